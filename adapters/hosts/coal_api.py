"""coal on collide: ``import collide.adapters.hosts.coal_api as coal``, or `install` for programs that import coal.

Names, defaults, fields and signs are those of coal 3.0.3, measured; hppfcl's old names are there, too. Shapes are made
of full lengths; contact normals point from ``o1`` to ``o2``; distances are below 0 where bodies overlap; meshes are
surfaces, `Convex` and height fields are solids; contacts collect over calls of `collide`. docs/hosts.md says what is
different, and why.
"""

from __future__ import annotations

import sys

from collide.adapters.hosts.coal_containers import (
    AABB,
    StdVec_CollisionRequest,
    StdVec_CollisionResult,
    StdVec_Contact,
    StdVec_ContactPatch,
    StdVec_ContactPatchRequest,
    StdVec_ContactPatchResult,
    StdVec_DistanceRequest,
    StdVec_DistanceResult,
    StdVec_Triangle,
    StdVec_Vec3s,
    StdVec_Vec6,
    Triangle,
    rotate,
    translate,
)
from collide.adapters.hosts.coal_enums import (
    MEMBERS,
    NODE_TYPE,
    OBJECT_TYPE,
    BVHBuildState,
    BVHModelType,
    CollisionRequestFlag,
    ContactPatchDirection,
    GJKConvergenceCriterion,
    GJKConvergenceCriterionType,
    GJKInitialGuess,
    GJKStatus,
    GJKVariant,
)
from collide.adapters.hosts.coal_geometry import (
    Box,
    Capsule,
    CollisionGeometry,
    CollisionObject,
    Cone,
    Cylinder,
    Ellipsoid,
    Halfspace,
    Plane,
    ShapeBase,
    Sphere,
    TriangleP,
)
from collide.adapters.hosts.coal_managers import (
    BroadPhaseCollisionManager,
    CollisionCallBackBase,
    CollisionCallBackCollect,
    CollisionCallBackDefault,
    DistanceCallBackBase,
    DistanceCallBackDefault,
    DynamicAABBTreeArrayCollisionManager,
    DynamicAABBTreeCollisionManager,
    IntervalTreeCollisionManager,
    NaiveCollisionManager,
    SaPCollisionManager,
    SpatialHashingCollisionManager,
    SSaPCollisionManager,
)
from collide.adapters.hosts.coal_meshes import (
    BVHModelBase,
    BVHModelOBB,
    BVHModelOBBRSS,
    Convex,
    ConvexBase,
)
from collide.adapters.hosts.coal_patches import (
    ComputeContactPatch,
    computeContactPatch,
)
from collide.adapters.hosts.coal_queries import (
    ComputeCollision,
    ComputeDistance,
    collide,
    distance,
)
from collide.adapters.hosts.coal_requests import (
    CollisionData,
    CollisionRequest,
    CollisionResult,
    Contact,
    ContactPatch,
    ContactPatchRequest,
    ContactPatchResult,
    CPUTimes,
    DistanceData,
    DistanceRequest,
    DistanceResult,
    QueryRequest,
    QueryResult,
)
from collide.adapters.hosts.coal_terrain import (
    CachedMeshLoader,
    HeightFieldAABB,
    HeightFieldOBBRSS,
    MeshLoader,
    OcTree,
    makeOctree,
)
from collide.adapters.hosts.coal_transform import (
    AngleAxis,
    Quaternion,
    Transform3s,
)
from collide.adapters.hosts.stand_in import StandIn
from collide.errors import CollideError, UnsupportedQuery

#: The release whose interface this is.
__version__ = __raw_version__ = "3.0.3"
COAL_MAJOR_VERSION, COAL_MINOR_VERSION, COAL_PATCH_VERSION = 3, 0, 3
WITH_QHULL, WITH_OCTOMAP = False, True
#: Names of hpp-fcl.
Transform3f, StdVec_Vec3f = Transform3s, StdVec_Vec3s
#: Every error of collide is one.
Exception = CollideError

globals().update(MEMBERS)

__all__ = [
    "AABB", "AngleAxis", "BVHBuildState", "BVHModelBase", "BVHModelOBB", "BVHModelOBBRSS", "BVHModelType", "Box",
    "BroadPhaseCollisionManager", "COAL_MAJOR_VERSION", "COAL_MINOR_VERSION", "COAL_PATCH_VERSION", "CPUTimes",
    "CachedMeshLoader", "Capsule", "CollisionCallBackBase", "CollisionCallBackCollect", "CollisionCallBackDefault",
    "CollisionData", "CollisionGeometry", "CollisionObject", "CollisionRequest", "CollisionRequestFlag",
    "CollisionResult", "ComputeCollision", "ComputeContactPatch", "ComputeDistance", "Cone", "Contact",
    "ContactPatch", "ContactPatchDirection", "ContactPatchRequest", "ContactPatchResult", "Convex", "ConvexBase",
    "Cylinder", "DistanceCallBackBase", "DistanceCallBackDefault", "DistanceData", "DistanceRequest",
    "DistanceResult", "DynamicAABBTreeArrayCollisionManager", "DynamicAABBTreeCollisionManager", "Ellipsoid",
    "Exception", "GJK", "GJKConvergenceCriterion", "GJKConvergenceCriterionType", "GJKInitialGuess", "GJKStatus",
    "GJKVariant", "Halfspace", "HeightFieldAABB", "HeightFieldOBBRSS", "IntervalTreeCollisionManager", "MeshLoader",
    "MinkowskiDiff", "NODE_TYPE", "NaiveCollisionManager", "OBJECT_TYPE", "OcTree", "Plane", "Quaternion",
    "QueryRequest", "QueryResult", "SSaPCollisionManager", "SaPCollisionManager", "ShapeBase",
    "SpatialHashingCollisionManager", "Sphere", "StdVec_CollisionRequest", "StdVec_CollisionResult",
    "StdVec_Contact", "StdVec_ContactPatch", "StdVec_ContactPatchRequest", "StdVec_ContactPatchResult",
    "StdVec_DistanceRequest", "StdVec_DistanceResult", "StdVec_Triangle", "StdVec_Vec3f", "StdVec_Vec3s",
    "StdVec_Vec6", "Transform3f", "Transform3s", "Triangle", "TriangleP", "WITH_OCTOMAP", "WITH_QHULL",
    "__raw_version__", "__version__", "checkVersionAtLeast", "checkVersionAtMost", "collide", "computeContactPatch",
    "distance", "install", "installed", "makeOctree", "rotate", "seed", "sharedMemory", "translate", "uninstall",
]
__all__.extend(MEMBERS)


def checkVersionAtLeast(major, minor, patch):
    """Whether coal 3.0.3 is at least that."""
    return (3, 0, 3) >= (major, minor, patch)


def checkVersionAtMost(major, minor, patch):
    """Whether coal 3.0.3 is at most that."""
    return (3, 0, 3) <= (major, minor, patch)


def seed(seed_value):
    """Nothing to do: answers have no chance in them."""


def sharedMemory(value=None):
    """False: arrays that are returned are copies. Setting it has no effect."""
    return False if value is None else None


class _LowLevel:
    """What stands inside of coal's search has no counterpart here."""

    def __init__(self, *args):
        name = type(self).__name__
        raise UnsupportedQuery(f"{name} is a part of coal's own search: use collide, distance or ComputeDistance")


class GJK(_LowLevel):
    """Refused."""


class MinkowskiDiff(_LowLevel):
    """Refused."""


_this = sys.modules[__name__]
_stand_in = StandIn({"coal": _this, "coal.coal_pywrap": _this, "hppfcl": _this, "hppfcl.hppfcl": _this}, ("pinocchio",))


def install() -> StandIn:
    """Let ``import coal`` and ``import hppfcl`` find this module, until `uninstall`, or to the end of a ``with`` block.

    Returns
    -------
    context manager
        Its value is this module. Installing twice is as once.

    Notes
    -----
    Modules that imported coal before keep it: a RuntimeWarning names them. Pinocchio is built on coal's own objects: it
    is imported with coal itself, before or after, and `collide.adapters.hosts.pinocchio` answers its pairs.
    """
    return _stand_in.install()


def uninstall() -> None:
    """Put back what ``import coal`` found before `install`; modules that hold this one keep it."""
    _stand_in.uninstall()


def installed() -> bool:
    """Whether ``import coal`` finds this module."""
    return _stand_in.installed


def check() -> str:
    """Install, ask one pair of what ``import coal`` finds, uninstall: one line for `collide doctor`.

    Raises
    ------
    RuntimeError : what does not hold.
    """
    return _stand_in.check(_gap_of_two)


def _gap_of_two(coal) -> float:
    return coal.distance(
        coal.Sphere(0.5), coal.Transform3s(), coal.Box(1, 1, 1), coal.Transform3s([2.0, 0.0, 0.0]),
        coal.DistanceRequest(), coal.DistanceResult(),
    )
