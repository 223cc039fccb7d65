/* `collide_contacts` and its batches: as `contacts` of collide/contact/contact_query.py answers of convex shapes. */
#include "capi_contacts.h"

#include <stdlib.h>

/* More contacts than a pair can have, and a number that kernels take. */
static const size_t ALL_CONTACTS = 0x7fffffff;

/* A question about contacts, its arguments but poses checked. */
struct contact_question {
    double margin;
    size_t max_contacts, capacity;
    unsigned flags;
    collide_contact *contacts;
};

/* The workspace's own room for manifolds; NULL where there is no memory. */
static struct manifold_space *manifold_of(collide_workspace *space)
{
    if (space->manifold != NULL) return space->manifold;
    if ((space->manifold = calloc(1, sizeof *space->manifold)) != NULL) begin_manifolds(space->manifold, space);
    return space->manifold;
}

/* Two shapes and their faces. */
static collide_status take_shapes(collide_workspace *space, struct manifold_space *manifold, const collide_shape *A,
                                  const collide_shape *B)
{
    const collide_shape *shapes[2];
    const struct hull_faces *faces;
    int64_t largest = ROUND_CORNERS;
    int k;
    shapes[0] = A;
    shapes[1] = B;
    take_pair(space, A, B);
    for (k = 0; k < 2; k++) {
        collide_status status = faces_of(shapes[k], &faces);
        int64_t *row = manifold->faces + FACE_INTS * k;
        int j;
        if (status != COLLIDE_OK) return status;
        for (j = 0; j < FACE_INTS; j++) row[j] = faces != NULL ? faces->ints[j] : 0;
        if (faces != NULL && faces->largest > largest) largest = faces->largest;
    }
    return fit_manifolds(manifold, largest) ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

/* Whether arguments are within their ranges, but for poses. */
static int are_good(const collide_workspace *workspace, struct contact_question *asked)
{
    if (asked->max_contacts > ALL_CONTACTS) asked->max_contacts = ALL_CONTACTS;
    return IS_HANDLE(workspace, WORKSPACE_WORD) && asked->margin >= 0.0 && asked->margin <= LARGEST && asked->max_contacts > 0 &&
           (asked->flags & ~(unsigned)COLLIDE_TRUST_POSES) == 0;
}

static collide_status one_pair(collide_workspace *space, const struct contact_question *asked, const double *X_WA,
                               const double *X_WB, size_t first, size_t *count)
{
    struct manifold_space *manifold = space->manifold;
    int64_t n = 0, most = 2 * manifold->header[HEADER + F_LARGEST] + 8;
    collide_status status;
    if (asked->capacity - first < asked->max_contacts && asked->capacity - first < (size_t)most) return COLLIDE_TOO_MANY;
    status = contacts_of_pair(space, manifold, X_WA, X_WB, asked->margin, (int64_t)asked->max_contacts, asked->flags,
                              asked->contacts + first, &n);
    *count = status == COLLIDE_OK ? (size_t)n : 0;
    return status;
}

collide_status contacts_of_shapes(collide_workspace *space, const collide_shape *A, const collide_shape *B, const double *X_WA,
                                  const double *X_WB, double margin, size_t max_contacts, unsigned flags,
                                  collide_contact *rows, size_t capacity, size_t *count)
{
    struct contact_question asked;
    collide_status status;
    asked.margin = margin;
    asked.max_contacts = max_contacts;
    asked.capacity = capacity;
    asked.flags = flags;
    asked.contacts = rows;
    if (!are_good(space, &asked)) return COLLIDE_INVALID_ARGUMENT;
    if (manifold_of(space) == NULL) return COLLIDE_NO_MEMORY;
    if ((status = take_shapes(space, space->manifold, A, B)) != COLLIDE_OK) return status;
    return one_pair(space, &asked, X_WA, X_WB, 0, count);
}

collide_status collide_contacts(collide_workspace *workspace, const collide_shape *A, const collide_shape *B, const double X_WA[16],
                                const double X_WB[16], double margin, size_t max_contacts, unsigned flags,
                                collide_contact *contacts, size_t *count)
{
    if (count == NULL) return COLLIDE_INVALID_ARGUMENT;
    *count = 0;
    if (!IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD) || X_WA == NULL || X_WB == NULL || contacts == NULL) return COLLIDE_INVALID_ARGUMENT;
    return contacts_of_shapes(workspace, A, B, X_WA, X_WB, margin, max_contacts, flags, contacts, max_contacts, count);
}

/* shapes, which : of a set; or A and B in `shapes`, and NULL. */
static collide_status all_pairs(collide_workspace *space, const struct contact_question *asked, const collide_shape *const *shapes,
                                const int64_t *which, size_t n, collide_poses X_WA, collide_poses X_WB, size_t *starts, size_t *failed)
{
    const double *of_a, *of_b;
    int64_t step_a, step_b;
    size_t k, count;
    collide_status status;
    if (starts == NULL) return COLLIDE_INVALID_ARGUMENT;
    starts[0] = 0;
    if (!take_poses(X_WA, n, &of_a, &step_a) || !take_poses(X_WB, n, &of_b, &step_b)) return COLLIDE_INVALID_ARGUMENT;
    if (n > 0 && asked->contacts == NULL) return COLLIDE_INVALID_ARGUMENT;
    if (manifold_of(space) == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < n; k++) {
        status = COLLIDE_OK;
        if (which != NULL) status = take_shapes(space, space->manifold, shapes[which[2 * k]], shapes[which[2 * k + 1]]);
        else if (k == 0) status = take_shapes(space, space->manifold, shapes[0], shapes[1]);
        if (status == COLLIDE_OK)
            status = one_pair(space, asked, of_a + step_a * (int64_t)k, of_b + step_b * (int64_t)k, starts[k], &count);
        if (status != COLLIDE_OK) {
            if (failed != NULL) *failed = k;
            return status;
        }
        starts[k + 1] = starts[k] + count;
    }
    return COLLIDE_OK;
}

collide_status collide_contacts_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                      collide_poses X_WA, collide_poses X_WB, double margin, size_t max_contacts, unsigned flags,
                                      collide_contact *contacts, size_t capacity, size_t *starts, size_t *failed)
{
    struct contact_question asked;
    const collide_shape *shapes[2];
    size_t n = longer(X_WA, X_WB);
    if (failed != NULL) *failed = 0;
    asked.margin = margin;
    asked.max_contacts = max_contacts;
    asked.capacity = capacity;
    asked.flags = flags;
    asked.contacts = contacts;
    if (!are_good(workspace, &asked) || !IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if (n == 0 && (X_WA.count > 1 || X_WB.count > 1)) return COLLIDE_INVALID_ARGUMENT;
    shapes[0] = A;
    shapes[1] = B;
    if (n == 0) X_WA.count = X_WB.count = 0;
    return all_pairs(workspace, &asked, shapes, NULL, n, X_WA, X_WB, starts, failed);
}

collide_status collide_contacts_each(collide_workspace *workspace, const collide_shape_set *set, const int64_t *which, size_t n,
                                     collide_poses X_WA, collide_poses X_WB, double margin, size_t max_contacts, unsigned flags,
                                     collide_contact *contacts, size_t capacity, size_t *starts, size_t *failed)
{
    struct contact_question asked;
    size_t k;
    if (failed != NULL) *failed = 0;
    asked.margin = margin;
    asked.max_contacts = max_contacts;
    asked.capacity = capacity;
    asked.flags = flags;
    asked.contacts = contacts;
    if (!are_good(workspace, &asked) || !IS_HANDLE(set, SET_WORD) || (n > 0 && which == NULL)) return COLLIDE_INVALID_ARGUMENT;
    for (k = 0; k < 2 * n; k++)
        if (which[k] < 0 || (uint64_t)which[k] >= set->count) {
            if (failed != NULL) *failed = k / 2;
            return COLLIDE_INVALID_ARGUMENT;
        }
    return all_pairs(workspace, &asked, set->shapes, which, n, X_WA, X_WB, starts, failed);
}
