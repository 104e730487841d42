#include "bus.h"

#include <aeolid/count.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define STALL_S  1.0
#define LINGER_S 30.0 /* for the last of it, however slowly it is read */
#define RUNS_MAX 9999u

static double clock_s(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* ---- opening ----------------------------------------------------------------------------------------------------- */

static int fail(bus_t *self, const char *what, const char *reason, char *why, size_t room)
{
    (void)snprintf(why, room, "bus %.200s: %.250s", what, reason);
    free(self->text);
    self->text = NULL;
    self->kind = BUS_NONE;
    return -1;
}

static int open_text(bus_t *self, const settings_t *settings, unsigned turbine, char *why, size_t room)
{
    char what[32];
    unsigned port = settings->tcp_port;
    int error;
    self->text = calloc(1, sizeof *self->text);
    if (self->text == NULL) {
        return fail(self, "tcp or pty", "out of memory", why, room);
    }
    if (settings->bus == BUS_PTY) {
        error = posix_bus_open_terminal(self->text);
        return error == 0 ? 0 : fail(self, "pty", strerror(error), why, room);
    }
    port += port == 0u ? 0u : turbine - 1u;
    (void)snprintf(what, sizeof what, "tcp:%u", port);
    if (port > 65535u) {
        return fail(self, what, "no such port; set a lower one in `bus`", why, room);
    }
    error = posix_bus_open_tcp(self->text, (uint16_t)port);
    return error == 0 ? 0 : fail(self, what, strerror(error), why, room);
}

/* Write the file's name for this turbine and run: name.log, name_2.log; name-3.log, name-3_2.log. */
static void name_file(char path[BUS_PATH_MAX], const char *name, unsigned turbine, unsigned run)
{
    const char *slash = strrchr(name, '/');
    const char *dot = strrchr(name, '.');
    const int stem = (int)(dot != NULL && (slash == NULL || dot > slash) ? (size_t)(dot - name) : strlen(name));
    char which[12] = "", again[12] = "";
    if (turbine > 1u) {
        (void)snprintf(which, sizeof which, "-%u", turbine);
    }
    if (run > 1u) {
        (void)snprintf(again, sizeof again, "_%u", run);
    }
    (void)snprintf(path, BUS_PATH_MAX, "%.*s%s%s%s", stem, name, which, again, name + stem);
}

static int open_file(bus_t *self, const settings_t *settings, unsigned turbine, char *why, size_t room)
{
    int error = EEXIST;
    for (unsigned run = 1; run <= RUNS_MAX && error == EEXIST; run++) {
        name_file(self->path, settings->bus_name, turbine, run);
        error = frame_log_open(&self->log, self->path, settings->overwrite);
    }
    return error == 0 ? 0 : fail(self, self->path, strerror(error), why, room);
}

int bus_open(bus_t *self, const settings_t *settings, unsigned turbine, char *why, size_t room)
{
    char text[SOCKETCAN_TEXT_MAX];
    int error;
    memset(self, 0, sizeof *self);
    self->kind = settings->bus;
    self->log.fd = -1;
    switch (settings->bus) {
    case BUS_TCP:
    case BUS_PTY:
        return open_text(self, settings, turbine, why, room);
    case BUS_FILE:
        return open_file(self, settings, turbine, why, room);
    case BUS_CAN:
        error = socketcan_open(&self->can, settings->bus_name, settings->fd);
        return error == 0
                   ? 0
                   : fail(self, settings->bus_name, socketcan_explain(settings->bus_name, error, text), why, room);
    case BUS_NONE:
    default:
        return 0;
    }
}

/* ---- a call ------------------------------------------------------------------------------------------------------ */

static int send_frame(void *context, const aeo_can_frame_t *frame)
{
    bus_t *self = (bus_t *)context;
    aeo_port_t port;
    int taken = 1;
    if (self->kind == BUS_FILE) {
        taken = frame_log_put(&self->log, self->clock_us, frame);
    } else if (self->kind == BUS_CAN) {
        socketcan_port(&self->can, &port, NULL);
        taken = port.send(port.context, frame);
    } else if (self->text != NULL) {
        posix_bus_port(self->text, &port);
        taken = port.send(port.context, frame);
    }
    aeo_count_add(&self->refused, taken ? 0u : 1u);
    return taken;
}

static uint32_t read_clock(void *context)
{
    const bus_t *self = (const bus_t *)context;
    return (uint32_t)self->clock_us;
}

void bus_port(bus_t *self, aeo_port_t *port)
{
    memset(port, 0, sizeof *port);
    port->context = self;
    port->send = send_frame;
    port->time_us = read_clock;
}

void bus_service(bus_t *self)
{
    if (self->kind == BUS_FILE) {
        frame_log_service(&self->log, self->clock_us);
    } else if (self->kind == BUS_CAN) {
        (void)socketcan_poll(&self->can);
    } else if (self->text != NULL) {
        (void)posix_bus_poll(self->text, -1, 0);
    }
}

/* ---- waiting: at the first and the last call -------------------------------------------------------------------- */

void bus_wait(bus_t *self, double seconds)
{
    const double until = clock_s() + seconds;
    while (self->text != NULL && posix_bus_listeners(self->text) == 0u && clock_s() < until) {
        (void)posix_bus_poll(self->text, -1, 20);
    }
}

void bus_pause(bus_t *self)
{
    const struct timespec moment = {0, 2000000};
    bus_service(self);
    (void)nanosleep(&moment, NULL);
}

void bus_linger(bus_t *self)
{
    const double begun = clock_s();
    double since = begun;
    size_t before = self->text != NULL ? posix_bus_waiting(self->text) : 0u;
    while (self->text != NULL && posix_bus_listeners(self->text) > 0u && clock_s() - since < STALL_S &&
           clock_s() - begun < LINGER_S) {
        size_t waiting;
        (void)posix_bus_poll(self->text, -1, 20);
        waiting = posix_bus_waiting(self->text);
        since = waiting != before ? clock_s() : since;
        before = waiting;
    }
}

const char *bus_address(const bus_t *self)
{
    return self->text != NULL ? self->text->address : NULL;
}

void bus_close(bus_t *self)
{
    if (self->kind == BUS_FILE) {
        frame_log_close(&self->log);
    } else if (self->kind == BUS_CAN) {
        socketcan_close(&self->can);
    } else if (self->text != NULL) {
        posix_bus_close(self->text);
        free(self->text);
        self->text = NULL;
    }
    self->kind = BUS_NONE;
}
/* SPDX-License-Identifier: MIT */
