/* What the shell knows of a mechanism: its sizes, its tables, its equations. All of it is generated when the FMU is built. */
#ifndef MODEL_H
#define MODEL_H

#include "sizes.h"

/* C has no arrays of no elements: a mechanism may have no inputs and no modes */
#define ROOM(count) ((count) > 0 ? (count) : 1)

typedef enum { REAL, INTEGER, STRING } Kind;

/* COMPUTED: outputs and locals */
typedef enum { PARAMETER, INPUT, COMPUTED } Causality;

/* What a parameter must be, beside finite. WITHIN: least <= value <= most */
typedef enum { ANY, NOT_NEGATIVE, POSITIVE, PLUS_OR_MINUS_ONE, WITHIN } Rule;

typedef struct {
    const char *name;
    const char *unit;
    Kind kind;
    Causality causality;
    double start; /* of a parameter or an input */
    int row;      /* of what is computed: its place among the rows, see below; of an input: its number */
    Rule rule;
    double least, most;
    const char *requirement; /* what would be right, as the end of the sentence "it must ..." */
} Variable;

/* Rows of what is computed: outputs, state, derivative of the state, the event indicator, time. */
enum { STATE_ROW = OUTPUTS, DERIVATIVE_ROW = STATE_ROW + STATES, MARGIN_ROW = DERIVATIVE_ROW + STATES, TIME_ROW, ROWS };

/* An input that commands the rate of a freedom, where the mode (-1: always) has the value. */
typedef struct {
    int input, rate, mode, value;
    int acceleration; /* the input that is the rate of the command */
} Command;

/* A least value of a parameter that depends on others, as equations_bounds computes it; %g in the text stands for it. */
typedef struct {
    int parameter;
    const char *requirement;
} Least;

/* The coordinates in words. */
typedef struct {
    const char *name, *unit;
} FreedomName;

extern const FreedomName freedoms[FREEDOMS];
extern const Variable variables[VARIABLES];
extern const int parameter_at[ROOM(PARAMETERS)], initial_at[2 * FREEDOMS], mode_at[ROOM(MODES)], input_at[ROOM(INPUTS)];
extern const int state_at[STATES];
extern const int tolerance_at, status_at, message_at;
extern const Command commands[ROOM(COMMANDS)];
extern const Least least[ROOM(BOUNDS)];

/* The equations, as CasADi writes them. x: state, m: modes, u: inputs, p: constants with the energy at the start after them,
   d: of a change, g: of a gradient. */
typedef int Equation(const double **arguments, double **results, int *iw, double *w, int memory);

Equation equations_bounds;        /* parameters -> bounds */
Equation equations_begin;         /* m, parameters, state as given, u -> p, x, scale */
Equation equations_begin_forward; /* ..., dparameters, dstate, du -> dp, dx */
Equation equations_begin_reverse; /* ..., gp, gx -> gparameters, gstate, gu */
Equation equations_derivative;    /* x, m, u, p -> x' */
Equation equations_outputs;       /* x, m, u, p -> y */
Equation equations_clearance;     /* x, m, u, p -> clearance */
Equation equations_jump;          /* x, m, u, p -> x */
Equation equations_following;     /* x, m, u, p, derivative of the motion -> x' where the motion is that of a jump to u */
Equation equations_jump_forward;  /* x, m, u, p, dx, du, dp -> dx */
Equation equations_jump_reverse;  /* x, m, u, p, gx -> gx, gu, gp */
Equation equations_forward;       /* x, m, u, p, dx, du, dp -> dy, dx', dclearance */
Equation equations_reverse;       /* x, m, u, p, gy, gx', gclearance -> gx, gu, gp */

#endif
