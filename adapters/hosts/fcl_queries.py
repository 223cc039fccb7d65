"""python-fcl's `collide`, `distance`, `continuousCollide` and default callbacks, answered by collide.

As there, where a mesh or an octree is asked with a plain geometry, the mesh is o1 of contacts and results, whichever
came first; results collect over calls.
"""

from __future__ import annotations

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_contacts import FLAT, contacts_of, nearest_sides, ordered
from collide.adapters.hosts.fcl_geometry import CollisionObject
from collide.adapters.hosts.fcl_planes import is_plane_with_pieces, plane_gap, plane_meets, sides_to_move
from collide.adapters.hosts.fcl_requests import (
    NODE_TYPE,
    OBJECT_TYPE,
    CCDMotionType,
    CollisionRequest,
    ContinuousCollisionRequest,
)
from collide.adapters.hosts.fcl_transform import Transform
from collide.adapters.hosts.host_numbers import whole
from collide.adapters.hosts.nearest_points import nearest_points
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.pairs.query import collide as hits

_PLANE, _HALFSPACE = NODE_TYPE.GEOM_PLANE, NODE_TYPE.GEOM_HALFSPACE


def collide(o1, o2, request=None, result=None):
    """Whether two objects meet, and their contacts.

    Parameters
    ----------
    o1, o2 : CollisionObject
    request : CollisionRequest, optional
    result : CollisionResult, optional
        ``is_collision`` and ``contacts`` of this call are added to what it holds.

    Returns
    -------
    int
        How many contacts were added: 0 where the objects are apart, at most ``num_max_contacts``.

    Raises
    ------
    UnsupportedQuery
        Where cost sources are wanted.
    TypeError
        Where arguments are no collision objects.
    """
    if o1.__class__ is not CollisionObject or o2.__class__ is not CollisionObject:
        _check_objects(o1, o2)
    limit, with_geometry = 1, False
    if request is not None:
        limit, with_geometry = request.num_max_contacts, request.enable_contact
        if limit.__class__ is not int or limit < 1 or request.enable_cost:
            limit = checked_limit(request)
            if limit == 0:
                return 0
    shapes_1, shapes_2 = o1._geometry._shapes, o2._geometry._shapes
    if len(shapes_1) == len(shapes_2) == 1:
        if not hits(shapes_1[0], shapes_2[0], o1._X, o2._X):
            return 0
    elif not meet(o1, o2):
        return 0
    if result is None:
        return 1 if limit == 1 else len(contacts_of(*ordered(o1, o2), limit, with_geometry))
    result.is_collision = True
    contacts = contacts_of(*ordered(o1, o2), limit, with_geometry)
    result.contacts.extend(contacts)
    return len(contacts)


def _check_objects(o1, o2) -> None:
    if not (isinstance(o1, CollisionObject) and isinstance(o2, CollisionObject)):
        raise TypeError(f"o1 and o2 must be CollisionObjects, got {type(o1).__name__} and {type(o2).__name__}")


def checked_limit(request: CollisionRequest) -> int:
    """How many contacts are wanted. Raises OverflowError, and UnsupportedQuery where cost sources are."""
    limit = whole("num_max_contacts", request.num_max_contacts)
    if limit < 0:
        raise OverflowError("num_max_contacts must not be negative")
    if request.enable_cost:
        raise UnsupportedQuery("enable_cost: there are no cost sources here; ask for contacts (enable_contact)")
    return limit


def _refuse_unfinished(*geometries) -> None:
    """Raises InvalidArgument for a mesh that is not finished."""
    for geometry in geometries:
        geometry._shape  # noqa: B018 - asks for it


def meet(o1: CollisionObject, o2: CollisionObject) -> bool:
    """Whether two objects meet. A connected set meets a plane where it meets both of its half-spaces."""
    g1, g2 = o1._geometry, o2._geometry
    _refuse_unfinished(g1, g2)
    if is_plane_with_pieces(o1, o2):
        return plane_meets(o1, o2)
    return all(hits(A, B, o1._X, o2._X) for A in g1._shapes for B in g2._shapes)


def distance(o1, o2, request=None, result=None):
    """The distance of two objects.

    Parameters
    ----------
    o1, o2 : CollisionObject
    request : DistanceRequest, optional
    result : DistanceResult, optional
        Takes this pair, where it is nearer than what it holds.

    Returns
    -------
    float
        [m]. Of objects that meet: minus their depth with ``enable_signed_distance``, −1 without it. Meshes have no
        inside: −1 in any case, but with planes and half-spaces, and 0 of two of them.
    """
    if o1.__class__ is not CollisionObject or o2.__class__ is not CollisionObject:
        _check_objects(o1, o2)
    o1, o2 = ordered(o1, o2)
    g1, g2 = o1._geometry, o2._geometry
    is_mesh = g1._object_type == OBJECT_TYPE.OT_BVH  # which stands first
    signed = request is not None and bool(request.enable_signed_distance) and (not is_mesh or g2._node_type in FLAT)
    shapes_1, shapes_2 = g1._shapes, g2._shapes
    if not (shapes_1 and shapes_2):
        _refuse_unfinished(g1, g2)
    if len(shapes_1) == len(shapes_2) == 1:
        A, B = shapes_1[0], shapes_2[0]
    elif is_plane_with_pieces(o1, o2):
        return _plane_distance(o1, o2, signed, result)
    else:
        A, B = nearest_sides(o1, o2)
    value, _, point_1, point_2, _, part_1, part_2, is_hit = nearest_points(A, B, o1._X, o2._X, signed=signed)
    if is_hit and not signed:
        value = 0.0 if is_mesh and g2._object_type == OBJECT_TYPE.OT_BVH else -1.0
    if result is not None and result.min_distance > value:
        result.min_distance, result.o1, result.o2, result.nearest_points = value, g1, g2, [point_1, point_2]
        result.b1 = -1 if g1._object_type == OBJECT_TYPE.OT_GEOM else part_1  # which stands first
        result.b2 = -1 if g2._object_type == OBJECT_TYPE.OT_GEOM else part_2
    return value


def _plane_distance(o1: CollisionObject, o2: CollisionObject, signed: bool, result) -> float:
    """`distance` of a plane and a mesh or an octree; o1 is the latter."""
    is_hit, value, point1, point2, cell = plane_gap(o1, o2)
    if is_hit:
        A, B = nearest_sides(o1, o2)
        value = float(engine.distance(A, B, o1._X, o2._X).distance) if signed else -1.0
    if result is not None and result.min_distance > value:
        result.min_distance, result.nearest_points = value, [point1, point2]
        result.o1, result.o2, result.b1, result.b2 = o1._geometry, o2._geometry, cell, -1
    return value


def continuousCollide(o1, tf1_end, o2, tf2_end, request=None, result=None):
    """When two moving objects first touch, in units of the motion.

    Parameters
    ----------
    o1, o2 : CollisionObject
        At the poses where their motions begin.
    tf1_end, tf2_end : Transform
        Where they end. ``CCDM_TRANS``, the default, leaves rotations as they are at the start; ``CCDM_LINEAR`` turns
        them the shortest way.
    request : ContinuousCollisionRequest, optional
    result : ContinuousCollisionResult, optional
        Takes the earlier of its time and this.

    Returns
    -------
    float
        Up to this time the objects are proven apart; 1 where they do not touch, 0 where they do at the start.

    Raises
    ------
    UnsupportedQuery
        For motions along screws and splines.
    """
    motion = ContinuousCollisionRequest().ccd_motion_type if request is None else request.ccd_motion_type
    for name, tf in (("tf1_end", tf1_end), ("tf2_end", tf2_end)):
        if not isinstance(tf, Transform):
            raise TypeError(f"{name} must be a Transform, got {type(tf).__name__}")
    ends = []
    for moving, tf in ((o1, tf1_end), (o2, tf2_end)):
        X = tf._X.copy()
        if motion == CCDMotionType.CCDM_TRANS:
            X[:3, :3] = moving._X[:3, :3]
        elif motion != CCDMotionType.CCDM_LINEAR and not np.array_equal(X[:3, :3], moving._X[:3, :3]):
            raise UnsupportedQuery("continuousCollide: screws and splines are not known; CCDM_LINEAR turns on a line")
        ends.append(X)
    hit, time = _first_contact(o1, ends[0], o2, ends[1])
    if result is not None:
        result.is_collide = bool(result.is_collide or hit)
        result.time_of_contact = min(time, result.time_of_contact)
    return time


def _first_contact(o1, X1, o2, X2) -> tuple[bool, float]:
    g1, g2 = o1._geometry, o2._geometry
    pairs = [(A, B) for A in g1._shapes for B in g2._shapes]
    if not pairs:
        raise InvalidArgument("continuousCollide: a mesh has no facets yet: beginModel, addSubModel, endModel")
    if len(pairs) > 1:
        if meet(o1, o2):
            return True, 0.0
        if is_plane_with_pieces(o1, o2):
            moves = [engine.time_of_impact(*pair, o1._X, X1, o2._X, X2) for pair in sides_to_move(o1, o2)]
            return any(t.hit for t in moves), min(float(t.time) for t in moves)
        pairs = [pair for pair in pairs if not hits(*pair, o1._X, o2._X)][:1]
    t = engine.time_of_impact(*pairs[0], o1._X, X1, o2._X, X2)
    return bool(t.hit), float(t.time)


def defaultCollisionCallback(o1, o2, cdata):
    """Ask one pair into ``cdata`` (`CollisionData`); True, which ends the traversal, once enough contacts are there."""
    request, result = cdata.request, cdata.result
    if cdata.done:
        return True
    collide(o1, o2, request, result)
    if not request.enable_cost and result.is_collision and len(result.contacts) > request.num_max_contacts:
        cdata.done = True
    return cdata.done


def defaultDistanceCallback(o1, o2, cdata):
    """Ask one pair into ``cdata`` (`DistanceData`); (whether that is all, the least distance so far)."""
    request, result = cdata.request, cdata.result
    if cdata.done:
        return True, result.min_distance
    distance(o1, o2, request, result)
    return (True, result.min_distance) if result.min_distance <= 0 else (cdata.done, result.min_distance)

