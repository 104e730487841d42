/* Numbers that were tuned, against a second writing of the rules they belong to, in double, from the headers' words. */
#include "aeolid/els.h"
#include "aeolid/fast_rls.h"
#include "aeolid/watch.h"
#include "guard.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static uint64_t seed;

void setUp(void)
{
    seed = 20261126u;
}

void tearDown(void)
{
}

/* ---- fast_rls: how long arrays live ------------------------------------------------------------------------------- */

/* q = n (1 - lambda). A follower warms up for half a life of life + tail / q memories, at least warm and at most twice
 * that; up to q = 0.2 an array lives on. Figures: docs/decisions/filters.md, by precision. */
static void arrays_live_as_long_as_was_measured(void)
{
    static aeo_real_t memory[20000];
    const double warm_least = AEO_REAL_BYTES == 8 ? 14 : 7, constant = AEO_REAL_BYTES == 8 ? 26 : 8,
                 tail = AEO_REAL_BYTES == 8 ? 10 : 6;
    static const double rates[] = {1e-5, 1e-4, 1e-3, 4e-3, 0.01, 0.03, 0.1};
    aeo_fast_rls_t filter;
    for (unsigned i = 0; i < 7u * 4u; i++) {
        const uint16_t past = (uint16_t)(2u + 3u * (i / 7u)), block = (uint16_t)(1u + i / 7u);
        const aeo_fast_rls_config_t config = {.past = past,
                                              .block = block,
                                              .outputs = 1,
                                              .forgetting = (aeo_real_t)(1.0 - rates[i % 7u]),
                                              .regularisation = AEO_REAL(1),
                                              .growth_max = AEO_REAL(100)};
        const double rate = 1.0 - (double)config.forgetting, n = past * block, q = n * rate;
        double warm = 2.0 * warm_least;
        if (aeo_fast_rls_init(&filter, &config, memory, sizeof memory / sizeof *memory) != AEO_OK) {
            continue; /* lambda^p below a thousandth */
        }
        if (q > 0.2) {
            const double life = constant + tail / q;
            warm = fmax(warm_least, fmin(life / 2.0, warm));
            TEST_ASSERT_UINT32_WITHIN(1u + (uint32_t)(life / rate * 1e-4), (uint32_t)((life - warm) / rate),
                                      filter.life);
        } else {
            TEST_ASSERT_EQUAL_HEX32(UINT32_MAX, filter.life);
        }
        TEST_ASSERT_UINT32_WITHIN(1u + (uint32_t)(warm / rate * 1e-4), (uint32_t)(warm / rate) + 2u * past,
                                  filter.warm);
        TEST_ASSERT_UINT32_WITHIN(1, (uint32_t)fmin(4.0 * n, 0.1 / rate), filter.wait);
        TEST_ASSERT_TRUE(fabs((double)filter.feedback - fmin(0.75, 0.07 / (q * q))) < 1e-4);
    }
}

/* Where nothing is forgotten an array is warm after fifty samples a regressor, and lives on. */
static void without_forgetting_arrays_warm_up_for_fifty_samples_each(void)
{
    static aeo_real_t memory[4000];
    aeo_fast_rls_t filter;
    for (uint16_t past = 1; past < 8u; past++) {
        const aeo_fast_rls_config_t config = {.past = past,
                                              .block = 3,
                                              .outputs = 1,
                                              .forgetting = AEO_REAL(1),
                                              .regularisation = AEO_REAL(1),
                                              .growth_max = AEO_REAL(100)};
        memset(&filter, 0x55, sizeof filter);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&filter, &config, memory, 4000));
        TEST_ASSERT_EQUAL_UINT32(50u * 3u * past, filter.warm);
        TEST_ASSERT_EQUAL_UINT32(4u * 3u * past, filter.wait);
        TEST_ASSERT_EQUAL_HEX32(UINT32_MAX, filter.life);
    }
}

/* ---- els: the guard ------------------------------------------------------------------------------------------------ */

typedef struct {
    double power, rest, varx, share;
} levels_t;

static double level_of(const levels_t *at)
{
    return fmax(fmax(at->varx, at->share * at->rest), 1e-12);
}

/* The mean over the second half of the start; then means over 64 samples, of which one counts at most four limits of
 * power and 1024 times the level of the rest; the share falls over 256 samples and rises over 4096. */
static int guard_in_double(levels_t *at, double innovation, double rest, uint32_t since, uint32_t wait, double ratio)
{
    const double power = pow(fmin(fabs(innovation), 1e6), 2), left = pow(fmin(fabs(rest), 1e6), 2);
    if (since > wait) {
        at->rest += (fmin(left, 1024.0 * fmax(at->rest, 1e-12)) - at->rest) / 64.0;
        const double limit = ratio * level_of(at), share = fmin(at->power / fmax(at->rest, 1e-12), 1e6);
        at->power += (fmin(power, 4.0 * limit) - at->power) / 64.0;
        at->share += (share - at->share) / (share < at->share ? 256.0 : 4096.0);
        return at->power > limit;
    }
    if (since > wait / 2u) {
        const double count = since - wait / 2u;
        at->varx += (power - at->varx) / count;
        at->rest += (left - at->rest) / count;
        at->power = at->varx;
        at->share = fmin(at->power / fmax(at->rest, 1e-12), 1e6);
    }
    return 0;
}

static void near(double expected, aeo_real_t found)
{
    TEST_ASSERT_TRUE(fabs(expected - (double)found) <= 1e-3 * fabs(expected) + 1e-30);
}

static void the_guard_is_its_rule(void)
{
    static const double amplitudes[] = {1, 1e-7, 30, 2e6, 0};
    for (unsigned run = 0; run < 30u; run++) {
        aeo_real_t words[AEO_GUARD_WORDS] = {0};
        levels_t at = {0, 0, 0, 0};
        const uint32_t wait = 16u + 7u * run;
        unsigned alarms = 0, close = 0, expected = 0;
        for (uint32_t k = 1; k < 1500u; k++) {
            const double now = k > 300u && k % 400u < 200u ? amplitudes[run % 5u] : 1.0;
            const aeo_real_t e = (aeo_real_t)(0.1 * now * draw(&seed)), rest = (aeo_real_t)(now * draw(&seed));
            const int told = aeo_guard_watch(words, e, rest, k, wait, AEO_REAL(4));
            const int right = guard_in_double(&at, (double)e, (double)rest, k, wait, 4.0);
            near(at.power, words[0]);
            near(at.rest, words[1]);
            near(at.varx, words[2]);
            near(at.share, words[3]);
            near(fmin(6.0 * sqrt(level_of(&at)), 1e6), aeo_guard_limit(words));
            TEST_ASSERT_TRUE(aeo_guard_holds(words, 1));
            alarms += told != 0;
            expected += right != 0;
            close += fabs(at.power - 4.0 * level_of(&at)) < 2e-3 * at.power;
        }
        TEST_ASSERT_TRUE(alarms <= expected + close && expected <= alarms + close);
    }
}

/* What the guard of els is shown: the innovation, and the residual without the terms in e, of at most tenfold the output and
 * its scale. Now and then a fault throws theta far off. */
static void els_shows_the_guard_what_is_left_without_e(void)
{
    enum { ORDER = 9, OUT = 2, PAST = 1, BLOCK = 8 };
    static aeo_real_t memory[AEO_ELS_WORDS(ORDER, OUT)];
    const aeo_els_config_t config = {.regressors = ORDER,
                                     .outputs = OUT,
                                     .past = PAST,
                                     .present = 1,
                                     .varx_samples = 20,
                                     .forgetting = AEO_REAL(1),
                                     .forgetting_start = AEO_REAL(1),
                                     .regularisation = AEO_REAL(1),
                                     .growth_max = AEO_REAL(100),
                                     .guard_ratio = AEO_REAL(100)};
    aeo_els_t els;
    levels_t at[OUT] = {{0, 0, 0, 0}};
    unsigned cut = 0, large = 0;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, memory, sizeof memory / sizeof *memory));
    for (unsigned k = 1; k < 600u; k++) {
        aeo_real_t z[ORDER], y[OUT];
        fill(z, ORDER, &seed);
        for (unsigned i = 0; i < OUT; i++) {
            y[i] = (aeo_real_t)((k % 3u == 0u ? 4.0 : 0.5) * draw(&seed));
        }
        if (k > 20u && k % 25u == 0u) {
            els.rls.theta[1] = els.rls.theta[ORDER + 2] = (aeo_real_t)(k % 50u == 0u ? 60.0 : -60.0);
            els.rls.theta[BLOCK - 1] = els.rls.theta[ORDER + BLOCK - 2] = AEO_REAL(5);
        }
        const uint32_t fell_back = els.count.fell_back, since = els.since;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&els, z, y));
        if (els.count.fell_back > fell_back) {
            memset(at, 0, sizeof at);
            continue;
        }
        for (unsigned i = 0; i < OUT; i++) {
            const double most = 10.0 * fmax(1.0, fabs((double)y[i]));
            double rest = (double)aeo_els_residual(&els)[i];
            for (unsigned j = BLOCK - OUT; j < BLOCK; j++) {
                rest += (double)els.rls.theta[i * ORDER + j] * (double)z[j];
            }
            cut += fabs(rest) > most;
            large += fabs(rest) > 10.0 && fabs((double)y[i]) > 1.0;
            rest = fmax(-most, fmin(most, rest));
            (void)guard_in_double(&at[i], (double)aeo_els_innovation(&els)[i], rest, since + 1u, els.wait, 100.0);
            near(at[i].power, els.levels[4u * i]);
            near(at[i].rest, els.levels[4u * i + 1u]);
            near(at[i].varx, els.levels[4u * i + 2u]);
            near(at[i].share, els.levels[4u * i + 3u]);
        }
    }
    TEST_ASSERT_TRUE(cut > 10u && large > 5u);
}

/* Each output's residual is cut at its own limit before it is fed back. */
static void each_output_has_its_own_limit(void)
{
    enum { ORDER = 9, OUT = 3 };
    static aeo_real_t memory[AEO_ELS_WORDS(ORDER, OUT)];
    const aeo_els_config_t config = {.regressors = ORDER,
                                     .outputs = OUT,
                                     .past = 1,
                                     .varx_samples = 20,
                                     .forgetting = AEO_REAL(1),
                                     .forgetting_start = AEO_REAL(1),
                                     .regularisation = AEO_REAL(1),
                                     .growth_max = AEO_REAL(100),
                                     .guard_ratio = AEO_REAL(100)};
    aeo_els_t els;
    unsigned cut[OUT] = {0, 0, 0};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, memory, sizeof memory / sizeof *memory));
    for (unsigned k = 1; k < 1200u; k++) {
        aeo_real_t z[ORDER], y[OUT];
        fill(z, ORDER, &seed);
        for (unsigned i = 0; i < OUT; i++) { /* of three sizes, now and then an outlier of one of them */
            const double size = pow(10.0, -1.0 * i) * (k > 100u && k % 120u == 40u * i ? 1000.0 : 1.0);
            y[i] = (aeo_real_t)(size * draw(&seed));
        }
        const uint32_t fell_back = els.count.fell_back;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_update(&els, z, y));
        if (els.count.fell_back > fell_back || els.since <= els.wait) {
            continue;
        }
        for (unsigned i = 0; i < OUT; i++) {
            const double limit = (double)aeo_guard_limit(els.levels + i * AEO_GUARD_WORDS);
            const double rest = (double)aeo_els_residual(&els)[i];
            near(fmax(-limit, fmin(limit, rest)), aeo_els_feedback(&els)[i]);
            cut[i] += fabs(rest) > limit;
        }
    }
    TEST_ASSERT_TRUE(cut[0] > 3u && cut[1] > 3u && cut[2] > 3u);
    TEST_ASSERT_EQUAL_UINT32(cut[0] + cut[1] + cut[2], els.count.limited);
}

/* Levels are powers: none below 0, none above what two amplitudes of a million have. */
static void levels_that_no_guard_has_are_noticed(void)
{
    for (unsigned i = 0; i < 2u * AEO_GUARD_WORDS; i++) {
        aeo_real_t words[2u * AEO_GUARD_WORDS] = {0};
        words[i] = AEO_REAL(2e12);
        TEST_ASSERT_TRUE(aeo_guard_holds(words, 2));
        words[i] = AEO_REAL(2.001e12);
        TEST_ASSERT_FALSE(aeo_guard_holds(words, 2));
        TEST_ASSERT_EQUAL_INT(i >= AEO_GUARD_WORDS, aeo_guard_holds(words, 1));
        words[i] = AEO_REAL(-1e-9);
        TEST_ASSERT_FALSE(aeo_guard_holds(words, 2));
    }
}

/* ---- els: fall-backs ----------------------------------------------------------------------------------------------- */

/* A start that is given puts the length of the next ones back. */
static void a_given_start_forgets_the_fall_backs(void)
{
    static aeo_real_t memory[AEO_ELS_WORDS(6, 1)], theta[6];
    const aeo_els_config_t config = {.regressors = 6,
                                     .outputs = 1,
                                     .past = 2,
                                     .varx_samples = 50,
                                     .forgetting = AEO_REAL(0.99),
                                     .forgetting_start = AEO_REAL(0.98),
                                     .forgetting_rate = AEO_REAL(0.9),
                                     .regularisation = AEO_REAL(1),
                                     .growth_max = AEO_REAL(100),
                                     .guard_ratio = AEO_REAL(4)};
    aeo_els_t els;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_init(&els, &config, memory, sizeof memory / sizeof *memory));
    els.backoff = 3;
    els.since = 77;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_els_start(&els, theta));
    TEST_ASSERT_EQUAL_UINT32(0, els.backoff);
    TEST_ASSERT_EQUAL_UINT32(50, els.wait);
    TEST_ASSERT_EQUAL_UINT32(0, els.since);
    els.backoff = 3;
    aeo_els_reset(&els);
    TEST_ASSERT_EQUAL_UINT32(0, els.backoff);
    TEST_ASSERT_EQUAL_UINT32(50, els.wait);
}

/* ---- the watch ----------------------------------------------------------------------------------------------------- */

enum { L = 2 };

typedef struct {
    double held, brought, level[L], last[L];
    uint32_t age, moved, withheld, blocks, suspected;
} watched_t;

static int watch_in_double(watched_t *at, const aeo_real_t *y, double power, double lambda, int withheld)
{
    const double rate = 1.0 - lambda;
    const double r = fmin(0.25, rate * (at->blocks < 2u ? 8.0 : withheld ? 1.0 / 512.0 : 1.0 / 8.0));
    for (unsigned i = 0; i < L; i++) {
        const double step = pow((double)y[i] - at->last[i], 2);
        at->last[i] = (double)y[i];
        if (step > at->level[i]) {
            at->moved++;
            at->level[i] = step < 16.0 ? fmin(1.0, at->level[i] * (1.0 + r)) : at->level[i];
        } else if (at->level[i] > 1e-12) {
            at->level[i] *= 1.0 - 2.0 * r;
        }
    }
    at->held = (withheld ? at->held : lambda * at->held) + power;
    at->brought += power;
    at->withheld += withheld > 1;
    at->age++;
    if (at->age < 16u || (double)at->age * rate < 1.0 - 1e-6) {
        return 0;
    }
    const int lively = at->moved / L >= at->age / 10u;
    const int full = at->held * (double)at->age * rate > 100.0 * at->brought;
    const int suspect = lively && (at->withheld > at->age / 2u || full);
    const int verdict = suspect && at->suspected;
    at->suspected = suspect && !verdict;
    at->age = at->moved = at->withheld = 0u;
    at->blocks += at->blocks < 2u;
    at->brought = 0.0;
    return verdict;
}

/* Lambda of so many halves that float holds it; blocks of 16 to 256 samples; calm, lively, with a fault, withheld. */
static void the_watch_is_its_rule(void)
{
    static const double lambdas[] = {0.5, 0.9375, 0.96875, 0.99609375};
    unsigned verdicts = 0;
    for (unsigned run = 0; run < 32u; run++) {
        aeo_real_t words[AEO_WATCH_WORDS(L)];
        aeo_watch_t self;
        watched_t at = {.level = {1e-3, 1e-3}};
        const double lambda = lambdas[run % 4u];
        aeo_watch_start(&self, words, L);
        for (unsigned k = 0; k < 6000u; k++) {
            const unsigned part = (k / 1000u + run / 4u) % 6u;
            const double amplitude = part == 1u ? 1e-4 : part == 2u ? 30.0 : 0.5;
            const int withheld = part == 3u ? 2 : part == 4u ? (int)(k % 3u) : 0;
            const double rare =
                run >= 16u && k % (4u + 5u * (run % 13u)) != 0u ? 0.0 : 1.0; /* few steps pass their level */
            const aeo_real_t y[L] = {(aeo_real_t)(rare * amplitude * draw(&seed)),
                                     (aeo_real_t)(rare * 0.1 * draw(&seed))};
            const double power = (double)(aeo_real_t)(part == 5u && k % 1000u < 100u ? 1e6 : amplitude * amplitude);
            const int right = watch_in_double(&at, y, power, lambda, withheld);
            const int told = aeo_watch_take(&self, words, L, y, (aeo_real_t)power, (aeo_real_t)lambda, withheld);
            TEST_ASSERT_EQUAL_INT(right, told);
            if (told) {
                aeo_watch_forget(&self, words, (aeo_real_t)power);
                at = (watched_t){power, 0, {at.level[0], at.level[1]}, {at.last[0], at.last[1]}, 0, 0, 0, at.blocks, 0};
                verdicts++;
            }
            near(at.held, words[0]);
            for (unsigned i = 0; i < L; i++) { /* rounding decides which step to the floor is the last */
                const int ends = at.level[i] < 1.01e-12 && words[2u + i] < AEO_REAL(1.01e-12);
                at.level[i] = ends ? (double)words[2u + i] : at.level[i];
                near(at.level[i], words[2u + i]);
            }
            TEST_ASSERT_EQUAL_UINT32(at.age, self.age);
            TEST_ASSERT_EQUAL_UINT32(at.moved, self.moved);
            TEST_ASSERT_EQUAL_UINT32(at.withheld, self.withheld);
            TEST_ASSERT_EQUAL_UINT32(at.blocks, self.blocks);
            TEST_ASSERT_EQUAL_UINT32(at.suspected, self.suspected);
            TEST_ASSERT_TRUE(aeo_watch_holds(&self, words, L));
        }
    }
    TEST_ASSERT_TRUE(verdicts > 20u);
}

/* A level stays within 1e-12 ... 1, from which one step may go a quarter down. */
static void levels_that_no_watch_has_are_noticed(void)
{
    static const double good[] = {1e-12, 2.6e-13, 1.0}, bad[] = {2.4e-13, 1.001, 0.0, -1.0};
    aeo_real_t words[AEO_WATCH_WORDS(L)];
    aeo_watch_t self;
    for (unsigned i = 0; i < L; i++) {
        for (unsigned j = 0; j < 4u; j++) {
            aeo_watch_start(&self, words, L);
            words[2u + i] = (aeo_real_t)good[j % 3u];
            TEST_ASSERT_TRUE(aeo_watch_holds(&self, words, L));
            words[2u + i] = (aeo_real_t)bad[j];
            TEST_ASSERT_FALSE(aeo_watch_holds(&self, words, L));
            words[2u + i] = AEO_REAL(1e-12) / AEO_REAL(4); /* no step leads there: the floor is left by less */
            TEST_ASSERT_FALSE(aeo_watch_holds(&self, words, L));
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(arrays_live_as_long_as_was_measured);
    RUN_TEST(without_forgetting_arrays_warm_up_for_fifty_samples_each);
    RUN_TEST(the_guard_is_its_rule);
    RUN_TEST(els_shows_the_guard_what_is_left_without_e);
    RUN_TEST(each_output_has_its_own_limit);
    RUN_TEST(levels_that_no_guard_has_are_noticed);
    RUN_TEST(a_given_start_forgets_the_fall_backs);
    RUN_TEST(the_watch_is_its_rule);
    RUN_TEST(levels_that_no_watch_has_are_noticed);
    return UNITY_END();
}
