"""Solids that are their own hull: by every facet and every vertex in fractions, ulps beside convex too."""

from __future__ import annotations

from collections import Counter

import numpy as np
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import hull_points, rng_of, rotation
from naive_triangles import as_integers, cross, inner, minus, world_points

import collide
from collide.hull.exact_hull import convex_hull
from collide.mesh import convex_surface
from collide.mesh.convex_surface import is_own_hull


def by_definition(vertices, faces) -> bool:
    (points,) = as_integers(world_points(vertices, np.eye(4)))
    used = np.unique(faces).tolist()
    for a, b, c in np.asarray(faces).tolist():
        n = cross(minus(points[b], points[a]), minus(points[c], points[a]))
        if any(inner(n, minus(points[v], points[a])) > 0 for v in used):
            return False
    return True


def cases(rng):
    for k in range(60):
        points = hull_points(rng, 16) if k % 2 else rng.integers(-2, 3, (16, 3)) * 1.0
        faces = convex_hull(points).facets
        vertices = points.copy()
        if k % 3 == 0:  # one vertex moved by ulps
            v = int(rng.choice(np.unique(faces)))
            vertices[v] = np.nextafter(vertices[v], rng.choice([-9.0, 9.0]))
        if k % 3 == 1:  # a flat facet in pieces, turned and far away
            corners, faces = box()
            vertices = corners @ rotation(rng).T * 10.0 ** rng.integers(-6, 7)
        yield vertices, faces
    yield from (box(), block_ring(), bumpy_sphere(60))


def test_as_the_definition_says():
    rng = rng_of("own hulls")
    seen: Counter = Counter()
    for vertices, faces in cases(rng):
        want = by_definition(vertices, faces)
        assert is_own_hull(vertices, faces) == want, f"{vertices.tolist()}, {np.asarray(faces).tolist()}"
        seen[want] += 1
    assert min(seen[True], seen[False]) >= 15, seen


def test_vertices_not_in_use_and_facets_without_area_say_nothing():
    vertices, faces = box()
    more = np.concatenate([vertices, [[9.0, 9.0, 9.0]]])
    assert is_own_hull(more, faces) and is_own_hull(vertices, np.concatenate([faces, [[0, 0, 1]]]))
    assert not is_own_hull(vertices, faces[:, ::-1])


def test_too_large_ones_are_left_open(monkeypatch):
    vertices, faces = box()
    monkeypatch.setattr(convex_surface, "MAX_SIGNS", 10)
    assert not is_own_hull(vertices, faces)


def test_solids_that_are_not_convex_are_refused_after_few_signs_and_flat_sides_need_few_integers(monkeypatch):
    """Signs in doubles and points made integers are counted: a bumpy ball shows itself at its first facets, and points
    of a box whose sides are grids, turned by any angle, become integers once, however many planes they are tested
    against."""
    looked_at, beyond = [], convex_surface._beyond
    monkeypatch.setattr(
        convex_surface, "_beyond", lambda points, f: looked_at.append(len(points) * len(f)) or beyond(points, f)
    )
    vertices, faces = bumpy_sphere(1500)
    assert not is_own_hull(vertices, faces)
    assert 0 < sum(looked_at) <= 0.02 * len(vertices) * len(faces), (looked_at, len(vertices), len(faces))
    made, integers = [], convex_surface.integers
    monkeypatch.setattr(convex_surface, "integers", lambda values: made.append(len(values)) or integers(values))
    slab = collide.tessellate(collide.HeightField(np.zeros((9, 9)), (0.125, 0.125), bottom=-0.25))
    for turned in (np.eye(3), rotation(rng_of("flat sides"))):
        made.clear()
        points = slab.vertices @ turned.T
        assert is_own_hull(points, slab.faces) == by_definition(points, slab.faces)
        assert made == [len(points)]
