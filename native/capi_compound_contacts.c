/* Contacts of two unions of convex shapes: the single calls of collide/contact/compound_contact_call.py. What these leave to Python is
   said to be unsupported. */
#include "capi_compound.h"
#include "capi_contacts.h"

#include <stdlib.h>

/* Header (collide/contact/compound_contact_call.py): then that of unions, then that of a batch of convex pairs
   (collide/contact/contact_blocks.py). */
enum {
    B_KERNEL, B_N_WANTED, B_WANTED_AT, B_REACH_OF_BOTH, B_COMPOSITE, B_BATCH = B_COMPOSITE + COMPOUND_HEADER,
    B_MANIFOLD = B_BATCH + HEADER, B_WHICH_AT = B_MANIFOLD + MANIFOLD_HEADER, B_XA_AT, B_STEP_A, B_XB_AT, B_STEP_B, B_OF_PAIR_AT, B_IDS_AT,
    B_SLACK_AT, B_OUT_AT, B_CAPACITY, B_ENDS_AT, B_PLACES_AT = B_ENDS_AT + 3, CONTACTS_HEADER = B_PLACES_AT + 4
};
/* What `write_contact_constants` writes (collide/contact/contact_constants.py). */
enum { B_COMPOUND_HEADER = 5, CONTACT_MEASURES = B_COMPOUND_HEADER + 5 };
/* Contacts that a call has space for, besides those of a last pair. */
static const size_t MAX_ROWS = 1024;

struct compound_contact_space {
    int64_t header[CONTACTS_HEADER], places[BLOCK];
    struct manifold_space manifold; /* of which the room is used */
    int64_t serials[2], *faces;
    void *held;                     /* arrays of pairs on the list */
    collide_contact *rows;
    size_t n_rows;
};

void free_compound_contacts(struct compound_contact_space *space)
{
    if (space == NULL) return;
    free_manifolds(&space->manifold);
    free(space->faces);
    free(space->held);
    free(space->rows);
    free(space);
}

static struct compound_contact_space *space_of(collide_workspace *workspace)
{
    size_t list = (size_t)workspace->compound->measures[U_LIST];
    int64_t m[CONTACT_MEASURES], *header;
    struct compound_contact_space *made;
    double *at;
    if (workspace->compound_contacts != NULL) return workspace->compound_contacts;
    if (workspace->kernels->write_contact_constants(address_of(m), CONTACT_MEASURES) != CONTACT_MEASURES ||
        m[B_COMPOUND_HEADER] != CONTACTS_HEADER || (made = calloc(1, sizeof *made)) == NULL)
        return NULL;
    if ((at = cache_lines(8 * list * (16 + 16 + 2 + 1 + 1 + 2), &made->held)) == NULL) {
        free(made);
        return NULL;
    }
    header = made->header;
    header[B_KERNEL] = code_at(&workspace->kernels->contacts_of_pairs);
    header[B_XA_AT] = address_of(at);
    header[B_XB_AT] = address_of(at + 16 * list);
    header[B_STEP_A] = header[B_STEP_B] = 16;
    header[B_WHICH_AT] = address_of(at + 32 * list);
    header[B_SLACK_AT] = address_of(at + 34 * list);
    header[B_ENDS_AT] = address_of(at + 35 * list);
    header[B_WANTED_AT] = address_of(at + 36 * list);
    header[B_PLACES_AT] = address_of(made->places);
    return workspace->compound_contacts = made;
}

/* How far the parts of a union reach from its origin, half-spaces apart. */
static double reach_of(const collide_compound *body)
{
    double reach = 0.0;
    size_t k;
    for (k = 0; k < body->n; k++) {
        const double *t = body->parts + PART * k + 9;
        double own = body->numbers[NUMBERS * k + REACH] + body->numbers[NUMBERS * k + RADIUS] + (fabs(t[0]) + fabs(t[1]) + fabs(t[2]));
        reach = own > reach ? own : reach;
    }
    return reach;
}

/* Room for faces of so many corners, and where all stands. */
static int fit(collide_workspace *workspace, struct compound_contact_space *space, int64_t largest)
{
    const struct compound_space *unions = workspace->compound;
    int64_t *header = space->header, *manifold = header + B_MANIFOLD;
    size_t n_rows = MAX_ROWS + 2 * (size_t)largest + 8;
    if (!fit_manifolds(&space->manifold, largest)) return 0;
    if (space->n_rows < n_rows) {
        collide_contact *rows = calloc(n_rows, sizeof *rows);
        if (rows == NULL) return 0;
        free(space->rows);
        space->rows = rows;
        space->n_rows = n_rows;
    }
    memcpy(header + B_COMPOSITE, unions->header, sizeof unions->header);
    memcpy(header + B_BATCH, workspace->header, sizeof workspace->header);
    header[B_BATCH + INTS_AT] = manifold[F_INTS_AT] = unions->header[U_INTS_AT];
    header[B_BATCH + NUMBERS_AT] = manifold[F_NUMBERS_AT] = unions->header[U_NUMBERS_AT];
    manifold[F_FACES_AT] = address_of(space->faces);
    manifold[F_POSES_AT] = address_of(workspace->poses);
    manifold[F_SHAPE_OF_AT] = address_of(workspace->shape_of);
    manifold[F_DOUBLES_AT] = space->manifold.header[HEADER + F_DOUBLES_AT];
    manifold[F_INTEGERS_AT] = space->manifold.header[HEADER + F_INTEGERS_AT];
    manifold[F_LARGEST] = space->manifold.header[HEADER + F_LARGEST];
    header[B_CAPACITY] = (int64_t)n_rows;
    return 1;
}

/* The pair's tables, and a row for the faces of every part, made when they are missed. */
static collide_status take_pair_of_unions(collide_workspace *workspace, const collide_compound *A, const collide_compound *B)
{
    collide_status status = take_compounds(workspace, A, B);
    struct compound_contact_space *space = status == COLLIDE_OK ? space_of(workspace) : NULL;
    double reach = reach_of(A) + reach_of(B);
    if (status != COLLIDE_OK) return status;
    if (space == NULL) return COLLIDE_NO_MEMORY;
    if (space->serials[0] != A->serial || space->serials[1] != B->serial) {
        int64_t *faces = calloc((A->n + B->n) * FACE_INTS, sizeof *faces);
        if (faces == NULL) return COLLIDE_NO_MEMORY;
        free(space->faces);
        space->faces = faces;
        space->serials[0] = A->serial;
        space->serials[1] = B->serial;
    }
    memcpy(space->header + B_REACH_OF_BOTH, &reach, sizeof reach);
    return fit(workspace, space, ROUND_CORNERS) ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

/* The faces of the parts that the last call missed. */
static collide_status make_missing(collide_workspace *workspace, const collide_compound *A, const collide_compound *B)
{
    struct compound_contact_space *space = workspace->compound_contacts;
    const int64_t *wanted = (const int64_t *)(intptr_t)space->header[B_WANTED_AT];
    int64_t largest = ROUND_CORNERS, k, n = space->header[B_N_WANTED];
    for (k = 0; k < n; k++) {
        size_t part = (size_t)wanted[k];
        const struct hull_faces *faces;
        collide_status status = faces_of(part < A->n ? A->shapes[part] : B->shapes[part - A->n], &faces);
        if (status != COLLIDE_OK) return status;
        if (faces == NULL) continue;
        memcpy(space->faces + FACE_INTS * part, faces->ints, sizeof faces->ints);
        largest = faces->largest > largest ? faces->largest : largest;
    }
    return fit(workspace, space, largest) ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

/* How many contacts there are; -1 where they are left to Python. */
static collide_status ask(collide_workspace *workspace, const collide_compound *A, const collide_compound *B, const double *X_WA,
                          const double *X_WB, double margin, size_t max_contacts, int64_t *n)
{
    struct compound_contact_space *space = workspace->compound_contacts;
    collide_status status;
    do {
        *n = workspace->kernels->contacts_single_compound(address_of(space->header), address_of(X_WA), address_of(X_WB),
                                                          address_of(space->rows), (int64_t)max_contacts, margin);
        if (*n >= 0 || space->header[B_N_WANTED] == 0) return COLLIDE_OK;
        status = make_missing(workspace, A, B);
    } while (status == COLLIDE_OK);
    return status;
}

collide_status collide_compound_contacts(collide_workspace *workspace, const collide_compound *A, const collide_compound *B,
                                         const double X_WA[16], const double X_WB[16], double margin, size_t max_contacts,
                                         unsigned flags, collide_contact *contacts, size_t capacity, size_t *count)
{
    collide_status status;
    rounding given;
    uint8_t check = !(flags & COLLIDE_TRUST_POSES);
    int64_t n;
    if (count == NULL) return COLLIDE_INVALID_ARGUMENT;
    *count = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(A, COMPOUND_WORD) || !IS_HANDLE(B, COMPOUND_WORD) || X_WA == NULL || X_WB == NULL || !(margin >= 0.0 && margin <= LARGEST) ||
        max_contacts == 0 || (contacts == NULL && capacity > 0) || (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (A->is_whole && B->is_whole) {
        if (capacity < max_contacts) max_contacts = capacity;
        if (max_contacts == 0) return COLLIDE_TOO_MANY;
        return collide_contacts(workspace, A->shapes[0], B->shapes[0], X_WA, X_WB, margin, max_contacts, flags, contacts, count);
    }
    if (max_contacts > 0x7fffffff) max_contacts = 0x7fffffff;
    if ((status = take_pair_of_unions(workspace, A, B)) != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    status = ask(workspace, A, B, X_WA, X_WB, margin, max_contacts, &n);
    if (status == COLLIDE_OK && n < 0) {
        int64_t pose_at = address_of(workspace->poses);
        status = workspace->kernels->first_bad_pose(address_of(X_WA), 0, 0, 1, check, pose_at) == 0 ||
                         workspace->kernels->first_bad_pose(address_of(X_WB), 0, 0, 1, check, pose_at) == 0
                     ? COLLIDE_INVALID_POSE : COLLIDE_UNSUPPORTED;
    } else if (status == COLLIDE_OK) {
        *count = (size_t)n;
        hand_out_contacts(workspace->compound_contacts->rows, *count, contacts, capacity);
        if (*count > capacity) status = COLLIDE_TOO_MANY;
    }
    round_as_before(given);
    return status;
}
