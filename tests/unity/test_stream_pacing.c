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
static void share_is_kept(uint32_t bits_per_s, uint32_t period_us, int with_clock)
{
    aeo_stream_config_t config = make_config();
    double budget = 0, spent = 0;
    unsigned k;
    config.bits_per_s = bits_per_s;
    config.sample_time_s = (aeo_real_t)(1e-6 * (double)period_us);
    fake.now_us = UINT32_C(0xFFFFF000); /* the clock wraps within the first samples */
    port.time_us = with_clock ? read_clock : NULL;
    start(&config);
    for (k = 0; k < 3000u; k++) {
        fake.kept = 0;
        fake.now_us += period_us;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        (void)aeo_stream_snapshot(&stream, k, theta);
        (void)aeo_stream_step(&stream);
        budget += (double)bits_per_s * 1e-6 * (double)period_us;
        spent += (double)(fake.kept * AEO_FRAME_BITS_EXTENDED);
        TEST_ASSERT_TRUE(spent <= budget + (double)((16u + CHANNELS) * AEO_FRAME_BITS_EXTENDED));
    }
    TEST_ASSERT_TRUE(spent >= 0.97 * budget); /* and what is granted is used */
    TEST_ASSERT_EQUAL_UINT32(0, stream.counters.dropped);
}

static void share_of_the_bus_is_kept(void)
{
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 0);
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 1);
    share_is_kept(AEO_STREAM_SHARE(250000, 200), 20000, 1);
    share_is_kept(AEO_STREAM_SHARE(1000000, 1000), 1000, 1);
    share_is_kept(9000, 100000, 0);
}

/* A quiet hour earns one burst and no more: the bus does not meet an hour's worth of frames at once. */
static void silence_is_not_saved_up(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k;
    config.bits_per_s = 25000; /* a frame each 6.4 ms */
    port.time_us = read_clock;
    start(&config);
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
    start(&config);
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
    start(&config);
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
    RUN_TEST(silence_is_not_saved_up);
    RUN_TEST(samples_too_fast_are_dropped);
    RUN_TEST(every_kth_sample);
    return UNITY_END();
}
