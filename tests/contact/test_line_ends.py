"""Lines of contact along rims and sharp edges of meshes: both ends of what is shared are there, on both surfaces."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest
from contact_oracle import ConvexBody, away_from, facet, failures_of_convex

import collide

EYE = np.eye(4)
RADIUS, LENGTH = 0.2, 0.8


class Lined(NamedTuple):
    """A body with a straight line on it.

    X_BL : a frame in the middle of the line, z along it and x into the body.   length : of the line [m].
    lost : of a cone how much of its line is not round enough, at its apex, a metre that the other is beside it [1]:
    surfaces are looked at down to 45°, and the radius across the line is length · tan α there.
    """

    shape: collide.Shape
    X_BL: np.ndarray
    length: float
    lost: float = 0.0


def straight(shape, radius: float, length: float) -> Lined:
    return Lined(shape, collide.pose((-radius, 0, 0)), length)


def cone(radius: float, height: float) -> Lined:
    length = float(np.hypot(radius, height))
    z, x = np.array([-radius, 0, height]) / length, np.array([-height, 0, -radius]) / length
    X_BL = np.eye(4)
    X_BL[:3, :3], X_BL[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), (radius / 2, 0, 0)
    return Lined(collide.Cone(radius, height), X_BL, length, np.sqrt(2) * height / radius)


def bodies(radius: float, length: float) -> dict[str, Lined]:
    ends = [[0, 0, -length / 2], [0, 0, length / 2]]
    return {
        "capsule": straight(collide.Capsule(radius, length), radius, length),
        "cylinder": straight(collide.Cylinder(radius, length), radius, length),
        "segment": straight(collide.ConvexHull(ends, radius=radius), radius, length),
        "cone": cone(radius, length),
    }


LINED = {**bodies(RADIUS, LENGTH), "flat cone": cone(0.45, 0.5), "needle": cone(0.02, 0.8)}
ROUND = {name: LINED[name].shape for name in ("capsule", "cylinder", "segment")}


def inverse(X: np.ndarray) -> np.ndarray:
    Y = np.eye(4)
    Y[:3, :3], Y[:3, 3] = X[:3, :3].T, -X[:3, :3].T @ X[:3, 3]
    return Y


def square(n: int) -> collide.Mesh:
    """An open square of side 2 across z, of n · n cells: a rim along y at x = 1."""
    k = np.linspace(-1.0, 1.0, n + 1)
    cells = [(n + 1) * i + j for i in range(n) for j in range(n)]
    faces = [f for c in cells for f in ((c, c + n + 1, c + n + 2), (c, c + n + 2, c + 1))]
    return collide.Mesh([(x, y, 0.0) for x in k for y in k], faces, solid=False)


def wedge(degrees: float, n: int) -> collide.Mesh:
    """A solid prism with an edge of this angle along y at x = 1, z = 0, cut into n pieces along it."""
    half = np.deg2rad(degrees) / 2
    outline = [(1.0, 0.0), (1.0 - 2 * np.cos(half), 2 * np.sin(half)), (1.0 - 2 * np.cos(half), -2 * np.sin(half))]
    points = [(x, y, z) for y in np.linspace(-1.0, 1.0, n + 1) for x, z in outline]
    sides = [(3 * i + p, 3 * i + (p + 1) % 3) for i in range(n) for p in range(3)]
    faces = [f for p, q in sides for f in ((p, q, q + 3), (p, q + 3, p + 3))]
    return collide.Mesh(points, [*faces, (0, 2, 1), (3 * n, 3 * n + 1, 3 * n + 2)])


def leaning(degrees: float) -> np.ndarray:
    """Angles in the plane across an edge, from x, at which a line leans on it [rad]."""
    return np.deg2rad((90 - degrees / 2) * np.array([-0.9, -0.5, 0, 0.7, 0.95]))


#: Bodies with an edge along y at x = 1, z = 0, and angles at which a line leans on it.
TARGETS = {
    **{f"rim {n}": (square(n), np.deg2rad([90, 70, 53, 45, 30, 1, -60])) for n in (1, 3)},
    **{f"edge of {a}, {n}": (wedge(a, n), leaning(a)) for a in (20, 90, 120, 170) for n in (1, 3)},
    **{f"hull of {a}": (collide.ConvexHull(wedge(a, 1).vertices), leaning(a)) for a in (20, 90, 120, 170)},
}


@pytest.mark.many(14)
@pytest.mark.parametrize("body", LINED)
@pytest.mark.parametrize("target", TARGETS)
def test_a_line_along_a_rim_or_a_sharp_edge_has_both_ends(target, body):
    """A line that turned by a hair from the edge ended where a steep facet did, or where it left a flat one; that of a
    cone had the nearest points alone."""
    (A, angles), lined = TARGETS[target], LINED[body]
    B = lined.shape
    rng = np.random.default_rng(5)
    turned = 0
    for angle in angles:
        out, along = np.array([np.cos(angle), 0, np.sin(angle)]), np.array([0.0, 1.0, 0.0])
        for _ in range(4):
            turn = rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, -3.1)
            gap, aside = rng.choice([1e-5, -1e-5, 1e-9, -1e-9, 0.0]), rng.choice([0.0, 1e-6, -1e-6])
            across = np.cross(along, out)
            X_WL = np.eye(4)
            line = np.cos(turn) * along + np.sin(turn) * across
            X_WL[:3, :3] = np.stack([out, np.cross(line, out), line], axis=1)
            X_WL[:3, 3] = (1.0, rng.uniform(-0.15, 0.15), 0.0) + gap * out + aside * across
            X = X_WL @ inverse(lined.X_BL)
            where = f"{target}, {body}: X_WB = np.array({X.tolist()!r})"
            c = collide.contacts(A, B, EYE, X, margin=1e-3)
            lost = 2e-3 + lined.lost * (abs(aside) + abs(turn) * lined.length)
            assert np.ptp(c.point_a[:, 1]) > lined.length - lost, where
            swapped = collide.contacts(B, A, X, EYE, margin=1e-3)
            if isinstance(A, collide.Mesh):
                assert np.array_equal(swapped.point_b, c.point_a), where
                assert (c.lower <= c.distance).all() and (c.distance <= c.upper).all(), where
                off = np.abs(ConvexBody(B, X).signed(c.point_b)).astype(float)
                assert (off <= c.upper - c.lower + 1e-12).all(), (where, off)
                on = [away_from(facet(A.vertices, A.faces, EYE, r["facet_a"]), r["point_a"]) for r in c.rows]
                assert max(on) <= 1e-9, (where, on)
            else:
                r = collide.distance(A, B, EYE, X)
                assert not failures_of_convex(A, B, EYE, X, 1e-3, c.rows, r), where
            turned += abs(turn) > 1e-6
    assert turned >= len(angles)


def lines_along(number: int):
    """(kinds, A, B, X_WA, X_WB, margin): a round line along an edge or another round line, turned by up to 9e-4,
    leaning off it by up to 0.4 rad, and beside it by up to a fifth of the radius, with a margin of up to 0.3."""
    rng = np.random.default_rng([7, number])
    b = list(LINED)[number % 4]
    a = ("edge", "box", "cylinder", "capsule", "cone")[number // 4 % 5]
    lined = bodies(rng.uniform(0.05, 0.5), rng.uniform(0.3, 1.0))[b]
    B, radius = lined.shape, lined.shape.radius
    sign = rng.choice([-1, 1], 3)
    turn = sign[0] * 10.0 ** rng.uniform(-12, -3.05)
    lean = rng.choice([0.0, sign[1] * 10.0 ** rng.uniform(-9, -0.4)])
    X_EL = collide.pose((0, 0, 0), rpy=(turn, 0, 0))  # E: x outwards, z along the line of A
    X_EL[:3, :3] = collide.pose(rpy=(0, lean, 0))[:3, :3] @ X_EL[:3, :3] @ np.diag([1.0, sign[2], sign[2]])
    X_EL[:3, 3] = (
        rng.choice([0.0, 1e-9, -1e-9, 1e-3, -1e-3]), rng.choice([0.0, 1e-6, 0.1, -0.2]) * radius,
        rng.uniform(-0.5, 0.5) * lined.length,
    )
    if a in ("edge", "box"):
        degrees = 90.0 if a == "box" else rng.uniform(20, 170)
        angle = np.deg2rad(rng.uniform(-0.9, 0.9) * (90 - degrees / 2))
        A = collide.ConvexHull(wedge(degrees, 1).vertices)
        out = np.array([np.cos(angle), 0, np.sin(angle)])
        corner = np.array([1.0, 0, 0])
        if a == "box":  # its edge at 45°
            A, corner = collide.Box((1, 2, 1)), np.array([0.5, 0, 0.5])
            out = np.sqrt(0.5) * np.array([out[0] - out[2], 0, out[0] + out[2]])
        X_AE = np.eye(4)
        X_AE[:3, :3], X_AE[:3, 3] = np.stack([out, np.cross((0, 1, 0), out), (0, 1, 0)], axis=1), corner
    else:
        other = bodies(rng.uniform(0.05, 0.5), rng.uniform(0.3, 1.0))[a]
        A, X_AE = other.shape, other.X_BL @ np.diag([-1.0, -1.0, 1.0, 1.0])
    X_WA = collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4)) if rng.uniform() < 0.5 else np.eye(4)
    X_WB = X_WA @ X_AE @ X_EL @ inverse(lined.X_BL)
    margin = max(collide.distance(A, B, X_WA, X_WB).upper, 0.0) + float(rng.choice([1e-6, 1e-3, 0.3]))
    return (a, b), A, B, X_WA, X_WB, margin


@pytest.mark.many(2)
@pytest.mark.parametrize("part", range(4))
def test_points_of_lines_that_lean_are_on_their_bodies(part):
    """An end was past that of a cylinder that leaned, by what the side falls off beside its line times the sine. Two
    cones side by side had no ends; the base of one is not square to its side."""
    with_ends: Counter = Counter()
    for number in range(200 * part, 200 * part + 200):
        kinds, A, B, X_WA, X_WB, margin = lines_along(number)
        c = collide.contacts(A, B, X_WA, X_WB, margin=margin)
        told = failures_of_convex(A, B, X_WA, X_WB, margin, c.rows, collide.distance(A, B, X_WA, X_WB))
        where = f"{A!r}, {B!r}, X_WA = np.array({X_WA.tolist()!r}), X_WB = np.array({X_WB.tolist()!r}), {margin!r}"
        assert not told, (number, kinds, told, where)
        with_ends[kinds] += len(c) > 1
    assert len(with_ends) == 20 and with_ends.total() >= 130, with_ends


@pytest.mark.parametrize("body", ROUND)
@pytest.mark.parametrize("beside", [0.0, 0.05, 0.15, 0.5])
def test_a_line_on_a_flat_face_beside_its_edge_has_no_others(body, beside):
    """The ends that the edge would have are farther than the face's own."""
    box = collide.Mesh(*collide.tessellate(collide.Box((2, 2, 2)))[:2])
    X = collide.pose((1.0 - beside, 0.0, 1.0 + RADIUS), rpy=(np.pi / 2, 0, 0))
    c = collide.contacts(box, ROUND[body], EYE, X, margin=1e-3)
    assert len(c) == 2 and np.abs(c.point_a[:, 0] - (1.0 - beside)).max() < 1e-9
