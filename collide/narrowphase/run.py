"""The narrowphase from Python: doubles first, the exact stage for what they leave open."""

from __future__ import annotations

from threading import local

import numpy as np

from collide._jit import address_of
from collide.errors import UnsupportedQuery
from collide.geometry.tables import PoseTable, ShapeTable
from collide.narrowphase.answer import DOUBLES, INTEGERS, answer_pairs
from collide.narrowphase.decide import DIGITS, decide_pairs
from collide.narrowphase.halfspaces import settle
from collide.results import PAIR_DTYPE, REFUSED, UNDECIDED
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
) -> np.ndarray:
    """Rows of `PAIR_DTYPE` for pairs (k, 2) of posed parts; fewer than k where a hit stopped it.

    poses : of all parts.   shape_of : (parts,) int64, rows of ``table``.
    Fields a, b and part_a, part_b are left 0: the caller knows the bodies.
    """
    pairs = np.ascontiguousarray(pairs, dtype=np.int64)
    rows = np.zeros(len(pairs), dtype=PAIR_DTYPE)
    tables = address_of(table.ints), address_of(table.numbers), address_of(poses.rows), address_of(shape_of)
    done = 0
    while done < len(pairs):
        todo, out = pairs[done:], rows[done:]
        answered = answer_pairs(
            *tables, address_of(todo), len(todo), boolean, stop_at_hit, limit, address_of(out), *_workspace.addresses
        )
        fresh = out[:answered]
        if (fresh["how"] == REFUSED).any():
            raise UnsupportedQuery(
                f"a pair whose shapes and distance together measure less than {SMALLEST:g} m is out of range: scale it"
            )
        if distrust_doubles:
            fresh["how"], fresh["lower"], fresh["upper"], fresh["beyond"] = UNDECIDED, -np.inf, np.inf, False
        if (fresh["how"] == UNDECIDED).any():
            decide_pairs(
                *tables, address_of(todo), answered, boolean, limit, address_of(out), address_of(poses.terms),
                len(poses.terms), address_of(_workspace.digits),
            )  # fmt: skip
            settle(out, np.flatnonzero(fresh["how"] == UNDECIDED), todo, table, poses, shape_of)
        done += answered
        # The hit that stopped the kernel may have been an open one that turned out to be apart.
        if stop_at_hit and fresh["hit"][-1]:
            break
    return rows[:done]


class _Workspace(local):
    """Scratch memory of one thread, made when the thread first asks."""

    def __init__(self) -> None:
        self.doubles = np.zeros(DOUBLES)
        self.integers = np.zeros(INTEGERS, dtype=np.int64)
        self.digits = np.zeros(DIGITS + 16, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_workspace = _Workspace()
