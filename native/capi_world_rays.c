/* Rays through a world whose first wall kernels leave open since a mesh or a field may be it: the places of all that a ray may meet first
   together, as `cast_rays` of collide/worlds/casts.py has them. */
#include "capi_field.h"
#include "capi_mesh.h"
#include "capi_rays.h"
#include "capi_world.h"

#include <stdlib.h>

/* A place where the ray meets a body. */
struct body_place {
    double t[3], normal[3];
    int64_t column[3], body; /* column : ray, facet, item */
    uint8_t flags[2];        /* proven, certified */
};

/* Places met so far, in an arena. */
struct body_places {
    struct body_place *of;
    size_t n, capacity;
    struct arena *arena;
};

static int by_place(const void *one, const void *other)
{
    const struct body_place *a = one, *b = other;
    if (a->t[0] != b->t[0]) return a->t[0] < b->t[0] ? -1 : 1;
    if (a->body != b->body) return a->body < b->body ? -1 : 1;
    if (a->column[2] != b->column[2]) return a->column[2] < b->column[2] ? -1 : 1;
    return (a->column[1] > b->column[1]) - (a->column[1] < b->column[1]);
}

/* Take places: of a mesh or a field, body -1 being no chord's; or of chords, whose items are numbers of bodies. */
static int take_places(struct body_places *all, const struct places *places, const int64_t *bodies, int64_t body)
{
    int64_t k;
    if (all->n + (size_t)places->n > all->capacity) {
        size_t capacity = 2 * (all->n + (size_t)places->n);
        struct body_place *more = arena_take(all->arena, capacity * sizeof *more);
        if (more == NULL) return 0;
        if (all->n > 0) memcpy(more, all->of, all->n * sizeof *more);
        all->of = more;
        all->capacity = capacity;
    }
    for (k = 0; k < places->n; k++) {
        struct body_place *place = &all->of[all->n++];
        memcpy(place->t, places->t + 3 * k, sizeof place->t);
        memcpy(place->normal, places->normals + 3 * k, sizeof place->normal);
        memcpy(place->column, places->columns + 3 * k, sizeof place->column);
        memcpy(place->flags, places->flags + 2 * k, sizeof place->flags);
        place->body = bodies != NULL ? bodies[place->column[2]] : body;
        if (bodies != NULL) place->column[2] = 0;
    }
    return 1;
}

/* The ends of the ray's chords in n convex bodies. */
static collide_status places_on_shapes(const collide_world *world, const struct ray *ray, const int64_t *bodies, int64_t n,
                                       struct body_places *all)
{
    struct ray own = *ray;
    struct chords chords;
    int64_t k;
    if (n == 0) return COLLIDE_OK;
    if (!begin_chords(&chords, all->arena, n)) return COLLIDE_NO_MEMORY;
    own.chords = &chords;
    chords.ints_at = address_of(world->table.ints);
    chords.numbers_at = address_of(world->table.numbers);
    chords.poses = world->poses;
    chords.shape_of = world->row_of;
    for (k = 0; k < n; k++) chords.asked[2 * k + 1] = bodies[k];
    if (cut_chords(&own, 0) > 0) return COLLIDE_UNSUPPORTED;
    write_ends(&own);
    return take_places(all, &chords.places, bodies, -1) ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

static collide_status places_on_whole(const collide_world *world, const struct ray *ray, int64_t body, struct body_places *all)
{
    struct ray own = *ray;
    struct chords chords;
    collide_status status = COLLIDE_UNSUPPORTED; /* of the mesh of a convex shape */
    own.field = world->wholes[body].field;
    own.mesh = world->wholes[body].mesh;
    own.X = world->X_WBs + 16 * body;
    own.chords = &chords;
    if (own.field != NULL) {
        if (!put_pose(ray->space, own.X, COLLIDE_TRUST_POSES, 0)) return COLLIDE_INVALID_POSE;
        status = places_on_field(&own, &chords, all->arena);
    } else if (own.mesh->given) {
        if (!begin_chords(&chords, all->arena, 1)) return COLLIDE_NO_MEMORY;
        chords.places.n = 0;
        status = facet_of(&own, &chords.places);
    }
    if (status != COLLIDE_OK) return status;
    return take_places(all, &chords.places, NULL, body) ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

/* The row of the first of all places. */
static collide_status write_first(const collide_world *world, const struct ray *ray, struct body_places *all, collide_world_hit *hit)
{
    const struct cast_space *cast = ray->space->cast;
    double *t = arena_take(all->arena, 3 * all->n * sizeof *t);
    int64_t *columns = arena_take(all->arena, 3 * all->n * sizeof *columns), *first = arena_take(all->arena, all->n * sizeof *first);
    uint8_t *flags = arena_take(all->arena, 2 * all->n);
    size_t k;
    if (all->arena->failed) return COLLIDE_NO_MEMORY;
    if (all->n == 0) return COLLIDE_OK;
    qsort(all->of, all->n, sizeof *all->of, by_place);
    for (k = 0; k < all->n; k++) {
        memcpy(t + 3 * k, all->of[k].t, sizeof all->of[k].t);
        memcpy(columns + 3 * k, all->of[k].column, sizeof all->of[k].column);
        memcpy(flags + 2 * k, all->of[k].flags, sizeof all->of[k].flags);
    }
    world->kernels->first_places(address_of(t), address_of(columns), address_of(flags), (int64_t)all->n, address_of(first));
    t += 3 * first[0];
    hit->distance = t[0];
    hit->lower = t[1];
    hit->upper = t[2];
    memcpy(hit->normal, all->of[first[0]].normal, sizeof hit->normal);
    for (k = 0; k < 3; k++) hit->point[k] = ray->origin[k] + t[0] * ldexp(cast->ray[RAY_VECTOR + k], (int)cast->exponent);
    hit->body = world->ids[all->of[0].body];
    hit->item = (int32_t)columns[3 * first[0] + 2];
    hit->facet = (int32_t)columns[3 * first[0] + 1];
    hit->hit = 1;
    hit->certified = flags[2 * first[0] + 1];
    return COLLIDE_OK;
}

collide_status settle_ray(const collide_world *world, collide_workspace *space, const double *ray, int64_t exponent, double limit,
                          const int64_t *pairs, int64_t n, collide_world_hit *hit)
{
    struct cast_space *cast = cast_space_of(space);
    struct body_places all = {NULL, 0, 0, NULL};
    struct arena arena;
    struct ray asked;
    collide_status status;
    int64_t *bodies, k, n_shapes = 0;
    if (cast == NULL) return COLLIDE_NO_MEMORY;
    memset(&asked, 0, sizeof asked);
    asked.space = space;
    asked.origin = ray;
    asked.limit = limit;
    asked.flags = COLLIDE_TRUST_POSES;
    asked.is_strict = 1;
    memcpy(cast->ray, ray, CHORD_RAY * sizeof *ray);
    cast->exponent = exponent;
    arena_begin(&arena);
    all.arena = &arena;
    bodies = arena_take(&arena, (size_t)n * sizeof *bodies);
    for (k = 0; bodies != NULL && k < n; k++) if (!world->is_whole[pairs[2 * k + 1]]) bodies[n_shapes++] = pairs[2 * k + 1];
    status = bodies == NULL ? COLLIDE_NO_MEMORY : places_on_shapes(world, &asked, bodies, n_shapes, &all);
    for (k = 0; k < n && status == COLLIDE_OK; k++)
        if (world->is_whole[pairs[2 * k + 1]]) status = places_on_whole(world, &asked, pairs[2 * k + 1], &all);
    if (status == COLLIDE_OK) status = write_first(world, &asked, &all, hit);
    arena_end(&arena);
    return status;
}
