/* The convex hull of points by the kernel of quickhull: collide/hull/exact_hull.py. */
#include "capi_tree.h"

#include <string.h>

/* The facets of a surface, of a flat hull also from the other side. */
static void take_facets(struct hull *hull, struct arena *arena, const int32_t *surface, int64_t n_facets)
{
    int64_t sides = hull->dimension == 2 ? 2 : 1, k;
    hull->n_facets = sides * n_facets;
    hull->facets = arena_take(arena, (size_t)(3 * hull->n_facets + 1) * sizeof *hull->facets);
    if (arena->failed) return;
    memcpy(hull->facets, surface, (size_t)(3 * n_facets) * sizeof *surface);
    for (k = 0; sides == 2 && k < 3 * n_facets; k++) hull->facets[3 * n_facets + k] = surface[k - k % 3 + (2 - k % 3)];
}

static void take_vertices(struct hull *hull, struct arena *arena, const int32_t *marks, int64_t capacity)
{
    int64_t k;
    hull->vertices = arena_take(arena, (size_t)capacity * sizeof *hull->vertices);
    for (k = 0; !arena->failed && k < capacity; k++)
        if (marks[k]) hull->vertices[hull->n_vertices++] = (int32_t)k;
}

struct hull hull_of(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n)
{
    struct hull hull = {-1, NULL, NULL, 0, 0};
    struct arena own;
    int64_t m[MEASURES], capacity, row, work, digits, ids, scaled;
    double *originals, *doubles;
    int64_t *integers;
    int32_t *rows;
    workspace_sizes(kernels, m);
    capacity = n + m[M_APICES];
    arena_begin(&own, NULL, 0);
    originals = arena_take(&own, (size_t)(3 * capacity) * 8);
    doubles = arena_take(&own, (size_t)(3 * capacity + m[M_WORK] + 2 * m[M_PLANE] * capacity) * 8);
    integers = arena_take(&own, (size_t)(m[M_HULL_DIGITS] + m[M_STATE]) * 8);
    rows = arena_take(&own, (size_t)((2 * m[M_FACET] + 16) * capacity) * 4);
    if (own.failed) arena->failed = 1;
    else {
        memcpy(originals, points, (size_t)(3 * n) * 8);
        work = address_of(doubles);
        digits = address_of(integers);
        ids = address_of(rows);
        scaled = work + 8 * m[M_WORK];
        row = 4 * capacity;
        /* In rows of one int32 a point: following, orphans, starting, owner, order, region (2), rim (2), fan, surface (6),
           facets. */
        hull.dimension = kernels->quickhull(
            n, address_of(originals), scaled, work, digits, ids + 16 * row, scaled + 24 * capacity, ids, ids + row, ids + 2 * row,
            ids + 3 * row, ids + 4 * row, ids + 5 * row, ids + 7 * row, ids + 9 * row, ids + 10 * row,
            digits + 8 * m[M_HULL_DIGITS]);
        if (hull.dimension >= 0) {
            take_facets(&hull, arena, rows + 10 * capacity, integers[m[M_HULL_DIGITS]]);
            take_vertices(&hull, arena, rows + 2 * capacity, capacity);
        }
    }
    arena_end(&own);
    return hull;
}
