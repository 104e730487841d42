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
    size_t i = 0;
    memcpy(&most, &limit, sizeof most);
#if AEO_LANES > 1
    aeo_lanes_bits_t room = {0};
    for (; i + AEO_LANES <= count; i += AEO_LANES) {
        room |= aeo_lanes_room(aeo_lanes_load(x + i), aeo_lanes_spread(limit));
    }
    if (aeo_lanes_any_negative(room)) {
        return 0;
    }
#endif
    for (; i < count; i++) {
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

/* Eight partial sums, lane by lane of lanes.h; of what is left four go into the first four, three are added last. An
 * eighth of the rounding error of one long chain, and no wait for each addition. */
#define CLEAR(p) part[p] = aeo_lanes_spread(AEO_SUM_START);
#define TERM(p)  aeo_lanes_load(x + (p)*AEO_LANES) * aeo_lanes_load(y + (p)*AEO_LANES)
#define BEGIN(p) part[p] = TERM(p);
#define ADD(p)   part[p] += TERM(p);
#if AEO_SMALL
aeo_real_t aeo_linalg_dot(const aeo_real_t *x, const aeo_real_t *y, size_t count)
{
    return aeo_linalg_dot_strips(x, AEO_SUM_LANES, 0, y, count);
}

aeo_real_t aeo_linalg_dot_strips(const aeo_real_t *x, size_t step, size_t growth, const aeo_real_t *y, size_t count)
#else
aeo_real_t aeo_linalg_dot(const aeo_real_t *x, const aeo_real_t *y, size_t count)
#endif
{
    aeo_lanes_t part[AEO_PARTS];
#if AEO_SMALL
    AEO_EACH_PART(CLEAR)
    for (; count >= AEO_SUM_LANES; count -= AEO_SUM_LANES) {
        AEO_EACH_PART(ADD)
        x += step;
        step += growth;
        y += AEO_SUM_LANES;
    }
#else
    if (count < AEO_SUM_LANES) {
        AEO_EACH_PART(CLEAR)
    } else { /* with a multiplication at first, and a count of its own: fewer instructions on a Cortex-M4F */
        AEO_EACH_PART(BEGIN)
        for (size_t eights = count / AEO_SUM_LANES; --eights > 0u;) {
            x += AEO_SUM_LANES;
            y += AEO_SUM_LANES;
            AEO_EACH_PART(ADD)
        }
        x += AEO_SUM_LANES;
        y += AEO_SUM_LANES;
        count %= AEO_SUM_LANES;
    }
#endif
    if (count >= 4u) {
        aeo_lanes_add_four(part, x, y);
    }
    aeo_real_t sum = aeo_lanes_sum(part);
    for (size_t i = count & 4u; i < count; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}
#undef CLEAR
#undef TERM
#undef BEGIN
#undef ADD

/* Not under -ffast-math, which may add up otherwise here than in a dot product by itself: a row's sum must not depend on
 * how many others there are. */
#if AEO_PARTS <= 2 && !defined(__FAST_MATH__)
#define IN_FOURS 1
/* Four rows (n values each) times z at once, each sum as aeo_linalg_dot has it. */
static void dot_four(const aeo_real_t *rows, const aeo_real_t *z, size_t n, aeo_real_t *sums)
{
    aeo_lanes_t s0[AEO_PARTS], s1[AEO_PARTS], s2[AEO_PARTS], s3[AEO_PARTS];
    size_t i = 0;
#define AT(row, p) AEO_FROM(lanes, rows + (row)*n + i + (p)*AEO_LANES)
#define CLEAR(p)   s0[p] = s1[p] = s2[p] = s3[p] = aeo_lanes_spread(AEO_SUM_START);
#define ADD(p)                                                                                                         \
    {                                                                                                                  \
        const aeo_lanes_t factor = AEO_FROM(lanes, z + i + (p)*AEO_LANES);                                             \
        s0[p] += AT(0, p) * factor;                                                                                    \
        s1[p] += AT(1, p) * factor;                                                                                    \
        s2[p] += AT(2, p) * factor;                                                                                    \
        s3[p] += AT(3, p) * factor;                                                                                    \
    }
    AEO_EACH_PART(CLEAR)
    for (; i + AEO_SUM_LANES <= n; i += AEO_SUM_LANES) {
        AEO_EACH_PART(ADD)
    }
    if (i + 4u <= n) {
        aeo_lanes_add_four(s0, rows + i, z + i);
        aeo_lanes_add_four(s1, rows + n + i, z + i);
        aeo_lanes_add_four(s2, rows + 2u * n + i, z + i);
        aeo_lanes_add_four(s3, rows + 3u * n + i, z + i);
        i += 4u;
    }
    aeo_lanes_store_sums(sums, s0, s1, s2, s3);
    for (; i < n; i++) {
        sums[0] += rows[i] * z[i];
        sums[1] += rows[n + i] * z[i];
        sums[2] += rows[2u * n + i] * z[i];
        sums[3] += rows[3u * n + i] * z[i];
    }
#undef AT
#undef CLEAR
#undef ADD
}
#else
#define IN_FOURS 0
#endif

int aeo_linalg_find_error(const aeo_real_t *rows, const aeo_real_t *z, size_t n, const aeo_real_t *y, aeo_real_t *error,
                          size_t count)
{
    size_t i = 0;
#if IN_FOURS
    for (; i + 4u <= count; i += 4u) {
        aeo_real_t sums[4];
        dot_four(rows, z, n, sums);
        for (size_t k = 0; k < 4u; k++) {
            error[i + k] = y[i + k] - sums[k];
        }
        rows += 4u * n;
    }
#endif
    for (; i < count; i++) {
        error[i] = y[i] - aeo_linalg_dot(rows, z, n);
        rows += n;
    }
    return aeo_linalg_all_within(error, count, AEO_LINALG_ERROR_MAX);
}

#define FETCH(type, p) v[p] = AEO_FROM(type, x + i + (p)*AEO_SIZE(type));
#define MOVE(type, p)  AEO_AT(type, row + (p)*AEO_SIZE(type)) += v[p] * a[r];
#define MOVE_ROWS(type, ABREAST, EACH)                                                                                 \
    for (; i + (ABREAST)*AEO_SIZE(type) <= n; i += (ABREAST)*AEO_SIZE(type)) {                                         \
        aeo_##type##_t v[ABREAST];                                                                                     \
        aeo_real_t *row = rows + i;                                                                                    \
        EACH(FETCH, type)                                                                                              \
        for (size_t r = 0; r < count; r++) {                                                                           \
            EACH(MOVE, type)                                                                                           \
            row += n;                                                                                                  \
        }                                                                                                              \
    }
void aeo_linalg_move_rows(aeo_real_t *AEO_RESTRICT rows, const aeo_real_t *AEO_RESTRICT a,
                          const aeo_real_t *AEO_RESTRICT x, size_t n, size_t count)
{
    size_t i = 0;
#if !AEO_SMALL
    MOVE_ROWS(lanes, AEO_ABREAST, AEO_EACH_OF)
#endif
    MOVE_ROWS(few, 1, AEO_ALONE)
#if AEO_FEW > 1
    MOVE_ROWS(one, 1, AEO_ALONE)
#endif
}
#undef FETCH
#undef MOVE
#undef MOVE_ROWS

void aeo_linalg_scale(aeo_real_t a, const aeo_real_t *AEO_RESTRICT x, aeo_real_t *AEO_RESTRICT y, size_t count)
{
    size_t i = 0;
#if AEO_LANES > 1
    for (; i + AEO_LANES <= count; i += AEO_LANES) {
        AEO_AT(lanes, y + i) = a * AEO_FROM(lanes, x + i);
    }
#endif
    for (; i < count; i++) {
        y[i] = a * x[i];
    }
}

/* SPDX-License-Identifier: MIT */
