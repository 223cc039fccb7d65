"""Pair queries: two shapes at one pair of poses, or at many."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from collide.base import argument_checks as checks
from collide.base.array_libraries import library_of, to_library
from collide.base.lazy_modules import lazy_module
from collide.base.threads import check_threads
from collide.certificates.make_certificate import certify
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.lowering.kind_of_shape import kind_of
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.convex_kernel_calls import finish_distances
from collide.narrowphase.dispatch import REFUSED, Method, method_of
from collide.narrowphase.single_queries import asks_prepared_pairs
from collide.pairs.batches import answer_batch, length_of, prepare_pair
from collide.pairs.least_depths import DepthSearch, checked_depth, shorten_depths
from collide.pairs.optional_algorithms import named_algorithm
from collide.pairs.pair_arguments import asked_poses, pose_at, shape_at
from collide.pairs.security_margin import checked_margin, within
from collide.results import PairResult
from collide.shapes.shape import Shape

pair_derivatives = lazy_module("collide.derivatives.pair_derivatives")

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from collide.derivatives.pair_derivatives import PairDerivatives
    from collide.results import Single
    from collide.transforms import Pose, PoseLike

    Shapes = Shape | Sequence[Shape]


@overload
def collide(
    A: Shape, B: Shape, X_WA: Pose, X_WB: Pose, *, security_margin: float = ..., check_poses: bool = ...,
    threads: int = ..., axes: NDArray[np.float64] | None = ..., algorithm: str | None = ..., like: None = ...,
) -> bool: ...
@overload
def collide(
    A: Shapes, B: Shapes, X_WA: PoseLike, X_WB: PoseLike, *, security_margin: float = ..., check_poses: bool = ...,
    threads: int = ..., axes: NDArray[np.float64] | None = ..., algorithm: str | None = ..., like: Any = ...,
) -> Any: ...
@asks_prepared_pairs(prepare_pair)
def collide(
    A,
    B,
    X_WA,
    X_WB,
    *,
    security_margin=0.0,
    check_poses=True,
    threads=1,
    axes=None,
    algorithm=None,
    like=None,
):
    """Whether the closed sets A and B share a point.

    Parameters
    ----------
    A, B : Shape, or sequence of Shape
        Two shapes; or, a shape for each pose, sequences of shapes (a list, or picked from a `ShapeSet`): X_WA and X_WB
        are then batches of this length.
    X_WA, X_WB : (4, 4) or (N, 4, 4) array_like, float64
        Poses of A and B in the world W [m]; a single pose goes with every pose of the other's batch. ``(R, t)`` tuples
        and scipy's rotations are accepted (`transforms.as_poses`), and arrays of PyTorch and JAX in the processor's
        memory (docs/arrays.md).
    security_margin : float
        [m], ≥ 0, finite: bodies at most so far apart count as hits, too. Decided by the proven bracket of the distance,
        and where the margin lies within the bracket by growing a body (`security_margin.py`): exactly between polytopes
        and balls swept over them. Goes with neither axes nor algorithm, and costs what `distance` does.
    check_poses : bool
        Refuse matrices that are no rotation. Else matrices are trusted: bodies are their images, and a half-space in a
        singular matrix has no plane, rows that are not certified, and a bracket of NaN.
    threads : int
        Answer a batch in at most so many threads; the answers are the same bits.
    axes : (N, 3) float64, optional
        Warm start: for each pose an axis that may separate the bodies, zeros where unknown. Tried first, and replaced,
        where the bodies are apart, by a separating axis: hand the same array to the next call, when the bodies have
        moved a little. Warm starts can only save time; answers are the same.
    algorithm : str, optional
        "gjk" (or ``None``), the default; or "barba-langerman", for two convex polytopes and one thread: the walk along
        bounded hierarchies, in O(log n + log m) rounds (docs/barba-langerman.md). The answers are the same; the default
        is faster. The hierarchies are built when first needed, and kept with the shapes.
    like : str or array, optional
        "torch", "jax", "numpy" or an array of one of these libraries: a batch comes back as an array of the library
        (`collide.to_library`).

    Returns
    -------
    bool, or (N,) bool
        bool for single poses. Touching is a hit; where rounding leaves the sign open (`PairResult.how` is "undecided"),
        the answer is True.

    Raises
    ------
    InvalidArgument
        Where arguments are no shapes, lengths do not match, or options do not go together.
    InvalidPose
        Naming the pose of the batch that is no rigid transform.
    UnsupportedQuery
        For shapes that the algorithm does not serve.

    Notes
    -----
    GJK (Gilbert, Johnson and Keerthi 1988) with proven bounds, in O(log n + log m) a round from 224 vertices on, after
    Dobkin and Kirkpatrick; integers where doubles leave the sign open. Pairs with meshes walk two box-trees.
    """
    if like is not None:
        library_of(like)
        hits = collide(
            A, B, X_WA, X_WB, security_margin=security_margin, check_poses=check_poses, threads=threads, axes=axes,
            algorithm=algorithm,
        )
        return hits if isinstance(hits, bool) else to_library(hits, like)
    margin = checked_margin("security_margin", security_margin)
    if margin and (axes is not None or algorithm is not None):
        raise InvalidArgument("security_margin goes with neither axes nor algorithm")
    answer = named_algorithm("collide", algorithm)
    if answer is not None:
        if axes is not None or check_threads(threads) != 1:
            raise InvalidArgument(f'algorithm="{algorithm}" takes no axes, and runs in one thread')
        return answer(A, B, X_WA, X_WB, check_poses)
    if axes is not None:
        return _with_axes(A, B, X_WA, X_WB, check_poses, threads, axes)
    if margin:
        return _with_margin(A, B, X_WA, X_WB, margin, check_poses, threads)
    return _batched(A, B, X_WA, X_WB, check_poses, threads)


def _batched(A, B, X_WA, X_WB, check_poses: bool, threads: int):
    X_WA, X_WB, single = asked_poses(A, B, X_WA, X_WB)
    question = Question(True, check=checks.true_or_false("check_poses", check_poses))
    if prepare_pair(A, B) and single:
        return collide(A, B, X_WA[0], X_WB[0], check_poses=question.check, threads=threads)
    hits = answer_batch(A, B, X_WA, X_WB, question, threads)
    return bool(hits[0]) if single else hits


def _with_margin(A, B, X_WA, X_WB, margin: float, check_poses: bool, threads: int):
    X_WA, X_WB, single = asked_poses(A, B, X_WA, X_WB)
    question = Question(False, margin, depths=False, check=checks.true_or_false("check_poses", check_poses))
    if prepare_pair(A, B) and single:
        return collide(
            A, B, X_WA[0], X_WB[0], security_margin=margin, check_poses=question.check, threads=threads
        )
    rows = answer_batch(A, B, X_WA, X_WB, question, threads)
    hits = within(rows, margin, lambda k: (shape_at(A, k), shape_at(B, k), pose_at(X_WA, k), pose_at(X_WB, k)))
    return bool(hits[0]) if single else hits


#: Longest warm-start axis: its square is far from overflow.
_LONGEST_AXIS = 1e100


def _with_axes(A, B, X_WA, X_WB, check_poses: bool, threads: int, axes):
    X_WA, X_WB, single = asked_poses(A, B, X_WA, X_WB)
    wanted = (length_of(A, B, X_WA, X_WB), 3)
    if not isinstance(axes, np.ndarray) or axes.dtype != np.float64 or axes.shape != wanted:
        got = f"{axes.dtype} {axes.shape}" if isinstance(axes, np.ndarray) else type(axes).__name__
        raise InvalidArgument(f"axes must be a float64 array {wanted}, one row a pose, got {got}")
    if not (axes.flags.c_contiguous and axes.flags.writeable and np.isfinite(axes).all()):
        raise InvalidArgument("axes must be contiguous, writeable and finite: it is read and updated in place")
    if len(axes) and np.abs(axes).max() > _LONGEST_AXIS:
        raise InvalidArgument(f"axes must not be longer than {_LONGEST_AXIS:g}: only their directions count")
    question = Question(True, check=checks.true_or_false("check_poses", check_poses), axes=axes)
    hits = answer_batch(A, B, X_WA, X_WB, question, threads)
    return bool(hits[0]) if single else hits


@overload
def distance(
    A: Shape, B: Shape, X_WA: Pose, X_WB: Pose, *, max_distance: float = ..., signed: bool = ...,
    check_poses: bool = ..., threads: int = ..., depth: DepthSearch = ...,
    like: None = ..., derivatives: Literal[False] = ...,
) -> PairResult[Single]: ...
@overload
def distance(
    A: Shapes, B: Shapes, X_WA: PoseLike, X_WB: PoseLike, *, max_distance: float = ..., signed: bool = ...,
    check_poses: bool = ..., threads: int = ..., depth: DepthSearch = ...,
    like: None = ..., derivatives: Literal[False] = ...,
) -> PairResult: ...
@overload
def distance(
    A: Shape, B: Shape, X_WA: Pose, X_WB: Pose, *, derivatives: Literal[True], max_distance: float = ...,
    signed: bool = ..., check_poses: bool = ..., threads: int = ...,
    depth: DepthSearch = ..., like: None = ...,
) -> PairDerivatives[Single]: ...
@overload
def distance(
    A: Shapes, B: Shapes, X_WA: PoseLike, X_WB: PoseLike, *, derivatives: Literal[True], max_distance: float = ...,
    signed: bool = ..., check_poses: bool = ..., threads: int = ...,
    depth: DepthSearch = ..., like: None = ...,
) -> PairDerivatives: ...
@overload
def distance(
    A: Shapes, B: Shapes, X_WA: PoseLike, X_WB: PoseLike, *, max_distance: float = ..., signed: bool = ...,
    check_poses: bool = ..., threads: int = ..., depth: DepthSearch = ..., like: Any,
    derivatives: bool = ...,
) -> Any: ...
@asks_prepared_pairs(prepare_pair, PairResult, certify)
def distance(
    A,
    B,
    X_WA,
    X_WB,
    *,
    max_distance=math.inf,
    signed=True,
    check_poses=True,
    threads=1,
    depth="quick",
    like=None,
    derivatives=False,
):
    """Signed distance of A and B, with witness points, normal and a proven bracket.

    Parameters
    ----------
    A, B : Shape, or sequence of Shape
        As of `collide`.
    X_WA, X_WB : (4, 4) or (N, 4, 4) array_like, float64
        Poses of A and B in the world W [m], as of `collide`.
    max_distance : float
        [m], ≥ 0. Beyond this distance only a proven lower bound is computed, and ``beyond`` is set.
    signed : bool
        False where only gaps are wanted: bodies that meet are then at distance 0, with a zero normal and a bracket of
        0, too, unless the sign is open. Depths are not computed, to save most of the time of overlapping pairs.
    check_poses, threads
        As of `collide`.
    depth : str
        Of overlapping bodies that are not convex: "quick", a translation that separates the bodies, short as a rule; or
        "least", the shortest translation known, with lower and upper near each other: of `Compound`s of convex shapes
        0.1 % as a rule, in 30 ms a pose; of meshes 10 % in the median, in 0.5 s, or 3 to 13 % beside curved shapes and
        in unions, in 1 to 2 s. Fields count as the items within the depth, an ``HPolytope(bounded=False)`` as far as
        the depth reaches (docs/conventions.md). Rows of convex bodies, of bodies apart and of
        open signs are the same.
    like : str or array, optional
        As of `collide`: fields are arrays of the library, as by `PairResult.to`.
    derivatives : bool
        Whether the answer has derivatives by both poses as well (docs/derivatives.md). The rows are the same. Overlaps
        of hulls and curved shapes are asked twice.

    Returns
    -------
    PairResult, with derivatives `PairDerivatives`
        Scalars for single poses, arrays with a leading N otherwise. Lengths in metres, vectors in W.

    Raises
    ------
    InvalidArgument
        As of `collide`, and for a negative or NaN max_distance.
    InvalidPose
        Naming the pose of the batch that is no rigid transform.
    UnsupportedQuery
        Where the depth is unbounded (half-space in half-space).

    Notes
    -----
    GJK for gaps, their last digits in double-doubles; EPA (van den Bergen 2001) for depths. Where a body is not convex,
    an overlap is minus the length of a translation proven to separate the bodies, of meshes by some hundred booleans,
    left out with ``signed=False``; each ends at the first two facets that meet, or are as near as the
    radii. Gaps of meshes of n and m facets take few boxes where a single pair of facets is nearest, O(n + m) where all
    are as near as each other within rounding, n·m at worst. Of unions of m and k parts, a mesh among them, each boolean
    compares all m·k pairs of boxes, and asks about pairs that overlap or come as near as the nearest parts are. Curved
    shapes within a mesh of n facets take O(n) where all its facets are near.
    """
    if like is not None:
        library_of(like)
        result = distance(
            A, B, X_WA, X_WB, max_distance=max_distance, signed=signed, check_poses=check_poses, threads=threads,
            depth=depth, derivatives=derivatives,
        )
        return to_library(result, like)
    if checks.true_or_false("derivatives", derivatives):
        options = {"check_poses": check_poses, "threads": threads, "depth": depth}
        result = distance(A, B, X_WA, X_WB, max_distance=max_distance, signed=signed, **options)
        return pair_derivatives.PairDerivatives(result, partial(_rows_again, check_threads(threads)))
    limit = checks.limit("max_distance", max_distance)
    signed = checks.true_or_false("signed", signed)
    least = checked_depth(depth) and signed
    X_WA, X_WB, single = asked_poses(A, B, X_WA, X_WB)
    question = Question(False, limit, signed, checks.true_or_false("check_poses", check_poses))
    if prepare_pair(A, B) and single and not least:
        return distance(
            A, B, X_WA[0], X_WB[0], max_distance=limit, signed=signed, check_poses=question.check, threads=threads
        )
    pose_copies = np.empty_like(X_WA), np.empty_like(X_WB)  # a certificate worked out later is one for these poses
    unbounded = []

    def finish(rows: np.ndarray) -> None:
        if finish_distances(rows, depths=signed):
            unbounded.append(True)

    rows = answer_batch(A, B, X_WA, X_WB, question, threads, finish=finish, pose_copies=pose_copies)
    if least:
        shorten_depths(rows, A, B, X_WA, X_WB)
    if unbounded:
        k = int(np.argmax(np.isneginf(rows["distance"])))
        where = "" if single else f" (pose {k} of the batch)"
        shapes = [shape_at(S, k) for S in (A, B)]
        pair = " and ".join(type(shape).__name__ for shape in shapes)
        why = REFUSED.get((method_of(*map(kind_of, shapes)), "distance"), REFUSED[Method.PLANES, "distance"])
        raise UnsupportedQuery(f"distance of {pair}{where}: {why}")
    return PairResult(rows, single, (_immutable(A), _immutable(B), *pose_copies), certify)


def _rows_again(threads: int, A, B, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """Rows of pairs at checked poses that are moved a little."""
    return distance(A, B, X_WA, X_WB, check_poses=False, threads=threads).rows


def _immutable(shapes):
    return tuple(shapes) if isinstance(shapes, list) else shapes
