/* fuzz_wire.c: any bytes at all as frames from a bus, and as settings of a streamer whose port refuses as it likes: no
 * frame may be read that does not say what it seems to, and no streamer break its contract.
 *
 * The first byte chooses what is fuzzed and the identifiers. Built as fuzz.c. */
#include "aeolid/status.h"
#include "aeolid/stream.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const uint8_t *data;
    size_t left;
} input_t;

typedef struct {
    input_t *input;
    aeo_address_t address;
    uint32_t now_us;
    int locked;
    unsigned calls;
} bus_t;

static void take(input_t *input, void *to, size_t bytes)
{
    const size_t given = bytes < input->left ? bytes : input->left;
    memset(to, 0, bytes);
    if (given > 0) {
        memcpy(to, input->data, given);
        input->data += given;
        input->left -= given;
    }
}

static unsigned take_byte(input_t *input)
{
    uint8_t byte;
    take(input, &byte, 1);
    return byte;
}

static void demand(int holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "%s\n", what);
        abort();
    }
}

static int same(const aeo_message_t *a, const aeo_message_t *b)
{
    return a->kind == b->kind && a->tag == b->tag && a->index == b->index && a->count == b->count &&
           memcmp(a->value, b->value, a->count * sizeof *a->value) == 0;
}

/* Put in the CRC-32 that the bytes would have as a CAN FD frame: no fuzzer guesses it. */
static void seal_frame(aeo_can_frame_t *frame)
{
    uint32_t crc = aeo_frame_crc32(UINT32_C(0xFFFFFFFF), frame->id);
    unsigned i;
    for (i = 0; i + 4u <= frame->length && i < sizeof frame->data; i += 4u) {
        const uint8_t *at = &frame->data[i];
        if (i != 4u) {
            crc = aeo_frame_crc32(crc, (uint32_t)at[0] | ((uint32_t)at[1] << 8) | ((uint32_t)at[2] << 16) |
                                           ((uint32_t)at[3] << 24));
        }
    }
    for (i = 0; i < 4u; i++) {
        frame->data[4u + i] = (uint8_t)(~crc >> (8u * i));
    }
}

/* Whatever passes is what the packer makes of it again; what is refused leaves no trace. */
static void fuzz_frame(input_t *input, const aeo_address_t *address)
{
    static const uint8_t lengths[] = {8, 12, 16, 20, 24, 32, 48, 64};
    aeo_can_frame_t frame, again;
    aeo_message_t message, untouched;
    aeo_address_t from = *address;
    uint8_t node = 99;
    int status;
    take(input, &frame, sizeof frame);
    if (take_byte(input) % 4u != 0u) {
        frame.id = address->base + frame.id % (address->extended != 0u ? 0x1100u : 0x48u);
        frame.flags = (uint8_t)((address->extended != 0u ? AEO_CAN_EXTENDED : 0u) | AEO_CAN_FD);
        frame.length = take_byte(input) % 4u == 0u ? frame.length : lengths[frame.length % sizeof lengths];
        seal_frame(&frame);
    }
    memset(&message, 0x5A, sizeof message);
    untouched = message;
    status = aeo_frame_unpack(address, &frame, &message, &node);
    demand(status == AEO_OK || status == AEO_E_MISMATCH || status == AEO_E_DAMAGED, "an unknown code of unpack");
    if (status != AEO_OK) {
        demand(node == 99 && memcmp(&message, &untouched, sizeof message) == 0, "a refused frame left traces");
        return;
    }
    from.node = node;
    demand(message.count >= 1u && message.count <= AEO_FRAME_VALUES_MAX, "a count out of range");
    demand(aeo_frame_pack(&from, &message, &again) == AEO_OK && again.id == frame.id && again.length == frame.length &&
               memcmp(again.data, frame.data, 4) == 0,
           "a frame that passed and is not what the packer makes");
}

/* A good frame with a few wrong bits is refused or says the same; three or fewer never pass. */
static void fuzz_damage(input_t *input, const aeo_address_t *address)
{
    aeo_message_t message, back;
    aeo_can_frame_t frame, good;
    unsigned i, flips;
    uint8_t node;
    memset(&message, 0, sizeof message);
    take(input, &message.tag, 1);
    take(input, &message.index, 2);
    message.kind = (aeo_kind_t)(take_byte(input) % 18u);
    message.count = (uint8_t)(take_byte(input) % 16u);
    take(input, message.value, sizeof message.value);
    if (aeo_frame_pack(address, &message, &frame) != AEO_OK) {
        return;
    }
    good = frame;
    demand(aeo_frame_unpack(address, &frame, &back, &node) == AEO_OK && node == address->node && same(&message, &back),
           "a packed frame is not read back");
    flips = take_byte(input) % 4u;
    for (i = 0; i < flips; i++) {
        const unsigned bit = (take_byte(input) + 256u * take_byte(input)) % (8u * frame.length);
        frame.data[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
    }
    if (memcmp(frame.data, good.data, frame.length) != 0) {
        demand(aeo_frame_unpack(address, &frame, &back, &node) != AEO_OK, "up to three wrong bits were not seen");
    }
}

static int send(void *context, const aeo_can_frame_t *frame)
{
    bus_t *self = (bus_t *)context;
    aeo_message_t message;
    uint8_t node;
    demand(self->locked == 1, "send without the lock");
    demand(aeo_frame_unpack(&self->address, frame, &message, &node) == AEO_OK && node == self->address.node,
           "a frame of the streamer that nobody can read");
    self->calls++;
    return take_byte(self->input) % 8u != 7u;
}

static uint32_t read_clock(void *context)
{
    bus_t *self = (bus_t *)context;
    uint32_t step;
    take(self->input, &step, sizeof step);
    self->now_us += step >> (step % 32u);
    return self->now_us;
}

static void lock(void *context)
{
    bus_t *self = (bus_t *)context;
    demand(self->locked++ == 0, "a nested lock");
}

static void unlock(void *context)
{
    bus_t *self = (bus_t *)context;
    demand(--self->locked == 0, "an unlock too many");
}

static void drive(aeo_stream_t *stream, input_t *input)
{
    static aeo_real_t values[AEO_STREAM_CHANNELS_MAX], theta[4096];
    uint32_t index = 0;
    unsigned k;
    for (k = 0; k < 12u; k++) {
        const unsigned what = take_byte(input);
        index += what % 16u == 0u ? 70000u : 1u;
        take(input, values, (what % 8u) * sizeof *values);
        (void)aeo_stream_sample(stream, index, values, values, values);
        (void)aeo_stream_innovation(stream, index, values);
        if (what % 4u == 0u) {
            (void)aeo_stream_snapshot(stream, index, theta);
        }
        if (what % 32u == 1u) {
            aeo_stream_finish(stream);
        } else if (what % 32u == 2u) {
            aeo_stream_reset(stream);
        }
        demand(aeo_stream_step(stream) <= (int)stream->config.burst, "more frames than a burst");
        demand(stream->credit_us <= (int32_t)(stream->config.burst * stream->longest_us), "more credit than a burst");
    }
}

static void fuzz_streamer(input_t *input)
{
    static aeo_channel_t channel[AEO_STREAM_CHANNELS_MAX];
    aeo_stream_config_t config;
    uint32_t *memory, words;
    aeo_stream_t stream;
    aeo_port_t port;
    bus_t bus;
    unsigned i;
    memset(&bus, 0, sizeof bus);
    take(input, &config, sizeof config);
    for (i = 0; i < AEO_STREAM_CHANNELS_MAX; i++) {
        channel[i].name = i % 3u == 0u ? NULL : "a name longer than what is sent of it, which is 32";
        channel[i].unit = i % 2u == 0u ? "m/s" : "";
        channel[i].scale = AEO_REAL(1);
    }
    config.channels = take_byte(input) % 16u == 0u ? NULL : channel;
    if (take_byte(input) % 4u != 0u) { /* mostly settings that are accepted */
        config.address.extended = config.address.extended & 1u;
        config.address.base = config.address.extended != 0u ? AEO_FRAME_BASE_EXTENDED : AEO_FRAME_BASE_STANDARD;
        config.address.node &= 3u;
        config.inputs %= 30u;
        config.outputs = (uint8_t)(config.outputs % 20u + 1u);
        config.scheduling %= 10u;
        config.model_set &= 1u;
        config.method = (uint8_t)(config.method & (config.model_set != 0u ? 3u : 2u)); /* els is VARMAX alone */
        config.past = (uint16_t)(config.past % 8u); /* 0: no predictor, any number of parameters */
        config.feedthrough = 0;
        config.parameters = config.past == 0u ? config.parameters % 400u + 1u
                                              : config.outputs * config.past *
                                                    (config.inputs + config.outputs * (1u + config.model_set));
        config.sample_time_s = config.lambda = config.rho = AEO_REAL(0.125);
        config.health_every |= 1u;
        config.describe_every |= 1u;
        config.burst = (uint8_t)(config.burst % 64u + 1u);
        config.repair_percent %= 101u;
        config.fd_ratio = (uint8_t)(config.fd_ratio % 16u + 1u);
        config.bits_per_s = config.bits_per_s % 2u == 0u ? 0u : config.bits_per_s % 8000000u + 1000u;
    }
    bus.input = input;
    bus.address = config.address;
    port.context = &bus;
    port.send = send;
    port.time_us = take_byte(input) % 2u == 0u ? NULL : read_clock;
    port.lock = lock;
    port.unlock = unlock;
    words = config.parameters >= 1u && config.parameters <= 4096u ? config.parameters : 1u;
    memory = malloc(words * sizeof *memory); /* exactly so many: the sanitizer sees one too far */
    demand(memory != NULL, "no memory");
    if (aeo_stream_init(&stream, &config, &port, memory, words) == AEO_OK) {
        drive(&stream, input);
    }
    free(memory);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    static const aeo_address_t addresses[] = {{AEO_FRAME_BASE_EXTENDED, 7, 1}, {AEO_FRAME_BASE_STANDARD, 2, 0}};
    input_t input = {data, bytes};
    const unsigned what = take_byte(&input);
    if (what % 3u == 0u) {
        fuzz_frame(&input, &addresses[what / 3u % 2u]);
    } else if (what % 3u == 1u) {
        fuzz_damage(&input, &addresses[what / 3u % 2u]);
    } else {
        fuzz_streamer(&input);
    }
    return 0;
}
