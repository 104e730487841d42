/* What a host has to compute alike: hashes by another program, which values go when, and which identifiers exist. */
#include "aeolid/status.h"
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

/* Computed outside this library from the text of frame.h: integers of unbounded size, reduced modulo 2^32. */
static void repair_sets_are_drawn_as_elsewhere(void)
{
    static const struct {
        uint16_t repair;
        uint32_t word, set;
    } golden[] = {{0, 0, 0x92CA2F0Eu},   {1, 0, 0x5032E8F1u},     {0, 7, 0x2316A329u},
                  {255, 3, 0xB0A35870u}, {65535, 7, 0xD74838CAu}, {4660, 5, 0x7532E876u}};
    for (unsigned i = 0; i < sizeof golden / sizeof *golden; i++) {
        TEST_ASSERT_EQUAL_HEX32(golden[i].set, aeo_frame_repair_set(golden[i].repair, golden[i].word));
    }
}

/* zlib's CRC-32 over the items of this very configuration, listed by hand from describe.h: 35 of them. */
static void a_configuration_is_hashed_as_elsewhere(void)
{
    const aeo_stream_config_t config = make_config();
    unsigned items = 0;
    start_stream(&config);
    step_until_idle();
    for (unsigned i = 0; i < fake.kept; i++) {
        const aeo_message_t message = message_at(i);
        items += message.kind == AEO_KIND_DESCRIPTION;
        if (message.kind == AEO_KIND_DESCRIPTION && message.tag == (uint8_t)AEO_ITEM_WIRE) {
            TEST_ASSERT_EQUAL_HEX32(0x28F57290u, message.value[0]);
            TEST_ASSERT_EQUAL_UINT16(2, message.index);
        }
    }
    TEST_ASSERT_EQUAL_UINT(1u + 35u, items);
}

/* Every item of the description, by hand. */
static void items_say_what_they_mean(void)
{
    const aeo_stream_config_t config = make_config();
    start_stream(&config);
    step_until_idle();
    unsigned seen = 0;
    for (unsigned i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        if (m.kind == AEO_KIND_DESCRIPTION && m.tag == (uint8_t)AEO_ITEM_OFFSET) {
            TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(channels[m.index].offset), m.value[0]);
            seen++;
        } else if (m.kind == AEO_KIND_DESCRIPTION && m.tag == (uint8_t)AEO_ITEM_SCALE) {
            TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(channels[m.index].scale), m.value[0]);
            seen++;
        } else if (m.kind == AEO_KIND_DESCRIPTION && m.tag == (uint8_t)AEO_ITEM_UNIT && m.index == 0u) {
            TEST_ASSERT_EQUAL_HEX32(0x00676564u, m.value[0]); /* "deg" */
            seen++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(2u * CHANNELS + 1u, seen);
}

/* Innovations go with the samples they belong to: every third, and none where no sample goes. */
static void innovations_go_with_their_samples(void)
{
    static const uint16_t every[] = {0, 1, 3};
    for (unsigned e = 0; e < 3u; e++) {
        aeo_stream_config_t config = make_config();
        unsigned innovations = 0, samples = 0;
        config.innovations = 1;
        config.sample_every = every[e];
        start_stream(&config);
        describe_first();
        for (uint32_t k = 100; k < 112; k++) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_innovation(&stream, k, y));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, k, u, y, NULL));
        }
        for (unsigned i = 0; i < fake.kept; i++) {
            const aeo_message_t message = message_at(i);
            innovations += message.kind == AEO_KIND_INNOVATION;
            samples += message.kind == AEO_KIND_SAMPLE;
            TEST_ASSERT_TRUE(every[e] > 0u && message.index % every[e] == 0u);
        }
        const unsigned sent = every[e] == 0u ? 0u : 12u / every[e];
        TEST_ASSERT_EQUAL_UINT(sent * OUTPUTS, innovations);
        TEST_ASSERT_EQUAL_UINT(sent * CHANNELS, samples);
        TEST_ASSERT_EQUAL_UINT32(111, stream.last_index);
        set_up_bus();
    }
}

/* Of an 11-bit base no bit may stand where kinds and nodes go: 6 of them, or 8 where the base is a multiple of 0x100. */
static void bases_leave_room_for_kinds_and_nodes(void)
{
    const aeo_message_t message = {AEO_KIND_SEAL, 1, 2, 1, {3}};
    aeo_address_t address = {0, 0, AEO_ADDRESS_FORCED};
    aeo_can_frame_t frame;
    for (uint32_t base = 0; base < 0x900u; base++) {
        const int whole = base < 0x800u && base % 0x40u == 0u;
        const unsigned step = base % 0x100u == 0u ? 16u : 4u;
        address.base = base;
        address.node = (uint8_t)(step - 1u);
        TEST_ASSERT_EQUAL_INT(whole ? AEO_OK : AEO_E_ARG, aeo_frame_pack(&address, &message, &frame));
        if (whole) {
            TEST_ASSERT_EQUAL_HEX32(base + step * (unsigned)AEO_KIND_SEAL + step - 1u, frame.id);
        }
    }
    address.extended = AEO_ADDRESS_FORCED | 1u;
    for (unsigned bit = 0; bit < 31u; bit++) {
        address.base = UINT32_C(1) << bit;
        TEST_ASSERT_EQUAL_INT(bit >= 13u && bit < 29u ? AEO_OK : AEO_E_ARG, aeo_frame_pack(&address, &message, &frame));
    }
}

/* A CAN FD frame has the shortest length for its count; another count with a true check is damage. */
static void counts_fit_their_lengths(void)
{
    static const uint8_t length[15] = {0, 12, 16, 20, 24, 32, 32, 48, 48, 48, 48, 64, 64, 64, 64};
    const aeo_address_t address = {AEO_FRAME_BASE_EXTENDED, 7, 1};
    for (unsigned count = 1; count <= 14u; count++) {
        aeo_message_t message, back;
        aeo_can_frame_t frame;
        uint8_t node;
        memset(&message, 0, sizeof message);
        message.kind = AEO_KIND_SAMPLE_FD;
        message.count = (uint8_t)count;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&address, &message, &frame));
        TEST_ASSERT_EQUAL_UINT8(length[count], frame.length);
        for (unsigned other = 0; other < 256u; other++) {
            uint32_t crc;
            frame.data[3] = (uint8_t)other;
            crc = aeo_frame_crc32(UINT32_C(0xFFFFFFFF), frame.id);
            crc = aeo_frame_crc32(crc, (uint32_t)other << 24);
            for (unsigned word = 2; word < frame.length / 4u; word++) {
                crc = aeo_frame_crc32(crc, 0);
            }
            for (unsigned byte = 0; byte < 4u; byte++) {
                frame.data[4u + byte] = (uint8_t)((~crc >> (8u * byte)) & 0xFFu);
            }
            TEST_ASSERT_EQUAL_INT(other >= 1u && other <= 14u && length[other] == frame.length ? AEO_OK : AEO_E_DAMAGED,
                                  aeo_frame_unpack(&address, &frame, &back, &node));
        }
    }
}

/* The macros of stream.h and frame.h, added up by hand from the standard's field lengths. */
static void lengths_on_the_bus_are_the_standards(void)
{
    TEST_ASSERT_EQUAL_UINT(54 + 64 + (54 + 64 - 1) / 4 + 13, AEO_FRAME_BITS_EXTENDED);
    TEST_ASSERT_EQUAL_UINT(34 + 64 + (34 + 64 - 1) / 4 + 13, AEO_FRAME_BITS_STANDARD);
    /* 12 bytes at 4 times the rate: 120 + 7 + 27 bits = 38.5 -> 39 and 59 */
    TEST_ASSERT_EQUAL_UINT(59 + 39, AEO_FRAME_FD_BITS_EXTENDED(12u, 4u));
    TEST_ASSERT_EQUAL_UINT(36 + (640 + 6 + 32), AEO_FRAME_FD_BITS_STANDARD(64u, 1u));
}

/* Each setting at its ends and one beyond: what is accepted is what stream.h says. */
static void settings_end_where_they_should(void)
{
    enum { CASES = 25 };
    for (unsigned i = 0; i < CASES; i++) {
        aeo_stream_config_t c = make_config();
        aeo_status_t expected = AEO_OK;
        c.past = 0;
        c.burst = 255;
        switch (i) {
        case 0:
            c.parameters = 1;
            break;
        case 1:
            c.parameters = 65536;
            break;
        case 2:
            c.parameters = 65537;
            expected = AEO_E_ARG;
            break;
        case 3:
            c.parameters = 0;
            expected = AEO_E_ARG;
            break;
        case 4:
            c.health_every = 1;
            break;
        case 5:
            c.health_every = 0;
            expected = AEO_E_ARG;
            break;
        case 6:
            c.describe_every = 1;
            break;
        case 7:
            c.describe_every = 0;
            expected = AEO_E_ARG;
            break;
        case 8:
            c.repair_percent = 100;
            break;
        case 9:
            c.repair_percent = 101;
            expected = AEO_E_ARG;
            break;
        case 10:
            c.burst = 0;
            expected = AEO_E_ARG;
            break;
        case 11:
            c.burst = 1;
            break;
        case 12:
            c.fd = 1;
            c.fd_ratio = 1;
            break;
        case 13:
            c.fd = 1;
            c.fd_ratio = 0;
            expected = AEO_E_ARG;
            break;
        case 14:
            c.fd = 1;
            c.fd_ratio = 16;
            break;
        case 15:
            c.fd = 1;
            c.fd_ratio = 17;
            expected = AEO_E_ARG;
            break;
        case 16:
            c.sample_time_s = AEO_REAL(1.9e-5);
            expected = AEO_E_ARG;
            break;
        case 17:
            c.sample_time_s = AEO_REAL(1000);
            break;
        case 18:
            c.sample_time_s = AEO_REAL(1001);
            expected = AEO_E_ARG;
            break;
        case 19:
            c.bits_per_s = 159;
            expected = AEO_E_ARG;
            break;
        case 20:
            c.bits_per_s = 160;
            c.sample_time_s = AEO_REAL(1000);
            break;
        case 21:
            c.fd = 1;
            c.fd_ratio = 1;
            c.bits_per_s = 999;
            expected = AEO_E_ARG;
            break;
        case 22:
            c.fd = 1;
            c.fd_ratio = 1;
            c.bits_per_s = 1000;
            c.sample_time_s = AEO_REAL(1000);
            break;
        case 23:
            c.outputs = 0;
            expected = AEO_E_ARG;
            break;
        default:
            c.channels = NULL;
            expected = AEO_E_ARG;
            break;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(expected, aeo_stream_init(&stream, &c, &port, words, PARAMETERS_MAX), "setting");
    }
}

/* While a snapshot is under way every fourth frame is description, as long as one is due. */
static void a_description_has_every_fourth_frame(void)
{
    aeo_stream_config_t config = make_config();
    unsigned first = 0, last = 0, seen = 0;
    config.describe_every = 1;
    config.burst = 255;
    config.health_every = 60000;
    start_stream(&config);
    (void)aeo_stream_step(&stream); /* the first description goes alone */
    fake.kept = 0;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 0, theta));
    (void)aeo_stream_step(&stream);
    TEST_ASSERT_EQUAL_UINT(255, fake.kept);
    for (unsigned i = 0; i < fake.kept; i++) {
        if (message_at(i).kind == AEO_KIND_DESCRIPTION) {
            first = seen == 0u ? i : first;
            last = i;
            seen++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(36, seen);
    TEST_ASSERT_EQUAL_UINT(35u * 4u, last - first);
}

/* The order of few parameters: the coprime number nearest to 0.618 N, computed elsewhere. */
static void few_parameters_go_in_the_known_order(void)
{
    static const uint32_t stride[16] = {0, 1, 1, 2, 3, 3, 5, 4, 5, 7, 7, 7, 7, 8, 9, 8};
    for (uint32_t count = 1; count < 16u; count++) {
        aeo_spread_t spread;
        aeo_spread_choose(&spread, count, 25);
        TEST_ASSERT_EQUAL_UINT32(stride[count], spread.stride);
        TEST_ASSERT_EQUAL_UINT32(1, spread.groups);
        TEST_ASSERT_EQUAL_UINT32(count / 4u + 8u, spread.repairs);
    }
}

/* Time before the start earns nothing, whatever the clock says: credit is for the time since init. */
static void the_past_earns_no_credit(void)
{
    aeo_stream_config_t config = make_config();
    config.bits_per_s = 25000;
    port.time_us = read_clock;
    fake.now_us = 123456789;
    start_stream(&config);
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    fake.now_us += 100000; /* 2,500 bits: fifteen frames of 160 */
    TEST_ASSERT_EQUAL_INT(15, aeo_stream_step(&stream));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(repair_sets_are_drawn_as_elsewhere);
    RUN_TEST(a_configuration_is_hashed_as_elsewhere);
    RUN_TEST(items_say_what_they_mean);
    RUN_TEST(innovations_go_with_their_samples);
    RUN_TEST(bases_leave_room_for_kinds_and_nodes);
    RUN_TEST(counts_fit_their_lengths);
    RUN_TEST(lengths_on_the_bus_are_the_standards);
    RUN_TEST(settings_end_where_they_should);
    RUN_TEST(a_description_has_every_fourth_frame);
    RUN_TEST(few_parameters_go_in_the_known_order);
    RUN_TEST(the_past_earns_no_credit);
    return UNITY_END();
}
