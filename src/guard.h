/* guard.h: tells when the innovations of a filter that feeds its residuals back have outgrown those of a VARX filter;
 * internal, not installed. The rule and its reasons: els.h, deviations 4 and 5.
 */
#ifndef AEOLID_GUARD_H
#define AEOLID_GUARD_H

#include "aeolid/config.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_guard_watch aeo_guard_watch_f64
#define aeo_guard_limit aeo_guard_limit_f64
#define aeo_guard_hold  aeo_guard_hold_f64
#endif

/* What a guard of l outputs remembers, side by side, l values each: y_{k-1}, the mean square innovation and the mean
 * square change of y over the last 64 samples, and the same two over the second half of the last VARX start. All zero
 * at a start. */
#define AEO_GUARD_WORDS(l) (5u * (size_t)(l))

/* Take sample number since >= 1 of a run whose first wait samples are VARX: innovation (at most 1e12) and y (at most
 * 1e6), l values each. During the VARX start its levels are measured, afterwards compared; returns 1 when the mean
 * innovation power of an output is more than ratio (at most 100) times its level. */
int aeo_guard_watch(aeo_real_t *levels, size_t l, const aeo_real_t *innovation, const aeo_real_t *y, uint32_t since,
                    uint32_t wait, aeo_real_t ratio);

/* feedback = residual cut to 6 roots of the level, and to 1e6; levels null: to 1e6 alone. Returns how many were cut. */
unsigned aeo_guard_limit(const aeo_real_t *levels, size_t l, const aeo_real_t *residual, aeo_real_t *feedback);

/* Return 1 when levels can be such, given that they are finite: y in range, means of cut squares. */
int aeo_guard_hold(const aeo_real_t *levels, size_t l);

#endif
/* SPDX-License-Identifier: MIT */
