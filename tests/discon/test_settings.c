/* Settings files, good and hostile: what is understood, and that everything else is one sentence that says where. */
#include "settings.h"

#include "simulator.h"

#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unity.h"

static settings_t settings;
static char why[SETTINGS_WHY_MAX];

void setUp(void)
{
}

void tearDown(void)
{
}

#define GOOD                                                                                                           \
    "controller = libdiscon.so\ninput = pitch_command offset 0.15 scale 0.05\noutput = generator_speed scale 5\n"      \
    "past = 20\nbus = tcp:29536\n"
#define PITCH                                                                                                          \
    "[pitch excitation]\nsignal = prbs\namplitude = 0.01\nrate = 0.1\nstart = 1\nstop = 2\nminimum = 0\nmaximum = 1\n"

static int parse(const char *text)
{
    why[0] = '\0';
    return settings_parse(&settings, "/etc/aeolid/t.cfg", text, strlen(text), why);
}

static void test_a_full_file_is_understood(void)
{
    const tap_t *tap = settings.tap;
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        0,
        parse("\xEF\xBB\xBF# comment\r\n  controller=/opt/my controller.so ; the real one\r\nsymbol = MAIN\n"
              "output = generator_speed offset -1e2 scale 5 # rad/s\ninput = torque_command scale 2e3 max 5e4 min -1\n"
              "scheduling = wind\noutput = record:83 name nod unit rad/s^2 scale 0.01\ninput = pitch_command scale 1\n"
              "method = lattice\nvarmax = yes\nforget = 0.999\nregularize = 1\nfeedthrough = pitch_command\n"
              "past = 7\ndecimation = 4\nbus = file:out/frames.log\nnode_id = 9\nshare = 12.5\nbit_rate = 250000\n"
              "snapshot_every = 3\nsample_every = 2\ninnovations = yes\nrepair = 0\nwait = 1.5\n"
              "[torque excitation]\nsignal = multisine\nlow = 0.1\nhigh = 2\nlines = 30\namplitude = 100\nrate = 1e3\n"
              "start = 0\nstop = 1e3\nminimum = 0\nmaximum = 5e4\nseed = 4294967295\n"),
        why);
    TEST_ASSERT_EQUAL_STRING("/opt/my controller.so", settings.controller);
    TEST_ASSERT_EQUAL_STRING("MAIN", settings.symbol);
    TEST_ASSERT_EQUAL_STRING("/etc/aeolid/out/frames.log", settings.bus_name);
    TEST_ASSERT_EQUAL_UINT(2, settings.taps[ROLE_INPUT]);
    TEST_ASSERT_EQUAL_UINT(2, settings.taps[ROLE_OUTPUT]);
    TEST_ASSERT_EQUAL_UINT(2, settings.taps[ROLE_SCHEDULING]); /* with the excitation, which is always sent */
    TEST_ASSERT_EQUAL_STRING("torque_command", tap[0].name);
    TEST_ASSERT_EQUAL_STRING("N m", tap[0].unit);
    TEST_ASSERT_EQUAL_FLOAT(5e4F, tap[0].maximum);
    TEST_ASSERT_EQUAL_STRING("pitch_command", tap[1].name);
    TEST_ASSERT_EQUAL_STRING("generator_speed", tap[2].name);
    TEST_ASSERT_EQUAL_FLOAT(-100.0F, tap[2].offset);
    TEST_ASSERT_EQUAL_STRING("nod", tap[3].name);
    TEST_ASSERT_EQUAL_UINT16(83, tap[3].record);
    TEST_ASSERT_EQUAL_STRING("wind", tap[4].name);
    TEST_ASSERT_EQUAL_STRING("excitation_torque", tap[5].name);
    TEST_ASSERT_EQUAL_HEX32(2, settings.feedthrough);
    TEST_ASSERT_EQUAL_INT(SIGNAL_MULTISINE, settings.torque.signal);
    TEST_ASSERT_EQUAL_UINT32(4294967295u, settings.torque.seed);
    TEST_ASSERT_EQUAL_INT(SIGNAL_OFF, settings.pitch.signal);
}

/* Without an input the filter is an autoregression of the outputs, and there is none whose feedthrough could be named. */
static void test_outputs_alone_are_enough(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("controller = a\nbus = none\npast = 3\noutput = tower_fore_aft scale 1\n"),
                                  why);
    TEST_ASSERT_EQUAL_UINT(0, settings.taps[ROLE_INPUT]);
    TEST_ASSERT_EQUAL_UINT(1, settings.taps[ROLE_OUTPUT]);
    TEST_ASSERT_EQUAL_INT(-1, parse("controller = a\nbus = none\npast = 3\noutput = tower_fore_aft scale 1\n"
                                    "feedthrough = tower_fore_aft\n"));
}

/* settings.h: offset -+ 100 scale where an end of the range is not given, none without a scale. */
static void test_the_range_that_is_not_given(void)
{
    static const struct {
        const char *line;
        float minimum, maximum;
    } cases[] = {
        {"output = wind offset 10 scale 0.5\n", -40.0F, 60.0F},
        {"output = wind scale 0.5\n", -50.0F, 50.0F},
        {"output = wind offset 10 scale 0.5 min 0\n", 0.0F, 60.0F},
        {"output = wind max 7 scale 1\n", -100.0F, 7.0F},
        {"output = wind max 7 scale 1 min -7\n", -7.0F, 7.0F},
        {"scheduling = wind\n", -3e38F, 3e38F},
        {"scheduling = wind min 5\n", 5.0F, 3e38F},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[512];
        (void)snprintf(text, sizeof text, GOOD "%s", cases[i].line);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse(text), why);
        TEST_ASSERT_EQUAL_FLOAT(cases[i].minimum, settings.tap[2].minimum);
        TEST_ASSERT_EQUAL_FLOAT(cases[i].maximum, settings.tap[2].maximum);
    }
}

static void test_the_example_is_understood(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, settings_read(&settings, EXAMPLE, why), why);
    TEST_ASSERT_EQUAL_INT(SIGNAL_PRBS, settings.pitch.signal);
    TEST_ASSERT_EQUAL_UINT(2, settings.taps[ROLE_INPUT]);
    TEST_ASSERT_EQUAL_UINT(3, settings.taps[ROLE_OUTPUT]);
}

static void test_every_name_of_the_table_is_a_channel(void)
{
    const named_record_t *entry;
    char text[512];
    for (size_t i = 0; (entry = records_at(i)) != NULL; i++) {
        (void)snprintf(text, sizeof text, GOOD "records = 200\nscheduling = %s name x\n", entry->name);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse(text), why);
    }
}

typedef struct {
    const char *text;
    const char *place; /* what the sentence must name */
    const char *words;
} bad_t;

static const bad_t bad[] = {
    {"", "t.cfg: controller", "missing"},
    {"controller = a\nbus = none\npast = 3\ninput = pitch scale 1\n", "t.cfg: output", "missing"},
    {"controller = a\nbus = none\ninput = pitch scale 1\noutput = wind scale 1\n", "t.cfg: past", "missing"},
    {"controller = a\npast = 3\ninput = pitch scale 1\noutput = wind scale 1\n", "t.cfg: bus", "missing"},
    {GOOD "past = 21\n", "line 6: past", "twice"},
    {GOOD "pasts = 21\n", "line 6: pasts", "no such key"},
    {GOOD "decimation = 2.5\n", "line 6: decimation = 2.5", "a whole number 1 ... 65535"},
    {GOOD "decimation = 0\n", "line 6: decimation = 0", "a whole number"},
    {GOOD "decimation = 10x\n", "line 6: decimation = 10x", "a whole number"},
    {GOOD "share = nan\n", "line 6: share = nan", "a number 0 ... 100"},
    {GOOD "share = inf\n", "line 6: share = inf", "a number"},
    {GOOD "share = 1,5\n", "line 6: share = 1,5", "a number"},
    {GOOD "share =\n", "line 6: share", "value is needed"},
    {GOOD "share\n", "line 6: share", "key = value"},
    {GOOD "= 5\n", "line 6", "key = value"},
    {GOOD "records = 63\n", "line 6: records", "64"},
    {GOOD "method = kalman\n", "line 6: method = kalman", "lattice"},
    {GOOD "varmax = maybe\n", "line 6: varmax", "yes or no"},
    {GOOD "feedthrough = wind\n", "line 6: feedthrough = wind", "inputs"},
    {GOOD "input = pitch_command scale 1\n", "line 6: input", "there already"},
    {GOOD "input = pitsch scale 1\n", "line 6: input = pitsch", "record:NUMBER"},
    {GOOD "input = record:0 name a unit b scale 1\n", "line 6: input", "1 ... 65535"},
    {GOOD "input = record:70\n", "line 6: input", "name NAME"},
    {GOOD "input = record:90 name a unit b scale 1\n", "t.cfg: a", "records = N"},
    {GOOD "input = thrust scale 1\n", "t.cfg: thrust", "records = N"},
    {GOOD "input = wind\n", "line 6: input = wind", "scale S"},
    {GOOD "input = wind scale 0\n", "line 6: scale = 0", "a number"},
    {GOOD "input = wind scale -1\n", "line 6: scale = -1", "a number"},
    {GOOD "input = wind scale\n", "line 6: input = scale", "a value"},
    {GOOD "input = wind scale 1 colour red\n", "line 6: colour", "scale, offset"},
    {GOOD "input = wind scale 1 min 5 max 5\n", "line 6: input = wind", "min is 5 and max 5"},
    {GOOD "output = wind scale 0.3 max -40\n", "line 6: output = wind",
     "min is -30 (not given: offset - 100 scale) and max -40"},
    {GOOD "output = wind offset 0 scale 0.5 min 100\n", "line 6: output = wind",
     "min is 100 and max 50 (not given: offset + 100 scale)"},
    {GOOD "output = wind offset 1e9 scale 1e-6\n", "line 6: output = wind", "min below max"},
    {GOOD "scheduling = wind min 5 max 5\n", "line 6: scheduling = wind", "min below max"},
    {GOOD "output = wind scale 0.3 scale 7\n", "line 6: scale = 7", "twice"},
    {GOOD "output = wind scale 1 offset 1 offset 1\n", "line 6: offset = 1", "twice"},
    {GOOD "output = wind scale 1 min 1 min 2\n", "line 6: min = 2", "twice"},
    {GOOD "output = wind max 9 scale 1 max 8\n", "line 6: max = 8", "twice"},
    {GOOD "output = wind name a scale 1 name b\n", "line 6: name = b", "twice"},
    {GOOD "output = wind unit a scale 1 unit b\n", "line 6: unit = b", "twice"},
    {GOOD "input = wind scale 1 name 123456789012345678901234567890123\n", "line 6: name", "characters"},
    {"bus = tcp\n", "line 1: bus = tcp", "tcp:PORT"},
    {"bus = tcp:65536\n", "line 1: bus", "65535"},
    {"bus = can:\n", "line 1: bus", "characters"},
    {"bus = can:0123456789abcdef\n", "line 1: bus", "characters"},
    {"bus = file:\n", "line 1: bus", "file:PATH"},
    {GOOD "[pitch]\n", "line 6: pitch", "[pitch excitation]"},
    {GOOD "[]\n", "line 6", "sections"},
    {GOOD "[pitch excitation\n", "line 6", "[name]"},
    {GOOD PITCH PITCH, "line 14: pitch excitation", "there already"},
    {GOOD "[pitch excitation]\n", "line 6: signal", "missing"},
    {GOOD "[pitch excitation]\nsignal = prbs\n", "line 6: amplitude", "missing"},
    {GOOD "[pitch excitation]\nsignal = prbs\namplitude = 1\nrate = 1\nstart = 1\nstop = 2\nminimum = 0\n",
     "line 6: maximum", "limits"},
    {GOOD
     "[pitch excitation]\nsignal = multisine\namplitude = 1\nrate = 1\nstart = 1\nstop = 2\nminimum = 0\nmaximum = 1\n",
     "line 6: low", "missing"},
    {GOOD PITCH "amplitude = 5\n", "line 14: amplitude", "twice"},
    {GOOD PITCH "order = 4\n", "line 14: order = 4", "5 ... 15"},
    {GOOD "[pitch excitation]\nsignal = prbs\namplitude = 1\nrate = 1\nstart = 2\nstop = 2\nminimum = 0\nmaximum = 1\n",
     "line 6: section", "start before stop"},
    {GOOD "[pitch excitation]\nsignal = prbs\namplitude = 1\nrate = 0\n", "line 9: rate", "a number"},
    {GOOD "[torque excitation]\nsignal = prbs\nform = tilt\n", "line 8: form", "only [pitch excitation]"},
    {GOOD "[pitch excitation]\npast = 3\n", "line 7: past", "no such key"},
    {GOOD "wait = \x01\x02\x7f\n", "line 6: wait = ???", "a number"},
};

static void test_every_mistake_is_named_with_its_place_and_remedy(void)
{
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(-1, parse(bad[i].text), bad[i].text);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, bad[i].place), why);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, bad[i].words), why);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "/etc/aeolid/t.cfg"), why);
    }
}

static void test_lines_of_every_length(void)
{
    static char text[4096];
    for (unsigned length = 1000; length<3000u; length += length> 1015u && length < 1030u ? 1u : 15u) {
        (void)snprintf(text, sizeof text, GOOD "# %0*d\n", (int)length - 2, 0);
        TEST_ASSERT_EQUAL_INT(length <= 1023u ? 0 : -1, parse(text));
        TEST_ASSERT_TRUE(length <= 1023u || strstr(why, "line 6: line: longer than 1023") != NULL);
    }
}

static void test_too_many_channels(void)
{
    char text[8192] = GOOD;
    for (unsigned i = 0; i < 40u; i++) {
        (void)snprintf(text + strlen(text), sizeof text - strlen(text), "scheduling = wind name w%u\n", i);
    }
    TEST_ASSERT_EQUAL_INT(-1, parse(text));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "at most 32"), why);
}

/* Numbers are written with a point whatever the simulator has set. */
static void test_a_locale_with_a_decimal_comma_changes_nothing(void)
{
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"};
    int there = 0;
    for (unsigned i = 0; i < 3u && !there; i++) {
        there = setlocale(LC_ALL, names[i]) != NULL;
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse(GOOD "share = 2.5\n"), why);
    TEST_ASSERT_EQUAL_DOUBLE(2.5, settings.share);
    (void)setlocale(LC_ALL, "C");
    if (!there) {
        TEST_IGNORE_MESSAGE("no locale with a decimal comma is installed");
    }
}

static void test_files_that_are_none(void)
{
    static char large[SETTINGS_TEXT_MAX + 2u];
    memset(large, '#', sizeof large - 1u);
    TEST_ASSERT_TRUE(write_text(in_scratch("large.cfg"), large));
    TEST_ASSERT_EQUAL_INT(-1, settings_read(&settings, in_scratch("large.cfg"), why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "32768"), why);
    TEST_ASSERT_EQUAL_INT(-1, settings_read(&settings, WRAPPER, why));
    TEST_ASSERT_EQUAL_INT(-1, settings_read(&settings, "/nowhere", why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "AEOLID_DISCON"), why);
    TEST_ASSERT_TRUE(write_text(in_scratch("empty.cfg"), ""));
    TEST_ASSERT_EQUAL_INT(-1, settings_read(&settings, in_scratch("empty.cfg"), why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "controller"), why);
}

/* ---- hostile text ------------------------------------------------------------------------------------------------ */

static uint32_t state = 2463534242u;

static uint32_t draw(uint32_t below)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state % below;
}

/* Whatever is accepted keeps its promises; whatever is not has one bounded sentence. */
static void check_promises(int result)
{
    TEST_ASSERT_TRUE(memchr(why, '\0', sizeof why) != NULL);
    if (result != 0) {
        TEST_ASSERT_EQUAL_INT(-1, result);
        TEST_ASSERT_TRUE(strlen(why) > 10u && strchr(why, '\n') == NULL);
        return;
    }
    TEST_ASSERT_TRUE(settings.taps[ROLE_OUTPUT] >= 1u);
    TEST_ASSERT_TRUE(settings_taps(&settings) <= SETTINGS_CHANNELS_MAX);
    TEST_ASSERT_TRUE(settings.decimation >= 1u && settings.past >= 1u && settings.records >= RECORDS_LEAST);
    for (unsigned i = 0; i < settings_taps(&settings); i++) {
        const tap_t *tap = &settings.tap[i];
        TEST_ASSERT_TRUE(tap->scale > 0 && tap->minimum < tap->maximum && tap->record <= settings.records);
        TEST_ASSERT_TRUE(memchr(tap->name, '\0', sizeof tap->name) != NULL);
    }
    TEST_ASSERT_TRUE(settings.pitch.signal == SIGNAL_OFF || settings.pitch.maximum > settings.pitch.minimum);
}

/* Change `length` characters of text (with room for `most`) in some places; returns the new length, at least 1. */
static size_t mutate(char *text, size_t length, size_t most)
{
    static const char letters[] = "=#;[]: \t\r\n0123456789.-+eExnaif\xFF\xEF";
    for (uint32_t i = draw(4); i < 4u; i++) {
        const uint32_t at = draw((uint32_t)length), span = 1u + draw(12);
        const size_t stop = at + span < length ? at + span : length;
        switch (draw(4)) {
        case 0: /* another letter, any byte among them */
            text[at] = draw(4) == 0u ? (char)draw(256) : letters[draw(sizeof letters - 1u)];
            break;
        case 1: /* cut out */
            memmove(text + at, text + stop, length - stop);
            length -= stop - at;
            break;
        case 2: /* cut short */
            length = draw(8) == 0u ? at : length;
            break;
        default: /* double a stretch */
            if (length + span < most && at + span < length) {
                memmove(text + at + span, text + at, length - at);
                length += span;
            }
            break;
        }
        length = length == 0u ? 1u : length;
    }
    return length;
}

static void test_mutated_files(void)
{
    static const char seed[] = GOOD "feedthrough = pitch_command\nscheduling = record:70 name a unit b\n" PITCH
                                    "[torque excitation]\nsignal = multisine\nlow = 0.1\nhigh = 1\namplitude = 1\n"
                                    "rate = 1\nstart = 0\nstop = 9\nminimum = 0\nmaximum = 1\n";
    unsigned accepted = 0;
    for (unsigned k = 0; k < 60000u; k++) {
        char text[2 * sizeof seed + 64];
        char *exact; /* of its very length, so that a read beyond it is seen */
        size_t length;
        int result;
        memcpy(text, seed, sizeof seed);
        length = mutate(text, sizeof seed - 1u, sizeof text);
        exact = malloc(length);
        memcpy(exact, text, length);
        why[0] = '\0';
        result = settings_parse(&settings, "t.cfg", exact, length, why);
        free(exact);
        accepted += result == 0;
        check_promises(result);
    }
    TEST_ASSERT_TRUE(accepted > 1000u && accepted < 59000u);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_full_file_is_understood);
    RUN_TEST(test_outputs_alone_are_enough);
    RUN_TEST(test_the_range_that_is_not_given);
    RUN_TEST(test_the_example_is_understood);
    RUN_TEST(test_every_name_of_the_table_is_a_channel);
    RUN_TEST(test_every_mistake_is_named_with_its_place_and_remedy);
    RUN_TEST(test_lines_of_every_length);
    RUN_TEST(test_too_many_channels);
    RUN_TEST(test_a_locale_with_a_decimal_comma_changes_nothing);
    RUN_TEST(test_files_that_are_none);
    RUN_TEST(test_mutated_files);
    return UNITY_END();
}
/* SPDX-License-Identifier: MIT */
