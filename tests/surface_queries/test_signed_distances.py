"""Signed distances of points: brackets against fractions over all facets, signs against winding numbers in integers."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from facet_distances import exact_vector, nearest_square, square_to_triangle
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import rng_of
from solid_membership import windings

import collide
from collide.errors import InvalidArgument, UnsupportedQuery

#: What the docstring promises, of the distance and the longest side.
PROMISE = 2.0**-47


def joined(*parts):
    """(vertices, faces) of several."""
    starts = np.cumsum([0] + [len(v) for v, _ in parts[:-1]])
    return np.concatenate([v for v, _ in parts]), np.concatenate([f + k for (_, f), k in zip(parts, starts)])


def nested_shells():
    """A box in the cavity of a box."""
    v, f = box((-0.5,) * 3, (0.5,) * 3)
    return joined(box(), (v, f[:, ::-1]), box((-0.25,) * 3, (0.25,) * 3))


def crossing_boxes():
    v, f = box()
    return joined((v, f), (v + np.array([0.5, 0.25, 0.75]), f))


def soup(rng, n: int = 25):
    """Facets of sides from 1e-6 to 1: needles, caps, and such without area."""
    corners = rng.uniform(-1.0, 1.0, (n, 3, 3))
    thin = 10.0 ** rng.uniform(-16.0, 0.0, n)
    for k in range(n):
        a, b, c = corners[k]
        if k % 3 == 1:  # a needle: its last corner near its first
            corners[k, 2] = a + thin[k] * (c - a)
        elif k % 3 == 2:  # a cap: its last corner near the middle of its first side
            corners[k, 2] = a + rng.uniform(0.3, 0.7) * (b - a) + thin[k] * (c - a)
    corners[-1, 2], corners[-2, 1:] = corners[-1, 0], corners[-2, 0]  # a segment, a point
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def some_points(rng, triangles: np.ndarray, n: int) -> np.ndarray:
    """In the box and around, on corners, edges and facets, an ulp off these, and a little off."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    points = [rng.uniform(low - 0.3 * (high - low), high + 0.3 * (high - low)) for _ in range(n)]
    for k in range(2 * n):
        a, b, c = triangles[rng.integers(len(triangles))]
        aim = [a, a / 2 + b / 2, a / 2 + b / 4 + c / 4, a + rng.random() * (b - a)][k % 4]
        off = [0.0, 0.0, 2.0**-52, -(2.0**-52), 1e-9, -1e-4][rng.integers(6)]
        points.append(aim * (1.0 + off * rng.integers(0, 2, 3)))
    return np.array(points)


def check(vertices, faces, points, *, signed: bool, what: str) -> dict[str, int]:
    """Every answer against fractions; how many points are on facets, inside, and have a bracket on both sides of 0."""
    mesh = collide.Mesh(vertices, faces, solid=signed)
    triangles = mesh.vertices[mesh.faces]
    got = collide.signed_distances(mesh, points, signed=signed)
    corners = [[exact_vector(p) for p in t] for t in triangles.tolist()] if signed else []
    numbers = windings(corners, points) if signed else [0] * len(points)
    sides = max(
        math.dist(t[i], t[j]) for t in triangles.tolist() for i, j in ((0, 1), (1, 2), (2, 0))
    )
    counts = {"on": 0, "inside": 0, "near": 0}
    for k, point in enumerate(points):
        case = what, point.tolist(), tuple(column[k] for column in got)
        square = nearest_square(point, triangles)
        on, inside = square == 0, signed and (numbers[k] or 0) >= 1
        assert (got.distance[k] == 0.0) == on, case
        assert on or (got.distance[k] < 0.0) == inside, case
        assert got.lower[k] <= got.distance[k] <= got.upper[k], case
        least, most = sorted((abs(Fraction(got.lower[k])), abs(Fraction(got.upper[k]))))
        assert least**2 <= square <= most**2, case
        assert float(most - least) <= 2.1 * PROMISE * (abs(got.distance[k]) + sides), case
        # The facet named is nearest, and the place on it, as far as the promise goes and coordinates are rounded.
        error = Fraction(2.0 * PROMISE * (abs(got.distance[k]) + sides) + 1e-320)
        of_facet = square_to_triangle(point, triangles[got.facet[k]])
        assert of_facet <= (Fraction(math.sqrt(square)) * (1 + Fraction(1, 2**50)) + error) ** 2, case
        rounded = error + Fraction(2.0**-51 * np.abs(got.point[k]).max())
        assert square_to_triangle(got.point[k], triangles[got.facet[k]]) <= rounded**2, case
        counts["on"] += on
        counts["inside"] += inside and not on
        counts["near"] += least == 0 and not on
    return counts


SOLIDS = {
    "box": box, "ring": block_ring, "nested": nested_shells, "crossing": crossing_boxes,
    "bumpy": lambda: bumpy_sphere(60),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_distances_and_signs_of_solids_by_fractions(name):
    rng = rng_of("signed distances", name)
    vertices, faces = SOLIDS[name]()
    points = some_points(rng, vertices[faces], 25)
    counts = check(vertices, faces, points, signed=True, what=name)
    assert counts["on"] >= 8 and counts["inside"] >= 6, counts


@pytest.mark.parametrize("scale, shift", [(1.0, 1e6), (1e-30, 0.0), (1e30, 1e33), (3e-9, 1.0)])
def test_meshes_far_from_the_origin_small_and_large(scale, shift):
    rng = rng_of("placed", scale)
    vertices, faces = bumpy_sphere(40)
    placed = vertices * scale + shift * np.array([1.0, -0.5, 0.25])
    points = some_points(rng, placed[faces], 8)
    points[:6] = placed.mean(axis=0) + scale * rng.normal(size=(6, 3))
    counts = check(placed, faces, points, signed=True, what=f"{scale} {shift}")
    assert counts["inside"] >= 3, counts


def test_facets_without_shape_and_open_meshes():
    rng = rng_of("soup")
    on = 0
    for index in range(4):
        vertices, faces = soup(rng)
        counts = check(vertices, faces, some_points(rng, vertices[faces], 8), signed=False, what=f"soup {index}")
        assert counts["inside"] == 0
        on += counts["on"]
    assert on >= 12


def test_caps_alone():
    """Flat facets one by one, whose inside is what is near."""
    rng = rng_of("caps")
    inner = 0
    for k in range(60):
        a, b = rng.uniform(-1.0, 1.0, (2, 3))
        across = np.cross(b - a, rng.normal(size=3))
        c = a + rng.uniform(0.2, 0.8) * (b - a) + across * 10.0 ** rng.uniform(-17, 0)
        triangle = np.array([a, b, c])
        weights = rng.dirichlet(np.ones(3), 3)
        points = weights @ triangle + np.cross(b - a, across) * 10.0 ** rng.uniform(-17, 1, (3, 1))
        check(triangle, np.array([[0, 1, 2]]), points, signed=False, what=f"cap {k}")
        edges = [min(np.linalg.norm(p - (u + t * (v - u))) for u, v in ((a, b), (b, c), (c, a))
                     for t in np.linspace(0, 1, 65)) for p in points]
        inner += sum(d > 1.001 * r for d, r in zip(edges, collide.signed_distances(
            collide.Mesh(triangle, [[0, 1, 2]]), points, signed=False).distance))
    assert inner >= 20, inner


def test_points_far_away():
    vertices, faces = bumpy_sphere(60)
    rng = rng_of("far")
    for reach in (1e3, 1e6, 1e12, 1e40):
        points = reach * rng.normal(size=(6, 3))
        counts = check(vertices, faces, points, signed=True, what=f"{reach}")
        assert counts["inside"] == 0


def test_details_small_beside_the_whole():
    """A tree whose nodes have origins of their own."""
    rng = rng_of("details")
    v, f = bumpy_sphere(500)
    vertices, faces = joined((1e-7 * v, f), (1e-7 * v + [3e-6, 0, 0], f), (v + np.array([50.0, 0.0, 0.0]), f))
    mesh = collide.Mesh(vertices, faces)
    assert mesh.tree.has_origins
    points = np.concatenate([
        6e-8 * rng.normal(size=(10, 3)), 6e-8 * rng.normal(size=(10, 3)) + [3e-6, 0, 0], rng.normal(size=(6, 3)) * 30.0,
    ])
    counts = check(vertices, faces, points, signed=True, what="details")
    assert counts["inside"] >= 4, counts


def test_an_answer_does_not_depend_on_the_others():
    rng = rng_of("alone")
    for vertices, faces in (bumpy_sphere(2000), crossing_boxes(), nested_shells()):
        mesh = collide.Mesh(vertices, faces)
        points = np.concatenate([rng.uniform(-1.5, 1.5, (9000, 3)), np.round(rng.uniform(-1.5, 1.5, (9000, 3)), 1)])
        got = collide.signed_distances(mesh, points)
        order = rng.permutation(len(points))
        shuffled = collide.signed_distances(mesh, points[order], threads=2)
        for column, other in zip(got, shuffled):
            assert np.array_equal(column[order], other)
        for k in range(0, len(points), 600):
            alone = collide.signed_distances(mesh, points[k])
            assert alone.distance.shape == () and alone.point.shape == (3,)
            assert all(np.array_equal(column[k], value) for column, value in zip(got, alone)), points[k].tolist()
        assert np.array_equal(got.distance <= 0.0, collide.contains(mesh, np.eye(4), points))


def test_no_point_and_bad_arguments():
    mesh = collide.Mesh(*box())
    got = collide.signed_distances(mesh, np.zeros((0, 3)))
    assert got.distance.shape == got.facet.shape == (0,) and got.point.shape == (0, 3)
    surface = collide.Mesh(*box(), solid=False)
    with pytest.raises(UnsupportedQuery, match="signed=False"):
        collide.signed_distances(surface, (0, 0, 0))
    assert collide.signed_distances(surface, (0, 0, 0.5), signed=False).distance == 0.5
    assert collide.signed_distances(mesh, (0, 0, 0.5)).distance == -0.5
    with pytest.raises(InvalidArgument, match="tessellate"):
        collide.signed_distances(collide.Sphere(1.0), (0, 0, 0))
    for points in ((0, 0), [(0, 0, np.nan)], [(0, 0, 1e51)]):
        with pytest.raises(InvalidArgument, match="points"):
            collide.signed_distances(mesh, points)


def test_scaled_meshes_and_height_fields():
    mesh = collide.Mesh(*bumpy_sphere(60))
    points = rng_of("scaled").uniform(-1.5, 1.5, (50, 3))
    once, twice = collide.signed_distances(mesh, points), collide.signed_distances(mesh.scaled(2.0), 2.0 * points)
    assert np.array_equal(2.0 * once.distance, twice.distance) and np.array_equal(once.facet, twice.facet)
    terrain = collide.HeightField([[0.0, 0.0], [0.0, 0.0]], 1.0, bottom=-2.0)
    assert collide.signed_distances(terrain, [(0.1, 0.1, 0.25), (0.1, 0.1, -0.25)]).distance.tolist() == [0.25, -0.25]
