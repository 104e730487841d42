/* filter_refusal.h: says in words which setting a filter of the library refuses, for programs whose users choose it.
 *
 * MODEL
 *   aeo_estimator_init answers AEO_E_ARG whatever is out of range. Sizes are compared with the limits of regressor.h.
 *   Of channels and forgetting the library itself is asked, with everything else harmless, so that what a filter bears
 *   is written down in the filter alone; the least forgetting factor is found by bisection.
 *
 * CONTRACT
 *   Memory: 5 kB of stack. A few dozen initialisations. Nothing is kept.
 */
#ifndef AEOLID_FILTER_REFUSAL_H
#define AEOLID_FILTER_REFUSAL_H

#include <aeolid/estimator.h>

#define FILTER_REFUSAL_MAX 256u /* characters, the final zero among them */

/* Write one sentence on what aeo_estimator_init refuses, into text. method: aeo_method_t; memory and words as init had
 * them, and overwritten; null: there was none. config->channels: inputs and outputs with their names, not null. */
void filter_refusal_explain(char text[FILTER_REFUSAL_MAX], unsigned method, const aeo_estimator_config_t *config,
                            aeo_real_t *memory, size_t words);

#endif
/* SPDX-License-Identifier: MIT */
