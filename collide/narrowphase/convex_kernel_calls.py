"""The narrowphase from Python: doubles first, the exact stage for what they leave open."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import local

import numpy as np

from collide.base.free_threads import workspace_under_lock
from collide.errors import UnsupportedQuery
from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_boolean, prepared_row, prepared_within
from collide.lowering.shape_table import NO_TERMS, POSE, PoseTable, ShapeTable
from collide.narrowphase.exact.depth_requests import ROWS_PER_BATCH
from collide.narrowphase.exact.exact_stage import settle_exactly, settle_rows, step_codes
from collide.narrowphase.exact.settle_space import WORKSPACE
from collide.narrowphase.exact_curved.settle_curved import settle_curved
from collide.narrowphase.fallback_searches import settle_by_other_searches
from collide.narrowphase.finish_rows import finish_rows
from collide.narrowphase.pair_kernel import DOUBLES, INTEGERS, REQUESTS_AT, answer_pairs
from collide.narrowphase.pose_batches import (
    ANSWERED,
    BAD_POSE,
    BLOCK,
    CORE,
    HEADER,
    INTS_AT,
    NUMBERS_AT,
    POSES_AT,
    SETTLE,
    answer_poses,
)
from collide.narrowphase.prepared_pairs import Prepared
from collide.narrowphase.single_call import collide_single, distance_single, within_single
from collide.results import PAIR_DTYPE, REFUSED, UNDECIDED, zeroed_rows
from collide.transforms import SMALLEST

#: Set by tests: no pair of hulls is settled in doubles, whatever they have proven.
distrust_doubles = False


def run_pairs(
    table: ShapeTable,
    poses: PoseTable,
    shape_of: np.ndarray,
    pairs: np.ndarray,
    *,
    boolean: bool,
    limit: float,
    stop_at_hit: bool = False,
    depths: bool = True,
) -> np.ndarray:
    """Rows of `PAIR_DTYPE` for pairs (k, 2) of posed parts; fewer than k where a hit stopped the search.

    poses : of all parts.   shape_of : (parts,) int64, rows of ``table``.
    depths : whether depths of overlaps are wanted.
    Fields a, b and part_a, part_b are left 0: the caller knows the bodies.
    """
    pairs = np.ascontiguousarray(pairs, dtype=np.int64)
    rows = zeroed_rows(len(pairs), PAIR_DTYPE)
    table.build_trees(shape_of[pairs])
    tables = *table.addresses, address_of(poses.rows), address_of(poses.terms), address_of(shape_of)
    depths = depths and not boolean
    done = 0
    while done < len(pairs):
        last = len(pairs) if boolean else done + ROWS_PER_BATCH
        todo, out = pairs[done:last], rows[done:last]
        answered = answer_pairs(
            *tables, address_of(todo), len(todo), boolean, depths, stop_at_hit, limit, address_of(out),
            *_of_thread.space.addresses,
        )
        _finish(out[:answered], todo, table, poses, shape_of, boolean=boolean, limit=limit, depths=depths)
        done += answered
        # The hit that stopped the kernel may have been an open one that turned out to be apart.
        if stop_at_hit and out["hit"][answered - 1]:
            break
    return rows[:done]


def settle_proposals(
    table: ShapeTable,
    poses: PoseTable,
    shape_of: np.ndarray,
    pairs: np.ndarray,
    rows: np.ndarray,
    *,
    boolean: bool = False,
) -> None:
    """Let the exact stage settle rows in place, starting from vertices found by another search.

    Arguments as in `run_pairs`; rows : with vertices, count, points and a guess of the distance. Bodies that meet get a
    hit without a depth.   boolean : no distance is wanted either.
    """
    rows["how"], rows["lower"], rows["upper"] = UNDECIDED, -np.inf, np.inf
    _of_thread.space.integers[REQUESTS_AT] = 0
    _finish(
        rows,
        np.ascontiguousarray(pairs, dtype=np.int64),
        table,
        poses,
        shape_of,
        boolean=boolean,
        limit=np.inf,
        depths=False,
    )


def _finish(
    rows, pairs, table: ShapeTable, poses: PoseTable, shape_of, *, boolean: bool, limit: float, depths: bool
) -> None:
    """Settle in place what doubles left open."""
    how = rows["how"]
    if np.count_nonzero(how == REFUSED):
        raise UnsupportedQuery(
            f"a pair whose shapes and distance together measure less than {SMALLEST:g} m is out of range: scale it"
        )
    if distrust_doubles:
        how[:], rows["lower"], rows["upper"], rows["beyond"] = UNDECIDED, -np.inf, np.inf, False
    if np.count_nonzero(how) < len(how):  # UNDECIDED is 0
        settle_rows(
            rows, pairs, table, poses, shape_of, boolean=boolean, depths=depths, limit=limit,
            digits=_of_thread.space.digits,
            requests_at=_of_thread.space.addresses[1] + 8 * REQUESTS_AT,
        )
        if not distrust_doubles:
            settle_by_other_searches(
                code_of(answer_pairs), *table.addresses, address_of(poses.rows), address_of(poses.terms),
                address_of(shape_of), address_of(pairs), len(rows), boolean, depths, limit, address_of(rows),
                *_of_thread.space.addresses, address_of(_of_thread.space.digits),
            )
            _settle_curved(rows, pairs, table, poses, shape_of, boolean=boolean, limit=limit)


def _settle_curved(rows, pairs, table: ShapeTable, poses: PoseTable, shape_of, *, boolean: bool, limit: float) -> None:
    """Settle in place what is still open, by `settle_curved`, which needs the rows of a distance."""
    undecided = np.flatnonzero(rows["how"] == UNDECIDED)
    if not len(undecided) or _of_thread.leaves_touching_open:
        return
    if not boolean:
        settle_curved(rows, undecided, pairs, table, poses, shape_of, limit)
        return
    measured = run_pairs(table, poses, shape_of, pairs[undecided], boolean=False, limit=limit)
    for name in ("how", "hit", "certified"):
        rows[name][undecided] = measured[name]


@contextmanager
def leaving_touching_open() -> Iterator[None]:
    """Within, pairs of curved sets touching within rounding stay open in this thread: searches try place after place
    where bodies just part. An open pair counts as a hit, so no place is free by mistake."""
    before, _of_thread.leaves_touching_open = _of_thread.leaves_touching_open, True
    try:
        yield
    finally:
        _of_thread.leaves_touching_open = before


def number_of_poses(X_WA: np.ndarray, X_WB: np.ndarray) -> int:
    """Number of pairs of two batches of poses, either of them possibly a single pose."""
    return max(len(X_WA), len(X_WB)) if min(len(X_WA), len(X_WB)) else 0


def run_poses(
    out: np.ndarray,
    table: ShapeTable,
    which: np.ndarray | None,
    X_WA: np.ndarray,
    X_WB: np.ndarray,
    *,
    boolean: bool,
    limit: float,
    check: bool,
    axes: np.ndarray | None = None,
    depths: bool = True,
) -> bool:
    """Answer two convex sets at n pairs of poses; False where a matrix is no pose.

    out : becomes the answers: bool[n], or n rows of `PAIR_DTYPE`, zeroed before.
    which : (n, 2) int64 rows of ``table`` pose by pose, or None for rows 0 and 1 throughout.
    X_WA, X_WB : C-contiguous float64 (n, 4, 4), or (1, 4, 4) for a pose paired with all of the other body's.
    check : refuse matrices other than rotations.
    axes : (n, 3) for booleans: an axis to try first, pose by pose, replaced by a separating axis.
    depths : of rows: whether depths of overlaps are wanted.
    """
    n = len(out)
    table.build_trees(np.arange(2) if which is None else which)
    space = _of_thread.space
    header = space.header_of(table)
    done = 0
    while done < n:
        status = answer_poses(
            address_of(header), 0 if which is None else address_of(which), address_of(X_WA), 16 * (len(X_WA) > 1),
            address_of(X_WB), 16 * (len(X_WB) > 1), done, n, boolean, depths and not boolean, limit, check,
            0 if axes is None else address_of(axes), address_of(out),
        )
        if status == BAD_POSE:
            return False
        done = int(header[ANSWERED])
        if status:
            start = done - 1 - (done - 1) % BLOCK
            rows = space.rows[: done - start] if boolean else out[start:done]
            _finish(rows, space.pairs, table, space.poses, space.shape_of, boolean=boolean, limit=limit, depths=depths)
            if boolean:
                out[start:done] = rows["hit"]
    return True


def scratch() -> tuple[int, int]:
    """Addresses of this thread's workspace, doubles and integers, as `answer_pairs` takes them."""
    return _of_thread.space.addresses


def settle_open(
    rows, pairs, table: ShapeTable, poses: PoseTable, shape_of, *, boolean: bool, limit: float, depths: bool
) -> None:
    """Settle in place what doubles left open of rows that `answer_pairs` has just made with this thread's workspace."""
    _finish(rows, pairs, table, poses, shape_of, boolean=boolean, limit=limit, depths=depths)


def block_workspace() -> BlockWorkspace:
    """That of this thread."""
    return _of_thread.space


def finish_distances(rows: np.ndarray, *, depths: bool) -> bool:
    """`finish_rows` of `distance`; whether a depth has no end."""
    return bool(finish_rows(address_of(rows), len(rows), depths))


class BlockWorkspace:
    """Scratch memory of the kernels, and a block of poses, pairs and rows."""

    def __init__(self) -> None:
        self.doubles = np.zeros(DOUBLES)
        self.integers = np.zeros(INTEGERS, dtype=np.int64)
        self.digits = np.zeros(WORKSPACE, dtype=np.int64)
        self.poses = PoseTable(np.zeros((2 * BLOCK, POSE)), NO_TERMS)
        self.shape_of = np.zeros(2 * BLOCK, dtype=np.int64)
        self.pairs = np.stack([np.arange(BLOCK), np.arange(BLOCK, 2 * BLOCK)], axis=1)
        self.rows = np.zeros(BLOCK, dtype=PAIR_DTYPE)
        self.addresses = address_of(self.doubles), address_of(self.integers)

        self.shape_of[BLOCK:] = 1
        buffers = self.poses.rows, self.shape_of, self.pairs, self.rows
        self._header = np.zeros(HEADER, dtype=np.int64)
        self._header[CORE] = code_of(answer_pairs)
        self._header[POSES_AT:SETTLE] = *map(address_of, buffers), *self.addresses
        steps = code_of(settle_exactly), address_of(step_codes()), address_of(self.digits)
        self._header[SETTLE:ANSWERED] = steps
        #: Where a header without tables is.
        self.header_at = address_of(self._header)

    def header_of(self, table: ShapeTable) -> np.ndarray:
        """What `pose_batches.py` reads first: addresses of the kernel, the tables and this workspace."""
        header = self._header.copy()
        header[INTS_AT], header[NUMBERS_AT] = table.addresses
        return header

    def settle(self, table: ShapeTable, n: int, limit: float) -> None:
        """Settle in place what doubles left open of the first n rows of the block, distances up to a limit [m]."""
        _finish(
            self.rows[:n], self.pairs[:n], table, self.poses, self.shape_of, boolean=False, limit=limit, depths=True
        )


class _OfThread(local):
    """The workspace of one thread, made when the thread first asks."""

    def __init__(self) -> None:
        self.space = BlockWorkspace()
        self.leaves_touching_open = False


_of_thread = _OfThread()


@workspace_under_lock
def space_of_single_calls() -> BlockWorkspace:
    """A workspace for all single calls of kernels that keep Python's lock. Two threads at once may get two workspaces,
    and either works while held."""
    return BlockWorkspace()


def prepared_sets(table: ShapeTable) -> Prepared:
    """Two convex sets ready for one call at a time: rows 0 and 1 of a table."""
    if not table.is_built:
        table.build_trees(np.arange(2))
    return prepared_by(space_of_single_calls().header_of(table), table)


def prepared_by(header: np.ndarray, table: ShapeTable | None = None) -> Prepared:
    """The same by what kernels read first; of two sets of few numbers a block of `lower_pair`, without a table."""
    return Prepared(
        collide=prepared_boolean(collide_single, header), within=prepared_within(within_single, header),
        distance=prepared_row(distance_single, header), table=table, held=space_of_single_calls(),
        header=None if table else header,
    )
