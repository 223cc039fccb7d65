/* Terrain as a mesh: the closed surface over heights, triangle by triangle as collide/fields/terrain_surface.py makes it. */
#include "capi_arena.h"
#include "capi_internal.h"

/* Grid points of a field at most, and cells: a mesh holds 2^28 facets. */
static const size_t MAX_HEIGHTS = (size_t)1 << 30, MAX_CELLS = (size_t)1 << 27;

/* Heights (rows, columns), NaN in holes, over lines of x and y, and what becomes of them. */
struct terrain {
    const double *heights;
    size_t rows, columns;
    double *x, *y, lowest, highest, bottom;
    uint8_t *cells; /* of each cell 1, or 0 where a corner is in a hole */
    size_t n_cells;
    double *vertices;
    int32_t *faces;
    size_t n_vertices, n_faces;
};

/* Coordinates of n grid points along an axis, each rounded once. */
static double *grid_line(struct arena *arena, size_t n, double side)
{
    double *line = arena_take(arena, n * sizeof *line);
    size_t k;
    for (k = 0; line != NULL && k < n; k++) line[k] = 0.5 * ((double)(2 * (int64_t)k + 1 - (int64_t)n) * side);
    return line;
}

/* The least and the greatest height; 0 where a height is no number of a body, or all are holes. */
static int measure_heights(struct terrain *field)
{
    size_t k;
    field->lowest = INFINITE;
    field->highest = -INFINITE;
    for (k = 0; k < field->rows * field->columns; k++) {
        double height = field->heights[k];
        if (fabs(height) > LARGEST) return 0;
        field->lowest = height < field->lowest ? height : field->lowest;
        field->highest = height > field->highest ? height : field->highest;
    }
    return field->lowest < INFINITE;
}

/* The bottom that was handed in, or one as far below as heights differ and the longer side together; 0 where it is none. */
static int place_bottom(struct terrain *field, const double *bottom)
{
    double x = field->x[field->columns - 1], y = field->y[field->rows - 1], width = 2.0 * (x > y ? x : y);
    if (!(x <= LARGEST && y <= LARGEST)) return 0;
    field->bottom = bottom != NULL ? *bottom : field->lowest - (field->highest - field->lowest + width);
    return field->bottom < field->lowest && field->bottom >= -LARGEST;
}

/* Which cells have four heights; how many. */
static size_t mark_cells(struct terrain *field)
{
    size_t columns = field->columns, i, j, count = 0;
    for (i = 0; i + 1 < field->rows; i++)
        for (j = 0; j + 1 < columns; j++) {
            const double *corner = field->heights + i * columns + j;
            int is_cell = !isnan(corner[0]) && !isnan(corner[1]) && !isnan(corner[columns]) && !isnan(corner[columns + 1]);
            field->cells[i * (columns - 1) + j] = (uint8_t)is_cell;
            count += (size_t)is_cell;
        }
    return count;
}

static void put_face(struct terrain *field, int32_t a, int32_t b, int32_t c)
{
    int32_t *face = field->faces + 3 * field->n_faces++;
    face[0] = a;
    face[1] = b;
    face[2] = c;
}

static void put_vertex(struct terrain *field, double x, double y, double z)
{
    double *vertex = field->vertices + 3 * field->n_vertices++;
    vertex[0] = x;
    vertex[1] = y;
    vertex[2] = z;
}

/* Two triangles a cell, of the numbers that grid points have. */
static void put_tops(struct terrain *field, const int32_t *at)
{
    size_t columns = field->columns, i, j;
    for (i = 0; i + 1 < field->rows; i++)
        for (j = 0; j + 1 < columns; j++) {
            const int32_t *here = at + i * columns + j;
            if (!field->cells[i * (columns - 1) + j]) continue;
            put_face(field, here[0], here[1], here[columns + 1]);
            put_face(field, here[0], here[columns + 1], here[columns]);
        }
}

/* Two triangles from an edge of the rim down to the edge below, the surface to its left. */
static void put_wall(struct terrain *field, int32_t begin, int32_t end, int32_t below_begin, int32_t below_end)
{
    put_face(field, below_begin, below_end, end);
    put_face(field, below_begin, end, begin);
}

/* The grid points around a rectangle, counter-clockwise from above; how many. */
static size_t list_rim(const struct terrain *field, int32_t *rim)
{
    size_t rows = field->rows, columns = field->columns, n = 0, k;
    for (k = 0; k + 1 < columns; k++) rim[n++] = (int32_t)k;
    for (k = 0; k + 1 < rows; k++) rim[n++] = (int32_t)(k * columns + columns - 1);
    for (k = columns - 1; k > 0; k--) rim[n++] = (int32_t)((rows - 1) * columns + k);
    for (k = rows - 1; k > 0; k--) rim[n++] = (int32_t)(k * columns);
    return n;
}

/* The surface of a rectangle without holes: cells, walls, and the bottom as a fan around its middle. */
static void make_rectangle(struct terrain *field, struct arena *arena)
{
    size_t rows = field->rows, columns = field->columns, n = rows * columns, n_rim = 2 * (rows + columns - 2), k;
    int32_t *at = arena_take(arena, n * sizeof *at), *rim = arena_take(arena, n_rim * sizeof *rim), middle = (int32_t)(n + n_rim);
    field->vertices = arena_take(arena, 3 * (n + n_rim + 1) * sizeof *field->vertices);
    field->faces = arena_take(arena, 3 * (2 * field->n_cells + 3 * n_rim) * sizeof *field->faces);
    if (arena->failed) return;
    list_rim(field, rim);
    for (k = 0; k < n; k++) {
        at[k] = (int32_t)k;
        put_vertex(field, field->x[k % columns], field->y[k / columns], field->heights[k]);
    }
    for (k = 0; k < n_rim; k++)
        put_vertex(field, field->x[(size_t)rim[k] % columns], field->y[(size_t)rim[k] / columns], field->bottom);
    put_vertex(field, 0.5 * field->x[0] + 0.5 * field->x[columns - 1], 0.5 * field->y[0] + 0.5 * field->y[rows - 1], field->bottom);
    put_tops(field, at);
    for (k = 0; k < n_rim; k++) {
        size_t next = k + 1 < n_rim ? k + 1 : 0;
        put_wall(field, rim[k], rim[next], (int32_t)(n + k), (int32_t)(n + next));
    }
    for (k = 0; k < n_rim; k++) put_face(field, middle, (int32_t)(n + (k + 1 < n_rim ? k + 1 : 0)), (int32_t)(n + k));
}

/* Walls along the edges of cells that run one way: from a corner (row, column) of the cell to another, beside a cell where there is
   none. n : how far below the grid points' numbers those of the bottom are. */
static void put_walls(struct terrain *field, const int32_t *at, const size_t from[2], const size_t to[2], const int beside[2], int32_t n)
{
    size_t columns = field->columns, i, j;
    for (i = 0; i + 1 < field->rows; i++)
        for (j = 0; j + 1 < columns; j++) {
            size_t row = i + (size_t)beside[0], column = j + (size_t)beside[1]; /* -1 wraps to what is too large */
            int is_inner = row + 1 < field->rows && column + 1 < columns && row != (size_t)-1 && column != (size_t)-1;
            int32_t begin = at[(i + from[0]) * columns + j + from[1]], end = at[(i + to[0]) * columns + j + to[1]];
            if (!field->cells[i * (columns - 1) + j] || (is_inner && field->cells[row * (columns - 1) + column])) continue;
            put_wall(field, begin, end, begin + n, end + n);
        }
}

/* The surface of cells around holes: each has a bottom of its own, and walls where no cell is beside it. */
static void make_with_holes(struct terrain *field, struct arena *arena)
{
    static const size_t corners[5][2] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}, {0, 0}};
    static const int beside[4][2] = {{-1, 0}, {0, 1}, {1, 0}, {0, -1}};
    size_t columns = field->columns, n_points = field->rows * columns, n = 0, n_tops, i, k;
    int32_t *at = arena_take(arena, n_points * sizeof *at);
    field->faces = arena_take(arena, 3 * 12 * field->n_cells * sizeof *field->faces);
    if (arena->failed) return;
    memset(at, -1, n_points * sizeof *at);
    for (k = 0; k < (field->rows - 1) * (columns - 1); k++)
        for (i = 0; field->cells[k] && i < 4; i++)
            at[(k / (columns - 1) + corners[i][0]) * columns + k % (columns - 1) + corners[i][1]] = 0;
    for (k = 0; k < n_points; k++) n += at[k] == 0;
    if ((field->vertices = arena_take(arena, 6 * n * sizeof *field->vertices)) == NULL) return;
    n = 0;
    for (k = 0; k < n_points; k++) {
        if (at[k] < 0) continue;
        at[k] = (int32_t)n++;
        put_vertex(field, field->x[k % columns], field->y[k / columns], field->heights[k]);
    }
    for (k = 0; k < n; k++) put_vertex(field, field->vertices[3 * k], field->vertices[3 * k + 1], field->bottom);
    put_tops(field, at);
    n_tops = field->n_faces;
    for (k = 0; k < 4; k++) put_walls(field, at, corners[k], corners[k + 1], beside[k], (int32_t)n);
    for (k = 0; k < n_tops; k++) {
        const int32_t *top = field->faces + 3 * k;
        put_face(field, top[2] + (int32_t)n, top[1] + (int32_t)n, top[0] + (int32_t)n);
    }
}

static collide_status make_terrain(struct terrain *field, const double cell[2], const double *bottom, struct arena *arena,
                                   collide_mesh **mesh)
{
    size_t n = (field->rows - 1) * (field->columns - 1);
    if (!measure_heights(field)) return COLLIDE_INVALID_SHAPE;
    field->x = grid_line(arena, field->columns, cell[0]);
    field->y = grid_line(arena, field->rows, cell[1]);
    field->cells = arena_take(arena, n);
    if (arena->failed) return COLLIDE_NO_MEMORY;
    field->n_cells = mark_cells(field);
    if (!place_bottom(field, bottom) || field->n_cells == 0 || field->n_cells >= MAX_CELLS) return COLLIDE_INVALID_SHAPE;
    if (field->n_cells == n) make_rectangle(field, arena);
    else make_with_holes(field, arena);
    if (arena->failed) return COLLIDE_NO_MEMORY;
    return collide_mesh_create(field->vertices, field->n_vertices, field->faces, field->n_faces, COLLIDE_SOLID, mesh);
}

collide_status collide_height_field_create(const double *heights, size_t rows, size_t columns, const double cell[2],
                                           const double *bottom, collide_mesh **mesh)
{
    struct terrain field;
    struct arena arena;
    collide_status status;
    rounding given;
    if (mesh == NULL) return COLLIDE_INVALID_ARGUMENT;
    *mesh = NULL;
    if (heights == NULL || cell == NULL) return COLLIDE_INVALID_ARGUMENT;
    if (rows < 2 || columns < 2 || rows >= MAX_HEIGHTS || columns >= MAX_HEIGHTS || rows * columns >= MAX_HEIGHTS)
        return COLLIDE_INVALID_SHAPE;
    if (!is_length(cell[0]) || !is_length(cell[1]) || (bottom != NULL && !is_coordinate(*bottom))) return COLLIDE_INVALID_SHAPE;
    memset(&field, 0, sizeof field);
    field.heights = heights;
    field.rows = rows;
    field.columns = columns;
    given = round_as_kernels_do();
    arena_begin(&arena);
    status = make_terrain(&field, cell, bottom, &arena, mesh);
    arena_end(&arena);
    round_as_before(given);
    return status;
}
