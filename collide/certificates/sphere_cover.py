"""Whether balls cover a body, from a certificate, in Python integers.

A body is made of parts: the shape, or the items of a `Compound`, however deep. Each part has facets: a `Mesh` its
triangles, a convex part a closed surface around the part, from the certificate. Two facts make the proof.

Facets.  A triangle is cut in two at the middle of an edge, pieces again, and every last piece lies in a single
ball: a ball is convex, so three corners suffice. All facets lie in the union U of the balls.

Inside.  Let B be a closed bounded set with its boundary in U: the points with a winding number of 1 or more. Were
B not within U, the rest W = B \\ U would be open, and made of components of the complement of U. Take any point o, and
x the point of the closure of W farthest from o, on the boundary of U. Let n_i = x − c_i, for the balls with x on their
spheres: every y ≠ x near x with n_i·(y − x) ≥ 0 for all i lies outside U. Suppose a direction u has n_i·u = 0 for all
i. Points of W near x can be moved along u, or against u, without entering a ball, so x + t u lies in the closure of W
for all small t of a sign. If besides a direction v, no multiple of u, has n_i·v ≥ 0 for all i, the points x + t u and
x − t u are joined by an arc through the half-plane of v, outside U: both are in the closure of W, and the second or
the first is farther from o than x is. So the n_i span the space, or wind around 0 in a plane. In both cases x is a
point of three spheres whose centres do not lie on a line: a corner of the union. Three balls have two corners at most.
If every corner lies strictly inside a ball, or off B, then B lies in U.

A convex part lies in B where every plane of its closed surface has the part on its inner side, and an inner point
strictly: each facet then winds the same way around the points of the part.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.certificates.exact_parts import leaves_of
from collide.certificates.winding_number import winding_number_around
from collide.lowering.convex_sets import convex_set
from collide.numerics.exact_points import PlacedPoints, Point, integers, leading_digits
from collide.numerics.exact_vectors import cross, inner, minus
from collide.shapes.mesh import Mesh
from collide.shapes.primitives import Cone, Cylinder, Ellipsoid, Sphere
from collide.shapes.shape import Shape

#: In `PartCover.pieces`: −1, −2, −3 for a piece cut in two at the middle of its edge 0, 1, 2, from corner k to k + 1.
CUT_AT = -1
#: Corners of the union are known to 2^-45 of the largest coordinate; facets must be farther away.
_CLEARANCE = Fraction(1, 2**45)
#: Facets whose boxes are farther from a corner, in parts of the largest coordinate, are not looked at in integers.
_SLACK = 2.0**-40
#: Products of normals and points worked on at a time.
_BLOCK = 1 << 21


class PartCover(NamedTuple):
    """How balls cover a part.

    ball : number of a ball around a whole `Sphere`; −1 where facets are covered.
    vertices, faces : (n, 3) float64 and (m, 3) ints in the part's frame [m], a closed surface around a convex part;
        ``None`` for a `Mesh`, with facets of its own.
    pieces : (k,) int32, facet after facet: −1, −2, −3 for a piece cut at the middle of its first, second, third edge,
        whose halves follow, first the half with the edge's first end; otherwise the number of the ball around it.
    """

    ball: int
    vertices: np.ndarray | None
    faces: np.ndarray | None
    pieces: np.ndarray


class _Balls(NamedTuple):
    """Centres and radii as integers, in units of 2^grid [m]."""

    centers: list[Point]
    radii: list[int]
    grid: int

    def on_grid(self, grid: int) -> _Balls:
        shift = self.grid - grid
        return _Balls(
            [(x << shift, y << shift, z << shift) for x, y, z in self.centers], [r << shift for r in self.radii], grid
        )


def flaw_of_cover(shape: Shape, centers: np.ndarray, radii: np.ndarray, covers: Sequence[PartCover]) -> str | None:
    """Why a certificate fails to prove a shape covered by balls; ``None`` for a proof.

    centers, radii : (n, 3) and (n,) float64 in the frame of the shape [m].

    O(pieces) integers; corners of the union by triples of balls that meet: O(n³) at worst. Of all corners off the balls
    O(facets) doubles.
    """
    balls = _exact_balls(centers, radii)
    leaves = list(leaves_of(shape))
    if len(leaves) != len(covers):
        return f"the body has {len(leaves)} parts, the certificate {len(covers)}"
    if min(balls.radii, default=0) < 0:
        return "a radius is negative"
    corners = None
    for k, ((leaf, poses), cover) in enumerate(zip(leaves, covers)):
        flaw = _flaw_of_ball(leaf, poses, cover.ball, balls) if cover.ball >= 0 else None
        if cover.ball < 0:
            surface = _surface(leaf, cover)
            if isinstance(surface, str):
                return f"part {k}: {surface}"
            vertices, faces = surface
            placed = PlacedPoints(vertices, poses)
            flaw = None if isinstance(leaf, Mesh) else _flaw_of_surface(leaf, poses, placed, vertices, faces)
            flaw = flaw or _flaw_of_facets(placed, faces, cover.pieces, balls)
            if not flaw and getattr(leaf, "solid", True):
                flaw = _flaw_of_closing(vertices, faces)
                corners = _corners_off_balls(balls) if corners is None else corners
                flaw = flaw or _flaw_of_inside(placed, faces, corners)
        if flaw:
            return f"part {k}: {flaw}"
    return None


def _surface(leaf: Shape, cover: PartCover) -> tuple[np.ndarray, np.ndarray] | str:
    """(vertices, faces) of a part, or what is wrong with them."""
    if isinstance(leaf, Mesh):
        return leaf.vertices, leaf.faces
    if cover.vertices is None or cover.faces is None:
        return "the certificate has no facets around a convex part"
    vertices, faces = np.asarray(cover.vertices, dtype=np.float64), np.asarray(cover.faces, dtype=np.int64)
    if vertices.ndim != 2 or faces.ndim != 2 or vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
        return "facets around the part need vertices (n, 3) and faces (m, 3)"
    if not np.isfinite(vertices).all() or faces.min(initial=0) < 0 or faces.max(initial=-1) >= len(vertices):
        return "facets around the part name no vertices, or vertices that are not finite"
    return vertices, faces


def ball_around(leaf: Shape, poses: tuple[np.ndarray, ...], centers: np.ndarray, radii: np.ndarray) -> int:
    """The number of a ball around a whole `Sphere`, decided exactly; −1 without such a ball, and for other parts."""
    balls = _exact_balls(centers, radii)
    numbers = range(len(radii)) if isinstance(leaf, Sphere) else ()
    return next((k for k in numbers if _flaw_of_ball(leaf, poses, k, balls) is None), -1)


def _exact_balls(centers: np.ndarray, radii: np.ndarray) -> _Balls:
    values, grid = integers(np.column_stack([centers, radii]))
    return _Balls(list(zip(values[0::4], values[1::4], values[2::4])), values[3::4], grid)


def _flaw_of_ball(leaf: Shape, poses: tuple[np.ndarray, ...], number: int, balls: _Balls) -> str | None:
    if not isinstance(leaf, Sphere) or number >= len(balls.radii):
        return f"ball {number} is said to hold a {type(leaf).__name__} whole"
    placed = PlacedPoints(np.zeros((1, 3)), poses)
    grid = min(placed.grid, balls.grid)
    finer, unit = balls.on_grid(grid), Fraction(2) ** grid
    away = minus(placed.on_grid(grid)[0], finer.centers[number])
    spare = finer.radii[number] - Fraction(leaf.radius) / unit
    return None if spare >= 0 and inner(away, away) <= spare * spare else f"ball {number} does not hold the sphere"


# --- facets -------------------------------------------------------------------------------------


def _flaw_of_facets(placed: PlacedPoints, faces: np.ndarray, pieces: np.ndarray, balls: _Balls) -> str | None:
    """Why facets are not proven to lie in the balls."""
    grid = min(placed.grid, balls.grid)
    points, balls, numbers = list(placed.on_grid(grid)), balls.on_grid(grid), iter(np.asarray(pieces).tolist())
    squares, n = [r * r for r in balls.radii], len(balls.radii)
    for facet, (a, b, c) in enumerate(faces.tolist()):
        stack = [(points[a], points[b], points[c], 0)]
        while stack:
            a, b, c, depth = stack.pop()
            number = next(numbers, None)
            if number is not None and CUT_AT - 2 <= number <= CUT_AT:
                stack += _bisected((a, b, c), CUT_AT - number, depth + 1)
                continue
            if number is None or not 0 <= number < n:
                return f"facet {facet} is not covered: the certificate ends, or names no ball"
            x, y, z = balls.centers[number]
            center, square = (x << depth, y << depth, z << depth), squares[number] << 2 * depth
            for corner in (a, b, c):
                away = minus(corner, center)
                if inner(away, away) > square:
                    return f"facet {facet} is not covered: a piece leaves ball {number}"
    return None if next(numbers, None) is None else "the certificate has pieces of more facets than there are"


def _bisected(corners: tuple[Point, Point, Point], edge: int, depth: int) -> list[tuple[Point, Point, Point, int]]:
    """The halves of a triangle, the second first, in units half as large."""
    head = (edge + 1) % 3
    p, q = corners[edge], corners[head]
    first = [(2 * x, 2 * y, 2 * z) for x, y, z in corners]
    second = list(first)
    first[head] = second[edge] = p[0] + q[0], p[1] + q[1], p[2] + q[2]
    return [(second[0], second[1], second[2], depth), (first[0], first[1], first[2], depth)]


def _flaw_of_closing(vertices: np.ndarray, faces: np.ndarray) -> str | None:
    """Whether every edge is run along as often one way as the other; equal vertices count as a single vertex."""
    _, rows = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    corners = rows.reshape(-1)[faces]
    edges = corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = edges[edges[:, 0] != edges[:, 1]]
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, edge = np.unique(np.column_stack([low, high]), axis=0, return_inverse=True)
    balance = np.bincount(edge.reshape(-1), weights=np.where(edges[:, 0] == low, 1, -1))
    return "its facets do not close" if balance.any() else None


# --- surfaces around convex parts ---------------------------------------------------------------


def _flaw_of_surface(
    leaf: Shape, poses: tuple[np.ndarray, ...], placed: PlacedPoints, vertices: np.ndarray, faces: np.ndarray
) -> str | None:
    """Why facets are not proven to run around a convex part: every plane has the part on its inner side."""
    reaches: Iterator[tuple[Fraction, Fraction]]
    is_curved = isinstance(leaf, (Cylinder, Cone, Ellipsoid))
    around = PlacedPoints(vertices, ()) if is_curved else placed
    corners, unit = list(around), Fraction(2) ** around.grid
    normals = [
        cross(minus(corners[b], corners[a]), minus(corners[c], corners[a])) for a, b, c in faces.tolist()
    ]
    if is_curved:
        middle, reaches = (Fraction(0),) * 3, iter(map(_curved_reach(leaf), normals))
    else:
        convex = convex_set(leaf)
        points = PlacedPoints(convex.points, poses)
        scale = Fraction(2) ** points.grid
        exact = [(x * scale, y * scale, z * scale) for x, y, z in points]
        middle = tuple(sum(axis) / len(exact) for axis in zip(*exact))  # type: ignore[assignment]
        reaches = _reaches_of_points(exact, Fraction(convex.radius), normals)
    for facet, (n, (along, square)) in enumerate(zip(normals, reaches)):
        plane = inner(n, corners[int(faces[facet, 0])]) * unit
        spare = plane - along
        if n != (0, 0, 0) and not (spare >= 0 and spare * spare >= square and inner(n, middle) < plane):
            return f"the plane of facet {facet} cuts the part"
    return None


def _reaches_of_points(
    points: list[tuple[Fraction, Fraction, Fraction]], radius: Fraction, normals: list[Point]
) -> Iterator[tuple[Fraction, Fraction]]:
    """For each normal n (a, s), rational: the largest product of swept points with n is a + √s.

    In doubles a product of a point with the leading digits of n is off by less than 2^-48 of the largest coordinate:
    points lower than the highest by more than 2^-45 of it are not looked at in integers.
    """
    rough = np.array([[float(x) for x in point] for point in points])
    slack, step = 2.0**-45 * float(np.abs(rough).max()), max(1, _BLOCK // len(points))
    for start in range(0, len(normals), step):
        some = normals[start : start + step]
        heights = np.array([leading_digits(n) for n in some]) @ rough.T
        for n, row in zip(some, heights):
            highest = np.flatnonzero(row >= row.max() - slack).tolist()
            yield max(inner(n, points[k]) for k in highest), radius**2 * inner(n, n)


def _curved_reach(leaf: Shape):
    """n → (a, s), rational, with the part's largest product with n at most a + √s."""
    if isinstance(leaf, Ellipsoid):
        radii = [Fraction(r) for r in leaf.radii.tolist()]
        return lambda n: (Fraction(0), sum((r * x) ** 2 for r, x in zip(radii, n)))
    radius, half = Fraction(leaf.radius), Fraction(leaf.length) / 2  # type: ignore[attr-defined]
    if isinstance(leaf, Cylinder):
        return lambda n: (half * abs(n[2]), radius**2 * (n[0] ** 2 + n[1] ** 2))

    def of_cone(n: Point) -> tuple[Fraction, Fraction]:
        rim = radius**2 * (n[0] ** 2 + n[1] ** 2)
        rise = 2 * half * n[2]  # of the apex over the middle of the base
        return (half * n[2], Fraction(0)) if rise >= 0 and rise * rise >= rim else (-half * n[2], rim)

    return of_cone


# --- the inside ---------------------------------------------------------------------------------


def _corners_off_balls(balls: _Balls) -> np.ndarray:
    """(k, 3) the points of three spheres that are inside no ball [m], off by at most 2^-52 of the largest coordinate.
    """
    centers, radii = _in_doubles(balls)
    corners = []
    for i, j, k in _meeting_triples(centers, radii):
        origin, square = balls.centers[i], balls.radii[i] ** 2
        a, b = minus(balls.centers[j], origin), minus(balls.centers[k], origin)
        n = cross(a, b)
        N = inner(n, n)
        # The points are q / 2N ± n √T / 2N² from the origin: their products with a and b are half of these.
        along_a, along_b = (
            inner(d, d) + square - balls.radii[m] ** 2 for d, m in ((a, j), (b, k))
        )
        p, r = cross(b, n), cross(n, a)
        q = along_a * p[0] + along_b * r[0], along_a * p[1] + along_b * r[1], along_a * p[2] + along_b * r[2]
        T = N * (4 * N * N * square - inner(q, q))
        if N == 0 or T < 0:
            continue
        root, divisor = math.isqrt(T << 128), N * N << 65
        for sign in (1, -1) if T else (1,):
            whole = [(N * x << 64) + sign * root * y + divisor * z for x, y, z in zip(q, n, origin)]
            place = np.array([math.ldexp(x / divisor, balls.grid) for x in whole])
            depth = radii - np.sqrt(np.square(centers - place).sum(axis=1))
            # Balls that may hold the corner, the deepest first; to leave any out is no more than stricter.
            likely = [m for m in np.argsort(-depth)[:8].tolist() if depth[m] > -1e-9 * radii[m] and m not in (i, j, k)]
            for m in likely:
                d = minus(balls.centers[m], origin)
                # Strictly inside: 2 x·d > r_i² + |d|² − r_m², both sides times N²
                rest = N * (N * (square + inner(d, d) - balls.radii[m] ** 2) - inner(q, d))
                if _exceeds(sign * inner(n, d), T, rest):
                    break
            else:
                corners.append(place)
    return np.array(corners).reshape(-1, 3)


def _meeting_triples(centers: np.ndarray, radii: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Triples of balls that meet pair by pair, with a slack far above rounding: more triples do no harm."""
    for i in range(len(radii)):
        away = np.sqrt(np.square(centers[i + 1 :] - centers[i]).sum(axis=1))
        near = i + 1 + np.flatnonzero(away <= (radii[i + 1 :] + radii[i]) * (1.0 + 1e-9))
        apart = np.sqrt(np.square(centers[near][:, None] - centers[near][None]).sum(axis=2))
        meet = apart <= (radii[near][:, None] + radii[near][None]) * (1.0 + 1e-9)
        for j, k in np.argwhere(np.triu(meet, 1)).tolist():
            yield i, int(near[j]), int(near[k])


def _in_doubles(balls: _Balls) -> tuple[np.ndarray, np.ndarray]:
    rows = [[math.ldexp(x, balls.grid) for x in (*c, r)] for c, r in zip(balls.centers, balls.radii)]
    columns = np.array(rows).reshape(-1, 4)
    return columns[:, :3], columns[:, 3]


def _exceeds(factor: int, T: int, limit: int) -> bool:
    """factor √T > limit, of integers."""
    if limit < 0:
        return factor >= 0 or factor * factor * T < limit * limit
    return factor > 0 and factor * factor * T > limit * limit


def _flaw_of_inside(placed: PlacedPoints, faces: np.ndarray, corners: np.ndarray) -> str | None:
    """Why corners of the union, inside no ball, are not proven to be off a closed surface and its inside."""
    if not len(corners):
        return None
    seen, unit = PlacedPoints(corners, ()), Fraction(2) ** placed.grid
    points = list(placed)
    vertices = np.array([[math.ldexp(x, placed.grid) for x in point] for point in points])
    largest = max(float(np.abs(vertices).max()), float(np.abs(corners).max()))
    near_m = Fraction(largest) * _CLEARANCE
    low, high = (side(axis=1) for side in (vertices[faces].min, vertices[faces].max))
    for k, corner in enumerate(corners):
        beside = ((corner < low - _SLACK * largest) | (corner > high + _SLACK * largest)).any(axis=1)
        here = tuple(Fraction(x) / unit for x in corner.tolist())
        for facet in np.flatnonzero(~beside).tolist():
            a, b, c = faces[facet].tolist()
            if not _is_far(here, points[a], points[b], points[c], near_m / unit):
                return f"a corner of the union is not apart from facet {facet}"
        if winding_number_around(k, seen, placed, faces) != 0:
            return f"the balls leave a hole in the part at {corner.tolist()}"
    return None


def _is_far(p, a: Point, b: Point, c: Point, distance: Fraction) -> bool:
    """Whether a plane with the triangle on its inner side leaves p farther out than a distance; the triangle's plane on
    both sides, planes across it through its edges.
    """
    n = cross(minus(b, a), minus(c, a))
    height, square = inner(n, minus(p, a)), distance**2
    if height * height > square * inner(n, n):
        return True
    for tail, head in ((a, b), (b, c), (c, a)):
        edge = minus(head, tail)
        m = cross(edge, n)
        if n == (0, 0, 0):  # a segment: the plane along it that faces p
            m = cross(edge, cross(minus(p, tail), edge))
        out = inner(m, minus(p, tail))
        if out > 0 and out * out > square * inner(m, m):
            return True
    return False
