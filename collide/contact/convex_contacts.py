"""Contacts of two convex sets, or of many pairs of them, from Python: rows of `distance`, and what is made of them."""

from __future__ import annotations

from threading import local
from typing import NamedTuple

import numpy as np

from collide.base.threads import answers_in_order, pieces_of
from collide.contact.contact_blocks import (
    BAD_POSE,
    BLOCK_HEADER,
    CAPACITY,
    CHECK,
    LIMIT,
    N_GENERAL,
    OPEN,
    OUT_AT,
    PLACES_AT,
    ROWS_FULL,
    UNBOUNDED,
    WHICH_AT,
    contacts_of_pairs,
)
from collide.contact.contact_rows import CONTACT_DTYPE, Slack, joined_rows
from collide.contact.convex_manifolds import (
    MARGIN,
    MAX_CONTACTS,
    PAIRS_DONE,
    POSES_AT,
    ROWS_DONE,
    max_corners,
    workspace_doubles,
    workspace_integers,
)
from collide.contact.single_contact_call import SINGLE_HEADER
from collide.contact.support_face import ROUND
from collide.errors import InvalidPose, UnsupportedQuery
from collide.kernels import address_of
from collide.lowering.hull_faces import HullFaceTable, face_table_of
from collide.lowering.hull_polygons import faces_memory
from collide.lowering.packed_convex import BLOCK as BLOCK_OF_POINTS
from collide.lowering.shape_table import POSE, ShapeTable
from collide.narrowphase.convex_batches import shape_table
from collide.narrowphase.convex_kernel_calls import block_workspace
from collide.narrowphase.pose_batches import BLOCK
from collide.narrowphase.pose_batches import HEADER as HEADER_OF_POSES
from collide.transforms import as_poses

#: The least that a thread is handed.
_PIECE = 512
#: Contacts a pair that there is room for at first, and of so many pairs: how many they have tells about the others.
_USUAL, _FIRST = 8, 256


class ConvexPairs(NamedTuple):
    """n pairs of single convex sets at their poses.

    table : of all sets.   which : (n, 2) rows of the table; without, rows 0 and 1 throughout.
    X_WA, X_WB : C-contiguous matrices (n, 4, 4), or (1, 4, 4) for a single pose.
    of_pair : (n, 2) numbers of matrices, where ``X_WA`` and ``X_WB`` are the same array.
    ids : an id for each matrix, for columns a and b; None for 0 and 1.
    slack : by how much rounding may have moved the bodies of a pair towards each other.
    """

    table: ShapeTable
    which: np.ndarray | None
    X_WA: np.ndarray
    X_WB: np.ndarray
    of_pair: np.ndarray | None = None
    ids: np.ndarray | None = None
    slack: Slack | None = None

    def __len__(self) -> int:  # type: ignore[override]
        if self.of_pair is not None:
            return len(self.of_pair)
        lengths = [len(self.X_WA), len(self.X_WB), *([] if self.which is None else [len(self.which)])]
        return max(lengths) if min(lengths) else 0

    def take(self, piece: slice) -> ConvexPairs:
        slack = None if self.slack is None else self.slack.take(piece)
        which, of_pair = (
            None if column is None else column[piece] for column in (self.which, self.of_pair)
        )
        X_WA, X_WB = (X if len(X) == 1 or of_pair is not None else X[piece] for X in (self.X_WA, self.X_WB))
        return ConvexPairs(self.table, which, X_WA, X_WB, of_pair, self.ids, slack)


def convex_contacts(
    A, B, X_WA: np.ndarray, X_WB: np.ndarray, margin: float, max_contacts: int, *, slack: Slack | None = None,
    check: bool = False, threads: int = 1,
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends): contacts of pairs of single convex sets, pair after pair, and where the contacts of each pair end.

    A, B : shapes, or shapes `Picked` from a set pose by pose.   X_WA, X_WB : C-contiguous (n, 4, 4), or (1, 4, 4) for a
    single pose.   slack : the margin of a pair is larger by its slack.   check : refuse matrices other than rotations.
    Raises InvalidPose, UnsupportedQuery.
    """
    table, which = shape_table(A, B)
    pairs = ConvexPairs(table, which, X_WA, X_WB, slack=slack)
    try:
        return contacts_of(pairs, margin, max_contacts, check=check, threads=threads)
    except InvalidPose:
        for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")):
            as_poses(X, name, check=check)  # named by its place in the whole batch
        return contacts_of(pairs, margin, max_contacts, check=False, threads=threads)  # on the brink of the tolerance


def contacts_of(
    pairs: ConvexPairs, margin: float, max_contacts: int, *, check: bool = False, threads: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) as `convex_contacts`. Raises InvalidPose without a name, UnsupportedQuery."""
    limit = margin if pairs.slack is None else margin + pairs.slack.largest
    asked = _Asked(margin, max_contacts, limit, check)
    n = len(pairs)
    threads = min(threads, n // _PIECE)
    if threads < 2:
        return _contacts_of(pairs, asked)
    pieces = pieces_of(n, threads, _PIECE)
    return joined_rows(answers_in_order(pieces, lambda piece: _contacts_of(pairs.take(piece), asked), threads))


class _Asked(NamedTuple):
    """What `contacts_of` is asked, and up to where distances matter to it [m]."""

    margin: float
    max_contacts: int
    limit: float
    check: bool


def _contacts_of(pairs: ConvexPairs, asked: _Asked) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) of pairs, in this thread."""
    n, table = len(pairs), pairs.table
    if n == 0:
        return np.empty(0, dtype=CONTACT_DTYPE), np.empty(0, dtype=np.int64)
    table.build_trees(np.arange(2) if pairs.which is None else pairs.which)
    faces = face_table_of(table, ROUND)
    space, block = _of_thread.space.fit(faces.largest), block_workspace()
    max_rows = min(asked.max_contacts, max_corners(faces.largest))
    ends, out = np.empty(n, dtype=np.int64), np.empty(_USUAL * min(n, _FIRST) + max_rows, dtype=CONTACT_DTYPE)
    places = np.empty(BLOCK, dtype=np.int64)
    header = np.zeros(BLOCK_HEADER, dtype=np.int64)
    header[:HEADER_OF_POSES] = block.header_of(table)
    header[HEADER_OF_POSES : HEADER_OF_POSES + PAIRS_DONE] = manifold_addresses(
        table, faces, space, block.poses.rows, block.shape_of
    )
    header[HEADER_OF_POSES + MAX_CONTACTS] = asked.max_contacts
    header.view(np.float64)[[HEADER_OF_POSES + MARGIN, LIMIT]] = asked.margin, asked.limit
    slacks = None if pairs.slack is None else pairs.slack.each
    header[WHICH_AT : LIMIT] = (
        _address_or_0(pairs.which), address_of(pairs.X_WA), 16 * (len(pairs.X_WA) > 1), address_of(pairs.X_WB),
        16 * (len(pairs.X_WB) > 1), _address_or_0(pairs.of_pair), _address_or_0(pairs.ids), _address_or_0(slacks),
        address_of(out), len(out), address_of(ends),
    )
    header[CHECK], header[PLACES_AT] = asked.check, address_of(places)
    n_done, n_rows = HEADER_OF_POSES + PAIRS_DONE, HEADER_OF_POSES + ROWS_DONE
    while status := contacts_of_pairs(address_of(header), n):
        if status == BAD_POSE:
            raise InvalidPose("a matrix is no pose")
        if status == UNBOUNDED:
            raise UnsupportedQuery(
                "contacts of Halfspace and Halfspace: their overlap has no end, so no normal tells the way out; "
                "collide() still answers"
            )
        if status == ROWS_FULL:
            out = _with_space(out, int(header[n_rows]), int(header[n_done]), n, max_rows)
            header[OUT_AT], header[CAPACITY] = address_of(out), len(out)
        else:
            assert status == OPEN
            block.settle(table, int(header[N_GENERAL]), asked.limit)
    rows = out[: header[n_rows]]
    return rows if 2 * len(rows) >= len(out) else rows.copy(), ends


def _address_or_0(array: np.ndarray | None) -> int:
    return 0 if array is None else address_of(array)


def _with_space(rows: np.ndarray, n_rows: int, n_done: int, n: int, max_rows: int) -> np.ndarray:
    """The first rows, of ``n_done`` of n pairs, with space for as many rows a pair of all others."""
    share = 1.125 * n / max(n_done, 1)
    larger = np.empty(int(max(share, 1.5) * n_rows) + 2 * max_rows, dtype=CONTACT_DTYPE)
    words = CONTACT_DTYPE.itemsize // 8  # numpy copies records field by field
    larger.view(np.int64)[: words * n_rows] = rows.view(np.int64)[: words * n_rows]
    return larger


def manifold_addresses(
    table: ShapeTable, faces: HullFaceTable, space: ManifoldSpace, poses: np.ndarray, shape_of: np.ndarray
) -> tuple[int, ...]:
    """The header of `convex_manifolds` up to what a call has done."""
    return (
        *table.addresses, address_of(faces.ints), address_of(poses), address_of(shape_of),
        address_of(space.doubles), address_of(space.integers), faces.largest,
    )


class ManifoldSpace:
    """Scratch memory of the kernel."""

    def __init__(self) -> None:
        self.largest = 0
        self.doubles, self.integers = np.zeros(0), np.zeros(0, dtype=np.int64)
        self.poses, self.shape_of = np.zeros((2, POSE)), np.zeros(2, dtype=np.int64)
        self.header = np.zeros(SINGLE_HEADER, dtype=np.int64)
        self.memory = np.empty(3 * BLOCK_OF_POINTS + faces_memory(BLOCK_OF_POINTS) // 8, dtype=np.int64)

    def fit(self, largest: int) -> ManifoldSpace:
        """Itself, with space for faces of so many corners."""
        self.shape_of[:] = 0, 1
        if largest > self.largest:
            self.largest = largest
            self.doubles = np.zeros(workspace_doubles(largest))
            self.integers = np.zeros(workspace_integers(largest), dtype=np.int64)
            self.rows = np.zeros(max_corners(largest), dtype=CONTACT_DTYPE)
            self.header[HEADER_OF_POSES + POSES_AT : HEADER_OF_POSES + PAIRS_DONE] = (
                address_of(self.poses), address_of(self.shape_of), address_of(self.doubles), address_of(self.integers),
                largest,
            )
            #: Used by kernels of pairs, whatever becomes of the workspace: a larger one is of other arrays.
            self.buffers = self.doubles, self.integers, self.poses, self.shape_of
        return self


class _OfThread(local):
    """The workspace of one thread, made when the thread first asks."""

    def __init__(self) -> None:
        self.space = ManifoldSpace()


_of_thread = _OfThread()
