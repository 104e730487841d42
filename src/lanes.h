/* lanes.h: several numbers at once, where the compiler has vectors and the processor keeps to IEEE 754 in them; internal,
 * not installed.
 *
 * A kernel is written once, in aeo_lanes_t, which holds AEO_LANES numbers: 4 or 8 floats, 2 or 4 doubles, and 1 where
 * there are no vectors or AEO_NO_VECTORS is defined. Sums run in 8 lanes in every build and end in one order, so that each
 * form gives the same bits.
 */
#ifndef AEOLID_LANES_H
#define AEOLID_LANES_H

#include "aeolid/config.h"

#include "root.h"

#if !defined(AEO_NO_VECTORS) && defined(__GNUC__) && (defined(__SSE2__) || defined(__aarch64__))
#ifdef __AVX__
#define AEO_LANES_BYTES 32
#else
#define AEO_LANES_BYTES 16
#endif
#define AEO_LANES (AEO_LANES_BYTES / AEO_REAL_BYTES)
typedef aeo_real_t aeo_lanes_t __attribute__((vector_size(AEO_LANES_BYTES)));
/* the same anywhere in an array of numbers */
typedef aeo_real_t aeo_lanes_there_t __attribute__((vector_size(AEO_LANES_BYTES), aligned(AEO_REAL_BYTES), may_alias));
#if AEO_REAL_BYTES == 8
typedef int64_t aeo_lanes_bits_t __attribute__((vector_size(AEO_LANES_BYTES)));
#define AEO_LANES_MAGNITUDE INT64_MAX
#else
typedef int32_t aeo_lanes_bits_t __attribute__((vector_size(AEO_LANES_BYTES)));
#define AEO_LANES_MAGNITUDE INT32_MAX
#endif
#else
#define AEO_LANES 1
typedef aeo_real_t aeo_lanes_t, aeo_lanes_there_t;
#endif

/* For what a vector is too long for: four floats where it has eight, else no other vector; and a number by itself. */
#if AEO_LANES == 8
#define AEO_FEW 4
typedef aeo_real_t aeo_few_t __attribute__((vector_size(16)));
typedef aeo_real_t aeo_few_there_t __attribute__((vector_size(16), aligned(AEO_REAL_BYTES), may_alias));
#else
#define AEO_FEW AEO_LANES
typedef aeo_lanes_t aeo_few_t;
typedef aeo_lanes_there_t aeo_few_there_t;
#endif
typedef aeo_real_t aeo_one_t, aeo_one_there_t;

/* The header of all that later processors can do takes longer to read than a source of this library to compile. */
#if defined(__SSE2__) && AEO_LANES > 1
#ifdef __AVX__
#include <immintrin.h>
#else
#include <emmintrin.h>
#endif
#endif

/* What a lane of a sum begins with: -0, to which any number, -0 too, adds itself. So beginning with a product is the same. */
#define AEO_SUM_START (-AEO_REAL(0))

/* Lanes of a sum, and the vectors that hold them. AEO_EACH_PART(DO) is DO(0) DO(1) ... for all of these, AEO_LAST_FOUR(DO) for
 * those of the last four lanes, if these are by themselves: as no loop, since not every level of optimisation keeps what a
 * loop goes over in registers. */
#define AEO_SUM_LANES 8
#define AEO_PARTS     (AEO_SUM_LANES / AEO_LANES)
#if AEO_PARTS == 1
#define AEO_EACH_PART(DO) DO(0)
#elif AEO_PARTS == 2
#define AEO_EACH_PART(DO) DO(0) DO(1)
#define AEO_LAST_FOUR(DO) DO(1)
#elif AEO_PARTS == 4
#define AEO_EACH_PART(DO) DO(0) DO(1) DO(2) DO(3)
#define AEO_LAST_FOUR(DO) DO(2) DO(3)
#else
#define AEO_EACH_PART(DO) DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7)
#define AEO_LAST_FOUR(DO) DO(4) DO(5) DO(6) DO(7)
#endif
/* A kernel without sums over lanes is a macro of the type (lanes, few, one) and of how many of these go abreast, twice,
 * since it gives the same bits in any: two vectors, or four numbers where there are none, then what is left. */
#define AEO_AT(type, pointer)   (*(aeo_##type##_there_t *)(pointer))
#define AEO_FROM(type, pointer) (*(const aeo_##type##_there_t *)(pointer))
#define AEO_SIZE(type)          (sizeof(aeo_##type##_t) / sizeof(aeo_real_t))
#define AEO_ALONE(DO, type)     DO(type, 0)
#if AEO_LANES > 1
#define AEO_ABREAST           2
#define AEO_EACH_OF(DO, type) DO(type, 0) DO(type, 1)
#else
#define AEO_ABREAST           4
#define AEO_EACH_OF(DO, type) DO(type, 0) DO(type, 1) DO(type, 2) DO(type, 3)
#endif

/* Text counts for more than time: one kernel serves two purposes. */
#if AEO_LANES == 1 && defined(__OPTIMIZE_SIZE__)
#define AEO_SMALL 1
#else
#define AEO_SMALL 0
#endif

static inline aeo_lanes_t aeo_lanes_load(const aeo_real_t *from)
{
    return *(const aeo_lanes_there_t *)from;
}

static inline void aeo_lanes_store(aeo_real_t *to, aeo_lanes_t x)
{
    *(aeo_lanes_there_t *)to = x;
}

/* x in every lane */
static inline aeo_lanes_t aeo_lanes_spread(aeo_real_t x)
{
#if AEO_LANES == 8
    return (aeo_lanes_t){x, x, x, x, x, x, x, x};
#elif AEO_LANES == 4
    return (aeo_lanes_t){x, x, x, x};
#elif AEO_LANES == 2
    return (aeo_lanes_t){x, x};
#else
    return x;
#endif
}

/* Add four more products, x[i] y[i], to the first four of 8 lanes. */
static inline void aeo_lanes_add_four(aeo_lanes_t *part, const aeo_real_t *x, const aeo_real_t *y)
{
#if AEO_LANES == 8
    const aeo_few_t low = _mm256_castps256_ps128(part[0]) + AEO_FROM(few, x) * AEO_FROM(few, y);
    part[0] = _mm256_insertf128_ps(part[0], low, 0);
#elif AEO_LANES == 4
    part[0] += aeo_lanes_load(x) * aeo_lanes_load(y);
#elif AEO_LANES == 2
    part[0] += aeo_lanes_load(x) * aeo_lanes_load(y);
    part[1] += aeo_lanes_load(x + 2) * aeo_lanes_load(y + 2);
#else
    part[0] += x[0] * y[0];
    part[1] += x[1] * y[1];
    part[2] += x[2] * y[2];
    part[3] += x[3] * y[3];
#endif
}

/* Return the sum of 8 lanes, ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)). */
static inline aeo_real_t aeo_lanes_sum(const aeo_lanes_t *part)
{
#if AEO_LANES == 8
    const aeo_few_t all = _mm256_castps256_ps128(part[0]) + _mm256_extractf128_ps(part[0], 1);
    return (all[0] + all[2]) + (all[1] + all[3]);
#elif AEO_LANES == 4
    const aeo_lanes_t all = part[0] + part[1];
    return (all[0] + all[2]) + (all[1] + all[3]);
#elif AEO_LANES == 2
    const aeo_lanes_t all = (part[0] + part[2]) + (part[1] + part[3]);
    return all[0] + all[1];
#else
    return ((part[0] + part[4]) + (part[2] + part[6])) + ((part[1] + part[5]) + (part[3] + part[7]));
#endif
}

/* Store four sums of 8 lanes, each as aeo_lanes_sum has it. */
static inline void aeo_lanes_store_sums(aeo_real_t *to, const aeo_lanes_t *first, const aeo_lanes_t *second,
                                        const aeo_lanes_t *third, const aeo_lanes_t *fourth)
{
#if defined(__SSE2__) && AEO_REAL_BYTES == 4 && AEO_LANES > 1
#if AEO_LANES == 8
#define FOLD(part) (_mm256_castps256_ps128((part)[0]) + _mm256_extractf128_ps((part)[0], 1))
#else
#define FOLD(part) ((part)[0] + (part)[1])
#endif
    const __m128 a = FOLD(first), b = FOLD(second), c = FOLD(third), d = FOLD(fourth);
    const __m128 ab = _mm_unpacklo_ps(a, b) + _mm_unpackhi_ps(a, b); /* a0 + a2, b0 + b2, a1 + a3, b1 + b3 */
    const __m128 cd = _mm_unpacklo_ps(c, d) + _mm_unpackhi_ps(c, d);
    _mm_storeu_ps(to, _mm_movelh_ps(ab, cd) + _mm_movehl_ps(cd, ab));
#elif defined(__SSE2__) && AEO_LANES == 4
#define FOLD(part) (_mm256_castpd256_pd128((part)[0] + (part)[1]) + _mm256_extractf128_pd((part)[0] + (part)[1], 1))
    const __m128d a = FOLD(first), b = FOLD(second), c = FOLD(third), d = FOLD(fourth);
    _mm_storeu_pd(to, _mm_unpacklo_pd(a, b) + _mm_unpackhi_pd(a, b));
    _mm_storeu_pd(to + 2, _mm_unpacklo_pd(c, d) + _mm_unpackhi_pd(c, d));
#else
#define FOLD(part) aeo_lanes_sum(part)
    to[0] = FOLD(first);
    to[1] = FOLD(second);
    to[2] = FOLD(third);
    to[3] = FOLD(fourth);
#endif
#undef FOLD
}

#if AEO_LANES > 1
/* Square roots of numbers that are not negative. */
static inline aeo_lanes_t aeo_lanes_root(aeo_lanes_t x)
{
#if defined(AEO_SQRT_PLAIN) && defined(__SSE2__)
#if AEO_REAL_BYTES == 8 && AEO_LANES == 4
    return _mm256_sqrt_pd(x);
#elif AEO_REAL_BYTES == 8
    return _mm_sqrt_pd(x);
#elif AEO_LANES == 8
    return _mm256_sqrt_ps(x);
#else
    return _mm_sqrt_ps(x);
#endif
#else
    for (int i = 0; i < AEO_LANES; i++) {
        x[i] = AEO_SQRT(x[i]);
    }
    return x;
#endif
}

/* Let a lane be negative where x, its sign aside, has bits above those of the limit: it is larger, infinite or NaN. */
static inline aeo_lanes_bits_t aeo_lanes_room(aeo_lanes_t x, aeo_lanes_t limit)
{
    return (aeo_lanes_bits_t)limit - ((aeo_lanes_bits_t)x & AEO_LANES_MAGNITUDE);
}

/* Return 1 when a lane is negative. */
static inline int aeo_lanes_any_negative(aeo_lanes_bits_t x)
{
#if defined(__SSE2__) && AEO_REAL_BYTES == 8 && AEO_LANES == 4
    return _mm256_movemask_pd((__m256d)x) != 0;
#elif defined(__SSE2__) && AEO_REAL_BYTES == 8
    return _mm_movemask_pd((__m128d)x) != 0;
#elif defined(__SSE2__) && AEO_LANES == 8
    return _mm256_movemask_ps((__m256)x) != 0;
#elif defined(__SSE2__)
    return _mm_movemask_ps((__m128)x) != 0;
#else
    int any = 0;
    for (int i = 0; i < AEO_LANES; i++) {
        any |= x[i] < 0;
    }
    return any;
#endif
}
#endif

#endif
/* SPDX-License-Identifier: MIT */
