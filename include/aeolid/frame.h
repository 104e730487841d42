/* frame.h: packs one message of the wire into one CAN frame and back, by shifts, the same on every machine.
 *
 * MODEL
 *   Two shapes, one for every classic message and one for every CAN FD message:
 *
 *     identifier   29 bit: base + kind * 256 + node       (J1939: priority 7, proprietary B, source address node)
 *                  11 bit: base + kind * 4   + node       base = 0x40, 0x80 or 0xC0 modulo 0x100
 *                          base + kind * 16  + node       base = 0 modulo 0x100
 *     byte 0       tag      what the kind says: channel, item or snapshot number
 *     byte 1..2    index    little endian: what the kind says
 *
 *     classic, 8 bytes
 *     byte 3       check    CRC-8 (polynomial 0x2F, start 0xFF, inverted) over identifier without node, length and all
 *                           other bytes; Hamming distance 4
 *     byte 4..7    value    little endian: binary32 pattern or unsigned number
 *
 *     CAN FD, 12, 16, 20, 24, 32, 48 or 64 bytes, the least that holds the values
 *     byte 3       count    of values, 1 ... 14
 *     byte 4..7    check    CRC-32 (IEEE 802.3), little endian, over the words identifier, bytes 0..3, values and the
 *                           zero words after them; Hamming distance 5 or more up to 2974 bits
 *     byte 8..     values   little endian, of consecutive channels or parameters
 *
 *     kind             tag              index                         value
 *     0  health        item             flags                         sample index (item 0) or a counter
 *     1  description   item             channel + 256 * part, or u16  number, binary32 or four characters
 *     2  sample        channel          sample index modulo 65536     binary32 in the channel's unit
 *     3  innovation    output           sample index modulo 65536     binary32
 *     4  begin         snapshot number  number of parameters - 1      sample index at which the snapshot was taken
 *     5  parameter     snapshot number  parameter index               binary32
 *     6  repair        snapshot number  repair number                 exclusive or of a drawn set of parameters
 *     7  end           snapshot number  sample index modulo 65536     CRC-32 over the words number + 2^8 (parameters
 *                                                                     - 1) + 2^24 node, sample index, parameters
 *     8  seal          channels, +128:  sample index modulo 65536     CRC-32 over the words node + 2^8 tag, sample
 *                      of innovations                                 index (32 bits), values: of what was just sent
 *     10 sample FD     first channel    sample index modulo 65536     binary32 each
 *     11 innovation FD first output     sample index modulo 65536     binary32 each
 *     13 parameter FD  snapshot number  index of the first            binary32 each: 14, in the last block less
 *     14 repair FD     snapshot number  repair number                 exclusive or of a drawn set of blocks, 14 words
 *
 *   aeolid.dbc names the same fields; a test holds the two together. Sources of the CRCs: Koopman and Chakravarty,
 *   "Cyclic redundancy code polynomial selection for embedded networks", DSN 2004; Koopman, "32-bit cyclic redundancy
 *   codes for Internet applications", DSN 2002. Deviation from a usual DBC layout: the checks are there because serial
 *   CAN adapters carry frames as plain text, without the CRC of the bus; a CRC-8 alone lets one in 128 of the errors of
 *   four, six, ... bits pass, the CRC-32 of seal, end, description and CAN FD frames none that a lifetime would see.
 *
 *   Which identifiers are free: CANopen's predefined connection set and its reserved identifiers (CiA 301, tables "generic
 *   pre-defined connection set" and "restricted CAN-IDs") leave one gap that holds a node, 0x680 ... 0x6DF; a node there
 *   has 64 of them, nothing sooner than SDO requests and later than heartbeats. J1939 leaves anybody the proprietary B
 *   parameter groups 0xFF00 ... 0xFFFF; their last byte is the source address, which a node must have claimed (SAE
 *   J1939-81; port/j1939/claim.h does it) before it sends. aeo_frame_pack refuses every other base unless
 *   AEO_ADDRESS_FORCED says that the bus has no such devices; aeo_frame_unpack reads at any.
 *
 * CONTRACT
 *   Memory: none beyond the arguments. Constant tables 128 bytes. About 500 instructions a classic frame, 370 and 100 a
 *   value a CAN FD frame. Stack 56 bytes (Cortex-M4F).
 *   Deterministic; thread and interrupt rule: all functions are pure and may be called from anywhere.
 */
#ifndef AEOLID_FRAME_H
#define AEOLID_FRAME_H

#include <aeolid/config.h>
#include <aeolid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of everything above and of the description items below; a receiver refuses what it does not know. */
#define AEO_WIRE_VERSION 2

/* Bases that disturb nobody, with room for 32 kinds and 254 nodes (29 bit, low 13 bits zero) or 16 kinds and 4 nodes (11
 * bit, low 6 bits zero). Both may be defined otherwise; one that others use stops the compiler unless
 * AEO_FRAME_BASE_FORCED is defined, and then still needs AEO_ADDRESS_FORCED. */
#ifndef AEO_FRAME_BASE_EXTENDED
#define AEO_FRAME_BASE_EXTENDED UINT32_C(0x1CFF4000)
#endif
#ifndef AEO_FRAME_BASE_STANDARD
#define AEO_FRAME_BASE_STANDARD UINT32_C(0x680)
#endif

/* 1 where a base, with 29 or 11 bit identifiers, is used neither by CANopen nor by J1939; a constant expression:
 *   typedef char base_is_free[AEO_FRAME_BASE_IS_FREE(MY_BASE, 1) ? 1 : -1]; */
#define AEO_FRAME_BASE_IS_FREE(base, extended)                                                                         \
    ((extended) ? ((base)&UINT32_C(0xE3FF1FFF)) == UINT32_C(0x00FF0000) : (base) == UINT32_C(0x680))

#ifndef AEO_FRAME_BASE_FORCED
#if !AEO_FRAME_BASE_IS_FREE(AEO_FRAME_BASE_EXTENDED, 1)
#error "AEO_FRAME_BASE_EXTENDED is no J1939 proprietary B group; define AEO_FRAME_BASE_FORCED where no J1939 is"
#endif
#if !AEO_FRAME_BASE_IS_FREE(AEO_FRAME_BASE_STANDARD, 0)
#error "AEO_FRAME_BASE_STANDARD is used by CANopen; define AEO_FRAME_BASE_FORCED where no CANopen is"
#endif
#endif

#define AEO_FRAME_VALUES_MAX 14 /* values in a CAN FD frame of 64 bytes */

/* Longest classic frame of 8 bytes on the bus in bits, 29 and 11 bit identifier: the bits from start of frame to the
 * end of the CRC, 54 + 64 or 34 + 64, one stuffed bit for each four of them after the first, and 13 for CRC delimiter,
 * acknowledgement, end of frame and the space to the next. */
#define AEO_FRAME_BITS_EXTENDED 160u
#define AEO_FRAME_BITS_STANDARD 135u

/* Longest CAN FD frame of `length` bytes in bits of the nominal rate, when the data phase is `ratio` times as fast.
 * Source: ISO 11898-1:2015, 10.4.
 *   nominal   start, 11 identifier, RRS, IDE, FDF, res, BRS: 17; 29 bit: 19 more (SRR and 18 identifier)
 *             one stuffed bit for each four after the first: 4 of 17, 8 of 36
 *             CRC delimiter 2, acknowledgement 2 and its delimiter, end of frame 7, space 3: 15      36 or 59 in all
 *   data      ESI, 4 length code, 8 length, and what remains of the stuffed bits, (all bits - 1) / 4 - 4 or 8:
 *             10 length + 6 or 7
 *             4 stuff count, 17 CRC and 6 fixed stuffed bits; above 16 bytes 21 CRC and 7             27 or 32 */
#define AEO_FRAME_FD_BITS_EXTENDED(length, ratio) (59u + AEO_FRAME_FD_DATA((length), 7u, (ratio)))
#define AEO_FRAME_FD_BITS_STANDARD(length, ratio) (36u + AEO_FRAME_FD_DATA((length), 6u, (ratio)))
#define AEO_FRAME_FD_DATA(length, head, ratio)                                                                         \
    ((10u * (unsigned)(length) + (head) + ((length) > 16u ? 32u : 27u) + (unsigned)(ratio)-1u) / (unsigned)(ratio))

/* Bytes of the CAN FD frame that carries so many values, 1 ... 14. */
#define AEO_FRAME_FD_LENGTH(values)                                                                                    \
    ((values) <= 4u ? 8u + 4u * (unsigned)(values) : (values) <= 6u ? 32u : (values) <= 10u ? 48u : 64u)

/* aeo_can_frame_t.flags */
#define AEO_CAN_EXTENDED 1u /* 29 bit identifier */
#define AEO_CAN_FD       2u /* CAN FD frame */
#define AEO_CAN_BRS      4u /* CAN FD data phase at the fast rate */

typedef enum {
    AEO_KIND_HEALTH = 0,
    AEO_KIND_DESCRIPTION = 1,
    AEO_KIND_SAMPLE = 2,
    AEO_KIND_INNOVATION = 3,
    AEO_KIND_BEGIN = 4,
    AEO_KIND_PARAMETER = 5,
    AEO_KIND_REPAIR = 6,
    AEO_KIND_END = 7,
    AEO_KIND_SEAL = 8,
    AEO_KIND_SAMPLE_FD = 10,
    AEO_KIND_INNOVATION_FD = 11,
    AEO_KIND_PARAMETER_FD = 13,
    AEO_KIND_REPAIR_FD = 14
} aeo_kind_t;

#define AEO_KIND_LIMIT 16u /* kinds are below; those that are not listed do not exist */
#define AEO_KIND_FD    8u  /* from a classic kind to its CAN FD form */

/* tag of a seal: bit 7 tells innovations from samples */
#define AEO_SEAL_INNOVATION 0x80u

/* tag of a description message */
typedef enum {
    AEO_ITEM_WIRE = 0,        /* index: wire version (this item never changes its place); value: configuration hash */
    AEO_ITEM_SHAPE = 1,       /* index: model set; value: inputs, outputs, scheduling, values a frame (1, on
                                 CAN FD 14), a byte each */
    AEO_ITEM_PARAMETERS = 2,  /* index: past window p; value: number of parameters */
    AEO_ITEM_SAMPLE_TIME = 3, /* index: every how many samples one is sent, 0 none; value: binary32 s */
    AEO_ITEM_FORGETTING = 4,  /* value: binary32 lambda */
    AEO_ITEM_REGULARISATION = 5, /* value: binary32 rho */
    AEO_ITEM_FEEDTHROUGH = 6,    /* value: bit j set: input j has a current-sample parameter */
    AEO_ITEM_OFFSET = 7,         /* index: channel; value: binary32, the channel's unit */
    AEO_ITEM_SCALE = 8,          /* index: channel; value: binary32, the channel's unit */
    AEO_ITEM_NAME = 9,           /* index: channel + 256 * part; value: four characters, zero after the end */
    AEO_ITEM_UNIT = 10,          /* as the name */
    AEO_ITEM_COUNT = 11
} aeo_item_t;

/* tag of a health message: the newest sample index; the streamer's counters sent, refused, dropped, snapshots, busy;
 * from AEO_HEALTH_FILTER on up to nine counters of the filter */
#define AEO_HEALTH_INDEX     0u
#define AEO_HEALTH_SENT      1u
#define AEO_HEALTH_REFUSED   2u
#define AEO_HEALTH_DROPPED   3u
#define AEO_HEALTH_SNAPSHOTS 4u
#define AEO_HEALTH_BUSY      5u
#define AEO_HEALTH_FILTER    8u
/* Bit 15 of the flags of a health message: the node has ended its stream on purpose. The others are the filter's. */
#define AEO_HEALTH_STOPPED 0x8000u

/* One CAN frame as ports send it. */
typedef struct {
    uint32_t id;      /* identifier, 0 ... 2^29 - 1 or 0 ... 2^11 - 1 */
    uint8_t length;   /* bytes in data: 0 ... 8, on CAN FD also 12, 16, 20, 24, 32, 48, 64 */
    uint8_t flags;    /* AEO_CAN_... */
    uint8_t data[64]; /* the first `length` count */
} aeo_can_frame_t;

/* Added to aeo_address_t.extended: send at a base that CANopen or J1939 use. Only where none of their devices is. */
#define AEO_ADDRESS_FORCED 2u

/* Where a node sits in the identifiers. */
typedef struct {
    uint32_t base;    /* AEO_FRAME_BASE_EXTENDED to start with; a higher number gives way to other traffic */
    uint8_t node;     /* 0 ... 253 with 29 bits: on J1939 the source address that was claimed; with 11 bits 0 ... 3, 0
                         ... 15 where the base is a multiple of 0x100; two nodes on one bus differ here */
    uint8_t extended; /* 1: 29 bit identifiers, 0: 11 bit; + AEO_ADDRESS_FORCED */
} aeo_address_t;

/* One message; on CAN FD `count` values. */
typedef struct {
    aeo_kind_t kind;
    uint8_t tag;
    uint16_t index;
    uint8_t count;                        /* 1 for classic kinds; 1 ... 14 for CAN FD kinds */
    uint32_t value[AEO_FRAME_VALUES_MAX]; /* bit patterns; aeo_float_bits for numbers */
} aeo_message_t;

#ifdef AEO_REAL_DOUBLE
#define aeo_float_bits aeo_float_bits_f64
#endif

/* Pack `message` into `frame` for the node at `address`; CAN FD kinds make a CAN FD frame with the fast data phase.
 * AEO_E_ARG: null pointer, base without room for kinds and node or used by others and not forced, node too high, kind
 * that does not exist, count that does not fit it. */
aeo_status_t aeo_frame_pack(const aeo_address_t *address, const aeo_message_t *message, aeo_can_frame_t *frame);

/* Unpack `frame` into `message` if it belongs to any node at address->base; its number goes to *node.
 * AEO_E_ARG: null pointer or bad base. AEO_E_MISMATCH: a frame of somebody else (identifier, flags, length).
 * AEO_E_DAMAGED: the check is wrong, or the count does not fit the length. On failure message and node are unchanged.
 */
aeo_status_t aeo_frame_unpack(const aeo_address_t *address, const aeo_can_frame_t *frame, aeo_message_t *message,
                              uint8_t *node);

/* Return the binary32 pattern of a number; the double build rounds to nearest first. */
uint32_t aeo_float_bits(aeo_real_t value);

/* Continue a CRC-32 (IEEE 802.3, reflected) with the four bytes of `word`, least significant first. Start and finish
 * with an inversion: crc = ~0; crc = aeo_frame_crc32(crc, w) ...; ~crc. */
uint32_t aeo_frame_crc32(uint32_t crc, uint32_t word);

/* Return word `word` (0, 1, ...) of the set drawn for repair number `repair`: bit j stands for member 32 * word + j. An
 * integer hash and not a shift register: sets drawn linearly from 32 bits would span 32 dimensions only. */
uint32_t aeo_frame_repair_set(uint16_t repair, uint32_t word);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
