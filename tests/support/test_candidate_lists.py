"""Rings in cyclic order, and candidate lists against linear programs: who may be farthest where a coarse vertex is."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import rng_of, rotation
from reproduction import reproducing

from collide.hull.exact_hull import convex_hull
from collide.kernels import address_of
from collide.support import grow_tree as grow
from collide.support.rings import order_rings, put_rings

optimize = pytest.importorskip("scipy.optimize")

SOURCE = "points, n_coarse = {points}, {n_coarse}  # tests/support/test_candidate_lists.py"


def cloud(rng, kind: str) -> np.ndarray:
    if kind == "prism":  # caps and sides of many level corners
        angle = np.arange(12) * (np.pi / 6)
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.ones(12)])
        return np.concatenate([ring, ring * (1.0, 1.0, -1.0)]) @ rotation(rng)
    if kind == "box":
        return np.array([p for p in np.ndindex(2, 2, 2)], dtype=float)
    points = rng.normal(size=(28, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points * {"ball": (1.0, 1.0, 1.0), "pancake": (1.0, 1.0, 0.01), "needle": (1.0, 0.05, 0.05)}[kind]


def margin(points, w: int, coarse, v: int) -> float:
    """By how much w can lead all points, and v all coarse ones, in one direction of coordinates up to 1; else 0."""
    leads = np.concatenate([points[w] - np.delete(points, w, axis=0), points[v] - coarse[(coarse != points[v]).any(1)]])
    leads = leads / np.linalg.norm(leads, axis=1)[:, None]
    objective = [0.0, 0.0, 0.0, -1.0]
    rows = np.column_stack([-leads, np.ones(len(leads))])
    return -optimize.linprog(objective, A_ub=rows, b_ub=np.zeros(len(rows)), bounds=[(-1, 1)] * 3 + [(None, 1)]).fun


def lists_of(points, facets, fine, coarse) -> dict[int, list[int]]:
    """Candidates among the fine vertices of each coarse one, by kernels as Python."""
    n, f, m = len(points), len(facets), len(coarse)
    memory = np.zeros(grow.tree_memory(n, f, 1 << 14) // 8, dtype=np.int64)
    tree = grow._growing(address_of(memory), n, f, 1 << 14)[0]
    tree.points[: 3 * n] = points.ravel()
    assert put_rings(tree.points, n, facets.ravel(), f, tree.rings, tree.flat_workspace) == 0
    tree.ordered[: len(fine)] = [*coarse, *np.setdiff1d(fine, coarse)]
    tree.place[tree.ordered[: len(fine)]] = np.arange(len(fine))
    tree.header[grow.SIZES : grow.SIZES + 2] = len(fine), m
    assert grow._add_levels(tree, 2) == 0
    starts, pairs = tree.list_workspace.list_starts, tree.list_workspace.pairs
    return {int(v): pairs[starts[i] : starts[i + 1]].tolist() for i, v in enumerate(coarse)}


class Rings:
    """What `order_rings` makes of a surface."""

    def __init__(self, points, facets):
        n, f = len(points), len(facets)
        self.starts, self.ring, self.ring_facets, following, self.corner = (
            np.empty(k, dtype=np.int32) for k in (n + 1, 3 * f, 3 * f, 6 * f, n)
        )
        self.normals = np.empty((f, 3))
        self.status = order_rings(
            address_of(points), n, address_of(facets), f, address_of(self.starts), address_of(self.ring),
            address_of(self.ring_facets), address_of(following), address_of(self.corner), address_of(self.normals),
        )


@pytest.mark.plain_kernels
@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["ball", "pancake", "needle", "prism", "box"])
def test_lists_hold_whoever_may_be_farthest(kind):
    """A vertex stands in a list exactly where its normal cone meets the owner's in directions of some extent."""
    rng = rng_of("candidate lists", kind)
    seen: Counter = Counter()
    points = np.ascontiguousarray(cloud(rng, kind))
    hull = convex_hull(points)
    fine = np.sort(hull.vertices).astype(np.int32)
    coarse = np.ascontiguousarray(rng.permutation(fine)[: max(len(fine) // 4, 3)])
    with reproducing(SOURCE, points=points, n_coarse=len(coarse)):
        for v, listed in lists_of(points, hull.facets, fine, coarse).items():
            assert len(set(listed)) == len(listed) and v in listed
            for w in fine.tolist():
                possible = margin(points, w, points[coarse], v)
                if possible > 1e-7:
                    assert w in listed, (v, w)
                elif possible < 1e-12 and kind not in ("prism", "box") and w not in coarse:  # cones may just touch
                    assert w not in listed, (v, w)
                seen[w in listed] += 1
    assert seen[True] >= len(fine) and seen[False] >= 3, seen


@pytest.mark.plain_kernels
def test_lists_along_long_arcs():
    """Edges of a cap turn a quarter, past dozens of coarse vertices: whoever leads both subsets in a direction is
    listed."""
    rng = rng_of("long arcs")
    angle = np.arange(90) * (np.pi / 45)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.ones(90)]) * (1.0, 0.7, 0.1)
    points = np.ascontiguousarray(np.concatenate([ring, ring * (1.0, 1.0, -1.0)]) @ rotation(rng))
    hull = convex_hull(points)
    fine, coarse = np.sort(hull.vertices).astype(np.int32), np.arange(180, dtype=np.int32)[::2] + np.arange(90) // 45
    coarse = np.ascontiguousarray(rng.permutation(coarse), dtype=np.int32)
    listed = {(v, w) for v, rows in lists_of(points, hull.facets, fine, coarse).items() for w in rows}
    directions = rng.normal(size=(20000, 3))
    owners = coarse[(points[coarse] @ directions.T).argmax(axis=0)]
    met = set(zip(owners.tolist(), (points @ directions.T).argmax(axis=0).tolist()))
    assert met <= listed and len(met) >= 200, (len(met), met - listed)


@pytest.mark.parametrize("kind", ["ball", "prism", "box"])
def test_rings(kind):
    """Neighbours one after another span the facet that is named, with unit normals outwards."""
    points = np.ascontiguousarray(cloud(rng_of("rings", kind), kind))
    facets = np.ascontiguousarray(convex_hull(points).facets, dtype=np.int32)
    rings = Rings(points, facets)
    assert rings.status == 0 and len(rings.ring) == 3 * len(facets) == rings.starts[-1]
    middle = points.mean(axis=0)
    for f, (a, b, c) in enumerate(facets.tolist()):
        true = np.cross(points[b] - points[a], points[c] - points[a])
        assert np.abs(rings.normals[f] - true / np.linalg.norm(true)).max() <= 1e-14
        assert rings.normals[f] @ (points[a] - middle) > 0
    for v in range(len(points)):
        ring = rings.ring[rings.starts[v] : rings.starts[v + 1]].tolist()
        named = rings.ring_facets[rings.starts[v] : rings.starts[v + 1]].tolist()
        assert set(named) == set(np.flatnonzero((facets == v).any(axis=1)).tolist())
        for k, f in enumerate(named):
            triangle = facets[f].tolist()
            turned = triangle[triangle.index(v) :] + triangle[: triangle.index(v)]
            assert turned == [v, ring[k], ring[(k + 1) % len(ring)]]
    assert rings.corner.all()


def test_surfaces_that_are_none():
    """Open ones, and vertices where several sheets meet, are refused."""
    points = np.array([p for p in np.ndindex(2, 2, 2)], dtype=float)
    facets = np.ascontiguousarray(convex_hull(points).facets, dtype=np.int32)
    assert Rings(points, facets[:-1].copy()).status == 2
    two = np.concatenate([points, points[1:] - 1.0 * points[1:] * 2])  # both cubes have corner 0
    mirrored = facets.copy()
    mirrored[facets > 0] += 7
    assert Rings(two, np.concatenate([facets, mirrored[:, ::-1]]).astype(np.int32)).status == 2
