/* naive.c: the textbook RLS as one would write it down: g = P z / (lambda + z'P z), theta += eps g', P = (P - g z'P) /
 * lambda. */
#include "rivals.h"

void naive_update(aeo_real_t *p, aeo_real_t *theta, aeo_real_t *g, size_t n, size_t l, aeo_real_t lambda,
                  const aeo_real_t *z, const aeo_real_t *y)
{
    aeo_real_t alpha = lambda;
    for (size_t i = 0; i < n; i++) {
        aeo_real_t sum = AEO_REAL(0);
        for (size_t j = 0; j < n; j++) {
            sum += p[i * n + j] * z[j];
        }
        g[i] = sum;
        alpha += z[i] * sum;
    }
    for (size_t i = 0; i < l; i++) {
        aeo_real_t eps = y[i];
        for (size_t j = 0; j < n; j++) {
            eps -= theta[i * n + j] * z[j];
        }
        for (size_t j = 0; j < n; j++) {
            theta[i * n + j] += eps * g[j] / alpha;
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            p[i * n + j] = (p[i * n + j] - g[i] * g[j] / alpha) / lambda;
        }
    }
}
