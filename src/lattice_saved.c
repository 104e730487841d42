/* lattice_saved.c: how a lattice is written into a flat array and read back, and what it can be. */
#include "aeolid/lattice.h"

#include "aeolid/regressor.h"
#include "lattice_state.h"
#include "linalg.h"
#include "saved.h"

#include <string.h>

/* Largest numbers of a state, from the proof in lattice.c: alpha, an entry of P r, the same over alpha (its gain, with
 * variances of four times the bound), a weight. */
#define ALPHA_MAX  AEO_REAL(3e35)
#define P_R_MAX    AEO_REAL(1e23)
#define GAIN_MAX   AEO_REAL(3e5)
#define WEIGHT_MAX AEO_REAL(1.1e26)

/* What the last sample left for the forward predictors of the next: alpha, step = 1 / alpha or 0, gain = P r. */
static int stages_hold(const aeo_lattice_t *self, const aeo_real_t *state)
{
    const size_t m = self->config.block;
    const aeo_real_t *const alpha = state + (self->alpha - self->factor), *const step = alpha + self->config.past;
    const aeo_real_t *gain = state + (self->gain - self->factor);
    for (size_t j = 0; j < self->config.past; j++) {
        if (!(alpha[j] >= AEO_REAL(0.5) && alpha[j] <= ALPHA_MAX && step[j] >= AEO_REAL(0) && step[j] <= AEO_REAL(2))) {
            return 0;
        }
        for (size_t c = 0; c < m; c++, gain++) {
            const aeo_real_t g = *gain * step[j]; /* below 6e38 only where the first check fails: bits are judged */
            if (!aeo_linalg_all_within(gain, 1, P_R_MAX) || !aeo_linalg_all_within(&g, 1, GAIN_MAX)) {
                return 0;
            }
        }
    }
    return 1;
}

static int state_holds(const aeo_lattice_t *self, const aeo_real_t *state)
{
    const size_t p = self->config.past, m = self->config.block, l = self->config.outputs;
    for (size_t index = 0; index < aeo_lattice_count_variances(&self->config); index++) {
        const aeo_lattice_variance_t at = aeo_lattice_find_variance(self, state, index);
        const aeo_real_t diagonal = at.factor[at.i * at.m - at.i * (at.i - 1u) / 2u];
        if (!(diagonal > AEO_REAL(0)) || aeo_lattice_variance(&at) > AEO_REAL(4) * self->variance_max) {
            return 0;
        }
    }
    /* present, target, forward and backward weights lie side by side */
    return stages_hold(self, state) &&
           aeo_linalg_all_within(state + (self->present_weight - self->factor),
                                 (size_t)(self->window - self->present_weight), WEIGHT_MAX) &&
           aeo_linalg_all_within(state + (self->window - self->factor), p * m, AEO_SCALED_MAX) &&
           aeo_linalg_all_within(state + (self->error - self->factor), p * m, AEO_LATTICE_ERROR_MAX) &&
           aeo_linalg_all_within(state + (self->innovation - self->factor), 2 * l, AEO_LATTICE_ERROR_MAX);
}

/* The numbers that are saved, all of one type, from health to watch. */
enum { ORDERS = 8, LEARNING, HEAD, SCAN, BEGUN, QUIET, WATCH, NUMBERS = WATCH + 5 };

/* state lies as self's does */
static int numbers_hold(const aeo_lattice_t *self, const uint32_t numbers[NUMBERS], const aeo_real_t *state)
{
    aeo_watch_t watch;
    memcpy(&watch, numbers + WATCH, sizeof watch);
    return numbers[ORDERS] <= self->config.past && numbers[HEAD] < self->config.past &&
           numbers[SCAN] < aeo_lattice_count_variances(&self->config) && numbers[LEARNING] <= UINT16_MAX &&
           numbers[BEGUN] <= 1u && numbers[QUIET] <= 1u &&
           aeo_watch_holds(&watch, state + (self->watched - self->factor), self->config.outputs);
}

int aeo_lattice_invariants_hold(const aeo_lattice_t *self)
{
    if (self == NULL || aeo_lattice_judge_config(&self->config) != AEO_OK) {
        return 0;
    }
    uint32_t numbers[NUMBERS];
    memcpy(numbers, (const unsigned char *)self + offsetof(aeo_lattice_t, health), sizeof numbers);
    const size_t behind = (size_t)(self->reading - self->factor), m = self->config.block;
    return behind + self->config.past * (2u * m * m + m) == aeo_lattice_count_words(&self->config) &&
           self->read_order < self->config.past && numbers_hold(self, numbers, self->factor) &&
           aeo_linalg_all_finite(self->factor, aeo_lattice_count_state(self)) && state_holds(self, self->factor);
}

/* The saved array: version, bytes of a real, p, m, d, l, four settings; numbers; the state (saved.h). */
static void describe(const aeo_lattice_t *self, aeo_saved_form_t *form)
{
    form->version = AEO_LATTICE_SAVED_VERSION;
    form->size_count = 4;
    form->setting_count = 4;
    form->number_count = NUMBERS;
    form->sizes = &self->config.past;
    form->settings = &self->config.forgetting;
    form->words = AEO_LATTICE_SAVED_HEAD + aeo_lattice_count_state(self) + AEO_SAVED_SEAL;
}

aeo_status_t aeo_lattice_save(const aeo_lattice_t *self, aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    describe(self, &form);
    const aeo_status_t status = aeo_saved_begin(&form, &self->health, saved, length);
    if (status == AEO_OK) {
        memcpy(saved + AEO_LATTICE_SAVED_HEAD, self->factor, aeo_lattice_count_state(self) * sizeof *saved);
        aeo_saved_seal(saved, form.words);
    }
    return status;
}

aeo_status_t aeo_lattice_restore(aeo_lattice_t *self, const aeo_real_t *saved, size_t length)
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
    const aeo_real_t *const body = saved + AEO_LATTICE_SAVED_HEAD;
    if (!numbers_hold(self, numbers, body) || !state_holds(self, body)) {
        return AEO_E_DAMAGED;
    }
    self->read_order = 0;
    memcpy((unsigned char *)self + offsetof(aeo_lattice_t, health), numbers, sizeof numbers);
    memcpy(self->factor, body, aeo_lattice_count_state(self) * sizeof *body);
    return AEO_OK;
}
/* SPDX-License-Identifier: MIT */
