/* controller.h: loads the user's controller library, each turbine with static variables of its own.
 *
 * MODEL
 *   A library that is in the process already, whoever loaded it, would share its static variables with the turbine that
 *   has it: then a private copy of the file is loaded instead, made beside it (so that $ORIGIN keeps its meaning) or in
 *   TMPDIR or /tmp, and removed again at once. The question and the loading happen under a lock on the file, for copies
 *   of this wrapper know nothing of each other.
 *   Alternative tried: dlmopen. A name space has a C library of its own whose locale is not set up in the simulator's
 *   other threads (isalpha there is a segmentation fault), and after 11 of them the static TLS is used up (glibc 2.36).
 *   What copies still share are the libraries the controller needs itself, as with copies made by hand, and in C++ the
 *   variables of inline functions and templates; there -fno-gnu-unique helps.
 *
 * CONTRACT
 *   Memory: the structure, and what the loader takes. Waits at most 2 s for the file's lock. May be called by several
 *   threads on different structures.
 */
#ifndef AEOLID_DISCON_CONTROLLER_H
#define AEOLID_DISCON_CONTROLLER_H

#include <stddef.h>

/* The calling convention (GH Bladed, legacy interface). */
typedef void (*discon_procedure_t)(float *avrSWAP, int *aviFAIL, const char *accINFILE, char *avcOUTNAME, char *avcMSG);

typedef struct {
    void *handle; /* null: not loaded */
    discon_procedure_t call;
} controller_t;

/* Load `path` and find `symbol`; `own` is this wrapper's procedure, which must not be called in circles. Returns 0,
 * else -1, nothing stays loaded, and `why` (room characters) holds a sentence. */
int controller_load(controller_t *self, const char *path, const char *symbol, discon_procedure_t own, char *why,
                    size_t room);

/* Unload; nothing when not loaded. */
void controller_unload(controller_t *self);

#endif
/* SPDX-License-Identifier: MIT */
