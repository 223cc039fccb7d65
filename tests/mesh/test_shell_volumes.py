"""Volumes of shells, their signs, and facets without area: against Fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import determinant, exact
from mesh_shapes import box, bumpy_sphere
from naive import rng_of, rotation

from collide.kernels import address_of
from collide.mesh.shell_nesting import judge_shells, shells_memory
from collide.mesh.shell_volumes import exact_integers, scaled_to_one, without_area


def true_volume(vertices, faces) -> Fraction:
    points = exact(vertices)
    return sum((determinant(*(points[v] for v in face)) for face in faces.tolist()), Fraction(0)) / 6


def together(*meshes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(vertices, corners int32, shells int32) of several closed surfaces, facets shuffled."""
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])
    corners = np.concatenate([f + s for (_, f), s in zip(meshes, starts)]).astype(np.int32)
    shells = np.repeat(np.arange(len(meshes)), [len(f) for _, f in meshes]).astype(np.int32)
    order = rng_of("shuffled").permutation(len(corners))
    return (
        np.concatenate([v for v, _ in meshes]),
        np.ascontiguousarray(corners[order]),
        np.ascontiguousarray(shells[order]),
    )


def flattened(mesh, factor: float):
    vertices, faces = mesh
    return vertices * (1.0, 1.0, factor), faces


def turned_over(mesh):
    return mesh[0], mesh[1][:, ::-1]


def tilted(mesh, rng, shift: float):
    return mesh[0] @ rotation(rng).T + shift, mesh[1]


def shell_volumes(vertices, corners, shells, n_shells) -> tuple[np.ndarray, np.ndarray]:
    """(volumes, signs); nothing is written behind the memory that is asked for."""
    n, f, points = len(vertices), len(corners), np.ascontiguousarray(vertices)
    volumes, signs, wrong = np.empty(n_shells), *np.empty((2, n_shells), dtype=np.int32)
    n_words = -(-shells_memory(n, f, n_shells) // 8)
    memory = np.full(n_words + 4096, -7, dtype=np.int64)
    judge_shells(
        address_of(points), n, address_of(corners), f, address_of(shells), n_shells, address_of(volumes),
        address_of(signs), address_of(wrong), address_of(memory),
    )
    assert (memory[n_words:] == -7).all()
    return volumes, signs


def test_volumes_and_signs():
    rng = rng_of("volumes")
    cube, sphere = box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)), bumpy_sphere(200)
    meshes = [
        cube, turned_over(cube), sphere, tilted(sphere, rng, 1e9), tilted(flattened(cube, 3e-16), rng, 0.3),
        turned_over(tilted(flattened(cube, 3e-16), rng, 0.3)), flattened(cube, 0.0), flattened(sphere, 0.0),
        flattened(cube, 1e-300),
    ]
    vertices, corners, shells = together(*meshes)
    volumes, signs = shell_volumes(vertices, corners, shells, len(meshes))
    doubtful = 0
    for k in range(len(meshes)):
        true = true_volume(vertices, corners[shells == k])
        assert signs[k] == (true > 0) - (true < 0), k
        if true == 0:
            assert volumes[k] == 0.0
        else:
            size = np.ptp(vertices[corners[shells == k]].reshape(-1, 3), axis=0).max() ** 3
            assert abs(Fraction(float(volumes[k])) - true) <= Fraction(1e-12) * Fraction(float(size))
            doubtful += abs(true) < Fraction(1e-13) * Fraction(float(size))
    assert doubtful >= 2 and set(signs.tolist()) == {-1, 0, 1}


def test_facets_that_belong_to_no_shell_do_not_count():
    vertices, faces = box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    corners = np.concatenate([faces, [[0, 1, 6]]]).astype(np.int32)
    shells = np.array([0] * len(faces) + [-1], dtype=np.int32)
    volumes, signs = shell_volumes(vertices, corners, shells, 1)
    assert volumes.tolist() == [pytest.approx(6.0)] and signs.tolist() == [1]


@pytest.mark.parametrize("lowest, highest", [(-1074, 160), (-1074, -900), (100, 160), (0, 3)])
def test_signs_of_volumes_of_the_widest_coordinates(lowest, highest):
    """Flat boxes and such off by a bit, of coordinates from the smallest doubles to the largest that meshes have."""
    rng = rng_of("wide", lowest, highest)
    seen = set()
    for _ in range(40):
        vertices, faces = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
        u, v = (np.ldexp(rng.uniform(-1, 1, 3), rng.integers(lowest, highest + 1, 3)) for _ in range(2))
        w = [np.zeros(3), u + v, np.ldexp(rng.uniform(-1, 1, 3), lowest)][int(rng.integers(3))]
        points = np.clip(vertices @ np.stack([u, v, w]), -1e50, 1e50)
        faces = np.ascontiguousarray(faces, dtype=np.int32)
        _, signs = shell_volumes(points, faces, np.zeros(len(faces), dtype=np.int32), 1)
        true = true_volume(points, faces)
        assert signs[0] == (true > 0) - (true < 0), points.tolist()
        seen.add(int(signs[0]))
    assert seen == {-1, 0, 1}, seen


def test_facets_without_area():
    rng = rng_of("without area")
    flat = 0
    for scale in (1.0, 1e-300, 1e150):
        points = rng.integers(-2, 3, size=(60, 3)) * scale
        points[30:] = rng.normal(size=(30, 1)) * scale * np.array([1.0, 3.0, -0.5])  # near one line
        points[45:] = points[30:45] * 2.0 + points[30] * 0.0
        corners = rng.integers(0, 60, size=(300, 3)).astype(np.int32)
        found = without_area(points, corners)
        for face, thin in zip(corners.tolist(), found.tolist()):
            a, b, c = (exact(points[[v]])[0] for v in face)
            u, v = [x - y for x, y in zip(b, a)], [x - y for x, y in zip(c, a)]
            cross = [u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3] for k in range(3)]
            assert thin == (not any(cross)), (points[face].tolist(), thin)
        flat += int(found.sum())
    assert 30 < flat < 870, flat


def test_one_unit_for_all():
    values = np.array([[0.1, 5e-324], [0.0, -3.0]])
    whole = exact_integers(values)
    ratio = Fraction(int(whole[0, 0])) / Fraction(0.1)
    assert [[Fraction(int(x)) for x in row] for row in whole] == [
        [ratio * Fraction(x) for x in row] for row in values.tolist()
    ]
    scaled, exponent = scaled_to_one(values)
    assert 0.5 <= np.abs(scaled).max() < 1.0 and np.ldexp(scaled, exponent)[1].tolist() == [0.0, -3.0]
