/* Whole numbers of any size times a power of two: what doubles and their sums and products are, exactly. */
#ifndef COLLIDE_CAPI_BIGINT_H
#define COLLIDE_CAPI_BIGINT_H

#include <stdint.h>

#include "capi_arena.h"

/* sign * (limbs, least first) * 2^(32 * shift). No limb at either end is 0; sign 0 has none. */
struct bigint {
    const uint32_t *limbs;
    int64_t shift;
    size_t n;
    int sign;
};

/* Of a finite double; 0 of others. */
struct bigint bigint_of(struct arena *arena, double value);
struct bigint bigint_sum(struct arena *arena, struct bigint a, struct bigint b);
struct bigint bigint_difference(struct arena *arena, struct bigint a, struct bigint b);
struct bigint bigint_product(struct arena *arena, struct bigint a, struct bigint b);
struct bigint bigint_copy(struct arena *arena, struct bigint a);
int bigint_equal(struct bigint a, struct bigint b);

/* a / b to the nearest double, ties to even; b is not 0. Infinite where it is too large. */
double bigint_ratio(struct arena *arena, struct bigint a, struct bigint b);
double bigint_rounded(struct arena *arena, struct bigint a);

/* Divide n numbers, not all 0, by what all have in common: coprime integers are left. */
void bigint_make_coprime(struct arena *arena, struct bigint *numbers, size_t n);

#endif
