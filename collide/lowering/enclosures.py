"""Convex shapes without exact facets, as meshes meet them: between a polytope inside and one around.

Cylinders, cones and ellipsoids are curved; the corners of an `HPolytope` may be rounded. A polytope around the shape
and a polytope inside, both made of doubles, decide most questions without rounding: a miss of the outer polytope is a
miss of the shape, a hit of the inner polytope a hit of the shape. The rest is for the convex engine, facet by facet
(`facets_against_curved.py`).

Both polytopes are right by more than rounding: rings and corners are drawn in or pushed out by 1e-12 of the size
beyond what the geometry asks; corners are checked against a shape's planes in fractions.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.curved.curved_kinds import CURVED
from collide.hull.exact_hull import convex_hull
from collide.lowering.facet_bodies import Body, made_body
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.parts import convex_set_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.shapes.hpolytope import HPolytope
from collide.shapes.shape import Shape, kept_with_shape


class Enclosure(NamedTuple):
    """A convex shape between two polytopes, in its own frame.

    outer : the polytope around the shape, a solid body whose hull (`hull_of`) is the shape itself.
    inner : a polytope within the shape; ``None`` where not found.
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
    if packed.kind in CURVED:
        return CURVED[packed.kind].polytopes(packed.params)
    return _around(packed), _within(shape, packed)


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
