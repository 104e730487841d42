/* proof.c: for one filter of a small size CBMC proves, for all numbers in its memory, all samples and all saved words at
 * once, that no access leaves its array, no loop runs on, and nothing that C leaves undefined is computed. -DPROVE_RLS
 * and so on choose the filter, -DPROVE_UPDATE or -DPROVE_RESTORE the step. Settings are fixed: sizes must be, for loops
 * to end, and memory is made arbitrary after init, so that the others matter little. Run by tests/gates/proof.py. */
#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/frame.h"
#include "aeolid/lattice.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"

/* Names, sizes and settings: p = 1, one input, one output, no schedule, gate off. */
#if defined(PROVE_RLS)
#define FILTER(verb) aeo_rls_##verb
enum { REGRESSORS = 2, OUTPUTS = 1, WORDS = AEO_RLS_WORDS(2, 1), SAVED = AEO_RLS_SAVED_WORDS(2, 1) };
#define SETTINGS                                                                                                       \
    {                                                                                                                  \
        2, 1, AEO_REAL(0.75), AEO_REAL(1), AEO_REAL(0), AEO_REAL(4)                                                    \
    }
#elif defined(PROVE_ELS)
#define FILTER(verb) aeo_els_##verb
enum { REGRESSORS = 3, OUTPUTS = 1, WORDS = AEO_ELS_WORDS(3, 1), SAVED = AEO_ELS_SAVED_WORDS(3, 1) };
#define SETTINGS                                                                                                       \
    {                                                                                                                  \
        3, 1, 1, 0, 16, AEO_REAL(0.75), AEO_REAL(0.75), AEO_REAL(0.5), AEO_REAL(1), AEO_REAL(0), AEO_REAL(4),          \
            AEO_REAL(4)                                                                                                \
    }
#elif defined(PROVE_FAST_RLS)
#define FILTER(verb) aeo_fast_rls_##verb
enum {
    REGRESSORS = 2,
    OUTPUTS = 1,
    WORDS = AEO_FAST_RLS_WORDS(1, 2, 0, 1),
    SAVED = AEO_FAST_RLS_SAVED_WORDS(1, 2, 0, 1)
};
#define SETTINGS                                                                                                       \
    {                                                                                                                  \
        1, 2, 1, 0, AEO_REAL(0.75), AEO_REAL(1), AEO_REAL(4)                                                           \
    }
#else
#define FILTER(verb) aeo_lattice_##verb
enum {
    REGRESSORS = 2,
    OUTPUTS = 1,
    WORDS = AEO_LATTICE_WORDS(1, 2, 0, 1),
    SAVED = AEO_LATTICE_SAVED_WORDS(1, 2, 0, 1)
};
#define SETTINGS                                                                                                       \
    {                                                                                                                  \
        1, 2, 0, 1, AEO_REAL(0.75), AEO_REAL(1), AEO_REAL(0), AEO_REAL(4)                                              \
    }
#endif

/* What a function named so returns is any value at all to CBMC. */
aeo_real_t nondet_real(void);

#ifdef PROVE_RESTORE
/* In the place of src/crc.c: a sum of any value covers the true one, and every word may pass its seal. */
uint32_t nondet_word(void);
uint32_t aeo_frame_crc32(uint32_t crc, uint32_t word)
{
    (void)crc;
    (void)word;
    return nondet_word();
}
#endif

static FILTER(t) filter;
static aeo_real_t memory[WORDS], saved[SAVED], z[REGRESSORS], y[OUTPUTS], theta[REGRESSORS * OUTPUTS];

static void fill_with_anything(aeo_real_t *x, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        x[i] = nondet_real();
    }
}

int main(void)
{
    static const FILTER(config_t) config = SETTINGS;
    if (FILTER(init)(&filter, &config, memory, WORDS) != AEO_OK) {
        __CPROVER_assert(0, "sound settings are accepted");
    }
#ifdef PROVE_RESTORE
    fill_with_anything(saved, SAVED);
    (void)FILTER(restore)(&filter, saved, SAVED);
    (void)FILTER(save)(&filter, saved, SAVED);
#else
    fill_with_anything(memory, WORDS);
    fill_with_anything(z, REGRESSORS);
    fill_with_anything(y, OUTPUTS);
    (void)FILTER(update)(&filter, z, y);
    (void)FILTER(read)(&filter, theta, REGRESSORS * OUTPUTS);
    (void)FILTER(invariants_hold)(&filter);
#endif
    return 0;
}
