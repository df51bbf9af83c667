/* A mechanism in motion: what is given, its state, and the step that takes it forward in time. The twin of linkwork.plant. */
#ifndef PLANT_H
#define PLANT_H

#include <stdbool.h>

#include "model.h"

enum { SENTENCE = 400 };

/* solver.status */
typedef enum {
    GOOD,
    STEP_OUT_OF_ORDER,
    INPUT_NOT_FINITE,
    LIMIT_OF_ASSEMBLY,
    TOLERANCE_NOT_MET,
    NOT_INITIALISED,
    BAD_PARAMETER,
    INTERNAL = 9
} Reason;

/* Numbers alone: a saved state is a copy of it. */
typedef struct {
    double given[VARIABLES];     /* parameters and inputs, by value reference */
    double slopes[ROOM(INPUTS)]; /* rates of change of the inputs over the next step */
    double last_slopes[ROOM(INPUTS)];
    double slopes_from;                                   /* time after the beginning of the step from which on they act */
    double seen[ROOM(INPUTS)], seen_slopes[ROOM(INPUTS)]; /* inputs when the watch looked last, and the rates up to then */
    double seen_time, moved;                              /* when that was; 1 where the watch changes inputs */
    double follows;                                       /* 1 in model exchange: commands act at every instant */
    double fresh[ROOM(COMMANDS)];                         /* 1 where the command was set since the last step (co-simulation) */
    double applied[ROOM(COMMANDS)];                       /* the commands at the last event, and its time (model exchange) */
    double applied_time;
    double modes[ROOM(MODES)];
    double p[CONSTANTS];
    double x[STATES];
    double scale[STATES];       /* magnitudes below which the error of a component is absolute */
    double outputs[OUTPUTS];    /* the last that could be computed */
    double derivative[STATES];  /* likewise */
    double twist[ROOM(TWISTS)]; /* angles of the springs whose turns are not counted, at the last step of the integrator */
    double slipped, slip_time;  /* 1 + number of the first that passed half a turn in the last step, and when; or 0 */
    double begun;               /* 1 where state and constants follow from what is given */
    double time, start_time, stop_time; /* infinite: none */
    double master_tolerance;            /* 0: none */
    double tolerance, step_size;
} Plant;

/* What a step calls after each step of the integrator but the last; it may change inputs, or shorten the duration. */
typedef struct {
    void (*call)(void *context, Plant *plant, double *end);
    void *context;
} Watch;

/* The inputs, and all that a run begins with, of what is given or of its change: parameters, state and inputs. A command in force
   is the rate of its freedom. */
LOCAL void plant_inputs(const Plant *a, double u[ROOM(INPUTS)]);
LOCAL void plant_split(const Plant *a, const double given[VARIABLES], double own[ROOM(PARAMETERS)], double state[2 * FREEDOMS],
                       double u[ROOM(INPUTS)]);

/* Put start values in the place of all that was given. */
LOCAL void plant_reset(Plant *a);

/* Constants and state from what is given; on failure the reason, with the sentence. */
LOCAL Reason plant_begin(Plant *a, char sentence[SENTENCE]);

/* Take parameters that were changed during a run; a spring does no work as its stiffness changes. On failure the reason, with the
   sentence, and those before return. */
LOCAL Reason plant_tune(Plant *a, const double before[VARIABLES], char sentence[SENTENCE]);

/* Go forward by a step under the inputs in force. A step that fails leaves all as it was. Where `early`, a step into the limit
   of assembly ends there and is good, with the reason LIMIT_OF_ASSEMBLY in `ended`. */
LOCAL Reason plant_step(Plant *a, double time, double step, const Watch *watch, bool early, Reason *ended,
                        char sentence[SENTENCE]);

/* Whether the links can be joined at a state, clear of the limit of assembly; if not, the sentence. */
LOCAL Reason plant_check_assembly(const Plant *a, const double x[STATES], char sentence[SENTENCE]);

/* Where the clearance is small: whether friction may jam the links there, and they are clear of the limit of assembly. */
LOCAL bool plant_jams(const Plant *a, const double x[STATES]);

/* The motion: the state with the commands applied, in co-simulation those that were set since the last step. */
LOCAL void plant_present(const Plant *a, double x[STATES]);

/* Model exchange. A command is followed: the motion has it at every instant, while the state that a solver integrates carries the
   momenta on, which do not depend on the rate of the command. At an event the state becomes the motion. */
LOCAL bool plant_jump(Plant *a); /* an event: whether the state changed */
LOCAL bool plant_state_derivative(const Plant *a, double derivative[STATES]);

/* All outputs anew; on failure the last good ones stay. */
LOCAL Reason plant_outputs(Plant *a, char sentence[SENTENCE]);
/* Whether a command stayed the same since the last event while its acceleration was not zero; the sentence. */
LOCAL bool plant_contradicted(const Plant *a, char sentence[SENTENCE]);
LOCAL bool plant_derivative(const Plant *a, double derivative[STATES]); /* of the motion */
LOCAL double plant_margin(const Plant *a);

/* Changes of all rows with those of what is given (by value reference) and of the state; `start`: at the start of a run, where
   state and constants follow from what is given, else a change of a command that is in force applies it. */
LOCAL void plant_forward(const Plant *a, bool start, const double given[VARIABLES], const double x[STATES], double rows[ROWS]);

/* The gradient of a weighted sum of rows; `commanded` as the commands whose inputs it is asked for. */
LOCAL void plant_reverse(const Plant *a, bool start, const double rows[ROWS], const bool commanded[ROOM(COMMANDS)],
                         double given[VARIABLES], double x[STATES]);

/* A number in words, with a decimal point where the host's locale has a comma. */
typedef char Digits[32];
LOCAL const char *digits(Digits text, double value);

#endif
