#include "settings_channel.h"

#include <stdio.h>
#include <string.h>

#define LARGEST 1e30

unsigned settings_taps(const settings_t *self)
{
    return self->taps[ROLE_INPUT] + self->taps[ROLE_OUTPUT] + self->taps[ROLE_SCHEDULING];
}

/* What the options of a line may leave out. */
typedef struct {
    int has_scale, has_name, has_unit, has_minimum, has_maximum;
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
        given->has_name = given->has_unit = 1;
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
    if (strcmp(word, "scale") == 0) {
        given->has_scale = 1;
        return read_float(text, word, value, 1e-30, &tap->scale);
    }
    if (strcmp(word, "offset") == 0) {
        return read_float(text, word, value, -LARGEST, &tap->offset);
    }
    if (strcmp(word, "min") == 0) {
        given->has_minimum = 1;
        return read_float(text, word, value, -LARGEST, &tap->minimum);
    }
    if (strcmp(word, "max") == 0) {
        given->has_maximum = 1;
        return read_float(text, word, value, -LARGEST, &tap->maximum);
    }
    if (strcmp(word, "name") == 0) {
        given->has_name = 1;
        return text_copy(text, word, value, tap->name, sizeof tap->name);
    }
    if (strcmp(word, "unit") == 0) {
        given->has_unit = 1;
        return text_copy(text, word, value, tap->unit, sizeof tap->unit);
    }
    return text_refuse(text, word, value, "scale, offset, min, max, name or unit, each with its value, is needed");
}

/* Say what is missing or cannot be. */
static int check(const settings_t *self, const text_t *text, const char *key, const tap_t *tap, const given_t *given)
{
    if (!given->has_name || !given->has_unit) {
        return text_refuse(text, key, "record", "`name NAME` and `unit UNIT` are needed after a record's number");
    }
    if (tap->role != ROLE_SCHEDULING && !given->has_scale) {
        return text_refuse(text, key, tap->name, "`scale S` is needed, about the channel's standard deviation");
    }
    if (given->has_minimum && given->has_maximum && !(tap->minimum < tap->maximum)) {
        return text_refuse(text, key, tap->name, "min below max is needed");
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

/* Where no range is given: beyond a hundred standard deviations a number is a sensor's fault and not a sample. */
static void set_range(tap_t *tap, const given_t *given)
{
    if (given->has_scale && !given->has_minimum) {
        tap->minimum = tap->offset - 100.0F * tap->scale; /* offset and scale are at most LARGEST: no overflow */
    }
    if (given->has_scale && !given->has_maximum) {
        tap->maximum = tap->offset + 100.0F * tap->scale;
    }
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
    if (check(self, text, key, &tap, &given) != 0) {
        return -1;
    }
    set_range(&tap, &given);
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
