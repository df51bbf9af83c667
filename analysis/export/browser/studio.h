/* What the parts of the page's module share. */
#ifndef STUDIO_H
#define STUDIO_H

#include "drawing.h"
#include "plant.h"

#define FACE(name) __attribute__((export_name(#name))) name

enum {
    MOST_ROWS = 4096,
    MOST = 2 * FREEDOMS, /* components of a periodic motion at most */
    SAMPLES = 256        /* of a turn, for its amplitude */
};

/* Of a turn (rad). */
static const double QUARTER = 1.5707963267948966;

/* What is given and how it moves; why the last call went no further. */
extern Plant plant;
extern Reason reason;
extern char sentence[SENTENCE];

/* State and constants from what is given. */
Reason begin(Plant *a);

/* Write a row: see studio.c. */
Reason write_row(Plant *a, int number);

/* Solve a system of equations in place, its matrix row by row, by elimination; whether it has a solution. */
bool solve(double matrix[], double right[], int n);

/* The eigenvalues of a matrix, the largest modulus first: the roots of its characteristic polynomial. */
void eigenvalues(const double matrix[], int n, double real[], double imaginary[]);

/* Half of how far a turn swings: from its Fourier series, on a grid eight times as fine, and the parabolas through the greatest
   and the least value. */
double swing_amplitude(const double samples[SAMPLES]);

#endif
