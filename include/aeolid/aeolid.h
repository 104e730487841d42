/* aeolid.h: includes the whole library, and says which version it is.
 *
 * MODEL
 *   None of its own: one line for programs that use everything. A program that uses one filter includes that header.
 *
 * CONTRACT
 *   No memory, no operations, no state. AEO_VERSION compares like a number: 0.1.0 is 100.
 */
#ifndef AEOLID_AEOLID_H
#define AEOLID_AEOLID_H

#include "aeolid/channel.h"
#include "aeolid/config.h"
#include "aeolid/count.h"
#include "aeolid/els.h"
#include "aeolid/estimator.h"
#include "aeolid/fast_rls.h"
#include "aeolid/frame.h"
#include "aeolid/lattice.h"
#include "aeolid/markov.h"
#include "aeolid/port.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"
#include "aeolid/status.h"
#include "aeolid/stream.h"
#include "aeolid/watch.h"

/* Version of the interface (semantic versioning); the wire has its own, AEO_WIRE_VERSION. */
#define AEO_VERSION_MAJOR 0
#define AEO_VERSION_MINOR 1
#define AEO_VERSION_PATCH 0
#define AEO_VERSION       (AEO_VERSION_MAJOR * 10000 + AEO_VERSION_MINOR * 100 + AEO_VERSION_PATCH)

#endif
/* SPDX-License-Identifier: MIT */
