/* One description runs regressor and filter as two would by hand, and a stream cannot be told otherwise. */
#include "aeolid/estimator.h"
#include "fake_bus.h"
#include "samples.h"
#include "unity.h"

#include <string.h>

enum { R = 2, L = 3, P = 4, MASK = 2, PRESENT = 1, METHODS = 4, WORDS = 4000, COUNT = 400, PERIOD = 50000 };

static const aeo_estimator_method_t method[METHODS] = {aeo_estimator_rls, aeo_estimator_els, aeo_estimator_fast_rls,
                                                       aeo_estimator_lattice};
static const aeo_channel_t channel[R + L] = {{"pitch", "deg", AEO_REAL(0.5), AEO_REAL(0.5), AEO_REAL(-2), AEO_REAL(2)},
                                             {"torque", "kN m", AEO_REAL(0), AEO_REAL(2), AEO_REAL(0), AEO_REAL(0)},
                                             {"speed", "rad/s", AEO_REAL(-0.25), AEO_REAL(1), AEO_REAL(0), AEO_REAL(0)},
                                             {"fore_aft", "m/s", AEO_REAL(0), AEO_REAL(0.75), AEO_REAL(0), AEO_REAL(0)},
                                             {"side", NULL, AEO_REAL(0), AEO_REAL(1), AEO_REAL(-1e5), AEO_REAL(1e5)}};

static aeo_estimator_t one, other;
static aeo_real_t memory[WORDS], twin[WORDS], saved[WORDS], now_u[R], now_y[L];
static uint64_t seed;

void setUp(void)
{
    seed = 20261126u;
    set_up_bus();
    memset(now_y, 0, sizeof now_y);
}

void tearDown(void)
{
    tear_down_bus();
}

static aeo_estimator_config_t describe(aeo_model_set_t model_set)
{
    const aeo_estimator_config_t config = {.inputs = R,
                                           .outputs = L,
                                           .past = P,
                                           .model_set = model_set,
                                           .feedthrough = MASK,
                                           .period_us = PERIOD,
                                           .channels = channel,
                                           .forgetting = AEO_REAL(0.995),
                                           .regularisation = AEO_REAL(0.1),
                                           .excitation_min = AEO_REAL(0.05),
                                           .growth_max = AEO_REAL(100),
                                           .varx_samples = 50,
                                           .forgetting_start = AEO_REAL(0.99),
                                           .forgetting_rate = AEO_REAL(0.99),
                                           .guard_ratio = AEO_REAL(4)};
    return config;
}

static void take_one(unsigned k)
{
    fill(now_u, R, &seed);
    for (unsigned i = 0; i < L; i++) {
        now_y[i] = AEO_REAL(0.5) * now_y[i] + AEO_REAL(0.3) * now_u[i % R] + AEO_REAL(0.01) * (aeo_real_t)draw(&seed);
    }
    (void)k;
}

static aeo_model_set_t first_set(unsigned m)
{
    return m == (unsigned)AEO_METHOD_ELS ? AEO_VARMAX : AEO_VARX;
}

/* An estimator feeds back what is due: samples lost, one in ten, are no forgotten feedback. */
static void lost_samples_are_no_forgotten_feedback(void)
{
    const aeo_estimator_config_t config = describe(AEO_VARMAX);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, aeo_estimator_els, &config, memory, WORDS));
    for (unsigned k = 0; k < 20000u; k++) {
        take_one(k);
        const aeo_real_t good = now_y[0];
        if (draw(&seed) < -0.8) {
            now_y[0] = make_not_finite(0);
        }
        (void)aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD);
        now_y[0] = good;
    }
    TEST_ASSERT_TRUE(aeo_estimator_count(&one, AEO_COUNT_UPDATES) > 1000u);
    TEST_ASSERT_EQUAL_UINT32(0, one.of.els.count.unfed);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_estimator_health(&one) & AEO_ELS_UNFED);
}

/* ---- the same as by hand ------------------------------------------------------------------------------------------- */

static void rls_is_what_it_is_by_hand(void)
{
    enum { N_BY_HAND = AEO_REGRESSOR_LENGTH(R, L, P, 1, PRESENT) };
    static aeo_real_t window[AEO_REGRESSOR_WORDS(R, L, P, 1)], own[AEO_RLS_WORDS(N_BY_HAND, L)];
    const aeo_estimator_config_t config = describe(AEO_VARMAX);
    aeo_regressor_config_t layout = {
        .inputs = R, .outputs = L, .past = P, .model_set = AEO_VARMAX, .feedthrough = MASK};
    const aeo_rls_config_t settings = {
        N_BY_HAND, L, config.forgetting, config.regularisation, config.excitation_min, config.growth_max};
    aeo_real_t offset[R + L], scale[R + L];
    aeo_regressor_t regressor;
    aeo_rls_t rls;
    for (unsigned i = 0; i < R + L; i++) {
        offset[i] = channel[i].offset;
        scale[i] = channel[i].scale;
    }
    layout.period_us = PERIOD;
    layout.offset = offset;
    layout.scale = scale;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &settings, own, sizeof own / sizeof *own));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, aeo_estimator_rls, &config, memory, WORDS));
    for (unsigned k = 0; k < COUNT; k++) {
        take_one(k);
        const aeo_status_t status = aeo_regressor_push(&regressor, now_u, now_y, (uint64_t)k * PERIOD);
        TEST_ASSERT_EQUAL_INT(status, aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD));
        if (status == AEO_OK) {
            TEST_ASSERT_EQUAL_INT(AEO_OK,
                                  aeo_rls_update(&rls, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor)));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_set_innovation(&regressor, aeo_rls_residual(&rls)));
            TEST_ASSERT_EQUAL_MEMORY(aeo_rls_innovation(&rls), aeo_estimator_innovation(&one), L * sizeof *own);
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(aeo_rls_theta(&rls), aeo_estimator_theta(&one), N_BY_HAND * L * sizeof *own);
    TEST_ASSERT_EQUAL_UINT32(COUNT - P, aeo_estimator_count(&one, AEO_COUNT_UPDATES));
    TEST_ASSERT_EQUAL_UINT32(COUNT, aeo_estimator_count(&one, AEO_COUNT_SAMPLES));
    TEST_ASSERT_TRUE(aeo_estimator_invariants_hold(&one));
}

/* Any two filters see the same regressor, so they come to the same predictions. */
static void every_method_predicts(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        for (unsigned k = 0; k < COUNT; k++) {
            take_one(k);
            const aeo_status_t status = aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD);
            TEST_ASSERT_EQUAL_INT(k < P ? AEO_FILLING : AEO_OK, status);
        }
        for (unsigned i = 0; i < L; i++) { /* u of up to 0.3 in y, noise of 0.01, scales from 0.75 */
            const double e = (double)aeo_estimator_residual(&one)[i];
            TEST_ASSERT_TRUE(e > -0.35 && e < 0.35);
        }
        TEST_ASSERT_NOT_NULL(aeo_estimator_theta(&one));
        TEST_ASSERT_TRUE(aeo_estimator_invariants_hold(&one));
        TEST_ASSERT_EQUAL_UINT32(COUNT - P, aeo_estimator_count(&one, AEO_COUNT_UPDATES));
        aeo_estimator_reset(&one);
        TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_estimator_take(&one, now_u, now_y, 0));
    }
}

/* ---- memory and refusals ------------------------------------------------------------------------------------------- */

static void words_are_those_of_the_macros(void)
{
    for (unsigned e = 0; e < 2u; e++) {
        const aeo_estimator_config_t config = describe(e == 0u ? AEO_VARX : AEO_VARMAX);
        const size_t expected[METHODS] = {
            AEO_ESTIMATOR_RLS_WORDS(R, L, P, e, PRESENT), AEO_ESTIMATOR_ELS_WORDS(R, L, P, PRESENT),
            AEO_ESTIMATOR_FAST_RLS_WORDS(R, L, P, e, PRESENT), AEO_ESTIMATOR_LATTICE_WORDS(R, L, P, e, PRESENT)};
        const size_t kept[METHODS] = {AEO_ESTIMATOR_RLS_SAVED_WORDS(R, L, P, e, PRESENT),
                                      AEO_ESTIMATOR_ELS_SAVED_WORDS(R, L, P, PRESENT),
                                      AEO_ESTIMATOR_FAST_RLS_SAVED_WORDS(R, L, P, e, PRESENT),
                                      AEO_ESTIMATOR_LATTICE_SAVED_WORDS(R, L, P, e, PRESENT)};
        for (unsigned m = 0; m < METHODS; m++) {
            if (m != (unsigned)AEO_METHOD_ELS || e == 1u) {
                TEST_ASSERT_EQUAL_size_t(expected[m], aeo_estimator_words(method[m], &config));
                TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY,
                                      aeo_estimator_init(&one, method[m], &config, memory, expected[m] - 1u));
                aeo_real_t *const own = memory + WORDS / 2;
                TEST_ASSERT_TRUE(expected[m] < WORDS / 2);
                memset(memory, 0x55, sizeof memory);
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, own, expected[m]));
                (void)aeo_estimator_theta(&one);
                for (size_t i = 0; i < sizeof memory; i++) { /* what lies before and behind is nobody's */
                    const size_t word = i / sizeof *memory;
                    const int is_its = word >= WORDS / 2 && word < WORDS / 2 + expected[m];
                    TEST_ASSERT_TRUE(is_its || ((const unsigned char *)memory)[i] == 0x55u);
                }
                TEST_ASSERT_EQUAL_size_t(kept[m], aeo_estimator_saved_words(&one));
            }
        }
    }
}

/* Each thing wrong with a description, alone: refused, and neither object nor memory is touched. */
static void a_refused_description_leaves_every_byte(void)
{
    static aeo_real_t before[WORDS];
    aeo_channel_t bad[R + L];
    for (unsigned m = 0; m < METHODS; m++) {
        for (unsigned fault = 0; fault < 9u; fault++) {
            aeo_estimator_config_t config = describe(first_set(m));
            aeo_estimator_t untouched;
            memcpy(bad, channel, sizeof bad);
            config.channels = fault == 0u ? NULL : bad;
            config.inputs = fault == 1u ? 33u : config.inputs;
            config.feedthrough = fault == 2u ? 4u : config.feedthrough;
            config.forgetting = fault == 3u ? AEO_REAL(1.5) : config.forgetting;
            config.regularisation = fault == 4u ? make_not_finite(0) : config.regularisation;
            config.period_us = fault == 5u ? 0u : config.period_us;
            bad[3].scale = fault == 6u ? AEO_REAL(0) : bad[3].scale;
            bad[4].minimum = fault == 7u ? make_not_finite(2) : bad[4].minimum;
            bad[4].maximum = fault == 8u ? AEO_REAL(-2e5) : bad[4].maximum;
            memset(&one, 0x55, sizeof one);
            memset(memory, 0x55, sizeof memory);
            memcpy(&untouched, &one, sizeof one);
            memcpy(before, memory, sizeof memory);
            const aeo_status_t status = aeo_estimator_init(&one, method[m], &config, memory, WORDS);
            TEST_ASSERT_EQUAL_INT(fault == 4u || fault == 7u ? AEO_E_NOT_FINITE : AEO_E_ARG, status);
            TEST_ASSERT_EQUAL_MEMORY(&untouched, &one, sizeof one);
            TEST_ASSERT_EQUAL_MEMORY(before, memory, sizeof memory);
        }
    }
}

/* Channels in place of the four arrays: never both, and a range whose ends are both 0 is none. */
static void a_channel_is_described_once(void)
{
    static aeo_real_t window[AEO_REGRESSOR_WORDS(R, L, P, 0)];
    static const aeo_real_t some[R + L] = {1, 1, 1, 1, 1};
    const aeo_real_t **place[4];
    aeo_regressor_config_t layout = {.inputs = R, .outputs = L, .past = P, .period_us = PERIOD, .channels = channel};
    aeo_regressor_t regressor;
    place[0] = &layout.offset;
    place[1] = &layout.scale;
    place[2] = &layout.minimum;
    place[3] = &layout.maximum;
    for (unsigned i = 0; i < 4u; i++) {
        *place[i] = some;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG,
                              aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window));
        *place[i] = NULL;
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window));
    now_u[0] = AEO_REAL(-1);
    now_u[1] = AEO_REAL(9e5); /* no range, and 4.5e5 when scaled */
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_regressor_push(&regressor, now_u, now_y, PERIOD));
    now_u[0] = AEO_REAL(-2.5);
    TEST_ASSERT_EQUAL_INT(AEO_E_RANGE, aeo_regressor_push(&regressor, now_u, now_y, 2u * PERIOD));
}

/* ---- saving -------------------------------------------------------------------------------------------------------- */

static void a_restored_estimator_goes_on(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        const size_t n = aeo_estimator_regressors(&config);
        size_t length;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&other, method[m], &config, twin, WORDS));
        for (unsigned k = 0; k < COUNT; k++) {
            take_one(k);
            if (k == COUNT / 2u) {
                length = aeo_estimator_saved_words(&one);
                TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_estimator_save(&one, saved, length - 1u));
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_save(&one, saved, length));
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_restore(&other, saved, length));
            }
            (void)aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD);
            if (k >= COUNT / 2u) {
                (void)aeo_estimator_take(&other, now_u, now_y, (uint64_t)k * PERIOD);
            }
        }
        TEST_ASSERT_EQUAL_MEMORY(aeo_estimator_theta(&one), aeo_estimator_theta(&other), n * L * sizeof *memory);
        for (unsigned c = 0; c < (unsigned)AEO_COUNTERS; c++) {
            TEST_ASSERT_EQUAL_UINT32(aeo_estimator_count(&one, (aeo_counter_t)c),
                                     aeo_estimator_count(&other, (aeo_counter_t)c));
        }
    }
}

/* After a reset, window and filter are as new: bit for bit what one gives that was never used. Counters stay. */
static void a_reset_estimator_is_a_new_one(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        const size_t n = aeo_estimator_regressors(&config);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&other, method[m], &config, twin, WORDS));
        for (unsigned k = 0; k < 2u * COUNT; k++) {
            take_one(k);
            const aeo_status_t status = aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD);
            if (k == COUNT) {
                const uint32_t samples = aeo_estimator_count(&one, AEO_COUNT_SAMPLES);
                const uint32_t updates = aeo_estimator_count(&one, AEO_COUNT_UPDATES);
                aeo_estimator_reset(&one);
                TEST_ASSERT_EQUAL_UINT32(samples, aeo_estimator_count(&one, AEO_COUNT_SAMPLES));
                TEST_ASSERT_EQUAL_UINT32(updates, aeo_estimator_count(&one, AEO_COUNT_UPDATES));
            } else if (k > COUNT) {
                TEST_ASSERT_EQUAL_INT(status, aeo_estimator_take(&other, now_u, now_y, (uint64_t)k * PERIOD));
                TEST_ASSERT_EQUAL_MEMORY(aeo_estimator_innovation(&one), aeo_estimator_innovation(&other),
                                         L * sizeof *memory);
            }
        }
        TEST_ASSERT_EQUAL_MEMORY(aeo_estimator_theta(&one), aeo_estimator_theta(&other), n * L * sizeof *memory);
    }
}

/* While a window fills there are no residuals: behind a gap those of before it must not stand in for them. */
static void behind_a_gap_no_old_residual_is_fed_back(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(AEO_VARMAX);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        for (unsigned k = 0; k < 200u; k++) {
            take_one(k);
            const uint64_t now = (uint64_t)(k < 190u ? k : k + 5u) * PERIOD;
            const aeo_status_t status = aeo_estimator_take(&one, now_u, now_y, now);
            const aeo_real_t *const fed = one.regressor.block + R + L;
            for (unsigned i = 0; i < L; i++) {
                if (status == AEO_OK) {
                    TEST_ASSERT_EQUAL_MEMORY(one.calls.feedback(&one) + i, fed + i, sizeof *fed);
                } else {
                    TEST_ASSERT_TRUE(fed[i] >= AEO_REAL(0) && fed[i] <= AEO_REAL(0));
                }
            }
        }
        TEST_ASSERT_EQUAL_UINT32(1, aeo_estimator_count(&one, AEO_COUNT_GAPS));
    }
}

/* Any word changed, of the window's part or of the filter's: refused, and both stay as they were. */
static void a_damaged_array_changes_nothing(void)
{
    static aeo_real_t before[WORDS];
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        for (unsigned k = 0; k < 30u; k++) {
            take_one(k);
            (void)aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD);
        }
        const size_t length = aeo_estimator_saved_words(&one);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_save(&one, saved, length));
        take_one(30);
        (void)aeo_estimator_take(&one, now_u, now_y, UINT64_C(30) * PERIOD);
        memcpy(&other, &one, sizeof one);
        memcpy(before, memory, sizeof memory);
        for (size_t i = 0; i < length; i += 7u) {
            const aeo_real_t kept = saved[i];
            saved[i] = kept + AEO_REAL(1);
            TEST_ASSERT_NOT_EQUAL_INT(AEO_OK, aeo_estimator_restore(&one, saved, length));
            saved[i] = kept;
            TEST_ASSERT_EQUAL_MEMORY(&other, &one, sizeof one);
            TEST_ASSERT_EQUAL_MEMORY(before, memory, sizeof memory);
        }
    }
}

/* ---- the stream ---------------------------------------------------------------------------------------------------- */

static aeo_stream_config_t describe_bus(void)
{
    const aeo_stream_config_t bus = {.address = {AEO_FRAME_BASE_EXTENDED, 5, 1},
                                     .innovations = 1,
                                     .sample_every = 1,
                                     .health_every = 10,
                                     .describe_every = 600,
                                     .burst = 16};
    return bus;
}

/* The index of a description item, and its value. */
static aeo_message_t find_item(aeo_item_t item)
{
    for (unsigned i = 0; i < fake.kept; i++) {
        const aeo_message_t message = message_at(i);
        if (message.kind == AEO_KIND_DESCRIPTION && message.tag == (uint8_t)item) {
            return message;
        }
    }
    TEST_FAIL_MESSAGE("the item is not described");
    return message_at(0);
}

/* By hand, what the wire says of each: the model set, and above it the maker. */
static void what_is_announced_is_what_runs(void)
{
    static const uint16_t wire[2][METHODS] = {{0x000, 0xFFF, 0x100, 0x200}, {0x301, 0x001, 0x101, 0x201}};
    const aeo_stream_config_t bus = describe_bus();
    for (unsigned e = 0; e < 2u; e++) {
        for (unsigned m = 0; m < METHODS; m++) {
            const aeo_estimator_config_t config = describe(e == 0u ? AEO_VARX : AEO_VARMAX);
            const aeo_status_t status = aeo_estimator_init(&one, method[m], &config, memory, WORDS);
            if (wire[e][m] == 0xFFFu) { /* els needs the innovations in its window */
                TEST_ASSERT_EQUAL_INT(AEO_E_ARG, status);
                continue;
            }
            TEST_ASSERT_EQUAL_INT(AEO_OK, status);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_announce(&one, &stream, &bus, &port, words, PARAMETERS_MAX));
            fake.kept = 0;
            step_until_idle();
            TEST_ASSERT_EQUAL_HEX16(wire[e][m], find_item(AEO_ITEM_SHAPE).index);
            TEST_ASSERT_EQUAL_HEX32(0x01000000u + R + (L << 8), find_item(AEO_ITEM_SHAPE).value[0]);
            TEST_ASSERT_EQUAL_UINT16(P, find_item(AEO_ITEM_PARAMETERS).index);
            TEST_ASSERT_EQUAL_UINT32(L * (P * (R + L * (1u + e)) + PRESENT), find_item(AEO_ITEM_PARAMETERS).value[0]);
            TEST_ASSERT_EQUAL_UINT32(MASK, find_item(AEO_ITEM_FEEDTHROUGH).value[0]);
            TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(AEO_REAL(0.05)), find_item(AEO_ITEM_SAMPLE_TIME).value[0]);
        }
    }
}

/* Innovation, sample and health of one sample, and the snapshot, are those of the estimator. */
static void send_brings_all_of_a_sample(void)
{
    const aeo_estimator_config_t config = describe(AEO_VARX);
    const aeo_stream_config_t bus = describe_bus();
    unsigned samples = 0, innovations = 0;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, aeo_estimator_lattice, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_announce(&one, &stream, &bus, &port, words, PARAMETERS_MAX));
    describe_first();
    for (unsigned k = 0; k < 50u; k++) {
        take_one(k);
        TEST_ASSERT_EQUAL_INT(k < P ? AEO_FILLING : AEO_OK,
                              aeo_estimator_send(&one, &stream, k, now_u, now_y, NULL, (uint64_t)k * PERIOD));
    }
    for (unsigned i = 0; i < fake.kept; i++) {
        const aeo_message_t message = message_at(i);
        samples += message.kind == AEO_KIND_SAMPLE;
        innovations += message.kind == AEO_KIND_INNOVATION;
        if (message.kind == AEO_KIND_INNOVATION && message.index == 49u) {
            TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(aeo_estimator_innovation(&one)[message.tag]), message.value[0]);
        }
    }
    TEST_ASSERT_EQUAL_UINT(50u * (R + L), samples);
    TEST_ASSERT_EQUAL_UINT((50u - P) * L, innovations);
    TEST_ASSERT_EQUAL_UINT32(50, stream.counter[0]);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_snapshot(&one, &stream, 49));
    TEST_ASSERT_EQUAL_HEX32(aeo_float_bits(aeo_estimator_theta(&one)[7]), words[7]);
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_estimator_snapshot(&one, &stream, 49));
}

/* What the estimator knows may not be said again, and by hand a filter cannot be announced as another. */
static void a_contradiction_is_refused(void)
{
    const aeo_estimator_config_t config = describe(AEO_VARMAX);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, aeo_estimator_els, &config, memory, WORDS));
    for (unsigned fault = 0; fault < 11u; fault++) {
        aeo_stream_config_t bus = describe_bus();
        bus.inputs = fault == 0u ? R : 0u;
        bus.outputs = fault == 1u ? L : 0u;
        bus.method = fault == 2u ? (uint8_t)AEO_METHOD_ELS : 0u;
        bus.model_set = fault == 3u ? (uint16_t)AEO_VARMAX : 0u;
        bus.past = fault == 4u ? P : 0u;
        bus.parameters = fault == 5u ? 9u : 0u;
        bus.feedthrough = fault == 6u ? MASK : 0u;
        bus.channels = fault == 7u ? channel : NULL;
        bus.sample_time_s = fault == 8u ? AEO_REAL(0.05) : AEO_REAL(0);
        bus.lambda = fault == 9u ? AEO_REAL(0.995) : AEO_REAL(0);
        bus.rho = fault == 10u ? AEO_REAL(0.1) : AEO_REAL(0);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_announce(&one, &stream, &bus, &port, words, PARAMETERS_MAX));
    }
    aeo_stream_config_t whole = make_config(); /* VARX, 2 inputs, 3 outputs, p = 20: 300 parameters */
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.method = (uint8_t)AEO_METHOD_ELS;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.model_set = (uint16_t)AEO_VARMAX; /* the filter then has 480 */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.parameters = 480;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.feedthrough = 1;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.parameters = 483;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.feedthrough = 4; /* there are two inputs */
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.feedthrough = 2;
    whole.method = 4;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
    whole.method = 0;
    whole.model_set = 2;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &whole, &port, words, PARAMETERS_MAX));
}

/* ---- health, counters, invariants ---------------------------------------------------------------------------------- */

/* The filter's own health, of whichever it is. */
static uint32_t *find_health(unsigned m)
{
    uint32_t *const places[METHODS] = {&one.of.rls.health, &one.of.els.health, &one.of.fast_rls.health,
                                       &one.of.lattice.health};
    return places[m];
}

static void health_is_the_filters_until_cleared(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_EQUAL_HEX32(0, aeo_estimator_health(&one));
        *find_health(m) |= 4u;
        TEST_ASSERT_EQUAL_HEX32(4, aeo_estimator_health(&one));
        aeo_estimator_clear_health(&one);
        TEST_ASSERT_EQUAL_HEX32(0, aeo_estimator_health(&one));
    }
    aeo_estimator_clear_health(NULL);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_estimator_health(NULL));
    TEST_ASSERT_EQUAL_size_t(0, aeo_estimator_saved_words(NULL));
    TEST_ASSERT_EQUAL_UINT32(0, aeo_estimator_count(NULL, AEO_COUNT_SAMPLES));
}

/* Before the first sample nothing has been counted, of what a filter counts and of what it does not know. */
static void all_counters_begin_at_zero(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        for (unsigned c = 0; c <= (unsigned)AEO_COUNTERS; c++) {
            TEST_ASSERT_EQUAL_UINT32(0, aeo_estimator_count(&one, (aeo_counter_t)c));
        }
    }
}

/* Window and filter must both be sound. */
static void invariants_are_those_of_both_parts(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_TRUE(aeo_estimator_invariants_hold(&one));
        one.regressor.filled = P + 1u;
        TEST_ASSERT_FALSE(aeo_estimator_invariants_hold(&one));
        one.regressor.filled = 0;
        memset(memory, 0xFF, sizeof(aeo_real_t) * 8u); /* the filter's memory comes first; NaN */
        TEST_ASSERT_FALSE(aeo_estimator_invariants_hold(&one));
    }
    TEST_ASSERT_FALSE(aeo_estimator_invariants_hold(NULL));
}

static void flags_travel_with_the_samples(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        const aeo_stream_config_t bus = describe_bus();
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_announce(&one, &stream, &bus, &port, words, PARAMETERS_MAX));
        *find_health(m) |= 2u;
        take_one(0);
        (void)aeo_estimator_send(&one, &stream, 0, now_u, now_y, NULL, 0);
        TEST_ASSERT_EQUAL_HEX16(2, stream.flags);
    }
}

static void nothing_is_sent_without_both(void)
{
    const aeo_estimator_config_t config = describe(AEO_VARX);
    const aeo_stream_config_t bus = describe_bus();
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, aeo_estimator_rls, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_announce(&one, &stream, &bus, &port, words, PARAMETERS_MAX));
    take_one(0);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_send(NULL, &stream, 0, now_u, now_y, NULL, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_send(&one, &stream, 0, NULL, now_y, NULL, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_send(&one, NULL, 0, now_u, now_y, NULL, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_snapshot(NULL, &stream, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_snapshot(&one, NULL, 0));
    TEST_ASSERT_EQUAL_UINT(0, fake.kept);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_estimator_count(&one, AEO_COUNT_SAMPLES)); /* nor is anything absorbed */
}

/* A stream with scheduling channels wants them with each sample; without them nothing is absorbed or sent. */
static void scheduling_is_not_left_out(void)
{
    static const aeo_channel_t wide[R + L + 1] = {{.scale = 1}, {.scale = 1}, {.scale = 1},
                                                  {.scale = 1}, {.scale = 1}, {.name = "wind", .scale = 1}};
    const aeo_real_t wind = 8;
    aeo_estimator_config_t config = describe(AEO_VARX);
    aeo_stream_config_t bus = describe_bus();
    config.channels = wide;
    bus.scheduling = 1;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, aeo_estimator_rls, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_announce(&one, &stream, &bus, &port, words, PARAMETERS_MAX));
    take_one(0);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_estimator_send(&one, &stream, 0, now_u, now_y, NULL, 0));
    TEST_ASSERT_EQUAL_UINT32(0, aeo_estimator_count(&one, AEO_COUNT_SAMPLES));
    TEST_ASSERT_EQUAL_UINT(0, fake.kept);
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_estimator_send(&one, &stream, 0, now_u, now_y, &wind, 0));
    TEST_ASSERT_EQUAL_UINT32(1, aeo_estimator_count(&one, AEO_COUNT_SAMPLES));
    TEST_ASSERT_GREATER_THAN_UINT(R + L, fake.kept);
}

static void (*let_in)(void *context);
static unsigned fewest;

/* Where a step of another context may come between. */
static void watch_unlock(void *context)
{
    fewest = stream.counters_used < fewest ? stream.counters_used : fewest;
    let_in(context);
}

/* Flags and counters change under one lock: a step that saw fewer counters would begin anew with the items of health. */
static void a_step_between_sees_all_counters(void)
{
    const aeo_estimator_config_t config = describe(AEO_VARX);
    const aeo_stream_config_t bus = describe_bus();
    aeo_port_t watched = port;
    let_in = port.unlock;
    watched.unlock = watch_unlock;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, aeo_estimator_rls, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_announce(&one, &stream, &bus, &watched, words, PARAMETERS_MAX));
    for (unsigned k = 0; k < 20u; k++) {
        take_one(k);
        fewest = k == 0u ? 0u : AEO_STREAM_COUNTERS; /* from the first sample on */
        (void)aeo_estimator_send(&one, &stream, k, now_u, now_y, NULL, (uint64_t)k * PERIOD);
        TEST_ASSERT_EQUAL_UINT(k == 0u ? 0u : AEO_STREAM_COUNTERS, fewest);
    }
}

/* A gap is told of, and the sample behind it taken: it is the first of the P that fill the window. */
static void a_gap_takes_the_sample_that_tells_of_it(void)
{
    for (unsigned m = 0; m < METHODS; m++) {
        const aeo_estimator_config_t config = describe(first_set(m));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_estimator_init(&one, method[m], &config, memory, WORDS));
        for (unsigned k = 0; k < 30u; k++) {
            take_one(k);
            (void)aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD);
        }
        for (unsigned k = 40; k < 50u; k++) {
            const uint32_t samples = aeo_estimator_count(&one, AEO_COUNT_SAMPLES);
            take_one(k);
            TEST_ASSERT_EQUAL_INT(k == 40u      ? AEO_E_GAP
                                  : k < 40u + P ? AEO_FILLING
                                                : AEO_OK,
                                  aeo_estimator_take(&one, now_u, now_y, (uint64_t)k * PERIOD));
            TEST_ASSERT_EQUAL_UINT32(samples + 1u, aeo_estimator_count(&one, AEO_COUNT_SAMPLES));
        }
        TEST_ASSERT_EQUAL_UINT32(1, aeo_estimator_count(&one, AEO_COUNT_GAPS));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(rls_is_what_it_is_by_hand);
    RUN_TEST(lost_samples_are_no_forgotten_feedback);
    RUN_TEST(every_method_predicts);
    RUN_TEST(words_are_those_of_the_macros);
    RUN_TEST(a_refused_description_leaves_every_byte);
    RUN_TEST(a_channel_is_described_once);
    RUN_TEST(a_restored_estimator_goes_on);
    RUN_TEST(a_reset_estimator_is_a_new_one);
    RUN_TEST(behind_a_gap_no_old_residual_is_fed_back);
    RUN_TEST(a_damaged_array_changes_nothing);
    RUN_TEST(what_is_announced_is_what_runs);
    RUN_TEST(send_brings_all_of_a_sample);
    RUN_TEST(a_contradiction_is_refused);
    RUN_TEST(health_is_the_filters_until_cleared);
    RUN_TEST(all_counters_begin_at_zero);
    RUN_TEST(invariants_are_those_of_both_parts);
    RUN_TEST(flags_travel_with_the_samples);
    RUN_TEST(nothing_is_sent_without_both);
    RUN_TEST(scheduling_is_not_left_out);
    RUN_TEST(a_step_between_sees_all_counters);
    RUN_TEST(a_gap_takes_the_sample_that_tells_of_it);
    return UNITY_END();
}
