#include "capi_bigint.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* --- sums and products --------------------------------------------------------------------------------------------- */

static const struct bigint ZERO = {NULL, 0, 0, 0};

/* Limbs become a number: without zeros at its ends. */
static struct bigint made(const uint32_t *limbs, size_t n, int64_t shift, int sign)
{
    struct bigint a;
    while (n > 0 && limbs[n - 1] == 0) n--;
    while (n > 0 && *limbs == 0) {
        limbs++;
        n--;
        shift++;
    }
    if (n == 0) return ZERO;
    a.limbs = limbs;
    a.n = n;
    a.shift = shift;
    a.sign = sign;
    return a;
}

static uint32_t *limbs_of(struct arena *arena, size_t n) { return arena_take(arena, (n ? n : 1) * sizeof(uint32_t)); }

struct bigint bigint_of(struct arena *arena, double value)
{
    int exponent, low;
    uint64_t bits;
    uint32_t *limbs = limbs_of(arena, 3);
    if (limbs == NULL || value == 0.0 || !(fabs(value) <= DBL_MAX)) return ZERO;
    bits = (uint64_t)ldexp(frexp(fabs(value), &exponent), 53);
    exponent = exponent - 53 + 32 * 64; /* above 0: doubles end at 2^-1074 */
    low = exponent % 32;
    limbs[0] = (uint32_t)(bits << low);
    limbs[1] = (uint32_t)(bits << low >> 32);
    limbs[2] = low > 0 ? (uint32_t)(bits >> (64 - low)) : 0;
    return made(limbs, 3, exponent / 32 - 64, value < 0.0 ? -1 : 1);
}

struct bigint bigint_copy(struct arena *arena, struct bigint a)
{
    uint32_t *limbs = limbs_of(arena, a.n);
    if (limbs == NULL || a.n == 0) return ZERO;
    memcpy(limbs, a.limbs, a.n * sizeof *limbs);
    a.limbs = limbs;
    return a;
}

static uint32_t limb_at(struct bigint a, int64_t place)
{
    return place >= a.shift && place < a.shift + (int64_t)a.n ? a.limbs[place - a.shift] : 0;
}

/* -1, 0, 1: how the sizes compare, whatever the signs. */
static int compare_sizes(struct bigint a, struct bigint b)
{
    int64_t place, end = a.shift + (int64_t)a.n, low = a.shift < b.shift ? a.shift : b.shift;
    if (a.n == 0 || b.n == 0) return a.n > 0 ? 1 : b.n > 0 ? -1 : 0;
    if (end != b.shift + (int64_t)b.n) return end > b.shift + (int64_t)b.n ? 1 : -1;
    for (place = end - 1; place >= low; place--) {
        uint32_t x = limb_at(a, place), y = limb_at(b, place);
        if (x != y) return x > y ? 1 : -1;
    }
    return 0;
}

int bigint_equal(struct bigint a, struct bigint b) { return a.sign == b.sign && compare_sizes(a, b) == 0; }

struct bigint bigint_sum(struct arena *arena, struct bigint a, struct bigint b)
{
    int64_t low, end, place;
    uint32_t *limbs;
    uint64_t carry = 0;
    int subtract = a.sign != b.sign;
    if (a.n == 0) return b;
    if (b.n == 0) return a;
    if (subtract && compare_sizes(a, b) < 0) {
        struct bigint other = a;
        a = b;
        b = other;
    }
    low = a.shift < b.shift ? a.shift : b.shift;
    end = a.shift + (int64_t)a.n;
    if (end < b.shift + (int64_t)b.n) end = b.shift + (int64_t)b.n;
    if ((limbs = limbs_of(arena, (size_t)(end - low) + 1)) == NULL) return ZERO;
    for (place = low; place < end; place++) {
        uint64_t x = limb_at(a, place), y = limb_at(b, place);
        carry = subtract ? x - y - carry : x + y + carry;
        limbs[place - low] = (uint32_t)carry;
        carry = carry >> 32 & 1; /* of a difference below 0 all higher bits are set */
    }
    limbs[end - low] = (uint32_t)carry;
    return made(limbs, (size_t)(end - low) + 1, low, a.sign);
}

struct bigint bigint_difference(struct arena *arena, struct bigint a, struct bigint b)
{
    b.sign = -b.sign;
    return bigint_sum(arena, a, b);
}

struct bigint bigint_product(struct arena *arena, struct bigint a, struct bigint b)
{
    uint32_t *limbs;
    size_t i, j;
    if (a.n == 0 || b.n == 0) return ZERO;
    if ((limbs = limbs_of(arena, a.n + b.n)) == NULL) return ZERO;
    memset(limbs, 0, (a.n + b.n) * sizeof *limbs);
    for (i = 0; i < a.n; i++) {
        uint64_t carry = 0;
        for (j = 0; j < b.n; j++) {
            carry += (uint64_t)a.limbs[i] * b.limbs[j] + limbs[i + j];
            limbs[i + j] = (uint32_t)carry;
            carry >>= 32;
        }
        limbs[i + b.n] = (uint32_t)carry;
    }
    return made(limbs, a.n + b.n, a.shift + b.shift, a.sign * b.sign);
}

/* --- quotients ----------------------------------------------------------------------------------------------------- */

static int leading_zeros(uint32_t limb)
{
    int found = 0;
    while (!(limb & 0x80000000u)) {
        limb <<= 1;
        found++;
    }
    return found;
}

/* Bits of a number below its highest one, 2^0 counted as 1. */
static int64_t length_in_bits(struct bigint a) { return 32 * ((int64_t)a.n + a.shift) - leading_zeros(a.limbs[a.n - 1]); }

/* The limbs of a, so that its highest bit is the highest of n limbs but one. */
static void write_aligned(struct bigint a, uint32_t *out, size_t n)
{
    int n_zeros = leading_zeros(a.limbs[a.n - 1]);
    size_t k;
    memset(out, 0, (n + 1) * sizeof *out);
    for (k = 0; k < a.n; k++) {
        uint64_t limb = (uint64_t)a.limbs[a.n - 1 - k] << n_zeros;
        out[n - 1 - k] |= (uint32_t)limb;
        out[n - k] |= (uint32_t)(limb >> 32);
    }
}

/* Whether r of n + 1 limbs is at least d; if so it becomes less by d. */
static int subtract_if_larger(uint32_t *r, const uint32_t *d, size_t n)
{
    size_t k = n + 1;
    uint64_t carry = 0;
    while (k > 0 && r[k - 1] == d[k - 1]) k--;
    if (k > 0 && r[k - 1] < d[k - 1]) return 0;
    for (k = 0; k <= n; k++) {
        carry = (uint64_t)r[k] - d[k] - carry;
        r[k] = (uint32_t)carry;
        carry = carry >> 32 & 1;
    }
    return 1;
}

/* 62 bits q of which the first or second is set, the last also where anything follows, times 2^exponent, to a double. */
static double to_double(uint64_t q, int64_t exponent)
{
    int64_t top = exponent + (q >> 61 & 1 ? 61 : 60), last = top - 52;
    uint64_t rest, half;
    int drop;
    if (top > 1023) return HUGE_VAL;
    if (last < -1074) last = -1074;
    if (last - exponent > 62) return 0.0;
    drop = (int)(last - exponent);
    rest = q & (((uint64_t)1 << drop) - 1);
    half = (uint64_t)1 << (drop - 1);
    q >>= drop;
    if (rest > half || (rest == half && (q & 1))) q++;
    return ldexp((double)q, (int)last);
}

double bigint_ratio(struct arena *arena, struct bigint a, struct bigint b)
{
    size_t n = a.n > b.n ? a.n : b.n, k;
    uint32_t *r, *d;
    uint64_t q = 0, rest = 0;
    int bit;
    if (a.n == 0) return 0.0;
    r = limbs_of(arena, n + 1);
    d = limbs_of(arena, n + 1);
    if (r == NULL || d == NULL) return 0.0;
    write_aligned(a, r, n);
    write_aligned(b, d, n);
    for (bit = 0; bit < 62; bit++) {
        q = q << 1 | (uint64_t)subtract_if_larger(r, d, n);
        for (k = n; k > 0; k--) r[k] = r[k] << 1 | r[k - 1] >> 31;
        r[0] <<= 1;
    }
    for (k = 0; k <= n; k++) rest |= r[k];
    return a.sign * b.sign * to_double(q | (rest != 0), length_in_bits(a) - length_in_bits(b) - 61);
}

double bigint_rounded(struct arena *arena, struct bigint a)
{
    struct bigint one = bigint_of(arena, 1.0);
    return arena->failed ? 0.0 : bigint_ratio(arena, a, one);
}

/* --- what numbers have in common ----------------------------------------------------------------------------------- */

static int64_t trailing_zeros(struct bigint a)
{
    int found = 0;
    while (!(a.limbs[0] >> found & 1)) found++;
    return 32 * a.shift + found;
}

/* Limbs turned right by some bits, below 32. */
static size_t shift_right(uint32_t *limbs, size_t n, int bits)
{
    size_t k;
    for (k = 0; bits > 0 && k < n; k++) limbs[k] = limbs[k] >> bits | (k + 1 < n ? limbs[k + 1] << (32 - bits) : 0);
    while (n > 0 && limbs[n - 1] == 0) n--;
    return n;
}

/* Make limbs odd; returns how many are left. */
static size_t make_odd(uint32_t *limbs, size_t n)
{
    size_t zeros = 0;
    int bits = 0;
    while (zeros < n && limbs[zeros] == 0) zeros++;
    if (zeros > 0) memmove(limbs, limbs + zeros, (n - zeros) * sizeof *limbs);
    n -= zeros;
    if (n == 0) return 0;
    while (!(limbs[0] >> bits & 1)) bits++;
    return shift_right(limbs, n, bits);
}

/* Greatest common divisor of two odd numbers, by subtraction and halving: both become it, of as many limbs as is returned. */
static size_t common_divisor(uint32_t *x, size_t n, uint32_t *y, size_t m)
{
    for (;;) {
        size_t k = n > m ? n : m;
        uint64_t carry = 0;
        int larger = n > m;
        if (n == m) {
            while (k > 0 && x[k - 1] == y[k - 1]) k--;
            if (k == 0) return n;
            larger = x[k - 1] > y[k - 1];
        }
        if (!larger) {
            uint32_t *other = x;
            size_t size = n;
            x = y;
            y = other;
            n = m;
            m = size;
        }
        for (k = 0; k < n; k++) {
            carry = (uint64_t)x[k] - (k < m ? y[k] : 0) - carry;
            x[k] = (uint32_t)carry;
            carry = carry >> 32 & 1;
        }
        while (n > 0 && x[n - 1] == 0) n--;
        n = make_odd(x, n);
    }
}

/* The divisor d, odd, of limbs that it divides, taken out of them from below: no remainder is left to care for. */
static void divide_exactly(uint32_t *limbs, size_t n, const uint32_t *d, size_t m)
{
    uint32_t inverse = d[0];
    size_t k, i;
    for (i = 0; i < 4; i++) inverse *= 2 - d[0] * inverse;
    for (k = 0; k < n; k++) {
        uint32_t quotient = limbs[k] * inverse;
        uint64_t carry = 0, borrow = 0;
        for (i = 0; k + i < n; i++) {
            uint64_t part;
            carry += i < m ? (uint64_t)quotient * d[i] : 0;
            part = (uint64_t)limbs[k + i] - (uint32_t)carry - borrow;
            limbs[k + i] = (uint32_t)part;
            borrow = part >> 32 & 1;
            carry >>= 32;
            if (i >= m && carry == 0 && borrow == 0) break;
        }
        limbs[k] = quotient;
    }
}

/* The same number, an integer after a division by 2^zeros, in limbs of its own from 2^0 on. */
static struct bigint without_zeros(struct arena *arena, struct bigint a, int64_t zeros)
{
    int64_t bits = 32 * a.shift - zeros; /* how far the limbs move up; below 0 by less than a limb */
    size_t up = bits > 0 ? (size_t)(bits / 32) : 0, n = a.n + up + 1;
    int part = bits > 0 ? (int)(bits % 32) : 0;
    uint32_t *limbs = limbs_of(arena, n);
    size_t k;
    struct bigint out = ZERO;
    if (limbs == NULL) return ZERO;
    memset(limbs, 0, n * sizeof *limbs);
    for (k = 0; k < a.n; k++) {
        uint64_t limb = (uint64_t)a.limbs[k] << part;
        limbs[up + k] |= (uint32_t)limb;
        limbs[up + k + 1] |= (uint32_t)(limb >> 32);
    }
    out.limbs = limbs;
    out.sign = a.sign;
    out.n = shift_right(limbs, n, bits < 0 ? (int)-bits : 0);
    return out;
}

void bigint_make_coprime(struct arena *arena, struct bigint *numbers, size_t n)
{
    int64_t zeros = INT64_MAX;
    size_t k, n_divisor = 0, longest = 0;
    uint32_t *divisor, *other;
    for (k = 0; k < n; k++)
        if (numbers[k].n > 0 && trailing_zeros(numbers[k]) < zeros) zeros = trailing_zeros(numbers[k]);
    for (k = 0; k < n; k++) {
        if (numbers[k].n > 0) numbers[k] = without_zeros(arena, numbers[k], zeros);
        if (numbers[k].n > longest) longest = numbers[k].n;
    }
    divisor = limbs_of(arena, longest);
    other = limbs_of(arena, longest);
    if (divisor == NULL || other == NULL) return;
    for (k = 0; k < n; k++) {
        size_t length = numbers[k].n;
        if (length == 0) continue;
        memcpy(other, numbers[k].limbs, length * sizeof *other);
        length = make_odd(other, length);
        if (n_divisor == 0) {
            memcpy(divisor, other, length * sizeof *other);
            n_divisor = length;
        } else {
            n_divisor = common_divisor(divisor, n_divisor, other, length);
        }
    }
    for (k = 0; k < n; k++) {
        uint32_t *limbs = (uint32_t *)numbers[k].limbs; /* made above: nobody else's */
        if (numbers[k].n == 0) continue;
        if (!(n_divisor == 1 && divisor[0] == 1)) divide_exactly(limbs, numbers[k].n, divisor, n_divisor);
        numbers[k] = made(limbs, numbers[k].n, 0, numbers[k].sign);
    }
}
