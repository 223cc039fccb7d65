/* Hulls of points. Room is taken from an arena, and whoever makes something looks at its `failed`. */
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

#endif
