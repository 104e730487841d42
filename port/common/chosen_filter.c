/* chosen_filter.c: one row of calls a filter. */
#include "chosen_filter.h"

#include <string.h>

int chosen_filter_method(const char *name)
{
    static const char *const names[] = {"rls", "els", "fast-rls", "lattice"};
    for (int i = 0; i < 4; i++) {
        if (strcmp(name, names[i]) == 0) {
            return i;
        }
    }
    return -1;
}

static unsigned is_varmax(const chosen_config_t *config)
{
    return config->model_set == AEO_VARMAX ? 1u : 0u;
}

static uint16_t count_present(const chosen_config_t *config)
{
    uint16_t present = 0;
    for (uint32_t mask = config->feedthrough; mask != 0u; mask &= mask - 1u) {
        present++;
    }
    return present;
}

static uint16_t find_block(const chosen_config_t *config)
{
    return (uint16_t)AEO_REGRESSOR_BLOCK(config->inputs, config->outputs, is_varmax(config));
}

size_t chosen_filter_regressors(const chosen_config_t *config)
{
    return AEO_REGRESSOR_LENGTH(config->inputs, config->outputs, config->past, is_varmax(config),
                                count_present(config));
}

static size_t count_own_words(const chosen_config_t *config)
{
    const size_t n = chosen_filter_regressors(config), l = config->outputs;
    const size_t m = find_block(config), p = config->past, d = count_present(config);
    switch (config->method) {
    case CHOSEN_RLS:
        return AEO_RLS_WORDS(n, l);
    case CHOSEN_ELS:
        return AEO_ELS_WORDS(n, l);
    case CHOSEN_FAST_RLS:
        return AEO_FAST_RLS_WORDS(p, m, d, l);
    case CHOSEN_LATTICE:
        return AEO_LATTICE_WORDS(p, m, d, l);
    default:
        return 0;
    }
}

size_t chosen_filter_words(const chosen_config_t *config)
{
    const size_t own = count_own_words(config);
    return own == 0u ? 0u : own + chosen_filter_regressors(config) * config->outputs;
}

static aeo_status_t init_rls(chosen_filter_t *self, aeo_real_t *memory, size_t words)
{
    const chosen_config_t *c = &self->config;
    const aeo_rls_config_t config = {.regressors = self->regressors,
                                     .outputs = c->outputs,
                                     .forgetting = c->forgetting,
                                     .regularisation = c->regularisation,
                                     .excitation_min = c->excitation_min,
                                     .growth_max = c->growth_max};
    return aeo_rls_init(&self->of.rls, &config, memory, words);
}

static aeo_status_t init_els(chosen_filter_t *self, aeo_real_t *memory, size_t words)
{
    const chosen_config_t *c = &self->config;
    const aeo_els_config_t config = {.regressors = self->regressors,
                                     .outputs = c->outputs,
                                     .past = c->past,
                                     .present = count_present(c),
                                     .varx_samples = c->varx_samples,
                                     .forgetting = c->forgetting,
                                     .forgetting_start = c->forgetting_start,
                                     .forgetting_rate = c->forgetting_rate,
                                     .regularisation = c->regularisation,
                                     .excitation_min = c->excitation_min,
                                     .growth_max = c->growth_max,
                                     .guard_ratio = c->guard_ratio};
    return is_varmax(c) ? aeo_els_init(&self->of.els, &config, memory, words) : AEO_E_ARG;
}

static aeo_status_t init_fast_rls(chosen_filter_t *self, aeo_real_t *memory, size_t words)
{
    const chosen_config_t *c = &self->config;
    const aeo_fast_rls_config_t config = {.past = c->past,
                                          .block = find_block(c),
                                          .outputs = c->outputs,
                                          .feedthrough = c->feedthrough,
                                          .forgetting = c->forgetting,
                                          .regularisation = c->regularisation,
                                          .growth_max = c->growth_max};
    return aeo_fast_rls_init(&self->of.fast_rls, &config, memory, words);
}

static aeo_status_t init_lattice(chosen_filter_t *self, aeo_real_t *memory, size_t words)
{
    const chosen_config_t *c = &self->config;
    const aeo_lattice_config_t config = {.past = c->past,
                                         .block = find_block(c),
                                         .present = count_present(c),
                                         .outputs = c->outputs,
                                         .forgetting = c->forgetting,
                                         .regularisation = c->regularisation,
                                         .excitation_min = c->excitation_min,
                                         .growth_max = c->growth_max};
    return aeo_lattice_init(&self->of.lattice, &config, memory, words);
}

aeo_status_t chosen_filter_init(chosen_filter_t *self, const chosen_config_t *config, aeo_real_t *memory, size_t words)
{
    const size_t n = chosen_filter_regressors(config), own = count_own_words(config);
    if (n > UINT16_MAX || own == 0u || memory == NULL) {
        return AEO_E_ARG;
    }
    if (words < chosen_filter_words(config)) {
        return AEO_E_MEMORY;
    }
    self->config = *config;
    self->regressors = (uint16_t)n;
    self->theta = memory + own;
    memset(self->theta, 0, n * config->outputs * sizeof *self->theta);
    switch (config->method) {
    case CHOSEN_RLS:
        return init_rls(self, memory, own);
    case CHOSEN_ELS:
        return init_els(self, memory, own);
    case CHOSEN_LATTICE:
        return init_lattice(self, memory, own);
    case CHOSEN_FAST_RLS:
        return init_fast_rls(self, memory, own);
    default:
        return AEO_E_ARG;
    }
}

static aeo_status_t update(chosen_filter_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    switch (self->config.method) {
    case CHOSEN_RLS:
        return aeo_rls_update(&self->of.rls, z, y);
    case CHOSEN_ELS:
        return aeo_els_update(&self->of.els, z, y);
    case CHOSEN_LATTICE:
        return aeo_lattice_update(&self->of.lattice, z, y);
    case CHOSEN_FAST_RLS:
        return aeo_fast_rls_update(&self->of.fast_rls, z, y);
    default:
        return AEO_E_ARG;
    }
}

aeo_status_t chosen_filter_take(chosen_filter_t *self, aeo_regressor_t *regressor)
{
    const aeo_status_t status = update(self, aeo_regressor_z(regressor), aeo_regressor_y(regressor));
    if (status == AEO_OK && is_varmax(&self->config)) {
        const int els = self->config.method == CHOSEN_ELS;
        /* a residual that is out of the regressor's range is not taken: zeros stand in its place, as in a start */
        (void)aeo_regressor_set_innovation(regressor,
                                           els ? aeo_els_feedback(&self->of.els) : chosen_filter_residual(self));
    }
    return status;
}

const aeo_real_t *chosen_filter_theta(chosen_filter_t *self)
{
    const size_t length = (size_t)self->regressors * self->config.outputs;
    aeo_status_t status = AEO_E_ARG;
    switch (self->config.method) {
    case CHOSEN_RLS:
        status = aeo_rls_read(&self->of.rls, self->theta, length);
        break;
    case CHOSEN_ELS:
        status = aeo_els_read(&self->of.els, self->theta, length);
        break;
    case CHOSEN_LATTICE:
        status = aeo_lattice_read(&self->of.lattice, self->theta, length);
        break;
    case CHOSEN_FAST_RLS:
        status = aeo_fast_rls_read(&self->of.fast_rls, self->theta, length);
        break;
    default:
        break;
    }
    return status == AEO_OK ? self->theta : NULL;
}

const aeo_real_t *chosen_filter_innovation(const chosen_filter_t *self)
{
    switch (self->config.method) {
    case CHOSEN_ELS:
        return aeo_els_innovation(&self->of.els);
    case CHOSEN_LATTICE:
        return aeo_lattice_innovation(&self->of.lattice);
    case CHOSEN_FAST_RLS:
        return aeo_fast_rls_innovation(&self->of.fast_rls);
    case CHOSEN_RLS:
    default:
        return aeo_rls_innovation(&self->of.rls);
    }
}

const aeo_real_t *chosen_filter_residual(const chosen_filter_t *self)
{
    switch (self->config.method) {
    case CHOSEN_ELS:
        return aeo_els_residual(&self->of.els);
    case CHOSEN_LATTICE:
        return aeo_lattice_residual(&self->of.lattice);
    case CHOSEN_FAST_RLS:
        return aeo_fast_rls_residual(&self->of.fast_rls);
    case CHOSEN_RLS:
    default:
        return aeo_rls_residual(&self->of.rls);
    }
}

uint32_t chosen_filter_health(const chosen_filter_t *self)
{
    switch (self->config.method) {
    case CHOSEN_ELS:
        return aeo_els_health(&self->of.els);
    case CHOSEN_LATTICE:
        return aeo_lattice_health(&self->of.lattice);
    case CHOSEN_FAST_RLS:
        return aeo_fast_rls_health(&self->of.fast_rls);
    case CHOSEN_RLS:
    default:
        return aeo_rls_health(&self->of.rls);
    }
}

static uint32_t count_of_rls(const aeo_rls_count_t *count, unsigned which)
{
    const uint32_t values[] = {count->updates, count->rejected,      count->withheld,
                               count->bounded, count->reinitialised, count->released};
    return which <= CHOSEN_RELEASED ? values[which] : 0u;
}

static uint32_t count_of_lattice(const aeo_lattice_count_t *count, unsigned which)
{
    const uint32_t values[] = {count->updates, count->rejected,      count->withheld,
                               count->bounded, count->reinitialised, count->released};
    return which <= CHOSEN_RELEASED ? values[which] : which == CHOSEN_RESTARTED ? count->restarted : 0u;
}

static uint32_t count_of_fast_rls(const aeo_fast_rls_count_t *count, unsigned which)
{
    const uint32_t values[] = {count->updates, count->rejected,      0u,
                               count->bounded, count->reinitialised, count->released};
    return which <= CHOSEN_RELEASED ? values[which] : which == CHOSEN_RESTARTED ? count->restarted : 0u;
}

uint32_t chosen_filter_count(const chosen_filter_t *self, unsigned which)
{
    switch (self->config.method) {
    case CHOSEN_ELS:
        if (which == CHOSEN_FELL_BACK) {
            return self->of.els.count.fell_back;
        }
        return which == CHOSEN_LIMITED ? self->of.els.count.limited : count_of_rls(&self->of.els.rls.count, which);
    case CHOSEN_LATTICE:
        return count_of_lattice(&self->of.lattice.count, which);
    case CHOSEN_FAST_RLS:
        return count_of_fast_rls(&self->of.fast_rls.count, which);
    case CHOSEN_RLS:
    default:
        return count_of_rls(&self->of.rls.count, which);
    }
}

uint16_t chosen_filter_wire_set(const chosen_config_t *config)
{
    static const uint16_t maker[2][4] = {{0, 0, 1, 2}, {3, 0, 1, 2}};
    return (uint16_t)(config->model_set | (uint16_t)(maker[is_varmax(config)][config->method] << 8));
}
/* SPDX-License-Identifier: MIT */
