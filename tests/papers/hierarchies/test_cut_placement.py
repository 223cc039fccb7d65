"""Where new vertices of a cut are put: proofs by fractions, axes ahead of which all neighbours are, a dome's depths."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from half_edge_surface import Surface, view_of
from naive import rng_of
from naive_triangles import cross, inner, minus

from collide.numerics.vec3 import Vec3
from collide.papers.hierarchies.cut_placement import (
    INSETS,
    Cut,
    axis_of,
    difference,
    find_inner,
    inset_of,
    put_new,
    shortest_part,
    twos,
    unit_normal,
    within,
    write_point,
)
from collide.papers.hierarchies.half_edges import read_ring
from collide.papers.hierarchies.true_facets import Cloud

pytestmark = pytest.mark.plain_kernels


def exact_within(points, w, r, beside, s, x) -> bool:
    """Whether x is inside the tetrahedron, or inside its face w, r, s, by barycentric coordinates."""
    P = [[Fraction(c) for c in row] for row in np.asarray(points).tolist()]

    def volume(a, b, c, d):
        return inner(cross(minus(b, a), minus(c, a)), minus(d, a))

    whole = volume(P[w], P[r], P[beside], P[s])
    if whole == 0:
        return False
    parts = [
        volume(P[x], P[r], P[beside], P[s]) / whole, volume(P[w], P[x], P[beside], P[s]) / whole,
        volume(P[w], P[r], P[x], P[s]) / whole, volume(P[w], P[r], P[beside], P[x]) / whole,
    ]
    return parts[0] > 0 and parts[1] > 0 and parts[3] > 0 and parts[2] >= 0


def test_within_is_what_barycentric_coordinates_say():
    rng = rng_of("within")
    seen: Counter = Counter()
    for _ in range(300):
        points = rng.integers(-3, 4, (5, 3)).astype(float)
        if rng.random() < 0.5:
            weights = rng.integers(0, 3, 4)
            points[4] = (weights @ points[:4]) / max(weights.sum(), 1)
        want = exact_within(points, 0, 1, 2, 3, 4)
        assert within(view_of(Cloud(points)), 0, 1, 2, 3, 4) == want, points.tolist()
        seen[want] += 1
    assert min(seen[True], seen[False]) > 20, seen


def test_new_vertices_are_proven_inside():
    rng = rng_of("new vertices")
    put = 0
    for _ in range(10):
        points = rng.normal(size=(20, 3)) * (1.0, 1.0, 0.3)
        surface = Surface(points)
        cloud = surface.kept
        cloud.reserve(cloud.used + 30)
        view = view_of(cloud)
        w = int(rng.choice(surface.vertices))
        ring, outer = np.zeros(40, dtype=np.int64), np.zeros(40, dtype=np.int64)
        k = read_ring(surface.mesh, w, ring, outer)
        axis, nearest = axis_of(view.scaled, w, ring, k)
        ahead = [float(np.dot(axis, difference(view.scaled, w, r))) for r in ring[:k]]
        assert nearest == pytest.approx(min(ahead)) and nearest > 0
        inside = cloud.used + k
        assert find_inner(view, w, ring, k, inside)
        cut = Cut(w, k, ring, outer, cloud.used + np.arange(k), inside, axis, nearest)
        assert shortest_part(view, cut) == pytest.approx(0.5 * min(ahead) / max(ahead))
        for j in range(k):
            proven = [put_new(view, cut, j, inset_of(attempt) * shortest_part(view, cut)) for attempt in range(INSETS)]
            rows = view.originals.reshape(-1, 3)
            beside = (ring[(j + 1) % k], ring[(j - 1) % k])
            is_inside = any(exact_within(rows, w, ring[j], b, inside, cut.fresh[j]) for b in beside)
            assert proven[-1] == is_inside, points.tolist()
            put += proven[-1]
            height = np.dot(axis, difference(view.scaled, w, cut.fresh[j]))
            assert 0.4 * nearest < height < 0.8 * nearest, "deeper than half-way, by the dome at most"
    assert put > 40


def test_points_written_and_small_helpers():
    points = rng_of("written points").normal(size=(6, 3)) * 2.0**70
    cloud = Cloud(points)
    cloud.reserve(cloud.used + 1)
    view = view_of(cloud)
    write_point(view, cloud.used, Vec3(0.25, -0.5, 2.0**-30))
    assert view.scaled[-3:].tolist() == [0.25, -0.5, 2.0**-30]
    assert view.originals[-3:].tolist() == [x * 2.0**cloud.exponent for x in (0.25, -0.5, 2.0**-30)]
    assert view.work[0] > 0.0 and view.work[1] == 0.0
    assert [twos(j) for j in (0, 1, 2, 3, 12, 40)] == [40, 0, 1, 0, 2, 3]
    n = unit_normal(points.ravel(), 0, 1, 2)
    assert np.linalg.norm(n) == pytest.approx(1.0) and abs(np.dot(n, (points[1] - points[0]) / 2.0**70)) < 1e-14
    assert unit_normal(points.ravel(), 0, 0, 1) == (0.0, 0.0, 0.0)
    assert [inset_of(k + 1) / inset_of(k) for k in range(3)] == [256.0] * 3
