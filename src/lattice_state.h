/* lattice_state.h: what the sources of the lattice share; internal, not installed.
 *
 * A matrix P = L D L' (m x m) is packed by columns: column j holds D_j, then rows j+1 ... m-1 of L, whose diagonal
 * is 1.
 */
#ifndef AEOLID_LATTICE_STATE_H
#define AEOLID_LATTICE_STATE_H

#include "aeolid/lattice.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_lattice_judge_config aeo_lattice_judge_config_f64
#define aeo_lattice_count_words  aeo_lattice_count_words_f64
#define aeo_lattice_turn         aeo_lattice_turn_f64
#define aeo_lattice_variance     aeo_lattice_variance_f64
#endif

/* An error beyond this is a runaway; lattice.c proves what follows from it. */
#define AEO_LATTICE_ERROR_MAX AEO_REAL(1e10)

/* Judge sizes and settings on the ranges of lattice.h: AEO_OK, AEO_E_NOT_FINITE or AEO_E_ARG. */
aeo_status_t aeo_lattice_judge_config(const aeo_lattice_config_t *config);

/* Return AEO_LATTICE_WORDS of a filter. */
size_t aeo_lattice_count_words(const aeo_lattice_config_t *config);

/* Absorb r (m values) with weight 1 / alpha into P (factor), which becomes scale times what it was less the news; with
 * scale 0 it stays. gain (m values, written) = P r, or D L'r with scale 0; returns alpha + r'Pr. Needs alpha > 0. */
aeo_real_t aeo_lattice_turn(aeo_real_t *factor, const aeo_real_t *r, aeo_real_t *gain, size_t m, aeo_real_t alpha,
                            aeo_real_t scale);

/* Where variance P_ii of one of the triangles is to be found. */
typedef struct {
    const aeo_real_t *factor;
    size_t m, i;
} aeo_lattice_variance_t;

/* Find variance index of a state at factor: those of the 2 p - 1 triangles of m come first, then those of d. */
static inline aeo_lattice_variance_t aeo_lattice_find_variance(const aeo_lattice_t *self, const aeo_real_t *factor,
                                                               size_t index)
{
    const size_t m = self->config.block, t = index / m, stages = 2u * (size_t)self->config.past - 1u;
    const aeo_lattice_variance_t at = {factor + t * AEO_LATTICE_TRIANGLE(m), t < stages ? m : self->config.present,
                                       index - t * m};
    return at;
}

static inline unsigned aeo_lattice_count_variances(const aeo_lattice_config_t *config)
{
    return (2u * config->past - 1u) * config->block + config->present;
}

/* Return P_ii. */
aeo_real_t aeo_lattice_variance(const aeo_lattice_variance_t *at);

/* Return r_j of the last sample (m values). The places go round: what stage j keeps is stage j + 1's a sample later. */
static inline aeo_real_t *aeo_lattice_find_error(const aeo_lattice_t *self, size_t j)
{
    const size_t place = self->head + j, p = self->config.past;
    return self->error + (place < p ? place : place - p) * self->config.block;
}

/* Words of the state, which begins at factor. */
static inline size_t aeo_lattice_count_state(const aeo_lattice_t *self)
{
    return (size_t)(self->forward - self->factor);
}

#endif
/* SPDX-License-Identifier: MIT */
