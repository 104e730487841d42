/* The fast filter's settings, its saved form, its read-out and its invariants; its behaviour is in test_fast_rls.c. */
#include "aeolid/fast_rls.h"
#include "samples.h"
#include "saved.h"
#include "unity.h"

#include <string.h>

enum { P = 6, M = 4, D = 1, L = 2, N = P * M + D, WORDS = AEO_FAST_RLS_WORDS(P, M, D, L) };
enum { SAVED = AEO_FAST_RLS_SAVED_WORDS(P, M, D, L) };

static aeo_fast_rls_t fast;
static aeo_real_t fast_memory[WORDS], saved[SAVED];

void setUp(void)
{
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

/* A filter that has seen 100 samples of noise, the second entry of each block present in z. */
static void start_and_feed(void)
{
    const aeo_fast_rls_config_t config = make_config(M, 2, 0.998, 1, 10);
    aeo_real_t z[N] = {AEO_REAL(0)}, block[M], y[L];
    uint64_t seed = 5;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    for (int k = 0; k < 100; k++) {
        fill(block, M, &seed);
        fill(y, L, &seed);
        z[N - 1] = block[1];
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        memmove(z, z + M, (P - 1) * M * sizeof *z);
        memcpy(z + (P - 1) * M, block, M * sizeof *z);
    }
}

static void settings_out_of_range_are_refused(void)
{
    static const double BAD[][3] = {{0.49, 1, 4}, {1.01, 1, 4},  {1, 0.9e-8, 4}, {1, 1.1e8, 4},
                                    {1, 1, 3.9},  {1, 1, 1.1e6}, {1, 1e-8, 200}, {0, 1, 4},
                                    {-1.0, 1, 4}, {1, 0, 4},     {1, -1, 4}};
    const aeo_fast_rls_t untouched = fast;
    for (size_t t = 0; t < sizeof BAD / sizeof BAD[0]; t++) {
        const aeo_fast_rls_config_t config = make_config(M, 0, BAD[t][0], BAD[t][1], BAD[t][2]);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    }
    for (int t = 0; t < 12; t++) {
        aeo_fast_rls_config_t config = make_config(M, 0, 1, 1, 4);
        aeo_real_t *const fields[3] = {&config.forgetting, &config.regularisation, &config.growth_max};
        *fields[t / 4] = make_not_finite(t % 4);
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    }
    static const uint32_t SIZES[][4] = {{0, 4, 2, 0},  {1025, 1, 1, 0}, {2, 0, 2, 0},   {2, 97, 2, 0}, {2, 4, 0, 0},
                                        {2, 4, 33, 0}, {2, 4, 2, 16},   {256, 4, 1, 1}, {600, 2, 1, 0}};
    for (size_t t = 0; t < sizeof SIZES / sizeof SIZES[0]; t++) {
        aeo_fast_rls_config_t config = make_config(SIZES[t][1], SIZES[t][3], 1, 1, 4);
        config.past = (uint16_t)SIZES[t][0];
        config.outputs = (uint16_t)SIZES[t][2];
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    }
    aeo_fast_rls_config_t config = make_config(M, 0, 0.97, 1, 4);
    config.past = 230; /* 0.97^230 < 1/1000 */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_init(&fast, &config, fast_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_init(NULL, &config, fast_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_init(&fast, NULL, fast_memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_init(&fast, &config, NULL, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &fast, sizeof fast);
    start_and_feed();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &fast.config, fast_memory, WORDS)); /* its own, once more */
    TEST_ASSERT_TRUE(fast.config.past == P && fast.count.updates == 0u && aeo_fast_rls_invariants_hold(&fast));
}

/* Restore an array that was tampered with, under a seal of its own: the seal is not the only judge. */
static aeo_status_t restore_sealed(aeo_real_t *words)
{
    aeo_saved_seal(words, SAVED);
    return aeo_fast_rls_restore(&fast, words, SAVED);
}

static void restore_names_what_is_wrong(void)
{
    start_and_feed();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&fast, saved, SAVED));
    const aeo_fast_rls_t before = fast;
    for (size_t i = 0; i < AEO_FAST_RLS_SAVED_HEAD; i++) { /* settings, then numbers in halves */
        const aeo_real_t wrong[3] = {saved[i] + AEO_REAL(0.5), AEO_REAL(-1), AEO_REAL(65536)};
        const aeo_status_t status = i == 0 ? AEO_E_VERSION : i < 10 ? AEO_E_MISMATCH : AEO_E_DAMAGED;
        for (int t = 0; t < 3; t++) {
            const aeo_real_t good = saved[i];
            saved[i] = wrong[t];
            TEST_ASSERT_EQUAL_INT(status, restore_sealed(saved));
            saved[i] = good;
            TEST_ASSERT_EQUAL_MEMORY(&before, &fast, sizeof fast);
        }
    }
    const size_t factor = AEO_FAST_RLS_SAVED_HEAD + N * (2 * M + 2) + 2 * M;
    const struct {
        size_t at;
        double value;
    } damage[] = {
        {13, P + 2},                                           /* more samples than the window holds */
        {15, 2},                                               /* a third array */
        {37, P + 3},                                           /* a disturbance that the window cannot hold still */
        {38, 60000},                                           /* astray for longer than is borne */
        {AEO_FAST_RLS_SAVED_HEAD + 2 * M * N + N + M, 1.1e20}, /* a share no variance makes */
        {AEO_FAST_RLS_SAVED_HEAD + 2 * AEO_FAST_RLS_ARRAY_WORDS(P, M, D) + N * L + N + M, 1}, /* disturbances */
        {AEO_FAST_RLS_SAVED_HEAD + 2 * AEO_FAST_RLS_ARRAY_WORDS(P, M, D) + N * L + 2 * (N + M) - 1, -1},
        {factor, 1e7},                                /* a factor beyond any variance */
        {factor + M * (M + 1) / 2, 1e34},             /* an energy no data have */
        {factor + M * (M + 1) / 2 + M * M + 1, 1e21}, /* a disagreement no array goes on with */
        {factor, 0},                                  /* a diagonal entry of the factor */
        {factor + M * (M + 1) / 2 + M * M, 0.5},      /* 1 / gamma below 1 */
        {factor + M * (M + 1) / 2 + M * M, 1e21},     /* 1 / gamma that no array goes on with */
        {AEO_FAST_RLS_SAVED_HEAD + 2 * M * N, 1e30},  /* a gain that could move A out of bounds */
        {AEO_FAST_RLS_SAVED_HEAD + AEO_FAST_RLS_ARRAY_WORDS(P, M, D), -2e30}, /* a rest that could overflow */
        {AEO_FAST_RLS_SAVED_HEAD + 2 * AEO_FAST_RLS_ARRAY_WORDS(P, M, D) + N * L, 1.2e6}, /* the window */
        {AEO_FAST_RLS_SAVED_HEAD + 2 * AEO_FAST_RLS_ARRAY_WORDS(P, M, D) + N * L + N + M - 1, -1.2e6},
        {factor + M * (M + 1) / 2 + M * M, 2.5e20}}; /* 1 / gamma just beyond */
    for (size_t t = 0; t < sizeof damage / sizeof damage[0]; t++) {
        const aeo_real_t good = saved[damage[t].at];
        saved[damage[t].at] = (aeo_real_t)damage[t].value;
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_sealed(saved));
        saved[damage[t].at] = good;
    }
    saved[10] = saved[11] = AEO_REAL(0); /* the random state, never 0 */
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_sealed(saved));
    TEST_ASSERT_EQUAL_MEMORY(&before, &fast, sizeof fast);
}

static void saved_head_is_counted_right(void)
{
    /* the formula, the writer and this test agree: the first array starts right after the head, residuals end it but for watch
     * and seal */
    start_and_feed();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&fast, saved, SAVED));
    TEST_ASSERT_EQUAL_MEMORY(fast.array[0].forward, saved + AEO_FAST_RLS_SAVED_HEAD, 50 * sizeof *saved);
    const size_t behind = AEO_WATCH_WORDS(L) + AEO_SAVED_SEAL;
    TEST_ASSERT_EQUAL_MEMORY(aeo_fast_rls_residual(&fast), saved + SAVED - behind - L, L * sizeof *saved);
}

static void read_copies_theta(void)
{
    aeo_real_t theta[N * L];
    const size_t count = N * L;
    start_and_feed();
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_fast_rls_read(&fast, theta, count - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_read(NULL, theta, count));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_fast_rls_read(&fast, NULL, count));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_read(&fast, theta, count));
    TEST_ASSERT_EQUAL_MEMORY(aeo_fast_rls_theta(&fast), theta, count * sizeof *theta);
}

static void invariants_notice_damage(void)
{
    start_and_feed();
    aeo_real_t *const spots[4] = {fast.array[1].factor, fast.array[0].scalar, fast.theta + 3, fast.window + 1};
    const aeo_real_t wrong[4] = {AEO_REAL(0), AEO_REAL(0.9), make_not_finite(2), AEO_REAL(2e6)};
    for (int t = 0; t < 4; t++) {
        const aeo_real_t good = *spots[t];
        *spots[t] = wrong[t];
        TEST_ASSERT_FALSE(aeo_fast_rls_invariants_hold(&fast));
        *spots[t] = good;
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(&fast));
    }
    fast.random = 0;
    TEST_ASSERT_FALSE(aeo_fast_rls_invariants_hold(&fast));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(settings_out_of_range_are_refused);
    RUN_TEST(restore_names_what_is_wrong);
    RUN_TEST(saved_head_is_counted_right);
    RUN_TEST(read_copies_theta);
    RUN_TEST(invariants_notice_damage);
    return UNITY_END();
}
