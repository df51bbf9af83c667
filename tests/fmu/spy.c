/* A library between a master and an FMU's own, which is linked to it: a line in the file LINKWORK_CALLS for each of some calls.
   All other functions are found in the FMU's library, since a search for a symbol goes on there. */
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

static void said(const char *what)
{
    const char *path = getenv("LINKWORK_CALLS");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (!file) return;
    fprintf(file, "%s\n", what);
    fclose(file);
}

/* A function that says its name, and calls the one behind it. */
#define PASS(RESULT, NAME, PARAMETERS, ...)                       \
    RESULT NAME PARAMETERS                                        \
    {                                                             \
        static NAME##TYPE *real;                                  \
        if (!real) real = (NAME##TYPE *)dlsym(RTLD_NEXT, #NAME);  \
        said(#NAME);                                              \
        return real(__VA_ARGS__);                                 \
    }

typedef const fmi2ValueReference *References2;

PASS(fmi2Component, fmi2Instantiate,
     (fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions *functions,
      fmi2Boolean visible, fmi2Boolean logging),
     name, type, guid, resources, functions, visible, logging)
PASS(fmi2Status, fmi2SetInteger, (fmi2Component c, References2 r, size_t n, const fmi2Integer v[]), c, r, n, v)
PASS(fmi2Status, fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate state), c, state)
PASS(fmi2Status, fmi2EnterEventMode, (fmi2Component c), c)
PASS(fmi2Status, fmi2SetRealInputDerivatives,
     (fmi2Component c, References2 r, size_t n, const fmi2Integer order[], const fmi2Real v[]), c, r, n, order, v)

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_going_back)
{
    static fmi2DoStepTYPE *real;
    static fmi2Real before;
    if (!real) real = (fmi2DoStepTYPE *)dlsym(RTLD_NEXT, "fmi2DoStep");
    if (before > 0.0 && fabs(step - before) > 1e-6 * before) said("variedStep");
    before = step;
    return real(c, time, step, no_going_back);
}

PASS(fmi3Status, fmi3SetFMUState, (fmi3Instance c, fmi3FMUState state), c, state)
PASS(fmi3Status, fmi3EnterEventMode, (fmi3Instance c), c)

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference needed[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    fmi3InstantiateCoSimulationTYPE *real =
        (fmi3InstantiateCoSimulationTYPE *)dlsym(RTLD_NEXT, "fmi3InstantiateCoSimulation");
    said("fmi3InstantiateCoSimulation");
    if (event_mode) said("eventModeUsed");
    if (early_return) said("earlyReturnAllowed");
    if (update) said("intermediateUpdate");
    return real(name, token, resources, visible, logging, event_mode, early_return, needed, count, environment, log,
                update);
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_going_back,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful)
{
    fmi3DoStepTYPE *real = (fmi3DoStepTYPE *)dlsym(RTLD_NEXT, "fmi3DoStep");
    const fmi3Status status =
        real(c, time, step, no_going_back, event_needed, terminate, early_return, last_successful);
    if (*early_return) said("earlyReturn");
    return status;
}
