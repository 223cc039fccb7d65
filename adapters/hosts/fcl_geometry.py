"""python-fcl's geometries and `CollisionObject`, made of collide's shapes.

Geometries may be changed after they are made (``box.side = …``), which makes a new shape; shapes themselves are
immutable, and keep what makes single calls fast. Lengths are [m]; ``lz`` is the full length along z.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_requests import NODE_TYPE, OBJECT_TYPE
from collide.adapters.hosts.fcl_transform import Transform, quaternion_of, rotation_of
from collide.adapters.hosts.host_numbers import real, rows_of_three, shaped, whole
from collide.adapters.hosts.posed_objects import HostGeometry, HostObject
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.shapes.shape import Shape


class CollisionGeometry(HostGeometry):
    """Base of all geometries; of itself it has no points."""

    _node_type: int | None = None
    _object_type = OBJECT_TYPE.OT_GEOM
    _center: np.ndarray | None = None

    def getNodeType(self):
        """A number of `NODE_TYPE`, None of the base."""
        return self._node_type

    def computeLocalAABB(self):
        """Nothing to do: boxes are always those of the geometry as it is."""
        return

    @property
    def aabb_center(self):
        """Middle (3,) of the box around the geometry in its frame; setting it has no effect on queries."""
        if self._node_type is None:
            return None
        if self._center is not None:
            return self._center.copy()
        return 0.5 * (self._corners[0] + self._corners[1]) if np.isfinite(self._corners).all() else np.zeros(3)

    @aabb_center.setter
    def aabb_center(self, value):
        if self._node_type is None:
            raise ReferenceError
        self._center = shaped("aabb_center", value, (3,)).copy()


class TriangleP(CollisionGeometry):
    """A triangle with corners a, b, c (3,). python-fcl answers no query of one; here it is a flat convex set."""

    _node_type = NODE_TYPE.GEOM_TRIANGLE

    def __init__(self, a, b, c):
        self._points = np.array([shaped(name, p, (3,)) for name, p in zip("abc", (a, b, c))])
        self._rebuild()

    def _rebuild(self):
        self._become([self._points.min(axis=0), self._points.max(axis=0)], engine.ConvexHull(self._points))

    def _set(self, row: int, value) -> None:
        self._points[row] = shaped("abc"[row], value, (3,))
        self._rebuild()

    a = property(lambda self: self._points[0].copy(), lambda self, value: self._set(0, value), doc="Corner (3,) [m].")
    b = property(lambda self: self._points[1].copy(), lambda self, value: self._set(1, value), doc="Corner (3,) [m].")
    c = property(lambda self: self._points[2].copy(), lambda self, value: self._set(2, value), doc="Corner (3,) [m].")


class Box(CollisionGeometry):
    """A box with full edge lengths x, y, z; lengths of 0 make it flat."""

    _node_type = NODE_TYPE.GEOM_BOX

    def __init__(self, x, y, z):
        self.side = np.array([real(name, length) for name, length in zip("xyz", (x, y, z))])

    @property
    def side(self):
        """Full edge lengths (3,) [m]."""
        return self._side.copy()

    @side.setter
    def side(self, value):
        side = shaped("side", value, (3,)).copy()
        flat = (side == 0.0).any() and (side >= 0.0).all()
        corners = 0.5 * side * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        self._become([-0.5 * side, 0.5 * side], engine.ConvexHull(corners) if flat else engine.Box(side))
        self._side = side


class Sphere(CollisionGeometry):
    """A ball; with radius 0 a point."""

    _node_type = NODE_TYPE.GEOM_SPHERE

    def __init__(self, radius):
        self.radius = radius

    @property
    def radius(self):
        """[m]."""
        return self._radius

    @radius.setter
    def radius(self, value):
        radius = real("radius", value)
        shape = engine.Sphere(radius) if radius != 0.0 else engine.ConvexHull([[0.0, 0.0, 0.0]])
        self._become([[-radius] * 3, [radius] * 3], shape)
        self._radius = radius


class Ellipsoid(CollisionGeometry):
    """Semi-axes a, b, c along x, y, z."""

    _node_type = NODE_TYPE.GEOM_ELLIPSOID

    def __init__(self, a, b, c):
        self.radii = np.array([real(name, length) for name, length in zip("abc", (a, b, c))])

    @property
    def radii(self):
        """Semi-axes (3,) [m]."""
        return self._radii.copy()

    @radii.setter
    def radii(self, value):
        radii = shaped("radii", value, (3,)).copy()
        self._become([-radii, radii], engine.Ellipsoid(radii))
        self._radii = radii


class _Round(CollisionGeometry):
    """What a radius and a length along z make."""

    _kind: type
    _has_caps = False

    def __init__(self, radius, lz):
        self._make(radius, lz)

    def _make(self, radius, lz) -> None:
        radius, lz = real("radius", radius), real("lz", lz)
        half = np.array([radius, radius, 0.5 * lz + (radius if self._has_caps else 0.0)])
        self._become([-half, half], self._kind(radius, lz))
        self._radius, self._lz = radius, lz

    radius = property(lambda self: self._radius, lambda self, value: self._make(value, self._lz), doc="[m].")
    lz = property(lambda self: self._lz, lambda self, value: self._make(self._radius, value), doc="[m].")


class Capsule(_Round):
    """A capsule along z; ``lz`` is the length of its axis without the caps."""

    _node_type, _kind, _has_caps = NODE_TYPE.GEOM_CAPSULE, engine.Capsule, True


class Cone(_Round):
    """A cone along z, its apex at +lz/2."""

    _node_type, _kind = NODE_TYPE.GEOM_CONE, engine.Cone


class Cylinder(_Round):
    """A cylinder along z."""

    _node_type, _kind = NODE_TYPE.GEOM_CYLINDER, engine.Cylinder


class Convex(CollisionGeometry):
    """The convex hull of some vertices, a solid.

    vertices : (n, 3) [m].   num_faces : how many faces there are.   faces : flat, each led by the number of its
    corners, as python-fcl has them; they are checked for their count, and the hull is that of the vertices.
    """

    _node_type = NODE_TYPE.GEOM_CONVEX

    def __init__(self, vertices, num_faces, faces):
        points = rows_of_three("vertices", vertices)
        self._become([points.min(axis=0), points.max(axis=0)], engine.ConvexHull(points))
        self._num_faces = _checked_faces(faces, num_faces, len(points))

    @property
    def num_faces(self):
        """How many faces there are."""
        return self._num_faces


def _checked_faces(faces, num_faces, n_points: int) -> int:
    """How many faces a flat list holds, each led by the number of its corners. Raises InvalidArgument."""
    values, num_faces = checks.whole_numbers("Convex: faces", faces), whole("Convex: num_faces", num_faces)
    width = int(values[0]) + 1 if len(values) else 0
    if width > 3 and len(values) == width * num_faces:  # as a rule all are alike
        rows = values.reshape(-1, width)
        if (rows[:, 0] == width - 1).all() and rows[:, 1:].min() >= 0 and rows[:, 1:].max() < n_points:
            return len(rows)
    flat, at, count = values.tolist(), 0, 0
    while at < len(flat):
        corners = flat[at + 1 : at + 1 + flat[at]]
        if flat[at] < 3 or len(corners) != flat[at] or not all(0 <= k < n_points for k in corners):
            raise InvalidArgument(
                f"Convex: face {count} is {flat[at : at + 6]} …: faces are flat, [3, i, j, k, …], each led by the "
                f"number of its corners, and there are {n_points} vertices"
            )
        at, count = at + 1 + flat[at], count + 1
    if count != num_faces:
        raise InvalidArgument(f"Convex: num_faces is {num_faces}, but faces holds {count}")
    return count


class _Flat(CollisionGeometry):
    """What a normal and an offset make; the normal is brought to length 1, and the offset with it."""

    def __init__(self, n, d):
        self._set(n, d)

    def _set(self, n, d) -> None:
        n, d = shaped("n", n, (3,)), real("d", d)
        length = float(np.linalg.norm(n))
        if not 0.0 < length < np.inf:
            raise InvalidArgument(f"{type(self).__name__}: n must be finite and not 0, got {n.tolist()}")
        self._n, self._d = (n / length, d / length) if length != 1.0 else (n.copy(), d)
        self._become([[-np.inf] * 3, [np.inf] * 3], *self._sides(self._n, self._d))
        self._center = self._n * self._d

    #: The half-spaces of a normal and an offset, of each kind its own.
    _sides: Callable[..., tuple[Shape, ...]]

    n = property(lambda self: self._n.copy(), lambda self, value: self._set(value, self._d), doc="Unit normal (3,).")
    d = property(lambda self: self._d, lambda self, value: self._set(self._n, value), doc="Offset along n [m].")


class Halfspace(_Flat):
    """The solid {x : n·x ≤ d}."""

    _node_type = NODE_TYPE.GEOM_HALFSPACE

    def _sides(self, n, d):
        return (engine.Halfspace(n, d),)


class Plane(_Flat):
    """The plane {x : n·x = d}: what its two half-spaces share."""

    _node_type = NODE_TYPE.GEOM_PLANE

    def _sides(self, n, d):
        return engine.Halfspace(n, d), engine.Halfspace(-n, -d)


class CollisionObject(HostObject):
    """A geometry at a pose in the world. Unlike python-fcl's, the object handed to callbacks is this very one.

    geom : any geometry.   tf : a `Transform`, the identity where there is none.   Raises ValueError without a geometry.
    """

    __slots__ = ()

    def __init__(self, geom=None, tf=None, _no_instance=False):
        if geom is not None and not isinstance(geom, CollisionGeometry):
            raise TypeError(f"geom must be a CollisionGeometry, got {type(geom).__name__}")
        if geom is None or geom._node_type is None:
            raise InvalidArgument("CollisionObject needs a geometry, such as Box(1, 1, 1)")
        self._geometry = geom
        self._watchers = ()
        self._X = np.eye(4) if tf is None else _matrix(tf).copy()

    def getObjectType(self):
        """A number of `OBJECT_TYPE`."""
        return self._geometry._object_type

    def getNodeType(self):
        """A number of `NODE_TYPE`."""
        return self._geometry._node_type

    def getTranslation(self):
        """A copy (3,) [m]."""
        return self._X[:3, 3].copy()

    def setTranslation(self, vec):
        """vec : (3,) [m]."""
        self._X[:3, 3] = shaped("vec", vec, (3,))
        for moved in self._watchers:
            moved.add(self)

    def getRotation(self):
        """A copy (3, 3)."""
        return self._X[:3, :3].copy()

    def setRotation(self, mat):
        """mat : (3, 3)."""
        self._X[:3, :3] = shaped("mat", mat, (3, 3))
        self._moved()

    def getQuatRotation(self):
        """(4,) w, x, y, z."""
        return quaternion_of(self._X[:3, :3])

    def setQuatRotation(self, q):
        """q : (4,) w, x, y, z."""
        self._X[:3, :3] = rotation_of(shaped("q", q, (4,)))
        self._moved()

    def getTransform(self):
        """A `Transform` of its own."""
        return Transform(self._X[:3, :3], self._X[:3, 3])

    def setTransform(self, tf):
        """tf : a `Transform`."""
        self._X[:] = _matrix(tf)
        self._moved()

    def isOccupied(self):
        """True: there are no free or uncertain geometries here."""
        return True

    def isFree(self):
        """False, as `isOccupied` is True."""
        return False

    def isUncertain(self):
        """False, as `isOccupied` is True."""
        return False


def _matrix(tf) -> np.ndarray:
    if not isinstance(tf, Transform):
        raise TypeError(f"tf must be a Transform, got {type(tf).__name__}")
    return tf._X
