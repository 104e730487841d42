/* fake_bus.c: see fake_bus.h. */
#include "fake_bus.h"

#include "unity.h"

#include <string.h>

fake_bus_t fake;
aeo_port_t port;
aeo_stream_t stream;
uint32_t words[PARAMETERS_MAX];
aeo_real_t theta[PARAMETERS_MAX], u[INPUTS], y[OUTPUTS];

const aeo_channel_t channels[CHANNELS] = {
    {.name = "pitch", .unit = "deg", .scale = AEO_REAL(1)},
    {.name = "generator_torque", .unit = "Nm", .scale = AEO_REAL(1000)},
    {.name = "a name of exactly 32 characters!", .unit = "rad/s", .offset = AEO_REAL(1.25), .scale = AEO_REAL(0.02)},
    {.scale = AEO_REAL(1)},
    {.name = "y3", .unit = "", .offset = AEO_REAL(-1), .scale = AEO_REAL(2)}};

static int send(void *context, const aeo_can_frame_t *frame)
{
    fake_bus_t *self = (fake_bus_t *)context;
    const unsigned call = self->calls++;
    self->lock_errors += port.lock != NULL && self->locked != 1;
    if (self->refuse_all || call == self->refuse_at || self->kept == KEPT) {
        return 0;
    }
    self->frame[self->kept++] = *frame;
    return 1;
}

uint32_t read_clock(void *context)
{
    return ((fake_bus_t *)context)->now_us;
}

static void lock(void *context)
{
    fake_bus_t *self = (fake_bus_t *)context;
    self->lock_errors += self->locked != 0;
    self->locked++;
    self->lock_calls++;
}

static void unlock(void *context)
{
    fake_bus_t *self = (fake_bus_t *)context;
    self->lock_errors += self->locked != 1;
    self->locked--;
}

aeo_stream_config_t make_config(void)
{
    aeo_stream_config_t config;
    memset(&config, 0, sizeof config);
    config.address.base = AEO_FRAME_BASE_EXTENDED;
    config.address.node = 5;
    config.address.extended = 1;
    config.inputs = INPUTS;
    config.outputs = OUTPUTS;
    config.past = 20;
    config.parameters = N;
    config.sample_time_s = AEO_REAL(0.1);
    config.lambda = AEO_REAL(1);
    config.rho = AEO_REAL(1);
    config.channels = channels;
    config.sample_every = 1;
    config.health_every = 10;
    config.describe_every = 600;
    config.repair_percent = 25;
    config.burst = 16;
    config.bits_per_s = 0;
    return config;
}

void start_stream(const aeo_stream_config_t *config)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, config, &port, words, config->parameters));
}

void set_up_bus(void)
{
    unsigned i;
    memset(&fake, 0, sizeof fake);
    fake.refuse_at = 0xFFFFFFFFu;
    port.context = &fake;
    port.send = send;
    port.time_us = NULL;
    port.lock = lock;
    port.unlock = unlock;
    for (i = 0; i < PARAMETERS_MAX; i++) {
        theta[i] = AEO_REAL(0.001) * (aeo_real_t)i - AEO_REAL(3.0);
    }
}

void tear_down_bus(void)
{
    TEST_ASSERT_EQUAL_INT(0, fake.locked);
    TEST_ASSERT_EQUAL_INT(0, fake.lock_errors);
}

aeo_message_t message_at(unsigned i)
{
    static const aeo_address_t address = {AEO_FRAME_BASE_EXTENDED, 0, 1};
    aeo_message_t message;
    uint8_t node;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_unpack(&address, &fake.frame[i], &message, &node));
    TEST_ASSERT_EQUAL_UINT8(5, node);
    return message;
}

unsigned long bits_taken(void)
{
    unsigned long bits = 0;
    unsigned i;
    for (i = 0; i < fake.kept; i++) {
        const unsigned length = fake.frame[i].length;
        bits += length == 8u ? AEO_FRAME_BITS_EXTENDED : AEO_FRAME_FD_BITS_EXTENDED(length, stream.config.fd_ratio);
    }
    return bits;
}

void step_until_idle(void)
{
    unsigned steps = 0;
    while (aeo_stream_pending(&stream)) {
        TEST_ASSERT_TRUE(aeo_stream_step(&stream) >= 0);
        TEST_ASSERT_TRUE(++steps < 100000u);
    }
}

void describe_first(void)
{
    step_until_idle();
    fake.kept = 0;
    fake.calls = 0;
}

void run_all(void)
{
    const uint32_t counters[2] = {11, 22};
    unsigned k;
    for (k = 0; k < 60u; k++) {
        u[0] = (aeo_real_t)k;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        if (k == 20u) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, k, theta));
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_health(&stream, 3, counters, 2));
        (void)aeo_stream_step(&stream);
    }
    aeo_stream_finish(&stream);
    step_until_idle();
}

int is_sample(unsigned i)
{
    const aeo_kind_t kind = message_at(i).kind;
    return kind == AEO_KIND_SAMPLE || kind == AEO_KIND_SAMPLE_FD || kind == AEO_KIND_SEAL;
}

int is_health(unsigned i)
{
    return message_at(i).kind == AEO_KIND_HEALTH;
}

unsigned lasting_frames(aeo_can_frame_t *into)
{
    unsigned i, count = 0;
    for (i = 0; i < fake.kept; i++) {
        if (!is_sample(i) && !is_health(i)) {
            memset(&into[count], 0, sizeof *into); /* what lies beyond the length is not part of a frame */
            into[count].id = fake.frame[i].id;
            into[count].flags = fake.frame[i].flags;
            into[count].length = fake.frame[i].length;
            memcpy(into[count].data, fake.frame[i].data, fake.frame[i].length);
            count++;
        }
    }
    return count;
}
