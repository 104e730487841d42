/* The clock of samples: every step once, holes seen, jumps survived. */
#include "sample_clock.h"

#include <math.h>

#include "unity.h"

void setUp(void)
{
}

void tearDown(void)
{
}

/* At every step and decimation, on times rounded to float as record 2 has them: sample i at call i * decimation. */
static void test_every_sample_once_on_float_times(void)
{
    static const double steps[] = {0.01, 0.0125, 0.005, 0.1, 1.0 / 3.0};
    for (unsigned s = 0; s < 5u; s++) {
        for (unsigned decimation = 1; decimation <= 40u; decimation += 13u) {
            sample_clock_t clock;
            uint32_t samples = 0;
            TEST_ASSERT_EQUAL_INT(0, sample_clock_init(&clock, (double)(float)steps[s], decimation));
            for (uint32_t k = 0; k < 2000000u; k++) {
                const clock_tick_t tick = sample_clock_take(&clock, (double)(float)(k * steps[s]));
                TEST_ASSERT_EQUAL_INT(k % decimation == 0u ? CLOCK_SAMPLE : CLOCK_STEP, tick);
                samples += tick == CLOCK_SAMPLE;
                TEST_ASSERT_EQUAL_UINT32(samples - 1u, clock.index);
            }
        }
    }
}

static void test_times_that_stand_still_or_are_repaired_give_no_second_sample(void)
{
    sample_clock_t clock;
    uint32_t samples = 0;
    TEST_ASSERT_EQUAL_INT(0, sample_clock_init(&clock, 0.01, 5));
    for (int k = 0; k < 1000; k++) {
        for (int again = 0; again < 3; again++) { /* k, one back, k again */
            const clock_tick_t tick = sample_clock_take(&clock, 7.0 + 0.01 * (k - (again == 1)));
            TEST_ASSERT_EQUAL_INT(again > 0 ? CLOCK_REPEATED : k % 5 == 0 ? CLOCK_SAMPLE : CLOCK_STEP, tick);
            samples += tick == CLOCK_SAMPLE;
        }
    }
    TEST_ASSERT_EQUAL_UINT32(200, samples);
    TEST_ASSERT_EQUAL_UINT64(999, clock.elapsed);
}

static void test_missing_steps_leave_a_hole(void)
{
    sample_clock_t clock;
    TEST_ASSERT_EQUAL_INT(0, sample_clock_init(&clock, 0.1, 1));
    TEST_ASSERT_EQUAL_INT(CLOCK_SAMPLE, sample_clock_take(&clock, 0.0));
    TEST_ASSERT_EQUAL_INT(CLOCK_SAMPLE, sample_clock_take(&clock, 0.4));
    TEST_ASSERT_EQUAL_UINT32(4, clock.index);
}

static void test_jumps_start_a_new_window(void)
{
    static const double to[] = {0.0, 1e9, -1e9, 5.0};
    sample_clock_t clock;
    TEST_ASSERT_EQUAL_INT(0, sample_clock_init(&clock, 0.1, 2));
    TEST_ASSERT_EQUAL_INT(CLOCK_SAMPLE, sample_clock_take(&clock, 100.0));
    TEST_ASSERT_EQUAL_INT(CLOCK_STEP, sample_clock_take(&clock, 100.1));
    TEST_ASSERT_EQUAL_INT(CLOCK_SAMPLE, sample_clock_take(&clock, 100.2));
    for (unsigned i = 0; i < 4u; i++) {
        const uint32_t before = clock.index;
        TEST_ASSERT_EQUAL_INT(CLOCK_JUMPED, sample_clock_take(&clock, to[i]));
        TEST_ASSERT_EQUAL_UINT32(before + 2u, clock.index); /* one index is missing */
        TEST_ASSERT_EQUAL_INT(CLOCK_REPEATED, sample_clock_take(&clock, to[i]));
    }
    TEST_ASSERT_EQUAL_INT(CLOCK_STEP, sample_clock_take(&clock, 5.1));
    TEST_ASSERT_EQUAL_INT(CLOCK_SAMPLE, sample_clock_take(&clock, 5.2));
    TEST_ASSERT_EQUAL_UINT32(10, clock.index);
}

static void test_no_number_is_no_time(void)
{
    sample_clock_t clock;
    TEST_ASSERT_EQUAL_INT(0, sample_clock_init(&clock, 0.1, 1));
    TEST_ASSERT_EQUAL_INT(CLOCK_REPEATED, sample_clock_take(&clock, (double)NAN));
    TEST_ASSERT_EQUAL_INT(CLOCK_REPEATED, sample_clock_take(&clock, (double)INFINITY));
    TEST_ASSERT_EQUAL_INT(CLOCK_SAMPLE, sample_clock_take(&clock, 3.0));
    TEST_ASSERT_EQUAL_INT(CLOCK_REPEATED, sample_clock_take(&clock, (double)-INFINITY));
    TEST_ASSERT_EQUAL_INT(CLOCK_SAMPLE, sample_clock_take(&clock, 3.1));
}

static void test_steps_that_are_none_are_refused(void)
{
    static const double bad[] = {0.0, -0.1, 1e-7, 1e4, (double)NAN, (double)INFINITY};
    sample_clock_t clock;
    for (unsigned i = 0; i < 6u; i++) {
        TEST_ASSERT_EQUAL_INT(-1, sample_clock_init(&clock, bad[i], 1));
    }
    TEST_ASSERT_EQUAL_INT(-1, sample_clock_init(&clock, 0.1, 0));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_sample_once_on_float_times);
    RUN_TEST(test_times_that_stand_still_or_are_repaired_give_no_second_sample);
    RUN_TEST(test_missing_steps_leave_a_hole);
    RUN_TEST(test_jumps_start_a_new_window);
    RUN_TEST(test_no_number_is_no_time);
    RUN_TEST(test_steps_that_are_none_are_refused);
    return UNITY_END();
}
/* SPDX-License-Identifier: MIT */
