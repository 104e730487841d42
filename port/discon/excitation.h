/* excitation.h: makes small, bounded signals to be added to a controller's demands, so that the turbine can be
 * identified while it is controlled.
 *
 * MODEL
 *   target_b(t) = s_b(t)                 collective (s_b the same), individual (shifted sequences), torque
 *               = s(t) cos psi_b         tilt,   psi_b = azimuth + 2 pi (b - 1) / blades, blade 1 at record 60
 *               = s(t) sin psi_b         yaw     (Coleman transformation; Bir, "Multiblade coordinate
 *                                        transformation and its application to wind turbine analysis", 2008, eq. (1))
 *   s: prbs, +-amplitude, the maximum-length sequence of a shift register of `order` bits, one bit each `hold` seconds;
 *   or multisine, `lines` equal cosines from low to high Hz with phases after Schroeder, "Synthesis of low-peak-factor
 *   signals", 1970, eq. (11), turned by the seed; scaled so that its peak is the amplitude.
 *   Outside start <= t < stop the target is 0.
 *   e_b moves towards target_b by at most rate * dt a call. So
 *     |e_b| <= amplitude,   |de_b/dt| <= rate, at the start and the end too,   e_b = 0 from stop + amplitude / rate.
 *   Applied: total = command + e_b, cut so that it stays in minimum ... maximum. A command that lies outside
 *   already is left where the controller put it: e_b is pulled back to 0 at its rate and may only point inwards
 *   meanwhile. What is added is then what the limits leave; it is cut at once, so its own rate is that of the command.
 *
 * CONTRACT
 *   Memory: the structure, 4.8 kB. Operations a call: prbs 50 instructions, multisine one cosine a line and sequence.
 *   s is a function of time alone: time that stands still or goes back repeats values, and e_b holds meanwhile.
 *   Threads: one context at a time may touch one object.
 */
#ifndef AEOLID_DISCON_EXCITATION_H
#define AEOLID_DISCON_EXCITATION_H

#include <stdint.h>

#define EXCITATION_BLADES    3u
#define EXCITATION_LINES_MAX 64u
#define EXCITATION_ORDER_MIN 5u
#define EXCITATION_ORDER_MAX 15u

typedef enum { SIGNAL_OFF, SIGNAL_PRBS, SIGNAL_MULTISINE } excitation_signal_t;
typedef enum { FORM_COLLECTIVE, FORM_INDIVIDUAL, FORM_TILT, FORM_YAW } excitation_form_t;

typedef struct {
    excitation_signal_t signal;
    excitation_form_t form;
    double amplitude, rate;  /* above 0; the demand's unit, and a second */
    double start_s, stop_s;  /* stop after start */
    double minimum, maximum; /* of the total demand */
    double hold_s;           /* prbs: length of a bit, above 0 */
    unsigned order;          /* prbs */
    double low_hz, high_hz;  /* multisine, 0 < low <= high */
    unsigned lines;          /* multisine, 1 ... EXCITATION_LINES_MAX */
    uint32_t seed;
} excitation_settings_t;

/* Private but readable in a debugger. */
typedef struct {
    excitation_settings_t settings;
    double value[EXCITATION_BLADES]; /* e_b */
    double last_s;                   /* time of the last call that moved it */
    int moving;                      /* 1 once last_s holds a time */
    double gain;                     /* multisine: brings the peak to the amplitude */
    double phase[EXCITATION_LINES_MAX];
    uint32_t period; /* prbs: bits */
    uint8_t bits[(1u << EXCITATION_ORDER_MAX) / 8u];
} excitation_t;

/* Make the sequences; settings are copied. */
void excitation_init(excitation_t *self, const excitation_settings_t *settings);

/* Move e_b on to time_s. azimuth_rad and blades serve tilt and yaw; where allowed[b] is 0 e_b goes to 0. */
void excitation_advance(excitation_t *self, double time_s, double azimuth_rad, unsigned blades,
                        const uint8_t allowed[EXCITATION_BLADES]);

/* The clock was set back for good: e_b holds for one call and goes on with the new time. */
void excitation_rewind(excitation_t *self);

/* Return the total demand of blade b for this command; bit for bit the command where nothing is added. */
float excitation_apply(const excitation_t *self, unsigned b, float command);

/* Return 1 when the command lies within minimum ... maximum, so that excitation is allowed. */
int excitation_allowed(const excitation_t *self, float command);

/* Return 1 when the signal is off, or its time is over and every e_b is 0. */
int excitation_over(const excitation_t *self, double time_s);

#endif
/* SPDX-License-Identifier: MIT */
