/* The FMU of probed.c as FMI 3.0: the same functions behind the other interface. */
#define EARLY INSTANTIATED
#include "probed.c"

#include "fmi3FunctionTypes.h"

/* The callbacks of FMI 2.0, whose logger hands on to that of FMI 3.0. */
typedef struct {
    fmi2CallbackFunctions callbacks;
    fmi3LogMessageCallback log;
    void *environment;
} Bridge;

static void hand_on(void *bridge, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...) {
    Bridge *b = bridge;
    (void)name;
    if (b->log) b->log(b->environment, (fmi3Status)status, category, message);
}

static fmi3Instance make(fmi2Type type, fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean logging, void *environment,
                         fmi3LogMessageCallback log) {
    Bridge *b = calloc(1, sizeof *b);
    b->callbacks.logger = hand_on;
    b->callbacks.componentEnvironment = b;
    b->log = log;
    b->environment = environment;
    fmi2Component made = fmi2Instantiate(name, type, token, resources, &b->callbacks, 0, logging);
    if (!made) free(b);
    return made;
}

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, void *environment, fmi3LogMessageCallback log) {
    (void)visible;
    return make(fmi2ModelExchange, name, token, resources, logging, environment, log);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
                                         fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
                                         void *environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)visible, (void)early, (void)required, (void)n, (void)update;
    return events ? NULL : make(fmi2CoSimulation, name, token, resources, logging, environment, log);
}

void fmi3FreeInstance(fmi3Instance c) {
    Instance *s = c;
    void *bridge = s ? (void *)s->callbacks : NULL;
    fmi2FreeInstance(c);
    free(bridge);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    return (fmi3Status)fmi2SetDebugLogging(c, on, n, categories);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean bounded, double tolerance, double start, fmi3Boolean ends, double stop) {
    fmi2Status status = fmi2SetupExperiment(c, bounded, tolerance, start, ends, stop);
    return (fmi3Status)(status ? status : fmi2EnterInitializationMode(c));
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    ENTER(CONTINUOUS);
    return (fmi3Status)fmi2EnterEventMode(s);
}

#define SAME(NAME2, NAME3) \
    fmi3Status fmi3##NAME3(fmi3Instance c) { return (fmi3Status)fmi2##NAME2(c); }
SAME(ExitInitializationMode, ExitInitializationMode)
SAME(Terminate, Terminate)
SAME(Reset, Reset)
SAME(EnterContinuousTimeMode, EnterContinuousTimeMode)

#define ACCESS(VERB, KIND2, KIND3, TYPE)                                                                                         \
    fmi3Status fmi3##VERB##KIND3(fmi3Instance c, const fmi3ValueReference vr[], size_t n, TYPE value[], size_t size) {           \
        Instance *s = c;                                                                                                         \
        if (s && n != size) return (fmi3Status)refuse(s, "the number of values is wrong");                                       \
        return (fmi3Status)fmi2##VERB##KIND2(c, vr, n, value);                                                                   \
    }
ACCESS(Get, Real, Float64, double)
ACCESS(Set, Real, Float64, const double)
ACCESS(Get, Integer, Int32, int)
ACCESS(Set, Integer, Int32, const int)
ACCESS(Get, String, String, fmi3String)
ACCESS(Set, String, String, const fmi3String)

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)fmi2GetFMUstate(c, state); }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return (fmi3Status)fmi2SetFMUstate(c, state); }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)fmi2FreeFMUstate(c, state); }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *n) { return (fmi3Status)fmi2SerializedFMUstateSize(c, state, n); }
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t n) {
    return (fmi3Status)fmi2SerializeFMUstate(c, state, (fmi2Byte *)bytes, n);
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t n, fmi3FMUState *state) {
    return (fmi3Status)fmi2DeSerializeFMUstate(c, (const fmi2Byte *)bytes, n, state);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknown[], size_t nu, const fmi3ValueReference known[],
                                        size_t nk, const double seed[], size_t ns, double result[], size_t nr) {
    ENTER(RUNNING);
    NEED(ns == nk && nr == nu);
    return (fmi3Status)fmi2GetDirectionalDerivative(s, unknown, nu, known, nk, seed, result);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknown[], size_t nu, const fmi3ValueReference known[],
                                    size_t nk, const double seed[], size_t ns, double result[], size_t nr) {
    ENTER(RUNNING);
    NEED(ns == nu && nr == nk && unknown && known && seed && result);
    for (size_t j = 0; j < nk; j++) {
        result[j] = 0;
        for (size_t i = 0; i < nu; i++) {
            double entry, along = fault("adjoint") ? -1 : 1;
            fmi2Status status = fmi2GetDirectionalDerivative(s, unknown + i, 1, known + j, 1, &along, &entry);
            if (status) return (fmi3Status)status;
            result[j] += entry * seed[i];
        }
    }
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
    ENTER(EVENT);
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *needed, fmi3Boolean *end, fmi3Boolean *nominals, fmi3Boolean *values,
                                    fmi3Boolean *defined, double *time) {
    ENTER(EVENT);
    NEED(needed && end && nominals && values && defined && time);
    *needed = *end = *nominals = *values = *defined = 0;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no, fmi3Boolean *event, fmi3Boolean *end) {
    ENTER(CONTINUOUS);
    NEED(event && end);
    fmi2Boolean events, ends;
    fmi2Status status = fmi2CompletedIntegratorStep(s, no, &events, &ends);
    *event = events, *end = ends;
    return (fmi3Status)status;
}

fmi3Status fmi3SetTime(fmi3Instance c, double time) { return (fmi3Status)fmi2SetTime(c, time); }
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const double x[], size_t n) { return (fmi3Status)fmi2SetContinuousStates(c, x, n); }
fmi3Status fmi3GetContinuousStates(fmi3Instance c, double x[], size_t n) { return (fmi3Status)fmi2GetContinuousStates(c, x, n); }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, double x[], size_t n) { return (fmi3Status)fmi2GetDerivatives(c, x, n); }
fmi3Status fmi3GetEventIndicators(fmi3Instance c, double z[], size_t n) { return (fmi3Status)fmi2GetEventIndicators(c, z, n); }
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, double x[], size_t n) { return (fmi3Status)one(c, x, n, 2, RUNNING); }

static fmi3Status count(fmi3Instance c, size_t *number, size_t value) {
    ENTER(ANY);
    NEED(number);
    *number = value;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) { return count(c, n, 1); }
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) { return count(c, n, 0); }

fmi3Status fmi3DoStep(fmi3Instance c, double time, double size, fmi3Boolean no, fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early,
                      double *reached) {
    ENTER(STEP);
    NEED(event && end && early && reached);
    fmi2Status status = fmi2DoStep(s, time, size, no);
    *event = *end = *early = 0;
    *reached = s->now.t;
    return (fmi3Status)status;
}

/* What is never allowed here, of no concern for arguments. */
#define NEVER(NAME) \
    fmi3Status fmi3##NAME(fmi3Instance c) { \
        ENTER(0); \
        return fmi3OK; \
    }
NEVER(EnterStepMode) NEVER(GetOutputDerivatives) NEVER(EnterConfigurationMode) NEVER(ExitConfigurationMode)
NEVER(ActivateModelPartition) NEVER(GetNumberOfVariableDependencies) NEVER(GetVariableDependencies)
NEVER(GetIntervalDecimal) NEVER(GetIntervalFraction) NEVER(SetIntervalDecimal) NEVER(SetIntervalFraction)
NEVER(GetShiftDecimal) NEVER(GetShiftFraction) NEVER(SetShiftDecimal) NEVER(SetShiftFraction)
void *fmi3InstantiateScheduledExecution(void) { return NULL; }

#define NONE(KIND) NEVER(Get##KIND) NEVER(Set##KIND)
NONE(Float32) NONE(Int8) NONE(UInt8) NONE(Int16) NONE(UInt16) NONE(UInt32) NONE(Int64) NONE(UInt64)
NONE(Boolean) NONE(Binary) NONE(Clock)
