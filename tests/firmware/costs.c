/* costs.c: counts the instructions of one update of every filter, with 4 outputs, about 44 and about 124 regressors. On
 * the board they come from SysTick; on a PC from callgrind, which collects inside measure_update only. */
#include "board.h"
#include "family.h"

#ifdef COSTS_ON_PC
#include <stdlib.h>
#endif

enum { WORDS_MAX = 32768, WARM = 80, MEASURED = 20 };

static family_object_t object;
static aeo_regressor_t regressor;
static aeo_real_t memory[WORDS_MAX], window[2048];

/* The first with n = 44 and 124 for VARX; VARMAX blocks are longer by the outputs and take shorter windows. */
static const family_size_t VARX_SIZES[2] = {{4, 4, 5, 4}, {4, 4, 15, 4}};
static const family_size_t VARMAX_SIZES[2] = {{3, 4, 4, 0}, {3, 4, 11, 3}};

/* external, so that it stays a function that callgrind can name */
aeo_status_t measure_update(const family_filter_t *filter, const aeo_real_t *z, const aeo_real_t *y)
    __attribute__((noinline));

aeo_status_t measure_update(const family_filter_t *filter, const aeo_real_t *z, const aeo_real_t *y)
{
    return filter->update(&object, z, y);
}

/* Return ticks over MEASURED updates, after the window has filled and WARM updates have passed. */
static uint32_t measure(const family_filter_t *filter, family_size_t size, int *sound)
{
    const family_settings_t settings = {AEO_REAL(0.999), AEO_REAL(0.1), AEO_REAL(0.05)};
    family_plant_t plant;
    uint32_t ticks = 0;
    family_plant_start(&plant, size, 1u);
    if (filter->words(size) > WORDS_MAX ||
        family_start_regressor(&regressor, filter, size, AEO_REAL(1e6), window, 2048) != AEO_OK ||
        filter->init(&object, size, settings, memory, filter->words(size)) != AEO_OK) {
        *sound = 0;
        return 0;
    }
    for (unsigned k = 0, updates = 0; updates < WARM + MEASURED; k++) {
        family_plant_step(&plant);
        if (aeo_regressor_push(&regressor, plant.u, plant.y, UINT64_C(1000) * k) != AEO_OK) {
            continue;
        }
        const aeo_real_t *z = aeo_regressor_z(&regressor), *y = aeo_regressor_y(&regressor);
        aeo_status_t status;
        if (updates++ < WARM) {
            status = filter->update(&object, z, y);
        } else {
            const uint32_t before = board_ticks();
            status = measure_update(filter, z, y);
            ticks += (before - board_ticks()) & UINT32_C(0xFFFFFF);
        }
        if (status != AEO_OK) {
            *sound = 0;
        }
        if (filter->feedback != NULL) {
            (void)aeo_regressor_set_innovation(&regressor, filter->feedback(&object));
        }
    }
    return ticks;
}

static void report(const family_filter_t *filter, family_size_t size, int *sound)
{
    const uint32_t ticks = measure(filter, size, sound);
    board_write(filter->name);
    board_write(" ");
    board_write_decimal((uint32_t)family_regressors(filter, size));
    board_write(" ");
    board_write_decimal((uint32_t)filter->words(size));
    board_write(" ");
    board_write_decimal(ticks / MEASURED * 5u / 8u);
    board_write("\n");
}

#ifdef COSTS_ON_PC
/* costs FILTER SIZE: one of the list's filters, at size 0 or 1, so that callgrind counts it alone. */
int main(int count, char **arguments)
{
    int sound = count == 3;
    if (sound) {
        const family_filter_t *filter = &FAMILY[atoi(arguments[1])];
        report(filter, (filter->feedback != NULL ? VARMAX_SIZES : VARX_SIZES)[atoi(arguments[2])], &sound);
    }
    return sound ? 0 : 1;
}
#endif

int board_main(void)
{
    int sound = 1;
    for (unsigned f = 0; f < FAMILY_COUNT; f++) {
        for (unsigned s = 0; s < 2u; s++) {
            report(&FAMILY[f], (FAMILY[f].feedback != NULL ? VARMAX_SIZES : VARX_SIZES)[s], &sound);
        }
    }
    return sound ? 0 : 1;
}
