"""Contacts of a page: boxes that meet meet where their overlap is, and what is left out is said."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest

from collide import Box, Halfspace, Mesh, Sphere, pose, tessellate
from collide.pages import drawn_contacts
from collide.reports import report
from collide.reports.state_reports import Stated
from collide.scenes import Scene, SceneBody


def stated(*bodies, label="", **limits) -> Stated:
    scene = Scene("test", [SceneBody(name, shape, pose(at)) for name, shape, at in bodies])
    return Stated(label, scene, report.make(scene, **limits))


CUBE = Box((1, 1, 1))


def test_patches_stand_where_boxes_meet():
    made = stated(("table", Box((4, 4, 1)), (0, 0, 0)), ("part", CUBE, (0.3, 0, 0.999)), ("on", CUBE, (0.3, 0, 1.999)))
    entries, about = drawn_contacts.of_states([made])
    assert json.loads(json.dumps(entries, allow_nan=False)) == entries
    deep, touching = entries
    assert ({deep["a"], deep["b"]}, deep["class"]) == ({"table", "part"}, "colliding")
    assert ({touching["a"], touching["b"]}, touching["class"]) == ({"part", "on"}, "touching")
    for entry, z, depth in ((deep, 0.4995, 0.001), (touching, 1.499, 0.0)):
        (patch,) = entry["patches"]
        corners = {(round(x, 9), round(y, 9)) for x, y, _ in patch["points"]}
        assert corners == {(-0.2, -0.5), (-0.2, 0.5), (0.8, -0.5), (0.8, 0.5)}
        assert [p[2] for p in patch["points"]] == pytest.approx([z] * 4, abs=1e-9)
        assert patch["depths"] == pytest.approx([depth] * 4, abs=1e-9) and np.abs(patch["normal"]).tolist() == [0, 0, 1]
        volume = pytest.approx(depth * 1.0, abs=1e-12)
        overlap = entry["overlap"]
        assert overlap["volume"] == volume and overlap["certified"] and "state" not in entry
        assert ("triangles" in overlap) == (depth > 0.0)
    common = deep["overlap"]
    corners = np.frombuffer(base64.b64decode(common["triangles"]), "<f4").reshape(-1, 3) + common["origin"]
    assert np.allclose(corners.min(axis=0), (-0.2, -0.5, 0.499), atol=1e-6)
    assert np.allclose(corners.max(axis=0), (0.8, 0.5, 0.5), atol=1e-6) and len(corners) == 36
    assert about["pairs"] == about["of"] == 2 and "volumes" in about["note"]


def test_nothing_meets():
    made = stated(("a", CUBE, (0, 0, 0)), ("b", CUBE, (3, 0, 0)), clearance=5.0)
    assert made.report.near and drawn_contacts.of_states([made]) == ([], None)


def test_the_deepest_come_first_and_the_rest_is_counted():
    row = [(f"b{k}", Sphere(1.0), (1.9 * k, 0, 0)) for k in range(6)]
    entries, about = drawn_contacts.of_states([stated(*row)], max_pairs=3)
    assert [about["pairs"], about["of"]] == [3, 5] and "2 left out" in about["note"]
    depths = [max(d for patch in entry["patches"] for d in patch["depths"]) for entry in entries]
    assert depths == pytest.approx([0.1] * 3)


def test_states_are_named():
    made = [stated(("a", CUBE, (0, 0, 0)), ("b", CUBE, (0.9 + k, 0, 0)), label=str(k)) for k in range(2)]
    made.append(stated(("a", CUBE, (0, 0, 0)), ("b", CUBE, (0.95, 0, 0)), label="2"))
    entries, about = drawn_contacts.of_states(made)
    assert [entry["state"] for entry in entries] == [0, 2] and about["of"] == 2


def test_pairs_without_contacts():
    """Two half-spaces that overlap have none: the library refuses them by name."""
    made = stated(("a", Halfspace((0, 0, 1), 0.0), (0, 0, 0)), ("b", Halfspace((0, 0.6, -0.8), 1.0), (0, 0, 0)))
    entries, about = drawn_contacts.of_states([made])
    assert entries == [] and [about["pairs"], about["of"]] == [0, 1] and "1 for which there are none" in about["note"]


def test_large_meshes_are_left_out(monkeypatch):
    mesh = Mesh(*tessellate(Sphere(1.0), tolerance=0.01))
    made = stated(("a", mesh, (0, 0, 0)), ("b", mesh, (1.95, 0, 0)), ("c", CUBE, (0, 1.49, 0)))
    monkeypatch.setattr(drawn_contacts, "_MAX_FACETS", 2 * len(mesh.faces) - 1)
    entries, about = drawn_contacts.of_states([made])
    assert [{entry["a"], entry["b"]} for entry in entries] == [{"a", "c"}]
    assert about["of"] == 2 and "1 left out" in about["note"]
