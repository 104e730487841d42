#include "simulator.h"

#include <dlfcn.h>
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static double draw(simulator_t *self)
{
    self->noise = self->noise * 1664525u + 1013904223u;
    return (double)(self->noise >> 8) / 8388608.0 - 1.0;
}

int simulator_open(simulator_t *self, const char *library, unsigned records, const char *infile)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    memset(self, 0, sizeof *self);
    self->length = (records * sizeof(float) + page - 1u) / page * page + page;
    self->pages = mmap(NULL, self->length, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (self->pages == MAP_FAILED || mprotect((char *)self->pages + self->length - page, page, PROT_NONE) != 0) {
        return 0;
    }
    self->swap = (float *)(void *)((char *)self->pages + self->length - page) - records;
    self->records = records;
    self->step_s = 0.01;
    self->speed = 122.0;
    self->noise = 1;
    (void)snprintf(self->in, sizeof self->in, "%s", infile);
    (void)snprintf(self->out, sizeof self->out, "run");
    self->handle = dlopen(library, RTLD_LAZY);
    if (self->handle != NULL) {
        void *address = dlsym(self->handle, "DISCON");
        memcpy(&self->call, &address, sizeof self->call);
    }
    return self->call != NULL;
}

int simulator_call(simulator_t *self, float status)
{
    float *swap = self->swap;
    swap[1 - 1] = status;
    swap[2 - 1] = (float)self->time_s;
    swap[3 - 1] = (float)self->step_s;
    swap[20 - 1] = (float)self->speed;
    swap[21 - 1] = (float)(self->speed / 97.0);
    swap[23 - 1] = swap[47 - 1];
    swap[24 - 1] = 0.01F;
    swap[27 - 1] = (float)(14.0 + draw(self));
    swap[4 - 1] = swap[33 - 1] = swap[34 - 1] = swap[28 - 1] > 0.5F ? swap[42 - 1] : swap[45 - 1];
    swap[49 - 1] = SIMULATOR_MESSAGE;
    swap[50 - 1] = (float)strlen(self->in) + 1.0F;
    swap[51 - 1] = SIMULATOR_OUT;
    swap[53 - 1] = (float)self->tower[1];
    swap[54 - 1] = (float)(0.1 * draw(self));
    swap[60 - 1] = (float)fmod(self->time_s * 1.26, 6.283185307);
    swap[61 - 1] = 3.0F;
    self->fail = 0;
    self->call(swap, &self->fail, self->in, self->out, self->message);
    return self->fail;
}

void simulator_step(simulator_t *self)
{
    const double pitch = (double)(self->swap[28 - 1] > 0.5F ? self->swap[42 - 1] : self->swap[45 - 1]);
    const double push = draw(self) - 8.0 * (pitch - 0.15), speed = 0.05 * (self->speed - 122.0);
    const double acceleration = push - 4.0 * self->tower[0] - 0.2 * self->tower[1];
    self->speed += self->step_s * (2.0 * push - speed);
    self->tower[1] += self->step_s * acceleration;
    self->tower[0] += self->step_s * self->tower[1];
    self->time_s += self->step_s;
}

int simulator_run(simulator_t *self, double until_s, int last)
{
    int fail = simulator_call(self, 0.0F);
    while (fail >= 0 && self->time_s < until_s) {
        simulator_step(self);
        fail = simulator_call(self, 1.0F);
    }
    return last && fail >= 0 ? simulator_call(self, -1.0F) : fail;
}

void simulator_close(simulator_t *self)
{
    if (self->handle != NULL) {
        (void)dlclose(self->handle);
    }
    if (self->pages != NULL) {
        (void)munmap(self->pages, self->length);
    }
    memset(self, 0, sizeof *self);
}

/* ---- files ------------------------------------------------------------------------------------------------------- */

static int write_bytes(const char *path, const void *bytes, size_t length)
{
    FILE *file = fopen(path, "wb");
    const int done = file != NULL && fwrite(bytes, 1, length, file) == length;
    return file != NULL && fclose(file) == 0 && done;
}

int write_text(const char *path, const char *text)
{
    return write_bytes(path, text, strlen(text));
}

int copy_file(const char *from, const char *to)
{
    static char bytes[16 << 20];
    FILE *file = fopen(from, "rb");
    const size_t length = file == NULL ? 0u : fread(bytes, 1, sizeof bytes, file);
    return file != NULL && fclose(file) == 0 && length > 0u && write_bytes(to, bytes, length);
}

int write_settings(const char *path, const char *controller, const char *more)
{
    char text[4096];
    (void)snprintf(text, sizeof text,
                   "controller = %s\ninput = pitch_command scale 0.05\noutput = generator_speed offset 122 scale 0.2\n"
                   "output = tower_fore_aft scale 0.3\ndecimation = 10\n%s%s",
                   controller, strstr(more, "past = ") == NULL ? "past = 8\n" : "", more);
    return write_text(path, text);
}

int configure(const char *controller, const char *more)
{
    const char *path = in_scratch("settings.cfg");
    return write_settings(path, controller, more) && setenv("AEOLID_DISCON", path, 1) == 0;
}

int same_answers(const simulator_t *a, const simulator_t *b)
{
    return memcmp(a->swap, b->swap, a->records * sizeof *a->swap) == 0 &&
           memcmp(a->message, b->message, sizeof a->message) == 0 && memcmp(a->out, b->out, sizeof a->out) == 0 &&
           memcmp(a->in, b->in, sizeof a->in) == 0 && a->fail == b->fail;
}

static char folder[64];

static void remove_scratch(void)
{
    char path[512];
    const struct dirent *entry;
    DIR *list = opendir(folder);
    while (list != NULL && (entry = readdir(list)) != NULL) {
        (void)snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        (void)remove(path);
    }
    if (list != NULL) {
        (void)closedir(list);
    }
    (void)rmdir(folder);
}

const char *scratch(void)
{
    if (folder[0] == '\0') {
        (void)snprintf(folder, sizeof folder, "/tmp/aeolid-discon-XXXXXX");
        if (mkdtemp(folder) == NULL || atexit(remove_scratch) != 0) {
            abort();
        }
    }
    return folder;
}

const char *in_scratch(const char *name)
{
    static char path[8][256];
    static unsigned turn;
    turn = (turn + 1u) % 8u;
    (void)snprintf(path[turn], sizeof path[turn], "%s/%s", scratch(), name);
    return path[turn];
}
/* SPDX-License-Identifier: MIT */
