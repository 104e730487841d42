/* guard.c: the levels of guard.h. */
#include "guard.h"

#include "aeolid/regressor.h"

#include "root.h"

/* Bounds from which nothing below overflows in float: amplitudes are cut at 1e6, so powers are at most 1e12, what
 * should be at most 1e12 SHARE_MAX = 1e18, and four limits of a hundredfold 4e20. */
#define AMPLITUDE_MAX AEO_SCALED_MAX
#define POWER_MAX     AEO_REAL(1e12)
#define SHARE_MAX     AEO_REAL(1e6)
/* A channel quieter than a millionth of its scale has no level of its own; this also keeps the divisor off 0. */
#define POWER_MIN AEO_REAL(1e-12)

/* The memory in samples; how much one sample may count, as a multiple of the limit: an outlier disturbs the p
 * predictions after it too, and with p = 10 all together add up to 11/64 of 4 limits; how fast the share is believed to
 * have fallen or risen; how far a residual may stand out, in roots of the level. Chosen by experiment: docs/decisions. */
#define MEMORY      AEO_REAL(64)
#define OUTLIER_MAX AEO_REAL(4)
#define FALL        AEO_REAL(256)
#define RISE        AEO_REAL(4096)
#define STAND_OUT   AEO_REAL(6)
/* How much one sample may count for livelier data: 32 deviations raise their level 17 times; of a reading of 1e6 nothing
 * more is believed either, or what it made of theta would pass unnoticed for 18 memories of the level. */
#define LIVELIER_MAX AEO_REAL(1024)

enum { POWER, REST, VARX, SHARE };

static aeo_real_t at_least(aeo_real_t x, aeo_real_t low)
{
    return x > low ? x : low;
}

static aeo_real_t at_most(aeo_real_t x, aeo_real_t high)
{
    return x < high ? x : high;
}

static aeo_real_t square_of(aeo_real_t x)
{
    const aeo_real_t cut = at_most(at_least(x, -AMPLITUDE_MAX), AMPLITUDE_MAX);
    return cut * cut;
}

/* What the innovation power should be: no more than VARX had, or, where the data have become livelier since, than its
 * usual share of what is left without the terms in e. */
static aeo_real_t find_level(const aeo_real_t *levels)
{
    return at_least(at_least(levels[VARX], levels[SHARE] * levels[REST]), POWER_MIN);
}

static aeo_real_t find_share(const aeo_real_t *levels)
{
    return at_most(levels[POWER] / at_least(levels[REST], POWER_MIN), SHARE_MAX);
}

int aeo_guard_watch(aeo_real_t *levels, aeo_real_t innovation, aeo_real_t rest, uint32_t since, uint32_t wait,
                    aeo_real_t ratio)
{
    const uint32_t first = wait / 2u;
    const aeo_real_t power = square_of(innovation), left = square_of(rest);
    if (since > wait) {
        const aeo_real_t most = LIVELIER_MAX * at_least(levels[REST], POWER_MIN); /* at most 4e15 */
        levels[REST] += (at_most(left, most) - levels[REST]) / MEMORY;
        const aeo_real_t limit = ratio * find_level(levels), share = find_share(levels);
        levels[POWER] += (at_most(power, OUTLIER_MAX * limit) - levels[POWER]) / MEMORY;
        levels[SHARE] += (share - levels[SHARE]) / (share < levels[SHARE] ? FALL : RISE);
        return levels[POWER] > limit;
    }
    if (since > first) {
        const aeo_real_t count = (aeo_real_t)(since - first); /* >= 1 */
        levels[VARX] += (power - levels[VARX]) / count;
        levels[REST] += (left - levels[REST]) / count;
        levels[POWER] = levels[VARX];
        levels[SHARE] = find_share(levels);
    }
    return 0;
}

aeo_real_t aeo_guard_limit(const aeo_real_t *levels)
{
    return at_most(STAND_OUT * AEO_SQRT(find_level(levels)), AMPLITUDE_MAX); /* level >= POWER_MIN > 0 */
}

int aeo_guard_holds(const aeo_real_t *levels, size_t count)
{
    for (size_t i = 0; i < count * AEO_GUARD_WORDS; i++) {
        if (levels[i] < AEO_REAL(0) || levels[i] > AEO_REAL(2) * POWER_MAX) {
            return 0;
        }
    }
    return 1;
}
/* SPDX-License-Identifier: MIT */
