/* socketcan.h: sends frames on a CAN interface of Linux, for controllers that run it: PLC, industrial PC, Raspberry Pi.
 *
 * MODEL
 *   streamer --send--> raw socket (never blocks, receives no frames) --> interface's queue --> CAN controller
 *                           ^
 *   background --poll-------+   error frames, interface up or down, gone and come back
 *
 *   The socket has an empty filter: nothing from the bus reaches this process. Error frames are made by the interface
 *   itself and have a filter of their own. Source: Documentation/networking/can.rst of the Linux kernel.
 *
 * CONTRACT
 *   Memory: the structure; no heap. One system call a frame, one a poll and three more when it looks at the interface.
 *   Never blocks but for poll, which binds anew when the interface has come back and may wait for the kernel's network
 *   configuration then: call it in the background, beside aeo_stream_step, and not in the control task.
 *   Threads: with two contexts (drawing in port.h) give socketcan_port a mutex; it is the streamer's lock, and poll
 *   takes it for a few instructions. A mutex with PTHREAD_PRIO_INHERIT keeps the control task's priority.
 *   Failures: a frame that cannot go now is refused and counted: `full` where the queue has no room, `down` while the
 *   interface is down, gone or in bus-off. A queue shorter than the channels of a sample loses samples; the kernel's
 *   default is 10 frames: ip link set can0 txqueuelen 100.
 */
#ifndef AEOLID_POSIX_SOCKETCAN_H
#define AEOLID_POSIX_SOCKETCAN_H

#include <aeolid/port.h>
#include <pthread.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SOCKETCAN_NAME_MAX 16u      /* characters of an interface's name, the final zero included (IFNAMSIZ) */
#define SOCKETCAN_TEXT_MAX 200u     /* characters of an explanation, the final zero included */
#define SOCKETCAN_LOOK_US  50000u   /* poll looks at the interface not more often than this */
#define SOCKETCAN_REST_US  1000000u /* in bus-off for so long without word of a restart, the interface's flags decide */

/* Never decrease; stay at 2^32 - 1. */
typedef struct {
    uint32_t sent;     /* frames the kernel took */
    uint32_t full;     /* frames refused: the interface's queue or the socket's buffer is full */
    uint32_t down;     /* frames refused: interface down or gone, controller in bus-off */
    uint32_t failed;   /* frames refused for another reason: last_error says which */
    uint32_t errors;   /* error frames from the controller */
    uint32_t bus_off;  /* times it went into bus-off */
    uint32_t lost;     /* times the interface went down or away or the controller into bus-off, as poll saw it */
    uint32_t returned; /* times it came back */
} socketcan_counters_t;

/* Private but readable in a debugger. */
typedef struct {
    int fd;                        /* raw socket; -1 closed */
    int fd_frames;                 /* 1: CAN FD */
    int up;                        /* 1: the interface is there and up, as poll saw it last */
    int off;                       /* 1: in bus-off */
    int last_error;                /* errno of the last frame that failed, 0 none */
    unsigned index;                /* of the interface the socket is bound to; 0 none */
    uint32_t looked_us, off_us;    /* clock of the last look, of the bus-off */
    pthread_mutex_t *mutex;        /* null: one context */
    char name[SOCKETCAN_NAME_MAX]; /* interface */
    socketcan_counters_t counters;
} socketcan_t;

/* Open `interface` ("can0"); fd_frames 1: CAN FD. Returns 0, also where the interface is down: frames are refused until
 * it comes up, and self->up tells. Else an errno, self is closed, and socketcan_explain has a sentence for it. */
int socketcan_open(socketcan_t *self, const char *interface, int fd_frames);

/* Fill in the callbacks: send, a clock (CLOCK_MONOTONIC), and the lock where `mutex`, an initialised mutex that lives
 * on, is not null. */
void socketcan_port(socketcan_t *self, aeo_port_t *port, pthread_mutex_t *mutex);

/* Count error frames, see whether the interface is up, bind anew when it was gone and is back. Call some ten times a
 * second. Returns 1 while frames can go: up and not in bus-off. */
int socketcan_poll(socketcan_t *self);

/* Write what an errno of socketcan_open means and what helps into `text` (SOCKETCAN_TEXT_MAX characters); returns
 * `text`. ENETDOWN: the sentence for an interface that is down. */
const char *socketcan_explain(const char *interface, int error, char *text);

/* Close the socket; what the queue holds is sent. */
void socketcan_close(socketcan_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
