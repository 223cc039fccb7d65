"""Seeded families of motions that are hard for time of impact, each with an independent gap to judge it by.

A group is two shapes and n motions of them. `FAMILIES` names what is hard about each.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import motion_oracle as oracle
import numpy as np
from motion_oracle import BodyMotion, Gap
from scipy.spatial.transform import Rotation

import collide


class Group(NamedTuple):
    """n motions of two shapes.   size : of both together [m], what the judge's rounding is measured in."""

    name: str
    A: collide.Shape
    B: collide.Shape
    X_WA0: np.ndarray
    X_WA1: np.ndarray
    X_WB0: np.ndarray
    X_WB1: np.ndarray
    omega_WA: np.ndarray | None
    omega_WB: np.ndarray | None
    gap: Gap
    size: float

    @property
    def poses(self) -> tuple[np.ndarray, ...]:
        return self.X_WA0, self.X_WA1, self.X_WB0, self.X_WB1

    def motions(self) -> tuple[BodyMotion, BodyMotion]:
        return BodyMotion(self.X_WA0, self.X_WA1, self.omega_WA), BodyMotion(self.X_WB0, self.X_WB1, self.omega_WB)


def poses(R: Rotation, p: np.ndarray) -> np.ndarray:
    X = np.zeros((len(p), 4, 4))
    X[:, :3, :3], X[:, :3, 3], X[:, 3, 3] = R.as_matrix(), p, 1.0
    return X




Pair = tuple[collide.Shape, collide.Shape, Gap, float]


def boxes(rng) -> Pair:
    a, b = rng.uniform(0.1, 1.5, (2, 3))
    gap = oracle.polytope_gap(*oracle.box_features(a), *oracle.box_features(b))
    return collide.Box(a), collide.Box(b), gap, float(np.linalg.norm(a) + np.linalg.norm(b))


def _simplices(rng) -> Pair:
    a, b = rng.normal(0.0, 0.6, (2, 4, 3))
    gap = oracle.polytope_gap(*oracle.simplex_features(a), *oracle.simplex_features(b))
    return collide.ConvexHull(a), collide.ConvexHull(b), gap, float(np.linalg.norm(a) + np.linalg.norm(b))


def _capsules(rng) -> Pair:
    (r, s), (h, k) = rng.uniform(0.05, 0.4, 2), rng.uniform(0.0, 2.0, 2)
    A, B = collide.Capsule(r, h), collide.Capsule(s, k)
    return A, B, oracle.segment_gap(0.5 * h, 0.5 * k, r + s), float(r + s + h + k)


def _sphere_and_round(rng) -> Pair:
    r, radius, length = rng.uniform(0.05, 0.6, 3)
    length *= 3.0
    kind = rng.integers(3)
    if kind == 0:
        size = rng.uniform(0.1, 1.5, 3)
        B: collide.Shape = collide.Box(size)
        distance = oracle.box_distance(0.5 * size)
        extent = float(np.linalg.norm(size))
    elif kind == 1:
        B, distance = collide.Cylinder(radius, length), oracle.cylinder_distance(radius, length)
        extent = radius + length
    else:
        B, distance = collide.Cone(radius, length), oracle.cone_distance(radius, length)
        extent = radius + length
    return collide.Sphere(r), B, oracle.point_gap(distance, r), float(r + extent)


def _half_space(rng) -> Pair:
    normal, offset = rng.normal(size=3), float(rng.uniform(-2.5, -0.5))
    points = rng.normal(0.0, 0.5, (rng.integers(4, 20), 3))
    radius = float(rng.choice([0.0, 0.2]))
    B = collide.ConvexHull(points, radius=radius)
    return collide.Halfspace(normal, offset), B, oracle.plane_gap(normal, offset, points, radius), 4.0


def _rods(rng) -> Pair:
    a, b = np.array([0.01, 0.01, 1.0]) * rng.uniform(1.0, 4.0), np.array([0.02, 0.01, 2.0])
    gap = oracle.polytope_gap(*oracle.box_features(a), *oracle.box_features(b))
    return collide.Box(a), collide.Box(b), gap, 6.0


def needle_and_plate(rng) -> Pair:
    a, b = np.array([1e-3, 1e-3, 0.2]), np.array([1.0, 1.0, 1e-6])
    gap = oracle.polytope_gap(*oracle.box_features(a), *oracle.box_features(b))
    return collide.Box(a), collide.Box(b), gap, 1.7


def _any(rng) -> Pair:
    return (boxes, _simplices, _capsules, _sphere_and_round)[rng.integers(4)](rng)


def random_group(name, rng, n, pair: Pair, *, spread=1.5, turn=None, omega=None, fast=0.0) -> Group:
    """Random positions within the spread at both ends, random orientations.

    turn : largest angle between both ends, π without.   omega : turns are given as angular velocities up to this.
    fast : B flies past A on a line so long.
    """
    A, B, gap, size = pair
    p = rng.uniform(-spread, spread, (4, n, 3))
    R0, R1 = [Rotation.random(n, random_state=rng) for _ in range(2)], [None, None]
    omegas: list = [None, None]
    for k in range(2):
        if omega is not None:
            direction = rng.normal(size=(n, 3))
            length = rng.uniform(0.0, omega, n) / np.linalg.norm(direction, axis=1)
            omegas[k] = direction * length[:, None]
            R1[k] = Rotation.from_rotvec(omegas[k]) * R0[k]
        elif turn is not None:
            R1[k] = Rotation.from_rotvec(rng.normal(0.0, turn, (n, 3)) / 3.0) * R0[k]
        else:
            R1[k] = Rotation.random(n, random_state=rng)
    if fast:
        along = rng.normal(size=(n, 3))
        along *= fast / np.linalg.norm(along, axis=1)[:, None]
        share = rng.uniform(0.1, 0.9, (n, 1))
        p[3] = p[2] + (1.0 - share) * along
        p[2] = p[2] - share * along
    X = [poses(R0[0], p[0]), poses(R1[0], p[1]), poses(R0[1], p[2]), poses(R1[1], p[3])]
    return Group(name, A, B, *X, omegas[0], omegas[1], gap, size)


def resolution(group: Group) -> float:
    """How small a gap or depth the oracle can tell from none [m]: rounding of positions and turned points."""
    moved = max(1.0, float(np.abs(group.X_WB1[:, :3, 3] - group.X_WB0[:, :3, 3]).max()))
    turns = [1.0] + [float(np.linalg.norm(w, axis=1).max()) for w in (group.omega_WA, group.omega_WB) if w is not None]
    return 1e-12 * (moved + group.size * max(turns))


def _grazing(name, rng, n, pair: Pair) -> Group:
    """Motions whose least gap is all but 0: bodies whose origins meet half-way, B's path then shifted to the side by as
    much as just clears it, and a little."""
    group = random_group(name, rng, n, pair, spread=1.5, turn=0.5)
    A, B = group.motions()
    half = np.full(n, 0.5)
    group = _shifted(group, A.at(half)[1] - B.at(half)[1])
    shift = rng.normal(size=(n, 3))
    shift /= np.linalg.norm(shift, axis=1)[:, None]
    low, high = np.zeros(n), np.full(n, 8.0)  # overlapping (mostly), free
    for _ in range(36):
        middle = 0.5 * (low + high)
        A, B = _shifted(group, middle[:, None] * shift).motions()
        free = oracle.judge(group.gap, A, B, np.ones(n), np.ones(n), samples=32, rounds=10).least > 0.0
        low, high = np.where(free, low, middle), np.where(free, middle, high)
    off = rng.choice([-1e-7, -1e-10, 0.0, 1e-10, 1e-7], n)
    return _shifted(group, (high + off)[:, None] * shift)


def _shifted(group: Group, by: np.ndarray) -> Group:
    X0, X1 = group.X_WB0.copy(), group.X_WB1.copy()
    X0[:, :3, 3] += by
    X1[:, :3, 3] += by
    return group._replace(X_WB0=X0, X_WB1=X1)


#: By name: ``make(rng, n)`` gives a group.
FAMILIES: dict[str, Callable[[np.random.Generator, int], Group]] = {
    "boxes at random": lambda rng, n: random_group("boxes at random", rng, n, boxes(rng)),
    "tetrahedra at random": lambda rng, n: random_group("tetrahedra at random", rng, n, _simplices(rng)),
    "capsules at random": lambda rng, n: random_group("capsules at random", rng, n, _capsules(rng)),
    "a sphere and a round or square body": lambda rng, n: random_group("sphere", rng, n, _sphere_and_round(rng)),
    "half-spaces": lambda rng, n: random_group("half-spaces", rng, n, _half_space(rng), turn=1.0),
    "translations": lambda rng, n: random_group("translations", rng, n, _any(rng), turn=0.0),
    "many turns": lambda rng, n: random_group("many turns", rng, n, _any(rng), omega=60.0, spread=2.0),
    "spinning rods": lambda rng, n: random_group("spinning rods", rng, n, _rods(rng), omega=200.0, spread=2.0),
    "ten kilometres": lambda rng, n: random_group("ten kilometres", rng, n, _any(rng), spread=0.5, fast=1e4),
    "needles and plates": lambda rng, n: random_group("needles and plates", rng, n, needle_and_plate(rng), spread=0.5),
    "fast needles and plates": lambda rng, n: random_group(
        "fast needles and plates", rng, n, needle_and_plate(rng), spread=0.3, turn=0.3, fast=1e4
    ),
    "grazing": lambda rng, n: _grazing("grazing", rng, n, _any(rng)),
}
