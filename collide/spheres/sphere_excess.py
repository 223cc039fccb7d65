"""How far a union of balls exceeds a body: the greatest distance of a point of a ball from the body, bracketed."""

from __future__ import annotations

import numpy as np

from collide.lowering.convex_sets import IDENTITY
from collide.pairs.query import distance
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.shape import Shape
from collide.spheres.body_facets import BodyPart, farthest_reaches
from collide.surface_queries.signed_distances import signed_distances

_POINT = ConvexHull(np.zeros((1, 3)))
#: A bracket this narrow, in parts of the excess and of the largest radius, is narrow enough.
_NARROW, _LEAST = 0.01, 1e-4
#: Points whose distances are asked for, at most; further ones would narrow the bracket.
_MAX_POINTS = 12_000
_HALF_DIAGONAL = 3.0**0.5
_SIGNS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def excess_bracket(
    shape: Shape, parts: list[BodyPart], centers: np.ndarray, radii: np.ndarray
) -> tuple[float, float]:
    """(lower, upper) of the greatest distance of a point of the balls from a body [m], proven.

    A point of the ball (c, r) is at most r + s(c) away, with s the signed distance of c: exactly so far, in some
    direction, where the body is convex. Cubes around the balls are halved from there: the distance of a cube's middle,
    moved into the ball, and half the diagonal bound the distances of all its points in the ball. What a surface wraps
    counts as body, and is known from one side: ``lower`` is 0 for a body with a surface.
    """
    bounds = np.maximum(radii + farthest_reaches(parts, centers), 0.0)
    if not all(part.solid for part in parts):
        return 0.0, float(bounds.max())
    owner, middles, half_sides = np.arange(len(radii)), centers, radii.copy()
    lower, finished, n_asked = _lower_bound(shape, parts, centers, radii), 0.0, 0
    while len(owner):
        c, r = centers[owner], radii[owner]
        away = middles - c
        length = np.sqrt(np.square(away).sum(axis=1))
        inside = c + away * np.minimum(1.0, r * (1.0 - 1e-12) / np.maximum(length, 1e-300))[:, None]
        least, largest = distances_from_body(shape, inside)
        lower = max(lower, float(least.max()))
        # 1e-9 of the radius: the middle was moved by rounded numbers.
        bounds = np.minimum(bounds, largest + _HALF_DIAGONAL * half_sides + 1e-9 * r)
        limit = max(lower * (1.0 + _NARROW), lower + _LEAST * float(radii.max()))
        n_asked += len(owner)
        is_open = bounds > limit
        finished = max(finished, float(bounds[~is_open].max(initial=0.0)))
        if 8 * is_open.sum() + n_asked > _MAX_POINTS:
            return lower, max(finished, float(bounds[is_open].max(initial=0.0)))
        owner, half_sides = np.repeat(owner[is_open], 8), np.repeat(0.5 * half_sides[is_open], 8)
        middles = middles[is_open][:, None] + 2.0 * half_sides[::8, None, None] * _SIGNS
        middles = middles.reshape(-1, 3)
        bounds = np.repeat(bounds[is_open], 8)
        gap = np.sqrt(np.square(middles - centers[owner]).sum(axis=1)) - _HALF_DIAGONAL * half_sides
        meets = gap <= radii[owner]
        owner, half_sides, middles, bounds = owner[meets], half_sides[meets], middles[meets], bounds[meets]
    return lower, max(finished, lower)


def _lower_bound(shape: Shape, parts: list[BodyPart], centers: np.ndarray, radii: np.ndarray) -> float:
    """The greatest distance of the points of balls beyond, or opposite of, the place of the body nearest the centre."""
    points = []
    for part in parts:
        near = signed_distances(part.mesh, centers)
        away = (near.point - centers) * np.where(near.distance > 0.0, -1.0, 1.0)[:, None]
        length = np.sqrt(np.square(away).sum(axis=1))
        points.append(centers + away * (radii * (1.0 - 1e-12) / np.maximum(length, 1e-300))[:, None])
    return float(distances_from_body(shape, np.concatenate(points))[0].max())


def distances_from_body(shape: Shape, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(lower, upper) bounds of how far points (n, 3) are from a body, 0 inside."""
    X = np.tile(IDENTITY, (len(points), 1, 1))
    X[:, :3, 3] = points
    rows = distance(shape, _POINT, IDENTITY, X, signed=False, check_poses=False)
    return np.maximum(rows.lower, 0.0), np.maximum(rows.upper, 0.0)
