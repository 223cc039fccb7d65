"""Vertices of half-spaces' intersections, against every triple of planes in Fractions."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from exact_simplex import exact, inner, solved
from naive import rng_of
from reproduction import reproducing

from collide.hull.double_description import halfspace_vertices

SOURCE = (
    "from collide.hull.double_description import halfspace_vertices\nimport numpy as np\n"
    "print(halfspace_vertices(np.array({n}), np.array({b})))"
)


def corners_of(normals, offsets) -> set[tuple[Fraction, ...]]:
    """The points of three independent planes that no half-space excludes."""
    rows, right = exact(normals), [Fraction(b) for b in offsets.tolist()]
    found = set()
    for chosen in combinations(range(len(rows)), 3):
        x = solved([list(rows[k]) for k in chosen], [right[k] for k in chosen])
        if x is not None and all(inner(n, x) <= b for n, b in zip(rows, right)):
            found.add(tuple(x))
    return found


def random_planes(rng, kind: str) -> tuple[np.ndarray, np.ndarray]:
    m = int(rng.integers(1, 5 if kind == "boxed" else 9))
    if kind == "lattice":
        normals, offsets = rng.integers(-2, 3, size=(m, 3)) * 1.0, rng.integers(-2, 4, size=m) * 0.5
    else:
        normals, offsets = rng.normal(size=(m, 3)), rng.normal(size=m) + 0.7
    keep = normals.any(axis=1)
    normals, offsets = normals[keep], offsets[keep]
    if kind == "boxed":
        normals, offsets = (
            np.concatenate([normals, np.eye(3), -np.eye(3)]),
            np.concatenate([offsets, rng.uniform(0.1, 1, 6)]),
        )
    if not len(normals):
        return np.eye(3)[:1], np.ones(1)
    return normals, offsets


def float_of(value: Fraction) -> float:
    try:
        return float(value)  # rounds to nearest
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def is_way_out(direction, normals) -> bool:
    """No half-space bounds the direction, but for its rounding."""
    return bool((normals @ direction <= 1e-12 * np.abs(normals).sum(axis=1)).all()) and np.abs(direction).max() == 1.0


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["lattice", "random", "boxed"])
def test_vertices(kind):
    rng = rng_of("double description", kind)
    seen: Counter = Counter()
    for _ in range(80):
        normals, offsets = random_planes(rng, kind)
        with reproducing(SOURCE, n=normals, b=offsets):
            vertices, slop, way_out = halfspace_vertices(normals, offsets)
            if way_out is not None:
                assert is_way_out(way_out, normals)
                seen["unbounded"] += 1
                continue
            true = corners_of(normals, offsets)
            assert len(vertices) == len(true)
            seen["empty" if not true else "bounded"] += 1
            for vertex in exact(vertices):
                apart = min(sum(((x - y) ** 2 for x, y in zip(vertex, corner)), Fraction(0)) for corner in true)
                assert apart <= Fraction(slop) ** 2
            seen["rounded"] += slop > 0.0
    wanted = {
        "lattice": ("unbounded", "empty", "bounded"),
        "random": ("unbounded", "bounded", "rounded"),
        "boxed": ("bounded", "rounded"),
    }
    assert min(seen[what] for what in wanted[kind]) >= 5, seen


def test_flat_sets_have_their_corners():
    """Two half-spaces back to back hold a polygon, one a point."""
    square = np.concatenate([np.eye(3), -np.eye(3)])
    assert len(halfspace_vertices(square, np.array([1.0, 1.0, 0.5, 1.0, 1.0, -0.5]))[0]) == 4
    vertices, slop, way_out = halfspace_vertices(square, np.array([1.0, 2.0, 0.5, -1.0, -2.0, -0.5]))
    assert vertices.tolist() == [[1.0, 2.0, 0.5]] and slop == 0.0 and way_out is None


def test_few_planes_are_unbounded_or_empty():
    """Normals that span less than space: a slab, a wedge, and a slab of negative width."""
    up = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    _, _, way_out = halfspace_vertices(up, np.array([1.0, 1.0]))
    assert way_out is not None and way_out[2] == 0.0
    vertices, _, way_out = halfspace_vertices(up, np.array([-1.0, -1.0]))
    assert len(vertices) == 0 and way_out is None
    wedge = np.array([(1.0, 1.0, 0.0), (1.0, -1.0, 0.0)])
    assert is_way_out(halfspace_vertices(wedge, np.array([1.0, 1.0]))[2], wedge)


def test_corners_are_quotients_rounded_once():
    """The corners of boxes are quotients of doubles: rounded to nearest, among the smallest and beyond the largest."""
    rng = rng_of("quotients of boxes")
    seen: Counter = Counter()
    for _ in range(300):
        ends = rng.normal(size=(2, 3)) * 2.0 ** rng.choice([0, 0, -600, 600], 3)
        ends, lengths = np.sort(ends, axis=0), np.abs(rng.normal(size=3)) * 2.0 ** rng.choice([0, 0, -440, 440], 3)
        normals = np.concatenate([np.diag(lengths), -np.diag(lengths)])
        offsets = np.concatenate([ends[1], -ends[0]])
        with reproducing(SOURCE, n=normals, b=offsets):
            vertices, slop, way_out = halfspace_vertices(normals, offsets)
            assert way_out is None and len(vertices) == 8
            for axis in range(3):
                true = [float_of(Fraction(float(end)) / Fraction(float(lengths[axis]))) for end in ends[:, axis]]
                assert {*vertices[:, axis].tolist()} == {*true}
                for x in true:
                    seen["infinite" if np.isinf(x) else "subnormal" if abs(x) < 2.0**-1022 else "normal"] += 1
            assert slop > 0.0
    assert min(seen[what] for what in ("infinite", "subnormal", "normal")) >= 20, seen
