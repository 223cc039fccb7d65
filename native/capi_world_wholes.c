/* Pairs of bodies of which one is a mesh or a field, by the pair queries of this interface; as collide/worlds/packed_world.py asks
   them. */
#include "capi_field.h"
#include "capi_mesh.h"
#include "capi_world.h"

int is_alive(const collide_shape *shape, const collide_mesh *mesh, const collide_field *field)
{
    return shape != NULL ? IS_HANDLE(shape, SHAPE_WORD) : mesh != NULL ? IS_HANDLE(mesh, MESH_WORD) : IS_HANDLE(field, FIELD_WORD);
}

const char *kind_of_body(const collide_world *world, int64_t body)
{
    const struct whole_body *whole = &world->wholes[body];
    if (whole->mesh != NULL) return "a mesh";
    return whole->field == NULL ? "a convex shape" : whole->field->are == BALLS ? "a point cloud" : "a voxel grid";
}

collide_status make_whole(const collide_mesh *mesh, const collide_field *field, struct whole_body *whole)
{
    const double *low = mesh != NULL ? mesh->low : field->low, *high = mesh != NULL ? mesh->high : field->high;
    double corners[24];
    int k;
    whole->mesh = mesh;
    whole->field = field;
    for (k = 0; k < 24; k++) corners[k] = k / 3 >> (2 - k % 3) & 1 ? high[k % 3] : low[k % 3];
    return collide_hull(corners, 8, mesh != NULL ? mesh->radius : 0.0, &whole->bound);
}

/* A pair with a body that is asked about as a whole, its bodies in the order of the key. */
struct whole_pair {
    const struct whole_body *wholes[2];
    const collide_shape *shapes[2]; /* NULL of wholes */
    const double *X[2];
};

static struct whole_pair pair_of_key(const collide_world *world, int64_t key)
{
    int64_t bodies[2];
    struct whole_pair pair;
    int k;
    bodies[0] = first_of(key);
    bodies[1] = second_of(key);
    for (k = 0; k < 2; k++) {
        pair.wholes[k] = &world->wholes[bodies[k]];
        pair.shapes[k] = world->is_whole[bodies[k]] ? NULL : shape_of_body(world, bodies[k]);
        pair.X[k] = world->X_WBs + 16 * bodies[k];
    }
    return pair;
}

/* Which body of a field and a convex shape is the field; -1 of other pairs. */
static int field_of(const struct whole_pair *pair)
{
    if (pair->wholes[0]->field != NULL && pair->shapes[1] != NULL) return 0;
    return pair->wholes[1]->field != NULL && pair->shapes[0] != NULL ? 1 : -1;
}

/* Which body of a mesh of facets and a convex shape is the mesh; -1 of other pairs. */
static int mesh_of(const struct whole_pair *pair)
{
    int k;
    for (k = 0; k < 2; k++)
        if (pair->wholes[k]->mesh != NULL && pair->wholes[k]->mesh->given && pair->shapes[!k] != NULL) return k;
    return -1;
}

/* Both bodies as facets. */
static collide_status meshes_of(const struct whole_pair *pair, const collide_mesh *meshes[2])
{
    collide_status status = COLLIDE_OK;
    int k;
    for (k = 0; k < 2 && status == COLLIDE_OK; k++) {
        meshes[k] = pair->wholes[k]->mesh;
        if (pair->shapes[k] != NULL) status = surface_of(pair->shapes[k], &meshes[k]);
        else if (meshes[k] == NULL) status = COLLIDE_UNSUPPORTED;
    }
    if (status == COLLIDE_OK && !meshes[0]->given && !meshes[1]->given) return COLLIDE_UNSUPPORTED; /* two convex shapes */
    return status;
}

collide_status whole_meets(const collide_world *world, collide_workspace *space, int64_t key, uint8_t *hit)
{
    struct whole_pair pair = pair_of_key(world, key);
    const collide_mesh *meshes[2];
    collide_status status;
    int f = field_of(&pair), m = mesh_of(&pair), found = 0;
    if (f >= 0)
        status = collide_field_collide(space, pair.wholes[f]->field, pair.shapes[!f], pair.X[f], pair.X[!f], COLLIDE_TRUST_POSES,
                                       &found);
    else if (m >= 0)
        status = collide_mesh_shape_collide(space, pair.wholes[m]->mesh, pair.shapes[!m], pair.X[m], pair.X[!m],
                                            COLLIDE_TRUST_POSES, &found);
    else if ((status = meshes_of(&pair, meshes)) == COLLIDE_OK)
        status = collide_mesh_collide(space, meshes[0], meshes[1], pair.X[0], pair.X[1], COLLIDE_TRUST_POSES, &found);
    *hit = (uint8_t)found;
    return status == COLLIDE_OK ? status : refuse_pair(world, space, key, status);
}

/* A row with its bodies exchanged: `flipped` of collide/results.py. */
static collide_pair flipped(const collide_pair *row)
{
    collide_pair out = *row;
    int k;
    out.part_a = row->part_b;
    out.part_b = row->part_a;
    memcpy(out.point_a, row->point_b, sizeof out.point_a);
    memcpy(out.point_b, row->point_a, sizeof out.point_b);
    memcpy(out.vertices_a, row->vertices_b, sizeof out.vertices_a);
    memcpy(out.vertices_b, row->vertices_a, sizeof out.vertices_b);
    for (k = 0; k < 3; k++) out.normal[k] = 0.0 - row->normal[k]; /* never -0.0 */
    return out;
}

static collide_status row_of(collide_workspace *space, const struct whole_pair *pair, double limit, collide_pair *row)
{
    const collide_mesh *meshes[2];
    collide_status status;
    int f = field_of(pair), m = mesh_of(pair);
    if (f >= 0)
        status = collide_field_distance(space, pair->wholes[f]->field, pair->shapes[!f], pair->X[f], pair->X[!f], limit,
                                        COLLIDE_TRUST_POSES, row);
    else if (m >= 0)
        status = collide_mesh_shape_distance(space, pair->wholes[m]->mesh, pair->shapes[!m], pair->X[m], pair->X[!m],
                                             COLLIDE_TRUST_POSES, row);
    else if ((status = meshes_of(pair, meshes)) == COLLIDE_OK)
        status = collide_mesh_distance(space, meshes[0], meshes[1], pair->X[0], pair->X[1], COLLIDE_TRUST_POSES, row);
    if (f == 1 || m == 1) *row = flipped(row);
    return status;
}

collide_status row_from_outside(const collide_world *world, collide_workspace *space, const collide_shape *shape, const double *X_WS,
                                int64_t body, double limit, collide_pair *row)
{
    static const struct whole_body none = {NULL, NULL, NULL};
    struct whole_pair pair = pair_of_key(world, key_of(body, body));
    pair.wholes[0] = &none;
    pair.shapes[0] = shape;
    pair.X[0] = X_WS;
    return row_of(space, &pair, limit, row);
}

collide_status row_of_whole(const collide_world *world, collide_workspace *space, int64_t key, double limit, collide_pair *row)
{
    struct whole_pair pair = pair_of_key(world, key);
    collide_status status = row_of(space, &pair, limit, row);
    row->a = world->ids[first_of(key)];
    row->b = world->ids[second_of(key)];
    return status == COLLIDE_OK ? status : refuse_pair(world, space, key, status);
}

collide_status contacts_of_whole(const collide_world *world, collide_workspace *space, int64_t key, double margin,
                                 size_t max_contacts, collide_contact *rows, size_t capacity, size_t *n)
{
    struct whole_pair pair = pair_of_key(world, key);
    const collide_mesh *meshes[2];
    collide_status status;
    int f = field_of(&pair);
    *n = 0;
    if (f >= 0) {
        struct field_pair of_field = {space, pair.wholes[f]->field, pair.shapes[!f], pair.X[f], pair.X[!f], COLLIDE_TRUST_POSES};
        return contacts_of_field(&of_field, f, margin, max_contacts, rows, capacity, n);
    }
    if ((status = meshes_of(&pair, meshes)) != COLLIDE_OK) return status;
    return collide_mesh_contacts(space, meshes[0], meshes[1], pair.X[0], pair.X[1], margin, max_contacts, COLLIDE_TRUST_POSES, rows,
                                 capacity, n);
}
