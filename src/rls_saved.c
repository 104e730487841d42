/* rls_saved.c: how the filter of rls.h is written into a flat array and read back, and what it can be. */
#include "aeolid/rls.h"

#include "linalg.h"
#include "rls_state.h"
#include "saved.h"
#include "strips.h"

#include <string.h>

/* A factor that the proofs of rls_state.h admit: finite, its diagonal above 0, no variance beyond four times the bound, which is
 * below 1024 AEO_RLS_FACTOR_MAX^2. */
static int factor_holds(const aeo_real_t *factor, size_t n, aeo_real_t variance_max)
{
    int holds =
        aeo_linalg_all_within(factor, AEO_RLS_FACTOR_WORDS(n), AEO_RLS_FACTOR_MAX) && aeo_strips_hold(factor, n);
    for (size_t i = 0; i < n && holds; i++) {
        holds = aeo_strips_norm2(factor, n, i) <= AEO_REAL(4) * variance_max;
    }
    return holds;
}

int aeo_rls_invariants_hold(const aeo_rls_t *self)
{
    if (self == NULL || aeo_rls_judge_config(&self->config) != AEO_OK) {
        return 0;
    }
    const size_t n = self->config.regressors, l = self->config.outputs;
    return self->theta == self->factor + AEO_RLS_FACTOR_WORDS(n) && self->watched == self->theta + n * l + 2 * l &&
           self->work == self->watched + AEO_WATCH_WORDS(l) && self->scan_row < n &&
           aeo_linalg_all_finite(self->theta, n * l + 2 * l + AEO_WATCH_WORDS(l)) && /* scratch is anything */
           aeo_watch_holds(&self->watch, self->watched, l) && factor_holds(self->factor, n, self->variance_max);
}

/* The saved array: version, bytes of a real, n, l, four settings; health, six counters, scan row, the watch's five
 * numbers; factor, theta, innovation, residual and the watch's words as they lie in memory (saved.h). */
enum { SCAN_ROW = 7, WATCH, NUMBERS = WATCH + 5 };

static size_t count_kept(const aeo_rls_t *self)
{
    return AEO_RLS_KEPT_WORDS(self->config.regressors, self->config.outputs);
}

static void describe(const aeo_rls_t *self, aeo_saved_form_t *form)
{
    form->version = AEO_RLS_SAVED_VERSION;
    form->size_count = 2;
    form->setting_count = 4;
    form->number_count = NUMBERS;
    form->sizes = &self->config.regressors;
    form->settings = &self->config.forgetting;
    form->words = AEO_RLS_SAVED_WORDS(self->config.regressors, self->config.outputs);
}

aeo_status_t aeo_rls_save(const aeo_rls_t *self, aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    describe(self, &form);
    const aeo_status_t status = aeo_saved_begin(&form, &self->health, saved, length);
    if (status == AEO_OK) {
        memcpy(saved + AEO_RLS_SAVED_HEAD, self->factor, count_kept(self) * sizeof *saved);
        aeo_saved_seal(saved, form.words);
    }
    return status;
}

/* What follows the head, all finite: such as a filter can have, or the proofs would not hold from here on. */
static int body_holds(const aeo_rls_t *self, const uint32_t *numbers, const aeo_real_t *body)
{
    aeo_watch_t watch;
    memcpy(&watch, numbers + WATCH, sizeof watch);
    const size_t n = self->config.regressors, l = self->config.outputs;
    const aeo_real_t *const theta = body + AEO_RLS_FACTOR_WORDS(n);
    return numbers[SCAN_ROW] < n && factor_holds(body, n, self->variance_max) &&
           aeo_linalg_all_within(theta, n * l, AEO_RLS_THETA_MAX) &&
           aeo_linalg_all_within(theta + n * l, 2 * l, AEO_RLS_INNOVATION_MAX) &&
           aeo_watch_holds(&watch, theta + n * l + 2 * l, l);
}

aeo_status_t aeo_rls_restore(aeo_rls_t *self, const aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    uint32_t numbers[NUMBERS];
    describe(self, &form);
    const aeo_status_t status = aeo_saved_judge(&form, saved, length, numbers);
    if (status != AEO_OK) {
        return status;
    }
    const aeo_real_t *const body = saved + AEO_RLS_SAVED_HEAD;
    if (!body_holds(self, numbers, body)) {
        return AEO_E_DAMAGED;
    }
    memcpy((unsigned char *)self + offsetof(aeo_rls_t, health), numbers, form.number_count * sizeof *numbers);
    memcpy(self->factor, body, count_kept(self) * sizeof *body);
    return AEO_OK;
}
/* SPDX-License-Identifier: MIT */
