"""Contacts of meshes facet by facet, as engines have them that ask for one contact, or for every two facets that meet.

One contact of a mesh is that of the facets that decide that the bodies meet: it costs what the boolean costs, however
deep the bodies are in each other. `collide.contacts` describes whole overlaps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import collide as engine
from collide.adapters.hosts.nearest_points import nearest_points
from collide.kernels.prepared import row_fields
from collide.narrowphase.facets.single_facets import facets_with, two_facets
from collide.shapes.shape import Shape

#: The corner after each of three, and the one after that.
_FOLLOWING, _LAST = [1, 2, 0], [2, 0, 1]


class FacetContact(NamedTuple):
    """How two facets, or a facet and a solid, that meet come apart after the shortest way, each by itself.

    facet_a, facet_b : their numbers, −1 of a solid.   normal : (3,) from A to B.   point_a, point_b, middle : (3,) [m].
    distance : minus the length of the way [m], ≤ 0.
    """

    facet_a: int
    facet_b: int
    normal: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray
    middle: np.ndarray
    distance: float


def deciding_contact(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, answer: tuple) -> FacetContact:
    """The contact of the facets that decide that two bodies meet, of which one is a mesh, the other a mesh or a single
    convex set.

    answer : of `nearest_points` without depths, a hit.   O(log n), and O(n) where a part of a mesh of several lies
    inside the solid.
    """
    _, _, point, _, _, i, j, _ = answer
    if not isinstance(A, engine.Mesh):
        distance, normal, point_b, point_a, middle, j = _of_facet_and_solid(B, j, A, X_WB, X_WA, point)
        return FacetContact(-1, j, -normal, point_a, point_b, middle, distance)
    if not isinstance(B, engine.Mesh):
        distance, normal, point_a, point_b, middle, i = _of_facet_and_solid(A, i, B, X_WA, X_WB, point)
        return FacetContact(i, -1, normal, point_a, point_b, middle, distance)
    row = two_facets().distance(X_WA, X_WB, A, i, B, j)
    fields = nearest_points(_facet(A, i), _facet(B, j), X_WA, X_WB) if row is None else row_fields(row)
    distance, normal, point_a, point_b, middle, _, _, _ = fields
    return FacetContact(i, j, normal, point_a, point_b, middle, min(distance, 0.0))


def _of_facet_and_solid(A, i: int, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, point: np.ndarray) -> tuple:
    """(distance, normal, point_a, point_b, their middle, facet) of facet i of a mesh; where it does not meet the solid,
    of a facet at the point that both share: a part that lies inside the solid is not named.
    """
    fields = _nearest_of_facet(A, i, B, X_WA, X_WB)
    if fields[0] > 0.0:
        i = _facet_at(A, X_WA, point)
        fields = _nearest_of_facet(A, i, B, X_WA, X_WB)
    distance, normal, point_a, point_b, middle, _, _, _ = fields
    return min(distance, 0.0), normal, point_a, point_b, middle, i


def _nearest_of_facet(A, i: int, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> tuple:
    """`nearest_points` of facet i of a mesh and a solid."""
    row = facets_with(B).distance(X_WA, X_WB, A, i)
    return nearest_points(_facet(A, i), B, X_WA, X_WB) if row is None else row_fields(row)


def _facet(mesh, i: int) -> Shape:
    return engine.ConvexHull(mesh.vertices[mesh.faces[i]])


def _facet_at(mesh, X_WM: np.ndarray, point: np.ndarray) -> int:
    """A facet with the vertex that is nearest to a point of the world."""
    place = (point - X_WM[:3, 3]) @ X_WM[:3, :3]
    vertex = np.square(mesh.vertices - place).sum(axis=1).argmin()
    return int((mesh.faces == vertex).any(axis=1).argmax())


def contacts_of_facets(A, B, X_WA, X_WB, limit: int, with_geometry: bool) -> list[tuple]:
    """(facet of A, of B, normal, pos, depth) of up to ``limit`` pairs of facets of two meshes that meet, which is
    decided exactly.   with_geometry : whether the last three are wanted; else they are 0.
    """
    pairs = engine.facet_pairs(A, B, X_WA, X_WB, first=limit == 1).pairs[:limit]
    if not with_geometry:
        return [(i, j, np.zeros(3), np.zeros(3), 0.0) for i, j in pairs.tolist()]
    return [(i, j, *of_pair) for (i, j), of_pair in zip(pairs.tolist(), _of_facet_pairs(A, B, X_WA, X_WB, pairs))]


def _of_facet_pairs(A, B, X_WA: np.ndarray, X_WB: np.ndarray, pairs: np.ndarray) -> list[tuple]:
    """(normal, pos, depth) of pairs (n, 2) of facets that meet.

    The normal is that along which the two triangles, as flat convex sets, come apart after the shortest way, which is
    the depth; pos is the middle of what they share. In doubles, good to rounding.
    """
    corners_a = (A.vertices[A.faces[pairs[:, 0]]] @ X_WA[:3, :3].T) + X_WA[:3, 3]
    corners_b = (B.vertices[B.faces[pairs[:, 1]]] @ X_WB[:3, :3].T) + X_WB[:3, 3]
    return list(zip(*_triangles_apart(corners_a, corners_b)))


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Cross products of vectors (…, 3); numpy's takes far longer for few."""
    return u[..., _FOLLOWING] * v[..., _LAST] - u[..., _LAST] * v[..., _FOLLOWING]


def _triangles_apart(corners_a: np.ndarray, corners_b: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """(normals (n, 3), positions (n, 3), depths) of pairs of triangles (n, 3, 3) that meet.

    The shortest way out of a Minkowski difference is along a normal of one of its faces: of a triangle, across two
    edges, or, of parallel triangles, in their plane across an edge.
    """
    edges_a, edges_b = corners_a[:, _FOLLOWING] - corners_a, corners_b[:, _FOLLOWING] - corners_b
    normal_a, normal_b = _cross(edges_a[:, 0], edges_a[:, 1]), _cross(edges_b[:, 0], edges_b[:, 1])
    across = _cross(edges_a[:, :, None], edges_b[:, None]).reshape(-1, 9, 3)
    in_plane = [_cross(normal[:, None], edges) for normal, edges in ((normal_a, edges_a), (normal_b, edges_b))]
    axes = np.concatenate([normal_a[:, None], normal_b[:, None], across, *in_plane], axis=1)
    lengths = np.sqrt((axes * axes).sum(axis=2))
    scale = np.abs(edges_a).max(axis=(1, 2)) * np.abs(edges_b).max(axis=(1, 2))
    short = lengths <= 1e-12 * np.maximum(scale, lengths.max(axis=1))[:, None]
    axes = axes / np.where(short, 1.0, lengths)[:, :, None]
    axes = np.concatenate([axes, -axes], axis=1)
    reach_a, reach_b = axes @ corners_a.transpose(0, 2, 1), axes @ corners_b.transpose(0, 2, 1)
    depth = reach_a.max(axis=2) - reach_b.min(axis=2)
    depth[np.concatenate([short, short], axis=1)] = np.inf
    best, n = depth.argmin(axis=1), np.arange(len(axes))
    normal = axes[n, best]
    way = np.maximum(depth[n, best], 0.0)
    middle = corners_a[n, reach_a[n, best].argmax(axis=1)] - 0.5 * way[:, None] * normal
    common = _common_points(corners_a, corners_b, normal_a, normal_b)
    return normal, np.where(np.isfinite(common), common, middle), way.tolist()


def _common_points(corners_a, corners_b, normal_a, normal_b) -> np.ndarray:
    """Middles (n, 3) of what pairs of triangles share; NaN where they lie in one plane."""
    along = _cross(normal_a, normal_b)
    with np.errstate(all="ignore"):
        ends = [
            _crossing(corners, plane_normal, plane_corners[:, 0], along)
            for corners, plane_normal, plane_corners in (
                (corners_a, normal_b, corners_b), (corners_b, normal_a, corners_a)
            )
        ]
        (low_a, high_a, at_low, at_high), (low_b, high_b, *_) = ends
        s = 0.5 * (np.maximum(low_a, low_b) + np.minimum(high_a, high_b))
        part = np.where(high_a > low_a, (s - low_a) / (high_a - low_a), 0.0)
        lengths = [np.linalg.norm(vectors, axis=1) for vectors in (along, normal_a, normal_b)]
        flat = lengths[0] <= 1e-12 * lengths[1] * lengths[2]
        points = at_low + np.clip(part, 0.0, 1.0)[:, None] * (at_high - at_low)
    points[flat] = np.nan
    return points


def _crossing(corners, plane_normal, plane_point, along):
    """Where triangles cross planes: (lowest, highest) along a direction, and the points (n, 3) there."""
    height = np.einsum("nvc,nc->nv", corners - plane_point[:, None], plane_normal)
    following = height[:, _FOLLOWING]
    t = np.where(height == following, 0.0, height / (height - following))
    crosses = (height * following <= 0.0) & ~((height == following) & (height != 0.0))
    points = corners + np.clip(t, 0.0, 1.0)[:, :, None] * (corners[:, _FOLLOWING] - corners)
    s = np.einsum("nvc,nc->nv", points, along)
    n = np.arange(len(s))
    first, last = np.where(crosses, s, np.inf).argmin(axis=1), np.where(crosses, s, -np.inf).argmax(axis=1)
    return s[n, first], s[n, last], points[n, first], points[n, last]
