"""Straight motions sampled and certified: from a checker's questions to one verdict each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from collide.errors import InvalidArgument
from collide.kernels import address_of
from collide.robots.certify_meshes import settle_meshes
from collide.robots.certify_motions import certify_motions
from collide.robots.check_workspace import CheckWorkspace, MotionWorkspace
from collide.robots.checker_scene import CheckerScene
from collide.robots.motion_bounds import OPEN_INTERVAL
from collide.robots.open_pairs import are_hits
from collide.robots.sample_motions import CURSOR, MOTION, N_OPEN_SAMPLES, sample_motions

#: Before anything is proven, motions are asked at their ends and, so many times halved, in between.
_SAMPLED_HALVINGS = 2
#: A motion that is sampled alone is halved at most so often: 2^30 samples take an hour.
_MAX_HALVINGS = 30
#: An open interval of a motion.
OPEN_DTYPE = np.dtype([("edge", "i8"), ("begin", "f8"), ("end", "f8")])


class Verdicts:
    """Motions, or segments of a motion, in arrays: free, colliding at a time, or open."""

    free: np.ndarray
    time: np.ndarray

    @property
    def collides(self) -> np.ndarray:
        """(N,) bool: motions with a collision ``time``."""
        return ~np.isnan(self.time)

    @property
    def is_open(self) -> np.ndarray:
        """(N,) bool: motions neither proven free nor colliding."""
        return ~self.free & np.isnan(self.time)


@dataclass(frozen=True)
class CertifiedEdges(Verdicts):
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

    def __len__(self) -> int:
        return len(self.free)

    def __repr__(self) -> str:
        return (
            f"CertifiedEdges({len(self)} motions: {int(self.free.sum())} proven free, {int(self.collides.sum())} "
            f"collide, {int(self.is_open.sum())} open)"
        )


def sampled_collision(
    checker: CheckerScene, q0: np.ndarray, q1: np.ndarray, step: float, threads: int,
    max_halvings: int | None = None,
) -> np.ndarray:
    """(N,) a t at which each motion collides, NaN where all samples are free.

    Ends first, then the middle, then quarters, …, until no column changes by more than ``step``; a motion is asked no
    more after its first hit.   max_halvings : the most halvings.
    """
    times = np.full(len(q0), np.nan)
    if max_halvings is None:
        _refuse_too_many(q0, q1, step)
        max_halvings = _MAX_HALVINGS

    def on_piece(space: CheckWorkspace, piece: slice) -> None:
        sample_piece(checker, space, q0[piece], q1[piece], step, max_halvings, times[piece])

    checker.in_pieces(len(q0), threads, None, on_piece)
    return times


def sample_piece(
    checker: CheckerScene, space: CheckWorkspace, q0: np.ndarray, q1: np.ndarray, step: float, max_halvings: int,
    times: np.ndarray,
) -> None:
    """Write ``times`` (n,), NaN before, of motions with a sample in collision."""
    dof, cursor = q0.shape[1], np.zeros(CURSOR, dtype=np.int64)
    q, samples = space.sample
    while cursor[MOTION] < len(q0):
        sample_motions(
            space.address, address_of(q0), address_of(q1), dof, len(q0), step, max_halvings, address_of(q),
            address_of(cursor), address_of(samples), address_of(times),
        )
        if cursor[N_OPEN_SAMPLES]:
            space.ask_meshes(checker.setting)
            _settle_samples(checker, space, q0, q1, samples[: cursor[N_OPEN_SAMPLES]], times)
            here = cursor[MOTION]
            if here < len(q0) and not np.isnan(times[here]):
                cursor[:N_OPEN_SAMPLES] = here + 1, 0


def _settle_samples(
    checker: CheckerScene, space: CheckWorkspace, q0: np.ndarray, q1: np.ndarray, samples: np.ndarray, times: np.ndarray
) -> None:
    """Ask the pairs that samples left to others (k, OPEN_SAMPLE), in the order of the samples."""
    motions, at = samples[:, 0].astype(np.int64), samples[:, 1]
    q = np.where(at[:, None] < 1.0, q0[motions] + at[:, None] * (q1[motions] - q0[motions]), q1[motions])
    hits = np.zeros(len(samples), dtype=bool)
    pairs = space.open_pairs
    setting = checker.setting
    meets = are_hits(pairs, checker.link_poses(q), setting.bodies, setting.surroundings.bodies, once=True)
    hits[pairs[meets, 0]] = True
    for k in np.flatnonzero(hits)[::-1].tolist():  # the first of a motion is written last
        times[motions[k]] = at[k]


def _refuse_too_many(q0: np.ndarray, q1: np.ndarray, step: float) -> None:
    change = np.abs(q1 - q0).max(axis=1, initial=0.0)
    if change.max(initial=0.0) / step > 2.0**_MAX_HALVINGS:
        k = int(change.argmax())
        raise InvalidArgument(
            f"RobotChecker: from Q0 to Q1, motion {k} changes a column by {change[k]:g} [rad or m]: in steps of "
            f"{step:g} that is more than 2^{_MAX_HALVINGS} samples; take a larger resolution"
        )


def certify(
    checker: CheckerScene, q0: np.ndarray, q1: np.ndarray, resolution: float, threads: int, progress
) -> CertifiedEdges:
    """`RobotChecker.certify_edges` of checked arguments (N, dof)."""
    times = np.full(len(q0), np.nan)

    def sample(space: CheckWorkspace, work: MotionWorkspace, piece: slice) -> None:
        sample_piece(checker, space, q0[piece], q1[piece], resolution, _SAMPLED_HALVINGS, times[piece])

    rows, n_checked = prove(checker, q0, q1, times, resolution, threads, progress, sample)
    free = np.isnan(times)
    out = np.zeros(len(rows), dtype=OPEN_DTYPE)
    out["edge"], out["begin"], out["end"] = rows[:, :3].T
    free[out["edge"]] = False
    return CertifiedEdges(free, times, out, open_names(checker, rows), n_checked)


def prove(
    checker: CheckerScene, q0: np.ndarray, q1: np.ndarray, times: np.ndarray, resolution: float, threads: int,
    progress, begin: Callable[[CheckWorkspace, MotionWorkspace, slice], None],
) -> tuple[np.ndarray, int]:
    """(rows of what stays open, configurations asked) of motions q0 and q1, as of `certify_motions`; ``times`` (N,) of
    collisions, NaN so far, are written.

    begin : called first with each piece of the motions: tells the workspace their kind, or samples them.
    Rows, (k, OPEN_INTERVAL or more), are sorted by motion and begin, and end at the latest at a known collision.
    """
    open_rows: list[np.ndarray] = []
    counts: list[int] = []

    def on_piece(space: CheckWorkspace, piece: slice) -> None:
        work, hit_at = space.motions(resolution), times[piece]
        space.ask_meshes(checker.setting)
        begin(space, work, piece)
        intervals, meshes = _certify_piece(space, work, q0[piece], q1[piece], hit_at)
        rows = [intervals] if len(intervals) else []
        if len(meshes):
            rows += settle_meshes(checker, space, work, q0[piece], q1[piece], meshes, hit_at, resolution)
        counts.append(work.n_checked)
        for some in rows:
            known = hit_at[some[:, 0].astype(np.int64)]
            some[:, 2] = np.fmin(some[:, 2], known)
            some[:, 0] += piece.start
            open_rows.append(some[np.isnan(known) | (work.is_earliest & (some[:, 1] < known))])

    checker.in_pieces(len(q0), threads, progress, on_piece)
    if not open_rows:
        return np.zeros((0, OPEN_INTERVAL)), sum(counts)
    rows = np.concatenate(open_rows)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))], sum(counts)


def _certify_piece(space: CheckWorkspace, work: MotionWorkspace, q0, q1, times) -> tuple[np.ndarray, np.ndarray]:
    """(open intervals, pairs of meshes), (k, OPEN_INTERVAL or more) each, of motions without a time, q0 and q1 as of
    `certify_motions`; ``times`` of collisions written.
    """
    open_rows, meshes = [], []
    done = 0
    while done < len(q0):
        before, done = done, certify_motions(
            space.address, work.address, address_of(q0), address_of(q1), q0.shape[-1], done, len(q0), address_of(times)
        )
        open_rows.append(work.open_intervals.copy())
        meshes.append(work.mesh_pairs.copy())
        if done == before:
            work.grow()
    if len(open_rows) == 1:
        return open_rows[0], meshes[0]
    return tuple(np.concatenate(rows or [work.open_intervals[:0]]) for rows in (open_rows, meshes))  # type: ignore


def open_names(checker: CheckerScene, rows: np.ndarray) -> list[tuple[str, str]]:
    """Names of both bodies of each open row."""
    return [_names_of(checker, int(body), int(partner)) for body, partner in rows[:, 3:5].tolist()]


def _names_of(checker: CheckerScene, body: int, partner: int) -> tuple[str, str]:
    """Of a body and its partner as `motion_bounds.py` has them."""
    if body >= 0:
        return checker.names_of(body, partner)
    return checker.names_of(*checker.setting.self_pairs[partner].tolist())
