"""Straight motions sampled and certified: from a checker's questions to one verdict each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from collide.errors import InvalidArgument
from collide.kernels import address_of
from collide.robots.certify_meshes import settle_meshes
from collide.robots.certify_motions import certify_motions
from collide.robots.check_tables import UNBOUNDED_HALF
from collide.robots.check_workspace import CheckWorkspace, MotionWorkspace
from collide.robots.checker_scene import CheckerScene
from collide.robots.motion_bounds import OPEN_INTERVAL
from collide.robots.robot_bodies import paths_to_root

#: Before anything is proven, motions are asked at their ends and, so many times halved, in between.
SAMPLED_HALVINGS = 2
#: A motion that is sampled alone is halved at most so often: 2^30 samples take an hour.
_MAX_HALVINGS = 30
#: Roundings of forward kinematics, as a share of where links are and how far they reach.
_ROUNDING = 2.0**-40

#: An open interval of a motion.
OPEN_DTYPE = np.dtype([("edge", "i8"), ("begin", "f8"), ("end", "f8")])


@dataclass(frozen=True)
class CertifiedEdges:
    """Verdicts on straight motions q(t) = Q0 + t (Q1 − Q0), 0 ≤ t ≤ 1: free, colliding, or open.

    Parameters
    ----------
    free : (N,) bool
        Proven: no tested pair meets at any t.
    time : (N,) float64
        A t at which the motion collides, not always the first; NaN where no collision was met.
    open : (k,) OPEN_DTYPE
        Intervals of t neither proven free nor hit, at the resolution asked: ``edge``, ``begin``, ``end``.
    open_names : list of (str, str)
        For each open interval two bodies not proven apart.
    n_checked : int
        Configurations asked for proofs; the samples before are not counted.
    """

    free: np.ndarray
    time: np.ndarray
    open: np.ndarray
    open_names: list[tuple[str, str]]
    n_checked: int

    @property
    def collides(self) -> np.ndarray:
        """(N,) bool: motions with a collision ``time``."""
        return ~np.isnan(self.time)

    @property
    def is_open(self) -> np.ndarray:
        """(N,) bool: motions neither proven free nor colliding."""
        return ~self.free & np.isnan(self.time)

    def __len__(self) -> int:
        return len(self.free)

    def __repr__(self) -> str:
        return (
            f"CertifiedEdges({len(self)} motions: {int(self.free.sum())} proven free, {int(self.collides.sum())} "
            f"collide, {int(self.is_open.sum())} open)"
        )


def sampled_collision(
    q0: np.ndarray, q1: np.ndarray, step: float, collides: Callable[[np.ndarray], np.ndarray],
    n_halvings: int | None = None,
) -> np.ndarray:
    """(N,) a t at which each motion collides, NaN where all samples are free.

    Ends first, then the middle, then quarters, …, until no column changes by more than ``step``; a motion is asked no
    more after its first hit.   n_halvings : the most halvings.
    """
    times = np.full(len(q0), np.nan)
    change = np.abs(q1 - q0).max(axis=1, initial=0.0)
    with np.errstate(over="ignore"):
        needed = np.minimum(np.ceil(np.log2(np.maximum(change / step, 1.0))), 2000.0).astype(np.int64)
    if n_halvings is None and needed.max(initial=0) > _MAX_HALVINGS:
        k = int(needed.argmax())
        raise InvalidArgument(
            f"RobotChecker: from Q0 to Q1, motion {k} changes a column by {change[k]:g} [rad or m]: in steps of "
            f"{step:g} that is more than 2^{_MAX_HALVINGS} samples; take a larger resolution"
        )
    if n_halvings is not None:
        needed = np.minimum(needed, n_halvings)
    for level in range(-1, int(needed.max(initial=-1)) + 1):
        if level == 0:
            continue  # the ends are all of a motion that is not halved
        alive = np.flatnonzero(np.isnan(times) & (needed >= level))
        n_samples = 2 if level < 0 else 2 ** (level - 1)
        for k in range(n_samples):  # in sequence: up to 2^29 samples, and the first may be a hit
            t = float(k) if level < 0 else (k + 0.5) / n_samples
            alive = alive[np.isnan(times[alive])]
            if not len(alive):
                break
            q = q0[alive] + t * (q1[alive] - q0[alive]) if t < 1.0 else q1[alive]
            times[alive[collides(np.ascontiguousarray(q))]] = t
    return times


def certify(
    checker: CheckerScene, q0: np.ndarray, q1: np.ndarray, times: np.ndarray, resolution: float, threads: int, progress
) -> CertifiedEdges:
    """`RobotChecker.certify_edges` of checked arguments (N, dof).

    times : (N,) of known collisions, NaN for motions to be certified; filled in.
    """
    remaining = np.flatnonzero(np.isnan(times))
    ends = np.ascontiguousarray(q0[remaining]), np.ascontiguousarray(q1[remaining])
    later = np.full(len(remaining), np.nan)
    open_rows: list[np.ndarray] = [np.zeros((0, OPEN_INTERVAL))]
    counts: list[int] = []

    def on_piece(space: CheckWorkspace, piece: slice) -> None:
        work = _motion_workspace(checker, resolution)
        begin, end, hit_at = ends[0][piece], ends[1][piece], later[piece]
        intervals, meshes = _certify_piece(space, work, begin, end, hit_at)
        of_meshes = settle_meshes(checker, space, work, begin, end, meshes, hit_at, resolution)
        rows = np.concatenate([intervals, *of_meshes])
        rows[:, 0] += piece.start
        open_rows.append(rows)
        counts.append(work.n_checked)

    checker.in_pieces(len(remaining), threads, progress, on_piece)
    times[remaining] = later
    rows = np.concatenate(open_rows)
    rows = rows[np.isnan(later[rows[:, 0].astype(np.int64)])]
    rows[:, 0] = remaining[rows[:, 0].astype(np.int64)]
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    free = np.isnan(times)
    out = np.zeros(len(rows), dtype=OPEN_DTYPE)
    out["edge"], out["begin"], out["end"] = rows[:, :3].T
    free[out["edge"]] = False
    names = [_names_of(checker, int(body), int(partner)) for body, partner in rows[:, 3:].tolist()]
    return CertifiedEdges(free, times, out, names, sum(counts))


def _certify_piece(space: CheckWorkspace, work: MotionWorkspace, q0, q1, times) -> tuple[np.ndarray, np.ndarray]:
    """(open intervals, pairs of meshes), (k, OPEN_INTERVAL) each, of some motions; ``times`` of collisions written."""
    open_rows, meshes = [np.zeros((0, OPEN_INTERVAL))], [np.zeros((0, OPEN_INTERVAL))]
    done = 0
    while done < len(q0):
        before, done = done, certify_motions(
            space.address, work.address, address_of(q0), address_of(q1), q0.shape[1], done, len(q0), address_of(times)
        )
        open_rows.append(work.open_intervals.copy())
        meshes.append(work.mesh_pairs.copy())
        if done == before:
            work.grow()
    return np.concatenate(open_rows), np.concatenate(meshes)


def _names_of(checker: CheckerScene, body: int, partner: int) -> tuple[str, str]:
    """Of a body and its partner as `motion_bounds.py` has them."""
    if body >= 0:
        return checker.names_of(body, partner)
    return checker.names_of(*checker.setting.self_pairs[partner].tolist())


def _motion_workspace(checker: CheckerScene, resolution: float) -> MotionWorkspace:
    """Paths of joints from each body to the root, and how many of them stand between the bodies of each pair."""
    robot, setting = checker.robot, checker.setting
    number = {joint.name: k for k, joint in enumerate(robot.sorted_joints)}
    paths = paths_to_root(robot, [body.link for body in setting.bodies])
    between = np.zeros((max(len(setting.self_pairs), 1), 2), dtype=np.int64)
    for k, (a, b) in enumerate(setting.self_pairs.tolist()):
        shared = set(paths[a]) & set(paths[b])
        between[k] = len(paths[a]) - len(shared), len(paths[b]) - len(shared)
    # Where a body without end meets another of the robot, roundings are as large as the other reaches.
    boxes = np.abs(setting.tables.body_boxes)
    reach = float(boxes[boxes.max(axis=1) < UNBOUNDED_HALF].sum(axis=1).max(initial=0.0))
    reach += float(np.abs(setting.base[9:]).sum())
    reach += float(np.abs(robot.joint_table.doubles[:, 9:12]).sum())
    return MotionWorkspace(
        [np.array([number[name] for name in path], dtype=np.int64) for path in paths], between, robot.dof,
        checker.n_pairs, resolution, _ROUNDING * reach,
    )
