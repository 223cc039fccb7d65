/* What the files of contacts with height fields share. */
#ifndef COLLIDE_HOST_TERRAIN_TASK_H
#define COLLIDE_HOST_TERRAIN_TASK_H

#include "host_terrain.h"

enum { MAX_ROWS = 512, MAX_TOUCHES = 128, PER_FACET = 16, MANIFOLD_ROWS = 64, PER_PATCH = 8, MAX_TRIED = 64, HULL_POINTS = 64, MAX_HULLS = 8 };
enum { PRISM_POINTS = 6, PRISM_FACES = 5, PRISM_CORNERS = 18 };
/* Normals nearer to each other than this cosine are one. */
#define SAME_NORMAL (1.0 - 1e-9)
/* Places are good to this part of the sizes in play. */
#define PLACES 1e-7

/* A facet within the margin of a body, as far as its own plane tells. */
struct near_facet {
    double gap, support[3];  /* along its normal, and the body's point nearest to its plane */
    double n[3], p[3], depth; /* where it is hit, the way out of the prism alone, from a point of it */
    struct terrain_facet facet;
    int32_t is_hit;          /* hit : the prism overlaps, along a direction that does not leave the field */
    int32_t is_in_hull;
};

/* A contact that is known, in H: a normal, a point of the field, the distance there, the body's least height. */
struct touch {
    double n[3], p[3], distance, lowest;
    struct terrain_facet facet; /* one that it was found at */
    int is_point; /* the body has no more than a point within the margin */
};

struct terrain_space {
    double block[3 * COORDINATES + 7]; /* of a prism: coordinates, from a cache line's beginning */
    double normals[3 * PRISM_FACES], flatness[PRISM_FACES];
    int64_t ids[PRISM_POINTS], triangles[PRISM_FACES], starts[PRISM_FACES + 1], corners[PRISM_CORNERS], edges[PRISM_CORNERS],
        face_of[PRISM_CORNERS], fan_starts[PRISM_POINTS + 1], fans[PRISM_CORNERS];
    double hull[3 * HULL_POINTS + 7];
    struct near_facet *near;
    size_t n_near, capacity;
    struct touch touches[MAX_TOUCHES];
    int n_touches, n_rows;
    collide_contact rows[MAX_ROWS], found[MANIFOLD_ROWS];
};

/* What a question has in hand. */
struct task {
    const struct terrain_pair *pair;
    struct terrain_space *own;
    collide_workspace *space;
    struct manifold_space *manifold;
    struct terrain_body body;
    double tolerance; /* of places [m] */
};

static inline double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline double square_between(const double a[3], const double b[3])
{
    double e[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return dot3(e, e);
}

static inline void turn_to_world(const double *X_WH, const double v[3], double out[3])
{
    int k;
    for (k = 0; k < 3; k++) out[k] = X_WH[4 * k] * v[0] + X_WH[4 * k + 1] * v[1] + X_WH[4 * k + 2] * v[2];
}

static inline void turn_from_world(const double *X_WH, const double v[3], double out[3])
{
    int k;
    for (k = 0; k < 3; k++) out[k] = X_WH[k] * v[0] + X_WH[4 + k] * v[1] + X_WH[8 + k] * v[2];
}

static inline void point_to_world(const double *X_WH, const double p[3], double out[3])
{
    int k;
    turn_to_world(X_WH, p, out);
    for (k = 0; k < 3; k++) out[k] += X_WH[4 * k + 3];
}

static inline void point_from_world(const double *X_WH, const double p[3], double out[3])
{
    double away[3] = {p[0] - X_WH[3], p[1] - X_WH[7], p[2] - X_WH[11]};
    turn_from_world(X_WH, away, out);
}

/* host_terrain_near.c: facets that no direction tried there proves to be farther from the body than `margin`, into own->near; where own
   is NULL, 1 at the first of them. -1 where there is no memory. */
int find_near(const struct terrain_pair *pair, const struct terrain_body *body, double margin, struct terrain_space *own);
/* The same, behind those that are in own->near. */
int add_near(const struct terrain_pair *pair, const struct terrain_body *body, double margin, struct terrain_space *own);

/* host_terrain_prisms.c: have the second body, once a question, and the prism below a facet take their places in the workspace. */
void take_body(const struct task *task);
void take_prism(const struct task *task, const struct terrain_facet *facet);
/* The least translation out of the hull of all facets that are chosen and what is below them: its normal in H; 0 where there is none. */
int way_out_of_hull(const struct task *task, double n[3]);

/* host_terrain.c: what a body shows along a normal over the facet that is taken. point_a, point_b : NULL, or nearest points, `distance`
   apart. */
void add_manifold(const struct task *task, const double n[3], const double *point_a, const double *point_b, double distance);

/* host_terrain.c: whether contacts that are known say all of a facet: it is apart along one of their normals; or it lies beside the facet
   of one, or on its plane, and is no deeper along its normal. Then it may add points along that. */
int is_accounted_for(const struct task *task, const struct terrain_facet *facet);

/* host_terrain_deep.c: one more contact, where facets are hit that no contact accounts for. */
void put_deep_contact(const struct task *task);

/* host_terrain_rows.c: keep rows that are within the margin and not there yet. */
void keep_rows(const struct task *task, const collide_contact *rows, int64_t n);
/* Of the rows kept those that tell most, patch after patch, the deepest first; how many. */
int64_t take_rows(const struct task *task, int64_t max_contacts, collide_contact *rows);

#endif
