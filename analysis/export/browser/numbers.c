/* Numerical methods for the page: linear equations, eigenvalues, the swing of a periodic motion. */
#include "studio.h"

#include <complex.h>
#include <math.h>
#include <string.h>

bool solve(double matrix[], double right[], int n) {
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int r = c + 1; r < n; r++)
            if (fabs(matrix[r * n + c]) > fabs(matrix[best * n + c])) best = r;
        if (!(fabs(matrix[best * n + c]) > 0.0)) return false;
        for (int i = 0; i < n; i++) {
            double kept = matrix[c * n + i];
            matrix[c * n + i] = matrix[best * n + i];
            matrix[best * n + i] = kept;
        }
        double kept = right[c];
        right[c] = right[best];
        right[best] = kept;
        for (int r = 0; r < n; r++) {
            if (r == c) continue;
            double factor = matrix[r * n + c] / matrix[c * n + c];
            for (int i = c; i < n; i++) matrix[r * n + i] -= factor * matrix[c * n + i];
            right[r] -= factor * right[c];
        }
    }
    for (int r = 0; r < n; r++) right[r] /= matrix[r * n + r];
    return true;
}

void eigenvalues(const double matrix[], int n, double real[], double imaginary[]) {
    double m[MOST * MOST] = {0}, coefficient[MOST + 1] = {1.0};
    double complex root[MOST];
    for (int k = 1; k <= n; k++) { /* Faddeev and Le Verrier */
        double next[MOST * MOST] = {0}, trace = 0.0;
        for (int i = 0; i < n; i++) m[i * n + i] += coefficient[k - 1];
        for (int r = 0; r < n; r++)
            for (int c = 0; c < n; c++)
                for (int i = 0; i < n; i++) next[r * n + c] += matrix[i * n + r] * m[i * n + c];
        for (int i = 0; i < n; i++) trace += next[i * n + i];
        coefficient[k] = -trace / k;
        memcpy(m, next, sizeof m);
    }
    double radius = 0.0;
    for (int k = 1; k <= n; k++) radius = fmax(radius, pow(fabs(coefficient[k]), 1.0 / k));
    for (int i = 0; i < n; i++) root[i] = radius * cexp(I * (0.4 + PERIOD * i / n));
    for (int round = 0; round < 500; round++) { /* Weierstrass, Durand and Kerner */
        double largest = 0.0;
        for (int i = 0; i < n; i++) {
            double complex value = coefficient[0], product = 1.0;
            for (int k = 1; k <= n; k++) value = value * root[i] + coefficient[k];
            for (int j = 0; j < n; j++)
                if (j != i) product *= root[i] - root[j];
            if (product == 0.0) continue;
            root[i] -= value / product;
            largest = fmax(largest, cabs(value / product));
        }
        if (largest <= 1e-16 * radius) break;
    }
    for (int i = 0; i < n; i++) {
        int best = i;
        for (int j = i + 1; j < n; j++)
            if (cabs(root[j]) > cabs(root[best])) best = j;
        double complex kept = root[i];
        root[i] = root[best];
        root[best] = kept;
        real[i] = creal(root[i]);
        imaginary[i] = cimag(root[i]);
    }
}

double swing_amplitude(const double samples[SAMPLES]) {
    enum { FINE_SAMPLES = 8 * SAMPLES };
    static double cosine[FINE_SAMPLES], fine[FINE_SAMPLES];
    double real[SAMPLES / 2 + 1], imaginary[SAMPLES / 2 + 1], ends[2];
    int top[2] = {0, 0};
    if (cosine[0] == 0.0)
        for (int i = 0; i < FINE_SAMPLES; i++) cosine[i] = cos(4.0 * QUARTER * i / FINE_SAMPLES);
    for (int k = 0; k <= SAMPLES / 2; k++) {
        real[k] = imaginary[k] = 0.0;
        for (int i = 0, at = 0; i < SAMPLES; i++, at = (at + 8 * k) % FINE_SAMPLES) {
            real[k] += samples[i] * cosine[at] * (k ? 2.0 : 1.0) / SAMPLES;
            imaginary[k] -= samples[i] * cosine[(at + 3 * FINE_SAMPLES / 4) % FINE_SAMPLES] * 2.0 / SAMPLES;
        }
    }
    for (int i = 0; i < FINE_SAMPLES; i++) {
        fine[i] = real[0];
        for (int k = 1, at = i; k <= SAMPLES / 2; k++, at = (at + i) % FINE_SAMPLES)
            fine[i] += real[k] * cosine[at] - imaginary[k] * cosine[(at + 3 * FINE_SAMPLES / 4) % FINE_SAMPLES];
        if (fine[i] > fine[top[0]]) top[0] = i;
        if (fine[i] < fine[top[1]]) top[1] = i;
    }
    for (int end = 0; end < 2; end++) {
        double before = fine[(top[end] + FINE_SAMPLES - 1) % FINE_SAMPLES], at = fine[top[end]];
        double after = fine[(top[end] + 1) % FINE_SAMPLES], bend = before - 2.0 * at + after;
        ends[end] = at - (bend == 0.0 ? 0.0 : (after - before) * (after - before) / (8.0 * bend));
    }
    return 0.5 * (ends[0] - ends[1]);
}
