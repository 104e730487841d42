/* node.c: a controller in software: feeds samples from standard input to the filter and streams it on a virtual bus.
 *
 * Standard input, one record a sample, 8-byte little-endian doubles and nothing else:
 *     index, time in seconds, u (inputs), y (outputs)                          NaN: the sample is missing
 * Standard output, one line: the address for a listener, as `aeolid listen --bus` takes it.
 * Standard error: a line `health {json}` at the end, a sentence when something fails. Exit 0, or 2 for wrong usage, or
 * 3.
 * SIGINT and SIGTERM: no further samples; what is under way is sent to its end.
 */
#include "../common/filter_refusal.h"
#include "../common/method_names.h"
#include "node_bus.h"
#include "node_options.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define BURST      16u
#define STALL_S    5.0   /* a listener that takes less than STALL_TEXT in so long has gone */
#define STALL_TEXT 4096u /* characters: 150 classic frames, a fifth of what a bus of 10 kbit/s carries */
#define DESCRIBE_S 10.0  /* what a late joiner waits at most for the description */
#define LINGER_S   2.0   /* time for listeners to read the end and close; a pseudo terminal forgets what was not read */
#define GOODBYE_S  30.0  /* for all of it, however slowly they read: a full ring at 115200 bit/s takes 23 s */

typedef struct {
    node_options_t options;
    node_bus_t bus;
    aeo_stream_t stream;
    aeo_estimator_t estimator;
    uint32_t snapshot_steps; /* samples between two snapshots */
    uint32_t since_snapshot;
    uint64_t samples;
    uint32_t index; /* of the newest sample */
    double start_s;
} node_t;

static volatile sig_atomic_t stopped;

static void stop(int number)
{
    (void)number;
    stopped = 1;
}

static double clock_s(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int fail(const char *what, const char *why)
{
    (void)fprintf(stderr, "aeolid-node: %s: %s\n", what, why);
    return 3;
}

/* ---- set-up ------------------------------------------------------------------------------------------------------ */

static int init_estimator(node_t *self)
{
    const node_options_t *o = &self->options;
    const aeo_estimator_method_t method = method_of((unsigned)o->method);
    aeo_estimator_config_t config;
    aeo_real_t *memory;
    size_t words;
    memset(&config, 0, sizeof config);
    config.inputs = o->inputs;
    config.outputs = o->outputs;
    config.past = o->past;
    config.model_set = o->varmax ? AEO_VARMAX : AEO_VARX;
    config.feedthrough = o->feedthrough;
    config.period_us = (uint32_t)(o->sample_time_s * 1e6 + 0.5);
    config.channels = o->channel;
    config.forgetting = o->lambda;
    config.regularisation = o->rho;
    config.excitation_min = AEO_REAL(0.05);
    config.growth_max = AEO_REAL(10.0);
    config.varx_samples = o->varx_samples;
    config.forgetting_start = o->lambda_start;
    config.forgetting_rate = AEO_REAL(0.99);
    config.guard_ratio = AEO_REAL(4.0);
    words = aeo_estimator_words(method, &config);
    memory = calloc(words, sizeof *memory);
    if (memory == NULL || aeo_estimator_init(&self->estimator, method, &config, memory, words) != AEO_OK) {
        char refused[FILTER_REFUSAL_MAX];
        filter_refusal_explain(refused, (unsigned)o->method, &config, memory, words);
        return fail("filter", refused);
    }
    return 0;
}

/* Steps in DESCRIBE_S, or more where the share is narrow, within what the stream takes. */
static uint16_t choose_describe_every(const node_options_t *o)
{
    const double bits =
        (double)o->bits_per_s * o->sample_time_s; /* a step; a description takes a fifth of them at most */
    const double all = 5.0 * AEO_FRAME_BITS_EXTENDED * AEO_STREAM_DESCRIPTION_MAX((uint32_t)o->inputs + o->outputs);
    const double usual = DESCRIBE_S / o->sample_time_s, narrow = bits > 0 ? all / bits : 0.0;
    const double steps = usual > narrow ? usual : narrow;
    return (uint16_t)(steps < 1.0 ? 1.0 : steps > 65535.0 ? 65535.0 : steps);
}

/* Steps between two health frames: 10, or as many as leave them a twentieth of a narrow share. */
static uint16_t choose_health_every(const node_options_t *o)
{
    const double bits = (double)o->bits_per_s * o->sample_time_s; /* a step */
    const double steps = bits > 0 ? 20.0 * AEO_FRAME_BITS_EXTENDED / bits + 1.0 : 0.0;
    return (uint16_t)(steps < 10.0 ? 10.0 : steps > 65535.0 ? 65535.0 : steps);
}

/* Samples between two snapshots, 0 none: at least one where any are asked for, at most what 32 bits hold. */
static uint32_t choose_snapshot_steps(double seconds, double sample_time_s)
{
    const double steps = seconds / sample_time_s + 0.5;
    if (!(seconds > 0)) {
        return 0;
    }
    return steps < 1.0 ? 1u : steps >= 4294967295.0 ? UINT32_MAX : (uint32_t)steps;
}

static int init_stream(node_t *self)
{
    const node_options_t *o = &self->options;
    const uint32_t parameters = (uint32_t)self->estimator.regressor.length * o->outputs;
    aeo_stream_config_t config;
    aeo_port_t port;
    aeo_status_t result;
    memset(&config, 0, sizeof config);
    config.address.base = o->base;
    config.address.node = o->node;
    config.address.extended = (uint8_t)((o->base >= 0x800u) | (o->force_base ? AEO_ADDRESS_FORCED : 0u));
    config.innovations = o->innovations;
    config.seal = o->seal;
    config.fd = o->fd;
    config.fd_ratio = o->fd_ratio;
    config.sample_every = o->sample_every;
    config.health_every = choose_health_every(o);
    config.describe_every = choose_describe_every(o);
    config.repair_percent = o->repair_percent;
    config.burst = BURST;
    config.bits_per_s = o->bits_per_s;
    node_bus_port(&self->bus, &port);
    result = aeo_estimator_announce(&self->estimator, &self->stream, &config, &port,
                                    calloc(parameters, sizeof(uint32_t)), parameters);
    if (result == AEO_E_BUDGET) {
        return fail("stream", "samples, health and description need more than nine tenths of the share of the bus; "
                              "raise --share or --sample-every");
    }
    return result == AEO_OK ? 0 : fail("stream", "a setting is out of range (stream.h)");
}

static int open_bus(node_t *self)
{
    const node_options_t *o = &self->options;
    char why[SOCKETCAN_TEXT_MAX];
    if (o->can != NULL ? node_bus_open_can(&self->bus, o->can, o->fd, o->bit_rate, why)
                       : node_bus_open_text(&self->bus, o->terminal, o->tcp_port, why)) {
        return fail("bus", why);
    }
    (void)printf("%s\n", self->bus.address);
    (void)fflush(stdout);
    return 0;
}

/* ---- running ----------------------------------------------------------------------------------------------------- */

/* In lossless mode wait until every listener has room for what one sample can send. */
static void wait_for_room(node_t *self)
{
    const size_t needed = BURST + 2u * AEO_STREAM_CHANNELS_MAX + 2u; /* in CAN FD frames fewer, and less text */
    double since = clock_s();
    size_t before = node_bus_waiting(&self->bus);
    while (node_bus_room(&self->bus) < needed) {
        size_t waiting;
        (void)node_bus_poll(&self->bus, -1, 100);
        waiting = node_bus_waiting(&self->bus);
        if (waiting + STALL_TEXT <= before) {
            before = waiting;
            since = clock_s();
        } else if (clock_s() - since > STALL_S) {
            node_bus_abandon(&self->bus, POSIX_BUS_RING / 2u);
            before = node_bus_waiting(&self->bus);
            since = clock_s();
        }
    }
}

/* Keep the bus moving until sample `number` of the run is due. */
static void wait_until_due(node_t *self, uint64_t number)
{
    double left;
    if (!(self->options.speed > 0) || stopped) {
        wait_for_room(self);
        if (number % 64u == 0u) {
            (void)node_bus_poll(&self->bus, -1, 0);
        }
        return;
    }
    do {
        left = self->start_s + (double)number * self->options.sample_time_s / self->options.speed - clock_s();
        (void)node_bus_poll(&self->bus, -1, left > 0.1 ? 100 : left > 0 ? (int)(left * 1e3) : 0);
    } while (left > 1e-3 && !stopped);
}

/* Begin to send the parameters of this instant; 0 while the snapshot before is still under way, or where a lattice has
 * no finite ones. */
static int send_snapshot(node_t *self)
{
    return aeo_estimator_snapshot(&self->estimator, &self->stream, self->index) == AEO_OK;
}

static void take_sample(node_t *self, const double *record)
{
    aeo_real_t u[AEO_STREAM_CHANNELS_MAX], y[AEO_STREAM_CHANNELS_MAX];
    const unsigned r = self->options.inputs, l = self->options.outputs;
    unsigned i;
    for (i = 0; i < r; i++) {
        u[i] = (aeo_real_t)record[2u + i];
    }
    for (i = 0; i < l; i++) {
        y[i] = (aeo_real_t)record[2u + r + i];
    }
    self->index = (uint32_t)record[0];
    (void)aeo_estimator_send(&self->estimator, &self->stream, self->index, u, y, NULL,
                             (uint64_t)(record[1] * 1e6 + 0.5));
    self->since_snapshot++;
    if (self->snapshot_steps > 0u && self->since_snapshot >= self->snapshot_steps && send_snapshot(self)) {
        self->since_snapshot = 0;
    }
    (void)aeo_stream_step(&self->stream);
    self->samples++;
}

static int record_is_sound(const double *record)
{
    return record[0] >= 0 && record[0] <= 4294967295.0 && record[1] >= 0 && record[1] <= 1e12;
}

/* Read and process samples until the input ends or a signal comes. */
static int run(node_t *self)
{
    static char buffer[65536];
    double record[2 + AEO_STREAM_CHANNELS_MAX];
    const size_t size = sizeof(double) * (2u + self->options.inputs + self->options.outputs);
    size_t held = 0, at;
    self->start_s = clock_s();
    while (!stopped) {
        ssize_t got;
        if (!node_bus_poll(&self->bus, STDIN_FILENO, 100)) {
            continue;
        }
        got = read(STDIN_FILENO, buffer + held, sizeof buffer - held);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got <= 0) {
            return got == 0 && held == 0u ? 0
                                          : fail("standard input", got < 0 ? strerror(errno) : "ends within a sample");
        }
        held += (size_t)got;
        for (at = 0; held - at >= size && !stopped; at += size) {
            memcpy(record, buffer + at, size);
            if (!record_is_sound(record)) {
                return fail("standard input", "an index or time is out of range; samples are lost or misaligned");
            }
            wait_until_due(self, self->samples);
            take_sample(self, record);
        }
        held -= at;
        memmove(buffer, buffer + at, held);
    }
    return 0;
}

/* Step without samples until nothing is pending, or the bus takes nothing any more (then not 0); simulated time goes on
 * as it did. */
static int drain(node_t *self)
{
    uint64_t number = self->samples;
    const double since = clock_s();
    self->start_s =
        since - (double)number * self->options.sample_time_s / (self->options.speed > 0 ? self->options.speed : 1);
    while (aeo_stream_pending(&self->stream)) {
        wait_until_due(self, ++number);
        wait_for_room(self); /* a listener that hangs must not keep the node for ever */
        (void)aeo_stream_step(&self->stream);
        if (node_bus_is_stuck(&self->bus, STALL_S)) {
            return fail(self->bus.address, "it takes no frames, so the end of the stream could not be sent");
        }
    }
    return 0;
}

static int say_goodbye(node_t *self)
{
    int result;
    double since, begun;
    size_t before;
    result = drain(self); /* first the snapshot under way, then one of the last theta */
    if (result == 0) {
        (void)send_snapshot(self);
        aeo_stream_finish(&self->stream);
        result = drain(self);
    }
    since = begun = clock_s();
    before = node_bus_waiting(&self->bus);
    while (node_bus_listeners(&self->bus) > 0u && clock_s() - since < LINGER_S && clock_s() - begun < GOODBYE_S) {
        (void)node_bus_poll(&self->bus, -1, 20);
        if (node_bus_waiting(&self->bus) != before) {
            before = node_bus_waiting(&self->bus);
            since = clock_s();
        }
    }
    return result;
}

static int dump(node_t *self)
{
    const aeo_real_t *theta = aeo_estimator_theta(&self->estimator);
    FILE *file = fopen(self->options.dump, "wb");
    uint32_t i;
    int error = file == NULL ? errno : theta == NULL ? ERANGE : 0;
    for (i = 0; error == 0 && i < self->stream.config.parameters; i++) {
        const uint32_t bits = aeo_float_bits(theta[i]);
        const unsigned char bytes[4] = {(unsigned char)(bits & 0xFFu), (unsigned char)((bits >> 8) & 0xFFu),
                                        (unsigned char)((bits >> 16) & 0xFFu), (unsigned char)(bits >> 24)};
        error = fwrite(bytes, 1, 4, file) == 4u ? 0 : EIO;
    }
    if (file != NULL && fclose(file) != 0 && error == 0) {
        error = errno;
    }
    return error == 0 ? 0 : fail(self->options.dump, strerror(error));
}

static void print_health(const node_t *self)
{
    const aeo_stream_counters_t *c = &self->stream.counters;
    const aeo_regressor_count_t *g = &self->estimator.regressor.count;
    (void)fprintf(stderr,
                  "health {\"samples\": %llu, \"accepted\": %u, \"not_finite\": %u, \"range\": %u, \"time\": %u, "
                  "\"gaps\": %u, \"withheld\": %u, \"bounded\": %u, \"reinitialised\": %u, "
                  "\"released\": %u, \"flags\": %u, "
                  "\"sent\": %u, \"refused\": %u, \"dropped\": %u, \"snapshots\": %u, \"busy\": %u, \"overrun\": %u",
                  (unsigned long long)self->samples, g->samples, g->not_finite, g->range, g->time, g->gaps,
                  aeo_estimator_count(&self->estimator, AEO_COUNT_WITHHELD),
                  aeo_estimator_count(&self->estimator, AEO_COUNT_BOUNDED),
                  aeo_estimator_count(&self->estimator, AEO_COUNT_REINITIALISED),
                  aeo_estimator_count(&self->estimator, AEO_COUNT_RELEASED), aeo_estimator_health(&self->estimator),
                  c->sent, c->refused, c->dropped, c->snapshots, c->busy, node_bus_dropped(&self->bus));
    node_bus_print_counters(&self->bus);
    (void)fprintf(stderr, "}\n");
}

int main(int argc, char **argv)
{
    static node_t self;
    struct sigaction action;
    int result, ended;
    if (node_options_read(&self.options, argc, argv) != 0) {
        return 2;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = stop;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    self.snapshot_steps = choose_snapshot_steps(self.options.snapshot_s, self.options.sample_time_s);
    if (init_estimator(&self) != 0 || open_bus(&self) != 0 || init_stream(&self) != 0) {
        return 3;
    }
    while (self.options.wait && !stopped && node_bus_listeners(&self.bus) == 0u) {
        (void)node_bus_poll(&self.bus, -1, 100);
    }
    result = run(&self);
    ended = say_goodbye(&self);
    result = result != 0 ? result : ended;
    if (self.options.dump != NULL && dump(&self) != 0) {
        result = 3;
    }
    print_health(&self);
    node_bus_close(&self.bus);
    return result;
}
