/* Margins of bodies and of pairs of a world, as collide/worlds/scene.py and packed_world.py hold them. */
#include "capi_contacts.h"
#include "capi_world.h"

#include <math.h>
#include <stdlib.h>

/* What a box gets beside its margin, relatively: `widened` of collide/broadphase/bounding_boxes.py. */
static const double WIDENING = 1.0 / ((int64_t)1 << 50);

/* The place of a pair with a margin of its own, or where it is to go. */
static size_t place_of_pair(const collide_world *world, int64_t key)
{
    size_t low = 0, high = world->n_margin_keys;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (world->margin_keys[middle] < key) low = middle + 1;
        else high = middle;
    }
    return low;
}

static int is_pair_at(const collide_world *world, size_t place, int64_t key)
{
    return place < world->n_margin_keys && world->margin_keys[place] == key;
}

double reach_of_key(const collide_world *world, int64_t key, double margin)
{
    size_t place;
    if (world->widest == 0.0) return margin;
    place = place_of_pair(world, key);
    if (is_pair_at(world, place, key)) return margin + world->pair_margins[place];
    return margin + (world->margins[first_of(key)] + world->margins[second_of(key)]);
}

void spread_margins(collide_world *world)
{
    size_t k;
    memcpy(world->spread, world->margins, world->n * sizeof *world->spread);
    for (k = 0; k < 2 * world->n_margin_keys; k++) {
        int64_t key = world->margin_keys[k / 2];
        double *spread = &world->spread[k % 2 ? second_of(key) : first_of(key)];
        if (*spread < 0.5 * world->pair_margins[k / 2]) *spread = 0.5 * world->pair_margins[k / 2];
    }
    world->widest = 0.0;
    for (k = 0; k < world->n; k++)
        if (world->spread[k] > world->widest) world->widest = world->spread[k];
}

void forget_margins(collide_world *world, int64_t body)
{
    size_t k, n = 0;
    world->margins[body] = 0.0;
    for (k = 0; k < world->n_margin_keys; k++) {
        if (first_of(world->margin_keys[k]) == body || second_of(world->margin_keys[k]) == body) continue;
        world->margin_keys[n] = world->margin_keys[k];
        world->pair_margins[n++] = world->pair_margins[k];
    }
    world->n_margin_keys = n;
    if (world->widest > 0.0) spread_margins(world);
}

/* A box is moved outwards by r, at least the body's share of its margins and what the sums round by. */
void widen_box(collide_world *world, int64_t body)
{
    const double *box = world->boxes + 6 * body;
    double *widened = world->widened + 6 * body, spread = world->spread[body], r;
    int axis;
    memcpy(widened, box, 6 * sizeof *box);
    for (axis = 0; axis < 6 && spread > 0.0; axis++) {
        r = spread + (fabs(box[axis]) + spread) * WIDENING;
        widened[axis] = axis < 3 ? box[axis] - r : box[axis] + r;
    }
}

/* Take other margins: the tree's leaves have room for them. */
static void take_margins(collide_world *world)
{
    rounding given = round_as_kernels_do();
    spread_margins(world);
    widen_leaves(world);
    round_as_before(given);
}

/* --- changes -------------------------------------------------------------------------------------------------------- */

static collide_status check_margins(collide_world *world, const char *caller, const double *margins, size_t n)
{
    size_t k;
    for (k = 0; k < n; k++)
        if (!(margins[k] == 0.0 || (margins[k] >= SMALLEST && margins[k] <= LARGEST)))
            return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: margins[%zu] is %g; it must be 0 or within 1e-50 ... 1e50 m",
                          caller, k, margins[k]);
    return COLLIDE_OK;
}

collide_status collide_world_set_margins(collide_world *world, const int32_t *ids, size_t n, const double *margins)
{
    static const char caller[] = "collide_world_set_margins";
    collide_status status;
    size_t k;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((status = check_ids(world, caller, "ids", ids, n)) != COLLIDE_OK || n == 0) return status;
    if (margins == NULL) return refuse(world->message, COLLIDE_INVALID_ARGUMENT, "%s: margins is NULL", caller);
    if ((status = check_margins(world, caller, margins, n)) != COLLIDE_OK) return status;
    for (k = 0; k < n; k++) world->margins[row_of_id(world, ids[k])] = margins[k];
    take_margins(world);
    return COLLIDE_OK;
}

/* Room for so many more pairs; 0 where there is no memory. */
static int reserve_pairs(collide_world *world, size_t more)
{
    size_t n = world->n_margin_keys + more;
    if (n <= world->margin_capacity) return 1;
    n += n / 2 + 16;
    if (!resize(&world->margin_keys, n, 8) || !resize(&world->pair_margins, n, sizeof(double))) return 0;
    world->margin_capacity = n;
    return 1;
}

/* Give a pair a margin of its own, or take it away where `margin` is NULL. */
static void put_margin(collide_world *world, int64_t key, const double *margin)
{
    size_t place = place_of_pair(world, key), there = (size_t)is_pair_at(world, place, key), rest;
    int64_t *keys = world->margin_keys + place;
    double *margins = world->pair_margins + place;
    rest = world->n_margin_keys - place - there;
    if (margin == NULL && !there) return;
    memmove(keys + (margin != NULL), keys + there, rest * sizeof *keys);
    memmove(margins + (margin != NULL), margins + there, rest * sizeof *margins);
    world->n_margin_keys = place + rest + (margin != NULL);
    if (margin == NULL) return;
    *keys = key;
    *margins = *margin;
}

collide_status collide_world_set_pair_margins(collide_world *world, const int32_t *pairs, size_t n, const double *margins)
{
    static const char caller[] = "collide_world_set_pair_margins";
    collide_status status;
    size_t k;
    if (!IS_HANDLE(world, WORLD_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if ((status = check_pairs(world, caller, pairs, n)) != COLLIDE_OK || n == 0) return status;
    if (margins != NULL && (status = check_margins(world, caller, margins, n)) != COLLIDE_OK) return status;
    if (margins != NULL && !reserve_pairs(world, n)) return refuse(world->message, COLLIDE_NO_MEMORY, "%s: out of memory", caller);
    for (k = 0; k < n; k++)
        put_margin(world, key_of(row_of_id(world, pairs[2 * k]), row_of_id(world, pairs[2 * k + 1])), margins != NULL ? margins + k : NULL);
    take_margins(world);
    return COLLIDE_OK;
}
