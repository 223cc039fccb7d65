"""Bodies that are unions of convex parts: questions to the kernels of `narrowphase/composite/composite_poses.py`.

How the bodies' answer is made of the answers of their parts is told in `narrowphase/composite/composite_rows.py`.
"""

from __future__ import annotations

from threading import local

import numpy as np

from collide.base.free_threads import workspace_under_lock
from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_boolean, prepared_row, prepared_within
from collide.lowering.compound_table import BALL_IN_WORLD, CompoundTable, LaidOut
from collide.lowering.shape_table import POSE, TERM_ROW, PoseTable, ShapeTable
from collide.narrowphase import convex_kernel_calls as run
from collide.narrowphase.composite.composite_block import (
    BLOCK,
    HEADER,
    LIST,
    N_ANSWERED,
    N_DONE,
    N_LISTED,
    NEAR,
    SLOTS,
)
from collide.narrowphase.composite.composite_poses import BAD_POSE, answer_compounds
from collide.narrowphase.composite.composite_rows import SCORE, SEPARATING, combine_rows
from collide.narrowphase.composite.single_composite_call import (
    collide_single_compound,
    distance_single_compound,
    within_single_compound,
)
from collide.narrowphase.pair_kernel import DOUBLES, INTEGERS, answer_pairs
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import PAIR_DTYPE

# --- workspaces ---------------------------------------------------------------------------------

#: How far things have come to begin with.
_AT_THE_START = (0,) * (HEADER - N_DONE)
#: Rows of parts of a block of poses, unless one pose takes more.
_CAPACITY = 4096


class _Workspace:
    """Scratch memory of the kernels, for ``capacity`` rows of parts."""

    def __init__(self, capacity: int):
        self.capacity = capacity
        self.poses = PoseTable(np.zeros((2 * BLOCK + capacity, POSE)), np.zeros((2 * BLOCK + capacity, TERM_ROW)))
        self.shape_of = np.zeros(2 * BLOCK + capacity, dtype=np.int64)
        self.pairs, self.owners = np.zeros((LIST, 2), dtype=np.int64), np.zeros((LIST, 2), dtype=np.int64)
        self.rows = np.zeros(LIST, dtype=PAIR_DTYPE)
        self.scores, self.slots = np.zeros(BLOCK * SCORE), np.zeros(SLOTS, dtype=np.int64)
        self.balls, self.near = np.zeros((4 + 2 * capacity, BALL_IN_WORLD)), np.zeros(NEAR, dtype=np.int64)
        of_slots = self.scores, self.slots, self.balls, self.near
        buffers = *self.poses, self.shape_of, self.pairs, self.owners, self.rows, *of_slots
        self._addresses = tuple(map(address_of, buffers))

    def header_of(self, table: CompoundTable, scratch: tuple[int, int], at_once: int = 0) -> np.ndarray:
        """The header of a call; scratch : addresses of a workspace of `answer_pairs`.   at_once : of single calls, how
        many pairs of parts are answered at once."""
        addresses = *table.addresses, *self._addresses, *scratch
        return np.array((code_of(answer_pairs), *addresses, self.capacity, at_once, *_AT_THE_START))


class _SingleSpace(_Workspace):
    """The same for single calls, which have nothing else."""

    def __init__(self, capacity: int):
        super().__init__(capacity)
        self.byte, self.row = np.zeros(1, dtype=np.uint8), np.zeros(1, dtype=PAIR_DTYPE)
        self._pair_space = np.zeros(DOUBLES), np.zeros(INTEGERS, dtype=np.int64)
        self.scratch = address_of(self._pair_space[0]), address_of(self._pair_space[1])


class _OfThread(local):
    """The workspace of one thread, made when the thread first asks; `asked` counts its pairs of parts."""

    space: _Workspace | None = None
    asked = 0

    def space_for(self, table: CompoundTable) -> _Workspace:
        if self.space is None or self.space.capacity < table.max_parts:
            self.space = _Workspace(max(table.max_parts, _CAPACITY))
        return self.space


of_thread = _OfThread()


# --- questions ----------------------------------------------------------------------------------


def answer_compound_batch(
    out: np.ndarray,
    table: CompoundTable,
    which: np.ndarray | None,
    X_WA: np.ndarray,
    X_WB: np.ndarray,
    *,
    boolean: bool,
    limit: float,
    check: bool,
    depths: bool,
) -> bool:
    """Answer two bodies at n pairs of poses; False at an invalid pose. Arguments as in `run.run_poses`.

    which : (n, 2) int64 bodies of ``table`` pose by pose, or ``None`` for bodies 0 and 1 throughout.
    """
    table.build_trees(which)
    space = of_thread.space_for(table)
    header = space.header_of(table, run.scratch())
    while True:
        status = answer_compounds(
            address_of(header), 0 if which is None else address_of(which), address_of(X_WA), 16 * (len(X_WA) > 1),
            address_of(X_WB), 16 * (len(X_WB) > 1), len(out), boolean, depths and not boolean, limit, check,
            run.distrust_doubles, address_of(out),
        )
        if not status or status == BAD_POSE:
            of_thread.asked += int(header[N_ANSWERED])
            return not status
        listed = int(header[N_LISTED])
        run.settle_open(
            space.rows[:listed], space.pairs[:listed], table.table, space.poses, space.shape_of, boolean=boolean,
            limit=limit,
            depths=depths and not boolean,
        )


#: Pairs of parts of a single call, which keeps Python's lock; more are left to the long way, which lets go of it. Of
#: bodies with more pairs, so many at most are answered before they are left to it.
_MAX_AT_ONCE, _MAX_OF_MANY = 1024, 256
#: Parts of two bodies whose single calls go through one kernel: a row of poses each is kept.
_MAX_PARTS = 1 << 13


def single_header(table: CompoundTable) -> tuple[np.ndarray, _SingleSpace]:
    """(header of single calls of bodies 0 and 1, their workspace)."""
    space = _single_space(1 << (table.max_parts - 1).bit_length())
    at_once = _MAX_AT_ONCE if table.counts.prod() <= _MAX_AT_ONCE else _MAX_OF_MANY
    return space.header_of(table, space.scratch, at_once), space


@workspace_under_lock
def _single_space(max_parts: int) -> _SingleSpace:
    return _SingleSpace(max_parts)


def prepared_compounds(A: LaidOut, B: LaidOut) -> Prepared:
    """Two bodies ready for one call at a time, and their table for batches."""
    table = CompoundTable([A, B])
    table.build_trees(None)
    if table.max_parts > _MAX_PARTS:
        return Prepared(table=table)
    header, space = single_header(table)
    places = address_of(space.byte), address_of(space.row)
    words = np.array([code_of(answer_compounds), *places, *header.tolist()])
    return Prepared(
        collide=prepared_boolean(collide_single_compound, words), within=prepared_within(within_single_compound, words),
        distance=prepared_row(distance_single_compound, words), table=table, held=space,
    )


def combine(
    rows: np.ndarray, starts: np.ndarray, spans: np.ndarray, table: ShapeTable, poses: PoseTable, shape_of
) -> np.ndarray:
    """One row a pair of bodies from rows of pairs of parts.

    rows : PAIR_DTYPE, those of a pair of bodies standing together.   starts : first row of each pair of bodies.
    spans : (k, 4) int64: first part and number of parts of A, and of B. Parts too far apart may have been left out of
        ``rows``, but they still bar the way out.
    table, poses, shape_of : as in `run.run_pairs`.
    """
    if (spans[:, 1::2] == 1).all():
        return rows
    out = np.zeros(len(starts), dtype=PAIR_DTYPE)  # padding too: equal answers are equal bytes
    ends, spans, score = np.append(starts, len(rows)), np.ascontiguousarray(spans), np.zeros(SCORE + SEPARATING)
    combine_rows(
        address_of(rows), address_of(ends), address_of(spans), len(starts), *table.addresses, address_of(poses.rows),
        address_of(shape_of), address_of(score), address_of(out),
    )
    return out
