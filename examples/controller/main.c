/* A controller that identifies its plant while it works: samples into the filter, filter into the stream, stream onto
 * the bus. The plant is made up here and the bus is a text file in the form of candump, which aeolid listen reads; in
 * a controller, sensors and the CAN driver stand in their places, and nothing else changes.
 *
 *   ./controller bus.log [samples]
 */
#include <aeolid/aeolid.h>

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { INPUTS = 1, OUTPUTS = 2, PAST = 12, N = AEO_REGRESSOR_LENGTH(INPUTS, OUTPUTS, PAST, 0, 0) };
enum { PERIOD_US = 100000 };

static aeo_real_t words[AEO_ESTIMATOR_RLS_WORDS(INPUTS, OUTPUTS, PAST, 0, 0)];
static uint32_t snapshot[AEO_STREAM_WORDS(OUTPUTS * N)];
static aeo_estimator_t estimator;
static aeo_stream_t stream;

/* All there is to say of the channels: inputs first. Offset and scale are near mean and standard deviation; beyond minimum
 * and maximum lies a sensor's fault. */
static const aeo_channel_t channels[INPUTS + OUTPUTS] = {
    {.name = "pitch", .unit = "deg", .offset = 0, .scale = 1, .minimum = -90, .maximum = 90},
    {.name = "tower_fore_aft", .unit = "m/s2", .offset = 0, .scale = 1, .minimum = -50, .maximum = 50},
    {.name = "generator_speed", .unit = "rpm", .offset = 0, .scale = 1, .minimum = -100, .maximum = 100}};

/* The bus: one line a frame, as candump -l writes it. 1: taken. */
typedef struct {
    FILE *file;
    double time_s;
} bus_t;

static int send_frame(void *context, const aeo_can_frame_t *frame)
{
    const bus_t *bus = context;
    fprintf(bus->file, "(%.6f) can0 %08" PRIX32 "#", bus->time_s, frame->id);
    for (unsigned i = 0; i < frame->length; i++) {
        fprintf(bus->file, "%02X", frame->data[i]);
    }
    return fprintf(bus->file, "\n") > 0;
}

static int identification_init(bus_t *file)
{
    const aeo_estimator_config_t settings = {.inputs = INPUTS,
                                             .outputs = OUTPUTS,
                                             .past = PAST,
                                             .period_us = PERIOD_US,
                                             .channels = channels,
                                             .forgetting = 1.0f,
                                             .regularisation = 0.1f,
                                             .excitation_min = 0.05f,
                                             .growth_max = 10.0f};
    const aeo_stream_config_t bus = {.address = {AEO_FRAME_BASE_EXTENDED, 1, 1},
                                     .sample_every = 1,
                                     .health_every = 10,
                                     .describe_every = 100,
                                     .repair_percent = 25,
                                     .seal = 1,
                                     .burst = 16,
                                     .bits_per_s = AEO_STREAM_SHARE(500000, 50)};
    const aeo_port_t port = {.context = file, .send = send_frame};
    return aeo_estimator_init(&estimator, aeo_estimator_rls, &settings, words, sizeof words / sizeof *words) ==
               AEO_OK &&
           aeo_estimator_announce(&estimator, &stream, &bus, &port, snapshot, sizeof snapshot / sizeof *snapshot) ==
               AEO_OK;
}

/* What a control task calls after its own work, every 0.1 s. */
static void identify_sample(uint32_t k, const aeo_real_t *u, const aeo_real_t *y)
{
    aeo_estimator_send(&estimator, &stream, k, u, y, NULL, UINT64_C(1) * PERIOD_US * k);
    if (k % 300 == 299) {
        aeo_estimator_snapshot(&estimator, &stream, k); /* every 30 s */
    }
    aeo_stream_step(&stream);
}

/* Numbers in -1 ... 1, the same everywhere. */
static float draw(void)
{
    static uint32_t state = 1;
    state = state * UINT32_C(1664525) + UINT32_C(1013904223);
    return (float)(state >> 8) / 8388608.0f - 1.0f;
}

/* A tower of 0.32 Hz and damping 0.03 beside a rotor that slows down within 4 s, sampled at 10 Hz. */
static void run_plant(float pitch, aeo_real_t y[OUTPUTS])
{
    static float tower[2], rotor;
    const float c = 1.9480f, d = -0.9880f; /* 2 r cos(w h), -r^2 with r = exp(-0.03 w h), w = 2 pi 0.32 rad/s */
    const float next = c * tower[0] + d * tower[1] - 0.05f * pitch + 0.01f * draw();
    tower[1] = tower[0];
    tower[0] = next;
    rotor = 0.975f * rotor - 0.4f * pitch + 0.02f * draw();
    y[0] = tower[0] + 0.002f * draw();
    y[1] = rotor + 0.01f * draw();
}

int main(int count, char **arguments)
{
    bus_t bus = {.file = count > 1 ? fopen(arguments[1], "w") : NULL, .time_s = 0};
    const uint32_t samples = count > 2 ? (uint32_t)strtoul(arguments[2], NULL, 10) : 3000;
    if (bus.file == NULL) {
        fprintf(stderr, "usage: controller LOG [SAMPLES]: LOG is a file to write, such as bus.log\n");
        return 2;
    }
    if (!identification_init(&bus)) {
        fprintf(stderr, "controller: a setting is out of its range\n");
        return 1;
    }
    aeo_real_t u[INPUTS] = {0}, y[OUTPUTS] = {0};
    float test_signal = 0;
    for (uint32_t k = 0; k < samples; k++) {
        bus.time_s = 0.1 * (double)k;
        run_plant(u[0], y); /* the pitch of the sample before acts on this one */
        if (k % 5 == 0) {
            test_signal = draw() > 0 ? 0.5f : -0.5f;
        }
        u[0] = 0.2f * y[1] + test_signal; /* speed control, and a small test signal */
        identify_sample(k, u, y);
    }
    aeo_stream_finish(&stream);
    for (uint32_t k = samples; aeo_stream_pending(&stream); k++) {
        bus.time_s = 0.1 * (double)k;
        aeo_stream_step(&stream);
    }
    printf("%" PRIu32 " samples, health %" PRIu32 ", %" PRIu32 " frames\n", samples, aeo_estimator_health(&estimator),
           stream.counters.sent);
    return fclose(bus.file) == 0 ? 0 : 1;
}
