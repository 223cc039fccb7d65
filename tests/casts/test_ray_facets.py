"""Rays against facets, each by its own exact formula: through edges and corners, in planes, from the surface."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import block_ring, box
from naive import LATTICE_ROTATIONS, pose, rng_of
from reproduction import reproducing

import collide
from collide.casts.cast_arguments import checked_rays
from collide.casts.ray_facets import _running_ends, facets_met
from collide.lowering.facet_bodies import body_of


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def minus(a, b):
    return [x - y for x, y in zip(a, b)]


def entry(triangle, o, d) -> Fraction | None:
    """The least t ≥ 0 at which o + t d is in a closed triangle with an area, in Fractions."""
    a, b, c = triangle
    n = cross(minus(b, a), minus(c, a))
    rate, height = dot(n, d), dot(n, minus(a, o))
    first, last = Fraction(0), None
    if rate != 0:
        t = Fraction(height) / rate
        if t < 0:
            return None
        first = last = t
    elif height != 0:
        return None
    for p, q in ((a, b), (b, c), (c, a)):  # inwards of each edge
        m = cross(n, minus(q, p))
        level, pace = dot(m, minus(o, p)), dot(m, d)
        if pace == 0:
            if level < 0:
                return None
        elif pace > 0:
            first = max(first, -level / pace)
        else:
            last = -level / pace if last is None else min(last, -level / pace)
    return first if last is None or first <= last else None


def corners_in_world(mesh, X) -> list:
    world = mesh.vertices @ X[:3, :3].T + X[:3, 3]  # exact of lattice poses
    return [[[Fraction(v) for v in world[k].tolist()] for k in face] for face in mesh.faces.tolist()]


MESHES = {"box": collide.Mesh(*box()), "ring": collide.Mesh(*block_ring())}


@pytest.mark.many(2)
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("every", [False, True])
def test_facets_are_those_of_the_formula(name, every):
    rng, seen = rng_of("ray facets", name, every), Counter()
    mesh = MESHES[name]
    for _ in range(4):
        X = pose(LATTICE_ROTATIONS[int(rng.integers(24))], rng.integers(-2, 3, 3) * 0.25)
        o, at = rng.integers(-8, 9, (10, 3)) * 0.25, X[:3, 3] + rng.integers(-3, 4, (10, 3)) * 0.5
        d = np.where((at == o).all(axis=1, keepdims=True), (0.0, 1.0, 0.0), at - o)
        limit = float(rng.choice([math.inf, 1.0]))
        origins, directions, _ = checked_rays("raycast", o, d)
        triangles = corners_in_world(mesh, X)
        with reproducing("X, o, d = {X}, {o}, {d}  # tests/casts/test_ray_facets.py", X=X, o=o, d=d):
            events = facets_met(body_of(mesh), X[None], origins, directions, limit, every)
            expected = []
            for k in range(10):
                start, step = ([Fraction(v) for v in w.tolist()] for w in (o[k], d[k]))
                met = [(entry(t, start, step), f) for f, t in enumerate(triangles)]
                met = sorted((t, f) for t, f in met if t is not None and t <= limit)
                expected += [(k, t, f) for t, f in (met if every else met[:1])]
                seen[min(len(met), 3)] += 1
            assert list(zip(events.ray.tolist(), events.facet.tolist())) == [(k, f) for k, _, f in expected]
            for (_, t, f), (value, lower, upper), n in zip(expected, events.t.tolist(), events.normal):
                assert Fraction(lower) <= t <= Fraction(upper) and lower <= value <= upper
                a, b, c = (np.array([float(v) for v in p]) for p in triangles[f])
                outward = np.cross(b - a, c - a)
                np.testing.assert_allclose(n, outward / np.linalg.norm(outward), rtol=0, atol=1e-14)
            assert events.proven.all() and events.certified.all() and not events.item.any()
    assert seen[0] > 3 and seen[3] > 2, seen


def test_first_hits_have_the_digits_of_all_hits():
    rng = rng_of("first of all facets")
    mesh = MESHES["ring"]
    X = np.array([pose(t=rng.normal(size=3) * 0.1) for _ in range(20)])
    o = rng.normal(size=(20, 3)) * 3
    origins, directions, _ = checked_rays("raycast", o, -o + 0.4 * rng.normal(size=(20, 3)))
    every, first = (facets_met(body_of(mesh), X, origins, directions, math.inf, flag) for flag in (True, False))
    rows = np.flatnonzero(np.diff(every.ray, prepend=-1))
    assert len(rows) > 8
    for one, other in zip(first, every.of(rows)):
        assert one.tobytes() == other.tobytes()


def test_a_limit_cuts_off_exactly():
    mesh, ulp = MESHES["box"], np.nextafter(2.0, 0)
    origins, directions, _ = checked_rays("raycast", (-3, 0.3, 0.2), (1, 0, 0))
    for limit, n in ((2.0, 1), (ulp, 0), (4.0, 2), (np.nextafter(4.0, 0), 1), (0.0, 0)):
        assert len(facets_met(body_of(mesh), np.eye(4)[None], origins, directions, limit, True).ray) == n
    on_wall, directions, _ = checked_rays("raycast", (-1, 0.3, 0.2), (-1, 0, 0))
    assert facets_met(body_of(mesh), np.eye(4)[None], on_wall, directions, 0.0, True).t.tolist() == [[0.0, 0.0, 0.0]]


def test_running_ends():
    rng = rng_of("running ends")
    for n in (0, 1, 2, 17, 64):
        ray, upper = np.sort(rng.integers(0, 5, n)), rng.normal(size=n)
        expected = [max(upper[i] for i in range(k + 1) if ray[i] == ray[k]) for k in range(n)]
        assert _running_ends(ray, upper).tolist() == expected
