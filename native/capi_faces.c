/* Faces of hulls as kernels read them: collide/lowering/hull_polygons.py makes them. */
#include "capi_faces.h"

#include <stdlib.h>

/* What `make_faces` of collide/lowering/hull_polygons.py says in the header of its memory. */
enum { OF_FACES, OF_CORNERS, OF_IDS, OF_KEPT, OF_LARGEST };

double *points_of_hull(const collide_shape *shape, struct arena *arena)
{
    int64_t n = shape->ints[COUNT], padded = shape->ints[PADDED], k;
    const double *columns = (const double *)(intptr_t)shape->ints[ADDRESS];
    double *points = arena_take(arena, (size_t)(3 * n) * sizeof *points);
    for (k = 0; points != NULL && k < 3 * n; k++) points[k] = columns[k % 3 * padded + k / 3];
    return points;
}

static collide_status make_faces(const collide_shape *shape, struct hull_faces **out)
{
    const struct collide_kernels *kernels = kernels_here();
    struct hull_faces *faces;
    struct arena arena;
    int64_t n = shape->ints[COUNT], *memory;
    const double *points;
    void *block = NULL;
    rounding given;
    if (kernels == NULL) return COLLIDE_NO_KERNELS;
    if ((faces = calloc(1, sizeof *faces)) == NULL) return COLLIDE_NO_MEMORY;
    given = round_as_kernels_do();
    arena_begin(&arena);
    points = points_of_hull(shape, &arena);
    memory = arena_take(&arena, (size_t)kernels->faces_memory(n));
    if (!arena.failed && kernels->make_faces(address_of(points), n, address_of(memory)) == 0)
        block = cache_lines((size_t)memory[OF_KEPT] * sizeof(double), &faces->held);
    if (block != NULL) {
        kernels->keep_faces(address_of(points), n, address_of(memory), address_of(block), address_of(faces->ints));
        faces->largest = memory[OF_LARGEST] > ROUND_CORNERS ? memory[OF_LARGEST] : ROUND_CORNERS;
        *out = faces;
    } else free_faces(faces);
    arena_end(&arena);
    round_as_before(given);
    return block != NULL ? COLLIDE_OK : COLLIDE_NO_MEMORY;
}

void free_faces(struct hull_faces *faces)
{
    if (faces == NULL) return;
    free(faces->held);
    free(faces);
}

collide_status faces_of(const collide_shape *shape, const struct hull_faces **faces)
{
    collide_shape *kept = (collide_shape *)shape; /* what is made is no part of what the shape is */
    struct hull_faces *made = NULL;
    collide_status status;
    *faces = NULL;
    if (shape->ints[KIND] != POINTS) return COLLIDE_OK;
    if (kept->faces == NULL) {
        if ((status = make_faces(shape, &made)) != COLLIDE_OK) return status;
        if (!PUT_IF_NULL(&kept->faces, made)) free_faces(made); /* another thread was sooner */
    }
    *faces = kept->faces;
    return COLLIDE_OK;
}
