/* contract.c: the laws of contract.h. Each holds for any filter that minimises the weighted, regularised sum of rls.h.
 */
#include "contract.h"

#include "linalg.h"
#include "samples.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_MAX = 24, L_MAX = 4, SAMPLES = 400, WORDS_MAX = 4096, OBJECT_MAX = 1024 };

static const filter_face_t *filter;
static uint64_t seed;

typedef union {
    uint64_t aligned;
    unsigned char bytes[OBJECT_MAX];
} object_t;

static object_t first, second;
static aeo_real_t first_memory[WORDS_MAX], second_memory[WORDS_MAX], saved[WORDS_MAX];
static aeo_real_t z[SAMPLES * N_MAX], y[SAMPLES * L_MAX];

static size_t count_regressors(filter_size_t size)
{
    return size.past * size.block + size.tail;
}

/* Let each window be the one before it moved by one block, as regressor.h makes them, from an empty start; the tail
 * is of the present sample, whose block enters the window at the next. */
static void slide_windows(filter_size_t size)
{
    const size_t n = count_regressors(size), past = n - size.tail, m = size.block;
    aeo_real_t window[N_MAX] = {AEO_REAL(0)}, block[N_MAX];
    for (size_t k = 0; k < SAMPLES; k++) {
        fill(block, m, &seed);
        memcpy(z + k * n, window, past * sizeof *window);
        memcpy(z + k * n + past, block, size.tail * sizeof *block);
        memmove(window, window + m, (past - m) * sizeof *window);
        memcpy(window + past - m, block, m * sizeof *block);
    }
}

/* A system with all directions excited: z even noise, y = M z + noise of a tenth. */
static void make_samples(filter_size_t size)
{
    const size_t n = count_regressors(size), l = size.outputs;
    aeo_real_t m[L_MAX * N_MAX];
    fill(m, l * n, &seed);
    fill(z, SAMPLES * n, &seed);
    if (filter->sliding) {
        slide_windows(size);
    }
    for (size_t k = 0; k < SAMPLES; k++) {
        for (size_t i = 0; i < l; i++) {
            double sum = 0.1 * draw(&seed);
            for (size_t j = 0; j < n; j++) {
                sum += (double)m[i * n + j] * (double)z[k * n + j];
            }
            y[k * l + i] = (aeo_real_t)sum;
        }
    }
}

static void start(object_t *object, aeo_real_t *memory, filter_size_t size, double lambda, double rho)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, filter->init(object, size, lambda, rho, memory, filter->words(size)));
    TEST_ASSERT_TRUE(filter->invariants_hold(object));
}

/* Update with samples from ... to-1 and check every invariant after every one. */
static void feed(object_t *object, filter_size_t size, size_t from, size_t to)
{
    const size_t n = count_regressors(size), l = size.outputs;
    for (size_t k = from; k < to; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_OK, filter->update(object, z + k * n, y + k * l));
        TEST_ASSERT_TRUE(filter->invariants_hold(object));
    }
}

static void assert_same_state(filter_size_t size)
{
    const size_t l = size.outputs, count = count_regressors(size) * l;
    aeo_real_t one[L_MAX * N_MAX]; /* a filter that works theta out may answer from one place for all objects */
    memcpy(one, filter->theta(&first), count * sizeof *one);
    TEST_ASSERT_EQUAL_MEMORY(one, filter->theta(&second), count * sizeof *one);
    TEST_ASSERT_EQUAL_MEMORY(filter->innovation(&first), filter->innovation(&second), l * sizeof(aeo_real_t));
    TEST_ASSERT_EQUAL_MEMORY(filter->residual(&first), filter->residual(&second), l * sizeof(aeo_real_t));
}

/* n = 1, 2, 3, 7, 13, 24, and 8 whose blocks are those of outputs alone */
static const filter_size_t SIZES[] = {{1, 1, 0, 1}, {1, 2, 0, 1}, {1, 2, 1, 2}, {3, 2, 1, 3},
                                      {4, 3, 1, 4}, {8, 3, 0, 2}, {4, 2, 0, 2}};
static const filter_size_t LARGEST = {8, 3, 0, L_MAX};
static const filter_size_t SMALL = {3, 2, 1, 2}, MIDDLE = {4, 3, 1, 3}, LARGE = {8, 3, 0, 2};
enum { SIZE_COUNT = sizeof SIZES / sizeof SIZES[0] };

/* The regressors are even noise with condition below 10, so rounding is all that separates recursion and batch: some
 * hundred rounding errors of unit size after 400 updates of 24 rotations. */
static int is_close(const aeo_real_t *theta, const double *batch, filter_size_t size, double lambda, size_t count)
{
    const double bound = filter->close != NULL ? filter->close(lambda, count) : 300.0 * (double)AEO_REAL_EPSILON;
    return relative_distance(theta, batch, count_regressors(size) * size.outputs) < bound;
}

/* What the regularisation weighs after count samples. */
static void fill_ridge(filter_size_t size, double lambda, double rho, size_t count, double ridge[N_MAX])
{
    for (size_t j = 0; j < count_regressors(size); j++) {
        ridge[j] = filter->prior != NULL ? filter->prior(size, lambda, rho, j) : rho;
        ridge[j] *= pow(lambda, (double)count);
    }
}

static void law_equals_batch(void)
{
    static const double LAMBDA[] = {1.0, 0.99, 0.9}, RHO[] = {0.01, 1.0, 30.0};
    for (size_t s = 0; s < SIZE_COUNT; s++) {
        const filter_size_t size = SIZES[s];
        const size_t n = count_regressors(size), l = size.outputs;
        for (size_t t = 0; t < 9; t++) {
            /* the filter's own rounded settings: the law is about the recursion, not about 0.9 having no exact float */
            const double lambda = (double)(aeo_real_t)LAMBDA[t / 3], rho = (double)(aeo_real_t)RHO[t % 3];
            double weight[SAMPLES], theta[L_MAX * N_MAX], ridge[N_MAX];
            make_samples(size);
            start(&first, first_memory, size, lambda, rho);
            feed(&first, size, 0, SAMPLES);
            for (size_t k = SAMPLES; k-- > 0;) {
                weight[k] = k == SAMPLES - 1 ? 1.0 : weight[k + 1] * lambda;
            }
            fill_ridge(size, lambda, rho, SAMPLES, ridge);
            solve_batch(z, y, weight, SAMPLES, n, l, ridge, theta);
            TEST_ASSERT_TRUE(is_close(filter->theta(&first), theta, size, lambda, SAMPLES));
        }
    }
}

/* No input: z holds the past outputs themselves, y_k = A_1 y_{k-1} + A_2 y_{k-2} + e_k from rest. */
static void make_autoregression(filter_size_t size)
{
    const size_t l = size.outputs, n = size.past * l;
    memset(z, 0, sizeof z);
    for (size_t k = 0; k < SAMPLES; k++) {
        for (size_t lag = 1; lag <= size.past && lag <= k; lag++) {
            memcpy(z + k * n + (size.past - lag) * l, y + (k - lag) * l, l * sizeof *y);
        }
        for (size_t i = 0; i < l; i++) {
            const aeo_real_t *const newest = z + k * n + n - l, *const older = newest - l;
            y[k * l + i] = AEO_REAL(0.6) * newest[i] - AEO_REAL(0.3) * newest[(i + 1) % l] - AEO_REAL(0.4) * older[i] +
                           (aeo_real_t)draw(&seed);
        }
    }
}

static void law_autoregression_equals_batch(void)
{
    const filter_size_t size = {4, 2, 0, 2}; /* blocks as long as there are outputs */
    const size_t n = count_regressors(size), l = size.outputs;
    double batch[L_MAX * N_MAX], ridge[N_MAX];
    make_autoregression(size);
    start(&first, first_memory, size, 1.0, 1.0);
    feed(&first, size, 0, SAMPLES);
    fill_ridge(size, 1.0, 1.0, SAMPLES, ridge);
    solve_batch(z, y, NULL, SAMPLES, n, l, ridge, batch);
    TEST_ASSERT_TRUE(is_close(filter->theta(&first), batch, size, 1.0, SAMPLES));
}

static void law_first_samples_equal_batch(void)
{
    /* fewer samples than regressors: only the regularisation makes the answer unique */
    const filter_size_t size = LARGE;
    const size_t n = count_regressors(size), l = size.outputs;
    make_samples(size);
    start(&first, first_memory, size, 1.0, 1.0);
    for (size_t k = 0; k < 2 * n; k++) {
        double theta[L_MAX * N_MAX], ridge[N_MAX];
        feed(&first, size, k, k + 1);
        fill_ridge(size, 1.0, 1.0, k + 1, ridge);
        solve_batch(z, y, NULL, k + 1, n, l, ridge, theta);
        TEST_ASSERT_TRUE(is_close(filter->theta(&first), theta, size, 1.0, k + 1));
    }
}

static void law_residuals(void)
{
    /* innovation = y - theta_before z, residual = y - theta_after z */
    const filter_size_t size = {4, 3, 1, 4};
    const size_t n = count_regressors(size), l = size.outputs;
    make_samples(size);
    start(&first, first_memory, size, 0.99, 1.0);
    for (size_t k = 0; k < SAMPLES; k++) {
        double before[L_MAX], after[L_MAX];
        for (int late = 0; late < 2; late++) {
            if (late) {
                feed(&first, size, k, k + 1);
            }
            for (size_t i = 0; i < l; i++) {
                double sum = (double)y[k * l + i];
                for (size_t j = 0; j < n; j++) {
                    sum -= (double)filter->theta(&first)[i * n + j] * (double)z[k * n + j];
                }
                *(late ? &after[i] : &before[i]) = sum;
            }
        }
        for (size_t i = 0; i < l; i++) {
            TEST_ASSERT_TRUE(fabs((double)filter->innovation(&first)[i] - before[i]) <
                             100.0 * (double)AEO_REAL_EPSILON);
            TEST_ASSERT_TRUE(fabs((double)filter->residual(&first)[i] - after[i]) < 100.0 * (double)AEO_REAL_EPSILON);
        }
    }
}

static void law_permutation(void)
{
    const filter_size_t size = MIDDLE;
    const size_t n = count_regressors(size), l = size.outputs;
    size_t order[N_MAX];
    make_samples(size);
    start(&first, first_memory, size, 0.99, 1.0);
    feed(&first, size, 0, SAMPLES);
    for (size_t j = 0; j < n; j++) {
        order[j] = (5 * j + 3) % n; /* 5 and 13 have no common factor: every index once */
        if (filter->sliding) {      /* only channels may change places, and those of the tail come first */
            static const size_t CHANNELS[3] = {0, 2, 1};
            order[j] = j - j % size.block + (j == n - 1 ? 0 : CHANNELS[j % size.block]);
        }
    }
    start(&second, second_memory, size, 0.99, 1.0);
    for (size_t k = 0; k < SAMPLES; k++) {
        aeo_real_t mixed[N_MAX];
        for (size_t j = 0; j < n; j++) {
            mixed[j] = z[k * n + order[j]];
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, filter->update(&second, mixed, y + k * l));
    }
    double expected[L_MAX * N_MAX];
    for (size_t i = 0; i < l * n; i++) {
        expected[i] = (double)filter->theta(&first)[i / n * n + order[i % n]];
    }
    TEST_ASSERT_TRUE(is_close(filter->theta(&second), expected, size, 0.99, SAMPLES));
}

static void law_scaling(void)
{
    /* powers of two: y by 8, z by 4, rho by 16: theta by 2, and not one bit differs but in the exponent */
    const filter_size_t size = SMALL;
    const size_t n = count_regressors(size), l = size.outputs;
    make_samples(size);
    start(&first, first_memory, size, 0.99, 1.0);
    start(&second, second_memory, size, 0.99, 16.0);
    for (size_t k = 0; k < SAMPLES; k++) {
        aeo_real_t z4[N_MAX], y8[L_MAX];
        for (size_t j = 0; j < n; j++) {
            z4[j] = 4 * z[k * n + j];
        }
        for (size_t i = 0; i < l; i++) {
            y8[i] = 8 * y[k * l + i];
        }
        feed(&first, size, k, k + 1);
        TEST_ASSERT_EQUAL_INT(AEO_OK, filter->update(&second, z4, y8));
        for (size_t i = 0; i < n * l; i++) {
            const aeo_real_t doubled = 2 * filter->theta(&first)[i];
            TEST_ASSERT_EQUAL_MEMORY(&doubled, &filter->theta(&second)[i], sizeof doubled);
        }
        for (size_t i = 0; i < l; i++) {
            const aeo_real_t eightfold = 8 * filter->innovation(&first)[i];
            TEST_ASSERT_EQUAL_MEMORY(&eightfold, &filter->innovation(&second)[i], sizeof eightfold);
        }
    }
}

static void law_outputs_do_not_mix(void)
{
    /* each row of theta is what a filter of that output alone holds, to the bit */
    const filter_size_t size = {3, 2, 1, 4};
    const size_t n = count_regressors(size), l = size.outputs;
    make_samples(size);
    start(&first, first_memory, size, 0.99, 1.0);
    feed(&first, size, 0, SAMPLES);
    for (size_t i = 0; i < l; i++) {
        const filter_size_t single = {size.past, size.block, size.tail, 1};
        start(&second, second_memory, single, 0.99, 1.0);
        for (size_t k = 0; k < SAMPLES; k++) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->update(&second, z + k * n, y + k * l + i));
        }
        aeo_real_t row[N_MAX]; /* theta of one object may not outlive that of another */
        memcpy(row, filter->theta(&first) + i * n, n * sizeof *row);
        TEST_ASSERT_EQUAL_MEMORY(row, filter->theta(&second), n * sizeof *row);
    }
}

static void law_reset_is_fresh(void)
{
    const filter_size_t size = {3, 2, 1, 3};
    make_samples(size);
    start(&first, first_memory, size, 0.99, 1.0);
    start(&second, second_memory, size, 0.99, 1.0);
    feed(&first, size, 0, 150);
    filter->reset(&first);
    assert_same_state(size);
    for (size_t k = 150; k < SAMPLES; k++) {
        feed(&first, size, k, k + 1);
        feed(&second, size, k, k + 1);
        assert_same_state(size);
    }
}

static aeo_real_t again[WORDS_MAX];

static void law_restore_continues(void)
{
    for (size_t s = 0; s < SIZE_COUNT; s++) {
        const filter_size_t size = SIZES[s];
        const size_t length = filter->saved_words(size);
        make_samples(size);
        start(&first, first_memory, size, 0.99, 1.0);
        for (size_t k = 0; k + 40 <= SAMPLES; k += 57) {
            feed(&first, size, k, k + 20);
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->save(&first, saved, length));
            start(&second, second_memory, size, 0.99, 1.0);
            feed(&second, size, 0, 5); /* whatever it did before must not matter */
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->restore(&second, saved, length));
            TEST_ASSERT_TRUE(filter->invariants_hold(&second));
            assert_same_state(size);
            for (size_t i = 0; i < length; i++) {
                again[i] = AEO_REAL(7); /* a word that save leaves out stays as it was */
            }
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->save(&second, again, length));
            TEST_ASSERT_EQUAL_MEMORY(saved, again, length * sizeof *saved);
            for (size_t next = k + 20; next < k + 40; next++) {
                feed(&first, size, next, next + 1);
                feed(&second, size, next, next + 1);
                assert_same_state(size);
            }
        }
    }
}

/* Upset the filter so many times, four samples apart, from sample 40; returns the next sample. */
static size_t upset(filter_size_t size, unsigned times)
{
    size_t k = 40;
    feed(&first, size, 0, k);
    for (unsigned t = 0; t < times && filter->lose != NULL; t++, k += 4) {
        filter->lose(&first);
        feed(&first, size, k, k + 4);
    }
    return k;
}

static void law_restore_continues_over_a_gap(void)
{
    /* what a filter remembers of its troubles shows at the next fresh start only */
    for (size_t s = 0; s < SIZE_COUNT; s++) {
        const filter_size_t size = SIZES[s];
        const size_t length = filter->saved_words(size);
        make_samples(size);
        for (unsigned times = 0; times <= 6u; times++) {
            start(&first, first_memory, size, 0.99, 1.0);
            const size_t at = upset(size, times);
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->save(&first, saved, length));
            start(&second, second_memory, size, 0.99, 1.0);
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->restore(&second, saved, length));
            for (size_t next = at + 30; next < at + 120; next++) {
                feed(&first, size, next, next + 1);
                feed(&second, size, next, next + 1);
                assert_same_state(size);
            }
        }
    }
}

/* Call with a bad sample: one code, one counter up, and every other byte of object and memory as before. */
static void assert_refused(aeo_status_t code, const aeo_real_t *bad_z, const aeo_real_t *bad_y)
{
    object_t before = first;
    memcpy(second_memory, first_memory, sizeof first_memory);
    TEST_ASSERT_EQUAL_INT(code, filter->update(&first, bad_z, bad_y));
    *filter->rejected(&before) += code == AEO_E_ARG ? 0u : 1u;
    TEST_ASSERT_EQUAL_MEMORY(&before, &first, filter->object_bytes);
    TEST_ASSERT_EQUAL_MEMORY(second_memory, first_memory, sizeof first_memory);
}

static void law_refusal_leaves_every_byte(void)
{
    const filter_size_t size = MIDDLE;
    const size_t n = count_regressors(size), l = size.outputs;
    aeo_real_t bad[N_MAX];
    make_samples(size);
    start(&first, first_memory, size, 0.99, 1.0);
    for (size_t k = 0; k < 60; k += 20) {
        feed(&first, size, k, k + 20);
        for (size_t at = 0; at < n + l; at++) {
            for (int kind = 0; kind < 6; kind++) {
                const size_t count = at < n ? n : l;
                aeo_real_t *spot = &bad[at < n ? at : at - n];
                memcpy(bad, at < n ? z : y, count * sizeof *bad);
                *spot = kind < 4 ? make_not_finite(kind) : AEO_REAL(kind == 4 ? 1.0001e6 : -1e30);
                assert_refused(kind < 4 ? AEO_E_NOT_FINITE : AEO_E_RANGE, at < n ? bad : z, at < n ? y : bad);
            }
        }
        assert_refused(AEO_E_ARG, NULL, y);
        assert_refused(AEO_E_ARG, z, NULL);
        TEST_ASSERT_EQUAL_INT(AEO_E_ARG, filter->update(NULL, z, y));
    }
}

static void law_memory_is_the_formula(void)
{
    /* one word short at every size is refused untouched; the exact length is never overstepped, neither written nor read:
     * what lies behind is no number, nor is what memory held before */
    const aeo_real_t mark = make_not_finite(0);
    for (size_t n = 1; n <= 16; n++) {
        for (size_t l = 1; l <= L_MAX; l++) {
            const size_t block = n % 3 + 1; /* sizes 1 ... 16 as windows of blocks of 2, 3 and 1 */
            const filter_size_t size = {n < block ? 1 : n / block, n < block ? n : block, n < block ? 0 : n % block, l};
            const size_t words = filter->words(size);
            const object_t untouched = first;
            for (size_t i = 0; i < WORDS_MAX; i++) {
                first_memory[i] = mark;
            }
            TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, filter->init(&first, size, 1.0, 1.0, first_memory, words - 1));
            TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, filter->init(&first, size, 1.0, 1.0, first_memory, 0));
            TEST_ASSERT_EQUAL_MEMORY(&untouched, &first, sizeof first);
            make_samples(size);
            start(&first, first_memory, size, 0.9, 1.0);
            TEST_ASSERT_TRUE(filter->invariants_hold(&first));
            for (size_t i = 0; i < l; i++) { /* zeros before the first update */
                TEST_ASSERT_TRUE(fabs((double)filter->innovation(&first)[i]) < 1e-30);
                TEST_ASSERT_TRUE(fabs((double)filter->residual(&first)[i]) < 1e-30);
            }
            feed(&first, size, 0, 40);
            TEST_ASSERT_TRUE(filter->invariants_hold(&first));
            TEST_ASSERT_TRUE(aeo_linalg_all_finite(filter->theta(&first), l * count_regressors(size)));
            const size_t length = filter->saved_words(size);
            saved[length] = mark;
            TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, filter->save(&first, saved, length - 1));
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->save(&first, saved, length));
            TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, filter->restore(&first, saved, length - 1));
            TEST_ASSERT_EQUAL_INT(AEO_OK, filter->restore(&first, saved, length));
            TEST_ASSERT_EQUAL_MEMORY(&mark, &saved[length], sizeof mark);
            for (size_t i = words; i < WORDS_MAX; i++) {
                TEST_ASSERT_EQUAL_MEMORY(&mark, &first_memory[i], sizeof mark);
            }
        }
    }
}

static void law_restore_survives_damage(void)
{
    /* every word of a saved filter replaced by NaN is refused and leaves the filter as it was */
    const filter_size_t size = {2, 2, 1, 2};
    const size_t length = filter->saved_words(size);
    make_samples(size);
    start(&first, first_memory, size, 0.99, 1.0);
    feed(&first, size, 0, 50);
    TEST_ASSERT_EQUAL_INT(AEO_OK, filter->save(&first, saved, length));
    feed(&first, size, 50, 60);
    const object_t before = first;
    memcpy(second_memory, first_memory, sizeof first_memory);
    for (size_t i = 0; i < length; i++) {
        const aeo_real_t good = saved[i];
        saved[i] = make_not_finite((int)(i % 4));
        TEST_ASSERT_EQUAL_INT(AEO_E_NOT_FINITE, filter->restore(&first, saved, length));
        saved[i] = good;
        TEST_ASSERT_EQUAL_MEMORY(&before, &first, filter->object_bytes);
        TEST_ASSERT_EQUAL_MEMORY(second_memory, first_memory, sizeof first_memory);
    }
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, filter->restore(&first, NULL, length));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, filter->save(&first, NULL, length));
}

static void law_survives_rough_treatment(void)
{
    /* bursts of NaN, silence, steps to the edge of the range, the same sample for ever: finite and sound throughout,
     * and after 20 memories of good samples as good as a filter that saw only those */
    const filter_size_t size = SMALL;
    const size_t n = count_regressors(size), l = size.outputs;
    const double lambda = (double)AEO_REAL(0.95);
    make_samples(size);
    start(&first, first_memory, size, lambda, 1.0);
    aeo_real_t rough[N_MAX];
    for (size_t k = 0; k < 20000; k++) {
        const size_t mode = k / 500 % 5;
        for (size_t j = 0; j < n; j++) {
            rough[j] = mode == 0   ? z[(k % SAMPLES) * n + j]
                       : mode == 1 ? AEO_REAL(0)
                       : mode == 2 ? AEO_REAL(1e6)
                       : mode == 3 ? z[j]
                                   : make_not_finite((int)(k % 4));
        }
        const aeo_status_t status = filter->update(&first, rough, y + (k % SAMPLES) * l);
        TEST_ASSERT_EQUAL_INT(mode == 4 ? AEO_E_NOT_FINITE : AEO_OK, status);
        TEST_ASSERT_TRUE(filter->invariants_hold(&first));
    }
    for (int pass = 0; pass < 3; pass++) {
        feed(&first, size, 0, SAMPLES);
    }
    start(&second, second_memory, size, lambda, 1.0);
    for (int pass = 0; pass < 3; pass++) {
        feed(&second, size, 0, SAMPLES);
    }
    double expected[L_MAX * N_MAX];
    for (size_t i = 0; i < n * l; i++) {
        expected[i] = (double)filter->theta(&second)[i];
    }
    TEST_ASSERT_TRUE(relative_distance(filter->theta(&first), expected, n * l) < 1e-3);
}

void run_contract(const filter_face_t *face)
{
    filter = face;
    const char *given = getenv("AEOLID_TEST_SEED");
    seed = given != NULL ? strtoull(given, NULL, 0) : UINT64_C(20091218);
    printf("%s: AEOLID_TEST_SEED=%llu\n", face->name, (unsigned long long)seed);
    TEST_ASSERT_TRUE(face->object_bytes <= OBJECT_MAX && face->words(LARGEST) <= WORDS_MAX);
    TEST_ASSERT_TRUE(face->saved_words(LARGEST) < WORDS_MAX);
    RUN_TEST(law_equals_batch);
    RUN_TEST(law_autoregression_equals_batch);
    RUN_TEST(law_first_samples_equal_batch);
    RUN_TEST(law_residuals);
    RUN_TEST(law_permutation);
    RUN_TEST(law_scaling);
    RUN_TEST(law_outputs_do_not_mix);
    RUN_TEST(law_reset_is_fresh);
    RUN_TEST(law_restore_continues);
    RUN_TEST(law_restore_continues_over_a_gap);
    RUN_TEST(law_refusal_leaves_every_byte);
    RUN_TEST(law_memory_is_the_formula);
    RUN_TEST(law_restore_survives_damage);
    RUN_TEST(law_survives_rough_treatment);
}
