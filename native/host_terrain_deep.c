/* Overlaps with a height field that no direction out of a single prism leaves. */
#include "host_terrain_task.h"

#include <string.h>

/* Of directions that are tried the one along which all facets that are hit are clear soonest, and which is the last. */
struct way_out {
    double n[3], length;
    size_t last;
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

/* The facet that is the last to be clear along n. */
static size_t try_way(const struct task *task, const double n[3], struct way_out *best)
{
    const struct terrain_space *own = task->own;
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
    if (n[2] > 0.0 && length < best->length) {
        best->length = length;
        best->last = last;
        memcpy(best->n, n, sizeof best->n);
    }
    return last;
}

/* Upwards, along normals, and out of hulls of a few facets, one more at a time: around a peak or along a ridge these are what is hit. */
static struct way_out best_way_out(const struct task *task)
{
    static const double upwards[3] = {0.0, 0.0, 1.0};
    struct terrain_space *own = task->own;
    struct way_out best;
    double n[3];
    size_t k, last;
    int n_tried = 0;
    best.length = INFINITE;
    last = try_way(task, upwards, &best);
    for (k = 0; k < own->n_near && n_tried < MAX_TRIED; k++)
        if (own->near[k].is_hit) {
            n_tried++;
            try_way(task, own->near[k].facet.n, &best);
            try_way(task, own->near[k].n, &best);
        }
    for (n_tried = 0; n_tried < MAX_HULLS && !own->near[last].is_in_hull; n_tried++) {
        own->near[last].is_in_hull = 1;
        if (!way_out_of_hull(task, n)) break;
        last = try_way(task, n, &best);
    }
    return best;
}

/* Points of all facets that are hit, along one normal; where none of these is as deep as the way is long, one that is. */
static void put_way_out(const struct task *task, const struct way_out *way)
{
    struct terrain_space *own = task->own;
    collide_contact row;
    double q[3];
    size_t k;
    int c;
    memset(&row, 0, sizeof row);
    row.distance = -way->length;
    turn_to_world(task->pair->X_WH, way->n, row.normal);
    for (k = 0; k < own->n_near && !task->body.is_round; k++)
        if (own->near[k].is_hit) {
            take_prism(task, &own->near[k].facet);
            add_manifold(task, way->n, NULL, NULL, 0.0);
        }
    for (c = 0; c < own->n_rows; c++)
        if (own->rows[c].distance <= row.distance * (1.0 - 1e-6) && dot3(own->rows[c].normal, row.normal) > SAME_NORMAL) return;
    for (c = 0; c < 3; c++) q[c] = own->near[way->last].p[c] - way->length * way->n[c];
    point_to_world(task->pair->X_WH, own->near[way->last].p, row.point_a);
    point_to_world(task->pair->X_WH, q, row.point_b);
    keep_rows(task, &row, 1);
}

void put_deep_contact(const struct task *task)
{
    struct terrain_space *own = task->own;
    struct way_out way;
    size_t k;
    int n_hit = 0;
    for (k = 0; k < own->n_near; k++)
        if (own->near[k].is_hit) {
            own->near[k].is_hit = !is_cleared(task, own->near + k);
            n_hit += own->near[k].is_hit;
        }
    if (n_hit == 0) return;
    way = best_way_out(task);
    if (way.length < INFINITE) put_way_out(task, &way);
}
