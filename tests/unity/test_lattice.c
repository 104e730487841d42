/* What is particular to the lattice: new windows, its start, gate and bound, read-outs in slices, its saved form. */
#include "aeolid/lattice.h"
#include "lattice_state.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum {
    P = 4,
    M = 3,
    D = 1,
    L = 2,
    N = P * M + D,
    SAMPLES = 2400,
    WORDS = AEO_LATTICE_WORDS(P, M, D, L),
    SAVED = AEO_LATTICE_SAVED_WORDS(P, M, D, L)
};

static aeo_lattice_t lattice, other;
static aeo_real_t memory[WORDS], other_memory[WORDS];
static aeo_real_t z[N], y[L], block[M], rows[SAMPLES * N], answers[SAMPLES * L];
static aeo_real_t model[L * N];
static uint64_t seed = 3;

void setUp(void)
{
}

void tearDown(void)
{
}

static aeo_lattice_config_t make_config(double lambda, double gate, double growth)
{
    const aeo_lattice_config_t config = {
        P, M, D, L, (aeo_real_t)lambda, AEO_REAL(1), (aeo_real_t)gate, (aeo_real_t)growth};
    return config;
}

static void start(double lambda, double gate, double growth)
{
    const aeo_lattice_config_t config = make_config(lambda, gate, growth);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&lattice, &config, memory, WORDS));
    memset(z, 0, sizeof z);
    memset(block, 0, sizeof block);
    fill(model, L * N, &seed);
}

/* The next sample: the window slides, then y = model z + noise. The block of this sample follows the next time. */
static void draw_sample(double amplitude, double noise)
{
    memmove(z, z + M, (P - 1) * M * sizeof *z);
    memcpy(z + (P - 1) * M, block, sizeof block);
    for (size_t i = 0; i < M; i++) {
        block[i] = (aeo_real_t)(amplitude * draw(&seed));
    }
    memcpy(z + P * M, block, D * sizeof *block);
    for (size_t i = 0; i < L; i++) {
        double sum = noise * draw(&seed);
        for (size_t j = 0; j < N; j++) {
            sum += (double)model[i * N + j] * (double)z[j];
        }
        y[i] = (aeo_real_t)sum;
    }
}

static void feed(double amplitude, double noise)
{
    draw_sample(amplitude, noise);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, y));
    TEST_ASSERT_TRUE(aeo_lattice_invariants_hold(&lattice));
}

static void keep_row(size_t k)
{
    memcpy(rows + k * N, z, sizeof z);
    memcpy(answers + k * L, y, sizeof y);
}

static double distance_from_model(void)
{
    aeo_real_t theta[L * N];
    double expected[L * N];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, theta, L * N));
    for (size_t i = 0; i < L * N; i++) {
        expected[i] = (double)model[i];
    }
    return relative_distance(theta, expected, L * N);
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
    TEST_ASSERT_EQUAL_UINT(1629, AEO_LATTICE_WORDS(10, 5, 0, 3));
    TEST_ASSERT_EQUAL_UINT(8309, AEO_LATTICE_WORDS(50, 5, 0, 3));
    TEST_ASSERT_EQUAL_UINT(AEO_LATTICE_WORDS(20, 5, 2, 3) - AEO_LATTICE_WORDS(10, 5, 2, 3),
                           AEO_LATTICE_WORDS(100, 5, 2, 3) - AEO_LATTICE_WORDS(90, 5, 2, 3));
}

static void slices_and_copies_read_one_sample(void)
{
    aeo_real_t whole[L * N], slices[L * N], copied[L * N];
    start(0.99, 0, 1e6);
    for (int k = 0; k < 200; k++) {
        feed(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, whole, L * N));
    for (int j = 0; j + 1 < P; j++) {
        TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_lattice_read_next(&lattice, slices, L * N));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read_next(&lattice, slices, L * N));
    TEST_ASSERT_EQUAL_MEMORY(whole, slices, sizeof whole);
    /* the copy is read slice by slice while the filter goes on, and must tell of the sample it was taken at */
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &other, other_memory, WORDS));
    for (int j = 0; j < P; j++) {
        feed(1.0, 0.1);
        TEST_ASSERT_EQUAL_INT(j + 1 < P ? AEO_FILLING : AEO_OK, aeo_lattice_read_next(&other, copied, L * N));
        TEST_ASSERT_TRUE(aeo_lattice_invariants_hold(&other));
    }
    TEST_ASSERT_EQUAL_MEMORY(whole, copied, sizeof whole);
    /* an update between two slices begins the read-out anew */
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_lattice_read_next(&lattice, slices, L * N));
    feed(1.0, 0.1);
    for (int j = 0; j < P; j++) {
        TEST_ASSERT_EQUAL_INT(j + 1 < P ? AEO_FILLING : AEO_OK, aeo_lattice_read_next(&lattice, slices, L * N));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, whole, L * N));
    TEST_ASSERT_EQUAL_MEMORY(whole, slices, sizeof whole);
}

static void a_copy_goes_on_alike(void)
{
    aeo_real_t one[L * N], two[L * N];
    start(0.99, 0.05, 1000);
    for (int k = 0; k < 100; k++) {
        feed(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &other, other_memory, WORDS));
    for (int k = 0; k < 50; k++) {
        feed(1.0, 0.1);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&other, z, y));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, one, L * N));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&other, two, L * N));
    TEST_ASSERT_EQUAL_MEMORY(one, two, sizeof one);
    const aeo_lattice_t untouched = other;
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_lattice_copy(&lattice, &other, other_memory, WORDS - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(&lattice, &lattice, other_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(NULL, &other, other_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(&lattice, NULL, other_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(&lattice, &other, NULL, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &other, sizeof other);
}

static void refused_reads_leave_theta(void)
{
    aeo_real_t theta[L * N];
    start(0.99, 0, 1e6);
    feed(1.0, 0.1);
    for (size_t i = 0; i < L * N; i++) {
        theta[i] = AEO_REAL(7);
    }
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_lattice_read(&lattice, theta, L * N - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_lattice_read_next(&lattice, theta, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_read(&lattice, NULL, L * N));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_read(NULL, theta, L * N));
    for (size_t i = 0; i < L * N; i++) {
        TEST_ASSERT_TRUE(theta[i] > AEO_REAL(6.5) && theta[i] < AEO_REAL(7.5));
    }
    /* weights that only a flipped bit makes: their products leave the range of numbers */
    for (size_t i = 0; i < (P - 1) * M * M; i++) {
        lattice.backward_weight[i] = lattice.forward_weight[i] = (aeo_real_t)(sizeof(aeo_real_t) == 4 ? 1e25 : 1e200);
    }
    lattice.target_weight[(P - 1) * M * (L + D)] = AEO_REAL(1e20);
    TEST_ASSERT_EQUAL_INT(AEO_E_RANGE, aeo_lattice_read(&lattice, theta, L * N));
}

/* After a jump of the window the stages fill without learning, and what was learnt before serves at once: the two edges
 * weigh one row each among the memory's 100, N^(1/2) / 100 = 0.036 of the signal, and are forgotten with it. */
static void a_new_window_is_followed_until_filled(void)
{
    start(0.99, 0, 1e6);
    for (int k = 0; k < 1000; k++) {
        feed(1.0, 0.01);
    }
    TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(&lattice));
    const size_t kept = (size_t)(lattice.window - lattice.factor); /* covariances and weights */
    aeo_real_t before[WORDS], theta[2][L * N];
    memcpy(before, lattice.factor, kept * sizeof *before);
    fill(z, P * M, &seed); /* samples were lost: a window of others */
    for (unsigned k = 0; k < P - 1; k++) {
        feed(1.0, 0.01);
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
        feed(1.0, 0.01);
        TEST_ASSERT_FALSE(lattice.following);
        TEST_ASSERT_TRUE(distance_from_model() < (k < 700 ? 0.08 : 0.01));
    }
    TEST_ASSERT_EQUAL_UINT32(1, lattice.count.restarted);
}

/* Rows on both sides of many gaps: the estimate is that of all rows that were absorbed, but for the edges, each of
 * which weighs one row among the memory's 1000. */
static void gaps_cost_little(void)
{
    static double weight[SAMPLES];
    start(0.999, 0, 1e6);
    for (size_t k = 0; k < SAMPLES; k++) {
        if (k % 600 == 599) {
            fill(z, P * M, &seed);
        }
        feed(1.0, 0.3);
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
        const uint64_t same = seed;
        const int honest = run % 2;
        start(1.0, 0, 1e6);
        fill(z, P * M, &seed);
        for (size_t j = 0; j < P * M; j++) {
            z[j] *= AEO_REAL(10);
        }
        for (unsigned k = 0; k < 1000; k++) {
            feed(1.0, 0.1);
            if (k == 0) {
                TEST_ASSERT_EQUAL_UINT32(4 * N - 1, lattice.learning);
                lattice.learning = honest ? lattice.learning : 0;
            }
        }
        TEST_ASSERT_EQUAL_UINT32(0, lattice.learning);
        TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(&lattice));
        distance[honest] += distance_from_model();
        seed = honest ? seed : same;
    }
    TEST_ASSERT_TRUE(distance[1] < 0.2 && distance[0] > 2.0 * distance[1]);
}

static void quiet_samples_are_followed(void)
{
    aeo_real_t factor[WORDS];
    start(0.99, 0.05, 1000);
    for (int k = 0; k < 1000; k++) {
        feed(1.0, 0.01);
    }
    TEST_ASSERT_TRUE(lattice.count.withheld < 10);
    for (int k = 0; k < P + 2; k++) { /* what is left of the excitation passes through the window */
        feed(0.0, 0.0);
    }
    memcpy(factor, lattice.factor, (size_t)(lattice.window - lattice.factor) * sizeof *factor);
    for (int k = 0; k < 100000; k++) {
        draw_sample(0.0, 0.0);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, y));
    }
    /* covariances and weights stay to the bit */
    TEST_ASSERT_EQUAL_MEMORY(factor, lattice.factor, (size_t)(lattice.window - lattice.factor) * sizeof *factor);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_WITHHELD, aeo_lattice_health(&lattice));
    TEST_ASSERT_TRUE(lattice.count.withheld >= 100000);
    TEST_ASSERT_TRUE(distance_from_model() < 0.01);
    for (int k = 0; k < 50; k++) { /* and serve at once when it is over */
        feed(1.0, 0.01);
        for (size_t i = 0; i < L; i++) { /* without the weights learnt before, several times 1 */
            TEST_ASSERT_TRUE(fabs((double)aeo_lattice_innovation(&lattice)[i]) < 0.1);
        }
    }
    TEST_ASSERT_FALSE(lattice.following);
}

static void without_the_gate_variances_stay_bounded(void)
{
    /* one channel moves, the others never do: their variances must not grow for ever, the moving one must learn on */
    start(0.99, 0, 100);
    double largest = 0.0;
    for (int k = 0; k < 30000; k++) {
        const aeo_real_t x = (aeo_real_t)draw(&seed), last = z[(P - 1) * M];
        memmove(z, z + M, (P - 1) * M * sizeof *z);
        z[(P - 1) * M] = x;
        y[0] = (k < 20000 ? 1 : -1) * x;
        y[1] = last;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, y));
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
    start(0.9, 0, 1e6);
    for (int k = 0; k < 50; k++) {
        feed(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &other, other_memory, WORDS));
    other.variance_max = AEO_REAL(1e-4);
    draw_sample(1.0, 0.1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, y));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&other, z, y));
    TEST_ASSERT_TRUE(other.count.bounded > 0 && lattice.count.bounded == 0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, before, L * N));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&other, after, L * N));
    TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof before);
}

static void rounding_does_not_inflate_the_covariances(void)
{
    /* two equal channels, lambda = 1: nothing is ever learnt of their difference, whose variance tends to half of
     * 1 / rho = 1 from above and must not creep up again */
    start(1, 0, 1e6);
    double lowest = 1.0, last = 1.0;
    for (int k = 0; k < 300000; k++) {
        draw_sample(1.0, 0.1);
        for (size_t i = 0; i < P; i++) {
            z[i * M + 1] = z[i * M];
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, y));
        const aeo_lattice_variance_t at = aeo_lattice_find_variance(&lattice, lattice.factor, 0);
        last = (double)aeo_lattice_variance(&at);
        lowest = last < lowest ? last : lowest;
    }
    TEST_ASSERT_TRUE(lowest > 0.499 && last < lowest * 1.001);
}

static void runaway_starts_afresh(void)
{
    aeo_real_t *const weights[3] = {lattice.target_weight, lattice.forward_weight, lattice.backward_weight};
    for (unsigned t = 0; t < 3; t++) {
        start(1.0, 0, 1000);
        for (int k = 0; k < 100; k++) {
            feed(1.0, 0.01);
        }
        weights[t][0] = AEO_REAL(1e20); /* as a flipped bit would */
        feed(1.0, 0.01);
        TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_REINITIALISED, aeo_lattice_health(&lattice));
        TEST_ASSERT_EQUAL_UINT32(1, lattice.count.reinitialised);
        for (int k = 0; k < 2000; k++) {
            feed(1.0, 0.01);
        }
        TEST_ASSERT_TRUE(distance_from_model() < 0.01);
    }
}

static void settings_out_of_range_are_refused(void)
{
    static const double BAD[][4] = {{0.49, 1, 0, 4},  {1.01, 1, 0, 4},  {1, 0.9e-8, 0, 4},
                                    {1, 1.1e8, 0, 4}, {1, 1, -0.1, 4},  {1, 1, 1.1, 4},
                                    {1, 1, 0, 3.9},   {1, 1, 0, 1.1e6}, {1, 1e-8, 0, 200}};
    const aeo_lattice_t untouched = lattice;
    for (size_t t = 0; t < sizeof BAD / sizeof BAD[0]; t++) {
        aeo_lattice_config_t config = make_config(BAD[t][0], BAD[t][2], BAD[t][3]);
        config.regularisation = (aeo_real_t)BAD[t][1];
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, memory, WORDS));
    }
    for (int t = 0; t < 16; t++) {
        aeo_lattice_config_t config = make_config(1, 0, 4);
        aeo_real_t *const fields[4] = {&config.forgetting, &config.regularisation, &config.excitation_min,
                                       &config.growth_max};
        *fields[t / 4] = make_not_finite(t % 4);
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_lattice_init(&lattice, &config, memory, WORDS));
    }
    static const uint16_t SIZES[][4] = {{0, 3, 0, 1},     {1, 0, 0, 1},     {4, 3, 4, 1},    {4, 3, 0, 0},
                                        {4, 3, 0, 33},    {1, 97, 0, 1},    {1025, 1, 0, 1}, {341, 3, 2, 1},
                                        {65535, 1, 0, 1}, {1, 65535, 0, 1}, {4, 3, 65535, 1}};
    for (size_t t = 0; t < sizeof SIZES / sizeof SIZES[0]; t++) {
        aeo_lattice_config_t config = make_config(1, 0, 4);
        config.past = SIZES[t][0];
        config.block = SIZES[t][1];
        config.present = SIZES[t][2];
        config.outputs = SIZES[t][3];
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, memory, WORDS));
    }
    aeo_lattice_config_t config = make_config(0.5, 0, 4);
    config.past = 22; /* 0.5^21 < 1e-6: a window longer than the memory */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(NULL, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, NULL, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, NULL, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &lattice, sizeof lattice);
}

static void restore_names_what_is_wrong(void)
{
    static aeo_real_t saved[SAVED];
    start(0.99, 0.05, 1000);
    for (int k = 0; k < 20; k++) {
        feed(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&lattice, saved, SAVED));
    const aeo_lattice_t before = lattice;
    for (size_t i = 0; i < AEO_LATTICE_SAVED_HEAD; i++) { /* head, then health, counters and places in halves */
        const aeo_real_t wrong[3] = {saved[i] + AEO_REAL(0.5), AEO_REAL(-1), AEO_REAL(65536)};
        for (int t = 0; t < 3; t++) {
            const aeo_real_t good = saved[i];
            saved[i] = wrong[t];
            TEST_ASSERT_EQUAL_INT(i == 0   ? AEO_E_VERSION
                                  : i < 10 ? AEO_E_MISMATCH
                                           : AEO_E_DAMAGED,
                                  aeo_lattice_restore(&lattice, saved, SAVED));
            saved[i] = good;
            TEST_ASSERT_EQUAL_MEMORY(&before, &lattice, sizeof lattice);
        }
    }
    static const struct {
        size_t word;
        double value;
    } PLACES[] = {{25, P + 1}, {26, 1}, {29, P}, {31, (2 * P - 1) * M + D}, {33, 2}, {35, 2}};
    for (size_t t = 0; t < sizeof PLACES / sizeof PLACES[0]; t++) {
        const aeo_real_t good = saved[PLACES[t].word];
        saved[PLACES[t].word] = (aeo_real_t)PLACES[t].value;
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_lattice_restore(&lattice, saved, SAVED));
        saved[PLACES[t].word] = good;
        TEST_ASSERT_EQUAL_MEMORY(&before, &lattice, sizeof lattice);
    }
    saved[AEO_LATTICE_SAVED_HEAD] = AEO_REAL(0); /* first diagonal entry */
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_lattice_restore(&lattice, saved, SAVED));
}

static void saved_head_is_counted_right(void)
{
    /* the formula, the writer and this test agree: the state starts right after the head */
    static aeo_real_t saved[SAVED];
    start(1, 0, 4);
    feed(1.0, 0.1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&lattice, saved, SAVED));
    TEST_ASSERT_EQUAL_MEMORY(lattice.factor, saved + AEO_LATTICE_SAVED_HEAD,
                             sizeof *saved * AEO_LATTICE_STATE(P, M, D, L));
}

static void health_is_sticky_until_cleared(void)
{
    start(0.99, 0.9, 1000);
    feed(1e-6, 0.0);
    feed(1e-6, 0.0);
    feed(1.0, 0.0);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_WITHHELD, aeo_lattice_health(&lattice));
    aeo_lattice_reset(&lattice);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_WITHHELD, aeo_lattice_health(&lattice));
    aeo_lattice_clear_health(&lattice);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(&lattice));
    TEST_ASSERT_TRUE(lattice.count.withheld >= 1);
    lattice.count.updates = UINT32_MAX;
    feed(1.0, 0.0);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, lattice.count.updates); /* never decreases */
    aeo_lattice_reset(NULL);
    aeo_lattice_clear_health(NULL);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(NULL));
    TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(NULL));
}

static void invariants_notice_damage(void)
{
    start(0.99, 0, 100);
    feed(1.0, 0.1);
    aeo_real_t *const places[5] = {lattice.factor, lattice.present_factor, lattice.alpha, lattice.window,
                                   lattice.target_weight};
    for (unsigned t = 0; t < 5; t++) {
        const aeo_real_t good = *places[t];
        *places[t] = make_not_finite((int)t % 4);
        TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(&lattice));
        if (t < 3) {
            *places[t] = AEO_REAL(0);
            TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(&lattice));
        }
        if (t < 2) {
            *places[t] = AEO_REAL(401); /* a variance beyond 4 * 100 */
            TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(&lattice));
        }
        *places[t] = good;
        TEST_ASSERT_TRUE(aeo_lattice_invariants_hold(&lattice));
    }
    lattice.orders = P + 1;
    TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(&lattice));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(words_are_linear_in_the_window);
    RUN_TEST(slices_and_copies_read_one_sample);
    RUN_TEST(a_copy_goes_on_alike);
    RUN_TEST(refused_reads_leave_theta);
    RUN_TEST(a_new_window_is_followed_until_filled);
    RUN_TEST(gaps_cost_little);
    RUN_TEST(a_false_start_is_thrown_away);
    RUN_TEST(quiet_samples_are_followed);
    RUN_TEST(without_the_gate_variances_stay_bounded);
    RUN_TEST(bounding_leaves_theta_alone);
    RUN_TEST(rounding_does_not_inflate_the_covariances);
    RUN_TEST(runaway_starts_afresh);
    RUN_TEST(settings_out_of_range_are_refused);
    RUN_TEST(restore_names_what_is_wrong);
    RUN_TEST(saved_head_is_counted_right);
    RUN_TEST(health_is_sticky_until_cleared);
    RUN_TEST(invariants_notice_damage);
    return UNITY_END();
}
