"""What was said to pybullet and is not given back: shapes as createCollisionShape made them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from collide.adapters.hosts.bullet_shapes import obj_groups
from collide.adapters.hosts.host_numbers import shaped
from collide.adapters.hosts.quaternion_poses import pose_of
from collide.scenes.loaders.mesh_file import read_mesh
from collide.shapes import Box, Capsule, Compound, ConvexHull, Cylinder, Halfspace, Mesh, Shape, Sphere
from collide.transforms import inverse_pose

SHAPE_ARGUMENTS = (
    "shapeType", "radius", "halfExtents", "height", "fileName", "meshScale", "planeNormal", "flags",
    "collisionFramePosition", "collisionFrameOrientation", "vertices", "indices", "heightfieldTextureScaling",
    "heightfieldData", "numHeightfieldRows", "numHeightfieldColumns", "replaceHeightfieldIndex", "physicsClientId",
)
BODY_ARGUMENTS = (
    "baseMass", "baseCollisionShapeIndex", "baseVisualShapeIndex", "basePosition", "baseOrientation",
    "baseInertialFramePosition", "baseInertialFrameOrientation", "linkMasses", "linkCollisionShapeIndices",
    "linkVisualShapeIndices", "linkPositions", "linkOrientations", "linkInertialFramePositions",
    "linkInertialFrameOrientations", "linkParentIndices", "linkJointTypes", "linkJointAxis", "useMaximalCoordinates",
    "flags", "batchPositions", "physicsClientId",
)
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def named(names: tuple[str, ...], values: tuple, keywords: dict) -> dict[str, Any]:
    """Arguments of a call by name."""
    return dict(zip(names, values)) | keywords


def shape_of_arguments(pybullet: Any, arguments: dict[str, Any]) -> Shape | None:
    """The shape that createCollisionShape makes, in the frame of the body's link; None where that is not known."""
    kind = arguments["shapeType"]
    radius, height = arguments.get("radius", 0.5), arguments.get("height", 1.0)
    shape: Shape | None = None
    if kind == pybullet.GEOM_SPHERE:
        shape = Sphere(radius)
    elif kind == pybullet.GEOM_BOX:
        shape = Box(2.0 * shaped("halfExtents", arguments.get("halfExtents", (1, 1, 1)), (3,)))
    elif kind == pybullet.GEOM_CAPSULE:
        shape = Capsule(radius, height)
    elif kind == pybullet.GEOM_CYLINDER:
        shape = Cylinder(radius, height)
    elif kind == pybullet.GEOM_PLANE:
        shape = Halfspace(arguments.get("planeNormal", (0, 0, 1)), 0.0)
    elif kind == pybullet.GEOM_MESH:
        shape = _mesh(pybullet, arguments)
    elif kind == pybullet.GEOM_HEIGHTFIELD and arguments.get("heightfieldData"):
        shape = _terrain(arguments)
    if shape is None or isinstance(shape, Halfspace):
        return shape
    X = pose_of(
        arguments.get("collisionFramePosition", (0, 0, 0)), arguments.get("collisionFrameOrientation", _UPRIGHT)
    )
    return moved(shape, X)


def moved(shape: Shape, X: np.ndarray) -> Shape:
    """The shape at a pose (4, 4) of its frame."""
    return shape if (X == np.eye(4)).all() else Compound([(shape, X)])


def inertial_frames(arguments: dict[str, Any]) -> dict[int, tuple[int, np.ndarray]]:
    """{link: (number of its shape, (4, 4) pose of the link's frame in its centre of mass's)} of createMultiBody."""
    shapes = [arguments.get("baseCollisionShapeIndex", -1), *(arguments.get("linkCollisionShapeIndices") or ())]
    positions = [
        arguments.get("baseInertialFramePosition", (0, 0, 0)),
        *(arguments.get("linkInertialFramePositions") or ()),
    ]
    orientations = [
        arguments.get("baseInertialFrameOrientation", _UPRIGHT), *(arguments.get("linkInertialFrameOrientations") or ())
    ]
    return {
        k - 1: (shape, inverse_pose(pose_of(position, orientation)))
        for k, (shape, position, orientation) in enumerate(zip(shapes, positions, orientations))
        if shape >= 0
    }


def _mesh(pybullet: Any, arguments: dict[str, Any]) -> Shape | None:
    scale = shaped("meshScale", arguments.get("meshScale", (1, 1, 1)), (3,))
    concave = bool(arguments.get("flags", 0) & pybullet.GEOM_FORCE_CONCAVE_TRIMESH)
    if arguments.get("vertices") is not None and len(arguments["vertices"]):
        points = np.array(arguments["vertices"], dtype=np.float64) * scale
        if arguments.get("indices") is None or not len(arguments["indices"]):
            return ConvexHull(points)
        return Mesh(points, np.array(arguments["indices"], dtype=np.int64).reshape(-1, 3), solid=False)
    path = Path(arguments.get("fileName", ""))
    if not path.is_file():
        return None  # pybullet looks in folders of its own, too
    if path.suffix.lower() == ".obj" and not concave:
        return Compound([(ConvexHull(group * scale), np.eye(4)) for group in obj_groups(path)])
    parts = [part for part in read_mesh(path).parts if part.facets is not None]
    points = np.concatenate([part.points for part in parts]) * scale
    if not concave:
        return ConvexHull(points)
    first = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    return Mesh(points, np.concatenate([part.facets + n for part, n in zip(parts, first)]), solid=False)


def _terrain(arguments: dict[str, Any]) -> Mesh:
    """Bullet's height field: its middle at the origin, both across and in height, each cell parted from x to y."""
    nx, ny = arguments["numHeightfieldRows"], arguments["numHeightfieldColumns"]
    heights = np.array(arguments["heightfieldData"], dtype=np.float64).reshape(ny, nx)
    heights = heights - 0.5 * (heights.min() + heights.max())
    x, y = np.meshgrid(np.arange(nx) - 0.5 * (nx - 1), np.arange(ny) - 0.5 * (ny - 1))
    points = np.stack([x, y, heights], axis=2).reshape(-1, 3) * np.array(arguments.get("meshScale", (1, 1, 1)))
    corner = (np.arange(nx - 1)[None, :] + nx * np.arange(ny - 1)[:, None]).ravel()
    facets = [(corner, corner + 1, corner + nx), (corner + 1, corner + nx + 1, corner + nx)]
    return Mesh(points, np.concatenate([np.stack(facet, axis=1) for facet in facets]), solid=False)
