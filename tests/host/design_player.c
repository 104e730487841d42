/* Play the excitations of a settings file as port/discon does, without a simulator: design_player CFG DT FROM COUNT
 * prints time, pitch and torque of COUNT calls, DT seconds apart, the first at FROM, after one a step before it. */
#include "excitation.h"
#include "settings.h"

#include <stdio.h>
#include <stdlib.h>

static settings_t settings;
static excitation_t pitch, torque;

int main(int count, char **words)
{
    static const uint8_t allowed[EXCITATION_BLADES] = {1, 1, 1};
    char why[SETTINGS_WHY_MAX];
    if (count != 5 || settings_read(&settings, words[1], why) != 0) {
        fprintf(stderr, "%s\n", count == 5 ? why : "design_player CFG DT FROM COUNT");
        return 1;
    }
    const double dt = atof(words[2]), from = atof(words[3]);
    excitation_init(&pitch, &settings.pitch);
    excitation_init(&torque, &settings.torque);
    for (long k = -1; k < atol(words[4]); k++) {
        const double time = from + dt * (double)k;
        excitation_advance(&pitch, time, 0.0, 3, allowed);
        excitation_advance(&torque, time, 0.0, 1, allowed);
        if (k >= 0) {
            printf("%.17g %.17g %.17g\n", time, pitch.value[0], torque.value[0]);
        }
    }
    return 0;
}
/* SPDX-License-Identifier: MIT */
