/* What is particular to the square-root RLS: its gate, its bound, its settings, its saved form. */
#include "aeolid/rls.h"
#include "linalg.h"
#include "samples.h"
#include "saved.h"
#include "strips.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { N = 6, L = 2, WORDS = AEO_RLS_WORDS(N, L), SAVED = AEO_RLS_SAVED_WORDS(N, L) };

static aeo_rls_t rls;
static aeo_real_t memory[WORDS];
static aeo_real_t z[N], y[L];
static uint64_t seed = 7;

void setUp(void)
{
}

void tearDown(void)
{
}

static aeo_rls_config_t make_config(double lambda, double gate, double growth)
{
    const aeo_rls_config_t config = {N, L, (aeo_real_t)lambda, AEO_REAL(1), (aeo_real_t)gate, (aeo_real_t)growth};
    return config;
}

static void start(double lambda, double gate, double growth)
{
    const aeo_rls_config_t config = make_config(lambda, gate, growth);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, WORDS));
}

/* y = sums of z, so that theta has a known answer of ones and minus ones */
static void feed(double amplitude)
{
    fill(z, N, &seed);
    y[0] = y[1] = AEO_REAL(0);
    for (size_t j = 0; j < N; j++) {
        z[j] = (aeo_real_t)((double)z[j] * amplitude);
        y[0] += z[j];
        y[1] -= z[j];
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
    TEST_ASSERT_TRUE(aeo_rls_invariants_hold(&rls));
}

static double variance(size_t i)
{
    return (double)aeo_strips_norm2(rls.factor, N, i);
}

static void words_are_known_at_compile_time(void)
{
    TEST_ASSERT_EQUAL_UINT(1491, AEO_RLS_WORDS(44, 4));
    TEST_ASSERT_EQUAL_UINT(9091, AEO_RLS_WORDS(124, 4));
}

static void covariance_matches_the_conventional_recursion(void)
{
    double p[N][N] = {{0}};
    const double lambda = (double)AEO_REAL(0.97);
    for (size_t i = 0; i < N; i++) {
        p[i][i] = 1.0;
    }
    start(0.97, 0, 1e6);
    for (int k = 0; k < 300; k++) {
        double pz[N] = {0}, news = lambda;
        feed(1.0);
        for (size_t i = 0; i < N; i++) {
            for (size_t j = 0; j < N; j++) {
                pz[i] += p[i][j] * (double)z[j];
            }
            news += (double)z[i] * pz[i];
        }
        for (size_t i = 0; i < N; i++) {
            for (size_t j = 0; j < N; j++) {
                p[i][j] = (p[i][j] - pz[i] * pz[j] / news) / lambda;
            }
        }
        for (size_t i = 0; i < N; i++) {
            TEST_ASSERT_TRUE(fabs(variance(i) - p[i][i]) < 200.0 * (double)AEO_REAL_EPSILON * p[i][i]);
        }
    }
}

static void quiet_samples_do_not_forget(void)
{
    start(0.99, 0.05, 1000);
    for (int k = 0; k < 1000; k++) {
        feed(1.0);
    }
    TEST_ASSERT_EQUAL_UINT32(0, aeo_rls_health(&rls));
    aeo_real_t theta[N * L], before[N];
    memcpy(theta, aeo_rls_theta(&rls), sizeof theta);
    for (size_t i = 0; i < N; i++) {
        before[i] = (aeo_real_t)variance(i);
    }
    memset(z, 0, sizeof z);
    memset(y, 0, sizeof y);
    for (int k = 0; k < 100000; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
    }
    TEST_ASSERT_EQUAL_MEMORY(theta, aeo_rls_theta(&rls), sizeof theta);
    for (size_t i = 0; i < N; i++) {
        const aeo_real_t after = (aeo_real_t)variance(i);
        TEST_ASSERT_EQUAL_MEMORY(&before[i], &after, sizeof after);
    }
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_WITHHELD, aeo_rls_health(&rls));
    TEST_ASSERT_EQUAL_UINT32(100000, rls.count.withheld);
}

static void without_the_gate_variances_stay_bounded(void)
{
    /* one direction excited, the others never: P must not grow for ever and the excited one must go on forgetting */
    start(0.99, 0, 100);
    double largest = 0.0;
    for (int k = 0; k < 50000; k++) {
        memset(z, 0, sizeof z);
        z[2] = (aeo_real_t)draw(&seed);
        y[0] = y[1] = (k < 40000 ? 1 : -1) * z[2];
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
        for (size_t i = 0; i < N; i++) {
            largest = variance(i) > largest ? variance(i) : largest;
        }
    }
    TEST_ASSERT_TRUE(largest <= 200.0); /* twice growth_max / rho, the proven bound */
    TEST_ASSERT_TRUE(largest > 50.0);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_BOUNDED, aeo_rls_health(&rls));
    TEST_ASSERT_TRUE(rls.count.bounded > 100);
    TEST_ASSERT_TRUE(fabs((double)aeo_rls_theta(&rls)[2] + 1.0) < 1e-3);
}

static void rounding_does_not_inflate_the_covariance(void)
{
    /* collinear regressors, lambda = 1: along the difference of the first two nothing is ever learnt or forgotten, so
     * their variance tends to half of 1 / rho = 1 from above and must not creep up again */
    start(1, 0, 1e6);
    double lowest = 1.0;
    for (int k = 0; k < 300000; k++) {
        fill(z, N, &seed);
        z[1] = z[0];
        y[0] = y[1] = z[0];
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
        lowest = variance(0) < lowest ? variance(0) : lowest;
    }
    TEST_ASSERT_TRUE(lowest > 0.499 && variance(0) < lowest * 1.001);
}

static void bounding_leaves_theta_alone(void)
{
    /* same samples with a tight and with a loose bound: until the next sample that matters, theta is the same bits */
    start(0.9, 0, 1e6);
    for (int k = 0; k < 50; k++) {
        feed(1.0);
    }
    aeo_real_t theta[N * L];
    memcpy(theta, aeo_rls_theta(&rls), sizeof theta);
    rls.variance_max = AEO_REAL(1e-4);
    memset(z, 0, sizeof z);
    memset(y, 0, sizeof y);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
    TEST_ASSERT_TRUE(rls.count.bounded > 0);
    TEST_ASSERT_EQUAL_MEMORY(theta, aeo_rls_theta(&rls), sizeof theta);
}

static void runaway_starts_afresh(void)
{
    start(1.0, 0, 1000);
    for (int k = 0; k < 100; k++) {
        feed(1.0);
    }
    rls.theta[0] = AEO_REAL(1e20); /* as a flipped bit would */
    feed(1.0);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_REINITIALISED, aeo_rls_health(&rls));
    TEST_ASSERT_EQUAL_UINT32(1, rls.count.reinitialised);
    for (int k = 0; k < 2000; k++) {
        feed(1.0);
    }
    for (size_t j = 0; j < N; j++) {
        TEST_ASSERT_TRUE(fabs((double)aeo_rls_theta(&rls)[j] - 1.0) < 1e-2);
        TEST_ASSERT_TRUE(fabs((double)aeo_rls_theta(&rls)[N + j] + 1.0) < 1e-2);
    }
}

static void lambda_can_change_between_samples(void)
{
    /* weight of sample i: the product of the lambdas of all later ones; the batch solution knows no recursion */
    enum { SAMPLES = 60 };
    static aeo_real_t all_z[SAMPLES * N], all_y[SAMPLES * L];
    static double weight[SAMPLES], ridge[N], batch[L * N];
    double product = 1.0;
    start(1, 0, 1e6);
    for (int k = 0; k < SAMPLES; k++) {
        const aeo_real_t lambda = (aeo_real_t)(0.9 + 0.1 * k / SAMPLES);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_set_forgetting(&rls, lambda));
        fill(z, N, &seed);
        fill(y, L, &seed);
        memcpy(all_z + k * N, z, sizeof z);
        memcpy(all_y + k * L, y, sizeof y);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
        for (int i = 0; i < k; i++) {
            weight[i] *= (double)lambda;
        }
        weight[k] = 1.0;
        product *= (double)lambda;
    }
    for (size_t j = 0; j < N; j++) {
        ridge[j] = product;
    }
    solve_batch(all_z, all_y, weight, SAMPLES, N, L, ridge, batch);
    TEST_ASSERT_TRUE(relative_distance(aeo_rls_theta(&rls), batch, N * L) < 300.0 * (double)AEO_REAL_EPSILON);
    const aeo_rls_t before = rls;
    static const double BAD[3] = {0.49, 1.01, -1.0};
    for (int t = 0; t < 3; t++) {
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_set_forgetting(&rls, (aeo_real_t)BAD[t]));
    }
    for (int t = 0; t < 4; t++) {
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_rls_set_forgetting(&rls, make_not_finite(t)));
    }
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_set_forgetting(NULL, AEO_REAL(1)));
    TEST_ASSERT_EQUAL_MEMORY(&before, &rls, sizeof rls);
}

static void a_filter_set_like_init_is_the_same(void)
{
    /* gate, scan and root follow lambda: set to 0.97 it does what a filter initialised with 0.97 does, to the bit */
    static aeo_real_t other_memory[WORDS];
    aeo_rls_t other;
    const aeo_rls_config_t config = make_config(0.97, 0.2, 4);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&other, &config, other_memory, WORDS));
    start(0.999, 0.2, 4);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_set_forgetting(&rls, AEO_REAL(0.97)));
    for (int k = 0; k < 500; k++) {
        fill(z, N, &seed);
        fill(y, L, &seed);
        for (size_t j = 0; j < N; j++) {
            z[j] *= j == 5 ? AEO_REAL(0) : k % 3 == 0 ? AEO_REAL(0.01) : AEO_REAL(1); /* for bound and gate */
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&other, z, y));
    }
    TEST_ASSERT_EQUAL_MEMORY(memory, other_memory, sizeof memory);
    TEST_ASSERT_EQUAL_MEMORY(&rls.count, &other.count, sizeof rls.count);
    TEST_ASSERT_TRUE(rls.count.withheld > 0u && rls.count.bounded > 0u);
}

static void a_start_is_a_prior(void)
{
    /* from theta_0 on data y equals theta_0 plus what is found from 0 on y - theta_0 z */
    aeo_real_t prior[N * L], found[N * L];
    double expected[N * L];
    fill(prior, N * L, &seed);
    for (int late = 0; late < 2; late++) {
        uint64_t same = 99;
        start(0.99, 0, 1e6);
        if (late) {
            feed(1.0); /* whatever was known before is gone */
            const aeo_real_t last = aeo_rls_innovation(&rls)[1];
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_start(&rls, prior));
            TEST_ASSERT_EQUAL_MEMORY(prior, aeo_rls_theta(&rls), sizeof prior);
            TEST_ASSERT_EQUAL_MEMORY(&last, &aeo_rls_innovation(&rls)[1], sizeof last);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_start(&rls, aeo_rls_theta(&rls))); /* its own is allowed */
        }
        for (int k = 0; k < 4; k++) { /* fewer samples than parameters: the prior matters */
            fill(z, N, &same);
            fill(y, L, &same);
            for (size_t i = 0; i < N * L && !late; i++) {
                y[i / N] -= prior[i] * z[i % N];
            }
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_read(&rls, found, N * L));
        for (size_t i = 0; i < N * L && !late; i++) {
            expected[i] = (double)found[i] + (double)prior[i];
        }
    }
    TEST_ASSERT_TRUE(relative_distance(found, expected, N * L) < 100.0 * (double)AEO_REAL_EPSILON);
    const aeo_rls_t before = rls;
    prior[3] = make_not_finite(2);
    TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_rls_start(&rls, prior));
    prior[3] = AEO_REAL(-1.1e6);
    TEST_ASSERT_EQUAL_INT(AEO_E_RANGE, aeo_rls_start(&rls, prior));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_start(&rls, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_start(NULL, prior));
    TEST_ASSERT_EQUAL_MEMORY(&before, &rls, sizeof rls);
    TEST_ASSERT_EQUAL_MEMORY(found, aeo_rls_theta(&rls), sizeof found);
}

static void settings_out_of_range_are_refused(void)
{
    static const double BAD[][4] = {{0.49, 1, 0, 4},   {1.01, 1, 0, 4}, {1, 0.9e-8, 0, 4}, {1, 1.1e8, 0, 4},
                                    {1, 1, -0.1, 4},   {1, 1, 1.1, 4},  {1, 1, 0, 3.9},    {1, 1, 0, 1.1e6},
                                    {1, 1e-8, 0, 200}, {0, 1, 0, 4},    {-1.0, 1, 0, 4},   {1, 0, 0, 4},
                                    {1, -1, 0, 4}};
    const aeo_rls_t untouched = rls;
    for (size_t t = 0; t < sizeof BAD / sizeof BAD[0]; t++) {
        aeo_rls_config_t config = make_config(BAD[t][0], BAD[t][2], BAD[t][3]);
        config.regularisation = (aeo_real_t)BAD[t][1];
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_init(&rls, &config, memory, WORDS));
    }
    for (int t = 0; t < 16; t++) {
        aeo_rls_config_t config = make_config(1, 0, 4);
        aeo_real_t *const fields[4] = {&config.forgetting, &config.regularisation, &config.excitation_min,
                                       &config.growth_max};
        *fields[t / 4] = make_not_finite(t % 4);
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_rls_init(&rls, &config, memory, WORDS));
    }
    aeo_rls_config_t config = make_config(1, 0, 4);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_init(NULL, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_init(&rls, NULL, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_init(&rls, &config, NULL, WORDS));
    static const uint16_t SIZES[][2] = {{0, 1}, {1025, 1}, {1, 0}, {1, 33}, {65535, 1}, {1, 65535}};
    for (size_t t = 0; t < sizeof SIZES / sizeof SIZES[0]; t++) {
        config.regressors = SIZES[t][0];
        config.outputs = SIZES[t][1];
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_rls_init(&rls, &config, memory, WORDS));
    }
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &rls, sizeof rls);
    start(0.99, 0.05, 1000);
    feed(1.0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &rls.config, memory, WORDS)); /* its own, once more */
    TEST_ASSERT_TRUE(rls.config.regressors == N && rls.count.updates == 0u && aeo_rls_invariants_hold(&rls));
}

/* Restore an array that was tampered with, under a seal of its own: the seal is not the only judge. */
static aeo_status_t restore_sealed(aeo_real_t *words)
{
    aeo_saved_seal(words, SAVED);
    return aeo_rls_restore(&rls, words, SAVED);
}

static void restore_names_what_is_wrong(void)
{
    static aeo_real_t saved[SAVED];
    start(0.99, 0.05, 1000);
    feed(1.0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_save(&rls, saved, SAVED));
    static const aeo_status_t HEAD[8] = {AEO_E_VERSION,  AEO_E_MISMATCH, AEO_E_MISMATCH, AEO_E_MISMATCH,
                                         AEO_E_MISMATCH, AEO_E_MISMATCH, AEO_E_MISMATCH, AEO_E_MISMATCH};
    const aeo_rls_t before = rls;
    for (size_t i = 0; i < AEO_RLS_SAVED_HEAD; i++) { /* head, then health, counters, scan row and watch in halves */
        const aeo_real_t wrong[3] = {saved[i] + AEO_REAL(0.5), AEO_REAL(-1), AEO_REAL(65536)};
        for (int t = 0; t < 3; t++) {
            const aeo_real_t good = saved[i];
            saved[i] = wrong[t];
            TEST_ASSERT_EQUAL_INT(i < 8 ? HEAD[i] : AEO_E_DAMAGED, restore_sealed(saved));
            saved[i] = good;
            TEST_ASSERT_EQUAL_MEMORY(&before, &rls, sizeof rls);
        }
    }
    saved[23] = N; /* scan row at n */
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_sealed(saved));
    saved[23] = 0;
    /* before the first diagonal entry of the factor, which stands in row 2 of its strip, are zeros */
    const aeo_real_t good[3] = {saved[AEO_RLS_SAVED_HEAD], saved[AEO_RLS_SAVED_HEAD + 1],
                                saved[AEO_RLS_SAVED_HEAD + 2]};
    const aeo_real_t wrong[3] = {AEO_REAL(1e-3), AEO_REAL(-1e-3), AEO_REAL(0)};
    for (size_t i = 0; i < 3; i++) {
        saved[AEO_RLS_SAVED_HEAD + i] = wrong[i];
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_sealed(saved));
        saved[AEO_RLS_SAVED_HEAD + i] = good[i];
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, restore_sealed(saved));
}

static void saved_head_is_counted_right(void)
{
    /* the formula, the writer and this test agree: the factor starts right after the head */
    static aeo_real_t saved[SAVED];
    start(1, 0, 4);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_save(&rls, saved, SAVED));
    TEST_ASSERT_EQUAL_MEMORY(rls.factor, saved + AEO_RLS_SAVED_HEAD, sizeof *saved * AEO_RLS_FACTOR_WORDS(N));
}

static void health_is_sticky_until_cleared(void)
{
    start(0.99, 0.9, 1000);
    feed(1e-6);
    feed(1.0);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_WITHHELD, aeo_rls_health(&rls));
    aeo_rls_reset(&rls);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_WITHHELD, aeo_rls_health(&rls));
    aeo_rls_clear_health(&rls);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_rls_health(&rls));
    TEST_ASSERT_TRUE(rls.count.withheld >= 1);
    rls.count.updates = UINT32_MAX;
    feed(1.0);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, rls.count.updates); /* never decreases */
    aeo_rls_reset(NULL);
    aeo_rls_clear_health(NULL);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_rls_health(NULL));
    TEST_ASSERT_FALSE(aeo_rls_invariants_hold(NULL));
}

static void invariants_notice_damage(void)
{
    start(0.99, 0, 100);
    feed(1.0);
    aeo_real_t *const diagonal = rls.factor + aeo_strips_pad(N);
    const aeo_real_t good = *diagonal;
    *diagonal = AEO_REAL(0);
    TEST_ASSERT_FALSE(aeo_rls_invariants_hold(&rls));
    *diagonal = make_not_finite(0);
    TEST_ASSERT_FALSE(aeo_rls_invariants_hold(&rls));
    *diagonal = AEO_REAL(21); /* variance 441 > 4 * 100 */
    TEST_ASSERT_FALSE(aeo_rls_invariants_hold(&rls));
    *diagonal = good;
    for (size_t above = 1; above <= aeo_strips_pad(N); above++) { /* zeros of the strip, not S */
        diagonal[-(int)above] = AEO_REAL(1e-3);
        TEST_ASSERT_FALSE(aeo_rls_invariants_hold(&rls));
        diagonal[-(int)above] = AEO_REAL(0);
    }
    TEST_ASSERT_TRUE(aeo_rls_invariants_hold(&rls));
    rls.theta[3] = make_not_finite(2);
    TEST_ASSERT_FALSE(aeo_rls_invariants_hold(&rls));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(words_are_known_at_compile_time);
    RUN_TEST(covariance_matches_the_conventional_recursion);
    RUN_TEST(quiet_samples_do_not_forget);
    RUN_TEST(without_the_gate_variances_stay_bounded);
    RUN_TEST(rounding_does_not_inflate_the_covariance);
    RUN_TEST(bounding_leaves_theta_alone);
    RUN_TEST(runaway_starts_afresh);
    RUN_TEST(lambda_can_change_between_samples);
    RUN_TEST(a_filter_set_like_init_is_the_same);
    RUN_TEST(a_start_is_a_prior);
    RUN_TEST(settings_out_of_range_are_refused);
    RUN_TEST(restore_names_what_is_wrong);
    RUN_TEST(saved_head_is_counted_right);
    RUN_TEST(health_is_sticky_until_cleared);
    RUN_TEST(invariants_notice_damage);
    return UNITY_END();
}
