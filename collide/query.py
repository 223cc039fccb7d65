"""Pair queries: two shapes at one pair of poses, or at many."""

from __future__ import annotations

import math

import numpy as np

from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery
from collide.geometry.tables import ShapeTable, pose_table
from collide.narrowphase.run import run_pairs
from collide.results import PairResult
from collide.shapes.base import Shape
from collide.transforms import as_poses
from collide.unions import Union, combine


def collide(A: Shape, B: Shape, X_WA, X_WB, *, check_poses: bool = True):
    """Whether the closed sets A and B share a point.

    Parameters
    ----------
    A, B : shapes.
    X_WA, X_WB : (4, 4) poses in the world, or batches (N, 4, 4); a single pose goes with every
        pose of the other's batch. ``(R, t)`` tuples are accepted.
    check_poses : refuse matrices that are no rotation.

    Returns
    -------
    bool for single poses, bool[N] otherwise. Touching is a hit; where rounding leaves the sign
    open (`PairResult.how` is "undecided"), the answer is True.

    Raises InvalidPose, InvalidArgument.
    """
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB, check_poses)
    hits = _rows(A, B, X_WA, X_WB, boolean=True, limit=0.0)["hit"]
    return bool(hits[0]) if single else hits


def distance(A: Shape, B: Shape, X_WA, X_WB, *, max_distance: float = math.inf, check_poses: bool = True):
    """Signed distance of A and B, with witness points, normal and a proven bracket.

    Parameters
    ----------
    A, B, X_WA, X_WB, check_poses : as in `collide`.
    max_distance : [m], ≥ 0. Beyond it only a proven lower bound is worked out, and ``beyond`` is set.

    Returns
    -------
    PairResult : scalars for single poses, arrays with a leading N otherwise.

    Raises InvalidPose, InvalidArgument; UnsupportedQuery where the depth has no end (half-space in
    half-space).
    """
    limit = check_distance("max_distance", max_distance)
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB, check_poses)
    rows = _rows(A, B, X_WA, X_WB, boolean=False, limit=limit)
    endless = np.isneginf(rows["distance"])
    if endless.any():
        where = "" if single else f" (pose {int(np.argmax(endless))} of the batch)"
        raise UnsupportedQuery(
            f"distance of {type(A).__name__} and {type(B).__name__}{where}: their overlap has no end, so no "
            "translation of finite length separates them; collide() still answers"
        )
    return PairResult(rows, single, (A, B, X_WA, X_WB))


def check_distance(name: str, value) -> float:
    """A distance limit [m]: a number ≥ 0, infinity allowed."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidArgument(f"{name} must be a number ≥ 0 [m], got {value!r}") from None
    if not number >= 0.0:
        raise InvalidArgument(f"{name} must be ≥ 0 [m], got {value!r}")
    return number


def _poses(A, B, X_WA, X_WB, check: bool):
    for name, shape in (("A", A), ("B", B)):
        if not isinstance(shape, Shape):
            raise InvalidArgument(f"{name} must be a shape, for example collide.Box((1, 1, 1)), got {shape!r}")
    single = _is_single(X_WA) and _is_single(X_WB)
    X_WA, X_WB = as_poses(X_WA, "X_WA", check=check), as_poses(X_WB, "X_WB", check=check)
    if len(X_WA) != len(X_WB):
        if 1 not in (len(X_WA), len(X_WB)):
            raise InvalidPose(f"X_WA has {len(X_WA)} poses and X_WB {len(X_WB)}: batches must match, or one be single")
        n = max(len(X_WA), len(X_WB)) if min(len(X_WA), len(X_WB)) else 0
        X_WA, X_WB = (X if len(X) == n else np.broadcast_to(X[:n], (n, 4, 4)) for X in (X_WA, X_WB))
    return X_WA, X_WB, single


def _is_single(X) -> bool:
    if isinstance(X, tuple):
        return all(np.ndim(part) == dimensions for part, dimensions in zip(X, (2, 1)))
    return np.ndim(X) == 2


def _rows(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, boolean: bool, limit: float) -> np.ndarray:
    """One row a pose: every part of A against every part of B, combined."""
    parts_a, parts_b = A.parts(), B.parts()
    parts = [*parts_a, *parts_b]
    n, many = len(X_WA), len(parts_a) * len(parts_b)
    X_WBs = np.concatenate([np.concatenate([X_WA] * len(parts_a)), np.concatenate([X_WB] * len(parts_b))])
    X_BPs = np.repeat(np.array([X for _, X in parts]), n, axis=0)
    poses = pose_table(X_WBs, X_BPs, np.repeat([packed.reach for packed, _ in parts], n))
    # Part k stands at rows k·n … k·n + n − 1 of the pose table; pairs of one pose stand together.
    which = np.arange(n)[:, None, None] + n * np.zeros((1, len(parts_a), len(parts_b)), dtype=np.int64)
    first = which + n * np.arange(len(parts_a))[None, :, None]
    second = which + n * (len(parts_a) + np.arange(len(parts_b)))[None, None, :]
    table = ShapeTable([packed for packed, _ in parts])
    pairs = np.stack([first.ravel(), second.ravel()], axis=1)
    rows = run_pairs(table, poses, np.repeat(np.arange(len(parts)), n), pairs, boolean=boolean, limit=limit)
    rows["b"] = 1
    if many == 1:
        return rows
    rows["part_a"], rows["part_b"] = first.ravel() // max(n, 1), second.ravel() // max(n, 1) - len(parts_a)

    def sides(k: int) -> tuple[Union, Union]:
        own = poses.rows.reshape(len(parts), n, -1)[:, k]
        return (
            Union([packed for packed, _ in parts_a], own[: len(parts_a)]),
            Union([packed for packed, _ in parts_b], own[len(parts_a) :]),
        )

    if boolean:
        hits = rows["hit"].reshape(n, many).any(axis=1)
        rows = rows[::many].copy()
        rows["hit"] = hits
        return rows
    return combine(rows, np.arange(0, n * many, many), np.ones(n, dtype=bool), sides)
