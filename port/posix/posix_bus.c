#include "posix_bus.h"

#include "slcan.h"

#include <aeolid/count.h>

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#define CLASSIC_LINE 27u /* characters of a classic frame with 29 bit identifier and 8 bytes */

static void clear(posix_bus_t *self)
{
    unsigned i;
    self->terminal = 0;
    self->server = -1;
    self->arrived = 0;
    self->refused = 0;
    self->dropped = 0;
    self->address[0] = '\0';
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        self->listener[i].fd = -1;
        self->listener[i].open = 0;
    }
}

static void start_listener(posix_listener_t *listener, int fd)
{
    listener->fd = fd;
    listener->open = 0;
    listener->head = 0;
    listener->tail = 0;
    listener->dropped = 0;
    listener->command_length = 0;
}

static int make_nonblocking(int fd)
{
    const int flags = fcntl(fd, F_GETFL);
    return flags < 0 || fcntl(fd, F_SETFL, flags | O_NONBLOCK) < 0 || fcntl(fd, F_SETFD, FD_CLOEXEC) < 0 ? errno : 0;
}

/* Set the slave raw through a descriptor of its own and close that again: the settings stay with the terminal, and the
 * master then sees the listener come and go (POLLHUP). */
static int make_raw(const char *name)
{
    struct termios settings;
    const int fd = open(name, O_RDWR | O_NOCTTY);
    int result = 0;
    if (fd < 0) {
        return errno;
    }
    if (tcgetattr(fd, &settings) != 0) {
        result = errno;
    } else {
        cfmakeraw(&settings);
        result = tcsetattr(fd, TCSANOW, &settings) != 0 ? errno : 0;
    }
    close(fd);
    return result;
}

/* Not ptsname: its answer lies in a place that all threads share, and turbines may open theirs at once. */
static int name_slave(int fd, char *name, size_t room)
{
    unsigned number = 0;
    if (grantpt(fd) != 0 || unlockpt(fd) != 0 || ioctl(fd, TIOCGPTN, &number) != 0) {
        return errno;
    }
    (void)snprintf(name, room, "/dev/pts/%u", number);
    return 0;
}

int posix_bus_open_terminal(posix_bus_t *self)
{
    char name[32];
    int error;
    const int fd = posix_openpt(O_RDWR | O_NOCTTY);
    clear(self);
    if (fd < 0) {
        return errno;
    }
    error = name_slave(fd, name, sizeof name);
    if (error == 0) {
        error = make_raw(name);
    }
    if (error == 0) {
        error = make_nonblocking(fd);
    }
    if (error != 0) {
        close(fd);
        return error;
    }
    self->terminal = 1;
    (void)snprintf(self->address, sizeof self->address, "slcan:%s", name);
    start_listener(&self->listener[0], fd);
    return 0;
}

int posix_bus_open_tcp(posix_bus_t *self, uint16_t port)
{
    struct sockaddr_in address;
    socklen_t length = sizeof address;
    const int yes = 1;
    int error;
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    clear(self);
    if (fd < 0) {
        return errno;
    }
    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    (void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(fd, (struct sockaddr *)&address, sizeof address) != 0 || listen(fd, POSIX_BUS_LISTENERS) != 0 ||
        getsockname(fd, (struct sockaddr *)&address, &length) != 0) {
        error = errno;
        close(fd);
        return error;
    }
    error = make_nonblocking(fd);
    self->server = fd;
    (void)snprintf(self->address, sizeof self->address, "slcan:socket://127.0.0.1:%u",
                   (unsigned)ntohs(address.sin_port));
    return error;
}

/* ---- sending ----------------------------------------------------------------------------------------------------- */

static uint32_t free_characters(const posix_listener_t *listener)
{
    return POSIX_BUS_RING - (listener->head - listener->tail);
}

static void append(posix_listener_t *listener, const char *text, size_t length)
{
    const size_t at = listener->head % POSIX_BUS_RING;
    const size_t first = length < POSIX_BUS_RING - at ? length : POSIX_BUS_RING - at;
    memcpy(listener->ring + at, text, first);
    memcpy(listener->ring, text + first, length - first);
    listener->head += (uint32_t)length;
}

static int send_frame(void *context, const aeo_can_frame_t *frame)
{
    posix_bus_t *self = (posix_bus_t *)context;
    char line[SLCAN_LINE_MAX];
    const size_t length = slcan_format(frame, line);
    const size_t room = posix_bus_room(self);
    unsigned i, taken = 0;
    if (length == 0u) {
        return 0;
    }
    if (room == SIZE_MAX) {
        return 1;
    }
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        taken += self->listener[i].open && free_characters(&self->listener[i]) >= length;
    }
    if (taken == 0u) {
        aeo_count_up(&self->refused);
        return 0;
    }
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        posix_listener_t *listener = &self->listener[i];
        if (listener->open && free_characters(listener) >= length) {
            append(listener, line, length);
        } else if (listener->open) {
            aeo_count_up(&listener->dropped);
        }
    }
    return 1;
}

void posix_bus_port(posix_bus_t *self, aeo_port_t *port)
{
    port->context = self;
    port->send = send_frame;
    port->time_us = NULL;
    port->lock = NULL;
    port->unlock = NULL;
}

/* ---- peers ------------------------------------------------------------------------------------------------------- */

static void shut_channel(posix_bus_t *self, posix_listener_t *listener)
{
    listener->open = 0;
    listener->tail = listener->head;
    listener->command_length = 0;
    aeo_count_add(&self->dropped, listener->dropped);
    listener->dropped = 0;
    if (self->terminal) { /* what was sent for it; what has come meanwhile is the next listener's, its "open" perhaps */
        (void)tcflush(listener->fd, TCOFLUSH);
    }
}

static void forget(posix_bus_t *self, posix_listener_t *listener)
{
    shut_channel(self, listener);
    if (!self->terminal) { /* a terminal stays for the next listener */
        close(listener->fd);
        listener->fd = -1;
    }
}

/* Obey one slcan command; acknowledge everything else that a listener may send while it sets its channel up. */
static void obey(posix_bus_t *self, posix_listener_t *listener)
{
    const char *answer = "\r";
    const char letter = listener->command_length > 0u ? listener->command[0] : '\0';
    if (letter == 'O' || letter == 'L') {
        listener->open = 1;
    } else if (letter == 'C') {
        shut_channel(self, listener);
    } else if (letter == 'V') {
        answer = "V1013\r";
    } else if (letter == 'N') {
        answer = "NAEOL\r";
    }
    if (letter != '\0' && free_characters(listener) >= strlen(answer)) {
        append(listener, answer, strlen(answer));
    }
    listener->command_length = 0;
}

static void read_commands(posix_bus_t *self, posix_listener_t *listener)
{
    char text[512];
    ssize_t i;
    const ssize_t got = read(listener->fd, text, sizeof text);
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) {
        forget(self, listener); /* EIO: the last holder of the terminal has closed it */
        return;
    }
    for (i = 0; i < got; i++) {
        if (text[i] == '\r') {
            obey(self, listener);
        } else if (listener->command_length < sizeof listener->command) {
            listener->command[listener->command_length++] = text[i];
        } /* a longer line is cut: only its first letter counts */
    }
}

static void write_ring(posix_bus_t *self, posix_listener_t *listener)
{
    while (listener->head != listener->tail) {
        const size_t at = listener->tail % POSIX_BUS_RING;
        const size_t waiting = listener->head - listener->tail;
        const size_t length = waiting < POSIX_BUS_RING - at ? waiting : POSIX_BUS_RING - at;
        const ssize_t put = self->terminal ? write(listener->fd, listener->ring + at, length)
                                           : send(listener->fd, listener->ring + at, length, MSG_NOSIGNAL);
        if (put > 0) {
            listener->tail += (uint32_t)put;
        } else if (put < 0 && errno != EAGAIN && errno != EINTR) {
            forget(self, listener);
            return;
        } else {
            return;
        }
    }
}

/* Return a place for a peer that has come, or null where all are taken by listeners that keep up. */
static posix_listener_t *find_place(posix_bus_t *self)
{
    posix_listener_t *silent = NULL, *slowest = NULL;
    uint32_t most = POSIX_BUS_RING / 2u;
    unsigned i;
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        posix_listener_t *listener = &self->listener[i];
        if (listener->fd < 0) {
            return listener;
        }
        if (!listener->open && (silent == NULL || self->arrived - listener->order > self->arrived - silent->order)) {
            silent = listener;
        } else if (listener->open && listener->head - listener->tail > most) {
            slowest = listener;
            most = listener->head - listener->tail;
        }
    }
    if (silent != NULL || slowest != NULL) {
        forget(self, silent != NULL ? silent : slowest);
    }
    return silent != NULL ? silent : slowest;
}

static void accept_peer(posix_bus_t *self)
{
    posix_listener_t *place;
    const int fd = accept(self->server, NULL, NULL);
    const int buffer = 65536; /* the kernel's own choice, megabytes, would hide a listener that hangs for minutes */
    if (fd < 0) {
        return;
    }
    (void)setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
    place = make_nonblocking(fd) == 0 ? find_place(self) : NULL;
    if (place == NULL) {
        close(fd);
        return;
    }
    start_listener(place, fd);
    place->order = self->arrived++;
}

/* A terminal without a listener reports POLLHUP at once and for ever: wait without it, look again afterwards. */
static int hangs_up(const posix_bus_t *self)
{
    struct pollfd probe = {self->listener[0].fd, POLLIN, 0};
    return self->terminal && poll(&probe, 1, 0) > 0 && (probe.revents & POLLHUP) != 0 && (probe.revents & POLLIN) == 0;
}

int posix_bus_poll(posix_bus_t *self, int also, int timeout_ms)
{
    struct pollfd wait[POSIX_BUS_LISTENERS + 2];
    posix_listener_t *listener;
    unsigned i;
    memset(wait, 0, sizeof wait);
    if (hangs_up(self)) {
        if (self->listener[0].open) {
            shut_channel(self, &self->listener[0]);
        }
        wait[0].fd = -1;
        timeout_ms = timeout_ms < 0 || timeout_ms > 20 ? 20 : timeout_ms;
    } else {
        wait[0].fd = self->listener[0].fd;
    }
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        listener = &self->listener[i];
        wait[i].fd = i == 0u ? wait[0].fd : listener->fd;
        wait[i].events = (short)(POLLIN | (listener->head != listener->tail ? POLLOUT : 0));
    }
    wait[POSIX_BUS_LISTENERS].fd = self->server;
    wait[POSIX_BUS_LISTENERS].events = POLLIN;
    wait[POSIX_BUS_LISTENERS + 1].fd = also;
    wait[POSIX_BUS_LISTENERS + 1].events = POLLIN;
    if (poll(wait, POSIX_BUS_LISTENERS + 2, timeout_ms) <= 0) {
        return 0;
    }
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        listener = &self->listener[i];
        if (listener->fd >= 0 && (wait[i].revents & (POLLIN | POLLERR | POLLHUP)) != 0) {
            read_commands(self, listener);
        }
        if (listener->fd >= 0 && (wait[i].revents & POLLOUT) != 0) {
            write_ring(self, listener);
        }
    }
    if ((wait[POSIX_BUS_LISTENERS].revents & POLLIN) != 0) {
        accept_peer(self);
    }
    return (wait[POSIX_BUS_LISTENERS + 1].revents & (POLLIN | POLLHUP | POLLERR)) != 0;
}

/* ---- figures ----------------------------------------------------------------------------------------------------- */

unsigned posix_bus_listeners(const posix_bus_t *self)
{
    unsigned i, count = 0;
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        count += self->listener[i].open != 0;
    }
    return count;
}

size_t posix_bus_room(const posix_bus_t *self)
{
    size_t room = SIZE_MAX;
    unsigned i;
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        const posix_listener_t *listener = &self->listener[i];
        if (listener->open && free_characters(listener) / CLASSIC_LINE < room) {
            room = free_characters(listener) / CLASSIC_LINE;
        }
    }
    return room;
}

size_t posix_bus_waiting(const posix_bus_t *self)
{
    size_t most = 0;
    unsigned i;
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        const size_t waiting = self->listener[i].head - self->listener[i].tail;
        if (self->listener[i].open && waiting > most) {
            most = waiting;
        }
    }
    return most;
}

uint32_t posix_bus_dropped(const posix_bus_t *self)
{
    uint32_t sum = self->dropped;
    unsigned i;
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        aeo_count_add(&sum, self->listener[i].fd >= 0 ? self->listener[i].dropped : 0u);
    }
    return sum;
}

void posix_bus_abandon(posix_bus_t *self, size_t waiting)
{
    unsigned i;
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        posix_listener_t *listener = &self->listener[i];
        if (listener->open && (size_t)(listener->head - listener->tail) > waiting) {
            forget(self, listener);
        }
    }
}

void posix_bus_close(posix_bus_t *self)
{
    unsigned i;
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        if (self->listener[i].fd >= 0) {
            close(self->listener[i].fd);
            self->listener[i].fd = -1;
            self->listener[i].open = 0;
        }
    }
    if (self->server >= 0) {
        close(self->server);
        self->server = -1;
    }
}
