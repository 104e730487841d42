/* Every function refuses each null pointer that it must not get, one at a time, with all else as it should be. */
#include "aeolid/els.h"
#include "aeolid/estimator.h"
#include "aeolid/fast_rls.h"
#include "aeolid/frame.h"
#include "aeolid/lattice.h"
#include "aeolid/markov.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"
#include "fake_bus.h"
#include "unity.h"

#include <string.h>

enum { WORDS = 4000 };

static aeo_real_t memory[WORDS], other[WORDS], z[16], e[4], out[WORDS];
static aeo_rls_t rls;
static aeo_els_t els;
static aeo_fast_rls_t fast;
static aeo_lattice_t lattice, copy;
static aeo_regressor_t window;
static aeo_estimator_t estimator;

void setUp(void)
{
    set_up_bus();
}

void tearDown(void)
{
    tear_down_bus();
}

#define REFUSED(call) TEST_ASSERT_EQUAL_INT(AEO_E_ARG, (call))
#define DONE(call)    TEST_ASSERT_EQUAL_INT(AEO_OK, (call))

static void rls_refuses_nulls(void)
{
    const aeo_rls_config_t config = {3, 1, AEO_REAL(0.99), AEO_REAL(1), AEO_REAL(0), AEO_REAL(100)};
    REFUSED(aeo_rls_init(NULL, &config, memory, WORDS));
    REFUSED(aeo_rls_init(&rls, NULL, memory, WORDS));
    REFUSED(aeo_rls_init(&rls, &config, NULL, WORDS));
    DONE(aeo_rls_init(&rls, &config, memory, WORDS));
    REFUSED(aeo_rls_start(NULL, z));
    REFUSED(aeo_rls_start(&rls, NULL));
    REFUSED(aeo_rls_set_forgetting(NULL, AEO_REAL(0.9)));
    REFUSED(aeo_rls_update(NULL, z, e));
    REFUSED(aeo_rls_update(&rls, NULL, e));
    REFUSED(aeo_rls_update(&rls, z, NULL));
    REFUSED(aeo_rls_read(NULL, out, WORDS));
    REFUSED(aeo_rls_read(&rls, NULL, WORDS));
    REFUSED(aeo_rls_save(NULL, out, WORDS));
    REFUSED(aeo_rls_save(&rls, NULL, WORDS));
    DONE(aeo_rls_save(&rls, out, WORDS));
    REFUSED(aeo_rls_restore(NULL, out, WORDS));
    REFUSED(aeo_rls_restore(&rls, NULL, WORDS));
    aeo_rls_reset(NULL);
    aeo_rls_clear_health(NULL);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_rls_health(NULL));
    TEST_ASSERT_FALSE(aeo_rls_invariants_hold(NULL));
    TEST_ASSERT_EQUAL_UINT32(0, rls.count.updates + rls.count.rejected);
}

static void els_refuses_nulls(void)
{
    const aeo_els_config_t config = {.regressors = 3,
                                     .outputs = 1,
                                     .past = 1,
                                     .forgetting = AEO_REAL(0.99),
                                     .forgetting_start = AEO_REAL(0.99),
                                     .regularisation = AEO_REAL(1),
                                     .growth_max = AEO_REAL(100)};
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = 1, .past = 1, .model_set = AEO_VARMAX, .period_us = 10};
    REFUSED(aeo_els_init(NULL, &config, memory, WORDS));
    REFUSED(aeo_els_init(&els, NULL, memory, WORDS));
    REFUSED(aeo_els_init(&els, &config, NULL, WORDS));
    DONE(aeo_els_init(&els, &config, memory, WORDS));
    DONE(aeo_regressor_init(&window, &layout, other, WORDS));
    REFUSED(aeo_els_start(NULL, z));
    REFUSED(aeo_els_start(&els, NULL));
    REFUSED(aeo_els_update(NULL, z, e));
    REFUSED(aeo_els_update(&els, NULL, e));
    REFUSED(aeo_els_update(&els, z, NULL));
    REFUSED(aeo_els_step(NULL, &window, z, e, 10));
    REFUSED(aeo_els_step(&els, NULL, z, e, 10));
    REFUSED(aeo_els_step(&els, &window, NULL, e, 10));
    REFUSED(aeo_els_step(&els, &window, z, NULL, 10));
    REFUSED(aeo_els_read(NULL, out, WORDS));
    REFUSED(aeo_els_read(&els, NULL, WORDS));
    REFUSED(aeo_els_save(NULL, out, WORDS));
    REFUSED(aeo_els_save(&els, NULL, WORDS));
    DONE(aeo_els_save(&els, out, WORDS));
    REFUSED(aeo_els_restore(NULL, out, WORDS));
    REFUSED(aeo_els_restore(&els, NULL, WORDS));
    aeo_els_reset(NULL);
    aeo_els_clear_health(NULL);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_els_health(NULL));
    TEST_ASSERT_FALSE(aeo_els_invariants_hold(NULL));
}

static void fast_rls_refuses_nulls(void)
{
    const aeo_fast_rls_config_t config = {.past = 2,
                                          .block = 2,
                                          .outputs = 1,
                                          .forgetting = AEO_REAL(0.99),
                                          .regularisation = AEO_REAL(1),
                                          .growth_max = AEO_REAL(100)};
    REFUSED(aeo_fast_rls_init(NULL, &config, memory, WORDS));
    REFUSED(aeo_fast_rls_init(&fast, NULL, memory, WORDS));
    REFUSED(aeo_fast_rls_init(&fast, &config, NULL, WORDS));
    DONE(aeo_fast_rls_init(&fast, &config, memory, WORDS));
    REFUSED(aeo_fast_rls_update(NULL, z, e));
    REFUSED(aeo_fast_rls_update(&fast, NULL, e));
    REFUSED(aeo_fast_rls_update(&fast, z, NULL));
    REFUSED(aeo_fast_rls_read(NULL, out, WORDS));
    REFUSED(aeo_fast_rls_read(&fast, NULL, WORDS));
    REFUSED(aeo_fast_rls_save(NULL, out, WORDS));
    REFUSED(aeo_fast_rls_save(&fast, NULL, WORDS));
    DONE(aeo_fast_rls_save(&fast, out, WORDS));
    REFUSED(aeo_fast_rls_restore(NULL, out, WORDS));
    REFUSED(aeo_fast_rls_restore(&fast, NULL, WORDS));
    aeo_fast_rls_reset(NULL);
    aeo_fast_rls_clear_health(NULL);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_fast_rls_health(NULL));
    TEST_ASSERT_FALSE(aeo_fast_rls_invariants_hold(NULL));
}

static void the_lattice_refuses_nulls(void)
{
    const aeo_lattice_config_t config = {.past = 2,
                                         .block = 2,
                                         .outputs = 1,
                                         .forgetting = AEO_REAL(0.99),
                                         .regularisation = AEO_REAL(1),
                                         .growth_max = AEO_REAL(100)};
    REFUSED(aeo_lattice_init(NULL, &config, memory, WORDS));
    REFUSED(aeo_lattice_init(&lattice, NULL, memory, WORDS));
    REFUSED(aeo_lattice_init(&lattice, &config, NULL, WORDS));
    DONE(aeo_lattice_init(&lattice, &config, memory, WORDS));
    REFUSED(aeo_lattice_copy(NULL, &copy, other, WORDS));
    REFUSED(aeo_lattice_copy(&lattice, NULL, other, WORDS));
    REFUSED(aeo_lattice_copy(&lattice, &copy, NULL, WORDS));
    REFUSED(aeo_lattice_update(NULL, z, e));
    REFUSED(aeo_lattice_update(&lattice, NULL, e));
    REFUSED(aeo_lattice_update(&lattice, z, NULL));
    REFUSED(aeo_lattice_read(NULL, out, WORDS));
    REFUSED(aeo_lattice_read(&lattice, NULL, WORDS));
    REFUSED(aeo_lattice_read_next(NULL, out, WORDS));
    REFUSED(aeo_lattice_read_next(&lattice, NULL, WORDS));
    REFUSED(aeo_lattice_save(NULL, out, WORDS));
    REFUSED(aeo_lattice_save(&lattice, NULL, WORDS));
    DONE(aeo_lattice_save(&lattice, out, WORDS));
    REFUSED(aeo_lattice_restore(NULL, out, WORDS));
    REFUSED(aeo_lattice_restore(&lattice, NULL, WORDS));
    aeo_lattice_reset(NULL);
    aeo_lattice_clear_health(NULL);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_lattice_health(NULL));
    TEST_ASSERT_FALSE(aeo_lattice_invariants_hold(NULL));
}

static void window_and_read_out_refuse_nulls(void)
{
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = 1, .past = 1, .model_set = AEO_VARMAX, .period_us = 10};
    REFUSED(aeo_regressor_init(NULL, &layout, memory, WORDS));
    REFUSED(aeo_regressor_init(&window, NULL, memory, WORDS));
    REFUSED(aeo_regressor_init(&window, &layout, NULL, WORDS));
    DONE(aeo_regressor_init(&window, &layout, memory, WORDS));
    REFUSED(aeo_regressor_push(NULL, z, e, 10));
    REFUSED(aeo_regressor_push(&window, NULL, e, 10));
    REFUSED(aeo_regressor_push(&window, z, NULL, 10));
    REFUSED(aeo_regressor_set_innovation(&window, e)); /* of no sample */
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_regressor_push(&window, z, e, 10));
    REFUSED(aeo_regressor_set_innovation(NULL, e));
    REFUSED(aeo_regressor_set_innovation(&window, NULL));
    DONE(aeo_regressor_set_innovation(&window, e));
    REFUSED(aeo_regressor_save(NULL, out, WORDS));
    REFUSED(aeo_regressor_save(&window, NULL, WORDS));
    DONE(aeo_regressor_save(&window, out, WORDS));
    REFUSED(aeo_regressor_restore(NULL, out, WORDS));
    REFUSED(aeo_regressor_restore(&window, NULL, WORDS));
    aeo_regressor_reset(NULL);
    TEST_ASSERT_FALSE(aeo_regressor_invariants_hold(NULL));
    REFUSED(aeo_markov_read(NULL, z, out, WORDS));
    REFUSED(aeo_markov_read(&window, NULL, out, WORDS));
    REFUSED(aeo_markov_read(&window, z, NULL, WORDS));
    REFUSED(aeo_markov_read_scaled(NULL, z, out, WORDS));
    REFUSED(aeo_markov_read_scaled(&window, NULL, out, WORDS));
    REFUSED(aeo_markov_read_scaled(&window, z, NULL, WORDS));
    TEST_ASSERT_TRUE(aeo_markov_at(NULL, z, 0) <= AEO_REAL(0));
    TEST_ASSERT_TRUE(aeo_markov_at(&window, NULL, 0) <= AEO_REAL(0));
    TEST_ASSERT_EQUAL_INT(-1, aeo_markov_channel(NULL, 0));
}

static void the_estimator_refuses_nulls(void)
{
    static const aeo_channel_t own[2] = {{.scale = AEO_REAL(1)}, {.scale = AEO_REAL(1)}};
    const aeo_estimator_config_t config = {.inputs = 1,
                                           .outputs = 1,
                                           .past = 2,
                                           .period_us = 1000,
                                           .channels = own,
                                           .forgetting = AEO_REAL(0.99),
                                           .regularisation = AEO_REAL(1),
                                           .growth_max = AEO_REAL(100)};
    aeo_estimator_config_t bare = config;
    aeo_stream_config_t bus;
    bare.channels = NULL;
    memset(&bus, 0, sizeof bus);
    bus.health_every = bus.describe_every = 100;
    bus.burst = 2;
    bus.address.base = AEO_FRAME_BASE_EXTENDED;
    bus.address.extended = 1;
    REFUSED(aeo_estimator_init(NULL, aeo_estimator_rls, &config, memory, WORDS));
    REFUSED(aeo_estimator_init(&estimator, NULL, &config, memory, WORDS));
    REFUSED(aeo_estimator_init(&estimator, aeo_estimator_rls, NULL, memory, WORDS));
    REFUSED(aeo_estimator_init(&estimator, aeo_estimator_rls, &config, NULL, WORDS));
    REFUSED(aeo_estimator_init(&estimator, aeo_estimator_rls, &bare, memory, WORDS));
    DONE(aeo_estimator_init(&estimator, aeo_estimator_rls, &config, memory, WORDS));
    REFUSED(aeo_estimator_announce(NULL, &stream, &bus, &port, words, PARAMETERS_MAX));
    REFUSED(aeo_estimator_announce(&estimator, NULL, &bus, &port, words, PARAMETERS_MAX));
    REFUSED(aeo_estimator_announce(&estimator, &stream, NULL, &port, words, PARAMETERS_MAX));
    REFUSED(aeo_estimator_announce(&estimator, &stream, &bus, NULL, words, PARAMETERS_MAX));
    REFUSED(aeo_estimator_announce(&estimator, &stream, &bus, &port, NULL, PARAMETERS_MAX));
    DONE(aeo_estimator_announce(&estimator, &stream, &bus, &port, words, PARAMETERS_MAX));
    REFUSED(aeo_estimator_take(NULL, z, e, 1000));
    REFUSED(aeo_estimator_take(&estimator, NULL, e, 1000));
    REFUSED(aeo_estimator_take(&estimator, z, NULL, 1000));
    REFUSED(aeo_estimator_send(NULL, &stream, 0, z, e, NULL, 1000));
    REFUSED(aeo_estimator_send(&estimator, NULL, 0, z, e, NULL, 1000));
    REFUSED(aeo_estimator_send(&estimator, &stream, 0, z, NULL, NULL, 2000));
    REFUSED(aeo_estimator_snapshot(NULL, &stream, 0));
    REFUSED(aeo_estimator_snapshot(&estimator, NULL, 0));
    REFUSED(aeo_estimator_save(NULL, out, WORDS));
    REFUSED(aeo_estimator_save(&estimator, NULL, WORDS));
    DONE(aeo_estimator_save(&estimator, out, WORDS));
    REFUSED(aeo_estimator_restore(NULL, out, WORDS));
    REFUSED(aeo_estimator_restore(&estimator, NULL, WORDS));
    aeo_estimator_reset(NULL);
    TEST_ASSERT_EQUAL_size_t(0, aeo_estimator_regressors(NULL));
    TEST_ASSERT_NULL(aeo_estimator_theta(NULL));
}

static void streams_and_frames_refuse_nulls(void)
{
    aeo_stream_config_t config = make_config();
    aeo_can_frame_t frame;
    aeo_message_t message;
    uint8_t node;
    aeo_port_t half = port;
    half.unlock = NULL;
    REFUSED(aeo_stream_init(&stream, &config, &half, words, PARAMETERS_MAX));
    half = port;
    half.lock = NULL;
    REFUSED(aeo_stream_init(&stream, &config, &half, words, PARAMETERS_MAX));
    half = port;
    half.send = NULL;
    REFUSED(aeo_stream_init(&stream, &config, &half, words, PARAMETERS_MAX));
    REFUSED(aeo_stream_init(NULL, &config, &port, words, PARAMETERS_MAX));
    REFUSED(aeo_stream_init(&stream, NULL, &port, words, PARAMETERS_MAX));
    REFUSED(aeo_stream_init(&stream, &config, NULL, words, PARAMETERS_MAX));
    REFUSED(aeo_stream_init(&stream, &config, &port, NULL, PARAMETERS_MAX));
    config.channels = NULL;
    REFUSED(aeo_stream_init(&stream, &config, &port, words, PARAMETERS_MAX));
    config = make_config();
    config.past = 0;
    config.inputs = 1;
    config.scheduling = 1;
    config.feedthrough = 0;
    DONE(aeo_stream_init(&stream, &config, &port, words, PARAMETERS_MAX));
    REFUSED(aeo_stream_snapshot(NULL, 0, theta));
    REFUSED(aeo_stream_snapshot(&stream, 0, NULL));
    REFUSED(aeo_stream_sample(NULL, 0, u, y, u));
    REFUSED(aeo_stream_sample(&stream, 0, NULL, y, u));
    REFUSED(aeo_stream_sample(&stream, 0, u, NULL, u));
    REFUSED(aeo_stream_sample(&stream, 0, u, y, NULL));
    REFUSED(aeo_stream_innovation(NULL, 0, y));
    REFUSED(aeo_stream_innovation(&stream, 0, NULL));
    REFUSED(aeo_stream_health(NULL, 0, NULL, 0));
    REFUSED(aeo_stream_health(&stream, 0, NULL, 1));
    REFUSED(aeo_stream_step(NULL));
    aeo_stream_reset(NULL);
    aeo_stream_finish(NULL);
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(NULL));
    memset(&message, 0, sizeof message);
    message.kind = AEO_KIND_HEALTH;
    message.count = 1;
    REFUSED(aeo_frame_pack(NULL, &message, &frame));
    REFUSED(aeo_frame_pack(&config.address, NULL, &frame));
    REFUSED(aeo_frame_pack(&config.address, &message, NULL));
    DONE(aeo_frame_pack(&config.address, &message, &frame));
    REFUSED(aeo_frame_unpack(NULL, &frame, &message, &node));
    REFUSED(aeo_frame_unpack(&config.address, NULL, &message, &node));
    REFUSED(aeo_frame_unpack(&config.address, &frame, NULL, &node));
    REFUSED(aeo_frame_unpack(&config.address, &frame, &message, NULL));
    DONE(aeo_frame_unpack(&config.address, &frame, &message, &node));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(rls_refuses_nulls);
    RUN_TEST(els_refuses_nulls);
    RUN_TEST(fast_rls_refuses_nulls);
    RUN_TEST(the_lattice_refuses_nulls);
    RUN_TEST(window_and_read_out_refuse_nulls);
    RUN_TEST(the_estimator_refuses_nulls);
    RUN_TEST(streams_and_frames_refuse_nulls);
    return UNITY_END();
}
