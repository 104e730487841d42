/* estimator_fast_rls.c: fast_rls.h as a method of estimator.h. */
#include "aeolid/estimator.h"

#include "settings.h"

static size_t count_block(const aeo_estimator_config_t *config)
{
    return AEO_REGRESSOR_BLOCK(config->inputs, config->outputs, config->model_set == AEO_VARMAX ? 1u : 0u);
}

static size_t words(const aeo_estimator_config_t *config)
{
    const size_t p = config->past, m = count_block(config), l = config->outputs;
    return AEO_FAST_RLS_WORDS(p, m, aeo_settings_count_bits(config->feedthrough), l);
}

static size_t saved_words(const aeo_estimator_config_t *config)
{
    const size_t p = config->past, m = count_block(config), l = config->outputs;
    return AEO_FAST_RLS_SAVED_WORDS(p, m, aeo_settings_count_bits(config->feedthrough), l);
}

static aeo_status_t init(aeo_estimator_t *self, const aeo_estimator_config_t *config, aeo_real_t *memory, size_t length)
{
    aeo_fast_rls_config_t settings;
    settings.past = config->past;
    settings.block = (uint16_t)count_block(config); /* at most 96 */
    settings.outputs = config->outputs;
    settings.feedthrough = config->feedthrough;
    settings.forgetting = config->forgetting;
    settings.regularisation = config->regularisation;
    settings.growth_max = config->growth_max;
    return aeo_fast_rls_init(&self->of.fast_rls, &settings, memory, length);
}

static aeo_status_t update(aeo_estimator_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    return aeo_fast_rls_update(&self->of.fast_rls, z, y);
}

static const aeo_real_t *theta(aeo_estimator_t *self)
{
    return aeo_fast_rls_theta(&self->of.fast_rls);
}

static const aeo_real_t *innovation(const aeo_estimator_t *self)
{
    return aeo_fast_rls_innovation(&self->of.fast_rls);
}

static const aeo_real_t *residual(const aeo_estimator_t *self)
{
    return aeo_fast_rls_residual(&self->of.fast_rls);
}

static uint32_t health(const aeo_estimator_t *self)
{
    return aeo_fast_rls_health(&self->of.fast_rls);
}

static void clear_health(aeo_estimator_t *self)
{
    aeo_fast_rls_clear_health(&self->of.fast_rls);
}

static uint32_t count(const aeo_estimator_t *self, aeo_counter_t which)
{
    switch (which) {
    case AEO_COUNT_UPDATES:
        return self->of.fast_rls.count.updates;
    case AEO_COUNT_REJECTED:
        return self->of.fast_rls.count.rejected;
    case AEO_COUNT_BOUNDED:
        return self->of.fast_rls.count.bounded;
    case AEO_COUNT_REINITIALISED:
        return self->of.fast_rls.count.reinitialised;
    case AEO_COUNT_RELEASED:
        return self->of.fast_rls.count.released;
    case AEO_COUNT_RESTARTED:
        return self->of.fast_rls.count.restarted;
    case AEO_COUNT_SAMPLES:
    case AEO_COUNT_NOT_FINITE:
    case AEO_COUNT_RANGE:
    case AEO_COUNT_TIME:
    case AEO_COUNT_GAPS:
    case AEO_COUNT_WITHHELD:
    case AEO_COUNT_FELL_BACK:
    case AEO_COUNT_LIMITED:
    case AEO_COUNTERS:
    default:
        return 0; /* the regressor's, or another filter's */
    }
}

static void reset(aeo_estimator_t *self)
{
    aeo_fast_rls_reset(&self->of.fast_rls);
}

static aeo_status_t save(const aeo_estimator_t *self, aeo_real_t *saved, size_t length)
{
    return aeo_fast_rls_save(&self->of.fast_rls, saved, length);
}

static aeo_status_t restore(aeo_estimator_t *self, const aeo_real_t *saved, size_t length)
{
    return aeo_fast_rls_restore(&self->of.fast_rls, saved, length);
}

static int invariants_hold(const aeo_estimator_t *self)
{
    return aeo_fast_rls_invariants_hold(&self->of.fast_rls);
}

void aeo_estimator_fast_rls(aeo_estimator_calls_t *calls)
{
    calls->method = AEO_METHOD_FAST_RLS;
    calls->words = words;
    calls->saved_words = saved_words;
    calls->init = init;
    calls->update = update;
    calls->theta = theta;
    calls->innovation = innovation;
    calls->residual = residual;
    calls->feedback = residual;
    calls->health = health;
    calls->clear_health = clear_health;
    calls->count = count;
    calls->reset = reset;
    calls->save = save;
    calls->restore = restore;
    calls->invariants_hold = invariants_hold;
}
/* SPDX-License-Identifier: MIT */
