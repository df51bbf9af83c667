/* A host for real-time targets: a system in one program, without a heap.

       host STEPS [RATE]

   takes STEPS communication steps of the system's own length as fast as they go, or steps of 1 / RATE seconds, each begun at its
   time and due when the next one begins: a deadline is missed where it ends later.

   The parts, their start values and their connections are in system.h, which is generated. The native FMUs are linked from their
   sources, each behind its prefix, and take their memory from a pool, by the functions that FMI 2.0 has for this. The controllers,
   FMUs in Python elsewhere, are in controllers.h. What it prints are names and numbers; us are microseconds. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <limits.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

#include "controllers.h"
#include "fmi2Functions.h"

/* Memory: a pool that is given away from its start on. All of it is zero, and what is released is not given again. */

enum { POOL = 1 << 18 };

static _Alignas(max_align_t) unsigned char pool[POOL];
static size_t used;

static void *allocate(size_t count, size_t size) {
    size_t unit = sizeof(max_align_t);
    if (size > 0 && count > POOL / size) return NULL;
    size_t wanted = (count * size + unit - 1) / unit * unit;
    if (wanted > POOL - used) return NULL;
    used += wanted;
    return pool + used - wanted;
}

static void release(void *memory) {
    (void)memory;
}

/* Native FMUs */

static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    (void)environment, (void)status, (void)category;
    va_list arguments;
    va_start(arguments, message);
    fprintf(stderr, "%s: ", name);
    vfprintf(stderr, message, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static const fmi2CallbackFunctions callbacks = {log_message, allocate, release, NULL, NULL};

static void need(int good, const char *part, const char *what) {
    if (good) return;
    fprintf(stderr, "%s: %s failed\n", part, what);
    exit(1);
}

#define FMU(fmu)                                                                                                               \
    fmi2InstantiateTYPE fmu##_fmi2Instantiate;                                                                                 \
    fmi2SetDebugLoggingTYPE fmu##_fmi2SetDebugLogging;                                                                         \
    fmi2SetupExperimentTYPE fmu##_fmi2SetupExperiment;                                                                         \
    fmi2EnterInitializationModeTYPE fmu##_fmi2EnterInitializationMode;                                                         \
    fmi2ExitInitializationModeTYPE fmu##_fmi2ExitInitializationMode;                                                           \
    fmi2SetRealTYPE fmu##_fmi2SetReal;                                                                                         \
    fmi2SetIntegerTYPE fmu##_fmi2SetInteger;                                                                                   \
    fmi2SetBooleanTYPE fmu##_fmi2SetBoolean;                                                                                   \
    fmi2GetRealTYPE fmu##_fmi2GetReal;                                                                                         \
    fmi2DoStepTYPE fmu##_fmi2DoStep;                                                                                           \
    fmi2TerminateTYPE fmu##_fmi2Terminate;                                                                                     \
    fmi2FreeInstanceTYPE fmu##_fmi2FreeInstance;

#define CALL(fmu, function, part, ...) need(fmu##_fmi2##function(part, __VA_ARGS__) <= fmi2Warning, #part, #function);
#define NEW(fmu, part, name, guid)                                                                                             \
    part = fmu##_fmi2Instantiate(name, fmi2CoSimulation, guid, NULL, &callbacks, fmi2False, fmi2False);                        \
    need(part != NULL, name, "instantiating");                                                                                 \
    /* why a step is refused; an FMU of another make may lack the category */                                                  \
    fmu##_fmi2SetDebugLogging(part, fmi2True, 1, (const fmi2String[]){"logStatusDiscard"});                                    \
    CALL(fmu, SetupExperiment, part, fmi2False, 0.0, 0.0, fmi2False, 0.0)
#define SET(fmu, type, part, reference, value)                                                                                 \
    CALL(fmu, Set##type, part, (const fmi2ValueReference[]){reference}, 1, (const fmi2##type[]){value})
#define GET(fmu, part, reference, value) CALL(fmu, GetReal, part, (const fmi2ValueReference[]){reference}, 1, &value)
#define ENTER(fmu, part) need(fmu##_fmi2EnterInitializationMode(part) <= fmi2Warning, #part, "entering the initialisation");
#define EXIT(fmu, part) need(fmu##_fmi2ExitInitializationMode(part) <= fmi2Warning, #part, "the initialisation");
#define STEP(fmu, part, time, step) CALL(fmu, DoStep, part, time, step, fmi2True)
#define END(fmu, part)                                                                                                         \
    need(fmu##_fmi2Terminate(part) <= fmi2Warning, #part, "terminating");                                                      \
    fmu##_fmi2FreeInstance(part);

#include "system.h"

/* Times */

/* Bins of 1 ns, and from 2 * FINE ns on FINE of one width for each doubling: what is read from them is right within 1 / FINE. */
enum { FINE = 128, BINS = 40 * FINE };

/* How often something took how long (ns). */
typedef struct {
    unsigned bins[BINS];
    int64_t worst;
} Times;

static void count(Times *times, int64_t taken) {
    int doublings = 0;
    while (taken >> doublings >= 2 * FINE) doublings++;
    int64_t bin = (int64_t)doublings * FINE + (taken >> doublings);
    times->bins[bin < BINS ? bin : BINS - 1]++;
    if (taken > times->worst) times->worst = taken;
}

/* What a share of all did not exceed (us). */
static double percentile(const Times *times, double share, long all) {
    double below = 0.0;
    int bin = 0;
    while (bin < BINS - 1 && (below += times->bins[bin]) < share * (double)all) bin++;
    int doublings = bin < 2 * FINE ? 0 : bin / FINE - 1;
    int64_t end = (int64_t)(bin - doublings * FINE + 1) << doublings;
    return 1e-3 * (double)(share == 1.0 || end > times->worst ? times->worst : end);
}

static void print(const char *name, double value) {
    printf("%-32s %.12g\n", name, value);
}

static void print_times(const char *what, const Times *times, long all) {
    static const struct {
        const char *name;
        double share;
    } shares[] = {{"median", 0.5}, {"99%", 0.99}, {"99.9%", 0.999}, {"99.99%", 0.9999}, {"worst", 1.0}};
    for (size_t i = 0; i < sizeof shares / sizeof *shares; i++) {
        char name[32];
        snprintf(name, sizeof name, "%s_us_%s", what, shares[i].name);
        print(name, percentile(times, shares[i].share, all));
    }
}

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void await_time(int64_t due) {
    struct timespec t = {.tv_sec = due / 1000000000, .tv_nsec = due % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {
    }
}

static Times taken, woken;

/* Return the finite number that a whole word is, or 0. */
static double number(const char *word) {
    char *end;
    double value = strtod(word, &end);
    return *end == '\0' && isfinite(value) ? value : 0.0;
}

int main(int words, char **word) {
    static char buffer[4096];
    setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
    double wanted = words > 1 ? number(word[1]) : 0.0;
    double rate = words > 2 ? number(word[2]) : 0.0, step = words > 2 ? 1.0 / rate : COMMUNICATION_STEP;
    long steps = wanted >= 1.0 && wanted < (double)LONG_MAX ? (long)wanted : 0, missed = 0;
    int64_t latest = 0, locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    if (words > 3 || steps < 1 || (double)steps != wanted || (words > 2 && !(rate > 0.0))) {
        fprintf(stderr, "host STEPS [RATE]: a whole number of steps, and steps a second; both above 0\n");
        return 2;
    }
    begin();
    /* what depends directly on an input settles; until the start, a controller tells what a sample would give */
    for (int part = 0; part < PARTS; part++) {
        sample_ahead();
        read_outputs();
        go_back();
        set_inputs();
    }
    initialise();
    read_outputs();
    size_t used_before = used;
    int64_t start = now() + 1000000;
    for (long k = 0; k < steps; k++) {
        int64_t due = start + (int64_t)((double)k * step * 1e9), end = start + (int64_t)((double)(k + 1) * step * 1e9);
        if (rate > 0.0) await_time(due);
        int64_t begun = now();
        set_inputs();
        advance((double)k * step, step);
        read_outputs();
        int64_t done = now();
        count(&taken, done - begun);
        if (rate > 0.0) {
            count(&woken, begun - due);
            missed += done > end;
            if (done - end > latest) latest = done - end;
        }
    }
    print("steps", (double)steps);
    print("step_s", step);
    print_times("step", &taken, steps);
    if (rate > 0.0) {
        print_times("wake", &woken, steps);
        print("deadlines_missed", (double)missed);
        print("latest_us", 1e-3 * (double)latest);
    }
    print("memory_locked", (double)locked);
    print("pool_bytes", (double)used_before);
    print("pool_bytes_in_steps", (double)(used - used_before));
    for (int i = 0; i < OUTPUTS; i++) print(outputs[i], y[i]);
    finish();
    return 0;
}
