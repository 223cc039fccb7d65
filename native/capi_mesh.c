/* Meshes from arrays, and the surfaces of polytopes: collide/shapes/mesh.py, collide/lowering/facet_bodies.py and the tree of
   collide/mesh/build_bvh.py. */
#include "capi_box_tree.h"
#include "capi_mesh.h"
#include "capi_tree.h"

#include <stdlib.h>
#include <string.h>

/* The most facets that a box-tree holds. */
static const size_t MAX_FACETS = (size_t)1 << 28;

typedef char headers_fit[sizeof ((struct collide_mesh *)0)->tree == TREE_INTS * sizeof(int64_t) &&
                                 sizeof ((struct collide_mesh *)0)->numbers == TREE_NUMBERS * sizeof(double) ? 1 : -1];

/* What `fill_tree` makes. */
struct filled {
    int32_t *nodes, *ids;
    double *triangles;
    int64_t n_nodes;
};

static struct filled fill(const struct collide_kernels *kernels, struct arena *arena, const int64_t *m, const double *vertices,
                          int64_t n, const int64_t *faces, int64_t n_facets, collide_mesh *mesh)
{
    struct filled made;
    int64_t most = n_facets > 2 ? n_facets : 2, n_stack = 3 * m[M_WIDTH] * (m[M_DEEPEST_SPLIT] + 40), counts[2] = {0, 0};
    double numbers[4];
    void *records = arena_take(arena, (size_t)(m[M_RECORD] * n_facets) * 4);
    void *work = arena_take(arena, (size_t)m[M_TREE_WORK] * 8);
    void *stack = arena_take(arena, (size_t)n_stack * 8);
    made.nodes = arena_take(arena, (size_t)(m[M_NODE] * most) * 4);
    made.triangles = arena_take(arena, (size_t)(9 * n_facets) * 8);
    made.ids = arena_take(arena, (size_t)n_facets * 4);
    made.n_nodes = 0;
    if (arena->failed) return made;
    kernels->fill_tree(address_of(vertices), n, address_of(faces), n_facets, address_of(records), address_of(made.nodes), most,
                       address_of(made.triangles), address_of(made.ids), address_of(numbers), address_of(work),
                       address_of(stack), n_stack, address_of(counts));
    made.n_nodes = counts[0];
    mesh->depth = mesh->tree[DEPTH] = counts[1];
    mesh->tree[EXPONENT] = (int64_t)numbers[3];
    memcpy(mesh->numbers, numbers, 3 * sizeof *numbers);
    return made;
}

/* Largest coordinates, and a ball around the root's box. */
static void measure(const struct collide_kernels *kernels, collide_mesh *mesh, const int64_t *m, const struct filled *made,
                    int64_t n_facets)
{
    float box[6];
    int64_t k;
    int axis;
    for (k = 0; k < 3 * n_facets; k++) {
        const double *p = made->triangles + 3 * k;
        for (axis = 0; axis < 3; axis++)
            if (fabs(p[axis]) > mesh->numbers[CORNER + axis]) mesh->numbers[CORNER + axis] = fabs(p[axis]);
    }
    for (k = 0; k < 6; k++) memcpy(&box[k], made->nodes + k * m[M_WIDTH], sizeof box[k]);
    mesh->numbers[BALL] = ldexp(kernels->root_of_squares(fabs((double)box[0]) + (double)box[3], fabs((double)box[1]) + (double)box[4],
                                                         fabs((double)box[2]) + (double)box[5]),
                                (int)mesh->tree[EXPONENT]) * (1 + 2.220446049250313e-16 * 4);
}

static void digest(const struct collide_kernels *kernels, collide_mesh *mesh, const struct filled *made, int64_t n_facets)
{
    int64_t memory[DIGEST_WORDS];
    kernels->digest_numbers(0, 0, address_of(made->triangles), 9 * n_facets, address_of(made->ids), n_facets,
                            address_of(memory), address_of(mesh->content));
}

/* Everything that kernels read, in one block, and the slabs that distances need. */
static void keep(const struct collide_kernels *kernels, struct arena *arena, const int64_t *m, collide_mesh *mesh,
                 const struct filled *made, int64_t n_facets)
{
    size_t nodes = (size_t)(m[M_NODE] * made->n_nodes) * 4, slabs = (size_t)(m[M_SLAB] * made->n_nodes) * 4;
    size_t triangles = (size_t)(9 * n_facets) * 8, ids = (size_t)n_facets * 4;
    char *block = cache_lines(nodes + slabs + triangles + ids, &mesh->held);
    void *work = arena_take(arena, (size_t)(5 * made->n_nodes) * 8);
    if (block == NULL || work == NULL) {
        arena->failed = 1;
        return;
    }
    /* Nodes of 224 bytes and slabs of 160 keep what follows on boundaries of doubles. */
    mesh->tree[NODES_AT] = address_of(memcpy(block, made->nodes, nodes));
    mesh->tree[SLABS_AT] = address_of(block + nodes);
    mesh->tree[TRIANGLES_AT] = address_of(memcpy(block + nodes + slabs, made->triangles, triangles));
    mesh->tree[IDS_AT] = address_of(memcpy(block + nodes + slabs + triangles, made->ids, ids));
    mesh->tree[TREE_NUMBERS_AT] = address_of(mesh->numbers);
    mesh->tree[N_NODES] = made->n_nodes;
    mesh->tree[N_FACETS] = n_facets;
    mesh->tree[HAS_ORIGINS] = 0;
    kernels->fill_slabs(address_of(mesh->tree), mesh->tree[SLABS_AT], address_of(work));
}

/* The box around vertices. */
static void box_around(const double *vertices, int64_t n, collide_mesh *mesh)
{
    int64_t k;
    for (k = 0; k < 3 * n; k++) {
        double *low = &mesh->low[k % 3], *high = &mesh->high[k % 3];
        if (k < 3 || vertices[k] < *low) *low = vertices[k];
        if (k < 3 || vertices[k] > *high) *high = vertices[k];
    }
}

/* The tree of facets, and a ball around them; mesh->radius is set. */
static collide_status build_mesh(const struct collide_kernels *kernels, const double *vertices, int64_t n, const int64_t *faces,
                            int64_t n_facets, collide_mesh *mesh)
{
    struct arena arena;
    struct filled made;
    int64_t m[MEASURES];
    box_around(vertices, n, mesh);
    workspace_sizes(kernels, m);
    if (m[M_TREE_INTS] != TREE_INTS || m[M_TREE_NUMBERS] != TREE_NUMBERS) return COLLIDE_NO_KERNELS;
    arena_begin(&arena);
    made = fill(kernels, &arena, m, vertices, n, faces, n_facets, mesh);
    if (!arena.failed) {
        measure(kernels, mesh, m, &made, n_facets);
        digest(kernels, mesh, &made, n_facets);
        mesh->reach = kernels->reach_of_facets(address_of(made.triangles), n_facets, address_of(mesh->numbers + CENTRE));
        keep(kernels, &arena, m, mesh, &made, n_facets);
    }
    arena_end(&arena);
    return arena.failed ? COLLIDE_NO_MEMORY : COLLIDE_OK;
}

void collide_mesh_free(collide_mesh *mesh)
{
    if (!IS_HANDLE(mesh, MESH_WORD)) return;
    end_handle(&mesh->word);
    collide_shape_free(mesh->hull);
    free_topology(mesh->topology);
    free(mesh->corners);
    free(mesh->points);
    free(mesh->held);
    free(mesh);
}

/* --- meshes of facets ----------------------------------------------------------------------------------------------- */

/* The facets, and a point of every part. solid : as asked for. */
static collide_status mesh_of_facets(const double *vertices, int64_t n, const int32_t *faces, int64_t m, int solid,
                                     collide_mesh *mesh)
{
    const struct collide_kernels *kernels = kernels_here();
    collide_status status = COLLIDE_NO_MEMORY;
    struct arena arena;
    int64_t codes[3], measures[MEASURES], *counts, *wide, k;
    int32_t *corners, *flags, *shells, *signs, *ids;
    double *volumes;
    void *memory;
    int encloses;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    codes[0] = code_at(&kernels->first_rows);
    codes[1] = code_at(&kernels->classify_facets);
    codes[2] = code_at(&kernels->judge_shells);
    workspace_sizes(kernels, measures);
    arena_begin(&arena);
    corners = arena_take(&arena, (size_t)(3 * m) * 4);
    flags = arena_take(&arena, (size_t)m * 4);
    shells = arena_take(&arena, (size_t)m * 4);
    signs = arena_take(&arena, (size_t)m * 4);
    ids = arena_take(&arena, (size_t)(n + m) * 4);
    counts = arena_take(&arena, (size_t)measures[M_COUNTS] * 8);
    volumes = arena_take(&arena, (size_t)m * 8);
    wide = arena_take(&arena, (size_t)(3 * m) * 8);
    memory = arena_take(&arena, (size_t)(kernels->survey_memory(n, m) + kernels->shells_memory(n, m, m)));
    if (!arena.failed) {
        encloses = (int)kernels->survey_facets(address_of(codes), address_of(vertices), n, address_of(faces), m,
                                               address_of(corners), address_of(flags), address_of(shells), address_of(counts),
                                               address_of(volumes), address_of(signs), address_of(memory));
        mesh->solid = solid != COLLIDE_SURFACE && encloses;
        mesh->n_points = kernels->one_of_each_part(address_of(corners), address_of(shells), m, n, address_of(ids));
        mesh->points = malloc((size_t)(3 * mesh->n_points + 1) * sizeof *mesh->points);
        mesh->corners = malloc((size_t)(3 * m) * sizeof *corners);
        if (mesh->corners != NULL) memcpy(mesh->corners, corners, (size_t)(3 * m) * sizeof *corners);
        for (k = 0; mesh->points != NULL && k < mesh->n_points; k++)
            memcpy(mesh->points + 3 * k, vertices + 3 * (int64_t)ids[k], 3 * sizeof *vertices);
        for (k = 0; k < 3 * m; k++) wide[k] = faces[k];
        if (solid == COLLIDE_SOLID && !encloses) status = COLLIDE_INVALID_SHAPE;
        else if (mesh->points != NULL && mesh->corners != NULL) status = build_mesh(kernels, vertices, n, wide, m, mesh);
    }
    arena_end(&arena);
    return status;
}

static int are_facets(const double *vertices, size_t n, const int32_t *faces, size_t m)
{
    double largest = 0.0;
    size_t k;
    if (n == 0 || n > (size_t)INT32_MAX || m == 0 || m > MAX_FACETS) return 0;
    for (k = 0; k < 3 * n; k++) {
        if (!(fabs(vertices[k]) <= LARGEST)) return 0;
        if (fabs(vertices[k]) > largest) largest = fabs(vertices[k]);
    }
    for (k = 0; k < 3 * m; k++)
        if (faces[k] < 0 || (size_t)faces[k] >= n) return 0;
    return largest == 0.0 || largest >= SMALLEST;
}

collide_status collide_mesh_create(const double *vertices, size_t n, const int32_t *faces, size_t m, int solid,
                                   collide_mesh **mesh)
{
    collide_mesh *made;
    collide_status status = COLLIDE_INVALID_SHAPE;
    rounding given;
    if (mesh == NULL) return COLLIDE_INVALID_ARGUMENT;
    *mesh = NULL;
    if (vertices == NULL || faces == NULL || solid < COLLIDE_SURFACE || solid > COLLIDE_SOLID_IF_CLOSED)
        return COLLIDE_INVALID_ARGUMENT;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = MESH_WORD;
    made->given = 1;
    given = round_as_kernels_do();
    if (are_facets(vertices, n, faces, m)) status = mesh_of_facets(vertices, (int64_t)n, faces, (int64_t)m, solid, made);
    round_as_before(given);
    if (status == COLLIDE_OK) *mesh = made;
    else collide_mesh_free(made);
    return status;
}

/* --- surfaces of polytopes ------------------------------------------------------------------------------------------ */

/* Whether point a comes before point b: by z, then by y, then by x. */
static int comes_before(const double *a, const double *b)
{
    int axis;
    for (axis = 2; axis >= 0; axis--)
        if (a[axis] != b[axis]) return a[axis] < b[axis];
    return 0;
}

/* Facets of a hull: one side of a flat one, a facet without area of a segment or a point. */
static int64_t facets_of(const struct hull *hull, const double *points, int64_t *faces)
{
    int64_t n_facets = hull->dimension == 3 ? hull->n_facets : hull->n_facets / 2, k;
    int32_t first = hull->vertices[0], last = hull->vertices[0];
    if (hull->dimension >= 2) {
        for (k = 0; k < 3 * n_facets; k++) faces[k] = hull->facets[k];
        return n_facets;
    }
    for (k = 0; k < hull->n_vertices; k++) {
        int32_t vertex = hull->vertices[k];
        if (comes_before(points + 3 * (int64_t)vertex, points + 3 * (int64_t)first)) first = vertex;
        if (comes_before(points + 3 * (int64_t)last, points + 3 * (int64_t)vertex)) last = vertex;
    }
    faces[0] = first;
    faces[1] = faces[2] = last;
    return 1;
}

/* Corners of facets of a hull: of equal points the first. */
static int32_t *corners_of_hull(const struct collide_kernels *kernels, struct arena *arena, const double *points, int64_t n,
                                const int64_t *faces, int64_t n_facets)
{
    int64_t size = 2, k;
    int32_t *table, *first, *corners = malloc((size_t)(3 * n_facets) * sizeof *corners);
    double *same = arena_take(arena, (size_t)(3 * n) * sizeof *same);
    while (size <= n) size *= 2;
    table = arena_take(arena, (size_t)size * sizeof *table);
    first = arena_take(arena, (size_t)n * sizeof *first);
    if (corners == NULL || arena->failed) {
        arena->failed = 1;
        return corners;
    }
    for (k = 0; k < 3 * n; k++) same[k] = points[k] + 0.0; /* minus zero is zero */
    memset(table, -1, (size_t)size * sizeof *table);
    kernels->first_rows(address_of(same), n, address_of(table), size, address_of(first));
    for (k = 0; k < 3 * n_facets; k++) corners[k] = first[faces[k]];
    return corners;
}

static collide_status mesh_of_hull(const collide_shape *shape, collide_mesh *mesh)
{
    const struct collide_kernels *kernels = kernels_here();
    int64_t n = shape->ints[COUNT], n_facets, *faces;
    collide_status status = COLLIDE_NO_MEMORY;
    struct arena arena;
    struct hull hull;
    double *points;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    arena_begin(&arena);
    if ((points = points_of_hull(shape, &arena)) != NULL) {
        hull = hull_of(kernels, &arena, points, n);
        faces = arena_take(&arena, (size_t)(3 * (hull.n_facets + 1)) * 8);
        mesh->points = malloc(3 * sizeof *mesh->points);
        if (!arena.failed && mesh->points != NULL) {
            mesh->solid = hull.dimension == 3;
            mesh->radius = shape->numbers[RADIUS];
            mesh->n_points = 1;
            memcpy(mesh->points, points + 3 * (int64_t)hull.vertices[0], 3 * sizeof *points);
            n_facets = facets_of(&hull, points, faces);
            mesh->corners = corners_of_hull(kernels, &arena, points, n, faces, n_facets);
            if (!arena.failed) status = build_mesh(kernels, points, n, faces, n_facets, mesh);
        }
    }
    arena_end(&arena);
    return status;
}

collide_status collide_mesh_of_shape(const collide_shape *shape, collide_mesh **mesh)
{
    collide_mesh *made;
    collide_status status;
    rounding given;
    if (mesh == NULL) return COLLIDE_INVALID_ARGUMENT;
    *mesh = NULL;
    if (!IS_HANDLE(shape, SHAPE_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if (shape->ints[KIND] != POINTS || shape->numbers[SLOP] != 0.0) return COLLIDE_UNSUPPORTED;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = MESH_WORD;
    given = round_as_kernels_do();
    status = mesh_of_hull(shape, made);
    round_as_before(given);
    if (status == COLLIDE_OK) *mesh = made;
    else collide_mesh_free(made);
    return status;
}

collide_status surface_of(const collide_shape *shape, const collide_mesh **mesh)
{
    collide_shape *kept = (collide_shape *)shape; /* what is made is no part of what the shape is */
    collide_mesh *made = NULL;
    collide_status status;
    *mesh = NULL;
    if (kept->surface == NULL) {
        if ((status = collide_mesh_of_shape(shape, &made)) != COLLIDE_OK) return status;
        if (!PUT_IF_NULL(&kept->surface, made)) collide_mesh_free(made); /* another thread was sooner */
    }
    *mesh = kept->surface;
    return COLLIDE_OK;
}
