/* count.h: counters that stay at their largest value, in the library and in ports.
 *
 * CONTRACT
 *   A counter never decreases: at 1,000 events a second one that started again at 0 would do so after 50 days, and
 *   whoever compares two readings would take the difference for a restart. Cost: a comparison and an addition.
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
