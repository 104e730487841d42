/* records.h: names the records of avrSWAP, the array by which simulator and controller speak to each other.
 *
 * MODEL
 *   Records are numbered from 1, each a 32-bit float. Sources: GH Bladed, "Bladed user manual", appendix A; the list of
 *   OpenFAST's ServoDyn, BladedInterface.f90.
 *
 * CONTRACT
 *   Memory: constants. Pure functions; may be called from anywhere.
 */
#ifndef AEOLID_DISCON_RECORDS_H
#define AEOLID_DISCON_RECORDS_H

#include <stddef.h>
#include <stdint.h>

/* Those that this port itself reads or writes. */
enum {
    RECORD_STATUS = 1, /* 0 first call, 1 later ones, -1 last; -8 checkpoint, -9 restart (OpenFAST) */
    RECORD_TIME = 2,   /* s */
    RECORD_STEP = 3,   /* s between two calls */
    RECORD_PITCH_1 = 4,
    RECORD_PITCH_ACTUATOR = 10, /* 0 position, 1 rate */
    RECORD_PITCH_MODE = 28,     /* 0 collective (45), 1 individual (42 to 44) */
    RECORD_PITCH_2 = 33,
    RECORD_PITCH_3 = 34,
    RECORD_COMMAND_1 = 42, /* pitch demand of blade 1; 43 and 44 follow */
    RECORD_COMMAND = 45,   /* collective pitch demand */
    RECORD_TORQUE_COMMAND = 47,
    RECORD_MESSAGE_LENGTH = 49, /* characters of avcMSG */
    RECORD_AZIMUTH = 60,
    RECORD_BLADES = 61,
    RECORDS_LEAST = 64 /* every array is taken to have so many */
};

/* Where a channel's value comes from. */
typedef enum {
    SOURCE_MEASURED,         /* a record as the simulator gave it, read before the controller is called */
    SOURCE_DEMANDED,         /* a record as the simulator gets it back, excitation included */
    SOURCE_PITCH,            /* mean of records 4, 33, 34 over the blades there are */
    SOURCE_COMMAND,          /* record 45, or the mean of 42 to 44, as record 28 says */
    SOURCE_EXCITED_PITCH,    /* what was added to the pitch demand: mean over the blades */
    SOURCE_EXCITED_PITCH_AT, /* the same of one blade; record holds 0, 1, 2 */
    SOURCE_EXCITED_TORQUE    /* what was added to the torque demand */
} record_source_t;

typedef struct {
    const char *name;
    const char *unit;
    record_source_t source;
    uint16_t record;
} named_record_t;

/* Return the entry called `name`, null for any other name. */
const named_record_t *records_find(const char *name);

/* Return entry number `i` in the table's order, null past its end. */
const named_record_t *records_at(size_t i);

/* Return record `number` (1 ...) of the array. */
float records_get(const float *swap, unsigned number);

/* Return the number of blades in the array, 1 ... 3; 3 where record 61 says nothing sensible. */
unsigned records_blades(const float *swap);

/* Return 1 when the array asks for one demand a blade (42 to 44), 0 when for a collective one (45). */
int records_individual(const float *swap);

/* Return 1 when `value` is neither NaN nor infinite, judged on its bits. */
int records_finite(float value);

#endif
/* SPDX-License-Identifier: MIT */
