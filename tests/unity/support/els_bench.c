/* els_bench.c: the plant and the filter of els_bench.h. */
#include "els_bench.h"

#include "samples.h"
#include "unity.h"

#include <string.h>

aeo_els_t els;
aeo_regressor_t regressor;
aeo_real_t memory[WORDS], window[WINDOW], saved[SAVED];
uint64_t seed, time_us;
els_plant_t plant;

void reset_bench(void)
{
    seed = 11;
    time_us = 0;
}

aeo_els_config_t make_els_config(unsigned p)
{
    const aeo_els_config_t config = {.regressors = (uint16_t)(p * M),
                                     .outputs = L,
                                     .past = (uint16_t)p,
                                     .varx_samples = 200,
                                     .forgetting = AEO_REAL(1),
                                     .forgetting_start = AEO_REAL(0.99),
                                     .forgetting_rate = AEO_REAL(0.99),
                                     .regularisation = AEO_REAL(0.1),
                                     .excitation_min = AEO_REAL(0.05),
                                     .growth_max = AEO_REAL(10),
                                     .guard_ratio = AEO_REAL(4)};
    return config;
}

void start_regressor(unsigned p)
{
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = L, .past = (uint16_t)p, .model_set = AEO_VARMAX, .period_us = 1000};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, WINDOW));
    time_us = 0;
}

void start(const aeo_els_config_t *config)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, config, memory, WORDS));
    start_regressor(config->past);
}

/* (1 + root z^-1)^order as noise, with one real pole at 1/2 */
void set_plant(double root, unsigned order, double scale)
{
    memset(&plant, 0, sizeof plant);
    double c[P_MAX + 1] = {1.0};
    for (unsigned k = 0; k < order; k++) {
        for (unsigned i = k + 1; i > 0; i--) {
            c[i] += root * c[i - 1];
        }
    }
    memcpy(plant.ma, c + 1, sizeof plant.ma);
    plant.ar[0] = 0.5;
    plant.x[0] = 1.0;
    plant.scale = scale;
    plant.noise = 1.0;
}

/* Push what the plant does next; returns the status of the step. */
aeo_status_t step(void)
{
    const double u = 1.7 * draw(&seed), e = plant.noise * 1.7 * draw(&seed); /* about unit variance */
    double y = e;
    for (unsigned i = 0; i < P_MAX; i++) {
        y += plant.ar[i] * plant.y[i] + plant.x[i] * plant.u[i] + plant.ma[i] * plant.e[i];
    }
    for (unsigned i = P_MAX - 1; i > 0; i--) {
        plant.y[i] = plant.y[i - 1];
        plant.u[i] = plant.u[i - 1];
        plant.e[i] = plant.e[i - 1];
    }
    plant.y[0] = y;
    plant.u[0] = u;
    plant.e[0] = e;
    const aeo_real_t input = (aeo_real_t)u, output = (aeo_real_t)(y * plant.scale);
    time_us += 1000;
    return aeo_els_step(&els, &regressor, &input, &output, time_us);
}

void run(unsigned samples)
{
    for (unsigned k = 0; k < samples; k++) {
        const aeo_status_t status = step();
        TEST_ASSERT_TRUE(status == AEO_OK || status == AEO_FILLING);
    }
    TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
}

/* Run and return the mean power of the innovations over the noise's own, and in *worst that of the worst 64 running. */
double measure(unsigned samples, double *worst)
{
    double sum = 0.0, recent = 0.0, ring[64] = {0.0};
    *worst = 0.0;
    for (unsigned k = 0; k < samples; k++) {
        TEST_ASSERT_TRUE(step() >= AEO_OK);
        const double innovation = (double)aeo_els_innovation(&els)[0] / plant.scale, power = innovation * innovation;
        sum += power;
        recent += power - ring[k % 64];
        ring[k % 64] = power;
        *worst = recent / 64.0 > *worst ? recent / 64.0 : *worst;
    }
    TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
    const double own = 1.7 * 1.7 / 3.0 * plant.noise * plant.noise;
    *worst /= own;
    return sum / samples / own;
}
