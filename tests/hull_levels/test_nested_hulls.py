"""Outer hulls contain the body, exactly; distances are those of an oracle; no level is larger than asked."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from facet_distances import nearest_square
from naive import rng_of

import collide

SIZES = (8, 16, 24, 60)


def on_a_ball(rng, n: int) -> np.ndarray:
    points = rng.normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def ring(n: int) -> np.ndarray:
    turns = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    return np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)


def bodies() -> dict[str, np.ndarray]:
    rng = rng_of("nested hulls")
    turned = ring(90) @ np.array([[1.0, 0.0, 0.3], [0.0, 1.0, 0.2], [0.0, 0.0, 1.0]])
    return {
        "ball": on_a_ball(rng, 200), "cloud": rng.uniform(-1.0, 1.0, (400, 3)),
        "needle": on_a_ball(rng, 120) * [1.0, 1e-6, 1e-6], "pancake": on_a_ball(rng, 120) * [1.0, 1.0, 1e-9],
        "cylinder": np.concatenate([ring(60), ring(60) + np.eye(3)[2]]), "disc": ring(90), "turned disc": turned,
        "far": on_a_ball(rng, 90) * 1e-3 + 1e3, "large": on_a_ball(rng, 90) * 1e6,
        "small": on_a_ball(rng, 90) * 1e-6, "lattice": np.array([*np.ndindex(4, 4, 4)]) / 4,
        "tetrahedron": np.vstack([np.eye(3), np.zeros(3)]),
        "segment": np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [0.5, 1.0, 1.5]]), "point": np.array([[1.0, 2.0, 3.0]]),
    }


def as_integers(*points: np.ndarray) -> list[np.ndarray]:
    """All coordinates times one power of two."""
    lowest = min(float(np.abs(p[p != 0.0]).min()) if (p != 0.0).any() else 1.0 for p in points)
    factor = 2 ** max(0, 60 - int(np.frexp(lowest)[1]))
    return [np.array([[int(Fraction(x) * factor) for x in row] for row in p.tolist()], dtype=object) for p in points]


def is_within(inner: np.ndarray, outer: collide.ConvexHull) -> bool:
    """Whether points are in a solid hull, in integers, by the hull's facets; these are checked by `validate`."""
    outer.validate()
    facets = outer.hull.facets
    corners, points = as_integers(outer.points, inner)
    a, b, c = (corners[facets[:, k]] for k in range(3))
    u, v = b - a, c - a
    normals = np.stack([u[:, i] * v[:, j] - u[:, j] * v[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
    return bool((points @ normals.T <= (a * normals).sum(axis=1)).all())


@pytest.mark.parametrize("kind", bodies())
def test_each_outer_hull_contains_the_next_and_the_body(kind):
    points = bodies()[kind]
    hulls = collide.nested_hulls(collide.ConvexHull(points), SIZES)
    assert [level.size for level in hulls] == list(SIZES)
    proven = 0
    for level, after in zip(hulls, [*hulls[1:], None]):
        inner = points if after is None else after.outer.points
        if level.outer.hull.dimension == 3:
            assert is_within(points, level.outer) and is_within(inner, level.outer), (kind, level)
            proven += 1
        else:
            assert level.outer_within == 0.0 and {*map(tuple, level.outer.points)} <= {*map(tuple, points)}
        assert level.planes <= level.size and len(level.inner.points) <= level.size
        assert len(level.outer.points) <= max(2 * level.planes - 4, len(level.outer.hull.vertices))
        assert {*map(tuple, level.inner.points)} <= {*map(tuple, points)}
        if after is not None:
            assert {*map(tuple, level.inner.points)} <= {*map(tuple, after.inner.points)}
    assert proven == (0 if kind in ("segment", "point") else len(SIZES))


@pytest.mark.parametrize("kind", ["ball", "cloud", "cylinder", "needle", "far"])
def test_distances_between_levels_are_those_of_all_facets(kind):
    points = bodies()[kind]
    body = collide.ConvexHull(points)
    asked = 0
    for level in collide.nested_hulls(body, SIZES[:3]):
        size = float(np.ptp(points, axis=0).max())
        for of, to, said in (
            (level.outer, body, level.outer_within), (body, level.inner, level.inner_within),
            (level.outer, level.inner, level.gap[1]),
        ):
            if to.hull.dimension < 3:
                continue
            facets = to.points[to.hull.facets]
            outside = [p for p in of.points[of.hull.vertices] if not is_within(p[None], to)]
            true = max((float(nearest_square(p, facets)) for p in outside), default=0.0) ** 0.5
            assert true <= said <= true + 1e-9 * size, (kind, level, true)
            if of is level.outer and to is level.inner:
                assert level.gap[0] <= true, (kind, level, true)
            asked += 1
    assert asked >= 8


def test_levels_come_near_the_body_as_they_grow():
    hulls = collide.nested_hulls(collide.ConvexHull(bodies()["ball"]), (8, 32, 128))
    for coarse, fine in pairwise(hulls):
        assert fine.outer_within < 0.4 * coarse.outer_within and fine.inner_within < 0.6 * coarse.inner_within


def test_a_body_of_few_facets_is_its_levels():
    (level,) = collide.nested_hulls(collide.Box((1.0, 2.0, 3.0)), [12])
    assert level.planes == 12 and len(level.outer.points) == len(level.inner.points) == 8
    assert level.outer_within == level.inner_within == 0.0 and level.gap == (0.0, 0.0)
    (level,) = collide.nested_hulls(collide.Box((1.0, 2.0, 3.0)), [8])
    assert level.planes == 6 and 0.0 < level.outer_within < 1e-11


def test_meshes_and_clouds_are_their_points():
    points = bodies()["ball"]
    hull = collide.ConvexHull(points)
    expected = collide.nested_hulls(hull, [16])[0]
    for shape in (collide.Mesh(points, hull.hull.facets), collide.PointCloud(points)):
        level = collide.nested_hulls(shape, [16])[0]
        assert np.array_equal(level.outer.points, expected.outer.points)
        assert np.array_equal(level.inner.points, expected.inner.points)


@pytest.mark.parametrize(
    "shape", [collide.Sphere(1.0), collide.ConvexHull(np.eye(3), radius=0.1), collide.Halfspace((0, 0, 1), 0.0),
              collide.PointCloud(np.eye(3), 0.1)],
)
def test_shapes_that_are_no_sets_of_points_are_refused(shape):
    with pytest.raises(collide.UnsupportedQuery, match=f"{type(shape).__name__} is no set of points.*tessellate"):
        collide.nested_hulls(shape)


@pytest.mark.parametrize(("sizes", "said"), [([], "ascend"), ([4], "≥ 8"), ([16, 8], "ascend"), ([8, 8], "ascend")])
def test_sizes_are_checked(sizes, said):
    with pytest.raises(collide.InvalidArgument, match=said):
        collide.nested_hulls(collide.Box((1, 1, 1)), sizes)
