#include "budget.h"

#include "describe.h"
#include "stream_send.h"

#define MOST_USED AEO_REAL(0.9)
#define STEPS_MAX AEO_REAL(4e9)
#define OWED      2u /* samples whose debt a snapshot may meet, and longest frames that credit may lack */

/* Time on the bus and frames. */
typedef struct {
    aeo_real_t us, frames;
} load_t;

uint32_t aeo_budget_period_us(const aeo_stream_config_t *config)
{
    return (uint32_t)(config->sample_time_s * AEO_REAL(1e6) + AEO_REAL(0.5)); /* at most 10^9 */
}

uint32_t aeo_budget_longest_us(const aeo_stream_config_t *config)
{
    const uint32_t classic = aeo_stream_cost_us(config, 8);
    const uint32_t fd = config->fd != 0u ? aeo_stream_cost_us(config, 64) : 0u;
    return fd > classic ? fd : classic;
}

/* Time on the bus of `values` values of one sample; at most 65 frames of a second. */
static uint32_t cost_values_us(const aeo_stream_config_t *config, unsigned values)
{
    const unsigned rest = values % AEO_FRAME_VALUES_MAX;
    if (values == 0u) {
        return 0;
    }
    if (config->fd == 0u) {
        return (values + (config->seal != 0u ? 1u : 0u)) * aeo_stream_cost_us(config, 8);
    }
    return values / AEO_FRAME_VALUES_MAX * aeo_stream_cost_us(config, 64) +
           (rest > 0u ? aeo_stream_cost_us(config, AEO_FRAME_FD_LENGTH(rest)) : 0u);
}

/* One sample with its innovations and seals; 0 when none are sent. */
static uint32_t cost_sample_us(const aeo_stream_config_t *config)
{
    const unsigned outputs = config->innovations != 0u ? config->outputs : 0u;
    if (config->sample_every == 0u) {
        return 0;
    }
    return cost_values_us(config, aeo_describe_channels(config)) + cost_values_us(config, outputs);
}

uint32_t aeo_budget_count_description(const aeo_stream_config_t *config)
{
    const uint32_t slots = aeo_describe_slots(config);
    uint32_t slot, frames = 0;
    aeo_message_t message;
    for (slot = 0; slot < slots; slot++) {
        frames += aeo_describe(config, 0, slot, &message) ? 1u : 0u;
    }
    return frames;
}

static load_t cost_snapshot(const aeo_stream_config_t *config, const aeo_spread_t *spread)
{
    const aeo_real_t blocks = (aeo_real_t)spread->count + (aeo_real_t)spread->repairs;
    const load_t load = {blocks * (aeo_real_t)aeo_budget_longest_us(config) +
                             AEO_REAL(4) * (aeo_real_t)aeo_budget_longest_us(config),
                         blocks + AEO_REAL(4)};
    return load;
}

/* 1 when one step may earn more than the cap of one burst keeps. */
static int is_cut(const aeo_stream_config_t *config)
{
    return aeo_budget_period_us(config) > (config->burst - 1u) * aeo_budget_longest_us(config) && /* 255 10^6 < 2^32 */
           aeo_budget_longest_us(config) > 0u;
}

/* Of so much credit a step, what leaves where the cap cuts: whole frames, or one every so many steps. */
static aeo_real_t cut(const aeo_stream_config_t *config, uint32_t earned)
{
    const uint32_t longest = aeo_budget_longest_us(config), whole = earned / longest; /* cut only: longest >= 1 */
    if (earned == 0u) {
        return AEO_REAL(0);
    }
    if (whole == 0u) {
        return (aeo_real_t)longest / (aeo_real_t)((longest + earned - 1u) / earned);
    }
    return (aeo_real_t)(whole < config->burst ? whole : config->burst) * (aeo_real_t)longest;
}

/* Of a step's credit, what samples leave on average. Where the cap cuts, the steps that pay for a sample send nothing
 * else, the last of them in part. */
static aeo_real_t find_rest_us(const aeo_stream_config_t *config, uint32_t sample)
{
    const uint32_t period = aeo_budget_period_us(config), every = config->sample_every > 0u ? config->sample_every : 1u;
    const uint32_t paying = (sample + period - 1u) / period; /* 1.3e8 + 10^9 < 2^32 */
    if (!is_cut(config)) {
        return (aeo_real_t)period - (aeo_real_t)sample / (aeo_real_t)every;
    }
    if (every == 1u) {
        return cut(config, sample < period ? period - sample : 0u);
    }
    return paying < every ? cut(config, period) * (aeo_real_t)(every - paying) / (aeo_real_t)every : AEO_REAL(0);
}

uint32_t aeo_budget_find_steps(const aeo_stream_config_t *config, const aeo_spread_t *spread, uint32_t slots)
{
    const uint32_t sample = cost_sample_us(config), period = aeo_budget_period_us(config);
    const aeo_real_t longest = (aeo_real_t)aeo_budget_longest_us(config), burst = (aeo_real_t)config->burst;
    /* a short frame, too, needs credit for the longest, and where the cap cuts, the rest of that is lost */
    const aeo_real_t each = is_cut(config) ? longest : (aeo_real_t)aeo_stream_cost_us(config, 8);
    const aeo_real_t usable = is_cut(config) ? cut(config, period) : (aeo_real_t)period;
    const load_t snapshot = cost_snapshot(config, spread);
    const aeo_real_t description = (aeo_real_t)slots;
    const aeo_real_t frames =
        AEO_REAL(1) / (aeo_real_t)config->health_every + description / (aeo_real_t)config->describe_every;
    const aeo_real_t left = find_rest_us(config, sample) - frames * each;
    const aeo_real_t every = (aeo_real_t)(config->sample_every > 0u ? config->sample_every : 1u);
    const aeo_real_t share = (aeo_real_t)sample / every + frames * (aeo_real_t)aeo_stream_cost_us(config, 8);
    const aeo_real_t owed = description * longest + AEO_REAL(OWED) * ((aeo_real_t)sample + AEO_REAL(2) * longest);
    aeo_real_t steps, in_frames;
    if (share > MOST_USED * (aeo_real_t)period || left < usable * (AEO_REAL(1) - MOST_USED) ||
        frames > MOST_USED * burst) {
        return 0;
    }
    steps = (snapshot.us + owed) / left; /* at least a tenth of what is usable, which is above 0 */
    in_frames = (snapshot.frames + description + AEO_REAL(OWED)) / (burst - frames);
    steps = (steps > in_frames ? steps : in_frames) + AEO_REAL(2);
    return (uint32_t)(steps < STEPS_MAX ? steps : STEPS_MAX);
}
/* SPDX-License-Identifier: MIT */
