#include "spread.h"

#define GROUP_MAX 256u

static uint32_t find_divisor(uint32_t a, uint32_t b)
{
    while (b != 0u) {
        const uint32_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/* Largest stride not above 0.618 N that is coprime with N; 1 always is, so the search ends. */
static uint32_t choose_stride(uint32_t count)
{
    uint32_t stride = (count * 618u) / 1000u; /* 65536 * 618 < 2^32 */
    while (stride > 1u && find_divisor(count, stride) != 1u) {
        stride--;
    }
    return stride > 0u ? stride : 1u;
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
    return (position * self->stride) % self->count; /* 65535 * 40502 < 2^32; count >= 1 */
}

uint32_t aeo_spread_repair(const aeo_spread_t *self, const uint32_t *theta, uint16_t repair)
{
    const uint32_t group = repair % self->groups;                        /* groups >= 1 */
    const uint32_t hop = (self->groups * self->stride) % self->count;    /* 256 * 40502 < 2^32 */
    uint32_t at = (group * self->stride) % self->count;
    uint32_t position, member = 0, set = 0, sum = 0;
    for (position = group; position < self->count; position += self->groups) {
        if (member % 32u == 0u) {
            set = aeo_frame_repair_set(repair, member / 32u);
        }
        if (((set >> (member % 32u)) & 1u) != 0u) {
            sum ^= theta[at];
        }
        at += hop; /* both below count: one subtraction brings it back */
        at -= at >= self->count ? self->count : 0u;
        member++;
    }
    return sum;
}
