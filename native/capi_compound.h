/* Between the files of unions: bodies of convex parts, as collide/lowering/compound_table.py lays them out. */
#ifndef COLLIDE_CAPI_COMPOUND_H
#define COLLIDE_CAPI_COMPOUND_H

#include "capi_internal.h"

/* Integers of a body: its parts and groups among those of a pair. */
enum { BODY_FIRST, BODY_COUNT, BODY_FIRST_GROUP, BODY_GROUPS, UNION_BODY };
/* Doubles of a body, and of a group; how many stand in a group; doubles of a ball in the world. */
enum { BODY = 6, GROUP_BALL = 11, GROUP = 4, BALL_IN_WORLD = 5, TERM_ROW = 96 };
/* Header of questions (collide/narrowphase/composite/composite_block.py). */
enum {
    U_CORE, U_INTS_AT, U_NUMBERS_AT, U_PARTS_AT, U_BODIES_AT, U_BODY_BALLS_AT, U_BY_PLACE_AT, U_GROUPS_AT, U_POSES_AT, U_TERMS_AT,
    U_SHAPE_OF_AT, U_PAIRS_AT, U_OWNERS_AT, U_ROWS_AT, U_SCORES_AT, U_SLOTS_AT, U_BALLS_AT, U_NEAR_AT, U_DOUBLES_AT, U_INTEGERS_AT,
    U_CAPACITY, U_AT_ONCE, U_N_DONE, U_N_LISTED = U_N_DONE + 5, COMPOUND_HEADER = U_N_LISTED + 2
};
/* What `write_composite_constants` writes (collide/narrowphase/composite/composite_constants.py). */
enum {
    U_PART, U_BODY, U_BODY_INTS, U_GROUP, U_GROUP_BALL, U_BALL, U_TERM_ROW, U_HEADER, U_BLOCK, U_LIST, U_NEAR, U_SLOTS, U_SCORES,
    COMPOUND_MEASURES
};

struct collide_compound {
    int64_t word;
    size_t n, n_groups;
    int64_t serial;               /* no two have the same */
    const collide_shape **shapes; /* of the parts */
    int64_t *ints;                /* their rows, ranks left 0 */
    double *numbers;
    double *parts, *groups, ball[BODY];
    int64_t *by_place;
    int is_whole; /* a single part that stands where the body does */
    void *held;
};

/* What questions about unions take beside a workspace: the tables of the pair asked about last, and room for its poses. */
struct compound_space {
    int64_t header[COMPOUND_HEADER], measures[COMPOUND_MEASURES], bodies[2 * UNION_BODY];
    int64_t serials[2];
    double balls[2 * BODY];
    size_t capacity, n_parts; /* of the unions, and of the tables: rows of parts */
    void *scratch, *tables;
};

/* The tables of a pair, or why there are none. */
collide_status take_compounds(collide_workspace *space, const collide_compound *A, const collide_compound *B);
void free_compound_space(struct compound_space *space);

/* capi_compound_contacts.c */
void free_compound_contacts(struct compound_contact_space *space);

#endif
