/* stream_send.h (internal): hands the message under way to the port and charges its time on the bus.
 *
 * MODEL
 *   cost = longest time of a frame of this length on a bus of bits_per_s, in microseconds, rounded up; see frame.h.
 *
 * CONTRACT
 *   Memory: none; message and frame lie in the stream, so that no call chain holds both on its stack. Callers hold the
 *   lock while they use them.
 */
#ifndef AEOLID_STREAM_SEND_H
#define AEOLID_STREAM_SEND_H

#include <aeolid/stream.h>

#ifdef AEO_REAL_DOUBLE
#define aeo_stream_lock      aeo_stream_lock_f64
#define aeo_stream_unlock    aeo_stream_unlock_f64
#define aeo_stream_cost_us   aeo_stream_cost_us_f64
#define aeo_stream_has_ended aeo_stream_has_ended_f64
#define aeo_stream_send      aeo_stream_send_f64
#endif

/* Keep the other context out, let it in again; nothing where the port has no lock. */
void aeo_stream_lock(const aeo_stream_t *self);
void aeo_stream_unlock(const aeo_stream_t *self);

/* Return the cost of a classic frame (length 8) or of a CAN FD frame (12 ... 64); 0 without a limit. */
uint32_t aeo_stream_cost_us(const aeo_stream_config_t *config, unsigned length);

/* Return 1 once the closing frames have left: nothing follows them, and no snapshot is under way. */
int aeo_stream_has_ended(const aeo_stream_t *self);

/* Pack self->message and offer it to the port; 1 when the port took it: counted and charged then. */
int aeo_stream_send(aeo_stream_t *self);

#endif
/* SPDX-License-Identifier: MIT */
