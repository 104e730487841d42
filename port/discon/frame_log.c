#include "frame_log.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

int frame_log_open(frame_log_t *self, const char *path, int replace)
{
    struct stat facts;
    struct rlimit most;
    struct timespec now;
    if (!replace && stat(path, &facts) == 0) { /* O_EXCL settles the race with another process */
        self->fd = -1;
        return S_ISREG(facts.st_mode) ? EEXIST : EINVAL;
    }
    self->fd = open(path, O_WRONLY | O_CREAT | (replace ? O_TRUNC : O_EXCL) | O_NONBLOCK | O_CLOEXEC, 0666);
    (void)clock_gettime(CLOCK_REALTIME, &now);
    self->start_us = (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
    self->held = 0;
    self->size = 0;
    self->written_us = 0;
    self->stamp_length = 0;
    self->limit = UINT64_MAX;
    if (self->fd < 0) {
        return errno;
    }
    if (fstat(self->fd, &facts) != 0 || !S_ISREG(facts.st_mode)) {
        (void)close(self->fd);
        self->fd = -1;
        return EINVAL;
    }
    if (getrlimit(RLIMIT_FSIZE, &most) == 0 && most.rlim_cur != RLIM_INFINITY) {
        self->limit = most.rlim_cur;
    }
    return 0;
}

/* Write `count` hexadecimal digits of a number. */
static char *write_hex(char *at, uint32_t number, unsigned count)
{
    while (count > 0u) {
        count--;
        *at++ = "0123456789ABCDEF"[number >> (4u * count) & 15u];
    }
    return at;
}

int frame_log_put(frame_log_t *self, uint64_t time_us, const aeo_can_frame_t *frame)
{
    char *at = self->text + self->held;
    if (self->fd < 0 || FRAME_LOG_ROOM - self->held < FRAME_LOG_LINE || frame->length > sizeof frame->data) {
        return 0;
    }
    if (self->stamp_length == 0u || time_us != self->stamp_us) { /* the frames of one call share it */
        const uint64_t date_us = self->start_us + time_us;
        self->stamp_us = time_us;
        self->stamp_length = (size_t)snprintf(self->stamp, sizeof self->stamp, "(%010llu.%06u) can0 ",
                                              (unsigned long long)(date_us / 1000000u), (unsigned)(date_us % 1000000u));
    }
    memcpy(at, self->stamp, self->stamp_length);
    at = write_hex(at + self->stamp_length, frame->id, (frame->flags & AEO_CAN_EXTENDED) != 0u ? 8u : 3u);
    *at++ = '#';
    if ((frame->flags & AEO_CAN_FD) != 0u) {
        *at++ = '#';
        *at++ = (frame->flags & AEO_CAN_BRS) != 0u ? '1' : '0';
    }
    for (unsigned i = 0; i < frame->length; i++) {
        at = write_hex(at, frame->data[i], 2);
    }
    *at++ = '\n';
    self->held = (size_t)(at - self->text);
    return 1;
}

/* Write what is kept, as much as the file takes. */
static void flush(frame_log_t *self)
{
    size_t length = self->held;
    ssize_t put;
    if (self->fd < 0 || length == 0u) {
        return;
    }
    if (self->size + length > self->limit) {
        return;
    }
    put = write(self->fd, self->text, length);
    if (put > 0) { /* less than asked for: the disk is full, and the rest waits */
        memmove(self->text, self->text + put, length - (size_t)put);
        self->held -= (size_t)put;
        self->size += (uint64_t)put;
    }
}

void frame_log_service(frame_log_t *self, uint64_t time_us)
{
    if (time_us - self->written_us >= FRAME_LOG_US || self->held > FRAME_LOG_ROOM / 2u) {
        flush(self);
        self->written_us = time_us;
    }
}

void frame_log_close(frame_log_t *self)
{
    flush(self);
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}
/* SPDX-License-Identifier: MIT */
