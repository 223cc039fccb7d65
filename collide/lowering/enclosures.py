"""Convex shapes without exact facets, as meshes meet them: between a polytope inside and one around.

Cylinders, cones and ellipsoids are curved; the corners of an `HPolytope` may be rounded. A polytope around the shape
and one inside it, both made of doubles, decide most questions without rounding: what does not meet the outer one does
not meet the shape, what meets the inner one does. The rest is for the convex engine, facet by facet
(`facets_against_curved.py`).

Both polytopes are right by more than rounding: rings and corners are drawn in or pushed out by 1e-12 of the size
beyond what the geometry asks; that of a shape with planes is looked at in fractions.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import convex_hull
from collide.lowering.facet_bodies import Body, made_body
from collide.lowering.packed_convex import CONE, CYLINDER, ELLIPSOID, PackedConvex
from collide.lowering.parts import convex_set_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.shapes.hpolytope import HPolytope
from collide.shapes.shape import Shape, kept_with_shape

#: Corners of the rings around an axis, and times the facets of an icosahedron are cut in four.
_SIDES, _CUTS = 32, 2
#: Beyond what the geometry asks, relative.
_MARGIN = 1e-12


class Enclosure(NamedTuple):
    """A convex shape between two polytopes, in its own frame.

    outer : the polytope around it, a solid body whose hull (`hull_of`) is the shape itself.
    inner : a polytope within the shape; None where none was found.
    packed : the shape as the convex engine reads it.
    """

    outer: Body
    inner: Body | None
    packed: PackedConvex

    @property
    def key(self) -> tuple:
        return self.outer.key


@kept_with_shape("_surface")
def enclosure_of(shape: Shape) -> Enclosure:
    """The polytopes of a convex shape without exact facets, made when first asked for and kept with it."""
    packed = convex_set_of(shape)
    outer, inner = _polytopes(shape, packed)
    point = inner[:1] if inner is not None and packed.slop else packed.points[:1] if packed.slop else np.zeros((1, 3))
    return Enclosure(_body(shape, outer, point), None if inner is None else _body(shape, inner, inner[:1]), packed)


def _body(shape: Shape, points: np.ndarray, own_point: np.ndarray) -> Body:
    hull = convex_hull(points)
    tree = build_mesh_tree(points, hull.facets)
    return made_body(shape, tree, True, 0.0, own_point)


def _polytopes(shape: Shape, packed: PackedConvex) -> tuple[np.ndarray, np.ndarray | None]:
    """Corners (n, 3) of a solid polytope around a shape, and of one within."""
    if packed.kind in (CYLINDER, CONE):
        radius, half = packed.params[:2].tolist()
        return _turned(radius * (1 + _MARGIN) / np.cos(np.pi / _SIDES), half, packed.kind), _turned(
            radius * (1 - _MARGIN), half, packed.kind
        )
    if packed.kind == ELLIPSOID:
        points, least = _ball()
        return points * ((1 + _MARGIN) / least) * packed.params[:3], points * (1 - _MARGIN) * packed.params[:3]
    return _around(packed), _within(shape, packed)


def _turned(radius: float, half: float, kind: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(_SIDES, -half)], axis=1)
    return np.vstack([ring, [[0.0, 0.0, half]] if kind == CONE else ring * (1.0, 1.0, -1.0)])


@cache
def _ball() -> tuple[np.ndarray, float]:
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


def _around(packed: PackedConvex) -> np.ndarray:
    """Corners of boxes that hold what the stored points may stand for."""
    low = np.nextafter(packed.points - packed.slop, -np.inf)
    high = np.nextafter(packed.points + packed.slop, np.inf)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    points = np.where(corners[None], high[:, None], low[:, None]).reshape(-1, 3)
    return points[convex_hull(points).vertices]


def _within(shape: Shape, packed: PackedConvex) -> np.ndarray | None:
    """The stored corners drawn in a little, where that is in all half-spaces, exactly, and solid."""
    if not isinstance(shape, HPolytope):
        return None
    middle = packed.points.mean(axis=0)
    for shrink in (2.0**-40, 2.0**-30, 2.0**-20, 2.0**-10):
        points = middle + (packed.points - middle) * (1 - shrink)
        if _in_all(shape, points):
            hull = convex_hull(points)
            return points[hull.vertices] if hull.dimension == 3 else None
    return None


def _in_all(shape: HPolytope, points: np.ndarray) -> bool:
    """Whether points are in all half-spaces: by doubles where these tell, in fractions where they do not."""
    terms = shape.normals[:, None] * points[None]
    inside = terms.sum(axis=2) + 2.0**-48 * np.abs(terms).sum(axis=2) <= shape.offsets[:, None] - 2.0**-1000
    return all(
        sum(Fraction(a) * Fraction(x) for a, x in zip(shape.normals[i].tolist(), points[j].tolist()))
        <= Fraction(float(shape.offsets[i]))
        for i, j in np.argwhere(~inside).tolist()
    )
