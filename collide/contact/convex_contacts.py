"""Contacts of two convex sets: the faces that support the normal of their distance, clipped against each other.

The witness points of `distance` are one contact. Where both bodies have a face across its normal, or nearly, the
corners of the polygon in which these faces overlap, seen along the normal, are the others.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from collide.batches import answer_batch
from collide.contact.contact_facets import Pairs, Side, lengths_of, normals_of, rotated
from collide.contact.contact_points import Points, across, points_along
from collide.contact.contact_rows import GAP, OVERLAP, PatchContacts, flipped_contacts, no_rows, rows_of
from collide.contact.reduce_manifold import reduce_manifold
from collide.errors import UnsupportedQuery
from collide.hull.exact_hull import convex_hull
from collide.lowering.facet_bodies import body_of, hull_of
from collide.lowering.packed_convex import CONE, CYLINDER, HALFSPACE, POINTS, PackedConvex
from collide.lowering.parts import convex_set_of
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.facets.facet_queries import NearPairs
from collide.shapes.shape import Shape

#: A face counts as across the normal down to this cosine.
_ACROSS = 0.7
#: Heights that differ by less than this share of the size are equal; so are directions.
_EQUAL = 2.0**-30
#: Corners of the polygon within a circle of a cylinder's end or a cone's base.
_ROUND = 8
_U = 2.0**-53
_ERRORS = 64.0


def convex_contacts(A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int) -> np.ndarray:
    """Rows for two shapes that are one convex set each, at single poses (4, 4). Raises UnsupportedQuery."""
    packed_a, packed_b = convex_set_of(A), convex_set_of(B)
    if HALFSPACE in (packed_a.kind, packed_b.kind) and packed_a.kind != packed_b.kind:
        if packed_a.kind == HALFSPACE:
            return against_plane(A, B, X_WA, X_WB, margin, max_contacts)
        return flipped_contacts(against_plane(B, A, X_WB, X_WA, margin, max_contacts))
    if (packed_b.content, X_WB[:3].tolist()) < (packed_a.content, X_WA[:3].tolist()):
        return flipped_contacts(_ordered(B, A, packed_b, packed_a, X_WB, X_WA, margin, max_contacts))
    return _ordered(A, B, packed_a, packed_b, X_WA, X_WB, margin, max_contacts)


def _ordered(
    A: Shape, B: Shape, packed_a: PackedConvex, packed_b: PackedConvex, X_WA, X_WB, margin: float, max_contacts: int
) -> np.ndarray:
    row = _answer(A, B, X_WA, X_WB, margin)
    if row is None:
        return no_rows()
    n = row["normal"].copy()
    error = _error(packed_a, X_WA, packed_b, X_WB)
    origin = X_WA[:3, 3]
    radius = packed_a.radius + packed_b.radius
    a = _support(packed_a, X_WA[:3, :3], np.zeros(3), n, error)
    b = _support(packed_b, X_WB[:3, :3], X_WB[:3, 3] - origin, -n, error)
    points = _nearest(row, packed_a, packed_b, n, origin)
    facets = np.array([[-1, -1]])
    if len(a[0]) and len(b[0]):
        pairs = _product(a, b)
        overlap_corners = points_along(pairs, n, True, True, error)
        gap = overlap_corners.gap - radius
        is_near = (gap <= margin + overlap_corners.error) & (gap >= row["lower"] - _ERRORS * error)
        overlap_corners = overlap_corners.take(is_near)
        points, facets = _with_nearest(points, overlap_corners, facets, pairs.near.facets[overlap_corners.pair], error)
    flat = (across(n)[None] * points.b[:, None]).sum(axis=2)
    size = float((flat.max(axis=0) - flat.min(axis=0)).max())
    selected = reduce_manifold(flat, points.gap, points.error, max_contacts, max(_ERRORS * error, _EQUAL * size))
    points, facets = points.take(selected), facets[selected]
    distance = points.gap - radius
    middle = 0.5 * (points.a + points.b) + 0.5 * (packed_a.radius - packed_b.radius) * n + origin
    half = 0.5 * distance[:, None] * n
    bound = points.error + 8.0 * error + packed_a.slop + packed_b.slop
    return rows_of([PatchContacts(n, middle - half, middle + half, distance, bound, facets, _kind(row), _apart(row))])


def against_plane(A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int) -> np.ndarray:
    """Rows for a half-space A and anything but one: corners of B within the margin of the plane, or below it."""
    body = hull_of(body_of(B)) if B.meshed else B
    packed = convex_set_of(body)
    row = _answer(A, body, X_WA, X_WB, margin)
    if row is None:
        return no_rows()
    n = row["normal"].copy()
    origin = row["point_a"]
    error = _error(convex_set_of(A), X_WA, packed, X_WB) + 8.0 * _U * float(np.abs(origin).max())
    shift = X_WB[:3, 3] - origin
    facets = np.array([[-1, -1]])
    points = _nearest(row, convex_set_of(A), packed, n, origin)
    if packed.kind == POINTS:
        corners, numbers = _corners_of(B, packed)
        low = rotated(X_WB[:3, :3], corners) + shift
    else:
        triangles, _ = _support(packed, X_WB[:3, :3], shift, -n, error)
        low = triangles.reshape(-1, 3)
        numbers = np.full(len(low), -1)
    gap = (low * n).sum(axis=1)
    near = gap - packed.radius <= margin + 32.0 * error
    low, gap = low[near], gap[near]
    slack = float(row["upper"] - row["lower"]) + 32.0 * error
    corners_of_faces = Points(np.arange(len(gap)), low - gap[:, None] * n, low, gap, np.full(len(gap), slack))
    corner_facets = np.stack([np.full(len(gap), -1), numbers[near]], axis=1)
    points, facets = _with_nearest(points, corners_of_faces, facets, corner_facets, error)
    flat = (across(n)[None] * points.b[:, None]).sum(axis=2)
    size = float((flat.max(axis=0) - flat.min(axis=0)).max())
    selected = reduce_manifold(flat, points.gap, points.error, max_contacts, max(_ERRORS * error, _EQUAL * size))
    points, facets = points.take(selected), facets[selected]
    distance = points.gap - packed.radius
    middle = 0.5 * (points.a + points.b) - 0.5 * packed.radius * n + origin
    half = 0.5 * distance[:, None] * n
    bound = points.error + 8.0 * error + packed.slop
    return rows_of([PatchContacts(n, middle - half, middle + half, distance, bound, facets, _kind(row), _apart(row))])


def _with_nearest(
    nearest: Points, corners_of_faces: Points, facets: np.ndarray, others: np.ndarray, error: float
) -> tuple[Points, np.ndarray]:
    """The corners of faces; and the nearest points, with their facets, where no corner is as near."""
    known = nearest.gap[0] + nearest.error[0] + _ERRORS * error
    if len(corners_of_faces.gap) and (corners_of_faces.gap - corners_of_faces.error).min() <= known:
        return corners_of_faces, others
    return Points(*(np.concatenate(both) for both in zip(nearest, corners_of_faces))), np.concatenate([facets, others])


def _answer(A: Shape, B: Shape, X_WA, X_WB, margin: float):
    """The row of `distance`, None where it is proven that they are farther apart than the margin."""
    row = answer_batch(A, B, X_WA[None], X_WB[None], Question(False, margin))[0]
    if np.isneginf(row["distance"]):
        raise UnsupportedQuery(
            f"contacts of {type(A).__name__} and {type(B).__name__}: their overlap has no end, so no normal tells the "
            "way out; collide() still answers"
        )
    if row["beyond"] or row["lower"] > margin:
        return None
    return row


def _kind(row) -> int:
    return OVERLAP if row["hit"] else GAP


def _apart(row) -> float:
    return max(0.0, -float(row["lower"])) if row["hit"] else 0.0


def _nearest(row, packed_a: PackedConvex, packed_b: PackedConvex, n, origin) -> Points:
    """The points of `distance`, moved back to the cores."""
    gap = np.array([float(row["distance"]) + packed_a.radius + packed_b.radius])
    a = (row["point_a"] - packed_a.radius * n - origin)[None]
    bracket = max(row["upper"] - row["distance"], row["distance"] - row["lower"])
    return Points(np.array([-1]), a, a + gap[:, None] * n, gap, np.array([float(bracket)]))


def _error(packed_a: PackedConvex, X_WA, packed_b: PackedConvex, X_WB) -> float:
    """Bound of the error of a coordinate seen from A's origin."""
    both = packed_a, packed_b
    reach = sum(4.0 * (p.reach + p.radius) + float(np.abs(X[:3, 3]).max()) for p, X in zip(both, (X_WA, X_WB)))
    if HALFSPACE in (packed_a.kind, packed_b.kind):
        planes = (p.params for p in both if p.kind == HALFSPACE)
        reach += sum(abs(float(plane[3])) / max(1e-300, float(lengths_of(plane[:3]))) for plane in planes)
    return 8.0 * _U * reach


def _product(a, b) -> Pairs:
    """Every facet of one with every facet of the other."""
    (corners_a, ids_a), (corners_b, ids_b) = a, b
    i, j = np.repeat(np.arange(len(ids_a)), len(ids_b)), np.tile(np.arange(len(ids_b)), len(ids_a))
    sides = [
        Side(ids[k], corners[k], normals_of(corners)[k], np.zeros((len(k), 3), dtype=np.int64))
        for corners, ids, k in ((corners_a, ids_a, i), (corners_b, ids_b, j))
    ]
    zeros, points = np.zeros(len(i)), np.zeros((len(i), 3))
    near = NearPairs(np.stack([ids_a[i], ids_b[j]], axis=1), zeros > 0.0, zeros, zeros, points, points)
    return Pairs(near, *sides)


def _support(packed: PackedConvex, R, shift, n, error: float) -> tuple[np.ndarray, np.ndarray]:
    """(triangles (k, 3, 3), their numbers) of the face across n that supports n, or of an edge as one without area.

    Of curved faces a polygon within them; none where the body has but a point there.
    """
    if packed.kind == POINTS:
        corners, ids = _hull_support(packed, rotated(R, packed.points) + shift, n, error)
    else:
        local = (R * n[:, None]).sum(axis=0)
        points = _round_support(packed, local / lengths_of(local))
        corners = np.array([[points[0], points[k], points[k + 1]] for k in range(1, len(points) - 1)]).reshape(-1, 3, 3)
        if len(points) == 2:
            corners = points[[0, 1, 1]][None]
        corners = rotated(R, corners) + shift
        ids = np.full(len(corners), -1)
    return corners, ids


def _hull_support(packed: PackedConvex, points: np.ndarray, n, error: float) -> tuple[np.ndarray, np.ndarray]:
    facets = _facets(packed.content, packed)
    heights = (points * n).sum(axis=1)
    size = float(np.abs(points - points[0]).max())
    slack = _ERRORS * error + _EQUAL * size
    top = heights >= heights.max() - slack
    corners = points[facets]
    normals = normals_of(corners)
    cosines = np.where(top[facets].any(axis=1), (normals * n).sum(axis=1), -1.0)
    if len(facets) and cosines.max() >= _ACROSS:
        best = int(np.argmax(cosines))
        off = np.abs(((corners - corners[best, 0]) * normals[best]).sum(axis=2)).max(axis=1)
        ids = np.flatnonzero((off <= slack) & ((normals * normals[best]).sum(axis=1) > 0.5))
        return corners[ids], ids
    some = points[top]
    far = some[int(np.argmax(lengths_of(some - some[0])))]
    if lengths_of(far - some[0]) <= slack:
        return np.stack([some[0]] * 3)[None], np.array([-1])
    return np.stack([some[0], far, far])[None], np.array([-1])


_hull_facets: dict[bytes, np.ndarray] = {}
_MAX_HULLS = 512


def _facets(content: bytes, packed: PackedConvex) -> np.ndarray:
    """(f, 3) facets of the hull of the points, of flat ones from both sides; kept for shapes asked about lately."""
    if content not in _hull_facets:
        while len(_hull_facets) >= _MAX_HULLS:
            _hull_facets.pop(next(iter(_hull_facets)), None)
        _hull_facets[content] = convex_hull(packed.points).facets
    return _hull_facets[content]


def _corners_of(shape: Shape, packed: PackedConvex) -> tuple[np.ndarray, np.ndarray]:
    """(points, a facet that each belongs to); of meshes those in use."""
    if shape.meshed:
        faces = shape.faces  # type: ignore[attr-defined]
        used, first = np.unique(faces, return_index=True)
        return shape.vertices[used], first // 3  # type: ignore[attr-defined]
    facets = _facets(packed.content, packed)
    if not len(facets):
        return packed.points, np.full(len(packed.points), -1)
    used, first = np.unique(facets, return_index=True)
    return packed.points[used], first // 3


def _round_support(packed: PackedConvex, n: np.ndarray) -> np.ndarray:
    """Points of a curved body's face or line that supports the unit vector n, in its own frame; none of an
    ellipsoid.
    """
    aside = math.hypot(n[0], n[1])
    x, y = (n[0] / aside, n[1] / aside) if aside > _EQUAL else (1.0, 0.0)
    radius, half = float(packed.params[0]), float(packed.params[1])
    if packed.kind == CYLINDER:
        if abs(n[2]) >= _ACROSS:
            return _disc(x, y, radius, math.copysign(half, n[2]))
        return np.array([[x * radius, y * radius, -half], [x * radius, y * radius, half]])
    if packed.kind == CONE:
        if -n[2] >= _ACROSS:
            return _disc(x, y, radius, -half)
        return np.array([[0.0, 0.0, half], [x * radius, y * radius, -half]])
    return np.zeros((0, 3))


@lru_cache(maxsize=2)
def _circle(n: int) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(n) / n
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _disc(x: float, y: float, radius: float, z: float) -> np.ndarray:
    """Corners of a regular polygon within a disc, its first towards (x, y); anticlockwise seen from outside."""
    c, s = _circle(_ROUND).T
    points = np.stack([radius * (x * c - y * s), radius * (y * c + x * s), np.full(_ROUND, z)], axis=1)
    return points if z > 0.0 else points[::-1]
