"""Proofs about fields (clouds, grids, swept meshes, large terrain): a hit by one item, a gap by planes, each item
beyond at least a plane.

With a normal n and the vertex b of the other body farthest along n, an item is beyond the plane where
n·(p − b) > (r_p + r_b)|n| for all vertices p of the item. The right side is replaced by a slightly larger fraction. The
left side is taken in doubles with a bound of rounding, and in integers for items that doubles place beyond no plane.
A body parted from all triangles of a solid lies outside where the surface winds 0 times around a vertex of the body.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.certificates.body_groups import point_of, vertex_of
from collide.certificates.certificate import INSIDE, NO_VERTEX, PLANE, POINT, TOGETHER, Certificate, VertexPair
from collide.certificates.convex_proofs import flaw_of_proof
from collide.certificates.exact_parts import ExactPart, exact_parts
from collide.certificates.nearest_to_origin import nearest_to_origin, nearest_vertex_pairs
from collide.certificates.point_and_plane import (
    WeightedPoint,
    flaw_of_point,
    holds,
    reaches,
    root_no_less,
    seen_from,
)
from collide.certificates.proof_search import common_point, parting_normal, quick_normal
from collide.certificates.swept_hulls import SweptHulls, hull_numbered, hulls_of
from collide.certificates.winding_number import winding_number
from collide.lowering.convex_sets import HALFSPACE, POINTS
from collide.numerics.exact_points import (
    PlacedPoints,
    Point,
    in_integers,
    integers,
    leading_digits,
    opposite,
    rounded,
)
from collide.numerics.exact_vectors import inner, minus
from collide.shapes.shape import Shape
from collide.shapes.swept_mesh import SweptMesh

#: Stands for all items of a field, which planes part from a body.
EVERY_ITEM = -1
#: Planes of a certificate at most: of more there is none. Bits of a normal's components. Blocks opened at a time.
_MAX_PLANES, _BITS, _OPENED = 1000, 40, 256
#: Bits of the roots in reaches of curved parts, rounded up.
_ROOT_BITS = 256
#: Of the numbers added up, what rounding of their products and sums is less than.
_ROUNDING = 2.0**-48
#: Where an item lies: beyond a plane, not beyond, or left open by doubles.
_BEYOND, _OPEN, _NOT_BEYOND = 1, 0, -1


def has_field_certificates(A: Shape, B: Shape) -> bool:
    """Whether pairs of these may have a certificate: a field, and convex parts."""
    return not (B if A.is_field else A).is_asked_whole


class _Plane(NamedTuple):
    """A plane that parts items from a part of the other body, in the items' frame: an item of radius r lies beyond
    where n·p > limit + (r + radius)·length for all of its vertices p.
    """

    normal: Point
    n: tuple[Fraction, Fraction, Fraction]
    limit: Fraction
    length: Fraction
    radius: Fraction

    def sides(self, items: SweptHulls) -> np.ndarray:
        """(n,) int8: where items lie.

        Digits of n, products and sums are rounded by 2^-53 each of the numbers added up, fewer than 16 times;
        components of n too small for that by 2^-1075, less than 2^-48 times 1e-300, and products by less than 1e-290.
        """
        n, limit, length = np.array([float(c) for c in self.n]), rounded(self.limit)[0], rounded(self.length)[0]
        points = items.facing(n)
        with np.errstate(over="ignore", invalid="ignore"):  # infinities and what is no number tell nothing
            widths = (items.radii + float(self.radius)) * length
            heights = points @ n - (limit + widths)[:, None]
            bound = _ROUNDING * (np.abs(points) @ (np.abs(n) + 1e-300) + (abs(limit) + widths)[:, None]) + 1e-290
        is_beyond, is_not = (heights > bound).all(axis=1), (heights < -bound).any(axis=1)
        return is_beyond.astype(np.int8) - is_not

    def parts_exactly(self, items: SweptHulls, row: int) -> bool:
        """Whether an item lies beyond, in integers: n and vertices are whole numbers on grids of powers of two."""
        reach = self.limit + (Fraction(float(items.radii[row])) + self.radius) * self.length
        n, (numbers, grid) = in_integers(self.n), integers(items.vertices(row))
        reach *= max(c.denominator for c in self.n) / Fraction(2) ** grid
        whole_reach = reach.numerator // reach.denominator
        return all(inner(n, vertex) > whole_reach for vertex in zip(numbers[0::3], numbers[1::3], numbers[2::3]))


def _plane(items: SweptHulls, part: ExactPart, normal: Point) -> _Plane:
    n, height = _in_items_frame(items, normal)
    scale = Fraction(2) ** -max((c.numerator.bit_length() - c.denominator.bit_length() for c in n), default=0)
    limit = scale * (_height_of(part, normal) - height)
    x, y, z = (scale * c for c in n)  # digits of exact normals are many
    return _Plane(normal, (x, y, z), limit, scale * _no_less_than_length(normal), part.radius)


def _in_items_frame(items: SweptHulls, normal: Point) -> tuple[tuple[Fraction, Fraction, Fraction], Fraction]:
    """(n_G, h) with n·(X p) = n_G·p + h for points p of the items' frame, entries taken as exact."""
    n: tuple = tuple(map(Fraction, normal))
    height = Fraction(0)
    for X in reversed(items.poses):
        rows = [[Fraction(v) for v in row] for row in X[:3].tolist()]
        height += inner(n, [row[3] for row in rows])
        n = tuple(sum(n[i] * rows[i][k] for i in range(3)) for k in range(3))
    return n, height


def _height_of(part: ExactPart, normal: Point) -> Fraction:
    """The largest n·b of a part's vertices, or hardly more than of a curved part; of a half-space's plane, whose normal
    is a multiple of this.
    """
    if part.kind not in (HALFSPACE, POINTS):
        return max(a + root_no_less(b, _ROOT_BITS) for a, b in reaches(part, normal))
    if part.kind == POINTS:
        farthest = part.vertices.first_along(opposite(normal))
        return inner(normal, part.vertices[farthest]) * Fraction(2) ** part.vertices.grid
    n, offset = part.plane
    k = max(range(3), key=lambda axis: abs(n[axis]))
    return offset * Fraction(normal[k]) / n[k]


def _no_less_than_length(normal: Point) -> Fraction:
    """A number that is no less than the length of a normal, and hardly more."""
    shift = 64
    return Fraction(math.isqrt(inner(normal, normal) << 2 * shift) + 1, 1 << shift)


def _unparted(items: SweptHulls, planes: Sequence[_Plane]) -> Iterator[int]:
    """Rows of items on no plane's far side: first all known by doubles, then the rows decided by integers."""
    best = np.full(len(items.numbers), _NOT_BEYOND, dtype=np.int8)
    for plane in planes:
        rows = np.flatnonzero(best < _BEYOND)
        best[rows] = np.maximum(best[rows], plane.sides(items.picked(rows)))
    yield from np.flatnonzero(best == _NOT_BEYOND).tolist()
    for row in np.flatnonzero(best == _OPEN).tolist():
        if not any(plane.parts_exactly(items, row) for plane in planes):
            yield row


def _own_planes(items: SweptHulls, part: ExactPart) -> list[_Plane]:
    """Of a half-space its own plane, to which proofs are limited; an empty list of points."""
    return [_plane(items, part, in_integers(part.plane[0]))] if part.kind == HALFSPACE else []


def _number_of_inside(field: Shape) -> int | None:
    """The item that stands for the inside of a solid, the number after its last triangle; ``None`` of other fields."""
    return len(field.mesh.faces) if isinstance(field, SweptMesh) and field.mesh.solid else None


def _is_outside(field: Shape, X_WF: np.ndarray, part: ExactPart) -> bool:
    """Whether a part, parted from all triangles, is proven to be outside of a solid, if the field is a solid.

    No part reaches across the surface, so a vertex tells of all. A half-space has no end, and the solid has.
    """
    point = point_of(part)
    return point is None or _number_of_inside(field) is None or _winding_number(field, X_WF, point) == 0


def _winding_number(field: Shape, X_WF: np.ndarray, point: WeightedPoint) -> int | None:
    assert isinstance(field, SweptMesh)
    return winding_number(seen_from(PlacedPoints(field.mesh.vertices, [X_WF]), point), field.mesh.faces)


def _turned(certificate: Certificate) -> Certificate:
    """The certificate of the same bodies in the opposite order."""
    kind, i, j, rows = certificate
    if kind == POINT:
        return Certificate(kind, j, i, rows)
    return Certificate(kind, j, i, tuple(opposite(row) if kind == PLANE else row[::-1] for row in rows))


# --- checking -----------------------------------------------------------------------------------


def flaw_of_field_certificates(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, certificates: Sequence[Certificate], claim: str
) -> str | None:
    """Why certificates fail to prove a field and another shape "together" or "apart"; None for a proof."""
    if not has_field_certificates(A, B):
        return "a field and this body have no certificate"
    if not A.is_field:
        return flaw_of_field_certificates(B, A, X_WB, X_WA, list(map(_turned, certificates)), claim)
    parts = exact_parts(B, X_WB)
    if claim == TOGETHER:
        return _flaw_of_hit(A, X_WA, parts, certificates)
    items = hulls_of(A, X_WA)
    planes = [_own_planes(items, part) for part in parts]
    for kind, i, j, pairs in certificates:
        if kind != PLANE or i != EVERY_ITEM or not 0 <= j < len(parts):
            return f"no planes between a field and part {j}, but {kind!r} of item {i}"
        if parts[j].kind != HALFSPACE:
            planes[j].append(_plane(items, parts[j], pairs[0]))
    named = {certificate.part_b for certificate in certificates}
    for j, part in enumerate(parts):
        first = _first_unparted(items, planes[j] if j in named else [])
        if first is not None:
            return f"part {j}: no plane parts it from an item, number {first}"
        if not _is_outside(A, X_WA, part):
            return f"part {j} is not proven to be outside of the solid"
    return None


def _first_unparted(items: SweptHulls, planes: Sequence[_Plane]) -> int | None:
    """The number of an item not beyond any plane; ``None`` where every item is beyond a plane."""
    unparted = _unparted(items, planes)
    if items.opened is None:
        row = next(unparted, None)
        return None if row is None else int(items.numbers[row])
    blocks = items.numbers[np.fromiter(unparted, dtype=np.int64)]
    for k in range(0, len(blocks), _OPENED):
        first = _first_unparted(items.opened(blocks[k : k + _OPENED]), planes)
        if first is not None:
            return first
    return None


def _flaw_of_hit(
    field: Shape, X_WF: np.ndarray, parts: Sequence[ExactPart], certificates: Sequence[Certificate]
) -> str | None:
    if len(certificates) != 1 or certificates[0].kind not in (TOGETHER, INSIDE, POINT):
        return f'a hit of a field is proven by one certificate "together", "inside" or "point", not {len(certificates)}'
    kind, i, j, pairs = certificates[0]
    if not 0 <= j < len(parts):
        return f"there is no part {j}"
    if kind == INSIDE:
        return _flaw_of_inside(field, X_WF, i, parts[j], pairs)
    if kind == POINT and i == _number_of_inside(field):
        return _flaw_of_point_inside(field, X_WF, parts[j], pairs[0])
    item = hull_numbered(field, X_WF, i)
    if item is None:
        return f"there is no item {i}"
    return flaw_of_point(item, parts[j], pairs[0]) if kind == POINT else flaw_of_proof(item, parts[j], pairs, hit=True)


def _flaw_of_point_inside(field: Shape, X_WF: np.ndarray, part: ExactPart, point: WeightedPoint) -> str | None:
    if point[3] <= 0 or not holds(part, point):
        return "the body does not hold the point (x, y, z, w), w > 0"
    winding = _winding_number(field, X_WF, point)
    return None if winding is not None and winding > 0 else "the point does not lie in the solid"


def _flaw_of_inside(
    field: Shape, X_WF: np.ndarray, number: int, part: ExactPart, pairs: Sequence[VertexPair]
) -> str | None:
    if number != _number_of_inside(field):
        return f"item {number} is not the inside of a solid"
    if part.kind != POINTS or len(pairs) != 1 or pairs[0][0] != NO_VERTEX or not 0 <= pairs[0][1] < len(part):
        return "−1 is needed for the solid, and one vertex of the other body"
    winding = _winding_number(field, X_WF, vertex_of(part, pairs[0][1]))
    return None if winding is not None and winding > 0 else f"vertex {pairs[0][1]} does not lie in the solid"


# --- making -------------------------------------------------------------------------------------


def field_certificate(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, row) -> tuple[Certificate, ...] | None:
    """The certificate of a row of `distance`, or None."""
    if not has_field_certificates(A, B):
        return None
    field, body, X_WF, X_WS = (A, B, X_WA, X_WB) if A.is_field else (B, A, X_WB, X_WA)
    numbers = [int(row["part_a"]), int(row["part_b"])]
    parts = exact_parts(body, X_WS)
    if row["hit"]:
        near = [row["point_a"], row["point_b"], 0.5 * (row["point_a"] + row["point_b"])]
        certificates = _of_hit(field, X_WF, parts, numbers if A.is_field else numbers[::-1], near)
    else:
        certificates = _of_gap(field, X_WF, parts)
    if certificates is None or A.is_field:
        return certificates
    return tuple(map(_turned, certificates))


def _of_gap(field: Shape, X_WF: np.ndarray, parts: list[ExactPart]) -> tuple[Certificate, ...] | None:
    certificates: list[Certificate] = []
    items = hulls_of(field, X_WF)
    for j, part in enumerate(parts):
        planes = _own_planes(items, part)
        met = _part_all(items, part, planes)
        if met is not None or len(planes) > _MAX_PLANES or not _is_outside(field, X_WF, part):
            return None
        certificates += [Certificate(PLANE, EVERY_ITEM, j, (plane.normal,)) for plane in planes]
    return tuple(certificates)


def _of_hit(
    field: Shape, X_WF: np.ndarray, parts: list[ExactPart], numbers, near: list[np.ndarray]
) -> tuple[Certificate, ...] | None:
    """Of the item and the part named, or of the first item that planes cannot part from a part."""
    i, j = numbers
    j = j if 0 <= j < len(parts) else 0  # facets of a convex body are numbered as well
    named = hull_numbered(field, X_WF, i)
    if named is not None and (certificate := _of_item(named, i, parts[j], j, near)):
        return (certificate,)
    items, inside = hulls_of(field, X_WF), _number_of_inside(field)
    for k in sorted(range(len(parts)), key=lambda k: k != j):
        met = _part_all(items, parts[k], _own_planes(items, parts[k]))
        if met is not None and (certificate := _of_item(met.part(0), int(met.numbers[0]), parts[k], k, near)):
            return (certificate,)
        point = point_of(parts[k]) if parts[k].kind != POINTS else None
        if point and inside is not None and _flaw_of_point_inside(field, X_WF, parts[k], point) is None:
            return (Certificate(POINT, inside, k, (point,)),)
        if inside is not None and _flaw_of_inside(field, X_WF, inside, parts[k], [(NO_VERTEX, 0)]) is None:
            return (Certificate(INSIDE, inside, k, ((NO_VERTEX, 0),)),)
    return None


def _of_item(item: ExactPart, i: int, part: ExactPart, j: int, near: list[np.ndarray]) -> Certificate | None:
    """That an item and a part meet, where they do. near : (3,) points tried first where the part is curved."""
    if part.kind not in (POINTS, HALFSPACE):
        point = common_point(item, part, near)
        return point and Certificate(POINT, i, j, (point,))
    pairs = _pairs_of(item, part)
    return Certificate(TOGETHER, i, j, tuple(pairs)) if flaw_of_proof(item, part, pairs, hit=True) is None else None


def _pairs_of(item: ExactPart, part: ExactPart) -> list[VertexPair]:
    if part.kind == HALFSPACE:
        return [(item.vertices.first_along(in_integers(part.plane[0])), NO_VERTEX)]
    grid = min(item.vertices.grid, part.vertices.grid)
    return list(nearest_vertex_pairs(item.vertices.on_grid(grid), part.vertices.on_grid(grid), [(0, 0)]))


def _part_all(items: SweptHulls, part: ExactPart, planes: list[_Plane]) -> SweptHulls | None:
    """Adds planes between all items and a part, of the nearest items first, until each item lies beyond a plane or
    planes are too many. Returns an item not to be parted from the part, or None.

    A block whose box overlaps the part is opened before the next block is looked at.
    """
    if planes:
        items = items.picked(list(_unparted(items, planes)))
    away = _away(items, part)
    while len(away) and len(planes) <= _MAX_PLANES:
        nearest, known = int(np.argmin(away)), len(planes)
        item, remaining = items.picked([nearest]), np.arange(len(away)) != nearest
        if next(_unparted(item, planes), None) is not None:
            plane = _parting(item, part)
            if plane is not None:
                planes.append(plane)
            elif item.opened is None:
                return item
            else:
                met = _part_all(item.opened(item.numbers), part, planes)
                if met is not None:
                    return met
        for plane in planes[known:]:
            remaining &= plane.sides(items) != _BEYOND
        items, away = items.picked(remaining), away[remaining]
    return None


def _away(items: SweptHulls, part: ExactPart) -> np.ndarray:
    """(n,) about how far boxes around items are from the middle of a part, squared, or how high above a half-space."""
    X = items.poses[1] @ items.poses[0]
    if part.kind == HALFSPACE:
        n = X[:3, :3].T @ np.array([float(c) for c in part.plane[0]])
        return (items.facing(n) @ n).min(axis=1) - items.radii * np.linalg.norm(n)
    if part.kind != POINTS:
        middle = (np.array([float(c) for c in part.placement[1]]) - X[:3, 3]) @ X[:3, :3]
        return _squared_away(items, middle)
    vertex = [float(Fraction(c) * Fraction(2) ** part.vertices.grid) for c in part.vertices[0]]
    centre = part.points_P.mean(axis=0) - part.points_P[0]
    middle = (np.array(vertex) + part.poses[-1][:3, :3] @ centre - X[:3, 3]) @ X[:3, :3]
    return _squared_away(items, middle)


def _squared_away(items: SweptHulls, middle: np.ndarray) -> np.ndarray:
    """(n,) squares of how far boxes around items are from a point of their frame, radii left out."""
    low, high = items.points.min(axis=1), items.points.max(axis=1)
    return np.square(np.maximum(np.maximum(low - middle, middle - high), 0.0)).sum(axis=1)


def _parting(item: SweptHulls, part: ExactPart) -> _Plane | None:
    """A plane beyond which a single item lies, its normal of few digits where these do."""
    if part.kind == HALFSPACE:
        return None
    single = item.part(0)
    if part.kind != POINTS:
        search = quick_normal if item.opened else parting_normal
        normal = search(single, part)
        plane = normal and _plane(item, part, normal)
        return plane if plane and plane.parts_exactly(item, 0) else None
    grid = min(single.vertices.grid, part.vertices.grid)
    points, vertices = single.vertices.on_grid(grid), part.vertices.on_grid(grid)
    pairs = nearest_vertex_pairs(points, vertices, [(0, 0)])
    exact = nearest_to_origin([minus(points[i], vertices[j]) for i, j in pairs]).vector
    if not any(exact):
        return None
    leading = leading_digits(exact)
    largest = max(map(abs, leading))
    x, y, z = (round(c / largest * (1 << _BITS)) for c in leading)
    for normal in ((x, y, z), exact):
        plane = _plane(item, part, normal)
        if plane.parts_exactly(item, 0):
            return plane
    return None
