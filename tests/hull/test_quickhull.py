"""The steps of quickhull one by one: what a corner sees, the fan that it gets, the lists of points still outside."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from exact_simplex import determinant, exact
from naive import rng_of

from collide.hull import growing_hull as G
from collide.hull import quickhull as Q
from collide.hull.first_simplex import APICES, first_simplex
from collide.numerics import orientation as O

pytestmark = pytest.mark.plain_kernels


class Growing:
    """A hull that grows by one corner at a time, in whatever order."""

    def __init__(self, points: np.ndarray):
        n = self.n = len(points)
        capacity = n + APICES
        originals, scaled = [*points.ravel().tolist(), *[0.0] * (3 * APICES)], [0.0] * (3 * capacity)
        work, corners = [0.0] * O.WORK, [0] * 4
        exponent = O.survey(originals, scaled, n, work)
        self.facets, self.state = np.zeros(2 * G.FACET * capacity, dtype=np.int64), [0] * G.STATE
        self.owner, self.following = [-1] * capacity, [-1] * capacity
        self.region, self.rim, self.fan = [0] * capacity, [0] * (2 * capacity), [0] * capacity
        self.hull = G.GrowingHull(
            O.CloudView(scaled, originals, work, [0] * O.DIGITS, 0, exponent), self.facets,
            np.zeros(2 * G.PLANE * capacity), self.state, self.following, self.owner, [0] * capacity, self.region,
            self.rim, self.fan, [-1] * capacity, [0] * capacity,
        )
        assert first_simplex(self.hull.cloud, n, corners) == 3
        self.exact = exact(points)
        Q.distribute(self.hull, Q.begin(self.hull, n, corners), 4)
        self.n_fan = 4

    def alive(self) -> dict[int, list[int]]:
        rows = self.facets.reshape(-1, G.FACET)[: self.state[G.USED]]
        return {f: row[:3].tolist() for f, row in enumerate(rows) if row[0] >= 0}

    def is_above(self, i: int, triangle) -> bool:
        a, b, c = (self.exact[k] for k in triangle)
        return determinant(*([x - y for x, y in zip(p, a)] for p in (self.exact[i], b, c))) > 0

    def expand(self, i: int) -> None:
        f = self.owner[i]
        n_region, n_edges = Q.visible_region(self.hull, f, i)
        seen = {g for g, triangle in self.alive().items() if self.is_above(i, triangle)}
        assert set(map(int, self.region[:n_region])) == seen and n_region == len(seen), (
            "a corner sees all facets it is above"
        )
        self.check_rim(n_edges, seen)
        n_orphans = Q.gather(self.hull, n_region, i)
        self.owner[i] = -1
        for g in self.region[:n_region]:
            G.free_facet(self.hull, int(g))
        assert Q.build_fan(self.hull, i, n_edges)
        self.n_fan = n_edges
        Q.distribute(self.hull, n_orphans, n_edges)

    def check_rim(self, n_edges: int, seen: set[int]) -> None:
        """Every edge between what is seen and what is not, once."""
        found = {(int(self.rim[2 * k]), int(self.rim[2 * k + 1])) for k in range(n_edges)}
        across = self.facets.reshape(-1, G.FACET)[:, 3:6]
        alive = self.alive()
        true = {(g, e) for g in alive if g not in seen for e in range(3) if int(across[g, e]) in seen}
        assert found == true and len(found) == n_edges

    def check(self) -> None:
        """Closed and convex so far; every point outside is in the list of one facet that it is above, others are
        inside."""
        alive, edges = self.alive(), {}
        for f, triangle in alive.items():
            for e in range(3):
                edges[triangle[e], triangle[(e + 1) % 3]] = f
        for (i, j), f in edges.items():
            e = alive[f].index(i)
            assert int(self.facets[G.FACET * f + 3 + e]) == edges[j, i]
        vertices = {v for triangle in alive.values() for v in triangle}
        assert len(edges) == 3 * len(alive) and len(alive) == 2 * len(vertices) - 4
        for i in range(self.n):
            above = [f for f, triangle in alive.items() if self.is_above(i, triangle)]
            assert (self.owner[i] in above) if above else self.owner[i] == -1
        for f in alive:
            listed, i = [], int(self.facets[G.FACET * f + G.POINT])
            while i >= 0:
                listed.append(i)
                i = int(self.following[i])
            assert sorted(listed) == [i for i in range(self.n) if self.owner[i] == f]


CLOUDS = {
    "ball": lambda rng: rng.normal(size=(16, 3)),
    "lattice": lambda rng: np.unique(rng.integers(-1, 2, size=(20, 3)) * 1.0, axis=0),
    "sphere": lambda rng: np.array([p / np.linalg.norm(p) for p in rng.normal(size=(14, 3))]),
    "flat sides": lambda rng: np.concatenate([rng.random(size=(9, 3)) * (1, 1, 0), rng.random(size=(6, 3))]),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", CLOUDS)
def test_steps(kind):
    rng = rng_of("quickhull", kind)
    seen: Counter = Counter()
    for _ in range(6):
        hull = Growing(CLOUDS[kind](rng))
        hull.check()
        while outside := [i for i in range(hull.n) if hull.owner[i] >= 0]:
            hull.expand(int(rng.choice(outside)))
            hull.check()
            seen["steps"] += 1
        assert not any(hull.is_above(i, t) for i in range(hull.n) for t in hull.alive().values())
    assert seen["steps"] > 15, seen


@pytest.mark.slow
def test_wide_fans_are_searched_by_halving():
    """The facet that `locate` finds is one that the point is above, if it is above any of the fan."""
    rng = rng_of("locate")
    seen: Counter = Counter()
    angle = np.arange(60) * (2 * np.pi / 60)
    for _ in range(4):
        ring = np.column_stack([30 * np.cos(angle), 30 * np.sin(angle), 0.01 * rng.random(60)])
        cloud = np.concatenate(
            [ring, [[0.0, 0.0, -3.0]], [[0.0, 0.0, 1.0]], rng.normal(size=(40, 3)) * (9.0, 9.0, 1.0)]
        )
        hull = Growing(cloud)
        apex = 61
        for i in [*range(60), apex]:
            if hull.owner[i] >= 0:
                hull.expand(i)
        if hull.n_fan <= Q.WIDE_FAN or hull.alive()[int(hull.fan[0])][2] != apex:
            continue
        fan = [int(f) for f in hull.fan[: hull.n_fan]]
        for i in range(62, len(cloud)):
            above = [k for k, f in enumerate(fan) if hull.is_above(i, hull.alive()[f])]
            place, sure = Q.locate(hull.hull, len(fan), i)
            assert not sure or not above or place in above, cloud.tolist()
            seen["above" if above else "inside", bool(sure)] += 1
    assert seen["above", True] > 20, seen


def test_the_order_of_last_resort_is_a_permutation():
    for n in (1, 2, 3, 100, 5000):
        order = [0] * n
        Q.shuffle(order, n)
        assert sorted(order) == list(range(n))
        again = [0] * n
        Q.shuffle(again, n)
        assert again == order
    assert sum(abs(i - k) for i, k in enumerate(order)) > n * n / 4, "about n²/3 for a random one"
