/* els.c: the feedback, schedule and guard of els.h around the recursion of rls.c. */
#include "aeolid/els.h"

#include "guard.h"
#include "linalg.h"
#include "saved.h"
#include "settings.h"

#include <string.h>

/* A guard needs a mean over at least 8 samples; starts lengthen up to 2^6 times; a run of so many waits was sound. */
#define VARX_MIN    16u
#define BACKOFF_MAX 6u
#define SOUND_WAITS 16u
/* Theta of scaled data stays below some tens, and what is left of an output below that output. */
#define KEPT_MAX AEO_REAL(100)
#define REST_MAX AEO_REAL(10)

static int guard_is_on(const aeo_els_config_t *config)
{
    return config->guard_ratio > AEO_REAL(0);
}

/* p blocks [u; y; e], of which u may be empty; without blocks there is nothing to guard or to start from. */
static int layout_holds(const aeo_els_config_t *config)
{
    const unsigned n = config->regressors, p = config->past, d = config->present;
    if (p == 0u) {
        return d == 0u && config->varx_samples == 0u && !guard_is_on(config);
    }
    return n > d && (n - d) % p == 0u && (n - d) / p >= 2u * config->outputs;
}

/* What is not the inner filter's to judge. */
static aeo_status_t judge_config(const aeo_els_config_t *config)
{
    static const aeo_real_t RANGES[4][2] = {{AEO_REAL(0.5), AEO_REAL(1)},
                                            {AEO_REAL(0.5), AEO_REAL(1)},
                                            {AEO_REAL(0), AEO_REAL(0.999999)},
                                            {AEO_REAL(0), AEO_REAL(100)}};
    const aeo_real_t settings[4] = {config->forgetting, config->forgetting_start, config->forgetting_rate,
                                    config->guard_ratio};
    const aeo_status_t status = aeo_settings_judge(settings, RANGES, 4);
    if (status != AEO_OK) {
        return status;
    }
    const int guard_holds =
        !guard_is_on(config) || (config->guard_ratio >= AEO_REAL(1.5) && config->varx_samples >= VARX_MIN);
    return layout_holds(config) && config->forgetting_start <= config->forgetting &&
                   config->varx_samples <= AEO_ELS_VARX_SAMPLES_MAX && guard_holds
               ? AEO_OK
               : AEO_E_ARG;
}

aeo_status_t aeo_els_init(aeo_els_t *self, const aeo_els_config_t *config, aeo_real_t *memory, size_t words)
{
    if (self == NULL || config == NULL || memory == NULL) {
        return AEO_E_ARG;
    }
    aeo_status_t status = judge_config(config);
    if (status != AEO_OK) {
        return status;
    }
    const size_t own = AEO_ELS_OWN(config->outputs);
    const aeo_rls_config_t inner = {config->regressors,     config->outputs,        config->forgetting,
                                    config->regularisation, config->excitation_min, config->growth_max};
    /* rls checks its settings first and its memory last, so too few words for both are too few for it alone */
    status = aeo_rls_init(&self->rls, &inner, memory, words < own ? 0u : words - own);
    if (status != AEO_OK) {
        return status;
    }
    const size_t l = config->outputs;
    self->config = *config;
    self->feedback = memory + AEO_RLS_WORDS(config->regressors, l);
    self->levels = self->feedback + l;
    self->health = 0u;
    memset(&self->count, 0, sizeof self->count);
    aeo_els_reset(self);
    return AEO_OK;
}

static void set_shortfall(aeo_els_t *self, aeo_real_t shortfall)
{
    self->shortfall = shortfall;
    /* lambda_start <= lambda <= lambda_end, both checked at init: never refused */
    (void)aeo_rls_set_forgetting(&self->rls, self->config.forgetting - shortfall);
}

/* Feed nothing back for a VARX start, with the schedule at its beginning. */
static void start_varx(aeo_els_t *self)
{
    memset(self->feedback, 0, AEO_ELS_OWN(self->config.outputs) * sizeof *self->feedback);
    self->since = 0u;
    self->missed = 0u;
    self->wait = self->config.varx_samples << self->backoff;
    set_shortfall(self, self->config.forgetting - self->config.forgetting_start);
}

void aeo_els_reset(aeo_els_t *self)
{
    if (self == NULL) {
        return;
    }
    aeo_rls_reset(&self->rls);
    self->backoff = 0u;
    start_varx(self);
}

/* The columns of e in theta become 0: the last l of each of the p blocks. */
static void clear_moving_average(aeo_els_t *self)
{
    const unsigned n = self->config.regressors, l = self->config.outputs, past = n - self->config.present;
    const unsigned m = self->config.past > 0u ? past / self->config.past : n + l; /* without blocks: no column */
    aeo_real_t *entry = self->rls.theta;
    for (unsigned i = 0; i < l; i++) {
        for (unsigned j = 0; j < n; j++, entry++) {
            if (j < past && j % m + l >= m) {
                *entry = AEO_REAL(0);
            }
        }
    }
}

aeo_status_t aeo_els_start(aeo_els_t *self, const aeo_real_t *theta)
{
    if (self == NULL || self->config.past == 0u) {
        return AEO_E_ARG;
    }
    const aeo_status_t status = aeo_rls_start(&self->rls, theta);
    if (status != AEO_OK) {
        return status;
    }
    clear_moving_average(self);
    self->backoff = 0u;
    start_varx(self);
    return AEO_OK;
}

/* Back to VARX. What theta says of u and y stays as the new start: the fit of a VARX begins nearer to it than to 0. But
 * what no scaled data have was left by a fault, and would go into the yardstick that the start measures. */
static void fall_back(aeo_els_t *self)
{
    const uint32_t run = self->since > self->wait ? self->since - self->wait : 0u;
    const size_t count = (size_t)self->config.regressors * self->config.outputs;
    clear_moving_average(self);
    if (!aeo_linalg_all_within(self->rls.theta, count, KEPT_MAX)) {
        memset(self->rls.theta, 0, count * sizeof *self->rls.theta);
    }
    (void)aeo_rls_start(&self->rls, self->rls.theta); /* which refuses entries beyond 1e6 only */
    if (run >= SOUND_WAITS * self->wait) {            /* wait <= 1e6 2^6: no overflow */
        self->backoff = 0u;
    } else if (self->backoff < BACKOFF_MAX) {
        self->backoff++;
    }
    start_varx(self);
    aeo_count_up(&self->count.fell_back);
    self->health |= AEO_ELS_FELL_BACK;
}

/* The newest e in z is what the last update gave to be fed back, or, right after a gap, 0. Two misses running are no
 * gap, unless the first was fed back to: then it is forgotten (aeo_els_step, estimator_els.c). */
static void notice_unfed(aeo_els_t *self, const aeo_real_t *z)
{
    const size_t l = self->config.outputs;
    const aeo_real_t *newest = z + (self->config.regressors - self->config.present - l);
    uint32_t missed = 0u;
    for (size_t i = 0; i < l; i++) {
        if (newest[i] < self->feedback[i] || newest[i] > self->feedback[i]) {
            missed = 1u;
        }
    }
    if (missed != 0u && self->missed != 0u) {
        aeo_count_up(&self->count.unfed);
        self->health |= AEO_ELS_UNFED;
    }
    self->missed = missed;
}

/* Return the terms in e of the prediction of output i, with theta as it is now. */
static aeo_real_t predict_from_e(const aeo_els_t *self, const aeo_real_t *z, size_t i)
{
    const size_t n = self->config.regressors, l = self->config.outputs, p = self->config.past;
    const size_t m = (n - self->config.present) / p; /* called with the guard on only: p >= 1 */
    const aeo_real_t *row = self->rls.theta + i * n;
    aeo_real_t sum = AEO_REAL(0);
    for (size_t block = 1; block <= p; block++) {
        const size_t e = block * m - l;
        sum += aeo_linalg_dot(row + e, z + e, l);
    }
    return sum;
}

/* Return what is left of output y without the terms in e. More than tenfold y and its scale is no livelier data but a
 * theta far off, which must not stretch the yardstick that is to tell of it. */
static aeo_real_t cut_rest(aeo_real_t rest, aeo_real_t y)
{
    const aeo_real_t most = REST_MAX * (aeo_is_between(y, AEO_REAL(-1), AEO_REAL(1)) ? AEO_REAL(1)
                                        : y > AEO_REAL(0)                            ? y
                                                                                     : -y);
    return rest > most ? most : rest < -most ? -most : rest;
}

/* Show the guard each output; returns 1 when the innovations of one have grown. */
static int watch(aeo_els_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    int grown = 0;
    for (size_t i = 0; i < self->config.outputs; i++) {
        const aeo_real_t rest = cut_rest(self->rls.residual[i] + predict_from_e(self, z, i), y[i]);
        grown |= aeo_guard_watch(self->levels + i * AEO_GUARD_WORDS, self->rls.innovation[i], rest, self->since,
                                 self->wait, self->config.guard_ratio);
    }
    return grown;
}

static void set_feedback(aeo_els_t *self)
{
    if (self->since <= self->wait) {
        return; /* zeros since the start */
    }
    for (size_t i = 0; i < self->config.outputs; i++) {
        const aeo_real_t limit =
            guard_is_on(&self->config) ? aeo_guard_limit(self->levels + i * AEO_GUARD_WORDS) : AEO_SCALED_MAX;
        const aeo_real_t e = self->rls.residual[i];
        self->feedback[i] = e;
        if (!aeo_is_between(e, -limit, limit)) {
            self->feedback[i] = e > limit ? limit : -limit;
            aeo_count_up(&self->count.limited);
            self->health |= AEO_ELS_LIMITED;
        }
    }
}

/* How often P has started anew of itself; modulo 2^32 once a counter stays at the top. */
static uint32_t count_starts(const aeo_els_t *self)
{
    return self->rls.count.reinitialised + self->rls.count.released;
}

/* What follows once the inner filter, started anew `starts` times before, has taken z; passes its status on. After a
 * fault of a sensor, too, the yardstick of the guard is to be measured again. */
static aeo_status_t attend(aeo_els_t *self, const aeo_real_t *z, const aeo_real_t *y, uint32_t starts,
                           aeo_status_t status)
{
    if (status != AEO_OK) {
        return status;
    }
    if (self->config.past > 0u) {
        notice_unfed(self, z);
    }
    aeo_count_up(&self->since);
    if ((guard_is_on(&self->config) && watch(self, z, y)) || count_starts(self) != starts) {
        fall_back(self);
        return AEO_OK;
    }
    set_feedback(self);
    if (self->shortfall > AEO_REAL(0)) {
        const aeo_real_t next = self->shortfall * self->config.forgetting_rate;
        set_shortfall(self, next > AEO_REAL_EPSILON / AEO_REAL(4) ? next : AEO_REAL(0));
    }
    return AEO_OK;
}

aeo_status_t aeo_els_update(aeo_els_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    const uint32_t starts = count_starts(self);
    return attend(self, z, y, starts, aeo_rls_update(&self->rls, z, y));
}

/* Update and attend are called one by one: this chain of calls is the deepest, and a frame less matters. */
aeo_status_t aeo_els_step(aeo_els_t *self, aeo_regressor_t *regressor, const aeo_real_t *u, const aeo_real_t *y,
                          uint64_t time_us)
{
    if (self == NULL || regressor == NULL || regressor->model_set != (uint8_t)AEO_VARMAX ||
        regressor->length != self->config.regressors || regressor->outputs != self->config.outputs ||
        regressor->past != self->config.past ||
        regressor->past * (unsigned)regressor->block_length + self->config.present != self->config.regressors) {
        return AEO_E_ARG;
    }
    aeo_status_t status = aeo_regressor_push(regressor, u, y, time_us);
    if (status != AEO_OK) {
        return status;
    }
    const uint32_t starts = count_starts(self);
    const aeo_real_t *z = aeo_regressor_z(regressor), *now = aeo_regressor_y(regressor);
    status = attend(self, z, now, starts, aeo_rls_update(&self->rls, z, now));
    if (status != AEO_OK) {
        return status;
    }
    self->missed = 0u; /* for what is due is always taken: it is at most 1e6, and regressor fits */
    return aeo_regressor_set_innovation(regressor, self->feedback);
}

const aeo_real_t *aeo_els_feedback(const aeo_els_t *self)
{
    return self->feedback;
}

const aeo_real_t *aeo_els_theta(const aeo_els_t *self)
{
    return self->rls.theta;
}

aeo_status_t aeo_els_read(const aeo_els_t *self, aeo_real_t *theta, size_t length)
{
    return aeo_rls_read(self != NULL ? &self->rls : NULL, theta, length);
}

const aeo_real_t *aeo_els_innovation(const aeo_els_t *self)
{
    return self->rls.innovation;
}

const aeo_real_t *aeo_els_residual(const aeo_els_t *self)
{
    return self->rls.residual;
}

uint32_t aeo_els_health(const aeo_els_t *self)
{
    return self != NULL ? self->health | self->rls.health : 0u;
}

void aeo_els_clear_health(aeo_els_t *self)
{
    if (self != NULL) {
        self->health = 0u;
        self->rls.health = 0u;
    }
}

/* feedback in range and levels that can be such; all are finite */
static int memory_holds(const aeo_real_t *feedback, size_t l)
{
    return aeo_linalg_all_within(feedback, l, AEO_SCALED_MAX) && aeo_guard_holds(feedback + l, l);
}

int aeo_els_invariants_hold(const aeo_els_t *self)
{
    if (self == NULL || judge_config(&self->config) != AEO_OK || !aeo_rls_invariants_hold(&self->rls)) {
        return 0;
    }
    const size_t l = self->config.outputs;
    const aeo_real_t lambda = self->rls.config.forgetting, expected = self->config.forgetting - self->shortfall;
    return self->config.regressors == self->rls.config.regressors && l == self->rls.config.outputs &&
           self->feedback == self->rls.factor + AEO_RLS_WORDS(self->config.regressors, l) &&
           self->levels == self->feedback + l && aeo_linalg_all_finite(self->feedback, AEO_ELS_OWN(l)) &&
           memory_holds(self->feedback, l) && aeo_is_between(lambda, expected, expected) &&
           self->backoff <= BACKOFF_MAX && self->wait == self->config.varx_samples << self->backoff;
}

/* The saved array: version, bytes of a real, p, d, lambda_end, lambda_start, rate, guard ratio, VARX samples (at most
 * 1e6, exact in a float); three counters, health, since, backoff, missed; lambda_end - lambda; feedback and levels
 * (saved.h); then the saved array of rls.h, which has a seal of its own. */
enum { BACKOFF = 5, MISSED, NUMBERS, SETTINGS = 5 };

static void describe(const aeo_els_t *self, aeo_real_t settings[SETTINGS], aeo_saved_form_t *form)
{
    settings[0] = self->config.forgetting;
    settings[1] = self->config.forgetting_start;
    settings[2] = self->config.forgetting_rate;
    settings[3] = self->config.guard_ratio;
    settings[4] = (aeo_real_t)self->config.varx_samples;
    form->version = AEO_ELS_SAVED_VERSION;
    form->size_count = 2;
    form->setting_count = SETTINGS;
    form->number_count = NUMBERS;
    form->sizes = &self->config.past;
    form->settings = settings;
    form->words = AEO_ELS_SAVED_WORDS(self->config.regressors, self->config.outputs);
}

aeo_status_t aeo_els_save(const aeo_els_t *self, aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    aeo_real_t settings[SETTINGS];
    describe(self, settings, &form);
    const aeo_status_t status = aeo_saved_begin(&form, &self->count, saved, length);
    if (status != AEO_OK) {
        return status;
    }
    const size_t own = AEO_ELS_OWN(self->config.outputs), outer = AEO_ELS_SAVED_HEAD + own;
    saved[AEO_ELS_SAVED_HEAD - 1u] = self->shortfall;
    memcpy(saved + AEO_ELS_SAVED_HEAD, self->feedback, own * sizeof *saved); /* the levels lie behind it */
    (void)aeo_rls_save(&self->rls, saved + outer, length - outer);           /* the length is judged: it cannot fail */
    aeo_saved_seal(saved, form.words);
    return AEO_OK;
}

/* Restore the inner filter, which wants the lambda it was saved with; on failure everything is as it was. */
static aeo_status_t restore_inner(aeo_els_t *self, const aeo_real_t *saved, aeo_real_t shortfall)
{
    const aeo_real_t before = self->shortfall;
    set_shortfall(self, shortfall);
    const aeo_status_t status =
        aeo_rls_restore(&self->rls, saved, AEO_RLS_SAVED_WORDS(self->config.regressors, self->config.outputs));
    if (status != AEO_OK) {
        set_shortfall(self, before);
    }
    return status;
}

aeo_status_t aeo_els_restore(aeo_els_t *self, const aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    aeo_real_t settings[SETTINGS];
    uint32_t numbers[NUMBERS];
    describe(self, settings, &form);
    aeo_status_t status = aeo_saved_judge(&form, saved, length, numbers);
    if (status != AEO_OK) {
        return status;
    }
    const aeo_real_t *const body = saved + AEO_ELS_SAVED_HEAD; /* behind the shortfall */
    if (numbers[BACKOFF] > BACKOFF_MAX || numbers[MISSED] > 1u || !memory_holds(body, self->config.outputs) ||
        !aeo_is_between(body[-1], AEO_REAL(0), self->config.forgetting - self->config.forgetting_start)) {
        return AEO_E_DAMAGED;
    }
    const size_t own = AEO_ELS_OWN(self->config.outputs);
    status = restore_inner(self, body + own, body[-1]);
    if (status != AEO_OK) {
        return status;
    }
    memcpy((unsigned char *)self + offsetof(aeo_els_t, count), numbers, form.number_count * sizeof *numbers);
    self->wait = self->config.varx_samples << self->backoff;
    memcpy(self->feedback, body, own * sizeof *body);
    return AEO_OK;
}
/* SPDX-License-Identifier: MIT */
