/* guard.c: the levels of guard.h. */
#include "guard.h"

#include "aeolid/regressor.h"
#include "linalg.h"

/* Bounds from which nothing below overflows in float. Innovations are at most 1e12, so their squares fit, and powers are
 * cut at 1e12; squared changes of y are at most (2e6)^2. A level is at most 1e12 RISE_MAX = 1e18, four limits 4e20. */
#define POWER_MAX AEO_REAL(1e12)
#define RISE_MAX  AEO_REAL(1e6)
/* A channel quieter than a millionth of its scale has no level of its own; this is also what keeps divisors off 0. */
#define POWER_MIN AEO_REAL(1e-12)

/* The memory in samples; how much one sample may count, as a multiple of the limit: an outlier disturbs the p predictions
 * after it too, and with p = 10 all together add up to 11/64 of 4 limits; how far a residual may stand out, in roots of
 * the level, before it is cut. Chosen by experiment: DESIGN.md. */
#define MEMORY      AEO_REAL(64)
#define OUTLIER_MAX AEO_REAL(4)
#define STAND_OUT   AEO_REAL(6)

static aeo_real_t at_least(aeo_real_t x, aeo_real_t low)
{
    return x > low ? x : low;
}

static aeo_real_t at_most(aeo_real_t x, aeo_real_t high)
{
    return x < high ? x : high;
}

/* The innovation power that VARX would have on an output today: that of its start, times what y has become livelier.
 * level points at the output's y_{k-1}; its other levels lie l apart. */
static aeo_real_t find_level(const aeo_real_t *level, size_t l)
{
    const aeo_real_t rise = level[2 * l] / at_least(level[4 * l], POWER_MIN);
    return at_least(level[3 * l], POWER_MIN) * at_most(at_least(rise, AEO_REAL(1)), RISE_MAX);
}

int aeo_guard_watch(aeo_real_t *levels, size_t l, const aeo_real_t *innovation, const aeo_real_t *y, uint32_t since,
                    uint32_t wait, aeo_real_t ratio)
{
    const uint32_t first = wait / 2u;
    int grown = 0;
    for (size_t i = 0; i < l; i++) {
        aeo_real_t *const level = levels + i;
        const aeo_real_t step = y[i] - level[0], change = step * step;
        const aeo_real_t power = at_most(innovation[i] * innovation[i], POWER_MAX);
        level[0] = y[i];
        if (since > wait) {
            level[2 * l] += (change - level[2 * l]) / MEMORY;
            const aeo_real_t limit = ratio * find_level(level, l);
            level[l] += (at_most(power, OUTLIER_MAX * limit) - level[l]) / MEMORY;
            grown |= level[l] > limit;
        } else if (since > first) {
            const aeo_real_t count = (aeo_real_t)(since - first); /* >= 1 */
            level[l] += (power - level[l]) / count;
            level[2 * l] += (change - level[2 * l]) / count;
            level[3 * l] = level[l];
            level[4 * l] = level[2 * l];
        }
    }
    return grown;
}

unsigned aeo_guard_limit(const aeo_real_t *levels, size_t l, const aeo_real_t *residual, aeo_real_t *feedback)
{
    unsigned cut = 0;
    for (size_t i = 0; i < l; i++) {
        aeo_real_t limit = AEO_SCALED_MAX;
        if (levels != NULL) {
            limit = at_most(limit, STAND_OUT * AEO_SQRT(find_level(levels + i, l))); /* level >= POWER_MIN > 0 */
        }
        feedback[i] = at_most(at_least(residual[i], -limit), limit);
        cut += residual[i] > limit || residual[i] < -limit ? 1u : 0u;
    }
    return cut;
}

int aeo_guard_hold(const aeo_real_t *levels, size_t l)
{
    if (!aeo_linalg_all_within(levels, l, AEO_SCALED_MAX)) {
        return 0;
    }
    for (size_t i = l; i < AEO_GUARD_WORDS(l); i++) {
        if (levels[i] < AEO_REAL(0) || levels[i] > AEO_REAL(8) * POWER_MAX) {
            return 0;
        }
    }
    return 1;
}
/* SPDX-License-Identifier: MIT */
