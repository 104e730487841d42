/* Description, health, farewell and a fresh start of the streamer. */
#include "fake_bus.h"
#include "unity.h"

#include <string.h>

void setUp(void)
{
    set_up_bus();
}

void tearDown(void)
{
    tear_down_bus();
}

static void description_is_repeated_and_hashed(void)
{
    aeo_stream_config_t config = make_config();
    uint32_t crc = UINT32_C(0xFFFFFFFF), hash, first, i;
    config.describe_every = 50;
    start_stream(&config);
    step_until_idle();
    first = fake.kept;
    TEST_ASSERT_EQUAL_UINT32(7u + 2u * CHANNELS + (2u + 4u + 8u + 0u + 1u) + (1u + 1u + 2u + 0u + 0u), first);
    hash = message_at(0).value[0];
    for (i = 1; i < first; i++) {
        const aeo_message_t m = message_at(i);
        crc = aeo_frame_crc32(crc, (uint32_t)m.tag | ((uint32_t)m.index << 16));
        crc = aeo_frame_crc32(crc, m.value[0]);
    }
    TEST_ASSERT_EQUAL_HEX32(hash, ~crc);
    fake.kept = 0;
    for (i = 0; i < 60u; i++) {
        (void)aeo_stream_step(&stream);
    }
    for (i = 0, crc = 0; i < fake.kept; i++) {
        crc += message_at(i).kind == AEO_KIND_DESCRIPTION;
    }
    TEST_ASSERT_EQUAL_UINT32(first, crc);
}

static void health_tells_index_and_counters(void)
{
    const aeo_stream_config_t config = make_config();
    const uint32_t counters[AEO_STREAM_COUNTERS] = {100, 101, 102, 103, 104, 105, 106, 107, 108};
    unsigned i, k, indices = 0;
    uint32_t told[17] = {0};
    start_stream(&config);
    describe_first();
    for (k = 0; k < 300u; k++) {
        (void)aeo_stream_sample(&stream, 100000u + k, u, y, NULL);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_health(&stream, 0xFFFFFFFFu, counters, AEO_STREAM_COUNTERS));
        (void)aeo_stream_step(&stream);
    }
    for (i = 0; i < fake.kept; i++) {
        if (is_health(i)) {
            const aeo_message_t m = message_at(i);
            TEST_ASSERT_EQUAL_HEX16(0x7FFFu, m.index); /* bit 15 belongs to the end of the stream */
            TEST_ASSERT_TRUE(m.tag < 17u);
            told[m.tag] = m.value[0];
            indices += m.tag == 0u;
        }
    }
    TEST_ASSERT_EQUAL_UINT32_ARRAY(counters, told + AEO_HEALTH_FILTER, AEO_STREAM_COUNTERS);
    TEST_ASSERT_TRUE(told[0] >= 100280u && told[0] < 100300u);
    TEST_ASSERT_EQUAL_UINT(15, indices); /* every second of 30 */
}

static void farewell_says_stopped(void)
{
    const aeo_stream_config_t config = make_config();
    unsigned i, farewells = 0;
    start_stream(&config);
    run_all();
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        if (m.kind == AEO_KIND_HEALTH && (m.index & AEO_HEALTH_STOPPED) != 0u) {
            farewells++;
            TEST_ASSERT_EQUAL_UINT8(0, m.tag);
            TEST_ASSERT_EQUAL_UINT32(59, m.value[0]);
        } else {
            TEST_ASSERT_EQUAL_UINT(0, farewells); /* nothing after it */
        }
    }
    TEST_ASSERT_EQUAL_UINT(6, farewells);
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(&stream));
    aeo_stream_finish(&stream);
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream)); /* said once */
}

static void reset_is_fresh(void)
{
    static aeo_can_frame_t reference[KEPT];
    const aeo_stream_config_t config = make_config();
    unsigned count;
    start_stream(&config);
    run_all();
    count = lasting_frames(reference);
    start_stream(&config);
    (void)aeo_stream_snapshot(&stream, 5, theta);
    (void)aeo_stream_step(&stream);
    stream.number = 0; /* the one thing reset keeps on purpose: two snapshots must not share a number */
    aeo_stream_reset(&stream);
    fake.kept = 0;
    fake.calls = 0;
    run_all();
    {
        static aeo_can_frame_t found[KEPT];
        TEST_ASSERT_EQUAL_UINT(count, lasting_frames(found));
        TEST_ASSERT_EQUAL_MEMORY(reference, found, count * sizeof *found);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(description_is_repeated_and_hashed);
    RUN_TEST(health_tells_index_and_counters);
    RUN_TEST(farewell_says_stopped);
    RUN_TEST(reset_is_fresh);
    return UNITY_END();
}
