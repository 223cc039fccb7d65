"""Rows of bodies of facets and their brackets: against all pairs of triangles in fractions, radii and limits added."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import naive
import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import box, bumpy_sphere
from naive import random_pose, rng_of, unit
from naive_triangles import surface_distance, winding, world_points

import collide
from collide.kernels import address_of
from collide.lowering.facet_bodies import body_of
from collide.narrowphase import rows
from collide.narrowphase.facets import surface_distance as layout
from collide.narrowphase.facets.facet_kernel_calls import body_rows
from collide.narrowphase.facets.mesh_distance_kernel import _set_bracket, _step, _unit_or_z
from collide.numerics.vec3 import Vec3
from collide.results import PAIR_DTYPE

#: Segments and points as triangles: cores of swept bodies.
DEGENERATE = np.array([[0, 0, 0]]), np.array([[0, 1, 1]])


def bodies(rng, k: int):
    """(mesh, its vertices and facets, other body, vertices and facets of its core, its radius)."""
    given = (box(), bumpy_sphere(16, k), soup(rng, 8, 0.6))[k % 3]
    mesh = collide.Mesh(*given, solid=False)
    radius = float(rng.uniform(0.05, 0.4))
    others = (
        (collide.Sphere(radius), np.zeros((1, 3)), DEGENERATE[0], radius),
        (collide.Capsule(radius, 0.75), np.array([[0.0, 0, -0.375], [0, 0, 0.375]]), DEGENERATE[1], radius),
        (mesh, *given, 0.0),
        (collide.Box((0.5, 0.5, 1.0)), *box((-0.25, -0.25, -0.5), (0.25, 0.25, 0.5)), 0.0),
    )
    return mesh, given, *others[int(rng.integers(4))]


@pytest.mark.parametrize("limit", [math.inf, 0.3])
def test_brackets_hold_what_brute_force_finds(limit):
    rng = rng_of("surface gaps", limit)
    seen: Counter = Counter()
    for k in range(48):
        A, (va, fa), B, vb, fb, radius = bodies(rng, k)
        X, Y = random_pose(rng, 0.2), random_pose(rng, 0.2)
        Y[:3, 3] += unit(rng.normal(size=3)) * rng.uniform(0.5, 3.0)
        (row,) = body_rows(body_of(A), body_of(B), X[None], Y[None], limit=limit, depths=False)
        square, pairs = surface_distance(va, fa, X, vb, fb, Y)
        told = f"{naive.spell(X)}, {naive.spell(Y)}, case {k}: {row}"
        gap = math.sqrt(square) - radius
        if row["hit"]:
            inside = False
            if isinstance(B, collide.Box) and square > 0:
                inside = inside_of(vb, fb, Y, va, X)
            assert gap <= 0 or inside, told
            assert row["distance"] <= 0 and row["upper"] <= 0, told
        elif row["beyond"]:
            assert gap > limit and row["lower"] <= gap and row["lower"] > limit, told
        else:
            lower, upper = (Fraction(float(row[name])) + Fraction(radius) for name in ("lower", "upper"))
            assert lower**2 <= square <= upper**2 and row["lower"] <= row["distance"] <= row["upper"], told
            between = row["point_b"] - row["point_a"]
            assert np.allclose(between, row["distance"] * row["normal"], atol=1e-12), told
            assert np.linalg.norm(row["normal"]) == pytest.approx(1.0, abs=1e-12), told
            if len(pairs) == 1 and A is not B and not isinstance(B, collide.Box) and gap > 1e-9:
                assert int(row["part_a"]) == pairs[0][0], told
        name = "hit" if row["hit"] else "beyond" if row["beyond"] else "gap"
        seen[name] += 1
    assert seen["hit"] >= 5 and seen["gap"] >= 5 and (seen["beyond"] >= 10) == (limit < math.inf), seen


def inside_of(vertices, faces, X, points, Y) -> bool:
    """Whether the first of the points lies in a closed surface."""
    corners, (p,) = naive_integers(vertices, X, points[:1], Y)
    return bool(winding([[corners[v] for v in face] for face in np.asarray(faces).tolist()], p))


def naive_integers(vertices, X, points, Y):
    exact = world_points(vertices, X), world_points(points, Y)
    denominator = max(x.denominator for group in exact for point in group for x in point)
    return ([[int(x * denominator) for x in point] for point in group] for group in exact)


@pytest.mark.plain_kernels
def test_steps_go_to_the_next_double():
    row = np.zeros(1, dtype=PAIR_DTYPE)
    numbers = row.view(np.float64)
    for value in (1.0, 5e-324, 1e300, 0.1, math.inf, 0.0, -1.0):
        for up in (True, False):
            numbers[rows.LOWER] = value
            _step(address_of(row), rows.LOWER, up)
            wanted = math.nextafter(value, math.inf if up else 0.0)
            if not up and value == math.inf:
                wanted = math.inf
            elif value < 0.0 or (not up and value == 0.0):
                wanted = 0.0
            assert numbers[rows.LOWER] == wanted, (value, up)
    for v in ((3.0, 0.0, 4.0), (1e-200, 0.0, 0.0)):
        n = _unit_or_z(Vec3(*v))
        assert math.hypot(*n) == pytest.approx(1.0) or max(v) < 1e-160
    assert _unit_or_z(Vec3(0.0, 0.0, 0.0)) == (0.0, 0.0, 1.0)


@pytest.mark.plain_kernels
def test_brackets_of_swept_bodies_are_rounded_outwards():
    rng = rng_of("brackets of swept bodies")
    row, result = np.zeros(1, dtype=PAIR_DTYPE), np.zeros(layout.RESULT)
    numbers = row.view(np.float64)
    for k in range(300):
        core, radius = float(rng.uniform(0, 2)), float(rng.choice([0.0, 0.1, rng.uniform(0, 2)]))
        if k % 5 == 0:
            core = radius
        result[layout.DISTANCE], result[layout.LOWER] = core, core * (1 - 2.0**-50 * (k % 3))
        result[layout.UPPER] = core * (1 + 2.0**-50 * (k % 2))
        _set_bracket(address_of(row), result, radius)
        lower, distance, upper = (numbers[field] for field in (rows.LOWER, rows.DISTANCE, rows.UPPER))
        told = (result.tolist(), radius, lower, distance, upper)
        assert Fraction(lower) <= max(Fraction(result[layout.LOWER]) - Fraction(radius), 0), told
        if upper > 0.0 or result[layout.UPPER] >= radius:
            assert Fraction(upper) >= Fraction(result[layout.UPPER]) - Fraction(radius), told
        assert lower <= distance <= upper, told
