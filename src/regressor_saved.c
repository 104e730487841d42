/* regressor_saved.c: how the window of regressor.h is written into a flat array and read back. */
#include "aeolid/regressor.h"

#include "linalg.h"
#include "saved.h"

#include <string.h>

/* Sizes, wide ones in halves of 16 bits; numbers. */
enum { INPUTS, OUTPUTS, PAST, MODEL_SET, FEEDTHROUGH, PERIOD = FEEDTHROUGH + 2, SIZES = PERIOD + 2 };
enum { FILLED, PENDING, TIME, COUNTS = TIME + 2, NUMBERS = COUNTS + 5 };

static void put_halves(uint16_t *to, uint32_t value)
{
    to[0] = (uint16_t)(value >> 16);
    to[1] = (uint16_t)(value & 0xFFFFu);
}

/* The saved array: version, bytes of a real, r, l, p, model set, mask, period; offsets and inverse scales; samples in the
 * window, whether a block waits, time, five counters; z with room for all inputs, and the block (saved.h). */
static void describe(const aeo_regressor_t *self, uint16_t sizes[SIZES], aeo_saved_form_t *form)
{
    const size_t r = self->inputs, l = self->outputs, e = self->model_set;
    sizes[INPUTS] = self->inputs;
    sizes[OUTPUTS] = self->outputs;
    sizes[PAST] = self->past;
    sizes[MODEL_SET] = self->model_set;
    put_halves(sizes + FEEDTHROUGH, self->feedthrough);
    put_halves(sizes + PERIOD, self->period_us);
    form->version = AEO_REGRESSOR_SAVED_VERSION;
    form->size_count = SIZES;
    form->setting_count = (uint8_t)(2u * (r + l)); /* at most 128; offset and inverse lie side by side */
    form->number_count = NUMBERS;
    form->sizes = sizes;
    form->settings = self->offset;
    form->words = AEO_REGRESSOR_SAVED_WORDS(r, l, self->past, e);
}

aeo_status_t aeo_regressor_save(const aeo_regressor_t *self, aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    uint16_t sizes[SIZES];
    uint32_t numbers[NUMBERS];
    numbers[FILLED] = self->filled;
    numbers[PENDING] = self->pending;
    numbers[TIME] = (uint32_t)(self->time_us >> 32);
    numbers[TIME + 1] = (uint32_t)(self->time_us & UINT32_C(0xFFFFFFFF));
    memcpy(numbers + COUNTS, &self->count, sizeof self->count);
    describe(self, sizes, &form);
    const aeo_status_t status = aeo_saved_begin(&form, numbers, saved, length);
    if (status == AEO_OK) {
        const size_t room = (size_t)(self->block - self->z);
        aeo_real_t *const body = saved + AEO_REGRESSOR_SAVED_HEAD(self->inputs, self->outputs);
        memset(body, 0, room * sizeof *body);
        memcpy(body, self->z, self->length * sizeof *body);
        memcpy(body + room, self->block, self->block_length * sizeof *body);
        aeo_saved_seal(saved, form.words);
    }
    return status;
}

/* Judge a saved window; numbers (written) are its numbers. */
static aeo_status_t judge(const aeo_regressor_t *self, const aeo_real_t *saved, size_t length,
                          uint32_t numbers[NUMBERS])
{
    aeo_saved_form_t form;
    uint16_t sizes[SIZES];
    describe(self, sizes, &form);
    const aeo_status_t status = aeo_saved_judge(&form, saved, length, numbers);
    if (status != AEO_OK) {
        return status;
    }
    const size_t room = (size_t)(self->block - self->z);
    const aeo_real_t *const body = saved + AEO_REGRESSOR_SAVED_HEAD(self->inputs, self->outputs);
    if (numbers[FILLED] > self->past || numbers[PENDING] > 1u || numbers[FILLED] > numbers[PENDING] * self->past ||
        !aeo_linalg_all_within(body, room + self->block_length, AEO_SCALED_MAX)) {
        return AEO_E_DAMAGED;
    }
    return AEO_OK;
}

aeo_status_t aeo_regressor_judge_saved(const aeo_regressor_t *self, const aeo_real_t *saved, size_t length)
{
    uint32_t numbers[NUMBERS];
    return judge(self, saved, length, numbers);
}

aeo_status_t aeo_regressor_restore(aeo_regressor_t *self, const aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    uint32_t numbers[NUMBERS];
    const aeo_status_t status = judge(self, saved, length, numbers);
    if (status != AEO_OK) {
        return status;
    }
    const aeo_real_t *const body = saved + AEO_REGRESSOR_SAVED_HEAD(self->inputs, self->outputs);
    self->filled = (uint16_t)numbers[FILLED];
    self->pending = (uint8_t)numbers[PENDING];
    self->time_us = (uint64_t)numbers[TIME] << 32 | numbers[TIME + 1];
    memcpy(&self->count, numbers + COUNTS, sizeof self->count);
    memcpy(self->z, body, self->length * sizeof *body);
    memcpy(self->block, body + (self->block - self->z), self->block_length * sizeof *body);
    return AEO_OK;
}
/* SPDX-License-Identifier: MIT */
