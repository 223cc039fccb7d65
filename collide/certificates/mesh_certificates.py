"""Certificates of pairs with a mesh, and their check in Python integers. Nothing here imports a kernel.

together  facets `part_a` and `part_b` (of meshes; 0 for a convex shape, which is taken whole) come within r_A + r_B of
          each other: the hull of the difference points named does, and vertices of a mesh are corners of that facet.
inside    the vertex named of one body, −1 standing for the other, lies in the other, a solid: its facets wind around it.
apart     as of convex bodies, the axis that the vertices named give parts all vertices in use. A mesh whose hull meets
          the other body has none, though the bodies be apart: that would take an axis for every pair of facets.

Vertices of a mesh are rows of ``vertices``, those of convex shapes as in `certificates.py`.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.certificates.certificates import Certificate, _minus, _Posed, _refused, _refused_by_plane, _search
from collide.lowering.packed_convex import HALFSPACE, POINTS, pack_points
from collide.lowering.parts import convex_set_of, parts_of

_IDENTITY = np.eye(4)
#: Directions of the segments that count how often a surface winds around a point; the next one where an edge is met.
_DIRECTIONS = ((7919, 104729, 1299709), (-15485863, 32452843, 49979687), (86028121, -3, 17), (5, 982451653, -373587883))


def mesh_certificate(A, B, X_WA, X_WB, row) -> tuple[Certificate, ...] | None:
    """The certificate of one row of `distance`, a mesh among the shapes; None where there is none."""
    one, other = _Side(A, X_WA), _Side(B, X_WB)
    if not (one.served and other.served):
        return None
    if HALFSPACE in (one.kind, other.kind):
        return _of_plane(one, other, bool(row["hit"]))
    return _together(one, other, row) if row["hit"] else _apart(one, other)


def refused_mesh(A, B, X_WA, X_WB, given, wanted: str) -> str | None:
    """Why a certificate does not prove that the bodies meet ("together") or miss ("apart"); None where it does."""
    one, other = _Side(A, X_WA), _Side(B, X_WB)
    if not (one.served and other.served):
        return "these shapes have no certificates"
    if len(given) != 1:
        return f"one certificate is needed, not {len(given)}"
    kind, i, j, pairs = given[0]
    if (kind == "apart") != (wanted == "apart"):
        return f"the result says {wanted}, the certificate {kind!r}"
    if kind == "inside":
        return _refused_inside(one, other, pairs)
    if kind not in ("apart", "together"):
        return f"there is no kind {kind!r}"
    return _refused_pairs(one, other, i, j, pairs, hit=kind == "together")


class _Side:
    """One body: its shape, pose, and vertices in use."""

    def __init__(self, shape, X: np.ndarray):
        self.shape, self.X, self.meshed = shape, X, shape.meshed and hasattr(shape, "faces")
        self.packed = None if shape.meshed else convex_set_of(shape)
        self.kind = POINTS if self.packed is None else self.packed.kind
        plain = self.meshed or (
            not shape.meshed and len(parts_of(shape)) == 1 and np.array_equal(parts_of(shape)[0][1], _IDENTITY)
        )
        self.served = plain and self.kind in (POINTS, HALFSPACE) and (self.packed is None or self.packed.slop == 0.0)
        self.used = np.unique(shape.faces) if self.meshed else None

    def posed(self, ids=None) -> _Posed:
        """All vertices in use, or these, in this order."""
        if self.packed is not None:
            return _Posed(self.packed, self.X, _IDENTITY)
        chosen = self.used if ids is None else np.asarray(ids)
        return _PosedMesh(pack_points(self.shape.vertices[chosen]), self.X, _IDENTITY)

    def facet(self, k: int) -> list[int] | None:
        """Vertex ids of facet k; None for a convex shape, which is taken whole."""
        return self.shape.faces[k].tolist() if self.meshed else None


def _name(side: _Side, ids, k: int) -> int:
    return k if ids is None else int(ids[k])


def _of_plane(one: _Side, other: _Side, hit: bool) -> tuple[Certificate, ...] | None:
    """The vertex nearest the plane, found in integers: it lies behind it, or all lie before it."""
    half, body = (one, other) if one.kind == HALFSPACE else (other, one)
    if body.kind == HALFSPACE:
        return None
    n, _ = half.posed().plane()
    points = body.posed().points()
    k = min(range(len(points)), key=lambda k: sum(c * x for c, x in zip(n, points[k])))
    vertex = _name(body, body.used, k)
    return (Certificate("together" if hit else "apart", 0, 0, ((-1, vertex) if half is one else (vertex, -1),)),)


def _apart(one: _Side, other: _Side) -> tuple[Certificate, ...] | None:
    """Vertex pairs that give an axis between the hulls; None where these meet."""
    a, b = one.posed(), other.posed()
    found = _search(a, b, [(0, 0)])
    if _refused(a, b, found, hit=False) is not None:
        return None
    pairs = tuple((_name(one, one.used, i), _name(other, other.used, j)) for i, j in found)
    return (Certificate("apart", 0, 0, pairs),)


def _together(one: _Side, other: _Side, row) -> tuple[Certificate, ...] | None:
    facets = [int(row["part_a"]) if one.meshed else 0, int(row["part_b"]) if other.meshed else 0]
    ids = one.facet(facets[0]), other.facet(facets[1])
    a, b = one.posed(ids[0]), other.posed(ids[1])
    found = _search(a, b, [(0, 0)])
    if _refused(a, b, found, hit=True) is None:
        pairs = tuple((_name(one, ids[0], i), _name(other, ids[1], j)) for i, j in found)
        return (Certificate("together", facets[0], facets[1], pairs),)
    for solid, body, first in ((one, other, False), (other, one, True)):
        if not (solid.meshed and solid.shape.solid):
            continue
        for vertex in _one_of_each_part(body):
            pair = (vertex, -1) if first else (-1, vertex)
            if _refused_inside(one, other, (pair,)) is None:
                return (Certificate("inside", 0, 0, (pair,)),)
    return None


def _one_of_each_part(body: _Side) -> list[int]:
    """Vertex ids: one of every part that hangs together, at least."""
    if not body.meshed:
        return [0]
    _, first = np.unique(body.shape.survey.shells, return_index=True)
    return body.shape.faces[first, 0].tolist()


# --- the check ----------------------------------------------------------------------------------


def _refused_pairs(one: _Side, other: _Side, i: int, j: int, pairs, *, hit: bool) -> str | None:
    for side, k, name in ((one, i, "A"), (other, j, "B")):
        if not 0 <= k < (len(side.shape.faces) if side.meshed else 1):
            return f"{name} has no facet {k}"
    if HALFSPACE in (one.kind, other.kind):
        return _refused_by_plane(one.posed(), other.posed(), _numbered(one, other, pairs), hit=hit)
    if not hit:
        named = _numbered(one, other, pairs)
        if not 1 <= len(named) <= 4:
            return f"one to four vertex pairs are needed, not {len(named)}"
        if any(k < 0 for pair in named for k in pair):
            return "a vertex named is none, or is in no facet"
        return _refused(one.posed(), other.posed(), named, hit=False)
    ids = one.facet(i), other.facet(j)
    local = []
    for pair in pairs:
        here = []
        for k, own in zip(pair, ids):
            if own is not None and k not in own:
                return f"vertex {k} is no corner of the facet named"
            here.append(k if own is None else own.index(k))
        local.append(tuple(here))
    return _refused(one.posed(ids[0]), other.posed(ids[1]), local, hit=True)


def _numbered(one: _Side, other: _Side, pairs) -> list[tuple[int, int]]:
    """Pairs by places among the vertices in use; −1 where there is none such."""
    places = [None if side.used is None else {int(v): k for k, v in enumerate(side.used)} for side in (one, other)]
    return [tuple(k if own is None else own.get(k, -1) for k, own in zip(pair, places)) for pair in pairs]  # type: ignore[misc]


def _refused_inside(one: _Side, other: _Side, pairs) -> str | None:
    if len(pairs) != 1 or sum(k == -1 for k in pairs[0]) != 1:
        return "one vertex of one body is needed, and −1 for the other"
    i, j = pairs[0]
    solid, body, vertex = (one, other, j) if i == -1 else (other, one, i)
    if not (solid.meshed and solid.shape.solid):
        return "the other body is no solid mesh"
    many = len(body.shape.vertices) if body.meshed else len(body.packed.points)  # type: ignore[union-attr]
    if body.kind != POINTS or not 0 <= vertex < many or (body.meshed and vertex not in body.used):  # type: ignore[operator]
        return f"there is no vertex {vertex}"
    point = (body.posed([vertex]).points()[0] if body.meshed else body.posed().points()[vertex])
    if _winding(_integers(solid, point), solid.shape.faces.tolist()) > 0:
        return None
    return f"vertex {vertex} does not lie in the solid"


def _integers(solid: _Side, point) -> list[tuple[int, int, int]]:
    """Vertices of a mesh less the point, times one power of two: exact."""
    rows = [[Fraction(v) for v in row] for row in solid.X[:3].tolist()]
    shift = [row[3] - x for row, x in zip(rows, point)]
    return _placed([row[:3] for row in rows], shift, solid.shape.vertices.tolist())[0]


def _placed(rotation, shift, values) -> tuple[list[tuple[int, int, int]], int]:
    """(integer points, what they are to be divided by) of R v + t, exactly; a tenth of the time that Fractions take."""
    unit = max(x.as_integer_ratio()[1] for v in values for x in v)
    scaled = [[n * (unit // d) for n, d in map(float.as_integer_ratio, v)] for v in values]
    over = max(x.denominator for row in rotation for x in row)
    last = max([over * unit, *(x.denominator for x in shift)])
    more = last // (over * unit)
    R = [[int(x * over) * more for x in row] for row in rotation]
    t = [int(x * last) for x in shift]
    (a, b, c), (d, e, f), (g, h, i) = R
    tx, ty, tz = t
    return [(a * x + b * y + c * z + tx, d * x + e * y + f * z + ty, g * x + h * y + i * z + tz) for x, y, z in scaled], last


class _PosedMesh(_Posed):
    """Many vertices at their place."""

    def points(self) -> list[tuple[Fraction, ...]]:
        found, over = _placed(self.rotation, self.shift, self.packed.points.tolist())
        return [(Fraction(x, over), Fraction(y, over), Fraction(z, over)) for x, y, z in found]


def _winding(points: list[tuple[int, int, int]], faces: list[list[int]]) -> int:
    """How often the facets wind around the origin; 1 where it lies on one of them."""
    for direction in _DIRECTIONS:
        dx, dy, dz = direction
        total, clear = 0, True
        # Sides of the plane through the origin across two others: only facets that the line can meet are looked at.
        ux, uy, uz = -dy, dx, 0
        vx, vy, vz = dy * uz - dz * uy, dz * ux - dx * uz, dx * uy - dy * ux
        flat = [(ux * x + uy * y + uz * z, vx * x + vy * y + vz * z) for x, y, z in points]
        for a, b, c in faces:
            (pa, qa), (pb, qb), (pc, qc) = flat[a], flat[b], flat[c]
            if (pa > 0 and pb > 0 and pc > 0) or (pa < 0 and pb < 0 and pc < 0):
                continue
            if (qa > 0 and qb > 0 and qc > 0) or (qa < 0 and qb < 0 and qc < 0):
                continue
            sides = pa * qb - pb * qa, pb * qc - pc * qb, pc * qa - pa * qc
            low, high = min(sides), max(sides)
            if low < 0 < high:
                continue
            A, B, C = points[a], points[b], points[c]
            n = _crossed(_minus(B, A), _minus(C, A))
            height = n[0] * A[0] + n[1] * A[1] + n[2] * A[2]
            if height == 0 and any(n) and _holds_origin(A, B, C, n):
                return 1
            if low == 0 or high == 0:
                clear = clear and not _may_meet(sides)
                continue
            slope = n[0] * dx + n[1] * dy + n[2] * dz
            if height * slope > 0:
                total += 1 if slope > 0 else -1
        if clear:
            return total
    return 0


def _may_meet(sides) -> bool:
    """Whether the line passes an edge or a corner: no side is clearly on the other."""
    return min(sides) >= 0 or max(sides) <= 0


def _holds_origin(A, B, C, n) -> bool:
    """Whether a triangle in a plane through the origin holds it."""
    for p, q in ((A, B), (B, C), (C, A)):
        side = _crossed(p, q)
        if side[0] * n[0] + side[1] * n[1] + side[2] * n[2] < 0:
            return False
    return True


def _crossed(a, b) -> tuple[int, int, int]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
