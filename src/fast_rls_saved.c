/* fast_rls_saved.c: how the fast filter of fast_rls.h is written into a flat array, read back and checked. */
#include "aeolid/fast_rls.h"

#include "fast_array.h"
#include "linalg.h"
#include "saved.h"

#include <string.h>

enum { HEAD = 10, NUMBERS = 14 };

/* The saved array: version, bytes of a real, p, m, l, feedthrough, three settings; health, counters, hold, random, filled,
 * active, ages (saved.h); then arrays, theta, window, innovation and residual as they lie in memory. */
static void fill_head(const aeo_fast_rls_t *self, aeo_real_t head[HEAD])
{
    head[0] = AEO_REAL(AEO_FAST_RLS_SAVED_VERSION);
    head[1] = AEO_REAL(AEO_REAL_BYTES);
    head[2] = (aeo_real_t)self->config.past;
    head[3] = (aeo_real_t)self->config.block;
    head[4] = (aeo_real_t)self->config.outputs;
    aeo_saved_put_u32(head + 5, self->config.feedthrough);
    head[7] = self->config.forgetting;
    head[8] = self->config.regularisation;
    head[9] = self->config.growth_max;
}

static size_t count_kept(const aeo_fast_rls_t *self)
{
    return AEO_FAST_RLS_KEPT_WORDS(self->config.past, self->config.block, self->tail, self->config.outputs);
}

aeo_status_t aeo_fast_rls_save(const aeo_fast_rls_t *self, aeo_real_t *saved, size_t length)
{
    if (self == NULL || saved == NULL) {
        return AEO_E_ARG;
    }
    if (length < AEO_FAST_RLS_SAVED_HEAD + count_kept(self)) {
        return AEO_E_MEMORY;
    }
    fill_head(self, saved);
    const aeo_fast_rls_count_t *const count = &self->count;
    saved = aeo_saved_put_u32(saved + HEAD, self->health);
    saved = aeo_saved_put_u32(saved, count->updates);
    saved = aeo_saved_put_u32(saved, count->rejected);
    saved = aeo_saved_put_u32(saved, count->bounded);
    saved = aeo_saved_put_u32(saved, count->reinitialised);
    saved = aeo_saved_put_u32(saved, count->restarted);
    saved = aeo_saved_put_u32(saved, count->renewed);
    saved = aeo_saved_put_u32(saved, count->held);
    saved = aeo_saved_put_u32(saved, self->hold);
    saved = aeo_saved_put_u32(saved, self->random);
    saved = aeo_saved_put_u32(saved, self->filled);
    saved = aeo_saved_put_u32(saved, self->active);
    saved = aeo_saved_put_u32(saved, self->array[0].age);
    saved = aeo_saved_put_u32(saved, self->array[1].age);
    memcpy(saved, self->array[0].forward, count_kept(self) * sizeof *saved);
    return AEO_OK;
}

/* The numbers in words, KEPT_WORDS of them and all finite, can be those of self's memory. */
static int words_hold(const aeo_fast_rls_t *self, const aeo_real_t *words)
{
    const size_t m = self->config.block, n = self->length;
    const size_t array = AEO_FAST_RLS_ARRAY_WORDS(self->config.past, m, self->tail);
    const aeo_real_t *const window = words + 2 * array + n * self->config.outputs;
    return aeo_fast_array_is_sound(self, words) && aeo_fast_array_is_sound(self, words + array) &&
           aeo_linalg_all_within(window, n + m, AEO_REAL(1.1e6)) &&
           aeo_linalg_all_within(window + n + m, self->config.outputs, AEO_REAL(1e12));
}

static int numbers_hold(const aeo_fast_rls_t *self, const uint32_t numbers[NUMBERS])
{
    return numbers[9] != 0u && numbers[10] <= self->config.past + 1u && numbers[11] <= 1u;
}

aeo_status_t aeo_fast_rls_restore(aeo_fast_rls_t *self, const aeo_real_t *saved, size_t length)
{
    if (self == NULL || saved == NULL) {
        return AEO_E_ARG;
    }
    if (length < AEO_FAST_RLS_SAVED_HEAD + count_kept(self)) {
        return AEO_E_MEMORY;
    }
    if (!aeo_linalg_all_finite(saved, AEO_FAST_RLS_SAVED_HEAD + count_kept(self))) {
        return AEO_E_NOT_FINITE;
    }
    aeo_real_t head[HEAD];
    fill_head(self, head);
    const aeo_status_t same = aeo_saved_judge_head(saved, head, HEAD);
    if (same != AEO_OK) {
        return same;
    }
    uint32_t numbers[NUMBERS];
    int sound = 1;
    const aeo_real_t *body = saved + HEAD;
    for (int i = 0; i < NUMBERS; i++) {
        body = aeo_saved_get_u32(body, &numbers[i], &sound);
    }
    if (!sound || !numbers_hold(self, numbers) || !words_hold(self, body)) {
        return AEO_E_DAMAGED;
    }
    self->health = numbers[0];
    self->count.updates = numbers[1];
    self->count.rejected = numbers[2];
    self->count.bounded = numbers[3];
    self->count.reinitialised = numbers[4];
    self->count.restarted = numbers[5];
    self->count.renewed = numbers[6];
    self->count.held = numbers[7];
    self->hold = numbers[8];
    self->random = numbers[9];
    self->filled = (uint16_t)numbers[10];
    self->active = (uint8_t)numbers[11];
    self->array[0].age = numbers[12];
    self->array[1].age = numbers[13];
    memcpy(self->array[0].forward, body, count_kept(self) * sizeof *body);
    return AEO_OK;
}

int aeo_fast_rls_invariants_hold(const aeo_fast_rls_t *self)
{
    if (self == NULL || self->active > 1u || self->random == 0u || self->filled > self->config.past + 1u ||
        self->length != AEO_FAST_RLS_LENGTH(self->config.past, self->config.block, self->tail)) {
        return 0;
    }
    const size_t m = self->config.block, n = self->length;
    const aeo_real_t *const words = self->array[0].forward;
    return self->residual == self->theta + (n * self->config.outputs + n + m + self->config.outputs) &&
           aeo_linalg_all_finite(words, count_kept(self)) && words_hold(self, words);
}
/* SPDX-License-Identifier: MIT */
