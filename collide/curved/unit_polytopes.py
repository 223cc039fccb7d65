"""Polytopes between which curved sets stand: rings across an axis, and a ball cut into facets."""

from __future__ import annotations

from functools import cache

import numpy as np

from collide.hull.exact_hull import convex_hull

#: Corners of the rings around an axis, and times the facets of an icosahedron are cut in four.
SIDES, _CUTS = 32, 2
#: Corners are drawn in or pushed out by this part of the size beyond what the geometry asks: rounding, and more.
MARGIN = 1e-12


def ring(radius: float, z: float) -> np.ndarray:
    """(SIDES, 3) corners of a regular polygon at a height z."""
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(SIDES, z)], axis=1)


def rings_around(radius: float) -> tuple[float, float]:
    """Radii of the polygons around a disc and within the disc."""
    return radius * (1 + MARGIN) / np.cos(np.pi / SIDES), radius * (1 - MARGIN)


@cache
def unit_ball() -> tuple[np.ndarray, float]:
    """Points (n, 3) of the unit sphere, an icosahedron's facets cut in four; least distance of their hull's planes."""
    golden = (1 + 5**0.5) / 2
    corners = [(0.0, s, t * golden) for s in (1.0, -1.0) for t in (1.0, -1.0)]
    points = _unit(np.array([np.roll(p, k) for p in corners for k in range(3)]))
    for _ in range(_CUTS):
        facets = convex_hull(points).facets
        edges = np.unique(
            np.sort(np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]]), axis=1), axis=0
        )
        points = np.vstack([points, _unit(points[edges].sum(axis=1))])
    a, b, c = points[convex_hull(points).facets].transpose(1, 0, 2)
    normals = _unit(np.cross(b - a, c - a))
    return points, float((normals * a).sum(axis=1).min())


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.sqrt(np.square(v).sum(axis=1))[:, None]
