/* What the lattice estimates: new windows, gaps, its start, its gate, its bound, its rounding. */
#include "lattice_bench.h"
#include "lattice_state.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { SAMPLES = 2400 };

static aeo_real_t rows[SAMPLES * N], answers[SAMPLES * L];

void setUp(void)
{
    reset_lattice_bench();
}

void tearDown(void)
{
}

static void keep_row(size_t k)
{
    memcpy(rows + k * N, lattice_z, sizeof lattice_z);
    memcpy(answers + k * L, lattice_y, sizeof lattice_y);
}

/* |theta - batch| / |batch| over the rows kept, weights given. */
static double distance_from_batch(const double *weight, size_t count, double ridge_each)
{
    static double ridge[N], batch[L * N];
    aeo_real_t theta[L * N];
    for (size_t j = 0; j < N; j++) {
        ridge[j] = ridge_each;
    }
    solve_batch(rows, answers, weight, count, N, L, ridge, batch);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, theta, L * N));
    return relative_distance(theta, batch, L * N);
}

static void words_are_linear_in_the_window(void)
{
    TEST_ASSERT_EQUAL_UINT(1637, AEO_LATTICE_WORDS(10, 5, 0, 3));
    TEST_ASSERT_EQUAL_UINT(8317, AEO_LATTICE_WORDS(50, 5, 0, 3));
    TEST_ASSERT_EQUAL_UINT(AEO_LATTICE_WORDS(20, 5, 2, 3) - AEO_LATTICE_WORDS(10, 5, 2, 3),
                           AEO_LATTICE_WORDS(100, 5, 2, 3) - AEO_LATTICE_WORDS(90, 5, 2, 3));
}

/* After a jump of the window the stages fill without learning, and what was learnt before serves at once: the two edges
 * weigh one row each among the memory's 100, N^(1/2) / 100 = 0.036 of the signal, and are forgotten with it. */
static void a_new_window_is_followed_until_filled(void)
{
    start_lattice(0.99, 0, 1e6);
    for (int k = 0; k < 1000; k++) {
        feed_lattice(1.0, 0.01);
    }
    TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(&lattice));
    const size_t kept = (size_t)(lattice.window - lattice.factor); /* covariances and weights */
    aeo_real_t before[WORDS], theta[2][L * N];
    memcpy(before, lattice.factor, kept * sizeof *before);
    fill(lattice_z, P * M, &lattice_seed); /* samples were lost: a window of others */
    for (unsigned k = 0; k < P - 1; k++) {
        feed_lattice(1.0, 0.01);
        TEST_ASSERT_EQUAL_MEMORY(before, lattice.factor, kept * sizeof *before);
        /* the errors of a followed sample are as good a priori as a posteriori */
        TEST_ASSERT_EQUAL_MEMORY(&lattice.config.forgetting, &lattice.alpha[k], sizeof *lattice.alpha);
        /* nor does theta move, though most stages hold errors of the window before */
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, theta[k == 0 ? 0 : 1], L * N));
        TEST_ASSERT_EQUAL_MEMORY(theta[0], theta[k == 0 ? 0 : 1], sizeof theta[0]);
        TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_RESTARTED, aeo_lattice_health(&lattice));
        TEST_ASSERT_EQUAL_UINT32(k + 1u, lattice.orders);
        TEST_ASSERT_TRUE(lattice.following);
    }
    for (int k = 0; k < 1000; k++) {
        feed_lattice(1.0, 0.01);
        TEST_ASSERT_FALSE(lattice.following);
        TEST_ASSERT_TRUE(distance_from_lattice_model() < (k < 700 ? 0.08 : 0.01));
    }
    TEST_ASSERT_EQUAL_UINT32(1, lattice.count.restarted);
}

/* Rows on both sides of many gaps: the estimate is that of all rows that were absorbed, but for the edges, each of
 * which weighs one row among the memory's 1000. */
static void gaps_cost_little(void)
{
    static double weight[SAMPLES];
    start_lattice(0.999, 0, 1e6);
    for (size_t k = 0; k < SAMPLES; k++) {
        if (k % 600 == 599) {
            fill(lattice_z, P * M, &lattice_seed);
        }
        feed_lattice(1.0, 0.3);
        keep_row(k);
        weight[k] = lattice.following ? 0.0 : pow((double)AEO_REAL(0.999), (double)(SAMPLES - 1 - k));
    }
    TEST_ASSERT_EQUAL_UINT32(4, lattice.count.restarted);
    TEST_ASSERT_TRUE(distance_from_batch(weight, SAMPLES, 0.1) < 5e-3);
}

/* A first window with a past that is not 0 is no start from rest. With blocks before it ten times larger than what
 * follows, the false zeros would bias theta for the whole record; thrown away after 4 n samples they do not. */
static void a_false_start_is_thrown_away(void)
{
    double distance[2] = {0.0, 0.0}; /* sums of ten runs */
    for (int run = 0; run < 20; run++) {
        const uint64_t same = lattice_seed;
        const int honest = run % 2;
        start_lattice(1.0, 0, 1e6);
        fill(lattice_z, P * M, &lattice_seed);
        for (size_t j = 0; j < P * M; j++) {
            lattice_z[j] *= AEO_REAL(10);
        }
        for (unsigned k = 0; k < 1000; k++) {
            feed_lattice(1.0, 0.1);
            if (k == 0) {
                TEST_ASSERT_EQUAL_UINT32(4 * N - 1, lattice.learning);
                lattice.learning = honest ? lattice.learning : 0;
            }
        }
        TEST_ASSERT_EQUAL_UINT32(0, lattice.learning);
        TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(&lattice));
        distance[honest] += distance_from_lattice_model();
        lattice_seed = honest ? lattice_seed : same;
    }
    TEST_ASSERT_TRUE(distance[1] < 0.2 && distance[0] > 2.0 * distance[1]);
}

static void quiet_samples_are_followed(void)
{
    aeo_real_t factor[WORDS];
    start_lattice(0.99, 0.05, 1000);
    for (int k = 0; k < 1000; k++) {
        feed_lattice(1.0, 0.01);
    }
    TEST_ASSERT_TRUE(lattice.count.withheld < 10);
    for (int k = 0; k < P + 2; k++) { /* what is left of the excitation passes through the window */
        feed_lattice(0.0, 0.0);
    }
    memcpy(factor, lattice.factor, (size_t)(lattice.window - lattice.factor) * sizeof *factor);
    for (int k = 0; k < 100000; k++) {
        draw_lattice_sample(0.0, 0.0);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
    }
    /* covariances and weights stay to the bit */
    TEST_ASSERT_EQUAL_MEMORY(factor, lattice.factor, (size_t)(lattice.window - lattice.factor) * sizeof *factor);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_WITHHELD, aeo_lattice_health(&lattice));
    TEST_ASSERT_TRUE(lattice.count.withheld >= 100000);
    TEST_ASSERT_TRUE(distance_from_lattice_model() < 0.01);
    for (int k = 0; k < 50; k++) { /* and serve at once when it is over */
        feed_lattice(1.0, 0.01);
        for (size_t i = 0; i < L; i++) { /* without the weights learnt before, several times 1 */
            TEST_ASSERT_TRUE(fabs((double)aeo_lattice_innovation(&lattice)[i]) < 0.1);
        }
    }
    TEST_ASSERT_FALSE(lattice.following);
}

static void without_the_gate_variances_stay_bounded(void)
{
    /* one channel moves, the others never do: their variances must not grow for ever, the moving one must learn on */
    start_lattice(0.99, 0, 100);
    double largest = 0.0;
    for (int k = 0; k < 30000; k++) {
        const aeo_real_t x = (aeo_real_t)draw(&lattice_seed), last = lattice_z[(P - 1) * M];
        memmove(lattice_z, lattice_z + M, (P - 1) * M * sizeof *lattice_z);
        lattice_z[(P - 1) * M] = x;
        lattice_y[0] = (k < 20000 ? 1 : -1) * x;
        lattice_y[1] = last;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
        for (size_t index = 0; index < (2 * P - 1) * M + D; index++) {
            const aeo_lattice_variance_t at = aeo_lattice_find_variance(&lattice, lattice.factor, index);
            const double variance = (double)aeo_lattice_variance(&at);
            largest = variance > largest ? variance : largest;
        }
    }
    TEST_ASSERT_TRUE(largest <= 200.0 && largest > 50.0); /* twice growth_max / rho, the proven bound */
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_BOUNDED, aeo_lattice_health(&lattice));
    TEST_ASSERT_TRUE(lattice.count.bounded > 100);
    aeo_real_t theta[L * N];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, theta, L * N));
    TEST_ASSERT_TRUE(fabs((double)theta[(P - 1) * M] + 1.0) < 1e-3);
    TEST_ASSERT_TRUE(fabs((double)theta[N + (P - 2) * M] - 1.0) < 1e-3);
}

static void bounding_leaves_theta_alone(void)
{
    aeo_real_t before[L * N], after[L * N];
    start_lattice(0.9, 0, 1e6);
    for (int k = 0; k < 50; k++) {
        feed_lattice(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &twin, twin_memory, WORDS));
    twin.variance_max = AEO_REAL(1e-4);
    draw_lattice_sample(1.0, 0.1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&twin, lattice_z, lattice_y));
    TEST_ASSERT_TRUE(twin.count.bounded > 0 && lattice.count.bounded == 0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, before, L * N));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&twin, after, L * N));
    TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof before);
}

/* And every other word of the state: what is taken off the triangle shows nowhere else. */
static void bounding_touches_one_triangle_alone(void)
{
    start_lattice(0.9, 0, 1e6);
    for (int k = 0; k < 50; k++) {
        feed_lattice(1.0, 0.1);
    }
    const size_t triangle = AEO_LATTICE_TRIANGLE(M), stages = 2u * P - 1u;
    for (size_t scan = 0; scan < aeo_lattice_count_variances(&lattice.config); scan++) {
        lattice.scan = (uint32_t)scan;
        lattice.scan_step = 1;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &twin, twin_memory, WORDS));
        twin.variance_max = AEO_REAL(1e-4);
        draw_lattice_sample(1.0, 0.1);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&twin, lattice_z, lattice_y));
        TEST_ASSERT_EQUAL_UINT32(lattice.count.bounded + 1u, twin.count.bounded);
        const size_t at = scan / M < stages ? scan / M * triangle : stages * triangle;
        const size_t behind = scan / M < stages ? at + triangle : stages * triangle + AEO_LATTICE_TRIANGLE(D);
        const size_t state = aeo_lattice_count_state(&lattice);
        TEST_ASSERT_TRUE(memcmp(lattice.factor, twin.factor, at * sizeof *lattice.factor) == 0);
        TEST_ASSERT_EQUAL_MEMORY(lattice.factor + behind, twin.factor + behind,
                                 (state - behind) * sizeof *lattice.factor);
        TEST_ASSERT_TRUE(memcmp(lattice.factor + at, twin.factor + at, (behind - at) * sizeof *lattice.factor) != 0);
    }
}

static void bounding_quarters_a_variance_in_time(void)
{
    for (int t = 0; t < 40; t++) { /* each comes round before forgetting can double it */
        const double lambda = t < 20 ? 0.5 + 0.025 * t : 1.0 - pow(0.5, t / 2 - 9);
        start_lattice(lambda, 0, 1e6);
        const unsigned count = aeo_lattice_count_variances(&lattice.config);
        TEST_ASSERT_TRUE(pow(lambda, (count + lattice.scan_step - 1u) / lattice.scan_step) > 0.4999999);
    }
    start_lattice(0.9, 0, 1e6);
    for (int k = 0; k < 50; k++) {
        feed_lattice(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &twin, twin_memory, WORDS));
    twin.variance_max = AEO_REAL(1e-4);
    twin.scan_step = 1;
    const size_t scanned = twin.scan;
    draw_lattice_sample(1.0, 0.1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&twin, lattice_z, lattice_y));
    const aeo_lattice_variance_t whole = aeo_lattice_find_variance(&lattice, lattice.factor, scanned);
    const aeo_lattice_variance_t quarter = aeo_lattice_find_variance(&twin, twin.factor, scanned);
    const double ratio = (double)aeo_lattice_variance(&quarter) / (double)aeo_lattice_variance(&whole);
    TEST_ASSERT_TRUE(fabs(ratio - 0.25) < 20.0 * (double)AEO_REAL_EPSILON);
}

static void rounding_does_not_inflate_the_covariances(void)
{
    /* two equal channels, lambda = 1: nothing is ever learnt of their difference, whose variance tends to half of
     * 1 / rho = 1 from above and must not creep up again */
    start_lattice(1, 0, 1e6);
    double lowest = 1.0, last = 1.0;
    for (int k = 0; k < 300000; k++) {
        draw_lattice_sample(1.0, 0.1);
        for (size_t i = 0; i < P; i++) {
            lattice_z[i * M + 1] = lattice_z[i * M];
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
        const aeo_lattice_variance_t at = aeo_lattice_find_variance(&lattice, lattice.factor, 0);
        last = (double)aeo_lattice_variance(&at);
        lowest = last < lowest ? last : lowest;
    }
    TEST_ASSERT_TRUE(lowest > 0.499 && last < lowest * 1.001);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(words_are_linear_in_the_window);
    RUN_TEST(a_new_window_is_followed_until_filled);
    RUN_TEST(gaps_cost_little);
    RUN_TEST(a_false_start_is_thrown_away);
    RUN_TEST(quiet_samples_are_followed);
    RUN_TEST(without_the_gate_variances_stay_bounded);
    RUN_TEST(bounding_leaves_theta_alone);
    RUN_TEST(bounding_touches_one_triangle_alone);
    RUN_TEST(bounding_quarters_a_variance_in_time);
    RUN_TEST(rounding_does_not_inflate_the_covariances);
    return UNITY_END();
}
