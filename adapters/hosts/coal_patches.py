"""coal's contact patches: polygons halfway between two surfaces, from collide's contact manifolds."""

from __future__ import annotations

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_geometry import Halfspace, Plane, checked_geometry, pose_of
from collide.adapters.hosts.coal_nearest import GeometryPair, nearest
from collide.adapters.hosts.coal_queries import asked
from collide.adapters.hosts.coal_requests import Contact, ContactPatch

#: Corners of a patch, at most.
_CORNERS = 64


def computeContactPatch(*args):
    """The patches over which two geometries touch, the deepest first.

    Parameters
    ----------
    args : ``(o1, o2, collision_result, request, result)`` with two `CollisionObject`, or ``(g1, tf1, g2, tf2,
        collision_result, request, result)``.
        ``collision_result`` : of the same bodies at the same places: without a contact there is no patch.
        ``request`` : ContactPatchRequest.   ``result`` : ContactPatchResult, emptied and filled.

    Raises
    ------
    TypeError
        For arguments of other types.
    """
    g1, X1, g2, X2, collision_result, request, result = asked("computeContactPatch", args, 3)
    patches_posed(g1, X1, g2, X2, collision_result, request, result)


def patches_posed(g1, X1, g2, X2, collision_result, request, result) -> None:
    """The same of geometries at poses (4, 4)."""
    result.clear()
    if request.max_num_patch < 1 or not collision_result.isCollision():
        return
    rows = _patch_rows(g1, X1, g2, X2, collision_result, request.getPatchTolerance())
    if not len(rows):  # touching within rounding, or without end: one point
        result._patches.append(_point_patch(collision_result.getContact(0)))
        return
    swept_1, swept_2 = g1._radius_swept, g2._radius_swept
    keys = np.unique(rows[["part_a", "part_b", "patch"]], return_inverse=True)[1].ravel()
    deepest = [rows["distance"][keys == key].min() for key in range(keys.max() + 1)]
    for key in np.argsort(deepest, kind="stable")[: request.max_num_patch]:
        some = rows[keys == key]
        some = some[some["distance"] <= some["distance"].min() + 2.0 * request.getPatchTolerance()]
        shift = 0.5 * (swept_1 - swept_2) * some["normal"][0]
        points = 0.5 * some["point_a"] + 0.5 * some["point_b"] + shift
        depth = float(some["distance"].min()) - swept_1 - swept_2
        result._patches.append(_patch(some["normal"][0], points[int(some["distance"].argmin())], depth, points))


def _patch_rows(g1, X1, g2, X2, collision_result, tolerance: float) -> np.ndarray:
    """Contacts that may belong to a patch: those no more than twice the tolerance less deep than the deepest."""
    if isinstance(g1, (Plane, Halfspace)) and isinstance(g2, (Plane, Halfspace)):
        return np.zeros(0)
    answer = nearest(GeometryPair.now(g1, X1, g2, X2), 0.0, np.inf, False)
    radii = g1._radius_swept + g2._radius_swept
    reach = max(0.0, float(answer.distance) + radii) + 2.0 * tolerance
    return engine.contacts(*answer.shapes, X1, X2, margin=reach, max_contacts=_CORNERS).rows


def _point_patch(contact: Contact) -> ContactPatch:
    normal = contact.normal if np.linalg.norm(contact.normal) > 0.5 else np.array([0.0, 0.0, 1.0])
    return _patch(normal, contact.pos, contact.penetration_depth, contact.pos[None])


def _patch(normal: np.ndarray, origin: np.ndarray, depth: float, points: np.ndarray) -> ContactPatch:
    """A patch with this normal (3,) through ``origin`` (3,), of points (n, 3) brought into its plane."""
    patch = ContactPatch()
    x = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    x /= np.linalg.norm(x)
    patch.tf._X[:3] = np.column_stack([x, np.cross(normal, x), normal, origin])
    patch.penetration_depth = depth
    for point in points:
        patch.addPoint(point)
    return patch


class ComputeContactPatch:
    """`computeContactPatch` of two geometries: called with ``(tf1, tf2, collision_result, request, result)``."""

    def __init__(self, o1, o2):
        self._o1, self._o2 = checked_geometry("o1", o1), checked_geometry("o2", o2)

    def __call__(self, tf1, tf2, collision_result, request, result):
        poses = pose_of("tf1", tf1), pose_of("tf2", tf2)
        patches_posed(self._o1, poses[0], self._o2, poses[1], collision_result, request, result)
