/* Casts of a union of convex shapes onto another, by the kernel of collide/casts/union_cast.py. What it leaves to Python is said to be
   unsupported. */
#include "capi_casts.h"
#include "capi_compound.h"

typedef char headers_agree[(int)UNION_HEADER == (int)UNION_CASTS + (int)COMPOUND_HEADER ? 1 : -1];

/* Pairs of parts that a cast may take: of bodies of few pairs, and of others (collide/narrowphase/composite/composite.py). */
enum { MAX_AT_ONCE = 1024, MAX_OF_MANY = 256 };

static int has_halfspace(const collide_compound *body)
{
    size_t k;
    for (k = 0; k < body->n; k++) if (body->ints[INTS * k + KIND] == HALFSPACE) return 1;
    return 0;
}

/* The header of the pair taken. */
static void fill_header(collide_workspace *space, const collide_compound *A, const collide_compound *B)
{
    struct cast_space *cast = space->cast;
    int64_t *header = cast->union_header;
    header[0] = code_at(&space->kernels->cast_pairs);
    header[1] = address_of(cast->doubles);
    header[2] = address_of(cast->integers);
    header[3] = address_of(cast->union_work);
    memcpy(header + UNION_CASTS, space->compound->header, sizeof space->compound->header);
    header[UNION_CASTS + U_AT_ONCE] = A->n <= MAX_AT_ONCE && A->n * B->n <= MAX_AT_ONCE ? MAX_AT_ONCE : MAX_OF_MANY;
}

static void write_union_contact(const double *row, collide_first_contact *first)
{
    first->distance = row[UNION_T];
    first->lower = row[UNION_T + 1];
    first->upper = row[UNION_T + 2];
    memcpy(first->normal, row + UNION_NORMAL, sizeof first->normal);
    memcpy(first->point, row + UNION_POINT, sizeof first->point);
    first->part_a = (int32_t)row[UNION_PART_A];
    first->part_b = (int32_t)row[UNION_PART_B];
    first->at_start = row[UNION_AT_START] != 0.0;
    first->hit = 1;
}

collide_status collide_compound_cast(collide_workspace *workspace, const collide_compound *A, const collide_compound *B,
                                     const double X_WA[16], const double X_WB[16], const double direction[3], double max_distance,
                                     unsigned flags, collide_first_contact *first)
{
    struct cast_space *cast;
    collide_status status;
    rounding given;
    double vector[3];
    if (first == NULL) return COLLIDE_INVALID_ARGUMENT;
    begin_contact(first);
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(A, COMPOUND_WORD) || !IS_HANDLE(B, COMPOUND_WORD) || X_WA == NULL || X_WB == NULL || direction == NULL || !(max_distance >= 0.0) ||
        (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (A->is_whole && B->is_whole)
        return collide_cast(workspace, A->shapes[0], B->shapes[0], X_WA, X_WB, direction, max_distance, flags, first);
    if (has_halfspace(A)) return COLLIDE_UNSUPPORTED;
    if ((status = take_compounds(workspace, A, B)) != COLLIDE_OK) return status;
    if ((cast = cast_space_of(workspace)) == NULL) return COLLIDE_NO_MEMORY;
    fill_header(workspace, A, B);
    given = round_as_kernels_do();
    if (!take_direction(workspace, direction, vector, &cast->exponent)) status = COLLIDE_INVALID_ARGUMENT;
    else if (!put_pose(workspace, X_WA, flags, 0) || !put_pose(workspace, X_WB, flags, BLOCK)) status = COLLIDE_INVALID_POSE;
    else {
        int64_t met = workspace->kernels->cast_single_union(address_of(cast->union_header), address_of(X_WA), address_of(X_WB),
                                                            address_of(direction), max_distance, address_of(cast->union_row));
        if (met < 0) status = COLLIDE_UNSUPPORTED;
        else if (met > 0) write_union_contact(cast->union_row, first);
    }
    round_as_before(given);
    return status;
}
