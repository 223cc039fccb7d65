/* Shapes from numbers: what collide/shapes checks and collide/lowering/packed_convex.py lays out. */
#include "capi_faces.h"
#include "capi_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* As many points have a few that stand for all; from as many on there is a support tree. */
enum { FEWEST_COARSE = 64, FEWEST_FOR_TREE = 224 };
/* Rounds a root of a sum of squares upwards: it is good to 4 units in the last place. */
static const double UPWARDS = 1 + 1e-15;

/* Digest of kind, radius and parameters, then of the points; -0.0 and 0.0 are one number among these. */
static void digest(collide_shape *shape, const double *points, size_t n)
{
    int64_t memory[DIGEST_WORDS];
    double head[6];
    head[0] = (double)shape->ints[KIND];
    head[1] = shape->numbers[RADIUS];
    memcpy(head + 2, shape->numbers + PARAMS, 4 * sizeof *head);
    kernels_here()->digest_numbers(address_of(head), 6, address_of(points), (int64_t)(3 * n), 0, 0, address_of(memory),
                                   address_of(shape->content));
}

/* Coordinates axis by axis, filled up with the first point, then coarse points. */
static collide_status lay_out(collide_shape *shape, const double *points, size_t n)
{
    size_t padded = (n + COORDINATES - 1) / COORDINATES * COORDINATES;
    const struct collide_kernels *kernels = kernels_here();
    int64_t measures[MEASURES];
    double *block;
    measures[M_COARSE] = 0;
    if (kernels == NULL || (n >= FEWEST_COARSE && !workspace_sizes(kernels, measures))) return COLLIDE_NO_KERNELS;
    block = cache_lines((3 * padded + 4 * (size_t)measures[M_COARSE]) * sizeof *block, &shape->block);
    if (block == NULL) return COLLIDE_NO_MEMORY;
    shape->ints[COUNT] = (int64_t)n;
    shape->ints[PADDED] = (int64_t)padded;
    shape->ints[ADDRESS] = address_of(block);
    shape->ints[LOWEST] = kernels->lay_out_points(address_of(points), (int64_t)n, address_of(block), (int64_t)padded,
                                                  address_of(&shape->numbers[REACH]));
    if (n < FEWEST_COARSE) return COLLIDE_OK;
    shape->ints[COARSE_AT] = address_of(block + 3 * padded);
    kernels->choose_coarse(address_of(points), (int64_t)n, shape->ints[COARSE_AT]);
    return COLLIDE_OK;
}

static collide_status build_support_tree(collide_shape *shape, size_t n)
{
    const struct collide_kernels *kernels = kernels_here();
    collide_status status;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    status = build_tree(kernels, shape->points, n, &shape->tree);
    shape->ints[TREE] = address_of(shape->tree);
    return status;
}

/* The same where the processor rounds as kernels want it. */
static collide_status made_of_points(collide_shape *shape, const double *points, size_t n, int may_have_tree)
{
    collide_status status = lay_out(shape, points, n);
    if (status != COLLIDE_OK) return status;
    digest(shape, points, n);
    if (!may_have_tree || n < FEWEST_FOR_TREE) return COLLIDE_OK;
    if ((shape->points = malloc(3 * n * sizeof *points)) == NULL) return COLLIDE_NO_MEMORY;
    memcpy(shape->points, points, 3 * n * sizeof *points);
    return build_support_tree(shape, n);
}

/* The hull of n points as given, swept; slop : how far stored points may be from those meant. */
static collide_status shape_of_points(const double *points, size_t n, double radius, double slop, int may_have_tree,
                                      collide_shape **out)
{
    collide_shape *shape = calloc(1, sizeof *shape);
    collide_status status;
    rounding given;
    if (shape == NULL) return COLLIDE_NO_MEMORY;
    shape->word = SHAPE_WORD;
    shape->ints[KIND] = POINTS;
    shape->numbers[RADIUS] = radius;
    shape->numbers[SLOP] = slop;
    given = round_as_kernels_do();
    status = made_of_points(shape, points, n, may_have_tree);
    round_as_before(given);
    if (status == COLLIDE_OK) *out = shape;
    else collide_shape_free(shape);
    return status;
}

static collide_status shape_of_numbers(int kind, const double *params, size_t n, double reach, collide_shape **out)
{
    collide_shape *shape;
    if (kernels_here() == NULL) return COLLIDE_NO_KERNELS;
    if ((shape = calloc(1, sizeof *shape)) == NULL) return COLLIDE_NO_MEMORY;
    shape->word = SHAPE_WORD;
    shape->ints[KIND] = kind;
    shape->ints[LOWEST] = NO_BITS;
    shape->numbers[REACH] = reach;
    memcpy(shape->numbers + PARAMS, params, n * sizeof *params);
    digest(shape, NULL, 0);
    *out = shape;
    return COLLIDE_OK;
}

void collide_shape_free(collide_shape *shape)
{
    if (!IS_HANDLE(shape, SHAPE_WORD)) return;
    end_handle(&shape->word);
    free(shape->tree);
    free_faces(shape->faces);
    collide_mesh_free(shape->surface);
    free(shape->points);
    free(shape->block);
    free(shape);
}

collide_status collide_sphere(double radius, collide_shape **shape)
{
    static const double centre[3] = {0.0, 0.0, 0.0};
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (!is_length(radius)) return COLLIDE_INVALID_SHAPE;
    return shape_of_points(centre, 1, radius, 0.0, 0, shape);
}

collide_status collide_box(const double size[3], collide_shape **shape)
{
    double corners[24];
    collide_status status;
    int k;
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (size == NULL) return COLLIDE_INVALID_ARGUMENT;
    for (k = 0; k < 3; k++) if (!(size[k] == 0.0 || is_length(size[k]))) return COLLIDE_INVALID_SHAPE;
    for (k = 0; k < 24; k++) {
        double half = 0.5 * size[k % 3];
        corners[k] = k / 3 >> (2 - k % 3) & 1 ? half : 0.0 - half; /* no minus zero of flat boxes */
    }
    status = shape_of_points(corners, 8, 0.0, 0.0, 0, shape);
    for (k = 0; status == COLLIDE_OK && k < 3; k++) (*shape)->numbers[PARAMS + k] = 0.5 * size[k]; /* no part of the digest */
    return status;
}

collide_status collide_capsule(double radius, double length, collide_shape **shape)
{
    double ends[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (!is_length(radius) || !(length == 0.0 || is_length(length))) return COLLIDE_INVALID_SHAPE;
    ends[2] = 0.0 - 0.5 * length; /* no minus zero of a ball */
    ends[5] = 0.5 * length;
    return shape_of_points(ends, length > 0.0 ? 2 : 1, radius, 0.0, 0, shape);
}

static collide_status round_shape(int kind, double radius, double length, collide_shape **shape)
{
    double params[2];
    rounding given;
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (!is_length(radius) || !is_length(length)) return COLLIDE_INVALID_SHAPE;
    if (kernels_here() == NULL) return COLLIDE_NO_KERNELS;
    given = round_as_kernels_do();
    params[0] = radius;
    params[1] = 0.5 * length;
    length = kernels_here()->root_of_squares(params[0], params[1], 0.0) * UPWARDS;
    round_as_before(given);
    return shape_of_numbers(kind, params, 2, length, shape);
}

collide_status collide_cylinder(double radius, double length, collide_shape **shape)
{
    return round_shape(CYLINDER, radius, length, shape);
}

collide_status collide_cone(double radius, double length, collide_shape **shape)
{
    return round_shape(CONE, radius, length, shape);
}

collide_status collide_ellipsoid(const double radii[3], collide_shape **shape)
{
    double largest = 0.0;
    int k;
    rounding given;
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (radii == NULL) return COLLIDE_INVALID_ARGUMENT;
    for (k = 0; k < 3; k++) {
        if (!is_length(radii[k])) return COLLIDE_INVALID_SHAPE;
        if (radii[k] > largest) largest = radii[k];
    }
    given = round_as_kernels_do();
    largest *= UPWARDS;
    round_as_before(given);
    return shape_of_numbers(ELLIPSOID, radii, 3, largest, shape);
}

collide_status collide_halfspace(const double normal[3], double offset, collide_shape **shape)
{
    double params[4], length;
    rounding given;
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (normal == NULL) return COLLIDE_INVALID_ARGUMENT;
    if (!is_coordinate(normal[0]) || !is_coordinate(normal[1]) || !is_coordinate(normal[2])) return COLLIDE_INVALID_SHAPE;
    given = round_as_kernels_do();
    length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    round_as_before(given);
    if (!(length >= 1e-6 && length <= 1e6) || !is_coordinate(offset)) return COLLIDE_INVALID_SHAPE;
    memcpy(params, normal, 3 * sizeof *params);
    params[3] = offset;
    return shape_of_numbers(HALFSPACE, params, 4, 0.0, shape);
}

/* Whether n points are finite, not too large, and not all too small. */
static int are_points(const double *points, size_t n)
{
    double largest = 0.0;
    size_t k;
    for (k = 0; k < 3 * n; k++) {
        if (!is_coordinate(points[k])) return 0;
        if (fabs(points[k]) > largest) largest = fabs(points[k]);
    }
    return largest == 0.0 || largest >= SMALLEST;
}

collide_status collide_hull(const double *points, size_t n, double radius, collide_shape **shape)
{
    int good;
    rounding given;
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (points == NULL) return COLLIDE_INVALID_ARGUMENT;
    given = round_as_kernels_do();
    good = n > 0 && n < (size_t)1 << 26 && (radius == 0.0 || is_length(radius)) && are_points(points, n);
    round_as_before(given);
    if (!good) return COLLIDE_INVALID_SHAPE;
    return shape_of_points(points, n, radius == 0.0 ? 0.0 : radius, 0.0, 1, shape);
}

/* Whether numbers make a curved set, or a half-space, of this kind. */
static int are_params(int64_t kind, const double *params)
{
    int k, n = kind == ELLIPSOID ? 3 : 2;
    if (kind == HALFSPACE) {
        double length = sqrt(params[0] * params[0] + params[1] * params[1] + params[2] * params[2]);
        return length >= 1e-6 && length <= 1e6 && is_coordinate(params[3]);
    }
    for (k = 0; k < n; k++) if (!is_length(params[k])) return 0;
    return kind == CYLINDER || kind == CONE || kind == ELLIPSOID;
}

collide_status shape_of_row(int64_t kind, const double *numbers, const double *points, size_t n, int may_have_tree,
                            collide_shape **shape)
{
    collide_status status = COLLIDE_INVALID_SHAPE;
    int k, is_good = 1;
    rounding given = round_as_kernels_do();
    *shape = NULL;
    for (k = 0; k < NUMBERS; k++) is_good = is_good && is_coordinate(numbers[k]) && (k >= PARAMS || numbers[k] >= 0.0);
    if (kind == POINTS) is_good = is_good && n > 0 && n < (size_t)1 << 26 && are_points(points, n);
    else is_good = is_good && n == 0 && are_params(kind, numbers + PARAMS);
    round_as_before(given);
    if (!is_good) return status;
    if (kind == POINTS) status = shape_of_points(points, n, numbers[RADIUS], numbers[SLOP], may_have_tree, shape);
    else status = shape_of_numbers((int)kind, numbers + PARAMS, NUMBERS - PARAMS, numbers[REACH], shape);
    for (k = 0; status == COLLIDE_OK && k < NUMBERS; k++) if (k != REACH) (*shape)->numbers[k] = numbers[k];
    return status;
}

/* The corners of m half-spaces, by collide/hull/double_description.py, in memory that grows with the rays it takes. */
static collide_status shape_of_halfspaces(const double *normals, const double *offsets, int64_t m, collide_shape **shape)
{
    enum { TOO_FEW_RAYS = -2 };
    const struct collide_kernels *kernels = kernels_here();
    int64_t normals_at = address_of(normals), offsets_at = address_of(offsets), capacity = 128, n = TOO_FEW_RAYS, k = 0;
    collide_status status = COLLIDE_INVALID_SHAPE;
    struct arena arena;
    double *corners = NULL, slop = 0.0;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    arena_begin(&arena);
    while (n == TOO_FEW_RAYS && !arena.failed) {
        void *memory = arena_take(&arena, (size_t)kernels->corners_memory(normals_at, offsets_at, m, capacity *= 2));
        corners = arena_take(&arena, (size_t)(3 * capacity) * sizeof *corners);
        if (!arena.failed)
            n = kernels->find_corners(normals_at, offsets_at, m, address_of(memory), capacity, address_of(corners),
                                      address_of(&slop));
    }
    while (k < 3 * n && is_coordinate(corners[k])) k++;
    if (arena.failed) status = COLLIDE_NO_MEMORY;
    else if (n > 0 && k == 3 * n) status = shape_of_points(corners, (size_t)n, 0.0, slop, 0, shape);
    arena_end(&arena);
    return status;
}

collide_status collide_hpolytope(const double *normals, const double *offsets, size_t m, collide_shape **shape)
{
    collide_status status;
    size_t k;
    rounding given;
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (normals == NULL || offsets == NULL) return COLLIDE_INVALID_ARGUMENT;
    if (m == 0 || m > (size_t)1 << 20) return COLLIDE_INVALID_SHAPE;
    given = round_as_kernels_do();
    for (k = 0; k < m; k++) {
        const double *n = normals + 3 * k;
        if (!is_coordinate(n[0]) || !is_coordinate(n[1]) || !is_coordinate(n[2]) || !is_coordinate(offsets[k]) ||
            (n[0] == 0.0 && n[1] == 0.0 && n[2] == 0.0))
            break;
    }
    status = k < m ? COLLIDE_INVALID_SHAPE : shape_of_halfspaces(normals, offsets, (int64_t)m, shape);
    round_as_before(given);
    return status;
}

/* --- sets ---------------------------------------------------------------------------------------------------------- */

struct placed {
    const collide_shape *shape;
    size_t number;
};

static int by_content(const void *one, const void *other)
{
    return memcmp(((const struct placed *)one)->shape->content, ((const struct placed *)other)->shape->content,
                  sizeof ((const struct placed *)one)->shape->content);
}

/* Rows of shapes with ranks by content: equal shapes have one rank. */
static void fill_set(collide_shape_set *set, struct placed *order)
{
    size_t k;
    int64_t rank = 0;
    for (k = 0; k < set->count; k++) {
        memcpy(set->ints + INTS * k, set->shapes[k]->ints, sizeof set->shapes[k]->ints);
        memcpy(set->numbers + NUMBERS * k, set->shapes[k]->numbers, sizeof set->shapes[k]->numbers);
        order[k].shape = set->shapes[k];
        order[k].number = k;
    }
    qsort(order, set->count, sizeof *order, by_content);
    for (k = 0; k < set->count; k++) {
        if (k > 0 && by_content(&order[k - 1], &order[k]) != 0) rank++;
        set->ints[INTS * order[k].number + RANK] = rank;
    }
}

collide_status collide_shape_set_create(const collide_shape *const *shapes, size_t n, collide_shape_set **set)
{
    collide_shape_set *made;
    struct placed *order;
    size_t k;
    if (set == NULL) return COLLIDE_INVALID_ARGUMENT;
    *set = NULL;
    if (shapes == NULL || n == 0 || n > (size_t)1 << 40 || n > (size_t)-1 / 64) return COLLIDE_INVALID_ARGUMENT;
    for (k = 0; k < n; k++)
        if (!IS_HANDLE(shapes[k], SHAPE_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = SET_WORD;
    order = malloc(n * sizeof *order);
    made->count = n;
    made->ints = malloc(n * INTS * sizeof *made->ints);
    made->numbers = malloc(n * NUMBERS * sizeof *made->numbers);
    made->shapes = malloc(n * sizeof *made->shapes);
    if (order == NULL || made->ints == NULL || made->numbers == NULL || made->shapes == NULL) {
        free(order);
        collide_shape_set_free(made);
        return COLLIDE_NO_MEMORY;
    }
    memcpy(made->shapes, shapes, n * sizeof *made->shapes);
    fill_set(made, order);
    free(order);
    *set = made;
    return COLLIDE_OK;
}

void collide_shape_set_free(collide_shape_set *set)
{
    if (!IS_HANDLE(set, SET_WORD)) return;
    end_handle(&set->word);
    free(set->ints);
    free(set->numbers);
    free((void *)set->shapes);
    free(set);
}
