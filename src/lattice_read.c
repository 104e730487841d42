/* lattice_read.c: theta from the stages of a lattice, and the filter's saved form. */
#include "aeolid/lattice.h"

#include "aeolid/regressor.h"
#include "lattice_state.h"
#include "linalg.h"
#include "saved.h"

#include <string.h>

/* What a read-out keeps: columns of the predictors A and B of one order, p m of m entries each, and the p m entries of
 * G. Column c multiplies entry c % m of x_{k - c / m}. */
static size_t count_columns(const aeo_lattice_t *self)
{
    return (size_t)self->config.past * self->config.block;
}

/* Order 0: A = B = I at x_k, and no gain yet; theta holds the present inputs' columns only. */
static void begin_reading(aeo_lattice_t *self, aeo_real_t *theta)
{
    const size_t m = self->config.block, columns = count_columns(self), d = self->config.present;
    memset(self->reading, 0, columns * (2 * m + 1) * sizeof *self->reading);
    for (size_t c = 0; c < m; c++) {
        self->reading[c * m + c] = AEO_REAL(1);
        self->reading[(columns + c) * m + c] = AEO_REAL(1);
    }
    const size_t l = self->config.outputs;
    for (size_t i = 0; i < l; i++) {
        memset(theta, 0, columns * sizeof *theta);
        theta += columns;
        for (size_t c = 0; c < d; c++) {
            *theta++ = self->present_weight[c * l + i];
        }
    }
}

/* theta += (kappa_j of y less present_weight times kappa_j of u) B_j. */
static void add_order(const aeo_lattice_t *self, size_t j, aeo_real_t *theta)
{
    const size_t m = self->config.block, l = self->config.outputs, d = self->config.present;
    const size_t columns = count_columns(self), older = columns - (j + 1) * m;
    const aeo_real_t *b = self->reading + columns * m;
    aeo_real_t *const left = self->targets;
    for (size_t c = 0; c < (j + 1) * m; c++) {
        memset(left, 0, (l + d) * sizeof *left);
        aeo_lattice_correct(self->target_weight + j * m * (l + d), b, left, l + d, m, NULL, AEO_REAL(0));
        aeo_lattice_correct(self->present_weight, left + l, left, l, d, NULL, AEO_REAL(0));
        /* z has the oldest block first: block i of B_j, newest first, is block j - i behind the older ones */
        aeo_real_t *const column = theta + older + (j - c / m) * m + c % m;
        for (size_t i = 0; i < l; i++) {
            column[i * (columns + d)] -= left[i];
        }
        b += m;
    }
}

/* From order j to j + 1, all at the present sample k. The backward predictor of the sample before, which the order
 * recursion asks for, is B_j(k-1) = B_j(k) + r_j G_j'. Columns from the last to the first, so that B moves in place;
 * before the first one, B is 0 there. */
static void raise_order(const aeo_lattice_t *self, size_t j)
{
    const size_t m = self->config.block, columns = count_columns(self);
    aeo_real_t *const backward = self->backward_weight + j * m * m, *const forward = self->forward_weight + j * m * m;
    const aeo_real_t *const error = aeo_lattice_find_error(self, j);
    aeo_real_t *a = self->reading + (j + 2) * m * m, *b = a + columns * m;
    aeo_real_t *g = self->reading + 2 * columns * m + (j + 1) * m;
    for (size_t c = (j + 2) * m; c-- > 0;) {
        a -= m;
        b -= m;
        if (c < m) {
            memset(b, 0, m * sizeof *b);
        } else {
            aeo_real_t *const older = b - m * m;
            const aeo_real_t before = *--g;
            *g += self->step[j] * aeo_linalg_dot(older, self->gain + j * m, m);
            aeo_linalg_axpy(before, error, older, m);
            memcpy(b, older, m * sizeof *b);
        }
        aeo_real_t *const old = self->spare;
        memcpy(old, b, m * sizeof *b);
        aeo_lattice_correct(backward, a, b, m, m, NULL, AEO_REAL(0));
        aeo_lattice_correct(forward, old, a, m, m, NULL, AEO_REAL(0));
    }
}

aeo_status_t aeo_lattice_read_next(aeo_lattice_t *self, aeo_real_t *theta, size_t length)
{
    if (self == NULL || theta == NULL) {
        return AEO_E_ARG;
    }
    const size_t p = self->config.past, count = (count_columns(self) + self->config.present) * self->config.outputs;
    if (length < count) {
        return AEO_E_MEMORY;
    }
    const size_t j = self->read_order;
    if (j == 0u) {
        begin_reading(self, theta);
    }
    add_order(self, j, theta);
    if (j + 1u < p) {
        raise_order(self, j);
        self->read_order++;
        return AEO_FILLING;
    }
    self->read_order = 0;
    return aeo_linalg_all_finite(theta, count) ? AEO_OK : AEO_E_RANGE;
}

aeo_status_t aeo_lattice_read(aeo_lattice_t *self, aeo_real_t *theta, size_t length)
{
    if (self != NULL) {
        self->read_order = 0;
    }
    aeo_status_t status;
    do {
        status = aeo_lattice_read_next(self, theta, length);
    } while (status == AEO_FILLING);
    return status;
}

const aeo_real_t *aeo_lattice_innovation(const aeo_lattice_t *self)
{
    return self->innovation;
}

const aeo_real_t *aeo_lattice_residual(const aeo_lattice_t *self)
{
    return self->residual;
}

uint32_t aeo_lattice_health(const aeo_lattice_t *self)
{
    return self != NULL ? self->health : 0u;
}

void aeo_lattice_clear_health(aeo_lattice_t *self)
{
    if (self != NULL) {
        self->health = 0u;
    }
}

/* What holds of a state, finite numbers at the places of self, wherever it lies: at state. */
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
