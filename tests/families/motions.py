"""Seeded families of motions that are hard for time of impact, each with an independent gap to judge it by.

A group is two shapes and n motions of them. `FAMILIES` names what is hard about each.
"""

from __future__ import annotations

import math
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

    def speeds(self) -> np.ndarray:
        """(n,) bounds of how fast points of A and B come nearer each other."""
        return oracle.speeds(*self.motions(), reach_of(self.A), reach_of(self.B))

    def motions(self) -> tuple[BodyMotion, BodyMotion]:
        return BodyMotion(self.X_WA0, self.X_WA1, self.omega_WA), BodyMotion(self.X_WB0, self.X_WB1, self.omega_WB)


def reach_of(shape: collide.Shape) -> float:
    """Greatest distance of a shape's points from its origin, by its numbers [m]."""
    if isinstance(shape, collide.Box):
        return 0.5 * float(np.linalg.norm(shape.size))
    if isinstance(shape, collide.Mesh):
        return float(np.linalg.norm(shape.vertices, axis=1).max())
    if isinstance(shape, collide.ConvexHull):
        return float(np.linalg.norm(shape.points, axis=1).max()) + shape.radius
    if isinstance(shape, collide.Sphere):
        return shape.radius
    if isinstance(shape, collide.Capsule):
        return shape.radius + 0.5 * shape.length
    if isinstance(shape, collide.Cylinder | collide.Cone):
        return math.hypot(shape.radius, 0.5 * shape.length)
    if isinstance(shape, collide.Ellipsoid):
        return float(shape.radii.max())
    if isinstance(shape, collide.Compound):
        return max(float(np.linalg.norm(X[:3, 3])) + reach_of(item) for item, X in shape.items)
    assert isinstance(shape, collide.Halfspace)
    return math.inf


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
    kind = rng.integers(4)
    if kind == 0:
        size = rng.uniform(0.1, 1.5, 3)
        B: collide.Shape = collide.Box(size)
        distance = oracle.box_distance(0.5 * size)
        extent = float(np.linalg.norm(size))
    elif kind == 1:
        B, distance = collide.Cylinder(radius, length), oracle.cylinder_distance(radius, length)
        extent = radius + length
    elif kind == 2:
        radii = rng.uniform(0.1, 0.9, 3)
        B, distance = collide.Ellipsoid(radii), oracle.ellipsoid_distance(radii)
        extent = float(radii.max())
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


def rods(rng) -> Pair:
    a, b = np.array([0.01, 0.01, 1.0]) * rng.uniform(1.0, 4.0), np.array([0.02, 0.01, 2.0])
    gap = oracle.polytope_gap(*oracle.box_features(a), *oracle.box_features(b))
    return collide.Box(a), collide.Box(b), gap, 6.0


def needle_and_plate(rng) -> Pair:
    a, b = np.array([1e-3, 1e-3, 0.2]), np.array([1.0, 1.0, 1e-6])
    gap = oracle.polytope_gap(*oracle.box_features(a), *oracle.box_features(b))
    return collide.Box(a), collide.Box(b), gap, 1.7


#: An L of two boxes: its profile in x and y, extruded along z; sizes and centres of the boxes.
_L_PROFILE = np.array([(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 1.5), (0, 1.5)], dtype=float)
L_BOXES = (((2.0, 0.5, 0.6), (1.0, 0.25, 0.0)), ((0.5, 1.5, 0.6), (0.25, 0.75, 0.0)))


def l_mesh() -> collide.Mesh:
    """The L as a closed surface of 20 facets."""
    low, high = np.c_[_L_PROFILE, np.full(6, -0.3)], np.c_[_L_PROFILE, np.full(6, 0.3)]
    cap = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    sides = [f for k in range(6) for f in ((k, (k + 1) % 6, 6 + (k + 1) % 6), (k, 6 + (k + 1) % 6, 6 + k))]
    mesh = collide.Mesh(np.concatenate([low, high]), np.concatenate([cap[:, ::-1], cap + 6, np.array(sides)]))
    assert mesh.solid
    return mesh


def l_gap(features) -> Gap:
    """Of the L and a convex polytope, by its (points, normals, edges)."""
    boxes_of_l = [oracle.moved_features(oracle.box_features(size), np.eye(3), at) for size, at in L_BOXES]
    return oracle.union_gap([oracle.polytope_gap(*box, *features) for box in boxes_of_l])


def l_mesh_and_box(rng) -> Pair:
    size = rng.uniform(0.2, 0.9, 3)
    return l_mesh(), collide.Box(size), l_gap(oracle.box_features(size)), 2.5 + float(np.linalg.norm(size))


def _surface_and_simplex(rng) -> Pair:
    """Five triangles anywhere, closed nowhere."""
    corners, points = rng.normal(0.0, 0.7, (5, 3, 3)), rng.normal(0.0, 0.5, (4, 3))
    other = oracle.simplex_features(points)
    gap = oracle.union_gap([oracle.polytope_gap(*oracle.simplex_features(c), *other) for c in corners])
    mesh = collide.Mesh(corners.reshape(-1, 3), np.arange(15).reshape(5, 3), solid=False)
    return mesh, collide.ConvexHull(points), gap, 4.0


def _unions(rng) -> Pair:
    """Three boxes in one body, two in the other."""
    bodies = []
    for k in (3, 2):
        sizes, at, R = rng.uniform(0.1, 0.8, (k, 3)), rng.uniform(-0.8, 0.8, (k, 3)), Rotation.random(k, rng)
        X = poses(R, at)
        features = [oracle.moved_features(oracle.box_features(s), x[:3, :3], x[:3, 3]) for s, x in zip(sizes, X)]
        bodies.append((collide.Compound([(collide.Box(s), x) for s, x in zip(sizes, X)]), features))
    (A, of_a), (B, of_b) = bodies
    return A, B, oracle.union_gap([oracle.polytope_gap(*a, *b) for a in of_a for b in of_b]), 5.0


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
    "spinning rods": lambda rng, n: random_group("spinning rods", rng, n, rods(rng), omega=200.0, spread=2.0),
    "ten kilometres": lambda rng, n: random_group("ten kilometres", rng, n, _any(rng), spread=0.5, fast=1e4),
    "needles and plates": lambda rng, n: random_group("needles and plates", rng, n, needle_and_plate(rng), spread=0.5),
    "fast needles and plates": lambda rng, n: random_group(
        "fast needles and plates", rng, n, needle_and_plate(rng), spread=0.3, turn=0.3, fast=1e4
    ),
    "unions": lambda rng, n: random_group("unions", rng, n, _unions(rng), spread=2.0),
    "a solid mesh and a box": lambda rng, n: random_group("solid", rng, n, l_mesh_and_box(rng), spread=2.0),
    "a surface and a tetrahedron": lambda rng, n: random_group(
        "surface", rng, n, _surface_and_simplex(rng), spread=2.5, omega=8.0
    ),
    "grazing": lambda rng, n: _grazing("grazing", rng, n, _any(rng)),
}
