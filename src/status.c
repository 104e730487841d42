/* status.c: the sentences of status.h. */
#include "aeolid/status.h"

const char *aeo_status_text(aeo_status_t status)
{
    switch (status) {
    case AEO_OK:
        return "done";
    case AEO_FILLING:
        return "sample taken, the past window is filling";
    case AEO_E_ARG:
        return "an argument is null, out of its range or overlaps another";
    case AEO_E_MEMORY:
        return "the array given is too short";
    case AEO_E_NOT_FINITE:
        return "a number is NaN or infinite";
    case AEO_E_RANGE:
        return "a number is outside its plausible range";
    case AEO_E_TIME:
        return "time does not advance by about one period";
    case AEO_E_GAP:
        return "samples are missing before this one, the past window starts with it";
    case AEO_E_VERSION:
        return "saved in a version of the format that is not known here";
    case AEO_E_MISMATCH:
        return "saved by a filter with other dimensions or settings";
    case AEO_E_DAMAGED:
        return "saved words or a frame are damaged";
    case AEO_E_BUSY:
        return "the snapshot before is still being sent";
    case AEO_E_BUDGET:
        return "the share of the bus is too small for what is to be sent";
    case AEO_E_REFUSED:
        return "frames of a sample were dropped";
    }
    return "unknown status";
}
/* SPDX-License-Identifier: MIT */
