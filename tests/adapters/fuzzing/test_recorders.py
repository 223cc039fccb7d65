"""Scenes recorded from live programs: the bodies they had, where they were, and the same answers."""

from __future__ import annotations

import numpy as np
import pytest

from collide import (
    Box,
    Capsule,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    InvalidArgument,
    Mesh,
    Sphere,
    UnsupportedQuery,
    pose,
)
from collide.adapters.fuzzing.recorders import record_coal, record_fcl, record_mujoco, record_pybullet
from collide.adapters.peers.compare import compare
from collide.scenes import load

POINTS = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1, 0], [0, 0, 1 / 3]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
TURNED = pose((0.1, 1 / 3, -2), rpy=(0.1, 0.2, 0.3))
ROUND = [Sphere(0.3), Box((1, 2, 1 / 3)), Capsule(0.3, 0.5), Cylinder(0.1, 0.7), Cone(0.2, 0.4),
         Ellipsoid((0.1, 0.2, 0.3)), Halfspace((0, 0, 1), -0.5)]


def check(place, expected, X_WB, atol: float = 0.0) -> None:
    """The file holds these shapes, all at one pose."""
    bodies = load(place).bodies
    assert [body.shape for body in bodies] == expected
    assert all(np.allclose(body.X_WB, X_WB, rtol=0, atol=atol) for body in bodies)


def test_python_fcl(tmp_path):
    fcl = pytest.importorskip("fcl", reason="python-fcl is not installed")
    geometries = [fcl.Sphere(0.3), fcl.Box(1, 2, 1 / 3), fcl.Capsule(0.3, 0.5), fcl.Cylinder(0.1, 0.7),
                  fcl.Cone(0.2, 0.4), fcl.Ellipsoid(0.1, 0.2, 0.3),
                  fcl.Halfspace(np.array([0, 0, 1.0]), -0.5)]
    X = fcl.Transform(TURNED[:3, :3], TURNED[:3, 3])
    objects = [(fcl.CollisionObject(geometry, X), geometry) for geometry in geometries]
    model = fcl.BVHModel()
    model.beginModel(4, 4)
    model.addSubModel(POINTS, FACES)
    model.endModel()
    place = tmp_path / "scene.json"
    record_fcl([*objects, (fcl.CollisionObject(model, X), Mesh(POINTS, FACES))], place)
    check(place, [*ROUND, Mesh(POINTS, FACES)], TURNED, 1e-15)
    assert [body.name for body in load(place).bodies][:2] == ["object_0", "object_1"]
    with pytest.raises(UnsupportedQuery, match="object 0: python-fcl gives no numbers of a BVHModel"):
        record_fcl([(fcl.CollisionObject(model, X), model)], place)
    with pytest.raises(InvalidArgument, match="1 for 2 objects"):
        record_fcl(objects[:2], place, names=["a"])


def test_coal(tmp_path):
    coal = pytest.importorskip("coal", reason="coal is not installed")
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    corners.extend(POINTS)
    triangles.extend([coal.Triangle(*map(int, face)) for face in FACES])
    model = coal.BVHModelOBBRSS()
    model.beginModel(4, 4)
    model.addVertices(POINTS)
    model.addTriangles(FACES)
    model.endModel()
    swept = coal.Convex(corners, triangles)
    swept.setSweptSphereRadius(0.25)
    geometries = [coal.Sphere(0.3), coal.Box(1, 2, 1 / 3), coal.Capsule(0.3, 0.5), coal.Cylinder(0.1, 0.7),
                  coal.Cone(0.2, 0.4), coal.Ellipsoid(0.1, 0.2, 0.3), coal.Halfspace(np.array([0, 0, 1.0]), -0.5),
                  coal.Convex(corners, triangles), swept, model]
    X = coal.Transform3s(TURNED[:3, :3], TURNED[:3, 3])
    place = tmp_path / "scene.json"
    record_coal([coal.CollisionObject(geometry, X) for geometry in geometries], place)
    check(place, [*ROUND, ConvexHull(POINTS), ConvexHull(POINTS, radius=0.25), Mesh(POINTS, FACES)], TURNED)
    comparison = compare(load(place), engines=["coal"], every_pair=True)
    assert comparison.ours_wrong == 0 and comparison.pairs == 45
    plane = coal.CollisionObject(coal.Plane(np.array([0, 0, 1.0]), 0.5), X)
    with pytest.raises(UnsupportedQuery, match="object 0: a Plane of coal's"):
        record_coal([plane], place)


def test_pybullet(tmp_path):
    p = pytest.importorskip("pybullet", reason="pybullet is not installed")
    client = p.connect(p.DIRECT)
    try:
        for at, shape in (((0, 0, 0.5), {"shapeType": p.GEOM_BOX, "halfExtents": [0.5, 0.25, 0.5]}),
                          ((1, 2, 3), {"shapeType": p.GEOM_SPHERE, "radius": 0.5})):
            collision = p.createCollisionShape(**shape, physicsClientId=client)
            p.createMultiBody(1.0, collision, basePosition=at, physicsClientId=client)
        place = tmp_path / "scene.json"
        scene = record_pybullet(place, client)
        again = load(place)
        assert sorted(type(body.shape).__name__ for body in again.bodies) == ["Box", "Sphere"]
        assert [body.X_WB[:3, 3].tolist() for body in again.bodies] == [[0, 0, 0.5], [1, 2, 3]]
        assert [body.name for body in again.bodies] == [body.name for body in scene.bodies]
    finally:
        p.disconnect(client)


def test_mujoco(tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
        "<body pos='0 0 0.5'><freejoint/><geom name='box' type='box' size='.25 .5 .125'/>"
        "<geom type='sphere' size='.125' pos='0 0 .25'/></body>"
        "<body pos='0 0 1' euler='0 90 0'><freejoint/><geom name='pin' type='capsule' size='.125 .5'/></body>"
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    place = tmp_path / "scene.json"
    record_mujoco(model, data, place)
    scene = load(place)
    assert [body.name for body in scene.bodies] == ["floor", "box", "geom_2", "pin"]
    assert scene.body("box").shape == Box((0.5, 1, 0.25)) and scene.body("pin").shape == Capsule(0.125, 1)
    assert scene.body("floor").static and isinstance(scene.body("floor").shape, Halfspace)
    assert np.allclose(scene.body("pin").X_WB[:3, 2], (1, 0, 0)), "turned about y"
    assert [pair[:2] for pair in scene.allowed] == [("box", "geom_2")] and "one body" in scene.allowed[0][2]
    pairs = scene.world().distances(max_distance=0.2).rows
    assert [tuple(row) for row in pairs[["a", "b"]].tolist()] == [(2, 3)] and abs(pairs["distance"][0]) < 1e-15
