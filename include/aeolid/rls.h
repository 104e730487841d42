/* rls.h: estimates the parameters of a linear predictor with several outputs from one regressor and outputs a sample.
 *
 * MODEL
 *   y_k = theta z_k + e_k minimises, over theta (l x n),
 *       sum_{i<=k} lambda^{k-i} |y_i - theta z_i|^2 + lambda^{k+1} rho |theta|_F^2,   P_{-1} = I / rho, theta_{-1} = 0
 *   Houtzager, van Wingerden, Verhaegen, "VARMAX-based closed-loop subspace model identification", 2009, section II-E,
 *   eq. (24), whose rho^2 Pi is our rho I. The recursion there,
 *       g_k = P_{k-1} z_k / (lambda + z_k' P_{k-1} z_k),   eps_k = y_k - theta_{k-1} z_k,
 *       theta_k = theta_{k-1} + eps_k g_k',                P_k = (P_{k-1} - g_k z_k' P_{k-1}) / lambda,
 *   is carried out on the lower triangular factor S of P = S S' by n plane rotations (inverse QR, array form):
 *       [ lambda^(1/2)  z'S ]          [ a^(1/2)      0    ]
 *       [      0         S  ]  Theta = [ g a^(1/2)  S_new lambda^(1/2) ],   a = lambda + z'Pz,
 *   so P cannot lose symmetry or sign; all outputs share S. Deviations, all off when lambda = 1:
 *   1 excitation gate: a sample with z'Pz < excitation_min (1 - lambda) n carries almost no news and is absorbed with
 *     lambda = 1 (steady excitation gives z'Pz = (1 - lambda) n on average): a quiet turbine does not forget.
 *   2 bound: when a parameter's variance P_ii exceeds growth_max / rho, its present value is absorbed as if it had been
 *     measured, which halves P_ii twice and leaves theta as it is: directions never excited cannot wind up while the
 *     excited ones go on forgetting.
 *   3 release: what follows numbers a hundred times too large looks quiet, too, and would not be learnt from for good;
 *     numbers 1e6 times too large outweigh good data for 30 memories even without the gate. When watch.h finds that P
 *     is too small for data that are as lively as usual, P = I / rho anew, theta stays. The ranges of regressor.h keep
 *     such numbers out in the first place.
 *   Why this form: on four closed-loop turbine recordings (regressors singular to rounding, n = 50 and 150, 10,000
 *   samples, lambda = 1) the float result lies at most 4e-5 (rho = 1), 2e-4 (0.1), 3e-3 (0.01) from the double batch
 *   solution, its predictions at most 2e-5 at any of them; docs/decisions/filters.md has the rivals.
 *
 * CONTRACT
 *   Memory: AEO_RLS_WORDS(n, l) words of aeo_real_t from the caller: 8 s (n + 4 - 4 s) + n l
 *   + 24 s + 4 l + 3, with s = n / 8 rounded up. n=44, l=4: 1,491 words (6.0 kB in float); n=124, l=4: 9,091 words
 *   (36.4 kB). Memory on a multiple of 32 bytes is the fastest where the processor has vectors.
 *   Operations: 5/2 n^2 + 4 l n + O(n) multiplications and additions and n square roots and 2 n divisions a sample; a
 *   sample that meets the bound costs up to 3/2 n^2 more for each variance bounded. Worst stack: 200 bytes.
 *   Determinism: no branch depends on anything but the data; the same calls give the same bits in every build
 *   that keeps to IEEE 754 (-ffp-contract=off, no -ffast-math), with vectors or without (AEO_NO_VECTORS).
 *   Threads and interrupts: one context at a time may touch one object; different objects are independent. Read-outs
 *   between two updates are consistent.
 *   Long runs: in float the gain cannot fall below rounding, about 1e7 samples of memory; and where channels are
 *   exactly collinear, P must not span more than 1e7: keep memory / rho below 1e6 samples, lambda <= 0.99999 with rho =
 *   0.1 (3e7 samples stay sound), lambda = 1 up to 1e5 samples. Double has no such limit in practice.
 */
#ifndef AEOLID_RLS_H
#define AEOLID_RLS_H

#include "aeolid/config.h"
#include "aeolid/status.h"
#include "aeolid/watch.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_rls_init            aeo_rls_init_f64
#define aeo_rls_update          aeo_rls_update_f64
#define aeo_rls_theta           aeo_rls_theta_f64
#define aeo_rls_read            aeo_rls_read_f64
#define aeo_rls_innovation      aeo_rls_innovation_f64
#define aeo_rls_residual        aeo_rls_residual_f64
#define aeo_rls_health          aeo_rls_health_f64
#define aeo_rls_clear_health    aeo_rls_clear_health_f64
#define aeo_rls_reset           aeo_rls_reset_f64
#define aeo_rls_start           aeo_rls_start_f64
#define aeo_rls_set_forgetting  aeo_rls_set_forgetting_f64
#define aeo_rls_save            aeo_rls_save_f64
#define aeo_rls_restore         aeo_rls_restore_f64
#define aeo_rls_invariants_hold aeo_rls_invariants_hold_f64
#endif

/* Sizes accepted by init. */
#define AEO_RLS_REGRESSORS_MAX 1024
#define AEO_RLS_OUTPUTS_MAX    32

/* S lies in strips of so many rows, filled up with zeros at the front: words of S and of scratch for n regressors. */
#define AEO_RLS_STRIP           8u
#define AEO_RLS_STRIPS(n)       (((size_t)(n) + AEO_RLS_STRIP - 1u) / AEO_RLS_STRIP)
#define AEO_RLS_FACTOR_WORDS(n) (AEO_RLS_STRIP * AEO_RLS_STRIPS(n) * ((size_t)(n) + 4u - 4u * AEO_RLS_STRIPS(n)))
#define AEO_RLS_WORK_WORDS(n)   (3u * AEO_RLS_STRIP * AEO_RLS_STRIPS(n) + 1u)

/* Words that are the filter's state, words of memory, and words of a saved filter, for n regressors and l outputs. */
#define AEO_RLS_KEPT_WORDS(n, l)                                                                                       \
    (AEO_RLS_FACTOR_WORDS(n) + (size_t)(n) * (size_t)(l) + 2u * (size_t)(l) + AEO_WATCH_WORDS(l))
#define AEO_RLS_WORDS(n, l)       (AEO_RLS_KEPT_WORDS(n, l) + AEO_RLS_WORK_WORDS(n))
#define AEO_RLS_SAVED_HEAD        34u
#define AEO_RLS_SAVED_WORDS(n, l) (AEO_RLS_SAVED_HEAD + AEO_RLS_KEPT_WORDS(n, l) + AEO_SAVED_SEAL)

/* Version of the saved array. */
#define AEO_RLS_SAVED_VERSION 3

/* Health flags; once set they stay until aeo_rls_clear_health. */
#define AEO_RLS_WITHHELD      1u   /* forgetting was withheld: a sample carried almost no news */
#define AEO_RLS_BOUNDED       2u   /* a variance met its bound: some direction is not excited */
#define AEO_RLS_REINITIALISED 4u   /* theta ran away (innovation beyond 1e12); the estimator started afresh */
#define AEO_RLS_RELEASED      128u /* P was too small for good data, as a fault leaves it; it started anew, theta stays */

typedef struct {
    uint16_t regressors;   /* n, 1 ... 1024 */
    uint16_t outputs;      /* l, 1 ... 32 */
    aeo_real_t forgetting; /* lambda, 0.5 ... 1; memory is 1 / (1 - lambda) samples. Too small: noisy parameters; too
                                  large: slow to follow. Start: 1, or 1 - 1 / (10 n) to follow changes */
    aeo_real_t regularisation; /* rho, 1e-8 ... 1e8: as if rho samples of size 1 with output 0 had been seen in each
                                  direction. Too small: in float, directions the data leave open fill with rounding
                                  noise (below 0.01); too large: bias. Start: 0.1 with scaled channels */
    aeo_real_t excitation_min; /* gate, 0 ... 1; 0: off. Too small: noise counts as excitation; too large: forgetting
                                  stops in normal operation. Start: 0.05 */
    aeo_real_t growth_max;     /* bound on P_ii relative to 1 / rho, 4 ... 1e6 and growth_max / rho <= 1e10. Too small:
                                  holds on to old values; too large: parameters the data leave open drift. Start: 10 */
} aeo_rls_config_t;

/* Counters never decrease; at 4,294,967,295 they stay. */
typedef struct {
    uint32_t updates;       /* samples absorbed */
    uint32_t rejected;      /* updates refused with AEO_E_NOT_FINITE or AEO_E_RANGE */
    uint32_t withheld;      /* samples absorbed without forgetting by the gate */
    uint32_t bounded;       /* variances bounded */
    uint32_t reinitialised; /* fresh starts forced by a runaway parameter */
    uint32_t released;      /* times P started anew because it was too small for good data */
} aeo_rls_count_t;

/* Private but for reading. Pointers lead into the caller's memory. */
typedef struct {
    aeo_real_t *factor;     /* AEO_RLS_FACTOR_WORDS(n): S in strips of 8 rows, each by columns; diagonal above 0 */
    aeo_real_t *theta;      /* l x n by rows */
    aeo_real_t *innovation; /* l */
    aeo_real_t *residual;   /* l */
    aeo_real_t *watched;    /* 2 l + 2: words of the watch; all up to here is saved, the rest scratch */
    aeo_real_t *work;       /* AEO_RLS_WORK_WORDS(n): S'z_k, g_k, turns */
    aeo_real_t inverse_root_forgetting;
    aeo_real_t gate;         /* excitation_min (1 - lambda) n */
    aeo_real_t variance_max; /* growth_max / rho */
    aeo_rls_config_t config;
    uint32_t scan_step; /* variances checked a sample: all within the time in which P can double */
    uint32_t health;    /* from here on saved, number by number */
    aeo_rls_count_t count;
    uint32_t scan_row; /* next variance to be checked */
    aeo_watch_t watch;
} aeo_rls_t;

/* Start self with theta = 0 and P = I / rho in the memory given (words values, written, aligned as the type). The
 * config is copied. Memory must outlive self and serve nothing else.
 * AEO_E_ARG: null pointer, or a size or setting out of its range; AEO_E_NOT_FINITE: a setting is NaN or infinite;
 * AEO_E_MEMORY: words < AEO_RLS_WORDS(n, l). On failure neither self nor memory is written. */
aeo_status_t aeo_rls_init(aeo_rls_t *self, const aeo_rls_config_t *config, aeo_real_t *memory, size_t words);

/* Absorb one sample: z (n values, read) and y (l values, read), scaled; neither may lie in self's memory.
 * AEO_OK: theta, innovation and residual are those of this sample. AEO_E_NOT_FINITE, AEO_E_RANGE (a value beyond 1e6):
 * nothing changed but count.rejected. AEO_E_ARG: null pointer, nothing changed. */
aeo_status_t aeo_rls_update(aeo_rls_t *self, const aeo_real_t *z, const aeo_real_t *y);

/* Return theta, l x n by rows, scaled units (markov.h undoes the scales); valid until the next update. */
const aeo_real_t *aeo_rls_theta(const aeo_rls_t *self);

/* Copy theta, l x n by rows, into theta (length values, written): the snapshot of this sample, whatever follows.
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < l n. On failure theta is not written. */
aeo_status_t aeo_rls_read(const aeo_rls_t *self, aeo_real_t *theta, size_t length);

/* Return the a priori innovation eps_k = y_k - theta_{k-1} z_k, l values; zeros before the first update. */
const aeo_real_t *aeo_rls_innovation(const aeo_rls_t *self);

/* Return the a posteriori residual e_k = y_k - theta_k z_k, l values; zeros before the first update. */
const aeo_real_t *aeo_rls_residual(const aeo_rls_t *self);

/* Return the sticky health flags, 0 when all is well; the counters are in self->count. Null answers 0. */
uint32_t aeo_rls_health(const aeo_rls_t *self);

/* Lower all health flags; the counters stay. Null is ignored. */
void aeo_rls_clear_health(aeo_rls_t *self);

/* Start afresh as after init: theta, P, innovations, scan; health and counters stay. Null is ignored. */
void aeo_rls_reset(aeo_rls_t *self);

/* Take theta (l x n by rows, read; may be self's own) as what is known and P = I / rho as how well: as after init, but
 * towards theta instead of 0. Innovation, residual, health and counters stay. Entries beyond 1e6 are refused.
 * AEO_E_ARG: null pointer; AEO_E_NOT_FINITE, AEO_E_RANGE: an entry of theta. On failure self is unchanged. */
aeo_status_t aeo_rls_start(aeo_rls_t *self, const aeo_real_t *theta);

/* Set lambda (0.5 ... 1) from the next sample on, for forgetting schedules; config.forgetting holds it. O(n).
 * AEO_E_ARG: null pointer or out of range; AEO_E_NOT_FINITE: not a number. On failure self is unchanged. */
aeo_status_t aeo_rls_set_forgetting(aeo_rls_t *self, aeo_real_t lambda);

/* Write everything needed to go on later into saved (length values, written; must not lie in self's memory).
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_RLS_SAVED_WORDS(n, l). On failure saved is not written. */
aeo_status_t aeo_rls_save(const aeo_rls_t *self, aeo_real_t *saved, size_t length);

/* Go on where saved (length values, read) was written; self was initialised with the same sizes and settings, and has
 * the same lambda where aeo_rls_set_forgetting changed it. The next update gives the same bits as the saved filter's
 * would have.
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_RLS_SAVED_WORDS(n, l); AEO_E_VERSION: another format version;
 * AEO_E_MISMATCH: other sizes, settings or precision; AEO_E_NOT_FINITE, AEO_E_DAMAGED: the numbers cannot come from a
 * filter. On failure self is unchanged. */
aeo_status_t aeo_rls_restore(aeo_rls_t *self, const aeo_real_t *saved, size_t length);

/* Return 1 when every number but scratch is finite, the factor's diagonal is above 0, every variance is at most four times
 * its bound and the sizes agree, else 0; O(n^2), for tests and debugging. A null pointer answers 0. */
int aeo_rls_invariants_hold(const aeo_rls_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
