/* Worlds: bodies in columns, the tree over their boxes, and what questions about them take. Python's are in collide/worlds and
   collide/broadphase. */
#ifndef COLLIDE_CAPI_WORLD_H
#define COLLIDE_CAPI_WORLD_H

#include "capi_internal.h"

/* --- layouts; `begin_world` compares their sizes with what the kernels say (collide/casts/world_constants.py) ------------ */

/* A node of the tree (collide/broadphase/graded_boxes.py), and a body's integers and bits (tree_in_memory.py). */
enum { SKIP, BODY, PARENT, LINK };
enum { FLAGS, GROUP, MASK, ALLOWED_AT, TRAITS };
enum { STATIC_BIT = 1, STILL_BIT = 2 };
/* A tree in memory, bodies of single parts (moved_bodies.py), and a tree as rays see it (collide/casts/rays_in_tree.py). */
enum {
    T_NODES_AT, T_LINKS_AT, T_N_NODES, T_N_FIXED, T_BOXES_AT, T_N_BOXES, T_TRAITS_AT, T_ALLOWED_AT, T_N_ALLOWED, T_LEAF_OF_AT,
    T_CHANGED_AT, T_N_CHANGED, TREE_HEADER
};
enum { P_INTS_AT, P_NUMBERS_AT, P_ROW_OF_AT, P_POSES_AT, P_BOXES_AT, P_N_BODIES, P_N_MOVED, SINGLE_PARTS };
enum {
    R_NODES_AT, R_LINKS_AT, R_N_NODES, R_FIRST_AT, R_N_BODIES, R_SKIPPED_AT, R_MESHED_AT, R_UNBOUNDED_AT, R_N_UNBOUNDED,
    RAY_TREE
};
/* Doubles of a question of `boxes_ahead`, and of a ray; integers that a row of allowed pairs takes for each of them at most. */
enum { SWEEP = 10, RAY = 6, ROW_OF_A_KEY = 8 };
/* What `write_world_constants` writes. */
enum {
    W_TREE, W_LINK, W_TRAITS, W_SINGLE_PARTS, W_ROW_OF_A_KEY, W_SWEEP, W_STACK, W_STACK_OF_PAIRS, W_RAY, W_RAY_TREE, W_RAY_DOUBLES,
    W_RAY_INTEGERS, W_HIT_ROW, WORLD_MEASURES
};

/* Trees one behind another: each has more than twice the nodes of the next. */
enum { MAX_SECTIONS = 64 };
enum { MESSAGE = 240 };

/* --- a world -------------------------------------------------------------------------------------------------------- */

/* Distinct shapes, in rows that kernels read; row 0 is a point. */
struct shape_rows {
    int64_t *ints;
    double *numbers;
    const collide_shape **shapes; /* NULL of rows that are free */
    size_t *users;                /* how many bodies have it */
    size_t *order;                /* rows in use, by content and then by address */
    size_t *unused;               /* rows that are free */
    size_t n, n_ordered, n_unused;
};

/* The forest over bodies that have an end: fixed ones first (collide/broadphase/tree_over_bodies.py). */
struct body_tree {
    double *nodes;
    int64_t *links, *scratch;
    int64_t sections[MAX_SECTIONS + 1], n_inner[MAX_SECTIONS], n_fixed;
    double sides[MAX_SECTIONS], least; /* sums of sides of inner nodes, and the least sum since the trees were made [m] */
    size_t n_sections, n_holes;
};

/* What a body is that is asked about as a whole, and a convex set around it, which is the world's; NULL of convex shapes. */
struct whole_body {
    const collide_mesh *mesh;
    const collide_field *field;
    collide_shape *bound;
};

struct collide_world {
    int64_t word;
    const struct collide_kernels *kernels;
    int64_t measures[WORLD_MEASURES];
    /* Columns, a row a body in the order of ids; those of removed bodies stay until they are many. */
    int32_t *ids;
    double *X_WBs, *poses, *boxes, *widened; /* widened : boxes with room for margins, where there are some */
    struct whole_body *wholes;
    int64_t *row_of, *traits, *leaf_of, *changed, *first, *is_whole, *unbounded, *numbers;
    uint8_t *is_moved, *is_alive;
    size_t n, n_alive, capacity, n_unbounded;
    int64_t n_changed;
    int32_t next_id;
    struct shape_rows table;
    struct body_tree tree;
    /* Pairs never tested: keys both ways round, ascending, and rows of them as kernels read them. */
    int64_t *allowed_keys, *allowed_rows;
    size_t n_allowed_keys, n_allowed, allowed_capacity;
    /* Margins of bodies [m], and keys of pairs with their own, ascending; what boxes of bodies are widened by, and the most of it. */
    double *margins, *pair_margins, *spread, widest;
    int64_t *margin_keys;
    size_t n_margin_keys, margin_capacity;
    collide_shape *point;
    char message[MESSAGE];
};

/* What questions about worlds take beside a workspace: lists that grow, and a block of pairs. */
struct world_space {
    int64_t *keys, *sorted, *pairs, *counts, *stack, *skipped;
    double *bounds, *rays, *flat_nodes;
    int64_t *flat_links; /* of a tree of leaves side by side */
    collide_contact *contacts;
    size_t n_keys, n_counts, n_contacts, n_flat;
    double X_WA[16 * BLOCK], X_WB[16 * BLOCK];
    int64_t which[2 * BLOCK];
    collide_pair rows[BLOCK];
    uint8_t hits[BLOCK];
};

static inline int is_whole_key(const collide_world *world, int64_t key)
{
    return world->is_whole[key >> 32] != 0 || world->is_whole[key & 0xffffffff] != 0;
}

/* Write a sentence, and return the status. */
collide_status refuse(char *message, collide_status status, const char *format, ...);

collide_status refuse_pair(const collide_world *world, collide_workspace *space, int64_t key, collide_status status);

static inline int64_t key_of(int64_t i, int64_t j) { return i < j ? i << 32 | j : j << 32 | i; }
static inline int64_t first_of(int64_t key) { return key >> 32; }
static inline int64_t second_of(int64_t key) { return key & 0xffffffff; }

/* capi_world.c: memory for n items, 0 where there is none; the row of a body, -1 of unknown ids; whether ids, or both ids of
   pairs, are those of bodies. */
int resize(void *place, size_t n, size_t bytes);
int64_t row_of_id(const collide_world *world, int32_t id);
collide_status check_ids(collide_world *world, const char *caller, const char *what, const int32_t *ids, size_t n);
collide_status check_pairs(collide_world *world, const char *caller, const int32_t *pairs, size_t n);

/* capi_world_margins.c: a margin [m] and that of a pair, its own or the sum of both bodies'. After a change of margins how far boxes
   spread; a body that is removed; a box that has changed. */
double reach_of_key(const collide_world *world, int64_t key, double margin);
void spread_margins(collide_world *world);
void forget_margins(collide_world *world, int64_t body);
void widen_box(collide_world *world, int64_t body);

/* Boxes that the tree is over, with room for margins: two of them come within a distance wherever bodies come within that and their
   margin. */
static inline double *tree_boxes(const collide_world *world) { return world->widest > 0.0 ? world->widened : world->boxes; }

/* capi_world_shapes.c: rows of shapes for one more user, with room for it; and one user less. */
int64_t take_shape(struct shape_rows *table, const collide_shape *shape);
void leave_shape(struct shape_rows *table, int64_t row);
static inline const collide_shape *shape_of_body(const collide_world *world, int64_t body)
{
    return world->table.shapes[world->row_of[body]];
}

/* capi_world_tree.c: the tree as kernels take it; what changes of bodies do to it, whose memory is there. */
void tree_header(const collide_world *world, int64_t header[TREE_HEADER]);
void make_trees(collide_world *world);
void add_to_trees(collide_world *world, size_t first);
void take_from_trees(collide_world *world, int64_t body);
/* Poses and boxes of the bodies whose flags are set; with_tree: of bodies that are in it. All leaves by other margins. */
void move_flagged(collide_world *world, int with_tree);
void widen_leaves(collide_world *world);
/* The mean side of an inner node [m]: how far apart bodies are. */
double spacing_of(const struct body_tree *tree);

/* capi_world_pairs.c: what every question begins with: arguments that are good, and memory. */
collide_status check_question(const collide_world *world, collide_workspace *space, const char *caller, int is_good,
                              const char *what);
collide_status no_memory(collide_workspace *space);
/* COLLIDE_TOO_MANY, and how many there are, where there is no room for all. */
collide_status too_many(collide_workspace *space, size_t count, size_t capacity);
/* Room for so many keys; 0 where there is none. */
int fit_keys(struct world_space *own, size_t n);
/* Sort keys of bodies below n, of which there are counts. */
void sort_keys(struct world_space *own, size_t n_keys, size_t n);
/* Answer up to BLOCK keys of bodies, or of a point and bodies where X_WP is not NULL, into own->hits or own->rows. */
collide_status answer_keys(const collide_world *world, collide_workspace *space, const int64_t *keys, size_t n, const double *X_WP,
                           int boolean, double limit);

/* capi_world_pairs.c: what may come first, a pair or a body, and no sooner than a bound by boxes; in the order of bounds, then keys. */
struct candidate {
    double bound;
    int64_t key;
};
int compare_candidates(const void *one, const void *other);

/* capi_world_outside.c: the box around a shape at a pose; into own->skipped 1 for each body that a question leaves out, and whether
   there is any; the row of question k while nothing is met, and where it is left open; a direction that is none. */
void box_around(const collide_world *world, const collide_shape *shape, const double *X_WS, double box[6]);
int skip_bodies(const collide_world *world, struct world_space *own, const uint32_t *group, const uint32_t *mask);
collide_world_hit nothing_met(size_t k);
void leave_open(collide_world_hit *hit);
collide_status refuse_direction(collide_workspace *space, const char *caller, size_t k);
/* How many bodies, of those not skipped, are in the way of a moved box, or may be nearest to a point: into own->keys, and own->bounds, of
   t or distance from below.   n_leaves : of leaves side by side, or -1 for the tree. */
size_t bodies_ahead(const collide_world *world, struct world_space *own, const double question[SWEEP], int of_points, int64_t n_leaves);

/* capi_world_rays.c: the row of a ray, origin and vector, by n pairs (0, body) of the bodies that it may meet first; those that kernels
   leave open are COLLIDE_UNSUPPORTED. */
collide_status settle_ray(const collide_world *world, collide_workspace *space, const double *ray, int64_t exponent, double limit,
                          const int64_t *pairs, int64_t n, collide_world_hit *hit);

/* capi_world_wholes.c: what a body is, "a voxel grid". */
const char *kind_of_body(const collide_world *world, int64_t body);

/* capi_world_wholes.c: whether a body's shape, mesh or field, the others of which are NULL, was not freed. */
int is_alive(const collide_shape *shape, const collide_mesh *mesh, const collide_field *field);

/* capi_world_wholes.c: what a body with a mesh or a field is, as it is added. And a pair with such a body: whether it meets, or its
   row; what the pair queries of this interface do not answer is COLLIDE_UNSUPPORTED, and the bodies are named. */
collide_status make_whole(const collide_mesh *mesh, const collide_field *field, struct whole_body *whole);
collide_status whole_meets(const collide_world *world, collide_workspace *space, int64_t key, uint8_t *hit);
collide_status row_of_whole(const collide_world *world, collide_workspace *space, int64_t key, double limit, collide_pair *row);
/* The row of a shape from outside and a body that is a mesh or a field. */
collide_status row_from_outside(const collide_world *world, collide_workspace *space, const collide_shape *shape, const double *X_WS,
                                int64_t body, double limit, collide_pair *row);
/* Contacts of such a pair of meshes, of a mesh and a polytope or a ball, or of a field and a shape; COLLIDE_TOO_MANY where `capacity` may not do. */
collide_status contacts_of_whole(const collide_world *world, collide_workspace *space, int64_t key, double margin,
                                 size_t max_contacts, collide_contact *rows, size_t capacity, size_t *n);


#endif
