"""HPolytope: an intersection of half-spaces. Plane: that of two opposite ones."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.base.foreign_arguments import foreign_arguments
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidShape
from collide.shapes.shape import Shape, plane_numbers, positive, rows
from collide.transforms import LARGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.hull import double_description, region_corners
    from collide.least_distance import input_rows, nearest_pair, pair_proposals
else:  # with kernels, which those who only check certificates do not load
    double_description = lazy_module("collide.hull.double_description")
    region_corners = lazy_module("collide.hull.region_corners")
    input_rows = lazy_module("collide.least_distance.input_rows")
    nearest_pair = lazy_module("collide.least_distance.nearest_pair")
    pair_proposals = lazy_module("collide.least_distance.pair_proposals")

#: More than what a quotient, a root and a sum round.
_UP = 1 + 2.0**-40


class HPolytope(Shape):
    """The polytope {x : normals @ x ≤ offsets}, not empty.

    Parameters
    ----------
    normals : (m, 3) array_like, float64
        Outward normals, each of any length but zero, in the frame of the shape.
    offsets : (m,) array_like, float64
        In the units of normals·x: metres, where normals have length 1.
    bounded : bool
        True: an unbounded set is refused; corners are found now. False: a region, bounded or not, kept as the
        planes given: frusta, corridors, workspace limits (docs/polytopes.md, "Regions in scenes").

    Raises
    ------
    InvalidShape
        Where the set is empty, naming half-spaces that contradict each other, or, with ``bounded``, has no end: both
        are decided exactly. Where numbers are not finite or out of range, lengths do not match, or a normal is zero.

    Notes
    -----
    Bounded: the vertices are found exactly, by double description in integers (Motzkin, Raiffa, Thompson and Thrall
    1953), and rounded once to float64; ``vertices`` (v, 3) holds them, and every bracket counts their rounding in.
    About O(m v²) integer operations: meant for m up to a few hundred.

    Otherwise an exact least-distance program decides whether the region has a point, in O(m) for each of a few rounds:
    0.1 s for 100,000 half-spaces. ``boundary_within`` [m] is how far the boundary is from the frame's origin, at most.
    A region has no ``vertices``: a pair query closes the region by a box proven to change nothing
    (`lowering/closed_regions.py`).
    """

    __slots__ = ("_closed", "boundary_within", "bounded", "is_closed", "normals", "offsets", "slop", "vertices")
    normals: np.ndarray
    offsets: np.ndarray
    vertices: np.ndarray
    slop: float
    bounded: bool
    boundary_within: float
    #: True of a region that a box closes: its planes, not its rounded corners, decide what doubles leave open.
    is_closed: bool
    #: Closed by boxes of sizes that were needed (`lowering/closed_regions.py`).
    _closed: dict[float, HPolytope]

    def __init__(self, normals: ArrayLike, offsets: ArrayLike, *, bounded: bool = True):
        normals = rows("HPolytope", "normals", normals, (None, 3))
        offsets = rows("HPolytope", "offsets", offsets, (None,))
        if len(offsets) != len(normals):
            raise InvalidShape(
                f"HPolytope: offsets must have shape ({len(normals)},), one for each row of normals {normals.shape}, "
                f"got {offsets.shape}"
            )
        zero = ~normals.any(axis=1)
        if zero.any():
            raise InvalidShape(f"HPolytope: normals[{int(np.argmax(zero))}] is zero and names no half-space")
        if not checks.true_or_false("HPolytope: bounded", bounded):
            self._store(normals=normals, offsets=offsets, bounded=False)
            self._store(boundary_within=_boundary_within(normals, offsets))
            return
        vertices, slop, unbounded = double_description.halfspace_vertices(normals, offsets)
        if unbounded is not None:
            raise InvalidShape(
                f"HPolytope: unbounded in direction {unbounded.tolist()}; add a half-space that ends it, or say "
                "bounded=False"
            )
        if not len(vertices):
            raise InvalidShape("HPolytope: empty: no point satisfies all half-spaces at once")
        if not np.abs(vertices).max() <= LARGEST:
            raise InvalidShape(f"HPolytope: a vertex lies beyond {LARGEST:g} m; scale the scene")
        vertices.flags.writeable = False
        self._store(
            normals=normals, offsets=offsets, bounded=True, vertices=vertices, slop=slop, is_closed=False
        )

    def closed(self, size: float) -> HPolytope:
        """A region within the box [−size, size]³ of its frame, with corners; made once and kept.

        Parameters
        ----------
        size : float
            A power of two [m], so large that the box holds a point of the region: twice ``boundary_within`` is.

        Returns
        -------
        HPolytope
            Its ``vertices`` within ``slop`` [m] of the corners of the planes as given.

        Raises
        ------
        UnsupportedQuery
            Of a region without inside of more than 394 half-spaces.
        """
        if not hasattr(self, "_closed"):
            self._store(_closed={})
        if size not in self._closed:
            sides = np.vstack([np.eye(3), -np.eye(3)])
            normals, offsets = np.vstack([self.normals, sides]), np.append(self.offsets, np.full(6, size))
            vertices, slop = region_corners.region_corners(normals, offsets, size)
            shape = object.__new__(HPolytope)
            shape._store(normals=normals, offsets=offsets, bounded=True, vertices=vertices, slop=slop, is_closed=True)
            for array in (normals, offsets, vertices):
                array.flags.writeable = False
            self._closed.setdefault(size, shape)
        return self._closed[size]

    @classmethod
    def _from_fields(cls, normals: np.ndarray, offsets: np.ndarray, bounded: bool = True) -> HPolytope:
        return cls(normals, offsets, bounded=bounded)

    @property
    def _fields(self) -> tuple[str, ...]:  # type: ignore[override]
        return ("normals", "offsets") if self.bounded else ("normals", "offsets", "bounded")

    def _scaled(self, s: np.ndarray) -> HPolytope:
        # {x : n·x ≤ d} becomes {y : (S⁻¹ n)·y ≤ d}; times the largest factor, equal factors leave normals as they are
        largest = np.abs(s).max()
        return HPolytope(self.normals * (largest / s), self.offsets * largest, bounded=self.bounded)

    @property
    def is_region(self) -> bool:  # type: ignore[override]
        """Whether it is kept as planes."""
        return not self.bounded


class Plane(HPolytope):
    """A wall without end, met from both sides: {x : |normal·x − offset| ≤ thickness / 2}.

    Parameters
    ----------
    normal : (3,) array_like
        Across the wall, in the frame of the shape. Any length within [1e-6, 1e6], kept as given.
    offset : float
        Of the middle, in the units of normal·x: metres, where the normal has length 1.
    thickness : float
        ≥ 0, in the same units; 0 makes a plane.

    Raises
    ------
    InvalidShape
        Where the normal has no direction, or a number is not finite or out of range.

    Notes
    -----
    A region of two half-spaces, an `HPolytope` with ``bounded=False``: ``normals`` (2, 3) and ``offsets`` (2,) hold
    them, and queries answer for those, exactly where they answer for regions exactly (docs/polytopes.md). The two
    offsets, offset ± thickness / 2, are rounded once. A depth is the shortest way out to either side, or through a
    plane. For a floor take a `Halfspace`: bodies that fell through are still in it.
    """

    __slots__ = ("normal", "offset", "thickness")
    normal: np.ndarray
    offset: float
    thickness: float

    @foreign_arguments
    def __init__(self, normal: ArrayLike, offset: float, thickness: float = 0.0):
        normal, offset = plane_numbers("Plane", normal, offset)
        thickness = positive("Plane", "thickness", thickness, zero=True)
        half = 0.5 * thickness
        super().__init__([normal, -normal], [offset + half, half - offset], bounded=False)
        self._store(normal=normal, offset=offset, thickness=thickness)

    @classmethod
    def _from_fields(cls, normal, offset, thickness) -> Plane:  # type: ignore[override]
        return cls(normal, offset, thickness)

    @property
    def _fields(self) -> tuple[str, ...]:  # type: ignore[override]
        return Plane.__slots__

    def _scaled(self, s: np.ndarray) -> Plane:
        largest = np.abs(s).max()
        return Plane(self.normal * (largest / s), self.offset * largest, self.thickness * largest)


def _boundary_within(normals: np.ndarray, offsets: np.ndarray) -> float:
    """An upper bound of the distance of the boundary from the origin [m]. Raises InvalidShape where the set is empty.

    Outside, the boundary is as far as the set; inside, no farther than the nearest plane.
    """
    lengths = np.abs(normals).max(axis=1)
    far = np.abs(offsets) > LARGEST * np.minimum(lengths, 1.0)
    if far.any():
        k = int(np.argmax(far))
        raise InvalidShape(
            f"HPolytope: half-space {k} is farther than {LARGEST:g} m from the origin: offset {offsets[k]:g}, normal "
            f"{normals[k].tolist()}; scale the scene"
        )
    read = input_rows.input_rows(np.zeros((1, 3)), normals, offsets)
    pair = nearest_pair.nearest_pair(read.points, read.halfspaces, pair_proposals.Work())
    if pair.kind == nearest_pair.EMPTY:
        named = sorted(pair.halfspaces)
        raise InvalidShape(
            f"HPolytope: empty: half-spaces {', '.join(map(str, named[:-1]))} and {named[-1]} contradict each other, "
            "no point satisfies all of them"
            if len(named) > 1
            else f"HPolytope: empty: no point satisfies half-space {named[0]}"
        )
    if pair.kind == nearest_pair.MEETING:
        exponents = np.frexp(lengths)[1]
        scaled = np.ldexp(normals, -exponents[:, None])
        return float((np.ldexp(offsets, -exponents) / np.sqrt(np.square(scaled).sum(axis=1))).min()) * _UP
    unit = Fraction(2) ** read.exponent / pair.denominator
    place = [number * unit for number in pair.x]
    if max(map(abs, place)) > LARGEST:
        raise InvalidShape(f"HPolytope: all of it lies beyond {LARGEST:g} m; scale the scene")
    return math.hypot(*map(float, place)) * _UP
