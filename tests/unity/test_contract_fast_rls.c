/* The contract suite over the fast filter. */
#include "aeolid/fast_rls.h"
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
    return AEO_FAST_RLS_WORDS(size.past, size.block, size.tail, size.outputs);
}

static size_t saved_words(filter_size_t size)
{
    return AEO_FAST_RLS_SAVED_WORDS(size.past, size.block, size.tail, size.outputs);
}

static aeo_status_t init(void *object, filter_size_t size, double lambda, double rho, aeo_real_t *memory, size_t given)
{
    const aeo_fast_rls_config_t config = {.past = (uint16_t)size.past,
                                          .block = (uint16_t)size.block,
                                          .outputs = (uint16_t)size.outputs,
                                          .feedthrough = (1u << size.tail) - 1u,
                                          .forgetting = (aeo_real_t)lambda,
                                          .regularisation = (aeo_real_t)rho,
                                          .growth_max = AEO_REAL(1e6)};
    return aeo_fast_rls_init(object, &config, memory, given);
}

/* What the header says of P_{-1}: the newest block weighs rho, each older one more by 1 / lambda, the tail less. */
static double prior(filter_size_t size, double lambda, double rho, size_t j)
{
    return rho * pow(lambda, (double)(j / size.block) + 1.0 - (double)size.past);
}

/* Two sources of distance. Before n samples have come only the regularisation keeps P finite: at n = 24, rho = 0.01 its
 * condition is some 1e3, rounding is raised by that and then forgotten slowly (40 seeds: at most 7,000 roundings). With
 * lambda = 0.9 memories are shorter than windows and arrays are renewed; each begins to make the gain when what precedes
 * it still weighs e^-7 (float) or e^-14 (double) of the data. */
static double close_enough(double lambda, size_t count)
{
    (void)count;
    return lambda < 0.95 ? (sizeof(aeo_real_t) == 4 ? 1e-2 : 1e-6) : 30000.0 * (double)AEO_REAL_EPSILON;
}

CONTRACT_FORWARD(fast_rls)

static const aeo_real_t *theta(const void *object)
{
    return aeo_fast_rls_theta(object);
}

static uint32_t *rejected(void *object)
{
    return &((aeo_fast_rls_t *)object)->count.rejected;
}

/* A forward predictor so far off that the array in charge is lost at the next sample. */
static void lose(void *object)
{
    aeo_fast_rls_t *const self = object;
    self->array[self->active].forward[0] = AEO_REAL(-1e25);
}

int main(void)
{
    static const filter_face_t face = {.name = "fast_rls",
                                       .object_bytes = sizeof(aeo_fast_rls_t),
                                       .sliding = 1,
                                       .words = words,
                                       .saved_words = saved_words,
                                       .init = init,
                                       .theta = theta,
                                       CONTRACT_CALLS,
                                       .rejected = rejected,
                                       .lose = lose,
                                       .prior = prior,
                                       .close = close_enough};
    UNITY_BEGIN();
    run_contract(&face);
    return UNITY_END();
}
