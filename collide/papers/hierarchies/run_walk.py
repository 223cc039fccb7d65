"""The walk from Python: addresses in, rows out."""

from __future__ import annotations

from threading import local
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.papers.hierarchies.walk import DOUBLES, INTEGERS, TRACE, TRACED_ROUNDS, WALK_DTYPE, walk_poses
from collide.papers.hierarchies.walk_bodies import WalkBody
from collide.papers.hierarchies.walk_steps import INVERSE, SEPARATED


class TracedRound(NamedTuple):
    """What holds after a round.

    space : "base", "primal" or "polar".   invariant : "separation", "inverse separation" or "none".
    level_p, level_q : levels reached, 1 the body itself, as the paper counts.
    vertex_p, vertex_q : where the planes are tangent.   p_star, q_star : of the star invariant, −1 at the coarsest
        level; rows of the hierarchies' points.
    z, z_star : points of Q, for the planes π and φ.   x, x_star : points of P in P's frame, for μ and γ.
    """

    space: str
    invariant: str
    level_p: int
    level_q: int
    vertex_p: int
    vertex_q: int
    p_star: int
    q_star: int
    z: np.ndarray
    x: np.ndarray
    z_star: np.ndarray
    x_star: np.ndarray


def no_walks(n: int) -> np.ndarray:
    """Rows of walks that were not begun: LOST, all counts 0."""
    return np.zeros(n, dtype=WALK_DTYPE)


def run_walks(
    body_p: WalkBody,
    body_r: WalkBody,
    packed_p: PackedConvex,
    packed_r: PackedConvex,
    X_WP: np.ndarray,
    X_WR: np.ndarray,
    *,
    trace: bool = False,
    early: bool = False,
) -> tuple[np.ndarray, tuple[TracedRound, ...]]:
    """(rows of `WALK_DTYPE`, rounds of the last pose where ``trace`` asks for them) for poses (n, 4, 4).

    early : a hybrid, for measurements: every new plane is tried at once against the whole bodies, by their support
        trees, and every new point against a ball in R.
    """
    n, polar = len(X_WP), body_r.polar
    assert polar is not None, "the body that plays R has a polar"
    rows = no_walks(n)
    table = ShapeTable([packed_p, packed_r])
    table.build_trees(np.arange(2))
    poses = np.empty((2 * n, 4, 4))
    poses[0::2], poses[1::2] = X_WP, X_WR
    laid_out = pose_table(poses, np.broadcast_to(np.eye(4), poses.shape), np.zeros(2 * n))
    rounds = np.zeros((TRACED_ROUNDS, TRACE)) if trace else None
    walk_poses(
        body_p.hierarchy.address, polar.hierarchy.address, polar.address, *table.addresses,
        address_of(laid_out.rows), n, early, address_of(rows), 0 if rounds is None else address_of(rounds),
        *_of_thread.addresses,
    )
    if rounds is None or n == 0:
        return rows, ()
    return rows, tuple(_read(k, row) for k, row in enumerate(rounds[: rows["rounds"][-1]]))


def _read(number: int, row: np.ndarray) -> TracedRound:
    space = "base" if number == 0 else ("polar" if row[0] else "primal")
    invariant = {SEPARATED: "separation", INVERSE: "inverse separation"}.get(int(row[1]), "none")
    level_p, level_q, vertex_p, vertex_q, p_star, q_star = (int(v) for v in row[2:8])
    return TracedRound(
        space, invariant, level_p + 1, level_q + 1, vertex_p, vertex_q, p_star, q_star, *row[8:20].reshape(4, 3)
    )


class _OfThread(local):
    """The workspace of one thread, made when the thread first asks."""

    def __init__(self) -> None:
        self.doubles = np.zeros(DOUBLES)
        self.integers = np.zeros(INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_of_thread = _OfThread()
