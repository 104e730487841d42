/* chosen_filter.h: any filter of the library behind one face, chosen at run time by programs that offer them all.
 *
 * MODEL
 *   none of its own. Firmware calls one filter directly; the node in software and the replay of recordings take the name
 *   of a method from their user.
 *
 * CONTRACT
 *   Memory: chosen_filter_words(config) words of aeo_real_t: those of the filter and l n for the parameters read.
 *   Threads: one context at a time may touch one object.
 */
#ifndef AEOLID_CHOSEN_FILTER_H
#define AEOLID_CHOSEN_FILTER_H

#include <aeolid/els.h>
#include <aeolid/fast_rls.h>
#include <aeolid/lattice.h>
#include <aeolid/regressor.h>
#include <aeolid/rls.h>

/* Numbers travel in descriptions (chosen_filter_wire_set) and never change. */
typedef enum { CHOSEN_RLS = 0, CHOSEN_ELS = 1, CHOSEN_FAST_RLS = 2, CHOSEN_LATTICE = 3 } chosen_method_t;

/* Counters of chosen_filter_count: those of rls.h, then those of single filters, 0 for the others. */
enum {
    CHOSEN_UPDATES,
    CHOSEN_REJECTED,
    CHOSEN_WITHHELD,
    CHOSEN_BOUNDED,
    CHOSEN_REINITIALISED,
    CHOSEN_RELEASED,
    CHOSEN_FELL_BACK,
    CHOSEN_LIMITED,
    CHOSEN_RESTARTED,
    CHOSEN_COUNTERS
};

/* Settings as in the filters' headers; those from varx_samples on are read for els only. */
typedef struct {
    chosen_method_t method;
    aeo_model_set_t model_set; /* els is VARMAX; the others take either and feed their residual back in VARMAX */
    uint16_t inputs, outputs, past;
    uint32_t feedthrough; /* bit i: u_i of the present sample is a regressor */
    aeo_real_t forgetting, regularisation, excitation_min, growth_max;
    uint32_t varx_samples;
    aeo_real_t forgetting_start, forgetting_rate, guard_ratio;
} chosen_config_t;

typedef struct {
    chosen_config_t config;
    uint16_t regressors; /* n */
    aeo_real_t *theta;   /* l n: parameters as last read */
    union {
        aeo_rls_t rls;
        aeo_els_t els;
        aeo_fast_rls_t fast_rls;
        aeo_lattice_t lattice;
    } of;
} chosen_filter_t;

/* Return the method called `name` (rls, els, fast-rls, lattice) as a number, -1 for any other. */
int chosen_filter_method(const char *name);

/* Return n, the regressors of this layout. */
size_t chosen_filter_regressors(const chosen_config_t *config);

/* Return the words that init needs; 0 for a method that is not there. */
size_t chosen_filter_words(const chosen_config_t *config);

/* Start self in the memory given. Codes of the filter's init; AEO_E_ARG also for els that is not VARMAX. */
aeo_status_t chosen_filter_init(chosen_filter_t *self, const chosen_config_t *config, aeo_real_t *memory, size_t words);

/* Absorb the regressor's sample, and give it the residual back where it is VARMAX. Codes of the filter's update. */
aeo_status_t chosen_filter_take(chosen_filter_t *self, aeo_regressor_t *regressor);

/* Read theta, l x n by rows, scaled units; valid until the next call. Null where the filter has no finite one. */
const aeo_real_t *chosen_filter_theta(chosen_filter_t *self);

/* Return innovation and residual of the last sample, l values; the sticky health flags; counter `which`. */
const aeo_real_t *chosen_filter_innovation(const chosen_filter_t *self);
const aeo_real_t *chosen_filter_residual(const chosen_filter_t *self);
uint32_t chosen_filter_health(const chosen_filter_t *self);
uint32_t chosen_filter_count(const chosen_filter_t *self, unsigned which);

/* Return what a description tells of the filter: the model set, and in the upper byte which filter made it. rls in
 * VARX and els in VARMAX have 0 there, as all streams had when there were no others; fast-rls 1, lattice 2, rls in
 * VARMAX 3. A host that does not know a number says so. */
uint16_t chosen_filter_wire_set(const chosen_config_t *config);

#endif
/* SPDX-License-Identifier: MIT */
