"""What notebooks show: pictures that are PNG files with the body in them, names escaped, reprs in a line."""

from __future__ import annotations

import base64
import re
import struct
import zlib

import numpy as np
import pytest

import collide
from collide.base import notebook_html
from collide.scenes import load
from collide.scenes.description import SceneBody

TETRAHEDRON = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


def pictures(text: str) -> list[np.ndarray]:
    """(height, width, 4) of each picture in HTML, read by the rules of PNG; lengths and checksums asserted."""
    read = []
    for data in re.findall(r'src="data:image/png;base64,([^"]+)"', text):
        png = base64.b64decode(data)
        assert png[:8] == b"\x89PNG\r\n\x1a\n"
        at, chunks = 8, {}
        while at < len(png):
            (length,), kind = struct.unpack_from(">I", png, at), png[at + 4 : at + 8]
            chunks[kind] = png[at + 8 : at + 8 + length]
            assert zlib.crc32(kind + chunks[kind]) == struct.unpack_from(">I", png, at + 8 + length)[0]
            at += 12 + length
        width, height, depth, colours, *_ = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
        assert (depth, colours) == (8, 6) and b"IEND" in chunks
        rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 1 + 4 * width)
        assert not rows[:, 0].any()
        read.append(rows[:, 1:].reshape(height, width, 4))
    return read


def world() -> collide.World:
    made = collide.World()
    made.add(collide.Box((1, 1, 1)), name="<b>box</b>")
    made.add(collide.Sphere(0.5), collide.pose((0.9, 0, 0)), name="ball")
    made.add(collide.Halfspace((0, 0, 1), -2.0), name="floor", static=True)
    return made


@pytest.mark.parametrize("shape", [
    collide.Box((1, 2, 3)), collide.Sphere(1e-9), collide.Capsule(1e6, 1e6), collide.Halfspace((0, 0, 1), 0.0),
    collide.Mesh(TETRAHEDRON, FACES), collide.Compound([(collide.Box((1, 1, 1)), np.eye(4))]),
    collide.VoxelGrid(np.zeros((1, 3), dtype=int), 0.1), collide.HeightField(np.zeros((3, 3)), 0.1),
    collide.HPolytope([(0, 0, 1), (0, 0, -1)], [1, 1], bounded=False),
], ids=lambda shape: type(shape).__name__)
def test_shapes_have_a_picture(shape):
    (picture,) = pictures(shape._repr_html_())
    drawn = picture[..., 3] > 0
    share = drawn.mean()
    assert 0.02 < share < 0.95 and not drawn[0].any() and not drawn[:, 0].any(), "within the border"
    assert len(np.unique(picture[drawn][:, :3], axis=0)) >= 1


@pytest.mark.parametrize("shape", [collide.PointCloud(np.zeros((3, 3))), collide.Box((1, 0, 0))])
def test_shapes_without_triangles_have_their_repr(shape):
    text = shape._repr_html_()
    assert pictures(text) == [] and type(shape).__name__ in text


def test_what_is_nearer_hides_what_is_behind():
    towards = np.linalg.inv(notebook_html._VIEW)[:, 2]
    far, near = TETRAHEDRON[FACES] * 0.2, TETRAHEDRON[FACES] * 0.2 + 3.0 * towards
    colours = np.repeat([(255, 0, 0), (0, 0, 255)], 4, axis=0)
    for order in (slice(None), slice(None, None, -1)):
        picture = notebook_html._drawn(np.concatenate([far, near])[order], colours[order])
        seen = picture[picture[..., 3] > 0][:, :3]
        assert (seen[:, 2] > 0).all() and not seen[:, 0].any(), "of two in one line of sight the nearer alone"


def test_many_small_triangles_are_drawn_too(monkeypatch):
    monkeypatch.setattr(notebook_html, "_MAX_FILLED", 0)
    rng = np.random.default_rng(2)
    corners = rng.uniform(-1, 1, (3000, 1, 3)) + 0.01 * rng.uniform(-1, 1, (3000, 3, 3))
    assert (notebook_html._drawn(corners, np.full((3000, 3), 200))[..., 3] > 0).sum() > 2000


def test_worlds_and_scenes_have_a_picture_and_a_table():
    made = world()
    assert repr(made) == "World(3 bodies: <b>box</b>, ball, floor)"
    text = made._repr_html_()
    assert len(pictures(text)) == 1 and "&lt;b&gt;box&lt;/b&gt;" in text and "<b>" not in text
    assert text.count("<tr>") == 4 and "<td>0.900 0.000 0.000</td>" in text
    for k in range(20):
        made.add(collide.Box((1, 1, 1)), name=f"more {k}")
    assert repr(made) == "World(23 bodies: <b>box</b>, ball, floor, more 0, …)"
    assert made._repr_html_().count("<tr>") == 13 and "… and 11 more" in made._repr_html_()
    assert repr(collide.World()) == "World(0 bodies)" and "<img" not in collide.World()._repr_html_()
    scene = load("workcell")
    assert re.fullmatch(r"Scene\('workcell', \d+ bodies \(\d+ static\).*\)", repr(scene))
    assert len(pictures(scene._repr_html_())) == 1
    body = SceneBody("cup", collide.Sphere(0.5), collide.pose((1, 2, 3)), static=True, owner="arm")
    assert repr(body) == "SceneBody('cup', Sphere(radius=0.5), at (1, 2, 3), static, of arm)"
    assert len(pictures(body._repr_html_())) == 1


def test_results_of_worlds_have_the_attributes_of_results_of_pairs():
    made = world()
    rows = made.distances()
    pairs = [rows.pair(k) for k in range(len(rows))]
    assert len(rows) == 3
    for name in rows.rows.dtype.names:
        column = getattr(rows, name)
        assert np.array_equal(column, rows[name]) and column.base is not None, "no copy"
        assert np.array_equal(column, [getattr(pair, name) for pair in pairs])
    assert made.minimum().distance.tolist() == [rows.distance.min()]
    made.add(collide.Box((1, 1, 1)), collide.pose((0.5, 0, 0)), name="second box")
    contacts, hits, overlaps = made.contacts(), made.raycast((0, 0, 5), (0, 0, -1)), made.overlaps()
    for result in (contacts, hits, overlaps):
        assert len(result) and all(
            name == "point" or np.array_equal(getattr(result, name), result[name]) for name in result.rows.dtype.names
        )


def test_results_have_tables():
    rows = world().distances()
    least = rows.distance.min()
    assert repr(rows) == f"WorldResult(3 rows, 1 hits, least distance {least:.6g} m)"
    text = rows._repr_html_()
    assert text.count("<tr>") == 4 and text.index("&lt;b&gt;") < text.index(f"{rows.distance.max():.6g}"), "sorted"
    assert repr(world().query(collide.Sphere(0.1), collide.pose((50, 0, 0)))) == "WorldResult(0 rows, 0 hits)"
    single = collide.distance(collide.Sphere(1), collide.Sphere(1), np.eye(4), collide.pose((3, 0, 0)))
    assert "<td>1</td>" in single._repr_html_() and "closed form" in single._repr_html_()
