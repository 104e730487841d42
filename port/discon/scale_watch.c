#include "scale_watch.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define NUMBER_MAX 32
#define BLOCK_S    60.0
#define BLOCK_MIN  100.0
#define BLOCK_MAX  1e6
#define LAST_LEAST 20u  /* samples that are judged at the end of a run */
#define FACTOR     30.0 /* by which scale and deviation may differ */
#define OFF_MOST   10.0 /* scales by which offset and mean may */

static double later(const excitation_settings_t *e, double time_s)
{
    return e->signal != SIGNAL_OFF && e->start_s > time_s ? e->start_s : time_s;
}

static double earlier(const excitation_settings_t *e, double time_s)
{
    return e->signal != SIGNAL_OFF && e->stop_s < time_s ? e->stop_s : time_s;
}

void scale_watch_init(scale_watch_t *self, const settings_t *settings, double sample_time_s)
{
    const double samples = BLOCK_S / sample_time_s; /* sample_time_s is at least 2e-5 s */
    memset(self, 0, sizeof *self);
    self->settings = settings;
    self->period_s = sample_time_s;
    self->block = (uint32_t)(samples < BLOCK_MIN ? BLOCK_MIN : samples > BLOCK_MAX ? BLOCK_MAX : samples + 0.5);
    self->from_s = later(&settings->torque, later(&settings->pitch, -HUGE_VAL));
    self->until_s = earlier(&settings->torque, earlier(&settings->pitch, HUGE_VAL));
}

static unsigned count_filtered(const scale_watch_t *self)
{
    return self->settings->taps[ROLE_INPUT] + self->settings->taps[ROLE_OUTPUT];
}

int scale_watch_take(scale_watch_t *self, const float *value, double time_s)
{
    if (!(time_s >= self->from_s && time_s <= self->until_s)) {
        return 0;
    }
    for (unsigned i = 0; i < count_filtered(self); i++) {
        const tap_t *tap = &self->settings->tap[i];
        watch_sums_t *sums = &self->now[i];
        double x, step;
        if (!records_finite(value[i])) {
            continue;
        }
        x = ((double)value[i] - (double)tap->offset) / (double)tap->scale; /* scale >= 1e-30 */
        if (sums->count == 0u) {
            sums->first = value[i];
        }
        sums->moved |= value[i] < sums->first || value[i] > sums->first;
        sums->count++;
        step = x - sums->mean;
        sums->mean += step / (double)sums->count;
        sums->square += step * (x - sums->mean);
    }
    self->samples++;
    return self->samples >= self->block;
}

/* Significant digits that show a mean to a tenth of the deviation. */
static int choose_digits(double mean, double deviation)
{
    const double digits = 2.0 + floor(log10(fabs(mean) / deviation + 1.0));
    return digits > 9.0 ? 9 : (int)digits;
}

static watch_kind_t classify(const watch_sums_t *sums, double *deviation)
{
    *deviation = sums->count > 1u ? sqrt(sums->square / (double)sums->count) : 0.0;
    if (sums->count == 0u) {
        return WATCH_MISSING;
    }
    if (!sums->moved) {
        return WATCH_CONSTANT;
    }
    return *deviation < 1.0 / FACTOR || *deviation > FACTOR || fabs(sums->mean) > OFF_MOST ? WATCH_SCALE : WATCH_FINE;
}

/* Write a number as the settings read it: with a point, whatever the simulator's locale. */
static const char *write_number(char text[NUMBER_MAX], int digits, double value)
{
    const size_t length = (size_t)snprintf(text, NUMBER_MAX, "%.*g", digits, value);
    const size_t whole = strspn(text, "+-0123456789");
    const size_t mark = strcspn(text + whole, "+-0123456789e");
    if (mark > 0u && whole + mark <= length) {
        text[whole] = '.';
        memmove(text + whole + 1u, text + whole + mark, length - whole - mark + 1u);
    }
    return text;
}

static void say_scale(char *text, const tap_t *tap, const watch_sums_t *sums, double deviation)
{
    const double scale = deviation * (double)tap->scale;
    const double offset = sums->mean * (double)tap->scale + (double)tap->offset;
    const char *effect = deviation < 1.0 / FACTOR ? "the filter hardly sees it"
                         : deviation > FACTOR     ? "it drowns the others in the filter"
                                                  : "its samples are near the end of the range or beyond";
    char number[6][NUMBER_MAX];
    (void)snprintf(text, SCALE_WATCH_TEXT_MAX,
                   "%s: its mean lies %s scales from its offset and its deviation is %s scales (offset %s, scale %s "
                   "%s): %s; `offset %s scale %s` would fit",
                   tap->name, write_number(number[0], 3, sums->mean), write_number(number[1], 2, deviation),
                   write_number(number[2], 6, (double)tap->offset), write_number(number[3], 6, (double)tap->scale),
                   tap->unit, effect, write_number(number[4], choose_digits(offset, scale), offset),
                   write_number(number[5], 2, scale));
}

static void say_constant(char *text, const tap_t *tap, const watch_sums_t *sums, double seconds)
{
    const int is_input = tap->role == ROLE_INPUT;
    char number[NUMBER_MAX];
    (void)snprintf(text, SCALE_WATCH_TEXT_MAX,
                   "%s: constant at %s %s for %.0f s: nothing can be learnt of it; %s; on the host give it the role "
                   "ignore, and identify without --markov what a filter with it has sent",
                   tap->name, write_number(number, 7, (double)sums->first), tap->unit, seconds,
                   is_input ? "excite it, or take its `input` line out"
                            : "take its `output` line out, or let the simulator fill its record");
}

int scale_watch_judge(scale_watch_t *self, unsigned i, int last, char text[SCALE_WATCH_TEXT_MAX])
{
    const int whole = self->samples >= self->block;
    const int older = last && self->samples < LAST_LEAST && self->blocks > 0u;
    const watch_sums_t *sums = older ? &self->before[i] : &self->now[i];
    const tap_t *tap = &self->settings->tap[i];
    const double seconds = self->period_s * (double)(older ? self->block : self->samples);
    double deviation;
    watch_kind_t kind;
    if (i >= count_filtered(self) || (!whole && !older && self->samples < LAST_LEAST)) {
        return 0;
    }
    kind = classify(sums, &deviation);
    if (kind == WATCH_FINE || (kind == WATCH_SCALE && !last && self->blocks == 0u) ||
        ((unsigned)self->told[i] >> (unsigned)kind & 1u) != 0u) {
        return 0;
    }
    self->told_channels += self->told[i] == 0u ? 1u : 0u;
    self->told[i] = (uint8_t)(self->told[i] | 1u << (unsigned)kind);
    if (kind == WATCH_SCALE) {
        say_scale(text, tap, sums, deviation);
    } else if (kind == WATCH_CONSTANT) {
        say_constant(text, tap, sums, seconds);
    } else {
        (void)snprintf(text, SCALE_WATCH_TEXT_MAX,
                       "%s: no finite value for %.0f s, so no sample is filtered; take its line out of the settings",
                       tap->name, seconds);
    }
    return 1;
}

void scale_watch_next(scale_watch_t *self)
{
    memcpy(self->before, self->now, sizeof self->before);
    memset(self->now, 0, sizeof self->now);
    self->samples = 0;
    self->blocks++;
}
/* SPDX-License-Identifier: MIT */
