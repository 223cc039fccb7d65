"""Meshes of the C interface: solids, hits and gaps are Python's, bit by bit; what C does not answer is said to be
unsupported."""

from __future__ import annotations

from collections import Counter

import c_library as c
import mesh_corruptions
import numpy as np
import pytest
import soak_pairs
import surfaces

import collide
from collide.kernels import mode
from collide.results import PAIR_DTYPE

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

FACETED = ("solid", "surface", "solid", "surface", "box", "capsule", "sphere", "hull", "swept hull", "flat hull")


def test_meshes_have_pythons_bits_or_are_left_to_python():
    asker, told = c.Asker(), Counter()
    for number in range(900):
        case = soak_pairs.draw(77, number, 1e4, FACETED)
        if not (case.A.meshed or case.B.meshed):
            continue
        A, B = c.CMesh(case.A), c.CMesh(case.B)
        for (one, other), (shape, partner), poses in (
            ((A, B), (case.A, case.B), (case.X_WA, case.X_WB)), ((B, A), (case.B, case.A), (case.X_WB, case.X_WA)),
        ):
            status, hit = asker.meshes_meet(one, other, *poses)
            wanted = collide.collide(shape, partner, *poses)
            assert status == c.UNSUPPORTED or (status, hit) == (c.OK, wanted), f"draw(77, {number}): {case.kinds}"
            status_of_gap, row = asker.mesh_gap(one, other, *poses)
            if status_of_gap == c.OK:
                gap = collide.distance(shape, partner, *poses).rows
                assert row.tobytes() == gap.tobytes(), f"draw(77, {number}): {case.kinds}: {row}, {gap}"
            else:
                assert status_of_gap == c.UNSUPPORTED and row.tobytes() == bytes(PAIR_DTYPE.itemsize)
            told[status, wanted, status_of_gap] += 1
    answered = sum(count for (status, _, _), count in told.items() if status == c.OK)
    gaps = sum(count for (status, hit, gap), count in told.items() if gap == c.OK)
    assert answered > 0.95 * sum(told.values()) and answered > 650, told
    assert gaps > 350 and gaps > 0.8 * sum(count for (_, hit, _), count in told.items() if not hit), told


def _surfaces() -> list:
    cavity, flat = surfaces.box((0.25, 0.25, 0.25), (0.5, 0.5, 0.5)), np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    return [
        surfaces.box(), surfaces.torus(), surfaces.ball(), surfaces.loosened(*surfaces.torus()),
        surfaces.joined(surfaces.box(), surfaces.box((3, 0, 0), (4, 1, 1))), (flat, np.array([[0, 1, 2], [0, 2, 1]])),
        surfaces.joined(surfaces.box(), (cavity[0], cavity[1][:, ::-1])),
    ]


def test_what_is_a_solid_is_what_python_takes_for_one():
    """Spoilt meshes: refused alike, or the same solid or surface."""
    random, told = np.random.default_rng(78), Counter()
    asker, probe = c.Asker(), collide.Box(0.01, 0.01, 0.01)
    own = c.CMesh(probe)
    for number in range(300):
        spoilt = mesh_corruptions.spoil(random, *_surfaces()[number % 7], mesh_corruptions.KINDS[number % 15])
        for asked, solid in ((c.SOLID_IF_CLOSED, None), (c.SOLID, True), (c.SURFACE, False)):
            try:
                mesh = collide.Mesh(spoilt.vertices, spoilt.faces, solid=solid)
            except collide.InvalidShape:
                mesh = None
            status, handle = c.raw_mesh(spoilt.vertices, spoilt.faces, asked)
            told[asked, status, mesh is not None and mesh.solid] += 1
            assert (status == c.OK) == (mesh is not None), (number, spoilt.kind, asked, status)
            if mesh is None:
                assert status == c.INVALID_SHAPE and handle is None
                continue
            made = c.CMesh.__new__(c.CMesh)
            made.handle = handle
            # A probe at the middle, where only an inside is met, tells a solid from a surface.
            for where in (spoilt.vertices.mean(axis=0), spoilt.vertices[0]):
                said = asker.meshes_meet(made, own, np.eye(4), c.identity_at(*where))
                wanted = collide.collide(mesh, probe, np.eye(4), c.identity_at(*where))
                assert said in ((c.OK, wanted), (c.UNSUPPORTED, False)), (number, spoilt.kind, asked)
    assert told[c.SOLID_IF_CLOSED, c.OK, True] > 25 and told[c.SOLID_IF_CLOSED, c.OK, False] > 25, told
    assert told[c.SOLID, c.INVALID_SHAPE, False] > 25, told


def test_cavities_are_what_python_takes_for_them():
    """A large box and others on a coarse grid, some turned inside out: within it and each other, touching, crossing."""
    random, told = np.random.default_rng(79), Counter()
    for number in range(500):
        boxes = []
        for k in range(int(random.integers(2, 6))):
            low = random.integers(0, 4, 3) if k else np.zeros(3)
            vertices, faces = surfaces.box(low, low + (random.integers(1, 4, 3) if k else 6))
            turned = bool(random.random() < (0.4 if k else 0.1))
            boxes.append((vertices, faces[:, ::-1] if turned else faces, turned))
        vertices, faces = surfaces.joined(*(box[:2] for box in boxes))
        vertices = vertices * random.choice([1.0, 0.1, 1e-30], 3)
        status, handle = c.raw_mesh(vertices, faces, c.SOLID)
        c.library().collide_mesh_free(handle)
        solid = collide.Mesh(vertices, faces).solid
        assert status == (c.OK if solid else c.INVALID_SHAPE), number
        told[solid] += any(turned for *_, turned in boxes)
    assert told[True] > 150 and told[False] > 30, told


def test_height_fields_are_meshes_to_c():
    random, asker, told = np.random.default_rng(80), c.Asker(), Counter()
    for number in range(40):
        field = collide.HeightField(random.normal(size=(7, 6)) * 0.2, (0.3, 0.25))
        body = (collide.Box(0.2, 0.3, 0.1), collide.Sphere(0.2), collide.Capsule(0.1, 0.3))[number % 3]
        A, B, X = c.CMesh(field), c.CMesh(body), c.identity_at(*random.uniform((-1, -1, -0.5), (1, 1, 1)))
        hit = collide.collide(field, body, np.eye(4), X)
        assert asker.meshes_meet(A, B, np.eye(4), X) == (c.OK, hit), number
        status, row = asker.mesh_gap(A, B, np.eye(4), X)
        if status == c.OK:
            assert row.tobytes() == collide.distance(field, body, np.eye(4), X).rows.tobytes(), number
        told[hit, status == c.OK] += 1
    assert told[False, True] > 8 and sum(count for (hit, _), count in told.items() if hit) > 8, told


def test_mesh_arguments_are_checked():
    vertices, faces = surfaces.box()
    assert c.raw_mesh(vertices, faces, 3) == (c.INVALID_ARGUMENT, None)
    assert c.raw_mesh(vertices, faces[:0], c.SURFACE) == (c.INVALID_SHAPE, None)
    normals = np.vstack([3.0 * np.eye(3), [[-1.0, -1.0, -3.0]]])  # corners at thirds
    for shape in (c.CShape(collide.Cone(1.0, 1.0)), c.CShape(collide.HPolytope(normals, [1, 1, 1, 1]))):
        assert c.raw_shape("collide_mesh_of_shape", shape.handle) == (c.UNSUPPORTED, None)
    asker, box, mesh = c.Asker(), c.CMesh(collide.Box(1, 1, 1)), c.CMesh(collide.Mesh(vertices, faces))
    X = np.eye(4)
    assert asker.meshes_meet(box, box, X, X)[0] == c.INVALID_ARGUMENT, "two convex shapes are asked about as such"
    assert asker.meshes_meet(box, mesh, X, X, 4)[0] == c.INVALID_ARGUMENT
    for bad in c.odd_poses():
        for poses in ((bad, X), (X, bad)):
            assert asker.meshes_meet(box, mesh, *poses)[0] == c.INVALID_POSE
            assert asker.mesh_gap(box, mesh, *poses)[0] == c.INVALID_POSE
