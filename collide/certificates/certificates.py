"""Certificates: plain data that prove a boolean, and their check in Python integers.

Nothing here imports a kernel. A certificate names vertices, so it carries no rounded number:

apart     the nearest point v of the hull of the difference points a_i − b_j named (one to three of
          them) is the axis. It proves: v·(a − b) > (r_A + r_B)|v| for all vertices a of A and b of B.
together  the hull of the difference points named (one to four) comes within r_A + r_B of the origin.
          Where a half-space takes part, the vertex named lies behind its plane, or within the radius.

For unions of convex parts: together, one certificate names the parts that meet; apart, there is one
for each pair of parts. Cylinders, cones and ellipsoids have none (`certificate` is None), nor have
rows whose sign is open. Vertices are rows of `PackedConvex.points`: the points of a `ConvexHull` as
given, the corners of a `Box` by sign (−−−, −−+, …), the ends of a `Capsule`, the rounded ``vertices``
of an `HPolytope`. Pairs with a mesh: `mesh_certificates.py`.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from operator import index
from typing import NamedTuple

import numpy as np

from collide.errors import CollideError, InvalidArgument
from collide.lowering.packed_convex import HALFSPACE, POINTS, PackedConvex
from collide.lowering.parts import parts_of
from collide.results import UNDECIDED
from collide.transforms import as_poses


class Certificate(NamedTuple):
    """kind : "apart" or "together".   part_a, part_b : parts of A and B, 0 for convex bodies.
    pairs : ((vertex of A, vertex of B), …); −1 stands for a half-space.
    """

    kind: str
    part_a: int
    part_b: int
    pairs: tuple[tuple[int, int], ...]


class CertificateRefused(CollideError):
    """A certificate does not prove what the result claims; the message says where it fails."""


Vector = tuple[int, int, int]


# --- what a user calls --------------------------------------------------------------------------


def certificate_of(A, B, X_WA, X_WB, row) -> tuple[Certificate, ...] | None:
    """The certificate of one row of `distance`, or None where the pair has none.

    The vertices that decided in doubles are tried first; where they do not prove the boolean exactly,
    an exact search from them finds those that do.
    """
    if row["how"] == UNDECIDED or row["beyond"]:
        return None
    if A.meshed or B.meshed:
        from collide.certificates.mesh_certificates import mesh_certificate

        return mesh_certificate(A, B, X_WA, X_WB, row)
    parts_a, parts_b = _posed(A, X_WA), _posed(B, X_WB)
    if all(any(part.packed.kind == HALFSPACE for part in parts) for parts in (parts_a, parts_b)):
        return None
    if any(part.packed.kind not in (POINTS, HALFSPACE) for part in (*parts_a, *parts_b)):
        return None
    ids = [(int(i), int(j)) for i, j in zip(row["vertices_a"], row["vertices_b"])][: row["count"]]
    own = int(row["part_a"]), int(row["part_b"])
    if row["hit"]:
        return (_make(parts_a[own[0]], parts_b[own[1]], *own, ids, hit=True),)
    return tuple(
        _make(a, b, i, j, ids if (i, j) == own else [(0, 0)], hit=False)
        for i, a in enumerate(parts_a)
        for j, b in enumerate(parts_b)
    )


def certificate_from(A, B, X_WA, X_WB, pairs, *, hit: bool) -> tuple[Certificate, ...]:
    """The certificate of a boolean about two convex polytopes, from vertex pairs to begin the exact search with.

    pairs : one to four (vertex of A, vertex of B) near where the bodies meet, or are nearest each other.
    """
    (a,), (b,) = _posed(A, X_WA), _posed(B, X_WB)
    return (_make(a, b, 0, 0, list(pairs)[:4], hit=hit),)


def verify(A, B, X_WA, X_WB, r, *, certificate=None) -> None:
    """Check in Python integers that the certificate of a single result proves its boolean.

    A, B, X_WA, X_WB : the question, one pose each.   r : the `PairResult` of `distance`.
    certificate : to be checked instead of ``r.certificate``, for example one read from a file.

    Raises CertificateRefused with the reason; InvalidArgument where there is nothing to check.
    Looks at every vertex; O(vertices) integer operations a pair of parts.
    """
    for name, shape in (("A", A), ("B", B)):
        if not (hasattr(shape, "meshed") and hasattr(shape, "parts")):
            raise InvalidArgument(f"verify: {name} must be a shape, for example collide.Box((1, 1, 1)), got {shape!r}")
    if not (hasattr(r, "hit") and hasattr(r, "__len__")):
        raise InvalidArgument(f"verify: r must be a result of distance, got {r!r}")
    X_WA, X_WB = as_poses(X_WA, "X_WA", check=False), as_poses(X_WB, "X_WB", check=False)
    if len(X_WA) != 1 or len(X_WB) != 1 or len(r) != 1:
        raise InvalidArgument("verify: one pair at one pose each; index a batch first")
    given = r.certificate if certificate is None else certificate
    if given is None:
        raise InvalidArgument(
            "verify: this result carries no certificate (curved shapes, open sign, beyond, or bodies apart of which one is "
            "a mesh whose hull meets the other)"
        )
    given = _as_certificates(given)
    wanted = "together" if bool(np.all(r.hit)) else "apart"
    if A.meshed or B.meshed:
        from collide.certificates.mesh_certificates import refused_mesh

        reason = refused_mesh(A, B, X_WA[0], X_WB[0], given, wanted)
        if reason:
            raise CertificateRefused(reason)
        return
    parts_a, parts_b = _posed(A, X_WA[0]), _posed(B, X_WB[0])
    seen = set()
    for one in given:
        kind, i, j, pairs = one
        if kind != wanted:
            raise CertificateRefused(f"the result says {wanted}, the certificate {kind!r}")
        if not (0 <= i < len(parts_a) and 0 <= j < len(parts_b)):
            raise CertificateRefused(f"there are no parts {i} and {j}")
        reason = _refused(parts_a[i], parts_b[j], pairs, hit=kind == "together")
        if reason:
            raise CertificateRefused(f"parts {i} and {j}: {reason}")
        seen.add((i, j))
    if not seen or (wanted == "apart" and len(seen) < len(parts_a) * len(parts_b)):
        raise CertificateRefused(f"{len(parts_a) * len(parts_b)} pairs of parts, {len(seen)} of them certified")


def _as_certificates(given) -> list[Certificate]:
    """What may come from a file, as certificates of Python integers; refused where it has not their form."""
    try:
        return [
            Certificate(kind, index(i), index(j), tuple((index(p), index(q)) for p, q in pairs)) for kind, i, j, pairs in given
        ]
    except (TypeError, ValueError):
        raise CertificateRefused("a certificate is rows of (kind, part, part, pairs of vertex numbers), all numbers whole") from None


# --- exact points -------------------------------------------------------------------------------


class _Posed:
    """A convex part at its place: integer vertices times 2^exponent, exact."""

    def __init__(self, packed: PackedConvex, X_WB: np.ndarray, X_BP: np.ndarray):
        self.packed = packed
        rows = _matrix(X_WB, X_BP)
        self.rotation = [row[:3] for row in rows]
        self.shift = [row[3] for row in rows]

    def points(self) -> list[tuple[Fraction, ...]]:
        """World vertices as Fractions."""
        return [
            tuple(sum((r * Fraction(c) for r, c in zip(row, point)), shift) for row, shift in zip(self.rotation, self.shift))
            for point in self.packed.points.tolist()
        ]

    def plane(self):
        """(n, offset) with the half-space {x : n·x ≤ offset} in the world; n = cof(R) m."""
        R = self.rotation
        m, offset = [Fraction(v) for v in self.packed.params[:3]], Fraction(float(self.packed.params[3]))
        cofactor = [
            [
                R[(i + 1) % 3][(j + 1) % 3] * R[(i + 2) % 3][(j + 2) % 3]
                - R[(i + 1) % 3][(j + 2) % 3] * R[(i + 2) % 3][(j + 1) % 3]
                for j in range(3)
            ]
            for i in range(3)
        ]
        n = [sum(c * v for c, v in zip(row, m)) for row in cofactor]
        determinant = sum(a * b for a, b in zip(R[0], cofactor[0]))
        return n, offset * determinant + sum(a * b for a, b in zip(n, self.shift))


def _matrix(X_WB: np.ndarray, X_BP: np.ndarray) -> list[list]:
    """The first three rows of X_WB X_BP, multiplied exactly."""
    W = [[Fraction(v) for v in row] for row in X_WB[:3].tolist()]
    P = [[Fraction(v) for v in row] for row in X_BP.tolist()]
    return [[sum(w[k] * P[k][j] for k in range(4)) for j in range(4)] for w in W]


def _posed(shape, X_WB: np.ndarray) -> list[_Posed]:
    return [_Posed(packed, X_WB, X_BP) for packed, X_BP in parts_of(shape)]


def _to_integers(P, Q) -> tuple[list[Vector], list[Vector], int]:
    """Points of both bodies as integers, and the scale: what they were multiplied by."""
    scale = max(c.denominator for group in (P, Q) for point in group for c in point)  # powers of two
    scaled = [[(int(x * scale), int(y * scale), int(z * scale)) for x, y, z in group] for group in (P, Q)]
    return scaled[0], scaled[1], scale


def _dot(a, b) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _minus(a, b) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


# --- the check ----------------------------------------------------------------------------------


def _refused(a: _Posed, b: _Posed, pairs, *, hit: bool) -> str | None:
    """Why the vertex pairs do not prove that the parts meet (hit) or miss; None where they do."""
    if HALFSPACE in (a.packed.kind, b.packed.kind):
        return _refused_by_plane(a, b, pairs, hit=hit)
    counts = len(a.packed.points), len(b.packed.points)
    if not 1 <= len(pairs) <= 4:
        return f"one to four vertex pairs are needed, not {len(pairs)}"
    for i, j in pairs:
        if not (0 <= i < counts[0] and 0 <= j < counts[1]):
            return f"there is no vertex pair {i}, {j}"
    P, Q, scale = _to_integers(a.points(), b.points())
    radius = (Fraction(a.packed.radius) + Fraction(b.packed.radius)) * scale
    v, over = _nearest([_minus(P[i], Q[j]) for i, j in pairs])
    square = _dot(v, v)
    if hit:
        return None if square <= radius**2 * over**2 else "the points named do not come within the radii of the origin"
    if square == 0:
        return "the points named contain the origin, so they give no axis"
    gap = min(_dot(v, p) for p in P) - max(_dot(v, q) for q in Q)
    if gap > 0 and gap**2 > radius**2 * square:
        return None
    k = min(range(len(P)), key=lambda k: _dot(v, P[k]))
    m = max(range(len(Q)), key=lambda m: _dot(v, Q[m]))
    return f"vertex {k} of A and vertex {m} of B are not apart along the axis"


def _refused_by_plane(a: _Posed, b: _Posed, pairs, *, hit: bool) -> str | None:
    if a.packed.kind == b.packed.kind:
        return "two half-spaces have no certificate"
    half, body = (a, b) if a.packed.kind == HALFSPACE else (b, a)
    n, offset = half.plane()
    square = sum(c * c for c in n)
    radius = Fraction(body.packed.radius)
    values = [sum(c * x for c, x in zip(n, point)) - offset for point in body.points()]
    beyond = [value > 0 and value**2 > radius**2 * square for value in values]
    if hit:
        named = [j if half is a else i for i, j in pairs]
        if any(0 <= k < len(values) and not beyond[k] for k in named):
            return None
        return "no vertex named reaches the half-space"
    return None if all(beyond) else f"vertex {beyond.index(False)} reaches the half-space"


def _nearest(points: list[Vector]) -> tuple[Vector, int]:
    """(v, s) with v/s the point of the hull of at most four points nearest the origin, s > 0.

    Johnson's subalgorithm by definition: of all subsets, the one whose nearest point of the affine
    hull has positive weights, and to which no other point is an improvement.
    """
    for count in range(1, len(points) + 1):
        for subset in combinations(points, count):
            weights = _weights(subset)
            if weights is None or any(w <= 0 for w in weights):
                continue
            over = sum(weights)
            v = tuple(sum(w * p[k] for w, p in zip(weights, subset)) for k in range(3))
            if all(_dot(v, p) * over >= _dot(v, v) for p in points):
                return v, over  # type: ignore[return-value]
    raise AssertionError("some subset holds the nearest point")


def _weights(points: tuple[Vector, ...]) -> list[int] | None:
    """Integer weights of the point of the affine hull nearest the origin; None if dependent."""
    base, rest = points[0], [_minus(p, points[0]) for p in points[1:]]
    gram = [[_dot(e, f) for f in rest] for e in rest]
    right = [-_dot(e, base) for e in rest]
    whole = _determinant(gram)
    if whole == 0:
        return None
    tail = [
        _determinant([[right[i] if c == k else row[c] for c in range(len(rest))] for i, row in enumerate(gram)])
        for k in range(len(rest))
    ]
    return [whole - sum(tail), *tail]


def _determinant(m: list[list[int]]) -> int:
    if not m:
        return 1
    return sum((-1) ** k * m[0][k] * _determinant([row[:k] + row[k + 1 :] for row in m[1:]]) for k in range(len(m)))


# --- finding one --------------------------------------------------------------------------------


def _make(a: _Posed, b: _Posed, i: int, j: int, ids: list[tuple[int, int]], *, hit: bool) -> Certificate:
    kind = "together" if hit else "apart"
    if HALFSPACE in (a.packed.kind, b.packed.kind):
        return Certificate(kind, i, j, tuple(ids[:1]))
    counts = len(a.packed.points), len(b.packed.points)
    if not (ids and all(0 <= p < counts[0] and 0 <= q < counts[1] for p, q in ids)):
        ids = [(0, 0)]
    if _refused(a, b, ids, hit=hit) is None:
        return Certificate(kind, i, j, tuple(ids))
    return Certificate(kind, i, j, tuple(_search(a, b, ids)))


def _search(a: _Posed, b: _Posed, ids: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Vertex pairs of the simplex of A ⊖ B nearest the origin: GJK in integers."""
    P, Q, _ = _to_integers(a.points(), b.points())
    ids = list(dict.fromkeys(ids))[:4]
    while True:
        v, over = _nearest([_minus(P[i], Q[j]) for i, j in ids])
        ids = _carriers(P, Q, ids, v, over)
        if not any(v):
            return ids
        i = min(range(len(P)), key=lambda k: _dot(v, P[k]))
        j = max(range(len(Q)), key=lambda k: _dot(v, Q[k]))
        if _dot(v, _minus(P[i], Q[j])) * over >= _dot(v, v):
            return ids
        ids.append((i, j))


def _carriers(P, Q, ids, v: Vector, over: int) -> list[tuple[int, int]]:
    """The smallest subset of the pairs whose hull holds v/over as its nearest point."""
    for count in range(1, len(ids) + 1):
        for subset in combinations(ids, count):
            weights = _weights(tuple(_minus(P[i], Q[j]) for i, j in subset))
            if weights is None or any(w <= 0 for w in weights):
                continue
            total = sum(weights)
            point = [sum(w * _minus(P[i], Q[j])[k] for w, (i, j) in zip(weights, subset)) for k in range(3)]
            if all(c * over == x * total for c, x in zip(point, v)):
                return list(subset)
    raise AssertionError("the nearest point lies in some subset")
