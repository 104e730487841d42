/* claim.h: holds a J1939 source address for a node: claims it, defends it, and yields it, by SAE J1939-81.
 *
 * MODEL
 *   The last byte of a 29 bit identifier is the sender's address, and on a J1939 bus nobody sends before it has claimed
 *   one with its NAME, 64 bits that no other device has; of two that want one address the lower NAME keeps it.
 *
 *     start --claim--> waiting 250 ms --> held --lower NAME claims it--> next free address, waiting; or none: lost
 *
 *   The streamer hears nothing by design, so this sits beside it: frames that arrive go to aeo_claim_receive, what is to
 *   be sent comes from aeo_claim_step, and the port that the streamer gets, aeo_claim_port, refuses every frame whose
 *   address is not held at that moment. When the address changes, the stream is started anew with the new one:
 *
 *     aeo_claim_start(&claim, &config, now_us);
 *     aeo_claim_port(&claim, &can_port, &port);
 *     for each frame that arrives: aeo_claim_receive(&claim, &frame, now_us);
 *     every few milliseconds:      while (aeo_claim_step(&claim, now_us, &frame)) {
 *                                      if (!can_port.send(can_port.context, &frame)) {
 *                                          aeo_claim_refused(&claim);
 *                                          break;
 *                                      }
 *                                  }
 *                                  if (aeo_claim_address(&claim) >= 0 && it is not the stream's) {
 *                                      wire.address.node = (uint8_t)aeo_claim_address(&claim);
 *                                      aeo_stream_init(&stream, &wire, &port, memory, words);
 *                                  }
 *
 *   Source: SAE J1939-81 (2017), 4.2 to 4.5. Deviations: the 250 ms are waited for with every address, also where the
 *   standard lets one send at once; commanded address (PGN 65240) is not obeyed.
 *   Limit: the port judges a frame when it is sent. Frames that a driver's queue or mailboxes have taken by then still
 *   leave with the old address after it is lost; keep that queue short, or empty it where the driver lets you.
 *
 * CONTRACT
 *   Memory: the structure, 104 bytes with 64 bit pointers. No heap. Nothing blocks: each call is a few dozen
 *   instructions, a change of address 250 steps at most. Threads: receive, step, start and the port's send in one
 *   context, or under the lock that keeps the streamer's contexts apart. Frames that the node itself has sent must not
 *   be given to receive: a claim with its own NAME is another device with that NAME, and both fall silent.
 */
#ifndef AEOLID_J1939_CLAIM_H
#define AEOLID_J1939_CLAIM_H

#include <aeolid/port.h>

#ifdef __cplusplus
extern "C" {
#endif

#define AEO_CLAIM_WAIT_US 250000u /* from a claim to the first message */

/* NAME: identity 0 ... 2^21 - 1 (serial number), manufacturer 0 ... 2047 (by SAE; 0 where there is none), function and
 * vehicle system of J1939 appendix B (255 and 127: not available), industry group 0 ... 5 (0 global, 5 industrial
 * process control, stationary), arbitrary 1: takes another address when it loses its own. Instances 0. */
#define AEO_CLAIM_NAME(identity, manufacturer, function, system, group, arbitrary)                                     \
    (((uint64_t)(identity)&0x1FFFFFu) | (((uint64_t)(manufacturer)&0x7FFu) << 21) |                                    \
     (((uint64_t)(function)&0xFFu) << 40) | (((uint64_t)(system)&0x7Fu) << 49) | (((uint64_t)(group)&7u) << 60) |      \
     (((uint64_t)(arbitrary)&1u) << 63))

typedef enum { AEO_CLAIM_WAITING = 0, AEO_CLAIM_HELD = 1, AEO_CLAIM_LOST = 2 } aeo_claim_state_t;

typedef struct {
    uint64_t name;   /* bit 63, arbitrary: without it a lost address is not replaced */
    uint8_t address; /* wanted first, 0 ... 253; 128 ... 247 are those that no function owns. Start: 200 */
    uint8_t lowest;  /* of those to take otherwise, 0 ... highest. Start: 128 */
    uint8_t highest; /* ... 253. Start: 247 */
} aeo_claim_config_t;

/* Private but readable in a debugger. */
typedef struct {
    aeo_claim_config_t config;
    aeo_port_t port;   /* that the streamer's frames go to */
    uint32_t since_us; /* the claim under way */
    uint32_t taken[8]; /* bit for each address that another device has claimed */
    uint32_t lost;     /* addresses yielded */
    uint8_t address;   /* held or wanted */
    uint8_t state;     /* aeo_claim_state_t */
    uint8_t owes;      /* 1: a claim, or that none can be made, is to be sent */
    uint8_t delays;    /* 1: not before a time drawn from the NAME: two that cannot claim would collide for ever */
    uint8_t announced; /* 1: the claim under way has been sent, and since_us is when */
} aeo_claim_t;

/* Begin to claim. now_us: any clock that wraps at 2^32. AEO_E_ARG: null pointer, address or range above 253, range
 * empty; self is then unchanged. */
int aeo_claim_start(aeo_claim_t *self, const aeo_claim_config_t *config, uint32_t now_us);

/* Heed a frame that has arrived: claims of others, and requests for ours; others are ignored. */
void aeo_claim_receive(aeo_claim_t *self, const aeo_can_frame_t *frame, uint32_t now_us);

/* Fill in the next frame to send and return 1, or return 0 when there is none. Call every 50 ms or more often. The frame
 * counts as sent, and a claim's 250 ms begin, unless aeo_claim_refused follows. */
int aeo_claim_step(aeo_claim_t *self, uint32_t now_us, aeo_can_frame_t *frame);

/* Say that the frame of the last step was not taken by the driver: a later step offers it again, and the 250 ms of a
 * claim begin when it leaves. Call it before anything else of self; null is ignored. */
void aeo_claim_refused(aeo_claim_t *self);

/* Return the address that is held, or -1 while there is none. */
int aeo_claim_address(const aeo_claim_t *self);

/* Fill `guarded` with callbacks that pass to `port` what has the address held, and refuse everything else. Both ports
 * are used until the end. AEO_E_ARG: null pointer, port without send. */
int aeo_claim_port(aeo_claim_t *self, const aeo_port_t *port, aeo_port_t *guarded);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
