/* fast_rls.c: window, theta and the succession of arrays of fast_rls.h; fast_array.c is the recursion. */
#include "aeolid/fast_rls.h"

#include "fast_array.h"
#include "fast_theta.h"
#include "linalg.h"
#include "settings.h"

#include <string.h>

/* As in rls.c: samples are at most 1e6, and an innovation beyond AEO_LINALG_ERROR_MAX forces theta to start afresh
 * before it is used. A gain is at most 1e12 (fast_array.c, fast_theta.c), so theta moves by at most 2e24 an update, and
 * theta z stays below n 2e24 1e6 < 2.1e33 until the next judgement. */
#define KEPT_MAX            AEO_REAL(100) /* theta of scaled data stays below some tens */
#define REGULARISATION_RISE AEO_REAL(65536)

/* q = n (1 - lambda). Up to STEADY an array lives until its errors disagree; above, for LIFE + TAIL / q memories,
 * about two thirds of what was measured (turbine and white data, m = 1 and 5, p = 10 and 30) at q = 0.3, 1, 4: 64,
 * 20 and 12 in float, over 100, 70 and 33 in double. A follower warms up for half of that, but at least WARM and at
 * most twice WARM memories: what precedes it weighs e^-7 ... e^-14 of the data in float and e^-14 ... e^-28 in
 * double then, and data of condition 1e4 raise that by as much. */
#define STEADY AEO_REAL(0.2)
#if AEO_REAL_BYTES == 8
#define WARM AEO_REAL(14)
#define LIFE AEO_REAL(26)
#define TAIL AEO_REAL(10)
#else
#define WARM AEO_REAL(7)
#define LIFE AEO_REAL(8)
#define TAIL AEO_REAL(6)
#endif

/* c: the largest that no start diverges with, and above q = 0.3 what prolongs life. */
#define FEEDBACK_MAX  AEO_REAL(0.75)
#define FEEDBACK_TAIL AEO_REAL(0.07)

/* The largest q: 3, and what rounding makes of lambda. Innovations were those of rls.h times 1.05, 1.8, 9 and 1e7 at q = 3,
 * 5, 7 and 10 (coloured data, 60,000 samples): arrays lose their way as fast as their followers warm up. */
#define CROWDED_MAX AEO_REAL(3.0001)

/* Theta is astray where the innovations' power passes that of the outputs, a millionth of their scale at least, so many
 * times for so many memories more often than not: theta = 0 would do better by far. */
#define ASTRAY_RATIO    AEO_REAL(100)
#define ASTRAY_LEAST    AEO_REAL(1e-12)
#define ASTRAY_MEMORIES AEO_REAL(2)

static int sizes_hold(const aeo_fast_rls_config_t *config, size_t tail)
{
    const unsigned m = config->block;
    if (m < 1u || m > AEO_FAST_RLS_BLOCK_MAX || config->past < 1u || config->outputs < 1u ||
        config->outputs > AEO_FAST_RLS_OUTPUTS_MAX || (m < 32u && config->feedthrough >> m != 0u)) {
        return 0;
    }
    return AEO_FAST_RLS_LENGTH(config->past, m, tail) <= AEO_FAST_RLS_REGRESSORS_MAX;
}

static aeo_status_t judge_config(const aeo_fast_rls_config_t *config, size_t tail)
{
    const aeo_status_t status =
        aeo_settings_judge_common(config->forgetting, config->regularisation, AEO_REAL(0), config->growth_max);
    if (status != AEO_OK || !sizes_hold(config, tail)) {
        return status != AEO_OK ? status : AEO_E_ARG;
    }
    const aeo_real_t n = (aeo_real_t)AEO_FAST_RLS_LENGTH(config->past, config->block, tail);
    return n * (AEO_REAL(1) - config->forgetting) <= CROWDED_MAX ? AEO_OK : AEO_E_ARG;
}

/* A length of time as a number of samples. In float none is above 86 memories of 1.7e7 samples; in double a memory may
 * have 1e15, and what 32 bits cannot hold is cut at 2e9, six years at 10 Hz. */
static uint32_t to_samples(aeo_real_t length)
{
    return length < AEO_REAL(2e9) ? (uint32_t)length : UINT32_C(2000000000);
}

static void fill_schedule(aeo_fast_rls_t *self)
{
    const aeo_real_t n = (aeo_real_t)self->length, rate = AEO_REAL(1) - self->config.forgetting, q = n * rate;
    self->feedback = FEEDBACK_MAX * q * q > FEEDBACK_TAIL ? FEEDBACK_TAIL / (q * q) : FEEDBACK_MAX;
    self->life = UINT32_MAX;
    self->wait = 4u * self->length;
    self->warm = 50u * self->length; /* where nothing is forgotten */
    self->patience = self->warm;
    if (rate * (aeo_real_t)self->wait > AEO_REAL(0.1)) {
        self->wait = to_samples(AEO_REAL(0.1) / rate);
    }
    if (rate > AEO_REAL(0)) { /* at least half of a rounding error */
        aeo_real_t warm = AEO_REAL(2) * WARM;
        if (q > STEADY) {
            const aeo_real_t life = LIFE + TAIL / q;
            warm = life < AEO_REAL(2) * warm ? life / AEO_REAL(2) : warm;
            warm = warm > WARM ? warm : WARM;
            self->life = to_samples((life - warm) / rate);
        }
        self->warm = to_samples(warm / rate) + 2u * self->config.past;
        self->patience = to_samples(ASTRAY_MEMORIES / rate) + 2u * self->config.past;
    }
}

static void place(aeo_fast_rls_t *self, aeo_real_t *memory)
{
    const size_t m = self->config.block, n = self->length, l = self->config.outputs;
    for (int i = 0; i < 2; i++) {
        aeo_fast_rls_array_t *const array = &self->array[i];
        array->forward = memory;
        array->backward = array->forward + m * n;
        array->gain = array->backward + m * n;
        array->share = array->gain + n + m;
        array->factor = array->share + n + m;
        array->energy = array->factor + m * (m + 1) / 2;
        array->scalar = array->energy + m * m;
        memory = array->scalar + 3;
    }
    self->theta = memory;
    self->window = self->theta + n * l;
    self->added = self->window + m + n;
    self->innovation = self->added + m + n;
    self->residual = self->innovation + l;
    self->watched = self->residual + l;
    self->step = self->watched + AEO_WATCH_WORDS(l);
    self->update = self->step + n;
    self->error = self->update + n;
}

aeo_status_t aeo_fast_rls_init(aeo_fast_rls_t *self, const aeo_fast_rls_config_t *config, aeo_real_t *memory,
                               size_t words)
{
    if (self == NULL || config == NULL || memory == NULL) {
        return AEO_E_ARG;
    }
    const uint16_t tail = (uint16_t)aeo_settings_count_bits(config->feedthrough);
    const aeo_status_t status = judge_config(config, tail);
    if (status != AEO_OK) {
        return status;
    }
    if (words < AEO_FAST_RLS_WORDS(config->past, config->block, tail, config->outputs)) {
        return AEO_E_MEMORY;
    }
    self->config = *config; /* which may be self's own */
    self->health = 0;
    memset(&self->count, 0, sizeof self->count);
    self->tail = tail;
    self->length = (uint16_t)AEO_FAST_RLS_LENGTH(config->past, config->block, tail);
    self->inverse_root_forgetting = aeo_inverse_root(config->forgetting);
    self->variance_max = config->growth_max / config->regularisation;                      /* regularisation >= 1e-8 */
    self->disturbance = AEO_SQRT((AEO_REAL(1) - config->forgetting) / self->variance_max); /* growth_max >= 4 */
    fill_schedule(self);
    place(self, memory);
    aeo_fast_rls_reset(self);
    return AEO_OK;
}

/* theta that no scaled data have, as a fault may leave it, is not kept when arrays start afresh: with a rho raised by
 * arrays lost in the fault not even twenty memories would lead back. */
static void judge_theta(aeo_fast_rls_t *self)
{
    const size_t count = (size_t)self->length * self->config.outputs;
    if (!aeo_linalg_all_within(self->theta, count, KEPT_MAX)) {
        memset(self->theta, 0, count * sizeof *self->theta);
    }
}

/* Forget the window and both arrays; the first array is ready for the next sample. */
static void start_arrays(aeo_fast_rls_t *self)
{
    memset(self->window, 0, (size_t)(self->innovation - self->window) * sizeof *self->window);
    self->disturbed = 0;
    aeo_fast_array_start(self, &self->array[0]);
    aeo_fast_array_start(self, &self->array[1]);
    self->active = 0;
    self->filled = 0;
    judge_theta(self);
}

void aeo_fast_rls_reset(aeo_fast_rls_t *self)
{
    if (self == NULL) {
        return;
    }
    const size_t words = (size_t)(self->error - self->array[0].forward) + 3u * self->config.block;
    memset(self->array[0].forward, 0, words * sizeof *self->theta);
    self->hold = 0;
    self->astray = 0;
    self->random = 1;
    self->regularisation = self->config.regularisation;
    aeo_watch_start(&self->watch, self->watched, self->config.outputs);
    start_arrays(self);
}

/* The disturbance's sign: xorshift, period 2^32 - 1. */
static aeo_real_t draw_disturbance(aeo_fast_rls_t *self)
{
    uint32_t x = self->random;
    x ^= x << 13 & UINT32_C(0xFFFFFFFF);
    x ^= x >> 17;
    x ^= x << 5 & UINT32_C(0xFFFFFFFF);
    self->random = x;
    return (x >> 16 & 1u) != 0u ? self->disturbance : -self->disturbance;
}

static aeo_real_t magnitude(aeo_real_t x)
{
    return x < AEO_REAL(0) ? -x : x;
}

/* How z continues the window. */
typedef enum { CONTINUES, CONTINUES_PARTLY, BREAKS } fit_t;

/* Compare w (z in the order of w) with the window, not moved yet, but for the newest m entries: the same but for
 * disturbances and their rounding. Places from before the first sample hold zeros. */
static fit_t compare_window(const aeo_fast_rls_t *self, const aeo_real_t *w)
{
    const size_t n = self->length, m = self->config.block, seen = (size_t)self->filled * m;
    const size_t known = seen + m < n ? n - m - seen : 0;
    const aeo_real_t *const before = self->window + 2 * m;
    const aeo_real_t same = AEO_REAL(2) * self->disturbance;
    fit_t fit = CONTINUES;
    for (size_t i = n - m; i-- > 0;) {
        const aeo_real_t apart = magnitude(w[i] - before[i]);
        if (apart <= same || apart <= same + AEO_REAL(2) * AEO_REAL_EPSILON * magnitude(w[i])) {
            continue;
        }
        if (i >= known) {
            return BREAKS;
        }
        fit = CONTINUES_PARTLY;
    }
    return fit;
}

/* Samples theta waits before it listens to an array that starts when another one, age samples old, is gone: the
 * first gains of an array would throw away what theta knows. A tenth of a memory is best on turbine data: theta then
 * stays within 0.14 of the square-root filter's (p = 10), after half a memory within 0.17, after three within 0.34,
 * for theta's own walk under noise is 0.2 a memory. And at most half of age: records with many breaks must go on
 * learning. */
static uint32_t find_hold(const aeo_fast_rls_t *self, uint32_t age)
{
    return self->wait < age / 2u ? self->wait : age / 2u;
}

/* Move count numbers down by m places: old and new overlap. */
static void move_down(aeo_fast_rls_t *self, aeo_real_t *x)
{
    memcpy(self->step, x + self->config.block, self->length * sizeof *x);
    memcpy(x, self->step, self->length * sizeof *x);
}

/* Disturb channel c of the newest block, which the window already holds. */
static void disturb(aeo_fast_rls_t *self, size_t c)
{
    const size_t n = self->length;
    const aeo_real_t before = self->window[n + c];
    if (self->disturbed == 0u) { /* nothing was in the window, whatever is left in these */
        memset(self->array[0].share, 0, n * sizeof *self->theta);
        memset(self->array[1].share, 0, n * sizeof *self->theta);
    }
    self->window[n + c] += draw_disturbance(self);
    self->added[n + c] = self->window[n + c] - before; /* as rounding leaves it */
    self->disturbed = self->config.past + 2u;
    aeo_count_up(&self->count.bounded);
    self->health |= AEO_FAST_RLS_BOUNDED;
}

/* Move the window on by one block. w is z in the order of w. */
static fit_t move_window(aeo_fast_rls_t *self, const aeo_real_t *w)
{
    const size_t n = self->length, m = self->config.block;
    fit_t fit = compare_window(self, w);
    if (fit == BREAKS) {
        self->hold = find_hold(self, self->array[self->active].age);
        start_arrays(self);
        aeo_count_up(&self->count.restarted);
        self->health |= AEO_FAST_RLS_RESTARTED;
        fit = compare_window(self, w);
    }
    if (self->filled == 0u) { /* the watch has taken z; of it a new array absorbs what enters the window now */
        aeo_watch_forget(&self->watch, self->watched, aeo_linalg_dot(w + (n - m), w + (n - m), m));
    }
    move_down(self, self->window);
    memcpy(self->window + n, w + (n - m), m * sizeof *w);
    if (self->disturbed > 0u) {
        self->disturbed--;
        move_down(self, self->added);
        memset(self->added + n, 0, m * sizeof *w);
    }
    if (self->filled <= self->config.past) {
        self->filled++;
    }
    for (size_t c = 0; c < m && self->config.forgetting < AEO_REAL(1); c++) {
        if (aeo_fast_array_variance(self, &self->array[self->active], c) > self->variance_max) {
            disturb(self, c);
        }
    }
    return fit;
}

/* innovation = y - theta z; returns 1 when all are below the bound from which the update is proven not to overflow. */
static int find_innovation(aeo_fast_rls_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    return aeo_linalg_find_error(self->theta, z, self->length, y, self->innovation, self->config.outputs);
}

/* The array in charge has lost its way: its follower takes over when it has absorbed a quarter of what makes it warm,
 * else both start afresh and theta waits at least until the window has passed once. */
static void replace_array(aeo_fast_rls_t *self)
{
    aeo_fast_rls_array_t *const lost = &self->array[self->active], *const follower = &self->array[self->active ^ 1u];
    const uint32_t pass = self->config.past + 1u, hold = find_hold(self, lost->age);
    if (self->regularisation < self->config.regularisation * REGULARISATION_RISE) {
        self->regularisation *= AEO_REAL(16);
    }
    aeo_fast_array_start(self, lost);
    if (follower->age > self->warm / 4u) {
        self->active ^= 1u;
        if (aeo_fast_array_step(self, follower)) {
            return;
        }
    }
    aeo_fast_array_start(self, follower);
    judge_theta(self);
    aeo_watch_forget(&self->watch, self->watched, AEO_REAL(0));
    self->hold = hold > pass ? hold : pass;
}

/* Start, feed and promote the array that follows the one in charge. */
static void feed_follower(aeo_fast_rls_t *self)
{
    aeo_fast_rls_array_t *const first = &self->array[self->active], *const follower = &self->array[self->active ^ 1u];
    if (follower->age == 0u) {
        if (first->age < self->life && !aeo_fast_array_is_late(first)) {
            return;
        }
        aeo_fast_array_start(self, follower); /* until now its memory held the rests of the first */
    }
    if (!aeo_fast_array_step(self, follower)) {
        aeo_fast_array_start(self, follower);
    } else if (follower->age >= self->warm) {
        aeo_fast_array_start(self, first);
        self->active ^= 1u;
        aeo_count_up(&self->count.renewed);
    }
}

/* One sample through window and arrays; z is judged and the innovation found. */
static void absorb(aeo_fast_rls_t *self, const aeo_real_t *z)
{
    const fit_t fit = move_window(self, aeo_fast_theta_order(self, z, 0));
    memcpy(self->residual, self->innovation, self->config.outputs * sizeof *self->residual);
    if (!aeo_fast_array_step(self, &self->array[self->active])) {
        replace_array(self);
        aeo_count_up(&self->count.reinitialised);
        self->health |= AEO_FAST_RLS_REINITIALISED;
        return;
    }
    if (fit != CONTINUES || self->hold > 0u || !aeo_fast_theta_learn(self, z)) {
        self->hold -= self->hold > 0u ? 1u : 0u;
        aeo_count_up(&self->count.held);
    }
    feed_follower(self);
}

/* Return 1 when the innovations have been far larger than the outputs for long: more often than not, for a single
 * reading, or an output that passes through 0, says nothing. */
static int is_astray(aeo_fast_rls_t *self, const aeo_real_t *y)
{
    const size_t l = self->config.outputs;
    const aeo_real_t power = aeo_linalg_dot(self->innovation, self->innovation, l); /* at most 32 1e24 */
    if (power > ASTRAY_RATIO * (aeo_linalg_dot(y, y, l) + ASTRAY_LEAST)) {
        self->astray++;
    } else {
        self->astray -= self->astray > 0u ? 1u : 0u;
    }
    return self->astray > self->patience;
}

/* Let both arrays start afresh when they hold too much for the data of late; theta waits until their window is whole.
 * The whole window counts: after a gap blocks enter it that were the newest of no sample absorbed. Before the sample is
 * absorbed, so that nobody needs y any more further down. */
static void watch(aeo_fast_rls_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    const aeo_real_t power = aeo_linalg_dot(z, z, self->length);
    if (aeo_watch_take(&self->watch, self->watched, self->config.outputs, y, power, self->config.forgetting, 0)) {
        self->hold = find_hold(self, self->array[self->active].age);
        self->regularisation = self->config.regularisation;
        start_arrays(self);
        aeo_count_up(&self->count.released);
        self->health |= AEO_FAST_RLS_RELEASED;
    }
}

aeo_status_t aeo_fast_rls_update(aeo_fast_rls_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    const aeo_status_t status =
        aeo_linalg_judge_sample(z, self->length, y, self->config.outputs, &self->count.rejected);
    if (status != AEO_OK) {
        return status;
    }
    if (!find_innovation(self, z, y) || is_astray(self, y)) {
        aeo_fast_rls_reset(self);
        aeo_count_up(&self->count.reinitialised);
        self->health |= AEO_FAST_RLS_REINITIALISED;
        (void)find_innovation(self, z, y); /* theta = 0: it is y, at most 1e6 */
    }
    if (self->config.forgetting < AEO_REAL(1)) {
        watch(self, z, y);
    }
    absorb(self, z);
    aeo_count_up(&self->count.updates);
    return AEO_OK;
}

const aeo_real_t *aeo_fast_rls_theta(const aeo_fast_rls_t *self)
{
    return self->theta;
}

aeo_status_t aeo_fast_rls_read(const aeo_fast_rls_t *self, aeo_real_t *theta, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    return aeo_linalg_copy_out(self->theta, (size_t)self->length * self->config.outputs, theta, length);
}

const aeo_real_t *aeo_fast_rls_innovation(const aeo_fast_rls_t *self)
{
    return self->innovation;
}

const aeo_real_t *aeo_fast_rls_residual(const aeo_fast_rls_t *self)
{
    return self->residual;
}

uint32_t aeo_fast_rls_health(const aeo_fast_rls_t *self)
{
    return self != NULL ? self->health : 0u;
}

void aeo_fast_rls_clear_health(aeo_fast_rls_t *self)
{
    if (self != NULL) {
        self->health = 0u;
    }
}
/* SPDX-License-Identifier: MIT */
