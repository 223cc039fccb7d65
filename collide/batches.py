"""Batches: from shapes and poses as checked by `query.py` to rows, in as many threads as asked for.

Pairs of convex sets in their own frames, by far the most, go through `narrowphase/poses.py` as they are;
unions are taken apart into pairs of parts and put together again by `unions.py`.
"""

from __future__ import annotations

import numpy as np

from collide.errors import InvalidPose
from collide.geometry.tables import ShapeTable, pose_table
from collide.narrowphase import run
from collide.results import PAIR_DTYPE
from collide.shapes.base import Shape, is_plain
from collide.shapes.shape_set import Picked, ShapeSet
from collide.transforms import as_poses
from collide.unions import Union, combine
from collide.workers import check_threads, pieces_of, share, share_if_it_helps


def length_of(A, B, X_WA, X_WB) -> int:
    """How many pairs a question of checked lengths has."""
    lengths = [len(X_WA), len(X_WB), *(len(S) for S in (A, B) if not isinstance(S, Shape))]
    return max(lengths) if min(lengths) else 0


def ask(
    A, B, X_WA, X_WB, boolean: bool, limit: float, check: bool, threads: int, axes=None, depths=True, close=None, kept=()
) -> np.ndarray:
    """bool[n], or a row a pose, of a batch in at most so many threads.

    depths : of rows: whether it is wanted how deep overlaps are; without it some rows may tell all the same.
    close : called with the rows of each piece when they are done, by the thread that did them.
    kept : two arrays like X_WA and X_WB, to become copies of them.
    """
    workers, n = check_threads(threads), length_of(A, B, X_WA, X_WB)
    out = np.zeros(n, dtype=bool if boolean else PAIR_DTYPE)
    for X, copy in zip((X_WA, X_WB), kept):
        if len(X) == 1:
            copy[:] = X
    if n == 0:
        return out
    A, B = _of_one_set(A, B, n)
    plain = _all_plain(A) and _all_plain(B) and not run.distrust_doubles

    def work(part: slice | np.ndarray) -> None:
        one, other = (S if isinstance(S, Shape) else S[part] for S in (A, B))
        X_WO, X_WT = (X if len(X) == 1 else X[part] for X in (X_WA, X_WB))
        own = None if axes is None else axes[part]
        for X, copy in zip((X_WO, X_WT), kept):
            if len(copy) > 1:
                copy[part] = X
        rows = out[part] if isinstance(part, slice) else np.zeros_like(out, shape=len(part))
        try:
            _answer_into(rows, one, other, X_WO, X_WT, boolean, limit, check, own, depths)
        except InvalidPose:
            _refuse_poses(X_WA, X_WB, check)  # named by its place in the whole batch
            raise
        if close is not None:
            close(rows)
        if not isinstance(part, slice):
            out[part] = rows

    if plain:
        workers = min(workers, n // _FEWEST_PLAIN)
        if workers < 2:
            work(slice(0, n))
        else:
            share(pieces_of(n, workers, _FEWEST_PLAIN), work, workers)
    elif workers < 2:
        work(slice(0, n))
    else:  # from 1 µs to 1 ms a pose, with Python's lock or without
        order = _together(A, B)
        share_if_it_helps(n, work if order is None else lambda part: work(order[part]), workers)
    return out


#: A thread is handed at least so many poses: below, handing over takes longer than answering.
_FEWEST_PLAIN = 2000


def _together(A, B) -> np.ndarray | None:
    """(n,) numbers of the poses, those of the same two shapes one after another, since each pair is asked about at once;
    None where they are all of one pair."""
    return np.argsort(A.rows * len(A.shape_set) + B.rows, kind="stable") if isinstance(A, Picked) else None


def _of_one_set(A, B, n: int):
    """The shapes as they are, or where one side is a sequence, both as picked from one set."""
    if isinstance(A, Shape) and isinstance(B, Shape):
        return A, B
    if isinstance(A, Picked) and isinstance(B, Picked) and A.shape_set is B.shape_set:
        return A, B
    numbers: dict[int, int] = {}
    shapes: list[Shape] = []

    def number(shape: Shape) -> int:
        if id(shape) not in numbers:  # held by the list as long as this dictionary lives
            numbers[id(shape)] = len(shapes)
            shapes.append(shape)
        return numbers[id(shape)]

    def rows(side) -> np.ndarray:
        if isinstance(side, Shape):
            return np.full(n, number(side))
        if isinstance(side, Picked):
            used, which = np.unique(side.rows, return_inverse=True)
            return np.array([number(side.shape_set.shapes[k]) for k in used.tolist()], dtype=np.int64)[which.ravel()]
        return np.fromiter(map(number, side), dtype=np.int64, count=n)

    both = rows(A), rows(B)
    shape_set = ShapeSet(shapes)
    return Picked(shape_set, both[0]), Picked(shape_set, both[1])


def _refuse_poses(X_WA, X_WB, check: bool) -> None:
    as_poses(X_WA, "X_WA", check=check)
    as_poses(X_WB, "X_WB", check=check)


def _answer_into(out: np.ndarray, A, B, X_WA, X_WB, boolean: bool, limit: float, check: bool, axes=None, depths=True) -> None:
    """Answer a batch in this thread into out, zeroed: bool[n] or rows."""
    n = len(out)
    if n == 0:
        return
    if _all_plain(A) and _all_plain(B) and not run.distrust_doubles:
        table, which = _table(A, B)
        wanted = {"boolean": boolean, "limit": limit, "axes": axes, "depths": depths}
        if run.run_poses(out, table, which, X_WA, X_WB, check=check, **wanted):
            return
        _refuse_poses(X_WA, X_WB, check)
        out.fill(0)  # it is a pose after all, on the brink of the tolerance
        if not run.run_poses(out, table, which, X_WA, X_WB, check=False, **wanted):
            raise AssertionError("a pose that is none")
        return
    _refuse_poses(X_WA, X_WB, check)
    X_WA, X_WB = (np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4))) for X in (X_WA, X_WB))
    if isinstance(A, Shape) and isinstance(B, Shape):
        out[:] = _parts(A, B, X_WA, X_WB, boolean=boolean, limit=limit, depths=depths)
    else:
        _pair_by_pair(out, A, B, X_WA, X_WB, boolean, limit, depths)


def _pair_by_pair(out: np.ndarray, A: Picked, B: Picked, X_WA, X_WB, boolean: bool, limit: float, depths: bool) -> None:
    """The same for shapes that differ from pose to pose, poses (n, 4, 4): each distinct pair of them is one batch."""
    shapes = A.shape_set
    keys = A.rows * len(shapes) + B.rows
    if not run.distrust_doubles:
        plain = shapes.plain[A.rows] & shapes.plain[B.rows]
        some = np.flatnonzero(plain)
        if len(some):
            rows = np.zeros_like(out, shape=len(some))
            _answer_into(rows, A[some], B[some], X_WA[some], X_WB[some], boolean, limit, False, None, depths)
            out[some] = rows
        keys[plain] = -1
    for key in np.unique(keys[keys >= 0]).tolist():
        some = np.flatnonzero(keys == key)
        one, other = shapes.shapes[key // len(shapes)], shapes.shapes[key % len(shapes)]
        out[some] = _parts(one, other, X_WA[some], X_WB[some], boolean=boolean, limit=limit, depths=depths)


def _all_plain(side) -> bool:
    return bool(side.shape_set.plain[side.rows].all()) if isinstance(side, Picked) else is_plain(side)


def _table(A, B) -> tuple[ShapeTable, np.ndarray | None]:
    """(table, rows of it pose by pose); None for rows 0 and 1 throughout."""
    if isinstance(A, Picked):
        return A.shape_set.table, np.stack([A.rows, B.rows], axis=1)
    prepared = getattr(A, "_prepared", {}).get(getattr(B, "_serial", None))
    return (prepared.table if prepared else ShapeTable([A.parts()[0][0], B.parts()[0][0]])), None


def _parts(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, boolean: bool, limit: float, depths: bool
) -> np.ndarray:
    """bool[n], or one row a pose: every part of A against every part of B, combined."""
    if A.meshed or B.meshed:
        from collide.meshes.pair_queries import pair_hits, pair_rows

        return pair_hits(A, B, X_WA, X_WB) if boolean else pair_rows(A, B, X_WA, X_WB, limit=limit, depths=depths)
    parts_a, parts_b = A.parts(), B.parts()
    parts = [*parts_a, *parts_b]
    n, many = len(X_WA), len(parts_a) * len(parts_b)
    X_WBs = np.concatenate([np.concatenate([X_WA] * len(parts_a)), np.concatenate([X_WB] * len(parts_b))])
    X_BPs = np.repeat(np.array([X for _, X in parts]), n, axis=0)
    poses = pose_table(X_WBs, X_BPs, np.repeat([packed.reach for packed, _ in parts], n))
    # Part k stands at rows k·n … k·n + n − 1 of the pose table; pairs of one pose stand together.
    which = np.arange(n)[:, None, None] + n * np.zeros((1, len(parts_a), len(parts_b)), dtype=np.int64)
    first = which + n * np.arange(len(parts_a))[None, :, None]
    second = which + n * (len(parts_a) + np.arange(len(parts_b)))[None, None, :]
    table = ShapeTable([packed for packed, _ in parts])
    pairs = np.stack([first.ravel(), second.ravel()], axis=1)
    rows = run.run_pairs(table, poses, np.repeat(np.arange(len(parts)), n), pairs, boolean=boolean, limit=limit)
    if many == 1:
        return rows["hit"] if boolean else rows
    rows["part_a"], rows["part_b"] = first.ravel() // max(n, 1), second.ravel() // max(n, 1) - len(parts_a)

    def sides(k: int) -> tuple[Union, Union]:
        own = poses.rows.reshape(len(parts), n, -1)[:, k]
        return (
            Union([packed for packed, _ in parts_a], own[: len(parts_a)]),
            Union([packed for packed, _ in parts_b], own[len(parts_a) :]),
        )

    if boolean:
        return np.logical_or.reduce(rows["hit"].reshape(n, many), axis=1)
    return combine(rows, np.arange(0, n * many, many), np.ones(n, dtype=bool), sides)
