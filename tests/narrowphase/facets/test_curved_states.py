"""Whether meshes and curved shapes meet: facet by facet, alone as in batches, where hundreds of facets are near."""

from __future__ import annotations

import numpy as np
import pytest
from samples import sizes

import collide

BALL = collide.tessellate(collide.Sphere(0.5), tolerance=8e-3)
SHAPES = {
    "can": collide.Cylinder(0.3, 0.6), "cone": collide.Cone(0.3, 0.6), "ellipsoid": collide.Ellipsoid((0.3, 0.2, 0.15)),
    "needle": collide.Cylinder(0.02, 1.4),
}


POINT = collide.ConvexHull([[0.0, 0.0, 0.0]])


def bumpy(rng) -> np.ndarray:
    return BALL[0] * rng.uniform(0.85, 1.0, size=(len(BALL[0]), 1))


def meets_by_facets(mesh, shape, X_WA, X_WB) -> bool:
    """Facet by facet, each a hull; of a solid its inside, too."""
    hulls = [collide.ConvexHull(mesh.vertices[face]) for face in mesh.faces]
    n = len(hulls)
    hits = collide.collide(hulls, [shape] * n, np.repeat(X_WA[None], n, axis=0), np.repeat(X_WB[None], n, axis=0))
    centre = X_WB[:3, 3]
    return bool(hits.any()) or (mesh.solid and collide.collide(mesh, collide.Sphere(1e-9), X_WA, collide.pose(centre)))


@pytest.mark.many(4)
@pytest.mark.parametrize("solid", [False, True])
@pytest.mark.parametrize("name", SHAPES)
@sizes(24, 400)
def test_verdicts_are_those_of_the_facets(name, solid, n):
    rng, shape, n_hits = np.random.default_rng(31), SHAPES[name], 0
    mesh = collide.Mesh(bumpy(rng), BALL[1], solid=solid)
    X_WA, X_WB = (
        np.stack([collide.pose(0.35 * rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)]) for _ in "12"
    )
    hits, rows = collide.collide(mesh, shape, X_WA, X_WB), collide.distance(mesh, shape, X_WA, X_WB, signed=False).rows
    swapped = collide.distance(shape, mesh, X_WB, X_WA, signed=False).rows
    for k in range(n):
        X, Y = X_WA[k].copy(), X_WB[k].copy()
        case = f"pose {k}: X_WA={X.tolist()}, X_WB={Y.tolist()}, {shape!r}, solid={solid}"
        alone = collide.distance(mesh, shape, X, Y, signed=False)
        assert alone.rows.tobytes() == rows[k : k + 1].tobytes(), case
        assert collide.distance(shape, mesh, Y, X, signed=False).rows.tobytes() == swapped[k : k + 1].tobytes(), case
        assert collide.collide(mesh, shape, X, Y) == collide.collide(shape, mesh, Y, X) == hits[k] == alone.hit, case
        assert hits[k] == meets_by_facets(mesh, shape, X, Y), case
        if alone.hit and alone.how != collide.How.EXACT_ARITHMETIC:
            corners = collide.ConvexHull(mesh.vertices[mesh.faces[alone.part_a]])
            assert collide.collide(corners, shape, X, Y), case
            assert alone.lower == alone.upper == 0.0 and alone.certified, case
            for body, pose in ((corners, X), (shape, Y)):
                assert collide.distance(POINT, body, collide.pose(alone.point_a), pose).distance <= 1e-12, case
        n_hits += alone.hit
    assert 0.15 * n < n_hits < n


def test_a_vertex_inside_names_a_facet_beside_it():
    """The nearest facet touches within rounding, so that polytopes decide, by a corner of two facets that meet."""
    vertices = [[-1, -1, -1], [-1, -1, 1], [-1, 1, 1], [1, -1, -1], [1, -1, 1], [1, 1, 1], [3, 0, 0]]
    mesh = collide.Mesh(vertices, [[0, 3, 4], [3, 5, 4], [1, 5, 2], [6, 6, 6]], solid=False)
    X_WA = np.array([[1.0, 0, 0, -2], [0, 0, -1, 1.5], [0, 1, 0, -1], [0, 0, 0, 1]])
    r = collide.distance(mesh, collide.Cone(2, 0.25), X_WA, collide.pose((1, 1.5, -1)), signed=False)
    assert r.hit and r.part_a in (1, 3)


def tube(radius: float) -> collide.Mesh:
    turns, heights = np.linspace(0, 2 * np.pi, 48, endpoint=False), np.linspace(-1, 1, 60)
    rings = np.stack([radius * np.cos(turns), radius * np.sin(turns), np.zeros(48)], axis=1)
    vertices = (rings[None] + heights[:, None, None] * np.array([0, 0, 1.0])).reshape(-1, 3)
    i, j = np.arange(59)[:, None] * 48, np.arange(48)
    after = (j + 1) % 48
    quads = [np.stack(np.broadcast_arrays(*corners), axis=-1).reshape(-1, 3) for corners in (
        (i + j, i + 48 + j, i + 48 + after), (i + j, i + 48 + after, i + after)
    )]
    return collide.Mesh(vertices, np.concatenate(quads), solid=False)


@pytest.mark.parametrize("gap", [-1e-7, 1e-7, 1e-4, 0.05, 0.3])
def test_a_can_in_a_tube(gap):
    """All facets of the tube are near: the flats of the tube are 1·cos(π/48) m from its axis."""
    mesh, can = tube(1.0), collide.Cylinder(np.cos(np.pi / 48) - gap, 1.9)
    X = collide.pose((1, 2, 3), rpy=(0.1, 0.2, 0.3))
    assert collide.collide(mesh, can, X, X) == (gap < 0) == collide.collide(can, mesh, X[None], X[None])[0]


@pytest.mark.parametrize("solid", [False, True])
@pytest.mark.parametrize("name", SHAPES)
def test_margins_are_those_of_distances(name, solid):
    rng, shape, n_within = np.random.default_rng(32), SHAPES[name], 0
    mesh = collide.Mesh(bumpy(rng), BALL[1], solid=solid)
    for k in range(60):
        X, Y = (collide.pose(0.4 * rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) for _ in "12")
        margin, r = float(rng.choice([1e-3, 0.05, 0.2])), collide.distance(mesh, shape, X, Y, signed=False)
        case = f"pose {k}: X_WA={X.tolist()}, X_WB={Y.tolist()}, {shape!r}, {margin=}, {solid=}"
        is_within = collide.collide(mesh, shape, X, Y, security_margin=margin)
        assert is_within == (r.hit or r.distance <= margin), case
        assert is_within == collide.collide(shape, mesh, Y[None], X[None], security_margin=margin)[0], case
        n_within += is_within and not r.hit
    assert 2 < n_within < 40
