/* Right-hand sides of a native FMU of FMI 2.0, counted and timed: compiled with its sources instead of equations.c.

       right_hand_sides STEPS STEP LOOPS < REFERENCE VALUE ...   reals that are set before the initialisation

   prints how many right-hand sides the steps take, each, and nanoseconds of a bare one, at the states and inputs that they
   were called with in the steps. */
#define equations_derivative bare_derivative
#include "equations.c"
#undef equations_derivative

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"
#include "model.h"

enum { KEPT = 4096 };

static long calls;
static double kept_x[KEPT][STATES], kept_u[KEPT][ROOM(INPUTS)], kept_m[ROOM(MODES)], kept_p[CONSTANTS];

int equations_derivative(const double **arguments, double **results, int *iw, double *w, int memory)
{
    memcpy(kept_x[calls % KEPT], arguments[0], sizeof *kept_x);
    memcpy(kept_m, arguments[1], sizeof kept_m);
    memcpy(kept_u[calls % KEPT], arguments[2], sizeof *kept_u);
    memcpy(kept_p, arguments[3], sizeof kept_p);
    calls++;
    return bare_derivative(arguments, results, iw, w, memory);
}

static void silent(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e, (void)name, (void)status, (void)category, (void)text;
}

static double now(void)
{
    struct timespec t;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int count, char **arguments)
{
    static const fmi2CallbackFunctions callbacks = {silent, calloc, free, NULL, NULL};
    if (count != 4)
        return 2;
    int steps = atoi(arguments[1]), loops = atoi(arguments[3]), status = 0;
    double step = atof(arguments[2]), value, sum = 0.0, best = 1e9;
    unsigned reference;
    fmi2Component c = fmi2Instantiate("count", fmi2CoSimulation, TOKEN, NULL, &callbacks, 0, 0);
    while (scanf("%u %lf", &reference, &value) == 2)
        status |= fmi2SetReal(c, &reference, 1, &value);
    status |= fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) | fmi2EnterInitializationMode(c) | fmi2ExitInitializationMode(c);
    calls = 0;
    for (int i = 0; i < steps; i++)
        status |= fmi2DoStep(c, i * step, step, 1);
    if (status)
        return 1;
    long made = calls, n = calls < KEPT ? calls : KEPT;
    for (int loop = 0; loop < loops; loop++) {
        double begun = now(), result[STATES];
        for (long i = 0; i < n; i++) {
            bare_derivative((const double *[]){kept_x[i], kept_m, kept_u[i], kept_p}, (double *[]){result}, NULL, NULL, 0);
            sum += result[STATES - 1];
        }
        double took = (now() - begun) / (double)n;
        best = took < best ? took : best;
    }
    printf("%.6f %.4f %g\n", (double)made / steps, 1e9 * best, sum); /* the sum is printed so that nothing is left out */
    fmi2FreeInstance(c);
    return 0;
}
