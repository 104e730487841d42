/* family.c: the list of the filters and the plant of family.h. */
#include "family.h"

#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/frame.h"
#include "aeolid/lattice.h"
#include "aeolid/rls.h"

#include <string.h>

/* What all filters share is their names' shape: one macro writes the face of each. */
#define FACE(x)                                                                                                        \
    static aeo_status_t x##_update(void *self, const aeo_real_t *z, const aeo_real_t *y)                               \
    {                                                                                                                  \
        return aeo_##x##_update(self, z, y);                                                                           \
    }                                                                                                                  \
    static aeo_status_t x##_read(void *self, aeo_real_t *theta, size_t length)                                         \
    {                                                                                                                  \
        return aeo_##x##_read(self, theta, length);                                                                    \
    }                                                                                                                  \
    static const aeo_real_t *x##_innovation(const void *self)                                                          \
    {                                                                                                                  \
        return aeo_##x##_innovation(self);                                                                             \
    }                                                                                                                  \
    static const aeo_real_t *x##_residual(const void *self)                                                            \
    {                                                                                                                  \
        return aeo_##x##_residual(self);                                                                               \
    }                                                                                                                  \
    static uint32_t x##_health(const void *self)                                                                       \
    {                                                                                                                  \
        return aeo_##x##_health(self);                                                                                 \
    }                                                                                                                  \
    static void x##_clear_health(void *self)                                                                           \
    {                                                                                                                  \
        aeo_##x##_clear_health(self);                                                                                  \
    }                                                                                                                  \
    static void x##_reset(void *self)                                                                                  \
    {                                                                                                                  \
        aeo_##x##_reset(self);                                                                                         \
    }                                                                                                                  \
    static aeo_status_t x##_save(const void *self, aeo_real_t *saved, size_t length)                                   \
    {                                                                                                                  \
        return aeo_##x##_save(self, saved, length);                                                                    \
    }                                                                                                                  \
    static aeo_status_t x##_restore(void *self, const aeo_real_t *saved, size_t length)                                \
    {                                                                                                                  \
        return aeo_##x##_restore(self, saved, length);                                                                 \
    }                                                                                                                  \
    static int x##_invariants_hold(const void *self)                                                                   \
    {                                                                                                                  \
        return aeo_##x##_invariants_hold(self);                                                                        \
    }

#define ROW(x, feedback)                                                                                               \
    {                                                                                                                  \
#x, sizeof(aeo_##x##_t), x##_words, x##_saved_words, x##_init, x##_update, x##_read, x##_innovation,           \
            x##_residual, feedback, x##_health, x##_clear_health, x##_reset, x##_save, x##_restore,                    \
            x##_invariants_hold                                                                                        \
    }

static size_t length_of(family_size_t size, unsigned varmax)
{
    return AEO_REGRESSOR_LENGTH(size.inputs, size.outputs, size.past, varmax, size.present);
}

/* The first inputs of the feedthrough mask. */
static uint32_t find_mask(family_size_t size)
{
    return (UINT32_C(1) << size.present % 32u) - 1u; /* present <= 8 wherever a filter is to accept it */
}

/* ---- rls --------------------------------------------------------------------------------------------------------- */

FACE(rls)

static size_t rls_words(family_size_t size)
{
    return AEO_RLS_WORDS(length_of(size, 0), size.outputs);
}

static size_t rls_saved_words(family_size_t size)
{
    return AEO_RLS_SAVED_WORDS(length_of(size, 0), size.outputs);
}

static aeo_status_t rls_init(void *self, family_size_t size, family_settings_t settings, aeo_real_t *memory,
                             size_t words)
{
    const aeo_rls_config_t config = {.regressors = (uint16_t)length_of(size, 0),
                                     .outputs = size.outputs,
                                     .forgetting = settings.forgetting,
                                     .regularisation = settings.regularisation,
                                     .excitation_min = settings.excitation_min,
                                     .growth_max = AEO_REAL(10)};
    return aeo_rls_init(self, &config, memory, words);
}

/* ---- els --------------------------------------------------------------------------------------------------------- */

FACE(els)

static size_t els_words(family_size_t size)
{
    return AEO_ELS_WORDS(length_of(size, 1), size.outputs);
}

static size_t els_saved_words(family_size_t size)
{
    return AEO_ELS_SAVED_WORDS(length_of(size, 1), size.outputs);
}

static aeo_status_t els_init(void *self, family_size_t size, family_settings_t settings, aeo_real_t *memory,
                             size_t words)
{
    const aeo_els_config_t config = {.regressors = (uint16_t)length_of(size, 1),
                                     .outputs = size.outputs,
                                     .past = size.past,
                                     .present = size.present,
                                     .varx_samples = 50,
                                     .forgetting = settings.forgetting,
                                     .forgetting_start = AEO_REAL(0.98),
                                     .forgetting_rate = AEO_REAL(0.99),
                                     .regularisation = settings.regularisation,
                                     .excitation_min = settings.excitation_min,
                                     .growth_max = AEO_REAL(10),
                                     .guard_ratio = AEO_REAL(4)};
    return aeo_els_init(self, &config, memory, words);
}

static const aeo_real_t *els_feedback(const void *self)
{
    return aeo_els_feedback(self);
}

/* ---- fast_rls ---------------------------------------------------------------------------------------------------- */

FACE(fast_rls)

static size_t fast_rls_words(family_size_t size)
{
    return AEO_FAST_RLS_WORDS(size.past, size.inputs + size.outputs, size.present, size.outputs);
}

static size_t fast_rls_saved_words(family_size_t size)
{
    return AEO_FAST_RLS_SAVED_WORDS(size.past, size.inputs + size.outputs, size.present, size.outputs);
}

static aeo_status_t fast_rls_init(void *self, family_size_t size, family_settings_t settings, aeo_real_t *memory,
                                  size_t words)
{
    const aeo_fast_rls_config_t config = {.past = size.past,
                                          .block = (uint16_t)(size.inputs + size.outputs),
                                          .outputs = size.outputs,
                                          .feedthrough = find_mask(size),
                                          .forgetting = settings.forgetting,
                                          .regularisation = settings.regularisation,
                                          .growth_max = AEO_REAL(10)};
    return aeo_fast_rls_init(self, &config, memory, words);
}

/* ---- lattice ----------------------------------------------------------------------------------------------------- */

FACE(lattice)

static size_t lattice_words(family_size_t size)
{
    return AEO_LATTICE_WORDS(size.past, size.inputs + size.outputs, size.present, size.outputs);
}

static size_t lattice_saved_words(family_size_t size)
{
    return AEO_LATTICE_SAVED_WORDS(size.past, size.inputs + size.outputs, size.present, size.outputs);
}

static aeo_status_t lattice_init(void *self, family_size_t size, family_settings_t settings, aeo_real_t *memory,
                                 size_t words)
{
    const aeo_lattice_config_t config = {.past = size.past,
                                         .block = (uint16_t)(size.inputs + size.outputs),
                                         .present = size.present,
                                         .outputs = size.outputs,
                                         .forgetting = settings.forgetting,
                                         .regularisation = settings.regularisation,
                                         .excitation_min = settings.excitation_min,
                                         .growth_max = AEO_REAL(10)};
    return aeo_lattice_init(self, &config, memory, words);
}

/* ---- the list ---------------------------------------------------------------------------------------------------- */

const family_filter_t FAMILY[] = {ROW(rls, NULL), ROW(els, els_feedback), ROW(fast_rls, NULL), ROW(lattice, NULL)};
const unsigned FAMILY_COUNT = sizeof FAMILY / sizeof FAMILY[0];

size_t family_regressors(const family_filter_t *filter, family_size_t size)
{
    return length_of(size, filter->feedback != NULL);
}

aeo_status_t family_start_regressor(aeo_regressor_t *self, const family_filter_t *filter, family_size_t size,
                                    aeo_real_t limit, aeo_real_t *memory, size_t words)
{
    aeo_regressor_config_t config;
    aeo_real_t minimum[2 * FAMILY_CHANNELS_MAX], maximum[2 * FAMILY_CHANNELS_MAX];
    for (unsigned i = 0; i < 2u * FAMILY_CHANNELS_MAX; i++) {
        minimum[i] = -limit;
        maximum[i] = limit;
    }
    memset(&config, 0, sizeof config);
    config.inputs = size.inputs;
    config.outputs = size.outputs;
    config.past = size.past;
    config.model_set = filter->feedback != NULL ? AEO_VARMAX : AEO_VARX;
    config.feedthrough = find_mask(size);
    config.period_us = 1000;
    config.minimum = minimum;
    config.maximum = maximum;
    return aeo_regressor_init(self, &config, memory, words);
}

/* ---- the plant --------------------------------------------------------------------------------------------------- */

aeo_real_t family_draw(uint32_t *seed)
{
    /* xorshift32 (Marsaglia 2003); 32-bit operations only, so a board needs no helper of its compiler */
    uint32_t x = *seed;
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    *seed = x;
    return (aeo_real_t)((int32_t)(x >> 8) - 8388608) * AEO_REAL(1.0 / 8388608.0);
}

void family_plant_start(family_plant_t *self, family_size_t size, uint32_t seed)
{
    memset(self, 0, sizeof *self);
    self->size = size;
    self->seed = seed;
    self->excitation = AEO_REAL(1);
    self->noise = AEO_REAL(0.1);
    self->sign = AEO_REAL(1);
}

void family_plant_step(family_plant_t *self)
{
    const unsigned r = self->size.inputs, l = self->size.outputs;
    aeo_real_t next[FAMILY_CHANNELS_MAX];
    for (unsigned i = 0; i < l; i++) {
        aeo_real_t sum = AEO_REAL(0.6) * self->y[i] - AEO_REAL(0.3) * self->y[(i + 1u) % l];
        for (unsigned j = 0; j < r; j++) {
            sum += self->sign * AEO_REAL(0.5) / (aeo_real_t)(1u + i + j) * self->u[j];
        }
        next[i] = sum + self->noise * family_draw(&self->seed);
    }
    for (unsigned i = 0; i < l; i++) {
        self->y[i] = next[i];
    }
    for (unsigned j = 0; j < r; j++) {
        self->u[j] = self->excitation * family_draw(&self->seed) - AEO_REAL(0.2) * self->sign * self->y[j % l];
    }
}

uint32_t family_crc(uint32_t crc, const aeo_real_t *x, size_t count)
{
    for (size_t i = 0; i < count; i++) {
#if AEO_REAL_BYTES == 8
        uint64_t bits;
        memcpy(&bits, &x[i], sizeof bits);
        crc = aeo_frame_crc32(crc, (uint32_t)(bits >> 32));
        crc = aeo_frame_crc32(crc, (uint32_t)bits);
#else
        uint32_t bits;
        memcpy(&bits, &x[i], sizeof bits);
        crc = aeo_frame_crc32(crc, bits);
#endif
    }
    return crc;
}
