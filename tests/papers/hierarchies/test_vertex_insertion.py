"""Vertices put into a hull one by one, from whatever vertex they are near: the hull of all, with its half-edges."""

from __future__ import annotations

import numpy as np
import pytest
from half_edge_surface import Surface
from naive import rng_of

from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.half_edges import USED
from collide.papers.hierarchies.vertex_insertion import insert_near, sees

pytestmark = pytest.mark.plain_kernels


def points_of(rng, kind: str) -> np.ndarray:
    points = rng.normal(size=(26, 3))
    if kind == "lattice":
        return np.unique(rng.integers(-3, 4, (26, 3)), axis=0)[rng.permutation(20)].astype(float)
    return points / (np.linalg.norm(points, axis=1)[:, None] if kind == "sphere" else 1.0)


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["sphere", "scattered", "lattice"])
def test_the_hull_grows_by_what_is_outside(kind):
    rng = rng_of("vertex insertion", kind)
    grown = inside = 0
    for _ in range(8):
        points = points_of(rng, kind)
        surface = Surface(points, 8, room=80)
        mesh, cloud = surface.mesh, surface.cloud
        seen = np.full(len(mesh.corners) // 3, -1)
        for v in range(8, len(points)):
            above = [t for t in range(mesh.state[USED]) if mesh.corners[3 * t] >= 0 and sees(cloud, mesh, t, v)]
            corners = {int(mesh.corners[3 * t + e]) for t in above for e in range(3)}
            elsewhere = set(surface.vertices) - corners
            region, rim, stack = (np.full(200, -1) for _ in range(3))
            told = f"{points.tolist()}, {v}"
            if elsewhere:
                before = mesh.corners.copy()
                assert not insert_near(cloud, mesh, seen, v, min(elsewhere), region, rim, stack), told
                assert np.array_equal(mesh.corners, before), told
            if not above:
                inside += 1
                continue
            assert insert_near(cloud, mesh, seen, v, min(corners), region, rim, stack), told
            surface.vertices = [u for u in [*surface.vertices, v] if mesh.leaving[u] >= 0]
            surface.check()
            assert surface.is_hull(1e-9), told
            grown += 1
        if kind != "lattice":  # there the perturbation keeps no points on facets, the hull may
            assert surface.vertices == sorted(convex_hull(points).vertices.tolist()), points.tolist()
    assert grown > 40 and (inside > 10 or kind == "sphere"), (grown, inside)
