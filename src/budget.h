/* budget.h (internal): adds up all that a stream sends, and tells how long a snapshot takes beside it.
 *
 * MODEL
 *   Each step earns its sample time of credit, which `burst` frames of the longest kind cap. On average of
 *       c = the part of it that the cap leaves: whole frames where it may cut, all of it where it cannot
 *   samples, innovations and seals take their share s of the time, and health and description d. The rest is the
 *   snapshots', but for what a description and samples under way may owe when one begins:
 *       steps = (snapshot + owed) / (c (1 - s) - d) + 2,
 *   the same in frames against `burst` a step, the larger of both. Accepted is what leaves a tenth of the time.
 *
 * CONTRACT
 *   Memory: none. Called at init only: the description is gone through once. Pure.
 */
#ifndef AEOLID_BUDGET_H
#define AEOLID_BUDGET_H

#include <aeolid/stream.h>

#ifdef AEO_REAL_DOUBLE
#define aeo_budget_find_steps        aeo_budget_find_steps_f64
#define aeo_budget_count_description aeo_budget_count_description_f64
#define aeo_budget_longest_us        aeo_budget_longest_us_f64
#define aeo_budget_period_us         aeo_budget_period_us_f64
#endif

/* Return the sample time in microseconds, 20 ... 10^9, and the cost of the longest frame in use, 0 without a limit. */
uint32_t aeo_budget_period_us(const aeo_stream_config_t *config);
uint32_t aeo_budget_longest_us(const aeo_stream_config_t *config);

/* Return the frames of a description. */
uint32_t aeo_budget_count_description(const aeo_stream_config_t *config);

/* Return the steps within which a snapshot leaves, at most 4e9; 0 when samples and all else leave less than a tenth of
 * the budget or of the frames a step. config is valid, spread that of its blocks, slots the frames
 * of its description. */
uint32_t aeo_budget_find_steps(const aeo_stream_config_t *config, const aeo_spread_t *spread, uint32_t slots);

#endif
/* SPDX-License-Identifier: MIT */
