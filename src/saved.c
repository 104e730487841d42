/* saved.c: the helpers of saved.h. */
#include "saved.h"

#include "aeolid/frame.h"
#include "linalg.h"

#include <string.h>

/* Write value as two words; returns the place behind them. */
static aeo_real_t *put_u32(aeo_real_t *to, uint32_t value)
{
    to[0] = (aeo_real_t)(value >> 16);
    to[1] = (aeo_real_t)(value & 0xFFFFu);
    return to + 2;
}

static size_t count_head(const aeo_saved_form_t *form)
{
    return 2u + form->size_count + form->setting_count;
}

/* Return word i of the head. */
static aeo_real_t find_head(const aeo_saved_form_t *form, size_t i)
{
    if (i < 2u) {
        return i == 0u ? (aeo_real_t)form->version : AEO_REAL(AEO_REAL_BYTES);
    }
    i -= 2u;
    return i < form->size_count ? (aeo_real_t)form->sizes[i] : form->settings[i - form->size_count];
}

static aeo_status_t judge_length(const aeo_saved_form_t *form, const aeo_real_t *saved, size_t length)
{
    if (saved == NULL) {
        return AEO_E_ARG;
    }
    return length < form->words ? AEO_E_MEMORY : AEO_OK;
}

aeo_status_t aeo_saved_begin(const aeo_saved_form_t *form, const void *numbers, aeo_real_t *saved, size_t length)
{
    const aeo_status_t status = judge_length(form, saved, length);
    if (status != AEO_OK) {
        return status;
    }
    for (size_t i = 0; i < count_head(form); i++) {
        *saved++ = find_head(form, i);
    }
    for (size_t i = 0; i < form->number_count; i++) {
        uint32_t number;
        memcpy(&number, (const unsigned char *)numbers + i * sizeof number, sizeof number);
        saved = put_u32(saved, number);
    }
    return AEO_OK;
}

/* CRC-32 over the bits of count values; of a double the upper half comes first. */
static uint32_t find_crc(const aeo_real_t *saved, size_t count)
{
    uint32_t crc = UINT32_C(0xFFFFFFFF);
    for (size_t i = 0; i < count; i++) {
#if AEO_REAL_BYTES == 8
        uint64_t bits;
        memcpy(&bits, saved + i, sizeof bits);
        crc = aeo_frame_crc32(crc, (uint32_t)(bits >> 32));
        crc = aeo_frame_crc32(crc, (uint32_t)(bits & UINT32_C(0xFFFFFFFF)));
#else
        uint32_t bits;
        memcpy(&bits, saved + i, sizeof bits);
        crc = aeo_frame_crc32(crc, bits);
#endif
    }
    return ~crc;
}

void aeo_saved_seal(aeo_real_t *saved, size_t words)
{
    put_u32(saved + (words - AEO_SAVED_SEAL), find_crc(saved, words - AEO_SAVED_SEAL));
}

/* Read count numbers written by put_u32, all words finite; returns 0 when they cannot be such. */
static int get_numbers(const aeo_real_t *from, uint32_t *numbers, size_t count)
{
    uint32_t number = 0;
    for (size_t i = 0; i < 2u * count; i++) {
        const aeo_real_t half = from[i];
        if (!(half >= AEO_REAL(0) && half <= AEO_REAL(65535)) || half > (aeo_real_t)(uint32_t)half) {
            return 0; /* out of range, or not a whole number */
        }
        number = number << 16 | (uint32_t)half;
        numbers[i / 2u] = number; /* complete after every second word */
    }
    return 1;
}

aeo_status_t aeo_saved_judge(const aeo_saved_form_t *form, const aeo_real_t *saved, size_t length, uint32_t *numbers)
{
    const aeo_status_t status = judge_length(form, saved, length);
    if (status != AEO_OK) {
        return status;
    }
    if (!aeo_linalg_all_finite(saved, form->words)) {
        return AEO_E_NOT_FINITE;
    }
    for (size_t i = 0; i < count_head(form); i++) {
        const aeo_real_t expected = find_head(form, i), found = *saved++;
        if (found < expected || found > expected) {
            return i == 0 ? AEO_E_VERSION : AEO_E_MISMATCH;
        }
    }
    const size_t sealed = form->words - AEO_SAVED_SEAL;
    uint32_t crc = 0;
    const aeo_real_t *const start = saved - count_head(form);
    return get_numbers(start + sealed, &crc, 1) && crc == find_crc(start, sealed) &&
                   get_numbers(saved, numbers, form->number_count)
               ? AEO_OK
               : AEO_E_DAMAGED;
}
/* SPDX-License-Identifier: MIT */
