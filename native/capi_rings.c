/* Neighbours in cyclic order: `Rings` of collide/support/build_support_tree.py. */
#include "capi_tree.h"

#include <string.h>

/* Rings of a surface as `order_rings` finds them; returns what that says. */
static int64_t order(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n,
                     const int32_t *facets, int64_t n_facets, struct rings *rings)
{
    int32_t *following, *place;
    int64_t result, k;
    rings->starts = arena_take(arena, (size_t)(n + 1) * 4);
    rings->ring = arena_take(arena, (size_t)(3 * n_facets) * 4);
    rings->ring_facets = arena_take(arena, (size_t)(3 * n_facets) * 4);
    rings->normals = arena_take(arena, (size_t)(3 * n_facets) * 8);
    rings->corner = arena_take(arena, (size_t)n);
    following = arena_take(arena, (size_t)(6 * n_facets) * 4);
    place = arena_take(arena, (size_t)n * 4);
    rings->n_normals = n_facets;
    if (arena->failed) return -1;
    result = kernels->order_rings(address_of(points), n, address_of(facets), n_facets, address_of(rings->starts),
                                address_of(rings->ring), address_of(rings->ring_facets), address_of(following),
                                address_of(place), address_of(rings->normals));
    for (k = 0; k < n; k++) rings->corner[k] = place[k] >= 3;
    return result;
}

static int turned_over(const int32_t *facets, int64_t half)
{
    int64_t k;
    for (k = 0; k < 3 * half; k++)
        if (facets[3 * half + k] != facets[k - k % 3 + (2 - k % 3)]) return 0;
    return 1;
}

/* Which facets of a flat hull are of its upper side. */
static void mark_upper(const struct rings *rings, const int32_t *facets, int64_t n_facets, uint8_t *upward)
{
    int64_t k, best = 0;
    double largest = -1.0;
    if (n_facets % 2 == 0 && turned_over(facets, n_facets / 2)) { /* as `hull_of` gives them; normals of slivers round */
        for (k = 0; k < n_facets; k++) upward[k] = k < n_facets / 2;
        return;
    }
    for (k = 0; k < n_facets; k++) {
        const double *v = rings->normals + 3 * k;
        double size = fabs(v[0]) + fabs(v[1]) + fabs(v[2]);
        if (size > largest) {
            largest = size;
            best = k;
        }
    }
    for (k = 0; k < n_facets; k++) {
        const double *v = rings->normals + 3 * k, *first = rings->normals + 3 * best;
        upward[k] = v[0] * first[0] + v[1] * first[1] + v[2] * first[2] > 0.0;
    }
}

/* One side of a flat hull: its facets, the edges of its border, who follows whom there. */
struct side {
    int32_t *facets, *border;
    int64_t n_facets, n_border;
    int64_t *following, *previous;
};

static int has_edge(const int64_t *sorted, int64_t n, int64_t key)
{
    int64_t low = 0;
    while (low < n) {
        int64_t middle = low + (n - low) / 2;
        if (sorted[middle] == key) return 1;
        if (sorted[middle] < key) low = middle + 1;
        else n = middle;
    }
    return 0;
}

/* Ascending, in place: a heap. */
static void sort_keys(int64_t *keys, int64_t n)
{
    int64_t begin = n / 2, end = n;
    while (end > 1) {
        int64_t key, at, child;
        if (begin > 0) key = keys[--begin];
        else {
            key = keys[--end];
            keys[end] = keys[0];
        }
        for (at = begin; (child = 2 * at + 1) < end; at = child) {
            if (child + 1 < end && keys[child + 1] > keys[child]) child++;
            if (keys[child] <= key) break;
            keys[at] = keys[child];
        }
        keys[at] = key;
    }
}

static void find_border(struct arena *arena, int64_t n, struct side *side)
{
    int64_t edges = 3 * side->n_facets, e, k;
    int64_t *backward = arena_take(arena, (size_t)(edges + 1) * 8);
    side->border = arena_take(arena, (size_t)(2 * edges + 1) * 4);
    side->following = arena_take(arena, (size_t)n * 8);
    side->previous = arena_take(arena, (size_t)n * 8);
    side->n_border = 0;
    if (arena->failed) return;
    for (k = 0; k < n; k++) side->following[k] = side->previous[k] = -1;
    for (e = 0; e < edges; e++) {
        const int32_t *f = side->facets + e - e % 3;
        backward[e] = (int64_t)f[(e + 1) % 3] * n + f[e % 3];
    }
    sort_keys(backward, edges);
    for (k = 0; k < 3; k++) /* all first edges, then all second ones, then all third ones */
        for (e = 0; e < side->n_facets; e++) {
            int32_t a = side->facets[3 * e + k], b = side->facets[3 * e + (k + 1) % 3];
            if (has_edge(backward, edges, (int64_t)a * n + b)) continue;
            side->border[2 * side->n_border] = a;
            side->border[2 * side->n_border + 1] = b;
            side->n_border++;
            side->following[a] = b;
            side->previous[b] = a;
        }
}

/* Whether a border certainly turns at a vertex. */
static int is_bent(const double *points, int64_t at, int64_t next, int64_t last)
{
    double a[3], b[3], x, y, z, bound;
    int k;
    for (k = 0; k < 3; k++) {
        a[k] = points[3 * next + k] - points[3 * at + k];
        b[k] = points[3 * last + k] - points[3 * at + k];
    }
    bound = 4e-15 * (fabs(a[0]) + fabs(a[1]) + fabs(a[2])) * (fabs(b[0]) + fabs(b[1]) + fabs(b[2]));
    x = fabs(a[1] * b[2] - a[2] * b[1]);
    y = fabs(a[2] * b[0] - a[0] * b[2]);
    z = fabs(a[0] * b[1] - a[1] * b[0]);
    return x > bound || y > bound || z > bound;
}

/* All vertices are corners of the border: its neighbours alone; diagonals may have thousands of ends. */
static void border_alone(struct arena *arena, int64_t n, const struct side *side, struct rings *rings)
{
    int64_t k, at = 0;
    rings->ring = arena_take(arena, (size_t)(2 * n) * 4);
    rings->ring_facets = arena_take(arena, (size_t)(2 * n) * 4);
    if (arena->failed) return;
    for (k = 0; k < n; k++) {
        rings->starts[k] = (int32_t)at;
        if (side->following[k] < 0) continue;
        rings->ring[at] = (int32_t)side->following[k];
        rings->ring[at + 1] = (int32_t)side->previous[k];
        rings->ring_facets[at] = 0;
        rings->ring_facets[at + 1] = 1;
        at += 2;
    }
    rings->starts[n] = (int32_t)at;
}

/* Forget the last point, which closed a disc, and name the two sides as facets 0 and 1. */
static void leave_out(struct rings *rings, int64_t point, int64_t n_upper)
{
    int64_t k, i, at = 0;
    for (k = 0; k < point; k++) {
        int64_t begin = rings->starts[k], end = rings->starts[k + 1];
        rings->starts[k] = (int32_t)at;
        for (i = begin; i < end; i++) {
            if (rings->ring[i] == point) continue;
            /* A neighbour just before the point loses the facet between them: what follows is the lower side. */
            rings->ring[at] = rings->ring[i];
            rings->ring_facets[at] = rings->ring_facets[i] >= n_upper;
            at++;
        }
    }
    rings->starts[point] = (int32_t)at;
}

/* Rings of one side, which is closed by triangles from its border to a point of its own. */
static int close_disc(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n,
                      const struct side *side, struct rings *rings)
{
    uint8_t *corner = rings->corner;
    int64_t n_facets = side->n_facets + side->n_border, k;
    double *all = arena_take(arena, (size_t)(3 * n + 3) * 8);
    int32_t *facets = arena_take(arena, (size_t)(3 * n_facets) * 4);
    if (arena->failed) return 0;
    memcpy(all, points, (size_t)(3 * n) * 8);
    memcpy(all + 3 * n, points, 3 * 8);
    memcpy(facets, side->facets, (size_t)(3 * side->n_facets) * 4);
    for (k = 0; k < side->n_border; k++) {
        int32_t *f = facets + 3 * (side->n_facets + k);
        f[0] = side->border[2 * k + 1];
        f[1] = side->border[2 * k];
        f[2] = (int32_t)n;
    }
    if (order(kernels, arena, all, n + 1, facets, n_facets, rings) != 0) return 0;
    rings->corner = corner;
    leave_out(rings, n, side->n_facets);
    return 1;
}

/* A flat hull, both sides triangulated in one way. */
static int as_polygon(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n,
                      const int32_t *facets, int64_t n_facets, struct rings *rings)
{
    struct side side;
    uint8_t *upward = arena_take(arena, (size_t)n_facets), *used = arena_take(arena, (size_t)n);
    double normal[3] = {0.0, 0.0, 0.0}, length, *both;
    int64_t k;
    int all_corners = 1, axis;
    side.facets = arena_take(arena, (size_t)(3 * n_facets) * 4);
    side.n_facets = 0;
    if (arena->failed) return 0;
    rings->flat = 1;
    mark_upper(rings, facets, n_facets, upward);
    memset(used, 0, (size_t)n);
    for (k = 0; k < n_facets; k++) {
        for (axis = 0; axis < 3; axis++) {
            double part = rings->normals[3 * k + axis] * (upward[k] ? 1.0 : -1.0);
            normal[axis] = k == 0 ? part : normal[axis] + part;
            used[facets[3 * k + axis]] = 1;
        }
        if (upward[k]) memcpy(side.facets + 3 * side.n_facets++, facets + 3 * k, 3 * 4);
    }
    find_border(arena, n, &side);
    if (arena->failed || 2 * side.n_facets != n_facets) return 0;
    for (k = 0; k < n; k++) {
        int on_it = side.following[k] >= 0;
        if (on_it != (side.previous[k] >= 0)) return 0;
        rings->corner[k] = on_it && is_bent(points, k, side.following[k], side.previous[k]);
        all_corners = all_corners && rings->corner[k] == used[k];
    }
    if (all_corners) border_alone(arena, n, &side, rings);
    else if (!close_disc(kernels, arena, points, n, &side, rings)) return 0;
    if ((both = arena_take(arena, 6 * 8)) == NULL) return 0;
    length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    for (axis = 0; axis < 3; axis++) {
        both[axis] = normal[axis] / length;
        both[3 + axis] = -normal[axis] / length;
    }
    rings->normals = both;
    rings->n_normals = 2;
    return 1;
}

struct rings rings_of(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n,
                      const int32_t *facets, int64_t n_facets)
{
    struct rings rings = {NULL, NULL, NULL, NULL, 0, NULL, 0, 0};
    int64_t result = order(kernels, arena, points, n, facets, n_facets, &rings);
    rings.good = result == 0 || (result == 1 && as_polygon(kernels, arena, points, n, facets, n_facets, &rings));
    return rings;
}
