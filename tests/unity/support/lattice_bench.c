/* lattice_bench.c: the filter and the system of lattice_bench.h. */
#include "lattice_bench.h"

#include "samples.h"
#include "unity.h"

#include <string.h>

aeo_lattice_t lattice, twin;
aeo_real_t lattice_memory[WORDS], twin_memory[WORDS];
aeo_real_t lattice_z[N], lattice_y[L], lattice_model[L * N];
uint64_t lattice_seed;
static aeo_real_t block[M]; /* of this sample, which enters the window at the next */

void reset_lattice_bench(void)
{
    lattice_seed = 3;
}

aeo_lattice_config_t make_lattice_config(double lambda, double gate, double growth)
{
    const aeo_lattice_config_t config = {
        P, M, D, L, (aeo_real_t)lambda, AEO_REAL(1), (aeo_real_t)gate, (aeo_real_t)growth};
    return config;
}

void start_lattice(double lambda, double gate, double growth)
{
    const aeo_lattice_config_t config = make_lattice_config(lambda, gate, growth);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&lattice, &config, lattice_memory, WORDS));
    memset(lattice_z, 0, sizeof lattice_z);
    memset(block, 0, sizeof block);
    fill(lattice_model, L * N, &lattice_seed);
}

void draw_lattice_sample(double amplitude, double noise)
{
    memmove(lattice_z, lattice_z + M, (P - 1) * M * sizeof *lattice_z);
    memcpy(lattice_z + (P - 1) * M, block, sizeof block);
    for (size_t i = 0; i < M; i++) {
        block[i] = (aeo_real_t)(amplitude * draw(&lattice_seed));
    }
    memcpy(lattice_z + P * M, block, D * sizeof *block);
    for (size_t i = 0; i < L; i++) {
        double sum = noise * draw(&lattice_seed);
        for (size_t j = 0; j < N; j++) {
            sum += (double)lattice_model[i * N + j] * (double)lattice_z[j];
        }
        lattice_y[i] = (aeo_real_t)sum;
    }
}

void feed_lattice(double amplitude, double noise)
{
    draw_lattice_sample(amplitude, noise);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, lattice_z, lattice_y));
    TEST_ASSERT_TRUE(aeo_lattice_invariants_hold(&lattice));
}

double distance_from_lattice_model(void)
{
    aeo_real_t theta[L * N];
    double expected[L * N];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, theta, L * N));
    for (size_t i = 0; i < L * N; i++) {
        expected[i] = (double)lattice_model[i];
    }
    return relative_distance(theta, expected, L * N);
}
