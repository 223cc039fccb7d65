"""Posed convex sets in integers: supports, membership, and the quadrics and planes they are bounded by.

All numbers of a pair, poses included, are doubles, so integers times powers of two: lengths in units of 2^−L m, entries
of rotations in units of 2^−M, and points of the world in units of 2^−(L + M) m. R maps integers of a body's frame to
integers of the world; back from there goes its adjugate, by det R times as long. A point of the world is (x, y, z, w),
w > 0, for x/w, y/w, z/w.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from math import gcd, isqrt
from typing import NamedTuple

from collide.curved.shape_kinds import CONE, CYLINDER, ELLIPSOID
from collide.narrowphase.exact_curved.root_signs import exact_root, sign, sign_with_root, sign_with_roots
from collide.numerics.exact_vectors import cross, inner, minus

Vector = tuple[int, int, int]
#: x, y, z, w.
WorldPoint = tuple[int, int, int, int]
Matrix = list[list[int]]


class Reach(NamedTuple):
    """The number a + √b."""

    a: int
    b: int


class Units(NamedTuple):
    """Exponents L and M."""

    length: int
    rotation: int

    @property
    def world(self) -> int:
        return self.length + self.rotation


def units_of(lengths: Iterable[Fraction], entries: Iterable[Fraction]) -> Units:
    """Units in which all these lengths, and all entries of rotations, are whole."""
    return Units(*(max((x.denominator.bit_length() - 1 for x in numbers), default=0) for numbers in (lengths, entries)))


def whole(x: Fraction, unit: int) -> int:
    """x·2^unit, which is whole."""
    return x.numerator << (unit - x.denominator.bit_length() + 1)


class IntegerPose:
    """A pose in integers: R (rows), p in units of the world, adj R (rows), det R."""

    def __init__(self, entries: Sequence[Fraction], units: Units):
        rotation = [whole(x, units.rotation) for x in entries[:9]]
        self.rows: tuple[Vector, Vector, Vector] = tuple(  # type: ignore[assignment]
            (rotation[i], rotation[i + 1], rotation[i + 2]) for i in (0, 3, 6)
        )
        self.p: Vector = tuple(whole(x, units.length) << units.rotation for x in entries[9:])  # type: ignore[assignment]
        self.columns: tuple[Vector, Vector, Vector] = tuple(zip(*self.rows))  # type: ignore[assignment]
        x, y, z = self.columns
        self.adjugate = cross(y, z), cross(z, x), cross(x, y)
        self.det = inner(x, self.adjugate[0])

    def turned(self, v: Sequence[int]) -> Vector:
        """R v."""
        return inner(self.rows[0], v), inner(self.rows[1], v), inner(self.rows[2], v)

    def turned_back(self, n: Sequence[int]) -> Vector:
        """Rᵀ n."""
        return inner(self.columns[0], n), inner(self.columns[1], n), inner(self.columns[2], n)

    def placed(self, v: Sequence[int], w: int = 1) -> WorldPoint:
        """The world's point of v/w in the frame."""
        x = self.turned(v)
        return x[0] + w * self.p[0], x[1] + w * self.p[1], x[2] + w * self.p[2], w

    def local(self, x: WorldPoint) -> WorldPoint:
        """The frame's point of a point of the world."""
        w = x[3]
        d = x[0] - w * self.p[0], x[1] - w * self.p[1], x[2] - w * self.p[2]
        return (*(inner(row, d) for row in self.adjugate), w * self.det)  # type: ignore[return-value]

    @cached_property
    def to_local(self) -> Matrix:
        """(4, 4) `local` as a matrix."""
        return [[*row, -inner(row, self.p)] for row in self.adjugate] + [[0, 0, 0, self.det]]


class Disc(NamedTuple):
    """A flat end of a cylinder or cone: the disc of a radius around the axis, at a height of the frame."""

    pose: IntegerPose
    height: int
    radius: int

    @property
    def plane(self) -> Matrix:
        """(4, 3) the world's points of (x, y, w) in the disc's plane."""
        (ax, ay, az), (bx, by, bz), c = *self.pose.columns[:2], self.pose.placed((0, 0, self.height))
        return [[ax, bx, c[0]], [ay, by, c[1]], [az, bz, c[2]], [0, 0, 1]]

    @property
    def conic(self) -> Matrix:
        """x² + y² ≤ r² w² in the disc's plane."""
        return [[1, 0, 0], [0, 1, 0], [0, 0, -self.radius**2]]


class CurvedBody:
    """A cylinder, cone or ellipsoid at a pose. sizes : radius and half length, or three radii, in units of length."""

    #: Of the ball swept over the set, in units of the world.
    radius = 0

    def __init__(self, kind: int, sizes: Sequence[int], pose: IntegerPose):
        self.kind, self.sizes, self.pose = kind, tuple(sizes), pose
        self.centre = pose.placed((0, 0, 0))

    def reaches(self, n: Vector) -> list[Reach]:
        """n·x is at most the largest of these on the set, and as large somewhere."""
        w = self.pose.turned_back(n)
        at = inner(n, self.pose.p)
        if self.kind == ELLIPSOID:
            return [Reach(at, sum((a * x) ** 2 for a, x in zip(self.sizes, w)))]
        radius, half = self.sizes[:2]
        square = radius * radius * (w[0] * w[0] + w[1] * w[1])
        if self.kind == CYLINDER:
            return [Reach(at + half * abs(w[2]), square)]
        return [Reach(at + half * w[2], 0), Reach(at - half * w[2], square)]

    def holds(self, x: WorldPoint) -> bool:
        """Whether a point of the world is in the set."""
        return self.holds_local(self.pose.local(x))

    def holds_local(self, u: WorldPoint) -> bool:
        """The same of a point (x, y, z, w) of the frame, w > 0."""
        x, y, z, w = u
        if self.kind == ELLIPSOID:
            return sum(g * c * c for g, c in zip(self.weights[:3], u)) <= self.weights[3] * w * w
        radius, half = self.sizes[:2]
        if abs(z) > half * w:
            return False
        if self.kind == CYLINDER:
            return x * x + y * y <= (radius * w) ** 2
        return (x * x + y * y) * 4 * half * half <= (radius * (half * w - z)) ** 2

    @cached_property
    def weights(self) -> tuple[int, int, int, int]:
        """Of an ellipsoid: Σ weights_i x_i² ≤ weights₃ w²."""
        a, b, c = (s * s for s in self.sizes)
        return b * c, c * a, a * b, a * b * c

    @cached_property
    def local_quadric(self) -> Matrix:
        """(4, 4) xᵀQx ≤ 0 of the curved side, without ends, in the frame; of a cone both of its nappes."""
        if self.kind == ELLIPSOID:
            a, b, c, d = self.weights
            return [[a, 0, 0, 0], [0, b, 0, 0], [0, 0, c, 0], [0, 0, 0, -d]]
        radius, half = self.sizes[:2]
        square = radius * radius
        if self.kind == CYLINDER:
            return [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, -square]]
        a = 4 * half * half
        along, last = square * half, -square * half * half
        return [[a, 0, 0, 0], [0, a, 0, 0], [0, 0, -square, along], [0, 0, along, last]]

    @cached_property
    def quadrics(self) -> list[Matrix]:
        """(4, 4) of the curved sides, in the world."""
        return [congruent(self.local_quadric, self.pose.to_local)]

    @cached_property
    def discs(self) -> list[Disc]:
        if self.kind == ELLIPSOID:
            return []
        radius, half = self.sizes[:2]
        heights = (-half, half) if self.kind == CYLINDER else (-half,)
        return [Disc(self.pose, height, radius) for height in heights]

    @cached_property
    def corners(self) -> list[WorldPoint]:
        """The tip of a cone."""
        return [self.pose.placed((0, 0, self.sizes[1]))] if self.kind == CONE else []

    @cached_property
    def normals(self) -> list[Vector]:
        """Of the flat ends, in the world, not of unit length: cofactors map normals."""
        if self.kind == ELLIPSOID:
            return []
        axis = self.pose.adjugate[2]
        return [axis, opposite(axis)] if self.kind == CYLINDER else [opposite(axis)]

    def supports(self, n: Vector, near: WorldPoint) -> list[WorldPoint]:
        """Points of the set farthest along n, as far as they are fractions; of many, one near a point of the world."""
        w = self.pose.turned_back(n)
        if self.kind == ELLIPSOID:
            root = exact_root(sum((a * x) ** 2 for a, x in zip(self.sizes, w)))
            return [self.pose.placed([a * a * x for a, x in zip(self.sizes, w)], root)] if root else []
        radius, half = self.sizes[:2]
        root = exact_root(w[0] * w[0] + w[1] * w[1])
        u = self.pose.local(near)
        z, scale = max(-half * u[3], min(half * u[3], u[2])), u[3]
        if root == 0:  # an end: the nearest point within, about the axis
            height = -half if w[2] < 0 or self.kind == CONE else half
            return [self.pose.placed((*u[:2], height * scale), scale)]
        if root is None:
            return []
        rim = radius * w[0], radius * w[1]
        if self.kind == CYLINDER:
            height = sign(w[2]) * half * scale if w[2] else z
            return [self.pose.placed((rim[0] * scale, rim[1] * scale, height * root), root * scale)]
        # A cone's rim, and the point beside ``near`` of the line from there to the tip.
        share = half * scale - z  # of 2 half scale
        side = rim[0] * share, rim[1] * share, 2 * half * root * z
        points = [(*rim, -half * root, root), (*side, 2 * half * root * scale)]
        return [self.pose.placed(point[:3], point[3]) for point in points]


class SweptPoints:
    """The hull of points of the world (integers) swept by a ball.

    radius : in units of the world.   triangles, edges : of the hull, by number.   solid : whether of three dimensions.
    support : the largest n·x over all points, along n; ``points`` may be a part, near the opponent.
    """

    def __init__(
        self, points: Sequence[Vector], radius: int, triangles: Sequence[Sequence[int]], edges, solid: bool,
        support: Callable[[Vector], int] | None = None,
    ):
        self.points, self.radius, self.triangles, self.edges, self.solid = points, radius, triangles, edges, solid
        self.support = support or (lambda n: max(inner(n, x) for x in points))
        self.discs: list[Disc] = []

    @property
    def centre(self) -> WorldPoint:
        """The mean of the points."""
        return (*(sum(c) for c in zip(*self.points)), len(self.points))  # type: ignore[return-value]

    def reaches(self, n: Vector) -> list[Reach]:
        return [Reach(self.support(n), self.radius**2 * inner(n, n))]

    def holds(self, x: WorldPoint) -> bool:
        """Whether a point is at most the radius from the hull."""
        p, w = x[:3], x[3]
        limit = (self.radius * w) ** 2
        if any(_square_of(p, w, point) <= limit for point in self.points):
            return True
        if any(_is_near_segment(p, w, self.points[i], self.points[j], limit) for i, j in self.edges):
            return True
        corners = [[self.points[i] for i in triangle] for triangle in self.triangles]
        return any(_is_near_triangle(p, w, corner, limit) for corner in corners) or self.holds_within(x)

    def holds_within(self, x: WorldPoint) -> bool:
        """Whether a point is in the hull, of a solid one."""
        return self.solid and all(height <= 0 for height in self._heights(x))

    def _heights(self, x: WorldPoint) -> Iterable[int]:
        for i, j, k in self.triangles:
            a = self.points[i]
            normal = cross(minus(self.points[j], a), minus(self.points[k], a))
            yield inner(normal, x[:3]) - x[3] * inner(normal, a)

    @cached_property
    def quadrics(self) -> list[Matrix]:
        """Of balls around corners, and of cylinders without ends around edges."""
        square = self.radius**2
        made = []
        for c in self.points:
            made.append(_symmetric([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [-x for x in c], inner(c, c) - square))
        for i, j in self.edges:
            a, d = self.points[i], minus(self.points[j], self.points[i])
            length, along = inner(d, d), inner(a, d)
            block = [[length * (r == s) - d[r] * d[s] for s in range(3)] for r in range(3)]
            beside = [d[r] * along - length * a[r] for r in range(3)]
            made.append(_symmetric(block, beside, length * inner(a, a) - along * along - square * length))
        return made

    @property
    def corners(self) -> list[WorldPoint]:
        return []

    @cached_property
    def normals(self) -> list[Vector]:
        """Of the facets."""
        corners = ([self.points[i] for i in triangle] for triangle in self.triangles)
        return list({primitive(cross(minus(b, a), minus(c, a))) for a, b, c in corners})

    def supports(self, n: Vector, near: WorldPoint) -> list[WorldPoint]:
        """As of `CurvedBody`: corners that are as far as any, and what of their plane or lines is nearest ``near``."""
        root = exact_root(inner(n, n))
        if root is None or root == 0:
            return []
        farthest = max(inner(n, x) for x in self.points)
        tied = [x for x in self.points if inner(n, x) == farthest]
        points: list[WorldPoint] = [(*x, 1) for x in tied]
        points += [_nearest_of_segment(near, a, b) for a, b in combinations(tied[:8], 2)]
        if len(tied) > 2:
            w, square = near[3], root * root
            height = inner(n, near[:3]) - w * farthest
            points.append((*(c * square - height * m for c, m in zip(near[:3], n)), w * square))  # type: ignore[arg-type]
        return [(*(c * root + self.radius * m * x[3] for c, m in zip(x[:3], n)), x[3] * root) for x in points]  # type: ignore[misc]


IntegerBody = CurvedBody | SweptPoints

# --- small algebra ------------------------------------------------------------------------------


def opposite(n: Sequence[int]) -> Vector:
    return -n[0], -n[1], -n[2]


def primitive(n: Sequence[int]) -> Vector:
    """A normal, divided by what its numbers have in common."""
    common = gcd(*n)
    return (n[0] // common, n[1] // common, n[2] // common) if common else (0, 0, 0)


def congruent(Q: Sequence[Sequence[int]], G: Sequence[Sequence[int]]) -> Matrix:
    """GᵀQG."""
    QG = [[sum(q * g[j] for q, g in zip(row, G)) for j in range(len(G[0]))] for row in Q]
    return [[sum(g[i] * row[j] for g, row in zip(G, QG)) for j in range(len(G[0]))] for i in range(len(G[0]))]


def _symmetric(block: Matrix, beside: Sequence[int], last: int) -> Matrix:
    return [[*row, b] for row, b in zip(block, beside)] + [[*beside, last]]


def _square_of(p: Sequence[int], w: int, point: Vector) -> int:
    """|p − w point|²."""
    d = p[0] - w * point[0], p[1] - w * point[1], p[2] - w * point[2]
    return inner(d, d)


def _is_near_segment(p: Sequence[int], w: int, a: Vector, b: Vector, limit: int) -> bool:
    """Whether p/w is beside a segment, and at most √limit/w from it."""
    d = minus(b, a)
    x = p[0] - w * a[0], p[1] - w * a[1], p[2] - w * a[2]
    along, length = inner(x, d), inner(d, d)
    return 0 < along < w * length and inner(x, x) * length - along * along <= limit * length


def _is_near_triangle(p: Sequence[int], w: int, corners: Sequence[Vector], limit: int) -> bool:
    """The same of a triangle, above or below it."""
    a, b, c = corners
    normal = cross(minus(b, a), minus(c, a))
    height = inner(normal, p) - w * inner(normal, a)
    if height * height > limit * inner(normal, normal):
        return False
    return all(is_left_of(p, w, s, e, normal) for s, e in ((a, b), (b, c), (c, a))) and any(normal)


def _nearest_of_segment(p: WorldPoint, a: Vector, b: Vector) -> WorldPoint:
    """The point of a segment nearest a point."""
    d, w = minus(b, a), p[3]
    square = inner(d, d) * w
    along = max(0, min(square, inner(d, (p[0] - w * a[0], p[1] - w * a[1], p[2] - w * a[2]))))
    return (*(c * square + x * along for c, x in zip(a, d)), square) if square else (*a, 1)  # type: ignore[return-value]


def is_left_of(p: Sequence[int], w: int, start: Vector, end: Vector, normal: Vector) -> bool:
    """Whether p/w is to the left of an edge, or on it, seen against the normal."""
    x = p[0] - w * start[0], p[1] - w * start[1], p[2] - w * start[2]
    return inner(cross(minus(end, start), x), normal) >= 0


def least_height(C: CurvedBody, n: Vector) -> int:
    """A whole number at most n·x for all points of C."""
    return min(-r.a - isqrt(r.b) - 1 for r in C.reaches(opposite(n)))


def is_apart_along(A: IntegerBody, B: IntegerBody, n: Vector) -> bool:
    """Whether n·x is less on all of A than on all of B: n is a strictly separating direction."""
    return all(sign_of_overlap(r, s) < 0 for r in A.reaches(n) for s in B.reaches(opposite(n)))


def sign_of_overlap(r: Reach, s: Reach) -> int:
    """The sign of the sum of two reaches."""
    return sign_with_roots(r.a + s.a, r.b, s.b) if r.b and s.b else sign_with_root(r.a + s.a, r.b + s.b)
