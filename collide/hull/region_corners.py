"""Corners of an intersection of half-spaces within a box, few or many.

Few planes go to double description, in integers. Many planes are seen from a point inside; their polars are rounded to
doubles, and the hull of the rounded polars is exact: the planes meeting in a corner are known for the planes of the
rounded polars. Polars off by a part η of themselves bound a body whose distance from the region is at most η times the
square of its size over its inner radius: to x·p ≤ 1 they add η|p||x|, |p| ≤ 1 / inner radius, and a body shrunk by this
part about the point lies within the other. This distance plus the rounding of corners is the slop.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.errors import UnsupportedQuery
from collide.hull.double_description import halfspace_vertices
from collide.hull.exact_hull import convex_hull
from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.interior_point import interior_point
from collide.least_distance.pair_proposals import Work
from collide.numerics.exact_vectors import cross, inner, minus

#: So many planes at most, the box's among them, go to double description; so many where the region is flat.
_MAX_INTEGERS, _MAX_FLAT = 48, 400
#: A polar is good to this part of itself: a difference good to four units in the last place, and a quotient.
_POLAR_ERROR = 2.0**-50
#: Corners whose rounding is bounded by more than this part of the size are found in fractions.
_CORNER = 2.0**-49
#: More than what sums and roots round.
_UP = 1 + 2.0**-20


def region_corners(normals: np.ndarray, offsets: np.ndarray, size: float) -> tuple[np.ndarray, float]:
    """(corners (v, 3), how far they may be off [m]) of {x : normals @ x ≤ offsets}, planes of a box among them.

    Parameters
    ----------
    normals, offsets : (m, 3), (m,) float64
        No normal zero; the set is not empty, and within the box.
    size : float
        Half the edge of the box around the origin [m], a power of two.

    Raises
    ------
    UnsupportedQuery
        Of more than 400 half-spaces whose intersection has no inside.

    O(m log m): 100,000 half-spaces take a second or two.
    """
    if len(normals) <= _MAX_INTEGERS:
        return halfspace_vertices(normals, offsets)[:2]
    scaled, right = _in_box_units(normals, offsets, size)
    planes = HomogeneousRows(scaled, right, lambda row: as_integers([*scaled[row].tolist(), float(right[row])])[0])
    for exactly in (False, True):
        centre = interior_point(planes, Work(), exactly)
        corners = None if centre is None else _corners(scaled, right, centre)
        if corners is not None:
            return corners[0] * size, corners[1] * size
    if len(normals) > _MAX_FLAT:
        raise UnsupportedQuery(
            f"HPolytope(bounded=False): a region without inside of {len(normals) - 6} half-spaces takes too long; at "
            f"most {_MAX_FLAT - 6} are taken: leave out those that others imply"
        )
    return halfspace_vertices(normals, offsets)[:2]


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
    rounding = error + 2.0**-51 * (across + float(np.abs(centre).max()))
    slop = _UP * (_POLAR_ERROR * across * across / inner_radius + rounding)
    return np.unique(corners + centre, axis=0), slop


def _heights(normals: np.ndarray, offsets: np.ndarray, centre: np.ndarray) -> np.ndarray | None:
    """offsets − normals @ centre > 0 to four units in the last place; None where any height is not > 0."""
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
    p, q, r = ((Fraction(x), Fraction(y), Fraction(z)) for x, y, z in (a.tolist(), b.tolist(), c.tolist()))
    normal = cross(minus(q, p), minus(r, p))
    height = inner(p, normal)
    return [float(v / height) for v in normal]
