"""Pairs of items of two unions in the way of a cast: by their boxes, the nearest first.

No item reaches out of its box, so two items touch no sooner than their boxes, A's moved. Pairs are asked in the order
of these bounds, until the bounds exceed the upper bound of a proven contact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from collide.broadphase.box_tree import BoxTree
from collide.broadphase.boxes_ahead import SWEEP, bodies_ahead
from collide.casts.cast_pairs import STATUS, UPPER
from collide.casts.convex_casts import PairRows
from collide.casts.portal import HIT

#: Of so few pairs of items all are asked: quicker than a tree.
MAX_ASKED = 64
#: Pairs of items that are listed at once: so many casts at once need little memory.
_LISTED_AT_ONCE = 1 << 16

#: Rows of casts by their numbers, items of A and items of B, (k,) each; a miss may be left out.
Answer = Callable[[np.ndarray, np.ndarray, np.ndarray], PairRows]


def rows_ahead(
    casts: np.ndarray, boxes_of: Callable[[int], tuple[np.ndarray, np.ndarray]], vectors: np.ndarray,
    limits: np.ndarray, answer: Answer, first: int,
) -> Iterator[PairRows]:
    """Rows of pairs of items of unions, with all possible first contacts among them.

    casts : (k,) numbers of casts; pairs that cannot hold the first contact are not asked.
    boxes_of : of the items of A and of B in a cast, (m, 6) each.   vectors, limits : (n, 3) and (n,), of all casts.
    first : pairs of a cast asked together before any is ruled out.
    """
    for owner, pairs, bounds in _listed(casts, boxes_of, vectors, limits):
        best = limits.copy()
        for some in nearest_first(owner, bounds, best, first):
            pair_rows = answer(owner[some], *pairs[some].T)
            take_best(best, pair_rows)
            yield pair_rows


def rows_within_sets(
    casts: np.ndarray, boxes_of: Callable[[int], tuple[np.ndarray, np.ndarray]], vectors: np.ndarray,
    limits: np.ndarray, earliest: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray], starts: Answer,
    answer: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], PairRows], first: int,
) -> Iterator[PairRows]:
    """`rows_ahead` of items slow to answer, in the order in which convex sets around them meet.

    earliest : t before which items of A and of B (k,) have no contact in casts (k,), infinity without contact; quick.
    starts : rows of pairs in contact at the start, asked of pairs whose sets may be.
    answer : rows of the other pairs; takes upper bounds of the first contacts of all casts, too.
    first : pairs of a cast whose sets are asked together.
    A pair is answered once its bound is not above the box bound of every pair whose sets were not asked: then no other
    pair has a lower bound.
    """
    for owner, pairs, bounds in _listed(casts, boxes_of, vectors, limits):
        best, following = limits.copy(), np.zeros(len(limits))
        after = np.append(np.where(np.diff(owner) == 0, bounds[1:], np.inf), np.inf)[: len(owner)]
        waiting, until = np.zeros(0, dtype=np.int64), np.full(len(owner), np.inf)
        for number, some in enumerate(nearest_first(owner, bounds, best, first)):
            until[some] = np.maximum(earliest(owner[some], *pairs[some].T), bounds[some])
            following[owner[some]] = after[some]  # of several of an owner the last one counts
            waiting = np.concatenate([waiting, some[until[some] < np.inf]])
            is_ready = until[waiting] <= following[owner[waiting]]
            ready, waiting = waiting[is_ready], waiting[~is_ready]
            ready = ready[np.lexsort((until[ready], owner[ready]))]
            # One at first; the more were asked in vain, the more at once.
            for next_ones in nearest_first(owner[ready], until[ready], best, 2**number):
                asked = ready[next_ones]
                near = asked[until[asked] <= 0.0]
                if len(near):
                    touching = starts(owner[near], *pairs[near].T)
                    take_best(best, touching)
                    yield touching
                    asked = asked[(best >= 0.0)[owner[asked]]]
                item_a, item_b = pairs[asked].T
                pair_rows = answer(owner[asked], item_a, item_b, best)
                take_best(best, pair_rows)
                yield pair_rows


def take_best(best: np.ndarray, pair_rows: PairRows) -> None:
    """Lower the upper bounds of the casts' first contacts; −∞ for casts with a pair proven to touch at the start.
    """
    marks = pair_rows.marks
    proven = marks.proven & (pair_rows.rows[:, STATUS] == HIT)
    upper = np.where(marks.at_start[proven], -np.inf, pair_rows.rows[proven, UPPER])
    np.minimum.at(best, pair_rows.owner[proven], upper)


def nearest_first(owner: np.ndarray, bounds: np.ndarray, best: np.ndarray, first: int = 1) -> Iterator[np.ndarray]:
    """Numbers of pairs, of every owner its next ``first``, then twice as many each time, as long as they may be nearer
    than its best.

    owner : (k,) ascending.   bounds : (k,) from below, ascending among those of an owner.
    best : (n,) from above, brought up to date by the caller between rounds.
    """
    rank = np.arange(len(owner)) - np.searchsorted(owner, owner)
    begin, size = 0, first
    while len(rank) and begin <= rank.max():
        some = np.flatnonzero((rank >= begin) & (rank < begin + size) & (bounds <= best[owner]))
        if len(some):
            yield some
        begin, size = begin + size, 2 * size


def _listed(casts: np.ndarray, boxes_of, vectors: np.ndarray, limits: np.ndarray):
    """Yields (casts (k,) ascending, items of A and of B (k, 2), bounds (k,) of t from below), some casts at a time."""
    tree, blocks, count = BoxTree(np.zeros((0, 6))), [], 0
    for cast in casts.tolist():
        boxes_a, boxes_b = boxes_of(cast)
        if not np.array_equal(boxes_b, tree.boxes):
            tree = BoxTree(boxes_b)
        pairs, bounds = _pairs_ahead(boxes_a, tree, vectors[cast], limits[cast])
        blocks.append((np.full(len(pairs), cast), pairs, bounds))
        count += len(pairs)
        if count >= _LISTED_AT_ONCE or cast == casts[-1]:
            yield tuple(np.concatenate(column) for column in zip(*blocks))
            blocks, count = [], 0


def _pairs_ahead(boxes_a: np.ndarray, tree: BoxTree, vector: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """((k, 2) items of A and of B whose boxes meet as A's are moved, (k,) bounds of t from below), by bound."""
    sweeps = np.empty((len(boxes_a), SWEEP))
    sweeps[:, :6], sweeps[:, 6:9], sweeps[:, 9] = boxes_a, vector, limit
    pairs, bounds = bodies_ahead(tree, sweeps)
    order = np.argsort(bounds, kind="stable")
    return pairs[order], bounds[order]
