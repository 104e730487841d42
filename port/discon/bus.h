/* bus.h: where a turbine's frames go: listeners on a terminal or TCP port, a CAN interface, a file, nowhere.
 *
 * MODEL
 *   Several turbines with one settings file stay apart: turbine 2, 3 … of a process gets the port or node number one,
 *   two … higher, and -2, -3 … before the ending of its file. Runs stay apart too: where the file exists, this run's is
 *   the first of _2, _3 … _9999 that is free, unless the settings say `overwrite = yes`.
 *
 * CONTRACT
 *   Memory: the structure; for tcp and pty posix_bus_t besides (4.2 MB), allocated by bus_open. send, service: never
 *   block. A CAN interface that was taken away and comes back is bound anew within bus_service, which may then wait for
 *   the kernel.
 */
#ifndef AEOLID_DISCON_BUS_H
#define AEOLID_DISCON_BUS_H

#include "../posix/posix_bus.h"
#include "../posix/socketcan.h"
#include "frame_log.h"
#include "settings.h"

#define BUS_PATH_MAX (SETTINGS_PATH_MAX + 32u)

typedef struct {
    bus_kind_t kind; /* BUS_NONE: frames are taken and lost */
    posix_bus_t *text;
    socketcan_t can;
    frame_log_t log;
    uint64_t clock_us;       /* simulated time, set by the owner: paces the streamer, dates the lines of the file */
    uint32_t refused;        /* frames not taken; never decreases */
    char path[BUS_PATH_MAX]; /* of the file that is written */
} bus_t;

/* Open what the settings say for turbine number `turbine` (1 ...). Returns 0, else -1, `why` (room characters) holds a
 * sentence and the bus is BUS_NONE. */
int bus_open(bus_t *self, const settings_t *settings, unsigned turbine, char *why, size_t room);

/* Fill in `send` and the clock of simulated time; no lock: one context. */
void bus_port(bus_t *self, aeo_port_t *port);

/* Carry on: once a call. */
void bus_service(bus_t *self);

/* Wait up to `seconds` for a listener where there can be one. */
void bus_wait(bus_t *self, double seconds);

/* Carry on and let a few milliseconds pass. */
void bus_pause(bus_t *self);

/* Give listeners time to take what waits for them and to leave (a terminal forgets what was not read); returns once
 * they have, or after a second in which nothing moves. */
void bus_linger(bus_t *self);

/* What a listener opens where the settings do not say it (a terminal, any free port), else null. */
const char *bus_address(const bus_t *self);

/* Close everything. */
void bus_close(bus_t *self);

#endif
/* SPDX-License-Identifier: MIT */
