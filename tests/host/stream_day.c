/* stream_day.c: what a streamer sends in a day, as a count of every identifier, for test_can_identifiers.py. */
#include <aeolid/stream.h>

#include <string.h>

#define KEPT 256u

typedef struct {
    uint32_t id[KEPT], flags[KEPT], count[KEPT];
    uint32_t kept, lost;
} day_t;

int day_run(day_t *day, uint32_t base, uint32_t node, uint32_t extended, uint32_t forced, uint32_t fd,
            uint32_t samples);
int day_packs(uint32_t base, uint32_t node, uint32_t extended, uint32_t forced);

static int count(void *context, const aeo_can_frame_t *frame)
{
    day_t *day = (day_t *)context;
    uint32_t i = 0;
    while (i < day->kept && (day->id[i] != frame->id || day->flags[i] != frame->flags)) {
        i++;
    }
    if (i == KEPT) {
        day->lost++;
        return 1;
    }
    if (i == day->kept) {
        day->id[i] = frame->id;
        day->flags[i] = frame->flags;
        day->kept++;
    }
    day->count[i]++;
    return 1;
}

/* Samples, snapshots with repairs, innovations, descriptions and health, at 5 % of 500 kbit/s; the status of init. */
int day_run(day_t *day, uint32_t base, uint32_t node, uint32_t extended, uint32_t forced, uint32_t fd, uint32_t samples)
{
    static const aeo_stream_channel_t channels[5] = {{.name = "a", .unit = "", .scale = 1},
                                                     {.name = "b", .unit = "", .scale = 1},
                                                     {.name = "c", .unit = "", .scale = 1},
                                                     {.name = "d", .unit = "", .scale = 1},
                                                     {.name = "e", .unit = "", .scale = 1}};
    static uint32_t memory[450];
    static aeo_stream_t stream;
    static const float theta[450];
    const float u[2] = {1, 2}, y[3] = {3, 4, 5};
    aeo_stream_config_t wire;
    aeo_port_t port;
    uint32_t k;
    int status;
    memset(day, 0, sizeof *day);
    memset(&port, 0, sizeof port);
    memset(&wire, 0, sizeof wire);
    port.context = day;
    port.send = count;
    wire.address.base = base;
    wire.address.node = (uint8_t)node;
    wire.address.extended = (uint8_t)(extended | (forced != 0u ? AEO_ADDRESS_FORCED : 0u));
    wire.inputs = 2;
    wire.outputs = 3;
    wire.past = 30;
    wire.parameters = 450;
    wire.sample_time_s = 0.1F;
    wire.lambda = wire.rho = 1;
    wire.channels = channels;
    wire.sample_every = 1;
    wire.health_every = 10;
    wire.describe_every = 100;
    wire.repair_percent = 25;
    wire.burst = 16;
    wire.bits_per_s = AEO_STREAM_SHARE(500000, 50);
    wire.seal = 1;
    wire.innovations = (uint8_t)(fd != 0u);
    wire.fd = (uint8_t)fd;
    wire.fd_ratio = 4;
    status = aeo_stream_init(&stream, &wire, &port, memory, 450);
    for (k = 0; status == 0 && k < samples; k++) {
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        (void)aeo_stream_innovation(&stream, k, y);
        if (k % 100u == 0u) {
            (void)aeo_stream_snapshot(&stream, k, theta);
        }
        (void)aeo_stream_step(&stream);
    }
    return status;
}

int day_packs(uint32_t base, uint32_t node, uint32_t extended, uint32_t forced)
{
    aeo_address_t address;
    aeo_can_frame_t frame;
    aeo_message_t message;
    memset(&message, 0, sizeof message);
    message.count = 1;
    address.base = base;
    address.node = (uint8_t)node;
    address.extended = (uint8_t)(extended | (forced != 0u ? AEO_ADDRESS_FORCED : 0u));
    return aeo_frame_pack(&address, &message, &frame);
}
