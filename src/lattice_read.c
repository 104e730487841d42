/* lattice_read.c: theta from the stages of a lattice. */
#include "aeolid/lattice.h"

#include "aeolid/regressor.h"
#include "lattice_state.h"
#include "linalg.h"
#include "rows.h"

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
        aeo_rows_correct(self->target_weight + j * m * (l + d), b, left, l + d, m, NULL, AEO_REAL(0));
        aeo_rows_correct(self->present_weight, left + l, left, l, d, NULL, AEO_REAL(0));
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
            aeo_linalg_move_rows(older, &before, error, m, 1);
            memcpy(b, older, m * sizeof *b);
        }
        aeo_real_t *const old = self->spare;
        memcpy(old, b, m * sizeof *b);
        aeo_rows_correct(backward, a, b, m, m, NULL, AEO_REAL(0));
        aeo_rows_correct(forward, old, a, m, m, NULL, AEO_REAL(0));
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
/* SPDX-License-Identifier: MIT */
