#include "observer.h"

#include "announce.h"

#include "../common/filter_refusal.h"
#include "../common/method_names.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FRAME_BITS    160.0
#define HEALTH_EVERY  10.0   /* samples between two health frames */
#define DESCRIBE_S    10.0   /* what a late joiner waits at most for the description */
#define FINISH_STEPS  200000 /* calls' worth of simulated time that the end of the stream may take */
#define FINISH_PAUSES 500    /* of 2 ms in which a bus that takes nothing may hold up the end */

static int fail(observer_t *self, const char *what, char *why, size_t room)
{
    (void)snprintf(why, room, "%s", what);
    observer_drop(self);
    return -1;
}

/* ---- start ------------------------------------------------------------------------------------------------------- */

static aeo_estimator_config_t describe(const observer_t *self)
{
    const settings_t *s = self->settings;
    aeo_estimator_config_t config;
    memset(&config, 0, sizeof config);
    config.inputs = (uint16_t)s->taps[ROLE_INPUT];
    config.outputs = (uint16_t)s->taps[ROLE_OUTPUT];
    config.past = (uint16_t)s->past;
    config.model_set = s->varmax ? AEO_VARMAX : AEO_VARX;
    config.feedthrough = s->feedthrough;
    config.period_us = self->period_us;
    config.channels = self->channel;
    config.forgetting = s->lambda;
    config.regularisation = s->rho;
    config.excitation_min = AEO_REAL(0.05);
    config.growth_max = AEO_REAL(10.0);
    config.varx_samples = s->varx_samples;
    config.forgetting_start = s->lambda < 0.99F ? s->lambda : AEO_REAL(0.99);
    config.forgetting_rate = AEO_REAL(0.99);
    config.guard_ratio = AEO_REAL(4.0);
    return config;
}

static uint16_t choose_steps(double steps)
{
    return (uint16_t)(steps < 1.0 ? 1.0 : steps > 65535.0 ? 65535.0 : steps);
}

/* Calls between two health frames: 10 samples, or as many calls of so many bits as leave them a twentieth of the share. */
static uint16_t choose_health_every(const settings_t *s, double bits)
{
    const double samples = HEALTH_EVERY * s->decimation, calls = bits > 0 ? 20.0 * FRAME_BITS / bits + 1.0 : 0.0;
    return choose_steps(samples > calls ? samples : calls);
}

/* Calls between two descriptions, which take a fifth of the share at most. */
static uint16_t choose_describe_every(const settings_t *s, double step_s)
{
    const double bits = (double)s->bit_rate * s->share / 100.0 * step_s, usual = DESCRIBE_S / step_s;
    const double narrow = bits > 0 ? 5.0 * FRAME_BITS * AEO_STREAM_DESCRIPTION_MAX(settings_taps(s)) / bits : 0.0;
    return choose_steps(usual > narrow ? usual : narrow);
}

/* Frames in one call: those that its time pays for and one more, so that credit saved up leaves over several calls. */
static uint8_t choose_burst(double bits)
{
    const double frames = bits > 0 ? bits / FRAME_BITS + 2.0 : 16.0;
    return (uint8_t)(frames > 16.0 ? 16.0 : frames);
}

static aeo_status_t start_stream(observer_t *self, unsigned turbine, uint32_t parameters, uint32_t *memory)
{
    const settings_t *s = self->settings;
    aeo_stream_config_t config;
    aeo_port_t port;
    memset(&config, 0, sizeof config);
    config.address.base = AEO_FRAME_BASE_EXTENDED;
    config.address.node = (uint8_t)((s->node_id + turbine - 1u) % 254u);
    config.address.extended = 1;
    config.scheduling = (uint8_t)s->taps[ROLE_SCHEDULING];
    config.innovations = (uint8_t)s->innovations;
    config.seal = (uint8_t)(s->seal && !s->fd);
    config.fd = (uint8_t)s->fd;
    config.fd_ratio = (uint8_t)s->fd_ratio;
    config.sample_every = (uint16_t)s->sample_every;
    config.health_every = choose_health_every(s, (double)s->bit_rate * s->share / 100.0 * self->clock.step_s);
    config.describe_every = choose_describe_every(s, self->clock.step_s);
    config.repair_percent = (uint8_t)s->repair;
    config.burst = choose_burst((double)s->bit_rate * s->share / 100.0 * self->clock.step_s);
    config.bits_per_s = (uint32_t)((double)s->bit_rate * s->share / 100.0);
    if (s->share > 0 && config.bits_per_s < (s->fd ? 1000u : 160u)) {
        return AEO_E_BUDGET; /* less is no stream (stream.h) */
    }
    bus_port(&self->bus, &port);
    return aeo_estimator_announce(&self->estimator, &self->stream, &config, &port, memory, parameters);
}

static void name_channels(observer_t *self)
{
    for (unsigned i = 0; i < settings_taps(self->settings); i++) {
        const tap_t *tap = &self->settings->tap[i];
        self->channel[i].name = tap->name;
        self->channel[i].unit = tap->unit;
        self->channel[i].offset = tap->offset;
        self->channel[i].scale = tap->scale;
        self->channel[i].minimum = tap->minimum;
        self->channel[i].maximum = tap->maximum;
    }
}

/* Estimator and streamer in one array. */
static int start_filter(observer_t *self, unsigned turbine, char *why, size_t room)
{
    const settings_t *s = self->settings;
    const aeo_estimator_config_t config = describe(self);
    const aeo_estimator_method_t method = method_of((unsigned)s->method);
    const size_t words = aeo_estimator_words(method, &config), regressors = aeo_estimator_regressors(&config);
    const size_t parameters = regressors * s->taps[ROLE_OUTPUT];
    aeo_real_t *memory;
    aeo_status_t result;
    if (regressors <= AEO_REGRESSOR_LENGTH_MAX) { /* longer ones are refused, and may be more than there is */
        self->memory = calloc(words + AEO_STREAM_WORDS(parameters), sizeof(aeo_real_t));
    }
    memory = self->memory;
    if (memory == NULL || aeo_estimator_init(&self->estimator, method, &config, memory, words) != AEO_OK) {
        char refused[FILTER_REFUSAL_MAX + 8u] = "filter: ";
        filter_refusal_explain(refused + strlen(refused), (unsigned)s->method, &config, memory, words);
        return fail(self, refused, why, room);
    }
    result = start_stream(self, turbine, (uint32_t)parameters, (uint32_t *)(void *)(memory + words));
    if (result == AEO_E_BUDGET) {
        return fail(self, "share: samples, health and description need more than nine tenths; raise it or sample_every",
                    why, room);
    }
    return result == AEO_OK ? 0 : fail(self, "stream: a setting is out of range (stream.h)", why, room);
}

int observer_start(observer_t *self, const settings_t *settings, unsigned turbine, double step_s, char *why,
                   size_t room)
{
    double period_us, samples;
    memset(self, 0, sizeof *self);
    self->settings = settings;
    self->turbine = turbine;
    self->due = CLOCK_REPEATED;
    self->bus.log.fd = -1;
    if (sample_clock_init(&self->clock, step_s, settings->decimation) != 0) {
        return fail(self, "record 3, the time between two calls, is not 1e-6 ... 1000 s; the simulator must set it",
                    why, room);
    }
    period_us = self->clock.step_s * settings->decimation * 1e6 + 0.5;
    if (!(period_us >= 20.0 && period_us <= 1e9)) {
        return fail(self, "decimation: the sample time must be 2e-5 ... 1000 s", why, room);
    }
    self->period_us = (uint32_t)period_us;
    samples = settings->snapshot_s / (period_us * 1e-6) + 0.5;
    samples = settings->snapshot_s > 0 && samples < 1.0 ? 1.0 : samples; /* shorter than a sample: with every one */
    self->snapshot_samples = samples < 4e9 ? (uint32_t)samples : 0u;
    name_channels(self);
    scale_watch_init(&self->watch, settings, period_us * 1e-6);
    if (bus_open(&self->bus, settings, turbine, why, room) != 0) {
        return -1;
    }
    if (start_filter(self, turbine, why, room) != 0) {
        return -1;
    }
    announce_start(self);
    bus_wait(&self->bus, settings->wait_s);
    self->on = 1;
    return 0;
}

/* ---- a call ------------------------------------------------------------------------------------------------------ */

static float mean_of_blades(const float *swap, unsigned first, unsigned second, unsigned third)
{
    const unsigned number[3] = {first, second, third};
    const unsigned blades = records_blades(swap);
    double sum = 0;
    for (unsigned b = 0; b < blades; b++) {
        sum += (double)records_get(swap, number[b]);
    }
    return (float)(sum / blades);
}

static float read_after(const tap_t *tap, const float *swap, const demands_t *demands)
{
    double sum = 0;
    const unsigned blades = records_blades(swap);
    switch (tap->source) {
    case SOURCE_COMMAND:
        return records_individual(swap)
                   ? mean_of_blades(swap, RECORD_COMMAND_1, RECORD_COMMAND_1 + 1, RECORD_COMMAND_1 + 2)
                   : records_get(swap, RECORD_COMMAND);
    case SOURCE_EXCITED_PITCH:
        for (unsigned b = 0; b < blades; b++) {
            sum += (double)demands->added[b];
        }
        return (float)(sum / blades);
    case SOURCE_EXCITED_PITCH_AT:
        return demands->added[tap->record];
    case SOURCE_EXCITED_TORQUE:
        return demands->added[EXCITATION_BLADES];
    case SOURCE_MEASURED:
    case SOURCE_PITCH:
    case SOURCE_DEMANDED:
    default:
        return records_get(swap, tap->record);
    }
}

clock_tick_t observer_before(observer_t *self, const float *swap)
{
    const clock_tick_t tick = self->clock.step_s > 0
                                  ? sample_clock_take(&self->clock, (double)records_get(swap, RECORD_TIME))
                                  : CLOCK_REPEATED;
    self->due = (int)tick;
    self->bus.clock_us = (uint64_t)((double)self->clock.elapsed * self->clock.step_s * 1e6 + 0.5);
    if (!self->on || (tick != CLOCK_SAMPLE && tick != CLOCK_JUMPED)) {
        return tick;
    }
    for (unsigned i = 0; i < settings_taps(self->settings); i++) {
        const tap_t *tap = &self->settings->tap[i];
        if (tap->source == SOURCE_MEASURED) {
            self->value[i] = records_get(swap, tap->record);
        } else if (tap->source == SOURCE_PITCH) {
            self->value[i] = mean_of_blades(swap, RECORD_PITCH_1, RECORD_PITCH_2, RECORD_PITCH_3);
        }
    }
    return tick;
}

/* Begin to send the parameters of this instant; 0 while those before are under way or where there are none. */
static int send_snapshot(observer_t *self)
{
    return aeo_estimator_snapshot(&self->estimator, &self->stream, self->clock.index) == AEO_OK;
}

/* Tell what the scales hide, once a channel and kind. */
static void judge_scales(observer_t *self, int last)
{
    char text[SCALE_WATCH_TEXT_MAX];
    for (unsigned i = 0; i < settings_taps(self->settings); i++) {
        if (scale_watch_judge(&self->watch, i, last, text)) {
            (void)fprintf(stderr, "aeolid-discon: turbine %u: %s\n", self->turbine, text);
        }
    }
}

static void take_sample(observer_t *self, double time_s)
{
    const settings_t *s = self->settings;
    const float *u = self->value, *y = u + s->taps[ROLE_INPUT], *scheduling = y + s->taps[ROLE_OUTPUT];
    const uint32_t index = self->clock.index;
    (void)aeo_estimator_send(&self->estimator, &self->stream, index, u, y,
                             s->taps[ROLE_SCHEDULING] > 0u ? scheduling : NULL, (uint64_t)index * self->period_us);
    self->since_snapshot++;
    if (self->snapshot_samples > 0u && self->since_snapshot >= self->snapshot_samples && send_snapshot(self)) {
        self->since_snapshot = 0;
    }
    if (scale_watch_take(&self->watch, self->value, time_s)) {
        judge_scales(self, 0);
        scale_watch_next(&self->watch);
    }
}

void observer_after(observer_t *self, const float *swap, const demands_t *demands)
{
    if (!self->on || self->due == (int)CLOCK_REPEATED) {
        return;
    }
    if (self->due != (int)CLOCK_STEP) {
        for (unsigned i = 0; i < settings_taps(self->settings); i++) {
            const tap_t *tap = &self->settings->tap[i];
            if (tap->source != SOURCE_MEASURED && tap->source != SOURCE_PITCH) {
                self->value[i] = read_after(tap, swap, demands);
            }
        }
        take_sample(self, (double)records_get(swap, RECORD_TIME));
    }
    (void)aeo_stream_step(&self->stream);
    bus_service(&self->bus);
}

/* ---- the end ----------------------------------------------------------------------------------------------------- */

/* Let simulated time run on until nothing is pending, the bus takes nothing any more, or it takes too long. */
static void drain(observer_t *self)
{
    int pauses = 0;
    for (int32_t i = 0; i < FINISH_STEPS && pauses < FINISH_PAUSES && aeo_stream_pending(&self->stream); i++) {
        const uint32_t refused = self->bus.refused;
        self->clock.elapsed++;
        self->bus.clock_us = (uint64_t)((double)self->clock.elapsed * self->clock.step_s * 1e6 + 0.5);
        (void)aeo_stream_step(&self->stream);
        bus_service(&self->bus);
        if (self->bus.refused != refused) {
            bus_pause(&self->bus);
            pauses++;
        }
    }
}

void observer_finish(observer_t *self)
{
    if (self->on) {
        drain(self); /* first the snapshot under way, then one of the last theta */
        (void)send_snapshot(self);
        aeo_stream_finish(&self->stream);
        drain(self);
        bus_linger(&self->bus);
        judge_scales(self, 1);
        announce_end(self, 1);
        self->on = 0;
    }
    observer_drop(self);
}

void observer_drop(observer_t *self)
{
    if (self->on) {
        announce_end(self, 0);
    }
    bus_close(&self->bus);
    free(self->memory);
    self->memory = NULL;
    self->on = 0;
}
/* SPDX-License-Identifier: MIT */
