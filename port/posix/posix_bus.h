/* posix_bus.h: offers a virtual CAN bus to other processes: slcan text over a pseudo terminal or TCP on the loopback.
 *
 * MODEL
 *   streamer --send--> one ring a listener --poll--> terminal or sockets
 *   A listener is a peer that has opened its channel (slcan command O or L; C closes it). What is sent while it is
 *   closed is not kept: it joins late, as on a real bus. Other slcan commands are acknowledged; frames from listeners
 *   are read over and dropped: this node listens to nothing.
 *   Whoever connects gets a place. Where none is free it takes that of the peer that has been connected longest without
 *   opening its channel, else that of the open listener which is furthest behind, if that is more than half a ring; so
 *   peers that say nothing or read nothing lock nobody out. Only where all listeners keep up is it turned away.
 *
 * CONTRACT
 *   Memory: 16 rings of 256 kB in the structure (an operating system gives those in use), none from the heap. One thread. send never blocks; poll waits at most
 *   the time given. A frame is refused when no open listener has room for it; a listener without room while another has
 *   some loses the frame (dropped). Without listeners every frame is taken and lost, as on a bus nobody reads.
 */
#ifndef AEOLID_POSIX_BUS_H
#define AEOLID_POSIX_BUS_H

#include <aeolid/port.h>

#define POSIX_BUS_LISTENERS 16
#define POSIX_BUS_RING      262144u /* characters, a power of two; 9700 classic frames */

/* One peer. */
typedef struct {
    int fd;           /* -1: free place */
    int open;         /* 1: its channel is open */
    uint32_t order;   /* of its arrival, wraps */
    uint32_t head;    /* characters written, wraps */
    uint32_t tail;    /* characters taken by the peer, wraps */
    uint32_t dropped; /* frames it lost because its ring was full */
    size_t command_length;
    char command[160]; /* line being received */
    char ring[POSIX_BUS_RING];
} posix_listener_t;

typedef struct {
    int terminal;     /* 1: pseudo terminal, 0: TCP */
    int server;       /* listening socket, -1 for a terminal */
    uint32_t arrived; /* peers so far, wraps */
    uint32_t refused; /* frames no listener had room for */
    uint32_t dropped; /* frames lost to single listeners that have left */
    char address[96]; /* what a listener opens: slcan:/dev/pts/3 or slcan:socket://127.0.0.1:29536 */
    posix_listener_t listener[POSIX_BUS_LISTENERS];
} posix_bus_t;

/* Open a pseudo terminal; 0 when done, else an errno. */
int posix_bus_open_terminal(posix_bus_t *self);

/* Listen on 127.0.0.1:port, port 0: any free one; 0 when done, else an errno. */
int posix_bus_open_tcp(posix_bus_t *self, uint16_t port);

/* Fill in the callbacks; no clock and no lock: one thread, simulated time. */
void posix_bus_port(posix_bus_t *self, aeo_port_t *port);

/* Move characters both ways; wait up to timeout_ms for something to do, and for fd `also` (-1: none) to become
 * readable.
 * Returns 1 when `also` is readable, else 0. */
int posix_bus_poll(posix_bus_t *self, int also, int timeout_ms);

/* Return the number of open listeners. */
unsigned posix_bus_listeners(const posix_bus_t *self);

/* Return the classic frames for which every open listener has room; SIZE_MAX without listeners. */
size_t posix_bus_room(const posix_bus_t *self);

/* Return the characters that wait for the slowest open listener. */
size_t posix_bus_waiting(const posix_bus_t *self);

/* Return the frames lost to single listeners so far. */
uint32_t posix_bus_dropped(const posix_bus_t *self);

/* Close the channel of each listener whose ring holds more than `waiting` characters: it does not read any more. */
void posix_bus_abandon(posix_bus_t *self, size_t waiting);

/* Close everything. */
void posix_bus_close(posix_bus_t *self);

#endif
/* SPDX-License-Identifier: MIT */
