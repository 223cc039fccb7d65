"""Casts of any two shapes: convex parts by `convex_casts.py`, facets of meshes by the tree that they stand in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.batches import answer_batch
from collide.casts.convex_casts import (
    CastRows,
    Marks,
    PairRows,
    answer_questions,
    cast_parts,
    first_contacts,
    nothing_met,
)
from collide.casts.directions import Directions
from collide.casts.leaves import Leaf, leaves_of
from collide.casts.mesh_casts import cast_leaves
from collide.casts.posed_parts import part_pairs
from collide.casts.region_casts import Way, are_proven, are_to_be_asked_again, limits_of
from collide.lowering.closed_regions import closed_shapes
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
    if not n:  # what no cast asks about may be a mesh, which has no parts
        return nothing_met(0)
    sides = [[side] * n if isinstance(side, Shape) else side for side in (A, B)]
    onto_region = np.flatnonzero([b.is_region for b in sides[1]])
    if len(onto_region):
        return _with_regions(sides, X_WA, X_WB, directions, limits, onto_region)
    meshed = np.array([a.meshed or b.meshed for a, b in zip(*sides)], dtype=bool)
    if not meshed.any():
        return cast_parts(part_pairs(A, B, X_WA, X_WB, n), directions.vectors, limits, n)
    X_WA, X_WB = (np.broadcast_to(X, (n, 4, 4)) for X in (X_WA, X_WB))
    numbers: dict[tuple[int, int], list[int]] = {}
    for k, (a, b) in enumerate(zip(*sides)):
        numbers.setdefault((id(a), id(b)) if meshed[k] else (-1, -1), []).append(k)
    answers = []
    for key, some in numbers.items():
        poses = np.ascontiguousarray(X_WA[some]), np.ascontiguousarray(X_WB[some])
        vectors, limit = np.ascontiguousarray(directions.vectors[some]), limits[some]
        if key == (-1, -1):
            pairs = part_pairs([sides[0][k] for k in some], [sides[1][k] for k in some], *poses, len(some))
            answers.append(cast_parts(pairs, vectors, limit, len(some)))
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


def _cast_meshed(A: Shape, B: Shape, X_WA, X_WB, vectors: np.ndarray, limits: np.ndarray) -> CastRows:
    """The same of two shapes of which one is a mesh or holds one."""
    n = len(limits)
    starts = _starts(A, B, X_WA, X_WB)
    ahead = np.flatnonzero(~starts.hit)
    parts = []
    for i, leaf_a in enumerate(leaves_of(A)):
        for j, leaf_b in enumerate(leaves_of(B)):
            pair = leaf_a, leaf_b, X_WA[ahead], X_WB[ahead], vectors[ahead], limits[ahead]
            part = cast_leaves(*pair) if leaf_a.shape.meshed or leaf_b.shape.meshed else _cast_convex(*pair)
            k = len(part.owner)
            parts.append(part._replace(owner=ahead[part.owner], item_a=np.full(k, i), item_b=np.full(k, j)))
    rows = np.concatenate([part.rows for part in parts])
    marks = Marks._make(np.concatenate(columns) for columns in zip(*(part.marks for part in parts)))
    columns = [np.concatenate([getattr(part, name) for part in parts]) for name in ("owner", "item_a", "item_b")]
    out = first_contacts(PairRows(rows, marks, *columns), n)
    hit = starts.hit
    out.hit[hit], out.at_start[hit], out.t[hit] = True, True, 0.0
    out.proven[hit], out.certified[hit] = starts.proven[hit], starts.proven[hit]
    out.normal[hit], out.point[hit] = starts.normal[hit], starts.point[hit]
    out.item_a[hit] = out.item_b[hit] = 0
    return out


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
    pairs = part_pairs(A, B, X_WA, X_WB, len(limits))
    return answer_questions(pairs, vectors, limits)
