"""Checks that a hierarchy has the properties A1–A5 or B1–B5, in Python integers, without code of the builder.

Names are as of Barba and Langerman, section 4. Checked where the text leaves details open:

* B3 holds from ``bounded_from`` on. The text makes P simple by perturbing its facets, and includes P itself. Here
  P is level 0 as given, with any degrees;
* A4, B4: V(P_i) \\ V(P_{i+1}) is independent in P_i. The text's own levels P_{i+1} of the second kind, the same
  polyhedron with more vertices, are left out: a cut and its removal are a single level here;
* A5, B5: depth ≤ 8 + 2.5·log2 n, and at most 16 n vertices in all levels;
* Lemma 4.2 as the walk uses it: ``removed`` names all removed neighbours in the finer level; a vertex
  added by a cut is in the hull of the vertex cut and its neighbours, and not in the hull of the neighbours alone.
"""

from __future__ import annotations

import math

import numpy as np

from collide.hull.exact_hull import Hull, convex_hull
from collide.hull.validate_hull import validate_hull
from collide.papers.hierarchies.hierarchy import Hierarchy

#: Depth at most the first plus the second times log2 n, vertices of all levels at most the third times n.
DEPTH_AT_MOST, DEPTH_PER_LOG, SIZE_PER_VERTEX = 8.0, 2.5, 16.0


def validate_hierarchy(points: np.ndarray, hierarchy: Hierarchy, bounded_from: int = 1) -> None:
    """Raise AssertionError with the name of the first violated property; exact.

    points : (n, 3) as given to `build_hierarchy`.
    bounded_from : first level with B3 checked; 1 unless vertices of large degree are neighbours.

    O(total size) for the combinatorics; inclusion tests take the new vertices of a level times its facets.
    """
    name = "B" if hierarchy.degree_bound else "A"
    points = np.asarray(points, dtype=np.float64)
    levels = [_surface(hierarchy, level) for level in range(hierarchy.depth)]
    _check_rows(hierarchy, points)
    _check_ends(hierarchy, points, levels, name)
    for level in range(hierarchy.depth - 1):
        _check_inclusion(hierarchy, levels, level, name)
        _check_independent(hierarchy, level, name)
        _check_removed(hierarchy, level)
    for level, triangles in enumerate(levels):
        _check_strictly_extreme(hierarchy, triangles, level)
    if hierarchy.degree_bound:
        _check_degrees(hierarchy, bounded_from)
    else:
        assert not (hierarchy.birth > 0).any(), "A3: a level has a vertex that the finer level has not"
    _check_size(hierarchy, name)


def _surface(hierarchy: Hierarchy, level: int) -> np.ndarray:
    """(f, 3) triangles of a level, after a check that its neighbour lists form a single closed surface."""
    vertices = hierarchy.vertices(level).tolist()
    corners: set[tuple[int, int, int]] = set()
    for v in vertices:
        ring = hierarchy.neighbours_of(v, level).tolist()
        assert len(set(ring)) == len(ring) >= 3, f"rows: vertex {v} has a neighbour twice in level {level}"
        corners.update((v, a, b) for a, b in zip(ring, [*ring[1:], ring[0]]))
    assert all((b, c, a) in corners for a, b, c in corners), f"rows: the rings of level {level} do not fit together"
    lowest_first = sorted(t for t in corners if t[0] == min(t))
    return np.array(lowest_first, dtype=np.int32).reshape(-1, 3)


def _check_rows(hierarchy: Hierarchy, points: np.ndarray) -> None:
    birth, last = hierarchy.birth, hierarchy.last
    assert np.array_equal(hierarchy.points[: len(points)], points), "rows: the points are not the first ones"
    assert not birth[: len(points)].max(initial=0), "rows: a point comes late"
    assert (birth[len(points) :] != 0).all(), "rows: an added vertex is in level 0"
    for level in range(hierarchy.depth):
        expected = np.flatnonzero((birth >= 0) & (birth <= level) & (level <= last))
        assert np.array_equal(hierarchy.vertices(level), expected), f"rows: birth and last do not fit level {level}"
    late = birth > 0
    parents = hierarchy.parent[late]
    assert (parents >= 0).all() and (hierarchy.parent[~late] == -1).all(), "rows: parents do not fit birth"
    assert (last[parents] == birth[late] - 1).all(), "rows: a parent does not leave when its new vertices come"


def _check_ends(hierarchy: Hierarchy, points: np.ndarray, levels: list[np.ndarray], name: str) -> None:
    first = hierarchy.vertices(0)
    _named(f"{name}1: level 0 is not P", points, Hull(3, first, levels[0]))
    assert len(hierarchy.vertices(hierarchy.depth - 1)) == 4, f"{name}1: the last level is no tetrahedron"


def _named(message: str, points: np.ndarray, hull: Hull) -> None:
    """`validate_hull` with the property's name in front."""
    try:
        validate_hull(points, hull)
    except AssertionError as error:
        raise AssertionError(f"{message}: {error}") from None


def _check_inclusion(hierarchy: Hierarchy, levels: list[np.ndarray], level: int, name: str) -> None:
    """Levels i and i + 1 are convex surfaces, and no vertex of i + 1 is outside of level i."""
    finer, coarser = hierarchy.vertices(level), hierarchy.vertices(level + 1)
    both = np.union1d(finer, coarser)
    for vertices, triangles, cloud in (
        (finer, levels[level], both), (coarser, levels[level + 1], coarser),
    ):
        hull = Hull(3, _places(cloud, vertices), _places(cloud, triangles))
        _named(f"{name}2: level {level + 1} is not in level {level}", hierarchy.points[cloud], hull)


def _places(cloud: np.ndarray, ids: np.ndarray) -> np.ndarray:
    return np.searchsorted(cloud, ids).astype(np.int32)


def _check_independent(hierarchy: Hierarchy, level: int, name: str) -> None:
    gone = set(np.setdiff1d(hierarchy.vertices(level), hierarchy.vertices(level + 1)).tolist())
    assert gone, f"{name}4: level {level + 1} is level {level}"
    for v in gone:
        beside = gone.intersection(hierarchy.neighbours_of(v, level).tolist())
        assert not beside, f"{name}4: neighbours {v} and {min(beside)} of level {level} leave together"


def _check_removed(hierarchy: Hierarchy, level: int) -> None:
    """Lemma 4.2 between a level and the next one."""
    for v in hierarchy.vertices(level + 1).tolist():
        listed = hierarchy.removed_of(v, level + 1).tolist()
        if hierarchy.birth[v] == level + 1:
            w = int(hierarchy.parent[v])
            assert listed == [w], f"Lemma 4.2: new vertex {v} does not name the vertex cut, {w}"
            _check_combination(hierarchy, v, w, level)
        else:
            ring = hierarchy.neighbours_of(v, level).tolist()
            expected = [u for u in ring if hierarchy.last[u] == level]
            assert sorted(listed) == sorted(expected), f"Lemma 4.2: the vertices gone beside {v} are not those listed"


def _check_combination(hierarchy: Hierarchy, v: int, w: int, level: int) -> None:
    ring = hierarchy.neighbours_of(w, level)
    around = hierarchy.points[np.append(ring, v)]
    with_w = hierarchy.points[np.append(ring, [w, v])]
    hull = convex_hull(with_w)
    assert len(with_w) - 1 not in hull.vertices, f"B2: new vertex {v} is not in the star of {w}"
    hull = convex_hull(around)
    assert len(around) - 1 in hull.vertices, f"Lemma 4.2: new vertex {v} is in the hull of the neighbours of {w}"


def _integers(points: np.ndarray) -> np.ndarray:
    """The coordinates times one power of two, as Python integers."""
    fraction, exponent = np.frexp(points)
    mantissa = (fraction * 2.0**53).astype(np.int64)
    lowest = exponent[mantissa != 0].min() if mantissa.any() else 0
    return mantissa.astype(object) << np.where(mantissa == 0, 0, exponent - lowest).astype(object)


def _check_strictly_extreme(hierarchy: Hierarchy, triangles: np.ndarray, level: int) -> None:
    """Around every vertex the facets lie in three planes or more."""
    vertices = hierarchy.vertices(level)
    exact = _integers(hierarchy.points[vertices])
    place = {int(v): k for k, v in enumerate(vertices)}
    opposite = {(a, b): c for t in triangles.tolist() for a, b, c in (t, t[1:] + t[:1], t[2:] + t[:2])}
    bends = dict.fromkeys(place, 0)
    for (a, b), c in opposite.items():
        if a < b:
            p, q, r, s = (exact[place[v]] for v in (a, b, c, opposite[b, a]))
            u, v, w = q - p, r - p, s - p
            normal = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
            if normal[0] * w[0] + normal[1] * w[1] + normal[2] * w[2] != 0:
                bends[a] += 1
                bends[b] += 1
    flat = [v for v, n_bends in bends.items() if n_bends < 3]
    assert not flat, f"vertex {flat[0]} of level {level} is not strictly extreme"


def _check_degrees(hierarchy: Hierarchy, bounded_from: int) -> None:
    for level in range(bounded_from, hierarchy.depth):
        largest = int(hierarchy.degrees(level).max())
        assert largest <= hierarchy.degree_bound, f"B3: level {level} has a vertex of degree {largest}"


def _check_size(hierarchy: Hierarchy, name: str) -> None:
    count = int(hierarchy.sizes[0])
    bound = DEPTH_AT_MOST + DEPTH_PER_LOG * math.log2(count)
    assert hierarchy.depth <= bound, f"{name}5: {hierarchy.depth} levels for {count} vertices"
    total = int(hierarchy.sizes.sum())
    assert total <= SIZE_PER_VERTEX * count, f"{name}5: {total} vertices in all levels, {count} in the first"
