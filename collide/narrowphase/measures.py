"""How much room kernels take and where things stand in it, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

from collide.geometry.coarse_points import COARSE
from collide.geometry.hulls.first_simplex import APICES
from collide.geometry.hulls.orientation import DIGITS as HULL_DIGITS
from collide.geometry.hulls.orientation import WORK
from collide.geometry.hulls.quickhull import FACET, PLANE, STATE
from collide.geometry.mesh_tree.build import _DEEPEST_SPLIT as DEEPEST_SPLIT
from collide.geometry.mesh_tree.build import _RECORD as RECORD
from collide.geometry.mesh_tree.build import _WORK as TREE_WORK
from collide.geometry.mesh_tree.layout import INTS as TREE_INTS
from collide.geometry.mesh_tree.layout import NODE, SLAB, WIDTH
from collide.geometry.mesh_tree.layout import NUMBERS as TREE_NUMBERS
from collide.geometry.support_tree.lists import STACK
from collide.geometry.surfaces.topology import COUNTS, EDGES, ONE_SIDED, OPEN, SHELLS, TURNED, UNBALANCED
from collide.geometry.tables import INTS, NUMBERS, POSE
from collide.kernels import entry, view_i64
from collide.narrowphase.answer import DOUBLES, INTEGERS, REQUESTS_AT
from collide.narrowphase.decide import WORKSPACE
from collide.narrowphase.poses import BLOCK, HEADER
from collide.narrowphase.rows import ROW
from collide.narrowphase.triangles import distances, inside, single, surfaces
from collide.narrowphase.triangles.exact import INTEGERS as MESH_INTEGERS

#: Doubles of a walk along meshes: of whichever takes most.
_MESH_DOUBLES = max(module.DOUBLES + module.FLOATS for module in (surfaces, distances, inside))

#: In this order: rooms of the narrowphase, layouts, rooms of hulls and of support trees; layouts and rooms of box-trees, what is
#: found out about surfaces, rooms of questions about meshes (`native/capi_internal.h`).
_MEASURES = (
    DOUBLES, INTEGERS, REQUESTS_AT, WORKSPACE, BLOCK, HEADER, INTS, NUMBERS, POSE, ROW, COARSE, APICES, HULL_DIGITS, WORK,
    FACET, PLANE, STATE, STACK,
    NODE, SLAB, WIDTH, TREE_INTS, TREE_NUMBERS, RECORD, TREE_WORK, DEEPEST_SPLIT,
    COUNTS, EDGES, SHELLS, OPEN | UNBALANCED | TURNED | ONE_SIDED,
    single.HEADER, _MESH_DOUBLES, MESH_INTEGERS, distances.RESULT, distances.MARKS,
)  # fmt: skip


@entry("int64(int64, int64)")
def tell_measures(out_at, n):
    """Write the first n of `_MEASURES`; returns how many there are."""
    out = view_i64(out_at, n)
    at = 0
    for measure in _MEASURES:
        if at < n:
            out[at] = measure
        at += 1
    return at
