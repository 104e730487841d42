/* frame_log.h: writes frames to a file as candump does (can-utils, log format), which `aeolid listen --bus` replays.
 *
 *   (1764108012.300000) can0 1CFF4201#0001002A3F800000          classic frame
 *   (1764108012.300000) can0 1CFF4A01##1…                        CAN FD, flags 1: fast data phase
 *   The stamp is the host's clock at the first call plus the simulated time since then: a date, as candump writes it,
 *   and differences that are the controller's seconds, however fast the simulator runs.
 *
 * CONTRACT
 *   Memory: the structure. Lines are written once a second of simulated time, or when half the room is used: one system
 *   call and not one for each sample; a simulator that is killed loses that second. A disk that is full costs frames,
 *   which are then refused. A file that exists is not touched unless `replace` says so. The file must be a regular one:
 *   a pipe would hold the simulator up. Beyond the process's limit on file sizes nothing is written, since the system
 *   would end the process.
 */
#ifndef AEOLID_DISCON_FRAME_LOG_H
#define AEOLID_DISCON_FRAME_LOG_H

#include <aeolid/frame.h>

#define FRAME_LOG_ROOM 32768u   /* characters kept at most */
#define FRAME_LOG_US   1000000u /* between two writes */
#define FRAME_LOG_LINE 192u     /* the longest line */

typedef struct {
    int fd;         /* -1: closed */
    uint64_t limit; /* bytes the file may have */
    uint64_t size;
    uint64_t start_us;   /* host's clock at time 0, us since 1970 */
    uint64_t written_us; /* time of the last write */
    uint64_t stamp_us;   /* time that `stamp` tells */
    size_t stamp_length, held;
    char stamp[48];
    char text[FRAME_LOG_ROOM];
} frame_log_t;

/* Begin a new file; 0, or an errno: EEXIST where there is one that `replace` 0 leaves alone. */
int frame_log_open(frame_log_t *self, const char *path, int replace);

/* Keep one frame for time_us; 1 taken, 0 no room. */
int frame_log_put(frame_log_t *self, uint64_t time_us, const aeo_can_frame_t *frame);

/* Write what is kept, as much as the file takes, when it is due at time_us. */
void frame_log_service(frame_log_t *self, uint64_t time_us);

/* Write what is kept and close. */
void frame_log_close(frame_log_t *self);

#endif
/* SPDX-License-Identifier: MIT */
