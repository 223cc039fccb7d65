#include "capi_arena.h"

#include <stdlib.h>

struct chunk {
    struct chunk *before;
    double first; /* aligns what follows */
};

enum { CHUNK = 1 << 16 };

void arena_begin(struct arena *arena, void *memory, size_t size)
{
    arena->place = memory;
    arena->used = 0;
    arena->size = size;
    arena->chunks = NULL;
    arena->fixed = memory != NULL;
    arena->failed = 0;
}

void *arena_take(struct arena *arena, size_t bytes)
{
    void *taken;
    bytes = bytes == 0 ? 8 : (bytes + 7) / 8 * 8;
    if (arena->failed) return NULL;
    if (bytes > arena->size - arena->used) {
        size_t size = bytes > CHUNK ? bytes : CHUNK;
        struct chunk *chunk = arena->fixed ? NULL : malloc(sizeof *chunk + size);
        if (chunk == NULL) {
            arena->failed = 1;
            return NULL;
        }
        chunk->before = arena->chunks;
        arena->chunks = chunk;
        arena->place = (unsigned char *)(chunk + 1);
        arena->used = 0;
        arena->size = size;
    }
    taken = arena->place + arena->used;
    arena->used += bytes;
    return taken;
}

struct mark arena_mark(const struct arena *arena)
{
    struct mark mark;
    mark.chunks = arena->chunks;
    mark.place = arena->place;
    mark.used = arena->used;
    mark.size = arena->size;
    return mark;
}

void arena_return(struct arena *arena, struct mark mark)
{
    while (arena->chunks != mark.chunks) {
        struct chunk *before = arena->chunks->before;
        free(arena->chunks);
        arena->chunks = before;
    }
    arena->place = mark.place;
    arena->used = mark.used;
    arena->size = mark.size;
}

void arena_end(struct arena *arena)
{
    struct mark nothing = {NULL, NULL, 0, 0};
    arena_return(arena, nothing);
}
