/* fast_theta.h: theta of the fast filter and the order of its columns; internal, not installed.
 */
#ifndef AEOLID_FAST_THETA_H
#define AEOLID_FAST_THETA_H

#include "aeolid/fast_rls.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_fast_theta_learn aeo_fast_theta_learn_f64
#define aeo_fast_theta_order aeo_fast_theta_order_f64
#endif

/* Return from (n values), or, where the feedthrough mask makes the orders of z and w differ, self->update with them in
 * the other order: of w from that of z, or with back from that of w to that of z. */
const aeo_real_t *aeo_fast_theta_order(const aeo_fast_rls_t *self, const aeo_real_t *from, int back);

/* Move theta by the gain of the array in charge, which has just absorbed the sample, and write the residual. Returns 0
 * when that gain is beyond its bound: nothing but scratch is written. */
int aeo_fast_theta_learn(aeo_fast_rls_t *self, const aeo_real_t *z);

#endif
/* SPDX-License-Identifier: MIT */
