/* What the data do not tell of theta stays where it is: channels that are still, collinear or seldom move, for 1,000 memories
 * of every filter. */
#include "aeolid/estimator.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { R = 2, L = 2, P = 2, METHODS = 4, WORDS = 1500, THETA_MAX = 40, PERIOD = 100000, MEMORY = 50 };

typedef enum { STILL, COLLINEAR, SELDOM } habit_t;

static const aeo_estimator_method_t method[METHODS] = {aeo_estimator_rls, aeo_estimator_els, aeo_estimator_fast_rls,
                                                       aeo_estimator_lattice};
static const double RHO = 0.1, GROWTH = 10.0, NOISE = 0.1;
static aeo_estimator_t filter;
static aeo_real_t memory[WORDS];
static uint64_t seed;

/* What a life showed: the largest |theta| at any time behind the first 20 memories, and the mean square innovation of
 * the first samples at which the second input had moved. */
typedef struct {
    double largest, surprise;
} life_t;

void setUp(void)
{
    seed = 20261130u;
}

void tearDown(void)
{
}

static void start(unsigned which)
{
    static aeo_channel_t channel[R + L];
    for (size_t i = 0; i < R + L; i++) {
        channel[i].scale = AEO_REAL(1);
    }
    const aeo_estimator_config_t config = {.inputs = R,
                                           .outputs = L,
                                           .past = P,
                                           .model_set = which == 1u ? AEO_VARMAX : AEO_VARX,
                                           .period_us = PERIOD,
                                           .channels = channel,
                                           .forgetting = AEO_REAL(1) - AEO_REAL(1) / MEMORY,
                                           .regularisation = (aeo_real_t)RHO,
                                           .excitation_min = AEO_REAL(0.05),
                                           .growth_max = (aeo_real_t)GROWTH,
                                           .varx_samples = 100,
                                           .forgetting_start = AEO_REAL(1) - AEO_REAL(1) / MEMORY,
                                           .forgetting_rate = AEO_REAL(0.99),
                                           .guard_ratio = AEO_REAL(4)};
    TEST_ASSERT_TRUE(aeo_estimator_words(method[which], &config) <= WORDS);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&filter, method[which], &config, memory, WORDS));
}

static double find_largest(void)
{
    const aeo_real_t *const theta = aeo_estimator_theta(&filter);
    const size_t count = aeo_estimator_regressors(&filter.config) * L;
    double largest = 0.0;
    for (size_t i = 0; i < count; i++) {
        largest = fmax(largest, fabs((double)theta[i]));
    }
    return largest;
}

static double find_power(void)
{
    double power = 0.0;
    for (size_t i = 0; i < L; i++) {
        power += pow((double)aeo_estimator_innovation(&filter)[i], 2);
    }
    return power;
}

/* Live 1,000 memories. The second input does nothing to the plant: it is 0, half of the first, or 0 but for five samples
 * in twenty memories. */
static life_t live(unsigned which, habit_t habit)
{
    life_t life = {0.0, 0.0};
    double y0 = 0.0, y1 = 0.0;
    unsigned surprises = 0;
    setUp();
    start(which);
    for (unsigned k = 0; k < 1000u * MEMORY; k++) {
        const unsigned since = k % (20u * MEMORY);
        const double free_input = draw(&seed), first = draw(&seed);
        const double second = habit == COLLINEAR ? 0.5 * first : habit == SELDOM && since < 5u ? free_input : 0.0;
        const aeo_real_t u[R] = {(aeo_real_t)first, (aeo_real_t)second}, y[L] = {(aeo_real_t)y0, (aeo_real_t)y1};
        if (aeo_estimator_take(&filter, u, y, (uint64_t)k * PERIOD) == AEO_OK && k > 20u * MEMORY) {
            if (k % 25u == 0u) {
                life.largest = fmax(life.largest, find_largest());
            }
            if (since >= 1u && since < 5u) {
                life.surprise += find_power();
                surprises++;
            }
        }
        y0 = 0.8 * y0 + 0.3 * first + NOISE * draw(&seed);
        y1 = 0.5 * y1 + 0.2 * first + NOISE * draw(&seed);
    }
    TEST_ASSERT_TRUE(surprises > 100u);
    life.surprise /= surprises;
    TEST_ASSERT_EQUAL_UINT32(0, aeo_estimator_count(&filter, AEO_COUNT_REINITIALISED));
    TEST_ASSERT_TRUE(aeo_estimator_invariants_hold(&filter));
    return life;
}

/* Noise of deviation s leaves a parameter of variance v uncertain by s v^(1/2), v = growth_max / rho where the bound holds
 * it; the plant's own parameters are at most 0.8. */
static void theta_stays_within_its_spread(void)
{
    const double spread = NOISE / sqrt(3.0) * sqrt(GROWTH / RHO);
    for (unsigned which = 0; which < METHODS; which++) {
        TEST_ASSERT_TRUE(live(which, STILL).largest < 0.8 + 3.0 * spread);
        TEST_ASSERT_TRUE(live(which, COLLINEAR).largest < 0.8 + 3.0 * spread);
        TEST_ASSERT_TRUE(live(which, SELDOM).largest < 0.8 + 3.0 * spread);
    }
}

/* An input that moves after twenty memories of standstill surprises no filter more than twice as much as rls. */
static void what_moves_at_last_surprises_as_little_as_rls(void)
{
    const double most = 4.0 * live(0, SELDOM).surprise;
    for (unsigned which = 1; which < METHODS; which++) {
        TEST_ASSERT_TRUE(live(which, SELDOM).surprise < most);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(theta_stays_within_its_spread);
    RUN_TEST(what_moves_at_last_surprises_as_little_as_rls);
    return UNITY_END();
}
