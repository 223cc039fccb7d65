/* Which shells with a negative volume are cavities, and which are inside out: collide/mesh/shell_nesting.py.

   A shell that runs the wrong way round is the wall of a cavity where everything else winds around it at least once. Rays are
   cast from one of its points in fixed directions, in doubles with an error bound, and in exact numbers for the facets that come
   too close. */
#include "capi_mesh.h"
#include "capi_bigint.h"

#include <string.h>

/* Directions tried before a point is given up, and points of a shell tried before it is. */
enum { DIRECTIONS = 6, TRIED = 24 };
/* The sum of three coordinates below 1, and three times one, round by less than this. */
static const double ROUNDED_MIDDLE = 1.7763568394002505e-15;

struct nesting {
    const struct collide_kernels *kernels;
    struct arena *arena;
    const struct surface *surface;
    const double *vertices, *scaled;
    const int8_t *signs;
    int64_t n;
    double *low, *high; /* boxes of shells */
    uint8_t *shared;    /* vertices of several shells: they lie on other shells' facets, so they tell nothing */
    uint8_t *around;    /* shells whose boxes meet a point */
};

/* A fixed component within 2^19 of 0; few planes of a mesh will hold such a direction. */
static int32_t direction_of(int k, int axis)
{
    uint32_t h = (uint32_t)(3 * k + axis + 1) * 0x9e3779b1u;
    h = (h ^ h >> 15) * 0x85ebca6bu;
    return (int32_t)((h ^ h >> 13) & 0xfffffu) - 0x80000;
}

static int find_boxes(struct nesting *nesting)
{
    const struct surface *surface = nesting->surface;
    int64_t f, k, n_shells = surface->n_shells;
    int32_t *owner = arena_take(nesting->arena, (size_t)nesting->n * 4);
    nesting->low = arena_take(nesting->arena, (size_t)(3 * n_shells) * 8);
    nesting->high = arena_take(nesting->arena, (size_t)(3 * n_shells) * 8);
    nesting->shared = arena_take(nesting->arena, (size_t)nesting->n);
    nesting->around = arena_take(nesting->arena, (size_t)n_shells);
    if (nesting->arena->failed) return 0;
    for (k = 0; k < 3 * n_shells; k++) {
        nesting->low[k] = INFINITE;
        nesting->high[k] = -INFINITE;
    }
    for (k = 0; k < nesting->n; k++) {
        owner[k] = -1;
        nesting->shared[k] = 0;
    }
    for (f = 0; f < surface->n_facets; f++) {
        int32_t shell = surface->shells[f];
        for (k = 0; shell >= 0 && k < 3; k++) {
            int32_t vertex = surface->corners[3 * f + k];
            int axis;
            if (owner[vertex] >= 0 && owner[vertex] != shell) nesting->shared[vertex] = 1;
            owner[vertex] = shell;
            for (axis = 0; axis < 3; axis++) {
                double value = nesting->vertices[3 * (int64_t)vertex + axis];
                if (value < nesting->low[3 * shell + axis]) nesting->low[3 * shell + axis] = value;
                if (value > nesting->high[3 * shell + axis]) nesting->high[3 * shell + axis] = value;
            }
        }
    }
    return 1;
}

/* Mark the shells but one whose boxes meet that of some vertices; whether one of positive volume is among them. */
static int find_around(struct nesting *nesting, int32_t shell, const int32_t *row, int n_vertices)
{
    int64_t k;
    int i, axis, positive = 0;
    for (k = 0; k < nesting->surface->n_shells; k++) {
        int meets = k != shell;
        for (axis = 0; meets && axis < 3; axis++) {
            double lowest = INFINITE, highest = -INFINITE;
            for (i = 0; i < n_vertices; i++) {
                double value = nesting->vertices[3 * (int64_t)row[i] + axis];
                if (value < lowest) lowest = value;
                if (value > highest) highest = value;
            }
            meets = nesting->low[3 * k + axis] <= highest && nesting->high[3 * k + axis] >= lowest;
        }
        nesting->around[k] = (uint8_t)meets;
        positive = positive || (meets && nesting->signs[k] > 0);
    }
    return positive;
}

static struct bigint determinant(struct arena *arena, const struct bigint *a, const struct bigint *b, const struct bigint *c)
{
    struct bigint sum = bigint_of(arena, 0.0);
    int i;
    for (i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        struct bigint across = bigint_difference(arena, bigint_product(arena, b[j], c[k]), bigint_product(arena, b[k], c[j]));
        sum = bigint_sum(arena, sum, bigint_product(arena, a[i], across));
    }
    return sum;
}

/* Seen from the middle of vertices, exactly: on which side of each of a facet's edges the ray passes, and on which side of the
   facet the point lies. */
static void exact_signs(struct nesting *nesting, const int32_t *facet, const int32_t *row, int n_vertices,
                        const int32_t *direction, int sides[3], int *height)
{
    struct arena *arena = nesting->arena;
    struct mark mark = arena_mark(arena);
    struct bigint away[3][3], along[3], count = bigint_of(arena, n_vertices);
    int k, i, axis;
    for (axis = 0; axis < 3; axis++) {
        struct bigint middle = bigint_of(arena, 0.0);
        for (i = 0; i < n_vertices; i++)
            middle = bigint_sum(arena, middle, bigint_of(arena, nesting->vertices[3 * (int64_t)row[i] + axis]));
        for (k = 0; k < 3; k++) {
            struct bigint corner = bigint_of(arena, nesting->vertices[3 * (int64_t)facet[k] + axis]);
            away[k][axis] = bigint_difference(arena, bigint_product(arena, corner, count), middle);
        }
        along[axis] = bigint_of(arena, direction[axis]);
    }
    for (k = 0; k < 3; k++) sides[k] = determinant(arena, along, away[k], away[(k + 1) % 3]).sign;
    *height = determinant(arena, away[0], away[1], away[2]).sign;
    arena_return(arena, mark);
}

/* What a direction says of a point: how often facets wind around it. */
enum { DECIDED, ON_A_FACET, MET_AN_EDGE };

static int ask_direction(struct nesting *nesting, const int32_t *corners, int64_t facets, const int32_t *row, int n_vertices,
                         int k, int32_t *ambiguous, int64_t *winding)
{
    double ray[8];
    int32_t direction[3];
    int64_t count, u;
    int axis, i, on_it = 0;
    for (axis = 0; axis < 3; axis++) {
        direction[axis] = direction_of(k, axis);
        ray[axis] = nesting->scaled[3 * (int64_t)row[0] + axis];
        for (i = 1; i < n_vertices; i++) ray[axis] += nesting->scaled[3 * (int64_t)row[i] + axis];
        ray[3 + axis] = direction[axis];
    }
    ray[6] = n_vertices;
    ray[7] = n_vertices == 1 ? 0.0 : ROUNDED_MIDDLE;
    count = nesting->kernels->cast_ray(address_of(nesting->scaled), nesting->n, address_of(corners), facets, address_of(ray),
                                       address_of(winding), address_of(ambiguous));
    for (u = 0; u < count; u++) {
        int sides[3], height, up, down, level;
        exact_signs(nesting, corners + 3 * (int64_t)ambiguous[u], row, n_vertices, direction, sides, &height);
        up = sides[0] > 0 || sides[1] > 0 || sides[2] > 0;
        down = sides[0] < 0 || sides[1] < 0 || sides[2] < 0;
        level = sides[0] == 0 || sides[1] == 0 || sides[2] == 0;
        if (up && down) continue;
        if (level) return MET_AN_EDGE;
        on_it = on_it || height == 0;
        if (height == sides[0]) *winding += sides[0];
    }
    return on_it ? ON_A_FACET : DECIDED;
}

/* Whether the facets around wind around the middle of vertices: 1, 0; -1 where it lies on one, or all directions met an edge. */
static int is_wound_around(struct nesting *nesting, const int32_t *row, int n_vertices)
{
    const struct surface *surface = nesting->surface;
    struct arena *arena = nesting->arena;
    struct mark mark = arena_mark(arena);
    int32_t *corners = arena_take(arena, (size_t)(3 * surface->n_facets) * 4);
    int32_t *ambiguous = arena_take(arena, (size_t)surface->n_facets * 4);
    int64_t facets = 0, f, winding = 0;
    int k, outcome = MET_AN_EDGE;
    if (arena->failed) return 0;
    for (f = 0; f < surface->n_facets; f++)
        if (surface->shells[f] >= 0 && nesting->around[surface->shells[f]])
            memcpy(corners + 3 * facets++, surface->corners + 3 * f, 3 * sizeof *corners);
    for (k = 0; k < DIRECTIONS && outcome == MET_AN_EDGE; k++)
        outcome = ask_direction(nesting, corners, facets, row, n_vertices, k, ambiguous, &winding);
    arena_return(arena, mark);
    return outcome == DECIDED ? winding >= 1 : -1;
}

/* The least vertex of a shell, not shared, that is larger than `above`; -1 where there is none. */
static int32_t next_alone(const struct nesting *nesting, int32_t shell, int32_t above)
{
    const struct surface *surface = nesting->surface;
    int64_t f;
    int k;
    int32_t found = -1;
    for (f = 0; f < surface->n_facets; f++)
        for (k = 0; surface->shells[f] == shell && k < 3; k++) {
            int32_t vertex = surface->corners[3 * f + k];
            if (vertex > above && !nesting->shared[vertex] && (found < 0 || vertex < found)) found = vertex;
        }
    return found;
}

static int is_cavity(struct nesting *nesting, int32_t shell)
{
    const struct surface *surface = nesting->surface;
    int32_t vertex = -1;
    int64_t f;
    int tried, outcome;
    for (tried = 0; tried < TRIED && (vertex = next_alone(nesting, shell, vertex)) >= 0; tried++) {
        if (!find_around(nesting, shell, &vertex, 1)) return 0;
        if ((outcome = is_wound_around(nesting, &vertex, 1)) >= 0) return outcome;
    }
    for (f = 0, tried = 0; f < surface->n_facets && tried < TRIED; f++) {
        if (surface->shells[f] != shell) continue;
        tried++;
        if (!find_around(nesting, shell, surface->corners + 3 * f, 3)) return 0;
        if ((outcome = is_wound_around(nesting, surface->corners + 3 * f, 3)) >= 0) return outcome;
    }
    return 0;
}

int are_cavities(const struct collide_kernels *kernels, struct arena *arena, const struct surface *surface,
                 const double *vertices, const double *scaled, int64_t n, const int8_t *signs)
{
    struct nesting nesting;
    int64_t shell;
    nesting.kernels = kernels;
    nesting.arena = arena;
    nesting.surface = surface;
    nesting.vertices = vertices;
    nesting.scaled = scaled;
    nesting.signs = signs;
    nesting.n = n;
    if (!find_boxes(&nesting)) return 0;
    for (shell = 0; shell < surface->n_shells; shell++)
        if (signs[shell] < 0 && (!is_cavity(&nesting, (int32_t)shell) || arena->failed)) return 0;
    return 1;
}
