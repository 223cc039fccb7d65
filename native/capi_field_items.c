/* What walks leave open: the items near a shape, asked as convex shapes of their own, as collide/narrowphase/fields/field_items.py
   lists them and `_union_row` of field_pairs.py asks. */
#include "capi_field.h"

#include <stdlib.h>

/* What rounding of a box's sides is, as a part of the numbers met (2^-40); heights over a plane that are looked at again
   (2^-36). */
static const double ROUNDING = 9.094947017729282e-13, LEVEL = 1.4551915228366852e-11;
/* Matrices no farther off rotations are rounded rotations; farther off (2^-10) they are inverted. */
static const double ROTATION = 1e-13, FAR_OFF = 0.0009765625;

void turn_back(const double *X, const double v[3], double out[3])
{
    int k;
    for (k = 0; k < 3; k++) out[k] = X[k] * v[0] + X[4 + k] * v[1] + X[8 + k] * v[2];
}

double off_rotation(const double *X)
{
    double off = 0.0, column[3], turned[3];
    int i, j;
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) column[j] = X[4 * j + i];
        turn_back(X, column, turned);
        turned[i] -= 1.0;
        for (j = 0; j < 3; j++) off = fabs(turned[j]) > off ? fabs(turned[j]) : off;
    }
    return off;
}

double shift_of(const double *X) { return fabs(X[3]) + fabs(X[7]) + fabs(X[11]); }

/* A box in a field's frame; lengths there are at most `stretch` times as long as in the world. */
struct seen_box {
    double low[3], high[3], stretch;
};

static double length_of(const double *rows, int step)
{
    double square = 0.0;
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) square += rows[step * i + j] * rows[step * i + j];
    return sqrt(square);
}

void invert_rotation(const double *X, double off, double inverse[9])
{
    double determinant;
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
            inverse[3 * i + j] = off > FAR_OFF ? X[4 * c + a] * X[4 * d + b] - X[4 * c + b] * X[4 * d + a] : X[4 * j + i];
        }
    if (!(off > FAR_OFF)) return;
    determinant = X[0] * inverse[0] + X[1] * inverse[3] + X[2] * inverse[6];
    for (i = 0; i < 9; i++) inverse[i] /= determinant;
}

/* The box around the shape: box_in_frame of field_items.py, where the bounds of what rounds are derived. */
static struct seen_box box_around(const struct field_pair *pair)
{
    const double *F = pair->X_WF, *S = pair->X_WS;
    double pose[POSE] = {0.0}, box[6], inverse[9], column[3], least = 0.0, largest = 0.0, slack, wider;
    double off = off_rotation(F), condition = 1.0;
    struct seen_box seen;
    int64_t first = 0;
    int i, j, k;
    invert_rotation(F, off, inverse);
    seen.stretch = off < ROTATION ? 1.0 : 1.0 + 2.0 * off;
    if (off > FAR_OFF) {
        seen.stretch = length_of(inverse, 3);
        condition = seen.stretch * length_of(F, 4);
    }
    for (j = 0; j < 4; j++) {
        for (k = 0; k < 3; k++) column[k] = j < 3 ? S[4 * k + j] : S[4 * k + 3] - F[4 * k + 3];
        for (k = 0; k < 3; k++)
            for (i = 0; i < 3; i++) pose[j < 3 ? 3 * k + j : 9 + k] += inverse[3 * k + i] * column[i];
    }
    pair->space->kernels->bounding_boxes(address_of(pair->shape->ints), address_of(pair->shape->numbers), address_of(pose),
                                         address_of(&first), 1, address_of(box));
    for (k = 0; k < 3; k++) {
        least = fabs(box[k]) > least ? fabs(box[k]) : least;
        largest = fabs(box[3 + k]) > largest ? fabs(box[3 + k]) : largest;
    }
    slack = ROUNDING * condition + 8.0 * ((off > FAR_OFF ? 0.0 : off) + off_rotation(S));
    slack *= least + largest + seen.stretch * (shift_of(F) + shift_of(S));
    wider = slack + pair->shape->numbers[RADIUS] * (seen.stretch - 1.0);
    for (k = 0; k < 3; k++) {
        seen.low[k] = box[k] - wider;
        seen.high[k] = box[3 + k] + wider;
    }
    return seen;
}

/* --- listings --------------------------------------------------------------------------------------------------------- */

/* The balls that may come within a distance of what is in a box. */
static struct listing balls_within(const struct field_pair *pair, struct arena *arena, const struct seen_box *box, double distance)
{
    const collide_field *field = pair->field;
    const double *points = (const double *)(intptr_t)field->tree[TRIANGLES_AT];
    struct listing some = {NULL, 0};
    int64_t stack[POINT_STACK], tree_at = address_of(field->tree), n, k;
    double from[3], to[3], stretch = box->stretch * (1.0 + ROUNDING), reach = stretch * (distance + field->radius);
    int i;
    for (i = 0; i < 3; i++) {
        from[i] = box->low[i] - reach;
        to[i] = box->high[i] + reach;
    }
    n = pair->space->kernels->points_in_box(tree_at, address_of(from), address_of(to), 0, 0, address_of(stack));
    if ((some.numbers = arena_take(arena, (size_t)n * sizeof *some.numbers)) == NULL) return some;
    pair->space->kernels->points_in_box(tree_at, address_of(from), address_of(to), address_of(some.numbers), n, address_of(stack));
    for (k = 0; k < n; k++) {
        int64_t number = some.numbers[k];
        const double *p = points + 3 * number;
        double own = stretch * ((field->radii == NULL ? field->radius : field->radii[number]) + distance);
        int near = 1;
        for (i = 0; i < 3; i++) near &= p[i] >= box->low[i] - own && p[i] <= box->high[i] + own;
        if (near) some.numbers[some.n++] = number;
    }
    return some;
}

/* The same of cells, as words: those that the box may reach, a cell more on every side for what rounds. */
static struct listing cells_within(const struct field_pair *pair, struct arena *arena, const struct seen_box *box, double distance)
{
    const collide_field *field = pair->field;
    struct listing some = {NULL, 0};
    int64_t *stack, range[6], tree_at = address_of(field->tree);
    double reach = distance * box->stretch * (1.0 + ROUNDING);
    int k;
    for (k = 0; k < 3; k++) {
        double origin = field->numbers[ORIGIN + k], side = field->numbers[SIDES + k], most = (double)field->tree[CELLS_ALONG + k];
        double first = (box->low[k] - reach - origin) / side, last = (box->high[k] + reach - origin) / side;
        first = first > -2.0 ? first < most + 2.0 ? first : most + 2.0 : -2.0;
        last = last > -2.0 ? last < most + 2.0 ? last : most + 2.0 : -2.0;
        range[k] = first < 1.0 ? 0 : (int64_t)floor(first) - 1;
        range[3 + k] = last + 1.0 > most - 1.0 ? field->tree[CELLS_ALONG + k] - 1 : (int64_t)floor(last) + 1;
    }
    if ((stack = cell_stack(pair->space, arena)) == NULL) return some;
    some.n = pair->space->kernels->cells_in_range(tree_at, address_of(range), address_of(range + 3), 0, 0, address_of(stack));
    if ((some.numbers = arena_take(arena, (size_t)some.n * sizeof *some.numbers)) == NULL) some.n = 0;
    pair->space->kernels->cells_in_range(tree_at, address_of(range), address_of(range + 3), address_of(some.numbers), some.n,
                                         address_of(stack));
    return some;
}

/* The half-space's normal in the field's frame, of length 1: the lowest items along it alone say how near it is. Returns how much
   higher others may be that rounding cannot tell from these. */
static double normal_of(const struct field_pair *pair, double n[3])
{
    const double *own = pair->shape->numbers + PARAMS, *S = pair->X_WS;
    double world[3], length;
    int k;
    for (k = 0; k < 3; k++) world[k] = S[4 * k] * own[0] + S[4 * k + 1] * own[1] + S[4 * k + 2] * own[2];
    length = sqrt(world[0] * world[0] + world[1] * world[1] + world[2] * world[2]);
    for (k = 0; k < 3; k++) world[k] /= length;
    turn_back(pair->X_WF, world, n);
    return LEVEL * (reach_of_items(pair->field) + shift_of(pair->X_WF) + shift_of(S));
}

/* Of listed items with heights those no higher than the lowest and a slack. */
static void keep_lowest(struct listing *some, const double *heights, double slack)
{
    double lowest = INFINITE;
    int64_t k, n = some->n;
    for (k = 0; k < n; k++) lowest = heights[k] < lowest ? heights[k] : lowest;
    for (some->n = k = 0; k < n; k++)
        if (heights[k] <= lowest + slack) some->numbers[some->n++] = some->numbers[k];
}

static struct listing lowest_balls(const struct field_pair *pair, struct arena *arena, const double n[3], double slack)
{
    const collide_field *field = pair->field;
    const double *points = (const double *)(intptr_t)field->tree[TRIANGLES_AT];
    struct listing some = {NULL, 0};
    double *heights = arena_take(arena, (size_t)field->tree[N_FACETS] * sizeof *heights);
    int64_t k;
    if ((some.numbers = arena_take(arena, (size_t)field->tree[N_FACETS] * sizeof *some.numbers)) == NULL) return some;
    for (k = 0; k < field->tree[N_FACETS]; k++) {
        const double *p = points + 3 * k;
        heights[k] = p[0] * n[0] + p[1] * n[1] + p[2] * n[2] - (field->radii == NULL ? field->radius : field->radii[k]);
        some.numbers[k] = k;
    }
    some.n = field->tree[N_FACETS];
    keep_lowest(&some, heights, slack);
    return some;
}

static struct listing lowest_cells(const struct field_pair *pair, struct arena *arena, const double n[3], double slack)
{
    const struct collide_kernels *kernels = pair->space->kernels;
    struct listing some = {NULL, 0};
    double *heights;
    int64_t *stack, tree_at = address_of(pair->field->tree);
    if ((stack = cell_stack(pair->space, arena)) == NULL) return some;
    some.n = kernels->lowest_cells(tree_at, address_of(n), slack, 0, 0, 0, address_of(stack));
    heights = arena_take(arena, (size_t)some.n * sizeof *heights);
    if ((some.numbers = arena_take(arena, (size_t)some.n * sizeof *some.numbers)) == NULL) {
        some.n = 0;
        return some;
    }
    kernels->lowest_cells(tree_at, address_of(n), slack, address_of(some.numbers), address_of(heights), some.n, address_of(stack));
    keep_lowest(&some, heights, slack);
    return some;
}

/* The items that are higher along a normal than the lowest by no more than a slack. */
static struct listing lowest_items(const struct field_pair *pair, struct arena *arena, const double n[3], double slack)
{
    return pair->field->are == BALLS ? lowest_balls(pair, arena, n, slack) : lowest_cells(pair, arena, n, slack);
}

/* The items near what is in a box. */
static struct listing items_around(const struct field_pair *pair, struct arena *arena, double distance)
{
    struct seen_box box = box_around(pair);
    return pair->field->are == BALLS ? balls_within(pair, arena, &box, distance) : cells_within(pair, arena, &box, distance);
}

/* The items that may come within a distance of the shape; of a half-space the lowest ones over it. */
static struct listing items_within(const struct field_pair *pair, struct arena *arena, double distance)
{
    double n[3], slack;
    if (pair->shape->ints[KIND] != HALFSPACE) return items_around(pair, arena, distance);
    slack = normal_of(pair, n);
    return lowest_items(pair, arena, n, slack);
}

/* How low an item is along a normal. */
static double least_height(const collide_field *field, int64_t item, const double n[3])
{
    const double *p = (const double *)(intptr_t)field->tree[TRIANGLES_AT] + 3 * item;
    double height = 0.0;
    int k;
    if (field->are == BALLS)
        return p[0] * n[0] + p[1] * n[1] + p[2] * n[2] - (field->radii == NULL ? field->radius : field->radii[item]);
    for (k = 0; k < 3; k++) {
        double low = (double)axis_of(item, k) * field->numbers[SIDES + k] + field->numbers[ORIGIN + k];
        double high = (double)(axis_of(item, k) + 1) * field->numbers[SIDES + k] + field->numbers[ORIGIN + k];
        height += n[k] * low < n[k] * high ? n[k] * low : n[k] * high;
    }
    return height;
}

/* The items that reach below a half-space's plane, moved outwards by a distance and what rounds: of the numbers met, 2^-40, and what
   the matrices are off rotations. */
static struct listing items_below(const struct field_pair *pair, struct arena *arena, double distance)
{
    static const struct listing none = {NULL, 0};
    const double *F = pair->X_WF, *S = pair->X_WS, *own = pair->shape->numbers + PARAMS;
    double away[3] = {S[3] - F[3], S[7] - F[7], S[11] - F[11]}, there[3], n[3], height, size, least;
    struct listing lowest;
    (void)normal_of(pair, n);
    turn_back(F, away, there);
    height = own[3] / sqrt(own[0] * own[0] + own[1] * own[1] + own[2] * own[2]) + n[0] * there[0] + n[1] * there[1] + n[2] * there[2];
    size = reach_of_items(pair->field) + fabs(height) + shift_of(F) + shift_of(S) + distance;
    height += distance * (1.0 + ROUNDING) + (ROUNDING + 8.0 * (off_rotation(F) + off_rotation(S))) * size;
    lowest = lowest_items(pair, arena, n, 0.0);
    if (arena->failed || lowest.n == 0) return none;
    least = least_height(pair->field, lowest.numbers[0], n);
    return least <= height ? lowest_items(pair, arena, n, height - least) : none;
}

static int by_number(const void *one, const void *other)
{
    int64_t a = *(const int64_t *)one, b = *(const int64_t *)other;
    return (a > b) - (a < b);
}

struct listing items_near(const struct field_pair *pair, struct arena *arena, double distance)
{
    int is_halfspace = pair->shape->ints[KIND] == HALFSPACE;
    struct listing some = is_halfspace ? items_below(pair, arena, distance) : items_around(pair, arena, distance);
    if (!arena->failed && some.n > 0) qsort(some.numbers, (size_t)some.n, sizeof *some.numbers, by_number);
    return some;
}

/* --- items as shapes -------------------------------------------------------------------------------------------------- */

/* The row of an item, whose shape was made, or why there is none, and the pair's shape. */
static collide_status row_of_shape(const struct field_pair *pair, collide_status status, collide_shape *item, unsigned flags,
                                   collide_pair *row)
{
    if (status == COLLIDE_OK)
        status = collide_distance(pair->space, item, pair->shape, pair->X_WF, pair->X_WS, INFINITE, flags, row);
    collide_shape_free(item);
    return status;
}

static collide_status row_of_one(const struct field_pair *pair, int64_t item, unsigned flags, collide_pair *row)
{
    collide_shape *shape;
    collide_status status = shape_of_item(pair->field, item, &shape);
    return row_of_shape(pair, status, shape, flags, row);
}

/* A box of cells, six numbers of `merge_cells` counted from a cell. */
static collide_status row_of_box(const struct field_pair *pair, const int64_t *box, const int64_t first[3], unsigned flags,
                                 collide_pair *row)
{
    const int64_t least[3] = {first[0] + box[0], first[1] + box[1], first[2] + box[2]};
    collide_shape *shape;
    collide_status status = shape_of_cells(pair->field, least, box + 3, &shape);
    return row_of_shape(pair, status, shape, flags, row);
}

int64_t merge_listed(const struct field_pair *pair, struct arena *arena, const struct listing *some, int64_t first[3], int64_t **boxes)
{
    int64_t along[3], k;
    uint8_t *block;
    int axis;
    for (axis = 0; axis < 3; axis++) {
        int64_t last = first[axis] = axis_of(some->numbers[0], axis);
        for (k = 1; k < some->n; k++) {
            int64_t at = axis_of(some->numbers[k], axis);
            first[axis] = at < first[axis] ? at : first[axis];
            last = at > last ? at : last;
        }
        along[axis] = last + 1 - first[axis];
    }
    block = arena_take(arena, (size_t)(along[0] * along[1] * along[2]));
    if ((*boxes = arena_take(arena, 6 * (size_t)some->n * sizeof **boxes)) == NULL) return 0;
    memset(block, 0, (size_t)(along[0] * along[1] * along[2]));
    for (k = 0; k < some->n; k++) {
        int64_t word = some->numbers[k], row = (axis_of(word, 0) - first[0]) * along[1] + axis_of(word, 1) - first[1];
        block[row * along[2] + axis_of(word, 2) - first[2]] = 1;
    }
    return pair->space->kernels->merge_cells(address_of(block), along[0], along[1], along[2], address_of(*boxes));
}

/* Whether the shape meets any of some cells, by boxes of them. */
static collide_status boxes_meet(const struct field_pair *pair, struct arena *arena, const struct listing *some, uint8_t *hit)
{
    collide_status status = COLLIDE_OK;
    int64_t first[3], *boxes, n_boxes, k;
    collide_pair row;
    if (some->n == 0) return COLLIDE_OK;
    n_boxes = merge_listed(pair, arena, some, first, &boxes);
    if (arena->failed) return COLLIDE_NO_MEMORY;
    for (k = 0; k < n_boxes && status == COLLIDE_OK && !*hit; k++) {
        status = row_of_box(pair, boxes + 6 * k, first, pair->flags | COLLIDE_UNSIGNED, &row);
        *hit = row.hit;
    }
    return status;
}

static collide_status balls_meet(const struct field_pair *pair, const struct listing *some, uint8_t *hit)
{
    collide_status status = COLLIDE_OK;
    collide_pair row;
    int64_t k;
    for (k = 0; k < some->n && status == COLLIDE_OK && !*hit; k++) {
        status = row_of_one(pair, some->numbers[k], pair->flags | COLLIDE_UNSIGNED, &row);
        *hit = row.hit;
    }
    return status;
}

collide_status items_meet(const struct field_pair *pair, uint8_t *hit)
{
    struct arena arena;
    struct listing some;
    collide_status status;
    *hit = 0;
    arena_begin(&arena);
    some = items_within(pair, &arena, 0.0);
    if (arena.failed) status = COLLIDE_NO_MEMORY;
    else status = pair->field->are == BALLS ? balls_meet(pair, &some, hit) : boxes_meet(pair, &arena, &some, hit);
    arena_end(&arena);
    return status;
}

/* --- a single item near ----------------------------------------------------------------------------------------------- */

/* The row of a ball by its number, or of a cell by its word, and how results name it. */
static collide_status row_named(const struct field_pair *pair, int64_t item, unsigned flags, collide_pair *row)
{
    collide_status status = row_of_one(pair, item, flags, row);
    int k;
    row->part_a = (int32_t)number_of_item(pair->field, item);
    row->count = 0;
    for (k = 0; k < 4; k++) row->vertices_a[k] = -1;
    return status;
}

/* The row of an item that alone is near: `_union_row` and `_depth`, where the union has one part. */
static collide_status row_of_lone_item(const struct field_pair *pair, struct arena *arena, int64_t item, collide_pair *row)
{
    collide_status status;
    double distance;
    if (pair->shape->ints[KIND] == HALFSPACE) return row_named(pair, item, pair->flags, row);
    status = row_named(pair, item, pair->flags | COLLIDE_UNSIGNED, row);
    if (status != COLLIDE_OK || (row->hit && pair->flags & COLLIDE_UNSIGNED)) return status;
    distance = row->upper;
    if (row->hit) {
        if ((status = row_named(pair, item, pair->flags, row)) != COLLIDE_OK) return status;
        distance = -row->lower > -row->distance ? -row->lower : -row->distance;
        distance = distance > 0.0 ? distance : 0.0;
    }
    return items_within(pair, arena, distance).n == 1 ? COLLIDE_OK : COLLIDE_UNSUPPORTED;
}

collide_status row_of_item(const struct field_pair *pair, collide_pair *row)
{
    collide_status status = COLLIDE_UNSUPPORTED;
    struct arena arena;
    struct listing some;
    arena_begin(&arena);
    some = items_within(pair, &arena, 0.0);
    if (!arena.failed && some.n == 1) status = row_of_lone_item(pair, &arena, some.numbers[0], row);
    if (arena.failed) status = COLLIDE_NO_MEMORY;
    arena_end(&arena);
    return status;
}
