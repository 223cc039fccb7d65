"""The nearest pair of a World, by branch and bound: pairs in the order of how near their boxes let them be, until no
remaining pair can be nearer than the best.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.broadphase.bounding_boxes import least_distances
from collide.worlds.packed_world import PackedWorld
from collide.worlds.posed_bodies import PosedBodies

#: Relative: what a bound from boxes, or a distance within its bracket, may be off. Far more than either is.
_ROUNDING = 2.0**-24
#: Pairs that are asked at first; then twice as many each time.
_FIRST = 16


class _Nearest(NamedTuple):
    """pair : (1, 2), the nearest so far, or (0, 2).   row : (1,) its answer; ``None`` before the pair is asked."""

    pair: np.ndarray
    row: np.ndarray | None


def nearest_pair(packed: PackedWorld, limit: float, threads: int) -> np.ndarray:
    """The row of the tested pair with the least signed distance, at most ``limit`` [m], of several pairs with the least
    positions; no row without a pair within the limit.
    """
    asked = np.empty(0, dtype=np.int64)
    best, winner = np.inf, _Nearest(np.empty((0, 2), dtype=np.int64), None)
    n = len(packed.roster.ids)
    for margin in _margins(packed, limit):
        candidates = packed.candidates(margin)
        keys = candidates[:, 0] * n + candidates[:, 1]
        is_new = ~np.isin(keys, asked) if len(asked) else slice(None)
        asked = keys
        best, winner = _least(packed, candidates[is_new], min(limit, best), best, winner, threads)
        if best < np.inf:
            break
    if np.isfinite(best) and best > margin:  # boxes no farther apart than the best have not all been compared
        candidates = packed.candidates(min(best * (1.0 + _ROUNDING), limit))
        is_new = ~np.isin(candidates[:, 0] * n + candidates[:, 1], asked)
        best, winner = _least(packed, candidates[is_new], min(limit, best), best, winner, threads)
    if winner.row is not None:
        return winner.row
    return packed.answer(winner.pair, np.inf, boolean=False, stop_at_hit=False).rows


def _margins(packed: PackedWorld, limit: float):
    """Margins to look within, in turn: 0, the World's extent over its number of bodies, 4 times the last, ``limit``."""
    yield 0.0
    tree = packed.tree
    if tree is None or not limit > 0.0:
        return
    around = tree.around
    extent = float((around[3:] - around[:3]).max())
    margin = extent / max(len(packed.roster.ids), 1)
    while 0.0 < margin < min(limit, extent):
        yield margin
        margin *= 4.0
    yield limit


def _least(packed: PackedWorld, pairs: np.ndarray, limit: float, best: float, winner: _Nearest, threads: int):
    """(least distance, its pair) among pairs (k, 2) and the best so far."""
    bounds, size = lower_bounds(packed, pairs), _FIRST
    while True:
        top = best + _ROUNDING * abs(best) if best > -np.inf else best  # −inf: two half-spaces
        remain = bounds <= min(top, limit)
        pairs, bounds = pairs[remain], bounds[remain]
        if not len(pairs):
            return best, winner
        nearest = np.argpartition(bounds, size - 1)[:size] if size < len(bounds) else np.arange(len(bounds))
        reach = max(min(limit, top), 0.0)
        rows = packed.answer(pairs[nearest], reach, boolean=False, stop_at_hit=False, threads=threads).rows
        rows = rows[~rows["beyond"] & (rows["distance"] <= limit)]
        for row in rows[np.lexsort((rows["b"], rows["a"], rows["distance"]))][:1, None]:
            pair, distance = np.array([[row["a"][0], row["b"][0]]], dtype=np.int64), float(row["distance"][0])
            if distance < best or (distance == best and tuple(pair[0]) < tuple(winner.pair[0])):
                # Depths have no limit: a row of convex bodies that hit is that of any. A gap's may be of a search that
                # the limit cut, and a union's iterations are those of the parts within the limit.
                is_any = row["hit"][0] and packed.parts.single_convex[pair[0]].all()
                best, winner = distance, _Nearest(pair, row if reach == np.inf or is_any else None)
        bounds[nearest] = np.inf
        pairs, bounds, size = pairs[bounds < np.inf], bounds[bounds < np.inf], 2 * size


def lower_bounds(packed: PosedBodies, pairs: np.ndarray) -> np.ndarray:
    """(k,) lower bounds of signed distances [m], as of `gap_bounds`: less than the gap of boxes, or minus the shortest
    shift along an axis to part them. With a body not convex, whose depth is known from above alone, −inf where they
    may meet.
    """
    parts = packed.parts
    boxes = parts.boxes if parts.all_of_one_part else parts.body_boxes(np.arange(len(parts.shape_of)))
    bounds = least_distances(boxes, pairs, _ROUNDING)
    bounds[(bounds <= 0.0) & ~parts.single_convex[pairs].all(axis=1)] = -np.inf
    return bounds
