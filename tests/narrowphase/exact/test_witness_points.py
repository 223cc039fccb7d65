"""Witness points of the exact stage: where the named points come nearest, of the bodies as asked."""

from __future__ import annotations

from collections import Counter

import naive
import numpy as np
import pytest
from exact_simplex import exact, nearest_to_origin
from naive import Case, hull_points, random_pose, reproducible, rng_of, unit
from naive_triangles import world_points
from posed_bodies import PosedBodies

import collide
from collide.kernels import address_of
from collide.narrowphase.exact import witness_points as W
from collide.narrowphase.rows import view_row
from collide.numerics.vec3 import Vec3
from collide.results import PAIR_DTYPE

pytestmark = pytest.mark.plain_kernels


def drawn(rng) -> Case:
    A, B = (
        collide.ConvexHull(hull_points(rng, int(rng.integers(4, 8))), radius=float(rng.choice([0.0, 0.2])))
        for _ in range(2)
    )
    return Case(A, B, random_pose(rng, 2.0), random_pose(rng, 2.0))


class Row:
    """A row, and doubles to work in."""

    def __init__(self):
        self.rows, self.doubles = np.zeros(1, dtype=PAIR_DTYPE), np.zeros(128)
        self.view, self.doubles_at = view_row(address_of(self.rows)), address_of(self.doubles)

    def points(self, bodies: PosedBodies) -> list[np.ndarray]:
        """Of the bodies as worked on."""
        a, b = self.rows["point_a"][0], self.rows["point_b"][0]
        return [b, a] if bodies.ordered.flip else [a, b]


@pytest.mark.many(2)
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_points_along_the_normal(n):
    """The point of the named simplex nearest the origin, taken apart: each body's point is in the hull of its named
    vertices, grown by the radius along the normal."""
    rng = rng_of("witness points", n)
    flips: Counter = Counter()
    for _ in range(40):
        case = drawn(rng)
        bodies, row = PosedBodies(*case), Row()
        names = list(bodies.difference())
        ids = [k for at in rng.choice(len(names), n, replace=False) for k in names[at]]
        simplex = [bodies.difference()[ids[2 * k], ids[2 * k + 1]] for k in range(n)]
        nearest = nearest_to_origin(simplex)
        if float(nearest.square) < 1e-6:
            continue
        length = float(nearest.square) ** 0.5
        v = np.array([float(x) for x in nearest.point]) / length
        distance = length - bodies.radius
        with reproducible(case):
            W.put_normal_and_points(
                row.view, bodies.ordered, address_of(bodies.poses.terms), ids, n, row.doubles_at, Vec3(*v), distance
            )
            sense = 1.0 if bodies.ordered.flip else -1.0
            assert np.abs(row.rows["normal"][0] - sense * v).max() <= 1e-15
            gap = row.rows["point_b"][0] - row.rows["point_a"][0]
            assert np.abs(gap - distance * row.rows["normal"][0]).max() <= 1e-14
            assert not W.points_miss(row.view, bodies.ordered.size, distance)
            assert W.points_miss(row.view, bodies.ordered.size, distance + 1e-12)
            for which, (shape, X, p) in enumerate(zip(bodies.shapes, bodies.X, row.points(bodies))):
                points, radius = naive.corners(shape)
                core = p + (1 - 2 * which) * radius * v  # on the other side of the surface
                named = world_points(points[ids[which : 2 * n : 2]], X)
                offset = [[x - y for x, y in zip(q, exact([core])[0])] for q in named]
                assert float(nearest_to_origin(offset).square) <= 1e-28
        flips[bodies.ordered.flip] += 1
    assert min(flips[True], flips[False]) >= 10, flips


def test_common_points():
    """The origin among four points of A ⊖ B: one point of both cores, whose weights are exact to rounding."""
    rng = rng_of("common points")
    cases = 0
    for _ in range(2000):
        case = drawn(rng)
        case = case.with_b_moved(case.X_WA[:3, 3] - case.X_WB[:3, 3])
        bodies, row = PosedBodies(*case), Row()
        names = list(bodies.difference())
        ids = [k for at in rng.choice(len(names), 4, replace=False) for k in names[at]]
        simplex = [bodies.difference()[ids[2 * k], ids[2 * k + 1]] for k in range(4)]
        equations = np.vstack([np.array([[float(x) for x in p] for p in simplex]).T, np.ones(4)])
        if abs(np.linalg.det(equations)) < 1e-3 or np.linalg.solve(equations, (0, 0, 0, 1)).min() < 1e-4:
            continue
        nearest = nearest_to_origin(simplex)
        cases += 1
        with reproducible(case):
            W.put_common_point(row.view, bodies.ordered, ids, 4, row.doubles_at)
            for which, (shape, X, p) in enumerate(zip(bodies.shapes, bodies.X, row.points(bodies))):
                named = world_points(naive.corners(shape)[0][ids[which::2]], X)
                true = [sum(w * q[axis] for w, q in zip(nearest.weights, named)) for axis in range(3)]
                assert np.abs(p - [float(x) for x in true]).max() <= 1e-11
            a, b = row.rows["point_a"][0], row.rows["point_b"][0]
            assert np.abs(a - b).max() <= 1e-14
        if cases == 12:
            return
    raise AssertionError(f"{cases} cases with the origin inside")


def test_normals_alone_where_sizes_are_out_of_range():
    """Points keep their middle and get the distance that is said."""
    bodies, row = PosedBodies(collide.Sphere(1.0), collide.Sphere(1.0), np.eye(4), np.eye(4)), Row()
    ordered = bodies.ordered._replace(size=2.0**-400)
    row.rows["point_a"], row.rows["point_b"] = (0.0, 2.0, 0.0), (2.0, 0.0, 0.0)
    v = unit((1.0, 2.0, 2.0))
    W.put_normal_and_points(row.view, ordered, 0, [0, 0], 1, row.doubles_at, Vec3(*v), 3.0)
    r = row.rows[0]
    assert np.abs((r["point_a"] + r["point_b"]) / 2 - (1.0, 1.0, 0.0)).max() <= 1e-15
    assert np.abs(r["point_b"] - r["point_a"] - 3.0 * r["normal"]).max() <= 1e-15
