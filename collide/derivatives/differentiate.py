"""Derivatives of a batch's rows: of pairs of convex sets by the kernel, of unions by their nearest parts.

In overlaps of cores the direction of the depth need not be the only one. Such a pair is asked again with B pushed
deeper along the direction by a length ε, `PUSHED` of the depth. If another direction n' parts the bodies by as short a
way, the depth then grows by ε n · n' alone, and the answer turns to n'. Otherwise all other directions are longer by at
least ε (1 − n · n').
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from collide.derivatives.active_parts import active_pairs, is_least_of_parts
from collide.derivatives.derived_rows import Derived, empty_derived, run_rows, table_of, unwritten_derived
from collide.derivatives.gradient_rows import (
    CORE_A,
    CORE_B,
    CORE_DISTANCE,
    DIRECTION_OPEN,
    GRADIENT,
    IS_FIXED,
    NO_DEPTH,
    SEVERAL_DIRECTIONS,
    SEVERAL_PARTS,
    STATE,
    TOO_FAR,
    UNCERTAIN,
    UNIQUE,
    UNIT_NORMAL,
)
from collide.lowering.parts import is_single_convex, parts_of
from collide.shapes.shape import Shape

#: By what part of the cores' depth B is pushed deeper to see whether another direction is as short, and by what part of
#: the pair's size, places included, at least.
PUSHED, LEAST_PUSH = 2.0**-16, 2.0**-36
#: Directions and depths of the pushed pair that differ by less are the same.
_SAME_DIRECTION, _SAME_DEPTH = 2.0**-10, 2.0**-10
#: Gradients of parts as near that differ by less than this part of the largest number are the same.
_SAME_GRADIENT = 2.0**-30
#: Rows of ``A``, ``B`` at poses (n, 4, 4) each.
Ask = Callable[[Any, Any, np.ndarray, np.ndarray], np.ndarray]


def differentiate(rows: np.ndarray, question: tuple, ask: Ask) -> Derived:
    """Derivatives of the rows of a question (A, B, X_WA, X_WB), as of `PairResult`.   ask : answers pairs anew."""
    A, B, X_WA, X_WB = question
    n = len(rows)
    shapes, of_a, of_b = _numbered(A, B, n)
    is_convex = np.array([is_single_convex(shape) for shape in shapes], dtype=bool)
    is_pair = is_convex[of_a] & is_convex[of_b]
    some = np.flatnonzero(is_pair)
    derived = unwritten_derived(n) if len(some) == n else empty_derived(n)
    if len(some):
        table, poses = table_of(shapes, is_convex), (X_WA, X_WB)
        if len(some) == n:
            run_rows(rows, table, (of_a, of_b), poses, poses, derived)
        else:
            poses = tuple(X if len(X) == 1 else X[some] for X in poses)
            part = Derived(*(column[some] for column in derived))
            run_rows(rows[some], table, (of_a[some], of_b[some]), poses, poses, part)
            for whole, piece in zip(derived, part):
                whole[some] = piece
    for k in np.flatnonzero(~is_pair).tolist():
        X_WAk, X_WBk = (X[k if len(X) > 1 else 0] for X in (X_WA, X_WB))
        out = Derived(*(column[k] for column in derived))
        _differentiate_union(rows[k], shapes[of_a[k]], shapes[of_b[k]], X_WAk, X_WBk, out)
    is_open = np.flatnonzero(derived.kinds[:, STATE] == DIRECTION_OPEN)
    if len(is_open):
        _close_directions(rows, is_open, question, ask, derived)
    unknown = derived.kinds[:, STATE] != UNIQUE
    if unknown.any():
        derived.numbers[unknown, GRADIENT : GRADIENT + 12] = np.nan
    return derived


def _differentiate_union(row, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, out: Derived) -> None:
    """Write the derivative of a row of bodies, a union among them: of the nearest parts, where the derivatives of all
    nearest parts are the same."""
    if row["beyond"] or not row["certified"] or not row["normal"].any():
        out.kinds[STATE] = TOO_FAR if row["beyond"] else NO_DEPTH if row["certified"] else UNCERTAIN
        return
    if not is_least_of_parts(row, A, B):
        if _is_ball(A) or _is_ball(B):
            _put_ball(row, A, B, X_WA, X_WB, out)
        return
    active = active_pairs(A, B, X_WA, X_WB, float(row["upper"]), row["normal"])
    if active is None:
        return
    states, gradients = active.derived.kinds[:, STATE], active.derived.numbers[:, GRADIENT : GRADIENT + 12]
    for to, values in zip(out, active.derived):
        to[...] = values[0]
    out.kinds[IS_FIXED] &= len(states) == 1
    if states.any():
        out.kinds[STATE] = states.max() if len(states) == 1 else max(SEVERAL_PARTS, int(states.max()))
    elif np.ptp(gradients, axis=0).max() > _SAME_GRADIENT * np.abs(gradients).max():
        out.kinds[STATE] = SEVERAL_PARTS


def _is_ball(shape: Shape) -> bool:
    return is_single_convex(shape) and len(parts_of(shape)[0][0].points) == 1


def _put_ball(row, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, out: Derived) -> None:
    """Write the derivative of a ball in a body, proven to be so deep, as of its normal and witness points: the ball's
    follows from the normal, so that both are unique where the normal is."""
    n = row["normal"]
    radii = [parts_of(shape)[0][0].radius if _is_ball(shape) else 0.0 for shape in (A, B)]
    core_a, core_b = row["point_a"] - radii[0] * n, row["point_b"] + radii[1] * n
    out.kinds[STATE], out.kinds[IS_FIXED], out.radii[:] = DIRECTION_OPEN, 0, radii
    out.numbers[UNIT_NORMAL : UNIT_NORMAL + 3], out.numbers[CORE_DISTANCE] = n, row["distance"] + sum(radii)
    out.numbers[CORE_A : CORE_A + 3], out.numbers[CORE_B : CORE_B + 3] = core_a, core_b
    out.numbers[GRADIENT : GRADIENT + 12] = np.concatenate(
        [np.cross(n, core_a - X_WA[:3, 3]), -n, np.cross(core_b - X_WB[:3, 3], n), n]
    )


def _numbered(A, B, n: int) -> tuple[list[Shape], np.ndarray, np.ndarray]:
    """(distinct shapes, (n,) numbers of A among them, and of B).   A, B : shapes, or sequences of n."""
    numbers: dict[int, int] = {}
    shapes: list[Shape] = []

    def number(shape: Shape) -> int:
        if id(shape) not in numbers:
            numbers[id(shape)] = len(shapes)
            shapes.append(shape)
        return numbers[id(shape)]

    of_a, of_b = (
        np.full(n, number(side)) if isinstance(side, Shape) else np.fromiter(map(number, side), np.int64, n)
        for side in (A, B)
    )
    return shapes, of_a, of_b


def _close_directions(rows: np.ndarray, which: np.ndarray, question: tuple, ask: Ask, derived: Derived) -> None:
    """Ask rows ``which`` again, pushed deeper; their states become unique, or not."""
    A, B, X_WA, X_WB = question
    A, B = (side if isinstance(side, Shape) else [side[k] for k in which.tolist()] for side in (A, B))
    X_WA, X_WB = (np.broadcast_to(X, (len(rows), 4, 4))[which] for X in (X_WA, X_WB))
    normals, numbers = rows["normal"][which], derived.numbers[which]
    lengths = push_lengths(numbers, derived.radii[which], X_WA, X_WB)
    X_pushed = X_WB.copy()
    X_pushed[:, :3, 3] -= lengths[:, None] * normals
    lengths = np.einsum("ij,ij->i", X_WB[:, :3, 3] - X_pushed[:, :3, 3], normals)  # as rounded
    pushed = ask(A, B, np.ascontiguousarray(X_WA), X_pushed)
    turned = np.einsum("ij,ij->i", pushed["normal"], normals) < 1.0 - _SAME_DIRECTION
    grown = (rows["distance"][which] - pushed["distance"]) / lengths
    is_same = ~turned & (np.abs(grown - 1.0) <= _SAME_DEPTH) & pushed["certified"]
    derived.kinds[which, STATE] = np.where(is_same, UNIQUE, SEVERAL_DIRECTIONS)


def push_lengths(numbers: np.ndarray, radii: np.ndarray, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) by how much to push B [m]: a part of the cores' depth, and far more than what rounding moves."""
    size = radii.sum(axis=1)
    for at, X in ((CORE_A, X_WA), (CORE_B, X_WB)):
        size += np.abs(numbers[:, at : at + 3] - X[:, :3, 3]).sum(axis=1) + np.abs(X[:, :3, 3]).sum(axis=1)
    return np.maximum(PUSHED * np.abs(numbers[:, CORE_DISTANCE]), LEAST_PUSH * size)
