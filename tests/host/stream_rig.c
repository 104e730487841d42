/* stream_rig.c: the streamer on a port that keeps what is sent, driven from Python by stream_rig.py. */
#include <aeolid/stream.h>

#include <stdlib.h>
#include <string.h>

typedef struct {
    uint8_t node, inputs, outputs, scheduling, innovations, seal, fd, fd_ratio, repair_percent, burst;
    uint16_t sample_every, health_every, describe_every;
    uint32_t parameters, bits_per_s;
    float sample_time_s;
} rig_settings_t;

typedef struct {
    aeo_stream_t stream;
    aeo_stream_channel_t channel[AEO_STREAM_CHANNELS_MAX];
    char name[AEO_STREAM_CHANNELS_MAX][8];
    aeo_can_frame_t *frame;
    size_t kept, room;
    uint32_t memory[65536];
} rig_t;

rig_t *rig_start(const rig_settings_t *settings, size_t room);
int rig_run(rig_t *self, uint32_t first, uint32_t count, const float *values, const float *innovations);
int rig_snapshot(rig_t *self, uint32_t index, const float *theta);
size_t rig_take(rig_t *self, aeo_can_frame_t *frames);
int rig_finish(rig_t *self);
int rig_pending(const rig_t *self);
void rig_counters(const rig_t *self, uint32_t *counters);
void rig_free(rig_t *self);
uint32_t rig_longest(uint32_t length, uint32_t ratio, uint32_t extended);
uint32_t rig_load_of(uint32_t bit_rate, uint32_t sample_us, uint32_t sample_bits, uint32_t sample_every,
                     uint32_t snapshot_bits, uint32_t snapshot_every, uint32_t health_every, uint32_t description,
                     uint32_t describe_every);
uint32_t rig_load(uint32_t bit_rate, uint32_t sample_us, uint32_t channels, uint32_t innovations, uint32_t parameters,
                  uint32_t repair_percent, uint32_t snapshot_every, uint32_t health_every, uint32_t description,
                  uint32_t describe_every, uint32_t fd, uint32_t ratio);

static int keep(void *context, const aeo_can_frame_t *frame)
{
    rig_t *self = (rig_t *)context;
    if (self->kept == self->room) {
        return 0;
    }
    memset(&self->frame[self->kept], 0, sizeof *frame);
    self->frame[self->kept].id = frame->id;
    self->frame[self->kept].length = frame->length;
    self->frame[self->kept].flags = frame->flags;
    memcpy(self->frame[self->kept].data, frame->data, frame->length);
    self->kept++;
    return 1;
}

static void describe(rig_t *self, aeo_stream_config_t *config, const rig_settings_t *settings)
{
    unsigned i;
    memset(config, 0, sizeof *config);
    for (i = 0; i < AEO_STREAM_CHANNELS_MAX; i++) {
        self->name[i][0] = 'c';
        self->name[i][1] = (char)('0' + i / 10u);
        self->name[i][2] = (char)('0' + i % 10u);
        self->channel[i].name = self->name[i];
        self->channel[i].unit = "m/s";
        self->channel[i].offset = 0.5F;
        self->channel[i].scale = 1.5F;
    }
    config->address.base = AEO_FRAME_BASE_EXTENDED;
    config->address.node = settings->node;
    config->address.extended = 1;
    config->inputs = settings->inputs;
    config->outputs = settings->outputs;
    config->scheduling = settings->scheduling;
    config->innovations = settings->innovations;
    config->seal = settings->seal;
    config->fd = settings->fd;
    config->fd_ratio = settings->fd_ratio;
    config->parameters = settings->parameters;
    config->past = 1;
    config->sample_time_s = settings->sample_time_s;
    config->lambda = 1.0F;
    config->rho = 0.1F;
    config->channels = self->channel;
    config->sample_every = settings->sample_every;
    config->health_every = settings->health_every;
    config->describe_every = settings->describe_every;
    config->repair_percent = settings->repair_percent;
    config->burst = settings->burst;
    config->bits_per_s = settings->bits_per_s;
}

rig_t *rig_start(const rig_settings_t *settings, size_t room)
{
    rig_t *self = calloc(1, sizeof *self);
    aeo_stream_config_t config;
    aeo_port_t port;
    memset(&port, 0, sizeof port);
    if (self == NULL) {
        return NULL;
    }
    self->frame = calloc(room, sizeof *self->frame);
    self->room = room;
    port.context = self;
    port.send = keep;
    describe(self, &config, settings);
    /* the host believes a description only when parameters = outputs * (past * (inputs + outputs) + present inputs) */
    config.past = (uint16_t)(settings->parameters / settings->outputs / (settings->inputs + settings->outputs));
    if (self->frame == NULL || aeo_stream_init(&self->stream, &config, &port, self->memory, 65536) != 0) {
        rig_free(self);
        return NULL;
    }
    return self;
}

/* Samples first ... first + count - 1, a step after each; values (count x channels), innovations (count x outputs). */
int rig_run(rig_t *self, uint32_t first, uint32_t count, const float *values, const float *innovations)
{
    const aeo_stream_config_t *config = &self->stream.config;
    const unsigned m = (unsigned)config->inputs + config->outputs + config->scheduling;
    uint32_t k, i;
    for (k = 0; k < count; k++) {
        const float *u = values + (size_t)k * m, *y = u + config->inputs, *s = y + config->outputs;
        uint32_t counter[AEO_STREAM_COUNTERS];
        for (i = 0; i < AEO_STREAM_COUNTERS; i++) {
            counter[i] = (first + k) * (i + 1u);
        }
        (void)aeo_stream_health(&self->stream, 5u, counter, AEO_STREAM_COUNTERS);
        (void)aeo_stream_sample(&self->stream, first + k, u, y, s);
        (void)aeo_stream_innovation(&self->stream, first + k, innovations + (size_t)k * config->outputs);
        (void)aeo_stream_step(&self->stream);
    }
    return aeo_stream_pending(&self->stream);
}

int rig_snapshot(rig_t *self, uint32_t index, const float *theta)
{
    return aeo_stream_snapshot(&self->stream, index, theta);
}

/* Step without samples until nothing is pending. */
int rig_finish(rig_t *self)
{
    uint32_t steps = 0;
    aeo_stream_finish(&self->stream);
    while (aeo_stream_pending(&self->stream) && steps++ < 1000000u) {
        (void)aeo_stream_step(&self->stream);
    }
    return aeo_stream_pending(&self->stream);
}

size_t rig_take(rig_t *self, aeo_can_frame_t *frames)
{
    const size_t count = self->kept;
    memcpy(frames, self->frame, count * sizeof *frames);
    self->kept = 0;
    return count;
}

int rig_pending(const rig_t *self)
{
    return aeo_stream_pending(&self->stream);
}

void rig_counters(const rig_t *self, uint32_t *counters)
{
    memcpy(counters, &self->stream.counters, sizeof self->stream.counters);
}

void rig_free(rig_t *self)
{
    free(self->frame);
    free(self);
}

/* The formulas of frame.h and stream.h. */
uint32_t rig_longest(uint32_t length, uint32_t ratio, uint32_t extended)
{
    const int fd = length > 8u;
    if (extended != 0u) {
        return fd ? AEO_FRAME_FD_BITS_EXTENDED(length, ratio) : AEO_FRAME_BITS_EXTENDED;
    }
    return fd ? AEO_FRAME_FD_BITS_STANDARD(length, ratio) : AEO_FRAME_BITS_STANDARD;
}

uint32_t rig_load_of(uint32_t bit_rate, uint32_t sample_us, uint32_t sample_bits, uint32_t sample_every,
                     uint32_t snapshot_bits, uint32_t snapshot_every, uint32_t health_every, uint32_t description,
                     uint32_t describe_every)
{
    return AEO_STREAM_LOAD(bit_rate, sample_us, sample_bits, sample_every, snapshot_bits, snapshot_every, health_every,
                           description, describe_every);
}

uint32_t rig_load(uint32_t bit_rate, uint32_t sample_us, uint32_t channels, uint32_t innovations, uint32_t parameters,
                  uint32_t repair_percent, uint32_t snapshot_every, uint32_t health_every, uint32_t description,
                  uint32_t describe_every, uint32_t fd, uint32_t ratio)
{
    const uint32_t sample_bits = fd != 0u ? AEO_STREAM_SAMPLE_BITS_FD(channels, innovations, ratio)
                                          : AEO_STREAM_SAMPLE_BITS(channels, innovations, 1);
    const uint32_t snapshot_bits = fd != 0u ? AEO_STREAM_SNAPSHOT_BITS_FD(parameters, repair_percent, ratio)
                                            : AEO_STREAM_SNAPSHOT_BITS(parameters, repair_percent);
    return rig_load_of(bit_rate, sample_us, sample_bits, 1, snapshot_bits, snapshot_every, health_every, description,
                       describe_every);
}
