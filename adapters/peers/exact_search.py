"""GJK and EPA in integers, for the exact oracle (`exact.py`): both end after finitely many strict improvements.

Bodies are lists of integer points with a common exponent; everything is asked of the Minkowski difference A − B, the
hull of a_i − b_j over all vertex pairs (i, j).
"""

from collections import namedtuple
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from heapq import heappop, heappush
from itertools import combinations
from math import gcd

Nearest = namedtuple("Nearest", "pairs weights total v")


@dataclass(frozen=True)
class Depth:
    """Shortest translation that takes apart, up to touching, two bodies that meet.

    depth_squared, depth: exact square, and its root to the digits asked for; 0 where the
        bodies only touch or A - B has no interior.
    normal: integer vector n, not 0: moving B by depth n / |n| makes the bodies touch.
    facet: vertex-id pairs (i, j) with a_i - b_j in the plane n.x = depth |n|: three that
        span the nearest facet of A - B, or, where it has no interior, all of A - B.
    shell: triangles, each three pairs (i, j), of a closed surface inside A - B around
        the origin, nowhere nearer than the depth; empty where A - B has no interior.
    """

    depth_squared: Fraction
    depth: Decimal
    normal: tuple
    facet: tuple
    shell: tuple


def decimal_of(x, digits):
    return Context(prec=digits).divide(Decimal(x.numerator), Decimal(x.denominator))


def root_of(squared, digits):
    """The square root of a Fraction, rounded to so many digits."""
    return Context(prec=digits).sqrt(decimal_of(squared, digits + 10))


def squared_length(numerator, denominator, e):
    """The square of a length: a ratio of integers, brought to the world unit."""
    return Fraction(numerator, denominator) * Fraction(4) ** e


def dot(p, q):
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def cross(p, q):
    x, y, z = p
    u, v, w = q
    return (y * w - z * v, z * u - x * w, x * v - y * u)


def minus(p, q):
    return (p[0] - q[0], p[1] - q[1], p[2] - q[2])


def combination(weights, points):
    return tuple(sum(w * p[k] for w, p in zip(weights, points)) for k in range(3))


def primitive(p):
    """Integers divided by their greatest common divisor, which keeps them short."""
    g = gcd(*p)
    return tuple(x // g for x in p) if g > 1 else tuple(p)


def support(A, B, n):
    """The pair (i, j) whose difference a_i - b_j reaches farthest along n; exhaustive."""
    along_a = [dot(n, a) for a in A]
    along_b = [dot(n, b) for b in B]
    return along_a.index(max(along_a)), along_b.index(min(along_b))


def gjk(A, B, boolean=False):
    """The point of A - B nearest to the origin; with `boolean` any point, 0 iff that is.

    Each round comes strictly nearer: the segment from v to a point beyond the plane
    through v across v holds nearer points.  Simplices are finitely many, so it ends.
    """
    pairs = [(0, 0)]
    while True:
        nearest = nearest_in_simplex(A, B, pairs)
        n = primitive(minus((0, 0, 0), nearest.v))
        i, j = support(A, B, n)
        reach = dot(n, minus(A[i], B[j]))
        if reach * nearest.total <= dot(n, nearest.v) or (boolean and reach < 0):
            return nearest
        pairs = [(i, j), *nearest.pairs]


def nearest_in_simplex(A, B, pairs):
    """The point of the hull of one to four differences nearest to the origin.

    It is the one v in the hull with v.p >= v.v for all corners p, and by Caratheodory it
    has positive weights on some affinely independent subset: try them all.
    """
    points = {(i, j): minus(A[i], B[j]) for i, j in pairs}
    subsets = [s for size in range(len(points)) for s in combinations(points, size + 1)]
    for subset in subsets:
        corners = [points[pair] for pair in subset]
        weights = foot_weights(corners)
        if min(weights) <= 0:
            continue
        total, v = sum(weights), combination(weights, corners)
        if all(dot(v, p) * total >= dot(v, v) for p in points.values()):
            return Nearest(list(subset), weights, total, v)
    raise AssertionError("every simplex has a point nearest to the origin")


def foot_weights(points):
    """Integer barycentric weights of the foot of the perpendicular from the origin to the
    affine hull of one to four points, their sum positive; all 0 for dependent points."""
    if len(points) == 1:
        return (1,)
    if len(points) == 2:
        p, q = points
        edge = minus(q, p)
        return primitive((dot(q, edge), -dot(p, edge)))
    if len(points) == 3:
        p, q, r = points
        n = cross(minus(q, p), minus(r, p))
        return primitive([dot(n, cross(x, y)) for x, y in ((q, r), (r, p), (p, q))])
    # Four points span space, so the foot is the origin itself: Cramer's rule.
    p, q, r, s = points
    qr, ps = cross(q, r), cross(p, s)
    weights = (dot(s, qr), dot(r, ps), -dot(q, ps), -dot(p, qr))
    sign = (sum(weights) > 0) - (sum(weights) < 0)
    return primitive([sign * w for w in weights])


class Shell:
    """A growing polytope inside A - B that contains the origin: a closed surface of
    triangles, counterclockwise from outside, queued by the distance of their planes."""

    def __init__(self, tetrahedron):
        self.points = p, q, r, s = list(tetrahedron)
        self.planes, self.queue = {}, []
        inward = dot(cross(minus(q, p), minus(r, p)), minus(s, p)) > 0
        a, b = (1, 0) if inward else (0, 1)
        for triangle in ((a, b, 2), (b, a, 3), (a, 2, 3), (2, b, 3)):
            self.add(*triangle)

    def add(self, a, b, c):
        p, q, r = (self.points[k] for k in (a, b, c))
        n = primitive(cross(minus(q, p), minus(r, p)))
        self.planes[a, b, c] = n, dot(n, p)
        heappush(self.queue, (Fraction(dot(n, p) ** 2, dot(n, n)), (a, b, c)))

    def push(self, point):
        """Grow to contain a point outside: replace the triangles that it strictly sees.

        A triangle coplanar with the point stays, new ones continue it.  None is flat: the
        old edge of a new one lies in a plane that the point is strictly beyond.
        """
        seen = [tri for tri, (n, offset) in self.planes.items() if dot(n, point) > offset]
        edges = dict.fromkeys(e for a, b, c in seen for e in ((a, b), (b, c), (c, a)))
        for triangle in seen:
            del self.planes[triangle]
        self.points.append(point)
        for a, b in edges:
            if (b, a) not in edges:
                self.add(a, b, len(self.points) - 1)


def epa(A, B, e, pairs, digits):
    """The `Depth`, grown from a simplex `pairs` of differences that holds the origin.

    The nearest plane of an inner polytope is at most as far as the nearest facet of
    A - B, so it is that facet once it supports A - B; else push a vertex beyond it.
    """
    pairs, normal = spanning_pairs(A, B, pairs)
    if len(pairs) < 4:
        return Depth(Fraction(0), Decimal(0), normal, tuple(pairs), ())
    shell = Shell(minus(A[i], B[j]) for i, j in pairs)
    while True:
        squared, nearest = heappop(shell.queue)
        if nearest in shell.planes:
            normal, offset = shell.planes[nearest]
            i, j = support(A, B, normal)
            point = minus(A[i], B[j])
            if dot(normal, point) == offset:
                break
            shell.push(point)
            pairs.append((i, j))
    squared *= Fraction(4) ** e
    facet, *triangles = (tuple(pairs[k] for k in tri) for tri in (nearest, *shell.planes))
    return Depth(squared, root_of(squared, digits), normal, facet, tuple(triangles))


def spanning_pairs(A, B, pairs):
    """Affinely independent differences, extended until they span A - B, and a normal of
    A - B where it is flat, or None."""
    pairs, axes = list(pairs), [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    while len(pairs) < 4:
        origin, *others = [minus(A[i], B[j]) for i, j in pairs]
        edges = [minus(p, origin) for p in others]
        # These span the directions orthogonal to the differences so far.
        crosses = [cross(u, v) for u in edges[:1] or axes for v in edges[1:] or axes]
        normals = [primitive(n) for n in crosses if any(n)]
        for n in normals + [minus((0, 0, 0), n) for n in normals]:
            i, j = support(A, B, n)
            if dot(n, minus(A[i], B[j])) > dot(n, origin):
                pairs.append((i, j))
                break
        else:
            return pairs, normals[0]
    return pairs, None


def widest_difference(A, B, n):
    """max n.a - min n.b, how far A - B reaches along n; minus the gap where apart."""
    return max(dot(n, a) for a in A) - min(dot(n, b) for b in B)
