#include "spread.h"

#include <string.h>

#define GROUP_MAX 256u
#define BURST     16u /* frames lost in a row that are to hit distant parameters */
#define REACH     16u /* how far from the golden section a stride is looked for */

static uint32_t find_divisor(uint32_t a, uint32_t b)
{
    while (b != 0u) {
        const uint32_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/* Positions up to 15 apart are at least N / 40 parameters apart. */
static int spreads(uint32_t count, uint32_t stride)
{
    uint32_t at = 0, k;
    for (k = 1; k < BURST; k++) {
        at = (at + stride) % count; /* stride < count <= 65536 */
        if ((at < count - at ? at : count - at) * 40u < count) {
            return 0;
        }
    }
    return 1;
}

/* Nearest to 0.618 N that is coprime with N and spreads; from N = 16 on there is one within 16 (checked for every N).
 * Below that the nearest coprime one, which may be 1. */
static uint32_t choose_stride(uint32_t count)
{
    const uint32_t centre = (count * 618u + 500u) / 1000u; /* 65536 * 618 < 2^32 */
    uint32_t fallback = 0, i;
    for (i = 0; i < 2u * REACH + 1u; i++) {
        const uint32_t shift = (i + 1u) / 2u;
        const uint32_t stride =
            i % 2u == 1u ? centre + shift : centre - shift; /* wraps below 0: then not below count */
        if (stride < 1u || (stride >= count && count > 1u) || find_divisor(count, stride) != 1u) {
            continue;
        }
        fallback = fallback == 0u ? stride : fallback;
        if (spreads(count, stride)) {
            return stride;
        }
    }
    return fallback == 0u ? 1u : fallback;
}

void aeo_spread_choose(aeo_spread_t *self, uint32_t count, uint32_t percent)
{
    self->count = count;
    self->stride = choose_stride(count);
    self->groups = (count + GROUP_MAX - 1u) / GROUP_MAX;
    self->repairs = 0;
    if (percent > 0u) {
        self->repairs = count * percent / 100u + 8u * self->groups;
        if (self->repairs > 65535u) {
            self->repairs = 65535u; /* the repair number has 16 bits */
        }
    }
}

uint32_t aeo_spread_index(const aeo_spread_t *self, uint32_t position)
{
    return (position * self->stride) % self->count; /* 65535 * 40518 < 2^32; count >= 1 */
}

/* Add one block to the sum, or what there is of it. */
static void add_block(const uint32_t *theta, uint32_t parameters, uint32_t width, uint32_t block, uint32_t *sum)
{
    const uint32_t first = block * width; /* below parameters <= 65536, because block < ceil(parameters / width) */
    const uint32_t left = parameters - first < width ? parameters - first : width;
    uint32_t i;
    for (i = 0; i < left; i++) {
        sum[i] ^= theta[first + i];
    }
}

void aeo_spread_repair(const aeo_spread_t *self, const uint32_t *theta, uint32_t parameters, uint32_t width,
                       uint16_t repair, uint32_t *sum)
{
    const uint32_t group = repair % self->groups;                     /* groups >= 1 */
    const uint32_t hop = (self->groups * self->stride) % self->count; /* 256 * 40518 < 2^32 */
    uint32_t at = (group * self->stride) % self->count;
    uint32_t position, member = 0, set = 0;
    memset(sum, 0, width * sizeof *sum);
    for (position = group; position < self->count; position += self->groups) {
        if (member % 32u == 0u) {
            set = aeo_frame_repair_set(repair, member / 32u);
        }
        if (((set >> (member % 32u)) & 1u) != 0u) {
            if (width == 1u) { /* 19 instructions a member instead of 26 */
                sum[0] ^= theta[at];
            } else {
                add_block(theta, parameters, width, at, sum);
            }
        }
        at += hop; /* both below count: one subtraction brings it back */
        at -= at >= self->count ? self->count : 0u;
        member++;
    }
}
