"""Boxes by fifteen axes: brackets against the same axes in fractions, gaps against `distance`, decided often enough."""

from __future__ import annotations

from decimal import Decimal, getcontext
from fractions import Fraction

import numpy as np
from naive_triangles import cross, inner

import collide
from collide.contact.box_box import box_row
from collide.kernels import address_of
from collide.lowering.parts import convex_set_of
from collide.lowering.shape_table import ShapeTable
from collide.results import PAIR_DTYPE

MODES = ("any", "flush", "tilted by 1e-9", "tilted by 1e-3", "edge on edge", "capsule level", "capsule", "sphere")


def half_of(shape) -> np.ndarray:
    """Half sizes of a box, or of what a ball is swept over."""
    if isinstance(shape, collide.Box):
        return np.array(shape.size) / 2
    return np.array([0.0, 0.0, shape.length / 2 if isinstance(shape, collide.Capsule) else 0.0])


def swept(rng, mode: str):
    """A box, and a capsule or a sphere over a face of it, or in it: (A, B, X_WA, X_WB), exchanged now and then."""
    box, X_WA = collide.Box(rng.uniform(0.2, 1, 3)), collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
    ball = collide.Sphere(0.1) if mode == "sphere" else collide.Capsule(rng.uniform(0.02, 0.2), rng.uniform(0.1, 1.5))
    k = int(rng.integers(3))
    turn = np.zeros(3)
    lying = np.pi / 2
    if mode == "capsule":
        turn[:2] = rng.choice([1e-12, 1e-9, 1e-3, 0.3], 2)
    R_level = collide.pose((0, 0, 0), rpy=(lying, 0, 0) if k == 2 else (0, 0, 0))
    about = np.zeros(3)
    about[k] = rng.uniform(-3, 3)
    X_AB = collide.pose((0, 0, 0), rpy=about) @ R_level @ collide.pose((0, 0, 0), rpy=turn)
    X_AB[:3, 3] = rng.uniform(-0.4, 0.4, 3) * box.size
    X_AB[k, 3] = box.size[k] / 2 + ball.radius * rng.choice([1.0, 1.0, 1.0, -0.5]) + rng.choice([-1e-3, 1e-3, 0.05])
    X_WB = X_WA @ X_AB
    return (box, ball, X_WA, X_WB) if rng.integers(2) else (ball, box, X_WB, X_WA)


def boxes(rng, mode: str):
    """Two boxes near each other: (A, B, X_WA, X_WB)."""
    if mode in ("capsule level", "capsule", "sphere"):
        return swept(rng, mode)
    A, B = collide.Box(rng.uniform(0.1, 1, 3)), collide.Box(rng.uniform(0.1, 1, 3))
    X_WA = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
    if mode == "any":
        return A, B, X_WA, collide.pose(X_WA[:3, 3] + rng.normal(size=3) * 0.6, rpy=rng.uniform(-3, 3, 3))
    if mode == "edge on edge":
        X_AB = collide.pose((0, 0, 0), rpy=(np.pi / 4, 0, 0)) @ collide.pose((0, 0, 0), rpy=(0, 0, np.pi / 2))
        X_WA = X_WA @ collide.pose((0, 0, 0), rpy=(np.pi / 4, 0, 0))
        X_WB = X_WA @ X_AB @ collide.pose((0, 0, 0), rpy=rng.normal(size=3) * 0.1)
        X_WB[:3, 3] = X_WA[:3, 3] + rng.normal(size=3)
        r = collide.distance(A, B, X_WA, X_WB)
        X_WB[:3, 3] -= (r.distance + rng.choice([1e-3, -1e-3, -1e-2])) * r.normal
        return A, B, X_WA, X_WB
    tilt = {"flush": 0.0, "tilted by 1e-9": 1e-9, "tilted by 1e-3": 1e-3}[mode]
    k = int(rng.integers(3))
    shift = rng.uniform(-0.3, 0.3, 3)
    shift[k] = (A.size[k] + B.size[k]) / 2 + rng.choice([-1e-3, -1e-6, 1e-6, 1e-3])
    about = np.zeros(3)
    about[k] = rng.uniform(-3, 3)
    X_AB = collide.pose(shift, rpy=about) @ collide.pose((0, 0, 0), rpy=rng.normal(size=3) * tilt)
    return A, B, X_WA, X_WA @ X_AB


def row_of(A, B, X_WA, X_WB, limit=np.inf):
    table = ShapeTable([convex_set_of(A), convex_set_of(B)])
    rows, a, b = np.zeros(1, dtype=PAIR_DTYPE), np.ascontiguousarray(X_WA), np.ascontiguousarray(X_WB)
    is_known = box_row(*table.addresses, address_of(a), address_of(b), limit, address_of(rows))
    return rows[0], is_known


def widest_gap(A, B, X_WA, X_WB) -> Decimal:
    """The largest gap along the 15 axes, to forty digits, less radii: minus the depth, where cores overlap."""
    sides = []
    for S, X in ((A, X_WA), (B, X_WB)):
        half = [Fraction(v) for v in half_of(S).tolist()]
        columns = [[Fraction(X[i, k]) for i in range(3)] for k in range(3)]
        sides.append([[h * v for v in column] for h, column in zip(half, columns)])
    t = [Fraction(b) - Fraction(a) for a, b in zip(X_WA[:3, 3].tolist(), X_WB[:3, 3].tolist())]
    a, b = sides
    pairs = [(p[i], p[j]) for p in (a, b) for i, j in ((0, 1), (1, 2), (2, 0))] + [(p, q) for p in a for q in b]
    getcontext().prec = 60
    best = None
    for p, q in pairs:
        c = cross(p, q)
        square = inner(c, c)  # 0 of a side without length, too
        if square == 0:
            continue
        gap = abs(inner(t, c)) - sum(abs(inner(g, c)) for g in a + b)
        root = (Decimal(square.numerator) / Decimal(square.denominator)).sqrt()
        value = Decimal(gap.numerator) / Decimal(gap.denominator) / root
        best = value if best is None else max(best, value)
    assert best is not None
    return best - sum(Decimal(float(getattr(S, "radius", 0.0))) for S in (A, B))


def test_brackets_hold_the_widest_gap():
    decided = dict.fromkeys(MODES, 0)
    for seed in range(800):
        rng = np.random.default_rng(seed)
        mode = MODES[seed % len(MODES)]
        A, B, X_WA, X_WB = boxes(rng, mode)
        where = f'boxes(np.random.default_rng({seed}), "{mode}")'
        row, known = row_of(A, B, X_WA, X_WB)
        if not known:
            continue
        decided[mode] += 1
        r = collide.distance(A, B, X_WA, X_WB)
        assert row["hit"] == r.hit and row["lower"] <= r.upper and r.lower <= row["upper"], where
        assert row["upper"] - row["lower"] < 1e-11
        n = row["normal"]
        if r.hit:
            gap = widest_gap(A, B, X_WA, X_WB)  # nearest points of cores are over a face: so it is their distance, too
            assert Decimal(float(row["lower"])) <= gap <= Decimal(float(row["upper"])), where
            moved = X_WB.copy()  # it is a way out, and none is shorter
            moved[:3, 3] -= (row["lower"] - 1e-12) * n
            assert not collide.collide(A, B, X_WA, moved), where
        else:
            assert np.abs(n - r.normal).max() < 1e-6 and abs(row["distance"] - r.distance) < 1e-13, where
        assert abs(np.linalg.norm(n) - 1.0) < 1e-15
        assert np.abs(row["point_b"] - row["point_a"] - row["distance"] * n).max() < 1e-13, where
    assert min(decided.values()) > 50 and sum(decided.values()) > 600, decided
    assert decided["flush"] > 95 and decided["capsule level"] > 75, decided


def test_points_of_round_bodies_lie_over_the_face():
    """The end of a capsule longer than the face was taken, 6 cm off a box of 10 µm: soak of pairs, case 4308."""
    decided = beyond = 0
    for seed in range(600):
        rng = np.random.default_rng(seed)
        box = collide.Box(rng.uniform(0.2, 1.0, 3) * 10.0 ** rng.uniform(-6, 0))
        other = collide.Capsule(rng.uniform(0.02, 0.2), rng.uniform(0.1, 1.5)) if seed % 3 else collide.Sphere(0.1)
        k = int(rng.integers(3))
        lying = collide.pose((0, 0, 0), rpy=(0, np.pi / 2, 0) if k == 2 else (0, 0, 0))
        X_AB = collide.pose((0, 0, 0), rpy=np.eye(3)[k] * rng.choice([0.0, np.pi / 2, 0.7])) @ lying
        X_AB[:3, 3] = rng.uniform(-0.5, 0.5, 3) * box.size + rng.uniform(-0.5, 0.5) * half_of(other)[2] * X_AB[:3, 2]
        X_AB[k, 3] = box.size[k] / 2 + other.radius + rng.choice([1e-3, 0.05, 0.8])
        X = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) if seed % 2 else np.eye(4)
        A, B, X_WA, X_WB, point = box, other, X, X @ X_AB, "point_a"
        if rng.integers(2):
            A, B, X_WA, X_WB, point = B, A, X_WB, X_WA, "point_b"
        row, known = row_of(A, B, X_WA, X_WB)
        if not known or row["hit"]:
            continue
        decided += 1
        beyond += half_of(other)[2] > max(box.size)
        outside = np.abs(X[:3, :3].T @ (row[point] - X[:3, 3])) - half_of(box)
        assert outside.max() <= 1e-14, (seed, outside)
        rows = collide.contacts(A, B, X_WA, X_WB, margin=1.0).rows
        outside = np.abs((rows[point] - X[:3, 3]) @ X[:3, :3]) - half_of(box)
        assert len(rows) and outside.max() <= 1e-13, (seed, outside)
    assert decided > 150 and beyond > 30, (decided, beyond)


def test_exchanged_rows_are_the_mirror():
    for seed in range(100):
        A, B, X_WA, X_WB = boxes(np.random.default_rng(seed), MODES[seed % len(MODES)])
        (row, known), (back, back_known) = row_of(A, B, X_WA, X_WB), row_of(B, A, X_WB, X_WA)
        assert known == back_known
        if known:
            assert np.array_equal(row["normal"], 0.0 - back["normal"])
            assert np.array_equal(row["point_a"], back["point_b"])
            assert all(row[name] == back[name] for name in ("distance", "lower", "upper", "hit"))


def test_what_is_far_or_no_rotation_is_left_alone():
    A, E = collide.Box(1, 1, 1), np.eye(4)
    row, known = row_of(A, A, E, collide.pose((3, 0, 0)), limit=0.5)
    assert known and row["beyond"] and 0.5 < row["lower"] <= 2.0
    for bad in (np.diag([1.0, 1, 1 + 1e-6, 1]), np.diag([1.0, 1, -1, 1]), np.eye(4) * np.nan, np.diag([1.0, 1, 1, 2])):
        assert not row_of(A, A, E, bad)[1]
    assert not row_of(A, A, E, collide.pose((1, 0, 0)))[1]  # touching: exact arithmetic decides
