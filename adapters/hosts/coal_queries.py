"""coal's `collide` and `distance`, and the callables that keep two geometries, answered by collide.

As there: normals point from the first geometry to the second, ``penetration_depth`` and ``min_distance`` are below 0
where bodies overlap, results of `collide` collect over calls, and one contact is all that two shapes without facets
have; `computeContactPatch` has the rest.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_enums import OBJECT_TYPE
from collide.adapters.hosts.coal_geometry import CollisionGeometry, CollisionObject, checked_geometry, pose_of
from collide.adapters.hosts.coal_nearest import GeometryPair, Nearest, nearest
from collide.adapters.hosts.coal_requests import Contact
from collide.adapters.hosts.fcl_facets import contacts_of_facets
from collide.adapters.hosts.host_numbers import real, whole
from collide.errors import InvalidArgument
from collide.pairs.query import collide as hits

#: How many contacts of two meshes are looked at where those are wanted that are deeper than something.
_ALL = 1 << 30
#: How many pairs' bounds of the distance wait in a result at most, until they are worked out.
_MAX_BOUNDS = 16


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
    """The same of geometries at poses (4, 4).

    Of two sets that are a shape each, the boolean is decided, and the rest is worked out when it is read.
    """
    limit, margin = _checked(request)
    contacts = result._contacts
    n_wanted = limit - len(contacts)
    if n_wanted < 1:
        return len(contacts)
    pair = _Asked(g1, X1, g2, X2)
    if margin < 0.0 or not pair.is_of_two_shapes() or (n_wanted > 1 and (g1._has_parts or g2._has_parts)):
        rows, bound = _worked_out(pair, request.enable_contact, margin, request.distance_upper_bound, n_wanted)
        for row in rows:
            contacts.append(contact_of(g1, g2, *row))
        result.distance_lower_bound = min(result.distance_lower_bound, bound)
        return len(contacts)
    reach = margin + pair.radius_1 + pair.radius_2
    A, B = pair.shapes_1[0], pair.shapes_2[0]
    is_within = hits(A, B, X1, X2, security_margin=reach) if reach else hits(A, B, X1, X2)
    pair.keep(request.enable_contact, margin, request.distance_upper_bound)
    if is_within:
        contact = object.__new__(Contact)  # the constructor's defaults would be thrown away
        contact.o1, contact.o2 = g1, g2
        contact._postpone(pair.contact)
        contacts.append(contact)
    bounds = result._bounds_to_come
    bounds.append(pair.bound)
    if len(bounds) > _MAX_BOUNDS:
        result.distance_lower_bound  # noqa: B018 - works them out
    return len(contacts)


def _checked(request) -> tuple[int, float]:
    """The number of contacts and the margin [m]. Raises InvalidArgument, TypeError."""
    limit, margin = request.num_max_contacts, request.security_margin
    if limit.__class__ is not int or margin.__class__ is not float:
        limit, margin = whole("num_max_contacts", limit), real("security_margin", margin)
    if limit < 1:
        raise InvalidArgument(f"num_max_contacts must be at least 1, got {request.num_max_contacts}")
    if not -math.inf < margin < math.inf:
        raise InvalidArgument(f"security_margin must be finite [m], got {margin}")
    return limit, margin


class _Asked(GeometryPair):
    """A pair of which a contact's fields and a bound of the distance are worked out once, when one of them is read."""

    __slots__ = ("_answer", "_question")

    _answer: tuple[list[tuple], float] | None
    #: Whether contacts are wanted, the margin [m], the distance beyond which a bound is enough [m].
    _question: tuple[bool, float, float]

    def keep(self, *question) -> None:
        """Takes copies of the poses, which programs change in place; shapes are never changed."""
        self.X1, self.X2, self._question, self._answer = self.X1.copy(), self.X2.copy(), question, None

    def _worked_out(self) -> tuple[list[tuple], float]:
        answer = self._answer
        if answer is None:
            answer = self._answer = _worked_out(self, *self._question, 1)
        return answer

    def bound(self) -> float:
        """What the distance less the margin is at least [m]."""
        return self._worked_out()[1]

    def contact(self) -> tuple:
        """The fields of the contact, in the order of `Contact._later`."""
        return _fields(*self._worked_out()[0][0])


def _worked_out(
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
    if is_within and are_meshes and answer.distance <= 0.0:
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
    contact.__dict__.update(zip(Contact._later, _fields(b1, b2, normal, point_1, point_2, depth)))
    return contact


def _fields(b1, b2, normal, point_1, point_2, depth) -> tuple:
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
    pair = GeometryPair(g1, X1, g2, X2)
    result.o1, result.o2 = g1, g2
    if pair.is_of_two_shapes():
        gap = engine.distance(pair.shapes_1[0], pair.shapes_2[0], X1, X2, signed=is_signed)
        least, radii = gap.distance, pair.radius_1 + pair.radius_2
        if radii and (is_signed or not gap.hit):
            least -= radii
        result.min_distance = least
        result._postpone(partial(_of_gap, gap, pair.radius_1, pair.radius_2, g1._has_parts, g2._has_parts))
        return least
    answer = nearest(pair, 0.0, math.inf, is_signed)
    result.min_distance = answer.distance
    result.normal, result.nearest_points = np.array(answer.normal), [np.array(answer.point_1), np.array(answer.point_2)]
    result.b1, result.b2 = _of_whole(answer.facets_1, answer.part_1), _of_whole(answer.facets_2, answer.part_2)
    return result.min_distance


def _of_gap(gap, radius_1: float, radius_2: float, has_parts_1: bool, has_parts_2: bool) -> tuple:
    """The fields `DistanceResult._later` of a result of `collide.distance`."""
    row = gap.rows[0]
    normal, points = np.array(row["normal"]), [np.array(row["point_a"]), np.array(row["point_b"])]
    if radius_1 or radius_2:
        points = [points[0] + radius_1 * normal, points[1] - radius_2 * normal]
    return normal, points, int(row["part_a"]) if has_parts_1 else -1, int(row["part_b"]) if has_parts_2 else -1


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
