"""Sphere, Box, Capsule, Cylinder, Cone, Ellipsoid, Halfspace: shapes of a few numbers.

All are centred at the origin of their frame, with their axis along z; lengths are full lengths
in metres (MuJoCo's "size" holds half lengths).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from collide.errors import InvalidShape
from collide.shapes.shape import Shape, positive, rows, scalar, three_lengths

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Sphere(Shape):
    """A ball around the origin.

    radius : [m], > 0. A Euclidean ball in the world, whatever the pose's rounding.
    """

    __slots__ = ("radius",)
    _fields = __slots__
    radius: float

    def __init__(self, radius: float):
        self._store(radius=positive("Sphere", "radius", radius))


class Box(Shape):
    """A box centred at the origin, its faces across the axes.

    size : (3,) full edge lengths [m], each > 0; or three numbers: ``Box(1, 2, 3)`` is ``Box((1, 2, 3))``.
    """

    __slots__ = ("size",)
    _fields = __slots__
    size: np.ndarray

    def __init__(self, size: ArrayLike, y: float | None = None, z: float | None = None):
        self._store(size=three_lengths("Box", "size", size, y, z))


def _one_length(shape: str, length, height):
    """The length, under one of its two names."""
    if (length is None) == (height is None):
        got = "neither" if length is None else "both"
        raise InvalidShape(f"{shape}: give one of length and height, two names of one number; got {got}")
    return height if length is None else length


class Capsule(Shape):
    """All points within ``radius`` of a segment along z, centred at the origin.

    radius : [m], > 0.   length : of the segment, without the caps [m], ≥ 0; ``height=`` is another name for it.
    """

    __slots__ = ("radius", "length")
    _fields = __slots__
    radius: float
    length: float

    def __init__(self, radius: float, length: float | None = None, *, height: float | None = None):
        length = _one_length("Capsule", length, height)
        self._store(
            radius=positive("Capsule", "radius", radius), length=positive("Capsule", "length", length, zero=True)
        )


class Cylinder(Shape):
    """A solid cylinder along z, centred at the origin.

    radius : [m], > 0.   length : full length [m], > 0; ``height=`` is another name for it.
    """

    __slots__ = ("radius", "length")
    _fields = __slots__
    radius: float
    length: float

    def __init__(self, radius: float, length: float | None = None, *, height: float | None = None):
        length = _one_length("Cylinder", length, height)
        self._store(
            radius=positive("Cylinder", "radius", radius), length=positive("Cylinder", "length", length)
        )


class Cone(Shape):
    """A solid cone along z: apex at +z·length/2, base of ``radius`` at −z·length/2.

    radius : of the base [m], > 0.   length : from base to apex [m], > 0; ``height=`` is another name for it.
    """

    __slots__ = ("radius", "length")
    _fields = __slots__
    radius: float
    length: float

    def __init__(self, radius: float, length: float | None = None, *, height: float | None = None):
        length = _one_length("Cone", length, height)
        self._store(radius=positive("Cone", "radius", radius), length=positive("Cone", "length", length))


class Ellipsoid(Shape):
    """{x : Σ (x_k / radii_k)² ≤ 1}.

    radii : (3,) semi-axes along x, y, z [m], each > 0; or three numbers: ``Ellipsoid(1, 2, 3)``.
    """

    __slots__ = ("radii",)
    _fields = __slots__
    radii: np.ndarray

    def __init__(self, radii: ArrayLike, y: float | None = None, z: float | None = None):
        self._store(radii=three_lengths("Ellipsoid", "radii", radii, y, z))


class Halfspace(Shape):
    """{x : normal·x ≤ offset}: everything behind a plane, without end.

    normal : (3,) pointing out of the solid; any length but zero, kept as given.
    offset : in the same units as normal·x (metres, where the normal has length 1).
    """

    __slots__ = ("normal", "offset")
    _fields = __slots__
    normal: np.ndarray
    offset: float

    def __init__(self, normal: ArrayLike, offset: float):
        normal = rows("Halfspace", "normal", normal, (3,))
        length = float(np.linalg.norm(normal))
        if not 1e-6 <= length <= 1e6:
            raise InvalidShape(
                f"Halfspace: normal must have a length within [1e-6, 1e6] (1 is usual), got {length:g}"
            )
        self._store(normal=normal, offset=scalar("Halfspace", "offset", offset))
