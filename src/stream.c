#include <aeolid/stream.h>

#include <aeolid/status.h>

#include "budget.h"
#include "describe.h"
#include "linalg.h"
#include "spread.h"
#include "stream_send.h"

#include <string.h>

#define FAREWELLS        6u /* at 10 % loss fewer than two of them arrive once in 18,000 ends */
#define DESCRIPTION_TURN 4u /* one frame in so many is description while one is due and a snapshot under way */
#define HEALTH_TURN      2u /* the same of health: due more often than it can leave, it takes no more than its turn */
#define STREAM_ITEMS     5u /* own counters in health, before those of the filter */

typedef enum { PHASE_IDLE, PHASE_BEGIN, PHASE_BLOCKS, PHASE_END, PHASE_REPAIR, PHASE_CLOSE } phase_t;
typedef enum { FROM_NOTHING, FROM_DESCRIPTION, FROM_HEALTH, FROM_SNAPSHOT, FROM_FAREWELL } origin_t;

/* ---- start ------------------------------------------------------------------------------------------------------- */

static uint32_t count_blocks(const aeo_stream_config_t *config)
{
    return config->fd != 0u ? AEO_STREAM_BLOCKS(config->parameters) : config->parameters;
}

/* Bits of the longest frame in use, at which a budget may begin: no frame then takes longer than a second. */
static uint32_t find_least_budget(const aeo_stream_config_t *config)
{
    return config->fd != 0u ? 1000u : AEO_FRAME_BITS_EXTENDED;
}

static int config_is_valid(const aeo_stream_config_t *config)
{
    const unsigned m = aeo_describe_channels(config);
    const aeo_real_t h = config->sample_time_s;
    if (config->outputs < 1u || m > AEO_STREAM_CHANNELS_MAX || config->channels == NULL || config->parameters < 1u ||
        config->parameters > 65536u || config->health_every < 1u || config->describe_every < 1u ||
        config->repair_percent > 100u || config->burst < 1u || !aeo_describe_is_sound(config)) {
        return 0;
    }
    if (config->fd != 0u && (config->fd_ratio < 1u || config->fd_ratio > 16u)) {
        return 0;
    }
    return h >= AEO_REAL(2e-5) && h <= AEO_REAL(1000.0) &&
           (config->bits_per_s == 0u || config->bits_per_s >= find_least_budget(config));
}

/* Pack an empty message, which succeeds where node and base fit the identifiers. */
static int address_is_valid(const aeo_address_t *address)
{
    static const aeo_message_t probe = {AEO_KIND_HEALTH, 0, 0, 1, {0}};
    aeo_can_frame_t frame;
    return aeo_frame_pack(address, &probe, &frame) == AEO_OK;
}

aeo_status_t aeo_stream_init(aeo_stream_t *self, const aeo_stream_config_t *config, const aeo_port_t *port,
                             uint32_t *memory, uint32_t words)
{
    uint32_t steps;
    aeo_spread_t spread;
    if (self == NULL || config == NULL || port == NULL || memory == NULL || port->send == NULL ||
        (port->lock == NULL) != (port->unlock == NULL) || !config_is_valid(config) ||
        !address_is_valid(&config->address)) {
        return AEO_E_ARG;
    }
    if (words < AEO_STREAM_WORDS(config->parameters)) {
        return AEO_E_MEMORY;
    }
    aeo_spread_choose(&spread, count_blocks(config), config->repair_percent);
    steps = aeo_budget_find_steps(config, &spread, aeo_budget_count_description(config));
    if (steps == 0u || (config->snapshot_every > 0u && steps > config->snapshot_every)) {
        return AEO_E_BUDGET;
    }
    memset(self, 0, sizeof *self);
    self->config = *config;
    self->port = *port;
    self->theta = memory;
    self->frame_us = aeo_stream_cost_us(config, 8);
    self->longest_us = aeo_budget_longest_us(config);
    self->period_us = aeo_budget_period_us(config);
    self->spread = spread;
    self->snapshot_steps = steps;
    self->hash = aeo_describe_hash(config);
    aeo_stream_reset(self);
    return AEO_OK;
}

void aeo_stream_reset(aeo_stream_t *self)
{
    if (self == NULL) {
        return;
    }
    aeo_stream_lock(self);
    self->phase = PHASE_IDLE;
    self->slot = 0;
    self->described = 0;
    self->describing = 1;
    self->turn = 0;
    self->health_turn = HEALTH_TURN;
    self->describe_in = self->config.describe_every;
    self->health_in = self->config.health_every;
    self->health_item = 0;
    self->flags = 0;
    self->counters_used = 0;
    self->finishing = 0;
    self->farewells = 0;
    self->credit_us = 0;
    self->clock_us = self->port.time_us != NULL ? self->port.time_us(self->port.context) : 0u;
    aeo_stream_unlock(self);
}

/* ---- what the control task brings -------------------------------------------------------------------------------- */

/* Move on to `phase` and return AEO_OK, unless a snapshot is under way or the end is announced: that is counted. */
static aeo_status_t go_on(aeo_stream_t *self, phase_t phase)
{
    aeo_stream_lock(self);
    const int idle = self->phase == PHASE_IDLE && self->finishing == 0u;
    if (idle) {
        self->phase = (uint8_t)phase;
    } else {
        aeo_count_up(&self->counters.busy);
    }
    aeo_stream_unlock(self);
    return idle ? AEO_OK : AEO_E_BUSY;
}

/* The copy is made without the lock: an idle step reads nothing written here. Meanwhile the end may be announced. */
aeo_status_t aeo_stream_snapshot(aeo_stream_t *self, uint32_t index, const aeo_real_t *theta)
{
    if (self == NULL || theta == NULL) {
        return AEO_E_ARG;
    }
    if (go_on(self, PHASE_IDLE) != AEO_OK) {
        return AEO_E_BUSY;
    }
    self->number = (uint8_t)((self->number + 1u) & 0xFFu);
    self->taken_index = index;
    uint32_t crc = aeo_frame_crc32(UINT32_C(0xFFFFFFFF), self->number | ((self->config.parameters - 1u) << 8) |
                                                             ((uint32_t)self->config.address.node << 24));
    crc = aeo_frame_crc32(crc, index);
    for (uint32_t i = 0; i < self->config.parameters; i++) {
        self->theta[i] = aeo_float_bits(theta[i]);
        crc = aeo_frame_crc32(crc, self->theta[i]);
    }
    self->crc = ~crc;
    self->cursor = 0;
    return go_on(self, PHASE_BEGIN);
}

aeo_status_t aeo_stream_health(aeo_stream_t *self, uint32_t flags, const uint32_t *counter, unsigned count)
{
    if (self == NULL || count > AEO_STREAM_COUNTERS || (counter == NULL && count > 0u)) {
        return AEO_E_ARG;
    }
    aeo_stream_lock(self);
    self->flags = (uint16_t)(flags & 0x7FFFu);
    if (count > 0u) {
        memcpy(self->counter, counter, count * sizeof *counter);
    }
    self->counters_used = (uint8_t)count;
    aeo_stream_unlock(self);
    return AEO_OK;
}

/* ---- the step ---------------------------------------------------------------------------------------------------- */

static uint32_t find_width(const aeo_stream_t *self)
{
    return self->config.fd != 0u ? AEO_FRAME_VALUES_MAX : 1u;
}

/* Without the lock, for it is long: while a snapshot is under way the step alone moves cursor and phase, and nobody
 * writes theta. */
static void prepare_repair(aeo_stream_t *self)
{
    aeo_spread_repair(&self->spread, self->theta, self->config.parameters, find_width(self), (uint16_t)self->cursor,
                      self->ahead.value);
}

/* Parameters of the block at the cursor, or the combination prepared. */
static void choose_block(aeo_stream_t *self)
{
    const int fd = self->config.fd != 0u, repairs = self->phase == PHASE_REPAIR;
    const uint32_t width = find_width(self), parameters = self->config.parameters;
    const unsigned kind = repairs ? AEO_KIND_REPAIR : AEO_KIND_PARAMETER;
    aeo_message_t *message = &self->message;
    message->kind = (aeo_kind_t)(kind + (fd ? AEO_KIND_FD : 0u));
    if (repairs) {
        message->index = (uint16_t)self->cursor;
        message->count = (uint8_t)width;
        memcpy(message->value, self->ahead.value, width * sizeof *message->value);
    } else {
        const uint32_t first = aeo_spread_index(&self->spread, self->cursor) * width; /* below parameters */
        message->index = (uint16_t)first;
        message->count = (uint8_t)(parameters - first < width ? parameters - first : width);
        memcpy(message->value, &self->theta[first], message->count * sizeof *message->value);
    }
}

static void choose_snapshot(aeo_stream_t *self)
{
    aeo_message_t *message = &self->message;
    message->tag = self->number;
    switch ((phase_t)self->phase) {
    case PHASE_BEGIN:
        message->kind = AEO_KIND_BEGIN;
        message->index = (uint16_t)(self->config.parameters - 1u);
        message->value[0] = self->taken_index;
        break;
    case PHASE_BLOCKS:
    case PHASE_REPAIR:
        choose_block(self);
        break;
    case PHASE_END:
    case PHASE_CLOSE:
    case PHASE_IDLE:
    default:
        message->kind = AEO_KIND_END;
        message->index = (uint16_t)(self->taken_index & 0xFFFFu);
        message->value[0] = self->crc;
        break;
    }
}

static void choose_health(aeo_stream_t *self)
{
    const uint32_t own[STREAM_ITEMS] = {self->counters.sent, self->counters.refused, self->counters.dropped,
                                        self->counters.snapshots, self->counters.busy};
    /* every second frame tells the sample index: it dates the flags and lets late joiners count samples in full */
    const unsigned item = self->health_item % 2u == 0u ? AEO_HEALTH_INDEX : 1u + self->health_item / 2u;
    aeo_message_t *message = &self->message;
    message->kind = AEO_KIND_HEALTH;
    message->index = self->flags;
    if (item == AEO_HEALTH_INDEX) {
        message->tag = AEO_HEALTH_INDEX;
        message->value[0] = self->last_index;
    } else if (item <= STREAM_ITEMS) {
        message->tag = (uint8_t)item;
        message->value[0] = own[item - 1u];
    } else {
        message->tag = (uint8_t)(item - 1u - STREAM_ITEMS + AEO_HEALTH_FILTER);
        message->value[0] = self->counter[item - 1u - STREAM_ITEMS];
    }
}

/* Decide what leaves next; the state moves in `commit` alone, so a refusal repeats the very same message. */
static origin_t choose(aeo_stream_t *self)
{
    aeo_message_t *message = &self->message;
    const int due = self->describing != 0u && (self->phase == PHASE_IDLE || self->turn >= DESCRIPTION_TURN - 1u);
    memset(message, 0, sizeof *message);
    message->count = 1;
    if (aeo_stream_has_ended(self)) {
        return FROM_NOTHING;
    }
    if (self->described != 0u && self->health_in == 0u &&
        (self->phase == PHASE_IDLE || self->health_turn >= HEALTH_TURN - 1u)) {
        choose_health(self);
        return FROM_HEALTH;
    }
    if (self->described == 0u || (due && self->finishing == 0u)) {
        (void)aeo_describe(&self->config, self->hash, self->slot, message); /* no empty slot is left here */
        return FROM_DESCRIPTION;
    }
    if (self->phase != PHASE_IDLE) {
        choose_snapshot(self);
        return FROM_SNAPSHOT;
    }
    if (self->finishing != 0u && self->farewells > 0u) {
        message->kind = AEO_KIND_HEALTH;
        message->index = (uint16_t)(self->flags | AEO_HEALTH_STOPPED);
        message->value[0] = self->last_index;
        return FROM_FAREWELL;
    }
    return FROM_NOTHING;
}

static void commit_snapshot(aeo_stream_t *self)
{
    static const uint8_t next[] = {PHASE_IDLE, PHASE_BLOCKS, PHASE_END, PHASE_REPAIR, PHASE_CLOSE, PHASE_IDLE};
    uint32_t length = 1;
    if (self->phase == PHASE_BLOCKS) {
        length = self->spread.count;
    } else if (self->phase == PHASE_REPAIR) {
        length = self->spread.repairs;
    } else if (self->phase == PHASE_CLOSE) {
        length = 2;
    }
    if (++self->cursor < length) {
        return;
    }
    self->cursor = 0;
    if (self->phase == PHASE_CLOSE) {
        aeo_count_up(&self->counters.snapshots);
    }
    self->phase = next[self->phase];
    if (self->phase == PHASE_REPAIR && self->spread.repairs == 0u) {
        self->phase = PHASE_CLOSE;
    }
}

/* Pass empty slots, so that the end of a description is seen when it happens; without the lock, for 64 channels without
 * a name have hundreds, and the slot is the step's own. */
static void pass_empty_slots(aeo_stream_t *self)
{
    const uint32_t slots = aeo_describe_slots(&self->config);
    uint32_t slot = self->slot;
    while (slot < slots && !aeo_describe(&self->config, self->hash, slot, &self->ahead)) {
        slot++;
    }
    aeo_stream_lock(self);
    self->slot = slot;
    if (slot >= slots) {
        self->slot = 0;
        self->described = 1;
        self->describing = 0;
        self->describe_in = self->config.describe_every;
    }
    aeo_stream_unlock(self);
}

static void commit(aeo_stream_t *self, origin_t origin)
{
    switch (origin) {
    case FROM_DESCRIPTION:
        self->turn = 0;
        self->slot++; /* perhaps to an empty one: pass_empty_slots follows */
        break;
    case FROM_HEALTH:
        self->health_in = self->config.health_every;
        self->health_turn = 0;
        self->health_item = (uint8_t)((self->health_item + 1u) % (2u * (STREAM_ITEMS + self->counters_used)));
        break;
    case FROM_SNAPSHOT:
        self->turn = (uint8_t)(self->turn < 255u ? self->turn + 1u : 255u);
        self->health_turn = HEALTH_TURN;
        commit_snapshot(self);
        break;
    case FROM_FAREWELL:
        self->farewells--;
        break;
    case FROM_NOTHING:
    default:
        break;
    }
}

static void count_down(uint16_t *steps)
{
    if (*steps > 0u) {
        (*steps)--;
    }
}

/* Earn credit for the time since the last step; never more than one burst, so that silence is not saved up. */
static void earn(aeo_stream_t *self)
{
    const int32_t most = (int32_t)(self->config.burst * self->longest_us); /* 255 * 10^6 < 2^31 */
    uint32_t passed = self->period_us;
    if (self->port.time_us != NULL) {
        const uint32_t now = self->port.time_us(self->port.context);
        passed = now - self->clock_us;
        self->clock_us = now;
    }
    if (self->frame_us == 0u || passed > 1000000000u) {
        self->credit_us = most;
    } else {
        self->credit_us += (int32_t)passed; /* most + 10^9 < 2^31 */
        self->credit_us = self->credit_us > most ? most : self->credit_us;
    }
    count_down(&self->health_in);
    count_down(&self->describe_in);
    if (self->describe_in == 0u) {
        self->describing = 1;
    }
}

/* Send one frame and prepare what the next one needs; 0 when there is none or the port refused it. */
static int send_next(aeo_stream_t *self)
{
    origin_t origin;
    int taken = 0, repairs;
    aeo_stream_lock(self);
    origin = self->credit_us >= (int32_t)self->longest_us ? choose(self) : FROM_NOTHING;
    if (origin != FROM_NOTHING) {
        taken = aeo_stream_send(self);
        if (taken) {
            commit(self, origin);
        } else {
            aeo_count_up(&self->counters.refused);
        }
    }
    repairs = self->phase == PHASE_REPAIR;
    aeo_stream_unlock(self);
    if (taken && origin == FROM_DESCRIPTION) {
        pass_empty_slots(self);
    }
    if (taken && repairs && (origin == FROM_SNAPSHOT || origin == FROM_DESCRIPTION)) {
        prepare_repair(self); /* empty slots are tried where the values of the repair lay */
    }
    return taken;
}

int aeo_stream_step(aeo_stream_t *self)
{
    int sent = 0;
    if (self == NULL) {
        return AEO_E_ARG;
    }
    aeo_stream_lock(self);
    earn(self);
    aeo_stream_unlock(self);
    while (sent < (int)self->config.burst && send_next(self)) {
        sent++;
    }
    return sent;
}

void aeo_stream_finish(aeo_stream_t *self)
{
    if (self == NULL) {
        return;
    }
    aeo_stream_lock(self);
    if (self->finishing == 0u) {
        self->finishing = 1;
        self->farewells = FAREWELLS;
    }
    aeo_stream_unlock(self);
}

uint32_t aeo_stream_snapshot_steps(const aeo_stream_t *self)
{
    return self != NULL ? self->snapshot_steps : 0u;
}

int aeo_stream_pending(const aeo_stream_t *self)
{
    int pending;
    if (self == NULL) {
        return 0;
    }
    aeo_stream_lock(self);
    pending = self->described == 0u || self->phase != PHASE_IDLE || (self->finishing != 0u && self->farewells > 0u);
    aeo_stream_unlock(self);
    return pending;
}
