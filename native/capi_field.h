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

/* capi_field_pairs.c: whether both matrices are poses. */
int are_poses(const struct field_pair *pair);

/* Numbers of balls, or words of cells. */
struct listing {
    int64_t *numbers, n;
};

/* capi_field_items.c: what a walk leaves open, by the items nearby: whether the shape meets any; and the row of the pair where a
   single item is near, else COLLIDE_UNSUPPORTED. */
collide_status items_meet(const struct field_pair *pair, uint8_t *hit);
collide_status row_of_item(const struct field_pair *pair, collide_pair *row);
/* All items that may come within a distance of the shape, balls ascending: `items_within` of collide/narrowphase/fields/field_items.py. */
struct listing items_near(const struct field_pair *pair, struct arena *arena, double distance);
/* Fewer boxes with the union of some cells, six numbers each, counted from a cell; how many. 0 where there is no memory. */
int64_t merge_listed(const struct field_pair *pair, struct arena *arena, const struct listing *some, int64_t first[3], int64_t **boxes);
/* The largest entry of R^T R - I, and the sum of a shift's lengths along the axes. */
double off_rotation(const double *X);
double shift_of(const double *X);
/* Products with a pose's rotation, turned back: R^T v, added up in order. */
void turn_back(const double *X, const double v[3], double out[3]);
/* The inverse of a matrix, row by row: the transpose where `off` says that it is near a rotation. */
void invert_rotation(const double *X, double off, double inverse[9]);

/* The index of a cell along an axis, of its word; its number in results. */
static inline int64_t axis_of(int64_t word, int axis) { return word >> (16 * (2 - axis)) & 0xFFFF; }
static inline int64_t number_of_cell(const collide_field *grid, int64_t x, int64_t y, int64_t z)
{
    const int64_t *along = grid->tree + CELLS_ALONG;
    return (x * along[1] + y) * along[2] + z;
}
static inline int64_t number_of_item(const collide_field *field, int64_t item)
{
    return field->are == BALLS ? item : number_of_cell(field, axis_of(item, 0), axis_of(item, 1), axis_of(item, 2));
}

/* capi_field_unions.c: items as convex shapes in the field's frame, and these as one union. */
struct item_union {
    collide_shape **shapes;
    size_t n;
    collide_compound *body; /* NULL until the shapes are joined */
};
/* The shape of a ball, of a cell by its word, or of a box of cells. */
collide_status shape_of_item(const collide_field *field, int64_t item, collide_shape **shape);
collide_status shape_of_cells(const collide_field *grid, const int64_t least[3], const int64_t size[3], collide_shape **shape);
collide_status shapes_of_items(const collide_field *field, const int64_t *items, int64_t n, struct arena *arena, struct item_union *made);
collide_status join_items(struct item_union *made, struct arena *arena);
void free_union(struct item_union *made);
/* A convex shape as a union. */
collide_status union_of_shape(const collide_shape *shape, collide_compound **compound);

/* capi_field_ways.c: items on the way of a ball of radius `extra` from a place of W along a vector, up to a limit of t: by the t at
   which each may be met at the earliest. first : those behind an item met for sure may be left out. NULL where there is no memory. */
struct item_ahead {
    double time;
    int64_t item;
};
struct item_ahead *items_on_way(const collide_workspace *space, const collide_field *field, const double *X_WF, const double origin[3],
                                const double vector[3], double limit, double extra, int first, struct arena *arena, int64_t *n);
/* How far items reach from the origin of their frame along the axes, added up; how far places of W may be off in that frame [m]. */
double reach_of_items(const collide_field *field);
double rounding_of_place(const collide_field *field, const double *X_WF, const double place[3], double extra);
/* Whether a cell, within the grid or not, is occupied. stack : M_CELL_STACK words. */
int is_occupied(const collide_workspace *space, const collide_field *grid, const int64_t cell[3], int64_t *stack);
/* Words of a stack for walks down the trees of cells; NULL where there is no memory. */
int64_t *cell_stack(const collide_workspace *space, struct arena *arena);

/* capi_field_contacts.c: contacts of a pair, poses checked; is_second : the field is the second body of the rows. */
collide_status contacts_of_field(const struct field_pair *pair, int is_second, double margin, size_t max_contacts,
                                 collide_contact *contacts, size_t capacity, size_t *count);

/* capi_field_casts.c: the first contact of a shape, moved along a vector that kernels take, and a field; t in lengths of the vector.
   *is_proven : that a hit is one. */
collide_status cast_onto_field(collide_workspace *space, const collide_shape *shape, const collide_field *field, const double *X_WS,
                               const double *X_WF, const double vector[3], double limit, unsigned flags, collide_first_contact *first,
                               int *is_proven);

#endif
