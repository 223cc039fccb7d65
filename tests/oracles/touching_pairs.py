"""Pairs with a cylinder, cone or ellipsoid that touch exactly, and pairs that touch but for rounding: seeded families.

Exactly: a point of the surface of each, with coordinates that are doubles, and a direction normal to both surfaces
there; turned onto each other by matrices of 0, 1 and −1, which round nothing.
"""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import NamedTuple

import numpy as np

import collide

KINDS = ("cylinder", "cone", "ellipsoid")
OTHERS = ("box", "sphere", "capsule", "hull", "rounded", "segment", "triangle")
#: Matrices of 0, 1, −1 that are rotations.
TURNS = [
    M
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1, -1), repeat=3)
    if np.linalg.det(M := np.diag(signs)[list(order)].astype(float)) > 0
]


class Pair(NamedTuple):
    A: object
    B: object
    X_WA: np.ndarray
    X_WB: np.ndarray
    family: str

    def __repr__(self) -> str:
        poses = f"X_WA = {self.X_WA.tolist()}\nX_WB = {self.X_WB.tolist()}"
        return f"A = {self.A!r}\nB = {self.B!r}\n{poses}  # {self.family}"


class Feature(NamedTuple):
    """A point of a surface, in the frame; directions, five long, normal to the surface there; its name."""

    point: tuple
    normals: list[tuple[int, int, int]]
    name: str


def body(kind: str, rng) -> tuple[object, list[Feature]]:
    """A shape of a kind with sizes of few bits, and features of it."""
    radius = Fraction(5 * int(rng.integers(1, 9)), 64)  # a multiple of 5/64: a point at (3/5, 4/5) of it is a double
    half = Fraction(int(rng.integers(1, 17)), 32)
    x, y = ((5, 0), (3, 4), (-4, 3), (0, 5))[rng.integers(4)]
    halves = [Fraction(int(k), 16) for k in rng.integers(1, 17, 3)]
    return _MAKERS[kind](radius, half, (x, y), (Fraction(x, 5), Fraction(y, 5)), halves, rng)


def _cylinder(radius, half, across, angle, halves, rng):
    c, s = radius * angle[0], radius * angle[1]
    z = half * Fraction(int(rng.integers(-3, 4)), 4)
    return collide.Cylinder(float(radius), float(2 * half)), [
        Feature((c, s, z), [(*across, 0)], "side"),
        Feature((c, s, half), [(*across, 0), (0, 0, 5), *_leaning(across)], "rim"),
        Feature((c / 2, s / 2, half), [(0, 0, 5)], "end"),
    ]


def _leaning(across):
    """Normals (3, 4)/5 between an end and a side, where the side's is an axis."""
    return [(3 * across[0] // 5, 3 * across[1] // 5, 4)] if 0 in across else []


def _cone(radius, half, across, angle, halves, rng):
    # As high as 4/3 of its radius: the side's normal is (4, 3)/5 across and along.
    radius, half = 3 * radius, 2 * radius
    c, s = radius * angle[0], radius * angle[1]
    flank = [(4 * across[0] // 5, 4 * across[1] // 5, 3)] if 0 in across else []
    t = Fraction(int(rng.integers(1, 4)), 4)
    features = [
        Feature((0, 0, half), [(0, 0, 5), (3, 0, 4), (0, 3, 4), (0, -4, 3), (4, 0, 3)], "tip"),
        Feature((c, s, -half), [(*across, 0), (0, 0, -5), *flank], "rim"),
        Feature((c / 2, s / 2, -half), [(0, 0, -5)], "end"),
        Feature((c * (1 - t), s * (1 - t), 2 * half * t - half), flank, "side"),
    ]
    return collide.Cone(float(radius), float(2 * half)), features


def _ellipsoid(radius, half, across, angle, halves, rng):
    radii = (radius, radius, radius) if rng.random() < 0.3 else (radius, radius * 2, half)
    features = [Feature((radius, 0, 0), [(5, 0, 0)], "pole"), Feature((0, 0, -radii[2]), [(0, 0, -5)], "pole")]
    if radii[0] == radii[1] == radii[2]:
        features.append(Feature((radius * angle[0], radius * angle[1], 0), [(*across, 0)], "side"))
    return collide.Ellipsoid([float(a) for a in radii]), features


def _sphere(radius, half, across, angle, halves, rng):
    return collide.Sphere(float(radius)), [Feature((radius * angle[0], radius * angle[1], 0), [(*across, 0)], "side")]


def _capsule(radius, half, across, angle, halves, rng):
    c, s = radius * angle[0], radius * angle[1]
    return collide.Capsule(float(radius), float(2 * half)), [
        Feature((c, s, half / 2), [(*across, 0)], "side"),
        Feature((0, c, half + s), [(0, *across)] if across[1] > 0 else [], "end"),
    ]


def _box(radius, half, across, angle, halves, rng):
    inside = [k * Fraction(int(m), 8) for k, m in zip(halves, rng.integers(-7, 8, 3))]
    return collide.Box([float(2 * k) for k in halves]), [
        Feature((halves[0], inside[1], inside[2]), [(5, 0, 0)], "face"),
        Feature((halves[0], halves[1], inside[2]), [(5, 0, 0), (3, 4, 0), (4, 3, 0)], "edge"),
        Feature(tuple(halves), [(5, 0, 0), (3, 4, 0), (0, 3, 4)], "corner"),
    ]


def _hull(radius, half, across, angle, halves, rng):
    return collide.ConvexHull(shape_corners(halves)), _box(radius, half, across, angle, halves, rng)[1]


def _rounded(radius, half, across, angle, halves, rng):
    x, y, z = halves
    c, s = radius * Fraction(3, 5), radius * Fraction(4, 5)
    return collide.ConvexHull(shape_corners(halves), radius=float(radius)), [
        Feature((x + radius, y / 2, 0), [(5, 0, 0)], "face"),
        Feature((x + c, y + s, z / 2), [(3, 4, 0)], "edge"),
        Feature((x, y + s, z + c), [(0, 4, 3)], "corner"),
    ]


def _segment(radius, half, across, angle, halves, rng):
    return collide.ConvexHull(np.array([[0, 0, -float(half)], [0, 0, float(half)]])), [
        Feature((0, 0, half / 2), [(5, 0, 0), (3, 4, 0)], "edge"),
        Feature((0, 0, half), [(0, 0, 5), (0, 3, 4)], "corner"),
    ]


def _triangle(radius, half, across, angle, halves, rng):
    points = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]) * float(radius)
    return collide.ConvexHull(points), [
        Feature((0, 0, 0), [(0, 0, 5)], "face"),
        Feature((0, -radius, 0), [(0, -5, 0), (0, -3, 4), (0, 0, 5)], "edge"),
        Feature((0, radius, 0), [(0, 5, 0), (0, 3, 4)], "corner"),
    ]


_MAKERS = {
    "cylinder": _cylinder, "cone": _cone, "ellipsoid": _ellipsoid, "sphere": _sphere, "capsule": _capsule, "box": _box,
    "hull": _hull, "rounded": _rounded, "segment": _segment, "triangle": _triangle,
}


def shape_corners(h) -> np.ndarray:
    return np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * [float(k) for k in h]


def exact_pair(rng, scale: float = 1.0, stretch: float = 1.0) -> Pair:
    """Two bodies that share a point, and no more than their surfaces there: A before B along a direction."""
    while True:
        kinds = [KINDS[rng.integers(3)], (*KINDS, *OTHERS)[rng.integers(10)]]
        rng.shuffle(kinds)
        (A, of_a), (B, of_b) = (body(kind, rng) for kind in kinds)
        fa, fb = of_a[rng.integers(len(of_a))], of_b[rng.integers(len(of_b))]
        if not (fa.normals and fb.normals):
            continue
        na, nb = (f.normals[rng.integers(len(f.normals))] for f in (fa, fb))
        R = TURNS[rng.integers(24)]
        fits = [T for T in TURNS if (T @ np.array(nb) == -R @ np.array(na)).all()]
        if not fits:
            continue
        T = fits[rng.integers(len(fits))]
        if {"sphere", "capsule", "rounded"} & set(kinds):
            stretch = 1.0  # poses do not stretch the balls of radii
        shift = rng.integers(-64, 65, 3) / 16.0
        X_WA, X_WB = np.eye(4), np.eye(4)
        X_WA[:3, :3], X_WB[:3, :3] = R * stretch, T * stretch
        X_WA[:3, 3] = shift
        pa, pb = (np.array([float(x) for x in f.point]) for f in (fa, fb))
        exact = [Fraction(x) == Fraction(y) for f, p in ((fa, pa), (fb, pb)) for x, y in zip(f.point, p.tolist())]
        X_WB[:3, 3] = R @ pa * stretch + shift - T @ pb * stretch
        moved = [
            Fraction(stretch) * sum(Fraction(r) * Fraction(x) for r, x in zip(row, pa.tolist())) + Fraction(t)
            - Fraction(stretch) * sum(Fraction(r) * Fraction(x) for r, x in zip(other, pb.tolist()))
            for row, other, t in zip(R.tolist(), T.tolist(), shift.tolist())
        ]
        if not all(exact) or any(m != Fraction(x) for m, x in zip(moved, X_WB[:3, 3].tolist())):
            continue
        family = f"{kinds[0]} {fa.name} on {kinds[1]} {fb.name}"
        return scaled(Pair(A, B, X_WA, X_WB, family), scale)


def scaled(pair: Pair, scale: float) -> Pair:
    """All lengths times a power of two."""
    if scale == 1.0:
        return pair
    X_WA, X_WB = pair.X_WA.copy(), pair.X_WB.copy()
    X_WA[:3, 3] *= scale
    X_WB[:3, 3] *= scale
    return Pair(larger(pair.A, scale), larger(pair.B, scale), X_WA, X_WB, pair.family)


def larger(shape, scale: float):
    kind = type(shape).__name__
    if kind == "Ellipsoid":
        return collide.Ellipsoid(np.asarray(shape.radii) * scale)
    if kind == "Box":
        return collide.Box(np.asarray(shape.size) * scale)
    if kind == "ConvexHull":
        return collide.ConvexHull(shape.points * scale, radius=shape.radius * scale)
    if kind == "Sphere":
        return collide.Sphere(shape.radius * scale)
    return type(shape)(shape.radius * scale, shape.length * scale)


def near_pair(rng, scale: float = 1.0) -> Pair:
    """Bodies anywhere, moved along their normal until they touch, but for rounding and some ulps."""
    kinds = [KINDS[rng.integers(3)], (*KINDS, *OTHERS)[rng.integers(10)]]
    rng.shuffle(kinds)
    A, B = (body(kind, rng)[0] for kind in kinds)
    if rng.random() < 0.2:
        A = flattened(A, 2.0 ** int(rng.integers(-20, 21)))
    X_WA, X_WB = (collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4)) for _ in range(2))
    if rng.random() < 0.5:
        X_WB[:3, :3] = X_WA[:3, :3] @ TURNS[rng.integers(24)]  # flush, but for rounding
    X_WB[:3, 3] *= 3.0
    r = collide.distance(A, B, X_WA, X_WB)
    X_WB[:3, 3] -= r.distance * r.normal
    X_WB[:3, 3] += int(rng.integers(-2, 3)) * np.spacing(np.abs(X_WB[:3, 3]).max()) * r.normal
    return scaled(Pair(A, B, X_WA, X_WB, f"near {kinds[0]} {kinds[1]}"), scale)


def flattened(shape, ratio: float):
    """A needle or a coin."""
    kind = type(shape).__name__
    if kind == "Ellipsoid":
        return collide.Ellipsoid(np.asarray(shape.radii) * [1, 1, ratio])
    if kind in ("Cylinder", "Cone"):
        return type(shape)(shape.radius, shape.length * ratio)
    return shape
