/* replay.c: runs whole recordings through the filters, sample by sample as a controller would; called from Python.
 *
 * One structure carries everything, so the caller needs no other declaration. No allocation here either: the caller
 * asks aeo_replay_bytes and hands over that much memory, aligned for double.
 */
#include "method_names.h"

#include "aeolid/markov.h"

#if defined(__GNUC__)
#define EXPORTED __attribute__((visibility("default")))
#else
#define EXPORTED
#endif

/* Lengths: N samples, r inputs, l outputs, n regressors; all arrays by rows. */
typedef struct {
    uint64_t samples;        /* N */
    const double *u;         /* N x r, channel units */
    const double *y;         /* N x l */
    const uint64_t *time_us; /* N */
    const double *offset;    /* r + l */
    const double *scale;     /* r + l */
    const double *minimum;   /* r + l */
    const double *maximum;   /* r + l */
    uint32_t inputs, outputs, past, model_set, feedthrough, period_us;
    uint32_t method; /* aeo_method_t */
    double forgetting, regularisation, excitation_min, growth_max;
    uint32_t varx_samples; /* from here on for els only */
    double forgetting_start, forgetting_rate, guard_ratio;
    double *innovation;           /* N x l, channel units, a priori; untouched where no update took place */
    double *residual;             /* N x l, a posteriori */
    int8_t *status;               /* N, aeo_status_t of the sample */
    double *theta;                /* l x n, channel units */
    double *theta_scaled;         /* l x n */
    uint32_t regressors;          /* n, written */
    uint32_t health;              /* flags, written */
    uint32_t count[AEO_COUNTERS]; /* of aeo_counter_t */
} aeo_replay_t;

EXPORTED size_t aeo_replay_bytes(const aeo_replay_t *replay);
EXPORTED const char *aeo_replay_status_text(int status);
EXPORTED int aeo_replay_run(aeo_replay_t *replay, void *memory, size_t bytes);

/* What one replay keeps between samples, at the start of the caller's memory; words of the filters follow. */
typedef struct {
    aeo_estimator_t estimator;
    aeo_channel_t channel[AEO_REGRESSOR_CHANNELS_MAX * 2];
    aeo_real_t u[AEO_REGRESSOR_CHANNELS_MAX];
    aeo_real_t y[AEO_REGRESSOR_CHANNELS_MAX];
    double words[]; /* double only for its alignment */
} workspace_t;

static aeo_estimator_config_t describe(const aeo_replay_t *replay, const aeo_channel_t *channels)
{
    const aeo_estimator_config_t config = {
        .inputs = (uint16_t)replay->inputs,
        .outputs = (uint16_t)replay->outputs,
        .past = (uint16_t)replay->past,
        .model_set = (aeo_model_set_t)replay->model_set,
        .feedthrough = replay->feedthrough,
        .period_us = replay->period_us,
        .channels = channels,
        .forgetting = (aeo_real_t)replay->forgetting,
        .regularisation = (aeo_real_t)replay->regularisation,
        .excitation_min = (aeo_real_t)replay->excitation_min,
        .growth_max = (aeo_real_t)replay->growth_max,
        .varx_samples = replay->varx_samples,
        .forgetting_start = (aeo_real_t)replay->forgetting_start,
        .forgetting_rate = (aeo_real_t)replay->forgetting_rate,
        .guard_ratio = (aeo_real_t)replay->guard_ratio,
    };
    return config;
}

static size_t count_words(const aeo_replay_t *replay)
{
    const aeo_estimator_config_t config = describe(replay, NULL);
    const aeo_estimator_method_t method = method_of(replay->method);
    return method == NULL ? 0u : aeo_estimator_words(method, &config);
}

size_t aeo_replay_bytes(const aeo_replay_t *replay)
{
    return sizeof(workspace_t) + count_words(replay) * sizeof(aeo_real_t);
}

const char *aeo_replay_status_text(int status)
{
    return aeo_status_text((aeo_status_t)status);
}

static void narrow(const double *from, aeo_real_t *to, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        to[i] = (aeo_real_t)from[i];
    }
}

static aeo_status_t start(const aeo_replay_t *replay, workspace_t *work)
{
    for (size_t i = 0; i < (size_t)replay->inputs + replay->outputs; i++) {
        aeo_channel_t *const channel = &work->channel[i];
        channel->name = channel->unit = NULL;
        channel->offset = (aeo_real_t)replay->offset[i];
        channel->scale = (aeo_real_t)replay->scale[i];
        channel->minimum = (aeo_real_t)replay->minimum[i];
        channel->maximum = (aeo_real_t)replay->maximum[i];
    }
    const aeo_estimator_config_t config = describe(replay, work->channel);
    return aeo_estimator_init(&work->estimator, method_of(replay->method), &config, (aeo_real_t *)work->words,
                              count_words(replay));
}

static aeo_status_t step(const aeo_replay_t *replay, workspace_t *work, size_t k)
{
    const size_t r = replay->inputs, l = replay->outputs;
    narrow(replay->u + k * r, work->u, r);
    narrow(replay->y + k * l, work->y, l);
    const aeo_status_t status = aeo_estimator_take(&work->estimator, work->u, work->y, replay->time_us[k]);
    if (status != AEO_OK) {
        return status;
    }
    for (size_t i = 0; i < l; i++) {
        const double scale = (double)work->channel[r + i].scale;
        replay->innovation[k * l + i] = (double)aeo_estimator_innovation(&work->estimator)[i] * scale;
        replay->residual[k * l + i] = (double)aeo_estimator_residual(&work->estimator)[i] * scale;
    }
    return AEO_OK;
}

static aeo_status_t read_out(aeo_replay_t *replay, workspace_t *work)
{
    const aeo_real_t *theta = aeo_estimator_theta(&work->estimator);
    const aeo_regressor_t *const layout = &work->estimator.regressor;
    const size_t count = AEO_MARKOV_WORDS(layout->length, replay->outputs);
    if (theta == NULL) {
        return AEO_E_RANGE;
    }
    for (size_t i = 0; i < count; i++) {
        replay->theta_scaled[i] = (double)theta[i];
        replay->theta[i] = (double)aeo_markov_at(layout, theta, i);
    }
    replay->regressors = layout->length;
    replay->health = aeo_estimator_health(&work->estimator);
    for (unsigned i = 0; i < AEO_COUNTERS; i++) {
        replay->count[i] = aeo_estimator_count(&work->estimator, (aeo_counter_t)i);
    }
    return AEO_OK;
}

int aeo_replay_run(aeo_replay_t *replay, void *memory, size_t bytes)
{
    if (replay == NULL || memory == NULL) {
        return AEO_E_ARG;
    }
    if (replay->inputs > AEO_REGRESSOR_CHANNELS_MAX || replay->outputs > AEO_REGRESSOR_CHANNELS_MAX) {
        return AEO_E_ARG;
    }
    if (bytes < aeo_replay_bytes(replay)) {
        return AEO_E_MEMORY;
    }
    workspace_t *work = memory;
    const aeo_status_t status = start(replay, work);
    if (status != AEO_OK) {
        return status;
    }
    for (uint64_t k = 0; k < replay->samples; k++) {
        replay->status[k] = (int8_t)step(replay, work, (size_t)k);
    }
    return read_out(replay, work);
}
/* SPDX-License-Identifier: MIT */
