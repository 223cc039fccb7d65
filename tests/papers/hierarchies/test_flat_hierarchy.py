"""Hierarchies of polygons, segments and points: levels that lose every other corner, and Lemma 4.2 on each of them."""

from __future__ import annotations

import numpy as np
import pytest
from naive import rng_of, rotation

from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.flat_hierarchy import flat_hierarchy


def lists(starts, entries, row) -> list[int]:
    return entries[starts[row] : starts[row + 1]].tolist()


def polygon(rng, n: int) -> np.ndarray:
    """Corners in a plane of fractions, points on its edges and inside."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    corners = np.rint(np.column_stack([np.cos(angles), np.sin(angles)]) * 2.0**20)
    middles = 0.5 * (corners + np.roll(corners, 1, axis=0))
    flat = np.concatenate([corners, middles, 0.25 * corners[:3]])
    return flat[rng.permutation(len(flat))] @ [[1.0, 0.0, 2.0], [0.0, 1.0, -1.0]]


@pytest.mark.parametrize("n", [3, 4, 5, 9, 40])
def test_levels_of_polygons(n):
    rng = rng_of("flat hierarchy", n)
    points = polygon(rng, n)
    hull = convex_hull(points)
    h = flat_hierarchy(points, hull)
    levels = [h.level_vertices[a:b].tolist() for a, b in zip(h.level_start[:-1], h.level_start[1:])]
    area = [k for k in range(len(points)) if is_corner(points, k)]
    assert sorted(levels[0]) == area and len(levels[-1]) <= 4
    for level, cycle in enumerate(levels):
        places = {v: k for k, v in enumerate(cycle)}
        for v in cycle:
            row = h.row[v] + level
            ring = lists(h.neighbour_start, h.neighbours, row)
            k = places[v]
            assert sorted(ring) == sorted({cycle[k - 1], cycle[(k + 1) % len(cycle)]}), (n, level, v)
        if level:
            gone = set(levels[level - 1]) - set(cycle)
            assert set(cycle) < set(levels[level - 1]) and len(gone) == len(levels[level - 1]) // 2
            for d in rng.normal(size=(40, 3)):
                heights = points @ d
                top = max(cycle, key=lambda v: heights[v])
                beyond = [v for v in levels[level - 1] if heights[v] > heights[top]]
                removed = lists(h.removed_start, h.removed, h.row[top] + level)
                assert len(beyond) <= 1 and set(beyond) <= set(removed) <= gone, (n, level)
    assert (h.birth[area] == 0).all() and (np.delete(h.birth, area) == -1).all()


def is_corner(points, k: int) -> bool:
    """Whether the hull of the others is smaller, in a plane where x and y tell points apart."""
    return k in convex_corners(points[:, :2].tolist())


def convex_corners(points) -> set[int]:
    """Andrew's monotone chain, collinear points dropped."""
    order = sorted(range(len(points)), key=lambda k: points[k])
    found: set[int] = set()
    for sequence in (order, order[::-1]):
        chain: list[int] = []
        for k in sequence:
            while len(chain) > 1 and turn(points[chain[-2]], points[chain[-1]], points[k]) <= 0:
                chain.pop()
            chain.append(k)
        found |= set(chain)
    return found


def turn(a, b, c) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def test_segments_and_points():
    R = rotation(rng_of("segments"))
    segment = flat_hierarchy(*both(np.array([[0.0, 0, 0], [1, 2, 3], [2, 4, 6]])))
    assert sorted(segment.level_vertices.tolist()) == [0, 2] and sorted(segment.neighbours.tolist()) == [0, 2]
    point = flat_hierarchy(*both(np.array([R[0], R[0]])))
    assert len(point.level_vertices) == 1 and not len(point.neighbours) and not len(point.removed)


def both(points):
    return points, convex_hull(points)
