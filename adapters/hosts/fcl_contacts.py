"""Contacts in python-fcl's form: o1, o2, b1, b2, normal from o1 to o2, pos, penetration_depth."""

from __future__ import annotations

import math

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_geometry import CollisionObject
from collide.adapters.hosts.fcl_requests import NODE_TYPE, OBJECT_TYPE, Contact
from collide.errors import CollideError

_PLAIN, _MESH = OBJECT_TYPE.OT_GEOM, OBJECT_TYPE.OT_BVH
FLAT = (NODE_TYPE.GEOM_PLANE, NODE_TYPE.GEOM_HALFSPACE)


def ordered(o1: CollisionObject, o2: CollisionObject) -> tuple[CollisionObject, CollisionObject]:
    """The pair as results name it: a mesh or an octree before a plain geometry."""
    swaps = o1._geometry._object_type == _PLAIN and o2._geometry._object_type != _PLAIN
    return (o2, o1) if swaps else (o1, o2)


def nearest_sides(o1: CollisionObject, o2: CollisionObject):
    """The shapes, of a plane that half-space out of which the way is shorter."""
    pairs = [(A, B) for A in o1._geometry._shapes for B in o2._geometry._shapes]
    if len(pairs) == 1:
        return pairs[0]
    return max(pairs, key=lambda pair: engine.distance(pair[0], pair[1], o1._X, o2._X).distance)


def contacts_of(o1: CollisionObject, o2: CollisionObject, limit: int, with_geometry: bool) -> list[Contact]:
    """Contacts of two objects that meet, in the order of `ordered`, the deepest first: at least one, at most ``limit``.

    with_geometry : whether normals, places and depths are wanted; else they are 0.
    """
    g1, g2 = o1._geometry, o2._geometry
    if g1._object_type == g2._object_type == _MESH:
        results = facet_contacts(g1._shape, g2._shape, o1._X, o2._X, limit, with_geometry)
        return [_contact(g1, g2, *values) for values in results]
    if not with_geometry:
        return [_contact(g1, g2, -1, -1, np.zeros(3), np.zeros(3), 0.0)]
    if g1._node_type in FLAT and g2._node_type in FLAT:  # no translation takes them apart
        return [_contact(g1, g2, -1, -1, np.zeros(3), np.zeros(3), math.inf)]
    A, B = nearest_sides(o1, o2)
    rows = engine.contacts(A, B, o1._X, o2._X, max_contacts=limit).rows
    if not len(rows):
        return [_touching(A, B, o1, o2)]
    if len(rows) > 1:
        rows = rows[np.argsort(rows["distance"], kind="stable")[:limit]]
    return _of_rows(rows, [(o1, o2)] * len(rows))


def contacts_of_pairs(pairs: list, limit: int, with_geometry: bool) -> list[list[Contact]]:
    """The same of many pairs of objects that meet, pair by pair, those of two single shapes in one batch."""
    pairs = [ordered(o1, o2) for o1, o2 in pairs]
    if not with_geometry:
        return [contacts_of(o1, o2, limit, False) for o1, o2 in pairs]
    answers: list[list[Contact] | None] = [None] * len(pairs)
    plain = [k for k, pair in enumerate(pairs) if _is_plain_question(*pair)]
    if len(plain) > 1:
        for k, contacts in zip(plain, _batch([pairs[k] for k in plain], limit)):
            answers[k] = contacts
    return [
        contacts_of(o1, o2, limit, True) if contacts is None else contacts
        for (o1, o2), contacts in zip(pairs, answers)
    ]


def _is_plain_question(o1: CollisionObject, o2: CollisionObject) -> bool:
    g1, g2 = o1._geometry, o2._geometry
    if len(g1._shapes) != 1 or len(g2._shapes) != 1 or g1._object_type == g2._object_type == _MESH:
        return False
    return g1._node_type not in FLAT or g2._node_type not in FLAT


def _batch(pairs: list, limit: int) -> list[list[Contact] | None]:
    """Contacts pair by pair; None of pairs that are to be asked alone."""
    sides = [[pair[side] for pair in pairs] for side in (0, 1)]
    A, B = ([obj._geometry._shapes[0] for obj in side] for side in sides)
    X_WA, X_WB = (np.concatenate([obj._X for obj in side]).reshape(-1, 4, 4) for side in sides)
    try:
        results = engine.contacts(A, B, X_WA, X_WB, max_contacts=limit)
    except CollideError:  # told by the pair it is of
        return [None] * len(pairs)
    counts = np.diff(results.starts)
    owner = np.repeat(np.arange(len(pairs)), counts)
    order = np.lexsort((results.rows["distance"], owner))
    remaining = order[np.arange(len(order)) - np.repeat(results.starts[:-1], counts) < limit]
    contacts = _of_rows(results.rows[remaining], [pairs[k] for k in owner[remaining].tolist()])
    ends = np.cumsum(np.minimum(counts, limit)).tolist()
    return [contacts[begin:end] or None for begin, end in zip([0, *ends], ends)]


def _of_rows(rows: np.ndarray, pairs: list) -> list[Contact]:
    """A contact a row, of the pair of objects beside it."""
    normals, positions = list(rows["normal"].copy()), list(0.5 * rows["point_a"] + 0.5 * rows["point_b"])
    depths = np.maximum(-rows["distance"], 0.0).tolist()
    numbers = zip(*(rows[name].tolist() for name in ("facet_a", "part_a", "facet_b", "part_b")))
    contacts = []
    for (o1, o2), (facet_a, part_a, facet_b, part_b), normal, pos, depth in zip(
        pairs, numbers, normals, positions, depths
    ):
        g1, g2 = o1._geometry, o2._geometry
        b1, b2 = _number(g1, facet_a, part_a), _number(g2, facet_b, part_b)
        contacts.append(_contact(g1, g2, b1, b2, normal, pos, depth))
    return contacts


def _touching(A, B, o1: CollisionObject, o2: CollisionObject) -> Contact:
    """The contact of bodies that touch within rounding, where no facets say where."""
    r = engine.distance(A, B, o1._X, o2._X)
    normal, pos = np.array(r.normal), 0.5 * (np.array(r.point_a) + np.array(r.point_b))
    g1, g2 = o1._geometry, o2._geometry
    b1, b2 = _number(g1, int(r.part_a), int(r.part_a)), _number(g2, int(r.part_b), int(r.part_b))
    return _contact(g1, g2, b1, b2, normal, pos, max(0.0, -float(r.distance)))


def _number(geometry, facet: int, part: int) -> int:
    """The facet of a mesh, the box of an octree; −1 of anything else."""
    kind = geometry._object_type
    return -1 if kind == _PLAIN else facet if kind == _MESH else part


def _contact(g1, g2, b1, b2, normal, pos, depth) -> Contact:
    contact = Contact.__new__(Contact)
    contact.o1, contact.o2, contact.b1, contact.b2 = g1, g2, b1, b2
    contact.normal, contact.pos, contact.penetration_depth = normal, pos, depth
    return contact


def facet_contacts(A, B, X_WA, X_WB, limit: int, with_geometry: bool) -> list[tuple]:
    """One for each pair of facets that meet, which is decided exactly.

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
