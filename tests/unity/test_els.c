/* What extended least squares estimates: its schedule, its start, its guard, what it bears. */
#include "els_bench.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

void setUp(void)
{
    reset_bench();
}

void tearDown(void)
{
}

static void words_are_known_at_compile_time(void)
{
    TEST_ASSERT_EQUAL_UINT(4030, AEO_ELS_WORDS(80, 3));
    TEST_ASSERT_EQUAL_UINT(31230, AEO_ELS_WORDS(240, 3));
}

static void schedule_follows_its_equation(void)
{
    aeo_els_config_t config = make_els_config(2);
    config.forgetting = AEO_REAL(0.999);
    start(&config);
    set_plant(0.5, 1, 0.3);
    run(2); /* filling */
    double lambda = (double)config.forgetting_start;
    for (int k = 0; k < 2000; k++) {
        TEST_ASSERT_TRUE(fabs((double)els.rls.config.forgetting - lambda) < 100.0 * (double)AEO_REAL_EPSILON);
        run(1);
        lambda = (double)config.forgetting_rate * lambda +
                 (1.0 - (double)config.forgetting_rate) * (double)config.forgetting;
    }
    /* the end is reached to the bit, however slowly: what is rounded is the distance from it */
    run(3000);
    TEST_ASSERT_EQUAL_MEMORY(&config.forgetting, &els.rls.config.forgetting, sizeof config.forgetting);
    TEST_ASSERT_TRUE(!(els.shortfall > 0)); /* and from then on nothing is spent on it */
}

static void the_yardstick_is_the_second_half_of_the_start(void)
{
    aeo_els_config_t config = make_els_config(2);
    double sum = 0.0;
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(2 + 100);
    for (int k = 0; k < 100; k++) {
        run(1);
        sum += (double)aeo_els_innovation(&els)[0] * (double)aeo_els_innovation(&els)[0];
    }
    const double level = sum / 100.0;
    run(1);
    TEST_ASSERT_TRUE(fabs((double)els.levels[2] - level) < 100.0 * (double)AEO_REAL_EPSILON * level);
}

static void start_is_varx(void)
{
    /* until varx_samples are over, e is 0 throughout and theta is what an RLS of u and y alone finds */
    static aeo_real_t other_memory[AEO_RLS_WORDS(4, 1)];
    aeo_els_config_t config = make_els_config(2);
    config.forgetting_start = config.forgetting = AEO_REAL(0.99);
    start(&config);
    set_plant(0.5, 1, 0.3);
    const aeo_rls_config_t inner = {4, 1, AEO_REAL(0.99), AEO_REAL(0.1), AEO_REAL(0.05), AEO_REAL(10)};
    aeo_rls_t varx;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&varx, &inner, other_memory, AEO_RLS_WORDS(4, 1)));
    run(2);
    for (int k = 0; k < 200; k++) {
        run(1);
        const aeo_real_t *z = aeo_regressor_z(&regressor);
        const aeo_real_t short_z[4] = {z[0], z[1], z[3], z[4]};
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&varx, short_z, aeo_regressor_y(&regressor)));
        TEST_ASSERT_TRUE(!(aeo_els_feedback(&els)[0] > 0 || aeo_els_feedback(&els)[0] < 0));
        for (size_t j = 0; j < 4; j++) {
            TEST_ASSERT_TRUE(fabs((double)(aeo_els_theta(&els)[j + j / 2] - aeo_rls_theta(&varx)[j])) <
                             300.0 * (double)AEO_REAL_EPSILON);
        }
        TEST_ASSERT_TRUE(!(aeo_els_theta(&els)[2] > 0 || aeo_els_theta(&els)[2] < 0));
    }
    run(1);
    TEST_ASSERT_EQUAL_MEMORY(aeo_els_residual(&els), aeo_els_feedback(&els), sizeof(aeo_real_t));
    TEST_ASSERT_TRUE(aeo_els_residual(&els)[0] > 0 || aeo_els_residual(&els)[0] < 0);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_els_health(&els));
}

static void parameters_are_found(void)
{
    /* ARMAX with C = 1 + 0.5 z^-1 (the positive-real condition holds): y_k = 0.5 y_{k-1} + u_{k-1} + e_k + 0.5 e_{k-1}.
     * An efficient estimator's variance of the MA term is (1 - 0.25) / N and that of the others smaller; ELS is given
     * six standard deviations for its own inefficiency. VARX of the same length is off by its bias. */
    const double truth[3] = {1.0, 0.5, 0.5}; /* u, y, e */
    aeo_els_config_t config = make_els_config(1);
    set_plant(0.5, 1, 0.25);
    start(&config);
    run(20000);
    for (size_t j = 0; j < 3; j++) {
        const double theta = (double)aeo_els_theta(&els)[j] * (j == 0 ? 4.0 : 1.0); /* y is scaled by 1/4 */
        TEST_ASSERT_TRUE(fabs(theta - truth[j]) < 6.0 * sqrt(0.75 / 20000.0) * (j == 0 ? 2.0 : 1.0));
    }
    config.varx_samples = AEO_ELS_VARX_SAMPLES_MAX;
    set_plant(0.5, 1, 0.25);
    start(&config);
    run(20000);
    TEST_ASSERT_TRUE(fabs((double)aeo_els_theta(&els)[1] - 0.5) > 0.05);
    TEST_ASSERT_EQUAL_UINT32(0, els.count.fell_back);
}

static void bursts_are_bounded(void)
{
    /* H = (1 + 0.95 z^-1)^5, Re 1/H down to -1e6, violates condition (25): without the guard innovations burst to more
     * than 20 times the worst that VARX does in any 64 samples; with it the worst stays below 10 times, and the mean
     * below that of VARX. Worst seen over 24 seeds and systems: 6.5 times. */
    double plain_worst = 0.0;
    uint32_t falls = 0;
    for (unsigned t = 1; t <= 3; t++) {
        double mean[3], worst[3];
        for (int kind = 0; kind < 3; kind++) { /* VARX, plain, guarded */
            seed = 977 * t;
            set_plant(0.95, 5, 0.09);
            aeo_els_config_t config = make_els_config(5);
            config.varx_samples = kind == 0 ? AEO_ELS_VARX_SAMPLES_MAX : 200;
            config.guard_ratio = kind == 2 ? config.guard_ratio : AEO_REAL(0);
            start(&config);
            run(2000);
            mean[kind] = measure(40000, &worst[kind]);
        }
        TEST_ASSERT_TRUE(worst[2] < 10.0 * worst[0]);
        TEST_ASSERT_TRUE(mean[2] < mean[0]);
        plain_worst = worst[1] / worst[0] > plain_worst ? worst[1] / worst[0] : plain_worst;
        falls += els.count.fell_back;
    }
    TEST_ASSERT_TRUE(plain_worst > 20.0);
    TEST_ASSERT_TRUE(falls >= 1);
    TEST_ASSERT_EQUAL_UINT32(AEO_ELS_FELL_BACK, aeo_els_health(&els) & AEO_ELS_FELL_BACK);
}

/* Let 1/H explode: the zero of H to -1.3, as a flipped bit might, with P so small that nothing is learnt from it. */
static void break_moving_average(void)
{
    for (size_t i = 0; i < AEO_RLS_FACTOR_WORDS(els.config.regressors); i++) {
        els.rls.factor[i] *= AEO_REAL(1e-6);
    }
    els.rls.theta[els.config.regressors - 1u] = AEO_REAL(1.3);
}

static void divergence_falls_back(void)
{
    const aeo_els_config_t config = make_els_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(3000);
    double worst;
    const double sound = measure(2000, &worst);
    break_moving_average();
    for (int k = 0; k < 200 && els.count.fell_back == 0u; k++) {
        run(1);
        const double level = sound * plant.scale * plant.scale * 1.7 * 1.7 / 3.0;
        TEST_ASSERT_TRUE(fabs((double)aeo_els_feedback(&els)[0]) < 6.0 * 1.5 * sqrt(level));
    }
    TEST_ASSERT_EQUAL_UINT32(1, els.count.fell_back);
    TEST_ASSERT_TRUE((aeo_els_health(&els) & AEO_ELS_FELL_BACK) != 0u);
    TEST_ASSERT_TRUE((aeo_els_health(&els) & AEO_ELS_LIMITED) != 0u);
    for (size_t j = 0; j < 6; j++) { /* the columns of e are 0, the others are not */
        const aeo_real_t entry = aeo_els_theta(&els)[j];
        TEST_ASSERT_EQUAL_INT(j % 3 != 2, entry > 0 || entry < 0);
    }
    TEST_ASSERT_TRUE(!(aeo_els_feedback(&els)[0] > 0 || aeo_els_feedback(&els)[0] < 0));
    TEST_ASSERT_EQUAL_MEMORY(&config.forgetting_start, &els.rls.config.forgetting, sizeof(aeo_real_t));
    run(3000);
    TEST_ASSERT_TRUE(measure(2000, &worst) < 1.1 * sound);
    TEST_ASSERT_EQUAL_UINT32(1, els.count.fell_back);
}

static void starts_lengthen_while_it_diverges_and_not_after(void)
{
    const aeo_els_config_t config = make_els_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(2);
    uint32_t expected = 200;
    for (unsigned falls = 1; falls <= 9; falls++) {
        TEST_ASSERT_EQUAL_UINT32(expected, els.wait);
        run(els.wait + 1);
        break_moving_average();
        for (int k = 0; k < 300 && els.count.fell_back < falls; k++) {
            run(1);
        }
        TEST_ASSERT_EQUAL_UINT32(falls, els.count.fell_back);
        expected = expected < 200u * 64u ? 2u * expected : expected;
    }
    run(17u * els.wait);
    break_moving_average();
    run(300);
    TEST_ASSERT_EQUAL_UINT32(10, els.count.fell_back);
    TEST_ASSERT_EQUAL_UINT32(200, els.wait);
}

static void livelier_data_and_outliers_are_no_divergence(void)
{
    const aeo_els_config_t config = make_els_config(3);
    set_plant(0.8, 3, 0.1);
    start(&config);
    run(6000);
    const uint32_t before = els.count.fell_back; /* this plant may burst while it is learnt */
    plant.noise = 5.0;
    run(2000);
    plant.noise = 0.2;
    run(2000);
    plant.noise = 1.0;
    for (int k = 0; k < 10; k++) { /* the output jumps by 30 deviations of its noise for one sample */
        const double scale = plant.scale;
        plant.scale *= 10.0;
        run(1);
        plant.scale = scale;
        run(300);
    }
    TEST_ASSERT_EQUAL_UINT32(before, els.count.fell_back);
    TEST_ASSERT_TRUE(els.count.limited > 0u);
}

static void rough_treatment_is_survived(void)
{
    /* silence, the edge of the range, one sample for ever, NaN, gaps, noise alone: sound after every sample, and after
     * the longest start there is it predicts again as well as ever */
    aeo_els_config_t config = make_els_config(2);
    config.forgetting = AEO_REAL(0.995);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(2000);
    double worst;
    const double sound = measure(4000, &worst);
    for (unsigned k = 0; k < 12000; k++) {
        const unsigned mode = k / 400 % 6;
        aeo_real_t u = (aeo_real_t)draw(&seed), y = (aeo_real_t)draw(&seed);
        if (mode < 3) {
            u = y = AEO_REAL(mode == 0 ? 0 : mode == 1 ? (k % 7 != 0 ? 1e6 : -1e6) : 0.3);
        }
        y = mode == 3 ? make_not_finite((int)(k % 4)) : y;
        time_us += mode == 4 && k % 50 == 0 ? 5000 : 1000;
        aeo_els_step(&els, &regressor, &u, &y, time_us);
        TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
    }
    aeo_regressor_reset(&regressor);
    run(64u * config.varx_samples + 4000u);
    TEST_ASSERT_TRUE(measure(4000, &worst) < 1.1 * sound);
}

static void innovations_of_low_rank_are_borne(void)
{
    /* three outputs that two noises reach, lambda = 0.99 kept: the case in which the conventional form loses P */
    enum { P = 2, N = P * 7 };
    static aeo_real_t wide_memory[AEO_ELS_WORDS(N, 3)], wide_window[AEO_REGRESSOR_WORDS(1, 3, P, 1)];
    aeo_els_config_t config = make_els_config(P);
    config.regressors = N;
    config.outputs = 3;
    config.forgetting = AEO_REAL(0.99);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, wide_memory, AEO_ELS_WORDS(N, 3)));
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = 3, .past = P, .model_set = AEO_VARMAX, .period_us = 1000};
    TEST_ASSERT_EQUAL_INT(
        AEO_OK, aeo_regressor_init(&regressor, &layout, wide_window, sizeof wide_window / sizeof *wide_window));
    double a = 0.0, b = 0.0, sum = 0.0;
    for (uint64_t k = 1; k <= 50000; k++) {
        const double u = draw(&seed), first = draw(&seed), second = draw(&seed);
        const aeo_real_t y[3] = {(aeo_real_t)(a + first), (aeo_real_t)(b + second),
                                 (aeo_real_t)(a - b + first - second)};
        const aeo_real_t input = (aeo_real_t)u;
        a = 0.8 * a + 0.3 * b + u + 0.4 * first;
        b = 0.7 * b - 0.3 * a + 0.5 * second;
        TEST_ASSERT_TRUE(aeo_els_step(&els, &regressor, &input, y, 1000 * k) >= AEO_OK);
        TEST_ASSERT_TRUE(k % 100 != 0 || aeo_els_invariants_hold(&els));
        for (int i = 0; i < 3 && k > 10000; i++) {
            sum += (double)aeo_els_innovation(&els)[i] * (double)aeo_els_innovation(&els)[i];
        }
    }
    /* own power of the three innovations: (1 + 1 + 2) / 3; 14 parameters with a memory of 100 add about 14 % */
    TEST_ASSERT_TRUE(sum / 40000.0 < 1.25 * 4.0 / 3.0);
    TEST_ASSERT_EQUAL_UINT32(0, els.count.fell_back);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(words_are_known_at_compile_time);
    RUN_TEST(schedule_follows_its_equation);
    RUN_TEST(the_yardstick_is_the_second_half_of_the_start);
    RUN_TEST(start_is_varx);
    RUN_TEST(parameters_are_found);
    RUN_TEST(bursts_are_bounded);
    RUN_TEST(divergence_falls_back);
    RUN_TEST(starts_lengthen_while_it_diverges_and_not_after);
    RUN_TEST(livelier_data_and_outliers_are_no_divergence);
    RUN_TEST(rough_treatment_is_survived);
    RUN_TEST(innovations_of_low_rank_are_borne);
    return UNITY_END();
}
