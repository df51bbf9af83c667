/* What the shell knows of a mechanism: its sizes, its tables, its equations. All of it is generated when the FMU is built. */
#ifndef MODEL_H
#define MODEL_H

#include <math.h>

#include "sizes.h"

/* In one file, all.c, everything but the functions of the standard is static, so that several FMUs link into one program. */
#ifdef ALL_IN_ONE
#define LOCAL static
#define TABLE static
#else
#define LOCAL
#define TABLE extern
#endif

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
    int tunable;  /* of a parameter: whether it may change during a run */
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

/* A spring whose whole turns are not counted: the output that is the angle by which it is twisted, and its name. */
typedef struct {
    int output;
    const char *spring;
} Twist;

/* The coordinates in words. */
typedef struct {
    const char *name, *unit;
} FreedomName;

TABLE const FreedomName freedoms[FREEDOMS];
TABLE const Variable variables[VARIABLES];
TABLE const int parameter_at[ROOM(PARAMETERS)], initial_at[2 * FREEDOMS], mode_at[ROOM(MODES)], input_at[ROOM(INPUTS)];
TABLE const int state_at[STATES];
TABLE const double reach[STATES]; /* largest change in a step of the integrator, relative to the scale */
TABLE const int tolerance_at, status_at, message_at;
TABLE const Command commands[ROOM(COMMANDS)];
TABLE const Least least[ROOM(BOUNDS)];
TABLE const Twist twists[ROOM(TWISTS)];

/* The equations, as CasADi writes them. x: state, m: modes, u: inputs, p: constants with the energy at the start after them,
   d: of a change, g: of a gradient. */
typedef int Equation(const double **arguments, double **results, int *iw, double *w, int memory);

LOCAL Equation equations_bounds;        /* parameters -> bounds */
LOCAL Equation equations_begin;         /* m, parameters, state as given, u -> p, x, scale */
LOCAL Equation equations_begin_forward; /* ..., dparameters, dstate, du -> dp, dx */
LOCAL Equation equations_begin_reverse; /* ..., gp, gx -> gparameters, gstate, gu */
LOCAL Equation equations_derivative;    /* x, m, u, p -> x' */
LOCAL Equation equations_outputs;       /* x, m, u, p -> y */
LOCAL Equation equations_clearance;     /* x, m, u, p -> clearance */
LOCAL Equation equations_apart;         /* x, p -> numbers of SAY_APART */
LOCAL Equation equations_jump;          /* x, m, u, p -> x */
LOCAL Equation equations_following;     /* x, m, u, p, derivative of the motion -> x' where the motion is that of a jump to u */
LOCAL Equation equations_jump_forward;  /* x, m, u, p, dx, du, dp -> dx */
LOCAL Equation equations_jump_reverse;  /* x, m, u, p, gx -> gx, gu, gp */
LOCAL Equation equations_forward;       /* x, m, u, p, dx, du, dp -> dy, dx', dclearance */
LOCAL Equation equations_reverse;       /* x, m, u, p, gy, gx', gclearance -> gx, gu, gp */

#endif
