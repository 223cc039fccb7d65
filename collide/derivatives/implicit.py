"""How witness points and normal move with the poses, and how the gradient does: the implicit function theorem.

The equations of `settle_features.py` hold at all poses nearby, with each feature moving as its body does. Their
derivatives by a rotation ω and a shift v of either body are the right sides; the matrix is Newton's. Features stay the
same where witness points lie inside them, and only there is an answer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.derivatives.derived_rows import Derived
from collide.derivatives.gradient_rows import (
    BENDING_A,
    BENDING_B,
    CORE_A,
    CORE_B,
    CORE_DISTANCE,
    IS_FIXED,
    SIZE_A,
    SIZE_B,
    STATE,
    TANGENTS_A,
    TANGENTS_B,
    UNIQUE,
    UNIT_NORMAL,
)

#: Matrices of a larger condition, lengths in units of the pair's size, are singular.
_LARGEST_CONDITION = 2.0**40
_A, _B = (slice(0, 3), slice(3, 6)), (slice(6, 9), slice(9, 12))


class Motion(NamedTuple):
    """Derivatives by the twelve numbers of both poses: of witness points and normal (n, 3, 12), of the distance's
    gradient (n, 12, 12); NaN where features change, or are no regular answer."""

    point_a: np.ndarray
    point_b: np.ndarray
    normal: np.ndarray
    gradient: np.ndarray


def motion_of(derived: Derived, origins_a: np.ndarray, origins_b: np.ndarray) -> Motion:
    """`Motion` of n rows.   origins : (n, 3) of the bodies, in the world [m]."""
    n = len(derived.kinds)
    moved = Motion(*(np.full((n, size, 12), np.nan) for size in (3, 3, 3, 12)))
    known = np.flatnonzero((derived.kinds[:, STATE] == UNIQUE) & (derived.kinds[:, IS_FIXED] != 0))
    if not len(known):
        return moved
    rows = Derived(*(column[known] for column in derived))
    arms = [rows.numbers[:, at : at + 3] - o[known] for at, o in ((CORE_A, origins_a), (CORE_B, origins_b))]
    size = np.maximum(np.abs(arms).max(axis=(0, 2)), np.abs(rows.numbers[:, CORE_DISTANCE]))
    matrix, right = _system(rows, *arms)
    scale = np.ones((len(known), 8))
    scale[:, [0, 1, 2, 3, 7]] = np.where(size > 0.0, size, 1.0)[:, None]
    scaled = matrix * scale[:, None, :]
    scaled /= np.abs(scaled).max(axis=2, keepdims=True).clip(1e-300)
    regular = np.linalg.cond(scaled) < _LARGEST_CONDITION
    steps = np.linalg.solve(matrix[regular], right[regular])
    known, rows = known[regular], Derived(*(column[regular] for column in rows))
    for to, values in zip(moved, _moved(rows, steps, *(arm[regular] for arm in arms))):
        to[known] = values
    return moved


def _system(rows: Derived, arm_a: np.ndarray, arm_b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Newton's matrix (n, 8, 8), and the right sides (n, 8, 12) for a unit of each number of both poses."""
    m, n = rows.numbers, rows.numbers[:, UNIT_NORMAL : UNIT_NORMAL + 3]
    matrix, right = np.zeros((len(m), 8, 8)), np.zeros((len(m), 8, 12))
    sides = ((0, SIZE_A, TANGENTS_A, BENDING_A, _A, -1.0), (2, SIZE_B, TANGENTS_B, BENDING_B, _B, 1.0))
    for first, size, tangents, bending, (rotation, _), sign in sides:
        bend = m[:, [bending, bending + 1, bending + 1, bending + 2]].reshape(-1, 2, 2)
        for k in range(2):
            has, t = rows.kinds[:, size] > k, m[:, tangents + 3 * k : tangents + 3 * k + 3]
            matrix[:, first + k, first + k] = np.where(has, bend[:, k, k], 1.0)
            matrix[:, first + k, first + 1 - k] = np.where(rows.kinds[:, size] > 1, bend[:, k, 1 - k], 0.0)
            matrix[:, first + k, 4:7] = np.where(has[:, None], t, 0.0)
            matrix[:, 4:7, first + k] = np.where(has[:, None], sign * t, 0.0)
            right[:, first + k, rotation] = np.where(has[:, None], np.cross(n, t), 0.0)
    matrix[:, 4:7, 4:7] = -m[:, CORE_DISTANCE, None, None] * np.eye(3)
    matrix[:, 4:7, 7], matrix[:, 7, 4:7] = -n, n
    right[:, 4:7, _A[0]], right[:, 4:7, _A[1]] = -crossed(arm_a), np.eye(3)
    right[:, 4:7, _B[0]], right[:, 4:7, _B[1]] = crossed(arm_b), -np.eye(3)
    return matrix, right


def _moved(rows: Derived, steps: np.ndarray, arm_a: np.ndarray, arm_b: np.ndarray):
    """(point_a, point_b, normal, gradient) as of `Motion`."""
    m, n, dn = rows.numbers, rows.numbers[:, UNIT_NORMAL : UNIT_NORMAL + 3], steps[:, 4:7]
    cores, gradient = [], np.zeros((len(m), 12, 12))
    for first, tangents, size, (rotation, shift), arm, sign in (
        (0, TANGENTS_A, SIZE_A, _A, arm_a, -1.0), (2, TANGENTS_B, SIZE_B, _B, arm_b, 1.0)
    ):
        core = np.zeros((len(m), 3, 12))
        core[:, :, rotation] = -crossed(arm)  # ω × arm
        for k in range(2):
            t = np.where((rows.kinds[:, size] > k)[:, None], m[:, tangents + 3 * k : tangents + 3 * k + 3], 0.0)
            core += t[:, :, None] * steps[:, None, first + k]
        gradient[:, rotation] = sign * (crossed(arm) @ dn - crossed(n) @ core)
        gradient[:, shift] = sign * dn
        core[:, :, shift] += np.eye(3)
        cores.append(core)
    radii = rows.radii[:, :, None, None]
    gradient = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    return cores[0] + radii[:, 0] * dn, cores[1] - radii[:, 1] * dn, dn, gradient


def crossed(a: np.ndarray) -> np.ndarray:
    """(n, 3, 3) matrices of v ↦ a × v, of vectors (n, 3)."""
    out = np.zeros((*a.shape, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    return out - out.transpose(0, 2, 1)
