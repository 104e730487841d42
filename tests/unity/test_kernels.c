/* The kernels of linalg.h, rows.h, triangle.h and strips.h, at every length of what goes at once and what is left over, against the
 * same in double; none reads or writes a word beyond its arrays. */
#include "linalg.h"
#include "rows.h"
#include "samples.h"
#include "strips.h"
#include "triangle.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { MOST = 40, ROWS = 9, GUARD = 4 };

static uint64_t seed;
static aeo_real_t a[ROWS * MOST + GUARD], b[MOST + GUARD], c[MOST + GUARD], d[ROWS + GUARD],
    before[ROWS * MOST + GUARD];

/* What lies behind an array is large, so that one word too many shows. */
static void fill_guarded(aeo_real_t *x, size_t count, size_t room)
{
    fill(x, count, &seed);
    for (size_t i = count; i < room; i++) {
        x[i] = AEO_REAL(1e6) + (aeo_real_t)i;
    }
}

void setUp(void)
{
    seed = 20261128u;
}

void tearDown(void)
{
}

static void near(double expected, aeo_real_t found, double size)
{
    TEST_ASSERT_TRUE(fabs(expected - (double)found) <= 20.0 * (double)AEO_REAL_EPSILON * (1.0 + size));
}

static void untouched(const aeo_real_t *x, size_t count, size_t room)
{
    for (size_t i = count; i < room; i++) {
        TEST_ASSERT_TRUE(fabs((double)x[i] - 1e6 - (double)i) < 0.5);
    }
}

/* -ffast-math adds up as it likes, and flushes small numbers to zero, by which it is known. */
static int sums_are_as_written(void)
{
    volatile float tiny = 1e-38f;
    tiny *= 0.1f;
    return tiny > 0.0f;
}

/* error = y - rows z: to rounding that of double, and a row's to the bit that of the row by itself. */
static void a_row_among_others_has_the_sum_it_has_alone(void)
{
    for (size_t n = 1; n < MOST; n++) {
        for (size_t count = 1; count <= ROWS; count++) {
            aeo_real_t error[ROWS + GUARD];
            fill_guarded(a, n * count, ROWS * MOST + GUARD);
            fill_guarded(b, n, MOST + GUARD);
            fill_guarded(d, count, ROWS + GUARD);
            fill_guarded(error, 0, ROWS + GUARD);
            TEST_ASSERT_TRUE(aeo_linalg_find_error(a, b, n, d, error, count));
            for (size_t i = 0; i < count; i++) {
                double sum = (double)d[i];
                aeo_real_t alone;
                for (size_t j = 0; j < n; j++) {
                    sum -= (double)a[i * n + j] * (double)b[j];
                }
                near(sum, error[i], sqrt((double)n));
                TEST_ASSERT_TRUE(aeo_linalg_find_error(a + i * n, b, n, d + i, &alone, 1));
                if (sums_are_as_written()) {
                    TEST_ASSERT_EQUAL_MEMORY(&alone, error + i, sizeof alone);
                }
            }
            untouched(error, count, ROWS + GUARD);
        }
    }
}

static void errors_end_at_their_bound(void)
{
    for (size_t count = 1; count <= ROWS; count++) {
        for (size_t i = 0; i < count; i++) {
            aeo_real_t error[ROWS];
            memset(a, 0, sizeof a);
            memset(d, 0, sizeof d);
            d[i] = AEO_REAL(1e12);
            TEST_ASSERT_TRUE(aeo_linalg_find_error(a, b, 3, d, error, count));
            d[i] = AEO_REAL(-1.001e12);
            TEST_ASSERT_FALSE(aeo_linalg_find_error(a, b, 3, d, error, count));
        }
    }
}

/* rows += a x', and y = a x */
static void rows_move_at_every_length(void)
{
    for (size_t n = 1; n < MOST; n++) {
        for (size_t count = 1; count <= ROWS; count++) {
            fill_guarded(a, n * count, ROWS * MOST + GUARD);
            fill_guarded(b, n, MOST + GUARD);
            fill_guarded(d, count, ROWS + GUARD);
            memcpy(before, a, sizeof a);
            aeo_linalg_move_rows(a, d, b, n, count);
            for (size_t i = 0; i < count * n; i++) {
                near((double)before[i] + (double)d[i / n] * (double)b[i % n], a[i], 1.0);
            }
            untouched(a, n * count, ROWS * MOST + GUARD);
        }
        fill_guarded(c, 0, MOST + GUARD);
        aeo_linalg_scale(d[0], b, c, n);
        for (size_t i = 0; i < n; i++) {
            near((double)d[0] * (double)b[i], c[i], 1.0);
        }
        untouched(c, n, MOST + GUARD);
    }
}

/* x -= W v by columns, then W += step x gain'. */
static void columns_correct_and_move_at_every_length(void)
{
    for (size_t count = 1; count < MOST; count++) {
        for (size_t m = 1; m <= ROWS; m++) {
            for (int moves = 0; moves < 2; moves++) {
                aeo_real_t gain[ROWS];
                fill_guarded(a, count * m, ROWS * MOST + GUARD);
                fill_guarded(b, count, MOST + GUARD);
                fill_guarded(d, m, ROWS + GUARD);
                fill(gain, ROWS, &seed);
                memcpy(before, a, sizeof a);
                memcpy(c, b, sizeof b);
                aeo_rows_correct(a, d, b, count, m, moves ? gain : NULL, AEO_REAL(0.75));
                for (size_t i = 0; i < count; i++) {
                    double left = (double)c[i];
                    for (size_t r = 0; r < m; r++) {
                        left -= (double)before[r * count + i] * (double)d[r];
                    }
                    near(left, b[i], 3.0);
                    for (size_t r = 0; r < m; r++) {
                        const double moved = moves ? 0.75 * left * (double)gain[r] : 0.0;
                        near((double)before[r * count + i] + moved, a[r * count + i], 3.0);
                    }
                }
                untouched(a, count * m, ROWS * MOST + GUARD);
                untouched(b, count, MOST + GUARD);
            }
        }
    }
}

/* One word out of range, not finite, or right at the limit, at every place of every length. */
static void a_word_out_of_range_is_found_at_every_place(void)
{
    for (size_t n = 1; n < MOST; n++) {
        fill_guarded(b, n, MOST + GUARD); /* what lies behind is out of range */
        TEST_ASSERT_TRUE(aeo_linalg_all_within(b, n, AEO_REAL(1)));
        TEST_ASSERT_TRUE(aeo_linalg_all_finite(b, n));
        for (size_t i = 0; i < n; i++) {
            const aeo_real_t kept = b[i];
            for (int sign = -1; sign < 2; sign += 2) {
                b[i] = (aeo_real_t)sign;
                TEST_ASSERT_TRUE(aeo_linalg_all_within(b, n, AEO_REAL(1)));
                b[i] = (aeo_real_t)sign * (AEO_REAL(1) + AEO_REAL_EPSILON);
                TEST_ASSERT_FALSE(aeo_linalg_all_within(b, n, AEO_REAL(1)));
                TEST_ASSERT_TRUE(aeo_linalg_all_finite(b, n));
            }
            for (int kind = 0; kind < 4; kind++) {
                b[i] = make_not_finite(kind);
                TEST_ASSERT_FALSE(aeo_linalg_all_within(b, n, AEO_REAL(1)));
                TEST_ASSERT_FALSE(aeo_linalg_all_finite(b, n));
            }
            b[i] = kept;
        }
    }
}

/* ---- triangle ---------------------------------------------------------------------------------------------------------- */

enum { ORDER = 15, TRIANGLE = ORDER * (ORDER + 1) / 2 };

static double full(const aeo_real_t *factor, size_t n, size_t i, size_t j)
{
    return i < j ? 0.0 : (double)factor[j * n - j * (j - 1u) / 2u + i - j];
}

/* P = S S' */
static double covariance(const aeo_real_t *factor, size_t n, size_t i, size_t j)
{
    double sum = 0.0;
    for (size_t k = 0; k < n; k++) {
        sum += full(factor, n, i, k) * full(factor, n, j, k);
    }
    return sum;
}

/* With a = S'z: P becomes scale^2 (P - P z z'P / (alpha + z'P z)), the gain is P z, the diagonal of S stays above 0. */
static void triangles_of_every_order_absorb_a_measurement(void)
{
    for (size_t n = 1; n <= ORDER; n++) {
        aeo_real_t s[TRIANGLE + GUARD], old[TRIANGLE + GUARD], z[ORDER], projection[ORDER + GUARD], gain[ORDER + GUARD];
        const double alpha = 0.75, scale = 1.125;
        const size_t words = n * (n + 1u) / 2u;
        fill_guarded(s, words, TRIANGLE + GUARD);
        for (size_t j = 0; j < n; j++) {
            s[j * n - j * (j - 1u) / 2u] = AEO_REAL(1) + (aeo_real_t)j / AEO_REAL(8);
        }
        memcpy(old, s, sizeof s);
        fill(z, ORDER, &seed);
        fill_guarded(projection, 0, ORDER + GUARD);
        fill_guarded(gain, 0, ORDER + GUARD);
        aeo_triangle_project(s, z, projection, n);
        aeo_triangle_rotate(s, projection, gain, n, (aeo_real_t)alpha, (aeo_real_t)scale);
        double news = alpha, pz[ORDER] = {0};
        for (size_t i = 0; i < n; i++) {
            double a_i = 0.0;
            for (size_t j = 0; j < n; j++) {
                pz[i] += covariance(old, n, i, j) * (double)z[j];
                a_i += full(old, n, j, i) * (double)z[j];
            }
            near(a_i, projection[i], (double)n);
            near(pz[i], gain[i], 10.0 * (double)n);
            near(covariance(old, n, i, i), aeo_triangle_norm2(old, n, i), 10.0);
            news += pz[i] * (double)z[i];
        }
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j <= i; j++) {
                const double p = covariance(old, n, i, j) - pz[i] * pz[j] / news;
                near(scale * scale * p, (aeo_real_t)covariance(s, n, i, j), 100.0);
            }
            TEST_ASSERT_TRUE(full(s, n, i, i) > 0.0);
        }
        untouched(s, words, TRIANGLE + GUARD);
        untouched(projection, n, ORDER + GUARD);
        untouched(gain, n, ORDER + GUARD);
        TEST_ASSERT_TRUE(aeo_triangle_start(s, n, AEO_REAL(0.5)) == s + words);
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j <= i; j++) {
                near(i == j ? 0.5 : 0.0, (aeo_real_t)full(s, n, i, j), 0.0);
                TEST_ASSERT_TRUE(i == j || fabs(full(s, n, i, j)) < 1e-38);
            }
        }
        untouched(s, words, TRIANGLE + GUARD);
    }
}

/* ---- strips ------------------------------------------------------------------------------------------------------------ */

enum { LARGEST = 27, FACTOR = AEO_RLS_FACTOR_WORDS(LARGEST), WORK = AEO_RLS_WORK_WORDS(LARGEST) };

static aeo_real_t strips[FACTOR + GUARD], was[FACTOR + GUARD], work[WORK + GUARD];

/* Entry (i, j) of S: strip after strip of eight rows, column after column, with pad rows and columns of zeros before. */
static aeo_real_t *find_entry(aeo_real_t *factor, size_t n, size_t i, size_t j)
{
    const size_t pad = (8u - n % 8u) % 8u, strip = (i + pad) / 8u;
    size_t from = 0;
    for (size_t s = 0; s < strip; s++) {
        from += 8u * (8u * (s + 1u) - pad);
    }
    return factor + from + 8u * j + (i + pad) % 8u;
}

static double variance(aeo_real_t *factor, size_t n, size_t i, size_t j)
{
    double sum = 0.0;
    for (size_t k = 0; k <= i && k <= j; k++) {
        sum += (double)*find_entry(factor, n, i, k) * (double)*find_entry(factor, n, j, k);
    }
    return sum;
}

/* A factor, and scratch that holds what earlier calls left. */
static void start_strips(size_t n)
{
    fill_guarded(strips, 0, FACTOR + GUARD);
    fill_guarded(work, AEO_RLS_WORK_WORDS(n), WORK + GUARD);
    aeo_strips_start(strips, n, AEO_REAL(1.5));
    untouched(strips, AEO_RLS_FACTOR_WORDS(n), FACTOR + GUARD);
    for (size_t i = 0; i < n; i++) {
        near(2.25, (aeo_real_t)variance(strips, n, i, i), 1.0);
        for (size_t j = 0; j < i; j++) {
            *find_entry(strips, n, i, j) = (aeo_real_t)draw(&seed) / AEO_REAL(2);
        }
    }
    TEST_ASSERT_TRUE(aeo_strips_hold(strips, n));
    memcpy(was, strips, sizeof strips);
}

static void assert_absorbed(size_t n, const double *pa, double alpha, double news, double scale)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double p = variance(was, n, i, j) - pa[i] * pa[j] / (alpha + news);
            near(scale * scale * p, (aeo_real_t)variance(strips, n, i, j), 100.0);
        }
        near(variance(strips, n, i, i), aeo_strips_norm2(strips, n, i), 20.0);
    }
    TEST_ASSERT_TRUE(aeo_strips_hold(strips, n));
    untouched(strips, AEO_RLS_FACTOR_WORDS(n), FACTOR + GUARD);
    untouched(work, AEO_RLS_WORK_WORDS(n), WORK + GUARD);
}

static void strips_of_every_order_absorb_a_measurement(void)
{
    for (size_t n = 1; n <= LARGEST; n++) {
        aeo_real_t z[LARGEST];
        double pz[LARGEST] = {0}, news = 0.0;
        start_strips(n);
        fill(z, LARGEST, &seed);
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < n; j++) {
                pz[i] += variance(was, n, i, j) * (double)z[j];
            }
            news += pz[i] * (double)z[i];
        }
        near(news, aeo_strips_project(strips, z, n, work), 10.0 * (double)n);
        const aeo_real_t *const gain = aeo_strips_rotate(strips, n, n, work, AEO_REAL(0.75), AEO_REAL(1.125));
        for (size_t i = 0; i < n; i++) {
            near(pz[i], gain[i], 10.0 * (double)n);
        }
        assert_absorbed(n, pz, 0.75, news, 1.125);
    }
}

/* a = weight times row i, of which the rotation needs the first i + 1 alone: S a is weight times column i of P. */
static void strips_of_every_order_absorb_a_row(void)
{
    for (size_t n = 1; n <= LARGEST; n++) {
        for (size_t row = 0; row < n; row++) {
            double pa[LARGEST] = {0};
            start_strips(n);
            aeo_strips_take_row(strips, n, row, AEO_REAL(0.5), work);
            for (size_t i = 0; i < n; i++) {
                pa[i] = 0.5 * variance(was, n, i, row);
            }
            const aeo_real_t *const gain = aeo_strips_rotate(strips, n, row + 1u, work, AEO_REAL(1), AEO_REAL(1));
            for (size_t i = 0; i < n; i++) {
                near(pa[i], gain[i], 10.0);
            }
            assert_absorbed(n, pa, 1.0, 0.25 * variance(was, n, row, row), 1.0);
        }
    }
}

/* Every word of a factor: above 0 on the diagonal, free below it, 0 elsewhere. */
static void every_word_of_a_factor_is_judged(void)
{
    for (size_t n = 1; n <= LARGEST; n++) {
        const size_t words = AEO_RLS_FACTOR_WORDS(n);
        size_t diagonal = 0, below = 0;
        start_strips(n);
        for (size_t i = 0; i < words; i++) {
            const aeo_real_t kept = strips[i];
            strips[i] = AEO_REAL(0);
            const int zero = aeo_strips_hold(strips, n);
            strips[i] = AEO_REAL(1);
            const int above = aeo_strips_hold(strips, n);
            strips[i] = AEO_REAL(-1);
            const int less = aeo_strips_hold(strips, n);
            strips[i] = kept;
            TEST_ASSERT_TRUE(zero || above);
            TEST_ASSERT_TRUE(!zero || above == less);
            diagonal += !zero;
            below += zero && above && less;
        }
        TEST_ASSERT_EQUAL_size_t(n, diagonal);
        TEST_ASSERT_EQUAL_size_t(n * (n - 1u) / 2u, below);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_row_among_others_has_the_sum_it_has_alone);
    RUN_TEST(errors_end_at_their_bound);
    RUN_TEST(rows_move_at_every_length);
    RUN_TEST(columns_correct_and_move_at_every_length);
    RUN_TEST(a_word_out_of_range_is_found_at_every_place);
    RUN_TEST(triangles_of_every_order_absorb_a_measurement);
    RUN_TEST(strips_of_every_order_absorb_a_measurement);
    RUN_TEST(strips_of_every_order_absorb_a_row);
    RUN_TEST(every_word_of_a_factor_is_judged);
    return UNITY_END();
}
