/* Between libcollide and its Python module; no part of the C interface, and it changes with every version. */
#ifndef COLLIDE_KERNELS_OF_LEVEL_H
#define COLLIDE_KERNELS_OF_LEVEL_H

#include "export.h"

struct collide_kernels;

/* All kernels, compiled for the best level that this processor has, or for the one wanted ("v3"). NULL, and why, where there
   is none. */
COLLIDE_EXPORT const struct collide_kernels *collide_kernels_of_level(const char *wanted, const char **level, const char **why);

/* Checksum of the table's layout. */
COLLIDE_EXPORT unsigned collide_kernel_table(void);

#endif
