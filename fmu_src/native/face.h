/* What both faces check of every call, before anything else: the state of the instance, and pointers. */
#ifndef FACE_H
#define FACE_H

#include "instance.h"

/* A face defines FMI(Name), its name for something of the standard: FMI(Status) is fmi2Status or fmi3Status. */
#define RETURN(status) return (FMI(Status))(status)

#define SAY(...) RETURN(instance_say(c, ERROR, __VA_ARGS__))

/* The call is allowed in these states. */
#define ALLOW(phases)                             \
    Instance *c = component;                      \
    if (!instance_allows(c, __func__, phases))    \
        return FMI(Error);

/* A pointer that the standard wants: without it the call is an error, not a crash. */
#define NEED(condition)                               \
    if (!(condition))                                 \
        SAY("%s: a pointer is missing", __func__);

#define ALLOW_IN(type, phases)                                                                                   \
    ALLOW(phases)                                                                                                \
    if (c->interface != (type))                                                                                  \
        SAY("%s: not allowed in %s", __func__, (type) == CO_SIMULATION ? "model exchange" : "co-simulation");

#define ARRAYS (count == 0 || (references && values))

#define EACH(call)                                \
    for (size_t i = 0; i < count; i++)            \
        if ((call) != OK)                         \
            return FMI(Error);                    \
    return FMI(OK);

enum {
    ANY_STATE = INSTANTIATED | SETTLED,
    WITH_STATES = INITIALIZATION | EVENT | CONTINUOUS | TERMINATED,
    SETTABLE = INSTANTIATED | INITIALIZATION | EVENT | STEP
};

#endif
