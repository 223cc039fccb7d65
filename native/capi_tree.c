/* Hulls and support trees, by the kernels of collide/hull/quickhull.py and collide/support/grow_tree.py. */
#include "capi_tree.h"

#include <stdlib.h>

/* A hull of fewer vertices is scanned (collide/support/lazy_support_tree.py). */
enum { FEWEST_VERTICES = 32 };

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

/* The tree of a hull in a block of its own; NULL where no order of neighbours is certain, or memory has ended. */
static void *grow(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n,
                  const struct hull *hull)
{
    int64_t capacity = 8 * hull->n_vertices + 4096, outcome, *memory;
    void *block;
    for (;; capacity = outcome) {
        memory = arena_take(arena, (size_t)kernels->tree_memory(n, hull->n_facets, capacity));
        if (memory == NULL) return NULL;
        outcome = kernels->grow_tree(address_of(points), n, address_of(hull->vertices), hull->n_vertices,
                                     address_of(hull->facets), hull->n_facets, address_of(memory), capacity);
        if (outcome <= 0) break;
    }
    if (outcome < 0) return NULL;
    if ((block = malloc((size_t)memory[0])) == NULL) arena->failed = 1;
    else kernels->keep_tree(address_of(points), n, hull->n_facets, address_of(memory), capacity, address_of(block));
    return block;
}

collide_status build_tree(const struct collide_kernels *kernels, const double *points, size_t n, void **tree)
{
    struct arena arena;
    struct hull hull;
    collide_status status;
    arena_begin(&arena);
    hull = hull_of(kernels, &arena, points, (int64_t)n);
    if (!arena.failed && hull.dimension >= 2 && hull.n_vertices >= FEWEST_VERTICES)
        *tree = grow(kernels, &arena, points, (int64_t)n, &hull);
    status = arena.failed ? COLLIDE_NO_MEMORY : COLLIDE_OK;
    arena_end(&arena);
    return status;
}
