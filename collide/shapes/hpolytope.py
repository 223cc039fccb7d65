"""HPolytope: a bounded intersection of half-spaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from collide.errors import InvalidShape, UnsupportedQuery
from collide.hull.double_description import halfspace_vertices
from collide.shapes.shape import Shape, rows
from collide.transforms import LARGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class HPolytope(Shape):
    """{x : normals @ x ≤ offsets}, bounded and not empty.

    normals : (m, 3), each of any length but zero.   offsets : (m,).
    bounded : must be True in this version; unbounded corridors are a coming row of the plan.

    The vertices are found exactly (double description in integers) when the shape is made, then
    rounded once to float64; ``vertices`` holds them and every bracket counts that rounding in.
    Complexity: about O(m · v²) integer operations for v vertices; meant for m up to a few hundred.

    Raises InvalidShape where the set is empty or unbounded, exactly decided.
    """

    __slots__ = ("bounded", "normals", "offsets", "slop", "vertices")
    _fields = ("normals", "offsets")
    normals: np.ndarray
    offsets: np.ndarray
    vertices: np.ndarray
    slop: float
    bounded: bool

    def __init__(self, normals: ArrayLike, offsets: ArrayLike, *, bounded: bool = True):
        normals = rows("HPolytope", "normals", normals, (None, 3))
        offsets = rows("HPolytope", "offsets", offsets, (len(normals),))
        zero = ~normals.any(axis=1)
        if zero.any():
            raise InvalidShape(f"HPolytope: normals[{int(np.argmax(zero))}] is zero and names no half-space")
        if not bounded:
            raise UnsupportedQuery("HPolytope: bounded=False is not supported yet; add half-spaces that bound it")
        vertices, slop, unbounded = halfspace_vertices(normals, offsets)
        if unbounded is not None:
            raise InvalidShape(
                f"HPolytope: unbounded in direction {unbounded.tolist()}; add a half-space that ends it"
            )
        if not len(vertices):
            raise InvalidShape("HPolytope: empty: no point satisfies all half-spaces at once")
        if not np.abs(vertices).max() <= LARGEST:
            raise InvalidShape(f"HPolytope: a vertex lies beyond {LARGEST:g} m; scale the scene")
        vertices.flags.writeable = False
        self._store(normals=normals, offsets=offsets, bounded=True, vertices=vertices, slop=slop)
