/* A mesh and a convex shape of any kind: half-spaces by the mesh's hull (collide/narrowphase/facets/mesh_pairs.py), curved shapes by a
   walk down the facets (collide/narrowphase/facets/mesh_batches.py: curved_pair), polytopes as facets. */
#include "capi_box_tree.h"
#include "capi_mesh.h"
#include "capi_tree.h"

#include <stdlib.h>

/* Hulls of more points have their corners alone (collide/shapes/mesh.py). */
enum { MAX_HULL_POINTS = 512 };

/* The points that facets have, equal ones once, in order; n : how many. */
static double *points_of(const collide_mesh *mesh, struct arena *arena, int64_t *n)
{
    int64_t m = mesh->tree[N_FACETS], n_corners = 0, p, k;
    const double *triangles = (const double *)(intptr_t)mesh->tree[TRIANGLES_AT];
    const int32_t *ids = (const int32_t *)(intptr_t)mesh->tree[IDS_AT];
    uint8_t *is_used;
    double *points;
    for (k = 0; k < 3 * m; k++) if (mesh->corners[k] >= n_corners) n_corners = mesh->corners[k] + 1;
    points = arena_take(arena, (size_t)(3 * n_corners) * sizeof *points);
    is_used = arena_take(arena, (size_t)n_corners);
    *n = 0;
    if (arena->failed) return NULL;
    memset(is_used, 0, (size_t)n_corners);
    for (p = 0; p < m; p++)
        for (k = 0; k < 3; k++) {
            int32_t corner = mesh->corners[3 * (int64_t)ids[p] + k];
            memcpy(points + 3 * (int64_t)corner, triangles + 9 * p + 3 * k, 3 * sizeof *points);
            is_used[corner] = 1;
        }
    for (k = 0; k < n_corners; k++)
        if (is_used[k]) memmove(points + 3 * (*n)++, points + 3 * k, 3 * sizeof *points);
    return points;
}

static collide_status make_hull(const collide_mesh *mesh, collide_shape **hull)
{
    const struct collide_kernels *kernels = kernels_here();
    collide_status status = COLLIDE_NO_MEMORY;
    struct arena arena;
    struct hull corners;
    int64_t n, k;
    double *points, *some;
    arena_begin(&arena);
    points = points_of(mesh, &arena, &n);
    if (points != NULL && n > MAX_HULL_POINTS) {
        corners = hull_of(kernels, &arena, points, n);
        some = arena_take(&arena, (size_t)(3 * corners.n_vertices) * sizeof *some);
        for (k = 0; !arena.failed && k < corners.n_vertices; k++)
            memcpy(some + 3 * k, points + 3 * (int64_t)corners.vertices[k], 3 * sizeof *some);
        points = some;
        n = corners.n_vertices;
    }
    if (!arena.failed) status = collide_hull(points, (size_t)n, 0.0, hull);
    arena_end(&arena);
    return status;
}

/* The hull of a mesh, made by the thread that asks first. */
static collide_status hull_of_mesh(const collide_mesh *mesh, const collide_shape **hull)
{
    collide_mesh *kept = (collide_mesh *)mesh; /* what is made is no part of what the mesh is */
    collide_shape *made = NULL;
    collide_status status;
    if (kept->hull == NULL) {
        if ((status = make_hull(mesh, &made)) != COLLIDE_OK) return status;
        if (!PUT_IF_NULL(&kept->hull, made)) collide_shape_free(made); /* another thread was sooner */
    }
    *hull = kept->hull;
    return COLLIDE_OK;
}

/* Whether the middle of a shape, no point of which lies on a facet, is inside a solid. */
static collide_status is_inside(collide_workspace *space, const collide_mesh *mesh, const double *X_WM, const double *X_WS,
                                unsigned flags, int *inside)
{
    static const double middle[3] = {0.0, 0.0, 0.0};
    collide_shape *point;
    collide_status status;
    *inside = 0;
    if (!mesh->solid) return COLLIDE_OK;
    if (space->middle == NULL) {
        if ((status = collide_hull(middle, 1, 0.0, &point)) != COLLIDE_OK) return status;
        status = collide_mesh_of_shape(point, &space->middle);
        collide_shape_free(point);
        if (status != COLLIDE_OK) return status;
    }
    return collide_mesh_collide(space, mesh, space->middle, X_WM, X_WS, flags & COLLIDE_TRUST_POSES, inside);
}

/* How the pair is asked about, its arguments checked. */
enum { BY_FACETS, BY_HULL, BY_WALK };
static collide_status begin(collide_workspace *space, const collide_mesh *mesh, const collide_shape *shape, const double *X_WM,
                            const double *X_WS, unsigned flags, int *how)
{
    if (!IS_HANDLE(space, WORKSPACE_WORD) || !IS_HANDLE(mesh, MESH_WORD) || !IS_HANDLE(shape, SHAPE_WORD) || X_WM == NULL || X_WS == NULL || !mesh->given ||
        (flags & ~(unsigned)(COLLIDE_TRUST_POSES | COLLIDE_UNSIGNED)) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    *how = shape->ints[KIND] == HALFSPACE ? BY_HULL : shape->ints[KIND] == POINTS ? BY_FACETS : BY_WALK;
    return *how == BY_FACETS && shape->numbers[SLOP] != 0.0 ? COLLIDE_UNSUPPORTED : COLLIDE_OK;
}

/* What a walk along the facets says of the pair, a boolean, or a row where `pair` is not NULL; LONG_WAY: *status says why not. */
static int64_t walk(collide_workspace *space, const collide_mesh *mesh, const collide_shape *shape, const double *X_WM, const double *X_WS,
                    unsigned flags, collide_pair *pair, collide_status *status)
{
    int64_t state = LONG_WAY;
    rounding given = round_as_kernels_do();
    *status = why_mesh_pair(space, X_WM, X_WS, flags);
    if (*status == COLLIDE_UNSUPPORTED)
        state = ask_facets(space, mesh, shape, X_WM, X_WS, pair == NULL, !(flags & COLLIDE_UNSIGNED), pair);
    round_as_before(given);
    return state;
}

collide_status collide_mesh_shape_collide(collide_workspace *workspace, const collide_mesh *mesh, const collide_shape *shape,
                                          const double X_WM[16], const double X_WS[16], unsigned flags, int *hit)
{
    const collide_mesh *surface;
    const collide_shape *hull;
    collide_status status;
    int64_t state;
    int how;
    if (hit == NULL) return COLLIDE_INVALID_ARGUMENT;
    *hit = 0;
    if ((status = begin(workspace, mesh, shape, X_WM, X_WS, flags, &how)) != COLLIDE_OK) return status;
    if (how == BY_FACETS) {
        if ((status = surface_of(shape, &surface)) != COLLIDE_OK) return status;
        return collide_mesh_collide(workspace, mesh, surface, X_WM, X_WS, flags, hit);
    }
    if (how == BY_HULL) {
        if ((status = hull_of_mesh(mesh, &hull)) != COLLIDE_OK) return status;
        return collide_collide(workspace, hull, shape, X_WM, X_WS, flags, hit);
    }
    if ((state = walk(workspace, mesh, shape, X_WM, X_WS, flags, NULL, &status)) == LONG_WAY) return status;
    *hit = state == MEETS;
    return state == MAYBE_INSIDE ? is_inside(workspace, mesh, X_WM, X_WS, flags, hit) : COLLIDE_OK;
}

collide_status collide_mesh_shape_distance(collide_workspace *workspace, const collide_mesh *mesh, const collide_shape *shape,
                                           const double X_WM[16], const double X_WS[16], unsigned flags, collide_pair *pair)
{
    const collide_mesh *surface;
    const collide_shape *hull;
    collide_status status;
    int64_t state;
    int how, inside = 0, k;
    if (pair == NULL) return COLLIDE_INVALID_ARGUMENT;
    memset(pair, 0, sizeof *pair);
    if ((status = begin(workspace, mesh, shape, X_WM, X_WS, flags, &how)) != COLLIDE_OK) return status;
    if (how == BY_FACETS) {
        if ((status = surface_of(shape, &surface)) != COLLIDE_OK) return status;
        return collide_mesh_distance(workspace, mesh, surface, X_WM, X_WS, flags, pair);
    }
    if (how == BY_HULL) {
        if ((status = hull_of_mesh(mesh, &hull)) != COLLIDE_OK) return status;
        status = collide_distance(workspace, hull, shape, X_WM, X_WS, INFINITE, flags, pair);
        pair->count = 0;
        for (k = 0; status == COLLIDE_OK && k < 4; k++) pair->vertices_a[k] = pair->vertices_b[k] = -1; /* of the hull, not of the mesh */
        return status;
    }
    state = walk(workspace, mesh, shape, X_WM, X_WS, flags, pair, &status);
    if (state != LONG_WAY) status = state == 0 ? is_inside(workspace, mesh, X_WM, X_WS, flags, &inside) : COLLIDE_OK;
    if (inside) status = COLLIDE_UNSUPPORTED;
    if (status != COLLIDE_OK) memset(pair, 0, sizeof *pair);
    return status;
}
