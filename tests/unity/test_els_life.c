/* How extended least squares is used: its feedback, its starts, its saved form, what it refuses. */
#include "els_bench.h"
#include "samples.h"
#include "saved.h"
#include "unity.h"

#include <math.h>
#include <string.h>

void setUp(void)
{
    reset_bench();
}

void tearDown(void)
{
}

static void forgotten_feedback_is_told(void)
{
    const aeo_els_config_t config = make_els_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(500);
    /* a gap leaves zeros in z once: no complaint */
    time_us += 10000;
    TEST_ASSERT_EQUAL_INT(AEO_E_GAP, step());
    run(500);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_els_health(&els));
    for (int k = 0; k < 10; k++) {
        const aeo_real_t u = (aeo_real_t)draw(&seed), y = (aeo_real_t)draw(&seed);
        time_us += 1000;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_push(&regressor, &u, &y, time_us));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&els, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor)));
    }
    /* the first of these found the e of the step before; the next nine nothing, which for the first might be a gap */
    TEST_ASSERT_EQUAL_UINT32(8, els.count.unfed);
    TEST_ASSERT_TRUE((aeo_els_health(&els) & AEO_ELS_UNFED) != 0u);
}

/* Each gap leaves zeros in z once, and of two that lie one regressor apart the filter sees nothing between. */
static void lost_samples_are_no_forgotten_feedback(void)
{
    const aeo_els_config_t config = make_els_config(2);
    unsigned apart = 0, absorbed = 0;
    start(&config);
    for (unsigned k = 0; k < 20000u; k++) {
        const aeo_real_t u = (aeo_real_t)draw(&seed);
        const aeo_real_t y = draw(&seed) < -0.8 ? make_not_finite(0) : (aeo_real_t)draw(&seed);
        time_us += 1000;
        if (aeo_els_step(&els, &regressor, &u, &y, time_us) == AEO_OK) {
            absorbed++;
            continue;
        }
        apart += absorbed == 1u ? 1u : 0u;
        absorbed = 0;
    }
    TEST_ASSERT_TRUE(apart > 100u && els.since > config.varx_samples); /* such gaps, and something was fed back */
    TEST_ASSERT_EQUAL_UINT32(0, els.count.unfed);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_els_health(&els) & AEO_ELS_UNFED);
}

static void a_step_is_push_update_and_feedback(void)
{
    static aeo_real_t other_memory[WORDS], other_window[WINDOW];
    const aeo_els_config_t config = make_els_config(3);
    aeo_els_t other;
    set_plant(0.8, 2, 0.2);
    start(&config);
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = L, .past = 3, .model_set = AEO_VARMAX, .period_us = 1000};
    aeo_regressor_t by_hand;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&by_hand, &layout, other_window, WINDOW));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&other, &config, other_memory, WORDS));
    for (int k = 0; k < 600; k++) {
        const aeo_status_t status = step();
        const aeo_real_t u = (aeo_real_t)plant.u[0], y = (aeo_real_t)(plant.y[0] * plant.scale);
        TEST_ASSERT_EQUAL_INT(status, aeo_regressor_push(&by_hand, &u, &y, time_us));
        if (status == AEO_OK) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&other, aeo_regressor_z(&by_hand), aeo_regressor_y(&by_hand)));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_set_innovation(&by_hand, aeo_els_feedback(&other)));
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(memory, other_memory, AEO_ELS_WORDS(9, 1) * sizeof *memory);
    TEST_ASSERT_EQUAL_MEMORY(&els.count, &other.count, sizeof els.count);
}

static void a_regressor_that_does_not_fit_is_refused(void)
{
    const aeo_els_config_t config = make_els_config(2);
    const aeo_real_t one = AEO_REAL(1);
    start(&config);
    start_regressor(3);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, &one, &one, 1000));
    start_regressor(2);
    regressor.model_set = (uint8_t)AEO_VARX;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, &one, &one, 1000));
    start_regressor(2);
    regressor.outputs = 2;
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, &one, &one, 1000));
    const aeo_regressor_config_t flat = {/* one block of 6 instead of two of 3 */
                                         .inputs = 4,
                                         .outputs = L,
                                         .past = 1,
                                         .model_set = AEO_VARMAX,
                                         .period_us = 1000};
    const aeo_real_t four[4] = {one, one, one, one};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &flat, window, WINDOW));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, four, &one, 1000));
    /* one block of 4 and a present input instead of one block of 5: p, l and n are the same */
    aeo_els_config_t wide = make_els_config(1);
    wide.regressors = 5;
    start(&wide);
    const aeo_regressor_config_t narrow = {
        .inputs = 2, .outputs = L, .past = 1, .model_set = AEO_VARMAX, .feedthrough = 1, .period_us = 1000};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &narrow, window, WINDOW));
    TEST_ASSERT_EQUAL_UINT(5, regressor.length);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, four, &one, 1000));
    start(&config);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(NULL, &regressor, &one, &one, 1000));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, NULL, &one, &one, 1000));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_step(&els, &regressor, NULL, &one, 1000));
    TEST_ASSERT_EQUAL_UINT32(0, regressor.count.samples);
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_els_step(&els, &regressor, &one, &one, 1000));
}

static void a_given_varx_is_started_from(void)
{
    const aeo_els_config_t config = make_els_config(2);
    aeo_real_t theta[6] = {AEO_REAL(0.1), AEO_REAL(0.2), AEO_REAL(9), AEO_REAL(0.3), AEO_REAL(0.4), AEO_REAL(9)};
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(1000);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_start(&els, theta));
    TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
    theta[2] = theta[5] = AEO_REAL(0);
    TEST_ASSERT_EQUAL_MEMORY(theta, aeo_els_theta(&els), sizeof theta);
    TEST_ASSERT_EQUAL_UINT32(0, els.since);
    run(100);
    const aeo_els_t before = els;
    theta[3] = make_not_finite(1);
    TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_els_start(&els, theta));
    theta[3] = AEO_REAL(1.1e6);
    TEST_ASSERT_EQUAL_INT(AEO_E_RANGE, aeo_els_start(&els, theta));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_start(&els, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_start(NULL, theta));
    TEST_ASSERT_EQUAL_MEMORY(&before, &els, sizeof els);
}

/* A start needs blocks to start from: one will do. */
static void a_start_needs_blocks(void)
{
    static const aeo_real_t theta[3] = {AEO_REAL(1), AEO_REAL(2), AEO_REAL(3)};
    static aeo_real_t own[AEO_ELS_WORDS(3, 1)];
    aeo_els_config_t config = make_els_config(2);
    config.regressors = 3;
    config.outputs = 1;
    config.varx_samples = 0;
    config.guard_ratio = AEO_REAL(0);
    for (uint16_t past = 0; past < 2u; past++) {
        config.past = past;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, own, sizeof own / sizeof *own));
        TEST_ASSERT_EQUAL_INT(past == 0u ? AEO_E_ARG : AEO_OK, aeo_els_start(&els, theta));
    }
    const aeo_real_t expected[3] = {theta[0], theta[1], AEO_REAL(0)}; /* the column of e begins at 0 */
    TEST_ASSERT_EQUAL_MEMORY(expected, aeo_els_theta(&els), sizeof expected);
}

/* The first sample behind a start may hold no e: that is one miss, and no two running. */
static void one_miss_behind_a_start_is_no_complaint(void)
{
    const aeo_els_config_t config = make_els_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    TEST_ASSERT_EQUAL_UINT32(0, els.missed);
    run(1000);
    els.missed = 1;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_start(&els, aeo_els_theta(&els)));
    TEST_ASSERT_EQUAL_UINT32(0, els.missed);
    els.missed = 1;
    aeo_els_reset(&els);
    TEST_ASSERT_EQUAL_UINT32(0, els.missed);
}

/* A run of sixteen waits was sound: the next start is as long as the first. One sample less, and it is twice the last. */
static void a_run_of_sixteen_waits_was_sound(void)
{
    const aeo_els_config_t config = make_els_config(2);
    for (uint32_t less = 0; less < 2u; less++) {
        reset_bench();
        set_plant(0.5, 1, 0.3);
        start(&config);
        run(1000);
        els.backoff = 2;
        els.wait = config.varx_samples << 2;
        els.since = 17u * els.wait - 1u - less;
        els.rls.theta[1] = AEO_REAL(1e20); /* as a flipped bit would */
        run(1);
        TEST_ASSERT_EQUAL_UINT32(1, els.count.fell_back);
        TEST_ASSERT_EQUAL_UINT32(less == 0u ? 0u : 3u, els.backoff);
    }
}

/* Without blocks no entry of z is an e: none is missed. */
static void without_blocks_no_feedback_is_missed(void)
{
    static aeo_real_t own[AEO_ELS_WORDS(3, 1)];
    aeo_els_config_t config = make_els_config(2);
    config.regressors = 3;
    config.outputs = 1;
    config.past = 0;
    config.varx_samples = 0;
    config.guard_ratio = AEO_REAL(0);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, own, sizeof own / sizeof *own));
    for (unsigned k = 0; k < 50u; k++) {
        aeo_real_t z[3], y[1];
        fill(z, 3, &seed);
        fill(y, 1, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&els, z, y));
    }
    TEST_ASSERT_EQUAL_UINT32(0, els.count.unfed);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_els_health(&els) & AEO_ELS_UNFED);
}

static void runaway_starts_from_varx(void)
{
    const aeo_els_config_t config = make_els_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(1000);
    els.rls.theta[1] = AEO_REAL(1e20);
    run(1);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_REINITIALISED | AEO_ELS_FELL_BACK, aeo_els_health(&els));
    TEST_ASSERT_EQUAL_UINT32(1, els.count.fell_back);
    TEST_ASSERT_EQUAL_UINT32(400, els.wait);
}

/* A theta that no scaled data have is dropped to the last bit when the guard falls back; what they may have is kept. */
static void a_fall_back_drops_what_no_data_have(void)
{
    const aeo_els_config_t config = make_els_config(2);
    for (unsigned wild = 0; wild < 2u; wild++) {
        reset_bench();
        set_plant(0.5, 1, 0.3);
        start(&config);
        run(1000);
        TEST_ASSERT_EQUAL_UINT32(0, els.count.fell_back);
        for (unsigned k = 0; k < 500u && els.count.fell_back == 0u; k++) {
            els.rls.theta[0] = wild != 0u ? AEO_REAL(1e6) : AEO_REAL(60);
            run(1);
        }
        TEST_ASSERT_EQUAL_UINT32(1, els.count.fell_back);
        const size_t count = (size_t)config.regressors * config.outputs;
        double size = 0.0;
        for (size_t i = 0; i < count; i++) {
            size += fabs((double)els.rls.theta[i]);
        }
        TEST_ASSERT_TRUE(wild != 0u ? size < 1e-45 : size > 1.0);
    }
}

static void save_and_restore_go_on_in_every_phase(void)
{
    static aeo_real_t other_memory[WORDS];
    static const unsigned AT[] = {0, 1, 50, 99, 100, 199, 202, 203, 500, 3000};
    const aeo_els_config_t config = make_els_config(5);
    for (size_t t = 0; t < sizeof AT / sizeof AT[0]; t++) {
        seed = 977;
        set_plant(0.95, 5, 0.09);
        start(&config);
        run(5 + AT[t]);
        if (t % 3 == 0) { /* after a fall-back, too */
            els.rls.theta[1] = AEO_REAL(1e20);
            run(1 + AT[t]);
            TEST_ASSERT_EQUAL_UINT32(400, els.wait);
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&els, saved, AEO_ELS_SAVED_WORDS(15, 1)));
        aeo_els_t other;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&other, &config, other_memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_restore(&other, saved, AEO_ELS_SAVED_WORDS(15, 1)));
        TEST_ASSERT_TRUE(aeo_els_invariants_hold(&other));
        for (int k = 0; k < 500; k++) {
            run(1);
            TEST_ASSERT_EQUAL_INT(AEO_OK,
                                  aeo_els_update(&other, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor)));
            TEST_ASSERT_EQUAL_MEMORY(els.rls.theta, other.rls.theta, 15 * sizeof *memory);
            TEST_ASSERT_EQUAL_MEMORY(els.feedback, other.feedback, AEO_ELS_OWN(1) * sizeof *memory);
        }
        TEST_ASSERT_EQUAL_MEMORY(&els.count, &other.count, sizeof els.count);
        TEST_ASSERT_EQUAL_UINT32(els.wait, other.wait);
    }
}

static void restore_names_what_is_wrong(void)
{
    enum { LENGTH = AEO_ELS_SAVED_WORDS(6, 1), RLS_AT = AEO_ELS_SAVED_HEAD + AEO_ELS_OWN(1) };
    const aeo_els_config_t config = make_els_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(50);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&els, saved, LENGTH));
    run(7);
    const aeo_els_t before = els;
    static aeo_real_t memory_before[WORDS];
    memcpy(memory_before, memory, sizeof memory);
    for (size_t i = 0; i < (size_t)RLS_AT + AEO_RLS_SAVED_HEAD; i++) {
        const aeo_real_t wrong[2] = {AEO_REAL(-1.5), AEO_REAL(2.1e12)};
        for (int t = 0; t < 2; t++) {
            const aeo_status_t expected = i == 0 || i == RLS_AT            ? AEO_E_VERSION
                                          : i < 9                          ? AEO_E_MISMATCH
                                          : i < RLS_AT || i >= RLS_AT + 8u ? AEO_E_DAMAGED
                                                                           : AEO_E_MISMATCH;
            const aeo_real_t good = saved[i];
            saved[i] = wrong[t];
            if (i == AEO_ELS_SAVED_HEAD && t == 0) { /* the one word, e fed back, that -1.5 does not damage */
                saved[i] = AEO_REAL(-1.1e6);
            }
            aeo_saved_seal(saved + RLS_AT, AEO_RLS_SAVED_WORDS(6, 1)); /* the seals are not the only judges */
            aeo_saved_seal(saved, LENGTH);
            TEST_ASSERT_EQUAL_INT(expected, aeo_els_restore(&els, saved, LENGTH));
            saved[i] = good;
            TEST_ASSERT_EQUAL_MEMORY(&before, &els, sizeof els);
            TEST_ASSERT_EQUAL_MEMORY(memory_before, memory, sizeof memory);
        }
    }
    saved[20] = AEO_REAL(7); /* the low half of backoff */
    aeo_saved_seal(saved + RLS_AT, AEO_RLS_SAVED_WORDS(6, 1));
    aeo_saved_seal(saved, LENGTH);
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_els_restore(&els, saved, LENGTH));
}

static void settings_out_of_range_are_refused(void)
{
    const aeo_els_t untouched = els;
    for (int t = 0; t < 17; t++) {
        aeo_els_config_t config = make_els_config(2);
        config.regressors = t == 0 ? 7 : t == 1 ? 0 : config.regressors; /* no two blocks */
        config.outputs = t == 2 ? 2 : t == 3 ? 0 : t == 4 ? 33 : config.outputs;
        config.past = t == 5 ? 6 : t == 6 ? 0 : config.past; /* blocks of 1; guard without blocks */
        config.present = t == 7 ? 6 : config.present;
        config.varx_samples = t == 8 ? AEO_ELS_VARX_SAMPLES_MAX + 1u : t == 9 ? 15u : config.varx_samples;
        config.forgetting = t == 10 ? AEO_REAL(1.01) : t == 11 ? AEO_REAL(0.98) : config.forgetting;
        config.forgetting_start = t == 12 ? AEO_REAL(0.49) : config.forgetting_start;
        config.forgetting_rate = t == 13 ? AEO_REAL(1) : t == 14 ? AEO_REAL(-0.1) : config.forgetting_rate;
        config.guard_ratio = t == 15 ? AEO_REAL(1.4) : t == 16 ? AEO_REAL(101) : config.guard_ratio;
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(&els, &config, memory, WORDS));
    }
    for (int t = 0; t < 28; t++) {
        aeo_els_config_t config = make_els_config(2);
        aeo_real_t *const fields[7] = {&config.forgetting,     &config.forgetting_start, &config.forgetting_rate,
                                       &config.regularisation, &config.excitation_min,   &config.growth_max,
                                       &config.guard_ratio};
        *fields[t / 4] = make_not_finite(t % 4);
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_els_init(&els, &config, memory, WORDS));
    }
    aeo_els_config_t config = make_els_config(2);
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_els_init(&els, &config, memory, AEO_ELS_WORDS(6, 1) - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_els_init(&els, &config, memory, 3));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(NULL, &config, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(&els, NULL, memory, WORDS));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_init(&els, &config, NULL, WORDS));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &els, sizeof els);
    start(&config);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &els.config, memory, WORDS)); /* its own, once more */
    TEST_ASSERT_TRUE(els.config.past == 2 && aeo_els_invariants_hold(&els));
}

static void invariants_notice_damage(void)
{
    const aeo_els_config_t config = make_els_config(2);
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(300);
    aeo_real_t *const spots[] = {&els.feedback[0], &els.levels[0], &els.levels[3], &els.shortfall, &els.rls.theta[4]};
    for (size_t t = 0; t < sizeof spots / sizeof spots[0]; t++) {
        const aeo_real_t good = *spots[t];
        *spots[t] = t == 4 ? make_not_finite(0) : AEO_REAL(-1.1e6);
        TEST_ASSERT_FALSE(aeo_els_invariants_hold(&els));
        *spots[t] = good;
        TEST_ASSERT_TRUE(aeo_els_invariants_hold(&els));
    }
    els.wait++;
    TEST_ASSERT_FALSE(aeo_els_invariants_hold(&els));
    TEST_ASSERT_FALSE(aeo_els_invariants_hold(NULL));
}

static void null_and_reset_are_harmless(void)
{
    const aeo_els_config_t config = make_els_config(2);
    aeo_real_t theta[6];
    set_plant(0.5, 1, 0.3);
    start(&config);
    run(400);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_read(&els, theta, 6));
    TEST_ASSERT_EQUAL_MEMORY(aeo_els_theta(&els), theta, sizeof theta);
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_els_read(&els, theta, 5));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_read(NULL, theta, 6));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_els_read(&els, NULL, 6));
    aeo_els_reset(NULL);
    aeo_els_clear_health(NULL);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_els_health(NULL));
    els.health = AEO_ELS_LIMITED;
    els.rls.health = AEO_RLS_BOUNDED;
    aeo_els_reset(&els);
    TEST_ASSERT_EQUAL_UINT32(34, aeo_els_health(&els));
    aeo_els_clear_health(&els);
    TEST_ASSERT_EQUAL_UINT32(0, aeo_els_health(&els));
    TEST_ASSERT_EQUAL_UINT32(398, els.rls.count.updates);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(forgotten_feedback_is_told);
    RUN_TEST(lost_samples_are_no_forgotten_feedback);
    RUN_TEST(a_step_is_push_update_and_feedback);
    RUN_TEST(a_regressor_that_does_not_fit_is_refused);
    RUN_TEST(a_given_varx_is_started_from);
    RUN_TEST(a_start_needs_blocks);
    RUN_TEST(one_miss_behind_a_start_is_no_complaint);
    RUN_TEST(a_run_of_sixteen_waits_was_sound);
    RUN_TEST(without_blocks_no_feedback_is_missed);
    RUN_TEST(runaway_starts_from_varx);
    RUN_TEST(a_fall_back_drops_what_no_data_have);
    RUN_TEST(save_and_restore_go_on_in_every_phase);
    RUN_TEST(restore_names_what_is_wrong);
    RUN_TEST(settings_out_of_range_are_refused);
    RUN_TEST(invariants_notice_damage);
    RUN_TEST(null_and_reset_are_harmless);
    return UNITY_END();
}
