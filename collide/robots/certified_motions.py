"""Paths and splines certified: verdicts on the segments of one motion in time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from collide.errors import InvalidArgument, cut
from collide.robots.certified_edges import OPEN_DTYPE, Verdicts, open_names, prove
from collide.robots.checker_scene import CheckerScene
from collide.robots.configuration_batches import check_piece
from collide.robots.kinematic_tree import COLUMNS
from collide.robots.robot import Robot
from collide.robots.splines import Spline

_FULL_CIRCLE = 2.0 * np.pi
_NONE_OPEN = np.zeros(0, dtype=OPEN_DTYPE)


@dataclass(frozen=True)
class CertifiedMotion(Verdicts):
    """Verdicts on the segments of a motion, in its own time: proven free, colliding, or open.

    Parameters
    ----------
    breaks : (M + 1,) float64
        Times at which segments begin and end, as of the motion: of a path without times 0, 1, 2, ….
    free : (M,) bool
        Proven: no tested pair meets at any time of the segment.
    time : (M,) float64
        The earliest known collision of each segment; NaN where none was met. What lies before is proven free but for
        ``open`` intervals, what lies behind in the segment was not looked at.
    open : (k,) OPEN_DTYPE
        Intervals of time neither proven free nor hit, at the resolution asked: ``edge`` is the segment.
    open_names : list of (str, str)
        For each open interval two bodies not proven apart.
    lengths : (M,) float64
        Of segments, for `share`: durations, of a path without times the largest change of a column [rad or m].
    n_checked : int
        Configurations asked for proofs.
    """

    breaks: np.ndarray
    free: np.ndarray
    time: np.ndarray
    open: np.ndarray
    open_names: list[tuple[str, str]]
    lengths: np.ndarray
    n_checked: int

    @property
    def is_free(self) -> bool:
        """Whether all of the motion is proven free."""
        return bool(self.free.all())

    @cached_property
    def proven(self) -> np.ndarray:
        """(M,) float64: share of each segment's time that is proven free, 0 … 1."""
        durations = np.diff(self.breaks)
        seen = np.where(self.collides, self.time - self.breaks[:-1], durations)
        unproven = np.zeros(len(durations))
        np.add.at(unproven, self.open["edge"], self.open["end"] - self.open["begin"])
        shares = np.clip((seen - unproven) / durations, 0.0, 1.0)
        return np.where(self.free, 1.0, np.minimum(shares, np.nextafter(1.0, 0.0)))

    @cached_property
    def share(self) -> float:
        """Share of the motion that is proven free, segments counted by their ``lengths``; 1.0 where all is proven."""
        if self.is_free:
            return 1.0
        total = float(self.lengths.sum())
        weights = self.lengths / total if total > 0.0 else np.full(len(self.lengths), 1.0 / len(self.lengths))
        return float(min(weights @ self.proven, np.nextafter(1.0, 0.0)))

    @property
    def first(self) -> tuple[int, float] | None:
        """(segment, time) of the earliest known collision; ``None`` where none is known."""
        segments = np.flatnonzero(self.collides)
        return (int(segments[0]), float(self.time[segments[0]])) if len(segments) else None

    def __len__(self) -> int:
        return len(self.free)

    def __repr__(self) -> str:
        first = "no collision known"
        if self.first is not None:
            first = f"collides at {self.first[1]:g}, segment {self.first[0]}"
        return (
            f"CertifiedMotion({len(self)} segments: {int(self.free.sum())} proven free, {int(self.collides.sum())} "
            f"collide, {int(self.is_open.sum())} open; {self.share:.4%} proven, {first})"
        )


def certify_pieces(
    checker: CheckerScene, spline: Spline, breaks: np.ndarray, lengths: np.ndarray, resolution: float, threads: int,
    progress,
) -> CertifiedMotion:
    """A spline of the robot's columns proven, its earliest collisions wanted.

    breaks : (M + 1,) of the segments told, of those of the spline.   lengths : (M,) of `CertifiedMotion`.
    """
    points, begins, durations = spline.control_points, spline.breaks[:-1], np.diff(spline.breaks)
    # A piece that begins in a collision collides at its begin: halving would come no nearer than the resolution.
    ends, is_hit = np.ascontiguousarray(points[:, 0]), np.zeros(len(points), dtype=bool)
    checker.in_pieces(
        len(points), threads, None, lambda space, piece: check_piece(checker, space, ends[piece], is_hit[piece])
    )
    shares = np.where(is_hit, 0.0, np.nan)
    asked = np.flatnonzero(np.isnan(shares))
    later = np.full(len(asked), np.nan)
    rows, n_checked = prove(
        checker, np.ascontiguousarray(points[asked]), np.ascontiguousarray(spline.errors[asked]), later, resolution,
        threads, progress, lambda space, work, piece: work.ask_about_curves(spline.degree),
    )
    shares[asked] = later
    if not len(rows) and np.isnan(shares).all():
        free = np.ones(len(breaks) - 1, dtype=bool)
        return CertifiedMotion(breaks, free, np.full(len(free), np.nan), _NONE_OPEN, [], lengths, n_checked)
    pieces = asked[rows[:, 0].astype(np.int64)]
    segment_of = np.searchsorted(breaks, begins, "right") - 1
    times = np.full(len(breaks) - 1, np.nan)
    np.fmin.at(times, segment_of, begins + shares * durations)
    out = np.zeros(len(rows), dtype=OPEN_DTYPE)
    out["edge"] = segment_of[pieces]
    out["begin"], out["end"] = (begins[pieces] + rows[:, k] * durations[pieces] for k in (1, 2))
    is_before = ~(out["begin"] >= times[out["edge"]])
    rows, out = rows[is_before], out[is_before]
    free = np.isnan(times)
    free[out["edge"]] = False
    return CertifiedMotion(breaks, free, times, out, open_names(checker, rows), lengths, n_checked)


def wrapping_columns(robot: Robot) -> np.ndarray:
    """(dof,) bool: columns in which a full turn changes no link's pose.

    Values of continuous joints, unless a follower slides or turns by a broken multiple; yaws of planar joints; angles
    of floating joints.
    """
    index = {name: k for k, name in enumerate(robot.joint_names)}
    wraps = np.zeros(robot.dof, dtype=bool)
    for joint in robot.joints:
        if joint.type == "continuous" and joint.mimic is None:
            wraps[index[joint.name]] = True
        for suffix in COLUMNS[joint.type]:
            if suffix in ("/roll", "/pitch", "/yaw"):
                wraps[index[joint.name + suffix]] = True
    for joint in robot.joints:
        if joint.mimic is not None and len(COLUMNS[joint.type]) == 1:
            driver, multiplier, _ = robot._drivers[joint.name]
            if joint.type == "prismatic" or multiplier != round(multiplier):
                wraps[index[driver]] = False
    return wraps


def shortest_ways(robot: Robot, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """(N, dof) ends of motions from q0: those of q1 with whole turns taken off where a column `wraps`."""
    wraps, q1 = wrapping_columns(robot), q1.copy()
    change = q1[:, wraps] - q0[:, wraps]
    turns = np.round(change / _FULL_CIRCLE)
    q1[:, wraps] -= turns * _FULL_CIRCLE
    return q1


def refuse_degrees(robot: Robot, what: str, q: np.ndarray) -> None:
    """Refuse configurations (N, dof) in which every turn with limits leaves its limits, and by more than two turns.

    Raises InvalidArgument.
    """
    if not np.abs(q).max(initial=0.0) > 2.0 * _FULL_CIRCLE:
        return
    turns = {joint.name for joint in robot.joints if joint.type == "revolute"}
    columns = [k for k, name in enumerate(robot.joint_names) if name in turns and np.isfinite(robot.upper[k])]
    if not columns:
        return
    low, high = q[:, columns].min(axis=0), q[:, columns].max(axis=0)
    leaves = (high > robot.upper[columns]) | (low < robot.lower[columns])
    largest = np.maximum(np.abs(low), np.abs(high))
    if leaves.all() and largest.max() > 2.0 * _FULL_CIRCLE:
        k = int(largest.argmax())
        raise InvalidArgument(
            f"{what}: joint {cut(robot.joint_names[columns[k]])} reaches {largest[k]:g} rad, "
            f"{largest[k] / _FULL_CIRCLE:.0f} turns, and all joints with limits leave them: are these degrees? "
            "Give radians (numpy.radians)"
        )
