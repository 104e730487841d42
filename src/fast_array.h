/* fast_array.h: one array of the fast filter, everything that stands for P there; internal, not installed.
 *
 * It sees no outputs: fast_rls.c turns its gain into theta, and decides when an array starts and which one is heard.
 */
#ifndef AEOLID_FAST_ARRAY_H
#define AEOLID_FAST_ARRAY_H

#include "aeolid/fast_rls.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_fast_array_start    aeo_fast_array_start_f64
#define aeo_fast_array_step     aeo_fast_array_step_f64
#define aeo_fast_array_is_late  aeo_fast_array_is_late_f64
#define aeo_fast_array_variance aeo_fast_array_variance_f64
#define aeo_fast_array_is_sound aeo_fast_array_is_sound_f64
#endif

/* Let array begin with P_{-1}; what self->window holds until the next sample counts as zeros. */
void aeo_fast_array_start(const aeo_fast_rls_t *self, aeo_fast_rls_array_t *array);

/* Absorb self->window, moved on by one block; writes g into self->step and, while self->disturbed is above 0, into
 * array->share what the disturbances contribute to kappa. Returns 0 when the array has lost its way: it must start
 * afresh, and self->step holds nothing. */
int aeo_fast_array_step(aeo_fast_rls_t *self, aeo_fast_rls_array_t *array);

/* Return 1 when both backward errors disagree so far that a follower should warm up. */
int aeo_fast_array_is_late(const aeo_fast_rls_array_t *array);

/* Return the variance of newest entry c, (F^{-1})_cc. */
aeo_real_t aeo_fast_array_variance(const aeo_fast_rls_t *self, const aeo_fast_rls_array_t *array, size_t c);

/* Return 1 when the numbers at words, AEO_FAST_RLS_ARRAY_WORDS of them, can be an array's; all are finite. */
int aeo_fast_array_is_sound(const aeo_fast_rls_t *self, const aeo_real_t *words);

#endif
/* SPDX-License-Identifier: MIT */
