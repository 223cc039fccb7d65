"""Exact oracle for pairs of convex polytopes: obviously right rather than fast.

A body is the convex hull of points P, shape (n, 3), placed in the world frame by a
matrix R, shape (3, 3), and a vector t, shape (3,): its world vertices are R p + t.
Every double is the real number it is, R literally even where not quite orthonormal,
and nothing is rounded but the decimals read off at the end: vertices are integers
times one power of two, predicates are signs of integers, answers are Fractions.
Any finite, non-empty point set is a body: solid, flat, segment, point, duplicates.
Bodies are closed: touching is a hit, at distance 0.  Lengths carry the unit of the
inputs; directions point from A (P, R1, t1) to B (Q, R2, t2).

Everything is asked of the Minkowski difference A - B, the hull of a_i - b_j over all
vertex pairs (i, j): bodies meet iff it contains the origin; their gap is its distance
from the origin (GJK: Gilbert, Johnson, Keerthi 1988), their depth the distance from
the origin to its nearest facet (EPA: van den Bergen 2001).  Exact, both algorithms end
after finitely many strict improvements, and each answer carries a certificate, which
`verify` checks on all vertices without either algorithm.
"""

from collections import namedtuple
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from heapq import heappop, heappush
from itertools import combinations
from math import gcd

__all__ = ["Answer", "Certificate", "Depth"]
__all__ += ["depth", "distance", "hit", "signed_distance", "verify", "world_points"]

Certificate = namedtuple("Certificate", "axis pairs")


@dataclass(frozen=True)
class Answer:
    """Distance of two bodies, with closest points and the reason.

    distance_squared, distance: exact square, and its root to the digits asked for.
    point_a, point_b: closest points in the world frame; on a hit one common point.
    certificate.pairs: one to four (i, j, w), vertex ids of A and B and a rational w > 0,
        the w summing to 1, point_a = sum w a_i, point_b = sum w b_j: an upper bound.
    certificate.axis: integer vector n, the gap min n.b - max n.a being |n| distance, so
        that n separates strictly: a lower bound; None where the bodies meet.
    """

    hit: bool
    distance_squared: Fraction
    distance: Decimal
    point_a: tuple
    point_b: tuple
    certificate: Certificate


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


def world_points(P, R, t):
    """World vertices R p + t, exactly, as integers with a common exponent; O(n).

    Parameters
    ----------
    P : (n, 3) array_like
        Points in the body frame [m].
    R : (3, 3) array_like
        Its rotation in the world, taken as it stands.
    t : (3,) array_like
        Its origin in the world [m].

    Returns
    -------
    points : list of n tuples of 3 int
        Vertex i is points[i] · 2**e.
    e : int
        The exponent.
    """
    p, e_p = _integers(P)
    r, e_r = _integers(R)
    (t,), e_t = _integers([t])
    e = min(e_p + e_r, e_t)
    t = [x << (e_t - e) for x in t]
    return [tuple((dot(r[k], x) << (e_p + e_r - e)) + t[k] for k in range(3)) for x in p], e


def hit(P, R1, t1, Q, R2, t2, radius_a=0.0, radius_b=0.0):
    """Whether two bodies meet, each swept by a ball in the world frame.

    They meet iff their cores are at most the sum of the radii apart.

    Parameters
    ----------
    P, Q : (n, 3), (m, 3) array_like
        Vertices of the two polytopes in their own frames [m].
    R1, R2 : (3, 3) array_like
        Their rotations.
    t1, t2 : (3,) array_like
        Their origins in the world [m].
    radius_a, radius_b : float
        Of the balls [m], ≥ 0.

    Returns
    -------
    bool
        Exact. O(k (n + m)), k iterations of GJK, about ten.
    """
    A, B, e = _world_pair(P, R1, t1, Q, R2, t2)
    reach = _radius_sum(radius_a, radius_b)
    nearest = gjk(A, B, boolean=not reach)
    return _squared(dot(nearest.v, nearest.v), nearest.total**2, e) <= reach**2


def distance(P, R1, t1, Q, R2, t2, digits=30):
    """Distance of two polytopes with closest points and a certificate.

    Parameters
    ----------
    P, Q : (n, 3), (m, 3) array_like
        Vertices of the two polytopes in their own frames [m].
    R1, R2 : (3, 3) array_like
        Their rotations.
    t1, t2 : (3,) array_like
        Their origins in the world [m].
    digits : int
        Of the square root.

    Returns
    -------
    Answer
        The exact square, its root, closest points and their proof. O(k (n + m)), k iterations of GJK, about ten.
    """
    A, B, e = _world_pair(P, R1, t1, Q, R2, t2)
    nearest = gjk(A, B)
    squared = _squared(dot(nearest.v, nearest.v), nearest.total**2, e)
    axis = primitive(minus((0, 0, 0), nearest.v)) if squared else None
    weighted = zip(nearest.pairs, nearest.weights)
    pairs = tuple((i, j, Fraction(w, nearest.total)) for (i, j), w in weighted)
    a, b = _weighted_points(A, B, e, pairs)
    return Answer(squared == 0, squared, _root(squared, digits), a, b, Certificate(axis, pairs))


def depth(P, R1, t1, Q, R2, t2, digits=30):
    """Penetration depth of two polytopes that meet, with a certificate.

    Parameters
    ----------
    P, Q : (n, 3), (m, 3) array_like
        Vertices of the two polytopes in their own frames [m].
    R1, R2 : (3, 3) array_like
        Their rotations.
    t1, t2 : (3,) array_like
        Their origins in the world [m].
    digits : int
        Of the square root.

    Returns
    -------
    Depth
        The exact square, its root, and their proof. O(k (n + m + f)), k iterations of EPA on a surface of at most f
        triangles.

    Raises
    ------
    ValueError
        Where the bodies are apart.
    """
    A, B, e = _world_pair(P, R1, t1, Q, R2, t2)
    nearest = gjk(A, B)
    if any(nearest.v):
        raise ValueError("bodies are apart: they have a distance, not a depth")
    return epa(A, B, e, nearest.pairs, digits)


def signed_distance(P, R1, t1, Q, R2, t2, digits=30, radius_a=0.0, radius_b=0.0):
    """Gap of two swept polytopes, or minus their depth where they overlap.

    Cores apart: distance − r, with r the sum of the radii. Cores that meet: −(depth + r), the exact penetration of the
    sums, since a ball moves every supporting plane of A − B by r. Where A − B has no interior the core depth is 0,
    hence −r.

    Parameters
    ----------
    P, Q : (n, 3), (m, 3) array_like
        Vertices of the two polytopes in their own frames [m].
    R1, R2 : (3, 3) array_like
        Their rotations.
    t1, t2 : (3,) array_like
        Their origins in the world [m].
    digits : int
        Of the answer.
    radius_a, radius_b : float
        Of balls added in the world frame [m], ≥ 0.

    Returns
    -------
    Decimal
        [m]. Time of `distance` plus `depth`.
    """
    A, B, e = _world_pair(P, R1, t1, Q, R2, t2)
    reach = _radius_sum(radius_a, radius_b)
    nearest = gjk(A, B)
    guard, r = Context(prec=digits + 10), _decimal(reach, digits + 10)
    if not any(nearest.v):
        core = epa(A, B, e, nearest.pairs, digits + 10).depth
        return Context(prec=digits).minus(guard.add(core, r))
    # s - r = (s^2 - r^2) / (s + r): the exact numerator leaves nothing to cancel.
    squared = _squared(dot(nearest.v, nearest.v), nearest.total**2, e)
    excess = _decimal(squared - reach**2, digits + 10)
    return Context(prec=digits).divide(excess, guard.add(_root(squared, digits + 10), r))


def verify(answer, P, R1, t1, Q, R2, t2):
    """Check an `Answer` or `Depth` on all vertices.

    The checks prove the value from both sides and share only arithmetic with GJK and EPA. One exception: a `Depth` of 0
    proves that one plane parts the interiors, not that the bodies meet, which is for `distance` to prove.

    Parameters
    ----------
    answer : Answer or Depth
        Of these bodies.
    P, Q : (n, 3), (m, 3) array_like
        Vertices of the two polytopes in their own frames [m].
    R1, R2 : (3, 3) array_like
        Their rotations.
    t1, t2 : (3,) array_like
        Their origins in the world [m].

    Returns
    -------
    None
        Where everything holds. O(n + m + triangles of the shell).

    Raises
    ------
    ValueError
        Saying what is wrong.
    """
    checks = _depth_checks if isinstance(answer, Depth) else _distance_checks
    for holds, reason in checks(answer, *_world_pair(P, R1, t1, Q, R2, t2)):
        if not holds:
            raise ValueError(reason)


# Arithmetic ---------------------------------------------------------------------------


def _integers(rows):
    """Rows of three doubles, or Fractions of their kind, as integer 3-tuples and an exponent e: integers * 2**e."""
    # A double is a ratio whose denominator is a power of two; so are sums and products of doubles.
    ratios = [[(x if isinstance(x, Fraction) else float(x)).as_integer_ratio() for x in row] for row in rows]
    if not ratios or any(len(row) != 3 for row in ratios):
        raise ValueError("expected at least one row of three coordinates")
    shift = max(d.bit_length() - 1 for row in ratios for _, d in row)
    return [tuple((n << shift) // d for n, d in row) for row in ratios], -shift


def _world_pair(P, R1, t1, Q, R2, t2):
    """World vertices of both bodies as integers with the same exponent: (A, B, e)."""
    (A, e_a), (B, e_b) = world_points(P, R1, t1), world_points(Q, R2, t2)
    e = min(e_a, e_b)
    A = [tuple(x << (e_a - e) for x in a) for a in A]
    B = [tuple(x << (e_b - e) for x in b) for b in B]
    return A, B, e


def _radius_sum(radius_a, radius_b):
    if radius_a < 0 or radius_b < 0:
        raise ValueError("a radius must not be negative")
    return Fraction(float(radius_a)) + Fraction(float(radius_b))


def _decimal(x, digits):
    return Context(prec=digits).divide(Decimal(x.numerator), Decimal(x.denominator))


def _root(squared, digits):
    """The square root of a Fraction, rounded to so many digits."""
    return Context(prec=digits).sqrt(_decimal(squared, digits + 10))


def _squared(numerator, denominator, e):
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


def _weighted_points(A, B, e, pairs):
    """The points sum w a_i and sum w b_j in the world frame, pairs being (i, j, w)."""
    weights = [w * Fraction(2) ** e for _, _, w in pairs]
    a = combination(weights, [A[i] for i, _, _ in pairs])
    return a, combination(weights, [B[j] for _, j, _ in pairs])


def support(A, B, n):
    """The pair (i, j) whose difference a_i - b_j reaches farthest along n; exhaustive."""
    along_a = [dot(n, a) for a in A]
    along_b = [dot(n, b) for b in B]
    return along_a.index(max(along_a)), along_b.index(min(along_b))


# The point v / total of A - B, where v = sum weights (a_i - b_j) over pairs (i, j).
Nearest = namedtuple("Nearest", "pairs weights total v")


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
    return Depth(squared, _root(squared, digits), normal, facet, tuple(triangles))


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


# Certificates: each check yields (whether it holds, what is wrong otherwise) -------------


def _known(A, B, pairs):
    return bool(pairs) and all(0 <= i < len(A) and 0 <= j < len(B) for i, j in pairs)


def _is_root(root, squared):
    return root == _root(squared, len(root.as_tuple().digits))


def _extent(A, B, n):
    """max n.a - min n.b, how far A - B reaches along n; minus the gap where apart."""
    return max(dot(n, a) for a in A) - min(dot(n, b) for b in B)


def _distance_checks(answer, A, B, e):
    axis, pairs = answer.certificate
    yield _known(A, B, [(i, j) for i, j, _ in pairs]), "vertex pairs are missing or unknown"
    yield all(w > 0 for _, _, w in pairs), "a weight is not positive"
    yield sum(w for _, _, w in pairs) == 1, "the weights do not sum to 1"
    points = _weighted_points(A, B, e, pairs)
    yield points == (answer.point_a, answer.point_b), "the closest points are not as weighted"
    squared = dot(minus(*points), minus(*points))
    yield squared == answer.distance_squared, "the closest points are not that far apart"
    yield _is_root(answer.distance, squared), "the distance is not the root of its square"
    yield answer.hit == (squared == 0), "hit contradicts the distance"
    yield answer.hit == (axis is None), "an axis is due where bodies are apart, only there"
    if axis is not None:
        gap = -_extent(A, B, axis)
        yield gap > 0, "the axis does not separate the bodies strictly"
        yield _squared(gap**2, dot(axis, axis), e) == squared, "the gap along the axis is not the distance"


def _depth_checks(answer, A, B, e):
    n, squared = answer.normal, answer.depth_squared
    yield any(n), "the normal is 0"
    extent = _extent(A, B, n)
    yield extent >= 0, "the bodies are apart along the normal"
    yield _squared(extent**2, dot(n, n), e) == squared, "the depth does not make the bodies touch"
    yield _is_root(answer.depth, squared), "the depth is not the root of its square"
    yield _known(A, B, answer.facet), "vertex pairs are missing or unknown"
    on_plane = all(dot(n, minus(A[i], B[j])) == extent for i, j in answer.facet)
    yield on_plane, "the facet is not in the supporting plane of the normal"
    if squared:
        yield from _shell_checks(answer, A, B, e)


def _shell_checks(answer, A, B, e):
    """Whether A - B holds the ball around the origin whose radius is the depth.

    A closed surface that turns the inner side of every triangle to the origin winds
    around it, so every ray from the origin crosses it, at the depth or farther out.
    """
    edges = [edge for p, q, r in answer.shell for edge in ((p, q), (q, r), (r, p))]
    yield _known(A, B, [p for p, _ in edges]), "vertex pairs are missing or unknown"
    closed = len(set(edges)) == len(edges) and set(edges) == {(q, p) for p, q in edges}
    yield closed, "the shell is not a closed surface"
    for triangle in answer.shell:
        p, q, r = (minus(A[i], B[j]) for i, j in triangle)
        n = cross(minus(q, p), minus(r, p))
        yield dot(n, p) > 0, "a triangle of the shell turns its outer side to the origin"
        yield _squared(dot(n, p) ** 2, dot(n, n), e) >= answer.depth_squared, "the shell is nearer than the depth"
