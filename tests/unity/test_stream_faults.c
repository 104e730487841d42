/* The streamer on a bus that refuses, and with settings, channels and memory that it must refuse. */
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

/* For every k: refuse the k-th call. A sample is lost and counted; everything else comes all the same, in order. */
static void refuse_each_call(uint8_t fd)
{
    static aeo_can_frame_t reference[KEPT], found[KEPT];
    aeo_stream_config_t config = make_config();
    unsigned total, sent, lasting, k;
    config.parameters = 40;
    config.past = 0;
    config.seal = 1;
    config.fd = fd;
    config.fd_ratio = 1;
    start_stream(&config);
    run_all();
    total = fake.calls;
    sent = fake.kept;
    lasting = lasting_frames(reference);
    TEST_ASSERT_EQUAL_UINT(total, sent);
    for (k = 0; k < total; k++) {
        set_up_bus();
        fake.refuse_at = k;
        start_stream(&config);
        run_all();
        TEST_ASSERT_EQUAL_UINT32(1, stream.counters.refused + stream.counters.dropped);
        TEST_ASSERT_EQUAL_UINT32(fake.kept, stream.counters.sent);
        TEST_ASSERT_EQUAL_UINT32(sent - stream.counters.dropped, stream.counters.sent);
        TEST_ASSERT_EQUAL_UINT(lasting, lasting_frames(found));
        TEST_ASSERT_EQUAL_MEMORY(reference, found, lasting * sizeof *found);
        TEST_ASSERT_EQUAL_INT(0, fake.lock_errors);
    }
}

static void refusal_at_every_call(void)
{
    refuse_each_call(0);
}

static void refusal_at_every_call_on_can_fd(void)
{
    refuse_each_call(1);
}

static void a_dead_bus_blocks_nothing(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k;
    start_stream(&config);
    fake.refuse_all = 1;
    for (k = 0; k < 1000u; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_sample(&stream, k, u, y, NULL));
        TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    }
    TEST_ASSERT_EQUAL_UINT32(5000, stream.counters.dropped);
    TEST_ASSERT_EQUAL_UINT32(1000, stream.counters.refused);
    fake.refuse_all = 0; /* the bus is back: the description comes first, whole */
    TEST_ASSERT_EQUAL_INT(16, aeo_stream_step(&stream));
    TEST_ASSERT_EQUAL_INT(AEO_KIND_DESCRIPTION, message_at(0).kind);
    TEST_ASSERT_EQUAL_UINT8(AEO_ITEM_WIRE, message_at(0).tag);
    TEST_ASSERT_EQUAL_UINT16(AEO_WIRE_VERSION, message_at(0).index);
}

static void refuse(const aeo_stream_config_t *config, int expected)
{
    aeo_stream_t before;
    memset(&stream, 0x5A, sizeof stream);
    before = stream;
    TEST_ASSERT_EQUAL_INT(expected, aeo_stream_init(&stream, config, &port, words, 65536));
    TEST_ASSERT_EQUAL_MEMORY(&before, &stream, sizeof stream);
}

#define REFUSE_WITH(field, value)                                                                                      \
    do {                                                                                                               \
        aeo_stream_config_t bad = make_config();                                                                       \
        bad.field = (value);                                                                                           \
        refuse(&bad, AEO_E_ARG);                                                                                       \
    } while (0)

static aeo_real_t make_nan(void)
{
    const uint32_t bits = 0x7FC00000u;
    float value;
    memcpy(&value, &bits, sizeof value);
    return (aeo_real_t)value;
}

static void settings_out_of_range(void)
{
    REFUSE_WITH(outputs, 0);
    REFUSE_WITH(outputs, 63);
    REFUSE_WITH(channels, NULL);
    REFUSE_WITH(parameters, 0);
    REFUSE_WITH(parameters, 65537);
    REFUSE_WITH(sample_time_s, AEO_REAL(0));
    REFUSE_WITH(sample_time_s, AEO_REAL(1001));
    REFUSE_WITH(sample_time_s, make_nan());
    REFUSE_WITH(lambda, make_nan());
    REFUSE_WITH(rho, make_nan());
    REFUSE_WITH(health_every, 0);
    REFUSE_WITH(describe_every, 0);
    REFUSE_WITH(repair_percent, 101);
    REFUSE_WITH(burst, 0);
    REFUSE_WITH(bits_per_s, 159);
    REFUSE_WITH(address.node, 254);
    REFUSE_WITH(address.base, 1);
    REFUSE_WITH(address.base, UINT32_C(0x18FEE000)); /* of others, and not forced */
    REFUSE_WITH(fd, 1);                              /* without a ratio */
}

static void can_fd_settings_out_of_range(void)
{
    aeo_stream_config_t config = make_config();
    config.fd = 1;
    config.fd_ratio = 17;
    refuse(&config, AEO_E_ARG);
    config.fd_ratio = 16;
    config.bits_per_s = 999;
    refuse(&config, AEO_E_ARG);
    config.bits_per_s = 1000; /* a sample of five channels is 59 + 22 bits, sixteen times as fast in the data phase */
    config.health_every = 10000;
    config.describe_every = 60000;
    config.sample_time_s = AEO_REAL(0.09);
    refuse(&config, AEO_E_BUDGET);
    config.sample_time_s = AEO_REAL(0.1);
    start_stream(&config);
}

static void bad_channels_pointers_and_memory(void)
{
    aeo_stream_config_t config = make_config();
    aeo_stream_channel_t bad[CHANNELS];
    memcpy(bad, channels, sizeof bad);
    config.channels = bad;
    bad[2].scale = AEO_REAL(0);
    refuse(&config, AEO_E_ARG);
    bad[2].scale = make_nan();
    refuse(&config, AEO_E_ARG);
    bad[2].scale = AEO_REAL(1);
    bad[2].offset = make_nan();
    refuse(&config, AEO_E_ARG);
    config = make_config();
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(NULL, &config, &port, words, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, NULL, &port, words, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &config, NULL, words, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &config, &port, NULL, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_stream_init(&stream, &config, &port, words, N - 1u));
    config.bits_per_s = 8000; /* five frames of 160 bits in 0.1 s are the whole of it */
    refuse(&config, AEO_E_BUDGET);
    config.sample_every = 2;
    start_stream(&config);
    port.unlock = NULL;
    config = make_config();
    refuse(&config, AEO_E_ARG);
    port.lock = NULL;
    start_stream(&config);
    port.send = NULL;
    refuse(&config, AEO_E_ARG);
}

static void null_arguments_later(void)
{
    const aeo_stream_config_t config = make_config();
    start_stream(&config);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_sample(NULL, 0, u, y, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_sample(&stream, 0, NULL, y, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_sample(&stream, 0, u, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_innovation(NULL, 0, y));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_innovation(&stream, 0, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_snapshot(NULL, 0, theta));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_snapshot(&stream, 0, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_health(NULL, 0, NULL, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_health(&stream, 0, NULL, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_health(&stream, 0, words, AEO_STREAM_COUNTERS + 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_step(NULL));
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(NULL));
    aeo_stream_finish(NULL);
    aeo_stream_reset(NULL);
    TEST_ASSERT_EQUAL_UINT(0, fake.calls);
}

/* Counters tell of a node that runs for years: at the top they stay, and a receiver never sees one go back. */
static void counters_stay_at_the_top(void)
{
    aeo_stream_config_t config = make_config();
    config.parameters = 40;
    config.past = 0;
    start_stream(&config);
    memset(&stream.counters, 0xFF, sizeof stream.counters);
    run_all();
    fake.refuse_all = 1;
    (void)aeo_stream_sample(&stream, 1, u, y, NULL);
    aeo_stream_reset(&stream);
    (void)aeo_stream_step(&stream);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 1, theta));
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_stream_snapshot(&stream, 1, theta));
    TEST_ASSERT_EQUAL_HEX32(UINT32_MAX, stream.counters.sent);
    TEST_ASSERT_EQUAL_HEX32(UINT32_MAX, stream.counters.refused);
    TEST_ASSERT_EQUAL_HEX32(UINT32_MAX, stream.counters.dropped);
    TEST_ASSERT_EQUAL_HEX32(UINT32_MAX, stream.counters.snapshots);
    TEST_ASSERT_EQUAL_HEX32(UINT32_MAX, stream.counters.busy);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(refusal_at_every_call);
    RUN_TEST(refusal_at_every_call_on_can_fd);
    RUN_TEST(a_dead_bus_blocks_nothing);
    RUN_TEST(settings_out_of_range);
    RUN_TEST(can_fd_settings_out_of_range);
    RUN_TEST(bad_channels_pointers_and_memory);
    RUN_TEST(null_arguments_later);
    RUN_TEST(counters_stay_at_the_top);
    return UNITY_END();
}
