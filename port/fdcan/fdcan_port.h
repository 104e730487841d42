/* fdcan_port.h: carries frames to and from the FDCAN controller of an STM32, by its registers alone.
 *
 * MODEL
 *     send (control task, timer) --> ring --> TX FIFO of the controller --> bus --> RX FIFO 0 --> aeo_fdcan_receive
 *                                     |            ^
 *                                     +-- aeo_fdcan_serve: the interrupt "transmission completed" moves the next ones
 *
 *   Message RAM of one instance, in words of 32 bits; an element of a FIFO holds 64 bytes in 18 words whatever it carries:
 *
 *                        G4 (also G0: fixed by the hardware)       H7 (set up by aeo_fdcan_init)
 *     11 bit filters        0 ...  27    28 of 1 word                0 ...  27    28 of 1 word
 *     29 bit filters       28 ...  43     8 of 2 words              28 ...  43     8 of 2 words
 *     RX FIFO 0            44 ...  97     3 elements                44 ... 331    16 elements
 *     RX FIFO 1            98 ... 151     3, unused                    none
 *     TX event FIFO       152 ... 157     3, unused                    none
 *     TX FIFO             158 ... 211     3 elements               332 ... 907    32 elements
 *
 *   Source of registers and rules: the reference manuals RM0440 (G4), RM0444 (G0) and RM0433 (H7), chapter "FD controller
 *   area network". Frames with one identifier leave in the order given, for the controller is used as a FIFO and nothing
 *   else is in its TX memory.
 *   Bus-off: the controller stops by itself. With `recover` the interrupt lets it wait for the 129 times 11 recessive
 *   bits of ISO 11898-1 at once, otherwise aeo_fdcan_recover does; frames that were waiting leave then.
 *   A failed access to message RAM puts the controller into a mode that does not send; the interrupt takes it out.
 *
 * CONTRACT
 *   Memory: the structure, AEO_FDCAN_RING frames of 72 bytes and 64 more, or 88 (64-bit pointers). No heap, no vendor's
 *   library. Never blocks; init waits for the controller's clock, AEO_FDCAN_TRIES readings at most.
 *   Clock of the peripheral, pins, transceiver and the interrupt's number and urgency are the program's own business.
 *   Threads and interrupts: send may be called from any context, also above the interrupt: it masks interrupts
 *   (AEO_FDCAN_MASK) while it moves one frame, as serve does. lock and unlock keep them masked while the streamer makes a
 *   frame. receive, recover and state belong to one context each.
 *   The streamer hears nothing. Filters and receive are for what goes around it, such as a J1939 address claim; without
 *   filters the controller lets nothing in.
 *   Failures: no room, a length that no frame has, CAN FD on a port that was not told so: send refuses, the streamer
 *   counts. What the controller tells is in counters.
 */
#ifndef AEOLID_FDCAN_PORT_H
#define AEOLID_FDCAN_PORT_H

#include <aeolid/port.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Frames the ring holds, a power of two, 2 ... 256; 32 to start with: one burst and one sample of many channels. */
#ifndef AEO_FDCAN_RING
#define AEO_FDCAN_RING 32u
#endif
#if AEO_FDCAN_RING < 2 || AEO_FDCAN_RING > 256 || (AEO_FDCAN_RING & (AEO_FDCAN_RING - 1)) != 0
#error "AEO_FDCAN_RING is a power of two, 2 ... 256"
#endif

/* Readings of a register until init gives up. The controller answers within some periods of its two clocks. */
#ifndef AEO_FDCAN_TRIES
#define AEO_FDCAN_TRIES 10000u
#endif

#define AEO_FDCAN_E_STUCK (-48) /* the controller does not answer: its clock is off, or the address is wrong */

/* Addresses of instance n, 1 ...; H7's third instance, where there is one, has its registers at 0x4000D400. */
#define AEO_FDCAN_G4_REGISTERS(n) (0x40006400u + 0x400u * ((n)-1u)) /* G0 too */
#define AEO_FDCAN_G4_MEMORY(n)    (0x4000A400u + 0x350u * ((n)-1u))
#define AEO_FDCAN_G0_MEMORY(n)    (0x4000B400u + 0x350u * ((n)-1u))
#define AEO_FDCAN_H7_REGISTERS(n) (0x4000A000u + 0x400u * ((n)-1u))
#define AEO_FDCAN_H7_MEMORY(n)    (0x4000AC00u + 3632u * ((n)-1u)) /* n <= 2: 10 KiB are shared */

typedef enum { AEO_FDCAN_G4 = 0, AEO_FDCAN_H7 = 1 } aeo_fdcan_family_t; /* G0 is a G4 */

/* One bit is 1 + before + after quanta of `prescaler` periods of the controller's kernel clock. */
typedef struct {
    uint16_t prescaler; /* 1 ... 512; data phase 1 ... 32 */
    uint16_t before;    /* quanta from the first to the sample point, 2 ... 256; data phase 1 ... 32 */
    uint16_t after;     /* quanta after it, 2 ... 128; data phase 1 ... 16 */
    uint16_t jump;      /* quanta of resynchronisation, 1 ... after */
} aeo_fdcan_timing_t;

/* A frame is let in when (its identifier ^ id) & mask is 0 and its kind of identifier is that of the filter. */
typedef struct {
    uint32_t id;
    uint32_t mask;
    uint8_t extended; /* 1: 29 bit identifiers */
} aeo_fdcan_filter_t;

#define AEO_FDCAN_FILTERS_STANDARD 28u
#define AEO_FDCAN_FILTERS_EXTENDED 8u

typedef struct {
    uintptr_t registers;               /* address of the instance */
    uintptr_t memory;                  /* address of its part of the message RAM */
    uint8_t family;                    /* aeo_fdcan_family_t */
    uint8_t fd;                        /* 1: CAN FD frames are sent and received, the data phase as `data` says */
    uint8_t recover;                   /* 1: leave bus-off at once; 0: only aeo_fdcan_recover does. Start: 1 */
    uint8_t filter_count;              /* at most 28 with 11 bits and 8 with 29 bits; 0: nothing is received */
    const aeo_fdcan_filter_t *filters; /* read by init alone */
    aeo_fdcan_timing_t nominal;        /* aeo_fdcan_find_timing fills it in */
    aeo_fdcan_timing_t data;           /* with fd; the same clock */
    uint32_t (*time_us)(void);         /* a clock for the streamer that wraps at 2^32; null: it counts sample times */
} aeo_fdcan_config_t;

/* Never decrease; stay at 2^32 - 1. */
typedef struct {
    uint32_t lost;    /* receptions that found the RX FIFO full; several count once where the interrupt was late */
    uint32_t passive; /* times the controller became error passive */
    uint32_t bus_off; /* times it left the bus */
    uint32_t memory;  /* failed accesses to message RAM */
} aeo_fdcan_counters_t;

typedef enum {
    AEO_FDCAN_ACTIVE = 0,
    AEO_FDCAN_WARNING = 1, /* an error counter is at 96 or above */
    AEO_FDCAN_PASSIVE = 2, /* 128 or above */
    AEO_FDCAN_BUS_OFF = 3  /* off the bus, or waiting to come back */
} aeo_fdcan_state_t;

/* Private but readable in a debugger. */
typedef struct {
    aeo_can_frame_t ring[AEO_FDCAN_RING];
    aeo_fdcan_config_t config;
    aeo_fdcan_counters_t counters;
    volatile uint32_t head; /* frames written; wraps */
    volatile uint32_t tail; /* frames moved to the TX FIFO; wraps */
    uint32_t masked;        /* what AEO_FDCAN_MASK returned to lock */
} aeo_fdcan_t;

/* Find the timing of exactly bits_per_s at a kernel clock, with as many quanta a bit as there can be and the sample
 * point within half a quantum of sample_permille thousandths, 500 ... 950 (875 for 500 kbit/s, 800 for a data phase). data: 1
 * for the data phase. AEO_E_ARG: null pointer or there is none; timing is then unchanged. */
int aeo_fdcan_find_timing(aeo_fdcan_timing_t *timing, uint32_t clock_hz, uint32_t bits_per_s, uint32_t sample_permille,
                          int data);

/* Set the controller up, let it join the bus and fill `port` with the callbacks of self. Its clock must run. With a data
 * phase of prescaler 1 or 2 the transmitter's delay is compensated. AEO_E_ARG: null pointer, setting out of its range, too
 * many filters; nothing has been written. AEO_FDCAN_E_STUCK. */
int aeo_fdcan_init(aeo_fdcan_t *self, const aeo_fdcan_config_t *config, aeo_port_t *port);

/* Serve the controller: called by the handler of its interrupt line 0. */
void aeo_fdcan_serve(aeo_fdcan_t *self);

/* Take the oldest frame received; 0 when there is none. The interrupt comes for each, and leaves them here. */
int aeo_fdcan_receive(aeo_fdcan_t *self, aeo_can_frame_t *frame);

/* Begin to leave bus-off, which takes 129 times 11 recessive bits; 0 when the controller is not in it. */
int aeo_fdcan_recover(aeo_fdcan_t *self);

/* Return what the controller says of itself. */
aeo_fdcan_state_t aeo_fdcan_state(const aeo_fdcan_t *self);

/* Return the frames in the ring, 0 ... AEO_FDCAN_RING; those in the TX FIFO are not among them. */
uint32_t aeo_fdcan_waiting(const aeo_fdcan_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
