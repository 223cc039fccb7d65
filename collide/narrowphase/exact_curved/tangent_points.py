"""Points where two bodies may touch, as fractions: from pencils of quadrics and of conics.

Two quadrics xᵀQx = 0 and xᵀSx = 0 with a common tangent plane at p have (Q + λ S) p = 0 for a λ at which
f(λ) = det(Q + λ S) has a multiple root (Wang, Wang and Kim, "An algebraic condition for the separation of two
ellipsoids", CAGD 18, 2001: f has a positive double root iff two ellipsoids touch from outside). f has degree 4 in
space, 3 in a plane. The multiple roots of f are the roots of gcd(f, f′). A multiple root without conjugates is a
fraction, and so is the point: conjugates of a touching point are touching points of the same pencil. Irrational
multiple roots come in conjugate pairs, and no point is made of these.

Points made here are candidates, no more: the bodies tell exactly whether both hold a candidate.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import permutations
from math import gcd

from collide.narrowphase.exact_curved.integer_bodies import Disc, IntegerBody, Matrix, WorldPoint, congruent
from collide.narrowphase.exact_curved.root_signs import exact_root

#: Coefficients, lowest first.
Polynomial = list[int]


def tangent_points(A: IntegerBody, B: IntegerBody, near: WorldPoint) -> Iterable[WorldPoint]:
    """Candidates, w > 0; of touching lines the point near a point of the world.

    Sides against sides in space; ends against sides in the plane of the end.
    """
    for Q in A.quadrics:
        for S in B.quadrics:
            yield from _finite(touching(Q, S, near))
    for body, opponent in ((A, B), (B, A)):
        for disc in body.discs:
            plane = disc.plane
            foot = _in_disc(disc, near)
            for S in opponent.quadrics:
                section = congruent(S, plane)
                points = touching(disc.conic, section, foot)
                for end in opponent.discs:
                    points += _ends_on_line(disc, plane, section, end)
                yield from _finite([sum(p * q for p, q in zip(row, point)) for row in plane] for point in points)


def _ends_on_line(disc: Disc, plane: Matrix, section: Matrix, end: Disc) -> list[list[int]]:
    """Where the common line of the planes of two ends leaves both discs at once, in the plane of the first disc; of a
    line leaving both twice, the middle."""
    z = end.pose.to_local[2]
    line = [sum(z[i] * plane[i][j] for i in range(4)) - end.height * end.pose.det * plane[3][j] for j in range(3)]
    if not any(line[:2]):
        return []
    square = line[0] ** 2 + line[1] ** 2
    start, step = [-line[0] * line[2], -line[1] * line[2], square], [-line[1], line[0], 0]
    quadratics = []
    for Q in (disc.conic, section):
        c, b, a = (_form(Q, u, v) for u, v in ((start, start), (start, step), (step, step)))
        quadratics.append([c, 2 * b, a])
    common = greatest_divisor(*quadratics)
    if len(common) not in (2, 3):
        return []
    share = Fraction(-common[0], common[1]) if len(common) == 2 else Fraction(-common[1], 2 * common[2])
    return [[share.denominator * s + share.numerator * d for s, d in zip(start, step)]]


def _in_disc(disc: Disc, near: WorldPoint) -> tuple[int, int, int]:
    x, y, _, w = disc.pose.local(near)
    return x, y, w


def _finite(points: Iterable[Sequence[int]]) -> Iterable[WorldPoint]:
    for x, y, z, w in points:
        if w:
            yield (x, y, z, w) if w > 0 else (-x, -y, -z, -w)


def touching(Q: Matrix, S: Matrix, near: Sequence[int]) -> list[list[int]]:
    """Vectors p (homogeneous) with (Q + λ S) p = 0, λ a rational multiple root of det(Q + λ S).

    Two cylinders along a common direction are taken in the plane across; of a touching line the point nearest ``near``.
    """
    common = kernel_of([*Q, *S])
    if common:
        return _across(Q, S, common[0], near)
    f = determinant_of_pencil(Q, S)
    points: list[list[int]] = []
    for root in multiple_roots(f):
        span = kernel_of([[root.denominator * q + root.numerator * s for q, s in zip(*rows)] for rows in zip(Q, S)])
        if len(span) == 1:
            points.append(span[0])
        elif len(span) == 2:
            points += _on_quadric(Q, span[0], span[1]) or [_nearest_in_span(span[0], span[1], near)]
    return points


def _on_quadric(Q: Matrix, u: list[int], v: list[int]) -> list[list[int]]:
    """The rational points s u + t v with xᵀQx = 0; none where Q vanishes on the whole line."""
    a, b, c = _form(Q, u, u), _form(Q, u, v), _form(Q, v, v)
    root = exact_root(b * b - a * c) if b * b >= a * c else None
    if root is None or not (a or b or c):
        return []
    shares = [(-b + root, a), (-b - root, a)] if a else [(1, 0), (c, -2 * b)]
    return [[s * x + t * y for x, y in zip(u, v)] for s, t in shares]


def _across(Q: Matrix, S: Matrix, along: list[int], near: Sequence[int]) -> list[list[int]]:
    if along[-1] or len(Q) < 3:
        return [along]
    k = next(i for i, x in enumerate(along) if x)
    Q, S = ([[x for j, x in enumerate(row) if j != k] for i, row in enumerate(R) if i != k] for R in (Q, S))
    points = touching(Q, S, [x for i, x in enumerate(near) if i != k])
    return [_nearest_in_span([*p[:k], 0, *p[k:]], along, near) for p in points]


def _form(Q: Matrix, u: Sequence[int], v: Sequence[int]) -> int:
    """uᵀQv."""
    return sum(x * q * y for x, row in zip(u, Q) for q, y in zip(row, v))


def _nearest_in_span(u: list[int], v: list[int], near: Sequence[int]) -> list[int]:
    """Of the points s u + t v the one nearest a point."""
    if not u[-1]:
        u, v = v, u
    if not u[-1]:
        return u
    direction = [a * v[-1] - b * u[-1] for a, b in zip(u, v)] if v[-1] else v
    square = sum(x * x for x in direction[:-1])
    if not square:
        return u
    along = sum(x * (n * u[-1] - a * near[-1]) for x, n, a in zip(direction[:-1], near[:-1], u[:-1]))
    share = Fraction(along, square * near[-1])  # u/u_w + share/u_w · direction
    return [a * share.denominator + share.numerator * x for a, x in zip(u[:-1], direction[:-1])] + [
        u[-1] * share.denominator
    ]


# --- polynomials and matrices -------------------------------------------------------------------


def determinant_of_pencil(Q: Matrix, S: Matrix) -> Polynomial:
    """det(Q + λ S), by all permutations: up to 24 products of linear factors."""
    n = len(Q)
    total = [0] * (n + 1)
    for order in permutations(range(n)):
        odd = sum(order[i] > order[j] for i in range(n) for j in range(i + 1, n)) % 2
        product = [-1 if odd else 1]
        for i, j in enumerate(order):
            q, s = Q[i][j], S[i][j]
            if not (q or s):
                break
            product = [a * q + b * s for a, b in zip([*product, 0], [0, *product])]
        else:
            total = [a + b for a, b in zip(total, product)]
    return total


def multiple_roots(f: Polynomial) -> list[Fraction]:
    """Roots of f of order two or more that are fractions."""
    f = primitive(f)
    if not f:
        return []
    common = greatest_divisor(f, derivative(f))
    simple = quotient(common, greatest_divisor(common, derivative(common)))
    if len(simple) == 2:
        return [Fraction(-simple[0], simple[1])]
    if len(simple) == 3:
        c, b, a = simple
        root = exact_root(b * b - 4 * a * c) if b * b >= 4 * a * c else None
        return [] if root is None else [Fraction(-b - root, 2 * a), Fraction(-b + root, 2 * a)]
    return []


def primitive(f: Polynomial) -> Polynomial:
    """f without leading zeros, divided by what its coefficients have in common."""
    f = list(f)
    while f and not f[-1]:
        f.pop()
    return _without_factor(f) if f else f


def derivative(f: Polynomial) -> Polynomial:
    return [k * a for k, a in enumerate(f)][1:]


def greatest_divisor(f: Polynomial, g: Polynomial) -> Polynomial:
    """By pseudo-remainders of primitive polynomials (Euclid, Collins 1967)."""
    f, g = primitive(f), primitive(g)
    while g:
        while len(f) >= len(g):
            shift = len(f) - len(g)
            scaled = [g[-1] * a for a in f]
            for k, b in enumerate(g):
                scaled[k + shift] -= f[-1] * b
            f = primitive(scaled)
            if not f:
                break
        f, g = g, f
    return f


def quotient(f: Polynomial, g: Polynomial) -> Polynomial:
    """f / g, which leaves nothing, but for a factor."""
    rest = [Fraction(a) for a in f]
    made = [Fraction(0)] * max(len(f) - len(g) + 1, 0)
    for k in range(len(made) - 1, -1, -1):
        made[k] = rest[k + len(g) - 1] / g[-1]
        for j, b in enumerate(g):
            rest[k + j] -= made[k] * b
    scale = 1
    for a in made:
        scale = scale * a.denominator // gcd(scale, a.denominator)
    return primitive([int(a * scale) for a in made])


def kernel_of(rows: Sequence[Sequence[int]]) -> list[list[int]]:
    """A basis, in integers, of the vectors that all rows are orthogonal to."""
    width = len(rows[0])
    reduced: list[list[int]] = []
    pivots: list[int] = []
    for row in rows:
        row = list(row)
        for made, p in zip(reduced, pivots):
            if row[p]:
                row = [a * made[p] - b * row[p] for a, b in zip(row, made)]
        if not any(row):
            continue
        pivot = next(j for j, a in enumerate(row) if a)
        row = _without_factor(row)
        for k, made in enumerate(reduced):
            if made[pivot]:
                reduced[k] = _without_factor([a * row[pivot] - b * made[pivot] for a, b in zip(made, row)])
        reduced.append(row)
        pivots.append(pivot)
    basis = []
    for free in (j for j in range(width) if j not in pivots):
        scale = 1
        for row, p in zip(reduced, pivots):
            scale = scale * abs(row[p]) // gcd(scale, row[p])
        vector = [0] * width
        vector[free] = scale
        for row, p in zip(reduced, pivots):
            vector[p] = -row[free] * scale // row[p]
        basis.append(_without_factor(vector))
    return basis


def _without_factor(row: list[int]) -> list[int]:
    common = gcd(*row)
    return [a // common for a in row]
