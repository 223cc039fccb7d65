/* Overlaps with a height field that no direction out of a single prism leaves. */
#include "host_terrain_task.h"

#include <math.h>
#include <string.h>

enum { MAX_WAYS = 3 * MAX_TRIED + MAX_HULLS + 1, MAX_CHECKED = 64, ROUNDS = 16 };

/* A direction along which all facets that are hit are clear at some length, and which is the last. */
struct way_out {
    double n[3], length;
    size_t last;
};

/* Directions that are tried. */
struct ways {
    struct way_out all[MAX_WAYS];
    int n;
};

/* How far the body has to be moved along n until it is clear of a facet's prism, at most: until n parts them, or the direction does
   that is the prism's own way out, or the facet's plane. */
static double clearing_length(const struct near_facet *near, const double n[3], double lowest)
{
    double length = -facet_gap_along(&near->facet, n, lowest), along = dot3(near->n, n), rise = dot3(near->facet.n, n);
    if (along > 0.0 && near->depth < length * along) length = near->depth / along;
    if (rise > 0.0 && -near->gap < length * rise) length = -near->gap / rise;
    return length;
}

static int is_cleared(const struct task *task, const struct near_facet *near)
{
    const struct terrain_space *own = task->own;
    int k;
    for (k = 0; k < own->n_touches; k++) {
        const struct touch *touch = own->touches + k;
        if (clearing_length(near, touch->n, touch->lowest) <= -touch->distance + task->tolerance) return 1;
    }
    return 0;
}

/* Keep a direction upwards; the facet that is the last to be clear along it. */
static size_t try_way(const struct task *task, const double n[3], struct ways *ways)
{
    const struct terrain_space *own = task->own;
    struct way_out *way = ways->all + ways->n;
    double away[3] = {-n[0], -n[1], -n[2]}, support[3], lowest = -body_support(&task->body, away, support), length = 0.0;
    size_t k, last = 0;
    for (k = 0; k < own->n_near; k++)
        if (own->near[k].is_hit) {
            double of_facet = clearing_length(own->near + k, n, lowest);
            if (of_facet > length) {
                length = of_facet;
                last = k;
            }
        }
    if (n[2] > 0.0 && ways->n < MAX_WAYS) {
        way->length = length;
        way->last = last;
        memcpy(way->n, n, sizeof way->n);
        ways->n++;
    }
    return last;
}

/* Straight up, until all that is near is below: nothing else comes in the way then. */
static struct way_out way_upwards(const struct task *task)
{
    const struct terrain_space *own = task->own;
    struct way_out way = {{0.0, 0.0, 1.0}, 0.0, 0};
    size_t k;
    for (k = 0; k < own->n_near; k++) {
        double length = -facet_gap_along(&own->near[k].facet, way.n, task->body.low[2]);
        if (length > way.length) {
            way.length = length;
            way.last = k;
        }
    }
    return way;
}

/* Along normals that are known, along others, and out of hulls of a few facets, one more at a time: around a peak or along a ridge these
   are what is hit. */
static void try_ways(const struct task *task, struct ways *ways)
{
    static const double upwards[3] = {0.0, 0.0, 1.0};
    struct terrain_space *own = task->own;
    double n[3];
    size_t k, last;
    int n_tried = 0;
    ways->n = 0;
    last = try_way(task, upwards, ways);
    for (n_tried = 0; n_tried < own->n_touches && n_tried < MAX_TRIED; n_tried++) try_way(task, own->touches[n_tried].n, ways);
    for (k = 0, n_tried = 0; k < own->n_near && n_tried < MAX_TRIED; k++)
        if (own->near[k].is_hit) {
            n_tried++;
            try_way(task, own->near[k].facet.n, ways);
            try_way(task, own->near[k].n, ways);
        }
    for (n_tried = 0; n_tried < MAX_HULLS && !own->near[last].is_in_hull; n_tried++) {
        own->near[last].is_in_hull = 1;
        if (!way_out_of_hull(task, n)) break;
        last = try_way(task, n, ways);
    }
}

/* Move t on until no contact that is known overlaps, nor the way, where there is one: along one normal after another. */
static void resolve(const struct task *task, const struct way_out *way, double t[3])
{
    const struct terrain_space *own = task->own;
    int round, k, c;
    for (round = 0; round < ROUNDS; round++)
        for (k = way != NULL ? -1 : 0; k < own->n_touches; k++) {
            const double *n = k < 0 ? way->n : own->touches[k].n;
            double gap = (k < 0 ? -way->length : own->touches[k].distance) + dot3(t, n);
            for (c = 0; c < 3 && gap < 0.0; c++) t[c] -= gap * n[c];
        }
}

/* Whether the body, moved by t, overlaps the field nowhere by more than a hundredth of what it was moved. */
static int is_clear_at(const struct task *task, const double t[3])
{
    struct terrain_space *own = task->own;
    struct terrain_body moved = task->body;
    double X_WB[16], way[3], slack = 1e-2 * sqrt(dot3(t, t)) + task->tolerance;
    size_t n_near = own->n_near, k;
    int c, is_clear = 1;
    turn_to_world(task->pair->X_WH, t, way);
    memcpy(X_WB, task->pair->X_WB, sizeof X_WB);
    for (c = 0; c < 3; c++) {
        moved.p_HB[c] += t[c];
        moved.low[c] += t[c];
        moved.high[c] += t[c];
        X_WB[4 * c + 3] += way[c];
    }
    if (add_near(task->pair, &moved, -slack, own) < 0) is_clear = 0;
    for (k = n_near; k < own->n_near && is_clear; k++) {
        collide_pair row;
        take_prism(task, &own->near[k].facet);
        is_clear = row_of_pair(task->space, task->pair->X_WH, X_WB, 0.0, 0, &row) == COLLIDE_OK && row.distance >= -slack;
    }
    own->n_near = n_near;
    return is_clear;
}

/* The way that adds least to what the contacts that are known move the body, of those that end clear of the field: a way that is short
   because it leads into other facets is none. 0 where nothing is to be added. */
static int best_way_out(const struct task *task, struct way_out *best)
{
    struct ways ways;
    double t[3] = {0.0, 0.0, 0.0};
    int n_checked, k;
    try_ways(task, &ways);
    resolve(task, NULL, t);
    for (n_checked = 0; n_checked < MAX_CHECKED; n_checked++) {
        double least = INFINITE, end[3];
        int soonest = -1;
        for (k = 0; k < ways.n; k++) {
            double more = ways.all[k].length - dot3(ways.all[k].n, t);
            if (more < least) {
                least = more;
                soonest = k;
            }
        }
        if (soonest < 0) break;
        *best = ways.all[soonest];
        memcpy(end, t, sizeof end);
        resolve(task, best, end);
        if (is_clear_at(task, end)) return least > task->tolerance;
        ways.all[soonest].length = INFINITE;
    }
    *best = way_upwards(task);
    return 1;
}

/* Where the body touches last, moved out along n: its point that is farthest back along n, where that stands in the field, as it does of
   balls and ellipsoids whatever the field (their normal there is n, and nowhere else); else the point of the facet that is the last. */
static void place_of_way_out(const struct task *task, const struct way_out *way, double p[3])
{
    const struct terrain_space *own = task->own;
    double back[3] = {-way->n[0], -way->n[1], -way->n[2]}, lowest[3], off[3];
    int is_in_field = task->body.is_round, c;
    size_t k;
    body_support(&task->body, back, lowest);
    for (k = 0; k < own->n_near && !is_in_field; k++) {
        const struct terrain_facet *facet = &own->near[k].facet;
        for (c = 0; c < 3; c++) off[c] = lowest[c] - facet->v[0][c];
        is_in_field = depth_in_walls(facet, lowest) >= -task->tolerance && dot3(off, facet->n) <= task->tolerance;
    }
    for (c = 0; c < 3; c++) p[c] = is_in_field ? lowest[c] + way->length * way->n[c] : own->near[way->last].p[c];
}

/* Points along one normal of all facets that are hit, and of those beside them that are no deeper along it: ends of a body's faces lie
   over these. Where none of the points is as deep as the way is long, one that is. */
static void put_way_out(const struct task *task, const struct way_out *way)
{
    struct terrain_space *own = task->own;
    collide_contact row;
    double back[3] = {-way->n[0], -way->n[1], -way->n[2]}, p[3], q[3], lowest = -body_support(&task->body, back, p);
    size_t k;
    int c;
    memset(&row, 0, sizeof row);
    row.distance = -way->length;
    turn_to_world(task->pair->X_WH, way->n, row.normal);
    for (k = 0; k < own->n_near && !task->body.is_round; k++)
        if (own->near[k].is_hit || -facet_gap_along(&own->near[k].facet, way->n, lowest) <= way->length + task->tolerance) {
            take_prism(task, &own->near[k].facet);
            add_manifold(task, way->n, NULL, NULL, 0.0);
        }
    for (c = 0; c < own->n_rows; c++)
        if (own->rows[c].distance <= row.distance * (1.0 - 1e-6) && dot3(own->rows[c].normal, row.normal) > SAME_NORMAL) return;
    place_of_way_out(task, way, p);
    for (c = 0; c < 3; c++) q[c] = p[c] - way->length * way->n[c];
    point_to_world(task->pair->X_WH, p, row.point_a);
    point_to_world(task->pair->X_WH, q, row.point_b);
    keep_rows(task, &row, 1);
}

void put_deep_contact(const struct task *task)
{
    struct terrain_space *own = task->own;
    struct way_out way;
    size_t k;
    int n_hit = 0;
    /* Facets that were asked before a contact was found that accounts for them add their points along it here. */
    for (k = 0; k < own->n_near; k++)
        if (own->near[k].is_hit) {
            own->near[k].is_hit = !is_accounted_for(task, &own->near[k].facet) && !is_cleared(task, own->near + k);
            n_hit += own->near[k].is_hit;
        }
    if (n_hit == 0) return;
    if (best_way_out(task, &way)) put_way_out(task, &way);
}
