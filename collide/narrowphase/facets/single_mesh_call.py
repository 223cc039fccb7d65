"""Pairs with a mesh made ready for single booleans and gaps."""

from __future__ import annotations

import math

import numpy as np

from collide.lowering.composite_parts import is_union
from collide.lowering.facet_bodies import Body, body_of, has_facets, is_halfspace, reach_of
from collide.narrowphase import convex_queries as run
from collide.narrowphase.facets.mesh_hits import APART, HIT
from collide.narrowphase.facets.mesh_pairs import pair_states
from collide.narrowphase.facets.mesh_rows import NEAR, PROMISE
from collide.narrowphase.facets.single_surface import Side, SingleMeshPair
from collide.narrowphase.facets.surface_distance import (
    DISTANCE,
    EXACT,
    FACET_A,
    FACET_B,
    LOWER,
    NORMAL,
    POINT_A,
    POINT_B,
    UPPER,
)
from collide.results import FORMULA, PAIR_DTYPE
from collide.shapes.shape import Shape


class PreparedPair:
    """Two bodies in the order of their contents, as `collide.query` asks prepared pairs.

    collide : as `run.SinglePair` has it.
    """

    def __init__(self, one: Body, other: Body, sides: tuple[Side, Side], exchanged: bool):
        self._pair = SingleMeshPair(*sides, exchanged, one.radius + other.radius)
        self.collide = self._pair.collide
        self._exchanged, self._radii = exchanged, (one.radius, other.radius)
        self._reaches = reach_of(one) + reach_of(other)

    def distance(self, X_WA, X_WB, _depths: bool) -> np.ndarray | None:
        """The row of one gap, bit by bit that of a batch (`answers.mesh_rows`); None of overlaps, and of what a batch
        says better. Numpy takes ten times as long over arrays of one as this does."""
        found = self._pair.near(X_WA, X_WB)
        if found is None:
            return None
        numbers, marks = found[0].tolist(), found[1].tolist()
        radius = self._radii[0] + self._radii[1]
        normal = numbers[NORMAL : NORMAL + 3]
        if marks[FACET_A] < 0 or not (numbers[LOWER] > radius or radius == 0.0) or normal == [0.0, 0.0, 0.0]:
            return None
        lower, upper = numbers[LOWER], numbers[UPPER]
        if radius:
            lower, upper = math.nextafter(lower - radius, -math.inf), math.nextafter(upper - radius, math.inf)
        lower, upper = max(lower, 0.0), max(upper, 0.0)
        distance = min(max(numbers[DISTANCE] - radius, lower), upper) or upper
        points = [
            [numbers[at + i] + side * normal[i] for i in range(3)]
            for at, side in ((POINT_A, self._radii[0]), (POINT_B, -self._radii[1]))
        ]
        facets = [marks[FACET_A], marks[FACET_B]]
        x, y, z = (float(X_WB[k, 3] - X_WA[k, 3]) for k in range(3))
        away = math.sqrt(x * x + y * y + z * z)
        if numbers[DISTANCE] <= NEAR * (self._reaches + away):
            return None
        narrow = upper <= lower + PROMISE * (self._reaches + away)
        if self._exchanged:
            normal = [0.0 - x for x in normal]
            points.reverse()
            facets.reverse()
        rows = np.zeros(1, dtype=PAIR_DTYPE)
        rows[0] = (
            distance, lower, upper, [x + 0.0 for x in normal], *points, 0, 1, *facets, _NONE, _NONE, 0, 0, FORMULA,
            min(marks[EXACT], 255), False, narrow and (lower > 0.0 or radius == 0.0), False,
        )  # fmt: skip
        return rows


#: No vertices decided.
_NONE = (-1, -1, -1, -1)


def single_pair(A: Shape, B: Shape) -> PreparedPair | None:
    """The pair, or None where single calls are answered as batches of one: unions, half-spaces, curved shapes, very
    many parts.

    It holds trees and points, not the shapes. Raises UnsupportedQuery.
    """
    if is_union(A) or is_union(B) or is_halfspace(A) or is_halfspace(B) or not (has_facets(A) and has_facets(B)):
        return None
    one, other = body_of(A), body_of(B)
    exchanged = other.key < one.key
    if exchanged:
        one, other = other, one
    sides = _side(one), _side(other)
    return PreparedPair(one, other, sides, exchanged) if SingleMeshPair.serves(*sides) else None


def one_state(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, kept: dict[int, PreparedPair | None], key: int) -> int:
    """APART, HIT or OPEN at one pair of checked poses (4, 4). kept : pairs made ready, by numbers of the caller's."""
    if key not in kept:
        kept[key] = single_pair(A, B) if run.single_calls_are_safe() else None
    pair = kept[key]
    said = pair.collide(X_WA, X_WB) if pair is not None else None
    return int(pair_states(A, B, X_WA[None], X_WB[None])[0]) if said is None else HIT if said else APART


def _side(body: Body) -> Side:
    return Side(body.tree, body.solid, body.points, body.centre, body.reach)
