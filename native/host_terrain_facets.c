/* Facets of a height field, a convex body seen from it, and which directions leave it. */
#include "host_terrain.h"

#include <math.h>
#include <string.h>

/* Sines of angles that count as none: normals of curved bodies are good to a hundredth of that. */
#define FLAT 1e-6

static double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void grid_point(const struct terrain *terrain, int64_t i, int64_t j, double p[3])
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

/* --- a body -------------------------------------------------------------------------------------------------------- */

/* The hull's point farthest along m of the body's own frame. */
static void hull_support(const int64_t *ints, const double *size, const double m[3], double p[3])
{
    const double *x = (const double *)(intptr_t)ints[ADDRESS], *y = x + ints[PADDED], *z = y + ints[PADDED];
    double largest = -INFINITE;
    int64_t k, best = 0;
    int j;
    if (size[0] > 0.0) { /* a box */
        for (j = 0; j < 3; j++) p[j] = m[j] < 0.0 ? -size[j] : size[j];
        return;
    }
    for (k = 0; k < ints[COUNT]; k++) {
        double along = x[k] * m[0] + y[k] * m[1] + z[k] * m[2];
        if (along > largest) {
            largest = along;
            best = k;
        }
    }
    p[0] = x[best];
    p[1] = y[best];
    p[2] = z[best];
}

double body_support(const struct terrain_body *body, const double n[3], double point[3])
{
    const double *size = body->numbers + PARAMS, *R = body->R_HB;
    double m[3], p[3], length;
    int j;
    for (j = 0; j < 3; j++) m[j] = R[j] * n[0] + R[3 + j] * n[1] + R[6 + j] * n[2];
    if (body->ints[KIND] == CYLINDER) {
        length = sqrt(m[0] * m[0] + m[1] * m[1]);
        p[0] = length > 0.0 ? size[0] * m[0] / length : 0.0;
        p[1] = length > 0.0 ? size[0] * m[1] / length : 0.0;
        p[2] = m[2] < 0.0 ? -size[1] : size[1];
    } else if (body->ints[KIND] == ELLIPSOID) {
        for (j = 0; j < 3; j++) m[j] *= size[j];
        length = sqrt(dot3(m, m));
        for (j = 0; j < 3; j++) p[j] = size[j] * m[j] / length;
    } else {
        hull_support(body->ints, size, m, p);
    }
    for (j = 0; j < 3; j++)
        point[j] = body->p_HB[j] + dot3(R + 3 * j, p) + body->numbers[RADIUS] * n[j];
    return dot3(n, point);
}

struct terrain_body body_seen_from(const int64_t *ints, const double *numbers, const double *X_WH, const double *X_WB)
{
    struct terrain_body body;
    double away[3], n[3] = {0.0, 0.0, 0.0}, point[3];
    int i, j, k;
    body.ints = ints;
    body.numbers = numbers;
    for (k = 0; k < 3; k++) away[k] = X_WB[4 * k + 3] - X_WH[4 * k + 3];
    for (i = 0; i < 3; i++) {
        body.p_HB[i] = X_WH[i] * away[0] + X_WH[4 + i] * away[1] + X_WH[8 + i] * away[2];
        for (j = 0; j < 3; j++)
            body.R_HB[3 * i + j] = X_WH[i] * X_WB[j] + X_WH[4 + i] * X_WB[4 + j] + X_WH[8 + i] * X_WB[8 + j];
    }
    for (k = 0; k < 3; k++) {
        n[k] = 1.0;
        body.high[k] = body_support(&body, n, point);
        n[k] = -1.0;
        body.low[k] = -body_support(&body, n, point);
        n[k] = 0.0;
    }
    body.reach = numbers[REACH] + numbers[RADIUS];
    body.is_round = ints[KIND] == ELLIPSOID || (ints[KIND] == POINTS && ints[COUNT] == 1);
    return body;
}

double height_of_next(const struct terrain_body *body, const double n[3])
{
    const int64_t *ints = body->ints;
    const double *size = body->numbers + PARAMS, *R = body->R_HB, *x, *y, *z;
    double m[3], least = INFINITE, next = INFINITE;
    int64_t k;
    int j;
    if (body->is_round) return INFINITE;
    for (j = 0; j < 3; j++) m[j] = R[j] * n[0] + R[3 + j] * n[1] + R[6 + j] * n[2];
    if (ints[KIND] == CYLINDER) { /* corners within its end: the next is an eighth of a turn away */
        double on_end = 0.29 * size[0] * sqrt(m[0] * m[0] + m[1] * m[1]), on_side = 2.0 * size[1] * fabs(m[2]);
        return on_end < on_side ? on_end : on_side;
    }
    if (ints[KIND] != POINTS) return 0.0;
    if (size[0] > 0.0) {
        for (j = 0; j < 3; j++)
            if (2.0 * size[j] * fabs(m[j]) < next) next = 2.0 * size[j] * fabs(m[j]);
        return next;
    }
    x = (const double *)(intptr_t)ints[ADDRESS];
    y = x + ints[PADDED];
    z = y + ints[PADDED];
    for (k = 0; k < ints[COUNT]; k++) {
        double along = x[k] * m[0] + y[k] * m[1] + z[k] * m[2];
        if (along < least) {
            next = least;
            least = along;
        } else if (along < next) {
            next = along;
        }
    }
    return next - least;
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

/* The grid points around one. */
static int ring_rises(const struct terrain *terrain, int64_t i, int64_t j, const double p[3], const double n[3], double tolerance)
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
