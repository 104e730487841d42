/* describe.h (internal): lists the description of a stream, one message a slot.
 *
 * MODEL
 *   Slots run by tag and then by index: fixed items, offsets, scales, name parts, unit parts. The configuration hash is
 *   the CRC-32 over the words tag + 65536 * index and value of every slot that is not empty, but slot 0, which carries
 *   it.
 *
 * CONTRACT
 *   Memory: none. A slot costs at most 48 operations; the hash all slots. Pure; may be called from anywhere.
 */
#ifndef AEOLID_DESCRIBE_H
#define AEOLID_DESCRIBE_H

#include <aeolid/stream.h>

#ifdef AEO_REAL_DOUBLE
#define aeo_describe_is_sound aeo_describe_is_sound_f64
#define aeo_describe_channels aeo_describe_channels_f64
#define aeo_describe_slots    aeo_describe_slots_f64
#define aeo_describe          aeo_describe_f64
#define aeo_describe_hash     aeo_describe_hash_f64
#endif

/* Return inputs + outputs + scheduling. */
unsigned aeo_describe_channels(const aeo_stream_config_t *config);

/* Return 1 when every number the description carries is finite as binary32, the scales and the sample time above 0. */
int aeo_describe_is_sound(const aeo_stream_config_t *config);

/* Return the number of slots, empty ones included. */
uint32_t aeo_describe_slots(const aeo_stream_config_t *config);

/* Write slot `slot` into message and return 1; return 0 when it is empty: a name shorter than its parts. */
int aeo_describe(const aeo_stream_config_t *config, uint32_t hash, uint32_t slot, aeo_message_t *message);

/* Return the configuration hash. */
uint32_t aeo_describe_hash(const aeo_stream_config_t *config);

#endif
/* SPDX-License-Identifier: MIT */
