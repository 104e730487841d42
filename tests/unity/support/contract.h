/* contract.h: the laws every filter obeys, written once. A filter shows a face; the laws know nothing else of it. */
#ifndef CONTRACT_H
#define CONTRACT_H

#include "aeolid/config.h"
#include "aeolid/status.h"

typedef struct {
    const char *name;
    size_t object_bytes;
    size_t (*words)(size_t n, size_t l);
    size_t (*saved_words)(size_t n, size_t l);
    /* gate and bound off, so that forgetting is plain exponential weighting */
    aeo_status_t (*init)(void *object, size_t n, size_t l, double lambda, double rho, aeo_real_t *memory, size_t words);
    aeo_status_t (*update)(void *object, const aeo_real_t *z, const aeo_real_t *y);
    const aeo_real_t *(*theta)(const void *object);
    const aeo_real_t *(*innovation)(const void *object);
    const aeo_real_t *(*residual)(const void *object);
    void (*reset)(void *object);
    aeo_status_t (*save)(const void *object, aeo_real_t *saved, size_t length);
    aeo_status_t (*restore)(void *object, const aeo_real_t *saved, size_t length);
    int (*invariants_hold)(const void *object);
    uint32_t *(*rejected)(void *object); /* the counter of refused updates */
} filter_face_t;

/* Check all laws with Unity; one RUN_TEST a law. */
void run_contract(const filter_face_t *face);

#endif
