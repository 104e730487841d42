/* faults.c: the law that no fault of bounded length may stop a filter from learning. Every filter, its gate on and no
 * plausible ranges set, lives well, meets one fault, and 20 memories after it must lie within 10 % of a filter that
 * started afresh when the fault was over. Each fault is of a kind, a size from 10 to 1e6 times that of the signals, a
 * length from 1 to 1000 samples, and hits the inputs, the outputs, one channel or all, of a filter with one past block or
 * two. The plant turns over during it, so that whoever stays as he was is wrong.
 *
 * Then the other side of it: in a calm, with the offsets and drifts of a real one, no filter may start anew.
 *
 * faults [EVERY [SEED]]: every so manieth case of the matrix, by default 97; exit code 0 when the law held in all. */
#include "family.h"

#include "aeolid/watch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WORDS_MAX = 4096, THETA_MAX = 256, MEMORIES = 20 };

typedef enum { NOISE, ALTERNATING, CONSTANT, RAMP, STUCK, AFTER_GAP, BETWEEN_GAPS, BEFORE_GAP, KINDS } kind_t;
static const char *const KIND_NAMES[KINDS] = {"noise", "alternating",    "constant",     "ramp",
                                              "stuck", "gap and offset", "between gaps", "offset and gap"};
typedef enum { ALL, INPUTS, OUTPUTS, ONE_INPUT, ONE_OUTPUT, PLACES } place_t;
static const char *const PLACE_NAMES[PLACES] = {"all", "the inputs", "the outputs", "one input", "one output"};

static const double LAMBDAS[] = {0.99, 0.999, 0.9999};
static const double AMPLITUDES[] = {10, 100, 1e3, 1e4, 1e5, 1e6};
static const unsigned LENGTHS[] = {1, 10, 100, 1000};
static const uint16_t PASTS[] = {2, 1};
enum { LAMBDA_COUNT = 3, AMPLITUDE_COUNT = 6, LENGTH_COUNT = 4, PAST_COUNT = 2 };

typedef struct {
    const family_filter_t *filter;
    family_object_t object;
    aeo_regressor_t regressor;
    aeo_real_t memory[WORDS_MAX], window[256];
} life_t;

typedef struct {
    kind_t kind;
    place_t place;
    double lambda, amplitude;
    unsigned length;
    uint16_t past;
} case_t;

static life_t life, fresh;
static family_plant_t plant;
static uint64_t clock_us;
static uint32_t seed;
static family_size_t size = {2, 2, 2, 1};
static const uint32_t RELEASED = 128;

static void begin(life_t *self, const family_filter_t *filter, double lambda)
{
    const family_settings_t settings = {(aeo_real_t)lambda, AEO_REAL(0.1), AEO_REAL(0.05)};
    self->filter = filter;
    if (filter->words(size) > WORDS_MAX || filter->object_bytes > sizeof self->object ||
        family_start_regressor(&self->regressor, filter, size, AEO_REAL(1e6), self->window, 256) != AEO_OK ||
        filter->init(&self->object, size, settings, self->memory, filter->words(size)) != AEO_OK) {
        printf("%s does not start\n", filter->name);
        exit(1);
    }
}

static void push(life_t *self, const aeo_real_t *x)
{
    if (aeo_regressor_push(&self->regressor, x, x + size.inputs, clock_us) != AEO_OK) {
        return;
    }
    (void)self->filter->update(&self->object, aeo_regressor_z(&self->regressor), aeo_regressor_y(&self->regressor));
    if (self->filter->feedback != NULL) {
        (void)aeo_regressor_set_innovation(&self->regressor, self->filter->feedback(&self->object));
    }
}

static void step(aeo_real_t *x)
{
    family_plant_step(&plant);
    clock_us += 1000u;
    memcpy(x, plant.u, size.inputs * sizeof *x);
    memcpy(x + size.inputs, plant.y, size.outputs * sizeof *x);
}

static int is_hit(place_t place, unsigned channel)
{
    const unsigned r = size.inputs;
    return place == ALL || (place == INPUTS && channel < r) || (place == OUTPUTS && channel >= r) ||
           (place == ONE_INPUT && channel == 0u) || (place == ONE_OUTPUT && channel == r);
}

static void disturb(const case_t *c, unsigned k, aeo_real_t *x)
{
    const aeo_real_t a = (aeo_real_t)c->amplitude, sign = k % 2u == 0u ? AEO_REAL(1) : AEO_REAL(-1);
    for (unsigned i = 0; i < (unsigned)size.inputs + size.outputs; i++) {
        if (!is_hit(c->place, i)) {
            continue;
        }
        switch (c->kind) {
        case NOISE:
            x[i] = a * family_draw(&seed);
            break;
        case ALTERNATING:
            x[i] = a * sign;
            break;
        case RAMP:
            x[i] += a * (aeo_real_t)(k + 1u) / (aeo_real_t)c->length;
            break;
        case STUCK: /* at numbers of its own that do not move */
            x[i] = a / (aeo_real_t)(i + 1u);
            break;
        case CONSTANT:
        case AFTER_GAP:
        case BETWEEN_GAPS:
        case BEFORE_GAP:
        case KINDS:
        default:
            x[i] += a;
            break;
        }
    }
}

static void suffer(const case_t *c)
{
    aeo_real_t x[2 * FAMILY_CHANNELS_MAX];
    clock_us += c->kind == AFTER_GAP || c->kind == BETWEEN_GAPS ? 9000u : 0u;
    for (unsigned k = 0; k < c->length; k++) {
        step(x);
        disturb(c, k, x);
        push(&life, x);
    }
    clock_us += c->kind == BETWEEN_GAPS || c->kind == BEFORE_GAP ? 9000u : 0u;
}

static double find_distance(void)
{
    aeo_real_t one[THETA_MAX], other[THETA_MAX];
    const size_t count = family_regressors(life.filter, size) * size.outputs;
    double difference = 0.0, square = 0.0;
    (void)life.filter->read(&life.object, one, THETA_MAX);
    (void)fresh.filter->read(&fresh.object, other, THETA_MAX);
    for (size_t i = 0; i < count; i++) {
        difference += ((double)one[i] - (double)other[i]) * ((double)one[i] - (double)other[i]);
        square += (double)other[i] * (double)other[i];
    }
    return difference / square;
}

static double find_power(const life_t *self)
{
    const aeo_real_t *e = self->filter->innovation(&self->object);
    double power = 0.0;
    for (unsigned i = 0; i < size.outputs; i++) {
        power += (double)e[i] * (double)e[i];
    }
    return power;
}

/* Return the square of the relative distance of theta, and of a VARMAX filter, whose theta is not unique, by how much
 * the innovations' power over the last two memories is larger. */
static double recover(const case_t *c, double memory)
{
    aeo_real_t x[2 * FAMILY_CHANNELS_MAX];
    const uint32_t samples = (uint32_t)(MEMORIES * memory);
    double power = 0.0, fresh_power = 0.0;
    begin(&fresh, life.filter, c->lambda);
    for (uint32_t k = 0; k < samples; k++) {
        step(x);
        push(&life, x);
        push(&fresh, x);
        if (k + 2.0 * memory >= samples) {
            power += find_power(&life);
            fresh_power += find_power(&fresh);
        }
    }
    return life.filter->feedback != NULL ? power / fresh_power - 1.0 : find_distance();
}

static int meet(const family_filter_t *filter, const case_t *c)
{
    const uint32_t first_seed = seed;
    aeo_real_t x[2 * FAMILY_CHANNELS_MAX];
    const double memory = 1.0 / (1.0 - c->lambda);
    size.past = c->past;
    begin(&life, filter, c->lambda);
    family_plant_start(&plant, size, seed);
    for (uint32_t k = 0; k < (uint32_t)(6.0 * memory); k++) {
        step(x);
        push(&life, x);
    }
    plant.sign = -plant.sign;
    suffer(c);
    const double distance = recover(c, memory), most = filter->feedback != NULL ? 0.1 : 0.01;
    if (!(distance < most) || !filter->invariants_hold(&life.object)) {
        printf("%s: %g of at most %g after %s of %g on %s for %u samples, past %u, lambda %g, flags %#x, "
               "seed %u\n",
               filter->name, distance, most, KIND_NAMES[c->kind], c->amplitude, PLACE_NAMES[c->place], c->length,
               (unsigned)c->past, c->lambda, (unsigned)filter->health(&life.object), (unsigned)first_seed);
        return 0;
    }
    return 1;
}

static unsigned meet_faults(unsigned every, uint32_t first_seed, unsigned *failed)
{
    unsigned number = 0, met = 0;
    for (unsigned f = 0; f < FAMILY_COUNT; f++) {
        for (unsigned i = 0; i < (unsigned)KINDS * PLACES * LAMBDA_COUNT * AMPLITUDE_COUNT * LENGTH_COUNT * PAST_COUNT;
             i++) {
            const case_t c = {(kind_t)(i % KINDS),
                              (place_t)(i / KINDS % PLACES),
                              LAMBDAS[i / (KINDS * PLACES * AMPLITUDE_COUNT * LENGTH_COUNT) % LAMBDA_COUNT],
                              AMPLITUDES[i / (KINDS * PLACES) % AMPLITUDE_COUNT],
                              LENGTHS[i / (KINDS * PLACES * AMPLITUDE_COUNT) % LENGTH_COUNT],
                              PASTS[i / (KINDS * PLACES * AMPLITUDE_COUNT * LENGTH_COUNT * LAMBDA_COUNT)]};
            seed = (first_seed + number * UINT32_C(2654435761)) | 1u; /* a case is the same alone */
            /* the longest memory costs a hundred times the shortest: a tenth of its cases */
            if (number++ % (c.lambda > 0.9995 ? 10u * every : every) == 0u) {
                *failed += meet(&FAMILY[f], &c) ? 0u : 1u;
                met++;
            }
        }
    }
    return met;
}

/* A night: outputs and inputs a hundredth, a millionth or none of what they were, around an offset that stays, drifts or
 * turns slowly, for 300 memories. Returns 1 when no filter started anew in it. */
static int sleep_well(const family_filter_t *filter, double part, double offset, double drift)
{
    aeo_real_t x[2 * FAMILY_CHANNELS_MAX];
    const double lambda = 0.99;
    begin(&life, filter, lambda);
    family_plant_start(&plant, size, seed);
    double level = offset;
    for (unsigned k = 0; k < 32000; k++) {
        if (k == 2000) {
            plant.excitation = (aeo_real_t)part;
            plant.noise = (aeo_real_t)(0.1 * part);
        }
        level += k >= 2000 ? drift * (k / 3000 % 2 == 0 ? 1 : -1) : 0.0;
        step(x);
        for (unsigned i = 0; i < (unsigned)size.inputs + size.outputs; i++) {
            x[i] += (aeo_real_t)level;
        }
        push(&life, x);
    }
    if ((filter->health(&life.object) & RELEASED) != 0u) {
        printf("%s started anew in a calm of %g around %g, drift %g\n", filter->name, part, offset, drift);
        return 0;
    }
    return 1;
}

int main(int count, char **arguments)
{
    const unsigned every = count > 1 ? (unsigned)strtoul(arguments[1], NULL, 10) : 97u;
    unsigned failed = 0, nights = 0;
    const uint32_t first_seed = count > 2 ? (uint32_t)strtoul(arguments[2], NULL, 10) : 20091130u;
    if (every == 0u) {
        fputs("usage: faults [EVERY [SEED]]; EVERY is 1 or more\n", stderr);
        return 2;
    }
    const unsigned met = meet_faults(every, first_seed, &failed);
    seed = first_seed | 1u;
    size.past = PASTS[0];
    for (unsigned f = 0; f < FAMILY_COUNT; f++) {
        static const double SIZES[] = {0.1, 0.01, 1e-6, 0.0}, OFFSETS[] = {0.0, 3.0, 30.0}, DRIFTS[] = {0.0, 1e-5};
        for (unsigned i = 0; i < 24; i++, nights++) {
            failed += sleep_well(&FAMILY[f], SIZES[i % 4], OFFSETS[i / 4 % 3], DRIFTS[i / 12]) ? 0u : 1u;
        }
    }
    printf("%u faults met and %u nights slept, %u of them badly\n", met, nights, failed);
    return failed == 0u ? 0 : 1;
}
/* SPDX-License-Identifier: MIT */
