"""Batches: from shapes and poses as checked by `query.py` to answers, in as many threads as asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from collide.base.threads import check_threads, pieces_of, share, share_if_it_helps
from collide.errors import InvalidPose
from collide.lowering.shape_set_tables import tables_of
from collide.narrowphase.convex_batches import Question, answer_parts
from collide.narrowphase.dispatch_functions import OF_ONE_PAIR, Answer, answer_of
from collide.narrowphase.prepared_pairs import keep_prepared, prepared_pair, single_calls_are_safe
from collide.results import PAIR_DTYPE
from collide.shapes.shape import Shape
from collide.shapes.shape_set import Picked, ShapeSet
from collide.transforms import as_poses

#: A thread is handed at least so many poses of convex pairs: below, handing over takes longer than answering.
_MIN_POSES_PER_THREAD = 2000


def length_of(A, B, X_WA, X_WB) -> int:
    """How many pairs a question of checked lengths has."""
    lengths = [len(X_WA), len(X_WB), *(len(S) for S in (A, B) if not isinstance(S, Shape))]
    return max(lengths) if min(lengths) else 0


def answer_batch(
    A,
    B,
    X_WA: np.ndarray,
    X_WB: np.ndarray,
    question: Question,
    threads: int = 1,
    *,
    finish: Callable[[np.ndarray], None] | None = None,
    pose_copies: Sequence[np.ndarray] = (),
) -> np.ndarray:
    """bool[n], or a row a pose.

    A, B : shapes, or sequences of n shapes.   X_WA, X_WB : (n, 4, 4) or (1, 4, 4).
    threads : at most so many answer; the answers are the same bits.
    finish : called with the rows of each piece when they are done, by the thread that did them.
    pose_copies : two arrays like X_WA and X_WB, to become copies of them.
    """
    threads, n = check_threads(threads), length_of(A, B, X_WA, X_WB)
    out = np.zeros(n, dtype=bool if question.boolean else PAIR_DTYPE)
    for X, copy in zip((X_WA, X_WB), pose_copies):
        if len(X) == 1:
            copy[:] = X
    if n == 0:
        return out
    answer = None
    if isinstance(A, Shape) and isinstance(B, Shape):
        answer = answer_of(A, B)
    else:
        A, B = of_one_set(A, B, n)

    def work(piece: slice | np.ndarray) -> None:
        """Answer the poses of these numbers."""
        A_k, B_k = (S if isinstance(S, Shape) else S[piece] for S in (A, B))
        X_WAk, X_WBk = (X if len(X) == 1 else X[piece] for X in (X_WA, X_WB))
        for X, copy in zip((X_WAk, X_WBk), pose_copies):
            if len(copy) > 1:
                copy[piece] = X
        rows = out[piece] if isinstance(piece, slice) else np.zeros_like(out, shape=len(piece))
        piece_question = question if question.axes is None else question._replace(axes=question.axes[piece])
        try:
            _answer_into(rows, A_k, B_k, X_WAk, X_WBk, piece_question, answer)
        except InvalidPose:
            _refuse_poses(X_WA, X_WB, question.check)  # named by its place in the whole batch
            raise
        if finish is not None:
            finish(rows)
        if not isinstance(piece, slice):
            out[piece] = rows

    if not (_of_one_pair(A, B).any() if answer is None else answer.of_one_pair):
        threads = min(threads, n // _MIN_POSES_PER_THREAD)
        if threads < 2:
            work(slice(0, n))
        else:
            share(pieces_of(n, threads, _MIN_POSES_PER_THREAD), work, threads)
    elif threads < 2:
        work(slice(0, n))
    else:  # from 0.2 µs to 1 ms a pose, with Python's lock or without
        order = _pairs_together(A, B)
        share_if_it_helps(n, work if order is None else lambda piece: work(order[piece]), threads)
    return out


def prepare_pair(A, B) -> bool:
    """Make two shapes ready for single calls of `collide` and `distance`, and keep the pair with A: whether this has
    been done now. Never for sequences, and for shapes whose single calls are batches."""
    if not (isinstance(A, Shape) and isinstance(B, Shape) and single_calls_are_safe()):
        return False
    known = prepared_pair(A, B)
    if known is not None and (known.collide or (known.table and known.header is None)):
        return False
    pair = answer_of(A, B).prepare(A, B)
    if pair is None:
        return False
    if known is not None:  # asked for contacts, casts or impacts alone
        known.take(pair)
        return True
    keep_prepared(A, B, pair)
    return prepared_pair(A, B) is pair


def _of_one_pair(A: Picked, B: Picked) -> np.ndarray:
    kinds = tables_of(A.shape_set).kinds
    return OF_ONE_PAIR[kinds[A.rows], kinds[B.rows]]


def _pairs_together(A, B) -> np.ndarray | None:
    """(n,) numbers of the poses, grouped by pairs of shapes; ``None`` where all poses are of the same pair."""
    return np.argsort(A.rows * len(A.shape_set) + B.rows, kind="stable") if isinstance(A, Picked) else None


def of_one_set(A, B, n: int):
    """Shapes, on either side or both in sequences, as picked from a single set."""
    if isinstance(A, Picked) and isinstance(B, Picked) and A.shape_set is B.shape_set:
        return A, B
    shapes, rows_a, rows_b = distinct_shapes(A, B, n)
    shape_set = ShapeSet(shapes)
    return Picked(shape_set, rows_a), Picked(shape_set, rows_b)


def distinct_shapes(A, B, n: int) -> tuple[list[Shape], np.ndarray, np.ndarray]:
    """(shapes, each a single time; (n,) rows of A among the shapes, and of B).   A, B : shapes, or sequences of n."""
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

    rows_a, rows_b = rows(A), rows(B)
    return shapes, rows_a, rows_b


def _refuse_poses(X_WA, X_WB, check: bool) -> None:
    as_poses(X_WA, "X_WA", check=check)
    as_poses(X_WB, "X_WB", check=check)


def _answer_into(out: np.ndarray, A, B, X_WA, X_WB, question: Question, answer: Answer | None) -> None:
    """Answer a batch in this thread into ``out``, zeroed: bool[n] or rows.

    answer : of two shapes; None of shapes picked from a set.
    """
    if answer is None and _of_one_pair(A, B).any():
        _refuse_poses(X_WA, X_WB, question.check)
        _answer_pair_by_pair(out, A, B, X_WA, X_WB, question._replace(check=False))
        return
    batch = answer_parts if answer is None else answer.batch
    if not batch(out, A, B, X_WA, X_WB, question):
        _refuse_poses(X_WA, X_WB, question.check)
        out.fill(0)  # it is a pose after all, on the brink of the tolerance
        if not batch(out, A, B, X_WA, X_WB, question._replace(check=False)):
            raise AssertionError("a pose that is none")


def _answer_pair_by_pair(out: np.ndarray, A: Picked, B: Picked, X_WA, X_WB, question: Question) -> None:
    """The same for shapes with meshes among them, checked poses: a batch for each distinct pair in need of its own."""
    X_WA, X_WB = (np.broadcast_to(X, (len(out), 4, 4)) for X in (X_WA, X_WB))
    keys = np.where(_of_one_pair(A, B), A.rows * len(A.shape_set) + B.rows, -1)
    for key in np.unique(keys).tolist():
        some = np.flatnonzero(keys == key)
        rows = np.zeros_like(out, shape=len(some))
        pair = (A[some], B[some]) if key < 0 else (A[int(some[0])], B[int(some[0])])
        _answer_into(rows, *pair, X_WA[some], X_WB[some], question, None if key < 0 else answer_of(*pair))
        out[some] = rows
