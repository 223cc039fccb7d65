#include "capi_arena.h"

#include <stdlib.h>
#include <string.h>

struct chunk {
    struct chunk *before;
    double first; /* aligns what follows */
};

enum { CHUNK = 1 << 16 };

void arena_begin(struct arena *arena) { memset(arena, 0, sizeof *arena); }

void *arena_take(struct arena *arena, size_t bytes)
{
    void *taken;
    bytes = bytes == 0 ? 8 : (bytes + 7) / 8 * 8;
    if (arena->failed) return NULL;
    if (bytes > arena->size - arena->used) {
        size_t size = bytes > CHUNK ? bytes : CHUNK;
        struct chunk *chunk = malloc(sizeof *chunk + size);
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

void *arena_zeroed(struct arena *arena, size_t count, size_t bytes)
{
    void *taken;
    if (count > ((size_t)-1 >> 1) / bytes) arena->failed = 1;
    if ((taken = arena_take(arena, count * bytes)) != NULL) memset(taken, 0, count * bytes);
    return taken;
}

void arena_end(struct arena *arena)
{
    while (arena->chunks != NULL) {
        struct chunk *before = arena->chunks->before;
        free(arena->chunks);
        arena->chunks = before;
    }
}
