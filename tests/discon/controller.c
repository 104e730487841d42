/* A small controller to the Bladed calling convention: it regulates, remembers, and tells of everything it saw.
 *
 * Commands: pitch by an integrator on the generator speed that goes on from its own last demand in the array, torque in
 * proportion to speed. It folds every record (up to number TOLD + 7), both texts and their lengths into a sum, which it
 * writes into records TOLD ... as eight numbers of 8 bits, and counts its calls in a static variable.
 * accINFILE tells it what to do besides: "fail N" fails at call N with a message, "warn N" answers with 1 and a
 * message, "nan" writes odd bit patterns, "status" changes record 1, "quiet" writes no message, "trap" fails
 * with -3 unless it is called with upward rounding and the one flag of a division by zero raised. */
#include "controller_records.h"

#include <fenv.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef CONTROLLER_SYMBOL
#define CONTROLLER_SYMBOL DISCON
#endif

static unsigned calls;
static uint64_t sum = UINT64_C(1469598103934665603);

static void fold(const void *data, size_t length)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < length; i++) {
        sum = (sum ^ bytes[i]) * UINT64_C(1099511628211);
    }
}

static unsigned number_after(const char *text, const char *word)
{
    const char *at = strstr(text, word);
    return at == NULL ? 0u : (unsigned)strtoul(at + strlen(word), NULL, 10);
}

static void control(float *swap)
{
    const float error = swap[20 - 1] - 122.0F;
    const float last = swap[28 - 1] > 0.5F ? swap[42 - 1] : swap[45 - 1];
    float pitch = last + 2e-4F * error;
    pitch = pitch < 0.0F ? 0.0F : pitch > 1.5F ? 1.5F : pitch;
    swap[42 - 1] = swap[43 - 1] = swap[44 - 1] = swap[45 - 1] = pitch;
    swap[47 - 1] = 340.0F * swap[20 - 1];
    swap[48 - 1] = 1e-3F * swap[24 - 1];
}

void CONTROLLER_SYMBOL(float *swap, int *fail, const char *infile, char *outname, char *message);
void CONTROLLER_SYMBOL(float *swap, int *fail, const char *infile, char *outname, char *message)
{
    const size_t room = (size_t)swap[49 - 1];
    const int odd_surroundings = fegetround() != FE_UPWARD || fetestexcept(FE_ALL_EXCEPT) != FE_DIVBYZERO;
    calls++;
    fold(swap, (TOLD + 7u) * sizeof *swap);
    fold(infile, strlen(infile) + 1u);
    fold(outname, strlen(outname) + 1u);
    fold(message, room);
    fold(fail, sizeof *fail);
    control(swap);
    for (unsigned i = 0; i < 8u; i++) {
        swap[TOLD - 1u + i] = (float)((sum >> (8u * i)) & 255u);
    }
    swap[CALLS - 1] = (float)calls;
    if (strstr(infile, "nan") != NULL) {
        const uint32_t odd[3] = {UINT32_C(0x7FC12345), UINT32_C(0xFF800001) + calls, UINT32_C(0x80000000)};
        memcpy(swap + ODD - 1, odd, sizeof odd); /* quiet, signalling, negative zero */
    }
    if (strstr(infile, "status") != NULL) {
        swap[0] = 7.0F;
    }
    if (strstr(infile, "trap") != NULL && odd_surroundings) {
        *fail = -3;
    }
    if (strstr(infile, "quiet") == NULL) {
        (void)snprintf(message, room, "call %u", calls);
        (void)snprintf(outname, 64, "Controller:calls %u:-;", calls);
    }
    if (number_after(infile, "fail ") == calls || number_after(infile, "warn ") == calls) {
        *fail = strstr(infile, "fail ") != NULL ? -1 : 1;
        (void)snprintf(message, room, "the controller says so at call %u", calls);
    }
}
/* SPDX-License-Identifier: MIT */
