/* triangle.c: the kernels of triangle.h. */
#include "triangle.h"

#include "linalg.h"
#include "root.h"

#include <string.h>

void aeo_triangle_project(const aeo_real_t *factor, const aeo_real_t *z, aeo_real_t *projection, size_t n)
{
    for (size_t j = 0; j < n; j++) {
        projection[j] = aeo_linalg_dot(factor, z + j, n - j);
        factor += n - j;
    }
}

void aeo_triangle_expand(const aeo_real_t *factor, const aeo_real_t *a, aeo_real_t *z, size_t n)
{
    memset(z, 0, n * sizeof *z);
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j; i < n; i++) {
            z[i] += *factor++ * a[j];
        }
    }
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
static void rotate_first(aeo_real_t *AEO_RESTRICT s, aeo_real_t *AEO_RESTRICT b, turn_t turn)
{
    *b = turn.a * *s;
    *s = turn.c * *s;
}

/* One entry s of a column and b of the pivot in its row. */
static void rotate_entry(aeo_real_t *AEO_RESTRICT s, aeo_real_t *AEO_RESTRICT b, turn_t turn)
{
    const aeo_real_t last = *s;
    *s = turn.c * last - turn.k * *b;
    *b += turn.a * last;
}

/* Column s, then column t on its left, over the same rows of count: the pivot is fetched once for both. */
static void rotate_two(aeo_real_t *AEO_RESTRICT s, aeo_real_t *AEO_RESTRICT t, aeo_real_t *AEO_RESTRICT b, size_t count,
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

void aeo_triangle_rotate(aeo_real_t *factor, const aeo_real_t *projection, aeo_real_t *gain, size_t n, aeo_real_t alpha,
                         aeo_real_t scale)
{
    AEO_ASSERT(alpha > AEO_REAL(0));
    aeo_real_t *column = factor + n * (n + 1) / 2; /* one past the last column */
    aeo_real_t root = AEO_SQRT(alpha);
    /* From the last column to the first: then the pivot column has entries only where the factor's column has. Two
     * columns at once, j and j-1; when their number is odd, the last is alone. */
    for (size_t j = n; j > 0;) {
        const turn_t first = find_turn(projection[--j], scale, &alpha, &root);
        column -= n - j;
        rotate_first(column, gain + j, first);
        if (j % 2u == 0u) { /* n is odd: its last column is alone, and of one entry */
            /* so this loop never runs; without it gcc 12 makes an update on a Cortex-M4F 30 instructions dearer */
            for (size_t i = 1; i < n - j; i++) {
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
}

aeo_real_t *aeo_triangle_start(aeo_real_t *factor, size_t n, aeo_real_t diagonal)
{
    for (; n > 0; n--) {
        memset(factor, 0, n * sizeof *factor);
        *factor = diagonal;
        factor += n;
    }
    return factor;
}

aeo_real_t aeo_triangle_norm2(const aeo_real_t *factor, size_t n, size_t i)
{
    aeo_real_t sum = AEO_REAL(0);
    const aeo_real_t *entry = factor + i; /* row i of column 0 */
    for (size_t j = 0; j <= i; j++) {
        sum += *entry * *entry;
        entry += n - j - 1; /* column j+1 starts n - j later and its row i sits one place earlier */
    }
    return sum;
}
/* SPDX-License-Identifier: MIT */
