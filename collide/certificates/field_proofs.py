"""Proofs about point clouds and grids: a hit by one item, a gap by planes, each item beyond at least a plane.

With a normal n and the vertex b of the other body farthest along n, an item is beyond the plane where
n·(p − b) > (r_p + r_b)|n|, p being its point, or its corner least far along n. The right side is replaced by a
slightly larger fraction. The left side is taken in doubles with a bound of rounding, and as fractions for items left
open by doubles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.certificates.certificate import PLANE, TOGETHER, Certificate
from collide.certificates.convex_proofs import flaw_of_proof
from collide.certificates.exact_parts import ExactPart, exact_parts, has_exact_numbers
from collide.certificates.nearest_to_origin import nearest_to_origin, nearest_vertex_pairs
from collide.lowering.convex_sets import HALFSPACE, POINTS
from collide.numerics.exact_points import Point, in_integers, leading_digits, opposite
from collide.numerics.exact_vectors import inner, minus
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape
from collide.shapes.voxel_grid import VoxelGrid

#: Stands for all items of a field, which planes part from a body.
EVERY_ITEM = -1
#: Planes of a certificate at most: of more there is none. Bits of a normal's components.
_MAX_PLANES, _BITS = 1000, 40
#: Of the numbers added up, what rounding of their products and sums is less than.
_ROUNDING = 2.0**-48
_CORNERS = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)


def has_field_certificates(A: Shape, B: Shape) -> bool:
    """Whether pairs of these may have a certificate: a cloud or a grid, and convex parts of exact numbers."""
    field, body = (A, B) if A.is_field else (B, A)
    if not isinstance(field, (PointCloud, VoxelGrid)) or body.is_asked_whole:
        return False
    return all(has_exact_numbers(part) for part in exact_parts(body, np.eye(4)))


class _Field(NamedTuple):
    """Items in the field's frame: points (n, 3), or corners ``low``, ``high`` of boxes, radii (n,) and numbers (n,)."""

    low: np.ndarray
    high: np.ndarray
    radii: np.ndarray
    numbers: np.ndarray
    X_WF: np.ndarray
    X_FG: np.ndarray

    def picked(self, rows) -> _Field:
        low, high, radii, numbers = (column[rows] for column in (self.low, self.high, self.radii, self.numbers))
        return self._replace(low=low, high=high, radii=radii, numbers=numbers)

    def part(self, row: int) -> ExactPart:
        """An item."""
        points = np.unique(np.where(_CORNERS, self.high[row], self.low[row]), axis=0)
        return ExactPart(POINTS, points, float(self.radii[row]), None, self.X_WF, self.X_FG)


def _field_of(field: Shape, X_WF: np.ndarray) -> _Field:
    if isinstance(field, PointCloud):
        return _Field(field.points, field.points, field.radii, np.arange(len(field)), X_WF, np.eye(4))
    assert isinstance(field, VoxelGrid)
    tree = field.tree
    boxes = tree.boxes_in(np.zeros(3), np.array(tree.shape))
    return _Field(*tree.corners(boxes.least, boxes.size), np.zeros(len(boxes.numbers)), boxes.numbers, X_WF, field.X_FG)


def _numbered(field: Shape, X_WF: np.ndarray, number: int) -> ExactPart | None:
    """The item of a number; None for a number without an item."""
    if isinstance(field, PointCloud):
        single = _field_of(field, X_WF) if 0 <= number < len(field) else None
        return None if single is None else single.part(number)
    assert isinstance(field, VoxelGrid)
    tree = field.tree
    cell = np.array([np.unravel_index(number, tree.shape)]) if 0 <= number < math.prod(tree.shape) else None
    if cell is None or not tree.is_occupied(cell)[0]:
        return None
    boxes = tree.boxes_at(cell)
    low, high = tree.corners(boxes.least, boxes.size)
    return _Field(low, high, np.zeros(1), boxes.numbers, X_WF, field.X_FG).part(0)


# --- checking -----------------------------------------------------------------------------------


def flaw_of_field_certificates(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, certificates: Sequence[Certificate], claim: str
) -> str | None:
    """Why certificates fail to prove a field and another shape "together" or "apart"; None for a proof."""
    if not has_field_certificates(A, B):
        return "a field and this body have no certificate"
    if claim == TOGETHER:
        return _flaw_of_hit(A, B, X_WA, X_WB, certificates)
    field, parts = (A, exact_parts(B, X_WB)) if A.is_field else (B, exact_parts(A, X_WA))
    items = _field_of(field, X_WA if A.is_field else X_WB)
    normals: dict[int, list[Point]] = {j: [] for j in range(len(parts))}
    for kind, *numbers, pairs in certificates:
        i, j = numbers if A.is_field else numbers[::-1]
        if kind != PLANE or i != EVERY_ITEM or j not in normals:
            return f"no planes between a field and part {j}, but {kind!r} of item {i}"
        normals[j].append(pairs[0] if A.is_field else opposite(pairs[0]))
    for j, part in enumerate(parts):
        remaining = _remaining(items, part, normals[j])
        if len(remaining.numbers):
            n, first = len(remaining.numbers), int(remaining.numbers[0])
            return f"part {j}: no plane parts it from {n} items, as from number {first}"
    return None


def _flaw_of_hit(A: Shape, B: Shape, X_WA, X_WB, certificates: Sequence[Certificate]) -> str | None:
    if len(certificates) != 1 or certificates[0].kind != TOGETHER:
        return f'a hit of a field is proven by one certificate "together", not {len(certificates)}'
    _, i, j, pairs = certificates[0]
    bodies: list[ExactPart] = []
    for shape, X, number in ((A, X_WA, i), (B, X_WB, j)):
        if shape.is_field:
            part = _numbered(shape, X, number)
        else:
            parts = exact_parts(shape, X)
            part = parts[number] if 0 <= number < len(parts) else None
        if part is None:
            return f"there is no item or part {number}"
        bodies.append(part)
    return flaw_of_proof(bodies[0], bodies[1], pairs, hit=True)


def _remaining(items: _Field, part: ExactPart, normals: Sequence[Point]) -> _Field:
    """The items that no plane parts from a part of the other body; of a half-space its own plane alone counts."""
    for normal in [in_integers(part.plane[0])] if part.kind == HALFSPACE and normals else normals:
        items = items.picked(~_beyond(items, part, normal))
    return items


def _beyond(items: _Field, part: ExactPart, normal: Point) -> np.ndarray:
    """(n,) bool: which items lie beyond a part along a normal of whole numbers, for sure."""
    n_G, height = _in_items_frame(items, normal)
    scale = Fraction(2) ** -max((c.numerator.bit_length() - c.denominator.bit_length() for c in n_G), default=0)
    n_G = tuple(scale * c for c in n_G)  # type: ignore[assignment]  # digits of exact normals are many
    limit, length = scale * (_height_of(part, normal) - height), scale * _no_less_than_length(normal)
    n = np.array([float(c) for c in n_G])
    p = np.where(n > 0.0, items.low, items.high)
    reach = float(limit) + (items.radii + float(part.radius)) * float(length)
    sizes = np.abs(p) @ np.abs(n) + abs(float(limit)) + (items.radii + float(part.radius)) * float(length)
    heights, bound = p @ n - reach, _ROUNDING * sizes + 1e-290
    beyond = heights > bound
    for k in np.flatnonzero(np.abs(heights) <= bound).tolist():
        corners = zip(n_G, items.low[k].tolist(), items.high[k].tolist())
        corner = [Fraction(low if c > 0 else high) for c, low, high in corners]
        beyond[k] = inner(n_G, corner) > limit + (Fraction(items.radii[k]) + part.radius) * length
    return beyond


def _in_items_frame(items: _Field, normal: Point) -> tuple[tuple[Fraction, Fraction, Fraction], Fraction]:
    """(n_G, h) with n·(X p) = n_G·p + h for points p of the items' frame, entries taken as exact."""
    n: tuple = tuple(map(Fraction, normal))
    height = Fraction(0)
    for X in (items.X_WF, items.X_FG):
        rows = [[Fraction(v) for v in row] for row in X[:3].tolist()]
        height += inner(n, [row[3] for row in rows])
        n = tuple(sum(n[i] * rows[i][k] for i in range(3)) for k in range(3))
    return n, height


def _height_of(part: ExactPart, normal: Point) -> Fraction:
    """The largest n·b of a part's vertices; of a half-space's plane, whose normal is a multiple of this."""
    if part.kind != HALFSPACE:
        farthest = part.vertices.first_along(opposite(normal))
        return inner(normal, part.vertices[farthest]) * Fraction(2) ** part.vertices.grid
    n, offset = part.plane
    k = max(range(3), key=lambda axis: abs(n[axis]))
    return offset * Fraction(normal[k]) / n[k]


def _no_less_than_length(normal: Point) -> Fraction:
    """A number that is no less than the length of a normal, and hardly more."""
    shift = 64
    return Fraction(math.isqrt(inner(normal, normal) << 2 * shift) + 1, 1 << shift)


# --- making -------------------------------------------------------------------------------------


def field_certificate(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, row) -> tuple[Certificate, ...] | None:
    """The certificate of a row of `distance`, or None."""
    if not has_field_certificates(A, B):
        return None
    field, body = (A, B) if A.is_field else (B, A)
    X_WF, X_WS = (X_WA, X_WB) if A.is_field else (X_WB, X_WA)
    numbers = [int(row["part_a"]), int(row["part_b"])]
    i, j = numbers if A.is_field else numbers[::-1]
    parts = exact_parts(body, X_WS)
    if row["hit"]:
        return _of_hit(field, X_WF, i, parts, j, swapped=not A.is_field)
    certificates: list[Certificate] = []
    for k, part in enumerate(parts):
        normals = _normals(_field_of(field, X_WF), part)
        if normals is None:
            return None
        for normal in normals:
            if A.is_field:
                certificates.append(Certificate(PLANE, EVERY_ITEM, k, (normal,)))
            else:
                certificates.append(Certificate(PLANE, k, EVERY_ITEM, (opposite(normal),)))
    return tuple(certificates)


def _of_hit(
    field: Shape, X_WF: np.ndarray, i: int, parts: list[ExactPart], j: int, *, swapped: bool
) -> tuple[Certificate, ...] | None:
    """The item named and the part named first, then items that are not parted from a part by its normals."""
    named = _numbered(field, X_WF, i)
    tried = [] if named is None else [(i, named, j)]
    for step in range(2):
        for number, item, k in tried:
            pairs = _pairs_of(item, parts[k])
            if flaw_of_proof(item, parts[k], pairs, hit=True) is None:
                if swapped:
                    return (Certificate(TOGETHER, k, number, tuple((q, p) for p, q in pairs)),)
                return (Certificate(TOGETHER, number, k, tuple(pairs)),)
        if step == 0:
            items = _field_of(field, X_WF)
            tried = [
                (int(remaining.numbers[row]), remaining.part(row), k)
                for k, part in enumerate(parts)
                for remaining in [_near(items, part)]
                for row in range(min(len(remaining.numbers), _MAX_PLANES))
            ]
    return None


def _pairs_of(item: ExactPart, part: ExactPart) -> list[tuple[int, int]]:
    if part.kind == HALFSPACE:
        return [(item.vertices.first_along(in_integers(part.plane[0])), -1)]
    grid = min(item.vertices.grid, part.vertices.grid)
    return list(nearest_vertex_pairs(item.vertices.on_grid(grid), part.vertices.on_grid(grid), [(0, 0)]))


def _near(items: _Field, part: ExactPart) -> _Field:
    """Items that no plane along an axis parts from a part."""
    if part.kind == HALFSPACE:
        return _remaining(items, part, [(0, 0, 0)])
    axes = [tuple(sign * (axis == k) for k in range(3)) for axis in range(3) for sign in (1, -1)]
    return _remaining(items, part, axes)  # type: ignore[arg-type]


def _normals(items: _Field, part: ExactPart) -> list[Point] | None:
    """Normals of planes between all items and a part; None for an item at the part, or for too many planes."""
    if part.kind == HALFSPACE:
        normals = [in_integers(part.plane[0])]
        return None if len(_remaining(items, part, normals).numbers) else normals
    normals, middle = [], _middle(items, part)
    while len(items.numbers):
        if len(normals) >= _MAX_PLANES:
            return None
        away = np.maximum(np.maximum(items.low - middle, middle - items.high), 0.0)
        nearest = int(np.argmin(np.square(away).sum(axis=1)))
        normal = _parting(items.picked([nearest]), part)
        if normal is None:
            return None
        normals.append(normal)
        items = items.picked(~_beyond(items, part, normal))
    return normals


def _middle(items: _Field, part: ExactPart) -> np.ndarray:
    """About the middle of a part, in the items' frame."""
    vertex = [float(Fraction(c) * Fraction(2) ** part.vertices.grid) for c in part.vertices[0]]
    centre = part.points_P.mean(axis=0) - part.points_P[0]
    X = items.X_WF @ items.X_FG
    return (np.array(vertex) + part._poses[-1][:3, :3] @ centre - X[:3, 3]) @ X[:3, :3]


def _parting(item: _Field, part: ExactPart) -> Point | None:
    """A normal along which a single item lies beyond a part, of few digits where these do."""
    single = item.part(0)
    grid = min(single.vertices.grid, part.vertices.grid)
    points, vertices = single.vertices.on_grid(grid), part.vertices.on_grid(grid)
    pairs = nearest_vertex_pairs(points, vertices, [(0, 0)])
    exact = nearest_to_origin([minus(points[i], vertices[j]) for i, j in pairs]).vector
    if not any(exact):
        return None
    leading = leading_digits(exact)
    largest = max(map(abs, leading))
    short = tuple(round(c / largest * (1 << _BITS)) for c in leading)
    for normal in (short, exact):
        if _beyond(item, part, normal)[0]:  # type: ignore[arg-type]
            return normal  # type: ignore[return-value]
    return None

