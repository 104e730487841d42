#include "slcan.h"

#include <string.h>

static const uint8_t lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static char hex_digit(unsigned nibble)
{
    return "0123456789ABCDEF"[nibble & 15u];
}

static int find_length_code(uint8_t length)
{
    int code;
    for (code = 0; code < 16; code++) {
        if (lengths[code] == length) {
            return code;
        }
    }
    return -1;
}

static char choose_letter(uint8_t flags)
{
    const char *letters = (flags & AEO_CAN_EXTENDED) != 0u ? "TDB" : "tdb";
    if ((flags & AEO_CAN_FD) == 0u) {
        return letters[0];
    }
    return (flags & AEO_CAN_BRS) != 0u ? letters[2] : letters[1];
}

size_t slcan_format(const aeo_can_frame_t *frame, char *line)
{
    const unsigned digits = (frame->flags & AEO_CAN_EXTENDED) != 0u ? 8u : 3u;
    const uint32_t limit = digits == 8u ? UINT32_C(1) << 29 : UINT32_C(1) << 11;
    const int code = find_length_code(frame->length);
    size_t at = 0;
    unsigned i;
    if (code < 0 || frame->id >= limit || (code > 8 && (frame->flags & AEO_CAN_FD) == 0u)) {
        return 0;
    }
    line[at++] = choose_letter(frame->flags);
    for (i = digits; i > 0u; i--) {
        line[at++] = hex_digit((unsigned)(frame->id >> (4u * (i - 1u))));
    }
    line[at++] = hex_digit((unsigned)code);
    for (i = 0; i < frame->length; i++) {
        line[at++] = hex_digit((unsigned)frame->data[i] >> 4);
        line[at++] = hex_digit(frame->data[i]);
    }
    line[at++] = '\r';
    return at;
}

static int read_digit(char c)
{
    if (c >= '0' && c <= '9') {
        return c - '0';
    }
    if (c >= 'A' && c <= 'F') {
        return c - 'A' + 10;
    }
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* Read `digits` hexadecimal characters; -1 when one is none. At most 8 digits, so the value fits. */
static int64_t read_hex(const char *text, unsigned digits)
{
    int64_t value = 0;
    unsigned i;
    for (i = 0; i < digits; i++) {
        const int digit = read_digit(text[i]);
        if (digit < 0) {
            return -1;
        }
        value = value * 16 + digit;
    }
    return value;
}

int slcan_parse(const char *line, size_t length, aeo_can_frame_t *frame)
{
    static const char letters[] = "tTdDbB";
    static const uint8_t flags[] = {0,
                                    AEO_CAN_EXTENDED,
                                    AEO_CAN_FD,
                                    AEO_CAN_FD | AEO_CAN_EXTENDED,
                                    AEO_CAN_FD | AEO_CAN_BRS,
                                    AEO_CAN_FD | AEO_CAN_BRS | AEO_CAN_EXTENDED};
    const char *found = length > 0u && line[0] != '\0' ? strchr(letters, line[0]) : NULL;
    aeo_can_frame_t result;
    int64_t id, code, byte;
    unsigned digits, i;
    if (found == NULL) {
        return 0;
    }
    memset(&result, 0, sizeof result);
    result.flags = flags[found - letters];
    digits = (result.flags & AEO_CAN_EXTENDED) != 0u ? 8u : 3u;
    if (length < digits + 2u) {
        return 0;
    }
    id = read_hex(line + 1, digits);
    code = read_hex(line + 1 + digits, 1);
    if (id < 0 || id >= (digits == 8u ? INT64_C(1) << 29 : INT64_C(1) << 11) || code < 0 ||
        (code > 8 && (result.flags & AEO_CAN_FD) == 0u) || length != digits + 2u + 2u * lengths[code]) {
        return 0;
    }
    result.id = (uint32_t)id;
    result.length = lengths[code];
    for (i = 0; i < result.length; i++) {
        byte = read_hex(line + digits + 2u + 2u * i, 2);
        if (byte < 0) {
            return 0;
        }
        result.data[i] = (uint8_t)byte;
    }
    *frame = result;
    return 1;
}
