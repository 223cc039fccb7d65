"""What `save` writes, `load` reads back: the same shapes, poses and rules, every double as it was."""

from __future__ import annotations

import json

import numpy as np
import pytest

import collide
from collide import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    HPolytope,
    Mesh,
    Sphere,
    World,
    pose,
)
from collide.errors import InvalidArgument, SceneError
from collide.scenes import generate, load, save
from collide.scenes.write_scene import shape_document

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1 / 3]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
TURNED = pose((0.1, 1 / 3, -2e-17), rpy=(0.1, 0.2, 0.3))
SHAPES = [
    Box((1, 2 / 3, 3)), Sphere(0.1), Capsule(0.1, 0.3), Cylinder(1e-9, 1e5), Cone(0.7, 0.1), Ellipsoid((0.1, 0.2, 0.3)),
    Halfspace((0.1, 0.2, 0.7), 1 / 7), ConvexHull(TETRAHEDRON[0]), ConvexHull(TETRAHEDRON[0], radius=0.01),
    HPolytope(np.vstack([np.eye(3), -np.eye(3)]), [0.1] * 6), HPolytope([(0, 0, 1)], [0.1], bounded=False),
    Mesh(*TETRAHEDRON), Mesh(*TETRAHEDRON, solid=False),
    Mesh(TETRAHEDRON[0], TETRAHEDRON[1][:2]), HeightField([[0, 0.1, 0.2], [0.3, 0, 1 / 3]], (0.5, 0.25)),
    Compound([(Sphere(0.1), TURNED), (Compound([(Mesh(*TETRAHEDRON), TURNED)]), pose())]),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_shape_comes_back(shape, tmp_path):
    world = World()
    world.add(shape, TURNED, name="it", static=True, group=4, mask=0x0F)
    save(world, tmp_path / "scene.json")
    (body,) = load(tmp_path / "scene.json").bodies
    assert body.shape == shape and type(body.shape) is type(shape)
    assert getattr(body.shape, "solid", None) == getattr(shape, "solid", None)
    assert body.X_WB.tobytes() == TURNED.tobytes()
    assert (body.name, body.static, body.group, body.mask) == ("it", True, 4, 0x0F)


def test_a_scene_and_a_world_with_a_robot(tmp_path):
    scene = load("workcell")
    rows = scene.world().distances(max_distance=0.1).rows
    for n, of in enumerate((scene, scene.world())):
        place = tmp_path / f"{n}.json"
        save(of, place, about="a remark")
        again = load(place)
        assert again.world().distances(max_distance=0.1).rows.tobytes() == rows.tobytes()
        assert {pair[:2] for pair in again.allowed} == {pair[:2] for pair in scene.allowed}
        assert json.loads(place.read_text())["about"] == "a remark"


def test_clutter_of_every_kind(tmp_path):
    scene = generate("clutter", 3, n=40)
    save(scene, tmp_path / "clutter.json")
    assert [body.shape for body in load(tmp_path / "clutter.json").bodies] == [body.shape for body in scene.bodies]


def test_facets_in_the_file_itself(tmp_path):
    def read(**mesh):
        place = tmp_path / "scene.json"
        place.write_text(json.dumps({"collide": 1, "units": "mm", "bodies": [{"name": "a", "shape": {"mesh": mesh}}]}))
        return load(place).bodies[0].shape

    vertices, faces = (TETRAHEDRON[0] * 1000).tolist(), TETRAHEDRON[1]
    made = read(vertices=vertices, faces=faces)
    assert made.solid and made.vertices[1].tolist() == [1, 0, 0], "units count"
    assert not read(vertices=vertices, faces=faces, solid=False).solid
    for wrong, complaint in (
        ({"vertices": vertices}, "either file, or vertices and faces"), ({"faces": faces}, "either file"),
        ({"vertices": vertices, "faces": [[0, 1, 1.5]]}, "whole numbers"),
        ({"vertices": vertices, "faces": [[0, 1, 9]]}, "9"),
        ({"vertices": vertices, "faces": faces, "scale": 2}, "'scale' goes with a file"),
        ({"vertices": vertices, "faces": faces[:2], "solid": True}, "no inside"),
        ({"file": "a.stl", "faces": faces}, "in place of a file"),
    ):
        with pytest.raises(collide.CollideError, match=complaint):
            read(**wrong)


def test_what_cannot_be_written(tmp_path):
    with pytest.raises(SceneError, match=r"\.json"):
        save(World(), tmp_path / "scene.yaml")
    with pytest.raises(InvalidArgument, match="Scene or a World"):
        save(7, tmp_path / "scene.json")
    with pytest.raises(OSError, match="absent"):
        save(World(), tmp_path / "absent" / "scene.json")

    world = World()
    world.add(Sphere(1), name="a", mask=0xFFFFFFFF)
    save(world, tmp_path / "scene.json")
    assert load(tmp_path / "scene.json").bodies[0].mask == 0xFFFF, "no group has the bits that are left out"
    world.add(Sphere(1), name="b", group=0x10000)
    with pytest.raises(SceneError, match='"b": scene files have groups of 16 bits'):
        save(world, tmp_path / "scene.json")

    class Odd(Sphere):
        pass

    with pytest.raises(SceneError, match="Odd has no form"):
        shape_document(Odd(1.0))
