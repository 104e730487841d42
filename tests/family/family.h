/* family.h: every filter of the library behind one face, and a plant that feeds any of them: what firmware images, cost
 * gates, benchmark, soak and fuzzing share, so that a new filter joins all of them with one line in family.c.
 *
 * Free of the C library but for memcpy and memset: it runs on a board. Everything is computed in aeo_real_t with
 * additions and multiplications only, so a plant gives the same bits on every machine that does not contract them.
 */
#ifndef FAMILY_H
#define FAMILY_H

#include "aeolid/regressor.h"
#include "aeolid/status.h"

enum { FAMILY_CHANNELS_MAX = 8, FAMILY_OBJECT_MAX = 1024 };

/* A filter's size as its user thinks of it: present inputs are the first ones of the feedthrough mask. */
typedef struct {
    uint16_t inputs, outputs, past, present;
} family_size_t;

typedef struct {
    aeo_real_t forgetting, regularisation;
    aeo_real_t excitation_min; /* of filters that have such a gate */
} family_settings_t;

typedef struct {
    const char *name;
    size_t object_bytes;
    size_t (*words)(family_size_t size);
    size_t (*saved_words)(family_size_t size);
    aeo_status_t (*init)(void *self, family_size_t size, family_settings_t settings, aeo_real_t *memory, size_t words);
    aeo_status_t (*update)(void *self, const aeo_real_t *z, const aeo_real_t *y);
    aeo_status_t (*read)(void *self, aeo_real_t *theta, size_t length);
    const aeo_real_t *(*innovation)(const void *self);
    const aeo_real_t *(*residual)(const void *self);
    const aeo_real_t *(*feedback)(const void *self); /* what goes into the next VARMAX regressor; null: nothing */
    uint32_t (*health)(const void *self);
    void (*clear_health)(void *self);
    void (*reset)(void *self);
    aeo_status_t (*save)(const void *self, aeo_real_t *saved, size_t length);
    aeo_status_t (*restore)(void *self, const aeo_real_t *saved, size_t length);
    int (*invariants_hold)(const void *self);
} family_filter_t;

extern const family_filter_t FAMILY[];
extern const unsigned FAMILY_COUNT;

/* Storage for any filter's structure, aligned for all of them. */
typedef union {
    uint64_t number;
    void *pointer;
    unsigned char bytes[FAMILY_OBJECT_MAX];
} family_object_t;

/* Return n, the regressors of a filter of this size. */
size_t family_regressors(const family_filter_t *filter, family_size_t size);

/* Start a regressor for this filter and size, all scales 1, channels within -limit ... limit. */
aeo_status_t family_start_regressor(aeo_regressor_t *self, const family_filter_t *filter, family_size_t size,
                                    aeo_real_t limit, aeo_real_t *memory, size_t words);

/* A stable system with noise, in a loop that its outputs close: y_k = A y_{k-1} + B u_{k-1} + 0.1 e_k with a ring of
 * outputs, u_k = excitation - 0.2 y. */
typedef struct {
    family_size_t size;
    uint32_t seed;
    aeo_real_t excitation, noise, sign; /* amplitudes; sign turns B over: a step of the parameters */
    aeo_real_t u[FAMILY_CHANNELS_MAX], y[FAMILY_CHANNELS_MAX];
} family_plant_t;

/* At rest, seeded, excitation and noise at 1 and 0.1. */
void family_plant_start(family_plant_t *self, family_size_t size, uint32_t seed);

/* Draw evenly from -1 ... 1 in steps of 2^-23, exact in a float. */
aeo_real_t family_draw(uint32_t *seed);

/* One sample: u and y of self are those of this instant. */
void family_plant_step(family_plant_t *self);

/* Continue a CRC-32 over the bits of count numbers, the same on machines of either byte order. */
uint32_t family_crc(uint32_t crc, const aeo_real_t *x, size_t count);

#endif
