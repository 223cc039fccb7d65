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

from collide.adapters.peers.exact_search import (
    Depth,
    combination,
    cross,
    decimal_of,
    dot,
    epa,
    gjk,
    minus,
    primitive,
    root_of,
    squared_length,
    widest_difference,
)

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
    return squared_length(dot(nearest.v, nearest.v), nearest.total**2, e) <= reach**2


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
    squared = squared_length(dot(nearest.v, nearest.v), nearest.total**2, e)
    axis = primitive(minus((0, 0, 0), nearest.v)) if squared else None
    weighted = zip(nearest.pairs, nearest.weights)
    pairs = tuple((i, j, Fraction(w, nearest.total)) for (i, j), w in weighted)
    a, b = _weighted_points(A, B, e, pairs)
    return Answer(squared == 0, squared, root_of(squared, digits), a, b, Certificate(axis, pairs))


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
    guard, r = Context(prec=digits + 10), decimal_of(reach, digits + 10)
    if not any(nearest.v):
        core = epa(A, B, e, nearest.pairs, digits + 10).depth
        return Context(prec=digits).minus(guard.add(core, r))
    # s - r = (s^2 - r^2) / (s + r): the exact numerator leaves nothing to cancel.
    squared = squared_length(dot(nearest.v, nearest.v), nearest.total**2, e)
    excess = decimal_of(squared - reach**2, digits + 10)
    return Context(prec=digits).divide(excess, guard.add(root_of(squared, digits + 10), r))


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


def _weighted_points(A, B, e, pairs):
    """The points sum w a_i and sum w b_j in the world frame, pairs being (i, j, w)."""
    weights = [w * Fraction(2) ** e for _, _, w in pairs]
    a = combination(weights, [A[i] for i, _, _ in pairs])
    return a, combination(weights, [B[j] for _, j, _ in pairs])


# The point v / total of A - B, where v = sum weights (a_i - b_j) over pairs (i, j).


# Certificates: each check yields (whether it holds, what is wrong otherwise) -------------


def _known(A, B, pairs):
    return bool(pairs) and all(0 <= i < len(A) and 0 <= j < len(B) for i, j in pairs)


def _is_root(root, squared):
    return root == root_of(squared, len(root.as_tuple().digits))


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
        gap = -widest_difference(A, B, axis)
        yield gap > 0, "the axis does not separate the bodies strictly"
        yield squared_length(gap**2, dot(axis, axis), e) == squared, "the gap along the axis is not the distance"


def _depth_checks(answer, A, B, e):
    n, squared = answer.normal, answer.depth_squared
    yield any(n), "the normal is 0"
    extent = widest_difference(A, B, n)
    yield extent >= 0, "the bodies are apart along the normal"
    yield squared_length(extent**2, dot(n, n), e) == squared, "the depth does not make the bodies touch"
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
        yield squared_length(dot(n, p) ** 2, dot(n, n), e) >= answer.depth_squared, "the shell is nearer than the depth"
