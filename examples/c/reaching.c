/* A gripper of two fingers and a palm over a table: how far down it can go, what a ray sees, when it arrives, what it touches.

   make && ./reaching */
#include "helpers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { PARTS = 3, MOST = 16 };

int main(void)
{
    const double palm_size[3] = {0.1, 0.2, 0.04}, finger_size[3] = {0.02, 0.02, 0.12}, plate[3] = {1.0, 1.0, 0.1}; /* [m] */
    const double down[3] = {0.0, 0.0, -1.0}, eye[3] = {0.1, 0.02, 0.48};
    collide_shape *palm = NULL, *finger = NULL, *table = NULL;
    const collide_shape *parts[PARTS];
    collide_compound *gripper = NULL, *scene = NULL;
    collide_workspace *workspace = NULL;
    collide_first_contact first;
    collide_time_of_impact impact;
    collide_contact contacts[MOST];
    collide_ray_hit seen;
    collide_poses place;
    collide_vectors origin, direction;
    double X_GP[16 * PARTS], X_WG[16], X_WT[16], X_end[16], identity[16];
    size_t count = 0;

    require(collide_box(palm_size, &palm), "palm");
    require(collide_box(finger_size, &finger), "finger");
    require(collide_box(plate, &table), "table");
    require(collide_workspace_create(&workspace), "workspace");
    parts[0] = palm;
    parts[1] = parts[2] = finger;
    set_place(X_GP, 0.0, 0.0, 0.0);
    set_place(X_GP + 16, 0.0, -0.08, -0.08);
    set_place(X_GP + 32, 0.0, 0.08, -0.08);
    set_place(identity, 0.0, 0.0, 0.0);
    require(collide_compound_create(parts, X_GP, PARTS, &gripper), "gripper");
    require(collide_compound_create((const collide_shape *const *)&table, identity, 1, &scene), "scene");
    set_place(X_WG, 0.1, 0.0, 0.5);
    set_place(X_WT, 0.0, 0.0, -0.05);

    /* Straight down, until a finger touches. */
    require(collide_compound_cast(workspace, gripper, scene, X_WG, X_WT, down, INFINITY, 0, &first), "cast");
    printf("the gripper goes down %.3f m, then part %d touches\n", first.distance, (int)first.part_a);

    /* What a sensor in the middle of the palm sees. */
    place.matrices = X_WT;
    origin.xyz = eye;
    direction.xyz = down;
    place.count = origin.count = direction.count = 1;
    require(collide_raycast(workspace, table, place, origin, direction, INFINITY, 0, &seen, NULL, NULL), "ray");
    printf("a ray from the palm meets the table after %.3f m\n", seen.distance);

    /* When the palm alone would arrive, on its way through the table. */
    set_place(X_end, 0.1, 0.0, -0.5);
    require(collide_impact(workspace, palm, table, X_WG, X_end, X_WT, X_WT, NULL, NULL, 1e-9, 0, &impact), "impact");
    printf("the palm arrives at %.2f of its way\n", impact.time);

    /* Where the fingers stand, half a millimetre before they touch. */
    X_WG[11] -= first.distance - 0.0005;
    require(collide_compound_contacts(workspace, gripper, scene, X_WG, X_WT, 0.001, 4, 0, contacts, MOST, &count), "contacts");
    printf("%d contacts, of parts %d to %d, %.1f mm apart\n", (int)count, (int)contacts[0].part_a,
           (int)contacts[count - 1].part_a, 1e3 * contacts[0].distance);

    collide_compound_free(scene);
    collide_compound_free(gripper);
    collide_workspace_free(workspace);
    collide_shape_free(table);
    collide_shape_free(finger);
    collide_shape_free(palm);
    return 0;
}
