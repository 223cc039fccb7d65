/* Whether two convex shapes come within a margin: `security_margin` of collide/pairs/query.py, by collide/pairs/security_margin.py. */
#include "capi_contacts.h"

#include <stdlib.h>

/* What `split_sum` says (collide/lowering/split_sums.py). */
enum { NOT_KNOWN = -1, NOT_SPLIT, SPLIT };

static int is_stored_hull(const collide_shape *shape) { return shape->ints[KIND] == POINTS && shape->numbers[SLOP] == 0.0; }

/* The same points swept by another ball. */
static collide_status grown(const collide_shape *shape, double radius, collide_shape **out)
{
    size_t n = (size_t)shape->ints[COUNT], padded = (size_t)shape->ints[PADDED], k;
    const double *columns = (const double *)(intptr_t)shape->ints[ADDRESS];
    double *points = malloc(3 * n * sizeof *points);
    collide_status status;
    *out = NULL;
    if (points == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < 3 * n; k++) points[k] = columns[k % 3 * padded + k / 3];
    status = collide_hull(points, n, radius, out);
    free(points);
    return status;
}

/* Whether shapes that share a point exactly where A and B are within the margin do; where none are to be had A and B count as within. */
static collide_status grown_meet(collide_workspace *space, const collide_shape *A, const collide_shape *B, const double *X_WA,
                                 const double *X_WB, double margin, unsigned trust, uint8_t *within)
{
    const collide_shape *shapes[2];
    collide_shape *made[2] = {NULL, NULL};
    double split[2], radii[2] = {0.0, 0.0};
    collide_status status = COLLIDE_OK;
    collide_pair row;
    int are_two, k;
    int64_t outcome;
    shapes[0] = A;
    shapes[1] = B;
    *within = 1;
    for (k = 0; k < 2; k++) {
        if (!is_stored_hull(shapes[k]) && shapes[k]->ints[KIND] != HALFSPACE) return COLLIDE_OK;
        if (is_stored_hull(shapes[k])) radii[k] = shapes[k]->numbers[RADIUS];
    }
    are_two = is_stored_hull(A) && is_stored_hull(B);
    if (!is_stored_hull(A) && !is_stored_hull(B)) return COLLIDE_OK;
    outcome = space->kernels->split_sum(margin, radii[0], radii[1], address_of(split));
    if (outcome == NOT_KNOWN) return COLLIDE_UNSUPPORTED;
    if (outcome == NOT_SPLIT || (split[1] > 0.0 && split[1] < SMALLEST) || split[0] > LARGEST || (!are_two && split[1] != 0.0)) return COLLIDE_OK;
    for (k = 0; k < 2 && status == COLLIDE_OK; k++)
        if (is_stored_hull(shapes[k])) {
            status = grown(shapes[k], are_two && k == 1 ? split[1] : split[0], &made[k]);
            if (made[k] != NULL) shapes[k] = made[k];
        }
    if (status == COLLIDE_OK) {
        take_pair(space, shapes[0], shapes[1]);
        status = row_of_pair(space, X_WA, X_WB, 0.0, trust | COLLIDE_UNSIGNED, &row);
        take_pair(space, A, B);
        *within = row.hit || row.how == COLLIDE_HOW_UNDECIDED;
    }
    collide_shape_free(made[0]);
    collide_shape_free(made[1]);
    return status;
}

collide_status within_by_row(collide_workspace *space, const collide_shape *A, const collide_shape *B, const double *X_WA,
                             const double *X_WB, double margin, unsigned trust, const collide_pair *row, uint8_t *within)
{
    *within = row->hit || row->lower <= margin;
    if (!*within || row->hit || row->upper <= margin) return COLLIDE_OK;
    return grown_meet(space, A, B, X_WA, X_WB, margin, trust, within);
}

static collide_status decide(collide_workspace *space, const collide_shape *A, const collide_shape *B, const double *X_WA,
                             const double *X_WB, double margin, unsigned trust, uint8_t *within)
{
    collide_pair row;
    collide_status status = row_of_pair(space, X_WA, X_WB, margin, trust | COLLIDE_UNSIGNED, &row);
    return status == COLLIDE_OK ? within_by_row(space, A, B, X_WA, X_WB, margin, trust, &row, within) : status;
}

collide_status collide_within(collide_workspace *workspace, const collide_shape *A, const collide_shape *B, collide_poses X_WA,
                              collide_poses X_WB, double margin, unsigned flags, uint8_t *within, size_t *failed)
{
    const double *of_a, *of_b;
    int64_t step_a, step_b;
    size_t n = longer(X_WA, X_WB), k;
    collide_status status = COLLIDE_OK;
    rounding given;
    if (failed != NULL) *failed = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD) || !(margin == 0.0 || (margin >= SMALLEST && margin <= LARGEST)) ||
        (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (margin == 0.0) return collide_collide_batch(workspace, A, B, X_WA, X_WB, flags, NULL, within, failed);
    if (n == 0) return X_WA.count > 1 || X_WB.count > 1 ? COLLIDE_INVALID_ARGUMENT : COLLIDE_OK;
    if (within == NULL || !take_poses(X_WA, n, &of_a, &step_a) || !take_poses(X_WB, n, &of_b, &step_b)) return COLLIDE_INVALID_ARGUMENT;
    memset(within, 0, n);
    given = round_as_kernels_do();
    take_pair(workspace, A, B);
    for (k = 0; k < n && status == COLLIDE_OK; k++)
        status = decide(workspace, A, B, of_a + step_a * (int64_t)k, of_b + step_b * (int64_t)k, margin, flags, within + k);
    round_as_before(given);
    if (failed != NULL && status != COLLIDE_OK) *failed = k - 1;
    return status;
}
