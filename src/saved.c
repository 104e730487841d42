/* saved.c: the helpers of saved.h. */
#include "saved.h"

aeo_real_t *aeo_saved_put_u32(aeo_real_t *to, uint32_t value)
{
    to[0] = (aeo_real_t)(value >> 16);
    to[1] = (aeo_real_t)(value & 0xFFFFu);
    return to + 2;
}

const aeo_real_t *aeo_saved_get_u32(const aeo_real_t *from, uint32_t *value, int *sound)
{
    uint32_t halves[2] = {0, 0};
    for (int i = 0; i < 2; i++) {
        if (!(from[i] >= AEO_REAL(0) && from[i] <= AEO_REAL(65535))) {
            *sound = 0;
            continue;
        }
        halves[i] = (uint32_t)from[i];
        if (from[i] > (aeo_real_t)halves[i]) {
            *sound = 0; /* not a whole number */
        }
    }
    *value = halves[0] << 16 | halves[1];
    return from + 2;
}

aeo_status_t aeo_saved_judge_head(const aeo_real_t *saved, const aeo_real_t *expected, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (saved[i] < expected[i] || saved[i] > expected[i]) {
            return i == 0 ? AEO_E_VERSION : AEO_E_MISMATCH;
        }
    }
    return AEO_OK;
}
/* SPDX-License-Identifier: MIT */
