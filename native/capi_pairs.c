/* Workspaces and queries: as `run_poses` of collide/narrowphase/convex_kernel_calls.py and `distance` of collide/pairs/query.py. */
#include "capi_compound.h"
#include "capi_contacts.h"
#include "capi_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Longest axis to begin with: its square is far from overflow. */
static const double LONGEST_AXIS = 1e100;

/* A collide_pair is what kernels write. */
typedef char pairs_are_rows[sizeof(collide_pair) == 160 ? 1 : -1];
typedef char marks_stand_last[offsetof(collide_pair, exact) == 156 ? 1 : -1];

/* --- workspaces ---------------------------------------------------------------------------------------------------- */

/* Everything of a fixed size, in one piece. */
struct buffers {
    double poses[2 * BLOCK * POSE];
    int64_t shape_of[2 * BLOCK], pairs[2 * BLOCK];
    collide_pair rows[BLOCK];
};

static void begin_header(collide_workspace *space)
{
    space->header[CORE] = code_at(&space->kernels->answer_pairs);
    space->header[SETTLE] = code_at(&space->kernels->settle_exactly);
    space->header[STEPS_AT] = address_of(space->steps);
    space->steps[0] = code_at(&space->kernels->settle_hulls);
    space->steps[1] = code_at(&space->kernels->settle_halfspaces);
    space->steps[2] = code_at(&space->kernels->exact_depth);
    space->header[POSES_AT] = address_of(space->poses);
    space->header[SHAPE_OF_AT] = address_of(space->shape_of);
    space->header[PAIRS_AT] = address_of(space->pairs);
    space->header[ROWS_AT] = address_of(space->rows);
}

/* Parts 0 and BLOCK, shapes 0 and 1: what single calls ask about, and `answer_poses` leaves. */
static void begin_pairs(collide_workspace *space)
{
    int64_t k;
    for (k = 0; k < BLOCK; k++) {
        space->pairs[2 * k] = k;
        space->pairs[2 * k + 1] = BLOCK + k;
        space->shape_of[k] = 0;
        space->shape_of[BLOCK + k] = 1;
    }
}

static int allocate_workspace(collide_workspace *space)
{
    int64_t measures[MEASURES];
    struct buffers *buffers;
    double *doubles;
    int64_t *integers, *digits;
    size_t words, meshes, fields;
    workspace_sizes(space->kernels, measures);
    meshes = mesh_workspace_bytes(measures);
    fields = field_workspace_bytes(measures);
    words = (size_t)(measures[M_DOUBLES] + measures[M_INTEGERS] + measures[M_WORKSPACE]);
    buffers = cache_lines(sizeof *buffers, &space->held[0]);
    doubles = cache_lines(8 * words + meshes + fields, &space->held[1]);
    if (buffers == NULL || doubles == NULL) return 0;
    integers = (int64_t *)(doubles + measures[M_DOUBLES]);
    digits = integers + measures[M_INTEGERS];
    space->poses = buffers->poses;
    space->shape_of = buffers->shape_of;
    space->pairs = buffers->pairs;
    space->rows = buffers->rows;
    begin_header(space);
    space->header[DOUBLES_AT] = address_of(doubles);
    space->header[INTEGERS_AT] = address_of(integers);
    space->requests_at = address_of(integers + measures[M_REQUESTS_AT]);
    space->header[DIGITS_AT] = address_of(digits);
    begin_mesh_workspace(space, digits + measures[M_WORKSPACE], measures);
    begin_field_workspace(space, (char *)(digits + measures[M_WORKSPACE]) + meshes, measures);
    begin_pairs(space);
    return 1;
}

collide_status collide_workspace_create(collide_workspace **workspace)
{
    collide_workspace *made;
    const struct collide_kernels *kernels;
    if (workspace == NULL) return COLLIDE_INVALID_ARGUMENT;
    *workspace = NULL;
    if ((kernels = kernels_here()) == NULL) return COLLIDE_NO_KERNELS;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = WORKSPACE_WORD;
    made->kernels = kernels;
    if (!allocate_workspace(made)) {
        collide_workspace_free(made);
        return COLLIDE_NO_MEMORY;
    }
    *workspace = made;
    return COLLIDE_OK;
}

void collide_workspace_free(collide_workspace *workspace)
{
    if (!IS_HANDLE(workspace, WORKSPACE_WORD)) return;
    end_handle(&workspace->word);
    if (workspace->manifold != NULL) free_manifolds(workspace->manifold);
    free(workspace->manifold);
    free(workspace->impact);
    free(workspace->mesh_contacts);
    free_curved_contacts(workspace->curved_contacts);
    collide_mesh_free(workspace->middle);
    free_compound_space(workspace->compound);
    free_compound_contacts(workspace->compound_contacts);
    free_world_space(workspace->world);
    free(workspace->held[0]);
    free(workspace->held[1]);
    free(workspace->held[2]);
    free(workspace);
}

/* --- questions ----------------------------------------------------------------------------------------------------- */

/* The table of a single pair. */
void take_pair(collide_workspace *space, const collide_shape *A, const collide_shape *B)
{
    int order = A == B ? 0 : memcmp(A->content, B->content, sizeof A->content);
    memcpy(space->ints, A->ints, sizeof A->ints);
    memcpy(space->ints + INTS, B->ints, sizeof B->ints);
    memcpy(space->numbers, A->numbers, sizeof A->numbers);
    memcpy(space->numbers + NUMBERS, B->numbers, sizeof B->numbers);
    space->ints[RANK] = order > 0;
    space->ints[INTS + RANK] = order < 0;
    space->header[INTS_AT] = address_of(space->ints);
    space->header[NUMBERS_AT] = address_of(space->numbers);
    space->shape_of[0] = 0; /* a batch of a set may have left others */
    space->shape_of[BLOCK] = 1;
}

/* Number of the first pair from `first` on at which a matrix is no pose. */
static size_t first_bad(collide_workspace *space, const struct question *asked, size_t first)
{
    int64_t pose_at = address_of(space->poses), from = (int64_t)first, n = (int64_t)asked->n;
    int64_t a = space->kernels->first_bad_pose(address_of(asked->X_WA), asked->step_a, from, n, (uint8_t)asked->check, pose_at);
    int64_t b = space->kernels->first_bad_pose(address_of(asked->X_WB), asked->step_b, from, n, (uint8_t)asked->check, pose_at);
    return (size_t)(a < b ? a : b);
}

/* Settle what doubles left open of n rows of the block before: as `_finish` of
   collide/narrowphase/convex_kernel_calls.py. */
static collide_status settle_rows(collide_workspace *space, const struct question *asked, collide_pair *rows, size_t n,
                                  size_t *failed)
{
    const int64_t *header = space->header;
    uint8_t depths = asked->depths && !asked->boolean, boolean = (uint8_t)asked->boolean;
    for (*failed = 0; *failed < n; ++*failed)
        if (rows[*failed].how == REFUSED) return COLLIDE_OUT_OF_RANGE;
    if (space->kernels->settle_exactly(address_of(space->steps), header[INTS_AT], header[NUMBERS_AT], header[POSES_AT],
                                       header[SHAPE_OF_AT], header[PAIRS_AT], (int64_t)n, boolean, depths, asked->limit,
                                       address_of(rows), 0, 0, space->requests_at, header[DIGITS_AT]) > 0)
        space->kernels->settle_by_other_searches(
            header[CORE], header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], 0, header[SHAPE_OF_AT], header[PAIRS_AT],
            (int64_t)n, boolean, depths, asked->limit, address_of(rows), header[DOUBLES_AT], header[INTEGERS_AT],
            header[DIGITS_AT]);
    return COLLIDE_OK;
}

/* Answer all poses into booleans, or into rows that are zeroed. */
static collide_status answer(collide_workspace *space, const struct question *asked, uint8_t *hits, collide_pair *pairs,
                             size_t *failed)
{
    void *out = asked->boolean ? (void *)hits : (void *)pairs;
    size_t done = 0;
    while (done < asked->n) {
        int64_t result = space->kernels->answer_poses(
            address_of(space->header), address_of(asked->which), address_of(asked->X_WA), asked->step_a,
            address_of(asked->X_WB), asked->step_b, (int64_t)done, (int64_t)asked->n, (uint8_t)asked->boolean,
            (uint8_t)(asked->depths && !asked->boolean), asked->limit, (uint8_t)asked->check, address_of(asked->axes),
            address_of(out));
        done = (size_t)space->header[ANSWERED];
        if (result == BAD_POSE) {
            *failed = first_bad(space, asked, done);
            return COLLIDE_INVALID_POSE;
        }
        if (result == OPEN) {
            size_t start = done - 1 - (done - 1) % BLOCK, k, row = 0;
            collide_pair *rows = asked->boolean ? space->rows : pairs + start;
            collide_status status = settle_rows(space, asked, rows, done - start, &row);
            if (status != COLLIDE_OK) {
                *failed = start + row;
                return status;
            }
            for (k = start; asked->boolean && k < done; k++) hits[k] = rows[k - start].hit;
        }
    }
    return COLLIDE_OK;
}

collide_status answer_table(collide_workspace *space, const int64_t *ints, const double *numbers, const struct question *asked,
                            uint8_t *hits, collide_pair *pairs, size_t *failed)
{
    space->header[INTS_AT] = address_of(ints);
    space->header[NUMBERS_AT] = address_of(numbers);
    return answer(space, asked, hits, pairs, failed);
}

/* Body numbers into rows, and out with depths that nobody asked for; a depth without end is told. */
static collide_status close_pairs(collide_workspace *space, const struct question *asked, collide_pair *pairs, size_t *failed)
{
    size_t k;
    if (!space->kernels->finish_rows(address_of(pairs), (int64_t)asked->n, (uint8_t)asked->depths)) return COLLIDE_OK;
    for (k = 0; k < asked->n && pairs[k].distance != -INFINITE; k++) {}
    *failed = k;
    return COLLIDE_ENDLESS_DEPTH;
}

/* --- single calls -------------------------------------------------------------------------------------------------- */

static int are_none(unsigned flags) { return (flags & ~(unsigned)(COLLIDE_TRUST_POSES | COLLIDE_UNSIGNED)) != 0; }

/* One pair at one pair of poses. */
static struct question single(const double *X_WA, const double *X_WB, unsigned flags, int boolean)
{
    struct question asked;
    asked.which = NULL;
    asked.X_WA = X_WA;
    asked.X_WB = X_WB;
    asked.step_a = asked.step_b = 0;
    asked.n = 1;
    asked.boolean = boolean;
    asked.depths = !boolean && !(flags & COLLIDE_UNSIGNED);
    asked.check = !(flags & COLLIDE_TRUST_POSES);
    asked.limit = 0.0;
    asked.axes = NULL;
    return asked;
}

collide_status collide_collide(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                               const double X_WA[16], const double X_WB[16], unsigned flags, int *hit)
{
    collide_status status = COLLIDE_OK;
    rounding given;
    int64_t result;
    if (hit == NULL) return COLLIDE_INVALID_ARGUMENT;
    *hit = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD) || X_WA == NULL || X_WB == NULL || are_none(flags))
        return COLLIDE_INVALID_ARGUMENT;
    given = round_as_kernels_do();
    take_pair(workspace, A, B);
    result = workspace->kernels->collide_single(address_of(workspace->header), address_of(X_WA), address_of(X_WB));
    if (result < 0) {
        struct question asked = single(X_WA, X_WB, flags, 1);
        uint8_t found = 0;
        size_t failed;
        status = answer(workspace, &asked, &found, NULL, &failed);
        result = found;
    }
    round_as_before(given);
    if (status == COLLIDE_OK) *hit = (int)result;
    return status;
}

collide_status collide_distance(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                const double X_WA[16], const double X_WB[16], double max_distance, unsigned flags,
                                collide_pair *pair)
{
    collide_status status = COLLIDE_OK;
    rounding given;
    int64_t result;
    if (pair == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(pair, 0, sizeof *pair);
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD) || X_WA == NULL || X_WB == NULL || are_none(flags) || !(max_distance >= 0.0))
        return COLLIDE_INVALID_ARGUMENT;
    given = round_as_kernels_do();
    take_pair(workspace, A, B);
    result = workspace->kernels->distance_single(address_of(workspace->header), address_of(X_WA), address_of(X_WB),
                                                 address_of(pair), !(flags & COLLIDE_UNSIGNED), max_distance);
    if (result < 0) {
        struct question asked = single(X_WA, X_WB, flags, 0);
        size_t failed;
        asked.limit = max_distance;
        memset(pair, 0, sizeof *pair);
        status = answer(workspace, &asked, NULL, pair, &failed);
        if (status == COLLIDE_OK) status = close_pairs(workspace, &asked, pair, &failed);
    }
    round_as_before(given);
    return status;
}

collide_status meet_of_pair(collide_workspace *space, const double *X_WA, const double *X_WB, unsigned flags)
{
    struct question asked = single(X_WA, X_WB, flags, 1);
    uint8_t hit;
    size_t failed;
    return answer(space, &asked, &hit, NULL, &failed);
}

collide_status unfinished_row_of_pair(collide_workspace *space, const double *X_WA, const double *X_WB, double limit, unsigned flags,
                                      collide_pair *row)
{
    struct question asked = single(X_WA, X_WB, flags, 0);
    size_t failed;
    asked.limit = limit;
    memset(row, 0, sizeof *row);
    return answer(space, &asked, NULL, row, &failed);
}

collide_status row_of_pair(collide_workspace *space, const double *X_WA, const double *X_WB, double limit, unsigned flags,
                           collide_pair *row)
{
    struct question asked = single(X_WA, X_WB, flags, 0);
    collide_status status = unfinished_row_of_pair(space, X_WA, X_WB, limit, flags, row);
    size_t failed;
    return status == COLLIDE_OK ? close_pairs(space, &asked, row, &failed) : status;
}

/* --- batches ------------------------------------------------------------------------------------------------------- */

int take_poses(collide_poses poses, size_t n, const double **matrices, int64_t *step)
{
    *matrices = poses.matrices;
    *step = poses.count == 1 ? 0 : 16;
    return poses.count == n || poses.count == 1 ? poses.matrices != NULL || n == 0 : 0;
}

int take_vectors(collide_vectors vectors, size_t n, const double **xyz, int64_t *step)
{
    *xyz = vectors.xyz;
    *step = vectors.count == 1 ? 0 : 3;
    return vectors.count == n || vectors.count == 1 ? vectors.xyz != NULL || n == 0 : 0;
}

static int are_axes(const double *axes, size_t n)
{
    size_t k;
    for (k = 0; axes != NULL && k < 3 * n; k++)
        if (!(fabs(axes[k]) <= LONGEST_AXIS)) return 0;
    return 1;
}

/* A batch, its arguments but poses, flags and axes checked; the table is taken already. */
static collide_status ask(collide_workspace *space, struct question *asked, collide_poses X_WA, collide_poses X_WB,
                          unsigned flags, uint8_t *hits, collide_pair *pairs, size_t *failed)
{
    collide_status status;
    rounding given;
    size_t blamed = 0;
    asked->boolean = pairs == NULL;
    asked->depths = !asked->boolean && !(flags & COLLIDE_UNSIGNED);
    asked->check = !(flags & COLLIDE_TRUST_POSES);
    if (are_none(flags) || !take_poses(X_WA, asked->n, &asked->X_WA, &asked->step_a) ||
        !take_poses(X_WB, asked->n, &asked->X_WB, &asked->step_b) || !are_axes(asked->axes, asked->n))
        return COLLIDE_INVALID_ARGUMENT;
    if (asked->n == 0) return COLLIDE_OK;
    if (asked->boolean) memset(hits, 0, asked->n);
    else memset(pairs, 0, asked->n * sizeof *pairs);
    given = round_as_kernels_do();
    status = answer(space, asked, hits, pairs, &blamed);
    if (status == COLLIDE_OK && !asked->boolean) status = close_pairs(space, asked, pairs, &blamed);
    round_as_before(given);
    if (failed != NULL) *failed = blamed;
    return status;
}

size_t longer(collide_poses A, collide_poses B)
{
    if (A.count == 0 || B.count == 0) return 0;
    return A.count > B.count ? A.count : B.count;
}

static collide_status ask_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B, collide_poses X_WA,
                                collide_poses X_WB, double limit, unsigned flags, double *axes, uint8_t *hits,
                                collide_pair *pairs, size_t *failed)
{
    struct question asked;
    if (failed != NULL) *failed = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD) || !(limit >= 0.0)) return COLLIDE_INVALID_ARGUMENT;
    take_pair(workspace, A, B);
    asked.which = NULL;
    asked.n = longer(X_WA, X_WB);
    asked.limit = limit;
    asked.axes = axes;
    if (asked.n == 0) return X_WA.count > 1 || X_WB.count > 1 ? COLLIDE_INVALID_ARGUMENT : COLLIDE_OK;
    if (hits == NULL && pairs == NULL) return COLLIDE_INVALID_ARGUMENT;
    return ask(workspace, &asked, X_WA, X_WB, flags, hits, pairs, failed);
}

collide_status collide_collide_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                     collide_poses X_WA, collide_poses X_WB, unsigned flags, double *axes, uint8_t *hits,
                                     size_t *failed)
{
    return ask_batch(workspace, A, B, X_WA, X_WB, 0.0, flags, axes, hits, NULL, failed);
}

collide_status collide_distance_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                      collide_poses X_WA, collide_poses X_WB, double max_distance, unsigned flags,
                                      collide_pair *pairs, size_t *failed)
{
    return ask_batch(workspace, A, B, X_WA, X_WB, max_distance, flags, NULL, NULL, pairs, failed);
}

static collide_status ask_each(collide_workspace *workspace, const collide_shape_set *set, const int64_t *which, size_t n,
                               collide_poses X_WA, collide_poses X_WB, double limit, unsigned flags, double *axes,
                               uint8_t *hits, collide_pair *pairs, size_t *failed)
{
    struct question asked;
    size_t k;
    if (failed != NULL) *failed = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(set, SET_WORD) || !(limit >= 0.0)) return COLLIDE_INVALID_ARGUMENT;
    if (n > 0 && (which == NULL || (hits == NULL && pairs == NULL))) return COLLIDE_INVALID_ARGUMENT;
    for (k = 0; k < 2 * n; k++)
        if (which[k] < 0 || (uint64_t)which[k] >= set->count) {
            if (failed != NULL) *failed = k / 2;
            return COLLIDE_INVALID_ARGUMENT;
        }
    workspace->header[INTS_AT] = address_of(set->ints);
    workspace->header[NUMBERS_AT] = address_of(set->numbers);
    asked.which = which;
    asked.n = n;
    asked.limit = limit;
    asked.axes = axes;
    return ask(workspace, &asked, X_WA, X_WB, flags, hits, pairs, failed);
}

collide_status collide_collide_each(collide_workspace *workspace, const collide_shape_set *set, const int64_t *which, size_t n,
                                    collide_poses X_WA, collide_poses X_WB, unsigned flags, double *axes, uint8_t *hits,
                                    size_t *failed)
{
    return ask_each(workspace, set, which, n, X_WA, X_WB, 0.0, flags, axes, hits, NULL, failed);
}

collide_status collide_distance_each(collide_workspace *workspace, const collide_shape_set *set, const int64_t *which, size_t n,
                                     collide_poses X_WA, collide_poses X_WB, double max_distance, unsigned flags,
                                     collide_pair *pairs, size_t *failed)
{
    return ask_each(workspace, set, which, n, X_WA, X_WB, max_distance, flags, NULL, NULL, pairs, failed);
}
