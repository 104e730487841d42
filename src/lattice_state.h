/* lattice_state.h: what lattice.c and lattice_read.c share; internal, not installed. */
#ifndef AEOLID_LATTICE_STATE_H
#define AEOLID_LATTICE_STATE_H

#include "aeolid/lattice.h"

#ifdef AEO_REAL_DOUBLE
#define aeo_lattice_settings_hold aeo_lattice_settings_hold_f64
#endif

/* An error beyond this is a runaway; lattice.c proves what follows from it. */
#define AEO_LATTICE_ERROR_MAX AEO_REAL(1e10)

/* Return 1 when sizes and settings, all finite, lie in the ranges of lattice.h. */
int aeo_lattice_settings_hold(const aeo_lattice_config_t *config);

/* Words of the state, which begins at factor. */
static inline size_t aeo_lattice_count_state(const aeo_lattice_t *self)
{
    return (size_t)(self->forward - self->factor);
}

#endif
/* SPDX-License-Identifier: MIT */
