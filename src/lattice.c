/* lattice.c: the recursion of lattice.h; lattice_read.c works out theta, saves and restores. */
#include "aeolid/lattice.h"

#include "lattice_state.h"
#include "linalg.h"
#include "rows.h"
#include "settings.h"
#include "triangle.h"

#include <string.h>

/* Bounds from which nothing below overflows in float. Samples are at most 1e6 (checked), variances at most
 * 2 growth_max / rho <= 2e10 (checked at init, kept by bound_variances). An error r or f beyond ERROR_MAX forces a
 * fresh start before it is used, so with m <= 96 and p m <= 1024
 *   r'Pr <= tr(P) |r|^2 <= 96 2e10 96 1e20 < 2e34, which bounds each D_j v_j^2 too; alpha < 3e35, 1024 / 96 of it;
 *   |P r|_i <= (P_ii r'Pr)^(1/2) < 2e22, g_i <= P_ii^(1/2) / (2 lambda^(1/2)) < 1.1e5,
 * a weight moves by less than 1.1e15 an update and stays below 1.1e26 for 1e11 updates, and the next error lies below
 * 1e10 + 96 1.1e26 1e10 < 1.1e38 < FLT_MAX, where it is judged. Targets are judged at the end of the stages only: what
 * they may do to their weights until then, infinities included, goes with the fresh start. */

/* The oldest block's prior weighs lambda^{1-p} that of the newest: with less than this the window is longer than what
 * the filter remembers. */
#define FADED_MIN AEO_REAL(1e-6)

#if AEO_REAL_BYTES == 8
typedef uint64_t bits_t;
#else
typedef uint32_t bits_t;
#endif

/* Largest weight that is kept when covariances start anew; theta of scaled data stays below some tens. */
#define WEIGHT_MAX AEO_REAL(100)

/* Samples for each regressor after which the first ones are thrown away, when they were no true start. */
#define LEARNING 4u

static int sizes_hold(const aeo_lattice_config_t *config)
{
    const unsigned p = config->past, m = config->block, d = config->present, l = config->outputs;
    return p >= 1u && m >= 1u && m <= AEO_LATTICE_BLOCK_MAX && d <= m && l >= 1u && l <= AEO_LATTICE_OUTPUTS_MAX &&
           p <= AEO_LATTICE_REGRESSORS_MAX && p * m + d <= AEO_LATTICE_REGRESSORS_MAX;
}

aeo_status_t aeo_lattice_judge_config(const aeo_lattice_config_t *config)
{
    const aeo_status_t status = aeo_settings_judge_common(config->forgetting, config->regularisation,
                                                          config->excitation_min, config->growth_max);
    if (status != AEO_OK) {
        return status;
    }
    if (!sizes_hold(config)) {
        return AEO_E_ARG;
    }
    aeo_real_t faded = AEO_REAL(1);
    for (unsigned j = 1; j < config->past; j++) {
        faded *= config->forgetting;
    }
    return faded >= FADED_MIN ? AEO_OK : AEO_E_ARG;
}

size_t aeo_lattice_count_words(const aeo_lattice_config_t *config)
{
    return AEO_LATTICE_WORDS(config->past, config->block, config->present, config->outputs);
}

static void place_arrays(aeo_lattice_t *self, aeo_real_t *memory)
{
    const size_t p = self->config.past, m = self->config.block, d = self->config.present, l = self->config.outputs;
    self->factor = memory;
    self->present_factor = self->factor + (2 * p - 1) * AEO_LATTICE_TRIANGLE(m);
    self->present_weight = self->present_factor + AEO_LATTICE_TRIANGLE(d);
    self->target_weight = self->present_weight + l * d;
    self->forward_weight = self->target_weight + p * m * (l + d);
    self->backward_weight = self->forward_weight + (p - 1) * m * m;
    self->window = self->backward_weight + (p - 1) * m * m;
    self->error = self->window + p * m;
    self->gain = self->error + p * m;
    self->alpha = self->gain + p * m;
    self->step = self->alpha + p;
    self->innovation = self->step + p;
    self->residual = self->innovation + l;
    self->watched = self->residual + l;
    self->forward = self->watched + AEO_WATCH_WORDS(l);
    self->targets = self->forward + m;
    self->spare = self->targets + l + d;
    self->reading = self->spare + 2 * m;
}

aeo_status_t aeo_lattice_init(aeo_lattice_t *self, const aeo_lattice_config_t *config, aeo_real_t *memory, size_t words)
{
    if (self == NULL || config == NULL || memory == NULL) {
        return AEO_E_ARG;
    }
    const aeo_status_t status = aeo_lattice_judge_config(config);
    if (status != AEO_OK) {
        return status;
    }
    if (words < aeo_lattice_count_words(config)) {
        return AEO_E_MEMORY;
    }
    self->config = *config; /* which may be self's own */
    self->following = 0;
    self->health = 0;
    memset(&self->count, 0, sizeof self->count);
    place_arrays(self, memory);
    const unsigned n = config->past * (unsigned)config->block + config->present;
    self->inverse_forgetting = AEO_REAL(1) / config->forgetting; /* forgetting >= 1/2 */
    self->gate = config->excitation_min * (AEO_REAL(1) - config->forgetting) * (aeo_real_t)n;
    self->variance_max = config->growth_max / config->regularisation; /* regularisation >= 1e-8 */
    self->scan_step =
        (uint16_t)aeo_settings_find_scan_step(aeo_lattice_count_variances(config), config->forgetting); /* < 2^11 */
    aeo_lattice_reset(self);
    return AEO_OK;
}

aeo_status_t aeo_lattice_copy(const aeo_lattice_t *self, aeo_lattice_t *copy, aeo_real_t *memory, size_t words)
{
    if (self == NULL || copy == NULL || memory == NULL || copy == self) {
        return AEO_E_ARG;
    }
    if (words < aeo_lattice_count_words(&self->config)) {
        return AEO_E_MEMORY;
    }
    *copy = *self;
    copy->read_order = 0;
    place_arrays(copy, memory);
    memcpy(memory, self->factor, aeo_lattice_count_state(self) * sizeof *memory);
    return AEO_OK;
}

/* P = 1 / prior everywhere: with x_{k-i} worth rho lambda^{-i}, E^b_j = rho lambda^{-j} and E^f_j = rho. Any other
 * prior is no older self of itself moved by one block, and the order recursions would not be exact. */
static void reset_factors(aeo_lattice_t *self)
{
    const size_t p = self->config.past;
    const aeo_real_t newest = AEO_REAL(1) / self->config.regularisation; /* regularisation >= 1e-8 */
    aeo_real_t diagonal = newest, *factor = self->factor;
    for (size_t j = 0; j + 1 < 2 * p; j++) {
        factor = aeo_triangle_start(factor, self->config.block, diagonal);
        /* the last backward one is at least FADED_MIN newest > 0 */
        diagonal = j + 1 < p ? diagonal * self->config.forgetting : newest;
    }
    aeo_triangle_start(factor, self->config.present, newest);
    aeo_watch_forget(&self->watch, self->watched, AEO_REAL(0));
}

/* Let the covariances start anew and weights stay, unless a fault has left some that no scaled data have. Until such are
 * learnt anew their errors would go into the covariances of the later stages, and outlast ln(weight^2) memories there. */
static void restart_factors(aeo_lattice_t *self)
{
    const size_t weights = (size_t)(self->window - self->present_weight);
    reset_factors(self);
    if (!aeo_linalg_all_within(self->present_weight, weights, WEIGHT_MAX)) {
        memset(self->present_weight, 0, weights * sizeof *self->present_weight);
    }
}

void aeo_lattice_reset(aeo_lattice_t *self)
{
    if (self == NULL) {
        return;
    }
    memset(self->factor, 0, aeo_lattice_count_state(self) * sizeof *self->factor);
    aeo_watch_start(&self->watch, self->watched, self->config.outputs);
    reset_factors(self);
    for (size_t j = 0; j < self->config.past; j++) {
        self->alpha[j] = self->config.forgetting;
    }
    self->read_order = 0;
    self->orders = self->config.past;
    self->learning = 0;
    self->head = 0;
    self->scan = 0;
    self->begun = 0;
    self->quiet = 0;
}

/* Keep z without its present inputs; returns 1 when it is the window kept before, moved by one block. Compared are
 * bits, as blocks are handed on, not worked out anew. */
static int take_window(aeo_lattice_t *self, const aeo_real_t *z)
{
    const size_t m = self->config.block, older = m * (self->config.past - 1u);
    aeo_real_t *const window = self->window;
    int moved = 1;
    for (size_t i = 0; i < older; i++) {
        bits_t now, before;
        memcpy(&now, z + i, sizeof now);
        memcpy(&before, window + i + m, sizeof before);
        if (now != before) {
            moved = 0;
        }
        memcpy(window + i, &now, sizeof now);
    }
    memcpy(window + older, z + older, m * sizeof *z);
    return moved;
}

/* Carry out the regression at hand, which lies in self to keep it off the stack: P and weights move on, or stay when r
 * is only followed. */
static void regress(aeo_lattice_t *self)
{
    aeo_lattice_regression_t *const on = &self->on;
    on->alpha = aeo_lattice_turn(on->factor, on->r, on->gain, on->m, on->alpha,
                                 self->following ? AEO_REAL(0) : self->inverse_forgetting);
    on->step = self->following ? AEO_REAL(0) : AEO_REAL(1) / on->alpha; /* alpha >= lambda >= 1/2 */
    aeo_rows_correct(on->weight, on->r, on->targets, on->count, on->m, on->gain, on->step);
}

/* Stage j's predictions: forward becomes f_{j+1}(k), and r_j(k-1) becomes r_{j+1}(k) where it lies, in what is the next
 * stage's place by now. gain, alpha and step come from the sample before, whose covariance the forward predictor
 * shares. Returns 0 when an error ran away. */
static int predict(aeo_lattice_t *self, size_t j)
{
    const size_t m = self->config.block;
    aeo_real_t *const error = aeo_lattice_find_error(self, j + 1), *const old = self->spare;
    memcpy(old, self->forward, m * sizeof *old);
    aeo_rows_correct(self->forward_weight + j * m * m, error, self->forward, m, m, self->gain + j * m, self->step[j]);
    self->on.factor = self->factor + (self->config.past + j) * AEO_LATTICE_TRIANGLE(m);
    self->on.weight = self->backward_weight + j * m * m;
    self->on.r = old;
    self->on.targets = error;
    self->on.gain = old + m;
    self->on.alpha = self->alpha[j];
    self->on.m = m;
    self->on.count = m;
    regress(self);
    return aeo_linalg_all_within(self->forward, m, AEO_LATTICE_ERROR_MAX) &&
           aeo_linalg_all_within(error, m, AEO_LATTICE_ERROR_MAX);
}

/* Regress the targets on the backward error of stage j. */
static void explain(aeo_lattice_t *self, size_t j)
{
    const size_t m = self->config.block, count = (size_t)self->config.outputs + self->config.present;
    /* a sample that is followed has no part in the covariances: its errors a priori count in full */
    self->alpha[j] = self->following ? self->config.forgetting : self->news;
    self->on.factor = self->factor + j * AEO_LATTICE_TRIANGLE(m);
    self->on.weight = self->target_weight + j * m * count;
    self->on.r = aeo_lattice_find_error(self, j);
    self->on.targets = self->targets;
    self->on.gain = self->gain + j * m;
    self->on.alpha = self->news;
    self->on.m = m;
    self->on.count = count;
    regress(self);
    self->news = self->on.alpha;
    self->step[j] = self->on.step;
}

/* Regress what is left of y on what is left of u_k. */
static void explain_present(aeo_lattice_t *self)
{
    self->on.factor = self->present_factor;
    self->on.weight = self->present_weight;
    self->on.r = self->targets + self->config.outputs;
    self->on.targets = self->targets;
    self->on.gain = self->spare;
    self->on.alpha = self->news;
    self->on.m = self->config.present;
    self->on.count = self->config.outputs;
    regress(self);
    self->news = self->on.alpha;
}

/* Run the newest block and the targets through the stages that are filled. Returns 0 when an error ran away: those of
 * blocks, which go into covariances, are judged in each stage, those of targets at the end. */
static int run_stages(aeo_lattice_t *self)
{
    self->news = self->config.forgetting;
    for (size_t j = 0; j < self->orders; j++) {
        if (j + 1u < self->orders && !predict(self, j)) {
            return 0;
        }
        explain(self, j);
    }
    const size_t l = self->config.outputs, d = self->config.present;
    if (!aeo_linalg_all_within(self->targets, l + d, AEO_LATTICE_ERROR_MAX)) {
        return 0;
    }
    if (d > 0u) {
        explain_present(self);
    }
    return aeo_linalg_all_within(self->targets, l, AEO_LATTICE_ERROR_MAX);
}

/* Absorb or follow one judged sample; returns 0 when an error ran away. */
static int take_sample(aeo_lattice_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    const size_t m = self->config.block, l = self->config.outputs, older = m * (self->config.past - 1u);
    memcpy(self->forward, z + older, m * sizeof *z);
    self->head = self->head > 0u ? self->head - 1u : self->config.past - 1u;
    memcpy(aeo_lattice_find_error(self, 0), z + older, m * sizeof *z);
    memcpy(self->targets, y, l * sizeof *y);
    memcpy(self->targets + l, z + older + m, self->config.present * sizeof *z);
    if (!run_stages(self)) {
        return 0;
    }
    const aeo_real_t lambda = self->config.forgetting;
    const aeo_real_t left = self->following ? AEO_REAL(1) : lambda / self->news; /* news >= lambda */
    for (size_t i = 0; i < l; i++) {
        self->innovation[i] = self->targets[i];
        self->residual[i] = self->targets[i] * left;
    }
    self->quiet = (self->orders == self->config.past && self->news - lambda < self->gate);
    return 1;
}

/* Quarter the next variance when it passed the bound, by a measurement of the weights it belongs to which agrees with
 * what they are: of weight 3 / P_ii it takes P_ii to P_ii / (1 + 3). Only forgetting makes P grow, at most by 2 between
 * two checks, so P_ii <= 2 variance_max. */
static void bound_variance(aeo_lattice_t *self)
{
    const aeo_lattice_variance_t at = aeo_lattice_find_variance(self, self->factor, self->scan);
    const aeo_real_t variance = aeo_lattice_variance(&at);
    if (variance <= self->variance_max) {
        return;
    }
    aeo_real_t *const unit = self->spare;
    memset(unit, 0, at.m * sizeof *unit);
    unit[at.i] = AEO_REAL(1);
    aeo_lattice_turn(self->factor + (at.factor - self->factor), unit, unit + at.m, at.m, variance / AEO_REAL(3),
                     AEO_REAL(1)); /* variance > 0 */
    aeo_count_up(&self->count.bounded);
    self->health |= AEO_LATTICE_BOUNDED;
}

static void bound_variances(aeo_lattice_t *self)
{
    for (unsigned s = 0; s < self->scan_step; s++) {
        bound_variance(self);
        self->scan = self->scan + 1u < aeo_lattice_count_variances(&self->config) ? self->scan + 1u : 0u;
    }
}

/* A first window whose older blocks are not 0 was preceded by samples that the stages count as 0. */
static void begin(aeo_lattice_t *self, int from_rest)
{
    self->begun = 1;
    self->learning =
        from_rest ? 0u : LEARNING * (self->config.past * (uint32_t)self->config.block + self->config.present);
}

/* Judge how z follows the one before: sets following, orders and learning. */
static void place_sample(aeo_lattice_t *self, const aeo_real_t *z)
{
    const size_t p = self->config.past;
    const int moved = take_window(self, z);
    if (!self->begun) {
        begin(self, moved);
    } else if (!moved) {
        self->orders = 0;
        self->quiet = 0;
        memset(self->step, 0, p * sizeof *self->step);
        aeo_count_up(&self->count.restarted);
        self->health |= AEO_LATTICE_RESTARTED;
    }
    self->following = self->quiet;
    if (self->quiet) {
        aeo_count_up(&self->count.withheld);
        self->health |= AEO_LATTICE_WITHHELD;
    } else if (self->orders < p) {
        self->orders++;
        self->following = self->orders < p;
    }
}

static void start_afresh(aeo_lattice_t *self, const aeo_real_t *z)
{
    aeo_lattice_reset(self);
    take_window(self, z);
    begin(self, 0);
    self->following = 0;
    aeo_count_up(&self->count.reinitialised);
    self->health |= AEO_LATTICE_REINITIALISED;
}

/* Let the covariances start anew when they hold too much for the data of late; withheld: the gate kept this sample out.
 * All n entries count: blocks that were only followed enter the covariances as targets of the ones behind, and present
 * inputs have a covariance of their own, which a gap right behind them leaves without any later z that brings them. */
static void watch(aeo_lattice_t *self, const aeo_real_t *z, const aeo_real_t *y, int withheld)
{
    const size_t n = (size_t)self->config.past * self->config.block + self->config.present;
    const aeo_real_t power = aeo_linalg_dot(z, z, n);
    withheld += withheld && power >= self->gate * self->config.regularisation;
    if (aeo_watch_take(&self->watch, self->watched, self->config.outputs, y, power, self->config.forgetting,
                       withheld)) {
        restart_factors(self);
        self->learning = 0;
        self->quiet = 0;
        aeo_count_up(&self->count.released);
        self->health |= AEO_LATTICE_RELEASED;
    }
}

aeo_status_t aeo_lattice_update(aeo_lattice_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    const size_t n = (size_t)self->config.past * self->config.block + self->config.present;
    const aeo_status_t status = aeo_linalg_judge_sample(z, n, y, self->config.outputs, &self->count.rejected);
    if (status != AEO_OK) {
        return status;
    }
    place_sample(self, z);
    const int withheld = self->quiet != 0u;
    if (!take_sample(self, z, y)) {
        start_afresh(self, z);
        (void)take_sample(self, z, y); /* all weights are 0: errors are samples, at most 1e6 */
    }
    if (!self->following) {
        if (self->config.forgetting < AEO_REAL(1)) {
            bound_variances(self);
        }
        if (self->learning > 0u && --self->learning == 0u) {
            restart_factors(self);
        }
    }
    if (self->config.forgetting < AEO_REAL(1) && (withheld || !self->following)) {
        watch(self, z, y, withheld && self->following);
    }
    self->read_order = 0;
    aeo_count_up(&self->count.updates);
    return AEO_OK;
}
/* SPDX-License-Identifier: MIT */
