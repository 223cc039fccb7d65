/* Shapes, rays, points and boxes from outside a world against its bodies, as collide/worlds/outside.py and casts.py answer
   them. */
#include "capi_casts.h"
#include "capi_contacts.h"
#include "capi_world.h"

#include <math.h>
#include <stdlib.h>

typedef char hits_are_rows[sizeof(collide_world_hit) == 96 && offsetof(collide_world_hit, hit) == 88 ? 1 : -1];

static collide_status refuse_body(const collide_world *world, collide_workspace *space, const char *what, int64_t body,
                                  collide_status status)
{
    return refuse(space->message, status, "%s and body %ld: of %s: %s", what, (long)world->ids[body], kind_of_body(world, body),
                  collide_status_text(status));
}

/* --- boxes and shapes ----------------------------------------------------------------------------------------------- */

/* Numbers of the bodies whose boxes come within a margin of a box, as keys, ascending; *n : how many. 0 where there is no
   memory. boxes : of bodies, with room for margins or without. */
static int boxes_met(const collide_world *world, struct world_space *own, const double *boxes, const double box[6], double margin,
                     size_t *n)
{
    int64_t tree[TREE_HEADER], count;
    size_t k;
    tree_header(world, tree);
    tree[T_BOXES_AT] = address_of(boxes);
    while ((count = world->kernels->boxes_met(address_of(tree), address_of(box), 1, margin, address_of(own->pairs),
                                              (int64_t)own->n_keys)) > (int64_t)own->n_keys)
        if (!fit_keys(own, (size_t)count)) return 0;
    *n = (size_t)count + world->n_unbounded;
    if (!fit_keys(own, *n)) return 0;
    for (k = 0; k < (size_t)count; k++) own->keys[k] = own->pairs[2 * k + 1];
    for (; k < *n; k++) own->keys[k] = world->unbounded[k - (size_t)count];
    sort_keys(own, *n, world->n);
    return 1;
}

collide_status collide_world_boxes_near(const collide_world *world, collide_workspace *workspace, const double low_W[3],
                                        const double high_W[3], double margin, int32_t *ids, size_t capacity, size_t *count)
{
    int is_good = low_W != NULL && high_W != NULL && count != NULL && (capacity == 0 || ids != NULL) && margin >= 0.0, axis;
    collide_status status;
    double box[6];
    rounding given;
    size_t n, k;
    for (axis = 0; is_good && axis < 3; axis++) is_good = low_W[axis] <= high_W[axis];
    status = check_question(world, workspace, "collide_world_boxes_near", is_good,
                            "low_W and high_W must be corners of a box, low <= high, margin >= 0, and ids and count not NULL");
    if (count != NULL) *count = 0;
    if (status != COLLIDE_OK) return status;
    memcpy(box, low_W, 3 * sizeof *box);
    memcpy(box + 3, high_W, 3 * sizeof *box);
    given = round_as_kernels_do();
    if (!boxes_met(world, workspace->world, world->boxes, box, margin, &n)) status = no_memory(workspace);
    round_as_before(given);
    if (status != COLLIDE_OK) return status;
    for (k = 0; k < n && k < capacity; k++) ids[k] = world->ids[workspace->world->keys[k]];
    *count = n;
    return too_many(workspace, n, capacity);
}

void box_around(const collide_world *world, const collide_shape *shape, const double *X_WS, double box[6])
{
    int64_t parts[SINGLE_PARTS], row = 0, body;
    double pose[POSE];
    uint8_t is_moved = 1;
    parts[P_INTS_AT] = address_of(shape->ints);
    parts[P_NUMBERS_AT] = address_of(shape->numbers);
    parts[P_ROW_OF_AT] = address_of(&row);
    parts[P_POSES_AT] = address_of(pose);
    parts[P_BOXES_AT] = address_of(box);
    parts[P_N_BODIES] = 1;
    world->kernels->move_single_parts(address_of(parts), address_of(X_WS), address_of(&is_moved), 0, 0.0, address_of(&body));
}

static collide_status rows_of_shape(const collide_world *world, collide_workspace *space, const collide_shape *shape,
                                    const double *X_WS, double limit, collide_pair *rows, size_t capacity, size_t *count)
{
    struct world_space *own = space->world;
    double box[6];
    size_t n, k;
    box_around(world, shape, X_WS, box);
    if (!boxes_met(world, own, tree_boxes(world), box, limit, &n)) return no_memory(space);
    for (k = 0; k < n; k++) {
        int64_t body = own->keys[k];
        collide_pair row;
        collide_status status;
        if (world->is_whole[body]) status = row_from_outside(world, space, shape, X_WS, body, limit, &row);
        else {
            take_pair(space, shape, shape_of_body(world, body));
            status = row_of_pair(space, X_WS, world->X_WBs + 16 * body, limit, COLLIDE_TRUST_POSES, &row);
        }
        if (status != COLLIDE_OK && status != COLLIDE_ENDLESS_DEPTH)
            return refuse_body(world, space, "the shape", body, status);
        if (row.lower > limit) continue;
        row.a = -1;
        row.b = world->ids[body];
        if (*count < capacity) rows[*count] = row;
        ++*count;
    }
    return too_many(space, *count, capacity);
}

collide_status collide_world_query(const collide_world *world, collide_workspace *workspace, const collide_shape *shape,
                                   const double X_WS[16], double max_distance, collide_pair *rows, size_t capacity, size_t *count)
{
    int is_good = IS_HANDLE(shape, SHAPE_WORD) && X_WS != NULL && count != NULL && (capacity == 0 || rows != NULL) && max_distance >= 0.0;
    collide_status status = check_question(world, workspace, "collide_world_query", is_good,
                                           "shape, X_WS, rows or count is NULL, or max_distance is below 0");
    double pose[POSE];
    rounding given;
    if (count != NULL) *count = 0;
    if (status != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    if (world->kernels->first_bad_pose(address_of(X_WS), 0, 0, 1, 1, address_of(pose)) < 1)
        status = refuse(workspace->message, COLLIDE_INVALID_POSE,
                        "collide_world_query: X_WS is no pose: finite, a rotation, last row 0 0 0 1");
    else status = rows_of_shape(world, workspace, shape, X_WS, max_distance, rows, capacity, count);
    round_as_before(given);
    return status;
}

/* --- rays and points ------------------------------------------------------------------------------------------------ */

int skip_bodies(const collide_world *world, struct world_space *own, const uint32_t *group, const uint32_t *mask)
{
    int64_t any = 0;
    size_t k;
    for (k = 0; k < world->n; k++) {
        const int64_t *traits = world->traits + TRAITS * k;
        own->skipped[k] = (group != NULL && (traits[MASK] & *group) == 0) || (mask != NULL && (traits[GROUP] & *mask) == 0);
        any |= own->skipped[k];
    }
    return (int)any;
}

collide_world_hit nothing_met(size_t k)
{
    collide_world_hit hit;
    memset(&hit, 0, sizeof hit);
    hit.ray = (int32_t)k;
    hit.body = hit.item = hit.facet = -1;
    hit.distance = hit.lower = hit.upper = INFINITE;
    hit.certified = 1;
    return hit;
}

void leave_open(collide_world_hit *hit)
{
    int32_t ray = hit->ray;
    memset(hit, 0, sizeof *hit);
    hit->ray = ray;
}

collide_status refuse_direction(collide_workspace *space, const char *caller, size_t k)
{
    return refuse(space->message, COLLIDE_INVALID_ARGUMENT,
                  "%s: directions_W[%zu] is 0, not finite, outside 1e-100 ... 1e100, or has components of ratio 2^500", caller, k);
}

/* Whether n points, x y z of each, are finite and not too large; *k : which is not. */
static int are_places(const double *points, size_t n, size_t *k)
{
    for (*k = 0; *k < 3 * n; ++*k)
        if (!is_coordinate(points[*k])) break;
    *k /= 3;
    return *k == n;
}

/* One ray: its row, or COLLIDE_UNSUPPORTED where its first wall is left open. */
static collide_status cast_ray(const collide_world *world, collide_workspace *space, const double *ray, int64_t exponent,
                               double limit, collide_world_hit *hit)
{
    struct world_space *own = space->world;
    int64_t tree[RAY_TREE], n;
    double *integers = own->rays + world->measures[W_RAY_DOUBLES];
    tree[R_NODES_AT] = address_of(world->tree.nodes);
    tree[R_LINKS_AT] = address_of(world->tree.links);
    tree[R_N_NODES] = world->tree.sections[world->tree.n_sections];
    tree[R_FIRST_AT] = address_of(world->first);
    tree[R_N_BODIES] = (int64_t)world->n;
    tree[R_SKIPPED_AT] = address_of(own->skipped);
    tree[R_MESHED_AT] = address_of(world->is_whole);
    tree[R_UNBOUNDED_AT] = address_of(world->unbounded);
    tree[R_N_UNBOUNDED] = (int64_t)world->n_unbounded;
    limit = ldexp(limit, (int)exponent);
    while ((n = world->kernels->parts_on_rays(address_of(world->table.ints), address_of(world->table.numbers), address_of(world->poses),
                                              address_of(world->row_of), address_of(tree), address_of(ray), address_of(&limit),
                                              address_of(&exponent), 1, address_of(hit), address_of(own->pairs), (int64_t)own->n_keys,
                                              address_of(own->rays), address_of(integers))) > (int64_t)own->n_keys)
        if (!fit_keys(own, (size_t)n)) return COLLIDE_NO_MEMORY;
    if (n > 0) return settle_ray(world, space, ray, exponent, limit, own->pairs, n, hit);
    if (hit->body >= 0) hit->body = world->ids[hit->body];
    return COLLIDE_OK;
}

collide_status collide_world_raycast(const collide_world *world, collide_workspace *workspace, const double *origins_W,
                                     const double *directions_W, size_t n, double max_distance, const uint32_t *group,
                                     const uint32_t *mask, collide_world_hit *hits, collide_status *statuses)
{
    static const char caller[] = "collide_world_raycast";
    int is_good = n == 0 || (origins_W != NULL && directions_W != NULL && hits != NULL);
    collide_status status = check_question(world, workspace, caller, is_good && max_distance >= 0.0,
                                           "origins_W, directions_W or hits is NULL, or max_distance is below 0");
    collide_status first = COLLIDE_OK;
    double ray[RAY];
    int64_t exponent;
    rounding given;
    size_t k;
    if (status != COLLIDE_OK) return status;
    if (!are_places(origins_W, n, &k))
        return refuse(workspace->message, COLLIDE_INVALID_ARGUMENT, "%s: origins_W[%zu] is not finite, or exceeds 1e50", caller, k);
    given = round_as_kernels_do();
    skip_bodies(world, workspace->world, group, mask);
    for (k = 0; k < n && status == COLLIDE_OK; k++) {
        collide_status one;
        memcpy(ray, origins_W + 3 * k, 3 * sizeof *ray);
        if (!take_direction(workspace, directions_W + 3 * k, ray + 3, &exponent)) {
            status = refuse_direction(workspace, caller, k);
            break;
        }
        hits[k] = nothing_met(k);
        one = cast_ray(world, workspace, ray, exponent, max_distance, &hits[k]);
        hits[k].ray = (int32_t)k;
        if (one != COLLIDE_OK) leave_open(&hits[k]);
        if (one == COLLIDE_NO_MEMORY) status = no_memory(workspace);
        else if (one != COLLIDE_OK && first == COLLIDE_OK)
            first = refuse(workspace->message, one, "%s: ray %zu touches, or begins on, a surface within rounding", caller, k);
        if (statuses != NULL) statuses[k] = one;
    }
    round_as_before(given);
    return status != COLLIDE_OK ? status : first;
}

/* Leaves side by side, of the bodies that have an end and count; *n : how many. 0 where there is no memory. */
static int lay_out_leaves(const collide_world *world, struct world_space *own, int64_t *n)
{
    size_t body;
    *n = 0;
    if (own->n_flat < world->n) {
        double *nodes = realloc(own->flat_nodes, 6 * world->capacity * sizeof *nodes);
        int64_t *links = nodes == NULL ? NULL : realloc(own->flat_links, LINK * world->capacity * sizeof *links);
        if (nodes != NULL) own->flat_nodes = nodes;
        if (links == NULL) return 0;
        own->flat_links = links;
        own->n_flat = world->capacity;
    }
    for (body = 0; body < world->n; body++) {
        if (own->skipped[body] || world->leaf_of[body] < 0) continue;
        memcpy(own->flat_nodes + 6 * *n, world->boxes + 6 * body, 6 * sizeof(double));
        own->flat_links[LINK * *n + SKIP] = *n + 1;
        own->flat_links[LINK * *n + BODY] = (int64_t)body;
        own->flat_links[LINK * *n + PARENT] = -1;
        ++*n;
    }
    return 1;
}

size_t bodies_ahead(const collide_world *world, struct world_space *own, const double question[SWEEP], int of_points, int64_t n_leaves)
{
    const double *nodes = n_leaves < 0 ? world->tree.nodes : own->flat_nodes;
    const int64_t *links = n_leaves < 0 ? world->tree.links : own->flat_links;
    int64_t n_nodes = n_leaves < 0 ? world->tree.sections[world->tree.n_sections] : n_leaves, count, k;
    size_t n = 0, j;
    count = world->kernels->boxes_ahead(address_of(question), 1, (uint8_t)of_points, address_of(nodes), address_of(links), n_nodes,
                                        address_of(own->pairs), address_of(own->bounds), (int64_t)own->n_keys);
    for (k = 0; k < count; k++) {
        int64_t body = own->pairs[2 * k + 1];
        if (own->skipped[body]) continue;
        own->bounds[n] = own->bounds[k];
        own->keys[n++] = body;
    }
    for (j = 0; j < world->n_unbounded; j++) {
        if (own->skipped[world->unbounded[j]]) continue;
        own->bounds[n] = 0.0;
        own->keys[n++] = world->unbounded[j];
    }
    return n;
}

/* Bodies that may be nearest to a point, as keys, ascending; how many.   n_leaves : as of `bodies_ahead`. */
static size_t bodies_around(const collide_world *world, struct world_space *own, const double *point, double limit, int64_t n_leaves)
{
    double question[SWEEP] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    size_t n;
    memcpy(question, point, 3 * sizeof *question);
    question[SWEEP - 1] = limit;
    n = bodies_ahead(world, own, question, 1, n_leaves);
    sort_keys(own, n, world->n);
    return n;
}

/* The least signed distance of a point and the bodies of n keys, ascending: of several the first. Another body may be nearer
   where brackets overlap: what is proven is the least of both ends. */
static collide_status nearest_of_keys(const collide_world *world, collide_workspace *space, size_t n, const double *point,
                                      double limit, collide_world_hit *hit)
{
    struct world_space *own = space->world;
    double X_WP[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, lower = INFINITE, upper = INFINITE;
    collide_world_hit nothing = *hit;
    size_t first, k, some;
    for (k = 0; k < 3; k++) X_WP[4 * k + 3] = point[k];
    for (first = 0; first < n; first += some) {
        collide_status status;
        for (some = 0; some < BLOCK && first + some < n && !world->is_whole[own->keys[first + some]];) some++;
        if (some > 0) status = answer_keys(world, space, own->keys + first, some, X_WP, 0, INFINITE);
        else {
            int64_t body = own->keys[first];
            status = row_from_outside(world, space, world->point, X_WP, body, INFINITE, own->rows);
            own->rows[0].b = world->ids[body];
            some = 1;
            if (status != COLLIDE_OK) return refuse_body(world, space, "a point", body, status);
        }
        if (status != COLLIDE_OK) return status;
        for (k = 0; k < some; k++) {
            const collide_pair *row = &own->rows[k];
            if (row->lower < lower) lower = row->lower;
            if (row->upper < upper) upper = row->upper;
            if (hit->hit && !(row->distance < hit->distance)) continue;
            hit->hit = 1;
            hit->certified = row->certified;
            hit->body = row->b;
            hit->item = row->part_b;
            hit->distance = row->distance;
            memcpy(hit->normal, row->normal, sizeof hit->normal);
            memcpy(hit->point, row->point_b, sizeof hit->point);
        }
    }
    hit->lower = lower;
    hit->upper = upper;
    if (lower > limit) *hit = nothing;
    return COLLIDE_OK;
}

collide_status collide_world_nearest(const collide_world *world, collide_workspace *workspace, const double *points_W, size_t n,
                                     double max_distance, const uint32_t *group, const uint32_t *mask, collide_world_hit *hits)
{
    static const char caller[] = "collide_world_nearest";
    int is_good = (n == 0 || (points_W != NULL && hits != NULL)) && max_distance >= 0.0;
    collide_status status = check_question(world, workspace, caller, is_good,
                                           "points_W or hits is NULL, or max_distance is below 0");
    int64_t n_leaves = -1;
    rounding given;
    size_t k, near;
    if (status != COLLIDE_OK) return status;
    if (!are_places(points_W, n, &k))
        return refuse(workspace->message, COLLIDE_INVALID_ARGUMENT, "%s: points_W[%zu] is not finite, or exceeds 1e50", caller, k);
    given = round_as_kernels_do();
    if (skip_bodies(world, workspace->world, group, mask) && !lay_out_leaves(world, workspace->world, &n_leaves))
        status = no_memory(workspace);
    for (k = 0; k < n && status == COLLIDE_OK; k++) {
        hits[k] = nothing_met(k);
        near = bodies_around(world, workspace->world, points_W + 3 * k, max_distance, n_leaves);
        status = nearest_of_keys(world, workspace, near, points_W + 3 * k, max_distance, &hits[k]);
    }
    round_as_before(given);
    return status;
}
