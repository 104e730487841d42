/* watch.c: the levels and the verdict of watch.h. */
#include "aeolid/watch.h"

#include "aeolid/regressor.h"
#include "linalg.h"

/* What follows has its reasons in watch.h. A level that starts at LEVEL_START reaches any other within the first two
 * blocks: they move it by e^8 up and e^-16 down each. */
#define LEVEL_MIN   AEO_REAL(1e-12)
#define LEVEL_MAX   AEO_REAL(1)
#define LEVEL_START AEO_REAL(1e-3)
#define STEP_MAX    AEO_REAL(16) /* squared */
#define RATE_FIRST  AEO_REAL(8)
#define RATE        AEO_REAL(0.125)
#define RATE_QUIET  (AEO_REAL(0.125) / AEO_REAL(64))
#define RATE_MAX    AEO_REAL(0.25) /* so that 1 - 2 r stays above 0 */
/* An r that 1 + r would lose, less than 32 rounding errors, moves levels at one sample in RARE, by RARE times as much: it
 * is 2^-9 roundings of 1 at least, so that is 4 at least and 1/64 at most. Samples are drawn by the golden ratio's share
 * of their number: evenly spaced ones would see a periodic output in one phase alone. */
#define RATE_LEAST   (AEO_REAL(32) * AEO_REAL_EPSILON)
#define RARE         4096
#define RARE_SHIFT   20u /* 2^32 / 2^20 = RARE */
#define GOLDEN_RATIO UINT32_C(0x9E3779B9)
#define FIRST        2u
#define BLOCK_MIN    16u
#define BLOCK_MAX    (UINT32_C(1) << 26) /* 32 outputs of each still count within 32 bits */
#define MOVED_SHARE  10u
#define HELD_MAX     AEO_REAL(100)
/* Powers are at most 1024 1e12, and held at most 2^27 of them with forgetting; withheld samples may add for ever, and
 * half of the largest float is out of their reach. */
#define HELD_LIMIT AEO_REAL(1e38)

enum { HELD, BROUGHT, LEVELS };

void aeo_watch_forget(aeo_watch_t *self, aeo_real_t *words, aeo_real_t held)
{
    self->age = 0u;
    self->moved = 0u;
    self->withheld = 0u;
    self->suspected = 0u;
    words[HELD] = held;
    words[BROUGHT] = AEO_REAL(0);
}

void aeo_watch_start(aeo_watch_t *self, aeo_real_t *words, size_t outputs)
{
    aeo_watch_forget(self, words, AEO_REAL(0));
    self->blocks = 0u;
    words += LEVELS;
    for (size_t i = 0; i < outputs; i++) {
        words[i] = LEVEL_START;
        words[outputs + i] = AEO_REAL(0);
    }
}

/* Count the outputs' steps that passed their levels, and move those by r up or 2 r down. */
static void follow_outputs(aeo_watch_t *self, aeo_real_t *level, size_t outputs, const aeo_real_t *y, aeo_real_t r)
{
    if (r < RATE_LEAST) {
        r *= (self->age * GOLDEN_RATIO & UINT32_C(0xFFFFFFFF)) >> RARE_SHIFT == 0u ? AEO_REAL(RARE) : AEO_REAL(0);
    }
    const aeo_real_t up = AEO_REAL(1) + r, down = AEO_REAL(1) - AEO_REAL(2) * r;
    for (size_t i = 0; i < outputs; i++) {
        aeo_real_t *const last = level + outputs;
        const aeo_real_t d = y[i] - *last, power = d * d; /* at most 4e12 */
        *last = y[i];
        if (power > *level) {
            self->moved++; /* at most 32 2^26 < 2^32 */
            if (power < STEP_MAX) {
                *level = *level * up < LEVEL_MAX ? *level * up : LEVEL_MAX;
            }
        } else if (*level > LEVEL_MIN) {
            *level *= down;
        }
        level++;
    }
}

/* The block is over: return 1 when it and the one before are suspect. */
static int judge_block(aeo_watch_t *self, const aeo_real_t *words, size_t outputs, aeo_real_t rate)
{
    const int lively = self->moved / (uint32_t)outputs >= self->age / MOVED_SHARE; /* outputs >= 1 */
    const int overfull = words[HELD] * (aeo_real_t)self->age * rate > HELD_MAX * words[BROUGHT];
    const int suspect = lively && (self->withheld > self->age / 2u || overfull);
    const int twice = suspect && self->suspected != 0u;
    self->suspected = suspect && !twice ? 1u : 0u;
    return twice;
}

int aeo_watch_take(aeo_watch_t *self, aeo_real_t *words, size_t outputs, const aeo_real_t *y, aeo_real_t power,
                   aeo_real_t lambda, int withheld)
{
    const aeo_real_t rate = AEO_REAL(1) - lambda; /* exact, and above 0 */
    aeo_real_t r = rate * (self->blocks < FIRST ? RATE_FIRST : withheld ? RATE_QUIET : RATE);
    if (r > RATE_MAX) {
        r = RATE_MAX;
    }
    follow_outputs(self, words + LEVELS, outputs, y, r);
    words[HELD] = (withheld ? words[HELD] : lambda * words[HELD]) + power;
    words[BROUGHT] += power;
    self->withheld += withheld > 1 ? 1u : 0u;
    self->age++;
    if (self->age < BLOCK_MIN || ((aeo_real_t)self->age * rate < AEO_REAL(1) && self->age < BLOCK_MAX)) {
        return 0;
    }
    const int verdict = judge_block(self, words, outputs, rate);
    self->age = 0u;
    self->moved = 0u;
    self->withheld = 0u;
    self->blocks += self->blocks < FIRST ? 1u : 0u;
    words[BROUGHT] = AEO_REAL(0);
    return verdict;
}

int aeo_watch_holds(const aeo_watch_t *self, const aeo_real_t *words, size_t outputs)
{
    if (self->age > BLOCK_MAX || self->withheld > self->age || self->moved > self->age * outputs ||
        self->blocks > FIRST || self->suspected > 1u || words[HELD] < AEO_REAL(0) || words[HELD] > HELD_LIMIT ||
        words[BROUGHT] < AEO_REAL(0) || words[BROUGHT] > HELD_LIMIT) {
        return 0;
    }
    for (size_t i = 0; i < outputs; i++) {
        const aeo_real_t level = words[LEVELS + i];
        if (!(level > LEVEL_MIN / AEO_REAL(4) && level <= LEVEL_MAX)) {
            return 0;
        }
    }
    return aeo_linalg_all_within(words + LEVELS + outputs, outputs, AEO_SCALED_MAX);
}
/* SPDX-License-Identifier: MIT */
