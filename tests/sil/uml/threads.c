/* Streams from two threads over the SocketCAN port and receives on the same interface: threads INTERFACE.
 *
 * What the mutex must keep: every frame leaves whole, none twice, the samples of each channel in order.
 */
#include "aeolid/status.h"
#include "aeolid/stream.h"
#include "socketcan.h"

#include <linux/can.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { N = 200, SAMPLES = 400 };

static socketcan_t can;
static aeo_stream_t stream;
static uint32_t memory[N];
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static volatile int done;

static void check(int holds, const char *what)
{
    if (!holds) {
        (void)printf("FAILED: %s\n", what);
        exit(1);
    }
}

static void *run_background(void *unused)
{
    while (!done || aeo_stream_pending(&stream)) {
        (void)socketcan_poll(&can);
        (void)aeo_stream_step(&stream);
        (void)usleep(1000);
    }
    return unused;
}

static void *run_control_task(void *unused)
{
    aeo_real_t theta[N], u = 0, y = 0;
    uint32_t k, i;
    for (k = 0; k < SAMPLES; k++) {
        u = (aeo_real_t)k;
        y = (aeo_real_t) - (int)k;
        (void)aeo_stream_sample(&stream, k, &u, &y, NULL);
        if (k % 100u == 0u) {
            for (i = 0; i < N; i++) {
                theta[i] = (aeo_real_t)(k + i);
            }
            (void)aeo_stream_snapshot(&stream, k, theta);
        }
        (void)usleep(1000);
    }
    aeo_stream_finish(&stream);
    done = 1;
    return unused;
}

static int open_receiver(const char *interface)
{
    struct sockaddr_can address;
    const int buffer = 1 << 22;
    const int receiver = socket(AF_CAN, SOCK_RAW, CAN_RAW);
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(interface);
    check(setsockopt(receiver, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer) == 0, "a large buffer");
    check(bind(receiver, (struct sockaddr *)&address, sizeof address) == 0, "a receiver");
    return receiver;
}

/* Read what has been received: every frame is one of ours, samples come in order. */
static unsigned read_all(int receiver)
{
    const aeo_address_t address = {AEO_FRAME_BASE_EXTENDED, 7, 1};
    unsigned count = 0, next[2] = {0, 0};
    struct can_frame in;
    while (recv(receiver, &in, sizeof in, MSG_DONTWAIT) == (ssize_t)sizeof in) {
        aeo_can_frame_t frame;
        aeo_message_t message;
        uint8_t node;
        memset(&frame, 0, sizeof frame);
        frame.id = in.can_id & CAN_EFF_MASK;
        frame.flags = AEO_CAN_EXTENDED;
        frame.length = in.can_dlc;
        memcpy(frame.data, in.data, 8);
        check(aeo_frame_unpack(&address, &frame, &message, &node) == AEO_OK && node == 7u, "a frame of ours");
        if (message.kind == AEO_KIND_SAMPLE) {
            check(message.tag < 2u && message.index == next[message.tag]++, "samples in order");
        }
        count++;
    }
    check(next[0] == SAMPLES && next[1] == SAMPLES, "every sample");
    return count;
}

int main(int argc, char **argv)
{
    static const aeo_stream_channel_t channels[2] = {{.name = "u", .unit = "m", .scale = 1},
                                                     {.name = "y", .unit = "m", .scale = 1}};
    aeo_stream_config_t config;
    pthread_t control, background;
    aeo_port_t port;
    uint32_t before_us;
    int receiver;
    check(argc == 2, "an interface is named");
    receiver = open_receiver(argv[1]);
    check(socketcan_open(&can, argv[1], 0) == 0 && can.up, "the interface opens and is up");
    socketcan_port(&can, &port, &mutex);
    before_us = port.time_us(port.context);
    memset(&config, 0, sizeof config);
    config.address.base = AEO_FRAME_BASE_EXTENDED;
    config.address.node = 7;
    config.address.extended = 1;
    config.inputs = 1;
    config.outputs = 1;
    config.past = 0; /* no predictor: N values of anything */
    config.parameters = N;
    config.sample_time_s = 0.01F;
    config.channels = channels;
    config.sample_every = 1;
    config.health_every = 10;
    config.describe_every = 100;
    config.repair_percent = 25;
    config.burst = 4;
    check(aeo_stream_init(&stream, &config, &port, memory, N) == AEO_OK, "the stream starts");
    check(pthread_create(&control, NULL, run_control_task, NULL) == 0, "a thread");
    check(pthread_create(&background, NULL, run_background, NULL) == 0, "a thread");
    check(pthread_join(control, NULL) == 0 && pthread_join(background, NULL) == 0, "the threads end");
    check(read_all(receiver) == can.counters.sent && can.counters.sent == stream.counters.sent, "as many as were sent");
    check(stream.counters.snapshots > 0u && stream.counters.dropped == 0u, "whole snapshots, no sample lost");
    check(port.time_us(port.context) - before_us >= SAMPLES * 1000u, "a clock that runs");
    socketcan_close(&can);
    check(port.send(port.context, &(aeo_can_frame_t){0, 0, 0, {0}}) == 0, "a closed socket refuses");
    (void)printf("%u frames\n", can.counters.sent);
    return 0;
}
