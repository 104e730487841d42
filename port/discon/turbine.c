#include "turbine.h"

#include <dlfcn.h>
#include <errno.h>
#include <fenv.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    fenv_t arithmetic;
    int error;
} surroundings_t;

static void hold(surroundings_t *self)
{
    self->error = errno;
    (void)fegetenv(&self->arithmetic);
    (void)fesetenv(FE_DFL_ENV);
}

static void give_back(const surroundings_t *self)
{
    (void)fesetenv(&self->arithmetic);
    errno = self->error;
}

/* ---- begin ------------------------------------------------------------------------------------------------------- */

/* Find the settings file: AEOLID_DISCON, else this library's own path with the ending cfg. */
static int find_settings(discon_procedure_t own, char *path, size_t room)
{
    const char *named = getenv("AEOLID_DISCON");
    const char *slash, *dot;
    Dl_info info;
    void *address;
    size_t stem;
    if (named != NULL && named[0] != '\0') {
        return snprintf(path, room, "%s", named) < (int)room ? 0 : -1;
    }
    memcpy(&address, &own, sizeof address); /* as in controller.c */
    if (dladdr(address, &info) == 0 || info.dli_fname == NULL) {
        return -1;
    }
    slash = strrchr(info.dli_fname, '/');
    dot = strrchr(info.dli_fname, '.');
    stem = dot != NULL && (slash == NULL || dot > slash) ? (size_t)(dot - info.dli_fname) : strlen(info.dli_fname);
    return snprintf(path, room, "%.*s.cfg", (int)stem, info.dli_fname) < (int)room ? 0 : -1;
}

static int read_settings(turbine_t *self, discon_procedure_t own)
{
    char path[SETTINGS_PATH_MAX];
    surroundings_t outside;
    int result = -1;
    hold(&outside);
    if (find_settings(own, path, sizeof path) != 0) {
        (void)snprintf(self->why, sizeof self->why,
                       "the settings file's path is not known or longer than 1023 "
                       "characters; name one in AEOLID_DISCON");
    } else {
        result = settings_read(&self->settings, path, self->why);
    }
    give_back(&outside);
    return result;
}

static void add_note(turbine_t *self, const char *text)
{
    const size_t length = strlen(self->note);
    (void)snprintf(self->note + length, sizeof self->note - length, "%s%s", length > 0u ? "; " : "", text);
}

static void start_observer(turbine_t *self, const float *swap)
{
    char why[SETTINGS_WHY_MAX];
    const char *impossible;
    surroundings_t outside;
    hold(&outside);
    self->note[0] = '\0';
    self->told = 0;
    demands_init(&self->demands, &self->settings);
    impossible = demands_impossible(&self->demands, swap);
    if (impossible != NULL) {
        add_note(self, impossible);
    }
    if (observer_start(&self->observer, &self->settings, self->number, (double)records_get(swap, RECORD_STEP), why,
                       sizeof why) != 0) {
        add_note(self, why);
        add_note(self, "nothing is filtered or streamed");
    }
    give_back(&outside);
}

void turbine_begin(turbine_t *self, const float *swap, discon_procedure_t own)
{
    const int error = errno;
    self->begun = 1;
    /* the loader runs with the simulator's own environment: a library may set flush-to-zero for it as it is loaded */
    if (read_settings(self, own) == 0 &&
        controller_load(&self->controller, self->settings.controller, self->settings.symbol, own, self->why,
                        sizeof self->why) == 0) {
        start_observer(self, swap);
    }
    errno = error;
}

void turbine_restart(turbine_t *self, const float *swap)
{
    surroundings_t outside;
    hold(&outside);
    observer_finish(&self->observer);
    give_back(&outside);
    start_observer(self, swap);
}

/* ---- a call, the end --------------------------------------------------------------------------------------------- */

void turbine_before(turbine_t *self, float *swap, int observed)
{
    surroundings_t outside;
    hold(&outside);
    demands_restore(&self->demands, swap);
    if (observed && observer_before(&self->observer, swap) == CLOCK_JUMPED) {
        demands_rewind(&self->demands);
    }
    give_back(&outside);
}

void turbine_after(turbine_t *self, float *swap, int failed)
{
    surroundings_t outside;
    hold(&outside);
    if (!failed) {
        demands_excite(&self->demands, swap, (double)records_get(swap, RECORD_TIME));
        observer_after(&self->observer, swap, &self->demands);
    }
    give_back(&outside);
}

void turbine_end(turbine_t *self, int polite)
{
    surroundings_t outside;
    hold(&outside);
    if (self->controller.handle != NULL) {
        if (polite) {
            observer_finish(&self->observer);
        } else {
            observer_drop(&self->observer);
        }
    }
    give_back(&outside);
    controller_unload(&self->controller);
}
/* SPDX-License-Identifier: MIT */
