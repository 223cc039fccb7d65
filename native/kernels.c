/* The kernels of the level that this processor is of. */
#include <stdlib.h>
#include <string.h>

#define COLLIDE_DEFINE_KERNELS
#include "kernels.h"
#include "kernels_of_level.h"
#include "levels.h"

static const struct {
    const char *name;
    const struct collide_kernels *kernels;
} built[] = {
#define LEVEL(name) {#name, &collide_kernels_##name},
    COLLIDE_LEVELS
#undef LEVEL
};

static int number_of(const char *name)
{
    size_t k;
    for (k = 0; k < sizeof level_numbers / sizeof *level_numbers; k++)
        if (strcmp(name, level_names[k]) == 0) return level_numbers[k];
    return -1;
}

const struct collide_kernels *collide_kernels_of_level(const char *wanted, const char **level, const char **why)
{
    int most = level_of_processor();
    size_t k, best = sizeof built / sizeof *built;
    if (wanted != NULL && *wanted != 0 && number_of(wanted) < 0) {
        *why = "unknown level";
        return NULL;
    }
    for (k = 0; k < sizeof built / sizeof *built; k++) {
        if (wanted != NULL && *wanted != 0 && strcmp(wanted, built[k].name) != 0) continue;
        if (number_of(built[k].name) <= most) best = k; /* ascending */
    }
    if (best == sizeof built / sizeof *built) {
        *why = wanted != NULL && *wanted != 0 ? "this processor, or this library, has no such level"
                                              : "kernels need a processor of at least " COLLIDE_OLDEST;
        return NULL;
    }
    *level = built[best].name;
    return built[best].kernels;
}

unsigned collide_kernel_table(void) { return COLLIDE_TABLE; }
