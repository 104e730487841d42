/* status.h: says what a call did, in numbers that are the same in every build and travel on CAN.
 *
 * MODEL
 *   Three tiers. A programmer's error (null pointer, size out of range, too few words) is AEO_E_ARG or AEO_E_MEMORY.
 *   A rejected sample is another negative code; the estimator is untouched and exactly one counter goes up. A condition
 *   of the estimator (not excited, bounded, re-initialised) is no error: the call succeeds and a sticky health flag and
 *   a counter tell of it. AEO_E_GAP alone is negative and yet no rejection: the sample was taken as the first of a new
 *   past window, there is no regressor for it, and what is lost are the samples before it, which nobody has counted.
 *
 * CONTRACT
 *   Memory: none. Thread and interrupt rule: aeo_status_text reads constants only and may be called from anywhere.
 *   Numbers are never reused. -32 ... -47 belong to the streamer (stream.h), -48 ... -63 to ports (port.h), which define
 *   them.
 *   A positive code is a success that still has something to say.
 */
#ifndef AEOLID_STATUS_H
#define AEOLID_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    AEO_OK = 0,            /* done */
    AEO_FILLING = 1,       /* sample taken; the past window is not full yet, so there is no regressor for it */
    AEO_E_ARG = -1,        /* null pointer, size or setting out of its range, arrays that must not overlap do */
    AEO_E_MEMORY = -2,     /* the array given is shorter than its formula */
    AEO_E_NOT_FINITE = -3, /* a number is NaN or infinite */
    AEO_E_RANGE = -4,      /* a number is outside its configured or plausible range */
    AEO_E_TIME = -5,       /* time stands still, goes backwards, or the sample comes earlier than half a period */
    AEO_E_GAP = -6,        /* samples are missing before this one, which was taken: the past window starts with it */
    AEO_E_VERSION = -7,    /* saved by a version of the format that this one does not read */
    AEO_E_MISMATCH = -8,   /* saved by a filter of other dimensions, settings or precision */
    AEO_E_DAMAGED = -9,    /* saved words contradict each other, or a frame's check is wrong */
    AEO_E_BUSY = -32,      /* the snapshot before this one is still being sent; it stays what it was */
    AEO_E_BUDGET = -33, /* what is to be sent needs more than nine tenths of the budget, or snapshots do not fit in */
    AEO_E_REFUSED = -34 /* at least one frame of a sample or its seal was dropped; counters.dropped tells how many */
} aeo_status_t;

/* Return one English sentence without a full stop for a code, "unknown status" for any other; never null. The text
 * lives for ever and is for people only: programs compare numbers. Codes of ports answer "unknown status" here; their
 * headers say what they mean. */
const char *aeo_status_text(aeo_status_t status);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
