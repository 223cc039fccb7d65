/* Casts of a convex shape onto another: `shape_cast` of collide/casts/shape_cast.py, by the kernels that `answer_part_pairs` of
   collide/casts/convex_casts.py calls. What Python decides in integers is said to be unsupported. */
#include "capi_casts.h"
#include "capi_contacts.h"

#include <stdlib.h>

typedef char casts_are_rows[sizeof(collide_first_contact) == 88 ? 1 : -1];

struct cast_space *cast_space_of(collide_workspace *space)
{
    int64_t m[CAST_MEASURES];
    struct cast_space *made;
    void *held;
    if (space->cast != NULL) return space->cast;
    if (space->kernels->write_cast_constants(address_of(m), CAST_MEASURES) != CAST_MEASURES || m[K_QUESTION] != CAST_QUESTION ||
        m[K_CAST_ROW] != CAST_ROW || m[K_MARKS] != CAST_MARKS || m[K_PACE_TERMS] != PACE_TERMS || m[K_RAY] != CHORD_RAY ||
        m[K_CHORD_ROW] != CHORD_ROW || m[K_FACET_RAY] != FACET_RAY || m[K_FACET_HIT] != FACET_HIT ||
        m[K_UNION_HEADER] != UNION_HEADER || m[K_UNION_WORK] != UNION_WORK || m[K_UNION_ROW] != UNION_ROW)
        return NULL;
    made = cache_lines(sizeof *made + 8 * (size_t)(m[K_DOUBLES] + m[K_INTEGERS]), &held);
    if (made == NULL) return NULL;
    made->doubles = (double *)(made + 1);
    made->integers = (int64_t *)(made->doubles + m[K_DOUBLES]);
    space->held[2] = held;
    return space->cast = made;
}

int take_direction(const collide_workspace *space, const double direction[3], double vector[3], int64_t *exponent)
{
    int k;
    for (k = 0; k < 3; k++) if (!(fabs(direction[k]) < INFINITE)) return 0;
    return space->kernels->scale_directions(address_of(direction), 1, address_of(vector), address_of(exponent)) == 1;
}

int put_pose(collide_workspace *space, const double *X, unsigned flags, int row)
{
    uint8_t check = !(flags & COLLIDE_TRUST_POSES);
    return space->kernels->first_bad_pose(address_of(X), 0, 0, 1, check, address_of(space->poses + POSE * row)) == 1;
}

/* A cast whose pair is taken, and its poses, which stand in the workspace's block. */
struct cast_question {
    collide_workspace *space;
    const double *X_WA, *X_WB, *direction;
    double limit;
    unsigned flags;
};

static const unsigned CAST_FLAGS = COLLIDE_TRUST_POSES | COLLIDE_START_NORMALS;

/* The kernels' row of a cast, whose status becomes HIT or MISS. */
static collide_status decide(const struct cast_question *asked)
{
    collide_workspace *space = asked->space;
    struct cast_space *cast = space->cast;
    const struct collide_kernels *kernels = space->kernels;
    const int64_t *h = space->header;
    int64_t row_at = address_of(cast->row), marks_at = address_of(cast->marks), listed_at = address_of(&cast->listed);
    int64_t question_at = address_of(cast->question);
    unsigned trust = asked->flags & COLLIDE_TRUST_POSES;
    collide_status status = COLLIDE_OK;
    collide_pair common;
    kernels->cast_pairs(h[INTS_AT], h[NUMBERS_AT], h[POSES_AT], h[SHAPE_OF_AT], h[PAIRS_AT], question_at, 1, row_at,
                        address_of(cast->doubles), address_of(cast->integers));
    if (kernels->list_starts(row_at, marks_at, 1, listed_at) > 0) {
        if ((status = meet_of_pair(space, asked->X_WA, asked->X_WB, trust)) != COLLIDE_OK) return status;
        if (kernels->part_starts(row_at, marks_at, 1, listed_at, 1, h[ROWS_AT]) > 0) {
            status = unfinished_row_of_pair(space, asked->X_WA, asked->X_WB, 0.0, trust | COLLIDE_UNSIGNED, &common);
            if (status != COLLIDE_OK) return status;
            kernels->meet_at_start(row_at, marks_at, 1, listed_at, 1, address_of(&common));
        }
    }
    if (kernels->settle_levels(h[NUMBERS_AT], h[POSES_AT], h[SHAPE_OF_AT], h[PAIRS_AT], question_at, 1, row_at,
                               address_of(cast->terms), listed_at) > 0)
        return COLLIDE_UNSUPPORTED;
    if (kernels->close_casts(h[INTS_AT], h[NUMBERS_AT], h[SHAPE_OF_AT], h[PAIRS_AT], question_at, 1, row_at, marks_at, listed_at) > 0)
        return COLLIDE_UNSUPPORTED;
    return COLLIDE_OK;
}

/* t in units of the direction handed in: it was scaled by a power of two. */
static double unscaled(const struct cast_space *cast, double t) { return ldexp(t, (int)-cast->exponent); }

void begin_contact(collide_first_contact *first)
{
    memset(first, 0, sizeof *first);
    first->distance = first->lower = first->upper = INFINITE;
    first->part_a = first->part_b = -1;
    first->certified = 1;
}

/* What the row says; of bodies in contact at the start their normal as well, where it is wanted. */
static collide_status write_contact(const struct cast_question *asked, collide_first_contact *first)
{
    const struct cast_space *cast = asked->space->cast;
    const double *row = cast->row;
    double value = row[CAST_VALUE];
    collide_status status;
    collide_pair pair;
    begin_contact(first);
    if (row[CAST_STATUS] != CAST_HIT) return COLLIDE_OK;
    if (!(value > row[CAST_LOWER])) value = row[CAST_LOWER]; /* of zeros the bracket's, whose sign is plus */
    if (!(value < row[CAST_UPPER])) value = row[CAST_UPPER];
    first->distance = unscaled(cast, value);
    first->lower = unscaled(cast, row[CAST_LOWER]);
    first->upper = unscaled(cast, row[CAST_UPPER]);
    memcpy(first->normal, row + CAST_NORMAL, sizeof first->normal);
    memcpy(first->point, row + CAST_TOUCHING, sizeof first->point);
    first->part_a = first->part_b = 0;
    first->hit = 1;
    first->certified = cast->marks[IS_CERTIFIED];
    first->at_start = cast->marks[IS_AT_START];
    if (!first->at_start || !(asked->flags & COLLIDE_START_NORMALS)) return COLLIDE_OK;
    status = row_of_pair(asked->space, asked->X_WA, asked->X_WB, INFINITE, asked->flags & COLLIDE_TRUST_POSES, &pair);
    memcpy(first->normal, pair.normal, sizeof first->normal);
    memcpy(first->point, pair.point_b, sizeof first->point);
    return status;
}

static collide_status cast_once(const struct cast_question *asked, collide_first_contact *first)
{
    collide_workspace *space = asked->space;
    collide_status status;
    begin_contact(first);
    if (!take_direction(space, asked->direction, space->cast->question, &space->cast->exponent)) return COLLIDE_INVALID_ARGUMENT;
    if (!put_pose(space, asked->X_WA, asked->flags, 0) || !put_pose(space, asked->X_WB, asked->flags, BLOCK))
        return COLLIDE_INVALID_POSE;
    space->cast->question[CAST_LIMIT] = ldexp(asked->limit, (int)space->cast->exponent);
    if ((status = decide(asked)) == COLLIDE_OK) status = write_contact(asked, first);
    if (status != COLLIDE_OK) begin_contact(first);
    return status;
}

/* Arguments of all casts of a pair, but for poses and directions; the pair is taken. */
static collide_status begin(struct cast_question *asked, collide_workspace *space, const collide_shape *A, const collide_shape *B,
                            double max_distance, unsigned flags)
{
    if (!IS_HANDLE(space, WORKSPACE_WORD) || !IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD) || !(max_distance >= 0.0) || (flags & ~CAST_FLAGS) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (A->ints[KIND] == HALFSPACE) return COLLIDE_UNSUPPORTED;
    if (cast_space_of(space) == NULL) return COLLIDE_NO_MEMORY;
    asked->space = space;
    asked->limit = max_distance;
    asked->flags = flags;
    take_pair(space, A, B);
    return COLLIDE_OK;
}

collide_status collide_cast(collide_workspace *workspace, const collide_shape *A, const collide_shape *B, const double X_WA[16],
                            const double X_WB[16], const double direction[3], double max_distance, unsigned flags,
                            collide_first_contact *first)
{
    struct cast_question asked;
    collide_status status;
    rounding given;
    if (first == NULL) return COLLIDE_INVALID_ARGUMENT;
    begin_contact(first);
    if (X_WA == NULL || X_WB == NULL || direction == NULL) return COLLIDE_INVALID_ARGUMENT;
    if ((status = begin(&asked, workspace, A, B, max_distance, flags)) != COLLIDE_OK) return status;
    asked.X_WA = X_WA;
    asked.X_WB = X_WB;
    asked.direction = direction;
    given = round_as_kernels_do();
    status = cast_once(&asked, first);
    round_as_before(given);
    return status;
}

collide_status collide_cast_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B, collide_poses X_WA,
                                  collide_poses X_WB, collide_vectors directions, double max_distance, unsigned flags,
                                  collide_first_contact *contacts, collide_status *statuses, size_t *failed)
{
    struct cast_question asked;
    const double *of_a, *of_b, *along;
    int64_t step_a, step_b, step_d;
    struct batch_statuses reported = {statuses, COLLIDE_OK, 0};
    size_t n = longer(X_WA, X_WB), k;
    collide_status status;
    rounding given;
    if (failed != NULL) *failed = 0;
    n = n == 0 || directions.count == 0 ? 0 : n > directions.count ? n : directions.count;
    if (!take_poses(X_WA, n, &of_a, &step_a) || !take_poses(X_WB, n, &of_b, &step_b) ||
        !take_vectors(directions, n, &along, &step_d) || (n > 0 && contacts == NULL))
        return COLLIDE_INVALID_ARGUMENT;
    if ((status = begin(&asked, workspace, A, B, max_distance, flags)) != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    for (k = 0; k < n; k++) {
        asked.X_WA = of_a + step_a * (int64_t)k;
        asked.X_WB = of_b + step_b * (int64_t)k;
        asked.direction = along + step_d * (int64_t)k;
        put_status(&reported, k, cast_once(&asked, contacts + k));
    }
    round_as_before(given);
    return end_batch(&reported, failed);
}
