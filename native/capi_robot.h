/* Robots: tables from a file that Python wrote, and what kernels read of them (collide/robots). */
#ifndef COLLIDE_CAPI_ROBOT_H
#define COLLIDE_CAPI_ROBOT_H

#include "capi_arena.h"
#include "capi_internal.h"

/* Layouts, as Python's modules have them; `robot_layouts_fit` compares them with what the kernels say. */
enum {
    JOINT_INTS = 5, JOINT_DOUBLES = 23, BODY_INTS = 4, BOX = 6, NODE_LINK = 3, BODY_SPHERES = 5, SPHERE = 6,
    PART_NUMBERS = 6, MAP_INTS = 5, MAP_DOUBLES = 4,
    LINK_POSE = 12, MATRIX = 16, LANES = 8, OPEN_INTS = 4, OPEN_PAIR = 3, SPHERE_PLACE = 4, INTERVAL = 4, MAX_INTERVALS = 96, MAX_PIECES = 32,
    ITEM = 4, OPEN_INTERVAL = 5, MAX_DEGREE = 15, CURSOR = 3, OPEN_SAMPLE = 2
};

/* Header of a scene (collide/robots/check_scene.py). */
enum {
    JOINT_INTS_AT, JOINT_DOUBLES_AT, N_JOINTS, ROOT, BASE_AT, N_LINKS, CORE_CODE,
    BODIES_AT, BODY_BOXES_AT, N_BODIES, SELF_PAIRS_AT, N_SELF_PAIRS,
    PARTS_AT, N_LINK_PARTS, TWINS_AFTER, PART_BOXES_AT, IS_BOUND_AT, N_PARTS,
    NODES_AT, NODE_LINKS_AT, N_NODES, UNBOUNDED_AT, N_UNBOUNDED, BODY_OF_AT, PART_POSES_AT, ALLOWED_AT, N_AROUND,
    SHAPE_INTS_AT, SHAPE_NUMBERS_AT, TERMS_AT, SHAPE_OF_PART_AT,
    PART_PLACES_AT, LINKS_AT, WORLD_BOXES_AT, PLACED_AT, CANDIDATES_AT, PAIR_AT, ROW_AT, PAIR_DOUBLES_AT, PAIR_INTEGERS_AT,
    OPEN_AT, OPEN_CAPACITY, N_OPEN, STAMP,
    STATE_OF_PART, GAP_OF_PART, WALKS_AT,
    SPHERE_HEADER_AT, MESH_QUESTIONS_AT, MESH_POSES_AT, MESH_ROW_AT,
    SLACK,
    SCENE_HEADER
};
/* Header of spheres (collide/robots/sphere_lanes.py). */
enum {
    SPHERE_COUNTS_AT, AROUND_BODIES_AT, SPHERES_AT, PART_KINDS_AT, PART_NUMBERS_AT, N_SPHERES,
    COLUMNS_AT, N_COLUMNS, LINK_LANES_AT, AROUND_LANES_AT, SPHERE_LANES_AT, SPHERES_PLACED_AT, N_PLACED,
    VERDICTS_AT, FEWEST, OPEN_PAIRS_AT, N_OPEN_PAIRS, PAIR_CAPACITY,
    MAP_INTS_AT, MAP_DOUBLES_AT, MAP_CELLS_AT, N_MAPS, SPANS_AT, FLAGS_AT,
    PIECES_AT, HALF_LANES_AT, MOVED_LANES_AT,
    SPHERE_HEADER
};
/* Header of motions (collide/robots/motion_bounds.py). */
enum {
    PATHS_AT, PATH_LENGTHS_AT, BETWEEN_AT, PATH_STRIDE,
    CONFIGURATION_AT, MOVED_AT, INTERVALS_AT, ITEMS_AT, ITEM_CAPACITY,
    OPEN_INTERVALS_AT, OPEN_INTERVAL_CAPACITY, N_OPEN_INTERVALS, N_CHECKED,
    MESH_PAIRS_AT, MESH_PAIR_CAPACITY, N_MESH_PAIRS,
    MOTION_KIND, DEGREE, IS_EARLIEST, CELL_LIMIT, OPEN_STRIDE,
    CHANGES_AT, POINTS_AT, BOXES_AT, HITS_AT,
    RESOLUTION, ROUNDING,
    MOTION_HEADER
};
/* Words of a search for distances, and what its rows are of (collide/robots/nearest_pairs.py). */
enum { PER, BETWEEN, SLOTS, REACHES_AT, IS_ASKED_AT, N_ROWS, SLOT_OF_AT, SEARCH };
enum { OF_ROBOT = 0, OF_PAIR = 2, WITH_AROUND = 1, AMONG_ROBOT = 2 };

/* Objects that a workspace carries at once. */
enum { MAX_OBJECTS = 16 };

/* What a file has as plain numbers (collide/robots/checker_file.py). */
enum {
    F_COLUMNS, F_SHAPES, F_HAS_SPHERES, F_HAS_MESHES, F_FACET_BODIES, F_HAS_MARGINS,
    F_LINKS, F_JOINTS, F_BODIES, F_LINK_PARTS, F_PARTS, F_SELF_PAIRS, F_AROUND, F_NODES, F_UNBOUNDED, F_ROOT, F_TWINS_AFTER,
    F_SPHERES, F_MAPS, F_FEWEST,
    F_STRIDE, F_ITEMS,
    F_SIZES
};
/* Doubles of the file: pose of the root, slack of boxes, rounding of motions. */
enum { S_BASE, S_SLACK = LINK_POSE, S_ROUNDING, S_COUNT };

/* Sections of a file, in its order: name, type, how many elements there are, by sizes n; -1 where the file says. */
#define ROBOT_SECTIONS                                                                                                    \
    X(sizes, int64_t, F_SIZES)                                                                                            \
    X(names, uint8_t, -1)                                                                                                 \
    X(scalars, double, S_COUNT)                                                                                           \
    X(joint_ints, int64_t, JOINT_INTS * n[F_JOINTS])                                                                      \
    X(joint_doubles, double, JOINT_DOUBLES * n[F_JOINTS])                                                                 \
    X(moves, uint8_t, n[F_JOINTS] * n[F_LINKS])                                                                           \
    X(shape_ints, int64_t, 4 * n[F_SHAPES])                                                                               \
    X(shape_numbers, double, NUMBERS * n[F_SHAPES])                                                                       \
    X(points, double, -1)                                                                                                 \
    X(bodies, int64_t, BODY_INTS * n[F_BODIES])                                                                           \
    X(body_boxes, double, BOX * n[F_BODIES])                                                                              \
    X(parts, double, PART * n[F_LINK_PARTS])                                                                              \
    X(part_boxes, double, BOX * n[F_PARTS])                                                                               \
    X(is_bound, uint8_t, n[F_PARTS])                                                                                      \
    X(shape_of, int64_t, n[F_PARTS])                                                                                      \
    X(poses, double, POSE * (n[F_PARTS] - n[F_LINK_PARTS]))                                                               \
    X(part_poses, double, MATRIX * (n[F_PARTS] - n[F_LINK_PARTS]))                                                        \
    X(body_of, int64_t, n[F_PARTS] - n[F_LINK_PARTS])                                                                     \
    X(around_poses, double, MATRIX * n[F_AROUND])                                                                         \
    X(self_pairs, int64_t, 2 * n[F_SELF_PAIRS])                                                                           \
    X(allowed, uint8_t, n[F_BODIES] * n[F_AROUND])                                                                        \
    X(nodes, double, BOX * n[F_NODES])                                                                                    \
    X(node_links, int64_t, NODE_LINK * n[F_NODES])                                                                        \
    X(unbounded, int64_t, n[F_UNBOUNDED])                                                                                 \
    X(sphere_counts, int64_t, BODY_SPHERES * n[F_BODIES] * n[F_HAS_SPHERES])                                              \
    X(around_bodies, double, SPHERE * n[F_BODIES] * n[F_HAS_SPHERES])                                                     \
    X(sphere_rows, double, SPHERE * n[F_SPHERES])                                                                         \
    X(part_kinds, int64_t, (n[F_PARTS] - n[F_LINK_PARTS]) * n[F_HAS_SPHERES])                                             \
    X(part_numbers, double, PART_NUMBERS * (n[F_PARTS] - n[F_LINK_PARTS]) * n[F_HAS_SPHERES])                             \
    X(map_ints, int64_t, MAP_INTS * n[F_MAPS])                                                                            \
    X(map_doubles, double, MAP_DOUBLES * n[F_MAPS])                                                                       \
    X(map_cells, uint8_t, -1)                                                                                             \
    X(paths, int64_t, n[F_BODIES] * n[F_STRIDE])                                                                          \
    X(path_lengths, int64_t, n[F_BODIES])                                                                                 \
    X(between, int64_t, 2 * n[F_SELF_PAIRS])                                                                              \
    X(questions, int64_t, 4 * n[F_BODIES] * (n[F_AROUND] + n[F_BODIES]) * n[F_HAS_MESHES])                                \
    X(facet_ints, int64_t, 4 * n[F_FACET_BODIES])                                                                         \
    X(facet_numbers, double, (1 + 2 * n[F_FACET_BODIES]) * n[F_HAS_MESHES])                                               \
    X(facet_vertices, double, -1)                                                                                         \
    X(facet_faces, int64_t, -1)

enum {
#define X(name, type, count) SECTION_##name,
    ROBOT_SECTIONS
#undef X
    N_SECTIONS
};

struct collide_robot {
    int64_t word;
    const struct collide_kernels *kernels;
    int64_t *file; /* the words that the sections are in */
    int64_t counts[N_SECTIONS];
#define X(name, type, count) const type *name;
    ROBOT_SECTIONS
#undef X
    const char **texts; /* of columns, bodies, bodies around */
    collide_shape **shapes;
    collide_mesh **meshes; /* bodies of facets */
    int64_t *shape_rows; /* of INTS, and the file's rows of doubles */
    struct arena arena;  /* all but the shapes */
};

/* What a thread's questions are worked out in. */
struct collide_robot_workspace {
    int64_t word;
    const collide_robot *robot;
    collide_workspace *pairs; /* of questions about meshes, or NULL */
    int64_t scene[SCENE_HEADER], spheres[SPHERE_HEADER], motions[MOTION_HEADER], search[SEARCH];
    double *reaches; /* of slots, a byte each whether they are asked, rows: as many as there is room for */
    uint8_t *is_asked;
    collide_pair *rows;
    int64_t n_rows;
    double *samples, *sampled; /* configurations of a motion; samples left to others */
    double *intervals;         /* open ones, then pairs of meshes, half of the memory each */
    int64_t n_intervals;
    double *X_WBs, *moved, *boxes; /* of bodies around: poses as they stand, poses to be, boxes of their parts */
    struct robot_objects *objects; /* NULL until something is attached or allowed */
    struct arena arena;            /* all that does not grow */
};

/* Which of n answers are left to Python. */
struct unanswered {
    collide_status *statuses;
    size_t *failed;
    size_t first; /* n where there is none */
};
struct unanswered begin_unanswered(collide_status *statuses, size_t *failed, size_t n);
void note_unanswered(struct unanswered *rest, size_t k);
/* What a function returns whose answers these are, of n. */
collide_status end_unanswered(const struct unanswered *rest, size_t n);

/* Whether n configurations are there, and finite. */
int are_configurations(const collide_robot_workspace *space, const double *q, size_t n);

/* capi_robot_motions.c: room for motions, as a workspace begins; 0 where there is none. */
int begin_motions(collide_robot_workspace *space);
void end_motions(collide_robot_workspace *space);

/* capi_robot_around.c: bodies around as the file has them, in a workspace's own tables. */
void begin_around(collide_robot_workspace *space);

/* capi_robot_objects.c */
void end_objects(collide_robot_workspace *space);

/* capi_robot_meshes.c: bodies of facets, and whether questions name these alone; questions of a workspace, 0 without memory. */
collide_status read_meshes(collide_robot *robot);
void free_meshes(collide_robot *robot);
int begin_meshes(collide_robot_workspace *space);

/* capi_robot_checks.c: COLLIDE_OK where nothing that kernels follow leads out of the tables. */
collide_status check_robot(const collide_robot *robot);

#endif
