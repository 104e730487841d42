/* lattice_bench.h: a lattice and the samples of a random linear system, for the tests of lattice.h. */
#ifndef LATTICE_BENCH_H
#define LATTICE_BENCH_H

#include "aeolid/lattice.h"

enum {
    P = 4,
    M = 3,
    D = 1,
    L = 2,
    N = P * M + D,
    WORDS = AEO_LATTICE_WORDS(P, M, D, L),
    SAVED = AEO_LATTICE_SAVED_WORDS(P, M, D, L)
};

/* The filter under test, and a second one for copies. */
extern aeo_lattice_t lattice, twin;
extern aeo_real_t lattice_memory[WORDS], twin_memory[WORDS];

/* The last sample, and the system that made it: y = model z + noise. */
extern aeo_real_t lattice_z[N], lattice_y[L], lattice_model[L * N];
extern uint64_t lattice_seed;

/* Put the seed back: before every test. */
void reset_lattice_bench(void);

/* Return settings with rho = 1. */
aeo_lattice_config_t make_lattice_config(double lambda, double gate, double growth);

/* Start filter, window and a new system. */
void start_lattice(double lambda, double gate, double growth);

/* Make the next sample: the window slides, then y = model z + noise. The block of this sample follows the next time. */
void draw_lattice_sample(double amplitude, double noise);

/* Make a sample and let the filter take it; invariants must hold. */
void feed_lattice(double amplitude, double noise);

/* Return |theta - model| / |model|. */
double distance_from_lattice_model(void);

#endif
