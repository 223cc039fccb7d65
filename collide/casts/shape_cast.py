"""How far a body can be moved along a direction until it touches another: `shape_cast`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import answers_in_order, check_threads, pieces_of
from collide.casts.cast_arguments import checked_directions, refuse_unbounded
from collide.casts.cast_batches import cast_batch
from collide.casts.convex_casts import CastRows
from collide.casts.directions import Directions
from collide.casts.union_cast import AT_START, ITEM_A, ITEM_B, OUT_NORMAL, OUT_POINT, T_UPPER, T
from collide.casts.union_casts import prepare_way
from collide.narrowphase.prepared_pairs import prepared_pair
from collide.pairs.pair_arguments import asked_poses, matched_counts
from collide.results import only_value
from collide.shapes.shape import Shape
from collide.transforms import as_poses

#: A thread is handed at least so many casts.
_MIN_PER_THREAD = 500
_INF = math.inf


class ShapeCasts(NamedTuple):
    """Where bodies moved along directions first touch others.

    hit : (N,) bool. Of polytopes and half-spaces decided exactly; for other shapes, where rounding leaves hit or miss
        open, True.
    distance : t of the first contact: A stands at its pose moved by t · direction, and touches B. Lengths in units of
        the direction's, metres for unit directions. ``inf`` where nothing is met; 0 where they touch at the start.
    lower, upper : lower ≤ truth ≤ upper is proven where ``certified``, or where the hit is.
    point : in W [m], of B at the first contact with A; a common point for bodies in contact at the start. Zeros where
        nothing is met.
    normal : unit normal from A to B in W at the contact, never against the direction where t > 0. Zeros where nothing
        is met, and of bodies in contact at the start, as of `collide.distance` with ``signed=False``; with
        ``start_normals`` their normal and point are as `collide.distance` has them for the two touching parts.
    certified : the hit or miss is proven, and of hits the bracket is narrow: 2⁻⁴⁰ of the size of the pair
        (extents and distance) in units of the direction's length, 2⁻²⁶ where a cylinder, cone or ellipsoid takes part.
    at_start : whether they touch at t = 0.
    item_a, item_b : numbers of the touching parts of `Compound`s, two of several in contact at the start; 0 of other
        shapes; −1 where nothing is met.

    Single casts give scalars and (3,).
    """

    hit: np.ndarray
    distance: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    certified: np.ndarray
    at_start: np.ndarray
    item_a: np.ndarray
    item_b: np.ndarray


def shape_cast(
    A,
    X_WA,
    direction_W,
    B,
    X_WB,
    *,
    max_distance: float = math.inf,
    start_normals: bool = False,
    check_poses: bool = True,
    threads: int = 1,
) -> ShapeCasts:
    """How far A can be moved along a direction, without turning, until it touches B.

    Parameters
    ----------
    A, B : Shape, or sequence of Shape
        A moves and B stands. Sequences have a shape for each cast, as of `collide.distance`.
    X_WA, X_WB : (4, 4) or (N, 4, 4) array_like, float64
        Poses in the world W [m]: of A before it moves.
    direction_W : (3,) or (N, 3) array_like, float64
        Of the motion, in W, of any length > 0. Single poses and directions go with all of the others.
    max_distance : float
        ≥ 0, [lengths of the direction], as of `collide.raycast`: how far A moves at most, t of the point
        p + t · direction. With the whole motion as direction and 1 here, t is the fraction that peers report.
    start_normals : bool
        Work out normals of bodies in contact at the start, at the cost of a penetration depth.
    check_poses : bool
        Refuse matrices that are no rotation.
    threads : int
        Answer a batch in at most so many threads; the answers are the same bits.

    Returns
    -------
    ShapeCasts
        Scalars for single arguments, arrays with a leading N otherwise. Touching counts: bodies that touch at the start
        are a hit at 0 wherever A moves, and bodies that graze each other are a hit where they graze.

    Raises
    ------
    InvalidArgument
        Directions of length 0, not finite, or of components that differ by more than 2^500; max_distance negative or
        NaN; start_normals neither True nor False; arguments not of type Shape; lengths that do not match.
    InvalidPose
        Matrices that are no pose.
    UnsupportedQuery
        An unbounded A: a half-space, or a union with half-spaces.

    Notes
    -----
    A ray against the Minkowski difference of the two (G. van den Bergen, "Ray casting against general convex objects
    with application to continuous collision detection", 2004), its silhouette first, then the entry by refining a
    portal (Snethen's XenoCollide), with proven bounds; an exact linear program where doubles leave a cast of polytopes
    open. About 1 to 3 µs a convex pair in batches; O(log n) a support point from 224 vertices on.

    Unions of m and k convex parts: a walk down the trees over both, the parts whose balls may meet soonest first, until
    a contact is proven sooner than all others can be: some tens of microseconds; m k where every part is in every
    other's way. Meshes of n facets: a walk down both trees by the same bounds, O(log n) and the facets as near as the
    first contact; of unions with meshes the convex sets around the parts are cast first, and the parts in that order.
    Bodies that touch at the start cost what `collide.collide` does.
    """
    is_plain = check_poses is True and start_normals is False and threads.__class__ is int and threads == 1
    if is_plain and max_distance.__class__ is float and max_distance >= 0.0:
        pair = prepared_pair(A, B)
        way = None if pair is None else pair.cast
        row = None if way is None else way.single_contact(X_WA, X_WB, direction_W, max_distance)
        if row is not None:
            return _single_cast(row)
    limit = checks.limit("shape_cast: max_distance", max_distance, "")
    start_normals = checks.true_or_false("shape_cast: start_normals", start_normals)
    X_WA, X_WB, single = asked_poses(A, B, X_WA, X_WB)
    X_WA, X_WB = as_poses(X_WA, "X_WA", check=check_poses), as_poses(X_WB, "X_WB", check=check_poses)
    directions, single_direction = checked_directions("shape_cast", "direction_W", direction_W, "a cast")
    counts = {"X_WA": len(X_WA), "X_WB": len(X_WB), "direction_W": len(directions.vectors)}
    n, _ = matched_counts(A, B, counts)
    refuse_unbounded("shape_cast: A", A)
    if single and single_direction:
        prepare_way(A, B)
    rows = _in_threads(A, B, X_WA, X_WB, directions.repeated(n), limit, start_normals, check_threads(threads))
    casts = as_casts(rows, directions.repeated(n))
    return ShapeCasts._make(only_value(values) for values in casts) if single and single_direction else casts


def _single_cast(row: np.ndarray) -> ShapeCasts:
    """The result of an answer of `union_cast.py`, empty where nothing is met."""
    if not len(row):
        return ShapeCasts(False, _INF, _INF, _INF, np.zeros(3), np.zeros(3), True, False, -1, -1)  # type: ignore[arg-type]
    t, lower, upper = row[T : T_UPPER + 1].tolist()
    point, normal = row[OUT_POINT : OUT_POINT + 3], row[OUT_NORMAL : OUT_NORMAL + 3]
    items = int(row[ITEM_A]), int(row[ITEM_B])
    return ShapeCasts(True, t, lower, upper, point, normal, True, bool(row[AT_START]), *items)  # type: ignore[arg-type]


def _in_threads(
    A, B, X_WA, X_WB, directions: Directions, limit: float, start_normals: bool, threads: int
) -> CastRows:
    n = len(directions.vectors)
    limits = directions.limits(limit)

    def answer(piece: slice) -> CastRows:
        A_k, B_k = (S if isinstance(S, Shape) else S[piece] for S in (A, B))
        X_WAk, X_WBk = (X if len(X) == 1 else X[piece] for X in (X_WA, X_WB))
        of_piece = Directions(directions.vectors[piece], directions.exponents[piece])
        return cast_batch(A_k, B_k, X_WAk, X_WBk, of_piece, limits[piece], start_normals)

    threads = min(threads, n // _MIN_PER_THREAD)
    if threads < 2:
        return answer(slice(0, n))
    answers = answers_in_order(pieces_of(n, threads, _MIN_PER_THREAD), answer, threads)
    return CastRows._make(map(np.concatenate, zip(*answers)))


def as_casts(rows: CastRows, directions: Directions) -> ShapeCasts:
    t = directions.t_of(rows.t)
    return ShapeCasts(
        rows.hit, t[:, 0], t[:, 1], t[:, 2], rows.point, rows.normal, rows.certified, rows.at_start, rows.item_a,
        rows.item_b,
    )
