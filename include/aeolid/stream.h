/* stream.h: sends samples, parameters, description and health of one filter as CAN frames, within a share of the bus.
 *
 * MODEL
 *   A snapshot is one consistent copy of theta (l x n, taken between two updates), sent as N = l n parameter frames, on
 *   CAN FD as B = ceil(N / 14) frames of 14 parameters each, a block:
 *
 *     begin, parameter x N or B, end, repair x R, end, end     snapshot number modulo 256 in every frame
 *
 *   Position q = 0 ... B-1 carries block q S mod B, S coprime with B near 0.618 B: 16 neighbours in time are at least
 *   B / 40 apart in theta, so a burst of losses does not hit one place. (Classic: a block is one parameter, B = N.) A
 *   lost frame costs its own block only; the repair frames bring it back within the same cycle: positions fall into
 *   G = ceil(B / 256) interleaved groups q mod G; repair number k is the exclusive or of a drawn half of group k mod G
 *   (aeo_frame_repair_set). Any set of repair frames a few longer than the number of blocks missing in the group
 *   restores them exactly (random linear code over GF(2): Luby, "LT codes", FOCS 2002, is the sparse relative).
 *   Deviation: dense sets instead of sparse ones; groups of 256 keep a repair frame at 256 exclusive ors and need about
 *   3 surplus frames instead of some percent.
 *
 *   A classic sample is one frame a channel, then a seal over all of it; a CAN FD sample is ceil(channels / 14) frames,
 *   each sealed by its own CRC-32.
 *
 *   Pacing: time earns credit, a frame costs its longest time on the bus at bits_per_s, and nothing but samples leaves
 *   without credit for the longest frame in use. Samples are time-critical: they go at once and leave a debt that the
 *   rest waits for. Share of the bus = bits_per_s / bit rate; AEO_STREAM_SHARE(500000, 50) is 5 % of 500 kbit/s.
 *   Order in a step: first description; then health when due and description when due have their turns, at most every
 *   second and every fourth frame while a snapshot is under way; else the snapshot. After the closing frames: nothing.
 *
 * CONTRACT
 *   Memory: AEO_STREAM_WORDS(parameters) words of 32 bits from the caller: 456 for l = 3, n = 152; 176 for l = 4,
 *   n = 44.
 *   Words and not aeo_real_t: the wire carries binary32 in both builds. The structure itself 464 bytes (64-bit
 *   pointers; double 480), 208 of them messages and frame under way, so that no call chain needs them on the stack.
 *   Instructions, measured on x86-64 at -O2: sample 550 a frame, the seal among them, on CAN FD 320 a channel; snapshot
 *   80 N; step at most `burst` frames of 560 (CAN FD 1900), a repair frame 19 min(N, 256) more (CAN FD 72 min(B, 256)).
 *   Worst stack on Cortex-M4F, the port's own aside: init 228 bytes, sample 192, step 136. Deterministic. Never blocks,
 *   never retries within a call.
 *   Threads: sample, innovation, snapshot and health belong to the control task, step to one context of lower priority;
 *   where these differ the port needs lock and unlock (drawing in port.h). finish and pending may be called from either,
 *   reset from the context of step. The lock is held for one frame: repairs and the copy of a snapshot are made outside.
 *   Failures: a frame the port refuses is counted. A sample is then lost (counters.dropped); everything else keeps its
 *   turn and is offered again at the next step (counters.refused).
 *   In the double build every function here has the suffix _f64 in its symbol, see config.h.
 */
#ifndef AEOLID_STREAM_H
#define AEOLID_STREAM_H

#include <aeolid/port.h>
#include <aeolid/regressor.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Words of 32 bits for a snapshot of so many parameters, 1 ... 65536. */
#define AEO_STREAM_WORDS(parameters) (parameters)

/* Frames of 14 parameters on CAN FD. */
#define AEO_STREAM_BLOCKS(parameters) (((uint32_t)(parameters) + AEO_FRAME_VALUES_MAX - 1u) / AEO_FRAME_VALUES_MAX)

/* Repair frames for so many parameters (CAN FD: blocks). Above 52,000 with high percentages 65535. */
#define AEO_STREAM_REPAIRS(blocks, repair_percent)                                                                     \
    ((repair_percent) > 0u                                                                                             \
         ? (uint32_t)(blocks) * (uint32_t)(repair_percent) / 100u + 8u * (((uint32_t)(blocks) + 255u) / 256u)          \
         : 0u)

/* Frames of one snapshot, begin and three ends included: 582 for N = 450 and 25 %, on CAN FD 53. */
#define AEO_STREAM_FRAMES(parameters, repair_percent)                                                                  \
    ((uint32_t)(parameters) + AEO_STREAM_REPAIRS((parameters), (repair_percent)) + 4u)
#define AEO_STREAM_FRAMES_FD(parameters, repair_percent)                                                               \
    AEO_STREAM_FRAMES(AEO_STREAM_BLOCKS(parameters), (repair_percent))

/* Longest time on the bus in bits of the nominal rate, 29 bit identifiers (11 bits take less): a snapshot; a sample of
 * so many channels with so many innovations (0: not sent); ratio: fd_ratio. */
#define AEO_STREAM_SNAPSHOT_BITS(parameters, repair_percent)                                                           \
    (AEO_STREAM_FRAMES((parameters), (repair_percent)) * AEO_FRAME_BITS_EXTENDED)
#define AEO_STREAM_SNAPSHOT_BITS_FD(parameters, repair_percent, ratio)                                                 \
    ((AEO_STREAM_FRAMES_FD((parameters), (repair_percent)) - 4u) * AEO_FRAME_FD_BITS_EXTENDED(64u, (ratio)) +          \
     4u * AEO_FRAME_BITS_EXTENDED)
#define AEO_STREAM_SAMPLE_BITS(channels, innovations, seal)                                                            \
    (((uint32_t)(channels) + (uint32_t)(innovations) + ((seal) ? 1u + ((innovations) > 0u ? 1u : 0u) : 0u)) *          \
     AEO_FRAME_BITS_EXTENDED)
#define AEO_STREAM_SAMPLE_BITS_FD(channels, innovations, ratio)                                                        \
    (AEO_STREAM_VALUES_BITS_FD((channels), (ratio)) + AEO_STREAM_VALUES_BITS_FD((innovations), (ratio)))
#define AEO_STREAM_VALUES_BITS_FD(values, ratio)                                                                       \
    ((uint32_t)(values) / AEO_FRAME_VALUES_MAX * AEO_FRAME_FD_BITS_EXTENDED(64u, (ratio)) +                            \
     ((uint32_t)(values) % AEO_FRAME_VALUES_MAX > 0u                                                                   \
          ? AEO_FRAME_FD_BITS_EXTENDED(AEO_FRAME_FD_LENGTH((uint32_t)(values) % AEO_FRAME_VALUES_MAX), (ratio))        \
          : 0u))

/* Frames of a description, at most: eight parts of a name and four of a unit a channel. */
#define AEO_STREAM_DESCRIPTION_MAX(channels) (7u + 14u * (uint32_t)(channels))

/* Worst load of the bus by this node in thousandths, rounded up: a sample of sample_bits every sample_every, a snapshot
 * of snapshot_bits every snapshot_every, health every health_every and `description` frames every describe_every
 * sample times (all above 0). 2^32 - 1 stands for that and more. bits_per_s bounds the load whatever this says; where
 * this says more than the share, snapshots take longer than snapshot_every and counters.busy counts. A constant
 * expression:
 *   typedef char bus_has_room[AEO_STREAM_LOAD(500000, 100000, AEO_STREAM_SAMPLE_BITS(5, 0, 1), 1,
 *                             AEO_STREAM_SNAPSHOT_BITS(450, 25), 100, 10, 77, 100) <= 50 ? 1 : -1]; */
#define AEO_STREAM_LOAD(bit_rate, sample_us, sample_bits, sample_every, snapshot_bits, snapshot_every, health_every,   \
                        description, describe_every)                                                                   \
    AEO_STREAM_HELD(AEO_STREAM_OVER(AEO_STREAM_SHARES(sample_bits, sample_every) +                                     \
                                        AEO_STREAM_SHARES(snapshot_bits, snapshot_every) +                             \
                                        AEO_STREAM_SHARES(AEO_FRAME_BITS_EXTENDED, health_every) +                     \
                                        AEO_STREAM_SHARES(AEO_FRAME_BITS_EXTENDED * (description), describe_every),    \
                                    1ull * (sample_us) * (bit_rate)))

/* The quotient rounded up; bits every so many sample times in 1e-9 bits a sample time, 1e9 = 1e6 us/s times 1000; what
 * 32 bits hold of a load. The four parts, each rounded up, are less than 4 above their sum, which the quotient by
 * sample_us bit_rate (2e5 and more) makes less than 2e-5 thousandths. A snapshot has at most 2.2e7 bits: no overflow. */
#define AEO_STREAM_OVER(sum, by)       (((sum) + (by)-1u) / (by))
#define AEO_STREAM_SHARES(bits, every) AEO_STREAM_OVER(1000000000ull * (bits), (every))
#define AEO_STREAM_HELD(load)          ((uint32_t)((load) < 0xFFFFFFFFull ? (load) : 0xFFFFFFFFull))

/* Bits a second for so many thousandths of a bus: AEO_STREAM_SHARE(500000, 50) = 25000. */
#define AEO_STREAM_SHARE(bits_per_s, permille) ((uint32_t)(bits_per_s) / 1000u * (uint32_t)(permille))

/* Channels (inputs + outputs + scheduling), 1 ... 64. Bounds the description to 7 + 14 frames a channel. */
#ifndef AEO_STREAM_CHANNELS_MAX
#define AEO_STREAM_CHANNELS_MAX 64
#endif
#if AEO_STREAM_CHANNELS_MAX < 1 || AEO_STREAM_CHANNELS_MAX > 64
#error "AEO_STREAM_CHANNELS_MAX is 1 ... 64: the host refuses more"
#endif

#define AEO_STREAM_COUNTERS 9  /* counters a filter may report */
#define AEO_STREAM_NAME_MAX 32 /* characters of a channel name that are sent */
#define AEO_STREAM_UNIT_MAX 16 /* characters of a unit that are sent */

/* One channel; inputs first, then outputs, then scheduling, whose range is nobody's business here. */
typedef aeo_channel_t aeo_stream_channel_t;

/* Which filter makes the parameters; numbers travel in descriptions and never change. */
typedef enum { AEO_METHOD_RLS = 0, AEO_METHOD_ELS = 1, AEO_METHOD_FAST_RLS = 2, AEO_METHOD_LATTICE = 3 } aeo_method_t;

typedef struct {
    aeo_address_t address;
    uint8_t inputs;      /* r, 0 ... */
    uint8_t outputs;     /* l, 1 ... */
    uint8_t scheduling;  /* further channels sent with a sample; the three together at most AEO_STREAM_CHANNELS_MAX */
    uint8_t innovations; /* 1: aeo_stream_innovation sends, and the budget has room for it; 0 to start with */
    uint8_t seal;        /* 1: a seal after each classic sample, one frame more; without it a receiver believes samples
                             only while nothing on the bus is garbled. Start: 1. CAN FD needs none */
    uint8_t fd;       /* 1: samples, innovations and parameters as CAN FD frames; every node of the bus must bear it */
    uint8_t fd_ratio; /* CAN FD: data bit rate over nominal bit rate, rounded down, 1 ... 16; too large: the share is
                             exceeded. Start: 1 */
    uint8_t method;   /* aeo_method_t, for the description; els is VARMAX alone */
    uint16_t model_set;                   /* aeo_model_set_t of regressor.h, for the description */
    uint16_t past;                        /* p; 0: no predictor, any number of parameters, which no host identifies */
    uint32_t parameters;                  /* N = l n, 1 ... 65536, with n = p (r + l) + d for VARX, p (r + 2 l) + d for
                                             VARMAX, d bits of the mask: a filter announced as another is refused */
    uint32_t feedthrough;                 /* bit j: input j has a current-sample parameter */
    aeo_real_t sample_time_s;             /* 2e-5 ... 1000 s */
    aeo_real_t lambda;                    /* forgetting factor of the filter, for the description only */
    aeo_real_t rho;                       /* regularisation of the filter, for the description only */
    const aeo_stream_channel_t *channels; /* inputs + outputs + scheduling entries; must live on */
    uint16_t sample_every;                /* send every k-th sample, 0 none. Start: 1; more where the bus is narrow */
    uint16_t health_every;                /* steps between two health frames, 1 ... Start: 10 */
    uint16_t describe_every; /* steps between two descriptions, 1 ...; a late joiner waits so long. Start: 10 s */
    uint8_t repair_percent;  /* repair frames per 100 parameters, plus 8 a group, 0 ... 100. Start: 25, which makes good
                                10 % loss in the same cycle; 0: none, only the next snapshot makes good a loss */
    uint8_t burst;           /* frames in one step at most, 1 ...; many make a step long. Start: 16 */
    uint32_t bits_per_s;     /* budget in bits of the nominal rate, 160 ..., on CAN FD 1000 ...; 0: no limit (virtual
                                buses). Start: AEO_STREAM_SHARE(500000, 50) */
    uint32_t snapshot_every; /* steps between two snapshots that are to be sent whole; init refuses what cannot be. 0:
                                no promise, as many as there is room for. Start: 10 s */
} aeo_stream_config_t;

/* Order of the parameters within a snapshot, in blocks. */
typedef struct {
    uint32_t count;   /* B, on classic CAN N */
    uint32_t stride;  /* S */
    uint32_t groups;  /* G */
    uint32_t repairs; /* R */
} aeo_spread_t;

/* Never decrease; stay at 2^32 - 1. */
typedef struct {
    uint32_t sent;    /* frames the port took */
    uint32_t refused; /* frames the port refused that are offered again */
    uint32_t dropped; /* sample, innovation and seal frames lost: refused by the port, debt too deep, or the end said */
    uint32_t snapshots; /* snapshots sent to their last frame */
    uint32_t busy;      /* snapshots not taken: the one before was still being sent, or the end announced */
} aeo_stream_counters_t;

/* Private but readable in a debugger. */
typedef struct {
    aeo_stream_config_t config;
    aeo_port_t port;
    aeo_stream_counters_t counters;
    aeo_message_t message; /* under way, like the frame; used while the lock is held */
    aeo_can_frame_t frame;
    aeo_message_t ahead; /* of the step alone, without the lock: values of the next repair, slots of the description */
    uint32_t *theta;     /* parameters words, by index */
    uint32_t hash;       /* of the description */
    uint32_t frame_us;   /* cost of a classic frame; 0 without a limit */
    uint32_t longest_us; /* cost of the longest frame in use */
    uint32_t period_us;  /* sample time */
    uint32_t snapshot_steps; /* steps within which a snapshot leaves */
    uint32_t clock_us;       /* last reading of port.time_us */
    int32_t credit_us;       /* -134 frame_us ... burst longest_us */
    aeo_spread_t spread;
    uint32_t cursor;      /* position within the phase */
    uint32_t taken_index; /* sample index of the snapshot */
    uint32_t crc;         /* of the snapshot */
    uint32_t last_index;  /* newest sample index, for health */
    uint32_t slot;        /* next part of the description */
    uint32_t counter[AEO_STREAM_COUNTERS];
    uint16_t flags;       /* of the filter's health */
    uint16_t health_in;   /* steps until the next health frame */
    uint16_t describe_in; /* steps until the next description */
    uint8_t phase;        /* what of the snapshot comes next */
    uint8_t number;       /* of the snapshot */
    uint8_t health_item;  /* half-steps through the items, round and round */
    uint8_t counters_used;
    uint8_t described;   /* 1 once a whole description has left */
    uint8_t describing;  /* 1 while a description is under way */
    uint8_t turn;        /* frames of a snapshot since the description had its turn */
    uint8_t health_turn; /* 0: health had its turn, and a snapshot under way has the next */
    uint8_t farewells;   /* closing health frames still to send */
    uint8_t finishing;   /* 1 after aeo_stream_finish */
} aeo_stream_t;

#ifdef AEO_REAL_DOUBLE
#define aeo_stream_init           aeo_stream_init_f64
#define aeo_stream_sample         aeo_stream_sample_f64
#define aeo_stream_innovation     aeo_stream_innovation_f64
#define aeo_stream_snapshot       aeo_stream_snapshot_f64
#define aeo_stream_health         aeo_stream_health_f64
#define aeo_stream_step           aeo_stream_step_f64
#define aeo_stream_finish         aeo_stream_finish_f64
#define aeo_stream_pending        aeo_stream_pending_f64
#define aeo_stream_snapshot_steps aeo_stream_snapshot_steps_f64
#define aeo_stream_reset          aeo_stream_reset_f64
#endif

/* Start a stream; nothing is sent yet. config and port are copied, memory (words >= AEO_STREAM_WORDS(parameters)) is
 * used until the end. AEO_E_ARG: null pointer, setting out of its range, parameters that are not those of the model
 * set, sizes and mask, port without send, lock without unlock.
 * AEO_E_MEMORY: too few words. AEO_E_BUDGET: samples, seals, innovations, health and description together leave less than
 * a tenth of bits_per_s or of `burst` frames a step, or a snapshot takes more than snapshot_every steps; raise
 * sample_every, health_every or describe_every, or bits_per_s and burst. On failure self is unchanged. */
aeo_status_t aeo_stream_init(aeo_stream_t *self, const aeo_stream_config_t *config, const aeo_port_t *port,
                             uint32_t *memory, uint32_t words);

/* Send sample `index` and its seal: u (inputs), y (outputs), s (scheduling), in the channels' units, u or s null when
 * there are none, as binary32; a NaN arrives as a missing sample. Samples that sample_every skips cost nothing. AEO_E_ARG: null pointer.
 * AEO_E_REFUSED. */
aeo_status_t aeo_stream_sample(aeo_stream_t *self, uint32_t index, const aeo_real_t *u, const aeo_real_t *y,
                               const aeo_real_t *s);

/* Send the innovation e (outputs) of sample `index`; nothing when config.innovations is 0. Returns as
 * aeo_stream_sample. */
aeo_status_t aeo_stream_innovation(aeo_stream_t *self, uint32_t index, const aeo_real_t *e);

/* Copy theta (parameters values: l x n by rows) as binary32 and begin to send it; `index` is the last sample in it.
 * Call between two updates. AEO_E_ARG: null pointer. AEO_E_BUSY: the one before is under way or the end is announced;
 * nothing is changed but counters.busy. */
aeo_status_t aeo_stream_snapshot(aeo_stream_t *self, uint32_t index, const aeo_real_t *theta);

/* Keep flags (bits 0 ... 14) and `count` counters (0 ... AEO_STREAM_COUNTERS) for the health frames to come.
 * AEO_E_ARG. */
aeo_status_t aeo_stream_health(aeo_stream_t *self, uint32_t flags, const uint32_t *counter, unsigned count);

/* Send what credit and port allow; call once a sample time, or more often with port.time_us. Returns the frames sent,
 * or AEO_E_ARG for a null pointer. */
int aeo_stream_step(aeo_stream_t *self);

/* Return the steps within which a snapshot leaves whole, as long as the port refuses nothing, samples come no faster than
 * declared and step is called once a sample time: the formula is in budget.h of the sources. 0 for a null pointer. */
uint32_t aeo_stream_snapshot_steps(const aeo_stream_t *self);

/* Announce the end: after the snapshot under way, the last, closing health frames say that the node stops on purpose.
 * Samples leave until then; afterwards they are refused, until a reset. */
void aeo_stream_finish(aeo_stream_t *self);

/* Return 1 while first description, snapshot or closing frames are still to be sent, else 0. */
int aeo_stream_pending(const aeo_stream_t *self);

/* Forget snapshot, health and credit and describe anew, as after init; configuration, counters and snapshot number
 * stay. */
void aeo_stream_reset(aeo_stream_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
