#include "settings_text.h"

#include "settings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/* Keep what a message quotes short and printable: the file may hold anything. */
static void quote(const char *text, char *target, size_t room)
{
    size_t i;
    for (i = 0; text[i] != '\0' && i + 1u < room; i++) {
        target[i] = text[i] >= ' ' && text[i] <= '~' ? text[i] : '?';
    }
    target[i] = '\0';
}

int text_refuse(const text_t *self, const char *key, const char *value, const char *needed)
{
    char shown_key[40], shown_value[80], place[24] = "";
    quote(key, shown_key, sizeof shown_key);
    quote(value == NULL ? "" : value, shown_value, sizeof shown_value);
    if (self->number > 0u) {
        (void)snprintf(place, sizeof place, " line %u", self->number);
    }
    (void)snprintf(self->why, SETTINGS_WHY_MAX, "%.160s%s: %s%s%s: %s", self->file, place, shown_key,
                   value == NULL ? "" : " = ", shown_value, needed);
    return -1;
}

/* Remove blanks at both ends, in place. */
static char *trim(char *text)
{
    size_t length;
    while (is_blank(*text)) {
        text++;
    }
    length = strlen(text);
    while (length > 0u && is_blank(text[length - 1u])) {
        text[--length] = '\0';
    }
    return text;
}

static void cut_comment(char *line)
{
    for (char *c = line; *c != '\0'; c++) {
        if ((*c == '#' || *c == ';') && (c == line || is_blank(c[-1]))) {
            *c = '\0';
            return;
        }
    }
}

/* Find section, or key and value, in the line. */
static int take_apart(const text_t *self, text_line_t *line)
{
    char *text, *equals;
    cut_comment(line->line);
    text = trim(line->line);
    line->section = line->key = line->value = NULL;
    if (*text == '\0') {
        return 1;
    }
    if (*text == '[') {
        const size_t length = strlen(text);
        if (text[length - 1u] != ']') {
            return text_refuse(self, text, NULL, "a section is written [name]");
        }
        text[length - 1u] = '\0';
        line->section = trim(text + 1);
        return 1;
    }
    equals = strchr(text, '=');
    if (equals == NULL || equals == text) {
        return text_refuse(self, text, NULL, "a line is written key = value");
    }
    *equals = '\0';
    line->key = trim(text);
    line->value = trim(equals + 1);
    return *line->value != '\0' ? 1 : text_refuse(self, line->key, "", "a value is needed");
}

int text_next(text_t *self, text_line_t *line)
{
    const char *stop;
    size_t length;
    if (self->at >= self->end) {
        return 0;
    }
    self->number++;
    stop = memchr(self->at, '\n', (size_t)(self->end - self->at));
    stop = stop == NULL ? self->end : stop;
    length = (size_t)(stop - self->at);
    if (length > TEXT_LINE_MAX || memchr(self->at, '\0', length) != NULL) {
        return text_refuse(self, "line", NULL, "longer than 1023 characters or not text; is this the settings file?");
    }
    memcpy(line->line, self->at, length);
    line->line[length] = '\0';
    self->at = stop < self->end ? stop + 1 : stop;
    return take_apart(self, line);
}

unsigned text_words(char *value, char *words[TEXT_WORDS_MAX])
{
    unsigned count = 0;
    while (*value != '\0') {
        while (is_blank(*value)) {
            *value++ = '\0';
        }
        if (*value == '\0') {
            break;
        }
        if (count == TEXT_WORDS_MAX) {
            return count + 1u;
        }
        words[count++] = value;
        while (*value != '\0' && !is_blank(*value)) {
            value++;
        }
    }
    return count;
}

int text_number(const text_t *self, const char *key, const char *value, double low, double high, int whole,
                double *number)
{
    char needed[80], *end;
    const double found = strtod(value, &end);
    if (end == value || *end != '\0' || !(found >= low && found <= high) ||
        (whole && (found < 0 || found > (double)(uint64_t)found || found < (double)(uint64_t)found))) {
        (void)snprintf(needed, sizeof needed, "a %snumber %.10g ... %.10g is needed", whole ? "whole " : "", low, high);
        return text_refuse(self, key, value, needed);
    }
    *number = found;
    return 0;
}

int text_copy(const text_t *self, const char *key, const char *value, char *target, size_t room)
{
    const size_t length = strlen(value);
    char needed[64];
    if (length == 0u || length >= room) {
        (void)snprintf(needed, sizeof needed, "1 ... %u characters are needed", (unsigned)(room - 1u));
        return text_refuse(self, key, value, needed);
    }
    memcpy(target, value, length + 1u);
    return 0;
}
/* SPDX-License-Identifier: MIT */
