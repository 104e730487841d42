/* saved.h: how every filter writes itself into a flat array and checks one it is given; internal, not installed.
 *
 * Unsigned 32-bit numbers travel as two halves of 16 bits, each exact in a float.
 */
#ifndef AEOLID_SAVED_H
#define AEOLID_SAVED_H

#include "aeolid/config.h"
#include "aeolid/status.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_saved_put_u32    aeo_saved_put_u32_f64
#define aeo_saved_get_u32    aeo_saved_get_u32_f64
#define aeo_saved_judge_head aeo_saved_judge_head_f64
#endif

/* Write value as two words; returns the place behind them. */
aeo_real_t *aeo_saved_put_u32(aeo_real_t *to, uint32_t value);

/* Read two words written by aeo_saved_put_u32; lowers *sound to 0 when they cannot be such, else leaves it. The words
 * are finite. Returns the place behind them. */
const aeo_real_t *aeo_saved_get_u32(const aeo_real_t *from, uint32_t *value, int *sound);

/* Compare the head of a saved array with the one expected, count words, version first: AEO_OK, AEO_E_VERSION or
 * AEO_E_MISMATCH. The words are finite. */
aeo_status_t aeo_saved_judge_head(const aeo_real_t *saved, const aeo_real_t *expected, size_t count);

#endif
/* SPDX-License-Identifier: MIT */
