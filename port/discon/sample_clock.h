/* sample_clock.h: turns the times at which a simulator calls into samples of a steady rate.
 *
 * MODEL
 *   step n = round((t - t_0) / dt), dt = record 3; a sample is due when n is newer than all before and a multiple of
 *   `decimation`; its index is n / decimation. So
 *     a time that stands still, or goes back by up to two samples and comes again (a simulator that repairs a step): no
 *     second sample;
 *     a step that never comes: a hole, which regressor and host see as missing samples;
 *     a time that goes back further, or jumps ahead by more than 10,000 samples: t_0 is set anew and one index is left
 *     out, so that no window spans the jump.
 *   A float holds t well enough for 4,000,000 calls (11 h at 100 Hz); after that steps are missed or doubled.
 *
 * CONTRACT
 *   Memory: the structure. Operations: a division and a rounding.
 */
#ifndef AEOLID_DISCON_SAMPLE_CLOCK_H
#define AEOLID_DISCON_SAMPLE_CLOCK_H

#include <stdint.h>

typedef enum {
    CLOCK_REPEATED, /* nothing new: also for a time that is no number */
    CLOCK_STEP,     /* a new step without a sample */
    CLOCK_SAMPLE,   /* sample `index` is due */
    CLOCK_JUMPED    /* sample `index` is due, the first after a jump */
} clock_tick_t;

typedef struct {
    double step_s;
    unsigned decimation;
    double origin_s;
    int64_t newest;   /* step */
    uint32_t base;    /* index of step 0 */
    uint32_t index;   /* of the newest sample */
    uint64_t elapsed; /* steps since the first call, repeated ones not counted */
    int running;      /* 1 after the first call */
} sample_clock_t;

/* Make ready; 0, or -1 where step_s is no time step (1e-6 ... 1000 s). */
int sample_clock_init(sample_clock_t *self, double step_s, unsigned decimation);

/* Take the time of one call. */
clock_tick_t sample_clock_take(sample_clock_t *self, double time_s);

#endif
/* SPDX-License-Identifier: MIT */
