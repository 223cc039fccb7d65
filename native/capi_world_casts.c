/* Shapes moved along a direction through a world, as `cast_shape` of collide/worlds/casts.py: bodies by their boxes on the way, the
   nearest first, each by `collide_cast` or onto a field. What these leave to Python, and meshes in the way, are said to be unsupported. */
#include "capi_casts.h"
#include "capi_field.h"
#include "capi_world.h"

#include <stdlib.h>

/* So much of the t of a proven hit later bodies are cast beyond it. */
static const double BEYOND_T = 1.0 / (1 << 20);

/* A cast: the shape where it begins, its direction as kernels take it, and how far it goes, in lengths of that. */
struct moved_shape {
    const collide_shape *shape;
    const double *X_WS;
    double vector[3], limit;
    unsigned flags;
};

/* What is met first, of the bodies asked so far: t in lengths of the vector.   upper : of proven hits, `farthest` of all; `doubtful` the
   least from below of what is not certified; `beyond` where later bodies need not be looked for any more. */
struct first_body {
    collide_first_contact contact;
    int64_t body; /* -1: none */
    double lower, upper, farthest, doubtful, beyond;
};

/* The candidates of a cast in order, in own->pairs; how many. */
static size_t in_the_way(const collide_world *world, struct world_space *own, const struct moved_shape *moved)
{
    struct candidate *made = (struct candidate *)(void *)own->pairs;
    double question[SWEEP];
    size_t n, k;
    box_around(world, moved->shape, moved->X_WS, question);
    memcpy(question + 6, moved->vector, sizeof moved->vector);
    question[SWEEP - 1] = moved->limit;
    n = bodies_ahead(world, own, question, 0, -1);
    for (k = 0; k < n; k++) {
        made[k].bound = own->bounds[k];
        made[k].key = own->keys[k];
    }
    if (n > 0) qsort(made, n, sizeof *made, compare_candidates);
    return n;
}

/* Another body's contact, which is a hit: the first is the one of least t, of several the one of the body with the least id. */
static void take_hit(struct first_body *first, int64_t body, const collide_first_contact *contact, int is_proven)
{
    double t = contact->distance, upper = contact->upper;
    if (contact->lower < first->lower) first->lower = contact->lower;
    if (upper > first->farthest) first->farthest = upper;
    if (is_proven && upper < first->upper) first->upper = upper;
    if (is_proven) {
        double beyond = upper * (1.0 + BEYOND_T) + 8.0 * (upper - contact->lower);
        if (beyond < first->beyond) first->beyond = beyond;
    }
    if (!contact->certified && contact->lower < first->doubtful) first->doubtful = contact->lower;
    if (first->body >= 0 && !(t < first->contact.distance || (t == first->contact.distance && body < first->body))) return;
    first->contact = *contact;
    first->body = body;
}

/* The cast onto one body, t up to a limit. Normals of shapes that touch a field at the start are Python's to tell. */
static collide_status cast_onto_body(const collide_world *world, collide_workspace *space, const struct moved_shape *moved, int64_t body,
                                     double limit, collide_first_contact *contact, int *is_proven)
{
    const double *X_WB = world->X_WBs + 16 * body;
    const collide_field *field = world->is_whole[body] ? world->wholes[body].field : NULL;
    unsigned trust = moved->flags & (unsigned)COLLIDE_TRUST_POSES;
    collide_status status = COLLIDE_UNSUPPORTED;
    if (field != NULL) {
        status = cast_onto_field(space, moved->shape, field, moved->X_WS, X_WB, moved->vector, limit, trust, contact, is_proven);
        if (status == COLLIDE_OK && contact->at_start && moved->flags & COLLIDE_START_NORMALS) status = COLLIDE_UNSUPPORTED;
    } else if (!world->is_whole[body]) {
        status = collide_cast(space, moved->shape, shape_of_body(world, body), moved->X_WS, X_WB, moved->vector, limit, moved->flags, contact);
        *is_proven = status == COLLIDE_OK && space->cast->marks[IS_PROVEN];
    }
    return status;
}

/* Ask candidates in rounds, each of twice as many: those whose boxes may be met no later than what is proven to be met.
   *asked : the body asked last. */
static collide_status ask_in_order(const collide_world *world, collide_workspace *space, const struct moved_shape *moved, size_t n,
                                   struct first_body *first, int64_t *asked)
{
    const struct candidate *candidates = (const struct candidate *)(void *)space->world->pairs;
    size_t begin, size, k;
    for (begin = 0, size = 1; begin < n && candidates[begin].bound <= first->upper; begin += size, size *= 2) {
        double best = first->upper, limit = first->beyond < moved->limit ? first->beyond : moved->limit;
        for (k = begin; k < n && k < begin + size && candidates[k].bound <= best; k++) {
            int64_t body = *asked = candidates[k].key;
            collide_first_contact contact;
            int is_proven;
            collide_status status = cast_onto_body(world, space, moved, body, limit, &contact, &is_proven);
            if (status != COLLIDE_OK) return status;
            if (contact.hit) take_hit(first, body, &contact, is_proven);
        }
    }
    return COLLIDE_OK;
}

/* The row of what is met first, t in lengths of the direction handed in: it was scaled by 2^-exponent. */
static void write_hit(const collide_world *world, const struct first_body *first, int64_t exponent, collide_world_hit *hit)
{
    double upper = first->upper < INFINITE ? first->upper : first->farthest; /* what may be no hit bounds nothing, unless alone */
    if (first->body < 0) return;
    hit->distance = ldexp(first->contact.distance, (int)-exponent);
    hit->lower = ldexp(first->lower, (int)-exponent);
    hit->upper = ldexp(upper, (int)-exponent);
    memcpy(hit->normal, first->contact.normal, sizeof hit->normal);
    memcpy(hit->point, first->contact.point, sizeof hit->point);
    hit->body = world->ids[first->body];
    hit->item = first->contact.part_b;
    hit->hit = 1;
    hit->certified = !(first->doubtful <= upper); /* what is met later has no say in it */
    hit->at_start = first->contact.at_start;
}

static collide_status cast_through(const collide_world *world, collide_workspace *space, const struct moved_shape *moved,
                                   int64_t exponent, collide_world_hit *hit, int64_t *asked)
{
    struct first_body first;
    collide_status status;
    memset(&first, 0, sizeof first);
    first.body = -1;
    first.lower = first.upper = first.doubtful = first.beyond = INFINITE;
    status = ask_in_order(world, space, moved, in_the_way(world, space->world, moved), &first, asked);
    if (status == COLLIDE_OK) write_hit(world, &first, exponent, hit);
    else leave_open(hit);
    return status;
}

collide_status collide_world_cast(const collide_world *world, collide_workspace *workspace, const collide_shape *shape,
                                  collide_poses X_WS, collide_vectors directions_W, double max_distance, unsigned flags,
                                  const uint32_t *group, const uint32_t *mask, collide_world_hit *hits, collide_status *statuses)
{
    static const char caller[] = "collide_world_cast";
    size_t n = X_WS.count == 0 || directions_W.count == 0 ? 0 : X_WS.count > directions_W.count ? X_WS.count : directions_W.count, k;
    const double *poses, *along;
    double pose[POSE];
    int64_t step, step_along;
    int is_good = IS_HANDLE(shape, SHAPE_WORD) && take_poses(X_WS, n, &poses, &step) &&
                  take_vectors(directions_W, n, &along, &step_along) && (n == 0 || hits != NULL) && max_distance >= 0.0 &&
                  (flags & ~(unsigned)(COLLIDE_TRUST_POSES | COLLIDE_START_NORMALS)) == 0;
    collide_status status = check_question(world, workspace, caller, is_good,
                                           "shape, X_WS, directions_W or hits is NULL, counts are neither n nor 1, max_distance is below "
                                           "0, or a flag is none of casts"), first = COLLIDE_OK;
    rounding given;
    if (status != COLLIDE_OK) return status;
    if (shape->ints[KIND] == HALFSPACE)
        return refuse(workspace->message, COLLIDE_UNSUPPORTED, "%s: shape is a half-space, which has no end: it cannot be cast", caller);
    given = round_as_kernels_do();
    skip_bodies(world, workspace->world, group, mask);
    for (k = 0; k < n && status == COLLIDE_OK; k++) {
        struct moved_shape moved = {shape, poses + step * (int64_t)k, {0.0, 0.0, 0.0}, 0.0, flags | COLLIDE_TRUST_POSES};
        int64_t exponent, asked = 0;
        collide_status one;
        if (workspace->kernels->first_bad_pose(address_of(moved.X_WS), 0, 0, 1, !(flags & COLLIDE_TRUST_POSES), address_of(pose)) < 1)
            status = refuse(workspace->message, COLLIDE_INVALID_POSE, "%s: X_WS[%zu] is no pose: finite, a rotation, last row 0 0 0 1", caller, k);
        else if (!take_direction(workspace, along + step_along * (int64_t)k, moved.vector, &exponent))
            status = refuse_direction(workspace, caller, k);
        if (status != COLLIDE_OK) break;
        moved.limit = ldexp(max_distance, (int)exponent);
        hits[k] = nothing_met(k);
        one = cast_through(world, workspace, &moved, exponent, &hits[k], &asked);
        if (one == COLLIDE_NO_MEMORY) status = no_memory(workspace);
        else if (one != COLLIDE_OK && first == COLLIDE_OK)
            first = refuse(workspace->message, one, "%s: cast %zu and body %ld: onto %s: %s", caller, k, (long)world->ids[asked],
                           kind_of_body(world, asked), collide_status_text(one));
        if (statuses != NULL) statuses[k] = one;
    }
    round_as_before(given);
    return status != COLLIDE_OK ? status : first;
}
