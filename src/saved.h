/* saved.h: how every filter writes itself into a flat array and checks one it is given; internal, not installed.
 *
 * A saved array is a head (version, bytes of a real, sizes, settings), which must be that of the filter that reads it;
 * then unsigned 32-bit numbers as two halves of 16 bits, each exact in a float; then arrays as they lie in memory; last
 * the seal, AEO_SAVED_SEAL words.
 */
#ifndef AEOLID_SAVED_H
#define AEOLID_SAVED_H

#include "aeolid/config.h"
#include "aeolid/regressor.h"
#include "aeolid/status.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_saved_begin           aeo_saved_begin_f64
#define aeo_saved_judge           aeo_saved_judge_f64
#define aeo_saved_seal            aeo_saved_seal_f64
#define aeo_regressor_judge_saved aeo_regressor_judge_saved_f64
#endif

/* What the saved array of one filter is like. */
typedef struct {
    uint8_t version, size_count, setting_count, number_count;
    const uint16_t *sizes;      /* members that lie side by side in the object */
    const aeo_real_t *settings; /* the same */
    size_t words;               /* of head, numbers, arrays and seal */
} aeo_saved_form_t;

/* Write head and numbers (those of type uint32_t that begin there) into saved (length values, written); the caller
 * adds the arrays, then the seal. AEO_E_ARG: saved is null; AEO_E_MEMORY: length < form->words; neither writes. */
aeo_status_t aeo_saved_begin(const aeo_saved_form_t *form, const void *numbers, aeo_real_t *saved, size_t length);

/* Write the seal over words values (written: the last two). */
void aeo_saved_seal(aeo_real_t *saved, size_t words);

/* Judge a saved array (length values, read) on everything but what its filter knows better, and let numbers (written)
 * be its numbers. AEO_E_ARG, AEO_E_MEMORY as above; AEO_E_NOT_FINITE: any of form->words; AEO_E_VERSION,
 * AEO_E_MISMATCH: another head; AEO_E_DAMAGED: the seal is broken, or a number is none. */
aeo_status_t aeo_saved_judge(const aeo_saved_form_t *form, const aeo_real_t *saved, size_t length, uint32_t *numbers);

/* Judge a saved window as aeo_regressor_restore does, and write nothing. */
aeo_status_t aeo_regressor_judge_saved(const aeo_regressor_t *self, const aeo_real_t *saved, size_t length);

#endif
/* SPDX-License-Identifier: MIT */
