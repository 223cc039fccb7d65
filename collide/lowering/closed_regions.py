"""Regions of half-spaces, closed by a box that changes no answer.

A region FH keeps its planes. For a question it becomes K = FH ∩ [−s, s]³, an `HPolytope` with corners, which every
method of the pair table takes. Write ρ for a bound of how far points of the other body B lie from the origin of the
region's frame, and m for `HPolytope.boundary_within`. With s ≥ 2ρ + m answers are those of FH:

- Apart: FH has a point within m of the origin or holds the origin, so that the gap is at most ρ + m, and the point of
  FH nearest B within 2ρ + m of the origin: it is in K.
- Meeting: one plane is within m of the origin, so that B has to move by at most ρ + m to be behind it. Wherever B goes
  that far it stays in the box, where K and FH are the same: a translation separates B from both or from neither.

Sizes s are powers of two, and K is kept with the region. Its corners are those of the planes given: found in integers
where planes are few. Of many, the planes are seen from a point inside; their polars are rounded to doubles, the hull of
these is exact, and so is which planes meet in a corner. Rounded polars bound a body that lies within `_TURNED` of the
size, times size over inner radius, of K: that, and what corners round, is ``slop``, which every bracket counts in.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from collide.errors import UnsupportedQuery
from collide.fork_safe_lock import ForkSafeLock
from collide.hull.double_description import halfspace_vertices
from collide.hull.exact_hull import convex_hull
from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.interior_point import interior_point
from collide.least_distance.pair_proposals import Work
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import bounding_parts_of
from collide.numerics.exact_points import cross, inner, minus
from collide.shapes.hpolytope import HPolytope
from collide.shapes.shape import Shape
from collide.transforms import LARGEST, ROTATION_TOLERANCE

#: So many planes at most, the box's among them, go to double description; so many where the region is flat.
_FEW, _FEW_FLAT = 48, 400
#: A polar is good to this part of itself: a difference good to four units in the last place, and a quotient.
_TURNED = 2.0**-50
#: Corners whose rounding is bounded by more than this part of the size are found in fractions.
_CORNER = 2.0**-49
#: More than what a sum of lengths rounds, and what poses that are nearly rotations stretch.
_UP = 1 + 4 * ROTATION_TOLERANCE

_closing = ForkSafeLock()


def closings(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> Iterator[tuple[Shape, Shape, np.ndarray]]:
    """(A or what closes it, B or what closes it, numbers of the poses that this is for) of a region and another body.

    X_WA, X_WB : (n, 4, 4).   Raises UnsupportedQuery where the other body has no end either, or is too far away.
    """
    sizes = sizes_at(A, B, X_WA, X_WB)
    for size in np.unique(sizes).tolist():
        some = np.flatnonzero(sizes == size)
        yield (closed(A, size), B, some) if A.is_region else (A, closed(B, size), some)  # type: ignore[arg-type]


def sizes_at(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) box sizes for a region and another body at poses (n, 4, 4)."""
    region, other, X_WR, X_WO = (A, B, X_WA, X_WB) if A.is_region else (B, A, X_WB, X_WA)
    reach = reach_of(other)
    if not reach < math.inf:
        names = " and ".join(map(name_of, (A, B)))
        raise UnsupportedQuery(f"{names}: neither has an end, which this query needs; collide() and distance() answer")
    apart = np.sqrt(np.square(X_WO[:, :3, 3] - X_WR[:, :3, 3]).sum(axis=1))
    assert isinstance(region, HPolytope)
    return box_sizes(region, _stretch(X_WR) * (apart + _stretch(X_WO) * reach + region.boundary_within))


def name_of(shape: Shape) -> str:
    """What messages call a shape."""
    return "HPolytope(bounded=False)" if shape.is_region else type(shape).__name__


def _stretch(X: np.ndarray) -> np.ndarray | float:
    """(n,) bounds of what a pose and its inverse stretch lengths by, one after the other: 1 of rotations."""
    R = X[:, :3, :3]
    if np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(initial=0.0) <= 3.0 * ROTATION_TOLERANCE:
        return _UP
    with np.errstate(divide="ignore"):
        values = np.linalg.svd(R, compute_uv=False)
        return _UP * np.maximum(values[:, 0], 1.0) ** 2 / np.minimum(values[:, 2], 1.0) ** 2


def reach_of(shape: Shape) -> float:
    """How far points of a shape are from its origin, at most [m]: infinite of half-spaces and regions."""
    if shape.is_region:
        return math.inf
    lengths = [
        math.inf if packed.kind == HALFSPACE else _UP * (packed.reach + packed.slop + np.linalg.norm(X[:3, 3]))
        + packed.radius for packed, X in bounding_parts_of(shape)
    ]  # fmt: skip
    return float(max(lengths))


def box_sizes(region: HPolytope, distances: np.ndarray) -> np.ndarray:
    """(n,) half the edges of boxes that close a region for bodies with no point farther than ``distances`` (n,) from
    the origin of its frame [m].

    Raises UnsupportedQuery where that is out of range.
    """
    wanted = _UP * (2.0 * distances + region.boundary_within)
    if not (wanted <= LARGEST / 4.0).all():
        raise UnsupportedQuery(
            f"HPolytope(bounded=False): a body may be {float(np.max(wanted)):g} m away, more than {LARGEST / 4.0:g} m"
        )
    return np.ldexp(1.0, np.frexp(np.maximum(wanted, 1e-45))[1] + 1)


def closed(region: HPolytope, size: float) -> HPolytope:
    """A region within the box [−size, size]³ of its frame, made when first asked for and kept with it.

    size : a power of two [m], so large that the box holds a point of the region.
    """
    try:
        return region._closed[size]
    except (AttributeError, KeyError):
        pass
    with _closing():
        if not hasattr(region, "_closed"):
            region._store(_closed={})
        if size not in region._closed:
            region._closed[size] = _made(region, size)
        return region._closed[size]


def _made(region: HPolytope, size: float) -> HPolytope:
    sides = np.vstack([np.eye(3), -np.eye(3)])
    normals, offsets = np.vstack([region.normals, sides]), np.append(region.offsets, np.full(6, size))
    if len(normals) <= _FEW:
        return HPolytope.of_vertices(normals, offsets, *halfspace_vertices(normals, offsets)[:2])
    scaled, right = _in_box_units(normals, offsets, size)
    planes = HomogeneousRows(scaled, right, lambda row: as_integers([*scaled[row].tolist(), float(right[row])])[0])
    for exactly in (False, True):
        centre = interior_point(planes, Work(), exactly)
        corners = None if centre is None else _corners(scaled, right, centre)
        if corners is not None:
            return HPolytope.of_vertices(normals, offsets, corners[0] * size, corners[1] * size)
    if len(normals) > _FEW_FLAT:
        raise UnsupportedQuery(
            f"HPolytope(bounded=False): a region without inside of {len(region.normals)} half-spaces takes too long; "
            f"at most {_FEW_FLAT - 6} are taken: leave out those that others imply"
        )
    return HPolytope.of_vertices(normals, offsets, *halfspace_vertices(normals, offsets)[:2])


def _in_box_units(normals: np.ndarray, offsets: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """The planes with the box as [−1, 1]³, each by a power of two, so that nothing is rounded or out of range."""
    exponents = np.frexp(np.abs(normals).max(axis=1))[1]
    return np.ldexp(normals, -exponents[:, None]), np.ldexp(offsets, -exponents) / size


def _corners(normals: np.ndarray, offsets: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, float] | None:
    """(corners (v, 3), how far they may be off) of a region of about unit size; None where the centre is not inside."""
    heights = _heights(normals, offsets, centre)
    if heights is None:
        return None
    polars = normals / heights[:, None]
    hull = convex_hull(polars)
    if hull.dimension < 3:
        return None
    corners, error = _facet_polars(*polars[hull.facets].transpose(1, 0, 2))
    inner_radius = 1.0 / float(np.sqrt(np.square(polars[hull.vertices]).sum(axis=1)).max())
    across = float(np.sqrt(np.square(corners).sum(axis=1)).max())
    slop = _UP * (_TURNED * across * across / inner_radius + error + 2.0**-51 * (across + float(np.abs(centre).max())))
    return np.unique(corners + centre, axis=0), slop


def _heights(normals: np.ndarray, offsets: np.ndarray, centre: np.ndarray) -> np.ndarray | None:
    """offsets − normals @ centre > 0 to four units in the last place; None where one is not > 0."""
    terms = normals * centre
    heights = offsets - terms.sum(axis=1)
    total = np.abs(offsets) + np.abs(terms).sum(axis=1)
    point = [Fraction(x) for x in centre.tolist()]
    for k in np.flatnonzero(4.0 * heights <= 3.0 * total).tolist():
        exact = Fraction(float(offsets[k])) - inner([Fraction(x) for x in normals[k].tolist()], point)
        if exact <= 0:
            return None
        heights[k] = float(exact)
    return heights if heights.min() > 1e-290 else None


def _facet_polars(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, float]:
    """((f, 3) the points x with a·x = b·x = c·x = 1 of each row, how far they may be off)."""
    with np.errstate(all="ignore"):
        e, f = b - a, c - a
        normal = np.cross(e, f)
        spread = np.abs(e) @ np.ones((3, 1)) * (np.abs(f) @ np.ones((3, 1)))
        height = (a * normal).sum(axis=1, keepdims=True)
        x = normal / height
        normal_error = 2.0**-50 * spread
        size = np.sqrt(np.square(x).sum(axis=1, keepdims=True))
        reach = np.abs(a).sum(axis=1, keepdims=True)
        height_error = reach * (normal_error + 2.0**-50 * np.abs(normal).max(axis=1, keepdims=True))
        error = ((2.0 * normal_error + size * height_error) / np.abs(height) + 2.0**-51 * size)[:, 0]
        doubtful = ~((height > 2.0 * height_error)[:, 0] & (error <= _CORNER * max(1.0, float(np.median(size)))))
    for k in np.flatnonzero(doubtful).tolist():
        x[k] = _exact_polar(a[k], b[k], c[k])
        error[k] = 2.0**-51 * float(np.abs(x[k]).max())
    return x, float(error.max())


def _exact_polar(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> list[float]:
    p, q, r = (tuple(Fraction(v) for v in corner.tolist()) for corner in (a, b, c))
    normal = cross(minus(q, p), minus(r, p))
    height = inner(p, normal)
    return [float(v / height) for v in normal]
