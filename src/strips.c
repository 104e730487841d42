/* strips.c: the kernels of strips.h. */
#include "strips.h"

#include "lanes.h"
#include "linalg.h"

#include <string.h>

enum { W = AEO_RLS_STRIP };

/* Where column j of strip s begins, in padded order: strip t has W t + W - pad columns. */
static size_t find_column(size_t s, size_t j, size_t pad)
{
    return W * (W * s * (s + 1u) / 2u - s * pad + (j - pad));
}

/* Where a row, counted in padded order, begins: its columns lie W apart. */
static size_t find_row(size_t row, size_t pad)
{
    return find_column(row / W, pad, pad) + row % W;
}

void aeo_strips_start(aeo_real_t *factor, size_t n, aeo_real_t diagonal)
{
    const size_t pad = aeo_strips_pad(n);
    memset(factor, 0, AEO_RLS_FACTOR_WORDS(n) * sizeof *factor);
    for (size_t i = 0; i < n; i++) {
        factor[find_row(pad + i, pad) + W * i] = diagonal;
    }
}

/* Where a strip's numbers are met: strip s is `step` numbers long, each further one W W longer. */
typedef struct {
    const aeo_real_t *entry; /* of the first strip, in the first column */
    const aeo_real_t *z;     /* z of the first strip, the others' behind it */
    size_t step, strips;
} walk_t;

#if AEO_SMALL
/* a = S'z for the column at walk.entry; returns how many columns that was. */
static size_t project_some(walk_t walk, aeo_real_t *a, size_t left)
{
    (void)left;
    *a = aeo_linalg_dot_strips(walk.entry, walk.step, W * W, walk.z, W * walk.strips);
    return 1;
}
#else
/* a = S'z for the column at walk.entry, and for the one `apart` numbers further, which may be 0. Two pointers, and the
 * first strip by itself: a Cortex-M4F takes 6 % fewer instructions an update. */
static void project_two(walk_t walk, size_t apart, aeo_real_t *a, aeo_real_t *b)
{
    const aeo_real_t *left = walk.entry, *right = walk.entry + apart;
    aeo_lanes_t first[AEO_PARTS], second[AEO_PARTS];
#define BEGIN(i)                                                                                                       \
    {                                                                                                                  \
        const aeo_lanes_t z = aeo_lanes_load(walk.z + (i)*AEO_LANES);                                                  \
        first[i] = aeo_lanes_load(left + (i)*AEO_LANES) * z;                                                           \
        second[i] = aeo_lanes_load(right + (i)*AEO_LANES) * z;                                                         \
    }
#define ADD(i)                                                                                                         \
    {                                                                                                                  \
        const aeo_lanes_t z = aeo_lanes_load(walk.z + (i)*AEO_LANES);                                                  \
        first[i] += aeo_lanes_load(left + (i)*AEO_LANES) * z;                                                          \
        second[i] += aeo_lanes_load(right + (i)*AEO_LANES) * z;                                                        \
    }
    AEO_EACH_PART(BEGIN)
    while (--walk.strips > 0u) {
        left += walk.step;
        right += walk.step;
        walk.step += W * W;
        walk.z += W;
        AEO_EACH_PART(ADD)
    }
#undef BEGIN
#undef ADD
    *a = aeo_lanes_sum(first);
    *b = aeo_lanes_sum(second);
}

#if AEO_PARTS <= 2
#define IN_FOURS      1
/* The same for four columns from the one at walk.entry on. */
static void project_four(walk_t walk, aeo_real_t *a)
{
    const aeo_real_t *entry = walk.entry;
    aeo_lanes_t s0[AEO_PARTS], s1[AEO_PARTS], s2[AEO_PARTS], s3[AEO_PARTS];
#define AT(column, i) aeo_lanes_load(entry + (column)*W + (i)*AEO_LANES)
#define CLEAR(i)      s0[i] = s1[i] = s2[i] = s3[i] = aeo_lanes_spread(AEO_SUM_START);
#define ADD(i)                                                                                                         \
    {                                                                                                                  \
        const aeo_lanes_t factor = aeo_lanes_load(walk.z + (i)*AEO_LANES);                                             \
        s0[i] += AT(0, i) * factor;                                                                                    \
        s1[i] += AT(1, i) * factor;                                                                                    \
        s2[i] += AT(2, i) * factor;                                                                                    \
        s3[i] += AT(3, i) * factor;                                                                                    \
    }
    AEO_EACH_PART(CLEAR)
    for (;;) {
        AEO_EACH_PART(ADD)
        if (--walk.strips == 0u) {
            break;
        }
        entry += walk.step;
        walk.step += W * W;
        walk.z += W;
    }
#undef AT
#undef CLEAR
#undef ADD
    aeo_lanes_store_sums(a, s0, s1, s2, s3);
}
#else
#define IN_FOURS 0
#endif

/* The same for as many of `left` columns as go at once; returns how many that was. */
static size_t project_some(walk_t walk, aeo_real_t *a, size_t left)
{
#if IN_FOURS
    if (left >= 4u) {
        project_four(walk, a);
        return 4;
    }
#endif
    const size_t more = left > 1u; /* an odd pad leaves one column alone */
    project_two(walk, more * W, a, a + more);
    return 1u + more;
}
#endif

/* sums[j] = the sum of a[i]^2 over i >= j, from the last on; in fours, which shortens the chain of additions. Each is at
 * least the one after it, rounded or not. Returns the first. */
static aeo_real_t sum_squares(const aeo_real_t *a, aeo_real_t *sums, size_t count)
{
    aeo_real_t sum = AEO_REAL(0);
    for (size_t j = count; j > 0;) {
        j -= 4u; /* count is a multiple of 8 */
        const aeo_real_t s3 = a[j + 3] * a[j + 3], s2 = s3 + a[j + 2] * a[j + 2];
        const aeo_real_t s1 = s2 + a[j + 1] * a[j + 1], s0 = s1 + a[j] * a[j];
        sums[j + 3] = sum + s3;
        sums[j + 2] = sum + s2;
        sums[j + 1] = sum + s1;
        sum += s0;
        sums[j] = sum;
    }
    return sum;
}

aeo_real_t aeo_strips_project(const aeo_real_t *factor, const aeo_real_t *z, size_t n, aeo_real_t *work)
{
    const size_t pad = aeo_strips_pad(n), size = n + pad;
    aeo_real_t *const padded = work + size; /* z, in the row of turns, which come later */
    walk_t walk = {factor, padded, W * (W - pad), size / W};
    memset(work, 0, W * sizeof *work);
    memset(padded, 0, W * sizeof *padded);
    memcpy(padded + pad, z, n * sizeof *z);
    aeo_real_t *a = work + pad;
    for (aeo_real_t *end = work + W; walk.strips > 0u; end += W) {
        while (a < end) {
            const size_t columns = project_some(walk, a, (size_t)(end - a));
            walk.entry += columns * W;
            a += columns;
        }
        walk.entry += walk.step; /* from the end of a strip to the next one's first column that it has not */
        walk.step += W * W;
        walk.z += W;
        walk.strips--;
    }
    return sum_squares(work, padded + size, size);
}

void aeo_strips_take_row(const aeo_real_t *factor, size_t n, size_t i, aeo_real_t weight, aeo_real_t *work)
{
    const size_t pad = aeo_strips_pad(n), size = n + pad;
    const aeo_real_t *entry = factor + find_row(pad + i, pad);
    memset(work, 0, size * sizeof *work);
    for (size_t j = 0; j <= i; j++, entry += W) {
        work[pad + j] = weight * *entry;
    }
    (void)sum_squares(work, work + 2 * size, size);
}

/* With alpha_j = alpha + the sum at j, r = alpha^(1/2) and b the pivot column kept unnormalised (g alpha), which saves a
 * multiplication a term over the textbook rotation, column j turns by
 *     b_new = b + a s,   s_new = c s - k b,   c = scale r_{j+1} / r_j,   k = scale a / (r_j r_{j+1}).
 * The sums (one more, for j = count) become c, and turn k. c is scale to the bit when a is lost in alpha, and a ratio <= 1
 * never raises it: alpha scale / (r_j r_{j+1}) lies 5e-8 above it on average, and over 1e7 samples P would grow threefold
 * along directions that are never excited. alpha > 0 and the sums are not negative, so no root is 0. */
#if AEO_LANES == 1 || defined(__FAST_MATH__) || defined(__RECIPROCAL_MATH__)
/* One after the other: of several roots and quotients at once -ffast-math makes estimates, which inflate S. */
static void find_turns(const aeo_real_t *a, aeo_real_t *sums, aeo_real_t *turn, size_t count, aeo_real_t alpha,
                       aeo_real_t scale)
{
    aeo_real_t last = alpha, root = AEO_SQRT(alpha);
    for (size_t j = count; j-- > 0u;) {
        const aeo_real_t next = alpha + sums[j];
        aeo_real_t root_new = root;
        sums[j] = scale;
        if (next > last) {
            root_new = AEO_SQRT(next);
            sums[j] = root / root_new * scale;
        }
        turn[j] = a[j] / (root * root_new) * scale;
        last = next;
        root = root_new;
    }
}
#else
static void find_turns(const aeo_real_t *a, aeo_real_t *sums, aeo_real_t *turn, size_t count, aeo_real_t alpha,
                       aeo_real_t scale)
{
    const aeo_lanes_t base = aeo_lanes_spread(alpha), factor = aeo_lanes_spread(scale), root = aeo_lanes_root(base);
    for (size_t j = 0; j < count; j += AEO_LANES) {
        aeo_lanes_store(sums + j, aeo_lanes_root(base + aeo_lanes_load(sums + j)));
    }
    memcpy(sums + count, &root, sizeof *sums);
    for (size_t j = 0; j < count; j += AEO_LANES) {
        const aeo_lanes_t after = aeo_lanes_load(sums + j), before = aeo_lanes_load(sums + j + 1);
        aeo_lanes_store(turn + j, aeo_lanes_load(a + j) / (before * after) * factor);
        aeo_lanes_store(sums + j, before / after * factor); /* a root by itself is 1 */
    }
}
#endif

/* One part of a column and of the pivot in its rows. */
#define TURN(part, entry)                                                                                              \
    {                                                                                                                  \
        const aeo_lanes_t old = aeo_lanes_load(entry);                                                                 \
        aeo_lanes_store(entry, c *old - k * (part));                                                                   \
        (part) += a * old;                                                                                             \
    }

typedef struct {
    const aeo_real_t *a, *c, *k;
} turns_t;

/* Half of the rows of a strip by themselves, where they are whole vectors. Where text counts always so: 140 bytes on a
 * Cortex-M4F, 6 % more instructions of an update. */
#if AEO_PARTS > 1 && !AEO_SMALL
#define IN_HALVES 1
#else
#define IN_HALVES 0
#endif
#if AEO_SMALL
#define AT_ONCE  4
#define EACH(DO) DO(0) DO(1) DO(2) DO(3)
#else
#define AT_ONCE W
#define EACH    AEO_EACH_PART
#endif

/* x - y, at least 0 */
static size_t less(size_t x, size_t y)
{
    return x > y ? x - y : 0u;
}

#define CLEAR(i)  b[i] = aeo_lanes_spread(AEO_REAL(0));
#define STEP(i)   TURN(b[i], strip + W * j + (i)*AEO_LANES)
#define KEEP(i)   aeo_lanes_store(gain + (i)*AEO_LANES, b[i]);
#define CLEAR2(i) d[i] = aeo_lanes_spread(AEO_REAL(0));
#define STEP2(i)  TURN(d[i], above + W * j + (i)*AEO_LANES)
#define KEEP2(i)  aeo_lanes_store(gain - W + (i)*AEO_LANES, d[i]);
#define SPREAD_TURN                                                                                                    \
    const aeo_lanes_t a = aeo_lanes_spread(as[j]), c = aeo_lanes_spread(cs[j]), k = aeo_lanes_spread(ks[j])

/* From column j on down to column `first`, the parts of a strip that DO names. */
#define ROTATE(DO, first)                                                                                              \
    while (j > (first)) {                                                                                              \
        j--;                                                                                                           \
        SPREAD_TURN;                                                                                                   \
        DO                                                                                                             \
    }

/* Rotate the first `count` of a strip's columns, the last of them first; gain receives the strip's part of it. From column
 * `half` on its first four rows are 0. */
static void rotate_strip(aeo_real_t *AEO_RESTRICT strip, turns_t turns, size_t count, size_t half, aeo_real_t *gain)
{
    const aeo_real_t *AEO_RESTRICT const as = turns.a, *AEO_RESTRICT const cs = turns.c,
                                         *AEO_RESTRICT const ks = turns.k;
    aeo_lanes_t b[AEO_PARTS];
    size_t j = count;
    EACH(CLEAR)
#if IN_HALVES
    ROTATE(AEO_LAST_FOUR(STEP), half)
#else
    (void)half;
#endif
    ROTATE(EACH(STEP), 0u)
    EACH(KEEP)
}
#undef EACH

#if AEO_PARTS <= 2
#define IN_PAIRS 1
/* The same for two strips, the one above with as many of its columns as it has: neither waits for its own sums, and a turn
 * is spread over lanes once. */
static void rotate_two(aeo_real_t *AEO_RESTRICT strip, aeo_real_t *AEO_RESTRICT above, turns_t turns, size_t count,
                       size_t half, aeo_real_t *gain)
{
    const aeo_real_t *AEO_RESTRICT const as = turns.a, *AEO_RESTRICT const cs = turns.c,
                                         *AEO_RESTRICT const ks = turns.k;
    const size_t both = less(half, 4u);
    aeo_lanes_t b[AEO_PARTS], d[AEO_PARTS];
    size_t j = count;
    AEO_EACH_PART(CLEAR)
    AEO_EACH_PART(CLEAR2)
#if IN_HALVES
    ROTATE(AEO_LAST_FOUR(STEP), half)
    ROTATE(AEO_EACH_PART(STEP), both)
    ROTATE(AEO_EACH_PART(STEP) AEO_LAST_FOUR(STEP2), less(both, 4u))
#else
    ROTATE(AEO_EACH_PART(STEP), both)
#endif
    ROTATE(AEO_EACH_PART(STEP) AEO_EACH_PART(STEP2), 0u)
    AEO_EACH_PART(KEEP)
    AEO_EACH_PART(KEEP2)
}
#else
#define IN_PAIRS 0
#endif
#undef ROTATE
#undef CLEAR
#undef STEP
#undef KEEP
#undef CLEAR2
#undef STEP2
#undef KEEP2
#undef SPREAD_TURN
#undef TURN

const aeo_real_t *aeo_strips_rotate(aeo_real_t *factor, size_t n, size_t count, aeo_real_t *work, aeo_real_t alpha,
                                    aeo_real_t scale)
{
    const size_t pad = aeo_strips_pad(n), size = n + pad;
    AEO_ASSERT(alpha > AEO_REAL(0));
    aeo_real_t *const gain = work + size, *const sums = gain + size;
    find_turns(work, sums, gain, size, alpha, scale);
    const turns_t turns = {work + pad, sums + pad, gain + pad};
    /* A strip's part of the gain takes the place of turns that the strips above it do not have. */
    for (size_t end = size; end > pad; end -= AT_ONCE) {
        const size_t own = end - pad, columns = count < own ? count : own, row = end - AT_ONCE;
        aeo_real_t *const strip = factor + find_row(row, pad);
#if IN_PAIRS
        if (row > 0u) {
            end -= W;
            rotate_two(strip, factor + find_row(end - W, pad), turns, columns, less(own, 4u), gain + end);
            continue;
        }
#endif
        rotate_strip(strip, turns, columns, less(own, 4u), gain + row);
    }
    return gain + pad;
}

aeo_real_t aeo_strips_norm2(const aeo_real_t *factor, size_t n, size_t i)
{
    const size_t pad = aeo_strips_pad(n);
    const aeo_real_t *const row = factor + find_row(pad + i, pad);
    aeo_real_t even = AEO_REAL(0), odd = AEO_REAL(0);
    size_t j = 0;
    for (; j < i; j += 2) { /* two sums: half the wait for additions */
        even += row[W * j] * row[W * j];
        odd += row[W * j + W] * row[W * j + W];
    }
    return j > i ? even + odd : even + row[W * j] * row[W * j] + odd;
}

int aeo_strips_hold(const aeo_real_t *factor, size_t n)
{
    const size_t pad = aeo_strips_pad(n);
    const aeo_real_t *entry = factor;
    for (size_t last = W; last <= n + pad; last += W) { /* one past a strip's rows, and past its columns */
        for (size_t j = pad; j < last; j++) {
            for (size_t i = last - W; i < last; i++, entry++) {
                if (i == j ? !(*entry > AEO_REAL(0)) : i < j && (*entry < AEO_REAL(0) || *entry > AEO_REAL(0))) {
                    return 0;
                }
            }
        }
    }
    return 1;
}
/* SPDX-License-Identifier: MIT */
