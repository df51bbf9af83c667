/* The FMI 3.0 face as a WebAssembly component (FMI-LS-WASM): each method in the form of the component model's canonical ABI, on the
   function of the standard. A list is its address and its count; a result that is more than one number is a record in memory.

   Compiled for WebAssembly alone. A component cannot be called from within a callback, so that there is no intermediate update. */
#ifdef __wasm__
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

#include "face.h"

#define EXPORT(name) __attribute__((export_name(name)))

typedef struct {
    const void *data;
    size_t count;
} List;

typedef struct {
    uint32_t reference, order;
} Request;

/* The result of a method, or a status: a list, or anything else, whose numbers of eight bytes begin at eight. */
typedef struct {
    bool failed;
    union {
        uint8_t status;
        List list;
    } is;
} Listed;

typedef struct {
    bool failed;
    union {
        uint8_t status;
        uint64_t count;
        struct {
            double time;
            bool event, terminate, early;
        } step;
        struct {
            bool again, terminate, nominals, values, given;
            double time;
        } event;
    } is;
} Outcome;

__attribute__((import_module("callbacks"), import_name("log-message"))) void host_log(const char *name, size_t name_size,
                                                                                      int status, const char *category,
                                                                                      size_t category_size, const char *message,
                                                                                      size_t message_size);

static void write_log(fmi3InstanceEnvironment name, fmi3Status status, fmi3String category, fmi3String message) {
    host_log(name, strlen(name), status, category, strlen(category), message, strlen(message));
}

/* Memory of a call: what the host hands over and what it is given, freed when the host has read the result. */

typedef struct Block Block;
struct Block {
    Block *next;
    double data[];
};
static Block *blocks;

EXPORT("cabi_realloc") void *space_again(void *old, size_t old_size, size_t align, size_t size) {
    (void)align; /* at most 8 */
    Block *block = malloc(sizeof *block + size);
    if (!block) __builtin_trap();
    if (old_size) memcpy(block->data, old, old_size < size ? old_size : size);
    block->next = blocks;
    blocks = block;
    return block->data;
}

EXPORT("forget") void forget_blocks(uint32_t result) {
    (void)result;
    for (Block *block = blocks, *next; block; block = next) {
        next = block->next;
        free(block);
    }
    blocks = NULL;
}

static void *space(size_t count, size_t size) {
    return space_again(NULL, 0, 8, count * size);
}

static char *text(const char *data, size_t size) {
    char *copy = space(size + 1, 1);
    if (size) memcpy(copy, data, size);
    copy[size] = '\0';
    return copy;
}

static Listed *listed(fmi3Status status, const void *data, size_t count) {
    static Listed result;
    result = (Listed){status > fmi3Warning, {.list = {data, count}}};
    if (result.failed) result.is.status = status;
    return &result;
}

static Outcome *outcome(fmi3Status status, Outcome found) {
    static Outcome result;
    result = found;
    result.failed = status > fmi3Warning;
    if (result.failed) result.is.status = status;
    return &result;
}

/* Life */

typedef struct {
    bool there;
    void *instance;
} Created;

static Created *created(char *name, fmi3Instance instance) {
    static Created result;
    result = (Created){instance != NULL, instance};
    if (!instance) free(name);
    return &result;
}

#define NAME char *own = strcpy(malloc(name_size + 1), text(name, name_size));

EXPORT("instantiate-co-simulation")
Created *make_co_simulation(const char *name, size_t name_size, const char *token, size_t token_size, const char *path,
                            size_t path_size, bool visible, bool logging, bool event_mode, bool early_return,
                            const uint32_t *intermediate, size_t count) {
    NAME return created(own, fmi3InstantiateCoSimulation(own, text(token, token_size), text(path, path_size), visible, logging,
                                                         event_mode, early_return, intermediate, count, own, write_log, NULL));
}

EXPORT("instantiate-model-exchange")
Created *make_model_exchange(const char *name, size_t name_size, const char *token, size_t token_size, const char *path,
                             size_t path_size, bool visible, bool logging) {
    NAME return created(own, fmi3InstantiateModelExchange(own, text(token, token_size), text(path, path_size), visible, logging,
                                                          own, write_log));
}

EXPORT("drop") void drop(Instance *c) {
    char *name = c->environment;
    fmi3FreeInstance(c);
    free(name);
}

EXPORT("get-version") List *version(void) {
    static List result;
    result = (List){fmi3GetVersion(), strlen(fmi3GetVersion())};
    return &result;
}

EXPORT("set-debug-logging") fmi3Status debug(void *c, bool on, const List *categories, size_t count) {
    const char **names = space(count, sizeof *names);
    for (size_t i = 0; i < count; i++) names[i] = text(categories[i].data, categories[i].count);
    return fmi3SetDebugLogging(c, on, count, names);
}

EXPORT("enter-initialization-mode")
fmi3Status initialize(void *c, bool tolerance_given, double tolerance, double start, bool stop_given, double stop) {
    return fmi3EnterInitializationMode(c, tolerance_given, tolerance, start, stop_given, stop);
}

#define CHANGE(name, method)                                                                                                   \
    EXPORT(method) fmi3Status do_##name(void *c) {                                                                             \
        return fmi3##name(c);                                                                                                  \
    }

CHANGE(ExitInitializationMode, "exit-initialization-mode")
CHANGE(EnterEventMode, "enter-event-mode")
CHANGE(Terminate, "terminate")
CHANGE(Reset, "reset")
CHANGE(EnterConfigurationMode, "enter-configuration-mode")
CHANGE(ExitConfigurationMode, "exit-configuration-mode")
CHANGE(EvaluateDiscreteStates, "evaluate-discrete-states")
CHANGE(EnterContinuousTimeMode, "enter-continuous-time-mode")
CHANGE(EnterStepMode, "enter-step-mode")

/* Values */

#define VALUES_OF(type, method)                                                                                                \
    EXPORT("get-" method) Listed *get_##type(void *c, const uint32_t *references, size_t count) {                              \
        fmi3##type *values = space(count, sizeof *values);                                                                     \
        return listed(fmi3Get##type(c, references, count, values, count), values, count);                                      \
    }                                                                                                                          \
    EXPORT("set-" method)                                                                                                      \
    fmi3Status set_##type(void *c, const uint32_t *references, size_t count, const fmi3##type *values, size_t value_count) {   \
        return fmi3Set##type(c, references, count, values, value_count);                                                       \
    }

VALUES_OF(Float32, "float32")
VALUES_OF(Float64, "float64")
VALUES_OF(Int8, "int8")
VALUES_OF(Int16, "int16")
VALUES_OF(Int32, "int32")
VALUES_OF(Int64, "int64")
VALUES_OF(UInt8, "uint8")
VALUES_OF(UInt16, "uint16")
VALUES_OF(UInt32, "uint32")
VALUES_OF(UInt64, "uint64")
VALUES_OF(Boolean, "boolean")

EXPORT("get-string") Listed *get_strings(void *c, const uint32_t *references, size_t count) {
    List *values = space(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        fmi3String value;
        fmi3Status status = fmi3GetString(c, references + i, 1, &value, 1);
        if (status > fmi3Warning) return listed(status, NULL, 0);
        /* the next call may change it */
        values[i] = (List){text(value, strlen(value)), strlen(value)};
    }
    return listed(fmi3OK, values, count);
}

/* What there is none of, see fmi3.c: only an empty list is right. */

#define NO_VALUES(name, method, ...)                                                                                           \
    EXPORT("get-" method) Listed *get_##name(void *c, const uint32_t *references, size_t count) {                              \
        return listed(fmi3Get##name(c, references, count, __VA_ARGS__), NULL, 0);                                              \
    }

#define NO_SETTING(name, method, ...)                                                                                          \
    EXPORT("set-" method)                                                                                                      \
    fmi3Status set_##name(void *c, const uint32_t *references, size_t count, const void *values, size_t value_count) {         \
        (void)values, (void)value_count;                                                                                       \
        return fmi3Set##name(c, references, count, __VA_ARGS__);                                                               \
    }

NO_VALUES(Binary, "binary", NULL, NULL, count)
NO_VALUES(Clock, "clock", NULL)
NO_VALUES(IntervalDecimal, "interval-decimal", NULL, NULL)
NO_VALUES(IntervalFraction, "interval-fraction", NULL, NULL, NULL)
NO_VALUES(ShiftDecimal, "shift-decimal", NULL)
NO_VALUES(ShiftFraction, "shift-fraction", NULL, NULL)
NO_SETTING(String, "string", NULL, count)
NO_SETTING(Binary, "binary", NULL, NULL, count)
NO_SETTING(Clock, "clock", NULL)
NO_SETTING(IntervalDecimal, "interval-decimal", NULL)
NO_SETTING(IntervalFraction, "interval-fraction", NULL, NULL)
NO_SETTING(ShiftDecimal, "shift-decimal", NULL)
NO_SETTING(ShiftFraction, "shift-fraction", NULL, NULL)

EXPORT("get-number-of-variable-dependencies") Outcome *count_dependencies(void *c, uint32_t reference) {
    size_t count = 0;
    fmi3Status status = fmi3GetNumberOfVariableDependencies(c, reference, &count);
    return outcome(status, (Outcome){.is.count = count});
}

EXPORT("get-variable-dependencies") Listed *dependencies(void *c, uint32_t reference) {
    return listed(fmi3GetVariableDependencies(c, reference, NULL, NULL, NULL, NULL, 0), NULL, 0);
}

/* Saved state: the bytes themselves */

EXPORT("get-fmu-state") Listed *get_state(void *c) {
    fmi3FMUState state = NULL;
    size_t size = 0;
    fmi3Byte *bytes = NULL;
    fmi3Status status = fmi3GetFMUState(c, &state);
    if (status <= fmi3Warning) status = fmi3SerializedFMUStateSize(c, state, &size);
    if (status <= fmi3Warning) status = fmi3SerializeFMUState(c, state, bytes = space(size, 1), size);
    if (state) fmi3FreeFMUState(c, &state);
    return listed(status, bytes, size);
}

EXPORT("set-fmu-state") fmi3Status set_state(void *c, const fmi3Byte *bytes, size_t size) {
    fmi3FMUState state = NULL;
    fmi3Status status = fmi3DeserializeFMUState(c, bytes, size, &state);
    if (status <= fmi3Warning) status = fmi3SetFMUState(c, state);
    if (state) fmi3FreeFMUState(c, &state);
    return status;
}

/* Derivatives */

#define DERIVATIVE(name, method, results)                                                                                      \
    EXPORT(method)                                                                                                             \
    Listed *along_##name(void *c, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns, size_t known_count,  \
                         const double *seed, size_t seed_count) {                                                              \
        double *values = space(results, sizeof *values);                                                                       \
        return listed(                                                                                                         \
            fmi3Get##name##Derivative(c, unknowns, unknown_count, knowns, known_count, seed, seed_count, values, results),     \
            values, results);                                                                                                  \
    }

DERIVATIVE(Directional, "get-directional-derivative", unknown_count)
DERIVATIVE(Adjoint, "get-adjoint-derivative", known_count)

/* FMI 3.0 has no function for it. */
static fmi3Status set_slopes(void *component, const Request requests[], size_t count, const double values[],
                             size_t value_count) {
    ALLOW_IN(CO_SIMULATION, INSTANTIATED | INITIALIZATION | STEP)
    if (!instance_counts(c, "set-input-derivatives", value_count, count)) return fmi3Error;
    EACH(instance_set_slope(c, "set-input-derivatives", requests[i].reference, requests[i].order, values[i]))
}

EXPORT("set-input-derivatives")
fmi3Status set_input_slopes(void *c, const Request *requests, size_t count, const double *values, size_t value_count) {
    return set_slopes(c, requests, count, values, value_count);
}

EXPORT("get-output-derivatives") Listed *get_output_slopes(void *c, const Request *requests, size_t count) {
    fmi3ValueReference *references = space(count, sizeof *references);
    fmi3Int32 *orders = space(count, sizeof *orders);
    double *values = space(count, sizeof *values);
    for (size_t i = 0; i < count; i++) references[i] = requests[i].reference, orders[i] = (fmi3Int32)requests[i].order;
    return listed(fmi3GetOutputDerivatives(c, references, count, orders, values, count), values, count);
}

/* Steps and events */

EXPORT("do-step") Outcome *step(void *c, double time, double size, bool no_going_back) {
    Outcome found = {.is.step = {.time = time}};
    fmi3Status status = fmi3DoStep(c, time, size, no_going_back, &found.is.step.event, &found.is.step.terminate,
                                   &found.is.step.early, &found.is.step.time);
    return outcome(status, found);
}

EXPORT("update-discrete-states") Outcome *update(void *c) {
    Outcome found = {0};
    fmi3Status status = fmi3UpdateDiscreteStates(c, &found.is.event.again, &found.is.event.terminate, &found.is.event.nominals,
                                                 &found.is.event.values, &found.is.event.given, &found.is.event.time);
    return outcome(status, found);
}

EXPORT("completed-integrator-step") uint8_t *completed(void *c, bool no_going_back) {
    static uint8_t result[3]; /* failed; the status, or event mode and the end */
    bool event = false, terminate = false;
    fmi3Status status = fmi3CompletedIntegratorStep(c, no_going_back, &event, &terminate);
    result[0] = status > fmi3Warning;
    result[1] = result[0] ? status : event;
    result[2] = terminate;
    return result;
}

/* Model exchange */

EXPORT("set-time") fmi3Status set_time(void *c, double time) {
    return fmi3SetTime(c, time);
}

EXPORT("set-continuous-states") fmi3Status set_states(void *c, const double *values, size_t count) {
    return fmi3SetContinuousStates(c, values, count);
}

#define STATES_OF(name, method, count)                                                                                         \
    EXPORT(method) Listed *get_##name(void *c) {                                                                               \
        double *values = space(count, sizeof *values);                                                                         \
        return listed(fmi3Get##name(c, values, count), values, count);                                                         \
    }

STATES_OF(ContinuousStates, "get-continuous-states", STATES)
STATES_OF(ContinuousStateDerivatives, "get-continuous-state-derivatives", STATES)
STATES_OF(NominalsOfContinuousStates, "get-nominals-of-continuous-states", STATES)
STATES_OF(EventIndicators, "get-event-indicators", 1)

#define NUMBER_OF(name, method)                                                                                                \
    EXPORT(method) Outcome *count_##name(void *c) {                                                                            \
        size_t count = 0;                                                                                                      \
        fmi3Status status = fmi3GetNumberOf##name(c, &count);                                                                  \
        return outcome(status, (Outcome){.is.count = count});                                                                  \
    }

NUMBER_OF(ContinuousStates, "get-number-of-continuous-states")
NUMBER_OF(EventIndicators, "get-number-of-event-indicators")
#endif
