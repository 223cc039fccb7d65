/* Whole numbers of any size times a power of two: what doubles and their sums and products are, exactly. */
#ifndef COLLIDE_CAPI_WHOLE_H
#define COLLIDE_CAPI_WHOLE_H

#include <stdint.h>

#include "capi_arena.h"

/* sign * (limbs, least first) * 2^(32 * shift). No limb at either end is 0; sign 0 has none. */
struct whole {
    const uint32_t *limbs;
    int64_t shift;
    size_t n;
    int sign;
};

/* Of a finite double; 0 of others. */
struct whole whole_of(struct arena *arena, double value);
struct whole whole_sum(struct arena *arena, struct whole a, struct whole b);
struct whole whole_difference(struct arena *arena, struct whole a, struct whole b);
struct whole whole_product(struct arena *arena, struct whole a, struct whole b);
struct whole whole_copy(struct arena *arena, struct whole a);
int whole_equal(struct whole a, struct whole b);

/* a / b to the nearest double, ties to even; b is not 0. Infinite where it is too large. */
double whole_ratio(struct arena *arena, struct whole a, struct whole b);
double whole_rounded(struct arena *arena, struct whole a);

/* Divide n numbers, not all 0, by what all have in common: coprime integers are left. */
void whole_make_coprime(struct arena *arena, struct whole *numbers, size_t n);

#endif
