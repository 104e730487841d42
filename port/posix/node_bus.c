#include "node_bus.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define AHEAD_NS 1000000 /* frames may run so far ahead of the bus: a process sleeps in milliseconds */

static int64_t now_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void start(node_bus_t *self, int is_can)
{
    self->is_can = is_can;
    self->idle_ns = 0;
    self->refusing_ns = 0;
    self->usable = 1;
}

int node_bus_open_text(node_bus_t *self, int terminal, uint16_t tcp_port, char *why)
{
    const int error = terminal ? posix_bus_open_terminal(&self->text) : posix_bus_open_tcp(&self->text, tcp_port);
    start(self, 0);
    if (error != 0) {
        (void)snprintf(why, SOCKETCAN_TEXT_MAX, "%s", strerror(error));
        return -1;
    }
    (void)snprintf(self->address, sizeof self->address, "%s", self->text.address);
    return 0;
}

int node_bus_open_can(node_bus_t *self, const char *interface, int fd_frames, uint32_t bit_rate, char *why)
{
    int error = socketcan_open(&self->can, interface, fd_frames);
    start(self, 1);
    self->bit_rate = bit_rate;
    if (error == 0 && !self->can.up) { /* a controller would wait for it; who starts a node by hand wants to know */
        socketcan_close(&self->can);
        error = ENETDOWN;
    }
    if (error != 0) {
        (void)socketcan_explain(interface, error, why);
        return -1;
    }
    (void)snprintf(self->address, sizeof self->address, "socketcan:%s%s", interface, fd_frames ? "?fd=true" : "");
    return 0;
}

/* ---- sending ----------------------------------------------------------------------------------------------------- */

/* Worst length on the bus; the data of a CAN FD frame are reckoned at the slow rate, which errs to the safe side. */
static int64_t carry_ns(const node_bus_t *self, const aeo_can_frame_t *frame)
{
    const int64_t more = frame->length > 8u ? (frame->length - 8) * 10 : 0;
    return ((int64_t)AEO_FRAME_BITS_EXTENDED + more) * 1000000000 / self->bit_rate;
}

static int send_paced(void *context, const aeo_can_frame_t *frame)
{
    node_bus_t *self = (node_bus_t *)context;
    const int64_t now = now_ns();
    aeo_port_t port;
    int taken;
    socketcan_port(&self->can, &port, NULL);
    taken = port.send(port.context, frame);
    self->refusing_ns = taken ? 0 : self->refusing_ns != 0 ? self->refusing_ns : now;
    self->idle_ns = (self->idle_ns > now ? self->idle_ns : now) + carry_ns(self, frame); /* a refused one waits too */
    return taken;
}

void node_bus_port(node_bus_t *self, aeo_port_t *port)
{
    if (!self->is_can) {
        posix_bus_port(&self->text, port);
        return;
    }
    memset(port, 0, sizeof *port);
    port->context = self;
    port->send = send_paced;
}

/* ---- watching ---------------------------------------------------------------------------------------------------- */

static int left_ms(const node_bus_t *self)
{
    const int64_t left = self->idle_ns - now_ns();
    return left > 0 ? (int)(left / 1000000) + 1 : 0;
}

static void tell_change(node_bus_t *self)
{
    const int usable = socketcan_poll(&self->can);
    if (usable != self->usable) {
        (void)fprintf(stderr, "aeolid-node: %s: %s\n", self->address,
                      usable ? "the interface is back"
                             : "the interface is down, away or in bus-off; frames are refused until it is back");
    }
    self->usable = usable;
}

int node_bus_poll(node_bus_t *self, int also, int timeout_ms)
{
    struct pollfd wait = {also, POLLIN, 0};
    const int left = self->is_can ? left_ms(self) : 0;
    if (!self->is_can) {
        return posix_bus_poll(&self->text, also, timeout_ms);
    }
    tell_change(self);
    if (also < 0 && left > 0 && left < timeout_ms) {
        timeout_ms = left;
    }
    return poll(&wait, 1, timeout_ms) > 0;
}

unsigned node_bus_listeners(const node_bus_t *self)
{
    return self->is_can ? 0u : posix_bus_listeners(&self->text);
}

size_t node_bus_room(const node_bus_t *self)
{
    if (!self->is_can) {
        return posix_bus_room(&self->text);
    }
    return self->idle_ns - now_ns() <= AHEAD_NS ? SIZE_MAX : 0u;
}

size_t node_bus_waiting(const node_bus_t *self)
{
    return self->is_can ? 0u : posix_bus_waiting(&self->text);
}

void node_bus_abandon(node_bus_t *self, size_t waiting)
{
    if (!self->is_can) {
        posix_bus_abandon(&self->text, waiting);
    }
}

int node_bus_is_stuck(const node_bus_t *self, double seconds)
{
    return self->is_can && self->refusing_ns != 0 && (double)(now_ns() - self->refusing_ns) > seconds * 1e9;
}

uint32_t node_bus_dropped(const node_bus_t *self)
{
    return self->is_can ? 0u : posix_bus_dropped(&self->text);
}

void node_bus_print_counters(const node_bus_t *self)
{
    const socketcan_counters_t *c = &self->can.counters;
    if (self->is_can) {
        (void)fprintf(stderr,
                      ", \"interface\": {\"sent\": %u, \"full\": %u, \"down\": %u, \"failed\": %u, \"errors\": %u, "
                      "\"bus_off\": %u, \"lost\": %u, \"returned\": %u}",
                      c->sent, c->full, c->down, c->failed, c->errors, c->bus_off, c->lost, c->returned);
    }
}

void node_bus_close(node_bus_t *self)
{
    if (self->is_can) {
        socketcan_close(&self->can);
    } else {
        posix_bus_close(&self->text);
    }
}
