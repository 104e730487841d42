/* Time that the wrapper adds to a call: discon_bench [seconds of simulated time]. Figures for docs/decisions, no test.
 *
 * 2 inputs, 3 outputs, p = 20, filtered at 10 Hz of 100 calls a second, 5 % of 500 kbit/s; each bus in turn. Median and
 * 99.9 % point of single calls with the wrapper less the median without. A second argument names what to run alone, for
 * counting instructions: plain, or a bus. */
#include "simulator.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define CALLS_MAX 1000000u

static double took[CALLS_MAX];

static double clock_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Run `calls` calls; their times, sorted, are in took. 1 done. */
static int run(const char *library, unsigned calls)
{
    simulator_t simulator;
    if (!simulator_open(&simulator, library, SIMULATOR_RECORDS, "quiet") || simulator_call(&simulator, 0.0F) != 0) {
        return 0;
    }
    for (unsigned k = 0; k < calls; k++) {
        double from;
        simulator_step(&simulator);
        from = clock_us();
        (void)simulator_call(&simulator, 1.0F);
        took[k] = clock_us() - from;
    }
    (void)simulator_call(&simulator, -1.0F);
    simulator_close(&simulator);
    qsort(took, calls, sizeof *took, compare);
    return 1;
}

int main(int argc, char **argv)
{
    static const char *const buses[] = {"none", "file:bench.log", "tcp:0", "pty"};
    const unsigned calls = argc > 1 ? (unsigned)(100.0 * strtod(argv[1], NULL)) : 60000u;
    const char *alone = argc > 2 ? argv[2] : NULL;
    char more[512];
    double plain;
    if (calls < 1000u || calls > CALLS_MAX ||
        ((alone == NULL || strcmp(alone, "plain") == 0) && !run(CONTROLLER, calls))) {
        return 2;
    }
    plain = took[calls / 2u];
    (void)printf("without: median %.2f us, 99.9 %% %.2f us\n", plain, took[calls - calls / 1000u]);
    for (unsigned i = 0; i < 4u; i++) {
        if (alone != NULL && strcmp(alone, buses[i]) != 0) {
            continue;
        }
        (void)snprintf(more, sizeof more,
                       "bus = %s\npast = 20\ninput = torque_command offset 4e4 scale 2e3\n"
                       "output = tower_side_side scale 0.1\n",
                       buses[i]);
        if (!configure(CONTROLLER, more) || !run(WRAPPER, calls)) {
            return 2;
        }
        (void)printf(
            "%-15s adds: median %6.2f us, 90 %% %6.2f us, 99 %% %6.2f us, 99.9 %% %6.2f us, largest %6.1f us\n",
            buses[i], took[calls / 2u] - plain, took[calls - calls / 10u] - plain, took[calls - calls / 100u] - plain,
            took[calls - calls / 1000u] - plain, took[calls - 1u] - plain);
    }
    return 0;
}
/* SPDX-License-Identifier: MIT */
