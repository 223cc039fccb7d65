/* Rows of contacts with a height field: each once, and of many those that tell most. */
#include "host_terrain_task.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Rows that are not there yet, up to the margin. */
void keep_rows(const struct task *task, const collide_contact *rows, int64_t n)
{
    struct terrain_space *own = task->own;
    double near = 4.0 * task->tolerance * task->tolerance;
    int64_t k;
    for (k = 0; k < n && own->n_rows < MAX_ROWS; k++) {
        int i = 0;
        if (rows[k].distance > task->pair->margin) continue;
        while (i < own->n_rows && !(square_between(own->rows[i].point_a, rows[k].point_a) <= near &&
                                    dot3(own->rows[i].normal, rows[k].normal) > SAME_NORMAL))
            i++;
        if (i == own->n_rows) own->rows[own->n_rows++] = rows[k];
        else if (rows[k].distance < own->rows[i].distance) own->rows[i] = rows[k];
    }
}

/* Rows of one normal, seen along it. */
struct spot {
    double u, v, distance;
    int row;
};

static int from_left(const void *one, const void *other)
{
    const struct spot *p = one, *q = other;
    if (p->u != q->u) return p->u < q->u ? -1 : 1;
    return p->v < q->v ? -1 : p->v > q->v;
}

/* Twice the area of a triangle, positive counter-clockwise. */
static double area_of(const struct spot *a, const struct spot *b, const struct spot *c)
{
    return (b->u - a->u) * (c->v - a->v) - (b->v - a->v) * (c->u - a->u);
}

/* Numbers of the spots around all others, counter-clockwise; how many. The spots are put in order. A. M. Andrew, "Another efficient
   algorithm for convex hulls in two dimensions" (1979). */
static int spots_around(struct spot *spots, int n, double flat, int *around)
{
    int k, count = 0, lower;
    qsort(spots, (size_t)n, sizeof *spots, from_left);
    for (k = 0; k < n; k++) {
        while (count >= 2 && area_of(spots + around[count - 2], spots + around[count - 1], spots + k) <= flat) count--;
        around[count++] = k;
    }
    lower = count + 1;
    for (k = n - 2; k >= 0; k--) {
        while (count >= lower && area_of(spots + around[count - 2], spots + around[count - 1], spots + k) <= flat) count--;
        around[count++] = k;
    }
    return count > 1 ? count - 1 : count;
}

/* Whether a spot is no deeper than what lies around it carries: than the triangle that it is in, of a fan over the spots around. */
static int is_carried(const struct spot *spots, const int *around, int count, const struct spot *spot, double flat, double tolerance)
{
    int k;
    for (k = 1; k + 1 < count; k++) {
        const struct spot *a = spots + around[0], *b = spots + around[k], *c = spots + around[k + 1];
        double whole = area_of(a, b, c), of_a = area_of(spot, b, c), of_b = area_of(a, spot, c), of_c = area_of(a, b, spot);
        if (of_a < -flat || of_b < -flat || of_c < -flat) continue;
        return spot->distance >= (of_a * a->distance + of_b * b->distance + of_c * c->distance) / whole - tolerance;
    }
    return 0;
}

/* Into `out` those of some spots that are farthest from all before, the deepest first; how many. */
static int64_t spread_out(const collide_contact *rows, const struct spot *spots, const int *corners, int n, int64_t most, collide_contact *out)
{
    double away[MAX_ROWS];
    int64_t count = 0;
    int k, best = 0;
    for (k = 1; k < n; k++)
        if (spots[corners[k]].distance < spots[corners[best]].distance) best = k;
    for (k = 0; k < n; k++) away[k] = INFINITE;
    while (count < most && count < n) {
        const struct spot *spot = spots + corners[best];
        out[count++] = rows[spot->row];
        for (k = 0; k < n; k++) {
            double du = spots[corners[k]].u - spot->u, dv = spots[corners[k]].v - spot->v, square = du * du + dv * dv;
            if (square < away[k]) away[k] = square;
        }
        away[best] = -1.0;
        for (k = 0, best = 0; k < n; k++)
            if (away[k] > away[best]) best = k;
    }
    return count;
}

/* Of rows of one normal those around all others, and those that are deeper than these carry, into `out`; how many. */
static int64_t reduce_patch(const collide_contact *rows, struct spot *spots, int n, double tolerance, int64_t most, collide_contact *out)
{
    int around[MAX_ROWS + 1], corners[MAX_ROWS], count, k, i, n_corners;
    double extent = 0.0, flat, slack = 0.0; /* a hundredth of the depth carries nothing */
    for (k = 0; k < n; k++) slack = -1e-2 * spots[k].distance > slack ? -1e-2 * spots[k].distance : slack;
    slack += tolerance;
    for (k = 1; k < n; k++) {
        extent = fabs(spots[k].u - spots[0].u) > extent ? fabs(spots[k].u - spots[0].u) : extent;
        extent = fabs(spots[k].v - spots[0].v) > extent ? fabs(spots[k].v - spots[0].v) : extent;
    }
    flat = 1e-3 * tolerance * extent;
    count = n_corners = spots_around(spots, n, flat, around);
    memcpy(corners, around, (size_t)count * sizeof *corners);
    for (k = 0; k < n; k++) {
        for (i = 0; i < count && around[i] != k; i++) {}
        if (i == count && !is_carried(spots, around, count, spots + k, 10.0 * flat, slack)) corners[n_corners++] = k;
    }
    return spread_out(rows, spots, corners, n_corners, most, out);
}

/* The same of the rows whose normal is that of the deepest, which are taken away. */
static int64_t take_patch(collide_contact *rows, int *n_rows, double tolerance, int64_t most, collide_contact *out)
{
    struct spot spots[MAX_ROWS];
    double e[3] = {0.0, 0.0, 0.0}, f[3], normal[3];
    int n = 0, deepest = 0, k, remaining = 0, axis;
    int64_t count;
    for (k = 1; k < *n_rows; k++)
        if (rows[k].distance < rows[deepest].distance) deepest = k;
    memcpy(normal, rows[deepest].normal, sizeof normal);
    axis = fabs(normal[0]) < fabs(normal[1]) ? 0 : 1;
    if (fabs(normal[2]) < fabs(normal[axis])) axis = 2;
    e[(axis + 1) % 3] = normal[(axis + 2) % 3];
    e[(axis + 2) % 3] = -normal[(axis + 1) % 3];
    for (k = 0; k < 3; k++) f[k] = normal[(k + 1) % 3] * e[(k + 2) % 3] - normal[(k + 2) % 3] * e[(k + 1) % 3];
    for (k = 0; k < *n_rows; k++)
        if (dot3(rows[k].normal, normal) > SAME_NORMAL) {
            spots[n].u = dot3(rows[k].point_a, e);
            spots[n].v = dot3(rows[k].point_a, f);
            spots[n].distance = rows[k].distance;
            spots[n++].row = k;
        }
    count = reduce_patch(rows, spots, n, tolerance, most, out);
    for (k = 0; k < *n_rows; k++)
        if (!(dot3(rows[k].normal, normal) > SAME_NORMAL)) rows[remaining++] = rows[k];
    *n_rows = remaining;
    return count;
}

int64_t take_rows(const struct task *task, int64_t max_contacts, collide_contact *rows)
{
    struct terrain_space *own = task->own;
    int64_t n = 0;
    while (own->n_rows > 0 && n < max_contacts) {
        int64_t most = max_contacts - n < PER_PATCH ? max_contacts - n : PER_PATCH;
        n += take_patch(own->rows, &own->n_rows, task->tolerance, most, rows + n);
    }
    return n;
}
