"""Flat sides of a polar bulged a little, so that their triangulation does not depend on rounding.

The facets at a vertex w of R are polar to the corners of a flat side of ρ0(R), in the plane ⟨w − o, q⟩ = 1. Left flat,
the side would be triangulated by rounding errors, and errors changing slowly along its border make a fan: some corner
gets a degree growing with the number of corners, and so close to a plane no cut mends the degree in doubles. So corners
are drawn towards the origin by different amounts: the side becomes a shallow dome, in which every other corner is cut
off by a triangle, then every other corner of the rest, and so on. Its degrees are 2·log2 k for k corners.

Three corners stay. Each other corner, in the middle of a chain between two placed corners, comes a step below the plane
of the triangle beyond the chain: two planes a step apart stay distinct in doubles. A polygon cut off at
the middle lies within a few times the height of the triangle, so the drops grow by about a step from each halving to
the next.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.support.rings import order_rings

#: A side of more corners than this is bulged.
_LARGE_SIDE = 16
#: One step, in units of the largest Σ V_k |q_k| at the side: a point's roundings move it by less across the side, and
#: the two of the drawing by half of it at most. Larger ones push corners below facets beside the side that nearly lie
#: in its plane: with 2⁻⁴⁸ the doubling polyhedron's degrees rose from 37 to 197.
_STEP = 2.0**-51
#: Steps at most; chains of very uneven corners would take more. And how much any point may be drawn.
_MAX_STEPS, _MAX_DRAWN = 64.0, 2.0**-30


def dome_drops(
    points: np.ndarray, triangles: np.ndarray, of_triangle: np.ndarray, origin: np.ndarray, polar: np.ndarray,
    weight: np.ndarray,
) -> np.ndarray:
    """(m,) by what part of itself each polar point is to be drawn towards the origin; 0 for most.

    points, triangles : R's surface, closed.   of_triangle : (f,), the polar point of each triangle's plane.
    polar : (m, 3).   weight : (m,), Σ V_k |q_k| with |v_k − o_k| ≤ V_k for all points v.

    O(f + k log k) for k corners of sides with many.
    """
    owner, corner = _large_sides(points, triangles, of_triangle)
    drops = np.zeros(len(polar))
    if not len(owner):
        return drops
    start = np.flatnonzero(np.diff(owner, prepend=-1))
    side = np.repeat(np.arange(len(start)), np.diff(start, append=len(owner)))
    steps = _steps(polar[corner], (points[owner[start]] - origin)[side], start, side)
    unit = np.maximum.reduceat(weight[corner], start) * _STEP
    unit[unit * _MAX_STEPS > _MAX_DRAWN] = 0.0
    # A corner of several sides belongs to the largest: two vertices of R have two facets in common at most.
    order = np.lexsort((np.bincount(side)[side], corner))
    last = order[np.flatnonzero(np.diff(corner[order], append=-1))]
    drops[corner[last]] = (steps * unit[side])[last]
    return drops


def _large_sides(points, triangles, of_triangle) -> tuple[np.ndarray, np.ndarray]:
    """(vertex of R, polar point): the corners of all sides with many, side by side, each in cyclic order."""
    n, f = len(points), len(triangles)
    starts, ring, ring_facets = (np.empty(k, dtype=np.int32) for k in (n + 1, 3 * f, 3 * f))
    following, place, normals = np.empty(6 * f, dtype=np.int32), np.empty(n, dtype=np.int32), np.empty((f, 3))
    status = order_rings(
        address_of(points), n, address_of(triangles), f, address_of(starts), address_of(ring), address_of(ring_facets),
        address_of(following), address_of(place), address_of(normals),
    )
    if status:
        raise AssertionError("the facets of a solid hull are no closed surface")
    degree = np.diff(starts)
    owner = np.repeat(np.arange(n), degree)
    corner = of_triangle[ring_facets]
    before = np.arange(len(corner)) - 1
    used = degree > 0
    before[starts[:-1][used]] = starts[1:][used] - 1
    new = corner != corner[before]
    is_large = np.bincount(owner[new], minlength=n) > _LARGE_SIDE
    listed = new & is_large[owner]
    return owner[listed], corner[listed]


def _steps(polar, across, start, side) -> np.ndarray:
    """(c,) number of steps each corner is drawn inside; 0 for three corners of each side.

    polar : (c, 3), corners side after side in cyclic order.   across : (c, 3), the normal of each corner's side.
    """

    def area(i, j, k):
        return (np.cross(polar[j] - polar[i], polar[k] - polar[i]) * across[i]).sum(axis=1)

    steps = np.zeros(len(polar))
    count = np.bincount(side)
    thirds = [start, start + count // 3, start + 2 * count // 3]
    # Places of a chain count on beyond the side's end: the last one comes back to its first corner.
    low, high = np.concatenate(thirds), np.concatenate([*thirds[1:], start + count])
    apex, first, size = np.concatenate([thirds[2], thirds[0], thirds[1]]), np.tile(start, 3), np.tile(count, 3)
    while len(low):
        longer = high - low > 1
        low, high, apex, first, size = (v[longer] for v in (low, high, apex, first, size))
        middle = (low + high) // 2
        end = np.where(high == first + size, first, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            whole = area(low, end, apex)
            beyond = (
                area(middle, end, apex) * steps[low] + area(low, middle, apex) * steps[end]
                + area(low, end, middle) * steps[apex]
            ) / whole
        level = np.maximum(steps[low], steps[end])
        steps[middle] = np.clip(np.where(np.isfinite(beyond), beyond, level) + 1.0, 1.0, _MAX_STEPS)
        apex, first, size = np.concatenate([end, low]), np.tile(first, 2), np.tile(size, 2)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return steps
