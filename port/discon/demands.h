/* demands.h: adds the excitation to the demands that a controller has written, and takes it out again before the
 * controller sees the array once more.
 *
 * MODEL
 *   record 28 = 0: record 45; 1: records 42, 43, 44 of the blades there are; torque: record 47. Forms other than
 *   collective need record 28 = 1. A pitch rate actuator (record 10 = 1) gets no pitch excitation.
 *   A controller may go on from its own last demand in the array instead of the measured pitch. What the simulator left
 *   untouched there is therefore set back to what the controller wrote: it never integrates its own excitation.
 *   Collective, tilt and yaw stop for all blades when one demand is outside its limits.
 *
 * CONTRACT
 *   Memory: the structure, 9.6 kB. Where both signals are off no record is touched.
 */
#ifndef AEOLID_DISCON_DEMANDS_H
#define AEOLID_DISCON_DEMANDS_H

#include "excitation.h"
#include "settings.h"

#define DEMANDS 5u /* records 42, 43, 44, 45, 47 */

typedef struct {
    excitation_t pitch, torque;
    uint32_t own[DEMANDS], sent[DEMANDS]; /* bits as the controller wrote them and as the simulator got them */
    uint8_t changed[DEMANDS];
    float added[EXCITATION_BLADES + 1u]; /* to the pitch demand of each blade, to the torque demand */
} demands_t;

void demands_init(demands_t *self, const settings_t *settings);

/* Before the controller is called: set back what was added. */
void demands_restore(demands_t *self, float *swap);

/* After the controller was called at time_s: add what is due. */
void demands_excite(demands_t *self, float *swap, double time_s);

/* The clock was set back for good. */
void demands_rewind(demands_t *self);

/* Return a sentence when the settings ask for what this array does not allow, else null. */
const char *demands_impossible(const demands_t *self, const float *swap);

#endif
/* SPDX-License-Identifier: MIT */
