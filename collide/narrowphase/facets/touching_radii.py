"""Meshes touching hulls swept by balls within rounding: facet by facet, by the convex engine.

Cores are apart there, and bodies share a point where the hull's core comes as near to a facet as the radius is. A
triangle is a convex set, so each pair of a facet and the hull is decided exactly, on the poses as given.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import body_of
from collide.narrowphase.convex_batches import convex_rows
from collide.narrowphase.facets.facet_queries import facets_within
from collide.results import UNDECIDED
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape

#: Of more pairs of facets than this the sign stays open.
_MAX_PAIRS = 1024
#: Of the sum of the radii: it is rounded itself.
_ROUNDED = 1.0 + 2.0**-50


class Touching(NamedTuple):
    """What is proven of two bodies.

    is_hit : whether both share a point, ``None`` where open.   row : (1,) of the deciding pair of facets, the nearest
    pair of bodies apart.
    """

    is_hit: bool | None
    row: np.ndarray


def settle_touching(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> Touching | None:
    """What facets prove of two bodies with radii at poses (4, 4); ``None`` of bodies without radii, or with too many
    facets near.
    """
    a, b = body_of(A), body_of(B)
    radius = a.radius + b.radius
    near = facets_within(a.tree, b.tree, X_WA, X_WB, radius * _ROUNDED, _MAX_PAIRS) if radius > 0.0 else None
    if near is None or not len(near.facets):
        return None
    parts = {(_part(A, int(i)), _part(B, int(j))): None for i, j in near.facets[np.argsort(near.lower, kind="stable")]}
    rows = []
    for i, j in parts:
        row = convex_rows(_convex(A, i), _convex(B, j), X_WA[None], X_WB[None], depths=False)
        if row["hit"][0] and row["how"][0] != UNDECIDED:
            return Touching(True, row)
        rows.append(row)
    is_open = any(row["hit"][0] for row in rows)
    return Touching(None if is_open else False, min(rows, key=lambda row: float(row["lower"][0])))


def _part(shape: Shape, facet: int) -> int:
    """The facet of a mesh; of a convex shape, all of it."""
    return facet if isinstance(shape, Mesh) else -1


def _convex(shape: Shape, facet: int) -> Shape:
    return ConvexHull(shape.vertices[shape.faces[facet]]) if isinstance(shape, Mesh) else shape
