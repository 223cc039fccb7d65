"""Geoms of a compiled MuJoCo model as shapes.

Planes are half-spaces, height fields reach down to their base, as in MuJoCo. MuJoCo keeps vertices and heights in
single precision, meshes in their frames of inertia: those numbers are taken as they are.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from collide.scenes.loaders.mesh_file import part_of_arrays
from collide.scenes.loaders.mesh_shapes import Taken, part_shape
from collide.shapes.height_field import HeightField
from collide.shapes.primitives import Box, Capsule, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import Shape
from collide.transforms import pose

#: Kinds of geoms (mjtGeom) that collide, as a compiled model numbers them.
GEOM_KINDS = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
PLANE, FIELD, MESH, SDF = (GEOM_KINDS.index(kind) for kind in ("plane", "hfield", "mesh", "sdf"))


def shape_of(model, geom: int) -> Shape:
    """The shape of a geom that is no mesh and no signed distance field, in its own frame.

    Raises InvalidShape where its numbers make none.
    """
    size = [float(length) for length in model.geom_size[geom]]
    name = GEOM_KINDS[int(model.geom_type[geom])]
    if name == "plane":
        return Halfspace((0.0, 0.0, 1.0), 0.0)
    if name == "sphere":
        return Sphere(size[0])
    if name == "capsule":
        return Capsule(size[0], 2.0 * size[1])
    if name == "cylinder":
        return Cylinder(size[0], 2.0 * size[1])
    if name == "ellipsoid":
        return Ellipsoid(size)
    if name == "box":
        return Box([2.0 * length for length in size])
    return _height_field(model, int(model.geom_dataid[geom]))


def _height_field(model, field: int) -> HeightField:
    n_rows, n_columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    first = int(model.hfield_adr[field])
    x, y, z, base = model.hfield_size[field].tolist()
    heights = z * np.array(model.hfield_data[first : first + n_rows * n_columns], dtype=np.float64)
    cell = 2.0 * x / (n_columns - 1), 2.0 * y / (n_rows - 1)
    return HeightField(heights.reshape(n_rows, n_columns), cell, bottom=-base)


def pose_of(model, geom: int) -> np.ndarray:
    """(4, 4) X_BG of a geom in its body, as MuJoCo's kinematics has it.

    MuJoCo takes a frame that is the body's, or its frame of inertia, but for a millionth, for that frame.
    """
    import mujoco

    same, body = mujoco.mjtSameFrame, int(model.geom_bodyid[geom])
    shared, of_inertia = same(int(model.geom_sameframe[geom])), same(int(model.body_sameframe[body]))
    X_BG = pose(model.geom_pos[geom], quat_wxyz=model.geom_quat[geom])
    if shared in (same.mjSAMEFRAME_BODY, same.mjSAMEFRAME_BODYROT):
        X_BG[:3, :3] = np.eye(3)
    elif shared in (same.mjSAMEFRAME_INERTIA, same.mjSAMEFRAME_INERTIAROT):
        is_turned = of_inertia not in (same.mjSAMEFRAME_BODY, same.mjSAMEFRAME_BODYROT)
        X_BG[:3, :3] = pose(quat_wxyz=model.body_iquat[body])[:3, :3] if is_turned else np.eye(3)
    if shared == same.mjSAMEFRAME_BODY:
        X_BG[:3, 3] = 0.0
    elif shared == same.mjSAMEFRAME_INERTIA:
        X_BG[:3, 3] = model.body_ipos[body] if of_inertia != same.mjSAMEFRAME_BODY else 0.0
    return X_BG


def mesh_arrays(model, mesh: int) -> tuple[np.ndarray, np.ndarray]:
    """((n, 3) vertices, (m, 3) facets) of a mesh, as MuJoCo holds them."""
    first, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, m = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    vertices = np.array(model.mesh_vert[first : first + n], dtype=np.float64)
    return vertices, np.array(model.mesh_face[face : face + m], dtype=np.int64)


def mesh_shapes(model, meshes: str, path, used: Iterable[int]) -> dict[int, Taken]:
    """Number of a mesh → what it becomes, of the meshes that are used.

    meshes : "mesh", "hull" or "pieces".   path : of the file, for messages. Raises SceneError, InvalidShape.
    """
    taken = {}
    for mesh in sorted(set(used)):
        name = model.mesh(mesh).name or f"mesh {mesh}"
        taken[mesh] = part_shape(part_of_arrays(name, *mesh_arrays(model, mesh), meshes, path), 1.0, f"{path}: {name}")
    return taken
