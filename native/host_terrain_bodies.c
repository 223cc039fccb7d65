/* A convex body seen from a height field. */
#include "host_terrain_task.h"

#include <math.h>
#include <string.h>

/* Hulls of more faces are not looked through. */
enum { MAX_FACES = 64 };
/* From so many vertices on the farthest is looked for along edges. */
enum { MIN_VERTICES_TO_CLIMB = 48 };

/* Along m, of a hull's point. */
static double height_of(const int64_t *ints, int64_t k, const double m[3])
{
    const double *x = (const double *)(intptr_t)ints[ADDRESS];
    return x[k] * m[0] + x[ints[PADDED] + k] * m[1] + x[2 * ints[PADDED] + k] * m[2];
}

/* Of a vertex's neighbours the one farthest along m, and how far that is. */
static int64_t farthest_neighbour(const struct terrain_body *body, int64_t vertex, const double m[3], double *farthest)
{
    const int64_t *faces = body->faces, *starts = (const int64_t *)(intptr_t)faces[STARTS_AT];
    const int64_t *corners = (const int64_t *)(intptr_t)faces[CORNERS_AT], *face_of = (const int64_t *)(intptr_t)faces[FACE_OF_AT];
    const int64_t *fan_starts = (const int64_t *)(intptr_t)faces[FAN_STARTS_AT], *fans = (const int64_t *)(intptr_t)faces[FANS_AT];
    int64_t k, best = vertex;
    *farthest = -INFINITE;
    for (k = fan_starts[vertex]; k < fan_starts[vertex + 1]; k++) {
        int64_t at = fans[k], face = face_of[at], next = corners[at + 1 < starts[face + 1] ? at + 1 : starts[face]];
        double along = height_of(body->ints, next, m);
        if (along > *farthest) {
            *farthest = along;
            best = next;
        }
    }
    return best;
}

/* The hull's vertex farthest along m: uphill over its edges where there are many. */
static int64_t hull_vertex(const struct terrain_body *body, const double m[3])
{
    double largest, along;
    int64_t k, best = *body->vertex;
    if (body->is_large) {
        largest = height_of(body->ints, best, m);
        while ((k = farthest_neighbour(body, best, m, &along)) != best && along > largest) {
            best = k;
            largest = along;
        }
        *body->vertex = best;
        return best;
    }
    largest = height_of(body->ints, best = 0, m);
    for (k = 1; k < body->ints[COUNT]; k++)
        if ((along = height_of(body->ints, k, m)) > largest) {
            largest = along;
            best = k;
        }
    return best;
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
        int is_box = body->ints[KIND] == POINTS && size[0] > 0.0;
        int64_t vertex = is_box ? 0 : hull_vertex(body, m);
        const double *x = (const double *)(intptr_t)body->ints[ADDRESS];
        for (j = 0; j < 3; j++) p[j] = is_box ? (m[j] < 0.0 ? -size[j] : size[j]) : x[body->ints[PADDED] * j + vertex];
    }
    for (j = 0; j < 3; j++)
        point[j] = body->p_HB[j] + dot3(R + 3 * j, p) + body->numbers[RADIUS] * n[j];
    return dot3(n, point);
}

void body_extent(const struct terrain_pair *pair, const struct terrain_body *body, const double n[3], double *low, double *high)
{
    const double *R = body->R_HB, *box = pair->boxes + 6 * pair->b;
    double back[3] = {-n[0], -n[1], -n[2]}, point[3], middle, half = 0.0;
    int j;
    if (!body->is_large) {
        *high = body_support(body, n, point);
        *low = -body_support(body, back, point);
        return;
    }
    middle = dot3(n, body->p_HB);
    for (j = 0; j < 3; j++) {
        double along = R[j] * n[0] + R[3 + j] * n[1] + R[6 + j] * n[2];
        middle += along * box[j];
        half += fabs(along) * box[3 + j];
    }
    *low = middle - half;
    *high = middle + half;
}

/* Begin searches at a vertex that is about the lowest. */
static void begin_search(const struct terrain_pair *pair, const struct terrain_body *body)
{
    const int64_t *extremes = pair->extremes + EXTREMES * pair->b;
    double m[3], largest = -INFINITE;
    int k, j;
    for (j = 0; j < 3; j++) m[j] = -body->R_HB[6 + j];
    for (k = 0; k < EXTREMES; k++) {
        double along = height_of(body->ints, extremes[k], m);
        if (along > largest) {
            largest = along;
            *body->vertex = extremes[k];
        }
    }
}

struct terrain_body body_seen_from(const struct terrain_pair *pair, int64_t *vertex)
{
    const int64_t *ints = pair->ints + INTS * pair->b;
    const double *numbers = pair->numbers + NUMBERS * pair->b, *X_WH = pair->X_WH, *X_WB = pair->X_WB;
    struct terrain_body body;
    double away[3], n[3] = {0.0, 0.0, 0.0};
    int i, j, k;
    body.ints = ints;
    body.numbers = numbers;
    body.faces = pair->faces + FACE_INTS * pair->b;
    body.is_large = ints[KIND] == POINTS && ints[COUNT] > MIN_VERTICES_TO_CLIMB && body.faces[N_FACES] >= 4;
    body.vertex = vertex;
    *vertex = 0;
    for (k = 0; k < 3; k++) away[k] = X_WB[4 * k + 3] - X_WH[4 * k + 3];
    for (i = 0; i < 3; i++) {
        body.p_HB[i] = X_WH[i] * away[0] + X_WH[4 + i] * away[1] + X_WH[8 + i] * away[2];
        for (j = 0; j < 3; j++)
            body.R_HB[3 * i + j] = X_WH[i] * X_WB[j] + X_WH[4 + i] * X_WB[4 + j] + X_WH[8 + i] * X_WB[8 + j];
    }
    if (body.is_large) begin_search(pair, &body);
    for (k = 0; k < 3; k++) {
        n[k] = 1.0;
        body_extent(pair, &body, n, &body.low[k], &body.high[k]);
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
    const double *size = body->numbers + PARAMS, *R = body->R_HB;
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
    if (body->is_large) {
        for (j = 0; j < 3; j++) m[j] = -m[j];
        k = hull_vertex(body, m);
        farthest_neighbour(body, k, m, &next);
        return height_of(ints, k, m) - next;
    }
    for (k = 0; k < ints[COUNT]; k++) {
        double along = height_of(ints, k, m);
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

int distance_to_point(const struct terrain_body *body, const double p[3], double limit, double n[3], double *distance)
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
    else if (body->ints[KIND] == POINTS && body->numbers[RADIUS] == 0.0) is_known = beyond_hull(body->ints, body->faces, v, m, distance);
    for (k = 0; k < 3 && is_known; k++) n[k] = -dot3(R + 3 * k, m);
    return is_known;
}
