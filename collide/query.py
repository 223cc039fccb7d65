"""Pair queries: two shapes at one pair of poses, or at many."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery
from collide.geometry.tables import ShapeTable, pose_table
from collide.narrowphase import run
from collide.narrowphase.poses import collide_single
from collide.results import PAIR_DTYPE, PairResult
from collide.shapes.base import IDENTITY, Shape
from collide.transforms import as_poses
from collide.unions import Union, combine


def collide(A, B, X_WA, X_WB, *, check_poses: bool = True, threads: int = 1):
    """Whether the closed sets A and B share a point.

    Parameters
    ----------
    A, B : shapes; or sequences of shapes, one a pose, and then X_WA and X_WB are batches of that length.
    X_WA, X_WB : (4, 4) poses in the world, or batches (N, 4, 4); a single pose goes with every
        pose of the other's batch. ``(R, t)`` tuples are accepted.
    check_poses : refuse matrices that are no rotation.
    threads : answer a batch in this many threads; the answers are the same bits.

    Returns
    -------
    bool for single poses, bool[N] otherwise. Touching is a hit; where rounding leaves the sign
    open (`PairResult.how` is "undecided"), the answer is True.

    Raises InvalidPose, InvalidArgument.
    """
    try:
        hit = collide_single.ready(A._prepared[id(B)].address, X_WA, X_WB)
        if hit >= 0:
            return hit == 1
    except (AttributeError, KeyError, TypeError):
        pass  # not prepared yet, not single, not float64, not shapes: the long way answers, or says what is wrong
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB)
    if single:
        _prepare(A, B)
    hits = _ask(A, B, X_WA, X_WB, True, 0.0, check_poses, threads)
    return bool(hits[0]) if single else hits


def distance(
    A, B, X_WA, X_WB, *, max_distance: float = math.inf, check_poses: bool = True, threads: int = 1
) -> PairResult:
    """Signed distance of A and B, with witness points, normal and a proven bracket.

    Parameters
    ----------
    A, B, X_WA, X_WB, check_poses, threads : as in `collide`.
    max_distance : [m], ≥ 0. Beyond it only a proven lower bound is worked out, and ``beyond`` is set.

    Returns
    -------
    PairResult : scalars for single poses, arrays with a leading N otherwise.

    Raises InvalidPose, InvalidArgument; UnsupportedQuery where the depth has no end (half-space in
    half-space).
    """
    limit = check_distance("max_distance", max_distance)
    if limit == math.inf:
        try:
            rows = A._prepared[id(B)].distance(X_WA, X_WB)
            if rows is not None:
                return PairResult(rows, True, (A, B, X_WA.copy()[None], X_WB.copy()[None]))
        except (AttributeError, KeyError, TypeError):
            pass  # as in `collide`
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB)
    X_WA, X_WB = X_WA.copy(), X_WB.copy()  # a certificate worked out later is one for these poses
    if single:
        _prepare(A, B)
    rows = _ask(A, B, X_WA, X_WB, False, limit, check_poses, threads)
    rows["b"] = 1
    endless = np.isneginf(rows["distance"])
    if endless.any():
        k = int(np.argmax(endless))
        where = "" if single else f" (pose {k} of the batch)"
        raise UnsupportedQuery(
            f"distance of {type(_one(A, k)).__name__} and {type(_one(B, k)).__name__}{where}: their overlap has no "
            "end, so no translation of finite length separates them; collide() still answers"
        )
    return PairResult(rows, single, (_held(A), _held(B), X_WA, X_WB))


def check_distance(name: str, value) -> float:
    """A distance limit [m]: a number ≥ 0, infinity allowed."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidArgument(f"{name} must be a number ≥ 0 [m], got {value!r}") from None
    if not number >= 0.0:
        raise InvalidArgument(f"{name} must be ≥ 0 [m], got {value!r}")
    return number


# --- the question -------------------------------------------------------------------------------


def _poses(A, B, X_WA, X_WB):
    """Shapes checked, poses as batches (n, 4, 4) or (1, 4, 4) whose entries are still to be checked."""
    X_WA, single_a = _batch(X_WA, "X_WA")
    X_WB, single_b = _batch(X_WB, "X_WB")
    n = len(X_WA) if len(X_WB) == 1 else len(X_WB)
    for name, given in (("A", A), ("B", B)):
        if isinstance(given, (list, tuple)) and given and all(isinstance(shape, Shape) for shape in given):
            if len(given) != n or single_a or single_b:
                raise InvalidArgument(f"{name} is a sequence of {len(given)} shapes: give X_WA and X_WB as batches of as many")
        elif not isinstance(given, Shape):
            raise InvalidArgument(f"{name} must be a shape, for example collide.Box((1, 1, 1)), got {given!r}")
    if len(X_WA) != len(X_WB) and 1 not in (len(X_WA), len(X_WB)):
        raise InvalidPose(f"X_WA has {len(X_WA)} poses and X_WB {len(X_WB)}: batches must match, or one be single")
    return X_WA, X_WB, single_a and single_b


def _batch(X, name: str) -> tuple[np.ndarray, bool]:
    """(poses (n, 4, 4), whether a single one was given)."""
    if isinstance(X, np.ndarray) and X.dtype == np.float64 and X.ndim in (2, 3) and X.shape[-2:] == (4, 4):
        return np.ascontiguousarray(X).reshape(-1, 4, 4), X.ndim == 2
    single = _is_single(X)
    return as_poses(X, name, check=False), single


def _is_single(X) -> bool:
    if isinstance(X, tuple):
        return all(np.ndim(part) == dimensions for part, dimensions in zip(X, (2, 1)))
    return np.ndim(X) == 2


def _one(shapes, k: int) -> Shape:
    return shapes if isinstance(shapes, Shape) else shapes[k]


def _held(shapes):
    return shapes if isinstance(shapes, Shape) else tuple(shapes)


# --- answers ------------------------------------------------------------------------------------


def _ask(A, B, X_WA, X_WB, boolean: bool, limit: float, check: bool, threads: int) -> np.ndarray:
    """bool[n], or a row a pose, of a batch in as many threads."""
    workers = _workers(threads)
    n = max(len(X_WA), len(X_WB)) if min(len(X_WA), len(X_WB)) else 0
    if workers == 1 or n < 2 * workers:
        return _answers(A, B, X_WA, X_WB, boolean, limit, check)
    bounds = np.linspace(0, n, workers + 1).astype(int)

    def piece(k: int) -> np.ndarray:
        part = slice(bounds[k], bounds[k + 1])
        shapes = (S if isinstance(S, Shape) else S[part] for S in (A, B))
        poses = (X if len(X) == 1 else X[part] for X in (X_WA, X_WB))
        try:
            return _answers(*shapes, *poses, boolean, limit, check)
        except InvalidPose:
            _refuse_poses(X_WA, X_WB, check)  # named by its place in the whole batch
            raise

    with ThreadPoolExecutor(workers) as pool:
        return np.concatenate(list(pool.map(piece, range(workers))))


def _workers(threads) -> int:
    if isinstance(threads, bool) or not isinstance(threads, (int, np.integer)) or threads < 1:
        raise InvalidArgument(f"threads must be an integer ≥ 1, got {threads!r}")
    return int(threads)


def _refuse_poses(X_WA, X_WB, check: bool) -> None:
    as_poses(X_WA, "X_WA", check=check)
    as_poses(X_WB, "X_WB", check=check)


def _answers(A, B, X_WA, X_WB, boolean: bool, limit: float, check: bool) -> np.ndarray:
    if not len(X_WA) or not len(X_WB):
        return np.zeros(0, dtype=bool if boolean else PAIR_DTYPE)
    sides = [[S] if isinstance(S, Shape) else S for S in (A, B)]
    if all(_is_plain(shape) for side in sides for shape in side) and not run.distrust_doubles:
        out = _plain(*sides, X_WA, X_WB, boolean, limit, check)
        if out is None:
            _refuse_poses(X_WA, X_WB, check)
            out = _plain(*sides, X_WA, X_WB, boolean, limit, False)  # a pose on the brink of the tolerance
            assert out is not None
        return out
    _refuse_poses(X_WA, X_WB, check)
    n = max(len(X_WA), len(X_WB))
    X_WA, X_WB = (np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4))) for X in (X_WA, X_WB))
    if isinstance(A, Shape) and isinstance(B, Shape):
        rows = _parts(A, B, X_WA, X_WB, boolean=boolean, limit=limit)
    else:
        rows = np.concatenate(
            [
                _parts(_one(A, k), _one(B, k), X_WA[k : k + 1], X_WB[k : k + 1], boolean=boolean, limit=limit)
                for k in range(n)
            ]
        )
    return rows["hit"] if boolean else rows


def _is_plain(shape: Shape) -> bool:
    """Whether a shape is one convex set in its own frame."""
    parts = shape.parts()
    return len(parts) == 1 and (parts[0][1] is IDENTITY or np.array_equal(parts[0][1], IDENTITY))


def _plain(side_a, side_b, X_WA, X_WB, boolean: bool, limit: float, check: bool) -> np.ndarray | None:
    if len(side_a) == len(side_b) == 1:
        table = ShapeTable([side_a[0].parts()[0][0], side_b[0].parts()[0][0]])
        return run.run_poses(table, None, X_WA, X_WB, boolean=boolean, limit=limit, check=check)
    n = max(len(X_WA), len(X_WB))
    rows: dict[int, int] = {}
    packed = []
    which = np.empty((n, 2), dtype=np.int64)
    for column, side in enumerate((side_a, side_b)):
        for k, shape in enumerate(side):
            one = shape.parts()[0][0]
            if id(one) not in rows:
                rows[id(one)] = len(packed)
                packed.append(one)
            which[k if len(side) > 1 else slice(None), column] = rows[id(one)]
    return run.run_poses(ShapeTable(packed), which, X_WA, X_WB, boolean=boolean, limit=limit, check=check)


#: A shape keeps this many partners prepared for single calls.
_PARTNERS = 64


def _prepare(A: Shape, B: Shape) -> run.SinglePair | None:
    """The pair made ready for single calls, kept with A; None for unions. Never used for its identity alone:
    the entry holds B, so that no other shape can take its id."""
    try:
        return A._prepared[id(B)]
    except AttributeError:
        object.__setattr__(A, "_prepared", {})
    except KeyError:
        pass
    if not (_is_plain(A) and _is_plain(B)):
        return None
    if len(A._prepared) >= _PARTNERS:
        A._prepared.clear()
    pair = run.SinglePair((A, B), ShapeTable([A.parts()[0][0], B.parts()[0][0]]))
    A._prepared[id(B)] = pair
    return pair


def _parts(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, boolean: bool, limit: float) -> np.ndarray:
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
    rows = run.run_pairs(table, poses, np.repeat(np.arange(len(parts)), n), pairs, boolean=boolean, limit=limit)
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
