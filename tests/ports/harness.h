/* harness.h: what the blocks shown leave to the controller: sensors, a driver; and the dumps that tests compare.
 *
 * A program here is: #include "harness.h", #include "wiring.h", then the rest. wiring.h has the blocks of README.md
 * and docs/howto/port.md, as they are.
 */
#ifndef HARNESS_H
#define HARNESS_H

#include <aeolid/config.h>
#include <aeolid/port.h>

#include <stdio.h>
#include <stdlib.h>

/* Of the blocks. */
int identification_init(void);
void control_task(const aeo_real_t u[2], const aeo_real_t y[3], uint64_t time_us);
int stream_init(const aeo_port_t *port);
void take_sample(const aeo_real_t u[2], const aeo_real_t y[3], uint32_t k);
int can_start(void);
void mailbox_is_free_interrupt(void);
void background_task(void);
void FDCAN1_IT0_IRQHandler(void);
uint32_t read_timer_us(void);

/* Of the controller. read_sensors returns 0 when there are no more samples. */
int read_sensors(aeo_real_t *u, aeo_real_t *y);
int mailbox_is_free(void);
void mailbox_fill(uint32_t id, const uint8_t *data, uint8_t length);
void request_mailbox_interrupt(void);

/* A plant with a memory, driven by noise: the same bits on every machine, for no result is rounded twice. */
static inline aeo_real_t harness_draw(void)
{
    static uint32_t state = 1;
    state = state * 1664525u + 1013904223u;
    return ((aeo_real_t)(state >> 16) - AEO_REAL(32768.0)) / AEO_REAL(32768.0);
}

static inline void harness_sensors(aeo_real_t *u, aeo_real_t *y)
{
    static aeo_real_t state[3];
    unsigned i;
    u[0] = harness_draw();
    u[1] = harness_draw();
    for (i = 0; i < 3u; i++) {
        const aeo_real_t kept = AEO_REAL(0.875) * state[i];
        const aeo_real_t pushed = AEO_REAL(0.25) * u[i % 2u];
        state[i] = kept + pushed;
        y[i] = state[i] + harness_draw() / AEO_REAL(64.0);
    }
}

#endif
