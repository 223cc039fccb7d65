"""`Exclusion`: the O(log n + log m) planes by which the rounds of a miss left out the hull, as plain data."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.papers.polytopes.hierarchical_tree import HierarchicalTree
from collide.papers.polytopes.tree_walk import Plane, Walk


class Exclusion(NamedTuple):
    """Proof that the hull P of points and the region R of half-spaces are apart.

    R is in S, the intersection of the half-spaces of ``planes``. The boundary of P misses S, so that the connected
    set S is inside P or apart from P; and a point of S is not in P. `verify_exclusion` checks both.

    Attributes
    ----------
    planes : tuple of Plane
        u·x ≤ c with u = Σ multipliers·normals and c = Σ multipliers·offsets, at most d rows each, multipliers ≥ 0:
        R is in each, and every boundary simplex of P beyond at least a plane of them.
    outside : tuple of d floats
        A point of R, in its frame, outside P.
    ray : tuple of d floats
        The direction of a ray from ``outside``, on the grid of P (`HullBoundary`).
    ray_planes : tuple of d + 1 floats each
        (a, b) on the grid of P: the ray is in a·x > b, and every boundary simplex of P in a·x ≤ b of some plane, so
        the ray misses the boundary of P: were ``outside`` in P, the ray would cross the boundary.
    """

    planes: tuple[Plane, ...]
    outside: tuple[float, ...]
    ray: tuple[float, ...]
    ray_planes: tuple[tuple[float, ...], ...]


class HullBoundary(NamedTuple):
    """The boundary of a hull of points, made once for all poses; checked by `verify_boundary`.

    whole : (n, d) int64, the points on a grid: each is ``centre`` + ``unit``·whole to one unit an axis.
    facets : (f, d) int32, rows: simplices covering the boundary of the hull of ``whole``.
    """

    whole: np.ndarray
    centre: np.ndarray
    unit: float
    facets: np.ndarray


def hull_boundary(body: HierarchicalTree) -> HullBoundary:
    """The boundary that exclusions of a body are checked against.

    Parameters
    ----------
    body : HierarchicalTree
        Made from points.

    Returns
    -------
    HullBoundary
        Of the hull of its points.
    """
    checks.instance("hull_boundary: body", body, HierarchicalTree, "a HierarchicalTree")
    return HullBoundary(body.grid.whole.astype(np.int64), body.grid.centre, body.grid.unit, body.tree.facets)


def exclusion_of(A: HierarchicalTree, B: HierarchicalTree, walk: Walk, o: np.ndarray) -> Exclusion:
    """What the rounds of a miss came to; ``o`` is the origin of the rounds on the grid of A."""
    assert B.interior is not None and B.normals is not None and B.offsets is not None
    depths = B.offsets - B.normals @ B.interior
    planes = tuple(
        Plane(plane.rows, tuple(m / float(depths[row]) for row, m in zip(plane.rows, plane.multipliers)))
        for plane in walk.planes
    )
    ray = tuple((o - A.tree.centre).tolist())
    return Exclusion(planes, tuple(B.interior.tolist()), ray, tuple(walk.origin_planes))
