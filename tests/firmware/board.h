/* board.h: what a program of these images needs of the machine it runs on. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

/* Write a text that ends with 0 to whoever started the image. */
void board_write(const char *text);

/* End the image; the starter sees this exit code. */
void board_exit(int code);

/* Return a count that falls by 8 every 5 instructions and wraps at 2^24: SysTick at 25 MHz where every instruction is
 * declared to take 64 ns. 0 for ever where there is no such counter. */
uint32_t board_ticks(void);

/* The program; the machine's start-up code calls it. */
int board_main(void);

/* Write a number in decimal or as eight hexadecimal digits. */
void board_write_decimal(uint32_t value);
void board_write_hex(uint32_t value);

#endif
