/* els_bench.h: a simulated plant on an extended least-squares filter, for the tests of els.h. */
#ifndef ELS_BENCH_H
#define ELS_BENCH_H

#include "aeolid/els.h"

enum { P_MAX = 5, L = 1, M = 3, N_MAX = P_MAX * M, WORDS = AEO_ELS_WORDS(N_MAX, 3), WINDOW = 200 };
enum { SAVED = AEO_ELS_SAVED_WORDS(N_MAX, 3) };

/* y_k = sum_i ar_i y_{k-i} + x_i u_{k-i} + ma_i e_{k-i} + e_k, scaled to about unit variance of y. */
typedef struct {
    double ar[P_MAX], x[P_MAX], ma[P_MAX], y[P_MAX], u[P_MAX], e[P_MAX], scale, noise;
} els_plant_t;

extern aeo_els_t els;
extern aeo_regressor_t regressor;
extern aeo_real_t memory[WORDS], window[WINDOW], saved[SAVED];
extern uint64_t seed, time_us;
extern els_plant_t plant;

/* Put seed and time back: before every test. */
void reset_bench(void);

/* Return the settings to start with, for one input and one output and p blocks. */
aeo_els_config_t make_els_config(unsigned p);

/* Start the regressor alone, or filter and regressor. */
void start_regressor(unsigned p);
void start(const aeo_els_config_t *config);

/* Give the plant (1 + root z^-1)^order as noise and one real pole at 1/2. */
void set_plant(double root, unsigned order, double scale);

/* Push what the plant does next; returns the status of the step. */
aeo_status_t step(void);

/* Step samples times; every step must be taken. */
void run(unsigned samples);

/* Run and return the mean power of the innovations over the noise's own, and in *worst that of the worst 64 running. */
double measure(unsigned samples, double *worst);

#endif
