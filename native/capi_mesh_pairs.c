/* Two bodies of facets at a pair of poses: `prepared_facets` of collide/narrowphase/facets/facet_kernel_calls.py. What kernels leave to
   Python is said to be unsupported. */
#include "capi_mesh.h"

#include <string.h>

/* Header of the kernels (collide/narrowphase/facets/mesh_collide_kernel.py). */
enum {
    TREE_A, TREE_B, SOLID_A, SOLID_B, POINTS_A, POINTS_B, N_POINTS_A, N_POINTS_B, RADIUS_A, RADIUS_B, SAME_TREE, SAME_BODY, EXCHANGED,
    SURFACES_CODE, POINTS_CODE, DISTANCES_CODE, EXACT_CODE, STACK_AT, N_STACK, MESH_DOUBLES_AT, MESH_INTEGERS_AT, HEAP_AT, N_HEAP,
    SCRATCH_AT, WORDS_OF_PAIR
};

typedef char headers_agree[(int)WORDS_OF_PAIR == (int)MESH_HEADER && (int)EXCHANGED == (int)IS_EXCHANGED ? 1 : -1];
/* More points than this are left to a batch. */
enum { MAX_POINTS = 64 };

/* Room of a workspace for meshes (collide_workspace.mesh). */
struct mesh_workspace {
    int64_t header[MESH_HEADER];
};

size_t mesh_workspace_bytes(const int64_t *m)
{
    if (m[M_MESH_HEADER] != MESH_HEADER) return 0;
    return sizeof(struct mesh_workspace) + 8 * (size_t)(2 * STACK_OF_MESHES + 32 + 2 * HEAP_OF_MESHES) +
           8 * (size_t)(m[M_MESH_DOUBLES] + m[M_MESH_INTEGERS] + m[M_MESH_SCRATCH]);
}

#define CODE(space, name) code_at(&(space)->kernels->name)

void begin_mesh_workspace(collide_workspace *space, void *memory, const int64_t *m)
{
    struct mesh_workspace *mesh = memory;
    int64_t *header = mesh->header;
    space->mesh = mesh;
    header[SURFACES_CODE] = CODE(space, walk_surfaces);
    header[POINTS_CODE] = CODE(space, points_inside);
    header[EXACT_CODE] = CODE(space, decide_exactly);
    header[DISTANCES_CODE] = CODE(space, near_surfaces);
    header[N_STACK] = STACK_OF_MESHES;
    header[N_HEAP] = HEAP_OF_MESHES;
    header[STACK_AT] = address_of(mesh + 1);
    header[HEAP_AT] = header[STACK_AT] + 8 * (2 * STACK_OF_MESHES + 32);
    header[MESH_DOUBLES_AT] = header[HEAP_AT] + 8 * 2 * HEAP_OF_MESHES;
    header[MESH_INTEGERS_AT] = header[MESH_DOUBLES_AT] + 8 * m[M_MESH_DOUBLES];
    header[SCRATCH_AT] = header[MESH_INTEGERS_AT] + 8 * m[M_MESH_INTEGERS];
}

/* Whether B comes before A: by facets, by radius, then surfaces before solids. */
static int is_exchanged(const collide_mesh *A, const collide_mesh *B)
{
    int order = memcmp(B->content, A->content, sizeof A->content);
    if (order != 0) return order < 0;
    if (A->radius != B->radius) return B->radius < A->radius;
    return B->solid < A->solid;
}

/* Prepare the kernels for a pair: the bodies in the order of their contents. */
static void take_meshes(struct mesh_workspace *mesh, const collide_mesh *A, const collide_mesh *B)
{
    int64_t *header = mesh->header;
    int exchanged = is_exchanged(A, B);
    const collide_mesh *one = exchanged ? B : A, *two = exchanged ? A : B;
    header[TREE_A] = address_of(one->tree);
    header[TREE_B] = address_of(two->tree);
    header[SOLID_A] = one->solid;
    header[SOLID_B] = two->solid;
    header[POINTS_A] = address_of(one->points);
    header[POINTS_B] = address_of(two->points);
    header[N_POINTS_A] = one->n_points;
    header[N_POINTS_B] = two->n_points;
    memcpy(header + RADIUS_A, &one->radius, sizeof(double));
    memcpy(header + RADIUS_B, &two->radius, sizeof(double));
    header[SAME_TREE] = memcmp(one->content, two->content, sizeof one->content) == 0;
    header[SAME_BODY] = header[SAME_TREE] && one->radius == two->radius && one->solid == two->solid;
    header[EXCHANGED] = exchanged;
}

void write_mesh_header(collide_workspace *space, const collide_mesh *A, const collide_mesh *B, int64_t *header)
{
    take_meshes(space->mesh, A, B);
    memcpy(header, space->mesh->header, sizeof space->mesh->header);
}

/* Why a kernel left a pair to Python: matrices that are no poses, or something that C does not do. */
collide_status why_mesh_pair(collide_workspace *space, const double *X_WA, const double *X_WB, unsigned flags)
{
    int64_t check = !(flags & COLLIDE_TRUST_POSES), pose_at = address_of(space->poses);
    if (space->kernels->first_bad_pose(address_of(X_WA), 0, 0, 1, (uint8_t)check, pose_at) == 0) return COLLIDE_INVALID_POSE;
    if (space->kernels->first_bad_pose(address_of(X_WB), 0, 0, 1, (uint8_t)check, pose_at) == 0) return COLLIDE_INVALID_POSE;
    return COLLIDE_UNSUPPORTED;
}

collide_status check_mesh_pair(const collide_workspace *space, const collide_mesh *A, const collide_mesh *B, const double *X_WA,
                                 const double *X_WB, unsigned flags)
{
    if (!IS_HANDLE(space, WORKSPACE_WORD) || !IS_HANDLE(A, MESH_WORD) || !IS_HANDLE(B, MESH_WORD) || X_WA == NULL || X_WB == NULL || !(A->given || B->given) ||
        (flags & ~(unsigned)(COLLIDE_TRUST_POSES | COLLIDE_UNSIGNED)) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if ((A->solid && B->n_points > MAX_POINTS) || (B->solid && A->n_points > MAX_POINTS)) return COLLIDE_UNSUPPORTED;
    return COLLIDE_OK;
}

collide_status collide_mesh_collide(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B,
                                    const double X_WA[16], const double X_WB[16], unsigned flags, int *hit)
{
    collide_status status;
    rounding given;
    int64_t result;
    if (hit == NULL) return COLLIDE_INVALID_ARGUMENT;
    *hit = 0;
    if ((status = check_mesh_pair(workspace, A, B, X_WA, X_WB, flags)) != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    take_meshes(workspace->mesh, A, B);
    result = workspace->kernels->meet_single(address_of(workspace->mesh->header), address_of(X_WA), address_of(X_WB));
    if (result < 0) status = why_mesh_pair(workspace, X_WA, X_WB, flags);
    round_as_before(given);
    if (status == COLLIDE_OK) *hit = (int)result;
    return status;
}

collide_status collide_mesh_distance(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B,
                                     const double X_WA[16], const double X_WB[16], unsigned flags, collide_pair *pair)
{
    collide_status status;
    rounding given;
    if (pair == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(pair, 0, sizeof *pair);
    if ((status = check_mesh_pair(workspace, A, B, X_WA, X_WB, flags)) != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    take_meshes(workspace->mesh, A, B);
    if (workspace->kernels->gap_single(address_of(workspace->mesh->header), address_of(X_WA), address_of(X_WB), address_of(pair), 1,
                                       INFINITE) < 0) {
        memset(pair, 0, sizeof *pair);
        status = why_mesh_pair(workspace, X_WA, X_WB, flags);
    }
    round_as_before(given);
    return status;
}

int64_t facets_on_ray(collide_workspace *space, const collide_mesh *mesh, const double *X, const double *ray, double *hits,
                      int64_t capacity, int64_t *count)
{
    const int64_t *h = space->mesh->header;
    int64_t counters[3] = {0, 0, 0}, progress[2] = {0, 0};
    int64_t status = space->kernels->cast_rays(
        address_of(mesh->tree), address_of(X), 0, address_of(ray), 1, 1, address_of(hits), capacity, address_of(counters),
        address_of(progress), h[STACK_AT], STACK_OF_MESHES, h[MESH_DOUBLES_AT], h[MESH_INTEGERS_AT], h[EXACT_CODE]);
    *count = progress[1];
    return status;
}

const int64_t *mesh_pair_header(collide_workspace *space, const collide_mesh *A, const collide_mesh *B)
{
    take_meshes(space->mesh, A, B);
    return space->mesh->header;
}
