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
    double radius;
    double *points;
    int64_t n_points, depth;
    int solid, given; /* given : as facets, not as a convex shape */
    void *held;       /* nodes, triangles, ids, slabs */
};

#endif
