/* The FMI 3.0 face: co-simulation and model exchange. */
#include <stdlib.h>

#include "fmi3Functions.h"

#define FMI(name) fmi3##name
#define STATE(verb, noun) fmi3##verb##FMUState##noun
#define DESERIALIZE fmi3DeserializeFMUState

#include "face.h"

typedef fmi3ValueReference Reference;

static const Memory HEAP = {calloc, free};

#define COUNTS(count, right)                                                                                                   \
    if (!instance_counts(c, __func__, count, right)) return fmi3Error;

static void log_message(const Instance *c, Status status, const char *category, const char *message) {
    if (c->logger) ((fmi3LogMessageCallback)c->logger)(c->environment, (fmi3Status)status, category, message);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    (void)resources; /* nothing is read: any folder will do */
    (void)visible;
    return instance_new(name, token, MODEL_EXCHANGE, HEAP, logging, environment, log_message, (void (*)(void))log);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const Reference intermediate[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    (void)resources, (void)visible;
    (void)intermediate, (void)intermediate_count; /* all of them */
    Instance *c = instance_new(name, token, CO_SIMULATION, HEAP, logging, environment, log_message, (void (*)(void))log);
    if (c && event_mode) {
        instance_say(c, ERROR, "%s: this FMU has no event mode in co-simulation", __func__);
        instance_free(c);
        return NULL;
    }
    if (c) {
        c->early_return = early_return;
        c->update = (void (*)(void))update;
    }
    return c;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                               fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                               fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock_update,
                                               fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock_update, (void)lock, (void)unlock;
    if (log) log(environment, fmi3Error, "logStatusError", "this FMU has no scheduled execution");
    return NULL;
}

/* Life */

fmi3Status fmi3EnterInitializationMode(fmi3Instance component, fmi3Boolean tolerance_given, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_given, fmi3Float64 stop) {
    ALLOW(INSTANTIATED)
    Status status = instance_setup(c, tolerance_given, tolerance, start, stop_given, stop);
    if (status == OK) c->s.phase = INITIALIZATION;
    RETURN(status);
}

/* Values */

#define GET(type, call)                                                                                                        \
    fmi3Status fmi3Get##type(fmi3Instance component, const Reference references[], size_t count, fmi3##type values[],          \
                             size_t value_count) {                                                                             \
        ALLOW(ANY_STATE)                                                                                                       \
        NEED(ARRAYS)                                                                                                           \
        COUNTS(value_count, count)                                                                                             \
        EACH(call)                                                                                                             \
    }

#define SET(type, phases, kind)                                                                                                \
    fmi3Status fmi3Set##type(fmi3Instance component, const Reference references[], size_t count, const fmi3##type values[],    \
                             size_t value_count) {                                                                             \
        ALLOW(phases)                                                                                                          \
        NEED(ARRAYS)                                                                                                           \
        COUNTS(value_count, count)                                                                                             \
        SET_EACH(kind)                                                                                                         \
    }

GET(Float64, instance_get(c, __func__, references[i], REAL, &values[i]))
GET(Int32, instance_get_integer(c, __func__, references[i], &values[i]))
GET(String, instance_get_text(c, __func__, references[i], &values[i]))
SET(Float64, SETTABLE | CONTINUOUS | INTERMEDIATE, REAL)
SET(Int32, SETTABLE, INTEGER)

/* What there is none of: strings to set, other types, clocks, structural parameters, dependencies by element, scheduled execution */

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define NONE(name, count, ...)                                                                                                 \
    fmi3Status fmi3##name(__VA_ARGS__) {                                                                                       \
        ALLOW(ANY_STATE)                                                                                                       \
        RETURN(instance_none(c, __func__, count));                                                                             \
    }

#define NONE_OF(type)                                                                                                          \
    NONE(Get##type, n, fmi3Instance component, const Reference references[], size_t n, fmi3##type values[], size_t count)      \
    NONE(Set##type, n, fmi3Instance component, const Reference references[], size_t n, const fmi3##type values[], size_t count)

#define NONE_FOR(name, ...) NONE(name, n, fmi3Instance component, const Reference references[], size_t n, __VA_ARGS__)

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(UInt64)
NONE_OF(Boolean)
NONE_FOR(SetString, const fmi3String values[], size_t count)
NONE_FOR(GetBinary, size_t sizes[], fmi3Binary values[], size_t count)
NONE_FOR(SetBinary, const size_t sizes[], const fmi3Binary values[], size_t count)
NONE_FOR(GetClock, fmi3Clock values[])
NONE_FOR(SetClock, const fmi3Clock values[])
NONE_FOR(GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NONE_FOR(GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NONE_FOR(GetShiftDecimal, fmi3Float64 shifts[])
NONE_FOR(GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NONE_FOR(SetIntervalDecimal, const fmi3Float64 intervals[])
NONE_FOR(SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NONE_FOR(SetShiftDecimal, const fmi3Float64 shifts[])
NONE_FOR(SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NONE(EnterConfigurationMode, 1, fmi3Instance component)
NONE(ExitConfigurationMode, 1, fmi3Instance component)
NONE(EvaluateDiscreteStates, 1, fmi3Instance component)
NONE(EnterStepMode, 1, fmi3Instance component) /* there is no event mode in co-simulation to come from */
NONE(ActivateModelPartition, 1, fmi3Instance component, Reference clock, fmi3Float64 time)
NONE(GetNumberOfVariableDependencies, 1, fmi3Instance component, Reference reference, size_t *count)
NONE(GetVariableDependencies, 1, fmi3Instance component, Reference dependent, size_t dependent_elements[],
     Reference independents[], size_t independent_elements[], fmi3DependencyKind kinds[], size_t count)

/* Derivatives */

#define GET_DERIVATIVE(name, adjoint, seeds, results)                                                                          \
    fmi3Status fmi3Get##name(fmi3Instance component, const Reference unknowns[], size_t unknown_count,                         \
                             const Reference knowns[], size_t known_count, const fmi3Float64 seed[], size_t seed_count,        \
                             fmi3Float64 result[], size_t result_count) {                                                      \
        ALLOW(SETTLED & ~INTERMEDIATE)                                                                                         \
        NEED((unknown_count == 0 || unknowns) && (known_count == 0 || knowns))                                                 \
        NEED((seed_count == 0 || seed) && (result_count == 0 || result))                                                       \
        COUNTS(seed_count, seeds)                                                                                              \
        COUNTS(result_count, results)                                                                                          \
        RETURN(instance_directional(c, __func__, adjoint, unknowns, unknown_count, knowns, known_count, seed, result));        \
    }

GET_DERIVATIVE(DirectionalDerivative, false, known_count, unknown_count)
GET_DERIVATIVE(AdjointDerivative, true, unknown_count, known_count)

/* Model exchange */

fmi3Status fmi3EnterEventMode(fmi3Instance component) {
    ALLOW(CONTINUOUS)
    c->s.phase = EVENT;
    c->stale = true; /* the status was left as it was */
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance component, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed, fmi3Boolean *next_event_given,
                                    fmi3Float64 *next_event) {
    ALLOW(EVENT)
    NEED(again && terminate && nominals_changed && values_changed && next_event_given && next_event)
    *again = *nominals_changed = *next_event_given = fmi3False;
    *next_event = 0.0;
    instance_new_discrete_states(c, terminate, values_changed);
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance component, fmi3Float64 time) {
    ALLOW(CONTINUOUS)
    RETURN(instance_set_time(c, __func__, time));
}

GET_STATES(GetContinuousStateDerivatives, DERIVATIVES, WITH_STATES)
GET_STATES(GetNominalsOfContinuousStates, NOMINALS, WITH_STATES)

#define GET_NUMBER(name, number)                                                                                               \
    fmi3Status fmi3Get##name(fmi3Instance component, size_t *count) {                                                          \
        ALLOW_IN(MODEL_EXCHANGE, ANY_STATE)                                                                                    \
        NEED(count)                                                                                                            \
        *count = number;                                                                                                       \
        return fmi3OK;                                                                                                         \
    }

GET_NUMBER(NumberOfContinuousStates, STATES)
GET_NUMBER(NumberOfEventIndicators, 1)

/* Co-simulation */

fmi3Status fmi3GetOutputDerivatives(fmi3Instance component, const Reference references[], size_t count,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count) {
    ALLOW_IN(CO_SIMULATION, STEP | INTERMEDIATE | TERMINATED)
    NEED(ARRAYS && (count == 0 || orders))
    COUNTS(value_count, count)
    RETURN(instance_output_slopes(c, __func__, references, count, orders, values));
}

/* The importer sees the state after a step of the integrator, and may set inputs or ask for the end of the step. */
static void intermediate_update(void *context, Plant *plant, double *end) {
    Instance *c = context;
    fmi3Boolean requested = fmi3False;
    fmi3Float64 time = plant->time;
    c->s.phase = INTERMEDIATE;
    c->stale = true;
    ((fmi3IntermediateUpdateCallback)c->update)(c->environment, plant->time, fmi3True, fmi3True, fmi3True, c->early_return,
                                                &requested, &time);
    c->s.phase = STEP;
    if (requested && c->early_return && time < *end) *end = time;
}

fmi3Status fmi3DoStep(fmi3Instance component, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_going_back,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful) {
    ALLOW(STEP)
    NEED(event_needed && terminate && early_return && last_successful)
    Watch watch = {intermediate_update, c};
    Status status = instance_step(c, time, step, c->update ? &watch : NULL);
    *event_needed = fmi3False;
    *terminate = c->stopped;
    *early_return = status == OK && c->s.plant.time < time + step;
    *last_successful = c->s.plant.time;
    RETURN(status);
}
