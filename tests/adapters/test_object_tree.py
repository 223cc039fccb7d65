"""Trees over objects of hosts: the pairs that are near, against naive numpy over all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from collide.adapters.hosts import fcl_api as fcl
from collide.adapters.hosts.object_tree import ObjectTree, in_chunks
from collide.adapters.hosts.posed_objects import box_of, boxes_of_objects

SHAPES = [fcl.Box(0.5, 0.4, 0.3), fcl.Sphere(0.3), fcl.Capsule(0.1, 0.5), fcl.Cone(0.3, 0.4)]
FLOOR = fcl.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


def scattered(rng, n: int, spread: float, n_floors: int = 0) -> list:
    objects = []
    for k in range(n):
        tf = fcl.Transform(rng.normal(size=4), rng.uniform(-spread, spread, 3))
        objects.append(fcl.CollisionObject(FLOOR if k < n_floors else SHAPES[k % 4], tf))
    rng.shuffle(objects)
    return objects


def tree_of(objects: list) -> ObjectTree:
    tree = ObjectTree()
    for obj in objects:
        tree.add(obj)
    return tree


def naive_gaps(mine: list, theirs: list) -> np.ndarray:
    """(n, m) distances of boxes around corners, posed one by one."""
    def box(obj):
        if obj._geometry is FLOOR:
            return np.full(3, -np.inf), np.full(3, np.inf)
        low, high = obj._geometry._corners
        corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
                            for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        posed = corners @ obj.getRotation().T + obj.getTranslation()
        return posed.min(axis=0), posed.max(axis=0)

    a, b = [box(obj) for obj in mine], [box(obj) for obj in theirs]
    return np.array([[np.linalg.norm(np.maximum(0.0, np.maximum(l2 - h1, l1 - h2))) for l2, h2 in b] for l1, h1 in a])


def checked(found: list, gaps: np.ndarray, limit: float, case: str) -> None:
    """Each pair once, all that are within the limit, none that is farther by more than rounding."""
    assert len(found) == len(set(found)), case
    missing = set(map(tuple, np.argwhere(gaps <= limit - 1e-9).tolist())) - set(found)
    assert not missing, (case, sorted(missing)[:5])
    farther = [pair for pair in found if gaps[pair] > limit + 1e-9]
    assert not farther, (case, farther[:5])


@pytest.mark.many(10)
@pytest.mark.parametrize("seed", range(12))
def test_all_pairs_of_boxes_that_meet(seed):
    rng = np.random.default_rng(seed)
    n, n_floors = int(rng.integers(1, 150)), int(rng.integers(0, 3))
    objects, guests = (scattered(rng, size, rng.uniform(0.5, 4), min(n_floors, size)) for size in (n, n // 2 + 1))
    tree, other = tree_of(objects), tree_of(guests)
    for moves in (0, 1, n // 2, n, n):
        for obj in rng.choice(objects, moves, replace=False):
            obj.setTranslation(rng.uniform(-3, 3, 3))
        case = f"seed {seed}, {moves} moved"
        gaps = naive_gaps(objects, objects)
        gaps[np.tril_indices(n)] = np.inf
        checked([tuple(pair) for block in tree.pairs() for pair in block.tolist()], gaps, 0.0, case)
        gaps = naive_gaps(objects, guests)
        checked([tuple(pair) for block in tree.pairs(other) for pair in block.tolist()], gaps, 0.0, case)
        for k, guest in enumerate(guests[:3]):
            of_guest = np.where(np.arange(len(guests)) == k, gaps, np.inf)
            checked([(row, k) for row in tree.touching(guest)], of_guest, 0.0, case)


@pytest.mark.parametrize("seed", range(12))
def test_near_ones_come_first_and_none_is_left_out(seed):
    rng = np.random.default_rng(100 + seed)
    n = int(rng.integers(2, 90))
    spread = 10.0 ** rng.uniform(-1, 4)
    objects, guests = scattered(rng, n, spread, int(seed % 4 == 3)), scattered(rng, 7, spread, int(seed % 3 == 2))
    tree = tree_of(objects)
    for other, theirs in ((None, objects), (tree_of(guests), guests), (guests[0], guests[:1])):
        gaps = naive_gaps(objects, theirs)
        if other is None:
            gaps[np.tril_indices(n)] = np.inf
        for limit in (np.inf, float(np.median(gaps[gaps < np.inf])), 0.0):
            least, found, case = [np.inf], [], f"seed {100 + seed}, limit {limit}, of {len(theirs)}"
            for block_gaps, rows in tree.near(other, least):
                assert (np.diff(block_gaps) >= 0).all(), case
                for gap, pair in zip(block_gaps.tolist(), rows.tolist()):
                    assert abs(gap - gaps[tuple(pair)]) <= 1e-9 * (1 + spread), case
                    if gap <= max(least[0], 0.0):
                        found.append(tuple(pair))
                        least[0] = limit
            wanted = gaps if limit > 0.0 else np.where(gaps < 0.0, gaps, np.inf)  # at 0 whoever came first was enough
            if limit < np.inf and limit > 0.0:
                wanted = np.where(gaps < limit, gaps, np.inf)
            missing = set(map(tuple, np.argwhere(wanted < np.inf).tolist())) - set(found)
            assert not missing and len(found) == len(set(found)), (case, sorted(missing)[:5])
            assert found or not np.isfinite(gaps).any(), case


def test_a_limit_from_the_start():
    """Few objects and many: all pairs nearer than it, and hardly any other."""
    rng = np.random.default_rng(9)
    for n in (20, 400):
        objects, guest = scattered(rng, n, n ** (1 / 3)), scattered(rng, 1, 1.0)[0]
        tree, others = tree_of(objects), objects[::3]
        for against, theirs in ((None, objects), (tree_of(others), others), (guest, [guest])):
            gaps = naive_gaps(objects, theirs)
            if against is None:
                gaps[np.tril_indices(n)] = np.inf
            rows = [tuple(pair) for _, block in tree.near(against, [0.5]) for pair in block.tolist()]
            wanted = set(map(tuple, np.argwhere(gaps < 0.5).tolist()))
            assert wanted <= set(rows) and len(rows) == len(set(rows)) and max(gaps[pair] for pair in rows) < 1.0, n


def test_boxes_hold_their_bodies():
    """One by one and together alike, however far from the origin."""
    rng = np.random.default_rng(5)
    for scale in (1.0, 1e6, 1e-6):
        objects = scattered(rng, 200, scale)
        together = boxes_of_objects(
            np.array([obj._geometry._corners for obj in objects]), np.array([obj._X for obj in objects])
        )
        alone = np.array([box_of(obj) for obj in objects])
        assert np.allclose(alone, together, rtol=1e-11, atol=0.0)
        for obj, box in zip(objects, alone):
            low, high = obj._geometry._corners
            posed = np.array([low, high, [*low[:2], high[2]]]) @ obj.getRotation().T + obj.getTranslation()
            assert (posed > box[:3]).all() and (posed < box[3:]).all()


def test_chunks_are_what_there_was():
    blocks = [np.arange(2 * k).reshape(-1, 2) for k in (3, 40, 1, 500)]
    pieces = list(in_chunks(blocks, 4, 64))
    assert np.array_equal(np.concatenate(pieces), np.concatenate(blocks))
    assert [len(piece) for piece in pieces[:3]] == [3, 16, 24] and max(map(len, pieces)) == 64


def test_objects_come_and_go():
    a, b, c = (fcl.CollisionObject(SHAPES[1]) for _ in range(3))
    tree = tree_of([a, b, a])
    assert [block.tolist() for block in tree.pairs()] == [[[0, 1], [0, 2], [1, 2]]]
    assert tree.remove(a) and tree.objects == [b, a] and not tree.remove(c)
    a.setTranslation(np.array([5.0, 0.0, 0.0]))
    assert not list(tree.pairs()) and tree.touching(c) == [0]
    assert tree.remove(a) and a._watchers == ()
    tree.remove_all()
    assert tree.refresh() is None and tree.touching(c) == [] and not list(tree.near(None, [np.inf]))
    assert not list(tree.pairs(tree_of([c]))) and not list(tree_of([c]).pairs(tree))
