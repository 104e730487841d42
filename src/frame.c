#include <aeolid/frame.h>

#include <aeolid/status.h>

#include <string.h>

#define CLASSIC_BYTES 8u
#define CLASSIC_CHECK 3u /* where the CRC-8 is */
#define FD_COUNT      3u
#define FD_CHECK      4u
#define FD_HEAD       8u

typedef struct {
    uint32_t kind_step;  /* distance of two kinds */
    uint32_t node_limit; /* nodes from here on do not fit */
    uint32_t base_mask;  /* bits of the base that must be zero */
    uint32_t id_limit;   /* identifiers from here on do not exist */
} layout_t;

static const layout_t layouts[3] = {
    {4u, 4u, UINT32_C(0x3F), UINT32_C(1) << 11},
    {16u, 16u, UINT32_C(0xFF), UINT32_C(1) << 11},
    {256u, 254u, UINT32_C(0x1FFF), UINT32_C(1) << 29},
};

static int is_extended(const aeo_address_t *address)
{
    return (address->extended & 1u) != 0u;
}

static const layout_t *find_layout(const aeo_address_t *address)
{
    const layout_t *layout = &layouts[is_extended(address) ? 2 : (address->base & 0xFFu) == 0u ? 1 : 0];
    if ((address->base & layout->base_mask) != 0u || address->base >= layout->id_limit ||
        address->extended > (AEO_ADDRESS_FORCED | 1u)) {
        return NULL;
    }
    return layout;
}

static int may_send(const aeo_address_t *address)
{
    return (address->extended & AEO_ADDRESS_FORCED) != 0u ||
           AEO_FRAME_BASE_IS_FREE(address->base, is_extended(address));
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

static void put_word(uint8_t *at, uint32_t word)
{
    at[0] = (uint8_t)(word & 0xFFu);
    at[1] = (uint8_t)((word >> 8) & 0xFFu);
    at[2] = (uint8_t)((word >> 16) & 0xFFu);
    at[3] = (uint8_t)((word >> 24) & 0xFFu);
}

static uint32_t get_word(const uint8_t *at)
{
    return (uint32_t)at[0] | ((uint32_t)at[1] << 8) | ((uint32_t)at[2] << 16) | ((uint32_t)at[3] << 24);
}

/* The node stays out, so that a gateway may renumber nodes; the kind and the base do not. */
static uint8_t check_classic(uint32_t id_without_node, const aeo_can_frame_t *frame)
{
    uint8_t crc = 0xFF;
    unsigned i;
    for (i = 0; i < 4u; i++) {
        crc = continue_check(crc, (uint8_t)((id_without_node >> (8u * i)) & 0xFFu));
    }
    crc = continue_check(crc, CLASSIC_BYTES);
    for (i = 0; i < CLASSIC_BYTES; i++) {
        if (i != CLASSIC_CHECK) {
            crc = continue_check(crc, frame->data[i]);
        }
    }
    return (uint8_t)(crc ^ 0xFFu);
}

/* Here the node is part of it: no seal would tell a sample whose node was garbled from one of the other node. */
static uint32_t check_fd(const aeo_can_frame_t *frame)
{
    uint32_t crc = aeo_frame_crc32(UINT32_C(0xFFFFFFFF), frame->id);
    unsigned i;
    for (i = 0; i + 4u <= frame->length; i += 4u) { /* lengths are multiples of four: 12 ... 64 */
        if (i != FD_CHECK) {
            crc = aeo_frame_crc32(crc, get_word(&frame->data[i]));
        }
    }
    return ~crc;
}

#define KIND_BIT(kind) (1u << (unsigned)(kind))

static int is_fd(unsigned kind)
{
    const unsigned all = KIND_BIT(AEO_KIND_SAMPLE_FD) | KIND_BIT(AEO_KIND_INNOVATION_FD) |
                         KIND_BIT(AEO_KIND_PARAMETER_FD) | KIND_BIT(AEO_KIND_REPAIR_FD);
    return kind < AEO_KIND_LIMIT && (all & KIND_BIT(kind)) != 0u;
}

static int is_classic(unsigned kind)
{
    return kind <= AEO_KIND_SEAL;
}

aeo_status_t aeo_frame_pack(const aeo_address_t *address, const aeo_message_t *message, aeo_can_frame_t *frame)
{
    const layout_t *layout;
    unsigned kind, i, head;
    if (address == NULL || message == NULL || frame == NULL) {
        return AEO_E_ARG;
    }
    layout = find_layout(address);
    kind = (unsigned)message->kind;
    if (layout == NULL || !may_send(address) || address->node >= layout->node_limit ||
        (!is_classic(kind) && !is_fd(kind)) || message->count < 1u ||
        message->count > (is_fd(kind) ? AEO_FRAME_VALUES_MAX : 1u)) {
        return AEO_E_ARG;
    }
    head = is_fd(kind) ? FD_HEAD : CLASSIC_BYTES - 4u;
    frame->id = address->base + kind * layout->kind_step + address->node;
    frame->length = (uint8_t)(is_fd(kind) ? AEO_FRAME_FD_LENGTH(message->count) : CLASSIC_BYTES);
    frame->flags =
        (uint8_t)((is_extended(address) ? AEO_CAN_EXTENDED : 0u) | (is_fd(kind) ? AEO_CAN_FD | AEO_CAN_BRS : 0u));
    frame->data[0] = message->tag;
    frame->data[1] = (uint8_t)(message->index & 0xFFu);
    frame->data[2] = (uint8_t)(message->index >> 8);
    for (i = 0; head + 4u * i < frame->length; i++) { /* i <= 13: at most byte 60 ... 63 */
        put_word(&frame->data[head + 4u * i], i < message->count ? message->value[i] : 0u);
    }
    if (is_fd(kind)) {
        frame->data[FD_COUNT] = message->count;
        put_word(&frame->data[FD_CHECK], check_fd(frame));
    } else {
        frame->data[CLASSIC_CHECK] = check_classic(frame->id - address->node, frame);
    }
    return AEO_OK;
}

static int belongs_here(const layout_t *layout, const aeo_address_t *address, const aeo_can_frame_t *frame)
{
    const unsigned extended = is_extended(address) ? AEO_CAN_EXTENDED : 0u;
    const uint32_t offset = frame->id - address->base; /* wraps far above the limit when the id is below the base */
    const unsigned kind = offset / layout->kind_step;
    const unsigned length = frame->length;
    const int long_form = (frame->flags & AEO_CAN_FD) != 0u;
    if ((frame->flags & AEO_CAN_EXTENDED) != extended || frame->id >= layout->id_limit || kind >= AEO_KIND_LIMIT ||
        offset % layout->kind_step >= layout->node_limit) {
        return 0;
    }
    if (is_fd(kind)) {
        return long_form && (length == 12u || length == 16u || length == 20u || length == 24u || length == 32u ||
                             length == 48u || length == 64u);
    }
    return is_classic(kind) && !long_form && length == CLASSIC_BYTES;
}

/* Check and, on CAN FD, a count whose shortest frame this is. */
static int is_sound(unsigned kind, uint32_t id_without_node, const aeo_can_frame_t *frame)
{
    const unsigned count = frame->data[FD_COUNT];
    if (is_fd(kind)) {
        return count >= 1u && count <= AEO_FRAME_VALUES_MAX && AEO_FRAME_FD_LENGTH(count) == frame->length &&
               get_word(&frame->data[FD_CHECK]) == check_fd(frame);
    }
    return frame->data[CLASSIC_CHECK] == check_classic(id_without_node, frame);
}

aeo_status_t aeo_frame_unpack(const aeo_address_t *address, const aeo_can_frame_t *frame, aeo_message_t *message,
                              uint8_t *node)
{
    const layout_t *layout;
    uint32_t offset;
    unsigned kind, i, head;
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
    kind = offset / layout->kind_step;
    if (!is_sound(kind, frame->id - offset % layout->kind_step, frame)) {
        return AEO_E_DAMAGED;
    }
    *node = (uint8_t)(offset % layout->kind_step);
    message->kind = (aeo_kind_t)kind;
    message->tag = frame->data[0];
    message->index = (uint16_t)(frame->data[1] | ((unsigned)frame->data[2] << 8));
    message->count = is_fd(kind) ? frame->data[FD_COUNT] : 1u;
    head = is_fd(kind) ? FD_HEAD : CLASSIC_BYTES - 4u;
    for (i = 0; i < message->count; i++) {
        message->value[i] = get_word(&frame->data[head + 4u * i]);
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
