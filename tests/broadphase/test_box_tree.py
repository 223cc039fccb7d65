"""The box-tree beside every box against every other, as bodies are added, moved near and far, and removed; every
property of the tree; it stays as good as a new one, and costs what has changed.
"""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from validate_box_tree import depths_of, growth_of, validate_box_tree

from collide.broadphase.box_tree import BoxTree
from collide.broadphase.graded_boxes import BODY, SKIP

KINDS = ["uniform", "clusters", "all sizes", "a few huge", "rods", "flat", "a line to nothing", "in one place"]


def boxes_of(rng, kind: str, n: int) -> np.ndarray:
    """(n, 6): low and high corners."""
    middle, half = rng.uniform(0, n ** (1 / 3), (n, 3)), rng.uniform(0.1, 0.4, (n, 3))
    if kind == "clusters":
        middle = rng.normal(size=(n, 3)) * 0.5 + 100.0 * rng.integers(0, 3, (n, 1))
        half = rng.uniform(0.01, 0.1, (n, 3))
    elif kind == "all sizes":
        middle, half = rng.uniform(0, 10, (n, 3)), 10.0 ** rng.uniform(-6, 1, (n, 1)) * rng.uniform(0.1, 1, (n, 3))
    elif kind == "a few huge":
        half[: n // 20] *= n ** (1 / 3)
    elif kind == "rods":  # all outliers of the root
        middle[:, 0], half[:, 0] = 0.0, n ** (1 / 3)
    elif kind == "flat":
        middle[:, 2], half[:, 2] = 0.0, 0.0
    elif kind == "a line to nothing":
        middle, half = 2.0 ** -np.arange(n)[:, None] * np.ones(3), 2.0 ** -np.arange(n)[:, None] * np.full(3, 0.3)
    elif kind == "in one place":
        middle, half = np.full((n, 3), 3.0), np.zeros((n, 3))
    return np.hstack([middle - half, middle + half])


def filters_of(rng, n: int) -> tuple[np.ndarray, np.ndarray]:
    """(group, mask)."""
    return 1 << rng.integers(0, 3, n), rng.integers(1, 8, n)


def all_pairs(tree: BoxTree, alive, margin: float, group, mask, still, allowed) -> np.ndarray:
    """Every box against every other."""
    boxes = tree.boxes
    i, j = (alive[k] for k in np.triu_indices(len(alive), 1))
    keep = ((boxes[i, :3] - margin <= boxes[j, 3:]) & (boxes[i, 3:] + margin >= boxes[j, :3])).all(axis=1)
    keep &= ~(still[i] & still[j]) & ((group[i] & mask[j]) != 0) & ((group[j] & mask[i]) != 0)
    pairs = np.stack([i[keep], j[keep]], axis=1).tolist()
    return np.array([pair for pair in pairs if tuple(pair) not in allowed]).reshape(-1, 2)


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 5, 40, 170])
def test_pairs_are_those_of_all_boxes_whatever_happens(kind, n):
    """Few and many moved, near and far; bodies come and go; asleep, allowed, without end. The first pairs of the first
    bodies are the same whatever the tree."""
    rng, n_pairs, n_cut, removed = np.random.default_rng([n, KINDS.index(kind)]), 0, 0, set()
    boxes, fixed = boxes_of(rng, kind, n), rng.random(n) < 0.3
    if n > 3:
        boxes[0] = [-np.inf] * 3 + [np.inf] * 3
    tree, asleep = BoxTree(boxes, fixed), np.zeros(n, dtype=bool)
    group, mask = filters_of(rng, n)
    tree.set_groups(np.arange(n), group, mask)
    allowed: set = set()
    for step in range(24):
        done = step % 6
        alive = np.array(sorted(set(range(len(tree.boxes))) - removed))
        bounded = alive[np.isfinite(tree.boxes[alive]).all(axis=1)]
        few = rng.permutation(bounded)[: max(1, len(bounded) // 20)]
        if done == 1 and len(bounded):
            tree.move(bounded, tree.boxes[bounded] + np.tile(rng.normal(size=(len(bounded), 3)) * 0.3, 2))
        elif done in (0, 2) and len(few):
            scale = 0.02 if step % 4 else 5.0
            tree.move(few, tree.boxes[few] + np.tile(rng.normal(size=(len(few), 3)) * scale, 2))
        elif done == 3:
            k = int(rng.integers(1, 6))
            more, stay = boxes_of(rng, kind, k), rng.random(k) < 0.3
            traits = filters_of(rng, k)
            tree.append(more, stay, *traits)
            group, mask = np.append(group, traits[0]), np.append(mask, traits[1])
            fixed, asleep = np.append(fixed, stay), np.append(asleep, np.zeros(k, dtype=bool))
        elif done == 4 and len(few) and len(alive) > 2:
            tree.remove(few)
            removed |= set(few.tolist())
        elif done == 5 and len(few):
            asleep[few] = ~asleep[few]
            tree.set_asleep(few[asleep[few]], True)
            tree.set_asleep(few[~asleep[few]], False)
            pairs = rng.permutation(len(tree.boxes))[: 2 * (len(tree.boxes) // 2)].reshape(-1, 2)
            allowed = {tuple(sorted(p)) for p in pairs.tolist()}
            tree.set_allowed(np.array(sorted(allowed)).reshape(-1, 2))
        validate_box_tree(tree, len(removed))
        alive = np.array(sorted(set(range(len(tree.boxes))) - removed))
        for margin in (0.0, float(rng.choice([0.05, 1.0]))):
            pairs, wanted = tree.pairs(margin), all_pairs(tree, alive, margin, group, mask, fixed | asleep, allowed)
            assert np.array_equal(pairs, wanted), f"kind={kind!r}; n={n}; step={step}; margin={margin}"
            n_pairs += len(wanted)
            if not margin:
                end, most = int(rng.integers(1, len(tree.boxes) + 1)), int(rng.integers(1, 8))
                wanted = wanted.astype(np.int64)
                is_first = (wanted[:, 0] < end) & np.isfinite(tree.boxes[wanted]).all(axis=(1, 2))
                first = tree.first_pairs(end, most)
                assert np.array_equal(first, wanted[is_first][:most]), f"kind={kind!r}; n={n}; step={step}"
                n_cut += is_first.sum() > most
        box = tree.boxes[rng.choice(alive[np.isfinite(tree.boxes[alive]).all(axis=1)])] if len(bounded) else np.ones(6)
        near = ((box[:3] - 0.1 <= tree.boxes[:, 3:]) & (box[3:] + 0.1 >= tree.boxes[:, :3])).all(axis=1)
        assert np.array_equal(tree.touching(box, 0.1), np.flatnonzero(near)), f"kind={kind!r}; n={n}; step={step}"
    assert n < 40 or (n_pairs > 2 * n and (n_cut > 5 or kind in ("clusters", *KINDS[5:])))


@pytest.mark.parametrize("kind", KINDS)
def test_the_tree_has_the_depth_of_the_sizes_in_it(kind):
    """Levels: log2 of the width by the least size, as the paper has it, and those of the outliers' trees."""
    n = 600 if kind != "a line to nothing" else 50
    boxes = boxes_of(np.random.default_rng(3), kind, n)
    tree = BoxTree(boxes)
    validate_box_tree(tree)
    sides = (boxes[:, 3:] - boxes[:, :3]).max(axis=1)
    width = float((boxes[:, 3:].max(axis=0) - boxes[:, :3].min(axis=0)).max())
    levels = np.ceil(np.log2(max(width / sides.min(), 1.0))) if sides.min() > 0 else 0
    assert depths_of(tree).max() <= levels + 3 + np.log2(n) + 1, (depths_of(tree).max(), levels)
    assert tree.n_nodes <= 2 * n - 1


def test_rods_as_long_as_the_world_are_no_list():
    """All are outliers of the root, and a walk is to open few: the paper bounds their number by locality alone."""
    n = 4000
    tree = BoxTree(boxes_of(np.random.default_rng(4), "rods", n))
    validate_box_tree(tree)
    box = tree.boxes[17]
    opened, node = 0, 0
    while node < tree.n_nodes:
        opened += 1
        low, high = tree.nodes[node, :3], tree.nodes[node, 3:]
        node = node + 1 if (low <= box[3:]).all() and (high >= box[:3]).all() else int(tree.links[node, SKIP])
    met = len(tree.touching(box, 0.0))
    assert opened < 20 * met + 150 < n, (opened, met)


def test_what_has_moved_far_is_made_anew():
    """All bodies change places, spread, and come back: the sides of a tree made anew are a little less at most."""
    boxes = boxes_of(np.random.default_rng(1), "uniform", 2000)
    tree = BoxTree(boxes)
    for step, spread in enumerate([1.0, 1.0, 8.0, 8.0, 1.0, 0.1, 1.0]):
        moved = boxes_of(np.random.default_rng(step), "uniform", 2000)
        moved += (spread - 1.0) * np.tile(0.5 * (moved[:, :3] + moved[:, 3:]), 2)
        tree.refit(moved)
        assert growth_of(tree) <= 1.7, (step, growth_of(tree))
    assert tree.take_work()["trees made"] > 3


def test_what_moves_a_few_at_a_time_stays_good_as_well():
    """Paths alone are fitted: the sum of sides that decides is kept by differences, for ten thousand moves."""
    rng = np.random.default_rng(5)
    tree = BoxTree(boxes_of(rng, "uniform", 800))
    for _ in range(1000):
        few = rng.choice(800, 10, replace=False)
        fresh = boxes_of(rng, "uniform", 800)[few]
        tree.move(few, fresh)
    validate_box_tree(tree)
    assert growth_of(tree) <= 1.8, growth_of(tree)


def test_what_moves_a_little_keeps_its_tree():
    """Making it takes as long as a query: steps of a simulation are not to pay for it."""
    rng = np.random.default_rng(2)
    tree = BoxTree(boxes_of(rng, "uniform", 500))
    for _ in range(20):
        tree.refit(tree.boxes + np.tile(rng.uniform(-0.01, 0.01, (500, 3)), 2))
    assert tree.take_work()["trees made"] == 1


def test_most_small_steps_change_no_node():
    """A body that goes on as it went gets room for some steps: one in five or so of its steps costs anything."""
    rng = np.random.default_rng(6)
    tree = BoxTree(boxes_of(rng, "uniform", 400))
    step = np.tile(rng.uniform(-0.002, 0.002, (400, 3)), 2)
    tree.refit(tree.boxes + step)
    tree.take_work()
    for _ in range(40):
        tree.refit(tree.boxes + step)
        validate_box_tree(tree)
    assert 0 < tree.take_work()["leaves changed"] < 0.3 * 40 * 400


@pytest.mark.many(6)
@pytest.mark.parametrize("kind", ["uniform", "clusters", "all sizes", "a few huge", "flat"])
@pytest.mark.parametrize("n", [60, 400])
def test_pairs_are_kept_while_all_bodies_jitter(kind, n):
    """Leaves get room for steps, and what is near stays known: pairs are those of all boxes in every step, static,
    sleeping and filtered ones apart, at a margin and without, and while bodies come and go.
    """
    rng, n_cached, n_pairs = np.random.default_rng([7, n]), 0, 0
    boxes, fixed = boxes_of(rng, kind, n), rng.random(n) < 0.2
    tree, still = BoxTree(boxes, fixed), fixed.copy()
    group, mask = filters_of(rng, n)
    tree.set_groups(np.arange(n), group, mask)
    allowed = {tuple(sorted(pair)) for pair in rng.permutation(n)[: n // 4 * 2].reshape(-1, 2).tolist()}
    tree.set_allowed(np.array(sorted(allowed)))
    side = np.median((boxes[:, 3:] - boxes[:, :3]).max(axis=1))
    step = 0.004 * side
    removed: set = set()
    for turn in range(30):
        moving = np.array(sorted(set(range(len(tree.boxes))) - removed))
        shift = rng.uniform(-step, step, (len(moving), 3))
        tree.move(moving, tree.boxes[moving] + np.tile(shift, 2))
        if turn % 10 == 7:
            asleep = rng.permutation(moving)[: n // 10]
            tree.set_asleep(asleep, True)
            still[asleep] = True
        elif turn % 10 == 8:
            tree.remove(moving[:2])
            removed |= set(moving[:2].tolist())
        elif turn % 10 == 9:
            stays = np.array([True, False])
            tree.append(boxes_of(rng, kind, 2), stays, 1, 7)
            group, mask = np.append(group, [1, 1]), np.append(mask, [7, 7])
            still = np.append(still, stays)
        validate_box_tree(tree, len(removed))
        alive = np.array(sorted(set(range(len(tree.boxes))) - removed))
        for margin in (side, 0.0):
            wanted = all_pairs(tree, alive, margin, group, mask, still, allowed)
            assert np.array_equal(tree.pairs(margin), wanted), f"kind={kind!r}; n={n}; turn={turn}; margin={margin}"
            n_pairs += len(wanted)
        n_cached += tree._cached is not None
    assert n_cached > 24 and n_pairs > 0, (n_cached, n_pairs)


def test_small_bodies_get_room_for_steps_that_are_long_for_them():
    """A grain that goes ten times its own length in a step, far from others: what is free around it is its room."""
    rng = np.random.default_rng(10)
    middle = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 3)
    tree = BoxTree(np.hstack([middle - 5e-4, middle + 5e-4]))
    for _ in range(40):
        at = middle + rng.uniform(-0.005, 0.005, middle.shape)
        tree.refit(np.hstack([at - 5e-4, at + 5e-4]))
    assert tree.take_work()["leaves changed"] < 3 * len(middle)


def test_pairs_that_would_be_too_many_are_not_kept():
    boxes = np.tile([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], (300, 1))
    tree = BoxTree(boxes)
    for _ in range(3):
        assert len(tree.pairs(0.0)) == 300 * 299 // 2 and tree._cached is None
    assert len(tree.pairs(np.inf)) == 300 * 299 // 2


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda tree: pickle.loads(pickle.dumps(tree))])
def test_copies_are_trees_of_their_own(copied):
    """What kernels are told of a tree are addresses: a copy has others."""
    tree = BoxTree(boxes_of(np.random.default_rng(11), "uniform", 50))
    before = tree.pairs(0.0)
    other = copied(tree)
    tree.refit(tree.boxes + 100.0 * np.arange(50)[:, None])
    assert not len(tree.pairs(0.0))
    assert len(before) and np.array_equal(other.pairs(0.0), before)


@pytest.mark.parametrize("n", [1000, 20000])
def test_moving_a_few_looks_at_few_nodes(n):
    rng = np.random.default_rng(7)
    boxes = boxes_of(rng, "uniform", n)
    tree = BoxTree(boxes, np.arange(n) % 2 == 0)
    tree.pairs(0.0)
    tree.take_work()
    for _ in range(10):
        few = rng.choice(n, 5, replace=False)
        tree.move(few, tree.boxes[few] + np.tile(rng.normal(size=(5, 3)) * 0.3, 2))
        tree.pairs(0.0)
    work = tree.take_work()
    assert work["leaves changed"] == 50 and work["nodes fitted"] < 50 * 25 and not work["trees made"], work


def test_adding_one_at_a_time_sorts_each_a_few_times():
    """Trees of what was added are joined with others of their size: n log n nodes in all, not n squared."""
    rng, n = np.random.default_rng(8), 2000
    boxes = boxes_of(rng, "uniform", n)
    tree = BoxTree(boxes[:1])
    for k in range(1, n):
        tree.append(boxes[k : k + 1], np.zeros(1, dtype=bool))
    validate_box_tree(tree)
    assert tree.take_work()["nodes fitted"] < 6 * n * np.log2(n)
    assert len(tree.sections) <= np.log2(n) + 2


def test_memory_does_not_grow_with_what_comes_and_goes():
    rng = np.random.default_rng(9)
    tree = BoxTree(boxes_of(rng, "uniform", 300))
    alive = list(range(300))
    for _ in range(200):
        tree.remove(np.array(alive[:10]))
        first = len(tree.boxes)
        tree.append(boxes_of(rng, "uniform", 10), np.zeros(10, dtype=bool))
        alive = alive[10:] + list(range(first, first + 10))
    validate_box_tree(tree, 2000)
    assert tree.n_nodes < 1500 and len(tree.nodes) < 4000


def test_other_bodies_are_refused():
    boxes = boxes_of(np.random.default_rng(3), "uniform", 10)
    with pytest.raises(ValueError, match="same bodies"):
        BoxTree(boxes).refit(boxes[:9])
    boxes[0] = [-np.inf] * 3 + [np.inf] * 3
    with pytest.raises(ValueError, match="keep their ends"):
        BoxTree(boxes).refit(np.roll(boxes, 1, axis=0))


@pytest.mark.parametrize("what", ["box", "skip", "body", "leaf"])
def test_a_damaged_tree_is_noticed(what):
    tree = BoxTree(boxes_of(np.random.default_rng(3), "uniform", 30))
    validate_box_tree(tree)
    leaves = np.flatnonzero(tree.links[: tree.n_nodes, BODY] >= 0)
    if what == "box":
        tree.nodes[0, 0] += 0.5
    elif what == "skip":
        tree.links[1, SKIP] += 1
    elif what == "body":
        tree.links[leaves[0], BODY] = tree.links[leaves[1], BODY]
    else:
        tree.boxes[tree.links[leaves[3], BODY], 0] -= 1.0
    with pytest.raises(AssertionError, match=r"node|leaf|missing or doubled|body"):
        validate_box_tree(tree)


def test_a_box_that_is_no_number_is_everything():
    """However it comes into the tree: nothing compares with NaN, and a body that does not compare is lost."""
    unit = np.array([0.0, 0, 0, 1, 1, 1])
    lost = np.array([np.nan, 0, 0, np.inf, 1, 1])
    apart = np.array([unit, unit + 5, lost])
    made = BoxTree(apart)
    appended = BoxTree(apart[:2])
    appended.append(apart[2:], np.zeros(1, dtype=bool))
    moved = BoxTree(np.array([unit, unit + 5, [-np.inf] * 3 + [np.inf] * 3]))
    moved.move(np.array([2]), lost[None])
    for tree in (made, appended, moved):
        assert not np.isnan(tree.boxes).any()
        assert tree.pairs(0.0).tolist() == [[0, 2], [1, 2]]
        assert tree.touching(unit + 100, 0.0).tolist() == [2]
