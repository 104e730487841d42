#include "describe.h"

#include <string.h>

#define FIXED_ITEMS 7u /* description items before the per-channel ones */
#define NAME_PARTS  (AEO_STREAM_NAME_MAX / 4)
#define UNIT_PARTS  (AEO_STREAM_UNIT_MAX / 4)

unsigned aeo_describe_channels(const aeo_stream_config_t *config)
{
    return (unsigned)config->inputs + config->outputs + config->scheduling;
}

/* On the bit pattern, because -ffast-math lets a NaN pass every comparison. */
static int is_finite(aeo_real_t value)
{
    return (aeo_float_bits(value) & UINT32_C(0x7F800000)) != UINT32_C(0x7F800000);
}

static int is_normal_positive(aeo_real_t value)
{
    const uint32_t bits = aeo_float_bits(value);
    return bits >= UINT32_C(0x00800000) && bits < UINT32_C(0x7F800000);
}

/* 1 when the parameters are those of a predictor of the model set, sizes and mask, and the method makes such ones: a host
 * cuts theta by these. */
static int shape_is_sound(const aeo_stream_config_t *config)
{
    const uint32_t l = config->outputs, block = config->inputs + l * (1u + (config->model_set & 1u));
    uint32_t regressors = config->past * block, mask;
    if (config->model_set > (uint16_t)AEO_VARMAX || config->method > (uint8_t)AEO_METHOD_LATTICE ||
        (config->method == (uint8_t)AEO_METHOD_ELS && config->model_set != (uint16_t)AEO_VARMAX) ||
        (config->inputs < 32u && config->feedthrough >> config->inputs != 0u)) {
        return 0;
    }
    for (mask = config->feedthrough; mask != 0u; mask &= mask - 1u) {
        regressors++;
    }
    return config->past == 0u || config->parameters == regressors * l; /* 65535 192 64 + 2^11 < 2^32 */
}

int aeo_describe_is_sound(const aeo_stream_config_t *config)
{
    unsigned i;
    for (i = 0; i < aeo_describe_channels(config); i++) {
        if (!is_finite(config->channels[i].offset) || !is_normal_positive(config->channels[i].scale)) {
            return 0;
        }
    }
    return shape_is_sound(config) && is_normal_positive(config->sample_time_s) && is_finite(config->lambda) &&
           is_finite(config->rho);
}

/* Put up to four characters of part `part` of `text` into `value`; 0 when the text ends before. */
static int take_text(const char *text, unsigned part, uint32_t *value)
{
    unsigned i;
    uint32_t word = 0;
    if (text == NULL) {
        return 0;
    }
    for (i = 0; i < 4u * part; i++) {
        if (text[i] == '\0') {
            return 0;
        }
    }
    for (i = 0; i < 4u && text[4u * part + i] != '\0'; i++) {
        word |= (uint32_t)(unsigned char)text[4u * part + i] << (8u * i);
    }
    *value = word;
    return i > 0u;
}

/* Which filter made the parameters. rls in VARX and els in VARMAX have 0, as all streams had when there were no others. */
static uint8_t find_maker(const aeo_stream_config_t *config)
{
    static const uint8_t makers[2][4] = {{0, 0, 1, 2}, {3, 0, 1, 2}};
    return makers[config->model_set][config->method]; /* aeo_describe_is_sound has judged both */
}

static void describe_fixed(const aeo_stream_config_t *config, uint32_t hash, aeo_message_t *message)
{
    switch ((aeo_item_t)message->tag) {
    case AEO_ITEM_WIRE:
        message->index = AEO_WIRE_VERSION;
        message->value[0] = hash;
        break;
    case AEO_ITEM_SHAPE:
        message->index = (uint16_t)(config->model_set | ((unsigned)find_maker(config) << 8));
        message->value[0] = (uint32_t)config->inputs | ((uint32_t)config->outputs << 8) |
                            ((uint32_t)config->scheduling << 16) |
                            ((config->fd != 0u ? UINT32_C(14) : UINT32_C(1)) << 24);
        break;
    case AEO_ITEM_PARAMETERS:
        message->index = config->past;
        message->value[0] = config->parameters;
        break;
    case AEO_ITEM_SAMPLE_TIME:
        message->index = config->sample_every;
        message->value[0] = aeo_float_bits(config->sample_time_s);
        break;
    case AEO_ITEM_FORGETTING:
        message->value[0] = aeo_float_bits(config->lambda);
        break;
    case AEO_ITEM_REGULARISATION:
        message->value[0] = aeo_float_bits(config->rho);
        break;
    case AEO_ITEM_FEEDTHROUGH:
        message->value[0] = config->feedthrough;
        break;
    case AEO_ITEM_OFFSET:
    case AEO_ITEM_SCALE:
    case AEO_ITEM_NAME:
    case AEO_ITEM_UNIT:
    case AEO_ITEM_COUNT:
    default:
        break;
    }
}

uint32_t aeo_describe_slots(const aeo_stream_config_t *config)
{
    return FIXED_ITEMS + (2u + NAME_PARTS + UNIT_PARTS) * aeo_describe_channels(config);
}

int aeo_describe(const aeo_stream_config_t *config, uint32_t hash, uint32_t slot, aeo_message_t *message)
{
    const unsigned m = aeo_describe_channels(config);
    unsigned channel, part;
    memset(message, 0, sizeof *message);
    message->kind = AEO_KIND_DESCRIPTION;
    message->count = 1;
    if (slot < FIXED_ITEMS) {
        message->tag = (uint8_t)slot;
        describe_fixed(config, hash, message);
        return 1;
    }
    slot -= FIXED_ITEMS;
    channel = slot % m; /* m >= 1: init refuses a stream without outputs */
    part = slot / m;
    message->index = (uint16_t)channel;
    if (part < 2u) {
        message->tag = (uint8_t)(part == 0u ? AEO_ITEM_OFFSET : AEO_ITEM_SCALE);
        message->value[0] =
            aeo_float_bits(part == 0u ? config->channels[channel].offset : config->channels[channel].scale);
        return 1;
    }
    part -= 2u;
    if (part < NAME_PARTS) {
        message->tag = AEO_ITEM_NAME;
        message->index = (uint16_t)(channel + (part << 8));
        return take_text(config->channels[channel].name, part, &message->value[0]);
    }
    part -= NAME_PARTS;
    message->tag = AEO_ITEM_UNIT;
    message->index = (uint16_t)(channel + (part << 8));
    return take_text(config->channels[channel].unit, part, &message->value[0]);
}

uint32_t aeo_describe_hash(const aeo_stream_config_t *config)
{
    uint32_t crc = UINT32_C(0xFFFFFFFF), slot;
    aeo_message_t message;
    for (slot = 1; slot < aeo_describe_slots(config); slot++) {
        if (aeo_describe(config, 0, slot, &message)) {
            crc = aeo_frame_crc32(crc, (uint32_t)message.tag | ((uint32_t)message.index << 16));
            crc = aeo_frame_crc32(crc, message.value[0]);
        }
    }
    return ~crc;
}
