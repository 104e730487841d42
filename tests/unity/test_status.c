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
    TEST_ASSERT_EQUAL_INT(-32, AEO_E_BUSY);
    TEST_ASSERT_EQUAL_INT(-33, AEO_E_BUDGET);
    TEST_ASSERT_EQUAL_INT(-34, AEO_E_REFUSED);
}

static int is_code(int number)
{
    return (number >= -9 && number <= 1) || (number >= -34 && number <= -32);
}

/* All numbers that the library may ever use, the streamer's and the ports' among them. */
static void every_code_has_its_own_sentence_and_no_other_number(void)
{
    for (int i = -64; i <= 16; i++) {
        const char *text = aeo_status_text((aeo_status_t)i);
        TEST_ASSERT_EQUAL_INT(!is_code(i), strcmp(text, "unknown status") == 0);
        TEST_ASSERT_TRUE(strlen(text) > 3 && text[strlen(text) - 1] != '.');
        for (int j = -64; j < i && is_code(i); j++) {
            TEST_ASSERT_TRUE(strcmp(text, aeo_status_text((aeo_status_t)j)) != 0);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(numbers_are_fixed);
    RUN_TEST(every_code_has_its_own_sentence_and_no_other_number);
    return UNITY_END();
}
