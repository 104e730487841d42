/* announce.h: says in the simulator's own output what the wrapper does: one line at the first call, one at the last.
 *
 * CONTRACT
 *   Standard output, flushed, a line of at most ANNOUNCE_MAX characters; nothing is allocated. What is wrong goes to
 *   standard error instead.
 */
#ifndef AEOLID_DISCON_ANNOUNCE_H
#define AEOLID_DISCON_ANNOUNCE_H

#include "observer.h"

#define ANNOUNCE_MAX 2048u

/* What is tapped, at which rate, the filter and its size, the excitation, where the frames go. */
void announce_start(const observer_t *observer);

/* Samples, frames and snapshots so far, and what was lost. whole 0: no last call came, the stream has no end. */
void announce_end(const observer_t *observer, int whole);

#endif
/* SPDX-License-Identifier: MIT */
