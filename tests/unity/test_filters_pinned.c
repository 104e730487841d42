/* What the filters do in rare moments, against references of our own: bounds, falls back, read-outs after a restore. */
#include "aeolid/els.h"
#include "lattice_bench.h"
#include "aeolid/rls.h"
#include "samples.h"
#include "settings.h"
#include "strips.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static uint64_t seed;

void setUp(void)
{
    seed = 20261126u;
    reset_lattice_bench();
}

void tearDown(void)
{
}

/* ---- rls: bound_variances ------------------------------------------------------------------------------------------ */

enum { ORDER = 10 };

typedef struct {
    double p[ORDER][ORDER], theta[ORDER], lambda, most;
    unsigned row, step, bounded;
} dense_t;

/* The recursion of rls.h on a full P. */
static void absorb_densely(dense_t *self, const aeo_real_t *z, double y, double lambda)
{
    double pz[ORDER] = {0}, alpha = lambda, error = y;
    for (size_t i = 0; i < ORDER; i++) {
        for (size_t j = 0; j < ORDER; j++) {
            pz[i] += self->p[i][j] * (double)z[j];
        }
        alpha += (double)z[i] * pz[i];
        error -= self->theta[i] * (double)z[i];
    }
    for (size_t i = 0; i < ORDER; i++) {
        self->theta[i] += pz[i] * error / alpha;
        for (size_t j = 0; j < ORDER; j++) {
            self->p[i][j] = (self->p[i][j] - pz[i] * pz[j] / alpha) / lambda;
        }
    }
}

/* A measurement of parameter i of variance P_ii / 3 quarters P_ii: P - P_i P_i' 3 / (4 P_ii). */
static void bound_densely(dense_t *self)
{
    for (unsigned s = 0; s < self->step; s++) {
        const unsigned i = self->row;
        double column[ORDER];
        self->row = (i + 1u) % ORDER;
        if (self->p[i][i] <= self->most) {
            continue;
        }
        for (size_t j = 0; j < ORDER; j++) {
            column[j] = self->p[j][i];
        }
        for (size_t j = 0; j < ORDER; j++) {
            for (size_t k = 0; k < ORDER; k++) {
                self->p[j][k] -= column[j] * column[k] * 0.75 / column[i];
            }
        }
        self->bounded++;
    }
}

/* Two of ten channels are silent for long stretches, two are the same: P grows there, and is bounded as the reference. */
static void bounded_variances_are_those_of_a_full_covariance(void)
{
    static aeo_real_t memory[AEO_RLS_WORDS(ORDER, 1)];
    const aeo_rls_config_t config = {ORDER, 1, AEO_REAL(0.875), AEO_REAL(0.5), AEO_REAL(0), AEO_REAL(8)};
    dense_t dense = {.lambda = 0.875, .most = 16.0, .step = 2}; /* 0.875^5 > 1/2: ten rows in five samples */
    aeo_rls_t rls;
    aeo_real_t z[ORDER];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, sizeof memory / sizeof *memory));
    for (size_t i = 0; i < ORDER; i++) {
        dense.p[i][i] = 2.0;
    }
    for (unsigned k = 0; k < 400u; k++) {
        fill(z, ORDER, &seed);
        z[3] = k % 100u < 60u ? AEO_REAL(0) : z[3];
        z[9] = k % 150u < 80u ? AEO_REAL(0) : z[9];
        z[5] = z[4];
        const aeo_real_t y = AEO_REAL(0.5) * z[0] - z[3] + z[4] + AEO_REAL(0.25) * z[9] + (aeo_real_t)draw(&seed);
        absorb_densely(&dense, z, (double)y, dense.lambda);
        bound_densely(&dense);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, &y));
        TEST_ASSERT_EQUAL_UINT32(dense.bounded, rls.count.bounded);
        /* cond(P) is some 1e4, and roots of -ffast-math are estimates that are 1e2 roundings off */
        for (size_t i = 0; i < ORDER; i++) {
            const double variance = (double)aeo_strips_norm2(rls.factor, ORDER, i);
            TEST_ASSERT_TRUE(fabs(variance - dense.p[i][i]) < 1e6 * (double)AEO_REAL_EPSILON * (1.0 + dense.p[i][i]));
            TEST_ASSERT_TRUE(fabs((double)aeo_rls_theta(&rls)[i] - dense.theta[i]) < 1e6 * (double)AEO_REAL_EPSILON);
        }
    }
    TEST_ASSERT_TRUE(dense.bounded > 40u);
    TEST_ASSERT_EQUAL_UINT32(AEO_RLS_BOUNDED, aeo_rls_health(&rls));
}

/* A sample of little news is absorbed with weight 1 and nothing is forgotten. */
static void quiet_samples_are_absorbed_without_forgetting(void)
{
    static aeo_real_t memory[AEO_RLS_WORDS(ORDER, 1)];
    const aeo_rls_config_t config = {ORDER, 1, AEO_REAL(0.875), AEO_REAL(0.5), AEO_REAL(1), AEO_REAL(1e5)};
    dense_t dense = {.lambda = 0.875};
    aeo_rls_t rls;
    aeo_real_t z[ORDER];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, sizeof memory / sizeof *memory));
    for (size_t i = 0; i < ORDER; i++) {
        dense.p[i][i] = 2.0;
    }
    for (unsigned k = 0; k < 300u; k++) {
        fill(z, ORDER, &seed);
        const aeo_real_t y = AEO_REAL(0.5) * z[0] - z[3] + (aeo_real_t)draw(&seed);
        const uint32_t withheld = rls.count.withheld, released = rls.count.released;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, &y));
        const int quiet = rls.count.withheld > withheld;
        double news = 0.0, error = (double)y;
        for (size_t i = 0; i < ORDER; i++) {
            error -= dense.theta[i] * (double)z[i];
            for (size_t j = 0; j < ORDER; j++) {
                news += (double)z[i] * dense.p[i][j] * (double)z[j];
            }
        }
        TEST_ASSERT_TRUE(fabs(news - 1.25) < 1e-4 || quiet == (news < 1.25)); /* (1 - lambda) n */
        const double weight = quiet ? 1.0 : dense.lambda;
        absorb_densely(&dense, z, (double)y, weight);
        for (size_t i = 0; i < ORDER * ORDER && rls.count.released > released;
             i++) { /* the watch has let P start anew */
            dense.p[i / ORDER][i % ORDER] = i / ORDER == i % ORDER ? 2.0 : 0.0;
        }
        const double scale = (double)AEO_REAL_EPSILON * 1e5;
        TEST_ASSERT_TRUE(fabs((double)aeo_rls_innovation(&rls)[0] - error) < scale);
        TEST_ASSERT_TRUE(fabs((double)aeo_rls_residual(&rls)[0] - error * weight / (weight + news)) < scale);
        for (size_t i = 0; i < ORDER; i++) {
            const double variance = (double)aeo_strips_norm2(rls.factor, ORDER, i);
            TEST_ASSERT_TRUE(fabs(variance - dense.p[i][i]) < scale * (1.0 + dense.p[i][i]));
            TEST_ASSERT_TRUE(fabs((double)aeo_rls_theta(&rls)[i] - dense.theta[i]) < scale);
        }
    }
    TEST_ASSERT_TRUE(rls.count.withheld > 10u && rls.count.withheld < 290u);
}

/* What is followed moves no weight, so its residual is its innovation; what is absorbed leaves lambda / (lambda + z'Pz). */
static void what_a_lattice_follows_leaves_its_innovation(void)
{
    unsigned followed = 0;
    start_lattice(0.95, 0.6, 1e4);
    for (unsigned k = 0; k < 400u; k++) {
        const uint32_t withheld = lattice.count.withheld;
        feed_lattice(k % 100u < 50u ? 1.0 : 0.02, 0.1);
        const int quiet = lattice.count.withheld > withheld;
        for (unsigned i = 0; i < L; i++) {
            const double e = (double)aeo_lattice_innovation(&lattice)[i],
                         rest = (double)aeo_lattice_residual(&lattice)[i];
            const double left = quiet ? 1.0 : 0.95 / (double)lattice.news;
            if (!lattice.following || quiet) {
                TEST_ASSERT_TRUE(fabs(rest - e * left) <= 1e-5 * fabs(e));
            }
        }
        followed += quiet != 0;
    }
    TEST_ASSERT_TRUE(followed > 50u && followed < 350u);
}

/* The gate is off at 0: z = 0 brings no news, and P is forgotten all the same. */
static void without_a_gate_nothing_is_withheld(void)
{
    static aeo_real_t memory[AEO_RLS_WORDS(3, 1)];
    static const aeo_real_t nothing[3];
    const aeo_rls_config_t config = {3, 1, AEO_REAL(0.5), AEO_REAL(1), AEO_REAL(0), AEO_REAL(1e5)};
    aeo_rls_t rls;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, sizeof memory / sizeof *memory));
    for (unsigned k = 1; k < 10u; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, nothing, nothing));
        for (size_t i = 0; i < 3u; i++) {
            TEST_ASSERT_TRUE(fabs((double)aeo_strips_norm2(rls.factor, 3, i) / pow(2.0, k) - 1.0) < 1e-4);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(0, rls.count.withheld);
    TEST_ASSERT_EQUAL_HEX32(0, aeo_rls_health(&rls));
}

/* With z = 0 and lambda = 1/2 a variance doubles to the bit: at growth_max / rho it stays, beyond it is quartered. */
static void variances_at_the_bound_are_left_alone(void)
{
    static aeo_real_t memory[AEO_LATTICE_WORDS(1, 1, 0, 1)], nothing[1];
    const aeo_lattice_config_t config = {.past = 1,
                                         .block = 1,
                                         .outputs = 1,
                                         .forgetting = AEO_REAL(0.5),
                                         .regularisation = AEO_REAL(1),
                                         .growth_max = AEO_REAL(8)};
    static const double expected[] = {2, 4, 8, 4, 8, 4};
    aeo_lattice_t one;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&one, &config, memory, sizeof memory / sizeof *memory));
    for (unsigned k = 0; k < 6u; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&one, nothing, nothing));
        TEST_ASSERT_TRUE(fabs((double)one.factor[0] - expected[k]) < 1e-5);
        TEST_ASSERT_EQUAL_UINT32(k < 3u ? 0u : (k - 1u) / 2u, one.count.bounded);
    }
}

/* How many variances are checked a sample: all of them before lambda^-k passes 2. */
static void all_variances_are_checked_before_any_doubles(void)
{
    static const double lambdas[] = {0.5, 0.6, 0.75, 0.9, 0.95, 0.99, 0.999, 1.0};
    for (unsigned l = 0; l < sizeof lambdas / sizeof *lambdas; l++) {
        for (unsigned count = 1; count <= 1024u; count += 1u + count / 3u) {
            const double lambda = (double)(aeo_real_t)lambdas[l];
            const unsigned step = aeo_settings_find_scan_step(count, (aeo_real_t)lambdas[l]);
            const unsigned samples = (count + step - 1u) / step;
            TEST_ASSERT_TRUE(step >= 1u && (step == count || pow(lambda, samples) >= 0.5 * (1 - 1e-4)));
            if (step > 1u) { /* one row a sample less would be too few */
                TEST_ASSERT_TRUE(pow(lambda, (count + step - 2u) / (step - 1u)) < 0.5 * (1 + 1e-4));
            }
        }
    }
}

/* ---- els: the columns of e ----------------------------------------------------------------------------------------- */

/* Three inputs, two outputs, one present input: where a block's e lies is r + l behind its start. */
static void a_fall_back_clears_the_columns_of_e_alone(void)
{
    enum { IN = 3, OUT = 2, PAST = 2, M_ELS = IN + 2 * OUT, N_ELS = PAST * M_ELS + 1 };
    static aeo_real_t memory[AEO_ELS_WORDS(N_ELS, OUT)], window[AEO_REGRESSOR_WORDS(IN, OUT, PAST, 1)];
    const aeo_regressor_config_t layout = {
        .inputs = IN, .outputs = OUT, .past = PAST, .model_set = AEO_VARMAX, .feedthrough = 4u, .period_us = 1000};
    const aeo_els_config_t config = {.regressors = N_ELS,
                                     .outputs = OUT,
                                     .past = PAST,
                                     .present = 1,
                                     .varx_samples = 100,
                                     .forgetting = AEO_REAL(1),
                                     .forgetting_start = AEO_REAL(0.99),
                                     .forgetting_rate = AEO_REAL(0.99),
                                     .regularisation = AEO_REAL(0.1),
                                     .excitation_min = AEO_REAL(0.05),
                                     .growth_max = AEO_REAL(10),
                                     .guard_ratio = AEO_REAL(4)};
    aeo_regressor_t regressor;
    aeo_els_t els;
    aeo_real_t u[IN], y[OUT] = {0}, e[OUT] = {0};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, memory, sizeof memory / sizeof *memory));
    for (unsigned k = 0; k < 4000u && els.count.fell_back == 0u; k++) {
        fill(u, IN, &seed);
        for (unsigned i = 0; i < OUT; i++) {
            const aeo_real_t new_e = AEO_REAL(0.3) * (aeo_real_t)draw(&seed);
            y[i] = AEO_REAL(0.5) * y[i] + AEO_REAL(0.2) * (u[0] - u[1] + u[2]) + new_e + AEO_REAL(0.5) * e[i];
            e[i] = new_e;
        }
        if (k == 3000u) { /* 1/H explodes, and P is so small that nothing is learnt from it */
            for (size_t i = 0; i < AEO_RLS_FACTOR_WORDS(N_ELS); i++) {
                els.rls.factor[i] *= AEO_REAL(1e-6);
            }
            els.rls.theta[M_ELS + IN + OUT] = AEO_REAL(1.3);
        }
        const aeo_status_t status = aeo_els_step(&els, &regressor, u, y, 1000u * (uint64_t)k);
        TEST_ASSERT_EQUAL_INT(k < PAST ? AEO_FILLING : AEO_OK, status);
    }
    TEST_ASSERT_EQUAL_UINT32(1, els.count.fell_back);
    for (unsigned i = 0; i < OUT; i++) {
        for (unsigned j = 0; j < N_ELS; j++) {
            const aeo_real_t entry = aeo_els_theta(&els)[i * N_ELS + j];
            const int of_e = j + 1u < N_ELS && j % M_ELS >= IN + OUT;
            TEST_ASSERT_EQUAL_INT(!of_e, entry > 0 || entry < 0);
        }
    }
}

/* ---- lattice: slices ----------------------------------------------------------------------------------------------- */

/* Two stages of one state read, then another state restored: what follows is read of that one alone. */
static void a_restore_begins_a_read_out_anew(void)
{
    static aeo_real_t saved[SAVED], whole[L * N], slices[L * N];
    start_lattice(0.99, 0, 1e6);
    for (int k = 0; k < 100; k++) {
        feed_lattice(1.0, 0.1);
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_save(&lattice, saved, SAVED));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_read(&lattice, whole, L * N));
    for (int k = 0; k < 100; k++) {
        feed_lattice(1.0, 0.1);
    }
    for (int stages = 1; stages < P; stages++) {
        for (int j = 0; j < stages; j++) {
            TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_lattice_read_next(&lattice, slices, L * N));
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_restore(&lattice, saved, SAVED));
        for (int j = 0; j < P; j++) {
            TEST_ASSERT_EQUAL_INT(j + 1 < P ? AEO_FILLING : AEO_OK, aeo_lattice_read_next(&lattice, slices, L * N));
        }
        TEST_ASSERT_EQUAL_MEMORY(whole, slices, sizeof whole);
        feed_lattice(1.0, 0.1);
    }
}

/* ---- watch: what its constants do, measured ------------------------------------------------------------------------- */

enum { MEMORY = 128 }; /* exact in float: a block is one memory */
#define LAMBDA (AEO_REAL(1) - AEO_REAL(1) / AEO_REAL(128))

/* Samples y of one output, in memories, with a power and a withheld flag; returns how often P was to start anew. */
static unsigned watch_for(aeo_watch_t *watch, aeo_real_t *kept, unsigned samples, aeo_real_t y, aeo_real_t power,
                          int withheld)
{
    unsigned verdicts = 0;
    for (unsigned k = 0; k < samples; k++) {
        const aeo_real_t sample = k % 2u == 0u ? y : -y;
        verdicts += (unsigned)aeo_watch_take(watch, kept, 1, &sample, power, LAMBDA, withheld);
    }
    return verdicts;
}

/* Steps of which two of three are small: the level comes to lie where two of three pass it, wherever it was. */
static void a_level_is_passed_by_two_of_three_steps(void)
{
    aeo_real_t kept[AEO_WATCH_WORDS(1)], last = 0;
    aeo_watch_t watch;
    unsigned passed = 0;
    aeo_watch_start(&watch, kept, 1);
    for (unsigned k = 0; k < 40000u; k++) {
        const aeo_real_t y = (aeo_real_t)(0.3 * draw(&seed)), d = y - last;
        if (k >= 10000u) {
            passed += d * d > kept[2];
        }
        last = y;
        (void)aeo_watch_take(&watch, kept, 1, &y, AEO_REAL(1), LAMBDA, 0);
    }
    TEST_ASSERT_TRUE(fabs(passed / 30000.0 - 2.0 / 3.0) < 0.02); /* 0.003 of sampling; a level that moves: 0.01 */
}

/* Behind the first two blocks a level rises by e in eight memories, and 64 times slower while forgetting is withheld. */
static void a_level_moves_by_e_in_eight_memories(void)
{
    aeo_real_t kept[AEO_WATCH_WORDS(1)];
    aeo_watch_t watch;
    aeo_watch_start(&watch, kept, 1);
    (void)watch_for(&watch, kept, 2u * MEMORY, AEO_REAL(0), AEO_REAL(1), 0);
    kept[2] = AEO_REAL(1e-4);
    (void)watch_for(&watch, kept, 8u * MEMORY, AEO_REAL(0.25), AEO_REAL(1), 0);
    TEST_ASSERT_TRUE(fabs(log((double)kept[2] / 1e-4) - 1.0) < 0.02);
    kept[2] = AEO_REAL(1e-4);
    (void)watch_for(&watch, kept, 8u * MEMORY, AEO_REAL(0.25), AEO_REAL(0), 1);
    TEST_ASSERT_TRUE(fabs(log((double)kept[2] / 1e-4) - 1.0 / 64.0) < 0.002);
    kept[2] = AEO_REAL(1e-4);
    (void)watch_for(&watch, kept, 4u * MEMORY, AEO_REAL(0), AEO_REAL(1), 0); /* down it goes twice as fast */
    TEST_ASSERT_TRUE(fabs(log((double)kept[2] / 1e-4) + 1.0) < 0.05);
    TEST_ASSERT_TRUE(aeo_watch_holds(&watch, kept, 1));
}

/* The same law where a memory is so long that 1 + (1 - lambda) / 8 is 1 in float: up by r for each step passed, down by 2 r. */
static void a_level_moves_as_fast_in_every_memory(void)
{
    for (unsigned k = 8; k <= 24u; k += 4u) {
        for (unsigned how = 0; how < 3u; how++) { /* up, down, up while forgetting is withheld */
            const aeo_real_t rate = AEO_REAL(1) / (aeo_real_t)(1u << k);
            const double r = (double)rate / (how == 2u ? 512.0 : 8.0);
            aeo_real_t kept[AEO_WATCH_WORDS(1)];
            aeo_watch_t watch;
            aeo_watch_start(&watch, kept, 1);
            watch.blocks = 2;
            kept[2] = AEO_REAL(1e-4);
            if (r < 1e-8) {
                continue; /* too many samples for a test */
            }
            unsigned samples = (unsigned)(0.02 / r);
            samples = r < 4e-6 && samples < 64u * 4096u ? 64u * 4096u : samples; /* 64 that move the level */
            for (unsigned i = 0; i < samples; i++) {
                const aeo_real_t y = how == 1u ? AEO_REAL(0) : i % 2u == 0u ? AEO_REAL(0.25) : AEO_REAL(-0.25);
                (void)aeo_watch_take(&watch, kept, 1, &y, AEO_REAL(1), AEO_REAL(1) - rate, how == 2u);
            }
            const double moved = log((double)kept[2] / 1e-4), expected = samples * (how == 1u ? -2.0 * r : r);
            TEST_ASSERT_TRUE(fabs(moved / expected - 1.0) < 0.06); /* of sampling and rounding */
        }
    }
}

/* A square wave of 16 samples whose steps are large once in eight: the level stays below them, whatever the memory. */
static void a_periodic_output_is_seen_in_all_its_phases(void)
{
    aeo_real_t kept[AEO_WATCH_WORDS(1)];
    aeo_watch_t watch;
    aeo_watch_start(&watch, kept, 1);
    watch.blocks = 2;
    kept[2] = AEO_REAL(1e-4);
    for (unsigned i = 0; i < 1u << 22; i++) { /* (1 - 2 7) / 8 r a sample on average */
        const aeo_real_t y = i % 16u < 8u ? AEO_REAL(0.25) : AEO_REAL(-0.25);
        (void)aeo_watch_take(&watch, kept, 1, &y, AEO_REAL(1), AEO_REAL(1) - AEO_REAL(1) / AEO_REAL(1 << 22), 0);
    }
    TEST_ASSERT_TRUE(fabs(log((double)kept[2] / 1e-4) / (-13.0 / 64.0) - 1.0) < 0.06);
}

/* Two suspect blocks running release, one does not, nor one with a good one between. */
static void two_suspect_blocks_running_release(void)
{
    aeo_real_t kept[AEO_WATCH_WORDS(1)];
    aeo_watch_t watch;
    aeo_watch_start(&watch, kept, 1);
    TEST_ASSERT_EQUAL_UINT(0, watch_for(&watch, kept, 6u * MEMORY, AEO_REAL(0.5), AEO_REAL(1), 0));
    TEST_ASSERT_EQUAL_UINT(0, watch_for(&watch, kept, MEMORY, AEO_REAL(0.5), AEO_REAL(1), 2));
    TEST_ASSERT_EQUAL_UINT32(1, watch.suspected);
    TEST_ASSERT_EQUAL_UINT(0, watch_for(&watch, kept, MEMORY, AEO_REAL(0.5), AEO_REAL(1), 0));
    TEST_ASSERT_EQUAL_UINT32(0, watch.suspected);
    TEST_ASSERT_EQUAL_UINT(1, watch_for(&watch, kept, 2u * MEMORY, AEO_REAL(0.5), AEO_REAL(1), 2));
    TEST_ASSERT_EQUAL_UINT32(0, watch.suspected);
}

/* Withheld in more than half of a block's samples; a tenth of the steps are lively: one fewer is not suspect. */
static void a_block_is_suspect_from_half_and_from_a_tenth_on(void)
{
    aeo_real_t kept[AEO_WATCH_WORDS(1)];
    aeo_watch_t watch;
    for (unsigned withheld = 58; withheld <= 70u; withheld++) {
        aeo_watch_start(&watch, kept, 1);
        (void)watch_for(&watch, kept, 6u * MEMORY, AEO_REAL(0.5), AEO_REAL(1), 0);
        (void)watch_for(&watch, kept, withheld, AEO_REAL(0.5), AEO_REAL(1), 2);
        (void)watch_for(&watch, kept, MEMORY - withheld, AEO_REAL(0.5), AEO_REAL(1), 1);
        TEST_ASSERT_EQUAL_UINT32(0, watch.age);
        TEST_ASSERT_EQUAL_UINT32(withheld > 64u, watch.suspected);
    }
    for (unsigned steps = 5; steps <= 15u; steps++) {
        aeo_watch_start(&watch, kept, 1);
        (void)watch_for(&watch, kept, 6u * MEMORY, AEO_REAL(0.5), AEO_REAL(1), 0);
        const aeo_real_t rest = kept[3];
        for (unsigned k = 0; k < MEMORY; k++) { /* so many steps, then it stands still */
            const aeo_real_t y = k < steps && k % 2u == 0u ? -rest : k < steps ? rest : steps % 2u == 0u ? rest : -rest;
            (void)aeo_watch_take(&watch, kept, 1, &y, AEO_REAL(1), LAMBDA, 2);
        }
        TEST_ASSERT_EQUAL_UINT32(steps >= 12u, watch.suspected);
    }
}

/* Held over a hundred times what the block brings, which is 128 with a power of 1; usual is as much. */
static void held_a_hundred_times_over_is_suspect(void)
{
    aeo_real_t kept[AEO_WATCH_WORDS(1)];
    aeo_watch_t watch;
    for (unsigned above = 0; above < 2u; above++) {
        aeo_watch_start(&watch, kept, 1);
        (void)watch_for(&watch, kept, 6u * MEMORY, AEO_REAL(0.5), AEO_REAL(1), 0);
        const double left = pow(1.0 - 1.0 / MEMORY, MEMORY); /* of it after a block, and what the block adds */
        kept[0] = (aeo_real_t)(((above != 0u ? 1.01 : 0.99) * 100.0 * MEMORY - MEMORY * (1.0 - left)) / left);
        (void)watch_for(&watch, kept, MEMORY, AEO_REAL(0.5), AEO_REAL(1), 0);
        TEST_ASSERT_EQUAL_UINT32(above, watch.suspected);
    }
}

/* ---- saved windows, invariants ------------------------------------------------------------------------------------- */

/* What a window does not use of its room for present inputs is saved as 0: the same window gives the same array. */
static void a_saved_window_has_no_chance_in_it(void)
{
    enum { KEPT = AEO_REGRESSOR_SAVED_WORDS(3, 1, 2, 0) };
    static aeo_real_t window[AEO_REGRESSOR_WORDS(3, 1, 2, 0)], one[KEPT], other[KEPT];
    const aeo_regressor_config_t layout = {.inputs = 3, .outputs = 1, .past = 2, .feedthrough = 4u, .period_us = 1000};
    aeo_regressor_t regressor;
    aeo_real_t u[3] = {1, 2, 3}, y[1] = {4};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window));
    (void)aeo_regressor_push(&regressor, u, y, 0);
    memset(one, 0x11, sizeof one);
    memset(other, 0x22, sizeof other);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&regressor, one, KEPT));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_save(&regressor, other, KEPT));
    TEST_ASSERT_EQUAL_MEMORY(one, other, sizeof one);
    TEST_ASSERT_TRUE(aeo_regressor_invariants_hold(&regressor));
    aeo_real_t *const parts[] = {regressor.offset, regressor.inverse + 3, regressor.maximum + 3, regressor.z,
                                 regressor.block};
    for (unsigned place = 0; place < sizeof parts / sizeof *parts; place++) { /* each part alone */
        aeo_real_t *const at = parts[place];
        const aeo_real_t good = *at;
        *at = make_not_finite(0);
        TEST_ASSERT_FALSE(aeo_regressor_invariants_hold(&regressor));
        *at = good;
    }
}

/* A range of one value is a range: what the channel is stuck at is all it may have. */
static void a_range_may_be_one_value(void)
{
    static aeo_real_t window[AEO_REGRESSOR_WORDS(1, 1, 1, 0)];
    static const aeo_real_t only[2] = {2, -3};
    const aeo_regressor_config_t layout = {
        .inputs = 1, .outputs = 1, .past = 1, .period_us = 1000, .minimum = only, .maximum = only};
    aeo_regressor_t regressor;
    aeo_real_t u[1] = {2}, y[1] = {-3};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_regressor_init(&regressor, &layout, window, sizeof window / sizeof *window));
    TEST_ASSERT_EQUAL_INT(AEO_FILLING, aeo_regressor_push(&regressor, u, y, 0));
    u[0] = AEO_REAL(2.5);
    TEST_ASSERT_EQUAL_INT(AEO_E_RANGE, aeo_regressor_push(&regressor, u, y, 1000));
}

/* A filter that forgets nothing has no memory to compare with: nothing is watched, nothing released. */
static void without_forgetting_nothing_is_watched(void)
{
    static aeo_real_t memory[AEO_RLS_WORDS(ORDER, 1)];
    const aeo_rls_config_t config = {ORDER, 1, AEO_REAL(1), AEO_REAL(1), AEO_REAL(0), AEO_REAL(8)};
    aeo_rls_t rls;
    aeo_real_t z[ORDER];
    start_lattice(1.0, 0, 1000);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, sizeof memory / sizeof *memory));
    for (int k = 0; k < 20; k++) {
        feed_lattice(1.0, 0.1);
        fill(z, ORDER, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, z));
    }
    TEST_ASSERT_EQUAL_UINT32(0, lattice.watch.age);
    TEST_ASSERT_EQUAL_UINT32(0, rls.watch.age);
    TEST_ASSERT_EQUAL_UINT32(0, rls.scan_row);
}

static void a_scan_beyond_the_last_row_is_damage(void)
{
    static aeo_real_t memory[AEO_RLS_WORDS(ORDER, 1)];
    const aeo_rls_config_t config = {ORDER, 1, AEO_REAL(0.99), AEO_REAL(1), AEO_REAL(0), AEO_REAL(8)};
    aeo_rls_t rls;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, sizeof memory / sizeof *memory));
    rls.scan_row = ORDER - 1;
    TEST_ASSERT_TRUE(aeo_rls_invariants_hold(&rls));
    rls.scan_row = ORDER;
    TEST_ASSERT_FALSE(aeo_rls_invariants_hold(&rls));
}

/* With P = I / rho a quiet sample would be news from |z|^2 = gate * rho on: at rho = 4 that is sixteen times gate / rho. */
static void what_a_fresh_covariance_would_take_is_told_to_the_watch(void)
{
    static aeo_real_t memory[AEO_RLS_WORDS(ORDER, 1)];
    const aeo_rls_config_t config = {ORDER, 1, AEO_REAL(0.99), AEO_REAL(4), AEO_REAL(1), AEO_REAL(8)};
    const double gate = 0.01 * ORDER; /* excitation_min (1 - lambda) n */
    for (unsigned above = 0; above < 2u; above++) {
        aeo_rls_t rls;
        aeo_real_t z[ORDER] = {0}, y = 0;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &config, memory, sizeof memory / sizeof *memory));
        aeo_strips_start(rls.factor, ORDER, AEO_REAL(1e-3)); /* so small that nothing is news */
        z[0] = (aeo_real_t)sqrt((above != 0u ? 1.1 : 0.9) * gate * 4.0);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, z, &y));
        TEST_ASSERT_EQUAL_UINT32(1, rls.count.withheld);
        TEST_ASSERT_EQUAL_UINT32(above, rls.watch.withheld);
    }
}

/* The same of the lattice, whose gate keeps out the sample behind a quiet one. */
static void what_fresh_covariances_would_take_is_told_to_the_watch(void)
{
    for (unsigned above = 0; above < 2u; above++) {
        static aeo_real_t memory[WORDS];
        aeo_lattice_config_t config = make_lattice_config(0.99, 1.0, 1000);
        aeo_lattice_t self;
        aeo_real_t z[N] = {0}, y[L] = {0};
        config.regularisation = AEO_REAL(4);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_init(&self, &config, memory, WORDS));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&self, z, y)); /* nothing: quiet */
        z[N - 1] = (aeo_real_t)sqrt((above != 0u ? 1.1 : 0.9) * 0.01 * N * 4.0);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_lattice_update(&self, z, y));
        TEST_ASSERT_EQUAL_UINT32(above, self.watch.withheld);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(bounded_variances_are_those_of_a_full_covariance);
    RUN_TEST(quiet_samples_are_absorbed_without_forgetting);
    RUN_TEST(what_a_lattice_follows_leaves_its_innovation);
    RUN_TEST(without_a_gate_nothing_is_withheld);
    RUN_TEST(variances_at_the_bound_are_left_alone);
    RUN_TEST(all_variances_are_checked_before_any_doubles);
    RUN_TEST(a_fall_back_clears_the_columns_of_e_alone);
    RUN_TEST(a_restore_begins_a_read_out_anew);
    RUN_TEST(a_level_is_passed_by_two_of_three_steps);
    RUN_TEST(a_level_moves_by_e_in_eight_memories);
    RUN_TEST(a_level_moves_as_fast_in_every_memory);
    RUN_TEST(a_periodic_output_is_seen_in_all_its_phases);
    RUN_TEST(two_suspect_blocks_running_release);
    RUN_TEST(a_block_is_suspect_from_half_and_from_a_tenth_on);
    RUN_TEST(held_a_hundred_times_over_is_suspect);
    RUN_TEST(a_saved_window_has_no_chance_in_it);
    RUN_TEST(a_range_may_be_one_value);
    RUN_TEST(without_forgetting_nothing_is_watched);
    RUN_TEST(a_scan_beyond_the_last_row_is_damage);
    RUN_TEST(what_a_fresh_covariance_would_take_is_told_to_the_watch);
    RUN_TEST(what_fresh_covariances_would_take_is_told_to_the_watch);
    return UNITY_END();
}
