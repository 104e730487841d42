/* settings.c: the checks of settings.h. */
#include "settings.h"

#include "linalg.h"

/* The filters' proofs against overflow start from this bound on growth_max / regularisation. */
#define VARIANCE_MAX AEO_REAL(1e10)

aeo_status_t aeo_settings_judge(const aeo_real_t *settings, const aeo_real_t (*ranges)[2], size_t count)
{
    if (!aeo_linalg_all_finite(settings, count)) {
        return AEO_E_NOT_FINITE;
    }
    for (size_t i = 0; i < count; i++) {
        if (!aeo_is_between(settings[i], ranges[i][0], ranges[i][1])) {
            return AEO_E_ARG;
        }
    }
    return AEO_OK;
}

aeo_status_t aeo_settings_judge_common(aeo_real_t forgetting, aeo_real_t regularisation, aeo_real_t excitation_min,
                                       aeo_real_t growth_max)
{
    static const aeo_real_t RANGES[4][2] = {{AEO_REAL(0.5), AEO_REAL(1)},
                                            {AEO_REAL(1e-8), AEO_REAL(1e8)},
                                            {AEO_REAL(0), AEO_REAL(1)},
                                            {AEO_REAL(4), AEO_REAL(1e6)}};
    const aeo_real_t settings[4] = {forgetting, regularisation, excitation_min, growth_max};
    const aeo_status_t status = aeo_settings_judge(settings, RANGES, 4);
    /* regularisation >= 1e-8 */
    return status == AEO_OK && growth_max / regularisation > VARIANCE_MAX ? AEO_E_ARG : status;
}

uint32_t aeo_settings_find_scan_step(unsigned count, aeo_real_t lambda)
{
    aeo_real_t shrink = lambda;
    unsigned samples = 1; /* lambda >= 1/2, so one sample never more than doubles P */
    while (samples < count && shrink * lambda >= AEO_REAL(0.5)) {
        shrink *= lambda;
        samples++;
    }
    return (count + samples - 1u) / samples;
}

unsigned aeo_settings_count_bits(uint32_t mask)
{
    unsigned bits = 0;
    for (; mask != 0u; mask &= mask - 1u) {
        bits++;
    }
    return bits;
}
/* SPDX-License-Identifier: MIT */
