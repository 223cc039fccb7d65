"""The box-tree beside every box against every other, as bodies move near and far; it stays as good as a new one."""

from __future__ import annotations

import numpy as np
import pytest

from collide.broadphase.box_tree import BoxTree

STATIC, GROUP, MASK = 0, 1, 2


def boxes_of(rng, kind: str, n: int) -> np.ndarray:
    """(n, 6): low and high corners."""
    if kind == "uniform":
        middle, half = rng.uniform(0, n ** (1 / 3), (n, 3)), rng.uniform(0.1, 0.4, (n, 3))
    elif kind == "clusters":
        middle = rng.normal(size=(n, 3)) * 0.5 + 100.0 * rng.integers(0, 3, (n, 1))
        half = rng.uniform(0.01, 0.1, (n, 3))
    elif kind == "all sizes":
        middle, half = rng.uniform(0, 10, (n, 3)), 10.0 ** rng.uniform(-6, 1, (n, 1)) * rng.uniform(0.1, 1, (n, 3))
    else:  # in one place
        middle, half = np.full((n, 3), 3.0), np.zeros((n, 3))
    boxes = np.hstack([middle - half, middle + half])
    if n > 3:
        boxes[0] = [-np.inf] * 3 + [np.inf] * 3
    return boxes


def filters_of(rng, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(static, group, mask)."""
    return rng.integers(0, 2, n) * rng.integers(0, 2, n), 1 << rng.integers(0, 3, n), rng.integers(1, 8, n)


def all_pairs(boxes, margin: float, static, group, mask) -> np.ndarray:
    """Every box against every other."""
    i, j = np.triu_indices(len(boxes), 1)
    near = ((boxes[i, :3] - margin <= boxes[j, 3:]) & (boxes[j, :3] - margin <= boxes[i, 3:])).all(axis=1)
    keep = near & ~((static[i] != 0) & (static[j] != 0)) & ((group[i] & mask[j]) != 0) & ((group[j] & mask[i]) != 0)
    return np.stack([i[keep], j[keep]], axis=1)


@pytest.mark.parametrize("kind", ["uniform", "clusters", "all sizes", "in one place"])
@pytest.mark.parametrize("n", [1, 2, 5, 90])
def test_pairs_are_those_of_all_boxes(kind, n):
    rng = np.random.default_rng(n)
    tree = BoxTree(boxes_of(rng, kind, n))
    n_pairs = 0
    for step in range(12):
        if step:
            boxes = boxes_of(rng, kind, n) if step % 3 == 0 else tree.boxes + np.tile(rng.normal(size=3) * 0.1, 2)
            tree.refit(boxes)
        filters, margin = filters_of(rng, n), float(rng.choice([0.0, 0.05, 1.0]))
        pairs, wanted = tree.pairs(margin, *filters), all_pairs(tree.boxes, margin, *filters)
        assert np.array_equal(pairs, wanted), (kind, n, step)
        n_pairs += len(wanted)
        box = tree.boxes[rng.integers(n)]
        near = ((tree.boxes[:, :3] - margin <= box[3:]) & (box[:3] - margin <= tree.boxes[:, 3:])).all(axis=1)
        assert np.array_equal(tree.touching(box, margin), np.flatnonzero(near)), (kind, n, step)
    assert n_pairs > 2 * n or n < 5


def test_what_has_moved_far_is_sorted_anew():
    """All bodies change places, spread, and come back: the sides of a tree made anew are a little less at most."""
    rng = np.random.default_rng(1)
    boxes = boxes_of(rng, "uniform", 2000)
    tree = BoxTree(boxes)
    first = tree.order
    for step, spread in enumerate([1.0, 1.0, 8.0, 8.0, 1.0, 0.1, 1.0]):
        moved = boxes_of(np.random.default_rng(step), "uniform", 2000)
        middle = np.tile(0.5 * (moved[1:, :3] + moved[1:, 3:]), 2)
        moved[1:] += (spread - 1.0) * middle
        tree.refit(moved)
        sides, fresh = tree._fit(), BoxTree(moved)._fit()
        assert sides[0] <= 1.6 * fresh[0], (step, sides, fresh)
    assert not np.array_equal(tree.order, first)


def test_what_moves_a_little_keeps_its_order():
    """Sorting takes as long as a query: steps of a simulation are not to pay for it."""
    rng = np.random.default_rng(2)
    boxes = boxes_of(rng, "uniform", 500)
    tree = BoxTree(boxes)
    first = tree.order
    for _ in range(20):
        tree.refit(tree.boxes + np.tile(rng.uniform(-0.01, 0.01, (500, 3)), 2))
    assert tree.order is first


def test_other_bodies_are_refused():
    boxes = boxes_of(np.random.default_rng(3), "uniform", 10)
    with pytest.raises(ValueError, match="same bodies"):
        BoxTree(boxes).refit(boxes[:9])
    with pytest.raises(ValueError, match="same bodies"):
        BoxTree(boxes).refit(np.roll(boxes, 1, axis=0))
