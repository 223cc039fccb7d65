#ifndef COLLIDE_CAPI_ARENA_H
#define COLLIDE_CAPI_ARENA_H

#include <stddef.h>

/* Memory that is freed together. One that begins with memory of its caller's takes no more. */
struct arena {
    unsigned char *place; /* of the chunk in use */
    size_t used, size;
    struct chunk *chunks;
    int fixed;
    int failed; /* something did not fit: what was made since is worth nothing */
};

/* A place to return to: what was made since is given back. */
struct mark {
    struct chunk *chunks;
    unsigned char *place;
    size_t used, size;
};

void arena_begin(struct arena *arena, void *memory, size_t size);
void *arena_take(struct arena *arena, size_t bytes);
struct mark arena_mark(const struct arena *arena);
void arena_return(struct arena *arena, struct mark mark);
void arena_end(struct arena *arena);

#endif
