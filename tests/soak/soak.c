/* soak.c: a rough life for every filter, over and over: quiet spells, steps and drifts of the system, bursts of NaN and
 * of numbers out of range, saturated and frozen channels, scales off by 1e6 both ways, holes in time, saving and
 * restoring at any instant. Invariants are checked throughout. Every round ends with good data, on which the filter must
 * come to what a filter started afresh with them finds: nothing of the rough part may stay.
 *
 * Each filter lives three times, a third of the samples each: guarded, with plausible ranges at the regressor and the
 * filter's gate, as on a turbine; gated, without the ranges, where numbers up to 1e6 reach a filter that withholds
 * forgetting; and bare, with neither.
 *
 * soak SAMPLES [SEED [FILTER]]: samples a filter, at least 600,000; exit code 0 when all held. */
#include "family.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROUND = 200000, GOOD = 60000, CHECK_EVERY = 61, WORDS_MAX = 8192, THETA_MAX = 512 };

/* After 60,000 samples at lambda = 0.999 all that was before weighs exp(-60), times 1e12 where its scale was off: below
 * rounding, which in float is that of regressors of condition below 100. */
static const double CLOSE = sizeof(aeo_real_t) == 4 ? 2e-3 : 1e-8;
/* A VARMAX predictor of more lags than the plant has is not unique, as poles and zeros may cancel anywhere: there power
 * of the innovations counts, over the last samples of the good data. */
enum { COMPARED = 20000 };
static const double MORE_POWER = 1.005;

typedef enum {
    NORMAL,
    QUIET,        /* all signals at 1e-6, or exactly 0 */
    STEP,         /* the system's gain turns over */
    DRIFT,        /* the system's gain moves slowly */
    NOT_FINITE,   /* NaN and infinities, at the regressor and at the filter itself */
    OUT_OF_RANGE, /* beyond 1e6 */
    SATURATED,    /* one channel stands at its limit */
    FROZEN,       /* all channels repeat themselves */
    SCALED_UP,    /* one or all channels times up to 1e6 */
    SCALED_DOWN,  /* all channels times 1e-6 */
    HOLES,        /* samples are missing */
    KINDS
} kind_t;

static const char *const KIND_NAMES[KINDS] = {"normal",     "quiet",        "step",      "drift",
                                              "not finite", "out of range", "saturated", "frozen",
                                              "scaled up",  "scaled down",  "holes"};

typedef enum { BARE, GATED, GUARDED, MODES } mode_t;
static const char *const MODE_NAMES[MODES] = {"bare", "gated", "guarded"};

typedef struct {
    const family_filter_t *filter;
    family_object_t object;
    aeo_regressor_t regressor;
    aeo_real_t memory[WORDS_MAX], window[1024];
} life_t;

static life_t life, fresh;
static family_plant_t plant;
static aeo_real_t saved[WORDS_MAX];
static uint64_t clock_us;
static uint32_t seed, since;
static kind_t kind;
static unsigned channel, left; /* which channel the present spell hits; samples left of it */
static const family_size_t SIZE = {2, 3, 3, 1};

static void fail(const char *what)
{
    printf("%s: %s, seed %u, sample %u of the round, %s\n", life.filter->name, what, (unsigned)seed, (unsigned)since,
           KIND_NAMES[kind]);
    exit(1);
}

static uint32_t draw_number(uint32_t below)
{
    (void)family_draw(&seed);
    return (seed >> 4) % below;
}

static aeo_real_t make_not_finite(uint32_t which)
{
    static const uint32_t BITS[3] = {UINT32_C(0x7FC00000), UINT32_C(0x7F800000), UINT32_C(0xFF800000)};
    float value;
    memcpy(&value, &BITS[which % 3u], sizeof value);
    return (aeo_real_t)value;
}

static void begin(life_t *self, const family_filter_t *filter, mode_t mode)
{
    const family_settings_t settings = {AEO_REAL(0.999), AEO_REAL(0.1), mode != BARE ? AEO_REAL(0.05) : AEO_REAL(0)};
    self->filter = filter;
    if (filter->words(SIZE) > WORDS_MAX || filter->object_bytes > sizeof self->object ||
        family_regressors(filter, SIZE) * SIZE.outputs > THETA_MAX ||
        family_start_regressor(&self->regressor, filter, SIZE, mode == GUARDED ? AEO_REAL(20) : AEO_REAL(1e6),
                               self->window, 1024) != AEO_OK ||
        filter->init(&self->object, SIZE, settings, self->memory, filter->words(SIZE)) != AEO_OK) {
        fail("does not start");
    }
}

/* One sample through regressor and filter; codes are the caller's to judge. */
static aeo_status_t push(life_t *self, const aeo_real_t *u, const aeo_real_t *y)
{
    const family_filter_t *filter = self->filter;
    aeo_status_t status = aeo_regressor_push(&self->regressor, u, y, clock_us);
    if (status != AEO_OK) {
        return status;
    }
    status = filter->update(&self->object, aeo_regressor_z(&self->regressor), aeo_regressor_y(&self->regressor));
    if (status != AEO_OK) {
        fail("refuses what the regressor let pass");
    }
    if (filter->feedback != NULL &&
        aeo_regressor_set_innovation(&self->regressor, filter->feedback(&self->object)) != AEO_OK) {
        fail("feeds back what the regressor refuses");
    }
    return AEO_OK;
}

/* A filter that is handed a NaN past the regressor must refuse it and go on as if nothing had been. */
static void hand_over_not_finite(life_t *self)
{
    aeo_real_t z[1024], y[FAMILY_CHANNELS_MAX];
    const size_t n = family_regressors(self->filter, SIZE);
    memcpy(z, aeo_regressor_z(&self->regressor), n * sizeof *z);
    memcpy(y, aeo_regressor_y(&self->regressor), SIZE.outputs * sizeof *y);
    const uint32_t at = draw_number((uint32_t)n + SIZE.outputs);
    *(at < n ? &z[at] : &y[at - n]) = make_not_finite(draw_number(3));
    if (self->filter->update(&self->object, z, y) != AEO_E_NOT_FINITE) {
        fail("takes a number that is not finite");
    }
}

static void begin_spell(void)
{
    kind = (kind_t)draw_number(KINDS);
    channel = draw_number(SIZE.inputs + SIZE.outputs);
    left = 1u + draw_number(kind == QUIET || kind == DRIFT ? 6000u : kind == NORMAL ? 2000u : 400u);
    plant.excitation = AEO_REAL(1);
    plant.noise = AEO_REAL(0.1);
    if (kind == QUIET) {
        plant.excitation = plant.noise = draw_number(2) == 0u ? AEO_REAL(0) : AEO_REAL(1e-6);
    } else if (kind == STEP) {
        plant.sign = -plant.sign;
    }
}

/* Disturb the channels (inputs, then outputs) as the present spell does; returns how long the sample took to come. */
static uint64_t disturb(aeo_real_t *x)
{
    const unsigned count = SIZE.inputs + SIZE.outputs;
    static aeo_real_t last[2 * FAMILY_CHANNELS_MAX];
    const aeo_real_t scale = kind == SCALED_DOWN ? AEO_REAL(1e-6) : kind == SCALED_UP ? AEO_REAL(4e5) : AEO_REAL(1);
    for (unsigned i = 0; i < count; i++) {
        if (kind == FROZEN) {
            x[i] = last[i];
        } else if (kind != SCALED_UP || i == channel || channel == 0u) {
            x[i] *= scale;
        }
        last[i] = x[i];
    }
    if (kind == SATURATED) {
        x[channel] = AEO_REAL(0.75);
    } else if (kind == NOT_FINITE && draw_number(2) == 0u) {
        x[channel] = make_not_finite(draw_number(3));
    } else if (kind == OUT_OF_RANGE && draw_number(2) == 0u) {
        x[channel] = AEO_REAL(3e7) * family_draw(&seed);
    } else if (kind == DRIFT) {
        plant.sign += AEO_REAL(1e-4) * (channel % 2u == 0u ? AEO_REAL(1) : AEO_REAL(-1));
        plant.sign = plant.sign > AEO_REAL(1) ? AEO_REAL(1) : plant.sign < AEO_REAL(-1) ? AEO_REAL(-1) : plant.sign;
    }
    return kind == HOLES && draw_number(10) == 0u ? 1000u * (1u + draw_number(50)) : 1000u;
}

static void check(life_t *self)
{
    if (!self->filter->invariants_hold(&self->object)) {
        fail("breaks its invariants");
    }
    if (!aeo_regressor_invariants_hold(&self->regressor)) {
        fail("the regressor breaks its invariants");
    }
}

static void save_and_restore(life_t *self)
{
    const size_t length = self->filter->saved_words(SIZE);
    if (length > WORDS_MAX || self->filter->save(&self->object, saved, length) != AEO_OK) {
        fail("does not save");
    }
    self->filter->reset(&self->object);
    if (self->filter->restore(&self->object, saved, length) != AEO_OK) {
        fail("does not take back what it saved");
    }
}

static void live_roughly(uint32_t samples)
{
    left = 0;
    for (since = 0; since < samples; since++) {
        aeo_real_t x[2 * FAMILY_CHANNELS_MAX];
        if (left-- == 0u) {
            begin_spell();
        }
        family_plant_step(&plant);
        memcpy(x, plant.u, SIZE.inputs * sizeof *x);
        memcpy(x + SIZE.inputs, plant.y, SIZE.outputs * sizeof *x);
        clock_us += disturb(x);
        const aeo_status_t status = push(&life, x, x + SIZE.inputs);
        if (status == AEO_OK && kind == NOT_FINITE) {
            hand_over_not_finite(&life);
        }
        if (since % CHECK_EVERY == 0u) {
            check(&life);
        }
        if (draw_number(20000) == 0u) {
            save_and_restore(&life);
        }
    }
}

static double relative_distance(const aeo_real_t *a, const aeo_real_t *b, size_t count)
{
    double difference = 0.0, size = 0.0;
    for (size_t i = 0; i < count; i++) {
        difference += ((double)a[i] - (double)b[i]) * ((double)a[i] - (double)b[i]);
        size += (double)b[i] * (double)b[i];
    }
    return size > 0.0 ? difference / size : 1.0;
}

static double find_power(const life_t *self)
{
    const aeo_real_t *innovation = self->filter->innovation(&self->object);
    double power = 0.0;
    for (unsigned i = 0; i < SIZE.outputs; i++) {
        power += (double)innovation[i] * (double)innovation[i];
    }
    return power;
}

/* Return the squared distance of theta from that of the fresh filter; for a VARMAX filter the innovations' power more
 * than the fresh one's, as a share. */
static double compare(double power, double fresh_power)
{
    aeo_real_t one[THETA_MAX], other[THETA_MAX];
    const size_t count = family_regressors(life.filter, SIZE) * SIZE.outputs;
    if (life.filter->read(&life.object, one, THETA_MAX) != AEO_OK ||
        fresh.filter->read(&fresh.object, other, THETA_MAX) != AEO_OK) {
        fail("cannot be read");
    }
    const int varmax = life.filter->feedback != NULL;
    const double distance = varmax ? power / fresh_power - 1.0 : relative_distance(one, other, count);
    if (!(distance < (varmax ? MORE_POWER - 1.0 : CLOSE * CLOSE))) {
        printf("%s %.3g; ", varmax ? "more power" : "distance squared", distance);
        fail("does not recover");
    }
    return distance;
}

/* Good data, met by a filter which has seen nothing else too. */
static double live_well(mode_t mode)
{
    double power = 0.0, fresh_power = 0.0;
    kind = NORMAL;
    plant.sign = plant.excitation = AEO_REAL(1);
    plant.noise = AEO_REAL(0.1);
    clock_us += 1000000u; /* both begin with an empty window */
    begin(&fresh, life.filter, mode);
    for (since = 0; since < GOOD; since++) {
        family_plant_step(&plant);
        clock_us += 1000u;
        (void)push(&life, plant.u, plant.y);
        (void)push(&fresh, plant.u, plant.y);
        if (since % CHECK_EVERY == 0u) {
            check(&life);
            check(&fresh);
        }
        if (since >= GOOD - COMPARED) {
            power += find_power(&life);
            fresh_power += find_power(&fresh);
        }
    }
    return compare(power, fresh_power);
}

static void soak(const family_filter_t *filter, uint32_t rounds, mode_t mode)
{
    double worst = 0.0;
    uint32_t seen = 0;
    begin(&life, filter, mode);
    family_plant_start(&plant, SIZE, seed);
    for (uint32_t t = 0; t < rounds; t++) {
        live_roughly(ROUND - GOOD);
        const double distance = live_well(mode);
        worst = distance > worst ? distance : worst;
        seen |= filter->health(&life.object);
        filter->clear_health(&life.object);
    }
    printf("%s, %s: %u rounds of %u samples, farthest from a fresh filter %.2g, health seen %#x\n", filter->name,
           MODE_NAMES[mode], (unsigned)rounds, (unsigned)ROUND, worst, (unsigned)seen);
}

int main(int count, char **arguments)
{
    const double samples = count > 1 ? strtod(arguments[1], NULL) : 1e6;
    const uint32_t first_seed = count > 2 ? (uint32_t)strtoul(arguments[2], NULL, 10) : 20091130u;
    const char *const only = count > 3 ? arguments[3] : "";
    if (!(samples >= 3 * ROUND && samples <= 4e9) || first_seed == 0u) {
        fputs("usage: soak SAMPLES [SEED [FILTER]]; 600,000 samples or more, a seed other than 0\n", stderr);
        return 2;
    }
    for (unsigned f = 0; f < FAMILY_COUNT; f++) {
        if (only[0] == '\0' || strcmp(only, FAMILY[f].name) == 0) {
            seed = first_seed;
            for (unsigned mode = MODES; mode-- > 0u;) {
                soak(&FAMILY[f], (uint32_t)(samples / (3.0 * ROUND)), (mode_t)mode);
            }
        }
    }
    return 0;
}
