/* root.h: the square root of config.h, ready for use; internal, not installed, so that no public header needs <math.h>. */
#ifndef AEOLID_ROOT_H
#define AEOLID_ROOT_H

#include "aeolid/config.h"

#ifdef AEO_SQRT_PLAIN
#include <math.h>
#endif

#endif
/* SPDX-License-Identifier: MIT */
