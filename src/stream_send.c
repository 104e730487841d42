#include "stream_send.h"

#include <aeolid/status.h>

#include "linalg.h"

void aeo_stream_lock(const aeo_stream_t *self)
{
    if (self->port.lock != NULL) {
        self->port.lock(self->port.context);
    }
}

void aeo_stream_unlock(const aeo_stream_t *self)
{
    if (self->port.unlock != NULL) {
        self->port.unlock(self->port.context);
    }
}

uint32_t aeo_stream_cost_us(const aeo_stream_config_t *config, unsigned length)
{
    const int extended = (config->address.extended & 1u) != 0u;
    uint32_t bits = extended ? AEO_FRAME_BITS_EXTENDED : AEO_FRAME_BITS_STANDARD;
    if (config->bits_per_s == 0u) {
        return 0;
    }
    if (length > 8u) {
        bits = extended ? AEO_FRAME_FD_BITS_EXTENDED(length, config->fd_ratio)
                        : AEO_FRAME_FD_BITS_STANDARD(length, config->fd_ratio);
    }
    /* bits <= 745: 745e6 < 2^32. Rounding up keeps the share below its limit; at most 10^6 us because bits_per_s is at
     * least the bits of the longest frame. */
    return (bits * 1000000u + config->bits_per_s - 1u) / config->bits_per_s;
}

/* Closing frames leave between snapshots, and none begins once the end is announced. */
int aeo_stream_has_ended(const aeo_stream_t *self)
{
    return self->finishing != 0u && self->farewells == 0u;
}

/* The address was checked at init and kinds and counts are ours, so packing cannot fail. */
int aeo_stream_send(aeo_stream_t *self)
{
    if (aeo_frame_pack(&self->config.address, &self->message, &self->frame) != AEO_OK ||
        !self->port.send(self->port.context, &self->frame)) {
        return 0;
    }
    aeo_count_up(&self->counters.sent);
    self->credit_us -=
        (int32_t)(self->frame.length > 8u ? aeo_stream_cost_us(&self->config, self->frame.length) : self->frame_us);
    return 1;
}
