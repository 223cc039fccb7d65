"""Any shape as the kernels read it: parts with exact poses, flat tables, facets under a BVH."""
