#include "mps2_board.h"

#define SYST_CSR       MPS2_REGISTER(0xE000E010u)
#define SYST_RVR       MPS2_REGISTER(0xE000E014u)
#define SYST_CVR       MPS2_REGISTER(0xE000E018u)
#define NVIC_ISER      MPS2_REGISTER(0xE000E100u) /* 32 interrupts are all these boards have */
#define NVIC_ISPR      MPS2_REGISTER(0xE000E200u)
#define NVIC_IPR(n)    (*(volatile uint8_t *)(0xE000E400u + (n)))
#define SCB_ICSR       MPS2_REGISTER(0xE000ED04u)
#define SCB_CPACR      MPS2_REGISTER(0xE000ED88u)
#define MPU_CTRL       MPS2_REGISTER(0xE000ED94u)
#define MPU_RBAR       MPS2_REGISTER(0xE000ED9Cu)
#define MPU_RASR       MPS2_REGISTER(0xE000EDA0u)
#define PEND_SYSTICK   (1u << 26)
#define SYSTICK_MOST   0xFFFFFFu
#define PATTERN        0xA5A5A5A5u
#define PATTERN_MARGIN 16u /* words below the start-up code's own frame that are left as they are */
#define SYS_WRITE0     0x04
#define SYS_ARGUMENTS  0x15
#define SYS_EXIT       0x20 /* extended: with an exit code */
#define EXIT_REASON    0x20026u
#define EXIT_FAULT     99
#define DIGITS         10u

extern uint32_t stack_guard[], data_source[], data_begin[], data_end[], bss_begin[], bss_end[], stack_bottom[],
    stack_top[];

void mps2_reset(void);
void mps2_fault(void);

/* ---- start-up ---------------------------------------------------------------------------------------------------- */

/* Words from `begin` to the address `end`: the linker script's symbols are objects of their own to the language. */
static uint32_t count_words(const uint32_t *begin, uint32_t end)
{
    return (end - (uint32_t)(uintptr_t)begin) / (uint32_t)sizeof *begin;
}

/* Nobody may touch the 256 bytes below the stack; everything else stays as without protection. */
static void guard_stack(void)
{
    MPU_RBAR = (uint32_t)(uintptr_t)stack_guard | 0x10u; /* region 0 */
    MPU_RASR = (1u << 28) | (7u << 1) | 1u;              /* no instructions, no access, 2^(7 + 1) bytes */
    MPU_CTRL = 5;                                        /* on, but not while a fault is handled */
    __asm__ volatile("dsb\n isb" ::: "memory");
}

void mps2_reset(void)
{
    uint32_t sp, i;
    SCB_CPACR |= 0xFu << 20; /* the floating-point unit; without it the first instruction of it is a fault */
    __asm__ volatile("dsb\n isb" ::: "memory");
    __asm__ volatile("mov %0, sp" : "=r"(sp));
    for (i = 0; i < count_words(stack_bottom, sp) - PATTERN_MARGIN; i++) {
        stack_bottom[i] = PATTERN;
    }
    for (i = 0; i < count_words(data_begin, (uint32_t)(uintptr_t)data_end); i++) {
        data_begin[i] = data_source[i];
    }
    for (i = 0; i < count_words(bss_begin, (uint32_t)(uintptr_t)bss_end); i++) {
        bss_begin[i] = 0;
    }
    guard_stack();
    mps2_exit(main());
}

void mps2_fault(void)
{
    __asm__ volatile(
        "mov sp, %0" ::"r"(stack_top)); /* the stack itself may be what ran out; nothing returns from here */
    mps2_exit(EXIT_FAULT);
}

typedef union {
    uint32_t *stack;
    void (*handler)(void);
} vector_t;

#define FAULT                                                                                                          \
    {                                                                                                                  \
        .handler = mps2_fault                                                                                          \
    }
#define FOUR_FAULTS     FAULT, FAULT, FAULT, FAULT
#define SYSTEM_HANDLERS FAULT, FOUR_FAULTS, FOUR_FAULTS, FOUR_FAULTS /* 2 ... 14, none of which this board uses */

__attribute__((section(".vectors"), used)) static const vector_t vectors[] = {
    {.stack = stack_top},      {.handler = mps2_reset}, SYSTEM_HANDLERS,
    {.handler = mps2_systick}, {.handler = mps2_uart0}, {.handler = mps2_uart0}};

/* ---- interrupts -------------------------------------------------------------------------------------------------- */

void mps2_start_systick(uint32_t period_us)
{
    const uint32_t ticks = MPS2_CLOCK_HZ / 1000000u * period_us;
    SYST_CSR = 0;
    SYST_RVR = ticks > 0u && ticks <= SYSTICK_MOST ? ticks - 1u : SYSTICK_MOST;
    SYST_CVR = 0;
    SYST_CSR = period_us > 0u ? 7u : 0u; /* counting the processor's clock, with an interrupt */
}

void mps2_raise_systick(void)
{
    SCB_ICSR = PEND_SYSTICK;
    __asm__ volatile("dsb\n isb" ::: "memory");
}

uint32_t mps2_systick_age(void)
{
    return (SYST_CSR & 1u) != 0u ? SYST_RVR - SYST_CVR : 0u;
}

void mps2_enable(unsigned number, uint32_t urgency)
{
    NVIC_IPR(number) = (uint8_t)urgency;
    NVIC_ISER = 1u << number;
}

void mps2_raise(unsigned number)
{
    NVIC_ISPR = 1u << number;
}

uint32_t mps2_mask(void)
{
    uint32_t before;
    __asm__ volatile("mrs %0, primask\n cpsid i" : "=r"(before)::"memory");
    return before;
}

void mps2_unmask(uint32_t before)
{
    __asm__ volatile("msr primask, %0\n isb" ::"r"(before) : "memory");
}

void mps2_barrier(void)
{
    __asm__ volatile("dmb" ::: "memory");
}

void mps2_wait(const volatile uint32_t *word, uint32_t seen)
{
    uint32_t before = mps2_mask();
    while (*word == seen) {
        __asm__ volatile("dsb\n wfi" ::: "memory"); /* a masked interrupt wakes too, and is served by the unmasking */
        mps2_unmask(before);
        before = mps2_mask();
    }
    mps2_unmask(before);
}

/* ---- figures and semihosting ------------------------------------------------------------------------------------- */

uint32_t mps2_stack_size(void)
{
    return (uint32_t)sizeof *stack_bottom * count_words(stack_bottom, (uint32_t)(uintptr_t)stack_top);
}

uint32_t mps2_stack_used(void)
{
    const volatile uint32_t *words = stack_bottom;
    const uint32_t count = count_words(stack_bottom, (uint32_t)(uintptr_t)stack_top);
    uint32_t untouched = 0;
    while (untouched < count && words[untouched] == PATTERN) {
        untouched++;
    }
    return (uint32_t)sizeof *words * (count - untouched);
}

/* ARM semihosting: operation in r0, its parameter in r1. */
static int call_host(int operation, const void *parameter)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = parameter;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void mps2_write(const char *text)
{
    (void)call_host(SYS_WRITE0, text);
}

void mps2_write_decimal(uint32_t value)
{
    char text[DIGITS + 1u];
    unsigned at = DIGITS;
    text[at] = '\0';
    do {
        text[--at] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value > 0u);
    mps2_write(text + at);
}

void mps2_arguments(char *text, size_t size)
{
    const uint32_t block[2] = {(uint32_t)(uintptr_t)text, (uint32_t)size};
    if (call_host(SYS_ARGUMENTS, block) != 0) {
        text[0] = '\0';
    }
    text[size - 1u] = '\0';
}

void mps2_exit(int code)
{
    const uint32_t reason[2] = {EXIT_REASON, (uint32_t)code};
    for (;;) {
        (void)call_host(SYS_EXIT, reason);
    }
}
/* SPDX-License-Identifier: MIT */
