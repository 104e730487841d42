/* lattice_stage.c: the kernels of one stage, for blocks of a few entries. */
#include "lattice_state.h"
#include "linalg.h"

/* Four rows a turn, their errors in registers: a third of the instructions of two passes over memory. */
static void correct_four(aeo_real_t *AEO_RESTRICT weight, const aeo_real_t *AEO_RESTRICT v, aeo_real_t *AEO_RESTRICT x,
                         size_t count, size_t m, const aeo_real_t *AEO_RESTRICT gain, aeo_real_t step)
{
    aeo_real_t x0 = x[0], x1 = x[1], x2 = x[2], x3 = x[3];
    const aeo_real_t *column = weight;
    for (size_t c = 0; c < m; c++) {
        const aeo_real_t factor = v[c];
        x0 -= column[0] * factor;
        x1 -= column[1] * factor;
        x2 -= column[2] * factor;
        x3 -= column[3] * factor;
        column += count;
    }
    x[0] = x0;
    x[1] = x1;
    x[2] = x2;
    x[3] = x3;
    x0 *= step;
    x1 *= step;
    x2 *= step;
    x3 *= step;
    for (size_t c = 0; gain != NULL && c < m; c++) {
        const aeo_real_t factor = gain[c];
        weight[0] += x0 * factor;
        weight[1] += x1 * factor;
        weight[2] += x2 * factor;
        weight[3] += x3 * factor;
        weight += count;
    }
}

/* One row. Its sum grows in memory, term after term as above: a compiler that may reorder sums must not find another
 * answer for the same row in another place. */
static void correct_one(aeo_real_t *weight, const aeo_real_t *v, aeo_real_t *x, size_t count, size_t m,
                        const aeo_real_t *gain, aeo_real_t step)
{
    const aeo_real_t *entry = weight;
    for (size_t c = 0; c < m; c++) {
        *x -= *entry * v[c];
        entry += count;
    }
    const aeo_real_t left = *x * step;
    for (size_t c = 0; gain != NULL && c < m; c++) {
        *weight += left * gain[c];
        weight += count;
    }
}

void aeo_lattice_correct(aeo_real_t *weight, const aeo_real_t *v, aeo_real_t *x, size_t count, size_t m,
                         const aeo_real_t *gain, aeo_real_t step)
{
    size_t i = 0;
    for (; i + 4 <= count; i += 4) {
        correct_four(weight + i, v, x + i, count, m, gain, step);
    }
    for (; i < count; i++) {
        correct_one(weight + i, v, x + i, count, m, gain, step);
    }
}

/* Bierman's update, with P = L D L': from the last column to the first, with v_j = (L'r)_j, b the sum of D v L over the
 * columns behind,
 *     alpha_new = alpha + D v^2,   D_new = D alpha / alpha_new scale,   L_new = L - b v / alpha,   b_new = b + D v L.
 * alpha is above 0 and grows, so neither divisor is 0; alpha / alpha_new cannot round above 1 (nor could alpha times a
 * rounded 1 / alpha_new, which is rounded once more), so without forgetting D never creeps up, and it stays above 0. */
aeo_real_t aeo_lattice_turn(aeo_real_t *factor, const aeo_real_t *r, aeo_real_t *gain, size_t m, aeo_real_t alpha,
                            aeo_real_t scale)
{
    AEO_ASSERT(alpha > AEO_REAL(0));
    const int moving = scale > AEO_REAL(0);
    aeo_real_t *column = factor + AEO_LATTICE_TRIANGLE(m);
    gain += m;
    r += m;
    for (size_t below = 0; below < m; below++) {
        const aeo_real_t alpha_before = alpha;
        aeo_real_t *const l = column - below, v = *--r;
        for (size_t i = 0; i < below; i++) {
            v += l[i] * r[i + 1];
        }
        column = l - 1;
        const aeo_real_t w = *column * v;
        alpha += v * w;
        if (moving) {
            const aeo_real_t k = v / alpha_before;
            *column *= alpha_before / alpha * scale;
            for (size_t i = 0; i < below; i++) {
                const aeo_real_t last = l[i], b = gain[i];
                l[i] = last - k * b;
                gain[i] = b + w * last;
            }
        }
        *--gain = w;
    }
    return alpha;
}

aeo_real_t aeo_lattice_variance(const aeo_lattice_variance_t *at)
{
    const aeo_real_t *diagonal = at->factor; /* of column 0 */
    aeo_real_t sum = AEO_REAL(0);
    for (size_t below = at->i; below > 0; below--) {
        sum += diagonal[below] * diagonal[below] * *diagonal;
        diagonal += at->m - at->i + below;
    }
    return sum + *diagonal;
}
/* SPDX-License-Identifier: MIT */
