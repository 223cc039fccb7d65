/* A convex body seen from a height field. */
#include "host_terrain_task.h"

#include <math.h>
#include <string.h>

/* Hulls of more faces are not looked through. */
enum { MAX_FACES = 64 };

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
    body.is_capsule = ints[KIND] == POINTS && ints[COUNT] == 2;
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

void nearest_on_axis(const struct terrain_body *body, const double p[3], double nearest[3])
{
    const double *x = (const double *)(intptr_t)body->ints[ADDRESS];
    double ends[2][3], e[3], w[3], square, t;
    int k, end;
    for (end = 0; end < 2; end++) {
        double local[3] = {x[end], x[body->ints[PADDED] + end], x[2 * body->ints[PADDED] + end]};
        for (k = 0; k < 3; k++) ends[end][k] = body->p_HB[k] + dot3(body->R_HB + 3 * k, local);
    }
    for (k = 0; k < 3; k++) {
        e[k] = ends[1][k] - ends[0][k];
        w[k] = p[k] - ends[0][k];
    }
    square = dot3(e, e);
    t = square > 0.0 ? dot3(w, e) / square : 0.0;
    t = t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
    for (k = 0; k < 3; k++) nearest[k] = ends[0][k] + t * e[k];
}

/* --- a point and a body ---------------------------------------------------------------------------------------- */

/* Of v in a box's or a cylinder's own frame: the outward normal m of what is nearest, and how far v is beyond it; 0 where that is an edge
   or a rim. */
static int beyond_box(const double size[3], const double v[3], double m[3], double *beyond)
{
    int k, axis = 0, n_beyond = 0;
    *beyond = -INFINITE;
    for (k = 0; k < 3; k++) {
        double along = fabs(v[k]) - size[k];
        n_beyond += along > 0.0;
        m[k] = 0.0;
        if (along > *beyond) {
            *beyond = along;
            axis = k;
        }
    }
    m[axis] = v[axis] < 0.0 ? -1.0 : 1.0;
    return n_beyond < 2;
}

static int beyond_cylinder(const double *size, const double v[3], double m[3], double *beyond)
{
    double across = sqrt(v[0] * v[0] + v[1] * v[1]), aside = across - size[0], along = fabs(v[2]) - size[1];
    m[0] = m[1] = m[2] = 0.0;
    if (along > aside) {
        m[2] = v[2] < 0.0 ? -1.0 : 1.0;
    } else {
        if (!(across > 0.0)) return 0;
        m[0] = v[0] / across;
        m[1] = v[1] / across;
    }
    *beyond = along > aside ? along : aside;
    return !(along > 0.0 && aside > 0.0);
}

/* The same within a hull of few faces. */
static int beyond_hull(const int64_t *ints, const int64_t *faces, const double v[3], double m[3], double *beyond)
{
    const double *x = (const double *)(intptr_t)ints[ADDRESS], *y = x + ints[PADDED], *z = y + ints[PADDED];
    const double *normals = (const double *)(intptr_t)faces[NORMALS_AT], *nearest = normals;
    const int64_t *starts = (const int64_t *)(intptr_t)faces[STARTS_AT], *corners = (const int64_t *)(intptr_t)faces[CORNERS_AT];
    int64_t face;
    if (faces[N_FACES] < 4 || faces[N_FACES] > MAX_FACES) return 0;
    *beyond = -INFINITE;
    for (face = 0; face < faces[N_FACES]; face++) {
        const double *n = normals + 3 * face;
        int64_t corner = corners[starts[face]];
        double along = n[0] * (v[0] - x[corner]) + n[1] * (v[1] - y[corner]) + n[2] * (v[2] - z[corner]);
        if (along > 0.0) return 0;
        if (along > *beyond) {
            *beyond = along;
            nearest = n;
        }
    }
    memcpy(m, nearest, 3 * sizeof *m);
    return 1;
}

int distance_to_point(const struct terrain_body *body, const int64_t *faces, const double p[3], double limit, double n[3],
                      double *distance)
{
    const double *size = body->numbers + PARAMS, *R = body->R_HB;
    double away[3] = {p[0] - body->p_HB[0], p[1] - body->p_HB[1], p[2] - body->p_HB[2]}, v[3], m[3], c[3], length;
    int k, is_known = 0;
    if (dot3(away, away) > (body->reach + limit) * (body->reach + limit)) return 0;
    if (body->is_capsule) {
        nearest_on_axis(body, p, c);
        length = sqrt(square_between(c, p));
        for (k = 0; k < 3; k++) n[k] = (c[k] - p[k]) / length;
        *distance = length - body->numbers[RADIUS];
        return length > 0.0;
    }
    for (k = 0; k < 3; k++) v[k] = R[k] * away[0] + R[3 + k] * away[1] + R[6 + k] * away[2];
    if (body->ints[KIND] == CYLINDER) is_known = beyond_cylinder(size, v, m, distance);
    else if (body->ints[KIND] == POINTS && size[0] > 0.0) is_known = beyond_box(size, v, m, distance);
    else if (body->ints[KIND] == POINTS && body->numbers[RADIUS] == 0.0) is_known = beyond_hull(body->ints, faces, v, m, distance);
    for (k = 0; k < 3 && is_known; k++) n[k] = -dot3(R + 3 * k, m);
    return is_known;
}
