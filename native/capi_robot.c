/* Configurations of a robot: whether they collide, and distances, by the kernels of collide/robots. */
#include "capi_robot.h"

#include <stdlib.h>
#include <string.h>

/* Pairs left to others that there is room for at least, pairs that eight configurations leave open, and rows of pairs. */
enum { LEAST_OPEN = 4096, OPEN_PAIRS = 256, PAIR_ROWS = 4096 };
/* Verdicts of `check_configurations`, words of a pair left to others, and of a row that has no pair. */
enum { IS_FREE, COLLIDES, IS_OPEN };
enum { OPEN_NUMBER, OPEN_LOWER = 3 };
enum { NO_BODY = -1 };
/* The first limit of a search [m] (collide/robots/nearest_pairs.py), and configurations that go through together. */
#define FIRST_LIMIT 0.05
enum { TOGETHER = 64 };

/* --- workspaces ---------------------------------------------------------------------------------------------------- */

#define SHARED(word, section) scene[word] = address_of(robot->section)
#define ZEROED(word, count, bytes) header[word] = address_of(arena_zeroed(&space->arena, (size_t)(count), bytes))

static void begin_scene(collide_robot_workspace *space, const int64_t *m)
{
    const collide_robot *robot = space->robot;
    const int64_t *n = robot->sizes;
    int64_t *scene = space->scene, *header = scene, around = n[F_PARTS] - n[F_LINK_PARTS];
    SHARED(JOINT_INTS_AT, joint_ints), SHARED(JOINT_DOUBLES_AT, joint_doubles), SHARED(BASE_AT, scalars);
    SHARED(BODIES_AT, bodies), SHARED(BODY_BOXES_AT, body_boxes), SHARED(SELF_PAIRS_AT, self_pairs), SHARED(PARTS_AT, parts);
    SHARED(PART_BOXES_AT, part_boxes), SHARED(IS_BOUND_AT, is_bound), SHARED(NODE_LINKS_AT, node_links);
    SHARED(PART_POSES_AT, part_poses);
    SHARED(UNBOUNDED_AT, unbounded), SHARED(BODY_OF_AT, body_of), SHARED(ALLOWED_AT, allowed), SHARED(SHAPE_INTS_AT, shape_rows);
    SHARED(SHAPE_NUMBERS_AT, shape_numbers), SHARED(TERMS_AT, poses), SHARED(SHAPE_OF_PART_AT, shape_of);
    scene[N_JOINTS] = n[F_JOINTS], scene[ROOT] = n[F_ROOT], scene[N_LINKS] = n[F_LINKS], scene[N_BODIES] = n[F_BODIES];
    scene[N_SELF_PAIRS] = n[F_SELF_PAIRS], scene[N_LINK_PARTS] = n[F_LINK_PARTS], scene[TWINS_AFTER] = n[F_TWINS_AFTER];
    scene[N_PARTS] = n[F_PARTS], scene[N_NODES] = n[F_NODES], scene[N_UNBOUNDED] = n[F_UNBOUNDED], scene[N_AROUND] = n[F_AROUND];
    scene[CORE_CODE] = code_at(&robot->kernels->answer_pairs);
    scene[STATE_OF_PART] = code_at(&robot->kernels->state_of_part);
    scene[GAP_OF_PART] = code_at(&robot->kernels->gap_of_part);
    /* One configuration leaves each pair of parts to others at most once. */
    scene[OPEN_CAPACITY] = n[F_LINK_PARTS] * n[F_PARTS] + 1;
    if (scene[OPEN_CAPACITY] < LEAST_OPEN) scene[OPEN_CAPACITY] = LEAST_OPEN;
    ZEROED(PART_PLACES_AT, POSE * n[F_PARTS], sizeof(double)), ZEROED(LINKS_AT, POSE * n[F_LINKS], sizeof(double));
    ZEROED(WORLD_BOXES_AT, BOX * (n[F_BODIES] + MAX_OBJECTS), sizeof(double)), ZEROED(PLACED_AT, n[F_PARTS], 8), ZEROED(CANDIDATES_AT, n[F_PARTS] + 1, 8);
    ZEROED(PAIR_AT, 2, 8), ZEROED(ROW_AT, 1, sizeof(collide_pair)), ZEROED(PAIR_DOUBLES_AT, m[M_DOUBLES], sizeof(double));
    ZEROED(PAIR_INTEGERS_AT, m[M_INTEGERS], 8), ZEROED(OPEN_AT, OPEN_INTS * scene[OPEN_CAPACITY], 8), ZEROED(WALKS_AT, around + 1, 8);
    memcpy(&scene[SLACK], &robot->scalars[S_SLACK], sizeof(double));
    begin_around(space);
}

static void begin_spheres(collide_robot_workspace *space)
{
    const collide_robot *robot = space->robot;
    const int64_t *n = robot->sizes;
    int64_t *scene = space->spheres, *header = scene, columns = n[F_COLUMNS] > 0 ? n[F_COLUMNS] : 1;
    const size_t eight = LANES * sizeof(double);
    if (n[F_HAS_SPHERES] == 0) return;
    SHARED(SPHERE_COUNTS_AT, sphere_counts), SHARED(AROUND_BODIES_AT, around_bodies), SHARED(SPHERES_AT, sphere_rows);
    SHARED(PART_KINDS_AT, part_kinds), SHARED(PART_NUMBERS_AT, part_numbers), SHARED(MAP_INTS_AT, map_ints);
    SHARED(MAP_DOUBLES_AT, map_doubles), SHARED(MAP_CELLS_AT, map_cells);
    header[N_SPHERES] = n[F_SPHERES], header[N_MAPS] = n[F_MAPS], header[FEWEST] = n[F_FEWEST], header[N_COLUMNS] = columns;
    header[PAIR_CAPACITY] = OPEN_PAIRS;
    ZEROED(COLUMNS_AT, columns, eight), ZEROED(SPANS_AT, columns, eight), ZEROED(LINK_LANES_AT, LINK_POSE * n[F_LINKS], eight);
    ZEROED(AROUND_LANES_AT, SPHERE_PLACE * n[F_BODIES], eight), ZEROED(SPHERE_LANES_AT, SPHERE_PLACE * n[F_SPHERES], eight);
    ZEROED(SPHERES_PLACED_AT, n[F_BODIES], 8), ZEROED(VERDICTS_AT, 2, eight), ZEROED(FLAGS_AT, 1, eight), ZEROED(HALF_LANES_AT, 1, eight);
    ZEROED(OPEN_PAIRS_AT, OPEN_PAIR * OPEN_PAIRS, 8), ZEROED(PIECES_AT, 2 * (MAX_PIECES + LANES), sizeof(double));
    ZEROED(MOVED_LANES_AT, n[F_BODIES] * (n[F_STRIDE] + 1), eight);
    space->scene[SPHERE_HEADER_AT] = address_of(header);
}

/* Slots for n rows of pairs. */
static int fit_rows(collide_robot_workspace *space, int64_t n)
{
    collide_pair *rows = realloc(space->rows, (size_t)n * sizeof *rows);
    double *reaches;
    if (rows == NULL) return 0;
    space->rows = rows;
    if ((reaches = realloc(space->reaches, (size_t)n * sizeof *reaches)) == NULL) return 0;
    space->reaches = reaches;
    space->n_rows = n;
    return 1;
}

static int begin_workspace(collide_robot_workspace *space)
{
    int64_t m[MEASURES], *header = space->search;
    if (!workspace_sizes(space->robot->kernels, m)) return 0;
    begin_scene(space, m);
    begin_spheres(space);
    ZEROED(SLOT_OF_AT, space->robot->sizes[F_AROUND] + 1, 8);
    space->is_asked = arena_zeroed(&space->arena, 1, 1);
    if (!begin_motions(space) || !begin_meshes(space) || space->arena.failed || !fit_rows(space, PAIR_ROWS)) return 0;
    space->is_asked[0] = 1;
    return 1;
}

collide_status collide_robot_workspace_create(const collide_robot *robot, collide_robot_workspace **workspace)
{
    collide_robot_workspace *space;
    if (workspace == NULL) return COLLIDE_INVALID_ARGUMENT;
    *workspace = NULL;
    if (!IS_HANDLE(robot, ROBOT_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((space = calloc(1, sizeof *space)) == NULL) return COLLIDE_NO_MEMORY;
    space->word = ROBOT_SPACE_WORD;
    space->robot = robot;
    arena_begin(&space->arena);
    if (begin_workspace(space)) *workspace = space;
    else collide_robot_workspace_free(space);
    return *workspace != NULL ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

void collide_robot_workspace_free(collide_robot_workspace *workspace)
{
    if (!IS_HANDLE(workspace, ROBOT_SPACE_WORD)) return;
    end_handle(&workspace->word);
    end_motions(workspace);
    end_objects(workspace);
    collide_workspace_free(workspace->pairs);
    free(workspace->rows);
    free(workspace->reaches);
    arena_end(&workspace->arena);
    free(workspace);
}

/* --- what is left to Python ---------------------------------------------------------------------------------------- */

struct unanswered begin_unanswered(collide_status *statuses, size_t *failed, size_t n)
{
    struct unanswered rest = {statuses, failed, n};
    size_t k;
    for (k = 0; statuses != NULL && k < n; k++) statuses[k] = COLLIDE_OK;
    if (failed != NULL) *failed = 0;
    return rest;
}

void note_unanswered(struct unanswered *rest, size_t k)
{
    if (rest->statuses != NULL) rest->statuses[k] = COLLIDE_UNSUPPORTED;
    if (k < rest->first) rest->first = k;
}

collide_status end_unanswered(const struct unanswered *rest, size_t n)
{
    if (rest->first == n) return COLLIDE_OK;
    if (rest->failed != NULL) *rest->failed = rest->first;
    return COLLIDE_UNSUPPORTED;
}

int are_configurations(const collide_robot_workspace *space, const double *q, size_t n)
{
    const int64_t columns = !IS_HANDLE(space, ROBOT_SPACE_WORD) ? 0 : space->robot->sizes[F_COLUMNS];
    if (!IS_HANDLE(space, ROBOT_SPACE_WORD) || n > (size_t)1 << 40 || (q == NULL && n > 0 && columns > 0)) return 0;
    return n == 0 || space->robot->kernels->are_finite(address_of(q), (int64_t)n * columns);
}

/* --- questions ----------------------------------------------------------------------------------------------------- */

collide_status collide_robot_collide(collide_robot_workspace *workspace, const double *configurations, size_t n, uint8_t *hits,
                                     collide_status *statuses, size_t *failed)
{
    struct unanswered rest = begin_unanswered(statuses, failed, n);
    size_t done = 0, next, k;
    rounding given;
    if (!are_configurations(workspace, configurations, n) || (hits == NULL && n > 0)) return COLLIDE_INVALID_ARGUMENT;
    given = round_as_kernels_do();
    for (; done < n; done = next) {
        next = (size_t)workspace->robot->kernels->check_configurations(
            address_of(workspace->scene), address_of(configurations), workspace->robot->sizes[F_COLUMNS], (int64_t)done, (int64_t)n,
            address_of(hits));
        if (next == done) hits[next++] = IS_OPEN;
        for (k = done; k < next; k++) {
            if (hits[k] != IS_OPEN) continue;
            hits[k] = 0;
            note_unanswered(&rest, k);
        }
    }
    round_as_before(given);
    return end_unanswered(&rest, n);
}

/* Begin a search for rows of which `per` says what they are of. */
static void begin_search(collide_robot_workspace *space, int64_t per, unsigned between, int64_t slots)
{
    space->search[PER] = per;
    space->search[BETWEEN] = (int64_t)between;
    space->search[SLOTS] = slots;
    space->search[REACHES_AT] = address_of(space->reaches);
    space->search[IS_ASKED_AT] = address_of(space->is_asked);
    space->search[N_ROWS] = 0;
}

static int are_distances(const collide_robot_workspace *space, const double *q, size_t n, double max_distance, unsigned between,
                         const collide_pair *pairs)
{
    return are_configurations(space, q, n) && max_distance >= 0.0 && between > 0 && between <= 3 && (pairs != NULL || n == 0);
}

/* Whether a pair left to others may be nearer than the row of its configuration, or the row may not be the nearest. */
static int is_unsettled(const int64_t *open, const collide_pair *row, double limit)
{
    double lower;
    memcpy(&lower, open + OPEN_LOWER, sizeof lower);
    return row->a == NO_BODY || !(row->distance <= limit) || lower < row->distance;
}

static void finish_row(collide_pair *row, double max_distance)
{
    if (row->a != NO_BODY) return;
    row->beyond = row->certified = 1;
    row->distance = row->upper = INFINITE;
    row->lower = max_distance;
}

/* Rows and gradients of m configurations; `first` of them is the first of these. */
static void put_gradients(collide_robot_workspace *space, const double *q, int64_t n, const int64_t *of, int64_t m,
                          const collide_pair *rows, double *gradients)
{
    space->robot->kernels->distance_gradients(address_of(space->scene), address_of(q), space->robot->sizes[F_COLUMNS], n,
                                              address_of(of), m, address_of(space->robot->moves), address_of(rows), 0,
                                              address_of(gradients));
}

/* Rows of at most m <= TOGETHER configurations; returns how many are done, and which are left to others. */
static int64_t nearest_of(collide_robot_workspace *space, const double *q, int64_t m, double max_distance, collide_pair *rows,
                          double *gradients, uint8_t *is_unanswered)
{
    const int64_t *open, columns = space->robot->sizes[F_COLUMNS];
    int64_t of[TOGETHER], done, k;
    double limits[TOGETHER];
    memset(rows, 0, (size_t)m * sizeof *rows);
    memset(is_unanswered, 0, (size_t)m);
    for (k = 0; k < m; k++) {
        of[k] = k;
        limits[k] = max_distance < FIRST_LIMIT ? max_distance : FIRST_LIMIT;
    }
    done = space->robot->kernels->nearest_pairs(address_of(space->scene), address_of(q), columns, 0, m, max_distance,
                                                address_of(limits), address_of(space->search), address_of(rows));
    if (done == 0) {
        is_unanswered[0] = 1;
        return 1;
    }
    open = (const int64_t *)(intptr_t)space->scene[OPEN_AT];
    for (k = 0; k < space->scene[N_OPEN]; k++, open += OPEN_INTS)
        if (is_unsettled(open, &rows[open[OPEN_NUMBER]], limits[open[OPEN_NUMBER]])) is_unanswered[open[OPEN_NUMBER]] = 1;
    if (gradients != NULL) put_gradients(space, q, done, of, done, rows, gradients);
    for (k = 0; k < done; k++) finish_row(&rows[k], max_distance);
    return done;
}

/* What stands in a row without an answer. */
static void clear_row(const collide_robot_workspace *space, collide_pair *row, double *gradient)
{
    int64_t j;
    memset(row, 0, sizeof *row);
    for (j = 0; gradient != NULL && j < space->robot->sizes[F_COLUMNS]; j++) gradient[j] = NAN;
}

collide_status collide_robot_distance(collide_robot_workspace *workspace, const double *configurations, size_t n,
                                      double max_distance, unsigned between, collide_pair *pairs, double *gradients,
                                      collide_status *statuses, size_t *failed)
{
    struct unanswered rest = begin_unanswered(statuses, failed, n);
    uint8_t is_unanswered[TOGETHER];
    size_t done, columns;
    rounding given;
    if (!are_distances(workspace, configurations, n, max_distance, between, pairs)) return COLLIDE_INVALID_ARGUMENT;
    columns = (size_t)workspace->robot->sizes[F_COLUMNS];
    given = round_as_kernels_do();
    begin_search(workspace, OF_ROBOT, between, 1);
    for (done = 0; done < n;) {
        int64_t some = n - done < TOGETHER ? (int64_t)(n - done) : TOGETHER, k;
        double *gradient = gradients == NULL ? NULL : gradients + columns * done;
        some = nearest_of(workspace, configurations + columns * done, some, max_distance, pairs + done, gradient, is_unanswered);
        for (k = 0; k < some; k++) {
            if (!is_unanswered[k]) continue;
            note_unanswered(&rest, done + (size_t)k);
            clear_row(workspace, pairs + done + k, gradient == NULL ? NULL : gradient + columns * (size_t)k);
        }
        done += (size_t)some;
    }
    round_as_before(given);
    return end_unanswered(&rest, n);
}

/* By bodies, those around last and in their order. */
static int by_bodies(const void *one, const void *other)
{
    const collide_pair *p = one, *q = other;
    int64_t b = p->b >= 0 ? p->b : (int64_t)INT32_MAX - p->b, c = q->b >= 0 ? q->b : (int64_t)INT32_MAX - q->b;
    if (p->a != q->a) return p->a < q->a ? -1 : 1;
    return (b > c) - (b < c);
}

/* How many pairs a configuration has, sorted, in the workspace's rows; -1 where some are left to others, -2 without memory. */
static int64_t near_of(collide_robot_workspace *space, const double *q, double max_distance, unsigned between)
{
    int64_t starts[2], done = 0;
    while (done == 0) {
        begin_search(space, OF_PAIR, between, space->n_rows);
        done = space->robot->kernels->near_pairs(address_of(space->scene), address_of(q), space->robot->sizes[F_COLUMNS], 0, 1,
                                                 max_distance, address_of(starts), address_of(space->search),
                                                 address_of(space->rows));
        if (space->search[N_ROWS] < space->n_rows - 1 && done == 0) return -1;
        if (done == 0 && !fit_rows(space, 2 * space->n_rows)) return -2;
    }
    if (space->scene[N_OPEN] > 0) return -1;
    qsort(space->rows, (size_t)starts[1], sizeof *space->rows, by_bodies);
    return starts[1];
}

collide_status collide_robot_near(collide_robot_workspace *workspace, const double *configurations, size_t n, double max_distance,
                                  unsigned between, collide_pair *pairs, double *gradients, size_t capacity, size_t *starts,
                                  collide_status *statuses, size_t *failed)
{
    struct unanswered rest = begin_unanswered(statuses, failed, n);
    collide_status status = COLLIDE_OK;
    size_t k, columns, count = 0;
    rounding given;
    if (!are_distances(workspace, configurations, n, max_distance, between, pairs) || starts == NULL) return COLLIDE_INVALID_ARGUMENT;
    columns = (size_t)workspace->robot->sizes[F_COLUMNS];
    given = round_as_kernels_do();
    starts[0] = 0;
    for (k = 0; k < n && status == COLLIDE_OK; k++) {
        const double *q = configurations + columns * k;
        int64_t made = near_of(workspace, q, max_distance, between), j, of = 0;
        if (made == -1) note_unanswered(&rest, k);
        if (made == -2) status = COLLIDE_NO_MEMORY;
        else if (made > 0 && (size_t)made > capacity - count) status = COLLIDE_TOO_MANY;
        for (j = 0; j < made && status == COLLIDE_OK; j++, count++) {
            if (gradients != NULL) put_gradients(workspace, q, 1, &of, 1, workspace->rows + j, gradients + columns * count);
            pairs[count] = workspace->rows[j];
        }
        starts[k + 1] = count;
    }
    round_as_before(given);
    if (status == COLLIDE_OK) return end_unanswered(&rest, n);
    if (failed != NULL) *failed = k - 1;
    return status;
}
