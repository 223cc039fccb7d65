"""coal's requests, results, contacts and patches, with its defaults and names of fields."""

from __future__ import annotations

import math
import sys

import numpy as np

from collide.adapters.hosts.coal_containers import StdVec_Contact
from collide.adapters.hosts.coal_enums import (
    CollisionRequestFlag,
    ContactPatchDirection,
    GJKConvergenceCriterion,
    GJKConvergenceCriterionType,
    GJKInitialGuess,
    GJKVariant,
)
from collide.adapters.hosts.coal_transform import Transform3s
from collide.adapters.hosts.fields_when_read import FieldsWhenRead
from collide.adapters.hosts.host_numbers import real, shaped, whole
from collide.errors import InvalidArgument

_MAX = sys.float_info.max


class CPUTimes:
    """Nothing is timed: zeros."""

    def __init__(self):
        self.clear()

    def clear(self):
        """Zeros again."""
        self.wall = self.user = self.system = 0.0


class QueryRequest:
    """What collision and distance requests share: settings of GJK and EPA, all accepted and without effect."""

    def __init__(self):
        self.gjk_initial_guess = GJKInitialGuess.DefaultGuess
        self.enable_cached_gjk_guess = False
        self.gjk_variant = GJKVariant.DefaultGJK
        self.gjk_convergence_criterion = GJKConvergenceCriterion.Default
        self.gjk_convergence_criterion_type = GJKConvergenceCriterionType.Relative
        self.gjk_tolerance, self.gjk_max_iterations = 1e-6, 128
        self.epa_tolerance, self.epa_max_iterations = 1e-6, 64
        self.cached_gjk_guess = np.array([1.0, 0.0, 0.0])
        self.cached_support_func_guess = np.array([0, 0])
        self.enable_timings = False

    def updateGuess(self, result):
        """Nothing to do: guesses have no effect."""


class QueryResult:
    """What collision and distance results share; guesses and times have no meaning here."""

    def __init__(self):
        self.cached_gjk_guess = np.zeros(3)
        self.cached_support_func_guess = np.array([-1, -1])
        self.timings = CPUTimes()


class CollisionRequest(QueryRequest):
    """How many contacts are wanted, of what, and how near bodies must be to count.

    ``CollisionRequest()``, or with a `CollisionRequestFlag` and the number of contacts. ``security_margin`` [m]: bodies
    at most so far apart collide; below 0, those at least so deep. Of bodies farther apart than both it and
    ``distance_upper_bound`` [m] a lower bound of the distance is all that is worked out. ``break_distance`` has no
    effect. Without ``enable_contact`` no depth is worked out.
    """

    def __init__(self, flag=None, num_max_contacts=1):
        super().__init__()
        self.num_max_contacts = whole("num_max_contacts", num_max_contacts)
        self.enable_contact = flag is None or bool(flag & CollisionRequestFlag.CONTACT)
        self.enable_distance_lower_bound = flag is not None and bool(flag & CollisionRequestFlag.DISTANCE_LOWER_BOUND)
        self.security_margin = 0.0
        self.break_distance = 1e-3
        self.distance_upper_bound = _MAX


class DistanceRequest(QueryRequest):
    """Nearest points come in any case, depths with ``enable_signed_distance``; errors allowed are not made use of."""

    def __init__(self, enable_nearest_points=True, rel_err=0.0, abs_err=0.0):
        super().__init__()
        self.enable_nearest_points = enable_nearest_points
        self.enable_signed_distance = True
        self.rel_err, self.abs_err = rel_err, abs_err


class Contact(FieldsWhenRead):
    """A contact of geometries o1 and o2: ``normal`` (3,) from o1 to o2 in the world, ``pos`` (3,) between the surfaces
    [m], ``penetration_depth`` the signed distance [m], below 0 where they overlap; ``b1`` and ``b2`` facets of meshes,
    −1 elsewhere.

    ``Contact()``, ``Contact(o1, o2, b1, b2)``, ``Contact(o1, o2, b1, b2, pos, normal, depth)``. Fields of a contact
    that `collide` found are worked out when one of them is first read, of the poses that were asked.
    """

    _later = ("b1", "b2", "normal", "penetration_depth", "nearest_points", "pos")

    def __init__(self, o1=None, o2=None, b1=-1, b2=-1, pos=None, normal=None, depth=_MAX):
        self.o1, self.o2, self.b1, self.b2 = o1, o2, whole("b1", b1), whole("b2", b2)
        nothing = np.full(3, np.nan)
        self.pos = nothing if pos is None else shaped("pos", pos, (3,)).copy()
        self.normal = nothing.copy() if normal is None else shaped("normal", normal, (3,)).copy()
        self.penetration_depth = real("depth", depth)
        half = 0.5 * self.penetration_depth * self.normal if normal is not None else nothing
        #: The points (3,) of both surfaces.
        self.nearest_points = [self.pos - half, self.pos + half]

    def getNearestPoint1(self):
        """A copy (3,): of o1."""
        return self.nearest_points[0].copy()

    def getNearestPoint2(self):
        """A copy (3,): of o2."""
        return self.nearest_points[1].copy()

    def __eq__(self, other):
        return (
            isinstance(other, Contact)
            and (self.o1, self.o2, self.b1, self.b2) == (other.o1, other.o2, other.b1, other.b2)
            and self.penetration_depth == other.penetration_depth
            and np.array_equal(self.normal, other.normal)
            and np.array_equal(self.pos, other.pos)
            and np.array_equal(self.nearest_points, other.nearest_points)
        )

    __hash__ = object.__hash__


class CollisionResult(QueryResult):
    """Collects contacts over calls, up to the number that the request asks for; `clear` empties it.

    ``distance_lower_bound`` [m]: the least distance less the security margin that is proven, over these calls.
    """

    def __init__(self):
        super().__init__()
        self.clear()

    def clear(self):
        """As new."""
        self._contacts = StdVec_Contact()
        self._bound, self._bounds_to_come = _MAX, []

    @property
    def distance_lower_bound(self):
        """[m]; of pairs that were asked since it was last read, it is worked out now."""
        while self._bounds_to_come:
            work, question = self._bounds_to_come.pop()
            self._bound = min(self._bound, work(*question))
        return self._bound

    @distance_lower_bound.setter
    def distance_lower_bound(self, value):
        self._bound, self._bounds_to_come = value, []

    def isCollision(self):
        """Whether there is a contact."""
        return len(self._contacts) > 0

    def numContacts(self):
        """How many contacts there are."""
        return len(self._contacts)

    def addContact(self, c):
        """c : `Contact`."""
        self._contacts.append(c)

    def getContact(self, i):
        """Contact i; the last one beyond. Raises ValueError where there is none."""
        if not self._contacts:
            raise InvalidArgument("The number of contacts is zero. No Contact can be returned.")
        return self._contacts[min(i, len(self._contacts) - 1)]

    def getContacts(self, contacts_=None):
        """The contacts; where a list is handed over, into that."""
        if contacts_ is None:
            return self._contacts.copy()
        contacts_[:] = self._contacts
        return None


def _nothing() -> tuple:
    """The fields `DistanceResult._later` before a query."""
    return np.full(3, np.nan), [np.full(3, np.nan), np.full(3, np.nan)], -1, -1


class DistanceResult(FieldsWhenRead, QueryResult):
    """What `distance` found last: ``min_distance`` [m], ``normal`` (3,) from the first body to the second."""

    _later = ("normal", "nearest_points", "b1", "b2")

    def __init__(self):
        super().__init__()
        self.clear()

    def clear(self):
        """As new."""
        self.min_distance = _MAX
        self.o1 = self.o2 = None
        self._postpone(_nothing)

    def _fill(self, least: float, normal: np.ndarray, points: list, b1: int, b2: int) -> None:
        self.min_distance, self.normal, self.nearest_points, self.b1, self.b2 = least, normal, points, b1, b2

    def getNearestPoint1(self):
        """A copy (3,): of the first body."""
        return self.nearest_points[0].copy()

    def getNearestPoint2(self):
        """A copy (3,): of the second body."""
        return self.nearest_points[1].copy()


class ContactPatchRequest:
    """How many patches are wanted; made of numbers, or after a `CollisionRequest`, of its number of contacts.

    patch_tolerance : how far a point may lie behind the farthest one along the normal and belong to the patch [m].
    num_samples_curved_shapes has no effect: the ends of round bodies are octagons.
    """

    def __init__(self, max_num_patch=1, num_samples_curved_shapes=12, patch_tolerance=1e-3):
        if isinstance(max_num_patch, CollisionRequest):
            max_num_patch = max_num_patch.num_max_contacts
        self.max_num_patch = whole("max_num_patch", max_num_patch)
        self.setNumSamplesCurvedShapes(num_samples_curved_shapes)
        self.setPatchTolerance(patch_tolerance)

    def getNumSamplesCurvedShapes(self):
        """At least 3."""
        return self._samples

    def setNumSamplesCurvedShapes(self, num):
        """Without effect."""
        self._samples = max(3, whole("num", num))

    def getPatchTolerance(self):
        """[m]."""
        return self._tolerance

    def setPatchTolerance(self, tol):
        """tol : [m]; at least 1e-12."""
        tolerance = real("tol", tol)
        if not math.isfinite(tolerance):
            raise InvalidArgument(f"setPatchTolerance: tol must be finite [m], got {tolerance}")
        self._tolerance = max(1e-12, tolerance)


class ContactPatch:
    """A polygon in the plane halfway between two surfaces.

    ``tf`` : frame of the polygon in the world, its z-axis the normal, or minus the normal where ``direction`` is
    INVERTED.   ``penetration_depth`` : signed distance of the surfaces along the normal [m].
    """

    def __init__(self, preallocated_size=12):
        self.clear()

    def clear(self):
        """As new."""
        self.tf = Transform3s()
        self.direction = ContactPatchDirection.DEFAULT
        self.penetration_depth = 0.0
        self._points: list[np.ndarray] = []

    def size(self):
        """How many corners there are."""
        return len(self._points)

    def addPoint(self, point_3d):
        """The point (3,) in the world, brought into the plane."""
        R, t = self.tf._X[:3, :3], self.tf._X[:3, 3]
        self._points.append(((shaped("point_3d", point_3d, (3,)) - t) @ R)[:2])

    def getNormal(self):
        """(3,) from the first body to the second."""
        z = self.tf._X[:3, 2].copy()
        return -z if self.direction == ContactPatchDirection.INVERTED else z

    def getPoint(self, i):
        """Corner i in the world (3,); the last one beyond."""
        return self.tf.transform(np.append(self._points[min(i, len(self._points) - 1)], 0.0))

    def getPointShape1(self, i):
        """Corner i, half the depth along the normal: on the first body where its surface is flat there (3,)."""
        return self.getPoint(i) - 0.5 * self.penetration_depth * self.getNormal()

    def getPointShape2(self, i):
        """Corner i, half the depth against the normal: on the second body where its surface is flat there (3,)."""
        return self.getPoint(i) + 0.5 * self.penetration_depth * self.getNormal()

    def isSame(self, other, tol):
        """Whether normal, depth and corners agree within ``tol``, in any order."""
        if self.size() != other.size() or abs(self.penetration_depth - other.penetration_depth) > tol:
            return False
        if float(self.getNormal() @ other.getNormal()) < 1.0 - tol:
            return False
        theirs = np.array([other.getPoint(k) for k in range(other.size())]).reshape(-1, 3)
        mine = (self.getPoint(k) for k in range(self.size()))
        return all((np.linalg.norm(theirs - point, axis=1) <= tol).any() for point in mine)


class ContactPatchResult:
    """The patches of a pair of bodies."""

    def __init__(self, request=None):
        self.clear()

    def clear(self):
        """As new."""
        self._patches: list[ContactPatch] = []

    def set(self, request):
        """As new; nothing else depends on the request."""
        self.clear()

    def check(self, request):
        """True: a result can take the patches of any request."""
        return True

    def numContactPatches(self):
        """How many patches there are."""
        return len(self._patches)

    def getContactPatch(self, i):
        """Patch i; the last one beyond. Raises ValueError where there is none."""
        if not self._patches:
            raise InvalidArgument("The number of contact patches is zero. No ContactPatch can be returned.")
        return self._patches[min(i, len(self._patches) - 1)]

    def getUnusedContactPatch(self):
        """A new patch, which now belongs to it."""
        self._patches.append(ContactPatch())
        return self._patches[-1]


class CollisionData:
    """What `CollisionCallBackDefault` collects into."""

    def __init__(self):
        self.request, self.result, self.done = CollisionRequest(), CollisionResult(), False

    def clear(self):
        """The result as new."""
        self.result.clear()
        self.done = False


class DistanceData:
    """What `DistanceCallBackDefault` collects into."""

    def __init__(self):
        self.request, self.result, self.done = DistanceRequest(), DistanceResult(), False

    def clear(self):
        """The result as new."""
        self.result.clear()
        self.done = False
