/* One step of the integrator, DOP853 of Hairer, Norsett and Wanner, for the FMUs and the browser. Its twins are the step of
   linkwork.integrate and the compiled one of analysis.run, on the same tableau; tests hold the three equal. */
#ifndef STEP_H
#define STEP_H

#include <math.h>
#include <stdbool.h>

#include "tableau.h"

/* Slope of z at t, of that length; whether the equations are defined there. */
typedef bool Slope(const void *context, double t, const double z[], double result[], int length);

/* Error of a step of size h from z to `result`, relative to the scale, in the first `count` of so many components; `k` has the slopes of
   all stages. Not a number where a component is infinite. */
static inline double step_error(const double z[], const double result[], double h, const double k[], const double scale[],
                                int length, int count) {
    double sum5 = 0.0, sum3 = 0.0;
    for (int i = 0; i < count; i++) {
        if (!isfinite(result[i])) return NAN; /* an infinite component has no error relative to itself */
        double weight = 1.0 / (scale[i] + fmax(fabs(z[i]), fabs(result[i]))), error5 = 0.0, error3 = 0.0;
        for (int e = 0; e < ERROR_STAGES; e++) {
            error5 += E5[e] * k[E_STAGE[e] * length + i];
            error3 += E3[e] * k[E_STAGE[e] * length + i];
        }
        error5 *= weight;
        error3 *= weight;
        sum5 += error5 * error5;
        sum3 += error3 * error3;
    }
    double denominator = sum5 + 0.01 * sum3;
    return denominator == 0.0 ? 0.0 : fabs(h) * sum5 / sqrt(denominator * count);
}

/* Take a step of size h from z at t. `k` has room for the slopes of all stages, row by row, the first row filled in. Returns the
   error relative to the scale, not a number where the equations are not defined. */
static inline double attempt_step(Slope *slope, const void *context, double t, const double z[], double h, double k[],
                                  const double scale[], int length, double result[]) {
    for (int stage = 1; stage <= STAGES; stage++) {
        for (int i = 0; i < length; i++) result[i] = 0.0;
        for (int w = A_ROW[stage]; w < A_ROW[stage + 1]; w++)
            for (int i = 0; i < length; i++) result[i] += A_WEIGHT[w] * k[A_STAGE[w] * length + i];
        for (int i = 0; i < length; i++) result[i] = z[i] + h * result[i];
        if (stage < STAGES && !slope(context, t + C[stage] * h, result, k + stage * length, length)) return NAN;
    }
    return step_error(z, result, h, k, scale, length, length);
}

/* The step, shortened so that the clearance to a limit, at its rate, falls by no more than half; `ahead` is the clearance that the slope
   at the beginning of the step gives after the fraction PROBE of it. */
static inline double step_short_of_limit(double step, double clearance, double ahead) {
    double fall = clearance - ahead;
    if (isnan(fall)) return PROBE * step; /* beyond the limit */
    return fall > 0.5 * PROBE * clearance ? 0.5 * PROBE * step * clearance / fall : step;
}

/* Return the factor by which the step grows or shrinks after one of that error, relative to the tolerance. */
static inline double step_factor(double error) {
    if (error == 0.0) return GREATEST_FACTOR;
    if (!isfinite(error)) return 0.25;
    return fmin(GREATEST_FACTOR, fmax(LEAST_FACTOR, SAFETY * pow(error, -1.0 / ORDER)));
}

#endif
