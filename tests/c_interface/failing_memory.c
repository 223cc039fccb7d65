/* A world whose allocations fail one at a time: after each failure the call is made again, and nothing is to be
   different.

   Prints how many allocations there were, and in how many runs the answers were others or memory ran out without being told. */
#include "collide.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* glibc's own, which those below stand before. */
void *__libc_malloc(size_t bytes);
void *__libc_calloc(size_t n, size_t bytes);
void *__libc_realloc(void *memory, size_t bytes);

enum { BODIES = 20 };

static long n_allocations, failing = -1;
static int is_armed, has_failed;

/* Whether this allocation, of those within the calls that are tried, is the one that fails. */
static int fails(void)
{
    if (!is_armed || n_allocations++ != failing) return 0;
    has_failed = 1;
    return 1;
}

void *malloc(size_t bytes) { return fails() ? NULL : __libc_malloc(bytes); }
void *calloc(size_t n, size_t bytes) { return fails() ? NULL : __libc_calloc(n, bytes); }
void *realloc(void *memory, size_t bytes) { return fails() ? NULL : __libc_realloc(memory, bytes); }

static int n_untold;

/* Make a call, and again where memory ran out; it must say so exactly then. */
#define TRY(call)                                                        \
    do {                                                                 \
        has_failed = 0;                                                  \
        is_armed = 1;                                                    \
        status = (call);                                                 \
        is_armed = 0;                                                    \
        if ((status == COLLIDE_NO_MEMORY) != has_failed) n_untold++;     \
    } while (has_failed)

static unsigned long add_up(unsigned long sum, const void *memory, size_t bytes)
{
    const unsigned char *byte = memory;
    while (bytes-- > 0) sum = sum * 1099511628211u + *byte++;
    return sum;
}

static void set_pose(double *X, int k)
{
    int i;
    for (i = 0; i < 16; i++) X[i] = i % 5 == 0 ? 1.0 : 0.0;
    X[3] = 0.6 * (k % 4);
    X[7] = 0.65 * (k / 4 % 3);
    X[11] = 0.9 * (k / 12);
}

/* A cloud and a grid, and terrain, asked about with a box; a sum of all answers. Of few items, that fit where qsort sorts without
   memory of its own. */
static unsigned long fields(const collide_shape *box, const double *points, unsigned long sum)
{
    static const uint8_t cells[12] = {1, 0, 1, 1, 1, 1, 0, 1, 1, 1, 0, 1};
    static const double heights[9] = {0.1, 0.3, 0.2, 0.0, 0.4, 0.1, 0.2, 0.0, NAN}, sides[3] = {0.3, 0.2, 0.25}, way[3] = {0.1, 0.2, -1};
    const size_t along[3] = {2, 3, 2};
    double X[16], Y[16];
    collide_contact contacts[64];
    collide_first_contact first;
    collide_ray_hit hit;
    collide_field *grid = NULL, *cloud = NULL;
    collide_mesh *terrain = NULL;
    collide_workspace *workspace = NULL;
    collide_status status;
    size_t count;
    int k;
    set_pose(X, 0);
    set_pose(Y, 0);
    Y[3] = 0.31, Y[7] = 0.23, Y[11] = 0.7;
    TRY(collide_workspace_create(&workspace));
    TRY(collide_point_cloud_create(points, 40, sides, 1, &cloud));
    TRY(collide_voxel_grid_create(cells, along, sides, NULL, &grid));
    TRY(collide_height_field_create(heights, 3, 3, sides, NULL, &terrain));
    for (k = 0; k < 2; k++) {
        const collide_field *field = k ? cloud : grid;
        const collide_poses here = {X, 1};
        const collide_vectors from = {Y + 3, 1}, towards = {way, 1};
        TRY(collide_field_contacts(workspace, field, box, X, Y, 0.1, 8, 0, contacts, 64, &count));
        sum = add_up(sum, contacts, count * sizeof *contacts);
        TRY(collide_field_cast(workspace, box, field, Y, X, way, INFINITY, 0, &first));
        sum = add_up(sum, &first, sizeof first);
        TRY(collide_field_raycast(workspace, field, here, from, towards, INFINITY, 0, &hit, NULL, NULL));
        sum = add_up(sum, &hit, sizeof hit);
    }
    TRY(collide_mesh_shape_collide(workspace, terrain, box, X, Y, 0, &k));
    sum = add_up(sum, &k, sizeof k);
    collide_mesh_free(terrain);
    collide_field_free(cloud);
    collide_field_free(grid);
    collide_workspace_free(workspace);
    return sum;
}

/* Bodies that are added, moved, replaced and removed, and questions about them; a sum of all answers. */
static unsigned long scene(collide_shape *const *shapes, const collide_mesh *mesh, const collide_field *cloud)
{
    static collide_pair rows[400];
    static collide_contact contacts[2000];
    static collide_world_hit hits[2];
    const double origins[6] = {-3, 0.1, 0.2, 0.3, 0.1, 9}, directions[6] = {1, 0, 0, 0.01, 0.02, -1};
    const collide_vectors along = {directions, 2};
    const uint32_t group = 1;
    collide_world *world = NULL;
    collide_workspace *workspace = NULL;
    collide_status status;
    int32_t ids[BODIES], pairs[4];
    double X[16 * BODIES];
    unsigned long sum = 17;
    size_t count;
    int k, hit;
    TRY(collide_world_create(&world));
    TRY(collide_workspace_create(&workspace));
    for (k = 0; k < BODIES; k++) {
        collide_body body = COLLIDE_BODY_DEFAULT;
        set_pose(X + 16 * k, k);
        body.X_WB = X + 16 * k;
        if (k == 7) body.mesh = mesh;
        else if (k == 9) body.field = cloud;
        else body.shape = shapes[k % 4];
        body.mask = k == 9 ? 2 : 1; /* nothing is asked about the cloud but its box */
        TRY(collide_world_add(world, &body, 1, &ids[k]));
        sum = add_up(sum, &ids[k], sizeof ids[k]);
    }
    for (k = 0; k < 4; k++) pairs[k] = ids[k];
    TRY(collide_world_allow(world, pairs, 2));
    TRY(collide_world_move(world, ids, 4, X + 16 * 4));
    TRY(collide_world_replace(world, ids[10], shapes[0]));
    TRY(collide_world_replace_mesh(world, ids[11], mesh));
    TRY(collide_world_remove(world, ids[5]));
    TRY(collide_world_collides(world, workspace, &hit));
    sum = add_up(sum, &hit, sizeof hit);
    TRY(collide_world_hits(world, workspace, ids, BODIES / 2, &count));
    sum = add_up(sum, &count, sizeof count);
    TRY(collide_world_remove(world, 11)); /* rows of meshes that overlap are not answered */
    TRY(collide_world_remove(world, 7));
    TRY(collide_world_distances(world, workspace, 0.2, rows, 400, &count));
    sum = add_up(sum, rows, (count < 400 ? count : 400) * sizeof *rows);
    TRY(collide_world_minimum(world, workspace, INFINITY, rows, &count));
    sum = add_up(sum, rows, count * sizeof *rows);
    TRY(collide_world_contacts(world, workspace, 0.05, 8, contacts, 2000, &count));
    sum = add_up(sum, contacts, (count < 2000 ? count : 2000) * sizeof *contacts);
    TRY(collide_world_query(world, workspace, shapes[1], X, 0.1, rows, 400, &count));
    TRY(collide_world_nearest(world, workspace, origins, 2, INFINITY, &group, &group, hits));
    sum = add_up(sum, &hits[0].distance, sizeof hits[0].distance);
    TRY(collide_world_raycast(world, workspace, origins, directions, 2, INFINITY, NULL, NULL, hits, NULL));
    sum = add_up(sum, &hits[1].distance, sizeof hits[1].distance);
    TRY(collide_world_cast(world, workspace, shapes[1], (collide_poses){X, 1}, along, INFINITY, 0, &group, &group, hits, NULL));
    sum = add_up(sum, &hits[1].distance, sizeof hits[1].distance);
    sum = add_up(sum, &status, sizeof status);
    collide_workspace_free(workspace);
    collide_world_free(world);
    return sum;
}

int main(void)
{
    const double size[3] = {0.5, 0.6, 0.7}, radii[1] = {0.05}, corners[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    const int32_t faces[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    double points[3 * 250];
    long n, n_different = 0;
    unsigned long sum = 0;
    int k;
    for (k = 0; k < 750; k++) points[k] = 0.4 * sin(k * k + 0.5);
    for (n = -1; n < 0 || failing < n; failing++) { /* the first run tells how many there are */
        collide_shape *shapes[4];
        collide_mesh *mesh;
        collide_field *cloud;
        unsigned long found;
        if (collide_box(size, &shapes[0]) || collide_sphere(0.4, &shapes[1]) || collide_cylinder(0.3, 0.6, &shapes[2]) ||
            collide_hull(points, 250, 0.0, &shapes[3]) || collide_mesh_create(corners, 4, faces, 4, COLLIDE_SOLID, &mesh) ||
            collide_point_cloud_create(points, 250, radii, 1, &cloud))
            return 1;
        n_allocations = 0;
        found = fields(shapes[0], points, scene(shapes, mesh, cloud));
        if (n < 0) {
            n = n_allocations;
            sum = found;
        } else if (found != sum) n_different++;
        for (k = 0; k < 4; k++) collide_shape_free(shapes[k]);
        collide_mesh_free(mesh);
        collide_field_free(cloud);
    }
    printf("%ld allocations, %ld different, %d untold\n", n, n_different, n_untold);
    return 0;
}
