/* fast_rls_saved.c: how the fast filter of fast_rls.h is written into a flat array, read back and checked. */
#include "aeolid/fast_rls.h"

#include "fast_array.h"
#include "linalg.h"
#include "saved.h"

#include <string.h>

enum { HEAD = 10, NUMBERS = 14 };

/* Where the saved numbers stand in the object, in the order of the saved array. */
#define AT(field) (uint16_t) offsetof(aeo_fast_rls_t, field)
static const uint16_t NUMBER[NUMBERS] = {
    AT(health),          AT(count.updates), AT(count.rejected), AT(count.bounded), AT(count.reinitialised),
    AT(count.restarted), AT(count.renewed), AT(count.held),     AT(hold),          AT(array[0].age),
    AT(array[1].age),    AT(random),        AT(filled),         AT(active)};
enum { RANDOM = 11, FILLED = 12, ACTIVE = 13 };

/* The saved array: version, bytes of a real, p, m, l, feedthrough, three settings; health, counters, hold, ages,
 * random, filled, active (saved.h); then arrays, theta, window, innovation and residual as they lie in memory. */
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
    return (size_t)(self->residual - self->array[0].forward) + self->config.outputs;
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
    saved += HEAD;
    for (size_t i = 0; i < NUMBERS; i++) {
        uint32_t number;
        memcpy(&number, (const unsigned char *)self + NUMBER[i], sizeof number);
        saved = aeo_saved_put_u32(saved, number);
    }
    memcpy(saved, self->array[0].forward, count_kept(self) * sizeof *saved);
    return AEO_OK;
}

/* The numbers in words, KEPT_WORDS of them and all finite, can be those of self's memory. */
static int words_hold(const aeo_fast_rls_t *self, const aeo_real_t *words)
{
    const size_t m = self->config.block, n = self->length;
    const size_t array = (size_t)(self->array[1].forward - self->array[0].forward);
    const aeo_real_t *const window = words + 2 * array + n * self->config.outputs;
    return aeo_fast_array_is_sound(self, words) && aeo_fast_array_is_sound(self, words + array) &&
           aeo_linalg_all_within(window, n + m, AEO_REAL(1.1e6)) &&
           aeo_linalg_all_within(window + n + m, self->config.outputs, AEO_REAL(1e12));
}

static int numbers_hold(const aeo_fast_rls_t *self, const uint32_t numbers[NUMBERS])
{
    return numbers[RANDOM] != 0u && numbers[FILLED] <= self->config.past + 1u && numbers[ACTIVE] <= 1u;
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
    for (size_t i = 0; i < NUMBERS; i++) {
        memcpy((unsigned char *)self + NUMBER[i], &numbers[i], sizeof numbers[i]);
    }
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
