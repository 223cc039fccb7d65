"""Contacts of facets in python-fcl's form: of two meshes, pair by pair, and of one facet with a solid."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_geometry import CollisionObject
from collide.adapters.hosts.fcl_requests import OBJECT_TYPE, Contact

#: The corner after each of three, and the one after that.
_FOLLOWING, _LAST = [1, 2, 0], [2, 0, 1]


def new_contact(g1, g2, b1: int, b2: int, normal, pos, depth: float) -> Contact:
    """A contact with these fields; those that its constructor would make are not made first."""
    contact = Contact.__new__(Contact)
    contact.o1, contact.o2, contact.b1, contact.b2 = g1, g2, b1, b2
    contact.normal, contact.pos, contact.penetration_depth = normal, pos, depth
    return contact


def contact_when_read(g1, g2, work: Callable[..., tuple], *question) -> Contact:
    """A contact with fields ``work(*question)``, in the order of `Contact._later`, when one of them is first read."""
    contact = Contact.__new__(Contact)
    contact.o1, contact.o2 = g1, g2
    contact._postpone(partial(work, *question))
    return contact


def facet_contact(o1: CollisionObject, o2: CollisionObject, with_geometry: bool) -> Contact:
    """The contact of a mesh o1 and a mesh or a solid o2 that meet: of those facets that decide that they do, by
    themselves; one of those that `facet_contacts` has.
    """
    g1, g2 = o1._geometry, o2._geometry
    are_meshes = g2._object_type == OBJECT_TYPE.OT_BVH
    question = g1._shape, g2._shape, o1._X.copy(), o2._X.copy(), are_meshes, with_geometry
    return contact_when_read(g1, g2, _of_deciding_facets, *question)


def _of_deciding_facets(A, B, X_WA: np.ndarray, X_WB: np.ndarray, are_meshes: bool, with_geometry: bool) -> tuple:
    """The fields `Contact._later` of a mesh and a mesh or a solid."""
    answer = engine.distance(A, B, X_WA, X_WB, signed=False)
    i, j = answer.part_a, answer.part_b if are_meshes else -1
    if not with_geometry:
        return i, j, np.zeros(3), np.zeros(3), 0.0
    if are_meshes:
        return i, j, *_of_facet_pairs(A, B, X_WA, X_WB, np.array([[i, j]]))[0]
    return i, j, *_of_facet_and_solid(A.vertices[A.faces[i]], B, X_WA, X_WB)


def facet_contacts(o1: CollisionObject, o2: CollisionObject, limit: int, with_geometry: bool) -> list[Contact]:
    """One for each pair of facets of two meshes that meet."""
    g1, g2 = o1._geometry, o2._geometry
    values = contacts_of_facets(g1._shape, g2._shape, o1._X, o2._X, limit, with_geometry)
    return [new_contact(g1, g2, *of_pair) for of_pair in values]


def contacts_of_facets(A, B, X_WA, X_WB, limit: int, with_geometry: bool) -> list[tuple]:
    """(facet of A, of B, normal, pos, depth) of up to ``limit`` pairs of facets of two meshes that meet, which is
    decided exactly.   with_geometry : whether the last three are wanted; else they are 0.
    """
    pairs = engine.facet_pairs(A, B, X_WA, X_WB, first=limit == 1).pairs[:limit]
    if not with_geometry:
        return [(i, j, np.zeros(3), np.zeros(3), 0.0) for i, j in pairs.tolist()]
    return [(i, j, *of_pair) for (i, j), of_pair in zip(pairs.tolist(), _of_facet_pairs(A, B, X_WA, X_WB, pairs))]


def _of_facet_and_solid(triangle: np.ndarray, B, X_WA: np.ndarray, X_WB: np.ndarray) -> tuple:
    """(normal, pos, depth): how the facet by itself comes out of the solid after the shortest way, and where."""
    rows = engine.distance(engine.ConvexHull(triangle), B, X_WA, X_WB).rows
    pos = 0.5 * rows["point_a"][0] + 0.5 * rows["point_b"][0]
    return rows["normal"][0].copy(), pos, max(0.0, -rows["distance"].item())


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
