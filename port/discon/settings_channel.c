#include "settings_channel.h"

#include <stdio.h>
#include <string.h>

#define LARGEST   1e30
#define PLAUSIBLE 100.0F /* standard deviations */

unsigned settings_taps(const settings_t *self)
{
    return self->taps[ROLE_INPUT] + self->taps[ROLE_OUTPUT] + self->taps[ROLE_SCHEDULING];
}

/* The words of a line, each with its value. */
enum { SCALE, OFFSET, MINIMUM, MAXIMUM, NAME, UNIT, OPTIONS };
static const char *const options[OPTIONS] = {"scale", "offset", "min", "max", "name", "unit"};

/* What a line says of its channel. */
typedef struct {
    int has[OPTIONS]; /* 1: the word stands there */
    int known;        /* 1: name and unit are those of the table, unless the line has others */
} given_t;

static int find_tap(const settings_t *self, const char *name)
{
    for (unsigned i = 0; i < settings_taps(self); i++) {
        if (strcmp(self->tap[i].name, name) == 0) {
            return 1;
        }
    }
    return 0;
}

/* Read the channel's own word: a name of the table or record:NUMBER. */
static int read_source(const text_t *text, const char *key, const char *word, tap_t *tap, given_t *given)
{
    const named_record_t *entry = records_find(word);
    double number;
    if (entry != NULL) {
        tap->source = entry->source;
        tap->record = entry->record;
        (void)snprintf(tap->name, sizeof tap->name, "%s", entry->name);
        (void)snprintf(tap->unit, sizeof tap->unit, "%s", entry->unit);
        given->known = 1;
        return 0;
    }
    if (strncmp(word, "record:", 7) != 0) {
        return text_refuse(text, key, word, "a channel of port/discon/records.c or record:NUMBER is needed");
    }
    if (text_number(text, key, word + 7, 1, 65535, 1, &number) != 0) {
        return -1;
    }
    tap->source = SOURCE_DEMANDED; /* after the call both a measurement and a demand stand in the array */
    tap->record = (uint16_t)number;
    return 0;
}

static int read_float(const text_t *text, const char *word, const char *value, double low, float *target)
{
    double number;
    if (text_number(text, word, value, low, LARGEST, 0, &number) != 0) {
        return -1;
    }
    *target = (float)number;
    return 0;
}

static int read_option(const text_t *text, const char *word, const char *value, tap_t *tap, given_t *given)
{
    unsigned option = 0;
    while (option < OPTIONS && strcmp(word, options[option]) != 0) {
        option++;
    }
    if (option == OPTIONS) {
        return text_refuse(text, word, value, "scale, offset, min, max, name or unit, each with its value, is needed");
    }
    if (given->has[option]) {
        return text_refuse(text, word, value, "stands in this line twice; remove one of them");
    }
    given->has[option] = 1;
    switch (option) {
    case SCALE:
        return read_float(text, word, value, 1e-30, &tap->scale);
    case OFFSET:
        return read_float(text, word, value, -LARGEST, &tap->offset);
    case MINIMUM:
        return read_float(text, word, value, -LARGEST, &tap->minimum);
    case MAXIMUM:
        return read_float(text, word, value, -LARGEST, &tap->maximum);
    case NAME:
        return text_copy(text, word, value, tap->name, sizeof tap->name);
    default:
        return text_copy(text, word, value, tap->unit, sizeof tap->unit);
    }
}

/* Where no range is given: beyond a hundred standard deviations a number is a sensor's fault and not a sample. */
static void set_range(tap_t *tap, const given_t *given)
{
    if (given->has[SCALE] && !given->has[MINIMUM]) {
        tap->minimum = tap->offset - PLAUSIBLE * tap->scale; /* offset and scale are at most LARGEST: no overflow */
    }
    if (given->has[SCALE] && !given->has[MAXIMUM]) {
        tap->maximum = tap->offset + PLAUSIBLE * tap->scale;
    }
}

static int check_range(const text_t *text, const char *key, const tap_t *tap, const given_t *given)
{
    char needed[256];
    if (tap->minimum < tap->maximum) {
        return 0;
    }
    (void)snprintf(needed, sizeof needed, "min below max is needed; min is %.7g%s and max %.7g%s", (double)tap->minimum,
                   given->has[MINIMUM] ? "" : " (not given: offset - 100 scale)", (double)tap->maximum,
                   given->has[MAXIMUM] ? "" : " (not given: offset + 100 scale)");
    return text_refuse(text, key, tap->name, needed);
}

/* Say what is missing or cannot be. */
static int check(const settings_t *self, const text_t *text, const char *key, const tap_t *tap, const given_t *given)
{
    if (!given->known && !(given->has[NAME] && given->has[UNIT])) {
        return text_refuse(text, key, "record", "`name NAME` and `unit UNIT` are needed after a record's number");
    }
    if (tap->role != ROLE_SCHEDULING && !given->has[SCALE]) {
        return text_refuse(text, key, tap->name, "`scale S` is needed, about the channel's standard deviation");
    }
    if (check_range(text, key, tap, given) != 0) {
        return -1;
    }
    if (find_tap(self, tap->name)) {
        return text_refuse(text, key, tap->name,
                           "this name is there already; give one of them another with `name NAME`");
    }
    if (settings_taps(self) >= SETTINGS_CHANNELS_MAX) {
        return text_refuse(text, key, tap->name, "at most 32 channels");
    }
    return 0;
}

static void insert(settings_t *self, const tap_t *tap)
{
    unsigned at = 0;
    for (unsigned role = 0; role <= (unsigned)tap->role; role++) {
        at += self->taps[role];
    }
    memmove(&self->tap[at + 1u], &self->tap[at], (settings_taps(self) - at) * sizeof *tap);
    self->tap[at] = *tap;
    self->taps[tap->role]++;
}

static tap_t make_tap(tap_role_t role)
{
    tap_t tap;
    memset(&tap, 0, sizeof tap);
    tap.role = role;
    tap.scale = 1.0F;
    tap.minimum = -3e38F; /* within what binary32 holds: no range */
    tap.maximum = 3e38F;
    return tap;
}

int channel_add(settings_t *self, const text_t *text, tap_role_t role, const char *key, char *value)
{
    char *words[TEXT_WORDS_MAX];
    given_t given;
    tap_t tap = make_tap(role);
    const unsigned count = text_words(value, words);
    memset(&given, 0, sizeof given);
    if (count > TEXT_WORDS_MAX || read_source(text, key, words[0], &tap, &given) != 0) {
        return count > TEXT_WORDS_MAX ? text_refuse(text, key, NULL, "too many words") : -1;
    }
    for (unsigned i = 1; i < count; i += 2u) {
        if (i + 1u >= count) {
            return text_refuse(text, key, words[i], "a value is needed after this word");
        }
        if (read_option(text, words[i], words[i + 1u], &tap, &given) != 0) {
            return -1;
        }
    }
    set_range(&tap, &given);
    if (check(self, text, key, &tap, &given) != 0) {
        return -1;
    }
    insert(self, &tap);
    return 0;
}

int channel_add_named(settings_t *self, const char *name)
{
    const named_record_t *entry = records_find(name);
    tap_t tap = make_tap(ROLE_SCHEDULING);
    if (entry == NULL || find_tap(self, name)) {
        return 0;
    }
    if (settings_taps(self) >= SETTINGS_CHANNELS_MAX) {
        return -1;
    }
    tap.source = entry->source;
    tap.record = entry->record;
    (void)snprintf(tap.name, sizeof tap.name, "%s", entry->name);
    (void)snprintf(tap.unit, sizeof tap.unit, "%s", entry->unit);
    insert(self, &tap);
    return 0;
}
/* SPDX-License-Identifier: MIT */
