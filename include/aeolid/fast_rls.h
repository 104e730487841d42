/* fast_rls.h: estimates the same linear predictor as rls.h from a sliding window, at a cost linear in its length.
 *
 * MODEL
 *   y_k = theta z_k + e_k, z_k the regressor of regressor.h: p blocks of m entries, oldest first, then the d present
 *   inputs of the feedthrough mask; n = p m + d. theta (l x n) minimises
 *       sum_{i<=k} lambda^{k-i} |y_i - theta z_i|^2 + lambda^{k+1} |theta P_{-1}^{-1/2}|_F^2,   theta_{-1} = 0,
 *   with P_{-1} = diag(lambda^{p-1}, ..., lambda, 1, 1 / lambda (the tail)) / rho by blocks.
 *   Houtzager, van Wingerden, Verhaegen, "Fast-array recursive closed-loop subspace model identification", SYSID 2009:
 *   z_k is z_{k-1} moved by one block, so P_k moved by a block less P_{k-1} has rank 2m and P itself is never formed.
 *   With v_k the m newest entries of the window w_k = z_k and x_k the block that has just left it, so that
 *   [x_k; w_k] = [w_{k-1}; v_k], and with kappa_k = P_{k-1} w_k / lambda, 1 / gamma_k = 1 + w_k' kappa_k,
 *   g_k = gamma_k kappa_k the gain of RLS:
 *       e = v_k - A w_{k-1},    f = F^{-1} e / lambda,      F <- lambda F + gamma_{k-1} e e',
 *       [t; s] = [kappa_{k-1}; 0] + [-A'f; f],              A <- A + e g_{k-1}',      (t: the m oldest entries)
 *       r = x_k - B w_k,        kappa_k = s + B't,          r <- r + c (r - lambda E t),
 *       E <- lambda E + gamma_k r r',                       B <- B + r g_k',
 *       theta_k = theta_{k-1} + (y_k - theta_{k-1} z_k) g_k'.
 *   Deviations:
 *   1 The paper rotates a generator of 2m columns by m hyperbolic and m Givens rotations. That is the same in exact
 *     arithmetic, but there rounding errors grow as lambda^{-k}: on turbine data it is lost after 25 memories
 *     1 / (1 - lambda) in double and after one in float. Here the generator is kept apart as forward predictor A and
 *     backward predictor B. Each is a least-squares estimate that forgets its own errors, as long as the gain is built
 *     from t alone, B learns from the error r it really makes, and c > 0 feeds back by how much that differs from the
 *     error lambda E t that the gain foretells (Slock and Kailath, 1991, use the same redundancy for one channel).
 *     With c = 3/4, and 0.07 / q^2 where that is less, q = n (1 - lambda), errors die out up to q = 0.2 or more;
 *     docs/decisions/filters.md has what else was tried.
 *   2 Renewal: above q = 0.2 errors may grow again, by a factor e in one to ten memories. A second array then starts
 *     afresh before the first one's life ends, and takes over once it is warm; so it does at any q when the first one's
 *     two errors disagree. theta is never touched: only the gain changes hands.
 *   3 Bound: a channel whose newest entry the past foretells so well that its variance passes growth_max / rho enters
 *     with a disturbance of +-((1 - lambda) rho / growth_max)^(1/2) of its own, so that w = z + d. A and B absorb w,
 *     which is the bound of rls.h in a form that keeps the shift; theta does not. kappa is linear in the window: the
 *     recursion for d beside that for w gives P d, and theta absorbs z, with y, and d, with 0, as two measurements:
 *         theta <- theta + (y - theta z) (P z)' / (lambda + z'P z),   theta <- theta - theta d (P d)' / (lambda + d'P d).
 *     the second for an error theta d no larger than the innovation. So noise of y does not move theta along d, where P
 *     is large (it would drift there as the root of time), what the data do not tell of theta returns to 0 within some
 *     memories, and data without noise are met to rounding. No excitation gate: with a lambda that changes, P_k
 *     and P_{k-1} are no longer shifts of each other.
 *   4 Rests: in float, what rounding cuts off the sums of A and B is kept, in the memory of the second array while that
 *     one is at rest, and added the next time. In VARMAX the window foretells the newest e but for what theta moves, and
 *     these sums made theta 20 times worse than that of rls.h in float. -ffast-math undoes it.
 *   5 Release: numbers 1e6 times too large outweigh good data for 30 memories. When watch.h finds that the arrays hold
 *     far more than the data of late bring, both start afresh, theta stays and waits as after a break.
 *   6 Start within a record: blocks before the first window are unknown, taken as zeros by the arrays, and theta waits
 *     until the window is whole, unless they are zeros. In directions that the data excite little, theta comes to that
 *     of rls.h only as the arrays forget this start (turbine data of condition 1e4: 1e-2 after 8 memories, 1e-4 after
 *     12).
 *   7 Astray: innovations whose power is above 100 times that of the outputs for two memories, more often than not, are
 *     those of a theta that is worse than none: all starts afresh (AEO_FAST_RLS_REINITIALISED).
 *
 * CONTRACT
 *   Memory: AEO_FAST_RLS_WORDS(p, m, d, l) words of aeo_real_t from the caller:
 *   n (4m + l + 8) + 3m^2 + 10m + 4l + 8.
 *   p=10, m=5, d=0, l=3: 1,695 words (6.8 kB in float); p=50, m=5, d=0, l=3: 7,895 words (31.6 kB).
 *   Operations: 6 m n + 2 l n + O(n + m^2) multiplications and additions a sample; in float 6 m n
 *   additions more for the rests; or 6 m n of both more while a second array warms up; half as many again, and 3 l n,
 *   while a disturbance is in the window. Worst stack: 228 bytes.
 *   Determinism: no branch depends on anything but the data; the same calls give the same bits in the same build.
 *   Threads and interrupts: one context at a time may touch one object; different objects are independent. Read-outs
 *   between two updates are consistent.
 */
#ifndef AEOLID_FAST_RLS_H
#define AEOLID_FAST_RLS_H

#include "aeolid/config.h"
#include "aeolid/status.h"
#include "aeolid/watch.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_fast_rls_init            aeo_fast_rls_init_f64
#define aeo_fast_rls_update          aeo_fast_rls_update_f64
#define aeo_fast_rls_theta           aeo_fast_rls_theta_f64
#define aeo_fast_rls_read            aeo_fast_rls_read_f64
#define aeo_fast_rls_innovation      aeo_fast_rls_innovation_f64
#define aeo_fast_rls_residual        aeo_fast_rls_residual_f64
#define aeo_fast_rls_health          aeo_fast_rls_health_f64
#define aeo_fast_rls_clear_health    aeo_fast_rls_clear_health_f64
#define aeo_fast_rls_reset           aeo_fast_rls_reset_f64
#define aeo_fast_rls_save            aeo_fast_rls_save_f64
#define aeo_fast_rls_restore         aeo_fast_rls_restore_f64
#define aeo_fast_rls_invariants_hold aeo_fast_rls_invariants_hold_f64
#endif

/* Sizes accepted by init. */
#define AEO_FAST_RLS_REGRESSORS_MAX 1024
#define AEO_FAST_RLS_BLOCK_MAX      96
#define AEO_FAST_RLS_OUTPUTS_MAX    32

/* Words of one array, of memory, and of a saved filter, for p blocks of m entries, d present inputs and l outputs. */
#define AEO_FAST_RLS_LENGTH(p, m, d) ((size_t)(p) * (size_t)(m) + (size_t)(d))
#define AEO_FAST_RLS_ARRAY_WORDS(p, m, d)                                                                              \
    (AEO_FAST_RLS_LENGTH(p, m, d) * (2u * (size_t)(m) + 2u) + 2u * (size_t)(m) +                                       \
     (size_t)(m) * ((size_t)(m) + 1u) / 2u + (size_t)(m) * (size_t)(m) + 3u)
#define AEO_FAST_RLS_KEPT_WORDS(p, m, d, l)                                                                            \
    (2u * AEO_FAST_RLS_ARRAY_WORDS(p, m, d) + AEO_FAST_RLS_LENGTH(p, m, d) * ((size_t)(l) + 2u) + 2u * (size_t)(m) +   \
     2u * (size_t)(l) + AEO_WATCH_WORDS(l))
#define AEO_FAST_RLS_WORDS(p, m, d, l)                                                                                 \
    (AEO_FAST_RLS_KEPT_WORDS(p, m, d, l) + 2u * AEO_FAST_RLS_LENGTH(p, m, d) + 3u * (size_t)(m))
#define AEO_FAST_RLS_SAVED_HEAD 56u
#define AEO_FAST_RLS_SAVED_WORDS(p, m, d, l)                                                                           \
    (AEO_FAST_RLS_SAVED_HEAD + AEO_FAST_RLS_KEPT_WORDS(p, m, d, l) + AEO_SAVED_SEAL)

/* Version of the saved array. */
#define AEO_FAST_RLS_SAVED_VERSION 5

/* Health flags; once set they stay until aeo_fast_rls_clear_health. Bits 2 and 4 mean what they mean in rls.h. */
#define AEO_FAST_RLS_BOUNDED       2u   /* a variance met its bound: some direction is not excited */
#define AEO_FAST_RLS_REINITIALISED 4u   /* an array lost its way or theta ran away or astray, and started afresh */
#define AEO_FAST_RLS_RESTARTED     16u  /* z was not the last one moved by a block: window and arrays started afresh */
#define AEO_FAST_RLS_RELEASED      128u /* arrays held too much for good data to count, as a fault leaves them */

typedef struct {
    uint16_t past;        /* p, blocks in z, 1 ... 1024; p m + d at most 1024 */
    uint16_t block;       /* m, entries of a block, 1 ... 96: r + l for VARX, r + 2 l for VARMAX */
    uint16_t outputs;     /* l, 1 ... 32 */
    uint32_t feedthrough; /* bit i: entry i of the present block ends z; bits below m only. As in regressor.h */
    aeo_real_t
        forgetting; /* lambda, 0.5 ... 1 and q = n (1 - lambda) at most 3: memory is 1 / (1 - lambda) samples, and
                                  with one shorter than a third of n arrays lose their way as fast as they warm up.
                                  Below 1 - 1 / (5 n) a sample costs up to twice as much (renewal); with memories
                                  shorter than n, float is only roughly the RLS of rls.h. 1 is for records up to 1e5
                                  samples. Start: 1 - 1 / (10 n) */
    aeo_real_t regularisation; /* rho, 1e-8 ... 1e8, as in rls.h, of the newest block. Too small: in float arrays lose
                                  their way at the start, and start again with 16 times as much; too large: bias.
                                  Start: 1 with scaled channels */
    aeo_real_t growth_max;     /* bound on the variance of a newest entry relative to 1 / rho, 4 ... 1e6 and
                                  growth_max / rho <= 1e10. Too small: disturbs weakly excited directions, as the e of
                                  VARMAX are; too large: float loses directions not excited at all, and renewals
                                  follow. Start: 100; for VARMAX 1000 */
} aeo_fast_rls_config_t;

/* Counters never decrease; at 4,294,967,295 they stay. */
typedef struct {
    uint32_t updates;       /* samples absorbed */
    uint32_t rejected;      /* updates refused with AEO_E_NOT_FINITE or AEO_E_RANGE */
    uint32_t bounded;       /* newest entries disturbed by the bound */
    uint32_t reinitialised; /* fresh starts forced by an array that lost its way or a theta that ran away or astray */
    uint32_t restarted;     /* windows that were no shift of the one before */
    uint32_t renewed;       /* second arrays that took over */
    uint32_t held;          /* samples at which theta waited for an array to warm up */
    uint32_t released;      /* times the arrays started afresh because good data hardly counted */
} aeo_fast_rls_count_t;

/* One array: everything that stands for P. Private but for reading. */
typedef struct {
    aeo_real_t *forward;  /* m x n by rows: A, or, at rest, what rounding cut off that of the other array */
    aeo_real_t *backward; /* m x n by rows: B, the same */
    aeo_real_t *gain;     /* n + m: kappa, then m entries of scratch */
    aeo_real_t *share;    /* n + m: what disturbances contribute to kappa, then m entries of scratch */
    aeo_real_t *factor;   /* m (m + 1) / 2: lower triangular S by columns, F^{-1} = S S'; diagonal above 0 */
    aeo_real_t *energy;   /* m x m: E */
    aeo_real_t *scalar;   /* 3: 1 / gamma; mean square disagreement of the two backward errors; mean square error */
    uint32_t age;         /* samples absorbed, 0: not running */
} aeo_fast_rls_array_t;

/* Private but for reading. Pointers lead into the caller's memory. What is read most comes first, where short
 * instructions reach it. */
typedef struct {
    uint16_t length; /* n */
    uint16_t tail;   /* d */
    aeo_fast_rls_config_t config;
    aeo_real_t *theta;      /* l x n by rows, in the order of z */
    aeo_real_t *window;     /* m + n: [x; w], channels of the mask first in each block */
    aeo_real_t *added;      /* m + n: the disturbances in the window */
    aeo_real_t *innovation; /* l */
    aeo_real_t *residual;   /* l */
    aeo_real_t *watched;    /* 2 l + 2: words of the watch */
    aeo_real_t *step;       /* n: g of an array, in the order of w, scratch */
    aeo_real_t *update;     /* n: g in the order of z, scratch */
    aeo_real_t *error;      /* 3m: e or r, f, projection, scratch */
    uint32_t life;          /* samples after which an array's follower starts; UINT32_MAX: only when needed */
    uint32_t warm;          /* samples an array absorbs before it takes over */
    uint32_t wait;          /* most samples theta waits after a break */
    uint32_t patience;      /* astray beyond this means a fresh start */
    uint32_t random;        /* state of the disturbance's signs, never 0 */
    uint32_t filled;        /* samples the window holds, up to p + 1 */
    uint32_t active;        /* which array makes the gain, 0 or 1 */
    uint32_t health;
    aeo_fast_rls_count_t count;
    uint32_t hold;      /* samples theta waits still */
    uint32_t disturbed; /* samples until no disturbance is in the window, 0: none is */
    uint32_t astray;    /* samples of innovations far above the outputs, less those of others */
    aeo_watch_t watch;
    aeo_fast_rls_array_t array[2];
    aeo_real_t inverse_root_forgetting;
    aeo_real_t regularisation; /* rho of arrays that start now: 16 times more after each one that lost its way */
    aeo_real_t feedback;       /* c */
    aeo_real_t variance_max;   /* growth_max / rho */
    aeo_real_t disturbance;
} aeo_fast_rls_t;

/* Start self with theta = 0 and the P_{-1} above in the memory given (words values, written, aligned as the type). The
 * config is copied. Memory must outlive self and serve nothing else.
 * AEO_E_ARG: null pointer, or a size or setting out of its range; AEO_E_NOT_FINITE: a setting is NaN or infinite;
 * AEO_E_MEMORY: words < AEO_FAST_RLS_WORDS(p, m, d, l). On failure neither self nor memory is written. */
aeo_status_t aeo_fast_rls_init(aeo_fast_rls_t *self, const aeo_fast_rls_config_t *config, aeo_real_t *memory,
                               size_t words);

/* Absorb one sample: z (n values, read) and y (l values, read), scaled; neither may lie in self's memory. Each z is the
 * one before moved by one block; one that is not starts window and arrays afresh (AEO_FAST_RLS_RESTARTED), keeps theta,
 * and lets it wait until the arrays have absorbed half as many samples as before the break, at most a tenth of a
 * memory and at most 4 n.
 * AEO_OK: theta, innovation and residual are those of this sample. AEO_E_NOT_FINITE, AEO_E_RANGE (a value beyond 1e6):
 * nothing changed but count.rejected. AEO_E_ARG: null pointer, nothing changed. */
aeo_status_t aeo_fast_rls_update(aeo_fast_rls_t *self, const aeo_real_t *z, const aeo_real_t *y);

/* Return theta, l x n by rows, scaled units (markov.h undoes the scales); valid until the next update. */
const aeo_real_t *aeo_fast_rls_theta(const aeo_fast_rls_t *self);

/* Copy theta, l x n by rows, into theta (length values, written): the snapshot of this sample, whatever follows.
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < l n. On failure theta is not written. */
aeo_status_t aeo_fast_rls_read(const aeo_fast_rls_t *self, aeo_real_t *theta, size_t length);

/* Return the a priori innovation eps_k = y_k - theta_{k-1} z_k, l values; zeros before the first update. */
const aeo_real_t *aeo_fast_rls_innovation(const aeo_fast_rls_t *self);

/* Return the a posteriori residual e_k = y_k - theta_k z_k, l values; zeros before the first update. */
const aeo_real_t *aeo_fast_rls_residual(const aeo_fast_rls_t *self);

/* Return the sticky health flags, 0 when all is well; the counters are in self->count. Null answers 0. */
uint32_t aeo_fast_rls_health(const aeo_fast_rls_t *self);

/* Lower all health flags; the counters stay. Null is ignored. */
void aeo_fast_rls_clear_health(aeo_fast_rls_t *self);

/* Start afresh as after init: theta, arrays, window, innovations; health and counters stay. Null is ignored. */
void aeo_fast_rls_reset(aeo_fast_rls_t *self);

/* Write everything needed to go on later into saved (length values, written; must not lie in self's memory).
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_FAST_RLS_SAVED_WORDS(p, m, d, l). On failure saved is not
 * written. */
aeo_status_t aeo_fast_rls_save(const aeo_fast_rls_t *self, aeo_real_t *saved, size_t length);

/* Go on where saved (length values, read) was written; self was initialised with the same sizes and settings. The next
 * update gives the same bits as the saved filter's would have.
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_FAST_RLS_SAVED_WORDS(p, m, d, l); AEO_E_VERSION: another format
 * version; AEO_E_MISMATCH: other sizes, settings or precision; AEO_E_NOT_FINITE, AEO_E_DAMAGED: the numbers cannot come
 * from a filter. On failure self is unchanged. */
aeo_status_t aeo_fast_rls_restore(aeo_fast_rls_t *self, const aeo_real_t *saved, size_t length);

/* Return 1 when every number is finite, those of A and B at most 1e30, the factors' diagonals above 0, 1 / gamma at
 * least 1 and the sizes agree, else 0; O(m n), for tests and debugging. A null pointer answers 0. */
int aeo_fast_rls_invariants_hold(const aeo_fast_rls_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
