/* Prisms below facets of a height field, as rows of the tables that kernels read. */
#include "host_terrain_task.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The first place of a block that begins a cache line. */
static double *aligned(double *block) { return (double *)(((uintptr_t)block + 63) & ~(uintptr_t)63); }

/* Faces of a prism whose points are three corners, then those below them: the top, the base, the walls. */
static void lay_out_faces(struct terrain_space *own)
{
    static const int64_t top[3] = {0, 1, 2}, base[3] = {3, 5, 4}, base_edges[3] = {5, 4, 3};
    int64_t k, c, at = 0, place;
    for (k = 0; k < 3; k++) {
        own->corners[k] = own->edges[k] = top[k];
        own->corners[3 + k] = base[k];
        own->edges[3 + k] = base_edges[k];
    }
    for (k = 0; k < 3; k++) {
        int64_t next = (k + 1) % 3, *corners = own->corners + 6 + 4 * k, *edges = own->edges + 6 + 4 * k;
        corners[0] = k + 3;
        corners[1] = next + 3;
        corners[2] = next;
        corners[3] = k;
        edges[0] = 3 + k;
        edges[1] = 6 + next;
        edges[2] = k;
        edges[3] = 6 + k;
    }
    for (k = 0; k <= PRISM_FACES; k++) own->starts[k] = k < 2 ? 3 * k : 6 + 4 * (k - 2);
    for (k = 0; k < PRISM_FACES; k++)
        for (c = own->starts[k]; c < own->starts[k + 1]; c++) own->face_of[c] = k;
    for (k = 0; k < PRISM_POINTS; k++) {
        own->ids[k] = k;
        own->fan_starts[k] = at;
        for (place = 0; place < PRISM_CORNERS; place++)
            if (own->corners[place] == k) own->fans[at++] = place;
    }
    own->fan_starts[PRISM_POINTS] = at;
}

struct terrain_space *begin_terrain_space(void)
{
    struct terrain_space *own = calloc(1, sizeof *own);
    if (own != NULL) lay_out_faces(own);
    return own;
}

void free_terrain_space(struct terrain_space *own)
{
    if (own != NULL) free(own->near);
    free(own);
}

/* Exponents below those of a double's lowest bit are as good as its own. */
static int64_t exponent_of_low_bit(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, 8);
    return value == 0.0 ? NO_BITS : (int64_t)(bits >> 52 & 0x7ff) - 1075;
}

void take_body(const struct task *task)
{
    collide_workspace *space = task->space;
    struct manifold_space *manifold = task->manifold;
    const struct terrain_pair *pair = task->pair;
    take_table_pair(space, manifold, pair->ints, pair->numbers, pair->faces, pair->b, pair->b);
    space->ints[INTS + RANK] = 1;
    manifold->shape_of[0] = 0;
    manifold->shape_of[1] = 1;
}

/* Points in `columns`, padded with the first to a multiple of COORDINATES, take the place of the first body. */
static void take_points(const struct task *task, const double *columns, int64_t n, int64_t padded)
{
    int64_t *ints = task->space->ints, lowest = NO_BITS, k;
    double *numbers = task->space->numbers, square = 0.0;
    for (k = 0; k < 3 * padded; k++) {
        int64_t exponent = exponent_of_low_bit(columns[k]);
        if (exponent < lowest) lowest = exponent;
    }
    for (k = 0; k < n; k++) {
        double x = columns[k], y = columns[padded + k], z = columns[2 * padded + k], s = x * x + y * y + z * z;
        if (s > square) square = s;
    }
    memset(ints, 0, INTS * sizeof *ints);
    memset(numbers, 0, NUMBERS * sizeof *numbers);
    ints[KIND] = POINTS;
    ints[COUNT] = n;
    ints[PADDED] = padded;
    ints[ADDRESS] = address_of(columns);
    ints[LOWEST] = lowest;
    numbers[REACH] = sqrt(square) * (1 + 1e-15);
}

static void take_faces(const struct task *task, const double *columns)
{
    struct terrain_space *own = task->own;
    int64_t *faces = task->manifold->faces;
    faces[N_VERTICES] = PRISM_POINTS;
    faces[FACE_PADDED] = COORDINATES;
    faces[N_FACES] = PRISM_FACES;
    faces[FACE_COLUMNS_AT] = address_of(columns);
    faces[VERTEX_IDS_AT] = address_of(own->ids);
    faces[NORMALS_AT] = address_of(own->normals);
    faces[FLATNESS_AT] = address_of(own->flatness);
    faces[TRIANGLES_AT] = address_of(own->triangles);
    faces[STARTS_AT] = address_of(own->starts);
    faces[CORNERS_AT] = address_of(own->corners);
    faces[EDGES_AT] = address_of(own->edges);
    faces[FACE_OF_AT] = address_of(own->face_of);
    faces[FAN_STARTS_AT] = address_of(own->fan_starts);
    faces[FANS_AT] = address_of(own->fans);
}

void take_prism(const struct task *task, const struct terrain_facet *facet)
{
    struct terrain_space *own = task->own;
    double *columns = aligned(own->block);
    int k, axis;
    for (k = 0; k < COORDINATES; k++)
        for (axis = 0; axis < 3; axis++) {
            const double *corner = facet->v[k < PRISM_POINTS ? k % 3 : 0];
            int is_below = axis == 2 && k >= 3 && k < PRISM_POINTS;
            columns[COORDINATES * axis + k] = is_below ? -task->pair->terrain->size[3] : corner[axis];
        }
    take_points(task, columns, PRISM_POINTS, COORDINATES);
    for (k = 0; k < 3; k++) {
        own->normals[k] = facet->n[k];
        own->normals[3 + k] = k == 2 ? -1.0 : 0.0;
        own->normals[6 + 3 * k] = -facet->walls[k][0];
        own->normals[7 + 3 * k] = -facet->walls[k][1];
        own->normals[8 + 3 * k] = 0.0;
    }
    for (k = 0; k < PRISM_FACES; k++) own->flatness[k] = k < 2 ? 0.0 : 1e-15 * task->space->numbers[REACH];
    take_faces(task, columns);
}

/* Corners of facets that are chosen, each once, then the same on the base; how many, 0 where there is no room for them. */
static int64_t put_hull_points(const struct task *task, double *columns)
{
    const struct terrain_space *own = task->own;
    double points[HULL_POINTS][3];
    int64_t n = 0, i, padded, axis;
    size_t k;
    int c;
    for (k = 0; k < own->n_near; k++) {
        const struct terrain_facet *facet = &own->near[k].facet;
        if (!own->near[k].is_in_hull) continue;
        for (c = 0; c < 3; c++) {
            for (i = 0; i < n && memcmp(points[i], facet->v[c], sizeof points[i]) != 0; i++) {}
            if (i < n) continue;
            if (n == HULL_POINTS / 2) return 0;
            memcpy(points[n++], facet->v[c], sizeof points[i]);
        }
    }
    for (i = 0; i < n; i++) {
        memcpy(points[n + i], points[i], sizeof points[i]);
        points[n + i][2] = -task->pair->terrain->size[3];
    }
    n *= 2;
    padded = (n + COORDINATES - 1) / COORDINATES * COORDINATES;
    for (axis = 0; axis < 3; axis++)
        for (i = 0; i < padded; i++) columns[axis * padded + i] = points[i < n ? i : 0][axis];
    return n;
}

int way_out_of_hull(const struct task *task, double n[3])
{
    double *columns = aligned(task->own->hull);
    const double *X_WH = task->pair->X_WH, *X_WB = task->pair->X_WB;
    int64_t count = put_hull_points(task, columns);
    collide_pair row;
    rounding given;
    int64_t status;
    if (count == 0) return 0;
    take_points(task, columns, count, (count + COORDINATES - 1) / COORDINATES * COORDINATES);
    memset(&row, 0, sizeof row);
    given = round_as_kernels_do();
    status = task->space->kernels->answer_poses(address_of(task->space->header), 0, address_of(X_WH), 0, address_of(X_WB), 0, 0, 1, 0, 1,
                                                INFINITE, 1, 0, address_of(&row));
    round_as_before(given);
    if (status != 0 || row.how == COLLIDE_HOW_UNDECIDED || !(row.distance < 0.0)) return 0;
    turn_from_world(X_WH, row.normal, n);
    return 1;
}
