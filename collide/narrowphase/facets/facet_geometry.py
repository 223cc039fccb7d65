"""Corners and normals of facets by number, and what a ray through a facet adds to a winding number."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from collide.mesh.bvh import MeshTree
from collide.numerics.exact_points import Point, integers, leading_digits, placed
from collide.numerics.exact_vectors import Exact, cross, inner, minus

Vector = tuple[Exact, Exact, Exact]
Direction = TypeVar("Direction", bound=tuple)

#: Directions of rays tried one after another, where one passes an edge or a corner.
RAY_DIRECTIONS = (
    (89, 233, 610), (-1597, 377, 987), (144, -2584, 55), (-34, 21, -4181), (6765, -8, 13), (-3, -5, 10946),
)
#: Normals of facets whose longest edge is 1 along some axis: those shorter than this are worked out exactly.
_MIN_LENGTH = 2.0**-24


class FacetCorners:
    """Corners of the facets of a tree, by facet number."""

    def __init__(self, tree: MeshTree):
        self._triangles = tree.triangles
        self._place = np.empty(len(tree.ids), dtype=np.int64)
        self._place[tree.ids] = np.arange(len(self._place))

    def __getitem__(self, facets) -> np.ndarray:
        """(k, 3, 3) corners of facets (k,) in the frame of the mesh; (3, 3) of a single one."""
        return self._triangles[self._place[facets]].reshape(*np.shape(facets), 3, 3)


def exact_point(point: np.ndarray) -> tuple[list[Point], int]:
    """A point (3,) of the world as `placed` gives points: integers, and the exponent of their grid."""
    (x, y, z), grid = integers(point)
    return [(x, y, z)], grid


def facet_normals(X: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(k, 3) unit normals in W of facets (k, 3, 3) under poses (k, 4, 4) or (1, 4, 4); 0 of those without area,
    exactly.
    """
    c = np.ascontiguousarray(corners.transpose(1, 2, 0))
    u, v = c[1] - c[0], c[2] - c[0]  # a row an axis: quicker by far than rows of three
    sizes = np.maximum(np.abs(u).max(axis=0), np.abs(v).max(axis=0))
    sizes[sizes == 0.0] = 1.0
    u, v = (
        [X[:, i, 0] * w[0] + X[:, i, 1] * w[1] + X[:, i, 2] * w[2] for i in range(3)] for w in (u / sizes, v / sizes)
    )
    n = np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], axis=1)
    lengths = np.sqrt(n[:, 0] * n[:, 0] + n[:, 1] * n[:, 1] + n[:, 2] * n[:, 2])
    for k in np.flatnonzero(~(lengths > _MIN_LENGTH)).tolist():
        (p, q, r), _ = placed(X[k if len(X) > 1 else 0], corners[k])
        n[k] = leading_digits(cross(minus(q, p), minus(r, p)))
        lengths[k] = np.sqrt(np.square(n[k]).sum())
    lengths = lengths[:, None]
    return np.where(lengths > 0.0, n / np.where(lengths > 0.0, lengths, 1.0), 0.0) + 0.0


def ray_crossing(direction: Direction, a: Vector, b: Vector, c: Vector) -> int | None:
    """The exact contribution of a facet to the winding number of a ray's origin. a, b, c : its corners less the origin.

    1 where the ray leaves through the facet, −1 where the ray enters, 0 where the ray passes beside; ``None`` where the
    line of the ray passes an edge or a corner, or runs along the facet.
    """
    sides = [inner(direction, cross(p, q)) for p, q in ((a, b), (b, c), (c, a))]
    if max(sides) > 0 > min(sides):
        return 0
    if 0 in sides:
        return None
    is_ahead = inner(a, cross(b, c)) * sides[0] > 0
    return (1 if sides[0] > 0 else -1) if is_ahead else 0
