/* Versions, statuses, kernels of this processor, memory on cache lines. */
#include "capi_internal.h"

#include <stdlib.h>
#include <string.h>

const char *collide_version(void) { return COLLIDE_VERSION; }

const char *collide_status_text(collide_status status)
{
    switch (status) {
    case COLLIDE_OK: return "done";
    case COLLIDE_NO_MEMORY: return "out of memory";
    case COLLIDE_INVALID_ARGUMENT: return "an argument is NULL or outside its range";
    case COLLIDE_INVALID_SHAPE: return "these numbers make no such shape";
    case COLLIDE_INVALID_POSE: return "a matrix is no pose: finite, a rotation, last row 0 0 0 1";
    case COLLIDE_OUT_OF_RANGE: return "a pair whose shapes and distance together measure less than 1e-50 m: scale the scene";
    case COLLIDE_ENDLESS_DEPTH: return "the overlap has no end: no translation of finite length separates the bodies";
    case COLLIDE_UNSUPPORTED: return "not supported by the C interface";
    case COLLIDE_NO_KERNELS: return "no kernels for this processor, or COLLIDE_CPU names a level that is not to be had";
    case COLLIDE_TOO_MANY: return "more answers than there is room for";
    case COLLIDE_INVALID_FILE: return "no such file, no file of this version, or a damaged one";
    }
    return "unknown status";
}

static const struct collide_kernels *kernels_of(const char **level)
{
    const char *why = NULL;
    const struct collide_kernels *kernels = collide_kernels_of_level(getenv("COLLIDE_CPU"), level, &why);
    int64_t measures[MEASURES];
    return kernels != NULL && workspace_sizes(kernels, measures) ? kernels : NULL;
}

const struct collide_kernels *kernels_here(void)
{
    /* Threads that come first at once write the same. Asking the processor takes 30 us where it is a virtual one. */
    static const struct collide_kernels *volatile known = NULL;
    const char *level = NULL;
    if (known == NULL) known = kernels_of(&level);
    return known;
}

collide_status collide_level(const char **level)
{
    if (level == NULL) return COLLIDE_INVALID_ARGUMENT;
    *level = NULL;
    return kernels_of(level) != NULL ? COLLIDE_OK : COLLIDE_NO_KERNELS;
}

int workspace_sizes(const struct collide_kernels *kernels, int64_t measures[MEASURES])
{
    if (kernels->write_constants(address_of(measures), MEASURES) != MEASURES) return 0;
    return measures[M_BLOCK] == BLOCK && measures[M_HEADER] == HEADER && measures[M_INTS] == INTS &&
           measures[M_NUMBERS] == NUMBERS && measures[M_POSE] == POSE && mesh_workspace_bytes(measures) > 0 &&
           field_workspace_bytes(measures) > 0 &&
           measures[M_ROW] == (int64_t)sizeof(collide_pair) && measures[M_DIGEST] == DIGEST_WORDS;
}

void *cache_lines(size_t bytes, void **held)
{
    char *memory;
    *held = NULL;
    if (bytes > (size_t)-1 - 64 || (memory = calloc(bytes + 64, 1)) == NULL) return NULL;
    *held = memory;
    return memory + (64 - ((uintptr_t)memory & 63)) % 64;
}
