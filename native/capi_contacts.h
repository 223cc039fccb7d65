/* Contacts of a pair whose rows of tables stand in a workspace. */
#ifndef COLLIDE_CAPI_CONTACTS_H
#define COLLIDE_CAPI_CONTACTS_H

#include "capi_faces.h"

/* Header of manifolds, as collide/contact/convex_manifolds.py has it. Before it stands that of queries
   (collide/contact/single_contact_call.py). */
enum {
    F_INTS_AT, F_NUMBERS_AT, F_FACES_AT, F_POSES_AT, F_SHAPE_OF_AT, F_DOUBLES_AT, F_INTEGERS_AT, F_LARGEST, F_PAIRS_DONE,
    F_ROWS_DONE, F_MARGIN, F_MAX_CONTACTS, MANIFOLD_HEADER
};

/* What contacts take beside a workspace, with which it goes. */
struct manifold_space {
    int64_t header[HEADER + MANIFOLD_HEADER];
    int64_t faces[2 * FACE_INTS];
    double poses[2 * POSE];
    int64_t shape_of[2];
    void *held;
};

/* Begin one that is zeroed, and free it. */
void begin_manifolds(struct manifold_space *manifold, collide_workspace *space);
void free_manifolds(struct manifold_space *manifold);

/* Room for faces of so many corners; 0 where there is no memory. */
int fit_manifolds(struct manifold_space *manifold, int64_t largest);

/* The pair that is asked about: rows of a table of shapes and of a table of faces. */
void take_table_pair(collide_workspace *space, struct manifold_space *manifold, const int64_t *ints, const double *numbers,
                     const int64_t *faces, int64_t a, int64_t b);

/* Contacts of the pair taken, at most `max_contacts`, into `rows`, which has room for as many; *n : how many. flags : as of
   `collide_contacts`. */
collide_status contacts_of_pair(collide_workspace *space, struct manifold_space *manifold, const double *X_WA, const double *X_WB,
                                double margin, int64_t max_contacts, unsigned flags, collide_contact *rows, int64_t *n);

/* capi_contact_queries.c: contacts of two shapes; COLLIDE_TOO_MANY where `capacity` may not do. */
collide_status contacts_of_shapes(collide_workspace *space, const collide_shape *A, const collide_shape *B, const double *X_WA,
                                  const double *X_WB, double margin, size_t max_contacts, unsigned flags,
                                  collide_contact *rows, size_t capacity, size_t *count);

/* Whether the pair taken is proven to be farther apart than `gap`, and the direction that parts them. */
int is_farther_apart(collide_workspace *space, const double *X_WA, const double *X_WB, double gap, double direction[3]);

/* capi_axis.c: by how much two rows of a table of shapes are apart at least, along a direction of length about 1; of a half-space
   along its normal, which must be its z axis. Proven; negative, or infinitely so, where that tells nothing. */
double gap_along(const int64_t *ints_a, const double *numbers_a, const double *X_WA, const int64_t *ints_b,
                 const double *numbers_b, const double *X_WB, const double direction[3]);

/* capi_pairs.c: the boolean of the pair taken, into the workspace's first row. */
collide_status meet_of_pair(collide_workspace *space, const double *X_WA, const double *X_WB, unsigned flags);

/* capi_pairs.c: the row of `collide_distance` of the pair taken, with a proven bound where it is beyond the limit. */
collide_status row_of_pair(collide_workspace *space, const double *X_WA, const double *X_WB, double limit, unsigned flags,
                           collide_pair *row);
/* The same before depths that nobody asked for are taken out, with a point of each body. */
collide_status unfinished_row_of_pair(collide_workspace *space, const double *X_WA, const double *X_WB, double limit, unsigned flags,
                                      collide_pair *row);

/* Whether two convex shapes come within a margin, up to which their row was asked (capi_within.c). */
collide_status within_by_row(collide_workspace *space, const collide_shape *A, const collide_shape *B, const double *X_WA,
                             const double *X_WB, double margin, unsigned trust, const collide_pair *row, uint8_t *within);

#endif
