#include "settings.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Read a regular file whole; its length, or -1 with errno set. A pipe would hang the simulator. */
static ssize_t read_file(const char *path, char *text, size_t room)
{
    struct stat facts;
    size_t held = 0;
    ssize_t got = -1;
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd >= 0 && fstat(fd, &facts) == 0) {
        if (!S_ISREG(facts.st_mode)) {
            errno = S_ISDIR(facts.st_mode) ? EISDIR : EINVAL;
        } else {
            while (held < room && (got = read(fd, text + held, room - held)) > 0) {
                held += (size_t)got;
            }
        }
    }
    if (fd >= 0) {
        const int error = errno;
        (void)close(fd);
        errno = error;
    }
    return got < 0 ? -1 : (ssize_t)held;
}

int settings_read(settings_t *self, const char *path, char *why)
{
    char text[SETTINGS_TEXT_MAX + 1u];
    const ssize_t length = read_file(path, text, sizeof text);
    if (length < 0) {
        (void)snprintf(
            why, SETTINGS_WHY_MAX,
            "%.200s: %s; this file says what the wrapper does: put it there, or name another in AEOLID_DISCON", path,
            strerror(errno));
        return -1;
    }
    if ((size_t)length > SETTINGS_TEXT_MAX) {
        (void)snprintf(why, SETTINGS_WHY_MAX, "%.200s: longer than 32768 characters; is this the settings file?", path);
        return -1;
    }
    return settings_parse(self, path, text, (size_t)length, why);
}
/* SPDX-License-Identifier: MIT */
