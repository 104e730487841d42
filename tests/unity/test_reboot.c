/* A device that saves regressor and filter at one sample and goes on after a reboot: as if nothing had been. */
#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/lattice.h"
#include "aeolid/rls.h"
#include "samples.h"
#include "saved.h"
#include "unity.h"

#include <string.h>

enum { R = 2, L = 2, P = 4, M = R + L, N = P * M + 1, N_ELS = P * (M + L) + 1, PERIOD = 100000 };
enum { WINDOW = AEO_REGRESSOR_WORDS(R, L, P, 1), KEPT = AEO_REGRESSOR_SAVED_WORDS(R, L, P, 0) };
enum { KEPT_VARMAX = AEO_REGRESSOR_SAVED_WORDS(R, L, P, 1) };

typedef struct {
    aeo_regressor_t x, x_els;
    aeo_rls_t rls;
    aeo_els_t els;
    aeo_fast_rls_t fast;
    aeo_lattice_t lattice;
    aeo_real_t window[WINDOW], window_els[WINDOW];
    aeo_real_t of_rls[AEO_RLS_WORDS(N, L)], of_els[AEO_ELS_WORDS(N_ELS, L)];
    aeo_real_t of_fast[AEO_FAST_RLS_WORDS(P, M, 1, L)], of_lattice[AEO_LATTICE_WORDS(P, M, 1, L)];
} device_t;

static device_t one, other;
static aeo_real_t kept[KEPT], kept_els[KEPT_VARMAX], rls[AEO_RLS_SAVED_WORDS(N, L)], els[AEO_ELS_SAVED_WORDS(N_ELS, L)];
static aeo_real_t fast[AEO_FAST_RLS_SAVED_WORDS(P, M, 1, L)], lattice[AEO_LATTICE_SAVED_WORDS(P, M, 1, L)];
static aeo_real_t u[R], y[L];
static uint64_t seed;

void setUp(void)
{
    seed = 20091130u;
    memset(u, 0, sizeof u);
    memset(y, 0, sizeof y);
}

void tearDown(void)
{
}

static void switch_on(device_t *device)
{
    static const aeo_real_t OFFSET[R + L] = {AEO_REAL(0.5), AEO_REAL(0), AEO_REAL(-1), AEO_REAL(0.25)};
    const aeo_real_t lambda = AEO_REAL(0.99), rho = AEO_REAL(0.1), gate = AEO_REAL(0.05);
    aeo_regressor_config_t layout = {
        .inputs = R, .outputs = L, .past = P, .feedthrough = 2u, .period_us = PERIOD, .offset = OFFSET};
    const aeo_rls_config_t a = {N, L, lambda, rho, gate, AEO_REAL(10)};
    const aeo_els_config_t b = {.regressors = N_ELS,
                                .outputs = L,
                                .past = P,
                                .present = 1,
                                .varx_samples = 50,
                                .forgetting = lambda,
                                .forgetting_start = lambda,
                                .regularisation = rho,
                                .excitation_min = gate,
                                .growth_max = AEO_REAL(10),
                                .guard_ratio = AEO_REAL(4)};
    const aeo_fast_rls_config_t c = {.past = P,
                                     .block = M,
                                     .outputs = L,
                                     .feedthrough = 2u,
                                     .forgetting = lambda,
                                     .regularisation = rho,
                                     .growth_max = AEO_REAL(10)};
    const aeo_lattice_config_t d = {P, M, 1, L, lambda, rho, gate, AEO_REAL(10)};
    memset(device, 0x5A, sizeof *device); /* memory after power-on holds anything */
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&device->x, &layout, device->window, WINDOW));
    layout.model_set = AEO_VARMAX;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&device->x_els, &layout, device->window_els, WINDOW));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&device->rls, &a, device->of_rls, AEO_RLS_WORDS(N, L)));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&device->els, &b, device->of_els, AEO_ELS_WORDS(N_ELS, L)));
    TEST_ASSERT_EQUAL_INT(AEO_OK,
                          aeo_fast_rls_init(&device->fast, &c, device->of_fast, AEO_FAST_RLS_WORDS(P, M, 1, L)));
    TEST_ASSERT_EQUAL_INT(AEO_OK,
                          aeo_lattice_init(&device->lattice, &d, device->of_lattice, AEO_LATTICE_WORDS(P, M, 1, L)));
}

static void move_plant(void)
{
    const aeo_real_t next = AEO_REAL(0.7) * y[0] + AEO_REAL(0.5) * u[0] + AEO_REAL(0.1) * (aeo_real_t)draw(&seed);
    y[1] = AEO_REAL(0.5) * y[1] + AEO_REAL(0.3) * u[1] + AEO_REAL(0.1) * (aeo_real_t)draw(&seed);
    y[0] = next;
    u[0] = (aeo_real_t)draw(&seed);
    u[1] = (aeo_real_t)draw(&seed);
}

static void take(device_t *device, uint64_t k)
{
    if (aeo_regressor_push(&device->x, u, y, k * PERIOD) == AEO_OK) {
        const aeo_real_t *const z = aeo_regressor_z(&device->x), *const now = aeo_regressor_y(&device->x);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&device->rls, z, now));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&device->fast, z, now));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&device->lattice, z, now));
    }
    (void)aeo_els_step(&device->els, &device->x_els, u, y, k * PERIOD);
}

static void save_all(const device_t *device)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&device->x, kept, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&device->x_els, kept_els, KEPT_VARMAX));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_save(&device->rls, rls, sizeof rls / sizeof *rls));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_save(&device->els, els, sizeof els / sizeof *els));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_save(&device->fast, fast, sizeof fast / sizeof *fast));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&device->lattice, lattice, sizeof lattice / sizeof *lattice));
}

static void restore_all(device_t *device)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_restore(&device->x, kept, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_restore(&device->x_els, kept_els, KEPT_VARMAX));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_restore(&device->rls, rls, sizeof rls / sizeof *rls));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_restore(&device->els, els, sizeof els / sizeof *els));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_restore(&device->fast, fast, sizeof fast / sizeof *fast));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_restore(&device->lattice, lattice, sizeof lattice / sizeof *lattice));
}

/* Both devices have lived alike: theta to the bit, ages and counters. */
static void assert_alike(void)
{
    aeo_real_t theta[2][N * L];
    TEST_ASSERT_EQUAL_MEMORY(aeo_rls_theta(&one.rls), aeo_rls_theta(&other.rls), sizeof(aeo_real_t) * N * L);
    TEST_ASSERT_EQUAL_MEMORY(aeo_els_theta(&one.els), aeo_els_theta(&other.els), sizeof(aeo_real_t) * N_ELS * L);
    TEST_ASSERT_EQUAL_MEMORY(aeo_fast_rls_theta(&one.fast), aeo_fast_rls_theta(&other.fast), sizeof theta[0]);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&one.lattice, theta[0], N * L));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&other.lattice, theta[1], N * L));
    TEST_ASSERT_EQUAL_MEMORY(theta[0], theta[1], sizeof theta[0]);
    TEST_ASSERT_EQUAL_MEMORY(&one.fast.count, &other.fast.count, sizeof one.fast.count);
    TEST_ASSERT_EQUAL_MEMORY(&one.lattice.count, &other.lattice.count, sizeof one.lattice.count);
    TEST_ASSERT_EQUAL_MEMORY(&one.x.count, &other.x.count, sizeof one.x.count);
    TEST_ASSERT_EQUAL_UINT32(one.fast.array[one.fast.active].age, other.fast.array[other.fast.active].age);
    TEST_ASSERT_TRUE(aeo_regressor_invariants_hold(&other.x) && aeo_regressor_invariants_hold(&other.x_els));
}

/* Reboot at sample `at`, with `missed` samples until the device is up again; the other one has never been off, but its
 * sensors missed the same samples. */
static void reboot(unsigned at, unsigned missed)
{
    setUp();
    switch_on(&one);
    unsigned k = 0;
    for (; k < at; k++) {
        move_plant();
        take(&one, k);
    }
    save_all(&one);
    switch_on(&other);
    restore_all(&other);
    for (k += missed; k < at + 300u; k++) {
        move_plant();
        take(&one, k);
        take(&other, k);
        assert_alike();
    }
    TEST_ASSERT_EQUAL_UINT32(missed > 0u ? 1u : 0u, other.lattice.count.restarted);
    TEST_ASSERT_EQUAL_UINT32(missed > 0u ? 1u : 0u, other.fast.count.restarted);
}

static void a_reboot_leaves_no_mark(void)
{
    reboot(1000, 0);
    reboot(501, 0);
    reboot(700, 30);
}

static void a_reboot_while_the_window_fills(void)
{
    /* none, one and some blocks in the window: nothing restarts, for nothing has begun */
    for (unsigned at = 0; at < P + 2u; at++) {
        reboot(at, 0);
    }
}

static void a_regressor_of_others_is_refused(void)
{
    switch_on(&one);
    for (unsigned k = 0; k < 20u; k++) {
        move_plant();
        take(&one, k);
    }
    save_all(&one);
    const aeo_regressor_t before = one.x;
    enum { SIZES = 10, NUMBERS = AEO_REGRESSOR_SAVED_HEAD(R, L) };
    for (size_t i = 0; i < KEPT; i++) {
        const aeo_real_t good = kept[i];
        kept[i] = i < NUMBERS ? good + AEO_REAL(0.5) : AEO_REAL(1.1e6);
        for (int sealed = 0; sealed < (i < KEPT - AEO_SAVED_SEAL ? 2 : 1); sealed++) {
            if (sealed) {
                aeo_saved_seal(kept, KEPT);
            }
            const aeo_status_t expected = i == 0u                    ? AEO_E_VERSION
                                          : i < SIZES + 2u * (R + L) ? AEO_E_MISMATCH
                                                                     : AEO_E_DAMAGED;
            TEST_ASSERT_EQUAL_INT(expected, aeo_regressor_restore(&one.x, kept, KEPT));
            TEST_ASSERT_EQUAL_MEMORY(&before, &one.x, sizeof before);
        }
        kept[i] = good;
        aeo_saved_seal(kept, KEPT);
    }
    kept[SIZES + 2 * (R + L) + 1] = AEO_REAL(P + 1); /* more blocks than the window has */
    aeo_saved_seal(kept, KEPT);
    TEST_ASSERT_EQUAL_INT(AEO_E_DAMAGED, aeo_regressor_restore(&one.x, kept, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_E_MISMATCH,
                          aeo_regressor_restore(&one.x, kept_els, KEPT_VARMAX)); /* of another model set */
    kept[3] = make_not_finite(1);
    TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, aeo_regressor_restore(&one.x, kept, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_regressor_restore(&one.x, kept, KEPT - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_regressor_save(&one.x, kept, KEPT - 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_save(NULL, kept, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_save(&one.x, NULL, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_restore(NULL, kept, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_regressor_restore(&one.x, NULL, KEPT));
}

/* One bit of any word: what range checks cannot see is seen by the seal. */
static void a_flipped_bit_is_seen(void)
{
    switch_on(&one);
    for (unsigned k = 0; k < 100u; k++) {
        move_plant();
        take(&one, k);
    }
    save_all(&one);
    for (size_t i = 0; i < sizeof rls / sizeof *rls; i++) {
        unsigned char *const byte = (unsigned char *)(rls + i) + i % sizeof *rls;
        *byte ^= (unsigned char)(1u << i % 8u);
        TEST_ASSERT_TRUE(aeo_rls_restore(&one.rls, rls, sizeof rls / sizeof *rls) < AEO_OK);
        *byte ^= (unsigned char)(1u << i % 8u);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_restore(&one.rls, rls, sizeof rls / sizeof *rls));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_reboot_leaves_no_mark);
    RUN_TEST(a_reboot_while_the_window_fills);
    RUN_TEST(a_regressor_of_others_is_refused);
    RUN_TEST(a_flipped_bit_is_seen);
    return UNITY_END();
}
