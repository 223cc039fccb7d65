"""Half-spaces in doubles and double-doubles, against their images in Fractions; also where matrices are no rotation."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import exact, inner, solved
from naive import Case, corners, hull_points, pose, random_pose, reproducible, rng_of, unit
from naive_triangles import world_points
from posed_bodies import PosedBodies

import collide
from collide.kernels import address_of
from collide.narrowphase.halfspace_convex import halfspace_convex, plane_in_world, reach_of_plane, refine_height
from collide.narrowphase.halfspace_halfspace import halfspace_halfspace
from collide.narrowphase.rows import ROW, blank_row
from collide.results import FORMULA, PAIR_DTYPE, UNDECIDED

pytestmark = pytest.mark.plain_kernels


def image(half: collide.Halfspace, X: np.ndarray) -> tuple[list[Fraction], Fraction]:
    """(n, b) of the image {x : n·x ≤ b}: n solves Rᵀn = m, and x = R y + p."""
    R, (p,) = exact(X[:3, :3]), exact([X[:3, 3]])
    normal = solved([list(column) for column in zip(*R)], list(exact([half.normal])[0]))
    assert normal is not None
    return normal, Fraction(half.offset) + inner(normal, p)


def root(square: Fraction) -> Fraction:
    """To 60 digits."""
    return Fraction(math.isqrt(int(square * 4**200)), 2**200)


def signed_gap(case: Case) -> float:
    normal, offset = image(case.A, case.X_WA)
    points, radius = corners(case.B)
    lowest = min(inner(normal, x) - offset for x in world_points(points, case.X_WB))
    return float(lowest / root(inner(normal, normal)) - Fraction(radius))


def drawn(rng, kind: str) -> Case:
    half = collide.Halfspace(unit(rng.normal(size=3)), float(rng.normal()) - 1.0)
    body = collide.ConvexHull(hull_points(rng, int(rng.integers(1, 12))), radius=float(rng.choice([0.0, 0.3])))
    if kind == "lattice":  # many corners level
        half = collide.Halfspace((0.0, 0.0, 1.0), float(rng.integers(-2, 3)) * 0.5)
        body = collide.Box(tuple(rng.integers(1, 5, 3) * 0.5))
    X_WA, X_WB = random_pose(rng), random_pose(rng)
    if kind == "lattice":
        X_WA = pose()
        X_WB = pose(t=rng.integers(-4, 5, 3) * 0.25)
    elif kind == "sheared":
        X_WA[:3, :3] = X_WA[:3, :3] @ (np.eye(3) + 0.3 * rng.normal(size=(3, 3)))
    return Case(half, body, X_WA, X_WB)


@pytest.mark.parametrize("kind", ["rotated", "lattice", "sheared"])
def test_rows(kind):
    rng = rng_of("halfspace convex", kind)
    seen: Counter = Counter()
    for _ in range(60):
        case = drawn(rng, kind)
        bodies = PosedBodies(*case)
        rows = np.zeros(1, dtype=PAIR_DTYPE)
        with reproducible(case):
            true = signed_gap(case)
            halfspace_convex(bodies.ordered, bodies.query(), blank_row(address_of(rows)), bodies.work)
            row = rows[0]
            assert row["lower"] <= true + 4e-16 * abs(true) and true - 4e-16 * abs(true) <= row["upper"]
            if row["how"] == UNDECIDED:
                assert abs(true) <= 4 * bodies.error
                seen["open"] += 1
                continue
            assert row["how"] == FORMULA and row["certified"] and row["hit"] == (true <= 0)
            assert abs(row["distance"] - true) <= 4e-16 * abs(true) + 1e-30
            normal = np.array([float(x) for x in image(case.A, case.X_WA)[0]])
            assert np.abs(row["normal"] - unit(normal)).max() <= 1e-15 * np.linalg.cond(case.X_WA[:3, :3])
            # The plane through one point, the deepest of B at the other.
            offset = float(image(case.A, case.X_WA)[1]) / np.linalg.norm(normal)
            assert abs(row["point_a"] @ row["normal"] - offset) <= 1e-14 * bodies.ordered.size * 8
            assert np.abs(row["point_b"] - row["point_a"] - row["distance"] * row["normal"]).max() <= 1e-14 * 16
            lowest = world_points(corners(case.B)[0][[row["vertices_b"][0]]], case.X_WB)[0]
            at = np.array([float(x) for x in lowest]) - corners(case.B)[1] * row["normal"]
            assert np.abs(at - row["point_b"]).max() <= 1e-14 * 16
            seen[bool(row["hit"])] += 1
    assert min(seen[True], seen[False]) >= 15, seen


@pytest.mark.parametrize("kind", ["rotated", "lattice", "sheared"])
def test_planes_and_heights(kind):
    """The plane in doubles, its distance from the frame's origin, and the core's height to 2⁻⁹⁶ of the size."""
    rng = rng_of("refine height", kind)
    proven = 0
    for _ in range(40):
        case = drawn(rng, kind)
        bodies = PosedBodies(*case)
        pair = bodies.pair
        with reproducible(case):
            normal, offset = image(case.A, case.X_WA)
            length = math.sqrt(float(inner(normal, normal)))
            plane = plane_in_world(pair, pair.A)
            turned = np.array(plane.normal) / plane.length
            assert np.abs(turned - [float(x) / length for x in normal]).max() <= 4e-15
            from_origin = float(offset - inner(normal, exact([case.X_WA[:3, 3]])[0])) / length
            assert abs(plane.offset / plane.length - from_origin) <= 1e-14 * (1 + abs(from_origin))
            distance, skew = reach_of_plane(pair, pair.A)
            assert distance >= abs(from_origin) * (1 - 1e-14) and skew >= 1.0
            points, _ = corners(case.B)
            heights = [inner(normal, x) - offset for x in world_points(points, case.X_WB)]
            vertex = heights.index(min(heights))
            size = bodies.ordered.size + distance
            fine = refine_height(
                pair, bodies.work.fine_at, bodies.work.ties_at, vertex, size, 1e-13 * size * skew, skew
            )
            proven += fine.proven
            value = Fraction(float(fine.height.high)) + Fraction(float(fine.height.low))
            square, true = inner(normal, normal), min(heights)
            # |value − s/|n|| ≤ error, squared to stay rational
            bounds = [value - Fraction(fine.error), value + Fraction(fine.error)]
            low, high = (b * abs(b) * square for b in bounds)
            assert low <= true * abs(true) <= high and fine.error <= 2.0**-80 * size * skew
    assert proven == 40


def test_two_halfspaces():
    """They meet without end, but where their normals may be opposite exactly: left open."""
    rng = rng_of("two halfspaces")
    seen: Counter = Counter()
    for _ in range(60):
        A = collide.Halfspace(unit(rng.normal(size=3)), float(rng.normal()))
        tilt = float(rng.choice([0.0, 1e-15, 1e-12, 1.0]))
        facing = float(rng.choice([-1.0, -1.0, 1.0]))
        B = collide.Halfspace(unit(facing * A.normal + tilt * unit(rng.normal(size=3))), float(rng.normal()))
        X = random_pose(rng)
        case = Case(A, B, X, pose(X[:3, :3], rng.normal(size=3)))
        bodies = PosedBodies(*case)
        rows = np.zeros(1, dtype=PAIR_DTYPE)
        with reproducible(case):
            halfspace_halfspace(bodies.pair, bodies.ordered.flip, blank_row(address_of(rows)))
            row = rows[0]
            (n, _), (m, _) = image(A, case.X_WA), image(B, case.X_WB)
            across = math.sqrt(sum((n[k - 2] * m[k - 1] - n[k - 1] * m[k - 2]) ** 2 for k in range(3)))
            opposite = across <= 1e-14 and inner(n, m) < 0
            if across <= 1e-14 or across >= 1e-12:  # between: either
                assert (row["how"] == UNDECIDED) == opposite and row["certified"] != opposite
            assert row["hit"] and row["upper"] == 0.0 and row["distance"] == -math.inf
            outwards = -np.array([float(x) for x in m]) if bodies.ordered.flip else [float(x) for x in n]
            assert np.abs(row["normal"] - unit(outwards)).max() <= 1e-15
            assert (row["point_a"] == case.X_WA[:3, 3]).all() and (row["point_b"] == case.X_WB[:3, 3]).all()
            seen["opposite" if opposite else "askew"] += 1
    assert ROW == rows.nbytes and min(seen.values()) >= 12, seen
