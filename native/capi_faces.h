/* The faces of a hull as contacts need them. */
#ifndef COLLIDE_CAPI_FACES_H
#define COLLIDE_CAPI_FACES_H

#include "capi_tree.h"

/* A shape's row of faces, as collide/lowering/hull_faces.py has it: counts, then addresses of arrays. */
enum {
    N_VERTICES, FACE_PADDED, N_FACES, FACE_COLUMNS_AT, VERTEX_IDS_AT, NORMALS_AT, FLATNESS_AT, TRIANGLES_AT, STARTS_AT, CORNERS_AT,
    EDGES_AT, FACE_OF_AT, FAN_STARTS_AT, FANS_AT, FACE_INTS
};
/* Corners that the end of a cylinder has (collide/contact/support_face.py: ROUND): no pair has room for fewer. */
enum { ROUND_CORNERS = 8 };

struct hull_faces {
    int64_t ints[FACE_INTS];
    int64_t largest; /* most corners of a face, at least ROUND_CORNERS */
    void *held;
};

/* The faces of a shape that any number of threads may ask about: made by the first of them, and kept with it; NULL of shapes that are
   no hulls. */
collide_status faces_of(const collide_shape *shape, const struct hull_faces **faces);
void free_faces(struct hull_faces *faces);

#endif
