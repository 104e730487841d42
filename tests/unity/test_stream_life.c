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

/* Texts arrive character by character up to the longest that is sent, cut there, in the order of tags, parts, channels. */
static void texts_arrive_up_to_their_longest(void)
{
    static const char text[] = "0123456789abcdefghijklmnopqrstuvwxyz ABC";
    for (unsigned length = 0; length < sizeof text; length++) {
        aeo_channel_t own[CHANNELS];
        aeo_stream_config_t config = make_config();
        char name[CHANNELS][64] = {{0}}, unit[CHANNELS][64] = {{0}};
        uint32_t last = 0, crc = UINT32_C(0xFFFFFFFF);
        memcpy(own, channels, sizeof own);
        own[0].offset = AEO_REAL(-3.5);
        own[1].name = own[CHANNELS - 1].name = own[0].unit = own[CHANNELS - 1].unit =
            text + (sizeof text - 1u - length);
        config.channels = own;
        set_up_bus();
        start_stream(&config);
        step_until_idle();
        for (unsigned i = 0; i < fake.kept; i++) {
            const aeo_message_t m = message_at(i);
            const uint32_t part = m.index >> 8, channel = m.index & 255u;
            const uint32_t order = ((uint32_t)m.tag << 16) + (m.tag < AEO_ITEM_OFFSET ? 0u : m.index) + 1u;
            TEST_ASSERT_EQUAL_INT(AEO_KIND_DESCRIPTION, m.kind);
            TEST_ASSERT_TRUE(order > last);
            last = order;
            if (i > 0u) { /* the first carries the hash of all that follow */
                crc = aeo_frame_crc32(crc, (uint32_t)m.tag | ((uint32_t)m.index << 16));
                crc = aeo_frame_crc32(crc, m.value[0]);
            }
            for (unsigned c = 0; c < 4u && m.tag >= AEO_ITEM_NAME; c++) {
                char *const to = m.tag == AEO_ITEM_NAME ? name[channel] : unit[channel];
                TEST_ASSERT_TRUE(channel < CHANNELS && 4u * part + c < 63u);
                to[4u * part + c] = (char)(m.value[0] >> (8u * c) & 255u);
            }
        }
        for (unsigned i = 7; i < 7u + 2u * CHANNELS; i++) { /* every offset, then every scale */
            const aeo_message_t m = message_at(i);
            const unsigned c = (i - 7u) % CHANNELS;
            TEST_ASSERT_EQUAL_UINT8(i < 7u + CHANNELS ? AEO_ITEM_OFFSET : AEO_ITEM_SCALE, m.tag);
            TEST_ASSERT_EQUAL_UINT16(c, m.index);
            TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(i < 7u + CHANNELS ? own[c].offset : own[c].scale), m.value[0]);
        }
        for (unsigned c = 0; c < CHANNELS; c++) {
            char expected[64] = {0};
            (void)strncpy(expected, own[c].name != NULL ? own[c].name : "", 32);
            TEST_ASSERT_EQUAL_STRING(expected, name[c]);
            memset(expected, 0, sizeof expected);
            (void)strncpy(expected, own[c].unit != NULL ? own[c].unit : "", 16);
            TEST_ASSERT_EQUAL_STRING(expected, unit[c]);
        }
        TEST_ASSERT_EQUAL_HEX32(~crc, message_at(0).value[0]);
        TEST_ASSERT_EQUAL_UINT32(fake.kept, stream.counters.sent); /* and then nothing is due */
        TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(&stream));
    }
}

/* The sample index first, then one counter after the other, an index before each. */
static void health_takes_turns_from_the_index_on(void)
{
    const aeo_stream_config_t config = make_config();
    const uint32_t counters[3] = {7, 8, 9};
    unsigned found = 0;
    start_stream(&config);
    describe_first();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_health(&stream, 0, counters, 3));
    for (unsigned k = 0; k < 400u; k++) {
        (void)aeo_stream_step(&stream);
    }
    for (unsigned i = 0; i < fake.kept; i++) {
        if (is_health(i)) {
            const unsigned turn = found++ / 2u % 8u; /* five counters of the stream, three of the filter */
            const unsigned counter = turn < 5u ? turn + 1u : turn - 5u + AEO_HEALTH_FILTER;
            TEST_ASSERT_EQUAL_UINT8(found % 2u == 1u ? AEO_HEALTH_INDEX : counter, message_at(i).tag);
        }
    }
    TEST_ASSERT_TRUE(found > 34u); /* all of them twice */
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

/* What was earned before a reset is not spent after it. */
static void a_reset_stream_has_no_credit(void)
{
    aeo_stream_config_t config = make_config();
    config.bits_per_s = 100000;
    config.burst = 16;
    start_stream(&config);
    for (unsigned k = 0; k < 3000u; k++) {
        (void)aeo_stream_step(&stream);
    }
    const unsigned longest = (unsigned)stream.longest_us;
    TEST_ASSERT_TRUE(stream.credit_us > (int32_t)(8u * longest));
    aeo_stream_reset(&stream);
    TEST_ASSERT_EQUAL_INT32(0, stream.credit_us);
    TEST_ASSERT_EQUAL_INT((int)(stream.period_us / longest < 16u ? stream.period_us / longest : 16u),
                          aeo_stream_step(&stream));
}

/* A clock that stood still for a quarter of an hour and more is no debt: a burst may leave, as after any silence. */
static void a_long_silence_earns_a_burst(void)
{
    aeo_stream_config_t config = make_config();
    config.bits_per_s = 100000;
    config.burst = 4;
    port.time_us = read_clock;
    start_stream(&config);
    stream.credit_us = 0;
    fake.now_us += 1000000001u;
    TEST_ASSERT_EQUAL_INT(4, aeo_stream_step(&stream));
    fake.now_us += 10u;
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
}

/* A frame may take a microsecond: steps of twenty send twenty frames, not a burst. */
static void the_shortest_frames_are_paced_too(void)
{
    aeo_stream_config_t config = make_config();
    config.bits_per_s = 160000000;
    config.sample_time_s = AEO_REAL(2e-5);
    config.burst = 255;
    config.sample_every = 0;
    config.repair_percent = 100;
    start_stream(&config);
    TEST_ASSERT_EQUAL_INT32(1, stream.frame_us);
    describe_first();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 0, theta));
    stream.credit_us = 0;
    for (unsigned k = 0; k < 10u; k++) {
        TEST_ASSERT_EQUAL_INT(20, aeo_stream_step(&stream));
    }
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

/* Announced, the end lets no snapshot begin; after the closing frames no sample leaves either, until a reset. */
static void nothing_leaves_after_the_end(void)
{
    aeo_stream_config_t config = make_config();
    unsigned kept;
    config.innovations = 1;
    start_stream(&config);
    describe_first();
    aeo_stream_finish(&stream);
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_stream_snapshot(&stream, 59, theta));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, 60, u, y, NULL)); /* the control task goes on */
    step_until_idle();
    kept = fake.kept;
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_stream_snapshot(&stream, 61, theta));
    TEST_ASSERT_EQUAL_UINT32(2, stream.counters.busy);
    TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_sample(&stream, 61, u, y, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_innovation(&stream, 61, y));
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(&stream));
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    TEST_ASSERT_EQUAL_UINT(kept, fake.kept);
    aeo_stream_reset(&stream);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, 62, u, y, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 62, theta));
}

static int finishes; /* 1: the next unlock lets another context announce the end */
static void (*let_in)(void *context);

static void finish_behind(void *context)
{
    let_in(context);
    if (finishes == 1) {
        finishes = 0;
        aeo_stream_finish(&stream);
    }
}

static void an_end_announced_while_theta_is_copied_lets_no_snapshot_begin(void)
{
    const aeo_stream_config_t config = make_config();
    start_stream(&config);
    describe_first();
    let_in = stream.port.unlock;
    stream.port.unlock = finish_behind;
    finishes = 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_stream_snapshot(&stream, 59, theta));
    step_until_idle();
    TEST_ASSERT_EQUAL_UINT32(0, stream.counters.snapshots);
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(&stream));
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
    RUN_TEST(texts_arrive_up_to_their_longest);
    RUN_TEST(health_takes_turns_from_the_index_on);
    RUN_TEST(health_tells_index_and_counters);
    RUN_TEST(a_reset_stream_has_no_credit);
    RUN_TEST(a_long_silence_earns_a_burst);
    RUN_TEST(the_shortest_frames_are_paced_too);
    RUN_TEST(farewell_says_stopped);
    RUN_TEST(nothing_leaves_after_the_end);
    RUN_TEST(an_end_announced_while_theta_is_copied_lets_no_snapshot_begin);
    RUN_TEST(reset_is_fresh);
    return UNITY_END();
}
