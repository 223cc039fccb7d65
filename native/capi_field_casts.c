/* Casts of a convex shape onto a field: the items on its way, the first of them first, as unions, as collide/casts/field_casts.py asks
   about them. What casts of unions leave to Python is said to be unsupported. */
#include "capi_casts.h"
#include "capi_compound.h"
#include "capi_field.h"

/* Items asked about to begin with, and so many times more each time. */
enum { FIRST_ASKED = 16, GROWTH = 4 };
/* What lengths grow by at most under matrices that are taken for rotations (collide/lowering/closed_regions.py). */
static const double STRETCH = 1.0 + 4.0 * 1e-4;

/* A cast of the shape onto some items. */
static collide_status cast_onto_items(collide_workspace *space, const collide_compound *body, const collide_compound *items,
                                      const double *X_WS, const double *X_WF, const double vector[3], double limit, unsigned flags,
                                      collide_first_contact *first, int *is_proven)
{
    collide_status status = collide_compound_cast(space, body, items, X_WS, X_WF, vector, limit, flags, first);
    /* casts of unions answer what is proven, those of two convex shapes say whether it is */
    *is_proven = status == COLLIDE_OK && first->hit && (!items->is_whole || space->cast->marks[IS_PROVEN]);
    return status;
}

/* More and more of the items ahead, until what is met is proven to be met before the next. */
static collide_status cast_in_order(collide_workspace *space, const collide_compound *body, const collide_field *field, const double *X_WS,
                                    const double *X_WF, const double vector[3], double limit, unsigned flags,
                                    const struct item_ahead *ahead, int64_t n, struct arena *arena, collide_first_contact *first,
                                    int *is_proven)
{
    collide_status status = COLLIDE_OK;
    int64_t some, k, *items = arena_take(arena, (size_t)n * sizeof *items);
    if (items == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < n; k++) items[k] = ahead[k].item;
    for (some = FIRST_ASKED; status == COLLIDE_OK && n > 0; some *= GROWTH) {
        struct item_union made = {NULL, 0, NULL};
        if (some > n) some = n;
        status = shapes_of_items(field, items, some, arena, &made);
        if (status == COLLIDE_OK) status = join_items(&made, arena);
        if (status == COLLIDE_OK)
            status = cast_onto_items(space, body, made.body, X_WS, X_WF, vector, limit, flags, first, is_proven);
        free_union(&made);
        if (status != COLLIDE_OK || some == n || (*is_proven && first->upper < ahead[some].time)) break;
    }
    if (status == COLLIDE_OK && first->hit) first->part_b = (int32_t)number_of_item(field, items[first->part_b]);
    return status;
}

collide_status cast_onto_field(collide_workspace *space, const collide_shape *shape, const collide_field *field, const double *X_WS,
                               const double *X_WF, const double vector[3], double limit, unsigned flags, collide_first_contact *first,
                               int *is_proven)
{
    const double place[3] = {X_WS[3], X_WS[7], X_WS[11]};
    double reach = STRETCH * (shape->numbers[REACH] + shape->numbers[SLOP]) + shape->numbers[RADIUS];
    struct item_ahead *ahead;
    collide_compound *body;
    collide_status status;
    struct arena arena;
    int64_t n;
    *is_proven = 0;
    begin_contact(first);
    if (cast_space_of(space) == NULL) return COLLIDE_NO_MEMORY;
    if ((status = union_of_shape(shape, &body)) != COLLIDE_OK) return status;
    arena_begin(&arena);
    ahead = items_on_way(space, field, X_WF, place, vector, limit, reach, 0, &arena, &n);
    status = ahead == NULL ? COLLIDE_NO_MEMORY
                           : cast_in_order(space, body, field, X_WS, X_WF, vector, limit, flags, ahead, n, &arena, first, is_proven);
    arena_end(&arena);
    collide_compound_free(body);
    if (status != COLLIDE_OK) begin_contact(first);
    return status;
}

collide_status collide_field_cast(collide_workspace *workspace, const collide_shape *shape, const collide_field *field,
                                  const double X_WS[16], const double X_WF[16], const double direction[3], double max_distance,
                                  unsigned flags, collide_first_contact *first)
{
    struct field_pair pair = {workspace, field, shape, X_WF, X_WS, flags};
    collide_status status = COLLIDE_INVALID_ARGUMENT;
    double vector[3];
    int64_t exponent;
    rounding given;
    int is_proven;
    if (first == NULL) return COLLIDE_INVALID_ARGUMENT;
    begin_contact(first);
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(field, FIELD_WORD) || !IS_HANDLE(shape, SHAPE_WORD) || X_WF == NULL || X_WS == NULL ||
        direction == NULL || !(max_distance >= 0.0) || (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (shape->ints[KIND] == HALFSPACE) return COLLIDE_UNSUPPORTED;
    given = round_as_kernels_do();
    if (!are_poses(&pair)) status = COLLIDE_INVALID_POSE;
    else if (take_direction(workspace, direction, vector, &exponent)) {
        status = cast_onto_field(workspace, shape, field, X_WS, X_WF, vector, ldexp(max_distance, (int)exponent), flags, first, &is_proven);
        first->distance = ldexp(first->distance, (int)-exponent);
        first->lower = ldexp(first->lower, (int)-exponent);
        first->upper = ldexp(first->upper, (int)-exponent);
    }
    round_as_before(given);
    return status;
}
