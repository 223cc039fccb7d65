"""Meshes as proofs see them: vertices in use, corners of facets, and points proven inside, by winding numbers."""

from __future__ import annotations

from collections import Counter

import numpy as np
from mesh_shapes import block_ring, box
from naive import pose, random_pose, rng_of
from naive_triangles import as_integers, winding, world_points

import collide
from collide.certificates.certificate import NO_VERTEX
from collide.certificates.mesh_proofs import ProofBody, flaw_of_inside_proof, flaw_of_mesh_certificates

EYE = np.eye(4)
VERTICES = np.concatenate([[[50.0, 50.0, 50.0]], box()[0]])
MESH = collide.Mesh(VERTICES, box()[1] + 1)


def test_vertices_in_use():
    body = ProofBody(MESH, EYE)
    assert body.is_mesh and body.is_solid_mesh and body.has_certificates and body.n_facets == 12
    assert not body.has_vertex(0) and body.has_vertex(1) and body.has_vertex(8)
    assert not body.has_vertex(9) and not body.has_vertex(-1)
    assert len(body.part()) == 8 and [body.id_of(k, None) for k in (0, 7)] == [1, 8] and body.id_of(2, [5, 6, 7]) == 7
    assert body.indices_of([1, 8, 0, 99]) == [0, 7, -1, -1]
    assert body.corners(3) == MESH.faces[3].tolist()
    assert np.array_equal(body.part(body.corners(3)).points_P, VERTICES[MESH.faces[3]])


def test_convex_shapes_and_those_without_certificates():
    cube = ProofBody(collide.Box((1, 1, 1)), EYE)
    assert not cube.is_mesh and cube.n_facets == 1 and cube.corners(0) is None and cube.has_certificates
    assert cube.has_vertex(7) and not cube.has_vertex(8) and cube.indices_of([5]) == [5]
    half = ProofBody(collide.Halfspace((0, 0, 1), 0.0), EYE)
    assert half.has_certificates and not half.has_vertex(0)
    for shape in (
        collide.Cylinder(1, 1), collide.Compound([(collide.Sphere(1), EYE), (collide.Sphere(1), EYE)]),
        collide.Compound([(collide.Sphere(1), pose(t=(1, 0, 0)))]), collide.Compound([(MESH, EYE)]),
    ):
        assert not ProofBody(shape, EYE).has_certificates
    assert "or of a point, alone" in flaw_of_mesh_certificates(MESH, collide.Cylinder(1, 1), EYE, EYE, [], "apart")


def test_inside_is_what_winding_numbers_say():
    rng = rng_of("inside proofs")
    seen: Counter = Counter()
    vertices, faces = block_ring()
    solid = collide.Mesh(vertices, faces)
    for k in range(80):
        points = rng.integers(-4, 5, (4, 3)) / 2 if k % 2 else rng.uniform(-2, 2, (4, 3))
        X, Y = (random_pose(rng, 0.3), random_pose(rng, 0.3)) if k % 4 < 2 else (EYE, pose(t=(0.25, 0.0, 0.5)))
        body = (collide.ConvexHull(points), collide.Mesh(points, [[0, 1, 2], [1, 2, 3]], solid=False))[k // 2 % 2]
        A, B = ProofBody(solid, X), ProofBody(body, Y)
        corners, others = as_integers(world_points(vertices, X), world_points(points, Y))
        for vertex, p in enumerate(others):
            number = winding([[corners[v] for v in face] for face in faces.tolist()], p)
            want = number is None or number > 0  # solids are closed
            told = f"{points.tolist()}, {X.tolist()}, {Y.tolist()}: {vertex}"
            assert (flaw_of_inside_proof(A, B, [(NO_VERTEX, vertex)]) is None) == want, told
            assert (flaw_of_inside_proof(B, A, [(vertex, NO_VERTEX)]) is None) == want, told
            seen[number] += 1
    assert seen[None] >= 5 and seen[1] > 30 and seen[0] > 30, seen


def test_what_is_no_proof_of_inside():
    A, B = ProofBody(MESH, EYE), ProofBody(collide.Sphere(0.25), EYE)
    surface = ProofBody(collide.Mesh(*box(), solid=False), EYE)
    assert flaw_of_inside_proof(A, B, [(NO_VERTEX, 0)]) is None
    for first, second, pairs in (
        (A, B, []), (A, B, [(0, 0)]), (A, B, [(NO_VERTEX, NO_VERTEX)]), (A, B, [(NO_VERTEX, 0)] * 2),
        (A, B, [(NO_VERTEX, 1)]), (A, B, [(0, NO_VERTEX)]), (surface, B, [(NO_VERTEX, 0)]), (B, B, [(NO_VERTEX, 0)]),
        (B, A, [(NO_VERTEX, 0)]),
    ):
        assert flaw_of_inside_proof(first, second, pairs), pairs
