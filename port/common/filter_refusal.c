/* filter_refusal.c: the questions of filter_refusal.h, from sizes to single settings. */
#include "filter_refusal.h"

#include "method_names.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define CHANNELS_MAX ((unsigned)AEO_REGRESSOR_CHANNELS_MAX)
#define HALVINGS     30   /* of an interval of at most 1/2: to less than the rounding of binary32 */
#define SHOWN        1e-4 /* steps in which a least forgetting factor is told */

typedef struct {
    aeo_estimator_method_t method;
    aeo_real_t *memory;
    size_t words;
    aeo_channel_t plain[2u * CHANNELS_MAX];
} question_t;

static int takes(const question_t *self, const aeo_estimator_config_t *config)
{
    aeo_estimator_t trial;
    return aeo_estimator_init(&trial, self->method, config, self->memory, self->words) == AEO_OK;
}

/* Say what is wrong with the sizes; 0 where nothing is. */
static int explain_sizes(char *text, const aeo_estimator_config_t *config)
{
    const unsigned r = config->inputs, l = config->outputs, e = config->model_set == AEO_VARMAX ? 1u : 0u;
    const unsigned block = (unsigned)AEO_REGRESSOR_BLOCK(r, l, e);
    if (r > CHANNELS_MAX || l < 1u || l > CHANNELS_MAX) {
        return snprintf(text, FILTER_REFUSAL_MAX, "at most %u inputs and 1 ... %u outputs are filtered, not %u and %u",
                        CHANNELS_MAX, CHANNELS_MAX, r, l);
    }
    if (config->past < 1u || config->past * block + r > (unsigned)AEO_REGRESSOR_LENGTH_MAX) {
        return snprintf(text, FILTER_REFUSAL_MAX, "past = %u: with %u inputs and %u outputs%s it must be 1 ... %u",
                        (unsigned)config->past, r, l, e != 0u ? " of a VARMAX predictor" : "",
                        ((unsigned)AEO_REGRESSOR_LENGTH_MAX - r) / block);
    }
    if (r < 32u && config->feedthrough >> r != 0u) {
        return snprintf(text, FILTER_REFUSAL_MAX, "feedthrough names an input that does not exist; there are %u", r);
    }
    return 0;
}

/* Name the first channel that is refused beside others that are not; 0 where none is. */
static int explain_channel(char *text, const question_t *self, const aeo_estimator_config_t *harmless,
                           const aeo_channel_t *channels)
{
    for (unsigned i = 0; i < (unsigned)harmless->inputs + harmless->outputs; i++) {
        aeo_estimator_config_t config = *harmless;
        aeo_channel_t trial[2u * CHANNELS_MAX];
        memcpy(trial, self->plain, sizeof trial);
        trial[i] = channels[i];
        config.channels = trial;
        if (!takes(self, &config)) {
            return snprintf(text, FILTER_REFUSAL_MAX, "channel %.40s: its scale, offset or range is out of range",
                            channels[i].name != NULL ? channels[i].name : "without a name");
        }
    }
    return 0;
}

/* Say how much must be remembered, where the forgetting factor alone is refused; 0 where it is taken. */
static int explain_forgetting(char *text, unsigned method, const question_t *self,
                              const aeo_estimator_config_t *harmless, aeo_real_t forgetting)
{
    aeo_estimator_config_t config = *harmless;
    double refused = (double)forgetting, taken = 1.0, least;
    config.forgetting = forgetting;
    if (!(forgetting >= AEO_REAL(0.5) && forgetting < AEO_REAL(1)) || takes(self, &config)) {
        return 0;
    }
    for (unsigned i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (refused + taken);
        config.forgetting = (aeo_real_t)middle;
        if (takes(self, &config)) {
            taken = middle;
        } else {
            refused = middle;
        }
    }
    least = ceil(taken / SHOWN) * SHOWN; /* rounded up, so that what is told is taken */
    return snprintf(
        text, FILTER_REFUSAL_MAX,
        "forget = %g: a memory of %.4g samples is shorter than the %.4g that %s needs for %u regressors; raise "
        "forget to %.4f or more, or take rls%s",
        (double)forgetting, 1.0 / (1.0 - (double)forgetting), 1.0 / (1.0 - taken), method_name(method),
        (unsigned)aeo_estimator_regressors(harmless), least,
        method == (unsigned)AEO_METHOD_FAST_RLS ? " or lattice" : "");
}

void filter_refusal_explain(char text[FILTER_REFUSAL_MAX], unsigned method, const aeo_estimator_config_t *config,
                            aeo_real_t *memory, size_t words)
{
    question_t question;
    aeo_estimator_config_t harmless = *config;
    if (explain_sizes(text, config) != 0) {
        return;
    }
    if (memory == NULL) {
        (void)snprintf(text, FILTER_REFUSAL_MAX, "out of memory; choose a shorter past or fewer channels");
        return;
    }
    memset(&question, 0, sizeof question);
    question.method = method_of(method);
    question.memory = memory;
    question.words = words;
    for (unsigned i = 0; i < 2u * CHANNELS_MAX; i++) {
        question.plain[i].scale = AEO_REAL(1);
    }
    harmless.channels = question.plain;
    harmless.forgetting = AEO_REAL(1);
    if (takes(&question, &harmless) &&
        (explain_channel(text, &question, &harmless, config->channels) != 0 ||
         explain_forgetting(text, method, &question, &harmless, config->forgetting) != 0)) {
        return;
    }
    (void)snprintf(text, FILTER_REFUSAL_MAX,
                   "sample time, forget, regularize or varx samples out of range (regressor.h, the filter's header)");
}
/* SPDX-License-Identifier: MIT */
