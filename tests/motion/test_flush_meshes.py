"""Meshes that come together flush, face in face and edge on edge: facets that never cross clear of rounding.

The judge: bodies are unions of unit cubes, so that their first contact in a translation is that of two boxes' slabs,
and whether they meet at ``upper`` is six comparisons, both in fractions of the doubles given.
"""

from __future__ import annotations

import functools
from fractions import Fraction

import numpy as np
import pytest
from motions import l_mesh

import collide

I = np.eye(4)
CUBE, L, BAR = ((0, 0, 0),), ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 0, 0), (1, 0, 0), (2, 0, 0))
CORNER = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
BODIES = [CUBE, L, BAR, CORNER]


@functools.cache
def mesh_of(cells) -> collide.Mesh:
    """The surface of a union of unit cubes at integers, two triangles for each square of it."""
    corners: dict[tuple, int] = {}
    faces = []
    for cell in cells:
        for axis in range(3):
            for side in (0, 1):
                beyond = list(cell)
                beyond[axis] += 2 * side - 1
                if tuple(beyond) in cells:
                    continue
                square = []
                for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    at = list(cell)
                    at[axis] += side
                    at[(axis + 1) % 3] += u
                    at[(axis + 2) % 3] += v
                    square.append(corners.setdefault(tuple(at), len(corners)))
                a, b, c, d = square if side else square[::-1]
                faces += [(a, b, c), (a, c, d)]
    mesh = collide.Mesh(np.array(list(corners), dtype=float), np.array(faces))
    assert mesh.solid
    return mesh


def simplex_mesh() -> collide.Mesh:
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
    return collide.Mesh(points, np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]))


def slab_times(cells_a, cells_b, p0, p1) -> tuple[Fraction | None, bool]:
    """(first time within 0 … 1 at which the closed bodies touch, whether their insides meet right after it)."""
    best: tuple[Fraction, bool] | None = None
    for a in cells_a:
        for b in cells_b:
            begin, end, is_proper = Fraction(0), Fraction(1), True
            for k in range(3):
                x0, x1 = Fraction(float(p0[k])) + b[k] - a[k], Fraction(float(p1[k])) + b[k] - a[k]
                if x0 == x1:
                    if abs(x0) > 1:
                        begin, end = Fraction(1), Fraction(0)
                    is_proper &= abs(x0) < 1
                    continue
                first, last = sorted(((s - x0) / (x1 - x0)) for s in (-1, 1))
                begin, end = max(begin, first), min(end, last)
            if begin <= end:
                found = begin, is_proper and begin < end
                if best is None or found[0] < best[0] or (found[0] == best[0] and found[1]):
                    best = found
    return best or (None, False)


def meet(cells_a, cells_b, p0, p1, time: float) -> bool:
    """Whether the closed bodies meet at a time, exactly."""
    t = Fraction(time)
    d = [Fraction(float(x)) + t * (Fraction(float(y)) - Fraction(float(x))) for x, y in zip(p0, p1)]
    return any(all(abs(d[k] + b[k] - a[k]) <= 1 for k in range(3)) for a in cells_a for b in cells_b)


def slow(cells_a, cells_b) -> int:
    """Questions to GJK that a flush contact of two bodies may take: a tenth of what looking ahead from every pair of
    facets would."""
    return 10 * len(mesh_of(cells_a).faces) * len(mesh_of(cells_b).faces)


def random_flight(rng) -> tuple[np.ndarray, np.ndarray]:
    """Along an axis, or in a plane of the grid, at offsets that are whole numbers, or nearly."""
    p0 = rng.integers(-1, 2, 3).astype(float)
    if rng.uniform() < 0.2:
        p0[rng.integers(3)] += rng.choice([2.0**-52, -(2.0**-52), 2.0**-36, -(2.0**-36), 0.25])
    p1 = p0.copy()
    axis = rng.integers(3)
    far = rng.integers(4, 7) + rng.choice([0.0, 0.5, rng.uniform()])
    p0[axis], p1[axis] = far, rng.choice([-far, far - 3.75 - rng.uniform(), -0.5 * far])
    if rng.uniform() < 0.3:
        p1[(axis + 1) % 3] += rng.choice([-1.0, 1.0, 0.5])
    return (p0, p1) if rng.uniform() < 0.5 else (-p0, -p1)


@pytest.mark.slow
def test_unions_of_cubes_in_fractions():
    rng = np.random.default_rng(31)
    n_flush = n_free = n_open = 0
    for _ in range(60):
        cells_a, cells_b = (BODIES[k] for k in rng.integers(len(BODIES), size=2))
        A, B = mesh_of(cells_a), mesh_of(cells_b)
        p0, p1 = random_flight(rng)
        r = collide.time_of_impact(A, B, I, I, collide.pose(p0), collide.pose(p1))
        snippet = f"{cells_a}, {cells_b}, {p0.tolist()}, {p1.tolist()}: {r}"
        truth, is_proper = slab_times(cells_a, cells_b, p0, p1)
        if truth is None:
            assert not r.hit or r.upper == np.inf, snippet
            n_free += not r.hit
            continue
        assert r.hit and Fraction(float(r.lower)) <= truth, snippet
        if np.isfinite(r.upper):
            assert Fraction(float(r.upper)) >= truth and meet(cells_a, cells_b, p0, p1, r.upper), snippet
        margins = [abs(abs(p0[k] + b[k] - a[k]) - 1) for k in range(3) for a in cells_a for b in cells_b]
        if is_proper and not any(0 < margin < 1e-12 for margin in margins):  # no grazing, nor overlaps within rounding
            assert r.certified and r.queries <= slow(cells_a, cells_b), snippet
            n_flush += 1
        n_open += not r.certified
    assert n_flush >= 15 and n_free >= 5 and n_open >= 5, (n_flush, n_free, n_open)


def certain(A, B, *motion, truth: float, **options):
    """The answer, certified, and right."""
    r = collide.time_of_impact(A, B, *motion, **options)
    assert r.hit and r.certified, r
    assert r.lower <= truth + 1e-12 and truth - 1e-12 <= r.upper, (r, truth)
    return r


def test_equal_meshes_head_on():
    """Cubes, a unit in the last place larger, tetrahedra, balls of facets, unions: as a box and a box are answered."""
    rng = np.random.default_rng(32)
    cube = mesh_of(CUBE)
    ball = collide.Mesh(*collide.tessellate(collide.Sphere(0.5), tolerance=0.02))
    simplex = simplex_mesh()
    union = collide.Compound([(cube, I), (cube, collide.pose((1, 0, 0)))])
    larger = collide.Mesh(cube.vertices * (1 + 2.0**-52), cube.faces)
    box = collide.Compound([(collide.Box((1, 1, 1)), collide.pose((0.5, 0.5, 0.5)))])
    pairs = [
        (cube, cube, 1.0, 12), (cube, larger, 1.0, 12), (simplex, simplex, 1.0, 40), (ball, ball, 1.0, 4),
        (cube, box, 1.0, 12), (collide.Compound([(cube, I)]), cube, 1.0, 12), (union, union, 2.0, 24),
        (l_mesh(), l_mesh(), 2.0, 12),
    ]
    for A, B, width, most in pairs:
        n_facets = [len(s.faces) if isinstance(s, collide.Mesh) else 12 for s in (A, B)]
        for turned in (False, True):  # in a frame in which nothing is flush to the last digit
            X = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) if turned else I
            start, end = width + rng.uniform(0.5, 2.0), -rng.uniform(0.0, 3.0)
            r = certain(
                A, B, X, X, X @ collide.pose((start, 0, 0)), X @ collide.pose((end, 0, 0)),
                truth=(start - width) / (start - end),
            )
            assert r.queries <= most * n_facets[0] * n_facets[1], (r, A, B, X.tolist(), start, end)


def test_cubes_that_turn_and_come_flush():
    """B turns about the way it goes, by quarters at the contact; and one hinged in the plane of A's face falls shut."""
    rng = np.random.default_rng(33)
    cube = mesh_of(CUBE)
    centred = collide.Mesh(cube.vertices - 0.5, cube.faces)
    for _ in range(12):
        quarters, sense = int(rng.integers(1, 6)), rng.choice([-1.0, 1.0])
        truth = float(rng.uniform(0.2, 0.8))
        omega = np.array([sense * quarters * 0.5 * np.pi / truth, 0.0, 0.0])
        speed = rng.uniform(1.0, 4.0)
        X0 = collide.pose((1.0 + speed * truth, 0, 0))
        X1 = collide.moved_poses(X0, (-speed, 0, 0), omega)
        certain(centred, centred, I, I, X0, X1, truth=truth, omega_WB=omega)
    for _ in range(12):
        x = rng.uniform(0.2, 1.0)
        door = collide.Mesh(cube.vertices * (1.0, 0.25, 1.0) + (x, 0.0, 0.0), cube.faces)
        wall = collide.Mesh(cube.vertices * (1.0, 0.25, 1.0) + (x, -0.25, 0.0), cube.faces)
        begin, further = rng.uniform(0.2, 1.2), rng.uniform(0.1, 0.8)
        omega = np.array([0.0, 0.0, -begin - further])
        X0 = collide.pose((0, 0, 0), rpy=(0, 0, begin))
        X1 = collide.moved_poses(X0, (0, 0, 0), omega)
        certain(wall, door, I, I, X0, X1, truth=begin / (begin + further), omega_WB=omega)


def opened(mesh: collide.Mesh, towards) -> collide.Mesh:
    """The mesh without the facets that look somewhere."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return collide.Mesh(mesh.vertices, mesh.faces[normals @ np.array(towards) <= 0.0])


def test_open_meshes():
    """A point of an open mesh inside a solid is a meeting; one of two open meshes around the other is none."""
    cube = mesh_of(CUBE)
    bowl = opened(cube, (1, 0, 0))
    assert not bowl.solid
    motion = I, I, collide.pose((3, 0, 0)), collide.pose((-2, 0, 0))
    certain(cube, bowl, *motion, truth=0.4)
    certain(bowl, cube, *(motion[k] for k in (2, 3, 0, 1)), truth=0.4)
    r = collide.time_of_impact(opened(cube, (-1, 0, 0)), bowl, *motion)
    assert r.hit and r.lower <= 0.4 and r.upper >= 0.4 and r.lower >= 0.4 - 1e-12
    # A lid that goes into an open box of the same width, flush with its sides, never gets to its floor.
    tube = opened(bowl, (-1, 0, 0))
    lid = opened(opened(opened(tube, (0, 1, 0)), (0, -1, 0)), (0, 0, 1))
    inner = collide.Mesh(lid.vertices * (1.0, 0.5, 0.5) + (0.0, 0.25, 0.25), lid.faces)
    r = collide.time_of_impact(tube, inner, *motion)
    assert not r.hit
    # Walls without thickness that slide along a solid's sides touch them, and no more: that stays open.
    r = collide.time_of_impact(tube, cube, *motion)
    assert r.hit and 0.4 - 1e-12 <= r.lower <= 0.4 <= r.upper


@pytest.mark.slow
def test_bits_are_the_same_swapped_and_in_batches():
    rng, n = np.random.default_rng(34), 10
    A, B, n_proven = mesh_of(L), mesh_of(CORNER), 0
    for C, D in ((A, B), (A, A), (simplex_mesh(), simplex_mesh())):
        X0, X1 = (np.tile(I, (n, 1, 1)) for _ in range(2))
        for k in range(n):
            p0, p1 = random_flight(rng)
            X0[k, :3, 3], X1[k, :3, 3] = p0, p1
        r = collide.time_of_impact(C, D, I, I, X0, X1)
        swapped = collide.time_of_impact(D, C, X0, X1, I, I)
        threads = collide.time_of_impact(C, D, I, I, X0, X1, threads=2)
        n_proven += np.isfinite(r.upper[r.hit]).sum()
        for name in ("lower", "upper", "queries"):
            values = [getattr(of, name) for of in (r, swapped, threads)]
            assert values[0].tobytes() == values[1].tobytes() == values[2].tobytes(), name
        for k in range(0, n, 5):
            assert collide.time_of_impact(C, D, I, I, X0[k], X1[k]).upper == r.upper[k]
    assert n_proven >= 6
