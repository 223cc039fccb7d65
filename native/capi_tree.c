#include "capi_internal.h"
collide_status plant_tree(const struct collide_kernels *kernels, const double *points, size_t n, struct support_tree **tree)
{ (void)kernels; (void)points; (void)n; *tree = NULL; return COLLIDE_UNSUPPORTED; }
int64_t tree_address(const struct support_tree *tree) { (void)tree; return 0; }
void fell_tree(struct support_tree *tree) { (void)tree; }
