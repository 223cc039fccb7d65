#include "capi_internal.h"
collide_status collide_hpolytope(const double *normals, const double *offsets, size_t m, collide_shape **shape)
{ (void)normals; (void)offsets; (void)m; *shape = NULL; return COLLIDE_UNSUPPORTED; }
