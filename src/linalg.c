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
    aeo_real_t sum = aeo_lanes_sum_with(part, x, y, count >= 4u);
    for (size_t i = count & 4u; i < count; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}
#undef CLEAR
#undef TERM
#undef BEGIN
#undef ADD

int aeo_linalg_find_error(const aeo_real_t *rows, const aeo_real_t *z, size_t n, const aeo_real_t *y, aeo_real_t *error,
                          size_t count)
{
    for (size_t i = 0; i < count; i++) {
        error[i] = y[i] - aeo_linalg_dot(rows, z, n);
        rows += n;
    }
    return aeo_linalg_all_within(error, count, AEO_LINALG_ERROR_MAX);
}

void aeo_linalg_axpy(aeo_real_t a, const aeo_real_t *AEO_RESTRICT x, aeo_real_t *AEO_RESTRICT y, size_t count)
{
    const aeo_lanes_t factor = aeo_lanes_spread(a);
    size_t i = 0;
#define MOVE(p)                                                                                                        \
    aeo_lanes_store(y + i + (p)*AEO_LANES,                                                                             \
                    aeo_lanes_load(y + i + (p)*AEO_LANES) + factor * aeo_lanes_load(x + i + (p)*AEO_LANES));
    for (; i + AEO_SUM_LANES <= count; i += AEO_SUM_LANES) {
        AEO_EACH_PART(MOVE)
    }
#undef MOVE
    for (; i < count; i++) {
        y[i] += a * x[i];
    }
}

void aeo_linalg_scale(aeo_real_t a, const aeo_real_t *AEO_RESTRICT x, aeo_real_t *AEO_RESTRICT y, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        y[i] = a * x[i];
    }
}

/* SPDX-License-Identifier: MIT */
