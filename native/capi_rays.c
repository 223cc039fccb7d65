/* Where rays first meet a convex shape or a mesh: `raycast` of collide/casts/raycast.py, by the kernels of ray_parts.py, ray_facets.py
   and ray_hits.py. What Python decides in integers is told by its proven bracket, or said to be unsupported. */
#include "capi_casts.h"
#include "capi_box_tree.h"
#include "capi_mesh.h"

typedef char ray_hits_are_rows[sizeof(collide_ray_hit) == 88 ? 1 : -1];

/* Places of a surface that a ray meets, as collide/casts/ray_ends.py has them: a chord has two. */
enum { MAX_PLACES = 2 };
struct places {
    double t[3 * MAX_PLACES], normals[3 * MAX_PLACES];
    int64_t columns[3 * MAX_PLACES], n; /* ray, facet, item */
    uint8_t flags[2 * MAX_PLACES];      /* proven, certified */
};

/* A ray and what it is cast at: a mesh, or where that is NULL a shape that stands in the workspace's table. */
struct ray {
    collide_workspace *space;
    const collide_mesh *mesh;
    const double *X, *origin, *direction;
    double limit; /* in units of the scaled direction, once it is */
    unsigned flags;
};

/* Hits of a single ray that there is room for to begin with. */
enum { HITS_AT_FIRST = 64 };

static void begin_hit(collide_ray_hit *hit)
{
    memset(hit, 0, sizeof *hit);
    hit->distance = hit->lower = hit->upper = INFINITE;
    hit->facet = hit->part = -1;
    hit->certified = 1;
}

/* The two ends of the ray's chord in a convex set, or those of them that count. */
static collide_status chord_of(const struct ray *ray, struct places *places)
{
    collide_workspace *space = ray->space;
    const struct collide_kernels *kernels = space->kernels;
    struct cast_space *cast = space->cast;
    const int64_t *h = space->header;
    int64_t asked[2] = {0, 0}, listed;
    int64_t asked_at = address_of(asked), row_at = address_of(cast->chord), limit_at = address_of(&ray->limit);
    uint8_t exact = 0;
    memcpy(cast->ray, ray->origin, 3 * sizeof *cast->ray);
    memset(cast->chord, 0, sizeof cast->chord);
    kernels->cut_parts(h[INTS_AT], h[NUMBERS_AT], h[POSES_AT], h[SHAPE_OF_AT], asked_at, address_of(cast->ray), 1, 0, row_at,
                       address_of(cast->doubles), address_of(cast->integers));
    if (kernels->list_open_chords(h[INTS_AT], h[NUMBERS_AT], h[SHAPE_OF_AT], asked_at, row_at, limit_at, 1, 0, address_of(&listed)) > 0)
        return COLLIDE_UNSUPPORTED;
    places->n = kernels->write_chord_ends(row_at, asked_at, limit_at, address_of(&cast->exponent), address_of(&exact), 1,
                                          address_of(places->t), address_of(places->normals), address_of(places->columns),
                                          address_of(places->flags));
    return COLLIDE_OK;
}

/* The first of listed hits: the one whose bracket ends before the others begin; of several the least facet of those that hang
   together, with a bracket of the first of them. */
static collide_status first_of_hits(const struct ray *ray, const double *to_facets, const double *hits, int64_t n, uint8_t *is_narrow,
                                    struct places *places)
{
    const struct collide_kernels *kernels = ray->space->kernels;
    const double *triangles = (const double *)(intptr_t)ray->mesh->tree[TRIANGLES_AT];
    int64_t groups[5], exponent_at = address_of(&ray->space->cast->exponent), listed;
    double t[3];
    int k;
    if (n == 0) return COLLIDE_OK;
    kernels->group_first_facets(address_of(hits), n, address_of(to_facets), address_of(is_narrow), address_of(groups));
    if (!groups[2]) return COLLIDE_UNSUPPORTED;
    for (k = 0; k < 3; k++) { /* value, from below, from above */
        kernels->scale_facet_t(address_of(hits + FACET_HIT * groups[k == 0 ? 0 : 2 + k]), 1, address_of(to_facets), exponent_at, address_of(t));
        places->t[k] = t[k];
    }
    places->t[0] = places->t[0] > places->t[2] ? places->t[2] : places->t[0];
    places->n = 1;
    places->columns[0] = places->columns[2] = 0;
    places->columns[1] = (int64_t)hits[FACET_HIT * groups[0] + HIT_FACET];
    places->flags[0] = places->flags[1] = 1;
    triangles += 9 * (int64_t)hits[FACET_HIT * groups[0] + HIT_PLACE];
    return kernels->write_facet_normals(address_of(ray->X), 0, address_of(triangles), 1, address_of(places->normals), address_of(&listed)) > 0
               ? COLLIDE_UNSUPPORTED : COLLIDE_OK;
}

/* The first facet that a ray meets. */
static collide_status facet_of(const struct ray *ray, struct places *places)
{
    collide_workspace *space = ray->space;
    const collide_mesh *mesh = ray->mesh;
    double to_facets[FACET_RAY], some[FACET_HIT * HITS_AT_FIRST], *hits = some;
    uint8_t flags[HITS_AT_FIRST], *is_narrow = flags;
    int64_t capacity = HITS_AT_FIRST, n, ended;
    collide_status status = COLLIDE_NO_MEMORY;
    struct arena arena;
    arena_begin(&arena);
    space->kernels->put_rays_to_facets(address_of(ray->X), 0, address_of(mesh->numbers + CENTRE), mesh->reach, address_of(ray->origin),
                                       address_of(space->cast->ray + RAY_VECTOR), address_of(&ray->limit), 1, address_of(to_facets));
    while ((ended = facets_on_ray(space, mesh, ray->X, to_facets, hits, capacity, &n)) == 1 && !arena.failed) {
        capacity *= 4;
        hits = arena_take(&arena, (size_t)(FACET_HIT * capacity) * sizeof *hits);
        is_narrow = arena_take(&arena, (size_t)capacity);
        if (arena.failed) break;
    }
    if (ended == 2) status = COLLIDE_INVALID_POSE;
    else if (!arena.failed) status = first_of_hits(ray, to_facets, hits, n, is_narrow, places);
    arena_end(&arena);
    return status;
}

static void write_hit(const struct ray *ray, struct places *places, collide_ray_hit *hit)
{
    const struct collide_kernels *kernels = ray->space->kernels;
    struct cast_space *cast = ray->space->cast;
    int64_t first[MAX_PLACES], ray_number = 0;
    const double *t;
    begin_hit(hit);
    if (places->n == 0) return;
    kernels->first_places(address_of(places->t), address_of(places->columns), address_of(places->flags), places->n, address_of(first));
    t = places->t + 3 * first[0];
    kernels->write_places(address_of(ray->origin), address_of(cast->ray + RAY_VECTOR), address_of(&cast->exponent),
                          address_of(&ray_number), address_of(t), 1, address_of(hit->point));
    hit->distance = t[0];
    hit->lower = t[1];
    hit->upper = t[2];
    memcpy(hit->normal, places->normals + 3 * first[0], sizeof hit->normal);
    hit->facet = (int32_t)places->columns[3 * first[0] + 1];
    hit->part = 0;
    hit->hit = 1;
    hit->certified = places->flags[2 * first[0] + 1];
}

static collide_status cast_ray(struct ray *ray, double max_distance, collide_ray_hit *hit)
{
    struct cast_space *cast = ray->space->cast;
    struct places places;
    collide_status status;
    int k;
    begin_hit(hit);
    for (k = 0; k < 3; k++) if (!(fabs(ray->origin[k]) <= LARGEST)) return COLLIDE_INVALID_ARGUMENT;
    if (!take_direction(ray->space, ray->direction, cast->ray + RAY_VECTOR)) return COLLIDE_INVALID_ARGUMENT;
    if (!put_pose(ray->space, ray->X, ray->flags, 0)) return COLLIDE_INVALID_POSE;
    ray->limit = ldexp(max_distance, (int)cast->exponent);
    places.n = 0;
    status = ray->mesh != NULL ? facet_of(ray, &places) : chord_of(ray, &places);
    if (status == COLLIDE_OK) write_hit(ray, &places, hit);
    return status;
}

/* n rays at a shape whose surface is known, arguments but numbers checked. */
struct ray_question {
    collide_poses X;
    collide_vectors origins, directions;
    double max_distance;
    collide_ray_hit *hits;
    collide_status *statuses;
};

static collide_status cast_rays(struct ray *ray, const struct ray_question *asked, size_t *failed)
{
    const double *of_x, *of_o, *of_d;
    int64_t step_x, step_o, step_d;
    collide_status status, worst = COLLIDE_OK;
    size_t n = asked->X.count, k, blamed = 0;
    rounding given;
    if (failed != NULL) *failed = 0;
    n = asked->origins.count != 1 ? asked->origins.count : n;
    n = asked->directions.count != 1 ? asked->directions.count : n;
    if (!(asked->max_distance >= 0.0) || (ray->flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0 || (n > 0 && asked->hits == NULL) ||
        !take_poses(asked->X, n, &of_x, &step_x) || !take_vectors(asked->origins, n, &of_o, &step_o) ||
        !take_vectors(asked->directions, n, &of_d, &step_d))
        return COLLIDE_INVALID_ARGUMENT;
    if (cast_space_of(ray->space) == NULL) return COLLIDE_NO_MEMORY;
    given = round_as_kernels_do();
    for (k = 0; k < n; k++) {
        ray->X = of_x + step_x * (int64_t)k;
        ray->origin = of_o + step_o * (int64_t)k;
        ray->direction = of_d + step_d * (int64_t)k;
        status = cast_ray(ray, asked->max_distance, asked->hits + k);
        if (asked->statuses != NULL) asked->statuses[k] = status;
        if (status == COLLIDE_OK || worst != COLLIDE_OK) continue;
        worst = status;
        blamed = k;
    }
    round_as_before(given);
    if (failed != NULL) *failed = blamed;
    return worst;
}

static struct ray_question question_of(collide_poses X, collide_vectors origins, collide_vectors directions, double max_distance,
                                       collide_ray_hit *hits, collide_status *statuses)
{
    struct ray_question asked;
    asked.X = X;
    asked.origins = origins;
    asked.directions = directions;
    asked.max_distance = max_distance;
    asked.hits = hits;
    asked.statuses = statuses;
    return asked;
}

collide_status collide_raycast(collide_workspace *workspace, const collide_shape *shape, collide_poses X_WA, collide_vectors origins,
                               collide_vectors directions, double max_distance, unsigned flags, collide_ray_hit *hits,
                               collide_status *statuses, size_t *failed)
{
    struct ray_question asked = question_of(X_WA, origins, directions, max_distance, hits, statuses);
    struct ray ray;
    collide_status status;
    if (failed != NULL) *failed = 0;
    if (workspace == NULL || shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    ray.space = workspace;
    ray.flags = flags;
    ray.mesh = NULL;
    if (shape->ints[KIND] == POINTS && shape->numbers[RADIUS] == 0.0 && shape->numbers[SLOP] == 0.0 &&
        (status = surface_of(shape, &ray.mesh)) != COLLIDE_OK)
        return status;
    take_pair(workspace, shape, shape);
    return cast_rays(&ray, &asked, failed);
}

collide_status collide_mesh_raycast(collide_workspace *workspace, const collide_mesh *mesh, collide_poses X_WA, collide_vectors origins,
                                    collide_vectors directions, double max_distance, unsigned flags, collide_ray_hit *hits,
                                    collide_status *statuses, size_t *failed)
{
    struct ray_question asked = question_of(X_WA, origins, directions, max_distance, hits, statuses);
    struct ray ray;
    if (failed != NULL) *failed = 0;
    if (workspace == NULL || mesh == NULL || mesh->radius != 0.0) return COLLIDE_INVALID_ARGUMENT;
    ray.space = workspace;
    ray.flags = flags;
    ray.mesh = mesh;
    return cast_rays(&ray, &asked, failed);
}
