/* A budget counts all that is sent, and what was accepted sends a snapshot within the time the formula says. */
#include "fake_bus.h"
#include "samples.h"
#include "unity.h"

#include <string.h>

static uint64_t seed;
static double description; /* frames */

void setUp(void)
{
    const aeo_stream_config_t config = make_config();
    set_up_bus();
    seed = 20260101u;
    start_stream(&config);
    for (description = 0; stream.described == 0u;) {
        description += (double)aeo_stream_step(&stream);
    }
    set_up_bus();
}

void tearDown(void)
{
    tear_down_bus();
}

static uint32_t pick(const uint32_t *from, unsigned count)
{
    const double at = (draw(&seed) + 1.0) / 2.0 * (double)count;
    return from[(unsigned)at < count ? (unsigned)at : count - 1u];
}
#define PICK(...) pick((const uint32_t[]){__VA_ARGS__}, sizeof((const uint32_t[]){__VA_ARGS__}) / sizeof(uint32_t))

static aeo_stream_config_t draw_config(void)
{
    aeo_stream_config_t config = make_config();
    config.fd = (uint8_t)PICK(0, 0, 1);
    config.fd_ratio = (uint8_t)(config.fd != 0u ? PICK(1, 2, 4, 16) : 0u);
    config.seal = (uint8_t)PICK(0, 1);
    config.innovations = (uint8_t)PICK(0, 0, 1);
    config.past = 0;
    config.parameters = PICK(1, 14, 15, 150, N);
    config.sample_time_s = AEO_REAL(1e-6) * (aeo_real_t)PICK(500, 1000, 5000, 20000, 100000, 1000000);
    config.sample_every = (uint16_t)PICK(0, 1, 2, 10, 100, 1000);
    config.health_every = (uint16_t)PICK(1, 2, 5, 10, 100, 1000);
    config.describe_every = (uint16_t)PICK(20, 100, 1000, 10000, 65535);
    config.repair_percent = (uint8_t)PICK(0, 25, 100);
    config.burst = (uint8_t)PICK(1, 2, 3, 5, 16, 255);
    config.bits_per_s = PICK(0, 1000, 2500, 9700, 12500, 25000, 100000, 500000);
    return config;
}

/* Bits a second of everything but snapshots, and frames a step, by another way than the library's: from the macros. */
static double add_up(const aeo_stream_config_t *config, double *frames)
{
    const double period = (double)config->sample_time_s;
    const uint32_t innovations = config->innovations != 0u ? OUTPUTS : 0u;
    const double sample = config->fd != 0u ? (double)AEO_STREAM_SAMPLE_BITS_FD(CHANNELS, innovations, config->fd_ratio)
                                           : (double)AEO_STREAM_SAMPLE_BITS(CHANNELS, innovations, config->seal);
    *frames = 1.0 / config->health_every + description / config->describe_every;
    return (*frames * 160.0 + (config->sample_every > 0u ? sample / config->sample_every : 0.0)) / period;
}

/* Steps until the snapshot has left, with samples and innovations as declared; at most so many. */
static unsigned long count_steps(uint32_t *index, unsigned long most)
{
    const uint32_t before = stream.counters.snapshots;
    unsigned long steps = 0;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, *index, theta));
    while (stream.counters.snapshots == before && steps <= most) {
        fake.kept = 0;
        (void)aeo_stream_sample(&stream, *index, u, y, NULL);
        (void)aeo_stream_innovation(&stream, *index, y);
        (void)aeo_stream_step(&stream);
        (*index)++;
        steps++;
    }
    return steps;
}

static void a_snapshot_leaves_in_time(void)
{
    unsigned accepted = 0, near = 0;
    for (unsigned t = 0; t < 3000u; t++) {
        const aeo_stream_config_t config = draw_config();
        double frames;
        const double load = add_up(&config, &frames);
        const int status = aeo_stream_init(&stream, &config, &port, words, config.parameters);
        if ((config.bits_per_s > 0u && load > 0.95 * config.bits_per_s) || frames > config.burst) {
            TEST_ASSERT_EQUAL_INT(AEO_E_BUDGET, status); /* more than there is was never to be promised */
        }
        if (status != AEO_OK) {
            TEST_ASSERT_EQUAL_INT(AEO_E_BUDGET, status);
            continue;
        }
        const unsigned long most = aeo_stream_snapshot_steps(&stream);
        if (most > 20000u) {
            continue; /* costs time, shows nothing new */
        }
        uint32_t index = (uint32_t)((draw(&seed) + 1.0) * 500.0);
        unsigned long longest = 0;
        for (unsigned s = 0; s < 3u; s++) { /* the first meets the description, the others what is on its way by then */
            const unsigned long steps = count_steps(&index, most);
            TEST_ASSERT_TRUE_MESSAGE(steps <= most, "a snapshot later than its time");
            longest = steps > longest ? steps : longest;
        }
        accepted++;
        near += longest * 3u > most;
    }
    TEST_ASSERT_TRUE(accepted > 500u);
    TEST_ASSERT_TRUE(near * 2u > accepted); /* and the formula is no empty promise */
}

static void a_period_that_does_not_fit_is_refused(void)
{
    aeo_stream_config_t config = make_config();
    config.bits_per_s = 25000;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &config, &port, words, N));
    const uint32_t least = aeo_stream_snapshot_steps(&stream);
    config.snapshot_every = least;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &config, &port, words, N));
    config.snapshot_every = least - 1u;
    TEST_ASSERT_EQUAL_INT(AEO_E_BUDGET, aeo_stream_init(&stream, &config, &port, words, N));
    TEST_ASSERT_EQUAL_UINT32(0, aeo_stream_snapshot_steps(NULL));
}

/* Settings under which health took every turn, or all of the bus. */
static void health_has_its_turn_and_no_more(void)
{
    static const struct {
        uint16_t health_every, sample_every;
        uint8_t burst;
        uint32_t bits_per_s;
        double sample_time_s;
    } BAD[] = {{1, 1, 1, 0, 0.1}, {1, 0, 16, 25000, 0.005}, {10, 100, 16, 12500, 0.001}, {10, 0, 16, 12500, 0.001}};
    for (unsigned t = 0; t < 4u; t++) {
        aeo_stream_config_t config = make_config();
        config.health_every = BAD[t].health_every;
        config.sample_every = BAD[t].sample_every;
        config.burst = BAD[t].burst;
        config.bits_per_s = BAD[t].bits_per_s;
        config.sample_time_s = (aeo_real_t)BAD[t].sample_time_s;
        TEST_ASSERT_EQUAL_INT(AEO_E_BUDGET, aeo_stream_init(&stream, &config, &port, words, N));
    }
    /* and where a port that refuses leaves health always due, snapshots go on all the same */
    aeo_stream_config_t config = make_config();
    config.health_every = 2;
    config.burst = 2;
    start_stream(&config);
    describe_first();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 0, theta));
    for (unsigned k = 0; k < 2000u && stream.counters.snapshots == 0u; k++) {
        stream.health_in = 0;
        (void)aeo_stream_step(&stream);
    }
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.snapshots);
}

static void after_the_farewell_there_is_silence(void)
{
    const aeo_stream_config_t config = make_config();
    start_stream(&config);
    describe_first();
    aeo_stream_finish(&stream);
    for (unsigned k = 0; k < 20u && aeo_stream_pending(&stream); k++) {
        (void)aeo_stream_step(&stream);
    }
    TEST_ASSERT_FALSE(aeo_stream_pending(&stream));
    for (unsigned k = 0; k < 1000u; k++) {
        TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_snapshot_leaves_in_time);
    RUN_TEST(a_period_that_does_not_fit_is_refused);
    RUN_TEST(health_has_its_turn_and_no_more);
    RUN_TEST(after_the_farewell_there_is_silence);
    return UNITY_END();
}
