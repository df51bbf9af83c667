/* The FMI 3.0 face: co-simulation and model exchange. */
#include "fmi3Functions.h"

#include "instance.h"

#define ALLOW(phases)                                 \
    if (!instance_allows(instance, __func__, phases)) \
        return fmi3Error;

/* A pointer that the standard wants: without it the call is an error, not a crash. */
#define NEED(condition)                                                                             \
    if (!(condition))                                                                               \
        return (fmi3Status)instance_say(instance, ERROR, "%s: a pointer is missing", __func__);

#define COUNTS(count, right)                                     \
    if (!instance_counts(instance, __func__, count, right))      \
        return fmi3Error;

enum { ANY_STATE = INSTANTIATED | SETTLED };

static void log_message(const Instance *c, Status status, const char *category, const char *message)
{
    if (c->logger)
        ((fmi3LogMessageCallback)c->logger)(c->environment, (fmi3Status)status, category, message);
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log)
{
    (void)resources; /* nothing is read: any folder will do */
    (void)visible;
    return instance_new(name, token, MODEL_EXCHANGE, logging, environment, log_message, (void (*)(void))log);
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
    fmi3Boolean early_return, const fmi3ValueReference intermediate[], size_t intermediate_count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)resources;
    (void)visible;
    (void)intermediate; /* all of them */
    (void)intermediate_count;
    Instance *c = instance_new(name, token, CO_SIMULATION, logging, environment, log_message, (void (*)(void))log);
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

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock_update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock_update, (void)lock, (void)unlock;
    if (log)
        log(environment, fmi3Error, "logStatusError", "this FMU has no scheduled execution");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    instance_free(instance);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean logging, size_t count, const fmi3String categories[])
{
    (void)count;
    (void)categories; /* all of them */
    ALLOW(ANY_STATE)
    ((Instance *)instance)->logging = logging;
    return fmi3OK;
}

/* Life */

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_given, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_given, fmi3Float64 stop)
{
    ALLOW(INSTANTIATED)
    if (stop_given && !(stop > start))
        return (fmi3Status)instance_say(instance, ERROR, "%s: the stop time must be after the start time", __func__);
    Status status = instance_setup(instance, tolerance_given, tolerance, start);
    if (status == OK)
        ((Instance *)instance)->s.phase = INITIALIZATION;
    return (fmi3Status)status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    ALLOW(INITIALIZATION)
    return (fmi3Status)instance_exit_initialization(instance);
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    ALLOW(EVENT | CONTINUOUS | STEP)
    ((Instance *)instance)->s.phase = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    ALLOW(ANY_STATE & ~INTERMEDIATE)
    instance_reset(instance);
    return fmi3OK;
}

/* What this FMU has none of: clocks, structural parameters, dependencies by element, scheduled execution */

static fmi3Status unsupported(Instance *instance, const char *function, size_t count)
{
    if (!instance_allows(instance, function, ANY_STATE))
        return fmi3Error;
    return count == 0 ? fmi3OK : (fmi3Status)instance_say(instance, ERROR, "%s: this FMU has nothing of the kind", function);
}

#define NONE_OF_TYPE(type)                                                                                              \
    fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,                \
                             fmi3##type values[], size_t value_count)                                                   \
    {                                                                                                                   \
        (void)references, (void)values;                                                                                 \
        return unsupported(instance, __func__, count + value_count);                                                    \
    }                                                                                                                   \
    fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,                \
                             const fmi3##type values[], size_t value_count)                                             \
    {                                                                                                                   \
        (void)references, (void)values;                                                                                 \
        return unsupported(instance, __func__, count + value_count);                                                    \
    }

NONE_OF_TYPE(Float32)
NONE_OF_TYPE(Int8)
NONE_OF_TYPE(UInt8)
NONE_OF_TYPE(Int16)
NONE_OF_TYPE(UInt16)
NONE_OF_TYPE(UInt32)
NONE_OF_TYPE(UInt64)
NONE_OF_TYPE(Boolean)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t count, size_t sizes[],
                         fmi3Binary values[], size_t value_count)
{
    (void)references, (void)sizes, (void)values;
    return unsupported(instance, __func__, count + value_count);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t count, const size_t sizes[],
                         const fmi3Binary values[], size_t value_count)
{
    (void)references, (void)sizes, (void)values;
    return unsupported(instance, __func__, count + value_count);
}

#define NONE_OF_CLOCKS(name, ...)                                                                                       \
    fmi3Status fmi3##name(fmi3Instance instance, const fmi3ValueReference references[], size_t count, __VA_ARGS__)      \
    {                                                                                                                   \
        (void)references;                                                                                               \
        return unsupported(instance, __func__, count);                                                                  \
    }

#ifdef __clang__
#pragma clang diagnostic ignored "-Wunused-parameter"
#elif defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

NONE_OF_CLOCKS(GetClock, fmi3Clock values[])
NONE_OF_CLOCKS(SetClock, const fmi3Clock values[])
NONE_OF_CLOCKS(GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NONE_OF_CLOCKS(GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NONE_OF_CLOCKS(GetShiftDecimal, fmi3Float64 shifts[])
NONE_OF_CLOCKS(GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NONE_OF_CLOCKS(SetIntervalDecimal, const fmi3Float64 intervals[])
NONE_OF_CLOCKS(SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NONE_OF_CLOCKS(SetShiftDecimal, const fmi3Float64 shifts[])
NONE_OF_CLOCKS(SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    return unsupported(instance, __func__, 1);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return unsupported(instance, __func__, 1);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return unsupported(instance, __func__, 1);
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return unsupported(instance, __func__, 1); /* there is no event mode in co-simulation to come from */
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    return unsupported(instance, __func__, 1);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference, size_t *count)
{
    return unsupported(instance, __func__, 1);
}

fmi3Status fmi3GetVariableDependencies(
    fmi3Instance instance, fmi3ValueReference dependent, size_t dependent_elements[], fmi3ValueReference independents[],
    size_t independent_elements[], fmi3DependencyKind kinds[], size_t count)
{
    return unsupported(instance, __func__, 1);
}

/* Values */

#define GET(type, kind)                                                                                                 \
    fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,                \
                             fmi3##type values[], size_t value_count)                                                   \
    {                                                                                                                   \
        ALLOW(SETTLED)                                                                                                  \
        NEED(count == 0 || (references && values))                                                                      \
        COUNTS(value_count, count)                                                                                      \
        for (size_t i = 0; i < count; i++) {                                                                            \
            double value;                                                                                               \
            if (instance_get(instance, __func__, references[i], kind, &value) != OK)                                    \
                return fmi3Error;                                                                                       \
            values[i] = (fmi3##type)value;                                                                              \
        }                                                                                                               \
        return fmi3OK;                                                                                                  \
    }

#define SET(type, kind, phases)                                                                                         \
    fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,                \
                             const fmi3##type values[], size_t value_count)                                             \
    {                                                                                                                   \
        ALLOW(phases)                                                                                                   \
        NEED(count == 0 || (references && values))                                                                      \
        COUNTS(value_count, count)                                                                                      \
        for (size_t i = 0; i < count; i++)                                                                              \
            if (instance_set(instance, __func__, references[i], kind, (double)values[i]) != OK)                         \
                return fmi3Error;                                                                                       \
        return fmi3OK;                                                                                                  \
    }

GET(Float64, REAL)
GET(Int32, INTEGER)
GET(Int64, ENUMERATION)
SET(Float64, REAL, INSTANTIATED | INITIALIZATION | RUNNING)
SET(Int32, INTEGER, INSTANTIATED | INITIALIZATION | EVENT | STEP)
SET(Int64, ENUMERATION, INSTANTIATED | INITIALIZATION | EVENT | STEP)

fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3String values[],
                         size_t value_count)
{
    ALLOW(SETTLED)
    NEED(count == 0 || (references && values))
    COUNTS(value_count, count)
    for (size_t i = 0; i < count; i++)
        if (instance_get_text(instance, __func__, references[i], &values[i]) != OK)
            return fmi3Error;
    return fmi3OK;
}

fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3String values[],
                         size_t value_count)
{
    ALLOW(INSTANTIATED | INITIALIZATION | EVENT | STEP)
    NEED(count == 0 || references)
    for (size_t i = 0; i < count; i++)
        if (instance_set(instance, __func__, references[i], STRING, 0.0) != OK)
            return fmi3Error;
    return fmi3OK;
}

/* Saved state */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    ALLOW(ANY_STATE & ~INTERMEDIATE)
    NEED(state)
    return (fmi3Status)instance_save(instance, state);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    ALLOW(ANY_STATE & ~INTERMEDIATE)
    return (fmi3Status)instance_restore(instance, state);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    ALLOW(ANY_STATE)
    instance_forget_saved(state);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    ALLOW(ANY_STATE)
    NEED(state && size)
    *size = instance_serialized_size(state);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    ALLOW(ANY_STATE)
    NEED(state && bytes)
    return (fmi3Status)instance_serialize(instance, __func__, state, (char *)bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    ALLOW(ANY_STATE)
    NEED(bytes && state)
    return (fmi3Status)instance_deserialize(instance, (const char *)bytes, size, state);
}

/* Derivatives */

fmi3Status fmi3GetDirectionalDerivative(
    fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknown_count, const fmi3ValueReference knowns[],
    size_t known_count, const fmi3Float64 seed[], size_t seed_count, fmi3Float64 result[], size_t result_count)
{
    ALLOW(SETTLED & ~INTERMEDIATE)
    NEED((unknown_count == 0 || (unknowns && result)) && (known_count == 0 || (knowns && seed)))
    COUNTS(seed_count, known_count)
    COUNTS(result_count, unknown_count)
    return (fmi3Status)instance_directional(instance, __func__, false, unknowns, unknown_count, knowns, known_count, seed, result);
}

fmi3Status fmi3GetAdjointDerivative(
    fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknown_count, const fmi3ValueReference knowns[],
    size_t known_count, const fmi3Float64 seed[], size_t seed_count, fmi3Float64 result[], size_t result_count)
{
    ALLOW(SETTLED & ~INTERMEDIATE)
    NEED((unknown_count == 0 || (unknowns && seed)) && (known_count == 0 || (knowns && result)))
    COUNTS(seed_count, unknown_count)
    COUNTS(result_count, known_count)
    return (fmi3Status)instance_directional(instance, __func__, true, unknowns, unknown_count, knowns, known_count, seed, result);
}

/* Model exchange */

#define ALLOW_EXCHANGE(phases)                                                                       \
    ALLOW(phases)                                                                                    \
    if (((Instance *)instance)->interface != MODEL_EXCHANGE)                                         \
        return (fmi3Status)instance_say(instance, ERROR, "%s: not allowed in co-simulation", __func__);

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    ALLOW_EXCHANGE(CONTINUOUS)
    ((Instance *)instance)->s.phase = EVENT;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(
    fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
    fmi3Boolean *next_event_given, fmi3Float64 *next_event)
{
    bool ended, changed;
    ALLOW_EXCHANGE(EVENT)
    NEED(again && terminate && nominals_changed && values_changed && next_event_given && next_event)
    Status status = instance_new_discrete_states(instance, &ended, &changed);
    *again = *nominals_changed = *next_event_given = fmi3False;
    *terminate = ended;
    *values_changed = changed;
    *next_event = 0.0;
    return (fmi3Status)status;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    ALLOW_EXCHANGE(EVENT)
    ((Instance *)instance)->s.phase = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_going_back, fmi3Boolean *enter_event_mode,
                                       fmi3Boolean *terminate)
{
    ALLOW_EXCHANGE(CONTINUOUS)
    NEED(enter_event_mode && terminate)
    *enter_event_mode = fmi3False;
    *terminate = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    ALLOW_EXCHANGE(CONTINUOUS)
    return (fmi3Status)instance_set_time(instance, time);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 x[], size_t count)
{
    ALLOW_EXCHANGE(CONTINUOUS)
    NEED(x)
    return (fmi3Status)instance_set_states(instance, __func__, x, count);
}

#define GET_STATES(name, from)                                                                     \
    fmi3Status fmi3Get##name(fmi3Instance instance, fmi3Float64 values[], size_t count)            \
    {                                                                                              \
        ALLOW_EXCHANGE(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED)                           \
        NEED(values)                                                                               \
        return (fmi3Status)from(instance, __func__, values, count);                                \
    }

GET_STATES(ContinuousStates, instance_states)
GET_STATES(ContinuousStateDerivatives, instance_derivatives)
GET_STATES(NominalsOfContinuousStates, instance_nominals)
GET_STATES(EventIndicators, instance_indicators)

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *count)
{
    ALLOW_EXCHANGE(ANY_STATE)
    NEED(count)
    *count = 1;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *count)
{
    ALLOW_EXCHANGE(ANY_STATE)
    NEED(count)
    *count = STATES;
    return fmi3OK;
}

/* Co-simulation */

#define ALLOW_SIMULATION(phases)                                                                     \
    ALLOW(phases)                                                                                    \
    if (((Instance *)instance)->interface != CO_SIMULATION)                                          \
        return (fmi3Status)instance_say(instance, ERROR, "%s: not allowed in model exchange", __func__);

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count)
{
    ALLOW_SIMULATION(STEP | INTERMEDIATE | TERMINATED)
    NEED(count == 0 || (references && orders && values))
    COUNTS(value_count, count)
    return (fmi3Status)instance_output_slopes(instance, __func__, references, count, orders, values);
}

/* The importer sees the state after a step of the integrator, and may set inputs or ask for the end of the step. */
static void intermediate_update(void *context, Plant *plant, double *end)
{
    Instance *c = context;
    fmi3Boolean requested = fmi3False;
    fmi3Float64 time = plant->time;
    c->s.phase = INTERMEDIATE;
    c->stale = true;
    ((fmi3IntermediateUpdateCallback)c->update)(
        c->environment, plant->time, fmi3True, fmi3True, fmi3True, c->early_return, &requested, &time);
    c->s.phase = STEP;
    if (requested && c->early_return && time < *end)
        *end = time;
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_going_back, fmi3Boolean *event_needed,
    fmi3Boolean *terminate, fmi3Boolean *early_return, fmi3Float64 *last_successful)
{
    Instance *c = instance;
    Watch watch = {intermediate_update, c};
    ALLOW_SIMULATION(STEP)
    NEED(event_needed && terminate && early_return && last_successful)
    Status status = instance_step(c, time, step, c->update ? &watch : NULL);
    *event_needed = fmi3False;
    *terminate = c->stopped;
    *early_return = status == OK && c->s.plant.time < time + step;
    *last_successful = c->s.plant.time;
    return (fmi3Status)status;
}
