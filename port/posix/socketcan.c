#include "socketcan.h"

#include <aeolid/count.h>

#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define ERRORS_A_POLL 64 /* error frames read in one poll: a broken bus makes thousands a second */
#define NO_CAN        "this kernel has no CAN sockets for %s; load them (modprobe can_raw) or use slcan (pty, tcp:PORT)"
#define NO_RIGHT      "no permission for CAN sockets on %s; run as root, or grant the service or container CAP_NET_RAW"

static uint32_t read_clock(void *context)
{
    struct timespec now;
    (void)context;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)((uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u);
}

static void lock(void *context)
{
    (void)pthread_mutex_lock(((socketcan_t *)context)->mutex);
}

static void unlock(void *context)
{
    (void)pthread_mutex_unlock(((socketcan_t *)context)->mutex);
}

/* ---- opening ----------------------------------------------------------------------------------------------------- */

static int ask(const socketcan_t *self, unsigned long request, struct ifreq *answer)
{
    memset(answer, 0, sizeof *answer);
    memcpy(answer->ifr_name, self->name, SOCKETCAN_NAME_MAX);
    return ioctl(self->fd, request, answer) < 0 ? errno : 0;
}

/* Receive nothing but error frames. The filters come before bind: no frame can slip in between. */
static int set_filters(const socketcan_t *self)
{
    const can_err_mask_t all = CAN_ERR_MASK;
    const int yes = 1;
    if (setsockopt(self->fd, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0) != 0 ||
        setsockopt(self->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all, sizeof all) != 0) {
        return errno;
    }
    if (self->fd_frames && setsockopt(self->fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &yes, sizeof yes) != 0) {
        return errno;
    }
    return 0;
}

/* Bind to the interface of this name, which has another index each time an adapter is plugged in. */
static int bind_by_name(socketcan_t *self)
{
    struct sockaddr_can address;
    struct ifreq answer;
    int error = ask(self, SIOCGIFINDEX, &answer);
    if (error != 0) {
        return error;
    }
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = answer.ifr_ifindex;
    error = ask(self, SIOCGIFMTU, &answer);
    if (error == 0 && self->fd_frames && answer.ifr_mtu == (int)CAN_MTU) {
        error = EMSGSIZE;
    }
    if (error == 0 && bind(self->fd, (struct sockaddr *)&address, sizeof address) != 0) {
        error = errno == ENODEV ? ENOTTY : errno; /* it is there: so it is no CAN interface */
    }
    if (error == 0) {
        self->index = (unsigned)address.can_ifindex;
    }
    return error;
}

static int is_running(const socketcan_t *self)
{
    struct ifreq answer;
    return ask(self, SIOCGIFFLAGS, &answer) == 0 && (answer.ifr_flags & IFF_UP) != 0 &&
           (answer.ifr_flags & IFF_RUNNING) != 0;
}

int socketcan_open(socketcan_t *self, const char *interface, int fd_frames)
{
    const size_t length = strlen(interface);
    int error;
    memset(self, 0, sizeof *self);
    self->fd = -1;
    if (length == 0u || length >= SOCKETCAN_NAME_MAX) {
        return ENAMETOOLONG;
    }
    memcpy(self->name, interface, length);
    self->fd_frames = fd_frames;
    self->fd = socket(AF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    error = self->fd < 0 ? errno : set_filters(self);
    if (error == 0) {
        error = bind_by_name(self);
    }
    if (error != 0) {
        socketcan_close(self);
        return error;
    }
    self->up = is_running(self);
    self->looked_us = read_clock(NULL);
    return 0;
}

void socketcan_close(socketcan_t *self)
{
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
        self->up = 0;
    }
}

const char *socketcan_explain(const char *interface, int error, char *text)
{
    static const struct {
        int error;
        const char *form; /* the interface's name at most three times */
    } known[] = {
        {EAFNOSUPPORT, NO_CAN},
        {EPROTONOSUPPORT, NO_CAN},
        {EPERM, NO_RIGHT},
        {EACCES, NO_RIGHT},
        {ENODEV, "there is no interface %s; plug it in, or make a virtual one: ip link add dev %s type vcan && "
                 "ip link set %s up"},
        {ENAMETOOLONG, "%.40s is no name of an interface, which has 1 to 15 characters"},
        {ENOTTY, "%s is not a CAN interface; ip -brief link lists the interfaces there are"},
        {EMSGSIZE, "%s carries classic frames only; set it down, then ip link set %s mtu 72 (virtual) or ip link set "
                   "%s type can dbitrate 2000000 fd on"},
        {ENETDOWN, "the interface %s is down; ip link set %s up (a real one first needs ip link set %s type can "
                   "bitrate 500000)"},
    };
    size_t i;
    for (i = 0; i < sizeof known / sizeof *known; i++) {
        if (known[i].error == error) {
            (void)snprintf(text, SOCKETCAN_TEXT_MAX, known[i].form, interface, interface, interface);
            return text;
        }
    }
    (void)snprintf(text, SOCKETCAN_TEXT_MAX, "the interface %s cannot be opened: %s", interface, strerror(error));
    return text;
}

/* ---- sending ----------------------------------------------------------------------------------------------------- */

/* can_frame and canfd_frame begin alike; the number of bytes written tells the kernel which one it is. */
static ssize_t write_frame(const socketcan_t *self, const aeo_can_frame_t *frame)
{
    struct canfd_frame out;
    const int is_fd = (frame->flags & AEO_CAN_FD) != 0u;
    memset(&out, 0, sizeof out);
    out.can_id = frame->id | ((frame->flags & AEO_CAN_EXTENDED) != 0u ? CAN_EFF_FLAG : 0u);
    out.len = frame->length;
    out.flags = (frame->flags & AEO_CAN_BRS) != 0u && is_fd ? CANFD_BRS : 0u;
    memcpy(out.data, frame->data, frame->length <= 64u ? frame->length : 64u);
    return write(self->fd, &out, is_fd ? CANFD_MTU : CAN_MTU);
}

static int send_frame(void *context, const aeo_can_frame_t *frame)
{
    socketcan_t *self = (socketcan_t *)context;
    if (self->off) { /* the kernel takes frames in bus-off and throws them away */
        aeo_count_up(&self->counters.down);
        return 0;
    }
    if (write_frame(self, frame) >= 0) {
        aeo_count_up(&self->counters.sent);
        return 1;
    }
    if (errno == ENOBUFS || errno == EAGAIN || errno == EINTR) {
        aeo_count_up(&self->counters.full);
    } else if (errno == ENETDOWN || errno == ENXIO || errno == ENODEV) {
        aeo_count_up(&self->counters.down);
    } else {
        aeo_count_up(&self->counters.failed);
        self->last_error = errno;
    }
    return 0;
}

void socketcan_port(socketcan_t *self, aeo_port_t *port, pthread_mutex_t *mutex)
{
    self->mutex = mutex;
    port->context = self;
    port->send = send_frame;
    port->time_us = read_clock;
    port->lock = mutex != NULL ? lock : NULL;
    port->unlock = mutex != NULL ? unlock : NULL;
}

/* ---- watching ---------------------------------------------------------------------------------------------------- */

typedef struct {
    unsigned errors, bus_off;
    int last; /* 1: bus-off came last, -1: restarted, 0 neither */
} heard_t;

static heard_t hear_errors(const socketcan_t *self)
{
    heard_t heard = {0, 0, 0};
    struct canfd_frame frame;
    int i;
    for (i = 0; i < ERRORS_A_POLL; i++) {
        if (read(self->fd, &frame, sizeof frame) != (ssize_t)CAN_MTU) {
            break; /* nothing there, or the word that the interface went down: the flags tell that */
        }
        heard.errors++;
        if ((frame.can_id & CAN_ERR_BUSOFF) != 0u) {
            heard.bus_off++;
            heard.last = 1;
        } else if ((frame.can_id & CAN_ERR_RESTARTED) != 0u) {
            heard.last = -1;
        }
    }
    return heard;
}

/* Tell whether the interface is there and up; bind anew where it was away, which leaves it with another index. */
static int look(socketcan_t *self)
{
    struct ifreq answer;
    const int there = ask(self, SIOCGIFINDEX, &answer) == 0;
    if (!there) {
        self->index = 0; /* the same index may come back for a new interface, to which the socket is not bound */
        return 0;
    }
    if ((unsigned)answer.ifr_ifindex != self->index && bind_by_name(self) != 0) {
        return 0;
    }
    return is_running(self);
}

/* Take over what poll heard and saw; the only place beside send that changes what both contexts read. */
static int take_over(socketcan_t *self, heard_t heard, int up, uint32_t now_us)
{
    const int before = self->up && !self->off;
    int usable;
    aeo_count_add(&self->counters.errors, heard.errors);
    aeo_count_add(&self->counters.bus_off, heard.bus_off);
    if (heard.last > 0) {
        self->off = 1;
        self->off_us = now_us;
    } else if (heard.last < 0 || (up && now_us - self->off_us >= SOCKETCAN_REST_US)) {
        self->off = 0;
    }
    self->up = up;
    usable = self->up && !self->off;
    aeo_count_add(&self->counters.lost, before && !usable);
    aeo_count_add(&self->counters.returned, !before && usable);
    return usable;
}

int socketcan_poll(socketcan_t *self)
{
    const uint32_t now_us = read_clock(NULL);
    const heard_t heard = hear_errors(self);
    int up = self->up, usable;
    if (now_us - self->looked_us >= SOCKETCAN_LOOK_US) {
        up = look(self);
        self->looked_us = now_us;
    }
    if (self->mutex != NULL) {
        lock(self);
    }
    usable = take_over(self, heard, up, now_us);
    if (self->mutex != NULL) {
        unlock(self);
    }
    return usable;
}
