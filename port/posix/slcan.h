/* slcan.h: writes and reads CAN frames as lines of text, the serial protocol of LAWICEL adapters.
 *
 * MODEL
 *   tIIILDD..  11 bit identifier      TIIIIIIIILDD..  29 bit      (I identifier, L length code, D data, hexadecimal)
 *   d, D       CAN FD                 b, B            CAN FD with the fast data phase; L is the length code 0 ... F
 *   A line ends with a carriage return. Source: LAWICEL CANUSB manual 1.0D; FD letters as in the CANable 2.0 firmware.
 *
 * CONTRACT
 *   Memory: none. Pure functions; may be called from anywhere.
 */
#ifndef AEOLID_POSIX_SLCAN_H
#define AEOLID_POSIX_SLCAN_H

#include <aeolid/frame.h>

/* Characters of the longest line: letter, 8 identifier, length code, 128 data, carriage return. */
#define SLCAN_LINE_MAX 139u

/* Write one line into `line` (SLCAN_LINE_MAX characters, no final zero); returns its length, 0 for a frame whose
 * identifier or length does not exist. */
size_t slcan_format(const aeo_can_frame_t *frame, char *line);

/* Read one line of `length` characters without its carriage return; returns 1 and fills `frame`, 0 for anything
 * else. */
int slcan_parse(const char *line, size_t length, aeo_can_frame_t *frame);

#endif
/* SPDX-License-Identifier: MIT */
