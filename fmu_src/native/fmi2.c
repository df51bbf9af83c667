/* The FMI 2.0 face: co-simulation and model exchange. */
#include <stdlib.h>

#include "fmi2Functions.h"

#define FMI(name) fmi2##name
#define STATE(verb, noun) fmi2##verb##FMUstate##noun
#define DESERIALIZE fmi2DeSerializeFMUstate

#include "face.h"

typedef fmi2ValueReference Reference;

/* For hosts that give no functions of their own. A target without a heap is compiled with NO_HEAP: its host must give them. */
#ifdef NO_HEAP
static const Memory HEAP = {NULL, NULL};
#else
static const Memory HEAP = {calloc, free};
#endif

static void log_message(const Instance *c, Status status, const char *category, const char *message) {
    if (c->logger) ((fmi2CallbackLogger)c->logger)(c->environment, c->name, (fmi2Status)status, category, "%s", message);
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources; /* nothing is read: any folder will do */
    (void)visible;
    if (!functions || (type != fmi2ModelExchange && type != fmi2CoSimulation)) return NULL;
    Memory memory = {functions->allocateMemory, functions->freeMemory};
    if (!memory.allocate || !memory.release) memory = HEAP;
    if (!memory.allocate) return NULL; /* NO_HEAP */
    return instance_new(name, guid, type == fmi2CoSimulation ? CO_SIMULATION : MODEL_EXCHANGE, memory, logging,
                        functions->componentEnvironment, log_message, (void (*)(void))functions->logger);
}

/* Life */

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_given, fmi2Real stop) {
    ALLOW(INSTANTIATED)
    RETURN(instance_setup(c, tolerance_given, tolerance, start, stop_given, stop));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    ALLOW(INSTANTIATED)
    c->s.phase = INITIALIZATION;
    return fmi2OK;
}

/* Values */

#define GET(type, call)                                                                                                        \
    fmi2Status fmi2Get##type(fmi2Component component, const Reference references[], size_t count, fmi2##type values[]) {       \
        ALLOW(SETTLED)                                                                                                         \
        NEED(ARRAYS)                                                                                                           \
        EACH(call)                                                                                                             \
    }

GET(Real, instance_get(c, __func__, references[i], REAL, &values[i]))
GET(Integer, instance_get_integer(c, __func__, references[i], &values[i]))
GET(String, instance_get_text(c, __func__, references[i], &values[i]))

fmi2Status fmi2SetReal(fmi2Component component, const Reference references[], size_t count, const fmi2Real values[]) {
    ALLOW(SETTABLE | CONTINUOUS)
    NEED(ARRAYS)
    bool free = c->s.phase == CONTINUOUS; /* states may be set by themselves */
    double x[STATES];
    memcpy(x, c->s.plant.x, sizeof x);
    for (size_t i = 0; i < count; i++)
        if (free && instance_state(references[i]) >= 0)
            x[instance_state(references[i])] = values[i];
        else if (!instance_may_set(c, __func__, references[i], REAL))
            return fmi2Error;
    Status status = free ? instance_set_states(c, __func__, x, STATES) : OK;
    double before[VARIABLES];
    memcpy(before, c->s.plant.given, sizeof before);
    for (size_t i = 0; i < count && status == OK; i++)
        if (!free || instance_state(references[i]) < 0) instance_set(c, references[i], values[i]);
    RETURN(status == OK ? instance_tune(c, __func__, references, count, before) : status);
}

fmi2Status fmi2SetInteger(fmi2Component component, const Reference references[], size_t count, const fmi2Integer values[]) {
    ALLOW(SETTABLE)
    NEED(ARRAYS)
    SET_EACH(INTEGER)
}

#define NONE(name, type, phases)                                                                                               \
    fmi2Status fmi2##name(fmi2Component component, const Reference references[], size_t count, type values[]) {                \
        (void)references, (void)values;                                                                                        \
        ALLOW(phases)                                                                                                          \
        RETURN(instance_none(c, __func__, count));                                                                             \
    }

NONE(SetString, const fmi2String, SETTABLE)
NONE(GetBoolean, fmi2Boolean, ANY_STATE)
NONE(SetBoolean, const fmi2Boolean, ANY_STATE)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const Reference unknowns[], size_t unknown_count,
                                        const Reference knowns[], size_t known_count, const fmi2Real change[],
                                        fmi2Real result[]) {
    ALLOW(SETTLED)
    NEED((unknown_count == 0 || (unknowns && result)) && (known_count == 0 || (knowns && change)))
    RETURN(instance_directional(c, __func__, false, unknowns, unknown_count, knowns, known_count, change, result));
}

/* Model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component component) {
    ALLOW(EVENT | CONTINUOUS)
    c->s.phase = EVENT;
    c->stale = true; /* the status was left as it was */
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info) {
    bool terminate, changed;
    ALLOW(EVENT)
    NEED(info)
    instance_new_discrete_states(c, &terminate, &changed);
    *info = (fmi2EventInfo){.terminateSimulation = terminate, .valuesOfContinuousStatesChanged = changed};
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time) {
    ALLOW(EVENT | CONTINUOUS)
    RETURN(instance_set_time(c, __func__, time));
}

GET_STATES(GetDerivatives, DERIVATIVES, WITH_STATES)
GET_STATES(GetNominalsOfContinuousStates, NOMINALS, INSTANTIATED | WITH_STATES)

/* Co-simulation */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const Reference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    ALLOW_IN(CO_SIMULATION, INSTANTIATED | INITIALIZATION | STEP)
    NEED(ARRAYS && (count == 0 || orders))
    EACH(instance_set_slope(c, __func__, references[i], orders[i], values[i]))
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const Reference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED)
    NEED(ARRAYS && (count == 0 || orders))
    RETURN(instance_output_slopes(c, __func__, references, count, orders, values));
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean no_going_back) {
    (void)no_going_back;
    ALLOW(STEP)
    RETURN(instance_step(c, time, step, NULL));
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    ALLOW_IN(CO_SIMULATION, ANY_STATE)
    SAY("%s: no step is ever pending", __func__);
}

#define GET_STATUS(name, type, wanted, found)                                                                                  \
    fmi2Status fmi2Get##name(fmi2Component component, const fmi2StatusKind kind, type *value) {                                \
        ALLOW_IN(CO_SIMULATION, STEP | TERMINATED)                                                                             \
        NEED(value)                                                                                                            \
        if (!(wanted)) SAY("%s: there is no status of kind %d", __func__, (int)kind);                                          \
        *value = found;                                                                                                        \
        return fmi2OK;                                                                                                         \
    }

GET_STATUS(Status, fmi2Status, kind == fmi2DoStepStatus, c->s.step == GOOD ? fmi2OK : fmi2Discard)
GET_STATUS(RealStatus, fmi2Real, kind == fmi2LastSuccessfulTime, c->s.plant.time)
/* true after every refused step: a master that does not look at its reason would repeat the step for ever */
GET_STATUS(BooleanStatus, fmi2Boolean, kind == fmi2Terminated, c->s.step != GOOD)
GET_STATUS(StringStatus, fmi2String, kind == fmi2DoStepStatus || kind == fmi2PendingStatus, c->s.message)

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)value;
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED)
    SAY("%s: there is no status of kind %d", __func__, (int)kind);
}
