/* The J1939 address claim: who keeps an address, who yields, what each says, and that a stream sends with none but its
 * own. */
#include "aeolid/status.h"
#include "aeolid/stream.h"
#include "claim.h"
#include "unity.h"

#include <string.h>

#define CLAIM_ID   UINT32_C(0x18EEFF00)
#define REQUEST_ID UINT32_C(0x18EA0000)

static const aeo_claim_config_t usual = {AEO_CLAIM_NAME(77, 0, 255, 127, 5, 1), 200, 128, 247};
static aeo_claim_t claim;
static aeo_can_frame_t frame;

void setUp(void)
{
    memset(&claim, 0x5A, sizeof claim);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_claim_start(&claim, &usual, 0));
}

void tearDown(void)
{
}

/* What another device would claim the address with. */
static aeo_can_frame_t claim_of(uint64_t name, unsigned address)
{
    aeo_can_frame_t made;
    unsigned i;
    memset(&made, 0, sizeof made);
    made.id = CLAIM_ID | address;
    made.length = 8;
    made.flags = AEO_CAN_EXTENDED;
    for (i = 0; i < 8u; i++) {
        made.data[i] = (uint8_t)(name >> (8u * i) & 0xFFu);
    }
    return made;
}

static aeo_can_frame_t request_to(unsigned destination)
{
    static const uint8_t group[3] = {0x00, 0xEE, 0x00};
    aeo_can_frame_t made;
    memset(&made, 0, sizeof made);
    made.id = REQUEST_ID | (uint32_t)destination << 8 | 0x21u;
    made.length = 3;
    made.flags = AEO_CAN_EXTENDED;
    memcpy(made.data, group, sizeof group);
    return made;
}

static void hear(const aeo_can_frame_t *from, uint32_t now_us)
{
    aeo_claim_receive(&claim, from, now_us);
}

/* Check that one claim for this address leaves now, with the NAME. */
static void expect_claim(unsigned address, uint32_t now_us)
{
    const aeo_can_frame_t meant = claim_of(usual.name, address);
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, now_us, &frame));
    TEST_ASSERT_EQUAL_HEX32(meant.id, frame.id);
    TEST_ASSERT_EQUAL_MEMORY(&meant, &frame, sizeof frame);
    TEST_ASSERT_EQUAL_INT(0, aeo_claim_step(&claim, now_us, &frame));
}

static void hold(unsigned address, uint32_t now_us)
{
    expect_claim(address, now_us);
    TEST_ASSERT_EQUAL_INT(0, aeo_claim_step(&claim, now_us + AEO_CLAIM_WAIT_US - 1u, &frame));
    TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(&claim));
    TEST_ASSERT_EQUAL_INT(0, aeo_claim_step(&claim, now_us + AEO_CLAIM_WAIT_US, &frame));
    TEST_ASSERT_EQUAL_INT((int)address, aeo_claim_address(&claim));
}

static void an_undisputed_address_is_held_after_250_ms(void)
{
    TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(&claim));
    hold(200, UINT32_MAX - 1000u); /* the clock wraps meanwhile */
}

static void the_name_is_laid_out_as_j1939_has_it(void)
{
    const uint64_t name = AEO_CLAIM_NAME(0x1FFFFF, 0, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x00000000001FFFFF), name);
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x00000000FFE00000), AEO_CLAIM_NAME(0, 0x7FF, 0, 0, 0, 0));
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x0000FF0000000000), AEO_CLAIM_NAME(0, 0, 0xFF, 0, 0, 0));
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x00FE000000000000), AEO_CLAIM_NAME(0, 0, 0, 0x7F, 0, 0));
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x7000000000000000), AEO_CLAIM_NAME(0, 0, 0, 0, 7, 0));
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x8000000000000000), AEO_CLAIM_NAME(0, 0, 0, 0, 0, 1));
}

static void a_higher_name_is_told_and_a_lower_one_makes_room(void)
{
    aeo_can_frame_t other = claim_of(usual.name + 1u, 200);
    hold(200, 0);
    hear(&other, 300000);
    expect_claim(200, 300000); /* defended; held all the while */
    TEST_ASSERT_EQUAL_INT(200, aeo_claim_address(&claim));
    other = claim_of(usual.name - 1u, 200);
    hear(&other, 400000);
    TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(&claim)); /* at once */
    hold(201, 400000);
    TEST_ASSERT_EQUAL_UINT32(1, claim.lost);
}

static void contention_while_waiting_does_not_hold_it_up(void)
{
    const aeo_can_frame_t other = claim_of(usual.name + 1u, 200);
    uint32_t now;
    expect_claim(200, 0);
    for (now = 50000; now < AEO_CLAIM_WAIT_US; now += 50000u) {
        hear(&other, now);
        expect_claim(200, now);
    }
    TEST_ASSERT_EQUAL_INT(0, aeo_claim_step(&claim, AEO_CLAIM_WAIT_US, &frame));
    TEST_ASSERT_EQUAL_INT(200, aeo_claim_address(&claim));
}

static void addresses_of_others_are_passed_over_and_none_left_is_said(void)
{
    unsigned address;
    aeo_can_frame_t other;
    for (address = 128; address <= 247u; address++) {
        other = claim_of(address, address); /* lower than ours */
        if (address != 200u && address != 130u) {
            hear(&other, 0);
        }
    }
    hold(200, 0);
    other = claim_of(1, 200);
    hear(&other, 500000);
    hold(130, 500000); /* the only one left */
    other = claim_of(2, 130);
    hear(&other, 900000);
    TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(&claim));
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, 900000u + 153000u, &frame));
    TEST_ASSERT_EQUAL_HEX32(CLAIM_ID | 254u, frame.id);
    other = request_to(255);
    hear(&other, 2000000);
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, 2000000u + 153000u, &frame)); /* still none */
    TEST_ASSERT_EQUAL_HEX32(CLAIM_ID | 254u, frame.id);
}

static void without_the_right_to_another_address_it_falls_silent(void)
{
    aeo_claim_config_t fixed = usual;
    const aeo_can_frame_t other = claim_of(3, 200);
    const aeo_can_frame_t twin = claim_of(usual.name, 200);
    fixed.name &= ~(UINT64_C(1) << 63);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_claim_start(&claim, &fixed, 0));
    hear(&other, 0);
    TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(&claim));
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, 153000, &frame));
    TEST_ASSERT_EQUAL_HEX32(CLAIM_ID | 254u, frame.id);
    setUp(); /* and so do two devices with one NAME */
    hold(200, 0);
    hear(&twin, 300000);
    TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(&claim));
    TEST_ASSERT_EQUAL_UINT8(AEO_CLAIM_LOST, claim.state);
    TEST_ASSERT_EQUAL_HEX64(usual.name, claim.config.name);
}

static void requests_are_answered_and_the_rest_is_ignored(void)
{
    aeo_can_frame_t other = request_to(255);
    hold(200, 0);
    hear(&other, 300000);
    expect_claim(200, 300000);
    other = request_to(200);
    hear(&other, 300000);
    expect_claim(200, 300000);
    other = request_to(199); /* another's */
    hear(&other, 300000);
    TEST_ASSERT_EQUAL_INT(0, aeo_claim_step(&claim, 300000, &frame));
    other = claim_of(0, 200); /* what is none: cut, 11 bits, CAN FD, one that could not claim, another group */
    other.length = 7;
    hear(&other, 300000);
    other = claim_of(0, 200);
    other.flags = 0;
    hear(&other, 300000);
    other.flags = AEO_CAN_EXTENDED | AEO_CAN_FD;
    hear(&other, 300000);
    other = claim_of(0, 254);
    hear(&other, 300000);
    other = claim_of(0, 200);
    other.id ^= UINT32_C(0x01000000);
    hear(&other, 300000);
    TEST_ASSERT_EQUAL_INT(0, aeo_claim_step(&claim, 300000, &frame));
    TEST_ASSERT_EQUAL_INT(200, aeo_claim_address(&claim));
}

static void a_claim_that_the_driver_refused_is_offered_again(void)
{
    unsigned i;
    for (i = 0; i < 10u; i++) { /* 500 ms without room in the driver: nothing is held */
        TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, i * 50000u, &frame));
        aeo_claim_refused(&claim);
        TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(&claim));
    }
    hold(200, 500000); /* 250 ms from the one that left */
}

static void a_defence_that_the_driver_refused_is_offered_again(void)
{
    const aeo_can_frame_t weaker = claim_of(usual.name + 1u, 200);
    hold(200, 0);
    hear(&weaker, 300000);
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, 300000, &frame));
    aeo_claim_refused(&claim);
    TEST_ASSERT_EQUAL_INT(200, aeo_claim_address(&claim)); /* held: its own claim went out */
    expect_claim(200, 350000);
}

static void that_none_can_be_claimed_is_offered_again(void)
{
    const aeo_claim_config_t fixed = {AEO_CLAIM_NAME(77, 0, 255, 127, 5, 0), 200, 128, 247};
    const aeo_can_frame_t stronger = claim_of(5, 200);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_claim_start(&claim, &fixed, 0));
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, 0, &frame));
    hear(&stronger, 1000);
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, 200000, &frame));
    aeo_claim_refused(&claim);
    TEST_ASSERT_EQUAL_INT(1, aeo_claim_step(&claim, 250000, &frame));
    TEST_ASSERT_EQUAL_HEX32(CLAIM_ID | 254u, frame.id);
    TEST_ASSERT_EQUAL_INT(0, aeo_claim_step(&claim, 300000, &frame));
}

static void wrong_arguments_are_refused(void)
{
    aeo_claim_refused(NULL);
    aeo_claim_config_t wrong = usual;
    const aeo_claim_t before = claim;
    aeo_port_t port;
    memset(&port, 0, sizeof port);
    wrong.address = 254;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_claim_start(&claim, &wrong, 0));
    wrong = usual;
    wrong.lowest = 248;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_claim_start(&claim, &wrong, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_claim_start(NULL, &usual, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_claim_start(&claim, NULL, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_claim_port(&claim, &port, &port));
    TEST_ASSERT_EQUAL_MEMORY(&before, &claim, sizeof claim);
    TEST_ASSERT_EQUAL_INT(-1, aeo_claim_address(NULL));
}

/* ---- with a stream ----------------------------------------------------------------------------------------------- */

static unsigned sent_from[256];

static int note_sender(void *context, const aeo_can_frame_t *sent)
{
    (void)context;
    sent_from[sent->id & 0xFFu]++;
    return 1;
}

static uint32_t no_time(void *context)
{
    (void)context;
    return 0;
}

static void do_nothing(void *context)
{
    (void)context;
}

static void a_stream_sends_with_no_address_but_the_one_held(void)
{
    static const aeo_stream_channel_t channels[2] = {{.name = "u", .unit = "", .scale = 1},
                                                     {.name = "y", .unit = "", .scale = 1}};
    static uint32_t memory[4];
    static aeo_stream_t stream;
    const aeo_real_t u = 1, y = 2;
    const aeo_port_t bus = {NULL, note_sender, no_time, do_nothing, do_nothing};
    const aeo_can_frame_t stronger = claim_of(5, 200);
    aeo_stream_config_t wire = {.address = {AEO_FRAME_BASE_EXTENDED, 200, 1},
                                .inputs = 1,
                                .outputs = 1,
                                .past = 2,
                                .parameters = 4,
                                .sample_time_s = 1,
                                .lambda = 1,
                                .rho = 1,
                                .channels = channels,
                                .sample_every = 1,
                                .health_every = 1,
                                .describe_every = 1,
                                .burst = 16,
                                .fd_ratio = 1};
    aeo_port_t port;
    memset(sent_from, 0, sizeof sent_from);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_claim_port(&claim, &bus, &port));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &wire, &port, memory, 4));
    TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_sample(&stream, 0, &u, &y, NULL)); /* nothing is held yet */
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    hold(200, 0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, 1, &u, &y, NULL));
    TEST_ASSERT_GREATER_THAN_INT(0, aeo_stream_step(&stream));
    TEST_ASSERT_GREATER_THAN_UINT(2, sent_from[200]);
    hear(&stronger, 300000); /* taken away: silent from this frame on, and anew with the next address */
    sent_from[200] = 0;
    TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_sample(&stream, 2, &u, &y, NULL));
    hold(201, 300000);
    TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_sample(&stream, 3, &u, &y, NULL)); /* still the old address */
    wire.address.node = (uint8_t)aeo_claim_address(&claim);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &wire, &port, memory, 4));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, 4, &u, &y, NULL));
    TEST_ASSERT_EQUAL_UINT(0, sent_from[200]);
    TEST_ASSERT_GREATER_THAN_UINT(1, sent_from[201]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(an_undisputed_address_is_held_after_250_ms);
    RUN_TEST(the_name_is_laid_out_as_j1939_has_it);
    RUN_TEST(a_higher_name_is_told_and_a_lower_one_makes_room);
    RUN_TEST(contention_while_waiting_does_not_hold_it_up);
    RUN_TEST(addresses_of_others_are_passed_over_and_none_left_is_said);
    RUN_TEST(without_the_right_to_another_address_it_falls_silent);
    RUN_TEST(requests_are_answered_and_the_rest_is_ignored);
    RUN_TEST(a_claim_that_the_driver_refused_is_offered_again);
    RUN_TEST(a_defence_that_the_driver_refused_is_offered_again);
    RUN_TEST(that_none_can_be_claimed_is_offered_again);
    RUN_TEST(wrong_arguments_are_refused);
    RUN_TEST(a_stream_sends_with_no_address_but_the_one_held);
    return UNITY_END();
}
