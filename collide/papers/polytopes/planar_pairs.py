"""Whether convex polygons meet, how far apart they are: arguments checked, kernels called, proofs made on request."""

from __future__ import annotations

from threading import local

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads, share_if_it_helps
from collide.errors import InvalidArgument
from collide.kernels import address_of
from collide.papers.polytopes.convex_polygon import ConvexPolygon, planar_poses
from collide.papers.polytopes.planar_certificates import PlanarCertificate, certificate_of_row, gap_across
from collide.papers.polytopes.planar_distance import (
    DISTANCE,
    DISTANCE_ROW,
    LOWER,
    NORMAL,
    POINT_A,
    POINT_B,
    UPPER,
    measure_polygons,
)
from collide.papers.polytopes.planar_kernel import meet_polygons
from collide.papers.polytopes.planar_layout import DOUBLES, HIT, HOW, INTEGERS, LOST, READ, ROUNDS, ROW


class PolygonQuestion:
    """Pairs of polygons and their poses, checked: the question.

    Attributes
    ----------
    A, B : ConvexPolygon, or a list of n of them
    X_WA, X_WB : (n, 3, 3) or (1, 3, 3) float64
        Poses in W [m].
    n : int
        Pairs.
    single : bool
        Whether the question is a single pair, with scalars as answers.
    """

    def __init__(self, A, B, X_WA, X_WB):
        self.A, self.B = _polygons(A, "A"), _polygons(B, "B")
        self.X_WA, single_a = planar_poses(X_WA, "X_WA")
        self.X_WB, single_b = planar_poses(X_WB, "X_WB")
        counts = {name: len(side) for name, side in (("A", self.A), ("B", self.B)) if isinstance(side, list)}
        self.single = single_a and single_b and not counts
        counts |= {"X_WA": len(self.X_WA), "X_WB": len(self.X_WB)}
        self.n = checks.matched_count("", **counts)

    def pair(self, k: int) -> tuple[ConvexPolygon, ConvexPolygon, np.ndarray, np.ndarray]:
        """Polygons and poses (3, 3) of pair k."""
        A, B = (side[k] if isinstance(side, list) else side for side in (self.A, self.B))
        return A, B, *(X[k if len(X) > 1 else 0] for X in (self.X_WA, self.X_WB))

    def arguments(self) -> tuple[list[np.ndarray], tuple[int, ...]]:
        """(arrays to be kept alive, the arguments of a kernel for A and B: address and step of polygons and poses)."""
        arrays, numbers = [], []
        for side, X in ((self.A, self.X_WA), (self.B, self.X_WB)):
            polygons = side if isinstance(side, list) else [side]
            table = np.array([(address_of(p.vertices), len(p.vertices)) for p in polygons], dtype=np.int64)
            arrays += [table, X]
            numbers += [address_of(table), int(len(table) > 1), address_of(X), int(len(X) > 1)]
        return arrays, tuple(numbers)


def _polygons(side, name: str):
    if isinstance(side, ConvexPolygon):
        return side
    if isinstance(side, (list, tuple)) and all(isinstance(p, ConvexPolygon) for p in side):
        return list(side)
    raise InvalidArgument(
        f"{name} must be a ConvexPolygon or a list of them, for example collide.ConvexPolygon([(0, 0), (1, 0), (0, 1)])"
        f", got {checks.brief(side)}"
    )


class PolygonHits:
    """Whether polygons meet, and what it took.

    Parameters
    ----------
    question : PolygonQuestion
        What was asked.
    table : (n, 24) int64
        Rows of `planar_layout.py`.

    Attributes
    ----------
    hit : bool, or (n,) bool
        Whether they have a common point. Touching is a hit.
    rounds : int, or (n,) int64
        Rounds of the search: at most log₂ of both numbers of vertices, and 6.
    vertices_read : int, or (n,) int64
        How often a vertex was read.
    """

    def __init__(self, question: PolygonQuestion, table: np.ndarray):
        self._question, self._rows = question, table
        single = question.single
        self.hit = bool(table[0, HIT]) if single else table[:, HIT] == 1
        self.rounds = int(table[0, ROUNDS]) if single else table[:, ROUNDS].copy()
        self.vertices_read = int(table[0, READ]) if single else table[:, READ].copy()

    def __len__(self) -> int:
        return len(self._rows)

    def certificate(self, k: int = 0) -> PlanarCertificate:
        """The proof of pair k: a common point, or a line between the polygons.

        Parameters
        ----------
        k : int
            Number of the pair, 0 for a single pair.

        Returns
        -------
        PlanarCertificate
            Plain data, in fractions; checked by `verify_polygons`. Some milliseconds.

        Raises
        ------
        InvalidArgument
            For k out of range.
        """
        if not checks.is_integer(k) or not 0 <= k < len(self._rows):
            raise InvalidArgument(
                f"certificate: k must be an integer from 0 to {len(self._rows) - 1}, got {checks.brief(k)}"
            )
        return certificate_of_row(*self._question.pair(k), self._rows[k].tolist())

    def __repr__(self) -> str:
        return f"PolygonHits({self.hit})" if self._question.single else f"PolygonHits(<{len(self)} pairs>)"


def polygons_meet(A, B, X_WA, X_WB, *, threads: int = 1) -> PolygonHits:
    """Whether convex polygons in the plane have a common point, decided exactly.

    Parameters
    ----------
    A, B : ConvexPolygon, or list of n of them
        One goes with all poses; of a list each has its own.
    X_WA, X_WB : (3, 3) or (n, 3, 3) array_like, float64
        Poses in W, used as they stand, entry by entry [m]: `planar_pose` makes one. A single one goes with all others.
    threads : int
        Answer a batch in at most so many threads; the answers are the same bits.

    Returns
    -------
    PolygonHits
        Hits, rounds, vertices read, and certificates on request.

    Raises
    ------
    InvalidArgument
        Where A or B are no polygons, numbers of polygons do not match, or threads is no integer ≥ 1.
    InvalidPose
        Where a pose is not finite or no rotation, or their numbers do not match.

    Notes
    -----
    O(log n + log m) a pair of polygons of n and m vertices, nothing prepared: L. Barba and S. Langerman, "Optimal
    detection of intersections between convex polyhedra", section 2, Theorem 2.1. What doubles leave open is decided in
    integers.
    """
    threads = check_threads(threads)
    question = PolygonQuestion(A, B, X_WA, X_WB)
    table = np.zeros((question.n, ROW), dtype=np.int64)
    _answer(question, table, None, threads)
    return PolygonHits(question, table)


class PolygonDistances(PolygonHits):
    """Signed distances of polygons, and whether they meet.

    Parameters
    ----------
    question : PolygonQuestion
        The question.
    table : (n, 24) int64
        Rows of `planar_layout.py`.
    distances : (n, 9) float64
        Rows of `planar_distance.py` [m].

    Attributes
    ----------
    distance : float, or (n,) float64
        The gap, or minus the depth, the length of the least separating translation [m].
    lower, upper : float, or (n,) float64
        Bounds of the distance: no rounding error reaches beyond [m]. The sign agrees with ``hit``, exact.
    normal : (2,) or (n, 2) float64
        Unit vector in W from A towards B: moving B by −distance · normal brings them to touch.
    point_a, point_b : (2,) or (n, 2) float64
        Witness points in W [m]: point_b − point_a = distance · normal.
    """

    def __init__(self, question: PolygonQuestion, table: np.ndarray, distances: np.ndarray):
        super().__init__(question, table)
        rows = distances[0] if question.single else distances
        self.distance, self.lower, self.upper = (
            float(rows[k]) if question.single else rows[:, k].copy() for k in (DISTANCE, LOWER, UPPER)
        )
        self.normal, self.point_a, self.point_b = (rows[..., k : k + 2].copy() for k in (NORMAL, POINT_A, POINT_B))

    def __repr__(self) -> str:
        if self._question.single:
            return f"PolygonDistances({self.distance:.6g} m)"
        return f"PolygonDistances(<{len(self)} pairs>)"


def polygon_distance(A, B, X_WA, X_WB, *, threads: int = 1) -> PolygonDistances:
    """Signed distance, normal and witness points of convex polygons in the plane.

    Parameters
    ----------
    A, B : ConvexPolygon, or list of n of them
        A single polygon goes with all poses; each polygon of a list has its own pose.
    X_WA, X_WB : (3, 3) or (n, 3, 3) array_like, float64
        Poses in W, used as given, entry by entry [m]. A single pose goes with all others.
    threads : int
        The most threads for a batch; the answers have the same bits.

    Returns
    -------
    PolygonDistances
        Distances with bounds, normals, points, and all fields of `polygons_meet`.

    Raises
    ------
    InvalidArgument
        For A or B other than polygons, numbers of polygons that differ, or threads not an integer ≥ 1.
    InvalidPose
        For a pose not finite or not a rotation, or numbers of poses that differ.

    Notes
    -----
    The hit is decided exactly, first. A gap takes O(log n + log m) a round of GJK, a depth O(n + m): a
    translation has to be tried along the normal of every edge. Meeting polygons have depth 0 where their
    Minkowski difference has no area. Distances are doubles, off by at most 2⁻⁴⁶ (1.4e-14) of the pair's size.
    For polygons apart, ``lower`` and ``distance`` are positive, unless the gap is less than the least double.
    """
    threads = check_threads(threads)
    question = PolygonQuestion(A, B, X_WA, X_WB)
    table = np.zeros((question.n, ROW), dtype=np.int64)
    distances = np.zeros((question.n, DISTANCE_ROW))
    _answer(question, table, distances, threads)
    for k in np.flatnonzero((table[:, HIT] == 0) & ~(distances[:, LOWER] > 0.0)).tolist():
        certificate = certificate_of_row(*question.pair(k), table[k].tolist())
        distances[k, LOWER] = gap_across(*question.pair(k), certificate)
        distances[k, DISTANCE] = max(distances[k, DISTANCE], distances[k, LOWER])
        distances[k, UPPER] = max(distances[k, UPPER], distances[k, DISTANCE])
    return PolygonDistances(question, table, distances)


def _answer(question: PolygonQuestion, table: np.ndarray, distances: np.ndarray | None, threads: int) -> None:
    """Rows of `planar_layout.py` of all pairs, and of `planar_distance.py` where they are wanted."""
    arrays, numbers = question.arguments()
    assert arrays  # the numbers are addresses of them

    def answer(piece: slice) -> None:
        n, rows = piece.stop - piece.start, address_of(table) + table.itemsize * ROW * piece.start
        arguments = _arguments_from(numbers, piece.start)
        meet_polygons(*arguments, n, rows, *_of_thread.addresses)
        if distances is not None:
            measure_polygons(*arguments, n, rows, address_of(distances) + 8 * DISTANCE_ROW * piece.start)

    if threads > 1 and question.n > 1:
        share_if_it_helps(question.n, answer, threads)
    elif question.n:
        answer(slice(0, question.n))
    if (table[:, HOW] == LOST).any():
        raise AssertionError(f"planar search without a proof, pair {int(np.argmax(table[:, HOW] == LOST))}")


def _arguments_from(numbers: tuple[int, ...], first: int) -> tuple[int, ...]:
    """The arguments of a kernel for the pairs from one on: rows of polygons have 16 bytes, poses 72."""
    polygons_a, step_a, poses_a, pose_step_a, polygons_b, step_b, poses_b, pose_step_b = numbers
    return (
        polygons_a + 16 * step_a * first, step_a, poses_a + 72 * pose_step_a * first, pose_step_a,
        polygons_b + 16 * step_b * first, step_b, poses_b + 72 * pose_step_b * first, pose_step_b,
    )


class _OfThread(local):
    """The workspace of one thread, made when the thread first asks."""

    def __init__(self) -> None:
        self.doubles = np.zeros(DOUBLES)
        self.integers = np.zeros(INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_of_thread = _OfThread()
