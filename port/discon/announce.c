#include "announce.h"

#include "../common/method_names.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    char text[ANNOUNCE_MAX];
    size_t length;
} line_t;

__attribute__((format(printf, 2, 3))) static void add(line_t *self, const char *format, ...)
{
    const size_t room = sizeof self->text - self->length;
    va_list values;
    int written;
    va_start(values, format);
    written = vsnprintf(self->text + self->length, room, format, values);
    va_end(values);
    if (written > 0) {
        self->length += (size_t)written < room ? (size_t)written : room - 1u;
    }
}

static void put(const line_t *self)
{
    (void)fprintf(stdout, "%s\n", self->text);
    (void)fflush(stdout);
}

static void add_channels(line_t *line, const settings_t *s)
{
    static const char *const role[] = {"input", "output", "scheduling"};
    unsigned at = 0;
    for (unsigned r = 0; r < 3u; r++) {
        for (unsigned i = 0; i < s->taps[r]; i++) {
            add(line, "%s%s", i == 0u ? (at == 0u ? "" : "; ") : ", ", i == 0u ? role[r] : "");
            add(line, "%s%s", i == 0u ? " " : "", s->tap[at + i].name);
        }
        at += s->taps[r];
    }
}

static void add_excitation(line_t *line, const char *name, const excitation_settings_t *e)
{
    if (e->signal != SIGNAL_OFF) {
        add(line, "; %s excitation %g to %g s", name, e->start_s, e->stop_s);
    }
}

static void add_bus(line_t *line, const observer_t *observer)
{
    const settings_t *s = observer->settings;
    switch (s->bus) {
    case BUS_FILE:
        add(line, "; frames to %s", observer->bus.path);
        break;
    case BUS_CAN:
        add(line, "; frames to can:%s", s->bus_name);
        break;
    case BUS_TCP:
    case BUS_PTY:
        add(line, "; aeolid listen --bus %s", bus_address(&observer->bus));
        break;
    case BUS_NONE:
    default:
        add(line, "; frames to nowhere");
        break;
    }
}

void announce_start(const observer_t *observer)
{
    const settings_t *s = observer->settings;
    line_t line = {"", 0};
    add(&line, "aeolid-discon: turbine %u: ", observer->turbine);
    add_channels(&line, s);
    add(&line, "; %g samples a second; filter %s, past %u, %u x %u parameters", 1e6 / (double)observer->period_us,
        method_name((unsigned)s->method), s->past, s->taps[ROLE_OUTPUT],
        (unsigned)observer->estimator.regressor.length);
    add_excitation(&line, "pitch", &s->pitch);
    add_excitation(&line, "torque", &s->torque);
    add_bus(&line, observer);
    put(&line);
}

void announce_end(const observer_t *observer, int whole)
{
    const aeo_regressor_count_t *count = &observer->estimator.regressor.count;
    const aeo_stream_counters_t *sent = &observer->stream.counters;
    line_t line = {"", 0};
    add(&line, "aeolid-discon: turbine %u: %s: %u samples filtered, %u refused (%u beyond min or max%s); ",
        observer->turbine, whole ? "end" : "no last call came, the stream has no end", (unsigned)count->samples,
        (unsigned)(count->not_finite + count->range + count->time), (unsigned)count->range,
        count->range > 0u ? ", where not given offset - 100 scale and offset + 100 scale" : "");
    add(&line, "%u frames sent, %u lost; %u snapshots", (unsigned)sent->sent, (unsigned)sent->dropped,
        (unsigned)sent->snapshots);
    if (observer->watch.told_channels > 0u) {
        add(&line, "; %u channel%s to look at, see standard error", observer->watch.told_channels,
            observer->watch.told_channels == 1u ? "" : "s");
    }
    put(&line);
}
/* SPDX-License-Identifier: MIT */
