/* mps2.c: start-up code of the MPS2 boards (Cortex-M4F AN386, Cortex-M7 AN500), with semihosting for text and exit code.
 * No heap: mps2.ld defines no `end`, so a program that calls malloc does not link. */
#include "board.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SYST_CSR          REGISTER(0xE000E010u)
#define SYST_RVR          REGISTER(0xE000E014u)
#define SYST_CVR          REGISTER(0xE000E018u)
#define CPACR             REGISTER(0xE000ED88u)

extern uint32_t data_source[], data_begin[], data_end[], bss_begin[], bss_end[], stack_top[];

void reset_handler(void);
void fault_handler(void);

/* ARM semihosting: operation in r0, its parameter in r1. */
static int call_host(int operation, const void *parameter)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = parameter;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void board_write(const char *text)
{
    (void)call_host(0x04, text); /* SYS_WRITE0 */
}

void board_exit(int code)
{
    const uint32_t reason[2] = {0x20026u, (uint32_t)code}; /* ADP_Stopped_ApplicationExit */
    for (;;) {
        (void)call_host(0x20, reason); /* SYS_EXIT_EXTENDED */
    }
}

uint32_t board_ticks(void)
{
    return SYST_CVR;
}

void fault_handler(void)
{
    board_write("fault\n");
    board_exit(99);
}

void reset_handler(void)
{
    CPACR |= 0xFu << 20; /* the floating-point unit; without it the first instruction of it is a fault */
    __asm__ volatile("dsb\n isb" ::: "memory");
    for (uint32_t *from = data_source, *to = data_begin; to < data_end; from++, to++) {
        *to = *from;
    }
    for (uint32_t *to = bss_begin; to < bss_end; to++) {
        *to = 0;
    }
    SYST_RVR = 0xFFFFFFu;
    SYST_CVR = 0;
    SYST_CSR = 5; /* counting, from the processor's clock */
    board_exit(board_main());
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    stack_top,     reset_handler, fault_handler, fault_handler, fault_handler, fault_handler,
    fault_handler, fault_handler, fault_handler, fault_handler, fault_handler, fault_handler,
    fault_handler, fault_handler, fault_handler, fault_handler};
