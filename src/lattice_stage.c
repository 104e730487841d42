/* lattice_stage.c: the covariance of one stage, for blocks of a few entries. */
#include "lattice_state.h"

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
