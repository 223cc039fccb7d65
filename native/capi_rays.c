/* Where rays first meet a convex shape, a union or a mesh: `raycast` of collide/casts/raycast.py, by the kernels of ray_parts.py, ray_facets.py
   and ray_hits.py. What Python decides in integers is reported by its proven bracket, or said to be unsupported. */
#include "capi_compound.h"
#include "capi_field.h"
#include "capi_mesh.h"
#include "capi_rays.h"

typedef char ray_hits_are_rows[sizeof(collide_ray_hit) == 88 ? 1 : -1];

/* Hits of a single ray that there is room for to begin with; the mark of one that doubles decide (collide/casts/ray_ends.py). */
enum { HITS_AT_FIRST = 64, NARROW = 2 };

static void begin_hit(collide_ray_hit *hit)
{
    memset(hit, 0, sizeof *hit);
    hit->distance = hit->lower = hit->upper = INFINITE;
    hit->facet = hit->part = -1;
    hit->certified = 1;
}

int begin_chords(struct chords *chords, struct arena *arena, int64_t n)
{
    size_t k, m = (size_t)n;
    chords->n = n;
    chords->poses = arena_take(arena, (m + 1) * POSE * sizeof(double));
    chords->rows = arena_take(arena, m * CHORD_ROW * sizeof(double));
    chords->limits = arena_take(arena, m * sizeof(double));
    chords->shape_of = arena_take(arena, m * sizeof(int64_t));
    chords->asked = arena_take(arena, 2 * m * sizeof(int64_t));
    chords->listed = arena_take(arena, m * sizeof(int64_t));
    chords->exact = arena_take(arena, m);
    chords->places.t = arena_take(arena, 6 * m * sizeof(double));
    chords->places.normals = arena_take(arena, 6 * m * sizeof(double));
    chords->places.columns = arena_take(arena, 6 * m * sizeof(int64_t));
    chords->places.first = arena_take(arena, 2 * m * sizeof(int64_t));
    chords->places.flags = arena_take(arena, 4 * m);
    if (arena->failed) return 0;
    for (k = 0; k < m; k++) {
        chords->shape_of[k] = chords->asked[2 * k + 1] = (int64_t)k;
        chords->asked[2 * k] = 0;
    }
    memset(chords->exact, 0, m);
    return 1;
}

int64_t cut_chords(const struct ray *ray, int both)
{
    struct chords *chords = ray->chords;
    const struct collide_kernels *kernels = ray->space->kernels;
    struct cast_space *cast = ray->space->cast;
    int64_t asked_at = address_of(chords->asked), rows_at = address_of(chords->rows), k;
    memcpy(cast->ray, ray->origin, 3 * sizeof *cast->ray);
    memset(chords->rows, 0, (size_t)(chords->n * CHORD_ROW) * sizeof(double));
    for (k = 0; k < chords->n; k++) chords->limits[k] = ray->limit;
    kernels->cut_parts(chords->ints_at, chords->numbers_at, address_of(chords->poses), address_of(chords->shape_of), asked_at,
                       address_of(cast->ray), chords->n, (uint8_t)both, rows_at, address_of(cast->doubles), address_of(cast->integers));
    return kernels->list_open_chords(chords->ints_at, chords->numbers_at, address_of(chords->shape_of), asked_at, rows_at,
                                     address_of(chords->limits), chords->n, (uint8_t)both, address_of(chords->listed));
}

void write_ends(const struct ray *ray)
{
    struct chords *chords = ray->chords;
    struct places *places = &chords->places;
    places->n = ray->space->kernels->write_chord_ends(
        address_of(chords->rows), address_of(chords->asked), address_of(chords->limits), address_of(&ray->space->cast->exponent),
        address_of(chords->exact), chords->n, address_of(places->t), address_of(places->normals), address_of(places->columns),
        address_of(places->flags));
}

/* The ends of the ray's chords in all parts, those of them that count. */
static collide_status ends_of_chords(const struct ray *ray)
{
    struct chords *chords = ray->chords;
    if (ray->compound != NULL)
        ray->space->kernels->place_all_parts(address_of(ray->compound->parts), chords->n, address_of(chords->poses));
    if (cut_chords(ray, 0) > 0) return COLLIDE_UNSUPPORTED;
    write_ends(ray);
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
    if (!groups[2] || (ray->is_strict && (groups[1] > 1 || groups[2] != NARROW))) return COLLIDE_UNSUPPORTED;
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

collide_status facet_of(const struct ray *ray, struct places *places)
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

/* The row of the ray's first place; of a field items are named as results name them. */
static void write_hit(const struct ray *ray, struct places *places, collide_ray_hit *hit)
{
    const struct collide_kernels *kernels = ray->space->kernels;
    struct cast_space *cast = ray->space->cast;
    int64_t ray_number = 0, first;
    const double *t;
    begin_hit(hit);
    if (places->n == 0) return;
    kernels->first_places(address_of(places->t), address_of(places->columns), address_of(places->flags), places->n, address_of(places->first));
    first = places->first[0];
    t = places->t + 3 * first;
    kernels->write_places(address_of(ray->origin), address_of(cast->ray + RAY_VECTOR), address_of(&cast->exponent),
                          address_of(&ray_number), address_of(t), 1, address_of(hit->point));
    hit->distance = t[0];
    hit->lower = t[1];
    hit->upper = t[2];
    memcpy(hit->normal, places->normals + 3 * first, sizeof hit->normal);
    hit->facet = (int32_t)places->columns[3 * first + 1];
    hit->part = (int32_t)places->columns[3 * first + 2];
    hit->hit = 1;
    hit->certified = places->flags[2 * first + 1];
}

/* The row of a ray at a field, whose chords take room of their own. */
static collide_status cast_at_field(const struct ray *ray, collide_ray_hit *hit)
{
    struct ray own = *ray;
    struct chords chords;
    struct arena arena;
    collide_status status;
    arena_begin(&arena);
    own.chords = &chords;
    status = places_on_field(&own, &chords, &arena);
    if (status == COLLIDE_OK) write_hit(&own, &chords.places, hit);
    arena_end(&arena);
    return status;
}

static collide_status cast_ray(struct ray *ray, double max_distance, collide_ray_hit *hit)
{
    struct cast_space *cast = ray->space->cast;
    struct places *places = &ray->chords->places;
    collide_status status;
    double *pose;
    int k;
    begin_hit(hit);
    for (k = 0; k < 3; k++) if (!(fabs(ray->origin[k]) <= LARGEST)) return COLLIDE_INVALID_ARGUMENT;
    if (!take_direction(ray->space, ray->direction, cast->ray + RAY_VECTOR, &cast->exponent)) return COLLIDE_INVALID_ARGUMENT;
    if (!put_pose(ray->space, ray->X, ray->flags, 0)) return COLLIDE_INVALID_POSE;
    pose = ray->chords->poses + (ray->compound != NULL ? POSE * ray->chords->n : 0);
    memcpy(pose, ray->space->poses, POSE * sizeof *pose);
    ray->limit = ldexp(max_distance, (int)cast->exponent);
    places->n = 0;
    if (ray->field != NULL) return cast_at_field(ray, hit);
    status = ray->mesh != NULL ? facet_of(ray, places) : ends_of_chords(ray);
    if (status == COLLIDE_OK) write_hit(ray, places, hit);
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
    struct batch_statuses reported = {asked->statuses, COLLIDE_OK, 0};
    size_t n = asked->X.count, k;
    struct chords chords;
    struct arena arena;
    rounding given;
    if (failed != NULL) *failed = 0;
    n = asked->origins.count != 1 ? asked->origins.count : n;
    n = asked->directions.count != 1 ? asked->directions.count : n;
    if (!(asked->max_distance >= 0.0) || (ray->flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0 || (n > 0 && asked->hits == NULL) ||
        !take_poses(asked->X, n, &of_x, &step_x) || !take_vectors(asked->origins, n, &of_o, &step_o) ||
        !take_vectors(asked->directions, n, &of_d, &step_d))
        return COLLIDE_INVALID_ARGUMENT;
    if (cast_space_of(ray->space) == NULL) return COLLIDE_NO_MEMORY;
    arena_begin(&arena);
    if (!begin_chords(&chords, &arena, ray->compound != NULL ? (int64_t)ray->compound->n : 1)) {
        arena_end(&arena);
        return COLLIDE_NO_MEMORY;
    }
    chords.ints_at = ray->compound != NULL ? address_of(ray->compound->ints) : ray->space->header[INTS_AT];
    chords.numbers_at = ray->compound != NULL ? address_of(ray->compound->numbers) : ray->space->header[NUMBERS_AT];
    ray->chords = &chords;
    given = round_as_kernels_do();
    for (k = 0; k < n; k++) {
        ray->X = of_x + step_x * (int64_t)k;
        ray->origin = of_o + step_o * (int64_t)k;
        ray->direction = of_d + step_d * (int64_t)k;
        put_status(&reported, k, cast_ray(ray, asked->max_distance, asked->hits + k));
    }
    round_as_before(given);
    arena_end(&arena);
    return end_batch(&reported, failed);
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

/* A ray at nothing yet. */
static struct ray ray_of(collide_workspace *space, unsigned flags)
{
    struct ray ray;
    memset(&ray, 0, sizeof ray);
    ray.space = space;
    ray.flags = flags;
    return ray;
}

collide_status collide_raycast(collide_workspace *workspace, const collide_shape *shape, collide_poses X_WA, collide_vectors origins,
                               collide_vectors directions, double max_distance, unsigned flags, collide_ray_hit *hits,
                               collide_status *statuses, size_t *failed)
{
    struct ray_question asked = question_of(X_WA, origins, directions, max_distance, hits, statuses);
    struct ray ray = ray_of(workspace, flags);
    collide_status status;
    if (failed != NULL) *failed = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(shape, SHAPE_WORD)) return COLLIDE_INVALID_ARGUMENT;
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
    struct ray ray = ray_of(workspace, flags);
    if (failed != NULL) *failed = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(mesh, MESH_WORD) || mesh->radius != 0.0) return COLLIDE_INVALID_ARGUMENT;
    ray.mesh = mesh;
    return cast_rays(&ray, &asked, failed);
}

collide_status collide_compound_raycast(collide_workspace *workspace, const collide_compound *compound, collide_poses X_WA,
                                        collide_vectors origins, collide_vectors directions, double max_distance, unsigned flags,
                                        collide_ray_hit *hits, collide_status *statuses, size_t *failed)
{
    struct ray_question asked = question_of(X_WA, origins, directions, max_distance, hits, statuses);
    struct ray ray = ray_of(workspace, flags);
    if (failed != NULL) *failed = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(compound, COMPOUND_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if (compound->is_whole)
        return collide_raycast(workspace, compound->shapes[0], X_WA, origins, directions, max_distance, flags, hits, statuses, failed);
    ray.compound = compound;
    return cast_rays(&ray, &asked, failed);
}

collide_status collide_field_raycast(collide_workspace *workspace, const collide_field *field, collide_poses X_WF, collide_vectors origins,
                                     collide_vectors directions, double max_distance, unsigned flags, collide_ray_hit *hits,
                                     collide_status *statuses, size_t *failed)
{
    struct ray_question asked = question_of(X_WF, origins, directions, max_distance, hits, statuses);
    struct ray ray = ray_of(workspace, flags);
    if (failed != NULL) *failed = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(field, FIELD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    ray.field = field;
    return cast_rays(&ray, &asked, failed);
}
