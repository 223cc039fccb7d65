"""Hierarchies: every property by the validator, damage seen by the validator, Lemma 4.2 by brute force."""

from __future__ import annotations

import os
import subprocess
import sys
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hierarchy_families import STUBBORN, bipyramid, cube_grid, degree_doubling, families, prism, ring, sphere, turned

from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.hierarchy import DEGREE_BOUND, Hierarchy, build_hierarchy
from collide.papers.hierarchies.polar_hull import polar_of_hull
from collide.papers.hierarchies.validate_hierarchy import validate_hierarchy

NAMES = list(families(40))
#: In plain Python: the same tests on smaller bodies.
SIZE = 300 if os.environ.get("NUMBA_DISABLE_JIT") != "1" else 80


@cache
def built(name: str, bound: int) -> tuple[np.ndarray, Hierarchy]:
    points = families(SIZE)[name]
    return points, build_hierarchy(points, convex_hull(points), bound)


@pytest.mark.many(14)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bound", [0, 12, DEGREE_BOUND])
def test_families(name, bound):
    points, hierarchy = built(name, bound)
    late = hierarchy.depth if name == "crowded" or bound == 12 else (2 if name in STUBBORN else 1)
    validate_hierarchy(points, hierarchy, bounded_from=late)


@pytest.mark.many(14)
@pytest.mark.parametrize("name", NAMES)
def test_polars(name):
    points = families(SIZE // 2)[name]
    body = polar_of_hull(points, convex_hull(points))
    check_polar(points, body)
    validate_hierarchy(body.points, body.hierarchy, bounded_from=body.hierarchy.depth if name == "crowded" else 1)


def check_polar(points, body) -> None:
    """(v − o)·q < 1 for all, in integers; near the true polar point; all of the hull's facets have one."""
    hull = convex_hull(points)
    origin = [Fraction(x) for x in body.origin.tolist()]
    corners = {int(v): [Fraction(x) - o for x, o in zip(points[v].tolist(), origin)] for v in hull.vertices}
    for q, span in zip(body.points.tolist(), body.spans.tolist()):
        q = [Fraction(x) for x in q]
        heights = {v: sum(x * y for x, y in zip(corner, q)) for v, corner in corners.items()}
        assert max(heights.values()) < 1, f"polar point of {span} is outside"
        assert min(heights[v] for v in span) > 1 - 2.0**-8, f"polar point of {span} is far from its facet"
    sides = {tuple(t) for t in hull.facets.tolist()}
    planes = {frozenset(s) for s in body.spans.tolist()}
    assert len(planes) == len(body.spans) <= len(sides)


def test_polar_of_a_box_is_its_octahedron():
    points = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-4.0, 4.0)])
    body = polar_of_hull(points, convex_hull(points))
    assert body.origin.tolist() == [0, 0, 0] and len(body.points) == 6
    expected = [[s / h * (k == axis) for k in range(3)] for axis, h in enumerate((1, 2, 4)) for s in (-1, 1)]
    order = np.lexsort(body.points.T)
    assert np.allclose(body.points[order], np.array(expected)[np.lexsort(np.array(expected).T)], rtol=1e-14, atol=0)
    assert body.hierarchy.sizes.tolist()[0] == 6


def test_lemma_4_2_by_brute_force():
    """Planes tangent to a level at random vertices: at most one vertex of the finer level beyond, and among those
    listed."""
    rng = np.random.default_rng(4)
    beyond_some = tangents = 0
    for name in ("sphere", "bipyramid", "prism, turned", "degree doubling", "cube", "arcs", "pancake, turned"):
        for bound in (0, DEGREE_BOUND):
            _, hierarchy = built(name, bound)
            exact = [[Fraction(x) for x in row] for row in hierarchy.points.tolist()]
            for level in range(1, hierarchy.depth):
                coarse, fine = hierarchy.vertices(level).tolist(), hierarchy.vertices(level - 1).tolist()
                for direction in rng.integers(-20, 21, (4, 3)).tolist():
                    height = {v: sum(d * x for d, x in zip(direction, exact[v])) for v in {*coarse, *fine}}
                    top = max(height[v] for v in coarse)
                    beyond = [v for v in fine if height[v] > top]
                    assert len(beyond) <= 1, (name, level, direction)
                    for v in (v for v in coarse if height[v] == top):
                        tangents += 1
                        listed = hierarchy.removed_of(v, level).tolist()
                        assert set(beyond) <= set(listed), (name, level, direction, v)
                        if hierarchy.birth[v] == level:
                            assert height[int(hierarchy.parent[v])] >= top
                    beyond_some += len(beyond)
    assert beyond_some > 60 and tangents > 500


def test_degree_doubling_has_its_degrees():
    """The text's body: without a bound the degree of q doubles from level to level; with one it does not."""
    points = degree_doubling(6)
    hull = convex_hull(points)
    plain = build_hierarchy(points, hull, 0)
    assert plain.degrees(0).max() == len(points) - 1 == 192
    assert [int(plain.degrees(k).max()) for k in range(1, 4)] >= [90, 40, 20]
    bounded = build_hierarchy(points, hull)
    assert max(int(bounded.degrees(k).max()) for k in range(1, bounded.depth)) <= 24


def test_flat_sides_have_low_degrees():
    points = prism(500)
    hierarchy = build_hierarchy(points, convex_hull(points))
    assert hierarchy.degrees(0).max() <= 30


def test_points_on_sides_are_dropped():
    points = cube_grid(5)
    hierarchy = build_hierarchy(points, convex_hull(points))
    assert len(hierarchy.vertices(0)) == 8
    assert set(np.abs(points[hierarchy.vertices(0)] - 2).ravel()) == {2.0}


def test_tetrahedron_is_its_own_hierarchy():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    hierarchy = build_hierarchy(points, convex_hull(points))
    assert hierarchy.depth == 1 and hierarchy.degrees(0).tolist() == [3] * 4
    validate_hierarchy(points, hierarchy)
    validate_hierarchy(points, build_hierarchy(points, convex_hull(points), 0))


# --- refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "word"),
    [([[1, 2, 3]], "point"), ([[0, 0, 0], [1, 1, 1]], "segment"), (ring(12).tolist(), "flat")],
)
def test_bodies_without_interior_are_refused(points, word):
    points = np.array(points, dtype=float)
    with pytest.raises(ValueError, match=word):
        build_hierarchy(points, convex_hull(points))
    with pytest.raises(ValueError, match="no interior"):
        polar_of_hull(points, convex_hull(points))


def test_bad_arguments_are_refused():
    points = sphere(20)
    hull = convex_hull(points)
    with pytest.raises(ValueError, match="degree_bound"):
        build_hierarchy(points, hull, 5)
    with pytest.raises(ValueError, match="strictly inside"):
        polar_of_hull(points, hull, origin=np.array([2.0, 0, 0]))
    with pytest.raises(ValueError, match="strictly inside"):
        polar_of_hull(points, hull, origin=points[hull.facets[0]][0])
    with pytest.raises(ValueError, match="size"):
        polar_of_hull(points * 1e-80, hull)
    hierarchy = build_hierarchy(points, hull)
    with pytest.raises(ValueError, match="level"):
        hierarchy.row_of(int(hierarchy.vertices(0)[0]), 99)


def test_thin_oblique_bodies_have_no_polar_in_doubles():
    points = turned(sphere(60) * [1, 1, 1e-14])
    hull = convex_hull(points)
    assert hull.dimension == 3
    with pytest.raises(ValueError, match=r"thin|inside"):
        polar_of_hull(points, hull)
    validate_hierarchy(points, build_hierarchy(points, hull))


def test_sizes_at_the_ends_of_doubles():
    """The primal hierarchy of any finite points with interior; also where cuts are made."""
    for factor in (1e-300, 1e-150, 1e150, 1e300):
        points = bipyramid(90) * factor
        hierarchy = build_hierarchy(points, convex_hull(points), 16)
        assert (hierarchy.birth > 0).any()
        validate_hierarchy(points, hierarchy, bounded_from=3)


# --- damage -------------------------------------------------------------------------------------


def damaged(hierarchy: Hierarchy, **fields) -> Hierarchy:
    copy = {
        name: value.copy() if isinstance(value, np.ndarray) else value for name, value in hierarchy._asdict().items()
    }
    for name, change in fields.items():
        copy[name] = change(copy[name]) if callable(change) else change
    return Hierarchy(**copy)


def noticed(points, hierarchy, prop, **options) -> None:
    with pytest.raises(AssertionError, match=rf"^{prop}\b"):
        validate_hierarchy(points, hierarchy, **options)


def test_damage_to_levels_is_noticed():
    points, hierarchy = built("bipyramid", DEGREE_BOUND)
    new = np.flatnonzero(hierarchy.birth > 0)
    first = int(new[0])

    def moved(by):
        return lambda p: with_row(p, first, p[first] * by)

    noticed(points, damaged(hierarchy, points=moved(1.5)), "B2")
    noticed(points, damaged(hierarchy, points=moved(0.5)), "B2")
    noticed(points, damaged(hierarchy, degree_bound=10), "B3")
    noticed(points, damaged(hierarchy, parent=lambda p: with_row(p, first, -1)), "rows")
    noticed(points, damaged(hierarchy, removed=lambda r: np.roll(r, 1)), "Lemma 4.2")
    noticed(points, damaged(hierarchy, neighbours=lambda n: with_swap(n)), "rows")
    noticed(points * [1, 1, 2], hierarchy, "rows")
    noticed(np.concatenate([points, [[0, 0, 3.0]]]), appended(hierarchy), "B1")


def with_row(array, row, value):
    array[row] = value
    return array


def with_swap(array):
    array[[0, 1]] = array[[1, 0]]
    return array


def appended(hierarchy: Hierarchy) -> Hierarchy:
    """The hierarchy as if one more point had been given, outside, and overlooked."""
    count = int((hierarchy.parent < 0).sum())

    def put(value):
        return lambda array: np.insert(array, count, value, axis=0)

    def shift(ids):
        return ids + (ids >= count).astype(ids.dtype)

    return damaged(
        hierarchy, points=put([0, 0, 3.0]), birth=put(-1), last=put(-1), parent=lambda p: put(-1)(shift(p)),
        row=put(-1),
        neighbours=shift, removed=shift, level_vertices=shift,
    )


def test_damage_to_dependence_and_ends_is_noticed():
    points, hierarchy = built("sphere", 0)
    shallow = cut_short(hierarchy, hierarchy.depth - 1)
    noticed(points, shallow, "A1")
    noticed(points, skip_level(hierarchy), "A4")


def cut_short(hierarchy: Hierarchy, depth: int) -> Hierarchy:
    """Without the levels from ``depth`` on."""
    from collide.papers.hierarchies.level_rows import by_vertex

    return _of_levels(hierarchy, range(depth), by_vertex)


def skip_level(hierarchy: Hierarchy) -> Hierarchy:
    """Without its second level: what leaves is no longer independent."""
    from collide.papers.hierarchies.level_rows import by_vertex

    return _of_levels(hierarchy, [0, *range(2, hierarchy.depth)], by_vertex)


def _of_levels(hierarchy: Hierarchy, levels, by_vertex) -> Hierarchy:
    kept = []
    for level in levels:
        vertices = hierarchy.vertices(level)
        rings = [hierarchy.neighbours_of(int(v), level) for v in vertices]
        start = np.concatenate([[0], np.cumsum([len(r) for r in rings])])
        kept.append((vertices.copy(), start, np.concatenate(rings)))
    birth, last, *rest = by_vertex(kept, len(hierarchy.points), hierarchy.parent)
    return Hierarchy(hierarchy.points, hierarchy.degree_bound, birth, last, hierarchy.parent, *rest)


def test_added_vertices_are_no_dk_hierarchy():
    points, hierarchy = built("bipyramid", DEGREE_BOUND)
    noticed(points, damaged(hierarchy, degree_bound=0), "A3")


# --- the same everywhere ------------------------------------------------------------------------

SCRIPT = """
import sys, hashlib
sys.path.insert(0, {folder!r})
from hierarchy_families import families
from collide.papers.hierarchies.hierarchy import build_hierarchy
from collide.papers.hierarchies.polar_hull import polar_of_hull
from collide.hull.exact_hull import convex_hull
digest = hashlib.sha256()
for name, points in families(40).items():
    hull = convex_hull(points)
    fields = [*build_hierarchy(points, hull, 12)]
    body = polar_of_hull(points, hull, 12)
    for value in [*fields, *body[:3], *body.hierarchy]:
        digest.update(value.tobytes() if hasattr(value, "tobytes") else str(value).encode())
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_kernels_run_as_plain_python_with_the_same_bits():
    """Built by compiled kernels and by the same source as plain Python: all arrays alike."""
    script = SCRIPT.format(folder=str(Path(__file__).parent))
    found = {}
    for plain in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": plain}
        done = subprocess.run(
            [sys.executable, "-c", script],
            check=False, capture_output=True, text=True, timeout=300, env=environment,
            cwd=Path(__file__).parents[3],
        )
        assert done.returncode == 0, done.stderr
        found[plain] = done.stdout
    assert found["0"] == found["1"]
