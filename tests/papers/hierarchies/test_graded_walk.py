"""The counted walk over hierarchies of boxes: it comes to every pair of facets whose boxes meet, and n log n shows."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import bumpy_sphere
from naive import pose, rng_of, rotation

from collide.mesh.build_bvh import build_mesh_tree
from collide.papers.hierarchies.graded_tree import graded_tree
from collide.papers.hierarchies.graded_walk import boxes_of_graded, boxes_of_queries, count_walk
from collide.scenes.worst_cases import harpsicordia

KINDS = {
    "cubes": lambda v, f: boxes_of_graded(graded_tree(v, f), v, f),
    "tight": lambda v, f: boxes_of_graded(graded_tree(v, f), v, f, tight=True),
    "queries": lambda v, f: boxes_of_queries(build_mesh_tree(v, f), v, f),
}


def facets_whose_boxes_meet(a, b, X_AB) -> int:
    """By all pairs: boxes along A's axes, parted by these and by the axes of B's frame as X_AB lays them."""
    R, t = X_AB[:3, :3], X_AB[:3, 3]
    S = np.linalg.inv(R)
    boxes = [(v[f].min(axis=1), v[f].max(axis=1)) for v, f in (a, b)]
    (ca, ha), (cb, hb) = (((low + high) / 2, (high - low) / 2) for low, high in boxes)
    across = (cb @ R.T + t)[None] - ca[:, None]
    meet = (np.abs(across) <= ha[:, None] + (hb @ np.abs(R).T)[None] + 1e-12).all(axis=2)
    return int((meet & (np.abs(across @ S.T) <= hb[None] + (ha @ np.abs(S).T)[:, None] + 1e-12).all(axis=2)).sum())


@pytest.mark.parametrize("kind", KINDS)
def test_the_walk_comes_to_all_pairs_of_facets_whose_boxes_meet(kind):
    rng = rng_of("graded walk", kind)
    found = fewer = 0
    for k in range(8):
        a, b = (soup(rng, 60), soup(rng, 50)) if k % 2 else (bumpy_sphere(120, k), bumpy_sphere(150, k + 1))
        X = pose(rotation(rng), 0.3 * rng.normal(size=3))
        X[:3, :3] *= (1.0, 0.2, 3.0, 1.0)[k % 4]
        counts = count_walk(KINDS[kind](*a), KINDS[kind](*b), X)
        want = facets_whose_boxes_meet(a, b, X)
        assert counts.facet_pairs == want, f"seed {k}: {counts}, wanted {want} of X_AB = {X.tolist()}"
        assert counts.facet_pairs <= counts.meeting <= counts.compared
        found += want
        fewer += counts.compared < len(a[1]) * len(b[1])
    assert found > 1000 and fewer > 3, (found, fewer)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cubes", "tight"])
def test_harpsicordia_show_the_bound_of_theorem_3_6(kind):
    """Σ = n. Pairs of boxes that meet, the walk's calls: a constant a meeting, and below 8 n log2 n."""
    of_meeting, of_bound = [], []
    for n in (500, 1000, 2000, 4000):
        A, B, meetings = harpsicordia(n, 10.0)
        counts = count_walk(*(KINDS[kind](mesh.vertices, mesh.faces) for mesh in (A, B)))
        of_meeting.append(counts.meeting / meetings)
        of_bound.append(counts.meeting / (len(A.vertices) * np.log2(len(A.vertices))))
        assert 12.0 < counts.facet_pairs / meetings < 13.5
    assert max(of_meeting) < 1.15 * min(of_meeting) and max(of_bound) < 8.0, (of_meeting, of_bound)
