/* Facets of a height field, and which directions leave it. */
#include "host_terrain_task.h"

#include <math.h>
#include <string.h>

/* Sines of angles that count as none: normals of curved bodies are good to a hundredth of that. */
#define FLAT 1e-6

void grid_point(const struct terrain *terrain, int64_t i, int64_t j, double p[3])
{
    p[0] = terrain->dx * (double)j - terrain->size[0];
    p[1] = terrain->dy * (double)i - terrain->size[1];
    p[2] = terrain->size[2] * (double)terrain->heights[terrain->n_columns * i + j];
}

struct terrain_facet facet_at(const struct terrain *terrain, int64_t i, int64_t j, int t)
{
    struct terrain_facet facet;
    double u[3], w[3], length;
    int k;
    facet.i = i;
    facet.j = j;
    facet.t = t;
    grid_point(terrain, i, j, facet.v[0]);
    grid_point(terrain, t ? i + 1 : i, j + 1, facet.v[1]);
    grid_point(terrain, i + 1, t ? j : j + 1, facet.v[2]);
    for (k = 0; k < 3; k++) {
        u[k] = facet.v[1][k] - facet.v[0][k];
        w[k] = facet.v[2][k] - facet.v[0][k];
    }
    facet.n[0] = u[1] * w[2] - u[2] * w[1];
    facet.n[1] = u[2] * w[0] - u[0] * w[2];
    facet.n[2] = u[0] * w[1] - u[1] * w[0];
    length = sqrt(dot3(facet.n, facet.n));
    for (k = 0; k < 3; k++) facet.n[k] /= length;
    facet.walls = terrain->walls[t];
    return facet;
}

void lay_out_terrain(struct terrain *terrain)
{
    static const double along_x[2] = {0.0, 1.0}, along_y[2] = {-1.0, 0.0}, back_x[2] = {0.0, -1.0}, back_y[2] = {1.0, 0.0};
    double length, diagonal[2], back[2];
    terrain->dx = 2.0 * terrain->size[0] / (double)(terrain->n_columns - 1);
    terrain->dy = 2.0 * terrain->size[1] / (double)(terrain->n_rows - 1);
    length = sqrt(terrain->dx * terrain->dx + terrain->dy * terrain->dy);
    diagonal[0] = -(back[0] = terrain->dy / length);
    diagonal[1] = -(back[1] = -terrain->dx / length);
    memcpy(terrain->walls[0][0], along_x, sizeof back);
    memcpy(terrain->walls[0][1], along_y, sizeof back);
    memcpy(terrain->walls[0][2], back, sizeof back);
    memcpy(terrain->walls[1][0], diagonal, sizeof back);
    memcpy(terrain->walls[1][1], back_x, sizeof back);
    memcpy(terrain->walls[1][2], back_y, sizeof back);
}

/* C. Ericson, "Real-Time Collision Detection" (2005), section 5.1.5. */
void nearest_on_facet(const struct terrain_facet *facet, const double p[3], double nearest[3])
{
    const double *a = facet->v[0], *b = facet->v[1], *c = facet->v[2];
    double ab[3], ac[3], ap[3], bp[3], cp[3], d1, d2, d3, d4, d5, d6, va, vb, vc, s = 0.0, t = 0.0, sum;
    int k;
    for (k = 0; k < 3; k++) {
        ab[k] = b[k] - a[k];
        ac[k] = c[k] - a[k];
        ap[k] = p[k] - a[k];
        bp[k] = p[k] - b[k];
        cp[k] = p[k] - c[k];
    }
    d1 = dot3(ab, ap), d2 = dot3(ac, ap), d3 = dot3(ab, bp), d4 = dot3(ac, bp), d5 = dot3(ab, cp), d6 = dot3(ac, cp);
    va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (d1 <= 0.0 && d2 <= 0.0) {
        s = t = 0.0;
    } else if (d3 >= 0.0 && d4 <= d3) {
        s = 1.0;
    } else if (d6 >= 0.0 && d5 <= d6) {
        t = 1.0;
    } else if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
        s = d1 / (d1 - d3);
    } else if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
        t = d2 / (d2 - d6);
    } else if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        s = 1.0 - t;
    } else {
        sum = va + vb + vc;
        s = vb / sum;
        t = vc / sum;
    }
    for (k = 0; k < 3; k++) nearest[k] = a[k] + s * ab[k] + t * ac[k];
}

double facet_gap_along(const struct terrain_facet *facet, const double n[3], double lowest)
{
    double a = dot3(n, facet->v[0]), b = dot3(n, facet->v[1]), c = dot3(n, facet->v[2]);
    double highest = a > b ? a : b;
    return lowest - (highest > c ? highest : c);
}

double depth_in_walls(const struct terrain_facet *facet, const double p[3])
{
    double least = INFINITE;
    int k;
    for (k = 0; k < 3; k++) {
        double depth = facet->walls[k][0] * (p[0] - facet->v[k][0]) + facet->walls[k][1] * (p[1] - facet->v[k][1]);
        if (depth < least) least = depth;
    }
    return least;
}

/* --- directions that leave the field ------------------------------------------------------------------------------- */

static int rises(const double w[3], const double p[3], const double n[3], double tolerance)
{
    double e[3] = {w[0] - p[0], w[1] - p[1], w[2] - p[2]};
    return dot3(e, n) > FLAT * sqrt(dot3(e, e)) + tolerance;
}

static int grid_point_rises(const struct terrain *terrain, int64_t i, int64_t j, const double p[3], const double n[3],
                            double tolerance)
{
    double w[3];
    if (i < 0 || j < 0 || i >= terrain->n_rows || j >= terrain->n_columns) return 0;
    grid_point(terrain, i, j, w);
    return rises(w, p, n, tolerance);
}

int ring_rises(const struct terrain *terrain, int64_t i, int64_t j, const double p[3], const double n[3], double tolerance)
{
    static const int around[6][2] = {{0, 1}, {1, 1}, {1, 0}, {0, -1}, {-1, -1}, {-1, 0}};
    int k;
    for (k = 0; k < 6; k++)
        if (grid_point_rises(terrain, i + around[k][0], j + around[k][1], p, n, tolerance)) return 1;
    return 0;
}

/* The same from a point of the upper side. */
static int leaves_upwards(const struct terrain *terrain, const struct terrain_facet *facet, const double p[3], const double n[3],
                          double tolerance)
{
    /* Of the facet's corners, and of the corner across each edge of the facet beyond it. */
    static const int corners[2][3][2] = {{{0, 0}, {0, 1}, {1, 1}}, {{0, 0}, {1, 1}, {1, 0}}};
    static const int across[2][3][2] = {{{-1, 0}, {1, 2}, {1, 0}}, {{0, 1}, {2, 1}, {0, -1}}};
    const int(*corner)[2] = corners[facet->t], (*beyond)[2] = across[facet->t];
    int k;
    if (n[2] < -FLAT) return 0;
    for (k = 0; k < 3; k++)
        if (rises(facet->v[k], p, n, tolerance)) return 0;
    for (k = 0; k < 3; k++) {
        double e[3] = {facet->v[k][0] - p[0], facet->v[k][1] - p[1], facet->v[k][2] - p[2]};
        if (sqrt(dot3(e, e)) <= 2.0 * tolerance)
            return !ring_rises(terrain, facet->i + corner[k][0], facet->j + corner[k][1], p, n, tolerance);
    }
    for (k = 0; k < 3; k++) {
        double depth = facet->walls[k][0] * (p[0] - facet->v[k][0]) + facet->walls[k][1] * (p[1] - facet->v[k][1]);
        if (depth <= tolerance && grid_point_rises(terrain, facet->i + beyond[k][0], facet->j + beyond[k][1], p, n, tolerance))
            return 0;
    }
    return 1;
}

int64_t line_at(double x, int64_t n)
{
    double up = ceil(x);
    return up < 0.0 ? 0 : up >= (double)n ? n : (int64_t)up;
}

int leaves_terrain(const struct terrain *terrain, const struct terrain_facet *facet, const double p[3], const double n[3],
                   double tolerance)
{
    double off[3] = {p[0] - facet->v[0][0], p[1] - facet->v[0][1], p[2] - facet->v[0][2]};
    int k;
    if (dot3(n, facet->n) > 1.0 - 1e-12) return 1;
    if (fabs(dot3(off, facet->n)) <= tolerance) return leaves_upwards(terrain, facet, p, n, tolerance);
    /* A wall within the field is none; those around it stand upright, and the base is level. */
    if (p[2] > -terrain->size[3] + tolerance ? fabs(n[2]) > FLAT : n[2] > FLAT) return 0;
    for (k = 0; k < 4; k++) {
        double w[3];
        w[0] = k & 1 ? terrain->size[0] : -terrain->size[0];
        w[1] = k & 2 ? terrain->size[1] : -terrain->size[1];
        w[2] = p[2];
        if (rises(w, p, n, tolerance)) return 0;
    }
    return 1;
}
