"""Contacts of two convex sets, or of many pairs of them, from Python: rows of `distance`, and what is made of them."""

from __future__ import annotations

from threading import local
from typing import Any, NamedTuple

import numpy as np

from collide.batches import answer_batch, length_of
from collide.contact.box_box import box_rows
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.contact.convex_manifolds import (
    ARE_BOXES,
    HEADER,
    MARGIN,
    MAX_CONTACTS,
    PAIRS_DONE,
    ROWS_DONE,
    convex_manifolds,
    max_corners,
    workspace_doubles,
    workspace_integers,
)
from collide.contact.single_contact_call import SINGLE_HEADER, contacts_single
from collide.contact.support_face import ROUND
from collide.errors import InvalidPose, UnsupportedQuery
from collide.kernels import address_of
from collide.kernels.prepared import prepared_row
from collide.lowering.hull_faces import HullFaceTable, face_table_of
from collide.lowering.packed_convex import POINTS
from collide.lowering.shape_table import KIND, PARAMS, POSE, ShapeTable
from collide.narrowphase.convex_batches import Question, prepare_sets, shape_table
from collide.narrowphase.convex_kernel_calls import SinglePair
from collide.narrowphase.prepared_pairs import keep_prepared, prepared_pair, single_calls_are_safe
from collide.results import PAIR_DTYPE, UNDECIDED
from collide.shapes.primitives import Box
from collide.shapes.shape import Shape
from collide.threads import pieces_of, share
from collide.transforms import as_poses

#: Pairs that go through together: their rows stay in the cache, and what Python does between blocks is little.
_BLOCK = 2048
#: The least that a thread is handed.
_PIECE = 512
#: Contacts that there is room for, a pair, before more is asked for.
_USUAL = 8


def convex_contacts(
    A, B, X_WA: np.ndarray, X_WB: np.ndarray, margin: float, max_contacts: int, *, slack: np.ndarray | None = None,
    check: bool = False, threads: int = 1,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """(rows, ends): contacts of pairs of single convex sets, pair after pair, and where those of each end.

    A, B : shapes, or shapes `Picked` from one set pose by pose.   X_WA, X_WB : C-contiguous (n, 4, 4), or (1, 4, 4) for
    a pose that goes with all of the other's.   slack : (n,) by how much rounding may have moved the bodies of a pair
    towards each other [m]: the margin is larger by that.   check : refuse matrices that are no rotation.
    Raises InvalidPose, UnsupportedQuery.
    """
    limit = margin if slack is None else margin + float(slack.max(initial=0.0))
    asked = _Asked(A, B, X_WA, X_WB, slack, margin, max_contacts, Question(False, limit, check=check))
    n = length_of(A, B, X_WA, X_WB)
    threads = min(threads, n // _PIECE)
    try:
        if threads < 2:
            return _contacts_of(asked, slice(0, n))
        pieces = pieces_of(n, threads, _PIECE)
        answered: list = [None] * len(pieces)

        def work(number: int) -> None:
            answered[number] = _contacts_of(asked, pieces[number])

        share(range(len(pieces)), work, threads)
    except InvalidPose:
        for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")):
            as_poses(X, name, check=check)  # named by its place in the whole batch
        raise
    counts = [np.diff(ends, prepend=0) for _, ends in answered]
    return np.concatenate([rows for rows, _ in answered]), np.cumsum(np.concatenate(counts))


class _Asked(NamedTuple):
    """What `convex_contacts` is asked."""

    A: Any
    B: Any
    X_WA: np.ndarray
    X_WB: np.ndarray
    slack: np.ndarray | None
    margin: float
    max_contacts: int
    question: Question


def _contacts_of(asked: _Asked, piece: slice) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) of the pairs of a piece, in this thread: a block of rows of `distance` at a time."""
    n = piece.stop - piece.start
    header = np.zeros(HEADER, dtype=np.int64)
    ends = np.empty(n, dtype=np.int64)
    out = np.empty(0, dtype=CONTACT_DTYPE)
    for begin in range(0, n, _BLOCK):
        pairs = slice(piece.start + begin, min(piece.start + begin + _BLOCK, piece.stop))
        A, B = (S if isinstance(S, Shape) else S[pairs] for S in (asked.A, asked.B))
        X_WA, X_WB = (X if len(X) == 1 else X[pairs] for X in (asked.X_WA, asked.X_WB))
        slack = None if asked.slack is None else asked.slack[pairs]
        rows = _rows(asked, A, B, X_WA, X_WB)
        table, which = shape_table(A, B)
        faces = face_table_of(table, ROUND)
        header[:PAIRS_DONE] = _addresses(table, faces, _of_thread.space.fit(faces.largest))
        header[PAIRS_DONE] = 0
        max_rows = min(asked.max_contacts, max_corners(faces.largest))
        out = _with_space(out, int(header[ROWS_DONE]), min(max_rows, _USUAL) * (n - begin) + max_rows)
        while convex_manifolds(
            address_of(header), 0 if which is None else address_of(which), address_of(X_WA), 16 * (len(X_WA) > 1),
            address_of(X_WB), 16 * (len(X_WB) > 1), 0 if slack is None else address_of(slack), address_of(rows),
            len(rows), asked.margin, asked.max_contacts, address_of(out), len(out), address_of(ends) + 8 * begin,
        ):  # fmt: skip
            out = _with_space(out, int(header[ROWS_DONE]), len(out) + max_rows)
    n_rows = int(header[ROWS_DONE])
    return out[:n_rows] if 2 * n_rows >= len(out) else out[:n_rows].copy(), ends


def _with_space(rows: np.ndarray, n_rows: int, n_more: int) -> np.ndarray:
    """The first rows, and space for so many more behind them, in the same memory where that is large enough."""
    if n_rows + n_more <= len(rows):
        return rows
    larger = np.empty(n_rows + n_more, dtype=CONTACT_DTYPE)
    larger[:n_rows] = rows[:n_rows]
    return larger


def _rows(asked: _Asked, A, B, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """Rows of `distance`; of pairs of boxes as good as contacts need them, where a face tells (`box_box.py`)."""
    table, which = shape_table(A, B)
    is_box = _boxes(table)
    both = is_box[which].all(axis=1) if which is not None else np.array([is_box.all()])
    if not both.any():
        return _general_rows(asked.question, A, B, X_WA, X_WB)
    n = length_of(A, B, X_WA, X_WB)
    rows = np.zeros(n, dtype=PAIR_DTYPE)
    n_open = box_rows(
        *table.addresses, 0 if which is None else address_of(which), address_of(X_WA), 16 * (len(X_WA) > 1),
        address_of(X_WB), 16 * (len(X_WB) > 1), n, asked.question.limit, address_of(rows),
    )  # fmt: skip
    if n_open or not both.all():
        remaining = np.flatnonzero((rows["how"] == UNDECIDED) | ~both)
        A, B = (S if isinstance(S, Shape) else S[remaining] for S in (A, B))
        X_WA, X_WB = (X if len(X) == 1 else np.ascontiguousarray(X[remaining]) for X in (X_WA, X_WB))
        rows[remaining] = _general_rows(asked.question, A, B, X_WA, X_WB)[: len(remaining)]
    return rows


def _boxes(table: ShapeTable) -> np.ndarray:
    """(rows,) bool: which of the sets are boxes."""
    return (table.ints[:, KIND] == POINTS) & (table.numbers[:, PARAMS] > 0.0)


def _general_rows(question: Question, A, B, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    rows = answer_batch(A, B, X_WA, X_WB, question, prepare=True)
    _refuse_unbounded(rows, A, B)
    return rows


def _refuse_unbounded(rows: np.ndarray, A, B) -> None:
    unbounded = np.isneginf(rows["distance"])
    if unbounded.any():
        k = int(np.argmax(unbounded))
        names = [type(S if isinstance(S, Shape) else S[k]).__name__ for S in (A, B)]
        raise UnsupportedQuery(
            f"contacts of {names[0]} and {names[1]}: their overlap has no end, so no normal tells the way out; "
            "collide() still answers"
        )


def _addresses(table: ShapeTable, faces: HullFaceTable, space: _Workspace) -> tuple[int, ...]:
    """The header of `convex_manifolds` up to what a call has done."""
    return (
        *table.addresses, address_of(faces.ints), address_of(space.poses), address_of(space.shape_of),
        address_of(space.doubles), address_of(space.integers), faces.largest,
    )  # fmt: skip


def prepare_contacts(A, B) -> None:
    """Have two shapes that are prepared for single calls prepared for contacts as well; boxes, which `_rows` answers by
    itself, for both."""
    if isinstance(A, Shape) and isinstance(B, Shape):
        pair = prepared_pair(A, B)
        if pair is None and isinstance(A, Box) and isinstance(B, Box) and single_calls_are_safe():
            pair = prepare_sets(A, B)
            keep_prepared(A, B, pair)
        if isinstance(pair, SinglePair) and pair.of_contacts is None:
            pair.of_contacts = SingleContacts(pair)


class SingleContacts:
    """Two convex sets prepared for `contacts` of one pair of poses at a time.

    ask : a built-in function of two poses, rows and a flag; None where it leaves the answer to the long way.
    """

    def __init__(self, pair: SinglePair):
        self._pair = pair  # held, since kernels use its buffers
        table, header = pair.table, pair.header
        self._faces = face_table_of(table, ROUND)
        self._space = _Workspace()
        self._space.fit(self._faces.largest)
        self.max_rows = max_corners(self._faces.largest)
        self._header = np.zeros(SINGLE_HEADER, dtype=np.int64)
        self._header[: len(header)] = header
        self._of_manifold = self._header[len(header) :]
        self._of_manifold[:PAIRS_DONE] = _addresses(table, self._faces, self._space)
        self._of_manifold[ARE_BOXES] = _boxes(table).all()
        self._margin = self._of_manifold[MARGIN : MARGIN + 1].view(np.float64)
        self._ask = prepared_row(contacts_single, self._header)

    def contacts(self, X_WA, X_WB, margin: float, max_contacts: int) -> np.ndarray | None:
        """Rows; None where more than doubles, or an error, is called for."""
        rows = np.empty(min(max_contacts, self.max_rows), dtype=CONTACT_DTYPE)
        self._margin[0], self._of_manifold[MAX_CONTACTS] = margin, max_contacts
        if self._ask(X_WA, X_WB, rows, False) is None:
            return None
        return rows[: self._of_manifold[ROWS_DONE]]


class _Workspace:
    """Scratch memory of the kernel."""

    def __init__(self) -> None:
        self.largest = 0
        self.doubles, self.integers = np.zeros(0), np.zeros(0, dtype=np.int64)
        self.poses, self.shape_of = np.zeros((2, POSE)), np.zeros(2, dtype=np.int64)

    def fit(self, largest: int) -> _Workspace:
        """Itself, with space for faces of so many corners."""
        self.shape_of[:] = 0, 1
        if largest > self.largest:
            self.largest = largest
            self.doubles = np.zeros(workspace_doubles(largest))
            self.integers = np.zeros(workspace_integers(largest), dtype=np.int64)
        return self


class _OfThread(local):
    """The workspace of one thread, made when the thread first asks."""

    def __init__(self) -> None:
        self.space = _Workspace()


_of_thread = _OfThread()
