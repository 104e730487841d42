/* Frames: golden bytes of an independent program, round trips over all kinds, nodes and counts, damage of every
 * kind. */
#include "aeolid/frame.h"
#include "aeolid/status.h"
#include "unity.h"

#include <string.h>

static const aeo_address_t extended = {AEO_FRAME_BASE_EXTENDED, 7, 1};
static const aeo_address_t standard = {AEO_FRAME_BASE_STANDARD, 3, 0};
static const aeo_address_t wide = {0x600, 9, AEO_ADDRESS_FORCED}; /* where 11 bit identifiers began before */
static uint32_t state = 2463534242u;

void setUp(void)
{
}

void tearDown(void)
{
}

static uint32_t draw_word(void)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

static aeo_message_t make_message(aeo_kind_t kind, unsigned count)
{
    aeo_message_t message;
    unsigned i;
    memset(&message, 0, sizeof message);
    message.kind = kind;
    message.tag = (uint8_t)(draw_word() & 0xFFu);
    message.index = (uint16_t)(draw_word() & 0xFFFFu);
    message.count = (uint8_t)count;
    for (i = 0; i < count; i++) {
        message.value[i] = draw_word();
    }
    return message;
}

static void assert_same(const aeo_message_t *a, const aeo_message_t *b)
{
    TEST_ASSERT_EQUAL_INT(a->kind, b->kind);
    TEST_ASSERT_EQUAL_UINT8(a->tag, b->tag);
    TEST_ASSERT_EQUAL_UINT16(a->index, b->index);
    TEST_ASSERT_EQUAL_UINT8(a->count, b->count);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(a->value, b->value, a->count);
}

/* Computed bit by bit with CRC-8/AUTOSAR and with zlib's CRC-32 outside this library. */
static void golden_frames(void)
{
    static const uint8_t sample[8] = {0x03, 0xF4, 0x01, 0x90, 0x00, 0x00, 0xC0, 0x3F};
    static const uint8_t parameter[8] = {0xC8, 0xFF, 0xFF, 0x5A, 0xEF, 0xBE, 0xAD, 0xDE};
    static const uint8_t compact[8] = {0xC8, 0xFF, 0xFF, 0xFE, 0xEF, 0xBE, 0xAD, 0xDE};
    static const uint8_t seal[8] = {0x05, 0xF4, 0x01, 0x29, 0x26, 0x39, 0xF4, 0xCB};
    static const uint8_t block[20] = {0x01, 0x0E, 0x00, 0x03, 0x78, 0xDC, 0x45, 0x41, 0x01, 0x00,
                                      0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x00};
    static const uint8_t values[32] = {0x00, 0xF4, 0x01, 0x05, 0xCB, 0x3F, 0x4A, 0xD2, 0x01, 0x00, 0x00,
                                       0x00, 0x02, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x00, 0x04, 0x00,
                                       0x00, 0x00, 0x05, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00};
    const aeo_address_t last = {AEO_FRAME_BASE_EXTENDED, 253, 1};
    aeo_message_t message = {AEO_KIND_SAMPLE, 3, 500, 1, {0}};
    aeo_can_frame_t frame;
    message.value[0] = aeo_float_bits(AEO_REAL(1.5));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&extended, &message, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x1CFF4207u, frame.id);
    TEST_ASSERT_EQUAL_UINT8(AEO_CAN_EXTENDED, frame.flags);
    TEST_ASSERT_EQUAL_UINT8(8, frame.length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(sample, frame.data, 8);
    message = (aeo_message_t){AEO_KIND_PARAMETER, 200, 65535, 1, {0xDEADBEEFu}};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&wide, &message, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x659u, frame.id);
    TEST_ASSERT_EQUAL_UINT8(0, frame.flags);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(parameter, frame.data, 8);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&standard, &message, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x697u, frame.id);
    TEST_ASSERT_EQUAL_UINT8(0, frame.flags);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(compact, frame.data, 8);
    message = (aeo_message_t){AEO_KIND_SEAL, 5, 500, 1, {0xCBF43926u}};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&extended, &message, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x1CFF4807u, frame.id);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(seal, frame.data, 8);
    message = (aeo_message_t){AEO_KIND_PARAMETER_FD, 1, 14, 3, {1, 2, 3}};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&last, &message, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x1CFF4DFDu, frame.id);
    TEST_ASSERT_EQUAL_UINT8(20, frame.length);
    TEST_ASSERT_EQUAL_UINT8(AEO_CAN_EXTENDED | AEO_CAN_FD | AEO_CAN_BRS, frame.flags);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(block, frame.data, 20);
    memset(&frame, 0x5A, sizeof frame); /* what pads a frame is zero, whatever was there */
    message = (aeo_message_t){AEO_KIND_SAMPLE_FD, 0, 500, 5, {1, 2, 3, 4, 5, 6}};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&wide, &message, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x6A9u, frame.id);
    TEST_ASSERT_EQUAL_UINT8(32, frame.length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(values, frame.data, 32);
}

static void crc32_is_ieee(void)
{
    uint32_t crc = UINT32_C(0xFFFFFFFF); /* "12345678" as two little-endian words */
    crc = aeo_frame_crc32(crc, UINT32_C(0x34333231));
    crc = aeo_frame_crc32(crc, UINT32_C(0x38373635));
    TEST_ASSERT_EQUAL_HEX32(0x9AE0DAAFu, ~crc);
}

static unsigned most_values(unsigned kind) /* 0: no such kind */
{
    return kind <= 8u ? 1u : kind == 10u || kind == 11u || kind == 13u || kind == 14u ? 14u : 0u;
}

static void round_trips(void)
{
    unsigned kind, node, count;
    for (kind = 0; kind < AEO_KIND_LIMIT; kind++) {
        for (node = 0; node < 254; node++) {
            for (count = 1; count <= most_values(kind); count++) {
                aeo_address_t address = node >= 16u || count % 2u == 0u ? extended : node % 2u == 0u ? wide : standard;
                const aeo_message_t message = make_message((aeo_kind_t)kind, count);
                aeo_message_t back;
                aeo_can_frame_t frame;
                uint8_t found = 255, meant;
                address.node = (uint8_t)node;
                if (address.base == standard.base) {
                    address.node = (uint8_t)(node % 4u);
                }
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&address, &message, &frame));
                TEST_ASSERT_EQUAL_UINT8(most_values(kind) > 1u ? AEO_FRAME_FD_LENGTH(count) : 8u, frame.length);
                meant = address.node;
                address.node = 0; /* the receiver names the node, whatever its own number, and reads at any base */
                address.extended &= 1u;
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_unpack(&address, &frame, &back, &found));
                TEST_ASSERT_EQUAL_UINT8(meant, found);
                assert_same(&message, &back);
            }
        }
    }
}

static void flip(aeo_can_frame_t *frame, unsigned bit)
{
    if (bit < 64u) {
        frame->data[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
    } else {
        frame->id ^= UINT32_C(1) << (bit - 64u + 8u); /* kind and base; the node is not covered */
    }
}

/* Hamming distance 4: one, two or three wrong bits in data, kind or base never pass. */
static void three_wrong_bits_are_seen(void)
{
    const aeo_message_t message = make_message(AEO_KIND_PARAMETER, 1);
    aeo_can_frame_t frame, bad;
    aeo_message_t back;
    uint8_t node;
    unsigned i, j, k;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&extended, &message, &frame));
    for (i = 0; i < 85u; i++) {
        for (j = i; j < 85u; j++) {
            for (k = j; k < 85u; k++) { /* equal numbers cancel: i = j = k is one wrong bit */
                bad = frame;
                flip(&bad, i);
                if (j != i) {
                    flip(&bad, j);
                }
                if (k != j) {
                    flip(&bad, k);
                }
                if (memcmp(&bad, &frame, sizeof bad) != 0) {
                    TEST_ASSERT_TRUE(aeo_frame_unpack(&extended, &bad, &back, &node) < 0);
                }
            }
        }
    }
}

/* CAN FD: any one wrong bit of data or identifier, node and padding included, and any two of 2000 drawn pairs. */
static void wrong_bits_of_can_fd_are_seen(void)
{
    unsigned count, i, k;
    for (count = 1; count <= 14u; count++) {
        const aeo_message_t message = make_message(AEO_KIND_PARAMETER_FD, count);
        aeo_can_frame_t frame, bad;
        aeo_message_t back;
        uint8_t node;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&extended, &message, &frame));
        for (i = 0; i < 8u * frame.length + 29u + 2000u; i++) {
            unsigned bit[2];
            const unsigned bits = 8u * frame.length + 29u, wrong = i < bits ? 1u : 2u;
            bit[0] = i < bits ? i : draw_word() % bits;
            bit[1] = draw_word() % bits;
            bad = frame;
            for (k = 0; k < wrong; k++) {
                if (bit[k] < 29u) {
                    bad.id ^= UINT32_C(1) << bit[k];
                } else {
                    bad.data[(bit[k] - 29u) / 8u] ^= (uint8_t)(1u << ((bit[k] - 29u) % 8u));
                }
            }
            if (wrong == 1u || bit[0] != bit[1]) {
                TEST_ASSERT_TRUE(aeo_frame_unpack(&extended, &bad, &back, &node) < 0);
            }
        }
    }
}

static void foreign_frames_are_left_alone(void)
{
    const aeo_message_t message = make_message(AEO_KIND_SAMPLE, 1);
    aeo_message_t back, untouched;
    aeo_can_frame_t frame, other;
    uint8_t node = 77;
    unsigned length;
    memset(&back, 0x5A, sizeof back);
    untouched = back;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&extended, &message, &frame));
    other = frame;
    other.id = AEO_FRAME_BASE_EXTENDED - 1u;
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
    other.id = AEO_FRAME_BASE_EXTENDED + 256u * AEO_KIND_LIMIT;
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
    other.id = AEO_FRAME_BASE_EXTENDED + 256u * 9u; /* no such kind */
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
    other.id = AEO_FRAME_BASE_EXTENDED + 256u * AEO_KIND_SAMPLE_FD; /* a CAN FD kind in a classic frame */
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
    other.length = 12;
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
    other = frame;
    other.flags = 0;
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
    other = frame;
    other.id |= 0xFFu; /* node 255 does not exist */
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
    for (length = 0; length < 256u; length++) {
        other = frame;
        other.length = (uint8_t)length;
        if (length != 8u) {
            TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&extended, &other, &back, &node));
        }
    }
    other = frame;
    other.data[3] ^= 1u;
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_frame_unpack(&extended, &other, &back, &node));
    TEST_ASSERT_EQUAL_UINT8(77, node);
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &back, sizeof back);
}

/* Values that a frame does not have are left as they were. */
static void unpacking_writes_no_further_value(void)
{
    for (unsigned count = 1; count <= AEO_FRAME_VALUES_MAX; count++) {
        struct {
            aeo_message_t message;
            uint32_t behind;
        } found;
        aeo_message_t sent = make_message(AEO_KIND_SAMPLE_FD, (uint8_t)count);
        aeo_can_frame_t frame;
        uint8_t node;
        sent.count = (uint8_t)count;
        memset(&found, 0x5A, sizeof found);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&extended, &sent, &frame));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_unpack(&extended, &frame, &found.message, &node));
        for (unsigned i = count; i < AEO_FRAME_VALUES_MAX; i++) {
            TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5Au, found.message.value[i]);
        }
        TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5Au, found.behind);
    }
}

/* The form of a frame belongs to its kind: the same bytes in the other form are another system's, and are not damage. */
static void the_other_form_is_somebody_elses(void)
{
    for (unsigned kind = 0; kind < AEO_KIND_LIMIT; kind++) {
        for (unsigned count = 1; count <= most_values(kind); count++) {
            const aeo_address_t *const address = count % 2u == 0u ? &extended : &standard;
            const aeo_message_t message = make_message((aeo_kind_t)kind, count);
            aeo_message_t back = message;
            aeo_can_frame_t frame;
            uint8_t node = 77;
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(address, &message, &frame));
            for (unsigned rate = 0; rate <= AEO_CAN_BRS; rate += AEO_CAN_BRS) { /* either speed of the data phase */
                aeo_can_frame_t other = frame;
                other.flags = (uint8_t)((frame.flags & AEO_CAN_EXTENDED) |
                                        ((frame.flags & AEO_CAN_FD) != 0u ? 0u : AEO_CAN_FD | rate));
                TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(address, &other, &back, &node));
            }
            TEST_ASSERT_EQUAL_UINT8(77, node);
            assert_same(&message, &back);
        }
    }
}

/* A node beyond the last one is nobody's, though its frame is sound: nodes end at 3, 15 and 253. */
static void nodes_end_where_the_layout_says(void)
{
    static const aeo_address_t last[] = {{0x40, 3, 0}, {0x500, 15, 0}, {AEO_FRAME_BASE_EXTENDED, 253, 1}};
    for (unsigned i = 0; i < 3u; i++) {
        const aeo_message_t message = {AEO_KIND_HEALTH, 1, 2, 1, {3}};
        aeo_address_t address = last[i];
        aeo_can_frame_t frame;
        aeo_message_t found;
        uint8_t node = 0;
        address.extended |= AEO_ADDRESS_FORCED; /* the base may be another's by the standards */
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&address, &message, &frame));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_unpack(&address, &frame, &found, &node));
        TEST_ASSERT_EQUAL_UINT8(last[i].node, node);
        if (i == 2u) {  /* in the others the next node is the next kind's first */
            frame.id++; /* the check leaves the node out */
            TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&address, &frame, &found, &node));
            frame.id++;
            TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH, aeo_frame_unpack(&address, &frame, &found, &node));
        }
        address.node++;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &message, &frame));
    }
}

static void bad_arguments(void)
{
    const aeo_message_t good = make_message(AEO_KIND_END, 1);
    aeo_message_t message = good;
    aeo_address_t address = extended;
    aeo_can_frame_t frame;
    uint8_t node;
    unsigned count, kind;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(NULL, &good, &frame));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&extended, NULL, &frame));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&extended, &good, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_unpack(NULL, &frame, &message, &node));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_unpack(&extended, NULL, &message, &node));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_unpack(&extended, &frame, NULL, &node));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_unpack(&extended, &frame, &message, NULL));
    address.node = 254;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    address = extended;
    address.base |= 0x1000u;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_unpack(&address, &frame, &message, &node));
    address.base = UINT32_C(1) << 29;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    address = standard;
    address.node = 4;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    address = wide;
    address.node = 16;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    address = wide; /* CANopen's SDO requests, without being told that there are none */
    address.extended = 0;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    address = extended; /* a group that J1939 assigns */
    address.base = UINT32_C(0x18FEE000);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    address.extended |= AEO_ADDRESS_FORCED;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_pack(&address, &good, &frame));
    address.extended = 4;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_frame_pack(&address, &good, &frame));
    for (kind = 0; kind < 20u; kind++) {
        for (count = 0; count < 256u; count++) {
            const int exists = count >= 1u && count <= most_values(kind);
            message = make_message(AEO_KIND_END, 1);
            message.kind = (aeo_kind_t)kind;
            message.count = (uint8_t)count;
            TEST_ASSERT_EQUAL_INT(exists ? AEO_OK : AEO_E_ARG, aeo_frame_pack(&extended, &message, &frame));
        }
    }
}

/* Random bytes under an identifier of ours pass only by the one chance in 256 that the check leaves. */
static void random_bytes_rarely_pass(void)
{
    aeo_can_frame_t frame;
    aeo_message_t message;
    uint8_t node;
    unsigned i, j, passed = 0;
    for (i = 0; i < 100000u; i++) {
        memset(&frame, 0, sizeof frame);
        frame.id = AEO_FRAME_BASE_EXTENDED + draw_word() % (256u * (AEO_KIND_SEAL + 1u));
        frame.length = 8;
        frame.flags = AEO_CAN_EXTENDED;
        for (j = 0; j < 8u; j++) {
            frame.data[j] = (uint8_t)(draw_word() & 0xFFu);
        }
        passed += aeo_frame_unpack(&extended, &frame, &message, &node) == AEO_OK;
    }
    TEST_ASSERT_UINT32_WITHIN(100, 100000u * 254u / 256u / 256u, passed); /* 5 standard deviations */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(golden_frames);
    RUN_TEST(crc32_is_ieee);
    RUN_TEST(round_trips);
    RUN_TEST(three_wrong_bits_are_seen);
    RUN_TEST(wrong_bits_of_can_fd_are_seen);
    RUN_TEST(foreign_frames_are_left_alone);
    RUN_TEST(unpacking_writes_no_further_value);
    RUN_TEST(the_other_form_is_somebody_elses);
    RUN_TEST(nodes_end_where_the_layout_says);
    RUN_TEST(bad_arguments);
    RUN_TEST(random_bytes_rarely_pass);
    return UNITY_END();
}
