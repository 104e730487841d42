/* estimator_stream.c: what a stream says of an estimator; apart, so that a program without a stream does without it. */
#include "aeolid/estimator.h"

#include "stream_send.h"

/* What self knows: 0 in the bus's part, so that nothing is said twice. */
static int is_left_open(const aeo_stream_config_t *bus)
{
    return bus->inputs == 0u && bus->outputs == 0u && bus->method == 0u && bus->model_set == 0u && bus->past == 0u &&
           bus->parameters == 0u && bus->feedthrough == 0u && bus->channels == NULL &&
           aeo_float_bits(bus->sample_time_s) == 0u && aeo_float_bits(bus->lambda) == 0u &&
           aeo_float_bits(bus->rho) == 0u;
}

aeo_status_t aeo_estimator_announce(const aeo_estimator_t *self, aeo_stream_t *stream, const aeo_stream_config_t *bus,
                                    const aeo_port_t *port, uint32_t *memory, uint32_t words)
{
    if (self == NULL || bus == NULL || !is_left_open(bus)) {
        return AEO_E_ARG;
    }
    const aeo_estimator_config_t *const config = &self->config;
    aeo_stream_config_t whole = *bus;
    whole.inputs = (uint8_t)config->inputs; /* at most 32, as outputs */
    whole.outputs = (uint8_t)config->outputs;
    whole.method = (uint8_t)self->calls.method;
    whole.model_set = (uint16_t)config->model_set;
    whole.past = config->past;
    whole.parameters = (uint32_t)self->regressor.length * config->outputs;
    whole.feedthrough = config->feedthrough;
    whole.sample_time_s = (aeo_real_t)config->period_us / AEO_REAL(1e6);
    whole.lambda = config->forgetting;
    whole.rho = config->regularisation;
    whole.channels = config->channels;
    return aeo_stream_init(stream, &whole, port, memory, words);
}

aeo_status_t aeo_estimator_send(aeo_estimator_t *self, aeo_stream_t *stream, uint32_t index, const aeo_real_t *u,
                                const aeo_real_t *y, const aeo_real_t *s, uint64_t time_us)
{
    static const aeo_counter_t told[AEO_STREAM_COUNTERS] = {
        AEO_COUNT_SAMPLES,  AEO_COUNT_NOT_FINITE, AEO_COUNT_RANGE,         AEO_COUNT_TIME,    AEO_COUNT_GAPS,
        AEO_COUNT_WITHHELD, AEO_COUNT_BOUNDED,    AEO_COUNT_REINITIALISED, AEO_COUNT_RELEASED};
    if (stream == NULL || (s == NULL && stream->config.scheduling > 0u)) {
        return AEO_E_ARG;
    }
    const aeo_status_t status = aeo_estimator_take(self, u, y, time_us);
    if (status == AEO_E_ARG) {
        return status;
    }
    if (status == AEO_OK) {
        (void)aeo_stream_innovation(stream, index, aeo_estimator_innovation(self));
    }
    (void)aeo_stream_sample(stream, index, u, y, s);
    aeo_stream_lock(stream); /* all goes straight to its place: an array of counters is deep on a small stack */
    stream->flags = (uint16_t)(aeo_estimator_health(self) & 0x7FFFu);
    for (unsigned i = 0; i < AEO_STREAM_COUNTERS; i++) {
        stream->counter[i] = aeo_estimator_count(self, told[i]);
    }
    stream->counters_used = AEO_STREAM_COUNTERS;
    aeo_stream_unlock(stream);
    return status;
}

aeo_status_t aeo_estimator_snapshot(aeo_estimator_t *self, aeo_stream_t *stream, uint32_t index)
{
    const aeo_real_t *const theta = aeo_estimator_theta(self);
    if (self == NULL || stream == NULL) {
        return AEO_E_ARG;
    }
    return theta == NULL ? AEO_E_RANGE : aeo_stream_snapshot(stream, index, theta);
}
/* SPDX-License-Identifier: MIT */
