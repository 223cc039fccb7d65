"""A segment beside a posed tree: its box culls no facet that it meets, and how it passes each is exact."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from mesh_families import grid, soup
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of
from naive_triangles import as_integers, cross, inner, minus, triangles_meet, world_points
from posed_facets import numbers_of

from collide.kernels import address_of
from collide.kernels.plain import code_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import open_tree
from collide.narrowphase.facets.exact_triangles import BACK, BY, FROM, INTEGERS, PASS, THROUGH, decide_exactly
from collide.narrowphase.facets.posed_segment import (
    COUNTERS,
    EXACT,
    SEGMENT_DOUBLES,
    SEGMENT_FLOATS,
    ask_segment_exactly,
    open_segment,
    place_segment,
)
from collide.narrowphase.facets.posed_surfaces import ERROR

pytestmark = pytest.mark.plain_kernels


def test_every_facet_is_passed_as_exact_arithmetic_says():
    rng = rng_of("posed segments")
    seen: Counter = Counter()
    for k in range(24):
        vertices, faces = (soup(rng, 40, 0.7), grid(rng, 40), bumpy_sphere(40, k))[k % 3]
        tree, X = build_mesh_tree(vertices, faces), random_pose(rng)
        Y = X.copy() if k % 3 == 1 else random_pose(rng)
        ends = rng.integers(-1, 4, (2, 3)) * 1.0 if k % 3 == 1 else rng.uniform(-2.0, 2.0, (2, 3))
        if k % 4 == 0:  # through the middle of an edge, but for rounding
            middle = X[:3, :3] @ vertices[faces[0, :2]].mean(axis=0) + X[:3, 3] - Y[:3, 3]
            ends[1] = 2 * (Y[:3, :3].T @ middle) - ends[0]
        buffers = (
            X.ravel().copy(), Y.ravel().copy(), np.zeros(SEGMENT_DOUBLES), np.zeros(SEGMENT_FLOATS, dtype=np.float32),
            np.zeros(INTEGERS, dtype=np.int64), np.zeros(COUNTERS, dtype=np.int64),
        )
        at = [address_of(buffer) for buffer in buffers]
        segment = open_segment(open_tree(tree.address), *at[:5], code_of(decide_exactly), at[5])
        segment.ends[:] = *ends[0], *ends[1], *ends[0]
        segment.numbers[:] = numbers_of(ends)
        assert place_segment(segment, 3)
        told = f"vertices, faces, X, ends, Y = {[x.tolist() for x in (vertices, faces, X, ends, Y)]}"
        corners, (p, q) = as_integers(world_points(vertices, X), world_points(ends, Y))
        there = (ends @ Y[:3, :3].T + Y[:3, 3] - X[:3, 3]) @ X[:3, :3]
        assert np.abs(segment.corners[9:15].reshape(2, 3) - there).max() <= segment.placing[ERROR] + 1e-14, told
        for place, facet in enumerate(tree.ids.tolist()):
            T = [corners[v] for v in faces[facet].tolist()]
            how = ask_segment_exactly(segment, place, PASS)
            n = cross(minus(T[1], T[0]), minus(T[2], T[0]))
            start, end = inner(n, minus(p, T[0])), inner(n, minus(q, T[0]))
            meets = triangles_meet(T, [p, q, q])
            if start != 0 or end != 0:
                assert (how == BY) != meets, (told, facet)
                assert (how == FROM) == (meets and start == 0), (told, facet)
            assert how != THROUGH or (start > 0 > end and meets), (told, facet)
            assert how != BACK or (start < 0 < end and meets), (told, facet)
            seen[how] += 1
        assert segment.counters[EXACT] == len(faces)
    assert min(seen[how] for how in (BY, THROUGH, BACK)) >= 15 and len(seen) == 5, seen


def test_singular_poses_are_refused():
    tree = build_mesh_tree(np.eye(3), [[0, 1, 2]])
    good, flat = np.eye(4).ravel(), np.diag([1.0, 1.0, 0.0, 1.0]).ravel()
    rest = (np.zeros(SEGMENT_DOUBLES), np.zeros(SEGMENT_FLOATS, dtype=np.float32), np.zeros(INTEGERS, dtype=np.int64))
    counters = np.zeros(COUNTERS, dtype=np.int64)
    for X, Y, placed in ((good, good, True), (flat, good, False), (good, flat, False)):
        at = [address_of(buffer) for buffer in (X, Y, *rest)]
        segment = open_segment(open_tree(tree.address), *at, code_of(decide_exactly), address_of(counters))
        assert place_segment(segment, 0) == placed
