/* The shown slcan program with sensors that wait for a listener first and for it to have taken all in the end. */
#include "harness.h"

#include "wiring.h"

int read_sensors(aeo_real_t *u, aeo_real_t *y)
{
    static unsigned taken;
    if (taken == 0u) {
        (void)printf("%s\n", bus.address);
        (void)fflush(stdout);
    }
    while (taken == 0u && posix_bus_listeners(&bus) == 0u) {
        (void)posix_bus_poll(&bus, -1, 100);
    }
    harness_sensors(u, y);
    if (taken++ < 250u) {
        return 1;
    }
    while (posix_bus_waiting(&bus) > 0u) {
        (void)posix_bus_poll(&bus, -1, 100);
    }
    return 0;
}
