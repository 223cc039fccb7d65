/* Contacts of a field and a convex shape: those of the items within the margin as a union, but none at faces between two cells, as
   collide/contact/field_contacts.py has them. What contacts of unions leave to Python is said to be unsupported. */
#include "capi_compound.h"
#include "capi_field.h"

/* Contacts that a call has space for: as many as those of unions. */
enum { MAX_ROWS = 1024 };
/* How far next to a face is looked, in sides of a cell (2^-10). */
static const double NEXT = 0.0009765625;

/* Boxes of cells, or balls, as a union; boxes : six numbers each, counted from the cell `first`; NULL of balls. */
static collide_status union_near(const struct field_pair *pair, struct arena *arena, const struct listing *some, struct item_union *made,
                                 int64_t first[3], int64_t **boxes)
{
    collide_status status = COLLIDE_OK;
    int64_t n, k, least[3];
    int axis;
    *boxes = NULL;
    if (pair->field->are == BALLS) status = shapes_of_items(pair->field, some->numbers, some->n, arena, made);
    else {
        n = merge_listed(pair, arena, some, first, boxes);
        if ((made->shapes = arena_take(arena, (size_t)n * sizeof *made->shapes)) == NULL) return COLLIDE_NO_MEMORY;
        for (k = 0; k < n && status == COLLIDE_OK; k++) {
            for (axis = 0; axis < 3; axis++) least[axis] = (*boxes)[6 * k + axis] += first[axis];
            status = shape_of_cells(pair->field, least, *boxes + 6 * k + 3, &made->shapes[k]);
            if (status == COLLIDE_OK) made->n++;
        }
    }
    return status == COLLIDE_OK ? join_items(made, arena) : status;
}

/* Whether an item and a curved shape touch within rounding: Python decides these in integers, contacts of unions leave them open, and
   those of two convex shapes take either side. */
static int is_left_open(const struct field_pair *pair, const collide_shape *item)
{
    int64_t kind = pair->shape->ints[KIND];
    collide_pair row;
    if (kind == POINTS || kind == HALFSPACE) return 0;
    return collide_distance(pair->space, item, pair->shape, pair->X_WF, pair->X_WS, INFINITE, COLLIDE_TRUST_POSES, &row) != COLLIDE_OK ||
           row.how == COLLIDE_HOW_UNDECIDED;
}

/* Contacts of the union and the shape, parts as the union numbers them. */
static collide_status rows_of_union(const struct field_pair *pair, int is_second, const collide_compound *items, double margin,
                                    size_t max_contacts, collide_contact *rows, size_t *count)
{
    unsigned flags = pair->flags & (unsigned)COLLIDE_TRUST_POSES;
    collide_compound *body;
    collide_status status = union_of_shape(pair->shape, &body);
    if (status != COLLIDE_OK) return status;
    if (is_second)
        status = collide_compound_contacts(pair->space, body, items, pair->X_WS, pair->X_WF, margin, max_contacts, flags, rows, MAX_ROWS, count);
    else
        status = collide_compound_contacts(pair->space, items, body, pair->X_WF, pair->X_WS, margin, max_contacts, flags, rows, MAX_ROWS, count);
    collide_compound_free(body);
    if (status == COLLIDE_OK && items->is_whole && ((*count == MAX_ROWS && max_contacts > MAX_ROWS) || is_left_open(pair, items->shapes[0])))
        status = COLLIDE_UNSUPPORTED;
    return status == COLLIDE_TOO_MANY ? COLLIDE_UNSUPPORTED : status;
}

/* The cell of a box of cells that a place in the grid's frame lies in, or is next to. */
static void cell_of_place(const collide_field *grid, const int64_t *box, const double p[3], int64_t cell[3])
{
    int k;
    for (k = 0; k < 3; k++) {
        double at = floor((p[k] - grid->numbers[ORIGIN + k]) / grid->numbers[SIDES + k]), last = (double)(box[k] + box[3 + k] - 1);
        cell[k] = at > (double)box[k] ? (int64_t)(at < last ? at : last) : box[k];
    }
}

/* Whether what is next to a place along a direction out of the grid is the grid again. */
static int is_hidden(const struct field_pair *pair, const double p[3], const double n[3], int64_t *stack)
{
    const double *sides = pair->field->numbers + SIDES;
    double least = sides[0] < sides[1] ? sides[0] : sides[1], next = NEXT * (least < sides[2] ? least : sides[2]);
    int64_t cell[3];
    int k;
    for (k = 0; k < 3; k++) {
        double at = floor((p[k] + next * n[k] - pair->field->numbers[ORIGIN + k]) / sides[k]), end = (double)pair->field->tree[CELLS_ALONG + k];
        cell[k] = at < 0.0 ? -1 : at < end ? (int64_t)at : (int64_t)end;
    }
    return is_occupied(pair->space, pair->field, cell, stack);
}

/* Give a row the name of its item; whether it is hidden by another cell. */
static int name_row(const struct field_pair *pair, int is_second, const struct listing *some, const int64_t *boxes, int64_t *stack,
                    collide_contact *row)
{
    const double *X = pair->X_WF, *point = is_second ? row->point_b : row->point_a;
    const double away[3] = {point[0] - X[3], point[1] - X[7], point[2] - X[11]};
    double outwards[3], p[3], n[3];
    int32_t *part = is_second ? &row->part_b : &row->part_a;
    int64_t cell[3];
    int k;
    if (boxes == NULL) {
        *part = (int32_t)some->numbers[*part];
        return 0;
    }
    for (k = 0; k < 3; k++) outwards[k] = is_second ? -row->normal[k] : row->normal[k];
    turn_back(X, away, p);
    turn_back(X, outwards, n);
    cell_of_place(pair->field, boxes + 6 * (int64_t)*part, p, cell);
    *part = (int32_t)number_of_cell(pair->field, cell[0], cell[1], cell[2]);
    return is_hidden(pair, p, n, stack);
}

/* Contacts of the items near, named; hidden ones are left out, unless all are. */
static collide_status rows_near(const struct field_pair *pair, int is_second, struct arena *arena, const struct listing *some,
                                double margin, size_t max_contacts, collide_contact *rows, size_t *count)
{
    struct item_union items = {NULL, 0, NULL};
    int64_t first[3], *boxes, *stack = cell_stack(pair->space, arena);
    uint8_t *hidden = arena_take(arena, MAX_ROWS);
    collide_status status = arena->failed ? COLLIDE_NO_MEMORY : union_near(pair, arena, some, &items, first, &boxes);
    size_t n_kept = 0, k;
    if (status == COLLIDE_OK) status = rows_of_union(pair, is_second, items.body, margin, max_contacts, rows, count);
    free_union(&items);
    if (status != COLLIDE_OK) return status;
    for (k = 0; k < *count; k++) hidden[k] = (uint8_t)name_row(pair, is_second, some, boxes, stack, &rows[k]);
    for (k = 0; k < *count; k++) if (!hidden[k]) n_kept++;
    if (n_kept == 0 || n_kept == *count) return COLLIDE_OK;
    for (n_kept = k = 0; k < *count; k++) if (!hidden[k]) rows[n_kept++] = rows[k];
    *count = n_kept;
    return COLLIDE_OK;
}

collide_status contacts_of_field(const struct field_pair *pair, int is_second, double margin, size_t max_contacts,
                                 collide_contact *contacts, size_t capacity, size_t *count)
{
    struct arena arena;
    struct listing some;
    collide_contact *rows;
    collide_status status = COLLIDE_NO_MEMORY;
    rounding given = round_as_kernels_do();
    size_t n = 0;
    arena_begin(&arena);
    some = items_near(pair, &arena, margin);
    rows = arena_take(&arena, MAX_ROWS * sizeof *rows);
    if (!arena.failed) status = some.n == 0 ? COLLIDE_OK : rows_near(pair, is_second, &arena, &some, margin, max_contacts, rows, &n);
    *count = status == COLLIDE_OK ? n : 0;
    if (status == COLLIDE_OK) hand_out_contacts(rows, n, contacts, capacity);
    arena_end(&arena);
    round_as_before(given);
    return status == COLLIDE_OK && n > capacity ? COLLIDE_TOO_MANY : status;
}

collide_status collide_field_contacts(collide_workspace *workspace, const collide_field *field, const collide_shape *shape,
                                      const double X_WF[16], const double X_WS[16], double margin, size_t max_contacts, unsigned flags,
                                      collide_contact *contacts, size_t capacity, size_t *count)
{
    struct field_pair pair = {workspace, field, shape, X_WF, X_WS, flags};
    if (count == NULL) return COLLIDE_INVALID_ARGUMENT;
    *count = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(field, FIELD_WORD) || !IS_HANDLE(shape, SHAPE_WORD) || X_WF == NULL || X_WS == NULL ||
        !(margin >= 0.0 && margin <= LARGEST) || max_contacts == 0 || (contacts == NULL && capacity > 0) ||
        (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (!are_poses(&pair)) return COLLIDE_INVALID_POSE;
    return contacts_of_field(&pair, 0, margin, max_contacts, contacts, capacity, count);
}
