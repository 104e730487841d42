/* fast_theta.c: how the gain of an array moves theta, with and without disturbances in the window. */
#include "fast_theta.h"

#include "linalg.h"

#include <string.h>

/* As for the gain of an array (fast_array.c), so that theta moves by at most 1e24 an update. */
#define GAIN_MAX AEO_REAL(1e12)
#define NEWS_MAX AEO_REAL(1e20)

/* When the mask holds the first channels, or none, w is z itself. */
static int is_plain(uint32_t mask)
{
    return (mask & (mask + 1u)) == 0u;
}

/* In w, channels of the mask come first in each block, so that the tail of z is where the block of the present sample
 * begins. */
const aeo_real_t *aeo_fast_theta_order(const aeo_fast_rls_t *self, const aeo_real_t *from, int back)
{
    const size_t m = self->config.block, past = (size_t)self->config.past * m;
    aeo_real_t *const to = self->update;
    if (is_plain(self->config.feedthrough)) {
        return from;
    }
    memcpy(to, from, self->length * sizeof *to); /* the tail has its order already */
    for (size_t block = 0; block < past; block += m) {
        size_t marked = block, other = block + self->tail;
        for (size_t c = 0; c < m; c++) {
            const size_t at = c < 32u && (self->config.feedthrough >> c & 1u) != 0u ? marked++ : other++;
            to[back ? block + c : at] = from[back ? at : block + c];
        }
    }
    return to;
}

/* Normalise kappa, which lies in self->step and brings the news given: step = kappa / (1 + news). Returns 0 when it is
 * beyond its bound. */
static int normalise(aeo_fast_rls_t *self, aeo_real_t news)
{
    const size_t n = self->length;
    if (!aeo_linalg_all_within(&news, 1, NEWS_MAX)) {
        return 0;
    }
    const aeo_real_t inverse = AEO_REAL(1) / (AEO_REAL(1) + (news > AEO_REAL(0) ? news : AEO_REAL(0)));
    for (size_t i = 0; i < n; i++) {
        self->step[i] *= inverse;
    }
    return aeo_linalg_all_within(self->step, n, GAIN_MAX);
}

/* theta += innovation g', g in self->step, and residual = innovation (1 - g'z); returns that factor. */
static aeo_real_t follow(aeo_fast_rls_t *self, const aeo_real_t *z)
{
    const size_t n = self->length, l = self->config.outputs;
    const aeo_real_t *const gain = aeo_fast_theta_order(self, self->step, 1);
    const aeo_real_t left = AEO_REAL(1) - aeo_linalg_dot(gain, z, n);
    aeo_linalg_move_rows(self->theta, self->innovation, gain, n, l);
    aeo_linalg_scale(left, self->innovation, self->residual, l);
    return left;
}

/* Return -x, or the nearest number that is no larger than limit. */
static aeo_real_t oppose(aeo_real_t x, aeo_real_t limit)
{
    const aeo_real_t most = limit < AEO_REAL(0) ? -limit : limit;
    return x > most ? -most : x < -most ? most : -x;
}

/* Absorb the disturbances as a measurement of their own, whose outputs are 0: along them alone, theta is drawn to 0, for an
 * error no larger than the innovation, so that what has no noise is met to rounding. */
static void settle(aeo_fast_rls_t *self, const aeo_real_t *share, const aeo_real_t *z, aeo_real_t left)
{
    const size_t n = self->length, l = self->config.outputs;
    const aeo_real_t *const added = self->added + self->config.block;
    memcpy(self->step, share, n * sizeof *self->step);
    if (!normalise(self, aeo_linalg_dot(share, added, n))) {
        return;
    }
    const aeo_real_t *const ordered = aeo_fast_theta_order(self, added, 1);
    for (size_t i = 0; i < l; i++) { /* the residual holds what theta is moved by for each unit of the gain */
        self->residual[i] = oppose(aeo_linalg_dot(self->theta + i * n, ordered, n), self->innovation[i]);
    }
    const aeo_real_t *const gain = aeo_fast_theta_order(self, self->step, 1);
    aeo_linalg_move_rows(self->theta, self->residual, gain, n, l);
    const aeo_real_t seen = aeo_linalg_dot(gain, z, n);
    for (size_t i = 0; i < l; i++) {
        self->residual[i] = left * self->innovation[i] - seen * self->residual[i];
    }
}

int aeo_fast_theta_learn(aeo_fast_rls_t *self, const aeo_real_t *z)
{
    const size_t n = self->length;
    const aeo_fast_rls_array_t *const array = &self->array[self->active];
    if (self->disturbed == 0u) { /* self->step is g */
        (void)follow(self, z);
        return 1;
    }
    for (size_t i = 0; i < n; i++) {
        self->step[i] = array->gain[i] - array->share[i];
    }
    if (!normalise(self, aeo_linalg_dot(aeo_fast_theta_order(self, self->step, 1), z, n))) {
        return 0;
    }
    settle(self, array->share, z, follow(self, z));
    return 1;
}
/* SPDX-License-Identifier: MIT */
