/* The saved arrays word for word, written a second time from the headers' words; and every word of one that is wrong. */
#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/lattice.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"
#include "samples.h"
#include "saved.h"
#include "unity.h"

#include <string.h>

enum { WORDS = 20000 };

static aeo_real_t memory[WORDS], saved[WORDS], expected[WORDS], z[64], y[4];
static size_t length; /* of expected */
static uint64_t seed;

void setUp(void)
{
    seed = 20261129u;
    length = 0;
}

void tearDown(void)
{
}

/* ---- writing ----------------------------------------------------------------------------------------------------------- */

static void put(double value)
{
    expected[length++] = (aeo_real_t)value;
}

static void put_words(const aeo_real_t *from, size_t count)
{
    memcpy(expected + length, from, count * sizeof *from);
    length += count;
}

static void put_numbers(const uint32_t *from, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        put((double)(from[i] / 65536u));
        put((double)(from[i] % 65536u));
    }
}

/* CRC-32 of IEEE 802.3 bit by bit, over the words' bytes; of a double the upper half comes first. */
static uint32_t find_crc(const aeo_real_t *from, size_t count)
{
    uint32_t crc = UINT32_C(0xFFFFFFFF);
    for (size_t i = 0; i < count; i++) {
        uint64_t wide = 0;
        uint32_t narrow = 0;
        if (sizeof *from == 8) {
            memcpy(&wide, from + i, sizeof *from);
        } else {
            memcpy(&narrow, from + i, sizeof narrow);
        }
        for (unsigned half = 0; half < sizeof *from / 4u; half++) {
            const uint32_t word = sizeof *from == 4 ? narrow : (uint32_t)(half == 0u ? wide >> 32 : wide & 0xFFFFFFFFu);
            for (unsigned bit = 0; bit < 32u; bit++) {
                const uint32_t low = (crc ^ (word >> bit)) & 1u;
                crc = (crc >> 1) ^ (low != 0u ? UINT32_C(0xEDB88320) : 0u);
            }
        }
    }
    return ~crc;
}

static void put_seal(size_t from)
{
    const uint32_t crc = find_crc(expected + from, length - from);
    put_numbers(&crc, 1);
}

static void assert_written(aeo_status_t status)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, status);
    TEST_ASSERT_EQUAL_MEMORY(expected, saved, length * sizeof *saved);
}

/* ---- the filters ------------------------------------------------------------------------------------------------------- */

static aeo_rls_t rls;
static aeo_els_t els;
static aeo_fast_rls_t fast;
static aeo_lattice_t lattice;
static aeo_regressor_t window;

/* Numbers that differ in every place, none of them small. */
static void number(uint32_t *first, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        first[i] = 0x10203u + (uint32_t)i * 0x1111111u;
    }
}

static void start_rls(void)
{
    const aeo_rls_config_t config = {9, 2, AEO_REAL(0.984375), AEO_REAL(0.5), AEO_REAL(0.0625), AEO_REAL(64)};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, WORDS));
    for (unsigned k = 0; k < 50u; k++) {
        fill(z, 9, &seed);
        fill(y, 2, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, y));
    }
    number(&rls.health, 7);
}

static void put_rls(const aeo_rls_t *of)
{
    const size_t from = length, n = of->config.regressors, l = of->config.outputs;
    put(3);
    put(sizeof(aeo_real_t));
    put((double)n);
    put((double)l);
    put((double)of->config.forgetting);
    put((double)of->config.regularisation);
    put((double)of->config.excitation_min);
    put((double)of->config.growth_max);
    put_numbers(&of->health, 1);
    const uint32_t numbers[] = {of->count.updates,       of->count.rejected, of->count.withheld, of->count.bounded,
                                of->count.reinitialised, of->count.released, of->scan_row,       of->watch.age,
                                of->watch.moved,         of->watch.withheld, of->watch.blocks,   of->watch.suspected};
    put_numbers(numbers, 12);
    put_words(of->factor, AEO_RLS_FACTOR_WORDS(n));
    put_words(of->theta, n * l);
    put_words(of->innovation, l);
    put_words(of->residual, l);
    put_words(of->watched, AEO_WATCH_WORDS(l));
    put_seal(from);
}

static void rls_is_written_as_its_header_says(void)
{
    start_rls();
    put_rls(&rls);
    TEST_ASSERT_EQUAL_size_t(AEO_RLS_SAVED_WORDS(9, 2), length);
    assert_written(aeo_rls_save(&rls, saved, length));
}

static void start_els(void)
{
    const aeo_els_config_t config = {.regressors = 13,
                                     .outputs = 2,
                                     .past = 2,
                                     .present = 1,
                                     .varx_samples = 20,
                                     .forgetting = AEO_REAL(0.984375),
                                     .forgetting_start = AEO_REAL(0.96875),
                                     .forgetting_rate = AEO_REAL(0.9375),
                                     .regularisation = AEO_REAL(0.5),
                                     .excitation_min = AEO_REAL(0.0625),
                                     .growth_max = AEO_REAL(64),
                                     .guard_ratio = AEO_REAL(4)};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, memory, WORDS));
    for (unsigned k = 0; k < 50u; k++) {
        fill(z, 13, &seed);
        fill(y, 2, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&els, z, y));
    }
    number(&els.count.fell_back, 3);
    els.health = 0x70605u;
    els.since = 0x80706u;
    els.backoff = 5u;
    els.wait = 20u << 5;
    els.missed = 1u;
}

static void els_is_written_as_its_header_says(void)
{
    start_els();
    put(2);
    put(sizeof(aeo_real_t));
    put(2);
    put(1);
    put((double)els.config.forgetting);
    put((double)els.config.forgetting_start);
    put((double)els.config.forgetting_rate);
    put((double)els.config.guard_ratio);
    put(20);
    const uint32_t numbers[] = {els.count.fell_back, els.count.limited, els.count.unfed, els.health,
                                els.since,           els.backoff,       els.missed};
    put_numbers(numbers, 7);
    put((double)els.shortfall);
    put_words(els.feedback, 2);
    put_words(els.levels, AEO_ELS_OWN(2) - 2u);
    put_rls(&els.rls);
    put_seal(0);
    TEST_ASSERT_EQUAL_size_t(AEO_ELS_SAVED_WORDS(13, 2), length);
    assert_written(aeo_els_save(&els, saved, length));
}

/* A mask with bits in both halves, whose block has 18 entries. */
static void start_fast(void)
{
    const aeo_fast_rls_config_t config = {.past = 2,
                                          .block = 18,
                                          .outputs = 2,
                                          .feedthrough = 0x10003u,
                                          .forgetting = AEO_REAL(0.984375),
                                          .regularisation = AEO_REAL(0.5),
                                          .growth_max = AEO_REAL(64)};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, memory, WORDS));
    for (unsigned k = 0; k < 50u; k++) {
        fill(z, 39, &seed);
        fill(y, 2, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
    }
    number(&fast.count.updates, 8);
    fast.array[1].age = 0x30405u;
    fast.hold = 0x50607u;
    fast.regularisation = AEO_REAL(2048); /* 0.5, risen three times */
}

static void fast_rls_is_written_as_its_header_says(void)
{
    start_fast();
    const size_t n = 39, m = 18, array = AEO_FAST_RLS_ARRAY_WORDS(2, 18, 3);
    put(5);
    put(sizeof(aeo_real_t));
    put(2);
    put(18);
    put(2);
    put(1);
    put(3);
    put((double)fast.config.forgetting);
    put((double)fast.config.regularisation);
    put((double)fast.config.growth_max);
    const uint32_t numbers[] = {fast.random, fast.filled, fast.active, fast.health};
    put_numbers(numbers, 4);
    put_numbers(&fast.count.updates, 8);
    const uint32_t others[] = {fast.hold,
                               fast.disturbed,
                               fast.astray,
                               fast.watch.age,
                               fast.watch.moved,
                               fast.watch.withheld,
                               fast.watch.blocks,
                               fast.watch.suspected,
                               fast.array[0].age,
                               fast.array[1].age,
                               3u};
    put_numbers(others, 11);
    put_words(fast.array[0].forward, array);
    put_words(fast.array[1].forward, array);
    put_words(fast.theta, n * 2u);
    put_words(fast.window, n + m);
    put_words(fast.added, n + m);
    put_words(fast.innovation, 2);
    put_words(fast.residual, 2);
    put_words(fast.watched, AEO_WATCH_WORDS(2));
    put_seal(0);
    TEST_ASSERT_EQUAL_size_t(AEO_FAST_RLS_SAVED_WORDS(2, 18, 3, 2), length);
    assert_written(aeo_fast_rls_save(&fast, saved, length));
}

static void start_lattice(void)
{
    const aeo_lattice_config_t config = {.past = 3,
                                         .block = 4,
                                         .present = 2,
                                         .outputs = 2,
                                         .forgetting = AEO_REAL(0.984375),
                                         .regularisation = AEO_REAL(0.5),
                                         .excitation_min = AEO_REAL(0.0625),
                                         .growth_max = AEO_REAL(64)};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&lattice, &config, memory, WORDS));
    for (unsigned k = 0; k < 50u; k++) {
        memmove(z, z + 4, 8u * sizeof *z);
        fill(z + 8, 6, &seed);
        fill(y, 2, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, y));
    }
    lattice.health = 0x30201u;
    number(&lattice.count.updates, 7);
}

static void the_lattice_is_written_as_its_header_says(void)
{
    start_lattice();
    put(2);
    put(sizeof(aeo_real_t));
    put(3);
    put(4);
    put(2);
    put(2);
    put((double)lattice.config.forgetting);
    put((double)lattice.config.regularisation);
    put((double)lattice.config.excitation_min);
    put((double)lattice.config.growth_max);
    put_numbers(&lattice.health, 1);
    put_numbers(&lattice.count.updates, 7);
    const uint32_t numbers[] = {lattice.orders,       lattice.learning,       lattice.head,
                                lattice.scan,         lattice.begun,          lattice.quiet,
                                lattice.watch.age,    lattice.watch.moved,    lattice.watch.withheld,
                                lattice.watch.blocks, lattice.watch.suspected};
    put_numbers(numbers, 11);
    put_words(lattice.factor, AEO_LATTICE_STATE(3, 4, 2, 2));
    put_seal(0);
    TEST_ASSERT_EQUAL_size_t(AEO_LATTICE_SAVED_WORDS(3, 4, 2, 2), length);
    assert_written(aeo_lattice_save(&lattice, saved, length));
}

/* Wide numbers in both halves: the mask of 18 inputs, the period, the time. */
static void start_window(void)
{
    static aeo_real_t offset[19], scale[19];
    for (unsigned i = 0; i < 19u; i++) {
        offset[i] = AEO_REAL(0.125) * (aeo_real_t)i;
        scale[i] = AEO_REAL(0.5) + (aeo_real_t)i;
    }
    const aeo_regressor_config_t config = {.inputs = 18,
                                           .outputs = 1,
                                           .past = 2,
                                           .model_set = AEO_VARMAX,
                                           .feedthrough = 0x20005u,
                                           .period_us = 70000,
                                           .offset = offset,
                                           .scale = scale};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&window, &config, memory, WORDS));
    for (uint64_t k = 0; k < 5u; k++) {
        fill(z, 18, &seed);
        fill(y, 1, &seed);
        (void)aeo_regressor_push(&window, z, y, UINT64_C(0x123456789A) + 70000u * k);
        (void)aeo_regressor_set_innovation(&window, y);
    }
    number(&window.count.samples, 5);
}

static void the_window_is_written_as_its_header_says(void)
{
    start_window();
    put(1);
    put(sizeof(aeo_real_t));
    put(18);
    put(1);
    put(2);
    put(1);
    put(2);
    put(5);
    put(1);
    put(70000 - 65536);
    put_words(window.offset, 19);
    put_words(window.inverse, 19);
    const uint32_t numbers[] = {window.filled, window.pending, (uint32_t)(window.time_us >> 32),
                                (uint32_t)(window.time_us & 0xFFFFFFFFu)};
    put_numbers(numbers, 4);
    put_numbers(&window.count.samples, 5);
    put_words(window.z, 2u * 20u + 3u);
    for (unsigned i = 3; i < 18u; i++) { /* room for all inputs */
        put(0);
    }
    put_words(window.block, 20);
    put_seal(0);
    TEST_ASSERT_EQUAL_size_t(AEO_REGRESSOR_SAVED_WORDS(18, 1, 2, 1), length);
    assert_written(aeo_regressor_save(&window, saved, length));
}

/* ---- reading ----------------------------------------------------------------------------------------------------------- */

typedef aeo_status_t (*restore_t)(const aeo_real_t *from, size_t count);

static aeo_status_t restore_rls(const aeo_real_t *from, size_t count)
{
    return aeo_rls_restore(&rls, from, count);
}

static aeo_status_t restore_els(const aeo_real_t *from, size_t count)
{
    return aeo_els_restore(&els, from, count);
}

static aeo_status_t restore_fast(const aeo_real_t *from, size_t count)
{
    return aeo_fast_rls_restore(&fast, from, count);
}

static aeo_status_t restore_lattice(const aeo_real_t *from, size_t count)
{
    return aeo_lattice_restore(&lattice, from, count);
}

static aeo_status_t restore_window(const aeo_real_t *from, size_t count)
{
    return aeo_regressor_restore(&window, from, count);
}

/* The array saved, with one word that is another, under a seal that fits it. */
static aeo_status_t restore_with(restore_t restore, size_t place, aeo_real_t word)
{
    memcpy(expected, saved, length * sizeof *saved);
    expected[place] = word;
    aeo_saved_seal(expected, length);
    return restore(expected, length);
}

/* Every word of the head must be the filter's own; every number two whole halves below 65536; the seal that of the rest. */
static void judge_words(restore_t restore, size_t head, size_t numbers)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, restore(saved, length));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, restore(saved, length - 1u));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, restore(NULL, length));
    for (size_t i = 0; i < head; i++) {
        const aeo_status_t status = i == 0u ? AEO_E_VERSION : AEO_E_MISMATCH;
        TEST_ASSERT_EQUAL_INT(status, restore_with(restore, i, saved[i] + AEO_REAL(0.25)));
        TEST_ASSERT_EQUAL_INT(status, restore_with(restore, i, saved[i] - AEO_REAL(0.25)));
    }
    for (size_t i = head; i < head + 2u * numbers; i++) {
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_with(restore, i, AEO_REAL(65536)));
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_with(restore, i, AEO_REAL(-1)));
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore_with(restore, i, saved[i] + AEO_REAL(0.5)));
    }
    for (size_t i = 0; i < length; i++) {
        memcpy(expected, saved, length * sizeof *saved);
        expected[i] = make_not_finite((int)(i % 4u));
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, restore(expected, length));
    }
    for (size_t i = length - AEO_SAVED_SEAL; i < length; i++) {
        memcpy(expected, saved, length * sizeof *saved);
        expected[i] += expected[i] > AEO_REAL(0) ? AEO_REAL(-1) : AEO_REAL(1);
        TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, restore(expected, length));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, restore(saved, length));
}

static void words_that_are_not_the_filters_own_are_refused(void)
{
    start_rls();
    rls.health = rls.scan_row = 0;
    length = AEO_RLS_SAVED_WORDS(9, 2);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_save(&rls, saved, length));
    judge_words(restore_rls, 8, 13);
    start_els();
    length = AEO_ELS_SAVED_WORDS(13, 2);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&els, saved, length));
    judge_words(restore_els, 9, 7);
    start_fast();
    length = AEO_FAST_RLS_SAVED_WORDS(2, 18, 3, 2);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&fast, saved, length));
    judge_words(restore_fast, 10, 23);
    start_lattice();
    length = AEO_LATTICE_SAVED_WORDS(3, 4, 2, 2);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&lattice, saved, length));
    judge_words(restore_lattice, 10, 19);
    start_window();
    length = AEO_REGRESSOR_SAVED_WORDS(18, 1, 2, 1);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&window, saved, length));
    judge_words(restore_window, 10u + 38u, 9);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(rls_is_written_as_its_header_says);
    RUN_TEST(els_is_written_as_its_header_says);
    RUN_TEST(fast_rls_is_written_as_its_header_says);
    RUN_TEST(the_lattice_is_written_as_its_header_says);
    RUN_TEST(the_window_is_written_as_its_header_says);
    RUN_TEST(words_that_are_not_the_filters_own_are_refused);
    return UNITY_END();
}
