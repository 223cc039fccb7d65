/* Whether facets close and enclose something: `survey_surface` of collide/mesh/mesh_survey.py, so far as a solid needs
   it. */
#include "capi_mesh.h"

#include <stdlib.h>
#include <string.h>

/* Corners by the first vertex of the same coordinates. */
static void weld(const struct collide_kernels *kernels, struct arena *arena, const double *vertices, int64_t n,
                 const int32_t *faces, struct surface *surface)
{
    int64_t size = 16, k;
    double *points = arena_take(arena, (size_t)(3 * n) * 8);
    int32_t *first = arena_take(arena, (size_t)n * 4), *table;
    while (size < 2 * n) size *= 2;
    table = arena_take(arena, (size_t)size * 4);
    if (arena->failed) return;
    for (k = 0; k < 3 * n; k++) points[k] = vertices[k] + 0.0; /* -0.0 and 0.0 are one number */
    for (k = 0; k < size; k++) table[k] = -1;
    kernels->first_rows(address_of(points), n, address_of(table), size, address_of(first));
    for (k = 0; k < 3 * surface->n_facets; k++) surface->corners[k] = first[faces[k]];
}

/* Whether an inside can be told of a surface that closes: a shell of positive volume, and none inside out. */
static int encloses(const struct collide_kernels *kernels, struct arena *arena, const double *vertices, int64_t n,
                    const struct surface *surface)
{
    int64_t shells = surface->n_shells, k;
    double *volumes = arena_take(arena, (size_t)shells * 8);
    int32_t *signs = arena_take(arena, (size_t)shells * 4), *wrong = arena_take(arena, (size_t)shells * 4);
    void *memory = arena_take(arena, (size_t)kernels->shells_memory(n, surface->n_facets, shells));
    int positive = 0, any_wrong = 0;
    if (arena->failed) return 0;
    kernels->judge_shells(address_of(vertices), n, address_of(surface->corners), surface->n_facets,
                          address_of(surface->shells), shells, address_of(volumes), address_of(signs), address_of(wrong),
                          address_of(memory));
    for (k = 0; k < shells; k++) {
        positive = positive || signs[k] > 0;
        any_wrong = any_wrong || wrong[k];
    }
    return positive && !any_wrong;
}

static void look(const struct collide_kernels *kernels, struct arena *arena, const double *vertices, int64_t n,
                 const int32_t *faces, struct surface *surface)
{
    int64_t m[MEASURES], *counts, k;
    int32_t *flags = arena_take(arena, (size_t)surface->n_facets * 4), *scratch;
    int closed;
    workspace_sizes(kernels, m);
    counts = arena_take(arena, (size_t)m[M_COUNTS] * 8);
    scratch = arena_take(arena, (size_t)(12 * surface->n_facets + 4 * n + 1) * 4);
    if (arena->failed) return;
    weld(kernels, arena, vertices, n, faces, surface);
    if (arena->failed) return;
    kernels->classify_facets(address_of(surface->corners), surface->n_facets, n, address_of(flags), address_of(surface->shells),
                            address_of(counts), address_of(scratch));
    surface->n_shells = counts[m[M_SHELLS]];
    closed = counts[m[M_EDGES]] > 0;
    for (k = 0; k < surface->n_facets; k++) closed = closed && !(flags[k] & m[M_NOT_CLOSED]);
    surface->solid = closed ? encloses(kernels, arena, vertices, n, surface) : 0;
}

collide_status look_at_surface(const struct collide_kernels *kernels, const double *vertices, int64_t n, const int32_t *faces,
                               int64_t n_facets, struct surface *surface)
{
    struct arena arena;
    memset(surface, 0, sizeof *surface);
    surface->n_facets = n_facets;
    surface->corners = malloc((size_t)(3 * n_facets) * sizeof *surface->corners);
    surface->shells = malloc((size_t)n_facets * sizeof *surface->shells);
    arena_begin(&arena, NULL, 0);
    if (surface->corners == NULL || surface->shells == NULL) arena.failed = 1;
    else look(kernels, &arena, vertices, n, faces, surface);
    arena_end(&arena);
    return arena.failed ? COLLIDE_NO_MEMORY : COLLIDE_OK;
}
