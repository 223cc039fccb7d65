"""Hulls: the exact surface, made once, judged by every plane in integers; faces given are checked when asked."""

from __future__ import annotations

import numpy as np
import pytest
from naive import hull_points, rng_of
from naive_triangles import cross, inner, minus

from collide import ConvexHull, InvalidShape

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


def test_surfaces_have_all_points_behind_them():
    rng = rng_of("convex hulls")
    for case in range(30):
        points = rng.integers(-3, 4, (20, 3)) if case % 2 else np.rint(hull_points(rng, 20) * 2.0**30)
        hull = ConvexHull(points)
        surface = hull.hull
        assert hull.hull is surface, "made once"
        exact = [[int(x) for x in p] for p in points.tolist()]
        for a, b, c in surface.facets.tolist():
            n = cross(minus(exact[b], exact[a]), minus(exact[c], exact[a]))
            assert n != [0, 0, 0] and all(inner(n, minus(p, exact[a])) <= 0 for p in exact), points.tolist()
        edges = {(f[k], f[k - 1]) for f in surface.facets.tolist() for k in range(3)}
        assert surface.dimension == 3 and all((b, a) in edges for a, b in edges)
        assert set(surface.vertices.tolist()) == {v for edge in edges for v in edge}
        hull.validate()


@pytest.mark.parametrize(
    ("points", "dimension"),
    [([[1, 2, 3]], 0), ([[0, 0, 0]] * 3, 0), ([[0, 0, 0], [1, 1, 1], [2, 2, 2]], 1), (np.eye(3), 2), (CUBE, 3)],
)
def test_dimensions(points, dimension):
    hull = ConvexHull(points)
    assert hull.hull.dimension == dimension
    assert len(hull.hull.vertices) == {0: 1, 1: 2, 2: 3, 3: 8}[dimension]
    for array in (hull.hull.vertices, hull.hull.facets, hull.points):
        assert not array.flags.writeable


def test_faces_given_are_judged_by_validate_alone():
    good = ConvexHull(CUBE).hull.facets
    ConvexHull(CUBE, faces=good).validate()
    for bad in (good[:-1], good[:, ::-1], np.concatenate([good, good[:1]])):
        hull = ConvexHull(CUBE, faces=bad)
        with pytest.raises(InvalidShape, match="ConvexHull: faces: "):
            hull.validate()
        assert np.array_equal(hull.hull.facets, good)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [({"points": np.zeros((0, 3))}, "points"), ({"points": np.zeros((3, 2))}, r"shape \(N, 3\)"),
     ({"points": [[0, 0, np.nan]]}, "finite"), ({"points": [[1e-60, 0, 0]]}, "at least 1e-50"),
     ({"points": CUBE, "radius": -1.0}, "radius must be ≥ 0"), ({"points": CUBE, "faces": [[0, 1, 8]]}, r"faces\[0\]")],
)
def test_what_is_no_hull(arguments, words):
    with pytest.raises(InvalidShape, match=f"ConvexHull.*{words}"):
        ConvexHull(**arguments)
