/* mps2_board.h: start-up, interrupts, sleep and semihosting of an MPS2 board, as much as a node needs.
 *
 * MODEL
 *   Below the stack lie 256 bytes that the memory protection unit guards: one that grows too far is a fault, which ends
 *   the image with exit code 99, as every other fault does. There is no heap: mps2.ld has no `end`, so a program that
 *   calls malloc does not link.
 *
 * CONTRACT
 *   Memory: none but the stack, MPS2_STACK bytes of mps2.ld, which main and all interrupts share.
 *   The semihosting calls (write, arguments, exit) stop the processor until a debugger or an emulator answers; without
 *   one they are a fault. All else runs on a bare board.
 */
#ifndef AEOLID_MPS2_BOARD_H
#define AEOLID_MPS2_BOARD_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MPS2_CLOCK_HZ          25000000u /* of processor, SysTick, timers and UARTs */
#define MPS2_SYSTICK_MAX_US    671000u   /* its 24 bits hold no more */
#define MPS2_REGISTER(address) (*(volatile uint32_t *)(address))

/* Interrupts by number, and the urgencies: 0 is the most urgent, SysTick has it. */
#define MPS2_UART0_RECEIVE  0u
#define MPS2_UART0_TRANSMIT 1u
#define MPS2_LEAST_URGENT   0xE0u

/* The image defines these: its program, and the handlers of the interrupts that it uses. */
int main(void);
void mps2_systick(void);
void mps2_uart0(void); /* both interrupts of UART 0 */

/* Call mps2_systick every period_us, 1 ... MPS2_SYSTICK_MAX_US; 0: only when mps2_raise_systick does. */
void mps2_start_systick(uint32_t period_us);
void mps2_raise_systick(void);

/* Return the ticks of 40 ns since SysTick was due last, 0 when only mps2_raise_systick calls it. */
uint32_t mps2_systick_age(void);

/* Let an interrupt through, at an urgency that is a multiple of 32; raise it as if its device had. */
void mps2_enable(unsigned number, uint32_t urgency);
void mps2_raise(unsigned number);

/* Keep all interrupts out and return what was; put that back. */
uint32_t mps2_mask(void);
void mps2_unmask(uint32_t before);

/* Let no access to memory move across. */
void mps2_barrier(void);

/* Sleep until `*word`, which an interrupt writes, is no longer `seen`. Nothing is missed between look and sleep. */
void mps2_wait(const volatile uint32_t *word, uint32_t seen);

/* Return the deepest that the stack has been, in bytes, and its size: start-up fills it with a pattern. */
uint32_t mps2_stack_used(void);
uint32_t mps2_stack_size(void);

/* Write a text that ends with 0, or a number in decimal, to the debugger. */
void mps2_write(const char *text);
void mps2_write_decimal(uint32_t value);

/* Fetch the command line, cut to size - 1 characters, 0 at its end; empty without one. */
void mps2_arguments(char *text, size_t size);

/* End the image; the emulator ends with this exit code. */
void mps2_exit(int code);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
