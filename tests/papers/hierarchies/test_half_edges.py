"""Surfaces of half-edges that lose vertices: twins and Euler's number after every step, rings in order, holes that
are closed by the hull."""

from __future__ import annotations

import numpy as np
import pytest
from half_edge_surface import Surface
from naive import rng_of

from collide.papers.hierarchies.half_edges import (
    degree_of,
    drop_star,
    fill_hole,
    following,
    plan_hole,
    read_ring,
)
from collide.papers.hierarchies.independent_sets import by_degree, change_degrees, is_anchor, raises

pytestmark = pytest.mark.plain_kernels


def points_of(rng, kind: str) -> np.ndarray:
    points = rng.normal(size=(24, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points if kind == "sphere" else np.unique(np.rint(points * 40), axis=0)


@pytest.mark.parametrize("kind", ["sphere", "lattice"])
def test_vertices_leave_one_after_another(kind):
    rng = rng_of("half-edges", kind)
    removed = 0
    for _ in range(6):
        surface = Surface(points_of(rng, kind))
        surface.check()
        mesh, scratch = surface.mesh, [np.zeros(200, dtype=np.int64) for _ in range(5)]
        ring, outer, plan, stack, open_edges = scratch
        while len(surface.vertices) > 4:
            v = int(rng.choice(surface.vertices))
            d = read_ring(mesh, v, ring, outer)
            known = surface.ring(v)
            at = known.index(ring[0])
            assert ring[:d].tolist() == known[at:] + known[:at] and d == degree_of(mesh, v) == len(known)
            for k in range(d):
                assert mesh.corners[outer[k]] == ring[(k + 1) % d] and mesh.corners[following(outer[k])] == ring[k]
            degree = np.array([degree_of(mesh, u) if u in surface.vertices else 0 for u in range(len(surface.points))])
            assert plan_hole(surface.cloud, ring, 0, d, plan, stack)
            too_many = {b for b in range(3, 24) if raises(degree, ring, d, plan, b, open_edges)}
            drop_star(mesh, v)
            fill_hole(mesh, ring, 0, d, outer, plan, open_edges)
            surface.vertices.remove(v)
            surface.check()
            assert surface.is_hull(1e-12 if kind == "sphere" else 1e-6), (surface.points.tolist(), surface.triangles())
            before = degree.copy()
            change_degrees(degree, ring, d, plan)

            assert all(degree[u] == degree_of(mesh, u) == len(surface.ring(u)) for u in surface.vertices if u in known)
            # Every neighbour loses the edge to v first: what a diagonal more only makes up for is no rise.
            top = max([degree[u] for u in known if degree[u] > before[u]], default=0)
            assert too_many == set(range(3, top)), (top, too_many)
            removed += 1
    assert removed > 60


def test_vertices_by_rising_degree():
    rng = rng_of("by degree")
    for _ in range(30):
        degree = rng.integers(3, 12, 40)
        vertices = rng.permutation(40)[: rng.integers(1, 41)]
        limit, order = int(rng.integers(3, 13)), np.full(40, -1)
        listed = by_degree(vertices, len(vertices), degree, limit, order)
        want = sorted((v for v in vertices.tolist() if degree[v] <= limit), key=lambda v: degree[v])
        assert order[:listed].tolist() == want
    state = [0, 0, 5, 7, 9, 11, 0]
    assert [v for v in range(12) if is_anchor(state, v)] == [5, 7, 9, 11]
