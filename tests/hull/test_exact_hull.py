"""Convex hulls of clouds: against brute force in Python integers, and against damage done to them."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from fractions import Fraction
from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from hierarchy_families import ring, turned
from hypothesis import given, settings
from hypothesis import strategies as st

from collide.hull.exact_hull import Hull, convex_hull
from collide.hull.validate_hull import validate_hull

# --- clouds -------------------------------------------------------------------------------------


def on_sphere(rng, n: int) -> np.ndarray:
    points = rng.normal(size=(n, 3))
    return points / np.sqrt((points * points).sum(axis=1))[:, None]


def cube_surface(m: int) -> np.ndarray:
    grid = np.stack(np.meshgrid(*[np.arange(m)] * 3), axis=-1).reshape(-1, 3)
    return grid[((grid == 0) | (grid == m - 1)).any(axis=1)].astype(float)


def prism(n: int, height: float = 1.0, phase: float = 0.0, top: float = 1.0) -> np.ndarray:
    return np.concatenate([ring(n, -height), ring(n, height, top, phase)])


def bipyramid(n: int, height: float) -> np.ndarray:
    return np.concatenate([ring(n), [[0, 0, height], [0, 0, -height]]])


def families(rng, size: int) -> dict[str, np.ndarray]:
    """Clouds that are hard for a hull builder in one way each, of about ``size`` points."""
    half = size // 2
    t = np.linspace(-1, 1, half)
    fine = 2.0 ** -np.linspace(0, 50, size)
    flat = on_sphere(rng, size) * [1, 1, 0]
    ball = on_sphere(rng, size) * np.cbrt(rng.random(size))[:, None]
    root = max(3, int(size**0.5))
    lattice = rng.integers(-4, 5, (size, 3)).astype(float)
    tilted = np.column_stack([lattice[:, 0], lattice[:, 1], lattice[:, 0] + 3 * lattice[:, 1]])
    u, v = (c.ravel().astype(float) for c in np.meshgrid(np.arange(root), np.arange(root)))
    arcs = np.concatenate([np.c_[t, 0 * t, 1 - 0.1 * t * t], np.c_[0 * t, t, 0.1 * t * t - 1]])
    return {
        "sphere": on_sphere(rng, size),
        "ball": ball,
        "ball twice": np.concatenate([ball, ball[::-1]]),
        "prism": prism(half),
        "prism turned": turned(prism(half)),
        "thin prism turned": turned(prism(half, 1e-9)),
        "long prism turned": turned(prism(half, 1e9)),
        "antiprism": prism(half, 1.0, np.pi / half),
        "frustum turned": turned(prism(half, 1.0, 0.0, 0.25)),
        "bipyramid": bipyramid(size, 1.0),
        "flat bipyramid turned": turned(bipyramid(size, 1e-3)),
        "tall bipyramid turned": turned(bipyramid(size, 1e3)),
        "cone": np.concatenate([ring(size), [[0, 0, 2]]]),
        "cone turned": turned(np.concatenate([ring(size), [[0, 0, 2]]])),
        "paraboloid": np.column_stack([u, v, u * u + v * v]),
        "cube surface": cube_surface(max(3, int((size / 6) ** 0.5))),
        "cube surface turned": turned(cube_surface(max(3, int((size / 6) ** 0.5)))),
        "lattice": lattice,
        "lattice turned": turned(lattice),
        "tilted lattice": tilted,
        "flat": flat,
        "flat turned": turned(flat),
        "flat, x = z": np.column_stack([ball[:, 0], ball[:, 1], ball[:, 0]]),
        "needle": turned(on_sphere(rng, size) * [1, 1e-12, 1e-12]),
        "thinner needle": turned(on_sphere(rng, size) * [1, 1e-16, 1e-16]),
        "straight": np.outer(rng.integers(-9, 10, size), [3.0, -1.0, 0.1]),
        "straight, rounded": np.outer(rng.random(size), [3.0, -1.0, 0.1]),
        "cluster and one": np.concatenate([1 + 1e-15 * rng.normal(size=(size, 3)), [[-1, -1, -1]]]),
        "cluster": 1 + 1e-15 * rng.normal(size=(size, 3)),
        "arcs": arcs,
        "arcs turned": turned(arcs),
        "moment curve": np.column_stack([t, t * t, t**3]),
        "crowded arc": np.column_stack([fine, fine * fine, fine**3]),
        "crowded spiral": np.column_stack([fine * np.cos(9 * fine), fine * np.sin(9 * fine), fine * fine]),
        "one point": np.tile([[0.1, -0.2, 0.3]], (size, 1)),
        "zero": np.tile([[0.0, -0.0, 0.0], [-0.0, 0.0, 0.0]], (half, 1)),
    }


def scaled_apart(rng, n: int) -> dict[str, np.ndarray]:
    """Coordinates at the ends of the doubles' range, and far from each other."""
    points = on_sphere(rng, n)
    mixed = points * 10.0 ** rng.integers(-300, 1, (n, 3))
    lattice = rng.integers(-2, 3, (n, 3)).astype(float)
    return {
        "1e-150": points * 1e-150,
        "1e150": points * 1e150,
        "1e-300": points * 1e-300,
        "1e308": points * 1e308,
        "subnormal": lattice * 5e-324,
        "largest": np.sign(lattice) * np.finfo(float).max,
        "all magnitudes": mixed,
        "all magnitudes above 1": points * 10.0 ** rng.integers(0, 309, (n, 3)) * 0.1,
        "the whole range": points * 10.0 ** rng.integers(-320, 308, (n, 3)),
        "1 and 1e-300": np.where(rng.random((n, 3)) < 0.5, lattice, lattice * 1e-300),
        "nearly flat": lattice * [1, 1, 1e-300],
        "nearly flat, tilted": np.column_stack([lattice[:, :2], lattice[:, 0] + lattice[:, 1]])
        + np.where(lattice == 0, lattice[:, ::-1] * 5e-324, 0),
        "nearly straight": lattice * [1, 1e-200, 1e-310],
        "crowded at 0": points * 2.0 ** -rng.integers(0, 1070, (n, 1)),
    }


# --- the oracle: brute force in integers --------------------------------------------------------


def integers(points: np.ndarray) -> list[tuple[int, ...]]:
    """The doubles times one power of two."""
    ratios = [[value.as_integer_ratio() for value in row] for row in np.asarray(points).tolist()]
    common = max(denominator for row in ratios for _, denominator in row)
    return [tuple(a * (common // b) for a, b in row) for row in ratios]


def minus(p, q):
    return tuple(a - b for a, b in zip(p, q))


def cross(u, v):
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def inner(u, v):
    return sum(a * b for a, b in zip(u, v))


def rank(points) -> int:
    """Affine rank by elimination."""
    rows = [[Fraction(value) for value in minus(p, points[0])] for p in dict.fromkeys(points)]
    found = 0
    for column in range(3):
        pivot = next((row for row in rows[found:] if row[column]), None)
        if pivot is None:
            continue
        rows.remove(pivot)
        rows.insert(found, pivot)
        found += 1
        for row in rows[found:]:
            factor = row[column] / pivot[column]
            row[:] = [a - factor * b for a, b in zip(row, pivot)]
    return found


def said(points) -> str:
    return f"\nconvex_hull(np.array({np.asarray(points).tolist()!r}))" if len(points) <= 400 else ""


def check_by_brute_force(points: np.ndarray, hull: Hull) -> None:
    """Everything the interface promises, each by its definition; for small clouds."""
    exact, tell = integers(points), said(points)
    distinct = set(exact)
    assert hull.dimension == rank(exact), tell
    vertices = hull.vertices.tolist()
    assert vertices == sorted(set(vertices)), tell
    corners = {exact[v] for v in vertices}
    assert len(corners) == len(vertices), tell
    if hull.dimension < 2:
        assert corners == {min(distinct), max(distinct)}, tell
        assert hull.facets.shape == (0, 3), tell
        return
    facets = [tuple(row) for row in hull.facets.tolist()]
    assert {v for row in facets for v in row} == set(vertices), tell
    edges = [(row[k], row[(k + 1) % 3]) for row in facets for k in range(3)]
    for row in facets:
        a, b, c = (exact[v] for v in row)
        normal = cross(minus(b, a), minus(c, a))
        assert any(normal), (row, tell)
        heights = [inner(normal, minus(p, a)) for p in distinct]
        assert max(heights) == 0, (row, tell)
        assert (min(heights) == 0) == (hull.dimension == 2), (row, tell)
    if hull.dimension == 3:
        assert len(set(edges)) == len(edges), tell
        assert {(b, a) for a, b in edges} == set(edges), tell
        assert len(vertices) - len(edges) // 2 + len(facets) == 2, tell
        check_volume(exact, facets, tell)
        return
    front = facets[: len(facets) // 2]
    assert [row[::-1] for row in front] == facets[len(front) :], tell
    check_flat_by_area(exact, distinct, front, tell)


def check_volume(exact, facets, tell) -> None:
    """The surface's cones from any point of the hull fill the same volume: it is passed over once."""
    apex = exact[facets[0][0]]
    volumes = [inner(cross(minus(exact[a], apex), minus(exact[b], apex)), minus(exact[c], apex)) for a, b, c in facets]
    assert min(volumes) >= 0, tell
    other = exact[facets[-1][1]]
    again = [inner(cross(minus(exact[a], other), minus(exact[b], other)), minus(exact[c], other)) for a, b, c in facets]
    assert sum(volumes) == sum(again) > 0, tell


def check_flat_by_area(exact, distinct, front, tell) -> None:
    """The triangles lie in the plane's hull and have its area, found by a monotone chain."""
    a, b, c = (exact[v] for v in front[0])
    axis = next(k for k in range(3) if cross(minus(b, a), minus(c, a))[k])
    drop = {p: (p[(axis + 1) % 3], p[(axis + 2) % 3]) for p in distinct}

    def area(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    chains = []
    for run in (sorted(drop.values()), sorted(drop.values(), reverse=True)):
        chain: list[tuple[int, int]] = []
        for p in run:
            while len(chain) > 1 and area(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        chains += chain[:-1]
    areas = [area(*(drop[exact[v]] for v in row)) for row in front]
    assert min(areas) > 0 or max(areas) < 0, tell
    assert abs(sum(areas)) == sum(area(chains[0], p, q) for p, q in pairwise(chains)), tell
    assert set(chains) <= {drop[exact[v]] for row in front for v in row}, tell


def check_supports(rng, points: np.ndarray, hull: Hull) -> None:
    """In many directions no point of the cloud lies beyond the hull's vertices, but for rounding."""
    scale = np.abs(points).max()
    unit = points / scale
    for direction in np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(200, 3))]):
        heights = unit[:, 0] * direction[0] + unit[:, 1] * direction[1] + unit[:, 2] * direction[2]
        assert heights[hull.vertices].max() >= heights.max() - 1e-14, direction.tolist()


# --- small clouds, by brute force ---------------------------------------------------------------

NAMES = list(families(np.random.default_rng(0), 12))
SCALES = list(scaled_apart(np.random.default_rng(0), 12))


@cache
def all_clouds(size: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng([size, seed])
    return families(rng, size) | scaled_apart(rng, size)


@pytest.mark.many(2)
@pytest.mark.parametrize("name", [*NAMES, *SCALES])
def test_small_clouds_by_brute_force(name):
    for size, seed in product((8, 12, 30), range(3)):
        points = all_clouds(size, seed)[name]
        hull = convex_hull(points)
        check_by_brute_force(points, hull)
        validate_hull(points, hull)


def test_few_points():
    rng = np.random.default_rng(1)
    for n in range(1, 8):
        for _ in range(60):
            points = rng.integers(-1, 2, (n, 3)).astype(float)
            hull = convex_hull(points)
            check_by_brute_force(points, hull)
            validate_hull(points, hull)


@settings(max_examples=300, deadline=None, derandomize=True, database=None)
@given(
    st.lists(st.tuples(*[st.integers(-2, 2)] * 3), min_size=1, max_size=25),
    st.sampled_from([1.0, 0.1, 1e-160, 5e-324, 1e290]),
    st.sampled_from([(0, 0, 0), (1, 1, 1), (1e-17, 1, 0.3), (1e9, 0, 0)]),
)
def test_points_of_a_small_grid(rows, scale, shift):
    points = np.array(rows, dtype=float) * scale + np.array(shift) * scale
    hull = convex_hull(points)
    check_by_brute_force(points, hull)
    validate_hull(points, hull)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3), min_size=1, max_size=12))
def test_any_finite_doubles(rows):
    points = np.array(rows)
    hull = convex_hull(points)
    check_by_brute_force(points, hull)
    validate_hull(points, hull)


def test_last_bits_decide():
    """A cube's corners, some moved by an ulp: sides that are flat, or bent by the least there is."""
    rng = np.random.default_rng(3)
    corners = np.array(list(product((0.1, 0.7), repeat=3)))
    for _ in range(150):
        points = np.nextafter(corners, corners + rng.integers(-1, 2, corners.shape))
        points = np.concatenate([points, 0.5 * (points[:4] + points[4:]), 0.25 * points[:6:2] + 0.75 * points[1:6:2]])
        check_by_brute_force(points, convex_hull(points))


# --- large ones ---------------------------------------------------------------------------------


@pytest.mark.many(2)
@pytest.mark.parametrize("name", NAMES)
def test_large_clouds(name):
    rng = np.random.default_rng(5)
    points = all_clouds(1200, 0)[name]
    hull = convex_hull(points)
    validate_hull(points, hull)
    check_supports(rng, points + 0.0 if points.any() else points + 1.0, hull)


def test_larger_clouds():
    rng = np.random.default_rng(6)
    for points in (on_sphere(rng, 10_000), turned(prism(5_000)), prism(5_000), cube_surface(40)):
        hull = convex_hull(points)
        validate_hull(points, hull)
        check_supports(rng, points, hull)


@pytest.mark.slow
def test_a_crowd_over_a_ring():
    """Wide fans over many points, and more tests than a hull should take: both ways out are taken."""
    t = np.linspace(0, 1, 600)
    for crowd in (1e-8 * 2.0 ** (-50 * t), 1e-4 * 2.0 ** (-50 * t)):
        arc = np.column_stack([crowd, 0 * t, 0.3 - crowd * crowd])
        spiral = np.column_stack([crowd * np.cos(9 * t), crowd * np.sin(9 * t), 0.3 - crowd])
        for points in (np.concatenate([ring(2000), arc]), turned(np.concatenate([ring(2000), arc, spiral]))):
            validate_hull(points, convex_hull(points))


def test_support_values_of_a_lattice_are_equal():
    """In integers the comparison is exact."""
    rng = np.random.default_rng(7)
    points = rng.integers(-60, 61, (20_000, 3))
    points = points[(points * points).sum(axis=1) <= 3600]
    hull = convex_hull(points.astype(float))
    for direction in rng.integers(-50, 51, (500, 3)):
        heights = points @ direction
        assert heights[hull.vertices].max() == heights.max(), direction.tolist()


def test_only_corners_of_a_box_are_kept():
    """Points on flat sides and straight edges are rarely kept, and never where distances tie exactly."""
    for points in (cube_surface(9), np.array(list(product(range(7), repeat=3)), dtype=float)):
        hull = convex_hull(points)
        assert len(hull.vertices) == 8
        assert len(hull.facets) == 12


def test_every_point_of_a_sphere_or_a_prism_is_kept():
    for points in (prism(40), turned(prism(400)), on_sphere(np.random.default_rng(8), 500)):
        hull = convex_hull(points)
        assert len(hull.vertices) == len(points)
        assert len(hull.facets) == 2 * len(points) - 4


# --- the same answer again ----------------------------------------------------------------------


def test_the_same_points_give_the_same_rows():
    for points in all_clouds(30, 0).values():
        first, second = convex_hull(points), convex_hull(np.asfortranarray(points))
        assert all(np.array_equal(a, b) for a, b in zip(first, second))


def test_a_power_of_two_changes_nothing():
    for name in NAMES:
        points = all_clouds(30, 1)[name]
        for factor in (2.0**-300, 2.0**700):
            assert all(np.array_equal(a, b) for a, b in zip(convex_hull(points), convex_hull(points * factor))), name


def test_input_is_left_alone_and_checked():
    points = np.array(list(product((0, 1), repeat=3)))
    assert len(convex_hull(points).vertices) == 8  # integers are fine
    assert len(convex_hull(points[:, ::-1]).vertices) == 8
    frozen = points.astype(float)
    frozen.flags.writeable = False
    assert convex_hull(frozen).facets.dtype == np.int32
    for wrong in (np.zeros((0, 3)), np.zeros((4, 2)), np.zeros(3)):
        with pytest.raises(ValueError, match=r"\(n, 3\)"):
            convex_hull(wrong)
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match=r"points\[1\]"):
            convex_hull(np.array([[0.0, 0, 0], [0, value, 0]]))


CHILD = r"""
import pickle, sys
from collide import kernels
from collide.hull import quickhull as Q
from collide.hull.exact_hull import convex_hull
from collide.hull.validate_hull import validate_hull
assert kernels.PLAIN_PYTHON

clouds = pickle.load(sys.stdin.buffer)
pickle.dump([tuple(convex_hull(points)) for points in clouds], sys.stdout.buffer)

# What only large crowded clouds bring about: fans searched by halving, corners in a shuffled order.
sure = [0, 0]
known = Q.locate
def counted(*args):
    answer = known(*args)
    sure[answer[1]] += 1
    return answer
Q.locate, Q.WIDE_FAN = counted, 4
for Q.BUDGET, some in ((100, clouds[::2]), (0, clouds[1::2])):
    for points in some:
        validate_hull(points, convex_hull(points))
assert min(sure) > 20, sure
"""


@pytest.mark.slow
def test_plain_python_builds_the_same_hulls():
    """Also where fans are searched by halving, and corners come in a shuffled order."""
    clouds = [*all_clouds(30, 0).values(), *list(all_clouds(100, 0).values())[::5]]
    flat = np.array([[x, y, x + 2 * y] for x in range(4) for y in range(3)], dtype=float)
    clouds += [flat, flat[:3], flat[:1]]
    child = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CHILD],
        input=pickle.dumps(clouds), capture_output=True, check=False, timeout=300,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )
    assert child.returncode == 0, child.stderr.decode()
    for points, plain in zip(clouds, pickle.loads(child.stdout), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(convex_hull(points), plain)), said(points)


# --- the validator rejects what is wrong --------------------------------------------------------


def rejected(points, hull: Hull, why: str) -> None:
    with pytest.raises(AssertionError, match=why):
        validate_hull(points, hull)


def as_hull(dimension, facets, vertices=None) -> Hull:
    facets = np.array(facets, dtype=np.int32).reshape(-1, 3)
    return Hull(dimension, np.unique(facets) if vertices is None else np.array(vertices, dtype=np.int32), facets)


@pytest.mark.parametrize("name", ["ball", "prism turned", "cube surface", "lattice"])
def test_damaged_solids_are_rejected(name):
    rng = np.random.default_rng(9)
    points = all_clouds(30, 2)[name]
    hull = convex_hull(points)
    facets = hull.facets
    for at in rng.permutation(len(facets))[:6]:
        flipped = facets.copy()
        flipped[at] = flipped[at, ::-1]
        rejected(points, as_hull(3, flipped), "twice")
        rejected(points, as_hull(3, np.delete(facets, at, axis=0), hull.vertices), "open|corners are not")
    rejected(points, as_hull(3, facets[:, ::-1]), "above it|turn its back")
    outside = np.concatenate([points, [2.0 * points[hull.vertices[0]] - points.mean(axis=0)]])
    rejected(outside, hull, "outside")
    barely = points[facets[0]].mean(axis=0) + 1e-13 * (points[facets[0]].mean(axis=0) - points.mean(axis=0))
    rejected(np.concatenate([points, [barely]]), hull, "outside")
    rejected(points, hull._replace(vertices=hull.vertices[1:]), "corners are not")
    rejected(points, hull._replace(vertices=hull.vertices[::-1]), "sorted")
    rejected(points, hull._replace(dimension=2), "seen from behind")
    smaller = convex_hull(points[hull.vertices[1:]])
    kept = hull.vertices[1:]
    rejected(points, Hull(3, np.sort(kept[smaller.vertices]), kept[smaller.facets].astype(np.int32)), "outside")


def test_bent_edges_are_rejected():
    """Any one quadrilateral of a convex surface turned to its other diagonal makes a dent, or zero area."""
    points = on_sphere(np.random.default_rng(10), 40)
    facets = convex_hull(points).facets
    edges = {
        (int(row[k]), int(row[(k + 1) % 3])): (f, int(row[k - 1])) for f, row in enumerate(facets) for k in range(3)
    }
    done = 0
    for (a, b), (f, c) in edges.items():
        g, d = edges[b, a]
        if (c, d) not in edges and (d, c) not in edges and done < 20:
            other = facets.copy()
            other[f], other[g] = (a, d, c), (d, b, c)
            rejected(points, as_hull(3, other), "above it")
            done += 1
    assert done == 20


def test_surfaces_that_wind_twice_are_rejected():
    """Two apices over a pentagram: closed, of Euler characteristic 2, all edges convex."""
    points = np.concatenate([[[0, 0, 1], [0, 0, -1]], ring(5)])
    star = [2, 4, 6, 3, 5]
    facets = [(star[k], star[(k + 1) % 5], 0) for k in range(5)] + [(star[(k + 1) % 5], star[k], 1) for k in range(5)]
    rejected(points, as_hull(3, facets), "winds 2 times")


def test_flat_surfaces_given_as_solids_are_rejected():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])
    rejected(square, as_hull(3, [(0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)]), "one plane")
    straight = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1]])
    rejected(straight, as_hull(3, [(0, 1, 2), (0, 2, 3), (2, 1, 3), (1, 0, 3)]), "no area")


def test_damaged_flat_hulls_are_rejected():
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0], [1, 0, 0]])
    hull = convex_hull(points)
    validate_hull(points, hull)

    def both(front):
        return as_hull(2, [*front, *(row[::-1] for row in front)])

    validate_hull(points, both([(0, 1, 2), (0, 2, 3)]))
    rejected(points, both([(0, 1, 2)]), "outside")
    rejected(points, both([(0, 1, 2), (0, 3, 2)]), "twice|turned over")
    rejected(points, both([(0, 5, 1), (0, 1, 2), (0, 2, 3)]), "no area")
    rejected(points, both([(0, 4, 3), (0, 1, 4), (4, 1, 2)]), "turns inwards")
    rejected(points, both([(0, 1, 2), (0, 2, 3), (0, 1, 4)]), "twice")
    rejected(points, as_hull(2, [(0, 1, 2), (0, 2, 3)]), "seen from behind")
    rejected(np.concatenate([points, [[1, 1, 5e-324]]]), hull, "plane")
    rejected(np.concatenate([points, [[2 + 2**-50, 1, 0]]]), hull, "outside")
    star = np.concatenate([ring(5), [[0.0, 0, 0]]])
    order = [0, 2, 4, 1, 3]
    rejected(star, both([(order[k], order[(k + 1) % 5], 5) for k in range(5)]), "winds")


def test_damaged_straight_hulls_are_rejected():
    points = np.outer([0, 1, 2, 3], [1.0, 2.0, 3.0])
    hull = convex_hull(points)
    validate_hull(points, hull)
    none = np.zeros((0, 3))
    rejected(points, as_hull(1, none, [0, 2]), "beyond")
    rejected(points, as_hull(0, none, [0]), "another point")
    rejected(points, as_hull(1, none, [0]), "1 vertices")
    rejected(np.concatenate([points, [[1, 2, np.nextafter(3, 4)]]]), hull, "on the line")
    rejected(np.zeros((2, 3)), as_hull(1, none, [0, 1]), "same point")
    rejected(points[:2], as_hull(1, [(0, 1, 0)], [0, 1]), "with facets")
