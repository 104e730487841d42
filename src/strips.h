/* strips.h: the square-root factor of rls.h in strips of 8 rows; internal, not installed.
 *
 * S (n x n, lower) has zeros put before it, pad = -n mod 8 rows and columns of them, so that its rows fill whole strips.
 * Strip s holds rows 8 s ... 8 s + 7 of columns pad ... 8 s + 7, one column after the other, 8 numbers each: an entry above the
 * diagonal or in a row before the first is 0 and stays 0. Rows never touch one another in an update, so a strip's rows
 * go through all columns at once, their part of the pivot column in registers.
 *
 *         pad   n                 strip 0 (pad = 3):  0 0 0 0 0      strip 1:  x x x x x x 0 0 0 0 0 0 0
 *   pad [ 0     0 ]                                   0 0 0 0 0                x x x x x x x 0 0 0 0 0 0
 *     n [ 0     S ]                                   0 0 0 0 0                ...
 *                                                     x 0 0 0 0                x x x x x x x x x x x x x
 *                                                     x x 0 0 0 ...
 *
 * Beside it three rows of work, each of 8 numbers a strip and in padded order too, the last one number longer; what lies
 * in the pad is 0 or of no meaning. Arrays of one call never overlap.
 */
#ifndef AEOLID_STRIPS_H
#define AEOLID_STRIPS_H

#include "aeolid/rls.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_strips_start    aeo_strips_start_f64
#define aeo_strips_project  aeo_strips_project_f64
#define aeo_strips_take_row aeo_strips_take_row_f64
#define aeo_strips_rotate   aeo_strips_rotate_f64
#define aeo_strips_norm2    aeo_strips_norm2_f64
#define aeo_strips_hold     aeo_strips_hold_f64
#endif

/* Return what stands before S: rows and columns of zeros. */
static inline size_t aeo_strips_pad(size_t n)
{
    return (0u - n) % AEO_RLS_STRIP;
}

/* Let S be diagonal times the unit matrix. */
void aeo_strips_start(aeo_real_t *factor, size_t n, aeo_real_t diagonal);

/* Let a = S'z be the measurement to be absorbed, in work; returns |a|^2 = z'Pz. */
aeo_real_t aeo_strips_project(const aeo_real_t *factor, const aeo_real_t *z, size_t n, aeo_real_t *work);

/* Let a = weight times row i of S be the measurement to be absorbed, in work. */
void aeo_strips_take_row(const aeo_real_t *factor, size_t n, size_t i, aeo_real_t weight, aeo_real_t *work);

/* Absorb the measurement in work, whose a is 0 from entry count on: n plane rotations turn
 * [alpha^(1/2), a'; 0, S] into [alpha_new^(1/2), 0; g alpha_new^(1/2), S_new] and S becomes scale S_new. Returns g alpha_new (n
 * values, in work) = S a; alpha_new is alpha + |a|^2. Needs alpha > 0. */
const aeo_real_t *aeo_strips_rotate(aeo_real_t *factor, size_t n, size_t count, aeo_real_t *work, aeo_real_t alpha,
                                    aeo_real_t scale);

/* Return P_ii, the squared norm of row i of S. */
aeo_real_t aeo_strips_norm2(const aeo_real_t *factor, size_t n, size_t i);

/* Return 1 when the diagonal of S is above 0 and all that is not S is 0; none is NaN. */
int aeo_strips_hold(const aeo_real_t *factor, size_t n);

#endif
/* SPDX-License-Identifier: MIT */
