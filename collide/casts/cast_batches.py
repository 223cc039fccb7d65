"""Casts of any two shapes: convex parts by `convex_casts.py`, facets of meshes by the tree that they stand in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from collide.broadphase.bounding_boxes import boxes_of
from collide.casts.convex_casts import (
    CastRows,
    PairRows,
    answer_questions,
    earliest_contacts,
    first_contacts,
    joined,
    nothing_met,
)
from collide.casts.directions import Directions
from collide.casts.field_casts import field_casts
from collide.casts.items_ahead import MAX_ASKED, rows_ahead, rows_within_sets
from collide.casts.leaves import Leaf, leaves_of
from collide.casts.mesh_casts import Casts, cast_leaves
from collide.casts.posed_parts import PosedSides, posed_sides
from collide.casts.region_casts import Way, are_proven, are_to_be_asked_again, limits_of
from collide.casts.starts import Starts, item_of
from collide.casts.union_casts import UnionWay, cast_by_kernel, prepare_way
from collide.lowering.closed_regions import closed_shapes
from collide.lowering.compound_layout import body_ball, part_balls
from collide.lowering.compound_table import Balls
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import bounding_parts_of, convex_set_of, parts_of
from collide.narrowphase.composite.balls_on_ways import near_on_ways
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.dispatch import OF_FACETS, OF_UNIONS, cells_of
from collide.pairs.batches import answer_batch
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape
from collide.shapes.shape_set import have_any

_LOOKS_AT_FACETS, _ARE_TAKEN_APART = cells_of(OF_FACETS), cells_of(OF_UNIONS)


def cast_batch(
    A, B, X_WA: np.ndarray, X_WB: np.ndarray, directions: Directions, limits: np.ndarray, start_normals: bool = False
) -> CastRows:
    """First contacts of n casts.

    A, B : a shape, or n of them.   X_WA, X_WB : checked poses (n, 4, 4), or (1, 4, 4) for all.
    limits : (n,) of t, in units of the directions' vectors, as is the t of the answer.
    start_normals : normal and point of `distance` of items that touch at the start; else a common point, no normal.
    """
    rows = _first_contacts(A, B, X_WA, X_WB, directions, limits)
    if start_normals and rows.at_start.any():
        _add_start_normals(rows, A, B, X_WA, X_WB)
    return rows


def _add_start_normals(rows: CastRows, A, B, X_WA, X_WB) -> None:
    """Write normals and points of items in contact at the start, in a batch for all casts of the same two items."""
    X_WA, X_WB = (np.broadcast_to(X, (len(rows.hit), 4, 4)) for X in (X_WA, X_WB))
    numbers: dict[tuple[int, ...], list[int]] = {}
    for k in np.flatnonzero(rows.at_start).tolist():
        a, b = (side if isinstance(side, Shape) else side[k] for side in (A, B))
        numbers.setdefault((id(a), id(b), int(rows.item_a[k]), int(rows.item_b[k])), []).append(k)
    for (*_, i, j), some in numbers.items():
        a, b = (side if isinstance(side, Shape) else side[some[0]] for side in (A, B))
        pair_rows = answer_batch(
            item_of(a, i), item_of(b, j), np.ascontiguousarray(X_WA[some]), np.ascontiguousarray(X_WB[some]),
            Question(False, np.inf, True),
        )
        rows.normal[some], rows.point[some] = pair_rows["normal"], pair_rows["point_b"]


def _first_contacts(A, B, X_WA: np.ndarray, X_WB: np.ndarray, directions: Directions, limits: np.ndarray) -> CastRows:
    """The same without normals of bodies that touch at the start."""
    n = len(limits)
    if not n:  # what no cast asks about may be a mesh, which has no parts
        return nothing_met(0)
    if have_any(A, "is_field") or have_any(B, "is_field"):
        return field_casts(_first_contacts, A, B, X_WA, X_WB, directions, limits)
    kind_a, kind_b = (kind_of(S) if isinstance(S, Shape) else np.array([kind_of(s) for s in S]) for S in (A, B))
    are_two = isinstance(A, Shape) and isinstance(B, Shape)
    if are_two and _ARE_TAKEN_APART[kind_a, kind_b]:
        balls = body_ball(A), body_ball(B)
        near = near_on_ways(*balls, X_WA, X_WB, n, vectors=directions.vectors, limits=limits)
        if near is not None and not near.all():
            out = nothing_met(n)
            X_WA, X_WB = (X if len(X) == 1 else X[near] for X in (X_WA, X_WB))
            of_near = Directions(directions.vectors[near], directions.exponents[near])
            for column, values in zip(out, _first_contacts(A, B, X_WA, X_WB, of_near, limits[near])):
                column[near] = values
            return out
        way = prepare_way(A, B)
        if isinstance(way, UnionWay):
            return _by_kernel(way, A, B, X_WA, X_WB, directions, limits)
    sides = [[side] * n if isinstance(side, Shape) else side for side in (A, B)]
    onto_region = np.flatnonzero([b.is_region for b in sides[1]])
    if len(onto_region):
        return _with_regions(sides, X_WA, X_WB, directions, limits, onto_region)
    meshed = np.broadcast_to(_LOOKS_AT_FACETS[kind_a, kind_b], n)
    if not meshed.any():
        return _cast_parts_of(A, B, X_WA, X_WB, directions.vectors, limits)
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


def _by_kernel(
    way: UnionWay, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, directions: Directions, limits: np.ndarray
) -> CastRows:
    """The same of unions of convex parts, cast by cast in a kernel; what it leaves open is asked together."""
    rows, is_open = cast_by_kernel(way, X_WA, X_WB, directions, limits)
    if len(is_open):
        X_WA, X_WB = (X if len(X) == 1 else X[is_open] for X in (X_WA, X_WB))
        answer = _cast_parts_of(A, B, X_WA, X_WB, directions.vectors[is_open], limits[is_open])
        for column, values in zip(rows, answer):
            column[is_open] = values
    return rows


def _cast_parts_of(A, B, X_WA: np.ndarray, X_WB: np.ndarray, vectors: np.ndarray, limits: np.ndarray) -> CastRows:
    """The same of convex shapes and unions of such."""
    if isinstance(A, Shape) and isinstance(B, Shape) and len(parts_of(A)) * len(parts_of(B)) > MAX_ASKED:
        return _cast_unions(A, B, X_WA, X_WB, vectors, limits)
    return _cast_parts(posed_sides(A, B, X_WA, X_WB, len(limits)), vectors, limits)


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
        return _first_contacts(A, B, *poses, Directions(vectors, directions.exponents[which]), ends)

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


#: Pairs of convex parts of a cast that are asked in one kernel before any is ruled out.
_PARTS_TOGETHER = 32
#: Convex sets around leaves that are posed at once.
_POSED_AT_ONCE = 1 << 15


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


def _cast_unions(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, vectors: np.ndarray, limits: np.ndarray
) -> CastRows:
    """The same of two unions, of whose parts only those are posed whose balls come near the ball around the other."""
    rows, n = [], len(limits)
    of_a, of_b = (body_ball(A), part_balls(A)), (body_ball(B), part_balls(B))
    for k in range(n):
        X, Y = (poses if len(poses) == 1 else poses[k : k + 1] for poses in (X_WA, X_WB))
        way, limit = vectors[k : k + 1], limits[k : k + 1]
        some_a = _near_parts(of_a[1], of_b[0], of_a[1].n, X, Y, way, limit)
        some_b = _near_parts(of_a[0], of_b[1], of_b[1].n, X, Y, way, limit)
        if not len(some_a) or not len(some_b):
            rows.append(nothing_met(1))
            continue
        row = _cast_parts(posed_sides(A, B, X, Y, 1, some=(some_a, some_b)), way, limit)
        row.item_a[row.hit], row.item_b[row.hit] = some_a[row.item_a[row.hit]], some_b[row.item_b[row.hit]]
        rows.append(row)
    return CastRows._make(np.concatenate(columns) for columns in zip(*rows))


def _near_parts(a: Balls, b: Balls, n: int, X_WA, X_WB, vector: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Numbers, ascending, of the balls near the other body's way, of n balls of a body."""
    near = near_on_ways(a, b, X_WA, X_WB, n, vectors=np.repeat(vector, n, axis=0), limits=np.repeat(limit, n))
    return np.arange(n) if near is None else np.flatnonzero(near)


def _cast_meshed(A: Shape, B: Shape, X_WA, X_WB, vectors: np.ndarray, limits: np.ndarray) -> CastRows:
    """`CastRows` of two shapes, of which A, B or both are meshes or unions with meshes."""
    leaves_a, leaves_b = leaves_of(A), leaves_of(B)
    meshed = [np.array([leaf.shape.meshed for leaf in leaves]) for leaves in (leaves_a, leaves_b)]

    def answer(owner: np.ndarray, item_a: np.ndarray, item_b: np.ndarray, best: np.ndarray) -> PairRows:
        rows = []
        for some in _answered_together(item_a, item_b, leaves_b, meshed):
            cast, i, j = owner[some], item_a[some], item_b[some]
            X, Y = np.ascontiguousarray(X_WA[cast]), np.ascontiguousarray(X_WB[cast])
            if meshed[0][i[0]] or meshed[1][j[0]]:
                of_a, of_b = (
                    [leaves[k] for k in (items if (items != items[0]).any() else items[:1]).tolist()]
                    for leaves, items in ((leaves_a, i), (leaves_b, j))
                )
                # Chosen by the shapes alone: a cast has the same bits whatever else is in the batch.
                into_a = meshed[0][i[0]] and meshed[1][j[0]] and len(leaves_a) < len(leaves_b)
                got = cast_leaves(of_a, of_b, X, Y, Casts(cast, vectors[cast], limits[cast], best), into_a=into_a)
            else:
                got = _cast_convex(leaves_a[i[0]], leaves_b[j[0]], X, Y, vectors[cast], limits[cast])
            rows.append(got._replace(owner=cast[got.owner], item_a=i[got.owner], item_b=j[got.owner]))
        return joined(rows)

    n, n_pairs, starts = len(limits), len(leaves_a) * len(leaves_b), Starts(A, B, (leaves_a, leaves_b), X_WA, X_WB)
    if n_pairs <= MAX_ASKED:
        rows = [starts.of_casts(np.arange(n))]
        ahead = np.flatnonzero(starts.are_apart)
        owner, pair = np.repeat(ahead, n_pairs), np.tile(np.arange(n_pairs), len(ahead))
        rows.append(answer(owner, *np.divmod(pair, len(leaves_b)), limits))
    else:
        rows = list(_rows_of_unions(A, B, X_WA, X_WB, vectors, limits, starts, answer))
    return first_contacts(joined(rows), n)


def _rows_of_unions(A: Shape, B: Shape, X_WA, X_WB, vectors, limits, starts: Starts, answer) -> Iterator[PairRows]:
    """Rows of pairs of leaves that may be first contacts of casts, in the order of sets around them."""
    of_a, of_b = _boxes_at(A), _boxes_at(B)
    at_once = max(1, _POSED_AT_ONCE // (len(compound_parts(A).parts) + len(compound_parts(B).parts)))
    for first in range(0, len(limits), at_once):
        some = np.arange(first, min(first + at_once, len(limits)))
        sets = posed_sides(A, B, X_WA[some], X_WB[some], len(some), bounding_parts_of)

        def earliest(owner, item_a, item_b, some=some, sets=sets) -> np.ndarray:
            pairs = sets.pairs(np.searchsorted(some, owner), item_a, item_b)
            return earliest_contacts(pairs, vectors[some], limits[some])

        yield from rows_within_sets(
            some, lambda k: (of_a(X_WA[k]), of_b(X_WB[k])), vectors, limits, earliest, starts.of_pairs, answer,
            _PARTS_TOGETHER,
        )


def _answered_together(item_a, item_b, leaves_b: list[Leaf], meshed) -> Iterator[np.ndarray]:
    """Numbers of pairs of leaves for a call: a mesh and all convex sets cast at the mesh, or the mesh cast at them; a
    mesh of the union with fewer leaves and all meshes of the other union; else two leaves."""
    mesh_a, mesh_b = meshed[0][item_a], meshed[1][item_b]
    is_plane = np.array([not leaf.shape.meshed and convex_set_of(leaf.shape).kind == HALFSPACE for leaf in leaves_b])
    by_b = len(meshed[0]) >= len(meshed[1])
    key_a = np.where(mesh_b & ~mesh_a, -1, np.where(mesh_a & mesh_b & by_b, -2, item_a))
    key_b = np.where(mesh_a & ~mesh_b & ~is_plane[item_b], -1, np.where(mesh_a & mesh_b & (not by_b), -2, item_b))
    keys = (key_a + 2) * (len(leaves_b) + 2) + key_b + 2
    for key in np.unique(keys).tolist():
        yield np.flatnonzero(keys == key)


def _boxes_at(shape: Shape) -> Callable[[np.ndarray], np.ndarray]:
    """The boxes (leaves, 6) of a union's leaves by its pose (4, 4), made once of a body that stands still."""
    parts = compound_parts(shape)

    @lru_cache(maxsize=1)
    def boxes(pose: bytes) -> np.ndarray:
        return parts.boxes(np.frombuffer(pose).reshape(1, 4, 4))[0]

    return lambda X: boxes(X.tobytes())


def _cast_convex(leaf_a: Leaf, leaf_b: Leaf, X_WA, X_WB, vectors: np.ndarray, limits: np.ndarray) -> PairRows:
    """Rows of two convex items of unions."""
    A, B = Compound([(leaf_a.shape, leaf_a.X)]), Compound([(leaf_b.shape, leaf_b.X)])
    pairs = posed_sides(A, B, X_WA, X_WB, len(limits)).all_pairs(np.arange(len(limits)))
    return answer_questions(pairs, vectors, limits)
