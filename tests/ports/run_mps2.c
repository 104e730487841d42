/* The shown program for an MPS2 board with sensors; it goes on until the emulator is stopped. */
#include "harness.h"

#include "wiring.h"

int read_sensors(aeo_real_t *u, aeo_real_t *y)
{
    harness_sensors(u, y);
    return 1;
}
