/* simulator.h: a simulator to the Bladed calling convention, small and deterministic, for the tests of the wrapper. */
#ifndef AEOLID_TESTS_SIMULATOR_H
#define AEOLID_TESTS_SIMULATOR_H

#include <stddef.h>
#include <stdint.h>

enum { SIMULATOR_RECORDS = 168, SIMULATOR_MESSAGE = 301, SIMULATOR_OUT = 201, SIMULATOR_IN = 101 };

typedef void (*procedure_t)(float *, int *, const char *, char *, char *);

typedef struct {
    void *handle;
    procedure_t call;
    float *swap; /* ends where a page ends that must not be touched */
    unsigned records;
    void *pages;
    size_t length;
    char message[SIMULATOR_MESSAGE], out[SIMULATOR_OUT], in[SIMULATOR_IN];
    int fail;
    double time_s, step_s;
    double speed, tower[2]; /* the turbine */
    uint32_t noise;
} simulator_t;

/* Load a library and make a turbine with an array of `records`; 1 done. infile is what the controller is told. */
int simulator_open(simulator_t *self, const char *library, unsigned records, const char *infile);

/* Call once with this status at the present time: fills the measurements in before. Returns aviFAIL. */
int simulator_call(simulator_t *self, float status);

/* Call with status 0, then 1 at every step until time_s, then, last 1, with -1. Returns the last aviFAIL. */
int simulator_run(simulator_t *self, double until_s, int last);

/* Let the turbine answer to the demands in the array for one step. */
void simulator_step(simulator_t *self);

/* Unload and release. */
void simulator_close(simulator_t *self);

/* Write settings that name `controller`, with three channels and further lines, and name them in AEOLID_DISCON; `past`
 * is 8 unless the lines say otherwise. 1 done. */
int configure(const char *controller, const char *more);

/* The same as `path`, without naming it. */
int write_settings(const char *path, const char *controller, const char *more);

/* Check that two turbines have the same records, texts and answer, bit for bit; 1 they do. */
int same_answers(const simulator_t *a, const simulator_t *b);

/* Write a text to a file; copy a file. 1 done. */
int write_text(const char *path, const char *text);
int copy_file(const char *from, const char *to);

/* Return the path of a scratch folder, made once a process and removed at its end. */
const char *scratch(void);

/* Return scratch() and a name in one of eight buffers in turn. */
const char *in_scratch(const char *name);

#endif
/* SPDX-License-Identifier: MIT */
