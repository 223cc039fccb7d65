"""The traversal of eight-wide trees with visitors of a test's own, against all leaves and all pairs of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive import rng_of

from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import NODE, NOTHING, WIDTH, MeshTree, TreeView, open_tree
from collide.narrowphase.facets.pair_heap import pop_heap, push_heap
from collide.narrowphase.facets.traversal import (
    OF_A,
    OF_B,
    any_pair,
    box_of_tree,
    make_traversal,
    opens_b,
    pair_of_trees,
    push_children,
    word_of,
)

pytestmark = pytest.mark.plain_kernels


class Trees(NamedTuple):
    A: TreeView
    B: TreeView


class Segment(NamedTuple):
    tree: TreeView


class Query(NamedTuple):
    """visits : the pairs of runs visited, in their order.   limit : visits after which the traversal ends.

    pauses : heights of the stack at which it pauses.
    """

    trees: Trees
    segment: Segment
    visits: list
    limit: int
    pauses: list


def tree_of(seed: int, n: int) -> MeshTree:
    return build_mesh_tree(*bumpy_sphere(n, seed))


def used_children(tree: TreeView, node: int) -> int:
    halves = tree.boxes[NODE * node + 3 * WIDTH : NODE * node + 4 * WIDTH]
    return int(np.packbits(halves > NOTHING / 2, bitorder="little")[0])


def visit(query, pair):
    query.visits.append((~pair.link_a, ~pair.link_b))
    return len(query.visits) == query.limit


def open_all(query, pair, stack, top):
    A, B = query.trees
    if opens_b(A, B, pair, 1.0):
        mask = used_children(B, pair.link_b)
        return push_children(stack, top, mask, word_of(pair.a, WIDTH * pair.link_b), OF_B)
    return push_children(stack, top, used_children(A, pair.link_a), word_of(WIDTH * pair.link_a, pair.b), OF_A)


def open_one(query, pair, stack, top):
    mask = used_children(query.segment.tree, pair.link_a)
    return push_children(stack, top, mask, WIDTH * pair.link_a, OF_B)


def pause(query, _stack, top):
    return -top if query.pauses and top == query.pauses[-1] and query.pauses.pop() else top


def question(A: MeshTree, B: MeshTree, limit: int = -1, pauses=()) -> tuple[Query, np.ndarray]:
    view = open_tree(A.address)
    query = Query(Trees(view, open_tree(B.address)), Segment(view), [], limit, list(pauses))
    return query, np.zeros(WIDTH * (A.depth + B.depth + 4), dtype=np.int64)


def facets_of(run: int) -> list[int]:
    return list(range(run >> 3, (run >> 3) + (run & 7)))


@pytest.mark.parametrize("n", [4, 20, 90])
def test_every_facet_is_visited_once(n):
    tree = tree_of(n, n)
    query, stack = question(tree, tree)
    assert make_traversal(any_pair, box_of_tree, visit, open_one)(query, stack, 1) == 0
    facets = [f for run, _ in query.visits for f in facets_of(run)]
    assert sorted(facets) == list(range(len(tree.ids)))
    assert all(run == 0 for _, run in query.visits), "a leaf without facets stands for the segment"


@pytest.mark.parametrize(("m", "n"), [(4, 4), (4, 40), (30, 20)])
def test_every_pair_of_facets_is_visited_once(m, n):
    A, B = tree_of(m, m), tree_of(n + 1, n)
    query, stack = question(A, B)
    assert make_traversal(any_pair, pair_of_trees, visit, open_all)(query, stack, 1) == 0
    pairs = [(a, b) for run_a, run_b in query.visits for a in facets_of(run_a) for b in facets_of(run_b)]
    assert sorted(pairs) == [(a, b) for a in range(len(A.ids)) for b in range(len(B.ids))]


def test_a_visit_may_end_it():
    A, B = tree_of(1, 30), tree_of(2, 30)
    query, stack = question(A, B, limit=5)
    assert make_traversal(any_pair, pair_of_trees, visit, open_all)(query, stack, 1) == 0
    assert len(query.visits) == 5


def test_a_pause_changes_nothing():
    A, B = tree_of(3, 30), tree_of(4, 20)
    whole, stack = question(A, B)
    make_traversal(any_pair, pair_of_trees, visit, open_all)(whole, stack, 1)
    paused, stack = question(A, B, pauses=[3, 9, 14, 9, 12])
    traverse = make_traversal(pause, pair_of_trees, visit, open_all)
    top, calls = 1, 0
    while top:
        top, calls = -traverse(paused, stack, top), calls + 1
    assert calls == 6 and paused.visits == whole.visits


def test_children_are_pushed_in_ascending_order():
    stack = np.zeros(12, dtype=np.int64)
    assert push_children(stack, 2, 0b10010110, word_of(5, 40), OF_B) == 6
    assert stack[2:6].tolist() == [word_of(5, 40 + slot) for slot in (1, 2, 4, 7)]
    assert push_children(stack, 0, 0b101, word_of(40, 5), OF_A) == 2
    assert stack[:2].tolist() == [word_of(40, 5), word_of(42, 5)]


def test_heap_gives_the_least_first():
    rng = rng_of(8)
    for _ in range(20):
        n = int(rng.integers(1, 60))
        bounds = rng.integers(0, 12, size=n).astype(float)
        items, keys, size = np.zeros(n, dtype=np.int64), np.zeros(n), 0
        for item, key in enumerate(bounds.tolist()):
            size = push_heap(items, keys, size, item, key)
        taken = []
        while size:
            taken.append((float(keys[0]), int(items[0])))
            size = pop_heap(items, keys, size)
        assert [key for key, _ in taken] == sorted(bounds.tolist())
        assert sorted(item for _, item in taken) == list(range(n)) and all(bounds[item] == key for key, item in taken)
