/* port.h: carries frames from the streamer to a CAN controller: the only thing the library needs from its surroundings.
 *
 * MODEL
 *   Three contexts; a simple system runs all in the first one.
 *
 *     control task (every sample)       timer or background task           interrupt of the CAN controller
 *     ---------------------------       ------------------------           -------------------------------
 *     filter update                     aeo_stream_step                    mailbox free: takes the next frame out of
 *     aeo_stream_sample     --send-->                       --send-->      the port's own ring
 *     aeo_stream_snapshot
 *         |                                 |                                  |
 *         +-------- lock / unlock ----------+                                  +-- belongs to the port alone; the
 *           (only when the two differ)                                             library never runs in here
 *
 * CONTRACT
 *   Memory: the structure below, copied by aeo_stream_init. No callback may block: `send` hands over a copy of the
 *   frame or refuses. The streamer calls nothing but these four. Status codes -48 ... -63 are for ports to define.
 */
#ifndef AEOLID_PORT_H
#define AEOLID_PORT_H

#include <aeolid/frame.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    void *context; /* handed to every callback; may be null */

    /* Take a copy of `frame` (valid during the call only) and return 1, or return 0 when there is no room now. Never
     * waits. Frames with one identifier must leave in the order given. Must not be null. */
    int (*send)(void *context, const aeo_can_frame_t *frame);

    /* Return a microsecond clock that wraps at 2^32. Null: the streamer counts one sample time for each step. */
    uint32_t (*time_us)(void *context);

    /* Keep the other context out and let it in again; never nested; held while one frame is made
     * and sent. Both null where aeo_stream_step runs in the control task. */
    void (*lock)(void *context);
    void (*unlock)(void *context);
} aeo_port_t;

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
