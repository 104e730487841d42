#include "sample_clock.h"

#include <math.h>
#include <string.h>

#define BACK_MOST    2     /* samples a repaired step may go back */
#define FORWARD_MOST 10000 /* samples a hole may have; the wire counts them modulo 65536 */

/* The decimal number of nanoseconds that a float step stands for, where there is one: 0.01 and not 0.00999999978. */
static double find_decimal(double step_s)
{
    const double decimal = floor(step_s * 1e9 + 0.5) / 1e9;
    const float given = (float)step_s, found = (float)decimal;
    return memcmp(&given, &found, sizeof given) == 0 ? decimal : step_s;
}

int sample_clock_init(sample_clock_t *self, double step_s, unsigned decimation)
{
    memset(self, 0, sizeof *self);
    if (!(step_s >= 1e-6 && step_s <= 1000.0) || decimation < 1u) {
        return -1;
    }
    self->step_s = find_decimal(step_s);
    self->decimation = decimation;
    return 0;
}

static clock_tick_t start(sample_clock_t *self, double time_s)
{
    const clock_tick_t tick = self->running ? CLOCK_JUMPED : CLOCK_SAMPLE;
    if (self->running) {
        self->index += 2u;
        self->elapsed++;
    }
    self->base = self->index;
    self->origin_s = time_s;
    self->newest = 0;
    self->running = 1;
    return tick;
}

clock_tick_t sample_clock_take(sample_clock_t *self, double time_s)
{
    const double steps = (time_s - self->origin_s) / self->step_s;
    const int64_t k = (int64_t)self->decimation;
    int64_t n;
    if (!(fabs(time_s) <= 1e12)) {
        return CLOCK_REPEATED;
    }
    if (!self->running || steps > (double)(self->newest + FORWARD_MOST * k) ||
        steps < (double)(self->newest - BACK_MOST * k) - 0.5) {
        return start(self, time_s);
    }
    n = (int64_t)floor(steps + 0.5);
    if (n <= self->newest) {
        return CLOCK_REPEATED;
    }
    self->elapsed += (uint64_t)(n - self->newest);
    self->newest = n;
    if (n % k != 0) {
        return CLOCK_STEP;
    }
    self->index = self->base + (uint32_t)(n / k);
    return CLOCK_SAMPLE;
}
/* SPDX-License-Identifier: MIT */
