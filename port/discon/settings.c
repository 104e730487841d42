#include "settings.h"

#include "../common/method_names.h"
#include "settings_channel.h"
#include "settings_text.h"

#include <locale.h>
#include <stdio.h>
#include <string.h>

/* A key with a number for its value. */
typedef struct {
    const char *key;
    double low, high;
    int whole;
    double value; /* the default; NAN where the key is needed */
} number_t;

enum { RECORDS, DECIMATION, PAST, FORGET, REGULARIZE, VARX_SAMPLES, WAIT, NODE_ID, BIT_RATE, SHARE, SNAPSHOT_EVERY };
enum { SAMPLE_EVERY = SNAPSHOT_EVERY + 1, REPAIR, FD_RATIO, NUMBERS };
enum { AMPLITUDE, RATE, START, STOP, MINIMUM, MAXIMUM, HOLD, ORDER, LOW, HIGH, LINES, SEED, EXCITATION_NUMBERS };
enum { MAIN, PITCH, TORQUE, SECTIONS };

typedef struct {
    settings_t *settings;
    text_t text;
    unsigned section;
    number_t number[NUMBERS];
    number_t excitation[SECTIONS][EXCITATION_NUMBERS]; /* that of MAIN is not used */
    unsigned section_line[SECTIONS];
    unsigned long number_given, excitation_given[SECTIONS], words_given[SECTIONS];
    char feedthrough[TEXT_LINE_MAX + 1u];
    unsigned feedthrough_line;
} reading_t;

static const number_t main_numbers[NUMBERS] = {
    [RECORDS] = {"records", RECORDS_LEAST, 65535, 1, 84},
    [DECIMATION] = {"decimation", 1, 65535, 1, 1},
    [PAST] = {"past", 1, 1023, 1, 0},
    [FORGET] = {"forget", 0.5, 1, 0, 0},
    [REGULARIZE] = {"regularize", 1e-8, 1e8, 0, 0.1},
    [VARX_SAMPLES] = {"varx_samples", 16, AEO_ELS_VARX_SAMPLES_MAX, 1, 0},
    [WAIT] = {"wait", 0, 3600, 0, 0},
    [NODE_ID] = {"node_id", 0, 253, 1, 1},
    [BIT_RATE] = {"bit_rate", 10000, 8e6, 1, 500000},
    [SHARE] = {"share", 0, 100, 0, 5},
    [SNAPSHOT_EVERY] = {"snapshot_every", 0, 1e9, 0, 10},
    [SAMPLE_EVERY] = {"sample_every", 0, 65535, 1, 1},
    [REPAIR] = {"repair", 0, 100, 1, 25},
    [FD_RATIO] = {"fd_ratio", 1, 16, 1, 1},
};

static const number_t excitation_numbers[EXCITATION_NUMBERS] = {
    [AMPLITUDE] = {"amplitude", 1e-12, 1e12, 0, 0},
    [RATE] = {"rate", 1e-12, 1e12, 0, 0},
    [START] = {"start", 0, 1e9, 0, 0},
    [STOP] = {"stop", 0, 1e9, 0, 0},
    [MINIMUM] = {"minimum", -1e12, 1e12, 0, 0},
    [MAXIMUM] = {"maximum", -1e12, 1e12, 0, 0},
    [HOLD] = {"hold", 1e-3, 1e6, 0, 1},
    [ORDER] = {"order", EXCITATION_ORDER_MIN, EXCITATION_ORDER_MAX, 1, 10},
    [LOW] = {"low", 1e-6, 1e3, 0, 0},
    [HIGH] = {"high", 1e-6, 1e3, 0, 0},
    [LINES] = {"lines", 1, EXCITATION_LINES_MAX, 1, 20},
    [SEED] = {"seed", 0, 4294967295.0, 1, 1},
};

/* ---- single values ----------------------------------------------------------------------------------------------- */

static int starts_with(const char *text, const char *start, const char **rest)
{
    *rest = text + strlen(start);
    return strncmp(text, start, strlen(start)) == 0;
}

/* Prepend the file's folder to a relative path. */
static int read_path(const reading_t *self, const char *key, const char *value, char *target)
{
    const char *folder = value[0] == '/' ? "" : self->settings->folder;
    const size_t before = strlen(folder), length = strlen(value);
    if (before + length >= SETTINGS_PATH_MAX) {
        return text_refuse(&self->text, key, value,
                           "a shorter path is needed, at most 1023 characters with the folder");
    }
    memcpy(target, folder, before);
    memcpy(target + before, value, length + 1u);
    return 0;
}

static int read_bus(reading_t *self, const char *value)
{
    settings_t *s = self->settings;
    const char *rest;
    double port;
    if (starts_with(value, "tcp:", &rest)) {
        s->bus = BUS_TCP;
        if (text_number(&self->text, "bus", rest, 0, 65535, 1, &port) != 0) {
            return -1;
        }
        s->tcp_port = (unsigned)port;
        return 0;
    }
    if (starts_with(value, "file:", &rest) && *rest != '\0') {
        s->bus = BUS_FILE;
        return read_path(self, "bus", rest, s->bus_name);
    }
    if (starts_with(value, "can:", &rest)) {
        s->bus = BUS_CAN;
        return text_copy(&self->text, "bus", rest, s->bus_name, 16); /* IFNAMSIZ */
    }
    s->bus = strcmp(value, "pty") == 0 ? BUS_PTY : BUS_NONE;
    return s->bus == BUS_PTY || strcmp(value, "none") == 0
               ? 0
               : text_refuse(&self->text, "bus", value, "tcp:PORT, pty, can:INTERFACE, file:PATH or none is needed");
}

/* Return the place of `value` in a list that ends with null, -1 when it is not there. */
static int find_word(const char *const *list, const char *value)
{
    for (int i = 0; list[i] != NULL; i++) {
        if (strcmp(list[i], value) == 0) {
            return i;
        }
    }
    return -1;
}

static const char *const yes_no[] = {"no", "yes", NULL};
static const char *const methods[] = {"rls", "els", "fast-rls", "lattice", NULL};     /* the order of aeo_method_t */
static const char *const signals[] = {"off", "prbs", "multisine", NULL};              /* of excitation_signal_t */
static const char *const forms[] = {"collective", "individual", "tilt", "yaw", NULL}; /* of excitation_form_t */

static int read_choice(const reading_t *self, const char *key, const char *value, const char *const *list,
                       const char *needed, int *target)
{
    *target = find_word(list, value);
    return *target >= 0 ? 0 : text_refuse(&self->text, key, value, needed);
}

/* ---- keys -------------------------------------------------------------------------------------------------------- */

static int read_main_word(reading_t *self, int key, const char *name, char *value)
{
    settings_t *s = self->settings;
    switch (key) {
    case 0:
        return read_path(self, name, value, s->controller);
    case 1:
        return text_copy(&self->text, name, value, s->symbol, sizeof s->symbol);
    case 2:
        return read_bus(self, value);
    case 3:
        return read_choice(self, name, value, methods, "rls, els, fast-rls or lattice is needed", &s->method);
    case 4:
        return read_choice(self, name, value, yes_no, "yes or no is needed", &s->varmax);
    case 5:
        return read_choice(self, name, value, yes_no, "yes or no is needed", &s->innovations);
    case 6:
        return read_choice(self, name, value, yes_no, "yes or no is needed", &s->seal);
    case 7:
        return read_choice(self, name, value, yes_no, "yes or no is needed", &s->fd);
    case 8:
        return read_choice(self, name, value, yes_no, "yes or no is needed", &s->overwrite);
    default:
        self->feedthrough_line = self->text.number;
        return text_copy(&self->text, name, value, self->feedthrough, sizeof self->feedthrough);
    }
}

static int read_excitation_word(reading_t *self, int key, const char *name, const char *value)
{
    excitation_settings_t *e = self->section == PITCH ? &self->settings->pitch : &self->settings->torque;
    int choice;
    if (key == 0) {
        if (read_choice(self, name, value, signals, "prbs, multisine or off is needed", &choice) != 0) {
            return -1;
        }
        e->signal = (excitation_signal_t)choice;
        return 0;
    }
    if (self->section == TORQUE) {
        return text_refuse(&self->text, name, value, "only [pitch excitation] has a form");
    }
    if (read_choice(self, name, value, forms, "collective, individual, tilt or yaw is needed", &choice) != 0) {
        return -1;
    }
    e->form = (excitation_form_t)choice;
    return 0;
}

/* Note that a key was given; refuse it the second time. */
static int give(const reading_t *self, const char *key, unsigned long *given, int bit)
{
    if ((*given >> bit & 1ul) != 0ul) {
        return text_refuse(&self->text, key, NULL, "stands in this section twice; remove one of the lines");
    }
    *given |= 1ul << bit;
    return 0;
}

static int read_key(reading_t *self, char *key, char *value)
{
    static const char *const main_words[] = {"controller", "symbol",      "bus",  "method",
                                             "varmax",     "innovations", "seal", "fd",
                                             "overwrite",  "feedthrough", NULL};
    static const char *const excitation_words[] = {"signal", "form", NULL};
    const unsigned section = self->section;
    number_t *numbers = section == MAIN ? self->number : self->excitation[section];
    const int count = section == MAIN ? (int)NUMBERS : (int)EXCITATION_NUMBERS;
    unsigned long *given = section == MAIN ? &self->number_given : &self->excitation_given[section];
    static const char *const roles[] = {"input", "output", "scheduling", NULL}; /* the order of tap_role_t */
    const int role = section == MAIN ? find_word(roles, key) : -1;
    const int word = find_word(section == MAIN ? main_words : excitation_words, key);
    if (role >= 0) {
        return channel_add(self->settings, &self->text, (tap_role_t)role, key, value);
    }
    if (word >= 0) {
        if (give(self, key, &self->words_given[section], word) != 0) {
            return -1;
        }
        return section == MAIN ? read_main_word(self, word, key, value) : read_excitation_word(self, word, key, value);
    }
    for (int i = 0; i < count; i++) {
        if (strcmp(numbers[i].key, key) == 0) {
            return give(self, key, given, i) != 0 ? -1
                                                  : text_number(&self->text, key, value, numbers[i].low,
                                                                numbers[i].high, numbers[i].whole, &numbers[i].value);
        }
    }
    return text_refuse(&self->text, key, NULL, "no such key in this section; port/discon/settings.h lists them");
}

static int read_section(reading_t *self, const char *name)
{
    static const char *const sections[] = {"", "pitch excitation", "torque excitation", NULL};
    const int found = find_word(sections, name);
    if (found <= 0) {
        return text_refuse(&self->text, name, NULL, "the sections are [pitch excitation] and [torque excitation]");
    }
    if (self->section_line[found] != 0u) {
        return text_refuse(&self->text, name, NULL, "this section is there already; put their keys together");
    }
    self->section = (unsigned)found;
    self->section_line[found] = self->text.number;
    return 0;
}

/* ---- the whole --------------------------------------------------------------------------------------------------- */

static void take_excitation(const number_t *n, excitation_settings_t *e)
{
    e->amplitude = n[AMPLITUDE].value;
    e->rate = n[RATE].value;
    e->start_s = n[START].value;
    e->stop_s = n[STOP].value;
    e->minimum = n[MINIMUM].value;
    e->maximum = n[MAXIMUM].value;
    e->hold_s = n[HOLD].value;
    e->order = (unsigned)n[ORDER].value;
    e->low_hz = n[LOW].value;
    e->high_hz = n[HIGH].value;
    e->lines = (unsigned)n[LINES].value;
    e->seed = (uint32_t)n[SEED].value;
}

static int finish_excitation(reading_t *self, unsigned section, excitation_settings_t *e)
{
    const number_t *n = self->excitation[section];
    self->text.number = self->section_line[section];
    if (self->section_line[section] == 0u) {
        return 0;
    }
    if ((self->words_given[section] & 1ul) == 0ul) {
        return text_refuse(&self->text, "signal", NULL, "missing in this section: prbs, multisine or off");
    }
    for (int i = AMPLITUDE; i <= HIGH && e->signal != SIGNAL_OFF; i++) {
        const int needed = i <= MAXIMUM || ((i == LOW || i == HIGH) && e->signal == SIGNAL_MULTISINE);
        if (needed && (self->excitation_given[section] >> i & 1ul) == 0ul) {
            return text_refuse(&self->text, n[i].key, NULL, "missing in this section; excitation needs its limits");
        }
    }
    take_excitation(n, e);
    if (e->signal != SIGNAL_OFF && !(e->stop_s > e->start_s && e->maximum > e->minimum)) {
        return text_refuse(&self->text, "section", NULL, "start before stop and minimum below maximum are needed");
    }
    if (e->signal == SIGNAL_MULTISINE && !(e->high_hz >= e->low_hz)) {
        return text_refuse(&self->text, "section", NULL, "low not above high is needed");
    }
    return 0;
}

/* What is added is always sent along, asked for or not. */
static int tap_excitation(reading_t *self)
{
    settings_t *s = self->settings;
    int failed = 0;
    if (s->pitch.signal != SIGNAL_OFF && s->pitch.form == FORM_COLLECTIVE) {
        failed |= channel_add_named(s, "excitation_pitch");
    } else if (s->pitch.signal != SIGNAL_OFF) {
        failed |= channel_add_named(s, "excitation_pitch_1");
        failed |= channel_add_named(s, "excitation_pitch_2");
        failed |= channel_add_named(s, "excitation_pitch_3");
    }
    if (s->torque.signal != SIGNAL_OFF) {
        failed |= channel_add_named(s, "excitation_torque");
    }
    return failed == 0 ? 0 : text_refuse(&self->text, "channels", NULL, "at most 32 with those of the excitation");
}

static int check_taps(reading_t *self)
{
    const settings_t *s = self->settings;
    for (unsigned i = 0; i < settings_taps(s); i++) {
        const tap_t *tap = &s->tap[i];
        if ((tap->source == SOURCE_MEASURED || tap->source == SOURCE_DEMANDED) && tap->record > s->records) {
            return text_refuse(&self->text, tap->name, NULL,
                               "lies beyond the array; say with `records = N` how long the simulator's is");
        }
    }
    return 0;
}

static int find_feedthrough(reading_t *self)
{
    char *words[TEXT_WORDS_MAX];
    unsigned count, i, j;
    count = text_words(self->feedthrough, words);
    self->text.number = self->feedthrough_line;
    for (i = 0; i < count && i < TEXT_WORDS_MAX; i++) {
        for (j = 0; j < self->settings->taps[ROLE_INPUT]; j++) {
            if (strcmp(words[i], self->settings->tap[j].name) == 0) {
                self->settings->feedthrough |= UINT32_C(1) << j;
                break;
            }
        }
        if (j == self->settings->taps[ROLE_INPUT]) {
            return text_refuse(&self->text, "feedthrough", words[i], "names of inputs are needed");
        }
    }
    return 0;
}

static void take_numbers(reading_t *self)
{
    settings_t *s = self->settings;
    const number_t *n = self->number;
    s->records = (unsigned)n[RECORDS].value;
    s->decimation = (unsigned)n[DECIMATION].value;
    s->past = (unsigned)n[PAST].value;
    s->varmax = s->varmax || s->method == (int)AEO_METHOD_ELS;
    s->lambda = n[FORGET].value > 0 ? (float)n[FORGET].value : s->method == (int)AEO_METHOD_FAST_RLS ? 0.999F : 1.0F;
    s->rho = (float)n[REGULARIZE].value;
    s->varx_samples = (uint32_t)n[VARX_SAMPLES].value;
    if (s->varx_samples == 0u) {
        s->varx_samples = 10u * s->past * (uint32_t)AEO_REGRESSOR_BLOCK(s->taps[ROLE_INPUT], s->taps[ROLE_OUTPUT], 1u);
    }
    s->wait_s = n[WAIT].value;
    s->node_id = (unsigned)n[NODE_ID].value;
    s->bit_rate = (uint32_t)n[BIT_RATE].value;
    s->share = n[SHARE].value;
    s->snapshot_s = n[SNAPSHOT_EVERY].value;
    s->sample_every = (unsigned)n[SAMPLE_EVERY].value;
    s->repair = (unsigned)n[REPAIR].value;
    s->fd_ratio = (unsigned)n[FD_RATIO].value;
}

static int finish(reading_t *self)
{
    settings_t *s = self->settings;
    const char *missing = s->controller[0] == '\0'                      ? "controller"
                          : (self->words_given[MAIN] >> 2 & 1ul) == 0ul ? "bus"
                          : (self->number_given >> PAST & 1ul) == 0ul   ? "past"
                          : s->taps[ROLE_OUTPUT] == 0u                  ? "output"
                                                                        : NULL;
    self->text.number = 0;
    if (missing != NULL) {
        return text_refuse(&self->text, missing, NULL, "this key is missing; port/discon/example.cfg shows it");
    }
    take_numbers(self);
    if (finish_excitation(self, PITCH, &s->pitch) != 0 || finish_excitation(self, TORQUE, &s->torque) != 0) {
        return -1;
    }
    self->text.number = 0;
    return tap_excitation(self) != 0 || check_taps(self) != 0 ? -1 : find_feedthrough(self);
}

static int parse(reading_t *self)
{
    text_line_t line;
    int result;
    while ((result = text_next(&self->text, &line)) == 1) {
        if ((line.section != NULL && read_section(self, line.section) != 0) ||
            (line.key != NULL && read_key(self, line.key, line.value) != 0)) {
            return -1;
        }
    }
    return result < 0 ? -1 : finish(self);
}

int settings_parse(settings_t *self, const char *file, const char *text, size_t length, char *why)
{
    static const char mark[] = "\xEF\xBB\xBF"; /* UTF-8, as some editors begin a file */
    const char *slash = strrchr(file, '/');
    reading_t reading;
    locale_t plain, before;
    int result;
    memset(self, 0, sizeof *self);
    memset(&reading, 0, sizeof reading);
    if (slash != NULL && (size_t)(slash - file) + 1u < sizeof self->folder) {
        memcpy(self->folder, file, (size_t)(slash - file) + 1u);
    }
    if (self->folder[0] == '\0') {
        memcpy(self->folder, "./", 3); /* without a slash the loader would search its own folders */
    }
    (void)snprintf(self->symbol, sizeof self->symbol, "DISCON");
    self->seal = 1;
    memcpy(reading.number, main_numbers, sizeof main_numbers);
    memcpy(reading.excitation[PITCH], excitation_numbers, sizeof excitation_numbers);
    memcpy(reading.excitation[TORQUE], excitation_numbers, sizeof excitation_numbers);
    if (length >= 3u && memcmp(text, mark, 3) == 0) {
        text += 3;
        length -= 3u;
    }
    reading.settings = self;
    reading.text = (text_t){file, text, text + length, 0, why};
    plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    before = plain != (locale_t)0 ? uselocale(plain) : (locale_t)0;
    result = parse(&reading);
    if (plain != (locale_t)0) {
        (void)uselocale(before);
        freelocale(plain);
    }
    return result;
}

/* SPDX-License-Identifier: MIT */
