/* aeolid_block.c: see aeolid_block.h; sizes, channels and settings are what you change. */
#include "aeolid_block.h"

#ifdef AEOLID_TWO_FILES
#include "aeolid.h"
#else
#include <aeolid/estimator.h>
#include <aeolid/markov.h>
#endif

static const aeo_channel_t channels[BLOCK_INPUTS + BLOCK_OUTPUTS] = {
    {.name = "u", .unit = "V", .offset = 0, .scale = 1, .minimum = -100, .maximum = 100},
    {.name = "y", .unit = "m", .offset = 0, .scale = 2, .minimum = -100, .maximum = 100}};
static aeo_real_t words[AEO_ESTIMATOR_RLS_WORDS(BLOCK_INPUTS, BLOCK_OUTPUTS, BLOCK_PAST, 0, 0)];
static aeo_real_t parameters[BLOCK_PARAMETERS];
static aeo_estimator_t estimator;

int aeolid_block_start(void)
{
    const aeo_estimator_config_t settings = {.inputs = BLOCK_INPUTS,
                                             .outputs = BLOCK_OUTPUTS,
                                             .past = BLOCK_PAST,
                                             .period_us = BLOCK_PERIOD_US,
                                             .channels = channels,
                                             .forgetting = AEO_REAL(0.999),
                                             .regularisation = AEO_REAL(0.001),
                                             .excitation_min = AEO_REAL(0.05),
                                             .growth_max = AEO_REAL(10)};
    return (int)aeo_estimator_init(&estimator, aeo_estimator_rls, &settings, words, sizeof words / sizeof *words);
}

int aeolid_block_step(const double u[BLOCK_INPUTS], const double y[BLOCK_OUTPUTS], double time_s,
                      double innovation[BLOCK_OUTPUTS], double markov[BLOCK_PARAMETERS])
{
    aeo_real_t in[BLOCK_INPUTS], out[BLOCK_OUTPUTS];
    for (int i = 0; i < BLOCK_INPUTS; i++) {
        in[i] = (aeo_real_t)u[i];
    }
    for (int i = 0; i < BLOCK_OUTPUTS; i++) {
        out[i] = (aeo_real_t)y[i];
    }
    const aeo_status_t status = aeo_estimator_take(&estimator, in, out, (uint64_t)(time_s * 1e6 + 0.5));
    for (int i = 0; i < BLOCK_OUTPUTS; i++) {
        const aeo_real_t scale = channels[BLOCK_INPUTS + i].scale;
        innovation[i] = status == AEO_OK ? (double)(aeo_estimator_innovation(&estimator)[i] * scale) : 0.0;
    }
    if (aeo_markov_read(&estimator.regressor, aeo_estimator_theta(&estimator), parameters, BLOCK_PARAMETERS) ==
        AEO_OK) {
        for (int i = 0; i < BLOCK_PARAMETERS; i++) {
            markov[i] = (double)parameters[i];
        }
    }
    return (int)status;
}
/* SPDX-License-Identifier: MIT */
