/* The contract suite over the least-squares lattice. */
#include "aeolid/lattice.h"
#include "contract.h"
#include "unity.h"

#include <math.h>

void setUp(void)
{
}

void tearDown(void)
{
}

static size_t words(filter_size_t size)
{
    return AEO_LATTICE_WORDS(size.past, size.block, size.tail, size.outputs);
}

static size_t saved_words(filter_size_t size)
{
    return AEO_LATTICE_SAVED_WORDS(size.past, size.block, size.tail, size.outputs);
}

static aeo_status_t init(void *object, filter_size_t size, double lambda, double rho, aeo_real_t *memory, size_t given)
{
    const aeo_lattice_config_t config = {.past = (uint16_t)size.past,
                                         .block = (uint16_t)size.block,
                                         .present = (uint16_t)size.tail,
                                         .outputs = (uint16_t)size.outputs,
                                         .forgetting = (aeo_real_t)lambda,
                                         .regularisation = (aeo_real_t)rho,
                                         .excitation_min = AEO_REAL(0),
                                         .growth_max = AEO_REAL(1e6)};
    return aeo_lattice_init(object, &config, memory, given);
}

CONTRACT_FORWARD(lattice)

static const aeo_real_t *theta(const void *object)
{
    /* a copy is read: not even the scratch of a filter under test is touched */
    static aeo_real_t answer[4 * 24], memory[4096];
    const aeo_lattice_t *const self = object;
    aeo_lattice_t copy;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_copy(self, &copy, memory, 4096));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&copy, answer, sizeof answer / sizeof *answer));
    return answer;
}

static uint32_t *rejected(void *object)
{
    return &((aeo_lattice_t *)object)->count.rejected;
}

/* The block i samples before the newest weighs rho lambda^-i, the present inputs rho. */
static double prior(filter_size_t size, double lambda, double rho, size_t j)
{
    const size_t past = size.past * size.block;
    return j < past ? rho * pow(lambda, -(double)((past - 1 - j) / size.block)) : rho;
}

int main(void)
{
    static const filter_face_t face = {.name = "lattice",
                                       .object_bytes = sizeof(aeo_lattice_t),
                                       .sliding = 1,
                                       .words = words,
                                       .saved_words = saved_words,
                                       .init = init,
                                       .theta = theta,
                                       CONTRACT_CALLS,
                                       .rejected = rejected,
                                       .prior = prior};
    UNITY_BEGIN();
    run_contract(&face);
    return UNITY_END();
}
