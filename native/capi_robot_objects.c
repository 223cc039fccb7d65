/* Objects that a workspace carries on links of a robot, and pairs that it tests no more: `attach`, `detach` and `allow` of
   collide/robots/robot_checker.py. Behind the rows of the file's bodies stand those of objects, in tables of the workspace's own. */
#include "capi_compound.h"
#include "capi_robot.h"

#include <stdlib.h>
#include <string.h>

/* Roundings of forward kinematics, as a share of how far links and bodies reach (collide/robots/motion_bounds.py); below this sum of
   |R^T R - 1| roundings of a rotation count as none (collide/robots/check_scene.py). */
static const double ROUNDING_SHARE = 1.0 / ((int64_t)1 << 40), ROUNDINGS_OF_ROTATIONS = 1e-13;
enum { J_KIND, J_PARENT, J_CHILD };
enum { B_LINK, B_FIRST, B_COUNT };

/* An object in its link. parts, boxes : rows of its parts, boxes of these and then of their twins. */
struct carried {
    int64_t link, n_parts;
    const collide_shape **shapes; /* of the parts, then of twins */
    collide_shape **swollen;      /* those of twins that are the workspace's own, or NULL each */
    double *parts, *boxes, box[BOX], skew;
};

/* Tables of a workspace, begun as copies of the robot's. */
struct robot_objects {
    struct arena arena;
    struct carried *of[MAX_OBJECTS];
    int64_t n, n_parts; /* n_parts : of the robot's own bodies */
    int64_t *bodies, *self_pairs, *between, *shape_of, *shape_rows, *paths, *path_lengths, *map_ints;
    double *body_boxes, *parts, *part_boxes, *shape_numbers, *map_doubles;
    uint8_t *allowed, *is_bound;
};

/* --- tables ----------------------------------------------------------------------------------------------------------- */

/* How many rows of parts there are for links and objects, without those of twins; shapes of robot and objects at most. */
static int64_t part_rows(const collide_robot *robot) { return robot->sizes[F_LINK_PARTS] - robot->sizes[F_TWINS_AFTER]; }
static int64_t shape_capacity(const collide_robot *robot) { return robot->sizes[F_SHAPES] + 2 * part_rows(robot); }

/* Memory for `count` elements, of which the first are those of a table. */
static void *copy_of(struct arena *arena, const void *table, int64_t n, int64_t count, size_t bytes)
{
    void *own = arena_zeroed(arena, (size_t)count + 1, bytes);
    if (own != NULL && n > 0) memcpy(own, table, (size_t)n * bytes);
    return own;
}

#define COPIED(name, size, rows) made->name = copy_of(&made->arena, robot->name, (size) * n_rows, (size) * (n_rows + (rows)), sizeof *made->name)

/* The workspace's own tables, made at the first change; NULL without memory. */
static struct robot_objects *objects_of(collide_robot_workspace *space)
{
    const collide_robot *robot = space->robot;
    const int64_t *n = robot->sizes;
    struct robot_objects *made;
    int64_t n_rows, k, pairs = MAX_OBJECTS * (n[F_BODIES] + MAX_OBJECTS);
    if (space->objects != NULL) return space->objects;
    if ((made = calloc(1, sizeof *made)) == NULL) return NULL;
    arena_begin(&made->arena);
    n_rows = n[F_BODIES];
    COPIED(bodies, BODY_INTS, MAX_OBJECTS), COPIED(body_boxes, BOX, MAX_OBJECTS), COPIED(allowed, n[F_AROUND], MAX_OBJECTS);
    COPIED(paths, n[F_STRIDE], MAX_OBJECTS), COPIED(path_lengths, 1, MAX_OBJECTS);
    n_rows = n[F_SELF_PAIRS];
    COPIED(self_pairs, 2, pairs), COPIED(between, 2, pairs);
    n_rows = n[F_PARTS];
    COPIED(part_boxes, BOX, 0), COPIED(is_bound, 1, 0), COPIED(shape_of, 1, 0);
    n_rows = n[F_LINK_PARTS];
    COPIED(parts, PART, 0);
    n_rows = n[F_SHAPES];
    COPIED(shape_rows, INTS, shape_capacity(robot) - n_rows), COPIED(shape_numbers, NUMBERS, shape_capacity(robot) - n_rows);
    n_rows = n[F_MAPS];
    COPIED(map_ints, MAP_INTS, 0), COPIED(map_doubles, MAP_DOUBLES, 0);
    if (made->arena.failed) {
        arena_end(&made->arena);
        free(made);
        return NULL;
    }
    for (k = 0; k < n[F_BODIES]; k++) {
        const int64_t *body = robot->bodies + BODY_INTS * k;
        if (body[B_FIRST] + body[B_COUNT] > made->n_parts) made->n_parts = body[B_FIRST] + body[B_COUNT];
    }
    return space->objects = made;
}

/* Have kernels read the workspace's own tables. */
static void use_tables(collide_robot_workspace *space)
{
    const struct robot_objects *own = space->objects;
    int64_t *scene = space->scene;
    scene[BODIES_AT] = address_of(own->bodies), scene[BODY_BOXES_AT] = address_of(own->body_boxes);
    scene[SELF_PAIRS_AT] = address_of(own->self_pairs), scene[ALLOWED_AT] = address_of(own->allowed);
    scene[PARTS_AT] = address_of(own->parts), scene[PART_BOXES_AT] = address_of(own->part_boxes);
    scene[IS_BOUND_AT] = address_of(own->is_bound), scene[SHAPE_OF_PART_AT] = address_of(own->shape_of);
    scene[SHAPE_INTS_AT] = address_of(own->shape_rows), scene[SHAPE_NUMBERS_AT] = address_of(own->shape_numbers);
    space->motions[PATHS_AT] = address_of(own->paths), space->motions[PATH_LENGTHS_AT] = address_of(own->path_lengths);
    space->motions[BETWEEN_AT] = address_of(own->between);
    space->spheres[MAP_INTS_AT] = address_of(own->map_ints), space->spheres[MAP_DOUBLES_AT] = address_of(own->map_doubles);
}

/* --- an object -------------------------------------------------------------------------------------------------------- */

static void free_carried(struct carried *object)
{
    int64_t k;
    if (object == NULL) return;
    for (k = 0; object->swollen != NULL && k < object->n_parts; k++) collide_shape_free(object->swollen[k]);
    free(object->swollen);
    free((void *)object->shapes);
    free(object->parts);
    free(object);
}

void end_objects(collide_robot_workspace *space)
{
    struct robot_objects *own = space->objects;
    int64_t k;
    if (own == NULL) return;
    for (k = 0; k < own->n; k++) free_carried(own->of[k]);
    arena_end(&own->arena);
    free(own);
}

/* Centre and half sides of a box around a convex set, in its frame: `box_of` of collide/lowering/extents.py. */
static void box_of_shape(const collide_shape *shape, double box[BOX])
{
    const double *params = shape->numbers + PARAMS, *columns = (const double *)(intptr_t)shape->ints[ADDRESS];
    double wider = shape->numbers[RADIUS];
    int axis;
    int64_t k;
    for (axis = 0; axis < 3; axis++) {
        double low = INFINITE, high = -INFINITE;
        if (shape->ints[KIND] != POINTS) { /* three radii, or a radius and half a length */
            box[axis] = 0.0;
            box[3 + axis] = (params[2] > 0.0 ? params[axis] : params[axis / 2]) + wider + shape->numbers[SLOP];
            continue;
        }
        for (k = 0; k < shape->ints[COUNT]; k++) {
            double x = columns[shape->ints[PADDED] * axis + k];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        box[axis] = 0.5 * (low + high);
        box[3 + axis] = 0.5 * (high - low) + wider + shape->numbers[SLOP];
    }
}

/* The sum of |R^T R - 1| of a part's matrix; roundings of a rotation count as none. */
static double skew_of_part(const double *R)
{
    double off = 0.0;
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) off += fabs(R[i] * R[j] + R[3 + i] * R[3 + j] + R[6 + i] * R[6 + j] - (i == j));
    return off < ROUNDINGS_OF_ROTATIONS ? 0.0 : off;
}

/* The box around parts in the object's frame, from their boxes, and how far their matrices are from rotations. */
static void bound_parts(struct carried *object, const double *part_boxes)
{
    double low[3] = {INFINITE, INFINITE, INFINITE}, high[3] = {-INFINITE, -INFINITE, -INFINITE};
    int64_t k;
    int i;
    for (k = 0; k < object->n_parts; k++) {
        const double *part = object->parts + PART * k, *c = part_boxes + BOX * k, *h = c + 3;
        double skew = skew_of_part(part);
        if (skew > object->skew) object->skew = skew;
        for (i = 0; i < 3; i++) {
            const double *row = part + 3 * i;
            double centre = row[0] * c[0] + row[1] * c[1] + row[2] * c[2] + part[9 + i];
            double half = fabs(row[0]) * h[0] + fabs(row[1]) * h[1] + fabs(row[2]) * h[2];
            if (centre - half < low[i]) low[i] = centre - half;
            if (centre + half > high[i]) high[i] = centre + half;
        }
    }
    for (i = 0; i < 3; i++) {
        object->box[i] = 0.5 * (low[i] + high[i]);
        object->box[3 + i] = 0.5 * (high[i] - low[i]);
    }
}

/* A convex set swollen by a ball: `swollen` of collide/robots/check_tables.py. */
static collide_status swollen_shape(const collide_shape *shape, double padding, collide_shape **made)
{
    double numbers[NUMBERS];
    const double *points = NULL;
    collide_status status = COLLIDE_NO_MEMORY;
    struct arena arena;
    int is_hull = shape->ints[KIND] == POINTS;
    arena_begin(&arena);
    memcpy(numbers, shape->numbers, sizeof numbers);
    numbers[RADIUS] += padding;
    if (!is_hull || (points = points_of_hull(shape, &arena)) != NULL)
        status = shape_of_row(shape->ints[KIND], numbers, points, is_hull ? (size_t)shape->ints[COUNT] : 0, 1, made);
    arena_end(&arena);
    return status;
}

/* Rows of an object on a link, at a pose there. */
static collide_status make_carried(const collide_robot *robot, const collide_compound *compound, const double *X_LS, double padding,
                                   struct carried **made)
{
    int64_t n = (int64_t)compound->n, k;
    struct carried *object = *made = calloc(1, sizeof *object);
    collide_status status = COLLIDE_OK;
    double *rows;
    if (object == NULL) return COLLIDE_NO_MEMORY;
    object->n_parts = n;
    object->shapes = calloc((size_t)(2 * n), sizeof *object->shapes);
    object->swollen = calloc((size_t)n, sizeof *object->swollen);
    object->parts = rows = malloc((size_t)((PART + 2 * BOX) * n) * sizeof *rows);
    if (object->shapes == NULL || object->swollen == NULL || rows == NULL) return COLLIDE_NO_MEMORY;
    object->boxes = rows + PART * n;
    memcpy(rows, compound->parts, (size_t)(PART * n) * sizeof *rows);
    for (k = 0; k < n && status == COLLIDE_OK; k++) {
        object->shapes[k] = object->shapes[n + k] = compound->shapes[k];
        if (padding > 0.0) status = swollen_shape(compound->shapes[k], padding, &object->swollen[k]);
        if (object->swollen[k] != NULL) object->shapes[n + k] = object->swollen[k];
    }
    if (status != COLLIDE_OK) return status;
    for (k = 0; k < 2 * n; k++) box_of_shape(object->shapes[k], object->boxes + BOX * k);
    bound_parts(object, object->boxes + BOX * n);
    object->skew += robot->kernels->move_parts(address_of(X_LS), address_of(compound->parts), address_of(rows), n, address_of(object->box));
    return COLLIDE_OK;
}

/* --- rows of objects -------------------------------------------------------------------------------------------------- */

struct ranked {
    const int64_t *content;
    int64_t *rank;
};

static int by_content(const void *one, const void *other)
{
    return memcmp(((const struct ranked *)one)->content, ((const struct ranked *)other)->content, 2 * sizeof(int64_t));
}

/* Ranks of n shapes by content, equal ones the same: by them the bodies of a pair are ordered. */
static void rank_shapes(struct ranked *order, int64_t n)
{
    int64_t k, rank = 0;
    qsort(order, (size_t)n, sizeof *order, by_content);
    for (k = 0; k < n; k++) {
        if (k > 0 && by_content(&order[k - 1], &order[k]) != 0) rank++;
        *order[k].rank = rank;
    }
}

/* Rows of one object's parts from part `first` on, of its shapes from row `shape` on; the row behind these. */
static int64_t write_parts(struct robot_objects *own, const struct carried *object, int64_t first, int64_t twins_after, int64_t shape,
                           struct ranked *order)
{
    int64_t n = object->n_parts, side, k;
    for (side = 0; side < 1 + (twins_after > 0); side++) {
        int64_t to = first + side * twins_after;
        memcpy(own->parts + PART * to, object->parts, (size_t)(PART * n) * sizeof(double));
        memcpy(own->part_boxes + BOX * to, object->boxes + side * BOX * n, (size_t)(BOX * n) * sizeof(double));
        memset(own->is_bound + to, 0, (size_t)n);
        for (k = 0; k < n; k++, shape++) {
            const collide_shape *of_part = object->shapes[side * n + k];
            own->shape_of[to + k] = shape;
            memcpy(own->shape_rows + INTS * shape, of_part->ints, sizeof of_part->ints);
            memcpy(own->shape_numbers + NUMBERS * shape, of_part->numbers, sizeof of_part->numbers);
            order[shape].content = of_part->content;
        }
    }
    return shape;
}

/* The joints that move a link, from it to the root, into a row of paths; how many. */
static int64_t write_path(const collide_robot *robot, int64_t link, int64_t *path)
{
    int64_t k, count = 0;
    for (k = robot->sizes[F_JOINTS] - 1; k >= 0; k--) { /* parents come before */
        const int64_t *joint = robot->joint_ints + JOINT_INTS * k;
        if (joint[J_CHILD] != link) continue;
        if (joint[J_KIND] != 0 && count < robot->sizes[F_STRIDE]) path[count++] = k;
        link = joint[J_PARENT];
    }
    return count;
}

static double reach_of_box(const double *box)
{
    return fabs(box[0]) + fabs(box[1]) + fabs(box[2]) + fabs(box[3]) + fabs(box[4]) + fabs(box[5]);
}

/* What places of links and bodies may be off by rounding: as of the file, or by an object that reaches farther. */
static double rounding_with(const collide_robot *robot, double reach)
{
    double shifts = 0.0, rounding;
    int64_t k, i;
    for (i = 9; i < LINK_POSE; i++) {
        shifts += fabs(robot->scalars[S_BASE + i]);
        for (k = 0; k < robot->sizes[F_JOINTS]; k++) shifts += fabs(robot->joint_doubles[JOINT_DOUBLES * k + i]);
    }
    rounding = ROUNDING_SHARE * (reach + shifts);
    return reach > 0.0 && rounding > robot->scalars[S_ROUNDING] ? rounding : robot->scalars[S_ROUNDING];
}

/* Write the rows of all objects, which there is room for. Spheres and maps hold the file's bodies alone: with others they are left.
   order : of all shapes. */
static void carry_objects(collide_robot_workspace *space, struct ranked *order)
{
    const collide_robot *robot = space->robot;
    const int64_t *n = robot->sizes;
    struct robot_objects *own = space->objects;
    int64_t first = own->n_parts, shape, k;
    double skew = 0.0, reach = 0.0, slack, rounding;
    for (shape = 0; shape < n[F_SHAPES]; shape++) order[shape].content = robot->shapes[shape]->content;
    for (k = 0; k < own->n; k++) {
        const struct carried *object = own->of[k];
        const int64_t row[BODY_INTS] = {object->link, first, object->n_parts, 0};
        int64_t number = n[F_BODIES] + k;
        memcpy(own->bodies + BODY_INTS * number, row, sizeof row);
        memcpy(own->body_boxes + BOX * number, object->box, sizeof object->box);
        own->path_lengths[number] = write_path(robot, object->link, own->paths + n[F_STRIDE] * number);
        shape = write_parts(own, object, first, n[F_TWINS_AFTER], shape, order);
        first += object->n_parts;
        if (object->skew > skew) skew = object->skew;
        if (reach_of_box(object->box) > reach) reach = reach_of_box(object->box);
    }
    for (k = 0; k < shape; k++) order[k].rank = own->shape_rows + INTS * k + RANK;
    rank_shapes(order, shape);
    slack = robot->scalars[S_SLACK] + 8.0 * skew;
    rounding = rounding_with(robot, reach);
    memcpy(&space->scene[SLACK], &slack, sizeof slack);
    memcpy(&space->motions[ROUNDING], &rounding, sizeof rounding);
    space->scene[N_BODIES] = n[F_BODIES] + own->n;
    space->scene[SPHERE_HEADER_AT] = own->n == 0 && n[F_HAS_SPHERES] ? address_of(space->spheres) : 0;
}

/* --- pairs ------------------------------------------------------------------------------------------------------------ */

/* How many joints of one body's path are not of the other's. */
static int64_t joints_beyond(const collide_robot *robot, const struct robot_objects *own, int64_t body, int64_t other)
{
    const int64_t *path = own->paths + robot->sizes[F_STRIDE] * body, *others = own->paths + robot->sizes[F_STRIDE] * other;
    int64_t count = 0, i, j;
    for (i = 0; i < own->path_lengths[body]; i++) {
        for (j = 0; j < own->path_lengths[other] && others[j] != path[i];) j++;
        count += j == own->path_lengths[other];
    }
    return count;
}

static void test_pair(collide_robot_workspace *space, int64_t body, int64_t other)
{
    struct robot_objects *own = space->objects;
    int64_t row = space->scene[N_SELF_PAIRS]++;
    own->self_pairs[2 * row] = body, own->self_pairs[2 * row + 1] = other;
    own->between[2 * row] = joints_beyond(space->robot, own, body, other);
    own->between[2 * row + 1] = joints_beyond(space->robot, own, other, body);
}

/* Test the pair of a row no more; the first pairs have maps. */
static void drop_pair(collide_robot_workspace *space, int64_t row)
{
    struct robot_objects *own = space->objects;
    size_t after = (size_t)(--space->scene[N_SELF_PAIRS] - row);
    memmove(own->self_pairs + 2 * row, own->self_pairs + 2 * row + 2, 16 * after);
    memmove(own->between + 2 * row, own->between + 2 * row + 2, 16 * after);
    if (row >= space->spheres[N_MAPS]) return;
    after = (size_t)(--space->spheres[N_MAPS] - row);
    memmove(own->map_ints + MAP_INTS * row, own->map_ints + MAP_INTS * (row + 1), MAP_INTS * 8 * after);
    memmove(own->map_doubles + MAP_DOUBLES * row, own->map_doubles + MAP_DOUBLES * (row + 1), MAP_DOUBLES * 8 * after);
}

/* Whether numbers are of bodies: of the robot, objects among them, or around. */
static int are_numbers_of_bodies(const collide_robot_workspace *space, const int32_t *numbers, size_t n)
{
    size_t k;
    if (numbers == NULL && n > 0) return 0;
    for (k = 0; k < n; k++)
        if (numbers[k] >= 0 ? numbers[k] >= space->scene[N_BODIES] : -1 - (int64_t)numbers[k] >= space->robot->sizes[F_AROUND]) return 0;
    return 1;
}

static int is_named(const int32_t *numbers, size_t n, int64_t body)
{
    size_t k;
    for (k = 0; k < n; k++) if (numbers[k] == body) return 1;
    return 0;
}

/* --- changes ---------------------------------------------------------------------------------------------------------- */

/* COLLIDE_OK where an object can be carried besides. */
static collide_status check_object(const collide_robot_workspace *space, const collide_compound *object, const double *X_LS, double padding)
{
    const collide_robot *robot = space->robot;
    const struct robot_objects *own = space->objects;
    int64_t free_rows = part_rows(robot) - own->n_parts, k;
    double pose[POSE];
    for (k = 0; k < own->n; k++) free_rows -= own->of[k]->n_parts;
    for (k = 0; k < (int64_t)object->n; k++)
        if (object->ints[INTS * k + KIND] == HALFSPACE) return COLLIDE_UNSUPPORTED;
    if (robot->kernels->first_bad_pose(address_of(X_LS), 0, 0, 1, 1, address_of(pose)) < 1) return COLLIDE_INVALID_POSE;
    if (padding > 0.0 && robot->sizes[F_TWINS_AFTER] == 0) return COLLIDE_UNSUPPORTED;
    return own->n == MAX_OBJECTS || (int64_t)object->n > free_rows ? COLLIDE_TOO_MANY : COLLIDE_OK;
}

static collide_status attach(collide_robot_workspace *space, int32_t body, const collide_compound *object, const double *X_LS,
                             double padding, const int32_t *touch, size_t n_touch)
{
    const int64_t *n = space->robot->sizes;
    struct robot_objects *own = space->objects;
    struct ranked *order = malloc((size_t)(shape_capacity(space->robot) + 1) * sizeof *order);
    struct carried *made = NULL;
    int64_t number = n[F_BODIES] + own->n, k;
    collide_status status = order == NULL ? COLLIDE_NO_MEMORY : make_carried(space->robot, object, X_LS, padding, &made);
    if (status != COLLIDE_OK) {
        free_carried(made);
        free(order);
        return status;
    }
    made->link = own->bodies[BODY_INTS * body + B_LINK];
    own->of[own->n++] = made;
    carry_objects(space, order);
    free(order);
    for (k = 0; k < number; k++)
        if (own->bodies[BODY_INTS * k + B_LINK] != made->link && !is_named(touch, n_touch, k)) test_pair(space, k, number);
    for (k = 0; k < n[F_AROUND]; k++) own->allowed[n[F_AROUND] * number + k] = (uint8_t)is_named(touch, n_touch, -1 - k);
    return COLLIDE_OK;
}

collide_status collide_robot_attach(collide_robot_workspace *workspace, int32_t body, const collide_compound *object,
                                    const double X_LS[16], double padding, const int32_t *touch, size_t n_touch, int32_t *number)
{
    collide_status status;
    rounding given;
    if (number != NULL) *number = -1;
    if (!IS_HANDLE(workspace, ROBOT_SPACE_WORD) || !IS_HANDLE(object, COMPOUND_WORD) || X_LS == NULL || number == NULL || body < 0 ||
        !are_numbers_of_bodies(workspace, &body, 1) || !are_numbers_of_bodies(workspace, touch, n_touch) ||
        !(padding == 0.0 || (padding >= SMALLEST && padding < 1e6)))
        return COLLIDE_INVALID_ARGUMENT;
    if (objects_of(workspace) == NULL) return COLLIDE_NO_MEMORY;
    use_tables(workspace);
    given = round_as_kernels_do();
    status = check_object(workspace, object, X_LS, padding);
    if (status == COLLIDE_OK) status = attach(workspace, body, object, X_LS, padding, touch, n_touch);
    if (status == COLLIDE_OK) *number = (int32_t)(workspace->scene[N_BODIES] - 1);
    round_as_before(given);
    return status;
}

collide_status collide_robot_detach(collide_robot_workspace *workspace, int32_t number)
{
    struct robot_objects *own;
    struct ranked *order;
    int64_t k, around, first, later;
    if (!IS_HANDLE(workspace, ROBOT_SPACE_WORD)) return COLLIDE_INVALID_ARGUMENT;
    first = workspace->robot->sizes[F_BODIES], around = workspace->robot->sizes[F_AROUND];
    if (number < first || number >= workspace->scene[N_BODIES]) return COLLIDE_INVALID_ARGUMENT;
    if ((order = malloc((size_t)(shape_capacity(workspace->robot) + 1) * sizeof *order)) == NULL) return COLLIDE_NO_MEMORY;
    own = workspace->objects;
    for (k = workspace->scene[N_SELF_PAIRS] - 1; k >= 0; k--) {
        int64_t *pair = own->self_pairs + 2 * k;
        if (pair[0] == number || pair[1] == number) drop_pair(workspace, k);
        else pair[0] -= pair[0] > number, pair[1] -= pair[1] > number;
    }
    later = workspace->scene[N_BODIES] - 1 - number;
    memmove(own->allowed + around * number, own->allowed + around * (number + 1), (size_t)(around * later));
    free_carried(own->of[number - first]);
    own->n--;
    memmove(own->of + (number - first), own->of + (number - first) + 1, (size_t)later * sizeof *own->of);
    carry_objects(workspace, order);
    free(order);
    return COLLIDE_OK;
}

collide_status collide_robot_allow(collide_robot_workspace *workspace, const int32_t *pairs, size_t n)
{
    struct robot_objects *own;
    int64_t row;
    size_t k;
    if (!IS_HANDLE(workspace, ROBOT_SPACE_WORD) || n > (size_t)1 << 40 || !are_numbers_of_bodies(workspace, pairs, 2 * n))
        return COLLIDE_INVALID_ARGUMENT;
    if ((own = objects_of(workspace)) == NULL) return COLLIDE_NO_MEMORY;
    use_tables(workspace);
    for (k = 0; k < n; k++) {
        int64_t a = pairs[2 * k], b = pairs[2 * k + 1], low = a < b ? a : b, high = a < b ? b : a;
        if (low < 0 && high >= 0) own->allowed[workspace->robot->sizes[F_AROUND] * high + (-1 - low)] = 1;
        for (row = workspace->scene[N_SELF_PAIRS] - 1; row >= 0; row--) {
            const int64_t *pair = own->self_pairs + 2 * row;
            if ((pair[0] == a && pair[1] == b) || (pair[0] == b && pair[1] == a)) drop_pair(workspace, row);
        }
    }
    return COLLIDE_OK;
}
