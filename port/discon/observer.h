/* observer.h: filters and streams what passes between one simulator and one controller.
 *
 * MODEL
 *   call --> sample_clock --> channels --> regressor --> filter --> streamer --> bus
 *   Measured records are taken as the controller gets them, demands as the simulator gets them. The streamer is stepped
 *   at every call on simulated time, so that a call never has many frames to make.
 *   Channels that the filter hardly sees are told on standard error (scale_watch.h), the first and the last call on
 *   standard output: in the simulator's own text.
 *
 * CONTRACT
 *   Memory: the structure, and one array for regressor, filter and snapshot, allocated by observer_start and released
 *   by observer_finish; nothing is allocated in between.
 *   Failures leave the observer off: every call then does nothing. Nothing here touches the array.
 */
#ifndef AEOLID_DISCON_OBSERVER_H
#define AEOLID_DISCON_OBSERVER_H

#include "bus.h"
#include "demands.h"
#include "sample_clock.h"
#include "scale_watch.h"
#include "settings.h"

#include <aeolid/estimator.h>

typedef struct {
    const settings_t *settings;
    unsigned turbine;
    int on;  /* 1: filters and streams */
    int due; /* clock_tick_t of the call under way */
    sample_clock_t clock;
    aeo_estimator_t estimator;
    aeo_stream_t stream;
    bus_t bus;
    scale_watch_t watch;
    aeo_channel_t channel[SETTINGS_CHANNELS_MAX];
    float value[SETTINGS_CHANNELS_MAX]; /* of the sample under way */
    uint32_t period_us;
    uint32_t snapshot_samples; /* between two snapshots; 0 none */
    uint32_t since_snapshot;
    void *memory;
} observer_t;

/* Begin for turbine number `turbine`, whose simulator calls each step_s. settings must live on. Returns 0, else -1 and
 * `why` (room characters) holds a sentence; the observer is off. */
int observer_start(observer_t *self, const settings_t *settings, unsigned turbine, double step_s, char *why,
                   size_t room);

/* Before the controller is called: take the time and the measured records. Returns what the clock says; the clock runs
 * also while the observer is off. */
clock_tick_t observer_before(observer_t *self, const float *swap);

/* After the controller was called: take the demands, filter and stream. */
void observer_after(observer_t *self, const float *swap, const demands_t *demands);

/* Send the last parameters and the end of the stream, close the bus, release the memory. Waits for listeners, at most
 * some seconds. */
void observer_finish(observer_t *self);

/* Close the bus and release the memory at once. */
void observer_drop(observer_t *self);

#endif
/* SPDX-License-Identifier: MIT */
