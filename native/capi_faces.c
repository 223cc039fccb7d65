/* Faces of hulls as kernels read them: `_linked` and `HullFaceTable` of collide/lowering/hull_faces.py. */
#include "capi_faces.h"

#include <stdlib.h>
#include <string.h>

#if defined(_MSC_VER)
#include <intrin.h>
#define PUT_IF_NULL(place, made) (_InterlockedCompareExchangePointer((void *volatile *)(place), (made), NULL) == NULL)
#else
#define PUT_IF_NULL(place, made) __sync_bool_compare_and_swap((place), NULL, (made))
#endif

/* A corner under the number of the edge from it to the next, whichever way round. */
struct numbered {
    int64_t low, high, place;
};

static int by_edge(const void *one, const void *other)
{
    const struct numbered *p = one, *q = other;
    if (p->low != q->low) return p->low < q->low ? -1 : 1;
    return p->high < q->high ? -1 : p->high > q->high;
}

/* Integers of the faces, in the order of the row's addresses from TRIANGLES_AT on, then ids of vertices. */
struct links {
    int64_t *triangles, *starts, *corners, *edges, *face_of, *fan_starts, *fans, *vertex_ids;
};

/* Where arrays of `links` stand in one piece of memory; how many integers that is. */
static size_t lay_out_links(struct links *links, int64_t *memory, const struct making *m)
{
    size_t faces = (size_t)m->n_faces, corners = (size_t)m->n_corners, n = (size_t)m->n, at = 0, k;
    size_t sizes[8];
    int64_t **arrays[8];
    sizes[0] = faces;
    sizes[1] = faces + 1;
    sizes[2] = sizes[3] = sizes[4] = corners;
    sizes[5] = n + 1;
    sizes[6] = corners;
    sizes[7] = n;
    arrays[0] = &links->triangles;
    arrays[1] = &links->starts;
    arrays[2] = &links->corners;
    arrays[3] = &links->edges;
    arrays[4] = &links->face_of;
    arrays[5] = &links->fan_starts;
    arrays[6] = &links->fans;
    arrays[7] = &links->vertex_ids;
    for (k = 0; k < 8; k++) {
        *arrays[k] = memory == NULL ? NULL : memory + at;
        at += sizes[k];
    }
    return at;
}

/* Numbers of edges: the same from both of their faces, in the order of their ends. */
static void number_edges(struct making *m, struct links *links)
{
    struct numbered *sorted = arena_take(&m->arena, (size_t)m->n_corners * sizeof *sorted);
    int64_t face, k, number = -1;
    if (m->arena.failed) return;
    for (face = 0; face < m->n_faces; face++)
        for (k = m->starts[face]; k < m->starts[face + 1]; k++) {
            int64_t here = m->corners[k], next = m->corners[k + 1 < m->starts[face + 1] ? k + 1 : m->starts[face]];
            links->face_of[k] = face;
            sorted[k].low = here < next ? here : next;
            sorted[k].high = here < next ? next : here;
            sorted[k].place = k;
        }
    qsort(sorted, (size_t)m->n_corners, sizeof *sorted, by_edge);
    for (k = 0; k < m->n_corners; k++) {
        if (k == 0 || by_edge(&sorted[k - 1], &sorted[k]) != 0) number++;
        links->edges[sorted[k].place] = number;
    }
}

/* Which corners are at a vertex; the ids of vertices that have some into vertex_ids: how many. */
static int64_t link_fans(const struct making *m, struct links *links)
{
    int64_t k, n_ids = 0;
    memset(links->fan_starts, 0, (size_t)(m->n + 1) * sizeof *links->fan_starts);
    for (k = 0; k < m->n_corners; k++) links->fan_starts[m->corners[k] + 1]++;
    for (k = 0; k < m->n; k++) {
        if (links->fan_starts[k + 1] > 0) links->vertex_ids[n_ids++] = k;
        links->fan_starts[k + 1] += links->fan_starts[k];
    }
    for (k = 0; k < m->n_corners; k++) links->fans[links->fan_starts[m->corners[k]]++] = k;
    for (k = m->n; k > 0; k--) links->fan_starts[k] = links->fan_starts[k - 1]; /* each had moved to the end of its own */
    links->fan_starts[0] = 0;
    if (n_ids == 0) links->vertex_ids[n_ids++] = m->hull.vertices[0];
    return n_ids;
}

/* Everything into a block of doubles and one of integers. */
static void link_faces(struct making *m, struct hull_faces *faces)
{
    struct links links;
    size_t n_faces = (size_t)m->n_faces, padded;
    int64_t *integers, n_ids, k, axis;
    double *columns;
    if ((integers = malloc(lay_out_links(&links, NULL, m) * sizeof *integers)) == NULL) return;
    faces->held[1] = integers;
    lay_out_links(&links, integers, m);
    memcpy(links.triangles, m->triangles, n_faces * sizeof *links.triangles);
    memcpy(links.starts, m->starts, (n_faces + 1) * sizeof *links.starts);
    memcpy(links.corners, m->corners, (size_t)m->n_corners * sizeof *links.corners);
    number_edges(m, &links);
    n_ids = link_fans(m, &links);
    padded = ((size_t)n_ids + COORDINATES - 1) / COORDINATES * COORDINATES;
    columns = cache_lines((3 * padded + 4 * n_faces) * sizeof *columns, &faces->held[0]);
    if (columns == NULL || m->arena.failed) return;
    for (axis = 0; axis < 3; axis++)
        for (k = 0; k < (int64_t)padded; k++)
            columns[axis * (int64_t)padded + k] = m->points[3 * links.vertex_ids[k < n_ids ? k : 0] + axis];
    memcpy(columns + 3 * padded, m->normals, 3 * n_faces * sizeof *columns);
    memcpy(columns + 3 * padded + 3 * n_faces, m->flatness, n_faces * sizeof *columns);
    faces->ints[N_VERTICES] = n_ids;
    faces->ints[FACE_PADDED] = (int64_t)padded;
    faces->ints[N_FACES] = m->n_faces;
    faces->ints[FACE_COLUMNS_AT] = address_of(columns);
    faces->ints[VERTEX_IDS_AT] = address_of(links.vertex_ids);
    faces->ints[NORMALS_AT] = address_of(columns + 3 * padded);
    faces->ints[FLATNESS_AT] = address_of(columns + 3 * padded + 3 * n_faces);
    faces->ints[TRIANGLES_AT] = address_of(links.triangles);
    faces->ints[STARTS_AT] = address_of(links.starts);
    faces->ints[CORNERS_AT] = address_of(links.corners);
    faces->ints[EDGES_AT] = address_of(links.edges);
    faces->ints[FACE_OF_AT] = address_of(links.face_of);
    faces->ints[FAN_STARTS_AT] = address_of(links.fan_starts);
    faces->ints[FANS_AT] = address_of(links.fans);
    faces->largest = ROUND_CORNERS;
    for (k = 0; k < m->n_faces; k++)
        if (m->starts[k + 1] - m->starts[k] > faces->largest) faces->largest = m->starts[k + 1] - m->starts[k];
}

/* Points of a shape, one after another, as they were given. */
static const double *points_of(const collide_shape *shape, struct arena *arena)
{
    int64_t n = shape->ints[COUNT], padded = shape->ints[PADDED], k;
    const double *columns = (const double *)(intptr_t)shape->ints[ADDRESS];
    double *points = arena_take(arena, (size_t)(3 * n) * sizeof *points);
    for (k = 0; points != NULL && k < 3 * n; k++) points[k] = columns[k % 3 * padded + k / 3];
    return points;
}

static collide_status make_faces(const collide_shape *shape, struct hull_faces **out)
{
    const struct collide_kernels *kernels = kernels_here();
    struct hull_faces *faces;
    struct making m;
    rounding given;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    if ((faces = calloc(1, sizeof *faces)) == NULL) return COLLIDE_NO_MEMORY;
    memset(&m, 0, sizeof m);
    given = round_as_kernels_do();
    arena_begin(&m.arena, NULL, 0);
    m.n = shape->ints[COUNT];
    if ((m.points = points_of(shape, &m.arena)) != NULL) m.hull = hull_of(kernels, &m.arena, m.points, m.n);
    if (!m.arena.failed) put_polygons(&m);
    if (!m.arena.failed) link_faces(&m, faces);
    arena_end(&m.arena);
    round_as_before(given);
    if (m.arena.failed || faces->largest == 0) {
        free_faces(faces);
        return COLLIDE_NO_MEMORY;
    }
    *out = faces;
    return COLLIDE_OK;
}

void free_faces(struct hull_faces *faces)
{
    if (faces == NULL) return;
    free(faces->held[0]);
    free(faces->held[1]);
    free(faces);
}

collide_status faces_of(const collide_shape *shape, const struct hull_faces **faces)
{
    collide_shape *kept = (collide_shape *)shape; /* what is made is no part of what the shape is */
    struct hull_faces *made = NULL;
    collide_status status;
    *faces = NULL;
    if (shape->ints[KIND] != POINTS) return COLLIDE_OK;
    if (kept->faces == NULL) {
        if ((status = make_faces(shape, &made)) != COLLIDE_OK) return status;
        if (!PUT_IF_NULL(&kept->faces, made)) free_faces(made); /* another thread was sooner */
    }
    *faces = kept->faces;
    return COLLIDE_OK;
}
