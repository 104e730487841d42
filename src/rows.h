/* rows.h: a kernel of the filters whose cost is linear in p; internal, not installed. Arrays of one call never overlap. */
#ifndef AEOLID_ROWS_H
#define AEOLID_ROWS_H

#include "aeolid/config.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_rows_correct aeo_rows_correct_f64
#endif

/* Take off x (count values) what weight (m rows of count values) makes of v (m values), x -= weight'v, and move weight by
 * the error that is left, weight += gain (step x)'; with gain null it stays. */
void aeo_rows_correct(aeo_real_t *weight, const aeo_real_t *v, aeo_real_t *x, size_t count, size_t m,
                      const aeo_real_t *gain, aeo_real_t step);

#endif
/* SPDX-License-Identifier: MIT */
