/* mps2_port.h: carries frames as slcan text out of the UART of an MPS2 board (AN386 Cortex-M4F, AN500 Cortex-M7).
 *
 * MODEL
 *   Each context interrupts those to the right of it:
 *
 *     control task (SysTick)         UART interrupts                  main loop
 *     ----------------------         ---------------                  ---------
 *     filter update                  one character leaves the ring,   aeo_stream_step --send--> ring
 *     aeo_stream_sample --send-->    one of the host's comes
 *     aeo_stream_snapshot
 *
 *   A line is put into the ring whole or refused; nobody waits for the UART. Software raises the transmit interrupt when
 *   it has filled the ring, the UART raises it for each character after that. Registers: Arm DDI 0479, "Cortex-M System
 *   Design Kit", APB UART and APB timer.
 *   Commands, all that is ever read: O and L open the channel, C closes it, V and N are answered, settings (S s F Z M m
 *   W X) are acknowledged and have no effect; everything else, frames above all, gets BEL and is forgotten. While the
 *   channel is closed frames are taken and lost, as on a bus that nobody reads.
 *
 * CONTRACT
 *   Memory: the structure, MPS2_RING bytes and 32. Stack: send 180 bytes, the interrupt 40 (Cortex-M4F, gcc 12 -O2).
 *   Determinism: send takes 495 instructions for a classic frame; an interrupt moves one character each way.
 *   Threads and interrupts: one writer of the ring at a time, by lock (PRIMASK); mps2_port_serve, the handler of both
 *   interrupts of the UART, is its only reader. What delays the control task is a frame that the main loop makes: 1,110
 *   instructions measured.
 *   Failures: a line without room is refused, and the streamer counts it (counters.dropped or refused).
 *
 * WIRING
 *   INPUTS, OUTPUTS, N, settings, filter, identification_init, read_sensors and control_task are the controller's own:
 *
 *     static mps2_port_t uart;
 *     static aeo_stream_t stream;
 *     static uint32_t snapshot[AEO_STREAM_WORDS(N * OUTPUTS)];
 *     static volatile uint32_t samples;
 *     void mps2_uart0(void) { mps2_port_serve(&uart); }
 *     void mps2_systick(void)
 *     {
 *         aeo_real_t u[INPUTS], y[OUTPUTS];
 *         read_sensors(u, y);
 *         control_task(u, y, UINT64_C(100000) * samples);
 *         (void)aeo_stream_sample(&stream, samples, u, y, NULL);
 *         if (samples % 100 == 99) (void)aeo_stream_snapshot(&stream, samples, aeo_rls_theta(&filter));
 *         samples++;
 *     }
 *     int main(void)
 *     {
 *         aeo_port_t port;
 *         mps2_port_init(&uart, &port, 921600);
 *         if (identification_init() && aeo_stream_init(&stream, &settings, &port, snapshot, N * OUTPUTS) == AEO_OK)
 *             mps2_start_systick(100000);
 *         for (uint32_t k = 0;; k++) { mps2_wait(&samples, k); (void)aeo_stream_step(&stream); }
 *     }
 */
#ifndef AEOLID_MPS2_PORT_H
#define AEOLID_MPS2_PORT_H

#include <aeolid/port.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Characters of the ring, a power of two, 256 ... 65536; a classic frame takes 27. Too small: samples are dropped; too
 * large: a deaf host is noticed late. A sample and one burst of aeo_stream_step should fit: 2048 to start with. */
#ifndef MPS2_RING
#define MPS2_RING 2048u
#endif
#if MPS2_RING < 256 || MPS2_RING > 65536 || (MPS2_RING & (MPS2_RING - 1)) != 0
#error "MPS2_RING is a power of two, 256 ... 65536"
#endif

/* Private but readable in a debugger. */
typedef struct {
    volatile uint8_t ring[MPS2_RING];
    volatile uint32_t head; /* characters written, interrupts kept out; wraps */
    volatile uint32_t tail; /* characters taken, by the interrupt alone; wraps */
    volatile uint32_t open; /* 1: a host has opened the channel */
    uint32_t primask;       /* before lock */
    uint32_t timer;         /* its value at the last reading, counting down */
    uint32_t rest;          /* ticks that make no microsecond yet */
    uint32_t clock_us;      /* wraps */
    uint8_t length;         /* of the command being received, 0 ... 255, there it stays */
    char letter;            /* its first character */
} mps2_port_t;

/* Set UART 0 up for `baud` bits a second (400 ... 1562500) and timer 0 as the clock, enable the UART's interrupts below
 * all others and fill `port` with the callbacks of self. The channel is closed. time_us must be read every 170 s. */
void mps2_port_init(mps2_port_t *self, aeo_port_t *port, uint32_t baud);

/* Serve the UART: called by the handler of its interrupts, mps2_uart0 of mps2_board.h. */
void mps2_port_serve(mps2_port_t *self);

/* Return the characters that wait to be sent, 0 ... MPS2_RING. */
uint32_t mps2_port_waiting(const mps2_port_t *self);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
