/* fast_array.c: the recursion of fast_rls.h without the outputs. */
#include "fast_array.h"

#include "linalg.h"
#include "root.h"
#include "rows.h"
#include "triangle.h"

#include <string.h>

/* Bounds from which nothing overflows in float. Entries of the window are below 1.1e6 (samples 1e6, a disturbance of at
 * most rho^(1/2) <= 1e4). An array goes on only while its errors stay below ERROR_MAX, S'e below
 * PROJECTION_MAX, S below FACTOR_MAX, 1 / gamma below NEWS_MAX and |g| below GAIN_MAX; fast_rls.c starts it afresh
 * otherwise. Then
 *   the squares of S'e add up to less than 96 (1e18)^2 < 1e38;
 *   A, B move by at most ERROR_MAX GAIN_MAX = 1e24 a sample, and a row times the window is below n 1e24 1.1e6 < 1.2e33
 *   before it is judged;  kappa = g / gamma < 1e32;  E grows by at most (3 ERROR_MAX)^2 < 1e25 a sample.
 * What still exceeds the largest number on the way is infinite or NaN, and fails the judgement on its bits. */
#define ERROR_MAX AEO_LINALG_ERROR_MAX
#define GAIN_MAX  AEO_REAL(1e12)
#define NEWS_MAX  AEO_REAL(1e20)
/* Of a saved A or B: as an entry moves by at most 1e24 a sample, none that moves can leave this within 1e6 samples, and
 * one that rests cannot overflow by it. */
#define WEIGHT_MAX AEO_REAL(1e30)
/* Of S. The bound keeps its variances within a few times 1e10 where a memory is longer than the window; with a memory of
 * two samples they double with each one, faster than disturbances fill a window of six channels. */
#define FACTOR_MAX     AEO_REAL(1e6)
#define PROJECTION_MAX AEO_REAL(1e18)
/* Of a saved E, a sum of at most 1e8 samples. */
#define ENERGY_MAX AEO_REAL(1e33)

/* Of what disturbances contribute to kappa, P times a disturbance: at most 1e14 with the bounds on both. */
#define SHARE_MAX AEO_REAL(1e20)

/* 1 + w'kappa is at least 1; rounding in an array that is well lies far below this. */
#define NEWS_LEAST AEO_REAL(-0.1)

/* Square disagreement of the backward errors relative to their mean size, as a mean over some MEAN samples. The
 * relative error of theta is about a third of its root (turbine data, both precisions). Arrays that are well show
 * 1e-9 ... 1e-5 in float and 1e-27 ... 1e-20 in double on turbine data with measurement noise, up to 1e-2 and 1e-17
 * where channels are collinear. When errors grow they need some five memories from LATE, where a follower begins, to
 * LOST, where the gain is no longer fit for use, nor is it after one sample that disagrees by more than the mean
 * size (in float the mean over 64 would tell from 3.2 times that on, so this only comes sooner). */
#if AEO_REAL_BYTES == 8
#define LATE AEO_REAL(1e-10)
#define LOST AEO_REAL(1e-4)
#else
#define LATE AEO_REAL(1e-4)
#define LOST AEO_REAL(0.05)
#endif
#define MEAN AEO_REAL(64)

enum { INVERSE_GAMMA, DISAGREEMENT, ERROR_SIZE };

void aeo_fast_array_start(const aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    const size_t m = self->config.block, d = self->tail;
    const aeo_real_t lambda = self->config.forgetting;
    memset(array->forward, 0, (size_t)(array->scalar + 3 - array->forward) * sizeof *array->forward);
    aeo_real_t oldest = self->regularisation; /* 1 / (lambda P) of the oldest block: rho / lambda^p */
    for (size_t i = 0; i < self->config.past; i++) {
        oldest /= lambda; /* lambda^p >= 1/1000: p (1 - lambda) <= 3 and lambda >= 1/2 make it 1/64 at least */
    }
    aeo_real_t *diagonal = array->factor;
    for (size_t c = 0; c < m; c++) {
        array->energy[c * m + c] = oldest;
        /* rho >= 1e-8; entries of the present sample weigh 1 / lambda more */
        *diagonal = AEO_REAL(1) / AEO_SQRT(self->regularisation * (c + d < m ? AEO_REAL(1) : lambda));
        diagonal += m - c;
    }
    array->scalar[INVERSE_GAMMA] = AEO_REAL(1);
    array->age = 0;
}

aeo_real_t aeo_fast_array_variance(const aeo_fast_rls_t *self, const aeo_fast_rls_array_t *array, size_t c)
{
    return aeo_triangle_norm2(array->factor, self->config.block, c);
}

int aeo_fast_array_is_late(const aeo_fast_rls_array_t *array)
{
    return array->scalar[DISAGREEMENT] > LATE * array->scalar[ERROR_SIZE];
}

#if AEO_REAL_BYTES == 4
/* rows += a x', m rows of n values; what rounding cuts off is kept `apart` numbers from each entry, to be added the next
 * time (Kahan 1965). */
#define FETCH(type, p) v[p] = AEO_FROM(type, x + i + (p)*AEO_SIZE(type));
#define MOVE(type, p)                                                                                                  \
    {                                                                                                                  \
        aeo_real_t *const entry = row + (p)*AEO_SIZE(type), *const rest = entry + apart;                               \
        const aeo_##type##_t before = AEO_AT(type, entry), move = v[p] * a[r] + AEO_AT(type, rest);                    \
        const aeo_##type##_t after = before + move;                                                                    \
        AEO_AT(type, entry) = after;                                                                                   \
        AEO_AT(type, rest) = move - (after - before);                                                                  \
    }
#define MOVE_ROWS(type, ABREAST, EACH)                                                                                 \
    for (; i + (ABREAST)*AEO_SIZE(type) <= n; i += (ABREAST)*AEO_SIZE(type)) {                                         \
        aeo_##type##_t v[ABREAST];                                                                                     \
        aeo_real_t *row = rows + i;                                                                                    \
        EACH(FETCH, type)                                                                                              \
        for (size_t r = 0; r < m; r++) {                                                                               \
            EACH(MOVE, type)                                                                                           \
            row += n;                                                                                                  \
        }                                                                                                              \
    }
static void move_with_rests(aeo_real_t *rows, const aeo_real_t *AEO_RESTRICT a, const aeo_real_t *AEO_RESTRICT x,
                            size_t n, size_t m, ptrdiff_t apart)
{
    size_t i = 0;
    MOVE_ROWS(lanes, AEO_ABREAST, AEO_EACH_OF)
    MOVE_ROWS(few, 1, AEO_ALONE)
#if AEO_FEW > 1
    MOVE_ROWS(one, 1, AEO_ALONE)
#endif
}
#undef FETCH
#undef MOVE
#undef MOVE_ROWS
#endif

/* rows += a g', g in self->step, for the rows of A or B. In float these sums need more digits than they have: over a
 * memory of VARMAX data, whose newest e the window foretells but for what theta moves, rounding adds up to an error of 6e-3
 * in theta. So its rests are kept, where the same rows of the other array would be, until that one is needed: 4e-4 is
 * left. -ffast-math takes the rests out again. */
static void move_rows(const aeo_fast_rls_t *self, const aeo_fast_rls_array_t *array, const aeo_real_t *a,
                      aeo_real_t *rows)
{
    const size_t n = self->length, m = self->config.block;
#if AEO_REAL_BYTES == 4
    const aeo_fast_rls_array_t *const other = &self->array[array == self->array];
    if (other->age == 0u) {
        move_with_rests(rows, a, self->step, n, m, other->forward - array->forward);
        return;
    }
#else
    (void)array;
#endif
    aeo_linalg_move_rows(rows, a, self->step, n, m);
}

/* The first half of step_forward for the disturbances alone, with A and F as they are before it: kappa is linear in the
 * window, so their share of it obeys the same recursion. */
static int share_forward(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    const size_t n = self->length, m = self->config.block;
    aeo_real_t *const e = self->error;
    if (self->disturbed == 0u) {
        return 1;
    }
    if (!aeo_linalg_find_error(array->forward, self->added, n, self->added + n, e, m)) {
        return 0;
    }
    aeo_triangle_project(array->factor, e, e + m, m);
    if (!aeo_linalg_all_within(e + m, m, PROJECTION_MAX)) {
        return 0;
    }
    aeo_triangle_expand(array->factor, e + m, e, m);
    aeo_linalg_scale(AEO_REAL(1) / self->config.forgetting, e, array->share + n, m); /* lambda >= 1/2 */
    aeo_rows_correct(array->forward, array->share + n, array->share, n, m, NULL, AEO_REAL(0));
    return 1;
}

/* From kappa_{k-1} to [t; s], and A and F to sample k. */
static int step_forward(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    const size_t n = self->length, m = self->config.block;
    const aeo_real_t lambda = self->config.forgetting, gamma = AEO_REAL(1) / array->scalar[INVERSE_GAMMA]; /* >= 1 */
    const aeo_real_t *const e = self->error;
    aeo_real_t *const f = self->error + m;
    if (!aeo_linalg_find_error(array->forward, self->window, n, self->window + n, self->error, m)) {
        return 0;
    }
    aeo_triangle_project(array->factor, e, f + m, m);
    if (!aeo_linalg_all_within(f + m, m, PROJECTION_MAX)) {
        return 0;
    }
    aeo_triangle_rotate(array->factor, f + m, f, m, lambda * array->scalar[INVERSE_GAMMA],
                        self->inverse_root_forgetting);
    if (!aeo_linalg_all_within(array->factor, m * (m + 1) / 2, FACTOR_MAX)) {
        return 0;
    }
    aeo_linalg_scale(gamma, array->gain, self->step, n);
    aeo_linalg_scale(AEO_REAL(1) / lambda, f, array->gain + n, m); /* lambda >= 1/2 */
    aeo_rows_correct(array->forward, array->gain + n, array->gain, n, m, NULL, AEO_REAL(0));
    move_rows(self, array, e, array->forward);
    return 1;
}

/* kappa = s + B't, moved down by m places, for kappa itself or a share of it; self->step is a copy. */
static void close_gain(aeo_fast_rls_t *self, const aeo_fast_rls_array_t *array, aeo_real_t *gain)
{
    const size_t n = self->length, m = self->config.block;
    /* scratch: on the stack it would lengthen the deepest chain of calls */
    aeo_real_t *const sum = self->error + 2 * m;
    aeo_linalg_scale(AEO_REAL(-1), gain, sum, m);
    aeo_rows_correct(array->backward, sum, gain + m, n, m, NULL, AEO_REAL(0));
    memcpy(self->step, gain + m, n * sizeof *self->step); /* old and new overlap */
    memcpy(gain, self->step, n * sizeof *gain);
}

static int share_backward(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    if (self->disturbed == 0u) {
        return 1;
    }
    close_gain(self, array, array->share);
    return aeo_linalg_all_within(array->share, self->length, SHARE_MAX);
}

/* The error r of the backward predictor and by how much it differs from the one that t foretells, with r corrected. An
 * entry of x that left before the array began is a zero, which B, still zero too, foretells. */
static int find_backward_error(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    const size_t n = self->length, m = self->config.block;
    aeo_real_t *const r = self->error, *const difference = self->error + m;
    if (!aeo_linalg_find_error(array->backward, self->window + m, n, self->window, r, m)) {
        return 0;
    }
    for (size_t c = 0; c < m; c++) {
        if (array->age <= self->config.past + 1u && c + (size_t)array->age * m < n + m) {
            r[c] = AEO_REAL(0);
            difference[c] = AEO_REAL(0);
            continue;
        }
        difference[c] = r[c] - self->config.forgetting * aeo_linalg_dot(array->energy + c * m, array->gain, m);
        r[c] += self->feedback * difference[c];
    }
    return aeo_linalg_all_within(r, m, ERROR_MAX);
}

/* From [t; s] to kappa_k = s + B't, 1 / gamma_k, and g_k in self->step. */
static int find_gain(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    const size_t n = self->length, m = self->config.block;
    aeo_real_t *const sum = self->error + 2 * m; /* scratch, as above */
    close_gain(self, array, array->gain);
    *sum = aeo_linalg_dot(array->gain, self->window + m, n);
    if (!aeo_linalg_all_within(sum, 1, NEWS_MAX) || *sum < NEWS_LEAST) {
        return 0;
    }
    array->scalar[INVERSE_GAMMA] = AEO_REAL(1) + (*sum > AEO_REAL(0) ? *sum : AEO_REAL(0));
    const aeo_real_t gamma = AEO_REAL(1) / array->scalar[INVERSE_GAMMA]; /* the divisor is at least 1 */
    aeo_linalg_scale(gamma, array->gain, self->step, n);
    *sum = aeo_linalg_dot(self->step, self->step, n);
    return aeo_linalg_all_within(sum, 1, GAIN_MAX * GAIN_MAX);
}

/* B and E to sample k, and the mean disagreement; returns 0 when that is as large as the errors. */
static int step_backward(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    const size_t m = self->config.block;
    const aeo_real_t lambda = self->config.forgetting, gamma = AEO_REAL(1) / array->scalar[INVERSE_GAMMA]; /* >= 1 */
    const aeo_real_t *const r = self->error, *const difference = self->error + m;
    move_rows(self, array, r, array->backward);
    aeo_real_t apart = AEO_REAL(0), size = AEO_REAL(0);
    for (size_t c = 0; c < m; c++) {
        aeo_real_t *const energy = array->energy + c * m;
        for (size_t j = 0; j < m; j++) {
            energy[j] = lambda * energy[j] + gamma * r[c] * r[j];
        }
        if (energy[c] > AEO_REAL(1e-30)) { /* sizes in units of E_cc, which holds gamma r^2: at most 1 each */
            apart += gamma * (difference[c] / energy[c]) * difference[c];
            size += gamma * (r[c] / energy[c]) * r[c];
        }
    }
    aeo_real_t *const scalar = array->scalar;
    scalar[DISAGREEMENT] += (apart - scalar[DISAGREEMENT]) * (AEO_REAL(1) / MEAN);
    scalar[ERROR_SIZE] += (size - scalar[ERROR_SIZE]) * (AEO_REAL(1) / MEAN);
    return aeo_linalg_all_within(scalar + DISAGREEMENT, 2, NEWS_MAX) && apart <= scalar[ERROR_SIZE] &&
           scalar[DISAGREEMENT] <= LOST * scalar[ERROR_SIZE];
}

int aeo_fast_array_step(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array)
{
    aeo_count_up(&array->age);
    return share_forward(self, array) && step_forward(self, array) && share_backward(self, array) &&
           find_backward_error(self, array) && find_gain(self, array) && step_backward(self, array);
}

/* The gain kappa, too, for A moves by gamma kappa before anything of the new sample is judged. */
int aeo_fast_array_is_sound(const aeo_fast_rls_t *self, const aeo_real_t *words)
{
    const size_t n = self->length, m = self->config.block;
    const aeo_real_t *const kappa = words + 2 * m * n, *const share = kappa + n + m, *factor = share + n + m;
    const aeo_real_t *const scalar = factor + m * (m + 1) / 2 + m * m;
    if (!(scalar[INVERSE_GAMMA] >= AEO_REAL(1) && scalar[INVERSE_GAMMA] <= AEO_REAL(2) * NEWS_MAX)) {
        return 0;
    }
    for (size_t c = 0; c < m; c++) {
        if (!(*factor > AEO_REAL(0))) {
            return 0;
        }
        factor += m - c;
    }
    return aeo_linalg_all_within(words, 2 * m * n, WEIGHT_MAX) &&
           aeo_linalg_all_within(kappa, n, AEO_REAL(2) * GAIN_MAX * scalar[INVERSE_GAMMA]) &&
           aeo_linalg_all_within(share, n, SHARE_MAX) &&
           aeo_linalg_all_within(share + n + m, m * (m + 1) / 2, FACTOR_MAX) &&
           aeo_linalg_all_within(scalar - m * m, m * m, ENERGY_MAX) && scalar[DISAGREEMENT] >= AEO_REAL(0) &&
           scalar[ERROR_SIZE] >= AEO_REAL(0) && aeo_linalg_all_within(scalar + DISAGREEMENT, 2, AEO_REAL(2) * NEWS_MAX);
}
/* SPDX-License-Identifier: MIT */
