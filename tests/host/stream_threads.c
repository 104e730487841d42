/* A streamer shared by two threads, where what is done under the lock is counted: stream_threads classic|fd.
 *
 * Built with -Wl,--wrap for the four functions that make frames, snapshots and descriptions, and with ThreadSanitizer,
 * which reports what is read in one thread and written in the other without the lock. Prints a line
 *     repairs described copied sums
 * of the most calls of aeo_spread_repair, aeo_describe, aeo_float_bits and aeo_frame_crc32 while the lock was held
 * once, and exits with 1 when what is streamed does not come to its end.
 */
#include "aeolid/status.h"
#include "aeolid/stream.h"

#include "../../src/describe.h"
#include "../../src/spread.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 600, CHANNELS = 20, SAMPLES = 2000, REPAIRS = 0, DESCRIBED, COPIED, SUMS, COUNTED };

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_mutex_t end = PTHREAD_MUTEX_INITIALIZER;
static _Thread_local int locked;
static _Thread_local unsigned count[COUNTED];
static unsigned most[COUNTED]; /* guarded by mutex */
static aeo_stream_t stream;
static uint32_t memory[N];
static aeo_real_t theta[N];
static int done; /* guarded by end */

void __real_aeo_spread_repair(const aeo_spread_t *, const uint32_t *, uint32_t, uint32_t, uint16_t, uint32_t *);
int __real_aeo_describe(const aeo_stream_config_t *, uint32_t, uint32_t, aeo_message_t *);
uint32_t __real_aeo_float_bits(aeo_real_t);
uint32_t __real_aeo_frame_crc32(uint32_t, uint32_t);

void __wrap_aeo_spread_repair(const aeo_spread_t *self, const uint32_t *from, uint32_t parameters, uint32_t width,
                              uint16_t repair, uint32_t *sum)
{
    count[REPAIRS]++;
    __real_aeo_spread_repair(self, from, parameters, width, repair, sum);
}

int __wrap_aeo_describe(const aeo_stream_config_t *config, uint32_t hash, uint32_t slot, aeo_message_t *message)
{
    count[DESCRIBED]++;
    return __real_aeo_describe(config, hash, slot, message);
}

uint32_t __wrap_aeo_float_bits(aeo_real_t value)
{
    count[COPIED]++;
    return __real_aeo_float_bits(value);
}

uint32_t __wrap_aeo_frame_crc32(uint32_t crc, uint32_t word)
{
    count[SUMS]++;
    return __real_aeo_frame_crc32(crc, word);
}

static int send_frame(void *context, const aeo_can_frame_t *frame)
{
    (void)context;
    return locked && frame->length > 0u;
}

static void lock(void *context)
{
    (void)context;
    (void)pthread_mutex_lock(&mutex);
    locked = 1;
    memset(count, 0, sizeof count);
}

static void unlock(void *context)
{
    unsigned i;
    (void)context;
    for (i = 0; i < COUNTED; i++) {
        most[i] = count[i] > most[i] ? count[i] : most[i];
    }
    locked = 0;
    (void)pthread_mutex_unlock(&mutex);
}

static int is_done(void)
{
    int result;
    (void)pthread_mutex_lock(&end);
    result = done;
    (void)pthread_mutex_unlock(&end);
    return result;
}

static void *run_background(void *unused)
{
    unsigned steps = 0;
    while ((!is_done() || aeo_stream_pending(&stream)) && steps < 100000000u) {
        (void)aeo_stream_step(&stream);
        steps++;
    }
    return unused;
}

static void run_control_task(void)
{
    const aeo_real_t values[CHANNELS] = {0};
    uint32_t k, taken = 0;
    for (k = 0; k < SAMPLES || taken < 3u; k++) {
        theta[k % N] += (aeo_real_t)1;
        (void)aeo_stream_sample(&stream, k, values, values, NULL);
        taken += aeo_stream_snapshot(&stream, k, theta) == AEO_OK;
        (void)aeo_stream_health(&stream, k, &k, 1);
    }
    aeo_stream_finish(&stream);
    (void)pthread_mutex_lock(&end);
    done = 1;
    (void)pthread_mutex_unlock(&end);
}

int main(int argc, char **argv)
{
    static aeo_stream_channel_t channels[CHANNELS]; /* without names: 240 empty slots in a row */
    const aeo_port_t port = {NULL, send_frame, NULL, lock, unlock};
    aeo_stream_config_t config;
    pthread_t background;
    unsigned i;
    memset(&config, 0, sizeof config);
    for (i = 0; i < CHANNELS; i++) {
        channels[i].scale = (aeo_real_t)1;
    }
    config.address.base = AEO_FRAME_BASE_EXTENDED;
    config.address.extended = 1;
    config.inputs = CHANNELS / 2;
    config.outputs = CHANNELS / 2;
    config.seal = 1;
    config.fd = argc > 1 && strcmp(argv[1], "fd") == 0;
    config.fd_ratio = 4;
    config.parameters = N;
    config.sample_time_s = AEO_REAL(0.1);
    config.channels = channels;
    config.sample_every = 3; /* two of three are only counted */
    config.health_every = 2;
    config.describe_every = 50;
    config.repair_percent = 25;
    config.burst = 16;
    if (aeo_stream_init(&stream, &config, &port, memory, N) != AEO_OK ||
        pthread_create(&background, NULL, run_background, NULL) != 0) {
        return 1;
    }
    run_control_task();
    (void)pthread_join(background, NULL);
    (void)printf("%u %u %u %u\n", most[REPAIRS], most[DESCRIBED], most[COPIED], most[SUMS]);
    return aeo_stream_pending(&stream) || stream.counters.snapshots < 3u;
}
