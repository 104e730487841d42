/* <string.h> for the proof: numbers are copied and cleared one by one, so that the prover sees numbers and not their
 * bytes; anything else is a number's bits or a row of 32-bit counters. Structures are only cleared where they are 0. */
#ifndef PROOF_STRING_H
#define PROOF_STRING_H

#include <stddef.h>
#include <stdint.h>

#ifdef AEO_REAL_DOUBLE
typedef double proof_real_t;
#else
typedef float proof_real_t;
#endif

static inline void proof_copy_reals(proof_real_t *to, const void *from, size_t bytes)
{
    for (size_t i = 0; i < bytes / sizeof *to; i++) {
        to[i] = ((const proof_real_t *)from)[i];
    }
}

static inline void proof_copy_words(void *to, const void *from, size_t bytes)
{
    __CPROVER_assert(bytes % sizeof(uint32_t) == 0, "whole words are copied");
    for (size_t i = 0; i < bytes / sizeof(uint32_t); i++) {
        ((uint32_t *)to)[i] = ((const uint32_t *)from)[i];
    }
}

static inline void proof_clear_reals(proof_real_t *to, size_t bytes)
{
    for (size_t i = 0; i < bytes / sizeof *to; i++) {
        to[i] = 0;
    }
}

static inline void proof_clear_nothing(void *to, size_t bytes)
{
    (void)to;
    (void)bytes;
}

#define memcpy(to, from, bytes)                                                                                        \
    _Generic((to), proof_real_t * : proof_copy_reals, default : proof_copy_words)(to, from, bytes)
#define memset(to, value, bytes)                                                                                       \
    _Generic((to), proof_real_t * : proof_clear_reals, default : proof_clear_nothing)(to, bytes)

#endif
