/* linalg.c: the kernels of linalg.h. */
#include "linalg.h"

#include <string.h>

int aeo_linalg_all_finite(const aeo_real_t *x, size_t count)
{
#if AEO_REAL_BYTES == 8
    const uint64_t exponent = UINT64_C(0x7FF0000000000000);
    uint64_t bits;
#else
    const uint32_t exponent = UINT32_C(0x7F800000);
    uint32_t bits;
#endif
    for (size_t i = 0; i < count; i++) {
        memcpy(&bits, &x[i], sizeof bits);
        if ((bits & exponent) == exponent) {
            return 0;
        }
    }
    return 1;
}

int aeo_linalg_all_within(const aeo_real_t *x, size_t count, aeo_real_t limit)
{
    for (size_t i = 0; i < count; i++) {
        if (x[i] > limit || x[i] < -limit) {
            return 0;
        }
    }
    return 1;
}

aeo_status_t aeo_linalg_judge(const aeo_real_t *x, size_t count, aeo_real_t limit)
{
    if (!aeo_linalg_all_finite(x, count)) {
        return AEO_E_NOT_FINITE;
    }
    return aeo_linalg_all_within(x, count, limit) ? AEO_OK : AEO_E_RANGE;
}

/* Four partial sums: a quarter of the rounding error of one long chain, and no wait for each addition. */
aeo_real_t aeo_linalg_dot(const aeo_real_t *x, const aeo_real_t *y, size_t count)
{
    aeo_real_t s0 = AEO_REAL(0), s1 = AEO_REAL(0), s2 = AEO_REAL(0), s3 = AEO_REAL(0);
    size_t i = 0;
    for (; i + 4 <= count; i += 4) {
        s0 += x[i] * y[i];
        s1 += x[i + 1] * y[i + 1];
        s2 += x[i + 2] * y[i + 2];
        s3 += x[i + 3] * y[i + 3];
    }
    for (; i < count; i++) {
        s0 += x[i] * y[i];
    }
    return (s0 + s1) + (s2 + s3);
}

void aeo_linalg_axpy(aeo_real_t a, const aeo_real_t *restrict x, aeo_real_t *restrict y, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        y[i] += a * x[i];
    }
}

aeo_real_t aeo_linalg_project(const aeo_real_t *factor, const aeo_real_t *z, aeo_real_t *projection, size_t n)
{
    aeo_real_t sum = AEO_REAL(0);
    for (size_t j = 0; j < n; j++) {
        const aeo_real_t a = aeo_linalg_dot(factor, z + j, n - j);
        projection[j] = a;
        sum += a * a;
        factor += n - j;
    }
    return sum;
}

/* Rotate the pivot column into one column of the factor: with b the pivot column kept unnormalised (g alpha), which
 * saves a multiplication a term over the textbook rotation,
 *     b_new = b + a s,   s_new = c s - k b,   c = scale (alpha / alpha_new)^(1/2),   k = c a / alpha. */
static void rotate_column(aeo_real_t *restrict s, aeo_real_t *restrict b, size_t count, aeo_real_t a, aeo_real_t c,
                          aeo_real_t k)
{
    /* Row j of b is still 0 here: columns right of j have no entry in row j. So the diagonal is only scaled by c > 0
     * and stays above 0. */
    b[0] = a * s[0];
    s[0] = c * s[0];
    size_t i = 1;
    /* Four terms a turn: at -O2, with no vector unit asked for, this halves the instructions of the whole update. */
    for (; i + 4 <= count; i += 4) {
        const aeo_real_t s0 = s[i], s1 = s[i + 1], s2 = s[i + 2], s3 = s[i + 3];
        const aeo_real_t b0 = b[i], b1 = b[i + 1], b2 = b[i + 2], b3 = b[i + 3];
        s[i] = c * s0 - k * b0;
        s[i + 1] = c * s1 - k * b1;
        s[i + 2] = c * s2 - k * b2;
        s[i + 3] = c * s3 - k * b3;
        b[i] = b0 + a * s0;
        b[i + 1] = b1 + a * s1;
        b[i + 2] = b2 + a * s2;
        b[i + 3] = b3 + a * s3;
    }
    for (; i < count; i++) {
        const aeo_real_t last = s[i];
        s[i] = c * last - k * b[i];
        b[i] += a * last;
    }
}

aeo_real_t aeo_linalg_rotate(aeo_real_t *factor, const aeo_real_t *projection, size_t count, aeo_real_t *gain, size_t n,
                             aeo_real_t alpha, aeo_real_t scale)
{
    AEO_ASSERT(alpha > AEO_REAL(0));
    for (size_t i = count; i < n; i++) {
        gain[i] = AEO_REAL(0);
    }
    aeo_real_t *column = factor + (count * n - count * (count - 1) / 2); /* one past column count-1; count >= 1 */
    aeo_real_t root = AEO_SQRT(alpha);
    /* From the last column to the first: then the pivot column has entries only where the factor's column has. */
    for (size_t j = count; j-- > 0;) {
        const aeo_real_t a = projection[j];
        const aeo_real_t alpha_new = alpha + a * a;
        const aeo_real_t root_new = AEO_SQRT(alpha_new);
        /* alpha grows from a value above 0, so neither root is 0. As root <= root_new, c <= scale, and c is scale to
         * the bit when a is lost in alpha: alpha scale / (root root_new) lies 5e-8 above it on average, and over 1e7
         * samples P would grow threefold along directions that are never excited. */
        const aeo_real_t c = root / root_new * scale;
        const aeo_real_t k = a / (root * root_new) * scale;
        column -= n - j;
        rotate_column(column, gain + j, n - j, a, c, k);
        alpha = alpha_new;
        root = root_new;
    }
    return alpha;
}

aeo_real_t aeo_linalg_row_norm2(const aeo_real_t *factor, size_t n, size_t i, aeo_real_t *row)
{
    aeo_real_t sum = AEO_REAL(0);
    const aeo_real_t *entry = factor + i; /* row i of column 0 */
    for (size_t j = 0; j <= i; j++) {
        const aeo_real_t s = *entry;
        sum += s * s;
        if (row != NULL) {
            row[j] = s;
        }
        entry += n - j - 1; /* column j+1 starts n - j later and its row i sits one place earlier */
    }
    return sum;
}
/* SPDX-License-Identifier: MIT */
