/* The convex hull of points, by the kernel of quickhull. */
#include "capi_tree.h"

struct hull hull_of(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n)
{
    struct hull hull = {-1, NULL, NULL, 0, 0};
    int64_t m[MEASURES], *memory;
    workspace_sizes(kernels, m);
    if ((memory = arena_take(arena, (size_t)(m[M_HULL_EACH] * n + m[M_HULL_FIXED]))) == NULL) return hull;
    hull.dimension = kernels->quickhull(address_of(points), n, address_of(memory));
    hull.n_facets = memory[0];
    hull.n_vertices = memory[1];
    hull.facets = (int32_t *)(intptr_t)memory[2];
    hull.vertices = (int32_t *)(intptr_t)memory[3];
    return hull;
}
