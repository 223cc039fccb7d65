/* Whether facets close and enclose something: `survey_surface` of collide/mesh/mesh_survey.py, so far as a solid needs
   it. */
#include "capi_mesh.h"
#include "capi_bigint.h"

#include <stdlib.h>
#include <string.h>

/* As in collide/mesh/shell_volumes.py: errors of a term of a volume, of a sum, and of what underflows. */
static const double TERM_ERROR = 1.7763568394002505e-15, UNIT = 1.1102230246251565e-16;
#define UNDERFLOW_OF_TERMS ldexp(1.0, -1000)

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

/* Sign of the volume that a shell encloses, exactly. */
static int exact_sign(struct arena *arena, const double *vertices, const struct surface *surface, int32_t shell)
{
    struct arena sums;
    struct bigint total = bigint_of(arena, 0.0);
    int64_t f;
    arena_begin(&sums, NULL, 0);
    for (f = 0; f < surface->n_facets; f++) {
        struct mark mark = arena_mark(arena), nothing = {NULL, NULL, 0, 0};
        struct bigint v[9], next = total;
        int i;
        if (surface->shells[f] != shell) continue;
        for (i = 0; i < 9; i++) v[i] = bigint_of(arena, vertices[3 * (int64_t)surface->corners[3 * f + i / 3] + i % 3]);
        for (i = 0; i < 3; i++) { /* a . (b x c) */
            int j = (i + 1) % 3, k = (i + 2) % 3;
            struct bigint across = bigint_difference(arena, bigint_product(arena, v[3 + j], v[6 + k]),
                                                   bigint_product(arena, v[3 + k], v[6 + j]));
            next = bigint_sum(arena, next, bigint_product(arena, v[i], across));
        }
        arena_return(&sums, nothing);
        total = bigint_copy(&sums, next);
        arena_return(arena, mark);
    }
    if (sums.failed) arena->failed = 1;
    arena_end(&sums);
    return total.sign;
}

/* Whether an inside can be told of a surface that closes. */
static int encloses(const struct collide_kernels *kernels, struct arena *arena, const double *vertices, int64_t n,
                    const struct surface *surface)
{
    int64_t n_shells = surface->n_shells, k;
    double *scaled = arena_take(arena, (size_t)(3 * n) * 8), largest = 0.0;
    double *six = arena_take(arena, (size_t)n_shells * 8), *sizes = arena_take(arena, (size_t)n_shells * 8);
    int32_t *first = arena_take(arena, (size_t)n_shells * 4), *members = arena_take(arena, (size_t)n_shells * 4);
    int8_t *signs = arena_take(arena, (size_t)n_shells);
    int exponent, positive = 0, negative = 0;
    if (arena->failed) return 0;
    for (k = 0; k < 3 * n; k++)
        if (fabs(vertices[k]) > largest) largest = fabs(vertices[k]);
    frexp(largest, &exponent);
    for (k = 0; k < 3 * n; k++) scaled[k] = ldexp(vertices[k], -exponent);
    for (k = 0; k < n_shells; k++) {
        six[k] = sizes[k] = 0.0;
        first[k] = -1;
        members[k] = 0;
    }
    kernels->sum_volumes(address_of(scaled), n, address_of(surface->corners), surface->n_facets, address_of(surface->shells),
                         n_shells, address_of(first), address_of(members), address_of(six), address_of(sizes));
    for (k = 0; k < n_shells; k++) {
        double margin = sizes[k] * 2.0 * (TERM_ERROR + UNIT * members[k]) + UNDERFLOW_OF_TERMS * members[k];
        int sign = six[k] > 0.0 ? 1 : six[k] < 0.0 ? -1 : 0;
        if (fabs(six[k]) <= margin) sign = exact_sign(arena, vertices, surface, (int32_t)k);
        signs[k] = (int8_t)sign;
        positive = positive || sign > 0;
        negative = negative || sign < 0;
    }
    return positive && (!negative || are_cavities(kernels, arena, surface, vertices, scaled, n, signs));
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
