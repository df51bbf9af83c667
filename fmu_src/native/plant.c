#include "plant.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "step.h"

/* The least part of a step that is worth an early return. */
#define LEAST_ADVANCE 1e-9

const char *digits(Digits text, double value) {
    snprintf(text, sizeof(Digits), "%.9g", value);
    for (char *c = text; *c; c++) /* the host may have a locale with a decimal comma */
        if (*c == ',') *c = '.';
    return text;
}

static bool all_finite(const double values[], int count) {
    for (int i = 0; i < count; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

static void call(Equation *equation, const double **arguments, double **results) {
    equation(arguments, results, NULL, NULL, 0);
}

/* Inputs */

void plant_inputs(const Plant *a, double u[ROOM(INPUTS)]) {
    for (int i = 0; i < INPUTS; i++) u[i] = a->given[input_at[i]];
}

/* The inputs at a time after the beginning of a step; the slope of a command is the acceleration that it demands. */
static void shifted_inputs(const Plant *a, double t, double u[ROOM(INPUTS)]) {
    for (int i = 0; i < INPUTS; i++) u[i] = a->given[input_at[i]] + a->slopes[i] * (t - a->slopes_from);
    for (int c = 0; c < COMMANDS; c++) u[commands[c].acceleration] += a->slopes[commands[c].input];
}

/* Whether a command is in force under the modes. */
static bool in_force(const Plant *a, const Command *command) {
    return command->mode < 0 || a->given[mode_at[command->mode]] == command->value;
}

static Reason check_inputs(const Plant *a, char sentence[SENTENCE]) {
    for (int i = 0; i < INPUTS; i++) {
        double value = a->given[input_at[i]];
        Digits number, time;
        if (!isfinite(value)) {
            snprintf(sentence, SENTENCE, "input %s is %s at t = %s s: it must be a finite number", variables[input_at[i]].name,
                     digits(number, value), digits(time, a->time));
            return INPUT_NOT_FINITE;
        }
    }
    return GOOD;
}

/* The equations at a state */

static void state_derivative(const Plant *a, const double x[STATES], const double u[], double result[STATES]) {
    call(equations_derivative, (const double *[]){x, a->modes, u, a->p}, (double *[]){result});
}

static double state_clearance(const Plant *a, const double x[STATES]) {
    double u[ROOM(INPUTS)], result;
    plant_inputs(a, u);
    call(equations_clearance, (const double *[]){x, a->modes, u, a->p}, (double *[]){&result});
    return result;
}

/* The inputs for a jump to the commands marked: one that is in force and not marked keeps its rate. Whether any is. */
static bool inputs_of_jump(const Plant *a, const bool marked[ROOM(COMMANDS)], const double x[STATES], double u[ROOM(INPUTS)]) {
    bool any = false;
    plant_inputs(a, u);
    for (int c = 0; c < COMMANDS; c++)
        if (in_force(a, &commands[c])) {
            any |= marked[c];
            if (!marked[c]) u[commands[c].input] = x[commands[c].rate];
        }
    return any;
}

/* Apply the commands marked. */
static void apply(const Plant *a, const bool marked[ROOM(COMMANDS)], double x[STATES]) {
    double u[ROOM(INPUTS)], result[STATES];
    if (!inputs_of_jump(a, marked, x, u)) return;
    call(equations_jump, (const double *[]){x, a->modes, u, a->p}, (double *[]){result});
    memcpy(x, result, sizeof result);
}

/* The commands that act on the state: in model exchange all of them. One that is not finite does not: the state stays good. */
static void acting(const Plant *a, bool marked[ROOM(COMMANDS)]) {
    for (int c = 0; c < COMMANDS; c++)
        marked[c] = a->follows != 0.0 ? isfinite(a->given[input_at[commands[c].input]]) : a->fresh[c] != 0.0;
}

void plant_present(const Plant *a, double x[STATES]) {
    bool marked[ROOM(COMMANDS)];
    memcpy(x, a->x, sizeof a->x);
    acting(a, marked);
    apply(a, marked, x);
}

bool plant_jump(Plant *a) {
    double x[STATES];
    for (int c = 0; c < COMMANDS; c++) a->applied[c] = a->given[input_at[commands[c].input]];
    a->applied_time = a->time;
    plant_present(a, x);
    bool changed = memcmp(x, a->x, sizeof x) != 0;
    memcpy(a->x, x, sizeof x);
    return changed;
}

bool plant_contradicted(const Plant *a, char sentence[SENTENCE]) {
    for (int c = 0; c < COMMANDS; c++) {
        Digits held, rate;
        int speed = input_at[commands[c].input], acceleration = input_at[commands[c].acceleration];
        double change = a->given[acceleration] * (a->time - a->applied_time);
        if (!in_force(a, &commands[c]) || a->given[speed] != a->applied[c]) continue;
        if (!(fabs(change) > 1e-3 * (1.0 + fabs(a->given[speed])))) continue;
        snprintf(sentence, SENTENCE, "%s stayed at %s while %s is %s: in model exchange both must move", variables[speed].name,
                 digits(held, a->given[speed]), variables[acceleration].name, digits(rate, a->given[acceleration]));
        return true;
    }
    return false;
}

/* The beginning */

void plant_reset(Plant *a) {
    *a = (Plant){.stop_time = INFINITY};
    for (int v = 0; v < VARIABLES; v++) a->given[v] = variables[v].start;
}

#define DEGREE 57.29577951308232
#define HALF_TURN 3.141592653589793

static void configuration(const double x[STATES], char text[SENTENCE]) {
    int end = 0;
    text[0] = 0;
    for (int i = 0; i < FREEDOMS && end < SENTENCE; i++) {
        Digits value, degrees;
        snprintf(degrees, sizeof degrees, "%.4f", x[i] * DEGREE);
        bool angle = strcmp(freedoms[i].unit, "rad") == 0;
        end += snprintf(text + end, (size_t)(SENTENCE - end), "%s%s %s %s%s%s%s", i ? " and " : "", freedoms[i].name,
                        digits(value, x[i]), freedoms[i].unit, angle ? " (" : "", angle ? degrees : "", angle ? " deg)" : "");
    }
}

static Reason bad_parameter(int reference, double value, const char *requirement, char sentence[SENTENCE]) {
    Digits number;
    snprintf(sentence, SENTENCE, "parameter %s is %s: it must %s", variables[reference].name, digits(number, value),
             requirement);
    return BAD_PARAMETER;
}

static bool keeps(const Variable *v, double value) {
    if (!isfinite(value)) return false;
    switch (v->rule) {
    case NOT_NEGATIVE: return value >= 0.0;
    case POSITIVE: return value > 0.0;
    case PLUS_OR_MINUS_ONE: return fabs(value) == 1.0;
    case WITHIN: return v->least <= value && value <= v->most;
    default: return true;
    }
}

static Reason check_parameters(const Plant *a, char sentence[SENTENCE]) {
    double own[ROOM(PARAMETERS)], bounds[ROOM(BOUNDS)];
    for (int v = 0; v < VARIABLES; v++)
        if (variables[v].causality == PARAMETER && !keeps(&variables[v], a->given[v]))
            return bad_parameter(v, a->given[v], variables[v].requirement, sentence);
    for (int i = 0; i < PARAMETERS; i++) {
        int v = parameter_at[i];
        own[i] = a->given[v];
        if (fabs(own[i]) > GREATEST) return bad_parameter(v, own[i], TOO_LARGE, sentence);
        if (variables[v].rule == POSITIVE && own[i] < 1.0 / GREATEST) return bad_parameter(v, own[i], TOO_SMALL, sentence);
    }
    call(equations_bounds, (const double *[]){own}, (double *[]){bounds});
    for (int i = 0; i < BOUNDS; i++)
        if (own[least[i].parameter] < bounds[i]) {
            char requirement[SENTENCE];
            Digits number;
            const char *gap = strstr(least[i].requirement, "%g");
            int before = gap ? (int)(gap - least[i].requirement) : (int)strlen(least[i].requirement);
            snprintf(requirement, SENTENCE, "%.*s%s%s", before, least[i].requirement, gap ? digits(number, bounds[i]) : "",
                     gap ? gap + 2 : "");
            return bad_parameter(parameter_at[least[i].parameter], own[least[i].parameter], requirement, sentence);
        }
    return GOOD;
}

/* The parameter of the most extreme order of magnitude is to blame for constants that are not finite. */
static Reason blame_extreme(const Plant *a, char sentence[SENTENCE]) {
    int extreme = parameter_at[0];
    double most = -1.0;
    for (int i = 0; i < PARAMETERS; i++) {
        double value = fabs(a->given[parameter_at[i]]);
        if (value > 0.0 && fabs(log10(value)) > most) {
            most = fabs(log10(value));
            extreme = parameter_at[i];
        }
    }
    bool large = fabs(a->given[extreme]) > 1.0;
    return bad_parameter(
        extreme, a->given[extreme],
        large ? "be small enough for finite moments of inertia" : "be large enough for finite moments of inertia", sentence);
}

bool plant_jams(const Plant *a, const double x[STATES]) {
    Plant smooth = *a;
    if (SWITCH < 0 || a->p[SWITCH] == 0.0) return false;
    smooth.p[SWITCH] = 0.0;
    return fabs(state_clearance(&smooth, x)) >= NEAR_CLEARANCE;
}

Reason plant_check_assembly(const Plant *a, const double x[STATES], char sentence[SENTENCE]) {
    char where[SENTENCE], more[SENTENCE];
    double clearance = state_clearance(a, x), apart[STATES];
    if (clearance >= LIMIT_CLEARANCE) return GOOD;
    bool jams = plant_jams(a, x), near = clearance >= 0.0;
    configuration(x, where);
    call(equations_apart, (const double *[]){x, a->p}, (double *[]){apart});
    if (jams)
        more[0] = 0;
    else if (near)
        SAY_NEAR(more, atan2(clearance, sqrt(1.0 - clearance * clearance)) * DEGREE);
    else
        SAY_APART(more, apart);
    snprintf(sentence, SENTENCE, "%s at %.180s%s%.180s",
             jams   ? JAMMING
             : near ? ASSEMBLY
                    : UNJOINED,
             where, more[0] ? ": " : "", more);
    return LIMIT_OF_ASSEMBLY;
}

void plant_split(const Plant *a, const double given[VARIABLES], double own[ROOM(PARAMETERS)], double state[2 * FREEDOMS],
                 double u[ROOM(INPUTS)]) {
    for (int i = 0; i < PARAMETERS; i++) own[i] = given[parameter_at[i]];
    for (int i = 0; i < 2 * FREEDOMS; i++) state[i] = given[initial_at[i]];
    for (int i = 0; i < INPUTS; i++) u[i] = given[input_at[i]];
    for (int c = 0; c < COMMANDS; c++)
        if (in_force(a, &commands[c])) state[commands[c].rate] = u[commands[c].input];
}

Reason plant_begin(Plant *a, char sentence[SENTENCE]) {
    double own[ROOM(PARAMETERS)], state[2 * FREEDOMS], u[ROOM(INPUTS)];
    a->begun = 0.0;
    a->time = a->start_time;
    Reason reason = check_parameters(a, sentence);
    if (reason == GOOD) reason = check_inputs(a, sentence);
    if (reason != GOOD) return reason;
    for (int i = 0; i < MODES; i++) a->modes[i] = a->given[mode_at[i]];
    plant_split(a, a->given, own, state, u);
    call(equations_begin, (const double *[]){a->modes, own, state, u}, (double *[]){a->p, a->x, a->scale});
    if (!all_finite(a->p, CONSTANTS - 1)) return blame_extreme(a, sentence);
    reason = plant_check_assembly(a, a->x, sentence);
    if (reason != GOOD) return reason;
    if (!all_finite(a->p, CONSTANTS)) {
        char where[SENTENCE];
        configuration(a->x, where);
        snprintf(sentence, SENTENCE, "the energy at the start is not finite: %s", where);
        return INPUT_NOT_FINITE;
    }
    a->tolerance = a->given[tolerance_at];
    if (a->master_tolerance > 0.0) a->tolerance = fmin(a->tolerance, fmax(a->master_tolerance, LEAST_TOLERANCE));
    a->step_size = 0.0;
    for (int c = 0; c < COMMANDS; c++) {
        a->fresh[c] = 0.0;
        a->applied[c] = u[commands[c].input];
    }
    a->applied_time = a->seen_time = a->time;
    plant_inputs(a, a->seen);
    a->begun = 1.0;
    return GOOD;
}

/* Constants of the parameters given, with the energy at the state. */
static double start_energy(const Plant *a, double p[CONSTANTS]) {
    double own[ROOM(PARAMETERS)], state[2 * FREEDOMS], u[ROOM(INPUTS)], x[STATES], scale[STATES];
    plant_split(a, a->given, own, state, u);
    memcpy(state, a->x, sizeof state);
    call(equations_begin, (const double *[]){a->modes, own, state, u}, (double *[]){p, x, scale});
    return p[CONSTANTS - 1];
}

Reason plant_tune(Plant *a, const double before[VARIABLES], char sentence[SENTENCE]) {
    Plant old = *a;
    double p[CONSTANTS], unused[CONSTANTS];
    memcpy(old.given, before, sizeof old.given);
    Reason reason = check_parameters(a, sentence);
    double change = start_energy(a, p) - start_energy(&old, unused);
    if (reason == GOOD && !all_finite(p, CONSTANTS)) reason = blame_extreme(a, sentence);
    if (reason != GOOD) {
        *a = old;
        return reason;
    }
    p[CONSTANTS - 1] = a->p[CONSTANTS - 1] + change;
    memcpy(a->p, p, sizeof p);
    return GOOD;
}

/* Follow the springs whose turns are not counted to a state; notice the first of them that passes half a turn. */
static void follow_twists(Plant *a, const double x[STATES], double time) {
#if TWISTS > 0
    double u[ROOM(INPUTS)], y[ROOM(OUTPUTS)];
    plant_inputs(a, u);
    call(equations_outputs, (const double *[]){x, a->modes, u, a->p}, (double *[]){y});
    for (int i = 0; i < TWISTS; i++) {
        double angle = y[twists[i].output];
        if (fabs(angle - a->twist[i]) > HALF_TURN && a->slipped == 0.0) {
            a->slipped = 1.0 + i;
            a->slip_time = time;
        }
        a->twist[i] = angle;
    }
#else
    (void)a, (void)x, (void)time;
#endif
}

/* The integrator: see step.h */

/* What the slope of the state needs beside it: the plant, whose inputs change over the step. */
static bool state_slope(const void *context, double t, const double x[], double result[], int length) {
    (void)length;
    const Plant *a = context;
    double u[ROOM(INPUTS)];
    shifted_inputs(a, t, u);
    state_derivative(a, x, u, result);
    return true; /* a slope that is not finite makes the result so */
}

static double attempt(const Plant *a, double t, const double x[STATES], double h, double k[], double result[STATES]) {
    return attempt_step(state_slope, a, t, x, h, k, a->scale, STATES, result);
}

/* A cautious first step: one hundredth of the time in which the state would change by its own size. */
static double first_step(const Plant *a, const double x[STATES], const double slope[STATES], double duration) {
    double ratio = 0.0;
    for (int i = 0; i < STATES; i++) ratio = fmax(ratio, fabs(slope[i]) / (a->scale[i] + fabs(x[i])));
    return ratio == 0.0 ? duration : fmin(duration, pow(a->tolerance, 1.0 / ORDER) / ratio);
}

/* The step, shortened so that no freedom, at its rate, moves by more than its reach, and the clearance falls by no more than
   half. */
static double bounded_step(const Plant *a, double step, const double x[STATES], const double slope[STATES]) {
    double ahead[STATES];
    for (int i = 0; i < STATES; i++)
        if (step * fabs(slope[i]) > reach[i] * a->scale[i]) step = reach[i] * a->scale[i] / fabs(slope[i]);
    for (int i = 0; i < STATES; i++) ahead[i] = x[i] + PROBE * step * slope[i];
    return step_short_of_limit(step, state_clearance(a, x), state_clearance(a, ahead));
}

/* The longest part of a step h from x that stays clear of the limit of assembly: it is written to x. */
static double up_to_limit(const Plant *a, double t, double x[STATES], double h, double k[]) {
    double low = 0.0, high = h, best[STATES], tried[STATES];
    memcpy(best, x, sizeof best);
    while (high - low > 1e-15 * h) {
        double middle = 0.5 * (low + high);
        attempt(a, t, x, middle, k, tried);
        if (state_clearance(a, tried) >= LIMIT_CLEARANCE) {
            low = middle;
            memcpy(best, tried, sizeof best);
        } else {
            high = middle;
        }
    }
    memcpy(x, best, sizeof best);
    return low;
}

static Reason not_met(const Plant *a, const double x[STATES], double time, const char *cause, char sentence[SENTENCE]) {
    char where[SENTENCE];
    Digits number;
    configuration(x, where);
    digits(number, time);
    if (!(fabs(state_clearance(a, x)) >= NEAR_CLEARANCE)) {
        snprintf(sentence, SENTENCE, "in the step from t = %s s: %s near %s", number, plant_jams(a, x) ? JAMMING : ASSEMBLY,
                 where);
        return LIMIT_OF_ASSEMBLY;
    }
    snprintf(sentence, SENTENCE, "in the step from t = %s s: %s, at %s", number, cause, where);
    return TOLERANCE_NOT_MET;
}

/* Inputs that the watch sets go on at the rate at which they have changed last, but not after a jump. */
static void expect_inputs(Plant *a, double done, bool watched) {
    double time = a->time - a->seen_time;
    for (int i = 0; i < INPUTS; i++) {
        double value = a->given[input_at[i]], last = a->seen_slopes[i], slope = time > 0.0 ? (value - a->seen[i]) / time : last;
        if (watched && value != a->seen[i]) a->moved = 1.0;
        a->seen[i] = value;
        a->seen_slopes[i] = slope;
        a->slopes[i] = fabs(slope) <= 4.0 * fabs(last) ? slope : 0.0;
    }
    if (a->moved == 0.0) memset(a->slopes, 0, sizeof a->slopes);
    for (int c = 0; c < COMMANDS; c++) /* its rate is given */
        if (a->given[input_at[commands[c].acceleration]] != 0.0) a->slopes[commands[c].input] = 0.0;
    a->seen_time = a->time;
    a->slopes_from = done;
}

/* Let the watch see the state reached, and take what it changed: inputs, commands, the end of the step. */
static void look(Plant *a, double x[STATES], double time, double done, double *duration, const Watch *watch) {
    double end = time + *duration;
    memcpy(a->x, x, sizeof a->x);
    a->time = time + done;
    watch->call(watch->context, a, &end);
    plant_present(a, x);
    memset(a->fresh, 0, sizeof a->fresh);
    expect_inputs(a, done, true);
    if (end < time + *duration) *duration = fmax(done, end - time);
}

/* Integrate x over a duration, which watch and limit may shorten. */
static Reason integrate(Plant *a, double x[STATES], double time, double *duration, const Watch *watch, bool early,
                        Reason *ended, char sentence[SENTENCE]) {
    double k[STAGES * STATES], result[STATES], slope[STATES], done = 0.0; /* k: the first row is the slope at x */
    char cause[SENTENCE];
    Digits first, second, third;
    Reason reason;
    state_slope(a, 0.0, x, k, STATES);
    if (!all_finite(k, STATES)) return not_met(a, x, time, "the accelerations are not finite", sentence);
    double proposal = a->step_size > 0.0 ? a->step_size : first_step(a, x, k, *duration);
    for (int steps = 1;; steps++) {
        double remaining = *duration - done;
        proposal = bounded_step(a, proposal, x, k); /* the step after a shortened one grows from it */
        bool last = proposal >= remaining * (1.0 - 1e-10);
        double h = last ? remaining : fmin(proposal, 0.5 * remaining);
        if (steps > MAX_STEPS) {
            snprintf(cause, SENTENCE, "%d steps did not suffice: stopped %s s into an interval of %s s", MAX_STEPS,
                     digits(first, done), digits(second, *duration));
            reason = not_met(a, x, time, cause, sentence);
            break;
        }
        double error = attempt(a, done, x, h, k, result) / a->tolerance;
        if (error <= 1.0 && !last) {
            state_slope(a, done + h, result, slope, STATES);
            if (!all_finite(slope, STATES)) error = NAN;
        }
        if (error <= 1.0) {
            reason = plant_check_assembly(a, result, cause);
            if (reason != GOOD) {
                if (early) done += up_to_limit(a, done, x, h, k);
                snprintf(sentence, SENTENCE, "in the step from t = %s s: %s", digits(first, time), cause);
                break;
            }
            /* a step cut short by the end of the interval does not shorten the one carried over */
            proposal = fmax(h < proposal ? proposal : 0.0, step_factor(error) * h);
            memcpy(x, result, sizeof result);
            follow_twists(a, x, time + done + h);
            a->step_size = proposal;
            if (last) return GOOD;
            done += h;
            memcpy(k, slope, sizeof slope);
            if (watch) {
                look(a, x, time, done, duration, watch);
                if (*duration <= done) return GOOD;
                reason = check_inputs(a, sentence);
                if (reason != GOOD) return reason;
                state_slope(a, done, x, k, STATES);
            }
        } else {
            proposal = h * step_factor(error);
            if (proposal < LEAST_STEP * *duration) {
                snprintf(cause, SENTENCE, "the step size fell to %s s, %s s into an interval of %s s", digits(third, proposal),
                         digits(first, done), digits(second, *duration));
                reason = not_met(a, x, time, cause, sentence);
                break;
            }
        }
    }
    if (!early || reason != LIMIT_OF_ASSEMBLY || done < LEAST_ADVANCE * *duration) return reason;
    *ended = LIMIT_OF_ASSEMBLY;
    *duration = done;
    return GOOD;
}

static Reason check_step(const Plant *a, double time, double step, char sentence[SENTENCE]) {
    /* what rounding in the master's own sum of steps can make, and no more */
    double greater = fmax(fabs(time), fabs(a->time));
    double slack = fmin(1e-6 * step, 1e-9) + 8.0 * (nextafter(greater, INFINITY) - greater);
    bool numbers = isfinite(time) && isfinite(step);
    if (numbers && step > 0.0 && time + step != time && fabs(time - a->time) <= slack) return GOOD;
    Digits at, of, own;
    digits(at, time);
    digits(of, step);
    if (!numbers)
        snprintf(sentence, SENTENCE, "a step of %s s from t = %s s: both must be finite numbers", of, at);
    else if (step <= 0.0)
        snprintf(sentence, SENTENCE, "a step of %s s at t = %s s: it must be greater than zero", of, at);
    else if (time + step == time)
        snprintf(sentence, SENTENCE, "a step of %s s at t = %s s: it is lost in the rounding of the time", of, at);
    else
        snprintf(sentence, SENTENCE, "a step %s: it starts at t = %s s, but the state is at t = %s s",
                 time < a->time ? "backwards" : "over a gap", at, digits(own, a->time));
    return STEP_OUT_OF_ORDER;
}

Reason plant_step(Plant *a, double time, double step, const Watch *watch, bool early, Reason *ended, char sentence[SENTENCE]) {
    Plant before = *a;
    double x[STATES], duration = step;
    bool all[ROOM(COMMANDS)];
    *ended = GOOD;
    Reason reason = check_step(a, time, step, sentence);
    if (reason == GOOD) reason = check_inputs(a, sentence);
    if (reason != GOOD) return reason;
    for (int c = 0; c < COMMANDS; c++)
        all[c] = true; /* a command that was not set again: the step starts from it all the same, as the contract says */
    memcpy(x, a->x, sizeof x);
    apply(a, all, x);
    memset(a->fresh, 0, sizeof a->fresh);
    a->slopes_from = 0.0;
    follow_twists(a, x, time); /* a start, and what was set since the last step, is no motion */
    a->slipped = 0.0;
    if (watch) expect_inputs(a, 0.0, false);
    reason = integrate(a, x, time, &duration, watch, early, ended, sentence);
    if (reason != GOOD) {
        *a = before;
        return reason;
    }
    memcpy(a->x, x, sizeof x);
    a->time = time + duration;
    for (int i = 0; i < INPUTS; i++) {
        /* an input that moved stays where it has come to */
        if (!watch) a->given[input_at[i]] += a->slopes[i] * duration;
        a->last_slopes[i] = watch ? 0.0 : a->slopes[i];
        a->slopes[i] = 0.0;
    }
    return GOOD;
}

/* What is computed */

Reason plant_outputs(Plant *a, char sentence[SENTENCE]) {
    double x[STATES], u[ROOM(INPUTS)], y[ROOM(OUTPUTS)];
    Reason reason = check_inputs(a, sentence);
    if (reason != GOOD) return reason;
    plant_present(a, x);
    plant_inputs(a, u);
    call(equations_outputs, (const double *[]){x, a->modes, u, a->p}, (double *[]){y});
    if (!all_finite(y, OUTPUTS)) {
        int largest = 0;
        Digits time, number;
        const double idle[ROOM(INPUTS)] = {0};
        char where[SENTENCE];
        reason = plant_check_assembly(a, x, sentence);
        if (reason != GOOD) return reason;
        call(equations_outputs, (const double *[]){a->x, a->modes, idle, a->p}, (double *[]){y});
        if (!all_finite(y, OUTPUTS)) {
            configuration(a->x, where);
            snprintf(sentence, SENTENCE, "an output is not finite at t = %s s, %.250s: " NO_ACCELERATION, digits(time, a->time),
                     where);
            return INPUT_NOT_FINITE;
        }
        for (int i = 1; i < INPUTS; i++)
            if (fabs(u[i]) > fabs(u[largest])) largest = i;
        snprintf(sentence, SENTENCE, "an output is not finite at t = %s s: input %s is %s, too large", digits(time, a->time),
                 variables[input_at[largest]].name, digits(number, u[largest]));
        return INPUT_NOT_FINITE;
    }
    memcpy(a->outputs, y, sizeof a->outputs);
    return GOOD;
}

bool plant_derivative(const Plant *a, double derivative[STATES]) {
    double x[STATES], u[ROOM(INPUTS)];
    plant_present(a, x);
    plant_inputs(a, u);
    state_derivative(a, x, u, derivative);
    return all_finite(derivative, STATES);
}

bool plant_state_derivative(const Plant *a, double derivative[STATES]) {
    double u[ROOM(INPUTS)], motion[STATES];
    bool marked[ROOM(COMMANDS)];
    acting(a, marked);
    if (!inputs_of_jump(a, marked, a->x, u)) return plant_derivative(a, derivative);
    if (!plant_derivative(a, motion)) return false;
    call(equations_following, (const double *[]){a->x, a->modes, u, a->p, motion}, (double *[]){derivative});
    return all_finite(derivative, STATES);
}

double plant_margin(const Plant *a) {
    double x[STATES];
    plant_present(a, x);
    return state_clearance(a, x) - LIMIT_CLEARANCE;
}

/* Derivatives of what is computed */

/* The commands that a change of the inputs applies: those set since the last step, and those that change. */
static bool commanded_state(const Plant *a, const bool changed[ROOM(COMMANDS)], double u[ROOM(INPUTS)],
                            bool marked[ROOM(COMMANDS)]) {
    acting(a, marked);
    for (int c = 0; c < COMMANDS; c++) marked[c] = in_force(a, &commands[c]) && (changed[c] || marked[c]);
    return inputs_of_jump(a, marked, a->x, u);
}

void plant_forward(const Plant *a, bool start, const double given[VARIABLES], const double x[STATES], double rows[ROWS]) {
    double u[ROOM(INPUTS)], du[ROOM(INPUTS)], dp[CONSTANTS] = {0}, dx[STATES], after[STATES], dafter[STATES];
    bool changed[ROOM(COMMANDS)], marked[ROOM(COMMANDS)];
    for (int i = 0; i < INPUTS; i++) du[i] = given[input_at[i]];
    memcpy(after, a->x, sizeof after);
    memcpy(dx, x, sizeof dx);
    if (start) {
        double own[ROOM(PARAMETERS)], state[2 * FREEDOMS], down[ROOM(PARAMETERS)], dstate[2 * FREEDOMS];
        plant_split(a, a->given, own, state, u);
        plant_split(a, given, down, dstate, du);
        call(equations_begin_forward, (const double *[]){a->modes, own, state, u, down, dstate, du}, (double *[]){dp, dx});
    } else {
        for (int c = 0; c < COMMANDS; c++) changed[c] = du[commands[c].input] != 0.0;
        if (commanded_state(a, changed, u, marked)) {
            call(equations_jump, (const double *[]){a->x, a->modes, u, a->p}, (double *[]){after});
            call(equations_jump_forward, (const double *[]){a->x, a->modes, u, a->p, dx, du, dp}, (double *[]){dafter});
            memcpy(dx, dafter, sizeof dx);
        }
    }
    plant_inputs(a, u);
    call(equations_forward, (const double *[]){after, a->modes, u, a->p, dx, du, dp},
         (double *[]){rows, rows + DERIVATIVE_ROW, rows + MARGIN_ROW});
    memcpy(rows + STATE_ROW, dx, sizeof dx);
    rows[TIME_ROW] = 0.0;
}

void plant_reverse(const Plant *a, bool start, const double rows[ROWS], const bool commanded[ROOM(COMMANDS)],
                   double given[VARIABLES], double x[STATES]) {
    double u[ROOM(INPUTS)], before_jump[ROOM(INPUTS)], gu[ROOM(INPUTS)], gp[CONSTANTS], after[STATES];
    bool marked[ROOM(COMMANDS)];
    bool jumps = !start && commanded_state(a, commanded, before_jump, marked);
    memset(given, 0, VARIABLES * sizeof *given);
    memcpy(after, a->x, sizeof after);
    if (jumps) call(equations_jump, (const double *[]){a->x, a->modes, before_jump, a->p}, (double *[]){after});
    plant_inputs(a, u);
    call(equations_reverse, (const double *[]){after, a->modes, u, a->p, rows, rows + DERIVATIVE_ROW, rows + MARGIN_ROW},
         (double *[]){x, gu, gp});
    for (int i = 0; i < STATES; i++) x[i] += rows[STATE_ROW + i];
    for (int i = 0; i < INPUTS; i++) given[input_at[i]] = gu[i];
    if (jumps) {
        double before[STATES], gjump[ROOM(INPUTS)], unused[CONSTANTS];
        call(equations_jump_reverse, (const double *[]){a->x, a->modes, before_jump, a->p, x},
             (double *[]){before, gjump, unused});
        memcpy(x, before, sizeof before);
        for (int c = 0; c < COMMANDS; c++)
            if (marked[c])
                given[input_at[commands[c].input]] += gjump[commands[c].input];
            else if (in_force(a, &commands[c]))
                x[commands[c].rate] += gjump[commands[c].input];
    }
    if (start) {
        double own[ROOM(PARAMETERS)], state[2 * FREEDOMS], gown[ROOM(PARAMETERS)], gstate[2 * FREEDOMS];
        plant_split(a, a->given, own, state, u);
        call(equations_begin_reverse, (const double *[]){a->modes, own, state, u, gp, x}, (double *[]){gown, gstate, gu});
        for (int i = 0; i < INPUTS; i++) given[input_at[i]] += gu[i];
        for (int i = 0; i < PARAMETERS; i++) given[parameter_at[i]] += gown[i];
        for (int c = 0; c < COMMANDS; c++)
            if (in_force(a, &commands[c])) {
                given[input_at[commands[c].input]] += gstate[commands[c].rate];
                gstate[commands[c].rate] = 0.0;
            }
        for (int i = 0; i < 2 * FREEDOMS; i++) given[initial_at[i]] += gstate[i];
    }
}
