"""Signed distance of two of coal's geometries at two poses, with all that contacts are made of.

A plane is what its two half-spaces share: a connected set is as far from it as from the farther one. Balls swept over
shapes are taken off the distance.
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_geometry import CollisionGeometry, Halfspace, Plane
from collide.errors import UnsupportedQuery
from collide.pairs.query import collide as hits
from collide.shapes.shape import Shape

#: What coal says of the depth of bodies that no translation takes apart [m].
DEEPEST = -sys.float_info.max
#: Distances beyond this are without bound to the engine [m].
_FAR = 1e50
_FLATS = (Plane, Halfspace)


class Nearest(NamedTuple):
    """distance, lower : signed [m], the latter proven.   normal : (3,) from the first to the second, zeros where no
    depth was worked out.   point_1, point_2 : (3,) of each surface [m].   part_1, part_2 : facets, or boxes of an
    octree; −1 elsewhere.   is_within : whether they are at most the margin apart.   shapes : those that decided.
    facets_1, facets_2 : which facets of the whole theirs are, None for the same numbers.
    """

    distance: float
    lower: float
    normal: np.ndarray
    point_1: np.ndarray
    point_2: np.ndarray
    part_1: int
    part_2: int
    is_within: bool
    shapes: tuple[Shape, Shape]
    facets_1: np.ndarray | None = None
    facets_2: np.ndarray | None = None


class GeometryPair(NamedTuple):
    """Two geometries at poses (4, 4), with the shapes and swept radii [m] that they had when they were asked."""

    g1: CollisionGeometry
    X1: np.ndarray
    g2: CollisionGeometry
    X2: np.ndarray
    shapes_1: tuple[Shape, ...]
    shapes_2: tuple[Shape, ...]
    radius_1: float
    radius_2: float

    @classmethod
    def now(cls, g1: CollisionGeometry, X1: np.ndarray, g2: CollisionGeometry, X2: np.ndarray) -> GeometryPair:
        """With what the geometries have now."""
        return cls(g1, X1, g2, X2, g1._shapes, g2._shapes, g1._radius_swept, g2._radius_swept)

    def is_of_two_shapes(self) -> bool:
        """Whether each geometry is one shape, and one of the two has an end."""
        has_end = self.g1._box is not None or self.g2._box is not None
        return has_end and len(self.shapes_1) == len(self.shapes_2) == 1


def nearest(pair: GeometryPair, margin: float, limit: float, is_signed: bool) -> Nearest:
    """How far two geometries are apart.

    margin : what counts as within [m].   limit : farther pairs need a lower bound alone [m].   is_signed : whether
    depths are worked out. Raises what `collide.distance` raises.
    """
    if len(pair.shapes_1) == len(pair.shapes_2) == 1:
        return _of_shapes((pair.shapes_1[0], pair.shapes_2[0]), pair, margin, limit, is_signed)
    if isinstance(pair.g1, _FLATS) and isinstance(pair.g2, _FLATS):
        return _of_flats(pair, margin)
    answers = []
    for (shapes_1, facets_1), (shapes_2, facets_2) in (
        (p, q) for p in _connected(pair.g1) for q in _connected(pair.g2)
    ):
        sides = [_of_shapes((A, B), pair, margin, limit, is_signed) for A in shapes_1 for B in shapes_2]
        farthest = max(sides, key=lambda side: side.distance)
        answers.append(farthest._replace(
            is_within=all(side.is_within for side in sides), lower=max(side.lower for side in sides),
            facets_1=facets_1, facets_2=facets_2,
        ))
    least = min(answers, key=lambda answer: answer.distance)
    return least._replace(
        is_within=any(answer.is_within for answer in answers), lower=min(answer.lower for answer in answers)
    )


def _connected(g: CollisionGeometry) -> list[tuple[tuple[Shape, ...], np.ndarray | None]]:
    """Connected sets whose union a geometry is, each what its shapes share."""
    if isinstance(g, Plane):
        return [(g._shapes, None)]
    return [((shape,), facets) for shape, facets in g._pieces()]


def _of_shapes(shapes, pair: GeometryPair, margin: float, limit: float, is_signed: bool) -> Nearest:
    A, B = shapes
    g1, X1, g2, X2 = pair.g1, pair.X1, pair.g2, pair.X2
    swept_1, swept_2 = pair.radius_1, pair.radius_2
    radii = swept_1 + swept_2
    total = margin + radii
    try:
        if g1._has_parts or g2._has_parts:  # others are answered sooner without a limit
            largest = max(limit, margin, 0.0) + radii
            largest = largest if largest < _FAR else math.inf
            row = engine.distance(A, B, X1, X2, max_distance=largest, signed=is_signed).rows[0]
        else:
            row = engine.distance(A, B, X1, X2, signed=is_signed).rows[0]
    except UnsupportedQuery:
        if not (isinstance(g1, _FLATS) and isinstance(g2, _FLATS)):
            raise
        return _without_end(shapes, X1, X2)
    distance, lower, is_hit = float(row["distance"]), float(row["lower"]), bool(row["hit"])
    if total > 0.0:
        is_within = lower <= total and (row["upper"] <= total or hits(A, B, X1, X2, security_margin=total))
    else:
        is_within = is_hit if total == 0.0 else lower <= total
    part_1 = int(row["part_a"]) if g1._has_parts else -1
    part_2 = int(row["part_b"]) if g2._has_parts else -1
    normal, point_1, point_2 = row["normal"], row["point_a"], row["point_b"]
    if radii:
        point_1, point_2 = point_1 + swept_1 * normal, point_2 - swept_2 * normal
        if is_signed or not is_hit:
            distance, lower = distance - radii, lower - radii
    return Nearest(distance, lower, normal, point_1, point_2, part_1, part_2, bool(is_within), shapes)


def _of_flats(pair: GeometryPair, margin: float) -> Nearest:
    """Of planes and half-spaces, which have no end: the farthest of their sides."""
    sides = [_of_shapes((A, B), pair, margin, math.inf, True) for A in pair.shapes_1 for B in pair.shapes_2]
    farthest = max(sides, key=lambda side: side.distance)
    return farthest._replace(is_within=all(side.is_within for side in sides))


def _without_end(shapes, X1, X2) -> Nearest:
    """Of half-spaces that no translation takes apart: a point that they share, and coal's number for the depth."""
    normals = np.array([X[:3, :3] @ shape.normal for shape, X in zip(shapes, (X1, X2))])
    offsets = np.array([n @ X[:3, 3] + shape.offset for n, shape, X in zip(normals, shapes, (X1, X2))])
    if normals[0] @ normals[1] > 0.0:  # one within the other, or nearly: far down in both
        point = normals[0] * min(offsets[0], offsets[1])
        if (normals @ point > offsets).any():
            point = np.linalg.lstsq(normals, offsets, rcond=None)[0]
    else:
        point = np.linalg.lstsq(normals, offsets, rcond=None)[0]
    return Nearest(DEEPEST, DEEPEST, normals[0], point, point.copy(), -1, -1, True, shapes)
