/* pc.c: a PC as a board. */
#include "board.h"

#include <stdio.h>
#include <stdlib.h>

void board_write(const char *text)
{
    fputs(text, stdout);
}

void board_exit(int code)
{
    exit(code);
}

uint32_t board_ticks(void)
{
    return 0;
}

#ifndef COSTS_ON_PC
int main(void)
{
    return board_main();
}
#endif
