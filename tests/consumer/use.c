/* Identify y_k = 0.5 u_{k-1} - 0.25 y_{k-1} the way a controller would: memory at compile time, one call a sample. */
#include <aeolid/markov.h>
#include <aeolid/regressor.h>
#include <aeolid/rls.h>
#include <aeolid/status.h>

#include <stdio.h>

enum { R = 1, L = 1, P = 1, N = AEO_REGRESSOR_LENGTH(R, L, P, 0, 0) };

int main(void)
{
    static aeo_real_t window[AEO_REGRESSOR_WORDS(R, L, P, 0)], words[AEO_RLS_WORDS(N, L)];
    static aeo_regressor_t regressor;
    static aeo_rls_t rls;
    const aeo_regressor_config_t layout = {.inputs = R, .outputs = L, .past = P, .period_us = 100000};
    const aeo_rls_config_t settings = {.regressors = N,
                                       .outputs = L,
                                       .forgetting = AEO_REAL(1),
                                       .regularisation = AEO_REAL(1e-3),
                                       .excitation_min = AEO_REAL(0.05),
                                       .growth_max = AEO_REAL(1000)};
    if (aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window) != AEO_OK ||
        aeo_rls_init(&rls, &settings, words, sizeof words / sizeof *words) != AEO_OK) {
        return 1;
    }
    aeo_real_t u = 0, y = 0;
    for (unsigned k = 0; k < 1000; k++) {
        y = AEO_REAL(0.5) * u - AEO_REAL(0.25) * y;
        u = (aeo_real_t)(k * k % 17u) / 8 - 1;
        if (aeo_regressor_push(&regressor, &u, &y, k * UINT64_C(100000)) == AEO_OK) {
            aeo_rls_update(&rls, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor));
        }
    }
    aeo_real_t xi[AEO_MARKOV_WORDS(N, L)];
    const aeo_status_t status = aeo_markov_read(&regressor, aeo_rls_theta(&rls), xi, AEO_MARKOV_WORDS(N, L));
    printf("%s: %u-byte numbers, Xi = [%.4f %.4f]\n", aeo_status_text(status), (unsigned)sizeof(aeo_real_t),
           (double)xi[0], (double)xi[1]);
    const double error_u = (double)xi[0] - 0.5, error_y = (double)xi[1] + 0.25;
    return error_u * error_u + error_y * error_y < 1e-8 ? 0 : 1;
}
