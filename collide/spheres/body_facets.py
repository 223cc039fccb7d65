"""A body by its parts: facets around each part, and how far points are from the body, negative inside."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.base.poses_at import poses_at
from collide.certificates.exact_parts import leaves_of
from collide.errors import UnsupportedQuery
from collide.lowering.convex_sets import convex_set
from collide.pairs.query import distance
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.hpolytope import HPolytope
from collide.shapes.mesh import Mesh
from collide.shapes.primitives import Box, Capsule, Cone, Cylinder, Ellipsoid, Sphere
from collide.shapes.shape import Shape
from collide.shapes.tessellation import tessellate
from collide.surface_queries.signed_distances import signed_distances

#: Facets around curved parts are off by this share of their radius.
_DEVIATION = 0.008
#: Flat bodies are taken as this much thicker, in parts of their size.
_THICKNESS = 2.0**-20
#: Products of points and facets worked on at a time.
_BLOCK = 1 << 21
#: Samples by which an open surface is said to wind around a point.
_N_WINDING = 800
_POINT = ConvexHull(np.zeros((1, 3)))


class BodyPart(NamedTuple):
    """A part of a body, seen from the frame of the body.

    shape, X : the part, and its pose (4, 4).
    vertices, faces : the closed surface around a convex part, in the frame of the part; ``None`` of a `Mesh`.
    mesh : the facets in the frame of the body, for the distances of points.
    solid : whether the inside belongs to the part.
    deviation : no point of the facets is farther from a convex part [m]; 0 for a `Mesh`.
    """

    shape: Shape
    X: np.ndarray
    vertices: np.ndarray | None
    faces: np.ndarray | None
    mesh: Mesh
    solid: bool
    deviation: float

    @property
    def corners(self) -> np.ndarray:
        """(m, 3, 3) the corners of the facets in the frame of the body."""
        return self.mesh.vertices[self.mesh.faces]


def is_same(a: BodyPart, b: BodyPart) -> bool:
    """Whether two parts are equal shapes at the same pose."""
    return np.array_equal(a.X, b.X) and a.shape == b.shape


def body_parts(shape: Shape, what: str = "enclosing_spheres: shape") -> list[BodyPart]:
    """The parts of a body, in the order of `leaves_of`. Raises UnsupportedQuery for what has no facets, in the words of
    an argument ``what``.
    """
    return [_part(leaf, poses, what) for leaf, poses in leaves_of(shape)]


def _part(leaf: Shape, poses: tuple[np.ndarray, ...], what: str) -> BodyPart:
    X = np.eye(4)
    for step in poses:
        X = step @ X
    if isinstance(leaf, Mesh):
        mesh = leaf if np.array_equal(X, np.eye(4)) else Mesh(placed(leaf.vertices, X), leaf.faces)
        return BodyPart(leaf, X, None, None, mesh, leaf.solid, 0.0)
    vertices, faces = facets_around(leaf, what)
    # The distance from a convex set is convex: on a facet it is largest at a corner.
    deviation = np.max(distance(leaf, _POINT, np.eye(4), poses_at(vertices), signed=False, check_poses=False).upper)
    return BodyPart(leaf, X, vertices, faces, Mesh(placed(vertices, X), faces), True, max(float(deviation), 0.0))


def placed(points: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Points (n, 3) of a frame with the pose X (4, 4)."""
    return points @ X[:3, :3].T + X[:3, 3]


def shells_of(part: BodyPart) -> np.ndarray:
    """(m,) the number of the shell of each facet of a mesh, from 0; facets of no shell have numbers for themselves."""
    n = len(part.mesh.faces)
    shells = part.mesh.survey.shells.astype(np.int64) if part.solid else np.full(n, -1)
    return np.unique(np.where(shells < 0, np.arange(n) + shells.max() + 1, shells), return_inverse=True)[1]


# --- closed surfaces around convex parts --------------------------------------------------------


def facets_around(leaf: Shape, what: str) -> tuple[np.ndarray, np.ndarray]:
    """(vertices, faces) of a closed surface around a convex shape: its own facets, or facets around a curved shape."""
    if not isinstance(leaf, (Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, HPolytope, Sphere)) or leaf.is_region:
        raise UnsupportedQuery(
            f"{what}: a {type(leaf).__name__} has no facets around it: give primitives, hulls, meshes or a Compound of "
            "these"
        )
    if isinstance(leaf, (Cylinder, Cone, Ellipsoid)) or convex_set(leaf).radius > 0.0:
        return _pushed_outwards(leaf)
    points = np.unique(convex_set(leaf).points + 0.0, axis=0)
    hull = ConvexHull(points).hull
    if hull.dimension < 3:
        size = float(np.ptp(points, axis=0).max()) or float(np.abs(points).max()) or 1.0
        steps = _THICKNESS * size * np.concatenate([np.eye(3), -np.eye(3)])
        points = (points[:, None] + steps).reshape(-1, 3)
        hull = ConvexHull(points).hull
    used, faces = np.unique(hull.facets.reshape(-1, 3), return_inverse=True)
    return points[used], faces.reshape(-1, 3)


def _pushed_outwards(leaf: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Facets of a tessellation, scaled about an inner point until the plane of each lies outside the shape."""
    radius = max(leaf.radii) if isinstance(leaf, Ellipsoid) else getattr(leaf, "radius")  # noqa: B009
    vertices, faces = tessellate(leaf, tolerance=_DEVIATION * float(radius))
    convex = None if isinstance(leaf, (Cylinder, Cone, Ellipsoid)) else convex_set(leaf)
    middle = np.zeros(3) if convex is None else convex.points.mean(axis=0)
    a, b, c = (vertices[faces[:, k]] - middle for k in range(3))
    n = np.cross(b - a, c - a)
    length = np.sqrt(np.square(n).sum(axis=1))
    n, a = n[length > 0.0] / length[length > 0.0, None], a[length > 0.0]
    offsets = np.einsum("ij,ij->i", n, a)
    ratio = float((_reach(leaf, convex, middle, n) / offsets).max())
    return middle + (vertices - middle) * (ratio * (1.0 + 2.0**-40)), faces


def _reach(leaf: Shape, convex, middle: np.ndarray, n: np.ndarray) -> np.ndarray:
    """(k,) how far a shape reaches along unit vectors from an inner point."""
    if convex is not None:
        return (n @ (convex.points - middle).T).max(axis=1) + convex.radius
    if isinstance(leaf, Ellipsoid):
        return np.sqrt(np.square(n * leaf.radii).sum(axis=1))
    rim, half = leaf.radius * np.hypot(n[:, 0], n[:, 1]), 0.5 * leaf.length * n[:, 2]  # type: ignore[attr-defined]
    return rim + np.abs(half) if isinstance(leaf, Cylinder) else np.maximum(half, rim - half)


# --- distances ----------------------------------------------------------------------------------


class Reach:
    """How far points are from a body, negative inside, as a guide: curved parts are taken by their facets.

    A surface has for its inside the points around which the surface winds half or more, estimated from samples.
    """

    def __init__(self, parts: list[BodyPart]):
        self.parts = parts
        self._samples = [None if part.solid else surface_samples(part.corners, _N_WINDING) for part in parts]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(n,) of points (n, 3) in the frame of the body. O(n log m) for solids of m facets."""
        out = np.full(len(points), np.inf)
        for part, samples in zip(self.parts, self._samples):
            away = signed_distances(part.mesh, points, signed=part.solid).distance
            if samples is not None:
                away = np.where(_winding_of_samples(*samples, points) >= 0.5, -away, away)
            np.minimum(out, away, out=out)
        return out


def surface_samples(corners: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """(points (n, 3) spread evenly over facets (m, 3, 3), the area vectors (n, 3) they stand for); the same each time.
    """
    vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ends = np.cumsum(np.sqrt(np.square(vectors).sum(axis=1)))
    if not ends[-1] > 0.0:
        return corners.reshape(-1, 3)[:n], np.zeros((min(n, 3 * len(corners)), 3))
    places = (np.arange(n) + 0.5) / n * ends[-1]
    facet = np.minimum(np.searchsorted(ends, places), len(ends) - 1)
    # M. Roberts' additive sequence of two dimensions, folded into the triangle.
    u, v = (np.arange(1, n + 1) * step % 1.0 for step in (0.7548776662466927, 0.5698402909980532))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    a, b, c = (corners[facet, k] for k in range(3))
    area = np.maximum(np.sqrt(np.square(vectors[facet]).sum(axis=1)), np.finfo(float).tiny)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), vectors[facet] / area[:, None] * (ends[-1] / n)


def _winding_of_samples(samples: np.ndarray, vectors: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) the winding number of a surface around points, each sample a dipole."""
    out = np.empty(len(points))
    middle = samples.mean(axis=0)
    samples, points = samples - middle, points - middle
    squares, along = np.square(samples).sum(axis=1), np.einsum("ij,ij->i", samples, vectors)
    step = max(1, _BLOCK // len(samples))
    for start in range(0, len(points), step):
        some = points[start : start + step]
        away = squares + np.square(some).sum(axis=1)[:, None] - 2.0 * some @ samples.T
        np.maximum(away, 1e-12 * squares.max(), out=away)
        out[start : start + step] = ((along - some @ vectors.T) / (away * np.sqrt(away))).sum(axis=1)
    return out / (4.0 * math.pi)


def farthest_reaches(parts: list[BodyPart], points: np.ndarray) -> np.ndarray:
    """(n,) proven upper bounds of how far points are from a body, negative inside; curved parts as they are."""
    return reach_bounds(parts, points)[1]


def reach_bounds(parts: list[BodyPart], points: np.ndarray, *, wrapped: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """(lower, upper) proven bounds (n,) of how far points are from a body, negative inside; curved parts as they are.

    Inside, bounds are of the part with the point deepest. What a surface wraps counts as body, known from a single
    side: lower bounds are −inf then. ``wrapped`` : whether to ask what is wrapped, O(n m) for m facets; upper bounds
    are larger without.
    """
    lower, upper = np.full(len(points), np.inf), np.full(len(points), np.inf)
    X_WP = poses_at(points)
    for part in parts:
        if not isinstance(part.shape, Mesh):
            away = distance(part.shape, _POINT, part.X, X_WP, check_poses=False)
            least, largest = np.asarray(away.lower), np.asarray(away.upper)
        else:
            near = signed_distances(part.mesh, points, signed=part.solid)
            least, largest = np.asarray(near.lower), np.asarray(near.upper)
            if not part.solid:
                # Solid angles are sums of rounded terms: 1e-9 is far above what their rounding adds up to.
                winding = winding_of_surface(part.corners, points) if wrapped else np.zeros(len(points))
                least, largest = np.full(len(points), -np.inf), np.where(winding >= 0.5 + 1e-9, -least, largest)
            if part.mesh is not part.shape:  # vertices were rounded when placed, by less than 2^-50 of the largest
                rounding = 2.0**-50 * (np.abs(part.mesh.vertices).max() + np.abs(part.X[:3, 3]).max())
                least, largest = least - rounding, largest + rounding
        np.minimum(lower, least, out=lower)
        np.minimum(upper, largest, out=upper)
    return lower, upper


def winding_of_surface(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) how often facets (m, 3, 3) wind around points, solid angles over 4π: no whole number around an open surface.

    A. Van Oosterom and J. Strackee, "The solid angle of a plane triangle" (1983). O(n m).
    """
    out = np.zeros(len(points))
    step = max(1, _BLOCK // max(len(corners), 1))
    for start in range(0, len(points), step):
        away = corners[None] - points[start : start + step, None, None]
        a, b, c = (away[:, :, k] for k in range(3))
        la, lb, lc = (np.sqrt(np.square(v).sum(axis=2)) for v in (a, b, c))
        volume = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ijk,ijk->ij", u, v) for u, v in ((a, b), (b, c), (c, a)))
        out[start : start + step] = np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    return out / (2.0 * math.pi)
