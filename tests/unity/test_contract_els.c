/* The contract suite over extended least squares: with schedule, VARX start and guard off it is an RLS in z. */
#include "aeolid/els.h"
#include "contract.h"
#include "unity.h"

void setUp(void)
{
}

void tearDown(void)
{
}

static size_t regressors(filter_size_t size)
{
    return size.past * size.block + size.tail;
}

static size_t words(filter_size_t size)
{
    return AEO_ELS_WORDS(regressors(size), size.outputs);
}

static size_t saved_words(filter_size_t size)
{
    return AEO_ELS_SAVED_WORDS(regressors(size), size.outputs);
}

static aeo_status_t init(void *object, filter_size_t size, double lambda, double rho, aeo_real_t *memory, size_t given)
{
    const aeo_els_config_t config = {.regressors = (uint16_t)regressors(size),
                                     .outputs = (uint16_t)size.outputs,
                                     .forgetting = (aeo_real_t)lambda,
                                     .forgetting_start = (aeo_real_t)lambda,
                                     .regularisation = (aeo_real_t)rho,
                                     .excitation_min = AEO_REAL(0),
                                     .growth_max = AEO_REAL(1e6)};
    return aeo_els_init(object, &config, memory, given);
}

CONTRACT_FORWARD(els)

static const aeo_real_t *theta(const void *object)
{
    return aeo_els_theta(object);
}

static uint32_t *rejected(void *object)
{
    return &((aeo_els_t *)object)->rls.count.rejected;
}

int main(void)
{
    static const filter_face_t face = {.name = "els",
                                       .object_bytes = sizeof(aeo_els_t),
                                       .words = words,
                                       .saved_words = saved_words,
                                       .init = init,
                                       .theta = theta,
                                       CONTRACT_CALLS,
                                       .rejected = rejected};
    UNITY_BEGIN();
    run_contract(&face);
    return UNITY_END();
}
