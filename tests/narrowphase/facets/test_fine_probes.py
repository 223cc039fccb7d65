"""Every question about facets, asked of trees whose boxes are relative to their nodes: the answers are those of plain
trees, and of brute force."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_families import grid, soup
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of
from naive_triangles import facet_pairs

import collide
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.fine_boxes import with_origins
from collide.narrowphase.facets.facet_queries import (
    all_hits,
    facets_on_rays,
    facets_within,
    points_in_solid,
    self_hits,
    surface_distances,
)
from collide.narrowphase.facets.ray_surface import FACET_OF, RAY, RAY_OF, VALUE
from collide.scenes.worst_cases import harpsicordia


def scattered(rng, n: int, size: float):
    """Spheres of about 1, ``size`` apart from one another, as one mesh."""
    parts = [bumpy_sphere(60, k) for k in range(n)]
    at = [size * rng.normal(size=3) * (k > 0) for k in range(n)]
    first = np.cumsum([0] + [len(v) for v, _ in parts[:-1]])
    return np.concatenate([v + x for (v, _), x in zip(parts, at)]), np.concatenate(
        [f + k for (_, f), k in zip(parts, first)]
    )


def cases():
    """(name, mesh A, mesh B, pose of A, pose of B), small and large beside one another."""
    rng = rng_of("fine probes")
    for k in range(14):
        scale = (1.0, 1e3, 1e-6, 1e5)[k % 4]
        a = (soup(rng, 60), grid(rng, 60), bumpy_sphere(80, k), scattered(rng, 5, scale))[k % 4]
        b = (soup(rng, 50), bumpy_sphere(70, k), scattered(rng, 4, 300.0))[k % 3]
        X, Y = random_pose(rng, 0.5), random_pose(rng, 0.5)
        if k % 5 == 0:  # no rotation: only shifted
            X, Y = np.eye(4), np.eye(4)
            Y[:3, 3] = rng.uniform(-0.5, 0.5, 3)
        if k % 5 == 3:  # apart
            Y[:3, 3] += (0.0, 3.0 * max(np.ptp(a[0]), 1.0), 0.0)
        yield f"case {k}", a, b, X, Y
    A, B, _ = harpsicordia(500, 10.0)
    yield "harpsicordia", (A.vertices, A.faces), (B.vertices, B.faces), np.eye(4), np.eye(4)


CASES = list(cases())


def trees(mesh):
    plain = build_mesh_tree(*mesh)
    return plain, with_origins(plain)


@pytest.mark.many(2)
@pytest.mark.parametrize(("name", "a", "b", "X", "Y"), CASES, ids=[case[0] for case in CASES])
def test_pairs_and_distances_are_those_of_plain_trees(name, a, b, X, Y):
    (A, A_fine), (B, B_fine) = trees(a), trees(b)
    want = sorted(map(tuple, all_hits(A, B, X, Y).pairs.tolist()))
    assert name == "harpsicordia" or want == facet_pairs(*a, X, *b, Y), name
    reach = 0.05
    near = {tuple(pair) for pair in facets_within(A, B, X, Y, reach, 10**6).facets.tolist()}
    distance = surface_distances(A, B, X, Y)
    for fine_a, fine_b in ((A_fine, B_fine), (A, B_fine), (A_fine, B)):
        found = all_hits(fine_a, fine_b, X, Y)
        assert sorted(map(tuple, found.pairs.tolist())) == want, name
        listed = facets_within(fine_a, fine_b, X, Y, reach, 10**6)
        differing = near ^ {tuple(pair) for pair in listed.facets.tolist()}
        assert not differing, (name, sorted(differing)[:5])
        fine = surface_distances(fine_a, fine_b, X, Y)
        assert fine.lower[0] <= distance.upper[0] and distance.lower[0] <= fine.upper[0], name
        assert fine.distance[0] == pytest.approx(distance.distance[0], rel=1e-12, abs=1e-12), name
        assert fine.meets[0] == distance.meets[0] == (len(want) > 0), name


def test_cases_meet_and_do_not():
    met = [len(all_hits(build_mesh_tree(*a), build_mesh_tree(*b), X, Y).pairs) > 0 for _, a, b, X, Y in CASES]
    assert 4 <= sum(met) <= len(met) - 2, met


def first_of(ray: int, hits: list[tuple]):
    return min((hit for hit in hits if hit[RAY_OF] == ray), key=lambda hit: (hit[VALUE], hit[FACET_OF]), default=None)


@pytest.mark.parametrize(("name", "a", "b", "X", "Y"), CASES, ids=[case[0] for case in CASES])
def test_questions_about_one_tree_are_those_of_plain_trees(name, a, b, X, Y):
    plain, fine = trees(a)
    rng = rng_of("one fine tree", name)
    assert np.array_equal(self_hits(plain)[0], self_hits(fine)[0])
    corners = a[0][a[1]]
    inside = corners[rng.integers(0, len(corners), 60)].mean(axis=1)
    points = (inside + 0.2 * rng.normal(size=inside.shape)) @ X[:3, :3].T + X[:3, 3]
    assert np.array_equal(points_in_solid(plain, X, points, np.eye(4)), points_in_solid(fine, X, points, np.eye(4)))
    rays = np.zeros((60, RAY))
    rays[:, :3] = points + rng.normal(size=points.shape)
    rays[:, 3:6] = (inside @ X[:3, :3].T + X[:3, 3]) - rays[:, :3]
    rays[:, 6], rays[:, 7] = 2.0, 1.0
    for first_only in (False, True):
        hits = [facets_on_rays(tree, X, rays, first_only)[0] for tree in (plain, fine)]
        rows = [sorted(map(tuple, rows.tolist())) for rows in hits]
        if first_only:  # the first of each ray; what is dropped behind it may differ
            rows = [[first_of(k, of) for k in range(60)] for of in rows]
        assert rows[0] == rows[1], name
    assert len(hits[0]) > 30


def test_casts_and_curved_shapes_meet_the_same_facets():
    rng = rng_of("fine casts")
    met = 0
    for k, (name, a, _, X, Y) in enumerate(CASES[:8]):
        meshes = []
        for tree in trees(a):
            mesh = collide.Mesh(*a, solid=False)
            mesh._store(_tree=tree)
            meshes.append(mesh)
        shape = (collide.Cylinder(0.3, 0.8), collide.Cone(0.4, 0.7), collide.Ellipsoid((0.3, 0.2, 0.5)))[k % 3]
        Y = Y.copy()
        Y[:3, 3] += 4.0 * rng.normal(size=3)
        found = [collide.distance(mesh, shape, X, Y) for mesh in meshes]
        assert found[0].distance == pytest.approx(found[1].distance, rel=1e-9, abs=1e-9), name
        way = X[:3, 3] - Y[:3, 3]
        other = collide.Mesh(*bumpy_sphere(40), solid=False)
        casts = [collide.shape_cast(other, Y, way, mesh, X) for mesh in meshes]
        assert casts[0].hit == casts[1].hit, name
        if casts[0].hit:
            met += 1
            assert casts[0].distance == pytest.approx(casts[1].distance, rel=1e-9, abs=1e-12), name
    assert met >= 3, met
