/* guard.h: tells when the innovations of a filter that feeds its residuals back have outgrown those of a VARX filter;
 * internal, not installed. The rule and its reasons: els.h, deviations 4 and 5.
 */
#ifndef AEOLID_GUARD_H
#define AEOLID_GUARD_H

#include "aeolid/config.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_guard_watch aeo_guard_watch_f64
#define aeo_guard_limit aeo_guard_limit_f64
#define aeo_guard_holds aeo_guard_holds_f64
#endif

/* What the guard of one output remembers, all zero at a start: 0 the mean square innovation of the last 64 samples;
 * 1 the same of what is left without the terms in e; 2 the mean square innovation over the second half of the last VARX
 * start; 3 what the first has been of the second of late. */
#define AEO_GUARD_WORDS 4u

/* Take sample number since >= 1 of a run whose first wait samples are VARX: the innovation (at most 1e12 in size), and
 * rest, the residual before the terms in e are taken off. During the VARX start its power is measured, afterwards
 * compared; returns 1 when the mean innovation power is more than ratio (at most 100) times what it should be. */
int aeo_guard_watch(aeo_real_t *levels, aeo_real_t innovation, aeo_real_t rest, uint32_t since, uint32_t wait,
                    aeo_real_t ratio);

/* Return how large a residual may be to be fed back: 6 roots of what its power should be, at most 1e6. */
aeo_real_t aeo_guard_limit(const aeo_real_t *levels);

/* Return 1 when the levels of count outputs can be such, given that they are finite. */
int aeo_guard_holds(const aeo_real_t *levels, size_t count);

#endif
/* SPDX-License-Identifier: MIT */
