"""coal's primitive shapes and `CollisionObject`, made of those of python-fcl's interface: coal is a fork of FCL.

Lengths are [m]; ``halfSide`` and ``halfLength`` are halves of full lengths. A swept-sphere radius is added to the
margin of a query: shapes grown by r are as far apart as the shapes less r.
"""

from __future__ import annotations

import copy
import math

import numpy as np

from collide.adapters.hosts import coal_inertia, fcl_geometry
from collide.adapters.hosts.coal_containers import AABB
from collide.adapters.hosts.coal_enums import NODE_TYPE, OBJECT_TYPE
from collide.adapters.hosts.coal_inertia import MassProperties
from collide.adapters.hosts.coal_transform import Transform3s, rotation_matrix
from collide.adapters.hosts.fcl_transform import Transform
from collide.adapters.hosts.host_numbers import real, shaped
from collide.errors import InvalidArgument, brief
from collide.shapes.shape import Shape


class CollisionGeometry(fcl_geometry.CollisionGeometry):
    """Base of all geometries; of itself it has no points.

    ``cost_density``, ``threshold_occupied`` and ``threshold_free`` have no effect on queries.
    """

    _node_type, _object_type = NODE_TYPE.BV_UNKNOWN, OBJECT_TYPE.OT_UNKNOWN
    #: Radius of the ball that is swept over the shape [m].
    _radius_swept = 0.0
    #: Whether facets or boxes of it are told apart in contacts.
    _has_parts = False

    def __init__(self):
        raise RuntimeError(f"{type(self).__name__} cannot be instantiated: it is a base class")

    cost_density, threshold_occupied, threshold_free = 1.0, 1.0, 0.0

    def getObjectType(self):
        """An `OBJECT_TYPE`."""
        return self._object_type

    @property
    def aabb_local(self):
        """The `AABB` around it in its frame."""
        box, corners = AABB(), self._bounds()
        box.min_, box.max_ = corners[0].copy(), corners[1].copy()
        return box

    @property
    def aabb_center(self):
        """Middle (3,) of that box; of planes and half-spaces the point nearest to the origin."""
        return self.aabb_local.center() if self._center is None else self._center.copy()

    @aabb_center.setter
    def aabb_center(self, value):
        self._center = shaped("aabb_center", value, (3,)).copy()

    @property
    def aabb_radius(self):
        """Half of its diagonal [m]."""
        corners = self._bounds()
        return 0.5 * float(np.linalg.norm(corners[1] - corners[0]))

    def isOccupied(self):
        """Whether the density is at least the threshold of what counts as occupied."""
        return self.cost_density >= self.threshold_occupied

    def isFree(self):
        """Whether the density is at most the threshold of what counts as free."""
        return self.cost_density <= self.threshold_free

    def isUncertain(self):
        """Whether it is neither."""
        return not (self.isOccupied() or self.isFree())

    def computeVolume(self):
        """[m³]; 0 of what is flat or has no end."""
        return self._mass().volume

    def computeCOM(self):
        """Centre of mass (3,) in its frame [m]."""
        return self._mass().center

    def computeMomentofInertia(self):
        """(3, 3) about the origin of its frame, of density 1."""
        return self._mass().inertia

    def computeMomentofInertiaRelatedToCOM(self):
        """(3, 3) about its centre of mass, of density 1."""
        volume, c, inertia = self._mass()
        return inertia - volume * (float(c @ c) * np.eye(3) - np.outer(c, c))

    def clone(self):
        """A copy that can be changed by itself."""
        return copy.copy(self)

    def __copy__(self):
        made = object.__new__(type(self))
        for name, value in vars(self).items():
            made.__dict__[name] = value.copy() if isinstance(value, (np.ndarray, list)) else value
        return made

    def __eq__(self, other):
        return (
            type(self) is type(other) and self._radius_swept == other._radius_swept and self._shapes == other._shapes
        )

    __hash__ = object.__hash__

    def _bounds(self) -> np.ndarray:
        """Lowest and highest corner (2, 3)."""
        if self._corners is None:
            raise InvalidArgument(f"{type(self).__name__} has no points yet")
        return self._corners

    def _mass(self) -> MassProperties:
        return coal_inertia.flat()

    def _pieces(self) -> list[tuple[Shape, np.ndarray | None]]:
        """Connected shapes whose union it is, and which facets of the whole theirs are."""
        return [(self._shape, None)]

    def _become(self, corners, *shapes: Shape) -> None:
        """Takes its shapes; corners : (2, 3) of the box around them, without the swept radius."""
        grown = np.array([[-self._radius_swept], [self._radius_swept]])
        super()._become(np.asarray(corners, dtype=np.float64) + grown, *shapes)


class ShapeBase(CollisionGeometry):
    """Base of all shapes but meshes: a ball may be swept over them."""

    _object_type = OBJECT_TYPE.OT_GEOM

    def getSweptSphereRadius(self):
        """[m]."""
        return self._radius_swept

    def setSweptSphereRadius(self, radius):
        """radius : ≥ 0 [m]. Raises ValueError."""
        radius = real("setSweptSphereRadius: radius", radius)
        if not (math.isfinite(radius) and radius >= 0.0):
            raise InvalidArgument(f"setSweptSphereRadius: radius must be ≥ 0 and finite [m], got {radius}")
        corners = self._bounds() + np.array([[self._radius_swept], [-self._radius_swept]])
        self._radius_swept = radius
        self._become(corners, *self._shapes)


class TriangleP(ShapeBase, fcl_geometry.TriangleP):
    """A triangle with corners a, b, c (3,), a flat convex set. ``TriangleP(a, b, c)`` or ``TriangleP(triangle)``."""

    _node_type = NODE_TYPE.GEOM_TRIANGLE

    def __init__(self, *args):
        if len(args) == 1 and isinstance(args[0], TriangleP):
            args = (args[0].a, args[0].b, args[0].c)
        fcl_geometry.TriangleP.__init__(self, *args)


class Box(ShapeBase, fcl_geometry.Box):
    """A box. ``Box(x, y, z)``, ``Box(lengths)`` with full edge lengths (3,), ``Box(box)``."""

    _node_type = NODE_TYPE.GEOM_BOX

    def __init__(self, *args):
        if len(args) == 1:
            args = args[0].side if isinstance(args[0], Box) else shaped("side", args[0], (3,))
        fcl_geometry.Box.__init__(self, *args)

    @property
    def halfSide(self):
        """Half the edge lengths (3,) [m]."""
        return 0.5 * self._side

    @halfSide.setter
    def halfSide(self, value):
        self.side = 2.0 * shaped("halfSide", value, (3,))

    def _mass(self):
        return coal_inertia.box(self._side)


class Sphere(ShapeBase, fcl_geometry.Sphere):
    """A ball. ``Sphere(radius)`` or ``Sphere(sphere)``."""

    _node_type = NODE_TYPE.GEOM_SPHERE

    def __init__(self, radius):
        fcl_geometry.Sphere.__init__(self, radius.radius if isinstance(radius, Sphere) else radius)

    @property
    def aabb_radius(self):
        """Its radius [m]."""
        return self.radius + self._radius_swept

    def _mass(self):
        return coal_inertia.ellipsoid([self.radius] * 3)


class Ellipsoid(ShapeBase, fcl_geometry.Ellipsoid):
    """Semi-axes along x, y, z. ``Ellipsoid(a, b, c)``, ``Ellipsoid(radii)`` with (3,), ``Ellipsoid(ellipsoid)``."""

    _node_type = NODE_TYPE.GEOM_ELLIPSOID

    def __init__(self, *args):
        if len(args) == 1:
            args = args[0].radii if isinstance(args[0], Ellipsoid) else shaped("radii", args[0], (3,))
        fcl_geometry.Ellipsoid.__init__(self, *args)

    def _mass(self):
        return coal_inertia.ellipsoid(self._radii)


class _Round(ShapeBase, fcl_geometry._Round):
    """What a radius and a full length lz along z make, or another one like it."""

    def __init__(self, radius, lz=None):
        if lz is None and isinstance(radius, type(self)):
            radius, lz = radius.radius, radius.lz
        if lz is None:
            name = type(self).__name__
            raise TypeError(f"{name}(radius, lz), with the full length, or {name}({name.lower()})")
        fcl_geometry._Round.__init__(self, radius, lz)

    @property
    def halfLength(self):
        """Half of the length along z [m]."""
        return 0.5 * self._lz

    @halfLength.setter
    def halfLength(self, value):
        self.lz = 2.0 * real("halfLength", value)


class Capsule(_Round, fcl_geometry.Capsule):
    """A capsule along z; the length is that of its axis, without the caps."""

    _node_type = NODE_TYPE.GEOM_CAPSULE

    def _mass(self):
        return coal_inertia.capsule(self._radius, self._lz)


class Cone(_Round, fcl_geometry.Cone):
    """A cone along z, its apex above."""

    _node_type = NODE_TYPE.GEOM_CONE

    def _mass(self):
        return coal_inertia.cone(self._radius, self._lz)


class Cylinder(_Round, fcl_geometry.Cylinder):
    """A cylinder along z."""

    _node_type = NODE_TYPE.GEOM_CYLINDER

    def _mass(self):
        return coal_inertia.cylinder(self._radius, self._lz)


class _Flat(ShapeBase, fcl_geometry._Flat):
    """``(n, d)``, ``(a, b, c, d)`` with the coefficients of n, another one like it, or nothing: n = x, d = 0."""

    def __init__(self, *args):
        if not args:
            args = ((1.0, 0.0, 0.0), 0.0)
        elif len(args) == 1 and isinstance(args[0], _Flat):
            args = (args[0].n, args[0].d)
        elif len(args) == 4:
            args = (args[:3], args[3])
        fcl_geometry._Flat.__init__(self, *args)


class Halfspace(_Flat, fcl_geometry.Halfspace):
    """The solid {x : n·x ≤ d}; n is brought to length 1, and d with it."""

    _node_type = NODE_TYPE.GEOM_HALFSPACE


class Plane(_Flat, fcl_geometry.Plane):
    """The plane {x : n·x = d}; n is brought to length 1, and d with it."""

    _node_type = NODE_TYPE.GEOM_PLANE


class CollisionObject(fcl_geometry.CollisionObject):
    """A geometry at a pose in the world; the object handed to callbacks is this very one.

    ``CollisionObject(geometry)``, ``CollisionObject(geometry, transform)``, ``CollisionObject(geometry, R, t)``; a bool
    behind these, whether to compute the geometry's box, has no effect: boxes are always there.
    """

    __slots__ = ()

    def __init__(self, cgeom, *pose):
        self._geometry = checked_geometry("cgeom", cgeom)
        self._watchers = ()
        self._X = np.eye(4)
        if pose and isinstance(pose[-1], (bool, np.bool_)):
            pose = pose[:-1]
        if pose:
            self.setTransform(*pose)

    def collisionGeometry(self):
        """The geometry, the very object."""
        return self._geometry

    def setCollisionGeometry(self, collision_geometry, compute_local_aabb=True):
        """Put another geometry in its place."""
        g = self._geometry = checked_geometry("collision_geometry", collision_geometry)
        fcl_geometry.CollisionGeometry._become(g, g._bounds(), *g._shapes)  # so that managers look at boxes anew

    def getTransform(self):
        """A `Transform3s` of its own."""
        return Transform3s(self._X)

    def setTransform(self, tf, T=None):
        """tf : a `Transform3s`, or a rotation with the translation T (3,) [m]."""
        if T is not None:
            self._X[:3, :3], self._X[:3, 3] = rotation_matrix(tf), shaped("T", T, (3,))
        else:
            self._X[:] = pose_of("tf", tf)
        self._moved()

    def setIdentityTransform(self):
        """Where the world's origin is."""
        self._X[:] = np.eye(4)
        self._moved()

    def isIdentityTransform(self):
        """Whether it is there, exactly."""
        return bool((self._X == np.eye(4)).all())

    def getAABB(self):
        """The `AABB` around it in the world."""
        corners = self._geometry._bounds()
        box = AABB()
        if np.isfinite(corners).all():
            reach = np.abs(self._X[:3, :3]) @ (0.5 * (corners[1] - corners[0]))
            middle = self._X[:3, :3] @ (0.5 * (corners[0] + corners[1])) + self._X[:3, 3]
            box.min_, box.max_ = middle - reach, middle + reach
        else:
            box.min_, box.max_ = corners.copy()
        return box

    def computeAABB(self):
        """Nothing to do: boxes are always those of the object as it is."""


def checked_geometry(name: str, value) -> CollisionGeometry:
    """A geometry as given. Raises TypeError."""
    if not isinstance(value, CollisionGeometry):
        raise TypeError(f"{name} must be a CollisionGeometry of this module, such as Box(1, 1, 1), got {brief(value)}")
    return value


def pose_of(name: str, value) -> np.ndarray:
    """The pose (4, 4) of a transform, the very array. Raises TypeError."""
    if not isinstance(value, Transform):
        raise TypeError(f"{name} must be a Transform3s, got {type(value).__name__}")
    return value._X
