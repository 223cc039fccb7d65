/* Where rays first meet a field: the items on the way as convex parts, as `_on_field` of collide/casts/raycast.py asks about them. Faces
   between occupied cells are no surface (collide/casts/grid_rays.py): where doubles do not tell whether a place is at one, or whether a
   ray and a flat item meet, Python goes on in fractions, and here a ray is unsupported if anything is left open before its first wall. */
#include "capi_field.h"
#include "capi_rays.h"

#include <stdlib.h>

/* How a chord is of which nothing is known, to be left out (collide/curved/chords.py). */
enum { MISSED };
/* Matrices farther off rotations than this (2^-10) are not looked through for cells. */
static const double FAR_OFF = 0.0009765625;

/* Least and largest cells around a place of W that may be off by a width, by what rounds as well (`_cells_around`): of the lengths met
   a place of the grid's frame, and a plane between cells, round by some 2^-50, and `rounding_of_place` has 2^-40. */
struct cells_around {
    int64_t low[3], high[3];
};

static struct cells_around cells_around(const struct ray *ray, const double place[3], double width)
{
    const collide_field *grid = ray->field;
    const double *X = ray->X, away[3] = {place[0] - X[3], place[1] - X[7], place[2] - X[11]};
    double inverse[9], slack = rounding_of_place(grid, X, place, 0.0) + 2.0 * width;
    struct cells_around around;
    int k;
    invert_rotation(X, INFINITE, inverse); /* by its determinant */
    for (k = 0; k < 3; k++) {
        double p = inverse[3 * k] * away[0] + inverse[3 * k + 1] * away[1] + inverse[3 * k + 2] * away[2];
        double low = floor((p - slack - grid->numbers[ORIGIN + k]) / grid->numbers[SIDES + k]);
        double high = floor((p + slack - grid->numbers[ORIGIN + k]) / grid->numbers[SIDES + k]);
        double end = (double)(grid->tree[CELLS_ALONG + k] + 2);
        around.low[k] = low > -2.0 ? (int64_t)(low < end ? low : end) : -2;
        around.high[k] = high > -2.0 ? (int64_t)(high < end ? high : end) : -2;
    }
    return around;
}

/* How many of the eight cells at the corners of a range are occupied. */
static int count_corners(const struct ray *ray, const struct cells_around *around, int64_t *stack)
{
    int corner, k, count = 0;
    for (corner = 0; corner < 8; corner++) {
        int64_t cell[3];
        for (k = 0; k < 3; k++) cell[k] = corner >> k & 1 ? around->high[k] : around->low[k];
        count += is_occupied(ray->space, ray->field, cell, stack);
    }
    return count;
}

/* The most cells along an axis, less one, and *sum : of all axes. */
static int64_t span_of(const struct cells_around *around, int64_t *sum)
{
    int64_t most = 0;
    int k;
    for (*sum = k = 0; k < 3; k++) {
        int64_t span = around->high[k] - around->low[k];
        most = span > most ? span : most;
        *sum += span;
    }
    return most;
}

/* Whether a ray may begin in a cell, or on one. */
static int begins_in_cells(const struct ray *ray, int64_t *stack)
{
    struct cells_around around = cells_around(ray, ray->origin, 0.0);
    int64_t sum;
    return span_of(&around, &sum) > 1 || count_corners(ray, &around, stack) > 0;
}

enum { INNER, OUTER, UNKNOWN };

/* Whether a place where the ray enters or leaves a cell is on the surface of all cells. */
static int side_of_place(const struct ray *ray, const double *t, int64_t *stack)
{
    const struct cast_space *cast = ray->space->cast;
    double place[3], square = 0.0, width;
    struct cells_around around;
    int64_t sum, most;
    int k, is_outer;
    for (k = 0; k < 3; k++) {
        double step = ldexp(cast->ray[RAY_VECTOR + k], (int)cast->exponent);
        place[k] = ray->origin[k] + t[0] * step;
        square += step * step;
    }
    width = t[2] < INFINITE ? (t[2] - t[1]) * sqrt(square) : 0.0;
    around = cells_around(ray, place, width);
    most = span_of(&around, &sum);
    is_outer = count_corners(ray, &around, stack) < 8;
    return most > 1 || (is_outer && sum > 1) ? UNKNOWN : is_outer ? OUTER : INNER;
}

/* Of the places those on the surface of all cells; *doubt : the least t from below of what is not known. */
static void keep_outer(const struct ray *ray, struct places *places, int64_t *stack, double *doubt)
{
    int64_t k, n = places->n;
    for (places->n = k = 0; k < n; k++) {
        int side = side_of_place(ray, places->t + 3 * k, stack);
        int64_t at = places->n;
        if (side == UNKNOWN && places->t[3 * k + 1] < *doubt) *doubt = places->t[3 * k + 1];
        if (side != OUTER) continue;
        memmove(places->t + 3 * at, places->t + 3 * k, 3 * sizeof *places->t);
        memmove(places->normals + 3 * at, places->normals + 3 * k, 3 * sizeof *places->normals);
        memmove(places->columns + 3 * at, places->columns + 3 * k, 3 * sizeof *places->columns);
        memmove(places->flags + 2 * at, places->flags + 2 * k, 2);
        places->n++;
    }
}

static int by_item(const void *one, const void *other)
{
    int64_t a = ((const struct item_ahead *)one)->item, b = ((const struct item_ahead *)other)->item;
    return (a > b) - (a < b);
}

/* Tables of items, all at the ray's pose. */
static collide_status lay_out_items(const struct ray *ray, const struct item_union *items, struct chords *chords, struct arena *arena)
{
    int64_t *ints = arena_take(arena, items->n * INTS * sizeof *ints);
    double *numbers = arena_take(arena, items->n * NUMBERS * sizeof *numbers);
    size_t k;
    if (!begin_chords(chords, arena, (int64_t)items->n) || arena->failed) return COLLIDE_NO_MEMORY;
    for (k = 0; k < items->n; k++) {
        memcpy(ints + INTS * k, items->shapes[k]->ints, INTS * sizeof *ints);
        memcpy(numbers + NUMBERS * k, items->shapes[k]->numbers, NUMBERS * sizeof *numbers);
        memcpy(chords->poses + POSE * k, ray->space->poses, POSE * sizeof(double));
    }
    chords->ints_at = address_of(ints);
    chords->numbers_at = address_of(numbers);
    return COLLIDE_OK;
}

/* The ends of chords of the items ahead; what is open of them is left out. *doubt : when the ray may meet such a one, in lengths of the
   direction. */
static collide_status ends_of_items(const struct ray *ray, struct chords *chords, const struct item_ahead *ahead, int64_t n, int whole,
                                    struct arena *arena, double *doubt)
{
    int64_t k, n_open, *items = arena_take(arena, (size_t)n * sizeof *items);
    struct item_union made = {NULL, 0, NULL};
    collide_status status = COLLIDE_NO_MEMORY;
    for (k = 0; items != NULL && k < n; k++) items[k] = ahead[k].item;
    if (items != NULL) status = shapes_of_items(ray->field, items, n, arena, &made);
    if (status == COLLIDE_OK) status = lay_out_items(ray, &made, chords, arena);
    if (status == COLLIDE_OK) {
        n_open = cut_chords(ray, whole);
        for (k = 0; k < n_open; k++) {
            double soonest = ldexp(ahead[chords->listed[k]].time, (int)-ray->space->cast->exponent);
            chords->rows[CHORD_ROW * chords->listed[k] + CHORD_STATE] = MISSED;
            *doubt = soonest < *doubt ? soonest : *doubt;
        }
        write_ends(ray);
    }
    free_union(&made);
    return status;
}

/* Whether what is left open cannot come before what is proven to be met. */
static int is_beyond(const struct places *places, double doubt)
{
    double upper = -INFINITE;
    int64_t k;
    if (!(doubt < INFINITE)) return 1;
    for (k = 0; k < places->n; k++)
        if (places->flags[2 * k] && !(upper > -INFINITE && upper <= places->t[3 * k + 2])) upper = places->t[3 * k + 2];
    return doubt > upper && upper > -INFINITE;
}

collide_status places_on_field(const struct ray *ray, struct chords *chords, struct arena *arena)
{
    const collide_field *field = ray->field;
    int64_t *stack = cell_stack(ray->space, arena), n, k;
    double doubt = INFINITE;
    struct item_ahead *ahead;
    collide_status status;
    int whole;
    chords->places.n = 0;
    if (stack == NULL) return COLLIDE_NO_MEMORY;
    if (field->are == CELLS && off_rotation(ray->X) > FAR_OFF) return COLLIDE_UNSUPPORTED;
    whole = field->are == CELLS && begins_in_cells(ray, stack);
    ahead = items_on_way(ray->space, field, ray->X, ray->origin, ray->space->cast->ray + RAY_VECTOR, ray->limit, 0.0, !whole, arena, &n);
    if (ahead == NULL) return COLLIDE_NO_MEMORY;
    if (n == 0) return COLLIDE_OK;
    qsort(ahead, (size_t)n, sizeof *ahead, by_item); /* of places at the same t the least item is told */
    if ((status = ends_of_items(ray, chords, ahead, n, whole, arena, &doubt)) != COLLIDE_OK) return status;
    if (field->are == CELLS) keep_outer(ray, &chords->places, stack, &doubt);
    if (!is_beyond(&chords->places, doubt)) return COLLIDE_UNSUPPORTED;
    for (k = 0; k < chords->places.n; k++) {
        int64_t *item = &chords->places.columns[3 * k + 2];
        *item = number_of_item(field, ahead[*item].item);
    }
    return COLLIDE_OK;
}
