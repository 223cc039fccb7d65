/* Contacts of a box that comes down on a table: one pair, then a fall of a hundred poses in one call.

   make && ./resting */
#include "helpers.h"

#include <stdio.h>
#include <stdlib.h>

enum { POSES = 100, MOST = 8 };

int main(void)
{
    const double plate[3] = {2.0, 1.0, 0.1}, size[3] = {0.2, 0.3, 0.4}, margin = 0.002; /* [m] */
    collide_shape *table = NULL, *box = NULL;
    collide_workspace *workspace = NULL;
    collide_contact contacts[MOST], *rows = malloc(POSES * MOST * sizeof *rows);
    collide_poses still, falling;
    double X_WA[16], X_WB[16], *path = malloc(16 * POSES * sizeof *path);
    size_t count = 0, starts[POSES + 1], failed = 0, k;

    if (rows == NULL || path == NULL) return 1;
    require(collide_box(plate, &table), "table");
    require(collide_box(size, &box), "box");
    require(collide_workspace_create(&workspace), "workspace");

    /* A millimetre above the table: within the margin, so that a solver sees all four corners before they touch. */
    set_place(X_WA, 0.0, 0.0, -0.05);
    set_place(X_WB, 0.9, 0.0, 0.201);
    require(collide_contacts(workspace, table, box, X_WA, X_WB, margin, MOST, 0, contacts, &count), "contacts");
    printf("%d contacts, the normal is (%g, %g, %g)\n", (int)count, contacts[0].normal[0], contacts[0].normal[1],
           contacts[0].normal[2]);
    for (k = 0; k < count; k++)
        printf("  (%6.3f, %6.3f)  gap %.4f mm  corner %d of the box\n", contacts[k].point_b[0], contacts[k].point_b[1],
               1e3 * contacts[k].distance, contacts[k].feature_b % 4 == 0 ? contacts[k].feature_b / 4 : -1);

    /* Many poses at once: rows of one pose after another's. */
    for (k = 0; k < POSES; k++) set_place(path + 16 * k, 0.0, 0.0, 0.205 - 0.0001 * (double)k);
    still.matrices = X_WA;
    still.count = 1;
    falling.matrices = path;
    falling.count = POSES;
    require(collide_contacts_batch(workspace, table, box, still, falling, margin, MOST, 0, rows, POSES * MOST, starts, &failed),
            "batch");
    for (k = 0; k < POSES && starts[k + 1] == starts[k]; k++) {}
    printf("of %d poses the first within the margin is %d, with a gap of %.2f mm; %d rows in all\n", POSES, (int)k,
           1e3 * rows[starts[k]].distance, (int)starts[POSES]);

    collide_workspace_free(workspace);
    collide_shape_free(box);
    collide_shape_free(table);
    free(path);
    free(rows);
    return 0;
}
