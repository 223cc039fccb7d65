/* Items of a field as convex shapes, and some of them as one union: `hulls` and `as_union` of collide/narrowphase/fields. */
#include "capi_field.h"

static const double IDENTITY[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

/* Coordinates below 1e-50 m make no hull. */
static collide_status hull_of_item(const double *points, size_t n, double radius, collide_shape **shape)
{
    collide_status status = collide_hull(points, n, radius, shape);
    return status == COLLIDE_INVALID_SHAPE ? COLLIDE_OUT_OF_RANGE : status;
}

collide_status shape_of_cells(const collide_field *grid, const int64_t least[3], const int64_t size[3], collide_shape **shape)
{
    const double *origin = grid->numbers + ORIGIN, *sides = grid->numbers + SIDES;
    double corners[24];
    int k;
    for (k = 0; k < 24; k++) {
        int axis = k % 3;
        int64_t at = least[axis] + (k / 3 >> (2 - axis) & 1 ? size[axis] : 0);
        corners[k] = (double)at * sides[axis] + origin[axis];
    }
    return hull_of_item(corners, 8, 0.0, shape);
}

collide_status shape_of_item(const collide_field *field, int64_t item, collide_shape **shape)
{
    static const int64_t one[3] = {1, 1, 1};
    const double *points = (const double *)(intptr_t)field->tree[TRIANGLES_AT];
    int64_t cell[3] = {axis_of(item, 0), axis_of(item, 1), axis_of(item, 2)};
    if (field->are == BALLS)
        return hull_of_item(points + 3 * item, 1, field->radii == NULL ? field->radius : field->radii[item], shape);
    return shape_of_cells(field, cell, one, shape);
}

collide_status shapes_of_items(const collide_field *field, const int64_t *items, int64_t n, struct arena *arena, struct item_union *made)
{
    collide_status status = COLLIDE_OK;
    made->body = NULL;
    made->n = 0;
    if ((made->shapes = arena_take(arena, (size_t)n * sizeof *made->shapes)) == NULL) return COLLIDE_NO_MEMORY;
    while (made->n < (size_t)n && status == COLLIDE_OK) {
        status = shape_of_item(field, items[made->n], &made->shapes[made->n]);
        if (status == COLLIDE_OK) made->n++;
    }
    return status;
}

collide_status join_items(struct item_union *made, struct arena *arena)
{
    double *poses = arena_take(arena, made->n * sizeof IDENTITY);
    size_t k;
    if (poses == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < made->n; k++) memcpy(poses + 16 * k, IDENTITY, sizeof IDENTITY);
    return collide_compound_create((const collide_shape *const *)made->shapes, poses, made->n, &made->body);
}

void free_union(struct item_union *made)
{
    collide_compound_free(made->body);
    while (made->n > 0) collide_shape_free(made->shapes[--made->n]);
}

collide_status union_of_shape(const collide_shape *shape, collide_compound **compound)
{
    return collide_compound_create(&shape, IDENTITY, 1, compound);
}
