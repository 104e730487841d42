/* lattice.h: estimates a VARX or VARMAX predictor with several outputs from one sample a time, at a cost linear in p.
 *
 * MODEL
 *   y_k = theta z_k + e_k,   z_k = [ b_{k-p}; ...; b_{k-1}; u_k ] as regressor.h makes it, minimises over theta (l x n)
 *       sum_{i<=k} lambda^{k-i} |y_i - theta z_i|^2 + lambda^{k+1} rho sum_j pi_j |theta_j|^2,
 *       pi_j = lambda^{-i} for the columns of b_{k-1-i}, 1 for those of u_k: the weights that a shift allows
 *   Houtzager, "Markov Parameter Estimation using Least Squares Lattice Recursions", 2009, after Friedlander, "Lattice
 *   Filters for Adaptive Processing", 1982. Of the note: the forward errors f_j of x_k = b_{k-1} and the backward
 *   errors r_j of b_{k-1-j} are both of all m channels (its 0 1 in front of z_k does not close (13) and (16)), outputs
 *   are regressed on r_0 ... r_{p-1} (joint process), the present inputs u_k too, and y on what is left of u_k last.
 *   Stage j, errors a priori, P the inverse of the covariance named below it:
 *       f_{j+1}(k) = f_j(k) - Kf_j r_j(k-1),   Kf_j += f_{j+1}(k) g_j(k-1)',   g_j = P r_j(k) / alpha_{j+1}     E^b_j
 *       r_{j+1}(k) = r_j(k-1) - Kb_j f_j(k),   Kb_j += r_{j+1}(k) h_j',        h_j = P f_j(k) / alpha^f         E^f_j
 *       t_{j+1}(k) = t_j(k) - kappa_j r_j(k),  kappa_j += t_{j+1}(k) g_j(k)',  t_0 = [y_k; u_k]
 *       alpha_0 = lambda, alpha_{j+1}(k) = alpha_j(k) + r_j'P r_j, alpha^f = alpha_j(k-1) + f_j'P f_j
 *   Each is a small least-squares recursion with P = L D L' updated as Bierman's: nothing is inverted, P cannot lose
 *   its sign, and weights are corrected by the error they leave. theta is worked out when asked for, by the Levinson
 *   recursion (20) made exact: B_j(k-1) = B_j(k) + r_j(k) G_j(k)', G_{j+1} = G_j + B_j' g_j, for the predictors A_j,
 *   B_j of all orders. Deviations from the sum, the gate and the bound being off when lambda = 1:
 *   1 gate: after a sample with z'Pz < excitation_min (1 - lambda) n the next one is followed, not absorbed: every
 *     weight and covariance stays. So a quiet turbine forgets nothing; the sample that ends the quiet is lost.
 *   2 bound: when a variance of P passes growth_max / rho it is quartered, as in rls.h, with all weights left alone.
 *   3 new window: when z is not the z before moved by one block (a gap), weights stay until the p - 1 samples that
 *     follow have filled the stages, and innovations come from as many orders as are filled; then absorbing goes on.
 *     The sums of different orders then differ by a row at each edge: an error of about n^(1/2) / memory of the signal,
 *     forgotten as all else is.
 *   4 start: the blocks before the first z count as 0. When that z shows they were not, the error of it is swamped:
 *     after 4 n samples the covariances start anew at rho while all weights stay. The same after a runaway. With lambda
 *     = 1 the mark of the start fades as 1 / samples only; a turbine's predictions lose 0.1 % after 10,000 (p = 10,
 *     30).
 *   5 release: as in rls.h. When watch.h finds that the covariances hold far more than the data of late bring, as after a
 *     fault of a sensor, they start anew at rho while all weights stay.
 *   Rivals of this form: docs/decisions/filters.md. Float innovations of a turbine's loop with 1 % noise, lambda from
 *   0.98 to 1, lie 2e-5 to 1.3e-4 from the double ones, theta 3e-5 to 5e-5 (20,000 samples); where outputs are singular
 *   to rounding, 10^7 samples leave the innovations as they were.
 *
 * CONTRACT
 *   Memory: AEO_LATTICE_WORDS(p, m, d, l) words of aeo_real_t from the caller, linear in p.
 *   p=10, m=5, d=0, l=3: 1,637 words (6.5 kB in float); p=50: 8,317 words (33.3 kB).
 *   Operations: 7 m^2 + 2 m (l + d) multiplications and as many additions, 4 m divisions a stage, of which there are p;
 *   n comparisons. A read-out takes p^2 m^2 (m + l / 2). Worst stack: 208 bytes.
 *   Determinism: no branch depends on anything but the data; the same calls give the same bits in the same build.
 *   Threads and interrupts: one context at a time may touch one object; different objects are independent. A read-out
 *   may be long: a task of low priority copies the filter (aeo_lattice_copy, one memcpy) between two updates and reads
 *   from the copy at leisure, or in slices (aeo_lattice_read_next).
 *   Long runs: 10^7 samples of a turbine in float, singular to rounding, lambda = 0.99, 0.999, 0.99999 and 1 with
 *   growth_max = 10 and rho = 0.1: innovations of the last fifth as those of the first to 1e-3, theta below 14.
 */
#ifndef AEOLID_LATTICE_H
#define AEOLID_LATTICE_H

#include "aeolid/config.h"
#include "aeolid/status.h"
#include "aeolid/watch.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_lattice_init            aeo_lattice_init_f64
#define aeo_lattice_update          aeo_lattice_update_f64
#define aeo_lattice_read            aeo_lattice_read_f64
#define aeo_lattice_read_next       aeo_lattice_read_next_f64
#define aeo_lattice_copy            aeo_lattice_copy_f64
#define aeo_lattice_innovation      aeo_lattice_innovation_f64
#define aeo_lattice_residual        aeo_lattice_residual_f64
#define aeo_lattice_health          aeo_lattice_health_f64
#define aeo_lattice_clear_health    aeo_lattice_clear_health_f64
#define aeo_lattice_reset           aeo_lattice_reset_f64
#define aeo_lattice_save            aeo_lattice_save_f64
#define aeo_lattice_restore         aeo_lattice_restore_f64
#define aeo_lattice_invariants_hold aeo_lattice_invariants_hold_f64
#endif

/* Sizes accepted by init: p m + d at most the first, m the second, l the third. */
#define AEO_LATTICE_REGRESSORS_MAX 1024
#define AEO_LATTICE_BLOCK_MAX      96
#define AEO_LATTICE_OUTPUTS_MAX    32

/* Words that are the filter's state, words of memory (state, scratch of an update, scratch of a read-out), and words of
 * a saved filter, for p blocks of m entries, d present inputs and l outputs. */
#define AEO_LATTICE_TRIANGLE(m) ((size_t)(m) * ((size_t)(m) + 1u) / 2u)
#define AEO_LATTICE_STATE(p, m, d, l)                                                                                  \
    ((size_t)(p) *                                                                                                     \
         (2u * AEO_LATTICE_TRIANGLE(m) + (size_t)(m) * (2u * (size_t)(m) + (size_t)(l) + (size_t)(d) + 3u) + 2u) +     \
     AEO_LATTICE_TRIANGLE(d) + (size_t)(l) * (size_t)(d) + 2u * (size_t)(l) + AEO_WATCH_WORDS(l) -                     \
     AEO_LATTICE_TRIANGLE(m) - 2u * (size_t)(m) * (size_t)(m))
#define AEO_LATTICE_WORDS(p, m, d, l)                                                                                  \
    (AEO_LATTICE_STATE(p, m, d, l) + 3u * (size_t)(m) + (size_t)(l) + (size_t)(d) +                                    \
     (size_t)(p) * (2u * (size_t)(m) * (size_t)(m) + (size_t)(m)))
#define AEO_LATTICE_SAVED_HEAD              48u
#define AEO_LATTICE_SAVED_WORDS(p, m, d, l) (AEO_LATTICE_SAVED_HEAD + AEO_LATTICE_STATE(p, m, d, l) + AEO_SAVED_SEAL)

/* Version of the saved array. */
#define AEO_LATTICE_SAVED_VERSION 2

/* Health flags; once set they stay until aeo_lattice_clear_health. */
#define AEO_LATTICE_WITHHELD      1u   /* a sample was followed, not absorbed: the one before carried almost no news */
#define AEO_LATTICE_BOUNDED       2u   /* a variance met its bound: some direction is not excited */
#define AEO_LATTICE_REINITIALISED 4u   /* an error ran away (beyond 1e10); the estimator started afresh */
#define AEO_LATTICE_RESTARTED     16u  /* z was not the z before moved by one block */
#define AEO_LATTICE_RELEASED      128u /* covariances held too much for good data to count, as a fault leaves them */

typedef struct {
    uint16_t past;         /* p, blocks in z, 1 ...; regressor.h says how to choose it */
    uint16_t block;        /* m, entries of a block, 1 ... 96; p m + d <= 1024 */
    uint16_t present;      /* d, present inputs at the end of z, 0 ... m */
    uint16_t outputs;      /* l, 1 ... 32 */
    aeo_real_t forgetting; /* lambda, 0.5 ... 1, lambda^{p-1} >= 1e-6; memory is 1 / (1 - lambda) samples. Too small:
                                  noisy parameters; too large: slow to follow. Start: 1, or 1 - 1 / (10 n) */
    aeo_real_t regularisation; /* rho, 1e-8 ... 1e8: as if rho samples of size 1 with output 0 had been seen in each
                                  direction. Too small: in float, directions the data leave open fill with rounding
                                  noise; too large: bias. Start: 0.1 with scaled channels */
    aeo_real_t excitation_min; /* gate, 0 ... 1; 0: off. Too small: noise counts as excitation; too large: learning
                                  stops in normal operation. Start: 0.05 */
    aeo_real_t growth_max; /* bound on the variances relative to 1 / rho, 4 ... 1e6 and growth_max / rho <= 1e10. Too
                                  small: bias where prediction errors are below (rho / growth_max (1 - lambda))^(1/2);
                                  too large: parameters the data leave open drift. Start: 10 */
} aeo_lattice_config_t;

/* Counters never decrease; at 4,294,967,295 they stay. */
typedef struct {
    uint32_t updates;       /* samples accepted */
    uint32_t rejected;      /* updates refused with AEO_E_NOT_FINITE or AEO_E_RANGE */
    uint32_t withheld;      /* samples followed because of the gate */
    uint32_t bounded;       /* variances bounded */
    uint32_t reinitialised; /* fresh starts forced by a runaway error */
    uint32_t restarted;     /* new windows */
    uint32_t released;      /* times the covariances started anew because good data hardly counted */
} aeo_lattice_count_t;

/* Private: one of the small regressions of an update, of targets (count of them) on an error r (m entries). */
typedef struct {
    aeo_real_t *factor, *weight;
    const aeo_real_t *r;
    aeo_real_t *targets;
    aeo_real_t *gain; /* written: P r, or anything when r is only followed */
    aeo_real_t alpha; /* inverse of the weight of r, before and after the news of r itself */
    aeo_real_t step;  /* 1 / alpha, 0 when r is only followed */
    size_t m, count;
} aeo_lattice_regression_t;

/* Private but for reading. Pointers lead into the caller's memory; arrays of p or p - 1 stages, one after the other.
 * From factor to watched all is state, the rest scratch. */
typedef struct {
    aeo_lattice_config_t config;
    aeo_real_t
        *factor; /* 2 p - 1 triangles of m, each L D L' by columns with D in the diagonal, above 0: of (E^b_j)^{-1},
                                    then of (E^f_j)^{-1} */
    aeo_real_t *present_factor;  /* triangle of d: of the inverse covariance of u_k less its prediction */
    aeo_real_t *present_weight;  /* l x d by columns */
    aeo_real_t *target_weight;   /* p times (l + d) x m by columns: kappa_j */
    aeo_real_t *forward_weight;  /* p - 1 times m x m by columns: Kf_j */
    aeo_real_t *backward_weight; /* p - 1 times m x m by columns: Kb_j */
    aeo_real_t *window;          /* p m: the last z without its present inputs */
    aeo_real_t *error;           /* p times m: r_j of the last sample, going round */
    aeo_real_t *gain;            /* p times m: P r_j of the last sample */
    aeo_real_t *alpha;           /* p: alpha_j of the last sample */
    aeo_real_t *step;            /* p: 1 / alpha_{j+1} of the last sample, 0 where it was followed */
    aeo_real_t *innovation;      /* l */
    aeo_real_t *residual;        /* l */
    aeo_real_t *watched;         /* 2 l + 2: words of the watch */
    aeo_real_t *forward;         /* m: f_j of this sample */
    aeo_real_t *targets;         /* l + d: what is left of y and u */
    aeo_real_t *spare;           /* 2 m */
    aeo_real_t *reading;         /* p (2 m^2 + m): predictors of the order a read-out has come to */
    aeo_lattice_regression_t on; /* the regression at hand */
    aeo_real_t news;             /* lambda + z'Pz of the last sample */
    aeo_real_t inverse_forgetting;
    aeo_real_t gate;         /* excitation_min (1 - lambda) n */
    aeo_real_t variance_max; /* growth_max / rho */
    uint16_t read_order;     /* stages a read-out in slices has behind it */
    uint16_t scan_step;      /* variances checked a sample: all within the time in which P can double */
    uint32_t following;      /* 1 when the last sample was followed, not absorbed */
    uint32_t health;         /* from here on saved, word by word */
    aeo_lattice_count_t count;
    uint32_t orders;   /* stages filled since the window began, at most p */
    uint32_t learning; /* samples until the covariances start anew; 0: done */
    uint32_t head;     /* place of r_0 in error; r_j is j places further round */
    uint32_t scan;     /* variance to be checked next: of the triangles one after the other */
    uint32_t begun;    /* 1 after the first sample */
    uint32_t quiet;    /* 1 when the last sample lay below the gate */
    aeo_watch_t watch;
} aeo_lattice_t;

/* Start self with theta = 0 in the memory given (words values, written, aligned as the type). The config is copied.
 * Memory must outlive self and serve nothing else.
 * AEO_E_ARG: null pointer, or a size or setting out of its range; AEO_E_NOT_FINITE: a setting is NaN or infinite;
 * AEO_E_MEMORY: words < AEO_LATTICE_WORDS(p, m, d, l). On failure neither self nor memory is written. */
aeo_status_t aeo_lattice_init(aeo_lattice_t *self, const aeo_lattice_config_t *config, aeo_real_t *memory,
                              size_t words);

/* Absorb one sample: z (p m + d values, read) and y (l values, read), scaled; neither may lie in self's memory.
 * AEO_OK: innovation and residual are those of this sample. AEO_E_NOT_FINITE, AEO_E_RANGE (a value beyond 1e6): nothing
 * changed but count.rejected. AEO_E_ARG: null pointer, nothing changed. */
aeo_status_t aeo_lattice_update(aeo_lattice_t *self, const aeo_real_t *z, const aeo_real_t *y);

/* Work out theta, l x n by rows, scaled units (markov.h undoes the scales), into theta (length values, written), in one
 * go. Only scratch of self is written. AEO_E_ARG: null pointer; AEO_E_MEMORY: length < l n; neither writes theta.
 * AEO_E_RANGE: a parameter is no finite number, which weights from samples of some 1e6 may lead to. */
aeo_status_t aeo_lattice_read(aeo_lattice_t *self, aeo_real_t *theta, size_t length);

/* Do one stage of a read-out, at most 2 p m^2 (m + l / 2) operations; the same theta and length each time, p calls in
 * all. AEO_FILLING: call again, theta is not done; otherwise as aeo_lattice_read. An update or aeo_lattice_read between
 * two calls makes the next one the first again: what is read never mixes two samples. */
aeo_status_t aeo_lattice_read_next(aeo_lattice_t *self, aeo_real_t *theta, size_t length);

/* Make copy a filter of its own in memory (words values, written), with the state of self at this sample: for read-outs
 * that take their time while self goes on. AEO_E_ARG: null pointer, or copy is self; AEO_E_MEMORY: words <
 * AEO_LATTICE_WORDS(p, m, d, l). On failure neither copy nor memory is written. */
aeo_status_t aeo_lattice_copy(const aeo_lattice_t *self, aeo_lattice_t *copy, aeo_real_t *memory, size_t words);

/* Return the a priori innovation y_k - theta_{k-1} z_k, l values; zeros before the first update. */
const aeo_real_t *aeo_lattice_innovation(const aeo_lattice_t *self);

/* Return the a posteriori residual y_k - theta_k z_k, l values, the innovation when the sample was only followed; zeros
 * before the first update. */
const aeo_real_t *aeo_lattice_residual(const aeo_lattice_t *self);

/* Return the sticky health flags, 0 when all is well; the counters are in self->count. Null answers 0. */
uint32_t aeo_lattice_health(const aeo_lattice_t *self);

/* Lower all health flags; the counters stay. Null is ignored. */
void aeo_lattice_clear_health(aeo_lattice_t *self);

/* Start afresh as after init: weights, covariances, errors, window; health and counters stay. Null is ignored. */
void aeo_lattice_reset(aeo_lattice_t *self);

/* Write everything needed to go on later into saved (length values, written; must not lie in self's memory).
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_LATTICE_SAVED_WORDS(p, m, d, l). On failure saved is not
 * written. */
aeo_status_t aeo_lattice_save(const aeo_lattice_t *self, aeo_real_t *saved, size_t length);

/* Go on where saved (length values, read) was written; self was initialised with the same sizes and settings. The next
 * update gives the same bits as the saved filter's would have.
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_LATTICE_SAVED_WORDS(p, m, d, l); AEO_E_VERSION: another format
 * version; AEO_E_MISMATCH: other sizes, settings or precision; AEO_E_NOT_FINITE, AEO_E_DAMAGED: the numbers cannot come
 * from a filter. On failure self is unchanged. */
aeo_status_t aeo_lattice_restore(aeo_lattice_t *self, const aeo_real_t *saved, size_t length);

/* Return 1 when every number is finite, every diagonal is above 0, every variance is at most four times its bound,
 * every alpha at least 1/2 and the sizes agree, else 0; for tests and debugging. A null pointer answers 0. */
int aeo_lattice_invariants_hold(const aeo_lattice_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
