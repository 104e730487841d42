/* Every filter without inputs, through the estimator: an autoregression of the outputs, saved, read out and announced. */
#include "aeolid/estimator.h"
#include "aeolid/markov.h"
#include "fake_bus.h"
#include "samples.h"
#include "unity.h"

#include <string.h>

enum { L = 3, P = 4, METHODS = 4, WORDS = 4000, COUNT = 600, PERIOD = 50000, N_MAX = 2 * L * P };

static const aeo_estimator_method_t method[METHODS] = {aeo_estimator_rls, aeo_estimator_els, aeo_estimator_fast_rls,
                                                       aeo_estimator_lattice};
static const aeo_channel_t channel[L] = {
    {"tower_fore_aft", "m/s2", AEO_REAL(0), AEO_REAL(0.5), AEO_REAL(0), AEO_REAL(0)},
    {"tower_side_side", NULL, AEO_REAL(0), AEO_REAL(2), AEO_REAL(0), AEO_REAL(0)},
    {"rotor_speed", "rpm", AEO_REAL(0), AEO_REAL(1), AEO_REAL(-9), AEO_REAL(9)}};

static aeo_estimator_t one, other;
static aeo_real_t memory[WORDS], twin[WORDS], saved[WORDS];
static aeo_real_t sample[COUNT][L], seen[COUNT * N_MAX], target[COUNT * L];
static uint64_t seed;

/* From rest, the first P samples 0, so that what fast filters count as 0 before the first window was so; driven by noise. */
void setUp(void)
{
    seed = 20261127u;
    set_up_bus();
    memset(sample, 0, sizeof sample);
    for (unsigned k = P; k < COUNT; k++) {
        for (unsigned i = 0; i < L; i++) {
            const aeo_real_t size = channel[i].scale, beside = channel[(i + 1u) % L].scale;
            sample[k][i] = AEO_REAL(0.9) * sample[k - 1][i] - AEO_REAL(0.5) * sample[k - 2][i] -
                           AEO_REAL(0.3) * sample[k - 1][(i + 1u) % L] * size / beside +
                           size * AEO_REAL(0.5) * (aeo_real_t)draw(&seed);
        }
    }
}

void tearDown(void)
{
    tear_down_bus();
}

static aeo_model_set_t first_set(unsigned m)
{
    return m == (unsigned)AEO_METHOD_ELS ? AEO_VARMAX : AEO_VARX;
}

/* els without schedule, start and guard: plain least squares in z. */
static aeo_estimator_config_t describe(aeo_model_set_t model_set, aeo_real_t lambda)
{
    const aeo_estimator_config_t config = {.outputs = L,
                                           .past = P,
                                           .model_set = model_set,
                                           .period_us = PERIOD,
                                           .channels = channel,
                                           .forgetting = lambda,
                                           .regularisation = AEO_REAL(1),
                                           .growth_max = AEO_REAL(100),
                                           .forgetting_start = lambda};
    return config;
}

static aeo_status_t take(aeo_estimator_t *self, unsigned k)
{
    return aeo_estimator_take(self, NULL, sample[k], (uint64_t)k * PERIOD);
}

/* ---- the law ------------------------------------------------------------------------------------------------------- */

/* With lambda = 1, theta is the batch least squares of y_k on the windows the filter saw; in VARMAX these hold the
 * residuals fed back. Measured: 13 rounding errors of unit size in float, 25 in double; the contract has 300. */
static void the_autoregression_equals_batch(void)
{
    for (unsigned e = 0; e < 2u; e++) {
        for (unsigned m = 0; m < METHODS; m++) {
            const aeo_estimator_config_t config = describe(e == 0u ? AEO_VARX : AEO_VARMAX, AEO_REAL(1));
            const size_t n = aeo_estimator_regressors(&config);
            double ridge[N_MAX], batch[L * N_MAX];
            if (e == 0u && m == (unsigned)AEO_METHOD_ELS) {
                continue;
            }
            TEST_ASSERT_EQUAL_size_t(P * L * (1u + e), n); /* past outputs alone, no place for an input */
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
            for (unsigned k = 0; k < COUNT; k++) {
                TEST_ASSERT_EQUAL_INT(k < P ? AEO_FILLING : AEO_OK, take(&one, k));
                TEST_ASSERT_TRUE(aeo_estimator_invariants_hold(&one));
                if (k >= P) {
                    memcpy(seen + (k - P) * n, aeo_regressor_z(&one.regressor), n * sizeof *seen);
                    memcpy(target + (k - P) * L, aeo_regressor_y(&one.regressor), L * sizeof *target);
                }
            }
            for (size_t j = 0; j < n; j++) {
                ridge[j] = 1.0;
            }
            solve_batch(seen, target, NULL, COUNT - P, n, L, ridge, batch);
            /* fast_rls: its recursion runs error up where nothing is forgotten (test_contract_fast_rls.c) */
            const double bound = (m == (unsigned)AEO_METHOD_FAST_RLS ? 30000.0 : 3000.0) * (double)AEO_REAL_EPSILON;
            TEST_ASSERT_TRUE(relative_distance(aeo_estimator_theta(&one), batch, n * L) < bound);
        }
    }
}

/* ---- one estimator as another ---------------------------------------------------------------------------------------- */

static void assert_same(size_t n)
{
    TEST_ASSERT_EQUAL_MEMORY(aeo_estimator_innovation(&one), aeo_estimator_innovation(&other), L * sizeof *memory);
    TEST_ASSERT_EQUAL_MEMORY(aeo_estimator_residual(&one), aeo_estimator_residual(&other), L * sizeof *memory);
    TEST_ASSERT_EQUAL_MEMORY(aeo_estimator_theta(&one), aeo_estimator_theta(&other), n * L * sizeof *memory);
}

/* Restored in the middle, it goes on bit for bit; and what stands at u, null or not, is never looked at. */
static void a_restored_estimator_goes_on_bit_for_bit(void)
{
    static const aeo_real_t unused[1] = {AEO_REAL(1e30)};
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m), AEO_REAL(0.995));
        const size_t n = aeo_estimator_regressors(&config);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&other, method[m], &config, twin, WORDS));
        for (unsigned k = 0; k < COUNT; k++) {
            if (k == COUNT / 2u) {
                const size_t length = aeo_estimator_saved_words(&one);
                TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_estimator_save(&one, saved, length - 1u));
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_save(&one, saved, length));
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_restore(&other, saved, length));
            }
            (void)take(&one, k);
            if (k >= COUNT / 2u) {
                (void)aeo_estimator_take(&other, unused, sample[k], (uint64_t)k * PERIOD);
                assert_same(n);
            }
        }
    }
}

/* ---- sizes and refusals ---------------------------------------------------------------------------------------------- */

static void words_are_those_of_the_macros(void)
{
    for (unsigned e = 0; e < 2u; e++) {
        const aeo_estimator_config_t config = describe(e == 0u ? AEO_VARX : AEO_VARMAX, AEO_REAL(1));
        const size_t expected[METHODS] = {AEO_ESTIMATOR_RLS_WORDS(0, L, P, e, 0), AEO_ESTIMATOR_ELS_WORDS(0, L, P, 0),
                                          AEO_ESTIMATOR_FAST_RLS_WORDS(0, L, P, e, 0),
                                          AEO_ESTIMATOR_LATTICE_WORDS(0, L, P, e, 0)};
        const size_t kept[METHODS] = {
            AEO_ESTIMATOR_RLS_SAVED_WORDS(0, L, P, e, 0), AEO_ESTIMATOR_ELS_SAVED_WORDS(0, L, P, 0),
            AEO_ESTIMATOR_FAST_RLS_SAVED_WORDS(0, L, P, e, 0), AEO_ESTIMATOR_LATTICE_SAVED_WORDS(0, L, P, e, 0)};
        for (unsigned m = 0; m < METHODS; m++) {
            if (e == 0u && m == (unsigned)AEO_METHOD_ELS) {
                continue;
            }
            TEST_ASSERT_EQUAL_size_t(expected[m], aeo_estimator_words(method[m], &config));
            TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_estimator_init(&one, method[m], &config, memory, expected[m] - 1u));
            memory[expected[m]] = AEO_REAL(7);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, expected[m]));
            TEST_ASSERT_EQUAL_size_t(kept[m], aeo_estimator_saved_words(&one));
            for (unsigned k = 0; k < 50u; k++) {
                (void)take(&one, k);
            }
            TEST_ASSERT_TRUE(memory[expected[m]] >= AEO_REAL(7)); /* the word behind is nobody's */
        }
    }
}

/* Nothing at all, and a feedthrough of what is not there; a missing y and bad values stay refusals. */
static void what_cannot_be_is_refused(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        aeo_estimator_config_t config = describe(first_set(m), AEO_REAL(1));
        aeo_real_t bad[L] = {0};
        config.outputs = 0;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        config.outputs = L;
        config.feedthrough = 1;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        config.feedthrough = 0;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_take(&one, NULL, NULL, 0));
        bad[1] = make_not_finite(0);
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_estimator_take(&one, NULL, bad, 0));
        bad[1] = 0;
        bad[2] = 10;
        TEST_ASSERT_EQUAL_INT(AEO_E_RANGE, aeo_estimator_take(&one, NULL, bad, 0));
        TEST_ASSERT_EQUAL_UINT32(0, aeo_estimator_count(&one, AEO_COUNT_SAMPLES));
    }
}

/* ---- read-out and stream --------------------------------------------------------------------------------------------- */

/* Column j belongs to an output (or its innovation), and scales are undone between outputs. */
static void parameters_have_no_column_of_an_input(void)
{
    static aeo_real_t markov[L * N_MAX];
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m), AEO_REAL(1));
        const unsigned n = (unsigned)aeo_estimator_regressors(&config), block = n / P;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        for (unsigned k = 0; k < COUNT; k++) {
            (void)take(&one, k);
        }
        const aeo_real_t *const theta_now = aeo_estimator_theta(&one);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_markov_read(&one.regressor, theta_now, markov, (size_t)L * n));
        for (unsigned j = 0; j < n; j++) {
            TEST_ASSERT_EQUAL_INT((int)(j % block), aeo_markov_channel(&one.regressor, (uint16_t)j));
            for (unsigned i = 0; i < L; i++) { /* scales are powers of two: exact */
                const aeo_real_t expected = theta_now[i * n + j] * channel[i].scale / channel[j % block % L].scale;
                TEST_ASSERT_EQUAL_MEMORY(&expected, &markov[i * n + j], sizeof expected);
            }
        }
        TEST_ASSERT_EQUAL_INT(-1, aeo_markov_channel(&one.regressor, (uint16_t)n));
    }
}

/* The value of a description item. */
static uint32_t find_item(aeo_item_t item)
{
    for (unsigned i = 0; i < fake.kept; i++) {
        const aeo_message_t message = message_at(i);
        if (message.kind == AEO_KIND_DESCRIPTION && message.tag == (uint8_t)item) {
            return message.value[0];
        }
    }
    TEST_FAIL_MESSAGE("the item is not described");
    return 0;
}

static void a_stream_tells_outputs_alone(void)
{
    const aeo_stream_config_t bus = {.address = {AEO_FRAME_BASE_EXTENDED, 5, 1},
                                     .sample_every = 1,
                                     .health_every = 10,
                                     .describe_every = 600,
                                     .burst = 16};
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m), AEO_REAL(1));
        const uint32_t n = (uint32_t)aeo_estimator_regressors(&config);
        unsigned samples = 0;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_announce(&one, &stream, &bus, &port, words, PARAMETERS_MAX));
        fake.kept = 0;
        step_until_idle();
        TEST_ASSERT_EQUAL_HEX32(0x01000000u + (L << 8), find_item(AEO_ITEM_SHAPE));
        TEST_ASSERT_EQUAL_UINT32(L * n, find_item(AEO_ITEM_PARAMETERS));
        TEST_ASSERT_EQUAL_UINT32(0, find_item(AEO_ITEM_FEEDTHROUGH));
        fake.kept = 0;
        for (unsigned k = 0; k < 20u; k++) {
            TEST_ASSERT_EQUAL_INT(k < P ? AEO_FILLING : AEO_OK,
                                  aeo_estimator_send(&one, &stream, k, NULL, sample[k], NULL, (uint64_t)k * PERIOD));
        }
        for (unsigned i = 0; i < fake.kept; i++) {
            const aeo_message_t message = message_at(i);
            if (message.kind == AEO_KIND_SAMPLE) {
                TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(sample[message.index][message.tag]), message.value[0]);
                samples++;
            }
        }
        TEST_ASSERT_EQUAL_UINT(20u * L, samples);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_snapshot(&one, &stream, 19));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(the_autoregression_equals_batch);
    RUN_TEST(a_restored_estimator_goes_on_bit_for_bit);
    RUN_TEST(words_are_those_of_the_macros);
    RUN_TEST(what_cannot_be_is_refused);
    RUN_TEST(parameters_have_no_column_of_an_input);
    RUN_TEST(a_stream_tells_outputs_alone);
    return UNITY_END();
}
