/* The lattice against vectors that numpy made from batch least squares; see generate_lattice.py. */
#include "aeolid/lattice.h"
#include "lattice_vectors.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { P_MAX = 6, M_MAX = 3, D_MAX = 2, L_MAX = 3, N_MAX = P_MAX * M_MAX + D_MAX };

static aeo_lattice_t lattice;

void setUp(void)
{
}

void tearDown(void)
{
}

static void start(size_t c)
{
    static aeo_real_t memory[AEO_LATTICE_WORDS(P_MAX, M_MAX, D_MAX, L_MAX)];
    const aeo_lattice_config_t config = {.past = (uint16_t)LATTICE_VECTORS[c].past,
                                         .block = (uint16_t)LATTICE_VECTORS[c].block,
                                         .present = (uint16_t)LATTICE_VECTORS[c].present,
                                         .outputs = (uint16_t)LATTICE_VECTORS[c].outputs,
                                         .forgetting = (aeo_real_t)LATTICE_VECTORS[c].forgetting,
                                         .regularisation = (aeo_real_t)LATTICE_VECTORS[c].regularisation,
                                         .excitation_min = AEO_REAL(0),
                                         .growth_max = AEO_REAL(1e6)};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&lattice, &config, memory, sizeof memory / sizeof *memory));
}

/* Sample k of case c: the block of this sample enters the window after it. */
static void feed(size_t c, size_t k, aeo_real_t *z)
{
    const size_t m = LATTICE_VECTORS[c].block, past = m * LATTICE_VECTORS[c].past, l = LATTICE_VECTORS[c].outputs;
    const double *const block = LATTICE_VECTORS[c].blocks + k * m;
    aeo_real_t y[L_MAX];
    for (size_t j = 0; j < LATTICE_VECTORS[c].present; j++) {
        z[past + j] = (aeo_real_t)block[j];
    }
    for (size_t i = 0; i < l; i++) {
        y[i] = (aeo_real_t)LATTICE_VECTORS[c].y[k * l + i];
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&lattice, z, y));
    memmove(z, z + m, (past - m) * sizeof *z);
    for (size_t j = 0; j < m; j++) {
        z[past - m + j] = (aeo_real_t)block[j];
    }
}

static void vectors_are_met(void)
{
    /* the vectors are written with 13 digits, so double can be met to a few 1e-12 at best */
    const double bound = 300.0 * (double)AEO_REAL_EPSILON + 1e-11;
    for (size_t c = 0; c < sizeof LATTICE_VECTORS / sizeof LATTICE_VECTORS[0]; c++) {
        const size_t l = LATTICE_VECTORS[c].outputs, count = LATTICE_VECTORS[c].count;
        const size_t n = LATTICE_VECTORS[c].past * LATTICE_VECTORS[c].block + LATTICE_VECTORS[c].present;
        aeo_real_t z[N_MAX] = {AEO_REAL(0)}, theta[N_MAX * L_MAX];
        start(c);
        for (size_t k = 0; k < count; k++) {
            feed(c, k, z);
            for (size_t i = 0; i < l && k + LATTICE_LATE >= count; i++) {
                const double expected = LATTICE_VECTORS[c].innovation[(k + LATTICE_LATE - count) * l + i];
                TEST_ASSERT_TRUE(fabs((double)aeo_lattice_innovation(&lattice)[i] - expected) < 10.0 * bound);
            }
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, theta, n * l));
        TEST_ASSERT_TRUE(relative_distance(theta, LATTICE_VECTORS[c].theta, n * l) < bound);
        TEST_ASSERT_EQUAL_UINT32(0, aeo_lattice_health(&lattice));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(vectors_are_met);
    return UNITY_END();
}
