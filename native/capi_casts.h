/* Rows of casts and rays, and the room of a workspace for them. */
#ifndef COLLIDE_CAPI_CASTS_H
#define COLLIDE_CAPI_CASTS_H

#include "capi_internal.h"

/* A question and a row (collide/casts/cast_pairs.py), and how rows end (collide/casts/portal.py). */
enum { CAST_LIMIT = 3, CAST_QUESTION };
enum {
    CAST_STATUS, CAST_LOWER, CAST_VALUE, CAST_UPPER, CAST_NORMAL, CAST_TOUCHING = CAST_NORMAL + 3, CAST_SIZE = CAST_TOUCHING + 3, CAST_ROW
};
enum { CAST_MISS, CAST_HIT };
/* Marks of a row, and doubles that a pace is the sum of (collide/casts/close_casts.py). */
enum { IS_PROVEN, IS_CERTIFIED, IS_AT_START, CAST_MARKS, PACE_TERMS = 144 };
/* A ray and the row of a chord (collide/casts/cut_parts.py). */
enum { RAY_ORIGIN, RAY_VECTOR = 3, CHORD_RAY = 6 };
enum {
    CHORD_STATE, FIRST_LOWER, FIRST_VALUE, FIRST_UPPER, LAST_LOWER, LAST_VALUE, LAST_UPPER, FIRST_SIDE, LAST_SIDE, FIRST_NORMAL,
    LAST_NORMAL = FIRST_NORMAL + 3, CHORD_ROW = LAST_NORMAL + 3
};
/* What `write_cast_constants` writes (collide/casts/cast_constants.py). */
enum { K_QUESTION, K_CAST_ROW, K_MARKS, K_PACE_TERMS, K_RAY, K_CHORD_ROW, K_DOUBLES, K_INTEGERS, K_FACET_RAY, K_FACET_HIT, K_UNION_HEADER, K_UNION_WORK, K_UNION_ROW, CAST_MEASURES };
/* A ray to facets, and a hit (collide/narrowphase/facets/ray_surface.py). */
enum { FACET_RAY = 8 };
enum { HIT_RAY, HIT_FACET, HIT_LOWER, HIT_VALUE, HIT_UPPER, HIT_OPEN, HIT_PLACE, FACET_HIT };

/* Header of casts of unions before that of unions, words to work in, and an answer (collide/casts/union_cast.py). */
enum { UNION_CASTS = 4, UNION_HEADER = UNION_CASTS + 29, UNION_WORK = 165 };
enum { UNION_T, UNION_NORMAL = 3, UNION_POINT = 6, UNION_PART_A = 9, UNION_PART_B, UNION_AT_START, UNION_ROW };

struct cast_space {
    double question[CAST_QUESTION], row[CAST_ROW], terms[PACE_TERMS];
    double ray[CHORD_RAY];
    int64_t exponent, listed;
    int64_t union_header[UNION_HEADER];
    double union_work[UNION_WORK], union_row[UNION_ROW];
    uint8_t marks[CAST_MARKS];
    double *doubles;
    int64_t *integers;
};

/* The workspace's room for casts, made at the first of them; NULL where there is no memory, or the library's parts do not fit. */
struct cast_space *cast_space_of(collide_workspace *space);

/* What meets nothing, proven. */
void begin_contact(collide_first_contact *first);

/* A direction scaled by a power of two into `vector`, 2^-*exponent; 0 where it is none. */
int take_direction(const collide_workspace *space, const double direction[3], double vector[3], int64_t *exponent);

/* Whether a matrix is a pose, which then stands in row `row` of the workspace's poses. */
int put_pose(collide_workspace *space, const double *X, unsigned flags, int row);

#endif
