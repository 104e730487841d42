/* markov.h: reads the Markov parameters out of any filter's theta, in the channels' units or scaled.
 *
 * MODEL
 *   theta (l x n) multiplies the scaled regressor of regressor.h; in the channels' units
 *       Xi_ij = scale_y_i / scale_c(j) theta_ij,
 *   c(j) the channel of entry j: the order of Houtzager, van Wingerden, Verhaegen 2009 eq. (9) and (14), oldest block
 *   first, u before y (before e, which is scaled like y), present inputs of the feedthrough mask last. Offsets do not
 *   enter: Xi acts on deviations from them.
 *
 * CONTRACT
 *   Memory: none but the caller's array of AEO_MARKOV_WORDS(n, l) = n l values (n=50, l=3: 150; n=150, l=3: 450).
 *   Operations: one multiplication and one division a parameter. Worst stack: 64 bytes. Deterministic: the same theta
 *   gives the same bits, read at once or one by one.
 *   Threads and interrupts: reads the regressor and theta; call it between two updates.
 */
#ifndef AEOLID_MARKOV_H
#define AEOLID_MARKOV_H

#include "aeolid/regressor.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_markov_read        aeo_markov_read_f64
#define aeo_markov_read_scaled aeo_markov_read_scaled_f64
#define aeo_markov_at          aeo_markov_at_f64
#define aeo_markov_channel     aeo_markov_channel_f64
#endif

/* Values of a read-out for n regressors and l outputs. */
#define AEO_MARKOV_WORDS(n, l) ((size_t)(n) * (size_t)(l))

/* Return the channel (0 ... r-1 an input, r ... r+l-1 an output, r+l ... r+2l-1 an innovation) that entry j of z holds;
 * -1 for a null pointer or j at or above self->length. */
int aeo_markov_channel(const aeo_regressor_t *layout, uint16_t j);

/* Write theta (l x n by rows, read) in the channels' units into markov (length values, written), same order.
 * markov may be theta itself, but must not overlap it otherwise. AEO_E_ARG: null pointer; AEO_E_MEMORY: length < l n.
 * On failure markov is not written. */
aeo_status_t aeo_markov_read(const aeo_regressor_t *layout, const aeo_real_t *theta, aeo_real_t *markov, size_t length);

/* The same without undoing the scales: a copy of theta. */
aeo_status_t aeo_markov_read_scaled(const aeo_regressor_t *layout, const aeo_real_t *theta, aeo_real_t *markov,
                                    size_t length);

/* Return parameter index = i n + j in the channels' units, bit for bit what aeo_markov_read writes there; 0 for a null
 * pointer or an index at or above l n. For streamers that send one parameter at a time. */
aeo_real_t aeo_markov_at(const aeo_regressor_t *layout, const aeo_real_t *theta, size_t index);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
