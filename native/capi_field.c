/* Point clouds: their trees (collide/fields/point_tree.py), and which points are near a place (collide/shapes/point_cloud.py). */
#include "capi_field.h"

#include <stdlib.h>

/* Points of a leaf and boxes of a node; the least exponent of a tree's unit; points that links have bits for, numbers of nearest
   points in an answer at most. */
enum { LEAF = 7, WIDTH = 8, LEAST_EXPONENT = -900 };
static const size_t MAX_POINTS = (size_t)1 << 28, MAX_NEAREST = (size_t)1 << 26;
/* Rounds a root of a sum of squares upwards. */
static const double UPWARDS = 1 + 8.881784197001252e-16;

void measure_field(collide_field *field, const double low[3], const double high[3], double radius)
{
    double sum = 0.0;
    int k;
    for (k = 0; k < 3; k++) {
        double corner = fabs(low[k]) > fabs(high[k]) ? fabs(low[k]) : fabs(high[k]);
        field->numbers[CENTRE + k] = 0.5 * low[k] + 0.5 * high[k];
        field->numbers[CORNER + k] = corner;
        field->low[k] = low[k] - radius;
        field->high[k] = high[k] + radius;
        sum += corner * corner;
    }
    field->radius = radius;
    field->reach = sqrt(sum) * UPWARDS + radius;
}

void collide_field_free(collide_field *field)
{
    if (!IS_HANDLE(field, FIELD_WORD)) return;
    end_handle(&field->word);
    free(field->radii);
    free(field->held);
    free(field);
}

/* --- trees of points ------------------------------------------------------------------------------------------------ */

/* Where the nodes of each level begin, and behind them their number: the root, then as many as hold the level below. */
static int64_t first_nodes(int64_t n, int64_t firsts[])
{
    int64_t sizes[32], levels = 0, k;
    for (sizes[0] = (n + LEAF - 1) / LEAF; sizes[levels] > 1; levels++) sizes[levels + 1] = (sizes[levels] + WIDTH - 1) / WIDTH;
    levels++; /* the root holds a single box */
    firsts[0] = 0;
    firsts[1] = 1;
    for (k = 1; k < levels; k++) firsts[k + 1] = firsts[k] + sizes[levels - k];
    return levels;
}

/* Everything that kernels read, in one block. */
static collide_status build_points(const struct collide_kernels *kernels, const double *points, int64_t n, collide_field *cloud)
{
    int64_t m[MEASURES], firsts[34], levels = first_nodes(n, firsts);
    size_t nodes, floats, ids = (size_t)n * 4;
    struct arena arena;
    void *work;
    char *block;
    workspace_sizes(kernels, m);
    nodes = (size_t)(m[M_NODE] * firsts[levels]) * 4;
    floats = (size_t)(3 * WIDTH * ((n + LEAF - 1) / LEAF)) * 4;
    arena_begin(&arena);
    work = arena_take(&arena, (size_t)(m[M_POINT_WORK] * n + m[M_POINT_WORK_BESIDES]) * 8);
    block = cache_lines(nodes + floats + 3 * (size_t)n * 8 + ids, &cloud->held);
    if (work != NULL && block != NULL) {
        /* Nodes of 224 bytes and leaves of 96 keep what follows on boundaries of doubles. */
        cloud->tree[NODES_AT] = address_of(block);
        cloud->tree[SLABS_AT] = address_of(block + nodes);
        cloud->tree[TRIANGLES_AT] = address_of(memcpy(block + nodes + floats, points, 3 * (size_t)n * 8));
        cloud->tree[IDS_AT] = address_of(block + nodes + floats + 3 * (size_t)n * 8);
        cloud->tree[N_NODES] = firsts[levels];
        cloud->tree[DEPTH] = levels;
        kernels->build_point_tree(address_of(cloud->tree), address_of(work), address_of(firsts), levels);
    }
    arena_end(&arena);
    return work != NULL && block != NULL ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

/* The cloud of checked points: a box around them, the tree's unit, the tree. */
static collide_status make_cloud(const double *points, int64_t n, double radius, collide_field *cloud)
{
    const struct collide_kernels *kernels = kernels_here();
    double low[3], high[3], reach = 0.0;
    int64_t k;
    int exponent;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    memcpy(low, points, sizeof low);
    memcpy(high, points, sizeof high);
    for (k = 3; k < 3 * n; k++) {
        if (points[k] < low[k % 3]) low[k % 3] = points[k];
        if (points[k] > high[k % 3]) high[k % 3] = points[k];
    }
    measure_field(cloud, low, high, radius);
    for (k = 0; k < 3; k++) {
        double centre = cloud->numbers[CENTRE + k];
        if (high[k] - centre > reach) reach = high[k] - centre;
        if (centre - low[k] > reach) reach = centre - low[k];
    }
    frexp(reach, &exponent);
    cloud->tree[EXPONENT] = exponent > LEAST_EXPONENT ? exponent : LEAST_EXPONENT;
    cloud->numbers[BALL] = sqrt(3.0) * ldexp(1.0, (int)cloud->tree[EXPONENT]);
    cloud->are = BALLS;
    cloud->tree[TREE_NUMBERS_AT] = address_of(cloud->numbers);
    cloud->tree[N_FACETS] = n;
    return build_points(kernels, points, n, cloud);
}

/* Whether radii are those of balls, 0 or lengths, and the largest of them. */
static int are_radii(const double *radii, size_t n, double *largest)
{
    size_t k;
    *largest = 0.0;
    for (k = 0; k < n; k++) {
        if (!(radii[k] >= 0.0 && radii[k] <= LARGEST) || (radii[k] > 0.0 && radii[k] < SMALLEST)) return 0;
        if (radii[k] > *largest) *largest = radii[k];
    }
    return 1;
}

collide_status collide_point_cloud_create(const double *points, size_t n, const double *radii, size_t n_radii,
                                          collide_field **cloud)
{
    collide_field *made;
    collide_status status = COLLIDE_NO_MEMORY;
    rounding given;
    double largest;
    size_t k;
    int good;
    if (cloud == NULL) return COLLIDE_INVALID_ARGUMENT;
    *cloud = NULL;
    if (points == NULL || radii == NULL || (n_radii != 1 && n_radii != n)) return COLLIDE_INVALID_ARGUMENT;
    if (n == 0 || n >= MAX_POINTS) return COLLIDE_INVALID_SHAPE;
    given = round_as_kernels_do();
    good = are_radii(radii, n_radii, &largest);
    for (k = 0; good && k < 3 * n; k++) good = is_coordinate(points[k]);
    if (!good) status = COLLIDE_INVALID_SHAPE;
    else if ((made = calloc(1, sizeof *made)) != NULL) {
        made->word = FIELD_WORD;
        if (n_radii > 1 && (made->radii = malloc(n * sizeof *radii)) != NULL) memcpy(made->radii, radii, n * sizeof *radii);
        if (n_radii == 1 || made->radii != NULL) status = make_cloud(points, (int64_t)n, largest, made);
        if (status == COLLIDE_OK) *cloud = made;
        else collide_field_free(made);
    }
    round_as_before(given);
    return status;
}

/* --- points near a place -------------------------------------------------------------------------------------------- */

collide_status collide_point_cloud_nearest(const collide_field *cloud, const double *places, size_t n, size_t k,
                                           double max_distance, double *distances, int64_t *rows)
{
    int64_t stack[POINT_STACK];
    size_t i, j, found;
    rounding given;
    if (!IS_HANDLE(cloud, FIELD_WORD) || cloud->are != BALLS || k == 0 || !(max_distance >= 0.0) || n > MAX_NEAREST / k ||
        (n > 0 && (places == NULL || distances == NULL || rows == NULL)))
        return COLLIDE_INVALID_ARGUMENT;
    found = k < (size_t)cloud->tree[N_FACETS] ? k : (size_t)cloud->tree[N_FACETS];
    for (i = 0; i < 3 * n; i++)
        if (!is_coordinate(places[i])) return COLLIDE_INVALID_ARGUMENT;
    given = round_as_kernels_do();
    for (i = 0; i < n; i++) {
        double *squares = distances + k * i;
        kernels_here()->nearest_in_tree(address_of(cloud->tree), address_of(places + 3 * i), 1, (int64_t)found,
                                        max_distance * max_distance, address_of(squares), address_of(rows + k * i),
                                        address_of(stack));
        for (j = 0; j < k; j++) {
            squares[j] = j < found ? sqrt(squares[j]) : INFINITE;
            if (j >= found) rows[k * i + j] = -1;
        }
    }
    round_as_before(given);
    return COLLIDE_OK;
}

static int by_number(const void *one, const void *other)
{
    int64_t a = *(const int64_t *)one, b = *(const int64_t *)other;
    return (a > b) - (a < b);
}

/* Of the points in a box around a place those no farther away than r, ascending, as many as there is room for; returns how many. */
static size_t keep_near(const collide_field *cloud, const double p[3], double r, int64_t *numbers, int64_t n, int64_t *rows,
                        size_t capacity)
{
    const double *points = (const double *)(intptr_t)cloud->tree[TRIANGLES_AT];
    size_t count = 0;
    int64_t k;
    qsort(numbers, (size_t)n, sizeof *numbers, by_number);
    for (k = 0; k < n; k++) {
        const double *q = points + 3 * numbers[k];
        double x = q[0] - p[0], y = q[1] - p[1], z = q[2] - p[2];
        if (!(x * x + y * y + z * z <= r * r)) continue;
        if (count < capacity) rows[count] = numbers[k];
        count++;
    }
    return count;
}

collide_status collide_point_cloud_within(const collide_field *cloud, const double place[3], double r, int64_t *rows,
                                          size_t capacity, size_t *count)
{
    const struct collide_kernels *kernels;
    int64_t stack[POINT_STACK], n, *numbers;
    double low[3], high[3];
    struct arena arena;
    rounding given;
    int k;
    if (count == NULL) return COLLIDE_INVALID_ARGUMENT;
    *count = 0;
    if (!IS_HANDLE(cloud, FIELD_WORD) || cloud->are != BALLS || place == NULL || !(r >= 0.0 && r < INFINITE) || (rows == NULL && capacity > 0))
        return COLLIDE_INVALID_ARGUMENT;
    if (!is_coordinate(place[0]) || !is_coordinate(place[1]) || !is_coordinate(place[2])) return COLLIDE_INVALID_ARGUMENT;
    kernels = kernels_here();
    given = round_as_kernels_do();
    for (k = 0; k < 3; k++) {
        low[k] = place[k] - r * (1.0 + 1e-15);
        high[k] = place[k] + r * (1.0 + 1e-15);
    }
    arena_begin(&arena);
    n = kernels->points_in_box(address_of(cloud->tree), address_of(low), address_of(high), 0, 0, address_of(stack));
    if ((numbers = arena_take(&arena, (size_t)n * sizeof *numbers)) != NULL) {
        kernels->points_in_box(address_of(cloud->tree), address_of(low), address_of(high), address_of(numbers), n,
                               address_of(stack));
        *count = keep_near(cloud, place, r, numbers, n, rows, capacity);
    }
    arena_end(&arena);
    round_as_before(given);
    if (numbers == NULL) return COLLIDE_NO_MEMORY;
    return *count > capacity ? COLLIDE_TOO_MANY : COLLIDE_OK;
}
