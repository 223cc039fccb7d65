"""Surfaces of half-edges that lose vertices: twins and Euler's number after every step, rings in order, holes that
are closed by the hull."""

from __future__ import annotations

import numpy as np
import pytest
from naive import rng_of

from collide.hierarchies.half_edges import (
    FREE,
    USED,
    HalfEdges,
    degree_of,
    drop_star,
    fill_hole,
    following,
    plan_hole,
    preceding,
    read_ring,
)
from collide.hierarchies.independent_sets import by_degree, change_degrees, is_anchor, raises
from collide.hierarchies.true_facets import Cloud, twins_of
from collide.hull.exact_hull import convex_hull
from collide.numerics.orientation import CloudView

pytestmark = pytest.mark.plain_kernels


class Surface:
    """The hull of points as half-edges, its cloud, and rings by dictionaries."""

    def __init__(self, points: np.ndarray):
        triangles = np.ascontiguousarray(convex_hull(points).facets, dtype=np.int32)
        cloud = Cloud(points)
        self.points, self.kept = points, cloud
        self.cloud = CloudView(
            cloud.scaled.ravel(), cloud.originals.ravel(), cloud.work, cloud.digits, cloud.count, cloud.exponent
        )
        leaving = np.full(len(points), -1)
        leaving[triangles.ravel()] = np.arange(triangles.size)
        state = np.array([-1, len(triangles), *[-1] * 4, 0])
        self.mesh = HalfEdges(triangles.ravel().astype(np.int64), twins_of(triangles).astype(np.int64), leaving, state)
        self.vertices = sorted(set(triangles.ravel().tolist()))

    def triangles(self) -> list[tuple[int, int, int]]:
        rows = self.mesh.corners[: 3 * self.mesh.state[USED]].reshape(-1, 3).tolist()
        return [tuple(row) for row in rows if row[0] >= 0]

    def ring(self, v: int) -> list[int]:
        """Neighbours in order, from the triangles alone, beginning with the least."""
        after = {}
        for a, b, c in self.triangles():
            for x, y, z in ((a, b, c), (b, c, a), (c, a, b)):
                if x == v:
                    after[y] = z
        ring = [min(after)]
        while after[ring[-1]] != ring[0]:
            ring.append(after[ring[-1]])
        assert len(ring) == len(after)
        return ring

    def check(self) -> None:
        corners, twins, leaving, state = self.mesh
        free, t = set(), state[FREE]
        while t >= 0:
            assert corners[3 * t] == -1 and t not in free
            free.add(t)
            t = twins[3 * t]
        there = [h for h in range(3 * state[USED]) if h // 3 not in free]
        for h in there:
            g = twins[h]
            assert twins[g] == h and corners[g] == corners[following(h)] and corners[following(g)] == corners[h]
            assert following(preceding(h)) == h == preceding(following(h)) and h // 3 == following(h) // 3
        for v in self.vertices:
            assert corners[leaving[v]] == v and leaving[v] // 3 not in free
        assert len(self.vertices) - len(there) // 2 + len(there) // 3 == 2, "Euler"

    def is_hull(self, slack: float) -> bool:
        """Every vertex is behind every triangle."""
        P = self.points
        return all(
            ((P[self.vertices] - P[a]) @ np.cross(P[b] - P[a], P[c] - P[a])).max() <= slack
            for a, b, c in self.triangles()
        )


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
