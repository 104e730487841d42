/* The window against a regressor written down from the samples' history; every way a sample can be refused. */
#include "aeolid/regressor.h"
#include "samples.h"
#include "unity.h"

#include <string.h>

enum { SAMPLES = 60, CHANNELS = 6, WORDS = 512 };

static aeo_regressor_t regressor;
static aeo_real_t memory[WORDS];
static aeo_real_t u[SAMPLES][CHANNELS], y[SAMPLES][CHANNELS], e[SAMPLES][CHANNELS];
static uint64_t seed = 11;
static const uint32_t PERIOD = 100000;

void setUp(void)
{
    fill(u[0], (size_t)SAMPLES * CHANNELS, &seed);
    fill(y[0], (size_t)SAMPLES * CHANNELS, &seed);
    fill(e[0], (size_t)SAMPLES * CHANNELS, &seed);
}

void tearDown(void)
{
}

static aeo_regressor_config_t make_config(unsigned r, unsigned l, unsigned p)
{
    const aeo_regressor_config_t config = {
        .inputs = (uint16_t)r, .outputs = (uint16_t)l, .past = (uint16_t)p, .period_us = PERIOD};
    return config;
}

static void start(const aeo_regressor_config_t *config)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, config, memory, WORDS));
}

static aeo_status_t push(size_t k)
{
    const aeo_status_t status = aeo_regressor_push(&regressor, u[k], y[k], (uint64_t)k * PERIOD);
    TEST_ASSERT_TRUE(aeo_regressor_invariants_hold(&regressor));
    return status;
}

/* z_k from eq. (9)/(14), straight from the samples */
static size_t expected(aeo_real_t *z, size_t k, unsigned r, unsigned l, unsigned p, unsigned with_e, uint32_t mask)
{
    size_t n = 0;
    for (size_t i = k - p; i < k; i++) {
        for (unsigned c = 0; c < r; c++) {
            z[n++] = u[i][c];
        }
        for (unsigned c = 0; c < l; c++) {
            z[n++] = y[i][c];
        }
        for (unsigned c = 0; c < (with_e ? l : 0); c++) {
            z[n++] = e[i][c];
        }
    }
    for (unsigned c = 0; c < r; c++) {
        if (mask >> c & 1u) {
            z[n++] = u[k][c];
        }
    }
    return n;
}

static void order_is_that_of_the_paper(void)
{
    static const unsigned SIZES[][3] = {{1, 1, 1}, {2, 3, 4}, {3, 1, 2}, {1, 4, 10}, {4, 4, 1}, {0, 1, 3}, {0, 3, 2}};
    for (size_t s = 0; s < sizeof SIZES / sizeof SIZES[0]; s++) {
        const unsigned r = SIZES[s][0], l = SIZES[s][1], p = SIZES[s][2];
        for (unsigned set = 0; set < 2; set++) {
            for (uint32_t mask = 0; mask < 1u << r; mask++) {
                aeo_regressor_config_t config = make_config(r, l, p);
                config.model_set = set ? AEO_VARMAX : AEO_VARX;
                config.feedthrough = mask;
                start(&config);
                for (size_t k = 0; k < SAMPLES; k++) {
                    TEST_ASSERT_EQUAL_INT(k < p ? AEO_FILLING : AEO_OK, push(k));
                    if (k >= p) {
                        aeo_real_t z[128];
                        TEST_ASSERT_EQUAL_UINT(expected(z, k, r, l, p, set, mask), regressor.length);
                        TEST_ASSERT_EQUAL_MEMORY(z, aeo_regressor_z(&regressor), regressor.length * sizeof *z);
                        TEST_ASSERT_EQUAL_MEMORY(y[k], aeo_regressor_y(&regressor), l * sizeof *z);
                    }
                    if (set) {
                        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_set_innovation(&regressor, e[k]));
                    }
                }
                TEST_ASSERT_EQUAL_UINT32(SAMPLES, regressor.count.samples);
            }
        }
    }
}

static void scales_and_offsets_are_applied(void)
{
    const aeo_real_t offset[3] = {3, -5, 1000}, scale[3] = {2, AEO_REAL(0.25), 8192};
    aeo_regressor_config_t config = make_config(2, 1, 1);
    config.offset = offset;
    config.scale = scale;
    config.feedthrough = 2;
    start(&config);
    const aeo_real_t u0[2] = {7, -4}, u1[2] = {0, -6}, y0[1] = {1000 + 8192}, y1[1] = {1000 - 4096};
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_regressor_push(&regressor, u0, y0, 0));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_push(&regressor, u1, y1, PERIOD));
    const aeo_real_t z[4] = {2, 4, 1, -4}, scaled_y = AEO_REAL(-0.5); /* powers of two: exact */
    TEST_ASSERT_EQUAL_MEMORY(z, aeo_regressor_z(&regressor), sizeof z);
    TEST_ASSERT_EQUAL_MEMORY(&scaled_y, aeo_regressor_y(&regressor), sizeof scaled_y);
}

/* Push a bad sample and demand the code, one counter, and no other change. */
static void assert_rejected(aeo_status_t code, uint32_t *counter, const aeo_real_t *bad_u, const aeo_real_t *bad_y,
                            uint64_t time_us)
{
    static aeo_real_t words[WORDS];
    memcpy(words, memory, sizeof words);
    const aeo_regressor_t before = regressor;
    const uint32_t count = *counter;
    TEST_ASSERT_EQUAL_INT(code, aeo_regressor_push(&regressor, bad_u, bad_y, time_us));
    TEST_ASSERT_EQUAL_UINT32(count + 1, *counter);
    *counter = count;
    TEST_ASSERT_EQUAL_MEMORY(&before, &regressor, sizeof before);
    TEST_ASSERT_EQUAL_MEMORY(words, memory, sizeof words);
    *counter = count + 1;
}

static void bad_samples_leave_no_trace(void)
{
    const aeo_real_t low[5] = {-2, -2, -2, -2, -2}, high[5] = {2, 2, 2, 2, 2};
    const aeo_real_t scale[5] = {1, 1, 1, AEO_REAL(1e-7), 1}, offset[5] = {0};
    aeo_regressor_config_t config = make_config(2, 3, 3);
    config.minimum = low;
    config.maximum = high;
    start(&config);
    for (size_t k = 0; k < 10; k++) {
        push(k);
        for (size_t at = 0; at < 5; at++) {
            for (int kind = 0; kind < 6; kind++) {
                aeo_real_t bad_u[2] = {u[k][0], u[k][1]}, bad_y[3] = {y[k][0], y[k][1], y[k][2]};
                *(at < 2 ? &bad_u[at] : &bad_y[at - 2]) =
                    kind < 4 ? make_not_finite(kind) : AEO_REAL(kind == 4 ? 2.001 : -2.001);
                assert_rejected(kind < 4 ? AEO_E_NOT_FINITE : AEO_E_RANGE,
                                kind < 4 ? &regressor.count.not_finite : &regressor.count.range, bad_u, bad_y,
                                (k + 1) * PERIOD);
            }
        }
        assert_rejected(AEO_E_TIME, &regressor.count.time, u[k], y[k], k * PERIOD);
        assert_rejected(AEO_E_TIME, &regressor.count.time, u[k], y[k], k * PERIOD + PERIOD / 2 - 1);
        if (k > 0) {
            assert_rejected(AEO_E_TIME, &regressor.count.time, u[k], y[k], 0);
        }
    }
    /* plausible in its unit, but not once scaled: 2 / 1e-7 is beyond AEO_SCALED_MAX */
    config.scale = scale;
    config.offset = offset;
    start(&config);
    const aeo_real_t big[3] = {0, 2, 0};
    assert_rejected(AEO_E_RANGE, &regressor.count.range, u[0], big, 0);
}

static void scaling_that_overflows_is_out_of_range(void)
{
    const aeo_real_t offset[2] = {AEO_REAL(-3e38), 0}, scale[2] = {AEO_REAL(1e-30), 1};
    aeo_regressor_config_t config = make_config(1, 1, 1);
    config.offset = offset;
    config.scale = scale;
    start(&config);
    const aeo_real_t far = AEO_REAL(3e38);
    assert_rejected(AEO_E_RANGE, &regressor.count.range, &far, y[0], 0);
}

static void no_regressor_crosses_a_hole(void)
{
    /* lose any one sample of a run, by rejection or by silence: p samples later, and not before, regressors resume, and
     * they hold only samples from after the hole */
    const unsigned r = 2, l = 2, p = 4;
    for (size_t lost = 1; lost < 20; lost++) {
        for (int silent = 0; silent < 2; silent++) {
            const aeo_regressor_config_t config = make_config(r, l, p);
            start(&config);
            for (size_t k = 0; k < 40; k++) {
                if (k == lost) {
                    const aeo_real_t bad[2] = {make_not_finite(0), 0};
                    if (!silent) {
                        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE,
                                              aeo_regressor_push(&regressor, bad, y[k], (uint64_t)k * PERIOD));
                    }
                    continue;
                }
                const size_t begun = k > lost ? lost + 1 : 0;
                const aeo_status_t status = push(k);
                if (k == lost + 1) {
                    TEST_ASSERT_EQUAL_INT(AEO_E_GAP, status);
                } else {
                    TEST_ASSERT_EQUAL_INT(k - begun < p ? AEO_FILLING : AEO_OK, status);
                }
                if (status == AEO_OK) {
                    aeo_real_t z[32];
                    expected(z, k, r, l, p, 0, 0);
                    TEST_ASSERT_EQUAL_MEMORY(z, aeo_regressor_z(&regressor), regressor.length * sizeof *z);
                }
            }
            TEST_ASSERT_EQUAL_UINT32(1, regressor.count.gaps);
            TEST_ASSERT_EQUAL_UINT32(39, regressor.count.samples);
        }
    }
}

static void time_tolerates_half_a_period(void)
{
    const aeo_regressor_config_t config = make_config(1, 1, 1);
    start(&config);
    const uint64_t far = UINT64_C(1) << 60; /* a clock in microseconds since an epoch */
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_regressor_push(&regressor, u[0], y[0], far));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_push(&regressor, u[1], y[1], far + PERIOD / 2));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_push(&regressor, u[2], y[2], far + 2 * PERIOD));
    TEST_ASSERT_EQUAL_INT(AEO_E_GAP, aeo_regressor_push(&regressor, u[3], y[3], far + 2 * PERIOD + 3 * PERIOD / 2 + 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_TIME, aeo_regressor_push(&regressor, u[4], y[4], 0));
    aeo_regressor_reset(&regressor); /* the clock was set back */
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_regressor_push(&regressor, u[4], y[4], 0));
    TEST_ASSERT_EQUAL_UINT32(4 + 1, regressor.count.samples);
}

static void reset_is_fresh(void)
{
    const aeo_regressor_config_t config = make_config(2, 2, 3);
    start(&config);
    for (size_t k = 0; k < 10; k++) {
        push(k);
    }
    aeo_regressor_reset(&regressor);
    for (size_t k = 0; k < 10; k++) {
        TEST_ASSERT_EQUAL_INT(k < 3 ? AEO_FILLING : AEO_OK, push(k));
    }
    aeo_regressor_reset(NULL);
}

static void words_short_are_refused(void)
{
    for (unsigned r = 1; r <= 3; r++) {
        for (unsigned l = 1; l <= 3; l++) {
            for (unsigned p = 1; p <= 5; p++) {
                for (unsigned set = 0; set < 2; set++) {
                    aeo_regressor_config_t config = make_config(r, l, p);
                    config.model_set = set ? AEO_VARMAX : AEO_VARX;
                    config.feedthrough = (1u << r) - 1u;
                    const size_t words = AEO_REGRESSOR_WORDS(r, l, p, set);
                    const aeo_real_t mark = AEO_REAL(12345.5);
                    for (size_t i = 0; i < WORDS; i++) {
                        memory[i] = mark;
                    }
                    const aeo_regressor_t before = regressor;
                    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_regressor_init(&regressor, &config, memory, words - 1));
                    TEST_ASSERT_EQUAL_MEMORY(&before, &regressor, sizeof before);
                    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &config, memory, words));
                    for (size_t k = 0; k < 10; k++) {
                        push(k);
                        if (set) {
                            aeo_regressor_set_innovation(&regressor, e[k]);
                        }
                    }
                    for (size_t i = words; i < WORDS; i++) {
                        TEST_ASSERT_EQUAL_MEMORY(&mark, &memory[i], sizeof mark);
                    }
                }
            }
        }
    }
    TEST_ASSERT_EQUAL_UINT(77, AEO_REGRESSOR_WORDS(2, 3, 10, 0));
    TEST_ASSERT_EQUAL_UINT(177, AEO_REGRESSOR_WORDS(2, 3, 30, 0));
}

static void bad_settings_are_refused(void)
{
    const aeo_regressor_t before = regressor;
    aeo_regressor_config_t config = make_config(2, 2, 3);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(NULL, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, NULL, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, NULL, WORDS));
    static const unsigned SIZES[][3] = {{0, 0, 1}, {33, 1, 1},  {1, 0, 1},   {1, 33, 1},
                                        {1, 1, 0}, {2, 3, 205}, {32, 32, 16}};
    for (size_t s = 0; s < sizeof SIZES / sizeof SIZES[0]; s++) {
        config = make_config(SIZES[s][0], SIZES[s][1], SIZES[s][2]);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, memory, 100000));
    }
    config = make_config(2, 2, 3);
    config.feedthrough = 4;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, memory, WORDS));
    config = make_config(2, 2, 3);
    config.model_set = (aeo_model_set_t)2;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, memory, WORDS));
    config = make_config(2, 2, 3);
    config.period_us = 0;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, memory, WORDS));
    for (int t = 0; t < 4; t++) {
        for (size_t at = 0; at < 4; at++) {
            aeo_real_t table[4] = {1, 1, 1, 1};
            config = make_config(2, 2, 3);
            *(t == 0 ? &config.offset : t == 1 ? &config.scale : t == 2 ? &config.minimum : &config.maximum) = table;
            table[at] = make_not_finite(t);
            TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_regressor_init(&regressor, &config, memory, WORDS));
        }
    }
    const aeo_real_t bad_scales[3] = {0, -1, AEO_REAL(1e-38)};
    for (int t = 0; t < (AEO_REAL_BYTES == 4 ? 3 : 2); t++) {
        const aeo_real_t table[4] = {1, bad_scales[t], 1, 1};
        config = make_config(2, 2, 3);
        config.scale = table;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, memory, WORDS));
    }
    const aeo_real_t low[4] = {0, 0, 3, 0}, high[4] = {1, 1, 2, 1};
    config = make_config(2, 2, 3);
    config.minimum = low;
    config.maximum = high;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_init(&regressor, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&before, &regressor, sizeof before);
}

/* A range with one end at 0 is a range; both at 0 are none. */
static void a_range_may_begin_or_end_at_zero(void)
{
    static aeo_real_t own[64];
    aeo_channel_t table[1] = {{.scale = AEO_REAL(1)}};
    const aeo_regressor_config_t config = {.outputs = 1, .past = 1, .period_us = 10, .channels = table};
    static const double ends[4][2] = {{0, 5}, {-5, 0}, {0, 0}, {-5, 5}};
    static const double values[4] = {-6, -4, 4, 6};
    for (unsigned i = 0; i < 4u; i++) {
        table[0].minimum = (aeo_real_t)ends[i][0];
        table[0].maximum = (aeo_real_t)ends[i][1];
        for (unsigned j = 0; j < 4u; j++) {
            const aeo_real_t now = (aeo_real_t)values[j];
            const int inside = i == 2u || (values[j] >= ends[i][0] && values[j] <= ends[i][1]);
            aeo_regressor_t one;
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&one, &config, own, 64));
            TEST_ASSERT_EQUAL_INT(inside ? AEO_FILLING : AEO_E_RANGE, aeo_regressor_push(&one, NULL, &now, 10));
        }
    }
}

/* What no window can be: each number one beyond its end. */
static void windows_that_cannot_be_are_noticed(void)
{
    static aeo_real_t own[256];
    const aeo_regressor_config_t config = {
        .inputs = 2, .outputs = 1, .past = 3, .model_set = AEO_VARMAX, .feedthrough = 2, .period_us = 10};
    aeo_regressor_t good, bad;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&good, &config, own, 256));
    good.filled = 3;
    good.pending = 1;
    TEST_ASSERT_TRUE(aeo_regressor_invariants_hold(&good));
    for (unsigned i = 0; i < 11u; i++) {
        bad = good;
        bad.filled = (uint16_t)(bad.filled + (i == 0u));
        bad.pending = (uint8_t)(bad.pending + (i == 1u));
        bad.period_us = i == 2u ? 0u : bad.period_us;
        bad.model_set = (uint8_t)(bad.model_set + (i == 3u));
        bad.block_length = (uint16_t)(bad.block_length + (i == 4u));
        bad.length = (uint16_t)(bad.length + (i == 5u));
        bad.feedthrough |= i == 6u ? 1u : 0u;
        const aeo_real_t kept[4] = {own[0], own[good.length - 1u], good.block[0], good.block[3]};
        own[0] = i == 7u ? AEO_REAL(1.001e6) : own[0];
        own[good.length - 1u] = i == 8u ? AEO_REAL(-1.001e6) : own[good.length - 1u];
        good.block[0] = i == 9u ? AEO_REAL(1.001e6) : good.block[0];
        good.block[3] = i == 10u ? AEO_REAL(-1.001e6) : good.block[3];
        TEST_ASSERT_FALSE(aeo_regressor_invariants_hold(&bad));
        own[0] = kept[0];
        own[good.length - 1u] = kept[1];
        good.block[0] = kept[2];
        good.block[3] = kept[3];
    }
    bad = good; /* a third model set, whose sizes agree */
    bad.model_set = 2;
    bad.block_length = 5;
    bad.length = 3 * 5 + 1;
    TEST_ASSERT_FALSE(aeo_regressor_invariants_hold(&bad));
    for (size_t i = 0; i < 12u; i++) { /* four tables of three channels */
        const aeo_real_t kept = good.offset[i];
        good.offset[i] = make_not_finite((int)(i % 4u));
        TEST_ASSERT_FALSE(aeo_regressor_invariants_hold(&good));
        good.offset[i] = kept;
    }
    TEST_ASSERT_TRUE(aeo_regressor_invariants_hold(&good));
}

static void innovation_is_judged(void)
{
    aeo_regressor_config_t config = make_config(1, 2, 2);
    start(&config);
    push(0);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_set_innovation(&regressor, e[0])); /* VARX */
    config.model_set = AEO_VARMAX;
    start(&config);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_set_innovation(&regressor, e[0])); /* no sample yet */
    push(0);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_set_innovation(&regressor, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_set_innovation(NULL, e[0]));
    for (size_t at = 0; at < 2; at++) {
        for (int kind = 0; kind < 5; kind++) {
            aeo_real_t bad[2] = {0, 0};
            bad[at] = kind < 4 ? make_not_finite(kind) : AEO_REAL(2e6);
            TEST_ASSERT_EQUAL_INT(kind < 4 ? AEO_E_NOT_FINITE : AEO_E_RANGE,
                                  aeo_regressor_set_innovation(&regressor, bad));
            TEST_ASSERT_TRUE(aeo_regressor_invariants_hold(&regressor));
        }
    }
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_push(&regressor, NULL, y[0], 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_push(&regressor, u[0], NULL, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_push(NULL, u[0], y[0], 0));
    TEST_ASSERT_FALSE(aeo_regressor_invariants_hold(NULL));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(order_is_that_of_the_paper);
    RUN_TEST(scales_and_offsets_are_applied);
    RUN_TEST(bad_samples_leave_no_trace);
    RUN_TEST(scaling_that_overflows_is_out_of_range);
    RUN_TEST(no_regressor_crosses_a_hole);
    RUN_TEST(time_tolerates_half_a_period);
    RUN_TEST(reset_is_fresh);
    RUN_TEST(words_short_are_refused);
    RUN_TEST(bad_settings_are_refused);
    RUN_TEST(a_range_may_begin_or_end_at_zero);
    RUN_TEST(windows_that_cannot_be_are_noticed);
    RUN_TEST(innovation_is_judged);
    return UNITY_END();
}
