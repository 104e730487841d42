/* The streamer keeps to its share of the bus: nothing beyond it, and what is granted is used. */
#include "fake_bus.h"
#include "unity.h"

void setUp(void)
{
    set_up_bus();
}

void tearDown(void)
{
    tear_down_bus();
}

/* Over any stretch of time the bits sent stay within the share, one burst and one sample aside. */
static void share_is_kept(uint32_t bits_per_s, uint32_t period_us, int with_clock, uint8_t fd_ratio)
{
    aeo_stream_config_t config = make_config();
    double budget = 0, spent = 0, slack;
    unsigned k;
    config.bits_per_s = bits_per_s;
    config.fd = fd_ratio > 0u;
    config.fd_ratio = fd_ratio;
    config.past = 0;
    config.parameters = fd_ratio > 0u ? 4000u : N; /* a snapshot takes many steps: there is always something to send */
    config.seal = 1;
    slack = 16.0 * (fd_ratio > 0u ? AEO_FRAME_FD_BITS_EXTENDED(64u, fd_ratio) : AEO_FRAME_BITS_EXTENDED) +
            (double)AEO_STREAM_SAMPLE_BITS(CHANNELS, 0, 1);
    config.sample_time_s = (aeo_real_t)(1e-6 * (double)period_us);
    fake.now_us = UINT32_C(0xFFFFF000); /* the clock wraps within the first samples */
    port.time_us = with_clock ? read_clock : NULL;
    start_stream(&config);
    for (k = 0; k < 3000u; k++) {
        fake.kept = 0;
        fake.now_us += period_us;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        (void)aeo_stream_snapshot(&stream, k, theta);
        (void)aeo_stream_step(&stream);
        budget += (double)bits_per_s * 1e-6 * (double)period_us;
        spent += (double)bits_taken();
        TEST_ASSERT_TRUE(spent <= budget + slack);
    }
    TEST_ASSERT_TRUE(spent >= 0.97 * budget); /* and what is granted is used */
    TEST_ASSERT_EQUAL_UINT32(0, stream.counters.dropped);
}

static void share_of_the_bus_is_kept(void)
{
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 0, 0);
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 1, 0);
    share_is_kept(AEO_STREAM_SHARE(250000, 200), 25000, 1, 0);
    share_is_kept(AEO_STREAM_SHARE(1000000, 1000), 1100, 1, 0);
    share_is_kept(11000, 100000, 0, 0);
}

static void share_of_a_can_fd_bus_is_kept(void)
{
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 0, 4);
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 1, 1);
    share_is_kept(AEO_STREAM_SHARE(250000, 200), 20000, 1, 16);
    share_is_kept(7000, 100000, 1, 4);
}

/* Without a budget in the way the load of the bus is that of the formula, in the longest bits of each frame. */
static void measure_load(uint8_t fd_ratio, unsigned innovations)
{
    aeo_stream_config_t config = make_config();
    const unsigned steps = 60000, snapshot_every = 250, describe_every = 600, description = 7u + 2u * CHANNELS + 19u;
    const uint32_t sample_bits = fd_ratio > 0u ? AEO_STREAM_SAMPLE_BITS_FD(CHANNELS, innovations, fd_ratio)
                                               : AEO_STREAM_SAMPLE_BITS(CHANNELS, innovations, 1);
    const uint32_t snapshot_bits =
        fd_ratio > 0u ? AEO_STREAM_SNAPSHOT_BITS_FD(N, 25, fd_ratio) : AEO_STREAM_SNAPSHOT_BITS(N, 25);
    uint32_t load;
    double bits = 0;
    unsigned k;
    config.fd = fd_ratio > 0u;
    config.fd_ratio = fd_ratio;
    config.seal = 1;
    config.innovations = innovations > 0u;
    config.describe_every = (uint16_t)describe_every;
    start_stream(&config);
    for (k = 0; k < steps; k++) {
        fake.kept = 0;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        (void)aeo_stream_innovation(&stream, k, y);
        if (k % snapshot_every == 0u) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, k, theta));
        }
        (void)aeo_stream_step(&stream);
        bits += (double)bits_taken();
    }
    load =
        AEO_STREAM_LOAD(500000, 100000, sample_bits, 1, snapshot_bits, snapshot_every, 10, description, describe_every);
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * (double)load + 1.0, (double)load, bits / (0.1 * (double)steps) / 500000.0 * 1e3);
}

static void load_is_that_of_the_formula(void)
{
    measure_load(0, 0);
    measure_load(0, OUTPUTS);
    measure_load(1, OUTPUTS);
    measure_load(8, 0);
}

/* A constant expression, as integrators check it. */
typedef char
    bus_has_room[AEO_STREAM_LOAD(500000, 100000, AEO_STREAM_SAMPLE_BITS(5, 0, 1), 1, AEO_STREAM_SNAPSHOT_BITS(450, 25),
                                 100, 10, AEO_STREAM_DESCRIPTION_MAX(5), 100) <= 50
                     ? 1
                     : -1];

/* A quiet hour earns one burst and no more: the bus does not meet an hour's worth of frames at once. */
static void silence_is_not_saved_up(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k;
    config.bits_per_s = 25000; /* a frame each 6.4 ms */
    port.time_us = read_clock;
    start_stream(&config);
    while (stream.described == 0u) {
        fake.now_us += 100000u;
        (void)aeo_stream_step(&stream);
    }
    stream.config.health_every = 65535;
    stream.config.describe_every = 65535;
    stream.health_in = stream.describe_in = 65535;
    for (k = 0; k < 36000u; k++) {
        fake.now_us += 100000u;
        TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 1, theta));
    fake.kept = 0;
    for (k = 0; k < 64u; k++) {
        fake.now_us += 1000u;
        (void)aeo_stream_step(&stream);
    }
    TEST_ASSERT_EQUAL_UINT(16u + 9u, fake.kept); /* the burst at the first step, 63 ms of credit after it */
}

/* Samples that come ten times faster than declared are dropped and counted, not sent on credit for ever. */
static void samples_too_fast_are_dropped(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k;
    config.bits_per_s = 25000;
    port.time_us = read_clock;
    start_stream(&config);
    for (k = 0; k < 100000u; k++) {
        fake.kept = 0;
        fake.now_us += 3000u;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        (void)aeo_stream_step(&stream);
    }
    TEST_ASSERT_TRUE((double)stream.counters.sent * 160.0 <= 25000.0 * 300.0 + 160.0 * (16 + 2 * 64 + 5));
    TEST_ASSERT_EQUAL_UINT32(500000u, stream.counters.dropped + stream.counters.sent);
}

static void every_kth_sample(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k, i;
    config.sample_every = 4;
    start_stream(&config);
    describe_first();
    for (k = 0; k < 21u; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, k, u, y, NULL));
    }
    TEST_ASSERT_EQUAL_UINT(6u * CHANNELS, fake.kept);
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        TEST_ASSERT_EQUAL_UINT16(4u * (i / CHANNELS), m.index);
        TEST_ASSERT_EQUAL_UINT8(i % CHANNELS, m.tag);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(share_of_the_bus_is_kept);
    RUN_TEST(share_of_a_can_fd_bus_is_kept);
    RUN_TEST(load_is_that_of_the_formula);
    RUN_TEST(silence_is_not_saved_up);
    RUN_TEST(samples_too_fast_are_dropped);
    RUN_TEST(every_kth_sample);
    return UNITY_END();
}
