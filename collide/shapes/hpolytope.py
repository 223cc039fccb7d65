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
    """The polytope {x : normals @ x ≤ offsets}, bounded and not empty.

    Parameters
    ----------
    normals : (m, 3) array_like, float64
        Outward normals, each of any length but zero, in the frame of the shape.
    offsets : (m,) array_like, float64
        In the units of normals·x: metres, where normals have length 1.
    bounded : bool
        Must be True: unbounded polyhedra are not supported yet.

    Raises
    ------
    InvalidShape
        Where the set is empty or unbounded, which is decided exactly, or numbers are out of range.
    UnsupportedQuery
        For ``bounded=False``.

    Notes
    -----
    The vertices are found exactly, by double description in integers (Motzkin, Raiffa, Thompson and Thrall 1953), and
    rounded once to float64; ``vertices`` (v, 3) holds them, and every bracket counts that rounding in. About O(m v²)
    integer operations: meant for m up to a few hundred.
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
