/* Contacts of a height field and a convex body.

   Facets near the body are asked one by one, as prisms. A facet that the body's farthest point stands over or in has its own normal.
   Of others the convex engine finds the least translation, which counts where its direction leaves the field, so that no edge between
   facets pushes a body that slides over it; facets that share a contact that is known are not asked again. A facet that the
   body is in, and that no contact accounts for, is left along the normal that clears all of these soonest. */
#include "host_terrain_task.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- facets near a body -------------------------------------------------------------------------------------------- */

static int64_t cell_at(double x, int64_t n_cells)
{
    return x < 0.0 ? 0 : x >= (double)n_cells ? n_cells - 1 : (int64_t)x;
}

static int keep_near(struct terrain_space *own, const struct terrain_facet *facet, double gap, const double support[3])
{
    struct near_facet *near;
    if (own->n_near == own->capacity) {
        size_t capacity = own->capacity > 0 ? 2 * own->capacity : 64;
        if ((near = realloc(own->near, capacity * sizeof *near)) == NULL) return 0;
        own->near = near;
        own->capacity = capacity;
    }
    near = own->near + own->n_near++;
    near->gap = gap;
    memcpy(near->support, support, sizeof near->support);
    near->i = (int32_t)facet->i;
    near->j = (int32_t)facet->j;
    near->t = facet->t;
    near->is_hit = near->is_chosen = 0;
    return 1;
}

/* Facets that no direction tried here proves to be farther from the body than `margin`, into own->near; where own is NULL, 1 at the
   first of them. -1 where there is no memory. */
static int find_near(const struct terrain *terrain, const struct terrain_body *body, double margin, struct terrain_space *own)
{
    int64_t n_rows = terrain->n_rows - 1, n_columns = terrain->n_columns - 1, i, j, i_first, i_last, j_first, j_last;
    double length = sqrt(terrain->dx * terrain->dx + terrain->dy * terrain->dy), far[3], highest, lowest;
    double diagonal[3] = {-terrain->dy / length, terrain->dx / length, 0.0}, back[3] = {terrain->dy / length, -terrain->dx / length, 0.0};
    margin += 1e-9 * (body->reach + terrain->size[0] + terrain->size[1] + terrain->size[2] + terrain->size[3]);
    if (own != NULL) own->n_near = 0;
    if (body->low[0] > terrain->size[0] + margin || body->high[0] < -terrain->size[0] - margin ||
        body->low[1] > terrain->size[1] + margin || body->high[1] < -terrain->size[1] - margin ||
        body->low[2] > terrain->size[2] + margin || body->high[2] < -terrain->size[3] - margin)
        return 0;
    highest = body_support(body, diagonal, far);
    lowest = -body_support(body, back, far);
    j_first = cell_at((body->low[0] - margin + terrain->size[0]) / terrain->dx, n_columns);
    j_last = cell_at((body->high[0] + margin + terrain->size[0]) / terrain->dx, n_columns);
    i_first = cell_at((body->low[1] - margin + terrain->size[1]) / terrain->dy, n_rows);
    i_last = cell_at((body->high[1] + margin + terrain->size[1]) / terrain->dy, n_rows);
    for (i = i_first; i <= i_last; i++)
        for (j = j_first; j <= j_last; j++) {
            const float *h = terrain->heights + terrain->n_columns * i + j, *above = h + terrain->n_columns;
            double along = diagonal[0] * (terrain->dx * (double)j - terrain->size[0]) + diagonal[1] * (terrain->dy * (double)i - terrain->size[1]);
            double needed = (body->low[2] - margin) / terrain->size[2];
            int t;
            if (h[0] < needed && h[1] < needed && above[0] < needed && above[1] < needed) continue;
            for (t = 0; t < 2; t++) {
                struct terrain_facet facet;
                double away[3], support[3], gap;
                int k;
                if (t == 0 ? lowest - along > margin || (h[0] < needed && h[1] < needed && above[1] < needed)
                           : along - highest > margin || (h[0] < needed && above[0] < needed && above[1] < needed))
                    continue;
                facet = facet_at(terrain, i, j, t);
                for (k = 0; k < 3; k++) away[k] = -facet.n[k];
                gap = -body_support(body, away, support) - dot3(facet.n, facet.v[0]);
                if (gap > margin) continue;
                if (own == NULL) return 1;
                if (!keep_near(own, &facet, gap, support)) return -1;
            }
        }
    return 0;
}

int is_off_terrain(const struct terrain_pair *pair)
{
    const int64_t *ints = pair->ints + INTS * pair->b;
    struct terrain_body body = body_seen_from(ints, pair->numbers + NUMBERS * pair->b, pair->X_WH, pair->X_WB);
    return find_near(pair->terrain, &body, pair->margin, NULL) == 0;
}

/* --- contacts ------------------------------------------------------------------------------------------------------ */

static void keep_touch(const struct task *task, const double n[3], const double p[3], double distance, int is_point)
{
    struct terrain_space *own = task->own;
    double away[3] = {-n[0], -n[1], -n[2]}, point[3];
    struct touch *touch = own->touches + own->n_touches;
    if (own->n_touches == MAX_TOUCHES) return;
    memcpy(touch->n, n, sizeof touch->n);
    memcpy(touch->p, p, sizeof touch->p);
    touch->distance = distance;
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
    keep_touch(task, facet->n, q, gap, is_point);
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

/* Whether contacts that are known say all of a facet: it is apart along one of their normals, or shares one. */
static int is_accounted_for(const struct task *task, const struct terrain_facet *facet)
{
    const struct terrain_space *own = task->own;
    double tolerance = task->tolerance;
    int k, c;
    for (k = 0; k < own->n_touches; k++)
        if (facet_gap_along(facet, own->touches[k].n, own->touches[k].lowest) > task->pair->margin + 1e-3 * tolerance) return 1;
    for (k = 0; k < own->n_touches; k++) {
        const struct touch *touch = own->touches + k;
        double off[3] = {touch->p[0] - facet->v[0][0], touch->p[1] - facet->v[0][1], touch->p[2] - facet->v[0][2]};
        int n_more = 0;
        if (facet_gap_along(facet, touch->n, touch->lowest) < touch->distance - 1e-3 * tolerance) continue;
        if (dot3(touch->n, facet->n) < SAME_NORMAL &&
            (fabs(dot3(off, facet->n)) > tolerance || depth_in_walls(facet, touch->p) < -tolerance))
            continue;
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
    keep_touch(task, n, q, row.distance, 1);
    keep_rows(task, &row, 1);
    return 1;
}

/* Whether the direction from the facet's point nearest to the body's middle parts them. */
static int is_parted(const struct task *task, const struct terrain_facet *facet)
{
    double q[3], n[3], back[3], support[3], length;
    int k;
    nearest_on_facet(facet, task->body.p_HB, q);
    length = sqrt(square_between(task->body.p_HB, q));
    if (!(length > task->tolerance) || !(task->body.p_HB[2] > q[2])) return 0; /* else the base may be farther along it */
    for (k = 0; k < 3; k++) back[k] = -(n[k] = (task->body.p_HB[k] - q[k]) / length);
    return facet_gap_along(facet, n, -body_support(&task->body, back, support)) > task->pair->margin + 1e-3 * task->tolerance;
}

static collide_status ask_facet(const struct task *task, struct near_facet *near)
{
    const struct terrain_pair *pair = task->pair;
    struct terrain_facet facet = facet_at(pair->terrain, near->i, near->j, near->t);
    collide_contact *found = task->own->found;
    double n[3], p[3];
    collide_status status;
    int64_t count;
    if (is_accounted_for(task, &facet) || put_ball_contact(task, &facet) || is_parted(task, &facet)) return COLLIDE_OK;
    take_prism(task, &facet);
    status = contacts_of_pair(task->space, task->manifold, pair->X_WH, pair->X_WB, pair->margin, PER_FACET, 0, found, &count);
    if (status != COLLIDE_OK || count == 0) return status;
    turn_from_world(pair->X_WH, found->normal, n);
    point_from_world(pair->X_WH, found->point_a, p);
    if (leaves_terrain(pair->terrain, &facet, p, n, task->tolerance)) {
        keep_touch(task, n, p, found->distance, 0);
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
    if (p->i != q->i) return p->i < q->i ? -1 : 1;
    if (p->j != q->j) return p->j < q->j ? -1 : 1;
    return p->t - q->t;
}

/* All contacts within the margin, into own->rows. */
static collide_status find_contacts(const struct task *task)
{
    struct terrain_space *own = task->own;
    collide_status status = COLLIDE_OK;
    size_t k, left = 0;
    own->n_touches = own->n_rows = 0;
    if (find_near(task->pair->terrain, &task->body, task->pair->margin, own) < 0) return COLLIDE_NO_MEMORY;
    if (own->n_near == 0) return COLLIDE_OK;
    take_body(task);
    for (k = 0; k < own->n_near; k++) {
        struct terrain_facet facet = facet_at(task->pair->terrain, own->near[k].i, own->near[k].j, own->near[k].t);
        if (!put_face_contact(task, own->near + k, &facet)) own->near[left++] = own->near[k];
    }
    own->n_near = left;
    if (left > 1) qsort(own->near, left, sizeof *own->near, by_gap);
    for (k = 0; k < left && status == COLLIDE_OK; k++) status = ask_facet(task, own->near + k);
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
    if (find_near(pair->terrain, &task->body, within, own) < 0) return COLLIDE_NO_MEMORY;
    for (k = 0; k < own->n_near; k++) {
        struct terrain_facet facet = facet_at(pair->terrain, own->near[k].i, own->near[k].j, own->near[k].t);
        double of_boxes = gap_of_boxes(&task->body, &facet);
        own->near[k].gap = own->near[k].gap > of_boxes ? own->near[k].gap : of_boxes;
    }
    if (own->n_near > 1) qsort(own->near, own->n_near, sizeof *own->near, by_gap);
    if (own->n_near > 0) take_body(task);
    for (k = 0; k < own->n_near; k++) {
        struct terrain_facet facet = facet_at(pair->terrain, own->near[k].i, own->near[k].j, own->near[k].t);
        collide_status status;
        int64_t count;
        if (own->near[k].gap > best) continue;
        take_prism(task, &facet);
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
    task.pair = &asked;
    task.own = own;
    task.space = space;
    task.manifold = manifold;
    task.body = body_seen_from(pair->ints + INTS * pair->b, pair->numbers + NUMBERS * pair->b, pair->X_WH, pair->X_WB);
    task.tolerance = PLACES * (task.body.reach + terrain->dx + terrain->dy);
    within = task.body.reach + terrain->dx + terrain->dy;
    if (pair->margin > within) asked.margin = 0.0;
    status = find_contacts(&task);
    for (; status == COLLIDE_OK && asked.margin < pair->margin && own->n_rows == 0; within *= 2.0) {
        asked.margin = within < pair->margin ? within : pair->margin;
        status = find_nearest(&task, asked.margin);
    }
    *n = status == COLLIDE_OK ? take_rows(own, max_contacts, rows) : 0;
    return status;
}
