"""Contacts in python-fcl's form: (b1, b2, normal from o1 to o2, pos, penetration_depth)."""

from __future__ import annotations

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_requests import OBJECT_TYPE


def contact_rows(A, B, o1, o2, limit: int) -> list[tuple]:
    """The contact manifolds of two posed shapes that meet, the deepest first."""
    rows = engine.contacts(A, B, o1._X, o2._X, max_contacts=limit).rows
    if not len(rows):  # touching within rounding: no facets say where
        r = engine.distance(A, B, o1._X, o2._X)
        normal, pos = np.array(r.normal), 0.5 * (np.array(r.point_a) + np.array(r.point_b))
        return [(_number(o1, r.part_a), _number(o2, r.part_b), normal, pos, max(0.0, -float(r.distance)))]
    order = np.argsort(rows["distance"], kind="stable")[:limit]
    contacts = []
    for row in rows[order]:
        pos = 0.5 * row["point_a"] + 0.5 * row["point_b"]
        b1, b2 = (_number(o, row[f"facet_{s}"], row[f"part_{s}"]) for o, s in ((o1, "a"), (o2, "b")))
        contacts.append((b1, b2, row["normal"].copy(), pos, max(0.0, -float(row["distance"]))))
    return contacts


def _number(body, facet, part=None) -> int:
    """The facet of a mesh, the box of an octree; −1 of anything else."""
    kind = body._geometry._object_type
    if kind == OBJECT_TYPE.OT_GEOM:
        return -1
    return int(facet if kind == OBJECT_TYPE.OT_BVH or part is None else part)


def facet_contacts(A, B, X_WA, X_WB, limit: int, with_geometry: bool) -> list[tuple]:
    """One for each pair of facets that meet, found exactly.

    The normal of each is that along which the two triangles, as flat convex sets, come apart after the shortest way,
    which is its depth; pos is the middle of what they share. In doubles, good to rounding.
    """
    pairs = engine.facet_pairs(A, B, X_WA, X_WB, first=limit == 1).pairs[:limit]
    if not with_geometry:
        return [(int(i), int(j), np.zeros(3), np.zeros(3), 0.0) for i, j in pairs]
    corners_a = (A.vertices[A.faces[pairs[:, 0]]] @ X_WA[:3, :3].T) + X_WA[:3, 3]
    corners_b = (B.vertices[B.faces[pairs[:, 1]]] @ X_WB[:3, :3].T) + X_WB[:3, 3]
    normals, positions, depths = _triangles_apart(corners_a, corners_b)
    contacts = zip(pairs, normals, positions, depths)
    return [(int(i), int(j), normal, pos, depth) for (i, j), normal, pos, depth in contacts]


def _triangles_apart(corners_a: np.ndarray, corners_b: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """(normals (n, 3), positions (n, 3), depths) of pairs of triangles (n, 3, 3) that meet.

    The shortest way out of a Minkowski difference is along a normal of one of its faces: of a triangle, across two
    edges, or, of parallel triangles, in their plane across an edge.
    """
    edges_a, edges_b = np.roll(corners_a, -1, axis=1) - corners_a, np.roll(corners_b, -1, axis=1) - corners_b
    normal_a, normal_b = np.cross(edges_a[:, 0], edges_a[:, 1]), np.cross(edges_b[:, 0], edges_b[:, 1])
    across = np.cross(edges_a[:, :, None], edges_b[:, None]).reshape(-1, 9, 3)
    in_plane = [np.cross(normal[:, None], edges) for normal, edges in ((normal_a, edges_a), (normal_b, edges_b))]
    axes = np.concatenate([normal_a[:, None], normal_b[:, None], across, *in_plane], axis=1)
    lengths = np.linalg.norm(axes, axis=2)
    scale = np.abs(edges_a).max(axis=(1, 2)) * np.abs(edges_b).max(axis=(1, 2))
    short = lengths <= 1e-12 * np.maximum(scale, lengths.max(axis=1))[:, None]
    axes = axes / np.where(short, 1.0, lengths)[:, :, None]
    axes = np.concatenate([axes, -axes], axis=1)
    reach_a = np.einsum("nkc,nvc->nkv", axes, corners_a)
    reach_b = np.einsum("nkc,nvc->nkv", axes, corners_b)
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
    along = np.cross(normal_a, normal_b)
    with np.errstate(all="ignore"):
        ends = [
            _crossing(corners, plane_normal, plane_corners[:, 0], along)
            for corners, plane_normal, plane_corners in (
                (corners_a, normal_b, corners_b), (corners_b, normal_a, corners_a)
            )
        ]  # fmt: skip
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
    following = np.roll(height, -1, axis=1)
    t = np.where(height == following, 0.0, height / (height - following))
    crosses = (height * following <= 0.0) & ~((height == following) & (height != 0.0))
    points = corners + np.clip(t, 0.0, 1.0)[:, :, None] * (np.roll(corners, -1, axis=1) - corners)
    s = np.einsum("nvc,nc->nv", points, along)
    n = np.arange(len(s))
    first, last = np.where(crosses, s, np.inf).argmin(axis=1), np.where(crosses, s, -np.inf).argmax(axis=1)
    return s[n, first], s[n, last], points[n, first], points[n, last]
