/* Between the files that make support trees: collide/support and collide/hull in C. Room is taken from
   an arena, and whoever makes something looks at its `failed`. */
#ifndef COLLIDE_CAPI_TREE_H
#define COLLIDE_CAPI_TREE_H

#include "capi_arena.h"
#include "capi_internal.h"

/* The hull of points: facets (n_facets, 3) counter-clockwise from outside, of flat ones both sides, and its vertices, in order. */
struct hull {
    int64_t dimension;
    int32_t *facets, *vertices;
    int64_t n_facets, n_vertices;
};

struct hull hull_of(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n);

/* Neighbours of every vertex of a closed surface in cyclic order, and the facets' unit normals.

   starts : (n + 1).   ring, ring_facets : (starts[n]), the neighbour of a place, and the facet between it and the next.
   corner : (n) whether a vertex is extreme in a range of directions.   good : 0 where the surface is not closed. */
struct rings {
    int32_t *starts, *ring, *ring_facets;
    double *normals;
    int64_t n_normals;
    uint8_t *corner;
    int flat, good;
};

/* facets : of at least 3 vertices. */
struct rings rings_of(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n,
                      const int32_t *facets, int64_t n_facets);

/* The n vertices so ordered that the first sizes[k] of them are subset k; sizes fall, sizes[0] is n.

   normals : (n, 3) a direction in which each is extreme.   late : (n) whether it only enters a subset when no others are left. */
void order_nested(struct arena *arena, const int32_t *vertices, const double *normals, const uint8_t *late, int64_t n,
                  const int64_t *sizes, int n_sizes, int32_t *ordered);

#endif
