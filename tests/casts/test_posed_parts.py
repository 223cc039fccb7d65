"""Parts of posed shapes and pairs of them, against loops."""

from __future__ import annotations

import numpy as np
import pytest
from naive import one_of_each, random_pose, rng_of

import collide
from collide.casts.posed_parts import PosedParts, posed_parts, posed_sides
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import POSE_SLOP


def shapes_of(rng) -> list[collide.Shape]:
    each = one_of_each(rng)
    return [each["Compound"], each["Box"], each["Halfspace"], each["ConvexHull"]]


def place_of(parts: PosedParts, part: int) -> np.ndarray:
    return np.hstack([parts.poses.rows[part, :9].reshape(3, 3), parts.poses.rows[part, 9:12, None]])


@pytest.mark.parametrize("single_a", [True, False])
@pytest.mark.parametrize("single_b", [True, False])
@pytest.mark.parametrize("n_poses", [(5, 5), (1, 5), (5, 1)])
def test_pairs_are_those_of_loops(single_a, single_b, n_poses):
    rng = rng_of("part pairs", single_a, single_b, n_poses)
    n, shapes = 5, shapes_of(rng)
    A = shapes[0] if single_a else [shapes[k] for k in (0, 1, 0, 3, 1)]
    B = shapes[0] if single_b else [shapes[k] for k in (2, 0, 2, 3, 0)]
    X_WA, X_WB = (np.array([random_pose(rng) for _ in range(k)]) for k in n_poses)
    found = posed_sides(A, B, X_WA, X_WB, n).all_pairs(np.arange(n))
    expected = [
        (k, i, j)
        for k in range(n)
        for i in range(len(parts_of(A if single_a else A[k])))
        for j in range(len(parts_of(B if single_b else B[k])))
    ]
    assert list(zip(found.owner.tolist(), found.item_a.tolist(), found.item_b.tolist())) == expected
    for (k, i, j), (a, b) in zip(expected, found.pairs.tolist()):
        for side, single, X, item, part in ((A, single_a, X_WA, i, a), (B, single_b, X_WB, j, b)):
            packed, X_SP = parts_of(side if single else side[k])[item]
            X_WS = X[k if len(X) > 1 else 0]
            assert found.parts.packed(part).content == packed.content
            np.testing.assert_allclose(place_of(found.parts, part), (X_WS @ X_SP)[:3], rtol=0, atol=1e-14)
            assert np.array_equal(found.parts.body_poses[part], X_WS)
            assert np.array_equal(found.parts.part_poses[part], X_SP)
    assert found.pairs.flags.c_contiguous and found.pairs.dtype == np.int64


def test_equal_shapes_share_a_row():
    boxes = [collide.Box((1, 1, 1)), collide.Box((1, 1, 1)), collide.Box((1, 1, 2))]
    X = np.array([np.eye(4)] * 3)
    found = posed_sides(boxes, boxes[::-1], X, X, 3).all_pairs(np.arange(3))
    assert len(found.parts.table.packed) == 2
    assert found.parts.shape_of.tolist() == [0, 0, 1, 1, 0, 0]


def test_no_questions_make_no_pairs():
    box = collide.Box((1, 1, 1))
    for A, B in ((box, box), ([], box), ([], [])):
        found = posed_sides(A, B, np.zeros((0, 4, 4)), np.eye(4)[None], 0).all_pairs(np.arange(0))
        assert found.pairs.shape == (0, 2) and len(found.owner) == len(found.item_a) == len(found.item_b) == 0


def test_parts_of_one_body_follow_its_poses():
    rng = rng_of("posed parts")
    items = list(parts_of(one_of_each(rng)["Compound"]))
    X_WA = np.array([random_pose(rng) for _ in range(3)])
    parts = posed_parts(items, X_WA)
    assert len(parts.shape_of) == 9
    for k in range(9):
        pose_number, item = divmod(k, 3)
        packed, X_AP = items[item]
        assert parts.packed(k) is packed
        np.testing.assert_allclose(place_of(parts, k), (X_WA[pose_number] @ X_AP)[:3], rtol=0, atol=1e-14)
        assert (parts.poses.rows[k, POSE_SLOP] > 0.0) == (item > 0)  # the first stands where its body does
    corners, grid = parts.exact(0).vertices, parts.exact(0).vertices.grid
    rounded = np.array([[float(v) for v in p] for p in corners]) * 2.0**grid
    by_hand = parts.packed(0).points @ X_WA[0, :3, :3].T + X_WA[0, :3, 3]
    np.testing.assert_allclose(rounded, by_hand, rtol=0, atol=1e-14)
