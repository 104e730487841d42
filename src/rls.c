/* rls.c: the square-root recursion of rls.h. */
#include "aeolid/rls.h"

#include "linalg.h"
#include "rls_state.h"
#include "settings.h"
#include "strips.h"

#include <string.h>

aeo_status_t aeo_rls_judge_config(const aeo_rls_config_t *config)
{
    const aeo_status_t status = aeo_settings_judge_common(config->forgetting, config->regularisation,
                                                          config->excitation_min, config->growth_max);
    if (status == AEO_OK && (config->regressors < 1u || config->regressors > AEO_RLS_REGRESSORS_MAX ||
                             config->outputs < 1u || config->outputs > AEO_RLS_OUTPUTS_MAX)) {
        return AEO_E_ARG;
    }
    return status;
}

static void derive_from_forgetting(aeo_rls_t *self)
{
    const aeo_real_t lambda = self->config.forgetting;
    self->inverse_root_forgetting = aeo_inverse_root(lambda);
    self->gate = self->config.excitation_min * (AEO_REAL(1) - lambda) * (aeo_real_t)self->config.regressors;
    self->scan_step = aeo_settings_find_scan_step(self->config.regressors, lambda);
}

aeo_status_t aeo_rls_init(aeo_rls_t *self, const aeo_rls_config_t *config, aeo_real_t *memory, size_t words)
{
    if (self == NULL || config == NULL || memory == NULL) {
        return AEO_E_ARG;
    }
    const aeo_status_t status = aeo_rls_judge_config(config);
    if (status != AEO_OK) {
        return status;
    }
    const size_t n = config->regressors, l = config->outputs;
    if (words < AEO_RLS_WORDS(n, l)) {
        return AEO_E_MEMORY;
    }
    self->config = *config; /* which may be self's own */
    self->health = 0;
    memset(&self->count, 0, sizeof self->count);
    self->factor = memory;
    self->theta = self->factor + AEO_RLS_FACTOR_WORDS(n);
    self->innovation = self->theta + n * l;
    self->residual = self->innovation + l;
    self->watched = self->residual + l;
    self->work = self->watched + AEO_WATCH_WORDS(l);
    self->variance_max = config->growth_max / config->regularisation; /* regularisation >= 1e-8 */
    derive_from_forgetting(self);
    aeo_rls_reset(self);
    return AEO_OK;
}

/* P = I / rho */
static void start_factor(aeo_rls_t *self)
{
    const aeo_real_t diagonal = AEO_REAL(1) / AEO_SQRT(self->config.regularisation); /* regularisation >= 1e-8 */
    aeo_strips_start(self->factor, self->config.regressors, diagonal);
    self->scan_row = 0;
    aeo_watch_forget(&self->watch, self->watched, AEO_REAL(0));
}

void aeo_rls_reset(aeo_rls_t *self)
{
    if (self == NULL) {
        return;
    }
    memset(self->theta, 0, (size_t)(self->work - self->theta) * sizeof *self->theta);
    aeo_watch_start(&self->watch, self->watched, self->config.outputs);
    start_factor(self);
}

aeo_status_t aeo_rls_start(aeo_rls_t *self, const aeo_real_t *theta)
{
    if (self == NULL || theta == NULL) {
        return AEO_E_ARG;
    }
    const size_t count = (size_t)self->config.regressors * self->config.outputs;
    const aeo_status_t status = aeo_linalg_judge(theta, count);
    if (status != AEO_OK) {
        return status;
    }
    if (theta != self->theta) {
        memcpy(self->theta, theta, count * sizeof *theta);
    }
    start_factor(self);
    return AEO_OK;
}

aeo_status_t aeo_rls_set_forgetting(aeo_rls_t *self, aeo_real_t lambda)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    static const aeo_real_t RANGE[1][2] = {{AEO_REAL(0.5), AEO_REAL(1)}};
    const aeo_status_t status = aeo_settings_judge(&lambda, RANGE, 1);
    if (status == AEO_OK) {
        self->config.forgetting = lambda;
        derive_from_forgetting(self);
    }
    return status;
}

/* innovation = y - theta z; returns 1 when all are below the bound from which the update is proven not to overflow. */
static int find_innovation(aeo_rls_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    return aeo_linalg_find_error(self->theta, z, self->config.regressors, y, self->innovation, self->config.outputs);
}

/* Absorb z with the weight lambda and news = z'Pz, theta included. The gain comes unnormalised: gain = alpha g. */
static void absorb(aeo_rls_t *self, aeo_real_t news, aeo_real_t lambda, aeo_real_t scale)
{
    const size_t n = self->config.regressors, l = self->config.outputs;
    const aeo_real_t *const gain = aeo_strips_rotate(self->factor, n, n, self->work, lambda, scale);
    const aeo_real_t inverse = AEO_REAL(1) / (lambda + news);       /* alpha >= lambda >= 1/2 */
    aeo_linalg_scale(inverse, self->innovation, self->residual, l); /* what theta moves by for each unit of the gain */
    aeo_linalg_move_rows(self->theta, self->residual, gain, n, l);
    aeo_linalg_scale(lambda * inverse, self->innovation, self->residual, l);
}

/* Check the next scan_step variances; quarter each that passed the bound by absorbing a measurement of that parameter
 * which agrees with its present value: theta does not move. With a = (3 / P_ii)^(1/2) row_i, |a|^2 = 3 and
 * P_ii becomes P_ii / (1 + 3). Only forgetting makes P grow, at most by 2 between two checks, so P_ii <= 2
 * variance_max. */
static void bound_variances(aeo_rls_t *self)
{
    const size_t n = self->config.regressors;
    for (unsigned s = 0; s < self->scan_step; s++) {
        const size_t i = self->scan_row;
        self->scan_row = i + 1u < n ? (uint32_t)i + 1u : 0u;
        const aeo_real_t variance = aeo_strips_norm2(self->factor, n, i);
        if (variance <= self->variance_max) {
            continue;
        }
        /* variance > variance_max > 0 */
        aeo_strips_take_row(self->factor, n, i, AEO_SQRT(AEO_REAL(3) / variance), self->work);
        (void)aeo_strips_rotate(self->factor, n, i + 1, self->work, AEO_REAL(1), AEO_REAL(1));
        aeo_count_up(&self->count.bounded);
        self->health |= AEO_RLS_BOUNDED;
    }
}

/* Let P start anew when it is too small for the data of late. */
static void watch(aeo_rls_t *self, const aeo_real_t *z, const aeo_real_t *y, int quiet)
{
    const aeo_real_t power = aeo_linalg_dot(z, z, self->config.regressors);
    const int withheld = quiet + (quiet && power >= self->gate * self->config.regularisation);
    if (aeo_watch_take(&self->watch, self->watched, self->config.outputs, y, power, self->config.forgetting,
                       withheld)) {
        start_factor(self);
        aeo_count_up(&self->count.released);
        self->health |= AEO_RLS_RELEASED;
    }
}

aeo_status_t aeo_rls_update(aeo_rls_t *self, const aeo_real_t *z, const aeo_real_t *y)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    const aeo_status_t status =
        aeo_linalg_judge_sample(z, self->config.regressors, y, self->config.outputs, &self->count.rejected);
    if (status != AEO_OK) {
        return status;
    }
    if (!find_innovation(self, z, y)) {
        aeo_rls_reset(self);
        aeo_count_up(&self->count.reinitialised);
        self->health |= AEO_RLS_REINITIALISED;
        (void)find_innovation(self, z, y); /* theta = 0: it is y, at most 1e6 */
    }
    const aeo_real_t news = aeo_strips_project(self->factor, z, self->config.regressors, self->work);
    const int quiet = news < self->gate;
    if (quiet) {
        aeo_count_up(&self->count.withheld);
        self->health |= AEO_RLS_WITHHELD;
    }
    absorb(self, news, quiet ? AEO_REAL(1) : self->config.forgetting,
           quiet ? AEO_REAL(1) : self->inverse_root_forgetting);
    if (self->config.forgetting < AEO_REAL(1)) {
        bound_variances(self);
        watch(self, z, y, quiet);
    }
    aeo_count_up(&self->count.updates);
    return AEO_OK;
}

const aeo_real_t *aeo_rls_theta(const aeo_rls_t *self)
{
    return self->theta;
}

aeo_status_t aeo_rls_read(const aeo_rls_t *self, aeo_real_t *theta, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    return aeo_linalg_copy_out(self->theta, (size_t)self->config.regressors * self->config.outputs, theta, length);
}

const aeo_real_t *aeo_rls_innovation(const aeo_rls_t *self)
{
    return self->innovation;
}

const aeo_real_t *aeo_rls_residual(const aeo_rls_t *self)
{
    return self->residual;
}

uint32_t aeo_rls_health(const aeo_rls_t *self)
{
    return self != NULL ? self->health : 0u;
}

void aeo_rls_clear_health(aeo_rls_t *self)
{
    if (self != NULL) {
        self->health = 0u;
    }
}
/* SPDX-License-Identifier: MIT */
