/* contract.h: the laws every filter obeys, written once. A filter shows a face; the laws know nothing else of it. */
#ifndef CONTRACT_H
#define CONTRACT_H

#include "aeolid/config.h"
#include "aeolid/status.h"

/* Sizes of one filter: n = past * block + tail regressors, l outputs. Filters that use the shift of the window (sliding)
 * see windows that slide by one block a sample from an empty start, tail present values last; others see any numbers. */
typedef struct {
    size_t past, block, tail, outputs;
} filter_size_t;

typedef struct {
    const char *name;
    size_t object_bytes;
    int sliding; /* 1: z must slide by one block a sample */
    size_t (*words)(filter_size_t size);
    size_t (*saved_words)(filter_size_t size);
    /* gate, bound and schedules off, so that forgetting is plain exponential weighting */
    aeo_status_t (*init)(void *object, filter_size_t size, double lambda, double rho, aeo_real_t *memory, size_t words);
    aeo_status_t (*update)(void *object, const aeo_real_t *z, const aeo_real_t *y);
    const aeo_real_t *(*theta)(const void *object); /* valid until the next call of it */
    const aeo_real_t *(*innovation)(const void *object);
    const aeo_real_t *(*residual)(const void *object);
    void (*reset)(void *object);
    aeo_status_t (*save)(const void *object, aeo_real_t *saved, size_t length);
    aeo_status_t (*restore)(void *object, const aeo_real_t *saved, size_t length);
    int (*invariants_hold)(const void *object);
    uint32_t *(*rejected)(void *object); /* the counter of refused updates */
    /* Damage what the filter gives up and starts afresh at the next update; null: it has no such part. */
    void (*lose)(void *object);
    /* The weight that stands for rho at regressor j before the first sample; null: rho for each. */
    double (*prior)(filter_size_t size, double lambda, double rho, size_t j);
    /* Relative distance allowed from the batch solution after count well-excited samples; null: the suite's own. */
    double (*close)(double lambda, size_t count);
} filter_face_t;

/* Define the calls of the face that every filter has in the same form, for aeo_<filter>_t; CONTRACT_CALLS names them. */
#define CONTRACT_FORWARD(filter)                                                                                       \
    static aeo_status_t update(void *object, const aeo_real_t *z, const aeo_real_t *y)                                 \
    {                                                                                                                  \
        return aeo_##filter##_update(object, z, y);                                                                    \
    }                                                                                                                  \
    static const aeo_real_t *innovation(const void *object)                                                            \
    {                                                                                                                  \
        return aeo_##filter##_innovation(object);                                                                      \
    }                                                                                                                  \
    static const aeo_real_t *residual(const void *object)                                                              \
    {                                                                                                                  \
        return aeo_##filter##_residual(object);                                                                        \
    }                                                                                                                  \
    static void reset(void *object)                                                                                    \
    {                                                                                                                  \
        aeo_##filter##_reset(object);                                                                                  \
    }                                                                                                                  \
    static aeo_status_t save(const void *object, aeo_real_t *saved, size_t length)                                     \
    {                                                                                                                  \
        return aeo_##filter##_save(object, saved, length);                                                             \
    }                                                                                                                  \
    static aeo_status_t restore(void *object, const aeo_real_t *saved, size_t length)                                  \
    {                                                                                                                  \
        return aeo_##filter##_restore(object, saved, length);                                                          \
    }                                                                                                                  \
    static int invariants_hold(const void *object)                                                                     \
    {                                                                                                                  \
        return aeo_##filter##_invariants_hold(object);                                                                 \
    }
#define CONTRACT_CALLS                                                                                                 \
    .update = update, .innovation = innovation, .residual = residual, .reset = reset, .save = save,                    \
    .restore = restore, .invariants_hold = invariants_hold

/* Check all laws with Unity; one RUN_TEST a law. */
void run_contract(const filter_face_t *face);

#endif
