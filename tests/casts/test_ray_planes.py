"""Rays against regions of half-spaces, clipped by every plane in Fractions."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, pose, rng_of
from reproduction import reproducing

import collide
from collide.casts.cast_arguments import checked_rays
from collide.casts.ray_planes import planes_met

SOURCE = "normals, offsets, X, o, d = {normals}, {offsets}, {X}, {o}, {d}"


def naive_places(normals, offsets, X, o, d) -> list[tuple[Fraction, int]]:
    """(t, row) where a ray meets the surface: lattice poses keep everything exact."""
    R = X[:3, :3]
    start, step = [[Fraction(v) for v in (R.T @ w).tolist()] for w in (o - X[:3, 3], d)]
    enters = leaves = along = None
    for row, (n, b) in enumerate(zip(normals.tolist(), offsets.tolist())):
        height = Fraction(b) - sum(Fraction(x) * y for x, y in zip(n, start))
        rate = sum(Fraction(x) * y for x, y in zip(n, step))
        if rate == 0:
            if height < 0:
                return []
            if height == 0 and along is None:
                along = row
        elif rate < 0:
            enters = max([enters or (height / rate, row), (height / rate, row)], key=lambda e: (e[0], -e[1]))
        else:
            leaves = min([leaves, (height / rate, row)]) if leaves else (height / rate, row)
    if leaves and (leaves[0] < 0 or (enters and enters[0] > leaves[0])):
        return []
    places = []
    if along is not None:
        t = max(enters[0], Fraction(0)) if enters else Fraction(0)
        places.append((t, min(along, enters[1]) if enters and enters[0] == t else along))
    elif enters and enters[0] >= 0:
        places.append(enters)
    if leaves and not (places and places[0][0] == leaves[0]):
        places.append(leaves)
    return places


def drawn(rng, kind: str):
    n = int(rng.integers(2, 9))
    if kind == "lattice":
        normals = rng.integers(-1, 2, (n, 3)).astype(float)
        normals[~normals.any(axis=1)] = (0, 0, 1)
        return normals, rng.integers(0, 4, n).astype(float)
    return rng.normal(size=(n, 3)), rng.uniform(0.1, 1.0, n)


@pytest.mark.parametrize("kind", ["lattice", "random"])
@pytest.mark.parametrize("every", [False, True])
def test_places_are_those_of_all_planes(kind, every):
    """Along planes, through edges and corners, from the surface, from inside and outside."""
    rng, seen = rng_of("ray planes", kind, every), Counter()
    for _ in range(25):
        normals, offsets = drawn(rng, kind)
        region = collide.HPolytope(normals, offsets, bounded=False)
        X = pose(LATTICE_ROTATIONS[int(rng.integers(24))], rng.integers(-3, 4, 3) * 0.5)
        if kind == "random":
            X[:3, 3] = 0.0
        o, d = rng.integers(-6, 7, (8, 3)) * 0.5, rng.integers(-2, 3, (8, 3)).astype(float)
        d[~d.any(axis=1)] = (1, 0, 0)
        limit = float(rng.choice([math.inf, 2.0]))
        origins, directions, _ = checked_rays("raycast", o, d)
        with reproducing(SOURCE, normals=normals, offsets=offsets, X=X, o=o, d=d):
            events = planes_met(region, X[None], origins, directions, limit, every=every)
            expected = []
            for k in range(8):
                places = naive_places(region.normals, region.offsets, X, o[k], d[k])
                expected += [(k, t, row) for t, row in (places if every else places[:1]) if t <= limit]
                seen[len(places)] += 1
            assert list(zip(events.ray.tolist(), events.facet.tolist())) == [(k, row) for k, _, row in expected]
            for (_, t, row), (value, lower, upper), n in zip(expected, events.t.tolist(), events.normal):
                assert Fraction(lower) <= t <= Fraction(upper) and lower <= value <= upper <= lower + 1e-12
                outward = X[:3, :3] @ (region.normals[row] / np.linalg.norm(region.normals[row]))
                np.testing.assert_allclose(n, outward, rtol=0, atol=1e-14)
            assert events.proven.all() and events.certified.all() and not events.item.any()
    assert all(seen[k] > 10 for k in range(3)), seen


def test_poses_go_with_rays():
    region = collide.HPolytope([(0, 0, 1)], [0.0], bounded=False)
    X = np.array([collide.pose((0, 0, z)) for z in (0.0, 1.0, 2.0)])
    origins, directions, _ = checked_rays("raycast", np.array([(0, 0, 5.0)] * 3), (0, 0, -1))
    events = planes_met(region, X, origins, directions, math.inf, every=False)
    assert events.t[:, 0].tolist() == [5.0, 4.0, 3.0] and events.normal.tolist() == [[0.0, 0.0, 1.0]] * 3
    nothing = planes_met(region, X, origins[:0], directions.repeated(3)._replace(
        vectors=directions.vectors[:0], exponents=directions.exponents[:0]), math.inf, every=True)
    assert len(nothing.ray) == 0 and nothing.t.shape == (0, 3) and nothing.normal.shape == (0, 3)
