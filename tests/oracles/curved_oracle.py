"""Oracle for any two shapes: a proven bracket of their signed distance, in decimal arithmetic of 80 digits.

It shares no code with the engine, and asks shapes for nothing but the numbers they were made of. A body is a union of
convex *cells*: a core (points, a cylinder, cone or ellipsoid), its linear image under the pose as it stands, and a ball
added afterwards; a mesh is its triangles, and, if it is a solid, what they wind around.

What is proven of two cells, K being the differences a − b of their cores and r the sum of their radii:

* any direction n:                signed distance ≥ −(σ_A(n) + σ_B(−n)) / |n| − r          (`separation`)
* any point v of K:               signed distance ≤ |v| − r                                 (`weighted`)
* a closed surface of triangles with corners in K, seen from 0 from inside everywhere and nowhere nearer than d:
                                  signed distance ≤ −d − r                                  (`shell_depth`)

Directions, points and surfaces are found by GJK and EPA of its own (`curved_search.py`), which may be as wrong as they
like: the bracket is what these three say. Rounding is below 1e-76 of the pair in every step, and `_SLACK` is taken off.
A signed distance is the gap, or minus the smallest translation that parts the bodies; of bodies that are no convex set,
minus it too, and its bracket is as wide as what is known of it.
"""

from __future__ import annotations

import itertools
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from curved_cells import CONTEXT, Cell, Pose, Vector, cross, dot, exact, make_pose, minus, norm, times, vector
from curved_search import AXES, search_cells

#: Of the size of a pair: far more than all rounding of one bound.
_SLACK = Decimal("1e-66")
_ZERO, _INF = Decimal(0), Decimal("inf")
#: Pairs of cells that are looked at one by one.
MAX_PAIRS = 600

# --- bodies -------------------------------------------------------------------------------------


class Body:
    """A shape at a pose, as cells; coordinates are measured from ``origin``.

    shells : one point of each connected part of the surface, as other bodies may hold it.
    solids : [(m, 3) facets as triples of points] of closed meshes.   plane : (n, c) of a half-space {x : n·x ≤ c}.
    """

    def __init__(self, shape, X, origin: Vector = (_ZERO, _ZERO, _ZERO)):
        pose = make_pose(X)
        self.cells: list[Cell] = []
        self.shells: list[Vector] = []
        self.solids: list[list[tuple[Vector, Vector, Vector]]] = []
        self.plane: tuple[Vector, Decimal] | None = None
        self._add(shape, Pose(pose.rows, minus(pose.shift, origin)))
        if self.cells:
            self.low, self.high = (np.array([getattr(c, name) for c in self.cells]) for name in ("low", "high"))
        triangles = all(len(c.points) == 3 and not c.radius for c in self.cells) and self.cells
        self._corners = np.array([c.rough for c in self.cells]) if triangles else None

    def _add(self, shape, pose: Pose) -> None:
        kind = type(shape).__name__
        if kind == "Compound":
            for item, X_CS in shape.items:
                self._add(item, pose.after(make_pose(X_CS)))
        elif kind == "Mesh":
            self._add_mesh(shape, pose)
        elif kind == "Halfspace":
            self.plane = _plane(shape, pose)
        else:
            cell = _convex_cell(shape, kind, pose)
            self.cells.append(cell)
            self.shells.append(cell.support((Decimal(1), _ZERO, _ZERO))[1])

    def _add_mesh(self, shape, pose: Pose) -> None:
        points = [pose.image(vector(p)) for p in shape.vertices.tolist()]
        faces = shape.faces.tolist()
        facets = [Cell("points", points=[points[k] for k in face]) for face in faces]
        self.cells += facets
        root = list(range(len(points)))
        same: dict[Vector, int] = {}

        def find(k: int) -> int:
            while root[k] != k:
                k = root[k]
            return k

        for k, p in enumerate(points):
            root[find(k)] = find(same.setdefault(p, k))
        for i, j, k in faces:
            root[find(i)] = root[find(j)] = find(k)
        used = {k for face in faces for k in face}
        self.shells += [points[k] for k in {find(k) for k in used}]
        if shape.solid:
            self.solids.append([tuple(cell.points) for cell in facets])  # type: ignore[misc]

    def coarse(self, n: np.ndarray) -> np.ndarray:
        """(cells,) supports along n, |n| = 1, in doubles and no less than the true ones."""
        if self._corners is not None:
            size = float(np.abs(self._corners).max())
            return (self._corners @ n).max(axis=1) + 1e-14 * (size + 1e-300)
        return np.array([cell.coarse(n) for cell in self.cells])

    @property
    def scale(self) -> Decimal:
        return max((c.scale for c in self.cells), default=_ZERO)

    @property
    def convex(self) -> bool:
        return len(self.cells) == 1 and not self.solids

    def holds(self, p: Vector) -> bool:
        """Whether one of the solids winds around a point that lies on none of its facets."""
        return any(winding(facets, p) >= 1 for facets in self.solids)


def _convex_cell(shape, kind: str, pose: Pose) -> Cell:
    if kind in ("Cylinder", "Cone"):
        return Cell(kind.lower(), pose, (exact(shape.radius), exact(shape.length) / 2))
    if kind == "Ellipsoid":
        return Cell("ellipsoid", pose, vector(shape.radii))
    radius = exact(getattr(shape, "radius", 0.0))
    return Cell("points", points=[pose.image(p) for p in core_points(shape, kind)], radius=radius)


def core_points(shape, kind: str) -> list[Vector]:
    """The points whose hull is the core of a polytope, swept or not; of an HPolytope corners to 80 digits."""
    if kind == "Sphere":
        return [(_ZERO, _ZERO, _ZERO)]
    if kind == "Box":
        halves = [exact(x) / 2 for x in shape.size]
        return [tuple(s * x for s, x in zip(signs, halves)) for signs in itertools.product((-1, 1), repeat=3)]
    if kind == "Capsule":
        half = exact(shape.length) / 2
        return [(_ZERO, _ZERO, -half), (_ZERO, _ZERO, half)]
    if kind == "ConvexHull":
        return [vector(p) for p in shape.points.tolist()]
    if kind == "HPolytope":
        return _corners_of(tuple(map(tuple, shape.normals.tolist())), tuple(shape.offsets.tolist()))
    raise TypeError(f"no oracle for {kind}")


@lru_cache(maxsize=256)
def _corners_of(normals, offsets) -> list[Vector]:
    """Points where three planes of {x : normals·x ≤ offsets} meet and no half-space is left, in fractions."""
    rows = [[Fraction(x) for x in (*n, c)] for n, c in zip(normals, offsets)]
    found = set()
    for i, j, k in itertools.combinations(range(len(rows)), 3):
        a, b, c = rows[i], rows[j], rows[k]
        bc, ca, ab = _cross(b, c), _cross(c, a), _cross(a, b)
        det = sum(a[m] * bc[m] for m in range(3))
        if det:
            p = tuple((a[3] * bc[m] + b[3] * ca[m] + c[3] * ab[m]) / det for m in range(3))
            if all(sum(r[m] * p[m] for m in range(3)) <= r[3] for r in rows):
                found.add(p)
    return [vector(p) for p in sorted(found)]


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _plane(shape, pose: Pose) -> tuple[Vector, Decimal]:
    """(n, c) of the image {x : n·x ≤ c}: cofactors of the matrix instead of its inverse."""
    r = pose.rows
    cofactors = cross(r[1], r[2]), cross(r[2], r[0]), cross(r[0], r[1])
    normal = vector(shape.normal)
    n: Vector = tuple(dot(row, normal) for row in cofactors)  # type: ignore[assignment]
    return n, exact(shape.offset) * dot(r[0], cofactors[0]) + dot(n, pose.shift)


def winding(facets: list[tuple[Vector, Vector, Vector]], p: Vector) -> int:
    """How often closed facets, counter-clockwise from outside, wind around a point off them: crossings of a ray."""
    for ray in _RAYS:
        total, clear = 0, True
        for facet in facets:
            a, b, c = (minus(q, p) for q in facet)
            sides = [dot(ray, cross(u, v)) for u, v in ((a, b), (b, c), (c, a))]
            blur = Decimal("1e-60") * sum(abs(x) for q in (a, b, c) for x in q) ** 2
            if (min(sides) > blur) or (max(sides) < -blur):
                height = dot(a, cross(b, c))
                total += (1 if sides[0] > 0 else -1) * ((height > 0) == (sides[0] > 0))
            elif min(sides) < -blur and max(sides) > blur:
                continue
            else:
                clear = False  # an edge, or a facet without area, is met or nearly: another ray
                break
        if clear:
            return total
    raise ArithmeticError("every ray grazes an edge")


_RAYS = [vector(ray) for ray in np.random.default_rng(7).normal(size=(40, 3)).tolist()]


# --- two bodies ---------------------------------------------------------------------------------


class Bracket(NamedTuple):
    """lower ≤ signed distance ≤ upper [m].   n : a direction from A to B that proves lower, where one does.

    hit : True or False where proven, None where the bracket spans 0.   apart_by : of surfaces that do not meet while a
    body is inside another.
    """

    lower: Decimal
    upper: Decimal
    n: Vector | None = None

    @property
    def hit(self) -> bool | None:
        return True if self.upper <= 0 else False if self.lower > 0 else None


def bracket(A, B, X_WA, X_WB, *, depths: bool = True, enough: Decimal = _ZERO, guesses=()) -> Bracket:
    """The signed distance of two shapes, proven.

    X_WA, X_WB : (4, 4).   depths : False leaves how deep convex bodies overlap at what proves that they do.
    enough : stop where the distance is known to be below this.   guesses : directions from A to B to try.
    """
    with localcontext(CONTEXT):
        origin = make_pose(X_WA).shift
        a, b = Body(A, X_WA, origin), Body(B, X_WB, origin)
        return bracket_bodies(a, b, depths=depths, enough=enough, guesses=guesses)


def away_from(shape, X, point) -> float:
    """How far a point (3,) is from a closed body at most, about: 0 inside; for judging witness points."""
    with localcontext(CONTEXT):
        origin = make_pose(X).shift
        body = Body(shape, X, origin)
        p = minus(vector(point), origin)
        if body.plane is not None:
            n, c = body.plane
            return max(0.0, float((dot(n, p) - c) / norm(n)))
        only = Body.__new__(Body)
        cell = Cell("points", points=[p])
        only.cells, only.shells, only.solids, only.plane = [cell], [p], [], None
        only.low, only.high, only._corners = cell.low[None], cell.high[None], None
        found = bracket_bodies(only, body, depths=False, enough=Decimal("1e-16") * (body.scale + cell.scale))
        return max(0.0, float(found.upper))


def bracket_bodies(a: Body, b: Body, *, depths: bool = True, enough: Decimal = _ZERO, guesses=()) -> Bracket:
    if a.plane is not None or b.plane is not None:
        return _with_plane(a, b)
    slack = _SLACK * (a.scale + b.scale)
    if a.convex and b.convex:
        low, high, n = search_cells(a.cells[0], b.cells[0], depths=depths, enough=enough, guesses=guesses)
    else:
        low, high, n = search_union(a, b, enough=enough, guesses=guesses)
    return Bracket(low - slack, high + slack, n)


def _with_plane(a: Body, b: Body) -> Bracket:
    """A half-space and a body: one formula, whether they meet or not, and whether the body is convex or not."""
    if a.plane is None:
        found = _with_plane(b, a)
        return Bracket(found.lower, found.upper, times(Decimal(-1), found.n) if found.n else None)
    n, c = a.plane
    if b.plane is not None:
        m, d = b.plane
        if any(cross(n, m)) or dot(n, m) > 0:
            return Bracket(-_INF, -_INF)
        value = -(c / norm(n) + d / norm(m))
        return Bracket(value - _SLACK * abs(c), value + _SLACK * abs(c), n)
    down = times(Decimal(-1), n)
    value = min(-(cell.support(down)[0]) / norm(n) - cell.radius for cell in b.cells) - c / norm(n)
    slack = _SLACK * (abs(c / norm(n)) + b.scale)
    return Bracket(value - slack, value + slack, n)


# --- unions -------------------------------------------------------------------------------------


def search_union(a: Body, b: Body, *, enough=_ZERO, guesses=()):
    """(low, high, n) of two bodies of several cells: every pair that no box and no plane found so far puts farther
    apart."""
    bounds = _box_gaps(a, b)
    for guess in guesses:
        _cull(bounds, a, b, np.asarray(guess, dtype=float))
    todo = np.ones(bounds.shape, dtype=bool)
    low, high, best_n = _INF, _INF, None
    for _ in range(MAX_PAIRS):
        at = int(np.argmin(np.where(todo, bounds, np.inf)))
        i, j = np.unravel_index(at, bounds.shape)
        if not todo[i, j] or Decimal(float(bounds[i, j])) >= high:
            break
        todo[i, j] = False
        one_low, one_high, n = search_cells(a.cells[i], b.cells[j], depths=False, enough=enough, beyond=high)
        low = min(low, one_low)
        if one_high < high:
            high, best_n = one_high, n
        if high <= 0 or high <= enough:
            break
        if one_low > 0:
            _cull(bounds, a, b, np.array([float(x / norm(n)) for x in n]))
    if low > 0 and high > enough and (any(b.holds(p) for p in a.shells) or any(a.holds(p) for p in b.shells)):
        high = -low  # a body, or a part of it, is inside, and no shorter way leads through the surface around it
    if high <= 0 or low <= 0:
        low, best_n = max(((_hull_gap(a, b, n), n) for n in _ways(best_n, guesses)), key=lambda pair: pair[0])
        return min(low, high), high, best_n
    left = bounds[todo]
    return min(low, Decimal(float(left.min())) if left.size else _INF), high, best_n


def _ways(n, guesses) -> list[Vector]:
    found = [*AXES, *([n] if n is not None and any(n) else []), *(vector(g) for g in guesses if np.any(g))]
    return found


def _hull_gap(a: Body, b: Body, n: Vector) -> Decimal:
    """What parts the hulls parts the bodies: a lower bound of the signed distance."""
    down, length = times(Decimal(-1), n), norm(n)
    high = max(c.support(n)[0] / length + c.radius for c in a.cells)
    return -high - max(c.support(down)[0] / length + c.radius for c in b.cells)


def _box_gaps(a: Body, b: Body) -> np.ndarray:
    """(cells of A, cells of B) lower bounds of gaps, 0 where boxes meet."""
    steps = np.maximum(a.low[:, None] - b.high[None], b.low[None] - a.high[:, None])
    return np.sqrt((np.maximum(steps, 0.0) ** 2).sum(axis=2)) * (1 - 1e-12)


def _cull(bounds: np.ndarray, a: Body, b: Body, n: np.ndarray) -> None:
    length = float(np.linalg.norm(n))
    if not 0.0 < length < np.inf:
        return
    n = n / length
    gaps = -(a.coarse(n)[:, None] + b.coarse(-n)[None])
    np.maximum(bounds, gaps - 1e-15 * np.abs(gaps), out=bounds)
