/* Channels that a filter hardly sees are named with what would fit, once; first and last call say what is done. */
#include "scale_watch.h"

#include "simulator.h"

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "unity.h"

static settings_t settings;
static scale_watch_t watch;
static char text[SCALE_WATCH_TEXT_MAX];

void setUp(void)
{
    (void)unsetenv("AEOLID_DISCON");
}

void tearDown(void)
{
}

#define FILE_OF(lines)                                                                                                 \
    "controller = c.so\ninput = torque_command offset 4e4 scale 2e3\noutput = generator_speed offset 122 scale 5\n"    \
    "past = 20\nbus = none\n" lines

static void begin(const char *lines, double sample_time_s)
{
    char why[SETTINGS_WHY_MAX] = "";
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, settings_parse(&settings, "/t.cfg", lines, strlen(lines), why), why);
    scale_watch_init(&watch, &settings, sample_time_s);
}

/* One sample of two channels: a mean and a deviation each, drawn in turn from both sides. */
static int take(unsigned k, float torque, float torque_deviation, float speed, float speed_deviation)
{
    const float value[2] = {torque + (k % 2u == 0u ? torque_deviation : -torque_deviation),
                            speed + (k % 4u < 2u ? speed_deviation : -speed_deviation)};
    return scale_watch_take(&watch, value, 0.1 * k);
}

static void run(unsigned from, unsigned to, float torque, float torque_deviation, float speed, float speed_deviation)
{
    for (unsigned k = from; k < to; k++) {
        if (take(k, torque, torque_deviation, speed, speed_deviation) && k + 1u < to) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, scale_watch_judge(&watch, 0, 0, text), text);
            scale_watch_next(&watch);
        }
    }
}

static void test_a_direct_drive_speed_is_told_with_what_fits(void)
{
    begin(FILE_OF(""), 0.1);
    run(0, 600, 4e4F, 2e3F, 0.79F, 0.011F);
    TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 1, 0, text)); /* the start of a simulation is left aside */
    scale_watch_next(&watch);
    run(600, 1200, 4e4F, 2e3F, 0.79F, 0.011F);
    TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 0, 0, text));
    TEST_ASSERT_EQUAL_INT(1, scale_watch_judge(&watch, 1, 0, text));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "generator_speed: its mean lies -24.2 scales"), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "deviation is 0.0022 scales"), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "`offset 0.79 scale 0.011` would fit"), text);
    TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 1, 0, text)); /* once */
    TEST_ASSERT_EQUAL_UINT(1, watch.told_channels);
}

/* What is told fits, for means far beyond their deviations too, and is written with a point in every locale. */
static void test_what_is_told_can_be_pasted(void)
{
    static const float means[] = {0.0F, 0.79F, -3.0F, 4e6F}, deviations[] = {1e-3F, 0.5F, 1e3F};
    const char *locale = setlocale(LC_NUMERIC, "de_DE.UTF-8");
    for (unsigned i = 0; i < 12u; i++) {
        const float mean = means[i / 3u],
                    deviation = deviations[i % 3u] < mean / 1e6F ? mean / 1e6F : deviations[i % 3u];
        char again[1024], pasted[64];
        const char *found;
        begin(FILE_OF("output = tower_fore_aft offset 1e6 scale 0.01\n"), 0.1);
        for (unsigned k = 0; k < 600u; k++) {
            const float value[3] = {4e4F + (float)k, 122.0F + (float)(k % 9u),
                                    mean + (k % 2u == 0u ? deviation : -deviation)};
            (void)scale_watch_take(&watch, value, 0.1 * k);
        }
        TEST_ASSERT_EQUAL_INT(1, scale_watch_judge(&watch, 2, 1, text));
        found = strstr(text, "`offset ");
        TEST_ASSERT_NOT_NULL(found);
        (void)snprintf(pasted, sizeof pasted, "%.*s", (int)strcspn(found + 1, "`"), found + 1);
        TEST_ASSERT_NULL_MESSAGE(strchr(pasted, ','), locale != NULL ? locale : "C");
        (void)snprintf(again, sizeof again, FILE_OF("output = tower_fore_aft %s\n"), pasted);
        begin(again, 0.1);
        TEST_ASSERT_TRUE_MESSAGE(fabsf(settings.tap[2].offset - mean) <= 0.2F * deviation, text);
        TEST_ASSERT_TRUE_MESSAGE(fabsf(settings.tap[2].scale - deviation) <= 0.1F * deviation, text);
    }
    (void)setlocale(LC_NUMERIC, "C");
}

static void test_good_scales_are_passed_over(void)
{
    static const float factors[] = {0.04F, 0.3F, 1.0F, 5.0F, 25.0F};
    for (unsigned i = 0; i < 5u; i++) {
        begin(FILE_OF(""), 0.1);
        run(0, 600, 4e4F + 2e3F * 9.0F, 2e3F * factors[i], 122.0F - 5.0F * 9.0F, 5.0F * factors[i]);
        TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 0, 1, text));
        TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 1, 1, text));
    }
}

/* The bounds that scale_watch.h gives: a factor of 30 for the deviation, 10 scales for the mean. */
static void test_poor_scales_are_told_from_their_bounds_on(void)
{
    static const float deviations[] = {1.05F / 30.0F, 0.95F / 30.0F, 0.95F * 30.0F, 1.05F * 30.0F, 1.0F, 1.0F};
    static const float means[] = {0.0F, 0.0F, 0.0F, 0.0F, 9.9F, -10.1F};
    static const char *const words[] = {NULL, "hardly sees", NULL, "drowns the others", NULL, "end of the range"};
    for (unsigned i = 0; i < 6u; i++) {
        begin(FILE_OF(""), 0.1);
        run(0, 600, 4e4F, 2e3F, 122.0F + 5.0F * means[i], 5.0F * deviations[i]);
        TEST_ASSERT_EQUAL_INT(words[i] != NULL, scale_watch_judge(&watch, 1, 1, text));
        TEST_ASSERT_TRUE_MESSAGE(words[i] == NULL || strstr(text, words[i]) != NULL, text);
    }
}

static void test_a_constant_channel_is_told_after_the_first_minute(void)
{
    begin(FILE_OF(""), 0.1);
    for (unsigned k = 0; k < 599u; k++) {
        TEST_ASSERT_EQUAL_INT(0, take(k, 43093.0F, 0.0F, 122.0F, 1.0F));
    }
    TEST_ASSERT_EQUAL_INT(1, take(599, 43093.0F, 0.0F, 122.0F, 1.0F));
    TEST_ASSERT_EQUAL_INT(1, scale_watch_judge(&watch, 0, 0, text));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "torque_command: constant at 43093 N m for 60 s"), text);
    TEST_ASSERT_NOT_NULL(strstr(text, "`input` line"));
    TEST_ASSERT_NOT_NULL(strstr(text, "role ignore"));
    begin(FILE_OF(""), 0.1); /* a single bit is no constant */
    run(0, 600, 43093.0F, 0.004F, 122.0F, 1.0F);
    TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 0, 0, text));
    TEST_ASSERT_EQUAL_INT(1, scale_watch_judge(&watch, 0, 1, text));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "hardly sees"), text);
}

static void test_a_channel_without_numbers_is_told(void)
{
    begin(FILE_OF(""), 0.1);
    for (unsigned k = 0; k < 600u; k++) {
        (void)take(k, 4e4F, 2e3F, NAN, 0.0F);
    }
    TEST_ASSERT_EQUAL_INT(1, scale_watch_judge(&watch, 1, 0, text));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "generator_speed: no finite value for 60 s"), text);
}

/* What excitation is to move is not called constant before it begins or after it has ended. */
static void test_nothing_is_judged_without_the_excitation(void)
{
    begin(FILE_OF("[torque excitation]\nsignal = prbs\namplitude = 9\nrate = 9\nstart = 300\nstop = 400\nminimum = 0\n"
                  "maximum = 1e5\n"),
          0.1);
    for (unsigned k = 0; k < 3000u; k++) {
        TEST_ASSERT_EQUAL_INT(0, take(k, 4e4F, 0.0F, 122.0F, 1.0F));
    }
    TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 0, 1, text));
    for (unsigned k = 3000; k < 6000u; k++) {
        if (take(k, 4e4F, k <= 4000u ? 2e3F : 0.0F, 122.0F, 1.0F)) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, scale_watch_judge(&watch, 0, 0, text), text);
            scale_watch_next(&watch);
        }
    }
    TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 0, 1, text));
}

/* A run of one minute and a sample is judged by that minute; one of a few samples is not. */
static void test_a_short_run_is_judged_at_its_end(void)
{
    begin(FILE_OF(""), 0.1);
    run(0, 601, 4e4F, 2e3F, 0.79F, 0.011F);
    TEST_ASSERT_EQUAL_INT(1, scale_watch_judge(&watch, 1, 1, text));
    begin(FILE_OF(""), 0.1);
    run(0, 19, 4e4F, 0.0F, 0.79F, 0.011F);
    TEST_ASSERT_EQUAL_INT(0, scale_watch_judge(&watch, 0, 1, text));
    run(19, 20, 4e4F, 0.0F, 0.79F, 0.011F);
    TEST_ASSERT_EQUAL_INT(1, scale_watch_judge(&watch, 0, 1, text));
}

/* ---- in the wrapper ---------------------------------------------------------------------------------------------- */

/* Run a turbine for so long with a standard stream in a file; returns what stood there. */
static const char *say(int stream, const char *more, double until_s)
{
    static char said[8192];
    const char *path = in_scratch("said.txt");
    FILE *into = fopen(path, "wb+");
    const int before = dup(stream);
    simulator_t wrapped;
    size_t length;
    TEST_ASSERT_NOT_NULL(into);
    (void)fflush(NULL);
    TEST_ASSERT_TRUE(dup2(fileno(into), stream) >= 0);
    TEST_ASSERT_TRUE(configure(CONTROLLER, more));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, SIMULATOR_RECORDS, "quiet"));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, until_s, 1));
    simulator_close(&wrapped);
    (void)fflush(NULL);
    TEST_ASSERT_TRUE(dup2(before, stream) >= 0);
    (void)close(before);
    rewind(into);
    length = fread(said, 1, sizeof said - 1u, into);
    said[length] = '\0';
    (void)fclose(into);
    return said;
}

static unsigned count_lines(const char *said)
{
    unsigned lines = 0;
    for (; *said != '\0'; said++) {
        lines += *said == '\n';
    }
    return lines;
}

static void test_the_first_and_the_last_call_say_a_line_each(void)
{
    const char *said = say(STDOUT_FILENO, "bus = file:said.log\nscheduling = wind\n", 30.0);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(2, count_lines(said), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "turbine 1: input pitch_command; output generator_speed, tower_fore_aft; "
                                              "scheduling wind; 10 samples a second; filter rls, past 8, 2 x 24 "
                                              "parameters; frames to "),
                                 said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "/said.log\n"), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, ": end: 301 samples filtered, 0 refused (0 beyond min or max); "), said);
    TEST_ASSERT_NULL_MESSAGE(strstr(said, "to look at"), said);
    said = say(STDOUT_FILENO, "bus = none\noutput = rotor_speed offset 122 scale 0.5\n", 30.0);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said,
                                        ": end: 0 samples filtered, 301 refused (301 beyond min or max, where not "
                                        "given offset - 100 scale and offset + 100 scale); "),
                                 said);
    said = say(STDOUT_FILENO, "bus = tcp:0\n", 1.0);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "aeolid listen --bus slcan:socket://127.0.0.1:"), said);
}

static void test_a_poor_scale_is_told_on_standard_error_once(void)
{
    const char *lines = "bus = none\noutput = rotor_speed offset 122 scale 5\noutput = blade_root_out_1 scale 1e5\n";
    const char *said = say(STDERR_FILENO, lines, 200.0);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(2, count_lines(said), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "turbine 1: rotor_speed: its mean lies -24"), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "turbine 1: blade_root_out_1: constant at 0 N m for 60 s"), said);
    TEST_ASSERT_NOT_NULL(strstr(say(STDOUT_FILENO, lines, 200.0), "; 2 channels to look at, see standard error\n"));
    said = say(STDERR_FILENO, "bus = none\n", 200.0);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, count_lines(said), said);
}

/* What the filter refuses is told by the setting that it refuses, and the controller goes on. */
static void test_a_refused_filter_is_told_with_its_cause(void)
{
    const char *said = say(STDERR_FILENO, "bus = none\npast = 30\nmethod = fast-rls\nforget = 0.6\n", 1.0);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, count_lines(said), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "turbine 1: filter: forget = 0.6: a memory of 2.5 samples is shorter"),
                                 said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "fast-rls needs for 90 regressors"), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "or take rls or lattice; nothing is filtered or streamed"), said);
    said = say(STDERR_FILENO, "bus = none\npast = 342\n", 1.0);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "filter: past = 342: with 1 inputs and 2 outputs it must be 1 ... 341;"),
                                 said);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_direct_drive_speed_is_told_with_what_fits);
    RUN_TEST(test_what_is_told_can_be_pasted);
    RUN_TEST(test_good_scales_are_passed_over);
    RUN_TEST(test_poor_scales_are_told_from_their_bounds_on);
    RUN_TEST(test_a_constant_channel_is_told_after_the_first_minute);
    RUN_TEST(test_a_channel_without_numbers_is_told);
    RUN_TEST(test_nothing_is_judged_without_the_excitation);
    RUN_TEST(test_a_short_run_is_judged_at_its_end);
    RUN_TEST(test_the_first_and_the_last_call_say_a_line_each);
    RUN_TEST(test_a_poor_scale_is_told_on_standard_error_once);
    RUN_TEST(test_a_refused_filter_is_told_with_its_cause);
    return UNITY_END();
}
/* SPDX-License-Identifier: MIT */
