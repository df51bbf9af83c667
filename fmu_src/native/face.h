/* What both faces have in common: the checks of every call, and the functions that both standards have alike.

   A face defines the names of its standard before: FMI(Status) is fmi2Status or fmi3Status, STATE(Get, ) is fmi2GetFMUstate or
   fmi3GetFMUState, DESERIALIZE the one that these two spell differently. */
#ifndef FACE_H
#define FACE_H

#include <fenv.h>
#include <string.h>

#include "instance.h"

#define RETURN(status) return (FMI(Status))(status)

#define SAY(...) RETURN(instance_say(c, ERROR, __VA_ARGS__))

/* Arithmetic that is not defined gives NaN, which is looked for: a host that traps it must not end. Its traps come back at the end of
   the call. On Windows they are off unless a host of GCC's kind sets them. */
#ifdef __GNUC__
static inline void restore_traps(fenv_t *kept) {
    fesetenv(kept);
}
#define WITHOUT_TRAPS                                                                                                          \
    fenv_t kept_traps __attribute__((cleanup(restore_traps)));                                                                 \
    feholdexcept(&kept_traps);
#else
#define WITHOUT_TRAPS
#endif

/* The call is allowed in these states. */
#define ALLOW(phases)                                                                                                          \
    WITHOUT_TRAPS                                                                                                              \
    Instance *c = component;                                                                                                   \
    if (!instance_allows(c, __func__, phases)) return FMI(Error);

/* A pointer that the standard wants: without it the call is an error, not a crash. */
#define NEED(condition)                                                                                                        \
    if (!(condition)) SAY("%s: a pointer is missing", __func__);

#define ALLOW_IN(type, phases)                                                                                                 \
    ALLOW(phases)                                                                                                              \
    if (c->interface != (type))                                                                                                \
        SAY("%s: not allowed in %s", __func__, (type) == CO_SIMULATION ? "model exchange" : "co-simulation");

#define ARRAYS (count == 0 || (references && values))

#define EACH(call)                                                                                                             \
    Status status = OK;                                                                                                        \
    for (size_t i = 0; i < count; i++)                                                                                         \
        if ((status = (call)) != OK) RETURN(status);                                                                           \
    return FMI(OK);

/* All of them, or none. */
#define SET_EACH(kind)                                                                                                         \
    for (size_t i = 0; i < count; i++)                                                                                         \
        if (!instance_may_set(c, __func__, references[i], kind)) return FMI(Error);                                            \
    double before[VARIABLES];                                                                                                  \
    memcpy(before, c->s.plant.given, sizeof before);                                                                           \
    for (size_t i = 0; i < count; i++) instance_set(c, references[i], values[i]);                                              \
    RETURN(instance_tune(c, __func__, references, count, before));

enum {
    ANY_STATE = INSTANTIATED | SETTLED,
    WITH_STATES = INITIALIZATION | EVENT | CONTINUOUS | TERMINATED,
    SETTABLE = INSTANTIATED | INITIALIZATION | EVENT | STEP
};

/* Life */

const char *FMI(GetVersion)(void) {
    return FMI(Version);
}

void FMI(FreeInstance)(void *component) {
    instance_free(component);
}

FMI(Status) FMI(SetDebugLogging)(void *component, FMI(Boolean) logging, size_t count, const FMI(String) categories[]) {
    ALLOW(ANY_STATE)
    NEED(count == 0 || categories)
    RETURN(instance_log(c, __func__, logging, count, categories));
}

FMI(Status) FMI(ExitInitializationMode)(void *component) {
    ALLOW(INITIALIZATION)
    RETURN(instance_exit_initialization(c));
}

FMI(Status) FMI(Terminate)(void *component) {
    ALLOW(EVENT | CONTINUOUS | STEP)
    Status status = instance_check_commands(c);
    c->s.phase = TERMINATED;
    RETURN(status);
}

FMI(Status) FMI(Reset)(void *component) {
    ALLOW(ANY_STATE & ~INTERMEDIATE)
    instance_reset(c);
    return FMI(OK);
}

/* Saved state */

FMI(Status) STATE(Get, )(void *component, void **state) {
    ALLOW(ANY_STATE & ~INTERMEDIATE)
    NEED(state)
    RETURN(instance_save(c, state));
}

FMI(Status) STATE(Set, )(void *component, void *state) {
    ALLOW(ANY_STATE & ~INTERMEDIATE)
    NEED(state)
    RETURN(instance_restore(c, state));
}

FMI(Status) STATE(Free, )(void *component, void **state) {
    ALLOW(ANY_STATE)
    instance_forget_saved(c, state);
    return FMI(OK);
}

FMI(Status) STATE(Serialized, Size)(void *component, void *state, size_t *size) {
    ALLOW(ANY_STATE)
    NEED(state && size)
    *size = instance_serialized_size(state);
    return FMI(OK);
}

FMI(Status) STATE(Serialize, )(void *component, void *state, FMI(Byte) bytes[], size_t size) {
    ALLOW(ANY_STATE)
    NEED(state && bytes)
    RETURN(instance_serialize(c, __func__, state, (char *)bytes, size));
}

FMI(Status) DESERIALIZE(void *component, const FMI(Byte) bytes[], size_t size, void **state) {
    ALLOW(ANY_STATE)
    NEED(bytes && state)
    RETURN(instance_deserialize(c, (const char *)bytes, size, state));
}

/* Model exchange */

FMI(Status) FMI(EnterContinuousTimeMode)(void *component) {
    ALLOW(EVENT)
    c->s.phase = CONTINUOUS;
    return FMI(OK);
}

FMI(Status) FMI(CompletedIntegratorStep)(void *component, FMI(Boolean) final, FMI(Boolean) * event, FMI(Boolean) * terminate) {
    (void) final;
    ALLOW(CONTINUOUS)
    NEED(event && terminate)
    *event = *terminate = false;
    return FMI(OK);
}

FMI(Status) FMI(SetContinuousStates)(void *component, const double x[], size_t count) {
    ALLOW(CONTINUOUS)
    NEED(x)
    RETURN(instance_set_states(c, __func__, x, count));
}

#define GET_STATES(name, what, phases)                                                                                         \
    FMI(Status) FMI(name)(void *component, double values[], size_t count) {                                                    \
        ALLOW_IN(MODEL_EXCHANGE, phases)                                                                                       \
        NEED(values)                                                                                                           \
        RETURN(instance_get_states(c, __func__, what, values, count));                                                         \
    }

GET_STATES(GetContinuousStates, VALUES, WITH_STATES)
GET_STATES(GetEventIndicators, INDICATORS, WITH_STATES)

#endif
