"""Volume, area, centroid and inertia of meshes, against sums in fractions of tetrahedra, and closed forms."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import block_ring, bumpy_sphere

import collide
from collide.errors import InvalidShape


def turned_box(seed: int) -> collide.Mesh:
    rng = np.random.default_rng(seed)
    size, X = rng.uniform(0.1, 3.0, 3), collide.pose(rng.uniform(-5, 5, 3), rpy=rng.uniform(-3, 3, 3))
    vertices, faces = collide.tessellate(collide.Box(size), tolerance=1.0)[:2]
    return collide.Mesh(vertices @ X[:3, :3].T + X[:3, 3], faces)


def by_tetrahedra(mesh: collide.Mesh):
    """(volume, centroid, covariance about the origin) by midpoints: ∫ f = V / 20 (Σ f(corner) + 16 f(mean)) for
    quadratic f, over tetrahedra from a point of the surface."""
    start = [Fraction(x) for x in mesh.vertices[0]]
    V, first, second = Fraction(0), [Fraction(0)] * 3, [[Fraction(0)] * 3 for _ in range(3)]
    for face in mesh.faces.tolist():
        corners = [[Fraction(x) for x in mesh.vertices[v]] for v in face]
        u, v, w = ([x - s for x, s in zip(p, start)] for p in corners)
        six = sum(u[i] * (v[i - 2] * w[i - 1] - v[i - 1] * w[i - 2]) for i in range(3))
        four = [start, *corners]
        mean = [sum(p[i] for p in four) / 4 for i in range(3)]
        V += six / 6
        for i in range(3):
            first[i] += six / 6 * mean[i]
            for j in range(3):
                values = sum(p[i] * p[j] for p in four) + 16 * mean[i] * mean[j]
                second[i][j] += six / 6 * values / 20
    return V, first, second


@pytest.mark.parametrize("mesh", [turned_box(1), turned_box(2), collide.Mesh(*bumpy_sphere(60))], ids=str)
def test_measures_are_the_fractions_rounded_once(mesh):
    V, first, second = by_tetrahedra(mesh)
    assert mesh.volume == float(V)
    assert mesh.centroid.tolist() == [float(x / V) for x in first]
    C = [[second[i][j] - first[i] * first[j] / V for j in range(3)] for i in range(3)]
    trace = sum(C[i][i] for i in range(3))
    rho = Fraction(7850.3)
    wanted = [[float(rho * ((trace if i == j else 0) - C[i][j])) for j in range(3)] for i in range(3)]
    assert mesh.inertia(7850.3).tolist() == wanted


@pytest.mark.parametrize("seed", range(4))
def test_the_area_is_rounded_once(seed):
    """Beside roots of 60 digits."""
    mesh = turned_box(seed)
    with localcontext() as context:
        context.prec = 60
        total = Decimal(0)
        for face in mesh.faces.tolist():
            a, b, c = ([Fraction(x) for x in mesh.vertices[v]] for v in face)
            u, v = ([x - y for x, y in zip(p, a)] for p in (b, c))
            square = sum((u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2]) ** 2 for i in range(3))
            total += (Decimal(square.numerator) / Decimal(square.denominator)).sqrt() / 2
        assert mesh.area == float(total)


def test_closed_forms():
    box = collide.Mesh(*collide.tessellate(collide.Box((2, 4, 6)), tolerance=1.0)[:2])
    assert box.volume == 48.0 and box.area == 88.0 and box.centroid.tolist() == [0.0, 0.0, 0.0]
    assert box.inertia(3.0).tolist() == [[144 * 52 / 12, 0, 0], [0, 144 * 40 / 12, 0], [0, 0, 144 * 20 / 12]]
    assert box.scaled(0.5).volume == 6.0
    ring = collide.Mesh(*block_ring())
    assert ring.volume == ring.report.volume


def test_far_from_the_origin_and_tiny():
    """A cube of 1e-3 m at 1e6 m, where sums of doubles keep no digit of the inertia."""
    vertices, faces = collide.tessellate(collide.Box((2.0**-10,) * 3), tolerance=1.0)[:2]
    mesh = collide.Mesh(vertices + 2.0**20, faces)
    assert mesh.volume == 2.0**-30 and mesh.centroid.tolist() == [2.0**20] * 3
    assert mesh.inertia(6.0).tolist() == (np.eye(3) * 2.0**-50).tolist()


def test_surfaces_and_densities_are_refused():
    surface = collide.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert surface.area == 0.5
    for ask in (lambda: surface.volume, lambda: surface.centroid, lambda: surface.inertia(1.0)):
        with pytest.raises(InvalidShape, match="a surface encloses nothing"):
            ask()
    for density in (0.0, -1.0, np.nan, "steel"):
        with pytest.raises(InvalidShape, match="density"):
            turned_box(1).inertia(density)
