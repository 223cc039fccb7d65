/* Between the files of meshes: collide/mesh, collide/mesh and collide/lowering/facet_bodies.py in C. */
#ifndef COLLIDE_CAPI_MESH_H
#define COLLIDE_CAPI_MESH_H

#include "capi_arena.h"
#include "capi_internal.h"

/* Facets under a box-tree, the points of which one lies in every part, and a ball swept over all. */
struct collide_mesh {
    int64_t tree[10];   /* the tree's header */
    double numbers[7];  /* the tree's numbers */
    int64_t content[2]; /* digest of the facets */
    double radius, reach; /* reach : of the facets from the tree's centre */
    double *points;
    int64_t n_points, depth;
    int solid, given; /* given : as facets, not as a convex shape */
    void *held;       /* nodes, triangles, ids, slabs */
};

/* The surface of a polytope, made by the thread that asks first, and kept with it. */
collide_status surface_of(const collide_shape *shape, const collide_mesh **mesh);

/* capi_mesh_pairs.c: the facets that one ray may meet first (collide/narrowphase/facets/ray_surface.py), as many as there is room
   for; 0, or 1 where there are more, or 2 where the matrix is singular. */
int64_t facets_on_ray(collide_workspace *space, const collide_mesh *mesh, const double *X, const double *ray, double *hits,
                      int64_t capacity, int64_t *count);

#endif
