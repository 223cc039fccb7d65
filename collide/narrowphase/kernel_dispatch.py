"""The kernels' part of the table (`dispatch.py`): numbers made from its cells, for two packed convex sets."""

from __future__ import annotations

from collide.kernels import kernel
from collide.lowering.kinds import Kind
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.narrowphase.dispatch import OF_SETS, TABLE

SPHERES, SPHERE_CAPSULE, CAPSULES, HALFSPACE_CONVEX, HALFSPACES, CONVEX = range(len(OF_SETS))

#: What kernels tell apart; every other convex kind has the cells of POLYTOPE.
_COLUMNS = Kind.SPHERE, Kind.CAPSULE, Kind.POLYTOPE, Kind.HALFSPACE
_BITS = 3
#: The numbers of their cells, row after row, _BITS bits each: kernels index no tuple, an index may raise.
_CELLS = sum(
    OF_SETS.index(TABLE[a][b]) << _BITS * (len(_COLUMNS) * i + j)
    for i, a in enumerate(_COLUMNS) for j, b in enumerate(_COLUMNS)
)
_N_COLUMNS, _MASK = len(_COLUMNS), 2**_BITS - 1
_OF_HALFSPACE, _MAX_POINTS = _COLUMNS.index(Kind.HALFSPACE), _COLUMNS.index(Kind.POLYTOPE) + 1


@kernel(inline=True)
def method(kind_a, n_a, kind_b, n_b):
    """SPHERES, SPHERE_CAPSULE, CAPSULES, HALFSPACE_CONVEX, HALFSPACES or CONVEX; n_a, n_b : points of sets of
    points."""
    return (_CELLS >> _BITS * (_N_COLUMNS * _column(kind_a, n_a) + _column(kind_b, n_b))) & _MASK


@kernel(inline=True)
def _column(kind, n):
    if kind == HALFSPACE:
        return _OF_HALFSPACE
    return min(n, _MAX_POINTS) - 1 if kind == POINTS else _MAX_POINTS - 1
