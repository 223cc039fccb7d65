"""Sphere, Box, Capsule, Cylinder, Cone, Ellipsoid, Halfspace: shapes of a few numbers.

All are centred at the origin of their frame, with their axis along z; lengths are full lengths
in metres (MuJoCo's "size" holds half lengths).
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from collide.base.foreign_arguments import foreign_arguments
from collide.errors import InvalidShape, brief
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.shape import POINTS_INSTEAD, Shape, equal_but_for_signs, plane_numbers, positive, three_lengths

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Sphere(Shape):
    """A ball around the origin of its frame.

    Parameters
    ----------
    radius : float
        [m], > 0. The ball is Euclidean in the world, whatever the rounding of the pose's rotation.

    Raises
    ------
    InvalidShape
        Where the radius is not a finite number within [1e-50, 1e50] m.
    """

    __slots__ = ("radius",)
    _fields = __slots__
    radius: float

    @foreign_arguments
    def __init__(self, radius: float):
        self._store(radius=positive("Sphere", "radius", radius))

    def _scaled(self, s: np.ndarray) -> Sphere | Ellipsoid:
        radii = self.radius * np.abs(s)
        return Sphere(float(radii[0])) if (radii == radii[0]).all() else Ellipsoid(radii)


class Box(Shape):
    """A box centred at the origin of its frame, its edges along the axes.

    Parameters
    ----------
    size : (3,) array_like, or float
        Full edge lengths along x, y, z [m], each ≥ 0. ``Box(1, 2, 3)`` is ``Box((1, 2, 3))``. A length of 0 makes a
        rectangle without thickness, two a segment, three a point.
    y, z : float, optional
        The other two lengths [m], where ``size`` is the first of three numbers.

    Raises
    ------
    InvalidShape
        Where a length is negative or not a finite number, or two lengths are given.
    """

    __slots__ = ("size",)
    _fields = __slots__
    size: np.ndarray

    @foreign_arguments
    def __init__(self, size: ArrayLike, y: float | None = None, z: float | None = None):
        self._store(size=three_lengths("Box", "size", size, y, z, zero=True))

    def _scaled(self, s: np.ndarray) -> Box:
        return Box(self.size * np.abs(s))

    @staticmethod
    def rounded(size: ArrayLike, radius: float) -> ConvexHull:
        """A box with rounded edges and corners: the hull of the corners of a smaller box, swept by a ball.

        Parameters
        ----------
        size : (3,) array_like
            Full lengths along x, y, z [m], rounding included, each > 0 and ≥ 2·radius.
        radius : float
            Of edges and corners [m], ≥ 0.

        Returns
        -------
        ConvexHull
            Of the corners (±(x/2 − radius), ±(y/2 − radius), ±(z/2 − radius)), each rounded once, with the radius. The
            hull is asked about exactly as it stands.

        Raises
        ------
        InvalidShape
            Where a number is out of range, or a length is less than twice the radius.
        """
        lengths = three_lengths("Box.rounded", "size", size, None, None)
        radius = positive("Box.rounded", "radius", radius, zero=True)
        half = 0.5 * lengths - radius
        if half.min() < 0.0:
            raise InvalidShape(
                f"Box.rounded: radius must be at most half of every length, got {radius!r} and size {lengths.tolist()}"
            )
        return ConvexHull(np.array(list(product(*[(-h, h) for h in half]))) + 0.0, radius=radius)


def _one_length(shape: str, length, height):
    """The length, under one of its two names."""
    if (length is None) == (height is None):
        got = "neither" if length is None else "both"
        raise InvalidShape(
            f"{shape}: give one of length and height, two names of one number; got {got}: "
            f"{brief(length)} and {brief(height)}"
        )
    return height if length is None else length


class Capsule(Shape):
    """All points within a radius of a segment along z, centred at the origin of its frame.

    Parameters
    ----------
    radius : float
        Of the sweeping ball [m], > 0.
    length : float
        Of the segment, without the caps [m], ≥ 0; 0 is a sphere.
    height : float
        Another name for ``length`` [m]; exactly one of them is given.

    Raises
    ------
    InvalidShape
        Where a number is out of range, or neither or both of ``length`` and ``height`` are given.
    """

    __slots__ = ("radius", "length")
    _fields = __slots__
    radius: float
    length: float

    @foreign_arguments
    def __init__(self, radius: float, length: float | None = None, *, height: float | None = None):
        length = _one_length("Capsule", length, height)
        self._store(
            radius=positive("Capsule", "radius", radius), length=positive("Capsule", "length", length, zero=True)
        )

    def _scaled(self, s: np.ndarray) -> Capsule:
        factor = equal_but_for_signs(s, "its caps would not be parts of spheres")
        return Capsule(self.radius * factor, self.length * factor)


def _factors_of_round(s: np.ndarray) -> tuple[float, float]:
    """The factors of the radius and of the length of what is round about z."""
    x, y, z = np.abs(s).tolist()
    if x != y:
        raise InvalidShape(
            f"those along x and y must be equal but for signs, since its base would not be round{POINTS_INSTEAD}"
        )
    return x, z


class Cylinder(Shape):
    """A solid cylinder along z, centred at the origin of its frame.

    Parameters
    ----------
    radius : float
        [m], > 0.
    length : float
        Full length along z [m], > 0.
    height : float
        Another name for ``length`` [m]; exactly one of them is given.

    Raises
    ------
    InvalidShape
        Where a number is out of range, or neither or both of ``length`` and ``height`` are given.
    """

    __slots__ = ("radius", "length")
    _fields = __slots__
    radius: float
    length: float

    @foreign_arguments
    def __init__(self, radius: float, length: float | None = None, *, height: float | None = None):
        length = _one_length("Cylinder", length, height)
        self._store(
            radius=positive("Cylinder", "radius", radius), length=positive("Cylinder", "length", length)
        )

    def _scaled(self, s: np.ndarray) -> Cylinder:
        across, along = _factors_of_round(s)
        return Cylinder(self.radius * across, self.length * along)


class Cone(Shape):
    """A solid cone along z: its apex at +z·length/2, its base at −z·length/2.

    Parameters
    ----------
    radius : float
        Of the base [m], > 0.
    length : float
        From base to apex [m], > 0.
    height : float
        Another name for ``length`` [m]; exactly one of them is given.

    Raises
    ------
    InvalidShape
        Where a number is out of range, or neither or both of ``length`` and ``height`` are given.
    """

    __slots__ = ("radius", "length")
    _fields = __slots__
    radius: float
    length: float

    @foreign_arguments
    def __init__(self, radius: float, length: float | None = None, *, height: float | None = None):
        length = _one_length("Cone", length, height)
        self._store(radius=positive("Cone", "radius", radius), length=positive("Cone", "length", length))

    def _scaled(self, s: np.ndarray) -> Cone | Compound:
        across, along = _factors_of_round(s)
        cone = Cone(self.radius * across, self.length * along)
        return cone if s[2] > 0.0 else Compound([(cone, np.diag((1.0, -1.0, -1.0, 1.0)))])


class Ellipsoid(Shape):
    """The ellipsoid {x : Σ (x_k / radii_k)² ≤ 1}.

    Parameters
    ----------
    radii : (3,) array_like, or float
        Semi-axes along x, y, z [m], each > 0. ``Ellipsoid(1, 2, 3)`` is ``Ellipsoid((1, 2, 3))``.
    y, z : float, optional
        The other two semi-axes [m], where ``radii`` is the first of three numbers.

    Raises
    ------
    InvalidShape
        Where a semi-axis is not a positive finite number, or two are given.
    """

    __slots__ = ("radii",)
    _fields = __slots__
    radii: np.ndarray

    @foreign_arguments
    def __init__(self, radii: ArrayLike, y: float | None = None, z: float | None = None):
        self._store(radii=three_lengths("Ellipsoid", "radii", radii, y, z))

    def _scaled(self, s: np.ndarray) -> Ellipsoid:
        return Ellipsoid(self.radii * np.abs(s))


class Halfspace(Shape):
    """The half-space {x : normal·x ≤ offset}: everything behind a plane, unbounded.

    Parameters
    ----------
    normal : (3,) array_like
        Points out of the solid, in the frame of the shape. Any length within [1e-6, 1e6], kept as given.
    offset : float
        In the units of normal·x: metres, where the normal has length 1.

    Raises
    ------
    InvalidShape
        Where the normal has no direction, or a number is not finite.
    """

    __slots__ = ("normal", "offset")
    _fields = __slots__
    normal: np.ndarray
    offset: float

    @foreign_arguments
    def __init__(self, normal: ArrayLike, offset: float):
        normal, offset = plane_numbers("Halfspace", normal, offset)
        self._store(normal=normal, offset=offset)

    def _scaled(self, s: np.ndarray) -> Halfspace:
        largest = np.abs(s).max()
        return Halfspace(self.normal * (largest / s), self.offset * largest)
