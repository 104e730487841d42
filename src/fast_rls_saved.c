/* fast_rls_saved.c: how the fast filter of fast_rls.h is written into a flat array, read back and checked. */
#include "aeolid/fast_rls.h"

#include "fast_array.h"
#include "linalg.h"
#include "saved.h"

#include <string.h>

/* Places of the numbers saved: those that lie side by side from random to watch, the arrays' ages, how often rho has
 * risen. */
enum {
    RANDOM,
    FILLED,
    ACTIVE,
    DISTURBED = 13,
    ASTRAY,
    WATCH = 15,
    AGES = WATCH + 5,
    RISES = AGES + 2,
    NUMBERS,
    SIZES = 5
};

#define RISES_MAX 4u /* REGULARISATION_RISE of fast_rls.c is 16^4 */

static void copy_numbers(const aeo_fast_rls_t *self, uint32_t numbers[NUMBERS])
{
    memcpy(numbers, (const unsigned char *)self + offsetof(aeo_fast_rls_t, random), AGES * sizeof *numbers);
    numbers[AGES] = self->array[0].age;
    numbers[AGES + 1] = self->array[1].age;
    numbers[RISES] = 0u;
    aeo_real_t rho = self->config.regularisation;
    while (rho < self->regularisation) {
        rho *= AEO_REAL(16); /* exact */
        numbers[RISES]++;
    }
}

static size_t count_kept(const aeo_fast_rls_t *self)
{
    return (size_t)(self->step - self->array[0].forward);
}

/* The saved array: version, bytes of a real, p, m, l, feedthrough, three settings; random, filled, active, health,
 * counters, hold, disturbed, astray, watch, ages, rises of rho; then arrays, theta, window, disturbances, innovation,
 * residual and the watch's words as they lie in memory (saved.h). */
static void describe(const aeo_fast_rls_t *self, uint16_t sizes[SIZES], aeo_saved_form_t *form)
{
    sizes[0] = self->config.past;
    sizes[1] = self->config.block;
    sizes[2] = self->config.outputs;
    sizes[3] = (uint16_t)(self->config.feedthrough >> 16);
    sizes[4] = (uint16_t)(self->config.feedthrough & 0xFFFFu);
    form->version = AEO_FAST_RLS_SAVED_VERSION;
    form->size_count = SIZES;
    form->setting_count = 3;
    form->number_count = NUMBERS;
    form->sizes = sizes;
    form->settings = &self->config.forgetting;
    form->words = AEO_FAST_RLS_SAVED_HEAD + count_kept(self) + AEO_SAVED_SEAL;
}

aeo_status_t aeo_fast_rls_save(const aeo_fast_rls_t *self, aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    uint16_t sizes[SIZES];
    uint32_t numbers[NUMBERS];
    copy_numbers(self, numbers);
    describe(self, sizes, &form);
    const aeo_status_t status = aeo_saved_begin(&form, numbers, saved, length);
    if (status == AEO_OK) {
        memcpy(saved + AEO_FAST_RLS_SAVED_HEAD, self->array[0].forward, count_kept(self) * sizeof *saved);
        aeo_saved_seal(saved, form.words);
    }
    return status;
}

/* The numbers in words, KEPT_WORDS of them and all finite, can be those of self's memory. */
static int words_hold(const aeo_fast_rls_t *self, const aeo_real_t *words)
{
    const size_t m = self->config.block, n = self->length;
    const size_t array = (size_t)(self->array[1].forward - self->array[0].forward);
    const aeo_real_t *const window = words + 2 * array + n * self->config.outputs;
    return aeo_fast_array_is_sound(self, words) && aeo_fast_array_is_sound(self, words + array) &&
           aeo_linalg_all_within(window, n + m, AEO_REAL(1.1e6)) &&
           /* rounding may make up to twice as much of a disturbance */
           aeo_linalg_all_within(window + n + m, n + m, AEO_REAL(2) * self->disturbance) &&
           aeo_linalg_all_within(window + 2 * (n + m), self->config.outputs, AEO_REAL(1e12));
}

/* words lie as self's memory does */
static int numbers_hold(const aeo_fast_rls_t *self, const uint32_t numbers[NUMBERS], const aeo_real_t *words)
{
    aeo_watch_t watch;
    memcpy(&watch, numbers + WATCH, sizeof watch);
    return numbers[RANDOM] != 0u && numbers[FILLED] <= self->config.past + 1u && numbers[ACTIVE] <= 1u &&
           numbers[RISES] <= RISES_MAX && numbers[DISTURBED] <= self->config.past + 2u &&
           numbers[ASTRAY] <= self->patience &&
           aeo_watch_holds(&watch, words + (self->watched - self->array[0].forward), self->config.outputs);
}

aeo_status_t aeo_fast_rls_restore(aeo_fast_rls_t *self, const aeo_real_t *saved, size_t length)
{
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_saved_form_t form;
    uint16_t sizes[SIZES];
    uint32_t numbers[NUMBERS];
    describe(self, sizes, &form);
    const aeo_status_t status = aeo_saved_judge(&form, saved, length, numbers);
    if (status != AEO_OK) {
        return status;
    }
    const aeo_real_t *const body = saved + AEO_FAST_RLS_SAVED_HEAD;
    if (!numbers_hold(self, numbers, body) || !words_hold(self, body)) {
        return AEO_E_DAMAGED;
    }
    memcpy((unsigned char *)self + offsetof(aeo_fast_rls_t, random), numbers, AGES * sizeof *numbers);
    self->array[0].age = numbers[AGES];
    self->array[1].age = numbers[AGES + 1];
    self->regularisation = self->config.regularisation;
    for (uint32_t rises = numbers[RISES]; rises > 0u; rises--) {
        self->regularisation *= AEO_REAL(16);
    }
    memcpy(self->array[0].forward, body, count_kept(self) * sizeof *body);
    return AEO_OK;
}

int aeo_fast_rls_invariants_hold(const aeo_fast_rls_t *self)
{
    if (self == NULL || self->length != AEO_FAST_RLS_LENGTH(self->config.past, self->config.block, self->tail)) {
        return 0;
    }
    uint32_t numbers[NUMBERS];
    copy_numbers(self, numbers);
    const size_t m = self->config.block, n = self->length;
    const aeo_real_t *const words = self->array[0].forward;
    return numbers_hold(self, numbers, words) &&
           self->residual == self->theta + (n * self->config.outputs + 2 * (n + m) + self->config.outputs) &&
           aeo_linalg_all_finite(words, count_kept(self)) && words_hold(self, words);
}
/* SPDX-License-Identifier: MIT */
