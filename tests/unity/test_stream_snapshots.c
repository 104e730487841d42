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

/* CRC-32 of a snapshot as the header writes it: number, count and node, sample index, parameters. */
static uint32_t make_crc(const uint32_t *expected, uint32_t count, uint32_t number, uint32_t index)
{
    uint32_t crc = UINT32_C(0xFFFFFFFF), i;
    crc = aeo_frame_crc32(crc, number | ((count - 1u) << 8) | ((uint32_t)stream.config.address.node << 24));
    crc = aeo_frame_crc32(crc, index);
    for (i = 0; i < count; i++) {
        crc = aeo_frame_crc32(crc, expected[i]);
    }
    return ~crc;
}

/* Check that the frames kept are one whole snapshot of `expected`, other kinds aside. */
static void assert_snapshot(const uint32_t *expected, uint32_t count, uint32_t index)
{
    static uint8_t seen[65536];
    const uint32_t crc = make_crc(expected, count, stream.number, index);
    const unsigned fd = stream.config.fd != 0u ? AEO_KIND_FD : 0u;
    uint32_t i, j, parameters = 0, begins = 0, ends = 0, repairs = 0, frames = 0;
    memset(seen, 0, sizeof seen);
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        frames += m.kind != AEO_KIND_HEALTH && m.kind != AEO_KIND_DESCRIPTION;
        if (m.kind == AEO_KIND_BEGIN) {
            begins++;
            TEST_ASSERT_EQUAL_UINT32(index, m.value[0]);
            TEST_ASSERT_EQUAL_UINT32(count - 1u, m.index);
        } else if ((unsigned)m.kind == AEO_KIND_PARAMETER + fd) {
            TEST_ASSERT_EQUAL_UINT(fd ? (count - m.index < 14u ? count - m.index : 14u) : 1u, m.count);
            for (j = 0; j < m.count; j++) {
                parameters++;
                TEST_ASSERT_EQUAL_UINT8(0, seen[m.index + j]);
                seen[m.index + j] = 1;
                TEST_ASSERT_EQUAL_HEX32(expected[m.index + j], m.value[j]);
            }
        } else if (m.kind == AEO_KIND_END) {
            ends++;
            TEST_ASSERT_EQUAL_HEX32(crc, m.value[0]);
            TEST_ASSERT_EQUAL_UINT16(index & 0xFFFFu, m.index);
        } else if ((unsigned)m.kind == AEO_KIND_REPAIR + fd) {
            uint32_t sum[AEO_FRAME_VALUES_MAX];
            TEST_ASSERT_EQUAL_UINT16(repairs, m.index);
            aeo_spread_repair(&stream.spread, expected, count, m.count, m.index, sum);
            TEST_ASSERT_EQUAL_HEX32_ARRAY(sum, m.value, m.count);
            repairs++;
        }
    }
    TEST_ASSERT_EQUAL_UINT32(1, begins);
    TEST_ASSERT_EQUAL_UINT32(count, parameters);
    TEST_ASSERT_EQUAL_UINT32(3, ends);
    TEST_ASSERT_EQUAL_UINT32(stream.spread.repairs, repairs);
    TEST_ASSERT_EQUAL_UINT32(fd ? AEO_STREAM_FRAMES_FD(count, stream.config.repair_percent)
                                : AEO_STREAM_FRAMES(count, stream.config.repair_percent),
                             frames);
}

static void theta_arrives(uint8_t fd)
{
    static const uint32_t odd[] = {0x80000000u, 0x7F800000u, 0xFF800000u, 0x7FC00000u, 0x7F7FFFFFu, 0x00800000u};
    aeo_stream_config_t config = make_config();
    static uint32_t expected[N];
    unsigned i;
    config.fd = fd;
    config.fd_ratio = 4;
    start_stream(&config);
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
    TEST_ASSERT_EQUAL_UINT32(0, stream.counters.busy);
    memset(theta, 0, sizeof theta); /* the filter goes on: the copy must not move */
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_stream_snapshot(&stream, 70001, theta));
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.busy);
    step_until_idle();
    assert_snapshot(expected, N, 70000);
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.snapshots);
}

static void theta_arrives_bit_for_bit(void)
{
    theta_arrives(0);
}

static void theta_arrives_on_can_fd(void)
{
    theta_arrives(1);
}

/* Snapshots count from 1 to 255 and on from 0, in every frame of theirs: a host tells two of them apart. */
static void snapshots_are_numbered_one_by_one(void)
{
    aeo_stream_config_t config = make_config();
    config.past = 0;
    config.parameters = 2;
    config.repair_percent = 0;
    start_stream(&config);
    describe_first();
    for (uint32_t k = 1; k < 520u; k++) {
        const uint32_t expected[2] = {aeo_float_bits(theta[0]), aeo_float_bits(theta[1])};
        fake.kept = 0;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, k, theta));
        step_until_idle();
        TEST_ASSERT_EQUAL_UINT8(k & 255u, stream.number);
        for (unsigned i = 0; i < fake.kept; i++) {
            const aeo_message_t m = message_at(i);
            const int is_its = m.kind == AEO_KIND_BEGIN || m.kind == AEO_KIND_PARAMETER || m.kind == AEO_KIND_END;
            TEST_ASSERT_TRUE(!is_its || m.tag == (k & 255u));
        }
        assert_snapshot(expected, 2, k);
    }
}

/* Sizes around the edges of blocks and groups, with and without repair frames, and descriptions in between, whose turn
 * comes while repairs are prepared: the number of frames is the formula's. */
static void frames_are_as_many_as_the_formula_says(void)
{
    static const uint32_t sizes[] = {1, 2, 13, 14, 15, 28, 29, 255, 256, 257, 450, 1000};
    static uint32_t expected[1000];
    unsigned s, i, variant;
    for (i = 0; i < 1000u; i++) {
        expected[i] = aeo_float_bits(theta[i]);
    }
    for (s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        for (variant = 0; variant < 8u; variant++) {
            aeo_stream_config_t config = make_config();
            config.describe_every = (variant & 4u) != 0u ? 4 : config.describe_every;
            config.parameters = sizes[s];
            config.past = 0;
            config.fd = variant & 1u;
            config.fd_ratio = 2;
            config.repair_percent = (variant & 2u) != 0u ? 25 : 0;
            start_stream(&config);
            describe_first();
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 123456, theta));
            step_until_idle();
            assert_snapshot(expected, sizes[s], 123456);
        }
    }
}

/* Every size has each block once, and a burst of 16 lost frames takes parameters that are N / 40 apart. */
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

/* Whether positions up to 15 apart lie N / 40 parameters apart, and the stride that is chosen for it, written again. */
static int is_spread(uint32_t count, uint32_t stride)
{
    for (uint64_t apart = 1; apart < 16u; apart++) {
        const uint64_t at = apart * stride % count, other = count - at;
        if (40u * (at < other ? at : other) < count) {
            return 0;
        }
    }
    return 1;
}

static uint32_t find_stride(uint32_t count)
{
    const int64_t centre = ((int64_t)count * 618 + 500) / 1000;
    uint32_t coprime = 0;
    for (int64_t shift = 0; shift <= 16; shift++) { /* nearest first, the larger one before the smaller */
        for (int sign = 1; sign >= -1; sign -= 2) {
            const int64_t stride = centre + sign * shift;
            int64_t a = count, b = stride;
            if (stride < 1 || (stride >= count && count > 1u)) {
                continue;
            }
            while (b != 0) {
                const int64_t rest = a % b;
                a = b;
                b = rest;
            }
            if (a == 1 && is_spread(count, (uint32_t)stride)) {
                return (uint32_t)stride;
            }
            coprime = a == 1 && coprime == 0u ? (uint32_t)stride : coprime;
        }
    }
    return coprime > 0u ? coprime : 1u;
}

static void every_stride_is_the_nearest_that_spreads(void)
{
    for (uint32_t count = 1; count <= 65536u; count += count < 8192u ? 1u : 61u) {
        aeo_spread_t spread;
        aeo_spread_choose(&spread, count, 10);
        TEST_ASSERT_EQUAL_UINT32(find_stride(count), spread.stride);
        TEST_ASSERT_TRUE(count < 16u || is_spread(count, spread.stride));
        TEST_ASSERT_EQUAL_UINT32((count + 255u) / 256u, spread.groups);
        TEST_ASSERT_EQUAL_UINT32(count / 10u + 8u * spread.groups, spread.repairs);
    }
}

/* A repair's number has 16 bits: 65535 at most, which 63543 blocks with a repair for each reach. */
static void repairs_end_at_what_their_number_holds(void)
{
    for (uint32_t count = 63500; count < 63600u; count++) {
        const uint32_t all = count + 8u * ((count + 255u) / 256u);
        aeo_spread_t spread;
        aeo_spread_choose(&spread, count, 100);
        TEST_ASSERT_EQUAL_UINT32(all < 65535u ? all : 65535u, spread.repairs);
    }
}

/* Any one lost block is the exclusive or of a repair frame and the other members of its set, at every size. */
static void repair_restores_a_lost_block(void)
{
    static const uint32_t sizes[] = {1, 2, 33, 256, 257, 600, 65536};
    unsigned s, width;
    for (s = 0; s < 2u * sizeof sizes / sizeof *sizes; s++) {
        const uint32_t parameters = sizes[s / 2u];
        const uint32_t count = s % 2u == 0u ? parameters : AEO_STREAM_BLOCKS(parameters);
        aeo_spread_t spread;
        uint32_t i, lost;
        width = s % 2u == 0u ? 1u : 14u;
        aeo_spread_choose(&spread, count, 25);
        for (i = 0; i < parameters; i++) {
            words[i] = i * UINT32_C(2654435761) + 12345u;
        }
        for (lost = 0; lost < count; lost += 1u + count / 50u) { /* position of the lost one */
            const uint32_t group = lost % spread.groups, member = lost / spread.groups,
                           at = aeo_spread_index(&spread, lost) * width;
            uint32_t truth[14], with[14], without[14];
            uint32_t repair = group;
            while (((aeo_frame_repair_set((uint16_t)repair, member / 32u) >> (member % 32u)) & 1u) == 0u) {
                repair += spread.groups;
                TEST_ASSERT_TRUE(repair < 65536u);
            }
            aeo_spread_repair(&spread, words, parameters, width, (uint16_t)repair, with);
            for (i = 0; i < width; i++) {
                truth[i] = at + i < parameters ? words[at + i] : 0u;
                words[at + i] = at + i < parameters ? 0u : words[at + i];
            }
            aeo_spread_repair(&spread, words, parameters, width, (uint16_t)repair, without);
            for (i = 0; i < width; i++) {
                TEST_ASSERT_EQUAL_HEX32(truth[i], with[i] ^ without[i]);
                words[at + i] = at + i < parameters ? truth[i] : words[at + i];
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(theta_arrives_bit_for_bit);
    RUN_TEST(theta_arrives_on_can_fd);
    RUN_TEST(frames_are_as_many_as_the_formula_says);
    RUN_TEST(order_is_a_spread_permutation);
    RUN_TEST(snapshots_are_numbered_one_by_one);
    RUN_TEST(every_stride_is_the_nearest_that_spreads);
    RUN_TEST(repairs_end_at_what_their_number_holds);
    RUN_TEST(repair_restores_a_lost_block);
    return UNITY_END();
}
