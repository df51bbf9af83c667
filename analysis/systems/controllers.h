/* Controllers, as analysis/export/controllers.py has them: a structure of variables by their names, and what an instant of sampling does. */
#ifndef CONTROLLERS_H
#define CONTROLLERS_H

#include <math.h>

enum { HARMONICS = 6, POINTS = 72 };

static inline double limited(double value, double limit) {
    return fmin(fmax(value, -limit), limit);
}

typedef struct {
    double sample_time, gain, integral_gain, derivative_gain, filter_time, tracking_time, limit, reference, measured,
        feed_forward;
    double force, error, integral, derivative;
    long count;
} PidController;

static inline void PidController_sample(PidController *c) {
    double before = c->error;
    c->error = c->reference - c->measured;
    if (c->count > 0)
        c->derivative =
            (c->filter_time * c->derivative + c->derivative_gain * (c->error - before)) / (c->filter_time + c->sample_time);
    double wanted = c->gain * c->error + c->integral + c->derivative + c->feed_forward;
    c->force = limited(wanted, c->limit);
    double back = (c->force - wanted) / fmax(c->tracking_time, c->sample_time);
    c->integral += c->sample_time * (c->integral_gain * c->error + back);
}

typedef struct {
    double sample_time, position_gain, velocity_gain, limit, reference, reference_velocity, position, velocity, feed_forward;
    double force;
    long count;
} StateFeedbackController;

static inline void StateFeedbackController_sample(StateFeedbackController *c) {
    double back = c->position_gain * (c->position - c->reference);
    back += c->velocity_gain * (c->velocity - c->reference_velocity);
    c->force = limited(c->feed_forward - back, c->limit);
}

typedef struct {
    double sample_time, motion[1], motion_cos[HARMONICS + 1], motion_sin[HARMONICS + 1];
    double load[1], load_cos[HARMONICS + 1], load_sin[HARMONICS + 1], lead, angle, speed;
    double position, velocity, force;
    long count;
} MotionReferenceController;

static inline void MotionReferenceController_sample(MotionReferenceController *c) {
    double slope = 0.0, angle = c->angle + c->lead * c->speed;
    c->position = c->motion[0];
    c->force = c->load[0];
    for (int n = 1; n <= HARMONICS; n++) {
        double cosine = cos(n * angle), sine = sin(n * angle);
        c->position += c->motion_cos[n] * cosine + c->motion_sin[n] * sine;
        slope += n * (c->motion_sin[n] * cosine - c->motion_cos[n] * sine);
        c->force += c->load_cos[n] * cosine + c->load_sin[n] * sine;
    }
    c->velocity = slope * c->speed;
}

typedef struct {
    double sample_time, table[POINTS], angle;
    double force;
    long count;
} ForceTableController;

static inline void ForceTableController_sample(ForceTableController *c) {
    double place = POINTS * c->angle / (2.0 * 3.14159265358979323846), before = floor(place);
    /* as in Python, the remainder of a negative number is positive */
    int n = (int)(before - POINTS * floor(before / POINTS));
    double first = c->table[n], second = c->table[(n + 1) % POINTS];
    c->force = first + (place - before) * (second - first);
}

/* Take the samples before an instant. */
#define SAMPLE(type, part, end)                                                                                                \
    while ((double)part.count * part.sample_time < (end) - 1e-6 * part.sample_time) {                                          \
        type##_sample(&part);                                                                                                  \
        part.count++;                                                                                                          \
    }

#endif
