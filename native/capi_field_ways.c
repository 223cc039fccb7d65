/* Items that a ray or a moved body may meet: `items_on_way` of collide/narrowphase/fields/field_items.py, and the cells around a place. */
#include "capi_field.h"

#include <stdlib.h>

/* What rounding of a place is, as a part of the numbers met (2^-40). */
static const double ROUNDING = 9.094947017729282e-13;
/* Items that the first list holds. */
enum { FIRST_LISTED = 256 };

double reach_of_items(const collide_field *field)
{
    double reach = 0.0;
    int k;
    for (k = 0; k < 3; k++) reach += fabs(field->low[k]) > fabs(field->high[k]) ? fabs(field->low[k]) : fabs(field->high[k]);
    return reach;
}

double rounding_of_place(const collide_field *field, const double *X_WF, const double place[3], double extra)
{
    double size = reach_of_items(field) + shift_of(X_WF) + (fabs(place[0]) + fabs(place[1]) + fabs(place[2])) + extra;
    return (ROUNDING + 8.0 * off_rotation(X_WF)) * size;
}

int64_t *cell_stack(const collide_workspace *space, struct arena *arena)
{
    int64_t m[MEASURES];
    workspace_sizes(space->kernels, m);
    return arena_take(arena, (size_t)m[M_CELL_STACK] * sizeof(int64_t));
}

int is_occupied(const collide_workspace *space, const collide_field *grid, const int64_t cell[3], int64_t *stack)
{
    int k;
    for (k = 0; k < 3; k++) if (cell[k] < 0 || cell[k] >= grid->tree[CELLS_ALONG + k]) return 0;
    return space->kernels->cells_in_range(address_of(grid->tree), address_of(cell), address_of(cell), 0, 0, address_of(stack)) > 0;
}

static int sooner(const void *one, const void *other)
{
    const struct item_ahead *a = one, *b = other;
    if (a->time != b->time) return a->time < b->time ? -1 : 1;
    return (a->item > b->item) - (a->item < b->item);
}

struct item_ahead *items_on_way(const collide_workspace *space, const collide_field *field, const double *X_WF, const double origin[3],
                                const double vector[3], double limit, double extra, int first, struct arena *arena, int64_t *n)
{
    const struct collide_kernels *kernels = space->kernels;
    const double away[3] = {origin[0] - X_WF[3], origin[1] - X_WF[7], origin[2] - X_WF[11]};
    double way[6], slack = rounding_of_place(field, X_WF, origin, extra), *times;
    int64_t capacity = FIRST_LISTED, *items, *stack = cell_stack(space, arena), k; /* a stack of points is no longer */
    struct item_ahead *ahead;
    turn_back(X_WF, away, way);
    turn_back(X_WF, vector, way + 3);
    for (;;) {
        items = arena_take(arena, (size_t)capacity * sizeof *items);
        times = arena_take(arena, (size_t)capacity * sizeof *times);
        if (arena->failed) return NULL;
        if (field->are == BALLS)
            *n = kernels->balls_on_way(address_of(field->tree), address_of(field->radii), field->radius, address_of(way), limit, extra,
                                       slack, (uint8_t)first, address_of(items), address_of(times), capacity, address_of(stack));
        else
            *n = kernels->cells_on_way(address_of(field->tree), address_of(way), extra + slack, limit, (uint8_t)(first && extra == 0.0),
                                       address_of(items), address_of(times), capacity, address_of(stack));
        if (*n <= capacity) break;
        capacity = *n;
    }
    if ((ahead = arena_take(arena, (size_t)*n * sizeof *ahead)) == NULL) return NULL;
    for (k = 0; k < *n; k++) {
        ahead[k].time = times[k];
        ahead[k].item = items[k];
    }
    if (*n > 0) qsort(ahead, (size_t)*n, sizeof *ahead, sooner);
    return ahead;
}
