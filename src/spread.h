/* spread.h (internal): orders the parameters of a snapshot and combines them into repair frames.
 *
 * MODEL
 *   Position q carries parameter q S mod N; group q mod G; repair k combines the members j of group k mod G, positions
 *   k mod G + j G, for which bit j of aeo_frame_repair_set is set. See stream.h.
 *
 * CONTRACT
 *   Memory: none. A repair costs at most 256 exclusive ors. Pure; may be called from anywhere. No aeo_real_t: one
 *   symbol serves both builds.
 */
#ifndef AEOLID_SPREAD_H
#define AEOLID_SPREAD_H

#include <aeolid/stream.h>

/* Fill self for count = 1 ... 65536 parameters and percent = 0 ... 100 repair frames. */
void aeo_spread_choose(aeo_spread_t *self, uint32_t count, uint32_t percent);

/* Return the parameter at position 0 ... count-1. */
uint32_t aeo_spread_index(const aeo_spread_t *self, uint32_t position);

/* Return the value of one repair frame over theta (count words, by parameter index). */
uint32_t aeo_spread_repair(const aeo_spread_t *self, const uint32_t *theta, uint16_t repair);

#endif
/* SPDX-License-Identifier: MIT */
