/* The filter against vectors that numpy made from batch least squares; see generate.py. */
#include "aeolid/rls.h"
#include "rls_vectors.h"
#include "samples.h"
#include "unity.h"

enum { N_MAX = 12, L_MAX = 3 };

void setUp(void)
{
}

void tearDown(void)
{
}

static void vectors_are_met(void)
{
    for (size_t c = 0; c < sizeof RLS_VECTORS / sizeof RLS_VECTORS[0]; c++) {
        static aeo_real_t memory[AEO_RLS_WORDS(N_MAX, L_MAX)];
        const unsigned n = RLS_VECTORS[c].n, l = RLS_VECTORS[c].l;
        const aeo_rls_config_t config = {.regressors = (uint16_t)n,
                                         .outputs = (uint16_t)l,
                                         .forgetting = (aeo_real_t)RLS_VECTORS[c].forgetting,
                                         .regularisation = (aeo_real_t)RLS_VECTORS[c].regularisation,
                                         .excitation_min = AEO_REAL(0),
                                         .growth_max = AEO_REAL(1e6)};
        aeo_rls_t rls;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, AEO_RLS_WORDS(n, l)));
        for (size_t k = 0; k < RLS_VECTORS[c].count; k++) {
            aeo_real_t z[N_MAX], y[L_MAX];
            for (size_t j = 0; j < n; j++) {
                z[j] = (aeo_real_t)RLS_VECTORS[c].z[k * n + j];
            }
            for (size_t i = 0; i < l; i++) {
                y[i] = (aeo_real_t)RLS_VECTORS[c].y[k * l + i];
            }
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
        }
        /* the vectors are written with 13 digits, so double can be met to a few 1e-12 at best */
        const double bound = 100.0 * (double)AEO_REAL_EPSILON + 1e-11;
        TEST_ASSERT_TRUE(relative_distance(aeo_rls_theta(&rls), RLS_VECTORS[c].theta, (size_t)n * l) < bound);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(vectors_are_met);
    return UNITY_END();
}
