/* linalg.h: kernels shared by the filters; internal, not installed.
 * Arrays of one call never overlap.
 */
#ifndef AEOLID_LINALG_H
#define AEOLID_LINALG_H

#include "aeolid/config.h"
#include "aeolid/count.h"
#include "aeolid/status.h"

#include "lanes.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_linalg_all_finite   aeo_linalg_all_finite_f64
#define aeo_linalg_all_within   aeo_linalg_all_within_f64
#define aeo_linalg_judge        aeo_linalg_judge_f64
#define aeo_linalg_judge_sample aeo_linalg_judge_sample_f64
#define aeo_linalg_copy_out     aeo_linalg_copy_out_f64
#define aeo_linalg_find_error   aeo_linalg_find_error_f64
#define aeo_linalg_dot          aeo_linalg_dot_f64
#define aeo_linalg_dot_strips   aeo_linalg_dot_strips_f64
#define aeo_linalg_move_rows    aeo_linalg_move_rows_f64
#define aeo_linalg_scale        aeo_linalg_scale_f64
#endif

/* Return 1 when none of x[0 ... count-1] is NaN or infinite, judged on their bits: a compiler told that there
 * are no NaNs (-ffast-math) would drop x != x. */
int aeo_linalg_all_finite(const aeo_real_t *x, size_t count);

/* Return 1 when -limit <= x[i] <= limit for all i, which no NaN is; limit is above 0. */
int aeo_linalg_all_within(const aeo_real_t *x, size_t count, aeo_real_t limit);

/* Judge count scaled values: AEO_OK, AEO_E_NOT_FINITE, or AEO_E_RANGE beyond AEO_SCALED_MAX. */
aeo_status_t aeo_linalg_judge(const aeo_real_t *x, size_t count);

/* Judge a sample, z (n values) and y (l values): AEO_E_ARG when one is null, else as aeo_linalg_judge, z first, with one
 * more rejected when it is not AEO_OK. */
aeo_status_t aeo_linalg_judge_sample(const aeo_real_t *z, size_t n, const aeo_real_t *y, size_t l, uint32_t *rejected);

/* Copy count values for somebody outside, into to (length values, written), which may be where they are. AEO_E_ARG: to
 * is null; AEO_E_MEMORY: length < count; neither writes. */
aeo_status_t aeo_linalg_copy_out(const aeo_real_t *from, size_t count, aeo_real_t *to, size_t length);

/* Return the sum of x[i] y[i] over count terms. */
aeo_real_t aeo_linalg_dot(const aeo_real_t *x, const aeo_real_t *y, size_t count);

#if AEO_SMALL
/* The same where eight terms of x stand together, each eight `step` behind the last, and the step grows; what a
 * multiple of eight leaves over comes after another step. */
aeo_real_t aeo_linalg_dot_strips(const aeo_real_t *x, size_t step, size_t growth, const aeo_real_t *y, size_t count);
#endif

/* error (count values, written) = y - rows z, with rows of n values one after the other; returns 1 when all are below
 * AEO_LINALG_ERROR_MAX: what is larger is a runaway. */
#define AEO_LINALG_ERROR_MAX AEO_REAL(1e12)
int aeo_linalg_find_error(const aeo_real_t *rows, const aeo_real_t *z, size_t n, const aeo_real_t *y, aeo_real_t *error,
                          size_t count);

/* rows += a x', count rows of n values one after the other. */
void aeo_linalg_move_rows(aeo_real_t *rows, const aeo_real_t *a, const aeo_real_t *x, size_t n, size_t count);

/* y = a x over count terms. */
void aeo_linalg_scale(aeo_real_t a, const aeo_real_t *x, aeo_real_t *y, size_t count);

#endif
/* SPDX-License-Identifier: MIT */
