/* linalg.c: the kernels of linalg.h. */
#include "linalg.h"

#include "aeolid/regressor.h"

#include <string.h>

#if AEO_REAL_BYTES == 8
typedef uint64_t bits_t;
#define SIGN     UINT64_C(0x8000000000000000)
#define REAL_MAX DBL_MAX
#else
typedef uint32_t bits_t;
#define SIGN     UINT32_C(0x80000000)
#define REAL_MAX FLT_MAX
#endif

int aeo_linalg_all_finite(const aeo_real_t *x, size_t count)
{
    return aeo_linalg_all_within(x, count, REAL_MAX);
}

int aeo_linalg_all_within(const aeo_real_t *x, size_t count, aeo_real_t limit)
{
    /* Without their signs, IEEE numbers are ordered as their bits are, infinity and NaN last. */
    bits_t bits, most;
    memcpy(&most, &limit, sizeof most);
    for (size_t i = 0; i < count; i++) {
        memcpy(&bits, &x[i], sizeof bits);
        if ((bits & ~SIGN) > most) {
            return 0;
        }
    }
    return 1;
}

aeo_status_t aeo_linalg_judge(const aeo_real_t *x, size_t count)
{
    if (aeo_linalg_all_within(x, count, AEO_SCALED_MAX)) {
        return AEO_OK;
    }
    return aeo_linalg_all_finite(x, count) ? AEO_E_RANGE : AEO_E_NOT_FINITE;
}

aeo_status_t aeo_linalg_judge_sample(const aeo_real_t *z, size_t n, const aeo_real_t *y, size_t l, uint32_t *rejected)
{
    if (z == NULL || y == NULL) {
        return AEO_E_ARG;
    }
    aeo_status_t status = aeo_linalg_judge(z, n);
    if (status == AEO_OK) {
        status = aeo_linalg_judge(y, l);
    }
    if (status != AEO_OK) {
        aeo_count_up(rejected);
    }
    return status;
}

aeo_status_t aeo_linalg_copy_out(const aeo_real_t *from, size_t count, aeo_real_t *to, size_t length)
{
    if (to == NULL) {
        return AEO_E_ARG;
    }
    if (length < count) {
        return AEO_E_MEMORY;
    }
    if (to != from) {
        memcpy(to, from, count * sizeof *to);
    }
    return AEO_OK;
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

int aeo_linalg_find_error(const aeo_real_t *rows, const aeo_real_t *z, size_t n, const aeo_real_t *y, aeo_real_t *error,
                          size_t count)
{
    for (size_t i = 0; i < count; i++) {
        error[i] = y[i] - aeo_linalg_dot(rows, z, n);
        rows += n;
    }
    return aeo_linalg_all_within(error, count, AEO_LINALG_ERROR_MAX);
}

void aeo_linalg_axpy(aeo_real_t a, const aeo_real_t *restrict x, aeo_real_t *restrict y, size_t count)
{
    size_t i = 0;
    for (; i + 4 <= count; i += 4) { /* four a turn, as in rotate_two */
        const aeo_real_t y0 = y[i] + a * x[i], y1 = y[i + 1] + a * x[i + 1];
        const aeo_real_t y2 = y[i + 2] + a * x[i + 2], y3 = y[i + 3] + a * x[i + 3];
        y[i] = y0;
        y[i + 1] = y1;
        y[i + 2] = y2;
        y[i + 3] = y3;
    }
    for (; i < count; i++) {
        y[i] += a * x[i];
    }
}

void aeo_linalg_scale(aeo_real_t a, const aeo_real_t *restrict x, aeo_real_t *restrict y, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        y[i] = a * x[i];
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

/* Rotate the pivot column into a column of the factor: with b the pivot column kept unnormalised (g alpha), which saves
 * a multiplication a term over the textbook rotation,
 *     b_new = b + a s,   s_new = c s - k b,   c = scale (alpha / alpha_new)^(1/2),   k = c a / alpha. */
typedef struct {
    aeo_real_t a, c, k;
} turn_t;

/* The turn that brings a into alpha; root is that of alpha. Both are moved on to alpha_new. */
static turn_t find_turn(aeo_real_t a, aeo_real_t scale, aeo_real_t *alpha, aeo_real_t *root)
{
    const aeo_real_t alpha_new = *alpha + a * a;
    turn_t turn = {a, scale, scale};
    /* c is scale to the bit when a is lost in alpha, and root / root_new <= 1 never raises it: alpha scale / (root
     * root_new) lies 5e-8 above it on average, and over 1e7 samples P would grow threefold along directions that are
     * never excited. alpha grows from a value above 0, so no root is 0. */
    aeo_real_t root_new = *root;
    if (alpha_new > *alpha) {
        root_new = AEO_SQRT(alpha_new);
        turn.c = *root / root_new * scale;
    }
    turn.k = a / (*root * root_new) * scale;
    *alpha = alpha_new;
    *root = root_new;
    return turn;
}

/* An entry in a row in which the pivot is 0 still, as in that of a diagonal entry: columns further right have no entry
 * there. So a diagonal entry is only scaled by c > 0 and stays above 0. */
static void rotate_first(aeo_real_t *restrict s, aeo_real_t *restrict b, turn_t turn)
{
    *b = turn.a * *s;
    *s = turn.c * *s;
}

/* One entry s of a column and b of the pivot in its row. */
static void rotate_entry(aeo_real_t *restrict s, aeo_real_t *restrict b, turn_t turn)
{
    const aeo_real_t last = *s;
    *s = turn.c * last - turn.k * *b;
    *b += turn.a * last;
}

/* Column s, then column t on its left, over the same rows of count: the pivot is fetched once for both. */
static void rotate_two(aeo_real_t *restrict s, aeo_real_t *restrict t, aeo_real_t *restrict b, size_t count,
                       const turn_t *first, const turn_t *second)
{
    const aeo_real_t a = first->a, c = first->c, k = first->k, d = second->a, e = second->c, m = second->k;
    size_t i = 0;
    /* Four rows a turn: at -O2, with no vector unit asked for, this halves the instructions of the whole update. */
    for (; i + 4 <= count; i += 4) {
        const aeo_real_t s0 = s[i], s1 = s[i + 1], s2 = s[i + 2], s3 = s[i + 3];
        aeo_real_t b0 = b[i], b1 = b[i + 1], b2 = b[i + 2], b3 = b[i + 3];
        s[i] = c * s0 - k * b0;
        s[i + 1] = c * s1 - k * b1;
        s[i + 2] = c * s2 - k * b2;
        s[i + 3] = c * s3 - k * b3;
        b0 += a * s0;
        b1 += a * s1;
        b2 += a * s2;
        b3 += a * s3;
        const aeo_real_t t0 = t[i], t1 = t[i + 1], t2 = t[i + 2], t3 = t[i + 3];
        t[i] = e * t0 - m * b0;
        t[i + 1] = e * t1 - m * b1;
        t[i + 2] = e * t2 - m * b2;
        t[i + 3] = e * t3 - m * b3;
        b[i] = b0 + d * t0;
        b[i + 1] = b1 + d * t1;
        b[i + 2] = b2 + d * t2;
        b[i + 3] = b3 + d * t3;
    }
    for (; i < count; i++) {
        rotate_entry(s + i, b + i, *first);
        rotate_entry(t + i, b + i, *second);
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
    /* From the last column to the first: then the pivot column has entries only where the factor's column has. Two
     * columns at once, j and j-1; when their number is odd, the last is alone. */
    for (size_t j = count; j > 0;) {
        const turn_t first = find_turn(projection[--j], scale, &alpha, &root);
        column -= n - j;
        rotate_first(column, gain + j, first);
        if (j % 2u == 0u) {                      /* count is odd: its last column is alone */
            for (size_t i = 1; i < n - j; i++) { /* the pivot is still 0 in every row */
                rotate_first(column + i, gain + j + i, first);
            }
            continue;
        }
        const turn_t second = find_turn(projection[--j], scale, &alpha, &root);
        aeo_real_t *const right = column;
        column -= n - j;
        rotate_first(column, gain + j, second);
        rotate_entry(column + 1, gain + j + 1, second);
        rotate_two(right + 1, column + 2, gain + j + 2, n - j - 2, &first, &second);
    }
    return alpha;
}

aeo_real_t *aeo_linalg_start_triangle(aeo_real_t *factor, size_t n, aeo_real_t diagonal)
{
    for (; n > 0; n--) {
        memset(factor, 0, n * sizeof *factor);
        *factor = diagonal;
        factor += n;
    }
    return factor;
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
