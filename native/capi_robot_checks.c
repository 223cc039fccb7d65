/* What a file says of a robot, looked through before any kernel reads it: every number that leads somewhere leads into its table,
   every walk ends, every matrix is nearly a rotation. A digest tells damage; these checks tell lies that would be followed. */
#include "capi_robot.h"

#include <math.h>
#include <stdlib.h>

/* Joints (collide/robots/forward_kinematics.py) and rows of parts (collide/lowering/compound_table.py). */
enum { FIXED, ROTATION, ROTATION_ABOUT_COORDINATE, TRANSLATION, PLANAR, FLOATING };
enum { J_KIND, J_PARENT, J_CHILD, J_COLUMN, J_COORDINATE };
enum { J_AXIS = 12, J_ACROSS = 15 };
enum { B_LINK, B_FIRST, B_COUNT, B_TWINS };
enum { NODE_SKIP, NODE_BODY };
enum { PART_TURNED = 12, POSE_TERMS = 13 };
enum { FIRST_OUTER, N_OUTER, FIRST_INNER, N_INNER };
enum { SWEPT_BOX, ONLY_BOXED = 3 };
enum { FIRST_COLUMN, SECOND_COLUMN, N_FIRST, N_SECOND, CELLS_BEGIN };

static int is_index(int64_t value, int64_t n) { return value >= 0 && value < n; }
/* Whether `count` things from `first` on are among n; nothing overflows. */
static int is_run(int64_t first, int64_t count, int64_t n) { return first >= 0 && count >= 0 && count <= n && first <= n - count; }

static int are_indices(const int64_t *values, int64_t count, int64_t n)
{
    int64_t k;
    for (k = 0; k < count; k++) if (!is_index(values[k], n)) return 0;
    return 1;
}

static int are_coordinates(const double *values, int64_t count)
{
    int64_t k;
    for (k = 0; k < count; k++) if (!is_coordinate(values[k])) return 0;
    return 1;
}

/* Numbers, infinite ones among them. */
static int are_numbers(const double *values, int64_t count)
{
    int64_t k;
    for (k = 0; k < count; k++) if (values[k] != values[k]) return 0;
    return 1;
}

/* A row of R, 9 doubles, and t: R^T R off the identity by at most 1e-3. Products of poses that are let pass are, too. */
static int is_placement(const double *X)
{
    int i, j;
    if (!are_coordinates(X, LINK_POSE)) return 0;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            if (!(fabs(X[i] * X[j] + X[3 + i] * X[3 + j] + X[6 + i] * X[6 + j] - (i == j)) <= 1e-3)) return 0;
    return 1;
}

/* n matrices of a body's pose, or of a part in its body. */
static int are_matrices(const double *X, int64_t n)
{
    for (; n > 0; n--, X += MATRIX) {
        const double rows[LINK_POSE] = {X[0], X[1], X[2], X[4], X[5], X[6], X[8], X[9], X[10], X[3], X[7], X[11]};
        if (!is_placement(rows)) return 0;
    }
    return 1;
}

static int is_axis(const double *v) { return fabs(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 1.0) <= 1e-3; }

/* Links form a tree: every link but the root is the child of one joint, whose parent comes before. `seen` : a byte a link. */
static int are_joints(const collide_robot *robot, uint8_t *seen)
{
    static const int64_t widths[] = {0, 1, 1, 1, 3, 6};
    const int64_t *n = robot->sizes;
    int64_t k;
    if (n[F_JOINTS] != n[F_LINKS] - 1) return 0;
    seen[n[F_ROOT]] = 1;
    for (k = 0; k < n[F_JOINTS]; k++) {
        const int64_t *joint = robot->joint_ints + JOINT_INTS * k;
        const double *numbers = robot->joint_doubles + JOINT_DOUBLES * k;
        if (!is_index(joint[J_KIND], FLOATING + 1) || !is_index(joint[J_PARENT], n[F_LINKS]) || !seen[joint[J_PARENT]] ||
            !is_index(joint[J_CHILD], n[F_LINKS]) || seen[joint[J_CHILD]] || !is_index(joint[J_COORDINATE], 3) ||
            !is_run(joint[J_COLUMN], widths[joint[J_KIND]], n[F_COLUMNS]))
            return 0;
        if (!is_placement(numbers) || !are_coordinates(numbers, JOINT_DOUBLES)) return 0;
        if (joint[J_KIND] != FIXED && joint[J_KIND] != FLOATING && !is_axis(numbers + J_AXIS)) return 0;
        if (joint[J_KIND] == PLANAR && !(is_axis(numbers + J_ACROSS) && is_axis(numbers + J_ACROSS + 3))) return 0;
        seen[joint[J_CHILD]] = 1;
    }
    return 1;
}

static int are_bodies(const collide_robot *robot)
{
    const int64_t *n = robot->sizes;
    int64_t k;
    for (k = 0; k < n[F_BODIES]; k++) {
        const int64_t *body = robot->bodies + BODY_INTS * k;
        if (!is_index(body[B_LINK], n[F_LINKS]) || !is_run(body[B_FIRST], body[B_COUNT], n[F_LINK_PARTS] - n[F_TWINS_AFTER]) ||
            (body[B_TWINS] != 0 && body[B_TWINS] != n[F_TWINS_AFTER]))
            return 0;
    }
    for (k = 0; k < n[F_SELF_PAIRS]; k++)
        if (robot->self_pairs[2 * k] == robot->self_pairs[2 * k + 1]) return 0;
    return are_indices(robot->self_pairs, 2 * n[F_SELF_PAIRS], n[F_BODIES]) &&
           are_coordinates(robot->scalars, S_COUNT) && is_placement(robot->scalars + S_BASE) &&
           robot->scalars[S_SLACK] >= 0.0 && robot->scalars[S_ROUNDING] >= 0.0 &&
           are_numbers(robot->body_boxes, BOX * n[F_BODIES]);
}

static int are_parts(const collide_robot *robot)
{
    const int64_t *n = robot->sizes, around = n[F_PARTS] - n[F_LINK_PARTS];
    int64_t k;
    for (k = 0; k < n[F_LINK_PARTS]; k++) {
        const double *part = robot->parts + PART * k;
        /* Rows of which no body has the part are zeros: a matrix is asked of those that are turned. */
        if (!are_coordinates(part, PART) || (part[PART_TURNED] != 0.0 && !is_placement(part))) return 0;
    }
    for (k = 0; k < around; k++) {
        const double *pose = robot->poses + POSE * k;
        if (!is_placement(pose) || !are_coordinates(pose, POSE) || pose[POSE_TERMS] != -1.0) return 0;
    }
    return are_numbers(robot->part_boxes, BOX * n[F_PARTS]) && are_indices(robot->shape_of, n[F_PARTS], n[F_SHAPES]) &&
           are_indices(robot->body_of, around, n[F_AROUND]) && are_matrices(robot->part_poses, around) &&
           are_matrices(robot->around_poses, n[F_AROUND]);
}

/* A walk goes on to the next node or to one behind it, and meets every part around once at most. `seen` : a byte a part. */
static int is_tree(const collide_robot *robot, uint8_t *seen)
{
    const int64_t *n = robot->sizes, around = n[F_PARTS] - n[F_LINK_PARTS];
    int64_t k;
    for (k = 0; k < n[F_NODES]; k++) {
        const int64_t *node = robot->node_links + NODE_LINK * k;
        if (node[NODE_SKIP] <= k || node[NODE_SKIP] > n[F_NODES] || node[NODE_BODY] >= around) return 0;
        if (node[NODE_BODY] >= 0 && seen[node[NODE_BODY]]++ != 0) return 0;
    }
    for (k = 0; k < n[F_UNBOUNDED]; k++)
        if (!is_index(robot->unbounded[k], around) || seen[robot->unbounded[k]]++ != 0) return 0;
    for (k = 0; k < around; k++) if (!seen[k]) return 0; /* a part that no walk meets would be free of everything */
    return are_numbers(robot->nodes, BOX * n[F_NODES]);
}

static int are_spheres(const collide_robot *robot)
{
    const int64_t *n = robot->sizes, around = n[F_PARTS] - n[F_LINK_PARTS];
    int64_t k;
    if (n[F_HAS_SPHERES] == 0) return n[F_SPHERES] == 0 && n[F_MAPS] == 0;
    for (k = 0; k < n[F_BODIES]; k++) {
        const int64_t *counts = robot->sphere_counts + BODY_SPHERES * k;
        if (!is_run(counts[FIRST_OUTER], counts[N_OUTER], n[F_SPHERES]) ||
            !is_run(counts[FIRST_INNER], counts[N_INNER], n[F_SPHERES]))
            return 0;
    }
    for (k = 0; k < n[F_MAPS]; k++) {
        const int64_t *map = robot->map_ints + MAP_INTS * k, cells = robot->counts[SECTION_map_cells];
        if (!is_run(map[N_FIRST], 0, cells) || !is_run(map[N_SECOND], 0, cells) ||
            (map[N_SECOND] > 0 && map[N_FIRST] > cells / map[N_SECOND]) ||
            !is_run(map[CELLS_BEGIN], map[N_FIRST] * map[N_SECOND], cells) ||
            !is_index(map[FIRST_COLUMN], n[F_COLUMNS]) || !is_index(map[SECOND_COLUMN], n[F_COLUMNS]))
            return 0;
    }
    return n[F_MAPS] <= n[F_SELF_PAIRS] && are_coordinates(robot->around_bodies, SPHERE * n[F_BODIES]) &&
           are_coordinates(robot->sphere_rows, SPHERE * n[F_SPHERES]) && are_coordinates(robot->map_doubles, MAP_DOUBLES * n[F_MAPS]) &&
           are_indices(robot->part_kinds, around, ONLY_BOXED + 1) && are_numbers(robot->part_numbers, PART_NUMBERS * around);
}

static int are_paths(const collide_robot *robot)
{
    const int64_t *n = robot->sizes;
    int64_t k;
    for (k = 0; k < n[F_BODIES]; k++) {
        int64_t length = robot->path_lengths[k];
        if (!is_index(length, n[F_STRIDE] + 1) || !are_indices(robot->paths + n[F_STRIDE] * k, length, n[F_JOINTS])) return 0;
    }
    for (k = 0; k < 2 * n[F_SELF_PAIRS]; k++)
        if (!is_index(robot->between[k], robot->path_lengths[robot->self_pairs[k]] + 1)) return 0;
    return 1;
}

collide_status check_robot(const collide_robot *robot)
{
    const int64_t *n = robot->sizes;
    uint8_t *seen = calloc((size_t)(n[F_LINKS] + n[F_PARTS] + 1), 1);
    int is_sound;
    if (seen == NULL) return COLLIDE_NO_MEMORY;
    is_sound = are_joints(robot, seen) && are_bodies(robot) && are_parts(robot) && is_tree(robot, seen + n[F_LINKS]) &&
               are_spheres(robot) && are_paths(robot);
    free(seen);
    return is_sound ? COLLIDE_OK : COLLIDE_INVALID_FILE;
}
