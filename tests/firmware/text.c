/* text.c: numbers without stdio. */
#include "board.h"

void board_write_decimal(uint32_t value)
{
    char text[11];
    unsigned at = sizeof text - 1u;
    text[at] = '\0';
    do {
        text[--at] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value > 0u);
    board_write(text + at);
}

void board_write_hex(uint32_t value)
{
    char text[9];
    for (unsigned i = 0; i < 8u; i++) {
        text[i] = "0123456789abcdef"[(value >> (28u - 4u * i)) & 15u];
    }
    text[8] = '\0';
    board_write(text);
}
