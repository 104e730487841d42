#include "claim.h"

#include <aeolid/count.h>
#include <aeolid/status.h>

#include <string.h>

#define HIGHEST_ADDRESS 253u
#define NULL_ADDRESS    254u
#define GLOBAL_ADDRESS  255u
#define GROUP_MASK      UINT32_C(0x03FF0000) /* pages and format, without priority, destination and source */
#define CLAIMED         UINT32_C(0x00EE0000) /* PGN 60928 */
#define REQUEST         UINT32_C(0x00EA0000) /* PGN 59904 */
#define PRIORITY        UINT32_C(0x18000000) /* 6 */
#define NAME_BYTES      8u
#define DELAY_STEP_US   600u /* SAE J1939-81, 4.4.4.3: 0 to 153 ms */

static int is_taken(const aeo_claim_t *self, unsigned address)
{
    return (self->taken[address / 32u] >> (address % 32u) & 1u) != 0u;
}

static void claim(aeo_claim_t *self, uint32_t now_us)
{
    self->state = (uint8_t)AEO_CLAIM_WAITING;
    self->since_us = now_us;
    self->owes = 1;
    self->delays = 0;
    self->announced = 0;
}

int aeo_claim_start(aeo_claim_t *self, const aeo_claim_config_t *config, uint32_t now_us)
{
    if (self == NULL || config == NULL || config->address > HIGHEST_ADDRESS || config->highest > HIGHEST_ADDRESS ||
        config->lowest > config->highest) {
        return AEO_E_ARG;
    }
    self->config = *config;
    self->address = config->address;
    self->lost = 0;
    memset(self->taken, 0, sizeof self->taken);
    claim(self, now_us);
    return AEO_OK;
}

/* Look for another address, from the one lost upwards and round, so that neighbours in trouble do not meet again. */
static void yield(aeo_claim_t *self, uint32_t now_us)
{
    const unsigned lowest = self->config.lowest, count = self->config.highest - lowest + 1u;
    const unsigned from =
        self->address >= lowest && self->address <= self->config.highest ? self->address - lowest : 0u;
    unsigned i;
    aeo_count_up(&self->lost);
    for (i = 0; (self->config.name >> 63) != 0u && i < count; i++) {
        const unsigned next = lowest + (from + i) % count;
        if (!is_taken(self, next)) {
            self->address = (uint8_t)next;
            claim(self, now_us);
            return;
        }
    }
    self->state = (uint8_t)AEO_CLAIM_LOST;
    self->since_us = now_us;
    self->owes = 1;
    self->delays = 1;
}

static uint64_t read_name(const aeo_can_frame_t *frame)
{
    uint64_t name = 0;
    unsigned i;
    for (i = 0; i < NAME_BYTES; i++) {
        name |= (uint64_t)frame->data[i] << (8u * i);
    }
    return name;
}

static void heed_claim(aeo_claim_t *self, unsigned address, uint64_t name, uint32_t now_us)
{
    if (address > HIGHEST_ADDRESS) {
        return; /* of one that could not claim */
    }
    if (address != self->address || self->state == (uint8_t)AEO_CLAIM_LOST) {
        self->taken[address / 32u] |= UINT32_C(1) << (address % 32u);
    } else if (name > self->config.name) {
        self->owes = 1; /* defend */
    } else {
        self->taken[address / 32u] |= UINT32_C(1) << (address % 32u);
        if (name == self->config.name) {
            self->config.name &= ~(UINT64_C(1) << 63); /* two devices of one NAME would chase each other: fall silent */
            yield(self, now_us);
            self->config.name = name;
        } else {
            yield(self, now_us);
        }
    }
}

void aeo_claim_receive(aeo_claim_t *self, const aeo_can_frame_t *frame, uint32_t now_us)
{
    unsigned destination;
    uint32_t group;
    if (self == NULL || frame == NULL || (frame->flags & (AEO_CAN_EXTENDED | AEO_CAN_FD)) != AEO_CAN_EXTENDED) {
        return;
    }
    destination = (frame->id >> 8) & 0xFFu;
    group = frame->id & GROUP_MASK;
    if (group == CLAIMED && destination == GLOBAL_ADDRESS && frame->length == NAME_BYTES) {
        heed_claim(self, frame->id & 0xFFu, read_name(frame), now_us);
    } else if (group == REQUEST && frame->length >= 3u && frame->data[0] == 0x00u && frame->data[1] == 0xEEu &&
               frame->data[2] == 0x00u &&
               (destination == GLOBAL_ADDRESS ||
                (destination == self->address && self->state != (uint8_t)AEO_CLAIM_LOST))) {
        if (self->state == (uint8_t)AEO_CLAIM_LOST && self->owes == 0u) {
            self->delays = 1;
            self->since_us = now_us;
        }
        self->owes = 1;
    }
}

static uint32_t delay_us(const aeo_claim_t *self)
{
    uint64_t mixed = self->config.name * UINT64_C(0x9E3779B97F4A7C15); /* golden ratio: all bits reach the top ones */
    return (uint32_t)(mixed >> 56) * DELAY_STEP_US;
}

int aeo_claim_step(aeo_claim_t *self, uint32_t now_us, aeo_can_frame_t *frame)
{
    unsigned i;
    if (self == NULL || frame == NULL) {
        return 0;
    }
    if (self->state == (uint8_t)AEO_CLAIM_WAITING && self->announced != 0u &&
        now_us - self->since_us >= AEO_CLAIM_WAIT_US) {
        self->state = (uint8_t)AEO_CLAIM_HELD;
    }
    if (self->owes == 0u || (self->delays != 0u && now_us - self->since_us < delay_us(self))) {
        return 0;
    }
    if (self->state == (uint8_t)AEO_CLAIM_WAITING && self->announced == 0u) {
        self->since_us = now_us; /* the wait begins when the claim leaves */
        self->announced = 1;
    }
    self->owes = 0;
    self->delays = 0;
    memset(frame, 0, sizeof *frame);
    frame->id = PRIORITY | CLAIMED | GLOBAL_ADDRESS << 8 |
                (self->state == (uint8_t)AEO_CLAIM_LOST ? NULL_ADDRESS : self->address);
    frame->length = NAME_BYTES;
    frame->flags = AEO_CAN_EXTENDED;
    for (i = 0; i < NAME_BYTES; i++) {
        frame->data[i] = (uint8_t)(self->config.name >> (8u * i) & 0xFFu);
    }
    return 1;
}

void aeo_claim_refused(aeo_claim_t *self)
{
    if (self == NULL) {
        return;
    }
    self->owes = 1;
    if (self->state == (uint8_t)AEO_CLAIM_WAITING) {
        self->announced = 0; /* the wait begins when a claim leaves */
    }
}

int aeo_claim_address(const aeo_claim_t *self)
{
    return self != NULL && self->state == (uint8_t)AEO_CLAIM_HELD ? self->address : -1;
}

/* ---- the streamer's port ----------------------------------------------------------------------------------------- */

static int send_guarded(void *context, const aeo_can_frame_t *frame)
{
    aeo_claim_t *self = (aeo_claim_t *)context;
    const int address = aeo_claim_address(self);
    if (address < 0 || (frame->flags & AEO_CAN_EXTENDED) == 0u || (int)(frame->id & 0xFFu) != address) {
        return 0;
    }
    return self->port.send(self->port.context, frame);
}

static uint32_t time_guarded(void *context)
{
    const aeo_claim_t *self = (const aeo_claim_t *)context;
    return self->port.time_us(self->port.context);
}

static void lock_guarded(void *context)
{
    const aeo_claim_t *self = (const aeo_claim_t *)context;
    self->port.lock(self->port.context);
}

static void unlock_guarded(void *context)
{
    const aeo_claim_t *self = (const aeo_claim_t *)context;
    self->port.unlock(self->port.context);
}

int aeo_claim_port(aeo_claim_t *self, const aeo_port_t *port, aeo_port_t *guarded)
{
    if (self == NULL || port == NULL || guarded == NULL || port->send == NULL) {
        return AEO_E_ARG;
    }
    self->port = *port;
    guarded->context = self;
    guarded->send = send_guarded;
    guarded->time_us = port->time_us != NULL ? time_guarded : NULL;
    guarded->lock = port->lock != NULL ? lock_guarded : NULL;
    guarded->unlock = port->unlock != NULL ? unlock_guarded : NULL;
    return AEO_OK;
}
