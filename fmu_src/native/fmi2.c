/* The FMI 2.0 face: co-simulation and model exchange. */
#include "fmi2Functions.h"

#include <string.h>

#include "instance.h"

#define ALLOW(phases)                                     \
    if (!instance_allows(component, __func__, phases))    \
        return fmi2Error;

/* A pointer that the standard wants: without it the call is an error, not a crash. */
#define NEED(condition)                                                                              \
    if (!(condition))                                                                                \
        return (fmi2Status)instance_say(component, ERROR, "%s: a pointer is missing", __func__);

static void log_message(const Instance *c, Status status, const char *category, const char *message)
{
    if (c->logger)
        ((fmi2CallbackLogger)c->logger)(c->environment, c->name, (fmi2Status)status, category, "%s", message);
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources; /* nothing is read: any folder will do */
    (void)visible;
    if (type != fmi2ModelExchange && type != fmi2CoSimulation)
        return NULL;
    return instance_new(name, guid, type == fmi2CoSimulation ? CO_SIMULATION : MODEL_EXCHANGE, logging,
                        functions ? functions->componentEnvironment : NULL, log_message,
                        functions ? (void (*)(void))functions->logger : NULL);
}

void fmi2FreeInstance(fmi2Component component)
{
    instance_free(component);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean logging, size_t count, const fmi2String categories[])
{
    Instance *c = component;
    (void)count;
    (void)categories; /* all of them */
    ALLOW(INSTANTIATED | SETTLED)
    c->logging = logging;
    return fmi2OK;
}

/* Life */

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_given, fmi2Real stop)
{
    ALLOW(INSTANTIATED)
    if (stop_given && !(stop > start))
        return (fmi2Status)instance_say(component, ERROR, "%s: the stop time must be after the start time", __func__);
    return (fmi2Status)instance_setup(component, tolerance_given, tolerance, start);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    ALLOW(INSTANTIATED)
    ((Instance *)component)->s.phase = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    ALLOW(INITIALIZATION)
    return (fmi2Status)instance_exit_initialization(component);
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    ALLOW(EVENT | CONTINUOUS | STEP)
    ((Instance *)component)->s.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    ALLOW(INSTANTIATED | SETTLED)
    instance_reset(component);
    return fmi2OK;
}

/* Values */

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    ALLOW(SETTLED)
    NEED(count == 0 || (references && values))
    for (size_t i = 0; i < count; i++)
        if (instance_get(component, __func__, references[i], REAL, &values[i]) != OK)
            return fmi2Error;
    return fmi2OK;
}

/* Enumerations are integers here. */
static Kind integer_kind(fmi2ValueReference reference)
{
    return reference < VARIABLES && variables[reference].kind == ENUMERATION ? ENUMERATION : INTEGER;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2Integer values[])
{
    ALLOW(SETTLED)
    NEED(count == 0 || (references && values))
    for (size_t i = 0; i < count; i++) {
        double value;
        if (instance_get(component, __func__, references[i], integer_kind(references[i]), &value) != OK)
            return fmi2Error;
        values[i] = (fmi2Integer)value;
    }
    return fmi2OK;
}

/* There are no variables of this type. */
static fmi2Status none(Instance *component, const char *function, size_t count)
{
    ALLOW(INSTANTIATED | SETTLED)
    return count == 0 ? fmi2OK : (fmi2Status)instance_say(component, ERROR, "%s: there are no such variables", function);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2Boolean values[])
{
    (void)references;
    (void)values;
    return none(component, __func__, count);
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2String values[])
{
    ALLOW(SETTLED)
    NEED(count == 0 || (references && values))
    for (size_t i = 0; i < count; i++)
        if (instance_get_text(component, __func__, references[i], &values[i]) != OK)
            return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    ALLOW(INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP)
    NEED(count == 0 || (references && values))
    for (size_t i = 0; i < count; i++)
        if (instance_set(component, __func__, references[i], REAL, values[i]) != OK)
            return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference references[], size_t count, const fmi2Integer values[])
{
    ALLOW(INSTANTIATED | INITIALIZATION | EVENT | STEP)
    NEED(count == 0 || (references && values))
    for (size_t i = 0; i < count; i++)
        if (instance_set(component, __func__, references[i], integer_kind(references[i]), values[i]) != OK)
            return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t count, const fmi2Boolean values[])
{
    (void)references;
    (void)values;
    return none(component, __func__, count);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference references[], size_t count, const fmi2String values[])
{
    (void)values;
    ALLOW(INSTANTIATED | INITIALIZATION | EVENT | STEP)
    NEED(count == 0 || references)
    for (size_t i = 0; i < count; i++)
        if (instance_set(component, __func__, references[i], STRING, 0.0) != OK)
            return fmi2Error;
    return fmi2OK;
}

/* Saved state */

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ALLOW(INSTANTIATED | SETTLED)
    NEED(state)
    return (fmi2Status)instance_save(component, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    ALLOW(INSTANTIATED | SETTLED)
    return (fmi2Status)instance_restore(component, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    ALLOW(INSTANTIATED | SETTLED)
    instance_forget_saved(state);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    ALLOW(INSTANTIATED | SETTLED)
    NEED(state && size)
    *size = instance_serialized_size(state);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    ALLOW(INSTANTIATED | SETTLED)
    NEED(state && bytes)
    return (fmi2Status)instance_serialize(component, __func__, state, bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    ALLOW(INSTANTIATED | SETTLED)
    NEED(bytes && state)
    return (fmi2Status)instance_deserialize(component, bytes, size, state);
}

fmi2Status fmi2GetDirectionalDerivative(
    fmi2Component component, const fmi2ValueReference unknowns[], size_t unknown_count, const fmi2ValueReference knowns[],
    size_t known_count, const fmi2Real change[], fmi2Real result[])
{
    ALLOW(INITIALIZATION | EVENT | CONTINUOUS | STEP | TERMINATED)
    NEED((unknown_count == 0 || (unknowns && result)) && (known_count == 0 || (knowns && change)))
    return (fmi2Status)instance_directional(component, __func__, false, unknowns, unknown_count, knowns, known_count, change, result);
}

/* Model exchange */

#define ALLOW_EXCHANGE(phases)                                                                       \
    ALLOW(phases)                                                                                    \
    if (((Instance *)component)->interface != MODEL_EXCHANGE)                                        \
        return (fmi2Status)instance_say(component, ERROR, "%s: not allowed in co-simulation", __func__);

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    ALLOW_EXCHANGE(EVENT | CONTINUOUS)
    ((Instance *)component)->s.phase = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    bool terminate, changed;
    ALLOW_EXCHANGE(EVENT)
    NEED(info)
    Status status = instance_new_discrete_states(component, &terminate, &changed);
    *info = (fmi2EventInfo){.terminateSimulation = terminate, .valuesOfContinuousStatesChanged = changed};
    return (fmi2Status)status;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    ALLOW_EXCHANGE(EVENT)
    ((Instance *)component)->s.phase = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean no_going_back, fmi2Boolean *enter_event_mode,
                                       fmi2Boolean *terminate)
{
    (void)no_going_back;
    ALLOW_EXCHANGE(CONTINUOUS)
    NEED(enter_event_mode && terminate)
    *enter_event_mode = fmi2False;
    *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time)
{
    ALLOW_EXCHANGE(EVENT | CONTINUOUS)
    return (fmi2Status)instance_set_time(component, time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t count)
{
    ALLOW_EXCHANGE(CONTINUOUS)
    NEED(x)
    return (fmi2Status)instance_set_states(component, __func__, x, count);
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real derivatives[], size_t count)
{
    ALLOW_EXCHANGE(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED)
    NEED(derivatives)
    return (fmi2Status)instance_derivatives(component, __func__, derivatives, count);
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real indicators[], size_t count)
{
    ALLOW_EXCHANGE(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED)
    NEED(indicators)
    return (fmi2Status)instance_indicators(component, __func__, indicators, count);
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t count)
{
    ALLOW_EXCHANGE(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED)
    NEED(x)
    return (fmi2Status)instance_states(component, __func__, x, count);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real nominals[], size_t count)
{
    ALLOW_EXCHANGE(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED)
    NEED(nominals)
    return (fmi2Status)instance_nominals(component, __func__, nominals, count);
}

/* Co-simulation */

#define ALLOW_SIMULATION(phases)                                                                     \
    ALLOW(phases)                                                                                    \
    if (((Instance *)component)->interface != CO_SIMULATION)                                         \
        return (fmi2Status)instance_say(component, ERROR, "%s: not allowed in model exchange", __func__);

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    ALLOW_SIMULATION(INITIALIZATION | STEP)
    NEED(count == 0 || (references && orders && values))
    for (size_t i = 0; i < count; i++)
        if (instance_set_slope(component, __func__, references[i], orders[i], values[i]) != OK)
            return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[])
{
    ALLOW_SIMULATION(STEP | TERMINATED)
    NEED(count == 0 || (references && orders && values))
    return (fmi2Status)instance_output_slopes(component, __func__, references, count, orders, values);
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean no_going_back)
{
    (void)no_going_back;
    ALLOW_SIMULATION(STEP)
    return (fmi2Status)instance_step(component, time, step, NULL);
}

fmi2Status fmi2CancelStep(fmi2Component component)
{
    ALLOW_SIMULATION(0) /* no step is ever pending */
    return fmi2Error;
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value)
{
    ALLOW_SIMULATION(STEP | TERMINATED)
    NEED(value)
    if (kind != fmi2DoStepStatus)
        return (fmi2Status)instance_say(component, ERROR, "%s: there is no status of kind %d", __func__, (int)kind);
    *value = ((Instance *)component)->s.reason == GOOD ? fmi2OK : fmi2Discard;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
{
    ALLOW_SIMULATION(STEP | TERMINATED)
    NEED(value)
    if (kind != fmi2LastSuccessfulTime)
        return (fmi2Status)instance_say(component, ERROR, "%s: there is no status of kind %d", __func__, (int)kind);
    *value = ((Instance *)component)->s.plant.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)value;
    ALLOW_SIMULATION(STEP | TERMINATED)
    return (fmi2Status)instance_say(component, ERROR, "%s: there is no status of kind %d", __func__, (int)kind);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value)
{
    ALLOW_SIMULATION(STEP | TERMINATED)
    NEED(value)
    if (kind != fmi2Terminated)
        return (fmi2Status)instance_say(component, ERROR, "%s: there is no status of kind %d", __func__, (int)kind);
    *value = ((Instance *)component)->s.reason == LIMIT_OF_ASSEMBLY;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value)
{
    ALLOW_SIMULATION(STEP | TERMINATED)
    NEED(value)
    if (kind != fmi2DoStepStatus && kind != fmi2PendingStatus)
        return (fmi2Status)instance_say(component, ERROR, "%s: there is no status of kind %d", __func__, (int)kind);
    return (fmi2Status)instance_get_text(component, __func__, (unsigned)message_at, value);
}
