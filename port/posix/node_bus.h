/* node_bus.h: the bus of the software node, whichever it is: slcan text to listeners, or a CAN interface of Linux.
 *
 * MODEL
 *   slcan: listeners are seen, and push back when they do not read (posix_bus.h). CAN interface: nobody is seen and a
 *   virtual one pushes nothing back, so the node keeps to the bit rate of the bus by its own clock.
 *
 * CONTRACT
 *   Memory: the structure. One thread. send never blocks; poll waits at most the time given.
 */
#ifndef AEOLID_POSIX_NODE_BUS_H
#define AEOLID_POSIX_NODE_BUS_H

#include "posix_bus.h"
#include "socketcan.h"

typedef struct {
    int is_can;
    posix_bus_t text;
    socketcan_t can;
    uint32_t bit_rate;   /* of the CAN bus */
    int64_t idle_ns;     /* when the CAN bus will have carried what was sent */
    int64_t refusing_ns; /* since when it takes nothing; 0: the last frame was taken */
    int usable;          /* 0: the interface is down */
    char address[96];    /* what a listener opens: slcan:/dev/pts/3, slcan:socket://127.0.0.1:29536, socketcan:can0 */
} node_bus_t;

/* Open a pseudo terminal (terminal 1) or a TCP port on the loopback; or a CAN interface, for CAN FD with fd_frames 1.
 * Return 0, else `why` (SOCKETCAN_TEXT_MAX characters) holds a sentence. */
int node_bus_open_text(node_bus_t *self, int terminal, uint16_t tcp_port, char *why);
int node_bus_open_can(node_bus_t *self, const char *interface, int fd_frames, uint32_t bit_rate, char *why);

/* Fill in the callbacks; no clock and no lock: one thread, simulated time. */
void node_bus_port(node_bus_t *self, aeo_port_t *port);

/* As posix_bus_poll; also tells on standard error when a CAN interface goes or comes back. */
int node_bus_poll(node_bus_t *self, int also, int timeout_ms);

/* As posix_bus_listeners, posix_bus_room, posix_bus_waiting, posix_bus_abandon and posix_bus_close. On a CAN interface
 * no listeners are seen, nothing waits, and there is room when the bus has carried what was sent before. */
unsigned node_bus_listeners(const node_bus_t *self);
size_t node_bus_room(const node_bus_t *self);
size_t node_bus_waiting(const node_bus_t *self);
void node_bus_abandon(node_bus_t *self, size_t waiting);
void node_bus_close(node_bus_t *self);

/* Return 1 when a CAN interface has taken no frame for so many seconds although it was offered some. */
int node_bus_is_stuck(const node_bus_t *self, double seconds);

/* Return the frames lost to single listeners so far. */
uint32_t node_bus_dropped(const node_bus_t *self);

/* Write the counters of a CAN interface as a further member of a JSON object to standard error; nothing for slcan. */
void node_bus_print_counters(const node_bus_t *self);

#endif
/* SPDX-License-Identifier: MIT */
