/* The laws of the excitation: amplitude, rate, limits, start and stop, in every form, alone and through the wrapper. */
#include "demands.h"
#include "excitation.h"
#include "simulator.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unity.h"

#define STEP 0.01

static const uint8_t all_allowed[EXCITATION_BLADES] = {1, 1, 1};
static const excitation_settings_t base = {.signal = SIGNAL_PRBS,
                                           .form = FORM_COLLECTIVE,
                                           .amplitude = 0.02,
                                           .rate = 0.05,
                                           .start_s = 3.0,
                                           .stop_s = 43.0,
                                           .minimum = 0.0,
                                           .maximum = 0.4,
                                           .hold_s = 0.7,
                                           .order = 7,
                                           .low_hz = 0.05,
                                           .high_hz = 1.5,
                                           .lines = 12,
                                           .seed = 3};

void setUp(void)
{
}

void tearDown(void)
{
}

/* ---- the signals ------------------------------------------------------------------------------------------------- */

/* Every register passes through all its states: 2^n - 1 bits, one more of ones than of zeros, and the autocorrelation
 * of a maximum-length sequence, -1 at every shift. */
static void test_registers_are_of_maximum_length(void)
{
    static excitation_t e;
    for (unsigned order = EXCITATION_ORDER_MIN; order <= EXCITATION_ORDER_MAX; order++) {
        excitation_settings_t settings = base;
        static int8_t bit[1u << EXCITATION_ORDER_MAX];
        uint32_t period;
        int32_t sum = 0;
        settings.order = order;
        settings.seed = 12345;
        excitation_init(&e, &settings);
        period = e.period;
        TEST_ASSERT_EQUAL_UINT32((1u << order) - 1u, period);
        for (uint32_t i = 0; i < period; i++) {
            bit[i] = ((unsigned)e.bits[i / 8u] >> (i % 8u) & 1u) != 0u ? 1 : -1;
            sum += bit[i];
        }
        TEST_ASSERT_EQUAL_INT32(1, abs(sum));
        for (uint32_t shift = 1; shift < period; shift += 1u + period / 50u) {
            int32_t product = 0;
            for (uint32_t i = 0; i < period; i++) {
                product += bit[i] * bit[(i + shift) % period];
            }
            TEST_ASSERT_EQUAL_INT32(-1, product);
        }
    }
}

/* Run one setting; check the laws at every call; returns the largest value seen. */
static double check_laws(const excitation_settings_t *settings, unsigned blades, double from_s, double to_s)
{
    static excitation_t e;
    double before[EXCITATION_BLADES] = {0, 0, 0}, largest = 0;
    const double rest = settings->stop_s + settings->amplitude / settings->rate + STEP;
    excitation_init(&e, settings);
    for (double t = from_s; t < to_s; t += STEP) {
        for (int again = 0; again < 2; again++) { /* a repeated call moves nothing */
            excitation_advance(&e, t, 1.3 * t, blades, all_allowed);
            for (unsigned b = 0; b < EXCITATION_BLADES; b++) {
                const double size = fabs(e.value[b]), change = fabs(e.value[b] - before[b]);
                TEST_ASSERT_TRUE(size <= settings->amplitude * (1 + 1e-12));
                TEST_ASSERT_TRUE(change <= (again ? 0.0 : settings->rate * STEP * (1 + 1e-9)));
                TEST_ASSERT_TRUE((t >= settings->start_s && t <= rest) || !(size > 0));
                before[b] = e.value[b];
                largest = size > largest ? size : largest;
            }
        }
        TEST_ASSERT_TRUE(excitation_over(&e, t) == (t >= settings->stop_s && !(fabs(before[0]) > 0) &&
                                                    !(fabs(before[1]) > 0) && !(fabs(before[2]) > 0)));
    }
    return largest;
}

static void test_amplitude_rate_start_and_stop(void)
{
    for (unsigned signal = SIGNAL_PRBS; signal <= SIGNAL_MULTISINE; signal++) {
        for (unsigned form = FORM_COLLECTIVE; form <= FORM_YAW; form++) {
            for (unsigned k = 0; k < 4u; k++) { /* fast and slow against the amplitude; stopped within a bit */
                excitation_settings_t settings = base;
                settings.signal = (excitation_signal_t)signal;
                settings.form = (excitation_form_t)form;
                settings.rate = k % 2u == 0u ? 0.05 : 10.0;
                settings.stop_s = k < 2u ? 43.0 : 3.35;
                settings.seed = k;
                TEST_ASSERT_TRUE(check_laws(&settings, 2u + k % 2u, 0.0, 50.0) > 0);
            }
        }
    }
}

/* With time to get there the signals reach their amplitude: no law is kept by doing nothing. */
static void test_the_amplitude_is_reached(void)
{
    excitation_settings_t settings = base;
    settings.rate = 10.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02, check_laws(&settings, 3, 0.0, 50.0));
    settings.signal = SIGNAL_MULTISINE;
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.02, check_laws(&settings, 3, 0.0, 50.0));
}

/* Joining in mid-run the signal still leaves from zero at its rate. */
static void test_a_late_first_call_starts_from_zero(void)
{
    TEST_ASSERT_TRUE(check_laws(&base, 3, 20.0, 50.0) > 0);
}

/* Tilt and yaw are the multiblade transformation: transformed back they give the signal, and no collective part. */
static void test_multiblade_forms(void)
{
    static excitation_t e, plain;
    excitation_settings_t settings = base;
    settings.rate = 1e6;
    excitation_init(&plain, &settings);
    for (unsigned form = FORM_TILT; form <= FORM_YAW; form++) {
        settings.form = (excitation_form_t)form;
        excitation_init(&e, &settings);
        excitation_init(&plain, &base);
        plain.settings.rate = 1e6;
        for (double t = 0; t < 40.0; t += STEP) {
            double tilt = 0, yaw = 0, mean = 0;
            const double azimuth = 1.3 * t;
            excitation_advance(&e, t, azimuth, 3, all_allowed);
            excitation_advance(&plain, t, azimuth, 3, all_allowed);
            for (unsigned b = 0; b < 3u; b++) {
                const double psi = azimuth + 2.0943951023931953 * b;
                tilt += 2.0 / 3.0 * e.value[b] * cos(psi);
                yaw += 2.0 / 3.0 * e.value[b] * sin(psi);
                mean += e.value[b] / 3.0;
            }
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, form == FORM_TILT ? plain.value[0] : 0.0, tilt);
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, form == FORM_YAW ? plain.value[0] : 0.0, yaw);
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, mean);
        }
    }
}

/* ---- the limits of the sum --------------------------------------------------------------------------------------- */

static float next_random(void)
{
    static uint32_t state = 7;
    state = state * 1664525u + 1013904223u;
    return (float)(state >> 8) / 16777216.0F;
}

/* Random demands and values: the sum stays within the limits, or between them and a demand beyond them. */
static void test_the_sum_never_leaves_its_limits(void)
{
    static excitation_t e;
    static const double limits[][2] = {{0.0, 0.4}, {-0.1, 0.1}, {0.1 + 1e-9, 0.3 - 1e-9}, {1.0 / 3.0, 2.0 / 3.0}};
    excitation_settings_t settings = base;
    for (unsigned k = 0; k < 200000u; k++) {
        const float command = next_random() * 1.2F - 0.4F;
        float total;
        settings.minimum = limits[k % 4u][0];
        settings.maximum = limits[k % 4u][1];
        e.settings = settings;
        e.value[1] = (double)((next_random() - 0.5F) * 0.2F);
        total = excitation_apply(&e, 1, command);
        TEST_ASSERT_TRUE((double)total >= fmin(settings.minimum, (double)command));
        TEST_ASSERT_TRUE((double)total <= fmax(settings.maximum, (double)command));
        TEST_ASSERT_TRUE(fabs((double)total - (double)command) <= fabs(e.value[1]) + 1e-7);
    }
}

/* What is not a number, and everything where nothing is to be added, passes with its bits. */
static void test_demands_that_are_no_numbers_pass(void)
{
    static excitation_t e;
    static const uint32_t odd[] = {0x7FC12345u, 0xFF800001u, 0x7F800000u, 0xFF800000u, 0x80000000u, 1u};
    excitation_init(&e, &base);
    for (unsigned i = 0; i < 6u; i++) {
        float command, total;
        memcpy(&command, &odd[i], sizeof command);
        e.value[0] = i < 4u ? 0.02 : 0.0;
        total = excitation_apply(&e, 0, command);
        TEST_ASSERT_EQUAL_MEMORY(&odd[i], &total, sizeof total);
    }
}

/* ---- in the array ------------------------------------------------------------------------------------------------ */

typedef struct {
    float swap[RECORDS_LEAST];
    demands_t demands;
    double time_s;
} loop_t;

static void start(loop_t *self, const excitation_settings_t *pitch, const excitation_settings_t *torque, float mode)
{
    static settings_t settings;
    memset(self, 0, sizeof *self);
    memset(&settings, 0, sizeof settings);
    settings.pitch = *pitch;
    settings.torque = *torque;
    demands_init(&self->demands, &settings);
    self->swap[RECORD_PITCH_MODE - 1] = mode;
    self->swap[RECORD_BLADES - 1] = 3.0F;
}

static const excitation_settings_t off = {.signal = SIGNAL_OFF};

/* A controller that goes on from its own last demand does so as if nothing had been added, unless the simulator has
 * written a demand of its own. */
static void test_the_controller_gets_its_own_demand_back(void)
{
    static loop_t loop;
    float own = 0.1F;
    unsigned added = 0;
    start(&loop, &base, &off, 0.0F);
    loop.swap[RECORD_COMMAND - 1] = own;
    for (unsigned k = 0; k < 5000u; k++) {
        demands_restore(&loop.demands, loop.swap);
        TEST_ASSERT_EQUAL_MEMORY(&own, &loop.swap[RECORD_COMMAND - 1], sizeof own);
        own += 1e-5F;
        loop.swap[RECORD_COMMAND - 1] = own;
        demands_excite(&loop.demands, loop.swap, loop.time_s);
        added += loop.swap[RECORD_COMMAND - 1] < own || loop.swap[RECORD_COMMAND - 1] > own;
        TEST_ASSERT_FLOAT_WITHIN(1e-7F, loop.swap[RECORD_COMMAND - 1] - own, loop.demands.added[0]);
        loop.time_s += STEP;
    }
    TEST_ASSERT_TRUE(added > 3000u);
    start(&loop, &base, &off, 0.0F);
    loop.demands.pitch.value[0] = loop.demands.pitch.value[1] = loop.demands.pitch.value[2] = 0.01;
    loop.swap[RECORD_COMMAND - 1] = 0.1F;
    demands_excite(&loop.demands, loop.swap, 10.0);
    loop.swap[RECORD_COMMAND - 1] = 0.25F;
    demands_restore(&loop.demands, loop.swap);
    TEST_ASSERT_TRUE(loop.swap[RECORD_COMMAND - 1] >= 0.25F && loop.swap[RECORD_COMMAND - 1] <= 0.25F);
}

/* Record 28 chooses the records; the others keep their bits. */
static void test_the_right_records_are_excited(void)
{
    static loop_t loop;
    excitation_settings_t individual = base, torque = base;
    individual.form = FORM_INDIVIDUAL;
    torque.amplitude = 500.0;
    torque.rate = 1e4;
    torque.maximum = 6e4;
    for (int mode = 0; mode < 2; mode++) {
        unsigned changed[RECORDS_LEAST + 1] = {0};
        start(&loop, mode == 1 ? &individual : &base, &torque, (float)mode);
        for (unsigned k = 0; k < 1000u; k++) {
            float before[RECORDS_LEAST];
            for (unsigned i = 41; i < 45u; i++) {
                loop.swap[i] = 0.2F;
            }
            loop.swap[RECORD_TORQUE_COMMAND - 1] = 4e4F;
            memcpy(before, loop.swap, sizeof before);
            demands_excite(&loop.demands, loop.swap, STEP * k);
            for (unsigned i = 0; i < RECORDS_LEAST; i++) {
                changed[i + 1u] += memcmp(&before[i], &loop.swap[i], sizeof *before) != 0;
            }
        }
        for (unsigned i = 1; i <= RECORDS_LEAST; i++) {
            const int chosen = i == 47u || (mode == 0 ? i == 45u : i >= 42u && i <= 44u);
            TEST_ASSERT_TRUE(chosen ? changed[i] > 500u : changed[i] == 0u);
        }
        TEST_ASSERT_TRUE(mode == 0 || fabsf(loop.demands.added[0] - loop.demands.added[1]) > 1e-4F ||
                         fabsf(loop.demands.added[0] - loop.demands.added[2]) > 1e-4F);
    }
}

/* A shutdown: the demand runs beyond the limits. The excitation goes to zero at its rate and the controller's own
 * demand is then what the simulator gets. */
static void test_a_demand_beyond_the_limits_ends_the_excitation(void)
{
    static loop_t loop;
    float before = 0;
    start(&loop, &base, &off, 0.0F);
    for (unsigned k = 0; k < 2000u; k++) {
        const float command = k < 1000u ? 0.35F : 0.35F + 0.001F * (float)(k - 1000u);
        loop.swap[RECORD_COMMAND - 1] = command;
        demands_excite(&loop.demands, loop.swap, STEP * k);
        if (command > 0.4F) {
            TEST_ASSERT_TRUE(loop.swap[RECORD_COMMAND - 1] <= command);
            TEST_ASSERT_TRUE(fabs(loop.demands.pitch.value[0]) <= (double)before + 1e-9);
        } else {
            TEST_ASSERT_TRUE(loop.swap[RECORD_COMMAND - 1] >= 0.0F && loop.swap[RECORD_COMMAND - 1] <= 0.4F);
        }
        before = (float)fabs(loop.demands.pitch.value[0]);
        TEST_ASSERT_TRUE(k < 1100u || loop.swap[RECORD_COMMAND - 1] >= command);
    }
}

static void test_what_cannot_be_is_said_and_not_done(void)
{
    static loop_t loop;
    excitation_settings_t tilt = base;
    tilt.form = FORM_TILT;
    start(&loop, &tilt, &off, 0.0F);
    TEST_ASSERT_NOT_NULL(demands_impossible(&loop.demands, loop.swap));
    loop.swap[RECORD_COMMAND - 1] = 0.2F;
    for (unsigned k = 0; k < 1000u; k++) {
        demands_excite(&loop.demands, loop.swap, STEP * k);
        TEST_ASSERT_TRUE(loop.swap[RECORD_COMMAND - 1] >= 0.2F && loop.swap[RECORD_COMMAND - 1] <= 0.2F);
    }
    loop.swap[RECORD_PITCH_MODE - 1] = 1.0F;
    TEST_ASSERT_NULL(demands_impossible(&loop.demands, loop.swap));
    loop.swap[RECORD_PITCH_ACTUATOR - 1] = 1.0F;
    TEST_ASSERT_NOT_NULL(demands_impossible(&loop.demands, loop.swap));
}

/* ---- through the wrapper ----------------------------------------------------------------------------------------- */

/* A controller that always asks for 0.1: outside the excitation's time that is what the simulator gets; within it the
 * demand differs, stays in its limits and moves by the rate at most. With limits that leave 0.1 out nothing is added.
 * */
static unsigned excite_through_the_wrapper(const char *limits, float low, float high)
{
    simulator_t wrapped;
    char text[2048];
    float before = 0.1F;
    unsigned excited = 0;
    (void)snprintf(text, sizeof text,
                   "controller = %s\ninput = pitch_command scale 0.05\noutput = generator_speed offset 122 scale 5\n"
                   "past = 4\nbus = none\n[pitch excitation]\nsignal = prbs\namplitude = 0.03\nrate = 0.1\nstart = 2\n"
                   "stop = 12\nhold = 0.5\n%s",
                   CONTROLLER_BRIEF, limits);
    TEST_ASSERT_TRUE(write_text(in_scratch("settings.cfg"), text));
    (void)setenv("AEOLID_DISCON", in_scratch("settings.cfg"), 1);
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, SIMULATOR_RECORDS, ""));
    for (unsigned k = 0; k < 1500u; k++) {
        float total;
        TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, k == 0u ? 0.0F : 1.0F));
        total = wrapped.swap[RECORD_COMMAND - 1];
        if (wrapped.time_s < 2.0 - 1e-6 || wrapped.time_s > 12.0 + 0.3 + 0.02) {
            TEST_ASSERT_TRUE(total >= 0.1F && total <= 0.1F);
        }
        TEST_ASSERT_TRUE(total >= low && total <= high);
        TEST_ASSERT_TRUE(fabsf(total - before) <= 0.001F + 1e-6F);
        excited += total > 0.1F || total < 0.1F;
        before = total;
        simulator_step(&wrapped);
    }
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, -1.0F));
    simulator_close(&wrapped);
    return excited;
}

static void test_through_the_wrapper(void)
{
    TEST_ASSERT_TRUE(excite_through_the_wrapper("minimum = 0\nmaximum = 1\n", 0.07F, 0.13F) > 900u);
    TEST_ASSERT_TRUE(excite_through_the_wrapper("minimum = 0.09\nmaximum = 0.115\n", 0.09F, 0.115F) > 900u);
    TEST_ASSERT_EQUAL_UINT(0, excite_through_the_wrapper("minimum = 0.14\nmaximum = 0.16\n", 0.1F, 0.1F));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_registers_are_of_maximum_length);
    RUN_TEST(test_amplitude_rate_start_and_stop);
    RUN_TEST(test_the_amplitude_is_reached);
    RUN_TEST(test_a_late_first_call_starts_from_zero);
    RUN_TEST(test_multiblade_forms);
    RUN_TEST(test_the_sum_never_leaves_its_limits);
    RUN_TEST(test_demands_that_are_no_numbers_pass);
    RUN_TEST(test_the_controller_gets_its_own_demand_back);
    RUN_TEST(test_the_right_records_are_excited);
    RUN_TEST(test_a_demand_beyond_the_limits_ends_the_excitation);
    RUN_TEST(test_what_cannot_be_is_said_and_not_done);
    RUN_TEST(test_through_the_wrapper);
    return UNITY_END();
}
/* SPDX-License-Identifier: MIT */
