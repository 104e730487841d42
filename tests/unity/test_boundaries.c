/* Where the headers say that a range ends: the last value is taken and the next one refused. */
#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/lattice.h"
#include "aeolid/rls.h"
#include "fake_bus.h"
#include "samples.h"
#include "saved.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { WORDS = 120000 };

static aeo_real_t memory[WORDS];

void setUp(void)
{
    set_up_bus();
}

void tearDown(void)
{
    tear_down_bus();
}

/* The neighbour of x above (up 1) or below it. */
static aeo_real_t next_to(aeo_real_t x, int up)
{
#ifdef AEO_REAL_DOUBLE
    return nextafter(x, up ? DBL_MAX : -DBL_MAX);
#else
    return nextafterf(x, up ? FLT_MAX : -FLT_MAX);
#endif
}

/* One setting of one filter, by its place in the filter's own description. */
typedef struct {
    aeo_status_t (*init)(const void *config);
    void *config;
    aeo_real_t *setting;
    aeo_real_t low, high;
} range_t;

static aeo_rls_config_t rls_config;
static aeo_els_config_t els_config;
static aeo_fast_rls_config_t fast_config;
static aeo_lattice_config_t lattice_config;
static union {
    aeo_rls_t rls;
    aeo_els_t els;
    aeo_fast_rls_t fast;
    aeo_lattice_t lattice;
} filter;

static aeo_status_t init_rls(const void *config)
{
    return aeo_rls_init(&filter.rls, (const aeo_rls_config_t *)config, memory, WORDS);
}

static aeo_status_t init_els(const void *config)
{
    return aeo_els_init(&filter.els, (const aeo_els_config_t *)config, memory, WORDS);
}

static aeo_status_t init_fast(const void *config)
{
    return aeo_fast_rls_init(&filter.fast, (const aeo_fast_rls_config_t *)config, memory, WORDS);
}

static aeo_status_t init_lattice(const void *config)
{
    return aeo_lattice_init(&filter.lattice, (const aeo_lattice_config_t *)config, memory, WORDS);
}

static void describe_all(void)
{
    rls_config = (aeo_rls_config_t){4, 2, AEO_REAL(0.99), AEO_REAL(1), AEO_REAL(0.05), AEO_REAL(100)};
    els_config = (aeo_els_config_t){.regressors = 6,
                                    .outputs = 1,
                                    .past = 2,
                                    .varx_samples = 50,
                                    .forgetting = AEO_REAL(0.99),
                                    .forgetting_start = AEO_REAL(0.98),
                                    .forgetting_rate = AEO_REAL(0.99),
                                    .regularisation = AEO_REAL(1),
                                    .excitation_min = AEO_REAL(0.05),
                                    .growth_max = AEO_REAL(100),
                                    .guard_ratio = AEO_REAL(4)};
    fast_config = (aeo_fast_rls_config_t){.past = 4,
                                          .block = 3,
                                          .outputs = 2,
                                          .forgetting = AEO_REAL(0.99),
                                          .regularisation = AEO_REAL(1),
                                          .growth_max = AEO_REAL(100)};
    lattice_config = (aeo_lattice_config_t){.past = 4,
                                            .block = 3,
                                            .outputs = 2,
                                            .forgetting = AEO_REAL(0.99),
                                            .regularisation = AEO_REAL(1),
                                            .excitation_min = AEO_REAL(0.05),
                                            .growth_max = AEO_REAL(100)};
}

static void settings_end_where_the_headers_say(void)
{
    const range_t ranges[] = {
        {init_rls, &rls_config, &rls_config.forgetting, AEO_REAL(0.5), AEO_REAL(1)},
        {init_rls, &rls_config, &rls_config.excitation_min, AEO_REAL(0), AEO_REAL(1)},
        {init_rls, &rls_config, &rls_config.growth_max, AEO_REAL(4), AEO_REAL(1e6)},
        {init_rls, &rls_config, &rls_config.regularisation, AEO_REAL(1e-8), AEO_REAL(1e8)},
        {init_els, &els_config, &els_config.forgetting, AEO_REAL(0.98), AEO_REAL(1)}, /* not below its start */
        {init_els, &els_config, &els_config.forgetting_start, AEO_REAL(0.5), AEO_REAL(0.99)},
        {init_els, &els_config, &els_config.forgetting_rate, AEO_REAL(0), AEO_REAL(0.999999)},
        {init_els, &els_config, &els_config.guard_ratio, AEO_REAL(1.5), AEO_REAL(100)},
        {init_fast, &fast_config, &fast_config.growth_max, AEO_REAL(4), AEO_REAL(1e6)},
        {init_fast, &fast_config, &fast_config.regularisation, AEO_REAL(1e-8), AEO_REAL(1e8)},
        {init_lattice, &lattice_config, &lattice_config.forgetting, AEO_REAL(0.5), AEO_REAL(1)},
        {init_lattice, &lattice_config, &lattice_config.excitation_min, AEO_REAL(0), AEO_REAL(1)}};
    for (unsigned i = 0; i < sizeof ranges / sizeof *ranges; i++) {
        const range_t *range = &ranges[i];
        describe_all();
        /* growth_max / regularisation has a bound of its own, 1e10: out of the way here */
        rls_config.growth_max = fast_config.growth_max = AEO_REAL(50);
        *range->setting = range->low;
        TEST_ASSERT_EQUAL_INT(AEO_OK, range->init(range->config));
        /* below 0 a normal number, for -ffast-math flushes others to it */
        *range->setting = range->low > AEO_REAL(0) ? next_to(range->low, 0) : AEO_REAL(-1e-30);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, range->init(range->config));
        *range->setting = range->high;
        TEST_ASSERT_EQUAL_INT(AEO_OK, range->init(range->config));
        *range->setting = next_to(range->high, 1);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, range->init(range->config));
    }
}

static void variances_end_at_ten_to_the_ten(void)
{
    describe_all();
    rls_config.growth_max = AEO_REAL(1e6);
    rls_config.regularisation = AEO_REAL(1.000001e-4);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_rls(&rls_config));
    rls_config.regularisation = AEO_REAL(0.99999e-4);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_rls(&rls_config));
    rls_config.growth_max = AEO_REAL(9765625) / AEO_REAL(1024); /* 1e10 to the bit */
    rls_config.regularisation = AEO_REAL(1) / AEO_REAL(1048576);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_rls(&rls_config));
    rls_config.growth_max = next_to(rls_config.growth_max, 1);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_rls(&rls_config));
}

/* n (1 - lambda) <= 3 and lambda^(p-1) >= 1e-6, by halves: exact. */
static void short_memories_bound_the_window(void)
{
    describe_all();
    fast_config.forgetting = lattice_config.forgetting = AEO_REAL(0.5);
    fast_config.feedthrough = 0;
    for (unsigned past = 1; past <= 7u; past++) {
        for (unsigned block = 1; block <= 7u; block++) {
            fast_config.past = (uint16_t)past;
            fast_config.block = (uint16_t)block;
            TEST_ASSERT_EQUAL_INT(past * block <= 6u ? AEO_OK : AEO_E_ARG, init_fast(&fast_config));
        }
    }
    fast_config.past = 2;
    fast_config.block = 3;
    fast_config.feedthrough = 1; /* the present inputs count */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_fast(&fast_config));
    fast_config.forgetting = AEO_REAL(1) - AEO_REAL(1) / AEO_REAL(256);
    fast_config.past = 256;
    fast_config.feedthrough = 0;
    TEST_ASSERT_TRUE(init_fast(&fast_config) != AEO_E_ARG);
    fast_config.forgetting = AEO_REAL(0.9); /* 30 times a tenth, as it is rounded, is 3 all the same */
    fast_config.past = 10;
    TEST_ASSERT_TRUE(init_fast(&fast_config) != AEO_E_ARG);
    fast_config.forgetting = AEO_REAL(0.8999);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_fast(&fast_config));
    lattice_config.past = 20; /* 2^-19 = 1.9e-6 */
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_lattice(&lattice_config));
    lattice_config.past = 21;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_lattice(&lattice_config));
}

static void sizes_end_where_the_headers_say(void)
{
    describe_all();
    rls_config.regressors = 1;
    rls_config.outputs = AEO_RLS_OUTPUTS_MAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_rls(&rls_config));
    rls_config.outputs = AEO_RLS_OUTPUTS_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_rls(&rls_config));
    rls_config.outputs = 1;
    rls_config.regressors = AEO_RLS_REGRESSORS_MAX; /* sizes first, memory last */
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, init_rls(&rls_config));
    rls_config.regressors = AEO_RLS_REGRESSORS_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_rls(&rls_config));
    fast_config.past = 1;
    fast_config.block = 33;
    fast_config.outputs = AEO_FAST_RLS_OUTPUTS_MAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_fast(&fast_config));
    fast_config.outputs = AEO_FAST_RLS_OUTPUTS_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_fast(&fast_config));
    fast_config.outputs = 1;
    fast_config.block = AEO_FAST_RLS_BLOCK_MAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_fast(&fast_config));
    fast_config.block = AEO_FAST_RLS_BLOCK_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_fast(&fast_config));
    fast_config.block = 32; /* every bit of the mask has its entry */
    fast_config.feedthrough = UINT32_C(0x80000000);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_fast(&fast_config));
    fast_config.block = 31;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_fast(&fast_config));
    fast_config.feedthrough = 0;
    fast_config.past = AEO_FAST_RLS_REGRESSORS_MAX;
    fast_config.block = 1;
    fast_config.forgetting = AEO_REAL(1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_fast(&fast_config));
    fast_config.past = AEO_FAST_RLS_REGRESSORS_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_fast(&fast_config));
    fast_config.past = AEO_FAST_RLS_REGRESSORS_MAX; /* with a present input one too many */
    fast_config.feedthrough = 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_fast(&fast_config));
    lattice_config.past = AEO_LATTICE_REGRESSORS_MAX;
    lattice_config.block = 1;
    lattice_config.forgetting = AEO_REAL(1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_lattice(&lattice_config));
    lattice_config.present = 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_lattice(&lattice_config));
    lattice_config.present = 0;
    lattice_config.past = AEO_LATTICE_REGRESSORS_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_lattice(&lattice_config));
    lattice_config.past = 1;
    lattice_config.block = AEO_LATTICE_BLOCK_MAX;
    lattice_config.present = AEO_LATTICE_BLOCK_MAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_lattice(&lattice_config));
    lattice_config.present = AEO_LATTICE_BLOCK_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_lattice(&lattice_config));
    lattice_config.present = 0;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_lattice(&lattice_config));
    lattice_config.block = AEO_LATTICE_BLOCK_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_lattice(&lattice_config));
    lattice_config.block = 3;
    lattice_config.outputs = AEO_LATTICE_OUTPUTS_MAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_lattice(&lattice_config));
    lattice_config.outputs = AEO_LATTICE_OUTPUTS_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_lattice(&lattice_config));
}

static void starts_of_els_end_where_the_header_says(void)
{
    describe_all();
    els_config.varx_samples = 16;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_els(&els_config));
    els_config.varx_samples = 15;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_els(&els_config));
    for (unsigned quarters = 1; quarters < 6u; quarters++) { /* below 1.5 a guard is no guard, but off at 0 alone */
        els_config.varx_samples = 50;
        els_config.guard_ratio = AEO_REAL(0.25) * (aeo_real_t)quarters;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_els(&els_config));
    }
    els_config.guard_ratio = AEO_REAL(0); /* without the guard no start is too short */
    els_config.varx_samples = 0;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_els(&els_config));
    els_config.varx_samples = AEO_ELS_VARX_SAMPLES_MAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_els(&els_config));
    els_config.varx_samples = AEO_ELS_VARX_SAMPLES_MAX + 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_els(&els_config));
}

/* ---- regressor --------------------------------------------------------------------------------------------------- */

static aeo_status_t init_window(uint32_t period_us, aeo_real_t scale, unsigned r, unsigned l, unsigned p)
{
    static aeo_real_t scales[64];
    aeo_regressor_t regressor;
    aeo_regressor_config_t config = {.inputs = (uint16_t)r, .outputs = (uint16_t)l, .past = (uint16_t)p};
    for (unsigned i = 0; i < 64; i++) {
        scales[i] = scale;
    }
    config.period_us = period_us;
    config.scale = scales;
    return aeo_regressor_init(&regressor, &config, memory, WORDS);
}

static void windows_end_where_the_header_says(void)
{
#ifdef AEO_REAL_DOUBLE
    const aeo_real_t least = DBL_MIN * 4, most = DBL_MAX / 16;
#else
    const aeo_real_t least = FLT_MIN * 4, most = FLT_MAX / 16;
#endif
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(1, 1, 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(UINT32_C(4000000000), 1, 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(UINT32_C(4000000001), 1, 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(1, least, 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, next_to(least, 0), 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(1, most, 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, next_to(most, 1), 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(1, 1, 32, 32, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, 1, 33, 32, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, 1, 32, 33, 1));
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(1, 1, 2, 1, 340)); /* 3 340 + 2 = 1022, and room for 2 present inputs */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, 1, 2, 1, 341));
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(1, 1, 0, 1, 1024)); /* the largest of all */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, 1, 0, 1, 1025));
    aeo_regressor_t regressor;
    aeo_regressor_config_t moving = {.outputs = 1, .past = 512, .model_set = AEO_VARMAX, .period_us = 1};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &moving, memory, WORDS)); /* 2 512 with the e */
    moving.past = 513;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &moving, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(0, 1, 1, 1, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, 1, 1, 0, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, 1, 1, 1, 0));
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_window(1, 1, 32, 32, 15)); /* 64 15 + 32 = 992 */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_window(1, 1, 32, 32, 16));
}

/* A mask has a bit for each of 32 inputs, and none for one that is not there. */
static void masks_end_where_the_inputs_do(void)
{
    aeo_regressor_t regressor;
    aeo_regressor_config_t config = {.outputs = 1, .past = 1, .period_us = 1};
    for (unsigned r = 1; r <= 32u; r++) {
        config.inputs = (uint16_t)r;
        config.feedthrough = UINT32_MAX >> (32u - r);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &config, memory, WORDS));
        if (r < 32u) {
            config.feedthrough = UINT32_C(1) << r;
            TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, memory, WORDS));
        }
    }
}

/* A block waits or not, and the window is filled only where one does, at most with all of its blocks. */
static void numbers_of_saved_regressors_end_where_they_can(void)
{
    enum { LENGTH = AEO_REGRESSOR_SAVED_WORDS(1, 1, 3, 0) };
    static aeo_real_t saved[LENGTH];
    const aeo_regressor_config_t config = {.inputs = 1, .outputs = 1, .past = 3, .period_us = 1000};
    aeo_regressor_t regressor;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &config, memory, WORDS));
    for (unsigned pending = 0; pending < 3u; pending++) {
        for (unsigned filled = 0; filled < 7u; filled++) {
            regressor.pending = (uint8_t)pending;
            regressor.filled = (uint16_t)filled;
            const int can_be = pending < 2u && filled <= 3u * pending;
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&regressor, saved, LENGTH));
            TEST_ASSERT_EQUAL_INT(can_be ? AEO_OK : AEO_E_DAMAGED, aeo_regressor_restore(&regressor, saved, LENGTH));
        }
    }
    regressor.pending = 1;
    regressor.filled = 3;
    aeo_real_t *const places[] = {regressor.z, regressor.z + 5, regressor.block, regressor.block + 1};
    for (unsigned i = 0; i < 4u; i++) {
        for (int sign = -1; sign < 2; sign += 2) {
            *places[i] = (aeo_real_t)sign * AEO_REAL(1e6);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&regressor, saved, LENGTH));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_restore(&regressor, saved, LENGTH));
            *places[i] = next_to(*places[i], sign > 0);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&regressor, saved, LENGTH));
            TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_regressor_restore(&regressor, saved, LENGTH));
            *places[i] = AEO_REAL(0);
        }
    }
}

/* Reset puts back what init left: the saved forms differ in what has been counted alone. */
static void a_reset_window_is_saved_like_a_new_one(void)
{
    enum { LENGTH = AEO_REGRESSOR_SAVED_WORDS(2, 2, 3, 0) };
    static aeo_real_t fresh[LENGTH], again[LENGTH];
    static const aeo_real_t one[2] = {AEO_REAL(0.5), AEO_REAL(-0.25)};
    const aeo_regressor_config_t config = {.inputs = 2, .outputs = 2, .past = 3, .period_us = 1000};
    aeo_regressor_t regressor;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&regressor, fresh, LENGTH));
    for (unsigned k = 1; k < 9; k++) {
        (void)aeo_regressor_push(&regressor, one, one, 1000u * k);
    }
    aeo_regressor_reset(&regressor);
    memset(&regressor.count, 0, sizeof regressor.count);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&regressor, again, LENGTH));
    TEST_ASSERT_EQUAL_MEMORY(fresh, again, sizeof fresh);
}

/* ---- stream ------------------------------------------------------------------------------------------------------ */

static aeo_status_t init_stream(const aeo_stream_config_t *config)
{
    return aeo_stream_init(&stream, config, &port, words, PARAMETERS_MAX);
}

static void streams_end_where_the_header_says(void)
{
    static aeo_channel_t many[65];
    aeo_stream_config_t config = make_config();
    for (unsigned i = 0; i < 65; i++) {
        many[i] = channels[0];
    }
    config.channels = many;
    config.past = 0;
    config.inputs = 32; /* every bit of the mask has its input */
    config.outputs = 32;
    config.feedthrough = UINT32_C(0xFFFFFFFF);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_stream(&config));
    config.scheduling = 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_stream(&config));
    config.scheduling = 0;
    config.inputs = 31;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_stream(&config));
    config.feedthrough = UINT32_C(0x7FFFFFFF);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_stream(&config));
    many[3].scale = (aeo_real_t)FLT_MIN; /* the wire's numbers are binary32 in both builds */
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_stream(&config));
    many[3].scale = (aeo_real_t)(FLT_MIN / 2);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_stream(&config));
    many[3].scale = (aeo_real_t)FLT_MAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_stream(&config));
    static const aeo_real_t periods[] = {AEO_REAL(2e-5), AEO_REAL(1000)};
    for (int up = 0; up < 2; up++) {
        config.sample_time_s = periods[up];
        TEST_ASSERT_EQUAL_INT(AEO_OK, init_stream(&config));
        config.sample_time_s = next_to(periods[up], up);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_stream(&config));
    }
}

/* Each channel is judged, the first and the last of all, its offset and its scale. */
static void every_channel_of_a_stream_is_judged(void)
{
    aeo_channel_t own[CHANNELS];
    aeo_stream_config_t config = make_config();
    config.channels = own;
    for (unsigned i = 0; i < CHANNELS; i++) {
        memcpy(own, channels, sizeof own);
        TEST_ASSERT_EQUAL_INT(AEO_OK, init_stream(&config));
        own[i].offset = make_not_finite((int)(i % 4u));
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_stream(&config));
        own[i].offset = AEO_REAL(0);
        own[i].scale = AEO_REAL(0);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_stream(&config));
        own[i].scale = make_not_finite(2);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, init_stream(&config));
    }
}

/* After a reset no flag of the filter that ran before is told. */
static void a_reset_stream_has_no_flags(void)
{
    const aeo_stream_config_t config = make_config();
    const uint32_t counter[2] = {7, 8};
    start_stream(&config);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_health(&stream, 0x5A5A, counter, 2));
    aeo_stream_reset(&stream);
    fake.kept = 0;
    for (unsigned k = 0; k < 200u; k++) {
        (void)aeo_stream_step(&stream);
    }
    unsigned found = 0;
    for (unsigned i = 0; i < fake.kept; i++) {
        if (is_health(i)) {
            found++;
            TEST_ASSERT_EQUAL_HEX16(0, message_at(i).index);
            TEST_ASSERT_TRUE(message_at(i).tag < AEO_HEALTH_FILTER);
        }
    }
    TEST_ASSERT_TRUE(found > 10u);
}

/* The tag of a seal is the number of channels, odd or even. */
static void a_seal_counts_an_even_number_of_channels(void)
{
    for (uint8_t inputs = 0; inputs <= INPUTS; inputs++) {
        aeo_stream_config_t config = make_config();
        config.inputs = inputs;
        config.past = 0;
        config.seal = 1;
        start_stream(&config);
        describe_first();
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, 1, u, y, NULL));
        TEST_ASSERT_EQUAL_INT(AEO_KIND_SEAL, message_at(fake.kept - 1u).kind);
        TEST_ASSERT_EQUAL_UINT8(inputs + OUTPUTS, message_at(fake.kept - 1u).tag);
    }
}

/* ---- saved forms ------------------------------------------------------------------------------------------------- */

static void els_remembers_one_miss_at_most(void)
{
    enum { LENGTH = AEO_ELS_SAVED_WORDS(6, 1) };
    static aeo_real_t saved[LENGTH];
    describe_all();
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_els(&els_config));
    filter.els.missed = 1;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&filter.els, saved, LENGTH));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_restore(&filter.els, saved, LENGTH));
    filter.els.missed = 2;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&filter.els, saved, LENGTH));
    filter.els.missed = 0;
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_els_restore(&filter.els, saved, LENGTH));
    filter.els.backoff = 6;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&filter.els, saved, LENGTH));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_restore(&filter.els, saved, LENGTH));
}

/* A schedule has behind it at most what lies between its start and its end. */
static void els_lacks_at_most_what_its_schedule_has(void)
{
    enum { LENGTH = AEO_ELS_SAVED_WORDS(6, 1) };
    static aeo_real_t saved[LENGTH];
    describe_all();
    els_config.forgetting = AEO_REAL(0.75);
    els_config.forgetting_start = AEO_REAL(0.625);
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_els(&els_config));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&filter.els, saved, LENGTH));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_restore(&filter.els, saved, LENGTH)); /* at its start */
    static const aeo_real_t wrong[] = {AEO_REAL(0.1250001), AEO_REAL(0.25), AEO_REAL(1), AEO_REAL(-1e-6)};
    for (unsigned i = 0; i < 4u; i++) {
        saved[AEO_ELS_SAVED_HEAD - 1u] = wrong[i];
        aeo_saved_seal(saved, LENGTH);
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_els_restore(&filter.els, saved, LENGTH));
    }
}

/* The last value that a saved lattice may have at a place, and one that it may not have. */
static void judge_lattice_at(aeo_real_t *place, double held, double wrong)
{
    enum { LENGTH = AEO_LATTICE_SAVED_WORDS(4, 3, 2, 2) };
    static aeo_real_t saved[LENGTH];
    const aeo_real_t before = *place;
    *place = (aeo_real_t)held;
    TEST_ASSERT_TRUE(aeo_lattice_invariants_hold(&filter.lattice));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&filter.lattice, saved, LENGTH));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_restore(&filter.lattice, saved, LENGTH));
    *place = (aeo_real_t)wrong;
    TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(&filter.lattice));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&filter.lattice, saved, LENGTH));
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_lattice_restore(&filter.lattice, saved, LENGTH));
    *place = before;
}

/* What a lattice may hold, at the first and the last word of each array: 1/2 is the least alpha, steps are at most 2,
 * errors end at 1e10, innovation and residual among them, weights at 1.1e26, gains at 1e23 and, over alpha, at 3e5. */
static void saved_lattices_end_where_their_proof_does(void)
{
    enum { PAST = 4, BLOCK = 3, NOW = 2, OUT = 2 };
    aeo_lattice_t *const self = &filter.lattice;
    describe_all();
    lattice_config.present = NOW;
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_lattice(&lattice_config));
    const struct {
        aeo_real_t *first;
        size_t count;
        double held, wrong;
    } arrays[] = {{self->alpha, PAST, 0.5, 0.4999},
                  {self->alpha, PAST, 3e35, 3.01e35},
                  {self->step, PAST, 2, 2.001},
                  {self->step, PAST, 0, -0.001},
                  {self->window, PAST * BLOCK, 1e6, 1.001e6},
                  {self->window, PAST * BLOCK, -1e6, -1.001e6},
                  {self->error, PAST * BLOCK, 1e10, 1.001e10},
                  {self->innovation, OUT, -1e10, -1.001e10},
                  {self->residual, OUT, 1e10, 1.001e10},
                  {self->gain, PAST * BLOCK, 1e23, 1.001e23},
                  {self->present_weight, NOW * OUT, 1.1e26, 1.11e26},
                  {self->target_weight, PAST * BLOCK * (OUT + NOW), -1.1e26, -1.11e26},
                  {self->forward_weight, (PAST - 1) * BLOCK * BLOCK, 1.1e26, 1.11e26},
                  {self->backward_weight, (PAST - 1) * BLOCK * BLOCK, 1.1e26, 1.11e26}};
    for (unsigned i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        judge_lattice_at(arrays[i].first, arrays[i].held, arrays[i].wrong);
        judge_lattice_at(arrays[i].first + arrays[i].count - 1u, arrays[i].held, arrays[i].wrong);
    }
    for (size_t j = 0; j < PAST; j++) {
        self->step[j] = AEO_REAL(2);
        judge_lattice_at(self->gain + j * BLOCK, 1.5e5, 1.501e5);
        judge_lattice_at(self->gain + j * BLOCK + BLOCK - 1u, -1.5e5, -1.501e5);
        self->step[j] = AEO_REAL(0);
    }
    /* variances end at four times growth_max / rho = 100, each triangle's first and last */
    for (size_t t = 0; t < 2u * PAST - 1u; t++) {
        judge_lattice_at(self->factor + t * AEO_LATTICE_TRIANGLE(BLOCK), 400, 400.1);
        judge_lattice_at(self->factor + (t + 1u) * AEO_LATTICE_TRIANGLE(BLOCK) - 1u, 400, 400.1);
        judge_lattice_at(self->factor + (t + 1u) * AEO_LATTICE_TRIANGLE(BLOCK) - 1u, 1e-30, 0);
    }
    judge_lattice_at(self->present_factor, 400, 400.1);
    judge_lattice_at(self->present_factor + AEO_LATTICE_TRIANGLE(NOW) - 1u, 1e-30, -1);
}

static void numbers_of_saved_lattices_end_where_they_can(void)
{
    enum { LENGTH = AEO_LATTICE_SAVED_WORDS(4, 3, 0, 2) };
    static aeo_real_t saved[LENGTH];
    aeo_lattice_t *const self = &filter.lattice;
    describe_all();
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_lattice(&lattice_config));
    const struct {
        uint32_t *number, most;
    } ends[] = {{&self->orders, 4}, {&self->head, 3},  {&self->scan, 7 * 3 - 1},
                {&self->begun, 1},  {&self->quiet, 1}, {&self->learning, 65535}};
    for (unsigned i = 0; i < sizeof ends / sizeof *ends; i++) {
        const uint32_t before = *ends[i].number;
        for (uint32_t more = 0; more < 2u; more++) {
            *ends[i].number = ends[i].most + more;
            TEST_ASSERT_EQUAL_INT(more == 0u, aeo_lattice_invariants_hold(self));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(self, saved, LENGTH));
            TEST_ASSERT_EQUAL_INT(more == 0u ? AEO_OK : AEO_E_DAMAGED, aeo_lattice_restore(self, saved, LENGTH));
        }
        *ends[i].number = before;
    }
}

/* Innovations end at 1e12, factors at 1e6, energies at 1e33, predictors at 1e30, the gain at 2e12 / gamma, 1 / gamma at 2e20,
 * the mean squares too, and the window, for disturbances, a tenth above what a scaled number may be. */
static void saved_windows_end_where_their_proof_does(void)
{
    enum { LENGTH = AEO_FAST_RLS_SAVED_WORDS(4, 3, 0, 2) };
    static aeo_real_t saved[LENGTH];
    enum {
        PLACES = 26,
        M_BLOCK = 3,
        N_ALL = 4 * M_BLOCK,
        TRIANGLE = M_BLOCK * (M_BLOCK + 1) / 2,
        WEIGHTS = M_BLOCK * N_ALL
    };
    static const double held[PLACES] = {1e12,  -1e12, 1.1e6, 1.1e6, 1e6,  -1e6, 1e33, -1e33, 1e30,
                                        -1e30, 2e12,  -2e12, 2e20,  1,    2e20, 2e20, 1e-30, 1e-30,
                                        1e-30, 1e30,  1e30,  1e6,   1e33, 1e33, 0,    0};
    for (unsigned place = 0; place < PLACES; place++) {
        describe_all();
        TEST_ASSERT_EQUAL_INT(AEO_OK, init_fast(&fast_config));
        const aeo_fast_rls_array_t *const one = &filter.fast.array[0], *const two = &filter.fast.array[1];
        aeo_real_t *const words_held[PLACES] = {filter.fast.innovation,
                                                filter.fast.innovation + 1,
                                                filter.fast.window,
                                                filter.fast.window + 14,
                                                one->factor + 1,
                                                two->factor + TRIANGLE - 2,
                                                one->energy,
                                                two->energy + 8,
                                                one->forward,
                                                two->backward + WEIGHTS - 1,
                                                one->gain,
                                                two->gain + N_ALL - 1,
                                                one->scalar,
                                                two->scalar,
                                                one->scalar + 1,
                                                two->scalar + 2,
                                                one->factor,
                                                two->factor + M_BLOCK,
                                                two->factor + TRIANGLE - 1,
                                                two->forward,
                                                one->forward + WEIGHTS - 1,
                                                one->factor + TRIANGLE - 1,
                                                one->energy + 8,
                                                two->energy,
                                                one->scalar + 1,
                                                two->scalar + 2};
        const double wrong = place == 13u                  ? 0.999
                             : place >= 24u                ? -1e-20
                             : place >= 16u && place < 19u ? 0.0
                                                           : 1.001 * held[place];
        *words_held[place] = (aeo_real_t)held[place];
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(&filter.fast));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&filter.fast, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_restore(&filter.fast, saved, LENGTH));
        *words_held[place] = (aeo_real_t)wrong;
        TEST_ASSERT_FALSE(aeo_fast_rls_invariants_hold(&filter.fast));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&filter.fast, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_fast_rls_restore(&filter.fast, saved, LENGTH));
    }
}

static void numbers_of_saved_windows_end_where_they_can(void)
{
    enum { LENGTH = AEO_FAST_RLS_SAVED_WORDS(4, 3, 0, 2) };
    static aeo_real_t saved[LENGTH];
    aeo_fast_rls_t *const self = &filter.fast;
    describe_all();
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_fast(&fast_config));
    const struct {
        uint32_t *number, held, wrong;
    } ends[] = {{&self->filled, 5, 6}, {&self->active, 1, 2}, {&self->random, 1, 0}};
    for (unsigned i = 0; i < sizeof ends / sizeof *ends; i++) {
        const uint32_t before = *ends[i].number;
        *ends[i].number = ends[i].held;
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(self));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(self, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_restore(self, saved, LENGTH));
        *ends[i].number = ends[i].wrong;
        TEST_ASSERT_FALSE(aeo_fast_rls_invariants_hold(self));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(self, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_fast_rls_restore(self, saved, LENGTH));
        *ends[i].number = before;
    }
}

/* A factor of rls: variances up to four times growth_max / rho = 100, a diagonal above 0, zeros elsewhere; theta, innovation
 * and residual within what rls_state.h proves. */
static void saved_factors_end_where_their_proof_does(void)
{
    enum { ORDER = 4, OUT = 2, LENGTH = AEO_RLS_SAVED_WORDS(ORDER, OUT), PAD = 4, STRIP = AEO_RLS_STRIP };
    static aeo_real_t saved[LENGTH];
    aeo_rls_t *const self = &filter.rls;
    describe_all();
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_rls(&rls_config));
    const struct {
        aeo_real_t *word;
        double held, wrong;
    } ends[] = {{self->factor + PAD, 20, 20.01},
                {self->factor + PAD, 1e-30, 0},
                {self->factor + PAD + (ORDER - 1) * (STRIP + 1), 20, 20.01},
                {self->factor + PAD + (ORDER - 1) * (STRIP + 1), 1e-30, -1},
                {self->factor, 0, 1e-9},
                {self->factor + PAD + STRIP, 0, -1e-9},
                {self->theta, 1e29, 1.001e29},
                {self->theta + ORDER * OUT - 1, -1e29, -1.001e29},
                {self->innovation, 1e12, 1.001e12},
                {self->residual + OUT - 1, -1e12, -1.001e12}};
    for (unsigned i = 0; i < sizeof ends / sizeof *ends; i++) {
        const aeo_real_t before = *ends[i].word;
        *ends[i].word = (aeo_real_t)ends[i].held;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_save(self, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_restore(self, saved, LENGTH));
        *ends[i].word = (aeo_real_t)ends[i].wrong;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_save(self, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_rls_restore(self, saved, LENGTH));
        *ends[i].word = before;
    }
    for (uint32_t row = ORDER - 1; row <= ORDER; row++) {
        self->scan_row = row;
        TEST_ASSERT_EQUAL_INT(row < ORDER, aeo_rls_invariants_hold(self));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_save(self, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(row < ORDER ? AEO_OK : AEO_E_DAMAGED, aeo_rls_restore(self, saved, LENGTH));
    }
}

/* Every number that is saved comes back, also those that a short run leaves alone. */
static void saved_numbers_of_fast_rls_come_back(void)
{
    enum { LENGTH = AEO_FAST_RLS_SAVED_WORDS(4, 3, 0, 2) };
    static aeo_real_t saved[LENGTH], twin_memory[AEO_FAST_RLS_WORDS(4, 3, 0, 2)];
    aeo_fast_rls_t twin;
    describe_all();
    TEST_ASSERT_EQUAL_INT(AEO_OK, init_fast(&fast_config));
    TEST_ASSERT_EQUAL_INT(
        AEO_OK, aeo_fast_rls_init(&twin, &fast_config, twin_memory, sizeof twin_memory / sizeof *twin_memory));
    filter.fast.array[0].age = 17;
    filter.fast.array[1].age = 70001;
    filter.fast.active = 1;
    filter.fast.hold = 23;
    filter.fast.filled = 3;
    filter.fast.random = 99;
    filter.fast.health = 5;
    filter.fast.count.restarted = 4;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&filter.fast, saved, LENGTH));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_restore(&twin, saved, LENGTH));
    TEST_ASSERT_EQUAL_UINT32(17, twin.array[0].age);
    TEST_ASSERT_EQUAL_UINT32(70001, twin.array[1].age);
    TEST_ASSERT_EQUAL_UINT32(1, twin.active);
    TEST_ASSERT_EQUAL_UINT32(23, twin.hold);
    TEST_ASSERT_EQUAL_UINT32(3, twin.filled);
    TEST_ASSERT_EQUAL_UINT32(99, twin.random);
    TEST_ASSERT_EQUAL_UINT32(5, twin.health);
    TEST_ASSERT_EQUAL_UINT32(4, twin.count.restarted);
    for (unsigned rises = 0; rises <= 5u; rises++) {
        const aeo_real_t rho = fast_config.regularisation * (aeo_real_t)(1ul << 4u * rises);
        filter.fast.regularisation = rho;
        TEST_ASSERT_EQUAL_INT(rises <= 4u, aeo_fast_rls_invariants_hold(&filter.fast));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&filter.fast, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(rises <= 4u ? AEO_OK : AEO_E_DAMAGED, aeo_fast_rls_restore(&twin, saved, LENGTH));
        TEST_ASSERT_EQUAL_INT(rises <= 4u, memcmp(&twin.regularisation, &rho, sizeof rho) == 0);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(settings_end_where_the_headers_say);
    RUN_TEST(variances_end_at_ten_to_the_ten);
    RUN_TEST(short_memories_bound_the_window);
    RUN_TEST(sizes_end_where_the_headers_say);
    RUN_TEST(starts_of_els_end_where_the_header_says);
    RUN_TEST(windows_end_where_the_header_says);
    RUN_TEST(numbers_of_saved_regressors_end_where_they_can);
    RUN_TEST(a_reset_window_is_saved_like_a_new_one);
    RUN_TEST(streams_end_where_the_header_says);
    RUN_TEST(every_channel_of_a_stream_is_judged);
    RUN_TEST(a_reset_stream_has_no_flags);
    RUN_TEST(a_seal_counts_an_even_number_of_channels);
    RUN_TEST(els_remembers_one_miss_at_most);
    RUN_TEST(els_lacks_at_most_what_its_schedule_has);
    RUN_TEST(saved_lattices_end_where_their_proof_does);
    RUN_TEST(numbers_of_saved_lattices_end_where_they_can);
    RUN_TEST(numbers_of_saved_windows_end_where_they_can);
    RUN_TEST(saved_factors_end_where_their_proof_does);
    RUN_TEST(saved_windows_end_where_their_proof_does);
    RUN_TEST(masks_end_where_the_inputs_do);
    RUN_TEST(saved_numbers_of_fast_rls_come_back);
    return UNITY_END();
}
