/* fuzz.c: any bytes at all as a saved state, as a configuration and as samples: no filter may read or write outside its
 * memory, compute what C does not define, accept a state that breaks its invariants, or change on a refusal.
 *
 * The first byte chooses the filter, the second what is fuzzed, the third the size; the rest are numbers. Built with
 * clang -fsanitize=fuzzer,address,undefined by tests/gates/fuzz.py. */
#include "family.h"
#include "saved.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WORDS_MAX = 1 << 20 };

static const family_size_t SIZES[] = {{1, 1, 1, 0}, {1, 1, 2, 1}, {2, 1, 3, 2}, {2, 3, 2, 1}};

/* What is fuzzed, read front to back; zeros when it is exhausted. */
typedef struct {
    const uint8_t *data;
    size_t left;
} input_t;

static unsigned take_byte(input_t *input)
{
    if (input->left == 0) {
        return 0;
    }
    input->left--;
    return *input->data++;
}

static void take(input_t *input, void *to, size_t bytes)
{
    const size_t given = bytes < input->left ? bytes : input->left;
    memset(to, 0, bytes);
    if (given > 0) {
        memcpy(to, input->data, given);
        input->data += given;
        input->left -= given;
    }
}

static void demand(int holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "%s\n", what);
        abort();
    }
}

/* A filter in memory of exactly its length, so that the sanitizer sees one word too far. */
typedef struct {
    const family_filter_t *filter;
    family_size_t size;
    family_object_t object;
    aeo_real_t *memory;
    size_t words;
} subject_t;

static void *allocate(size_t bytes)
{
    void *memory = malloc(bytes);
    demand(memory != NULL, "no memory");
    memset(memory, 0, bytes);
    return memory;
}

static int start(subject_t *subject, family_settings_t settings)
{
    const size_t words = subject->filter->words(subject->size); /* of sizes out of range: any number */
    subject->words = words <= WORDS_MAX ? words : 1u;
    subject->memory = allocate(subject->words * sizeof *subject->memory);
    return subject->filter->init(&subject->object, subject->size, settings, subject->memory, subject->words) == AEO_OK;
}

/* Feed count samples made of the input, or of small numbers once it is exhausted. */
static void feed(subject_t *subject, input_t *input, unsigned count)
{
    const size_t n = family_regressors(subject->filter, subject->size), l = subject->size.outputs;
    aeo_real_t *z = allocate(n * sizeof *z), *y = allocate(l * sizeof *y);
    for (unsigned k = 0; k < count; k++) {
        take(input, z, n * sizeof *z);
        take(input, y, l * sizeof *y);
        const aeo_status_t status = subject->filter->update(&subject->object, z, y);
        demand(status == AEO_OK || status == AEO_E_NOT_FINITE || status == AEO_E_RANGE, "an unknown code of update");
        demand(subject->filter->invariants_hold(&subject->object), "invariants broken by samples");
    }
    free(z);
    free(y);
}

/* Restore from a good state with some words overwritten, or from arbitrary words. */
static void fuzz_restore(subject_t *subject, input_t *input)
{
    const family_filter_t *filter = subject->filter;
    const size_t length = filter->saved_words(subject->size);
    aeo_real_t *saved = allocate(length * sizeof *saved), *copy = allocate(subject->words * sizeof *copy);
    feed(subject, input, take_byte(input) % 8u);
    demand(filter->save(&subject->object, saved, length) == AEO_OK, "a filter that cannot be saved");
    if (take_byte(input) % 4u == 0u) {
        take(input, saved, length * sizeof *saved);
    } else {
        for (unsigned t = take_byte(input) % 8u + 1u; t > 0u; t--) {
            const size_t at = (take_byte(input) + 256u * take_byte(input)) % length;
            take(input, &saved[at], sizeof *saved);
        }
    }
    if (take_byte(input) % 8u != 0u) {
        aeo_saved_seal(saved, length); /* else hardly anything would get past the seal */
    }
    const family_object_t before = subject->object;
    memcpy(copy, subject->memory, subject->words * sizeof *copy);
    const aeo_status_t status = filter->restore(&subject->object, saved, length);
    if (status == AEO_OK) {
        demand(filter->invariants_hold(&subject->object), "a restored state that breaks the invariants");
        feed(subject, input, 4);
    } else {
        demand(memcmp(&before, &subject->object, filter->object_bytes) == 0 &&
                   memcmp(copy, subject->memory, subject->words * sizeof *copy) == 0,
               "a refused state that left traces");
    }
    free(saved);
    free(copy);
}

/* The regressor with arbitrary configuration and samples, in memory of the length its formula gives. */
static void fuzz_regressor(input_t *input)
{
    aeo_regressor_config_t config;
    aeo_regressor_t regressor;
    uint8_t sizes[4];
    aeo_real_t scales[4][64], u[32], y[32];
    uint64_t time_us = 0;
    memset(&config, 0, sizeof config);
    take(input, sizes, sizeof sizes);
    take(input, scales, sizeof scales);
    config.inputs = sizes[0];
    config.outputs = sizes[1];
    config.past = sizes[2];
    config.model_set = (aeo_model_set_t)(sizes[3] & 1u);
    config.feedthrough = (uint32_t)take_byte(input) << (sizes[3] % 24u);
    take(input, &config.period_us, sizeof config.period_us);
    config.offset = (sizes[3] & 2u) != 0u ? scales[0] : NULL;
    config.scale = (sizes[3] & 4u) != 0u ? scales[1] : NULL;
    config.minimum = (sizes[3] & 8u) != 0u ? scales[2] : NULL;
    config.maximum = (sizes[3] & 16u) != 0u ? scales[3] : NULL;
    const size_t words = AEO_REGRESSOR_WORDS(config.inputs, config.outputs, config.past, config.model_set);
    aeo_real_t *memory = allocate((words > 0 ? words : 1) * sizeof *memory);
    if (aeo_regressor_init(&regressor, &config, memory, words) == AEO_OK) {
        for (unsigned k = 0; k < 40u; k++) {
            uint32_t step;
            take(input, u, config.inputs * sizeof *u);
            take(input, y, config.outputs * sizeof *y);
            take(input, &step, sizeof step);
            time_us += take_byte(input) % 4u == 0u ? step : config.period_us;
            (void)aeo_regressor_push(&regressor, u, y, time_us);
            if (config.model_set == AEO_VARMAX) {
                (void)aeo_regressor_set_innovation(&regressor, y);
            }
            demand(aeo_regressor_invariants_hold(&regressor), "the regressor's invariants are broken");
        }
    }
    free(memory);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    input_t input = {data, bytes};
    subject_t subject;
    family_settings_t settings = {AEO_REAL(0.99), AEO_REAL(1), AEO_REAL(0.05)};
    memset(&subject, 0, sizeof subject);
    subject.filter = &FAMILY[take_byte(&input) % FAMILY_COUNT];
    const unsigned what = take_byte(&input) % 4u;
    subject.size = SIZES[take_byte(&input) % (sizeof SIZES / sizeof SIZES[0])];
    if (what == 3u) {
        fuzz_regressor(&input);
        return 0;
    }
    if (what == 2u) {
        take(&input, &settings, sizeof settings);
        if (take_byte(&input) % 4u == 0u) {
            take(&input, &subject.size, sizeof subject.size);
            subject.size.past %= 9u;
            subject.size.inputs %= 9u;
            subject.size.outputs %= 9u;
            subject.size.present %= 9u;
        }
    }
    const int started = start(&subject, settings);
    demand(started || what == 2u, "sound settings are refused");
    if (started && what == 0u) {
        fuzz_restore(&subject, &input);
    } else if (started) {
        feed(&subject, &input, 20);
    }
    free(subject.memory);
    return 0;
}
