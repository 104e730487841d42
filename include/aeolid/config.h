/* config.h: fixes the number type and the hooks that every other header and source of the library uses.
 *
 * MODEL
 *   none; this header computes nothing.
 *
 * CONTRACT
 *   Memory, time and stack: none; there is no config.c.
 *   Every translation unit of one program must see the same settings. A program that includes these headers for one
 *   precision and links the library of the other does not link: in the double build each function that touches
 *   aeo_real_t carries the suffix _f64 in its symbol, so the name asked for does not exist in the float library, and
 *   the other way round. Sources never write the suffix; each header maps its own functions with AEO_REAL_DOUBLE
 *   defined. Functions free of aeo_real_t (status.h) keep one name in both libraries.
 *
 * HOOKS
 *   AEO_CONFIG_HEADER  name of a header, in quotes or angle brackets, read before anything else; it may define any
 *                      macro below. Default: none. Example: -DAEO_CONFIG_HEADER='"my_aeolid_config.h"'.
 *   AEO_REAL_DOUBLE    defined (to anything): aeo_real_t is double. Default: not defined, aeo_real_t is float.
 *   AEO_SQRT(x)        square root of an aeo_real_t that is finite and not negative, correctly rounded; sqrtf or sqrt.
 *                      Define it to an intrinsic where the C library's one is slow; never to an estimate. Not
 *                      defined, sources include <math.h>, public headers do not: they are freestanding.
 *   AEO_NO_VECTORS     defined: no vectors of the compiler's, whatever the processor has; the bits are the same. Default:
 *                      not defined; gcc and clang use SSE2 or AVX on x86 and Advanced SIMD on 64-bit Arm.
 *   AEO_RESTRICT       C's restrict; in C++ and for MSVC, which have it under another name, __restrict. Define it to nothing
 *                      for a compiler that has neither.
 *   AEO_ASSERT(c)      checks a bound that a comment in a source proves; default: nothing. A debug build may define it
 *                      to assert(c). It is never the only guard against a wrong argument or a bad sample.
 */
#ifndef AEOLID_CONFIG_H
#define AEOLID_CONFIG_H

#ifdef AEO_CONFIG_HEADER
#include AEO_CONFIG_HEADER
#endif

#include <float.h>
#include <limits.h>
#include <stddef.h>
#include <stdint.h>

#if FLT_RADIX != 2 || FLT_MANT_DIG != 24
#error "aeolid needs IEEE 754 binary32 for float: samples are checked on their bit pattern"
#endif

#if SIZE_MAX < 0xFFFFFFFF || UINT_MAX < 0xFFFFFFFF
#error "aeolid needs integers and sizes of 32 bits: with 16 the sizes of its arrays wrap"
#endif

#ifdef AEO_REAL_DOUBLE
#if DBL_MANT_DIG != 53
#error "AEO_REAL_DOUBLE needs IEEE 754 binary64 for double; this target's double is shorter"
#endif
typedef double aeo_real_t;
#define AEO_REAL_BYTES   8
#define AEO_REAL_EPSILON DBL_EPSILON
#else
typedef float aeo_real_t;
#define AEO_REAL_BYTES   4
#define AEO_REAL_EPSILON FLT_EPSILON
#endif

/* AEO_REAL(0.5): a constant of the build's precision, so that no float build computes in double by accident. */
#define AEO_REAL(x) ((aeo_real_t)(x))

/* Words at the end of every saved array: the CRC-32 of frame.h over the bits of all before, in halves of 16 bits. */
#define AEO_SAVED_SEAL 2u

#ifndef AEO_SQRT
#define AEO_SQRT_PLAIN /* several roots at once are as good */
#ifdef AEO_REAL_DOUBLE
#define AEO_SQRT(x) sqrt(x)
#else
#define AEO_SQRT(x) sqrtf(x)
#endif
#endif

#ifndef AEO_RESTRICT
#if defined(__cplusplus) || defined(_MSC_VER)
#define AEO_RESTRICT __restrict
#else
#define AEO_RESTRICT restrict
#endif
#endif

#ifndef AEO_ASSERT
#define AEO_ASSERT(condition) ((void)0)
#endif

#endif
/* SPDX-License-Identifier: MIT */
