/* The equations as the page calls them: beside the torque that is given, the crank's drive has that of a motor. */
#define DRIVEN_C
#include "drawing.h"

#include <string.h>

/* What is given of the motor, as `equations_motor` has it, and how that changes; no breakdown torque: there is none. */
double motor[MOTOR], motor_change[MOTOR];

static int taken(Equation *equation, const double **given, double **results, int *iw, double *w, int memory) {
    const double *arguments[7];
    double u[ROOM(INPUTS)], du[ROOM(INPUTS)], torque, change;
    bool forward = equation == equations_forward;
    memcpy(arguments, given, (forward ? 7 : 4) * sizeof *given);
    if (TORQUE >= 0 && motor[0] != 0.0) {
        const double *speed = given[0] + FREEDOMS + CRANK;
        memcpy(u, given[2], sizeof u);
        equations_motor((const double *[]){motor, speed}, (double *[]){&torque}, iw, w, memory);
        u[ROOM(TORQUE + 1) - 1] += torque;
        arguments[2] = u;
        if (forward) {
            const double *dspeed = given[4] + FREEDOMS + CRANK;
            memcpy(du, given[5], sizeof du);
            equations_motor_forward((const double *[]){motor, speed, motor_change, dspeed}, (double *[]){&change}, iw, w,
                                    memory);
            du[ROOM(TORQUE + 1) - 1] += change;
            arguments[5] = du;
        }
    }
    return equation(arguments, results, iw, w, memory);
}

#define DRIVEN(name)                                                                                                           \
    int driven_##name(const double **given, double **results, int *iw, double *w, int memory) {                                \
        return taken(equations_##name, given, results, iw, w, memory);                                                         \
    }
DRIVEN(derivative)
DRIVEN(outputs)
DRIVEN(clearance)
DRIVEN(forward)
