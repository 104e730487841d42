/* A budget counts all that is sent, and what was accepted sends a snapshot within the time the formula says. */
#include "budget.h"
#include "fake_bus.h"
#include "samples.h"
#include "stream_send.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static uint64_t seed;
static double description; /* frames */
static unsigned counted_channels = CHANNELS, counted_outputs = OUTPUTS;

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

/* ---- the formula of budget.h, in double ---------------------------------------------------------------------------- */

static double cost_us(const aeo_stream_config_t *config, unsigned length)
{
    const double bits =
        length > 8u ? (double)AEO_FRAME_FD_BITS_EXTENDED(length, config->fd_ratio) : (double)AEO_FRAME_BITS_EXTENDED;
    return config->bits_per_s > 0u ? ceil(bits * 1e6 / config->bits_per_s) : 0.0;
}

static double values_us(const aeo_stream_config_t *config, unsigned values)
{
    if (values == 0u || config->sample_every == 0u) {
        return 0.0;
    }
    double sum = config->fd == 0u && config->seal != 0u ? cost_us(config, 8) : 0.0;
    for (unsigned left = values; left > 0u;) {
        const unsigned count = config->fd == 0u ? 1u : left < 14u ? left : 14u;
        sum += cost_us(config, config->fd == 0u ? 8u : AEO_FRAME_FD_LENGTH(count));
        left -= count;
    }
    return sum;
}

/* What a step keeps of so much credit: whole frames, or one every so many steps. */
static double keep(double earned, double longest, double burst)
{
    if (earned < longest) {
        return earned > 0.0 ? longest / ceil(longest / earned) : 0.0;
    }
    return fmin(floor(earned / longest), burst) * longest;
}

static double foretell_steps(const aeo_stream_config_t *config)
{
    const double period = round((double)config->sample_time_s * 1e6), burst = config->burst;
    const double longest = fmax(cost_us(config, 8), config->fd != 0u ? cost_us(config, 64) : 0.0);
    const double every = config->sample_every > 0u ? config->sample_every : 1.0;
    const double sample =
        values_us(config, counted_channels) + values_us(config, config->innovations != 0u ? counted_outputs : 0u);
    const double frames = 1.0 / config->health_every + description / config->describe_every;
    const double blocks = config->fd != 0u ? AEO_STREAM_BLOCKS(config->parameters) : config->parameters;
    const double all = blocks + AEO_STREAM_REPAIRS((uint32_t)blocks, config->repair_percent) + 4.0;
    const int cuts = longest > 0.0 && period > (burst - 1.0) * longest;
    const double usable = cuts ? keep(period, longest, burst) : period, paying = ceil(sample / period);
    double rest = period - sample / every;
    if (cuts && every < 2.0) {
        rest = keep(period - sample, longest, burst);
    } else if (cuts) {
        rest = paying < every ? usable * (every - paying) / every : 0.0;
    }
    const double left = rest - frames * (cuts ? longest : cost_us(config, 8));
    const double share = sample / every + frames * cost_us(config, 8);
    if (fabs(share / period - 0.9) < 1e-5 || fabs(left - 0.1 * usable) < 1e-5 * period ||
        fabs(frames / burst - 0.9) < 1e-5) {
        return -1.0; /* rounding decides */
    }
    if (share > 0.9 * period || left < 0.1 * usable || frames > 0.9 * burst) {
        return 0.0;
    }
    const double time = (all * longest + description * longest + 2.0 * (sample + 2.0 * longest)) / left;
    return fmax(time, (all + description + 2.0) / (burst - frames)) + 2.0;
}

static void steps_are_those_of_the_formula(void)
{
    unsigned accepted = 0, cut = 0;
    for (unsigned t = 0; t < 20000u; t++) {
        aeo_stream_config_t config = draw_config();
        config.bits_per_s = t % 4u == 0u ? 160000u * (1u + t / 4u % 40u) : config.bits_per_s; /* whole microseconds */
        const double steps = foretell_steps(&config);
        const int status = aeo_stream_init(&stream, &config, &port, words, config.parameters);
        if (steps < -0.5) {
            continue;
        }
        if (status == AEO_OK) { /* the library counts in float, and cuts fractions off */
            TEST_ASSERT_TRUE(fabs((double)aeo_stream_snapshot_steps(&stream) + 0.5 - steps) <= 0.6 + 1e-5 * steps);
            accepted++;
            cut += config.sample_time_s > AEO_REAL(0.05) && config.bits_per_s > 0u;
        } else {
            TEST_ASSERT_TRUE(status == AEO_E_BUDGET && steps < 1.0);
        }
    }
    TEST_ASSERT_TRUE(accepted > 4000u && cut > 500u);
}

/* Any number of inputs and outputs, of which the last frame holds what is left; and longest frames that take a microsecond
 * more than some whole steps. */
static void steps_of_any_channels_are_those_of_the_formula(void)
{
    static aeo_channel_t many[60];
    unsigned accepted = 0;
    for (unsigned i = 0; i < 60u; i++) {
        many[i].scale = AEO_REAL(1);
    }
    for (unsigned t = 0; t < 3000u; t++) {
        aeo_stream_config_t config = draw_config();
        config.channels = many;
        config.inputs = (uint8_t)PICK(0, 1, 12, 13, 14, 27, 28, 29);
        config.outputs = (uint8_t)PICK(1, 2, 13, 14, 15, 28, 29);
        config.feedthrough = 0;
        config.sample_every = (uint16_t)PICK(1, 2, 10);
        config.describe_every = 60000;
        config.health_every = 1000;
        if (t % 3u == 0u) { /* 160 bits in 501, 1001, 2001, 5001 microseconds */
            config.fd = 0;
            config.burst = 1;
            config.bits_per_s = PICK(319361, 159841, 79961, 31994);
            config.sample_time_s = AEO_REAL(1e-6) * (aeo_real_t)PICK(500, 1000, 5000, 100000);
        }
        const double kept = description;
        counted_channels = config.inputs + (unsigned)config.outputs;
        counted_outputs = config.outputs;
        description = 7.0 + 2.0 * counted_channels;
        const double steps = foretell_steps(&config);
        const int status = aeo_stream_init(&stream, &config, &port, words, config.parameters);
        counted_channels = CHANNELS;
        counted_outputs = OUTPUTS;
        description = kept;
        if (status == AEO_OK && steps > -0.5) {
            TEST_ASSERT_TRUE(fabs((double)aeo_stream_snapshot_steps(&stream) + 0.5 - steps) <= 0.6 + 1e-5 * steps);
            accepted++;
        } else {
            TEST_ASSERT_TRUE(steps < 1.0 && (steps < -0.5 || status == AEO_E_BUDGET));
        }
    }
    TEST_ASSERT_TRUE(accepted > 300u);
}

/* The step that cannot be cut: burst - 1 longest frames of 1000 microseconds take a sample time. */
static void a_step_that_fits_the_cap_is_not_cut(void)
{
    aeo_stream_config_t config = make_config();
    config.bits_per_s = 160000;
    config.sample_every = 100;
    config.describe_every = 60000;
    for (uint8_t burst = 3; burst < 6u; burst++) {
        for (unsigned more = 0; more < 2u; more++) {
            config.burst = burst;
            config.sample_time_s = AEO_REAL(1e-6) * (aeo_real_t)(1000u * (burst - 1u) + 20u * more);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &config, &port, words, N));
            TEST_ASSERT_UINT32_WITHIN(1, (uint32_t)foretell_steps(&config), aeo_stream_snapshot_steps(&stream));
        }
    }
}

/* A frame's time is rounded up, also where it is a whole number and a little more: 160 bits, and 53333333 of them a second. */
static void times_of_frames_are_rounded_up(void)
{
    aeo_stream_config_t config = make_config();
    static const uint32_t rates[] = {1000, 53333333, 159999999, 160000000, 160000001, 80000000, 79999999, 7, 125000};
    for (unsigned i = 0; i < sizeof rates / sizeof *rates; i++) {
        config.bits_per_s = rates[i];
        TEST_ASSERT_EQUAL_UINT32((uint32_t)cost_us(&config, 8), aeo_stream_cost_us(&config, 8));
    }
    config.bits_per_s = 0;
    TEST_ASSERT_EQUAL_UINT32(0, aeo_stream_cost_us(&config, 8));
}

/* Microseconds are counted to the nearest one. */
static void periods_are_rounded_to_whole_microseconds(void)
{
    aeo_stream_config_t config = make_config();
    for (unsigned k = 20; k < 20000u; k += 1u + k / 7u) {
        for (int part = -4; part <= 4; part++) {
            config.sample_time_s = (aeo_real_t)(1e-6 * ((double)k + 0.1 * part));
            TEST_ASSERT_EQUAL_UINT32(k, aeo_budget_period_us(&config));
        }
    }
}

/* Nine tenths of a step's frames may be health and description: 0.5 and 8.5 of ten, which are exact, and no more. */
static void nine_tenths_of_the_frames_are_allowed(void)
{
    aeo_stream_config_t config = make_config();
    config.bits_per_s = 0;
    config.sample_every = 0;
    config.burst = 10;
    config.health_every = 2;
    aeo_channel_t own[CHANNELS];
    memset(own, 0, sizeof own);
    for (unsigned i = 0; i < CHANNELS; i++) {
        own[i].scale = AEO_REAL(1);
    }
    config.channels = own; /* 7 + 2 * 5 frames without texts */
    TEST_ASSERT_EQUAL_UINT32(17, aeo_budget_count_description(&config));
    config.describe_every = 2;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &config, &port, words, N));
    config.health_every = 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_BUDGET, aeo_stream_init(&stream, &config, &port, words, N));
}

/* Texts too long to be sent whole count as what is sent of them. */
static void a_description_is_counted_as_it_is_sent(void)
{
    static const char text[] = "a name of more than thirty-two characters";
    aeo_channel_t own[CHANNELS];
    aeo_stream_config_t config = make_config();
    memcpy(own, channels, sizeof own);
    for (unsigned length = 0; length < sizeof text; length++) {
        own[0].name = own[0].unit = own[CHANNELS - 1].unit = text + (sizeof text - 1u - length);
        config.channels = own;
        set_up_bus();
        start_stream(&config);
        describe_first();
        TEST_ASSERT_EQUAL_UINT32(stream.counters.sent, aeo_budget_count_description(&config));
    }
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

/* Health that is always due leaves a snapshot every second frame. */
static void health_never_has_two_turns_running(void)
{
    aeo_stream_config_t config = make_config();
    config.burst = 1;
    config.sample_every = 0;
    start_stream(&config);
    describe_first();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 0, theta));
    for (unsigned k = 0; k < 100u; k++) {
        stream.health_in = 0;
        fake.kept = 0;
        TEST_ASSERT_EQUAL_INT(1, aeo_stream_step(&stream));
        TEST_ASSERT_EQUAL_INT(k % 2u == 0u, is_health(0));
    }
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
    RUN_TEST(steps_are_those_of_the_formula);
    RUN_TEST(steps_of_any_channels_are_those_of_the_formula);
    RUN_TEST(a_step_that_fits_the_cap_is_not_cut);
    RUN_TEST(times_of_frames_are_rounded_up);
    RUN_TEST(periods_are_rounded_to_whole_microseconds);
    RUN_TEST(nine_tenths_of_the_frames_are_allowed);
    RUN_TEST(a_description_is_counted_as_it_is_sent);
    RUN_TEST(a_period_that_does_not_fit_is_refused);
    RUN_TEST(health_has_its_turn_and_no_more);
    RUN_TEST(health_never_has_two_turns_running);
    RUN_TEST(after_the_farewell_there_is_silence);
    return UNITY_END();
}
