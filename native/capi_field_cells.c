/* Grids of occupied cells: their trees, as collide/fields/cell_tree.py makes them of arrays. */
#include "capi_field.h"

#include <stdlib.h>

/* Cells along an axis and in all, free or not; children of a node along an axis. */
static const size_t MAX_ALONG = 1 << 16, MAX_NUMBER = ((size_t)1 << 31) - 1;
enum { SIDE = 4, MAX_LEVELS = 8 };
/* Rounds a root of a sum of squares upwards. */
static const double UPWARDS = 1 + 8.881784197001252e-16;

/* Nodes of a level by key, and the bits of their children. */
struct run {
    int64_t *keys, *bits, n;
};

static int64_t count_bits(int64_t word)
{
    uint64_t remaining = (uint64_t)word;
    int64_t count = 0;
    for (; remaining != 0; remaining &= remaining - 1) count++;
    return count;
}

static int64_t levels_of(const int64_t along[3])
{
    int64_t most = along[0] > along[1] ? along[0] : along[1], levels = 1;
    if (along[2] > most) most = along[2];
    while ((int64_t)1 << 2 * levels < most) levels++;
    return levels;
}

/* The nodes of level 0 of an array of 0 and 1. */
static struct run finest(const struct collide_kernels *kernels, struct arena *arena, const uint8_t *occupied,
                         const int64_t along[3], int64_t levels)
{
    struct run run = {NULL, NULL, 0};
    size_t n = 1;
    int k;
    for (k = 0; k < 3; k++) n *= (size_t)(along[k] + SIDE - 1) / SIDE;
    run.keys = arena_take(arena, n * sizeof *run.keys);
    run.bits = arena_take(arena, n * sizeof *run.bits);
    if (!arena->failed)
        run.n = kernels->pack_cells(address_of(occupied), along[0], along[1], along[2], levels, address_of(run.keys),
                                    address_of(run.bits));
    return run;
}

/* The nodes above those of a level: six bits of a key number the child. */
static struct run parents_of(struct arena *arena, const struct run *below)
{
    struct run run = {NULL, NULL, 0};
    int64_t k;
    run.keys = arena_take(arena, (size_t)below->n * sizeof *run.keys);
    run.bits = arena_take(arena, (size_t)below->n * sizeof *run.bits);
    for (k = 0; !arena->failed && k < below->n; k++) {
        int64_t parent = below->keys[k] >> 6;
        if (run.n == 0 || run.keys[run.n - 1] != parent) {
            run.keys[run.n] = parent;
            run.bits[run.n++] = 0;
        }
        run.bits[run.n - 1] |= (int64_t)((uint64_t)1 << (below->keys[k] & 63));
    }
    return run;
}

/* The words of all nodes, the coarsest level first, in one block: bits, no solid bits, first children. */
static int keep_cells(collide_field *grid, const struct run *runs, int64_t levels)
{
    int64_t n_all = 0, n_inner, level, k, next = 1, *words;
    for (level = 0; level < levels; level++) n_all += runs[level].n;
    n_inner = n_all - runs[0].n;
    if ((words = cache_lines((size_t)(n_all + 2 * n_inner) * sizeof *words, &grid->held)) == NULL) return 0;
    grid->tree[BITS_AT] = address_of(words);
    grid->tree[SOLID_AT] = address_of(words + n_all);
    grid->tree[FIRST_AT] = address_of(words + n_all + n_inner);
    grid->tree[N_INNER] = n_inner;
    grid->tree[N_ALL] = n_all;
    for (level = levels - 1; level >= 0; words += runs[level--].n)
        memcpy(words, runs[level].bits, (size_t)runs[level].n * sizeof *words);
    words = (int64_t *)(intptr_t)grid->tree[BITS_AT];
    for (k = 0; k < n_inner; k++) {
        words[n_all + n_inner + k] = next;
        next += count_bits(words[k]);
    }
    for (k = n_inner; k < n_all; k++) grid->tree[N_FACETS] += count_bits(words[k]);
    return 1;
}

static collide_status build_cells(const uint8_t *occupied, const int64_t along[3], collide_field *grid)
{
    const struct collide_kernels *kernels = kernels_here();
    size_t n = (size_t)(along[0] * along[1] * along[2]), k;
    int64_t levels = levels_of(along), level;
    struct run runs[MAX_LEVELS];
    struct arena arena;
    uint8_t *cells;
    int any = 0, kept = 0;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    arena_begin(&arena);
    if ((cells = arena_take(&arena, n)) != NULL) {
        for (k = 0; k < n; k++) any |= cells[k] = occupied[k] != 0;
        runs[0] = finest(kernels, &arena, cells, along, levels);
        for (level = 1; level < levels; level++) runs[level] = parents_of(&arena, &runs[level - 1]);
        kept = any && !arena.failed && keep_cells(grid, runs, levels);
    }
    arena_end(&arena);
    grid->tree[DEPTH] = grid->tree[LEVELS] = levels;
    return kept ? COLLIDE_OK : cells != NULL && !any ? COLLIDE_INVALID_SHAPE : COLLIDE_NO_MEMORY;
}

/* The grid's frame: where cells begin, their sides, and a box around all cells; 0 where it reaches too far. */
static int place_cells(collide_field *grid, const int64_t along[3], const double cell[3], const double origin[3])
{
    double low[3], high[3], farthest = 0.0, shift = 0.0, sum = 0.0;
    int k;
    for (k = 0; k < 3; k++) {
        double half;
        grid->numbers[ORIGIN + k] = origin == NULL ? 0.0 : origin[k];
        grid->numbers[SIDES + k] = cell[k];
        grid->tree[CELLS_ALONG + k] = along[k];
        low[k] = 0.0 * cell[k] + grid->numbers[ORIGIN + k];
        high[k] = (double)along[k] * cell[k] + grid->numbers[ORIGIN + k];
        farthest = fabs(low[k]) > farthest ? fabs(low[k]) : farthest;
        farthest = fabs(high[k]) > farthest ? fabs(high[k]) : farthest;
        shift = fabs(grid->numbers[ORIGIN + k]) > shift ? fabs(grid->numbers[ORIGIN + k]) : shift;
        half = 0.5 * (high[k] - low[k]);
        sum += half * half;
    }
    measure_field(grid, low, high, 0.0);
    grid->numbers[BALL] = sqrt(sum) * UPWARDS;
    grid->are = CELLS;
    grid->tree[TREE_NUMBERS_AT] = address_of(grid->numbers);
    return farthest + shift <= LARGEST;
}

static int is_grid(const size_t cells[3], const double cell[3], const double origin[3])
{
    int k;
    for (k = 0; k < 3; k++)
        if (cells[k] == 0 || cells[k] > MAX_ALONG || !is_length(cell[k]) || (origin != NULL && !is_coordinate(origin[k]))) return 0;
    return (uint64_t)cells[0] * cells[1] <= MAX_NUMBER / cells[2];
}

collide_status collide_voxel_grid_create(const uint8_t *occupied, const size_t cells[3], const double cell[3],
                                         const double origin[3], collide_field **grid)
{
    collide_field *made;
    collide_status status = COLLIDE_INVALID_SHAPE;
    int64_t along[3];
    rounding given;
    int k;
    if (grid == NULL) return COLLIDE_INVALID_ARGUMENT;
    *grid = NULL;
    if (occupied == NULL || cells == NULL || cell == NULL) return COLLIDE_INVALID_ARGUMENT;
    if (!is_grid(cells, cell, origin)) return COLLIDE_INVALID_SHAPE;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = FIELD_WORD;
    for (k = 0; k < 3; k++) along[k] = (int64_t)cells[k];
    given = round_as_kernels_do();
    if (place_cells(made, along, cell, origin)) status = build_cells(occupied, along, made);
    round_as_before(given);
    if (status == COLLIDE_OK) *grid = made;
    else collide_field_free(made);
    return status;
}
