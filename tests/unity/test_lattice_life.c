/* How the lattice is used: read-outs in slices, copies, its saved form, what it refuses, its health. */
#include "lattice_bench.h"
#include "samples.h"
#include "saved.h"
#include "unity.h"

#include <math.h>
#include <string.h>

void setUp(void)
{
    reset_lattice_bench();
}

void tearDown(void)
{
}

static void slices_and_copies_read_one_sample(void)
{
    aeo_real_t whole[L * N], slices[L * N], copied[L * N];
    start_lattice(0.99, 0, 1e6);
    for (int k = 0; k < 200; k++) {
        feed_lattice(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, whole, L * N));
    for (int j = 0; j + 1 < P; j++) {
        TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_lattice_read_next(&lattice, slices, L * N));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read_next(&lattice, slices, L * N));
    TEST_ASSERT_EQUAL_MEMORY(whole, slices, sizeof whole);
    /* the copy is read slice by slice while the filter goes on, and must tell of the sample it was taken at */
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &twin, twin_memory, WORDS));
    for (int j = 0; j < P; j++) {
        feed_lattice(1.0, 0.1);
        TEST_ASSERT_EQUAL_INT(j + 1 < P ? AEO_FILLING : AEO_OK, aeo_lattice_read_next(&twin, copied, L * N));
        TEST_ASSERT_TRUE(aeo_lattice_invariants_hold(&twin));
    }
    TEST_ASSERT_EQUAL_MEMORY(whole, copied, sizeof whole);
    /* an update between two slices begins the read-out anew */
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_lattice_read_next(&lattice, slices, L * N));
    feed_lattice(1.0, 0.1);
    for (int j = 0; j < P; j++) {
        TEST_ASSERT_EQUAL_INT(j + 1 < P ? AEO_FILLING : AEO_OK, aeo_lattice_read_next(&lattice, slices, L * N));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, whole, L * N));
    TEST_ASSERT_EQUAL_MEMORY(whole, slices, sizeof whole);
}

static void a_copy_goes_on_alike(void)
{
    aeo_real_t one[L * N], two[L * N];
    start_lattice(0.99, 0.05, 1000);
    for (int k = 0; k < 100; k++) {
        feed_lattice(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(&lattice, &twin, twin_memory, WORDS));
    for (int k = 0; k < 50; k++) {
        feed_lattice(1.0, 0.1);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&twin, lattice_z, lattice_y));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, one, L * N));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&twin, two, L * N));
    TEST_ASSERT_EQUAL_MEMORY(one, two, sizeof one);
    const aeo_lattice_t untouched = twin;
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_lattice_copy(&lattice, &twin, twin_memory, WORDS - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(&lattice, &lattice, twin_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(NULL, &twin, twin_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(&lattice, NULL, twin_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_copy(&lattice, &twin, NULL, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &twin, sizeof twin);
}

/* A window is new when any of its older entries is not the one kept, and then what is kept is all of it. */
static void each_older_entry_tells_a_new_window(void)
{
    for (size_t j = 0; j < (P - 1) * M; j++) {
        start_lattice(0.99, 0, 1e6);
        for (unsigned k = 0; k < 30u; k++) {
            feed_lattice(1.0, 0.1);
        }
        TEST_ASSERT_EQUAL_UINT32(0, lattice.count.restarted);
        draw_lattice_sample(1.0, 0.1);
        lattice_z[j] += AEO_REAL(0.5);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
        TEST_ASSERT_EQUAL_UINT32(1, lattice.count.restarted);
        TEST_ASSERT_EQUAL_MEMORY(lattice_z, lattice.window, P * M * sizeof *lattice_z);
        for (unsigned k = 0; k < 10u; k++) {
            feed_lattice(1.0, 0.1);
        }
        TEST_ASSERT_EQUAL_UINT32(1, lattice.count.restarted);
    }
}

/* Released covariances learn at once, though the sample brought little news. */
static void what_is_released_is_not_withheld(void)
{
    unsigned seen = 0;
    start_lattice(0.95, 0.9, 1e4);
    for (unsigned k = 0; k < 3000u && seen < 5u; k++) {
        feed_lattice(1.0, 0.1);
        if (k < 200u) {
            continue;
        }
        const uint32_t released = lattice.count.released;
        lattice.watched[0] = AEO_REAL(1e12); /* as a fault leaves it */
        lattice.learning = 5000;             /* of a false start, which is over with it */
        feed_lattice(1.0, 0.1);
        if (lattice.count.released > released) {
            const int little = lattice.news - lattice.config.forgetting < lattice.gate;
            TEST_ASSERT_EQUAL_UINT32(0, lattice.quiet);
            TEST_ASSERT_EQUAL_UINT32(0, lattice.learning);
            seen += little != 0;
        }
    }
    TEST_ASSERT_EQUAL_UINT(5, seen);
}

/* A sample at which an error ran away is none that the gate withheld. */
static void what_ran_away_is_not_withheld(void)
{
    unsigned seen = 0;
    start_lattice(0.95, 0.9, 1e4);
    for (unsigned k = 0; k < 3000u && seen == 0u; k++) {
        feed_lattice(1.0, 0.1);
        if (k >= 200u && lattice.quiet) {
            lattice.target_weight[0] = AEO_REAL(1e25);
            feed_lattice(1.0, 0.1);
            TEST_ASSERT_EQUAL_UINT32(1, lattice.count.reinitialised);
            TEST_ASSERT_EQUAL_UINT32(0, lattice.following);
            TEST_ASSERT_EQUAL_UINT32(0, lattice.watch.withheld);
            seen++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(1, seen);
}

/* A whole read-out does not go on where slices stopped. */
static void a_whole_read_begins_at_the_beginning(void)
{
    aeo_real_t whole[L * N], again[L * N];
    start_lattice(0.99, 0, 1e6);
    for (int k = 0; k < 200; k++) {
        feed_lattice(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, whole, L * N));
    for (int slices = 1; slices < P; slices++) {
        for (int j = 0; j < slices; j++) {
            TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_lattice_read_next(&lattice, again, L * N));
        }
        memset(again, 0, sizeof again);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, again, L * N));
        TEST_ASSERT_EQUAL_MEMORY(whole, again, sizeof whole);
    }
}

/* After a first window within a record, 4 n absorbed samples are learnt from and then thrown away: P is what it was at the
 * start, weights stay. After a start from rest nothing is. */
static void a_start_within_a_record_is_thrown_away_once(void)
{
    for (unsigned rest = 0; rest < 2u; rest++) {
        start_lattice(0.99, 0, 1e6);
        const aeo_real_t prior = lattice.factor[0];
        if (rest == 0u) {
            fill(lattice_z, P * M, &lattice_seed);
        }
        for (unsigned k = 1; k < 12u * N; k++) {
            aeo_real_t weights[(P - 1) * M * M];
            memcpy(weights, lattice.forward_weight, sizeof weights);
            feed_lattice(1.0, 0.1);
            const int thrown = rest == 0u && k == 4u * N;
            TEST_ASSERT_EQUAL_INT(thrown, fabs((double)(lattice.factor[0] - prior)) < 1e-9 * (double)prior);
            TEST_ASSERT_EQUAL_UINT32(rest == 0u && k < 4u * N ? 4u * N - k : 0u, lattice.learning);
            TEST_ASSERT_TRUE(k < 20u || memcmp(weights, lattice.forward_weight, sizeof weights) != 0);
            double size = 0.0;
            for (size_t j = 0; j < (P - 1) * M * M; j++) {
                size += fabs((double)lattice.forward_weight[j]);
            }
            TEST_ASSERT_TRUE(!thrown || size > 0.0);
        }
    }
}

/* A new one holds its prior, lambda for each alpha, and zeros; so does one that was reset. */
static void a_fresh_lattice_holds_its_prior_alone(void)
{
    static aeo_real_t fresh[SAVED], again[SAVED];
    for (unsigned t = 0; t < 2u; t++) {
        start_lattice(0.875, 0.05, 1000);
        for (unsigned k = 0; k < 60u && t == 1u; k++) {
            feed_lattice(1.0, 0.1);
        }
        aeo_lattice_reset(&lattice);
        memset(&lattice.count, 0, sizeof lattice.count); /* these and the flags stay */
        aeo_lattice_clear_health(&lattice);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&lattice, t == 0u ? fresh : again, SAVED));
        TEST_ASSERT_EQUAL_UINT32(P, lattice.orders);
        TEST_ASSERT_EQUAL_UINT32(0, lattice.learning | lattice.head | lattice.scan | lattice.begun | lattice.quiet);
        TEST_ASSERT_EQUAL_UINT32(0, lattice.read_order);
        for (size_t j = 0; j < P; j++) {
            TEST_ASSERT_TRUE(fabs((double)lattice.alpha[j] - 0.875) < 1e-6);
        }
        for (const aeo_real_t *word = lattice.present_weight; word < lattice.forward; word++) {
            const int is_alpha = word >= lattice.alpha && word < lattice.step;
            const int is_level = word >= lattice.watched + 2 && word < lattice.watched + 2 + L;
            TEST_ASSERT_TRUE(is_alpha || is_level || fabs((double)*word) < 1e-30);
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(fresh, again, sizeof fresh);
}

static void refused_reads_leave_theta(void)
{
    aeo_real_t theta[L * N];
    start_lattice(0.99, 0, 1e6);
    feed_lattice(1.0, 0.1);
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

static void runaway_starts_afresh(void)
{
    aeo_real_t *const weights[3] = {lattice.target_weight, lattice.forward_weight, lattice.backward_weight};
    for (unsigned t = 0; t < 3; t++) {
        start_lattice(1.0, 0, 1000);
        for (int k = 0; k < 100; k++) {
            feed_lattice(1.0, 0.01);
        }
        weights[t][0] = AEO_REAL(1e20); /* as a flipped bit would */
        feed_lattice(1.0, 0.01);
        TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_REINITIALISED, aeo_lattice_health(&lattice));
        TEST_ASSERT_EQUAL_UINT32(1, lattice.count.reinitialised);
        TEST_ASSERT_EQUAL_UINT32(4u * N - 1u, lattice.learning); /* it began within a record */
        TEST_ASSERT_EQUAL_MEMORY(lattice_z, lattice.window, P * M * sizeof *lattice_z);
        for (int k = 0; k < 2000; k++) {
            feed_lattice(1.0, 0.01);
        }
        TEST_ASSERT_EQUAL_UINT32(0, lattice.count.restarted);
        TEST_ASSERT_TRUE(distance_from_lattice_model() < 0.01);
    }
}

static void runaway_of_blocks_that_no_target_shows_is_noticed(void)
{
    /* y hangs on nothing, so errors of blocks reach no target, large as they are */
    start_lattice(1.0, 0, 1000);
    for (int k = 0; k < 100; k++) {
        feed_lattice(1.0, 0.01);
    }
    memset(lattice.target_weight, 0, P * M * (L + D) * sizeof *lattice.target_weight);
    memset(lattice.backward_weight, 0, (P - 1) * M * M * sizeof *lattice.backward_weight);
    lattice.backward_weight[(P - 2) * M * M] = AEO_REAL(1e12); /* of the last stage: nothing else meets it */
    feed_lattice(1.0, 0.01);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_REINITIALISED, aeo_lattice_health(&lattice));
}

static void settings_out_of_range_are_refused(void)
{
    static const double BAD[][4] = {{0.49, 1, 0, 4},  {1.01, 1, 0, 4},  {1, 0.9e-8, 0, 4},
                                    {1, 1.1e8, 0, 4}, {1, 1, -0.1, 4},  {1, 1, 1.1, 4},
                                    {1, 1, 0, 3.9},   {1, 1, 0, 1.1e6}, {1, 1e-8, 0, 200}};
    const aeo_lattice_t untouched = lattice;
    for (size_t t = 0; t < sizeof BAD / sizeof BAD[0]; t++) {
        aeo_lattice_config_t config = make_lattice_config(BAD[t][0], BAD[t][2], BAD[t][3]);
        config.regularisation = (aeo_real_t)BAD[t][1];
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, lattice_memory, WORDS));
    }
    for (int t = 0; t < 16; t++) {
        aeo_lattice_config_t config = make_lattice_config(1, 0, 4);
        aeo_real_t *const fields[4] = {&config.forgetting, &config.regularisation, &config.excitation_min,
                                       &config.growth_max};
        *fields[t / 4] = make_not_finite(t % 4);
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_lattice_init(&lattice, &config, lattice_memory, WORDS));
    }
    static const uint16_t SIZES[][4] = {{0, 3, 0, 1},     {1, 0, 0, 1},     {4, 3, 4, 1},    {4, 3, 0, 0},
                                        {4, 3, 0, 33},    {1, 97, 0, 1},    {1025, 1, 0, 1}, {341, 3, 2, 1},
                                        {65535, 1, 0, 1}, {1, 65535, 0, 1}, {4, 3, 65535, 1}};
    for (size_t t = 0; t < sizeof SIZES / sizeof SIZES[0]; t++) {
        aeo_lattice_config_t config = make_lattice_config(1, 0, 4);
        config.past = SIZES[t][0];
        config.block = SIZES[t][1];
        config.present = SIZES[t][2];
        config.outputs = SIZES[t][3];
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, lattice_memory, WORDS));
    }
    aeo_lattice_config_t config = make_lattice_config(0.5, 0, 4);
    config.past = 22; /* 0.5^21 < 1e-6: a window longer than the memory */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, lattice_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(NULL, &config, lattice_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, NULL, lattice_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_lattice_init(&lattice, &config, NULL, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &lattice, sizeof lattice);
    start_lattice(0.99, 0.05, 1000);
    feed_lattice(1.0, 0.1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&lattice, &lattice.config, lattice_memory, WORDS)); /* its own */
    TEST_ASSERT_TRUE(lattice.config.past == P && lattice.count.updates == 0u && aeo_lattice_invariants_hold(&lattice));
}

/* Restore an array that was tampered with, under a seal of its own: the seal is not the only judge. */
static aeo_status_t restore_sealed(aeo_real_t *words)
{
    aeo_saved_seal(words, SAVED);
    return aeo_lattice_restore(&lattice, words, SAVED);
}

static void restore_names_what_is_wrong(void)
{
    static aeo_real_t saved[SAVED];
    start_lattice(0.99, 0.05, 1000);
    for (int k = 0; k < 20; k++) {
        feed_lattice(1.0, 0.1);
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
                                  restore_sealed(saved));
            saved[i] = good;
            TEST_ASSERT_EQUAL_MEMORY(&before, &lattice, sizeof lattice);
        }
    }
    static const struct {
        size_t word;
        double value;
    } PLACES[] = {{27, P + 1}, {28, 1}, {31, P}, {33, (2 * P - 1) * M + D}, {35, 2}, {37, 2}, {45, 3}, {47, 2}};
    for (size_t t = 0; t < sizeof PLACES / sizeof PLACES[0]; t++) {
        const aeo_real_t good = saved[PLACES[t].word];
        saved[PLACES[t].word] = (aeo_real_t)PLACES[t].value;
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_sealed(saved));
        saved[PLACES[t].word] = good;
        TEST_ASSERT_EQUAL_MEMORY(&before, &lattice, sizeof lattice);
    }
    const struct {
        const aeo_real_t *word;
        double value;
    } WORDS_OUT[] = {{lattice.alpha, 4e35},          {lattice.alpha + P - 1, 0.4},   {lattice.step, 2.1},
                     {lattice.step + 1, -1e-3},      {lattice.gain, 2e23},           {lattice.gain + P * M - 1, -1e6},
                     {lattice.present_weight, 2e26}, {lattice.target_weight, -2e26}, {lattice.forward_weight, 1e27},
                     {lattice.window - 1, 1e27},     {lattice.window, 1.1e6},        {lattice.error, 1.1e10},
                     {lattice.watched, -1},          {lattice.watched + 2, 1.1},     {lattice.watched + 2 + L, 2e6}};
    for (size_t t = 0; t < sizeof WORDS_OUT / sizeof WORDS_OUT[0]; t++) {
        aeo_real_t *const word = saved + AEO_LATTICE_SAVED_HEAD + (WORDS_OUT[t].word - lattice.factor);
        const aeo_real_t good = *word;
        *word = (aeo_real_t)WORDS_OUT[t].value;
        TEST_ASSERT_EQUAL_INT_MESSAGE(AEO_E_DAMAGED, restore_sealed(saved), "a word no lattice can hold");
        *word = good;
        TEST_ASSERT_EQUAL_INT(AEO_OK, restore_sealed(saved));
    }
    saved[AEO_LATTICE_SAVED_HEAD] = AEO_REAL(0); /* first diagonal entry */
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_sealed(saved));
}

static void saved_head_is_counted_right(void)
{
    /* the formula, the writer and this test agree: the state starts right after the head */
    static aeo_real_t saved[SAVED];
    start_lattice(1, 0, 4);
    feed_lattice(1.0, 0.1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&lattice, saved, SAVED));
    TEST_ASSERT_EQUAL_MEMORY(lattice.factor, saved + AEO_LATTICE_SAVED_HEAD,
                             sizeof *saved * AEO_LATTICE_STATE(P, M, D, L));
}

static void health_is_sticky_until_cleared(void)
{
    start_lattice(0.99, 0.9, 1000);
    feed_lattice(1e-6, 0.0);
    feed_lattice(1e-6, 0.0);
    feed_lattice(1.0, 0.0);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_WITHHELD, aeo_lattice_health(&lattice));
    aeo_lattice_reset(&lattice);
    TEST_ASSERT_EQUAL_UINT32(AEO_LATTICE_WITHHELD, aeo_lattice_health(&lattice));
    aeo_lattice_clear_health(&lattice);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(&lattice));
    TEST_ASSERT_TRUE(lattice.count.withheld >= 1);
    lattice.count.updates = UINT32_MAX;
    feed_lattice(1.0, 0.0);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, lattice.count.updates); /* never decreases */
    aeo_lattice_reset(NULL);
    aeo_lattice_clear_health(NULL);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(NULL));
    TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(NULL));
}

static void invariants_notice_damage(void)
{
    start_lattice(0.99, 0, 100);
    feed_lattice(1.0, 0.1);
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
    RUN_TEST(slices_and_copies_read_one_sample);
    RUN_TEST(a_copy_goes_on_alike);
    RUN_TEST(a_fresh_lattice_holds_its_prior_alone);
    RUN_TEST(each_older_entry_tells_a_new_window);
    RUN_TEST(what_is_released_is_not_withheld);
    RUN_TEST(what_ran_away_is_not_withheld);
    RUN_TEST(a_whole_read_begins_at_the_beginning);
    RUN_TEST(a_start_within_a_record_is_thrown_away_once);
    RUN_TEST(refused_reads_leave_theta);
    RUN_TEST(runaway_starts_afresh);
    RUN_TEST(runaway_of_blocks_that_no_target_shows_is_noticed);
    RUN_TEST(settings_out_of_range_are_refused);
    RUN_TEST(restore_names_what_is_wrong);
    RUN_TEST(saved_head_is_counted_right);
    RUN_TEST(health_is_sticky_until_cleared);
    RUN_TEST(invariants_notice_damage);
    return UNITY_END();
}
