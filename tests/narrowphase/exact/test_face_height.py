"""Distances of faces in double-doubles: where they are proven, every double written is that of integers."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.exact import filtered_gjk as F
from collide.narrowphase.exact.exact_gjk import gap_of_face
from collide.narrowphase.exact.exact_workspace import INTEGERS
from collide.narrowphase.exact.face_height import face_height
from collide.narrowphase.exact.settle_space import bracket_of_depth, bracket_of_gap
from collide.numerics.vec3 import divide, norm
from collide.scenes.families.ingredients import rotation_about

pytestmark = pytest.mark.plain_kernels

#: How boxes stand, and what part of their faces needs no integers at least. Gaps of 1e-13 are good to 2⁻⁶⁰ in
#: double-doubles, gaps of rounding to 2⁻⁵⁰.
KINDS = {"along the axes": 0.4, "1e-3": 0.95, "1e-9": 0.95, "1e-13": 0.6, "1e-16": 0.0}


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_doubles_as_in_integers(kind):
    rng = rng_of("face height", kind)
    seen: Counter = Counter()
    for _ in range(60):
        A, B = (collide.Box(tuple(np.round(rng.uniform(0.1, 2.0, 3), 2))) for _ in range(2))
        height = (A.size[2] + B.size[2]) / 2 + (0.0 if kind == "along the axes" else float(kind))
        X_AB = pose(t=(*np.round(rng.uniform(-0.2, 0.2, 2), 2), height))
        X = pose(t=np.round(rng.uniform(-2.0, 2.0, 3), 2))
        if kind != "along the axes":
            X, X_AB[:3, :3] = random_pose(rng), rotation_about(2, rng.uniform(0.0, 6.0))
        bodies = PosedBodies(A, B, X, X @ X_AB)
        assert F.is_filtered(bodies.ordered)
        ids = [*corners_of_face(bodies, rng), *[0] * 10]
        points = np.zeros(F.DOUBLES)
        for k in range(3):
            F._put_point(bodies.pair, points, k, ids[2 * k], ids[2 * k + 1])
        face = face_height(points)
        seen["proven"] += bool(face.proven)
        if not face.proven:
            continue
        terms, digits = bodies.poses.terms.ravel(), np.zeros(INTEGERS, dtype=np.int64)
        exact = gap_of_face(bodies.ordered, terms, digits, ids, 1)
        case = f"{bodies.shapes}, {bodies.X}, {ids}: {face}, {exact}"
        assert bracket_of_gap(face.distance) == bracket_of_gap(exact.excess), case
        assert bracket_of_depth(face.distance, 0.0, 0.0) == bracket_of_depth(exact.excess, 0.0, 0.0), case
        assert divide(face.direction, norm(face.direction)) == exact.v, case
    assert seen["proven"] >= KINDS[kind] * 60 and (seen["proven"] == 60 or kind not in ("1e-3", "1e-9")), seen
    assert seen["proven"] < 60 or kind != "1e-16", seen


def corners_of_face(bodies: PosedBodies, rng) -> list[int]:
    """Vertex pairs of three points of A ⊖ B, two with the same vertex of B and two with the same vertex of A, among the
    nearest to the origin's plane: a face of B on a face of A."""
    difference = {pair: np.array([float(x) for x in point]) for pair, point in bodies.difference().items()}
    R = bodies.X[0][:3, :3]
    heights = {pair: abs(point @ R[:, 2]) for pair, point in difference.items()}
    level = [pair for pair in heights if heights[pair] < min(heights.values()) + 1e-9]
    i, j = level[int(rng.integers(len(level)))]
    of_a = [pair for pair in level if pair[1] == j and pair[0] != i]
    of_b = [pair for pair in level if pair[0] == i and pair[1] != j]
    chosen = [(i, j), of_a[int(rng.integers(len(of_a)))], of_b[int(rng.integers(len(of_b)))]]
    return [k for pair in chosen for k in pair]
