/* channel.h: says what one channel is, once, for the regressor that scales it and the stream that names it.
 *
 * MODEL
 *   x_scaled = (x - offset) / scale; a sample with minimum <= x <= maximum is plausible.
 *
 * CONTRACT
 *   Memory: the structure, of the caller. An array of channels has the inputs first, then the outputs, then, for a
 *   stream, what it sends besides. A regressor copies the numbers; a stream reads names and units at every description, so for
 *   it the array and its texts must live on.
 */
#ifndef AEOLID_CHANNEL_H
#define AEOLID_CHANNEL_H

#include "aeolid/config.h"

typedef struct {
    const char *name;  /* ASCII, cut after 32 characters; null: none */
    const char *unit;  /* ASCII, cut after 16 characters; null: none */
    aeo_real_t offset; /* in the channel's unit. Start: the mean value */
    aeo_real_t scale; /* above 0, in the channel's unit. Start: the standard deviation. Scales that differ from the true
                          size by more than 100 cost that much of the float's precision */
    aeo_real_t minimum; /* plausible range, in the channel's unit; both 0: none. Beyond it lies a sensor's fault */
    aeo_real_t maximum; /* not below the minimum */
} aeo_channel_t;

#endif
/* SPDX-License-Identifier: MIT */
