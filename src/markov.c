/* markov.c: undoes the scales of regressor.h at read-out. */
#include "aeolid/markov.h"

#include "linalg.h"

/* The channel of entry j of a valid layout; present inputs follow the last block, lowest set bit of the mask first. */
static int find_channel(const aeo_regressor_t *layout, unsigned j)
{
    const unsigned past = (unsigned)layout->past * layout->block_length;
    if (j < past) {
        return (int)(j % layout->block_length);
    }
    unsigned left = j - past;
    for (unsigned i = 0; i < layout->inputs; i++) {
        if ((layout->feedthrough >> i & 1u) != 0u) {
            if (left == 0u) {
                return (int)i;
            }
            left--;
        }
    }
    return -1;
}

static aeo_real_t unscale(const aeo_regressor_t *layout, const aeo_real_t *theta, unsigned i, unsigned j)
{
    const unsigned channels = (unsigned)layout->inputs + layout->outputs;
    const size_t index = (size_t)i * layout->length + j;
    unsigned channel = (unsigned)find_channel(layout, j);
    if (channel >= channels) {
        channel -= layout->outputs; /* an innovation is scaled like its output */
    }
    /* inverse > 0 for every channel: init took scale finite, above 0 and with a finite reciprocal above 0. */
    return theta[index] * layout->inverse[channel] / layout->inverse[layout->inputs + i];
}

int aeo_markov_channel(const aeo_regressor_t *layout, uint16_t j)
{
    if (layout == NULL || j >= layout->length) {
        return -1;
    }
    return find_channel(layout, j);
}

aeo_status_t aeo_markov_read(const aeo_regressor_t *layout, const aeo_real_t *theta, aeo_real_t *markov, size_t length)
{
    if (layout == NULL || theta == NULL || markov == NULL) {
        return AEO_E_ARG;
    }
    if (length < AEO_MARKOV_WORDS(layout->length, layout->outputs)) {
        return AEO_E_MEMORY;
    }
    for (unsigned i = 0; i < layout->outputs; i++) {
        for (unsigned j = 0; j < layout->length; j++) {
            markov[(size_t)i * layout->length + j] = unscale(layout, theta, i, j);
        }
    }
    return AEO_OK;
}

aeo_status_t aeo_markov_read_scaled(const aeo_regressor_t *layout, const aeo_real_t *theta, aeo_real_t *markov,
                                    size_t length)
{
    if (layout == NULL || theta == NULL) {
        return AEO_E_ARG;
    }
    return aeo_linalg_copy_out(theta, AEO_MARKOV_WORDS(layout->length, layout->outputs), markov, length);
}

aeo_real_t aeo_markov_at(const aeo_regressor_t *layout, const aeo_real_t *theta, size_t index)
{
    if (layout == NULL || theta == NULL || index >= AEO_MARKOV_WORDS(layout->length, layout->outputs)) {
        return AEO_REAL(0);
    }
    return unscale(layout, theta, (unsigned)(index / layout->length), (unsigned)(index % layout->length));
}
/* SPDX-License-Identifier: MIT */
