/* turbine_node.c: a node on an MPS2 board: its control task filters a recording of the built-in turbine and streams it.
 *
 * Argument (semihosting): the period of SysTick in microseconds. With the recording's sample time the node runs as in a
 * turbine. With another one time counts samples, as if they had come when they should: shorter makes haste, 0 takes the
 * next sample as soon as the UART's ring has room for all that one sample can send, so that none is lost.
 * It begins when a host opens the channel, and ends with a last snapshot and the closing frames. Half-way it writes a
 * line `half`, in the end one `node {json}` and exits with 0; with 2 for a wrong argument, with 1 when a setting is
 * refused. In an emulator, with a listener at slcan:socket://127.0.0.1:29536:
 *
 *     qemu-system-arm -M mps2-an386 -display none -serial tcp:127.0.0.1:29536,server=on,wait=on \
 *         -semihosting-config enable=on,target=native,arg=turbine_node,arg=100000 -kernel build/mps2/turbine_node
 */
#include <aeolid/estimator.h>

#include "mps2_board.h"
#include "mps2_port.h"
/* cppcheck-suppress missingInclude; the build makes it */
#include "turbine_recording.h"

enum {
    CHANNELS = TURBINE_INPUTS + TURBINE_OUTPUTS,
    N = AEO_REGRESSOR_LENGTH(TURBINE_INPUTS, TURBINE_OUTPUTS, TURBINE_PAST, 0, 0),
    PARAMETERS = N * TURBINE_OUTPUTS,
    SNAPSHOT_EVERY = 100, /* samples */
    BURST = 16,           /* frames a step */
    LINE = 27,            /* characters of a classic frame */
    ROOM = LINE * (BURST + 2 * CHANNELS)
};

static aeo_real_t words[AEO_ESTIMATOR_RLS_WORDS(TURBINE_INPUTS, TURBINE_OUTPUTS, TURBINE_PAST, 0, 0)];
static uint32_t snapshot[AEO_STREAM_WORDS(PARAMETERS)];
static aeo_estimator_t estimator;
static aeo_stream_t stream;
static aeo_port_t port;
static mps2_port_t uart;

static volatile uint32_t ticks; /* of the control task */
static uint32_t taken;          /* samples */
static uint32_t latest;         /* ticks of 40 ns from when the control task was due until it ran, at most */
static uint32_t (*read_clock)(void *context);
static uint32_t first_us, last_us; /* when the first and the last sample were taken, by the port's clock */
static volatile uint32_t closed;   /* 1: the last snapshot is on its way and the end announced */

/* ---- the control task -------------------------------------------------------------------------------------------- */

static void take_sample(uint32_t index)
{
    const aeo_real_t *u = turbine_values[index], *y = u + TURBINE_INPUTS;
    (void)aeo_estimator_send(&estimator, &stream, index, u, y, NULL, (uint64_t)index * TURBINE_PERIOD_US);
    if (index % SNAPSHOT_EVERY == SNAPSHOT_EVERY - 1u) {
        (void)aeo_estimator_snapshot(&estimator, &stream, index);
    }
}

void mps2_systick(void)
{
    const uint32_t late = mps2_systick_age();
    latest = late > latest ? late : latest;
    ticks++;
    if (taken < TURBINE_SAMPLES) {
        last_us = read_clock(&uart);
        first_us = taken == 0u ? last_us : first_us;
        take_sample(taken);
        taken++;
    } else if (closed == 0u && !aeo_stream_pending(&stream)) { /* the snapshot before has left: one of the last theta */
        (void)aeo_estimator_snapshot(&estimator, &stream, TURBINE_SAMPLES - 1u);
        aeo_stream_finish(&stream);
        closed = 1;
    }
}

void mps2_uart0(void)
{
    mps2_port_serve(&uart);
}

/* ---- the main loop ----------------------------------------------------------------------------------------------- */

static uint32_t count_time(void *context)
{
    (void)context;
    return ticks * TURBINE_PERIOD_US;
}

static int start(uint32_t period_us)
{
    const aeo_estimator_config_t settings = {.inputs = TURBINE_INPUTS,
                                             .outputs = TURBINE_OUTPUTS,
                                             .past = TURBINE_PAST,
                                             .period_us = TURBINE_PERIOD_US,
                                             .channels = turbine_channels,
                                             .forgetting = 1.0f,
                                             .regularisation = 0.1f,
                                             .excitation_min = 0.05f,
                                             .growth_max = 10.0f};
    const aeo_stream_config_t bus = {.address = {AEO_FRAME_BASE_EXTENDED, 1, 1},
                                     .seal = 1,
                                     .sample_every = 1,
                                     .health_every = 10,
                                     .describe_every = 100,
                                     .repair_percent = 25,
                                     .burst = BURST,
                                     .bits_per_s = AEO_STREAM_SHARE(500000, 50)};
    mps2_port_init(&uart, &port, 921600);
    read_clock = port.time_us;
    if (period_us != TURBINE_PERIOD_US) {
        port.time_us = count_time;
    }
    return aeo_estimator_init(&estimator, aeo_estimator_rls, &settings, words, sizeof words / sizeof *words) ==
               AEO_OK &&
           aeo_estimator_announce(&estimator, &stream, &bus, &port, snapshot, PARAMETERS) == AEO_OK;
}

/* Sleep until the ring has room for all that one sample can send. */
static void wait_for_room(void)
{
    uint32_t tail = uart.tail;
    while (MPS2_RING - mps2_port_waiting(&uart) < ROOM) {
        mps2_wait(&uart.tail, tail);
        tail = uart.tail;
    }
}

static void run(uint32_t period_us)
{
    uint32_t stepped = 0;
    mps2_wait(&uart.open, 0);
    mps2_start_systick(period_us);
    while (closed == 0u || aeo_stream_pending(&stream)) {
        if (period_us == 0u) {
            wait_for_room();
            mps2_raise_systick();
        }
        mps2_wait(&ticks, stepped);
        stepped++;
        (void)aeo_stream_step(&stream);
        if (stepped == TURBINE_SAMPLES / 2u) {
            mps2_write("half\n");
        }
    }
    mps2_start_systick(0);
    while (mps2_port_waiting(&uart) > 0u && uart.open != 0u) {
        mps2_wait(&uart.tail, uart.tail);
    }
}

static void write_fact(const char *name, uint32_t value)
{
    mps2_write(name);
    mps2_write_decimal(value);
}

static void write_facts(void)
{
    const aeo_stream_counters_t *c = &stream.counters;
    write_fact("node {\"samples\": ", taken);
    write_fact(", \"accepted\": ", aeo_estimator_count(&estimator, AEO_COUNT_SAMPLES));
    write_fact(", \"updates\": ", aeo_estimator_count(&estimator, AEO_COUNT_UPDATES));
    write_fact(", \"ticks\": ", ticks);
    write_fact(", \"elapsed_us\": ", last_us - first_us);
    write_fact(", \"latest\": ", latest);
    write_fact(", \"sent\": ", c->sent);
    write_fact(", \"refused\": ", c->refused);
    write_fact(", \"dropped\": ", c->dropped);
    write_fact(", \"snapshots\": ", c->snapshots);
    write_fact(", \"busy\": ", c->busy);
    write_fact(", \"stack_used\": ", mps2_stack_used());
    write_fact(", \"stack\": ", mps2_stack_size());
    mps2_write("}\n");
}

/* Read the number that ends the command line; UINT32_MAX when there is none that SysTick can do. */
static uint32_t read_period(void)
{
    char line[64];
    uint32_t at = 0, value = 0;
    mps2_arguments(line, sizeof line);
    for (uint32_t i = 0; line[i] != '\0'; i++) {
        at = line[i] == ' ' ? i + 1u : at;
    }
    if (line[at] == '\0') {
        return UINT32_MAX;
    }
    for (; line[at] >= '0' && line[at] <= '9' && value <= MPS2_SYSTICK_MAX_US; at++) {
        value = 10u * value + (uint32_t)(line[at] - '0');
    }
    return line[at] == '\0' && value <= MPS2_SYSTICK_MAX_US ? value : UINT32_MAX;
}

int main(void)
{
    const uint32_t period_us = read_period();
    if (period_us == UINT32_MAX) {
        mps2_write("turbine_node: a period of 0 to 671000 microseconds is needed as its argument\n");
        return 2;
    }
    if (!start(period_us)) {
        mps2_write("turbine_node: a setting is out of range (regressor.h, rls.h, stream.h)\n");
        return 1;
    }
    run(period_us);
    write_facts();
    return 0;
}
/* SPDX-License-Identifier: MIT */
