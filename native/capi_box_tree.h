#ifndef COLLIDE_CAPI_BOX_TREE_H
#define COLLIDE_CAPI_BOX_TREE_H

/* The header of a tree, over facets, points or cells, and its numbers (collide/mesh/bvh.py). */
enum { NODES_AT, TRIANGLES_AT, IDS_AT, TREE_NUMBERS_AT, N_NODES, N_FACETS, DEPTH, EXPONENT, SLABS_AT, HAS_ORIGINS, TREE_INTS };
enum { CENTRE = 0, CORNER = 3, BALL = 6, TREE_NUMBERS };

#endif
