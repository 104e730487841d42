/* els.h: estimates a VARMAX predictor with several outputs from one sample a time, by extended least squares.
 *
 * MODEL
 *   y_k = theta z_k + e_k,   z_k = [ b_{k-p}; ...; b_{k-1}; u_k ],   b_i = [ u_i; y_i; e_i ]
 *   Houtzager, van Wingerden, Verhaegen, "VARMAX-based closed-loop subspace model identification", 2009, eq. (12) to
 *   (14) and section II-E, eq. (24): the recursion of rls.h, with the a posteriori residual e_k = y_k - theta_k z_k put
 *   into the regressors that follow. Deviations:
 *   1 square-root form (rls.h). The conventional form as printed, lambda = 0.99, loses the sign of P on the paper's
 *     turbine (three outputs, innovations of rank two); its innovations pass 1e4 standard deviations of the output.
 *   2 forgetting schedule: lambda_{k+1} = rate lambda_k + (1 - rate) lambda_end from lambda_start. Early regressors
 *     hold poor residuals and are worth forgetting; a lambda kept at 0.99 leaves parameters with noise of their own.
 *   3 start from VARX, eq. (23): for the first varx_samples the residual fed back is 0, so that the columns of e stay
 *     at 0 and the rest is a VARX estimate. Its mean innovation power, in the second half, is the guard's yardstick.
 *   4 growth guard for the positive-real condition (25), Re 1/H > 1/2. Where it fails the zeros of H pass the unit
 *     circle time and again, and the residual e = w / H, w what is left without the terms in e, bursts. It is a burst
 *     when over the last 64 samples, for one output,
 *         mean |innovation|^2 > guard_ratio * max(VARX level, usual share * mean |w|^2),
 *     the share being mean |innovation|^2 / mean |w|^2 of late: wind that makes everything livelier is none. Then the
 *     columns of e become 0, P = I / rho, the schedule starts again, and after varx_samples (twice as many each time it
 *     comes back soon, up to 64 times) feedback resumes. One sample counts four limits at most: an outlier is no burst.
 *     The same follows when rls.h releases P after a fault of a sensor, for the yardstick may be the fault's. Nor may
 *     a fault stretch the yardstick: one |w|^2 counts 1024 of its mean at most, w ten times the output or its scale;
 *     and theta beyond 100, which no scaled data have, does not stay but becomes 0.
 *   5 bounded feedback: a residual is cut at 6 times the root of that level, and always at 1e6, before it is fed back.
 *   With a short memory the H of a snapshot need not have a stable inverse: judge it before predicting with it.
 *
 * CONTRACT
 *   Memory: AEO_ELS_WORDS(n, l) words of aeo_real_t from the caller: AEO_RLS_WORDS(n, l) + 5 l.
 *   r=2, l=3, p=10 (n=80): 4,030 words (16.1 kB in float); p=30 (n=240): 31,230 words (124.9 kB).
 *   Operations: those of rls.h, p l^2 + 20 l more; n more while lambda moves, n (n + l) more at a fall-back. Worst
 *   stack: 248 bytes (restore; a step 232). Determinism, threads, interrupts: as rls.h.
 *   Feedback: aeo_els_step does all there is to a sample. Callers of aeo_els_update hand aeo_els_feedback to
 *   aeo_regressor_set_innovation before the next push; whoever forgets gets a VARX filter and AEO_ELS_UNFED. With
 *   aeo_els_update alone two gaps that lie one update apart raise it, too: the filter sees the regressors, not the calls.
 */
#ifndef AEOLID_ELS_H
#define AEOLID_ELS_H

#include "aeolid/config.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"
#include "aeolid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_els_init            aeo_els_init_f64
#define aeo_els_step            aeo_els_step_f64
#define aeo_els_update          aeo_els_update_f64
#define aeo_els_start           aeo_els_start_f64
#define aeo_els_feedback        aeo_els_feedback_f64
#define aeo_els_theta           aeo_els_theta_f64
#define aeo_els_read            aeo_els_read_f64
#define aeo_els_innovation      aeo_els_innovation_f64
#define aeo_els_residual        aeo_els_residual_f64
#define aeo_els_health          aeo_els_health_f64
#define aeo_els_clear_health    aeo_els_clear_health_f64
#define aeo_els_reset           aeo_els_reset_f64
#define aeo_els_save            aeo_els_save_f64
#define aeo_els_restore         aeo_els_restore_f64
#define aeo_els_invariants_hold aeo_els_invariants_hold_f64
#endif

/* Words of memory, and words of a saved filter, for n regressors and l outputs; of both, those beyond rls.h. */
#define AEO_ELS_OWN(l)            (5u * (size_t)(l))
#define AEO_ELS_WORDS(n, l)       (AEO_RLS_WORDS(n, l) + AEO_ELS_OWN(l))
#define AEO_ELS_SAVED_HEAD        24u
#define AEO_ELS_SAVED_WORDS(n, l) (AEO_ELS_SAVED_HEAD + AEO_ELS_OWN(l) + AEO_RLS_SAVED_WORDS(n, l) + AEO_SAVED_SEAL)

/* Version of the saved array. */
#define AEO_ELS_SAVED_VERSION 2

/* The longest VARX start accepted. */
#define AEO_ELS_VARX_SAMPLES_MAX 1000000u

/* Health flags besides those of rls.h; once set they stay until aeo_els_clear_health. */
#define AEO_ELS_FELL_BACK 8u  /* innovations grew, theta ran away or P was released: back to VARX for a while */
#define AEO_ELS_LIMITED   32u /* a residual was cut before it was fed back */
#define AEO_ELS_UNFED     64u /* twice running z did not hold the e of the update before: it is not being fed back */

typedef struct {
    uint16_t regressors; /* n = p m + d, 1 ... 1024 */
    uint16_t outputs;    /* l, 1 ... 32 */
    uint16_t past;    /* p, blocks in z; 0: z has no columns of e that the filter knows of, guard and start are off */
    uint16_t present; /* d, present inputs at the end of z */
    uint32_t varx_samples; /* VARX start, 0 ... 1,000,000; with the guard at least 16. Too small: a poor yardstick; too
                                  large: late. Start: 10 n, 1,000 at least */
    aeo_real_t forgetting; /* lambda_end, 0.5 ... 1, as in rls.h. Start: 1, or 1 - 1 / (50 n) to follow changes: with
                                  less memory the H of a snapshot often has no stable inverse */
    aeo_real_t forgetting_start; /* 0.5 ... forgetting; equal to it: no schedule. Start: 0.99 */
    aeo_real_t forgetting_rate; /* 0 ... 0.999999. Too small: early residuals are kept; too large: noise. Start: 0.99 */
    aeo_real_t regularisation;  /* rho, as in rls.h. Start: 0.1 */
    aeo_real_t excitation_min;  /* as in rls.h. Start: 0.05 */
    aeo_real_t growth_max;      /* as in rls.h. Start: 10 */
    aeo_real_t guard_ratio;     /* 1.5 ... 100, or 0: off. Too small: falls back for nothing; too large: bursts pass.
                                  Start: 4 (innovations twice as large as those of the VARX start) */
} aeo_els_config_t;

/* Counters never decrease; at 4,294,967,295 they stay. Updates and refusals are counted in rls.count. */
typedef struct {
    uint32_t fell_back; /* times the filter went back to VARX */
    uint32_t limited;   /* residuals cut before they were fed back */
    uint32_t unfed;     /* updates without the e of the one before, from the second running on */
} aeo_els_count_t;

/* Private but for reading. Pointers lead into the caller's memory. */
typedef struct {
    aeo_els_config_t config;
    aeo_real_t *feedback; /* l: what belongs into the next regressor */
    aeo_real_t *levels;   /* 4 l: what the guard remembers */
    aeo_real_t shortfall; /* lambda_end - lambda: decays to exactly 0, which lambda itself, rounded, could not reach */
    uint32_t wait;        /* samples of the last start that are VARX */
    aeo_els_count_t count;
    uint32_t health;
    uint32_t since;   /* samples since the last start */
    uint32_t backoff; /* wait = varx_samples 2^backoff */
    uint32_t missed;  /* 1: the last z did not hold the e fed back */
    aeo_rls_t rls;
} aeo_els_t;

/* Start self with theta = 0 and P = I / rho in the memory given (words values, written, aligned as the type). The
 * config is copied. Memory must outlive self and serve nothing else.
 * AEO_E_ARG: null pointer, a size or setting out of its range, sizes that do not make p blocks of at least 2 l
 * entries; AEO_E_NOT_FINITE: a setting is NaN or infinite; AEO_E_MEMORY: words < AEO_ELS_WORDS(n, l). On failure
 * neither self nor memory is written. */
aeo_status_t aeo_els_init(aeo_els_t *self, const aeo_els_config_t *config, aeo_real_t *memory, size_t words);

/* Push a sample into the regressor, absorb it once the window is full, and feed the residual back: all there is to do.
 * regressor is VARMAX with the same p, l and n; u, y and time_us as in aeo_regressor_push, whose codes it returns;
 * AEO_OK: absorbed. AEO_E_ARG: null pointer or a regressor that does not fit, nothing changed. */
aeo_status_t aeo_els_step(aeo_els_t *self, aeo_regressor_t *regressor, const aeo_real_t *u, const aeo_real_t *y,
                          uint64_t time_us);

/* Absorb one sample: z (n values, read) and y (l values, read), scaled; neither may lie in self's memory.
 * AEO_OK: theta, innovation and residual are those of this sample, and aeo_els_feedback is due. AEO_E_NOT_FINITE,
 * AEO_E_RANGE (a value beyond 1e6): nothing changed but rls.count.rejected. AEO_E_ARG: null pointer, nothing changed.
 */
aeo_status_t aeo_els_update(aeo_els_t *self, const aeo_real_t *z, const aeo_real_t *y);

/* Start from a VARX estimate, eq. (23): theta (l x n by rows, scaled, read), whose columns of e are taken as 0, and P =
 * I / rho; the VARX start, the schedule and the guard begin anew. Health and counters stay.
 * AEO_E_ARG: null pointer or past = 0; AEO_E_NOT_FINITE, AEO_E_RANGE (beyond 1e6): an entry of theta. On failure self
 * is unchanged. */
aeo_status_t aeo_els_start(aeo_els_t *self, const aeo_real_t *theta);

/* Return the e_k to hand to aeo_regressor_set_innovation, l values: the residual, cut; zeros during a VARX start. */
const aeo_real_t *aeo_els_feedback(const aeo_els_t *self);

/* Return theta, l x n by rows, scaled units (markov.h undoes the scales); valid until the next update. */
const aeo_real_t *aeo_els_theta(const aeo_els_t *self);

/* Copy theta, l x n by rows, into theta (length values, written): the snapshot of this sample, whatever follows.
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < l n. On failure theta is not written. */
aeo_status_t aeo_els_read(const aeo_els_t *self, aeo_real_t *theta, size_t length);

/* Return the a priori innovation eps_k = y_k - theta_{k-1} z_k, l values; zeros before the first update. */
const aeo_real_t *aeo_els_innovation(const aeo_els_t *self);

/* Return the a posteriori residual e_k = y_k - theta_k z_k, l values, uncut; zeros before the first update. After
 * a fall-back theta is already that of the new start and the residual still that of the old; where theta ran away, it
 * is that of the first sample of rls.h's fresh start. */
const aeo_real_t *aeo_els_residual(const aeo_els_t *self);

/* Return the sticky health flags, those of rls.h among them, 0 when all is well; the counters are in self->count and
 * self->rls.count. Null answers 0. */
uint32_t aeo_els_health(const aeo_els_t *self);

/* Lower all health flags; the counters stay. Null is ignored. */
void aeo_els_clear_health(aeo_els_t *self);

/* Start afresh as after init; health and counters stay. Null is ignored. */
void aeo_els_reset(aeo_els_t *self);

/* Write everything needed to go on later into saved (length values, written; must not lie in self's memory).
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_ELS_SAVED_WORDS(n, l). On failure saved is not written. */
aeo_status_t aeo_els_save(const aeo_els_t *self, aeo_real_t *saved, size_t length);

/* Go on where saved (length values, read) was written; self was initialised with the same sizes and settings. Codes and
 * promises as aeo_rls_restore. On failure self is unchanged. */
aeo_status_t aeo_els_restore(aeo_els_t *self, const aeo_real_t *saved, size_t length);

/* Return 1 when the invariants of rls.h hold, every number is finite, feedback is at most 1e6, powers are not negative
 * and lambda is where the schedule says, else 0; O(n^2), for tests and debugging. A null pointer answers 0. */
int aeo_els_invariants_hold(const aeo_els_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
