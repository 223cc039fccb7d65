/* Contacts of two convex sets: as `contacts_single` of collide/contact/single_contact_call.py, and its long way. */
#include "capi_contacts.h"

#include <stdlib.h>
#include <string.h>

typedef char contacts_are_rows[sizeof(collide_contact) == 144 ? 1 : -1];

void begin_manifolds(struct manifold_space *manifold, collide_workspace *space)
{
    int64_t *header = manifold->header + HEADER;
    memcpy(manifold->header, space->header, sizeof space->header);
    manifold->header[INTS_AT] = header[F_INTS_AT] = address_of(space->ints);
    manifold->header[NUMBERS_AT] = header[F_NUMBERS_AT] = address_of(space->numbers);
    header[F_FACES_AT] = address_of(manifold->faces);
    header[F_POSES_AT] = address_of(manifold->poses);
    header[F_SHAPE_OF_AT] = address_of(manifold->shape_of);
    manifold->shape_of[1] = 1;
}

void free_manifolds(struct manifold_space *manifold)
{
    free(manifold->held);
    manifold->held = NULL;
    manifold->header[HEADER + F_LARGEST] = 0;
}

int fit_manifolds(struct manifold_space *manifold, int64_t largest)
{
    /* `workspace_doubles` and `workspace_integers` of collide/contact/convex_manifolds.py */
    size_t corners = 2 * (size_t)largest + 8, doubles = 6 * (size_t)largest + 8 * corners;
    size_t integers = 4 * (size_t)largest + 5 * corners;
    void *memory;
    if (manifold->header[HEADER + F_LARGEST] >= largest && manifold->held != NULL) return 1;
    if ((memory = calloc(doubles + integers, 8)) == NULL) return 0;
    free(manifold->held);
    manifold->held = memory;
    manifold->header[HEADER + F_LARGEST] = largest;
    manifold->header[HEADER + F_DOUBLES_AT] = address_of(memory);
    manifold->header[HEADER + F_INTEGERS_AT] = address_of((double *)memory + doubles);
    return 1;
}

void take_table_pair(collide_workspace *space, struct manifold_space *manifold, const int64_t *ints, const double *numbers,
                     const int64_t *faces, int64_t a, int64_t b)
{
    const int64_t which[2] = {a, b};
    int k;
    for (k = 0; k < 2; k++) {
        memcpy(space->ints + INTS * k, ints + INTS * which[k], INTS * sizeof *ints);
        memcpy(space->numbers + NUMBERS * k, numbers + NUMBERS * which[k], NUMBERS * sizeof *numbers);
        memcpy(manifold->faces + FACE_INTS * k, faces + FACE_INTS * which[k], FACE_INTS * sizeof *faces);
    }
    space->header[INTS_AT] = address_of(space->ints);
    space->header[NUMBERS_AT] = address_of(space->numbers);
    space->shape_of[0] = 0; /* a batch of a set may have left others */
    space->shape_of[BLOCK] = 1;
}

/* What the single call leaves: the row by all means there are, then the same manifold. */
static collide_status contacts_by_rows(collide_workspace *space, struct manifold_space *manifold, const double *X_WA,
                                       const double *X_WB, double margin, int64_t max_contacts, unsigned flags,
                                       collide_contact *rows, int64_t *n)
{
    int64_t *header = manifold->header + HEADER;
    collide_pair row;
    collide_status status = row_of_pair(space, X_WA, X_WB, margin, flags, &row);
    if (status != COLLIDE_OK) return status;
    manifold->shape_of[0] = 0;
    manifold->shape_of[1] = 1;
    *n = space->kernels->manifold_of_row(address_of(header), address_of(X_WA), address_of(X_WB), address_of(&row), margin, max_contacts,
                                         address_of(rows));
    return COLLIDE_OK;
}

collide_status contacts_of_pair(collide_workspace *space, struct manifold_space *manifold, const double *X_WA, const double *X_WB,
                                double margin, int64_t max_contacts, unsigned flags, collide_contact *rows, int64_t *n)
{
    collide_status status = COLLIDE_OK;
    rounding given = round_as_kernels_do();
    *n = space->kernels->contacts_single(address_of(manifold->header), address_of(X_WA), address_of(X_WB), address_of(rows),
                                         max_contacts, margin);
    if (*n < 0) {
        *n = 0;
        status = contacts_by_rows(space, manifold, X_WA, X_WB, margin, max_contacts, flags, rows, n);
    }
    round_as_before(given);
    return status;
}

int is_farther_apart(collide_workspace *space, const double *X_WA, const double *X_WB, double gap, double direction[3])
{
    collide_pair row;
    rounding given = round_as_kernels_do();
    int64_t result;
    memset(&row, 0, sizeof row);
    result = space->kernels->answer_poses(address_of(space->header), 0, address_of(X_WA), 0, address_of(X_WB), 0, 0, 1, 0, 0, gap,
                                          1, 0, address_of(&row));
    round_as_before(given);
    memcpy(direction, row.normal, sizeof row.normal);
    return result == 0 && row.how != COLLIDE_HOW_UNDECIDED && row.lower > gap;
}
