/* settings.h: how every filter checks its settings, and what follows from them; internal, not installed. */
#ifndef AEOLID_SETTINGS_H
#define AEOLID_SETTINGS_H

#include "aeolid/config.h"
#include "aeolid/status.h"

#include "root.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_settings_judge          aeo_settings_judge_f64
#define aeo_settings_judge_common   aeo_settings_judge_common_f64
#define aeo_settings_find_scan_step aeo_settings_find_scan_step_f64
#define aeo_settings_count_bits     aeo_settings_count_bits_f64
#endif

/* Return 1 when low <= x <= high; x is finite. */
static inline int aeo_is_between(aeo_real_t x, aeo_real_t low, aeo_real_t high)
{
    return x >= low && x <= high;
}

/* Return lambda^(-1/2), which is exactly 1 for lambda = 1, as a filter that forgets nothing needs: the factor of P is
 * scaled by it at every sample. -ffast-math makes 1 / sqrtf an estimate with one Newton step, 6e-8 below 1 on some
 * processors, and P then loses 3.5 % in 300,000 samples. */
static inline aeo_real_t aeo_inverse_root(aeo_real_t lambda)
{
    return lambda < AEO_REAL(1) ? AEO_REAL(1) / AEO_SQRT(lambda) : AEO_REAL(1); /* lambda >= 1/2 */
}

/* Judge count settings that lie side by side: AEO_OK, AEO_E_NOT_FINITE, or AEO_E_ARG when one is below ranges[i][0] or
 * above ranges[i][1]. */
aeo_status_t aeo_settings_judge(const aeo_real_t *settings, const aeo_real_t (*ranges)[2], size_t count);

/* Judge what the filters have in common. */
aeo_status_t aeo_settings_judge_common(aeo_real_t forgetting, aeo_real_t regularisation, aeo_real_t excitation_min,
                                       aeo_real_t growth_max);

/* Return how many of count variances to check a sample so that each comes round before forgetting can double it. */
uint32_t aeo_settings_find_scan_step(unsigned count, aeo_real_t lambda);

/* Return how many bits of mask are set. */
unsigned aeo_settings_count_bits(uint32_t mask);

#endif
/* SPDX-License-Identifier: MIT */
