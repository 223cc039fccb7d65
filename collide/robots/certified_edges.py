"""Straight motions sampled and certified: from a checker's questions to one verdict each."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from collide.kernels import address_of
from collide.robots.certify_motions import COLLIDES_AT, IS_PROVEN, STAYS_OPEN, certify_motions
from collide.robots.check_workspace import CheckWorkspace, MotionWorkspace
from collide.robots.robot_bodies import paths_to_root

if TYPE_CHECKING:
    from collide.robots.robot_checker import RobotChecker

#: Before anything is proven, motions are asked at their ends and, so many times halved, in between.
_SAMPLED_HALVINGS = 2
#: Roundings of forward kinematics, as a share of where links are and how far they reach.
_ROUNDING = 2.0**-40

#: One interval that stays open.
OPEN_DTYPE = np.dtype([("edge", "i8"), ("begin", "f8"), ("end", "f8"), ("a", "i4"), ("b", "i4")])


class CertifiedEdges:
    """What is known of straight motions q(t) = Q0 + t (Q1 − Q0), 0 ≤ t ≤ 1: free, colliding, or open.

    Parameters
    ----------
    free : (N,) bool
        Proven: no tested pair meets at any t.
    time : (N,) float64
        A t at which the motion collides, not the first one; NaN where none was met.
    open : (k,) OPEN_DTYPE
        Intervals of t neither proven free nor hit, at the resolution asked: ``edge``, ``begin``, ``end``, and bodies
        ``a`` and ``b`` that could not be told apart there (names: `open_names`).
    n_checked : int
        Configurations that were asked in all.
    """

    def __init__(self, free: np.ndarray, time: np.ndarray, open_: np.ndarray, n_checked: int, bodies, around):
        self.free, self.time, self.open, self.n_checked = free, time, open_, n_checked
        self._bodies, self._around = list(bodies), list(around)

    @property
    def collides(self) -> np.ndarray:
        """(N,) bool: motions for which `time` is one of a collision."""
        return ~np.isnan(self.time)

    @property
    def is_open(self) -> np.ndarray:
        """(N,) bool: motions neither proven free nor colliding."""
        return ~self.free & np.isnan(self.time)

    @property
    def open_names(self) -> list[tuple[str, str]]:
        """Names of both bodies of each open interval."""
        return [
            (self._bodies[a], self._bodies[b] if b >= 0 else self._around[-1 - b])
            for a, b in zip(self.open["a"].tolist(), self.open["b"].tolist())
        ]

    def __len__(self) -> int:
        return len(self.free)

    def __repr__(self) -> str:
        return (
            f"CertifiedEdges({len(self)} motions: {int(self.free.sum())} proven free, {int(self.collides.sum())} collide, "
            f"{int(self.is_open.sum())} open)"
        )


def sampled_collision(
    q0: np.ndarray, q1: np.ndarray, step: float, collides: Callable[[np.ndarray], np.ndarray],
    n_halvings: int | None = None,
) -> np.ndarray:  # fmt: skip
    """(N,) a t at which each motion collides, NaN where none of its samples does.

    Ends first, then the middle, then quarters, …, until no column changes by more than ``step``; motions that were
    hit are not asked again.   n_halvings : at most so often.
    """
    times = np.full(len(q0), np.nan)
    change = np.abs(q1 - q0).max(axis=1, initial=0.0)
    needed = np.ceil(np.log2(np.maximum(change / step, 1.0))).astype(np.int64)
    if n_halvings is not None:
        needed = np.minimum(needed, n_halvings)
    for level in range(-1, int(needed.max(initial=-1)) + 1):
        alive = np.flatnonzero(np.isnan(times) & (needed >= level))
        ts = np.array([0.0, 1.0]) if level < 0 else (np.arange(2 ** max(level - 1, 0)) + 0.5) / 2 ** max(level - 1, 0)
        if level == 0:
            continue  # the ends are all of a motion that is not halved
        for t in ts.tolist():
            alive = alive[np.isnan(times[alive])]
            if not len(alive):
                break
            q = q0[alive] + t * (q1[alive] - q0[alive]) if t < 1.0 else q1[alive]
            times[alive[collides(np.ascontiguousarray(q))]] = t
    return times


def certify(
    checker: RobotChecker, q0: np.ndarray, q1: np.ndarray, resolution: float, threads: int, progress
) -> CertifiedEdges:
    """`RobotChecker.certify_edges` of checked arguments (N, dof)."""
    times = sampled_collision(q0, q1, resolution, lambda q: checker.collides(q, threads=threads), _SAMPLED_HALVINGS)
    left = np.flatnonzero(np.isnan(times))
    verdicts, later = np.full(len(left), IS_PROVEN, dtype=np.uint8), np.full(len(left), np.nan)
    ends = np.ascontiguousarray(q0[left]), np.ascontiguousarray(q1[left])
    kept: list[np.ndarray] = []
    counts: list[int] = []

    def on_piece(space: CheckWorkspace, piece: slice) -> None:
        work = _motion_workspace(checker, resolution)
        done, last = piece.start, piece.stop
        while done < last:
            part = slice(done, last)
            n = certify_motions(
                space.address, work.address, address_of(ends[0][part]), address_of(ends[1][part]), checker.robot.dof, 0,
                last - done, address_of(verdicts[part]), address_of(later[part]),
            )  # fmt: skip
            kept.append(_open_rows(work.open_intervals, left[done:]))
            if n == 0:
                work.grow()
            done += n
        counts.append(work.n_checked)

    checker._in_pieces(len(left), threads, progress, on_piece)
    times[left] = np.where(verdicts == COLLIDES_AT, later, np.nan)
    free = np.zeros(len(q0), dtype=bool)
    free[left[verdicts == IS_PROVEN]] = True
    rows = np.concatenate([np.zeros(0, dtype=OPEN_DTYPE), *kept])
    is_open = np.zeros(len(q0), dtype=bool)
    is_open[left[verdicts == STAYS_OPEN]] = True
    rows = rows[is_open[rows["edge"]]]
    rows = rows[np.lexsort((rows["begin"], rows["edge"]))]
    return CertifiedEdges(free, times, rows, sum(counts), checker.bodies, checker.around)


def _open_rows(intervals: np.ndarray, edges: np.ndarray) -> np.ndarray:
    rows = np.zeros(len(intervals), dtype=OPEN_DTYPE)
    rows["edge"] = edges[intervals[:, 0].astype(np.int64)]
    rows["begin"], rows["end"] = intervals[:, 1], intervals[:, 2]
    rows["a"], rows["b"] = intervals[:, 3], intervals[:, 4]
    return rows


def _motion_workspace(checker: RobotChecker, resolution: float) -> MotionWorkspace:
    robot: Any = checker.robot
    number = {joint.name: k for k, joint in enumerate(robot.sorted_joints)}
    paths = paths_to_root(robot, [body.link for body in checker._bodies])
    pairs = checker._filters.self_pairs
    between = np.zeros((max(len(pairs), 1), 2), dtype=np.int64)
    for k, (a, b) in enumerate(pairs.tolist()):
        shared = set(paths[a]) & set(paths[b])
        between[k] = len(paths[a]) - len(shared), len(paths[b]) - len(shared)
    reach = float(np.abs(checker._tables.body_boxes).sum(axis=1).max()) + float(np.abs(checker._X_WR[:3, 3]).sum())
    reach += float(np.abs(robot.joint_table.doubles[:, 9:12]).sum())
    return MotionWorkspace(
        [np.array([number[name] for name in path], dtype=np.int64) for path in paths], between, robot.dof,
        checker.n_pairs, resolution, _ROUNDING * reach,
    )  # fmt: skip
