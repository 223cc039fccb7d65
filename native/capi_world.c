/* Worlds: bodies that are added, moved and removed, and what is said of their pairs; as collide/worlds/bodies.py and scene.py. */
#include "capi_world.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

/* Rows of removed bodies stay until they are more than so many and twice the others (collide/worlds/bodies.py). */
enum { MIN_ROWS = 64 };
/* Rows beyond those of bodies: a point's, and a shape's that takes another one's place. */
enum { SPARE = 2 };

collide_status refuse(char *message, collide_status status, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, MESSAGE, format, arguments);
    va_end(arguments);
    return status;
}

const char *collide_world_message(const collide_world *world) { return IS_HANDLE(world, WORLD_WORD) ? world->message : "the world is NULL, or freed"; }

const char *collide_workspace_message(const collide_workspace *workspace)
{
    return IS_HANDLE(workspace, WORKSPACE_WORD) ? workspace->message : "the workspace is NULL, or freed";
}

/* --- memory --------------------------------------------------------------------------------------------------------- */

int resize(void *place, size_t n, size_t bytes)
{
    void *memory, *old;
    memcpy(&old, place, sizeof old);
    if (n > (size_t)-1 / bytes || (memory = realloc(old, n * bytes)) == NULL) return 0;
    memcpy(place, &memory, sizeof memory);
    return 1;
}

/* Room for so many more bodies, of whatever shapes, and for trees over all of them; 0 where there is no memory, and then
   nothing has changed. */
static int reserve(collide_world *world, size_t more)
{
    struct shape_rows *table = &world->table;
    struct body_tree *tree = &world->tree;
    size_t n = world->n + more, rows;
    if (n <= world->capacity) return 1;
    n += n / 2 < 16 ? 16 : n / 2;
    rows = n + SPARE;
    if (!(resize(&world->ids, rows, sizeof *world->ids) && resize(&world->X_WBs, rows, 16 * sizeof(double)) &&
          resize(&world->poses, rows, POSE * sizeof(double)) && resize(&world->boxes, rows, 6 * sizeof(double)) &&
          resize(&world->widened, rows, 6 * sizeof(double)) &&
          resize(&world->row_of, rows, 8) && resize(&world->traits, rows, 8 * TRAITS) && resize(&world->leaf_of, rows, 8) &&
          resize(&world->changed, rows, 8) && resize(&world->first, rows, 8) && resize(&world->is_whole, rows, 8) &&
          resize(&world->unbounded, rows, 8) && resize(&world->numbers, rows, 8) && resize(&world->is_moved, rows, 1) &&
          resize(&world->is_alive, rows, 1) && resize(&world->wholes, rows, sizeof *world->wholes) &&
          resize(&world->margins, rows, sizeof(double)) && resize(&world->spread, rows, sizeof(double)) &&
          resize(&table->ints, rows, 8 * INTS) &&
          resize(&table->numbers, rows, NUMBERS * sizeof(double)) && resize((void *)&table->shapes, rows, sizeof *table->shapes) &&
          resize(&table->users, rows, sizeof(size_t)) && resize(&table->order, rows, sizeof(size_t)) &&
          resize(&table->unused, rows, sizeof(size_t)) && resize(&tree->nodes, 3 * rows, 6 * sizeof(double)) &&
          resize(&tree->links, 3 * rows, 8 * LINK) &&
          resize(&tree->scratch, 2 * rows + 34 + (size_t)world->measures[W_STACK], 8)))
        return 0;
    for (; world->capacity < n; world->capacity++) world->first[world->capacity] = (int64_t)world->capacity;
    world->first[n] = (int64_t)n;
    return 1;
}

/* Whether the library's parts fit each other. */
static int begin_world(collide_world *world)
{
    const int64_t *m = world->measures;
    if (world->kernels->write_world_constants(address_of(world->measures), WORLD_MEASURES) != WORLD_MEASURES) return 0;
    return m[W_TREE] == TREE_HEADER && m[W_LINK] == LINK && m[W_TRAITS] == TRAITS && m[W_SINGLE_PARTS] == SINGLE_PARTS &&
           m[W_ROW_OF_A_KEY] == ROW_OF_A_KEY && m[W_SWEEP] == SWEEP && m[W_RAY] == RAY && m[W_RAY_TREE] == RAY_TREE &&
           m[W_HIT_ROW] == (int64_t)sizeof(collide_world_hit);
}

collide_status collide_world_create(collide_world **world)
{
    static const double origin[3] = {0.0, 0.0, 0.0};
    const struct collide_kernels *kernels = kernels_here();
    collide_world *made;
    collide_status status;
    if (world == NULL) return COLLIDE_INVALID_ARGUMENT;
    *world = NULL;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = WORLD_WORD;
    made->kernels = kernels;
    status = begin_world(made) ? collide_hull(origin, 1, 0.0, &made->point) : COLLIDE_NO_KERNELS;
    if (status == COLLIDE_OK && !(reserve(made, 1) && resize(&made->allowed_rows, 1, 8))) status = COLLIDE_NO_MEMORY;
    if (status != COLLIDE_OK) {
        collide_world_free(made);
        return status;
    }
    take_shape(&made->table, made->point);
    *world = made;
    return COLLIDE_OK;
}

void collide_world_free(collide_world *world)
{
    size_t k;
    if (!IS_HANDLE(world, WORLD_WORD)) return;
    end_handle(&world->word);
    for (k = 0; k < world->n; k++) collide_shape_free(world->wholes[k].bound);
    free(world->wholes);
    free(world->ids);
    free(world->X_WBs);
    free(world->poses);
    free(world->boxes);
    free(world->widened);
    free(world->row_of);
    free(world->traits);
    free(world->leaf_of);
    free(world->changed);
    free(world->first);
    free(world->is_whole);
    free(world->unbounded);
    free(world->numbers);
    free(world->is_moved);
    free(world->is_alive);
    free(world->table.ints);
    free(world->table.numbers);
    free((void *)world->table.shapes);
    free(world->table.users);
    free(world->table.order);
    free(world->table.unused);
    free(world->tree.nodes);
    free(world->tree.links);
    free(world->tree.scratch);
    free(world->allowed_keys);
    free(world->margins);
    free(world->spread);
    free(world->margin_keys);
    free(world->pair_margins);
    free(world->allowed_rows);
    collide_shape_free(world->point);
    free(world);
}

/* --- which body ----------------------------------------------------------------------------------------------------- */

/* The row of a body; -1 where there is none of this id. */
int64_t row_of_id(const collide_world *world, int32_t id)
{
    size_t low = 0, high = world->n;
    if (id >= 0 && (size_t)id < high && world->ids[id] == id) low = high = (size_t)id; /* none before it was ever removed */
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (world->ids[middle] < id) low = middle + 1;
        else high = middle;
    }
    return low < world->n && world->ids[low] == id && world->is_alive[low] ? (int64_t)low : -1;
}

static collide_status unknown_body(collide_world *world, const char *caller, const char *what, size_t k, int32_t id)
{
    return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: %s[%zu]: no body has id %ld; it may have been removed", caller,
                  what, k, (long)id);
}

/* Whether ids are those of bodies. */
collide_status check_ids(collide_world *world, const char *caller, const char *what, const int32_t *ids, size_t n)
{
    size_t k;
    if (n > 0 && ids == NULL) return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: %s is NULL", caller, what);
    for (k = 0; k < n; k++)
        if (row_of_id(world, ids[k]) < 0) return unknown_body(world, caller, what, k, ids[k]);
    return COLLIDE_OK;
}

collide_status check_pairs(collide_world *world, const char *caller, const int32_t *pairs, size_t n)
{
    collide_status status = check_ids(world, caller, "pairs", pairs, 2 * n);
    size_t k;
    for (k = 0; k < n && status == COLLIDE_OK; k++)
        if (pairs[2 * k] == pairs[2 * k + 1])
            status = refuse(world->message, COLLIDE_INVALID_ARGUMENT,
                            "%s: pair %zu is body %ld twice; a body is never tested against itself", caller, k, (long)pairs[2 * k]);
    return status;
}

/* Whether n matrices are poses. ids : of the bodies, or NULL of new ones. */
static collide_status check_poses(collide_world *world, const char *caller, const double *X_WBs, size_t n, const int32_t *ids)
{
    double pose[POSE];
    rounding given = round_as_kernels_do();
    int64_t k = world->kernels->first_bad_pose(address_of(X_WBs), 16, 0, (int64_t)n, 1, address_of(pose));
    round_as_before(given);
    if (k == (int64_t)n) return COLLIDE_OK;
    if (ids == NULL)
        return refuse(world->message, COLLIDE_INVALID_POSE, "%s: X_WB is no pose: finite, a rotation, last row 0 0 0 1", caller);
    return refuse(world->message, COLLIDE_INVALID_POSE,
                  "%s: X_WBs[%ld], of body %ld, is no pose: finite, a rotation, last row 0 0 0 1", caller, (long)k, (long)ids[k]);
}

/* --- pairs never tested --------------------------------------------------------------------------------------------- */

static int compare_keys(const void *one, const void *other)
{
    int64_t a = *(const int64_t *)one, b = *(const int64_t *)other;
    return (a > b) - (a < b);
}

/* Rows of what is allowed, from the keys, for which there is memory. */
static void write_allowed(collide_world *world)
{
    int64_t *row_at = world->numbers;
    size_t body;
    world->n_allowed = (size_t)world->kernels->write_allowed_rows(address_of(world->allowed_keys), (int64_t)world->n_allowed_keys,
                                                                  address_of(row_at), (int64_t)world->n,
                                                                  address_of(world->allowed_rows));
    for (body = 0; body < world->n; body++) world->traits[TRAITS * body + ALLOWED_AT] = row_at[body];
}

/* Sort keys, and keep each once. */
static void settle_keys(collide_world *world)
{
    size_t k, n = 0;
    if (world->n_allowed_keys > 0) qsort(world->allowed_keys, world->n_allowed_keys, sizeof(int64_t), compare_keys);
    for (k = 0; k < world->n_allowed_keys; k++)
        if (n == 0 || world->allowed_keys[k] != world->allowed_keys[n - 1]) world->allowed_keys[n++] = world->allowed_keys[k];
    world->n_allowed_keys = n;
    write_allowed(world);
}

static int reserve_keys(collide_world *world, size_t more)
{
    size_t n = world->n_allowed_keys + more;
    if (n <= world->allowed_capacity) return 1;
    n += n / 2 + 16;
    if (!resize(&world->allowed_keys, n, 8) || !resize(&world->allowed_rows, n, 8 * ROW_OF_A_KEY)) return 0;
    world->allowed_capacity = n;
    return 1;
}

collide_status collide_world_allow(collide_world *world, const int32_t *pairs, size_t n)
{
    static const char caller[] = "collide_world_allow";
    collide_status status;
    size_t k;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((status = check_pairs(world, caller, pairs, n)) != COLLIDE_OK) return status;
    if (!reserve_keys(world, 2 * n)) return refuse(world->message, COLLIDE_NO_MEMORY, "%s: out of memory", caller);
    for (k = 0; k < n; k++) {
        int64_t i = row_of_id(world, pairs[2 * k]), j = row_of_id(world, pairs[2 * k + 1]);
        world->allowed_keys[world->n_allowed_keys++] = i << 32 | j;
        world->allowed_keys[world->n_allowed_keys++] = j << 32 | i;
    }
    settle_keys(world);
    return COLLIDE_OK;
}

/* --- adding and removing -------------------------------------------------------------------------------------------- */

/* Drop the rows of removed bodies: those of the others go forward, in order. */
static void close_gaps(collide_world *world)
{
    int64_t *now_at = world->numbers;
    size_t k, n = 0;
    for (k = 0; k < world->n; k++) {
        now_at[k] = (int64_t)n;
        if (!world->is_alive[k]) continue;
        world->ids[n] = world->ids[k];
        memmove(world->X_WBs + 16 * n, world->X_WBs + 16 * k, 16 * sizeof(double));
        memmove(world->poses + POSE * n, world->poses + POSE * k, POSE * sizeof(double));
        memmove(world->boxes + 6 * n, world->boxes + 6 * k, 6 * sizeof(double));
        memmove(world->traits + TRAITS * n, world->traits + TRAITS * k, TRAITS * sizeof(int64_t));
        world->traits[TRAITS * n + FLAGS] &= STATIC_BIT | STILL_BIT; /* that it has changed is forgotten */
        world->wholes[n] = world->wholes[k];
        world->margins[n] = world->margins[k];
        world->is_whole[n] = world->is_whole[k];
        world->row_of[n] = world->row_of[k];
        world->is_moved[n] = 0;
        world->is_alive[n++] = 1;
    }
    for (k = 0; k < world->n_allowed_keys; k++)
        world->allowed_keys[k] = now_at[first_of(world->allowed_keys[k])] << 32 | now_at[second_of(world->allowed_keys[k])];
    for (k = 0; k < world->n_margin_keys; k++)
        world->margin_keys[k] = key_of(now_at[first_of(world->margin_keys[k])], now_at[second_of(world->margin_keys[k])]);
    world->n = n;
    world->n_changed = 0;
    spread_margins(world);
    for (k = 0; k < n; k++) widen_box(world, (int64_t)k);
    write_allowed(world);
    make_trees(world);
}

static collide_status check_body(collide_world *world, const collide_body *body, size_t k)
{
    static const char caller[] = "collide_world_add";
    if (body->size != sizeof *body)
        return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: bodies[%zu]: size is %zu; begin with COLLIDE_BODY_DEFAULT",
                      caller, k, body->size);
    if ((body->shape != NULL) + (body->mesh != NULL) + (body->field != NULL) != 1)
        return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: bodies[%zu]: one of shape, mesh and field must not be NULL",
                      caller, k);
    if (!is_alive(body->shape, body->mesh, body->field))
        return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: bodies[%zu]: what it is to be was freed", caller, k);
    if (body->X_WB != NULL && check_poses(world, caller, body->X_WB, 1, NULL) != COLLIDE_OK)
        return refuse(world->message, COLLIDE_INVALID_POSE,
                      "%s: bodies[%zu]: X_WB is no pose: finite, a rotation, last row 0 0 0 1", caller, k);
    return COLLIDE_OK;
}

/* Write the row of a new body, for which there is memory. */
static int32_t put_body(collide_world *world, const collide_body *body)
{
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    size_t row = world->n++;
    int64_t *traits = world->traits + TRAITS * row;
    memcpy(world->X_WBs + 16 * row, body->X_WB != NULL ? body->X_WB : identity, sizeof identity);
    traits[FLAGS] = body->is_static ? STATIC_BIT | STILL_BIT : 0;
    traits[GROUP] = body->group;
    traits[MASK] = body->mask;
    traits[ALLOWED_AT] = world->leaf_of[row] = -1;
    world->is_whole[row] = world->wholes[row].bound != NULL;
    world->row_of[row] = take_shape(&world->table, world->is_whole[row] ? world->wholes[row].bound : body->shape);
    world->is_alive[row] = world->is_moved[row] = 1;
    world->margins[row] = world->spread[row] = 0.0;
    world->n_alive++;
    return world->ids[row] = world->next_id++;
}

/* What n new bodies are that are asked about as wholes, into rows for which there is memory; where that fails nothing is kept. */
static collide_status make_wholes(collide_world *world, const collide_body *bodies, size_t n)
{
    static const struct whole_body none = {NULL, NULL, NULL};
    struct whole_body *wholes = world->wholes + world->n;
    collide_status status = COLLIDE_OK;
    size_t k;
    for (k = 0; k < n && status == COLLIDE_OK; k++) {
        wholes[k] = none;
        if (bodies[k].shape == NULL) status = make_whole(bodies[k].mesh, bodies[k].field, &wholes[k]);
    }
    if (status == COLLIDE_OK) return status;
    while (k-- > 0) collide_shape_free(wholes[k].bound);
    return refuse(world->message, status, "collide_world_add: %s", collide_status_text(status));
}

collide_status collide_world_add(collide_world *world, const collide_body *bodies, size_t n, int32_t *ids)
{
    static const char caller[] = "collide_world_add";
    collide_status status;
    rounding given;
    size_t k;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if (n == 0) return COLLIDE_OK;
    if (bodies == NULL || ids == NULL)
        return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: %s is NULL", caller, bodies == NULL ? "bodies" : "ids");
    if (n > (size_t)(INT32_MAX - world->next_id))
        return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: ids beyond 2^31 - 1: begin another world", caller);
    for (k = 0; k < n; k++)
        if ((status = check_body(world, bodies + k, k)) != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    if (world->n > MIN_ROWS + 2 * world->n_alive) close_gaps(world);
    status = reserve(world, n) ? COLLIDE_OK : refuse(world->message, COLLIDE_NO_MEMORY, "%s: out of memory", caller);
    if (status == COLLIDE_OK) status = make_wholes(world, bodies, n);
    if (status == COLLIDE_OK) {
        size_t first = world->n;
        for (k = 0; k < n; k++) ids[k] = put_body(world, bodies + k);
        move_flagged(world, 0);
        add_to_trees(world, first);
    }
    round_as_before(given);
    return status;
}

collide_status collide_world_remove(collide_world *world, int32_t id)
{
    int64_t row;
    rounding given;
    size_t k, n = 0;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((row = row_of_id(world, id)) < 0) return unknown_body(world, "collide_world_remove", "id", 0, id);
    given = round_as_kernels_do();
    world->is_alive[row] = 0;
    world->n_alive--;
    leave_shape(&world->table, world->row_of[row]);
    collide_shape_free(world->wholes[row].bound);
    world->wholes[row].bound = NULL;
    for (k = 0; k < world->n_allowed_keys; k++)
        if (first_of(world->allowed_keys[k]) != row && second_of(world->allowed_keys[k]) != row)
            world->allowed_keys[n++] = world->allowed_keys[k];
    if (n < world->n_allowed_keys) {
        world->n_allowed_keys = n;
        write_allowed(world);
    }
    forget_margins(world, row);
    take_from_trees(world, row);
    round_as_before(given);
    return COLLIDE_OK;
}

/* --- moving and replacing ------------------------------------------------------------------------------------------- */

collide_status collide_world_move(collide_world *world, const int32_t *ids, size_t n, const double *X_WBs)
{
    static const char caller[] = "collide_world_move";
    collide_status status;
    rounding given;
    size_t k;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((status = check_ids(world, caller, "ids", ids, n)) != COLLIDE_OK || n == 0) return status;
    if (X_WBs == NULL) return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: X_WBs is NULL", caller);
    if ((status = check_poses(world, caller, X_WBs, n, ids)) != COLLIDE_OK) return status;
    for (k = 0; k < n; k++) {
        int64_t row = row_of_id(world, ids[k]);
        memcpy(world->X_WBs + 16 * row, X_WBs + 16 * k, 16 * sizeof(double));
        world->is_moved[row] = 1;
    }
    given = round_as_kernels_do();
    move_flagged(world, 1);
    round_as_before(given);
    return COLLIDE_OK;
}

/* Give a body what it is to be from now on. */
static collide_status replace(collide_world *world, const char *caller, int32_t id, const collide_shape *shape,
                              const collide_mesh *mesh, const collide_field *field)
{
    struct whole_body whole = {NULL, NULL, NULL};
    collide_status status = COLLIDE_OK;
    int64_t row, before;
    rounding given;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((row = row_of_id(world, id)) < 0) return unknown_body(world, caller, "id", 0, id);
    if (shape == NULL && mesh == NULL && field == NULL)
        return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: what body %ld is to be is NULL", caller, (long)id);
    if (!is_alive(shape, mesh, field))
        return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: what body %ld is to be was freed", caller, (long)id);
    if (shape == NULL) status = make_whole(mesh, field, &whole);
    if (status != COLLIDE_OK) return refuse(world->message, status, "%s: %s", caller, collide_status_text(status));
    given = round_as_kernels_do();
    before = world->row_of[row];
    world->row_of[row] = take_shape(&world->table, shape != NULL ? shape : whole.bound);
    leave_shape(&world->table, before);
    collide_shape_free(world->wholes[row].bound);
    world->wholes[row] = whole;
    world->is_whole[row] = shape == NULL;
    world->is_moved[row] = 1;
    move_flagged(world, 1);
    round_as_before(given);
    return COLLIDE_OK;
}

collide_status collide_world_replace(collide_world *world, int32_t id, const collide_shape *shape)
{
    return replace(world, "collide_world_replace", id, shape, NULL, NULL);
}

collide_status collide_world_replace_mesh(collide_world *world, int32_t id, const collide_mesh *mesh)
{
    return replace(world, "collide_world_replace_mesh", id, NULL, mesh, NULL);
}

collide_status collide_world_replace_field(collide_world *world, int32_t id, const collide_field *field)
{
    return replace(world, "collide_world_replace_field", id, NULL, NULL, field);
}

collide_status collide_world_sleep(collide_world *world, const int32_t *ids, size_t n, int asleep)
{
    collide_status status;
    size_t k;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((status = check_ids(world, "collide_world_sleep", "ids", ids, n)) != COLLIDE_OK) return status;
    for (k = 0; k < n; k++) {
        int64_t *flags = world->traits + TRAITS * row_of_id(world, ids[k]) + FLAGS;
        *flags &= ~(int64_t)STILL_BIT;
        if (asleep || (*flags & STATIC_BIT)) *flags |= STILL_BIT;
    }
    return COLLIDE_OK;
}

/* --- what there is -------------------------------------------------------------------------------------------------- */

size_t collide_world_size(const collide_world *world) { return IS_HANDLE(world, WORLD_WORD) ? world->n_alive : 0; }

collide_status collide_world_pose(const collide_world *world, int32_t id, double X_WB[16])
{
    int64_t row;
    if (!IS_HANDLE(world, WORLD_WORD) || X_WB == NULL || (row = row_of_id(world, id)) < 0) return COLLIDE_INVALID_ARGUMENT;
    memcpy(X_WB, world->X_WBs + 16 * row, 16 * sizeof(double));
    return COLLIDE_OK;
}
