/* turbine.h: one simulator's turbine: its controller, what is added to its demands, what is observed of it.
 *
 * CONTRACT
 *   Memory: the structure (55 kB), and what controller, observer and bus take at the first call. One context at a time.
 *   Every call leaves floating-point environment (flags, rounding, traps), locale and errno as the controller and its
 *   simulator set them: a NaN in a record must not end a simulator that traps invalid operations, and flush-to-zero of
 *   the simulator must not reach the filter.
 */
#ifndef AEOLID_DISCON_TURBINE_H
#define AEOLID_DISCON_TURBINE_H

#include "controller.h"
#include "demands.h"
#include "observer.h"
#include "settings.h"

#define TURBINE_WHY_MAX 640u

typedef struct {
    unsigned number;            /* among those of this process, 1 ... */
    int begun;                  /* 1: settings read, library loaded or refused */
    int told;                   /* 1: `note` has been given */
    char why[TURBINE_WHY_MAX];  /* not empty: there is no controller to call, and this is the reason */
    char note[TURBINE_WHY_MAX]; /* not empty: the controller goes on, but not everything asked for is done */
    settings_t settings;
    controller_t controller;
    demands_t demands;
    observer_t observer;
} turbine_t;

/* Read settings, load the controller, start the observer: whatever fails is in why or note. own: as controller_load. */
void turbine_begin(turbine_t *self, const float *swap, discon_procedure_t own);

/* A first call for a turbine that has run already: observer and excitation start afresh, the controller stays. */
void turbine_restart(turbine_t *self, const float *swap);

/* Before and after the controller's procedure. observed 0: a call that is no time step (last, checkpoint), which only
 * gets its own demands back. failed 1: the controller asked the simulator to stop, and what it wrote is not used. */
void turbine_before(turbine_t *self, float *swap, int observed);
void turbine_after(turbine_t *self, float *swap, int failed);

/* After the last call: end the stream, close, unload. polite 0: at once. */
void turbine_end(turbine_t *self, int polite);

#endif
/* SPDX-License-Identifier: MIT */
