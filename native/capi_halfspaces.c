#include "capi_internal.h"
collide_status settle_halfspaces(const collide_shape *A, const double *pose_a, const collide_shape *B, const double *pose_b,
                                 collide_pair *row)
{ (void)A; (void)pose_a; (void)B; (void)pose_b; (void)row; return COLLIDE_UNSUPPORTED; }
