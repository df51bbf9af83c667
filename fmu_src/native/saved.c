/* Saved states: a copy of Saved, and the same as text. */
#include "instance.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

/* The text is JSON. Its numbers are written as the hexadecimal digits of their bits, which are the same on every platform and in
   every locale. The last of them is a checksum of all the text before it. */

#define HEADER "{\"model\":\"" MODEL_IDENTIFIER "\",\"token\":\"" TOKEN "\",\"format\":2,\"numbers\":\""

static const char hexadecimal[] = "0123456789abcdef";

Status instance_save(Instance *c, void **state) {
    Saved *saved = *state ? *state : c->memory.allocate(1, sizeof *saved);
    if (!saved) return instance_say(c, ERROR, "there is no memory for a saved state");
    *saved = c->s;
    *state = saved;
    return OK;
}

Status instance_restore(Instance *c, const void *state) {
    const Saved *saved = state;
    if (saved->plant.follows != c->s.plant.follows)
        return instance_say(c, ERROR, "the saved state is not one of %s",
                            c->interface == CO_SIMULATION ? "co-simulation" : "model exchange");
    c->s = *saved;
    c->stale = true;
    return OK;
}

/* Add a character to a checksum: FNV-1a of 64 bits, which tells of every change of a single character. */
static uint64_t summed(uint64_t sum, char character) {
    return (sum ^ (unsigned char)character) * 0x100000001b3u;
}

static const uint64_t NOTHING = 0xcbf29ce484222325u; /* the checksum of no text */

/* Text that is counted where there is no room for it. */
typedef struct {
    char *text;
    size_t size;
    uint64_t sum;
} Out;

static void put(Out *out, const char *text) {
    for (; *text; text++, out->size++) {
        if (out->text) out->text[out->size] = *text;
        out->sum = summed(out->sum, *text);
    }
}

static void put_bits(Out *out, uint64_t bits) {
    for (int shift = 60; shift >= 0; shift -= 4) put(out, (char[]){hexadecimal[bits >> shift & 15], 0});
}

static void put_saved(Out *out, const Saved *saved) {
    put(out, HEADER);
    for (size_t i = 0; i < NUMBERS; i++) {
        uint64_t bits;
        memcpy(&bits, (const char *)saved + i * sizeof bits, sizeof bits);
        put_bits(out, bits);
    }
    put(out, "\",\"message\":\"");
    put(out, saved->message);
    put(out, "\",\"cause\":\"");
    put(out, saved->cause_message);
    put(out, "\",\"check\":\"");
    put_bits(out, out->sum);
    put(out, "\"}");
}

void instance_forget_saved(const Instance *c, void **state) {
    if (state && *state) {
        c->memory.release(*state);
        *state = NULL;
    }
}

size_t instance_serialized_size(const void *state) {
    Out out = {.sum = NOTHING};
    put_saved(&out, state);
    return out.size;
}

Status instance_serialize(Instance *c, const char *function, const void *state, char *text, size_t size) {
    Out out = {.text = text, .sum = NOTHING};
    if (!instance_counts(c, function, size, instance_serialized_size(state))) return ERROR;
    put_saved(&out, state);
    return OK;
}

typedef struct {
    const char *at, *end;
} In;

static bool take(In *in, const char *text) {
    size_t length = strlen(text);
    if ((size_t)(in->end - in->at) < length || memcmp(in->at, text, length) != 0) return false;
    in->at += length;
    return true;
}

static bool take_text(In *in, const char *name, char text[SENTENCE]) {
    int length = 0;
    if (!take(in, name)) return false;
    for (; in->at < in->end && *in->at != '"'; in->at++) {
        if (length == SENTENCE - 1 || (unsigned char)*in->at < ' ') return false;
        text[length++] = *in->at;
    }
    text[length] = 0;
    return true;
}

static bool take_number(In *in, char *number) {
    uint64_t bits = 0;
    if (in->end - in->at < 16) return false;
    for (int i = 0; i < 16; i++, in->at++) {
        const char *digit = memchr(hexadecimal, *in->at, 16);
        if (!digit) return false;
        bits = bits << 4 | (uint64_t)(digit - hexadecimal);
    }
    memcpy(number, &bits, sizeof bits);
    return true;
}

/* Whether the checksum follows of all the text up to there. */
static bool take_check(In *in, const char *text) {
    uint64_t sum = NOTHING, found;
    if (!take(in, "\",\"check\":\"")) return false;
    for (const char *c = text; c < in->at; c++) sum = summed(sum, *c);
    return take_number(in, (char *)&found) && found == sum;
}

static bool whole(double value, double least, double most) {
    return least <= value && value <= most && value == floor(value);
}

/* Whether what was read can be worked with: what is not a number in it shows in the next step. */
static bool sound(const Saved *s) {
    for (int v = 0; v < VARIABLES; v++)
        if (variables[v].kind != REAL && variables[v].causality == PARAMETER &&
            !whole(s->plant.given[v], -2147483648.0, 2147483647.0))
            return false;
    if (!whole(s->phase, INSTANTIATED, TERMINATED)) return false;
    int phase = (int)s->phase, phases = INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP | TERMINATED;
    bool begun = s->plant.begun == 1.0 && s->plant.tolerance > 0.0;
    return (phase & phases) && !(phase & (phase - 1)) && (begun || phase & (INSTANTIATED | INITIALIZATION)) &&
           whole(s->reason, GOOD, INTERNAL) && whole(s->cause, GOOD, INTERNAL) && whole(s->step, GOOD, INTERNAL) &&
           isfinite(s->plant.time) && isfinite(s->plant.start_time);
}

Status instance_deserialize(Instance *c, const char *text, size_t size, void **state) {
    Saved *saved = c->memory.allocate(1, sizeof *saved);
    In in = {text, text + size};
    if (!saved) return instance_say(c, ERROR, "there is no memory for a saved state");
    bool good = take(&in, HEADER);
    for (size_t i = 0; i < NUMBERS && good; i++) good = take_number(&in, (char *)saved + i * sizeof(double));
    good = good && take_text(&in, "\",\"message\":\"", saved->message) &&
           take_text(&in, "\",\"cause\":\"", saved->cause_message) && take_check(&in, text) && take(&in, "\"}") &&
           in.at == in.end && sound(saved);
    if (!good) {
        c->memory.release(saved);
        return instance_say(c, ERROR, "the serialised state is damaged, or not one of a " MODEL_IDENTIFIER);
    }
    *state = saved;
    return OK;
}
