/* What is particular to extended least squares: its schedule, its start, its guard, its feedback, its saved form. */
#include "aeolid/els.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { P_MAX = 5, L = 1, M = 3, N_MAX = P_MAX * M, WORDS = AEO_ELS_WORDS(N_MAX, 3), WINDOW = 200 };
enum { SAVED = AEO_ELS_SAVED_WORDS(N_MAX, 3) };

static aeo_els_t els;
static aeo_regressor_t regressor;
static aeo_real_t memory[WORDS], window[WINDOW], saved[SAVED];
static uint64_t seed, time_us;

/* A simulated plant y_k = sum_i ar_i y_{k-i} + x_i u_{k-i} + ma_i e_{k-i} + e_k, scaled to about unit variance of y. */
static struct {
    double ar[P_MAX], x[P_MAX], ma[P_MAX], y[P_MAX], u[P_MAX], e[P_MAX], scale, noise;
} plant;

void setUp(void)
{
    seed = 11;
    time_us = 0;
}

void tearDown(void)
{
}

/* The settings to start with, for one input and one output and p blocks. */
static aeo_els_config_t make_config(unsigned p)
{
    const aeo_els_config_t config = {.regressors = (uint16_t)(p * M),
                                     .outputs = L,
                                     .past = (uint16_t)p,
                                     .varx_samples = 200,
                                     .forgetting = AEO_REAL(1),
                                     .forgetting_start = AEO_REAL(0.99),
                                     .forgetting_rate = AEO_REAL(0.99),
                                     .regularisation = AEO_REAL(0.1),
                                     .excitation_min = AEO_REAL(0.05),
                                     .growth_max = AEO_REAL(10),
                                     .guard_ratio = AEO_REAL(4)};
    return config;
}

static void start_regressor(unsigned p)
{
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = L, .past = (uint16_t)p, .model_set = AEO_VARMAX, .period_us = 1000};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, WINDOW));
    time_us = 0;
}

static void start(const aeo_els_config_t *config)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, config, memory, WORDS));
    start_regressor(config->past);
}

/* (1 + root z^-1)^order as noise, with one real pole at 1/2 */
static void set_plant(double root, unsigned order, double scale)
{
    memset(&plant, 0, sizeof plant);
    double c[P_MAX + 1] = {1.0};
    for (unsigned k = 0; k < order; k++) {
        for (unsigned i = k + 1; i > 0; i--) {
            c[i] += root * c[i - 1];
        }
    }
    memcpy(plant.ma, c + 1, sizeof plant.ma);
    plant.ar[0] = 0.5;
    plant.x[0] = 1.0;
    plant.scale = scale;
    plant.noise = 1.0;
}

/* Push what the plant does next; returns the status of the step. */
static aeo_status_t step(void)
{
    const double u = 1.7 * draw(&seed), e = plant.noise * 1.7 * draw(&seed); /* about unit variance */
    double y = e;
    for (unsigned i = 0; i < P_MAX; i++) {
        y += plant.ar[i] * plant.y[i] + plant.x[i] * plant.u[i] + plant.ma[i] * plant.e[i];
    }
    for (unsigned i = P_MAX - 1; i > 0; i--) {
        plant.y[i] = plant.y[i - 1];
        plant.u[i] = plant.u[i - 1];
        plant.e[i] = plant.e[i - 1];
    }
    plant.y[0] = y;
    plant.u[0] = u;
    plant.e[0] = e;
    const aeo_real_t input = (aeo_real_t)u, output = (aeo_real_t)(y * plant.scale);
    time_us += 1000;
    return aeo_els_step(&els, &regressor, &input, &output, time_us);
}

static void run(unsigned samples)
{
    for (unsigned k = 0; k < samples; k++) {
        const aeo_status_t status = step();
        TEST_ASSERT_TRUE(status == AEO_OK || status == AEO_FILLING);
    }
    TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
}

/* Run and return the mean power of the innovations over the noise's own, and in *worst that of the worst 64 running. */
static double measure(unsigned samples, double *worst)
{
    double sum = 0.0, recent = 0.0, ring[64] = {0.0};
    *worst = 0.0;
    for (unsigned k = 0; k < samples; k++) {
        TEST_ASSERT_TRUE(step() >= AEO_OK);
        const double innovation = (double)aeo_els_innovation(&els)[0] / plant.scale, power = innovation * innovation;
        sum += power;
        recent += power - ring[k % 64];
        ring[k % 64] = power;
        *worst = recent / 64.0 > *worst ? recent / 64.0 : *worst;
    }
    TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
    const double own = 1.7 * 1.7 / 3.0 * plant.noise * plant.noise;
    *worst /= own;
    return sum / samples / own;
}

static void words_are_known_at_compile_time(void)
{
    TEST_ASSERT_EQUAL_UINT(3661, AEO_ELS_WORDS(80, 3));
    TEST_ASSERT_EQUAL_UINT(30141, AEO_ELS_WORDS(240, 3));
}

static void schedule_follows_its_equation(void)
{
    aeo_els_config_t config = make_config(2);
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
    aeo_els_config_t config = make_config(2);
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
    aeo_els_config_t config = make_config(2);
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
    aeo_els_config_t config = make_config(1);
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
            aeo_els_config_t config = make_config(5);
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
    for (size_t i = 0; i < (size_t)els.config.regressors * (els.config.regressors + 1u) / 2u; i++) {
        els.rls.factor[i] *= AEO_REAL(1e-6);
    }
    els.rls.theta[els.config.regressors - 1u] = AEO_REAL(1.3);
}

static void divergence_falls_back(void)
{
    const aeo_els_config_t config = make_config(2);
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
    const aeo_els_config_t config = make_config(2);
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
    const aeo_els_config_t config = make_config(3);
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
    aeo_els_config_t config = make_config(2);
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
    aeo_els_config_t config = make_config(P);
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

static void forgotten_feedback_is_told(void)
{
    const aeo_els_config_t config = make_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(500);
    /* a gap leaves zeros in z once: no complaint */
    time_us += 10000;
    TEST_ASSERT_EQUAL_INT(AEO_E_GAP, step());
    run(500);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_els_health(&els));
    for (int k = 0; k < 10; k++) {
        const aeo_real_t u = (aeo_real_t)draw(&seed), y = (aeo_real_t)draw(&seed);
        time_us += 1000;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_push(&regressor, &u, &y, time_us));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&els, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor)));
    }
    /* the first of these found the e of the step before; the next nine nothing, which for the first might be a gap */
    TEST_ASSERT_EQUAL_UINT32(8, els.count.unfed);
    TEST_ASSERT_TRUE((aeo_els_health(&els) & AEO_ELS_UNFED) != 0u);
}

static void a_step_is_push_update_and_feedback(void)
{
    static aeo_real_t other_memory[WORDS], other_window[WINDOW];
    const aeo_els_config_t config = make_config(3);
    aeo_els_t other;
    set_plant(0.8, 2, 0.2);
    start(&config);
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = L, .past = 3, .model_set = AEO_VARMAX, .period_us = 1000};
    aeo_regressor_t by_hand;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&by_hand, &layout, other_window, WINDOW));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&other, &config, other_memory, WORDS));
    for (int k = 0; k < 600; k++) {
        const aeo_status_t status = step();
        const aeo_real_t u = (aeo_real_t)plant.u[0], y = (aeo_real_t)(plant.y[0] * plant.scale);
        TEST_ASSERT_EQUAL_INT(status, aeo_regressor_push(&by_hand, &u, &y, time_us));
        if (status == AEO_OK) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&other, aeo_regressor_z(&by_hand), aeo_regressor_y(&by_hand)));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_set_innovation(&by_hand, aeo_els_feedback(&other)));
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(memory, other_memory, AEO_ELS_WORDS(9, 1) * sizeof *memory);
    TEST_ASSERT_EQUAL_MEMORY(&els.count, &other.count, sizeof els.count);
}

static void a_regressor_that_does_not_fit_is_refused(void)
{
    const aeo_els_config_t config = make_config(2);
    const aeo_real_t one = AEO_REAL(1);
    start(&config);
    start_regressor(3);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, &one, &one, 1000));
    start_regressor(2);
    regressor.model_set = (uint8_t)AEO_VARX;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, &one, &one, 1000));
    start_regressor(2);
    regressor.outputs = 2;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, &one, &one, 1000));
    const aeo_regressor_config_t flat = {/* one block of 6 instead of two of 3 */
                                         .inputs = 4,
                                         .outputs = L,
                                         .past = 1,
                                         .model_set = AEO_VARMAX,
                                         .period_us = 1000};
    const aeo_real_t four[4] = {one, one, one, one};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &flat, window, WINDOW));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, four, &one, 1000));
    start_regressor(2);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(NULL, &regressor, &one, &one, 1000));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, NULL, &one, &one, 1000));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, NULL, &one, 1000));
    TEST_ASSERT_EQUAL_UINT32(0, regressor.count.samples);
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_els_step(&els, &regressor, &one, &one, 1000));
}

static void a_given_varx_is_started_from(void)
{
    const aeo_els_config_t config = make_config(2);
    aeo_real_t theta[6] = {AEO_REAL(0.1), AEO_REAL(0.2), AEO_REAL(9), AEO_REAL(0.3), AEO_REAL(0.4), AEO_REAL(9)};
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(1000);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_start(&els, theta));
    TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
    theta[2] = theta[5] = AEO_REAL(0);
    TEST_ASSERT_EQUAL_MEMORY(theta, aeo_els_theta(&els), sizeof theta);
    TEST_ASSERT_EQUAL_UINT32(0, els.since);
    run(100);
    const aeo_els_t before = els;
    theta[3] = make_not_finite(1);
    TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_els_start(&els, theta));
    theta[3] = AEO_REAL(1.1e6);
    TEST_ASSERT_EQUAL_INT(AEO_E_RANGE, aeo_els_start(&els, theta));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_start(&els, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_start(NULL, theta));
    TEST_ASSERT_EQUAL_MEMORY(&before, &els, sizeof els);
}

static void runaway_starts_from_varx(void)
{
    const aeo_els_config_t config = make_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(1000);
    els.rls.theta[1] = AEO_REAL(1e20);
    run(1);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_REINITIALISED | AEO_ELS_FELL_BACK, aeo_els_health(&els));
    TEST_ASSERT_EQUAL_UINT32(1, els.count.fell_back);
    TEST_ASSERT_EQUAL_UINT32(400, els.wait);
}

static void save_and_restore_go_on_in_every_phase(void)
{
    static aeo_real_t other_memory[WORDS];
    static const unsigned AT[] = {0, 1, 50, 99, 100, 199, 202, 203, 500, 3000};
    const aeo_els_config_t config = make_config(5);
    for (size_t t = 0; t < sizeof AT / sizeof AT[0]; t++) {
        seed = 977;
        set_plant(0.95, 5, 0.09);
        start(&config);
        run(5 + AT[t]);
        if (t % 3 == 0) { /* after a fall-back, too */
            els.rls.theta[1] = AEO_REAL(1e20);
            run(1 + AT[t]);
            TEST_ASSERT_EQUAL_UINT32(400, els.wait);
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&els, saved, AEO_ELS_SAVED_WORDS(15, 1)));
        aeo_els_t other;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&other, &config, other_memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_restore(&other, saved, AEO_ELS_SAVED_WORDS(15, 1)));
        TEST_ASSERT_TRUE(aeo_els_invariants_hold(&other));
        for (int k = 0; k < 500; k++) {
            run(1);
            TEST_ASSERT_EQUAL_INT(AEO_OK,
                                  aeo_els_update(&other, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor)));
            TEST_ASSERT_EQUAL_MEMORY(els.rls.theta, other.rls.theta, 15 * sizeof *memory);
            TEST_ASSERT_EQUAL_MEMORY(els.feedback, other.feedback, AEO_ELS_OWN(1) * sizeof *memory);
        }
        TEST_ASSERT_EQUAL_MEMORY(&els.count, &other.count, sizeof els.count);
        TEST_ASSERT_EQUAL_UINT32(els.wait, other.wait);
    }
}

static void restore_names_what_is_wrong(void)
{
    enum { LENGTH = AEO_ELS_SAVED_WORDS(6, 1), RLS_AT = AEO_ELS_SAVED_HEAD + AEO_ELS_OWN(1) };
    const aeo_els_config_t config = make_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(50);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&els, saved, LENGTH));
    run(7);
    const aeo_els_t before = els;
    static aeo_real_t memory_before[WORDS];
    memcpy(memory_before, memory, sizeof memory);
    for (size_t i = 0; i < (size_t)RLS_AT + 22u; i++) {
        const aeo_real_t wrong[2] = {AEO_REAL(-1.5), AEO_REAL(2.1e12)};
        for (int t = 0; t < 2; t++) {
            const aeo_status_t expected = i == 0 || i == RLS_AT            ? AEO_E_VERSION
                                          : i < 9                          ? AEO_E_MISMATCH
                                          : i < RLS_AT || i >= RLS_AT + 8u ? AEO_E_DAMAGED
                                                                           : AEO_E_MISMATCH;
            const aeo_real_t good = saved[i];
            saved[i] = wrong[t];
            if (i == AEO_ELS_SAVED_HEAD && t == 0) { /* the one word, e fed back, that -1.5 does not damage */
                saved[i] = AEO_REAL(-1.1e6);
            }
            TEST_ASSERT_EQUAL_INT(expected, aeo_els_restore(&els, saved, LENGTH));
            saved[i] = good;
            TEST_ASSERT_EQUAL_MEMORY(&before, &els, sizeof els);
            TEST_ASSERT_EQUAL_MEMORY(memory_before, memory, sizeof memory);
        }
    }
    saved[20] = AEO_REAL(7); /* the low half of backoff */
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_els_restore(&els, saved, LENGTH));
}

static void settings_out_of_range_are_refused(void)
{
    const aeo_els_t untouched = els;
    for (int t = 0; t < 17; t++) {
        aeo_els_config_t config = make_config(2);
        config.regressors = t == 0 ? 7 : t == 1 ? 0 : config.regressors; /* no two blocks */
        config.outputs = t == 2 ? 2 : t == 3 ? 0 : t == 4 ? 33 : config.outputs;
        config.past = t == 5 ? 3 : t == 6 ? 0 : config.past; /* blocks of 2; guard without blocks */
        config.present = t == 7 ? 6 : config.present;
        config.varx_samples = t == 8 ? AEO_ELS_VARX_SAMPLES_MAX + 1u : t == 9 ? 15u : config.varx_samples;
        config.forgetting = t == 10 ? AEO_REAL(1.01) : t == 11 ? AEO_REAL(0.98) : config.forgetting;
        config.forgetting_start = t == 12 ? AEO_REAL(0.49) : config.forgetting_start;
        config.forgetting_rate = t == 13 ? AEO_REAL(1) : t == 14 ? AEO_REAL(-0.1) : config.forgetting_rate;
        config.guard_ratio = t == 15 ? AEO_REAL(1.4) : t == 16 ? AEO_REAL(101) : config.guard_ratio;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(&els, &config, memory, WORDS));
    }
    for (int t = 0; t < 28; t++) {
        aeo_els_config_t config = make_config(2);
        aeo_real_t *const fields[7] = {&config.forgetting,     &config.forgetting_start, &config.forgetting_rate,
                                       &config.regularisation, &config.excitation_min,   &config.growth_max,
                                       &config.guard_ratio};
        *fields[t / 4] = make_not_finite(t % 4);
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_els_init(&els, &config, memory, WORDS));
    }
    aeo_els_config_t config = make_config(2);
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_els_init(&els, &config, memory, AEO_ELS_WORDS(6, 1) - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_els_init(&els, &config, memory, 3));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(NULL, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(&els, NULL, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(&els, &config, NULL, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &els, sizeof els);
}

static void invariants_notice_damage(void)
{
    const aeo_els_config_t config = make_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(300);
    aeo_real_t *const spots[] = {&els.feedback[0], &els.levels[0], &els.levels[3], &els.shortfall, &els.rls.theta[4]};
    for (size_t t = 0; t < sizeof spots / sizeof spots[0]; t++) {
        const aeo_real_t good = *spots[t];
        *spots[t] = t == 4 ? make_not_finite(0) : AEO_REAL(-1.1e6);
        TEST_ASSERT_FALSE(aeo_els_invariants_hold(&els));
        *spots[t] = good;
        TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
    }
    els.wait++;
    TEST_ASSERT_FALSE(aeo_els_invariants_hold(&els));
    TEST_ASSERT_FALSE(aeo_els_invariants_hold(NULL));
}

static void null_and_reset_are_harmless(void)
{
    const aeo_els_config_t config = make_config(2);
    aeo_real_t theta[6];
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(400);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_read(&els, theta, 6));
    TEST_ASSERT_EQUAL_MEMORY(aeo_els_theta(&els), theta, sizeof theta);
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_els_read(&els, theta, 5));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_read(NULL, theta, 6));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_read(&els, NULL, 6));
    aeo_els_reset(NULL);
    aeo_els_clear_health(NULL);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_els_health(NULL));
    els.health = AEO_ELS_LIMITED;
    els.rls.health = AEO_RLS_BOUNDED;
    aeo_els_reset(&els);
    TEST_ASSERT_EQUAL_UINT32(34, aeo_els_health(&els));
    aeo_els_clear_health(&els);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_els_health(&els));
    TEST_ASSERT_EQUAL_UINT32(398, els.rls.count.updates);
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
    RUN_TEST(forgotten_feedback_is_told);
    RUN_TEST(a_step_is_push_update_and_feedback);
    RUN_TEST(a_regressor_that_does_not_fit_is_refused);
    RUN_TEST(a_given_varx_is_started_from);
    RUN_TEST(runaway_starts_from_varx);
    RUN_TEST(save_and_restore_go_on_in_every_phase);
    RUN_TEST(restore_names_what_is_wrong);
    RUN_TEST(settings_out_of_range_are_refused);
    RUN_TEST(invariants_notice_damage);
    RUN_TEST(null_and_reset_are_harmless);
    return UNITY_END();
}
