/* Snapshots of theta arrive bit for bit, in an order and with repairs that lose little to a burst. */
#include "fake_bus.h"
#include "spread.h"
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

/* Check that the frames kept are one whole snapshot of `expected`, other kinds aside. */
static void assert_snapshot(const uint32_t *expected, uint32_t count, uint32_t index)
{
    static uint8_t seen[65536];
    uint32_t crc = UINT32_C(0xFFFFFFFF), i, parameters = 0, begins = 0, ends = 0, repairs = 0;
    memset(seen, 0, sizeof seen);
    for (i = 0; i < count; i++) {
        crc = aeo_frame_crc32(crc, expected[i]);
    }
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        if (m.kind == AEO_KIND_BEGIN) {
            begins++;
            TEST_ASSERT_EQUAL_UINT32(index, m.value[0]);
            TEST_ASSERT_EQUAL_UINT32(count - 1u, m.index);
        } else if (m.kind == AEO_KIND_PARAMETER) {
            parameters++;
            TEST_ASSERT_EQUAL_UINT8(0, seen[m.index]);
            seen[m.index] = 1;
            TEST_ASSERT_EQUAL_HEX32(expected[m.index], m.value[0]);
        } else if (m.kind == AEO_KIND_END) {
            ends++;
            TEST_ASSERT_EQUAL_HEX32(~crc, m.value[0]);
            TEST_ASSERT_EQUAL_UINT16(index & 0xFFFFu, m.index);
        } else if (m.kind == AEO_KIND_REPAIR) {
            TEST_ASSERT_EQUAL_UINT16(repairs, m.index);
            repairs++;
        }
    }
    TEST_ASSERT_EQUAL_UINT32(1, begins);
    TEST_ASSERT_EQUAL_UINT32(count, parameters);
    TEST_ASSERT_EQUAL_UINT32(3, ends);
    TEST_ASSERT_EQUAL_UINT32(stream.spread.repairs, repairs);
}

static void theta_arrives_bit_for_bit(void)
{
    static const uint32_t odd[] = {0x80000000u, 0x7F800000u, 0xFF800000u, 0x7FC00000u, 0x7F7FFFFFu, 0x00800000u};
    const aeo_stream_config_t config = make_config();
    static uint32_t expected[N];
    unsigned i;
    start(&config);
    describe_first();
    for (i = 0; i < 6u; i++) { /* -0, infinities, NaN, largest, smallest normal */
        float value;
        memcpy(&value, &odd[i], sizeof value);
        theta[i] = (aeo_real_t)value;
    }
    for (i = 0; i < N; i++) {
        expected[i] = aeo_float_bits(theta[i]);
    }
    TEST_ASSERT_EQUAL_HEX32_ARRAY(odd, expected, 6);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 70000, theta));
    memset(theta, 0, sizeof theta); /* the filter goes on: the copy must not move */
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_stream_snapshot(&stream, 70001, theta));
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.busy);
    step_until_idle();
    assert_snapshot(expected, N, 70000);
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.snapshots);
}

/* Every size has each parameter once, and a burst of 16 lost frames takes parameters that are N / 40 apart. */
static void order_is_a_spread_permutation(void)
{
    static const uint32_t sizes[] = {1,   2,   3,   5,   7,   16,   40,   255,   256,
                                     257, 300, 456, 512, 513, 1021, 4096, 65535, 65536};
    static uint8_t seen[65536];
    unsigned s;
    for (s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        aeo_spread_t spread;
        uint32_t q, j;
        aeo_spread_choose(&spread, sizes[s], 25);
        memset(seen, 0, sizeof seen);
        for (q = 0; q < sizes[s]; q++) {
            const uint32_t at = aeo_spread_index(&spread, q);
            TEST_ASSERT_TRUE(at < sizes[s]);
            TEST_ASSERT_EQUAL_UINT8(0, seen[at]);
            seen[at] = 1;
            for (j = 1; sizes[s] >= 16u && j < 16u && q + j < sizes[s]; j++) {
                const uint32_t other = aeo_spread_index(&spread, q + j);
                TEST_ASSERT_TRUE((at > other ? at - other : other - at) * 40u >= sizes[s]);
            }
        }
        TEST_ASSERT_TRUE(spread.groups * 256u >= sizes[s]);
        TEST_ASSERT_EQUAL_UINT32(sizes[s] / 4u + 8u * spread.groups, spread.repairs);
        aeo_spread_choose(&spread, sizes[s], 100);
        TEST_ASSERT_TRUE(spread.repairs <= 65535u); /* what its number can hold */
        aeo_spread_choose(&spread, sizes[s], 0);
        TEST_ASSERT_EQUAL_UINT32(0, spread.repairs);
    }
}

/* Any one lost parameter is the exclusive or of a repair frame and the other members of its set, at every size. */
static void repair_restores_a_lost_parameter(void)
{
    static const uint32_t sizes[] = {1, 2, 33, 256, 257, 600, 65536};
    unsigned s;
    for (s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        aeo_spread_t spread;
        uint32_t i, lost;
        aeo_spread_choose(&spread, sizes[s], 25);
        for (i = 0; i < sizes[s]; i++) {
            memory[i] = i * UINT32_C(2654435761) + 12345u;
        }
        for (lost = 0; lost < sizes[s]; lost += 1u + sizes[s] / 50u) { /* position of the lost one */
            const uint32_t group = lost % spread.groups, member = lost / spread.groups,
                           at = aeo_spread_index(&spread, lost);
            const uint32_t truth = memory[at];
            uint32_t repair = group;
            uint32_t with;
            while (((aeo_frame_repair_set((uint16_t)repair, member / 32u) >> (member % 32u)) & 1u) == 0u) {
                repair += spread.groups;
                TEST_ASSERT_TRUE(repair < 65536u);
            }
            with = aeo_spread_repair(&spread, memory, (uint16_t)repair);
            memory[at] = 0;
            TEST_ASSERT_EQUAL_HEX32(truth, with ^ aeo_spread_repair(&spread, memory, (uint16_t)repair));
            memory[at] = truth;
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(theta_arrives_bit_for_bit);
    RUN_TEST(order_is_a_spread_permutation);
    RUN_TEST(repair_restores_a_lost_parameter);
    return UNITY_END();
}
