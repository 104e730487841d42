/* The units law: in the channels' units, Xi times the unscaled deviations is what theta makes of the scaled ones. */
#include "aeolid/markov.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { R = 2, L = 2, P = 3, WORDS = AEO_REGRESSOR_WORDS(R, L, P, 1), N_MAX = P * (R + 2 * L) + R };

static aeo_regressor_t layout;
static aeo_real_t memory[WORDS];
static aeo_real_t theta[L * N_MAX], markov[L * N_MAX + 1];
static uint64_t seed = 3;
static const aeo_real_t OFFSET[R + L] = {10, -3, AEO_REAL(0.5), 7000};
static const aeo_real_t SCALE[R + L] = {AEO_REAL(0.3), 25000, AEO_REAL(1e-3), 90};

void setUp(void)
{
}

void tearDown(void)
{
}

static void start(aeo_model_set_t set, uint32_t mask)
{
    const aeo_regressor_config_t config = {.inputs = R,
                                           .outputs = L,
                                           .past = P,
                                           .model_set = set,
                                           .feedthrough = mask,
                                           .period_us = 1000,
                                           .offset = OFFSET,
                                           .scale = SCALE};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&layout, &config, memory, WORDS));
    fill(theta, L * N_MAX, &seed);
}

static void units_law_holds(void)
{
    for (uint32_t mask = 0; mask < 4; mask++) {
        start(AEO_VARX, mask);
        aeo_real_t u[P + 1][R], y[P + 1][L];
        for (uint64_t k = 0; k <= P; k++) {
            for (size_t c = 0; c < R; c++) {
                u[k][c] = (aeo_real_t)((double)OFFSET[c] + 3.0 * (double)SCALE[c] * draw(&seed));
            }
            for (size_t c = 0; c < L; c++) {
                y[k][c] = (aeo_real_t)((double)OFFSET[R + c] + 3.0 * (double)SCALE[R + c] * draw(&seed));
            }
            TEST_ASSERT_EQUAL_INT(k < P ? AEO_FILLING : AEO_OK, aeo_regressor_push(&layout, u[k], y[k], k * 1000));
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_markov_read(&layout, theta, markov, L * N_MAX));
        for (size_t i = 0; i < L; i++) {
            double scaled = 0.0, physical = 0.0;
            size_t j = 0;
            for (; j < layout.length; j++) {
                scaled += (double)theta[i * layout.length + j] * (double)aeo_regressor_z(&layout)[j];
            }
            j = 0;
            for (size_t k = 0; k < P; k++) {
                for (size_t c = 0; c < R + L; c++, j++) {
                    const double x = c < R ? (double)u[k][c] : (double)y[k][c - R];
                    physical += (double)markov[i * layout.length + j] * (x - (double)OFFSET[c]);
                }
            }
            for (size_t c = 0; c < R; c++) {
                if (mask >> c & 1u) {
                    physical += (double)markov[i * layout.length + j++] * ((double)u[P][c] - (double)OFFSET[c]);
                }
            }
            TEST_ASSERT_EQUAL_UINT(layout.length, j);
            /* the sum has up to 14 terms of size 3; 7000 over 90 costs 80 rounding errors in x - offset */
            TEST_ASSERT_TRUE(fabs(physical / (double)SCALE[R + i] - scaled) < 5000.0 * (double)AEO_REAL_EPSILON);
        }
    }
}

static void one_by_one_is_the_same_bits(void)
{
    start(AEO_VARMAX, 3);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_markov_read(&layout, theta, markov, L * N_MAX));
    for (size_t i = 0; i < (size_t)L * layout.length; i++) {
        const aeo_real_t one = aeo_markov_at(&layout, theta, i);
        TEST_ASSERT_EQUAL_MEMORY(&markov[i], &one, sizeof one);
    }
    const aeo_real_t none = AEO_REAL(0), past = aeo_markov_at(&layout, theta, (size_t)L * layout.length);
    TEST_ASSERT_EQUAL_MEMORY(&none, &past, sizeof none);
    aeo_real_t in_place[L * N_MAX];
    memcpy(in_place, theta, sizeof in_place);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_markov_read(&layout, in_place, in_place, L * N_MAX));
    TEST_ASSERT_EQUAL_MEMORY(markov, in_place, sizeof *markov * L * layout.length);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_markov_read_scaled(&layout, theta, markov, L * N_MAX));
    TEST_ASSERT_EQUAL_MEMORY(theta, markov, sizeof *markov * L * layout.length);
}

static void channels_are_named(void)
{
    start(AEO_VARMAX, 2);
    static const int BLOCK[6] = {0, 1, 2, 3, 4, 5};
    for (uint16_t j = 0; j < 18; j++) {
        TEST_ASSERT_EQUAL_INT(BLOCK[j % 6], aeo_markov_channel(&layout, j));
    }
    TEST_ASSERT_EQUAL_UINT(19, layout.length);
    TEST_ASSERT_EQUAL_INT(1, aeo_markov_channel(&layout, 18));
    TEST_ASSERT_EQUAL_INT(-1, aeo_markov_channel(&layout, 19));
    TEST_ASSERT_EQUAL_INT(-1, aeo_markov_channel(NULL, 0));
    /* an innovation has the scale of its output */
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_markov_read(&layout, theta, markov, L * N_MAX));
    TEST_ASSERT_TRUE(fabs((double)markov[4] - (double)theta[4]) <= 2.0 * (double)AEO_REAL_EPSILON);
}

static void short_arrays_are_refused(void)
{
    start(AEO_VARX, 1);
    const size_t count = (size_t)L * layout.length;
    const aeo_real_t mark = AEO_REAL(12345.5);
    for (size_t i = 0; i <= count; i++) {
        markov[i] = mark;
    }
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_markov_read(&layout, theta, markov, count - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_markov_read_scaled(&layout, theta, markov, count - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_markov_read(NULL, theta, markov, count));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_markov_read(&layout, NULL, markov, count));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_markov_read(&layout, theta, NULL, count));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_markov_read_scaled(NULL, theta, markov, count));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_markov_read_scaled(&layout, NULL, markov, count));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_markov_read_scaled(&layout, theta, NULL, count));
    for (size_t i = 0; i <= count; i++) {
        TEST_ASSERT_EQUAL_MEMORY(&mark, &markov[i], sizeof mark);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_markov_read(&layout, theta, markov, count));
    TEST_ASSERT_EQUAL_MEMORY(&mark, &markov[count], sizeof mark);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(units_law_holds);
    RUN_TEST(one_by_one_is_the_same_bits);
    RUN_TEST(channels_are_named);
    RUN_TEST(short_arrays_are_refused);
    return UNITY_END();
}
