"""Batches: from shapes and poses as checked by `query.py` to rows, in as many threads as asked for.

Pairs of convex sets in their own frames, by far the most, go through `narrowphase/pose_batches.py` as they are;
unions are taken apart into pairs of parts and put together again by `unions.py`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from collide.errors import InvalidPose
from collide.lowering.compound_table import UnionTable
from collide.lowering.shape_table import ShapeTable
from collide.narrowphase import convex_queries as run
from collide.narrowphase.composite.composite import UnionPair, run_unions
from collide.results import PAIR_DTYPE
from collide.shapes.shape import Shape, is_plain
from collide.shapes.shape_set import Picked, ShapeSet
from collide.threads import check_threads, pieces_of, share, share_if_it_helps
from collide.transforms import as_poses


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

    if not (_any_meshed(A) or _any_meshed(B)):
        workers = min(workers, n // _FEWEST)
        if workers < 2:
            work(slice(0, n))
        else:
            share(pieces_of(n, workers, _FEWEST), work, workers)
    elif workers < 2:
        work(slice(0, n))
    else:  # from 1 µs to 1 ms a pose, with Python's lock or without
        order = _together(A, B)
        share_if_it_helps(n, work if order is None else lambda part: work(order[part]), workers)
    return out


#: A thread is handed at least so many poses: below, handing over takes longer than answering.
_FEWEST = 2000


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
    wanted = {"boolean": boolean, "limit": limit, "depths": depths}
    if _all_plain(A) and _all_plain(B) and not run.distrust_doubles:
        answer = partial(run.run_poses, out, *_table(A, B), X_WA, X_WB, axes=axes, **wanted)
    elif not (_any_meshed(A) or _any_meshed(B)):
        answer = partial(run_unions, out, *_union_table(A, B), X_WA, X_WB, **wanted)
    else:
        if isinstance(A, Picked):
            _refuse_poses(X_WA, X_WB, check)
            X_WA, X_WB = (np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4))) for X in (X_WA, X_WB))
            _pair_by_pair(out, A, B, X_WA, X_WB, **wanted)
        else:
            _meshed(out, A, B, X_WA, X_WB, check=check, **wanted)
        return
    if not answer(check=check):
        _refuse_poses(X_WA, X_WB, check)
        out.fill(0)  # it is a pose after all, on the brink of the tolerance
        if not answer(check=False):
            raise AssertionError("a pose that is none")


def _pair_by_pair(out: np.ndarray, A: Picked, B: Picked, X_WA, X_WB, **wanted) -> None:
    """The same for shapes of which some are meshes, checked poses (n, 4, 4): each distinct pair with a mesh is one batch."""
    shapes = A.shape_set
    keys = np.where(shapes.meshed[A.rows] | shapes.meshed[B.rows], A.rows * len(shapes) + B.rows, -1)
    for key in np.unique(keys).tolist():
        some = np.flatnonzero(keys == key)
        rows = np.zeros_like(out, shape=len(some))
        if key < 0:
            _answer_into(rows, A[some], B[some], X_WA[some], X_WB[some], check=False, **wanted)
        else:
            one, other = shapes.shapes[key // len(shapes)], shapes.shapes[key % len(shapes)]
            _meshed(rows, one, other, X_WA[some], X_WB[some], **wanted)
        out[some] = rows


def _meshed(
    rows: np.ndarray, A: Shape, B: Shape, X_WA, X_WB, *, boolean: bool, limit: float, depths: bool, check: bool = False
) -> None:
    """Rows of two bodies of which one has a mesh, at poses (n, 4, 4) or (1, 4, 4)."""
    from collide.narrowphase.facets.mesh_pairs import pair_hits, pair_rows

    if boolean:
        rows[:] = pair_hits(A, B, X_WA, X_WB, check=check)
    else:
        pair_rows(A, B, X_WA, X_WB, limit=limit, depths=depths, check=check, out=rows)


def _any_meshed(side) -> bool:
    return bool(side.shape_set.meshed[side.rows].any()) if isinstance(side, Picked) else side.meshed


def _all_plain(side) -> bool:
    return bool(side.shape_set.plain[side.rows].all()) if isinstance(side, Picked) else is_plain(side)


def _table(A, B) -> tuple[ShapeTable, np.ndarray | None]:
    """(table, rows of it pose by pose); None for rows 0 and 1 throughout."""
    if isinstance(A, Picked):
        return A.shape_set.table, np.stack([A.rows, B.rows], axis=1)
    prepared = getattr(A, "_prepared", {}).get(getattr(B, "_serial", None))
    return (prepared.table if prepared else ShapeTable([A.parts()[0][0], B.parts()[0][0]])), None


def _union_table(A, B) -> tuple[UnionTable, np.ndarray | None]:
    """(table, bodies of it pose by pose); None for bodies 0 and 1 throughout."""
    if isinstance(A, Picked):
        return A.shape_set.unions, np.stack([A.rows, B.rows], axis=1)
    prepared = getattr(A, "_prepared", {}).get(getattr(B, "_serial", None))
    return (prepared.unions if isinstance(prepared, UnionPair) else UnionTable([A.laid_out(), B.laid_out()])), None
