"""Corners and normals of facets by number, and what a ray through a facet adds to a winding number."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.mesh.bvh import MeshTree
from collide.numerics import vec3
from collide.numerics.exact_points import Point, integers, leading_digits, placed
from collide.numerics.exact_vectors import Exact, cross, inner, minus
from collide.numerics.vec3 import Vec3, dot, put_vec3, sub, vec3_at

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
    X, corners = np.ascontiguousarray(X), np.ascontiguousarray(corners)
    n, listed = np.empty((len(corners), 3)), np.empty(len(corners), dtype=np.int64)
    step = 16 if len(X) > 1 else 0
    count = write_facet_normals(address_of(X), step, address_of(corners), len(n), address_of(n), address_of(listed))
    for k in listed[:count].tolist():
        (p, q, r), _ = placed(X[k if len(X) > 1 else 0], corners[k])
        exact = leading_digits(cross(minus(q, p), minus(r, p)))
        length = np.sqrt(np.square(exact).sum())
        n[k] = (exact / length if length > 0.0 else np.zeros(3)) + 0.0
    return n


@entry("int64(int64, int64, int64, int64, int64, int64)")
def write_facet_normals(X_at, step, corners_at, n, normals_at, listed_at):
    """Write the unit normals in W of n facets, corners of 9 doubles each; slivers, whose normal needs exact numbers,
    are listed. Returns how many are listed.

    X : the facets' poses, step 16, or 0 of a single one.   listed : room for n numbers.
    """
    normals, listed, count = view_f64(normals_at, 3 * n), view_i64(listed_at, n), 0
    for k in range(n):
        corners, X = view_f64(corners_at + 72 * k, 9), view_f64(X_at + 8 * step * k, 16)
        a = vec3_at(corners, 0)
        u, v = sub(vec3_at(corners, 3), a), sub(vec3_at(corners, 6), a)
        size = max(abs(u.x), abs(u.y), abs(u.z), abs(v.x), abs(v.y), abs(v.z))
        size = size if size > 0.0 else 1.0
        n_W = vec3.cross(_turned(X, u, size), _turned(X, v, size))
        length = math.sqrt(dot(n_W, n_W))
        if not length > _MIN_LENGTH:
            listed[count] = k
            count += 1
            length = 1.0
        put_vec3(normals, 3 * k, Vec3(n_W.x / length + 0.0, n_W.y / length + 0.0, n_W.z / length + 0.0))
    return count


@kernel(inline=True)
def _turned(X, u, size):
    v = Vec3(u.x / size, u.y / size, u.z / size)
    return Vec3(dot(vec3_at(X, 0), v), dot(vec3_at(X, 4), v), dot(vec3_at(X, 8), v))


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
