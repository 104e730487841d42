/* settings_text.h: takes lines and words of a settings file apart, and says what is wrong with one.
 *
 * CONTRACT
 *   Memory: the structures; nothing is allocated. Numbers are read with a point whatever the locale, as long as the
 *   caller has set the thread's locale to "C" (settings.c does).
 */
#ifndef AEOLID_DISCON_SETTINGS_TEXT_H
#define AEOLID_DISCON_SETTINGS_TEXT_H

#include <stddef.h>

#define TEXT_LINE_MAX  1023u
#define TEXT_WORDS_MAX 48u

/* Where reading stands. */
typedef struct {
    const char *file;
    const char *at, *end;
    unsigned number; /* of the line, from 1 */
    char *why;       /* SETTINGS_WHY_MAX characters */
} text_t;

/* One line. */
typedef struct {
    char line[TEXT_LINE_MAX + 1u]; /* key, value and section point into it */
    char *section;                 /* not null: a [section] line */
    char *key, *value;             /* both null: nothing on the line */
} text_line_t;

/* Take the next line; 1 done, 0 no more, -1 refused. */
int text_next(text_t *self, text_line_t *line);

/* Cut `value` into words, which it then consists of; returns their number, TEXT_WORDS_MAX + 1 when there are more. */
unsigned text_words(char *value, char *words[TEXT_WORDS_MAX]);

/* Read a number low ... high, a whole one where asked for; 0 done, -1 refused. */
int text_number(const text_t *self, const char *key, const char *value, double low, double high, int whole,
                double *number);

/* Copy `value` into `target` of `room` characters; 0 done, -1 refused: empty or too long. */
int text_copy(const text_t *self, const char *key, const char *value, char *target, size_t room);

/* Write "FILE line N: KEY = VALUE: NEEDED" into why; line 0 is left out, as is a null value. Returns -1. */
int text_refuse(const text_t *self, const char *key, const char *value, const char *needed);

#endif
/* SPDX-License-Identifier: MIT */
