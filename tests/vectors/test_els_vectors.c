/* Extended least squares against vectors that numpy made, a batch solution a sample; see generate_els.py. */
#include "aeolid/els.h"
#include "els_vectors.h"
#include "samples.h"
#include "unity.h"

#include <math.h>

enum { N_MAX = 12, L_MAX = 2, WINDOW = 40 };

void setUp(void)
{
}

void tearDown(void)
{
}

static void vectors_are_met(void)
{
    for (size_t c = 0; c < sizeof ELS_VECTORS / sizeof ELS_VECTORS[0]; c++) {
        static aeo_real_t memory[AEO_ELS_WORDS(N_MAX, L_MAX)], window[WINDOW];
        const unsigned r = ELS_VECTORS[c].inputs, l = ELS_VECTORS[c].outputs, p = ELS_VECTORS[c].past;
        const aeo_regressor_config_t layout = {.inputs = (uint16_t)r,
                                               .outputs = (uint16_t)l,
                                               .past = (uint16_t)p,
                                               .model_set = AEO_VARMAX,
                                               .feedthrough = ELS_VECTORS[c].present,
                                               .period_us = 1};
        aeo_regressor_t regressor;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, WINDOW));
        const aeo_els_config_t config = {.regressors = regressor.length,
                                         .outputs = (uint16_t)l,
                                         .past = (uint16_t)p,
                                         .present = (uint16_t)ELS_VECTORS[c].present,
                                         .varx_samples = ELS_VECTORS[c].varx_samples,
                                         .forgetting = (aeo_real_t)ELS_VECTORS[c].forgetting,
                                         .forgetting_start = (aeo_real_t)ELS_VECTORS[c].forgetting_start,
                                         .forgetting_rate = (aeo_real_t)ELS_VECTORS[c].rate,
                                         .regularisation = (aeo_real_t)ELS_VECTORS[c].regularisation,
                                         .growth_max = AEO_REAL(1e6)};
        aeo_els_t els;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, memory, sizeof memory / sizeof *memory));
        /* the vectors are written with 13 digits, so double can be met to a few 1e-12 at best */
        const double bound = 300.0 * (double)AEO_REAL_EPSILON + 1e-11;
        for (size_t k = 0; k < ELS_VECTORS[c].count; k++) {
            aeo_real_t u[2], y[L_MAX];
            for (size_t i = 0; i < r; i++) {
                u[i] = (aeo_real_t)ELS_VECTORS[c].u[k * r + i];
            }
            for (size_t i = 0; i < l; i++) {
                y[i] = (aeo_real_t)ELS_VECTORS[c].y[k * l + i];
            }
            TEST_ASSERT_EQUAL_INT(k < p ? AEO_FILLING : AEO_OK, aeo_els_step(&els, &regressor, u, y, k + 1));
            for (size_t i = 0; k >= p && i < l; i++) {
                const double innovation = ELS_VECTORS[c].innovations[(k - p) * l + i];
                TEST_ASSERT_TRUE(fabs((double)aeo_els_innovation(&els)[i] - innovation) < bound);
            }
        }
        TEST_ASSERT_TRUE(relative_distance(aeo_els_theta(&els), ELS_VECTORS[c].theta, config.regressors * (size_t)l) <
                         bound);
        for (size_t i = 0; i < l; i++) {
            TEST_ASSERT_TRUE(fabs((double)aeo_els_residual(&els)[i] - ELS_VECTORS[c].residual[i]) < bound);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(vectors_are_met);
    return UNITY_END();
}
