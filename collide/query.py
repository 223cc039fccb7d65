"""Pair queries: two shapes at one pair of poses, or at many."""

from __future__ import annotations

import itertools
import math
import weakref

import numpy as np

from collide.batches import ask, length_of
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery
from collide.geometry.tables import ShapeTable
from collide.narrowphase import run
from collide.results import PairResult
from collide.shapes.base import Shape, is_plain
from collide.shapes.shape_set import Picked
from collide.transforms import as_poses
from collide.workers import check_threads


def collide(
    A,
    B,
    X_WA,
    X_WB,
    *,
    check_poses: bool = True,
    threads: int = 1,
    axes: np.ndarray | None = None,
    algorithm: str | None = None,
):
    """Whether the closed sets A and B share a point.

    Parameters
    ----------
    A, B : shapes; or sequences of shapes, one a pose (a list, or picked from a `ShapeSet`), and then X_WA and
        X_WB are batches of that length.
    X_WA, X_WB : (4, 4) poses in the world, or batches (N, 4, 4); a single pose goes with every
        pose of the other's batch. ``(R, t)`` tuples are accepted.
    check_poses : refuse matrices that are no rotation.
    threads : answer a batch in this many threads; the answers are the same bits.
    axes : warm start, float64 (N, 3): for each pose an axis that may part the bodies, zeros where none is
        known. Tried first, and replaced where the bodies are apart by an axis that does: hand the same
        array to the next call, when they have moved a little. It can only save time; answers are the same.
    algorithm : "gjk" (or None), the default; or "barba-langerman", for two convex polytopes and one thread: the walk
        along bounded hierarchies, in O(log n + log m) rounds (docs/barba-langerman.md). The answers are the same;
        the default is faster. The hierarchies are built when first asked for, and kept with the shapes.

    Returns
    -------
    bool for single poses, bool[N] otherwise. Touching is a hit; where rounding leaves the sign
    open (`PairResult.how` is "undecided"), the answer is True.

    Raises InvalidPose, InvalidArgument; UnsupportedQuery for shapes that the algorithm does not serve.
    """
    if algorithm is not None and not _is_named(algorithm, "gjk"):
        return _by_algorithm(A, B, X_WA, X_WB, check_poses, threads, axes, algorithm)
    if axes is not None:
        return _with_axes(A, B, X_WA, X_WB, check_poses, threads, axes)
    if threads.__class__ is not int or threads != 1:
        return _batched(A, B, X_WA, X_WB, check_poses, threads)
    try:
        hit = A._prepared[B._serial].collide(X_WA, X_WB)
        if hit is not None:
            return hit
    except (AttributeError, KeyError, TypeError):
        pass  # not prepared yet, not single, not float64, not shapes: the long way answers, or says what is wrong
    return _batched(A, B, X_WA, X_WB, check_poses, threads)


def _batched(A, B, X_WA, X_WB, check_poses: bool, threads: int):
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB)
    _prepare(A, B)
    hits = ask(A, B, X_WA, X_WB, True, 0.0, check_poses, threads)
    return bool(hits[0]) if single else hits


def _by_algorithm(A, B, X_WA, X_WB, check_poses: bool, threads: int, axes, algorithm):
    if not _is_named(algorithm, "barba-langerman"):
        raise InvalidArgument(f'algorithm must be "gjk" or "barba-langerman", got {algorithm!r}')
    if axes is not None or check_threads(threads) != 1:
        raise InvalidArgument('algorithm="barba-langerman" takes no axes, and runs in one thread')
    found = walk(A, B, X_WA, X_WB, check_poses=check_poses)
    return bool(found.hit[0]) if _is_single(X_WA) and _is_single(X_WB) else found.hit


def _is_named(algorithm, name: str) -> bool:
    """Whether an algorithm is given by this name; anything but a string, an array among them, is not."""
    return isinstance(algorithm, str) and algorithm == name


def walk(A, B, X_WA, X_WB, *, check_poses: bool = True, trace: bool = False):
    """What `collide` says with ``algorithm="barba-langerman"``, with its counts: `collide.walks.Walks`.

    A, B : convex polytopes: `ConvexHull` without a radius, `Box`, `HPolytope`.   X_WA, X_WB, check_poses : as there.
    trace : also return the rounds of the last pose one by one.

    Raises InvalidPose, InvalidArgument; UnsupportedQuery for other shapes.
    """
    from collide import walks

    for shape in (A, B):
        walks.walk_body(shape)
    X_WA, X_WB, _, ask_default = _with_default(A, B, X_WA, X_WB, check_poses)
    return walks.walk_poses(A, B, X_WA, X_WB, lambda left: ask_default(left, True, 0.0), trace=trace)


def _with_default(A, B, X_WA, X_WB, check_poses: bool):
    """(poses, poses, whether single, a function that asks the default algorithm at the poses of given numbers).

    Poses are checked and copied: a certificate worked out later is one for these.
    """
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB)
    X_WA, X_WB = (as_poses(X, name, check=check_poses).copy() for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))

    def ask_default(left: np.ndarray, boolean: bool, limit: float, depths: bool = True) -> np.ndarray:
        X_WO, X_WT = (X if len(X) == 1 else np.ascontiguousarray(X[left]) for X in (X_WA, X_WB))
        return np.broadcast_to(ask(A, B, X_WO, X_WT, boolean, limit, False, 1, depths=depths), (len(left),))

    return X_WA, X_WB, single, ask_default


#: Longest warm-start axis: its square is far from overflow.
_LONGEST_AXIS = 1e100


def _with_axes(A, B, X_WA, X_WB, check_poses: bool, threads: int, axes):
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB)
    wanted = (length_of(A, B, X_WA, X_WB), 3)
    if not isinstance(axes, np.ndarray) or axes.dtype != np.float64 or axes.shape != wanted:
        given = f"{axes.dtype} {axes.shape}" if isinstance(axes, np.ndarray) else type(axes).__name__
        raise InvalidArgument(f"axes must be a float64 array {wanted}, one row a pose, got {given}")
    if not (axes.flags.c_contiguous and axes.flags.writeable and np.isfinite(axes).all()):
        raise InvalidArgument("axes must be contiguous, writeable and finite: it is read and updated in place")
    if len(axes) and np.abs(axes).max() > _LONGEST_AXIS:
        raise InvalidArgument(f"axes must not be longer than {_LONGEST_AXIS:g}: only their directions count")
    hits = ask(A, B, X_WA, X_WB, True, 0.0, check_poses, threads, axes)
    return bool(hits[0]) if single else hits


def distance(
    A,
    B,
    X_WA,
    X_WB,
    *,
    max_distance: float = math.inf,
    signed: bool = True,
    check_poses: bool = True,
    threads: int = 1,
    algorithm: str | None = None,
) -> PairResult:
    """Signed distance of A and B, with witness points, normal and a proven bracket.

    Parameters
    ----------
    A, B, X_WA, X_WB, check_poses, threads : as in `collide`.
    max_distance : [m], ≥ 0. Beyond it only a proven lower bound is worked out, and ``beyond`` is set.
    signed : False where gaps are all that is wanted: bodies that meet are then at distance 0, with a zero normal
        and a bracket that is 0, too, unless the sign is open. How deep they overlap is not worked out, which saves
        most of the time of overlapping pairs.
    algorithm : "gjk" (or None), the default; or "dobkin-kirkpatrick", for two convex polytopes, one thread and no
        max_distance: gaps are found down bounded hierarchies, and settled in integers. The same numbers to their
        last digit, and slower (docs/barba-langerman.md).

    Returns
    -------
    PairResult : scalars for single poses, arrays with a leading N otherwise.

    Raises InvalidPose, InvalidArgument; UnsupportedQuery where the depth has no end (half-space in
    half-space).
    """
    limit = check_distance("max_distance", max_distance)
    if algorithm is not None and not _is_named(algorithm, "gjk"):
        return _down_hierarchies(A, B, X_WA, X_WB, limit, signed, check_poses, threads, algorithm)
    if limit == math.inf and threads.__class__ is int and threads == 1:
        try:
            pair = A._prepared[B._serial]
            rows = pair.distance(X_WA, X_WB) if signed or pair.only_gaps else None
            if rows is not None:
                return PairResult(rows, True, (A, B, X_WA.copy()[None], X_WB.copy()[None]))
        except (AttributeError, KeyError, TypeError):
            pass  # as in `collide`
    X_WA, X_WB, single = _poses(A, B, X_WA, X_WB)
    kept = np.empty_like(X_WA), np.empty_like(X_WB)  # a certificate worked out later is one for these poses
    _prepare(A, B)
    endless = []

    def close(rows: np.ndarray) -> None:
        if run.close(rows, depths=signed):
            endless.append(True)

    rows = ask(A, B, X_WA, X_WB, False, limit, check_poses, threads, depths=signed, close=close, kept=kept)
    if endless:
        k = int(np.argmax(np.isneginf(rows["distance"])))
        where = "" if single else f" (pose {k} of the batch)"
        raise UnsupportedQuery(
            f"distance of {type(_one(A, k)).__name__} and {type(_one(B, k)).__name__}{where}: their overlap has no "
            "end, so no translation of finite length separates them; collide() still answers"
        )
    return PairResult(rows, single, (_held(A), _held(B), *kept))


def _down_hierarchies(A, B, X_WA, X_WB, limit, signed: bool, check_poses: bool, threads: int, algorithm) -> PairResult:
    if not _is_named(algorithm, "dobkin-kirkpatrick"):
        raise InvalidArgument(f'algorithm must be "gjk" or "dobkin-kirkpatrick", got {algorithm!r}')
    if limit != math.inf or check_threads(threads) != 1:
        raise InvalidArgument('algorithm="dobkin-kirkpatrick" takes no max_distance, and runs in one thread')
    from collide import walks

    for shape in (A, B):
        walks.walk_body(shape, algorithm)
    X_WA, X_WB, single, ask_default = _with_default(A, B, X_WA, X_WB, check_poses)
    rows = walks.rows_down_hierarchies(A, B, X_WA, X_WB, lambda left: ask_default(left, False, math.inf, signed))
    run.close(rows, depths=signed)
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


# --- the question -------------------------------------------------------------------------------


def _poses(A, B, X_WA, X_WB):
    """Shapes checked, poses as batches (n, 4, 4) or (1, 4, 4) whose entries are still to be checked."""
    X_WA, single_a = _batch(X_WA, "X_WA")
    X_WB, single_b = _batch(X_WB, "X_WB")
    counts = {"X_WA": len(X_WA), "X_WB": len(X_WB)}
    single = single_a and single_b
    for name, given in (("A", A), ("B", B)):
        if isinstance(given, Picked) or (
            isinstance(given, (list, tuple)) and all(isinstance(shape, Shape) for shape in given)
        ):
            counts[name] = len(given)
            single = False
        elif not isinstance(given, Shape):
            raise InvalidArgument(f"{name} must be a shape, for example collide.Box((1, 1, 1)), got {given!r}")
    wanted = max(counts.values()) if min(counts.values()) else 0
    for name, count in counts.items():
        if count != wanted and (count != 1 or name in "AB"):
            told = ", ".join(f"{other} {n}" for other, n in counts.items())
            kind = InvalidPose if name.startswith("X") else InvalidArgument
            raise kind(f"lengths do not match: {told}; batches must be equally long, or a single pose")
    return X_WA, X_WB, single


def _batch(X, name: str) -> tuple[np.ndarray, bool]:
    """(poses (n, 4, 4), whether a single one was given)."""
    if isinstance(X, np.ndarray) and X.dtype == np.float64 and X.ndim in (2, 3) and X.shape[-2:] == (4, 4):
        return np.ascontiguousarray(X).reshape(-1, 4, 4), X.ndim == 2
    return as_poses(X, name, check=False), _is_single(X)


def _is_single(X) -> bool:
    if isinstance(X, tuple):
        return all(np.ndim(part) == dimensions for part, dimensions in zip(X, (2, 1)))
    return np.ndim(X) == 2


def _one(shapes, k: int) -> Shape:
    return shapes if isinstance(shapes, Shape) else shapes[k]


def _held(shapes):
    return tuple(shapes) if isinstance(shapes, list) else shapes


# --- single calls -------------------------------------------------------------------------------

#: Numbers of shapes within this process, never used again.
_serials = itertools.count()
#: A shape keeps this many partners prepared for single calls.
_PARTNERS = 512


def _prepare(A, B) -> None:
    """Make a pair of shapes ready for single calls, and keep it with A, by the number B has then."""
    if not (isinstance(A, Shape) and isinstance(B, Shape)):
        return
    meshed = A.meshed or B.meshed
    if not meshed and not (is_plain(A) and is_plain(B)):
        return
    if not run.single_calls_are_safe():
        return
    if not hasattr(A, "_prepared"):
        object.__setattr__(A, "_prepared", {})
    if not hasattr(B, "_serial"):
        object.__setattr__(B, "_serial", next(_serials))
    prepared, serial = A._prepared, B._serial
    if serial in prepared:
        return
    pair = _meshed_pair(A, B) if meshed else run.SinglePair(ShapeTable([A.parts()[0][0], B.parts()[0][0]]))
    if pair is None:
        return
    for oldest in list(prepared)[: max(0, len(prepared) + 1 - _PARTNERS)]:  # a list: other threads add and finalizers take
        prepared.pop(oldest, None)
    prepared[serial] = pair
    weakref.finalize(B, prepared.pop, serial, None)  # what is gone is not held by its partners


def _meshed_pair(A: Shape, B: Shape):
    from collide.meshes.single import single_pair

    return single_pair(A, B)
