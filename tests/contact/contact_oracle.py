"""Contacts judged without the engine: facets of meshes as posed in rational arithmetic, and convex bodies by their
planes, found in integers, and by closed forms, in long doubles."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from itertools import product

import numpy as np
from naive_triangles import cross, inner, minus, world_points


def facet(vertices, faces, X, number) -> list[list[Fraction]]:
    """Corners of one facet in the world."""
    return world_points(np.asarray(vertices)[np.asarray(faces)[number]], X)


def gaps_along(P, Q, n) -> list[tuple[list[Fraction], Fraction]]:
    """(place, gap) of every corner over the other facet and every crossing of edges, seen along n.

    gap : what n is to be multiplied with to lead from P to Q there.   place : the point of P's side.
    """
    n = [Fraction(x) for x in n]
    found = []
    for face, points, sign in ((P, Q, 1), (Q, P, -1)):
        normal = cross(minus(face[1], face[0]), minus(face[2], face[0]))
        slope = inner(normal, n)
        if slope == 0:
            continue
        for p in points:
            away = inner(normal, minus(p, face[0])) / slope
            foot = [x - away * d for x, d in zip(p, n)]
            sides = [inner(normal, cross(minus(face[(k + 1) % 3], face[k]), minus(foot, face[k]))) for k in range(3)]
            if min(sides) >= -Fraction(1, 10**6) * inner(normal, normal):
                found.append((foot if sign == 1 else p, sign * away))
    for i in range(3):
        for j in range(3):
            e, f, w = minus(P[(i + 1) % 3], P[i]), minus(Q[(j + 1) % 3], Q[j]), minus(Q[j], P[i])
            normal = cross(e, f)
            slope = inner(normal, n)
            if slope == 0:
                continue
            gap = inner(w, normal) / slope
            # Where both lines, the second moved back by the gap, meet: s along the first.
            v = [x - gap * d for x, d in zip(w, n)]
            square = inner(normal, normal)
            s, t = inner(cross(v, f), normal) / square, inner(cross(v, e), normal) / square
            if -Fraction(1, 10**6) <= min(s, t) and max(s, t) <= 1 + Fraction(1, 10**6):
                found.append(([x + s * d for x, d in zip(P[i], e)], gap))
    return found


def gap_at(Q, p, n, tolerance) -> list[Fraction]:
    """[what n is to be multiplied with to lead from a point to the facet Q], without it where it leads past Q."""
    p, n = [Fraction(float(x)) for x in p], [Fraction(x) for x in n]
    normal = cross(minus(Q[1], Q[0]), minus(Q[2], Q[0]))
    slope = inner(normal, n)
    if slope == 0:
        return []
    gap = inner(normal, minus(Q[0], p)) / slope
    return [gap] if away_from(Q, [float(x + gap * d) for x, d in zip(p, n)]) < tolerance else []


def away_from(P, p) -> float:
    """How far a point of doubles is from the triangle P, about: the least distance from its plane, edges and
    corners."""
    T = np.array([[float(x) for x in q] for q in P])
    p = np.asarray(p, dtype=float)
    n = np.cross(T[1] - T[0], T[2] - T[0])
    best = min(np.linalg.norm(p - _clamped(T[k], T[(k + 1) % 3], p)) for k in range(3))
    square = n @ n
    if square > 0 and all(n @ np.cross(T[(k + 1) % 3] - T[k], p - T[k]) >= 0 for k in range(3)):
        best = min(best, abs(n @ (p - T[0])) / square**0.5)
    return float(best)


def _clamped(a, b, p):
    e = b - a
    square = e @ e
    return a + (min(max((p - a) @ e / square, 0.0), 1.0) if square > 0 else 0.0) * e


def check_row(row, a, b, X_WA, X_WB, radii=(0.0, 0.0), nearest=False, tolerance=1e-9) -> None:
    """That a row is what `contacts` promises of it. a, b : (vertices, faces); radii of balls swept over them.

    nearest : the row may be one of nearest points, whose gap is the distance of the two facets.
    """
    n = row["normal"]
    assert abs(np.linalg.norm(n) - 1) < 1e-12
    assert np.abs(row["point_b"] - row["point_a"] - row["distance"] * n).max() < tolerance * 1e-3
    assert row["lower"] <= row["distance"] <= row["upper"]
    P, Q = facet(*a, X_WA, row["facet_a"]), facet(*b, X_WB, row["facet_b"])
    core_a, core_b = row["point_a"] - radii[0] * n, row["point_b"] + radii[1] * n
    for side, facet_W, point, radius in (("A", P, row["point_a"], radii[0]), ("B", Q, row["point_b"], radii[1])):
        off = abs(away_from(facet_W, point) - radius)
        assert off < tolerance, (side, off)
    if max(away_from(P, core_a), away_from(Q, core_b)) >= tolerance:
        assert max(radii) > 0.0  # a core that leans: the points stand on the surface, not straight behind the core's
        return
    low, high = (Fraction(float(row[name])) + Fraction(sum(radii)) for name in ("lower", "upper"))
    there = [
        g
        for place, g in gaps_along(P, Q, n.tolist())
        if max(abs(float(x) - y) for x, y in zip(place, core_a)) < tolerance
    ]
    there += gap_at(Q, core_a, n.tolist(), tolerance)
    slack = Fraction(1, 2**48) * (1 + abs(low))  # the normal's own length
    if any(low - slack <= g <= high + slack for g in there):
        return
    assert nearest, (float(low), float(high), [float(g) for g in there])


# --- convex bodies, in 64 bits of mantissa --------------------------------------------------------------

LONG = np.longdouble
#: Rounding of a row's place and gap, of the size and the coordinates of a pair [1]: some sixty roundings of doubles.
ROUNDING = 2.0**-46
#: Of a pair with a cylinder, cone or ellipsoid that is nearer than rounding: the search for its depth stops at so much.
CURVED_ROUNDING = 2.0**-36
#: Of the size: by so much another place of theirs may come nearer along the normal; and by the size times how far its
#: points may be off, over how far they are apart.
CURVED_NORMALS = 2.0**-15


def _long(numbers: list[int]) -> np.ndarray:
    """Integers, all divided by one power of two, as long doubles of unit length."""
    spare = max(0, max(abs(x).bit_length() for x in numbers) - 63)
    v = np.array([LONG(x >> spare) for x in numbers])
    return v / np.sqrt((v * v).sum())


def _integers(points: np.ndarray) -> list[list[int]]:
    """Points times one power of two."""
    exact = [[Fraction(x) for x in p] for p in np.asarray(points, dtype=float).tolist()]
    scale = max(x.denominator for p in exact for x in p)
    return [[int(x * scale) for x in p] for p in exact]


class Core:
    """A hull of a few points: its planes by trying all triples in integers, whatever its dimension.

    normals, offsets : outward planes of it; of flat ones both sides and the rim, of segments also four beside them.
    triangles, edges : numbers of points that cover its surface, some of them more than once.
    facings, sides : (k, 3) a normal of each triangle, and (k, 3, 3) what lies in its plane across each of its sides,
    inward; of unit length, from integers: of a needle a cross product in long doubles leans by 1e-19 over its width.
    """

    def __init__(self, points: np.ndarray):
        self.points = np.asarray(points, dtype=float).astype(LONG)
        P, n = _integers(points), len(points)
        self.edges = [(i, j) for i in range(n) for j in range(i + 1, n)] or [(0, 0)]
        triples, facings, flat, found = [], [], [], []
        for i in range(n):
            for j in range(i + 1, n):
                for k in range(j + 1, n):
                    normal = cross(minus(P[j], P[i]), minus(P[k], P[i]))
                    if not any(normal):
                        continue
                    sides = [inner(normal, minus(p, P[i])) for p in P]
                    if min(sides) == 0 == max(sides):
                        flat.append(normal)
                    if max(sides) <= 0 or min(sides) >= 0:
                        triples.append((i, j, k))
                        facings.append(normal)
                        sign = -1 if max(sides) > 0 else 1
                        found.append([sign * x for x in normal])
        if flat:
            found = [flat[0], [-x for x in flat[0]], *self._rim(P, flat[0])]
        elif not found:
            found = self._ends(P)
        self.triangles = triples
        self.facings = np.array([_long(v) for v in facings])
        self.sides = np.array([
            [_long(cross(n, minus(P[t[(k + 1) % 3]], P[t[k]]))) for k in range(3)] for t, n in zip(triples, facings)
        ])
        self.normals = np.array([_long(v) for v in found])
        self.offsets = np.max(self.points @ self.normals.T, axis=0)

    @staticmethod
    def _rim(P, normal):
        found = []
        for i in range(len(P)):
            for j in range(len(P)):
                across = cross(minus(P[j], P[i]), normal)
                if any(across) and max(inner(across, minus(p, P[i])) for p in P) <= 0:
                    found.append(across)
        return found

    @staticmethod
    def _ends(P):
        e = next((minus(p, P[0]) for p in P if p != P[0]), [1, 0, 0])
        first = cross(e, [int(k == int(np.argmin([abs(x) for x in e]))) for k in range(3)])
        second = cross(e, first)
        return [[s * x for x in v] for v in (e, first, second) for s in (1, -1)]

    def support(self, n: np.ndarray):
        return (self.points @ n).max()

    def inside(self, q: np.ndarray) -> np.ndarray:
        """(k,) minus how deep points (k, 3) are inside; above 0 outside."""
        return (q @ self.normals.T - self.offsets).max(axis=1)

    def signed(self, q: np.ndarray) -> np.ndarray:
        """(k,) signed distances of points (k, 3)."""
        e0 = self.points[[i for i, _ in self.edges]]
        e = self.points[[j for _, j in self.edges]] - e0
        square = (e * e).sum(axis=1)
        w = q[:, None] - e0
        t = np.clip((w * e).sum(axis=2) / np.where(square > 0, square, 1), 0, 1)
        away = w - t[:, :, None] * e
        best = np.sqrt((away * away).sum(axis=2)).min(axis=1)
        if self.triangles:
            w = q[:, None, None] - self.points[self.triangles]
            over = ((w * self.sides).sum(axis=3) >= 0).all(axis=2)
            heights = np.where(over, np.abs((w[:, :, 0] * self.facings).sum(axis=2)), np.inf)
            best = np.minimum(best, heights.min(axis=1))
        inside = self.inside(q)
        return np.where(inside <= 0, inside, best)


@lru_cache(maxsize=4096)
def _core(data: bytes) -> Core:
    return Core(np.frombuffer(data).reshape(-1, 3))


class ConvexBody:
    """A convex shape at a pose, known by the numbers it was made of: signed distances of points, and supports.

    Of an ellipsoid a signed distance is good to a part in 2⁴⁰ of its size, by bisection of its normal equation.
    """

    def __init__(self, shape, X):
        self.kind = type(shape).__name__
        self.shape, self.X = shape, np.asarray(X).astype(LONG)
        self.radius = LONG(getattr(shape, "radius", 0.0))
        half = LONG(getattr(shape, "length", 0.0)) / 2
        self.half = half
        if self.kind == "Box":
            corners = np.array(list(product((-0.5, 0.5), repeat=3))) * shape.size
        elif self.kind == "Capsule":
            corners = np.array([[0.0, 0, float(half)], [0, 0, -float(half)]][: 2 if half else 1])
        elif self.kind == "Sphere":
            corners = np.zeros((1, 3))
        else:
            corners = getattr(shape, "points", None)
        self.core = None if corners is None else _core(np.ascontiguousarray(corners, dtype=float).tobytes())
        self.is_curved = self.kind in ("Cylinder", "Cone", "Ellipsoid")

    @property
    def size(self) -> float:
        if self.core is not None:
            return float(np.sqrt((self.core.points**2).sum(axis=1)).max() + self.radius)
        if self.kind == "Halfspace":
            return float(abs(self.shape.offset) / np.linalg.norm(self.shape.normal))
        if self.kind == "Ellipsoid":
            return float(np.max(self.shape.radii))
        return float(np.hypot(float(self.radius), float(self.half)))

    def local(self, p: np.ndarray) -> np.ndarray:
        return (np.asarray(p).astype(LONG) - self.X[:3, 3]) @ self.X[:3, :3]

    def signed(self, p) -> np.ndarray:
        """(k,) signed distances of points (k, 3) of the world [m]."""
        q = self.local(p)
        if self.core is not None:
            return self.core.signed(q) - self.radius
        if self.kind == "Halfspace":
            n = np.asarray(self.shape.normal).astype(LONG)
            return (q @ n - LONG(self.shape.offset)) / np.sqrt((n * n).sum())
        if self.kind == "Ellipsoid":
            return _of_ellipsoid(q, np.asarray(self.shape.radii).astype(LONG))
        aside = np.stack([np.hypot(q[:, 0], q[:, 1]), q[:, 2]], axis=1)
        r, h = self.radius, self.half
        if self.kind == "Cylinder":
            off = np.stack([aside[:, 0] - r, np.abs(aside[:, 1]) - h], axis=1)
            return np.minimum(off.max(axis=1), 0) + np.sqrt((np.maximum(off, 0) ** 2).sum(axis=1))
        outline = np.array([[0, h], [r, -h], [-r, -h]]).astype(LONG)
        return _of_outline(aside, outline)

    def support(self, n) -> LONG:
        """The farthest of the body along a unit vector of the world [m]; of a half-space infinite."""
        n = np.asarray(n).astype(LONG)
        g, shift = n @ self.X[:3, :3], n @ self.X[:3, 3]
        if self.core is not None:
            return self.core.support(g) + self.radius + shift
        if self.kind == "Halfspace":
            return LONG(np.inf)
        if self.kind == "Ellipsoid":
            return np.sqrt(((np.asarray(self.shape.radii).astype(LONG) * g) ** 2).sum()) + shift
        aside = np.hypot(g[0], g[1])
        if self.kind == "Cylinder":
            return self.radius * aside + self.half * abs(g[2]) + shift
        return max(self.half * g[2], self.radius * aside - self.half * g[2]) + shift

    def exits(self, p, n, grown) -> np.ndarray:
        """(k,) where lines from points (k, 3) along n leave the core, all its planes moved out by ``grown``; −∞ of
        lines that miss it."""
        q, g = self.local(p), np.asarray(n).astype(LONG) @ self.X[:3, :3]
        core = self.core
        slope, room = core.normals @ g, core.offsets + grown - q @ core.normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            at = room / slope
        end = np.where(slope > 0, at, np.inf).min(axis=1)
        begin = np.where(slope < 0, at, -np.inf).max(axis=1)
        missed = (begin > end) | ((slope == 0) & (room < 0)).any(axis=1)
        return np.where(missed, -np.inf, end)


def _of_outline(q, corners):
    """Signed distances of points (k, 2) from a triangle."""
    best, inside = np.full(len(q), np.inf).astype(LONG), np.full(len(q), -np.inf).astype(LONG)
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        e, w = b - a, q - a
        t = np.clip(w @ e / (e @ e), 0, 1)
        best = np.minimum(best, np.sqrt(((w - t[:, None] * e) ** 2).sum(axis=1)))
        middle = corners.mean(axis=0) - a
        outward = np.array([-e[1], e[0]]) * (1 if e[0] * middle[1] < e[1] * middle[0] else -1)
        inside = np.maximum(inside, w @ outward / np.sqrt(e @ e))
    return np.where(inside <= 0, -best, best)


def _of_ellipsoid(q, radii):
    """Signed distances: t of r²x / (r² + t) on the surface, by bisection; inside, a lower bound of the depth."""
    q, squares = np.abs(q), radii * radii
    level = np.sqrt(((q / radii) ** 2).sum(axis=1))
    low, high = np.full(len(q), -squares.min()), np.sqrt((q * q).sum(axis=1)) * radii.max() + 1e-300
    for _ in range(140):
        t = (low + high) / 2
        value = ((radii * q / (squares + t[:, None])) ** 2).sum(axis=1)
        low, high = np.where(value > 1, t, low), np.where(value > 1, high, t)
    foot = squares * q / (squares + high[:, None])
    away = np.sqrt(((foot - q) ** 2).sum(axis=1))
    return np.where(level >= 1, away, -away)


def failures_of_convex(A, B, X_WA, X_WB, margin, rows, r) -> list[str]:
    """What `contacts` broke of its promises about two convex shapes, a line each.

    rows : its answer.   r : that of `distance`, the certified bracket of which is taken as it is.
    """
    a, b = ConvexBody(A, X_WA), ConvexBody(B, X_WB)
    coordinates = a.size + b.size + float(np.abs(X_WA[:3, 3]).max() + np.abs(X_WB[:3, 3]).max())
    if len(rows):
        coordinates += float(np.abs(rows["point_a"]).max())
    eta = ROUNDING * coordinates
    lower, upper = float(r.lower), float(r.upper)
    if not len(rows):
        return [] if lower > margin else [f"no rows, though distance may be {lower!r}"]
    n = rows["normal"][0].astype(LONG)
    failures = [f"rows beyond the margin: {lower!r}"] if lower > margin else []
    d, low, high = (rows[name].astype(LONG) for name in ("distance", "lower", "upper"))
    wide = (high - low).astype(float)

    def blame(bad, what):
        failures.extend(f"row {k}: {what(k)}" for k in np.flatnonzero(bad)[:1])

    blame(np.abs(np.sqrt((rows["normal"] ** 2).sum(axis=1)) - 1) > 1e-12, lambda k: "the normal is no unit vector")
    blame((rows["normal"] != rows["normal"][0]).any(axis=1), lambda k: "another normal")
    blame(~((low <= d) & (d <= high)), lambda k: f"distance {d[k]} is not in [{low[k]}, {high[k]}]")
    blame(low > margin, lambda k: f"lies beyond the margin by {float(low[k] - margin):.3g}")
    blame(d < d[0], lambda k: f"is deeper than the first by {float(d[0] - d[k]):.3g}")
    off = np.abs(rows["point_b"] - rows["point_a"] - rows["distance"][:, None] * rows["normal"]).max(axis=1)
    blame(off > eta, lambda k: f"point_b - point_a is off distance * normal by {off[k]:.3g}")
    curved = a.is_curved or b.is_curved
    rounding = eta + (CURVED_ROUNDING * coordinates if curved else 0.0)
    lean = eta
    if curved:
        lean += coordinates * max(CURVED_NORMALS, CURVED_ROUNDING * coordinates / max(abs(r.distance), 1e-300))
    if low[0] > upper or high[0] < lower or not low[0] <= r.distance <= high[0]:
        failures.append(f"row 0: [{low[0]}, {high[0]}] does not hold the distance {r.distance!r}")
    support = -(a.support(n) + b.support(-n)) if "Halfspace" not in (a.kind, b.kind) else d[0]
    if not low[0] - lean <= support + wide[0] or not support - wide[0] <= high[0] + rounding:
        failures.append(f"row 0: [{low[0]}, {high[0]}], along the normal {support}")
    if wide.max() > (lean if curved else 2.0**-24 * coordinates):
        failures.append(f"a bracket is {wide.max():.3g} wide")
    allowed = wide + rounding + 3.0 * eta  # places count as over a face up to 2⁻⁴⁵ beyond its sides, which meet at tips
    for name, body, sign in (("point_a", a, 1), ("point_b", b, -1)):
        away = body.signed(rows[name])
        blame(np.abs(away) > allowed, lambda k, s=f"{name} is off its body by", away=away: f"{s} {float(away[k]):.3g}")
        steps = np.array([4.0, 64.0, 1e3, 1e5, 1e7]) * allowed.max()
        for s in [*steps[steps < body.size], body.size]:
            ahead = body.signed(rows[name].astype(LONG) + sign * s * n)
            told = f"{name} is behind its body by"
            blame(ahead < -allowed, lambda k, told=told, ahead=ahead: f"{told} {float(ahead[k]):.3g}")
    if a.core is not None and b.core is not None and not a.radius and not b.radius:
        failures += _failures_of_gaps(a, b, n, rows, eta)
    return failures


def _failures_of_gaps(a, b, n, rows, eta) -> list[str]:
    """Rows whose bracket is not how far two polytopes are apart along the normal, at places within rounding of it."""
    p = rows["point_a"].astype(LONG)
    off = 4.0 * eta  # a place is good to 2⁻⁴⁴
    least = -b.exits(p, -n, off) - a.exits(p, n, off)
    most = -b.exits(p, -n, -eta) - a.exits(p, n, -eta)
    bad = (rows["upper"] < least - 4 * eta) | (rows["lower"] > most + 4 * eta)
    return [
        f"row {k}: [{rows['lower'][k]!r}, {rows['upper'][k]!r}], gap there {float(least[k])!r} … {float(most[k])!r}"
        for k in np.flatnonzero(bad)[:1]
    ]
