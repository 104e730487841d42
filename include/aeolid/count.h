/* count.h: counters that stay at their largest value, in the library and in ports.
 *
 * MODEL
 *   c(k + 1) = min(c(k) + n, 2^32 - 1). At 1,000 events a second a counter that started again at 0 would do so after 50
 *   days, and whoever compares two readings would take that for a restart.
 *
 * CONTRACT
 *   A counter never decreases. Cost: a comparison and an addition; no memory of its own.
 */
#ifndef AEOLID_COUNT_H
#define AEOLID_COUNT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Add `events` to `*counter`, up to UINT32_MAX; `counter` must not be null. */
static inline void aeo_count_add(uint32_t *counter, uint32_t events)
{
    *counter += events < UINT32_MAX - *counter ? events : UINT32_MAX - *counter;
}

/* Add one to `*counter`, up to UINT32_MAX; `counter` must not be null. */
static inline void aeo_count_up(uint32_t *counter)
{
    if (*counter < UINT32_MAX) {
        *counter += 1u;
    }
}

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
