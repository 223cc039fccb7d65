/* Times of impact of two convex shapes: `time_of_impact` of collide/motion/impact_query.py, whose search is `find_impacts`. */
#include "capi_casts.h"
#include "capi_contacts.h"

#include <stdlib.h>

/* Header, job, part, body and row of the search (collide/motion/impact_jobs.py, moving_body.py), and how it ends. */
enum {
    I_CORE, I_INTS_AT, I_NUMBERS_AT, I_POSES_AT, I_SHAPE_OF_AT, I_PAIR_AT, I_DOUBLES_AT, I_INTEGERS_AT, I_BODIES_AT, I_ROW_AT, I_PROBE_AT,
    I_PARTS_AT, I_N_PARTS, XA0_AT, XA1_AT, XB0_AT, XB1_AT, I_OMEGA_A_AT = XB1_AT + 5, I_OMEGA_B_AT, I_N_SHAPES = I_OMEGA_B_AT + 3,
    IMPACT_HEADER
};
enum { IMPACT_JOB = 5, IMPACT_PART = 19, MOVING_BODY = 35 };
enum { MOTION_FREE, MOTION_CONTACT, MOTION_OPEN, MOTION_OPEN_START, MOTION_TOO_SMALL, MOTION_WRONG_TURN };
/* What `write_impact_constants` writes (collide/motion/impact_constants.py). */
enum { I_HEADER, I_JOB, I_PART, I_BODY, I_ANSWER, I_LARGEST_ANGLE, IMPACT_MEASURES };
/* Brackets that may be asked for [unit time]. */
static const double LEAST_TOLERANCE = 1e-14, LARGEST_TOLERANCE = 1.0;

struct impact_row {
    double lower, upper, normal[3], point_a[3], point_b[3];
    int32_t part_a, part_b, queries, status;
};

typedef char times_are_rows[sizeof(collide_time_of_impact) == 112 && sizeof(struct impact_row) == 104 ? 1 : -1];

struct impact_space {
    int64_t header[IMPACT_HEADER], job[IMPACT_JOB], shape_of[2], pair[2], measures[IMPACT_MEASURES];
    double parts[2 * IMPACT_PART], poses[2 * POSE], bodies[2 * MOVING_BODY];
    collide_pair rows[2];
    struct impact_row row;
};

/* The workspace's room, made at the first motion; NULL where there is no memory, or the library's parts do not fit. */
static struct impact_space *impact_space_of(collide_workspace *space)
{
    struct impact_space *made;
    const int64_t *m;
    int k;
    if (space->impact != NULL) return space->impact;
    if ((made = calloc(1, sizeof *made)) == NULL) return NULL;
    m = made->measures;
    if (space->kernels->write_impact_constants(address_of(m), IMPACT_MEASURES) != IMPACT_MEASURES || m[I_HEADER] != IMPACT_HEADER ||
        m[I_JOB] != IMPACT_JOB || m[I_PART] != IMPACT_PART || m[I_BODY] != MOVING_BODY || m[I_ANSWER] != (int64_t)sizeof made->row) {
        free(made);
        return NULL;
    }
    made->pair[1] = 1;
    for (k = 0; k < 6; k++) made->parts[k / 3 * IMPACT_PART + k % 3 * 4] = 1.0; /* parts stand where their bodies do */
    made->job[3] = made->job[4] = 1;
    made->header[I_CORE] = space->header[CORE];
    made->header[I_INTS_AT] = address_of(space->ints);
    made->header[I_NUMBERS_AT] = address_of(space->numbers);
    made->header[I_POSES_AT] = address_of(made->poses);
    made->header[I_SHAPE_OF_AT] = address_of(made->shape_of);
    made->header[I_PAIR_AT] = address_of(made->pair);
    made->header[I_DOUBLES_AT] = space->header[DOUBLES_AT];
    made->header[I_INTEGERS_AT] = space->header[INTEGERS_AT];
    made->header[I_BODIES_AT] = address_of(made->bodies);
    made->header[I_ROW_AT] = address_of(made->rows);
    made->header[I_PROBE_AT] = address_of(made->rows + 1);
    made->header[I_PARTS_AT] = address_of(made->parts);
    made->header[I_N_PARTS] = made->header[I_N_SHAPES] = 2;
    return space->impact = made;
}

/* A motion whose pair is taken. */
struct motion {
    collide_workspace *space;
    const double *X[4]; /* of A at times 0 and 1, then of B */
    const double *omega[2];
    unsigned trust;
    double tolerance;
};

/* Bodies that touch at the start, decided as `collide_collide` does, become contacts at time 0. */
static collide_status ask_start(const struct motion *asked, struct impact_row *row)
{
    collide_status status = meet_of_pair(asked->space, asked->X[0], asked->X[2], asked->trust);
    if (status != COLLIDE_OK || !asked->space->rows[0].hit) return status;
    row->lower = row->upper = 0.0;
    row->status = MOTION_CONTACT;
    return COLLIDE_OK;
}

/* Normal and points of bodies in contact at the start, as `collide_distance` has them, and whether the contact is proven. */
static collide_status describe_start(const struct motion *asked, struct impact_row *row)
{
    collide_pair pair;
    collide_status status = row_of_pair(asked->space, asked->X[0], asked->X[2], INFINITE, asked->trust, &pair);
    if (status != COLLIDE_OK && status != COLLIDE_ENDLESS_DEPTH) return status;
    memset(row->normal, 0, sizeof row->normal);
    memset(row->point_a, 0, sizeof row->point_a);
    memset(row->point_b, 0, sizeof row->point_b);
    row->part_a = row->part_b = 0;
    if (status == COLLIDE_OK) {
        memcpy(row->normal, pair.normal, sizeof pair.normal);
        memcpy(row->point_a, pair.point_a, sizeof pair.point_a);
        memcpy(row->point_b, pair.point_b, sizeof pair.point_b);
    }
    if (pair.how != COLLIDE_HOW_UNDECIDED) return COLLIDE_OK;
    row->upper = INFINITE;
    row->status = MOTION_OPEN_START;
    return COLLIDE_OK;
}

/* Bodies in contact at the last poses as given have a contact by time 1. */
static collide_status ask_end(const struct motion *asked, struct impact_row *row)
{
    collide_pair pair;
    collide_status status = row_of_pair(asked->space, asked->X[1], asked->X[3], INFINITE, asked->trust | COLLIDE_UNSIGNED, &pair);
    if (status != COLLIDE_OK || !pair.hit || pair.how == COLLIDE_HOW_UNDECIDED) return status;
    row->upper = 1.0;
    row->status = MOTION_CONTACT;
    return COLLIDE_OK;
}

static void search(const struct motion *asked, struct impact_row *row)
{
    struct impact_space *impact = asked->space->impact;
    int k;
    for (k = 0; k < 4; k++) impact->header[XA0_AT + k] = address_of(asked->X[k]);
    for (k = 0; k < 2; k++) impact->header[I_OMEGA_A_AT + k] = address_of(asked->omega[k]);
    asked->space->kernels->find_impacts(address_of(impact->header), address_of(impact->job), 1, 0.0, 1.0, asked->tolerance, address_of(row));
}

/* The row of a motion that begins and ends at poses. */
static collide_status first_impact(const struct motion *asked, struct impact_row *row)
{
    const int64_t *ints = asked->space->ints;
    int turns = asked->omega[0] != NULL || asked->omega[1] != NULL;
    collide_status status = COLLIDE_OK;
    asked->space->kernels->clear_impacts(address_of(row), 1);
    if (ints[KIND] == HALFSPACE && ints[INTS + KIND] == HALFSPACE) {
        if ((status = ask_start(asked, row)) != COLLIDE_OK) return status;
        if (row->status == MOTION_FREE) return COLLIDE_UNSUPPORTED;
    } else search(asked, row);
    if (row->status == MOTION_WRONG_TURN) return turns ? COLLIDE_INVALID_ARGUMENT : COLLIDE_INVALID_POSE;
    if (row->status == MOTION_TOO_SMALL) return COLLIDE_OUT_OF_RANGE;
    if (row->status == MOTION_OPEN_START) status = ask_start(asked, row);
    if (status == COLLIDE_OK && row->status == MOTION_CONTACT && row->upper == 0.0) status = describe_start(asked, row);
    if (status == COLLIDE_OK && row->status == MOTION_OPEN && row->upper == INFINITE && !turns) status = ask_end(asked, row);
    return status;
}

static void write_time(const struct impact_row *row, double tolerance, collide_time_of_impact *out)
{
    int is_free = row->status == MOTION_FREE;
    memset(out, 0, sizeof *out);
    out->time = out->lower = is_free ? 1.0 : row->lower;
    out->upper = is_free ? 1.0 : row->upper;
    memcpy(out->normal, row->normal, sizeof row->normal);
    memcpy(out->point_a, row->point_a, sizeof row->point_a);
    memcpy(out->point_b, row->point_b, sizeof row->point_b);
    out->queries = row->queries;
    out->hit = !is_free;
    out->certified = out->upper - out->lower <= tolerance;
}

static int is_turn(const collide_workspace *space, const double *omega)
{
    int k;
    for (k = 0; k < 3; k++) if (!(fabs(omega[k]) <= LARGEST)) return 0;
    return space->kernels->root_of_squares(omega[0], omega[1], omega[2]) <= (double)space->impact->measures[I_LARGEST_ANGLE];
}

/* A motion whose numbers are still to be checked. */
static collide_status answer(const struct motion *asked, collide_time_of_impact *out)
{
    struct impact_row *row = &asked->space->impact->row;
    collide_status status;
    int k;
    memset(out, 0, sizeof *out);
    for (k = 0; k < 2; k++)
        if (asked->omega[k] != NULL && !is_turn(asked->space, asked->omega[k])) return COLLIDE_INVALID_ARGUMENT;
    for (k = 0; k < 4; k++)
        if (!put_pose(asked->space, asked->X[k], asked->trust, 0)) return COLLIDE_INVALID_POSE;
    if ((status = first_impact(asked, row)) == COLLIDE_OK) write_time(row, asked->tolerance, out);
    return status;
}

static collide_status begin(struct motion *asked, collide_workspace *space, const collide_shape *A, const collide_shape *B,
                            double tolerance, unsigned flags)
{
    if (!IS_HANDLE(space, WORKSPACE_WORD) || !IS_HANDLE(A, SHAPE_WORD) || !IS_HANDLE(B, SHAPE_WORD) || !(tolerance >= LEAST_TOLERANCE && tolerance <= LARGEST_TOLERANCE) ||
        (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (impact_space_of(space) == NULL) return COLLIDE_NO_MEMORY;
    asked->space = space;
    asked->tolerance = tolerance;
    asked->trust = flags;
    take_pair(space, A, B);
    return COLLIDE_OK;
}

collide_status collide_impact(collide_workspace *workspace, const collide_shape *A, const collide_shape *B, const double X_WA0[16],
                              const double X_WA1[16], const double X_WB0[16], const double X_WB1[16], const double *omega_WA,
                              const double *omega_WB, double tolerance, unsigned flags, collide_time_of_impact *impact)
{
    struct motion asked;
    collide_status status;
    rounding given;
    if (impact == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(impact, 0, sizeof *impact);
    if (X_WA0 == NULL || X_WA1 == NULL || X_WB0 == NULL || X_WB1 == NULL) return COLLIDE_INVALID_ARGUMENT;
    if ((status = begin(&asked, workspace, A, B, tolerance, flags)) != COLLIDE_OK) return status;
    asked.X[0] = X_WA0;
    asked.X[1] = X_WA1;
    asked.X[2] = X_WB0;
    asked.X[3] = X_WB1;
    asked.omega[0] = omega_WA;
    asked.omega[1] = omega_WB;
    given = round_as_kernels_do();
    status = answer(&asked, impact);
    round_as_before(given);
    return status;
}

/* Where poses or vectors stand, and how far apart; 0 where there are not as many as wanted. */
static int take_column(const double *values, size_t count, size_t n, int64_t size, const double **first, int64_t *step)
{
    *first = values;
    *step = count == 1 ? 0 : size;
    return (count == n || count == 1) && (values != NULL || n == 0);
}

collide_status collide_impact_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                    const collide_motions *motions, double tolerance, unsigned flags,
                                    collide_time_of_impact *impacts, collide_status *statuses, size_t *failed)
{
    const collide_poses *poses[4];
    const collide_vectors *turns[2];
    const double *X[4], *omega[2];
    int64_t steps[6];
    struct motion asked;
    struct batch_statuses reported = {statuses, COLLIDE_OK, 0};
    size_t n = 1, k;
    collide_status status;
    rounding given;
    int j;
    if (failed != NULL) *failed = 0;
    if (motions == NULL) return COLLIDE_INVALID_ARGUMENT;
    poses[0] = &motions->X_WA0, poses[1] = &motions->X_WA1, poses[2] = &motions->X_WB0, poses[3] = &motions->X_WB1;
    turns[0] = &motions->omega_WA, turns[1] = &motions->omega_WB;
    for (j = 0; j < 4; j++) n = poses[j]->count != 1 ? poses[j]->count : n;
    for (j = 0; j < 2; j++) n = turns[j]->xyz != NULL && turns[j]->count != 1 ? turns[j]->count : n;
    for (j = 0; j < 4; j++)
        if (!take_column(poses[j]->matrices, poses[j]->count, n, 16, &X[j], &steps[j])) return COLLIDE_INVALID_ARGUMENT;
    for (j = 0; j < 2; j++)
        if (!take_column(turns[j]->xyz, turns[j]->count, n, 3, &omega[j], &steps[4 + j]) && turns[j]->xyz != NULL)
            return COLLIDE_INVALID_ARGUMENT;
    if ((status = begin(&asked, workspace, A, B, tolerance, flags)) != COLLIDE_OK) return status;
    if (n > 0 && impacts == NULL) return COLLIDE_INVALID_ARGUMENT;
    given = round_as_kernels_do();
    for (k = 0; k < n; k++) {
        for (j = 0; j < 4; j++) asked.X[j] = X[j] + steps[j] * (int64_t)k;
        for (j = 0; j < 2; j++) asked.omega[j] = omega[j] == NULL ? NULL : omega[j] + steps[4 + j] * (int64_t)k;
        put_status(&reported, k, answer(&asked, impacts + k));
    }
    round_as_before(given);
    return end_batch(&reported, failed);
}
