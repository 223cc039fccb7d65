/* Between the files of meshes: collide/mesh, collide/mesh and collide/lowering/facet_bodies.py in C. */
#ifndef COLLIDE_CAPI_MESH_H
#define COLLIDE_CAPI_MESH_H

#include "capi_arena.h"
#include "capi_internal.h"

struct facet_topology;

/* Facets under a box-tree, the points of which one lies in every part, and a ball swept over all. */
struct collide_mesh {
    int64_t word;
    int64_t tree[10];   /* the tree's header */
    double numbers[7];  /* the tree's numbers */
    int64_t content[2]; /* digest of the facets */
    double radius, reach;   /* reach : of the facets from the tree's centre */
    double low[3], high[3]; /* a box around its vertices */
    double *points;
    int32_t *corners; /* three a facet: numbers of vertices, equal for equal ones */
    collide_shape *volatile hull;             /* NULL until half-spaces are asked about (capi_mesh_shapes.c) */
    struct facet_topology *volatile topology; /* NULL until contacts are asked for (capi_mesh_contacts.c) */
    int64_t n_points, depth;
    int solid, given; /* given : as facets, not as a convex shape */
    void *held;       /* nodes, triangles, ids, slabs */
};

/* capi_field_pairs.c: how the facets of a mesh and a curved shape stand, by a walk down the facets' tree: a boolean, or the row of
   what is apart, or without depths meets (collide/narrowphase/facets/nearest_item_kernel.py). */
enum { LONG_WAY = -1, MAYBE_INSIDE, APART, MEETS };
int64_t ask_facets(collide_workspace *space, const collide_mesh *mesh, const collide_shape *shape, const double *X_WM,
                   const double *X_WS, int boolean, int depths, collide_pair *row);
/* The header of such a walk; NULL of a tree too deep for it. */
const int64_t *facet_walk(collide_workspace *space, const collide_mesh *mesh, const collide_shape *shape);

/* capi_curved_contacts.c */
void free_curved_contacts(struct curved_contact_space *space);

/* capi_mesh_contacts.c */
void free_topology(struct facet_topology *topology);
/* Words of a topology (collide/contact/contact_facets.py); corners have the numbers of vertices, some of which no facet may have. */
enum { T_CORNERS_AT, T_PLACES_AT, T_FANS_AT, T_FAN_STARTS_AT, T_EDGES_AT, T_N_CORNERS, T_IS_CONVEX, TOPOLOGY };
/* Which facets share corners and edges, made by the thread that asks first. */
collide_status topology_of(const struct collide_kernels *kernels, const collide_mesh *mesh, const int64_t **words);
/* How far a body reaches from its origin, rounded upwards: contacts near the margin are left to Python, by this. */
double reach_from_origin(const collide_mesh *mesh);

/* capi_mesh_pairs.c: what the kernels of two meshes read first, with the pair taken, and why a kernel left it to Python. */
enum { MESH_HEADER = 24, IS_EXCHANGED = 12 };
const int64_t *mesh_pair_header(collide_workspace *space, const collide_mesh *A, const collide_mesh *B);
collide_status why_mesh_pair(collide_workspace *space, const double *X_WA, const double *X_WB, unsigned flags);
collide_status check_mesh_pair(const collide_workspace *space, const collide_mesh *A, const collide_mesh *B, const double *X_WA,
                               const double *X_WB, unsigned flags);

/* The surface of a polytope, made by the thread that asks first, and kept with it. */
collide_status surface_of(const collide_shape *shape, const collide_mesh **mesh);

/* capi_mesh_pairs.c: the facets that one ray may meet first (collide/narrowphase/facets/ray_surface.py), as many as there is room
   for; 0, or 1 where there are more, or 2 where the matrix is singular. */
int64_t facets_on_ray(collide_workspace *space, const collide_mesh *mesh, const double *X, const double *ray, double *hits,
                      int64_t capacity, int64_t *count);

#endif
