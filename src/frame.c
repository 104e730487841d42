#include <aeolid/frame.h>

#include <aeolid/status.h>

#include <string.h>

#define HEAD_BYTES 4u
#define CHECK_AT   3u

typedef struct {
    uint32_t kind_step;  /* distance of two kinds */
    uint32_t node_limit; /* nodes from here on do not fit */
    uint32_t base_mask;  /* bits of the base that must be zero */
    uint32_t id_limit;   /* identifiers from here on do not exist */
} layout_t;

static const layout_t layouts[2] = {
    {16u, 16u, UINT32_C(0xFF), UINT32_C(1) << 11},
    {256u, 254u, UINT32_C(0x1FFF), UINT32_C(1) << 29},
};

static const layout_t *find_layout(const aeo_address_t *address)
{
    const layout_t *layout = &layouts[address->extended != 0u ? 1 : 0];
    if ((address->base & layout->base_mask) != 0u || address->base >= layout->id_limit) {
        return NULL;
    }
    return layout;
}

/* CRC-8 a nibble at a time: 16 bytes of table instead of 256, about 12 operations a byte. */
static uint8_t continue_check(uint8_t crc, uint8_t byte)
{
    static const uint8_t table[16] = {0x00, 0x2F, 0x5E, 0x71, 0xBC, 0x93, 0xE2, 0xCD,
                                      0x57, 0x78, 0x09, 0x26, 0xEB, 0xC4, 0xB5, 0x9A};
    unsigned state = (unsigned)crc ^ byte;
    state = ((state << 4) & 0xFFu) ^ table[state >> 4];
    state = ((state << 4) & 0xFFu) ^ table[state >> 4];
    return (uint8_t)state;
}

/* The node stays out, so that a gateway may renumber nodes; the kind and the base do not. */
static uint8_t compute_check(uint32_t id_without_node, const aeo_can_frame_t *frame)
{
    uint8_t crc = 0xFF;
    unsigned i;
    for (i = 0; i < 4u; i++) {
        crc = continue_check(crc, (uint8_t)((id_without_node >> (8u * i)) & 0xFFu));
    }
    crc = continue_check(crc, frame->length);
    for (i = 0; i < frame->length; i++) {
        if (i != CHECK_AT) {
            crc = continue_check(crc, frame->data[i]);
        }
    }
    return (uint8_t)(crc ^ 0xFFu);
}

/* Lengths that exist on CAN FD, as a count of values after the head. */
static int count_exists(unsigned count)
{
    return (count >= 1u && count <= 5u) || count == 7u || count == 11u || count == 15u;
}

int aeo_frame_pack(const aeo_address_t *address, const aeo_message_t *message, aeo_can_frame_t *frame)
{
    const layout_t *layout;
    uint32_t id;
    unsigned i;
    if (address == NULL || message == NULL || frame == NULL) {
        return AEO_E_ARG;
    }
    layout = find_layout(address);
    if (layout == NULL || address->node >= layout->node_limit || (unsigned)message->kind >= AEO_KIND_COUNT ||
        !count_exists(message->count)) {
        return AEO_E_ARG;
    }
    id = address->base + (uint32_t)message->kind * layout->kind_step;
    frame->id = id + address->node;
    frame->length = (uint8_t)(HEAD_BYTES + 4u * message->count);
    frame->flags = (uint8_t)((address->extended != 0u ? AEO_CAN_EXTENDED : 0u) |
                             (message->count > 1u ? AEO_CAN_FD | AEO_CAN_BRS : 0u));
    frame->data[0] = message->tag;
    frame->data[1] = (uint8_t)(message->index & 0xFFu);
    frame->data[2] = (uint8_t)(message->index >> 8);
    for (i = 0; i < message->count; i++) {
        const uint32_t value = message->value[i];
        uint8_t *at = &frame->data[HEAD_BYTES + 4u * i]; /* i <= 14: at most byte 60 ... 63 */
        at[0] = (uint8_t)(value & 0xFFu);
        at[1] = (uint8_t)((value >> 8) & 0xFFu);
        at[2] = (uint8_t)((value >> 16) & 0xFFu);
        at[3] = (uint8_t)((value >> 24) & 0xFFu);
    }
    frame->data[CHECK_AT] = compute_check(id, frame);
    return AEO_OK;
}

static int belongs_here(const layout_t *layout, const aeo_address_t *address, const aeo_can_frame_t *frame)
{
    const unsigned extended = address->extended != 0u ? AEO_CAN_EXTENDED : 0u;
    const uint32_t offset = frame->id - address->base; /* wraps far above the limit when the id is below the base */
    const unsigned count = frame->length < 8u ? 0u : (frame->length - HEAD_BYTES) / 4u;
    return (frame->flags & AEO_CAN_EXTENDED) == extended && frame->id < layout->id_limit &&
           offset < AEO_KIND_COUNT * layout->kind_step && offset % layout->kind_step < layout->node_limit &&
           count_exists(count) && HEAD_BYTES + 4u * count == frame->length &&
           (count == 1u || (frame->flags & AEO_CAN_FD) != 0u);
}

int aeo_frame_unpack(const aeo_address_t *address, const aeo_can_frame_t *frame, aeo_message_t *message, uint8_t *node)
{
    const layout_t *layout;
    uint32_t offset;
    unsigned i;
    if (address == NULL || frame == NULL || message == NULL || node == NULL) {
        return AEO_E_ARG;
    }
    layout = find_layout(address);
    if (layout == NULL) {
        return AEO_E_ARG;
    }
    if (!belongs_here(layout, address, frame)) {
        return AEO_E_MISMATCH;
    }
    offset = frame->id - address->base;
    if (frame->data[CHECK_AT] != compute_check(frame->id - offset % layout->kind_step, frame)) {
        return AEO_E_DAMAGED;
    }
    *node = (uint8_t)(offset % layout->kind_step);
    message->kind = (aeo_kind_t)(offset / layout->kind_step);
    message->tag = frame->data[0];
    message->index = (uint16_t)(frame->data[1] | ((unsigned)frame->data[2] << 8));
    message->count = (uint8_t)((frame->length - HEAD_BYTES) / 4u);
    for (i = 0; i < message->count; i++) {
        const uint8_t *at = &frame->data[HEAD_BYTES + 4u * i];
        message->value[i] =
            (uint32_t)at[0] | ((uint32_t)at[1] << 8) | ((uint32_t)at[2] << 16) | ((uint32_t)at[3] << 24);
    }
    return AEO_OK;
}

uint32_t aeo_float_bits(aeo_real_t value)
{
    const float narrow = (float)value;
    uint32_t bits;
    memcpy(&bits, &narrow, sizeof bits);
    return bits;
}

uint32_t aeo_frame_crc32(uint32_t crc, uint32_t word)
{
    static const uint32_t table[16] = {
        UINT32_C(0x00000000), UINT32_C(0x1DB71064), UINT32_C(0x3B6E20C8), UINT32_C(0x26D930AC),
        UINT32_C(0x76DC4190), UINT32_C(0x6B6B51F4), UINT32_C(0x4DB26158), UINT32_C(0x5005713C),
        UINT32_C(0xEDB88320), UINT32_C(0xF00F9344), UINT32_C(0xD6D6A3E8), UINT32_C(0xCB61B38C),
        UINT32_C(0x9B64C2B0), UINT32_C(0x86D3D2D4), UINT32_C(0xA00AE278), UINT32_C(0xBDBDF21C)};
    unsigned i;
    crc ^= word; /* reflected: the four bytes, least significant first, in one go */
    for (i = 0; i < 8u; i++) {
        crc = (crc >> 4) ^ table[crc & 15u];
    }
    return crc;
}

uint32_t aeo_frame_repair_set(uint16_t repair, uint32_t word)
{
    /* Two rounds of multiply and xor-shift; the odd constants are those of MurmurHash3's finaliser (Appleby, 2008). */
    uint32_t x = ((uint32_t)repair << 16) + word + UINT32_C(0x9E3779B9);
    x ^= x >> 16;
    x *= UINT32_C(0x85EBCA6B);
    x ^= x >> 13;
    x *= UINT32_C(0xC2B2AE35);
    x ^= x >> 16;
    return x;
}
