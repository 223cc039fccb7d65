/* What the files of the C interface share. */
#ifndef COLLIDE_CAPI_INTERNAL_H
#define COLLIDE_CAPI_INTERNAL_H

#define COLLIDE_BUILDING
#include "collide.h"
#include "kernels.h"
#include "kernels_of_level.h"

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF /* products and sums round separately, as in the kernels */
#endif

#include <math.h>
#include <string.h>
#define INFINITE HUGE_VAL

/* --- layouts, as Python's modules have them; `workspace_sizes` compares them with what the kernels say --------------- */

/* A row of integers a shape (collide/lowering/shape_table.py), a row of doubles, and a posed part. */
enum { KIND, COUNT, PADDED, ADDRESS, LOWEST, RANK, TREE, COARSE_AT, INTS };
enum { RADIUS, REACH, SLOP, PARAMS, NUMBERS = PARAMS + 4 };
enum { POSE = 15 };
/* Doubles of a part in the frame of its body (collide/lowering/compound_table.py). */
enum { PART = 19 };
/* Kinds (collide/lowering/packed_convex.py), doubles of a block of coordinates, and the exponent where no bit is set. */
enum { POINTS, CYLINDER, CONE, ELLIPSOID, HALFSPACE };
enum { COORDINATES = 8, NO_BITS = 2000 };
/* Header of queries (collide/narrowphase/pose_batches.py), poses that go through together, and what `answer_poses` says. */
enum {
    CORE, INTS_AT, NUMBERS_AT, POSES_AT, SHAPE_OF_AT, PAIRS_AT, ROWS_AT, DOUBLES_AT, INTEGERS_AT, SETTLE, STEPS_AT, DIGITS_AT,
    ANSWERED,
    HEADER
};
enum { BLOCK = 64, OPEN = 1, BAD_POSE = 2 };
/* A pair that the kernels refuse to measure (collide/results.py). */
enum { REFUSED = 255 };

/* Pairs of boxes that wait on the way down two meshes' trees, and those that wait in order: as in
   collide/narrowphase/facets/facet_queries.py. A tree is 136 nodes deep at most. */
enum { STACK_OF_MESHES = 8 * (2 * 136 + 4), HEAP_OF_MESHES = 1 << 14 };

/* What `write_constants` writes (collide/narrowphase/c_constants.py). */
enum {
    M_DOUBLES, M_INTEGERS, M_REQUESTS_AT, M_WORKSPACE, M_BLOCK, M_HEADER, M_INTS, M_NUMBERS, M_POSE, M_ROW, M_COARSE,
    M_HULL_EACH, M_HULL_FIXED,
    M_NODE, M_SLAB, M_WIDTH, M_TREE_INTS, M_TREE_NUMBERS, M_RECORD, M_TREE_WORK, M_DEEPEST_SPLIT,
    M_COUNTS,
    M_MESH_HEADER, M_MESH_DOUBLES, M_MESH_INTEGERS, M_MESH_SCRATCH, M_DIGEST,
    M_POINT_WORK, M_POINT_WORK_BESIDES, M_POINT_LEVELS, M_CELL_HEADER, M_CELL_NUMBERS, M_CELL_STACK, M_WALK_HEADER, M_PROBE, MEASURES
};

/* Integers that a digest is worked out in (collide/numerics/number_digest.py). */
enum { DIGEST_WORDS = 24 };

/* Sizes of things: nothing is larger, or a product of such would overflow. */
#define LARGEST 1e50
#define SMALLEST 1e-50
static inline int is_length(double value) { return value >= SMALLEST && value <= LARGEST; }
static inline int is_coordinate(double value) { return fabs(value) <= LARGEST; }

static inline int64_t address_of(const void *place) { return (int64_t)(intptr_t)place; }

/* Put what was made where others may look for it, unless another thread was sooner; whether it was not. */
#if defined(_MSC_VER)
#include <intrin.h>
#define PUT_IF_NULL(place, made) (_InterlockedCompareExchangePointer((void *volatile *)(place), (made), NULL) == NULL)
#else
#define PUT_IF_NULL(place, made) __sync_bool_compare_and_swap((place), NULL, (made))
#endif

/* What n single calls of a batch return: each into `statuses`, unless that is NULL; the first that is not COLLIDE_OK is `worst`. */
struct batch_statuses {
    collide_status *statuses, worst;
    size_t blamed;
};
static inline void put_status(struct batch_statuses *of, size_t k, collide_status status)
{
    if (of->statuses != NULL) of->statuses[k] = status;
    if (status == COLLIDE_OK || of->worst != COLLIDE_OK) return;
    of->worst = status;
    of->blamed = k;
}
static inline collide_status end_batch(const struct batch_statuses *of, size_t *failed)
{
    if (failed != NULL) *failed = of->blamed;
    return of->worst;
}

/* As many contacts to the caller as there is room for, who may have none: then contacts is NULL. */
static inline void hand_out_contacts(const collide_contact *rows, size_t count, collide_contact *contacts, size_t capacity)
{
    if (count > capacity) count = capacity;
    if (count > 0) memcpy(contacts, rows, count * sizeof *rows);
}

/* The first word of what a handle points to, which loses it when it is freed: by it a freed handle, or one of another type, is
   refused, for as long as nothing else stands in its memory. */
enum handle_word {
    SHAPE_WORD = 0x5afe5001, SET_WORD, COMPOUND_WORD, MESH_WORD, FIELD_WORD, WORLD_WORD, ROBOT_WORD, WORKSPACE_WORD, ROBOT_SPACE_WORD
};
#define IS_HANDLE(handle, its_word) ((handle) != NULL && (handle)->word == (its_word))
/* volatile: a compiler leaves out what is written to memory that is freed next. */
static inline void end_handle(volatile int64_t *word) { *word = 0; }

/* A kernel's address, as other kernels take it, from where a table holds it. */
static inline int64_t code_at(const void *function)
{
    int64_t code = 0;
    memcpy(&code, function, sizeof(void (*)(void)));
    return code;
}

/* --- shapes -------------------------------------------------------------------------------------------------------- */

struct mesh_workspace;
struct field_workspace;
struct hull_faces;
struct manifold_space;
struct cast_space;
struct impact_space;
struct compound_space;
struct mesh_contact_space;
struct compound_contact_space;
struct curved_contact_space;
struct collide_mesh;
struct world_space;

struct collide_shape {
    int64_t word;
    int64_t ints[INTS];
    double numbers[NUMBERS];
    int64_t content[2]; /* digest of the numbers: its bytes order the bodies of a pair */
    double *points;     /* (n, 3), of hulls; else NULL */
    void *block;        /* holds coordinates and coarse points */
    void *tree;         /* NULL where there is none */
    struct hull_faces *volatile faces; /* NULL until contacts are asked for (capi_faces.h) */
    struct collide_mesh *volatile surface; /* NULL until rays are asked for, or a world asks about it with a mesh (capi_mesh.c) */
};

struct collide_shape_set {
    int64_t word;
    int64_t *ints;
    double *numbers;
    const collide_shape **shapes;
    size_t count;
};

/* capi_shapes.c: the convex set of a row of a table: a kind, NUMBERS doubles, n points. */
collide_status shape_of_row(int64_t kind, const double *numbers, const double *points, size_t n, int may_have_tree,
                            collide_shape **shape);

/* capi_faces.c: points of a hull, one after another, as they were given; NULL where there is no memory. */
struct arena;
double *points_of_hull(const collide_shape *shape, struct arena *arena);

/* capi_tree.c: a support tree of n points (n, 3), which are kept; *tree stays NULL where the hull is too small for
   one. */
collide_status build_tree(const struct collide_kernels *kernels, const double *points, size_t n, void **tree);

/* --- kernels and workspaces ---------------------------------------------------------------------------------------- */

/* The kernels for this processor; NULL where there are none. */
const struct collide_kernels *kernels_here(void);

/* The measures; 0 where the library's parts do not fit each other. */
int workspace_sizes(const struct collide_kernels *kernels, int64_t measures[MEASURES]);

/* Zeroed memory that begins where a cache line does; *held is what to free. NULL where there is none. */
void *cache_lines(size_t bytes, void **held);

struct collide_workspace {
    int64_t word;
    int64_t header[HEADER];
    int64_t ints[2 * INTS]; /* the table of a single pair */
    double numbers[2 * NUMBERS];
    const struct collide_kernels *kernels;
    int64_t requests_at; /* an address */
    double *poses;     /* 2 * BLOCK rows */
    int64_t *shape_of; /* 2 * BLOCK */
    int64_t *pairs;    /* BLOCK pairs of parts */
    collide_pair *rows;
    int64_t steps[3]; /* addresses of what `settle_exactly` calls */
    struct mesh_workspace *mesh;
    struct field_workspace *field;
    struct manifold_space *manifold; /* of contacts; NULL until some are asked for */
    struct cast_space *cast; /* of casts and rays; NULL until some are asked for */
    struct impact_space *impact; /* of motions; NULL until some are asked for */
    struct compound_space *compound; /* of unions; NULL until some are asked about */
    struct mesh_contact_space *mesh_contacts; /* NULL until some are asked for */
    struct compound_contact_space *compound_contacts; /* the same of unions */
    struct curved_contact_space *curved_contacts; /* the same of curved shapes and meshes */
    struct collide_mesh *middle; /* a point at the origin, as a body of facets; NULL until it is asked for */
    struct world_space *world;       /* of worlds; NULL until one is asked */
    char message[240];               /* of the last question about a world */
    void *held[3];
};

/* capi_mesh_pairs.c: bytes of a workspace that questions about meshes take, 0 where the library's parts do not fit; and what
   is to be set in them, which are zeros. */
size_t mesh_workspace_bytes(const int64_t *measures);
void begin_mesh_workspace(collide_workspace *space, void *memory, const int64_t *measures);

/* capi_field_pairs.c: the same of questions about fields. */
size_t field_workspace_bytes(const int64_t *measures);
void begin_field_workspace(collide_workspace *space, void *memory, const int64_t *measures);

/* Headers of kernels for robots, of M_MESH_HEADER and M_WALK_HEADER words, which work in the room of a workspace: two bodies of facets
   (capi_mesh_pairs.c); the facets of one beside a convex part (capi_field_pairs.c), which only walks along facets are asked about
   then. stack : 2 * n_stack words. */
void write_mesh_header(collide_workspace *space, const collide_mesh *A, const collide_mesh *B, int64_t *header);
void write_facet_walk(collide_workspace *space, const int64_t *tree, double reach, double promise, int64_t *stack, int64_t n_stack,
                      int64_t *header);

/* capi_pairs.c: the pair that is asked about next. */
void take_pair(collide_workspace *space, const collide_shape *A, const collide_shape *B);

/* Poses of one body in a question of n pairs: whether they fit. */
int take_poses(collide_poses poses, size_t n, const double **matrices, int64_t *step);
/* The same of vectors. */
int take_vectors(collide_vectors vectors, size_t n, const double **xyz, int64_t *step);
/* How many pairs two batches of poses make; 0 where one is empty. */
size_t longer(collide_poses A, collide_poses B);

/* A question about poses: as `answer_poses` takes it. */
struct question {
    const int64_t *which; /* pairs of rows of the table, or NULL for rows 0 and 1 throughout */
    const double *X_WA, *X_WB;
    int64_t step_a, step_b; /* 16, or 0 for one pose throughout */
    size_t n;
    int boolean, depths, check;
    double limit;
    double *axes;
};

/* capi_pairs.c: answers of pairs of rows of a table, whose poses were checked: into zeroed booleans or rows. */
collide_status answer_table(collide_workspace *space, const int64_t *ints, const double *numbers, const struct question *asked,
                            uint8_t *hits, collide_pair *pairs, size_t *failed);
/* capi_world_pairs.c */
void free_world_space(struct world_space *own);

/* --- how the processor rounds -------------------------------------------------------------------------------------- */

/* Rounding to nearest, small numbers kept, nothing trapped: for the length of a call. */
#if defined(__x86_64__) || defined(_M_X64)
#include <xmmintrin.h>
typedef unsigned rounding;
static inline rounding round_as_kernels_do(void)
{
    rounding given = _mm_getcsr();
    if ((given & 0xffc0u) != 0x1f80u) _mm_setcsr(0x1f80u);
    return given;
}
static inline void round_as_before(rounding given)
{
    if ((given & 0xffc0u) != 0x1f80u) _mm_setcsr(given);
}
#elif defined(__aarch64__) && defined(__GNUC__)
typedef uint64_t rounding;
static inline rounding round_as_kernels_do(void)
{
    rounding given;
    __asm__ volatile("mrs %0, fpcr" : "=r"(given));
    if (given != 0) __asm__ volatile("msr fpcr, %0" : : "r"((uint64_t)0) : "memory");
    return given;
}
static inline void round_as_before(rounding given)
{
    if (given != 0) __asm__ volatile("msr fpcr, %0" : : "r"(given) : "memory");
}
#else
typedef int rounding;
static inline rounding round_as_kernels_do(void) { return 0; }
static inline void round_as_before(rounding given) { (void)given; }
#endif

#endif
