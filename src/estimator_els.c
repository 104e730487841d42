/* estimator_els.c: els.h as a method of estimator.h. */
#include "aeolid/estimator.h"

#include "settings.h"

static size_t words(const aeo_estimator_config_t *config)
{
    return AEO_ELS_WORDS(aeo_estimator_regressors(config), config->outputs);
}

static size_t saved_words(const aeo_estimator_config_t *config)
{
    return AEO_ELS_SAVED_WORDS(aeo_estimator_regressors(config), config->outputs);
}

static aeo_status_t init(aeo_estimator_t *self, const aeo_estimator_config_t *config, aeo_real_t *memory, size_t length)
{
    aeo_els_config_t settings;
    settings.regressors = (uint16_t)aeo_estimator_regressors(config); /* at most 1024: the regressor has judged it */
    settings.outputs = config->outputs;
    settings.past = config->past;
    settings.present = (uint16_t)aeo_settings_count_bits(config->feedthrough);
    settings.varx_samples = config->varx_samples;
    settings.forgetting = config->forgetting;
    settings.forgetting_start = config->forgetting_start;
    settings.forgetting_rate = config->forgetting_rate;
    settings.regularisation = config->regularisation;
    settings.excitation_min = config->excitation_min;
    settings.growth_max = config->growth_max;
    settings.guard_ratio = config->guard_ratio;
    return config->model_set == AEO_VARMAX ? aeo_els_init(&self->of.els, &settings, memory, length) : AEO_E_ARG;
}

static aeo_status_t update(aeo_estimator_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    const aeo_status_t status = aeo_els_update(&self->of.els, z, y);
    if (status == AEO_OK) {
        self->of.els.missed = 0u; /* aeo_estimator_take feeds back what is due, which is always taken: at most 1e6 */
    }
    return status;
}

static const aeo_real_t *theta(aeo_estimator_t *self)
{
    return aeo_els_theta(&self->of.els);
}

static const aeo_real_t *innovation(const aeo_estimator_t *self)
{
    return aeo_els_innovation(&self->of.els);
}

static const aeo_real_t *residual(const aeo_estimator_t *self)
{
    return aeo_els_residual(&self->of.els);
}

static const aeo_real_t *feedback(const aeo_estimator_t *self)
{
    return aeo_els_feedback(&self->of.els);
}

static uint32_t health(const aeo_estimator_t *self)
{
    return aeo_els_health(&self->of.els);
}

static void clear_health(aeo_estimator_t *self)
{
    aeo_els_clear_health(&self->of.els);
}

static uint32_t count(const aeo_estimator_t *self, aeo_counter_t which)
{
    switch (which) {
    case AEO_COUNT_UPDATES:
        return self->of.els.rls.count.updates;
    case AEO_COUNT_REJECTED:
        return self->of.els.rls.count.rejected;
    case AEO_COUNT_WITHHELD:
        return self->of.els.rls.count.withheld;
    case AEO_COUNT_BOUNDED:
        return self->of.els.rls.count.bounded;
    case AEO_COUNT_REINITIALISED:
        return self->of.els.rls.count.reinitialised;
    case AEO_COUNT_RELEASED:
        return self->of.els.rls.count.released;
    case AEO_COUNT_FELL_BACK:
        return self->of.els.count.fell_back;
    case AEO_COUNT_LIMITED:
        return self->of.els.count.limited;
    case AEO_COUNT_SAMPLES:
    case AEO_COUNT_NOT_FINITE:
    case AEO_COUNT_RANGE:
    case AEO_COUNT_TIME:
    case AEO_COUNT_GAPS:
    case AEO_COUNT_RESTARTED:
    case AEO_COUNTERS:
    default:
        return 0; /* the regressor's, or another filter's */
    }
}

static void reset(aeo_estimator_t *self)
{
    aeo_els_reset(&self->of.els);
}

static aeo_status_t save(const aeo_estimator_t *self, aeo_real_t *saved, size_t length)
{
    return aeo_els_save(&self->of.els, saved, length);
}

static aeo_status_t restore(aeo_estimator_t *self, const aeo_real_t *saved, size_t length)
{
    return aeo_els_restore(&self->of.els, saved, length);
}

static int invariants_hold(const aeo_estimator_t *self)
{
    return aeo_els_invariants_hold(&self->of.els);
}

void aeo_estimator_els(aeo_estimator_calls_t *calls)
{
    calls->method = AEO_METHOD_ELS;
    calls->words = words;
    calls->saved_words = saved_words;
    calls->init = init;
    calls->update = update;
    calls->theta = theta;
    calls->innovation = innovation;
    calls->residual = residual;
    calls->feedback = feedback;
    calls->health = health;
    calls->clear_health = clear_health;
    calls->count = count;
    calls->reset = reset;
    calls->save = save;
    calls->restore = restore;
    calls->invariants_hold = invariants_hold;
}
/* SPDX-License-Identifier: MIT */
