"""The corners of the generalised gradient: of each pair of witness points, direction and pair of parts as near.

Of bodies apart the distance is the least, over all pairs of parts and of witness points, of numbers whose gradients are
n · (ḃ − ȧ): the corners are at corners of the areas where the support sets of both face each other. Of overlaps the
directions that are as short are looked for by pushing B a little along some fixed directions, and along the axes of
both bodies: a direction n' is least where B was pushed along n'.
"""

from __future__ import annotations

import math

import numpy as np

from collide.derivatives.active_parts import active_pairs, is_least_of_parts
from collide.derivatives.derived_rows import Derived
from collide.derivatives.differentiate import LEAST_PUSH, PUSHED, Ask
from collide.derivatives.features import LEVEL
from collide.derivatives.gradient_rows import GRADIENT, NO_DEPTH, STATE, TOO_FAR, UNCERTAIN, UNIQUE
from collide.lowering.packed_convex import CONE, ELLIPSOID, HALFSPACE, POINTS, PackedConvex
from collide.lowering.parts import is_single_convex, parts_of
from collide.shapes.shape import Shape

#: A rim's area has so many corners here.
_RIM_POINTS = 32
#: Gradients, and places of a plane, that differ by less than this part of the size are equal.
_EQUAL = 2.0**-28
#: Directions that differ by less are the same; a pushed pair's direction is as short within this part of the push.
_SAME_NORMAL, _AS_SHORT = 2.0**-12, 2.0**-4
#: Directions of pushes: of a cube's faces, edges and corners.
_PUSHES = np.array([p for p in np.ndindex(3, 3, 3) if p != (1, 1, 1)]) - 1.0
_PUSHES /= np.linalg.norm(_PUSHES, axis=1)[:, None]


def gradients_of_row(row: np.ndarray, question: tuple, derived: Derived, k: int, ask: Ask) -> np.ndarray:
    """(m, 12) corners of row k.   row : (1,).   question : of the row.   derived : of all rows."""
    state = derived.kinds[k, STATE]
    if state == UNIQUE:
        return derived.numbers[k : k + 1, GRADIENT : GRADIENT + 12].copy()
    A, B, (X_WA,), (X_WB,) = question
    if state in (UNCERTAIN, TOO_FAR, NO_DEPTH):
        return np.empty((0, 12))
    if is_single_convex(A) and is_single_convex(B):
        return distinct(_convex_corners(row, A, B, X_WA, X_WB, ask))
    if not is_least_of_parts(row[0], A, B):
        return np.empty((0, 12))
    active = active_pairs(A, B, X_WA, X_WB, float(row["upper"][0]), row["normal"][0])
    if active is None:
        return np.empty((0, 12))
    origins = X_WA[:3, 3], X_WB[:3, 3]
    return distinct(
        np.concatenate([
            corners(a, X_a, b, X_b, part["normal"], float(part["distance"]), part["point_a"], origins)
            for a, b, X_a, X_b, part in zip(*active.sets, *active.X, active.rows)
        ])
    )


def _convex_corners(row: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, ask: Ask) -> np.ndarray:
    """(m, 12) corners of two convex sets."""
    (a, _), (b, _) = parts_of(A)[0], parts_of(B)[0]
    gap, origins = float(row["distance"][0]), (X_WA[:3, 3], X_WB[:3, 3])
    size = a.reach + b.reach + a.radius + b.radius + abs(gap)
    directions = [row[0]]
    if gap + a.radius + b.radius <= LEVEL * size:
        pushes = np.concatenate([_PUSHES, *(sign * X[:3, :3].T for X in (X_WA, X_WB) for sign in (-1.0, 1.0))])
        push = max(PUSHED * abs(gap + a.radius + b.radius), LEAST_PUSH * (size + np.abs(origins).sum()))
        pushes *= push
        X_pushed = np.repeat(X_WB[None], len(pushes), axis=0)
        X_pushed[:, :3, 3] += pushes
        rows = ask(A, B, X_WA[None], X_pushed)
        distances = rows["distance"] - np.einsum("ij,ij->i", rows["normal"], pushes)
        directions += list(rows[np.abs(distances - gap) <= _AS_SHORT * push])
    normals = distinct(np.array([least["normal"] for least in directions]), _SAME_NORMAL)
    points = row["point_a"][0]
    return np.concatenate([corners(a, X_WA, b, X_WB, n, gap, points, origins) for n in normals])


def corners(
    a: PackedConvex, X_a: np.ndarray, b: PackedConvex, X_b: np.ndarray, n: np.ndarray, gap: float, p_a: np.ndarray,
    origins: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """(m, 12) gradients at the corners of the area where the support sets of a and b face each other along n.

    gap : signed distance [m].   p_a : a witness point of a, taken where no area is left by rounding.
    """
    size = a.reach + b.reach + abs(gap) + a.radius + b.radius
    across = np.linalg.svd(n[None])[2][1:]
    areas = [_support_points(a, X_a, n), _support_points(b, X_b, -n)]
    planes = [None if area is None else _outline(area @ across.T) for area in areas]
    places = _common_corners(planes[0], planes[1], _EQUAL * size)
    height = float(n @ p_a)
    points = places @ across + height * n if len(places) else p_a[None]
    normals = np.broadcast_to(n, points.shape)
    o_a, o_b = origins
    return np.hstack([np.cross(n, points - o_a), -normals, np.cross(points - o_b, n), normals])


def _support_points(packed: PackedConvex, X: np.ndarray, n: np.ndarray) -> np.ndarray | None:
    """(m, 3) corners of the points of a core farthest along n, in the world; ``None`` of half-spaces."""
    R, t = X[:3, :3], X[:3, 3]
    g, level = R.T @ n, 4.0 * LEVEL * packed.reach
    if packed.kind == HALFSPACE:
        return None
    if packed.kind == POINTS:
        heights = packed.points @ g
        return packed.points[heights >= heights.max() - level] @ R.T + t
    if packed.kind == ELLIPSOID:
        radii = packed.params[:3]
        return ((radii**2 * g) / np.linalg.norm(radii * g))[None] @ R.T + t
    radius, half = packed.params[:2]
    angle = math.atan2(g[1], g[0])
    angles = angle + np.arange(_RIM_POINTS) * (2.0 * np.pi / _RIM_POINTS)
    radial = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    tops = [np.column_stack([radial, np.full(_RIM_POINTS, end * half)]) for end in (-1.0, 1.0)]
    if packed.kind == CONE:
        tops[1] = np.array([[0.0, 0.0, half]])
    candidates = np.concatenate(tops)
    heights = candidates @ g
    return candidates[heights >= heights.max() - level] @ R.T + t


def distinct(gradients: np.ndarray, equal: float = _EQUAL) -> np.ndarray:
    """Rows that differ by more than a part of the largest number."""
    rows: list[np.ndarray] = []
    scale = equal * max(1.0, np.abs(gradients).max(initial=0.0))
    for row in gradients:
        if not any(np.abs(row - before).max() <= scale for before in rows):
            rows.append(row)
    return np.array(rows).reshape(-1, gradients.shape[1])


def _outline(points: np.ndarray) -> np.ndarray:
    """(m, 2) corners of the hull of points of a plane, counter-clockwise (monotone chains; Andrew 1979)."""
    order = points[np.lexsort((points[:, 1], points[:, 0]))]
    chains: list[list[np.ndarray]] = []
    for run in (order, order[::-1]):
        chain: list[np.ndarray] = []
        for p in run:
            while len(chain) > 1 and _area(chain[-2], chain[-1], p) <= 0.0:
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    outline = np.array([*chains[0], *chains[1]])
    return outline if len(outline) else order[:1]


def _area(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _common_corners(outline_a: np.ndarray | None, outline_b: np.ndarray | None, off: float) -> np.ndarray:
    """(m, 2) corners of the common part of two convex outlines.   ``None`` : the whole plane.   off : rounding [m]."""
    if outline_a is None or outline_b is None:
        rest = outline_b if outline_a is None else outline_a
        return np.empty((0, 2)) if rest is None else rest
    corners_ = [p for p in outline_a if _is_within(p, outline_b, off)]
    corners_ += [p for p in outline_b if _is_within(p, outline_a, off)]
    for i in range(len(outline_a) if len(outline_a) > 1 else 0):
        for j in range(len(outline_b) if len(outline_b) > 1 else 0):
            corners_ += _crossing(outline_a[i - 1], outline_a[i], outline_b[j - 1], outline_b[j])
    return np.array(corners_).reshape(-1, 2)


def _is_within(p: np.ndarray, outline: np.ndarray, off: float) -> bool:
    if len(outline) == 1:
        return bool(np.linalg.norm(p - outline[0]) <= off)
    if len(outline) == 2:
        along = outline[1] - outline[0]
        t = min(max(float((p - outline[0]) @ along / (along @ along)), 0.0), 1.0)
        return bool(np.linalg.norm(p - outline[0] - t * along) <= off)
    sides = zip(outline, np.roll(outline, 1, axis=0))
    return all(_area(before, corner, p) >= -off * np.linalg.norm(corner - before) for corner, before in sides)


def _crossing(p: np.ndarray, q: np.ndarray, r: np.ndarray, s: np.ndarray) -> list[np.ndarray]:
    """The point where two segments cross, unless parallel."""
    u, v = q - p, s - r
    det = float(u[0] * v[1] - u[1] * v[0])
    if abs(det) <= _EQUAL * float(np.linalg.norm(u) * np.linalg.norm(v)):
        return []
    w = r - p
    t, x = (w[0] * v[1] - w[1] * v[0]) / det, (w[0] * u[1] - w[1] * u[0]) / det
    return [p + t * u] if -_EQUAL <= t <= 1.0 + _EQUAL and -_EQUAL <= x <= 1.0 + _EQUAL else []
