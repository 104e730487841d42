/* What a filter refuses is told by the setting that it refuses, and what is told to be taken is taken. */
#include "filter_refusal.h"
#include "method_names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unity.h"

enum { CHANNELS = 6, PAST_MOST = 40, WORDS = 200000 };

static aeo_real_t memory[WORDS];
static aeo_estimator_t estimator;
static aeo_channel_t channels[2 * AEO_REGRESSOR_CHANNELS_MAX];
static char text[FILTER_REFUSAL_MAX];
static uint32_t state = 2463534242u;

void setUp(void)
{
    static const char *const names[CHANNELS] = {"pitch", "torque", "wind", "speed", "fore_aft", "side_side"};
    memset(channels, 0, sizeof channels);
    for (unsigned i = 0; i < 2u * AEO_REGRESSOR_CHANNELS_MAX; i++) {
        channels[i].name = i < CHANNELS ? names[i] : "further";
        channels[i].scale = 1;
    }
}

void tearDown(void)
{
}

static unsigned draw(unsigned below)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state % below;
}

/* Sizes that every filter takes, settings as the programs choose them, a memory of 2 ... 2000 samples. */
static aeo_estimator_config_t draw_config(unsigned method)
{
    aeo_estimator_config_t config;
    memset(&config, 0, sizeof config);
    config.inputs = (uint16_t)draw(4);
    config.outputs = (uint16_t)(1u + draw(3));
    config.past = (uint16_t)(1u + draw(PAST_MOST));
    config.model_set = method == (unsigned)AEO_METHOD_ELS || draw(2) == 0u ? AEO_VARMAX : AEO_VARX;
    config.feedthrough = config.inputs > 0u ? draw(1u << config.inputs) : 0u;
    config.period_us = 100000;
    config.channels = channels;
    config.forgetting = 1 - 1 / (aeo_real_t)(2u + draw(draw(2) == 0u ? 20u : 2000u));
    config.regularisation = AEO_REAL(0.1);
    config.excitation_min = AEO_REAL(0.05);
    config.growth_max = 10;
    config.varx_samples = 1000;
    config.forgetting_start = config.forgetting < AEO_REAL(0.99) ? config.forgetting : AEO_REAL(0.99);
    config.forgetting_rate = AEO_REAL(0.99);
    config.guard_ratio = 4;
    return config;
}

static int takes(unsigned method, const aeo_estimator_config_t *config)
{
    const size_t words = aeo_estimator_words(method_of(method), config);
    TEST_ASSERT_TRUE(words <= WORDS);
    return aeo_estimator_init(&estimator, method_of(method), config, memory, words) == AEO_OK;
}

static void explain(unsigned method, const aeo_estimator_config_t *config)
{
    memset(text, 'x', sizeof text);
    filter_refusal_explain(text, method, config, memory, WORDS);
    TEST_ASSERT_NOT_NULL(memchr(text, '\0', sizeof text));
}

/* Where nothing else is wrong it is the memory: so it is told, with one that the filter takes and no much longer one. */
static void too_short_a_memory_is_told_with_one_that_is_taken(void)
{
    unsigned refused = 0;
    for (unsigned k = 0; k < 4000u; k++) {
        const unsigned method = draw(4);
        aeo_estimator_config_t config = draw_config(method);
        const char *told;
        if (takes(method, &config)) {
            continue;
        }
        refused++;
        TEST_ASSERT_TRUE(method == (unsigned)AEO_METHOD_FAST_RLS || method == (unsigned)AEO_METHOD_LATTICE);
        explain(method, &config);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("forget = ", text, 9, text);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, method_name(method)), text);
        told = strstr(text, "raise forget to ");
        TEST_ASSERT_NOT_NULL_MESSAGE(told, text);
        config.forgetting = (aeo_real_t)strtod(told + 16, NULL);
        TEST_ASSERT_TRUE_MESSAGE(takes(method, &config), text);
        config.forgetting -= AEO_REAL(2e-4);
        TEST_ASSERT_FALSE_MESSAGE(takes(method, &config), text);
    }
    TEST_ASSERT_TRUE(refused > 50u);
}

/* A channel is named, whatever its number and its fault, beside a memory that is too short, too. */
static void a_channel_is_named(void)
{
    for (unsigned k = 0; k < 1000u; k++) {
        const unsigned method = draw(4), fault = draw(4);
        const aeo_estimator_config_t config = draw_config(method);
        const unsigned at = draw((unsigned)config.inputs + config.outputs);
        setUp();
        channels[at].offset = fault == 0u ? (aeo_real_t)strtod("nan", NULL) : 1;
        channels[at].scale = fault == 1u ? 0 : 1;
        channels[at].minimum = fault == 2u ? (aeo_real_t)strtod("inf", NULL) : 2;
        channels[at].maximum = fault == 3u ? 1 : 3;
        TEST_ASSERT_FALSE(takes(method, &config));
        explain(method, &config);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("channel ", text, 8, text);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, channels[at].name), text);
    }
}

/* The longest window that is told is taken, and one longer is not. */
static void sizes_are_told_with_what_is_possible(void)
{
    for (unsigned k = 0; k < 300u; k++) {
        aeo_estimator_config_t config = draw_config(AEO_METHOD_LATTICE);
        const char *told;
        config.forgetting = 1;
        config.past = (uint16_t)(1025u + draw(60000));
        explain(AEO_METHOD_LATTICE, &config);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("past = ", text, 7, text);
        told = strstr(text, "1 ... ");
        TEST_ASSERT_NOT_NULL_MESSAGE(told, text);
        config.past = (uint16_t)atoi(told + 6);
        TEST_ASSERT_TRUE_MESSAGE(takes(AEO_METHOD_LATTICE, &config), text);
        config.past++;
        TEST_ASSERT_FALSE_MESSAGE(takes(AEO_METHOD_LATTICE, &config), text);
        config.past = 1;
        config.feedthrough = 1u << config.inputs;
        explain(AEO_METHOD_LATTICE, &config);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("feedthrough ", text, 12, text);
        config.outputs = (uint16_t)(draw(2) == 0u ? 0u : 33u + draw(60000));
        explain(AEO_METHOD_LATTICE, &config);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("at most 32 inputs", text, 17, text);
    }
}

static void what_remains_is_told_together(void)
{
    aeo_estimator_config_t config = draw_config(AEO_METHOD_RLS);
    filter_refusal_explain(text, AEO_METHOD_RLS, &config, NULL, 0);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "out of memory"), text);
    config.regularisation = 0;
    explain(AEO_METHOD_RLS, &config);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "regularize"), text);
    config = draw_config(AEO_METHOD_RLS);
    config.forgetting = AEO_REAL(0.25);
    explain(AEO_METHOD_RLS, &config);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "sample time, forget, regularize"), text);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(too_short_a_memory_is_told_with_one_that_is_taken);
    RUN_TEST(a_channel_is_named);
    RUN_TEST(sizes_are_told_with_what_is_possible);
    RUN_TEST(what_remains_is_told_together);
    return UNITY_END();
}
