/* Questions about all pairs of a world, as collide/worlds/pair_queries.py, minimum.py and contacts.py answer them. */
#include "capi_contacts.h"
#include "capi_world.h"

#include <math.h>
#include <stdlib.h>

/* Booleans about so many bodies or more ask a few pairs of the first ones before all others are looked for (packed_world.py). */
enum { MIN_SCANNED = 256, SCANNED = 64, FIRST_PAIRS = 32 };
/* What boxes' bounds are lowered by, relatively (collide/worlds/minimum.py); pairs asked at first; how often margins grow. */
static const double BOX_ROUNDING = 1.0 / (1 << 24);
enum { FIRST_ASKED = 16, MAX_GROWTH = 24 };

/* --- memory --------------------------------------------------------------------------------------------------------- */

static int64_t *more_of(int64_t **place, size_t n)
{
    int64_t *memory = n <= (size_t)-1 / 8 ? realloc(*place, 8 * n) : NULL;
    if (memory != NULL) *place = memory;
    return memory;
}

int fit_keys(struct world_space *own, size_t n)
{
    if (n <= own->n_keys) return 1;
    n += n / 2;
    if (more_of(&own->keys, n) == NULL || more_of(&own->sorted, n) == NULL || more_of(&own->pairs, 2 * n + 2) == NULL ||
        more_of((int64_t **)(void *)&own->bounds, n) == NULL)
        return 0;
    own->n_keys = n;
    return 1;
}

/* Room for a question; 0 where there is no memory. */
static int begin_question(const collide_world *world, collide_workspace *space)
{
    struct world_space *own = space->world;
    space->message[0] = 0;
    if (own == NULL && (own = space->world = calloc(1, sizeof *own)) == NULL) return 0;
    if (own->stack == NULL) own->stack = malloc(16 * (size_t)world->measures[W_STACK_OF_PAIRS]);
    if (own->rays == NULL) own->rays = calloc((size_t)(world->measures[W_RAY_DOUBLES] + world->measures[W_RAY_INTEGERS]), 8);
    if (own->stack == NULL || own->rays == NULL || !fit_keys(own, 64 + 4 * world->n)) return 0;
    if (world->n < own->n_counts) return 1;
    if (more_of(&own->counts, 2 * world->n + 2) == NULL || more_of(&own->skipped, 2 * world->n + 2) == NULL) return 0;
    own->n_counts = 2 * world->n + 2;
    return 1;
}

void free_world_space(struct world_space *own)
{
    if (own == NULL) return;
    free(own->keys);
    free(own->sorted);
    free(own->pairs);
    free(own->bounds);
    free(own->counts);
    free(own->skipped);
    free(own->stack);
    free(own->rays);
    free(own->contacts);
    free(own->flat_nodes);
    free(own->flat_links);
    free(own);
}

/* --- pairs of boxes ------------------------------------------------------------------------------------------------- */

/* By one of the bodies, from one array into another; stable. */
static void sort_by(int64_t (*body_of)(int64_t), const int64_t *keys, int64_t *sorted, size_t n_keys, int64_t *counts, size_t n)
{
    size_t k;
    memset(counts, 0, (n + 1) * sizeof *counts);
    for (k = 0; k < n_keys; k++) counts[body_of(keys[k]) + 1]++;
    for (k = 1; k < n; k++) counts[k] += counts[k - 1];
    for (k = 0; k < n_keys; k++) sorted[counts[body_of(keys[k])]++] = keys[k];
}

void sort_keys(struct world_space *own, size_t n_keys, size_t n)
{
    sort_by(second_of, own->keys, own->sorted, n_keys, own->counts, n);
    sort_by(first_of, own->sorted, own->keys, n_keys, own->counts, n);
}

/* Behind n keys those of one body without end with all others, as far as filters let them through; *n : how many there are
   then. */
static int add_unbounded(const collide_world *world, struct world_space *own, const int64_t *tree, int64_t body, double margin,
                         size_t *n)
{
    int64_t other, count = 0, k, *met;
    if (!fit_keys(own, *n + world->n)) return 0;
    for (other = 0; other < (int64_t)world->n; other++) {
        int is_earlier = other < body && world->leaf_of[other] < 0; /* a body without end, whose keys are there */
        if (world->is_alive[other] && other != body && !is_earlier) own->sorted[count++] = key_of(body, other);
    }
    met = own->pairs;
    count = world->kernels->tested_pairs(address_of(tree), address_of(own->sorted), count, margin, 0, address_of(met));
    for (k = 0; k < count; k++) own->keys[(*n)++] = key_of(met[2 * k], met[2 * k + 1]);
    return 1;
}

/* Keys of all pairs that are to be tested, boxes within a margin and those of bodies, ascending; *n : how many. 0 where there is no
   memory. */
static int near_pairs(const collide_world *world, struct world_space *own, double margin, size_t *n)
{
    int64_t tree[TREE_HEADER], count;
    size_t k;
    tree_header(world, tree);
    while ((count = world->kernels->pairs_of_all(address_of(tree), margin, 0, address_of(own->stack), address_of(own->keys),
                                                 (int64_t)own->n_keys)) > (int64_t)own->n_keys)
        if (!fit_keys(own, (size_t)count)) return 0;
    *n = (size_t)count;
    for (k = 0; k < world->n_unbounded; k++)
        if (!add_unbounded(world, own, tree, world->unbounded[k], margin, n)) return 0;
    sort_keys(own, *n, world->n);
    return 1;
}

/* --- pairs of bodies ------------------------------------------------------------------------------------------------ */

collide_status refuse_pair(const collide_world *world, collide_workspace *space, int64_t key, collide_status status)
{
    long a = world->ids[first_of(key)], b = world->ids[second_of(key)];
    const char *text = collide_status_text(status);
    if (!is_whole_key(world, key)) return refuse(space->message, status, "bodies %ld and %ld: %s", a, b, text);
    return refuse(space->message, status, "bodies %ld and %ld: of %s and %s: %s", a, b, kind_of_body(world, first_of(key)),
                  kind_of_body(world, second_of(key)), text);
}

collide_status answer_keys(const collide_world *world, collide_workspace *space, const int64_t *keys, size_t n, const double *X_WP,
                           int boolean, double limit)
{
    struct world_space *own = space->world;
    struct question asked;
    collide_status status;
    size_t k, failed = 0;
    for (k = 0; k < n; k++) {
        int64_t a = first_of(keys[k]), b = second_of(keys[k]);
        own->which[2 * k] = X_WP != NULL ? 0 : world->row_of[a];
        own->which[2 * k + 1] = world->row_of[b];
        memcpy(own->X_WA + 16 * k, X_WP != NULL ? X_WP : world->X_WBs + 16 * a, 16 * sizeof(double));
        memcpy(own->X_WB + 16 * k, world->X_WBs + 16 * b, 16 * sizeof(double));
    }
    asked.which = own->which;
    asked.X_WA = own->X_WA;
    asked.X_WB = own->X_WB;
    asked.step_a = asked.step_b = 16;
    asked.n = n;
    asked.boolean = boolean;
    asked.depths = !boolean;
    asked.check = 0; /* they were, when bodies were moved */
    asked.limit = limit;
    asked.axes = NULL;
    memset(own->hits, 0, n);
    memset(own->rows, 0, n * sizeof *own->rows);
    status = answer_table(space, world->table.ints, world->table.numbers, &asked, own->hits, own->rows, &failed);
    if (status != COLLIDE_OK)
        return X_WP == NULL ? refuse_pair(world, space, keys[failed], status)
                            : refuse(space->message, status, "a point and body %ld: %s", (long)world->ids[second_of(keys[failed])],
                                     collide_status_text(status));
    for (k = 0; k < n && !boolean; k++) {
        own->rows[k].a = X_WP != NULL ? -1 : world->ids[first_of(keys[k])];
        own->rows[k].b = world->ids[second_of(keys[k])];
    }
    return COLLIDE_OK;
}

collide_status no_memory(collide_workspace *space) { return refuse(space->message, COLLIDE_NO_MEMORY, "out of memory"); }

collide_status check_question(const collide_world *world, collide_workspace *space, const char *caller, int is_good,
                              const char *what)
{
    if (!IS_HANDLE(space, WORKSPACE_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if (!IS_HANDLE(world, WORLD_WORD)) return refuse(space->message, COLLIDE_INVALID_ARGUMENT, "%s: world is NULL, or freed", caller);
    if (!is_good) return refuse(space->message, COLLIDE_INVALID_ARGUMENT, "%s: %s", caller, what);
    return begin_question(world, space) ? COLLIDE_OK : no_memory(space);
}

/* What is asked about pairs: booleans or rows, up to a limit [m], to which the margins of pairs are added or not. */
struct asked_pairs {
    int boolean, with_margins;
    double limit;
};

static double reach_of(const collide_world *world, const struct asked_pairs *asked, int64_t key)
{
    return asked->with_margins ? reach_of_key(world, key, asked->limit) : asked->limit;
}

/* How many of n keys, BLOCK at most, are of convex shapes and have the reach of the first, before others. */
static size_t n_of_reach(const collide_world *world, const struct asked_pairs *asked, const int64_t *keys, size_t n, double reach)
{
    size_t k = 0;
    while (k < n && k < BLOCK && !is_whole_key(world, keys[k]) && reach_of(world, asked, keys[k]) == reach) k++;
    return k;
}

/* Whether a pair that is no more than a reach above 0 apart, from its row. */
static collide_status comes_within(const collide_world *world, collide_workspace *space, int64_t key, double reach,
                                   const collide_pair *row, uint8_t *hit)
{
    int64_t a = first_of(key), b = second_of(key);
    collide_status status;
    *hit = row->hit || row->lower <= reach;
    if (is_whole_key(world, key)) return COLLIDE_OK;
    status = within_by_row(space, shape_of_body(world, a), shape_of_body(world, b), world->X_WBs + 16 * a, world->X_WBs + 16 * b, reach,
                           COLLIDE_TRUST_POSES, row, hit);
    return status == COLLIDE_OK ? status : refuse_pair(world, space, key, status);
}

/* A pair with a mesh or a field, into own->hits or own->rows. */
static collide_status answer_whole(const collide_world *world, collide_workspace *space, int64_t key, int boolean, double reach)
{
    struct world_space *own = space->world;
    collide_status status = boolean ? whole_meets(world, space, key, own->hits) : COLLIDE_OK;
    if (status != COLLIDE_OK || (boolean && (own->hits[0] || reach == 0.0))) return status;
    return row_of_whole(world, space, key, reach, own->rows);
}

/* Answer the first of n keys, into own->rows unless booleans are asked; own->hits : whether they meet, or come within their reach
   where margins count; *some : how many. */
static collide_status answer_some(const collide_world *world, collide_workspace *space, const struct asked_pairs *asked,
                                  const int64_t *keys, size_t n, size_t *some)
{
    struct world_space *own = space->world;
    double reach = reach_of(world, asked, keys[0]);
    int rows = !asked->boolean || reach > 0.0, is_met;
    collide_status status;
    size_t k;
    if ((*some = n_of_reach(world, asked, keys, n, reach)) > 0) status = answer_keys(world, space, keys, *some, NULL, !rows, reach);
    else {
        *some = 1;
        own->hits[0] = 0;
        status = answer_whole(world, space, keys[0], asked->boolean, reach);
    }
    is_met = asked->boolean && is_whole_key(world, keys[0]) && own->hits[0];
    if (status != COLLIDE_OK || !rows || is_met) return status;
    for (k = 0; k < *some && status == COLLIDE_OK; k++) {
        if (asked->with_margins && reach > 0.0) status = comes_within(world, space, keys[k], reach, own->rows + k, own->hits + k);
        else own->hits[k] = own->rows[k].hit;
    }
    return status;
}

/* Whether one of n keys hits: those of convex shapes first, and of the others any, whatever is not answered. */
static collide_status any_hit(const collide_world *world, collide_workspace *space, const struct asked_pairs *asked,
                              const int64_t *keys, size_t n, int *hit)
{
    collide_status status = COLLIDE_OK, first = COLLIDE_OK;
    size_t k, j, some;
    for (k = 0; k < n && !*hit && status == COLLIDE_OK; k += some) {
        some = 1;
        if (is_whole_key(world, keys[k])) continue;
        status = answer_some(world, space, asked, keys + k, n - k, &some);
        for (j = 0; j < some && status == COLLIDE_OK; j++) *hit |= space->world->hits[j];
    }
    for (k = 0; k < n && !*hit && status == COLLIDE_OK; k++) {
        char message[MESSAGE];
        if (!is_whole_key(world, keys[k])) continue;
        memcpy(message, space->message, sizeof message);
        status = answer_some(world, space, asked, keys + k, 1, &some);
        if (status == COLLIDE_OK) *hit = space->world->hits[0];
        if (status != COLLIDE_UNSUPPORTED) continue;
        if (first != COLLIDE_OK) memcpy(space->message, message, sizeof message); /* the first that is not answered is named */
        first = status;
        status = COLLIDE_OK;
    }
    if (*hit) space->message[0] = 0;
    return status != COLLIDE_OK ? status : *hit ? COLLIDE_OK : first;
}

static collide_status collides(const collide_world *world, collide_workspace *space, double margin, int *hit)
{
    const struct asked_pairs asked = {1, 1, margin};
    struct world_space *own = space->world;
    collide_status status = COLLIDE_OK;
    size_t n;
    if (world->n >= MIN_SCANNED && world->widest == 0.0 && margin == 0.0) {
        int64_t tree[TREE_HEADER], keys[FIRST_PAIRS];
        tree_header(world, tree);
        n = (size_t)world->kernels->first_pairs(address_of(tree), SCANNED, address_of(keys), FIRST_PAIRS);
        status = any_hit(world, space, &asked, keys, n, hit);
        if (*hit || status != COLLIDE_OK) return status;
    }
    if (!near_pairs(world, own, margin, &n)) return no_memory(space);
    return any_hit(world, space, &asked, own->keys, n, hit);
}

static collide_status ask_collides(const collide_world *world, collide_workspace *space, const char *caller, double margin, int *hit)
{
    int is_good = hit != NULL && (margin == 0.0 || (margin >= SMALLEST && margin <= LARGEST));
    collide_status status = check_question(world, space, caller, is_good, "hit is NULL, or margin is neither 0 nor within 1e-50 ... 1e50");
    rounding given;
    if (hit != NULL) *hit = 0;
    if (status != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    status = collides(world, space, margin, hit);
    round_as_before(given);
    return status;
}

collide_status collide_world_collides(const collide_world *world, collide_workspace *workspace, int *hit)
{
    return ask_collides(world, workspace, "collide_world_collides", 0.0, hit);
}

collide_status collide_world_within(const collide_world *world, collide_workspace *workspace, double margin, int *hit)
{
    return ask_collides(world, workspace, "collide_world_within", margin, hit);
}

collide_status too_many(collide_workspace *space, size_t count, size_t capacity)
{
    if (count <= capacity) return COLLIDE_OK;
    return refuse(space->message, COLLIDE_TOO_MANY, "there are %zu, and room for %zu", count, capacity);
}

/* The ids of all tested pairs that hit, or come within their margins, two a pair. */
static collide_status pairs_that_hit(const collide_world *world, collide_workspace *space, int32_t *ids, size_t capacity,
                                     size_t *count)
{
    const struct asked_pairs asked = {1, 1, 0.0};
    struct world_space *own = space->world;
    collide_status status = COLLIDE_OK;
    size_t n, first, k, some;
    if (!near_pairs(world, own, 0.0, &n)) return no_memory(space);
    for (first = 0; first < n && status == COLLIDE_OK; first += some) {
        status = answer_some(world, space, &asked, own->keys + first, n - first, &some);
        for (k = 0; k < some && status == COLLIDE_OK; k++) {
            if (!own->hits[k]) continue;
            if (*count < capacity) {
                ids[2 * *count] = world->ids[first_of(own->keys[first + k])];
                ids[2 * *count + 1] = world->ids[second_of(own->keys[first + k])];
            }
            ++*count;
        }
    }
    return status == COLLIDE_OK ? too_many(space, *count, capacity) : status;
}

collide_status collide_world_hits(const collide_world *world, collide_workspace *workspace, int32_t *ids, size_t capacity,
                                  size_t *count)
{
    int is_good = count != NULL && (capacity == 0 || ids != NULL);
    collide_status status = check_question(world, workspace, "collide_world_hits", is_good, "ids or count is NULL");
    rounding given;
    if (count != NULL) *count = 0;
    if (status != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    status = pairs_that_hit(world, workspace, ids, capacity, count);
    round_as_before(given);
    return status;
}

/* Rows of all tested pairs within a limit: those that hit or come within their margins, or all that are not proven to be farther. */
static collide_status rows_within(const collide_world *world, collide_workspace *space, double limit, int hits_alone,
                                  collide_pair *rows, size_t capacity, size_t *count)
{
    const struct asked_pairs asked = {0, hits_alone, limit};
    struct world_space *own = space->world;
    collide_status status = COLLIDE_OK;
    size_t n, first, k, some;
    if (!near_pairs(world, own, limit, &n)) return no_memory(space);
    for (first = 0; first < n && status == COLLIDE_OK; first += some) {
        status = answer_some(world, space, &asked, own->keys + first, n - first, &some);
        for (k = 0; k < some && status == COLLIDE_OK; k++) {
            if (hits_alone ? !own->hits[k] : own->rows[k].lower > limit) continue;
            if (*count < capacity) rows[*count] = own->rows[k];
            ++*count;
        }
    }
    return status == COLLIDE_OK ? too_many(space, *count, capacity) : status;
}

static collide_status ask_rows(const collide_world *world, collide_workspace *space, const char *caller, double limit,
                               int hits_alone, collide_pair *rows, size_t capacity, size_t *count)
{
    int is_good = count != NULL && (capacity == 0 || rows != NULL) && limit >= 0.0;
    collide_status status = check_question(world, space, caller, is_good, "rows or count is NULL, or max_distance is below 0");
    rounding given;
    if (count != NULL) *count = 0;
    if (status != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    status = rows_within(world, space, limit, hits_alone, rows, capacity, count);
    round_as_before(given);
    return status;
}

collide_status collide_world_collisions(const collide_world *world, collide_workspace *workspace, collide_pair *rows,
                                        size_t capacity, size_t *count)
{
    return ask_rows(world, workspace, "collide_world_collisions", 0.0, 1, rows, capacity, count);
}

collide_status collide_world_distances(const collide_world *world, collide_workspace *workspace, double max_distance,
                                       collide_pair *rows, size_t capacity, size_t *count)
{
    return ask_rows(world, workspace, "collide_world_distances", max_distance, 0, rows, capacity, count);
}

/* --- the nearest pair ----------------------------------------------------------------------------------------------- */

/* The nearest pair so far. */
struct nearest {
    double distance;
    int64_t key; /* -1: none */
};

int compare_candidates(const void *one, const void *other)
{
    const struct candidate *a = one, *b = other;
    if (a->bound != b->bound) return a->bound < b->bound ? -1 : 1;
    return (a->key > b->key) - (a->key < b->key);
}

/* n keys as candidates, in the order of how near their boxes let them be; in own->pairs. */
static struct candidate *in_order(const collide_world *world, struct world_space *own, size_t n)
{
    struct candidate *made = (struct candidate *)(void *)own->pairs;
    size_t k;
    world->kernels->pairs_of_keys(address_of(own->keys), (int64_t)n, address_of(own->pairs));
    world->kernels->gap_bounds(address_of(world->boxes), (int64_t)world->n, address_of(own->pairs), (int64_t)n, BOX_ROUNDING,
                               address_of(own->bounds));
    for (k = 0; k < n; k++) {
        int is_open = own->bounds[k] <= 0.0 && is_whole_key(world, own->keys[k]); /* boxes bound depths of convex bodies alone */
        made[k].bound = is_open ? -INFINITE : own->bounds[k];
        made[k].key = own->keys[k];
    }
    if (n > 0) qsort(made, n, sizeof *made, compare_candidates);
    return made;
}

/* Ask n keys from the nearest boxes on, until no other can be nearer than the best. A pair is left out where its bound is above
   the best distance: bounds are lowered by 2^-24, far more than a distance may be off, so it has a larger one. */
static collide_status look_among(const collide_world *world, collide_workspace *space, size_t n, double limit, struct nearest *best)
{
    struct world_space *own = space->world;
    struct candidate *candidates = in_order(world, own, n);
    size_t first = 0, size = FIRST_ASKED, some, k;
    int64_t keys[BLOCK];
    while (first < n && candidates[first].bound <= (best->distance < limit ? best->distance : limit)) {
        struct asked_pairs asked = {0, 0, 0.0};
        double twice = 2.0 * best->distance, reach = twice < limit ? twice : limit;
        collide_status status;
        for (some = 0; some < size && first + some < n; some++) {
            keys[some] = candidates[first + some].key;
            if (is_whole_key(world, keys[some])) break;
        }
        asked.limit = reach > 0.0 ? reach : 0.0;
        status = answer_some(world, space, &asked, keys, some > 0 ? some : 1, &some);
        if (status != COLLIDE_OK) return status;
        for (k = 0; k < some; k++) {
            const collide_pair *row = &own->rows[k];
            if (row->beyond || !(row->distance <= limit)) continue;
            if (row->distance < best->distance || (row->distance == best->distance && keys[k] < best->key)) {
                best->distance = row->distance;
                best->key = keys[k];
            }
        }
        first += some;
        size = 2 * size < BLOCK ? 2 * size : BLOCK;
    }
    return COLLIDE_OK;
}

static collide_status least_distance(const collide_world *world, collide_workspace *space, double limit, struct nearest *best)
{
    struct world_space *own = space->world;
    double margin = 0.0, step = spacing_of(&world->tree);
    collide_status status;
    size_t n, round;
    for (round = 0;; round++) {
        if (!near_pairs(world, own, margin, &n)) return no_memory(space);
        if ((status = look_among(world, space, n, limit, best)) != COLLIDE_OK) return status;
        if (best->key >= 0 || margin >= limit) break;
        margin = round == 0 ? step : 4.0 * margin;
        if (!(margin > 0.0 && margin < limit) || round > MAX_GROWTH) margin = limit;
    }
    if (best->key < 0 || !(best->distance > margin)) return COLLIDE_OK;
    margin = 2.0 * best->distance < limit ? 2.0 * best->distance : limit; /* boxes as near as the best have not all been compared */
    if (!near_pairs(world, own, margin, &n)) return no_memory(space);
    return look_among(world, space, n, limit, best);
}

collide_status collide_world_minimum(const collide_world *world, collide_workspace *workspace, double max_distance,
                                     collide_pair *row, size_t *count)
{
    int is_good = row != NULL && count != NULL && max_distance >= 0.0;
    collide_status status = check_question(world, workspace, "collide_world_minimum", is_good,
                                           "row or count is NULL, or max_distance is below 0");
    struct nearest best = {INFINITE, -1};
    rounding given;
    if (count != NULL) *count = 0;
    if (status != COLLIDE_OK) return status;
    given = round_as_kernels_do();
    status = least_distance(world, workspace, max_distance, &best);
    if (status == COLLIDE_OK && best.key >= 0) {
        const struct asked_pairs asked = {0, 0, INFINITE};
        size_t some;
        status = answer_some(world, workspace, &asked, &best.key, 1, &some);
        *row = workspace->world->rows[0];
        *count = status == COLLIDE_OK;
    }
    round_as_before(given);
    return status;
}

/* --- contacts ------------------------------------------------------------------------------------------------------- */

/* Contacts of one pair into own->contacts, which grows. */
static collide_status contacts_of_key(const collide_world *world, collide_workspace *space, int64_t key, double margin,
                                      size_t max_contacts, size_t *n)
{
    struct world_space *own = space->world;
    int64_t a = first_of(key), b = second_of(key);
    for (;;) {
        size_t capacity = 2 * own->n_contacts + 64;
        collide_contact *memory;
        collide_status status;
        if (is_whole_key(world, key))
            status = contacts_of_whole(world, space, key, margin, max_contacts, own->contacts, own->n_contacts, n);
        else
            status = contacts_of_shapes(space, shape_of_body(world, a), shape_of_body(world, b), world->X_WBs + 16 * a,
                                        world->X_WBs + 16 * b, margin, max_contacts, COLLIDE_TRUST_POSES, own->contacts,
                                        own->n_contacts, n);
        if (status != COLLIDE_TOO_MANY) return status;
        if ((memory = realloc(own->contacts, capacity * sizeof *memory)) == NULL) return COLLIDE_NO_MEMORY;
        own->contacts = memory;
        own->n_contacts = capacity;
    }
}

collide_status collide_world_contacts(const collide_world *world, collide_workspace *workspace, double margin, size_t max_contacts,
                                      collide_contact *contacts, size_t capacity, size_t *count)
{
    int is_good = count != NULL && (capacity == 0 || contacts != NULL) && margin >= 0.0 && margin <= LARGEST && max_contacts > 0;
    collide_status status = check_question(world, workspace, "collide_world_contacts", is_good,
                                           "contacts or count is NULL, margin is outside 0 ... 1e50, or max_contacts is 0");
    struct world_space *own;
    rounding given;
    size_t n = 0, k, j, some;
    if (count != NULL) *count = 0;
    if (status != COLLIDE_OK) return status;
    own = workspace->world;
    given = round_as_kernels_do();
    if (!near_pairs(world, own, margin, &n)) status = no_memory(workspace);
    for (k = 0; k < n && status == COLLIDE_OK; k++) {
        status = contacts_of_key(world, workspace, own->keys[k], reach_of_key(world, own->keys[k], margin), max_contacts, &some);
        if (status != COLLIDE_OK) refuse_pair(world, workspace, own->keys[k], status);
        for (j = 0; j < some && status == COLLIDE_OK; j++, ++*count) {
            own->contacts[j].a = world->ids[first_of(own->keys[k])];
            own->contacts[j].b = world->ids[second_of(own->keys[k])];
            if (*count < capacity) contacts[*count] = own->contacts[j];
        }
    }
    round_as_before(given);
    return status == COLLIDE_OK ? too_many(workspace, *count, capacity) : status;
}
