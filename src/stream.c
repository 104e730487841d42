#include <aeolid/stream.h>

#include <aeolid/status.h>

#include "describe.h"
#include "spread.h"

#include <string.h>

#define FAREWELLS        4u /* at 10 % loss all of them vanish once in 10^4 ends */
#define DESCRIPTION_TURN 4u /* one frame in so many is description while one is due */
#define STREAM_ITEMS     5u /* own counters in health, before those of the filter */

typedef enum { PHASE_IDLE, PHASE_BEGIN, PHASE_BLOCKS, PHASE_END, PHASE_REPAIR, PHASE_CLOSE } phase_t;
typedef enum { FROM_NOTHING, FROM_DESCRIPTION, FROM_HEALTH, FROM_SNAPSHOT, FROM_FAREWELL } origin_t;

static void lock(const aeo_stream_t *self)
{
    if (self->port.lock != NULL) {
        self->port.lock(self->port.context);
    }
}

static void unlock(const aeo_stream_t *self)
{
    if (self->port.unlock != NULL) {
        self->port.unlock(self->port.context);
    }
}

/* Pack and hand over one message; 1 when the port took it. The address was checked at init, so packing cannot fail. */
static int send_message(aeo_stream_t *self, const aeo_message_t *message)
{
    aeo_can_frame_t frame;
    if (aeo_frame_pack(&self->config.address, message, &frame) != AEO_OK ||
        !self->port.send(self->port.context, &frame)) {
        return 0;
    }
    self->counters.sent++;
    self->credit_us -= (int32_t)self->frame_us;
    return 1;
}

/* ---- start ------------------------------------------------------------------------------------------------------- */

static int config_is_valid(const aeo_stream_config_t *config)
{
    const unsigned m = aeo_describe_channels(config);
    const aeo_real_t h = config->sample_time_s;
    if (config->outputs < 1u || m > AEO_STREAM_CHANNELS_MAX || config->channels == NULL || config->parameters < 1u ||
        config->parameters > 65536u || config->health_every < 1u || config->describe_every < 1u ||
        config->repair_percent > 100u || config->burst < 1u || !aeo_describe_is_sound(config)) {
        return 0;
    }
    return h >= AEO_REAL(2e-5) && h <= AEO_REAL(1000.0) &&
           (config->bits_per_s == 0u || config->bits_per_s >= AEO_FRAME_BITS_EXTENDED);
}

static uint32_t cost_frame_us(const aeo_stream_config_t *config)
{
    const uint32_t bits = config->address.extended != 0u ? AEO_FRAME_BITS_EXTENDED : AEO_FRAME_BITS_STANDARD;
    /* 160e6 < 2^32; rounding up keeps the share below its limit; at most 10^6 us because bits_per_s >= 160 */
    return config->bits_per_s == 0u ? 0u : (bits * 1000000u + config->bits_per_s - 1u) / config->bits_per_s;
}

int aeo_stream_init(aeo_stream_t *self, const aeo_stream_config_t *config, const aeo_port_t *port, uint32_t *memory,
                    uint32_t words)
{
    static const aeo_message_t probe = {AEO_KIND_HEALTH, 0, 0, 1, {0}};
    aeo_can_frame_t frame;
    uint32_t frame_us, period_us, frames;
    if (self == NULL || config == NULL || port == NULL || memory == NULL || port->send == NULL ||
        (port->lock == NULL) != (port->unlock == NULL) || !config_is_valid(config) ||
        aeo_frame_pack(&config->address, &probe, &frame) != AEO_OK) {
        return AEO_E_ARG;
    }
    if (words < AEO_STREAM_WORDS(config->parameters)) {
        return AEO_E_MEMORY;
    }
    frame_us = cost_frame_us(config);
    period_us = (uint32_t)(config->sample_time_s * AEO_REAL(1e6) + AEO_REAL(0.5));               /* at most 10^9 */
    frames = aeo_describe_channels(config) + (config->innovations != 0u ? config->outputs : 0u); /* at most 128 */
    if (config->sample_every > 0u && frames * frame_us / config->sample_every > period_us / 10u * 9u) {
        return AEO_E_BUDGET;
    }
    memset(self, 0, sizeof *self);
    self->config = *config;
    self->port = *port;
    self->theta = memory;
    self->frame_us = frame_us;
    self->period_us = period_us;
    self->hash = aeo_describe_hash(config);
    aeo_spread_choose(&self->spread, config->parameters, config->repair_percent);
    aeo_stream_reset(self);
    return AEO_OK;
}

void aeo_stream_reset(aeo_stream_t *self)
{
    if (self == NULL) {
        return;
    }
    lock(self);
    self->phase = PHASE_IDLE;
    self->cursor = 0;
    self->slot = 0;
    self->described = 0;
    self->describing = 1;
    self->turn = 0;
    self->describe_in = self->config.describe_every;
    self->health_in = self->config.health_every;
    self->health_item = 0;
    self->flags = 0;
    self->counters_used = 0;
    self->finishing = 0;
    self->farewells = 0;
    self->credit_us = 0;
    self->clock_us = self->port.time_us != NULL ? self->port.time_us(self->port.context) : 0u;
    unlock(self);
}

/* ---- what the control task brings -------------------------------------------------------------------------------- */

/* Send one value at once; deeper in debt than two samples it is dropped, so that the average keeps within the budget
 * even when samples come faster than declared. */
static int send_value(aeo_stream_t *self, aeo_kind_t kind, unsigned channel, uint32_t index, aeo_real_t value)
{
    const int32_t deepest = -(int32_t)(2u * AEO_STREAM_CHANNELS_MAX * self->frame_us); /* >= -1.28e8 */
    aeo_message_t message;
    int taken;
    message.kind = kind;
    message.tag = (uint8_t)channel;
    message.index = (uint16_t)(index & 0xFFFFu);
    message.count = 1;
    message.value[0] = aeo_float_bits(value);
    lock(self);
    taken = self->credit_us >= deepest && send_message(self, &message);
    if (!taken) {
        self->counters.dropped++;
    }
    self->last_index = index;
    unlock(self);
    return taken;
}

static int send_values(aeo_stream_t *self, aeo_kind_t kind, unsigned first, uint32_t index, const aeo_real_t *values,
                       unsigned count)
{
    unsigned i;
    int all = 1;
    for (i = 0; i < count; i++) {
        all &= send_value(self, kind, first + i, index, values[i]);
    }
    return all;
}

int aeo_stream_sample(aeo_stream_t *self, uint32_t index, const aeo_real_t *u, const aeo_real_t *y, const aeo_real_t *s)
{
    const aeo_stream_config_t *config;
    int all;
    if (self == NULL || y == NULL || (u == NULL && self->config.inputs > 0u) ||
        (s == NULL && self->config.scheduling > 0u)) {
        return AEO_E_ARG;
    }
    config = &self->config;
    self->last_index = index;
    if (config->sample_every == 0u || index % config->sample_every != 0u) {
        return AEO_OK;
    }
    all = send_values(self, AEO_KIND_SAMPLE, 0, index, u, config->inputs);
    all &= send_values(self, AEO_KIND_SAMPLE, config->inputs, index, y, config->outputs);
    all &= send_values(self, AEO_KIND_SAMPLE, (unsigned)config->inputs + config->outputs, index, s, config->scheduling);
    return all ? AEO_OK : AEO_E_REFUSED;
}

int aeo_stream_innovation(aeo_stream_t *self, uint32_t index, const aeo_real_t *e)
{
    if (self == NULL || e == NULL) {
        return AEO_E_ARG;
    }
    if (self->config.innovations == 0u || self->config.sample_every == 0u || index % self->config.sample_every != 0u) {
        return AEO_OK;
    }
    return send_values(self, AEO_KIND_INNOVATION, 0, index, e, self->config.outputs) ? AEO_OK : AEO_E_REFUSED;
}

int aeo_stream_snapshot(aeo_stream_t *self, uint32_t index, const aeo_real_t *theta)
{
    uint32_t i, crc = UINT32_C(0xFFFFFFFF);
    if (self == NULL || theta == NULL) {
        return AEO_E_ARG;
    }
    lock(self);
    if (self->phase != PHASE_IDLE) {
        self->counters.busy++;
        unlock(self);
        return AEO_E_BUSY;
    }
    for (i = 0; i < self->config.parameters; i++) {
        self->theta[i] = aeo_float_bits(theta[i]);
        crc = aeo_frame_crc32(crc, self->theta[i]);
    }
    self->crc = ~crc;
    self->taken_index = index;
    self->number = (uint8_t)((self->number + 1u) & 0xFFu);
    self->phase = PHASE_BEGIN;
    self->cursor = 0;
    unlock(self);
    return AEO_OK;
}

int aeo_stream_health(aeo_stream_t *self, uint32_t flags, const uint32_t *counter, unsigned count)
{
    if (self == NULL || count > AEO_STREAM_COUNTERS || (counter == NULL && count > 0u)) {
        return AEO_E_ARG;
    }
    lock(self);
    self->flags = (uint16_t)(flags & 0x7FFFu);
    if (count > 0u) {
        memcpy(self->counter, counter, count * sizeof *counter);
    }
    self->counters_used = (uint8_t)count;
    unlock(self);
    return AEO_OK;
}

/* ---- the step ---------------------------------------------------------------------------------------------------- */

static void choose_snapshot(const aeo_stream_t *self, aeo_message_t *message)
{
    uint32_t at;
    message->tag = self->number;
    switch ((phase_t)self->phase) {
    case PHASE_BEGIN:
        message->kind = AEO_KIND_BEGIN;
        message->index = (uint16_t)(self->config.parameters - 1u);
        message->value[0] = self->taken_index;
        break;
    case PHASE_BLOCKS:
        at = aeo_spread_index(&self->spread, self->cursor);
        message->kind = AEO_KIND_PARAMETER;
        message->index = (uint16_t)at;
        message->value[0] = self->theta[at];
        break;
    case PHASE_REPAIR:
        message->kind = AEO_KIND_REPAIR;
        message->index = (uint16_t)self->cursor;
        message->value[0] = aeo_spread_repair(&self->spread, self->theta, (uint16_t)self->cursor);
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

static void choose_health(const aeo_stream_t *self, aeo_message_t *message)
{
    const uint32_t own[STREAM_ITEMS] = {self->counters.sent, self->counters.refused, self->counters.dropped,
                                        self->counters.snapshots, self->counters.busy};
    /* every second frame tells the sample index: it dates the flags and lets late joiners count samples in full */
    const unsigned item = self->health_item % 2u == 0u ? AEO_HEALTH_INDEX : 1u + self->health_item / 2u;
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
static origin_t choose(aeo_stream_t *self, aeo_message_t *message)
{
    const int due = self->describing != 0u && (self->phase == PHASE_IDLE || self->turn >= DESCRIPTION_TURN - 1u);
    memset(message, 0, sizeof *message);
    message->count = 1;
    if (self->described != 0u && self->health_in == 0u) {
        choose_health(self, message);
        return FROM_HEALTH;
    }
    if (self->described == 0u || (due && self->finishing == 0u)) {
        (void)aeo_describe(&self->config, self->hash, self->slot, message); /* commit left no empty slot here */
        return FROM_DESCRIPTION;
    }
    if (self->phase != PHASE_IDLE) {
        choose_snapshot(self, message);
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
        length = self->config.parameters;
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
        self->counters.snapshots++;
    }
    self->phase = next[self->phase];
    if (self->phase == PHASE_REPAIR && self->spread.repairs == 0u) {
        self->phase = PHASE_CLOSE;
    }
}

/* Empty slots at the end of the list are passed here, so that the end of a description is seen when it happens. */
static void commit_description(aeo_stream_t *self)
{
    aeo_message_t skipped;
    self->turn = 0;
    do {
        self->slot++;
    } while (self->slot < aeo_describe_slots(&self->config) &&
             !aeo_describe(&self->config, self->hash, self->slot, &skipped));
    if (self->slot >= aeo_describe_slots(&self->config)) {
        self->slot = 0;
        self->described = 1;
        self->describing = 0;
        self->describe_in = self->config.describe_every;
    }
}

static void commit(aeo_stream_t *self, origin_t origin)
{
    switch (origin) {
    case FROM_DESCRIPTION:
        commit_description(self);
        break;
    case FROM_HEALTH:
        self->health_in = self->config.health_every;
        self->health_item = (uint8_t)((self->health_item + 1u) % (2u * (STREAM_ITEMS + self->counters_used)));
        break;
    case FROM_SNAPSHOT:
        self->turn = (uint8_t)(self->turn < 255u ? self->turn + 1u : 255u);
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
    const int32_t most = (int32_t)(self->config.burst * self->frame_us); /* 255 * 10^6 < 2^31 */
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

int aeo_stream_step(aeo_stream_t *self)
{
    aeo_message_t message;
    origin_t origin = FROM_DESCRIPTION;
    int sent = 0, taken = 1;
    if (self == NULL) {
        return AEO_E_ARG;
    }
    lock(self);
    earn(self);
    unlock(self);
    while (taken && origin != FROM_NOTHING && sent < (int)self->config.burst) {
        lock(self);
        origin = self->credit_us >= (int32_t)self->frame_us ? choose(self, &message) : FROM_NOTHING;
        if (origin != FROM_NOTHING) {
            taken = send_message(self, &message);
            if (taken) {
                commit(self, origin);
                sent++;
            } else {
                self->counters.refused++;
            }
        }
        unlock(self);
    }
    return sent;
}

void aeo_stream_finish(aeo_stream_t *self)
{
    if (self != NULL && self->finishing == 0u) {
        lock(self);
        self->finishing = 1;
        self->farewells = FAREWELLS;
        unlock(self);
    }
}

int aeo_stream_pending(const aeo_stream_t *self)
{
    return self != NULL &&
           (self->described == 0u || self->phase != PHASE_IDLE || (self->finishing != 0u && self->farewells > 0u));
}
