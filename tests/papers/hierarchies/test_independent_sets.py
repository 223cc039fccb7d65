"""Levels of hierarchies: what leaves is independent and small in degree, what stays is the hull of what is left."""

from __future__ import annotations

import numpy as np
import pytest
from naive import rng_of

from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.hierarchy import build_hierarchy

BOUNDS = (0, 12, 64)


def edges_of(triangles) -> set[tuple[int, int]]:
    return {(int(t[k]), int(t[k - 1])) for t in triangles for k in range(3)}


@pytest.mark.many(2)
@pytest.mark.parametrize("bound", BOUNDS)
def test_independence_degrees_and_hulls(bound):
    rng = rng_of("independent sets", bound)
    removed = raised = 0
    for kind in range(4):
        points = rng.normal(size=(150, 3)) * (1.0, 1.0, 1.0 if kind % 2 else 0.2)
        points /= np.linalg.norm(points / (1.0, 1.0, 1.0 if kind % 2 else 0.2), axis=1)[:, None]
        if kind == 2:  # neighbours of two poles
            points[:, 2] = 0.0
            points /= np.linalg.norm(points, axis=1)[:, None]
            points = np.concatenate([points, [[0.0, 0.0, 0.7], [0.0, 0.0, -0.7]]])
        hierarchy = build_hierarchy(points, convex_hull(points), bound)
        assert len(hierarchy.vertices(hierarchy.depth - 1)) == 4
        for level in range(hierarchy.depth - 1):
            here, there = (set(hierarchy.vertices(k).tolist()) for k in (level, level + 1))
            triangles = hierarchy.triangles(level)
            edges = edges_of(triangles)
            gone = here - there
            assert gone and not any(a in gone and b in gone for a, b in edges), (kind, level)
            assert all((b, a) in edges for a, b in edges), "twins"
            assert len(here) - len(edges) // 2 + len(triangles) == 2, "Euler"
            degrees = np.bincount(np.array(sorted(edges))[:, 0], minlength=len(hierarchy.points))
            assert degrees[hierarchy.vertices(level)].tolist() == hierarchy.degrees(level).tolist()
            if bound:
                raised += int((degrees > bound).sum())
                # Where nothing is cut no degree is raised over the bound; next to a cut some may be for a few levels.
                after = dict(zip(hierarchy.vertices(level + 1).tolist(), hierarchy.degrees(level + 1).tolist()))
                is_cut = not there <= here
                assert is_cut or all(after[v] <= max(bound, degrees[v]) for v in there), (kind, level)
                assert level < hierarchy.depth // 2 or max(after.values()) <= bound, (kind, level)
            removed += len(gone)
            P = hierarchy.points
            for a, b, c in hierarchy.triangles(level + 1).tolist():
                heights = (P[sorted(there)] - P[a]) @ np.cross(P[b] - P[a], P[c] - P[a])
                assert heights.max() <= 1e-9, (kind, level)
    assert removed > 400 and (raised > 0 or not bound), (removed, raised)
