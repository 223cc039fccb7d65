"""Plain references and seeded inputs that the engine's tests share; nothing here is fast.

A case is four things, in the order of `collide.distance`: shape A, shape B, their poses X_WA and
X_WB. References work on the doubles as they are: what `exact` says of corners and radii is the truth.
"""

from __future__ import annotations

import math
from contextlib import contextmanager
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

import collide
from collide.adapters.peers import exact
from collide.results import FIELDS
from collide.scenes.families.ingredients import EXACT_ROTATIONS

ULP = 2.0**-52
SHARED = Path(__file__).resolve().parents[3] / "shared"
#: They move lattices onto lattices without rounding.
LATTICE_ROTATIONS = EXACT_ROTATIONS



class Case(NamedTuple):
    """Arguments of a pair query."""

    A: collide.Shape
    B: collide.Shape
    X_WA: np.ndarray
    X_WB: np.ndarray

    def swapped(self) -> Case:
        return Case(self.B, self.A, self.X_WB, self.X_WA)

    def with_b_moved(self, shift) -> Case:
        X_WB = self.X_WB.copy()
        X_WB[:3, 3] += shift
        return self._replace(X_WB=X_WB)


# --- seeded inputs ------------------------------------------------------------------------------


def rng_of(*words) -> np.random.Generator:
    """A generator that depends on the words alone."""
    return np.random.default_rng([ord(letter) for letter in " ".join(map(str, words))])


def rotation(rng) -> np.ndarray:
    """Uniform, orthonormal to rounding."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def pose(R=None, t=(0.0, 0.0, 0.0)) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = np.eye(3) if R is None else R
    X[:3, 3] = t
    return X


def random_pose(rng, spread: float = 1.0) -> np.ndarray:
    return pose(rotation(rng), rng.uniform(-spread, spread, 3))


def hull_points(rng, n: int | None = None) -> np.ndarray:
    """4 to 64 points, on an ellipsoid or scattered."""
    n = int(rng.integers(4, 65)) if n is None else n
    points = rng.normal(size=(n, 3))
    if rng.random() < 0.6:
        points /= np.linalg.norm(points, axis=1)[:, None]
    return points * rng.uniform(0.5, 1.5, 3)


def one_of_each(rng) -> dict[str, collide.Shape]:
    """A shape of every kind, about half a metre large."""
    a, b, c = (float(x) for x in rng.uniform(0.2, 0.5, 3))
    n = rng.normal(size=3)
    box = np.array([*np.eye(3), *-np.eye(3), n / np.linalg.norm(n)])
    return {
        "Sphere": collide.Sphere(a),
        "Box": collide.Box((2 * a, 2 * b, 2 * c)),
        "Capsule": collide.Capsule(a, 2 * b),
        "Cylinder": collide.Cylinder(a, 2 * b),
        "Cone": collide.Cone(a, 2 * b),
        "Ellipsoid": collide.Ellipsoid((a, b, c)),
        "Halfspace": collide.Halfspace(n / np.linalg.norm(n), float(rng.uniform(-0.3, 0.3))),
        "ConvexHull": collide.ConvexHull(0.4 * hull_points(rng, 12), radius=0.1 * a),
        "HPolytope": collide.HPolytope(box, [a, b, c, a, b, c, 0.9 * min(a, b, c)]),
        "Compound": collide.Compound(
            [
                (collide.Box((2 * a, 0.2, 0.2)), np.eye(4)),
                (collide.Sphere(b), pose(rotation(rng), (a, 0.1, 0.0))),
                (collide.Cylinder(0.2, c), random_pose(rng, 0.3)),
            ]
        ),
    }


KINDS = tuple(one_of_each(rng_of("kinds")))


# --- the truth ----------------------------------------------------------------------------------


def corners(shape: collide.Shape) -> tuple[np.ndarray, float]:
    """(corner points (n, 3), radius swept over their hull) of a shape that exact arithmetic can judge."""
    if isinstance(shape, collide.Sphere):
        return np.zeros((1, 3)), shape.radius
    if isinstance(shape, collide.Capsule):
        half = 0.5 * shape.length
        return np.array([(0.0, 0.0, -half), (0.0, 0.0, half)]), shape.radius
    if isinstance(shape, collide.Box):
        return np.array(list(product((-0.5, 0.5), repeat=3))) * shape.size, 0.0
    if isinstance(shape, collide.ConvexHull):
        return shape.points, shape.radius
    raise TypeError(f"{type(shape).__name__} has no corners")


def exact_arguments(case: Case) -> tuple[tuple, dict]:
    (P, radius_a), (Q, radius_b) = corners(case.A), corners(case.B)
    R1, t1, R2, t2 = case.X_WA[:3, :3], case.X_WA[:3, 3], case.X_WB[:3, :3], case.X_WB[:3, 3]
    return (P, R1, t1, Q, R2, t2), {"radius_a": radius_a, "radius_b": radius_b}


def exact_hit(case: Case) -> bool:
    arguments, radii = exact_arguments(case)
    return exact.hit(*arguments, **radii)


def exact_distance(case: Case) -> Fraction:
    """Signed distance to 40 digits."""
    arguments, radii = exact_arguments(case)
    return Fraction(exact.signed_distance(*arguments, digits=40, **radii))


def distance_to_body(point, shape: collide.Shape, X_WB) -> float:
    """How far a world point is from a body with corners; negative inside."""
    return float(exact_distance(Case(collide.ConvexHull([point]), shape, np.eye(4), np.asarray(X_WB))))


def extent_along(shape: collide.Shape, X: np.ndarray, n: np.ndarray) -> float:
    """min n·x over a posed body, from the shape's own formula."""
    g = X[:3, :3].T @ n
    at = float(n @ X[:3, 3])
    if isinstance(shape, collide.Compound):
        return min(extent_along(part, X @ X_CS, n) for part, X_CS in shape.items)
    if isinstance(shape, collide.Ellipsoid):
        return at - float(np.linalg.norm(shape.radii * g))
    if isinstance(shape, collide.Cylinder):
        return at - shape.radius * math.hypot(g[0], g[1]) - shape.length / 2 * abs(g[2])
    if isinstance(shape, collide.Cone):
        half = shape.length / 2
        return at + min(half * g[2], -half * g[2] - shape.radius * math.hypot(g[0], g[1]))
    if isinstance(shape, collide.HPolytope):
        return at + float((shape.vertices @ g).min())
    points, radius = corners(shape)
    return at + float((points @ g).min()) - radius


def clearance_along(case: Case, n: np.ndarray) -> float:
    """Gap of the two bodies' extents along unit n, negative where they overlap.

    The signed distance of convex bodies is the largest of these, so each is a lower bound.
    """
    return extent_along(case.B, case.X_WB, n) + extent_along(case.A, case.X_WA, -n)


def size(case: Case) -> float:
    """S of collide/narrowphase/bounds.py for two bodies with corners, a few ulps smaller at most."""
    total = float(np.linalg.norm(case.X_WB[:3, 3] - case.X_WA[:3, 3]))
    for shape, X in ((case.A, case.X_WA), (case.B, case.X_WB)):
        points, radius = corners(shape)
        reach = np.linalg.norm(points, axis=1).max() * np.linalg.norm(X[:3, :3], axis=1).max()
        total += float(reach) + radius
    return total


def with_gap(case: Case, gap: float) -> Case:
    """B moved along the exact normal, so that the signed distance is about ``gap``.

    Twice: where bodies overlap deeply, leaving by one normal may bring another feature nearest.
    """
    for _ in range(2):
        arguments, radii = exact_arguments(case)
        answer = exact.distance(*arguments)
        axis = exact.depth(*arguments).normal if answer.hit else answer.certificate.axis
        n = np.array([float(Fraction(x, max(map(abs, axis)))) for x in axis])
        now = float(exact.signed_distance(*arguments, **radii))
        case = case.with_b_moved((gap - now) * n / np.linalg.norm(n))
    return case


def brute_force(world: collide.World, limit: float) -> list:
    """Every pair of a World that its filters leave, one by one: [(a, b, row)], at most ``limit`` apart."""
    rows = []
    ids = world.ids
    for k, i in enumerate(ids):
        for j in ids[k + 1 :]:
            a, b = world.body(i), world.body(j)
            if (i, j) in world.allowed or (a.static and b.static) or not (a.group & b.mask and b.group & a.mask):
                continue
            try:
                row = collide.distance(a.shape, b.shape, a.X_WB, b.X_WB, max_distance=limit).rows[0]
            except collide.UnsupportedQuery:
                rows.append((i, j, None))
                continue
            if row["hit"] or row["distance"] <= limit:
                rows.append((i, j, row))
    return rows


# --- comparing and reporting ----------------------------------------------------------------------

#: Fields of a row that say something about the pair, not about its bodies' numbers in a World.
ANSWER_FIELDS = tuple(field for field in FIELDS if field not in ("a", "b"))


def same_bits(one, other, fields=ANSWER_FIELDS) -> list[str]:
    """Fields in which two rows, or two arrays of rows, differ in any bit."""
    return [f for f in fields if np.asarray(one[f]).tobytes() != np.asarray(other[f]).tobytes()]


def spell(value) -> str:
    """Python source of a shape or an array, every double to its last digit."""
    if isinstance(value, collide.Compound):
        return "collide.Compound([" + ", ".join(f"({spell(s)}, {spell(X)})" for s, X in value.items) + "])"
    if isinstance(value, collide.ConvexHull):
        return f"collide.ConvexHull({spell(value.points)}, radius={value.radius!r})"
    if isinstance(value, collide.Shape):
        inside = ", ".join(f"{name}={spell(getattr(value, name))}" for name in value._fields)
        return f"collide.{type(value).__name__}({inside})"
    return repr(value.tolist() if isinstance(value, np.ndarray) else value)


def snippet(case: Case) -> str:
    return (
        f"import collide\nA = {spell(case.A)}\nB = {spell(case.B)}\n"
        f"X_WA = {spell(case.X_WA)}\nX_WB = {spell(case.X_WB)}\n"
        "r = collide.distance(A, B, X_WA, X_WB); print(r, r.lower, r.upper)"
    )


@contextmanager
def reproducible(case: Case):
    """Whatever fails inside is reported with source that asks the same question again."""
    __tracebackhide__ = True
    try:
        yield
    except Exception as error:
        raise AssertionError(f"{type(error).__name__}: {error}\n\n{snippet(case)}\n") from error


def share(flags) -> float:
    """Which part of the flags is true."""
    flags = list(flags)
    return sum(map(bool, flags)) / len(flags)


def turn(axis, angle: float) -> np.ndarray:
    """(3, 3) of a turn by an angle [rad] about an axis of any length."""
    return collide.pose(quat_wxyz=(math.cos(angle / 2), *(math.sin(angle / 2) * unit(axis))))[:3, :3]


def unit(v) -> np.ndarray:
    return np.asarray(v, dtype=float) / math.sqrt(float(np.dot(v, v)))
