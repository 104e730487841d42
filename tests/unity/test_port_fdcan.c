/* The FDCAN port on a model of the registers that keeps the rules of the reference manual. */
#include "fdcan_model.h"
#include "fdcan_port.h"
#include "unity.h"

#include <aeolid/status.h>
#include <string.h>

static aeo_fdcan_t can;
static aeo_port_t port;
static aeo_fdcan_config_t config;
static int h7;

/* 80 MHz: 500 kbit/s of 160 quanta, 2 Mbit/s of 40. */
static void start(uint8_t fd)
{
    config.registers = h7 ? AEO_FDCAN_H7_REGISTERS(2) : AEO_FDCAN_G4_REGISTERS(2);
    config.memory = h7 ? AEO_FDCAN_H7_MEMORY(2) : AEO_FDCAN_G4_MEMORY(2);
    config.family = (uint8_t)(h7 ? AEO_FDCAN_H7 : AEO_FDCAN_G4);
    config.fd = fd;
    fdcan_model_start(h7, config.registers, config.memory);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_find_timing(&config.nominal, 80000000, 500000, 875, 0));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_find_timing(&config.data, 80000000, 2000000, 800, 1));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_init(&can, &config, &port));
    fdcan_model_idle(1);
}

void setUp(void)
{
    memset(&config, 0, sizeof config);
    memset(&can, 0xA5, sizeof can);
    config.recover = 1;
}

void tearDown(void)
{
    if (fdcan_model_broken() != NULL) {
        TEST_FAIL_MESSAGE(fdcan_model_broken());
    }
    TEST_ASSERT_FALSE(fdcan_model_is_masked());
}

static void in_both(void (*test)(void))
{
    for (h7 = 0; h7 < 2; h7++) {
        setUp();
        test();
        tearDown();
    }
}

static aeo_can_frame_t make(uint32_t id, uint8_t flags, uint8_t length)
{
    aeo_can_frame_t frame;
    memset(&frame, 0, sizeof frame);
    frame.id = id;
    frame.flags = flags;
    frame.length = length;
    for (unsigned i = 0; i < length && i < sizeof frame.data; i++) {
        frame.data[i] = (uint8_t)(id + 37u * i + 1u);
    }
    return frame;
}

static void expect(const aeo_can_frame_t *frame, const aeo_can_frame_t *got)
{
    TEST_ASSERT_EQUAL_HEX32(frame->id, got->id);
    TEST_ASSERT_EQUAL_HEX8(frame->flags, got->flags);
    TEST_ASSERT_EQUAL_UINT8(frame->length, got->length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(frame->data, got->data, 64);
}

static void serve(void)
{
    while (fdcan_model_interrupts()) {
        aeo_fdcan_serve(&can);
    }
}

static void pass(const aeo_can_frame_t *frame)
{
    aeo_can_frame_t got;
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, frame));
    TEST_ASSERT_EQUAL_INT(1, fdcan_model_transmit(&got));
    expect(frame, &got);
    serve();
}

/* ---- set-up ------------------------------------------------------------------------------------------------------ */

static void registers_are_as_the_manual_says(void)
{
    const uint32_t offset = h7 ? 3632 : 0; /* of instance 2 in a shared memory */
    start(1);
    TEST_ASSERT_EQUAL_HEX32(19u << 25 | 0u << 16 | 138u << 8 | 19u, fdcan_model_register(0x1C));
    TEST_ASSERT_EQUAL_HEX32(1u << 23 | 0u << 16 | 30u << 8 | 7u << 4 | 7u, fdcan_model_register(0x0C));
    TEST_ASSERT_EQUAL_HEX32(32u << 8, fdcan_model_register(0x48)); /* the sample point, in periods */
    TEST_ASSERT_EQUAL_HEX32(0x300, fdcan_model_register(0x18));
    TEST_ASSERT_EQUAL_HEX32(0x2B, fdcan_model_register(0x80)); /* everything is rejected */
    TEST_ASSERT_EQUAL_HEX32(h7 ? 0xFFFFFFFF : 7, fdcan_model_register(h7 ? 0xE0 : 0xDC));
    TEST_ASSERT_EQUAL_HEX32(h7 ? 1u | 8u | 0x200u | 0x20000u | 0x2800000u : 1u | 4u | 0x80u | 0x4000u | 0xA0000u,
                            fdcan_model_register(0x54));
    if (h7) {
        TEST_ASSERT_EQUAL_HEX32(32u << 24 | (offset + 4u * 332u), fdcan_model_register(0xC0));
        TEST_ASSERT_EQUAL_HEX32(16u << 16 | (offset + 4u * 44u), fdcan_model_register(0xA0));
        TEST_ASSERT_EQUAL_HEX32(offset, fdcan_model_register(0x84));
        TEST_ASSERT_EQUAL_HEX32(offset + 4u * 28u, fdcan_model_register(0x88));
        TEST_ASSERT_EQUAL_HEX32(7, fdcan_model_register(0xBC));
    }
    start(0);
    TEST_ASSERT_EQUAL_HEX32(0, fdcan_model_register(0x18));
    TEST_ASSERT_EQUAL_HEX32(0, fdcan_model_register(0x0C));
}

/* Compensation is for prescalers 1 and 2 and for offsets that the register holds. */
static void slow_data_phases_are_not_compensated(void)
{
    static const aeo_fdcan_timing_t data[3] = {{2, 32, 16, 16}, {3, 32, 16, 16}, {32, 1, 1, 1}};
    static const uint32_t offset[3] = {66u << 8, 0, 0};
    for (unsigned i = 0; i < 3; i++) {
        start(1);
        config.data = data[i];
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_init(&can, &config, &port));
        fdcan_model_idle(1);
        TEST_ASSERT_EQUAL_HEX32(offset[i], fdcan_model_register(0x48));
        TEST_ASSERT_EQUAL_HEX32((i == 0 ? 1u << 23 : 0u) | (data[i].prescaler - 1u) << 16 | (data[i].before - 1u) << 8 |
                                    (data[i].after - 1u) << 4 | (data[i].jump - 1u),
                                fdcan_model_register(0x0C));
    }
}

static void a_controller_without_a_clock_is_told(void)
{
    start(0);
    fdcan_model_start(h7, config.registers, config.memory);
    fdcan_model_freeze();
    TEST_ASSERT_EQUAL_INT(AEO_FDCAN_E_STUCK, aeo_fdcan_init(&can, &config, &port));
}

static void a_sleeping_controller_wakes(void)
{
    start(0);
    fdcan_model_start(h7, config.registers, config.memory);
    fdcan_model_sleep();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_init(&can, &config, &port));
    fdcan_model_idle(1);
    const aeo_can_frame_t frame = make(5, 0, 3);
    pass(&frame);
}

static void refuse(aeo_fdcan_config_t wrong)
{
    fdcan_model_start(h7, config.registers, config.memory);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_init(&can, &wrong, &port));
    TEST_ASSERT_EQUAL_HEX32(1, fdcan_model_register(0x18));
    TEST_ASSERT_EQUAL_HEX32(0, fdcan_model_register(0x1C));
}

static void wrong_settings_are_refused(void)
{
    static const aeo_fdcan_timing_t nominal[] = {{0, 2, 2, 1}, {513, 2, 2, 1}, {1, 1, 2, 1}, {1, 257, 2, 1},
                                                 {1, 2, 1, 1}, {1, 2, 129, 1}, {1, 2, 2, 0}, {1, 2, 2, 3}};
    static const aeo_fdcan_timing_t data[] = {{0, 2, 2, 1}, {33, 2, 2, 1}, {1, 0, 2, 1}, {1, 33, 2, 1},
                                              {1, 2, 0, 1}, {1, 2, 17, 1}, {1, 2, 2, 0}, {1, 2, 2, 3}};
    aeo_fdcan_config_t wrong;
    start(1);
    for (unsigned i = 0; i < 8; i++) {
        wrong = config;
        wrong.nominal = nominal[i];
        refuse(wrong);
        wrong = config;
        wrong.data = data[i];
        refuse(wrong);
    }
    wrong = config;
    wrong.family = 2;
    refuse(wrong);
    wrong = config;
    wrong.memory += 2;
    refuse(wrong);
    wrong = config;
    wrong.memory = 0;
    refuse(wrong);
    wrong = config;
    wrong.registers = 0;
    refuse(wrong);
    wrong = config;
    wrong.filter_count = 1;
    refuse(wrong);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_init(NULL, &config, &port));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_init(&can, NULL, &port));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_init(&can, &config, NULL));
    if (h7) {
        wrong = config;
        wrong.memory = AEO_FDCAN_H7_MEMORY(1) - 4u;
        refuse(wrong);
        wrong.memory = AEO_FDCAN_H7_MEMORY(1) + 10240u - 3632u + 4u;
        refuse(wrong);
        wrong.memory -= 4u;
        fdcan_model_start(h7, wrong.registers, wrong.memory);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_init(&can, &wrong, &port));
    }
}

static void filters_of_impossible_identifiers_or_number_are_refused(void)
{
    static aeo_fdcan_filter_t filters[38];
    aeo_fdcan_config_t wrong;
    start(0);
    wrong = config;
    wrong.filters = filters;
    memset(filters, 0, sizeof filters);
    wrong.filter_count = 29;
    refuse(wrong);
    for (unsigned i = 0; i < 9; i++) {
        filters[i].extended = 1;
    }
    refuse(wrong);
    filters[8].extended = 0;
    wrong.filter_count = 36;
    fdcan_model_start(h7, config.registers, config.memory);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_init(&can, &wrong, &port));
    wrong.filter_count = 1;
    filters[0].id = 0x20000000;
    refuse(wrong);
    filters[0].extended = 0;
    filters[0].id = 0x800;
    refuse(wrong);
    filters[0].id = 0x7FF;
    filters[0].mask = 0x800;
    refuse(wrong);
}

/* ---- bit timing -------------------------------------------------------------------------------------------------- */

static int exists(uint32_t clock, uint32_t rate, uint32_t permille, int data)
{
    const uint32_t most[2][4] = {{512, 256, 128, 2}, {32, 32, 16, 1}}, *limit = most[data];
    for (uint32_t p = 1; p <= limit[0]; p++) {
        const uint32_t quanta = clock / (p * rate);
        for (uint32_t before = limit[3]; before <= limit[1] && p * quanta * rate == clock; before++) {
            const int64_t off = (int64_t)1000 * (1 + before) - (int64_t)permille * quanta;
            const uint32_t after = quanta - 1u - before; /* wraps to more than the most */
            if (after >= limit[3] && after <= limit[2] && off <= 500 && off > -500) {
                return 1;
            }
        }
    }
    return 0;
}

static void timing_is_exact_or_there_is_none(void)
{
    static const uint32_t clocks[] = {8000000, 16000000, 24000000, 48000000, 80000000, 170000000, 120000001};
    static const uint32_t rates[] = {20000, 125000, 500000, 800000, 2000000, 5000000, 333000};
    static const uint32_t points[] = {500, 800, 875};
    for (unsigned i = 0; i < 7 * 7 * 3 * 2; i++) {
        const uint32_t clock = clocks[i % 7], rate = rates[i / 7 % 7], point = points[i / 49 % 3];
        const int data = (int)(i / 147);
        aeo_fdcan_timing_t timing = {9, 9, 9, 9};
        const int found = aeo_fdcan_find_timing(&timing, clock, rate, point, data);
        TEST_ASSERT_EQUAL_INT(exists(clock, rate, point, data) ? AEO_OK : AEO_E_ARG, found);
        if (found == AEO_OK) {
            const uint32_t quanta = 1u + timing.before + timing.after;
            TEST_ASSERT_EQUAL_UINT32(clock, timing.prescaler * quanta * rate);
            TEST_ASSERT_UINT32_WITHIN(500, point * quanta, 1000u * (1u + timing.before));
            TEST_ASSERT_TRUE(timing.before <= (data ? 32 : 256) && timing.after <= (data ? 16 : 128));
            TEST_ASSERT_EQUAL_UINT32(timing.after < timing.before ? timing.after : timing.before, timing.jump);
            for (uint32_t p = 1; p < timing.prescaler; p++) { /* as many quanta as can be */
                TEST_ASSERT_TRUE(clock / rate % p != 0 || clock / rate / p > (data ? 49u : 385u) ||
                                 clock / rate / p * (1000u - point) > (data ? 16500u : 128500u) ||
                                 clock / rate / p * point > (data ? 33500u : 257500u));
            }
        } else {
            TEST_ASSERT_EQUAL_UINT32(9, timing.prescaler);
        }
    }
}

static void impossible_rates_are_refused(void)
{
    aeo_fdcan_timing_t timing;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_find_timing(NULL, 80000000, 500000, 800, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_find_timing(&timing, 80000000, 0, 800, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_find_timing(&timing, 80000000, 500000, 499, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fdcan_find_timing(&timing, 80000000, 500000, 951, 0));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_find_timing(&timing, 80000000, 500000, 500, 0));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_find_timing(&timing, 80000000, 500000, 950, 0));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fdcan_find_timing(&timing, 77000000, 200000, 668, 0)); /* 385: the longest bit */
    TEST_ASSERT_EQUAL_UINT16(256, timing.before);
    TEST_ASSERT_EQUAL_UINT16(128, timing.after);
}

/* ---- transmission ------------------------------------------------------------------------------------------------ */

static void classic_frames_of_every_length_leave_as_they_are(void)
{
    start(0);
    for (uint8_t length = 0; length <= 8; length++) {
        const aeo_can_frame_t short_id = make(0x7FFu - length, 0, length);
        const aeo_can_frame_t long_id = make(0x1FFFFFFFu - length, AEO_CAN_EXTENDED, length);
        pass(&short_id);
        pass(&long_id);
    }
}

static void fd_frames_of_every_length_leave_as_they_are(void)
{
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    start(1);
    for (unsigned i = 0; i < 16; i++) {
        const aeo_can_frame_t fast = make(0x1CFF4001u + i, AEO_CAN_EXTENDED | AEO_CAN_FD | AEO_CAN_BRS, lengths[i]);
        const aeo_can_frame_t slow = make(0x100u + i, AEO_CAN_FD, lengths[i]);
        pass(&fast);
        pass(&slow);
    }
    const aeo_can_frame_t classic = make(0x100u, 0, 8);
    pass(&classic);
}

static void what_no_frame_can_be_is_refused(void)
{
    start(0);
    aeo_can_frame_t frame = make(1, 0, 9);
    TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
    frame.length = 12;
    TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
    frame.length = 8;
    frame.flags = AEO_CAN_FD;
    TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
    start(1);
    frame.length = 13;
    TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
    TEST_ASSERT_EQUAL_INT(0, fdcan_model_transmit(&frame));
}

/* Ring and FIFO together hold so many, and nothing is lost or changes places whatever the interrupt does. */
static void frames_leave_in_order_whenever_the_interrupt_comes(void)
{
    uint32_t given = 0, taken = 0, state = 1;
    start(1);
    const uint32_t room = AEO_FDCAN_RING + (h7 ? 32u : 3u);
    for (unsigned step = 0; step < 4000; step++) {
        aeo_can_frame_t frame, got;
        state = state * 1664525u + 1013904223u;
        const unsigned act = state >> 30, lean = step / 500 % 2;
        if (act <= lean + 1u) {
            const uint8_t flags = given % 3u == 0u ? AEO_CAN_FD | AEO_CAN_BRS : 0u;
            frame = make(given & 0x7FFu, flags, given % 3u == 0u ? 64 : (uint8_t)(given % 9u));
            const int full = given - taken >= AEO_FDCAN_RING && aeo_fdcan_waiting(&can) == AEO_FDCAN_RING;
            TEST_ASSERT_EQUAL_INT(!full, port.send(port.context, &frame));
            given += full ? 0u : 1u;
        } else if (fdcan_model_transmit(&got)) {
            const uint8_t flags = taken % 3u == 0u ? AEO_CAN_FD | AEO_CAN_BRS : 0u;
            frame = make(taken & 0x7FFu, flags, taken % 3u == 0u ? 64 : (uint8_t)(taken % 9u));
            expect(&frame, &got);
            taken++;
        }
        TEST_ASSERT_TRUE(given - taken <= room);
        if ((state >> 20 & 3u) == 0u) {
            serve();
        }
    }
    TEST_ASSERT_TRUE(taken > 500);
}

static void a_full_port_holds_ring_and_fifo(void)
{
    aeo_can_frame_t frame = make(1, 0, 8);
    uint32_t held = 0;
    start(0);
    while (port.send(port.context, &frame)) {
        held++;
    }
    TEST_ASSERT_EQUAL_UINT32(AEO_FDCAN_RING + (h7 ? 32u : 3u), held);
    TEST_ASSERT_EQUAL_UINT32(AEO_FDCAN_RING, aeo_fdcan_waiting(&can));
    while (fdcan_model_transmit(&frame)) {
        held--;
        serve();
    }
    TEST_ASSERT_EQUAL_UINT32(0, held);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_fdcan_waiting(&can));
}

static void send_another(void)
{
    const aeo_can_frame_t frame = make(900, 0, 8);
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
}

/* The control task may be more urgent than the interrupt of the controller. */
static void a_more_urgent_context_may_send_within_the_interrupt(void)
{
    aeo_can_frame_t got;
    start(0);
    for (uint32_t i = 0; i < 40; i++) {
        const aeo_can_frame_t frame = make(i, 0, 4);
        (void)port.send(port.context, &frame);
    }
    uint32_t next = 0, others = 0;
    while (fdcan_model_transmit(&got)) {
        if (next == 10) {
            fdcan_model_interrupt_next(send_another);
        }
        if (got.id == 900) {
            others++;
        } else {
            TEST_ASSERT_EQUAL_UINT32(next++, got.id);
        }
        serve();
    }
    TEST_ASSERT_EQUAL_UINT32(1, others);
}

static uint32_t clock_us(void)
{
    return 77;
}

static void lock_masks_and_the_clock_is_the_programs(void)
{
    start(0);
    TEST_ASSERT_NULL(port.time_us);
    port.lock(port.context);
    TEST_ASSERT_TRUE(fdcan_model_is_masked());
    aeo_can_frame_t frame = make(3, 0, 1);
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    TEST_ASSERT_TRUE(fdcan_model_is_masked()); /* send puts back what was */
    port.unlock(port.context);
    TEST_ASSERT_FALSE(fdcan_model_is_masked());
    config.time_us = clock_us;
    start(0);
    TEST_ASSERT_EQUAL_UINT32(77, port.time_us(port.context));
}

/* ---- reception --------------------------------------------------------------------------------------------------- */

static const aeo_fdcan_filter_t wanted[] = {
    {0x123, 0x7FF, 0}, {0x18EEFF00, 0x03FFFF00, 1}, {0x700, 0x7F0, 0}, {0x18EA0000, 0x03FF0000, 1}};

static void start_receiving(uint8_t fd)
{
    config.filters = wanted;
    config.filter_count = 4;
    start(fd);
}

static void arrive(uint32_t id, uint8_t flags, uint8_t length, int let_in)
{
    static const uint8_t codes[65] = {[12] = 9, [16] = 10, [20] = 11, [24] = 12, [32] = 13, [48] = 14, [64] = 15};
    const aeo_can_frame_t frame = make(id, flags, length);
    aeo_can_frame_t got;
    memset(&got, 0, sizeof got);
    TEST_ASSERT_EQUAL_INT(let_in, fdcan_model_arrive(&frame, length > 8 ? codes[length] : length, 0));
    serve();
    TEST_ASSERT_EQUAL_INT(let_in, aeo_fdcan_receive(&can, &got));
    if (let_in) {
        expect(&frame, &got);
    }
}

static void what_a_filter_lets_in_is_received(void)
{
    start_receiving(1);
    arrive(0x123, 0, 0, 1);
    arrive(0x123, 0, 8, 1);
    arrive(0x124, 0, 8, 0);
    arrive(0x70F, AEO_CAN_FD | AEO_CAN_BRS, 64, 1);
    arrive(0x700, AEO_CAN_FD, 12, 1);
    arrive(0x6FF, 0, 5, 0);
    arrive(0x18EEFF7B, AEO_CAN_EXTENDED, 8, 1);
    arrive(0x14EEFF7B, AEO_CAN_EXTENDED, 7, 1); /* the priority does not count */
    arrive(0x18EEFE7B, AEO_CAN_EXTENDED, 8, 0);
    arrive(0x18EA7B01, AEO_CAN_EXTENDED, 3, 1);
    arrive(0x123, AEO_CAN_EXTENDED, 3, 0);
    const aeo_can_frame_t remote = make(0x123, 0, 0);
    TEST_ASSERT_EQUAL_INT(0, fdcan_model_arrive(&remote, 0, 1));
    config.filter_count = 0;
    start(0);
    arrive(0x123, 0, 0, 0);
}

static void a_classic_frame_has_eight_bytes_at_most(void)
{
    aeo_can_frame_t frame = make(0x123, 0, 8), got = make(0, 0, 0);
    start_receiving(0);
    TEST_ASSERT_EQUAL_INT(1, fdcan_model_arrive(&frame, 15, 0));
    TEST_ASSERT_EQUAL_INT(1, aeo_fdcan_receive(&can, &got));
    expect(&frame, &got);
}

static void a_full_reception_loses_the_newest_and_is_counted(void)
{
    const uint32_t room = h7 ? 16 : 3;
    aeo_can_frame_t got;
    start_receiving(0);
    for (uint32_t round = 0; round < 5; round++) {
        for (uint32_t i = 0; i <= room; i++) {
            const aeo_can_frame_t frame = make(0x700 + i % 16, 0, (uint8_t)(i % 9));
            TEST_ASSERT_EQUAL_INT(i < room, fdcan_model_arrive(&frame, frame.length, 0));
        }
        serve();
        TEST_ASSERT_EQUAL_UINT32(round + 1, can.counters.lost);
        for (uint32_t i = 0; i < room; i++) {
            TEST_ASSERT_EQUAL_INT(1, aeo_fdcan_receive(&can, &got));
            TEST_ASSERT_EQUAL_HEX32(0x700 + i % 16, got.id);
        }
        TEST_ASSERT_EQUAL_INT(0, aeo_fdcan_receive(&can, &got));
    }
}

/* ---- errors ------------------------------------------------------------------------------------------------------ */

static void bus_off_is_left_by_itself_and_nothing_is_lost(void)
{
    aeo_can_frame_t got;
    start(0);
    for (uint32_t i = 0; i < 10; i++) {
        const aeo_can_frame_t frame = make(i, 0, 8);
        TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    }
    fdcan_model_become_bus_off();
    TEST_ASSERT_EQUAL_INT(AEO_FDCAN_BUS_OFF, aeo_fdcan_state(&can));
    serve();
    TEST_ASSERT_EQUAL_UINT32(1, can.counters.bus_off);
    fdcan_model_idle(128);
    TEST_ASSERT_EQUAL_INT(0, aeo_fdcan_recover(&can)); /* it is on its way */
    TEST_ASSERT_EQUAL_INT(0, fdcan_model_transmit(&got));
    TEST_ASSERT_EQUAL_INT(AEO_FDCAN_BUS_OFF, aeo_fdcan_state(&can));
    fdcan_model_idle(1);
    serve();
    TEST_ASSERT_EQUAL_INT(AEO_FDCAN_ACTIVE, aeo_fdcan_state(&can));
    for (uint32_t i = 0; i < 10; i++) {
        TEST_ASSERT_EQUAL_INT(1, fdcan_model_transmit(&got));
        TEST_ASSERT_EQUAL_UINT32(i, got.id);
        serve();
    }
    TEST_ASSERT_EQUAL_UINT32(1, can.counters.bus_off);
}

static void bus_off_lasts_until_the_program_says_so(void)
{
    aeo_can_frame_t got;
    config.recover = 0;
    start(0);
    TEST_ASSERT_EQUAL_INT(0, aeo_fdcan_recover(&can));
    fdcan_model_start(h7, config.registers, config.memory); /* stopped, but not by errors: not recover's to start */
    TEST_ASSERT_EQUAL_INT(0, aeo_fdcan_recover(&can));
    start(0);
    fdcan_model_become_bus_off();
    serve();
    fdcan_model_idle(1000);
    TEST_ASSERT_EQUAL_INT(AEO_FDCAN_BUS_OFF, aeo_fdcan_state(&can));
    for (uint32_t i = 0; i < 100; i++) { /* a ring that fills up refuses */
        const aeo_can_frame_t frame = make(i, 0, 8);
        (void)port.send(port.context, &frame);
    }
    TEST_ASSERT_EQUAL_UINT32(AEO_FDCAN_RING, aeo_fdcan_waiting(&can));
    TEST_ASSERT_EQUAL_INT(1, aeo_fdcan_recover(&can));
    fdcan_model_idle(129);
    serve();
    TEST_ASSERT_EQUAL_INT(1, fdcan_model_transmit(&got));
    TEST_ASSERT_EQUAL_UINT32(0, got.id);
}

static void other_errors_are_counted_and_made_good(void)
{
    const aeo_can_frame_t frame = make(1, 0, 8);
    aeo_can_frame_t got;
    start(0);
    TEST_ASSERT_EQUAL_INT(AEO_FDCAN_ACTIVE, aeo_fdcan_state(&can));
    fdcan_model_become_passive();
    serve();
    TEST_ASSERT_EQUAL_INT(AEO_FDCAN_PASSIVE, aeo_fdcan_state(&can));
    TEST_ASSERT_EQUAL_UINT32(1, can.counters.passive);
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    fdcan_model_fail_memory();
    TEST_ASSERT_EQUAL_INT(0, fdcan_model_transmit(&got));
    serve();
    TEST_ASSERT_EQUAL_INT(1, fdcan_model_transmit(&got));
    TEST_ASSERT_EQUAL_UINT32(1, can.counters.memory);
    fdcan_model_become_bus_off();
    fdcan_model_fail_memory(); /* both at once: the way back is not undone */
    serve();
    fdcan_model_idle(129);
    serve();
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    TEST_ASSERT_EQUAL_INT(1, fdcan_model_transmit(&got));
    TEST_ASSERT_EQUAL_UINT32(1, can.counters.bus_off);
    TEST_ASSERT_EQUAL_UINT32(1, can.counters.passive);
    TEST_ASSERT_EQUAL_UINT32(0, can.counters.lost);
}

static void counters_stay_at_the_top(void)
{
    start_receiving(0);
    memset(&can.counters, 0xFF, sizeof can.counters);
    fdcan_model_become_passive();
    serve();
    fdcan_model_fail_memory();
    serve();
    fdcan_model_become_bus_off();
    serve();
    TEST_ASSERT_EACH_EQUAL_HEX32(UINT32_MAX, &can.counters, sizeof can.counters / 4);
}

#define IN_BOTH(name)                                                                                                  \
    static void name##_in_both(void)                                                                                   \
    {                                                                                                                  \
        in_both(name);                                                                                                 \
    }
IN_BOTH(registers_are_as_the_manual_says)
IN_BOTH(slow_data_phases_are_not_compensated)
IN_BOTH(a_controller_without_a_clock_is_told)
IN_BOTH(a_sleeping_controller_wakes)
IN_BOTH(wrong_settings_are_refused)
IN_BOTH(filters_of_impossible_identifiers_or_number_are_refused)
IN_BOTH(classic_frames_of_every_length_leave_as_they_are)
IN_BOTH(fd_frames_of_every_length_leave_as_they_are)
IN_BOTH(what_no_frame_can_be_is_refused)
IN_BOTH(frames_leave_in_order_whenever_the_interrupt_comes)
IN_BOTH(a_full_port_holds_ring_and_fifo)
IN_BOTH(a_more_urgent_context_may_send_within_the_interrupt)
IN_BOTH(lock_masks_and_the_clock_is_the_programs)
IN_BOTH(what_a_filter_lets_in_is_received)
IN_BOTH(a_classic_frame_has_eight_bytes_at_most)
IN_BOTH(a_full_reception_loses_the_newest_and_is_counted)
IN_BOTH(bus_off_is_left_by_itself_and_nothing_is_lost)
IN_BOTH(bus_off_lasts_until_the_program_says_so)
IN_BOTH(other_errors_are_counted_and_made_good)
IN_BOTH(counters_stay_at_the_top)

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(registers_are_as_the_manual_says_in_both);
    RUN_TEST(slow_data_phases_are_not_compensated_in_both);
    RUN_TEST(a_controller_without_a_clock_is_told_in_both);
    RUN_TEST(a_sleeping_controller_wakes_in_both);
    RUN_TEST(wrong_settings_are_refused_in_both);
    RUN_TEST(filters_of_impossible_identifiers_or_number_are_refused_in_both);
    RUN_TEST(timing_is_exact_or_there_is_none);
    RUN_TEST(impossible_rates_are_refused);
    RUN_TEST(classic_frames_of_every_length_leave_as_they_are_in_both);
    RUN_TEST(fd_frames_of_every_length_leave_as_they_are_in_both);
    RUN_TEST(what_no_frame_can_be_is_refused_in_both);
    RUN_TEST(frames_leave_in_order_whenever_the_interrupt_comes_in_both);
    RUN_TEST(a_full_port_holds_ring_and_fifo_in_both);
    RUN_TEST(a_more_urgent_context_may_send_within_the_interrupt_in_both);
    RUN_TEST(lock_masks_and_the_clock_is_the_programs_in_both);
    RUN_TEST(what_a_filter_lets_in_is_received_in_both);
    RUN_TEST(a_classic_frame_has_eight_bytes_at_most_in_both);
    RUN_TEST(a_full_reception_loses_the_newest_and_is_counted_in_both);
    RUN_TEST(bus_off_is_left_by_itself_and_nothing_is_lost_in_both);
    RUN_TEST(bus_off_lasts_until_the_program_says_so_in_both);
    RUN_TEST(other_errors_are_counted_and_made_good_in_both);
    RUN_TEST(counters_stay_at_the_top_in_both);
    return UNITY_END();
}
