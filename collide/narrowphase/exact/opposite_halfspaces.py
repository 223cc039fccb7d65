"""A step of the exact stage: two half-spaces whose normals are opposite within rounding, in Python's fractions.

Only exactly opposite ones can miss each other: the slightest tilt lets them meet, however far away.
A scene has a handful of half-spaces at most, so this needs no kernel.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import PoseTable, ShapeTable
from collide.numerics.exact_vectors import cross, inner
from collide.results import EXACT

_Vector = tuple[Fraction, Fraction, Fraction]


class _HalfSpace(NamedTuple):
    """{x : n·x ≤ offset} in the world; p is its frame's origin."""

    n: _Vector
    offset: Fraction
    p: _Vector


def settle_opposite_halfspaces(
    rows: np.ndarray,
    undecided: np.ndarray,
    pairs: np.ndarray,
    table: ShapeTable,
    poses: PoseTable,
    shape_of: np.ndarray,
) -> None:
    """Settle those of the undecided rows (their numbers) that are pairs of half-spaces, in place."""
    for k in undecided.tolist():
        parts = [int(part) for part in pairs[k]]
        packed = [table.packed[shape_of[part]] for part in parts]
        if any(shape.kind != HALFSPACE for shape in packed):
            continue
        A, B = (_half_space(shape.params, poses.exact(part)) for shape, part in zip(packed, parts))
        # Worked out on the same numbers whichever way the pair is asked.
        keys = [(shape.content, poses.rows[part].tobytes()) for shape, part in zip(packed, parts)]
        if keys[0] <= keys[1]:
            _settle(rows[k : k + 1], A, B)
            continue
        _settle(rows[k : k + 1], B, A)
        rows["normal"][k] = 0.0 - rows["normal"][k]
        rows["point_a"][k], rows["point_b"][k] = rows["point_b"][k].copy(), rows["point_a"][k].copy()


def _settle(row: np.ndarray, A: _HalfSpace, B: _HalfSpace) -> None:
    row["how"], row["certified"], row["hit"], row["exact"] = EXACT, True, True, 1
    if any(cross(A.n, B.n)) or inner(A.n, B.n) > 0:
        return  # they meet, and the overlap has no end: as the kernel left it
    # B.n = −c A.n: B is {x : A.n·x ≥ −b/c}, so the gap is (−b/c − a)/|A.n|.
    square = inner(A.n, A.n)
    c = -inner(A.n, B.n) / square
    gap = -B.offset / c - A.offset
    length = math.sqrt(float(square))
    distance = float(gap) / length
    slack = 4 * 2.0**-53 * abs(distance)
    row["hit"] = gap <= 0
    row["distance"], row["lower"], row["upper"] = distance, distance - slack, distance + slack
    row["normal"] = [float(v) / length for v in A.n]
    down = (inner(A.n, A.p) - A.offset) / square
    row["point_a"] = [float(v - down * u) for u, v in zip(A.n, A.p)]
    row["point_b"] = row["point_a"] + distance * row["normal"]


def _half_space(params: np.ndarray, pose: list[Fraction]) -> _HalfSpace:
    """The half-space {y : m·y ≤ b} at a pose: n = cof(R) m, offset = b·det R + n·p
    (`halfspace_convex.plane_in_world`)."""
    r0, r1, r2, p = ((pose[k], pose[k + 1], pose[k + 2]) for k in (0, 3, 6, 9))
    cofactor = cross(r1, r2), cross(r2, r0), cross(r0, r1)
    m = tuple(map(Fraction, params[:3].tolist()))
    n = inner(cofactor[0], m), inner(cofactor[1], m), inner(cofactor[2], m)
    return _HalfSpace(n, Fraction(float(params[3])) * inner(r0, cofactor[0]) + inner(n, p), p)
