#include "excitation.h"

#include "records.h"

#include <math.h>
#include <string.h>

#define TWO_PI      6.283185307179586
#define PEAK_POINTS 65536u /* instants at which the peak of a multisine is looked for */

/* ---- sequences --------------------------------------------------------------------------------------------------- */

/* Feedback taps of maximum-length registers, bit i - 1 for stage i (Golomb, "Shift register sequences", 1967). A test
 * runs each through its period. */
static const uint16_t taps[EXCITATION_ORDER_MAX + 1] = {
    [5] = 0x14,   [6] = 0x30,   [7] = 0x60,    [8] = 0xB8,    [9] = 0x110,   [10] = 0x240,
    [11] = 0x500, [12] = 0xE08, [13] = 0x1C80, [14] = 0x3802, [15] = 0x6000,
};

static unsigned parity(uint32_t word)
{
    unsigned odd = 0;
    for (; word != 0u; word &= word - 1u) {
        odd ^= 1u;
    }
    return odd;
}

static void make_bits(excitation_t *self)
{
    const unsigned order = self->settings.order;
    uint32_t state;
    self->period = (UINT32_C(1) << order) - 1u;
    state = 1u + self->settings.seed % self->period; /* any state but 0 */
    for (uint32_t i = 0; i < self->period; i++) {
        if ((state & 1u) != 0u) {
            self->bits[i / 8u] |= (uint8_t)(1u << (i % 8u));
        }
        state = ((state << 1) | parity(state & taps[order])) & self->period;
    }
}

/* Spread 32 bits over 0 ... 1 (the finaliser of MurmurHash3, public domain by its author A. Appleby). */
static double scatter(uint32_t word)
{
    word ^= word >> 16;
    word *= UINT32_C(0x85EBCA6B);
    word ^= word >> 13;
    word *= UINT32_C(0xC2B2AE35);
    word ^= word >> 16;
    return (double)word / 4294967296.0;
}

static double line_hz(const excitation_settings_t *s, unsigned line)
{
    return s->lines > 1u ? s->low_hz + (s->high_hz - s->low_hz) * line / (s->lines - 1u) : s->low_hz;
}

/* Sum of the cosines, without gain; sequence 0 ... 2 is shifted in time by so many thirds of the longest period. */
static double sum_lines(const excitation_t *self, double time_s, unsigned sequence)
{
    const excitation_settings_t *s = &self->settings;
    const double shifted = time_s + sequence / (3.0 * s->low_hz);
    double sum = 0;
    for (unsigned i = 0; i < s->lines; i++) {
        sum += cos(TWO_PI * line_hz(s, i) * shifted + self->phase[i]);
    }
    return sum;
}

static void make_lines(excitation_t *self)
{
    const excitation_settings_t *s = &self->settings;
    const double span = s->stop_s - s->start_s + 1.0 / s->low_hz;
    const double fine = 1.0 / (16.0 * s->high_hz);
    const double step = span / fine > PEAK_POINTS ? span / PEAK_POINTS : fine;
    double peak = 1.0;
    for (unsigned i = 0; i < s->lines; i++) {
        /* a common turn in time keeps the low peak and makes the seed another signal */
        self->phase[i] =
            -TWO_PI / 2.0 * i * (i + 1.0) / s->lines + TWO_PI * line_hz(s, i) * scatter(s->seed) / s->low_hz;
    }
    for (double t = 0; t < span; t += step) {
        const double size = fabs(sum_lines(self, t, 0));
        peak = size > peak ? size : peak;
    }
    self->gain = s->amplitude / peak;
}

void excitation_init(excitation_t *self, const excitation_settings_t *settings)
{
    memset(self, 0, sizeof *self);
    self->settings = *settings;
    if (settings->signal == SIGNAL_PRBS) {
        make_bits(self);
    } else if (settings->signal == SIGNAL_MULTISINE) {
        make_lines(self);
    }
}

/* ---- one call ---------------------------------------------------------------------------------------------------- */

static double clamp(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* The signal `since` seconds after its start, within +-amplitude. */
static double read_signal(const excitation_t *self, double since, unsigned sequence)
{
    const excitation_settings_t *s = &self->settings;
    uint32_t at;
    if (s->signal == SIGNAL_MULTISINE) { /* between the instants searched the peak may be passed by a little */
        return clamp(self->gain * sum_lines(self, since, sequence), -s->amplitude, s->amplitude);
    }
    at = (uint32_t)(fmod(floor(since / s->hold_s), self->period) + sequence * (self->period / 3u)) % self->period;
    return ((unsigned)self->bits[at / 8u] >> (at % 8u) & 1u) != 0u ? s->amplitude : -s->amplitude;
}

static double find_target(const excitation_t *self, double time_s, double azimuth_rad, unsigned blades, unsigned b)
{
    const excitation_settings_t *s = &self->settings;
    const double psi = azimuth_rad + TWO_PI * b / (blades > 0u ? blades : 1u);
    if (s->signal == SIGNAL_OFF || !(time_s >= s->start_s && time_s < s->stop_s)) {
        return 0;
    }
    switch (s->form) {
    case FORM_INDIVIDUAL:
        return read_signal(self, time_s - s->start_s, b);
    case FORM_TILT:
        return read_signal(self, time_s - s->start_s, 0) * cos(psi);
    case FORM_YAW:
        return read_signal(self, time_s - s->start_s, 0) * sin(psi);
    case FORM_COLLECTIVE:
    default:
        return read_signal(self, time_s - s->start_s, 0);
    }
}

void excitation_advance(excitation_t *self, double time_s, double azimuth_rad, unsigned blades,
                        const uint8_t allowed[EXCITATION_BLADES])
{
    const double dt = self->moving ? time_s - self->last_s : 0.0;
    if (self->settings.signal == SIGNAL_OFF || !(fabs(time_s) <= 1e12) || (self->moving && !(dt > 0))) {
        return; /* a repeated or repaired step has had its move */
    }
    for (unsigned b = 0; b < EXCITATION_BLADES; b++) {
        const double most = self->settings.rate * dt;
        double target = allowed[b] != 0u ? find_target(self, time_s, azimuth_rad, blades, b) : 0.0;
        if (!(target >= -self->settings.amplitude && target <= self->settings.amplitude)) {
            target = 0; /* an azimuth that is NaN */
        }
        self->value[b] = clamp(target, self->value[b] - most, self->value[b] + most);
    }
    self->last_s = time_s;
    self->moving = 1;
}

void excitation_rewind(excitation_t *self)
{
    self->moving = 0;
}

int excitation_allowed(const excitation_t *self, float command)
{
    const double demand = (double)command;
    return records_finite(command) && demand >= self->settings.minimum && demand <= self->settings.maximum;
}

float excitation_apply(const excitation_t *self, unsigned b, float command)
{
    const double e = self->value[b], demand = (double)command;
    double low, high;
    float total;
    if (self->settings.signal == SIGNAL_OFF || !(e < 0 || e > 0) || !records_finite(command)) {
        return command;
    }
    low = demand < self->settings.minimum ? demand : self->settings.minimum;
    high = demand > self->settings.maximum ? demand : self->settings.maximum;
    total = (float)clamp(demand + e, low, high);
    if ((double)total < low) { /* rounding to float may have passed the limit: one step inwards */
        total = nextafterf(total, INFINITY);
    } else if ((double)total > high) {
        total = nextafterf(total, -INFINITY);
    }
    return total;
}

int excitation_over(const excitation_t *self, double time_s)
{
    if (self->settings.signal == SIGNAL_OFF) {
        return 1;
    }
    for (unsigned b = 0; b < EXCITATION_BLADES; b++) {
        if (self->value[b] < 0 || self->value[b] > 0) {
            return 0;
        }
    }
    return time_s >= self->settings.stop_s;
}
/* SPDX-License-Identifier: MIT */
