/* settings.h: reads what a turbine's wrapper is to do from a small text file.
 *
 * MODEL
 *   One `key = value` a line; `[section]` lines; # or ; begins a comment at the start of a line or after a blank.
 *   Relative paths start at the folder of the file. Numbers are written with a point, whatever the locale.
 *
 *     controller = PATH     the controller's library
 *     symbol = NAME         its procedure, default DISCON
 *     input = CHANNEL ...   what drives the turbine; one line a channel. Without any the filter is an autoregression
 *     output = CHANNEL ...  what answers; at least one
 *     scheduling = CHANNEL ...  sent along, not filtered
 *         CHANNEL is a name of records.c, or record:NUMBER followed by `name NAME unit UNIT`; then in any order
 *         `scale S` (needed for input and output: about the standard deviation), `offset O` (0: about the mean),
 *         `min V`, `max V` (offset - 100 scale, offset + 100 scale; a sample with a channel outside is not filtered),
 *         `name NAME`, `unit UNIT`; each once
 *     records = N           length of the simulator's array, default 84; needed for channels beyond
 *     decimation = K        filter every K-th call, default 1
 *     past = P              past window of the filter
 *     method, forget, regularize, varmax, varx_samples, feedthrough = INPUT ...   as `aeolid node` has them
 *     bus = tcp:PORT | pty | can:INTERFACE | file:PATH | none
 *     overwrite = yes | no  file: replace the log of an earlier run; no (default): number this one, PATH_2, PATH_3 …
 *     wait = S              at the first call wait so long for a listener (tcp, pty), default 0
 *     node_id, bit_rate, share (percent), snapshot_every (s), sample_every, innovations, repair, seal, fd, fd_ratio
 *         as `aeolid node` has them; yes or no for innovations (no), seal (yes) and fd (no)
 *
 *     [pitch excitation]    and [torque excitation]: see excitation.h; without the section there is none
 *     signal = prbs | multisine
 *     form = collective | individual | tilt | yaw       pitch only
 *     amplitude, rate, start, stop, minimum, maximum    rad, N m, s; all needed
 *     hold = S, order = N                               prbs: seconds a bit, register of N bits (5 ... 15)
 *     low, high = HZ, lines = N                         multisine
 *     seed = N
 *
 * CONTRACT
 *   Memory: the structure. Reads at most SETTINGS_TEXT_MAX characters; never allocates; refuses unknown keys, sections
 *   and words, and repeated ones, but for input, output and scheduling, of which each names another channel. Not for
 *   two threads on one structure.
 */
#ifndef AEOLID_DISCON_SETTINGS_H
#define AEOLID_DISCON_SETTINGS_H

#include "excitation.h"
#include "records.h"

#include <aeolid/stream.h>

#define SETTINGS_TEXT_MAX     32768u
#define SETTINGS_PATH_MAX     1024u
#define SETTINGS_SYMBOL_MAX   64u
#define SETTINGS_WHY_MAX      512u
#define SETTINGS_CHANNELS_MAX 32u

typedef enum { ROLE_INPUT = 0, ROLE_OUTPUT = 1, ROLE_SCHEDULING = 2 } tap_role_t;

/* One tapped channel. */
typedef struct {
    char name[AEO_STREAM_NAME_MAX + 1];
    char unit[AEO_STREAM_UNIT_MAX + 1];
    tap_role_t role;
    record_source_t source;
    uint16_t record;
    float offset, scale, minimum, maximum; /* -3e38 and 3e38: no range */
} tap_t;

typedef enum { BUS_NONE, BUS_TCP, BUS_PTY, BUS_CAN, BUS_FILE } bus_kind_t;

typedef struct {
    char folder[SETTINGS_PATH_MAX]; /* of the file, with its last slash */
    char controller[SETTINGS_PATH_MAX];
    char symbol[SETTINGS_SYMBOL_MAX];
    tap_t tap[SETTINGS_CHANNELS_MAX]; /* inputs, then outputs, then scheduling */
    unsigned taps[3];                 /* of each role */
    unsigned records, decimation, past;
    int method, varmax; /* aeo_method_t */
    uint32_t varx_samples, feedthrough;
    float lambda, rho;
    bus_kind_t bus;
    char bus_name[SETTINGS_PATH_MAX]; /* file or interface */
    unsigned tcp_port, node_id, sample_every, repair, fd_ratio;
    int innovations, seal, fd, overwrite;
    uint32_t bit_rate;
    double wait_s, share, snapshot_s;
    excitation_settings_t pitch, torque;
} settings_t;

/* Read `length` characters as the file called `file`. Returns 0, else -1 and `why` (SETTINGS_WHY_MAX) holds a sentence
 * that names file, line, key and remedy. */
int settings_parse(settings_t *self, const char *file, const char *text, size_t length, char *why);

/* Read the file at `path`; as settings_parse. */
int settings_read(settings_t *self, const char *path, char *why);

/* Return the number of channels of all roles. */
unsigned settings_taps(const settings_t *self);

#endif
/* SPDX-License-Identifier: MIT */
