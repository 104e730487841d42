/* estimator_rls.c: rls.h as a method of estimator.h. */
#include "aeolid/estimator.h"

static size_t words(const aeo_estimator_config_t *config)
{
    return AEO_RLS_WORDS(aeo_estimator_regressors(config), config->outputs);
}

static size_t saved_words(const aeo_estimator_config_t *config)
{
    return AEO_RLS_SAVED_WORDS(aeo_estimator_regressors(config), config->outputs);
}

static aeo_status_t init(aeo_estimator_t *self, const aeo_estimator_config_t *config, aeo_real_t *memory, size_t length)
{
    aeo_rls_config_t settings;
    settings.regressors = (uint16_t)aeo_estimator_regressors(config); /* at most 1024: the regressor has judged it */
    settings.outputs = config->outputs;
    settings.forgetting = config->forgetting;
    settings.regularisation = config->regularisation;
    settings.excitation_min = config->excitation_min;
    settings.growth_max = config->growth_max;
    return aeo_rls_init(&self->of.rls, &settings, memory, length);
}

static aeo_status_t update(aeo_estimator_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    return aeo_rls_update(&self->of.rls, z, y);
}

static const aeo_real_t *theta(aeo_estimator_t *self)
{
    return aeo_rls_theta(&self->of.rls);
}

static const aeo_real_t *innovation(const aeo_estimator_t *self)
{
    return aeo_rls_innovation(&self->of.rls);
}

static const aeo_real_t *residual(const aeo_estimator_t *self)
{
    return aeo_rls_residual(&self->of.rls);
}

static uint32_t health(const aeo_estimator_t *self)
{
    return aeo_rls_health(&self->of.rls);
}

static void clear_health(aeo_estimator_t *self)
{
    aeo_rls_clear_health(&self->of.rls);
}

static uint32_t count(const aeo_estimator_t *self, aeo_counter_t which)
{
    switch (which) {
    case AEO_COUNT_UPDATES:
        return self->of.rls.count.updates;
    case AEO_COUNT_REJECTED:
        return self->of.rls.count.rejected;
    case AEO_COUNT_WITHHELD:
        return self->of.rls.count.withheld;
    case AEO_COUNT_BOUNDED:
        return self->of.rls.count.bounded;
    case AEO_COUNT_REINITIALISED:
        return self->of.rls.count.reinitialised;
    case AEO_COUNT_RELEASED:
        return self->of.rls.count.released;
    case AEO_COUNT_SAMPLES:
    case AEO_COUNT_NOT_FINITE:
    case AEO_COUNT_RANGE:
    case AEO_COUNT_TIME:
    case AEO_COUNT_GAPS:
    case AEO_COUNT_FELL_BACK:
    case AEO_COUNT_LIMITED:
    case AEO_COUNT_RESTARTED:
    case AEO_COUNTERS:
    default:
        return 0; /* the regressor's, or another filter's */
    }
}

static void reset(aeo_estimator_t *self)
{
    aeo_rls_reset(&self->of.rls);
}

static aeo_status_t save(const aeo_estimator_t *self, aeo_real_t *saved, size_t length)
{
    return aeo_rls_save(&self->of.rls, saved, length);
}

static aeo_status_t restore(aeo_estimator_t *self, const aeo_real_t *saved, size_t length)
{
    return aeo_rls_restore(&self->of.rls, saved, length);
}

static int invariants_hold(const aeo_estimator_t *self)
{
    return aeo_rls_invariants_hold(&self->of.rls);
}

void aeo_estimator_rls(aeo_estimator_calls_t *calls)
{
    calls->method = AEO_METHOD_RLS;
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
