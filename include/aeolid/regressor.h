/* regressor.h: turns one sample of inputs and outputs into the regressor of a VARX or VARMAX predictor.
 *
 * MODEL
 *   y_k = Xi z_k + e_k with, oldest block first and the present inputs last,
 *       z_k = [ b_{k-p}; ...; b_{k-1}; u_k ],   b_i = [u_i; y_i] (VARX) or [u_i; y_i; e_i] (VARMAX),
 *       Xi  = [ Xi_p ... Xi_1 Xi_0^u ]
 *   Houtzager, van Wingerden, Verhaegen, "VARMAX-based closed-loop subspace model identification", 2009, eq. (9) and
 *   (14). A new sample shifts z by one block of m entries; the fast array filters need exactly this order.
 *   Deviations: u_k is present only for inputs in the feedthrough mask, because in a loop whose controller has direct
 *   feedthrough the present-input terms cannot be told from noise; and every channel is scaled first,
 *       x_scaled = (x - offset) / scale,
 *   so that degrees, newton-metres and m/s^2 live in one single-precision covariance. markov.h undoes it.
 *
 * CONTRACT
 *   Memory: AEO_REGRESSOR_WORDS(r, l, p, e) words of aeo_real_t from the caller, e = 1 for VARMAX, else 0:
 *   p m + r + m + 4 (r + l) with m = r + l (1 + e). Two sizes: r=2, l=3, p=10: 77; r=2, l=3, p=30: 177.
 *   Operations: a push moves p m words and scales m; about 8 (p m + m) instructions. Worst stack: 104 bytes.
 *   Determinism: the same samples give the same bits, whatever came before the last reset or gap plus p samples.
 *   Threads and interrupts: one context at a time may touch one object; different objects are independent. z and y stay
 *   as they are between two pushes, so a reader in the pushing context needs no lock.
 *   Time: the caller gives microseconds that grow by about one period a sample. Time is how a hole is noticed: a
 *   rejected sample leaves no trace but a counter, and the next good one then arrives after a gap. Callers without a
 *   clock pass k * period_us, counting missed samples.
 *   Gap: a sample later than 1.5 periods after the last accepted one is kept as the first of a new window and answered
 *   with AEO_E_GAP; p - 1 samples answered with AEO_FILLING follow, and the one after those has a regressor again.
 *   No regressor ever mixes samples from both sides of a hole.
 */
#ifndef AEOLID_REGRESSOR_H
#define AEOLID_REGRESSOR_H

#include "aeolid/channel.h"
#include "aeolid/config.h"
#include "aeolid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_regressor_init            aeo_regressor_init_f64
#define aeo_regressor_push            aeo_regressor_push_f64
#define aeo_regressor_set_innovation  aeo_regressor_set_innovation_f64
#define aeo_regressor_z               aeo_regressor_z_f64
#define aeo_regressor_y               aeo_regressor_y_f64
#define aeo_regressor_reset           aeo_regressor_reset_f64
#define aeo_regressor_save            aeo_regressor_save_f64
#define aeo_regressor_restore         aeo_regressor_restore_f64
#define aeo_regressor_invariants_hold aeo_regressor_invariants_hold_f64
#endif

/* Limits: inputs 0 ... 32 (the mask has 32 bits), outputs 1 ... 32, p m + r at most AEO_REGRESSOR_LENGTH_MAX. */
#define AEO_REGRESSOR_CHANNELS_MAX 32
#define AEO_REGRESSOR_LENGTH_MAX   1024

/* A scaled sample beyond this is refused with AEO_E_RANGE; the overflow proofs of the filters start from it. */
#define AEO_SCALED_MAX AEO_REAL(1e6)

/* Entries of one block; entries of z with d inputs in the feedthrough mask; words of memory (for any mask). */
#define AEO_REGRESSOR_BLOCK(r, l, e)        ((size_t)(r) + (size_t)(l) * (1u + (size_t)(e)))
#define AEO_REGRESSOR_LENGTH(r, l, p, e, d) ((size_t)(p)*AEO_REGRESSOR_BLOCK(r, l, e) + (size_t)(d))
#define AEO_REGRESSOR_WORDS(r, l, p, e)                                                                                \
    (AEO_REGRESSOR_LENGTH(r, l, p, e, r) + AEO_REGRESSOR_BLOCK(r, l, e) + 4u * ((size_t)(r) + (size_t)(l)))

/* Words of a saved regressor, and the version of the saved array. */
#define AEO_REGRESSOR_SAVED_HEAD(r, l) (28u + 2u * ((size_t)(r) + (size_t)(l)))
#define AEO_REGRESSOR_SAVED_WORDS(r, l, p, e)                                                                          \
    (AEO_REGRESSOR_SAVED_HEAD(r, l) + AEO_REGRESSOR_LENGTH(r, l, p, e, r) + AEO_REGRESSOR_BLOCK(r, l, e) +             \
     AEO_SAVED_SEAL)
#define AEO_REGRESSOR_SAVED_VERSION 1

typedef enum {
    AEO_VARX = 0,  /* blocks [u; y]; consistent for long windows only: choose p until the innovation stops shrinking */
    AEO_VARMAX = 1 /* blocks [u; y; e]; short windows suffice, the filter must return e_k after each update */
} aeo_model_set_t;

typedef struct {
    uint16_t
        inputs; /* r, 0 ... 32; 0: an autoregression of the outputs alone, y_k = Xi [y_{k-p}; ...; y_{k-1}] + e_k */
    uint16_t outputs; /* l, 1 ... 32 */
    uint16_t past;    /* p, blocks in z, 1 ...; too small: biased, coloured innovation; too large: more variance
                                  and p^2 time and memory. Start: one slowest period over two, 10 ... 30 */
    aeo_model_set_t model_set; /* start: AEO_VARX */
    uint32_t feedthrough;      /* bit i: u_i of the present sample is a regressor. Start: 0. A bit set for an input that
                                  a controller with direct feedthrough computes from the present output biases the
                                  result */
    uint32_t period_us;        /* sample period, 1 ... 4,000,000,000 microseconds */
    const aeo_real_t *offset;  /* r + l values, inputs first, in the channels' units; null: all 0. Start: mean values */
    const aeo_real_t *scale;   /* r + l values above 0; null: all 1. Start: standard deviations. Scales that differ from
                                  the true size by more than 100 cost that much of the float's precision */
    const aeo_real_t *minimum; /* r + l values, plausible range in the channels' units; null: no lower end */
    const aeo_real_t *maximum; /* r + l values, not below the minimum; null: no upper end */
    const aeo_channel_t
        *channels; /* r + l channels that say all this in place of the four arrays, which are null then */
} aeo_regressor_config_t;

/* Counters never decrease; at 4,294,967,295 they stay. */
typedef struct {
    uint32_t samples;    /* accepted, those before a full window included */
    uint32_t not_finite; /* rejected with AEO_E_NOT_FINITE */
    uint32_t range;      /* rejected with AEO_E_RANGE */
    uint32_t time;       /* rejected with AEO_E_TIME */
    uint32_t gaps;       /* answered with AEO_E_GAP */
} aeo_regressor_count_t;

/* Private but for reading. Pointers lead into the caller's memory. */
typedef struct {
    aeo_real_t *z;       /* AEO_REGRESSOR_LENGTH: the regressor; valid after a push that returned AEO_OK */
    aeo_real_t *block;   /* m: the last accepted sample, scaled, not yet part of the past */
    aeo_real_t *offset;  /* r + l */
    aeo_real_t *inverse; /* r + l: 1 / scale */
    aeo_real_t *minimum; /* r + l */
    aeo_real_t *maximum; /* r + l */
    uint64_t time_us;    /* of the last accepted sample */
    uint32_t period_us;
    uint32_t feedthrough;
    uint16_t inputs, outputs, past;
    uint16_t block_length; /* m */
    uint16_t length;       /* entries of z */
    uint16_t filled;       /* blocks of the window that hold samples, 0 ... p */
    uint8_t model_set;     /* aeo_model_set_t */
    uint8_t pending;       /* 1: block holds a sample */
    aeo_regressor_count_t count;
} aeo_regressor_t;

/* Make self ready for its first sample, in the memory given (words values, written; 4- or 8-byte aligned as the type).
 * The config and its arrays are copied and may vanish afterwards. Memory must outlive self and serve nothing else.
 * AEO_E_ARG: a null pointer, a size, period, scale or range out of bounds, a mask bit at or above r, channels and arrays.
 * AEO_E_NOT_FINITE: an offset, scale or range end is NaN or infinite.
 * AEO_E_MEMORY: words < AEO_REGRESSOR_WORDS(r, l, p, e). On failure neither self nor memory is written. */
aeo_status_t aeo_regressor_init(aeo_regressor_t *self, const aeo_regressor_config_t *config, aeo_real_t *memory,
                                size_t words);

/* Take the sample u (r values, read; null when r = 0), y (l values, read), both in the channels' units, at time_us.
 * AEO_OK: z and y of this sample are ready. AEO_FILLING: accepted, the past window is not full yet.
 * AEO_E_GAP: accepted as the first sample of a new window (see above), count.gaps + 1.
 * Rejected, nothing changed but one counter: AEO_E_NOT_FINITE (judged on the bit pattern, so -ffast-math does not
 * remove it), AEO_E_RANGE (outside minimum ... maximum, or beyond AEO_SCALED_MAX once scaled), AEO_E_TIME (less than
 * half a period after the last accepted sample, or before it). When several hold, the first in this list is counted.
 * A clock that was set back is not guessed at: call aeo_regressor_reset. AEO_E_ARG: null pointer, nothing changed. */
aeo_status_t aeo_regressor_push(aeo_regressor_t *self, const aeo_real_t *u, const aeo_real_t *y, uint64_t time_us);

/* VARMAX only: give the innovation e (l scaled values, read) of the last accepted sample before the next push; without
 * it, as during filling, zeros are used. AEO_E_ARG: null pointer, VARX, no accepted sample. AEO_E_NOT_FINITE,
 * AEO_E_RANGE (beyond AEO_SCALED_MAX): the innovation is not taken. On failure nothing changes. */
aeo_status_t aeo_regressor_set_innovation(aeo_regressor_t *self, const aeo_real_t *e);

/* Return the regressor z_k, self->length scaled values, after a push that returned AEO_OK; valid until the next
 * push. */
const aeo_real_t *aeo_regressor_z(const aeo_regressor_t *self);

/* Return the outputs y_k of the last accepted sample, l scaled values; valid until the next push. */
const aeo_real_t *aeo_regressor_y(const aeo_regressor_t *self);

/* Empty the window and forget the last time, as after init; the counters stay. Null is ignored. */
void aeo_regressor_reset(aeo_regressor_t *self);

/* Write everything needed to go on later into saved (length values, written; must not lie in self's memory), at the same
 * sample as the filter: a filter whose window is not handed back with it sees a new one and waits, or starts its arrays
 * afresh. AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_REGRESSOR_SAVED_WORDS(r, l, p, e). On failure saved is not
 * written. */
aeo_status_t aeo_regressor_save(const aeo_regressor_t *self, aeo_real_t *saved, size_t length);

/* Go on where saved (length values, read) was written; self was initialised with the same sizes, period, offsets and
 * scales (plausible ranges may differ). Time goes on too: the next sample is one period after self->time_us, or later
 * after a gap; a device whose clock begins anew adds what it showed. The same pushes then give the same bits.
 * AEO_E_ARG: null pointer; AEO_E_MEMORY: length < AEO_REGRESSOR_SAVED_WORDS(r, l, p, e); AEO_E_VERSION: another format
 * version; AEO_E_MISMATCH: other sizes, settings or precision; AEO_E_NOT_FINITE, AEO_E_DAMAGED: a broken seal, or
 * numbers that no regressor holds. On failure self is unchanged. */
aeo_status_t aeo_regressor_restore(aeo_regressor_t *self, const aeo_real_t *saved, size_t length);

/* Return 1 when every stored number is finite and in range and the sizes agree, else 0; O(n), for tests and debugging.
 * A null pointer answers 0. */
int aeo_regressor_invariants_hold(const aeo_regressor_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
