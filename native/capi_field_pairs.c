/* A field and a convex shape: walks down the field's tree, as collide/narrowphase/fields/field_pairs.py asks for them by
   collide/narrowphase/facets/nearest_item_calls.py. */
#include "capi_field.h"
#include "capi_mesh.h"

/* Header of walks (collide/narrowphase/facets/item_questions.py), and how they end (nearest_item_kernel.py). */
enum {
    WALK_CORE, WALK_TREE_AT, WALK_INTS_AT, WALK_NUMBERS_AT, COORDINATES_AT, WALK_POSES_AT, WALK_SHAPE_OF_AT, WALK_PAIRS_AT,
    WALK_ROW_AT, WALK_DOUBLES_AT, WALK_INTEGERS_AT, WALK_STACK_AT, BOUNDS_AT, SHAPE_FIRST, ITEMS_ARE, RADII_AT, BOX_AT, PROBE_AT,
    REACH_OF_ITEMS, LARGEST_RADIUS, PROMISE, WALK_HEADER
};
/* Floats of a probe (collide/mesh/box_overlap.py). */
enum { PROBE_FLOATS = 38 };
/* What `clouds_meet_balls` leaves open (collide/narrowphase/fields/ball_walk_kernel.py). */
enum { OPEN_BALL = 2 };
/* Widths of brackets that are promised, as a part of the size (collide/narrowphase/bounds.py): 2^-40 and 2^-26. */
static const double PROMISE_STORED = 9.094947017729282e-13, PROMISE_CURVED = 1.4901161193847656e-08;

/* Room of a workspace for fields (collide_workspace.field): an item and a shape as a table of two, and what walks work in. */
struct field_workspace {
    int64_t header[WALK_HEADER];
    int64_t ints[2 * INTS];
    double numbers[2 * NUMBERS];
    double coordinates[3 * COORDINATES];
    double poses[2 * POSE];
    int64_t both[2]; /* 0 and 1: shapes of the poses, and the pair */
    collide_pair rows[2];
    int64_t ball[2 * POSE + POINT_STACK]; /* of `clouds_meet_balls` */
    double box[6];                        /* around the shape, in its frame: centre and half sides */
    float probe[PROBE_FLOATS];
};

size_t field_workspace_bytes(const int64_t *m)
{
    if (m[M_WALK_HEADER] != WALK_HEADER || m[M_PROBE] != PROBE_FLOATS || m[M_CELL_HEADER] != FIELD_INTS ||
        m[M_CELL_NUMBERS] != FIELD_NUMBERS || 2 * m[M_WIDTH] * (m[M_POINT_LEVELS] + 1) != POINT_STACK || m[M_CELL_STACK] < POINT_STACK)
        return 0;
    return sizeof(struct field_workspace) + 2 * 8 * (size_t)m[M_CELL_STACK];
}

void begin_field_workspace(collide_workspace *space, void *memory, const int64_t *m)
{
    struct field_workspace *walk = memory;
    int64_t *header = walk->header;
    space->field = walk;
    walk->both[1] = 1;
    walk->ints[KIND] = POINTS;
    walk->ints[PADDED] = COORDINATES;
    walk->ints[ADDRESS] = header[COORDINATES_AT] = address_of(walk->coordinates);
    walk->ints[LOWEST] = NO_BITS;
    header[WALK_CORE] = space->header[CORE];
    header[WALK_INTS_AT] = address_of(walk->ints);
    header[WALK_NUMBERS_AT] = address_of(walk->numbers);
    header[WALK_POSES_AT] = address_of(walk->poses);
    header[WALK_SHAPE_OF_AT] = header[WALK_PAIRS_AT] = address_of(walk->both);
    header[WALK_ROW_AT] = address_of(walk->rows);
    header[WALK_DOUBLES_AT] = space->header[DOUBLES_AT];
    header[WALK_INTEGERS_AT] = space->header[INTEGERS_AT];
    header[WALK_STACK_AT] = address_of(walk + 1);
    header[BOUNDS_AT] = header[WALK_STACK_AT] + 8 * m[M_CELL_STACK];
    header[BOX_AT] = address_of(walk->box);
    header[PROBE_AT] = address_of(walk->probe);
}

/* The box around a shape in its own frame (collide/lowering/extents.py); of a half-space none is asked for. */
static void set_box(const collide_shape *shape, double box[6])
{
    const double *corners = (const double *)(intptr_t)shape->ints[ADDRESS], *params = shape->numbers + PARAMS;
    double wider = shape->numbers[RADIUS] + shape->numbers[SLOP];
    int64_t i, k, n = shape->ints[PADDED];
    for (k = 0; k < 3; k++) {
        double low = INFINITE, high = -INFINITE;
        for (i = 0; shape->ints[KIND] == POINTS && i < n; i++) {
            double x = corners[k * n + i];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        if (shape->ints[KIND] != POINTS) { /* three radii of an ellipsoid, else a radius and half a length */
            high = params[2] > 0.0 ? params[k] : params[k == 2];
            low = -high;
        }
        box[k] = 0.5 * (low + high);
        box[3 + k] = 0.5 * (high - low) + wider;
    }
}

/* Prepare the walk for a pair: an item of so many corners stands first in the table, and in rank. */
static void take_items(collide_workspace *space, int64_t are, const int64_t *tree, int64_t corners, double reach, double radius,
                       const collide_shape *shape)
{
    struct field_workspace *walk = space->field;
    const double *promise = shape->ints[KIND] == POINTS ? &PROMISE_STORED : &PROMISE_CURVED;
    walk->ints[COUNT] = corners;
    walk->numbers[RADIUS] = radius;
    memcpy(walk->ints + INTS, shape->ints, sizeof shape->ints);
    memcpy(walk->numbers + NUMBERS, shape->numbers, sizeof shape->numbers);
    walk->ints[INTS + RANK] = 1;
    if (shape->ints[KIND] != HALFSPACE) set_box(shape, walk->box);
    walk->header[WALK_TREE_AT] = address_of(tree);
    walk->header[ITEMS_ARE] = are;
    walk->header[RADII_AT] = 0;
    memcpy(walk->header + REACH_OF_ITEMS, &reach, sizeof reach);
    memcpy(walk->header + LARGEST_RADIUS, &radius, sizeof radius);
    memcpy(walk->header + PROMISE, promise, sizeof(double));
}

static void take_field(collide_workspace *space, const collide_field *field, const collide_shape *shape)
{
    take_items(space, field->are, field->tree, field->are == BALLS ? 1 : 8, field->reach, field->radius, shape);
    space->field->header[RADII_AT] = address_of(field->radii);
}

const int64_t *facet_walk(collide_workspace *space, const collide_mesh *mesh, const collide_shape *shape)
{
    const double *largest = mesh->numbers + CORNER;
    double reach = sqrt(largest[0] * largest[0] + largest[1] * largest[1] + largest[2] * largest[2]) + mesh->radius;
    int64_t m[MEASURES];
    workspace_sizes(space->kernels, m);
    if (m[M_WIDTH] * (mesh->depth + 2) > m[M_CELL_STACK]) return NULL;
    take_items(space, FACETS, mesh->tree, 3, reach, 0.0, shape);
    return space->field->header;
}

int64_t ask_facets(collide_workspace *space, const collide_mesh *mesh, const collide_shape *shape, const double *X_WM,
                   const double *X_WS, int boolean, int depths, collide_pair *row)
{
    int64_t header_at = address_of(facet_walk(space, mesh, shape)), state = 0, place, how;
    if (header_at == 0) return LONG_WAY;
    if (!boolean)
        return space->kernels->curved_gap_single(header_at, address_of(X_WM), address_of(X_WS), address_of(row), (uint8_t)depths, INFINITE);
    space->kernels->curved_states_of(header_at, address_of(X_WM), address_of(X_WS), 1, 0.0, address_of(&state), address_of(&place),
                                     address_of(&how));
    return state;
}

void write_facet_walk(collide_workspace *space, const int64_t *tree, double reach, double promise, int64_t *stack, int64_t n_stack,
                      int64_t *header)
{
    const double radius = 0.0;
    space->field->ints[COUNT] = 3;
    space->field->numbers[RADIUS] = radius;
    memcpy(header, space->field->header, sizeof space->field->header);
    header[WALK_TREE_AT] = address_of(tree);
    header[WALK_STACK_AT] = address_of(stack);
    header[BOUNDS_AT] = address_of(stack + n_stack);
    header[ITEMS_ARE] = FACETS;
    header[RADII_AT] = header[SHAPE_FIRST] = 0;
    memcpy(header + REACH_OF_ITEMS, &reach, sizeof reach);
    memcpy(header + LARGEST_RADIUS, &radius, sizeof radius);
    memcpy(header + PROMISE, &promise, sizeof promise);
}

/* LONG_WAY; MEETS; else the pair is farther apart than a margin, or with a margin above 0 may be nearer. */
static int64_t state_of(const struct field_pair *pair, double margin)
{
    int64_t state, place, how, header_at = address_of(pair->space->field->header);
    const struct collide_kernels *kernels = pair->space->kernels;
    kernels->curved_states_of(
        header_at, address_of(pair->X_WF), address_of(pair->X_WS), 1, margin, address_of(&state), address_of(&place), address_of(&how)
    );
    return state;
}

static collide_status meet(const struct field_pair *pair, uint8_t *hit)
{
    int64_t state = pair->shape->ints[KIND] == HALFSPACE ? LONG_WAY : state_of(pair, 0.0);
    *hit = state == MEETS;
    return state == LONG_WAY ? items_meet(pair, hit) : COLLIDE_OK;
}

/* A row that is farther apart than a limit says no more than that it is. */
static void cut_row(collide_pair *row, double limit)
{
    if (!(row->lower > limit)) return;
    row->beyond = row->certified = 1;
    row->distance = row->lower;
    row->upper = INFINITE;
}

/* The row into zeros; of what is beyond the limit by a walk with the limit as margin. */
static collide_status measure_pair(const struct field_pair *pair, double limit, collide_pair *row)
{
    uint8_t depths = !(pair->flags & COLLIDE_UNSIGNED), is_written = 0;
    int64_t header_at = address_of(pair->space->field->header);
    const struct collide_kernels *kernels = pair->space->kernels;
    collide_status status = COLLIDE_OK;
    if (pair->shape->ints[KIND] != HALFSPACE) {
        int64_t state = limit < INFINITE ? state_of(pair, limit) : LONG_WAY;
        if (state == APART || state == MAYBE_INSIDE) row->lower = nextafter(limit, INFINITE);
        else
            kernels->curved_gaps(
                header_at, address_of(pair->X_WF), address_of(pair->X_WS), 1, depths, address_of(row), address_of(&is_written));
        is_written |= state == APART || state == MAYBE_INSIDE;
    }
    if (!is_written) {
        memset(row, 0, sizeof *row);
        status = row_of_item(pair, row);
    }
    cut_row(row, limit);
    kernels->finish_rows(address_of(row), 1, depths);
    if (status != COLLIDE_OK) memset(row, 0, sizeof *row);
    return status;
}

/* --- questions ------------------------------------------------------------------------------------------------------- */

/* n pairs of poses of a field and a shape. */
struct field_question {
    struct field_pair pair;
    const double *X_WF, *X_WS;
    int64_t step_f, step_s;
    size_t n;
};

static void go_to(struct field_question *asked, size_t k)
{
    asked->pair.X_WF = asked->X_WF + (size_t)asked->step_f * k;
    asked->pair.X_WS = asked->X_WS + (size_t)asked->step_s * k;
}

/* The question, checked, but for what its poses are. */
static collide_status begin(struct field_question *asked, collide_workspace *space, const collide_field *field,
                            const collide_shape *shape, collide_poses X_WF, collide_poses X_WS, unsigned flags)
{
    if (!IS_HANDLE(space, WORKSPACE_WORD) || !IS_HANDLE(field, FIELD_WORD) || !IS_HANDLE(shape, SHAPE_WORD) || (flags & ~(unsigned)(COLLIDE_TRUST_POSES | COLLIDE_UNSIGNED)) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    asked->n = longer(X_WF, X_WS);
    if (asked->n == 0) return X_WF.count > 1 || X_WS.count > 1 ? COLLIDE_INVALID_ARGUMENT : COLLIDE_OK;
    if (!take_poses(X_WF, asked->n, &asked->X_WF, &asked->step_f) || !take_poses(X_WS, asked->n, &asked->X_WS, &asked->step_s))
        return COLLIDE_INVALID_ARGUMENT;
    asked->pair.space = space;
    asked->pair.field = field;
    asked->pair.shape = shape;
    asked->pair.flags = flags;
    take_field(space, field, shape);
    return COLLIDE_OK;
}

int are_poses(const struct field_pair *pair)
{
    int64_t pose_at = address_of(pair->space->field->poses);
    uint8_t check = !(pair->flags & COLLIDE_TRUST_POSES);
    return pair->space->kernels->first_bad_pose(address_of(pair->X_WF), 0, 0, 1, check, pose_at) == 1 &&
           pair->space->kernels->first_bad_pose(address_of(pair->X_WS), 0, 0, 1, check, pose_at) == 1;
}

/* Number of the first pair at which a matrix is no pose; n where all are. */
static size_t first_bad(const struct field_question *asked)
{
    const struct collide_kernels *kernels = asked->pair.space->kernels;
    int64_t pose_at = address_of(asked->pair.space->field->poses), n = (int64_t)asked->n, f, s;
    uint8_t check = !(asked->pair.flags & COLLIDE_TRUST_POSES);
    f = kernels->first_bad_pose(address_of(asked->X_WF), asked->step_f, 0, asked->step_f == 0 ? 1 : n, check, pose_at);
    s = kernels->first_bad_pose(address_of(asked->X_WS), asked->step_s, 0, asked->step_s == 0 ? 1 : n, check, pose_at);
    if (asked->step_f == 0 && f == 1) f = n;
    if (asked->step_s == 0 && s == 1) s = n;
    return (size_t)(f < s ? f : s);
}

/* Booleans of a cloud of equal balls and a ball by one call; those left open are OPEN_BALL. */
static int are_balls(const struct field_question *asked)
{
    const int64_t *ints = asked->pair.shape->ints;
    return asked->pair.field->are == BALLS && asked->pair.field->radii == NULL && ints[KIND] == POINTS && ints[COUNT] == 1 &&
           asked->pair.shape->numbers[SLOP] == 0.0;
}

static void meet_ball(const struct field_question *asked, uint8_t *hits)
{
    const struct field_pair *pair = &asked->pair;
    const double *coordinates = (const double *)(intptr_t)pair->shape->ints[ADDRESS];
    double centre[3], radius = pair->shape->numbers[RADIUS];
    int k;
    for (k = 0; k < 3; k++) centre[k] = coordinates[k * pair->shape->ints[PADDED]];
    pair->space->kernels->clouds_meet_balls(
        address_of(pair->field->tree), pair->field->radius, address_of(centre), radius, address_of(asked->X_WF), asked->step_f,
        address_of(asked->X_WS), asked->step_s, (int64_t)asked->n, 0, address_of(hits), address_of(pair->space->field->ball));
}

/* The booleans of a question; *failed : the first pair without one. */
static collide_status answer_booleans(struct field_question *asked, uint8_t *hits, size_t *failed)
{
    collide_status status = COLLIDE_OK;
    int balls = are_balls(asked);
    size_t k;
    if ((*failed = first_bad(asked)) < asked->n) return COLLIDE_INVALID_POSE;
    if (balls) meet_ball(asked, hits);
    for (k = 0; status == COLLIDE_OK && k < asked->n; k++) {
        go_to(asked, k);
        if (!balls) status = meet(&asked->pair, &hits[k]);
        else if (hits[k] == OPEN_BALL) status = items_meet(&asked->pair, &hits[k]);
    }
    *failed = status == COLLIDE_OK ? 0 : k - 1;
    return status;
}

/* The rows of a question, which are zeros; *failed : the first pair without one, which later pairs are not the worse for. */
static collide_status answer_rows(struct field_question *asked, double limit, collide_pair *rows, collide_status *statuses,
                                  size_t *failed)
{
    collide_status first = COLLIDE_OK;
    size_t k;
    if ((*failed = first_bad(asked)) < asked->n) return COLLIDE_INVALID_POSE;
    *failed = 0;
    for (k = 0; k < asked->n; k++) {
        collide_status status;
        go_to(asked, k);
        status = measure_pair(&asked->pair, limit, &rows[k]);
        if (statuses != NULL) statuses[k] = status;
        if (status == COLLIDE_OK || first != COLLIDE_OK) continue;
        first = status;
        *failed = k;
    }
    return first;
}

static collide_poses single_pose(const double *X)
{
    collide_poses pose;
    pose.matrices = X;
    pose.count = 1;
    return pose;
}

collide_status collide_field_collide_batch(collide_workspace *workspace, const collide_field *field, const collide_shape *shape,
                                           collide_poses X_WF, collide_poses X_WS, unsigned flags, uint8_t *hits, size_t *failed)
{
    struct field_question asked;
    collide_status status = begin(&asked, workspace, field, shape, X_WF, X_WS, flags);
    size_t blamed = 0;
    rounding given;
    if (failed != NULL) *failed = 0;
    if (status != COLLIDE_OK || asked.n == 0) return status;
    if (hits == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(hits, 0, asked.n);
    given = round_as_kernels_do();
    status = answer_booleans(&asked, hits, &blamed);
    round_as_before(given);
    if (failed != NULL) *failed = blamed;
    return status;
}

collide_status collide_field_distance_batch(collide_workspace *workspace, const collide_field *field, const collide_shape *shape,
                                            collide_poses X_WF, collide_poses X_WS, double max_distance, unsigned flags,
                                            collide_pair *pairs, collide_status *statuses, size_t *failed)
{
    struct field_question asked;
    collide_status status = begin(&asked, workspace, field, shape, X_WF, X_WS, flags);
    size_t blamed = 0;
    rounding given;
    if (failed != NULL) *failed = 0;
    if (!(max_distance >= 0.0)) return COLLIDE_INVALID_ARGUMENT;
    if (status != COLLIDE_OK || asked.n == 0) return status;
    if (pairs == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(pairs, 0, asked.n * sizeof *pairs);
    given = round_as_kernels_do();
    status = answer_rows(&asked, max_distance, pairs, statuses, &blamed);
    round_as_before(given);
    if (failed != NULL) *failed = blamed;
    return status;
}

collide_status collide_field_collide(collide_workspace *workspace, const collide_field *field, const collide_shape *shape,
                                     const double X_WF[16], const double X_WS[16], unsigned flags, int *hit)
{
    uint8_t found = 0;
    collide_status status;
    if (hit == NULL) return COLLIDE_INVALID_ARGUMENT;
    *hit = 0;
    status = collide_field_collide_batch(workspace, field, shape, single_pose(X_WF), single_pose(X_WS), flags, &found, NULL);
    if (status == COLLIDE_OK) *hit = found;
    return status;
}

collide_status collide_field_distance(collide_workspace *workspace, const collide_field *field, const collide_shape *shape,
                                      const double X_WF[16], const double X_WS[16], double max_distance, unsigned flags,
                                      collide_pair *pair)
{
    if (pair == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(pair, 0, sizeof *pair);
    return collide_field_distance_batch(workspace, field, shape, single_pose(X_WF), single_pose(X_WS), max_distance, flags, pair,
                                        NULL, NULL);
}
