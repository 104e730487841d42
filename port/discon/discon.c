#include "discon.h"

#include "turbine.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TURBINES_MAX   64u
#define MESSAGE_MAX    65536.0F /* a longer record 49 is no length */
#define EXPORTED       __attribute__((visibility("default")))
#define STATUS_RESTART (-9.0F)

/* One place of the table; guarded. */
typedef struct {
    const float *array; /* the key: address of the last call */
    turbine_t *turbine; /* null: free */
    int inside;         /* 1: a call is under way */
    int moving;         /* 1: its array has changed its address */
} place_t;

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static place_t places[TURBINES_MAX];

/* ---- words ------------------------------------------------------------------------------------------------------- */

/* Characters the simulator offers, final zero included; 0 where record 49 is no length. */
static size_t find_room(const float *swap)
{
    const float room = records_get(swap, RECORD_MESSAGE_LENGTH);
    return room >= 1.0F && room <= MESSAGE_MAX ? (size_t)room : 0u;
}

static void write_message(char *message, size_t room, const char *text)
{
    const size_t length = strlen(text);
    const size_t most = length < room - 1u ? length : room - 1u;
    memcpy(message, text, most);
    message[most] = '\0';
}

/* Stop the simulator: there is no controller to call. */
static void refuse(const float *swap, int *fail, char *message, const char *why)
{
    const size_t room = find_room(swap);
    char text[TURBINE_WHY_MAX + 16u];
    (void)snprintf(text, sizeof text, "aeolid-discon: %s", why);
    if (fail != NULL) {
        *fail = -1;
    }
    if (message != NULL && room > 0u) {
        write_message(message, room, text);
    } else {
        (void)fprintf(stderr, "%s\n", text);
    }
}

/* ---- turbines ---------------------------------------------------------------------------------------------------- */

static place_t *find_array(const float *swap)
{
    for (unsigned i = 0; i < TURBINES_MAX; i++) {
        if (places[i].turbine != NULL && places[i].array == swap) {
            return &places[i];
        }
    }
    return NULL;
}

/* Return the only turbine there is, null when there are more or none. */
static place_t *find_only(void)
{
    place_t *only = NULL;
    for (unsigned i = 0; i < TURBINES_MAX; i++) {
        if (places[i].turbine != NULL) {
            if (only != NULL) {
                return NULL;
            }
            only = &places[i];
        }
    }
    return only;
}

static place_t *make_place(const float *swap, const char **why)
{
    *why = "more than 64 turbines in one process; use further copies of the wrapper";
    for (unsigned i = 0; i < TURBINES_MAX; i++) {
        if (places[i].turbine == NULL) {
            places[i].turbine = calloc(1, sizeof *places[i].turbine);
            if (places[i].turbine == NULL) {
                *why = "out of memory";
                return NULL;
            }
            places[i].turbine->number = i + 1u;
            places[i].array = swap;
            places[i].moving = 0;
            return &places[i];
        }
    }
    return NULL;
}

static unsigned count_turbines(void)
{
    unsigned count = 0;
    for (unsigned i = 0; i < TURBINES_MAX; i++) {
        count += places[i].turbine != NULL;
    }
    return count;
}

/* Find the turbine a call belongs to (discon.h), or make it; null: `why` says why there is none. */
static place_t *find_place(const float *swap, const char **why)
{
    const float status = records_get(swap, RECORD_STATUS);
    const int first = status >= -0.5F && status < 0.5F;
    const int begins = first || (status >= STATUS_RESTART - 0.5F && status < STATUS_RESTART + 0.5F);
    place_t *place = find_array(swap), *only = find_only();
    if (place == NULL && only != NULL && !only->inside && (!begins || (first && only->moving))) {
        place = only;
        place->array = swap;
        place->moving = 1;
    }
    if (place == NULL) {
        if (!begins && count_turbines() > 0u) {
            *why = "a call from an array not seen before, while several turbines run: the simulator moves its arrays; "
                   "give each turbine a copy of the wrapper library of its own";
            return NULL;
        }
        place = make_place(swap, why);
    }
    if (place != NULL) {
        place->inside = 1;
    }
    return place;
}

static place_t *enter(const float *swap, const char **why)
{
    place_t *place;
    (void)pthread_mutex_lock(&guard);
    place = find_place(swap, why);
    (void)pthread_mutex_unlock(&guard);
    return place;
}

static void leave(place_t *place, int ended)
{
    turbine_t *turbine = NULL;
    (void)pthread_mutex_lock(&guard);
    place->inside = 0;
    if (ended) {
        turbine = place->turbine;
        place->turbine = NULL;
        place->array = NULL;
    }
    (void)pthread_mutex_unlock(&guard);
    free(turbine);
}

/* ---- the call ---------------------------------------------------------------------------------------------------- */

/* Tell once what is not as asked for; in the message only where the controller left it as it was. */
static void tell(turbine_t *turbine, const float *swap, const int *fail, char *message, int first, char before)
{
    const size_t room = find_room(swap);
    char text[TURBINE_WHY_MAX + 64u];
    if (turbine->told || turbine->note[0] == '\0') {
        return;
    }
    turbine->told = 1;
    (void)snprintf(text, sizeof text, "aeolid-discon: turbine %u: %s; the controller goes on", turbine->number,
                   turbine->note);
    (void)fprintf(stderr, "%s\n", text);
    if (first && message != NULL && fail != NULL && *fail == 0 && room > 0u && before == '\0' && message[0] == '\0') {
        write_message(message, room, text);
    }
}

/* Forward one call. */
static void forward(turbine_t *turbine, float *swap, int *fail, const char *infile, char *outname, char *message)
{
    const float status = records_get(swap, RECORD_STATUS);
    const int first = status >= -0.5F && status < 0.5F;
    const int observed = first || (status >= 0.5F && records_finite(status));
    const char before = message != NULL && find_room(swap) > 0u ? message[0] : '\1';
    turbine_before(turbine, swap, observed);
    turbine->controller.call(swap, fail, infile, outname, message);
    if (observed) {
        turbine_after(turbine, swap, fail != NULL && *fail < 0);
    }
    tell(turbine, swap, fail, message, first, before);
}

EXPORTED void DISCON(float *avrSWAP, int *aviFAIL, const char *accINFILE, char *avcOUTNAME, char *avcMSG)
{
    const char *why = "";
    place_t *place;
    turbine_t *turbine;
    float status;
    int first;
    if (avrSWAP == NULL) {
        if (aviFAIL != NULL) {
            *aviFAIL = -1;
        }
        return;
    }
    status = records_get(avrSWAP, RECORD_STATUS); /* the controller may write there */
    first = status >= -0.5F && status < 0.5F;
    place = enter(avrSWAP, &why);
    if (place == NULL) {
        refuse(avrSWAP, aviFAIL, avcMSG, why);
        return;
    }
    turbine = place->turbine;
    if (!turbine->begun || (first && turbine->controller.call == NULL)) {
        turbine_begin(turbine, avrSWAP, DISCON);
    } else if (first) {
        turbine_restart(turbine, avrSWAP);
    }
    if (turbine->controller.call != NULL) {
        forward(turbine, avrSWAP, aviFAIL, accINFILE, avcOUTNAME, avcMSG);
    } else {
        refuse(avrSWAP, aviFAIL, avcMSG, turbine->why);
    }
    if (status >= -1.5F && status < -0.5F) {
        turbine_end(turbine, 1);
        leave(place, 1);
    } else {
        leave(place, 0);
    }
}

/* A simulator that unloads this library without a last call: leave nothing open behind. */
__attribute__((destructor)) static void unload(void)
{
    for (unsigned i = 0; i < TURBINES_MAX; i++) {
        if (places[i].turbine != NULL) {
            turbine_end(places[i].turbine, 0);
            free(places[i].turbine);
            places[i].turbine = NULL;
        }
    }
}
/* SPDX-License-Identifier: MIT */
