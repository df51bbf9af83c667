/* Periodic motions over the crank's angle: by Newton's method, one after another along a branch, and how far they swing. The twin, for
   a browser without Python, of analysis/periodic/motion and response/branch.py; tests of the studio hold the numbers equal. */
#include "studio.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "step.h"

enum {
    LENGTH = MOST + 1 + MOST * (MOST + 1), /* y, the time, the derivatives of y by y at the start and by what is varied */
    TRIALS = 40,                           /* iterations of Newton's method */
    SETTLING = 100,                        /* turns for which a motion is followed where that fails */
    TURN_SAMPLES = 1024,                   /* for the mean mass */
    NEAR_TRIALS = 8,                       /* iterations for the next point of a branch */
    REFINEMENTS = 30                       /* of the place of a special point */
};

/* Local error of a step over an angle; where a motion settles; largest correction of what counts as found, of what counts where
   corrections fall no further, as at kinks of a force law, and of a trial on a branch; least part of a correction. */
static const double FINE = 1e-12, COARSE = 1e-8, FOUND = 1e-10, NOISE = 1e-7, REACH = 1.0, LEAST_SHARE = 1.0 / 4096.0;

/* Greatest error of the columns in a step across a kink, relative to the tolerance. */
static const double KINK = 1e6;

/* Of a branch, relative to the range and the scale of y: the least and the greatest step, the greatest of what is varied, and the
   least cosine of the angle by which the branch may turn in one. */
static const double LEAST_ALONG = 1e-9, GREATEST_ALONG = 0.1, GREATEST_VARIED = 0.01, STRAIGHT = 0.97;

/* What was found of a periodic motion: seen from the page, and y as it was before, to begin with. */
static struct {
    double size, residual, iterations, period;
    double y[MOST], monodromy[MOST * MOST], real[MOST], imaginary[MOST];
    double value;                           /* of what is varied along a branch */
    double kind;                            /* of a point of a branch */
    double count, place[MOST], swing[MOST]; /* of those of y that swing: how many, where in the state, and their amplitudes */
} found = {.count = 1.0};

double *FACE(studio_found)(void) {
    return (double *)&found;
}

/* A periodic motion over the crank's angle: which components of the state make up y, the others as they are held; what y grows
   by in a turn of the crank, where links make whole turns: a motion closes apart from that. */
static struct {
    int size, place[MOST];
    double x[STATES], u[ROOM(INPUTS)], growth[MOST];
} section;

/* What is varied along a branch: its value reference, of what is given of the motor -1 and below; how the state that y leaves
   out, inputs and constants change with it; and the derivative of the map over a turn. */
static struct {
    int reference;
    double x[STATES], u[ROOM(INPUTS)], p[CONSTANTS], motor[MOTOR], along[MOST];
} varied;

/* The motion over the crank's angle */

/* A branch: the point that was reached, the way on, both relative to range and scale, the step, and the test functions; the
   special point that was reached last, if it is one. */
static struct {
    double size, value, y[MOST], way[MOST + 1], step, tests[3];
    int kind;
} branch = {.size = 1.0};

/* Whether friction is switched on that the equations solve for. */
static bool jams(void) {
    return SWITCH >= 0 && plant.p[SWITCH < 0 ? 0 : SWITCH] != 0.0;
}

static void locate(double angle, const double y[], double x[STATES]) {
    memcpy(x, section.x, sizeof section.x);
    x[CRANK] = angle;
    for (int i = 0; i < section.size; i++) x[section.place[i]] = y[i];
}

/* The motor, or one that there is not. */
static const double *drive(void) {
    static const double none[MOTOR] = {0.0, 1.0, 1.0};
    return motor[0] == 0.0 ? none : motor;
}

/* Change of the accelerations with the state, and where `varies` with what is varied. */
static void accelerations(const double x[STATES], const double by_state[], const double dx[STATES], bool varies,
                          double result[]) {
    static const double none_of_motor[MOTOR], none[ROOM(INPUTS)], nothing[CONSTANTS];
    const double *du = varies ? varied.u : none, *dp = varies ? varied.p : nothing;
    if (jams()) { /* the solution for the friction is in the function for all */
        double dy[ROOM(OUTPUTS)], df[STATES], dclearance;
        memcpy(motor_change, varies ? varied.motor : none_of_motor, sizeof motor_change);
        equations_forward((const double *[]){x, plant.modes, section.u, plant.p, dx, du, dp}, (double *[]){dy, df, &dclearance},
                          NULL, NULL, 0);
        memcpy(result, df + FREEDOMS, FREEDOMS * sizeof *df);
    } else if (varies) {
        equations_along((const double *[]){x, plant.modes, section.u, plant.p, drive(), dx, du, dp, varied.motor},
                        (double *[]){result}, NULL, NULL, 0);
    } else {
        for (int r = 0; r < FREEDOMS; r++) {
            result[r] = 0.0;
            for (int c = 0; c < 2 * FREEDOMS; c++) result[r] += by_state[r + FREEDOMS * c] * dx[c];
        }
    }
}

/* Rates with respect to the angle, of y, of the time, and of as many columns as there are. */
static bool slope(const void *context, double angle, const double z[], double result[], int length) {
    (void)context; /* the plant is one: see studio.h */
    int n = section.size, columns = (length - n - 1) / (n ? n : 1);
    double x[STATES], f[STATES], by_state[2 * FREEDOMS * FREEDOMS];
    locate(angle, z, x);
    double speed = x[FREEDOMS + CRANK];
    if (columns > 0 && !jams()) {
        equations_slopes((const double *[]){x, plant.modes, section.u, plant.p, drive()}, (double *[]){f, by_state}, NULL, NULL,
                         0);
    } else {
        equations_derivative((const double *[]){x, plant.modes, section.u, plant.p}, (double *[]){f}, NULL, NULL, 0);
    }
    for (int i = 0; i < n; i++) result[i] = f[section.place[i]] / speed;
    result[n] = 1.0 / speed;
    for (int c = 0; c < columns; c++) {
        const double *column = z + n + 1 + c * n;
        double dx[STATES] = {0}, df[2 * FREEDOMS];
        if (c == n) memcpy(dx, varied.x, sizeof dx); /* the last is of what is varied */
        for (int i = 0; i < n; i++) dx[section.place[i]] = column[i];
        memcpy(df, dx + FREEDOMS, FREEDOMS * sizeof *df);
        accelerations(x, by_state, dx, c == n, df + FREEDOMS);
        for (int i = 0; i < n; i++)
            result[n + 1 + c * n + i] = (df[section.place[i]] - result[i] * dx[FREEDOMS + CRANK]) / speed;
    }
    for (int i = 0; i < length; i++)
        if (!isfinite(result[i])) return false;
    return true;
}

/* The clearance to the limit of assembly. */
static double clearance(double angle, const double y[]) {
    double x[STATES], result;
    locate(angle, y, x);
    equations_clearance((const double *[]){x, plant.modes, section.u, plant.p}, (double *[]){&result}, NULL, NULL, 0);
    return result;
}

/* The step, shortened so that no freedom, at its rate, moves by more than its reach, and the clearance falls by no more than half;
   `rates` are those of z, and `gap` is its clearance. */
static double bounded_step(double step, double angle, const double z[], const double rates[], const double scale[],
                           double gap) {
    double ahead[MOST];
    step = fmin(step, reach[CRANK < 0 ? 0 : CRANK]);
    for (int i = 0; i < section.size && section.place[i] < FREEDOMS; i++)
        if (step * fabs(rates[i]) > reach[section.place[i]] * scale[i])
            step = reach[section.place[i]] * scale[i] / fabs(rates[i]);
    for (int i = 0; i < section.size; i++) ahead[i] = z[i] + PROBE * step * rates[i];
    return step_short_of_limit(step, gap, clearance(angle + PROBE * step, ahead));
}

/* Take z from one angle, which becomes the angle reached, to another; `proposal` is the step to begin with, and then that to go on
   with. */
static bool across(double *from, double to, double z[], const double scale[], int length, double tolerance, double *proposal) {
    static double k[STAGES * LENGTH];
    double result[LENGTH], begin = *from, done = 0.0, whole = to - begin, gap = clearance(begin, z);
    for (int steps = 0; steps < MAX_STEPS && done < whole; steps++) {
        if (!slope(NULL, *from, z, k, length)) return false;
        *proposal = bounded_step(*proposal, *from, z, k, scale, gap); /* the step after a shortened one grows from it */
        bool last = *proposal >= whole - done;
        double h = fmin(*proposal, whole - done);
        double error = attempt_step(slope, NULL, *from, z, h, k, scale, length, result) / tolerance;
        *proposal = fmax(error <= 1.0 && h < *proposal ? *proposal : 0.0, h * step_factor(error));
        bool least = *proposal < LEAST_STEP * whole;
        /* at a kink of a force law, as at a stop, the rates of the columns jump: the least step is taken if y is accurate */
        if (error <= 1.0 ||
            (least && error < KINK && step_error(z, result, h, k, scale, length, section.size + 1) <= tolerance)) {
            memcpy(z, result, (size_t)length * sizeof *z);
            done = last ? whole : done + h;
            *from = last ? to : begin + done;
            gap = clearance(*from, z);
            if (!(gap >= LIMIT_CLEARANCE)) return false;
        } else if (least) {
            return false;
        }
    }
    return done >= whole;
}

static void motion_scales(double scale[LENGTH]) {
    int n = section.size;
    double *along = scale + n + 1 + n * n;
    for (int i = 0; i < n; i++) scale[i] = plant.scale[section.place[i]];
    scale[n] = PERIOD / fmax(1.0, fabs(section.x[FREEDOMS + CRANK]));
    for (int c = 0; c < n; c++)
        for (int i = 0; i < n; i++) scale[n + 1 + c * n + i] = scale[i] / scale[c];
    for (int i = 0; i < n; i++) along[i] = scale[i] / branch.size;
}

/* Once round: y at the end, so many columns of the monodromy matrix, and the derivative by what is varied where one more is
   asked for. */
static bool once_round(double y[], int columns, double tolerance, double *proposal) {
    int n = section.size, length = n + 1 + columns * n, quarters = 16;
    double z[LENGTH] = {0}, scale[LENGTH], x[STATES], angle = 0.0;
    motion_scales(scale);
    memcpy(z, y, (size_t)n * sizeof *z);
    for (int i = 0; i < n && i < columns; i++) z[n + 1 + i * n + i] = 1.0;
    for (int part = 0; part < quarters; part++) {
        bool good = across(&angle, PERIOD * (part + 1) / quarters, z, scale, length, tolerance, proposal);
        locate(angle, z, x);
        reason = plant_check_assembly(&plant, x, sentence);
        if (reason == GOOD && !good) {
            Digits degrees;
            reason = TOLERANCE_NOT_MET;
            snprintf(sentence, SENTENCE, "a turn cannot be followed beyond crank angle %s deg",
                     digits(degrees, 90.0 * angle / QUARTER));
        }
        if (reason != GOOD) return false;
    }
    for (int i = 0; i < n; i++) y[i] = z[i] - section.growth[i];
    if (columns >= n) memcpy(found.monodromy, z + n + 1, (size_t)(n * n) * sizeof *z);
    if (columns > n) memcpy(varied.along, z + n + 1 + n * n, (size_t)n * sizeof *z);
    found.period = z[n];
    return true;
}

/* Whole turns in a change of a component of y, where that is a rotation that no spring couples to the crank. */
static double whole_turns(int component, double change) {
    int place = section.place[component];
    return place < FREEDOMS && rounds[place] > 0.0 ? rounds[place] * round(change / rounds[place]) : 0.0;
}

/* What makes up y under the modes in force; the reason why there is no periodic motion over an angle. */
static Reason cut(void) {
    const Plant *a = &plant;
    bool held[FREEDOMS] = {false};
    if (CRANK < 0) {
        snprintf(sentence, SENTENCE, "no freedom turns: there is no periodic motion over an angle");
        return INTERNAL;
    }
    plant_inputs(a, section.u);
    memcpy(section.x, a->x, sizeof section.x);
    for (int i = 0; i < FREEDOMS; i++) held[i] = mode_of[i] >= 0 && !(freeing[i] >> (int)a->modes[mode_of[i]] & 1);
    for (int c = 0; c < COMMANDS; c++) {
        const Command *command = &commands[c];
        if (command->mode >= 0 && a->modes[command->mode] != command->value) continue;
        held[command->rate - FREEDOMS] = true;
        if (command->rate != FREEDOMS + CRANK && section.u[command->input] != 0.0) {
            snprintf(sentence, SENTENCE, "%s is not 0: periodic motions are sought where only the crank goes on at a speed",
                     variables[input_at[command->input]].name);
            return INPUT_NOT_FINITE;
        }
    }
    section.size = 0;
    memset(section.growth, 0, sizeof section.growth);
    for (int rate = 0; rate < 2; rate++)
        for (int i = 0; i < FREEDOMS; i++)
            if (i != CRANK && !held[i]) section.place[section.size++] = rate * FREEDOMS + i;
    if (!held[CRANK]) section.place[section.size++] = FREEDOMS + CRANK;
    for (int i = 0; i < section.size; i++) {
        int at = section.place[i];
        if (at >= FREEDOMS) break;
        double turned = PERIOD * section.x[FREEDOMS + at] / section.x[FREEDOMS + CRANK];
        /* another crank makes as many turns as the speeds at the start say */
        section.growth[i] = coupled[at] + (swings[at] || !isfinite(turned) ? 0.0 : whole_turns(i, turned));
    }
    for (int i = 2 * FREEDOMS; i < STATES; i++) section.x[i] = 0.0;
    section.x[CRANK] = 0.0;
    found.count = 0.0;
    for (int i = 0; i < section.size; i++) { /* coordinates; where none is free, the speed of the crank */
        if (i > 0 && section.place[i] >= FREEDOMS) break;
        found.place[i] = section.place[i];
        found.count++;
    }
    if (section.x[FREEDOMS + CRANK] == 0.0 && !held[CRANK] && motor[0] != 0.0) /* a run-up is not followed */
        section.x[FREEDOMS + CRANK] = motor[2] * (1.0 - 0.5 * motor[1]);
    if (section.x[FREEDOMS + CRANK] == 0.0) {
        snprintf(sentence, SENTENCE, "the crank is at rest: there is no periodic motion");
        return INPUT_NOT_FINITE;
    }
    if (section.x[FREEDOMS + CRANK] < 0.0) {
        snprintf(sentence, SENTENCE, "the crank turns backwards: periodic motions are sought where it turns forwards");
        return INPUT_NOT_FINITE;
    }
    return GOOD;
}

/* Newton's correction of y, whose turn has this end and monodromy matrix; its size relative to the scales, not finite where there
   is none. */
static double correction(const double y[], const double end[], const double monodromy[], const double scale[],
                         double change[]) {
    int n = section.size;
    double matrix[MOST * MOST], size = 0.0;
    for (int r = 0; r < n; r++) {
        change[r] = end[r] - y[r];
        for (int c = 0; c < n; c++) matrix[r * n + c] = (r == c) - monodromy[c * n + r];
    }
    if (!solve(matrix, change, n)) return INFINITY;
    for (int i = 0; i < n; i++) size = isfinite(change[i]) ? fmax(size, fabs(change[i]) / scale[i]) : INFINITY;
    return size;
}

/* Newton's method for y at the end equal to y at the start. A correction is taken in part where the next one by the same matrix
   would not be smaller (Deuflhard's natural monotonicity test), and where the turn after it cannot be followed. */
static bool newton(double y[]) {
    int n = section.size, corrections = 0;
    double scale[LENGTH], trial[MOST], change[MOST] = {0}, before[MOST * MOST];
    double proposal = PERIOD / 64.0, share = 1.0, size = 0.0;
    motion_scales(scale);
    memcpy(trial, y, sizeof trial);
    while (corrections < TRIALS) {
        double end[MOST], next[MOST];
        memcpy(before, found.monodromy, sizeof before);
        memcpy(end, trial, sizeof end);
        bool good = once_round(end, n, FINE, &proposal);
        if (corrections == 0 && !good) return false;
        if (corrections > 0 &&
            !(good && correction(trial, end, before, scale, next) <= fmax((1.0 - 0.25 * share) * size, FOUND))) {
            share *= 0.5;
            if (share < LEAST_SHARE) {
                if (!good || size < NOISE) return good;
                break;
            }
            memcpy(found.monodromy, before, sizeof before);
        } else {
            bool close = corrections > 0 && size < FOUND;
            memcpy(y, trial, sizeof trial);
            found.residual = 0.0;
            for (int i = 0; i < n; i++) found.residual = fmax(found.residual, fabs(end[i] - y[i]) / scale[i]);
            size = correction(y, end, found.monodromy, scale, change);
            if (!isfinite(size)) break;
            found.iterations = ++corrections;
            share = fmin(1.0, 4.0 * share);
            /* once more, so that the matrix is that of the motion found */
            if (close || n == 0) {
                for (int i = 0; i < n; i++) y[i] += change[i];
                return true;
            }
        }
        for (int i = 0; i < n; i++) trial[i] = y[i] + share * change[i];
    }
    Digits number;
    reason = TOLERANCE_NOT_MET;
    snprintf(sentence, SENTENCE, "no periodic motion found: Newton's method leaves a residual of %s",
             digits(number, found.residual));
    return false;
}

/* A motion in which links make as many whole turns as in the turn of the crank after this start, or else none. */
static bool newton_with_rounds(double y[]) {
    double end[MOST], start[MOST], growth[MOST], proposal = PERIOD / 64.0;
    bool may_turn = false;
    memcpy(start, y, sizeof start);
    memcpy(end, y, sizeof end);
    memcpy(growth, section.growth, sizeof growth);
    for (int i = 0; i < section.size && section.place[i] < FREEDOMS; i++) may_turn = may_turn || swings[section.place[i]];
    if (may_turn && once_round(end, 0, COARSE, &proposal)) {
        for (int i = 0; i < section.size && section.place[i] < FREEDOMS; i++)
            if (swings[section.place[i]]) section.growth[i] += whole_turns(i, end[i] - y[i]);
        if (memcmp(growth, section.growth, sizeof growth) != 0) {
            if (newton(y)) return true;
            memcpy(section.growth, growth, sizeof growth);
            memcpy(y, start, sizeof start);
        }
    }
    return newton(y);
}

/* The periodic motion under what is given, its monodromy matrix and multipliers, sought from y as it was found before (warm), from
   the state at the start, and from where that settles; whether there is one. */
int FACE(studio_orbit)(int warm) {
    double y[MOST] = {0}, start[MOST] = {0}, before[MOST], proposal = PERIOD / 64.0;
    int sized = (int)found.size;
    memcpy(before, found.y, sizeof before);
    found.size = 0.0;
    reason = begin(&plant);
    if (reason == GOOD) reason = cut();
    if (reason != GOOD) return 0;
    int n = section.size;
    for (int i = 0; i < n; i++) y[i] = start[i] = section.x[section.place[i]];
    warm = warm && sized == n;
    if (warm) memcpy(y, before, sizeof y);
    bool good = newton_with_rounds(y);
    if (!good && warm) {
        memcpy(y, start, sizeof y);
        good = newton_with_rounds(y);
    }
    if (!good) {
        double scale[LENGTH], change = INFINITY;
        motion_scales(scale);
        memcpy(y, start, sizeof y);
        for (int turn = 0; turn < SETTLING && change > 1e-4; turn++) {
            double end[MOST];
            memcpy(end, y, sizeof end);
            if (!once_round(end, 0, COARSE, &proposal)) break;
            change = 0.0;
            for (int i = 0; i < n; i++) {
                end[i] -= whole_turns(i, end[i] - y[i]);
                change = fmax(change, fabs(end[i] - y[i]) / scale[i]);
            }
            memcpy(y, end, sizeof y);
        }
        good = newton_with_rounds(y);
    }
    if (!good) return 0;
    for (int i = 0; i < n; i++) y[i] -= whole_turns(i, y[i] - start[i]);
    reason = GOOD;
    sentence[0] = 0;
    memcpy(found.y, y, sizeof y);
    found.size = n;
    eigenvalues(found.monodromy, section.size, found.real, found.imaginary);
    return 1;
}

/* Rows of the periodic motion that was found, at so many equal steps of the crank's angle and at the end. How many there are. */
int FACE(studio_turn)(int steps) {
    int n = section.size, length = n + 1;
    double z[LENGTH] = {0}, scale[LENGTH], proposal = PERIOD / 64.0, angle = 0.0;
    Plant shown = plant;
    if (steps >= MOST_ROWS) steps = MOST_ROWS - 1;
    motion_scales(scale);
    memcpy(z, found.y, (size_t)n * sizeof *z);
    for (int number = 0;; number++) {
        locate(angle, z, shown.x);
        shown.time = z[n];
        reason = plant_check_assembly(&shown, shown.x, sentence);
        if (reason == GOOD) reason = write_row(&shown, number);
        if (reason != GOOD) return number;
        if (number == steps) return number + 1;
        if (!across(&angle, PERIOD * (number + 1) / steps, z, scale, length, FINE, &proposal)) {
            reason = TOLERANCE_NOT_MET;
            return number + 1;
        }
    }
}

/* Branches, by the length of arc */

static double *given_value(int reference) {
    return reference < 0 ? motor + (-1 - reference) : plant.given + reference;
}

/* What is varied to a value, and how all else changes with it. */
static bool vary(double value) {
    double own[ROOM(PARAMETERS)], state[2 * FREEDOMS], u[ROOM(INPUTS)];
    double down[ROOM(PARAMETERS)], dstate[2 * FREEDOMS], growth[MOST], change[VARIABLES] = {0};
    int reference = varied.reference;
    memcpy(growth, section.growth, sizeof growth); /* links go on making as many turns */
    *given_value(reference) = found.value = value;
    reason = begin(&plant);
    if (reason == GOOD) reason = cut();
    if (reason != GOOD) return false;
    memcpy(section.growth, growth, sizeof growth);
    if (reference >= 0) change[reference] = 1.0;
    plant_split(&plant, plant.given, own, state, u);
    plant_split(&plant, change, down, dstate, varied.u);
    equations_begin_forward((const double *[]){plant.modes, own, state, u, down, dstate, varied.u},
                            (double *[]){varied.p, varied.x}, NULL, NULL, 0);
    for (int i = 0; i < MOTOR; i++) varied.motor[i] = -1 - i == reference;
    varied.x[CRANK] = 0.0;
    for (int i = 2 * FREEDOMS; i < STATES; i++) varied.x[i] = 0.0;
    return true;
}

/* The matrix of Newton's method for y and what is varied, relative to their scales, at right angles to a way. */
static void bordered(const double scale[], const double way[], double matrix[]) {
    int n = section.size, m = n + 1;
    for (int r = 0; r < n; r++) {
        for (int c = 0; c < n; c++) matrix[r * m + c] = ((r == c) - found.monodromy[c * n + r]) * scale[c] / scale[r];
        matrix[r * m + n] = -varied.along[r] * branch.size / scale[r];
    }
    memcpy(matrix + n * m, way, (size_t)m * sizeof *way);
}

/* The way on from a point that was just found, in the sense of another; whether there is one. */
static bool next_way(const double scale[], const double before[], double way[]) {
    int m = section.size + 1;
    double matrix[(MOST + 1) * (MOST + 1)], length = 0.0;
    memset(way, 0, (size_t)m * sizeof *way);
    way[m - 1] = 1.0;
    bordered(scale, before, matrix);
    if (!solve(matrix, way, m)) return false;
    for (int i = 0; i < m; i++) length += way[i] * way[i];
    for (int i = 0; i < m; i++) way[i] /= sqrt(length);
    return isfinite(length);
}

/* Go so far along the branch from its point: y, what is varied and the way on from there, and how many iterations it took, 0
   where there is nothing to be found. */
static int along(double step, double y[], double way[]) {
    int m = section.size + 1;
    double scale[LENGTH], matrix[(MOST + 1) * (MOST + 1)], change[MOST + 1], proposal = PERIOD / 64.0;
    double value = branch.value + step * branch.way[m - 1] * branch.size;
    double size = INFINITY;
    bool close = false;
    for (int trial = 1; trial <= NEAR_TRIALS; trial++) {
        double before = size;
        if (!vary(value)) return 0;
        motion_scales(scale);
        for (int i = 0; trial == 1 && i < m - 1; i++) y[i] = branch.y[i] + step * branch.way[i] * scale[i];
        memcpy(change, y, (size_t)(m - 1) * sizeof *y);
        if (!once_round(change, m, FINE, &proposal)) return 0;
        for (int i = 0; i < m - 1; i++) change[i] = (change[i] - y[i]) / scale[i];
        change[m - 1] = 0.0;
        bordered(scale, branch.way, matrix);
        if (!solve(matrix, change, m)) return 0;
        size = 0.0;
        for (int i = 0; i < m; i++) size = fmax(size, fabs(change[i]));
        if (!(size < REACH)) return 0;
        for (int i = 0; i < m - 1; i++) y[i] += change[i] * scale[i];
        value += change[m - 1] * branch.size;
        if (close) return vary(value) && next_way(scale, branch.way, way) ? trial : 0;
        close = size < (size > 0.5 * before ? NOISE : FOUND);
    }
    return 0;
}

/* What changes its sign where the branch turns back, at a doubling of the period, and where a multiplier passes +1. */
static void test_functions(const double way[], double tests[3]) {
    double complex doubling = 1.0, passing = 1.0;
    int n = section.size;
    eigenvalues(found.monodromy, section.size, found.real, found.imaginary);
    for (int i = 0; i < n; i++) {
        doubling *= 1.0 + found.real[i] + I * found.imaginary[i];
        passing *= 1.0 - found.real[i] - I * found.imaginary[i];
    }
    tests[0] = way[n];
    tests[1] = creal(doubling);
    tests[2] = creal(passing);
}

/* Begin a branch at the motion that was found: what is varied, its range, and the sense in which it first goes. */
int FACE(studio_branch)(int reference, double size, double sense) {
    double scale[LENGTH], before[MOST + 1] = {0}, y[MOST], proposal = PERIOD / 64.0;
    int n = section.size;
    varied.reference = reference;
    branch.size = size;
    if (n == 0 || !vary(*given_value(reference))) return 0;
    memcpy(y, found.y, sizeof y);
    if (!once_round(y, n + 1, FINE, &proposal)) return 0;
    motion_scales(scale);
    before[n] = sense;
    if (!next_way(scale, before, branch.way)) return 0;
    memcpy(branch.y, found.y, sizeof branch.y);
    branch.value = found.value;
    branch.step = GREATEST_VARIED;
    branch.kind = 0;
    test_functions(branch.way, branch.tests);
    return 1;
}

/* The place of the special point of a kind within a step, to which it is narrowed down. */
static bool narrow(int kind, double step, double end, double y[], double way[]) {
    double low = 0.0, high = step, at_low = branch.tests[kind - 1], at_high = end, tests[3];
    for (int trial = 0; trial < REFINEMENTS; trial++) {
        double middle = (low * at_high - high * at_low) / (at_high - at_low);
        if (!along(middle, y, way)) return false;
        test_functions(way, tests);
        double at = tests[kind - 1];
        if (fabs(at) < FOUND || high - low < FOUND * step) return true;
        if ((at < 0.0) == (at_high < 0.0)) { /* the end that stays counts half: Illinois */
            high = middle;
            at_high = at;
            at_low *= 0.5;
        } else {
            low = middle;
            at_low = at;
            at_high *= 0.5;
        }
    }
    return true;
}

/* The next point of the branch: found.kind is 1 at a fold, 2 where the period doubles, to which it is narrowed down, else 0. */
int FACE(studio_follow)(void) {
    int n = section.size;
    double y[MOST], way[MOST + 1], tests[3];
    for (double step = branch.step; step > LEAST_ALONG; step *= 0.5) {
        double cosine = 0.0;
        int kind = 0, trials = along(step, y, way);
        for (int i = 0; trials && i <= n; i++) cosine += way[i] * branch.way[i];
        if (!trials || cosine < STRAIGHT) continue;
        test_functions(way, tests);
        bool changed[3];
        for (int k = 0; k < 3; k++) changed[k] = (tests[k] < 0.0) != (branch.tests[k] < 0.0);
        /* where it crosses another branch, it may turn back, but no multiplier passes +1 */
        if (branch.kind != 1 && changed[0] && changed[2]) kind = 1;
        if (!kind && branch.kind != 2 && changed[1]) kind = 2;
        if (kind && !narrow(kind, step, tests[kind - 1], y, way)) continue;
        if (kind) test_functions(way, tests);
        /* past a special point the sign is that of the other side */
        if (kind) tests[kind - 1] = -branch.tests[kind - 1];
        if (kind == 1) tests[2] = -branch.tests[2];
        double grown = step * (trials <= 4 && cosine > 1.0 - 0.2 * (1.0 - STRAIGHT) ? 1.6 : 1.0);
        branch.step = fmin(fmin(grown, GREATEST_ALONG), GREATEST_VARIED / fmax(fabs(way[n]), GREATEST_VARIED / GREATEST_ALONG));
        branch.kind = kind;
        branch.value = found.value;
        memcpy(branch.y, y, sizeof y);
        memcpy(branch.way, way, sizeof way);
        memcpy(branch.tests, tests, sizeof tests);
        memcpy(found.y, y, sizeof y);
        found.size = n;
        found.kind = kind;
        sentence[0] = 0;
        reason = GOOD;
        return 1;
    }
    if (reason == GOOD) {
        reason = TOLERANCE_NOT_MET;
        strcpy(sentence, "no further motion is found there");
    }
    return 0;
}

/* Half of how far each coordinate swings in the motion that was found, apart from its uniform growth; 0 where that is no more than
   rounding. */
void FACE(studio_amplitudes)(void) {
    static double samples[MOST][SAMPLES];
    double z[LENGTH] = {0}, scale[LENGTH], proposal = PERIOD / 64.0, angle = 0.0;
    bool good = true;
    motion_scales(scale);
    memcpy(z, found.y, (size_t)section.size * sizeof *z);
    for (int n = 0; n < SAMPLES && good; n++) {
        for (int i = 0; i < found.count; i++) samples[i][n] = z[i] - section.growth[i] * n / SAMPLES;
        good = across(&angle, PERIOD * (n + 1) / SAMPLES, z, scale, section.size + 1, FINE, &proposal);
    }
    for (int i = 0; i < found.count; i++) {
        double size = swing_amplitude(samples[i]);
        found.swing[i] = !good ? NAN : size > 10.0 * FOUND * scale[i] ? size : 0.0;
    }
}

/* Natural frequency of the freedom beside the crank, from the mean of what moves with it over a turn, the links at rest and it at
   its zero; its stiffness is what is given by this value reference. Not a number where there is none. */
double FACE(studio_natural)(int reference) {
    double mean = 0.0, stiffness = plant.given[reference];
    if (CRANK < 0 || begin(&plant) != GOOD) return NAN;
    for (int i = 0; i < TURN_SAMPLES; i++) {
        double angle = PERIOD * i / TURN_SAMPLES, mass;
        equations_at_rest((const double *[]){&angle, plant.p}, (double *[]){&mass}, NULL, NULL, 0);
        mean += mass / TURN_SAMPLES;
    }
    return stiffness > 0.0 && mean > 0.0 ? sqrt(stiffness / mean) : NAN;
}
