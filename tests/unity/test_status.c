/* Every code has its own sentence; unknown ones are said to be unknown. */
#include "aeolid/status.h"
#include "unity.h"

#include <string.h>

void setUp(void)
{
}

void tearDown(void)
{
}

static void numbers_are_fixed(void)
{
    TEST_ASSERT_EQUAL_INT(0, AEO_OK);
    TEST_ASSERT_EQUAL_INT(1, AEO_FILLING);
    TEST_ASSERT_EQUAL_INT(-1, AEO_E_ARG);
    TEST_ASSERT_EQUAL_INT(-2, AEO_E_MEMORY);
    TEST_ASSERT_EQUAL_INT(-3, AEO_E_NOT_FINITE);
    TEST_ASSERT_EQUAL_INT(-4, AEO_E_RANGE);
    TEST_ASSERT_EQUAL_INT(-5, AEO_E_TIME);
    TEST_ASSERT_EQUAL_INT(-6, AEO_E_GAP);
    TEST_ASSERT_EQUAL_INT(-7, AEO_E_VERSION);
    TEST_ASSERT_EQUAL_INT(-8, AEO_E_MISMATCH);
    TEST_ASSERT_EQUAL_INT(-9, AEO_E_DAMAGED);
}

static void every_code_has_its_own_sentence(void)
{
    for (int i = -9; i <= 1; i++) {
        TEST_ASSERT_TRUE(strlen(aeo_status_text((aeo_status_t)i)) > 3);
        for (int j = -9; j < i; j++) {
            TEST_ASSERT_TRUE(strcmp(aeo_status_text((aeo_status_t)i), aeo_status_text((aeo_status_t)j)) != 0);
        }
    }
}

static void others_are_unknown(void)
{
    TEST_ASSERT_EQUAL_STRING("unknown status", aeo_status_text((aeo_status_t)2));
    TEST_ASSERT_EQUAL_STRING("unknown status", aeo_status_text((aeo_status_t)-10));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(numbers_are_fixed);
    RUN_TEST(every_code_has_its_own_sentence);
    RUN_TEST(others_are_unknown);
    return UNITY_END();
}
