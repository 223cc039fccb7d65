"""python-fcl on collide: ``import collide.adapters.hosts.fcl_api as fcl``, or `install` for programs that import fcl.

Names, defaults, fields and conventions are those of python-fcl 0.7, measured: quaternions w, x, y, z; full lengths;
contact normals from ``o1`` to ``o2``; depths positive; −1 for the distance of objects that meet, without
``enable_signed_distance``; meshes are surfaces, `Convex` is a solid; results collect over calls. docs/hosts.md says
what is different, and why.
"""

from __future__ import annotations

import sys

from collide.adapters.hosts import fcl_requests
from collide.adapters.hosts.fcl_geometry import (
    Box,
    Capsule,
    CollisionGeometry,
    CollisionObject,
    Cone,
    Convex,
    Cylinder,
    Ellipsoid,
    Halfspace,
    Plane,
    Sphere,
    TriangleP,
)
from collide.adapters.hosts.fcl_managers import DynamicAABBTreeCollisionManager
from collide.adapters.hosts.fcl_meshes import BVHModel, OcTree
from collide.adapters.hosts.fcl_queries import (
    collide,
    continuousCollide,
    defaultCollisionCallback,
    defaultDistanceCallback,
    distance,
)
from collide.adapters.hosts.fcl_requests import (
    NODE_TYPE,
    OBJECT_TYPE,
    CCDMotionType,
    CCDSolverType,
    CollisionData,
    CollisionRequest,
    CollisionResult,
    Contact,
    ContinuousCollisionRequest,
    ContinuousCollisionResult,
    CostSource,
    DistanceData,
    DistanceRequest,
    DistanceResult,
    GJKSolverType,
)
from collide.adapters.hosts.fcl_transform import Transform
from collide.adapters.hosts.stand_in import StandIn

#: The release whose interface this is.
__version__ = "0.7.0.11"

__all__ = [
    "BVHModel", "Box", "CCDMotionType", "CCDSolverType", "Capsule", "CollisionData", "CollisionGeometry",
    "CollisionObject", "CollisionRequest", "CollisionResult", "Cone", "Contact", "ContinuousCollisionRequest",
    "ContinuousCollisionResult", "Convex", "CostSource", "Cylinder", "DistanceData", "DistanceRequest",
    "DistanceResult", "DynamicAABBTreeCollisionManager", "Ellipsoid", "GJKSolverType", "Halfspace", "NODE_TYPE",
    "OBJECT_TYPE", "OcTree", "Plane", "Sphere", "Transform", "TriangleP", "__version__", "collide",
    "continuousCollide", "defaultCollisionCallback", "defaultDistanceCallback", "distance",
]

_stand_in = StandIn({
    "fcl": sys.modules[__name__], "fcl.fcl": sys.modules[__name__], "fcl.collision_data": fcl_requests,
})


def install() -> StandIn:
    """Let ``import fcl`` find this module, until `uninstall`, or to the end of a ``with`` block.

    Returns
    -------
    context manager
        Its value is this module. Installing twice is as once.

    Notes
    -----
    Modules that imported python-fcl before keep it: a RuntimeWarning names them. trimesh looks for fcl when
    ``trimesh.collision`` is imported, and goes on without where that fails.
    """
    return _stand_in.install()


def uninstall() -> None:
    """Put back what ``import fcl`` found before `install`; modules that hold this one keep it."""
    _stand_in.uninstall()


def installed() -> bool:
    """Whether ``import fcl`` finds this module."""
    return _stand_in.installed


def check() -> str:
    """Install, ask one pair of what ``import fcl`` finds, uninstall: one line for `collide doctor`.

    Raises
    ------
    RuntimeError : what does not hold.
    """
    return _stand_in.check(_gap_of_two)


def _gap_of_two(fcl) -> float:
    ball, box = fcl.CollisionObject(fcl.Sphere(0.5)), fcl.CollisionObject(fcl.Box(1, 1, 1))
    box.setTranslation([2.0, 0.0, 0.0])
    return fcl.distance(ball, box)
