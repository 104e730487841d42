#include "controller.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define FLAGS         (RTLD_LAZY | RTLD_LOCAL) /* as OpenFAST loads a controller */
#define COPY_PATH_MAX 1200u

static discon_procedure_t find_procedure(void *handle, const char *symbol)
{
    discon_procedure_t call = NULL;
    void *address = dlsym(handle, symbol);
    memcpy(&call, &address, sizeof call); /* ISO C has no cast from an object's address to a procedure's */
    return call;
}

static void pause_a_moment(void)
{
    const struct timespec moment = {0, 10000000};
    (void)nanosleep(&moment, NULL);
}

/* Lock the file, or go on without after 2 s (a file system without locks, somebody who keeps one). */
static int lock_file(const char *path)
{
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    for (int i = 0; fd >= 0 && i < 200 && flock(fd, LOCK_EX | LOCK_NB) != 0 && (errno == EWOULDBLOCK || errno == EINTR);
         i++) {
        pause_a_moment();
    }
    return fd;
}

/* ---- private copies ---------------------------------------------------------------------------------------------- */

static int copy_bytes(int from, int to)
{
    char block[8192];
    ssize_t got;
    while ((got = read(from, block, sizeof block)) > 0) {
        for (ssize_t at = 0; at < got;) {
            const ssize_t put = write(to, block + at, (size_t)(got - at));
            if (put <= 0) {
                return -1;
            }
            at += put;
        }
    }
    return got == 0 && fchmod(to, S_IRWXU) == 0 ? 0 : -1;
}

/* Load a copy of `path` made in `folder`; null when that fails. */
static void *load_copy_in(const char *path, const char *folder, size_t folder_length)
{
    char copy[COPY_PATH_MAX];
    void *handle = NULL;
    int from, to;
    if (folder_length + 32u > sizeof copy) {
        return NULL;
    }
    (void)snprintf(copy, sizeof copy, "%.*s/.aeolid-XXXXXX", (int)folder_length, folder);
    from = open(path, O_RDONLY | O_CLOEXEC);
    to = from >= 0 ? mkostemp(copy, O_CLOEXEC) : -1;
    if (to >= 0) {
        const int failed = copy_bytes(from, to);
        (void)close(to); /* before it is loaded: what is open for writing cannot be run from */
        handle = failed ? NULL : dlopen(copy, FLAGS);
        (void)unlink(copy);
    }
    if (from >= 0) {
        (void)close(from);
    }
    return handle;
}

static void *load_copy(const char *path)
{
    const char *slash = strrchr(path, '/');
    const char *temporary = getenv("TMPDIR");
    void *handle = slash == NULL ? NULL : load_copy_in(path, path, (size_t)(slash - path));
    if (handle == NULL && temporary != NULL && temporary[0] == '/') {
        handle = load_copy_in(path, temporary, strlen(temporary));
    }
    return handle != NULL ? handle : load_copy_in(path, "/tmp", 4);
}

/* ---- loading ----------------------------------------------------------------------------------------------------- */

static int refuse(char *why, size_t room, const char *path, const char *reason, const char *remedy)
{
    (void)snprintf(why, room, "controller %.200s: %.200s; %s", path, reason, remedy);
    return -1;
}

static const char *loader_says(const char *path)
{
    const char *words = dlerror();
    const size_t length = strlen(path);
    if (words == NULL) {
        return "cannot be loaded";
    }
    /* the path stands before it already */
    return strncmp(words, path, length) == 0 && words[length] == ':' ? words + length + 1u + (words[length + 1u] == ' ')
                                                                     : words;
}

int controller_load(controller_t *self, const char *path, const char *symbol, discon_procedure_t own, char *why,
                    size_t room)
{
    static const char remedy[] = "set `controller` to your controller's library, built for this machine";
    struct stat facts;
    int lock, result = 0;
    void *there;
    self->call = NULL;
    self->handle = NULL;
    if (stat(path, &facts) == 0 && !S_ISREG(facts.st_mode)) { /* a pipe would hang the loader */
        return refuse(why, room, path, "not a file", remedy);
    }
    lock = lock_file(path);
    there = dlopen(path, FLAGS | RTLD_NOLOAD);
    (void)dlerror();
    if (there != NULL && find_procedure(there, symbol) == own) {
        result = refuse(why, room, path, "this is the wrapper itself", remedy);
    } else {
        self->handle = there != NULL ? load_copy(path) : dlopen(path, FLAGS);
        if (self->handle == NULL) {
            result = refuse(why, room, path, loader_says(path),
                            there != NULL ? "it is in use already, and no private copy could be made" : remedy);
        }
    }
    if (there != NULL) {
        (void)dlclose(there);
    }
    if (lock >= 0) {
        (void)close(lock);
    }
    if (result == 0) {
        self->call = find_procedure(self->handle, symbol);
        if (self->call == NULL || self->call == own) {
            (void)snprintf(why, room,
                           "controller %.200s has no procedure %.63s; set `symbol` to the name that the "
                           "simulator called before",
                           path, symbol);
            controller_unload(self);
            result = -1;
        }
    }
    return result;
}

void controller_unload(controller_t *self)
{
    if (self->handle != NULL) {
        (void)dlclose(self->handle);
    }
    self->handle = NULL;
    self->call = NULL;
}
/* SPDX-License-Identifier: MIT */
