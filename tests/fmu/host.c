/* A master in C: FMI 2.0 and 3.0, co-simulation and model exchange (by the classical Runge-Kutta method), without Python.

       host LIBRARY FMI cs|me TOKEN RESOURCES STATES STEPS STEP INSTANCES THREADS < PLAN

   runs as many instances, so many at a time, through so many steps, all alike. Lines of the plan:

       r REFERENCE VALUE       a real that is set before the initialisation
       m REFERENCE VALUE       an integer that is set before the initialisation
       i REFERENCE VALUE       a real input that is set before each step
       c REFERENCE VALUE STEP  a real input that is set before the step of this number, and from then on
       o REFERENCE             a real that is read after each step

   What it prints is JSON: the last status, the time reached, what was read then, whether all instances agree to the last bit,
   microseconds a step, what was logged, and whether anything of Python is in the process. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

#ifdef _WIN32
#include <windows.h>
#define SYMBOL(library, name) (void *)GetProcAddress(library, name)
#else
#include <dlfcn.h>
#include <pthread.h>
#define SYMBOL(library, name) dlsym(library, name)
#endif

enum { MOST = 128, MOST_INSTANCES = 64, PARTS = 10, LOGGED = 1000 };

typedef struct {
    unsigned reference[MOST];
    double value[MOST];
    int step[MOST];
    size_t count;
} List;

typedef struct {
    void *component;
    double time, values[MOST];
    int status;
} Run;

static int fmi, exchange, states, steps, instances, threads;
static double step_size;
static const char *token, *resources;
static List reals, modes, inputs, changes, outputs;
static Run runs[MOST_INSTANCES];
static char logged[LOGGED];
static void *library;

static void *function(const char *name)
{
    char whole[64];
    snprintf(whole, sizeof whole, "fmi%d%s", fmi, name);
    void *found = SYMBOL(library, whole);
    if (!found) {
        fprintf(stderr, "%s is not in the library\n", whole);
        exit(2);
    }
    return found;
}

#define FMI2(name) ((fmi2##name##TYPE *)function(#name))
#define FMI3(name) ((fmi3##name##TYPE *)function(#name))

static void say2(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    (void)e, (void)name, (void)status, (void)category;
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(logged, LOGGED, message, arguments);
    va_end(arguments);
}

static void say3(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)e, (void)status, (void)category;
    snprintf(logged, LOGGED, "%s", message);
}

static void need(int status, const char *what)
{
    if (status > 1) { /* a warning is as good as OK */
        fprintf(stderr, "%s: status %d, %s\n", what, status, logged);
        exit(1);
    }
}

/* The functions of a step are looked up once: what is measured is the FMU. */
static struct {
    fmi2SetRealTYPE *set2;
    fmi2GetRealTYPE *get2;
    fmi2DoStepTYPE *step2;
    fmi3SetFloat64TYPE *set3;
    fmi3GetFloat64TYPE *get3;
    fmi3DoStepTYPE *step3;
} call;

static void set(void *c, const List *list, size_t first, size_t count)
{
    const unsigned *at = list->reference + first;
    const double *values = list->value + first;
    need(fmi == 2 ? (int)call.set2(c, at, count, values) : (int)call.set3(c, at, count, values, count), "set");
}

static void get(Run *run)
{
    size_t n = outputs.count;
    need(fmi == 2 ? (int)call.get2(run->component, outputs.reference, n, run->values)
                  : (int)call.get3(run->component, outputs.reference, n, run->values, n), "get");
}

static void begin(Run *run)
{
    static const fmi2CallbackFunctions callbacks = {say2, calloc, free, NULL, NULL};
    void *c;
    if (fmi == 2)
        c = FMI2(Instantiate)("host", exchange ? fmi2ModelExchange : fmi2CoSimulation, token, resources, &callbacks, 0, 1);
    else if (exchange)
        c = FMI3(InstantiateModelExchange)("host", token, resources, 0, 1, NULL, say3);
    else
        c = FMI3(InstantiateCoSimulation)("host", token, resources, 0, 1, 0, 0, NULL, 0, NULL, say3, NULL);
    need(c ? 0 : 3, "instantiate");
    run->component = c;
    run->time = 0.0;
    set(c, &reals, 0, reals.count);
    for (size_t i = 0; i < modes.count; i++) {
        int whole = (int)modes.value[i];
        need(fmi == 2 ? (int)FMI2(SetInteger)(c, &modes.reference[i], 1, &whole)
                      : (int)FMI3(SetInt32)(c, &modes.reference[i], 1, &whole, 1), "set a mode");
    }
    if (fmi == 2) {
        need(FMI2(SetupExperiment)(c, 0, 0.0, 0.0, 0, 0.0), "setup");
        need(FMI2(EnterInitializationMode)(c), "enter initialisation");
        need(FMI2(ExitInitializationMode)(c), "exit initialisation");
    } else {
        need(FMI3(EnterInitializationMode)(c, 0, 0.0, 0.0, 0, 0.0), "enter initialisation");
        need(FMI3(ExitInitializationMode)(c), "exit initialisation");
    }
}

/* Model exchange */

static int event(void *c)
{
    if (fmi == 2) {
        fmi2EventInfo info;
        need(FMI2(NewDiscreteStates)(c, &info), "new discrete states");
        need(FMI2(EnterContinuousTimeMode)(c), "enter continuous time");
        return info.terminateSimulation;
    }
    fmi3Boolean again, ended, nominals, values, next;
    fmi3Float64 time;
    need(FMI3(UpdateDiscreteStates)(c, &again, &ended, &nominals, &values, &next, &time), "update discrete states");
    need(FMI3(EnterContinuousTimeMode)(c), "enter continuous time");
    return ended;
}

static int slope(void *c, double time, const double x[], double result[])
{
    size_t n = (size_t)states;
    if (fmi == 2) {
        need(FMI2(SetTime)(c, time), "time");
        need(FMI2(SetContinuousStates)(c, x, n), "states");
        return (int)FMI2(GetDerivatives)(c, result, n);
    }
    need(FMI3(SetTime)(c, time), "time");
    need(FMI3(SetContinuousStates)(c, x, n), "states");
    return (int)FMI3(GetContinuousStateDerivatives)(c, result, n);
}

/* A step by the classical method; where the equations are not defined the state is left as it was. */
static int runge_kutta(void *c, double time, double h)
{
    double x[MOST], y[MOST], k[4][MOST];
    static const double at[] = {0.0, 0.5, 0.5, 1.0};
    size_t n = (size_t)states;
    int status = 0;
    need(fmi == 2 ? (int)FMI2(GetContinuousStates)(c, x, n) : (int)FMI3(GetContinuousStates)(c, x, n), "states");
    for (int s = 0; s < 4 && status < 2; s++) {
        for (int i = 0; i < states; i++)
            y[i] = x[i] + (s ? h * at[s] * k[s - 1][i] : 0.0);
        status = slope(c, time + at[s] * h, y, k[s]);
    }
    for (int i = 0; i < states && status < 2; i++)
        x[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    slope(c, status < 2 ? time + h : time, x, y); /* leaves state and time there */
    return status;
}

static int advance(Run *run, double time)
{
    void *c = run->component;
    if (exchange) {
        int status = 0;
        for (int part = 0; part < PARTS && status < 2; part++)
            status = runge_kutta(c, time + part * (step_size / PARTS), step_size / PARTS);
        return status;
    }
    if (fmi == 2)
        return (int)call.step2(c, time, step_size, fmi2True);
    fmi3Boolean event_needed, terminate, early;
    fmi3Float64 last;
    return (int)call.step3(c, time, step_size, fmi3True, &event_needed, &terminate, &early, &last);
}

/* A run */

static void simulate(Run *run)
{
    void *c = run->component;
    run->status = exchange ? 2 * event(c) : 0;
    for (int step = 0; step < steps && run->status < 2; step++) {
        if (inputs.count)
            set(c, &inputs, 0, inputs.count);
        for (size_t i = 0; i < changes.count; i++)
            if (changes.step[i] == step) {
                if (exchange)
                    need(fmi == 2 ? (int)FMI2(EnterEventMode)(c) : (int)FMI3(EnterEventMode)(c), "enter event mode");
                set(c, &changes, i, 1);
                if (exchange && event(c))
                    run->status = 2;
            }
        run->status = advance(run, step * step_size);
        if (run->status < 2)
            run->time = (step + 1) * step_size;
        get(run);
    }
    get(run); /* after a step that was refused, too: the last good state is there to be read */
}

static void end(Run *run)
{
    need(fmi == 2 ? (int)FMI2(Terminate)(run->component) : (int)FMI3(Terminate)(run->component), "terminate");
    if (fmi == 2)
        FMI2(FreeInstance)(run->component);
    else
        FMI3(FreeInstance)(run->component);
}

static void *work(void *argument)
{
    for (size_t i = (size_t)argument; i < (size_t)instances; i += (size_t)threads)
        simulate(&runs[i]);
    return NULL;
}

static double now(void)
{
    struct timespec t;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void read_plan(void)
{
    char kind;
    unsigned reference;
    while (scanf(" %c %u", &kind, &reference) == 2) {
        List *list = kind == 'r' ? &reals : kind == 'm' ? &modes : kind == 'i' ? &inputs : kind == 'c' ? &changes : &outputs;
        size_t n = list->count++;
        list->reference[n] = reference;
        if (n == MOST - 1 || (kind != 'o' && scanf("%lf", &list->value[n]) != 1) ||
            (kind == 'c' && scanf("%d", &list->step[n]) != 1))
            need(3, "the plan");
    }
}

static int python_is_here(void)
{
    char line[1000];
    int found = 0;
    FILE *maps = fopen("/proc/self/maps", "r"); /* Linux */
    while (maps && fgets(line, sizeof line, maps))
        found |= strstr(line, "python") != NULL;
    if (maps)
        fclose(maps);
    return found;
}

int main(int count, char **arguments)
{
    if (count != 11)
        return 2;
    fmi = atoi(arguments[2]);
    exchange = strcmp(arguments[3], "me") == 0;
    token = arguments[4];
    resources = arguments[5][0] ? arguments[5] : NULL;
    states = atoi(arguments[6]);
    steps = atoi(arguments[7]);
    step_size = atof(arguments[8]);
    instances = atoi(arguments[9]);
    threads = atoi(arguments[10]);
    if (instances > MOST_INSTANCES || states > MOST)
        return 2;
    read_plan();
#ifdef _WIN32
    library = LoadLibraryA(arguments[1]);
#else
    library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
#endif
    if (!library) {
        fprintf(stderr, "%s cannot be loaded\n", arguments[1]);
        return 2;
    }
    if (fmi == 2) {
        call.set2 = FMI2(SetReal), call.get2 = FMI2(GetReal);
        if (!exchange)
            call.step2 = FMI2(DoStep);
    } else {
        call.set3 = FMI3(SetFloat64), call.get3 = FMI3(GetFloat64);
        if (!exchange)
            call.step3 = FMI3(DoStep);
    }
    for (int i = 0; i < instances; i++)
        begin(&runs[i]);
    double begun = now();
#ifdef _WIN32
    threads = 1;
    work(NULL);
#else
    pthread_t ids[MOST_INSTANCES];
    for (size_t i = 1; i < (size_t)threads; i++)
        need(3 * pthread_create(&ids[i], NULL, work, (void *)i), "a thread");
    work(NULL);
    for (int i = 1; i < threads; i++)
        pthread_join(ids[i], NULL);
#endif
    double seconds = (now() - begun) / ((double)steps * instances);
    int same = 1;
    for (int i = 0; i < instances; i++) {
        same &= memcmp(runs[i].values, runs[0].values, sizeof runs[0].values) == 0 && runs[i].status == runs[0].status;
        end(&runs[i]);
    }
    for (char *letter = logged; *letter; letter++)
        if (*letter == '"' || *letter == '\\' || (unsigned char)*letter < ' ')
            *letter = '\'';
    printf("{\"status\": %d, \"time\": %.17g, \"same\": %s, \"microseconds\": %.4f, \"python\": %s, \"logged\": \"%s\", \"values\": [",
           runs[0].status, runs[0].time, same ? "true" : "false", 1e6 * seconds, python_is_here() ? "true" : "false", logged);
    for (size_t i = 0; i < outputs.count; i++)
        printf("%s%.17g", i ? ", " : "", runs[0].values[i]);
    printf("]}\n");
    return 0;
}
