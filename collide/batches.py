"""Batches: from shapes and poses as checked by `query.py` to rows, in as many threads as asked for.

Pairs of convex sets in their own frames, by far the most, go through `narrowphase/poses.py` as they are;
unions are taken apart into pairs of parts and put together again by `unions.py`.
"""

from __future__ import annotations

import os
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache

import numpy as np

from collide import reading
from collide.errors import InvalidPose
from collide.geometry.packing import PackedConvex
from collide.geometry.tables import ShapeTable, pose_table
from collide.narrowphase import run
from collide.results import PAIR_DTYPE
from collide.shapes.base import Shape, is_plain
from collide.shapes.shape_set import Picked
from collide.transforms import as_poses
from collide.unions import Union, combine


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
    n = length_of(A, B, X_WA, X_WB)
    out = np.zeros(n, dtype=bool if boolean else PAIR_DTYPE)
    workers, fewest = reading.whole("threads", threads, 1), _FEWEST_OF_MESHES if _any_meshed(A) or _any_meshed(B) else _FEWEST_A_THREAD
    workers = min(workers, n // fewest)
    for X, copy in zip((X_WA, X_WB), kept):
        if workers < 2 or len(X) == 1:
            copy[:] = X
    if workers < 2:
        _answer_into(out, A, B, X_WA, X_WB, boolean, limit, check, axes, depths)
        if close is not None:
            close(out)
        return out
    pieces = iter(_pieces(n, workers, fewest))

    def work() -> None:
        for part in pieces:  # a thread takes the next as it becomes free: pairs do not all cost the same
            one, other = (S if isinstance(S, Shape) else S[part] for S in (A, B))
            X_WO, X_WT = (X if len(X) == 1 else X[part] for X in (X_WA, X_WB))
            own = None if axes is None else axes[part]
            for X, copy in zip((X_WO, X_WT), kept):
                if len(copy) > 1:
                    copy[part] = X
            try:
                _answer_into(out[part], one, other, X_WO, X_WT, boolean, limit, check, own, depths)
                if close is not None:
                    close(out[part])
            except InvalidPose:
                _refuse_poses(X_WA, X_WB, check)  # named by its place in the whole batch
                raise

    at_work: list[Future] = []
    try:
        try:
            at_work.extend(_pool(workers - 1).submit(work) for _ in range(workers - 1))
        except RuntimeError:  # no more threads are to be had, or Python is ending: this one does what is left
            pass
        work()
        for one in at_work:
            one.result()
    finally:  # after an error as well nobody writes into the caller's axes any more
        for _ in pieces:
            pass
        wait(at_work)
    return out


def _pieces(n: int, workers: int, fewest: int) -> list[slice]:
    """What is handed out of a batch at a time: ever smaller shares of what is left, none smaller than pays.

    A piece costs some 30 µs beside its answers. Large ones first, there are few; small ones last, no thread waits long for
    the others, though a core may be somebody else's now and then.
    """
    pieces, done = [], 0
    while done < n:
        left = n - done
        most = max(left // fewest, 1)  # so many pieces can be made of it
        share = -(-left // most) if most <= workers else max(left // (2 * workers), fewest)
        pieces.append(slice(done, done + share))
        done += share
    return pieces


#: A thread is handed at least so many poses: below, handing over takes longer than answering.
_FEWEST_A_THREAD = 2000
_FEWEST_OF_MESHES = 16


@lru_cache(maxsize=4)
def _pool(workers: int) -> ThreadPoolExecutor:
    """Threads are kept, and their workspaces with them."""
    return ThreadPoolExecutor(workers, thread_name_prefix="collide")


if hasattr(os, "register_at_fork"):  # a forked child has none of its parent's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


def _refuse_poses(X_WA, X_WB, check: bool) -> None:
    as_poses(X_WA, "X_WA", check=check)
    as_poses(X_WB, "X_WB", check=check)


def _answer_into(out: np.ndarray, A, B, X_WA, X_WB, boolean: bool, limit: float, check: bool, axes=None, depths=True) -> None:
    """Answer a batch in this thread into out, zeroed: bool[n] or rows."""
    n = len(out)
    if n == 0:
        return
    if _all_plain(A) and _all_plain(B) and not run.distrust_doubles:
        table, which = _table(A, B, n)
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


def _pair_by_pair(out: np.ndarray, A, B, X_WA, X_WB, boolean: bool, limit: float, depths: bool) -> None:
    """The same for shapes that differ from pose to pose, poses (n, 4, 4): each distinct pair of them is one batch."""
    n = len(out)
    (shapes_a, which_a), (shapes_b, which_b) = _numbered(A, n), _numbered(B, n)
    plain_a, plain_b = (np.array([is_plain(shape) for shape in shapes], dtype=bool) for shapes in (shapes_a, shapes_b))
    keys = which_a * len(shapes_b) + which_b
    if not run.distrust_doubles:
        plain = plain_a[which_a] & plain_b[which_b]
        some = np.flatnonzero(plain)
        if len(some):
            sides = [shapes_a[k] for k in which_a[some]], [shapes_b[k] for k in which_b[some]]
            rows = np.zeros_like(out, shape=len(some))
            _answer_into(rows, *sides, X_WA[some], X_WB[some], boolean, limit, False, None, depths)
            out[some] = rows
        keys[plain] = -1
    for key in np.unique(keys[keys >= 0]).tolist():
        some = np.flatnonzero(keys == key)
        one, other = shapes_a[key // len(shapes_b)], shapes_b[key % len(shapes_b)]
        out[some] = _parts(one, other, X_WA[some], X_WB[some], boolean=boolean, limit=limit, depths=depths)


def _numbered(side, n: int) -> tuple[list[Shape], np.ndarray]:
    """(distinct shapes, (n,) which of them stands at each pose)."""
    if isinstance(side, Shape):
        return [side], np.zeros(n, dtype=np.int64)
    if isinstance(side, Picked):
        used, which = np.unique(side.rows, return_inverse=True)
        return [side.shape_set.shapes[k] for k in used.tolist()], which.ravel()
    numbers: dict[int, int] = {}
    shapes: list[Shape] = []
    which = np.empty(n, dtype=np.int64)
    for k, shape in enumerate(side):
        if id(shape) not in numbers:  # held by the caller as long as this dictionary lives
            numbers[id(shape)] = len(shapes)
            shapes.append(shape)
        which[k] = numbers[id(shape)]
    return shapes, which


def _any_meshed(side) -> bool:
    if isinstance(side, Picked):
        return side.shape_set.meshed
    return side.meshed if isinstance(side, Shape) else any(shape.meshed for shape in side)


def _all_plain(side) -> bool:
    if isinstance(side, Picked):
        return bool(side.shape_set.plain[side.rows].all())
    return is_plain(side) if isinstance(side, Shape) else all(is_plain(shape) for shape in side)


def _table(A, B, n: int) -> tuple[ShapeTable, np.ndarray | None]:
    """(table, rows of it pose by pose); None for rows 0 and 1 throughout."""
    if isinstance(A, Shape) and isinstance(B, Shape):
        prepared = getattr(A, "_prepared", {}).get(getattr(B, "_serial", None))
        return (prepared.table if prepared else ShapeTable([A.parts()[0][0], B.parts()[0][0]])), None
    if isinstance(A, Picked) and isinstance(B, Picked) and A.shape_set is B.shape_set:
        return A.shape_set.table, np.stack([A.rows, B.rows], axis=1)
    rows: dict[int, int] = {}
    packed: list[PackedConvex] = []

    def row_of(shape: Shape) -> int:
        one = shape.parts()[0][0]
        if id(one) not in rows:  # held by packed as long as this dictionary lives
            rows[id(one)] = len(packed)
            packed.append(one)
        return rows[id(one)]

    which = np.empty((n, 2), dtype=np.int64)
    for column, side in enumerate((A, B)):
        which[:, column] = row_of(side) if isinstance(side, Shape) else [row_of(shape) for shape in side]
    return ShapeTable(packed), which


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
