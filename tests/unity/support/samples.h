/* samples.h: seeded random numbers, special bit patterns and batch solutions for the tests. */
#ifndef SAMPLES_H
#define SAMPLES_H

#include "aeolid/config.h"

/* Draw from -1 ... 1, evenly; the same seed gives the same numbers on every machine. */
double draw(uint64_t *seed);

/* Fill x with count draws. */
void fill(aeo_real_t *x, size_t count, uint64_t *seed);

/* Build numbers that -ffast-math must not see through: kind 0 quiet NaN, 1 negative NaN, 2 +infinity, 3 -infinity. */
aeo_real_t make_not_finite(int kind);

/* Solve min sum_k weight_k |y_k - theta z_k|^2 + sum_j ridge_j |theta_j|^2, theta_j column j, in double by Householder
 * QR of the stacked rows. z (count x n), y (count x l), weight (count) or null for ones, ridge (n); theta (l x n, written). Ends the program when memory
 * is short. */
void solve_batch(const aeo_real_t *z, const aeo_real_t *y, const double *weight, size_t count, size_t n, size_t l,
                 const double *ridge, double *theta);

/* Return |a - b|_F / |b|_F, 0 where a = b. */
double relative_distance(const aeo_real_t *a, const double *b, size_t count);

#endif
