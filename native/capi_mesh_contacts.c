/* Contacts of two bodies of facets: the single calls of collide/contact/mesh_contacts.py. What these leave to Python is said to be
   unsupported. */
#include "capi_box_tree.h"
#include "capi_mesh.h"

#include <stdlib.h>

/* Header of single calls (collide/contact/facet_contact_call.py): before that of batches, which follows that of two meshes
   (collide/contact/facet_manifolds.py). */
enum {
    C_KERNEL, C_N_ROWS, C_REACH_OF_BOTH, C_MESHES = 5, C_TOPOLOGY_A = C_MESHES + MESH_HEADER, C_TOPOLOGY_B, C_LIMIT, C_NEAR_CODE, C_WORDS_AT,
    C_CAPACITY, C_IS_LARGEST, FACETS_HEADER = C_IS_LARGEST + 4
};
/* What `write_contact_constants` writes (collide/contact/contact_constants.py). */
enum { C_HEADER, C_TOPOLOGY, C_PAIRS, C_ROWS, C_WORDS, CONTACT_MEASURES = C_WORDS + 6 };

struct facet_topology {
    int64_t words[TOPOLOGY];
    void *held;
};

struct mesh_contact_space {
    int64_t header[FACETS_HEADER];
    size_t n_rows;
    collide_contact *rows;
};

void free_topology(struct facet_topology *topology)
{
    if (topology == NULL) return;
    free(topology->held);
    free(topology);
}

collide_status topology_of(const struct collide_kernels *kernels, const collide_mesh *mesh, const int64_t **words)
{
    collide_mesh *kept = (collide_mesh *)mesh; /* what is made is no part of what the mesh is */
    int64_t m = mesh->tree[N_FACETS], n_corners = 0, k, *memory;
    const int32_t *ids = (const int32_t *)(intptr_t)mesh->tree[IDS_AT];
    struct facet_topology *made;
    int32_t *places;
    if (mesh->topology != NULL) {
        *words = mesh->topology->words;
        return COLLIDE_OK;
    }
    for (k = 0; k < 3 * m; k++) if (mesh->corners[k] >= n_corners) n_corners = mesh->corners[k] + 1;
    made = calloc(1, sizeof *made);
    memory = malloc((size_t)(15 * m + n_corners + 1) * sizeof *memory);
    places = malloc((size_t)(7 * m + n_corners + 1) * sizeof *places);
    if (made == NULL || memory == NULL || places == NULL) {
        free(made);
        free(memory);
        free(places);
        return COLLIDE_NO_MEMORY;
    }
    for (k = 0; k < m; k++) places[ids[k]] = (int32_t)k;
    made->held = places;
    made->words[T_CORNERS_AT] = address_of(mesh->corners);
    made->words[T_PLACES_AT] = address_of(places);
    made->words[T_FANS_AT] = address_of(places + m);
    made->words[T_EDGES_AT] = address_of(places + 4 * m);
    made->words[T_FAN_STARTS_AT] = address_of(places + 7 * m);
    made->words[T_N_CORNERS] = n_corners;
    made->words[T_IS_CONVEX] = !mesh->given;
    kernels->lay_out_topology(address_of(mesh->corners), m, n_corners, made->words[T_FANS_AT], made->words[T_FAN_STARTS_AT],
                              made->words[T_EDGES_AT], address_of(memory));
    free(memory);
    if (!PUT_IF_NULL(&kept->topology, made)) free_topology(made); /* another thread was sooner */
    *words = kept->topology->words;
    return COLLIDE_OK;
}

static struct mesh_contact_space *contact_space_of(collide_workspace *space)
{
    int64_t m[CONTACT_MEASURES];
    struct mesh_contact_space *made;
    if (space->mesh_contacts != NULL) return space->mesh_contacts;
    if (space->kernels->write_contact_constants(address_of(m), CONTACT_MEASURES) != CONTACT_MEASURES || m[C_HEADER] != FACETS_HEADER ||
        m[C_TOPOLOGY] != TOPOLOGY)
        return NULL;
    /* Words that are never touched cost nothing. */
    made = malloc(sizeof *made + (size_t)m[C_ROWS] * sizeof(collide_contact) + 8 * (size_t)m[C_WORDS]);
    if (made == NULL) return NULL;
    memset(made->header, 0, sizeof made->header);
    made->n_rows = (size_t)m[C_ROWS];
    made->rows = (collide_contact *)(made + 1);
    made->header[C_KERNEL] = code_at(&space->kernels->facet_manifolds);
    made->header[C_N_ROWS] = m[C_ROWS];
    made->header[C_NEAR_CODE] = code_at(&space->kernels->list_near_pairs);
    made->header[C_WORDS_AT] = address_of(made->rows + m[C_ROWS]);
    made->header[C_CAPACITY] = m[C_PAIRS];
    return space->mesh_contacts = made;
}

double reach_from_origin(const collide_mesh *mesh)
{
    const double *centre = mesh->numbers + CENTRE;
    return (fabs(centre[0]) + fabs(centre[1]) + fabs(centre[2]) + mesh->reach + mesh->radius) * (1 + 1e-12);
}

/* The header of a pair. */
static collide_status take_pair_of_facets(collide_workspace *space, const collide_mesh *A, const collide_mesh *B)
{
    int64_t *header = space->mesh_contacts->header;
    const int64_t *pair = mesh_pair_header(space, A, B), *topology;
    const collide_mesh *ordered[2];
    double least = A->reach < B->reach ? A->reach : B->reach, limit, reach = reach_from_origin(A) + reach_from_origin(B);
    collide_status status;
    int k;
    memcpy(header + C_MESHES, pair, MESH_HEADER * sizeof *pair);
    ordered[0] = pair[IS_EXCHANGED] ? B : A;
    ordered[1] = pair[IS_EXCHANGED] ? A : B;
    for (k = 0; k < 2; k++) {
        if ((status = topology_of(space->kernels, ordered[k], &topology)) != COLLIDE_OK) return status;
        header[C_TOPOLOGY_A + k] = address_of(topology);
    }
    limit = 2.0 * (least > 0.0 ? least : A->reach > B->reach ? A->reach : B->reach);
    memcpy(header + C_LIMIT, &limit, sizeof limit);
    memcpy(header + C_REACH_OF_BOTH, &reach, sizeof reach);
    return COLLIDE_OK;
}

collide_status collide_mesh_contacts(collide_workspace *workspace, const collide_mesh *A, const collide_mesh *B, const double X_WA[16],
                                     const double X_WB[16], double margin, size_t max_contacts, unsigned flags,
                                     collide_contact *contacts, size_t capacity, size_t *count)
{
    struct mesh_contact_space *space;
    collide_status status;
    rounding given;
    size_t zeroed;
    int64_t n;
    if (count == NULL) return COLLIDE_INVALID_ARGUMENT;
    *count = 0;
    if (!(margin >= 0.0 && margin <= LARGEST) || max_contacts == 0 || (contacts == NULL && capacity > 0) ||
        (flags & ~(unsigned)COLLIDE_TRUST_POSES) != 0)
        return COLLIDE_INVALID_ARGUMENT;
    if ((status = check_mesh_pair(workspace, A, B, X_WA, X_WB, flags)) != COLLIDE_OK) return status;
    if ((space = contact_space_of(workspace)) == NULL) return COLLIDE_NO_MEMORY;
    if (max_contacts > 0x7fffffff) max_contacts = 0x7fffffff;
    zeroed = max_contacts < space->n_rows ? max_contacts : space->n_rows;
    given = round_as_kernels_do();
    if ((status = take_pair_of_facets(workspace, A, B)) == COLLIDE_OK) {
        memset(space->rows, 0, zeroed * sizeof *space->rows);
        n = workspace->kernels->contacts_single_facets(address_of(space->header), address_of(X_WA), address_of(X_WB), address_of(space->rows),
                                                       (int64_t)max_contacts, margin);
        if (n < 0) status = why_mesh_pair(workspace, X_WA, X_WB, flags);
        else {
            *count = (size_t)n;
            hand_out_contacts(space->rows, *count, contacts, capacity);
            if (*count > capacity) status = COLLIDE_TOO_MANY;
        }
    }
    round_as_before(given);
    return status;
}
