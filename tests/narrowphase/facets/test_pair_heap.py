"""The heap of pairs of boxes in kernels, against Python's own, and the traversal's words and stack."""

from __future__ import annotations

import heapq

import pytest
from naive import rng_of

from collide.narrowphase.facets import traversal as T
from collide.narrowphase.facets.pair_heap import pop_heap, push_heap

pytestmark = pytest.mark.plain_kernels


def test_least_keys_come_first():
    rng = rng_of("pair heap")
    for _ in range(30):
        items, keys, size, known = [0] * 200, [0.0] * 200, 0, []
        for step in range(300):
            if size and (size == 200 or rng.random() < 0.45):
                key, _ = heapq.heappop(known)
                assert keys[0] == key
                size = pop_heap(items, keys, size)
            else:
                key = float(rng.integers(0, 20))
                heapq.heappush(known, (key, step))
                size = push_heap(items, keys, size, step, key)
            assert size == len(known) and sorted(keys[:size]) == sorted(key for key, _ in known)
            assert all(keys[(k - 1) >> 1] <= keys[k] for k in range(1, size)), "no heap"
        assert len(set(items[:size])) == size


def test_children_are_pushed_in_ascending_order():
    stack = [-1] * 12
    word = T.word_of(5, 7)
    assert (word >> 32, word & 0xFFFFFFFF) == (5, 7)
    top = T.push_children(stack, 2, 0b10100101, word, T.OF_A)
    assert top == 6 and [w >> 32 for w in stack[2:6]] == [5, 7, 10, 12] and {w & 0xFFFFFFFF for w in stack[2:6]} == {7}
    top = T.push_children(stack, 0, 0b11, word, T.OF_B)
    assert top == 2 and [w & 0xFFFFFFFF for w in stack[:2]] == [7, 8] and stack[6:] == [-1] * 6


class Query:
    """A tree of two levels beside another: what the traversal visits is written down."""

    def __init__(self, width: int, culled):
        self.width, self.culled, self.visited = width, culled, []

    def pair_behind(self, word: int) -> T.BoxPair:
        a, b = word >> 32, word & 0xFFFFFFFF
        return T.BoxPair(a, b, 1 if a == 0 else -a, 1 if b == 0 else -b)

    def open_pair(self, pair: T.BoxPair, stack, top: int) -> int:
        """The first of the two that is a node, 0, has boxes 1 … width."""
        mask = sum(1 << k for k in range(self.width) if not self.culled(k + 1))
        if pair.link_a > 0:
            return T.push_children(stack, top, mask, T.word_of(1, pair.b), T.OF_A)
        return T.push_children(stack, top, mask, T.word_of(pair.a, 1), T.OF_B)

    def visit(self, pair: T.BoxPair) -> bool:
        self.visited.append((pair.a, pair.b))
        return len(self.visited) == self.stop

    stop = 0


def traverse(query: Query) -> int:
    run = T.make_traversal(T.any_pair, Query.pair_behind, Query.visit, Query.open_pair)
    stack = [0] * 80
    stack[0] = T.word_of(0, 0)
    return run(query, stack, 1)


@pytest.mark.parametrize("width", [1, 3, 8])
def test_every_pair_of_leaves_once(width):
    query = Query(width, lambda k: False)
    assert traverse(query) == 0
    assert sorted(query.visited) == [(a, b) for a in range(1, width + 1) for b in range(1, width + 1)]


def test_what_is_culled_is_not_visited_and_a_visit_may_end_it():
    query = Query(8, lambda k: k % 3 == 0)
    traverse(query)
    left = [k for k in range(1, 9) if k % 3]
    assert sorted(query.visited) == [(a, b) for a in left for b in left]
    query = Query(8, lambda k: False)
    query.stop = 5
    assert traverse(query) == 0 and len(query.visited) == 5
