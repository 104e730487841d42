/* rls_state.h: what the sources of the square-root filter share; internal, not installed. */
#ifndef AEOLID_RLS_STATE_H
#define AEOLID_RLS_STATE_H

#include "aeolid/rls.h"

#include "linalg.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_rls_judge_config aeo_rls_judge_config_f64
#endif

/* Bounds from which nothing below overflows in float. Samples are at most 1e6 (checked), variances at most
 * 2 growth_max / rho <= 2e10 (checked at init, kept by bound_variances), so entries of S are below 1.5e5 and
 *   |S'z|_j <= n 1.5e5 1e6 < 2e14,   alpha <= 1 + n (2e14)^2 < 5e31,   g_i <= P_ii^(1/2) / (2 lambda^(1/2)) < 1.1e5.
 * An innovation beyond AEO_RLS_INNOVATION_MAX forces a fresh start before it is used, so theta moves by less than 1.1e17 an
 * update, stays below 1e29 for 1e11 updates, and theta z stays below n 1e29 1e6 < 1.1e38 < FLT_MAX. */
#define AEO_RLS_INNOVATION_MAX AEO_LINALG_ERROR_MAX
#define AEO_RLS_FACTOR_MAX     AEO_REAL(2e5) /* (4 growth_max / rho)^(1/2) */
#define AEO_RLS_THETA_MAX      AEO_REAL(1e29)

/* Judge sizes and settings on the ranges of rls.h: AEO_OK, AEO_E_NOT_FINITE or AEO_E_ARG. */
aeo_status_t aeo_rls_judge_config(const aeo_rls_config_t *config);

#endif
/* SPDX-License-Identifier: MIT */
