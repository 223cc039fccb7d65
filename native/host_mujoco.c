/* Functions of MuJoCo's collision table: a pair of geoms to contacts, in whatever thread MuJoCo asks.

   A model is found by its address, a copy of one by its signature and by what its geoms are made of. Geoms of no model that was
   added are left to the function that stood in the table before. */
#include "host_mujoco.h"

#include "host_slots.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { KINDS = COLLIDE_MUJOCO_KINDS, PAIRS = KINDS * KINDS, MAX_MODELS = 256, FIELD = 1, MESH = 7 };

typedef int collision_function(const void *, void *, void *, int, int, double);

static struct {
    struct collide_mujoco_layout layout;
    void **table;
    void *before[PAIRS];
    uint8_t replaced[PAIRS];
    void (*error)(const char *, ...);
} hook;

/* What is read of a geom in every call, in one cache line. */
struct geom {
    double size[3], reach;
    const int64_t *ints; /* rows of the tables; NULL of geoms that are left to MuJoCo */
    const double *numbers;
    int64_t row;
    int32_t type, dataid;
};

static struct {
    const void *volatile model; /* NULL of a free place */
    struct collide_mujoco_model made;
    struct geom *geoms;
    void *held;
} models[MAX_MODELS];
static volatile int n_models; /* places used so far */

/* Directions that parted two geoms when they were last asked about, under a hash. Threads write them as they come: any direction
   proves what it proves, so that one of other geoms, or half of one, costs time alone. */
enum { AXES = 1 << 15, PAUSE = 7 };
static volatile struct kept_axis {
    float direction[3]; /* 0 where none is known */
    int32_t pause;      /* of bodies that met when last asked about: so many calls go by until another direction is tried */
} kept_axes[AXES];

static volatile struct kept_axis *kept_axis_of(const void *data, int g1, int g2)
{
    uint64_t key = (uint64_t)(uintptr_t)data + 0x9e3779b97f4a7c15u * ((uint64_t)(uint32_t)g1 << 32 | (uint32_t)g2);
    key ^= key >> 29;
    key *= 0xbf58476d1ce4e5b9u;
    return &kept_axes[key >> 40 & (AXES - 1)];
}

static void keep_axis(volatile struct kept_axis *kept, const double *direction)
{
    int k;
    for (k = 0; k < 3; k++) kept->direction[k] = direction != NULL ? (float)direction[k] : 0.0f;
}

/* --- memory of MuJoCo's -------------------------------------------------------------------------------------------- */

static const void *pointer_at(const void *structure, int64_t offset)
{
    const void *found;
    memcpy(&found, (const char *)structure + offset, sizeof found);
    return found;
}

static int type_of(const void *model, int geom)
{
    return ((const int32_t *)pointer_at(model, hook.layout.geom_type))[geom];
}

/* Whether a geom is still what its row of the tables was made from; its mesh is looked at where that may be another one. */
static int is_as_it_was(const struct collide_mujoco_model *made, const struct geom *was, const void *model, int geom, int look_at_mesh)
{
    const double *size = (const double *)pointer_at(model, hook.layout.geom_size) + 3 * geom;
    int32_t dataid = ((const int32_t *)pointer_at(model, hook.layout.geom_dataid))[geom];
    const float *vertices;
    if (type_of(model, geom) != was->type || dataid != was->dataid) return 0;
    if (size[0] != was->size[0] || size[1] != was->size[1] || size[2] != was->size[2]) return 0;
    if (!look_at_mesh || was->type != MESH || dataid < 0) return 1;
    vertices = (const float *)pointer_at(model, hook.layout.mesh_vert) + 3 * (size_t)made->vertex_starts[dataid];
    return memcmp(vertices, made->vertices + 3 * (size_t)made->vertex_starts[dataid],
                  3 * sizeof(float) * (size_t)made->vertex_counts[dataid]) == 0;
}

/* Number of the model that answers for two geoms; -1 where none does. *changed : 1 where the model is ours, and was changed since. */
static int model_of(const void *model, int g1, int g2, int *changed)
{
    uint64_t signature;
    int k;
    *changed = 0;
    for (k = n_models - 1; k >= 0; k--) /* of two that stand for one model the later */
        if (models[k].model == model) {
            const struct collide_mujoco_model *made = &models[k].made;
            const struct geom *geoms = models[k].geoms;
            *changed = !is_as_it_was(made, geoms + g1, model, g1, 0) || !is_as_it_was(made, geoms + g2, model, g2, 0);
            return k;
        }
    memcpy(&signature, (const char *)model + hook.layout.signature, sizeof signature);
    for (k = n_models - 1; k >= 0; k--) {
        const struct collide_mujoco_model *made = &models[k].made;
        const struct geom *geoms = models[k].geoms;
        if (models[k].model != NULL && made->signature == signature && g1 < made->n_geoms && g2 < made->n_geoms &&
            is_as_it_was(made, geoms + g1, model, g1, 1) && is_as_it_was(made, geoms + g2, model, g2, 1))
            return k;
    }
    return -1;
}

/* --- a pair -------------------------------------------------------------------------------------------------------- */

/* Matrix of a geom. */
static void put_pose(const void *data, int geom, double *X)
{
    const double *p = (const double *)pointer_at(data, hook.layout.geom_xpos) + 3 * (size_t)geom;
    const double *R = (const double *)pointer_at(data, hook.layout.geom_xmat) + 9 * (size_t)geom;
    int i;
    for (i = 0; i < 3; i++) {
        memcpy(X + 4 * i, R + 3 * i, 3 * sizeof *R);
        X[4 * i + 3] = p[i];
    }
    X[12] = X[13] = X[14] = 0.0;
    X[15] = 1.0;
}

/* Distance, place, normal from the first geom to the second, and a tangent, which MuJoCo works out where it is 0. */
static void put_contact(const collide_contact *row, void *contact)
{
    double *out = contact;
    int k;
    out[0] = row->distance;
    for (k = 0; k < 3; k++) {
        out[1 + k] = 0.5 * (row->point_a[k] + row->point_b[k]);
        out[4 + k] = row->normal[k];
        out[7 + k] = 0.0;
    }
}

static int left_to_mujoco(const void *model, void *data, void *contacts, int g1, int g2, double margin)
{
    void *before = hook.before[KINDS * type_of(model, g1) + type_of(model, g2)];
    collision_function *call;
    memcpy(&call, &before, sizeof call);
    return call(model, data, contacts, g1, g2, margin);
}

/* Whether the direction that parted two geoms before parts them by more than `gap`; or, where they were apart or are new, that from
   one to the other. */
static int are_parted(volatile struct kept_axis *kept, const struct geom *A, const struct geom *B, const double *X_WA,
                      const double *X_WB, double gap)
{
    double axis[3] = {kept->direction[0], kept->direction[1], kept->direction[2]}, length = 0.0;
    int k;
    if (gap_along(A->ints, A->numbers, X_WA, B->ints, B->numbers, X_WB, axis) > gap) return 1;
    if (kept->pause > 0) {
        kept->pause--;
        return 0;
    }
    for (k = 0; k < 3; k++) {
        axis[k] = X_WB[4 * k + 3] - X_WA[4 * k + 3];
        length += axis[k] * axis[k];
    }
    if (!(length > 0.0)) return 0;
    for (k = 0; k < 3; k++) axis[k] /= sqrt(length);
    if (!(gap_along(A->ints, A->numbers, X_WA, B->ints, B->numbers, X_WB, axis) > gap)) return 0;
    keep_axis(kept, axis);
    return 1;
}

/* Contacts into `out`; how many, or -1 where MuJoCo is to be asked; *status where neither will do. */
static int answer(const struct collide_mujoco_model *made, const struct geom *A, const struct geom *B,
                  volatile struct kept_axis *kept, const void *data, char *out, int g1, int g2, double margin, collide_status *status)
{
    int64_t a = A->row, b = B->row, max_contacts = made->max_contacts[KINDS * A->type + B->type], n = 0, k;
    struct slot *slot;
    double X_WA[16], X_WB[16], axis[3], asked = margin > 0.0 ? margin < LARGEST ? margin : LARGEST : 0.0;
    /* MuJoCo finds contacts of bodies that are a little farther apart than it allows: those are left to it. */
    double slack = made->is_cull ? 1e-3 * (A->reach + B->reach) + 1e-5 : 0.0;
    int count = 0;
    if (made->is_cull && kept->pause > 0) {
        kept->pause--;
        return -1;
    }
    put_pose(data, g1, X_WA);
    put_pose(data, g2, X_WB);
    if (are_parted(kept, A, B, X_WA, X_WB, asked + slack)) return 0;
    if ((slot = take_slot(made->largest)) == NULL) {
        *status = COLLIDE_NO_MEMORY;
        return -1;
    }
    take_table_pair(slot->space, &slot->manifold, made->ints, made->numbers, made->faces, a, b);
    if (made->is_cull) {
        count = is_farther_apart(slot->space, X_WA, X_WB, asked + slack, axis) ? 0 : -1;
        keep_axis(kept, count == 0 ? axis : NULL);
        if (count < 0) kept->pause = PAUSE;
    } else {
        *status = contacts_of_pair(slot->space, &slot->manifold, X_WA, X_WB, asked, max_contacts, 0, slot->rows, &n);
        if (*status == COLLIDE_INVALID_POSE) { /* a state that diverged: MuJoCo notices, and resets it */
            *status = COLLIDE_OK;
            count = -1;
        }
        if (n == 0 && *status == COLLIDE_OK) {
            memcpy(axis, slot->space->rows->normal, sizeof axis);
            keep_axis(kept, axis);
        } else {
            keep_axis(kept, NULL);
            kept->pause = PAUSE;
        }
        for (k = 0; k < n; k++)
            if (slot->rows[k].distance <= margin) put_contact(&slot->rows[k], out + hook.layout.contact_size * count++);
    }
    give_slot_back(slot);
    return count;
}

/* The height field of a geom as it stands in MuJoCo's memory now: heights may change from step to step. */
static struct terrain terrain_of(const struct collide_mujoco_model *made, const void *model, const struct geom *geom)
{
    const int64_t *of_field = made->fields + 3 * geom->dataid; /* rows, columns, where its heights begin */
    struct terrain terrain;
    memcpy(terrain.size, (const double *)pointer_at(model, hook.layout.hfield_size) + 4 * geom->dataid, sizeof terrain.size);
    terrain.n_rows = of_field[0];
    terrain.n_columns = of_field[1];
    terrain.heights = (const float *)pointer_at(model, hook.layout.hfield_data) + of_field[2];
    lay_out_terrain(&terrain);
    return terrain;
}

/* The same as `answer`, of a height field and a convex geom. */
static int answer_on_field(const struct collide_mujoco_model *made, const struct geom *A, const struct geom *B,
                           volatile struct kept_axis *kept, const void *model, const void *data, char *out, int g1, int g2,
                           double margin, collide_status *status)
{
    double X_WH[16], X_WB[16];
    struct terrain terrain = terrain_of(made, model, A);
    struct terrain_pair pair = {&terrain, made->ints, made->faces, made->extremes, made->numbers, made->boxes, X_WH, X_WB, B->row,
                                margin > 0.0 ? margin < LARGEST ? margin : LARGEST : 0.0};
    int64_t n = 0, k;
    int count = 0;
    struct slot *slot;
    if (made->is_cull && kept->pause > 0) {
        kept->pause--;
        return -1;
    }
    put_pose(data, g1, X_WH);
    put_pose(data, g2, X_WB);
    if (made->is_cull) {
        pair.margin += 1e-3 * B->reach + 1e-5;
        if (is_off_terrain(&pair)) return 0;
        kept->pause = PAUSE;
        return -1;
    }
    if ((slot = take_slot(made->largest)) == NULL || !has_terrain_space(slot)) {
        if (slot != NULL) give_slot_back(slot);
        *status = COLLIDE_NO_MEMORY;
        return -1;
    }
    *status = terrain_contacts(slot->terrain, slot->space, &slot->manifold, &pair, made->max_contacts[KINDS * A->type + B->type],
                               slot->rows, &n);
    if (*status == COLLIDE_INVALID_POSE) {
        *status = COLLIDE_OK;
        count = -1;
    }
    for (k = 0; k < n; k++)
        if (slot->rows[k].distance <= margin) put_contact(&slot->rows[k], out + hook.layout.contact_size * count++);
    give_slot_back(slot);
    return count;
}

static int contacts_of_geoms(const void *model, void *data, void *contacts, int g1, int g2, double margin)
{
    collide_status status = COLLIDE_OK;
    int changed, count, number = model_of(model, g1, g2, &changed);
    const struct geom *A = number < 0 ? NULL : models[number].geoms + g1, *B = number < 0 ? NULL : models[number].geoms + g2;
    if (changed) {
        hook.error("collide: geom %d or %d is not what it was when install() looked at the model (kind, size or mesh): call "
                   "refresh() of what install() returned", g1, g2);
        return 0;
    }
    /* Culling wins nothing where MuJoCo has a formula for two kinds: others share its search with meshes. */
    if (number < 0 || (A->ints == NULL && A->type != FIELD) || B->ints == NULL ||
        (models[number].made.is_cull && hook.before[KINDS * A->type + B->type] != hook.before[KINDS * MESH + MESH]))
        return left_to_mujoco(model, data, contacts, g1, g2, margin);
    if (A->type == FIELD)
        count = answer_on_field(&models[number].made, A, B, kept_axis_of(data, g1, g2), model, data, contacts, g1, g2, margin, &status);
    else
        count = answer(&models[number].made, A, B, kept_axis_of(data, g1, g2), data, contacts, g1, g2, margin, &status);
    if (status != COLLIDE_OK) {
        hook.error("collide: contacts of geoms %d and %d: %s", g1, g2, collide_status_text(status));
        return 0;
    }
    return count < 0 ? left_to_mujoco(model, data, contacts, g1, g2, margin) : count;
}

/* --- the table ----------------------------------------------------------------------------------------------------- */

static void *ours(void)
{
    collision_function *function = contacts_of_geoms;
    void *address;
    memcpy(&address, &function, sizeof address);
    return address;
}

int collide_mujoco_hook(const struct collide_mujoco_layout *layout, void **table, const uint8_t *replaced,
                        void (*error)(const char *, ...))
{
    int k;
    if (hook.table != NULL) return -1;
    hook.layout = *layout;
    hook.table = table;
    hook.error = error;
    memcpy(hook.before, table, sizeof hook.before);
    for (k = 0; k < PAIRS; k++) hook.replaced[k] = replaced[k] && table[k] != NULL;
    PUBLISH();
    for (k = 0; k < PAIRS; k++)
        if (hook.replaced[k]) table[k] = ours();
    return 0;
}

int collide_mujoco_hooked(void)
{
    int k, n = 0;
    for (k = 0; hook.table != NULL && k < PAIRS; k++) n += hook.replaced[k] && hook.table[k] == ours();
    return n;
}

void collide_mujoco_unhook(void)
{
    int k;
    if (hook.table == NULL) return;
    for (k = 0; k < PAIRS; k++)
        if (hook.replaced[k] && hook.table[k] == ours()) hook.table[k] = hook.before[k];
    hook.table = NULL;
    free_slots();
}

/* A line for every geom of a model; NULL where there is no memory. */
static struct geom *lines_of(const struct collide_mujoco_model *made, void **held)
{
    struct geom *geoms = cache_lines((size_t)(made->n_geoms + 1) * sizeof *geoms, held);
    int64_t k;
    for (k = 0; geoms != NULL && k < made->n_geoms; k++) {
        int64_t row = made->rows[k];
        memcpy(geoms[k].size, made->sizes + 3 * k, sizeof geoms[k].size);
        geoms[k].reach = made->reaches[k];
        geoms[k].row = row;
        geoms[k].ints = row < 0 ? NULL : made->ints + INTS * row;
        geoms[k].numbers = row < 0 ? NULL : made->numbers + NUMBERS * row;
        geoms[k].type = made->types[k];
        geoms[k].dataid = made->dataids[k];
    }
    return geoms;
}

int collide_mujoco_add(const struct collide_mujoco_model *model)
{
    int k;
    if (model->face_ints != FACE_INTS || model->manifold_header != MANIFOLD_HEADER ||
        model->contact_bytes != (int64_t)sizeof(collide_contact))
        return -2;
    for (k = 0; k < MAX_MODELS && models[k].model != NULL; k++) {}
    if (k == MAX_MODELS) return -1;
    if ((models[k].geoms = lines_of(model, &models[k].held)) == NULL) return -3;
    models[k].made = *model;
    PUBLISH();
    models[k].model = model->model;
    if (k >= n_models) n_models = k + 1;
    return k;
}

void collide_mujoco_remove(int number)
{
    if (number < 0 || number >= MAX_MODELS || models[number].model == NULL) return;
    models[number].model = NULL;
    free(models[number].held);
    models[number].held = models[number].geoms = NULL;
    while (n_models > 0 && models[n_models - 1].model == NULL) n_models--;
}
