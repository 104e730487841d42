/* rows.c: the kernel of rows.h. */
#include "rows.h"

#include "lanes.h"

/* Some entries of x stay in registers while all rows pass. */
#define FETCH(type, p) left[p] = AEO_FROM(type, x + (p)*AEO_SIZE(type));
#define TAKE(type, p)  left[p] -= AEO_FROM(type, row + (p)*AEO_SIZE(type)) * v[r];
#define KEEP(type, p)                                                                                                  \
    AEO_AT(type, x + (p)*AEO_SIZE(type)) = left[p];                                                                    \
    left[p] *= step;
#define MOVE(type, p) AEO_AT(type, row + (p)*AEO_SIZE(type)) += left[p] * gain[r];
#define DEFINE_CORRECT(name, type, ABREAST, EACH)                                                                      \
    static void name(aeo_real_t *AEO_RESTRICT weight, const aeo_real_t *AEO_RESTRICT v, aeo_real_t *AEO_RESTRICT x,    \
                     size_t count, size_t m, const aeo_real_t *AEO_RESTRICT gain, aeo_real_t step)                     \
    {                                                                                                                  \
        aeo_##type##_t left[ABREAST];                                                                                  \
        aeo_real_t *row = weight;                                                                                      \
        EACH(FETCH, type)                                                                                              \
        for (size_t r = 0; r < m; r++) {                                                                               \
            EACH(TAKE, type)                                                                                           \
            row += count;                                                                                              \
        }                                                                                                              \
        EACH(KEEP, type)                                                                                               \
        row = weight;                                                                                                  \
        for (size_t r = 0; gain != NULL && r < m; r++) {                                                               \
            EACH(MOVE, type)                                                                                           \
            row += count;                                                                                              \
        }                                                                                                              \
    }
DEFINE_CORRECT(correct_abreast, lanes, AEO_ABREAST, AEO_EACH_OF)
#if AEO_FEW > 1
DEFINE_CORRECT(correct_few, few, 1, AEO_ALONE)
#endif
#undef FETCH
#undef TAKE
#undef KEEP
#undef MOVE
#undef DEFINE_CORRECT

/* One entry. Its sum grows in memory, term after term as above: a compiler that may reorder sums must not find another
 * answer for the same entry in another place. */
static void correct_one(aeo_real_t *weight, const aeo_real_t *v, aeo_real_t *x, size_t count, size_t m,
                        const aeo_real_t *gain, aeo_real_t step)
{
    const aeo_real_t *entry = weight;
    for (size_t r = 0; r < m; r++) {
        *x -= *entry * v[r];
        entry += count;
    }
    const aeo_real_t left = *x * step;
    for (size_t r = 0; gain != NULL && r < m; r++) {
        *weight += left * gain[r];
        weight += count;
    }
}

void aeo_rows_correct(aeo_real_t *weight, const aeo_real_t *v, aeo_real_t *x, size_t count, size_t m,
                      const aeo_real_t *gain, aeo_real_t step)
{
    size_t i = 0;
    for (; i + AEO_ABREAST * AEO_LANES <= count; i += AEO_ABREAST * AEO_LANES) {
        correct_abreast(weight + i, v, x + i, count, m, gain, step);
    }
#if AEO_FEW > 1
    for (; i + AEO_FEW <= count; i += AEO_FEW) {
        correct_few(weight + i, v, x + i, count, m, gain, step);
    }
#endif
    for (; i < count; i++) {
        correct_one(weight + i, v, x + i, count, m, gain, step);
    }
}
/* SPDX-License-Identifier: MIT */
