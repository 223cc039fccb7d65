"""The drawing of a scene: what stands in the page is where the bodies stand, each shape once."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest

from collide import Box, Compound, ConvexHull, Cylinder, Halfspace, Mesh, Sphere, pose, tessellate
from collide.pages import drawing, drawn_shapes
from collide.pages.drawn_shapes import MAX_FACETS, ShapeTable, facet_cap, is_smooth
from collide.reports import report
from collide.scenes import Scene, SceneBody


def arrays(shape: dict) -> tuple[np.ndarray, np.ndarray]:
    """Positions (V, 3) and triangles (F, 3) of a shape of the page."""
    positions = np.frombuffer(base64.b64decode(shape["positions"]), "<f4").reshape(-1, 3)
    triangles = np.frombuffer(base64.b64decode(shape["triangles"]), "<u4").reshape(-1, 3)
    assert len(positions) == shape["vertex_count"] and len(triangles) == shape["triangle_count"]
    return positions.astype(float), triangles.astype(int)


def drawn(bodies, **options) -> dict:
    scene = Scene("test", bodies)
    data = drawing.of_scene(scene, report.make(scene), **options)
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    return data


def world_points(data: dict, row: int, which: str = "shown") -> np.ndarray:
    body = data["bodies"][row]
    positions, _ = arrays(data["shapes"][body[which]])
    X_WB = np.array(body["X_WB"]).reshape(4, 4)
    return positions @ X_WB[:3, :3].T + X_WB[:3, 3]


def test_bodies_stand_where_they_stand():
    X_WB = pose((1, 2, 3), rpy=(0.3, -0.2, 1.0))
    data = drawn([SceneBody("box", Box((0.2, 0.4, 0.6)), X_WB, static=True, approximation="a guess", owner="robot")])
    body = data["bodies"][0]
    assert {key: body[key] for key in ("name", "static", "owner", "kind", "tested", "note")} == {
        "name": "box", "static": True, "owner": "robot", "kind": "Box", "tested": None, "note": "a guess",
    }
    assert body["X_WB"] == X_WB.ravel().tolist(), "poses are in full precision"
    corners = {(round(x, 6), round(y, 6), round(z, 6)) for x, y, z in world_points(data, 0).tolist()}
    wanted = {
        tuple(np.round(X_WB[:3, :3] @ (0.1 * i, 0.2 * j, 0.3 * k) + X_WB[:3, 3], 6).tolist())
        for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)
    }
    assert corners == wanted


def test_facets_face_outwards():
    data = drawn([SceneBody("ball", Sphere(0.5), np.eye(4)), SceneBody("can", Cylinder(0.1, 1.0), pose((3, 0, 0)))])
    for shape, volume in zip(data["shapes"], (np.pi / 6, np.pi * 0.01)):
        positions, triangles = arrays(shape)
        a, b, c = (positions[triangles[:, k]] for k in range(3))
        assert np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6 == pytest.approx(volume, rel=0.05)
        assert shape["smooth"] and shape["simplified_from"] is None and 0 < shape["deviation"] < 0.01


def test_shapes_that_bodies_share_stand_once():
    box = Box((1, 1, 1))
    bodies = [SceneBody(f"b{k}", box if k % 2 else Box((1, 1, 1)), pose((3.0 * k, 0, 0))) for k in range(6)]
    data = drawn([*bodies, SceneBody("other", Box((1, 1, 2)), pose((-9, 0, 0)))])
    assert [body["shown"] for body in data["bodies"]] == [0] * 6 + [1] and len(data["shapes"]) == 2


def test_what_is_tested_stands_beside_what_is_shown():
    bodies = [SceneBody("link", Box((1, 1, 1)), pose((0, 0, 5))), SceneBody("bare", Box((1, 1, 1)), pose((5, 0, 0)))]
    looks = {"link": [(Sphere(0.1), pose((1, 0, 0))), (Box((0.2, 0.2, 0.2)), np.eye(4))]}
    data = drawn(bodies, looks=looks, notes=["visuals"])
    link, bare = data["bodies"]
    assert link["tested"] == bare["shown"] and bare["tested"] is None and data["notes"] == ["visuals"]
    assert world_points(data, 0).min(axis=0) == pytest.approx((-0.1, -0.1, 4.9), abs=1e-6)
    assert world_points(data, 0)[:, 0].max() == pytest.approx(1.1, abs=1e-6)
    assert world_points(data, 0, "tested").min(axis=0) == pytest.approx((-0.5, -0.5, 4.5))


def test_halfspaces_are_squares_around_the_scene():
    floor = SceneBody("floor", Halfspace((0, 0, 1), -0.25), np.eye(4))
    data = drawn([floor, SceneBody("box", Box((1, 1, 1)), pose((7, 0, 5)))])
    floor = data["shapes"][data["bodies"][0]["shown"]]
    assert floor["unbounded"] and not data["shapes"][1]["unbounded"]
    points = world_points(data, 0)
    assert (points[:, 2] == -0.25).all() and np.ptp(points[:, 0]) > 14
    assert data["size"] == pytest.approx(1.0), "a half-space has no extent"


def test_sizes():
    assert drawn([SceneBody("floor", Halfspace((0, 0, 1), 0.0), np.eye(4))])["size"] == 1.0
    assert drawing.of_scene(Scene("none"), report.make(Scene("none")))["size"] == 1.0
    tilted = SceneBody("stick", Box((2, 1e-9, 1e-9)), pose((0, 0, 9), rpy=(0, 0, np.pi / 4)))
    assert drawn([tilted])["size"] == pytest.approx(2**0.5)
    far = SceneBody("far", Box((1, 1, 1)), pose((1e49, 0, 0)))
    huge = drawn([SceneBody("huge", Box((1e45, 1, 1)), np.eye(4)), far])
    assert np.isfinite(arrays(huge["shapes"][0])[0]).all(), "single precision ends earlier"


def test_bodies_without_triangles_are_named():
    data = drawn([SceneBody("needle", ConvexHull(np.array([(0, 0, 0), (1, 0, 0.0)])), np.eye(4))])
    assert data["bodies"][0]["name"] == "needle" and "not drawn: needle" in data["notes"][0]


@pytest.mark.parametrize(
    ("shape", "smooth"),
    [
        (Box((1, 1, 1)), False), (Sphere(1), True), (ConvexHull(np.eye(3)), False),
        (ConvexHull(np.eye(3), radius=0.1), True),
        (Mesh(np.eye(3), [[0, 1, 2]]), True), (Compound([(Box((1, 1, 1)), np.eye(4))]), False),
        (Compound([(Box((1, 1, 1)), np.eye(4)), (Sphere(1), np.eye(4))]), True), (Halfspace((0, 0, 1), 0.0), False),
    ],
)
def test_what_is_round(shape, smooth):
    assert is_smooth(shape) is smooth


# --- large scenes -------------------------------------------------------------------------------


def test_caps():
    assert facet_cap([]) == 0 and facet_cap([10, 20]) == 20
    assert facet_cap([500] * 1000) == 500, "many small meshes are drawn whole"
    assert facet_cap([500_000]) == MAX_FACETS
    assert facet_cap([10, 500_000, 200_000]) == (MAX_FACETS - 10) // 2
    for counts in ([900] * 10_000, [500_000] * 50, [3, 1200, 77] * 400):
        cap = facet_cap(counts)
        drawn_facets = sum(min(count, cap) for count in counts)
        assert cap >= 1 and drawn_facets <= (MAX_FACETS if max(counts) > 1000 and cap > 1000 else 1_000_000)


def test_large_meshes_are_simplified_and_say_so():
    vertices, faces = tessellate(Sphere(1.0), tolerance=2e-4)
    mesh = Mesh(vertices, faces)
    assert len(faces) > 9_000
    box = SceneBody("box", Box((1, 1, 1)), pose((5, 0, 0)))
    data = drawn([SceneBody("mesh", mesh, np.eye(4)), box], max_facets=3000)
    shape, box = data["shapes"]
    assert shape["simplified_from"] == len(faces) and 2400 < shape["triangle_count"] <= 3000 - 12
    assert box["simplified_from"] is None and box["triangle_count"] == 12
    assert 0 < shape["deviation"] < 0.15
    assert str(len(faces)) in data["notes"][0] and "display only" in data["notes"][0]
    assert np.abs(np.linalg.norm(arrays(shape)[0], axis=1) - 1).max() < shape["deviation"]


def test_tables_keep_apart_what_dies():
    """A shape that is gone may leave its id to the next: the table holds on to what it has seen."""
    table = ShapeTable(1.0)
    rows = [table.row([(Box((1, 1, 1 + k)), np.eye(4))]) for k in range(200)]
    assert rows == list(range(200)) and drawn_shapes.MAX_FACETS == 120_000
