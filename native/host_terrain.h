/* Contacts of a height field and a convex body, for host_mujoco.c; no part of the C interface.

   The field is what MuJoCo takes it for: under every triangle of the grid a prism down to the base. */
#ifndef COLLIDE_HOST_TERRAIN_H
#define COLLIDE_HOST_TERRAIN_H

#include "capi_contacts.h"

/* A field of n_rows x n_columns grid points. Row i, column j stands at x = dx j - size[0], y = dy i - size[1],
   z = size[2] heights[n_columns i + j] of its frame H; the base at z = -size[3]. */
struct terrain {
    const float *heights;
    int64_t n_rows, n_columns;
    double size[4], dx, dy;
    double walls[2][3][2]; /* of triangles t, below the edges from corner k to the next: unit normals from above, inward */
};

/* The rest of a field whose heights, counts and size are set. */
void lay_out_terrain(struct terrain *terrain);

/* Triangle t of cell (i, j): 0 between the grid points (i, j), (i, j + 1), (i + 1, j + 1), 1 between (i, j), (i + 1, j + 1),
   (i + 1, j); counter-clockwise from above. */
struct terrain_facet {
    int64_t i, j;
    int t;
    double v[3][3]; /* corners [m] */
    double n[3];    /* unit normal, upwards */
    const double (*walls)[2];
};

enum { EXTREMES = 14 };

/* A question: the second body is row `b` of tables as `take_table_pair` has them. */
struct terrain_pair {
    const struct terrain *terrain;
    const int64_t *ints, *faces, *extremes; /* extremes : (n, EXTREMES) vertices of large hulls that are farthest along some directions */
    const double *numbers, *boxes, *X_WH, *X_WB; /* boxes : (n, 6) of hulls: middles and half sides */
    int64_t b;
    double margin;
};

/* A convex body seen from H. */
struct terrain_body {
    const int64_t *ints;
    const double *numbers;
    const int64_t *faces;
    int64_t *vertex; /* of a large hull: where the last search ended */
    double R_HB[9], p_HB[3];
    double low[3], high[3]; /* its box along the axes of H */
    double reach;
    int is_capsule, is_large;
    int is_round;           /* a ball or an ellipsoid: it touches at one point */
};

struct terrain_facet facet_at(const struct terrain *terrain, int64_t i, int64_t j, int t);

/* vertex : a place of its own. */
struct terrain_body body_seen_from(const struct terrain_pair *pair, int64_t *vertex);

/* The point of a body farthest along a unit vector of H; how far that is. */
double body_support(const struct terrain_body *body, const double n[3], double point[3]);

/* Other points of a body that may touch, where the one lowest along n does, are higher than it by this at least [m]. */
double height_of_next(const struct terrain_body *body, const double n[3]);

/* The point of a capsule's axis nearest to p. */
void nearest_on_axis(const struct terrain_body *body, const double p[3], double nearest[3]);

/* How far a body reaches along a unit vector of H, and back along it, at most. */
void body_extent(const struct terrain_pair *pair, const struct terrain_body *body, const double n[3], double *low, double *high);

/* How far a point is from a body, negative within it, and the unit vector from the point to what is nearest: which way the body has to go;
   0 where that is not known here, or farther than the limit. */
int distance_to_point(const struct terrain_body *body, const double p[3], double limit, double n[3], double *distance);

/* The point of a facet nearest to p. */
void nearest_on_facet(const struct terrain_facet *facet, const double p[3], double nearest[3]);

/* Least height of a body along n, less the greatest of a facet: how far n parts them. */
double facet_gap_along(const struct terrain_facet *facet, const double n[3], double lowest);

/* How far a point is from the nearest wall of a facet's prism, seen from above; negative outside. */
double depth_in_walls(const struct terrain_facet *facet, const double p[3]);

void grid_point(const struct terrain *terrain, int64_t i, int64_t j, double p[3]);

/* The first of n lines of the grid at or beyond x, in cells. */
int64_t line_at(double x, int64_t n);

/* Whether a grid point around one is farther along n than p, which is at that one. */
int ring_rises(const struct terrain *terrain, int64_t i, int64_t j, const double p[3], const double n[3], double tolerance);

/* Whether n leaves the field at right angles from a point of a facet's prism: no part of the field around the point is farther
   along n. tolerance : of places [m]. */
int leaves_terrain(const struct terrain *terrain, const struct terrain_facet *facet, const double p[3], const double n[3],
                   double tolerance);

/* What contacts with fields take beside a workspace: zeroed to begin with. */
struct terrain_space;
struct terrain_space *begin_terrain_space(void); /* NULL where there is no memory */
void free_terrain_space(struct terrain_space *terrain_space);

/* Whether the body is proven to be farther from the field than the margin. */
int is_off_terrain(const struct terrain_pair *pair);

/* Contacts, at most `max_contacts`, into `rows`; *n : how many. With a margin beyond the body's own size and nothing that touches, the
   nearest alone. */
collide_status terrain_contacts(struct terrain_space *terrain_space, collide_workspace *space, struct manifold_space *manifold,
                                const struct terrain_pair *pair, int64_t max_contacts, collide_contact *rows, int64_t *n);

#endif
