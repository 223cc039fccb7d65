"""Rows that one search of the narrowphase leaves open, and another one may settle.

A boolean, a gap and a depth are searched for differently, and where curved shapes or rounded corners are within rounding of
touching, each proves some signs that the others do not (integers settle those of polytopes). What is proven is proven: an
open row asks the other two searches, so that `collide` and `distance`, signed or not, never contradict each other.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.narrowphase.answer import answer_pairs
from collide.results import PAIR_DTYPE, UNDECIDED

#: (boolean, depths) of `answer_pairs`: the search for the sign, for a depth, and for a gap.
_SIGN, _DEPTH, _GAP = (True, False), (False, True), (False, False)


def settle_by_other_searches(
    rows: np.ndarray, pairs: np.ndarray, tables: tuple[int, int, int, int, int], workspace: tuple[int, int], *, boolean: bool,
    depths: bool, limit: float,
) -> None:  # fmt: skip
    """Settle in place what is still open; arguments as of `run_pairs`.

    tables : addresses of the shapes' integers and numbers, the poses' rows and terms, and which shape a part is.
    workspace : addresses of doubles and integers.
    """
    own = (boolean, depths and not boolean)
    for search in (_SIGN, _DEPTH, _GAP):
        left = np.flatnonzero(rows["how"] == UNDECIDED)
        if search == own or not len(left):
            continue
        told, asked = np.zeros(len(left), dtype=PAIR_DTYPE), np.ascontiguousarray(pairs[left])
        answer_pairs(*tables, address_of(asked), len(asked), *search, False, limit, address_of(told), *workspace)
        proven = told["how"] != UNDECIDED
        left, told = left[proven], told[proven]
        whole = (search != _SIGN) & ~told["hit"]  # a gap, with all that is known of one
        rows[left[whole]] = told[whole]
        _take_sign(rows, left[~whole], told[~whole], limit)


def _take_sign(rows: np.ndarray, at: np.ndarray, told: np.ndarray, limit: float) -> None:
    """Take over from rows ``told`` whether the bodies meet, and what follows for the bracket."""
    if not len(at):
        return
    row = rows[at]
    row["how"], row["hit"] = told["how"], told["hit"]
    row["lower"] = np.where(told["hit"], row["lower"], np.maximum(row["lower"], told["lower"]))
    row["upper"] = np.where(told["hit"], np.minimum(row["upper"], 0.0), np.maximum(row["upper"], row["lower"]))
    row["beyond"] = row["lower"] > limit
    row["certified"] |= row["beyond"]
    row["distance"] = np.where(row["beyond"], row["lower"], np.clip(row["distance"], row["lower"], row["upper"])) + 0.0
    row["upper"][row["beyond"]] = np.inf
    lay_points_apart(row, np.arange(len(row)))
    rows[at] = row


def lay_points_apart(rows: np.ndarray, moved: np.ndarray) -> None:
    """Lay the points of rows whose distance was moved, by their numbers, as far apart along the normal, in place.

    They stay about their middle; how far they move is how much the distance did.
    """
    gap = rows["distance"][moved, None] * rows["normal"][moved]
    missing = 0.5 * (gap - (rows["point_b"][moved] - rows["point_a"][moved]))
    rows["point_a"][moved] -= missing
    rows["point_b"][moved] += missing
