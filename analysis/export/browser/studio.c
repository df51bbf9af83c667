/* The face for a browser: one mechanism, what is given and what is computed in memory that the page reads and writes.

   Numbers go in through studio_given (by value reference), studio_motor and studio_desk, and come out in rows: time, state,
   outputs, x, y and z of every joint of the picture, and the powers lost and supplied. Nothing is allocated and nothing is imported: a module
   is as good as its memory. */
#include "studio.h"

#include <math.h>
#include <string.h>

enum {
    PLACES = 3 * JOINTS,
    ROW = 1 + STATES + OUTPUTS + PLACES + 2,
    CORRECTIONS = 60 /* of a drag */
};

Plant plant;
Reason reason;
char sentence[SENTENCE];
static double rows[MOST_ROWS * ROW];

/* Seen from the page: in, view (2 by 3) and target of a drag; out, what was found of a periodic motion. */
static struct {
    double view[6], target[2];
} desk;

double *FACE(studio_given)(void) {
    return plant.given;
}
double *FACE(studio_desk)(void) {
    return (double *)&desk;
}
double *FACE(studio_rows)(void) {
    return rows;
}
double *FACE(studio_motor)(void) {
    return motor;
}
const char *FACE(studio_sentence)(void) {
    return sentence;
}

/* All start values in the place of what was given. */
void FACE(studio_reset)(void) {
    plant_reset(&plant);
}

Reason begin(Plant *a) {
    sentence[0] = 0;
    a->start_time = 0.0;
    if (motor[0] != 0.0 &&
        !(isfinite(motor[0]) && motor[1] > 0.0 && isfinite(motor[2]) && motor[2] != 0.0 && motor[0] * motor[2] > 0.0)) {
        strcpy(sentence,
               "of the motor the breakdown slip must be above 0, and the synchronous speed must not be 0 and must have "
               "the sign of the breakdown torque");
        return BAD_PARAMETER;
    }
    return plant_begin(a, sentence);
}

static void joint_places(const Plant *a, double places[ROOM(PLACES)]) {
    double u[ROOM(INPUTS)];
    plant_inputs(a, u);
    equations_joints((const double *[]){a->x, a->modes, u, a->p}, (double *[]){places}, NULL, NULL, 0);
}

Reason write_row(Plant *a, int number) {
    double *row = rows + number * ROW, derivative[STATES];
    Reason result = plant_outputs(a, sentence);
    row[0] = a->time;
    memcpy(row + 1, a->x, sizeof a->x);
    memcpy(row + 1 + STATES, a->outputs, sizeof a->outputs);
    if (JOINTS > 0) joint_places(a, row + 1 + STATES + OUTPUTS);
    plant_derivative(a, derivative);
    memcpy(row + ROW - 2, derivative + STATES - 2, 2 * sizeof *row);
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

/* A drag: the joint, and the given values that are moved. */
typedef struct {
    int joint, count, moved[2];
} Drag;

/* How far a joint is from the target, in the view; the square of it. */
static double drag_miss(const Plant *a, const Drag *drag, double miss[2]) {
    double places[ROOM(PLACES)];
    joint_places(a, places);
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
    plant_split(a, a->given, own, state, u);
    for (int m = 0; m < count; m++) {
        double down[ROOM(PARAMETERS)], dstate[2 * FREEDOMS], du[ROOM(INPUTS)], changes[ROOM(PLACES)], change[VARIABLES] = {0};
        change[drag->moved[m]] = 1.0;
        plant_split(a, change, down, dstate, du);
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
    double miss[2], step[2], left = drag_miss(a, drag, miss);
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
            double square = drag_miss(&tried, drag, after);
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
