"""Scenes written down from live programs of other engines, as files that `collide compare` takes.

    from collide.adapters.fuzzing.recorders import record_coal
    record_coal([gripper, part, table], "scene.json")      # then: collide compare scene.json --engines coal

Only what the engines give back by their public interfaces is read. What has no form in scene files is refused by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from collide.adapters.hosts.bullet_mirror import Mirror
from collide.adapters.hosts.mujoco_geoms import geom_shapes
from collide.errors import InvalidArgument, MissingExtra, UnsupportedQuery
from collide.scenes.description import Scene, SceneBody, free_name
from collide.scenes.loaders.mjcf_pairs import REASONS, filtered, moves
from collide.scenes.write_scene import save
from collide.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere
from collide.transforms import pose


def record_fcl(objects: Iterable[tuple[Any, Any]], path: str | Path, names: Sequence[str] | None = None) -> Scene:
    """Write python-fcl's collision objects as a scene file.

    Parameters
    ----------
    objects : iterable of (fcl.CollisionObject, geometry)
        python-fcl does not give an object's geometry back, so that it stands beside: the fcl.Box, Sphere, Capsule,
        Cylinder, Cone, Ellipsoid or Halfspace that the object was made of, or, since python-fcl gives no vertices
        back, a `collide.Shape` for a Convex (`ConvexHull`) or a BVHModel (`Mesh`).
    path : str or Path
        The scene file, ending in .json.
    names : sequence of str, optional
        Of the objects; by default object_0, object_1, …

    Returns
    -------
    Scene
        What was written.

    Raises
    ------
    UnsupportedQuery
        For a geometry without numbers, naming the object.
    """
    read = [(_of_fcl(geometry, k), pose(o.getTranslation(), R=o.getRotation())) for k, (o, geometry) in
            enumerate(objects)]
    return _saved(read, path, names, "python-fcl")


def record_coal(objects: Iterable[Any], path: str | Path, names: Sequence[str] | None = None) -> Scene:
    """Write coal's collision objects as a scene file.

    Parameters
    ----------
    objects : iterable of coal.CollisionObject
        Of spheres, boxes, capsules, cylinders, cones, ellipsoids, half-spaces, Convex and BVH models. Swept radii of
        points, boxes and hulls are written as those of hulls.
    path : str or Path
        The scene file, ending in .json.
    names : sequence of str, optional
        Of the objects; by default object_0, object_1, …

    Returns
    -------
    Scene
        What was written.

    Raises
    ------
    UnsupportedQuery
        For a geometry that has no form in scene files, naming the object.
    """
    read = [(_of_coal(o.collisionGeometry(), k), pose(o.getTranslation(), R=o.getRotation())) for k, o in
            enumerate(objects)]
    return _saved(read, path, names, "coal")


def record_pybullet(
    path: str | Path, client: int = 0, *, shapes: Mapping[tuple[int, int], Shape] | None = None
) -> Scene:
    """Write all bodies of a pybullet client, with their filters, as a scene file.

    Parameters
    ----------
    path : str or Path
        The scene file, ending in .json.
    client : int
        What ``pybullet.connect`` returned.
    shapes : mapping of (body, link) to Shape, optional
        For links whose shapes pybullet does not give back: height fields, meshes of triangles made from arrays.

    Returns
    -------
    Scene
        What was written: a body for every link with a collision shape.

    Raises
    ------
    UnsupportedQuery
        For links that cannot be read, naming them.
    """
    mirror = Mirror(client, shapes=shapes)
    for (number, link), why in mirror.remaining.items():
        raise UnsupportedQuery(f"body {number}, link {link} of client {client} cannot be recorded: {why}")
    world = mirror.world
    read = [world.body(i) for i in world.ids]
    scene = Scene("pybullet")
    for body in read:
        scene.add(SceneBody(body.name, body.shape, np.array(body.X_WB), body.static, body.group, body.mask))
    place = {body.id: body.name for body in read}
    scene.allowed = [(place[a], place[b], "filtered") for a, b, *_ in world._allowed if a in place and b in place]
    save(scene, path, about="recorded from pybullet")
    return scene


def record_mujoco(model: Any, data: Any, path: str | Path) -> Scene:
    """Write all geoms of a MuJoCo model, where they are now, as a scene file.

    Parameters
    ----------
    model : mujoco.MjModel
        Its geoms and filters; planes become half-spaces, meshes their convex hulls, as MuJoCo collides them.
    data : mujoco.MjData
        After ``mj_forward`` or ``mj_kinematics``: positions of the geoms are read.
    path : str or Path
        The scene file, ending in .json.

    Returns
    -------
    Scene
        What was written: a body for every geom; pairs that MuJoCo never tests are allowed, with its reason.

    Raises
    ------
    UnsupportedQuery
        For geoms of signed distance fields, naming the geom.
    MissingExtra
        Where mujoco is not installed.
    """
    try:
        import mujoco  # noqa: F401 - what reads the filters needs it
    except ImportError:
        raise MissingExtra("mujoco", extra="mujoco", purpose="record a model") from None
    geoms = geom_shapes(model)
    for geom, why in geoms.remaining.items():
        raise UnsupportedQuery(f"geom {geom} ({model.geom(geom).name or 'no name'}) cannot be recorded: {why}")
    scene, still = Scene("mujoco"), ~moves(model)
    taken: dict[str, int] = {}
    for k, row in enumerate(geoms.rows.tolist()):
        name = free_name(model.geom(k).name or f"geom_{k}", taken)
        taken[name] = 1
        X_WG = pose(data.geom_xpos[k], R=np.array(data.geom_xmat[k]).reshape(3, 3))
        scene.add(SceneBody(name, geoms.shapes[row], X_WG, bool(still[model.geom_bodyid[k]])))
    codes = filtered(model, np.arange(model.ngeom))
    names = [body.name for body in scene.bodies]
    scene.allowed = [
        (names[i], names[j], f"MuJoCo never tests it: {REASONS[codes[i, j]]}")
        for i, j in zip(*(side.tolist() for side in np.nonzero(np.triu(codes, 1))))
        if not (scene.bodies[i].static and scene.bodies[j].static)
    ]
    save(scene, path, about="recorded from MuJoCo")
    return scene


def _saved(read: list[tuple[Shape, np.ndarray]], path: str | Path, names: Sequence[str] | None, source: str) -> Scene:
    if names is not None and len(names) != len(read):
        raise InvalidArgument(f"names: {len(names)} for {len(read)} objects")
    scene = Scene(source)
    for k, (shape, X_WB) in enumerate(read):
        scene.add(SceneBody(names[k] if names is not None else f"object_{k}", shape, X_WB))
    save(scene, path, about=f"recorded from {source}")
    return scene


def _of_fcl(geometry: Any, k: int) -> Shape:
    if isinstance(geometry, Shape):
        return geometry
    name = type(geometry).__name__
    if name in ("Box", "Ellipsoid"):
        return Box(geometry.side) if name == "Box" else Ellipsoid(geometry.radii)
    if name == "Sphere":
        return Sphere(float(geometry.radius))
    if name in _ROUND:
        return _ROUND[name](float(geometry.radius), float(geometry.lz))
    if name == "Halfspace":
        return Halfspace(geometry.n, float(geometry.d))
    raise UnsupportedQuery(
        f"object {k}: python-fcl gives no numbers of a {name} back: hand in a collide.ConvexHull or a collide.Mesh"
    )


_ROUND: dict[str, type[Capsule | Cylinder | Cone]] = {
    "Capsule": Capsule, "Cylinder": Cylinder, "Cone": Cone,
}


def _of_coal(geometry: Any, k: int) -> Shape:
    name = type(geometry).__name__
    if name.startswith("BVHModel"):
        triangles = (geometry.tri_indices(i) for i in range(geometry.num_tris))
        return Mesh(np.array(geometry.vertices()), [[t[0], t[1], t[2]] for t in triangles])
    radius = float(geometry.getSweptSphereRadius()) if hasattr(geometry, "getSweptSphereRadius") else 0.0
    if name in ("Box", "Convex"):
        corners = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * 2.0
        points = corners * np.array(geometry.halfSide).ravel() if name == "Box" else np.array(geometry.points())
        return Box(2.0 * np.array(geometry.halfSide).ravel()) if name == "Box" and not radius else ConvexHull(
            points, radius=radius)
    if name == "Sphere":
        return Sphere(float(geometry.radius) + radius)
    if name == "Capsule":
        return Capsule(float(geometry.radius) + radius, 2.0 * float(geometry.halfLength))
    if radius:
        raise UnsupportedQuery(f"object {k}: a {name} with a swept sphere has no form in scene files")
    if name in _ROUND:
        return _ROUND[name](float(geometry.radius), 2.0 * float(geometry.halfLength))
    if name == "Ellipsoid":
        return Ellipsoid(np.array(geometry.radii).ravel())
    if name == "Halfspace":
        return Halfspace(np.array(geometry.n).ravel(), float(geometry.d))
    raise UnsupportedQuery(f"object {k}: a {name} of coal's has no form in scene files")
