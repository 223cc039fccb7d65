"""Intersections of half-spaces: vertices by all triples of planes in fractions; empty and unbounded ones are told."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from naive import rng_of, unit
from naive_triangles import cross, inner

from collide import HPolytope, InvalidShape

CUBE = np.concatenate([np.eye(3), -np.eye(3)])


def vertices_of(normals, offsets) -> list[list[Fraction]]:
    """Where three planes cross in a point that no half-space cuts off."""
    N = [[Fraction(x) for x in row] for row in np.asarray(normals, dtype=float).tolist()]
    d = [Fraction(x) for x in np.asarray(offsets, dtype=float).tolist()]
    found = []
    for i, j, k in combinations(range(len(N)), 3):
        determinant = inner(N[i], cross(N[j], N[k]))
        if determinant == 0:
            continue
        parts = zip(cross(N[j], N[k]), cross(N[k], N[i]), cross(N[i], N[j]))
        x = [(d[i] * a + d[j] * b + d[k] * c) / determinant for a, b, c in parts]
        if x not in found and all(inner(n, x) <= e for n, e in zip(N, d)):
            found.append(x)
    return found


def test_vertices_are_those_of_all_triples_rounded_once():
    rng = rng_of("hpolytope")
    seen: Counter = Counter()
    for case in range(40):
        if case % 2:
            more = rng.integers(-2, 3, (4, 3)) * 1.0
            more = more[more.any(axis=1)]
        else:
            more = np.array([unit(v) * 10.0 ** rng.integers(-3, 4) for v in rng.normal(size=(4, 3))])
        normals = np.concatenate([CUBE, more])
        lengths = np.linalg.norm(normals, axis=1)
        offsets = np.rint(rng.uniform(-0.4, 2, len(normals)) * 8) / 8 * (lengths if case % 2 == 0 else 1.0)
        known = vertices_of(normals, offsets)
        told = f"HPolytope({normals.tolist()}, {offsets.tolist()})"
        if not known:
            with pytest.raises(InvalidShape, match="empty"):
                HPolytope(normals, offsets)
            seen["empty"] += 1
            continue
        shape = HPolytope(normals, offsets)
        assert sorted(shape.vertices.tolist()) == sorted([float(x) for x in v] for v in known), told
        off = max(
            min(sum((Fraction(a) - b) ** 2 for a, b in zip(v, w)) for w in known) for v in shape.vertices.tolist()
        )
        assert off <= Fraction(shape.slop) ** 2, told
        assert not shape.vertices.flags.writeable
        seen["rounded" if off else "exact"] += 1
    assert min(seen[what] for what in ("empty", "rounded", "exact")) >= 3, seen


def test_what_is_no_polytope():
    with pytest.raises(InvalidShape, match="unbounded in direction") as told:
        HPolytope(CUBE[:5], np.ones(5))
    assert "-" in str(told.value)
    with pytest.raises(InvalidShape, match=r"normals\[1\] is zero"):
        HPolytope([[1, 0, 0], [0, 0, 0]], [1, 1])
    with pytest.raises(InvalidShape, match="offsets must have shape"):
        HPolytope(CUBE, np.ones(5))
    with pytest.raises(InvalidShape, match="empty"):
        HPolytope(CUBE, [1, 1, 1, -2, 1, 1])
    with pytest.raises(InvalidShape, match="a vertex lies beyond"):  # at 1e350: beyond doubles, too
        HPolytope(CUBE * 1e-300, np.full(6, 1e50))


def test_flat_and_single_points_are_polytopes():
    square = HPolytope(CUBE, [1, 1, 0, 1, 1, 0])
    assert sorted(square.vertices.tolist()) == [[x, y, 0] for x in (-1, 1) for y in (-1, 1)]
    assert HPolytope(CUBE, np.zeros(6)).vertices.tolist() == [[0.0, 0.0, 0.0]]
