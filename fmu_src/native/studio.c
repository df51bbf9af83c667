/* The face for a browser: one mechanism, what is given and what is computed in memory that the page reads and writes.

   Numbers go in through studio_given (by value reference) and studio_desk, and come out in rows: time, state, outputs, and x, y
   and z of every joint of the picture. Nothing is allocated and nothing is imported: a module is as good as its memory. */
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "drawing.h"
#include "plant.h"
#include "tableau.h"

#define FACE(name) __attribute__((export_name(#name))) name

enum {
    PLACES = 3 * JOINTS,
    ROW = 1 + STATES + OUTPUTS + PLACES,
    MOST_ROWS = 4096,
    MOST = 2 * FREEDOMS,             /* components of y at most */
    LENGTH = MOST + 1 + MOST * MOST, /* y, the time, the derivative of y with respect to y at the start */
    TRIALS = 40,                     /* iterations of Newton's method */
    SETTLING = 100,                  /* turns for which a motion is followed where that fails */
    CORRECTIONS = 60                 /* of a drag */
};

/* Local error of a step over an angle; where a motion settles; largest correction of what counts as found, and of a trial. */
static const double FINE = 1e-12, COARSE = 1e-8, FOUND = 1e-10, REACH = 1.0;

/* Of a turn (rad). */
static const double QUARTER = 1.5707963267948966;

static Plant plant;
static Reason reason;
static char sentence[SENTENCE];
static double rows[MOST_ROWS * ROW];

/* Seen from the page: in, view (2 by 3) and target of a drag; out, what was found of a periodic motion. */
static struct {
    double view[6], target[2];
} desk;

static struct {
    double size, residual, iterations, period;
    double y[MOST], monodromy[MOST * MOST], real[MOST], imaginary[MOST];
} found;

/* A periodic motion over the crank's angle: which components of the state make up y, the others as they are held. */
static struct {
    int size, place[MOST];
    double x[STATES], u[ROOM(INPUTS)];
} section;

double *FACE(studio_given)(void) {
    return plant.given;
}
double *FACE(studio_desk)(void) {
    return (double *)&desk;
}
double *FACE(studio_rows)(void) {
    return rows;
}
double *FACE(studio_found)(void) {
    return (double *)&found;
}
const char *FACE(studio_sentence)(void) {
    return sentence;
}

/* All start values in the place of what was given. */
void FACE(studio_reset)(void) {
    plant_reset(&plant);
}

static Reason begin(Plant *a) {
    sentence[0] = 0;
    a->start_time = 0.0;
    return plant_begin(a, sentence);
}

static void joints_of(const Plant *a, double places[ROOM(PLACES)]) {
    double u[ROOM(INPUTS)];
    for (int i = 0; i < INPUTS; i++) u[i] = a->given[input_at[i]];
    equations_joints((const double *[]){a->x, a->modes, u, a->p}, (double *[]){places}, NULL, NULL, 0);
}

static Reason write_row(Plant *a, int number) {
    double *row = rows + number * ROW;
    Reason result = plant_outputs(a, sentence);
    row[0] = a->time;
    memcpy(row + 1, a->x, sizeof a->x);
    memcpy(row + 1 + STATES, a->outputs, sizeof a->outputs);
    if (JOINTS > 0) joints_of(a, row + 1 + STATES + OUTPUTS);
    return result;
}

/* A run from what is given: rows at the start and after each of so many steps. How many there are: one that cannot go on has
   fewer, and one that cannot begin has none; studio_reason and studio_sentence say why. */
int FACE(studio_run)(double step, int count) {
    Reason ended = GOOD;
    int done = 0;
    reason = begin(&plant);
    if (reason == GOOD) reason = write_row(&plant, done);
    if (reason != GOOD) return 0;
    while (done < count && done < MOST_ROWS - 1) {
        reason = plant_step(&plant, done * step, step, NULL, true, &ended, sentence);
        if (reason == GOOD) reason = write_row(&plant, done + 1);
        if (reason != GOOD) break;
        done++;
        if (ended != GOOD) {
            reason = ended;
            break;
        }
    }
    return done + 1;
}

int FACE(studio_reason)(void) {
    return (int)reason;
}

/* The integrator over an angle: DOP853 for any number of components */

typedef bool Slope(double angle, const double z[], double result[], int length);
typedef double Columns[STAGES][LENGTH];

static double attempt(Slope *slope, double angle, const double z[], double h, Columns k, const double scale[], int length,
                      double result[]) {
    double sum5 = 0.0, sum3 = 0.0;
    for (int stage = 1; stage <= STAGES; stage++) {
        for (int i = 0; i < length; i++) {
            double sum = 0.0;
            for (int w = A_ROW[stage]; w < A_ROW[stage + 1]; w++) sum += A_WEIGHT[w] * k[A_STAGE[w]][i];
            result[i] = z[i] + h * sum;
        }
        if (stage < STAGES && !slope(angle + C[stage] * h, result, k[stage], length)) return NAN;
    }
    for (int i = 0; i < length; i++) {
        double weight = 1.0 / (scale[i] + fmax(fabs(z[i]), fabs(result[i]))), error5 = 0.0, error3 = 0.0;
        for (int e = 0; e < ERROR_STAGES; e++) {
            error5 += E5[e] * k[E_STAGE[e]][i];
            error3 += E3[e] * k[E_STAGE[e]][i];
        }
        sum5 += error5 * weight * (error5 * weight);
        sum3 += error3 * weight * (error3 * weight);
    }
    double denominator = sum5 + 0.01 * sum3;
    return denominator == 0.0 ? 0.0 : fabs(h) * sum5 / sqrt(denominator * length);
}

/* Take z from one angle to another; `proposal` is the step to begin with, and then that to go on with. */
static bool across(Slope *slope, double from, double to, double z[], const double scale[], int length, double tolerance,
                   double *proposal) {
    static Columns k;
    double result[LENGTH], done = 0.0, whole = to - from;
    for (int steps = 0; steps < MAX_STEPS && done < whole; steps++) {
        double h = fmin(*proposal, whole - done);
        bool last = h >= whole - done;
        if (!slope(from + done, z, k[0], length)) return false;
        double error = attempt(slope, from + done, z, h, k, scale, length, result) / tolerance;
        double factor = error == 0.0 ? GREATEST_FACTOR : SAFETY * pow(error, -1.0 / ORDER);
        if (error <= 1.0) {
            memcpy(z, result, (size_t)length * sizeof *z);
            done = last ? whole : done + h;
            *proposal = fmax(h < *proposal ? *proposal : 0.0, h * fmin(GREATEST_FACTOR, factor));
        } else {
            *proposal = h * (isfinite(error) ? fmax(LEAST_FACTOR, factor) : 0.25);
            if (*proposal < LEAST_STEP * whole) return false;
        }
    }
    return done >= whole;
}

/* The motion over the crank's angle */

static void locate(double angle, const double y[], double x[STATES]) {
    memcpy(x, section.x, sizeof section.x);
    x[CRANK] = angle;
    for (int i = 0; i < section.size; i++) x[section.place[i]] = y[i];
}

/* Rates with respect to the angle, of y, of the time, and of as many columns as there are. */
static bool slope(double angle, const double z[], double result[], int length) {
    int n = section.size, columns = (length - n - 1) / (n ? n : 1);
    double x[STATES], f[STATES];
    locate(angle, z, x);
    double speed = x[FREEDOMS + CRANK];
    equations_derivative((const double *[]){x, plant.modes, section.u, plant.p}, (double *[]){f}, NULL, NULL, 0);
    for (int i = 0; i < n; i++) result[i] = f[section.place[i]] / speed;
    result[n] = 1.0 / speed;
    for (int c = 0; c < columns; c++) {
        const double *column = z + n + 1 + c * n;
        double dx[STATES] = {0}, df[STATES], dy[ROOM(OUTPUTS)], dclearance, du[ROOM(INPUTS)] = {0}, dp[CONSTANTS] = {0};
        for (int i = 0; i < n; i++) dx[section.place[i]] = column[i];
        equations_forward((const double *[]){x, plant.modes, section.u, plant.p, dx, du, dp}, (double *[]){dy, df, &dclearance},
                          NULL, NULL, 0);
        for (int i = 0; i < n; i++)
            result[n + 1 + c * n + i] = (df[section.place[i]] - result[i] * dx[FREEDOMS + CRANK]) / speed;
    }
    for (int i = 0; i < length; i++)
        if (!isfinite(result[i])) return false;
    return true;
}

static void scale_of(double scale[LENGTH]) {
    int n = section.size;
    for (int i = 0; i < n; i++) scale[i] = plant.scale[section.place[i]];
    scale[n] = PERIOD / fmax(1.0, fabs(section.x[FREEDOMS + CRANK]));
    for (int c = 0; c < n; c++)
        for (int i = 0; i < n; i++) scale[n + 1 + c * n + i] = scale[i] / scale[c];
}

/* Once round: y at the end, and the monodromy matrix where that is asked for, column by column. */
static bool once_round(double y[], double monodromy[], double tolerance, double *proposal) {
    int n = section.size, length = n + 1 + (monodromy ? n * n : 0), quarters = 16;
    double z[LENGTH] = {0}, scale[LENGTH], x[STATES];
    scale_of(scale);
    memcpy(z, y, (size_t)n * sizeof *z);
    for (int i = 0; monodromy && i < n; i++) z[n + 1 + i * n + i] = 1.0;
    for (int part = 0; part < quarters; part++) {
        double to = PERIOD * (part + 1) / quarters;
        bool good = across(slope, PERIOD * part / quarters, to, z, scale, length, tolerance, proposal);
        locate(good ? to : PERIOD * part / quarters, z, x);
        reason = plant_check_assembly(&plant, x, sentence);
        if (reason == GOOD && !good) {
            Digits degrees;
            reason = TOLERANCE_NOT_MET;
            snprintf(sentence, SENTENCE, "a turn cannot be followed beyond crank angle %s deg",
                     digits(degrees, 360.0 * part / quarters));
        }
        if (reason != GOOD) return false;
    }
    memcpy(y, z, (size_t)n * sizeof *z);
    if (monodromy) memcpy(monodromy, z + n + 1, (size_t)(n * n) * sizeof *z);
    found.period = z[n];
    return true;
}

/* What makes up y under the modes in force; the reason why there is no periodic motion over an angle. */
static Reason cut(void) {
    const Plant *a = &plant;
    bool held[FREEDOMS] = {false};
    if (CRANK < 0) {
        snprintf(sentence, SENTENCE, "no freedom turns: there is no periodic motion over an angle");
        return INTERNAL;
    }
    for (int i = 0; i < INPUTS; i++) section.u[i] = a->given[input_at[i]];
    memcpy(section.x, a->x, sizeof section.x);
    for (int i = 0; i < FREEDOMS; i++) held[i] = mode_of[i] >= 0 && !(freeing[i] >> (int)a->modes[mode_of[i]] & 1);
    for (int c = 0; c < COMMANDS; c++) {
        const Command *command = &commands[c];
        if (command->mode >= 0 && a->modes[command->mode] != command->value) continue;
        held[command->rate - FREEDOMS] = true;
        if (command->rate != FREEDOMS + CRANK && section.u[command->input] != 0.0) {
            snprintf(sentence, SENTENCE, "%s is not 0: a motion that goes on so is not periodic",
                     variables[input_at[command->input]].name);
            return INPUT_NOT_FINITE;
        }
    }
    section.size = 0;
    for (int rate = 0; rate < 2; rate++)
        for (int i = 0; i < FREEDOMS; i++)
            if (i != CRANK && !held[i]) section.place[section.size++] = rate * FREEDOMS + i;
    if (!held[CRANK]) section.place[section.size++] = FREEDOMS + CRANK;
    for (int i = 2 * FREEDOMS; i < STATES; i++) section.x[i] = 0.0;
    if (section.x[FREEDOMS + CRANK] == 0.0) {
        snprintf(sentence, SENTENCE, "the crank is at rest: there is no periodic motion");
        return INPUT_NOT_FINITE;
    }
    return GOOD;
}

/* Solve a system of equations in place, its matrix row by row, by elimination; whether it has a solution. */
static bool solve(double matrix[], double right[], int n) {
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

/* Newton's method for y at the end equal to y at the start. */
static bool newton(double y[]) {
    int n = section.size;
    double scale[LENGTH], proposal = PERIOD / 64.0;
    bool close = false;
    scale_of(scale);
    for (int trial = 1; trial <= TRIALS; trial++) {
        double end[MOST], matrix[MOST * MOST], residual = 0.0, size = 0.0;
        memcpy(end, y, sizeof end);
        if (!once_round(end, found.monodromy, FINE, &proposal)) return false;
        for (int i = 0; i < n; i++) {
            end[i] -= y[i];
            residual = fmax(residual, fabs(end[i]) / scale[i]);
        }
        for (int r = 0; r < n; r++)
            for (int c = 0; c < n; c++) matrix[r * n + c] = (r == c) - found.monodromy[c * n + r];
        if (!solve(matrix, end, n)) break;
        for (int i = 0; i < n; i++) size = fmax(size, fabs(end[i]) / scale[i]);
        if (!isfinite(size)) break;
        found.residual = residual;
        found.iterations = trial;
        for (int i = 0; i < n; i++) y[i] += end[i] * (size > REACH ? REACH / size : 1.0);
        /* once more, so that the matrix is that of the motion found */
        if (close || n == 0) return true;
        close = size < FOUND;
    }
    Digits number;
    reason = TOLERANCE_NOT_MET;
    snprintf(sentence, SENTENCE, "no periodic motion found: Newton's method leaves a residual of %s",
             digits(number, found.residual));
    return false;
}

/* The eigenvalues of the monodromy matrix, the largest modulus first: the roots of its characteristic polynomial. */
static void multipliers(void) {
    int n = section.size;
    double m[MOST * MOST] = {0}, coefficient[MOST + 1] = {1.0};
    double complex root[MOST];
    for (int k = 1; k <= n; k++) { /* Faddeev and Le Verrier */
        double next[MOST * MOST] = {0}, trace = 0.0;
        for (int i = 0; i < n; i++) m[i * n + i] += coefficient[k - 1];
        for (int r = 0; r < n; r++)
            for (int c = 0; c < n; c++)
                for (int i = 0; i < n; i++) next[r * n + c] += found.monodromy[i * n + r] * m[i * n + c];
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
        found.real[i] = creal(root[i]);
        found.imaginary[i] = cimag(root[i]);
    }
}

/* The periodic motion under what is given, its monodromy matrix and multipliers, sought from y as it was found before (warm), from
   the state at the start, and from where that settles; whether there is one. */
int FACE(studio_orbit)(int warm) {
    double y[MOST] = {0}, start[MOST] = {0}, before[MOST], proposal = PERIOD / 64.0;
    char first[SENTENCE];
    int sized = (int)found.size;
    memcpy(before, found.y, sizeof before);
    found.size = 0.0;
    reason = begin(&plant);
    if (reason == GOOD) reason = cut();
    if (reason != GOOD) return 0;
    int n = section.size;
    for (int i = 0; i < n; i++) y[i] = start[i] = plant.x[section.place[i]];
    if (warm && sized == n) memcpy(y, before, sizeof y);
    bool good = newton(y);
    memcpy(first, sentence, sizeof first);
    if (!good) {
        double scale[LENGTH], change = INFINITY;
        scale_of(scale);
        memcpy(y, start, sizeof y);
        for (int turn = 0; turn < SETTLING && change > 1e-4; turn++) {
            double end[MOST];
            memcpy(end, y, sizeof end);
            if (!once_round(end, NULL, COARSE, &proposal)) break;
            change = 0.0;
            for (int i = 0; i < n; i++) change = fmax(change, fabs(end[i] - y[i]) / scale[i]);
            memcpy(y, end, sizeof y);
        }
        good = newton(y);
    }
    if (!good) return 0;
    reason = GOOD;
    sentence[0] = 0;
    memcpy(found.y, y, sizeof y);
    found.size = n;
    multipliers();
    return 1;
}

/* Rows of the periodic motion that was found, at so many equal steps of the crank's angle and at the end. How many there are. */
int FACE(studio_turn)(int steps) {
    int n = section.size, length = n + 1;
    double z[LENGTH] = {0}, scale[LENGTH], proposal = PERIOD / 64.0;
    Plant shown = plant;
    if (steps >= MOST_ROWS) steps = MOST_ROWS - 1;
    scale_of(scale);
    memcpy(z, found.y, (size_t)n * sizeof *z);
    for (int number = 0;; number++) {
        locate(PERIOD * number / steps, z, shown.x);
        shown.time = z[n];
        reason = plant_check_assembly(&shown, shown.x, sentence);
        if (reason == GOOD) reason = write_row(&shown, number);
        if (reason != GOOD) return number;
        if (number == steps) return number + 1;
        if (!across(slope, PERIOD * number / steps, PERIOD * (number + 1) / steps, z, scale, length, FINE, &proposal)) {
            reason = TOLERANCE_NOT_MET;
            return number + 1;
        }
    }
}

/* A drag: the joint, and the given values that are moved. */
typedef struct {
    int joint, count, moved[2];
} Drag;

/* How far a joint is from the target, in the view; the square of it. */
static double miss_of(const Plant *a, const Drag *drag, double miss[2]) {
    double places[ROOM(PLACES)];
    joints_of(a, places);
    for (int i = 0; i < 2; i++) {
        miss[i] = desk.target[i];
        for (int d = 0; d < 3; d++) miss[i] -= desk.view[3 * i + d] * places[3 * drag->joint + d];
    }
    return miss[0] * miss[0] + miss[1] * miss[1];
}

/* The change of the moved values that Gauss and Newton would make. */
static bool correction(const Plant *a, const Drag *drag, const double miss[2], double step[2]) {
    double own[ROOM(PARAMETERS)], state[2 * FREEDOMS], u[ROOM(INPUTS)], slopes[2][2] = {{0}}, matrix[4], largest = 0.0;
    int count = drag->count;
    for (int i = 0; i < PARAMETERS; i++) own[i] = a->given[parameter_at[i]];
    for (int i = 0; i < 2 * FREEDOMS; i++) state[i] = a->given[initial_at[i]];
    for (int i = 0; i < INPUTS; i++) u[i] = a->given[input_at[i]];
    for (int m = 0; m < count; m++) {
        double down[ROOM(PARAMETERS)], dstate[2 * FREEDOMS], changes[ROOM(PLACES)];
        for (int i = 0; i < PARAMETERS; i++) down[i] = parameter_at[i] == drag->moved[m];
        for (int i = 0; i < 2 * FREEDOMS; i++) dstate[i] = initial_at[i] == drag->moved[m];
        equations_joints_forward((const double *[]){a->modes, own, state, u, down, dstate}, (double *[]){changes}, NULL, NULL,
                                 0);
        for (int i = 0; i < 2; i++)
            for (int d = 0; d < 3; d++) slopes[i][m] += desk.view[3 * i + d] * changes[3 * drag->joint + d];
    }
    for (int r = 0; r < count; r++) {
        step[r] = slopes[0][r] * miss[0] + slopes[1][r] * miss[1];
        for (int c = 0; c < count; c++) matrix[r * count + c] = slopes[0][r] * slopes[0][c] + slopes[1][r] * slopes[1][c];
        largest = fmax(largest, matrix[r * count + r]);
    }
    for (int r = 0; r < count; r++) matrix[r * count + r] += 1e-14 * largest; /* a point that cannot move both ways */
    return solve(matrix, step, count);
}

/* Take a joint towards the target as far as the links let it; the square of what is left, and what was in the way. */
static double approach(Plant *a, const Drag *drag, char blocked[SENTENCE]) {
    double miss[2], step[2], left = miss_of(a, drag, miss);
    blocked[0] = 0;
    for (int trial = 0; trial < CORRECTIONS; trial++) {
        bool better = false;
        if (!correction(a, drag, miss, step)) break;
        blocked[0] = 0;
        for (double share = 1.0; share > 1e-9 && !better; share *= 0.5) {
            Plant tried = *a;
            double after[2];
            for (int m = 0; m < drag->count; m++) tried.given[drag->moved[m]] += share * step[m];
            if (begin(&tried) != GOOD) {
                memcpy(blocked, sentence, sizeof sentence);
                continue;
            }
            double square = miss_of(&tried, drag, after);
            better = square < left;
            if (better) {
                *a = tried;
                left = square;
                memcpy(miss, after, sizeof miss);
            }
        }
        if (!better) break;
    }
    return left;
}

/* Change one or two given values (the second -1 for none) so that a joint, seen in the view, comes as near to the target as the
   links let it; row 0 is of what was reached. The reason why it went no further. */
int FACE(studio_drag)(int joint, int first, int second) {
    const Drag drag = {joint, second < 0 ? 1 : 2, {first, second}};
    char blocked[SENTENCE], other[SENTENCE];
    reason = begin(&plant);
    if (reason != GOOD) return (int)reason;
    Plant start = plant;
    double left = approach(&plant, &drag, blocked);
    /* past the centre of a circle the way is round it: from other angles too */
    for (int m = 0; m < drag.count && blocked[0]; m++)
        for (int quarter = 1; quarter < 4 && strcmp(variables[drag.moved[m]].unit, "rad") == 0; quarter++) {
            Plant turned = start;
            turned.given[drag.moved[m]] += quarter * QUARTER;
            if (begin(&turned) != GOOD) continue;
            double square = approach(&turned, &drag, other);
            if (square < left) {
                plant = turned;
                left = square;
                memcpy(blocked, other, sizeof blocked);
            }
        }
    reason = write_row(&plant, 0);
    if (reason == GOOD && blocked[0]) {
        reason = LIMIT_OF_ASSEMBLY;
        memcpy(sentence, blocked, sizeof blocked);
    }
    return (int)reason;
}
