/* estimator.h: runs regressor and filter from one description of the channels, and announces them on a stream.
 *
 * MODEL
 *   u, y, t --> regressor.h --> one filter --> theta, innovation, health --> stream.h
 *   Nothing of its own. The description is written once: sizes, window, model set, mask, period, channels and settings go from
 *   there to the regressor, to the filter and to what the stream says of both, so none can contradict another. A filter
 *   is chosen by its method, a function that is named in the program: what is not named is not linked.
 *
 * CONTRACT
 *   Memory: AEO_ESTIMATOR_RLS_WORDS(r, l, p, e, d) words of aeo_real_t from the caller and the like for the other
 *   methods, d inputs in the feedthrough mask, e = 1 for VARMAX. r=2, l=3, p=10, d=0: rls 1,866 words (7.5 kB in float),
 *   els with e=1 4,140 words. The structure holds the state of any filter: 656 bytes (64-bit pointers; double 720).
 *   Operations: those of the regressor's push and of the filter's update. Worst stack: 56 bytes beyond the filter's.
 *   Determinism, long runs: as regressor and filter.
 *   Threads and interrupts: one context at a time may touch one object; different objects are independent.
 *   Failures: a call that fails leaves the object as it is, but for the counter that the header of the regressor or of
 *   the filter names.
 */
#ifndef AEOLID_ESTIMATOR_H
#define AEOLID_ESTIMATOR_H

#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/lattice.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"
#include "aeolid/stream.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef AEO_REAL_DOUBLE
#define aeo_estimator_rls             aeo_estimator_rls_f64
#define aeo_estimator_els             aeo_estimator_els_f64
#define aeo_estimator_fast_rls        aeo_estimator_fast_rls_f64
#define aeo_estimator_lattice         aeo_estimator_lattice_f64
#define aeo_estimator_words           aeo_estimator_words_f64
#define aeo_estimator_regressors      aeo_estimator_regressors_f64
#define aeo_estimator_init            aeo_estimator_init_f64
#define aeo_estimator_take            aeo_estimator_take_f64
#define aeo_estimator_theta           aeo_estimator_theta_f64
#define aeo_estimator_innovation      aeo_estimator_innovation_f64
#define aeo_estimator_residual        aeo_estimator_residual_f64
#define aeo_estimator_health          aeo_estimator_health_f64
#define aeo_estimator_clear_health    aeo_estimator_clear_health_f64
#define aeo_estimator_count           aeo_estimator_count_f64
#define aeo_estimator_reset           aeo_estimator_reset_f64
#define aeo_estimator_saved_words     aeo_estimator_saved_words_f64
#define aeo_estimator_save            aeo_estimator_save_f64
#define aeo_estimator_restore         aeo_estimator_restore_f64
#define aeo_estimator_invariants_hold aeo_estimator_invariants_hold_f64
#define aeo_estimator_announce        aeo_estimator_announce_f64
#define aeo_estimator_send            aeo_estimator_send_f64
#define aeo_estimator_snapshot        aeo_estimator_snapshot_f64
#endif

/* Words of memory for r inputs, l outputs, p blocks, e = 1 for VARMAX, d inputs in the mask; and of a saved estimator. */
#define AEO_ESTIMATOR_RLS_WORDS(r, l, p, e, d)                                                                         \
    (AEO_RLS_WORDS(AEO_REGRESSOR_LENGTH(r, l, p, e, d), l) + AEO_REGRESSOR_WORDS(r, l, p, e))
#define AEO_ESTIMATOR_ELS_WORDS(r, l, p, d)                                                                            \
    (AEO_ELS_WORDS(AEO_REGRESSOR_LENGTH(r, l, p, 1, d), l) + AEO_REGRESSOR_WORDS(r, l, p, 1))
#define AEO_ESTIMATOR_FAST_RLS_WORDS(r, l, p, e, d)                                                                    \
    (AEO_FAST_RLS_WORDS(p, AEO_REGRESSOR_BLOCK(r, l, e), d, l) + AEO_REGRESSOR_WORDS(r, l, p, e))
#define AEO_ESTIMATOR_LATTICE_WORDS(r, l, p, e, d)                                                                     \
    (AEO_LATTICE_WORDS(p, AEO_REGRESSOR_BLOCK(r, l, e), d, l) + AEO_REGRESSOR_LENGTH(r, l, p, e, d) * (size_t)(l) +    \
     AEO_REGRESSOR_WORDS(r, l, p, e))
#define AEO_ESTIMATOR_RLS_SAVED_WORDS(r, l, p, e, d)                                                                   \
    (AEO_RLS_SAVED_WORDS(AEO_REGRESSOR_LENGTH(r, l, p, e, d), l) + AEO_REGRESSOR_SAVED_WORDS(r, l, p, e))
#define AEO_ESTIMATOR_ELS_SAVED_WORDS(r, l, p, d)                                                                      \
    (AEO_ELS_SAVED_WORDS(AEO_REGRESSOR_LENGTH(r, l, p, 1, d), l) + AEO_REGRESSOR_SAVED_WORDS(r, l, p, 1))
#define AEO_ESTIMATOR_FAST_RLS_SAVED_WORDS(r, l, p, e, d)                                                              \
    (AEO_FAST_RLS_SAVED_WORDS(p, AEO_REGRESSOR_BLOCK(r, l, e), d, l) + AEO_REGRESSOR_SAVED_WORDS(r, l, p, e))
#define AEO_ESTIMATOR_LATTICE_SAVED_WORDS(r, l, p, e, d)                                                               \
    (AEO_LATTICE_SAVED_WORDS(p, AEO_REGRESSOR_BLOCK(r, l, e), d, l) + AEO_REGRESSOR_SAVED_WORDS(r, l, p, e))

/* What aeo_estimator_count tells: of the regressor, then of every filter, then of single ones (0 for the others). */
typedef enum {
    AEO_COUNT_SAMPLES,
    AEO_COUNT_NOT_FINITE,
    AEO_COUNT_RANGE,
    AEO_COUNT_TIME,
    AEO_COUNT_GAPS,
    AEO_COUNT_UPDATES,
    AEO_COUNT_REJECTED,
    AEO_COUNT_WITHHELD,
    AEO_COUNT_BOUNDED,
    AEO_COUNT_REINITIALISED,
    AEO_COUNT_RELEASED,
    AEO_COUNT_FELL_BACK, /* els */
    AEO_COUNT_LIMITED,   /* els */
    AEO_COUNT_RESTARTED, /* fast_rls and lattice */
    AEO_COUNTERS
} aeo_counter_t;

/* The one description. Sizes and mask are explained in regressor.h, settings in the header of the filter, where ranges
 * and values to start with stand, too. */
typedef struct {
    uint16_t inputs, outputs, past;
    aeo_model_set_t model_set; /* els takes AEO_VARMAX alone; the others take either, and feed their residual back */
    uint32_t feedthrough;
    uint32_t period_us;
    const aeo_channel_t *channels; /* r + l; must live on where a stream is announced, and then go on with scheduling */
    aeo_real_t forgetting, regularisation, excitation_min, growth_max; /* fast_rls has no excitation_min: not read */
    uint32_t varx_samples;                                             /* from here on read for els alone */
    aeo_real_t forgetting_start, forgetting_rate, guard_ratio;
} aeo_estimator_config_t;

typedef struct aeo_estimator aeo_estimator_t;

/* How the filter is called. Private: a method fills it in. */
typedef struct {
    aeo_method_t method;
    size_t (*words)(const aeo_estimator_config_t *config);
    size_t (*saved_words)(const aeo_estimator_config_t *config);
    aeo_status_t (*init)(aeo_estimator_t *self, const aeo_estimator_config_t *config, aeo_real_t *memory, size_t words);
    aeo_status_t (*update)(aeo_estimator_t *self, const aeo_real_t *z, const aeo_real_t *y);
    const aeo_real_t *(*theta)(aeo_estimator_t *self);
    const aeo_real_t *(*innovation)(const aeo_estimator_t *self);
    const aeo_real_t *(*residual)(const aeo_estimator_t *self);
    const aeo_real_t *(*feedback)(const aeo_estimator_t *self);
    uint32_t (*health)(const aeo_estimator_t *self);
    void (*clear_health)(aeo_estimator_t *self);
    uint32_t (*count)(const aeo_estimator_t *self, aeo_counter_t which);
    void (*reset)(aeo_estimator_t *self);
    aeo_status_t (*save)(const aeo_estimator_t *self, aeo_real_t *saved, size_t length);
    aeo_status_t (*restore)(aeo_estimator_t *self, const aeo_real_t *saved, size_t length);
    int (*invariants_hold)(const aeo_estimator_t *self);
} aeo_estimator_calls_t;

typedef void (*aeo_estimator_method_t)(aeo_estimator_calls_t *calls);

/* Private but for reading. */
struct aeo_estimator {
    aeo_estimator_config_t config;
    aeo_estimator_calls_t calls;
    aeo_regressor_t regressor;
    aeo_real_t *reading; /* l n: theta as last read, where the filter has none of its own (lattice) */
    union {
        aeo_rls_t rls;
        aeo_els_t els;
        aeo_fast_rls_t fast_rls;
        aeo_lattice_t lattice;
    } of;
};

/* The methods, to be handed to aeo_estimator_init; each brings the code of its filter along. */
void aeo_estimator_rls(aeo_estimator_calls_t *calls);
void aeo_estimator_els(aeo_estimator_calls_t *calls);
void aeo_estimator_fast_rls(aeo_estimator_calls_t *calls);
void aeo_estimator_lattice(aeo_estimator_calls_t *calls);

/* Return the words of memory that init needs, as the macros above do; n = p m + d, the regressors. 0 for a null pointer. */
size_t aeo_estimator_words(aeo_estimator_method_t method, const aeo_estimator_config_t *config);
size_t aeo_estimator_regressors(const aeo_estimator_config_t *config);

/* Make self ready for its first sample in the memory given (words values, written, aligned as the type; on a multiple of
 * 32 bytes it is the fastest). The config is copied, not the channels' texts. Memory must outlive self and serve nothing
 * else. Codes of aeo_regressor_init and of the filter's init; AEO_E_ARG also for no channels, and for els with VARX.
 * On failure neither self nor memory is written. */
aeo_status_t aeo_estimator_init(aeo_estimator_t *self, aeo_estimator_method_t method,
                                const aeo_estimator_config_t *config, aeo_real_t *memory, size_t words);

/* Take the sample u (r values; null when r = 0), y (l values), in the channels' units, taken at time_us, and absorb it
 * once the window is full. AEO_OK: theta, innovation and residual are those of this sample. AEO_E_GAP: as AEO_FILLING, and samples before
 * it are missing. Other codes as aeo_regressor_push and the filter's update: the sample is refused. AEO_E_ARG: a null
 * pointer. */
aeo_status_t aeo_estimator_take(aeo_estimator_t *self, const aeo_real_t *u, const aeo_real_t *y, uint64_t time_us);

/* Return theta, l x n by rows, scaled units (markov.h undoes the scales of self->regressor); valid until the next call.
 * Null for a null pointer, and where a lattice has no finite one. */
const aeo_real_t *aeo_estimator_theta(aeo_estimator_t *self);

/* Return innovation (a priori) and residual (a posteriori) of the last sample absorbed, l scaled values; the sticky
 * health flags of the filter; a counter. */
const aeo_real_t *aeo_estimator_innovation(const aeo_estimator_t *self);
const aeo_real_t *aeo_estimator_residual(const aeo_estimator_t *self);
uint32_t aeo_estimator_health(const aeo_estimator_t *self);
uint32_t aeo_estimator_count(const aeo_estimator_t *self, aeo_counter_t which);

/* Lower all health flags. Start afresh: window, theta and all that was learnt; health and counters stay. */
void aeo_estimator_clear_health(aeo_estimator_t *self);
void aeo_estimator_reset(aeo_estimator_t *self);

/* Write everything needed to go on later into saved, regressor and filter; go on where it was written, in an estimator
 * that was initialised alike. Codes of both; AEO_E_MEMORY: length is below what saved_words returns. A restore that
 * fails leaves self as it was. */
size_t aeo_estimator_saved_words(const aeo_estimator_t *self);
aeo_status_t aeo_estimator_save(const aeo_estimator_t *self, aeo_real_t *saved, size_t length);
aeo_status_t aeo_estimator_restore(aeo_estimator_t *self, const aeo_real_t *saved, size_t length);

/* Return 1 when those of regressor and filter hold, else 0. */
int aeo_estimator_invariants_hold(const aeo_estimator_t *self);

/* Start a stream of self's samples and parameters. bus says how it is sent: address, scheduling, innovations, seal, fd,
 * fd_ratio, sample_every, health_every, describe_every, repair_percent, burst, bits_per_s, snapshot_every. What self
 * knows is 0 there, or AEO_E_ARG. Otherwise as aeo_stream_init; words >= l n. */
aeo_status_t aeo_estimator_announce(const aeo_estimator_t *self, aeo_stream_t *stream, const aeo_stream_config_t *bus,
                                    const aeo_port_t *port, uint32_t *memory, uint32_t words);

/* Take sample `index` as aeo_estimator_take does and send it, with its innovation when the stream has innovations, and
 * health for the frames to come; s: scheduling channels, null when there are none. Returns what take returns: what did
 * not get on the bus is in the stream's counters. AEO_E_ARG also for a null stream, and for a null s where the stream has
 * scheduling channels; nothing is taken then. Then call aeo_stream_step. */
aeo_status_t aeo_estimator_send(aeo_estimator_t *self, aeo_stream_t *stream, uint32_t index, const aeo_real_t *u,
                                const aeo_real_t *y, const aeo_real_t *s, uint64_t time_us);

/* Begin to send the parameters of this instant; index is that of the last sample. Returns as aeo_stream_snapshot;
 * AEO_E_RANGE: a lattice has no finite ones. */
aeo_status_t aeo_estimator_snapshot(aeo_estimator_t *self, aeo_stream_t *stream, uint32_t index);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
