/* Polygons that bound a hull: collide/lowering/hull_faces.py, sum by sum. */
#include "capi_faces.h"

#include <stdlib.h>
#include <string.h>

/* Neighbours whose corners are off each other's plane by no more than this part of the size are one face. */
static const double COPLANAR = 1.0 / 70368744177664.0; /* 2^-46 */

/* An edge, its tail first, and the place it was found at. */
struct edge {
    int64_t tail, head, place;
};

static int by_ends(const void *one, const void *other)
{
    const struct edge *p = one, *q = other;
    if (p->tail != q->tail) return p->tail < q->tail ? -1 : 1;
    if (p->head != q->head) return p->head < q->head ? -1 : 1;
    return p->place < q->place ? -1 : p->place > q->place;
}

static int by_ends_alone(const void *one, const void *other)
{
    const struct edge *p = one, *q = other;
    if (p->tail != q->tail) return p->tail < q->tail ? -1 : 1;
    return p->head < q->head ? -1 : p->head > q->head;
}

/* The first edge with these ends; NULL where there is none. edges : in order. */
static const struct edge *find_edge(const struct edge *edges, int64_t n, int64_t tail, int64_t head)
{
    int64_t low = 0, high = n;
    struct edge wanted;
    wanted.tail = tail;
    wanted.head = head;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (by_ends_alone(&edges[middle], &wanted) < 0) low = middle + 1;
        else high = middle;
    }
    return low < n && by_ends_alone(&edges[low], &wanted) == 0 ? &edges[low] : NULL;
}

static const double *corner_of(const struct making *m, int64_t triangle, int k)
{
    return m->points + 3 * (int64_t)m->hull.facets[3 * triangle + k];
}

/* The product of p - q with a vector. */
static double product_of(const double *p, const double *q, const double *with)
{
    return (p[0] - q[0]) * with[0] + (p[1] - q[1]) * with[1] + (p[2] - q[2]) * with[2];
}

/* Unit normals, and twice the areas of triangles. */
static void put_normals(struct making *m, int64_t n)
{
    int64_t k;
    int j;
    m->units = arena_take(&m->arena, (size_t)(3 * n) * sizeof *m->units);
    m->areas = arena_take(&m->arena, (size_t)n * sizeof *m->areas);
    for (k = 0; !m->arena.failed && k < n; k++) {
        const double *p = corner_of(m, k, 0), *q = corner_of(m, k, 1), *r = corner_of(m, k, 2);
        double a[3], b[3], *u = m->units + 3 * k, length;
        for (j = 0; j < 3; j++) {
            a[j] = q[j] - p[j];
            b[j] = r[j] - p[j];
        }
        for (j = 0; j < 3; j++) u[j] = a[(j + 1) % 3] * b[(j + 2) % 3] - a[(j + 2) % 3] * b[(j + 1) % 3];
        m->areas[k] = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
        length = m->areas[k] > 0.0 ? m->areas[k] : 1.0;
        for (j = 0; j < 3; j++) u[j] /= length;
    }
}

static int64_t root_of(int64_t *parent, int64_t k)
{
    while (parent[k] != k) {
        parent[k] = parent[parent[k]];
        k = parent[k];
    }
    return k;
}

/* Whether the smaller of two neighbours lies in the plane of the larger. */
static int are_coplanar(const struct making *m, int64_t a, int64_t b)
{
    int64_t larger = m->areas[a] >= m->areas[b] ? a : b, smaller = larger == a ? b : a;
    const double *u = m->units + 3 * a, *v = m->units + 3 * b;
    double off = 0.0;
    int k;
    for (k = 0; k < 3; k++) {
        double along = fabs(product_of(corner_of(m, smaller, k), corner_of(m, larger, 0), m->units + 3 * larger));
        if (along > off) off = along;
    }
    return off <= m->tolerance && u[0] * v[0] + u[1] * v[1] + u[2] * v[2] > 0.0;
}

/* Of each triangle the least one of its face. */
static void put_components(struct making *m, int64_t *parent)
{
    int64_t n = m->hull.n_facets, k;
    struct edge *edges = arena_take(&m->arena, (size_t)(3 * n) * sizeof *edges);
    if (m->arena.failed) return;
    for (k = 0; k < 3 * n; k++) {
        edges[k].tail = m->hull.facets[k];
        edges[k].head = m->hull.facets[k - k % 3 + (k + 1) % 3];
        edges[k].place = k;
    }
    qsort(edges, (size_t)(3 * n), sizeof *edges, by_ends);
    for (k = 0; k < n; k++) parent[k] = k;
    for (k = 0; k < 3 * n; k++) {
        int64_t a = k / 3, b;
        const struct edge *twin = find_edge(edges, 3 * n, m->hull.facets[k - k % 3 + (k + 1) % 3], m->hull.facets[k]);
        b = twin != NULL ? twin->place / 3 : a;
        if (a < b && are_coplanar(m, a, b)) {
            int64_t i = root_of(parent, a), j = root_of(parent, b);
            parent[i > j ? i : j] = i < j ? i : j;
        }
    }
    for (k = 0; k < n; k++) parent[k] = root_of(parent, k);
}

/* The corners around triangles into `loop`; how many, 0 where that is no simple loop. edges, rim : room for 3 each a triangle. */
static int64_t boundary(const struct making *m, const int64_t *members, int64_t n, struct edge *edges, struct edge *rim, int64_t *loop)
{
    int64_t k, n_rim = 0, length = 0;
    const struct edge *at;
    for (k = 0; k < 3 * n; k++) {
        const int32_t *triangle = m->hull.facets + 3 * members[k / 3];
        edges[k].tail = triangle[k % 3];
        edges[k].head = triangle[(k + 1) % 3];
        edges[k].place = k;
    }
    qsort(edges, (size_t)(3 * n), sizeof *edges, by_ends);
    for (k = 0; k < 3 * n; k++) { /* in order of their tails */
        if (k > 0 && by_ends_alone(&edges[k - 1], &edges[k]) == 0) continue;
        if (find_edge(edges, 3 * n, edges[k].head, edges[k].tail) != NULL) continue;
        if (n_rim > 0 && rim[n_rim - 1].tail == edges[k].tail) return 0;
        rim[n_rim++] = edges[k];
    }
    if (n_rim == 0) return 0;
    for (at = rim; length < n_rim;) {
        int64_t low = 0, high = n_rim, head = at->head;
        loop[length++] = at->tail;
        if (head == rim[0].tail) return length == n_rim ? length : 0;
        while (low < high) {
            int64_t middle = low + (high - low) / 2;
            if (rim[middle].tail < head) low = middle + 1;
            else high = middle;
        }
        if (low == n_rim || rim[low].tail != head) return 0;
        at = &rim[low];
    }
    return 0;
}

static void put_face(struct making *m, const double *normal, double flatness, int64_t triangle, const int64_t *loop, int64_t length)
{
    int64_t face = m->n_faces++;
    if (normal != NULL) memcpy(m->normals + 3 * face, normal, 3 * sizeof *normal);
    else m->normals[3 * face] = m->normals[3 * face + 1] = m->normals[3 * face + 2] = 0.0;
    m->flatness[face] = flatness;
    m->triangles[face] = triangle;
    memcpy(m->corners + m->n_corners, loop, (size_t)length * sizeof *loop);
    m->n_corners += length;
    m->starts[m->n_faces] = m->n_corners;
}

static void put_triangle(struct making *m, int64_t triangle, double flatness)
{
    int64_t loop[3];
    int k;
    for (k = 0; k < 3; k++) loop[k] = m->hull.facets[3 * triangle + k];
    put_face(m, m->units + 3 * triangle, flatness, triangle, loop, 3);
}

/* The widest of some triangles, of equal ones the first. */
static int64_t widest_of(const struct making *m, const int64_t *members, int64_t n)
{
    int64_t widest = members[0], k;
    for (k = 1; k < n; k++)
        if (m->areas[members[k]] > m->areas[widest]) widest = members[k];
    return widest;
}

/* Triangles that are one face, or a face each where they make up no polygon. */
static void put_merged(struct making *m, const int64_t *members, int64_t n, struct edge *edges, int64_t *loop)
{
    int64_t widest = widest_of(m, members, n), length = 3, k;
    const double *normal = m->units + 3 * widest;
    double off = 0.0;
    for (k = 0; k < 3 * n; k++) {
        double along = fabs(product_of(corner_of(m, members[k / 3], (int)(k % 3)), corner_of(m, widest, 0), normal));
        if (along > off) off = along;
    }
    if (n == 1)
        for (k = 0; k < 3; k++) loop[k] = m->hull.facets[3 * members[0] + k];
    else length = boundary(m, members, n, edges, edges + 3 * n, loop);
    if (length > 0 && off <= 4.0 * m->tolerance) put_face(m, normal, off, members[0], loop, length);
    else
        for (k = 0; k < n; k++) put_triangle(m, members[k], m->tolerance);
}

/* Faces of a hull with an inside. */
static void put_solid(struct making *m)
{
    int64_t n = m->hull.n_facets, k, begin;
    int64_t *face_of = arena_take(&m->arena, (size_t)n * sizeof *face_of), *order = arena_take(&m->arena, (size_t)n * sizeof *order);
    int64_t *starts = arena_take(&m->arena, (size_t)(n + 1) * sizeof *starts), *loop = arena_take(&m->arena, (size_t)(3 * n) * sizeof *loop);
    struct edge *edges = arena_take(&m->arena, (size_t)(6 * n) * sizeof *edges);
    put_normals(m, n);
    if (m->arena.failed) return;
    for (k = 0, m->tolerance = 0.0; k < 9 * n; k++) {
        double off = fabs(corner_of(m, k / 9, (int)(k / 3 % 3))[k % 3] - corner_of(m, 0, 0)[k % 3]);
        if (off > m->tolerance) m->tolerance = off;
    }
    m->tolerance *= COPLANAR;
    put_components(m, face_of);
    if (m->arena.failed) return;
    memset(starts, 0, (size_t)(n + 1) * sizeof *starts);
    for (k = 0; k < n; k++) starts[face_of[k] + 1]++; /* sorted by face, triangles of one in their order */
    for (k = 0; k < n; k++) starts[k + 1] += starts[k];
    for (k = 0; k < n; k++) order[starts[face_of[k]]++] = k;
    for (begin = 0; begin < n;) {
        int64_t end = begin + 1;
        while (end < n && face_of[order[end]] == face_of[order[begin]]) end++;
        put_merged(m, order + begin, end - begin, edges, loop);
        begin = end;
    }
}

/* A flat hull's polygon, and the same seen from behind. */
static void put_flat(struct making *m)
{
    int64_t n = m->hull.n_facets / 2, k, widest, length;
    int64_t *members = arena_take(&m->arena, (size_t)n * sizeof *members), *loop = arena_take(&m->arena, (size_t)(3 * n) * sizeof *loop);
    struct edge *edges = arena_take(&m->arena, (size_t)(6 * n) * sizeof *edges);
    double behind[3], off = 0.0;
    const double *normal;
    put_normals(m, n);
    if (m->arena.failed) return;
    for (k = 0; k < n; k++) members[k] = k;
    length = boundary(m, members, n, edges, edges + 3 * n, loop);
    widest = widest_of(m, members, n);
    normal = m->units + 3 * widest;
    for (k = 0; k < length; k++) {
        double along = fabs(product_of(m->points + 3 * loop[k], corner_of(m, widest, 0), normal));
        if (along > off) off = along;
    }
    put_face(m, normal, off, 0, loop, length);
    for (k = 0; k < length / 2; k++) {
        int64_t other = loop[k];
        loop[k] = loop[length - 1 - k];
        loop[length - 1 - k] = other;
    }
    for (k = 0; k < 3; k++) behind[k] = -normal[k];
    put_face(m, behind, off, n, loop, length);
}

/* A segment's two ends. */
static void put_segment(struct making *m)
{
    double widest = -1.0, low, high;
    int64_t ends[2] = {0, 0}, k;
    int axis, j;
    for (axis = j = 0; j < 3; j++) {
        low = INFINITE;
        high = -INFINITE;
        for (k = 0; k < m->hull.n_vertices; k++) {
            double x = m->points[3 * (int64_t)m->hull.vertices[k] + j];
            if (x < low) low = x;
            if (x > high) high = x;
        }
        if (high - low > widest) {
            widest = high - low;
            axis = j;
        }
    }
    low = INFINITE;
    high = -INFINITE;
    for (k = 0; k < m->hull.n_vertices; k++) {
        double x = m->points[3 * (int64_t)m->hull.vertices[k] + axis];
        if (x < low) ends[0] = m->hull.vertices[k];
        if (x > high) ends[1] = m->hull.vertices[k];
        if (x < low) low = x;
        if (x > high) high = x;
    }
    put_face(m, NULL, 0.0, -1, ends, 2);
}

void put_polygons(struct making *m)
{
    size_t most = (size_t)m->hull.n_facets + 1;
    m->normals = arena_take(&m->arena, 3 * most * sizeof *m->normals);
    m->flatness = arena_take(&m->arena, most * sizeof *m->flatness);
    m->triangles = arena_take(&m->arena, most * sizeof *m->triangles);
    m->starts = arena_take(&m->arena, (most + 1) * sizeof *m->starts);
    m->corners = arena_take(&m->arena, 3 * most * sizeof *m->corners);
    if (m->arena.failed) return;
    m->starts[0] = 0;
    if (m->hull.dimension == 1) put_segment(m);
    if (m->hull.dimension == 2) put_flat(m);
    if (m->hull.dimension == 3) put_solid(m);
}
