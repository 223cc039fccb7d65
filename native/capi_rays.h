/* Between the files of rays. */
#ifndef COLLIDE_CAPI_RAYS_H
#define COLLIDE_CAPI_RAYS_H

#include "capi_arena.h"
#include "capi_casts.h"

/* Places of a surface that a ray meets, as collide/casts/ray_ends.py has them: a chord has two. */
struct places {
    double *t, *normals;      /* three each */
    int64_t *columns, *first; /* three each: ray, facet, item; the number of the first */
    uint8_t *flags;           /* two each: proven, certified */
    int64_t n;
};

/* Chords of all parts of a union, or of a single shape: where parts stand and what is asked about them. */
struct chords {
    int64_t n, ints_at, numbers_at;
    double *poses, *rows, *limits;       /* of every part, and the union's own pose behind them */
    int64_t *shape_of, *asked, *listed;
    uint8_t *exact;
    struct places places;
};

/* A ray and what it is cast at, all others NULL: a mesh, a field, convex parts of a union; or the shape of the pair taken. */
struct ray {
    collide_workspace *space;
    const collide_mesh *mesh;
    const collide_field *field;
    const collide_compound *compound;
    struct chords *chords;
    const double *X, *origin, *direction;
    double limit; /* in units of the scaled direction, once it is */
    unsigned flags;
    int is_strict; /* what Python works out in integers is left open, though it has a bracket */
};

/* capi_rays.c: room for the chords of n parts; the ray's chords in all of them, both ends or the first, of which as many as are returned
   stand in chords->listed, since doubles leave them open; and the ends of all chords that count, from the origin to the limit. */
int begin_chords(struct chords *chords, struct arena *arena, int64_t n);
int64_t cut_chords(const struct ray *ray, int both);
void write_ends(const struct ray *ray);

/* capi_rays.c: the first facet that a ray meets, into places with room for one. */
collide_status facet_of(const struct ray *ray, struct places *places);

/* capi_field_rays.c: the places of a ray's first item in chords->places, whose room is made in the arena. */
collide_status places_on_field(const struct ray *ray, struct chords *chords, struct arena *arena);

#endif
