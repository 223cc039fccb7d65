/* Two unions of convex shapes at many pairs of poses: `answer_compound_batch` of collide/narrowphase/composite/composite.py. */
#include "capi_compound.h"
#include "capi_contacts.h"

/* A question about n pairs of poses, as of capi_pairs.c, of the pair taken. */
static collide_status settle_list(collide_workspace *space, const struct question *asked, uint8_t boolean, uint8_t depths)
{
    struct compound_space *unions = space->compound;
    const int64_t *h = unions->header;
    const collide_pair *rows = (const collide_pair *)(intptr_t)h[U_ROWS_AT];
    int64_t n = h[U_N_LISTED], n_terms = 2 * BLOCK + h[U_CAPACITY], k;
    for (k = 0; k < n; k++) if (rows[k].how == REFUSED) return COLLIDE_OUT_OF_RANGE;
    if (space->kernels->settle_exactly(address_of(space->steps), h[U_INTS_AT], h[U_NUMBERS_AT], h[U_POSES_AT], h[U_SHAPE_OF_AT],
                                       h[U_PAIRS_AT], n, boolean, depths, asked->limit, h[U_ROWS_AT], h[U_TERMS_AT], n_terms,
                                       space->requests_at, space->header[DIGITS_AT]) > 0)
        space->kernels->settle_by_other_searches(h[U_CORE], h[U_INTS_AT], h[U_NUMBERS_AT], h[U_POSES_AT], h[U_TERMS_AT], h[U_SHAPE_OF_AT],
                                                 h[U_PAIRS_AT], n, boolean, depths, asked->limit, h[U_ROWS_AT], h[U_DOUBLES_AT],
                                                 h[U_INTEGERS_AT], space->header[DIGITS_AT]);
    return COLLIDE_OK;
}

/* Number of the first pair at which a matrix is no pose. */
static size_t first_bad(collide_workspace *space, const struct question *asked)
{
    int64_t pose_at = address_of(space->poses), n = (int64_t)asked->n;
    int64_t a = space->kernels->first_bad_pose(address_of(asked->X_WA), asked->step_a, 0, n, (uint8_t)asked->check, pose_at);
    int64_t b = space->kernels->first_bad_pose(address_of(asked->X_WB), asked->step_b, 0, n, (uint8_t)asked->check, pose_at);
    return (size_t)(a < b ? a : b);
}

static collide_status answer(collide_workspace *space, const struct question *asked, void *out, size_t *failed)
{
    struct compound_space *unions = space->compound;
    uint8_t boolean = (uint8_t)asked->boolean, depths = (uint8_t)(asked->depths && !asked->boolean);
    collide_status status = COLLIDE_OK;
    int64_t result;
    memset(unions->header + U_N_DONE, 0, (COMPOUND_HEADER - U_N_DONE) * sizeof *unions->header);
    while ((result = space->kernels->answer_compounds(
                address_of(unions->header), 0, address_of(asked->X_WA), asked->step_a, address_of(asked->X_WB), asked->step_b,
                (int64_t)asked->n, boolean, depths, asked->limit, (uint8_t)asked->check, 0, address_of(out))) == OPEN &&
           status == COLLIDE_OK) {
        status = settle_list(space, asked, boolean, depths);
        if (status != COLLIDE_OK) return status;
    }
    if (result == BAD_POSE) {
        *failed = first_bad(space, asked);
        return COLLIDE_INVALID_POSE;
    }
    return COLLIDE_OK;
}

/* The arguments of a batch, but for what its poses are. */
static collide_status begin(struct question *asked, collide_workspace *space, const collide_compound *A, const collide_compound *B,
                            collide_poses X_WA, collide_poses X_WB, double limit, unsigned flags, const void *out)
{
    if (!IS_HANDLE(space, WORKSPACE_WORD) || !IS_HANDLE(A, COMPOUND_WORD) || !IS_HANDLE(B, COMPOUND_WORD) || !(limit >= 0.0) ||
        (flags & ~(unsigned)(COLLIDE_TRUST_POSES | COLLIDE_UNSIGNED)) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    memset(asked, 0, sizeof *asked);
    asked->n = longer(X_WA, X_WB);
    if (asked->n == 0) return X_WA.count > 1 || X_WB.count > 1 ? COLLIDE_INVALID_ARGUMENT : COLLIDE_OK;
    if (out == NULL || !take_poses(X_WA, asked->n, &asked->X_WA, &asked->step_a) ||
        !take_poses(X_WB, asked->n, &asked->X_WB, &asked->step_b))
        return COLLIDE_INVALID_ARGUMENT;
    asked->limit = limit;
    asked->check = !(flags & COLLIDE_TRUST_POSES);
    asked->depths = !(flags & COLLIDE_UNSIGNED);
    return A->is_whole && B->is_whole ? COLLIDE_OK : take_compounds(space, A, B);
}

collide_status collide_compound_collide(collide_workspace *workspace, const collide_compound *A, const collide_compound *B,
                                        collide_poses X_WA, collide_poses X_WB, unsigned flags, uint8_t *hits, size_t *failed)
{
    struct question asked;
    size_t blamed = 0;
    collide_status status = begin(&asked, workspace, A, B, X_WA, X_WB, 0.0, flags, hits);
    rounding given;
    if (failed != NULL) *failed = 0;
    if (status != COLLIDE_OK || asked.n == 0) return status;
    if (A->is_whole && B->is_whole)
        return collide_collide_batch(workspace, A->shapes[0], B->shapes[0], X_WA, X_WB, flags, NULL, hits, failed);
    asked.boolean = 1;
    memset(hits, 0, asked.n);
    given = round_as_kernels_do();
    status = answer(workspace, &asked, hits, &blamed);
    round_as_before(given);
    if (failed != NULL) *failed = blamed;
    return status;
}

collide_status collide_compound_distance(collide_workspace *workspace, const collide_compound *A, const collide_compound *B,
                                         collide_poses X_WA, collide_poses X_WB, double max_distance, unsigned flags,
                                         collide_pair *pairs, size_t *failed)
{
    struct question asked;
    size_t blamed = 0;
    collide_status status = begin(&asked, workspace, A, B, X_WA, X_WB, max_distance, flags, pairs);
    rounding given;
    if (failed != NULL) *failed = 0;
    if (status != COLLIDE_OK || asked.n == 0) return status;
    if (A->is_whole && B->is_whole)
        return collide_distance_batch(workspace, A->shapes[0], B->shapes[0], X_WA, X_WB, max_distance, flags, pairs, failed);
    memset(pairs, 0, asked.n * sizeof *pairs);
    given = round_as_kernels_do();
    status = answer(workspace, &asked, pairs, &blamed);
    if (status == COLLIDE_OK && workspace->kernels->finish_rows(address_of(pairs), (int64_t)asked.n, (uint8_t)asked.depths)) {
        while (blamed < asked.n && pairs[blamed].distance != -INFINITE) blamed++;
        status = COLLIDE_ENDLESS_DEPTH;
    }
    round_as_before(given);
    if (failed != NULL) *failed = blamed;
    return status;
}
