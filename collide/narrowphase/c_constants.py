"""Sizes of the kernels' workspaces and layouts, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

import numpy as np

from collide.fields import cell_tree_kernel as cells
from collide.fields import point_tree_kernel as points
from collide.hull.quickhull import HULL_EACH, HULL_FIXED
from collide.kernels import entry, view_i64
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.mesh.box_overlap import FRAME, PRISM
from collide.mesh.build_bvh import _DEEPEST_SPLIT as DEEPEST_SPLIT
from collide.mesh.build_bvh import _RECORD as RECORD
from collide.mesh.build_bvh import _WORK as TREE_WORK
from collide.mesh.bvh import INTS as TREE_INTS
from collide.mesh.bvh import NODE, SLAB, WIDTH
from collide.mesh.bvh import NUMBERS as TREE_NUMBERS
from collide.mesh.mesh_topology import COUNTS
from collide.narrowphase.exact.settle_space import WORKSPACE
from collide.narrowphase.facets import facets_within as near_pairs
from collide.narrowphase.facets import item_questions as items
from collide.narrowphase.facets import mesh_collide_kernel as pairs
from collide.narrowphase.facets import ray_surface as rays
from collide.narrowphase.facets import surface_collision as surfaces
from collide.narrowphase.facets import surface_distance as distances
from collide.narrowphase.facets import winding_numbers as inside
from collide.narrowphase.facets.exact_triangles import INTEGERS as MESH_INTEGERS
from collide.narrowphase.pair_kernel import DOUBLES, INTEGERS, REQUESTS_AT
from collide.narrowphase.pose_batches import BLOCK, HEADER
from collide.narrowphase.rows import ROW
from collide.numerics.number_digest import DIGEST_WORDS
from collide.support.coarse_points import COARSE

#: Doubles of a walk along meshes: of whichever takes most.
_MESH_DOUBLES = max(module.DOUBLES + module.FLOATS for module in (surfaces, distances, inside, near_pairs, rays))

#: In this order: rooms of the narrowphase, layouts, rooms of hulls and of support trees; layouts and rooms of
#: box-trees, what is found out about surfaces, rooms of questions about meshes and of a digest; layouts and rooms of
#: trees over points and cells, and of walks down these (`native/capi_internal.h`).
_CONSTANTS = np.array([
    DOUBLES, INTEGERS, REQUESTS_AT, WORKSPACE, BLOCK, HEADER, INTS, NUMBERS, POSE, ROW, COARSE,
    HULL_EACH, HULL_FIXED,
    NODE, SLAB, WIDTH, TREE_INTS, TREE_NUMBERS, RECORD, TREE_WORK, DEEPEST_SPLIT,
    COUNTS,
    pairs.HEADER, _MESH_DOUBLES, MESH_INTEGERS, pairs.SCRATCH, DIGEST_WORDS,
    points.WORK, points.WORK_BESIDES, points.MAX_LEVELS, cells.HEADER, cells.N_NUMBERS, cells.STACK, items.HEADER,
    FRAME + PRISM,
], dtype=np.int64)


@entry("int64(int64, int64)")
def write_constants(out_at, n):
    """Write the first n of `_CONSTANTS`; returns how many there are."""
    out = view_i64(out_at, n)
    for at in range(min(n, len(_CONSTANTS))):
        out[at] = _CONSTANTS[at]
    return len(_CONSTANTS)
