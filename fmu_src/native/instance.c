#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Life */

static char *copy(Memory memory, const char *text) {
    char *result = memory.allocate(strlen(text) + 1, 1);
    return result ? strcpy(result, text) : NULL;
}

Instance *instance_new(const char *name, const char *token, Interface interface, Memory memory, bool logging, void *environment,
                       void (*log)(const Instance *, Status, const char *, const char *), void (*logger)(void)) {
    Instance *c = memory.allocate(1, sizeof *c);
    if (!c) return NULL;
    c->interface = interface;
    c->memory = memory;
    c->logging = logging ? ALL_CATEGORIES : 0;
    c->environment = environment;
    c->log = log;
    c->logger = logger;
    c->name = copy(memory, name ? name : "");
    c->text = memory.allocate(1, SENTENCE);
    bool good = c->name && c->text;
    if (good && c->name[0] == 0) {
        instance_say(c, ERROR, "an instance must have a name");
        good = false;
    }
    if (good && (!token || strcmp(token, TOKEN) != 0)) {
        instance_say(c, ERROR, "the GUID or token is %s: that of this FMU is %s", token ? token : "missing", TOKEN);
        good = false;
    }
    if (!good) {
        instance_free(c);
        return NULL;
    }
    instance_reset(c);
    return c;
}

void instance_free(Instance *c) {
    if (!c) return;
    void (*release)(void *) = c->memory.release;
    if (c->name) release(c->name);
    if (c->text) release(c->text);
    release(c);
}

void instance_reset(Instance *c) {
    c->s = (Saved){.phase = INSTANTIATED};
    plant_reset(&c->s.plant);
    c->s.plant.follows = c->interface == MODEL_EXCHANGE;
    c->stale = true;
}

static const char *phase_name(int phase) {
    switch (phase) {
    case INSTANTIATED: return "before the initialisation";
    case INITIALIZATION: return "in initialisation mode";
    case EVENT: return "in event mode";
    case CONTINUOUS: return "in continuous-time mode";
    case STEP: return "in step mode";
    case INTERMEDIATE: return "during an intermediate update";
    default: return "after termination";
    }
}

bool instance_allows(Instance *c, const char *function, int phases) {
    if (!c) return false;
    if ((int)c->s.phase & phases) return true;
    instance_say(c, ERROR, "%s: not allowed %s", function, phase_name((int)c->s.phase));
    return false;
}

/* By their statuses; the first are all of them. */
static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};

Status instance_log(Instance *c, const char *function, bool on, size_t count, const char *const names[]) {
    int wanted = count == 0 ? ALL_CATEGORIES : 0;
    for (size_t i = 0; i < count; i++) {
        int n = 0;
        while (n <= FATAL && !(names[i] && strcmp(names[i], categories[n]) == 0)) n++;
        if (n > FATAL)
            return instance_say(c, ERROR, "%s: there is no category %s", function, names[i] ? names[i] : "without a name");
        wanted |= n == 0 ? ALL_CATEGORIES : 1 << n;
    }
    c->logging = on ? c->logging | wanted : c->logging & ~wanted;
    return OK;
}

Status instance_say(const Instance *c, Status status, const char *format, ...) {
    char sentence[2 * SENTENCE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(sentence, sizeof sentence, format, arguments);
    va_end(arguments);
    /* an error is worth a sentence whether or not debugging was asked for */
    if (c->logging >> status & 1 || status == ERROR) c->log(c, status, categories[status], sentence);
    return status;
}

/* Keep a reason for solver.status and solver.message. */
static void note(Instance *c, Reason reason, const char *sentence) {
    c->s.reason = reason;
    snprintf(c->s.message, SENTENCE, "%s", sentence);
}

static void forget(Instance *c) {
    note(c, GOOD, "");
    c->s.cause = GOOD;
    c->s.cause_message[0] = 0;
}

Status instance_setup(Instance *c, bool tolerance_given, double tolerance, double start, bool stop_given, double stop) {
    Digits number;
    if (stop_given && !(stop >= start))
        return instance_say(c, ERROR, "the stop time is %s s: it must not be before the start time", digits(number, stop));
    if (!isfinite(start))
        return instance_say(c, ERROR, "the time at the start is %s s: it must be a finite number", digits(number, start));
    if (tolerance_given && !(isfinite(tolerance) && tolerance > 0.0))
        return instance_say(c, ERROR, "the tolerance is %s: it must be greater than zero", digits(number, tolerance));
    c->s.plant.start_time = start;
    c->s.plant.stop_time = stop_given ? stop : INFINITY;
    c->s.plant.time = start;
    c->s.plant.master_tolerance = tolerance_given ? tolerance : 0.0;
    c->s.plant.begun = 0.0;
    c->stale = true;
    return OK;
}

static Reason refresh(Instance *c, char sentence[SENTENCE]) {
    Reason reason = GOOD;
    if (c->s.plant.begun == 0.0) reason = plant_begin(&c->s.plant, sentence);
    if (reason == GOOD) reason = plant_outputs(&c->s.plant, sentence);
    c->stale = reason != GOOD;
    return reason;
}

Status instance_exit_initialization(Instance *c) {
    char sentence[SENTENCE];
    c->stale = true;
    Reason reason = refresh(c, sentence);
    if (reason != GOOD) {
        note(c, reason, sentence);
        return instance_say(c, ERROR, "%s", sentence);
    }
    forget(c);
    c->s.phase = c->interface == CO_SIMULATION ? STEP : EVENT;
    return OK;
}

/* Values */

static const Variable *variable(Instance *c, const char *function, unsigned reference, Kind kind) {
    static const char *const names[] = {"Real or Float64", "Integer or Int32", "String"};
    if (reference >= VARIABLES) {
        instance_say(c, ERROR, "%s: there is no variable with the value reference %u", function, reference);
        return NULL;
    }
    if (variables[reference].kind != kind) {
        instance_say(c, ERROR, "%s: variable %s is of type %s", function, variables[reference].name,
                     names[variables[reference].kind]);
        return NULL;
    }
    return &variables[reference];
}

/* Bring the outputs up to date. A read does not fail: the last good outputs stay, and the next step will be refused. But the states
   that a solver tries are discarded, and what is discrete stays until the next event. */
static Status read_outputs(Instance *c, const char *function) {
    char sentence[SENTENCE];
    Reason reason = refresh(c, sentence);
    if (c->s.phase == CONTINUOUS) return reason == GOOD ? OK : instance_say(c, DISCARD, "%s: %s", function, sentence);
    bool running = (int)c->s.phase & RUNNING, stepping = running && c->interface == CO_SIMULATION;
    bool refused = running && c->s.reason != GOOD; /* of which the reason stays, until a good step */
    if (reason != GOOD && !refused)
        note(c, reason, sentence);
    else if (reason == GOOD && c->s.reason != GOOD && !stepping && plant_margin(&c->s.plant) >= 0.0)
        forget(c); /* but not what ended the run: the limit of assembly */
    return OK;
}

static double computed(Instance *c, int row) {
    double derivative[STATES];
    if (row < STATE_ROW) return c->s.plant.outputs[row];
    if (row < DERIVATIVE_ROW) {
        double x[STATES];
        plant_present(&c->s.plant, x);
        return x[row - STATE_ROW];
    }
    if (row < MARGIN_ROW) {
        if (plant_derivative(&c->s.plant, derivative)) memcpy(c->s.plant.derivative, derivative, sizeof derivative);
        return c->s.plant.derivative[row - DERIVATIVE_ROW];
    }
    if (row == TIME_ROW) return c->s.plant.time;
    double margin = plant_margin(&c->s.plant);
    return isnan(margin) ? -LIMIT_CLEARANCE : margin;
}

Status instance_get(Instance *c, const char *function, unsigned reference, Kind kind, double *value) {
    const Variable *v = variable(c, function, reference, kind);
    if (!v) return ERROR;
    if (v->causality != COMPUTED)
        *value = c->s.plant.given[reference];
    else {
        bool status = (int)reference == status_at, tried = c->s.phase == CONTINUOUS;
        bool follows = !status && (v->row < STATE_ROW || (DERIVATIVE_ROW <= v->row && v->row < MARGIN_ROW));
        if (c->stale && (follows || !tried) && read_outputs(c, function) != OK) return DISCARD;
        *value = status ? c->s.reason : computed(c, v->row);
    }
    return OK;
}

Status instance_get_integer(Instance *c, const char *function, unsigned reference, int *value) {
    double number;
    Status status = instance_get(c, function, reference, INTEGER, &number);
    if (status == OK) *value = (int)number;
    return status;
}

Status instance_get_text(Instance *c, const char *function, unsigned reference, const char **value) {
    if (!variable(c, function, reference, STRING)) return ERROR;
    if (c->stale && c->s.phase != CONTINUOUS) read_outputs(c, function);
    memcpy(c->text, c->s.message, SENTENCE);
    *value = c->text;
    return OK;
}

/* A guess of an output for the initialisation, which is solved without one. */
static bool is_guess(const Instance *c, const Variable *v) {
    return v->causality == COMPUTED && v->row >= 0 && v->row < STATE_ROW && c->s.phase == INSTANTIATED;
}

bool instance_may_set(Instance *c, const char *function, unsigned reference, Kind kind) {
    const Variable *v = variable(c, function, reference, kind);
    int phase = (int)c->s.phase;
    if (!v) return false;
    if (v->causality == COMPUTED && !is_guess(c, v)) {
        instance_say(c, ERROR, "%s: %s is computed, it cannot be set", function, v->name);
        return false;
    }
    if (v->causality == PARAMETER && !(phase & (INSTANTIATED | INITIALIZATION | (v->tunable ? EVENT | STEP : 0)))) {
        instance_say(c, ERROR, "%s: %s is a %s parameter, it cannot be set %s", function, v->name,
                     v->tunable ? "tunable" : "fixed", phase_name(phase));
        return false;
    }
    return true;
}

void instance_set(Instance *c, unsigned reference, double value) {
    Plant *a = &c->s.plant;
    int phase = (int)c->s.phase;
    if (is_guess(c, &variables[reference])) return;
    a->given[reference] = value;
    c->stale = true;
    if (!(phase & RUNNING))
        a->begun = 0.0;
    else
        for (int k = 0; k < COMMANDS; k++)
            if (input_at[commands[k].input] == (int)reference) a->fresh[k] = 1.0;
}

Status instance_tune(Instance *c, const char *function, const unsigned references[], size_t count,
                     const double before[VARIABLES]) {
    char sentence[SENTENCE];
    bool tuned = false;
    for (size_t i = 0; i < count; i++) tuned |= variables[references[i]].tunable;
    if (!tuned || !((int)c->s.phase & RUNNING) || plant_tune(&c->s.plant, before, sentence) == GOOD) return OK;
    return instance_say(c, ERROR, "%s: %s", function, sentence);
}

Status instance_set_slope(Instance *c, const char *function, unsigned reference, int order, double slope) {
    Digits number;
    const Variable *v = variable(c, function, reference, REAL);
    if (!v) return ERROR;
    if (v->causality != INPUT || order != 1)
        return instance_say(c, ERROR, "%s: derivative %d of %s: the first derivatives of the inputs can be set", function,
                            order, v->name);
    if (!isfinite(slope))
        return instance_say(c, ERROR, "%s: the derivative of %s is %s: it must be a finite number", function, v->name,
                            digits(number, slope));
    c->s.plant.slopes[v->row] = slope;
    return OK;
}

Status instance_output_slopes(Instance *c, const char *function, const unsigned references[], size_t count, const int orders[],
                              double values[]) {
    Plant here = c->s.plant, *a = &here;
    double given[VARIABLES] = {0}, rows[ROWS], derivative[STATES];
    /* the motion goes on from the state with the commands applied */
    plant_present(&c->s.plant, here.x);
    memset(here.fresh, 0, sizeof here.fresh);
    for (size_t i = 0; i < count; i++) {
        const Variable *v = variable(c, function, references[i], REAL);
        if (!v) return ERROR;
        if (v->causality != COMPUTED || orders[i] != 1)
            return instance_say(c, ERROR, "%s: derivative %d of %s: the first derivatives of the outputs can be read", function,
                                orders[i], v->name);
    }
    for (int i = 0; i < INPUTS; i++) given[input_at[i]] = a->last_slopes[i];
    for (int k = 0; k < COMMANDS; k++) {
        /* a command that moved over the step was an acceleration: the state has it, as it has all commands */
        a->given[input_at[commands[k].acceleration]] += a->last_slopes[commands[k].input];
        given[input_at[commands[k].input]] = 0.0;
    }
    if (!plant_derivative(a, derivative)) return instance_say(c, DISCARD, "%s: the derivatives are not finite", function);
    plant_forward(a, false, given, derivative, rows);
    rows[TIME_ROW] = 1.0;
    for (size_t i = 0; i < count; i++) values[i] = rows[variables[references[i]].row];
    return OK;
}

/* What this FMU has none of is good where nothing is asked for. */
Status instance_none(Instance *c, const char *function, size_t count) {
    return count == 0 ? OK : instance_say(c, ERROR, "%s: this FMU has nothing of the kind", function);
}

bool instance_counts(Instance *c, const char *function, size_t count, size_t right) {
    if (count == right) return true;
    instance_say(c, ERROR, "%s: %lu numbers: it must be %lu", function, (unsigned long)count, (unsigned long)right);
    return false;
}

/* Steps */

/* Whether it is friction that ends the motion, and not the limit of assembly. */
static bool jams(const Instance *c) {
    return plant_jams(&c->s.plant, c->s.plant.x);
}

/* Say which spring passed half a turn in the step, in the log, and once in solver.message. */
static void caution(Instance *c) {
#if TWISTS > 0
    char sentence[SENTENCE];
    Digits time;
    if (c->s.plant.slipped == 0.0) return;
    snprintf(sentence, SENTENCE, "the torque of %s at t = %s s " SLIPPED, twists[(int)c->s.plant.slipped - 1].spring,
             digits(time, c->s.plant.slip_time));
    if (!c->s.message[0]) note(c, GOOD, sentence);
    instance_say(c, WARNING, "%s", sentence);
#else
    (void)c;
#endif
}

Status instance_step(Instance *c, double time, double step, const Watch *watch) {
    char sentence[SENTENCE];
    Digits end, stop;
    Reason ended;
    c->stopped = false;
    /* beyond what rounding in the master's sum of steps can make */
    if (time + step > c->s.plant.stop_time + 1e-6 * step + 1e-12 * fabs(time)) {
        snprintf(sentence, SENTENCE, "a step to t = %s s: the stop time is %s s", digits(end, time + step),
                 digits(stop, c->s.plant.stop_time));
        note(c, STEP_OUT_OF_ORDER, sentence);
        return instance_say(c, ERROR, "%s", sentence);
    }
    Reason reason = plant_step(&c->s.plant, time, step, watch, c->early_return, &ended, sentence);
    c->s.step = reason;
    c->stale = true; /* also after a refused step: its updates may have read outputs */
    if (reason == GOOD) {
        if (c->s.reason != GOOD) forget(c); /* but a caution stays */
        caution(c);
        c->stopped = ended != GOOD;
        if (ended != GOOD)
            note(c, ended, jams(c) ? "the step ended early: " JAMMING : "the step ended early, at the " ASSEMBLY);
        return OK;
    }
    if (reason == STEP_OUT_OF_ORDER && c->s.cause != GOOD) {
        /* a master that goes on after a refused step leaves a gap: what is to be known is why the first was refused */
        char both[SENTENCE];
        snprintf(both, SENTENCE, "%.120s; before that, %.270s", sentence, c->s.cause_message);
        note(c, (Reason)c->s.cause, both);
    } else {
        note(c, reason, sentence);
        if (reason != STEP_OUT_OF_ORDER) {
            c->s.cause = reason;
            memcpy(c->s.cause_message, c->s.message, SENTENCE);
        }
    }
    return instance_say(c, DISCARD, "%s", c->s.message);
}

/* Model exchange */

Status instance_check_commands(Instance *c) {
    char sentence[SENTENCE];
    bool moving = (int)c->s.phase & (EVENT | CONTINUOUS);
    return moving && plant_contradicted(&c->s.plant, sentence) ? instance_say(c, WARNING, "%s", sentence) : OK;
}

void instance_new_discrete_states(Instance *c, bool *terminate, bool *values_changed) {
    *values_changed = plant_jump(&c->s.plant);
    *terminate = !(plant_margin(&c->s.plant) >= 0.0);
    c->stale = true;
    if (*terminate) {
        note(c, LIMIT_OF_ASSEMBLY, jams(c) ? "the motion has ended: " JAMMING : "the motion has reached the " ASSEMBLY);
        instance_say(c, WARNING, "%s", c->s.message);
    }
}

Status instance_set_time(Instance *c, const char *function, double time) {
    Digits number;
    /* a solver tries steps that go past the stop time, to come back to it */
    if (!(c->s.plant.start_time <= time && isfinite(time)))
        return instance_say(c, ERROR, "%s: the time is %s s: it must be finite and not before the start", function,
                            digits(number, time));
    c->s.plant.time = time;
    c->stale = true;
    return OK;
}

Status instance_set_states(Instance *c, const char *function, const double x[], size_t count) {
    if (!instance_counts(c, function, count, STATES)) return ERROR;
    for (int i = 0; i < STATES; i++)
        if (!isfinite(x[i])) return instance_say(c, DISCARD, "%s: a state is not finite", function);
    memcpy(c->s.plant.x, x, sizeof c->s.plant.x);
    c->stale = true;
    return OK;
}

/* Make sure that the state follows from what is given, for what is read in initialisation mode. */
static Status begun(Instance *c, const char *function) {
    char sentence[SENTENCE];
    if (c->s.plant.begun != 0.0) return OK;
    Reason reason = plant_begin(&c->s.plant, sentence);
    if (reason == GOOD) return OK;
    note(c, reason, sentence);
    return instance_say(c, ERROR, "%s: %s", function, sentence);
}

Status instance_get_states(Instance *c, const char *function, What what, double values[], size_t count) {
    double derivative[STATES], margin;
    const double *found = what == VALUES ? c->s.plant.x : what == NOMINALS ? c->s.plant.scale : derivative;
    if (!instance_counts(c, function, count, what == INDICATORS ? 1 : STATES) || begun(c, function) != OK) return ERROR;
    if (what == INDICATORS) {
        margin = plant_margin(&c->s.plant);
        found = &margin;
    }
    if ((what == DERIVATIVES && !plant_state_derivative(&c->s.plant, derivative)) || (what == INDICATORS && isnan(margin)))
        return instance_say(c, DISCARD, "%s: the equations are not defined at this state", function);
    memcpy(values, found, count * sizeof *values);
    return OK;
}

/* Derivatives */

int instance_state(unsigned reference) {
    for (int i = 0; i < STATES; i++)
        if (state_at[i] == (int)reference) return i;
    return -1;
}

/* Whether a variable can be changed in the present state: what is given, and after initialisation the state itself. */
static bool known(Instance *c, const char *function, unsigned reference, bool start) {
    const Variable *v = variable(c, function, reference, REAL);
    if (!v) return false;
    bool state = v->causality == COMPUTED && !start && instance_state(reference) >= 0;
    if (state || v->causality == INPUT || (v->causality == PARAMETER && start)) return true;
    instance_say(c, ERROR, "%s: %s is no known of a derivative %s", function, v->name, phase_name((int)c->s.phase));
    return false;
}

static bool unknown(Instance *c, const char *function, unsigned reference) {
    const Variable *v = variable(c, function, reference, REAL);
    if (v && v->causality != COMPUTED) instance_say(c, ERROR, "%s: %s is no unknown of a derivative", function, v->name);
    return v && v->causality == COMPUTED;
}

Status instance_directional(Instance *c, const char *function, bool adjoint, const unsigned unknowns[], size_t unknown_count,
                            const unsigned knowns[], size_t known_count, const double seed[], double result[]) {
    const Plant *a = &c->s.plant;
    bool start = (int)c->s.phase == INITIALIZATION, commanded[ROOM(COMMANDS)] = {false};
    double given[VARIABLES] = {0}, x[STATES] = {0}, rows[ROWS] = {0};
    for (size_t i = 0; i < known_count; i++)
        if (!known(c, function, knowns[i], start)) return ERROR;
    for (size_t i = 0; i < unknown_count; i++)
        if (!unknown(c, function, unknowns[i])) return ERROR;
    if (begun(c, function) != OK) return ERROR;
    if (adjoint) {
        for (size_t i = 0; i < unknown_count; i++) rows[variables[unknowns[i]].row] += seed[i];
        for (size_t i = 0; i < known_count; i++)
            for (int k = 0; k < COMMANDS; k++) commanded[k] |= input_at[commands[k].input] == (int)knowns[i];
        plant_reverse(a, start, rows, commanded, given, x);
    } else {
        for (size_t i = 0; i < known_count; i++) {
            int state = start ? -1 : instance_state(knowns[i]);
            if (state >= 0)
                x[state] += seed[i];
            else
                given[knowns[i]] += seed[i];
        }
        plant_forward(a, start, given, x, rows);
    }
    for (size_t i = 0; i < (adjoint ? known_count : unknown_count); i++) {
        int state = adjoint && !start ? instance_state(knowns[i]) : -1;
        result[i] = !adjoint ? rows[variables[unknowns[i]].row] : state >= 0 ? x[state] : given[knowns[i]];
        if (!isfinite(result[i])) return instance_say(c, DISCARD, "%s: a derivative is not finite", function);
    }
    return OK;
}
