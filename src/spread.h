/* spread.h (internal): orders the parameters of a snapshot and combines them into repair frames.
 *
 * MODEL
 *   What is spread are blocks of `width` parameters, 1 on classic CAN and 14 on CAN FD; B = ceil(N / width). Position q
 *   carries block q S mod B; group q mod G; repair k combines the members j of group k mod G, positions k mod G + j G,
 *   for which bit j of aeo_frame_repair_set is set, word by word. See stream.h.
 *
 * CONTRACT
 *   Memory: none. A repair costs at most 256 width exclusive ors. Pure; may be called from anywhere. No aeo_real_t: one
 *   symbol serves both builds.
 */
#ifndef AEOLID_SPREAD_H
#define AEOLID_SPREAD_H

#include <aeolid/stream.h>

/* Fill self for count = 1 ... 65536 blocks and percent = 0 ... 100 repair frames. */
void aeo_spread_choose(aeo_spread_t *self, uint32_t count, uint32_t percent);

/* Return the block at position 0 ... count-1. */
uint32_t aeo_spread_index(const aeo_spread_t *self, uint32_t position);

/* Write the values of one repair frame over theta (parameters words, by index) into sum (width words); what the last
 * block lacks counts as zero. */
void aeo_spread_repair(const aeo_spread_t *self, const uint32_t *theta, uint32_t parameters, uint32_t width,
                       uint16_t repair, uint32_t *sum);

#endif
/* SPDX-License-Identifier: MIT */
