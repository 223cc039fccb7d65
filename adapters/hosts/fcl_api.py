"""python-fcl on collide: ``import collide.adapters.hosts.fcl_api as fcl``, or `install` for programs that import fcl.

Names, defaults, fields and conventions are those of python-fcl 0.7, measured: quaternions w, x, y, z; full lengths;
contact normals from ``o1`` to ``o2``; depths positive; −1 for the distance of objects that meet, without
``enable_signed_distance``; meshes are surfaces, `Convex` is a solid; results collect over calls. docs/hosts.md says
what is different, and why.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from types import ModuleType

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

#: The release whose interface this is.
__version__ = "0.7.0.11"

__all__ = [
    "BVHModel", "Box", "CCDMotionType", "CCDSolverType", "Capsule", "CollisionData", "CollisionGeometry",
    "CollisionObject", "CollisionRequest", "CollisionResult", "Cone", "Contact", "ContinuousCollisionRequest",
    "ContinuousCollisionResult", "Convex", "CostSource", "Cylinder", "DistanceData", "DistanceRequest",
    "DistanceResult", "DynamicAABBTreeCollisionManager", "Ellipsoid", "GJKSolverType", "Halfspace", "NODE_TYPE",
    "OBJECT_TYPE", "OcTree", "Plane", "Sphere", "Transform", "TriangleP", "__version__", "collide",
    "continuousCollide", "defaultCollisionCallback", "defaultDistanceCallback", "distance",
]  # fmt: skip

#: What ``sys.modules`` held under python-fcl's names before `install`; None while not installed.
_before: dict[str, ModuleType] | None = None


class _Installed:
    """Leaving the block takes the stand-in away."""

    def __enter__(self) -> ModuleType:
        return sys.modules[__name__]

    def __exit__(self, *exception) -> None:
        uninstall()


def install() -> _Installed:
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
    global _before
    if _before is None:
        _before = {name: module for name, module in sys.modules.items() if name.split(".")[0] == "fcl"}
        for name in _before:
            del sys.modules[name]
        module = sys.modules[__name__]
        sys.modules.update({"fcl": module, "fcl.fcl": module, "fcl.collision_data": fcl_requests})
        holders = _holders(_before.get("fcl"))
        if holders:
            warnings.warn(
                f"these modules hold another fcl already: {', '.join(holders)}; install() before they are imported",
                RuntimeWarning,
                stacklevel=2,
            )
    return _Installed()


def uninstall() -> None:
    """Put back what ``import fcl`` found before `install`; modules that hold this one keep it."""
    global _before
    if _before is None:
        return
    for name in [name for name in sys.modules if name.split(".")[0] == "fcl"]:
        del sys.modules[name]
    sys.modules.update(_before)
    _before = None


def installed() -> bool:
    """Whether ``import fcl`` finds this module."""
    return _before is not None


def check() -> str:
    """Install, ask one pair of what ``import fcl`` finds, uninstall: one line for `collide doctor`.

    Raises
    ------
    RuntimeError : what does not hold.
    """
    before = sys.modules.get("fcl")
    with install() as module:
        fcl = import_module("fcl")
        ball, box = fcl.CollisionObject(fcl.Sphere(0.5)), fcl.CollisionObject(fcl.Box(1, 1, 1))
        box.setTranslation([2.0, 0.0, 0.0])
        gap = fcl.distance(ball, box)
    if fcl is not module or gap != 1.0:
        raise RuntimeError(f"import fcl finds {fcl.__name__}; a ball and a box 1 m apart: {gap!r} m")
    if sys.modules.get("fcl") is not before:
        raise RuntimeError("uninstall() did not put back what import fcl found before")
    return "import fcl finds it, a pair was answered, uninstalled cleanly"


def _holders(former: ModuleType | None) -> list[str]:
    """Modules whose ``fcl`` is python-fcl, or nothing: trimesh's where the import failed."""
    names = []
    for name, module in list(sys.modules.items()):
        held = vars(module).get("fcl", module) if isinstance(module, ModuleType) else module
        if held is not module and (held is former if former is not None else held is None):
            names.append(name)
    return sorted(names)
