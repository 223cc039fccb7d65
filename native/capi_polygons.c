/* Polygons that bound a hull: collide/lowering/hull_faces.py, sum by sum. */
#include "capi_faces.h"

#include <stdlib.h>
#include <string.h>

/* Neighbours whose corners are off each other's plane by no more than this part of the size are one face. */
static const double COPLANAR = 1.0 / 70368744177664.0; /* 2^-46 */
/* Triangles of less than so much of their longest side's square have normals made perpendicular to it. */
static const double THIN = 1.0 / 64.0;

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

/* Unit normals, twice the areas, longest sides of triangles, and whether each is no sliver; how many are not. */
static int64_t put_normals(struct making *m, int64_t n)
{
    int64_t k, n_wide = 0;
    int j, side;
    m->units = arena_take(&m->arena, (size_t)(3 * n) * sizeof *m->units);
    m->areas = arena_take(&m->arena, (size_t)n * sizeof *m->areas);
    m->longest = arena_take(&m->arena, (size_t)n * sizeof *m->longest);
    m->wide = arena_take(&m->arena, (size_t)n * sizeof *m->wide);
    for (k = 0; !m->arena.failed && k < n; k++) {
        const double *p = corner_of(m, k, 0), *q = corner_of(m, k, 1), *r = corner_of(m, k, 2);
        double a[3], b[3], e[3], *u = m->units + 3 * k, length, square = -1.0;
        for (j = 0; j < 3; j++) {
            a[j] = q[j] - p[j];
            b[j] = r[j] - p[j];
        }
        for (j = 0; j < 3; j++) u[j] = a[(j + 1) % 3] * b[(j + 2) % 3] - a[(j + 2) % 3] * b[(j + 1) % 3];
        m->areas[k] = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
        length = m->areas[k] > 0.0 ? m->areas[k] : 1.0;
        for (j = 0; j < 3; j++) u[j] /= length;
        for (side = 0; side < 3; side++) {
            const double *from = corner_of(m, k, side), *to = corner_of(m, k, (side + 1) % 3);
            double d[3], along;
            for (j = 0; j < 3; j++) d[j] = to[j] - from[j];
            along = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            if (along > square) {
                square = along;
                m->longest[k] = side;
                memcpy(e, d, sizeof e);
            }
        }
        m->wide[k] = m->areas[k] > m->tolerance * sqrt(square);
        n_wide += m->wide[k];
        if (m->wide[k] && m->areas[k] < THIN * square) {
            double along = (u[0] * e[0] + u[1] * e[1] + u[2] * e[2]) / square;
            for (j = 0; j < 3; j++) u[j] = u[j] - along * e[j];
            length = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
            for (j = 0; j < 3; j++) u[j] /= length;
        }
    }
    return n_wide;
}

static int64_t root_of(int64_t *parent, int64_t k)
{
    while (parent[k] != k) {
        parent[k] = parent[parent[k]];
        k = parent[k];
    }
    return k;
}

/* How far the corners of some triangles are from the plane of one. */
static double off_plane(const struct making *m, const int64_t *members, int64_t n, int64_t plane)
{
    double off = 0.0;
    int64_t k;
    for (k = 0; k < 3 * n; k++) {
        double along = fabs(product_of(corner_of(m, members[k / 3], (int)(k % 3)), corner_of(m, plane, 0), m->units + 3 * plane));
        if (along > off) off = along;
    }
    return off;
}

/* Whether the smaller of two neighbours lies in the plane of the larger, and none is a sliver. */
static int are_coplanar(const struct making *m, int64_t a, int64_t b)
{
    int64_t larger = m->areas[a] >= m->areas[b] ? a : b, smaller = larger == a ? b : a;
    const double *u = m->units + 3 * a, *v = m->units + 3 * b;
    if (!m->wide[a] || !m->wide[b]) return 0;
    return off_plane(m, &smaller, 1, larger) <= m->tolerance && u[0] * v[0] + u[1] * v[1] + u[2] * v[2] > 0.0;
}

static void join(int64_t *parent, int64_t a, int64_t b)
{
    int64_t i = root_of(parent, a), j = root_of(parent, b);
    parent[i > j ? i : j] = i < j ? i : j;
}

/* Each sliver joined to one face beside it whose plane its corners do not leave. beside : the triangle across each side. */
static void join_slivers(const struct making *m, const int64_t *beside, int64_t *parent, int64_t *plane_of)
{
    int64_t n = m->hull.n_facets, k, joined;
    for (k = 0; k < n; k++) plane_of[k] = m->wide[k] ? k : -1;
    do {
        joined = 0;
        for (k = 0; k < n; k++) {
            int side;
            for (side = 0; plane_of[k] < 0 && side < 3; side++) {
                int64_t other = beside[3 * k + (m->longest[k] + side) % 3];
                if (plane_of[other] < 0 || !(off_plane(m, &k, 1, plane_of[other]) <= m->tolerance)) continue;
                plane_of[k] = plane_of[other];
                join(parent, k, other);
                joined++;
            }
        }
    } while (joined > 0);
}

/* Of each triangle the least one of its face. */
static void put_components(struct making *m, int64_t *parent)
{
    int64_t n = m->hull.n_facets, k;
    struct edge *edges = arena_take(&m->arena, (size_t)(3 * n) * sizeof *edges);
    int64_t *beside = arena_take(&m->arena, (size_t)(3 * n) * sizeof *beside);
    int64_t *plane_of = arena_take(&m->arena, (size_t)n * sizeof *plane_of);
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
        beside[k] = b = twin != NULL ? twin->place / 3 : a;
        if (a < b && are_coplanar(m, a, b)) join(parent, a, b);
    }
    join_slivers(m, beside, parent, plane_of);
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

/* The widest of some triangles, of equal ones the first. */
static int64_t widest_of(const struct making *m, const int64_t *members, int64_t n)
{
    int64_t widest = members[0], k;
    for (k = 1; k < n; k++)
        if (m->areas[members[k]] > m->areas[widest]) widest = members[k];
    return widest;
}

/* A face of some triangles; a sliver's normal is 0. */
static void put_piece(struct making *m, const int64_t *members, int64_t n, const int64_t *loop, int64_t length)
{
    int64_t widest = widest_of(m, members, n);
    if (m->wide[widest]) put_face(m, m->units + 3 * widest, off_plane(m, members, n, widest), members[0], loop, length);
    else put_face(m, NULL, 0.0, members[0], loop, length);
}

/* Triangles that are one face, or a face each where they make up no polygon. */
static void put_merged(struct making *m, const int64_t *members, int64_t n, struct edge *edges, int64_t *loop)
{
    int64_t length = 3, k;
    int j;
    if (n == 1)
        for (k = 0; k < 3; k++) loop[k] = m->hull.facets[3 * members[0] + k];
    else length = boundary(m, members, n, edges, edges + 3 * n, loop);
    if (length > 0 && off_plane(m, members, n, widest_of(m, members, n)) <= 4.0 * m->tolerance) {
        put_piece(m, members, n, loop, length);
        return;
    }
    for (k = 0; k < n; k++) {
        for (j = 0; j < 3; j++) loop[j] = m->hull.facets[3 * members[k] + j];
        put_piece(m, members + k, 1, loop, 3);
    }
}

/* Faces of a hull with an inside. */
static void put_solid(struct making *m)
{
    int64_t n = m->hull.n_facets, k, begin;
    int64_t *face_of = arena_take(&m->arena, (size_t)n * sizeof *face_of), *order = arena_take(&m->arena, (size_t)n * sizeof *order);
    int64_t *starts = arena_take(&m->arena, (size_t)(n + 1) * sizeof *starts), *loop = arena_take(&m->arena, (size_t)(3 * n) * sizeof *loop);
    struct edge *edges = arena_take(&m->arena, (size_t)(6 * n) * sizeof *edges);
    if (m->arena.failed) return;
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
    double behind[3], off;
    const double *normal;
    if (m->arena.failed) return;
    for (k = 0; k < n; k++) members[k] = k;
    length = boundary(m, members, n, edges, edges + 3 * n, loop);
    widest = widest_of(m, members, n);
    normal = m->units + 3 * widest;
    off = off_plane(m, members, n, widest);
    put_face(m, normal, off, 0, loop, length);
    for (k = 0; k < length / 2; k++) {
        int64_t other = loop[k];
        loop[k] = loop[length - 1 - k];
        loop[length - 1 - k] = other;
    }
    for (k = 0; k < 3; k++) behind[k] = -normal[k];
    put_face(m, behind, off, n, loop, length);
}

/* How far a point is from the line between two others. */
static double off_line(const double *v, const double *p, const double *q)
{
    double w[3], e[3], square, t;
    int j;
    for (j = 0; j < 3; j++) {
        w[j] = v[j] - p[j];
        e[j] = q[j] - p[j];
    }
    square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    t = square > 0.0 ? (w[0] * e[0] + w[1] * e[1] + w[2] * e[2]) / square : 0.0;
    t = t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
    for (j = 0; j < 3; j++) w[j] = w[j] - t * e[j];
    return sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
}

/* The two ends of a hull that is a line but for rounding. */
static void put_segment(struct making *m)
{
    double widest = -1.0, off = 0.0, low, high;
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
    for (k = 0; k < m->hull.n_vertices; k++) {
        double away = off_line(m->points + 3 * (int64_t)m->hull.vertices[k], m->points + 3 * ends[0], m->points + 3 * ends[1]);
        if (away > off) off = away;
    }
    put_face(m, NULL, off, -1, ends, 2);
}

/* Corners of faces, linked, while some are left out. bent : how far what was left out is off the side that begins there. */
struct ring {
    int64_t *ahead, *behind, *face_of, *sizes;
    double *bent;
};

/* Where each vertex that two faces share alone has its corners, -1 of others: first, then second. */
static void find_pairs(const struct making *m, int64_t *counts, int64_t *first, int64_t *second)
{
    int64_t k;
    for (k = 0; k < m->n; k++) counts[k] = 0;
    for (k = 0; k < m->n_corners; k++) {
        int64_t v = m->corners[k];
        if (counts[v] == 0) first[v] = k;
        if (counts[v] == 1) second[v] = k;
        counts[v]++;
    }
}

static void link_ring(const struct making *m, struct ring *ring)
{
    int64_t face, k;
    for (face = 0; face < m->n_faces; face++) {
        ring->sizes[face] = m->starts[face + 1] - m->starts[face];
        for (k = m->starts[face]; k < m->starts[face + 1]; k++) {
            ring->ahead[k] = k + 1 < m->starts[face + 1] ? k + 1 : m->starts[face];
            ring->behind[k] = k > m->starts[face] ? k - 1 : m->starts[face + 1] - 1;
            ring->face_of[k] = face;
            ring->bent[k] = 0.0;
        }
    }
}

/* Leaves out the corner at place i of one face and j of another, if it lies on the line between its neighbours but for rounding. */
static void leave_out(struct making *m, struct ring *ring, int64_t i, int64_t j)
{
    int64_t v = m->corners[i], p = m->corners[ring->behind[i]], q = m->corners[ring->ahead[i]];
    double before = ring->bent[ring->behind[i]], after = ring->bent[i], off;
    int k;
    if (m->corners[ring->ahead[j]] != p || m->corners[ring->behind[j]] != q) return;
    if (ring->sizes[ring->face_of[i]] <= 3 || ring->sizes[ring->face_of[j]] <= 3) return;
    off = off_line(m->points + 3 * v, m->points + 3 * p, m->points + 3 * q) + (after > before ? after : before);
    if (off > m->tolerance) return;
    for (k = 0; k < 2; k++) {
        int64_t at = k == 0 ? i : j, face = ring->face_of[at];
        ring->bent[ring->behind[at]] = off;
        ring->ahead[ring->behind[at]] = ring->ahead[at];
        ring->behind[ring->ahead[at]] = ring->behind[at];
        ring->sizes[face]--;
        if (off > m->flatness[face]) m->flatness[face] = off;
        m->corners[at] = -1;
    }
}

/* Leaves out corners of two faces alone that lie on the line between their neighbours but for rounding. */
static void straighten(struct making *m)
{
    struct ring ring;
    size_t corners = (size_t)m->n_corners, n = (size_t)m->n;
    int64_t *counts = arena_take(&m->arena, n * sizeof *counts), *first = arena_take(&m->arena, n * sizeof *first);
    int64_t *second = arena_take(&m->arena, n * sizeof *second), v, face, k, at = 0;
    ring.ahead = arena_take(&m->arena, corners * sizeof *ring.ahead);
    ring.behind = arena_take(&m->arena, corners * sizeof *ring.behind);
    ring.face_of = arena_take(&m->arena, corners * sizeof *ring.face_of);
    ring.sizes = arena_take(&m->arena, (size_t)m->n_faces * sizeof *ring.sizes);
    ring.bent = arena_take(&m->arena, corners * sizeof *ring.bent);
    if (m->arena.failed) return;
    find_pairs(m, counts, first, second);
    link_ring(m, &ring);
    for (v = 0; v < m->n; v++)
        if (counts[v] == 2) leave_out(m, &ring, first[v], second[v]);
    for (face = k = 0; face < m->n_faces; face++) {
        int64_t end = m->starts[face + 1];
        for (; k < end; k++)
            if (m->corners[k] >= 0) m->corners[at++] = m->corners[k];
        m->starts[face + 1] = at;
    }
    m->n_corners = at;
}

void put_polygons(struct making *m)
{
    size_t most = (size_t)m->hull.n_facets + 1;
    int64_t n = m->hull.dimension > 1 ? m->hull.n_facets : 0, n_wide, k;
    m->normals = arena_take(&m->arena, 3 * most * sizeof *m->normals);
    m->flatness = arena_take(&m->arena, most * sizeof *m->flatness);
    m->triangles = arena_take(&m->arena, most * sizeof *m->triangles);
    m->starts = arena_take(&m->arena, (most + 1) * sizeof *m->starts);
    m->corners = arena_take(&m->arena, 3 * most * sizeof *m->corners);
    if (m->arena.failed) return;
    m->starts[0] = 0;
    for (k = 0, m->tolerance = 0.0; k < 9 * n; k++) {
        double off = fabs(corner_of(m, k / 9, (int)(k / 3 % 3))[k % 3] - corner_of(m, 0, 0)[k % 3]);
        if (off > m->tolerance) m->tolerance = off;
    }
    m->tolerance *= COPLANAR;
    n_wide = put_normals(m, n);
    if (m->arena.failed || m->hull.dimension == 0) return;
    if (n_wide == 0) {
        put_segment(m);
        return;
    }
    if (m->hull.dimension == 2) put_flat(m);
    else put_solid(m);
    if (!m->arena.failed) straighten(m);
}
