/* port_template.h: shows what a port consists of; copy the directory and fill in the three marked places of the source.
 *
 * MODEL
 *   A ring of frames between the streamer and the transmit interrupt of the CAN controller (drawing in port.h):
 *
 *     send (control task, timer) --> ring --> aeo_template_transmit (interrupt: a mailbox is free)
 *
 * CONTRACT
 *   Memory: AEO_TEMPLATE_RING frames of 72 bytes in the structure. One writer (the streamer, kept single by lock where
 *   two contexts send) and one reader (the interrupt) share head and tail, each written by one side only.
 *   Never blocks. Thread and interrupt rule: send in the streamer's contexts, transmit in the interrupt.
 */
#ifndef AEOLID_PORT_TEMPLATE_H
#define AEOLID_PORT_TEMPLATE_H

#include <aeolid/port.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Frames the ring holds, a power of two, 2 ... 256; 32 to start with: one burst and one sample of many channels. */
#define AEO_TEMPLATE_RING 32u

typedef struct {
    aeo_can_frame_t ring[AEO_TEMPLATE_RING];
    volatile uint32_t head; /* frames written, by send alone; wraps */
    volatile uint32_t tail; /* frames read, by transmit alone; wraps */
    uint32_t now_us;        /* stands for a hardware timer */
    uint32_t locked;        /* stands for the interrupt mask */
} aeo_template_t;

/* Empty the ring and fill `port` with the callbacks of self. */
void aeo_template_init(aeo_template_t *self, aeo_port_t *port);

/* Take the oldest frame for a free mailbox; 0 when there is none. Called by the transmit interrupt. */
int aeo_template_transmit(aeo_template_t *self, aeo_can_frame_t *frame);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
