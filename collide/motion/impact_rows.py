"""Rows of first contacts, as kernels write them, and what `time_of_impact` returns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.motion.convex_impact import CONTACT, FREE, OPEN
from collide.motion.impact_jobs import DOUBLES_OF_ROW, clear_impacts
from collide.results import only_value

#: One row a motion: bracket of the first contact, normal and points in W [m]; which parts meet; questions to GJK; how
#: the search ended (`convex_impact.py`).
IMPACT_DTYPE = np.dtype(
    [
        ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point_a", "f8", 3), ("point_b", "f8", 3),
        ("part_a", "<i4"), ("part_b", "<i4"), ("queries", "<i4"), ("status", "<i4"),
    ],
    align=True,
)


class TimeOfImpact(NamedTuple):
    """First contacts of moving bodies, in units of the motions' time.

    hit : (N,) bool. False: proven free of contact from 0 to 1. True: they touch, or touching is open (``certified``).
    time : ``lower`` of hits: the bodies are proven apart until then, so moving to ``time`` never lets them overlap. 1
        of free motions.
    lower, upper : the first contact is at lower ≤ t ≤ upper, proven; both 0 for bodies in contact at the start, both 1
        for free motions. ``upper`` is inf where contact is not proven: the bodies come within rounding of each other
        at ``lower``, and the rest of the motion is open.
    certified : the answer is proven, and upper − lower is within the tolerance.
    normal : unit vector from A to B in W at ``time``; zeros for free motions, and for meshes that overlap at the start.
    point_a, point_b : nearest points of A and B in W at ``time`` [m]; zeros for free motions.
    part_a, part_b : which parts of compounds meet, which facets of meshes; 0 elsewhere.
    queries : questions to GJK, for diagnosis.

    Single motions have scalars and (3,).
    """

    hit: np.ndarray
    time: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    certified: np.ndarray
    normal: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray
    part_a: np.ndarray
    part_b: np.ndarray
    queries: np.ndarray


def free_rows(n: int) -> np.ndarray:
    """Rows of motions without any contact."""
    rows = np.zeros(n, dtype=IMPACT_DTYPE)
    clear_impacts(address_of(rows), n)
    return rows


def flipped_impacts(rows: np.ndarray) -> np.ndarray:
    """The same contacts with A and B exchanged, exactly."""
    swapped = rows.copy()
    for of_a, of_b in (("part_a", "part_b"), ("point_a", "point_b")):
        swapped[of_a], swapped[of_b] = rows[of_b], rows[of_a]
    swapped["normal"] = 0.0 - rows["normal"]
    return swapped


def as_result(rows: np.ndarray, tolerance: float, single: bool) -> TimeOfImpact:
    """Rows as callers see them."""
    free = rows["status"] == FREE
    lower, upper = np.where(free, 1.0, rows["lower"]), np.where(free, 1.0, rows["upper"])
    certified = upper - lower <= tolerance
    columns = (
        ~free, lower, lower.copy(), upper, certified, *(rows[name].copy() for name in (
            "normal", "point_a", "point_b", "part_a", "part_b", "queries")),
    )
    return TimeOfImpact(*(only_value(column) if single else column for column in columns))


def single_result(row: np.ndarray, tolerance: float, first: tuple[int, int] | None = None) -> TimeOfImpact | None:
    """`TimeOfImpact` of a motion of two convex parts, or of unions whose first parts have these rows; None for motions
    with a proven or possible contact at the start, or refused."""
    status, numbers = int(row["status"][0]), row.view(np.float64)[:DOUBLES_OF_ROW].copy()
    if status == FREE:
        lower = upper = 1.0
    else:
        lower, upper = numbers[:2].tolist()
        if status not in (CONTACT, OPEN) or upper == 0.0:
            return None
    normal, point_a, point_b = numbers[2:5], numbers[5:8], numbers[8:11]
    certified = upper - lower <= tolerance
    queries, part_a, part_b = int(row["queries"][0]), 0, 0
    if first is not None and status != FREE:
        part_a, part_b = int(row["part_a"][0]) - first[0], int(row["part_b"][0]) - first[1]
    values = status != FREE, lower, lower, upper, certified, normal, point_a, point_b, part_a, part_b, queries
    return TimeOfImpact(*values)  # type: ignore[arg-type]
