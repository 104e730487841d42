/* watch.h: tells a filter whose P holds far more than the data of late bring from one whose plant is quiet.
 *
 * MODEL
 *   A fault of a sensor, a hundred times the usual size for a tenth of a memory, leaves P a thousand times too small.
 *   The excitation gate of rls.h and lattice.h then finds no news in good data and withholds forgetting, which alone
 *   could cure it. z'Pz cannot tell this from a calm: multiply z and P by what leaves z'Pz as it is, and one becomes
 *   the other. So what is usual is remembered apart from P, in the outputs' steps d = y_k - y_{k-1}, which neither
 *   offsets nor slow drifts enter:
 *       level_i   that size of d_i^2 which two samples in three pass: level (1 + r) when d_i^2 > level, else
 *                 level (1 - 2 r), r = (1 - lambda) / 8; eight memories move it by a factor e at most. Where forgetting
 *                 is withheld r is 64 times less: a calm becomes usual after some 500 memories, not in a night. It
 *                 learns 64 times faster during the first two blocks, a step beyond 4 teaches it nothing, and it stays
 *                 within 1e-12 ... 1: channels are scaled. An r below 32 rounding errors, which 1 + r would lose,
 *                 moves it at one sample in 4096, drawn by their number, as 4096 r: the same law for every memory
 *   and what P may hold is bounded by
 *       held = sum lambda^{k-i} |z_i|^2 = tr P^{-1} less the regularisation, with the lambda that the filter applied.
 *   At the end of each block of one memory 1 / (1 - lambda), 16 samples at least and 2^26 at most, the filter is
 *   suspected when the outputs moved as usual, d_i^2 > level_i for a tenth of all, although
 *       forgetting was withheld for more than half of the samples, and P = I / rho would not have done that; or
 *       held > 100 mean |z|^2 / (1 - lambda): forgetting would need five memories to come back from there, and far more
 *       in directions that the data excite little.
 *   A filter suspected twice running starts P anew and keeps theta. So a fault of any size is over after sixteen memories
 *   of 1 / (1 - lambda), 16 samples at least: the innovations of every filter with lambda < 1 are then within a tenth of
 *   their size without it. More than 100 e^3 = 2,000 times what a memory of good data brings to P is released within
 *   three memories of its end; what the fault did to theta fades from then on. Less may be too little for a verdict, and
 *   fades as e^{-t} after t memories: 2,000 times as much weighs as the data after 7.6 memories and a tenth of them after
 *   10. fast_rls.h, whose arrays are lost in large faults and return with more rho, takes the longest.
 *   Own work. Rivals: docs/decisions/filters.md.
 *
 * CONTRACT
 *   Memory: AEO_WATCH_WORDS(l) = 2 l + 2 words, part of the filter's (l=1: 4; l=4: 10).
 *   Operations: 8 l + 12 a sample; the filter's |z|^2 aside. Worst stack: 48 bytes.
 *   Determinism: the same calls give the same bits. Threads and interrupts: as the filter that owns it.
 *   Limits: outputs that do not move are not good data, however lively the inputs. Data whose scales are a hundred times
 *   too small in every output make every calm look lively; P then starts anew in it, and theta is learnt from it.
 */
#ifndef AEOLID_WATCH_H
#define AEOLID_WATCH_H

#include "aeolid/config.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_watch_start  aeo_watch_start_f64
#define aeo_watch_forget aeo_watch_forget_f64
#define aeo_watch_take   aeo_watch_take_f64
#define aeo_watch_holds  aeo_watch_holds_f64
#endif

/* Words for l outputs: held, the sum of |z|^2 of this block, l levels, l outputs of the sample before. */
#define AEO_WATCH_WORDS(l) (2u * (size_t)(l) + 2u)

/* Private but for reading: the numbers of a watch, saved as they are. */
typedef struct {
    uint32_t age;       /* samples of this block */
    uint32_t moved;     /* steps of single outputs in it that passed their level */
    uint32_t withheld;  /* samples in it at which forgetting was withheld, but not with P = I / rho */
    uint32_t blocks;    /* blocks behind it, up to 2 */
    uint32_t suspected; /* 1: the block before was suspect */
} aeo_watch_t;

/* Begin with nothing known: words (AEO_WATCH_WORDS(outputs) values, written). */
void aeo_watch_start(aeo_watch_t *self, aeo_real_t *words, size_t outputs);

/* Begin a new block: P has started anew. held: |z|^2, at most 1.1e15, of a sample that was taken before and that the new
 * P absorbs nevertheless; 0 where there is none. Levels stay. */
void aeo_watch_forget(aeo_watch_t *self, aeo_real_t *words, aeo_real_t held);

/* Take the sample y (outputs values, read, at most 1e6 in size) with power = |z|^2, at most 1.1e15, that the filter has
 * absorbed with lambda (0.5 or more, below 1), or with forgetting withheld: 1, or 2 when P = I / rho would have found news
 * in it. Returns 1 when P is to start anew, which the caller then does, aeo_watch_forget included; else 0. */
int aeo_watch_take(aeo_watch_t *self, aeo_real_t *words, size_t outputs, const aeo_real_t *y, aeo_real_t power,
                   aeo_real_t lambda, int withheld);

/* Return 1 when self and words (finite) can be a watch's, else 0. */
int aeo_watch_holds(const aeo_watch_t *self, const aeo_real_t *words, size_t outputs);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
