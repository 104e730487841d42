/* The shown SocketCAN block with a control thread and a background thread, time running 25 times as fast. */
#include "harness.h"

#include "wiring.h"

#include <unistd.h>

static uint32_t (*read_clock)(void *context);
static volatile int ended;

static uint32_t hurry(void *context)
{
    return 25u * read_clock(context);
}

static void *run_background(void *unused)
{
    while (!ended) {
        background_task();
        (void)usleep(500);
    }
    return unused;
}

int main(void)
{
    aeo_real_t u[INPUTS], y[OUTPUTS];
    pthread_t thread;
    uint32_t k;
    if (!can_start()) {
        return 1;
    }
    read_clock = stream.port.time_us;
    stream.port.time_us = hurry;
    if (pthread_create(&thread, NULL, run_background, NULL) != 0) {
        return 1;
    }
    for (k = 0; k < 250u; k++) {
        harness_sensors(u, y);
        take_sample(u, y, k);
        (void)usleep(4000);
    }
    ended = 1;
    return pthread_join(thread, NULL);
}
