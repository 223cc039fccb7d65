/* Which level of processors this one is of. */
#ifndef COLLIDE_LEVELS_H
#define COLLIDE_LEVELS_H

#include <stdint.h>

#if defined(__x86_64__) || defined(_M_X64)
#if defined(_MSC_VER)
#include <immintrin.h>
#include <intrin.h>
static void cpuid_of(uint32_t leaf, uint32_t sub, uint32_t out[4]) { __cpuidex((int *)out, (int)leaf, (int)sub); }
static uint64_t saved_registers(void) { return _xgetbv(0); }
#else
#include <cpuid.h>
static void cpuid_of(uint32_t leaf, uint32_t sub, uint32_t out[4]) { __cpuid_count(leaf, sub, out[0], out[1], out[2], out[3]); }
static uint64_t saved_registers(void)
{
    uint32_t low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return ((uint64_t)high << 32) | low;
}
#endif

static int has_all(uint32_t word, uint32_t bits) { return (word & bits) == bits; }

/* 2, 3 or 4 for x86-64-v2, -v3 and -v4; 0 for what is older. Not __builtin_cpu_supports: some compilers' answer
   "no" to every level. A level counts only if the system saves its registers. */
static int level_of_processor(void)
{
    uint32_t most[4], basic[4], extended[4] = {0, 0, 0, 0}, far_most[4], far_away[4] = {0, 0, 0, 0};
    uint64_t saved = 0;
    cpuid_of(0, 0, most);
    cpuid_of(1, 0, basic);
    if (most[0] >= 7) cpuid_of(7, 0, extended);
    cpuid_of(0x80000000u, 0, far_most);
    if (far_most[0] >= 0x80000001u) cpuid_of(0x80000001u, 0, far_away);
    if (basic[2] & (1u << 27)) saved = saved_registers();
    /* SSE3, SSSE3, CMPXCHG16B, SSE4.1, SSE4.2, POPCNT; LAHF */
    if (!has_all(basic[2], 1u | 1u << 9 | 1u << 13 | 1u << 19 | 1u << 20 | 1u << 23) || !has_all(far_away[2], 1u)) return 0;
    /* FMA, MOVBE, OSXSAVE, AVX, F16C; BMI1, AVX2, BMI2; LZCNT; registers of 256 bits */
    if (!has_all(basic[2], 1u << 12 | 1u << 22 | 1u << 27 | 1u << 28 | 1u << 29) ||
        !has_all(extended[1], 1u << 3 | 1u << 5 | 1u << 8) || !has_all(far_away[2], 1u << 5) || (saved & 0x6) != 0x6)
        return 2;
    /* AVX512 F, DQ, CD, BW, VL; masks and registers of 512 bits */
    if (!has_all(extended[1], 1u << 16 | 1u << 17 | 1u << 28 | 1u << 30 | 1u << 31) || (saved & 0xe6) != 0xe6) return 3;
    return 4;
}
#define COLLIDE_OLDEST "x86-64-v2 (SSE4.2; processors since about 2009)"
static const char *const level_names[] = {"v2", "v3", "v4"};
static const int level_numbers[] = {2, 3, 4};
#else
static int level_of_processor(void) { return 1; }
#define COLLIDE_OLDEST "arm64"
static const char *const level_names[] = {"arm64"};
static const int level_numbers[] = {1};
#endif

#endif
