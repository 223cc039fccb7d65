/* Bodies around a robot: tables of a workspace's own, in which they move, by the kernel of collide/robots/move_surroundings.py. */
#include "capi_robot.h"

#include <string.h>

/* Words of a node that say which part its box is of; and what the kernel says of a matrix that is off a rotation. */
enum { NODE_PART = 1, SKEWED = -1 };

/* Memory of its own for a table of the robot's, filled; NULL where there is none. */
static double *copied(collide_robot_workspace *space, const double *table, int64_t n)
{
    double *own = arena_zeroed(&space->arena, (size_t)n + 1, sizeof *own);
    if (own != NULL) memcpy(own, table, (size_t)n * sizeof *own);
    return own;
}

void begin_around(collide_robot_workspace *space)
{
    const collide_robot *robot = space->robot;
    const int64_t *n = robot->sizes;
    int64_t parts = n[F_PARTS] - n[F_LINK_PARTS], k;
    double *places, *nodes = copied(space, robot->nodes, BOX * n[F_NODES]);
    space->X_WBs = copied(space, robot->around_poses, MATRIX * n[F_AROUND]);
    space->moved = copied(space, robot->around_poses, MATRIX * n[F_AROUND]);
    space->boxes = arena_zeroed(&space->arena, (size_t)(BOX * parts) + 1, sizeof(double));
    if (space->arena.failed) return;
    space->scene[NODES_AT] = address_of(nodes);
    places = (double *)(intptr_t)space->scene[PART_PLACES_AT] + POSE * n[F_LINK_PARTS];
    memcpy(places, robot->poses, (size_t)(POSE * parts) * sizeof(double));
    /* A leaf has the box of its part; parts without a leaf are those without an end, whose boxes nothing reads. */
    for (k = 0; k < n[F_NODES]; k++) {
        int64_t part = robot->node_links[NODE_LINK * k + NODE_PART];
        if (part >= 0) memcpy(space->boxes + BOX * part, nodes + BOX * k, BOX * sizeof(double));
    }
}

/* Whether n bodies are around and their matrices poses; *failed becomes the first of which that is not so. */
static collide_status check_around(const collide_robot *robot, const int32_t *bodies, size_t n, const double *X_WBs, size_t *failed)
{
    double pose[POSE];
    int64_t bad;
    size_t k;
    if (n > 0 && (bodies == NULL || X_WBs == NULL)) return COLLIDE_INVALID_ARGUMENT;
    for (k = 0; k < n; k++) {
        if (bodies[k] < 0 && -1 - (int64_t)bodies[k] < robot->sizes[F_AROUND]) continue;
        *failed = k;
        return COLLIDE_INVALID_ARGUMENT;
    }
    bad = robot->kernels->first_bad_pose(address_of(X_WBs), MATRIX, 0, (int64_t)n, 1, address_of(pose));
    if (bad == (int64_t)n) return COLLIDE_OK;
    *failed = (size_t)bad;
    return COLLIDE_INVALID_POSE;
}

/* The kernel compares all poses with those before: bodies whose pose has other bits are brought there, or none of them. */
static collide_status move_around(collide_robot_workspace *space, const int32_t *bodies, size_t n, const double *X_WBs)
{
    const collide_robot *robot = space->robot;
    size_t bytes = (size_t)(MATRIX * robot->sizes[F_AROUND]) * sizeof(double), k;
    if (robot->sizes[F_HAS_MARGINS]) return COLLIDE_UNSUPPORTED;
    memcpy(space->moved, space->X_WBs, bytes);
    for (k = 0; k < n; k++)
        memcpy(space->moved + MATRIX * (-1 - (int64_t)bodies[k]), X_WBs + MATRIX * k, MATRIX * sizeof(double));
    if (robot->kernels->move_surroundings(address_of(space->scene), address_of(space->moved), address_of(space->X_WBs),
                                          address_of(robot->body_of), address_of(space->boxes)) == SKEWED)
        return COLLIDE_UNSUPPORTED;
    memcpy(space->X_WBs, space->moved, bytes);
    return COLLIDE_OK;
}

collide_status collide_robot_move_around(collide_robot_workspace *workspace, const int32_t *bodies, size_t n, const double *X_WBs,
                                         size_t *failed)
{
    collide_status status;
    rounding given;
    size_t unread;
    if (failed == NULL) failed = &unread;
    *failed = 0;
    if (!IS_HANDLE(workspace, ROBOT_SPACE_WORD)) return COLLIDE_INVALID_ARGUMENT;
    given = round_as_kernels_do();
    status = check_around(workspace->robot, bodies, n, X_WBs, failed);
    if (status == COLLIDE_OK && n > 0) status = move_around(workspace, bodies, n, X_WBs);
    round_as_before(given);
    return status;
}

collide_status collide_robot_pose_around(const collide_robot_workspace *workspace, int32_t body, double X_WB[16])
{
    if (!IS_HANDLE(workspace, ROBOT_SPACE_WORD) || X_WB == NULL || body >= 0 || -1 - (int64_t)body >= workspace->robot->sizes[F_AROUND])
        return COLLIDE_INVALID_ARGUMENT;
    memcpy(X_WB, workspace->X_WBs + MATRIX * (-1 - (int64_t)body), MATRIX * sizeof(double));
    return COLLIDE_OK;
}
