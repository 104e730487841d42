#include "port_template.h"

/* Take a copy or refuse. The ring and not the mailbox: a controller has few mailboxes and orders them by identifier,
 * and frames with one identifier must leave in the order given. */
static int send(void *context, const aeo_can_frame_t *frame)
{
    aeo_template_t *self = (aeo_template_t *)context;
    const uint32_t head = self->head;
    if (head - self->tail >= AEO_TEMPLATE_RING) {
        return 0; /* full: the streamer counts it and offers everything but samples again */
    }
    self->ring[head % AEO_TEMPLATE_RING] = *frame;
    /* Place 1: on a core that reorders stores, a store barrier here, so that the frame is there before the head says
     * so. */
    self->head = head + 1u;
    return 1;
}

/* Place 2: read a free-running microsecond timer. Leave the callback null where there is none: the streamer then counts
 * one sample time a step. */
static uint32_t read_clock(void *context)
{
    const aeo_template_t *self = (const aeo_template_t *)context;
    return self->now_us;
}

/* Place 3: mask the interrupt or take the mutex that keeps the other context of the streamer out. It is held while
 * one frame is made and sent. Leave both null where one context does all. */
static void lock(void *context)
{
    aeo_template_t *self = (aeo_template_t *)context;
    self->locked++;
}

static void unlock(void *context)
{
    aeo_template_t *self = (aeo_template_t *)context;
    self->locked--;
}

void aeo_template_init(aeo_template_t *self, aeo_port_t *port)
{
    self->head = 0;
    self->tail = 0;
    self->now_us = 0;
    self->locked = 0;
    port->context = self;
    port->send = send;
    port->time_us = read_clock;
    port->lock = lock;
    port->unlock = unlock;
}

int aeo_template_transmit(aeo_template_t *self, aeo_can_frame_t *frame)
{
    const uint32_t tail = self->tail;
    if (self->head == tail) {
        return 0;
    }
    *frame = self->ring[tail % AEO_TEMPLATE_RING];
    self->tail = tail + 1u;
    return 1;
}
