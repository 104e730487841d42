/* estimator.c: regressor and filter of estimator.h, whichever filter it is. */
#include "aeolid/estimator.h"

#include "saved.h"
#include "settings.h"

static unsigned is_varmax(const aeo_estimator_config_t *config)
{
    return config->model_set == AEO_VARMAX ? 1u : 0u;
}

static aeo_regressor_config_t describe_window(const aeo_estimator_config_t *config)
{
    aeo_regressor_config_t layout = {0};
    layout.inputs = config->inputs;
    layout.outputs = config->outputs;
    layout.past = config->past;
    layout.model_set = config->model_set;
    layout.feedthrough = config->feedthrough;
    layout.period_us = config->period_us;
    layout.channels = config->channels;
    return layout;
}

size_t aeo_estimator_regressors(const aeo_estimator_config_t *config)
{
    return config == NULL ? 0u
                          : AEO_REGRESSOR_LENGTH(config->inputs, config->outputs, config->past, is_varmax(config),
                                                 aeo_settings_count_bits(config->feedthrough));
}

static size_t count_window_words(const aeo_estimator_config_t *config)
{
    return AEO_REGRESSOR_WORDS(config->inputs, config->outputs, config->past, is_varmax(config));
}

size_t aeo_estimator_words(aeo_estimator_method_t method, const aeo_estimator_config_t *config)
{
    aeo_estimator_calls_t calls;
    if (method == NULL || config == NULL) {
        return 0;
    }
    method(&calls);
    return calls.words(config) + count_window_words(config);
}

/* Judge everything; nothing is written: without memory regressor and filter judge all else, and say that there is none. */
static aeo_status_t judge(aeo_estimator_t *self, aeo_estimator_method_t method, const aeo_estimator_config_t *config,
                          aeo_real_t *memory, size_t words)
{
    const aeo_regressor_config_t layout = describe_window(config);
    aeo_estimator_calls_t calls;
    aeo_status_t status = aeo_regressor_init(&self->regressor, &layout, memory, 0);
    if (status == AEO_E_MEMORY) {
        method(&calls);
        status = calls.init(self, config, memory, 0);
        if (status == AEO_E_MEMORY && words >= calls.words(config) + count_window_words(config)) {
            return AEO_OK;
        }
    }
    return status;
}

aeo_status_t aeo_estimator_init(aeo_estimator_t *self, aeo_estimator_method_t method,
                                const aeo_estimator_config_t *config, aeo_real_t *memory, size_t words)
{
    if (self == NULL || method == NULL || config == NULL || memory == NULL || config->channels == NULL) {
        return AEO_E_ARG;
    }
    const aeo_status_t status = judge(self, method, config, memory, words);
    if (status != AEO_OK) {
        return status;
    }
    self->config = *config; /* which may be self's own */
    method(&self->calls);
    const aeo_regressor_config_t layout = describe_window(&self->config);
    const size_t own = self->calls.words(&self->config);
    (void)self->calls.init(self, &self->config, memory, own);
    return aeo_regressor_init(&self->regressor, &layout, memory + own, count_window_words(&self->config));
}

aeo_status_t aeo_estimator_take(aeo_estimator_t *self, const aeo_real_t *u, const aeo_real_t *y, uint64_t time_us)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_status_t status = aeo_regressor_push(&self->regressor, u, y, time_us);
    if (status == AEO_OK) {
        status = self->calls.update(self, aeo_regressor_z(&self->regressor), aeo_regressor_y(&self->regressor));
        if (status == AEO_OK && is_varmax(&self->config) != 0u) {
            /* a residual that is out of the regressor's range is not taken: zeros stand in its place, as in a start */
            (void)aeo_regressor_set_innovation(&self->regressor, self->calls.feedback(self));
        }
    }
    return status;
}

const aeo_real_t *aeo_estimator_theta(aeo_estimator_t *self)
{
    return self == NULL ? NULL : self->calls.theta(self);
}

const aeo_real_t *aeo_estimator_innovation(const aeo_estimator_t *self)
{
    return self->calls.innovation(self);
}

const aeo_real_t *aeo_estimator_residual(const aeo_estimator_t *self)
{
    return self->calls.residual(self);
}

uint32_t aeo_estimator_health(const aeo_estimator_t *self)
{
    return self == NULL ? 0u : self->calls.health(self);
}

void aeo_estimator_clear_health(aeo_estimator_t *self)
{
    if (self != NULL) {
        self->calls.clear_health(self);
    }
}

uint32_t aeo_estimator_count(const aeo_estimator_t *self, aeo_counter_t which)
{
    if (self == NULL) {
        return 0;
    }
    switch (which) {
    case AEO_COUNT_SAMPLES:
        return self->regressor.count.samples;
    case AEO_COUNT_NOT_FINITE:
        return self->regressor.count.not_finite;
    case AEO_COUNT_RANGE:
        return self->regressor.count.range;
    case AEO_COUNT_TIME:
        return self->regressor.count.time;
    case AEO_COUNT_GAPS:
        return self->regressor.count.gaps;
    case AEO_COUNT_UPDATES:
    case AEO_COUNT_REJECTED:
    case AEO_COUNT_WITHHELD:
    case AEO_COUNT_BOUNDED:
    case AEO_COUNT_REINITIALISED:
    case AEO_COUNT_RELEASED:
    case AEO_COUNT_FELL_BACK:
    case AEO_COUNT_LIMITED:
    case AEO_COUNT_RESTARTED:
    case AEO_COUNTERS:
    default:
        return self->calls.count(self, which);
    }
}

void aeo_estimator_reset(aeo_estimator_t *self)
{
    if (self != NULL) {
        aeo_regressor_reset(&self->regressor);
        self->calls.reset(self);
    }
}

static size_t count_saved_window(const aeo_estimator_config_t *config)
{
    return AEO_REGRESSOR_SAVED_WORDS(config->inputs, config->outputs, config->past, is_varmax(config));
}

size_t aeo_estimator_saved_words(const aeo_estimator_t *self)
{
    return self == NULL ? 0u : count_saved_window(&self->config) + self->calls.saved_words(&self->config);
}

aeo_status_t aeo_estimator_save(const aeo_estimator_t *self, aeo_real_t *saved, size_t length)
{
    if (self == NULL || saved == NULL) {
        return AEO_E_ARG;
    }
    const size_t window = count_saved_window(&self->config);
    if (length < aeo_estimator_saved_words(self)) {
        return AEO_E_MEMORY;
    }
    const aeo_status_t status = aeo_regressor_save(&self->regressor, saved, window);
    return status != AEO_OK ? status : self->calls.save(self, saved + window, length - window);
}

aeo_status_t aeo_estimator_restore(aeo_estimator_t *self, const aeo_real_t *saved, size_t length)
{
    if (self == NULL || saved == NULL) {
        return AEO_E_ARG;
    }
    const size_t window = count_saved_window(&self->config);
    if (length < aeo_estimator_saved_words(self)) {
        return AEO_E_MEMORY;
    }
    aeo_status_t status = aeo_regressor_judge_saved(&self->regressor, saved, window);
    if (status == AEO_OK) {
        status = self->calls.restore(self, saved + window, length - window);
    }
    return status != AEO_OK ? status : aeo_regressor_restore(&self->regressor, saved, window); /* judged above */
}

int aeo_estimator_invariants_hold(const aeo_estimator_t *self)
{
    return self != NULL && aeo_regressor_invariants_hold(&self->regressor) && self->calls.invariants_hold(self);
}
/* SPDX-License-Identifier: MIT */
