"""Rays as users ask for them: against every facet in fractions, limits that are exact, single rays and batches."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import block_ring, box
from naive import random_pose, rng_of
from naive_triangles import cross, inner, minus, world_points

import collide

EYE = np.eye(4)


def entered(T, o, d) -> Fraction | None:
    """Least t ≥ 0 with o + t d in a closed triangle with an area, off whose plane the ray leads; else None."""
    n = cross(minus(T[1], T[0]), minus(T[2], T[0]))
    slope = inner(n, d)
    if slope == 0:
        return None
    t = inner(n, minus(T[0], o)) / slope
    x = [p + t * q for p, q in zip(o, d)]
    sides = [inner(n, cross(minus(T[(k + 1) % 3], T[k]), minus(x, T[k]))) for k in range(3)]
    return t if t >= 0 and min(sides) >= 0 else None


def fractions(v) -> list[Fraction]:
    return [Fraction(x) for x in np.asarray(v, dtype=float).tolist()]


def test_hits_are_those_of_every_facet():
    rng = rng_of("raycast")
    met = 0
    for k in range(15):
        vertices, faces = (box(), block_ring(), soup(rng, 14, 0.6))[k % 3]
        X, mesh = random_pose(rng, 0.5), collide.Mesh(vertices, faces, solid=False)
        origins, directions = rng.normal(size=(2, 8, 3)) * 2
        directions[:4] = -origins[:4] + 0.3 * rng.normal(size=(4, 3)) + X[:3, 3]
        first = collide.raycast(mesh, X, origins, directions)
        every = collide.raycast(mesh, X, origins, directions, all_hits=True)
        corners = world_points(vertices, X)
        for i in range(8):
            o, d = fractions(origins[i]), fractions(directions[i])
            ts = [(entered([corners[v] for v in face], o, d), f) for f, face in enumerate(faces.tolist())]
            want = sorted((t, f) for t, f in ts if t is not None)
            told = repr([x.tolist() for x in (vertices, faces, X, origins[i], directions[i])])
            assert first.hit[i] == every.hit[i] == bool(want), told
            rows = slice(every.starts[i], every.starts[i + 1])
            assert every.facet[rows].tolist() == [f for _, f in want], told
            for t, lower, upper, (exact, _) in zip(every.distance[rows], every.lower[rows], every.upper[rows], want):
                assert lower <= exact <= upper and lower <= t <= upper, told
            if want:
                assert first.facet[i] == want[0][1] and first.lower[i] <= want[0][0] <= first.upper[i], told
                face = vertices[faces[want[0][1]]] @ X[:3, :3].T
                n = np.cross(face[1] - face[0], face[2] - face[0])
                assert np.allclose(first.normal[i], n / np.linalg.norm(n), atol=1e-12), told
                assert np.allclose(first.point[i], origins[i] + first.distance[i] * directions[i], atol=1e-12), told
            else:
                assert first.facet[i] == -1 and first.distance[i] == np.inf and not first.normal[i].any(), told
            met += len(want)
    assert met > 60


def test_limits_are_exact():
    mesh, origin = collide.Mesh(*box()), (0.25, 0.5, 3.0)
    for factor in (1.0, 2.0, 0.1):
        direction = (0.0, 0.0, -factor)
        exact = Fraction(2) / Fraction(factor)
        rounded = float(exact)
        for limit in (np.nextafter(rounded, 0), rounded, np.nextafter(rounded, 9e9)):
            r = collide.raycast(mesh, EYE, origin, direction, max_distance=limit)
            assert r.hit == (exact <= Fraction(limit)), (factor, limit)


def test_single_rays_and_batches():
    mesh = collide.Mesh(*box())
    one = collide.raycast(mesh, EYE, (0, 0.25, 3), (0, 0, -1))
    assert isinstance(bool(one.hit), bool) and one.point.shape == (3,) and np.ndim(one.distance) == 0
    assert one.distance == 2.0 and one.starts is None
    many = collide.raycast(mesh, np.stack([EYE] * 3), (0, 0.25, 3), [(0, 0, -1), (0, 0, 1), (0, 0, -2)])
    assert many.hit.tolist() == [True, False, True] and many.distance.tolist() == [2.0, np.inf, 1.0]
    for bad, words in (((0, 0, 0), "length 0"), ((np.nan, 0, 1), "finite"), ((1e-200, 0, 0), "no component")):
        with pytest.raises(collide.InvalidArgument, match=words):
            collide.raycast(mesh, EYE, (0, 0, 0), bad)
    with pytest.raises(collide.InvalidArgument, match="lengths do not match"):
        collide.raycast(mesh, EYE, np.zeros((2, 3)), np.ones((3, 3)))
