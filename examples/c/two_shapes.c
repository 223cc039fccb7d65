/* Two shapes: do they meet, how far are they apart, and along a path of poses.

   make && ./two_shapes */
#include <collide.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { POSES = 11 };

/* Leave with a sentence unless all went well. */
static void require(collide_status status, const char *what)
{
    if (status == COLLIDE_OK) return;
    fprintf(stderr, "%s: %s\n", what, collide_status_text(status));
    exit(1);
}

/* A pose turned about z by an angle [rad], at x, y, z [m]: row by row. */
static void set_pose(double *X, double angle, double x, double y, double z)
{
    double c = cos(angle), s = sin(angle);
    double pose[16] = {0};
    int k;
    pose[0] = c;
    pose[1] = -s;
    pose[4] = s;
    pose[5] = c;
    pose[10] = pose[15] = 1.0;
    pose[3] = x;
    pose[7] = y;
    pose[11] = z;
    for (k = 0; k < 16; k++) X[k] = pose[k];
}

int main(void)
{
    const double size[3] = {1.0, 2.0, 0.5}; /* full edge lengths [m] */
    collide_shape *box = NULL, *cylinder = NULL;
    collide_workspace *workspace = NULL;
    collide_poses still, moving;
    collide_pair pair;
    double X_WA[16], X_WB[16], path[16 * POSES];
    uint8_t hits[POSES];
    const char *level = NULL;
    size_t failed = 0;
    int hit = 0, k;

    require(collide_level(&level), "kernels");
    printf("collide %s, kernels for %s\n", collide_version(), level);

    /* Shapes never change: make them once. A workspace is scratch memory: one a thread. */
    require(collide_box(size, &box), "box");
    require(collide_cylinder(0.25, 1.0, &cylinder), "cylinder");
    require(collide_workspace_create(&workspace), "workspace");

    set_pose(X_WA, 0.0, 0.0, 0.0, 0.0);
    set_pose(X_WB, 0.3, 1.0, 0.0, 0.0);
    require(collide_collide(workspace, box, cylinder, X_WA, X_WB, 0, &hit), "collide");
    require(collide_distance(workspace, box, cylinder, X_WA, X_WB, INFINITY, 0, &pair), "distance");
    printf("one metre apart: %s, distance %.17g m, proven within [%.17g, %.17g]\n", hit ? "they meet" : "free", pair.distance,
           pair.lower, pair.upper);

    /* Many poses at once: the box stands, the cylinder comes nearer. */
    for (k = 0; k < POSES; k++) set_pose(path + 16 * k, 0.3, 1.5 - 0.1 * k, 0.0, 0.0);
    still.matrices = X_WA;
    still.count = 1;
    moving.matrices = path;
    moving.count = POSES;
    require(collide_collide_batch(workspace, box, cylinder, still, moving, 0, NULL, hits, &failed), "batch");
    for (k = 0; k < POSES; k++) printf("x = %.1f m: %s\n", 1.5 - 0.1 * k, hits[k] ? "they meet" : "free");

    /* What is wrong is told, and nothing is made of it. */
    X_WB[0] = 2.0;
    printf("a matrix that is no rotation: %s\n",
           collide_status_text(collide_collide(workspace, box, cylinder, X_WA, X_WB, 0, &hit)));

    collide_workspace_free(workspace);
    collide_shape_free(cylinder);
    collide_shape_free(box);
    return 0;
}
