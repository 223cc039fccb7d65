#ifndef COLLIDE_CAPI_ARENA_H
#define COLLIDE_CAPI_ARENA_H

#include <stddef.h>

/* Memory that is freed together. */
struct arena {
    unsigned char *place; /* of the chunk in use */
    size_t used, size;
    struct chunk *chunks;
    int failed; /* something did not fit: what was made since is worth nothing */
};

void arena_begin(struct arena *arena);
void *arena_take(struct arena *arena, size_t bytes);
/* Zeros for `count` things; NULL where there is no memory for them. */
void *arena_zeroed(struct arena *arena, size_t count, size_t bytes);
void arena_end(struct arena *arena);

#endif
