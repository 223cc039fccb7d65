"""Vertices of an H-polytope against cddlib (K. Fukuda's double description in rational numbers, by `pycddlib`)."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from collide import HPolytope

cdd = pytest.importorskip("cdd", reason="pycddlib is not installed: pip install pycddlib (it needs GMP to build)")


def cdd_vertices(normals, offsets) -> set[tuple[Fraction, ...]]:
    """The vertices of {x : normals @ x ≤ offsets}, exactly."""
    rows = [[Fraction(b), *(-Fraction(x) for x in n)] for n, b in zip(normals.tolist(), offsets.tolist())]
    if hasattr(cdd, "Matrix"):  # pycddlib 2
        matrix = cdd.Matrix(rows, number_type="fraction")
        matrix.rep_type = cdd.RepType.INEQUALITY
        generators = list(cdd.Polyhedron(matrix).get_generators())
    else:
        gmp = pytest.importorskip("cdd.gmp", reason="this build of pycddlib has no rational numbers")
        matrix = gmp.matrix_from_array(rows, rep_type=cdd.RepType.INEQUALITY)
        generators = gmp.copy_generators(gmp.polyhedron_from_matrix(matrix)).array
    assert all(g[0] == 1 for g in generators), "the polytope has no end"
    return {tuple(map(Fraction, g[1:])) for g in generators}


def box(size: float) -> tuple[np.ndarray, np.ndarray]:
    return np.vstack([np.eye(3), -np.eye(3)]), np.full(6, size)


def families(rng) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Normals and offsets: simple and degenerate corners, implied planes, thin and flat polytopes, and a point."""
    sides, faces = box(1.0)
    random = rng.normal(size=(20, 3))
    tangent = random / np.sqrt(np.square(random).sum(axis=1))[:, None]
    small = rng.integers(-2, 3, (14, 3)).astype(float)
    small = small[small.any(axis=1)]
    octahedron = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    thin = np.array([0.3, 0.5, 0.7])
    return {
        "tangent to a ball": (np.vstack([tangent, sides]), np.concatenate([np.ones(20), faces])),
        "small integers": (np.vstack([small, sides]), np.concatenate([rng.integers(1, 4, len(small)), 2 * faces])),
        "octahedron, planes twice": (np.vstack([octahedron, 2 * octahedron]), np.repeat([1.0, 2.0], 8)),
        "planes through a corner": (np.vstack([sides, octahedron]), np.concatenate([faces, np.full(8, 3.0)])),
        "thin": (np.vstack([sides, [thin, -thin]]), np.append(faces, [0.1, -0.1 + 1e-12])),
        "flat": (np.vstack([sides, [thin, -thin]]), np.append(faces, [0.25, -0.25])),
        "a point": (np.vstack([sides, [[1.0, 1.0, 1.0]]]), np.append(faces, -3.0)),
    }


@pytest.mark.parametrize("seed", range(4))
def test_vertices_are_those_of_cddlib(seed):
    """As many, each the rounding of one of cddlib's, none farther than the slop."""
    counts = {}
    for name, (normals, offsets) in families(np.random.default_rng(seed)).items():
        offsets = np.asarray(offsets, dtype=float)
        polytope = HPolytope(normals, offsets)
        expected = cdd_vertices(normals, offsets)
        case = f"{name}: HPolytope({normals.tolist()}, {offsets.tolist()})"
        rounded = {tuple(float(x) for x in v) for v in expected}
        assert {tuple(v) for v in polytope.vertices.tolist()} == rounded, case
        for v in expected:
            square = sum((x - Fraction(float(x))) ** 2 for x in v)
            assert square <= Fraction(polytope.slop) ** 2, f"slop {polytope.slop}, {case}"
        counts[name] = len(expected)
    assert counts["octahedron, planes twice"] == 6 and counts["planes through a corner"] == 8
    assert counts["a point"] == 1 and counts["tangent to a ball"] > 20 and counts["flat"] >= 3
