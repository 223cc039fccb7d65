"""Rows of pairs with a cylinder, cone or ellipsoid that doubles leave open, settled in integers."""

from __future__ import annotations

import math
from ctypes import c_double
from fractions import Fraction
from functools import lru_cache
from math import isqrt

import numpy as np

from collide.curved.shape_kinds import CONE, CYLINDER, ELLIPSOID, POINTS
from collide.hull.exact_hull import convex_hull
from collide.lowering.shape_table import (
    ADDRESS,
    COUNT,
    KIND,
    PADDED,
    PARAMS,
    POSE_SLOP,
    POSE_TERMS,
    RADIUS,
    REACH,
    SLOP,
    PoseTable,
)
from collide.narrowphase.bounds import PROMISE_CURVED
from collide.narrowphase.exact_curved.curved_pair import Decision, settle_pair
from collide.narrowphase.exact_curved.integer_bodies import (
    CurvedBody,
    IntegerBody,
    IntegerPose,
    SweptPoints,
    Units,
    Vector,
    least_height,
    opposite,
    units_of,
    whole,
)
from collide.narrowphase.fallback_searches import lay_points_apart
from collide.numerics.exact_vectors import inner
from collide.results import EXACT

_SIZES = {CYLINDER: 2, CONE: 2, ELLIPSOID: 3}
#: So many points are taken without a look at which of them are near.
_MAX_UNSORTED = 32


def settle_curved(
    rows: np.ndarray, undecided: np.ndarray, pairs: np.ndarray, table, poses: PoseTable, shape_of: np.ndarray,
    limit: float,
) -> None:
    """Settle in place the undecided rows (given by number) with a cylinder, cone or ellipsoid.

    rows : `PAIR_DTYPE`, of a distance.   pairs, table, poses, shape_of : as of `run_pairs`.
    limit : larger distances are not wanted [m].
    Rows of half-spaces are left to `exact_halfspace.py`; poses rounded without exact terms, and rounded corners, stay
    open.
    """
    for k in undecided.tolist():
        parts = [int(part) for part in pairs[k]]
        sets = [int(shape_of[part]) for part in parts]
        if _is_served(table, poses, sets, parts):
            row = rows[k : k + 1]
            n = _normal_of(row)
            A, B, units = _integer_bodies(table, poses, sets, parts, n)
            decision = settle_pair(A, B, n, _point_of(row, units))
            if not decision.is_open:
                _write(row, decision, A, B, units, limit, _size_of(table, poses, sets, parts))


def _is_served(table, poses: PoseTable, sets: list[int], parts: list[int]) -> bool:
    kinds = [int(table.ints[s, KIND]) for s in sets]
    if not (any(kind in _SIZES for kind in kinds) and all(kind in _SIZES or kind == POINTS for kind in kinds)):
        return False
    if any(table.numbers[s, SLOP] for s in sets):
        return False
    return all(poses.rows[p, POSE_SLOP] == 0.0 or poses.rows[p, POSE_TERMS] >= 0.0 for p in parts)


def _size_of(table, poses: PoseTable, sets: list[int], parts: list[int]) -> float:
    """The size S of a pair (`bounds.py`) under matrices without stretch [m]."""
    p_WA, p_WB = poses.rows[parts, 9:12]
    return float(table.numbers[sets][:, [REACH, RADIUS]].sum() + np.linalg.norm(p_WB - p_WA))


def _integer_bodies(
    table, poses: PoseTable, sets: list[int], parts: list[int], n: Vector
) -> tuple[IntegerBody, IntegerBody, Units]:
    """Bodies A and B in integers.   n : a direction from A to B, along which many points are sorted out."""
    entries = [poses.exact(part) for part in parts]
    points = [_points(table, s) if table.ints[s, KIND] == POINTS else None for s in sets]
    sizes = [
        [Fraction(x) for x in table.numbers[s, PARAMS : PARAMS + _SIZES.get(int(table.ints[s, KIND]), 0)].tolist()]
        for s in sets
    ]
    radii = [Fraction(float(table.numbers[s, RADIUS])) for s in sets]
    lengths = [x for e in entries for x in e[9:]] + sizes[0] + sizes[1] + radii
    lengths += [Fraction(x) for p in points if p is not None for x in p.ravel().tolist()]
    units = units_of(lengths, [x for e in entries for x in e[:9]])
    curved = {
        k: CurvedBody(int(table.ints[s, KIND]), [whole(x, units.length) for x in sizes[k]], IntegerPose(e, units))
        for k, (s, e) in enumerate(zip(sets, entries))
        if points[k] is None
    }
    bodies: list[IntegerBody] = []
    for k, (m, corners) in enumerate(zip((n, opposite(n)), points)):
        if corners is None:
            bodies.append(curved[k])
        else:
            radius = whole(radii[k], units.length) << units.rotation
            bodies.append(_swept_points(corners, radius, IntegerPose(entries[k], units), units, curved[1 - k], m))
    return bodies[0], bodies[1], units


def _swept_points(
    corners: np.ndarray, radius: int, pose: IntegerPose, units: Units, C: CurvedBody, n: Vector
) -> SweptPoints:
    """Points (m, 3) swept by a ball, in integers; of many, the points that can be near a curved set C along n.

    All that the hull and C share has n·x + radius |n| ≥ h, the least n·x over C. The hull's part above h is within the
    hull of the corners above h and their neighbours, since an edge crosses h between two of these.
    """

    def placed(k: int) -> Vector:
        return pose.placed([whole(Fraction(x), units.length) for x in corners[k].tolist()])[:3]

    if len(corners) <= _MAX_UNSORTED:
        return SweptPoints([placed(k) for k in range(len(corners))], radius, *_topology(corners.tobytes()))
    triangles = np.array(_topology(corners.tobytes())[0], dtype=np.int64).reshape(-1, 3)
    R = np.array([[float(Fraction(x, 1 << units.rotation)) for x in row] for row in pose.rows])
    size = np.abs(corners).sum(axis=1).max() + 1e-300

    def candidates(m: Vector, least: int | None) -> np.ndarray:
        """Rows perhaps farthest along m, or as far as ``least``; doubles are off by 1e-14 of the size."""
        length = max(max(abs(x) for x in m), 1)
        heights = corners @ (R.T @ np.array([float(Fraction(x, length)) for x in m]))
        limit = heights.max()
        if least is not None:
            limit = min(limit, float(Fraction(least - inner(m, pose.p), length << units.world)))
        return np.flatnonzero(heights >= limit - 1e-9 * size)

    def support(m: Vector) -> int:
        return max(inner(m, placed(int(k))) for k in candidates(m, None))

    reach = radius * (isqrt(inner(n, n)) + 1)
    near = candidates(n, least_height(C, n) - reach)
    beside = triangles[np.isin(triangles, near).any(axis=1)] if len(triangles) else np.arange(len(corners))
    taken = np.unique(np.concatenate([near, beside.ravel()]))
    return SweptPoints([placed(int(k)) for k in taken], radius, *_topology(corners[taken].tobytes()), support)


def _points(table, s: int) -> np.ndarray:
    """(n, 3) the points of row s of a table."""
    n, padded = int(table.ints[s, COUNT]), int(table.ints[s, PADDED])
    columns = np.ctypeslib.as_array((c_double * (3 * padded)).from_address(int(table.ints[s, ADDRESS])))
    return columns.reshape(3, padded)[:, :n].T.copy()


@lru_cache(256)
def _topology(points: bytes) -> tuple[list[list[int]], list[tuple[int, int]], bool]:
    """(triangles, edges, whether solid) of the hull of points; triangles are counter-clockwise seen from outside."""
    hull = convex_hull(np.frombuffer(points).reshape(-1, 3))
    triangles = hull.facets.tolist()
    edges = {(min(i, j), max(i, j)) for a, b, c in triangles for i, j in ((a, b), (b, c), (c, a))}
    if hull.dimension == 1:
        points_of = np.frombuffer(points).reshape(-1, 3)[hull.vertices]
        order = np.lexsort(points_of.T)
        edges = {(int(hull.vertices[order[0]]), int(hull.vertices[order[-1]]))}
    return triangles, sorted(edges), hull.dimension == 3


def _normal_of(row: np.ndarray) -> Vector:
    """The row's normal, from A to B, as integers."""
    return tuple(int(x) for x in np.rint(np.nan_to_num(row["normal"][0]) * 2.0**60).tolist())  # type: ignore[return-value]


def _point_of(row: np.ndarray, units: Units) -> tuple[int, int, int, int]:
    """The middle of the row's points, in units of the world."""
    middle = [Fraction(x) for x in (0.5 * (row["point_a"][0] + row["point_b"][0])).tolist()]
    scale = max(x.denominator for x in middle)
    return (*(x.numerator * (scale // x.denominator) << units.world for x in middle), scale)  # type: ignore[return-value]


def _write(
    row: np.ndarray, decision: Decision, A: IntegerBody, B: IntegerBody, units: Units, limit: float, size: float
) -> None:
    """What was decided, into a row.   size : S of the pair (`bounds.py`) [m]."""
    row["how"], row["exact"] = EXACT, 1
    is_hit = decision.point is not None
    row["hit"] = is_hit
    if is_hit:
        row["upper"] = np.minimum(row["upper"], 0.0)
        if decision.normal is not None:
            row["lower"] = row["upper"] = row["distance"] = 0.0
            row["normal"] = _unit(decision.normal)
        row["distance"] = np.minimum(row["distance"], row["upper"])
    else:
        gap = 0.0 if decision.normal is None else _gap(A, B, decision.normal, units)
        row["lower"] = np.maximum(row["lower"], gap)
        if decision.normal is not None:
            row["normal"] = _unit(decision.normal)
        row["upper"] = np.maximum(row["upper"], np.nextafter(row["lower"], np.inf))
        row["distance"] = np.clip(row["distance"], row["lower"], row["upper"])
        row["distance"] = np.where(row["distance"] > 0.0, row["distance"], row["upper"])
        if row["lower"][0] > limit:
            row["beyond"], row["upper"], row["distance"] = True, math.inf, row["lower"]
    row["certified"] = row["beyond"] | (row["upper"] - row["lower"] <= PROMISE_CURVED * size)
    lay_points_apart(row, np.zeros(1, dtype=np.int64))


def _unit(n: Vector) -> np.ndarray:
    shift = max(max(abs(x) for x in n).bit_length() - 1000, 0)
    v = np.array([float(x >> shift) for x in n])
    v /= np.abs(v).max()
    return v / math.sqrt(float(v @ v)) + 0.0


def _gap(A: IntegerBody, B: IntegerBody, n: Vector, units: Units) -> float:
    """A lower bound of the distance [m] of bodies apart along n, at least 0."""
    square = sum(x * x for x in n)
    extra = 128  # bits after the point of all roots
    overlap = max(
        (r.a + s.a << extra) + isqrt(r.b << 2 * extra) + isqrt(s.b << 2 * extra) + 2
        for r in A.reaches(n)
        for s in B.reaches(opposite(n))
    )
    if overlap >= 0:
        return 0.0
    gap = Fraction(-overlap, (isqrt(square << 2 * extra) + 1) << units.world)
    return max(math.nextafter(float(gap), 0.0), 0.0)
