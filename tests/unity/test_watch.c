/* Faults that would stop a filter from learning for good, and calms that must not look like them. */
#include "aeolid/watch.h"

#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/lattice.h"
#include "aeolid/rls.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { R = 2, L = 2, P = 3, M = R + L, N = P * M, N_ELS = P * (M + L), PERIOD = 100000, MEMORY = 200 };

static aeo_regressor_t x, x_els;
static aeo_rls_t rls;
static aeo_els_t els;
static aeo_fast_rls_t fast;
static aeo_lattice_t lattice;
static aeo_real_t window[AEO_REGRESSOR_WORDS(R, L, P, 0)], window_els[AEO_REGRESSOR_WORDS(R, L, P, 1)];
static aeo_real_t of_rls[AEO_RLS_WORDS(N, L)], of_els[AEO_ELS_WORDS(N_ELS, L)];
static aeo_real_t of_fast[AEO_FAST_RLS_WORDS(P, M, 0, L)], of_lattice[AEO_LATTICE_WORDS(P, M, 0, L)];
static aeo_real_t u[R], y[L];
static uint64_t seed, now;

static void start_filters(aeo_real_t gate)
{
    const aeo_real_t lambda = AEO_REAL(1) - AEO_REAL(1) / MEMORY, rho = AEO_REAL(0.1), growth = AEO_REAL(10);
    aeo_regressor_config_t layout = {.inputs = R, .outputs = L, .past = P, .period_us = PERIOD};
    const aeo_rls_config_t a = {N, L, lambda, rho, gate, growth};
    const aeo_els_config_t b = {.regressors = N_ELS,
                                .outputs = L,
                                .past = P,
                                .varx_samples = 100,
                                .forgetting = lambda,
                                .forgetting_start = lambda,
                                .regularisation = rho,
                                .excitation_min = gate,
                                .growth_max = growth,
                                .guard_ratio = AEO_REAL(4)};
    const aeo_fast_rls_config_t c = {
        .past = P, .block = M, .outputs = L, .forgetting = lambda, .regularisation = rho, .growth_max = growth};
    const aeo_lattice_config_t d = {P, M, 0, L, lambda, rho, gate, growth};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&x, &layout, window, AEO_REGRESSOR_WORDS(R, L, P, 0)));
    layout.model_set = AEO_VARMAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&x_els, &layout, window_els, AEO_REGRESSOR_WORDS(R, L, P, 1)));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &a, of_rls, AEO_RLS_WORDS(N, L)));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &b, of_els, AEO_ELS_WORDS(N_ELS, L)));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &c, of_fast, AEO_FAST_RLS_WORDS(P, M, 0, L)));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&lattice, &d, of_lattice, AEO_LATTICE_WORDS(P, M, 0, L)));
    memset(u, 0, sizeof u);
    memset(y, 0, sizeof y);
    seed = 20091130u;
    now = 0;
}

/* One sample of a plant whose first input acts with `gain`; what the sensors say of it is `fault` times noise where that
 * is not 0, else the truth, `size` times as large, plus an offset. */
static void live(unsigned samples, double gain, double fault, double size, double offset)
{
    for (; samples > 0u; samples--) {
        const double y0 = 0.7 * (double)y[0] + gain * (double)u[0] + 0.1 * draw(&seed);
        y[1] = (aeo_real_t)(0.5 * (double)y[1] + 0.3 * (double)u[1] + 0.1 * draw(&seed));
        y[0] = (aeo_real_t)y0;
        fill(u, R, &seed);
        aeo_real_t told[M];
        for (size_t i = 0; i < M; i++) {
            const double truth = (double)(i < R ? u[i] : y[i - R]);
            told[i] = (aeo_real_t)(fault > 0.0 ? fault * draw(&seed) : size * truth + offset);
        }
        now += PERIOD;
        if (aeo_regressor_push(&x, told, told + R, now) == AEO_OK) {
            const aeo_real_t *const z = aeo_regressor_z(&x), *const of_now = aeo_regressor_y(&x);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, of_now));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, of_now));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, of_now));
        }
        (void)aeo_els_step(&els, &x_els, told, told + R, now);
    }
}

static void assert_gain(double gain)
{
    aeo_real_t theta[N * L];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, theta, N * L));
    TEST_ASSERT_TRUE(fabs((double)theta[N - M] - gain) < 0.05);
    TEST_ASSERT_TRUE(fabs((double)aeo_rls_theta(&rls)[N - M] - gain) < 0.05);
    TEST_ASSERT_TRUE(fabs((double)aeo_fast_rls_theta(&fast)[N - M] - gain) < 0.05);
    TEST_ASSERT_TRUE(fabs((double)aeo_els_theta(&els)[N_ELS - M - L] - gain) < 0.05);
}

void setUp(void)
{
    start_filters(AEO_REAL(0.05));
}

void tearDown(void)
{
}

static void a_fault_of_all_sensors_does_not_stop_learning(void)
{
    /* 100 samples a hundred times too large, no plausible ranges, the gate on; then the plant turns over */
    live(10 * MEMORY, 0.5, 0, 1, 0);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_rls_health(&rls) | aeo_lattice_health(&lattice) | aeo_fast_rls_health(&fast));
    live(100, 0.5, 100, 1, 0);
    live(20 * MEMORY, -0.5, 0, 1, 0);
    assert_gain(-0.5);
    TEST_ASSERT_EQUAL_UINT32(1, rls.count.released);
    TEST_ASSERT_EQUAL_UINT32(1, lattice.count.released);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_RELEASED, aeo_rls_health(&rls) & AEO_RLS_RELEASED);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_RELEASED, aeo_lattice_health(&lattice) & AEO_LATTICE_RELEASED);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_RELEASED, aeo_els_health(&els) & AEO_RLS_RELEASED);
    live(20 * MEMORY, 0.5, 0, 1, 0); /* and follows as ever */
    assert_gain(0.5);
    TEST_ASSERT_EQUAL_UINT32(1, rls.count.released);
}

static void a_fault_ten_times_too_large_does_not_stop_learning(void)
{
    /* too small for P to hold a hundred times what the data bring: only the gate, shut in good data, tells of it */
    live(10 * MEMORY, 0.5, 0, 1, 0);
    live(100, 0.5, 10, 1, 0);
    live(20 * MEMORY, -0.5, 0, 1, 0);
    assert_gain(-0.5);
    TEST_ASSERT_EQUAL_UINT32(1, rls.count.released);
}

static void without_a_gate_a_million_does_not_outlast_twenty_memories(void)
{
    start_filters(AEO_REAL(0));
    live(10 * MEMORY, 0.5, 0, 1, 0);
    live(100, 0.5, 0.9e6, 1, 0);
    live(20 * MEMORY, -0.5, 0, 1, 0);
    assert_gain(-0.5);
    TEST_ASSERT_EQUAL_UINT32(1, rls.count.released);
    TEST_ASSERT_EQUAL_UINT32(1, lattice.count.released);
    TEST_ASSERT_TRUE(fast.count.released + fast.count.reinitialised >= 1u); /* arrays may lose their way first */
}

static void faults_that_come_back_are_survived_each_time(void)
{
    for (unsigned t = 0; t < 5u; t++) {
        const double gain = t % 2u == 0u ? 0.5 : -0.5;
        live(30, gain, 1000, 1, 0);
        live(20 * MEMORY, gain, 0, 1, 0);
        assert_gain(gain);
    }
}

/* Mean square innovations of rls, els, fast_rls and lattice over a memory of good data. */
static void measure(double gain, double power[4])
{
    memset(power, 0, 4 * sizeof *power);
    for (unsigned k = 0; k < MEMORY; k++) {
        live(1, gain, 0, 1, 0);
        const aeo_real_t *const e[4] = {aeo_rls_innovation(&rls), aeo_els_innovation(&els),
                                        aeo_fast_rls_innovation(&fast), aeo_lattice_innovation(&lattice)};
        for (unsigned f = 0; f < 4u; f++) {
            for (size_t i = 0; i < L; i++) {
                power[f] += pow((double)e[f][i], 2) / MEMORY;
            }
        }
    }
}

/* What watch.h says of a fault of any size and length: after sixteen memories innovations are within a tenth of the size
 * that they had before, which is that of the noise but for a few percent. The plant turns over in it. */
static void a_fault_of_any_size_is_over_after_sixteen_memories(void)
{
    static const double sizes[] = {3, 20, 80, 250, 800, 1e4, 0.9e6};
    static const unsigned lengths[] = {1, MEMORY / 5, MEMORY};
    for (unsigned i = 0; i < 21u; i++) {
        double before[4], after[4];
        start_filters(AEO_REAL(0.05));
        seed += i;
        live(10 * MEMORY + i * MEMORY / 21u, 0.5, 0, 1, 0);
        measure(0.5, before);
        live(lengths[i / 7u], 0.5, sizes[i % 7u], 1, 0);
        live(16 * MEMORY, -0.5, 0, 1, 0);
        measure(-0.5, after);
        for (unsigned f = 0; f < 4u; f++) {
            const double noise = L * 0.01 / 3.0, least = before[f] > noise ? before[f] : noise;
            TEST_ASSERT_TRUE(after[f] < 1.21 * least);
        }
    }
}

/* More than 100 e^3 memories' worth is released within three memories, wherever in a block the fault ends; less than 100
 * e never. Without a gate, so that nothing else tells. */
static void what_outweighs_two_thousand_memories_is_released_within_three(void)
{
    for (unsigned i = 0; i < 16u; i++) {
        const unsigned ends = i / 2u * MEMORY / 8u;
        start_filters(AEO_REAL(0));
        live(10 * MEMORY + ends, 0.5, 0, 1, 0);
        const double usual = (double)rls.watched[0]; /* what is held is usual */
        rls.watched[0] = (aeo_real_t)((i % 2u == 0u ? 2500.0 : 250.0) * usual);
        live(3 * MEMORY, 0.5, 0, 1, 0);
        TEST_ASSERT_EQUAL_UINT32(i % 2u == 0u, rls.count.released);
        live(8 * MEMORY, 0.5, 0, 1, 0);
        TEST_ASSERT_EQUAL_UINT32(i % 2u == 0u, rls.count.released);
    }
}

/* Samples of a plant y_k = gain y_{k-1} + u_{k-1} + noise through a fast filter with one past block and the present u. */
static void live_fast(aeo_fast_rls_t *self, unsigned samples, double gain)
{
    for (; samples > 0u; samples--) {
        const aeo_real_t was = u[0];
        fill(u, 1, &seed);
        const aeo_real_t z[3] = {was, y[0], u[0]};
        y[0] = (aeo_real_t)(gain * (double)y[0] + (double)was + 0.1 * draw(&seed));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(self, z, y));
    }
}

static void a_reading_that_only_the_first_sample_behind_a_gap_holds_counts(void)
{
    /* with one past block the first z behind a gap is the only one with this reading in it: the new array absorbs it */
    static aeo_real_t memory[AEO_FAST_RLS_WORDS(1, 2, 1, 1)];
    const aeo_fast_rls_config_t layout = {.past = 1,
                                          .block = 2,
                                          .feedthrough = 1u,
                                          .outputs = 1,
                                          .forgetting = AEO_REAL(1) - AEO_REAL(1) / MEMORY,
                                          .regularisation = AEO_REAL(0.1),
                                          .growth_max = AEO_REAL(10)};
    aeo_fast_rls_t one;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&one, &layout, memory, AEO_FAST_RLS_WORDS(1, 2, 1, 1)));
    live_fast(&one, 10 * MEMORY, 0.5);
    const aeo_real_t z[3] = {AEO_REAL(2), AEO_REAL(3e5), u[0]}; /* what no sensor said a sample ago */
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&one, z, y));
    TEST_ASSERT_EQUAL_UINT32(1, one.count.restarted);
    live_fast(&one, 20 * MEMORY, -0.5);
    TEST_ASSERT_TRUE(fabs((double)aeo_fast_rls_theta(&one)[1] + 0.5) < 0.05);
    TEST_ASSERT_EQUAL_UINT32(1, one.count.released);
}

/* Samples of a plant y_k = 0.5 y_{k-1} + gain u_k + noise through a lattice with one past block and the present u. */
static void live_through(aeo_lattice_t *self, unsigned samples, double gain)
{
    for (; samples > 0u; samples--) {
        aeo_real_t z[3] = {u[0], y[0], AEO_REAL(0)};
        fill(u, 1, &seed);
        z[2] = u[0];
        y[0] = (aeo_real_t)(0.5 * (double)y[0] + gain * (double)u[0] + 0.1 * draw(&seed));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(self, z, y));
    }
}

static void a_reading_that_only_the_present_inputs_hold_counts(void)
{
    /* a gap follows right behind it, so it enters the present inputs' covariance and never the window's */
    static aeo_real_t memory[AEO_LATTICE_WORDS(1, 2, 1, 1)];
    const aeo_lattice_config_t layout = {.past = 1,
                                         .block = 2,
                                         .present = 1,
                                         .outputs = 1,
                                         .forgetting = AEO_REAL(1) - AEO_REAL(1) / MEMORY,
                                         .regularisation = AEO_REAL(0.1),
                                         .growth_max = AEO_REAL(10)};
    aeo_lattice_t one;
    aeo_real_t theta[3];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&one, &layout, memory, AEO_LATTICE_WORDS(1, 2, 1, 1)));
    live_through(&one, 10 * MEMORY, 0.5);
    const aeo_real_t z[3] = {u[0], y[0], AEO_REAL(3e5)}, told[1] = {AEO_REAL(3e5)};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&one, z, told));
    live_through(&one, 20 * MEMORY, -0.5);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&one, theta, 3));
    TEST_ASSERT_TRUE(fabs((double)theta[0]) < 0.05);
    TEST_ASSERT_TRUE(fabs((double)theta[1] - 0.5) < 0.05);
    TEST_ASSERT_TRUE(fabs((double)theta[2] + 0.5) < 0.05);
    TEST_ASSERT_EQUAL_UINT32(1, one.count.released);
}

static void one_reading_does_not_stretch_the_yardstick_of_the_feedback(void)
{
    /* theta of els is thrown far off by one reading of an output, with P as it was; a gap keeps the reading out of z. What
     * is left without the terms in e is then as large as what theta makes of it, and must not pass for livelier data */
    for (unsigned t = 0; t < 20u; t++) {
        start_filters(AEO_REAL(0.05));
        seed += t;
        live(6 * MEMORY, 0.5, 0, 1, 0);
        const aeo_real_t told[L] = {AEO_REAL(-0.9e6), y[1]};
        now += PERIOD;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_step(&els, &x_els, u, told, now));
        now += 9u * PERIOD;
        live(18 * MEMORY, -0.5, 0, 1, 0);
        double power = 0.0;
        for (unsigned k = 0; k < 2u * MEMORY; k++) {
            live(1, -0.5, 0, 1, 0);
            power += (double)(els.rls.innovation[0] * els.rls.innovation[0]) / (2.0 * MEMORY);
        }
        TEST_ASSERT_TRUE(power <
                         1.3 * 0.01 / 3.0); /* the noise is even between -0.1 and 0.1; 0.15 are of theta's noise */
    }
}

static void a_calm_releases_nothing(void)
{
    /* a hundredth, a millionth, nothing at all, around offsets that the filters know or do not know */
    static const double SIZES[] = {1e-2, 1e-6, 0}, OFFSETS[] = {0, 3};
    for (unsigned t = 0; t < 6u; t++) {
        start_filters(AEO_REAL(0.05));
        live(10 * MEMORY, 0.5, 0, 1, 0);
        aeo_real_t before[N * L];
        memcpy(before, aeo_rls_theta(&rls), sizeof before);
        live(100 * MEMORY, -0.5, 0, SIZES[t % 3u], OFFSETS[t / 3u]);
        TEST_ASSERT_EQUAL_UINT32(0, rls.count.released + els.rls.count.released + lattice.count.released);
        TEST_ASSERT_TRUE(t >= 3u || lattice.count.withheld > 90u * MEMORY);
        live(20 * MEMORY, -0.5, 0, 1, 0);
        assert_gain(-0.5);
    }
}

static void a_start_in_the_calm_releases_nothing(void)
{
    live(50 * MEMORY, 0.5, 0, 1e-4, 0);
    TEST_ASSERT_EQUAL_UINT32(0, rls.count.released + els.rls.count.released + lattice.count.released);
    live(20 * MEMORY, 0.5, 0, 1, 0);
    assert_gain(0.5);
}

static void what_a_watch_cannot_be_is_noticed(void)
{
    TEST_ASSERT_TRUE(aeo_watch_holds(&rls.watch, rls.watched, L));
    aeo_real_t words[AEO_WATCH_WORDS(L)];
    for (size_t i = 0; i < AEO_WATCH_WORDS(L); i++) {
        memcpy(words, rls.watched, sizeof words);
        words[i] = i < 2u ? AEO_REAL(-1) : AEO_REAL(2e6);
        TEST_ASSERT_FALSE(aeo_watch_holds(&rls.watch, words, L));
    }
    for (size_t i = 0; i < 2u; i++) { /* powers end at 1e38 */
        memcpy(words, rls.watched, sizeof words);
        words[i] = AEO_REAL(1e38);
        TEST_ASSERT_TRUE(aeo_watch_holds(&rls.watch, words, L));
        words[i] = AEO_REAL(1.001e38);
        TEST_ASSERT_FALSE(aeo_watch_holds(&rls.watch, words, L));
    }
    static const struct {
        aeo_watch_t held;
        unsigned place;
    } ends[] = {{{1u << 26, 2u << 26, 1u << 26, 2, 1}, 0}, /* age, moved, withheld, blocks, suspected */
                {{7, 14, 7, 0, 0}, 1},
                {{7, 0, 7, 0, 0}, 2},
                {{7, 0, 0, 2, 0}, 3},
                {{7, 0, 0, 0, 1}, 4}};
    for (unsigned i = 0; i < 5u; i++) {
        uint32_t numbers[5];
        aeo_watch_t watch = ends[i].held;
        TEST_ASSERT_TRUE(aeo_watch_holds(&watch, rls.watched, L));
        memcpy(numbers, &watch, sizeof watch);
        numbers[ends[i].place]++;
        memcpy(&watch, numbers, sizeof watch);
        TEST_ASSERT_FALSE(aeo_watch_holds(&watch, rls.watched, L));
    }
    for (unsigned i = 0; i < 5u; i++) {
        uint32_t numbers[5] = {0, 0, 0, 0, 0};
        aeo_watch_t watch;
        numbers[i] = UINT32_MAX;
        memcpy(&watch, numbers, sizeof watch);
        TEST_ASSERT_FALSE(aeo_watch_holds(&watch, rls.watched, L));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_fault_of_all_sensors_does_not_stop_learning);
    RUN_TEST(a_fault_ten_times_too_large_does_not_stop_learning);
    RUN_TEST(without_a_gate_a_million_does_not_outlast_twenty_memories);
    RUN_TEST(faults_that_come_back_are_survived_each_time);
    RUN_TEST(a_fault_of_any_size_is_over_after_sixteen_memories);
    RUN_TEST(what_outweighs_two_thousand_memories_is_released_within_three);
    RUN_TEST(a_reading_that_only_the_first_sample_behind_a_gap_holds_counts);
    RUN_TEST(a_reading_that_only_the_present_inputs_hold_counts);
    RUN_TEST(one_reading_does_not_stretch_the_yardstick_of_the_feedback);
    RUN_TEST(a_calm_releases_nothing);
    RUN_TEST(a_start_in_the_calm_releases_nothing);
    RUN_TEST(what_a_watch_cannot_be_is_noticed);
    return UNITY_END();
}
