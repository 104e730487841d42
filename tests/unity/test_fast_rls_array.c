/* One sample of an array of the fast filter against the equations of its header, written again in double; and what happens
 * when arrays follow one another: who makes the gain, how long theta waits, what the watch is told. */
#include "aeolid/fast_rls.h"
#include "aeolid/rls.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { P = 4, M = 3, L = 2, N = P * M, WORDS = AEO_FAST_RLS_WORDS(P, M, 0, L) };

static aeo_fast_rls_t fast;
static aeo_real_t memory[WORDS], z[N], y[L];
static uint64_t seed;

void setUp(void)
{
    seed = 20261128u;
    memset(z, 0, sizeof z);
}

void tearDown(void)
{
}

static void start(double lambda)
{
    const aeo_fast_rls_config_t config = {.past = P,
                                          .block = M,
                                          .outputs = L,
                                          .forgetting = (aeo_real_t)lambda,
                                          .regularisation = AEO_REAL(0.5),
                                          .growth_max = AEO_REAL(1e4)};
    memset(z, 0, sizeof z);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, memory, WORDS));
}

/* One sample of channels that a first-order filter colours. */
static void feed(unsigned samples)
{
    for (; samples > 0u; samples--) {
        aeo_real_t newest[M];
        fill(newest, M, &seed);
        for (size_t c = 0; c < M; c++) {
            newest[c] += AEO_REAL(0.7) * z[N - M + c];
        }
        memmove(z, z + M, (N - M) * sizeof *z);
        memcpy(z + N - M, newest, sizeof newest);
        fill(y, L, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(&fast));
    }
}

/* ---- the recursion --------------------------------------------------------------------------------------------------- */

typedef struct {
    double forward[M][N], backward[M][N], kappa[N], inverse[M][M], energy[M][M], news, apart, size;
    uint32_t age;
} array_t;

/* An array as it is, with F^{-1} = S S' multiplied out. */
static array_t look_at(const aeo_fast_rls_array_t *from)
{
    array_t to;
    double s[M][M] = {{0}};
    const aeo_real_t *entry = from->factor;
    memset(&to, 0, sizeof to);
    for (size_t c = 0; c < M; c++) {
        for (size_t i = c; i < M; i++) {
            s[i][c] = (double)*entry++;
        }
        for (size_t j = 0; j < N; j++) {
            to.forward[c][j] = (double)from->forward[c * N + j];
            to.backward[c][j] = (double)from->backward[c * N + j];
        }
    }
    for (size_t i = 0; i < M; i++) {
        for (size_t j = 0; j < M; j++) {
            to.energy[i][j] = (double)from->energy[i * M + j];
            for (size_t c = 0; c < M; c++) {
                to.inverse[i][j] += s[i][c] * s[j][c];
            }
        }
    }
    for (size_t j = 0; j < N; j++) {
        to.kappa[j] = (double)from->gain[j];
    }
    to.news = (double)from->scalar[0];
    to.apart = (double)from->scalar[1];
    to.size = (double)from->scalar[2];
    to.age = from->age;
    return to;
}

static double dot(const double *a, const double *b, size_t count)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* The equations of fast_rls.h; window holds [x_k; w_k] = [w_{k-1}; v_k]. */
static void step_in_double(array_t *at, const double *window, double lambda, double c)
{
    double e[M], f[M], r[M], apart[M], both[N + M], square = lambda * at->news;
    const double gamma_before = 1.0 / at->news;
    at->age++;
    for (size_t i = 0; i < M; i++) {
        e[i] = window[N + i] - dot(at->forward[i], window, N);
    }
    for (size_t i = 0; i < M; i++) {
        f[i] = dot(at->inverse[i], e, M);
        square += f[i] * e[i];
    }
    memcpy(both, at->kappa, sizeof at->kappa);
    for (size_t i = 0; i < M; i++) {
        both[N + i] = f[i] / lambda;
        for (size_t j = 0; j < M; j++) { /* (lambda F + gamma e e')^{-1} */
            at->inverse[i][j] = (at->inverse[i][j] - f[i] * f[j] / square) / lambda;
        }
        for (size_t j = 0; j < N; j++) {
            both[j] -= at->forward[i][j] * f[i] / lambda;
            at->forward[i][j] += e[i] * gamma_before * at->kappa[j];
        }
    }
    for (size_t i = 0; i < M; i++) {
        const int unseen = at->age <= P + 1u && i + at->age * M < N + M;
        const double raw = window[i] - dot(at->backward[i], window + M, N);
        apart[i] = unseen ? 0.0 : raw - lambda * dot(at->energy[i], both, M);
        r[i] = unseen ? 0.0 : raw + c * apart[i];
    }
    for (size_t j = 0; j < N; j++) {
        at->kappa[j] = both[M + j];
        for (size_t i = 0; i < M; i++) {
            at->kappa[j] += at->backward[i][j] * both[i];
        }
    }
    at->news = 1.0 + fmax(dot(at->kappa, window + M, N), 0.0);
    double disagreement = 0.0, size = 0.0;
    for (size_t i = 0; i < M; i++) {
        for (size_t j = 0; j < M; j++) {
            at->energy[i][j] = lambda * at->energy[i][j] + r[i] * r[j] / at->news;
        }
        disagreement += apart[i] * apart[i] / (at->news * at->energy[i][i]);
        size += r[i] * r[i] / (at->news * at->energy[i][i]);
        for (size_t j = 0; j < N; j++) {
            at->backward[i][j] += r[i] * at->kappa[j] / at->news;
        }
    }
    at->apart += (disagreement - at->apart) / 64.0;
    at->size += (size - at->size) / 64.0;
}

/* `count` numbers differ by less than a small part of the largest of them. */
static void near(const double *expected, const double *found, size_t count, double part)
{
    double largest = 0.0, worst = 0.0;
    for (size_t i = 0; i < count; i++) {
        largest = fmax(largest, fabs(expected[i]));
        worst = fmax(worst, fabs(expected[i] - found[i]));
    }
    TEST_ASSERT_TRUE(worst <= part * largest + 1e-30);
}

/* Each sample starts from the array as the filter has it, so rounding does not add up. -ffast-math takes roots by estimate. */
static void each_sample_follows_the_equations(void)
{
    static const double lambdas[] = {1.0, 0.99, 0.9};
    for (unsigned run = 0; run < 3u; run++) {
        setUp();
        start(lambdas[run]);
        for (unsigned k = 0; k < 400u; k++) {
            double window[N + M];
            const uint32_t renewed = fast.count.renewed, active = fast.active;
            const uint32_t follows = fast.array[active ^ 1u].age;
            array_t expected = look_at(&fast.array[active]), second = look_at(&fast.array[active ^ 1u]);
            feed(1);
            for (size_t j = 0; j < N + M; j++) {
                window[j] = (double)fast.window[j];
            }
            if (fast.count.renewed != renewed) {
                continue;
            }
            step_in_double(&expected, window, (double)fast.config.forgetting, (double)fast.feedback);
            array_t found = look_at(&fast.array[active]);
            const double part = 1000.0 * (double)AEO_REAL_EPSILON;
            for (unsigned array = 0; array < (follows > 0u ? 2u : 1u); array++) {
                if (array == 1u) {
                    expected = second;
                    step_in_double(&expected, window, (double)fast.config.forgetting, (double)fast.feedback);
                    found = look_at(&fast.array[active ^ 1u]);
                }
                near(expected.forward[0], found.forward[0], M * N, part);
                near(expected.backward[0], found.backward[0], M * N, part);
                near(expected.kappa, found.kappa, N, part);
                near(expected.inverse[0], found.inverse[0], M * M, part);
                near(expected.energy[0], found.energy[0], M * M, part);
                near(&expected.news, &found.news, 1, part);
                near(&expected.size, &found.size, 1, part);
                /* a difference of errors that are alike: its own rounding is all there is of it after the start */
                TEST_ASSERT_TRUE(fabs(expected.apart - found.apart) <=
                                 1e-3 * expected.apart + part * expected.size / 64.0);
                TEST_ASSERT_EQUAL_UINT32(expected.age, found.age);
            }
        }
    }
    TEST_ASSERT_TRUE(fast.count.renewed > 0u); /* lambda = 0.9: the second array was seen, too */
}

/* What a sample adds to the mean when the two errors disagree, because E is no longer that of the errors. */
static void disagreement_is_a_mean_over_64_samples(void)
{
    start(0.99);
    feed(300);
    for (size_t i = 0; i < M * M; i++) {
        fast.array[0].energy[i] *= AEO_REAL(1.02);
    }
    const double before = (double)fast.array[0].scalar[1];
    array_t expected = look_at(&fast.array[0]);
    double window[N + M];
    feed(1);
    for (size_t j = 0; j < N + M; j++) {
        window[j] = (double)fast.window[j];
    }
    step_in_double(&expected, window, 0.99, (double)fast.feedback);
    TEST_ASSERT_TRUE(expected.apart > 4.0 * before);
    TEST_ASSERT_TRUE(fabs(expected.apart - (double)fast.array[0].scalar[1]) < 0.02 * expected.apart);
}

/* ---- blocks of every size ---------------------------------------------------------------------------------------------- */

/* The kernels take rows and columns by twos, fours and eights, and what is left one by one. With lambda = 1, theta is that
 * of rls.h from the same prior, which with rho everywhere needs one past block. */
static void blocks_of_every_size_agree_with_rls(void)
{
    enum { MOST = 21, OUTPUTS = 5 };
    static aeo_real_t own[AEO_FAST_RLS_WORDS(1, MOST, 0, OUTPUTS)], other[AEO_RLS_WORDS(MOST, OUTPUTS)];
    for (size_t m = 1; m <= MOST; m++) {
        const aeo_fast_rls_config_t config = {.past = 1,
                                              .block = (uint16_t)m,
                                              .outputs = (uint16_t)(1u + m % OUTPUTS),
                                              .forgetting = AEO_REAL(1),
                                              .regularisation = AEO_REAL(1),
                                              .growth_max = AEO_REAL(100)};
        const aeo_rls_config_t plain = {config.block, config.outputs, AEO_REAL(1),
                                        AEO_REAL(1),  AEO_REAL(0),    AEO_REAL(100)};
        aeo_rls_t rls;
        aeo_real_t block[MOST], told[OUTPUTS];
        double expected[MOST * OUTPUTS];
        for (size_t i = 0; i < sizeof own / sizeof *own; i++) { /* memory may hold anything before */
            own[i] = make_not_finite(0);
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, own, sizeof own / sizeof *own));
        TEST_ASSERT_TRUE(aeo_fast_rls_invariants_hold(&fast));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &plain, other, sizeof other / sizeof *other));
        memset(block, 0, sizeof block);
        for (unsigned k = 0; k < 200u; k++) {
            for (size_t i = 0; i < config.outputs; i++) {
                told[i] = block[i % m] - block[(3u * i) % m] / AEO_REAL(2) + (aeo_real_t)(0.1 * draw(&seed));
            }
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, block, told));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, block, told));
            fill(block, m, &seed);
        }
        for (size_t i = 0; i < m * config.outputs; i++) {
            expected[i] = (double)aeo_rls_theta(&rls)[i];
        }
        TEST_ASSERT_TRUE(relative_distance(aeo_fast_rls_theta(&fast), expected, m * config.outputs) <
                         (sizeof(aeo_real_t) == 4 ? 1e-3 : 1e-9));
        TEST_ASSERT_EQUAL_UINT32(0, fast.count.reinitialised); /* as what lies behind its memory, read, would make it */
    }
}

/* A mask has 32 bits, a block up to 96 entries: those above bit 31 are in no mask. */
static void masks_of_wide_blocks_agree_with_rls(void)
{
    enum { WIDE = 35, TAIL = 2, ALL = WIDE + TAIL };
    static aeo_real_t own[AEO_FAST_RLS_WORDS(1, WIDE, TAIL, 1)], other[AEO_RLS_WORDS(ALL, 1)];
    static const unsigned marked[2] = {0, 31};
    const aeo_fast_rls_config_t config = {.past = 1,
                                          .block = WIDE,
                                          .outputs = 1,
                                          .feedthrough = UINT32_C(0x80000001),
                                          .forgetting = AEO_REAL(1),
                                          .regularisation = AEO_REAL(1),
                                          .growth_max = AEO_REAL(100)};
    const aeo_rls_config_t plain = {ALL, 1, AEO_REAL(1), AEO_REAL(1), AEO_REAL(0), AEO_REAL(100)};
    aeo_rls_t rls;
    aeo_real_t window[ALL], block[WIDE], told[1];
    double expected[ALL];
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, own, sizeof own / sizeof *own));
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_init(&rls, &plain, other, sizeof other / sizeof *other));
    memset(window, 0, sizeof window);
    for (unsigned k = 0; k < 400u; k++) {
        fill(block, WIDE, &seed);
        for (unsigned i = 0; i < TAIL; i++) {
            window[WIDE + i] = block[marked[i]];
        }
        told[0] =
            window[0] - window[32] + window[34] / AEO_REAL(2) + window[WIDE + 1] + (aeo_real_t)(0.1 * draw(&seed));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, window, told));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_rls_update(&rls, window, told));
        memcpy(window, block, sizeof block);
    }
    for (size_t i = 0; i < ALL; i++) {
        expected[i] = (double)aeo_rls_theta(&rls)[i];
    }
    TEST_ASSERT_EQUAL_UINT32(0, fast.count.restarted + fast.count.reinitialised);
    TEST_ASSERT_TRUE(relative_distance(aeo_fast_rls_theta(&fast), expected, ALL) <
                     (sizeof(aeo_real_t) == 4 ? 1e-3 : 1e-9));
}

/* ---- succession -------------------------------------------------------------------------------------------------------- */

static uint32_t smaller(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* Theta waits for half of the age of the array that is gone, at most `wait`, from the break on. The watch then counts the
 * newest block alone, all that the new array has absorbed. */
static void after_a_break_theta_waits_for_half_of_what_was_seen(void)
{
    for (unsigned age = 1; age < 60u; age++) {
        setUp();
        start(0.99);
        TEST_ASSERT_TRUE(fast.wait < 25u);
        feed(age);
        fill(z, N, &seed); /* no shift of what was before */
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        TEST_ASSERT_EQUAL_UINT32(1, fast.count.restarted);
        const uint32_t wait = smaller(fast.wait, age / 2u);
        TEST_ASSERT_EQUAL_UINT32(wait > 0u ? wait - 1u : 0u, fast.hold); /* this sample is the first of them */
        TEST_ASSERT_EQUAL_UINT32(1, fast.array[0].age);
        double power = 0.0;
        for (size_t c = N - M; c < N; c++) {
            power += (double)z[c] * (double)z[c];
        }
        const double held = (double)fast.watched[0];
        near(&power, &held, 1, 1e-5);
        TEST_ASSERT_EQUAL_UINT32(0, fast.watch.age);
    }
}

/* Behind a break the arrays are those of a new filter that sees the same samples, bit for bit; theta rests, and while it does
 * the residual is the innovation. */
static void behind_a_break_the_arrays_are_new(void)
{
    static aeo_real_t own[WORDS];
    const size_t array = AEO_FAST_RLS_ARRAY_WORDS(P, M, 0);
    aeo_fast_rls_t fresh;
    start(0.99);
    feed(300);
    fill(z, N, &seed);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fresh, &fast.config, own, WORDS));
    for (unsigned k = 0; k < 100u; k++) {
        const uint32_t held = fast.count.held;
        if (k == 0u) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
            TEST_ASSERT_EQUAL_UINT32(1, fast.count.restarted);
        } else {
            feed(1);
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fresh, z, y));
        TEST_ASSERT_EQUAL_MEMORY(fresh.array[0].forward, fast.array[0].forward, array * sizeof *z);
        TEST_ASSERT_EQUAL_MEMORY(fresh.array[1].forward, fast.array[1].forward, array * sizeof *z);
        TEST_ASSERT_EQUAL_MEMORY(fresh.window, fast.window, (N + M) * sizeof *z);
        TEST_ASSERT_EQUAL_UINT32(fresh.filled, fast.filled);
        const int same = memcmp(aeo_fast_rls_innovation(&fast), aeo_fast_rls_residual(&fast), sizeof y) == 0;
        TEST_ASSERT_EQUAL_INT(fast.count.held > held, same);
    }
    TEST_ASSERT_TRUE(fast.count.held > 5u);
}

/* Theta that no scaled data have is dropped as a whole when arrays start afresh, and what they may have is kept. */
static void theta_beyond_all_scaled_data_is_dropped(void)
{
    for (unsigned i = 0; i < 4u; i++) {
        start(0.99);
        feed(300);
        aeo_real_t kept[N * L];
        fast.theta[i * (N * L - 1u) / 3u] = i % 2u == 0u ? AEO_REAL(100) : AEO_REAL(-100);
        memcpy(kept, fast.theta, sizeof kept);
        fill(z, N, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        TEST_ASSERT_EQUAL_MEMORY(kept, fast.theta, sizeof kept);
        fast.theta[i * (N * L - 1u) / 3u] *= AEO_REAL(1.001);
        fill(z, N, &seed);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        memset(kept, 0, sizeof kept);
        TEST_ASSERT_EQUAL_MEMORY(kept, fast.theta, sizeof kept);
    }
}

/* An array that is lost gives way to its follower once that is older than a quarter of what makes it warm; else both start
 * afresh, theta waits at least until the window has passed once, and the watch holds nothing. */
static void a_lost_array_is_followed_or_both_start_afresh(void)
{
    for (unsigned age = 1; age < 80u; age += 1u + age / 8u) { /* without a follower */
        setUp();
        start(0.99);
        feed(age);
        fast.array[0].forward[3] = AEO_REAL(-1e15);
        feed(1);
        TEST_ASSERT_EQUAL_UINT32(1, fast.count.reinitialised);
        const uint32_t wait = smaller(fast.wait, (age + 1u) / 2u);
        TEST_ASSERT_EQUAL_UINT32(wait > P + 1u ? wait : P + 1u, fast.hold);
        TEST_ASSERT_EQUAL_UINT32(0, fast.array[0].age);
        TEST_ASSERT_EQUAL_UINT32(0, fast.array[1].age);
        TEST_ASSERT_TRUE(fast.watched[0] <= AEO_REAL(0) && fast.watched[1] <= AEO_REAL(0));
        TEST_ASSERT_EQUAL_UINT32(0, fast.watch.age);
        TEST_ASSERT_TRUE(fast.regularisation > AEO_REAL(7.99) && fast.regularisation < AEO_REAL(8.01));
        const uint32_t held = fast.count.held, holds = fast.hold;
        feed(holds + 5u); /* and then it learns */
        TEST_ASSERT_EQUAL_UINT32(held + holds, fast.count.held);
    }
    for (unsigned more = 0; more < 2u; more++) {
        setUp();
        start(0.99);
        feed(200);
        fast.array[0].scalar[1] = fast.array[0].scalar[2] * AEO_REAL(0.02); /* late: a follower begins */
        if (sizeof(aeo_real_t) == 8) {
            fast.array[0].scalar[1] = fast.array[0].scalar[2] * AEO_REAL(1e-5);
        }
        feed(fast.warm / 4u + more);
        TEST_ASSERT_EQUAL_UINT32(fast.warm / 4u + more, fast.array[1].age);
        TEST_ASSERT_EQUAL_UINT32(0, fast.active);
        fast.array[0].forward[3] = AEO_REAL(-1e15);
        feed(1);
        TEST_ASSERT_EQUAL_UINT32(1, fast.count.reinitialised);
        TEST_ASSERT_EQUAL_UINT32(more, fast.active);
        TEST_ASSERT_EQUAL_UINT32(more * (fast.warm / 4u + 2u), fast.array[1].age);
        TEST_ASSERT_EQUAL_UINT32(0, fast.array[0].age);
        TEST_ASSERT_EQUAL_UINT32(more == 0u, fast.hold > 0u);
    }
}

/* In a short memory the follower begins when the first array has lived its life, and takes over once it is warm. */
static void a_follower_begins_when_a_life_ends(void)
{
    start(0.9);
    TEST_ASSERT_TRUE(fast.life > 20u && fast.life < 1000u);
    for (unsigned k = 1; k < fast.life + fast.warm; k++) {
        feed(1);
        const uint32_t first = k, follower = k >= fast.life ? k - fast.life + 1u : 0u;
        if (follower >= fast.warm) {
            TEST_ASSERT_EQUAL_UINT32(1, fast.count.renewed);
            TEST_ASSERT_EQUAL_UINT32(1, fast.active);
            TEST_ASSERT_EQUAL_UINT32(0, fast.array[0].age);
            break;
        }
        TEST_ASSERT_EQUAL_UINT32(first, fast.array[0].age);
        TEST_ASSERT_EQUAL_UINT32(follower, fast.array[1].age);
        TEST_ASSERT_EQUAL_UINT32(0, fast.count.renewed);
    }
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.renewed);
}

/* A theta that ran away is forgotten with all else, and what is told of that sample is what a new filter says: y. */
static void behind_a_runaway_the_innovation_is_the_output(void)
{
    start(0.99);
    feed(100);
    fast.theta[3] = AEO_REAL(1e20);
    feed(1);
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.reinitialised);
    TEST_ASSERT_EQUAL_MEMORY(y, aeo_fast_rls_innovation(&fast), sizeof y);
}

/* rho rises by 16 for each array lost, to 65536 times what was set, and no further. */
static void regularisation_rises_and_stays(void)
{
    start(0.99);
    double expected = 0.5;
    for (unsigned lost = 0; lost < 8u; lost++) {
        feed(20);
        fast.array[0].forward[3] = AEO_REAL(-1e15);
        feed(1);
        expected = expected < 0.5 * 65536.0 ? expected * 16.0 : expected;
        const double found = (double)fast.regularisation;
        near(&expected, &found, 1, 1e-6);
    }
    aeo_fast_rls_reset(&fast);
    TEST_ASSERT_TRUE(fast.regularisation > AEO_REAL(0.499) && fast.regularisation < AEO_REAL(0.501));
}

/* Innovations of more than ten times the outputs' size are borne for two memories and the window's length, not longer; as
 * many good samples as bad ones make up for them, and what is smaller says nothing. */
static void innovations_far_above_the_outputs_start_afresh(void)
{
    for (unsigned kind = 0; kind < 3u; kind++) { /* always, at every other sample, ever a little less */
        setUp();
        start(0.99);
        feed(50);
        memset(z, 0, sizeof z);
        unsigned k = 0;
        for (; k < 1000u && fast.count.reinitialised == 0u; k++) {
            memmove(z, z + M, (N - M) * sizeof *z);
            fill(z + N - M, M, &seed);
            fast.hold = 1000; /* nobody learns */
            double made = 0.0, told = 0.0;
            for (size_t i = 0; i < L; i++) {
                double sum = 0.0;
                for (size_t j = 0; j < N; j++) {
                    fast.theta[i * N + j] = AEO_REAL(50);
                    sum += 50.0 * (double)z[j];
                }
                const double size = kind == 1u && k % 2u == 0u ? 0.5 : kind == 2u ? 0.12 : 0.05;
                y[i] = (aeo_real_t)(size * sum);
                made += pow(sum - (double)y[i], 2);
                told += pow((double)y[i], 2);
            }
            TEST_ASSERT_EQUAL_INT(made > 100.0 * told, kind == 0u || (kind == 1u && k % 2u == 1u));
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        }
        TEST_ASSERT_EQUAL_UINT32(kind == 0u, fast.count.reinitialised);
        if (kind == 0u) {
            TEST_ASSERT_UINT_WITHIN(10, 200 + 2 * P, k);
            TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_REINITIALISED,
                                     aeo_fast_rls_health(&fast) & AEO_FAST_RLS_REINITIALISED);
            TEST_ASSERT_EQUAL_MEMORY(y, aeo_fast_rls_innovation(&fast), sizeof y); /* theta is 0 */
        }
    }
}

/* Arrays that hold too much start afresh with the rho that was set, and theta waits as after a break. */
static void a_release_starts_from_the_rho_that_was_set(void)
{
    start(0.99);
    feed(1000);
    TEST_ASSERT_EQUAL_UINT32(0, fast.count.released);
    fast.regularisation = AEO_REAL(8);
    for (unsigned k = 0; k < 2000u && fast.count.released == 0u; k++) {
        fast.watched[0] = AEO_REAL(1e12); /* as a fault leaves it */
        const uint32_t age = fast.array[fast.active].age;
        feed(1);
        if (fast.count.released > 0u) {
            const uint32_t wait = smaller(fast.wait, age / 2u);
            TEST_ASSERT_TRUE(wait > P);
            TEST_ASSERT_EQUAL_UINT32(wait - 1u, fast.hold);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(1, fast.count.released);
    TEST_ASSERT_EQUAL_UINT32(AEO_FAST_RLS_RELEASED, aeo_fast_rls_health(&fast));
    TEST_ASSERT_TRUE(fast.regularisation > AEO_REAL(0.499) && fast.regularisation < AEO_REAL(0.501));
    TEST_ASSERT_EQUAL_UINT32(1, fast.array[0].age);
}

/* ---- the disturbance --------------------------------------------------------------------------------------------------- */

/* Marsaglia's xorshift with 13, 17 and 5 (2003); bit 16 of its state is the sign. */
static uint32_t draw_next(uint32_t x)
{
    uint64_t wide = x;
    wide = (wide ^ wide << 13) & 0xFFFFFFFFu;
    wide = wide ^ wide >> 17;
    return (uint32_t)((wide ^ wide << 5) & 0xFFFFFFFFu);
}

/* Channels at rest meet the bound: each is disturbed by +-((1 - lambda) rho / growth_max)^(1/2), sign after sign. */
static void disturbances_are_those_of_the_header(void)
{
    const aeo_fast_rls_config_t config = {.past = P,
                                          .block = M,
                                          .outputs = L,
                                          .forgetting = AEO_REAL(0.9375),
                                          .regularisation = AEO_REAL(0.5),
                                          .growth_max = AEO_REAL(8)};
    const double size = sqrt(0.0625 * 0.5 / 8.0);
    uint32_t state = 1;
    unsigned signs[2] = {0, 0};
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, memory, WORDS));
    memset(y, 0, sizeof y);
    for (unsigned k = 0; k < 500u; k++) {
        int over[M];
        double variance[M];
        for (size_t c = 0; c < M; c++) { /* of the array as it stands before the sample */
            const array_t before = look_at(&fast.array[fast.active]);
            variance[c] = before.inverse[c][c];
            over[c] = variance[c] > 16.0;
        }
        const uint32_t bounded = fast.count.bounded;
        uint32_t expected = 0;
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        for (size_t c = 0; c < M; c++) {
            double added = 0.0;
            if (fabs(variance[c] - 16.0) < 1e-3) { /* rounding decides */
                over[c] = fabs((double)fast.window[N + c]) > size / 2.0;
            }
            if (over[c]) {
                state = draw_next(state);
                added = (state >> 16 & 1u) != 0u ? size : -size;
                signs[state >> 16 & 1u]++;
                expected++;
            }
            TEST_ASSERT_TRUE(fabs((double)fast.window[N + c] - added) < 1e-5 * size);
        }
        TEST_ASSERT_EQUAL_UINT32(bounded + expected, fast.count.bounded);
        TEST_ASSERT_EQUAL_HEX32(state, fast.random);
    }
    TEST_ASSERT_TRUE(signs[0] > 20u && signs[1] > 20u);
}

/* The full covariance that the recursion stands for, P_{-1} as the header has it. */
static void absorb_densely(double p[N][N], const double *w, double lambda)
{
    double pw[N], news = lambda;
    for (size_t i = 0; i < N; i++) {
        pw[i] = dot(p[i], w, N);
        news += w[i] * pw[i];
    }
    for (size_t i = 0; i < N; i++) {
        for (size_t j = 0; j < N; j++) {
            p[i][j] = (p[i][j] - pw[i] * pw[j] / news) / lambda;
        }
    }
}

/* Channel 1 is 0 or half of channel 0, so that windows are disturbed all the time: P d is that of a full covariance. */
static void disturbances_share_the_gain_as_a_full_covariance_says(void)
{
    const double lambda = 0.9375;
    for (unsigned half = 0; half < 2u; half++) {
        double p[N][N] = {{0}};
        unsigned compared = 0;
        const aeo_fast_rls_config_t config = {.past = P,
                                              .block = M,
                                              .outputs = L,
                                              .forgetting = (aeo_real_t)lambda,
                                              .regularisation = AEO_REAL(0.5),
                                              .growth_max = AEO_REAL(8)};
        setUp();
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_init(&fast, &config, memory, WORDS));
        for (size_t i = 0; i < N; i++) {
            p[i][i] = 2.0 * pow(lambda, (double)(P - 1 - i / M));
        }
        for (unsigned k = 0; k < 400u && fast.count.renewed == 0u; k++) {
            double w[N], d[N], apart = 0.0, size = 0.0;
            memmove(z, z + M, (N - M) * sizeof *z);
            fill(z + N - M, M, &seed);
            z[N - M + 1] = half != 0u ? z[N - M] / AEO_REAL(2) : AEO_REAL(0);
            fill(y, L, &seed);
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
            for (size_t i = 0; i < N; i++) {
                w[i] = (double)fast.window[M + i];
                d[i] = (double)fast.added[M + i];
                TEST_ASSERT_TRUE(fabs(w[i] - d[i] - (double)z[i]) < 1e-6); /* w = z + d */
            }
            for (size_t i = 0; i < N && fast.disturbed > 0u; i++) {
                const double share = dot(p[i], d, N) / lambda;
                apart += pow(share - (double)fast.array[fast.active].share[i], 2);
                size += pow(share, 2);
            }
            TEST_ASSERT_TRUE(sqrt(apart) <= (sizeof(aeo_real_t) == 4 ? 1e-2 : 1e-6) * sqrt(size));
            compared += size > 0.0;
            absorb_densely(p, w, lambda);
        }
        TEST_ASSERT_TRUE(compared > 100u);
    }
}

/* ---- the window -------------------------------------------------------------------------------------------------------- */

/* Without disturbances an entry continues the window when it is within two rounding errors of what it was. */
static void the_window_knows_its_entries_to_two_roundings(void)
{
    static const unsigned places[] = {0, M, N - M - 1};
    for (unsigned i = 0; i < 3u; i++) {
        for (unsigned off = 0; off < 4u; off++) {
            start(1.0);
            feed(20);
            for (size_t j = 0; j < N; j++) {
                z[j] = AEO_REAL(1);
            }
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
            TEST_ASSERT_EQUAL_UINT32(1, fast.count.restarted);
            for (unsigned k = 0; k < 6u; k++) { /* the window is full of ones */
                TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
            }
            z[places[i]] += (aeo_real_t)off * AEO_REAL_EPSILON;
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
            TEST_ASSERT_EQUAL_UINT32(off > 2u ? 2 : 1, fast.count.restarted);
        }
    }
}

/* With forgetting, an entry may differ by two disturbances, one each way, and no more. */
static void the_window_knows_its_entries_to_two_disturbances(void)
{
    for (unsigned tenths = 18; tenths < 30u; tenths += 2u) {
        start(0.9);
        memset(z, 0, sizeof z);
        memset(y, 0, sizeof y);
        for (unsigned k = 0; k < 10u; k++) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        }
        TEST_ASSERT_EQUAL_UINT32(0, fast.count.restarted + fast.count.bounded);
        z[0] = fast.disturbance * (aeo_real_t)tenths / AEO_REAL(10) + (tenths == 20u ? AEO_REAL(-1e-9) : AEO_REAL(0));
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_fast_rls_update(&fast, z, y));
        TEST_ASSERT_EQUAL_UINT32(tenths > 20u, fast.count.restarted);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(each_sample_follows_the_equations);
    RUN_TEST(disagreement_is_a_mean_over_64_samples);
    RUN_TEST(blocks_of_every_size_agree_with_rls);
    RUN_TEST(masks_of_wide_blocks_agree_with_rls);
    RUN_TEST(after_a_break_theta_waits_for_half_of_what_was_seen);
    RUN_TEST(behind_a_break_the_arrays_are_new);
    RUN_TEST(theta_beyond_all_scaled_data_is_dropped);
    RUN_TEST(a_lost_array_is_followed_or_both_start_afresh);
    RUN_TEST(a_follower_begins_when_a_life_ends);
    RUN_TEST(behind_a_runaway_the_innovation_is_the_output);
    RUN_TEST(regularisation_rises_and_stays);
    RUN_TEST(innovations_far_above_the_outputs_start_afresh);
    RUN_TEST(a_release_starts_from_the_rho_that_was_set);
    RUN_TEST(disturbances_are_those_of_the_header);
    RUN_TEST(disturbances_share_the_gain_as_a_full_covariance_says);
    RUN_TEST(the_window_knows_its_entries_to_two_roundings);
    RUN_TEST(the_window_knows_its_entries_to_two_disturbances);
    return UNITY_END();
}
