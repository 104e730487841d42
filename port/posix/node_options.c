#include "node_options.h"

#include "../common/method_names.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int refuse(const char *option, const char *value, const char *needed)
{
    (void)fprintf(stderr, "aeolid-node: %s %s: %s is needed\n", option, value, needed);
    return -1;
}

static int read_number(const char *option, const char *text, double low, double high, int whole, double *value)
{
    char *end;
    char needed[80];
    const double number = strtod(text, &end);
    if (end == text || *end != '\0' || !(number >= low && number <= high) || (whole && number > floor(number))) {
        (void)snprintf(needed, sizeof needed, "a %snumber %.10g ... %.10g", whole ? "whole " : "", low, high);
        return refuse(option, text, needed);
    }
    *value = number;
    return 0;
}

/* Beyond so many standard deviations a number is a sensor's fault and not a sample. A channel that is not scaled, offset
 * 0 and scale 1, has no such range. */
#define PLAUSIBLE 100.0

/* Fill in scale and range; 0 done, -1: the range has no width in the numbers of the filter. */
static int fill_channel(aeo_channel_t *channel, double offset, double scale)
{
    channel->offset = (aeo_real_t)offset;
    channel->scale = (aeo_real_t)scale;
    if (offset < 0 || offset > 0 || scale < 1 || scale > 1) {
        channel->minimum = (aeo_real_t)(offset - PLAUSIBLE * scale);
        channel->maximum = (aeo_real_t)(offset + PLAUSIBLE * scale);
        return channel->minimum < channel->maximum ? 0 : -1;
    }
    return 0;
}

static int read_channel(node_options_t *self, char **argv, int is_input)
{
    double offset, scale;
    aeo_channel_t *channel;
    if (is_input && self->outputs > 0u) {
        return refuse(argv[0], argv[1], "all inputs before the first output");
    }
    if (self->inputs + self->outputs >= AEO_STREAM_CHANNELS_MAX) {
        return refuse(argv[0], argv[1], "at most 64 channels");
    }
    if (read_number(argv[0], argv[3], -1e30, 1e30, 0, &offset) ||
        read_number(argv[0], argv[4], 1e-30, 1e30, 0, &scale)) {
        return -1;
    }
    channel = &self->channel[self->inputs + self->outputs];
    channel->name = argv[1];
    channel->unit = argv[2];
    if (fill_channel(channel, offset, scale) != 0) {
        return refuse(argv[0], argv[1], "a scale that single precision shows beside the offset");
    }
    if (is_input) {
        self->inputs++;
    } else {
        self->outputs++;
    }
    return 0;
}

static int read_bus(node_options_t *self, const char *text)
{
    double port;
    self->can = NULL;
    if (strncmp(text, "can:", 4) == 0 && text[4] != '\0') {
        self->can = text + 4;
        return 0;
    }
    if (strcmp(text, "pty") == 0) {
        self->terminal = 1;
        return 0;
    }
    if (strncmp(text, "tcp:", 4) != 0 || read_number("--bus", text + 4, 0, 65535, 1, &port)) {
        return refuse("--bus", text, "pty or tcp:PORT or can:INTERFACE");
    }
    self->terminal = 0;
    self->tcp_port = (uint16_t)port;
    return 0;
}

static int read_method(node_options_t *self, const char *text)
{
    self->method = method_number(text);
    return self->method >= 0 ? 0 : refuse("--method", text, "rls, els, fast-rls or lattice");
}

static int read_speed(node_options_t *self, const char *text)
{
    if (strcmp(text, "max") == 0) {
        self->speed = 0;
        return 0;
    }
    return read_number("--speed", text, 1e-3, 1e6, 0, &self->speed);
}

typedef struct {
    const char *name;
    double low, high;
    int whole;    /* 1: a number without a fraction */
    double value; /* the default; 0 where the option is needed or the default another's */
} setting_t;

enum {
    SAMPLE_TIME,
    PAST,
    FORGET,
    REGULARIZE,
    FEEDTHROUGH,
    BIT_RATE,
    SHARE,
    NODE_ID,
    SNAPSHOT_EVERY,
    SAMPLE_EVERY,
    REPAIR,
    VARX_SAMPLES,
    FD_RATIO,
    BASE
};

static void take_settings(node_options_t *self, const setting_t *setting)
{
    self->sample_time_s = setting[SAMPLE_TIME].value;
    self->past = (uint16_t)setting[PAST].value;
    self->varmax = self->varmax || self->method == (int)AEO_METHOD_ELS;
    self->lambda = (float)setting[FORGET].value;
    if (!(self->lambda > 0)) {
        self->lambda = self->method == (int)AEO_METHOD_FAST_RLS ? 0.999F : 1.0F;
    }
    self->lambda_start = self->lambda < 0.99F ? self->lambda : 0.99F;
    self->rho = (float)setting[REGULARIZE].value;
    self->feedthrough = (uint32_t)setting[FEEDTHROUGH].value;
    self->bit_rate = (uint32_t)setting[BIT_RATE].value;
    self->bits_per_s = (uint32_t)(setting[BIT_RATE].value * setting[SHARE].value / 100.0);
    self->node = (uint8_t)setting[NODE_ID].value;
    self->base = (uint32_t)setting[BASE].value;
    self->snapshot_s = setting[SNAPSHOT_EVERY].value;
    self->sample_every = (uint16_t)setting[SAMPLE_EVERY].value;
    self->repair_percent = (uint8_t)setting[REPAIR].value;
    self->varx_samples = (uint32_t)setting[VARX_SAMPLES].value;
    self->fd_ratio = (uint8_t)setting[FD_RATIO].value;
    if (self->varx_samples == 0u) {
        self->varx_samples =
            10u * self->past * (uint32_t)AEO_REGRESSOR_BLOCK(self->inputs, self->outputs, self->varmax);
    }
}

/* Read one option that takes one value; 0 done, -1 bad value, 1 not one of these. */
static int read_setting(node_options_t *self, setting_t *setting, size_t count, char **argv)
{
    size_t i;
    for (i = 0; i < count; i++) {
        if (strcmp(argv[0], setting[i].name) == 0) {
            return read_number(argv[0], argv[1], setting[i].low, setting[i].high, setting[i].whole, &setting[i].value);
        }
    }
    if (strcmp(argv[0], "--method") == 0) {
        return read_method(self, argv[1]);
    }
    if (strcmp(argv[0], "--bus") == 0) {
        return read_bus(self, argv[1]);
    }
    if (strcmp(argv[0], "--speed") == 0) {
        return read_speed(self, argv[1]);
    }
    if (strcmp(argv[0], "--dump") == 0) {
        self->dump = argv[1];
        return 0;
    }
    return 1;
}

/* Read one option without a value; 1 when it was one. */
static int read_switch(node_options_t *self, const char *option)
{
    if (strcmp(option, "--wait") == 0) {
        self->wait = 1;
    } else if (strcmp(option, "--varmax") == 0) {
        self->varmax = 1;
    } else if (strcmp(option, "--innovations") == 0) {
        self->innovations = 1;
    } else if (strcmp(option, "--force-base") == 0) {
        self->force_base = 1;
    } else if (strcmp(option, "--fd") == 0) {
        self->fd = 1;
    } else if (strcmp(option, "--seal") == 0 || strcmp(option, "--no-seal") == 0) {
        self->seal = option[2] == 's';
    } else {
        return 0;
    }
    return 1;
}

int node_options_read(node_options_t *self, int argc, char **argv)
{
    setting_t setting[] = {
        {"--sample-time", 2e-5, 1000.0, 0, 0.0},
        {"--past", 1, 1023, 1, 0},
        {"--forget", 0.5, 1.0, 0, 0.0},
        {"--regularize", 1e-8, 1e8, 0, 0.1},
        {"--feedthrough", 0, 4294967295.0, 1, 0},
        {"--bit-rate", 10000, 8e6, 1, 500000},
        {"--share", 0, 100, 0, 5},
        {"--node-id", 0, 253, 1, 1},
        {"--snapshot-every", 0, 1e9, 0, 10},
        {"--sample-every", 0, 65535, 1, 1},
        {"--repair", 0, 100, 1, 25},
        {"--varx-samples", 16, AEO_ELS_VARX_SAMPLES_MAX, 1, 0},
        {"--fd-ratio", 1, 16, 1, 1},
        {"--base", 0, 536870911.0, 1, AEO_FRAME_BASE_EXTENDED},
    };
    int at = 1, result;
    memset(self, 0, sizeof *self);
    self->speed = 1.0;
    self->seal = 1;
    while (at < argc) {
        const int left = argc - at - 1;
        if (read_switch(self, argv[at])) {
            at += 1;
        } else if ((strcmp(argv[at], "--input") == 0 || strcmp(argv[at], "--output") == 0) && left >= 4) {
            if (read_channel(self, argv + at, strcmp(argv[at], "--input") == 0)) {
                return -1;
            }
            at += 5;
        } else {
            result = left >= 1 ? read_setting(self, setting, sizeof setting / sizeof *setting, argv + at) : 1;
            if (result != 0) {
                return result < 0 ? -1 : refuse(argv[at], "", "an option listed in node_options.h, with its values,");
            }
            at += 2;
        }
    }
    if (self->outputs < 1u || !(setting[SAMPLE_TIME].value > 0) || !(setting[PAST].value > 0)) {
        return refuse("aeolid-node", "", "at least --output, --sample-time and --past");
    }
    if (self->can != NULL && self->wait) {
        return refuse("--wait", "", "a bus that shows its listeners (pty or tcp:PORT)");
    }
    take_settings(self, setting);
    return 0;
}
