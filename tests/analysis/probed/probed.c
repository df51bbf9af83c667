/* A small FMU for the tests of the probe: x' = u - k x, y = sin x + u. Without a fault it does what FMI 2.0.4 asks for; the
   environment variable PROBE_FAULT plants one. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { INSTANTIATED = 1, READY = 2, INIT = 4, EVENT = 8, CONTINUOUS = 16, STEP = 32, TERMINATED = 128, FAILED = 256 };
enum { X, DX, U, K, Y, N, LABEL, TIME };
#define ANY 0x1ff
#ifndef EARLY
#define EARLY 0 /* the state before the initialization, where FMI 3.0 lets variables be read */
#endif
#define RUNNING (INIT | EVENT | CONTINUOUS | STEP | TERMINATED | FAILED)

typedef struct {
    char magic[8];
    double x, u, k, t;
    int n, state;
    char label[1024];
} State;

typedef struct {
    State now;
    double start, stop;
    int type, logging, broken;
    const fmi2CallbackFunctions *callbacks;
} Instance;

static int shared;

static int fault(const char *name) {
    const char *planted = getenv("PROBE_FAULT");
    return planted && !strcmp(planted, name);
}

static void lose(size_t size) {
    static char *volatile lost; /* volatile, so that the compiler does not leave out what no one uses */
    lost = malloc(size);
    memset(lost, 1, size);
}

static void crash(void) { *(volatile int *)8 = 1; }

static fmi2Status refuse(Instance *s, const char *why) {
    s->now.state = FAILED;
    s->broken = strstr(why, "isfinite(size)") != NULL;
    if (s->logging) s->callbacks->logger(s->callbacks->componentEnvironment, "probed", fmi2Error, "logStatusError", why);
    return fmi2Error;
}

#define ENTER(allowed)                                                                      \
    Instance *s = c;                                                                        \
    if (!s) return fmi2Error;                                                               \
    if (!(s->now.state & (allowed)) && !fault("order")) return refuse(s, "not allowed in this state")
#define NEED(condition) \
    if (!(condition)) return refuse(s, "an argument is wrong: " #condition)

static void set_starts(Instance *s) {
    State start = {"probed1", 1, 0, fault("start") ? 3 : 2, 0, 0, INSTANTIATED, "none"};
    if (fault("reset") && s->now.magic[0]) start.x = s->now.x;
    s->now = start;
}

static double slope(const Instance *s) { return s->now.u - s->now.k * s->now.x; }
static double output(const Instance *s) { return sin(s->now.x) + s->now.u + (fault("range") ? 100 : 0); }

static int is_text(const char *p) {
    for (; *p; p++) {
        unsigned char b = (unsigned char)*p;
        int more = b < 0x80 ? 0 : (b & 0xe0) == 0xc0 ? 1 : (b & 0xf0) == 0xe0 ? 2 : (b & 0xf8) == 0xf0 ? 3 : -1;
        if (more < 0) return 0;
        while (more-- > 0)
            if ((*++p & 0xc0) != 0x80) return 0;
    }
    return 1;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)visible;
    if (!name || !*name || !guid || !callbacks || !callbacks->logger || type < 0 || type > 1) return NULL;
    if (strcmp(guid, "{probed}") && !fault("guid")) return NULL;
    if (fault("place") && resources && strchr(resources, '%')) crash();
    if (fault("leak")) lose(1000);
    Instance *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->callbacks = callbacks;
    s->type = type;
    s->logging = logging;
    s->stop = HUGE_VAL;
    set_starts(s);
    return s;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *s = c;
    if (s && s->broken && fault("end")) crash();
    free(s);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    ENTER(ANY);
    (void)categories;
    NEED(n == 0);
    s->logging = on;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean bounded, fmi2Real tolerance, fmi2Real start, fmi2Boolean ends, fmi2Real stop) {
    ENTER(INSTANTIATED);
    NEED(isfinite(start) && (!bounded || (isfinite(tolerance) && tolerance > 0)) && (!ends || stop >= start));
    s->start = s->now.t = start;
    s->stop = ends && !fault("stop") ? stop : HUGE_VAL;
    s->now.state = READY;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    ENTER(READY);
    s->now.state = INIT;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    ENTER(INIT);
    NEED(fault("bounds") || (s->now.k >= 0 && s->now.k <= 10));
    s->now.state = s->type == fmi2CoSimulation ? STEP : EVENT;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    ENTER(EVENT | CONTINUOUS | STEP);
    s->now.state = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    ENTER(ANY);
    set_starts(s);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    ENTER(EARLY | RUNNING);
    NEED(n == 0 || (vr && value));
    if (fault("refuse") && s->now.n > 3) return refuse(s, "no wish to answer");
    for (size_t i = 0; i < n; i++) {
        const double values[] = {s->now.x, slope(s), s->now.u, s->now.k, output(s)};
        NEED(vr[i] <= Y || vr[i] == TIME);
        value[i] = vr[i] == TIME ? s->now.t : values[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    ENTER(EARLY | RUNNING);
    NEED(n == 0 || (vr && value));
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != N && fault("crash")) crash();
        NEED(vr[i] == N);
        value[i] = s->now.n;
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    ENTER(EARLY | RUNNING);
    (void)vr, (void)value;
    NEED(n == 0);
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    ENTER(EARLY | RUNNING);
    NEED(n == 0 || (vr && value));
    for (size_t i = 0; i < n; i++) {
        NEED(vr[i] == LABEL);
        value[i] = s->now.label;
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    ENTER(INSTANTIATED | READY | INIT | EVENT | CONTINUOUS | STEP);
    NEED(n == 0 || (vr && value));
    for (size_t i = 0; i < n; i++) {
        int early = s->now.state & (INSTANTIATED | READY | INIT);
        NEED(isfinite(value[i]) || fault("nan"));
        NEED(vr[i] == U || (vr[i] == X && (early || s->now.state == CONTINUOUS)) || (vr[i] == K && early));
        *(vr[i] == U ? &s->now.u : vr[i] == X ? &s->now.x : &s->now.k) = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    ENTER(INSTANTIATED | READY | INIT | EVENT | STEP);
    (void)vr, (void)value;
    NEED(n == 0);
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    return fmi2SetInteger(c, vr, n, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    ENTER(INSTANTIATED | READY | INIT | EVENT | STEP);
    NEED(n == 0 || (vr && value));
    for (size_t i = 0; i < n; i++) {
        NEED(vr[i] == LABEL && value[i] && strlen(value[i]) < sizeof s->now.label && is_text(value[i]));
        strcpy(s->now.label, value[i]);
    }
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    ENTER(ANY);
    NEED(state);
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &s->now, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    ENTER(ANY);
    NEED(state);
    double x = s->now.x;
    memcpy(&s->now, state, sizeof(State));
    if (fault("state")) s->now.x = x;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    ENTER(ANY);
    if (!state && fault("free")) crash();
    if (!state) return fmi2OK;
    if (!fault("leaking state")) free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    ENTER(ANY);
    NEED(state && size);
    *size = sizeof(State);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    ENTER(ANY);
    NEED(state && bytes && size >= sizeof(State));
    memcpy(bytes, state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    ENTER(ANY);
    NEED(bytes && state && size == sizeof(State) && !memcmp(bytes, "probed1", 8));
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, bytes, sizeof(State));
    if (fault("serialized")) ((State *)*state)->n = 0;
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t nu, const fmi2ValueReference known[],
                                        size_t nk, const fmi2Real seed[], fmi2Real result[]) {
    ENTER(RUNNING);
    NEED(unknown && known && seed && result);
    for (size_t i = 0; i < nu; i++) {
        NEED(unknown[i] == DX || unknown[i] == Y);
        result[i] = 0;
        for (size_t j = 0; j < nk; j++) {
            NEED(known[j] == X || known[j] == U);
            double in_u = fault("derivative") ? 1.001 : 1;
            double in_x = unknown[i] == DX ? -s->now.k : cos(s->now.x);
            result[i] += (known[j] == X ? in_x : in_u) * seed[j];
        }
    }
    return fmi2OK;
}

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    ENTER(EVENT | CONTINUOUS);
    s->now.state = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    ENTER(EVENT);
    NEED(info);
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    ENTER(EVENT);
    s->now.state = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no, fmi2Boolean *event, fmi2Boolean *end) {
    ENTER(CONTINUOUS);
    (void)no;
    NEED(event && end);
    *event = *end = fmi2False;
    s->now.n++;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    ENTER(CONTINUOUS);
    NEED(isfinite(time) && time >= s->start);
    s->now.t = time;
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    ENTER(CONTINUOUS);
    NEED(x && n == 1 && isfinite(*x));
    s->now.x = *x;
    return fmi2OK;
}

static fmi2Status one(fmi2Component c, fmi2Real *place, size_t n, int which, int allowed) {
    ENTER(allowed);
    NEED(place && n == 1);
    *place = which == 0 ? s->now.x : which == 1 ? slope(s) : 1;
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real dx[], size_t n) { return one(c, dx, n, 1, RUNNING); }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { return one(c, x, n, 0, RUNNING); }
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { return one(c, x, n, 2, ANY); }

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
    ENTER(RUNNING);
    (void)z;
    NEED(n == 0);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no) {
    ENTER(STEP);
    (void)no;
    while (fault("hang") && size < 0) continue;
    NEED(fault("step") || (size > 0 && isfinite(size) && fabs(time - s->now.t) <= 1e-9 * (1 + fabs(time))));
    NEED(time + size <= s->stop + 1e-9);
    if (fault("leaking step")) lose(300);
    double k = s->now.k, rest = k ? s->now.u / k : 0;
    if (fault("shared")) s->now.u += 1e-9 * shared++;
    s->now.x = fault("euler") ? s->now.x + 50 * size * size : k ? rest + (s->now.x - rest) * exp(-k * size) : s->now.x + s->now.u * size;
    s->now.t = time + size;
    s->now.n++;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    ENTER(0);
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], const fmi2Real value[]) {
    ENTER(0);
    (void)vr, (void)n, (void)order, (void)value;
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], fmi2Real value[]) {
    ENTER(0);
    (void)vr, (void)n, (void)order, (void)value;
    return fmi2OK;
}

#define STATUS(NAME, TYPE, KIND, VALUE)                                            \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2StatusKind kind, TYPE *value) { \
        ENTER(STEP | TERMINATED);                                                  \
        NEED(value && (int)kind == (KIND));                                        \
        *value = VALUE;                                                            \
        return fmi2OK;                                                             \
    }

STATUS(Status, fmi2Status, fmi2DoStepStatus, fmi2OK)
STATUS(RealStatus, fmi2Real, fmi2LastSuccessfulTime, s->now.t)
STATUS(IntegerStatus, fmi2Integer, -1, 0)
STATUS(BooleanStatus, fmi2Boolean, fmi2Terminated, fmi2False)
STATUS(StringStatus, fmi2String, fmi2PendingStatus, "")
