"""Boxes of a body that is far smaller than the facet they are compared with: none that meets it is left out, and those
that do not are."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_families import random_pose, soup
from naive import rng_of
from naive_triangles import facet_pairs

import collide
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import open_tree
from collide.narrowphase.facets.facet_queries import all_hits, first_hits
from collide.narrowphase.facets.posed_surfaces import PLACING, extent_of, place
from collide.narrowphase.facets.small_boxes import without_missed


def small_and_large(rng, ratio: float):
    """((vertices, faces) of a soup of 60 facets so many times as small as the other of 12, its pose, the other, its
    pose): small ones lie across a point of a large facet, or a few of their sizes from it."""
    small, large = soup(rng, 60, size=0.1), soup(rng, 12)
    X, Y = random_pose(rng, 0.5), random_pose(rng, 0.5)
    corners = large[0][large[1][rng.integers(len(large[1]))]]
    at = rng.dirichlet(np.ones(3)) @ corners
    X[:3, 3] = Y[:3, :3] @ at + Y[:3, 3] + ratio * rng.normal(size=3) * rng.choice((0.3, 3.0))
    return (small[0] * ratio, small[1]), X, large, Y


def test_all_pairs_of_bodies_of_very_different_sizes_are_those_of_brute_force():
    met = cases = 0
    for ratio in (2.0**-12, 1e-4, 1e-5, 1e-7, 1e-9, 1e-12):
        rng = rng_of(f"small boxes {ratio}")
        for _ in range(6):
            (va, fa), X, (vb, fb), Y = small_and_large(rng, ratio)
            A, B = build_mesh_tree(va, fa), build_mesh_tree(vb, fb)
            want = facet_pairs(va, fa, X, vb, fb, Y)
            asked = (va.tolist(), fa.tolist(), X.tolist(), vb.tolist(), fb.tolist(), Y.tolist())
            told = f"ratio {ratio}: va, fa, X, vb, fb, Y = {asked}"
            assert list(map(tuple, all_hits(A, B, X, Y).pairs.tolist())) == want, told
            assert sorted(map(tuple, all_hits(B, A, Y, X).pairs[:, ::-1].tolist())) == want, told
            assert len(first_hits(A, B, X, Y).pairs) == bool(want), told
            met += bool(want)
            cases += 1
    assert 0.3 * cases < met < 0.9 * cases, (met, cases)


def parted_exactly(corners, box_low, box_high) -> bool:
    """Whether a plane parts a triangle from a box, for sure: by all axes of polyhedra, in fractions."""
    points = [[Fraction(x) for x in corner] for corner in corners]
    bounds = list(zip(map(Fraction, box_low), map(Fraction, box_high)))

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    edges = [[q - p for p, q in zip(points[k], points[k - 1])] for k in range(3)]
    units = [[Fraction(int(i == k)) for i in range(3)] for k in range(3)]
    for n in [*units, cross(edges[0], edges[1]), *(cross(e, u) for e in edges for u in units)]:
        heights = [sum(a * b for a, b in zip(n, p)) for p in points]
        ends = [sorted((a * low, a * high)) for a, (low, high) in zip(n, bounds)]
        if max(heights) < sum(e[0] for e in ends) or min(heights) > sum(e[1] for e in ends):
            return True
    return False


@pytest.mark.plain_kernels
def test_boxes_left_out_are_parted_by_a_plane_and_nearly_all_such_boxes_are_left_out():
    rng = rng_of("boxes that a facet misses")
    left_out = parted = 0
    pose = np.eye(4).ravel()
    for case in range(60):
        ratio = 10.0 ** -rng.uniform(4, 9)
        (va, fa), X, (vb, _), Y = small_and_large(rng, ratio)
        inverse = np.linalg.inv(X)
        corners = (vb.reshape(-1, 3, 3)[rng.integers(12)] @ Y[:3, :3].T + Y[:3, 3]) @ inverse[:3, :3].T + inverse[:3, 3]
        A, B = build_mesh_tree(va, fa), build_mesh_tree(corners, np.array([[0, 1, 2]]))
        views = open_tree(A.address), open_tree(B.address)
        placing, frames = np.zeros(PLACING), np.zeros((2, 9), dtype=np.float32)
        assert place(extent_of(views[0]), pose, extent_of(views[1]), pose, placing, *frames)
        for node in range(len(A.nodes)):
            mask = sum(1 << int(slot) for slot in np.flatnonzero(A.used([node])[0]))
            kept = without_missed(placing, 1, views[1], 0, views[0], node, mask)
            centres, halves = A.boxes([node])
            low, high = ((centres[0] + s * halves[0]) * 2.0**A.exponent + A.centre for s in (-1, 1))
            for slot in range(8):
                if (mask >> slot) & 1:
                    truth = parted_exactly(corners, low[slot], high[slot])
                    told = f"case {case}: {corners.tolist()}, {low[slot].tolist()}, {high[slot].tolist()}"
                    assert truth or (kept >> slot) & 1, told
                    parted += truth
                    left_out += not (kept >> slot) & 1
    assert parted > 200 and left_out > 0.98 * parted, (left_out, parted)


def ball(levels: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a ball of 20 · 4^levels facets and radius 1, about."""
    return collide.tessellate(collide.Sphere(1.0), tolerance=0.1 * 4.0**-levels)


def test_a_small_body_at_a_large_facet_is_not_walked_facet_by_facet():
    """A ball a million times as small as the slab that it stands beside, or reaches a fifth of its size into: facets
    tested grow as its boundary on the slab does, at most."""
    slab = collide.tessellate(collide.Box((1.0, 0.8, 0.6)))
    X_WB = collide.pose((0.2, 0.1, 0.0), rpy=(0.3, -0.2, 0.5))
    for levels in (2, 3, 4):
        vertices, faces = ball(levels)
        A, B = build_mesh_tree(1e-6 * vertices, faces), build_mesh_tree(*slab)
        for into, most in ((-0.2, 0), (0.2, 40.0 * len(faces) ** 0.5)):
            X_WA = X_WB @ collide.pose((0.03, 0.05, 0.3 + 1e-6 * (1.0 - into)))
            found = all_hits(A, B, X_WA, X_WB)
            nodes, triangles, _ = found.counters[0]
            assert triangles <= most and nodes <= 40 + most, (len(faces), into, nodes, triangles)
            assert bool(len(found.pairs)) == (into > 0)
