/* bare.c: a processor without any C library, as a Linux process: entry, two system calls, memcpy, memset and a square
 * root in integers. For RISC-V and big-endian PowerPC. */
#include "../board.h"

#include "math.h"
#include "string.h"

#if defined(__riscv)
enum { CALL_WRITE = 64, CALL_EXIT = 93 };

__asm__(".globl _start\n_start:\n\tandi sp, sp, -16\n\tcall start\n");

static long call_kernel(long number, long a, long b, long c)
{
    register long a7 __asm__("a7") = number;
    register long a0 __asm__("a0") = a;
    register long a1 __asm__("a1") = b;
    register long a2 __asm__("a2") = c;
    __asm__ volatile("ecall" : "+r"(a0) : "r"(a1), "r"(a2), "r"(a7) : "memory");
    return a0;
}
#elif defined(__powerpc__)
enum { CALL_WRITE = 4, CALL_EXIT = 1 };

__asm__(".globl _start\n_start:\n\trlwinm 1, 1, 0, 0, 27\n\tstwu 1, -32(1)\n\tbl start\n");

static long call_kernel(long number, long a, long b, long c)
{
    register long r0 __asm__("r0") = number;
    register long r3 __asm__("r3") = a;
    register long r4 __asm__("r4") = b;
    register long r5 __asm__("r5") = c;
    __asm__ volatile("sc" : "+r"(r0), "+r"(r3), "+r"(r4), "+r"(r5)::"memory", "cr0");
    return r3;
}
#else
#error "no start-up code for this processor"
#endif

void start(void);

void start(void)
{
    board_exit(board_main());
}

void board_write(const char *text)
{
    long length = 0;
    while (text[length] != '\0') {
        length++;
    }
    (void)call_kernel(CALL_WRITE, 1, (long)text, length);
}

void board_exit(int code)
{
    for (;;) {
        (void)call_kernel(CALL_EXIT, code, 0, 0);
    }
}

uint32_t board_ticks(void)
{
    return 0;
}

void *memcpy(void *to, const void *from, size_t count)
{
    unsigned char *target = to;
    const unsigned char *source = from;
    while (count-- > 0u) {
        *target++ = *source++;
    }
    return to;
}

void *memset(void *to, int value, size_t count)
{
    unsigned char *target = to;
    while (count-- > 0u) {
        *target++ = (unsigned char)value;
    }
    return to;
}

/* Correctly rounded square roots digit by digit, of normal numbers, which is all that the filters' proofs admit: with
 * mantissa M and even exponent, floor(sqrt(M 4^k)) has one bit more than the result keeps, and a remainder above 0 says
 * that the true root lies above it. A root is never exactly between two results, so that bit alone rounds to nearest. */
float sqrtf(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    if (bits << 1 == 0u) {
        return x;
    }
    const int32_t exponent = (int32_t)(bits >> 23) - 127;
    const int odd = exponent & 1;
    const uint64_t mantissa = (uint64_t)((bits & 0x7FFFFFu) | 0x800000u) << (25 + odd); /* root has 25 bits */
    uint32_t root = 0;
    for (uint32_t bit = UINT32_C(1) << 24; bit != 0u; bit >>= 1) {
        const uint64_t trial = root | bit;
        root |= trial * trial <= mantissa ? bit : 0u;
    }
    root = (root >> 1) + (root & 1u); /* may carry into the exponent, as it should */
    bits = root - 0x800000u + ((uint32_t)((exponent - odd) / 2 + 127) << 23);
    memcpy(&x, &bits, sizeof bits);
    return x;
}

double sqrt(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    if (bits << 1 == 0u) {
        return x;
    }
    const int32_t exponent = (int32_t)(bits >> 52) - 1023;
    const int odd = exponent & 1;
    uint64_t rest = ((bits & UINT64_C(0xFFFFFFFFFFFFF)) | UINT64_C(0x10000000000000)) << odd, root = 0;
    /* schoolbook: two digits of the argument a turn, 54 bits of root; the first turn takes the whole part */
    uint64_t left = rest >> 52;
    rest = rest << 12; /* the 52 bits behind the point, left-aligned */
    root = 1;
    left -= 1u;
    for (int i = 0; i < 53; i++) {
        left = left << 2 | rest >> 62;
        rest <<= 2;
        const uint64_t trial = root << 2 | 1u;
        root <<= 1;
        if (left >= trial) {
            left -= trial;
            root |= 1u;
        }
    }
    root = (root >> 1) + (root & 1u);
    bits = root - UINT64_C(0x10000000000000) + ((uint64_t)((exponent - odd) / 2 + 1023) << 52);
    memcpy(&x, &bits, sizeof bits);
    return x;
}
