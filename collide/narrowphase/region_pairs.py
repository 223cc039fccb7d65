"""Pairs with a region of half-spaces (`HPolytope` kept as planes): closed by a box, then sent to the table again.

Two bodies without end, a region and another or a half-space, have no box proven to change nothing. Whether they meet is
a program over the planes of both, exact. Their gap or depth comes from boxes growing until the deciding points are well
inside: certified are the sign, and the side of the bracket provable from a smaller set.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np

from collide.least_distance.homogeneous_rows import HomogeneousRows
from collide.least_distance.interior_point import origin_point
from collide.least_distance.nearest_pair import EMPTY, nearest_pair
from collide.least_distance.pair_proposals import Work
from collide.least_distance.posed_rows import rows_of_planes
from collide.least_distance.posed_sets import ExactRow, exact_pose, planes_at, planes_seen_from
from collide.lowering.closed_regions import box_sizes, closed, closings
from collide.narrowphase.bounds import PROMISE_STORED
from collide.narrowphase.convex_batches import Question
from collide.numerics.exact_vectors import dot
from collide.results import EXACT, PAIR_DTYPE
from collide.shapes.height_field import HeightField
from collide.shapes.hpolytope import HPolytope, Plane
from collide.shapes.primitives import Halfspace
from collide.shapes.shape import Shape
from collide.transforms import LARGEST

#: A method's function for two shapes: ``batch(out, A, B, X_WA, X_WB, question)``.
Batch = Callable[..., bool]
#: (n, 4, 4) each, of A and of B.
Poses = tuple[np.ndarray, np.ndarray]
#: A deciding point nearer to the box than this part of its size says nothing.
_INSIDE = 1.0 - 2.0**-10
#: Boxes grow by this.
_GROWTH = 16.0
#: What a root and two quotients round; a gap of which no more is known than that it is one.
_ROUNDED, _LEAST_GAP = 2.0**-48, 5e-324
#: Directions whose cone is all of space.
_DIRECTIONS = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, -1, -1))


def answer_closed(
    batch_of: Callable[[Shape, Shape], Batch], out: np.ndarray, A: Shape, B: Shape, poses: Poses, question: Question
) -> None:
    """Answers of a region and a body that has an end, at checked poses.

    batch_of : what answers two other shapes.   out, question : as of `convex_batches.answer_sets`.
    """
    answer = _answer_sides if _are_terrain_and_plane(A, B) else _answer_boxed
    answer(batch_of, out, A, B, poses, question)


def _answer_boxed(
    batch_of: Callable[[Shape, Shape], Batch], out: np.ndarray, A: Shape, B: Shape, poses: Poses, question: Question
) -> None:
    X_WA, X_WB = poses
    for K_a, K_b, some in closings(A, B, X_WA, X_WB):
        part, axes = out[some], None if question.axes is None else question.axes[some]
        batch_of(K_a, K_b)(
            part, K_a, K_b, X_WA[some], X_WB[some], question._replace(check=False, axes=axes)
        )
        out[some] = part
        if axes is not None and question.axes is not None:
            question.axes[some] = axes


def _are_terrain_and_plane(A: Shape, B: Shape) -> bool:
    """Whether a pair is a `Plane` and a height field without holes, in either order."""
    plane, field = (A, B) if isinstance(A, Plane) else (B, A)
    return isinstance(plane, Plane) and isinstance(field, HeightField) and not field.has_holes


def _answer_sides(
    batch_of: Callable[[Shape, Shape], Batch], out: np.ndarray, A: Shape, B: Shape, poses: Poses, question: Question
) -> None:
    """Answers of a `Plane` and terrain without holes by the two half-spaces of the plane; arguments as of
    `answer_closed`.

    Such terrain is connected: heights x · n of the terrain are an interval [m, M], heights of the plane [l, h]. Both
    meet where m ≤ h and l ≤ M, so where the terrain meets both half-spaces, x · n ≤ h and x · n ≥ l. A translation
    parts terrain and plane where terrain and a half-space part: the signed distance is the larger of m − h and l − M. A
    common point and the facet nearest across a gap come from a walk down the tree of a mesh, where triangles of all
    cells may be made.
    """
    plane, field = (A, B) if isinstance(A, Plane) else (B, A)
    assert isinstance(plane, Plane) and isinstance(field, HeightField)
    X_WA, X_WB = (np.ascontiguousarray(X) for X in poses)
    answers = []
    for normal, offset in zip(plane.normals, plane.offsets.tolist()):
        side, answer = Halfspace(normal, offset), np.zeros_like(out)
        pair = (side, B) if A is plane else (A, side)
        batch_of(*pair)(answer, *pair, X_WA, X_WB, question._replace(check=False, axes=None))
        answers.append(answer)
    first, second = answers
    if question.boolean:
        out[:] = first & second
        return
    out[:] = np.where(first["distance"] >= second["distance"], first, second)
    for bound in ("lower", "upper"):
        out[bound] = np.maximum(first[bound], second[bound])
    for verdict in ("hit", "certified"):
        out[verdict] = first[verdict] & second[verdict]
    out["part_b" if A is plane else "part_a"][out["hit"]] = -1
    rest = np.flatnonzero(~out["hit"] & ~field.is_field | out["hit"] & ~question.depths)
    if len(rest):
        part = np.zeros_like(out[rest])
        _answer_boxed(batch_of, part, A, B, (X_WA[rest], X_WB[rest]), question)
        out[rest] = _as_far_as(part, out[rest])


def _as_far_as(rows: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Rows of a plane within a box, whose corners are rounded, where they say the same as rows known of the plane
    itself; else those, or a place halfway between two points a rounding apart.
    """
    rows = np.where(rows["hit"] > known["hit"], known, rows)
    near = rows["hit"] < known["hit"]
    rows["hit"][near] = rows["certified"][near] = True
    for length in ("distance", "lower", "upper", "normal"):
        rows[length][near] = 0.0
    rows["point_a"][near] = rows["point_b"][near] = 0.5 * (rows["point_a"] + rows["point_b"])[near]
    return rows


def answer_unbounded(
    batch_of: Callable[[Shape, Shape], Batch], out: np.ndarray, A: Shape, B: Shape, poses: Poses, question: Question
) -> None:
    """As `answer_closed`, for two bodies without end."""
    X_WA, X_WB = poses
    for k in range(len(out)):
        gap, is_unbounded = _state(A, B, X_WA[k], X_WB[k], with_depth=question.depths and not question.boolean)
        hit = gap == 0.0
        if question.boolean:
            out[k] = hit
        elif is_unbounded or (hit and not question.depths):
            _write_common_point(out[k : k + 1], -math.inf if question.depths else 0.0)
        else:
            out[k] = _row(batch_of, A, B, X_WA[k : k + 1], X_WB[k : k + 1], gap)


def _state(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, with_depth: bool) -> tuple[float, bool]:
    """(lower bound of the gap [m], 0 exactly where the bodies meet; whether their overlap has no end).

    Both computed in the frame of the body with more planes.
    """
    if len(_planes_of(A)[0]) < len(_planes_of(B)[0]):
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    normals, offsets = _planes_of(A)
    seen = planes_seen_from(planes_at(*_planes_of(B), exact_pose(X_WB)), exact_pose(X_WA))
    gap = _gap_of(rows_of_planes(seen, normals, offsets), len(normals), X_WA)
    if gap > 0.0 or not with_depth:
        return gap, False
    # Bodies can part along a normal unless differences of directions in which they are endless are all directions.
    zeros = np.zeros(len(offsets))
    return 0.0, all(
        _gap_of(rows_of_planes([_through(plane, v) for plane in seen], normals, zeros), 0, X_WA) == 0.0
        for v in _DIRECTIONS
    )


def _planes_of(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(shape, Halfspace):
        return shape.normal[None], np.array([shape.offset])
    assert isinstance(shape, HPolytope)
    return shape.normals, shape.offsets


def _through(plane: ExactRow, v: tuple[int, ...]) -> ExactRow:
    """The half-space behind a parallel plane through a point."""
    return [*plane[:3], dot(plane, [Fraction(x) for x in v])]


def _gap_of(halfspaces: HomogeneousRows, n_first: int, X: np.ndarray) -> float:
    """0 where half-spaces have a point in common, else a proven width [m] between the first n and the others.

    Multipliers μ ≥ 0 with Σ μᵢ aᵢ = 0 and Σ μᵢ bᵢ < 0: with u the sum over the first, u·x ≤ c in the first, and in the
    others u·x ≥ c + |Σ μᵢ bᵢ|.   X : pose of all half-spaces; the width is measured in the world.
    """
    pair = nearest_pair(origin_point(3), halfspaces, Work())
    if pair.kind != EMPTY:
        return 0.0
    terms = [(row, [mu * v for v in halfspaces.integers(row)]) for row, mu in zip(pair.halfspaces, pair.multipliers)]
    u = [sum(vector[axis] for row, vector in terms if row < n_first) for axis in range(3)]
    width = -sum(vector[3] for _, vector in terms)
    bits = max(*map(abs, u), width).bit_length()
    scaled = np.array([float(Fraction(v, 1 << bits)) for v in u])
    across = float(np.linalg.norm(np.linalg.solve(X[:3, :3].T, scaled)))
    if across == 0.0:
        return _LEAST_GAP
    return max(float(Fraction(width, 1 << bits)) / across * (1.0 - _ROUNDED), _LEAST_GAP)


def _write_common_point(row: np.ndarray, distance: float) -> None:
    """Bodies that meet, in how deep an overlap nobody can or wants to say."""
    row["hit"], row["how"], row["exact"], row["distance"], row["lower"] = True, EXACT, 1, distance, distance
    row["certified"] = distance == 0.0
    row["normal"] = (0.0, 0.0, 0.0 if distance == 0.0 else 1.0)


def _row(batch_of, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, gap: float) -> np.ndarray:
    """The row of two bodies at poses (1, 4, 4) that are ``gap`` [m] apart at least, or whose overlap has an end."""
    hit = gap == 0.0
    apart = np.array([float(np.linalg.norm(X_WB[0, :3, 3] - X_WA[0, :3, 3]))])
    size = max(float(box_sizes(S, apart)[0]) for S in (A, B) if isinstance(S, HPolytope))
    while True:
        K_a, K_b = (closed(S, size) if isinstance(S, HPolytope) else S for S in (A, B))
        row = np.zeros(1, dtype=PAIR_DTYPE)
        batch_of(K_a, K_b)(row, K_a, K_b, X_WA, X_WB, Question(False, math.inf))
        decided = _is_inside(A, X_WA[0], row["point_a"][0], size) and _is_inside(B, X_WB[0], row["point_b"][0], size)
        if (decided and bool(row["hit"][0]) == hit) or size * _GROWTH > LARGEST / 4.0:
            break
        size *= _GROWTH
    row["hit"], row["certified"], row["how"], row["exact"] = hit, False, EXACT, 1
    if hit:
        row["lower"], row["upper"] = -math.inf, np.minimum(row["upper"], 0.0)
    else:
        row["upper"] = np.maximum(row["upper"], gap)
        row["lower"] = gap
        row["certified"] = row["upper"] - gap <= PROMISE_STORED * size
    row["distance"] = np.clip(row["distance"], row["lower"], row["upper"])
    row["count"], row["vertices_a"], row["vertices_b"] = 0, -1, -1
    return row


def _is_inside(shape: Shape, X_WS: np.ndarray, point: np.ndarray, size: float) -> bool:
    """Whether a point of a region is well inside its box."""
    if not shape.is_region:
        return True
    return bool(np.abs(np.linalg.solve(X_WS[:3, :3], point - X_WS[:3, 3])).max() < _INSIDE * size)

