/* Two bodies of facets at a pair of poses: `PreparedPair` of collide/narrowphase/facets/single_mesh_call.py. What that leaves to numpy is said to be
   unsupported. */
#include "capi_mesh.h"

#include <string.h>

/* Header of the kernels (collide/narrowphase/facets/single_surface.py). */
enum {
    TREE_A, TREE_B, ALIKE, EXCHANGED, WALK_AT, INSIDE_AT, SOLID_A, SOLID_B, POINTS_A, POINTS_B, MANY_A, MANY_B, BALLS_AT, KEYS_AT,
    MARKS_AT, STACK_AT, N_STACK, MESH_DOUBLES_AT, MESH_INTEGERS_AT, DECIDE, SWEPT, DISTANCES_AT, ROOM_AT, HEAP_AT, N_HEAP,
    MESH_HEADER
};
/* A result and its marks (collide/narrowphase/facets/surface_distance.py). */
enum { R_DISTANCE, R_LOWER, R_UPPER, R_POINT_A, R_POINT_B = 6, R_NORMAL = 9, RESULT = 12 };
enum { FACET_A, FACET_B, MEETS, BOXES, TRIANGLES, EXACT_DECISIONS, MARKS };
/* More points than this are left to a batch; bodies with radii are looked for this much farther. */
enum { MOST_POINTS = 64 };
static const double FARTHER = 1 + 1e-9;
/* Facets nearer than this share of the pair's size tell its direction badly; gaps are promised in brackets no wider than that. */
static const double NEAR = 5.960464477539063e-08, PROMISE = 1.1368683772161603e-13;

/* Room of a workspace for meshes (collide_workspace.mesh). */
struct mesh_room {
    int64_t header[MESH_HEADER];
    double balls[8], room[2 + RESULT];
    int64_t keys[128], marks[8];
    double found[RESULT + MARKS];
};

size_t mesh_room_bytes(const int64_t *m)
{
    if (m[M_MESH_HEADER] != MESH_HEADER || m[M_RESULT] != RESULT || m[M_MARKS] != MARKS) return 0;
    return sizeof(struct mesh_room) + 8 * (size_t)(2 * STACK_OF_MESHES + 32 + 2 * HEAP_OF_MESHES) +
           8 * (size_t)(m[M_MESH_DOUBLES] + m[M_MESH_INTEGERS]);
}

#define CODE(space, name) code_at(&(space)->kernels->name)

static int64_t code_at(const void *function)
{
    int64_t code = 0;
    memcpy(&code, function, sizeof(void (*)(void)));
    return code;
}

void furnish_meshes(collide_workspace *space, void *place, const int64_t *m)
{
    struct mesh_room *room = place;
    int64_t *header = room->header;
    space->mesh = room;
    header[WALK_AT] = CODE(space, walk_surfaces);
    header[INSIDE_AT] = CODE(space, points_inside);
    header[DECIDE] = CODE(space, decide_exactly);
    header[DISTANCES_AT] = CODE(space, near_surfaces);
    header[BALLS_AT] = address_of(room->balls);
    header[KEYS_AT] = address_of(room->keys);
    header[MARKS_AT] = address_of(room->marks);
    header[ROOM_AT] = address_of(room->room);
    header[N_STACK] = STACK_OF_MESHES;
    header[N_HEAP] = HEAP_OF_MESHES;
    header[STACK_AT] = address_of(room + 1);
    header[HEAP_AT] = header[STACK_AT] + 8 * (2 * STACK_OF_MESHES + 32);
    header[MESH_DOUBLES_AT] = header[HEAP_AT] + 8 * 2 * HEAP_OF_MESHES;
    header[MESH_INTEGERS_AT] = header[MESH_DOUBLES_AT] + 8 * m[M_MESH_DOUBLES];
}

/* Whether B comes before A: by facets, by radius, then surfaces before solids. */
static int is_exchanged(const collide_mesh *A, const collide_mesh *B)
{
    int order = memcmp(B->content, A->content, sizeof A->content);
    if (order != 0) return order < 0;
    if (A->radius != B->radius) return B->radius < A->radius;
    return B->solid < A->solid;
}

/* Prepare the kernels for a pair, in order. */
static void take_meshes(struct mesh_room *room, const collide_mesh *one, const collide_mesh *other, int exchanged)
{
    int64_t *header = room->header;
    double radius = one->radius + other->radius;
    header[TREE_A] = address_of(one->tree);
    header[TREE_B] = address_of(other->tree);
    header[ALIKE] = memcmp(one->content, other->content, sizeof one->content) == 0;
    header[EXCHANGED] = exchanged;
    header[SOLID_A] = one->solid;
    header[SOLID_B] = other->solid;
    header[POINTS_A] = address_of(one->points);
    header[POINTS_B] = address_of(other->points);
    header[MANY_A] = one->n_points;
    header[MANY_B] = other->n_points;
    header[SWEPT] = radius > 0.0;
    memcpy(room->balls, one->ball, sizeof one->ball);
    memcpy(room->balls + 4, other->ball, sizeof other->ball);
    room->room[0] = radius;
    room->room[1] = radius * FARTHER;
}

/* Why a kernel left a pair to Python: matrices that are no poses, or something that C does not do. */
static collide_status why(collide_workspace *space, const double *X_WA, const double *X_WB, unsigned flags)
{
    int64_t check = !(flags & COLLIDE_TRUST_POSES), room = address_of(space->poses);
    if (space->kernels->first_bad_pose(address_of(X_WA), 0, 0, 1, (uint8_t)check, room) == 0) return COLLIDE_INVALID_POSE;
    if (space->kernels->first_bad_pose(address_of(X_WB), 0, 0, 1, (uint8_t)check, room) == 0) return COLLIDE_INVALID_POSE;
    return COLLIDE_UNSUPPORTED;
}

static collide_status check_pair(const collide_workspace *space, const collide_mesh *A, const collide_mesh *B, const double *X_WA,
                                 const double *X_WB, unsigned flags)
{
    if (space == NULL || A == NULL || B == NULL || X_WA == NULL || X_WB == NULL || !(A->given || B->given) ||
        (flags & ~(unsigned)(COLLIDE_TRUST_POSES | COLLIDE_UNSIGNED)) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if ((A->solid && B->n_points > MOST_POINTS) || (B->solid && A->n_points > MOST_POINTS)) return COLLIDE_UNSUPPORTED;
    return COLLIDE_OK;
}

collide_status collide_mesh_collide(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B,
                                    const double X_WA[16], const double X_WB[16], unsigned flags, int *hit)
{
    collide_status status;
    rounding given;
    int64_t said;
    int exchanged;
    if (hit == NULL) return COLLIDE_INVALID_ARGUMENT;
    *hit = 0;
    if ((status = check_pair(workspace, A, B, X_WA, X_WB, flags)) != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    exchanged = is_exchanged(A, B);
    take_meshes(workspace->mesh, exchanged ? B : A, exchanged ? A : B, exchanged);
    said = workspace->kernels->meet_single(address_of(workspace->mesh->header), address_of(X_WA), address_of(X_WB));
    if (said < 0) status = why(workspace, X_WA, X_WB, flags);
    round_as_before(given);
    if (status == COLLIDE_OK) *hit = (int)said;
    return status;
}

static double larger(double a, double b) { return b > a ? b : a; }

/* The row of a gap, of bodies in the order of their contents; 0 where Python's batches know better. */
static int write_gap(const struct mesh_room *room, const collide_mesh *one, const collide_mesh *other, double away,
                     collide_pair *row)
{
    const double *r = room->found;
    double radius = one->radius + other->radius, size = (one->reach + other->reach) + away;
    int64_t marks[MARKS];
    int k, narrow;
    memcpy(marks, r + RESULT, sizeof marks);
    if (marks[FACET_A] < 0 || !(r[R_LOWER] > radius || radius == 0.0) || r[R_DISTANCE] <= NEAR * size) return 0;
    if (r[R_NORMAL] == 0.0 && r[R_NORMAL + 1] == 0.0 && r[R_NORMAL + 2] == 0.0) return 0;
    row->lower = larger(radius != 0.0 ? nextafter(r[R_LOWER] - radius, -INFINITE) : r[R_LOWER], 0.0);
    row->upper = larger(radius != 0.0 ? nextafter(r[R_UPPER] - radius, INFINITE) : r[R_UPPER], 0.0);
    row->distance = larger(r[R_DISTANCE] - radius, row->lower);
    if (row->upper < row->distance) row->distance = row->upper;
    if (row->distance == 0.0) row->distance = row->upper;
    for (k = 0; k < 3; k++) {
        row->normal[k] = r[R_NORMAL + k] + 0.0;
        row->point_a[k] = r[R_POINT_A + k] + one->radius * r[R_NORMAL + k];
        row->point_b[k] = r[R_POINT_B + k] + -other->radius * r[R_NORMAL + k];
    }
    for (k = 0; k < 4; k++) row->vertices_a[k] = row->vertices_b[k] = -1;
    narrow = row->upper <= row->lower + PROMISE * size;
    row->b = 1;
    row->part_a = (int32_t)marks[FACET_A];
    row->part_b = (int32_t)marks[FACET_B];
    row->how = COLLIDE_HOW_CLOSED_FORM;
    row->exact = (uint8_t)(marks[EXACT_DECISIONS] < 255 ? marks[EXACT_DECISIONS] : 255);
    row->certified = narrow && (row->lower > 0.0 || radius == 0.0);
    return 1;
}

static void exchange(collide_pair *row)
{
    int32_t part = row->part_a;
    int k;
    row->part_a = row->part_b;
    row->part_b = part;
    for (k = 0; k < 3; k++) {
        double point = row->point_a[k];
        row->point_a[k] = row->point_b[k];
        row->point_b[k] = point;
        row->normal[k] = 0.0 - row->normal[k] + 0.0;
    }
}

collide_status collide_mesh_distance(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B,
                                     const double X_WA[16], const double X_WB[16], unsigned flags, collide_pair *pair)
{
    const collide_mesh *one, *other;
    collide_status status;
    rounding given;
    int exchanged;
    if (pair == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(pair, 0, sizeof *pair);
    if ((status = check_pair(workspace, A, B, X_WA, X_WB, flags)) != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    exchanged = is_exchanged(A, B);
    one = exchanged ? B : A;
    other = exchanged ? A : B;
    take_meshes(workspace->mesh, one, other, exchanged);
    if (workspace->kernels->near_single(address_of(workspace->mesh->header), address_of(X_WA), address_of(X_WB),
                                        address_of(workspace->mesh->found), 1) < 0)
        status = why(workspace, X_WA, X_WB, flags);
    else {
        double x = X_WB[3] - X_WA[3], y = X_WB[7] - X_WA[7], z = X_WB[11] - X_WA[11];
        if (!write_gap(workspace->mesh, one, other, sqrt(x * x + y * y + z * z), pair)) status = COLLIDE_UNSUPPORTED;
        else if (exchanged) exchange(pair);
    }
    round_as_before(given);
    return status;
}
