/* regressor.c: the window of regressor.h. */
#include "aeolid/regressor.h"

#include "linalg.h"
#include "settings.h"

#include <string.h>

/* Channel tables hold finite numbers, so "no limit" is the largest one. */
#if AEO_REAL_BYTES == 8
#define REAL_MAX DBL_MAX
#define REAL_MIN DBL_MIN
#else
#define REAL_MAX FLT_MAX
#define REAL_MIN FLT_MIN
#endif

static int sizes_hold(const aeo_regressor_config_t *config)
{
    const unsigned r = config->inputs, l = config->outputs;
    if (r > AEO_REGRESSOR_CHANNELS_MAX || l < 1u || l > AEO_REGRESSOR_CHANNELS_MAX || config->past < 1u) {
        return 0;
    }
    if (config->model_set != AEO_VARX && config->model_set != AEO_VARMAX) {
        return 0;
    }
    if (r < 32u && config->feedthrough >> r != 0u) {
        return 0;
    }
    const size_t e = config->model_set == AEO_VARMAX ? 1u : 0u;
    return AEO_REGRESSOR_LENGTH(r, l, config->past, e, r) <= AEO_REGRESSOR_LENGTH_MAX && config->period_us >= 1u &&
           config->period_us <= UINT32_C(4000000000);
}

/* What the config says of one channel, from whichever description it has. */
enum { OFFSET, SCALE, MINIMUM, MAXIMUM, COLUMNS };

static void read_channel(const aeo_regressor_config_t *config, size_t i, aeo_real_t row[COLUMNS])
{
    if (config->channels != NULL) {
        const aeo_channel_t *const channel = &config->channels[i];
        /* both ends 0: no range. A NaN is neither above nor below and must not pass for 0 */
        const int open = aeo_linalg_all_within(&channel->minimum, 1, REAL_MIN) &&
                         aeo_linalg_all_within(&channel->maximum, 1, REAL_MIN);
        row[OFFSET] = channel->offset;
        row[SCALE] = channel->scale;
        row[MINIMUM] = open ? -REAL_MAX : channel->minimum;
        row[MAXIMUM] = open ? REAL_MAX : channel->maximum;
        return;
    }
    row[OFFSET] = config->offset != NULL ? config->offset[i] : AEO_REAL(0);
    row[SCALE] = config->scale != NULL ? config->scale[i] : AEO_REAL(1);
    row[MINIMUM] = config->minimum != NULL ? config->minimum[i] : -REAL_MAX;
    row[MAXIMUM] = config->maximum != NULL ? config->maximum[i] : REAL_MAX;
}

static aeo_status_t check_channels(const aeo_regressor_config_t *config)
{
    const size_t channels = (size_t)config->inputs + config->outputs;
    aeo_status_t status = AEO_OK;
    aeo_real_t row[COLUMNS];
    for (size_t i = 0; i < channels; i++) {
        read_channel(config, i, row);
        if (!aeo_linalg_all_finite(row, COLUMNS)) {
            return AEO_E_NOT_FINITE;
        }
        /* The reciprocal must be a normal number too: a table that can hold 1e-30 must not be allowed 1e-39. */
        if (!aeo_is_between(row[SCALE], REAL_MIN * AEO_REAL(4), REAL_MAX / AEO_REAL(16)) ||
            row[MINIMUM] > row[MAXIMUM]) {
            status = AEO_E_ARG; /* unless a number that follows is none */
        }
    }
    return status;
}

static void fill_tables(aeo_regressor_t *self, const aeo_regressor_config_t *config, aeo_real_t *memory)
{
    const size_t channels = (size_t)config->inputs + config->outputs;
    aeo_real_t row[COLUMNS];
    self->offset = memory;
    self->inverse = memory + channels;
    self->minimum = memory + 2 * channels;
    self->maximum = memory + 3 * channels;
    for (size_t i = 0; i < channels; i++) {
        read_channel(config, i, row);
        self->offset[i] = row[OFFSET];
        self->inverse[i] = AEO_REAL(1) / row[SCALE]; /* scale >= 4 REAL_MIN */
        self->minimum[i] = row[MINIMUM];
        self->maximum[i] = row[MAXIMUM];
    }
}

/* 1 when no channel is described twice. */
static int description_is_one(const aeo_regressor_config_t *config)
{
    return config->channels == NULL ||
           (config->offset == NULL && config->scale == NULL && config->minimum == NULL && config->maximum == NULL);
}

aeo_status_t aeo_regressor_init(aeo_regressor_t *self, const aeo_regressor_config_t *config, aeo_real_t *memory,
                                size_t words)
{
    if (self == NULL || config == NULL || memory == NULL || !sizes_hold(config) || !description_is_one(config)) {
        return AEO_E_ARG;
    }
    const aeo_status_t status = check_channels(config);
    if (status != AEO_OK) {
        return status;
    }
    const unsigned r = config->inputs, l = config->outputs, e = config->model_set == AEO_VARMAX ? 1u : 0u;
    const size_t m = AEO_REGRESSOR_BLOCK(r, l, e), past = config->past * m;
    if (words < AEO_REGRESSOR_WORDS(r, l, config->past, e)) {
        return AEO_E_MEMORY;
    }
    memset(self, 0, sizeof *self);
    self->inputs = config->inputs;
    self->outputs = config->outputs;
    self->past = config->past;
    self->model_set = (uint8_t)config->model_set;
    self->feedthrough = config->feedthrough;
    self->period_us = config->period_us;
    self->block_length = (uint16_t)m;
    self->length = (uint16_t)(past + aeo_settings_count_bits(config->feedthrough));
    self->z = memory;
    self->block = memory + past + r;
    fill_tables(self, config, self->block + self->block_length);
    aeo_regressor_reset(self);
    return AEO_OK;
}

static aeo_real_t scale(const aeo_regressor_t *self, aeo_real_t x, size_t channel)
{
    return (x - self->offset[channel]) * self->inverse[channel];
}

/* 1 when every value of the channels first ... first+count-1 lies in its plausible range and scales to a number that
 * the filters' overflow proofs allow. x is finite; (x - offset) * inverse may overflow, so the product is judged by
 * bits. */
static int in_range(const aeo_regressor_t *self, const aeo_real_t *x, size_t first, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const aeo_real_t scaled = scale(self, x[i], first + i);
        if (x[i] < self->minimum[first + i] || x[i] > self->maximum[first + i] ||
            !aeo_linalg_all_within(&scaled, 1, AEO_SCALED_MAX)) {
            return 0;
        }
    }
    return 1;
}

/* Accept or refuse by time alone: AEO_OK, AEO_E_GAP or AEO_E_TIME. */
static aeo_status_t judge_time(const aeo_regressor_t *self, uint64_t time_us)
{
    if (self->pending == 0u) {
        return AEO_OK;
    }
    if (time_us <= self->time_us) {
        return AEO_E_TIME;
    }
    const uint64_t step = time_us - self->time_us;
    const uint64_t half = self->period_us / 2u;
    if (step < half) {
        return AEO_E_TIME;
    }
    return step > self->period_us + half ? AEO_E_GAP : AEO_OK;
}

/* Move the last accepted block into the window: the oldest one drops out, the rest moves down by one block. */
static void shift_window(aeo_regressor_t *self)
{
    const size_t m = self->block_length;
    const size_t kept = (size_t)(self->past - 1u) * m;
    for (size_t i = 0; i < kept; i++) {
        self->z[i] = self->z[i + m];
    }
    memcpy(self->z + kept, self->block, m * sizeof *self->z);
    if (self->filled < self->past) {
        self->filled++;
    }
}

static void store_block(aeo_regressor_t *self, const aeo_real_t *u, const aeo_real_t *y)
{
    const size_t r = self->inputs, l = self->outputs;
    aeo_real_t *tail = self->z + (size_t)self->past * self->block_length;
    for (size_t i = 0; i < r + l; i++) {
        self->block[i] = scale(self, i < r ? u[i] : y[i - r], i);
        if (i < r && (self->feedthrough >> i & 1u) != 0u) {
            *tail++ = self->block[i];
        }
    }
    memset(self->block + r + l, 0, (self->block_length - r - l) * sizeof *self->block);
}

aeo_status_t aeo_regressor_push(aeo_regressor_t *self, const aeo_real_t *u, const aeo_real_t *y, uint64_t time_us)
{
    if (self == NULL || y == NULL || (u == NULL && self->inputs > 0u)) {
        return AEO_E_ARG;
    }
    if (!aeo_linalg_all_finite(u, self->inputs) || !aeo_linalg_all_finite(y, self->outputs)) {
        aeo_count_up(&self->count.not_finite);
        return AEO_E_NOT_FINITE;
    }
    if (!in_range(self, u, 0, self->inputs) || !in_range(self, y, self->inputs, self->outputs)) {
        aeo_count_up(&self->count.range);
        return AEO_E_RANGE;
    }
    const aeo_status_t time = judge_time(self, time_us);
    if (time == AEO_E_TIME) {
        aeo_count_up(&self->count.time);
        return time;
    }
    if (time == AEO_E_GAP) {
        aeo_count_up(&self->count.gaps);
        self->filled = 0;
    } else if (self->pending != 0u) {
        shift_window(self);
    }
    store_block(self, u, y);
    self->pending = 1;
    self->time_us = time_us;
    aeo_count_up(&self->count.samples);
    if (time == AEO_E_GAP) {
        return time;
    }
    return self->filled == self->past ? AEO_OK : AEO_FILLING;
}

aeo_status_t aeo_regressor_set_innovation(aeo_regressor_t *self, const aeo_real_t *e)
{
    if (self == NULL || e == NULL || self->model_set != (uint8_t)AEO_VARMAX || self->pending == 0u) {
        return AEO_E_ARG;
    }
    const aeo_status_t status = aeo_linalg_judge(e, self->outputs);
    if (status == AEO_OK) {
        memcpy(self->block + self->inputs + self->outputs, e, self->outputs * sizeof *e);
    }
    return status;
}

const aeo_real_t *aeo_regressor_z(const aeo_regressor_t *self)
{
    return self->z;
}

const aeo_real_t *aeo_regressor_y(const aeo_regressor_t *self)
{
    return self->block + self->inputs;
}

void aeo_regressor_reset(aeo_regressor_t *self)
{
    if (self == NULL) {
        return;
    }
    self->filled = 0;
    self->pending = 0;
    self->time_us = 0;
    memset(self->z, 0, self->length * sizeof *self->z);
    memset(self->block, 0, self->block_length * sizeof *self->block);
}

int aeo_regressor_invariants_hold(const aeo_regressor_t *self)
{
    if (self == NULL || self->filled > self->past || self->pending > 1u || self->period_us == 0u) {
        return 0;
    }
    const unsigned e = self->model_set;
    const size_t channels = (size_t)self->inputs + self->outputs;
    if (e > 1u || self->block_length != AEO_REGRESSOR_BLOCK(self->inputs, self->outputs, e) ||
        self->length != (size_t)self->past * self->block_length + aeo_settings_count_bits(self->feedthrough)) {
        return 0;
    }
    return aeo_linalg_all_finite(self->offset, 4 * channels) &&
           aeo_linalg_all_within(self->z, self->length, AEO_SCALED_MAX) &&
           aeo_linalg_all_within(self->block, self->block_length, AEO_SCALED_MAX);
}
/* SPDX-License-Identifier: MIT */
