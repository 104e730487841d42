/* triangle.h: kernels of a small triangular factor, packed; internal, not installed.
 *
 * S (n x n, lower) lies by columns: column j holds rows j ... n-1 and starts at j n - j (j - 1) / 2. The large one of rls.h
 * lies in strips (strips.h), which are faster and take more room. Arrays of one call never overlap.
 */
#ifndef AEOLID_TRIANGLE_H
#define AEOLID_TRIANGLE_H

#include "aeolid/config.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_triangle_expand  aeo_triangle_expand_f64
#define aeo_triangle_project aeo_triangle_project_f64
#define aeo_triangle_rotate  aeo_triangle_rotate_f64
#define aeo_triangle_start   aeo_triangle_start_f64
#define aeo_triangle_norm2   aeo_triangle_norm2_f64
#endif

/* projection = S'z (n values, written). */
void aeo_triangle_project(const aeo_real_t *factor, const aeo_real_t *z, aeo_real_t *projection, size_t n);

/* z = S a (n values, written). */
void aeo_triangle_expand(const aeo_real_t *factor, const aeo_real_t *a, aeo_real_t *z, size_t n);

/* Absorb one measurement whose projection is a = S'z: n plane rotations turn [alpha^(1/2), a'; 0, S] into
 * [alpha_new^(1/2), 0; g alpha_new^(1/2), S_new] and S becomes scale S_new. gain (n values, written) = S a, which is
 * g alpha_new; alpha_new is alpha + |a|^2. Needs alpha > 0. */
void aeo_triangle_rotate(aeo_real_t *factor, const aeo_real_t *projection, aeo_real_t *gain, size_t n, aeo_real_t alpha,
                         aeo_real_t scale);

/* Let the triangle at factor be diagonal times the unit one; returns the place behind it. */
aeo_real_t *aeo_triangle_start(aeo_real_t *factor, size_t n, aeo_real_t diagonal);

/* Return P_ii, the squared norm of row i of S. */
aeo_real_t aeo_triangle_norm2(const aeo_real_t *factor, size_t n, size_t i);

#endif
/* SPDX-License-Identifier: MIT */
