/* Two half-spaces whose normals are opposite within rounding, in exact numbers: collide/narrowphase/exact/opposite_halfspaces.py says the same
   in Python's fractions.

   Only exactly opposite ones can miss each other: the slightest tilt lets them meet, however far away. */
#include "capi_internal.h"
#include "capi_bigint.h"

#include <string.h>

/* {x : n.x <= offset} in the world, and its frame's origin p. */
struct plane {
    struct bigint n[3], offset, p[3];
};

static struct bigint dot(struct arena *arena, const struct bigint *a, const struct bigint *b)
{
    struct bigint sum = bigint_product(arena, a[0], b[0]);
    sum = bigint_sum(arena, sum, bigint_product(arena, a[1], b[1]));
    return bigint_sum(arena, sum, bigint_product(arena, a[2], b[2]));
}

/* a * b - c * d */
static struct bigint minor(struct arena *arena, struct bigint a, struct bigint b, struct bigint c, struct bigint d)
{
    return bigint_difference(arena, bigint_product(arena, a, b), bigint_product(arena, c, d));
}

static struct plane plane_of(struct arena *arena, const double *params, const double *pose)
{
    struct plane plane;
    struct bigint R[9], cofactors[9], m[3];
    int i, j;
    for (i = 0; i < 9; i++) R[i] = bigint_of(arena, pose[i]);
    for (i = 0; i < 3; i++) {
        m[i] = bigint_of(arena, params[i]);
        plane.p[i] = bigint_of(arena, pose[9 + i]);
    }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            const struct bigint *one = R + 3 * ((i + 1) % 3), *other = R + 3 * ((i + 2) % 3);
            int k = (j + 1) % 3, l = (j + 2) % 3;
            cofactors[3 * i + j] = minor(arena, one[k], other[l], one[l], other[k]);
        }
    for (i = 0; i < 3; i++) plane.n[i] = dot(arena, cofactors + 3 * i, m);
    plane.offset = bigint_product(arena, bigint_of(arena, params[3]), dot(arena, R, cofactors));
    plane.offset = bigint_sum(arena, plane.offset, dot(arena, plane.n, plane.p));
    return plane;
}

static int are_parallel(struct arena *arena, const struct bigint *n, const struct bigint *m)
{
    int i;
    for (i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        if (minor(arena, n[j], m[k], n[k], m[j]).sign != 0) return 0;
    }
    return 1;
}

/* m = -c n: B is {x : n.x >= -b / c}, so the gap is (-b / c - a) / |n|, where c = -n.m / n.n. */
static void write_gap(struct arena *arena, const struct plane *A, const struct plane *B, collide_pair *row)
{
    struct bigint square = dot(arena, A->n, A->n), along = dot(arena, A->n, B->n), behind, numerator;
    double length = sqrt(bigint_rounded(arena, square)), slack;
    int i;
    numerator = minor(arena, B->offset, square, A->offset, along);
    row->hit = numerator.sign == 0 || numerator.sign != along.sign;
    row->distance = bigint_ratio(arena, numerator, along) / length;
    slack = 4 * 1.1102230246251565e-16 * fabs(row->distance);
    row->lower = row->distance - slack;
    row->upper = row->distance + slack;
    behind = bigint_difference(arena, dot(arena, A->n, A->p), A->offset);
    for (i = 0; i < 3; i++) {
        row->normal[i] = bigint_rounded(arena, A->n[i]) / length;
        row->point_a[i] = bigint_ratio(arena, minor(arena, A->p[i], square, behind, A->n[i]), square);
        row->point_b[i] = row->point_a[i] + row->distance * row->normal[i];
    }
}

static void flip(collide_pair *row)
{
    int i;
    for (i = 0; i < 3; i++) {
        double point = row->point_a[i];
        row->point_a[i] = row->point_b[i];
        row->point_b[i] = point;
        row->normal[i] = 0.0 - row->normal[i];
    }
}

collide_status settle_halfspaces(const collide_shape *A, const double *pose_a, const collide_shape *B, const double *pose_b,
                                 collide_pair *row, void *workspace)
{
    struct arena arena;
    struct plane one, other;
    int order = memcmp(A->content, B->content, sizeof A->content), exchanged;
    /* Worked out on the same numbers whichever way the pair is asked. */
    exchanged = order > 0 || (order == 0 && memcmp(pose_a, pose_b, POSE * sizeof *pose_a) > 0);
    if (exchanged) {
        const collide_shape *shape = A;
        const double *pose = pose_a;
        A = B;
        B = shape;
        pose_a = pose_b;
        pose_b = pose;
    }
    arena_begin(&arena, workspace, HALFSPACES_BYTES);
    one = plane_of(&arena, A->numbers + PARAMS, pose_a);
    other = plane_of(&arena, B->numbers + PARAMS, pose_b);
    row->how = COLLIDE_HOW_EXACT_ARITHMETIC;
    row->certified = row->hit = row->exact = 1;
    /* Tilted ones meet, and the overlap has no end: as the kernel left it. */
    if (are_parallel(&arena, one.n, other.n) && dot(&arena, one.n, other.n).sign != 0) write_gap(&arena, &one, &other, row);
    if (exchanged) flip(row);
    return arena.failed ? COLLIDE_NO_MEMORY : COLLIDE_OK;
}
