/* What both faces share: an instance, the states it can be in, its values, its log, its saved state. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stddef.h>

#include "plant.h"

/* As in both standards. */
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;

/* Those of the log, as the bits of their statuses. */
enum { ALL_CATEGORIES = 1 << WARNING | 1 << DISCARD | 1 << ERROR | 1 << FATAL };

typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Interface;

/* States of an instance, to be combined where a function is allowed in several. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    INTERMEDIATE = 32,
    TERMINATED = 64,
    RUNNING = EVENT | CONTINUOUS | STEP | INTERMEDIATE,
    SETTLED = INITIALIZATION | RUNNING | TERMINATED
};

/* The numbers of model exchange: one for each state, and one event indicator. */
typedef enum { VALUES, DERIVATIVES, NOMINALS, INDICATORS } What;

typedef struct Instance Instance;

/* All that a saved state keeps: numbers, all of them double, and two sentences. */
typedef struct {
    Plant plant;
    double phase;
    double step;          /* the reason of the last step */
    double reason, cause; /* solver.status; the first reason since the last good step, other than steps out of order */
    char message[SENTENCE], cause_message[SENTENCE];
} Saved;

#define NUMBERS (offsetof(Saved, message) / sizeof(double))

/* Where the memory of an instance and of its saved states comes from: zeros, as calloc has them. Nothing is allocated in a step. */
typedef struct {
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
} Memory;

struct Instance {
    Saved s;
    Interface interface;
    Memory memory;
    int logging;  /* categories that are logged */
    bool stale;   /* the outputs are older than state and inputs */
    bool stopped; /* an early return at the limit of assembly */
    char *name;
    void (*log)(const Instance *c, Status status, const char *category, const char *message);
    void *environment;
    void (*logger)(void); /* of the face's own type */
    void (*update)(void);
    bool early_return;
    char *text; /* what the last get of a string returned */
};

LOCAL Instance *instance_new(const char *name, const char *token, Interface interface, Memory memory, bool logging,
                             void *environment, void (*log)(const Instance *, Status, const char *, const char *),
                             void (*logger)(void));
LOCAL void instance_free(Instance *c);
LOCAL void instance_reset(Instance *c);

/* Whether an instance is there and may be called this in its state: if not, that is said in the log. */
LOCAL bool instance_allows(Instance *c, const char *function, int phases);

/* Whether a count is right: if not, that is said in the log. */
LOCAL bool instance_counts(Instance *c, const char *function, size_t count, size_t right);

/* Log some categories, or all of them, or no longer. */
LOCAL Status instance_log(Instance *c, const char *function, bool on, size_t count, const char *const names[]);

/* Say a sentence, and return the status. */
LOCAL Status instance_say(const Instance *c, Status status, const char *format, ...);

LOCAL Status instance_setup(Instance *c, bool tolerance_given, double tolerance, double start, bool stop_given, double stop);
LOCAL Status instance_exit_initialization(Instance *c);

/* Values */
LOCAL Status instance_get(Instance *c, const char *function, unsigned reference, Kind kind, double *value);
LOCAL Status instance_get_integer(Instance *c, const char *function, unsigned reference, int *value);
LOCAL Status instance_get_text(Instance *c, const char *function, unsigned reference, const char **value);
LOCAL bool instance_may_set(Instance *c, const char *function, unsigned reference, Kind kind);
LOCAL void instance_set(Instance *c, unsigned reference, double value);
/* After a set, before which these were given: take tunable parameters, or none of what was set. */
LOCAL Status instance_tune(Instance *c, const char *function, const unsigned references[], size_t count,
                           const double before[VARIABLES]);
LOCAL Status instance_set_slope(Instance *c, const char *function, unsigned reference, int order, double slope);
LOCAL Status instance_output_slopes(Instance *c, const char *function, const unsigned references[], size_t count,
                                    const int orders[], double values[]);

/* The status of a call about `count` things of a kind that this FMU does not have. */
LOCAL Status instance_none(Instance *c, const char *function, size_t count);

LOCAL Status instance_step(Instance *c, double time, double step, const Watch *watch);

/* Number of the state that a value reference is of; -1 where it is none. */
LOCAL int instance_state(unsigned reference);

/* Model exchange */
/* WARNING, and a sentence, where commands contradicted their accelerations. */
LOCAL Status instance_check_commands(Instance *c);
LOCAL void instance_new_discrete_states(Instance *c, bool *terminate, bool *values_changed);
LOCAL Status instance_set_time(Instance *c, const char *function, double time);
LOCAL Status instance_set_states(Instance *c, const char *function, const double x[], size_t count);
LOCAL Status instance_get_states(Instance *c, const char *function, What what, double values[], size_t count);

/* Derivatives of unknowns with respect to knowns, times a change of these, or the unknowns' weights times them. */
LOCAL Status instance_directional(Instance *c, const char *function, bool adjoint, const unsigned unknowns[],
                                  size_t unknown_count, const unsigned knowns[], size_t known_count, const double seed[],
                                  double result[]);

/* Saved state */
LOCAL Status instance_save(Instance *c, void **state);
LOCAL Status instance_restore(Instance *c, const void *state);
LOCAL void instance_forget_saved(const Instance *c, void **state);
LOCAL size_t instance_serialized_size(const void *state);
LOCAL Status instance_serialize(Instance *c, const char *function, const void *state, char *text, size_t size);
LOCAL Status instance_deserialize(Instance *c, const char *text, size_t size, void **state);

#endif
