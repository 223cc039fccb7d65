/* Makes a support tree from a hull, nested subsets of its vertices and candidate lists between them: `build_support_tree` of
   collide/support/build_support_tree.py, and the tree byte for byte that one. */
#include "capi_tree.h"

#include <stdlib.h>
#include <string.h>

/* As there, with what was measured. */
enum { FINE_RATIO = 24, RATIO = 16, SMALL_HULL = 160, LARGEST_SCAN = 100, HIGHEST_DEGREE = 48, LONGEST_LIST = 384, ATTEMPTS = 6 };
/* A hull of fewer vertices is scanned; fewest entries of a list. */
enum { FEWEST_VERTICES = 32, FEWEST = 8 };
/* Subsets fall by RATIO at least. */
enum { MAX_LEVELS = 16 };

/* Header of a tree, as kernels read it (collide/support/support_tree.py). */
enum {
    T_POINTS, T_DEPTH, T_NODES, T_ENTRIES, T_LINKS, T_AT_NODES, T_AT_ENTRIES, T_AT_LIST_COORDINATES, T_AT_RING_STARTS, T_AT_RING,
    T_AT_RANGE, T_FLAT, T_AT_POINTS, T_HEADER
};

struct support_tree {
    int64_t header[T_HEADER];
    double range[3];
};

/* What is given, and the tree while levels are added to it, coarsest first. */
struct growing {
    const struct collide_kernels *kernels;
    struct arena *arena;
    const double *scaled;
    int64_t n;
    int64_t *place; /* of a vertex in the order */
    int32_t *nodes, *owners, *entries, *rows;
    double *coordinates;
    int64_t n_nodes, n_entries, depth;
    int too_flat; /* so degenerate that no order of neighbours is certain: it is scanned */
};

/* --- levels -------------------------------------------------------------------------------------------------------- */

/* Coordinates of rows of points, list by list: all x, all y, all z. */
static void write_coordinates(const double *points, const int32_t *nodes, int64_t n_nodes, const int32_t *rows, double *out)
{
    int64_t node, i;
    int axis;
    for (node = 0; node < n_nodes; node++) {
        int64_t begin = nodes[node], length = nodes[node + 1] - begin;
        for (axis = 0; axis < 3; axis++)
            for (i = 0; i < length; i++) out[3 * begin + axis * length + i] = points[3 * (int64_t)rows[begin + i] + axis];
    }
}

static void *grown(struct arena *arena, const void *old, int64_t n, int64_t more, size_t size)
{
    void *made = arena_take(arena, (size_t)(n + more) * size);
    if (made != NULL && n > 0) memcpy(made, old, (size_t)n * size);
    return made;
}

/* Lists of rows, of which each entry carries a number: `first` and its place in the order, or the row itself where first < 0.
   Short lists are filled up with their first entry. owners : of the lists; NULL for the first. */
static void add_level(struct growing *tree, const int32_t *starts, const int32_t *rows, int64_t lists, int64_t first,
                      const int32_t *owners)
{
    int64_t total = 0, list, i, at = tree->n_entries;
    for (list = 0; list < lists; list++) {
        int64_t length = starts[list + 1] - starts[list];
        total += length < FEWEST ? FEWEST : length;
    }
    tree->nodes = grown(tree->arena, tree->nodes, tree->n_nodes + 1, lists, 4);
    tree->owners = grown(tree->arena, tree->owners, tree->n_nodes, lists, 4);
    tree->entries = grown(tree->arena, tree->entries, at, total, 4);
    tree->rows = grown(tree->arena, tree->rows, at, total, 4);
    tree->coordinates = grown(tree->arena, tree->coordinates, 3 * at, 3 * total, 8);
    if (tree->arena->failed) return;
    for (list = 0; list < lists; list++) {
        int64_t length = starts[list + 1] - starts[list], filled = length < FEWEST ? FEWEST : length;
        for (i = 0; i < filled; i++, at++) {
            int32_t row = rows[starts[list] + (i < length ? i : 0)];
            tree->rows[at] = row;
            tree->entries[at] = first < 0 ? row : (int32_t)(first + tree->place[row]);
        }
        tree->owners[tree->n_nodes + list] = owners == NULL ? -1 : owners[list];
        tree->nodes[tree->n_nodes + list + 1] = (int32_t)at;
    }
    write_coordinates(tree->scaled, tree->nodes + tree->n_nodes, lists, tree->rows, tree->coordinates);
    tree->n_entries = at;
    tree->n_nodes += lists;
    tree->depth++;
}

/* Candidates of every coarse vertex among the fine ones, as a level of the tree. */
static void add_lists(struct growing *tree, const int32_t *fine, int64_t n_fine, const struct rings *rings, const int32_t *coarse,
                      int64_t n_coarse, int64_t first_node, int64_t first_number)
{
    int64_t capacity = 8 * n_fine + 4 * n_coarse, found, m[MEASURES];
    struct arena own;
    int32_t *starts, *pairs;
    double *scratch;
    workspace_sizes(tree->kernels, m);
    arena_begin(&own, NULL, 0);
    starts = arena_take(&own, (size_t)(n_coarse + 1) * 4);
    for (;;) {
        pairs = arena_take(&own, (size_t)(2 * capacity) * 4);
        scratch = arena_take(&own, (size_t)(tree->n + capacity + 2 * m[M_STACK]) * 8);
        if (own.failed) {
            tree->arena->failed = 1;
            break;
        }
        found = tree->kernels->candidate_lists(
            address_of(tree->scaled), tree->n, address_of(fine), n_fine, address_of(rings->starts), address_of(rings->ring),
            address_of(rings->ring_facets), address_of(rings->normals), rings->n_normals, address_of(tree->nodes),
            address_of(tree->entries), address_of(tree->coordinates), tree->n_nodes, tree->depth, address_of(coarse), n_coarse,
            first_node, address_of(pairs), capacity, address_of(starts), address_of(scratch));
        if (found <= capacity) {
            add_level(tree, starts, pairs, n_coarse, first_number, coarse);
            break;
        }
        capacity = found;
    }
    arena_end(&own);
}

/* Rings of the hull of a subset, whose rows are those of all points. */
static struct rings rings_of_subset(struct growing *tree, const int32_t *fine, int64_t n_fine)
{
    struct rings none = {NULL, NULL, NULL, NULL, 0, NULL, 0, 0};
    double *points = arena_take(tree->arena, (size_t)(3 * n_fine) * 8);
    struct hull hull;
    int64_t k;
    if (tree->arena->failed) return none;
    for (k = 0; k < n_fine; k++) memcpy(points + 3 * k, tree->scaled + 3 * (int64_t)fine[k], 3 * 8);
    hull = hull_of(tree->kernels, tree->arena, points, n_fine);
    if (tree->arena->failed || hull.n_facets < 2 || n_fine < 3) return none;
    for (k = 0; k < 3 * hull.n_facets; k++) hull.facets[k] = fine[hull.facets[k]];
    return rings_of(tree->kernels, tree->arena, tree->scaled, tree->n, hull.facets, hull.n_facets);
}

/* All levels, coarsest first; subset k is the first sizes[k] of the vertices. */
static void add_levels(struct growing *tree, const int32_t *ordered, const int64_t *sizes, int n_sizes, const struct rings *rings)
{
    int32_t whole[2] = {0, 0};
    int64_t first_node = 1, k;
    int level;
    for (k = 0; k < tree->n; k++) tree->place[k] = -1;
    for (k = 0; k < sizes[0]; k++) tree->place[ordered[k]] = k;
    whole[1] = (int32_t)sizes[n_sizes - 1];
    tree->nodes[0] = 0;
    add_level(tree, whole, ordered, 1, n_sizes > 1 ? 1 : -1, NULL);
    for (level = n_sizes - 2; level >= 0 && !tree->arena->failed; level--) {
        int64_t n_coarse = sizes[level + 1];
        struct rings own;
        if (level > 0) {
            own = rings_of_subset(tree, ordered, sizes[level]);
            tree->too_flat = tree->too_flat || !own.good;
            if (tree->arena->failed || tree->too_flat) return;
        }
        add_lists(tree, ordered, sizes[level], level > 0 ? &own : rings, ordered, n_coarse, first_node,
                  level > 0 ? first_node + n_coarse : -1);
        first_node += n_coarse;
    }
}

/* Whether kernels stay inside the arrays and come to an end, as `SupportTree` requires. */
static int is_sound(const struct growing *tree, const struct rings *rings)
{
    int64_t first = 0, end = 1, level, k, links = rings->starts[tree->n];
    for (k = 0; k < links; k++)
        if (rings->starts[rings->ring[k] + 1] == rings->starts[rings->ring[k]]) return 0;
    for (level = 0; level + 1 < tree->depth; level++) {
        int64_t least = INT64_MAX, most = -1;
        if (end >= tree->n_nodes + 1) return 0;
        for (k = tree->nodes[first]; k < tree->nodes[end]; k++) {
            if (tree->entries[k] < least) least = tree->entries[k];
            if (tree->entries[k] > most) most = tree->entries[k];
        }
        if (least != end || most >= tree->n_nodes) return 0;
        first = end;
        end = most + 1;
    }
    if (end != tree->n_nodes) return 0;
    for (k = 0; k < tree->n_entries; k++)
        if (rings->starts[tree->rows[k] + 1] == rings->starts[tree->rows[k]]) return 0;
    return 1;
}

/* Mark the owners of long lists as late; whether there are any. */
static int mark_long(const struct growing *tree, const int32_t *vertices, int64_t n, uint8_t *late)
{
    int64_t node, k;
    int any = 0;
    uint8_t *long_ones = arena_take(tree->arena, (size_t)tree->n);
    if (long_ones == NULL) return 0;
    memset(long_ones, 0, (size_t)tree->n);
    for (node = 1; node < tree->n_nodes; node++)
        if (tree->nodes[node + 1] - tree->nodes[node] > LONGEST_LIST) {
            long_ones[tree->owners[node]] = 1;
            any = 1;
        }
    for (k = 0; k < n; k++) late[k] = late[k] || long_ones[vertices[k]];
    return any;
}

/* --- the tree ------------------------------------------------------------------------------------------------------ */

/* Coordinates times powers of two that make the vertices fill a cube: normals of pancakes and needles are then good. */
static double *scaled_points(struct arena *arena, const double *points, int64_t n, const int32_t *vertices, int64_t n_vertices)
{
    double *scaled = arena_take(arena, (size_t)(3 * n) * 8);
    int axis;
    int64_t k;
    if (scaled == NULL) return NULL;
    for (axis = 0; axis < 3; axis++) {
        double low = points[3 * (int64_t)vertices[0] + axis], high = low;
        int exponent;
        for (k = 1; k < n_vertices; k++) {
            double value = points[3 * (int64_t)vertices[k] + axis];
            if (value < low) low = value;
            if (value > high) high = value;
        }
        frexp(high - low > 0.0 ? high - low : 1.0, &exponent);
        for (k = 0; k < n; k++) scaled[3 * k + axis] = ldexp(points[3 * k + axis], -exponent);
    }
    return scaled;
}

/* A direction in which each of the vertices is extreme: the sum of its facets' unit normals. */
static double *vertex_normals(struct arena *arena, const struct rings *rings, int64_t n, const int32_t *vertices,
                              int64_t n_vertices)
{
    int64_t links = rings->starts[n], k;
    double *sums = arena_take(arena, (size_t)(3 * links + 3) * 8), *normals = arena_take(arena, (size_t)(3 * n_vertices) * 8);
    int axis;
    if (arena->failed) return NULL;
    for (axis = 0; axis < 3; axis++) {
        sums[axis] = 0.0;
        for (k = 0; k < links; k++) {
            double part = rings->normals[3 * (int64_t)rings->ring_facets[k] + axis];
            sums[3 * k + 3 + axis] = k == 0 ? part : sums[3 * k + axis] + part;
        }
        for (k = 0; k < n_vertices; k++)
            normals[3 * k + axis] = sums[3 * (int64_t)rings->starts[vertices[k] + 1] + axis] -
                                    sums[3 * (int64_t)rings->starts[vertices[k]] + axis];
    }
    return normals;
}

static int subset_sizes(int64_t n, int64_t sizes[MAX_LEVELS])
{
    int n_sizes = 1;
    sizes[0] = n;
    while (n_sizes < MAX_LEVELS && sizes[n_sizes - 1] > (n_sizes == 1 ? SMALL_HULL : LARGEST_SCAN)) {
        int64_t ratio = n_sizes == 1 ? FINE_RATIO : RATIO;
        sizes[n_sizes] = (sizes[n_sizes - 1] + ratio - 1) / ratio;
        n_sizes++;
    }
    return n_sizes;
}

/* Lowest and highest power of two of the coordinates bound directions that are settled exactly (`exact_range`). */
static void write_range(const double *points, int64_t n, int64_t lowest, double range[3])
{
    double largest = 0.0;
    int64_t k, least, most;
    int highest;
    for (k = 0; k < 3 * n; k++)
        if (fabs(points[k]) > largest) largest = fabs(points[k]);
    frexp(largest, &highest);
    least = -1020 - lowest > -1020 ? -1020 - lowest : -1020;
    most = 960 - highest < 900 ? 960 - highest : 900;
    range[0] = ldexp(1.0, (int)(least < 1020 ? least : 1020));
    range[1] = ldexp(1.0, (int)most);
    range[2] = (double)(most - 1);
}

static int64_t put(unsigned char **at, const void *bytes, int64_t n)
{
    int64_t address = address_of(*at);
    memcpy(*at, bytes, (size_t)n);
    *at += (n + 7) / 8 * 8;
    return address;
}

/* One block of memory that holds the tree. */
static struct support_tree *kept(const struct growing *tree, const struct rings *rings, const double *points, int64_t lowest)
{
    int64_t links = rings->starts[tree->n], bytes = 28 * tree->n_entries + 4 * (tree->n_nodes + tree->n + links);
    struct support_tree *made = malloc(sizeof *made + (size_t)bytes + 64);
    unsigned char *at = (unsigned char *)(made + 1);
    int64_t *header;
    if (made == NULL) return NULL;
    header = made->header;
    header[T_POINTS] = tree->n;
    header[T_DEPTH] = tree->depth;
    header[T_NODES] = tree->n_nodes;
    header[T_ENTRIES] = tree->n_entries;
    header[T_LINKS] = links;
    header[T_FLAT] = rings->flat;
    header[T_AT_POINTS] = address_of(points);
    header[T_AT_RANGE] = address_of(made->range);
    header[T_AT_LIST_COORDINATES] = put(&at, tree->coordinates, 24 * tree->n_entries);
    write_coordinates(points, tree->nodes, tree->n_nodes, tree->rows, (double *)(made + 1));
    header[T_AT_NODES] = put(&at, tree->nodes, 4 * tree->n_nodes + 4);
    header[T_AT_ENTRIES] = put(&at, tree->entries, 4 * tree->n_entries);
    header[T_AT_RING_STARTS] = put(&at, rings->starts, 4 * tree->n + 4);
    header[T_AT_RING] = put(&at, rings->ring, 4 * links);
    write_range(points, tree->n, lowest, made->range);
    return made;
}

/* Vertices that are corners, where there are enough; which of all come late. Returns how many, 0 where one has no facets. */
static int64_t choose_vertices(const struct rings *rings, int32_t *vertices, int64_t n_vertices, uint8_t *late)
{
    int64_t k, corners = 0, n_used = 0;
    for (k = 0; k < n_vertices; k++) {
        if (rings->starts[vertices[k] + 1] == rings->starts[vertices[k]]) return 0;
        corners += rings->corner[vertices[k]];
    }
    for (k = 0; k < n_vertices; k++) {
        int32_t vertex = vertices[k];
        if (corners >= 3 && !rings->corner[vertex]) continue;
        late[n_used] = rings->starts[vertex + 1] - rings->starts[vertex] > HIGHEST_DEGREE;
        vertices[n_used++] = vertex;
    }
    return n_used;
}

static void build(struct growing *tree, const double *points, struct hull *hull, int64_t lowest, struct support_tree **out)
{
    struct arena *arena = tree->arena;
    struct rings rings;
    uint8_t *late = arena_take(arena, (size_t)hull->n_vertices);
    int64_t sizes[MAX_LEVELS], n_vertices;
    double *normals;
    int32_t *ordered;
    int attempt, n_sizes;
    tree->scaled = scaled_points(arena, points, tree->n, hull->vertices, hull->n_vertices);
    tree->place = arena_take(arena, (size_t)tree->n * 8);
    if (arena->failed) return;
    rings = rings_of(tree->kernels, arena, tree->scaled, tree->n, hull->facets, hull->n_facets);
    if (arena->failed || !rings.good) return;
    if ((n_vertices = choose_vertices(&rings, hull->vertices, hull->n_vertices, late)) == 0) return;
    normals = vertex_normals(arena, &rings, tree->n, hull->vertices, n_vertices);
    n_sizes = subset_sizes(n_vertices, sizes);
    ordered = arena_take(arena, (size_t)n_vertices * 4);
    for (attempt = 0; attempt < ATTEMPTS && !arena->failed; attempt++) {
        struct mark mark = arena_mark(arena);
        int again;
        order_nested(arena, hull->vertices, normals, late, n_vertices, sizes, n_sizes, ordered);
        tree->nodes = arena_take(arena, 4);
        tree->n_nodes = tree->n_entries = tree->depth = 0;
        if (!arena->failed) add_levels(tree, ordered, sizes, n_sizes, &rings);
        if (arena->failed || tree->too_flat || !is_sound(tree, &rings)) return;
        again = mark_long(tree, hull->vertices, n_vertices, late);
        if (arena->failed) return;
        if (!again || attempt == ATTEMPTS - 1) {
            if ((*out = kept(tree, &rings, points, lowest)) == NULL) arena->failed = 1;
            return;
        }
        arena_return(arena, mark);
    }
}

collide_status build_tree(const struct collide_kernels *kernels, const double *points, size_t n, int64_t lowest,
                          struct support_tree **tree)
{
    struct arena arena;
    struct growing growing;
    struct hull hull;
    collide_status status;
    *tree = NULL;
    arena_begin(&arena, NULL, 0);
    memset(&growing, 0, sizeof growing);
    growing.kernels = kernels;
    growing.arena = &arena;
    growing.n = (int64_t)n;
    hull = hull_of(kernels, &arena, points, growing.n);
    if (!arena.failed && hull.dimension >= 2 && hull.n_vertices >= FEWEST_VERTICES) build(&growing, points, &hull, lowest, tree);
    status = arena.failed ? COLLIDE_NO_MEMORY : COLLIDE_OK;
    arena_end(&arena);
    return status;
}

int64_t tree_address(const struct support_tree *tree) { return address_of(tree->header); }

void free_tree(struct support_tree *tree) { free(tree); }
