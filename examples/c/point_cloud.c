/* A scan of a room as an obstacle: does a robot's link meet it, how far is it away, which points are nearest; the same as voxels.

   make && ./point_cloud */
#include "helpers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 100, POINTS = SIDE * SIDE, POSES = 41, NEAREST = 3 };

/* What a sensor might give: a floor with a bump in its middle, a point every 2 cm. */
static void scan(double *points)
{
    int i, j;
    for (i = 0; i < SIDE; i++)
        for (j = 0; j < SIDE; j++) {
            double *p = points + 3 * (SIDE * i + j), x = 0.02 * i - 1.0, y = 0.02 * j - 1.0;
            p[0] = x;
            p[1] = y;
            p[2] = 0.3 / (1.0 + 20.0 * (x * x + y * y));
        }
}

/* Whether a link that comes down meets the obstacle, at all heights in one call, and the gap above. */
static void come_down(collide_workspace *workspace, const collide_field *obstacle, const collide_shape *link, const char *name)
{
    double X_WF[16], X_WS[16 * POSES];
    collide_poses still, falling;
    collide_pair row;
    uint8_t hits[POSES];
    size_t failed = 0;
    int k, first = 0;

    set_place(X_WF, 0.0, 0.0, 0.0);
    for (k = 0; k < POSES; k++) set_place(X_WS + 16 * k, 0.0, 0.0, 1.0 - 0.02 * k);
    still.matrices = X_WF;
    still.count = 1;
    falling.matrices = X_WS;
    falling.count = POSES;
    require(collide_field_collide_batch(workspace, obstacle, link, still, falling, 0, hits, &failed), "batch");
    while (first < POSES && !hits[first]) first++;
    require(collide_field_distance(workspace, obstacle, link, X_WF, X_WS, INFINITY, COLLIDE_UNSIGNED, &row), "distance");
    printf("%s: met from z = %.2f m on; from 1 m it is %.4f m away, item %d\n", name, 1.0 - 0.02 * first, row.distance, row.part_a);
}

int main(void)
{
    const double radius = 0.01, cell[3] = {0.05, 0.05, 0.05}, origin[3] = {-1.0, -1.0, 0.0}, place[3] = {0.0, 0.0, 0.4};
    const size_t cells[3] = {40, 40, 8};
    double *points = malloc(3 * POINTS * sizeof *points), distances[NEAREST];
    uint8_t *occupied = calloc(40 * 40 * 8, 1);
    int64_t rows[NEAREST];
    collide_shape *link = NULL;
    collide_field *cloud = NULL, *grid = NULL;
    collide_workspace *workspace = NULL;
    size_t count = 0;
    int k;

    if (points == NULL || occupied == NULL) return 1;
    scan(points);
    for (k = 0; k < POINTS; k++) {
        const double *p = points + 3 * k;
        int i = (int)((p[0] + 1.0) / 0.05 + 1e-9), j = (int)((p[1] + 1.0) / 0.05 + 1e-9);
        occupied[(40 * i + j) * 8 + (int)(p[2] / 0.05)] = 1;
    }

    /* Fields never change, as shapes: make them once for all threads. */
    require(collide_point_cloud_create(points, POINTS, &radius, 1, &cloud), "cloud");
    require(collide_voxel_grid_create(occupied, cells, cell, origin, &grid), "grid");
    require(collide_capsule(0.05, 0.3, &link), "capsule");
    require(collide_workspace_create(&workspace), "workspace");

    come_down(workspace, cloud, link, "cloud");
    come_down(workspace, grid, link, "voxels");

    require(collide_point_cloud_nearest(cloud, place, 1, NEAREST, INFINITY, distances, rows), "nearest");
    for (k = 0; k < NEAREST; k++) printf("point %d is %.4f m from the place above the bump\n", (int)rows[k], distances[k]);
    if (collide_point_cloud_within(cloud, place, 0.2, NULL, 0, &count) == COLLIDE_TOO_MANY)
        printf("%d points are within 0.2 m of it\n", (int)count);

    collide_workspace_free(workspace);
    collide_shape_free(link);
    collide_field_free(grid);
    collide_field_free(cloud);
    free(occupied);
    free(points);
    return 0;
}
