"""The table of widths in docs/accuracy.md, held against the engine: what the page promises is read from the page.

Every pair of kinds with a cylinder, cone or ellipsoid, with shapes and poses drawn here and nowhere else. Where a
formula
or a polytope gives the truth, brackets are judged by it, too: a ball, a ball's sweep along the axis, half-spaces.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import naive
import numpy as np
import pytest

import collide

PAGE = Path(__file__).resolve().parents[2] / "docs" / "accuracy.md"
CURVED = ("cylinder", "cone", "ellipsoid")
KINDS = ("sphere", "capsule", "box", "hull", "half-space", *CURVED)
COLUMNS = ("gap", "gap nearly in line", "depth", "depth in line")
#: No promise may be weaker than this.
WIDEST = {"gap": 2.0**-26, "gap nearly in line": 2.0**-22, "depth": 2.0**-26, "depth in line": 2.0**-16}
POSES = 120
#: Of the depths in arbitrary poses this part may be wider, and must then be uncertified: as the page says.
UNFINISHED = 0.01
ULP = 2.0**-52

_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def promised() -> dict[tuple[str, str], dict[str, float]]:
    """(kind, kind) → column → width in units of S, from the page; NaN where nothing is promised."""
    text = PAGE.read_text(encoding="utf-8")
    _, _, table = text.partition("| A | B |")
    found = {}
    for line in table.splitlines()[2:]:
        if not line.startswith("|"):
            break
        a, b, *cells = (cell.strip() for cell in line.strip("| ").split("|"))
        assert len(cells) == len(COLUMNS), line
        values = [re.fullmatch(r"2([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", cell) for cell in cells]
        widths = [2.0 ** int(v[1].translate(_POWERS)) if v else math.nan for v in values]
        found[a, b] = dict(zip(COLUMNS, widths))
    return found


TABLE = promised()


def shape_of(kind: str, rng) -> tuple[collide.Shape, float]:
    """(a shape with lengths of 0.05 to 1 m, what it adds to S [m])."""
    a, b, c = (float(x) for x in 0.05 * 20.0 ** rng.random(3))
    if kind == "sphere":
        return collide.Sphere(a / 2), a / 2
    if kind == "capsule":
        return collide.Capsule(a / 2, b), a / 2 + b / 2
    if kind == "box":
        return collide.Box((a, b, c)), math.hypot(a, b, c) / 2
    if kind == "hull":
        points = naive.hull_points(rng, 16) * (a / 3, b / 3, c / 3)
        return collide.ConvexHull(points), float(np.linalg.norm(points, axis=1).max())
    if kind == "half-space":
        return collide.Halfspace((0.0, 0.0, 1.0), 0.0), 0.0
    if kind == "ellipsoid":
        return collide.Ellipsoid((a / 2, b / 2, c / 2)), max(a, b, c) / 2
    return {"cylinder": collide.Cylinder, "cone": collide.Cone}[kind](a / 2, b), math.hypot(a, b) / 2


def pose_of(column: str, kind: str, reach: float, rng) -> np.ndarray:
    """X_AB, with and without an overlap; a half-space is missed only by what stands well above it."""
    step = rng.uniform(0.02, 4.0 if kind == "half-space" else 1.3) * reach
    if column in ("gap", "depth"):
        return naive.pose(naive.rotation(rng), naive.unit(rng.normal(size=3)) * step)
    X = naive.pose(
        np.diag([1.0, 1.0, 1.0] if rng.random() < 0.5 else [-1.0, 1.0, -1.0]), (0, 0, rng.choice([-1, 1]) * step)
    )
    if column == "gap nearly in line":
        tilt, shift, turn = 10.0 ** rng.uniform(-11, -1), 10.0 ** rng.uniform(-11, -1), rng.uniform(0, 2 * np.pi)
        c, s = math.cos(tilt), math.sin(tilt)
        around = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
        X[:3, :3] = around @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ X[:3, :3]
        X[0, 3] += shift * reach
    return X


def test_the_page_has_every_pair():
    assert set(TABLE) == {(a, b) for k, a in enumerate(CURVED) for b in (*KINDS[:5], *CURVED[k:])}
    for pair, widths in TABLE.items():
        for column, width in widths.items():
            assert math.isnan(width) == ("half-space" in pair and column == "gap nearly in line"), (pair, column)
            assert not width > WIDEST[column], (pair, column)


@pytest.mark.many(6)
@pytest.mark.parametrize("pair", TABLE, ids="-".join)
def test_brackets_keep_the_promised_width(pair):
    rng = naive.rng_of("promised", *pair)
    for column, width in TABLE[pair].items():
        if math.isnan(width):
            continue
        cases, sizes = [], []
        for _ in range(POSES):
            (A, size_a), (B, size_b) = shape_of(pair[0], rng), shape_of(pair[1], rng)
            X_WA, X_AB = naive.random_pose(rng), pose_of(column, pair[1], size_a + size_b, rng)
            cases.append(naive.Case(A, B, X_WA, X_WA @ X_AB))
            sizes.append(size_a + size_b + float(np.linalg.norm(cases[-1].X_WB[:3, 3] - X_WA[:3, 3])))
        A, B, X_WA, X_WB = zip(*cases)
        r = collide.distance(list(A), list(B), np.array(X_WA), np.array(X_WB))
        wanted = r.hit if column.startswith("depth") else ~r.hit
        relative = (r.upper - r.lower) / np.array(sizes)
        too_wide = np.flatnonzero(wanted & (relative > width))
        assert wanted.sum() >= POSES // 10, f"{column}: {wanted.sum()} of {POSES} poses"
        allowed = UNFINISHED * POSES if column == "depth" else 0
        told = "".join(naive.snippet(cases[k]) for k in too_wide[:1])
        assert len(too_wide) <= allowed, f"{column} of {pair}: {relative[too_wide]} against {width:.1e}\n{told}"
        assert not r.certified[too_wide].any(), f"wider than promised, and certified\n{told}"


# --- brackets against formulas ----------------------------------------------------------------------


def cylinder_and_point(radius: float, length: float, p) -> float:
    """Signed distance of a point from a cylinder, from the rectangle that it turns: negative inside."""
    outside = np.array([math.hypot(p[0], p[1]) - radius, abs(p[2]) - length / 2])
    return float(np.linalg.norm(np.maximum(outside, 0)) + min(outside.max(), 0.0))


def cone_and_point(radius: float, length: float, p) -> float:
    """The same for a cone: from its half-plane's triangle, apex on the axis."""
    apex, rim, base = np.array([0.0, length / 2]), np.array([radius, -length / 2]), np.array([0.0, -length / 2])
    q = np.array([math.hypot(p[0], p[1]), p[2]])

    def off(start, end):
        along = min(max(np.dot(q - start, end - start) / np.dot(end - start, end - start), 0.0), 1.0)
        return float(np.linalg.norm(q - start - along * (end - start)))

    side = np.array([length, radius]) / math.hypot(radius, length)
    inside = max(float(np.dot(q - apex, side)), base[1] - q[1])
    return inside if inside <= 0 else min(off(apex, rim), off(rim, base))


POINT_DISTANCES = {"cylinder": cylinder_and_point, "cone": cone_and_point}


@pytest.mark.parametrize("kind", POINT_DISTANCES)
def test_balls_by_the_formula(kind):
    """A ball's signed distance is its centre's less its radius, on the axis and off it."""
    rng = naive.rng_of("balls", kind)
    hits = []
    for k in range(300):
        (A, reach), (B, radius) = shape_of(kind, rng), shape_of("sphere", rng)
        p = rng.uniform(-1, 1, 3) * reach * (1, 1, 1.5) * ((0, 0, 1) if k % 5 == 0 else (1, 1, 1))
        truth = POINT_DISTANCES[kind](A.radius, A.length, p) - radius
        case = naive.Case(A, B, np.eye(4), naive.pose(t=p))
        with naive.reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            slack = 16 * ULP * (reach + radius + float(np.linalg.norm(p)))
            assert r.lower - slack <= truth <= r.upper + slack, f"{r.lower!r} ≤ {truth!r} ≤ {r.upper!r}"
    assert 0.2 < naive.share(hits) < 0.9


def test_half_spaces_by_the_formula():
    """The support of a curved body along a direction has a formula, and a half-space asks for nothing else."""
    rng = naive.rng_of("half-spaces")
    hits = []
    for k in range(300):
        kind = CURVED[k % 3]
        B, reach = shape_of(kind, rng)
        n, offset, p = naive.unit(rng.normal(size=3)), rng.uniform(-0.3, 0.3), rng.uniform(-0.6, 0.6, 3)
        if kind == "ellipsoid":
            extent = math.hypot(*(B.radii * n))
        else:
            rim = B.radius * math.hypot(n[0], n[1])
            extent = (
                B.length / 2 * abs(n[2]) + rim
                if kind == "cylinder"
                else max(-n[2] * B.length / 2, n[2] * B.length / 2 + rim)
            )
        length = float(np.linalg.norm(n))
        truth = (float(np.dot(n, p)) - offset - extent) / length
        case = naive.Case(collide.Halfspace(n, offset), B, np.eye(4), naive.pose(t=p))
        with naive.reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            slack = 16 * ULP * (reach + abs(offset) + float(np.linalg.norm(p)))
            assert r.lower - slack <= truth <= r.upper + slack, f"{r.lower!r} ≤ {truth!r} ≤ {r.upper!r}"
            assert r.certified
    assert 0.2 < naive.share(hits) < 0.9
