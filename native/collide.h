/* collide: distances and overlaps of rigid bodies, proven against rounding. The interface for C and C++.

   The answers are those of the Python package of the same version, bit by bit, and so is what is refused. No Python is
   needed, and none is loaded.

   Units and frames. Lengths are metres. A pose X_WA is the pose of body A in the world W: 16 doubles, a 4x4 matrix row by
   row, p_W = X_WA * p_A, whose last row is 0 0 0 1. Matrices are used as they stand, entry by entry, and are never made
   orthonormal; one whose R^T R is off the identity by more than 1e-4, or that mirrors, is refused (COLLIDE_TRUST_POSES
   skips that check). Numbers are finite and of a size of at most 1e50; positive lengths are at least 1e-50.

   Errors. Every function that can fail returns a collide_status and, unless that is COLLIDE_OK, leaves the objects that it
   was to make NULL. Nothing prints, nothing ends the process, nothing jumps.

   Memory. Shapes, sets of shapes, unions, meshes, fields, worlds, robots and workspaces are made by functions of this header
   and freed by the caller with collide_..._free, which take NULL. A handle that was freed, or one of another type, is
   COLLIDE_INVALID_ARGUMENT, and freeing such a one does nothing, for as long as its memory tells: a help to find mistakes that
   no program may rely on, since its memory may be another object's by then, or nobody's. Numbers handed in are copied. Queries
   allocate nothing, but for contacts: the first ones of a hull work out its faces, which are kept with it, and the first ones
   of a workspace what manifolds are made in; but for the first casts, motions and unions of a workspace, which make its room
   for them, and each new pair of unions; but for fields, where a walk leaves a pair open: then a list of the items nearby, which
   contacts, casts and rays make shapes of while a call lasts; and but for worlds, whose lists of pairs are kept with the workspace, and grow.

   Threads. A shape, a set, a union, a mesh, a field or a robot never changes: any number of threads may use one at once. A workspace is for
   one thread at a time: give each thread its own. A world may be asked by many at once while nobody changes it. Nothing else is
   shared. The answers do not depend on the caller's rounding mode, nor on whether it flushes small numbers to 0: both are set for
   the length of a call, and put back.

   Processors. The kernels are those of the best level that the processor has; the environment's variable COLLIDE_CPU names
   another one ("v2", "v3", "v4"), read when the first workspace, mesh or shape is made. */
#ifndef COLLIDE_H
#define COLLIDE_H

#include <stddef.h>
#include <stdint.h>

/* The version of this header; `collide_version` tells the library's. */
#define COLLIDE_VERSION "0.1.0"

#if defined(_WIN32) && defined(COLLIDE_BUILDING)
#define COLLIDE_LINKAGE __declspec(dllexport)
#elif defined(_WIN32)
#define COLLIDE_LINKAGE __declspec(dllimport)
#elif defined(__GNUC__)
#define COLLIDE_LINKAGE __attribute__((visibility("default")))
#else
#define COLLIDE_LINKAGE
#endif
#define COLLIDE_API COLLIDE_LINKAGE

#ifdef __cplusplus
extern "C" {
#endif

/* What a function has to say. Values never change their meaning. */
typedef enum collide_status {
    COLLIDE_OK = 0,
    COLLIDE_NO_MEMORY = 1,        /* an allocation failed; whatever was begun is freed */
    COLLIDE_INVALID_ARGUMENT = 2, /* a NULL where none may be, a distance below 0, a number outside its range */
    COLLIDE_INVALID_SHAPE = 3,    /* the numbers make no such shape: not finite, too large, too small, empty, unbounded */
    COLLIDE_INVALID_POSE = 4,     /* a matrix is no pose */
    COLLIDE_OUT_OF_RANGE = 5,     /* shapes and distance of a pair together measure less than 1e-50 m: scale the scene */
    COLLIDE_ENDLESS_DEPTH = 6,    /* two half-spaces overlap without end: there is no depth; the boolean has an answer */
    COLLIDE_UNSUPPORTED = 7,      /* Python answers this, this interface does not */
    COLLIDE_NO_KERNELS = 8,       /* the processor is too old, or COLLIDE_CPU names a level that is not to be had */
    COLLIDE_TOO_MANY = 9,          /* more contacts, points or pairs than the caller has room for */
    COLLIDE_INVALID_FILE = 10      /* no such file, no file of this version, or a damaged one */
} collide_status;

/* A sentence about a status, in English; of an unknown one, too. Never NULL. */
COLLIDE_API const char *collide_status_text(collide_status status);

/* The version of the library, "0.1.0". */
COLLIDE_API const char *collide_version(void);

/* The level of processors that the kernels are compiled for, into *level: "v2", "v3", "v4", "arm64". */
COLLIDE_API collide_status collide_level(const char **level);

/* --- shapes --------------------------------------------------------------------------------------------------------

   A closed convex set in its own frame, centred at the frame's origin where it is given by lengths, its axis along z. Full
   lengths, not half ones. A shape is made, asked about and freed; *shape becomes NULL where it cannot be made. */
typedef struct collide_shape collide_shape;

/* A ball. radius > 0. */
COLLIDE_API collide_status collide_sphere(double radius, collide_shape **shape);

/* A box of full edge lengths size[0], size[1], size[2] > 0 along x, y, z. */
COLLIDE_API collide_status collide_box(const double size[3], collide_shape **shape);

/* All points within radius > 0 of a segment along z; length >= 0 is the segment's, without the caps. */
COLLIDE_API collide_status collide_capsule(double radius, double length, collide_shape **shape);

/* A solid cylinder along z: radius > 0, full length > 0. */
COLLIDE_API collide_status collide_cylinder(double radius, double length, collide_shape **shape);

/* A solid cone along z: base of radius > 0 at -length/2, apex at +length/2, length > 0. */
COLLIDE_API collide_status collide_cone(double radius, double length, collide_shape **shape);

/* An ellipsoid with semi-axes radii[0], radii[1], radii[2] > 0 along x, y, z. */
COLLIDE_API collide_status collide_ellipsoid(const double radii[3], collide_shape **shape);

/* {x : normal . x <= offset}. normal points out of the solid; its length is kept as given, and lies within [1e-6, 1e6]. */
COLLIDE_API collide_status collide_halfspace(const double normal[3], double offset, collide_shape **shape);

/* The convex hull of n >= 1 points, x y z of each, in any order, swept by a ball of radius >= 0. Doubled, collinear, coplanar
   and inner points are fine. From 224 points on a support tree is made: 4 to 6 microseconds a point. n < 2^26. */
COLLIDE_API collide_status collide_hull(const double *points, size_t n, double radius, collide_shape **shape);

/* {x : normals[k] . x <= offsets[k] for all k < m}, bounded and not empty: both are decided exactly. normals : 3 * m doubles, no
   normal 0. The vertices are worked out exactly and rounded once, which every bracket counts in. For m up to a few hundred. */
COLLIDE_API collide_status collide_hpolytope(const double *normals, const double *offsets, size_t m, collide_shape **shape);

/* Frees a shape that no query and no set uses any more; NULL is fine. */
COLLIDE_API void collide_shape_free(collide_shape *shape);

/* Shapes under numbers, for batches that ask about a different pair at every pose. */
typedef struct collide_shape_set collide_shape_set;

/* A set of n >= 1 shapes, number k the one at shapes[k]; one may stand there repeatedly. They are not copied: free the set before
   them. */
COLLIDE_API collide_status collide_shape_set_create(const collide_shape *const *shapes, size_t n, collide_shape_set **set);
COLLIDE_API void collide_shape_set_free(collide_shape_set *set);

/* --- queries ------------------------------------------------------------------------------------------------------- */

/* Scratch memory of queries, one a thread: 4 MB of addresses, of which most are never touched. */
typedef struct collide_workspace collide_workspace;

COLLIDE_API collide_status collide_workspace_create(collide_workspace **workspace);
COLLIDE_API void collide_workspace_free(collide_workspace *workspace);

/* Which argument decided a pair (collide_pair.how). */
enum {
    COLLIDE_HOW_UNDECIDED = 0,        /* the bracket reaches to both sides of 0: touching within rounding; hit is then 1 */
    COLLIDE_HOW_SEPARATING_PLANE = 1, /* a plane with all of A on one side and all of B on the other */
    COLLIDE_HOW_COMMON_POINT = 2,     /* a simplex of points of A - B around the origin, clear of rounding */
    COLLIDE_HOW_SWEPT_OVERLAP = 3,    /* two core points nearer than the sum of the radii */
    COLLIDE_HOW_CLOSED_FORM = 4,      /* a formula with an error bound: spheres, capsules, half-spaces */
    COLLIDE_HOW_EXACT_ARITHMETIC = 5  /* integers, where doubles leave the sign open or the last digit */
};

/* What is known of a pair of bodies at one pair of poses: a row of Python's PAIR_DTYPE, byte by byte. */
typedef struct collide_pair {
    double distance;       /* signed [m]: the gap, or minus the depth */
    double lower, upper;   /* lower <= true signed distance <= upper, proven against rounding [m] */
    double normal[3];      /* unit vector from A to B, in W: moving B by -distance * normal brings the pair to touch */
    double point_a[3];     /* witness points in W [m]: point_b - point_a = distance * normal */
    double point_b[3];
    int32_t a, b;          /* 0 and 1 */
    int32_t part_a, part_b; /* 0 and 0: bodies are convex here */
    int32_t vertices_a[4]; /* ids of the vertices that span the deciding feature, pair by pair; -1 for curved bodies */
    int32_t vertices_b[4];
    int32_t iterations;    /* rounds of GJK (low half) and of EPA (high half), for diagnosis */
    int32_t count;         /* how many pairs of vertices there are */
    int32_t how;           /* COLLIDE_HOW_... */
    uint8_t exact;         /* rounds of the exact stage, 0 where doubles decided */
    uint8_t hit;           /* 1 where the closed sets share a point: touching is a hit */
    uint8_t certified;     /* 1 where the sign is proven and the bracket as narrow as is promised */
    uint8_t beyond;        /* 1 where the pair is farther apart than max_distance: distance and lower are then a proven lower
                              bound, and upper is infinite */
} collide_pair;

/* Flags of queries, to be joined by |; 0 for none. */
enum {
    COLLIDE_TRUST_POSES = 1, /* matrices need be no rotations; that they are finite and end in 0 0 0 1 is still checked. A singular
                                matrix leaves a half-space no plane: such rows are not certified, and their bracket is NaN */
    COLLIDE_UNSIGNED = 2     /* of distances: gaps are all that is wanted. Bodies that meet are at distance 0, with normal 0 */
};

/* Whether A and B share a point: *hit becomes 1 or 0. Where rounding of curved shapes leaves that open it is 1. */
COLLIDE_API collide_status collide_collide(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                           const double X_WA[16], const double X_WB[16], unsigned flags, int *hit);

/* The signed distance of A and B. max_distance >= 0, or infinite: beyond it only a proven lower bound is worked out.
   COLLIDE_ENDLESS_DEPTH: *pair tells all but a depth. */
COLLIDE_API collide_status collide_distance(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                            const double X_WA[16], const double X_WB[16], double max_distance,
                                            unsigned flags, collide_pair *pair);

/* Poses of a batch: `count` matrices one behind another. A count of 1 stands for a pose that goes with all of the other body's.

   Batches answer as single calls do, bit by bit, and several times faster. Where one fails, *failed, unless failed is NULL,
   becomes the number of the pair that is to blame (0 where none is), and the answers are of no use but after
   COLLIDE_ENDLESS_DEPTH, which leaves them as single calls do. */
typedef struct collide_poses {
    const double *matrices; /* 16 * count doubles */
    size_t count;
} collide_poses;

/* Booleans of A and B at n pairs of poses, hits[k] of the poses k; n is the larger of the counts.
   axes : NULL; or 3 * n doubles, for each pair an axis in W that may part the bodies, 0 0 0 where none is known, finite, none
   longer than 1e100: tried first, and replaced by one that does, where the bodies are apart. Saves time only. */
COLLIDE_API collide_status collide_collide_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                                 collide_poses X_WA, collide_poses X_WB, unsigned flags, double *axes,
                                                 uint8_t *hits, size_t *failed);

/* Distances of A and B at n pairs of poses. */
COLLIDE_API collide_status collide_distance_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                                  collide_poses X_WA, collide_poses X_WB, double max_distance,
                                                  unsigned flags, collide_pair *pairs, size_t *failed);

/* The same of a set's shapes: pair k is of the shapes which[2 * k] and which[2 * k + 1]. n : how many pairs there are; a count of
   poses is n or 1. */
COLLIDE_API collide_status collide_collide_each(collide_workspace *workspace, const collide_shape_set *set,
                                                const int64_t *which, size_t n, collide_poses X_WA, collide_poses X_WB,
                                                unsigned flags, double *axes, uint8_t *hits, size_t *failed);
COLLIDE_API collide_status collide_distance_each(collide_workspace *workspace, const collide_shape_set *set,
                                                 const int64_t *which, size_t n, collide_poses X_WA, collide_poses X_WB,
                                                 double max_distance, unsigned flags, collide_pair *pairs, size_t *failed);

/* --- margins ---------------------------------------------------------------------------------------------------------- */

/* Whether A and B are at most a margin apart, at n pairs of poses: Python's `security_margin`. margin : 0, or 1e-50 to 1e50 [m].
   Exact for polytopes, swept by balls, and half-spaces, but where radii and margin do not sum up to a double beside a
   half-space, or two doubles; those, and curved shapes, count as within where the bracket holds the margin. flags : COLLIDE_TRUST_POSES
   or 0. Where one fails, *failed is its number, and the answers from there on are of no use.

   Of unions and fields Python's answer is that of a row of collide_compound_distance or collide_field_distance with max_distance =
   margin and COLLIDE_UNSIGNED: within where hit is 1 or lower <= margin. */
COLLIDE_API collide_status collide_within(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                          collide_poses X_WA, collide_poses X_WB, double margin, unsigned flags, uint8_t *within,
                                          size_t *failed);

/* --- contacts -------------------------------------------------------------------------------------------------------

   Where two bodies touch, overlap, or come within a margin: up to max_contacts points, with one normal. The first is the deepest;
   the others are those that span the greatest area. docs/contacts.md says which points they are. */

/* What is known of a contact: a row of Python's CONTACT_DTYPE, byte by byte. */
typedef struct collide_contact {
    double distance;     /* along the normal [m]: the gap there, or minus the overlap */
    double lower, upper; /* lower <= its true value <= upper, proven against rounding [m] */
    double apart;        /* of overlaps: moving B by this length along the normal is proven to part the bodies [m] */
    double normal[3];    /* unit vector from A to B, in W */
    double point_a[3];   /* a point of each surface in W [m]: point_b - point_a = distance * normal */
    double point_b[3];
    int32_t a, b;           /* 0 and 1 */
    int32_t part_a, part_b; /* 0 and 0: bodies are convex here */
    int32_t facet_a, facet_b; /* first triangle of the hull's face; -1 where there is none */
    int32_t feature_a, feature_b; /* number * 4 + class: 0 a vertex, 1 an edge, 2 a face, 3 a corner within a round end; or -1. The
                                     same from step to step while the same features meet */
    int32_t patch;          /* 0: convex bodies have one */
    int32_t kind;           /* COLLIDE_CONTACT_... */
} collide_contact;

enum { COLLIDE_CONTACT_GAP = 0, COLLIDE_CONTACT_OVERLAP = 1 };

/* Contacts of A and B. margin : >= 0 [m]. contacts : room for max_contacts >= 1 rows. *count : how many there are; none where the
   bodies are farther apart than the margin. flags : COLLIDE_TRUST_POSES or 0. COLLIDE_ENDLESS_DEPTH: two half-spaces overlap, and
   there is no normal. */
COLLIDE_API collide_status collide_contacts(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                            const double X_WA[16], const double X_WB[16], double margin,
                                            size_t max_contacts, unsigned flags, collide_contact *contacts, size_t *count);

/* Contacts of A and B at n pairs of poses, one pair's after another's: those of pair k are starts[k] to starts[k + 1] - 1.
   contacts : room for `capacity` rows. starts : room for n + 1 numbers. Where one fails, *failed, unless failed is NULL, becomes the
   number of the pair; starts and rows of those before it are good. COLLIDE_TOO_MANY: go on from that pair with more room; a pair is
   asked about where there is room for max_contacts rows, or for as many as it can have. */
COLLIDE_API collide_status collide_contacts_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                                  collide_poses X_WA, collide_poses X_WB, double margin, size_t max_contacts,
                                                  unsigned flags, collide_contact *contacts, size_t capacity, size_t *starts,
                                                  size_t *failed);

/* The same of a set's shapes: pair k is of the shapes which[2 * k] and which[2 * k + 1]. */
COLLIDE_API collide_status collide_contacts_each(collide_workspace *workspace, const collide_shape_set *set,
                                                 const int64_t *which, size_t n, collide_poses X_WA, collide_poses X_WB,
                                                 double margin, size_t max_contacts, unsigned flags, collide_contact *contacts,
                                                 size_t capacity, size_t *starts, size_t *failed);

/* --- casts ---------------------------------------------------------------------------------------------------------

   How far a convex shape can be moved along a direction, without turning, until it touches another one. */

/* Vectors of a batch, x y z of each, one behind another. A count of 1 stands for one that goes with all. */
typedef struct collide_vectors {
    const double *xyz; /* 3 * count doubles */
    size_t count;
} collide_vectors;

/* Where a moved shape first touches one that stands: what Python's `shape_cast` says. */
typedef struct collide_first_contact {
    double distance;     /* t: A moved by t * direction touches B; lengths of the direction, metres of a unit vector. Infinite where
                            nothing is met, 0 where they touch at the start */
    double lower, upper; /* lower <= truth <= upper, proven where certified [lengths of the direction] */
    double normal[3];    /* unit normal from A to B in W; zeros where nothing is met, and of shapes in contact at the start */
    double point[3];     /* of B in W [m], where A touches it; a common point of shapes in contact at the start */
    int32_t part_a, part_b; /* 0 and 0 of convex shapes; -1 where nothing is met */
    uint8_t hit;         /* 1 where they touch on the way; also where rounding of curved shapes leaves that open */
    uint8_t certified;   /* 1 where hit or miss is proven, and the bracket of a hit as narrow as is promised */
    uint8_t at_start;    /* 1 where they touch before A moves */
    uint8_t reserved[5];
} collide_first_contact;

/* A flag of casts: normals and points of shapes in contact at the start are those of `collide_distance`. */
enum { COLLIDE_START_NORMALS = 4 };

/* The first contact of A, moved along a direction in W of any length > 0, and B, which stands. max_distance : how far A moves at most
   [lengths of the direction], >= 0, or infinite. flags : COLLIDE_TRUST_POSES, COLLIDE_START_NORMALS, or
   both. COLLIDE_UNSUPPORTED where Python decides in integers (polytopes that graze each other on the way within rounding, motions
   that approach a half-space by no more than rounding), and where A is a half-space, which Python refuses as well. */
COLLIDE_API collide_status collide_cast(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                        const double X_WA[16], const double X_WB[16], const double direction[3],
                                        double max_distance, unsigned flags, collide_first_contact *first);

/* The same of n casts; poses and directions go together as those of batches do. statuses : NULL, or room for n: what the single call
   returns of each cast. All are answered that can be; the first of the others is *failed, and its status is returned. */
COLLIDE_API collide_status collide_cast_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                              collide_poses X_WA, collide_poses X_WB, collide_vectors directions,
                                              double max_distance, unsigned flags, collide_first_contact *contacts,
                                              collide_status *statuses, size_t *failed);

/* --- times of impact -----------------------------------------------------------------------------------------------

   When two convex shapes in motion first touch. In unit time the origin of each moves on a line from its first pose to its second, and
   the body turns about it with constant angular velocity: the shortest way, or as told. */

/* When they first touch: what Python's `time_of_impact` says. */
typedef struct collide_time_of_impact {
    double time;         /* `lower` where they touch or that is open: until then they are proven apart; 1 of motions free of contact */
    double lower, upper; /* lower <= first contact <= upper, proven; 0 and 0 of shapes in contact at the start, 1 and 1 of free motions;
                            upper is infinite where they come within rounding of each other at `lower`, and the rest is open */
    double normal[3];    /* unit vector from A to B in W at `time`; zeros of free motions */
    double point_a[3];   /* nearest points of A and B in W at `time` [m]; zeros of free motions */
    double point_b[3];
    int32_t part_a, part_b; /* 0 and 0 of convex shapes */
    int32_t queries;     /* questions to GJK, for diagnosis */
    uint8_t hit;         /* 0: proven free of contact from 0 to 1 */
    uint8_t certified;   /* 1 where the answer is proven, and upper - lower is within the tolerance */
    uint8_t reserved[2];
} collide_time_of_impact;

/* The first contact of A and B on their ways from X_WA0 to X_WA1 and from X_WB0 to X_WB1. omega_WA, omega_WB : NULL for the shortest way;
   or angular velocities in W [rad in unit time], three doubles, up to 1e6 long, that lead from the first orientation to the second (else
   COLLIDE_INVALID_ARGUMENT). tolerance : width of the bracket that is to be reached, 1e-14 to 1. flags : COLLIDE_TRUST_POSES or 0.
   COLLIDE_UNSUPPORTED: two half-spaces that start apart, which Python refuses as well. */
COLLIDE_API collide_status collide_impact(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                          const double X_WA0[16], const double X_WA1[16], const double X_WB0[16],
                                          const double X_WB1[16], const double *omega_WA, const double *omega_WB,
                                          double tolerance, unsigned flags, collide_time_of_impact *impact);

/* Motions of a batch: n of each, or 1 that goes with all; xyz of an angular velocity is NULL for the shortest way. */
typedef struct collide_motions {
    collide_poses X_WA0, X_WA1, X_WB0, X_WB1;
    collide_vectors omega_WA, omega_WB;
} collide_motions;

/* The same of n motions. statuses, failed : as of `collide_cast_batch`. */
COLLIDE_API collide_status collide_impact_batch(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                                const collide_motions *motions, double tolerance, unsigned flags,
                                                collide_time_of_impact *impacts, collide_status *statuses, size_t *failed);

/* --- unions ----------------------------------------------------------------------------------------------------------

   Bodies of several convex shapes, each at its own pose: what Python's `Compound` is, without meshes among its items. */
typedef struct collide_compound collide_compound;

/* The union of n >= 1 shapes, shape k at the pose poses + 16 * k in the frame of the union. Shapes are not copied: free the union before
   them. A convex shape is asked about with unions as one of n = 1. O(n log n). COLLIDE_INVALID_POSE: a matrix is no pose. */
COLLIDE_API collide_status collide_compound_create(const collide_shape *const *shapes, const double *poses, size_t n,
                                                   collide_compound **compound);

/* Frees a union; NULL is fine. A union never changes and any number of threads may use it. */
COLLIDE_API void collide_compound_free(collide_compound *compound);

/* Booleans and signed distances of A and B at n pairs of poses, as collide_collide_batch and collide_distance_batch; n may be 1.
   part_a and part_b of a row name parts. The tables of a pair are laid out when it is asked about first, O(n log n), and kept in the
   workspace until another pair is: ask about a pair at all its poses in turn. */
COLLIDE_API collide_status collide_compound_collide(collide_workspace *workspace, const collide_compound *A,
                                                    const collide_compound *B, collide_poses X_WA, collide_poses X_WB,
                                                    unsigned flags, uint8_t *hits, size_t *failed);
COLLIDE_API collide_status collide_compound_distance(collide_workspace *workspace, const collide_compound *A,
                                                     const collide_compound *B, collide_poses X_WA, collide_poses X_WB,
                                                     double max_distance, unsigned flags, collide_pair *pairs, size_t *failed);

/* The first contact of A, moved along a direction, and B, which stands, as collide_cast; part_a and part_b name the parts that touch.
   flags : COLLIDE_TRUST_POSES or 0. COLLIDE_UNSUPPORTED: a half-space in A, which Python refuses as well, parts that graze or touch
   each other within rounding, and more than 1024 pairs of parts, or 256 of larger unions, that are in each other's way. */
COLLIDE_API collide_status collide_compound_cast(collide_workspace *workspace, const collide_compound *A, const collide_compound *B,
                                                 const double X_WA[16], const double X_WB[16], const double direction[3],
                                                 double max_distance, unsigned flags, collide_first_contact *first);

/* Contacts of A and B, as those of their parts: at most max_contacts of each pair of parts, in the order of part_a and part_b; patch
   counts the pairs. contacts : room for `capacity` rows. *count : how many there are. COLLIDE_TOO_MANY: more than that, of which as many
   are written. COLLIDE_UNSUPPORTED, never a guess: parts that touch, or are apart by a margin, within rounding, half-spaces at poses of
   their own, more than 256 pairs of parts that come within the margin, and more than 1024 contacts. */
COLLIDE_API collide_status collide_compound_contacts(collide_workspace *workspace, const collide_compound *A,
                                                     const collide_compound *B, const double X_WA[16], const double X_WB[16],
                                                     double margin, size_t max_contacts, unsigned flags, collide_contact *contacts,
                                                     size_t capacity, size_t *count);

/* --- meshes --------------------------------------------------------------------------------------------------------

   Triangles, as a solid or as a surface, asked about with each other and with convex shapes. This is less than Python answers:
   whether two such bodies meet, how far they are apart, contacts, and rays. Everything else of meshes is COLLIDE_UNSUPPORTED, never a
   guess: depths but of half-spaces, gaps below 6e-8 of the pair's size, unions, solids against bodies of more than 64 parts. */
typedef struct collide_mesh collide_mesh;

enum {
    COLLIDE_SURFACE = 0,        /* the facets alone */
    COLLIDE_SOLID = 1,          /* with what they wind around; facets that do not close are COLLIDE_INVALID_SHAPE */
    COLLIDE_SOLID_IF_CLOSED = 2 /* a solid where an inside can be told, else a surface */
};

/* A mesh of n vertices, x y z of each, and m facets, three numbers of vertices each, counter-clockwise from outside. Equal
   vertices count as one; a part that runs the other way round within another is a cavity. solid : one of the above.
   m <= 2^28. */
COLLIDE_API collide_status collide_mesh_create(const double *vertices, size_t n, const int32_t *faces, size_t m, int solid,
                                               collide_mesh **mesh);

/* The surface and the inside of a sphere, box, capsule or hull, to be asked about with meshes. COLLIDE_UNSUPPORTED: shapes that
   are curved otherwise, without end, or whose corners are rounded (collide_hpolytope). */
COLLIDE_API collide_status collide_mesh_of_shape(const collide_shape *shape, collide_mesh **mesh);

/* Terrain: heights over a grid and all below them down to a bottom, as a solid of the vertices and the faces of Python's HeightField,
   in its order. heights : rows * columns of them, row by row [m]; heights[i * columns + j] stands at x = (j - (columns - 1) / 2) *
   cell[0], y = (i - (rows - 1) / 2) * cell[1]. NaN makes a hole: cells with a corner there are left out. cell : sides of a cell along
   x and y > 0 [m]. bottom : z of the bottom, below all heights; NULL: as far below the lowest as heights differ and the longer side
   together. Facet 2 * (i * (columns - 1) + j) + t of a field without holes is triangle t of cell i, j. COLLIDE_INVALID_SHAPE: fewer
   than 2 * 2 heights, none that makes a cell, heights or sides out of range, 2^27 cells or more, a bottom not below all heights.
   O(rows * columns): what meshes of as many facets take. */
COLLIDE_API collide_status collide_height_field_create(const double *heights, size_t rows, size_t columns, const double cell[2],
                                                       const double *bottom, collide_mesh **mesh);

/* Frees a mesh; NULL is fine. A mesh never changes and any number of threads may use it. */
COLLIDE_API void collide_mesh_free(collide_mesh *mesh);

/* Whether A and B, of which one at least was made of facets, share a point; flags as of collide_collide. */
COLLIDE_API collide_status collide_mesh_collide(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B,
                                                const double X_WA[16], const double X_WB[16], unsigned flags, int *hit);

/* How far A and B are apart; part_a and part_b are facets. COLLIDE_UNSUPPORTED where they meet, or nearly: ask
   collide_mesh_collide which. */
COLLIDE_API collide_status collide_mesh_distance(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B,
                                                 const double X_WA[16], const double X_WB[16], unsigned flags,
                                                 collide_pair *pair);

/* A mesh, as made by collide_mesh_create, and a convex shape of any kind: whether they meet, and how far they are apart. The mesh stands
   first; part_a is a facet. Half-spaces are answered by the mesh's hull, depths too, which is made at the first of them and kept.
   COLLIDE_UNSUPPORTED, never a guess: depths of others, unless COLLIDE_UNSIGNED is asked for, what touches a curved shape within
   rounding, h-polytopes, and what collide_mesh_collide and collide_mesh_distance leave to Python. */
COLLIDE_API collide_status collide_mesh_shape_collide(collide_workspace *workspace, const collide_mesh *mesh,
                                                      const collide_shape *shape, const double X_WM[16], const double X_WS[16],
                                                      unsigned flags, int *hit);
COLLIDE_API collide_status collide_mesh_shape_distance(collide_workspace *workspace, const collide_mesh *mesh,
                                                       const collide_shape *shape, const double X_WM[16], const double X_WS[16],
                                                       unsigned flags, collide_pair *pair);

/* Contacts of A and B, patch by patch: at most max_contacts of each, and as many patches as there are. facet_a, facet_b, feature_a,
   feature_b and patch of a row tell which. contacts : room for `capacity` rows. *count : how many there are. COLLIDE_TOO_MANY: more
   than that, of which as many are written. COLLIDE_UNSUPPORTED, never a guess: bodies inside each other, overlaps too deep for a
   patch, contacts within rounding of the margin, and more than 4096 pairs of facets or 1024 contacts. The first contacts of a mesh
   work out which facets share corners and edges, O(n), which is kept with it; those of a workspace take 20 MB of addresses. */
COLLIDE_API collide_status collide_mesh_contacts(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B,
                                                 const double X_WA[16], const double X_WB[16], double margin, size_t max_contacts,
                                                 unsigned flags, collide_contact *contacts, size_t capacity, size_t *count);

/* The same of a mesh, as made by collide_mesh_create, and a convex shape; the mesh stands first. COLLIDE_UNSUPPORTED, never a guess:
   half-spaces, h-polytopes, what collide_mesh_contacts leaves to Python, and of curved shapes more than 448 facets near them, shapes
   inside a solid, and overlaps that a shorter way than the facets' might part. */
COLLIDE_API collide_status collide_mesh_shape_contacts(collide_workspace *workspace, const collide_mesh *mesh,
                                                       const collide_shape *shape, const double X_WM[16], const double X_WS[16],
                                                       double margin, size_t max_contacts, unsigned flags,
                                                       collide_contact *contacts, size_t capacity, size_t *count);

/* --- rays ------------------------------------------------------------------------------------------------------------

   Where rays first meet the surface of a shape. Surfaces are closed: a ray through an edge meets the facets around it, a ray from the
   surface meets it at 0, one from inside meets the wall on its way out. */

/* Where a ray first meets a surface: what Python's `raycast` says. */
typedef struct collide_ray_hit {
    double distance;     /* t of the point origin + t * direction: lengths of the direction, metres of a unit vector; infinite where
                            nothing is met */
    double lower, upper; /* lower <= truth <= upper, proven where certified */
    double normal[3];    /* outward unit normal of the surface in W; zeros of a facet without area, and where nothing is met */
    double point[3];     /* in W [m]; zeros where nothing is met */
    int32_t facet;       /* of a mesh, or of the triangles of a box or hull; of cylinders and cones 0 round about, 1 below, 2 above, of
                            capsules 1 and 2 on the balls at their ends; else 0, or -1: nothing is met, or a hull is swept by a ball */
    int32_t part;        /* of a union its part, else 0; -1 where nothing is met */
    uint8_t hit;         /* 1 where a surface is met; also where rounding of curved shapes leaves that open */
    uint8_t certified;   /* 1 where hit or miss is proven, and the bracket is narrow */
    uint8_t reserved[6];
} collide_ray_hit;

/* n rays at a convex shape: poses, origins and directions, n of each, or 1 that goes with all. Origins are in W [m], directions in W of any
   length > 0. max_distance : t up to which the surface counts, >= 0, or infinite. flags : COLLIDE_TRUST_POSES or 0. statuses : NULL, or
   room for n. All rays are answered that can be; the first of the others is *failed, and its status is returned. The first ray at a polytope
   works out its facets, which are kept with it.

   Rays through edges and corners meet several facets at once, or within rounding: the row then has a bracket that holds the first of
   them, and names the least facet of those, where Python works out t in integers. COLLIDE_UNSUPPORTED, never a guess: rays in the plane of a
   facet, t too near to the limit, rays that begin within rounding of a facet or of a half-space's plane, slivers of facets without a normal in
   doubles. */
COLLIDE_API collide_status collide_raycast(collide_workspace *workspace, const collide_shape *shape, collide_poses X_WA,
                                           collide_vectors origins, collide_vectors directions, double max_distance, unsigned flags,
                                           collide_ray_hit *hits, collide_status *statuses, size_t *failed);

/* The same of a union, whose parts are named by `part`; facet is -1 of polytopes, whose chords are told in closed form. Walls inside
   other parts count, too. COLLIDE_UNSUPPORTED: a ray that begins or ends within rounding of a part with flat sides, or grazes it. */
COLLIDE_API collide_status collide_compound_raycast(collide_workspace *workspace, const collide_compound *compound, collide_poses X_WA,
                                                    collide_vectors origins, collide_vectors directions, double max_distance,
                                                    unsigned flags, collide_ray_hit *hits, collide_status *statuses, size_t *failed);

/* The same of a mesh. */
COLLIDE_API collide_status collide_mesh_raycast(collide_workspace *workspace, const collide_mesh *mesh, collide_poses X_WA,
                                                collide_vectors origins, collide_vectors directions, double max_distance,
                                                unsigned flags, collide_ray_hit *hits, collide_status *statuses, size_t *failed);

/* --- fields ---------------------------------------------------------------------------------------------------------

   Point clouds and voxel grids, asked about with convex shapes: whether they meet, how far they are apart, contacts, casts, and rays.
   The field stands first, but in casts: rows name its balls, or its cells, in part_a, and normals go from it to the shape. Booleans are answered for every shape.
   Rows are COLLIDE_UNSUPPORTED, never a guess, where Python takes the items nearby as a union: depths and distances that a walk
   leaves open (touching within rounding, matrices off a rotation by 2^-40), and half-spaces, unless a single ball or cell is near:
   the one that is lowest over a half-space. */
typedef struct collide_field collide_field;

/* The union of balls around n points, x y z of each [m], 1 <= n < 2^28. radii : one for all (n_radii 1) or one each (n_radii n),
   >= 0; 0 makes points. The tree takes about 0.1 microseconds and 23 bytes a point. */
COLLIDE_API collide_status collide_point_cloud_create(const double *points, size_t n, const double *radii, size_t n_radii,
                                                      collide_field **cloud);

/* The union of the occupied cells of an array, a byte a cell, 0 where it is free, cell i, j, k at
   (i * cells[1] + j) * cells[2] + k, which is its number in part_a. cells : how many along each axis, at most 65536, and below 2^31
   in all. cell : sides of a cell > 0 [m]. origin : the least corner of cell 0, 0, 0 [m], or NULL for 0, 0, 0; a turned grid is one
   at a turned pose. A bit a cell is kept. COLLIDE_INVALID_SHAPE: no cell is occupied. */
COLLIDE_API collide_status collide_voxel_grid_create(const uint8_t *occupied, const size_t cells[3], const double cell[3],
                                                     const double origin[3], collide_field **grid);

/* Frees a field; NULL is fine. A field never changes and any number of threads may use it. */
COLLIDE_API void collide_field_free(collide_field *field);

/* Whether a field and a shape share a point; flags as of collide_collide. */
COLLIDE_API collide_status collide_field_collide(collide_workspace *workspace, const collide_field *field,
                                                 const collide_shape *shape, const double X_WF[16], const double X_WS[16],
                                                 unsigned flags, int *hit);

/* The signed distance of a field and a shape, as collide_distance. Ask with COLLIDE_UNSIGNED where gaps are all that is wanted:
   those of bodies that meet are answered, too. */
COLLIDE_API collide_status collide_field_distance(collide_workspace *workspace, const collide_field *field,
                                                  const collide_shape *shape, const double X_WF[16], const double X_WS[16],
                                                  double max_distance, unsigned flags, collide_pair *pair);

/* The same at n pairs of poses, as collide_collide_batch and collide_distance_batch. statuses : NULL, or room for n: what the
   single call returns of each pair. Where a matrix is no pose nothing is answered; else every distance is that can be: rows of the
   others are zeros, *failed is the first of them, and its status is returned. */
COLLIDE_API collide_status collide_field_collide_batch(collide_workspace *workspace, const collide_field *field,
                                                       const collide_shape *shape, collide_poses X_WF, collide_poses X_WS,
                                                       unsigned flags, uint8_t *hits, size_t *failed);
COLLIDE_API collide_status collide_field_distance_batch(collide_workspace *workspace, const collide_field *field,
                                                        const collide_shape *shape, collide_poses X_WF, collide_poses X_WS,
                                                        double max_distance, unsigned flags, collide_pair *pairs,
                                                        collide_status *statuses, size_t *failed);

/* Contacts of a field and a shape within a margin: those of the items nearby as a union, cells of a grid as few boxes; where cells meet
   face to face there are none. Rows are as of collide_compound_contacts, but that part_a names a ball or a cell, at most max_contacts for
   each ball or box. COLLIDE_UNSUPPORTED, never a guess: what collide_compound_contacts leaves to Python. O(items nearby). */
COLLIDE_API collide_status collide_field_contacts(collide_workspace *workspace, const collide_field *field, const collide_shape *shape,
                                                  const double X_WF[16], const double X_WS[16], double margin, size_t max_contacts,
                                                  unsigned flags, collide_contact *contacts, size_t capacity, size_t *count);

/* Where n rays first meet a field, as collide_raycast: `part` names the ball, or the cell; facet is -1 of cells. Faces between occupied
   cells are no surface. COLLIDE_UNSUPPORTED, never a guess: rays that graze or pass a cell's edge or a point within rounding before
   their first wall, begin within rounding of a cell's face, or end at one, and grids at matrices off a rotation by 2^-10. */
COLLIDE_API collide_status collide_field_raycast(collide_workspace *workspace, const collide_field *field, collide_poses X_WF,
                                                 collide_vectors origins, collide_vectors directions, double max_distance, unsigned flags,
                                                 collide_ray_hit *hits, collide_status *statuses, size_t *failed);

/* The first contact of a shape, moved along a direction, and a field, which stands, as collide_compound_cast: part_b names the ball or the
   cell. flags : COLLIDE_TRUST_POSES or 0. COLLIDE_UNSUPPORTED: a half-space, which Python refuses as well, and items that the shape grazes
   or touches within rounding. O(items on the way), of which the first ones are looked at first. */
COLLIDE_API collide_status collide_field_cast(collide_workspace *workspace, const collide_shape *shape, const collide_field *field,
                                              const double X_WS[16], const double X_WF[16], const double direction[3],
                                              double max_distance, unsigned flags, collide_first_contact *first);

/* The k >= 1 nearest points of a cloud to each of n places, x y z of each in the frame of the cloud [m], balls left out, nearest
   first, of points as far away as each other those of least number: distances and numbers, k a place; infinite and -1 where there
   are fewer, or none within max_distance >= 0. k * n <= 2^26; a walk sorts by insertion, so that k of some hundred is much. */
COLLIDE_API collide_status collide_point_cloud_nearest(const collide_field *cloud, const double *places, size_t n, size_t k,
                                                       double max_distance, double *distances, int64_t *rows);

/* Numbers of the points of a cloud no farther from a place than r >= 0, balls left out, ascending; *count : how many there are.
   COLLIDE_TOO_MANY: more than `capacity`, of which as many are written; a capacity of 0 with rows NULL asks how many. */
COLLIDE_API collide_status collide_point_cloud_within(const collide_field *cloud, const double place[3], double r, int64_t *rows,
                                                      size_t capacity, size_t *count);

/* --- worlds ----------------------------------------------------------------------------------------------------------

   Many bodies, a tree over their boxes, and questions about all of them: the answers of Python's World, row by row and bit by
   bit. Bodies are convex shapes; meshes and fields as well, of which a world says what the pair queries above say: whether they
   hit, gaps, contacts, where rays meet them, and where casts meet fields. What these do not answer is COLLIDE_UNSUPPORTED, and the
   message names the bodies. A change takes its time in the call that makes it: a step moves bodies, and the tree follows. Questions change nothing: any number of
   threads may ask a world at once, each with its own workspace, while nobody changes it. Shapes, meshes and fields are not
   copied: free them once no body is made of them.

   A pair of bodies is tested unless both are static or asleep, their groups and masks exclude each other (tested when
   (group_A & mask_B) and (group_B & mask_A)), or `collide_world_allow` names the pair.

   Room is the caller's: where rows are more than `capacity`, as many are written, *count becomes how many there are, and
   COLLIDE_TOO_MANY is returned. A capacity of 0 with rows NULL asks how many. A workspace keeps lists that grow with what is asked;
   they are all that a question allocates.

   Where a change does not return COLLIDE_OK the world is as before, and `collide_world_message` says which argument, or which
   body, is to blame; of questions `collide_workspace_message` does. */
typedef struct collide_world collide_world;

COLLIDE_API collide_status collide_world_create(collide_world **world);

/* Frees a world, not its shapes; NULL is fine. */
COLLIDE_API void collide_world_free(collide_world *world);

/* A sentence about the last change of a world that did not return COLLIDE_OK, or about the last such question asked with a
   workspace, until the next one; "" where there was none. Never NULL. */
COLLIDE_API const char *collide_world_message(const collide_world *world);
COLLIDE_API const char *collide_workspace_message(const collide_workspace *workspace);

/* A body as it is added. Begin with COLLIDE_BODY_DEFAULT: later versions may have more fields, behind these. */
typedef struct collide_body {
    size_t size;                /* sizeof(collide_body) */
    const collide_shape *shape; /* of shape, mesh and field one is not NULL */
    const collide_mesh *mesh;
    const collide_field *field;
    const double *X_WB;         /* its pose in the world, 16 doubles; NULL: the identity */
    int is_static;              /* never tested against other static bodies */
    uint32_t group, mask;       /* bit sets: the groups of the body, and the groups to test it against */
} collide_body;

#define COLLIDE_BODY_DEFAULT {sizeof(collide_body), NULL, NULL, NULL, NULL, 0, 1u, 0xFFFFu}

/* Add n bodies; ids[k] becomes the id of bodies[k], ascending, never used again in this world. O(log n) a body, or less of many
   at once. Where one of them is bad none is added. */
COLLIDE_API collide_status collide_world_add(collide_world *world, const collide_body *bodies, size_t n, int32_t *ids);

/* Take a body out, and what was allowed for it. */
COLLIDE_API collide_status collide_world_remove(collide_world *world, int32_t id);

/* Give n bodies other poses, 16 doubles each, in the order of ids; of a body named twice the last one counts. Where one is bad
   none has moved. Many in one call take less than one by one. */
COLLIDE_API collide_status collide_world_move(collide_world *world, const int32_t *ids, size_t n, const double *X_WBs);

/* Give a body another shape; its id, pose, filters and sleep stay. */
COLLIDE_API collide_status collide_world_replace(collide_world *world, int32_t id, const collide_shape *shape);
COLLIDE_API collide_status collide_world_replace_mesh(collide_world *world, int32_t id, const collide_mesh *mesh);
COLLIDE_API collide_status collide_world_replace_field(collide_world *world, int32_t id, const collide_field *field);

/* Put bodies to sleep (asleep 1) or wake them (0): a pair of two bodies asleep or static is not tested. */
COLLIDE_API collide_status collide_world_sleep(collide_world *world, const int32_t *ids, size_t n, int asleep);

/* Never test n pairs of bodies, two ids each. O(pairs allowed so far) a call: hand over many at once. */
COLLIDE_API collide_status collide_world_allow(collide_world *world, const int32_t *pairs, size_t n);

/* Margins [m] of n bodies, 0 or within 1e-50 ... 1e50: a tested pair no farther apart than both margins together counts as a hit for
   `collides` and `hits`, is a row of `collisions`, and has its contacts told. Distances are told unchanged. O(bodies) a call: hand
   over many at once. */
COLLIDE_API collide_status collide_world_set_margins(collide_world *world, const int32_t *ids, size_t n, const double *margins);

/* Margins of n pairs of bodies, two ids each, instead of the sum of both bodies'; margins NULL: the pairs lose theirs. */
COLLIDE_API collide_status collide_world_set_pair_margins(collide_world *world, const int32_t *pairs, size_t n, const double *margins);

/* How many bodies there are. */
COLLIDE_API size_t collide_world_size(const collide_world *world);

/* The pose of a body, as it was handed in. */
COLLIDE_API collide_status collide_world_pose(const collide_world *world, int32_t id, double X_WB[16]);

/* Whether any tested pair hits; stops at the first hit. COLLIDE_UNSUPPORTED: no pair that is answered does, and one is not. */
COLLIDE_API collide_status collide_world_collides(const collide_world *world, collide_workspace *workspace, int *hit);

/* Whether any tested pair is at most a margin apart [m], 0 or within 1e-50 ... 1e50, to which the margins of bodies and pairs are
   added; decided as by `collide_within`. */
COLLIDE_API collide_status collide_world_within(const collide_world *world, collide_workspace *workspace, double margin, int *hit);

/* Every tested pair that hits, or comes within its margin, by booleans alone: two ids a pair, sorted. capacity : of pairs. */
COLLIDE_API collide_status collide_world_hits(const collide_world *world, collide_workspace *workspace, int32_t *ids,
                                              size_t capacity, size_t *count);

/* Every tested pair that hits, with its depth, or comes within its margin (`hit` is 0 where it is apart): rows sorted by (a, b), the ids of the bodies, a < b. Of two half-spaces that
   overlap the distance is minus infinity. */
COLLIDE_API collide_status collide_world_collisions(const collide_world *world, collide_workspace *workspace, collide_pair *rows,
                                                    size_t capacity, size_t *count);

/* Every tested pair at most max_distance >= 0 apart, or infinite for all pairs, hits included. Only pairs proven to be farther
   apart are left out: lower <= max_distance of all rows. */
COLLIDE_API collide_status collide_world_distances(const collide_world *world, collide_workspace *workspace, double max_distance,
                                                   collide_pair *rows, size_t capacity, size_t *count);

/* The tested pair of least signed distance, of several the one with the least ids: *count becomes 1, or 0 where no tested pair
   is within max_distance. By branch and bound: pairs whose boxes cannot be as near are not asked. */
COLLIDE_API collide_status collide_world_minimum(const collide_world *world, collide_workspace *workspace, double max_distance,
                                                 collide_pair *row, size_t *count);

/* Contacts of every tested pair within a margin >= 0 [m] and its own, at most max_contacts >= 1 a pair, sorted by (a, b), the ids of the
   bodies; as `collide_contacts`. */
COLLIDE_API collide_status collide_world_contacts(const collide_world *world, collide_workspace *workspace, double margin,
                                                  size_t max_contacts, collide_contact *contacts, size_t capacity, size_t *count);

/* A shape from outside against every body: rows of those at most max_distance apart, a -1 and b the id of the body, sorted by
   b. Filters and sleep do not apply. */
COLLIDE_API collide_status collide_world_query(const collide_world *world, collide_workspace *workspace, const collide_shape *shape,
                                               const double X_WS[16], double max_distance, collide_pair *rows, size_t capacity,
                                               size_t *count);

/* Ids of bodies, ascending, whose axis-aligned boxes come within a margin of the box low_W ... high_W, which may be infinite: the
   broadphase alone. Boxes of half-spaces are near everything. */
COLLIDE_API collide_status collide_world_boxes_near(const collide_world *world, collide_workspace *workspace, const double low_W[3],
                                                    const double high_W[3], double margin, int32_t *ids, size_t capacity,
                                                    size_t *count);

/* What a ray or a moved shape meets first, or which body is nearest to a point: a row of Python's WorldHits, byte by byte. */
typedef struct collide_world_hit {
    double distance;     /* t on a ray, in lengths of its direction; of points the signed distance [m]; infinite of nothing */
    double lower, upper; /* lower <= truth <= upper, proven where certified */
    double normal[3];    /* unit vector in W: outward from the body for rays, from the cast shape or the point to the body; or zeros */
    double point[3];     /* in W [m], of the body; zeros where nothing is met */
    int32_t ray;         /* number of the ray, cast or point */
    int32_t body;        /* id of the body, -1 where nothing is met */
    int32_t item;        /* 0; -1 where nothing is met */
    int32_t facet;       /* of a ray on a cylinder or cone: 0 round about, 1 below, 2 above; as of Python's raycast; -1 of casts */
    uint8_t hit;         /* 1 where anything is met */
    uint8_t certified;   /* 1 where hit or miss is proven, and the bracket narrow */
    uint8_t at_start;    /* of casts 1 where they touch before they move */
} collide_world_hit;

/* The first body on each of n rays, x y z of origins and directions, which need be no unit vectors. max_distance : in lengths
   of the direction. group, mask : NULL, or bit sets: bodies count with (*group & mask_B) and (group_B & *mask). statuses :
   NULL, or room for n. A ray that touches a surface within rounding, or begins on one, Python settles in integers: its status
   is COLLIDE_UNSUPPORTED, its row zeros, and so is the call's; all others are answered, at fields as by `collide_field_raycast`,
   at meshes that were made of facets where a single facet is met first for certain. */
COLLIDE_API collide_status collide_world_raycast(const collide_world *world, collide_workspace *workspace, const double *origins_W,
                                                 const double *directions_W, size_t n, double max_distance, const uint32_t *group,
                                                 const uint32_t *mask, collide_world_hit *hits, collide_status *statuses);

/* The first body touched by a shape from outside that moves along a direction, without turning: n casts, poses and directions n of each,
   or 1 that goes with all. Of several touched at the same place the one with the least id. max_distance, flags : as of `collide_cast`;
   group, mask, statuses : as of `collide_world_raycast`. In a row `normal` goes from the shape to the body, and `point` is the body's.
   COLLIDE_UNSUPPORTED, never a guess, of a cast, whose row is zeros: where `collide_cast` or `collide_field_cast` leaves a body to Python
   that comes before what is proven to be met, where a mesh does, which the message names, and with COLLIDE_START_NORMALS where a field is
   touched at the start; and where the shape is a half-space, which Python refuses as well. O(log n) boxes, and a `collide_cast` for each body in the way, the nearest first. */
COLLIDE_API collide_status collide_world_cast(const collide_world *world, collide_workspace *workspace, const collide_shape *shape,
                                              collide_poses X_WS, collide_vectors directions_W, double max_distance, unsigned flags,
                                              const uint32_t *group, const uint32_t *mask, collide_world_hit *hits,
                                              collide_status *statuses);

/* The body of least signed distance to each of n points, x y z of each, no farther than max_distance; of several the one with
   the least id. group, mask : as of `collide_world_raycast`; with them every body's box is looked at. */
COLLIDE_API collide_status collide_world_nearest(const collide_world *world, collide_workspace *workspace, const double *points_W,
                                                 size_t n, double max_distance, const uint32_t *group, const uint32_t *mask,
                                                 collide_world_hit *hits);

/* --- robots ---------------------------------------------------------------------------------------------------------

   A robot among obstacles, from a file that `collide.RobotChecker.save` wrote in Python: links, attached objects, padding, untested
   pairs, and bodies around where they stood. Configurations are rows of collide_robot_columns doubles [rad or m], as in Python, one
   behind another. The answers are the checker's, bit by bit. COLLIDE_UNSUPPORTED, never a guess: what kernels leave to Python,
   distances near meshes that are not convex, and what touches within rounding. `statuses` : NULL, or room for n: which are left so;
   the others are answered, *failed, unless failed is NULL, is the first of those left, and its status is returned. */
typedef struct collide_robot collide_robot;

/* A robot from a file, or from its n bytes in memory, which are copied. Whatever stands in them is checked, so that a file may come
   from anywhere: COLLIDE_INVALID_FILE. A digest tells damage; a file made to lie is not told from one that Python wrote. */
COLLIDE_API collide_status collide_robot_load(const char *path, collide_robot **robot);
COLLIDE_API collide_status collide_robot_read(const void *bytes, size_t n, collide_robot **robot);

/* Frees a robot that no workspace uses any more; NULL is fine. A robot never changes and any number of threads may use it. */
COLLIDE_API void collide_robot_free(collide_robot *robot);

/* How many columns a configuration has, bodies the robot, and bodies there are around. */
COLLIDE_API size_t collide_robot_columns(const collide_robot *robot);
COLLIDE_API size_t collide_robot_bodies(const collide_robot *robot);
COLLIDE_API size_t collide_robot_around(const collide_robot *robot);

/* Names in UTF-8, which go with the robot: of a column; of a body by its number in rows, -1 - k for body k around. NULL out of
   range. */
COLLIDE_API const char *collide_robot_column_name(const collide_robot *robot, size_t column);
COLLIDE_API const char *collide_robot_body_name(const collide_robot *robot, int32_t body);

/* Scratch memory of questions about one robot, one a thread; made where a planner starts, not at every question. Bodies around
   stand in it where the file has them, until they are moved. */
typedef struct collide_robot_workspace collide_robot_workspace;

COLLIDE_API collide_status collide_robot_workspace_create(const collide_robot *robot, collide_robot_workspace **workspace);
COLLIDE_API void collide_robot_workspace_free(collide_robot_workspace *workspace);

/* Give n bodies around other poses X_WB, 16 doubles each, by their numbers in rows: -1 - k of body k around, which
   `collide_robot_body_name` names. Of a body named twice the last pose counts; all others stay. For the questions of this workspace
   alone, between any two: the robot stays as it was loaded, so that threads with workspaces of their own are not disturbed, and each
   thread moves its own. Answers are then those of a checker in Python whose World has moved, bit by bit. O(parts and nodes around).
   Where it is not COLLIDE_OK nothing has moved: COLLIDE_INVALID_ARGUMENT or COLLIDE_INVALID_POSE, *failed, unless NULL, is the first
   of n to blame; COLLIDE_UNSUPPORTED where bodies around were saved with margins, or where the entries of |R^T R - 1| add up to
   1e-13 or more: make such matrices orthonormal first. */
COLLIDE_API collide_status collide_robot_move_around(collide_robot_workspace *workspace, const int32_t *bodies, size_t n,
                                                     const double *X_WBs, size_t *failed);

/* Where a body around, -1 - k of body k, stands for a workspace: as in the file, or as it was moved. */
COLLIDE_API collide_status collide_robot_pose_around(const collide_robot_workspace *workspace, int32_t body, double X_WB[16]);

/* Attach an object to the link of a body of the robot, for the questions of this workspace alone: a grasped part. object : a union, not
   copied, of which no part is a half-space: free it once it is detached. X_LS : its pose in the link. padding : what it is swollen by
   against bodies around [m], >= 0, below 1e6; other than 0 where the file was saved with padding alone. touch : numbers of n_touch bodies, of
   the robot, objects or around, that are never tested against it, beside those of its own link; all others are. (A world's groups, masks
   and sleep are not in a file: name bodies that they exclude.) *number : of the object in rows and calls, behind all bodies that there are.
   Answers are then those of a checker in Python after `attach`, bit by bit. O(bodies + pairs). Spheres and maps, by which some robots
   are asked faster, are not used while anything is attached: of such robots motions may stay COLLIDE_MOTION_OPEN that Python proves.
   COLLIDE_TOO_MANY: 16 objects are carried, or more parts than the file has room
   for, 16 as Python writes it. COLLIDE_UNSUPPORTED: a half-space, or padding where the file has none; beside bodies around or links that are
   meshes, not convex, configurations and motions are left to Python where the object comes near them, or a motion's time is another one at which it
   collides. Where it is not COLLIDE_OK nothing has
   changed. */
COLLIDE_API collide_status collide_robot_attach(collide_robot_workspace *workspace, int32_t body, const collide_compound *object,
                                                const double X_LS[16], double padding, const int32_t *touch, size_t n_touch,
                                                int32_t *number);

/* Take an object away that was attached to this workspace; the numbers of those attached later become less by one. */
COLLIDE_API collide_status collide_robot_detach(collide_robot_workspace *workspace, int32_t number);

/* Never test n pairs of bodies from now on, two numbers each, in this workspace: of the robot, objects or around. What is allowed of
   an object is forgotten as it is detached. O(n * pairs). */
COLLIDE_API collide_status collide_robot_allow(collide_robot_workspace *workspace, const int32_t *pairs, size_t n);

/* Whether each of n configurations collides: hits[k]. A few microseconds each, fastest eight and more at a time. */
COLLIDE_API collide_status collide_robot_collide(collide_robot_workspace *workspace, const double *configurations, size_t n,
                                                 uint8_t *hits, collide_status *statuses, size_t *failed);

/* Pairs between which bodies distances are asked, to be joined by |. */
enum { COLLIDE_WITH_AROUND = 1, COLLIDE_AMONG_ROBOT = 2 };

/* The nearest pair of each of n configurations, or the deepest where some overlap. max_distance : >= 0, or infinite. In a row a is a
   body of the robot, b another or -1 - k for body k around, part_a and part_b numbers of convex parts; where no tested pair is
   within max_distance a is -1, beyond 1, lower max_distance and upper infinite. gradients : NULL, or a row of columns for each:
   derivatives of the distance [m/rad or m/m], NaN where there is none, as at 0. */
COLLIDE_API collide_status collide_robot_distance(collide_robot_workspace *workspace, const double *configurations, size_t n,
                                                  double max_distance, unsigned between, collide_pair *pairs,
                                                  double *gradients, collide_status *statuses, size_t *failed);

/* All pairs of bodies within max_distance, the nearest parts of each: those of configuration k are starts[k] to starts[k + 1] - 1,
   sorted by bodies, those around last; of configurations left to Python there are none. pairs, and gradients unless NULL: room for
   `capacity` rows. starts : room for n + 1. COLLIDE_TOO_MANY: go on from configuration *failed with more room; what is before it is
   good. */
COLLIDE_API collide_status collide_robot_near(collide_robot_workspace *workspace, const double *configurations, size_t n,
                                              double max_distance, unsigned between, collide_pair *pairs,
                                              double *gradients, size_t capacity, size_t *starts,
                                              collide_status *statuses, size_t *failed);

enum {
    COLLIDE_MOTION_OPEN = 0,    /* neither proven free nor found to collide, at the resolution asked */
    COLLIDE_MOTION_FREE = 1,    /* proven: at no time do tested pairs meet */
    COLLIDE_MOTION_COLLIDES = 2 /* at times[k] */
};

/* Verdicts on n straight motions q(t) = first + t (last - first), 0 <= t <= 1, of rows of `first` and `last`: proven, not sampled.
   resolution > 0 : intervals in which no column changes by more are not halved any more [rad or m]. A motion along which bodies graze
   each other is asked at every resolution of its way, some microseconds each, as far as they do: 1e-3 is soon told, 1e-9 may take hours,
   and nothing else ends a call. times : NULL, or room for n: a
   time of a collision, not always the first; NaN of others. */
COLLIDE_API collide_status collide_robot_certify(collide_robot_workspace *workspace, const double *first, const double *last,
                                                 size_t n, double resolution, uint8_t *verdicts, double *times,
                                                 collide_status *statuses, size_t *failed);

/* Whether n straight motions collide at samples: both ends, the middle, quarters, until no column changes by more than `resolution`
   from one to the next. What is between two samples is not looked at. hits, times : as above. */
COLLIDE_API collide_status collide_robot_sample(collide_robot_workspace *workspace, const double *first, const double *last,
                                                size_t n, double resolution, uint8_t *hits, double *times,
                                                collide_status *statuses, size_t *failed);

#ifdef __cplusplus
}
#endif

#endif
