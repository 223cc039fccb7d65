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
from collide.adapters.hosts.coal_nearest import GeometryPair, Nearest, nearest
from collide.adapters.hosts.coal_requests import Contact
from collide.adapters.hosts.coal_transform import Transform3s
from collide.adapters.hosts.facet_contacts import FacetContact, contacts_of_facets, deciding_contact
from collide.adapters.hosts.host_numbers import real, whole
from collide.adapters.hosts.nearest_points import nearest_points
from collide.errors import InvalidArgument
from collide.pairs.query import collide as hits

#: How many contacts of two meshes are looked at where those are wanted that are deeper than something.
_ALL = 1 << 30
_POSE = 4, 4
#: Where `nearest_points` says whether bodies meet.
_HIT = 7
#: How many pairs' bounds of the distance wait in a result at most, until they are worked out.
_MAX_BOUNDS = 1024


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
    return collide_posed(*asked("collide", args, 2))


def collide_posed(g1, X1, g2, X2, request, result) -> int:
    """The same of geometries at poses (4, 4).

    Of two sets that are a shape each, the boolean is decided, and the rest is worked out when it is read.
    """
    limit, margin = request.num_max_contacts, request.security_margin
    if limit.__class__ is not int or limit < 1 or margin.__class__ is not float or not -math.inf < margin < math.inf:
        limit, margin = checked_request(request)
    contacts = result._contacts
    n_wanted = limit - len(contacts)
    if n_wanted < 1:
        return len(contacts)
    shapes_1, shapes_2 = g1._shapes, g2._shapes
    if (
        margin < 0.0 or len(shapes_1) != 1 or len(shapes_2) != 1 or (g1._box is None and g2._box is None)
        or (n_wanted > 1 and (g1._has_parts or g2._has_parts))
    ):
        pair = GeometryPair.now(g1, X1, g2, X2)
        rows, bound = contact_rows(pair, request.enable_contact, margin, request.distance_upper_bound, n_wanted)
        for row in rows:
            contacts.append(contact_of(g1, g2, *row))
        result.distance_lower_bound = min(result.distance_lower_bound, bound)
        return len(contacts)
    radius_1, radius_2 = g1._radius_swept, g2._radius_swept
    reach = margin + radius_1 + radius_2
    A, B = shapes_1[0], shapes_2[0]
    is_within = hits(A, B, X1, X2, security_margin=reach) if reach else hits(A, B, X1, X2)
    # Programs change poses in place, and shapes are never changed. Bytes are made in half the time of an array.
    asked_pair = g1, X1.tobytes(), g2, X2.tobytes(), shapes_1, shapes_2, radius_1, radius_2
    question = asked_pair, request.enable_contact, margin, request.distance_upper_bound
    if is_within:
        contact = object.__new__(Contact)  # the constructor's defaults would be thrown away
        contact.__dict__ = {"o1": g1, "o2": g2, "_work": (_only_contact, question)}
        contacts.append(contact)
    bounds = result._bounds_to_come
    bounds.append((_bound, question))
    if len(bounds) > _MAX_BOUNDS:
        result.distance_lower_bound  # noqa: B018 - works them out
    return len(contacts)


def checked_request(request) -> tuple[int, float]:
    """The number of contacts and the margin [m]. Raises InvalidArgument, TypeError."""
    limit = whole("num_max_contacts", request.num_max_contacts)
    margin = real("security_margin", request.security_margin)
    if limit < 1:
        raise InvalidArgument(f"num_max_contacts must be at least 1, got {request.num_max_contacts}")
    if not -math.inf < margin < math.inf:
        raise InvalidArgument(f"security_margin must be finite [m], got {margin}")
    return limit, margin


def _only_contact(asked_pair: tuple, enable_contact, margin: float, upper_bound: float) -> tuple:
    """The fields `Contact._later` of two shapes within the margin."""
    g1, X1, g2, X2, (A, *_), (B, *_), radius_1, radius_2 = asked_pair
    X1, X2 = np.ndarray(_POSE, buffer=X1), np.ndarray(_POSE, buffer=X2)
    if enable_contact and not (g1._has_parts or g2._has_parts or radius_1 or radius_2):
        distance, normal, point_1, point_2, middle, _, _, _ = nearest_points(A, B, X1, X2)
        return -1, -1, normal, distance, [point_1, point_2], middle
    pair = GeometryPair(g1, X1, g2, X2, *asked_pair[4:])
    by_facets = _is_facet_by_facet(pair)
    if enable_contact and (by_facets or not (g1._has_parts or g2._has_parts)):
        return _nearest_fields(pair, True, by_facets)
    ((b1, b2, normal, point_1, point_2, depth),) = contact_rows(pair, enable_contact, margin, upper_bound, 1)[0]
    return contact_fields(b1, b2, normal, point_1, point_2, depth)


def _nearest_fields(pair: GeometryPair, is_signed: bool, by_facets: bool) -> tuple:
    """The same of two single shapes, however far apart.

    is_signed : whether the depth of bodies that overlap is wanted; else the distance is 0.   by_facets : as of
    `_is_facet_by_facet`; the depth is then that of the facets that decide.
    """
    answer = nearest_points(pair.shapes_1[0], pair.shapes_2[0], pair.X1, pair.X2, is_signed and not by_facets)
    if is_signed and by_facets and answer[_HIT]:
        b1, b2, normal, point_1, point_2, middle, distance = _deciding_contact(pair, answer)
        return b1, b2, normal, distance, [point_1, point_2], middle
    distance, normal, point_1, point_2, middle, part_1, part_2, is_hit = answer
    r1, r2 = pair.radius_1, pair.radius_2
    if r1 or r2:
        point_1, point_2 = point_1 + r1 * normal, point_2 - r2 * normal
        middle = 0.5 * point_1 + 0.5 * point_2
        if is_signed or not is_hit:
            distance -= r1 + r2
    b1, b2 = part_1 if pair.g1._has_parts else -1, part_2 if pair.g2._has_parts else -1
    return b1, b2, normal, distance, [point_1, point_2], middle


def _bound(asked_pair: tuple, enable_contact, margin: float, upper_bound: float) -> float:
    """What the distance less the margin is at least [m]."""
    g1, X1, g2, X2, *rest = asked_pair
    pair = GeometryPair(g1, np.ndarray(_POSE, buffer=X1), g2, np.ndarray(_POSE, buffer=X2), *rest)
    return contact_rows(pair, enable_contact, margin, upper_bound, 1)[1]


def contact_rows(
    pair: GeometryPair, enable_contact, margin: float, upper_bound: float, n_wanted: int
) -> tuple[list[tuple], float]:
    """Contacts, as arguments of `contact_of`, and what the distance less the margin is at least [m]."""
    g1, g2 = pair.g1, pair.g2
    has_parts = g1._has_parts or g2._has_parts
    are_meshes = g1._object_type == g2._object_type == OBJECT_TYPE.OT_BVH
    is_deep = margin < 0.0 and not are_meshes
    is_signed = is_deep or bool(enable_contact and not has_parts)
    least = max(margin, 0.0) if are_meshes else margin
    answer = nearest(pair, least, upper_bound, is_signed)
    lower = float(answer.lower)
    rows: list[tuple] = []
    is_within = answer.is_within
    if is_within and n_wanted == 1 and answer.distance <= 0.0 <= margin and _is_facet_by_facet(pair):
        if enable_contact:
            answer_of_facets = nearest_points(pair.shapes_1[0], pair.shapes_2[0], pair.X1, pair.X2, False)
            b1, b2, normal, point_1, point_2, _, lower = _deciding_contact(pair, answer_of_facets)
            rows = [(b1, b2, normal, point_1, point_2, lower)]
    elif is_within and are_meshes and answer.distance <= 0.0:
        rows, lower = _facet_rows(pair, margin, n_wanted, bool(enable_contact) or margin < 0.0)
        is_within = bool(rows) or margin >= 0.0
    elif is_within and has_parts and enable_contact and (n_wanted > 1 or answer.distance <= 0.0):
        rows = _rows(pair, answer, margin, n_wanted)
        lower = min([lower, *(row[5] for row in rows)])
    if is_within and not rows:
        rows = [(answer.part_1, answer.part_2, answer.normal, answer.point_1, answer.point_2, answer.distance)]
    facets_1, facets_2 = answer.facets_1, answer.facets_2
    rows = [(_of_whole(facets_1, b1), _of_whole(facets_2, b2), *rest) for b1, b2, *rest in rows]
    return rows, lower - margin


def _of_whole(facets, b: int) -> int:
    """Facet ``b`` of a piece, numbered as in the whole: ``facets`` (n,), or None for the same numbers."""
    return int(b if facets is None or b < 0 else facets[b])


def contact_of(g1, g2, b1, b2, normal, point_1, point_2, depth) -> Contact:
    """A contact of surfaces' points (3,), signed ``depth`` [m] apart along the normal (3,)."""
    contact = object.__new__(Contact)
    contact.o1, contact.o2 = g1, g2
    contact.__dict__.update(zip(Contact._later, contact_fields(b1, b2, normal, point_1, point_2, depth)))
    return contact


def contact_fields(b1, b2, normal, point_1, point_2, depth) -> tuple:
    """The same in the order of `Contact._later`."""
    points = [np.array(point_1), np.array(point_2)]
    return int(b1), int(b2), np.array(normal), float(depth), points, 0.5 * points[0] + 0.5 * points[1]


def _facet_rows(pair: GeometryPair, margin: float, n_wanted: int, with_geometry: bool) -> tuple[list[tuple], float]:
    """One for each pair of facets of two meshes that meet, deep enough where the margin is below 0; and minus the
    greatest depth among those looked at [m].
    """
    A, B, n_asked = pair.shapes_1[0], pair.shapes_2[0], _ALL if margin < 0.0 else n_wanted
    pairs = contacts_of_facets(A, B, pair.X1, pair.X2, n_asked, with_geometry)
    deepest = max((float(depth) for *_, depth in pairs), default=0.0)
    rows = []
    for b1, b2, normal, pos, depth in [pair for pair in pairs if margin >= 0.0 or -pair[4] <= margin][:n_wanted]:
        half = 0.5 * depth * normal
        rows.append((b1, b2, normal, pos + half, pos - half, -depth))
    return rows, -deepest


def _is_facet_by_facet(pair: GeometryPair) -> bool:
    """Whether a mesh is asked with a mesh or a solid that has an end: one contact is then of the facets that decide."""
    g1, g2 = pair.g1, pair.g2
    kinds = {g1._object_type, g2._object_type}
    is_asked = OBJECT_TYPE.OT_BVH in kinds and kinds <= {OBJECT_TYPE.OT_BVH, OBJECT_TYPE.OT_GEOM}
    return is_asked and g1._box is not None and g2._box is not None and pair.is_of_two_shapes()


def _deciding_contact(pair: GeometryPair, answer: tuple) -> FacetContact:
    """Of bodies whose facets meet; the balls swept over solids added to the depth.   answer : of `nearest_points`."""
    contact = deciding_contact(pair.shapes_1[0], pair.shapes_2[0], pair.X1, pair.X2, answer)
    r1, r2, normal = pair.radius_1, pair.radius_2, contact.normal
    if not (r1 or r2):
        return contact
    point_a, point_b = contact.point_a + r1 * normal, contact.point_b - r2 * normal
    middle = 0.5 * point_a + 0.5 * point_b
    return contact._replace(point_a=point_a, point_b=point_b, middle=middle, distance=contact.distance - (r1 + r2))


def _rows(pair: GeometryPair, answer: Nearest, margin: float, limit: int) -> list[tuple]:
    """The contact manifold of the shapes that decided, the deepest first."""
    swept_1, swept_2 = pair.radius_1, pair.radius_2
    reach = max(0.0, margin + swept_1 + swept_2)
    rows = engine.contacts(*answer.shapes, pair.X1, pair.X2, margin=reach, max_contacts=limit).rows
    rows = rows[rows["distance"] <= margin + swept_1 + swept_2]
    contacts = []
    for row in rows[np.argsort(rows["distance"], kind="stable")[:limit]]:
        normal = row["normal"]
        b1, b2 = (_part(g, row["facet_" + side], row["part_" + side]) for g, side in ((pair.g1, "a"), (pair.g2, "b")))
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
        [m]. Of bodies that overlap minus their depth, of a mesh and a solid that of one facet that meets it, 0 without
        ``enable_signed_distance``; 0 of two meshes, which have no inside; −1.8e308 of planes and half-spaces that no
        translation takes apart.

    Raises
    ------
    InvalidArgument, a ValueError
        For models without triangles.
    TypeError
        For arguments of other types.
    """
    return distance_posed(*asked("distance", args, 2))


def distance_posed(g1, X1, g2, X2, request, result) -> float:
    """The same of geometries at poses (4, 4)."""
    result.o1, result.o2 = g1, g2
    shapes_1, shapes_2, radius_1, radius_2 = g1._shapes, g2._shapes, g1._radius_swept, g2._radius_swept
    is_signed = bool(request.enable_signed_distance)
    if len(shapes_1) == len(shapes_2) == 1 and not (
        g1._has_parts or g2._has_parts or radius_1 or radius_2 or (g1._box is None and g2._box is None)
    ):
        least, normal, point_1, point_2, _, _, _, _ = nearest_points(shapes_1[0], shapes_2[0], X1, X2, is_signed)
        result._fill(least, normal, [point_1, point_2], -1, -1)
        return least
    is_signed = is_signed and not g1._object_type == g2._object_type == OBJECT_TYPE.OT_BVH
    pair = GeometryPair(g1, X1, g2, X2, shapes_1, shapes_2, radius_1, radius_2)
    if pair.is_of_two_shapes():
        b1, b2, normal, least, points, _ = _nearest_fields(pair, is_signed, is_signed and _is_facet_by_facet(pair))
        result._fill(least, normal, points, b1, b2)
        return result.min_distance
    answer = nearest(pair, 0.0, math.inf, is_signed)
    b1, b2 = _of_whole(answer.facets_1, answer.part_1), _of_whole(answer.facets_2, answer.part_2)
    points = [np.array(answer.point_1), np.array(answer.point_2)]
    result._fill(answer.distance, np.array(answer.normal), points, b1, b2)
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
    if len(args) == 4 + n_more and args[1].__class__ is args[3].__class__ is Transform3s:
        g1, tf1, g2, tf2 = args[:4]
        if isinstance(g1, CollisionGeometry) and isinstance(g2, CollisionGeometry):
            return g1, tf1._X, g2, tf2._X, *args[4:]
    if len(args) == 2 + n_more and isinstance(args[0], CollisionObject) and isinstance(args[1], CollisionObject):
        o1, o2, *more = args
        return o1._geometry, o1._X, o2._geometry, o2._X, *more
    if len(args) == 4 + n_more:
        g1, tf1, g2, tf2 = args[:4]
        return (
            checked_geometry("o1", g1), pose_of("tf1", tf1), checked_geometry("o2", g2), pose_of("tf2", tf2), *args[4:],
        )
    raise TypeError(
        f"{name} takes two CollisionObjects, or (geometry, transform, geometry, transform), and {n_more} more arguments"
    )
