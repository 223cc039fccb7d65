"""Contacts in python-fcl's form: o1, o2, b1, b2, normal from o1 to o2, pos, penetration_depth."""

from __future__ import annotations

import math

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_facets import facet_contact, facet_contacts, new_contact
from collide.adapters.hosts.fcl_geometry import CollisionObject
from collide.adapters.hosts.fcl_requests import NODE_TYPE, OBJECT_TYPE, Contact
from collide.adapters.hosts.nearest_points import nearest_points
from collide.errors import CollideError

_PLAIN, _MESH = OBJECT_TYPE.OT_GEOM, OBJECT_TYPE.OT_BVH
_CONVEX = NODE_TYPE.GEOM_CONVEX
FLAT = (NODE_TYPE.GEOM_PLANE, NODE_TYPE.GEOM_HALFSPACE)


def ordered(o1: CollisionObject, o2: CollisionObject) -> tuple[CollisionObject, CollisionObject]:
    """The pair as results name it: a mesh or an octree before a plain geometry."""
    swaps = o1._geometry._object_type == _PLAIN and o2._geometry._object_type != _PLAIN
    return (o2, o1) if swaps else (o1, o2)


def nearest_sides(o1: CollisionObject, o2: CollisionObject):
    """The shapes, of a plane that half-space out of which the way is shorter."""
    shapes_1, shapes_2 = o1._geometry._shapes, o2._geometry._shapes
    if len(shapes_1) == len(shapes_2) == 1:
        return shapes_1[0], shapes_2[0]
    pairs = [(A, B) for A in shapes_1 for B in shapes_2]
    return max(pairs, key=lambda pair: engine.distance(pair[0], pair[1], o1._X, o2._X).distance)


def contacts_of(o1: CollisionObject, o2: CollisionObject, limit: int, with_geometry: bool) -> list[Contact]:
    """Contacts of two objects that meet, in the order of `ordered`, the deepest first: at least one, at most ``limit``.

    with_geometry : whether normals, places and depths are wanted; else they are 0.
    """
    g1, g2 = o1._geometry, o2._geometry
    if limit == 1 and g1._object_type == g2._object_type == _PLAIN and g1._box is not None and g2._box is not None:
        return [_contact_of_solids(o1, o2, with_geometry)]
    if g1._object_type == g2._object_type == _MESH:
        return [facet_contact(o1, o2, with_geometry)] if limit == 1 else facet_contacts(o1, o2, limit, with_geometry)
    if not with_geometry:
        return [new_contact(g1, g2, -1, -1, np.zeros(3), np.zeros(3), 0.0)]
    if g1._node_type in FLAT and g2._node_type in FLAT:  # no translation takes them apart
        return [new_contact(g1, g2, -1, -1, np.zeros(3), np.zeros(3), math.inf)]
    if _is_one_facet(o1, o2, limit):
        return [facet_contact(o1, o2, True)]
    if _coincide(o1, o2) and (contact := _contact_along_x(o1, o2)) is not None:
        return [contact]
    A, B = nearest_sides(o1, o2)
    rows = engine.contacts(A, B, o1._X, o2._X, max_contacts=limit).rows
    if not len(rows):
        return [new_contact(g1, g2, *_touching(g1, g2, A, B, o1._X, o2._X))]
    rows = rows[np.argsort(rows["distance"], kind="stable")[:limit]]
    return _of_rows(rows, [(o1, o2)] * len(rows))


def _contact_of_solids(o1: CollisionObject, o2: CollisionObject, with_geometry: bool) -> Contact:
    """The one contact of two convex sets that have an end."""
    g1, g2, X_WA, X_WB = o1._geometry, o2._geometry, o1._X, o2._X
    if not with_geometry:
        return new_contact(g1, g2, -1, -1, np.zeros(3), np.zeros(3), 0.0)
    if g1._node_type == g2._node_type == _CONVEX and _coincide(o1, o2):
        contact = _contact_along_x(o1, o2)
        if contact is not None:
            return contact
    distance, normal, _, _, pos, _, _, _ = nearest_points(g1._shapes[0], g2._shapes[0], X_WA, X_WB)
    return new_contact(g1, g2, -1, -1, normal, pos, -distance if distance < 0.0 else 0.0)


def _coincide(o1: CollisionObject, o2: CollisionObject) -> bool:
    """Whether two hulls are one hull at one pose."""
    g1, g2 = o1._geometry, o2._geometry
    if not g1._node_type == g2._node_type == _CONVEX or o1._X.item(3) != o2._X.item(3):
        return False
    if not np.array_equal(o1._X, o2._X):
        return False
    return g1 is g2 or np.array_equal(g1._shapes[0].points, g2._shapes[0].points)


def _contact_along_x(o1: CollisionObject, o2: CollisionObject) -> Contact | None:
    """python-fcl's contact of two hulls in one place, where it is right: many ways out are as short as each other, and
    libccd goes along −x of the world, between the first vertices that reach as far. ``None`` where another is shorter.
    """
    hull, X = o1._geometry._shapes[0], o1._X
    corners = hull.points @ X[:3, :3].T + X[:3, 3]
    width = float(np.ptp(corners[:, 0]))
    depth = -float(engine.distance(hull, hull, X, X).distance)
    if width > depth * (1.0 + 1e-12):
        return None
    pos = 0.5 * (corners[corners[:, 0].argmin()] + corners[corners[:, 0].argmax()])
    return new_contact(o1._geometry, o2._geometry, -1, -1, np.array([-1.0, 0.0, 0.0]), pos, width)


def contacts_of_pairs(pairs: list, limit: int, with_geometry: bool) -> list[list[Contact]]:
    """The same of many pairs of objects that meet, pair by pair, those of two single shapes in one batch."""
    pairs = [ordered(o1, o2) for o1, o2 in pairs]
    if not with_geometry:
        return [contacts_of(o1, o2, limit, False) for o1, o2 in pairs]
    answers: list[list[Contact] | None] = [None] * len(pairs)
    plain = [
        k for k, (o1, o2) in enumerate(pairs)
        if _is_plain_question(o1, o2) and not _is_one_facet(o1, o2, limit) and not _coincide(o1, o2)
    ]
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


def _is_one_facet(o1: CollisionObject, o2: CollisionObject, limit: int) -> bool:
    """Whether one contact of a mesh with a solid is wanted: that of a facet, as python-fcl has it. Patches, of which
    `collide.contacts` tells, are worth their time where more is wanted.
    """
    g1, g2 = o1._geometry, o2._geometry
    return limit == 1 and g1._object_type == _MESH and g2._object_type == _PLAIN and g2._node_type not in FLAT


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
        contacts.append(new_contact(g1, g2, b1, b2, normal, pos, depth))
    return contacts


def _touching(g1, g2, A, B, X_WA: np.ndarray, X_WB: np.ndarray) -> tuple:
    """The fields `Contact._later` of bodies that touch within rounding, where no facets say where."""
    distance, normal, _, _, pos, part_a, part_b, _ = nearest_points(A, B, X_WA, X_WB)
    return _number(g1, part_a, part_a), _number(g2, part_b, part_b), normal, pos, max(0.0, -distance)


def _number(geometry, facet: int, part: int) -> int:
    """The facet of a mesh, the box of an octree; −1 of anything else."""
    kind = geometry._object_type
    return -1 if kind == _PLAIN else facet if kind == _MESH else part
