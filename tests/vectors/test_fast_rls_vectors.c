/* The fast filter against vectors that numpy made from batch least squares; see generate_fast_rls.py. */
#include "aeolid/fast_rls.h"
#include "fast_rls_vectors.h"
#include "samples.h"
#include "unity.h"

#include <string.h>

enum { P_MAX = 4, M_MAX = 3, D_MAX = 2, N_MAX = P_MAX * M_MAX + D_MAX, L_MAX = 3 };

void setUp(void)
{
}

void tearDown(void)
{
}

static void vectors_are_met(void)
{
    for (size_t c = 0; c < sizeof FAST_RLS_VECTORS / sizeof FAST_RLS_VECTORS[0]; c++) {
        static aeo_real_t memory[AEO_FAST_RLS_WORDS(P_MAX, M_MAX, D_MAX, L_MAX)];
        const unsigned m = FAST_RLS_VECTORS[c].block, l = FAST_RLS_VECTORS[c].outputs;
        const size_t past = (size_t)FAST_RLS_VECTORS[c].past * m;
        const aeo_fast_rls_config_t config = {.past = (uint16_t)FAST_RLS_VECTORS[c].past,
                                              .block = (uint16_t)m,
                                              .outputs = (uint16_t)l,
                                              .feedthrough = FAST_RLS_VECTORS[c].mask,
                                              .forgetting = (aeo_real_t)FAST_RLS_VECTORS[c].forgetting,
                                              .regularisation = (aeo_real_t)FAST_RLS_VECTORS[c].regularisation,
                                              .growth_max = AEO_REAL(1e6)};
        aeo_fast_rls_t fast;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, memory, sizeof memory / sizeof *memory));
        aeo_real_t z[N_MAX] = {AEO_REAL(0)}, y[L_MAX];
        for (size_t k = 0; k < FAST_RLS_VECTORS[c].count; k++) {
            const double *const block = FAST_RLS_VECTORS[c].blocks + k * m;
            size_t n = past;
            for (size_t j = 0; j < m; j++) {
                if ((config.feedthrough >> j & 1u) != 0u) {
                    z[n++] = (aeo_real_t)block[j];
                }
            }
            for (size_t i = 0; i < l; i++) {
                y[i] = (aeo_real_t)FAST_RLS_VECTORS[c].y[k * l + i];
            }
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
            memmove(z, z + m, (past - m) * sizeof *z);
            for (size_t j = 0; j < m; j++) {
                z[past - m + j] = (aeo_real_t)block[j];
            }
        }
        /* Digits of the vectors are 13; the arrays lose some hundred rounding errors before n samples have come. */
        const double bound = 1000.0 * (double)AEO_REAL_EPSILON + 1e-11;
        TEST_ASSERT_TRUE(
            relative_distance(aeo_fast_rls_theta(&fast), FAST_RLS_VECTORS[c].theta, (size_t)fast.length * l) < bound);
        TEST_ASSERT_EQUAL_UINT32(0, aeo_fast_rls_health(&fast));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(vectors_are_met);
    return UNITY_END();
}
