/* Between libcollide and collide.adapters.hosts.mujoco; no part of the C interface, and it changes with every version.

   Nothing of MuJoCo's is compiled in: where its structures hold what is read here is found out by Python, and handed in. */
#ifndef COLLIDE_HOST_MUJOCO_H
#define COLLIDE_HOST_MUJOCO_H

#include <stdint.h>

#include "export.h"

enum { COLLIDE_MUJOCO_KINDS = 9 }; /* kinds of geoms: MuJoCo's table has a function for every two */

/* Where things stand, in bytes; and how far apart contacts are that a function of the table writes. */
struct collide_mujoco_layout {
    int64_t geom_type, geom_dataid, geom_size, mesh_vert, hfield_size, hfield_data, signature; /* in mjModel */
    int64_t geom_xpos, geom_xmat;                                                              /* in mjData */
    int64_t contact_size;
};

/* A model whose geoms are ours. The arrays belong to the caller, and stay as they are until the model is removed. */
struct collide_mujoco_model {
    const void *model;
    uint64_t signature;
    int64_t n_geoms, is_cull;
    const int64_t *rows;      /* of geoms: rows of the tables, -1 of height fields and of those left to MuJoCo */
    const int32_t *types, *dataids; /* of geoms, as they were */
    const double *sizes;      /* (n_geoms, 3), as they were */
    const double *reaches;    /* of geoms: no point is farther from the origin; of planes 0 */
    const float *vertices;    /* of meshes, as they were */
    const int32_t *vertex_starts, *vertex_counts;
    const int64_t *fields;    /* (n_fields, 3) of height fields: rows, columns, where their heights begin */
    const int64_t *ints;      /* tables: of shapes, */
    const double *numbers;
    const int64_t *faces;     /* and of their faces */
    const double *boxes;      /* around hulls: (rows of the tables, 6), middles and half sides */
    const int64_t *extremes;  /* of large hulls: (rows of the tables, 14) vertices that are farthest along some directions */
    int64_t largest;          /* most corners of a face */
    int64_t face_ints, manifold_header, contact_bytes; /* as Python has them */
    int64_t max_contacts[COLLIDE_MUJOCO_KINDS * COLLIDE_MUJOCO_KINDS]; /* contacts of a pair of kinds */
};

/* Take the place of the functions of `table` where `replaced` is 1; 0, or -1 where it is taken already.
   error : MuJoCo's, which does not return. */
COLLIDE_EXPORT int collide_mujoco_hook(const struct collide_mujoco_layout *layout, void **table, const uint8_t *replaced,
                                       void (*error)(const char *, ...));
/* Put back what was there, but where somebody else has put another function since. */
COLLIDE_EXPORT void collide_mujoco_unhook(void);
/* How many functions of the table are ours. */
COLLIDE_EXPORT int collide_mujoco_hooked(void);

/* Have a model answered; its number, -1 where there are too many, -2 where the layouts of Python and C differ, -3 where there is
   no memory. */
COLLIDE_EXPORT int collide_mujoco_add(const struct collide_mujoco_model *model);
COLLIDE_EXPORT void collide_mujoco_remove(int number);

#endif
