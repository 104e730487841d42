/* estimator_lattice.c: lattice.h as a method of estimator.h. */
#include "aeolid/estimator.h"

#include "settings.h"

#include <string.h>

static size_t count_block(const aeo_estimator_config_t *config)
{
    return AEO_REGRESSOR_BLOCK(config->inputs, config->outputs, config->model_set == AEO_VARMAX ? 1u : 0u);
}

static size_t count_own(const aeo_estimator_config_t *config)
{
    const size_t p = config->past, m = count_block(config), l = config->outputs;
    return AEO_LATTICE_WORDS(p, m, aeo_settings_count_bits(config->feedthrough), l);
}

static size_t words(const aeo_estimator_config_t *config)
{
    const size_t n = aeo_estimator_regressors(config), l = config->outputs;
    return count_own(config) + n * l; /* theta is worked out when asked for */
}

static size_t saved_words(const aeo_estimator_config_t *config)
{
    const size_t p = config->past, m = count_block(config), l = config->outputs;
    return AEO_LATTICE_SAVED_WORDS(p, m, aeo_settings_count_bits(config->feedthrough), l);
}

static aeo_status_t init(aeo_estimator_t *self, const aeo_estimator_config_t *config, aeo_real_t *memory, size_t length)
{
    aeo_lattice_config_t settings;
    settings.past = config->past;
    settings.block = (uint16_t)count_block(config); /* at most 96 */
    settings.present = (uint16_t)aeo_settings_count_bits(config->feedthrough);
    settings.outputs = config->outputs;
    settings.forgetting = config->forgetting;
    settings.regularisation = config->regularisation;
    settings.excitation_min = config->excitation_min;
    settings.growth_max = config->growth_max;
    const aeo_status_t status = aeo_lattice_init(&self->of.lattice, &settings, memory, length);
    if (status == AEO_OK) {
        const size_t count = aeo_estimator_regressors(config) * config->outputs;
        self->reading = memory + count_own(config);
        memset(self->reading, 0, count * sizeof *self->reading);
    }
    return status;
}

static aeo_status_t update(aeo_estimator_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    return aeo_lattice_update(&self->of.lattice, z, y);
}

static const aeo_real_t *theta(aeo_estimator_t *self)
{
    const size_t length = aeo_estimator_regressors(&self->config) * self->config.outputs;
    return aeo_lattice_read(&self->of.lattice, self->reading, length) == AEO_OK ? self->reading : NULL;
}

static const aeo_real_t *innovation(const aeo_estimator_t *self)
{
    return aeo_lattice_innovation(&self->of.lattice);
}

static const aeo_real_t *residual(const aeo_estimator_t *self)
{
    return aeo_lattice_residual(&self->of.lattice);
}

static uint32_t health(const aeo_estimator_t *self)
{
    return aeo_lattice_health(&self->of.lattice);
}

static void clear_health(aeo_estimator_t *self)
{
    aeo_lattice_clear_health(&self->of.lattice);
}

static uint32_t count(const aeo_estimator_t *self, aeo_counter_t which)
{
    switch (which) {
    case AEO_COUNT_UPDATES:
        return self->of.lattice.count.updates;
    case AEO_COUNT_REJECTED:
        return self->of.lattice.count.rejected;
    case AEO_COUNT_WITHHELD:
        return self->of.lattice.count.withheld;
    case AEO_COUNT_BOUNDED:
        return self->of.lattice.count.bounded;
    case AEO_COUNT_REINITIALISED:
        return self->of.lattice.count.reinitialised;
    case AEO_COUNT_RELEASED:
        return self->of.lattice.count.released;
    case AEO_COUNT_RESTARTED:
        return self->of.lattice.count.restarted;
    case AEO_COUNT_SAMPLES:
    case AEO_COUNT_NOT_FINITE:
    case AEO_COUNT_RANGE:
    case AEO_COUNT_TIME:
    case AEO_COUNT_GAPS:
    case AEO_COUNT_FELL_BACK:
    case AEO_COUNT_LIMITED:
    case AEO_COUNTERS:
    default:
        return 0; /* the regressor's, or another filter's */
    }
}

static void reset(aeo_estimator_t *self)
{
    aeo_lattice_reset(&self->of.lattice);
}

static aeo_status_t save(const aeo_estimator_t *self, aeo_real_t *saved, size_t length)
{
    return aeo_lattice_save(&self->of.lattice, saved, length);
}

static aeo_status_t restore(aeo_estimator_t *self, const aeo_real_t *saved, size_t length)
{
    return aeo_lattice_restore(&self->of.lattice, saved, length);
}

static int invariants_hold(const aeo_estimator_t *self)
{
    return aeo_lattice_invariants_hold(&self->of.lattice);
}

void aeo_estimator_lattice(aeo_estimator_calls_t *calls)
{
    calls->method = AEO_METHOD_LATTICE;
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
