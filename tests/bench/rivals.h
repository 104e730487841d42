/* rivals.h: what the filters are timed against: the textbook (conventional covariance) RLS, plainly in C and written
 * with Eigen, both in the library's number type. */
#ifndef RIVALS_H
#define RIVALS_H

#include "aeolid/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One update of P (n x n), theta (l x n) with scratch g (n). */
void naive_update(aeo_real_t *p, aeo_real_t *theta, aeo_real_t *g, size_t n, size_t l, aeo_real_t lambda,
                  const aeo_real_t *z, const aeo_real_t *y);

/* The forms in which users of Eigen write P = (P - g g' / alpha) / lambda: one expression; the outer product subtracted
 * in place, then the division; one expression whose product is not evaluated first (lazyProduct); the same for the lower
 * triangle only; that triangle column after column. Which is the fastest depends on size, precision and flags. */
enum { EIGEN_EXPRESSION, EIGEN_IN_PLACE, EIGEN_LAZY, EIGEN_TRIANGULAR, EIGEN_COLUMNS, EIGEN_FORMS };

/* Start afresh with P = I / rho; one update in one of the forms. */
void eigen_start(size_t n, size_t l, aeo_real_t lambda, aeo_real_t rho);
void eigen_update(const aeo_real_t *z, const aeo_real_t *y, int form);

/* Return theta, l x n by columns, for comparison. */
const aeo_real_t *eigen_theta(void);

#ifdef __cplusplus
}
#endif

#endif
