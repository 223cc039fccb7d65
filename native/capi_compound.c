/* Unions of convex shapes, and the tables of two of them: collide/lowering/compound_table.py. */
#include "capi_compound.h"

#include <stdlib.h>

#if defined(_MSC_VER)
#define NEXT_NUMBER(place) _InterlockedIncrement64(place)
#else
#define NEXT_NUMBER(place) __sync_add_and_fetch((place), 1)
#endif

/* Rows of parts that there is room for at least. */
static const size_t LEAST_CAPACITY = 256;

static size_t groups_of(size_t n)
{
    size_t size = n, count = 0;
    do {
        size = (size + GROUP - 1) / GROUP;
        count += size;
    } while (size > 1);
    return count;
}

static int is_identity(const double *X)
{
    int k;
    for (k = 0; k < 16; k++) if (X[k] != (k % 5 == 0 ? 1.0 : 0.0)) return 0;
    return 1;
}

/* Rows of the parts, balls around them, and groups. */
static collide_status lay_out(collide_compound *made, const collide_shape *const *shapes, const double *poses)
{
    size_t n = made->n, k, doubles = n * (INTS + NUMBERS + PART + 2) + made->n_groups * GROUP_BALL;
    double *memory = cache_lines(8 * doubles, &made->held), *points = malloc((3 * n + 6) * sizeof *points);
    if (memory == NULL || points == NULL) {
        free(points);
        return COLLIDE_NO_MEMORY;
    }
    made->ints = (int64_t *)memory;
    made->numbers = memory + n * INTS;
    made->parts = made->numbers + n * NUMBERS;
    made->groups = made->parts + n * PART;
    made->by_place = (int64_t *)(made->groups + made->n_groups * GROUP_BALL);
    made->shapes = (const collide_shape **)(made->by_place + n);
    for (k = 0; k < n; k++) {
        made->shapes[k] = shapes[k];
        memcpy(made->ints + INTS * k, shapes[k]->ints, sizeof shapes[k]->ints);
        memcpy(made->numbers + NUMBERS * k, shapes[k]->numbers, sizeof shapes[k]->numbers);
    }
    kernels_here()->lay_out_parts(address_of(made->ints), address_of(made->numbers), address_of(poses), (int64_t)n, address_of(made->parts),
                                  address_of(made->ball), address_of(made->by_place), address_of(made->groups), address_of(points));
    free(points);
    return COLLIDE_OK;
}

collide_status collide_compound_create(const collide_shape *const *shapes, const double *poses, size_t n, collide_compound **compound)
{
    static volatile int64_t last_serial = 0;
    collide_compound *made;
    collide_status status = COLLIDE_OK;
    double pose[POSE];
    rounding given;
    size_t k;
    if (compound == NULL) return COLLIDE_INVALID_ARGUMENT;
    *compound = NULL;
    if (shapes == NULL || poses == NULL || n > (size_t)1 << 24) return COLLIDE_INVALID_ARGUMENT;
    if (n == 0) return COLLIDE_INVALID_SHAPE;
    for (k = 0; k < n; k++) if (!IS_HANDLE(shapes[k], SHAPE_WORD)) return COLLIDE_INVALID_ARGUMENT;
    if (kernels_here() == NULL) return COLLIDE_NO_KERNELS;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = COMPOUND_WORD;
    made->n = n;
    made->n_groups = groups_of(n);
    made->is_whole = n == 1 && is_identity(poses);
    given = round_as_kernels_do();
    if (kernels_here()->first_bad_pose(address_of(poses), 16, 0, (int64_t)n, 1, address_of(pose)) < (int64_t)n)
        status = COLLIDE_INVALID_POSE;
    else status = lay_out(made, shapes, poses);
    round_as_before(given);
    made->serial = NEXT_NUMBER(&last_serial);
    if (status == COLLIDE_OK) *compound = made;
    else collide_compound_free(made);
    return status;
}

void collide_compound_free(collide_compound *compound)
{
    if (!IS_HANDLE(compound, COMPOUND_WORD)) return;
    end_handle(&compound->word);
    free(compound->held);
    free(compound);
}

/* --- tables of a pair ------------------------------------------------------------------------------------------------- */

void free_compound_space(struct compound_space *space)
{
    if (space == NULL) return;
    free(space->scratch);
    free(space->tables);
    free(space);
}

static struct compound_space *compound_space_of(collide_workspace *space)
{
    struct compound_space *made;
    const int64_t *m;
    if (space->compound != NULL) return space->compound;
    if ((made = calloc(1, sizeof *made)) == NULL) return NULL;
    m = made->measures;
    if (space->kernels->write_composite_constants(address_of(m), COMPOUND_MEASURES) != COMPOUND_MEASURES || m[U_PART] != PART ||
        m[U_BODY] != BODY || m[U_BODY_INTS] != UNION_BODY || m[U_GROUP] != GROUP || m[U_GROUP_BALL] != GROUP_BALL ||
        m[U_BALL] != BALL_IN_WORLD || m[U_TERM_ROW] != TERM_ROW || m[U_HEADER] != COMPOUND_HEADER || m[U_BLOCK] != BLOCK) {
        free(made);
        return NULL;
    }
    made->header[U_CORE] = space->header[CORE];
    made->header[U_DOUBLES_AT] = space->header[DOUBLES_AT];
    made->header[U_INTEGERS_AT] = space->header[INTEGERS_AT];
    made->header[U_BODIES_AT] = address_of(made->bodies);
    made->header[U_BODY_BALLS_AT] = address_of(made->balls);
    return space->compound = made;
}

/* Room for poses of so many parts; 0 where there is no memory. */
static int fit_compounds(struct compound_space *space, size_t capacity)
{
    const int64_t *m = space->measures;
    size_t rows, list = (size_t)m[U_LIST];
    int64_t *h = space->header;
    void *held;
    double *at;
    if (capacity < LEAST_CAPACITY) capacity = LEAST_CAPACITY;
    if (space->capacity >= capacity) return 1;
    rows = 2 * BLOCK + capacity;
    at = cache_lines(8 * (rows * (POSE + TERM_ROW + 1) + 4 * list + (size_t)(m[U_SCORES] + m[U_SLOTS] + m[U_NEAR]) +
                          (4 + 2 * capacity) * BALL_IN_WORLD) + list * sizeof(collide_pair), &held);
    if (at == NULL) return 0;
    free(space->scratch);
    space->scratch = held;
    space->capacity = capacity;
    h[U_CAPACITY] = (int64_t)capacity;
    h[U_ROWS_AT] = address_of(at); /* rows stand first, on a cache line */
    h[U_POSES_AT] = h[U_ROWS_AT] + (int64_t)(list * sizeof(collide_pair));
    h[U_TERMS_AT] = h[U_POSES_AT] + 8 * POSE * (int64_t)rows;
    h[U_SHAPE_OF_AT] = h[U_TERMS_AT] + 8 * TERM_ROW * (int64_t)rows;
    h[U_PAIRS_AT] = h[U_SHAPE_OF_AT] + 8 * (int64_t)rows;
    h[U_OWNERS_AT] = h[U_PAIRS_AT] + 16 * m[U_LIST];
    h[U_SCORES_AT] = h[U_OWNERS_AT] + 16 * m[U_LIST];
    h[U_SLOTS_AT] = h[U_SCORES_AT] + 8 * m[U_SCORES];
    h[U_NEAR_AT] = h[U_SLOTS_AT] + 8 * m[U_SLOTS];
    h[U_BALLS_AT] = h[U_NEAR_AT] + 8 * m[U_NEAR];
    return 1;
}

struct placed {
    const int64_t *content;
    int64_t *rank;
};

static int by_content(const void *one, const void *other)
{
    return memcmp(((const struct placed *)one)->content, ((const struct placed *)other)->content, 2 * sizeof(int64_t));
}

/* Ranks of parts by content: equal ones have the same. */
static void rank_parts(struct placed *order, size_t n)
{
    size_t k;
    int64_t rank = 0;
    qsort(order, n, sizeof *order, by_content);
    for (k = 0; k < n; k++) {
        if (k > 0 && by_content(&order[k - 1], &order[k]) != 0) rank++;
        *order[k].rank = rank;
    }
}

/* Rows of both bodies' parts, one behind the other. */
static int fill_tables(struct compound_space *space, const collide_compound *const bodies[2])
{
    size_t n = bodies[0]->n + bodies[1]->n, n_groups = bodies[0]->n_groups + bodies[1]->n_groups, first = 0, first_group = 0, k;
    double *memory = malloc(8 * (n * (INTS + NUMBERS + PART + 1) + n_groups * GROUP_BALL) + n * sizeof(struct placed));
    struct placed *order;
    int64_t *ints = (int64_t *)memory, *by_place;
    double *numbers, *parts, *groups;
    int which;
    if (memory == NULL) return 0;
    numbers = memory + n * INTS;
    parts = numbers + n * NUMBERS;
    groups = parts + n * PART;
    by_place = (int64_t *)(groups + n_groups * GROUP_BALL);
    order = (struct placed *)(by_place + n);
    for (which = 0; which < 2; which++) {
        const collide_compound *body = bodies[which];
        int64_t *row = space->bodies + UNION_BODY * which;
        memcpy(ints + INTS * first, body->ints, body->n * INTS * sizeof *ints);
        memcpy(numbers + NUMBERS * first, body->numbers, body->n * NUMBERS * sizeof *numbers);
        memcpy(parts + PART * first, body->parts, body->n * PART * sizeof *parts);
        memcpy(groups + GROUP_BALL * first_group, body->groups, body->n_groups * GROUP_BALL * sizeof *groups);
        memcpy(by_place + first, body->by_place, body->n * sizeof *by_place);
        memcpy(space->balls + BODY * which, body->ball, sizeof body->ball);
        for (k = 0; k < body->n; k++) {
            order[first + k].content = body->shapes[k]->content;
            order[first + k].rank = ints + INTS * (first + k) + RANK;
        }
        row[BODY_FIRST] = (int64_t)first;
        row[BODY_COUNT] = (int64_t)body->n;
        row[BODY_FIRST_GROUP] = (int64_t)first_group;
        row[BODY_GROUPS] = (int64_t)body->n_groups;
        first += body->n;
        first_group += body->n_groups;
    }
    rank_parts(order, n);
    free(space->tables);
    space->tables = memory;
    space->n_parts = n;
    space->header[U_INTS_AT] = address_of(ints);
    space->header[U_NUMBERS_AT] = address_of(numbers);
    space->header[U_PARTS_AT] = address_of(parts);
    space->header[U_BY_PLACE_AT] = address_of(by_place);
    space->header[U_GROUPS_AT] = address_of(groups);
    return 1;
}

collide_status take_compounds(collide_workspace *space, const collide_compound *A, const collide_compound *B)
{
    struct compound_space *unions = compound_space_of(space);
    const collide_compound *bodies[2];
    if (unions == NULL) return COLLIDE_NO_MEMORY;
    if (unions->serials[0] == A->serial && unions->serials[1] == B->serial) return COLLIDE_OK;
    bodies[0] = A;
    bodies[1] = B;
    unions->serials[0] = 0; /* until all is filled in */
    if (!fit_compounds(unions, 2 * (A->n > B->n ? A->n : B->n)) || !fill_tables(unions, bodies)) return COLLIDE_NO_MEMORY;
    unions->serials[0] = A->serial;
    unions->serials[1] = B->serial;
    return COLLIDE_OK;
}
