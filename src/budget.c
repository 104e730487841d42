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
static aeo_real_t cost_sample_us(const aeo_stream_config_t *config)
{
    const unsigned outputs = config->innovations != 0u ? config->outputs : 0u;
    if (config->sample_every == 0u) {
        return AEO_REAL(0);
    }
    return (aeo_real_t)(cost_values_us(config, aeo_describe_channels(config)) + cost_values_us(config, outputs));
}

static aeo_real_t count_description(const aeo_stream_config_t *config)
{
    const uint32_t slots = aeo_describe_slots(config);
    uint32_t slot, frames = 0;
    aeo_message_t message;
    for (slot = 0; slot < slots; slot++) {
        frames += aeo_describe(config, 0, slot, &message) ? 1u : 0u;
    }
    return (aeo_real_t)frames;
}

static load_t cost_snapshot(const aeo_stream_config_t *config, const aeo_spread_t *spread)
{
    const aeo_real_t blocks = (aeo_real_t)spread->count + (aeo_real_t)spread->repairs;
    const load_t load = {blocks * (aeo_real_t)aeo_budget_longest_us(config) +
                             AEO_REAL(4) * (aeo_real_t)aeo_stream_cost_us(config, 8),
                         blocks + AEO_REAL(4)};
    return load;
}

/* Of a step's credit, what the cap of one burst leaves. */
static aeo_real_t find_usable_us(const aeo_stream_config_t *config)
{
    const uint32_t period = aeo_budget_period_us(config), longest = aeo_budget_longest_us(config);
    uint32_t whole;
    if (longest == 0u || period <= (config->burst - 1u) * longest) { /* 255 10^6 < 2^32 */
        return (aeo_real_t)period;
    }
    if (period < longest) { /* burst is 1: a frame every so many steps */
        return (aeo_real_t)longest / (aeo_real_t)((longest + period - 1u) / period); /* period >= 20 */
    }
    whole = period / longest;
    return (aeo_real_t)(whole < config->burst ? whole : config->burst) * (aeo_real_t)longest;
}

uint32_t aeo_budget_find_steps(const aeo_stream_config_t *config, const aeo_spread_t *spread)
{
    const aeo_real_t period = (aeo_real_t)aeo_budget_period_us(config), sample = cost_sample_us(config);
    const aeo_real_t every = (aeo_real_t)(config->sample_every > 0u ? config->sample_every : 1u);
    const aeo_real_t frame = (aeo_real_t)aeo_stream_cost_us(config, 8), share = sample / every / period;
    const aeo_real_t usable = find_usable_us(config), rest = usable * (AEO_REAL(1) - share);
    const aeo_real_t burst = (aeo_real_t)config->burst;
    const load_t snapshot = cost_snapshot(config, spread);
    const aeo_real_t description = count_description(config);
    const aeo_real_t frames =
        AEO_REAL(1) / (aeo_real_t)config->health_every + description / (aeo_real_t)config->describe_every;
    /* a short frame, too, needs credit for the longest, and where the cap cuts, the rest of that is lost */
    const aeo_real_t longest = (aeo_real_t)aeo_budget_longest_us(config);
    const aeo_real_t owed = description * longest + AEO_REAL(OWED) * (sample + frame + longest);
    aeo_real_t steps, in_frames;
    if (frames * frame > rest - usable * (AEO_REAL(1) - MOST_USED) || frames > MOST_USED * burst) {
        return 0;
    }
    steps = (snapshot.us + owed) / (rest - frames * frame); /* at least a tenth of what is usable, which is above 0 */
    in_frames = (snapshot.frames + description + AEO_REAL(OWED)) / (burst - frames);
    steps = (steps > in_frames ? steps : in_frames) + AEO_REAL(2);
    return (uint32_t)(steps < STEPS_MAX ? steps : STEPS_MAX);
}
