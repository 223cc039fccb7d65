/* What doubles leave open goes to the exact stage: as `settle_rows` of collide/narrowphase/exact/exact_stage.py, then `settle_by_other_searches`. */
#include "capi_internal.h"

#include <string.h>

/* Rows that stand open. */
static size_t open_rows(const collide_pair *rows, size_t n, int64_t *undecided)
{
    size_t k, n_open = 0;
    for (k = 0; k < n; k++)
        if (rows[k].how == COLLIDE_HOW_UNDECIDED) undecided[n_open++] = (int64_t)k;
    return n_open;
}

/* Row of the table that a part of the block is. */
static const collide_shape *shape_at(const collide_workspace *space, const struct question *asked, int64_t part)
{
    return asked->shapes[space->shape_of[part]];
}

static collide_status settle_half_spaces(collide_workspace *space, const struct question *asked, collide_pair *rows, size_t n)
{
    size_t n_open = open_rows(rows, n, space->undecided), k;
    for (k = 0; k < n_open; k++) {
        const int64_t *parts = space->pairs + 2 * space->undecided[k];
        const collide_shape *A = shape_at(space, asked, parts[0]), *B = shape_at(space, asked, parts[1]);
        collide_status status;
        if (A->ints[KIND] != HALFSPACE || B->ints[KIND] != HALFSPACE) continue;
        status = settle_halfspaces(A, space->poses + POSE * parts[0], B, space->poses + POSE * parts[1],
                                   rows + space->undecided[k], space->halfspaces);
        if (status != COLLIDE_OK) return status;
    }
    return COLLIDE_OK;
}

/* A boolean, a gap and a depth are searched for differently: open rows ask the other two searches. */
static void settle_by_other_searches(collide_workspace *space, const struct question *asked, collide_pair *rows, size_t n)
{
    static const int booleans[3] = {1, 0, 0}, depths[3] = {0, 1, 0};
    int search;
    for (search = 0; search < 3; search++) {
        size_t n_open = open_rows(rows, n, space->undecided), k;
        if (n_open == 0) return;
        if (booleans[search] == asked->boolean && depths[search] == (asked->depths && !asked->boolean)) continue;
        for (k = 0; k < n_open; k++)
            memcpy(space->asked + 2 * k, space->pairs + 2 * space->undecided[k], 2 * sizeof *space->asked);
        memset(space->results, 0, n_open * sizeof *space->results);
        space->kernels->answer_pairs(
            space->header[INTS_AT], space->header[NUMBERS_AT], space->header[POSES_AT], 0, space->header[SHAPE_OF_AT],
            address_of(space->asked), (int64_t)n_open, (uint8_t)booleans[search], (uint8_t)depths[search], 0, asked->limit,
            address_of(space->results), space->header[DOUBLES_AT], space->header[INTEGERS_AT]);
        space->kernels->take_proven(address_of(rows), address_of(space->undecided), address_of(space->results), (int64_t)n_open,
                                  (uint8_t)booleans[search], asked->limit);
    }
}

/* Overlaps that the exact stage has settled without a depth are measured by all planes. */
static void find_depths(collide_workspace *space, const struct question *asked, collide_pair *rows, size_t n)
{
    uint8_t shallow[BLOCK];
    size_t k;
    int any = 0;
    for (k = 0; k < n; k++) {
        shallow[k] = rows[k].how == COLLIDE_HOW_EXACT_ARITHMETIC && rows[k].hit && !rows[k].certified;
        any = any || shallow[k];
    }
    if (!any) return;
    space->kernels->exact_depth(
        space->header[INTS_AT], space->header[NUMBERS_AT], space->header[POSES_AT], space->header[SHAPE_OF_AT],
        space->header[PAIRS_AT], address_of(shallow), (int64_t)n, asked->limit, address_of(rows), 0, 0, space->digits_at);
}

collide_status settle_rows(collide_workspace *space, const struct question *asked, collide_pair *rows, size_t n, size_t *failed)
{
    const struct collide_kernels *kernels = space->kernels;
    const int64_t *header = space->header;
    int depths = asked->depths && !asked->boolean;
    collide_status status;
    size_t k;
    for (k = 0; k < n; k++)
        if (rows[k].how == REFUSED) {
            *failed = k;
            return COLLIDE_OUT_OF_RANGE;
        }
    if (open_rows(rows, n, space->undecided) == 0) return COLLIDE_OK;
    if (kernels->settle_hulls(header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT], header[PAIRS_AT],
                              (int64_t)n, (uint8_t)asked->boolean, (uint8_t)depths, asked->limit, address_of(rows), 0, 0,
                              space->requests_at, space->digits_at) > 0)
        kernels->settle_halfspaces(header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT], header[PAIRS_AT],
                               (int64_t)n, (uint8_t)asked->boolean, asked->limit, address_of(rows), 0, 0, space->digits_at);
    if (depths) find_depths(space, asked, rows, n);
    status = settle_half_spaces(space, asked, rows, n);
    if (status == COLLIDE_OK) settle_by_other_searches(space, asked, rows, n);
    return status;
}
