/* Contacts of a mesh and a convex shape: of cylinders, cones and ellipsoids by the single calls of
   collide/contact/curved_contact_call.py, of polytopes as facets. What these leave to Python is said to be unsupported. */
#include "capi_box_tree.h"
#include "capi_mesh.h"

#include <stdlib.h>

/* Header of single calls (collide/contact/curved_contact_call.py), before that of batches (curved_manifolds.py). */
enum {
    V_KERNEL, V_N_ROWS, V_REACH_OF_BOTH, V_WALK_AT, V_IS_SOLID, V_MOST_FACETS, V_LISTED_AT, V_PLACES_AT, V_ORDER_AT, V_FACETS_IN_ORDER_AT,
    V_ROWS_IN_ORDER_AT, V_STARTS, V_TREE_AT = V_STARTS + 4, V_TOPOLOGY_AT, V_SOLID, V_N_MESH, V_INTS_AT, V_NUMBERS_AT, V_FACES_AT, V_LARGEST,
    V_FACETS_AT, V_ROWS_AT, V_STARTS_AT, V_PATCHES_AT, V_SLOTS_AT, V_SEEN_AT, V_WORDS_AT, V_CAPACITY, V_MAX_CONTACTS,
    CURVED_HEADER = V_MAX_CONTACTS + 5
};
/* A row of faces, zeros of what is no hull, and corners that the end of a cylinder has (capi_faces.h). */
enum { FACE_WORDS = 14, END_CORNERS = 8 };
/* What `write_contact_constants` writes (collide/contact/contact_constants.py). */
enum { V_HEADER = 6, V_FACETS, V_ROWS, V_WORDS, CONTACT_MEASURES };

struct curved_contact_space {
    int64_t header[CURVED_HEADER], no_faces[FACE_WORDS];
    size_t n_rows, n_marks; /* marks : two words a facet or corner of the mesh, zeros between calls */
    collide_contact *rows;
    int64_t *marks;
    void *held;
};

void free_curved_contacts(struct curved_contact_space *space)
{
    if (space == NULL) return;
    free(space->marks);
    free(space->held);
    free(space);
}

static struct curved_contact_space *space_of(collide_workspace *workspace)
{
    int64_t m[CONTACT_MEASURES], *h;
    struct curved_contact_space *made;
    char *at;
    if (workspace->curved_contacts != NULL) return workspace->curved_contacts;
    if (workspace->kernels->write_contact_constants(address_of(m), CONTACT_MEASURES) != CONTACT_MEASURES || m[V_HEADER] != CURVED_HEADER ||
        (made = calloc(1, sizeof *made)) == NULL)
        return NULL;
    at = cache_lines((size_t)(m[V_FACETS] * (2 * (int64_t)sizeof(collide_pair) + 32) + 8 * m[V_WORDS]) +
                     (size_t)m[V_ROWS] * sizeof(collide_contact), &made->held);
    if (at == NULL) {
        free(made);
        return NULL;
    }
    h = made->header;
    h[V_KERNEL] = code_at(&workspace->kernels->curved_manifolds);
    h[V_N_ROWS] = m[V_ROWS];
    h[V_MOST_FACETS] = h[V_CAPACITY] = m[V_FACETS];
    h[V_LISTED_AT] = address_of(at);
    h[V_ROWS_IN_ORDER_AT] = h[V_ROWS_AT] = h[V_LISTED_AT] + m[V_FACETS] * (int64_t)sizeof(collide_pair);
    h[V_PLACES_AT] = h[V_ROWS_AT] + m[V_FACETS] * (int64_t)sizeof(collide_pair);
    h[V_ORDER_AT] = h[V_PLACES_AT] + 8 * m[V_FACETS];
    h[V_FACETS_IN_ORDER_AT] = h[V_FACETS_AT] = h[V_ORDER_AT] + 8 * m[V_FACETS];
    h[V_PATCHES_AT] = h[V_FACETS_AT] + 8 * m[V_FACETS];
    h[V_WORDS_AT] = h[V_PATCHES_AT] + 8 * m[V_FACETS];
    h[V_STARTS_AT] = address_of(h + V_STARTS);
    h[V_FACES_AT] = address_of(made->no_faces);
    h[V_LARGEST] = END_CORNERS;
    made->n_rows = (size_t)m[V_ROWS];
    made->rows = (collide_contact *)(intptr_t)(h[V_WORDS_AT] + 8 * m[V_WORDS]);
    return workspace->curved_contacts = made;
}

/* The header of a pair; COLLIDE_UNSUPPORTED where the walk is too deep. */
static collide_status take_curved(collide_workspace *workspace, struct curved_contact_space *space, const collide_mesh *mesh,
                                  const collide_shape *shape)
{
    int64_t *h = space->header, m = mesh->tree[N_FACETS];
    const int64_t *topology, *walk = facet_walk(workspace, mesh, shape);
    double reach = reach_from_origin(mesh) + shape->numbers[REACH] + shape->numbers[RADIUS];
    collide_status status;
    size_t n_marks;
    if (walk == NULL) return COLLIDE_UNSUPPORTED;
    if ((status = topology_of(workspace->kernels, mesh, &topology)) != COLLIDE_OK) return status;
    n_marks = (size_t)(topology[T_N_CORNERS] > m ? topology[T_N_CORNERS] : m) + 1;
    if (space->n_marks < n_marks) {
        int64_t *marks = calloc(2 * n_marks, sizeof *marks);
        if (marks == NULL) return COLLIDE_NO_MEMORY;
        free(space->marks);
        space->marks = marks;
        space->n_marks = n_marks;
    }
    memcpy(h + V_REACH_OF_BOTH, &reach, sizeof reach);
    h[V_WALK_AT] = address_of(walk);
    h[V_IS_SOLID] = h[V_SOLID] = mesh->solid;
    h[V_TREE_AT] = address_of(mesh->tree);
    h[V_TOPOLOGY_AT] = address_of(topology);
    h[V_N_MESH] = m;
    h[V_INTS_AT] = address_of(shape->ints);
    h[V_NUMBERS_AT] = address_of(shape->numbers);
    h[V_SLOTS_AT] = address_of(space->marks);
    h[V_SEEN_AT] = address_of(space->marks + space->n_marks);
    return COLLIDE_OK;
}

collide_status collide_mesh_shape_contacts(collide_workspace *workspace, const collide_mesh *mesh, const collide_shape *shape,
                                           const double X_WM[16], const double X_WS[16], double margin, size_t max_contacts,
                                           unsigned flags, collide_contact *contacts, size_t capacity, size_t *count)
{
    struct curved_contact_space *space;
    const collide_mesh *surface;
    collide_status status;
    rounding given;
    int64_t n;
    if (count == NULL) return COLLIDE_INVALID_ARGUMENT;
    *count = 0;
    if (!IS_HANDLE(workspace, WORKSPACE_WORD) || !IS_HANDLE(mesh, MESH_WORD) || !IS_HANDLE(shape, SHAPE_WORD) || X_WM == NULL || X_WS == NULL || !mesh->given ||
        !(margin >= 0.0 && margin <= LARGEST) || max_contacts == 0 || (contacts == NULL && capacity > 0) ||
        (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if (shape->ints[KIND] == HALFSPACE || (shape->ints[KIND] == POINTS && shape->numbers[SLOP] != 0.0)) return COLLIDE_UNSUPPORTED;
    if (shape->ints[KIND] == POINTS) {
        if ((status = surface_of(shape, &surface)) != COLLIDE_OK) return status;
        return collide_mesh_contacts(workspace, mesh, surface, X_WM, X_WS, margin, max_contacts, flags, contacts, capacity, count);
    }
    if ((space = space_of(workspace)) == NULL) return COLLIDE_NO_MEMORY;
    if (max_contacts > 0x7fffffff) max_contacts = 0x7fffffff;
    given = round_as_kernels_do();
    if ((status = take_curved(workspace, space, mesh, shape)) == COLLIDE_OK) {
        memset(space->rows, 0, (max_contacts < space->n_rows ? max_contacts : space->n_rows) * sizeof *space->rows);
        n = workspace->kernels->contacts_single_curved(address_of(space->header), address_of(X_WM), address_of(X_WS),
                                                       address_of(space->rows), (int64_t)max_contacts, margin);
        if (n < 0) status = why_mesh_pair(workspace, X_WM, X_WS, flags);
        else {
            *count = (size_t)n;
            hand_out_contacts(space->rows, *count, contacts, capacity);
            if (*count > capacity) status = COLLIDE_TOO_MANY;
        }
    }
    round_as_before(given);
    return status;
}
