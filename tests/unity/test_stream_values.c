/* Samples and innovations leave whole, in order, sealed on classic CAN and in few frames on CAN FD. */
#include "fake_bus.h"
#include "unity.h"

#include <string.h>

static const uint32_t INDEX = 0x12345678u;

void setUp(void)
{
    set_up_bus();
}

void tearDown(void)
{
    tear_down_bus();
}

static uint32_t seal_of(const aeo_real_t *values, unsigned count, unsigned tag)
{
    uint32_t crc = aeo_frame_crc32(UINT32_C(0xFFFFFFFF), stream.config.address.node | (tag << 8));
    unsigned i;
    crc = aeo_frame_crc32(crc, INDEX);
    for (i = 0; i < count; i++) {
        crc = aeo_frame_crc32(crc, aeo_float_bits(values[i]));
    }
    return ~crc;
}

static void start_sending(uint8_t seal, uint8_t fd)
{
    aeo_stream_config_t config = make_config();
    config.innovations = 1;
    config.seal = seal;
    config.fd = fd;
    config.fd_ratio = 1;
    start_stream(&config);
    describe_first();
}

static void a_seal_follows_the_last_channel(void)
{
    const aeo_real_t all[CHANNELS] = {1, 2, 3, 4, 5};
    unsigned i;
    start_sending(1, 0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_innovation(&stream, INDEX, all + INPUTS));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, INDEX, all, all + INPUTS, NULL));
    TEST_ASSERT_EQUAL_UINT(OUTPUTS + 1u + CHANNELS + 1u, fake.kept);
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        const unsigned at = i <= OUTPUTS ? i : i - OUTPUTS - 1u, last = i <= OUTPUTS ? OUTPUTS : CHANNELS;
        const aeo_real_t *values = i <= OUTPUTS ? all + INPUTS : all;
        TEST_ASSERT_EQUAL_UINT16(INDEX & 0xFFFFu, m.index);
        if (at == last) {
            TEST_ASSERT_EQUAL_INT(AEO_KIND_SEAL, m.kind);
            TEST_ASSERT_EQUAL_UINT8(last | (i <= OUTPUTS ? 0x80u : 0u), m.tag);
            TEST_ASSERT_EQUAL_HEX32(seal_of(values, last, m.tag), m.value[0]);
        } else {
            TEST_ASSERT_EQUAL_INT(i <= OUTPUTS ? AEO_KIND_INNOVATION : AEO_KIND_SAMPLE, m.kind);
            TEST_ASSERT_EQUAL_UINT8(at, m.tag);
            TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(values[at]), m.value[0]);
        }
    }
}

static void without_seal_there_is_none(void)
{
    start_sending(0, 0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_innovation(&stream, INDEX, y));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, INDEX, u, y, NULL));
    TEST_ASSERT_EQUAL_UINT(OUTPUTS + CHANNELS, fake.kept);
}

/* Scheduling channels come last, whatever is empty before them; a seal that is refused is a loss that is told. */
static void every_part_of_a_sample_may_be_empty(void)
{
    const aeo_real_t s[2] = {7, 8}, out[1] = {6};
    aeo_stream_config_t config = make_config();
    config.past = 0;
    config.inputs = 0;
    config.outputs = 1;
    config.scheduling = 2;
    config.seal = 1;
    start_stream(&config);
    describe_first();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, 1, NULL, out, s));
    TEST_ASSERT_EQUAL_UINT(4, fake.kept);
    TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(AEO_REAL(6)), message_at(0).value[0]);
    TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(AEO_REAL(8)), message_at(2).value[0]);
    fake.refuse_at = 7;
    TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_sample(&stream, 2, NULL, out, s));
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.dropped);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_sample(&stream, 3, NULL, out, NULL));
}

static void can_fd_carries_fourteen_channels_a_frame(void)
{
    static aeo_stream_channel_t many[64];
    static aeo_real_t in[40], out[20], s[4];
    aeo_stream_config_t config = make_config();
    unsigned i, j, next = 0;
    for (i = 0; i < 64u; i++) {
        many[i] = channels[0];
    }
    for (i = 0; i < 40u; i++) {
        in[i] = (aeo_real_t)i;
        out[i % 20u] = (aeo_real_t)(40u + i % 20u);
        s[i % 4u] = (aeo_real_t)(60u + i % 4u);
    }
    config.past = 0;
    config.inputs = 40;
    config.outputs = 20;
    config.scheduling = 4;
    config.channels = many;
    config.fd = 1;
    config.fd_ratio = 8;
    config.seal = 1; /* makes no difference here */
    start_stream(&config);
    while (aeo_stream_pending(&stream)) {
        (void)aeo_stream_step(&stream);
        fake.kept = 0;
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, INDEX, in, out, s));
    TEST_ASSERT_EQUAL_UINT(5, fake.kept);
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        TEST_ASSERT_EQUAL_INT(AEO_KIND_SAMPLE_FD, m.kind);
        TEST_ASSERT_EQUAL_UINT8(next, m.tag);
        TEST_ASSERT_EQUAL_UINT8(i < 4u ? 14u : 8u, m.count);
        for (j = 0; j < m.count; j++) {
            TEST_ASSERT_EQUAL_HEX32(aeo_float_bits((aeo_real_t)(next + j)), m.value[j]);
        }
        next += m.count;
    }
}

static void innovations_on_can_fd(void)
{
    start_sending(1, 1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_innovation(&stream, INDEX, y));
    TEST_ASSERT_EQUAL_UINT(1, fake.kept);
    TEST_ASSERT_EQUAL_INT(AEO_KIND_INNOVATION_FD, message_at(0).kind);
    TEST_ASSERT_EQUAL_UINT8(OUTPUTS, message_at(0).count);
}

static void the_description_names_the_values_a_frame(void)
{
    unsigned fd;
    for (fd = 0; fd < 2u; fd++) {
        aeo_stream_config_t config = make_config();
        config.fd = (uint8_t)fd;
        config.fd_ratio = 1;
        fake.kept = 0;
        start_stream(&config);
        step_until_idle();
        TEST_ASSERT_EQUAL_UINT8(AEO_ITEM_SHAPE, message_at(1).tag);
        TEST_ASSERT_EQUAL_UINT(fd ? 14u : 1u, message_at(1).value[0] >> 24);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_seal_follows_the_last_channel);
    RUN_TEST(without_seal_there_is_none);
    RUN_TEST(every_part_of_a_sample_may_be_empty);
    RUN_TEST(can_fd_carries_fourteen_channels_a_frame);
    RUN_TEST(innovations_on_can_fd);
    RUN_TEST(the_description_names_the_values_a_frame);
    return UNITY_END();
}
