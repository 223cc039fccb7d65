/* Between the files of fields: balls of a point cloud and cells of a grid under a tree, as collide/fields has them. */
#ifndef COLLIDE_CAPI_FIELD_H
#define COLLIDE_CAPI_FIELD_H

#include "capi_arena.h"
#include "capi_box_tree.h"
#include "capi_internal.h"

/* What items are (collide/narrowphase/facets/item_questions.py). */
enum { FACETS, BALLS, CELLS };

/* A tree's header and numbers behind those of a box-tree (collide/fields/cell_tree_kernel.py). */
enum {
    BITS_AT = TREE_INTS, SOLID_AT, FIRST_AT, N_INNER, N_ALL, LEVELS, CELLS_ALONG, LEAST = CELLS_ALONG + 3, FIELD_INTS = LEAST + 3
};
enum { ORIGIN = TREE_NUMBERS, SIDES = ORIGIN + 3, FIELD_NUMBERS = SIDES + 3 };

/* Words of a walk's stack down a tree of points: two for each of 8 boxes on 17 levels. */
enum { POINT_STACK = 2 * 8 * 17 };

struct collide_field {
    int64_t word;
    int64_t tree[FIELD_INTS];
    double numbers[FIELD_NUMBERS];
    int64_t are;            /* BALLS or CELLS */
    double low[3], high[3]; /* a box around all items */
    double reach;           /* of the items from the origin of their frame */
    double radius;          /* the largest of the balls' */
    double *radii;          /* of each ball, or NULL where all are of one size */
    void *held;             /* nodes, points and floats, or words of nodes */
};

/* capi_field.c: numbers of a tree around low and high [m], and how far its items reach. */
void measure_field(collide_field *field, const double low[3], const double high[3], double radius);

/* A field and a shape at a pair of poses; flags as of `collide_distance`. */
struct field_pair {
    collide_workspace *space;
    const collide_field *field;
    const collide_shape *shape;
    const double *X_WF, *X_WS;
    unsigned flags;
};

/* capi_field_items.c: what a walk leaves open, by the items nearby: whether the shape meets any; and the row of the pair where a
   single item is near, else COLLIDE_UNSUPPORTED. */
collide_status items_meet(const struct field_pair *pair, uint8_t *hit);
collide_status row_of_item(const struct field_pair *pair, collide_pair *row);

#endif
