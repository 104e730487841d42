/* lattice_stage.c: the covariance of one stage, for blocks of a few entries. */
#include "lanes.h"
#include "lattice_state.h"

/* Bierman's update, with P = L D L': from the last column to the first, with v_j = (L'r)_j, b the sum of D v L over the
 * columns behind,
 *     alpha_new = alpha + D v^2,   D_new = D alpha / alpha_new scale,   L_new = L - b v / alpha,   b_new = b + D v L.
 * alpha is above 0 and grows, so neither divisor is 0; alpha / alpha_new cannot round above 1 (nor could alpha times a
 * rounded 1 / alpha_new, which is rounded once more), so without forgetting D never creeps up, and it stays above 0. */
typedef struct {
    aeo_real_t k, w; /* v / alpha and D v */
} turn_t;

/* The turn of a column whose diagonal is at d, which moves unless scale is 0; alpha is moved on to alpha_new. */
static turn_t find_turn(aeo_real_t *d, aeo_real_t v, aeo_real_t *alpha, aeo_real_t scale)
{
    const aeo_real_t before = *alpha;
    turn_t turn = {AEO_REAL(0), *d * v};
    *alpha += v * turn.w;
    if (scale > AEO_REAL(0)) {
        turn.k = v / before;
        *d *= before / *alpha * scale;
    }
    return turn;
}

/* Column l, then column t on its left, over the same rows of count, with the b of each: that is fetched once for both. */
#define ROWS(type)                                                                                                     \
    for (; i + AEO_SIZE(type) <= count; i += AEO_SIZE(type)) {                                                         \
        const aeo_##type##_t last = AEO_FROM(type, l + i), other = AEO_FROM(type, t + i);                              \
        aeo_##type##_t sum = AEO_FROM(type, b + i);                                                                    \
        AEO_AT(type, l + i) = last - k * sum;                                                                          \
        sum += w * last;                                                                                               \
        AEO_AT(type, t + i) = other - e * sum;                                                                         \
        AEO_AT(type, b + i) = sum + u * other;                                                                         \
    }
static void move_two(aeo_real_t *AEO_RESTRICT l, aeo_real_t *AEO_RESTRICT t, aeo_real_t *AEO_RESTRICT b, size_t count,
                     turn_t first, turn_t second)
{
    const aeo_real_t k = first.k, w = first.w, e = second.k, u = second.w;
    size_t i = 0;
    ROWS(few)
#if AEO_FEW > 1
    ROWS(one)
#endif
}
#undef ROWS

aeo_real_t aeo_lattice_turn(aeo_real_t *factor, const aeo_real_t *r, aeo_real_t *gain, size_t m, aeo_real_t alpha,
                            aeo_real_t scale)
{
    AEO_ASSERT(alpha > AEO_REAL(0));
    aeo_real_t *column = factor + AEO_LATTICE_TRIANGLE(m); /* one past the last one looked at */
    size_t j = m;
    if (m % 2u != 0u) { /* the last column is alone */
        column--;
        j--;
        gain[j] = find_turn(column, r[j], &alpha, scale).w;
    }
    while (j > 0u) { /* columns j - 1 and j - 2 */
        const size_t below = m - j;
        aeo_real_t *const l = column - below, *const t = l - 1 - below; /* in rows from j on */
        aeo_real_t v = r[j - 1u], v_left = r[j - 2u] + t[-1] * v;
        for (size_t i = 0; i < below; i++) {
            v += l[i] * r[j + i];
            v_left += t[i] * r[j + i];
        }
        column = t - 2;
        const turn_t first = find_turn(l - 1, v, &alpha, scale), second = find_turn(column, v_left, &alpha, scale);
        gain[j - 1u] = first.w;
        gain[j - 2u] = second.w;
        if (scale > AEO_REAL(0)) {
            gain[j - 1u] += second.w * t[-1];
            t[-1] -= second.k * first.w;
            move_two(l, t, gain + j, below, first, second);
        }
        j -= 2u;
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
