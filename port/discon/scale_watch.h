/* scale_watch.h: tells which channels a filter hardly sees with the offset and scale that its settings give them.
 *
 * MODEL
 *   x = (value - offset) / scale, mean m and deviation s of its finite values over a block of 60 s (100 samples at
 *   least), by Welford, "Note on a method for calculating corrected sums of squares and products", 1962.
 *     constant    every value has the same bits: its Markov parameters stay at 0, or as undefined as the rest
 *     missing     not one finite value
 *     too small   s < 1/30: with rho = 0.1 the start at zero weighs as much as 90 samples or more, and damping comes
 *                 out too low or a mode is lost (docs/decisions/ports.md has the figures)
 *     too large   s > 30, or |m| > 10: near or beyond the range of 100 scales outside which samples are refused
 *   A block that is constant or missing is told at its end; the others from the second block on, for the first holds
 *   the simulator's start. Where excitation is asked for, blocks lie between its start and its stop. Scheduling channels
 *   are not filtered and therefore not judged.
 *
 * CONTRACT
 *   Memory: the structure, 2.1 kB; nothing is allocated. Operations: a sample 4 flops and a division a channel.
 *   Each kind is told once a channel, in one sentence. Deterministic.
 */
#ifndef AEOLID_DISCON_SCALE_WATCH_H
#define AEOLID_DISCON_SCALE_WATCH_H

#include "settings.h"

#define SCALE_WATCH_TEXT_MAX 512u

typedef enum { WATCH_FINE, WATCH_CONSTANT, WATCH_MISSING, WATCH_SCALE } watch_kind_t;

/* Private but readable in a debugger. */
typedef struct {
    uint32_t count;      /* finite values */
    double mean, square; /* of x: mean, and sum of squared differences from it */
    float first;
    int moved; /* 1: a value differed from the first */
} watch_sums_t;

typedef struct {
    const settings_t *settings;
    uint32_t block;           /* samples that are judged together */
    uint32_t samples, blocks; /* in the block under way, and blocks before it */
    double period_s;
    double from_s, until_s; /* outside nothing is taken */
    watch_sums_t now[SETTINGS_CHANNELS_MAX], before[SETTINGS_CHANNELS_MAX];
    uint8_t told[SETTINGS_CHANNELS_MAX]; /* bit k: kind k has been told */
    unsigned told_channels;              /* of which anything has been told */
} scale_watch_t;

/* Make ready; settings must live on. */
void scale_watch_init(scale_watch_t *self, const settings_t *settings, double sample_time_s);

/* Take one sample (all channels) of time_s, the simulator's; 1 when a block ends with it: judge, then begin anew. */
int scale_watch_take(scale_watch_t *self, const float *value, double time_s);

/* Write the sentence on channel i into `text`; 1, or 0 when there is nothing to tell that has not been told. last 1: no
 * sample comes any more; then 20 samples are enough, and the block before stands in for fewer. */
int scale_watch_judge(scale_watch_t *self, unsigned i, int last, char text[SCALE_WATCH_TEXT_MAX]);

/* Begin the next block. */
void scale_watch_next(scale_watch_t *self);

#endif
/* SPDX-License-Identifier: MIT */
