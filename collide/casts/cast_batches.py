"""Casts of any two shapes: convex parts by `convex_casts.py`, facets of meshes by the tree that they stand in."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from collide.batches import answer_batch
from collide.broadphase.bounding_boxes import boxes_of
from collide.casts.convex_casts import CastRows, PairRows, answer_questions, first_contacts, joined
from collide.casts.directions import Directions
from collide.casts.items_ahead import MAX_ASKED, rows_ahead
from collide.casts.leaves import Leaf, leaves_of
from collide.casts.mesh_casts import cast_leaves
from collide.casts.posed_parts import PosedSides, posed_sides
from collide.casts.region_casts import Way, are_proven, are_to_be_asked_again, limits_of
from collide.lowering.closed_regions import closed_shapes
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.convex_batches import Question
from collide.results import UNDECIDED
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape


def cast_batch(
    A, B, X_WA: np.ndarray, X_WB: np.ndarray, directions: Directions, limits: np.ndarray
) -> CastRows:
    """First contacts of n casts.

    A, B : a shape, or n of them.   X_WA, X_WB : checked poses (n, 4, 4), or (1, 4, 4) for all.
    limits : (n,) of t, in units of the directions' vectors, as is the t of the answer.
    """
    n = len(limits)
    sides = [[side] * n if isinstance(side, Shape) else side for side in (A, B)]
    onto_region = np.flatnonzero([b.is_region for b in sides[1]])
    if len(onto_region):
        return _with_regions(sides, X_WA, X_WB, directions, limits, onto_region)
    meshed = np.array([a.meshed or b.meshed for a, b in zip(*sides)], dtype=bool)
    if not meshed.any():
        return _cast_parts(posed_sides(A, B, X_WA, X_WB, n), directions.vectors, limits)
    X_WA, X_WB = (np.broadcast_to(X, (n, 4, 4)) for X in (X_WA, X_WB))
    numbers: dict[tuple[int, int], list[int]] = {}
    for k, (a, b) in enumerate(zip(*sides)):
        numbers.setdefault((id(a), id(b)) if meshed[k] else (-1, -1), []).append(k)
    answers = []
    for key, some in numbers.items():
        poses = np.ascontiguousarray(X_WA[some]), np.ascontiguousarray(X_WB[some])
        vectors, limit = np.ascontiguousarray(directions.vectors[some]), limits[some]
        if key == (-1, -1):
            parts = posed_sides([sides[0][k] for k in some], [sides[1][k] for k in some], *poses, len(some))
            answers.append(_cast_parts(parts, vectors, limit))
        else:
            answers.append(_cast_meshed(sides[0][some[0]], sides[1][some[0]], *poses, vectors, limit))
    order = np.argsort(np.concatenate(list(numbers.values())), kind="stable")
    return CastRows._make(np.concatenate(columns)[order] for columns in zip(*answers))


def _with_regions(sides, X_WA, X_WB, directions: Directions, limits: np.ndarray, some: np.ndarray) -> CastRows:
    """The same where B of some casts is a region, to be closed by a box around the way that matters."""
    n = len(limits)
    X_WA, X_WB = (np.broadcast_to(X, (n, 4, 4)) for X in (X_WA, X_WB))

    def ask(which: np.ndarray, ways: list[Way], *, far: bool) -> CastRows:
        A, B = ([side[k] for k in which.tolist()] for side in sides)
        vectors = directions.vectors[which]
        ends = limits_of(ways, limits[which], far=far) if ways else limits[which]
        poses = np.ascontiguousarray(X_WA[which]), np.ascontiguousarray(X_WB[which])
        if ways:
            A, B = closed_shapes(A, B, *poses, len(which), ends * np.linalg.norm(vectors, axis=1))
        return cast_batch(A, B, *poses, Directions(vectors, directions.exponents[which]), ends)

    ways = [
        Way(sides[0][k], X_WA[k], sides[1][k], X_WB[k], directions.vectors[k]) for k in some.tolist()
    ]
    rows = ask(some, ways, far=False)
    again = are_to_be_asked_again(ways, rows.hit, limits[some])
    if len(again):
        for column, values in zip(rows, ask(some[again], [ways[k] for k in again.tolist()], far=True)):
            column[again] = values
    proven = are_proven(ways, rows.hit, limits[some])
    rows = rows._replace(proven=rows.proven & proven, certified=rows.certified & proven)
    others = np.setdiff1d(np.arange(n), some)
    if not len(others):
        return rows
    answers = rows, ask(others, [], far=False)
    order = np.argsort(np.concatenate([some, others]), kind="stable")
    return CastRows._make(np.concatenate(columns)[order] for columns in zip(*answers))


class _Starts(NamedTuple):
    """(n,) bool: bodies that touch at the start, and where that is proven; (n, 3) their normals and points."""

    hit: np.ndarray
    proven: np.ndarray
    normal: np.ndarray
    point: np.ndarray


#: Pairs of convex parts of a cast that are asked in one kernel before any is ruled out.
_PARTS_TOGETHER = 32


def _cast_parts(sides: PosedSides, vectors: np.ndarray, limits: np.ndarray) -> CastRows:
    """First contacts of n casts of unions of convex parts."""
    n_pairs = sides.counts.prod(axis=1)
    rows = [answer_questions(sides.all_pairs(np.flatnonzero(n_pairs <= MAX_ASKED)), vectors, limits)]
    of_unions = np.flatnonzero(n_pairs > MAX_ASKED)
    if len(of_unions):
        boxes = boxes_of(sides.parts.table, sides.parts.poses.rows, sides.parts.shape_of)

        def boxes_of_cast(cast: int) -> tuple[np.ndarray, np.ndarray]:
            a, b = (boxes[first : first + count] for first, count in zip(sides.first[cast], sides.counts[cast]))
            return a, b

        def answer(owner: np.ndarray, item_a: np.ndarray, item_b: np.ndarray) -> PairRows:
            return answer_questions(sides.pairs(owner, item_a, item_b), vectors, limits)

        rows += rows_ahead(of_unions, boxes_of_cast, vectors, limits, answer, _PARTS_TOGETHER)
    return first_contacts(joined(rows), len(limits))


def _cast_meshed(A: Shape, B: Shape, X_WA, X_WB, vectors: np.ndarray, limits: np.ndarray) -> CastRows:
    """The same of two shapes of which one is a mesh or holds one."""
    starts = _starts(A, B, X_WA, X_WB)
    ahead = np.flatnonzero(~starts.hit)
    leaves_a, leaves_b = leaves_of(A), leaves_of(B)

    def answer(owner: np.ndarray, item_a: np.ndarray, item_b: np.ndarray) -> PairRows:
        parts = []
        for key in np.unique(item_a * len(leaves_b) + item_b).tolist():
            i, j = divmod(key, len(leaves_b))
            casts = owner[(item_a == i) & (item_b == j)]
            pair = leaves_a[i], leaves_b[j], X_WA[casts], X_WB[casts], vectors[casts], limits[casts]
            rows = cast_leaves(*pair) if leaves_a[i].shape.meshed or leaves_b[j].shape.meshed else _cast_convex(*pair)
            k = len(rows.owner)
            parts.append(rows._replace(owner=casts[rows.owner], item_a=np.full(k, i), item_b=np.full(k, j)))
        return joined(parts)

    n_pairs = len(leaves_a) * len(leaves_b)
    if n_pairs <= MAX_ASKED:
        owner, pair = np.repeat(ahead, n_pairs), np.tile(np.arange(n_pairs), len(ahead))
        rows = [answer(owner, *np.divmod(pair, len(leaves_b)))]
    else:
        of_a, of_b = _boxes_at(A), _boxes_at(B)
        rows = list(rows_ahead(ahead, lambda k: (of_a(X_WA[k]), of_b(X_WB[k])), vectors, limits, answer, 1))
    out = first_contacts(joined(rows), len(limits))
    hit = starts.hit
    out.hit[hit], out.at_start[hit], out.t[hit] = True, True, 0.0
    out.proven[hit], out.certified[hit] = starts.proven[hit], starts.proven[hit]
    out.normal[hit], out.point[hit] = starts.normal[hit], starts.point[hit]
    out.item_a[hit] = out.item_b[hit] = 0
    return out


def _boxes_at(shape: Shape) -> Callable[[np.ndarray], np.ndarray]:
    """The boxes (leaves, 6) of a union's leaves by its pose (4, 4), made once of a body that stands still."""
    parts = compound_parts(shape)

    @lru_cache(maxsize=1)
    def boxes(pose: bytes) -> np.ndarray:
        return parts.boxes(np.frombuffer(pose).reshape(1, 4, 4))[0]

    return lambda X: boxes(X.tobytes())


def _starts(A: Shape, B: Shape, X_WA, X_WB) -> _Starts:
    n = len(X_WA)
    starts = _Starts(answer_batch(A, B, X_WA, X_WB, Question(True)), np.ones(n, dtype=bool), *np.zeros((2, n, 3)))
    some = np.flatnonzero(starts.hit)
    if len(some):
        rows = answer_batch(A, B, X_WA[some], X_WB[some], Question(False, np.inf, True))
        starts.proven[some] = rows["how"] != UNDECIDED
        starts.normal[some], starts.point[some] = rows["normal"], rows["point_b"]
    return starts


def _cast_convex(leaf_a: Leaf, leaf_b: Leaf, X_WA, X_WB, vectors: np.ndarray, limits: np.ndarray) -> PairRows:
    """Rows of two convex items of unions."""
    A, B = Compound([(leaf_a.shape, leaf_a.X)]), Compound([(leaf_b.shape, leaf_b.X)])
    pairs = posed_sides(A, B, X_WA, X_WB, len(limits)).all_pairs(np.arange(len(limits)))
    return answer_questions(pairs, vectors, limits)
