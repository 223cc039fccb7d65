"""Pairs left to others by a checker's kernels: meshes that are not convex, and pairs undecided in doubles.

Each pair is asked of `collide.collide` or `collide.distance` at the poses of its links, bodies as handed in. For
overlapping unions of convex parts the deepest two parts are asked: kernels read unions as their parts.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from collide.pairs import query
from collide.results import PAIR_DTYPE
from collide.robots.check_tables import BodyAround, RobotBody, without_meshes
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape


def are_hits(
    pairs: np.ndarray, X_WLs: np.ndarray, bodies: Sequence[RobotBody], around: Sequence[BodyAround], *,
    once: bool = False,
) -> np.ndarray:
    """(k,) bool: pairs with a hit. A body of the robot is swollen by its padding, a body around by its margin, where
    the pair has a body around.

    once : of a configuration with a hit further pairs need not be asked, and may stay False.
    pairs : (k, 3 or more), configurations as rows of X_WLs (N, links, 4, 4).
    """
    out, collides = np.zeros(len(pairs), dtype=bool), np.zeros(len(X_WLs), dtype=bool)
    for rows, A, B, X_WA, X_WB, padding, margin in _batches(pairs, X_WLs, bodies, around):
        is_open = ~collides[pairs[rows, 0]]
        if once and not is_open.all():
            rows, X_WA, X_WB = rows[is_open], X_WA[is_open], X_WB[is_open] if len(X_WB) > 1 else X_WB
        if len(rows):
            out[rows] = query.collide(A, B, X_WA, X_WB, security_margin=padding + margin, check_poses=False)
            collides[pairs[rows[out[rows]], 0]] = True
    return out


def distances(
    pairs: np.ndarray, X_WLs: np.ndarray, bodies: Sequence[RobotBody], around: Sequence[BodyAround], *, limit,
    by_parts: bool = False, signed: bool = True,
) -> np.ndarray:
    """(k,) rows of PAIR_DTYPE of pairs as of `are_hits`, ``a`` and ``b`` numbered as in pairs; ``beyond`` a limit [m].

    limit : of all pairs, or (k,) of each, which may be exceeded.   by_parts : overlapping unions of convex parts give
        their deepest two parts, else a separating translation of the unions.   signed : whether depths are wanted.
    Distances are of the swollen bodies: the distance of the bodies less padding and margin, for convex bodies exactly
    the signed distance of the swollen bodies. Points lie on the swollen bodies.
    """
    out = np.zeros(len(pairs), dtype=PAIR_DTYPE)
    for rows, A, B, X_WA, X_WB, padding, margin in _batches(pairs, X_WLs, bodies, around):
        farthest = float(np.max(limit if np.ndim(limit) == 0 else limit[rows]))
        if padding + margin > 0.0:  # two sums, each rounded to the nearest: what is beyond is to be beyond the limit
            farthest = math.nextafter(math.nextafter(farthest + padding + margin, math.inf), math.inf)
        within = _rows_of(A, B, X_WA, X_WB, farthest, by_parts, signed)
        if padding + margin > 0.0:
            _swell(within, padding + margin)
        within["point_a"] += padding * within["normal"]
        within["point_b"] -= margin * within["normal"]
        if padding + margin > 0.0:
            within["hit"] |= within["upper"] <= 0.0
            open_ = np.flatnonzero(~within["hit"] & (within["lower"] <= 0.0))
            if len(open_):  # what brackets leave open is decided as `are_hits` does
                swell = padding + margin
                X_WB = np.broadcast_to(X_WB, X_WA.shape)[open_]
                within["hit"][open_] = query.collide(A, B, X_WA[open_], X_WB, security_margin=swell, check_poses=False)
        out[rows] = within
    out["a"], out["b"] = pairs[:, 1], pairs[:, 2]
    return out


def nearer_of(mine: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """(k,) the nearer of each two rows, its bracket a bracket of the least distance of both; ``a`` < 0 where neither
    has a pair.

    Rivals, rows with overlapping brackets, widen the bracket: the least distance is at least the lesser lower bound.
    """
    is_nearer = distances_of(theirs) < distances_of(mine)
    is_rival = (mine["a"] >= 0) & (theirs["a"] >= 0)
    is_rival &= np.where(is_nearer, mine["lower"] <= theirs["upper"], theirs["lower"] <= mine["upper"])
    out = np.where(is_nearer, theirs, mine)
    out["lower"][is_rival] = np.minimum(mine["lower"], theirs["lower"])[is_rival]
    out["certified"][is_rival] = (mine["certified"] & theirs["certified"])[is_rival]
    return out


def distances_of(rows: np.ndarray) -> np.ndarray:
    """(k,) distances [m], infinite where there is no pair."""
    return np.where(rows["a"] >= 0, rows["distance"], np.inf)


def _rows_of(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, limit: float, by_parts: bool, signed: bool
) -> np.ndarray:
    """Rows of two shapes at poses (k, 4, 4), as of `distances`."""
    parts_a, parts_b = (without_meshes(A), without_meshes(B)) if by_parts else (None, None)
    if parts_a is None or parts_b is None:
        rows = query.distance(A, B, X_WA, X_WB, max_distance=limit, signed=signed, check_poses=False).rows
        return rows.copy()
    A, B = parts_a, parts_b
    rows = query.distance(A, B, X_WA, X_WB, max_distance=limit, check_poses=False).rows.copy()
    overlap = np.flatnonzero(rows["distance"] < 0.0)
    pairs = list(itertools.product(_parts_as_shapes(A), _parts_as_shapes(B)))
    if len(pairs) > 1 and len(overlap):
        X_WA, X_WB = X_WA[overlap], np.broadcast_to(X_WB, X_WA.shape)[overlap]
        deepest = [query.distance(*pair, X_WA, X_WB, max_distance=0.0, check_poses=False).rows for pair in pairs]
        rows[overlap] = functools.reduce(nearer_of, deepest)
    return rows


def _parts_as_shapes(shape: Shape) -> list[Shape]:
    """The items of a `Compound` as shapes in the compound's frame, nested compounds flattened; else [shape]."""
    if not isinstance(shape, Compound):
        return [shape]
    return [Compound([(part, X)]) for item, X in shape.items for part in _parts_as_shapes(item)]


def _swell(rows: np.ndarray, by: float) -> None:
    """Take the swelling of both bodies [m], a sum that was rounded once, off distances; brackets stay proven."""
    # Bodies that touch have no derivative of their distance, and are not to seem to have any.
    rows["certified"] &= rows["distance"] != 0.0
    rounding = 2.0**-53 * by  # of the sum; differences are rounded to the nearest, which is at most the next double
    for field, outwards in (("lower", -math.inf), ("upper", math.inf)):
        swollen = np.nextafter(rows[field] - by, outwards)
        rows[field] = np.nextafter(swollen + math.copysign(rounding, outwards), outwards)
    rows["distance"] -= by


def _batches(
    pairs: np.ndarray, X_WLs: np.ndarray, bodies: Sequence[RobotBody], around: Sequence[BodyAround]
) -> Iterator[tuple]:
    """(rows of pairs, A, B, X_WA, X_WB, padding, margin) of those of the same two bodies."""
    if not len(pairs):
        return
    order = np.lexsort((pairs[:, 2], pairs[:, 1]))
    starts = np.flatnonzero((np.diff(pairs[order, 1:3], axis=0, prepend=pairs[order[:1], 1:3] - 1) != 0).any(axis=1))
    for rows in np.split(order, starts[1:]):
        a, b = pairs[rows[0], 1:3].tolist()
        A, k = bodies[a], pairs[rows, 0]
        X_WA = np.ascontiguousarray(X_WLs[k, A.link])
        if b >= 0:
            B = bodies[b]
            swell = (A.padding, B.padding) if A.is_obstacle or B.is_obstacle else (0.0, 0.0)
            yield rows, A.shape, B.shape, X_WA, np.ascontiguousarray(X_WLs[k, B.link]), *swell
        else:
            stands = around[-1 - b]
            yield rows, A.shape, stands.shape, X_WA, stands.X_WB[None], A.padding, stands.margin
