/* Which vertices make up the nested subsets of a support tree: collide/support/nested_subsets.py. */
#include "capi_tree.h"

#include <string.h>

/* Cells of the curve along each axis. */
enum { CELLS = 1 << 16 };

static int64_t cell_of(double w)
{
    w = (w + 1) * (0.5 * CELLS);
    return (int64_t)(w < 0.0 ? 0.0 : w > CELLS - 1 ? (double)(CELLS - 1) : w);
}

/* How far along the Hilbert curve a direction stands, on an octahedron unfolded to a square. */
static int64_t place_on_curve(const double *direction)
{
    double size = fabs(direction[0]) + fabs(direction[1]) + fabs(direction[2]), x, y, z;
    int64_t column, row, half, place = 0;
    if (!(size > 0.0)) size = 1.0;
    x = direction[0] / size;
    y = direction[1] / size;
    z = direction[2] / size;
    column = cell_of(z < 0.0 ? copysign(1 - fabs(y), x) : x); /* the lower half is folded out over the corners */
    row = cell_of(z < 0.0 ? copysign(1 - fabs(x), y) : y);
    for (half = CELLS / 2; half > 0; half /= 2) {
        int right = (column & half) > 0, upper = (row & half) > 0;
        place = 4 * place + (right ? (upper ? 2 : 3) : upper);
        if (right && !upper) {
            column = CELLS - 1 - column;
            row = CELLS - 1 - row;
        }
        if (!upper) {
            int64_t other = column;
            column = row;
            row = other;
        }
    }
    return place;
}

/* Numbers 0 ... n - 1 by their keys, equal ones in order: lists of two are merged, then of four ... */
static void sort_stably(const int64_t *keys, int64_t n, int64_t *order, int64_t *scratch)
{
    int64_t width, k;
    for (k = 0; k < n; k++) order[k] = k;
    for (width = 1; width < n; width *= 2) {
        for (k = 0; k < n; k += 2 * width) {
            int64_t middle = k + width < n ? k + width : n, end = k + 2 * width < n ? k + 2 * width : n;
            int64_t i = k, j = middle, at = k;
            while (i < middle || j < end)
                scratch[at++] = j == end || (i < middle && keys[order[i]] <= keys[order[j]]) ? order[i++] : order[j++];
        }
        memcpy(order, scratch, (size_t)n * sizeof *order);
    }
}

void order_nested(struct arena *arena, const int32_t *vertices, const double *normals, const uint8_t *late, int64_t n,
                  const int64_t *sizes, int n_sizes, int32_t *ordered)
{
    int64_t *places = arena_take(arena, (size_t)n * 8), *along = arena_take(arena, (size_t)n * 8);
    int64_t *scratch = arena_take(arena, (size_t)n * 8), k, free_ones = 0, n_remaining = n, end = n, at = 0;
    int s;
    if (arena->failed) return;
    for (k = 0; k < n; k++) places[k] = place_on_curve(normals + 3 * k);
    sort_stably(places, n, along, scratch);
    for (s = 0; s < 2; s++)
        for (k = 0; k < n; k++)
            if ((late[along[k]] != 0) == s) scratch[at++] = along[k];
    memcpy(along, scratch, (size_t)n * sizeof *along);
    for (k = 0; k < n; k++) free_ones += !late[k];
    for (s = 1; s < n_sizes; s++) {
        int64_t size = sizes[s], n_taken = 0, n_late = 0;
        double step = (double)(free_ones > size ? free_ones : size) / (double)size;
        end -= n_remaining - size;
        for (k = 0; k < n_remaining; k++) {
            if (n_taken < size && k == (int64_t)(((double)n_taken + 0.5) * step)) scratch[n_taken++] = along[k];
            else ordered[end + n_late++] = vertices[along[k]];
        }
        memcpy(along, scratch, (size_t)size * sizeof *along);
        n_remaining = free_ones = size;
    }
    for (k = 0; k < n_remaining; k++) ordered[k] = vertices[along[k]];
}
