/* fdcan_port.c: frames into the TX FIFO and out of the RX FIFO, and what the interrupt does; see fdcan_port.h. */
#include "fdcan_registers.h"

#include <aeolid/count.h>

#include <stddef.h>

/* Bytes by length code. */
static const uint8_t lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

/* Return the length code of a frame, or 16 for one that this port cannot send. */
static uint32_t find_code(const aeo_fdcan_t *self, const aeo_can_frame_t *frame)
{
    uint32_t code = 0;
    const int fd = (frame->flags & AEO_CAN_FD) != 0u;
    if (fd && self->config.fd == 0u) {
        return 16;
    }
    while (code < (fd ? 16u : 9u) && lengths[code] != frame->length) {
        code++;
    }
    return code < (fd ? 16u : 9u) ? code : 16u;
}

/* ---- transmission ------------------------------------------------------------------------------------------------ */

/* Write the element at the put index and request its transmission, which moves the index on. */
static void write_element(const aeo_fdcan_t *self, uint32_t index, const aeo_can_frame_t *frame)
{
    const fdcan_layout_t *layout = fdcan_layout(self);
    const uintptr_t element = self->config.memory + layout->tx + index * 4u * ELEMENT_WORDS;
    const int extended = (frame->flags & AEO_CAN_EXTENDED) != 0u, fd = (frame->flags & AEO_CAN_FD) != 0u;
    uint32_t second = ELEMENT_DLC(find_code(self, frame)), i;
    if (fd) {
        second |= ELEMENT_FDF | ((frame->flags & AEO_CAN_BRS) != 0u ? ELEMENT_BRS : 0u);
    }
    AEO_FDCAN_WRITE(element, extended ? ELEMENT_XTD | frame->id : frame->id << 18);
    AEO_FDCAN_WRITE(element + 4u, second);
    for (i = 0; i < frame->length; i += 4u) {
        const uint8_t *bytes = &frame->data[i]; /* of 64: those after the length are not sent */
        const uint32_t word = bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
        AEO_FDCAN_WRITE(element + 8u + i, word);
    }
    fdcan_write(self, layout->tx_add, UINT32_C(1) << index);
}

/* Move the oldest frame from the ring to the controller; 0 when there is none, or no room. The mask is held for one frame:
 * a more urgent context that sends finds ring and FIFO whole. */
static int move_one(aeo_fdcan_t *self)
{
    const uint32_t before = AEO_FDCAN_MASK();
    const uint32_t status = fdcan_read(self, FDCAN_TXFS), tail = self->tail;
    const int moves = self->head != tail && (status & TXFS_FULL) == 0u;
    if (moves) {
        write_element(self, TXFS_PUT(status), &self->ring[tail % AEO_FDCAN_RING]);
        self->tail = tail + 1u;
    }
    AEO_FDCAN_UNMASK(before);
    return moves;
}

/* Take a copy into the ring and push on, for a controller that has nothing to send raises no interrupt. */
static int send(void *context, const aeo_can_frame_t *frame)
{
    aeo_fdcan_t *self = (aeo_fdcan_t *)context;
    uint32_t before;
    int room;
    if (find_code(self, frame) > 15u) {
        return 0;
    }
    before = AEO_FDCAN_MASK();
    room = self->head - self->tail < AEO_FDCAN_RING;
    if (room) {
        self->ring[self->head % AEO_FDCAN_RING] = *frame;
        self->head = self->head + 1u;
    }
    AEO_FDCAN_UNMASK(before);
    (void)move_one(self);
    return room;
}

static uint32_t read_clock(void *context)
{
    return ((const aeo_fdcan_t *)context)->config.time_us();
}

static void lock(void *context)
{
    const uint32_t before = AEO_FDCAN_MASK();
    ((aeo_fdcan_t *)context)->masked = before; /* only now: the context that had the lock before has let it go */
}

static void unlock(void *context)
{
    AEO_FDCAN_UNMASK(((const aeo_fdcan_t *)context)->masked);
}

void fdcan_fill_port(aeo_fdcan_t *self, aeo_port_t *port)
{
    port->context = self;
    port->send = send;
    port->time_us = self->config.time_us != NULL ? read_clock : NULL;
    port->lock = lock;
    port->unlock = unlock;
}

uint32_t aeo_fdcan_waiting(const aeo_fdcan_t *self)
{
    return self->head - self->tail;
}

/* ---- reception --------------------------------------------------------------------------------------------------- */

int aeo_fdcan_receive(aeo_fdcan_t *self, aeo_can_frame_t *frame)
{
    const fdcan_layout_t *layout = fdcan_layout(self);
    const uint32_t status = fdcan_read(self, layout->rx_status), index = RXFS_GET(status);
    const uintptr_t element = self->config.memory + layout->rx + index * 4u * ELEMENT_WORDS;
    uint32_t first, second, i, word = 0;
    if (RXFS_LEVEL(status) == 0u) {
        return 0;
    }
    first = AEO_FDCAN_READ(element);
    second = AEO_FDCAN_READ(element + 4u);
    frame->flags = 0;
    frame->id = (first >> 18) & 0x7FFu;
    if ((first & ELEMENT_XTD) != 0u) {
        frame->flags = AEO_CAN_EXTENDED;
        frame->id = first & 0x1FFFFFFFu;
    }
    frame->length = lengths[ELEMENT_CODE(second)];
    if ((second & ELEMENT_FDF) != 0u) {
        frame->flags |= (uint8_t)(AEO_CAN_FD | ((second & ELEMENT_BRS) != 0u ? AEO_CAN_BRS : 0u));
    } else if (frame->length > 8u) {
        frame->length = 8; /* classic frames have 8 bytes at any code above */
    }
    for (i = 0; i < frame->length; i++) {
        word = i % 4u == 0u ? AEO_FDCAN_READ(element + 8u + i) : word >> 8;
        frame->data[i] = (uint8_t)(word & 0xFFu);
    }
    fdcan_write(self, layout->rx_acknowledge, index);
    return 1;
}

/* ---- what the controller tells ----------------------------------------------------------------------------------- */

int aeo_fdcan_recover(aeo_fdcan_t *self)
{
    const uint32_t control = fdcan_read(self, FDCAN_CCCR);
    if ((control & CCCR_INIT) == 0u || (fdcan_read(self, FDCAN_PSR) & PSR_BO) == 0u) {
        return 0; /* or on its way already */
    }
    fdcan_write(self, FDCAN_CCCR, control & ~(CCCR_INIT | CCCR_CCE));
    return 1;
}

aeo_fdcan_state_t aeo_fdcan_state(const aeo_fdcan_t *self)
{
    const uint32_t status = fdcan_read(self, FDCAN_PSR);
    if ((status & PSR_BO) != 0u) {
        return AEO_FDCAN_BUS_OFF;
    }
    if ((status & PSR_EP) != 0u) {
        return AEO_FDCAN_PASSIVE;
    }
    return (status & PSR_EW) != 0u ? AEO_FDCAN_WARNING : AEO_FDCAN_ACTIVE;
}

/* The flags of bus-off and error passive tell of a change, either way. The way out of bus-off comes last: until INIT reads
 * as it was written, CCCR must not be written again. */
static void heed_errors(aeo_fdcan_t *self, uint32_t flags)
{
    const fdcan_layout_t *layout = fdcan_layout(self);
    const aeo_fdcan_state_t state = aeo_fdcan_state(self);
    if ((flags & layout->memory) != 0u) {
        aeo_count_up(&self->counters.memory);
        fdcan_write(self, FDCAN_CCCR, fdcan_read(self, FDCAN_CCCR) & ~CCCR_ASM);
    }
    if ((flags & layout->bus_off) != 0u && state == AEO_FDCAN_BUS_OFF) {
        aeo_count_up(&self->counters.bus_off);
        if (self->config.recover != 0u) {
            (void)aeo_fdcan_recover(self);
        }
    }
    if ((flags & layout->passive) != 0u && state == AEO_FDCAN_PASSIVE) {
        aeo_count_up(&self->counters.passive);
    }
}

void aeo_fdcan_serve(aeo_fdcan_t *self)
{
    const fdcan_layout_t *layout = fdcan_layout(self);
    const uint32_t flags = fdcan_read(self, FDCAN_IR);
    fdcan_write(self, FDCAN_IR, flags); /* before the state is read: what happens in between raises them again */
    if ((flags & layout->lost) != 0u) {
        aeo_count_up(&self->counters.lost);
    }
    if ((flags & (layout->bus_off | layout->passive | layout->memory)) != 0u) {
        heed_errors(self, flags);
    }
    while (move_one(self)) {
    }
}
/* SPDX-License-Identifier: MIT */
