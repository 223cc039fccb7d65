"""coal's `collide` and `distance`, and the callables that keep two geometries, answered by collide.

As there: normals point from the first geometry to the second, ``penetration_depth`` and ``min_distance`` are below 0
where bodies overlap, results of `collide` collect over calls, and one contact is all that two shapes without facets
have; `computeContactPatch` has the rest.
"""

from __future__ import annotations

import math

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_enums import OBJECT_TYPE
from collide.adapters.hosts.coal_geometry import CollisionGeometry, CollisionObject, checked_geometry, pose_of
from collide.adapters.hosts.coal_nearest import Nearest, nearest
from collide.adapters.hosts.coal_requests import Contact
from collide.adapters.hosts.fcl_facets import contacts_of_facets
from collide.adapters.hosts.host_numbers import real, whole
from collide.errors import InvalidArgument

#: How many contacts of two meshes are looked at where those are wanted that are deeper than something.
_ALL = 1 << 30


def collide(*args):
    """Whether two geometries come within the security margin, and their contacts.

    Parameters
    ----------
    args : ``(o1, o2, request, result)`` with two `CollisionObject`, or ``(g1, tf1, g2, tf2, request, result)`` with
        geometries and `Transform3s`.
        ``request`` : CollisionRequest.   ``result`` : CollisionResult, takes the contacts.

    Returns
    -------
    int
        How many contacts the result now has: at most ``num_max_contacts``.

    Raises
    ------
    InvalidArgument, a ValueError
        For ``num_max_contacts`` below 1, margins that are no numbers, models without triangles.
    TypeError
        For arguments of other types.
    """
    g1, X1, g2, X2, request, result = asked("collide", args, 2)
    return collide_posed(g1, X1, g2, X2, request, result)


def collide_posed(g1, X1, g2, X2, request, result) -> int:
    """The same of geometries at poses (4, 4)."""
    limit = whole("num_max_contacts", request.num_max_contacts)
    margin = real("security_margin", request.security_margin)
    if limit < 1:
        raise InvalidArgument(f"num_max_contacts must be at least 1, got {request.num_max_contacts}")
    if not math.isfinite(margin):
        raise InvalidArgument(f"security_margin must be finite [m], got {margin}")
    n_wanted = limit - result.numContacts()
    if n_wanted < 1:
        return result.numContacts()
    has_parts = g1._has_parts or g2._has_parts
    are_meshes = g1._object_type == g2._object_type == OBJECT_TYPE.OT_BVH
    is_deep = margin < 0.0 and not are_meshes
    is_signed = is_deep or bool(request.enable_contact and not has_parts)
    least = max(margin, 0.0) if are_meshes else margin
    answer = nearest(g1, X1, g2, X2, least, request.distance_upper_bound, is_signed)
    lower = float(answer.lower)
    rows: list[tuple] = []
    if answer.is_within and are_meshes and answer.distance <= 0.0:
        with_geometry = bool(request.enable_contact) or margin < 0.0
        rows, lower = _facet_rows(g1, X1, g2, X2, margin, n_wanted, with_geometry)
        if not rows and margin < 0.0:
            answer = answer._replace(is_within=False)
    elif answer.is_within and has_parts and request.enable_contact and (n_wanted > 1 or answer.distance <= 0.0):
        rows = _rows(g1, X1, g2, X2, answer, margin, n_wanted)
        lower = min([lower, *(row[5] for row in rows)])
    result.distance_lower_bound = min(result.distance_lower_bound, lower - margin)
    if not answer.is_within:
        return result.numContacts()
    if not rows:
        rows = [(answer.part_1, answer.part_2, answer.normal, answer.point_1, answer.point_2, answer.distance)]
    for b1, b2, normal, point_1, point_2, depth in rows:
        part_1 = b1 if answer.facets_1 is None or b1 < 0 else answer.facets_1[b1]
        part_2 = b2 if answer.facets_2 is None or b2 < 0 else answer.facets_2[b2]
        result.addContact(contact_of(g1, g2, part_1, part_2, normal, point_1, point_2, depth))
    return result.numContacts()


def contact_of(g1, g2, b1, b2, normal, point_1, point_2, depth) -> Contact:
    """A contact of surfaces' points (3,), signed ``depth`` [m] apart along the normal (3,)."""
    contact = object.__new__(Contact)  # the constructor's defaults would be thrown away
    contact.o1, contact.o2, contact.b1, contact.b2 = g1, g2, int(b1), int(b2)
    contact.normal, contact.penetration_depth = np.array(normal), float(depth)
    contact.nearest_points = [np.array(point_1), np.array(point_2)]
    contact.pos = 0.5 * contact.nearest_points[0] + 0.5 * contact.nearest_points[1]
    return contact


def _facet_rows(
    g1, X1, g2, X2, margin: float, n_wanted: int, with_geometry: bool
) -> tuple[list[tuple], float]:
    """One for each pair of facets of two meshes that meet, deep enough where the margin is below 0; and minus the
    greatest depth among those looked at [m].
    """
    pairs = contacts_of_facets(g1._shape, g2._shape, X1, X2, _ALL if margin < 0.0 else n_wanted, with_geometry)
    deepest = max((float(depth) for *_, depth in pairs), default=0.0)
    rows = []
    for b1, b2, normal, pos, depth in [pair for pair in pairs if margin >= 0.0 or -pair[4] <= margin][:n_wanted]:
        half = 0.5 * depth * normal
        rows.append((b1, b2, normal, pos + half, pos - half, -depth))
    return rows, -deepest


def _rows(g1, X1, g2, X2, answer: Nearest, margin: float, limit: int) -> list[tuple]:
    """The contact manifold of the shapes that decided, the deepest first."""
    swept_1, swept_2 = g1._radius_swept, g2._radius_swept
    reach = max(0.0, margin + swept_1 + swept_2)
    rows = engine.contacts(*answer.shapes, X1, X2, margin=reach, max_contacts=limit).rows
    rows = rows[rows["distance"] <= margin + swept_1 + swept_2]
    contacts = []
    for row in rows[np.argsort(rows["distance"], kind="stable")[:limit]]:
        normal = row["normal"]
        b1, b2 = (_part(g, row["facet_" + side], row["part_" + side]) for g, side in ((g1, "a"), (g2, "b")))
        points = row["point_a"] + swept_1 * normal, row["point_b"] - swept_2 * normal
        contacts.append((b1, b2, normal, *points, row["distance"] - swept_1 - swept_2))
    return contacts


def _part(g: CollisionGeometry, facet, part) -> int:
    """The facet of a mesh or a field, the box of an octree; −1 of anything else."""
    if not g._has_parts:
        return -1
    return int(part if g._object_type == OBJECT_TYPE.OT_OCTREE else facet)


def distance(*args):
    """The signed distance of two geometries.

    Parameters
    ----------
    args : ``(o1, o2, request, result)`` with two `CollisionObject`, or ``(g1, tf1, g2, tf2, request, result)`` with
        geometries and `Transform3s`.
        ``request`` : DistanceRequest.   ``result`` : DistanceResult, takes this pair in place of what it held.

    Returns
    -------
    float
        [m]. Of bodies that overlap minus their depth, 0 without ``enable_signed_distance``; 0 of two meshes, which have
        no inside; −1.8e308 of planes and half-spaces that no translation takes apart.

    Raises
    ------
    InvalidArgument, a ValueError
        For models without triangles.
    TypeError
        For arguments of other types.
    """
    g1, X1, g2, X2, request, result = asked("distance", args, 2)
    return distance_posed(g1, X1, g2, X2, request, result)


def distance_posed(g1, X1, g2, X2, request, result) -> float:
    """The same of geometries at poses (4, 4)."""
    are_meshes = g1._object_type == g2._object_type == OBJECT_TYPE.OT_BVH
    is_signed = bool(request.enable_signed_distance) and not are_meshes
    answer = nearest(g1, X1, g2, X2, 0.0, math.inf, is_signed)
    result.min_distance, result.normal = answer.distance, np.array(answer.normal)
    result.nearest_points = [np.array(answer.point_1), np.array(answer.point_2)]
    result.o1, result.o2 = g1, g2
    b1, b2 = answer.part_1, answer.part_2
    result.b1 = int(b1 if answer.facets_1 is None or b1 < 0 else answer.facets_1[b1])
    result.b2 = int(b2 if answer.facets_2 is None or b2 < 0 else answer.facets_2[b2])
    return result.min_distance


class _OfTwo:
    """Two geometries that are asked again and again."""

    def __init__(self, o1, o2):
        self._o1, self._o2 = checked_geometry("o1", o1), checked_geometry("o2", o2)


class ComputeCollision(_OfTwo):
    """`collide` of two geometries: called with ``(tf1, tf2, request, result)``."""

    def __call__(self, tf1, tf2, request, result):
        return collide_posed(self._o1, pose_of("tf1", tf1), self._o2, pose_of("tf2", tf2), request, result)


class ComputeDistance(_OfTwo):
    """`distance` of two geometries: called with ``(tf1, tf2, request, result)``."""

    def __call__(self, tf1, tf2, request, result):
        return distance_posed(self._o1, pose_of("tf1", tf1), self._o2, pose_of("tf2", tf2), request, result)


def asked(name: str, args: tuple, n_more: int) -> tuple:
    """(g1, X1, g2, X2, …) of both forms of a query's arguments. Raises TypeError."""
    if len(args) == 2 + n_more and isinstance(args[0], CollisionObject) and isinstance(args[1], CollisionObject):
        o1, o2 = args[:2]
        return (o1._geometry, o1._X, o2._geometry, o2._X, *args[2:])
    if len(args) == 4 + n_more:
        g1, tf1, g2, tf2 = args[:4]
        return (
            checked_geometry("o1", g1), pose_of("tf1", tf1), checked_geometry("o2", g2), pose_of("tf2", tf2), *args[4:],
        )
    raise TypeError(
        f"{name} takes two CollisionObjects, or (geometry, transform, geometry, transform), and {n_more} more arguments"
    )
