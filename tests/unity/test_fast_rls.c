/* What is particular to the fast filter: its agreement with the square-root RLS, breaks, renewal, bound, failing arrays,
 * health; its settings and saved form are in test_fast_rls_saved.c. */
#include "aeolid/fast_rls.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum {
    R = 2,
    L = 2,
    P = 6,
    N_MAX = P * (R + 2 * L) + R,
    M_MAX = R + 2 * L,
    WORDS = AEO_FAST_RLS_WORDS(P, M_MAX, R, L)
};

static aeo_fast_rls_t fast;
static aeo_rls_t rls;
static aeo_real_t fast_memory[WORDS], rls_memory[AEO_RLS_WORDS(N_MAX, L)], fast_window[256], rls_window[256];
static aeo_regressor_t fast_regressor, rls_regressor;
static uint64_t seed, tick;
static double state[3], noise;
static int collinear;

void setUp(void)
{
    seed = 11;
    tick = 0;
    noise = 0.1;
    collinear = 0;
    memset(state, 0, sizeof state);
}

void tearDown(void)
{
}

static aeo_fast_rls_config_t make_config(size_t block, uint32_t mask, double lambda, double rho, double growth)
{
    const aeo_fast_rls_config_t config = {.past = P,
                                          .block = (uint16_t)block,
                                          .outputs = L,
                                          .feedthrough = mask,
                                          .forgetting = (aeo_real_t)lambda,
                                          .regularisation = (aeo_real_t)rho,
                                          .growth_max = (aeo_real_t)growth};
    return config;
}

/* Both filters, each with a window of its own: in VARMAX each feeds back its own residuals. */
static void start(aeo_model_set_t set, uint32_t mask, double lambda, double rho, double growth)
{
    const size_t block = AEO_REGRESSOR_BLOCK(R, L, set == AEO_VARMAX);
    const aeo_fast_rls_config_t config = make_config(block, mask, lambda, rho, growth);
    const aeo_regressor_config_t layout = {
        .inputs = R, .outputs = L, .past = P, .model_set = set, .feedthrough = mask, .period_us = 10};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&fast_regressor, &layout, fast_window, 256));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&rls_regressor, &layout, rls_window, 256));
    const aeo_rls_config_t other = {.regressors = fast.length,
                                    .outputs = L,
                                    .forgetting = (aeo_real_t)lambda,
                                    .regularisation = (aeo_real_t)rho,
                                    .excitation_min = AEO_REAL(0),
                                    .growth_max = AEO_REAL(1e6)};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &other, rls_memory, AEO_RLS_WORDS(fast.length, L)));
}

/* A third-order plant in a loop u = r - f y, so that inputs and outputs are correlated. */
static void step_plant(aeo_real_t u[R], aeo_real_t y[L])
{
    double out[L];
    for (size_t i = 0; i < L; i++) {
        out[i] = state[i] + noise * draw(&seed);
        y[i] = (aeo_real_t)out[i];
    }
    u[0] = (aeo_real_t)(draw(&seed) - 0.1 * out[0]);
    u[1] = collinear ? 2 * u[0] : (aeo_real_t)(draw(&seed) - 0.2 * out[1]);
    const double x0 = 0.9 * state[0] + 0.2 * state[1] + (double)u[0] + noise * draw(&seed);
    const double x1 = -0.2 * state[0] + 0.9 * state[1] + 0.1 * state[2] + 0.5 * (double)u[1] + noise * draw(&seed);
    state[2] = 0.5 * state[2] + 0.3 * (double)u[0] + (double)u[1] + noise * draw(&seed);
    state[0] = x0;
    state[1] = x1;
}

/* One sample for a window; returns 1 when it has a regressor. */
static int push(aeo_regressor_t *regressor, const aeo_real_t *u, const aeo_real_t *y)
{
    const aeo_status_t status = aeo_regressor_push(regressor, u, y, tick * 10);
    TEST_ASSERT_TRUE(status == AEO_OK || status == AEO_FILLING || status == AEO_E_GAP);
    return status == AEO_OK;
}

static void feed_fast(const aeo_real_t *u, const aeo_real_t *y)
{
    if (push(&fast_regressor, u, y)) {
        TEST_ASSERT_EQUAL_INT(
            AEO_OK, aeo_fast_rls_update(&fast, aeo_regressor_z(&fast_regressor), aeo_regressor_y(&fast_regressor)));
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(&fast));
        if (fast_regressor.model_set == (uint8_t)AEO_VARMAX) {
            aeo_regressor_set_innovation(&fast_regressor, aeo_fast_rls_residual(&fast));
        }
    }
}

static void feed(unsigned count)
{
    for (unsigned k = 0; k < count; k++) {
        aeo_real_t u[R], y[L];
        step_plant(u, y);
        tick++;
        feed_fast(u, y);
        if (push(&rls_regressor, u, y)) {
            TEST_ASSERT_EQUAL_INT(
                AEO_OK, aeo_rls_update(&rls, aeo_regressor_z(&rls_regressor), aeo_regressor_y(&rls_regressor)));
            if (rls_regressor.model_set == (uint8_t)AEO_VARMAX) {
                aeo_regressor_set_innovation(&rls_regressor, aeo_rls_residual(&rls));
            }
        }
    }
}

static double find_distance(void)
{
    const size_t count = (size_t)fast.length * L;
    double expected[N_MAX * L];
    for (size_t i = 0; i < count; i++) {
        expected[i] = (double)aeo_rls_theta(&rls)[i];
    }
    return relative_distance(aeo_fast_rls_theta(&fast), expected, count);
}

/* The agreement that the filter promises, on any data that excite all directions. */
static double promised(void)
{
    return sizeof(aeo_real_t) == 4 ? 1e-2 : 1e-4;
}

static void words_are_known_at_compile_time(void)
{
    TEST_ASSERT_EQUAL_UINT(1695, AEO_FAST_RLS_WORDS(10, 5, 0, 3));
    TEST_ASSERT_EQUAL_UINT(7895, AEO_FAST_RLS_WORDS(50, 5, 0, 3));
}

static void agrees_with_square_root_rls(void)
{
    /* every mask, one of which (bit 1 alone) makes z and window differ in their order; both model sets */
    for (uint32_t mask = 0; mask < 4u; mask++) {
        for (int set = AEO_VARX; set <= AEO_VARMAX; set++) {
            setUp();
            start(set == AEO_VARX ? AEO_VARX : AEO_VARMAX, mask, 0.998, 1.0, 1e6);
            feed(12000); /* 24 memories */
            TEST_ASSERT_TRUE(find_distance() < promised());
            TEST_ASSERT_EQUAL_UINT32(0, aeo_fast_rls_health(&fast));
            TEST_ASSERT_EQUAL_UINT32(0, fast.count.renewed);
        }
    }
}

static void errors_die_out(void)
{
    /* 300 memories, many times what the generator in its array form survives: the last errors are as small as the first */
    start(AEO_VARX, 0, 0.998, 1.0, 1e6);
    feed(15000);
    double early = 0.0, late = 0.0;
    for (int k = 0; k < 20; k++) {
        feed(100);
        early += find_distance() / 20;
    }
    feed(130000);
    for (int k = 0; k < 20; k++) {
        feed(100);
        late += find_distance() / 20;
    }
    TEST_ASSERT_EQUAL_UINT32(0, fast.count.renewed);
    TEST_ASSERT_TRUE(late < 3.0 * early);
}

/* A library built with -ffast-math, which takes the rests of sums out, is known by numbers it flushes to zero. */
static int keeps_rests(void)
{
    volatile float tiny = 1e-38f;
    tiny *= 0.1f;
    return sizeof(aeo_real_t) == 4 && tiny > 0.0f;
}

static void small_residuals_in_the_window_are_borne(void)
{
    /* Both filters see the z of one VARMAX loop, where the newest e is all but foretold by the window. Float sums of A
     * and B without their rests make the array disagree until it is renewed, four to six times here (eight seeds). */
    start(AEO_VARMAX, 0, 0.998, 1.0, 1e6);
    noise = 0.03;
    double worst = 0.0;
    for (int k = 0; k < 60000; k++) {
        aeo_real_t u[R], y[L];
        step_plant(u, y);
        tick++;
        if (!push(&rls_regressor, u, y)) {
            continue;
        }
        const aeo_real_t *const z = aeo_regressor_z(&rls_regressor);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        aeo_regressor_set_innovation(&rls_regressor, aeo_rls_residual(&rls));
        worst = k % 200 == 0 && k >= 10000 ? fmax(worst, find_distance()) : worst;
    }
    TEST_ASSERT_TRUE(fast.count.renewed == 0u || (sizeof(aeo_real_t) == 4 && !keeps_rests()));
    TEST_ASSERT_TRUE(worst < (fast.count.renewed == 0u ? 1.0 : 2.0) * promised());
    TEST_ASSERT_EQUAL_UINT32(0, aeo_fast_rls_health(&fast));
}

static void short_memories_are_renewed(void)
{
    /* memory 40 samples for 24 regressors: errors grow, arrays take turns, and theta stays with the other filter */
    start(AEO_VARX, 0, 0.975, 1.0, 1e6);
    feed(1200);
    double worst = 0.0;
    for (int k = 0; k < 6000; k++) {
        feed(1);
        worst = fmax(worst, find_distance());
    }
    TEST_ASSERT_TRUE(fast.count.renewed > 3);
    TEST_ASSERT_EQUAL_UINT32(0, fast.count.reinitialised);
    TEST_ASSERT_TRUE(worst < promised());
}

static void start_within_a_record_waits_for_the_window(void)
{
    start(AEO_VARX, 0, 0.998, 1.0, 1e6);
    feed(P + 1); /* the first regressor is full of samples the arrays have not seen */
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.updates);
    feed(P - 2);
    const aeo_real_t nothing[N_MAX * L] = {AEO_REAL(0)};
    TEST_ASSERT_EQUAL_MEMORY(nothing, aeo_fast_rls_theta(&fast), sizeof(aeo_real_t) * fast.length * L);
    TEST_ASSERT_EQUAL_UINT32(P - 1, fast.count.held);
    feed(1);
    TEST_ASSERT_EQUAL_UINT32(P - 1, fast.count.held);
    TEST_ASSERT_TRUE(memcmp(nothing, aeo_fast_rls_theta(&fast), sizeof(aeo_real_t) * fast.length * L) != 0);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_fast_rls_health(&fast));
}

static void break_keeps_theta_and_waits(void)
{
    start(AEO_VARX, 0, 0.998, 1.0, 1e6);
    feed(6000);
    aeo_real_t before[N_MAX * L];
    const size_t bytes = sizeof *before * fast.length * L;
    memcpy(before, aeo_fast_rls_theta(&fast), bytes);
    const uint32_t held = fast.count.held;
    tick += 5; /* five samples lost */
    feed(P);   /* the gap, and P - 1 samples of filling */
    feed(1);
    TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_RESTARTED, aeo_fast_rls_health(&fast));
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.restarted);
    const uint32_t wait = fast.hold + 1u;
    TEST_ASSERT_UINT32_WITHIN(2, 50, wait); /* a tenth of a memory */
    feed(wait - 1u);
    TEST_ASSERT_EQUAL_MEMORY(before, aeo_fast_rls_theta(&fast), bytes);
    TEST_ASSERT_EQUAL_UINT32(held + wait, fast.count.held);
    feed(12000);
    TEST_ASSERT_TRUE(find_distance() < promised());
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.restarted);
}

static void frequent_breaks_do_not_stop_learning(void)
{
    /* a sample lost every 150: each wait is half of the stretch before it, so every stretch teaches something */
    start(AEO_VARX, 0, 0.998, 1.0, 1e6);
    for (int k = 0; k < 200; k++) {
        tick++;
        feed(150);
    }
    TEST_ASSERT_TRUE(fast.count.held < fast.count.updates * 2u / 3u);
    TEST_ASSERT_TRUE(fast.count.restarted > 150);
    TEST_ASSERT_TRUE(find_distance() < 0.2); /* the other filter has forgotten nothing at the breaks */
}

static void lost_array_is_replaced(void)
{
    /* as flipped bits would: in each part of the array that makes the gain */
    for (int part = 0; part < 5; part++) {
        setUp();
        start(AEO_VARX, 0, 0.998, 1.0, 1e6);
        feed(6000);
        aeo_fast_rls_array_t *const array = &fast.array[fast.active];
        aeo_real_t *const spots[5] = {array->forward + 3, array->backward + 5, array->gain + 2, array->energy,
                                      array->scalar};
        aeo_real_t before[N_MAX * L];
        memcpy(before, aeo_fast_rls_theta(&fast), sizeof before);
        *spots[part] = part == 4 ? AEO_REAL(1e19) : AEO_REAL(-1e15);
        if (part == 4) {
            array->gain[0] = AEO_REAL(1e17);
        }
        feed(1);
        if (part < 3) { /* at once: theta has not moved by a bit */
            TEST_ASSERT_EQUAL_MEMORY(before, aeo_fast_rls_theta(&fast), sizeof *before * fast.length * L);
        }
        feed(12000);
        TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_REINITIALISED, aeo_fast_rls_health(&fast));
        TEST_ASSERT_TRUE(fast.count.reinitialised >= 1);
        TEST_ASSERT_TRUE(fast.regularisation > AEO_REAL(15)); /* rho was 1; arrays that follow start from more */
        TEST_ASSERT_TRUE(find_distance() < promised());
    }
}

static void gain_without_sense_is_refused(void)
{
    /* 1 + w'kappa is at least 1; a little less may be rounding and counts as 1, which invariants demand */
    static aeo_real_t kept[WORDS];
    aeo_real_t u[R], y[L];
    start(AEO_VARX, 0, 0.998, 1.0, 1e6);
    feed(6000);
    const aeo_fast_rls_t before = fast;
    memcpy(kept, fast_memory, sizeof kept);
    step_plant(u, y);
    tick++;
    feed_fast(u, y);
    const double news = (double)fast.array[0].scalar[0] - 1.0;
    for (int lost = 0; lost < 2; lost++) {
        fast = before;
        memcpy(fast_memory, kept, sizeof kept);
        const size_t m = fast.config.block, n = fast.length;
        const aeo_real_t *const w = fast.window + m; /* its entries from m on, and those of kappa, stay in the window */
        double size = 0.0;
        for (size_t j = m; j < n; j++) {
            size += (double)w[j] * (double)w[j];
        }
        for (size_t j = m; j < n; j++) {
            fast.array[0].gain[j] += (aeo_real_t)(((lost ? -1.0 : -0.05) - news) * (double)w[j] / size);
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, aeo_regressor_z(&fast_regressor), y));
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(&fast));
        TEST_ASSERT_EQUAL_UINT32(lost ? AEO_FAST_RLS_REINITIALISED : 0, aeo_fast_rls_health(&fast));
    }
    TEST_ASSERT_EQUAL_MEMORY(kept + (fast.theta - fast_memory), fast.theta, sizeof *kept * fast.length * L);
}

/* Something is kept where the rows of the second array will be. */
static int has_rests(void)
{
    int found = 0;
    for (const aeo_real_t *rest = fast.array[1].forward; rest < fast.array[1].gain; rest++) {
        found |= *rest > 0 || *rest < 0;
    }
    return found;
}

static void follower_takes_over_when_errors_disagree(void)
{
    start(AEO_VARX, 0, 0.998, 1.0, 1e6);
    feed(6000);
    TEST_ASSERT_EQUAL_UINT32(0, fast.array[1].age);
    TEST_ASSERT_EQUAL_INT(keeps_rests(), has_rests());
    /* beyond LATE, short of LOST */
    fast.array[0].scalar[1] = (sizeof(aeo_real_t) == 4 ? AEO_REAL(0.02) : AEO_REAL(1e-5)) * fast.array[0].scalar[2];
    feed(1);
    TEST_ASSERT_EQUAL_UINT32(1, fast.array[1].age);
    TEST_ASSERT_FALSE(has_rests()); /* A and B begin at 0, which one sample with a gain of 0 leaves */
    feed(fast.warm);
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.renewed);
    TEST_ASSERT_EQUAL_UINT32(1, fast.active);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_fast_rls_health(&fast));
    TEST_ASSERT_TRUE(find_distance() < promised());
}

static void collinear_channels_stay_bounded_and_unbiased(void)
{
    /* The second input is twice the first and y has no noise: P would grow without end. The outputs are met to
     * rounding all the same, for the disturbances of the window do not enter the innovation. */
    start(AEO_VARX, 0, 0.998, 1.0, 10);
    noise = 0.0;
    collinear = 1;
    double missed = 0.0, size = 0.0;
    for (int k = 0; k < 40000; k++) {
        aeo_real_t u[R], y[L];
        step_plant(u, y);
        tick++;
        feed_fast(u, y);
        for (size_t i = 0; k > 20000 && i < L; i++) {
            missed += pow((double)aeo_fast_rls_innovation(&fast)[i], 2);
            size += pow((double)y[i], 2);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_BOUNDED, aeo_fast_rls_health(&fast));
    TEST_ASSERT_TRUE(fast.count.bounded > 1000);
    TEST_ASSERT_TRUE(size > 1.0 && sqrt(missed / size) < 1000.0 * (double)AEO_REAL_EPSILON);
}

/* With a memory of two samples the variances of six channels at rest double faster than disturbances bound them. What
 * they outgrow is the range that S may have, so an array starts afresh before that. */
static void the_shortest_memory_at_rest_stays_within_bounds(void)
{
    static const aeo_real_t z[M_MAX], y[L];
    aeo_fast_rls_config_t config = make_config(M_MAX, 0, 0.5, 3e-8, 10);
    config.past = 1; /* three memories, the most that is taken */
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    for (int k = 0; k < 2000; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(&fast));
    }
    TEST_ASSERT_TRUE(fast.count.reinitialised > 0u);
}

/* The shortest memory that is taken is one third of the regressors: innovations are those of rls within a quarter still. */
static void short_memories_stay_close_to_rls(void)
{
    const double n = (double)P * (R + L);
    for (int q = 1; q <= 3; q++) {
        double of_fast = 0.0, of_rls = 0.0;
        setUp();
        start(AEO_VARX, 0, 1.0 - q / n, 1.0, 100.0);
        for (int k = 0; k < 20000; k++) {
            feed(1);
            for (size_t i = 0; k > 1000 && i < L; i++) {
                of_fast += pow((double)aeo_fast_rls_innovation(&fast)[i], 2);
                of_rls += pow((double)aeo_rls_innovation(&rls)[i], 2);
            }
        }
        TEST_ASSERT_EQUAL_UINT32(0, fast.count.reinitialised);
        TEST_ASSERT_TRUE(of_rls > 1.0 && sqrt(of_fast / of_rls) < 1.25);
    }
    const aeo_fast_rls_config_t config = make_config(R + L, 0, 1.0 - 3.01 / n, 1.0, 100.0);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
}

static void runaway_starts_afresh(void)
{
    start(AEO_VARX, 0, 0.998, 1.0, 1e6);
    feed(1000);
    fast.theta[0] = AEO_REAL(1e20); /* as a flipped bit would */
    feed(1);
    TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_REINITIALISED, aeo_fast_rls_health(&fast));
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.reinitialised);
    feed(12000);
    TEST_ASSERT_TRUE(find_distance() < promised());
}

static void health_is_sticky_until_cleared(void)
{
    start(AEO_VARX, 0, 0.998, 1.0, 10);
    feed(100);
    tick += 5;
    feed(100);
    TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_RESTARTED, aeo_fast_rls_health(&fast));
    aeo_fast_rls_reset(&fast);
    TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_RESTARTED, aeo_fast_rls_health(&fast));
    aeo_fast_rls_clear_health(&fast);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_fast_rls_health(&fast));
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.restarted);
    fast.count.updates = UINT32_MAX;
    feed(1);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, fast.count.updates); /* never decreases */
    aeo_fast_rls_reset(NULL);
    aeo_fast_rls_clear_health(NULL);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_fast_rls_health(NULL));
    TEST_ASSERT_FALSE(aeo_fast_rls_invariants_hold(NULL));
}

static void schedules_fit_their_numbers(void)
{
    /* the longer the memory the longer the warm-up, and never more than 32 bits hold, down to the last bit of lambda */
    enum { LONG_WORDS = AEO_FAST_RLS_WORDS(10, 5, 0, 3) };
    static aeo_real_t memory[LONG_WORDS];
    aeo_fast_rls_t filter;
    uint32_t before = 0;
    for (double rate = 1.0 / 1024; rate >= (double)AEO_REAL_EPSILON / 2; rate /= 2) {
        const aeo_fast_rls_config_t config = {.past = 10,
                                              .block = 5,
                                              .outputs = 3,
                                              .forgetting = AEO_REAL(1) - (aeo_real_t)rate,
                                              .regularisation = AEO_REAL(1),
                                              .growth_max = AEO_REAL(100)};
        const aeo_status_t status = aeo_fast_rls_init(&filter, &config, memory, LONG_WORDS);
        TEST_ASSERT_EQUAL_INT(AEO_OK, status);
        TEST_ASSERT_TRUE(filter.warm >= before && filter.warm <= 2000000020u && filter.wait <= 200u);
        before = filter.warm;
    }
    TEST_ASSERT_TRUE(before > 200000000u);
}

/* The wait is four samples a regressor, or a tenth of a memory where that is less: 166 of 1,667 for n = 50. */
static void a_break_waits_for_a_tenth_of_a_memory(void)
{
    enum { SHORT_WORDS = AEO_FAST_RLS_WORDS(10, 5, 0, 3) };
    static aeo_real_t memory[SHORT_WORDS];
    static const struct {
        double rate;
        uint32_t wait;
    } known[] = {{0.0004, 200}, {0.0006, 166}, {0.0008, 125}, {0.01, 10}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        aeo_fast_rls_t filter;
        const aeo_fast_rls_config_t config = {.past = 10,
                                              .block = 5,
                                              .outputs = 3,
                                              .forgetting = AEO_REAL(1) - (aeo_real_t)known[i].rate,
                                              .regularisation = AEO_REAL(1),
                                              .growth_max = AEO_REAL(100)};
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&filter, &config, memory, SHORT_WORDS));
        TEST_ASSERT_UINT32_WITHIN(1, known[i].wait, filter.wait);
    }
}

/* The second window of all has nothing to do with the first: a break, though most of the window is not known yet. */
static void a_break_right_behind_the_start_is_noticed(void)
{
    const aeo_fast_rls_config_t config = make_config(R + L, 0, 0.999, 1.0, 100);
    aeo_real_t z[P * (R + L)], y[L] = {0};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    for (uint32_t k = 0; k < 3u; k++) {
        fill(z, P * (R + L), &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        TEST_ASSERT_EQUAL_UINT32(k, fast.count.restarted);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_break_waits_for_a_tenth_of_a_memory);
    RUN_TEST(a_break_right_behind_the_start_is_noticed);
    RUN_TEST(words_are_known_at_compile_time);
    RUN_TEST(agrees_with_square_root_rls);
    RUN_TEST(errors_die_out);
    RUN_TEST(small_residuals_in_the_window_are_borne);
    RUN_TEST(short_memories_are_renewed);
    RUN_TEST(start_within_a_record_waits_for_the_window);
    RUN_TEST(break_keeps_theta_and_waits);
    RUN_TEST(frequent_breaks_do_not_stop_learning);
    RUN_TEST(lost_array_is_replaced);
    RUN_TEST(gain_without_sense_is_refused);
    RUN_TEST(follower_takes_over_when_errors_disagree);
    RUN_TEST(collinear_channels_stay_bounded_and_unbiased);
    RUN_TEST(the_shortest_memory_at_rest_stays_within_bounds);
    RUN_TEST(short_memories_stay_close_to_rls);
    RUN_TEST(runaway_starts_afresh);
    RUN_TEST(health_is_sticky_until_cleared);
    RUN_TEST(schedules_fit_their_numbers);
    return UNITY_END();
}
