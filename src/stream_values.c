#include <aeolid/stream.h>

#include <aeolid/status.h>

#include "linalg.h"
#include "stream_send.h"

/* Up to three arrays that are sent as one. */
typedef struct {
    const aeo_real_t *part[3];
    unsigned length[3];
    unsigned count; /* of all values */
} values_t;

static uint32_t take_bits(const values_t *values, unsigned at)
{
    unsigned part = 0;
    while (at >= values->length[part]) { /* at < count, the sum of the lengths: ends within the three */
        at -= values->length[part];
        part++;
    }
    return aeo_float_bits(values->part[part][at]);
}

/* Offer the message under way at once; deeper in debt than two samples of the most channels it is dropped, so that the
 * average keeps within the budget even when samples come faster than declared. After the closing frames, too. */
static int send_now(aeo_stream_t *self)
{
    const int32_t deepest = -(int32_t)(2u * AEO_STREAM_CHANNELS_MAX * self->frame_us); /* >= -1.28e8 */
    const int taken = !aeo_stream_has_ended(self) && self->credit_us >= deepest && aeo_stream_send(self);
    if (!taken) {
        aeo_count_up(&self->counters.dropped);
    }
    return taken;
}

/* One frame of up to `width` values from `first` on; the lock is held for one frame, not for the whole sample. */
static int send_part(aeo_stream_t *self, aeo_kind_t kind, uint32_t index, const values_t *values, unsigned first,
                     uint32_t *crc)
{
    const unsigned width = self->config.fd != 0u ? AEO_FRAME_VALUES_MAX : 1u;
    const unsigned left = values->count - first;
    aeo_message_t *message = &self->message;
    unsigned i;
    int taken;
    aeo_stream_lock(self);
    message->kind = kind;
    message->tag = (uint8_t)first;
    message->index = (uint16_t)(index & 0xFFFFu);
    message->count = (uint8_t)(left < width ? left : width);
    for (i = 0; i < message->count; i++) {
        message->value[i] = take_bits(values, first + i);
        *crc = aeo_frame_crc32(*crc, message->value[i]);
    }
    self->last_index = index;
    taken = send_now(self);
    aeo_stream_unlock(self);
    return taken;
}

static int send_seal(aeo_stream_t *self, unsigned tag, uint32_t index, uint32_t crc)
{
    aeo_message_t *message = &self->message;
    int taken;
    aeo_stream_lock(self);
    message->kind = AEO_KIND_SEAL;
    message->tag = (uint8_t)tag;
    message->index = (uint16_t)(index & 0xFFFFu);
    message->count = 1;
    message->value[0] = ~crc;
    taken = send_now(self);
    aeo_stream_unlock(self);
    return taken;
}

static aeo_status_t send_values(aeo_stream_t *self, aeo_kind_t kind, uint32_t index, const values_t *values)
{
    const int fd = self->config.fd != 0u;
    const unsigned tag = values->count | (kind == AEO_KIND_INNOVATION ? AEO_SEAL_INNOVATION : 0u);
    uint32_t crc = aeo_frame_crc32(UINT32_C(0xFFFFFFFF), self->config.address.node | (tag << 8));
    unsigned first;
    int all = 1;
    crc = aeo_frame_crc32(crc, index);
    for (first = 0; first < values->count; first += fd ? AEO_FRAME_VALUES_MAX : 1u) {
        const unsigned sent_as = (unsigned)kind + (fd ? AEO_KIND_FD : 0u);
        all &= send_part(self, (aeo_kind_t)sent_as, index, values, first, &crc);
    }
    if (!fd && self->config.seal != 0u) {
        all &= send_seal(self, tag, index, crc);
    }
    return all ? AEO_OK : AEO_E_REFUSED;
}

aeo_status_t aeo_stream_sample(aeo_stream_t *self, uint32_t index, const aeo_real_t *u, const aeo_real_t *y,
                               const aeo_real_t *s)
{
    const aeo_stream_config_t *config;
    values_t values;
    if (self == NULL || y == NULL || (u == NULL && self->config.inputs > 0u) ||
        (s == NULL && self->config.scheduling > 0u)) {
        return AEO_E_ARG;
    }
    config = &self->config;
    if (config->sample_every == 0u || index % config->sample_every != 0u) {
        aeo_stream_lock(self); /* the step reads it for health */
        self->last_index = index;
        aeo_stream_unlock(self);
        return AEO_OK;
    }
    values.part[0] = u;
    values.part[1] = y;
    values.part[2] = s;
    values.length[0] = config->inputs;
    values.length[1] = config->outputs;
    values.length[2] = config->scheduling;
    values.count = values.length[0] + values.length[1] + values.length[2];
    return send_values(self, AEO_KIND_SAMPLE, index, &values);
}

aeo_status_t aeo_stream_innovation(aeo_stream_t *self, uint32_t index, const aeo_real_t *e)
{
    values_t values;
    if (self == NULL || e == NULL) {
        return AEO_E_ARG;
    }
    if (self->config.innovations == 0u || self->config.sample_every == 0u || index % self->config.sample_every != 0u) {
        return AEO_OK;
    }
    values.part[0] = e;
    values.part[1] = values.part[2] = NULL;
    values.count = values.length[0] = self->config.outputs;
    values.length[1] = values.length[2] = 0;
    return send_values(self, AEO_KIND_INNOVATION, index, &values);
}
