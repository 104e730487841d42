/* samples.c: see samples.h. */
#include "samples.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

double draw(uint64_t *seed)
{
    /* SplitMix64 (Steele, Lea, Flood 2014) */
    *seed += UINT64_C(0x9E3779B97F4A7C15);
    uint64_t z = *seed;
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    z ^= z >> 31;
    return (double)(z >> 11) / 4503599627370496.0 - 1.0;
}

void fill(aeo_real_t *x, size_t count, uint64_t *seed)
{
    for (size_t i = 0; i < count; i++) {
        x[i] = (aeo_real_t)draw(seed);
    }
}

aeo_real_t make_not_finite(int kind)
{
    aeo_real_t x;
#if AEO_REAL_BYTES == 8
    const uint64_t bits[4] = {UINT64_C(0x7FF8000000000001), UINT64_C(0xFFF8000000000000), UINT64_C(0x7FF0000000000000),
                              UINT64_C(0xFFF0000000000000)};
#else
    const uint32_t bits[4] = {0x7FC00001u, 0xFFC00000u, 0x7F800000u, 0xFF800000u};
#endif
    memcpy(&x, &bits[kind], sizeof x);
    return x;
}

/* Reduce a (rows x cols, by rows) to upper triangular form in its first n columns by Householder reflections. */
static void reduce(double *a, size_t rows, size_t cols, size_t n)
{
    for (size_t j = 0; j < n; j++) {
        double norm = 0.0;
        for (size_t i = j; i < rows; i++) {
            norm += a[i * cols + j] * a[i * cols + j];
        }
        norm = a[j * cols + j] > 0.0 ? -sqrt(norm) : sqrt(norm);
        const double head = a[j * cols + j] - norm, beta = -1.0 / (norm * head);
        a[j * cols + j] = head;
        for (size_t c = j + 1; c < cols; c++) {
            double dot = 0.0;
            for (size_t i = j; i < rows; i++) {
                dot += a[i * cols + j] * a[i * cols + c];
            }
            for (size_t i = j; i < rows; i++) {
                a[i * cols + c] -= beta * dot * a[i * cols + j];
            }
        }
        a[j * cols + j] = norm;
    }
}

void solve_batch(const aeo_real_t *z, const aeo_real_t *y, const double *weight, size_t count, size_t n, size_t l,
                 const double *ridge, double *theta)
{
    const size_t cols = n + l, rows = n + count;
    double *a = calloc(rows * cols, sizeof *a);
    if (a == NULL) {
        fputs("no memory for the batch solution\n", stderr);
        exit(1);
    }
    for (size_t j = 0; j < n; j++) {
        a[j * cols + j] = sqrt(ridge[j]);
    }
    for (size_t k = 0; k < count; k++) {
        const double w = weight != NULL ? sqrt(weight[k]) : 1.0;
        for (size_t j = 0; j < n; j++) {
            a[(n + k) * cols + j] = w * (double)z[k * n + j];
        }
        for (size_t i = 0; i < l; i++) {
            a[(n + k) * cols + n + i] = w * (double)y[k * l + i];
        }
    }
    reduce(a, rows, cols, n);
    for (size_t i = 0; i < l; i++) {
        for (size_t j = n; j-- > 0;) {
            double sum = a[j * cols + n + i];
            for (size_t c = j + 1; c < n; c++) {
                sum -= a[j * cols + c] * theta[i * n + c];
            }
            theta[i * n + j] = sum / a[j * cols + j];
        }
    }
    free(a);
}

double relative_distance(const aeo_real_t *a, const double *b, size_t count)
{
    double difference = 0.0, size = 0.0;
    for (size_t i = 0; i < count; i++) {
        difference += ((double)a[i] - b[i]) * ((double)a[i] - b[i]);
        size += b[i] * b[i];
    }
    return !(difference <= 0.0) ? sqrt(difference / size) : 0.0; /* before any news both are 0; NaN is kept */
}
