/* Rows of the distinct shapes of a world, ranked by content as the rows of collide/lowering/shape_table.py are. */
#include "capi_world.h"

/* Ranks stand so far apart that others go between them. */
static const int64_t RANK_STEP = (int64_t)1 << 32;

/* By content, and shapes of equal content by their addresses. */
static int compare_shapes(const collide_shape *one, const collide_shape *other)
{
    int order = memcmp(one->content, other->content, sizeof one->content);
    if (order != 0 || one == other) return order;
    return (uintptr_t)one < (uintptr_t)other ? -1 : 1;
}

/* The place of a shape in the order, or where it is to go. */
static size_t place_of(const struct shape_rows *table, const collide_shape *shape)
{
    size_t low = 0, high = table->n_ordered;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (compare_shapes(table->shapes[table->order[middle]], shape) < 0) low = middle + 1;
        else high = middle;
    }
    return low;
}

static int have_equal_content(const collide_shape *one, const collide_shape *other)
{
    return memcmp(one->content, other->content, sizeof one->content) == 0;
}

/* Ranks of all rows anew. */
static void rank_all(struct shape_rows *table)
{
    int64_t rank = 0;
    size_t k;
    for (k = 0; k < table->n_ordered; k++) {
        size_t row = table->order[k];
        if (k > 0 && !have_equal_content(table->shapes[table->order[k - 1]], table->shapes[row])) rank += RANK_STEP;
        table->ints[INTS * row + RANK] = rank;
    }
}

/* The rank of the row at a place of the order: its neighbour's where their contents are equal, or one between its neighbours'. */
static void rank_row(struct shape_rows *table, size_t place)
{
    size_t row = table->order[place];
    const collide_shape *shape = table->shapes[row];
    int64_t *rank = &table->ints[INTS * row + RANK], below = 0, above;
    int has_below = place > 0, has_above = place + 1 < table->n_ordered;
    if (has_below) {
        below = table->ints[INTS * table->order[place - 1] + RANK];
        *rank = below;
        if (have_equal_content(table->shapes[table->order[place - 1]], shape)) return;
    }
    above = has_above ? table->ints[INTS * table->order[place + 1] + RANK] : below + 2 * RANK_STEP;
    *rank = above;
    if (has_above && have_equal_content(table->shapes[table->order[place + 1]], shape)) return;
    if (!has_below) below = above - 2 * RANK_STEP;
    *rank = below + (above - below) / 2;
    if (*rank == below) rank_all(table);
}

int64_t take_shape(struct shape_rows *table, const collide_shape *shape)
{
    size_t place = place_of(table, shape), row;
    if (place < table->n_ordered && table->shapes[table->order[place]] == shape) {
        table->users[table->order[place]]++;
        return (int64_t)table->order[place];
    }
    row = table->n_unused > 0 ? table->unused[--table->n_unused] : table->n++;
    memcpy(table->ints + INTS * row, shape->ints, sizeof shape->ints);
    memcpy(table->numbers + NUMBERS * row, shape->numbers, sizeof shape->numbers);
    table->shapes[row] = shape;
    table->users[row] = 1;
    memmove(table->order + place + 1, table->order + place, (table->n_ordered++ - place) * sizeof *table->order);
    table->order[place] = row;
    rank_row(table, place);
    return (int64_t)row;
}

void leave_shape(struct shape_rows *table, int64_t row)
{
    size_t place;
    if (--table->users[row] > 0) return;
    place = place_of(table, table->shapes[row]);
    memmove(table->order + place, table->order + place + 1, (--table->n_ordered - place) * sizeof *table->order);
    table->shapes[row] = NULL;
    table->unused[table->n_unused++] = (size_t)row;
}
