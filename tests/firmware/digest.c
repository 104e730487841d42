/* digest.c: runs every filter at several sizes through good and bad samples, gaps, saving and restoring, and prints a
 * CRC-32 over all bits of theta and innovations: the same on every machine, or one of them computes something else. */
#include "board.h"
#include "family.h"

enum { SAMPLES = 600, WORDS_MAX = 16384, THETA_MAX = 512 };

static family_object_t object;
static aeo_regressor_t regressor;
static aeo_real_t memory[WORDS_MAX], saved[WORDS_MAX], window[1024], theta[THETA_MAX];

/* n = 3, 6, 44 and 51 for VARX */
static const family_size_t SIZES[] = {{1, 1, 1, 1}, {1, 2, 2, 0}, {4, 4, 5, 4}, {2, 3, 10, 1}};

static aeo_real_t make_nan(void)
{
    union {
        uint32_t bits;
        float value;
    } nan = {UINT32_C(0x7FC00000)};
    return (aeo_real_t)nan.value;
}

/* Restart from the saved state: what was saved must be everything. */
static int save_and_restore(const family_filter_t *filter, family_size_t size)
{
    const size_t length = filter->saved_words(size);
    if (length > WORDS_MAX || filter->save(&object, saved, length) != AEO_OK) {
        return 0;
    }
    filter->reset(&object);
    return filter->restore(&object, saved, length) == AEO_OK;
}

static int feed(const family_filter_t *filter, family_plant_t *plant, uint32_t k, uint64_t time_us)
{
    family_plant_step(plant);
    aeo_real_t u[FAMILY_CHANNELS_MAX];
    for (unsigned j = 0; j < plant->size.inputs; j++) {
        u[j] = plant->u[j];
    }
    if (k % 97u == 50u) {
        u[0] = k % 2u == 0u ? make_nan() : AEO_REAL(1e9);
    }
    const aeo_status_t status = aeo_regressor_push(&regressor, u, plant->y, time_us);
    if (status != AEO_OK) {
        return status != AEO_E_ARG;
    }
    if (filter->update(&object, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor)) != AEO_OK) {
        return 0;
    }
    return filter->feedback == NULL || aeo_regressor_set_innovation(&regressor, filter->feedback(&object)) == AEO_OK;
}

/* Return the digest; *sound is lowered when anything failed. */
static uint32_t digest(const family_filter_t *filter, family_size_t size, int *sound)
{
    const family_settings_t settings = {AEO_REAL(0.9921875), AEO_REAL(0.125), AEO_REAL(0.05)};
    const size_t count = family_regressors(filter, size) * size.outputs;
    family_plant_t plant;
    uint32_t crc = UINT32_C(0xFFFFFFFF);
    family_plant_start(&plant, size, 20091130u);
    if (count > THETA_MAX || filter->words(size) > WORDS_MAX ||
        family_start_regressor(&regressor, filter, size, AEO_REAL(1e6), window, sizeof window / sizeof *window) !=
            AEO_OK ||
        filter->init(&object, size, settings, memory, filter->words(size)) != AEO_OK) {
        *sound = 0;
        return 0;
    }
    for (uint32_t k = 0; k < SAMPLES; k++) {
        /* a hole of three samples at 300; quiet from 400 to 440, so that gate and bounds act */
        plant.excitation = plant.noise = AEO_REAL(k >= 400u && k < 440u ? 1e-4 : 0.5);
        if (!feed(filter, &plant, k, UINT64_C(1000) * (k + (k < 300u ? 0u : 3u)))) {
            *sound = 0;
        }
        if (k % 100u == 99u) {
            if (!save_and_restore(filter, size) || filter->read(&object, theta, THETA_MAX) != AEO_OK ||
                !filter->invariants_hold(&object)) {
                *sound = 0;
            }
            crc = family_crc(crc, theta, count);
            crc = family_crc(crc, filter->innovation(&object), size.outputs);
        }
    }
    return ~crc;
}

int board_main(void)
{
    int sound = 1;
    for (unsigned f = 0; f < FAMILY_COUNT; f++) {
        for (unsigned s = 0; s < sizeof SIZES / sizeof SIZES[0]; s++) {
            const uint32_t crc = digest(&FAMILY[f], SIZES[s], &sound);
            board_write(FAMILY[f].name);
            board_write(" ");
            board_write_decimal((uint32_t)family_regressors(&FAMILY[f], SIZES[s]));
            board_write(" ");
            board_write_hex(crc);
            board_write("\n");
        }
    }
    return sound ? 0 : 1;
}
