/* Contacts of a height field and a convex body.

   Facets near the body are asked one by one, as prisms. A facet that the body's farthest point stands over or in has its own normal.
   Of others the convex engine finds the least translation, which counts where its direction leaves the field, so that no edge between
   facets pushes a body that slides over it; facets that share a contact that is known are not asked again. A facet that the
   body is in, and that no contact accounts for, is left along the normal that clears all of these soonest. */
#include "host_terrain_task.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- contacts ------------------------------------------------------------------------------------------------------ */

static void keep_touch(const struct task *task, const struct terrain_facet *facet, const double n[3], const double p[3], double distance, int is_point)
{
    struct terrain_space *own = task->own;
    double away[3] = {-n[0], -n[1], -n[2]}, point[3];
    struct touch *touch = own->touches + own->n_touches;
    if (own->n_touches == MAX_TOUCHES) return;
    memcpy(touch->n, n, sizeof touch->n);
    memcpy(touch->p, p, sizeof touch->p);
    touch->distance = distance;
    touch->facet = *facet;
    touch->is_point = is_point;
    touch->lowest = -body_support(&task->body, away, point);
    own->n_touches++;
}

void add_manifold(const struct task *task, const double n[3], const double *point_a, const double *point_b, double distance)
{
    collide_pair row;
    int64_t count;
    memset(&row, 0, sizeof row);
    turn_to_world(task->pair->X_WH, n, row.normal);
    if (point_a != NULL) {
        row.distance = row.lower = row.upper = distance;
        row.hit = distance <= 0.0;
        memcpy(row.point_a, point_a, sizeof row.point_a);
        memcpy(row.point_b, point_b, sizeof row.point_b);
    } else { /* of a distance that is never kept, in a bracket that no gap is in: the faces' own points are all that come of it */
        row.distance = 1e39;
        row.lower = -1e40;
        row.upper = -1e39;
    }
    count = task->space->kernels->manifold_of_row(address_of(task->manifold->header + HEADER), address_of(task->pair->X_WH),
                                                  address_of(task->pair->X_WB), address_of(&row), task->pair->margin, PER_FACET,
                                                  address_of(task->own->found));
    keep_rows(task, task->own->found, count);
}

/* The body's farthest point stands over the facet, or in it so that all other ways out of the prism are longer. */
static int put_face_contact(const struct task *task, const struct near_facet *near, const struct terrain_facet *facet)
{
    double q[3], depth, gap = near->gap;
    collide_contact row;
    int k, is_point;
    if (gap > task->pair->margin) return 0;
    for (k = 0; k < 3; k++) q[k] = near->support[k] - gap * facet->n[k];
    depth = depth_in_walls(facet, gap > 0.0 ? q : near->support);
    if (!(depth >= (gap > 0.0 ? 0.0 : -gap)) || near->support[2] + task->pair->terrain->size[3] < -gap) return 0;
    is_point = gap + height_of_next(&task->body, facet->n) > task->pair->margin + task->tolerance;
    keep_touch(task, facet, facet->n, q, gap, is_point);
    memset(&row, 0, sizeof row);
    row.distance = gap;
    turn_to_world(task->pair->X_WH, facet->n, row.normal);
    point_to_world(task->pair->X_WH, q, row.point_a);
    point_to_world(task->pair->X_WH, near->support, row.point_b);
    if (is_point) {
        keep_rows(task, &row, 1);
    } else {
        take_prism(task, facet);
        add_manifold(task, facet->n, row.point_a, row.point_b, gap);
    }
    return 1;
}

/* Grid points within the body, or within the margin of it, around which the field is lower along the body's shortest way out: all other
   ways out of their prisms are longer. */
static void put_point_contacts(const struct task *task)
{
    const struct terrain *terrain = task->pair->terrain;
    const struct terrain_body *body = &task->body;
    double margin = task->pair->margin, p[3], n[3], distance;
    int64_t i, j, i_first = line_at((body->low[1] - margin + terrain->size[1]) / terrain->dy, terrain->n_rows);
    int64_t j_first = line_at((body->low[0] - margin + terrain->size[0]) / terrain->dx, terrain->n_columns);
    for (i = i_first; i < terrain->n_rows; i++) {
        for (j = j_first; j < terrain->n_columns; j++) {
            struct terrain_facet facet;
            collide_contact row;
            int k;
            grid_point(terrain, i, j, p);
            if (p[0] > body->high[0] + margin || p[1] > body->high[1] + margin) break;
            if (p[2] < body->low[2] - margin || !distance_to_point(body, p, margin, n, &distance)) continue;
            if (distance > margin || n[2] < 0.0 || ring_rises(terrain, i, j, p, n, 0.0)) continue;
            memset(&row, 0, sizeof row);
            row.distance = distance;
            turn_to_world(task->pair->X_WH, n, row.normal);
            point_to_world(task->pair->X_WH, p, row.point_a);
            for (k = 0; k < 3; k++) row.point_b[k] = row.point_a[k] + distance * row.normal[k];
            facet = facet_at(terrain, i < terrain->n_rows - 1 ? i : i - 1, j < terrain->n_columns - 1 ? j : j - 1, 0);
            keep_touch(task, &facet, n, p, distance, 0);
            keep_rows(task, &row, 1);
        }
        if (terrain->dy * (double)i - terrain->size[1] > body->high[1] + margin) return;
    }
}

/* Whether two facets share a grid point. */
static int are_linked(const struct terrain_facet *one, const struct terrain_facet *other)
{
    int k, c;
    for (k = 0; k < 3; k++)
        for (c = 0; c < 3; c++)
            if (one->v[k][0] == other->v[c][0] && one->v[k][1] == other->v[c][1]) return 1;
    return 0;
}

int is_accounted_for(const struct task *task, const struct terrain_facet *facet)
{
    const struct terrain_space *own = task->own;
    double tolerance = task->tolerance;
    int k, c;
    for (k = 0; k < own->n_touches; k++)
        if (facet_gap_along(facet, own->touches[k].n, own->touches[k].lowest) > task->pair->margin + 1e-3 * tolerance) return 1;
    for (k = 0; k < own->n_touches; k++) {
        const struct touch *touch = own->touches + k;
        int n_more = 0;
        if (facet_gap_along(facet, touch->n, touch->lowest) < touch->distance - 1e-3 * tolerance) continue;
        if (dot3(touch->n, facet->n) < SAME_NORMAL && !are_linked(facet, &touch->facet)) continue;
        for (c = 0; c < 3; c++)
            n_more += touch->lowest - dot3(touch->n, facet->v[c]) <= task->pair->margin + tolerance &&
                      square_between(facet->v[c], touch->p) > tolerance * tolerance;
        if (n_more > 0 && !touch->is_point) {
            take_prism(task, facet);
            add_manifold(task, touch->n, NULL, NULL, 0.0);
        }
        return 1;
    }
    return 0;
}

/* A ball whose middle is above the facet's plane: whether that has answered. */
static int put_ball_contact(const struct task *task, const struct terrain_facet *facet)
{
    const struct terrain_pair *pair = task->pair;
    const double *c = task->body.p_HB;
    double q[3], n[3], length, radius = task->body.numbers[RADIUS];
    collide_contact row;
    int k;
    if (task->body.ints[KIND] != POINTS || task->body.ints[COUNT] != 1) return 0;
    for (k = 0; k < 3; k++) q[k] = c[k] - facet->v[0][k];
    if (!(dot3(q, facet->n) > 1e-3 * radius)) return 0;
    nearest_on_facet(facet, c, q);
    length = sqrt(square_between(c, q));
    if (length - radius > pair->margin) return 1;
    for (k = 0; k < 3; k++) n[k] = (c[k] - q[k]) / length;
    if (!leaves_terrain(pair->terrain, facet, q, n, task->tolerance)) return 1; /* another facet is nearer */
    memset(&row, 0, sizeof row);
    row.distance = length - radius;
    turn_to_world(pair->X_WH, n, row.normal);
    point_to_world(pair->X_WH, q, row.point_a);
    for (k = 0; k < 3; k++) row.point_b[k] = row.point_a[k] + row.distance * row.normal[k];
    keep_touch(task, facet, n, q, row.distance, 1);
    keep_rows(task, &row, 1);
    return 1;
}

/* Whether a direction n of H, upwards, parts the body and a facet's prism. */
static int parts(const struct task *task, const struct terrain_facet *facet, const double n[3])
{
    double back[3] = {-n[0], -n[1], -n[2]}, support[3];
    return n[2] >= 0.0 && facet_gap_along(facet, n, -body_support(&task->body, back, support)) > task->pair->margin + 1e-3 * task->tolerance;
}

/* Whether a direction parts them that is easily found: from the facet's nearest point to the body's middle, or of a capsule to its axis,
   or across the faces of a box. */
static int is_parted(const struct task *task, const struct terrain_facet *facet)
{
    const struct terrain_body *body = &task->body;
    double c[3], q[3], n[3], length;
    int k, round, is_box = body->ints[KIND] == POINTS && body->numbers[PARAMS] > 0.0;
    memcpy(c, body->p_HB, sizeof c);
    for (round = 0; round < (body->is_capsule ? 3 : 1); round++) {
        nearest_on_facet(facet, c, q);
        if (body->is_capsule) nearest_on_axis(body, q, c);
    }
    length = sqrt(square_between(c, q));
    for (k = 0; k < 3 && length > task->tolerance; k++) n[k] = (c[k] - q[k]) / length;
    if (length > task->tolerance && parts(task, facet, n)) return 1;
    for (k = 0; k < 3 && is_box; k++) {
        double sign = body->R_HB[6 + k] < 0.0 ? -1.0 : 1.0;
        n[0] = sign * body->R_HB[k];
        n[1] = sign * body->R_HB[3 + k];
        n[2] = sign * body->R_HB[6 + k];
        if (parts(task, facet, n)) return 1;
    }
    return 0;
}

static collide_status ask_facet(const struct task *task, struct near_facet *near)
{
    const struct terrain_pair *pair = task->pair;
    const struct terrain_facet *facet = &near->facet;
    collide_contact *found = task->own->found;
    double n[3], p[3];
    collide_status status;
    int64_t count;
    if (is_accounted_for(task, facet) || put_ball_contact(task, facet) || is_parted(task, facet)) return COLLIDE_OK;
    take_prism(task, facet);
    status = contacts_of_pair(task->space, task->manifold, pair->X_WH, pair->X_WB, pair->margin, PER_FACET, 0, found, &count);
    if (status != COLLIDE_OK || count == 0) return status;
    turn_from_world(pair->X_WH, found->normal, n);
    point_from_world(pair->X_WH, found->point_a, p);
    if (leaves_terrain(pair->terrain, facet, p, n, task->tolerance)) {
        keep_touch(task, facet, n, p, found->distance, 0);
        keep_rows(task, found, count);
    } else if (found->distance < 0.0) {
        near->is_hit = 1;
        near->depth = -found->distance;
        memcpy(near->n, n, sizeof near->n);
        memcpy(near->p, p, sizeof near->p);
    }
    return COLLIDE_OK;
}

/* --- questions ----------------------------------------------------------------------------------------------------- */

static int by_gap(const void *one, const void *other)
{
    const struct near_facet *p = one, *q = other;
    double a = fabs(p->gap), b = fabs(q->gap);
    if (a != b) return a < b ? -1 : 1;
    if (p->facet.i != q->facet.i) return p->facet.i < q->facet.i ? -1 : 1;
    if (p->facet.j != q->facet.j) return p->facet.j < q->facet.j ? -1 : 1;
    return p->facet.t - q->facet.t;
}

/* All contacts within the margin, into own->rows. */
static collide_status find_contacts(const struct task *task)
{
    struct terrain_space *own = task->own;
    collide_status status = COLLIDE_OK;
    size_t k, remaining = 0;
    own->n_touches = own->n_rows = 0;
    if (find_near(task->pair, &task->body, task->pair->margin, own) < 0) return COLLIDE_NO_MEMORY;
    if (own->n_near == 0) return COLLIDE_OK;
    take_body(task);
    for (k = 0; k < own->n_near; k++) {
        if (!put_face_contact(task, own->near + k, &own->near[k].facet)) own->near[remaining++] = own->near[k];
    }
    own->n_near = remaining;
    put_point_contacts(task);
    if (remaining > 1) qsort(own->near, remaining, sizeof *own->near, by_gap);
    for (k = 0; k < remaining && status == COLLIDE_OK; k++) status = ask_facet(task, own->near + k);
    if (status == COLLIDE_OK) put_deep_contact(task);
    return status;
}

/* How far a body's box is from that of a facet's prism at least. */
static double gap_of_boxes(const struct terrain_body *body, const struct terrain_facet *facet)
{
    double square = 0.0;
    int k, c;
    for (k = 0; k < 3; k++) {
        double low = facet->v[0][k], high = low, gap = 0.0;
        for (c = 1; c < 3; c++) {
            low = facet->v[c][k] < low ? facet->v[c][k] : low;
            high = facet->v[c][k] > high ? facet->v[c][k] : high;
        }
        if (body->low[k] > high) gap = body->low[k] - high;
        else if (k < 2 && body->high[k] < low) gap = low - body->high[k];
        square += gap * gap;
    }
    return sqrt(square);
}

/* The nearest contact alone, of bodies that are apart: facets by what their planes tell, the nearest first. */
static collide_status find_nearest(const struct task *task, double within)
{
    struct terrain_space *own = task->own;
    const struct terrain_pair *pair = task->pair;
    double best = within;
    size_t k;
    if (find_near(pair, &task->body, within, own) < 0) return COLLIDE_NO_MEMORY;
    for (k = 0; k < own->n_near; k++) {
        double of_boxes = gap_of_boxes(&task->body, &own->near[k].facet);
        own->near[k].gap = own->near[k].gap > of_boxes ? own->near[k].gap : of_boxes;
    }
    if (own->n_near > 1) qsort(own->near, own->n_near, sizeof *own->near, by_gap);
    if (own->n_near > 0) take_body(task);
    for (k = 0; k < own->n_near; k++) {
        collide_status status;
        int64_t count;
        if (own->near[k].gap > best) continue;
        take_prism(task, &own->near[k].facet);
        status = contacts_of_pair(task->space, task->manifold, pair->X_WH, pair->X_WB, best, PER_FACET, 0, own->found, &count);
        if (status != COLLIDE_OK) return status;
        if (count == 0 || own->found[0].distance > best) continue;
        own->rows[0] = own->found[0];
        own->n_rows = 1;
        best = own->found[0].distance;
    }
    return COLLIDE_OK;
}

collide_status terrain_contacts(struct terrain_space *own, collide_workspace *space, struct manifold_space *manifold,
                                const struct terrain_pair *pair, int64_t max_contacts, collide_contact *rows, int64_t *n)
{
    const struct terrain *terrain = pair->terrain;
    struct terrain_pair asked = *pair;
    struct task task;
    collide_status status;
    double within;
    int64_t vertex;
    task.pair = &asked;
    task.own = own;
    task.space = space;
    task.manifold = manifold;
    task.body = body_seen_from(pair, &vertex);
    task.tolerance = PLACES * (task.body.reach + terrain->dx + terrain->dy);
    within = task.body.reach + terrain->dx + terrain->dy;
    if (pair->margin > within) asked.margin = 0.0;
    status = find_contacts(&task);
    for (; status == COLLIDE_OK && asked.margin < pair->margin && own->n_rows == 0; within *= 2.0) {
        asked.margin = within < pair->margin ? within : pair->margin;
        status = find_nearest(&task, asked.margin);
    }
    *n = status == COLLIDE_OK ? take_rows(&task, max_contacts, rows) : 0;
    return status;
}
