"""Meshes and convex shapes of all kinds through the C interface: Python's answers, bit by bit, or left to Python."""

from __future__ import annotations

from collections import Counter

import c_library as c
import numpy as np
import pytest
import soak_pairs
import surfaces

import collide
from collide.kernels import mode
from collide.results import PAIR_DTYPE

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

PARTNERS = (
    "half-space", "cylinder", "cone", "ellipsoid", "half-space", "cylinder", "ellipsoid", "box", "sphere", "hull",
)


def pairs() -> list[tuple]:
    """(name, mesh, shape, X_WM, X_WS): random, and shapes far inside of a solid, or within a cavity."""
    cases = []
    for number in range(260):
        k = soak_pairs.draw(141, number, 1e2, ("solid", "surface", *PARTNERS))
        for A, B, X_WA, X_WB in ((k.A, k.B, k.X_WA, k.X_WB), (k.B, k.A, k.X_WB, k.X_WA)):
            if A.meshed and not B.meshed:
                cases.append((f"draw(141, {number})", A, B, X_WA, X_WB))
    cavity = surfaces.box((0.25, 0.25, 0.25), (0.75, 0.75, 0.75))
    hollow = collide.Mesh(*surfaces.joined(surfaces.box(), (cavity[0], cavity[1][:, ::-1])))
    ball = collide.Mesh(*surfaces.ball())
    for number in range(60):
        random = np.random.default_rng([142, number])
        shape = soak_pairs.shape(PARTNERS[number % 7], 0.1, random)
        X_WS = soak_pairs.rotation(random)
        X_WS[:3, 3] = random.uniform(0, 1, 3) if number % 2 else random.uniform(-1, 1, 3)
        cases.append((f"inside {number}", hollow if number % 2 else ball, shape, np.eye(4), X_WS))
    return cases


def test_answers_have_pythons_bits_or_are_left_to_python():
    asker, told, meshes = c.Asker(), Counter(), {}
    for name, mesh, shape, X_WM, X_WS in pairs():
        own, partner = meshes.setdefault(id(mesh), (c.CMesh(mesh), mesh))[0], c.CShape(shape)
        kind = "plane" if isinstance(shape, collide.Halfspace) else "curved" if partner_is_curved(shape) else "facets"
        wanted = collide.collide(mesh, shape, X_WM, X_WS)
        for flags, signed in ((0, True), (c.UNSIGNED, False)):
            status, hit, status_of_row, rows = asker.mesh_shape(own, partner, X_WM, X_WS, flags)
            assert (status, hit) in ((c.OK, wanted), (c.UNSUPPORTED, False)), (name, status, hit, wanted)
            told[kind, "boolean", status] += 1
            if status_of_row == c.OK:
                row = collide.distance(mesh, shape, X_WM, X_WS, signed=signed).rows
                assert rows.tobytes() == row.tobytes(), (name, kind, signed, rows, row)
            else:
                assert status_of_row == c.UNSUPPORTED and rows.tobytes() == bytes(PAIR_DTYPE.itemsize), (name, kind)
            told[kind, f"row, meeting: {wanted}", status_of_row] += 1
    assert told["plane", "boolean", c.OK] >= 60 and told["plane", "boolean", c.UNSUPPORTED] == 0, told
    assert told["plane", "row, meeting: True", c.OK] >= 30 and told["plane", "row, meeting: True", c.UNSUPPORTED] == 0
    assert told["curved", "boolean", c.OK] >= 150 and told["curved", "boolean", c.UNSUPPORTED] <= 20, told
    assert told["curved", "row, meeting: False", c.OK] >= 60 and told["curved", "row, meeting: True", c.OK] >= 10, told


def partner_is_curved(shape: collide.Shape) -> bool:
    return isinstance(shape, (collide.Cylinder, collide.Cone, collide.Ellipsoid))


def test_what_is_refused():
    asker, mesh = c.Asker(), c.CMesh(collide.Mesh(*surfaces.box()))
    normals = np.array([[3, 1, 0], [-3, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    rounded = c.CShape(collide.HPolytope(normals, np.ones(5)))
    assert asker.mesh_shape(mesh, rounded, np.eye(4), np.eye(4))[::2] == (c.UNSUPPORTED, c.UNSUPPORTED)
    box = c.CMesh(collide.Box(1, 1, 1))  # no mesh of facets
    assert asker.mesh_shape(box, c.CShape(collide.Sphere(1)), np.eye(4), np.eye(4))[::2] == (c.INVALID_ARGUMENT,) * 2
    for shape in (collide.Cylinder(1, 1), collide.Halfspace((0, 0, 1), 0), collide.Box(1, 1, 1)):
        own = c.CShape(shape)
        assert asker.mesh_shape(mesh, own, np.eye(4), np.eye(4), 4)[::2] == (c.INVALID_ARGUMENT,) * 2
        for number, bad in enumerate(c.odd_poses()):
            assert asker.mesh_shape(mesh, own, np.eye(4), bad)[::2] == (c.INVALID_POSE,) * 2, (shape, number)


def test_contacts_have_pythons_bits_or_are_left_to_python():
    """Of the pairs above, and of cans, cones and ellipsoids that rest on a plate and on a ball of facets."""
    asker, told, meshes = c.Asker(), Counter(), {}
    cases = [(*pair, 1e-2, 4) for pair in pairs()]
    plate, ball = collide.Mesh(*surfaces.box((-2, -2, -0.2), (2, 2, 0))), collide.Mesh(*surfaces.ball())
    for number in range(90):
        random = np.random.default_rng([143, number])
        shape = [collide.Cylinder(0.2, 0.3), collide.Cone(0.2, 0.3), collide.Ellipsoid((0.1, 0.2, 0.3))][number % 3]
        mesh, X_WS = (plate, ball)[number % 2], soak_pairs.rotation(random)
        gap = collide.distance(mesh, shape, np.eye(4), X_WS + c.identity_at(0.1, 0.2, 5) - np.eye(4)).distance
        X_WS[:3, 3] = 0.1, 0.2, 5.0
        if mesh is plate:
            X_WS[2, 3] -= gap + random.choice([1e-3, 5e-3, -1e-3, -5e-3])
        else:
            X_WS[:3, 3] = random.uniform(-1, 1, 3) * 1.2
        cases.append((f"at rest {number}", mesh, shape, np.eye(4), X_WS, 2e-2, int(random.choice([1, 4, 8]))))
    for name, mesh, shape, X_WM, X_WS, margin, most in cases:
        own, partner = meshes.setdefault(id(mesh), (c.CMesh(mesh), mesh))[0], c.CShape(shape)
        status, rows, count = asker.many_contacts(own, partner, X_WM, X_WS, margin, most)
        if isinstance(shape, collide.Halfspace):
            assert status == c.UNSUPPORTED
            continue
        kind = "curved" if partner_is_curved(shape) else "facets"
        if status == c.OK:
            wanted = collide.contacts(mesh, shape, X_WM, X_WS, margin=margin, max_contacts=most).rows
            assert count == len(rows) and rows.tobytes() == wanted.tobytes(), (name, margin, most, rows, wanted)
            told[kind, "contacts" if count else "none"] += 1
        else:
            assert (status, count) == (c.UNSUPPORTED, 0), (name, status)
            told[kind, "left"] += 1
    assert told["curved", "contacts"] >= 40 and told["curved", "none"] >= 40, told
    assert told["curved", "left"] <= 0.4 * sum(count for (kind, _), count in told.items() if kind == "curved"), told


def test_vertices_that_no_facet_has_are_no_harm():
    """A triangle with the last numbers of 50,000 vertices: its hull, its contacts with a can and with a box."""
    vertices = np.random.default_rng(144).normal(size=(50_000, 3))
    vertices[-3:] = (-1, -1, 0), (1, -1, 0), (0, 1, 0)
    mesh, X = collide.Mesh(vertices, [[49_997, 49_998, 49_999]], solid=False), c.identity_at(0, 0, 0.505)
    asker, own = c.Asker(), c.CMesh(mesh)
    for shape in (collide.Cylinder(0.1, 1.0), collide.Box(0.2, 0.2, 1.0)):
        wanted = collide.contacts(mesh, shape, np.eye(4), X, margin=0.01, max_contacts=4).rows
        status, rows, _ = asker.many_contacts(own, c.CShape(shape), np.eye(4), X, 0.01, 4)
        assert (status, rows.tobytes()) == (c.OK, wanted.tobytes()) and len(rows) == 4, (shape, status)
    plane = collide.Halfspace((0, 0, 1), -0.25)
    _, hit, status, row = asker.mesh_shape(own, c.CShape(plane), np.eye(4), np.eye(4))
    assert (status, hit, row["distance"][0]) == (c.OK, False, 0.25)
    assert row.tobytes() == collide.distance(mesh, plane, np.eye(4), np.eye(4)).rows.tobytes()
